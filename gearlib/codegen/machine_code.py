"""A compiler for generated functions: from the small part of Python that they are written in to LLVM's intermediate language.

numba infers types for all of Python, and needs half a second for a function that has hardly any of it. Generated functions hold
numbers, flat arrays, loops over ranges and branches only. So one walk over the syntax tree is enough: every expression has one kind,
a name stands for the value that it was given last (no memory is set aside for it), and where branches or loops meet, values are
joined.

Arguments and results tell their kinds: ``float``, ``int`` (64 bits), ``int32``, and the arrays ``floats``, ``ints``, ``int32s``, of
which no bounds are checked. Functions that return ``int32`` are seen from outside. The turns of a
loop over ``parallel(n)`` do not depend on each other; where they work on neighbours in arrays they are carried out several at a time.

The meaning is Python's but for two things: a division by zero gives infinity or not-a-number, as do functions outside of their
domains, and whole numbers have 64 bits.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence
from typing import NamedTuple, cast

from gearlib.codegen.instructions import LANES, SYMBOLS, TWO_ARGUMENTS, Unsupported, Value, Writer, constant, real
from gearlib.codegen.loops import carried, grows_with, is_elementwise, is_never_empty, stored

CONSTANTS = {name: getattr(math, name) for name in ("pi", "e", "inf", "nan")}
KINDS = {"float": "double", "int": "i64", "int32": "i32", "floats": "double*", "ints": "i64*", "int32s": "i32*"}
OPERATIONS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}
COMPARISONS = {ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
LARGEST_POWER = 1 << 16  # by multiplications

Names = dict[str, Value]
Signature = tuple[tuple[str, ...], str]  # kinds of the arguments and of the result


def intermediate(source: str) -> str:
    r"""LLVM's text for a module of functions.

    Raises
    ------
    Unsupported
        Source with anything that is not compiled here.

    Examples
    --------
    >>> print(intermediate("def f(n: int, x: floats) -> float:\n    return x[n]"))
    define internal double @f(i64 %a.n, ptr %a.x) nounwind {
    start:
      %v1 = getelementptr inbounds double, ptr %a.x, i64 %a.n
      %v2 = load double, ptr %v1, align 8
      ret double %v2
    }
    <BLANKLINE>
    """
    functions = [node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef)]
    signatures = {node.name: _signature(node) for node in functions}
    declarations: dict[str, str] = {}
    texts = [_Function(node, signatures, declarations).text() for node in functions]
    return "\n".join([*texts, *declarations.values()])


def _signature(node: ast.FunctionDef) -> Signature:
    annotations = [*(argument.annotation for argument in node.args.args), node.returns]
    kinds = [KINDS.get(a.id) if isinstance(a, ast.Name) else None for a in annotations]
    known = tuple(kind for kind in kinds if kind is not None)
    if len(known) < len(kinds):
        raise Unsupported(f"line {node.lineno}: `{node.name}` must tell the kinds of its arguments and of its result")
    return known[:-1], known[-1]


def _refusal(node: ast.AST) -> Unsupported:
    return Unsupported(f"`{ast.unparse(node)}` is not in the language of generated functions")


class _Turns(NamedTuple):
    """A name that a loop hands on: its value before the loop, and at the beginning of each turn."""

    name: str
    first: Value
    value: Value


class _Range(NamedTuple):
    """Of a loop; ``begun`` where there is a turn in any case."""

    first: Value
    last: Value
    step: int
    begun: bool


class _Function:
    """One function on its way. ``names`` is None where control never comes."""

    def __init__(self, node: ast.FunctionDef, signatures: dict[str, Signature], declarations: dict[str, str]) -> None:
        self.node, self.signatures = node, signatures
        kinds, self.result = signatures[node.name]
        self.write = Writer(declarations)
        self.loops: list[tuple[str, list[tuple[str, Names]]]] = []  # where ``break`` leads to, and from where
        self.lane = ""  # the name that runs over several neighbours at a time
        self.arguments = [(a.arg, Value(f"%a.{a.arg}", kind)) for a, kind in zip(node.args.args, kinds, strict=True)]
        self.names: Names | None = dict(self.arguments)

    def text(self) -> str:
        self.write.start("start")
        self.carry_out(self.node.body)
        if self.names is not None:
            raise Unsupported(f"`{self.node.name}` must end with a return")
        linkage, arguments = "" if self.result == "i32" else "internal ", ", ".join(v.typed for _, v in self.arguments)
        head = f"define {linkage}{self.result} @{self.node.name}({arguments}) nounwind {{"
        return "\n".join([head, *self.write.lines, "}", ""])

    @property
    def here(self) -> Names:
        """What names stand for at a place that control comes to."""
        assert self.names is not None
        return self.names

    # ------------------------------------------------------------ statements

    def carry_out(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            if self.names is None:
                return
            try:
                self.statement(statement)
            except Unsupported as problem:
                if problem.args[0].startswith("line "):
                    raise
                raise Unsupported(f"line {statement.lineno}: {problem}") from None

    def statement(self, statement: ast.stmt) -> None:
        if isinstance(statement, ast.Assign) and len(statement.targets) == 1:
            self.assign(statement.targets[0], statement.value)
        elif isinstance(statement, ast.AugAssign):
            self.change(statement)
        elif isinstance(statement, ast.For) and isinstance(statement.target, ast.Name) and not statement.orelse:
            self.repeat(statement, statement.target.id)
        elif isinstance(statement, ast.If):
            self.choose(statement)
        elif isinstance(statement, ast.Return) and statement.value is not None:
            result = self.value(statement.value)
            if self.result == "i32":
                result = self.write.converted(result, "i64")
            self.write.lines.append(f"  ret {self.write.converted(result, self.result).typed}")
            self.names = None
        elif isinstance(statement, ast.Break) and self.loops:
            self.leave(*self.loops[-1])
        elif not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)):  # a docstring
            raise _refusal(statement)

    def assign(self, target: ast.expr, value: ast.expr) -> None:
        if not isinstance(target, ast.Tuple):
            self.store(target, self.value(value))
        elif isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts):
            for part, result in zip(target.elts, [self.value(v) for v in value.elts], strict=True):
                self.store(part, result)
        else:
            raise _refusal(value)

    def store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self.here[target.id] = value
        elif isinstance(target, ast.Subscript):
            self.write.store(self.place(target), value)
        else:
            raise _refusal(target)

    def change(self, statement: ast.AugAssign) -> None:
        target, operation = statement.target, OPERATIONS.get(type(statement.op))
        if operation is None:
            raise _refusal(statement)
        if isinstance(target, ast.Subscript):
            place = self.place(target)
            self.write.store(place, self.write.operated(operation, self.write.load(place), self.value(statement.value)))
        else:
            self.store(target, self.write.operated(operation, self.value(target), self.value(statement.value)))

    def choose(self, statement: ast.If) -> None:
        """One branch of many; they may be more than recursion could follow."""
        end, rest = self.write.new(), cast(list[ast.stmt], [statement])
        coming: list[tuple[str, Names]] = []
        while len(rest) == 1 and isinstance(rest[0], ast.If):
            yes, no = self.write.new(), self.write.new()
            self.branch(rest[0].test, yes, no)
            before = self.here
            self.write.start(yes)
            self.names = dict(before)
            self.carry_out(rest[0].body)
            self.leave(end, coming)
            self.write.start(no)
            self.names, rest = before, rest[0].orelse
        self.carry_out(rest)
        self.leave(end, coming)
        self.join(end, coming)

    def leave(self, end: str, coming: list[tuple[str, Names]]) -> None:
        """Go to a block that others lead to as well, if control comes here."""
        if self.names is not None:
            coming.append((self.write.block, self.names))
            self.write.go(end)
            self.names = None

    def join(self, block: str, coming: Sequence[tuple[str, Names]]) -> None:
        """Begin a block that others lead to. A name keeps its meaning if it has one, of one kind, in all of them."""
        self.names = None
        if not coming:
            return
        self.write.start(block)
        first, others = coming[0][1], [names for _, names in coming[1:]]
        joined = {}
        for name, value in first.items():
            found = [value, *(names[name] for names in others if name in names)]
            if len(found) == len(coming) and all(v.kind == value.kind for v in found):
                ways = [(v, b) for v, (b, _) in zip(found, coming, strict=True)]
                joined[name] = value if all(v == value for v in found) else self.write.phi(ways)
        self.names = joined

    # ------------------------------------------------------------ loops

    def repeat(self, statement: ast.For, target: str) -> None:
        call = statement.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in ("range", "parallel")):
            raise _refusal(call)
        bounds = [self.value(a) for a in call.args]
        step = bounds[2].whole if len(bounds) == 3 else 1
        if not step or not bounds or any(b.kind != "i64" for b in bounds):
            raise _refusal(call)
        first, last = (constant(0), bounds[0]) if len(bounds) == 1 else bounds[:2]
        together = call.func.id == "parallel" and step == 1 and is_elementwise(statement, target)
        if together:
            many = self.write.operated("sub", last, constant(LANES - 1))
            self.lane = target
            first = self.loop(statement, target, _Range(first, many, LANES, False))
            self.lane = ""
        self.loop(statement, target, _Range(first, last, step, not together and is_never_empty(call)))

    def loop(self, statement: ast.For, target: str, over: _Range) -> Value:
        """First the test whether there is a turn; then the body, with the test for another turn at its end. Returns how far it came."""
        body, end, test = self.write.new(), self.write.new(), "<" if over.step > 0 else ">"
        before, coming = self.here, []
        if over.begun:
            self.write.go(body)
        else:
            self.write.fork(self.write.compared(test, over.first, over.last), body, end)
            coming.append((self.write.block, before))
        entry = self.write.block
        self.write.start(body)
        names = [name for name in sorted(carried(statement)) if name in before]
        turns = [_Turns(target, over.first, Value(f"%{self.write.new()}", "i64"))]
        turns += [_Turns(name, before[name], Value(f"%{self.write.new()}", before[name].kind)) for name in names]
        head, anew = len(self.write.lines), stored(statement.body)
        self.names = {n: v for n, v in before.items() if n not in anew} | {turn.name: turn.value for turn in turns}
        self.loops.append((end, []))
        self.carry_out(statement.body)
        late: list[Value] = []
        if self.names is not None:
            late = [self.write.operated("add", turns[0].value, constant(over.step)), *(self.again(turn) for turn in turns[1:])]
            self.write.fork(self.write.compared(test, late[0], over.last), body, end)
            coming.append((self.write.block, self.here))
        for k, (_, early, value) in enumerate(turns):
            back = f", [ {late[k].text}, %{self.write.block} ]" if late else ""
            self.write.lines.insert(head, f"  {value.text} = phi {value.kind} [ {early.text}, %{entry} ]{back}")
        self.join(end, [*coming, *self.loops.pop()[1]])
        return self.write.phi([(over.first, entry), (late[0], coming[-1][0])]) if self.lane else over.first

    def again(self, turn: _Turns) -> Value:
        late = self.here.get(turn.name)
        if late is None or late.kind != turn.value.kind:
            raise Unsupported(f"`{turn.name}` is of one kind before the loop and of another in it")
        return late

    # ------------------------------------------------------------ expressions

    def value(self, node: ast.expr) -> Value:
        if isinstance(node, ast.Constant):
            return constant(node.value)
        if isinstance(node, ast.Name):
            return self.named(node.id)
        if isinstance(node, ast.Subscript):
            return self.write.load(self.place(node))
        if isinstance(node, ast.BinOp):
            return self.power(node) if isinstance(node.op, ast.Pow) else self.operations(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return self.write.negative(self.value(node.operand))
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return self.write.emit(f"xor {self.write.truth(self.value(node.operand)).typed}, true", "i1")
        if isinstance(node, ast.Compare):
            return self.compared(node)
        if isinstance(node, ast.IfExp):
            return self.chosen(node)
        if isinstance(node, ast.BoolOp):
            return self.conditions(node)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            return self.called(node.func.id, [self.value(a) for a in node.args])
        raise _refusal(node)

    def named(self, name: str) -> Value:
        if name not in self.here and name not in CONSTANTS:
            raise Unsupported(f"`{name}` has no value there, or values of two kinds")
        return self.here[name] if name in self.here else real(CONSTANTS[name])

    def place(self, node: ast.Subscript) -> Value:
        laned = bool(self.lane) and grows_with(node.slice, self.lane)
        return self.write.at(self.value(node.value), self.value(node.slice), laned)

    def operations(self, node: ast.BinOp) -> Value:
        """A sum may have thousands of terms, and a syntax tree as deep; so it is not climbed by recursion."""
        pending: list[ast.BinOp] = []
        first: ast.expr = node
        while isinstance(first, ast.BinOp) and not isinstance(first.op, ast.Pow):
            pending.append(first)
            first = first.left
        result = self.value(first)
        for outer in reversed(pending):
            if type(outer.op) not in OPERATIONS:
                raise _refusal(outer)
            result = self.write.operated(OPERATIONS[type(outer.op)], result, self.value(outer.right))
        return result

    def power(self, node: ast.BinOp) -> Value:
        base, exponent = self.value(node.left), self.value(node.right)
        if exponent.whole is not None and abs(exponent.whole) <= LARGEST_POWER:
            return self.write.power(base, exponent.whole)
        return self.write.called("pow", [base, exponent])

    def compared(self, node: ast.Compare) -> Value:
        if len(node.ops) > 1:  # what is compared twice has no effects
            sides = [node.left, *node.comparators]
            pairs: list[ast.expr] = [ast.Compare(a, [o], [b]) for a, o, b in zip(sides, node.ops, sides[1:])]
            return self.conditions(ast.BoolOp(ast.And(), pairs))
        if type(node.ops[0]) not in COMPARISONS:
            raise _refusal(node)
        return self.write.compared(COMPARISONS[type(node.ops[0])], self.value(node.left), self.value(node.comparators[0]))

    def branch(self, test: ast.expr, yes: str, no: str) -> None:
        """Go to one of two blocks; what need not be looked at for that is not."""
        if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
            self.branch(test.operand, no, yes)
        elif isinstance(test, ast.BoolOp):
            for part in test.values[:-1]:
                following = self.write.new()
                self.branch(part, *((following, no) if isinstance(test.op, ast.And) else (yes, following)))
                self.write.start(following)
            self.branch(test.values[-1], yes, no)
        else:
            self.write.fork(self.write.truth(self.value(test)), yes, no)

    def chosen(self, node: ast.IfExp) -> Value:
        """One of several values; the others are not computed."""
        end, rest = self.write.new(), cast(ast.expr, node)
        coming: list[tuple[Value, str]] = []
        while isinstance(rest, ast.IfExp):
            yes, no = self.write.new(), self.write.new()
            self.branch(rest.test, yes, no)
            self.write.start(yes)
            coming.append((self.value(rest.body), self.write.block))
            self.write.go(end)
            self.write.start(no)
            rest = rest.orelse
        coming.append((self.value(rest), self.write.block))
        self.write.go(end)
        self.write.start(end)
        if len({value.kind for value, _ in coming}) > 1:
            if any(value.whole is None and value.kind != "double" for value, _ in coming):
                raise _refusal(node)
            coming = [
                (self.write.converted(value, "double"), block) for value, block in coming
            ]  # of constants: no instructions
        return self.write.phi(coming)

    def conditions(self, node: ast.BoolOp) -> Value:
        """Conditions, one after the other as long as they do not decide it."""
        end, coming, both = self.write.new(), [], isinstance(node.op, ast.And)
        for part in node.values:
            value, following = self.value(part), self.write.new()
            if value.kind != "i1":
                raise _refusal(node)
            if part is node.values[-1]:
                coming.append((value, self.write.block))
                self.write.go(end)
            else:
                coming.append((constant(not both), self.write.block))
                self.write.fork(value, *((following, end) if both else (end, following)))
                self.write.start(following)
        self.write.start(end)
        return self.write.phi(coming)

    def called(self, name: str, values: list[Value]) -> Value:
        kinds, result = self.signatures.get(name, ((), "i32"))
        if result != "i32" and len(kinds) == len(values):
            given = [self.write.converted(value, kind).typed for value, kind in zip(values, kinds, strict=True)]
            return self.write.emit(f"call {result} @{name}({', '.join(given)})", result)
        if name in ("max", "min") and len(values) > 1:
            return self.write.extreme(">" if name == "max" else "<", values)
        if len(values) == 1 and name == "int":
            return self.write.truncated(values[0])
        if name in SYMBOLS and len(values) == 1 + (name in TWO_ARGUMENTS):
            return self.write.called(name, values)
        raise Unsupported(f"`{name}` with {len(values)} arguments is no function that can be compiled")
