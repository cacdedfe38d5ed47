"""A compiler for the small language: the part of Python that generated functions and integration loops are written in, to LLVM's
intermediate language.

The language has numbers, flat arrays, records, loops and branches only. So a single pass over the syntax tree suffices: every
expression has one type, a name stands for the value last assigned to it (static single assignment; no stack slots), and where branches
or loops meet, values are joined by phi nodes.

Arguments and results declare their types: ``float``, ``int`` (64 bits), ``int32``, ``bool``, ``None``, a tuple of these, the arrays
``floats``, ``ints``, ``int32s`` (without bounds checks), and records (subclasses of `ctypes.Structure` whose fields are ``c_int64`` and
``c_double``). An address is an ``int``; ``floats_at(address)``, ``ints_at(address)``, ``int32s_at(address)`` and ``Record(address)``
dereference it, and a `Prototype` of the environment calls the C function at an address. Functions that return ``int32`` are exported.

A loop over ``parallel(n)`` has independent iterations; where they access consecutive array elements they are vectorised. A loop over
``blocks(n)`` processes `BLOCK` elements at a time, of arrays whose length is a nonzero multiple of it: what is indexed by the loop
variable is a vector, ``total(v)`` its sum, ``where(c, a, b)`` a select, and ``one_by_one(x, i)`` loads elements that were just stored
one by one.

A ``lane`` is a SIMD vector of `LANES` numbers, one of each of as many simultaneous runs, and ``lanes`` an array of such vectors.
Arithmetic, comparisons and functions are elementwise; ``a if c else b`` evaluates both branches and selects by mask. ``any_of(c)`` is
whether a mask is true in any lane, ``both(c, d)`` and ``either(c, d)`` combine masks, ``in_lanes(x)`` broadcasts a number. A function
``sin_of_lanes`` of the module replaces the C library's ``sin`` for lanes.

Semantics are Python's with two exceptions: a division by zero gives infinity or NaN, as do functions outside their domains, and
integers have 64 bits.
"""

from __future__ import annotations

import ast
import ctypes
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, cast

from gearlib.compiler.data_flow import carried, grows_with, is_elementwise, is_never_empty, stored
from gearlib.compiler.instructions import (
    BLOCKED,
    LANED,
    LANES,
    MASK,
    SYMBOLS,
    TWO_ARGUMENTS,
    VECTORS,
    Unsupported,
    Value,
    Writer,
    constant,
    real,
)
from gearlib.compiler.small_language import BLOCK, Environment, Prototype, fields_of, is_record

CONSTANTS = {name: getattr(math, name) for name in ("pi", "e", "inf", "nan")}
KINDS = {
    "float": "double", "int": "i64", "int32": "i32", "bool": "i1", "floats": "double*", "ints": "i64*", "int32s": "i32*",
    "lane": LANED, "lanes": f"{LANED}*",
}  # fmt: skip
ARRAYS_AT = {"floats_at": "double*", "ints_at": "i64*", "int32s_at": "i32*", "lanes_at": f"{LANED}*"}
FIELDS: dict[object, str] = {ctypes.c_int64: "i64", ctypes.c_double: "double"}
OPERATIONS = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}
COMPARISONS = {ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
LARGEST_POWER = 1 << 16  # largest exponent expanded into multiplications

Names = dict[str, Value]
Signature = tuple[tuple[str, ...], str]  # types of the arguments and of the result


def intermediate(source: str, environment: Environment | None = None, fused: bool = False) -> str:
    r"""LLVM IR for a module of functions.

    Parameters
    ----------
    source : str
    environment : mapping, optional
        Numbers, records and prototypes that the source refers to.
    fused : bool
        Whether a product and a sum of vectors may be one instruction.

    Raises
    ------
    Unsupported
        The source is outside the supported subset.

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
    functions = ((node, environment or {}) for node in ast.parse(source).body if isinstance(node, ast.FunctionDef))
    return translated(functions, fused)


def translated(functions: Iterable[tuple[ast.FunctionDef, Environment]], fused: bool = False) -> str:
    """LLVM IR for functions, each with its environment.

    ``fused`` allows fused multiply-add in vector code, which rounds once instead of twice.
    """
    functions = list(functions)
    signatures = {node.name: _signature(node, environment) for node, environment in functions}
    declarations: dict[str, str] = {}
    texts = [_Function(node, environment, signatures, Writer(declarations, fused)).text() for node, environment in functions]
    return "\n".join([*texts, *declarations.values()])


def _signature(node: ast.FunctionDef, environment: Environment) -> Signature:
    kinds = [kind_of(annotation, environment) for annotation in (*(a.annotation for a in node.args.args), node.returns)]
    known = tuple(kind for kind in kinds if kind is not None)
    if len(known) < len(kinds):
        raise Unsupported(f"line {node.lineno}: `{node.name}` must declare the kinds of its arguments and of its result")
    return known[:-1], known[-1]


def kind_of(annotation: ast.expr | None, environment: Environment) -> str | None:
    if isinstance(annotation, ast.Constant) and annotation.value is None:
        return "void"
    if isinstance(annotation, ast.Name):
        return f"{annotation.id}*" if is_record(environment.get(annotation.id)) else KINDS.get(annotation.id)
    if isinstance(annotation, ast.Subscript) and isinstance(annotation.slice, ast.Tuple):
        parts = [kind_of(part, environment) for part in annotation.slice.elts]
        return "{ " + ", ".join(part for part in parts if part is not None) + " }" if None not in parts else None
    return None


def chain(node: ast.BinOp) -> tuple[ast.expr, list[ast.BinOp]]:
    """The first operand of sums and products, and the operations from left to right: iteratively, since long sums nest as deep."""
    pending: list[ast.BinOp] = []
    first: ast.expr = node
    while isinstance(first, ast.BinOp) and not isinstance(first.op, ast.Pow):
        pending.append(first)
        first = first.left
    return first, pending[::-1]


def _refusal(node: ast.AST) -> Unsupported:
    return Unsupported(f"`{ast.unparse(node)}` is not in the language of generated functions")


class _Turns(NamedTuple):
    """A loop-carried name: its phi node, its initial value, and its value at the start of each iteration."""

    name: str
    first: Value
    value: Value


class _Range(NamedTuple):
    """Bounds of a for-loop; ``begun`` where there is at least one iteration."""

    first: Value
    last: Value
    step: int
    begun: bool


class _Exits(NamedTuple):
    """Targets of ``break`` and ``continue`` of a loop, and the blocks that branch to them."""

    end: str
    breaks: list[tuple[str, Names]]
    latch: str
    continues: list[tuple[str, Names]]


class _Function:
    """Translation of one function; ``names`` is None in unreachable code."""

    def __init__(
        self, node: ast.FunctionDef, environment: Environment, signatures: dict[str, Signature], write: Writer
    ) -> None:
        self.node, self.environment, self.signatures = node, environment, signatures
        kinds, self.result = signatures[node.name]
        self.write = write
        self.loops: list[_Exits] = []
        self.lane, self.vector = "", LANED  # the loop variable of the current block of elements, and the vector type
        self.arguments = [(a.arg, Value(f"%a.{a.arg}", kind)) for a, kind in zip(node.args.args, kinds, strict=True)]
        self.names: Names | None = dict(self.arguments)
        self.laned = any(kind in (LANED, f"{LANED}*") for kind in kinds)

    def text(self) -> str:
        self.write.start("start")
        self.translate_statements(self.node.body)
        if self.names is not None and self.result != "void":
            raise Unsupported(f"`{self.node.name}` must end with a return")
        if self.names is not None:
            self.write.lines.append("  ret void")
        linkage, arguments = "" if self.result == "i32" else "internal ", ", ".join(v.typed for _, v in self.arguments)
        head = f"define {linkage}{self.result} @{self.node.name}({arguments}) nounwind {{"
        return "\n".join([head, *self.write.lines, "}", ""])

    @property
    def here(self) -> Names:
        """Values of the names at a reachable place."""
        assert self.names is not None
        return self.names

    # ------------------------------------------------------------ statements

    def translate_statements(self, statements: Sequence[ast.stmt]) -> None:
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
            (target,) = statement.targets
            self.assign(target, statement.value)
        elif isinstance(statement, ast.Assign):
            value = self.value(statement.value)
            for target in statement.targets:
                self.store(target, value)
        elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
            self.assign(statement.target, statement.value)
        elif isinstance(statement, ast.AugAssign):
            self.change(statement)
        elif isinstance(statement, ast.For) and isinstance(statement.target, ast.Name) and not statement.orelse:
            self.repeat(statement, statement.target.id)
        elif isinstance(statement, ast.While) and not statement.orelse:
            self.repeat_while(statement)
        elif isinstance(statement, ast.If):
            self.choose(statement)
        elif isinstance(statement, ast.Return):
            self.give_back(statement)
            self.names = None
        elif isinstance(statement, ast.Break) and self.loops:
            self.leave(self.loops[-1].end, self.loops[-1].breaks)
        elif isinstance(statement, ast.Continue) and self.loops:
            self.leave(self.loops[-1].latch, self.loops[-1].continues)
        elif isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
            self.value(statement.value)
        elif not (
            isinstance(statement, ast.Pass) or (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant))
        ):
            raise _refusal(statement)  # only docstrings are left

    def give_back(self, statement: ast.Return) -> None:
        if self.result == "void":
            if statement.value is not None:
                raise _refusal(statement)
            self.write.lines.append("  ret void")
        elif self.result.startswith("{") and isinstance(statement.value, ast.Tuple):
            result = Value("poison", self.result)
            for i, (part, kind) in enumerate(zip(statement.value.elts, parts_of(self.result), strict=True)):
                value = self.write.converted(self.value(part), kind)
                result = self.write.emit(f"insertvalue {result.typed}, {value.typed}, {i}", self.result)
            self.write.lines.append(f"  ret {result.typed}")
        elif statement.value is not None:
            result = self.value(statement.value)
            if self.result == "i32":
                result = self.write.converted(result, "i64")
            self.write.lines.append(f"  ret {self.write.converted(result, self.result).typed}")
        else:
            raise _refusal(statement)

    def assign(self, target: ast.expr, value: ast.expr) -> None:
        if not isinstance(target, ast.Tuple):
            self.store(target, self.value(value))
        elif isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts):
            for part, result in zip(target.elts, [self.value(v) for v in value.elts], strict=True):
                self.store(part, result)
        else:
            whole = self.value(value)
            kinds = parts_of(whole.kind)
            if len(kinds) != len(target.elts):
                raise _refusal(value)
            for i, (part, kind) in enumerate(zip(target.elts, kinds, strict=True)):
                self.store(part, self.write.emit(f"extractvalue {whole.typed}, {i}", kind))

    def store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self.here[target.id] = value
        elif isinstance(target, (ast.Subscript, ast.Attribute)):
            self.write.store(self.place(target), value)
        else:
            raise _refusal(target)

    def change(self, statement: ast.AugAssign) -> None:
        target, operation = statement.target, OPERATIONS.get(type(statement.op))
        if operation is None:
            raise _refusal(statement)
        if isinstance(target, (ast.Subscript, ast.Attribute)):
            place = self.place(target)
            self.write.store(place, self.write.operated(operation, self.write.load(place), self.value(statement.value)))
        else:
            self.store(target, self.write.operated(operation, self.value(target), self.value(statement.value)))

    def choose(self, statement: ast.If) -> None:
        """An if-elif chain, iteratively: it may be longer than the recursion limit."""
        end, rest = self.write.new(), cast(list[ast.stmt], [statement])
        coming: list[tuple[str, Names]] = []
        while len(rest) == 1 and isinstance(rest[0], ast.If):
            yes, no = self.write.new(), self.write.new()
            self.branch(rest[0].test, yes, no)
            before = self.here
            self.write.start(yes)
            self.names = dict(before)
            self.translate_statements(rest[0].body)
            self.leave(end, coming)
            self.write.start(no)
            self.names, rest = before, rest[0].orelse
        self.translate_statements(rest)
        self.leave(end, coming)
        self.join(end, coming)

    def leave(self, end: str, coming: list[tuple[str, Names]]) -> None:
        """Branch to a block with several predecessors, if this point is reachable."""
        if self.names is not None:
            coming.append((self.write.block, self.names))
            self.write.go(end)
            self.names = None

    def join(self, block: str, coming: Sequence[tuple[str, Names]]) -> None:
        """Begin a block with several predecessors; a name survives if it has one type in all of them (phi nodes)."""
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
        if isinstance(call, ast.Name) and isinstance(self.environment.get(call.id), tuple):
            for number in cast("tuple[float, ...]", self.environment[call.id]):  # unrolled
                self.store(statement.target, constant(number))
                self.translate_statements(statement.body)
            return
        if not (
            isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in ("range", "parallel", "blocks")
        ):
            raise _refusal(call)
        bounds = [self.value(a) for a in call.args]
        step = bounds[2].whole if len(bounds) == 3 else 1
        if not step or not bounds or any(b.kind != "i64" for b in bounds):
            raise _refusal(call)
        first, last = (constant(0), bounds[0]) if len(bounds) == 1 else bounds[:2]
        if call.func.id == "blocks":
            self.lane, self.vector = target, BLOCKED
            self.loop(statement, target, _Range(first, last, BLOCK, True))
            self.lane, self.vector = "", LANED
            return
        together = call.func.id == "parallel" and step == 1 and is_elementwise(statement, target)
        if together:
            many = self.write.operated("sub", last, constant(LANES - 1))
            self.lane = target
            first = self.loop(statement, target, _Range(first, many, LANES, False))
            self.lane = ""
        self.loop(statement, target, _Range(first, last, step, not together and is_never_empty(call)))

    def loop(self, statement: ast.For, target: str, over: _Range) -> Value:
        """A for-loop in rotated form: guard, body, test at the end. Returns the final value of the counter."""
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
        exits = self.carry_out_loop(statement.body, end)
        late: list[Value] = []
        if self.names is not None:
            late = [self.write.operated("add", turns[0].value, constant(over.step)), *(self.again(turn) for turn in turns[1:])]
            self.write.fork(self.write.compared(test, late[0], over.last), body, end)
            coming.append((self.write.block, self.here))
        for k, (_, early, value) in enumerate(turns):
            back = f", [ {late[k].text}, %{self.write.block} ]" if late else ""
            self.write.lines.insert(head, f"  {value.text} = phi {value.kind} [ {early.text}, %{entry} ]{back}")
        self.join(end, [*coming, *exits.breaks])
        together = self.lane == target and self.vector == LANED
        return self.write.phi([(over.first, entry), (late[0], coming[-1][0])]) if together else over.first

    def carry_out_loop(self, body: Sequence[ast.stmt], end: str) -> _Exits:
        """The body of a loop up to its latch."""
        exits = _Exits(end, [], self.write.new() if has_continue(body) else "", [])
        self.loops.append(exits)
        self.translate_statements(body)
        self.loops.pop()
        if exits.continues:
            self.leave(exits.latch, exits.continues)
            self.join(exits.latch, exits.continues)
        return exits

    def repeat_while(self, statement: ast.While) -> None:
        """A while-loop with the test in its header; LLVM rotates it."""
        head, body, out, end = (self.write.new() for _ in range(4))
        before, entry, anew = self.here, self.write.block, stored(statement.body)
        turns = [
            _Turns(name, before[name], Value(f"%{self.write.new()}", before[name].kind))
            for name in sorted(carried(statement))
            if name in before
        ]
        self.write.go(head)
        self.write.start(head)
        place = len(self.write.lines)
        self.names = {n: v for n, v in before.items() if n not in anew} | {turn.name: turn.value for turn in turns}
        coming: list[tuple[str, Names]] = []
        if isinstance(statement.test, ast.Constant) and statement.test.value is True:
            self.write.go(body)
        else:
            self.branch(statement.test, body, out)
            during = dict(self.here)
            self.write.start(out)
            self.leave(end, coming)
            self.names = during
        self.write.start(body)
        exits = self.carry_out_loop(statement.body, end)
        late: list[Value] = []
        last = self.write.block
        if self.names is not None:
            late = [self.again(turn) for turn in turns]
            self.write.go(head)
        for k, (_, early, value) in enumerate(turns):
            back = f", [ {late[k].text}, %{last} ]" if late else ""
            self.write.lines.insert(place, f"  {value.text} = phi {value.kind} [ {early.text}, %{entry} ]{back}")
        self.join(end, [*coming, *exits.breaks])

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
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "math":
            return self.named(node.attr)
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and isinstance(node.slice, ast.Constant):
            numbers = self.environment.get(node.value.id)
            if isinstance(numbers, tuple) and isinstance(node.slice.value, int):
                return constant(numbers[node.slice.value])
        if isinstance(node, (ast.Subscript, ast.Attribute)):
            return self.write.load(self.place(node))
        if isinstance(node, ast.BinOp):
            return self.power(node) if isinstance(node.op, ast.Pow) else self.operations(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return self.write.negative(self.value(node.operand))
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return self.write.denied(self.write.truth(self.value(node.operand)))
        if isinstance(node, ast.Compare):
            return self.compared(node)
        if isinstance(node, ast.IfExp):
            return self.chosen(node)
        if isinstance(node, ast.BoolOp):
            return self.conditions(node)
        if isinstance(node, ast.Call) and not node.keywords:
            return self.call(node)
        raise _refusal(node)

    def named(self, name: str) -> Value:
        if name in self.here:
            return self.here[name]
        number = self.environment.get(name, CONSTANTS.get(name))
        if not isinstance(number, (bool, int, float)):
            raise Unsupported(f"`{name}` has no value there, or values of two kinds")
        return real(number) if isinstance(number, float) else constant(number)

    def place(self, node: ast.Subscript | ast.Attribute) -> Value:
        """Pointer to an array element or a record field."""
        if isinstance(node, ast.Subscript):
            vector = self.vector if self.lane and grows_with(node.slice, self.lane) else ""
            return self.write.at(self.value(node.value), self.value(node.slice), vector)
        record = self.value(node.value)
        fields = fields_of(self.environment.get(record.kind.removesuffix("*")))
        for i, (name, kind) in enumerate(fields):
            if name == node.attr and kind in FIELDS:
                return self.write.field(record, 8 * i, FIELDS[kind])
        raise Unsupported(f"`{ast.unparse(node)}`: there is no such field")

    def operations(self, node: ast.BinOp) -> Value:
        """A chain of binary operations, from left to right."""
        first, later = chain(node)
        result = self.value(first)
        for outer in later:
            if isinstance(outer.op, (ast.FloorDiv, ast.Mod)):
                both = self.write.divided(result, self.value(outer.right))
                result = both[isinstance(outer.op, ast.Mod)]
                continue
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
        sides = [node.left, *node.comparators]
        if len(node.ops) > 1:  # an operand that is compared twice must have no side effects
            pairs: list[ast.expr] = [ast.Compare(a, [o], [b]) for a, o, b in zip(sides, node.ops, sides[1:])]
            return self.conditions(ast.BoolOp(ast.And(), pairs))
        (operation,) = map(type, node.ops)
        if operation not in COMPARISONS:
            raise _refusal(node)
        return self.write.compared(COMPARISONS[operation], *map(self.value, sides))

    def branch(self, test: ast.expr, yes: str, no: str) -> None:
        """Conditional branch with short-circuit evaluation."""
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
        """Conditional expression: only the chosen value is computed, but where each lane chooses."""
        if self.laned:
            return self.selected(node)
        end, rest = self.write.new(), cast(ast.expr, node)
        coming: list[tuple[Value, str, int]] = []  # each with the insertion point at the end of its block
        while isinstance(rest, ast.IfExp):
            yes, no = self.write.new(), self.write.new()
            self.branch(rest.test, yes, no)
            self.write.start(yes)
            coming.append((self.value(rest.body), self.write.block, len(self.write.lines)))
            self.write.go(end)
            self.write.start(no)
            rest = rest.orelse
        coming.append((self.value(rest), self.write.block, len(self.write.lines)))
        self.write.go(end)
        if len({value.kind for value, *_ in coming}) > 1:  # mixed types, as of a condition and a variable
            if any(value.kind not in ("double", "i64", "i1") for value, *_ in coming):
                raise _refusal(node)
            for k, (value, block, place) in reversed(list(enumerate(coming))):  # each value in the block that computes it
                added = len(self.write.lines)
                coming[k] = self.write.converted(value, "double"), block, place
                conversion = self.write.lines[added:]
                del self.write.lines[added:]
                self.write.lines[place:place] = conversion
        self.write.start(end)
        return self.write.phi([(value, block) for value, block, _ in coming])

    def selected(self, node: ast.IfExp) -> Value:
        """Conditional expression of lanes: all values are computed."""
        ways: list[tuple[ast.expr, ast.expr]] = []
        rest: ast.expr = node
        while isinstance(rest, ast.IfExp):
            ways.append((rest.test, rest.body))
            rest = rest.orelse
        result = self.value(rest)
        for test, body in reversed(ways):
            condition = self.write.truth(self.value(test))
            result = self.write.selected(condition, *self.write.alike([self.value(body), result]))
        return result

    def conditions(self, node: ast.BoolOp) -> Value:
        """``and`` / ``or`` with short-circuit evaluation, but of lanes."""
        both = isinstance(node.op, ast.And)
        if self.laned:
            return self.write.joined("and" if both else "or", [self.value(v) for v in node.values])
        end, coming = self.write.new(), []
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

    def call(self, node: ast.Call) -> Value:
        function = node.func
        if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name) and function.value.id == "math":
            name = function.attr
        elif isinstance(function, ast.Name):
            name = function.id
        else:
            raise _refusal(node)
        if name == "one_by_one" and len(node.args) == 2:
            return self.write.one_by_one(self.place(ast.Subscript(node.args[0], node.args[1], ast.Load())))
        if name == "len" and isinstance(node.args[0], ast.Name):
            numbers = self.environment.get(node.args[0].id)
            if isinstance(numbers, tuple):
                return constant(len(numbers))
        values = [self.value(a) for a in node.args]
        known = self.environment.get(name)
        if isinstance(known, Prototype) and len(values) == 1 + len(known.arguments):
            return self.foreign(known, values)
        if self.node.name != f"{name}_of_lanes" in self.signatures and any(value.kind == LANED for value in values):
            return self.own(f"{name}_of_lanes", values)
        if len(values) == 1 and name == "any_of" and values[0].kind == MASK:
            return self.write.over_lanes("or", values[0])
        if name in self.signatures and self.signatures[name][1] != "i32":
            return self.own(name, values)
        if len(values) == 1 and values[0].kind == "i64":
            if is_record(known) or name in ARRAYS_AT:
                return self.write.address(values[0], ARRAYS_AT.get(name, f"{name}*"))
        return self.called(name, values)

    def own(self, name: str, values: Sequence[Value]) -> Value:
        """Call of a function of the small language."""
        kinds, result = self.signatures[name]
        if len(kinds) != len(values):
            raise Unsupported(f"`{name}` takes {len(kinds)} arguments, not {len(values)}")
        given = [self.write.converted(value, kind).typed for value, kind in zip(values, kinds, strict=True)]
        call = f"call {result} @{name}({', '.join(given)})"
        if result != "void":
            return self.write.emit(call, result)
        self.write.lines.append(f"  {call}")
        return Value("", result)

    def foreign(self, prototype: Prototype, values: Sequence[Value]) -> Value:
        """Indirect call of a C function; it may clobber all memory."""
        kinds, result = [KINDS[a] for a in prototype.arguments], KINDS[prototype.result]
        given = [self.write.converted(value, kind).typed for value, kind in zip(values[1:], kinds, strict=True)]
        function = self.write.address(values[0], "function*")
        found = self.write.emit(f"call {result} {function.text}({', '.join(given)})", result)
        return self.write.converted(found, "i64")

    def called(self, name: str, values: list[Value]) -> Value:
        """Call of a built-in function."""
        if name in ("max", "min") and len(values) > 1:
            return self.write.extreme(">" if name == "max" else "<", values)
        if len(values) == 1 and name == "int":
            return self.write.truncated(values[0])
        if len(values) == 1 and name == "abs":
            return self.write.absolute(values[0])
        if len(values) == 1 and name == "total" and values[0].kind in VECTORS:
            return self.write.total(values[0])
        if len(values) == 1 and name in ("block", "in_lanes"):
            return self.write.converted(values[0], BLOCKED if name == "block" else LANED)
        if len(values) > 1 and name in ("both", "either"):
            return self.write.joined("and" if name == "both" else "or", values)
        if len(values) == 3 and name == "where":
            return self.write.selected(values[0], *self.write.alike(values[1:]))
        if name in SYMBOLS and len(values) == 1 + (name in TWO_ARGUMENTS):
            return self.write.called(name, values)
        raise Unsupported(f"`{name}` with {len(values)} arguments is not a function that can be compiled")


def parts_of(kind: str) -> list[str]:
    """Types of a tuple's elements."""
    return kind.strip("{ }").split(", ") if kind.startswith("{") else []


def has_continue(body: Sequence[ast.stmt]) -> bool:
    """Whether the body has a ``continue``, at any depth of its statements."""
    return any(isinstance(s, ast.Continue) or has_continue([*getattr(s, "body", ()), *getattr(s, "orelse", ())]) for s in body)
