"""Evaluation of Modelica expressions to numbers, choices and component expressions; no text is passed to another interpreter."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from gearlib.errors import AttributeNameError, GearlibError, ModelicaError, nearest
from gearlib.language import expressions as language
from gearlib.language.component import Component, Port
from gearlib.language.declarations import Connector, Declaration, Derivative, Discrete, Variable, declared_by
from gearlib.modelica.counterparts import ModelicaClass, array_in, local_name, names_in
from gearlib.modelica.element_types import TypeKind, check_type, type_named
from gearlib.modelica.scopes import ClassScope, lookup
from gearlib.modelica.si_types import constant_named, conversion_named
from gearlib.modelica.syntax_tree import (
    ArrayNode,
    CallNode,
    ChoiceNode,
    ComponentNode,
    ComprehensionNode,
    GivenNode,
    NumberNode,
    OperationNode,
    RangeNode,
    ReferenceNode,
    StringNode,
    SyntaxNode,
    TruthNode,
)

_FUNCTIONS: Mapping[str, tuple[Callable[..., Any], Callable[..., float], int]] = {
    "sin": (language.sin, math.sin, 1), "cos": (language.cos, math.cos, 1), "tan": (language.tan, math.tan, 1),
    "asin": (language.asin, math.asin, 1), "acos": (language.acos, math.acos, 1), "atan": (language.atan, math.atan, 1),
    "atan2": (language.atan2, math.atan2, 2), "sinh": (language.sinh, math.sinh, 1), "cosh": (language.cosh, math.cosh, 1),
    "tanh": (language.tanh, math.tanh, 1), "exp": (language.exp, math.exp, 1), "log": (language.log, math.log, 1),
    "sqrt": (language.sqrt, math.sqrt, 1),
    "log10": (lambda x: language.log(x) / math.log(10.0), math.log10, 1),
    "abs": (abs, abs, 1), "sign": (language.sign, lambda x: (x > 0) - (x < 0), 1),
    "min": (language.Min, lambda *values: min(values), 2), "max": (language.Max, lambda *values: max(values), 2),
}  # fmt: skip
_WITHOUT_EVENTS = ("abs", "sign", "min", "max")  # as in Modelica; gearlib's versions raise events by themselves
_OF_NUMBERS: Mapping[str, tuple[Callable[..., Any], int]] = {
    "integer": (math.floor, 1), "floor": (math.floor, 1), "ceil": (math.ceil, 1), "mod": (lambda x, y: x - math.floor(x / y) * y, 2),
    "div": (lambda x, y: math.trunc(x / y), 2), "rem": (lambda x, y: x - math.trunc(x / y) * y, 2), "size": (lambda x, k: _size(x, k), 2),
    "zeros": (lambda n: (0.0,) * n, 1), "ones": (lambda n: (1.0,) * n, 1), "fill": (lambda v, n: (v,) * n, 2),
    "linspace": (lambda a, b, n: tuple(a + (b - a) * k / (n - 1) for k in range(n)), 3),
}  # fmt: skip
_OF_THEIR_ARGUMENTS = ("abs", "min", "max", "mod", "div", "rem", "sum", "product", "pre", "noEvent", "fill")  # as for the type
_RELATIONS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
_LOGICAL = ("and", "or", "not")


class Absent(ModelicaError):
    """A component or connector whose condition is false."""

    def __init__(self, node: ReferenceNode) -> None:
        super().__init__(f"{node.at}: {node} is absent, since its condition is false; only connections may name it")


def _size(x: Any, k: int) -> int:
    return len(x) if k == 1 else _size(x[0], k - 1)


@dataclass(frozen=True)
class Evaluation:
    """Context for the evaluation of an expression: a component of the class that contains it, or the class alone.

    Parameters
    ----------
    scope : ClassScope
        Scope in the text, for names of constants.
    component : Component or None
        Its variables, parameters and parts are what names stand for; None: constants only.
    constants : mapping of str to SyntaxNode
        Values of constants, and of structural choices that are not given.
    conditional : frozenset of str
        Parts that exist conditionally.
    indices : mapping of str to int
        Indices of the enclosing loops.
    of_parameters : bool
        Whether the value is one of a parameter, so that it is constant.
    types : mapping of str to str
        Types of the elements of the class.
    """

    scope: ClassScope
    component: Component | None = None
    constants: Mapping[str, SyntaxNode] = field(default_factory=dict)
    conditional: frozenset[str] = frozenset()
    indices: Mapping[str, int] = field(default_factory=dict)
    of_parameters: bool = False
    types: Mapping[str, TypeKind] = field(default_factory=dict)

    def at_index(self, index: str, value: int) -> Evaluation:
        """The same context within a loop."""
        return replace(self, indices={**self.indices, index: value})

    # ------------------------------------------------------------ values

    def number(self, node: SyntaxNode) -> Any:
        """A number, an expression, or a tuple of them; a condition becomes 1 or 0."""
        found = self.value(node)
        if isinstance(found, str):
            raise ModelicaError(f"{node.at}: '{found}' is a string; expected a number")
        if isinstance(found, bool):
            return int(found)
        if _is_condition(found):
            return language.value_of(found)
        return found

    def value(self, node: SyntaxNode) -> Any:
        """A number, Boolean, string, expression, condition, component, port, or a tuple of these."""
        try:
            with node.at.in_refusals():
                return self._value(node)
        except (GearlibError, RecursionError):
            raise
        except ZeroDivisionError:
            raise ModelicaError(f"{node.at}: a division by zero") from None
        except (ArithmeticError, LookupError, TypeError, ValueError) as problem:
            raise ModelicaError(f"{node.at}: this cannot be evaluated: {problem}") from None

    def _value(self, node: SyntaxNode) -> Any:
        match node:
            case NumberNode() | StringNode() | TruthNode():
                return node.value
            case ReferenceNode():
                return self.reference(node)
            case GivenNode():
                return getattr(self.component, node.name)
            case OperationNode():
                return self._operation(node)
            case ChoiceNode():
                return self._choice(node)
            case CallNode():
                return self._call(node)
            case ArrayNode():
                return tuple(map(self.value, node.items))
            case RangeNode():
                return self.range(node)
            case ComprehensionNode():
                return tuple(self.at_index(node.index, k).value(node.value) for k in self.range(node.range))
        raise ModelicaError(f"{node.at}: this expression is not supported")

    def constant(self, node: SyntaxNode, expected: str = "a constant") -> Any:
        """A value that must be known at translation."""
        found = self.value(node)
        if not _is_constant(found):
            raise ModelicaError(f"{node.at}: this has to be {expected}, known when the model is built; it depends on {found}")
        return found

    def range(self, node: SyntaxNode) -> tuple[int, ...]:
        """The values of a loop index."""
        if not isinstance(node, RangeNode):
            found = self.constant(node, "a range such as 1:n")
            if isinstance(found, tuple):
                return found
            raise ModelicaError(f"{node.at}: expected a range, such as 1:n")
        if node.first is None or node.last is None:
            raise ModelicaError(f"{node.at}: a bare colon is not supported here; give both ends")
        ends = [self.constant(n, "a whole number") for n in (node.first, node.step or NumberNode(node.at, 1), node.last)]
        first, step, last = (int(e) if isinstance(e, (int, float)) and float(e).is_integer() else None for e in ends)
        if first is None or step is None or last is None or step == 0:
            raise ModelicaError(f"{node.at}: expected whole numbers, as in 1:n")
        return tuple(range(first, last + (1 if step > 0 else -1), step))

    # ------------------------------------------------------------ names

    def reference(self, node: ReferenceNode) -> Any:
        """The object that a name with its subscripts denotes."""
        first = node.names[0]
        if len(node.names) == 1 and first in self.indices:
            return self.indices[first]
        if node.names == ("time",):
            return language.time
        if self.component is not None and has(self.component, first):
            found: Any = self.component
            for name, subscripts in zip(node.names, node.subscripts, strict=True):
                found = self._subscripted(self._member(found, name, node), subscripts, node)
            if found is None and len(node.names) == 1 and first in self.constants:
                found = self._subscripted(self._constant(first), node.subscripts[0], node)
            if found is None:
                raise ModelicaError(f"{node.at}: {node} has no value")
            return found
        if first in self.conditional:
            raise Absent(node)
        if first in self.constants:
            return self._subscripted(replace(self, indices={})._constant(first), node.subscripts[0], node)
        return self._constant_of_class(node)

    def _constant(self, name: str) -> Any:
        found = self.value(self.constants[name])
        check_type(found, self.types.get(name), self.constants[name])
        return found

    def check_assigned(self, name: str, node: SyntaxNode) -> None:
        """Refuse an expression that is Real by its form for what is declared as Integer or Boolean."""
        kind = self.types.get(name)
        if kind in ("integer", "boolean") and self._is_real(node):
            form = "integer() or div(), for a quotient is Real also of Integers" if kind == "integer" else "a condition"
            raise ModelicaError(f"{node.at}: a Real expression is given to '{name}'; expected {form}")

    def _is_real(self, node: SyntaxNode) -> bool:
        """Whether an expression is Real by its form in Modelica; what other components declare is not known."""
        match node:
            case NumberNode():
                return isinstance(node.value, float)
            case OperationNode():
                sign = node.operator.removeprefix(".")
                return sign in ("/", "^") or (sign in ("+", "-", "*") and any(map(self._is_real, node.operands)))
            case ChoiceNode():
                return any(map(self._is_real, (*(value for _, value in node.branches), node.otherwise)))
            case ArrayNode():
                return any(map(self._is_real, node.items))
            case CallNode():
                if node.function in _OF_THEIR_ARGUMENTS:
                    return any(map(self._is_real, node.arguments))
                return node.function in ("floor", "ceil", "der") or (node.function in _FUNCTIONS and node.function != "sign")
            case ReferenceNode() if len(node.names) == 1:
                return node.names == ("time",) or self.types.get(node.names[0]) == "real"
        return False

    def _constant_of_class(self, node: ReferenceNode) -> Any:
        """A constant of an enclosing class, another class or the library; or an enumeration literal."""
        for level in self.scope.upwards() if len(node.names) == 1 else ():
            if (found := _constant_in(level, node.names[0])) is not None:
                return _of_its_type(found, level)
        place = lookup(node.names[:-1], self.scope) if len(node.names) > 1 else node.names
        if isinstance(place, ClassScope):
            if (found := _constant_in(place, node.names[-1])) is not None:
                return _of_its_type(found, place)
            if node.names[-1] in place.node.literals:
                return node.names[-1]
        full = lookup(node.names, self.scope)
        if isinstance(full, tuple):
            if (number := constant_named(".".join(full))) is not None:
                return number
            if full[0] == "Modelica" and "Types" in full:
                return full[-1]
            if full[0] in ("StateSelect", "AssertionLevel") and len(full) == 2:
                return full[1]
        valid = [] if self.component is None else [*declared_names(self.component), *self.constants]
        raise ModelicaError(f"{node.at}: nothing is called '{node}' here; {nearest(node.names[0], valid)}")

    def _member(self, owner: Any, name: str, node: ReferenceNode) -> Any:
        if isinstance(owner, tuple):
            return tuple(self._member(each, name, node) for each in owner)
        if isinstance(owner, Component):
            array = array_in(type(owner), name)
            if isinstance(array, tuple):
                return tuple(getattr(owner, signal) for signal in array)
            if array is not None:
                family, _, variable = array.partition(".")
                return tuple(getattr(part, variable) for part in getattr(owner, family))
            local = name_within(owner, name)
            declared = getattr(type(owner), local, None)
            if isinstance(declared, Connector) and local not in declared_by(owner).connectors:
                raise Absent(node)
            try:
                found = getattr(owner, local)
            except AttributeNameError as problem:
                raise ModelicaError(f"{node.at}: {problem}") from None
            return tuple(found) if isinstance(found, list) else found
        if isinstance(owner, Port):
            return getattr(owner, name)
        raise ModelicaError(f"{node.at}: {node} is not supported: what stands before '.{name}' is not a component")

    def _subscripted(self, value: Any, subscripts: tuple[SyntaxNode, ...], node: ReferenceNode) -> Any:
        for subscript in subscripts:
            if isinstance(subscript, RangeNode) and subscript.first is None:
                continue
            index = self.range(subscript) if isinstance(subscript, RangeNode) else self.constant(subscript, "an index")
            indices = index if isinstance(index, tuple) else (index,)
            if not isinstance(value, tuple):
                raise ModelicaError(f"{node.at}: {node} is not an array")
            if not all(isinstance(k, int) and 1 <= k <= len(value) for k in indices):
                raise ModelicaError(f"{node.at}: the index of {node} is {index}; expected 1 to {len(value)}")
            value = tuple(value[k - 1] for k in indices) if isinstance(index, tuple) else value[index - 1]
        return value

    def declaration(self, node: ReferenceNode) -> Declaration | None:
        """The declaration of a variable by its name; None if no component declares it."""
        owner: Any = self.component
        for name, subscripts in zip(node.names[:-1], node.subscripts[:-1], strict=True):
            owner = (
                self._subscripted(self._member(owner, name, node), subscripts, node) if isinstance(owner, Component) else owner
            )
        if isinstance(owner, Port):
            return owner.connector.variables.get(node.names[-1])
        if not isinstance(owner, Component):
            return None
        found = getattr(type(owner), name_within(owner, node.names[-1]), None)
        return found if isinstance(found, Declaration) else None

    # ------------------------------------------------------------ conditions

    def condition(self, node: SyntaxNode) -> Any:
        """A condition, or a Boolean if it is known."""
        found = self.value(node)
        if isinstance(found, bool) or _is_condition(found):
            return bool(found) if found in (True, False) else found
        if isinstance(node, (ReferenceNode, CallNode)) and not isinstance(found, (tuple, str, float)):
            target = node if isinstance(node, ReferenceNode) else next(iter(node.arguments), None)
            declared = self.declaration(target) if isinstance(target, ReferenceNode) else None
            if isinstance(declared, Discrete):
                return language.holds(found)
            if isinstance(declared, Declaration) and not isinstance(declared, Derivative):
                return found > 0.5
        raise ModelicaError(f"{node.at}: expected a condition, such as w > 0")

    def _choice(self, node: ChoiceNode) -> Any:
        branches: list[tuple[Any, Any]] = []
        quiet = all(isinstance(c, CallNode) and c.function == "noEvent" for c, _ in node.branches)
        for condition, value in node.branches:
            decided = self.condition(condition)
            if decided is True:
                if not branches:
                    return self.value(value)
                branches.append((self.number(value), True))
                break
            if decided is not False:
                branches.append((self.number(value), decided))
        else:
            if not branches:
                return self.value(node.otherwise)
            branches.append((self.number(node.otherwise), True))
        return self._quiet(language.Piecewise(*branches), quiet)

    def _quiet(self, found: Any, quiet: bool = True) -> Any:
        """Without events, if so wanted; a parameter has none."""
        return language.no_event(found) if quiet and not self.of_parameters else found

    # ------------------------------------------------------------ operators and functions

    def _operation(self, node: OperationNode) -> Any:
        sign = node.operator
        if sign in _LOGICAL:
            parts = [self.condition(operand) for operand in node.operands]
            if sign == "not":
                return not parts[0] if isinstance(parts[0], bool) else language.Not(parts[0])
            decisive = sign == "or"
            if decisive in [p for p in parts if isinstance(p, bool)]:
                return decisive
            parts = [p for p in parts if not isinstance(p, bool)]
            if len(parts) < 2:
                return parts[0] if parts else not decisive
            return (language.Or if decisive else language.And)(*parts)
        values = [self.value(operand) for operand in node.operands]
        if sign in ("==", "<>"):
            same = self._equal(values, node)
            return same if sign == "==" else (not same if isinstance(same, bool) else language.Not(same))
        values = [self.number(operand) for operand in node.operands]
        if any(isinstance(v, tuple) for v in values):
            return self._elementwise(sign.removeprefix("."), values, node)
        if sign in _RELATIONS:
            found = _RELATIONS[sign](*values)
            return bool(found) if found in (True, False) else found
        return _arithmetic(sign.removeprefix("."), values)

    def _equal(self, values: list[Any], node: OperationNode) -> Any:
        if all(map(_is_constant, values)):
            return values[0] == values[1]
        numbers = [
            language.value_of(self.condition(operand)) if isinstance(value, bool) or _is_condition(value) else value
            for operand, value in zip(node.operands, values, strict=True)
        ]
        if isinstance(numbers[0], (int, float)):
            numbers.reverse()
        return language.equals(*numbers)

    def _elementwise(self, sign: str, values: list[Any], node: OperationNode) -> Any:
        sizes = {len(v) for v in values if isinstance(v, tuple)}
        both = all(isinstance(v, tuple) for v in values)
        unusual = sign in _RELATIONS or (both and sign in "*/^" and not node.operator.startswith("."))
        if len(sizes) != 1 or unusual:
            raise ModelicaError(f"{node.at}: arrays of these sizes are not supported with '{node.operator}'")
        count = sizes.pop()
        columns = [v if isinstance(v, tuple) else (v,) * count for v in values]
        return tuple(
            self._elementwise(sign, list(row), node) if any(isinstance(r, tuple) for r in row) else _arithmetic(sign, list(row))
            for row in zip(*columns, strict=True)
        )

    def _call(self, node: CallNode) -> Any:
        full = lookup(tuple(node.function.split(".")), self.scope)  # a name of the text hides a built-in function
        if isinstance(full, ClassScope):
            raise ModelicaError(f"{node.at}: user-defined functions, such as {node.function}, are not supported")
        path = ".".join(full)
        if path in ("noEvent", "smooth", "homotopy", "der", "pre", "edge", "change", "initial", "sample", "semiLinear"):
            return self._operator_function(path, node)
        if (conversion := conversion_named(path)) is not None:
            (x,) = self._arguments(node, 1)
            factor, offset = conversion
            return x * factor + offset if offset else x * factor
        name = path.removeprefix("Modelica.Math.")
        if node.named:
            raise ModelicaError(f"{node.at}: {node.function}: arguments by name are not supported")
        if name in _FUNCTIONS:
            ours, of_numbers, count = _FUNCTIONS[name]
            if name in ("min", "max") and len(node.arguments) == 1:
                (values,) = self._arguments(node, 1)
                values = values if isinstance(values, tuple) else (values,)
            else:
                values = self._arguments(node, count)
            if all(isinstance(v, (int, float)) for v in values):
                return of_numbers(*values)
            found = ours(*values)
            return self._quiet(found, name in _WITHOUT_EVENTS)
        if name in _OF_NUMBERS:
            function, count = _OF_NUMBERS[name]
            values = self._arguments(node, count)
            if not _is_constant(tuple(v for v in values if not isinstance(v, tuple))):
                raise ModelicaError(
                    f"{node.at}: {name}() is read of numbers known when the model is built only; got {values[0]}"
                )
            return function(*values)
        if name in ("sum", "product"):
            (values,) = self._arguments(node, 1)
            total: Any = 0 if name == "sum" else 1
            for v in values if isinstance(values, tuple) else (values,):
                total = _arithmetic("+" if name == "sum" else "*", [total, v])
            return total
        raise ModelicaError(
            f"{node.at}: the function {node.function}() is not supported; {nearest(name, [*_FUNCTIONS, *_OF_NUMBERS])}"
        )

    def _operator_function(self, name: str, node: CallNode) -> Any:
        count = {"smooth": 2, "initial": 0, "sample": 2, "semiLinear": 3}.get(name, 1)
        arguments = node.arguments
        if name == "homotopy":
            actual = dict(node.named).get("actual", arguments[0] if arguments else None)
            if actual is None:
                raise ModelicaError(f"{node.at}: homotopy() without its actual value")
            return self.value(actual)
        if len(arguments) != count:
            raise ModelicaError(f"{node.at}: {name}() takes {count} arguments, got {len(arguments)}")
        if name == "initial":
            return language.initial()
        if name == "smooth":
            return self.value(arguments[1])
        if name == "sample":
            first, period = (self.number(a) for a in arguments)
            return language.sample(period, first)
        if name == "semiLinear":
            above, below = (OperationNode(node.at, "*", (a, arguments[0])) for a in arguments[1:])
            positive = OperationNode(node.at, ">=", (arguments[0], NumberNode(node.at, 0)))
            return self._choice(ChoiceNode(node.at, ((positive, above),), below))
        (of,) = arguments
        x = self.value(of)
        if name == "noEvent":
            return x if isinstance(x, (bool, int, float)) or _is_condition(x) else self._quiet(x)
        if name == "der":
            return 0 if isinstance(x, (int, float)) else language.der(x)
        if name == "pre":  # of a continuous variable: its left limit, which actions of When see
            declared = self.declaration(of) if isinstance(of, ReferenceNode) else None
            return x if isinstance(declared, (Variable, Derivative)) else language.pre(x)
        before = language.pre(x)
        if name == "change":
            return language.Not(language.equals(x, before))
        return language.And(language.holds(x), language.Not(language.holds(before)))

    def _arguments(self, node: CallNode, count: int) -> list[Any]:
        if len(node.arguments) != count:
            raise ModelicaError(f"{node.at}: {node.function}() takes {count} arguments, got {len(node.arguments)}")
        return [self.number(a) for a in node.arguments]


def has(component: Component, name: str) -> bool:
    """Whether a component declares a name, or has such a part already."""
    local = name_within(component, name)
    return isinstance(getattr(type(component), local, None), Declaration) or local in vars(component)


def name_within(component: Component, name: str) -> str:
    """Component name of a part or declaration that the text refers to; only the library spells names in another way."""
    kind = type(component)
    local = name if name in vars(component) else local_name(kind, names_in(kind), name)
    library = [base for base in kind.__mro__ if not isinstance(base, ModelicaClass)]
    return local if kind in library or any(local in vars(base) for base in library) else name


def declared_names(component: Component) -> list[str]:
    """Names of a component's declarations and parts."""
    own = [n for kind in type(component).__mro__ for n, d in vars(kind).items() if isinstance(d, Declaration)]
    return own + [n for n in vars(component) if not n.startswith("_")]


def _arithmetic(sign: str, values: list[Any]) -> Any:
    if len(values) == 1:
        return -values[0] if sign == "-" else values[0]
    a, b = values
    match sign:
        case "+":
            return a + b
        case "-":
            return a - b
        case "*" if isinstance(a, int) and isinstance(b, int):
            return a * b
        case "*" | "/":  # integer factors may carry a unit, as in 5 * w
            a, b = (float(v) if isinstance(v, int) else v for v in (a, b))
            return a * b if sign == "*" else a / b
    if isinstance(a, (int, float)) and isinstance(b, (int, float)):
        return math.pow(a, b)
    if isinstance(b, float) and b * 2 == int(b * 2):
        b = language.as_number(Fraction(b), "an exponent")
    return a**b


def _of_its_type(element: ComponentNode, level: ClassScope) -> Any:
    assert element.value is not None
    found = Evaluation(level).value(element.value)
    check_type(found, type_named(element.type, level, element).kind, element.value)
    return found


def _constant_in(level: ClassScope, name: str) -> ComponentNode | None:
    """A constant declared in a class."""
    for element in level.node.elements:
        if isinstance(element, ComponentNode) and element.name == name and element.prefixes & {"constant", "parameter"}:
            return element if "constant" in element.prefixes and element.value is not None else None
    return None


def _is_constant(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_constant, value))
    return isinstance(value, (bool, int, float, str))


def _is_condition(value: Any) -> bool:
    """Whether it is a comparison, or a combination of them; symbols are not."""
    try:
        language.as_condition(value, "a condition")
    except GearlibError:
        return False
    return True
