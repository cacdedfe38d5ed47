"""Code generation for Taylor coefficients: a program's operations as recurrences for power series in time.

Every quantity is a power series about the start of the step. Series are added coefficient by coefficient; a product, a quotient or an
elementary function takes a convolution with the earlier coefficients (Jorba and Zou, doi:10.1080/10586458.2005.10128904, section 2).
The generated function evaluates all operations of the right-hand side at order 0, and then, in one loop, at each further order: so
its size does not depend on the order. Conditions that choose between expressions are evaluated at the start of the step.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from gearlib.compiler.object_code import CompiledFunction, compiled
from gearlib.compiler.small_language import Prototype
from gearlib.compiler.translate import chain
from gearlib.native.layout import Layout
from gearlib.native.source import HEADER, LONGEST, assignments, is_small
from gearlib.program.program import Newton, Program

# int32 f(double t, void *coefficients, void *work, void *data, void *index, int64 order, int64 size): row k of the coefficients has
# ``size`` numbers, row 0 the states; rows 1 to ``order`` are computed.
SERIES = Prototype("int32", ("float", "int", "int", "int", "int", "int", "int"))
HIGHEST = 30  # order
ROW = HIGHEST + 2  # numbers per row of the work space
MOST_PRODUCTS = 120  # convolutions; more would make the code large
MOST_COMPARED = 24  # differences whose coefficients are kept; a table has more
INTEGER_POWERS = 64  # up to which a power is computed by multiplications: others divide by their base, which may be zero
CONSTANTS = ("pi", "e", "inf", "nan")

HEAD = "def series(t: float, c: floats, work: floats, data: floats, index: ints, order: int, size: int) -> int32:"


class NoSeriesError(Exception):
    """An operation that has no power series, or none that is implemented."""


@dataclass(frozen=True)
class TaylorSeries:
    """Compiled function for the Taylor coefficients of the states, see `SERIES`, with its cost.

    Attributes
    ----------
    machine_code : CompiledFunction
    rows : int
        Rows of the work space, `ROW` numbers each.
    sums, products : int
        Statements per order, and convolutions.
    guarded : bool
        Whether divisors may change sign; only the right-hand side checks that.
    pulses : bool
        Whether there is an exponential such as a bell curve of time, a pulse that coefficients at an earlier time do not show.
    branches : bool
        Whether values at the start of a step choose between expressions, so that a short visit to another branch may be missed.
    hides : bool
        Whether the coefficients may not show what happens within a step: there are functions that are constant to rounding far from
        where they change, such as tanh, or many comparisons.
    compared : int
        Differences whose sign chooses between expressions; the last rows of the work space hold their coefficients.
    """

    machine_code: CompiledFunction
    rows: int
    sums: int
    products: int
    guarded: bool
    pulses: bool
    branches: bool
    hides: bool
    compared: int

    @property
    def address(self) -> int:
        return self.machine_code.address


@dataclass(frozen=True)
class PowerSeries:
    """A quantity: ``name`` holds its coefficient of the current order, or its value where it does not vary within the step.

    ``straight``: it is affine in time.
    """

    name: str
    varies: bool = True
    straight: bool = False


@dataclass
class _Writer:
    """Statements of order 0 and of each further order."""

    first: list[str] = field(default_factory=list)
    later: list[str] = field(default_factory=list)
    rows: int = 0
    products: int = 0
    pulses: bool = False
    branches: bool = False
    hides: bool = False
    compared: list[PowerSeries] = field(default_factory=list)
    _known: dict[tuple[object, ...], PowerSeries] = field(default_factory=dict)
    _rows: dict[tuple[str, str], int] = field(default_factory=dict)

    # ------------------------------------------------------------ quantities

    def constant(self, text: str) -> PowerSeries:
        """A quantity that does not vary within a step."""
        if text.replace(".", "").isdecimal() or text.isidentifier():
            return PowerSeries(text, varies=False)
        return self._named(("constant", text), text, "", PowerSeries("", varies=False))

    def _named(self, key: tuple[object, ...], first: str, later: str, like: PowerSeries | None = None) -> PowerSeries:
        """The quantity with a key, computed on first use: expressions of order 0 and of further orders (empty for constants)."""
        if key not in self._known:
            name = f"q{len(self._known)}"
            found = PowerSeries(name) if like is None else replace(like, name=name)
            self._known[key] = found
            self.first.append(f"{found.name} = {first}")
            if later:
                self.later.append(f"{found.name} = {later}")
        return self._known[key]

    def time(self) -> PowerSeries:
        return self._named(("t",), "t", "1.0 if k == 1 else 0.0", PowerSeries("", straight=True))

    def row(self, a: PowerSeries) -> int:
        """Offset of the row of work space with all coefficients of a quantity so far."""
        if (a.name, "") not in self._rows:
            at = self.reserved(a.name)
            self.keep(a.name, at)
        return self._rows[a.name, ""]

    def reserved(self, name: str) -> int:
        """Offset of a new row, for a quantity that is computed later on."""
        at = self._rows[name, ""] = self.rows * ROW
        self.rows += 1
        return at

    def keep(self, name: str, at: int) -> None:
        self.first.append(f"work[{at}] = {name}")
        self.later.append(f"work[{at} + k] = {name}")

    def slope_row(self, a: PowerSeries) -> int:
        """Offset of the row with the coefficients times their order."""
        if (a.name, "slope") not in self._rows:
            at = self._rows[a.name, "slope"] = self.rows * ROW
            self.rows += 1
            self.later.append(f"work[{at} + k] = k * {a.name}")
        return self._rows[a.name, "slope"]

    def convolved(self, a: int, b: int, last: str) -> str:
        """Sum over j from 1 to ``last`` of row a at j times row b at k - j."""
        self.products += 1
        if self.products > MOST_PRODUCTS:
            raise NoSeriesError(f"takes up to {MOST_PRODUCTS} products and functions of variables")
        total = f"p{self.products}"
        self.later += [f"{total} = 0.0", f"for j in range(1, {last}):", f"    {total} += work[{a} + j] * work[{b} + k - j]"]
        return total

    # ------------------------------------------------------------ operations

    def plus(self, a: PowerSeries, b: PowerSeries) -> PowerSeries:
        if not (a.varies or b.varies):
            return self.constant(f"({a.name} + {b.name})")
        if not (a.varies and b.varies):
            a, b = (a, b) if a.varies else (b, a)
            return self._named(("+", a, b), f"{a.name} + {b.name}", a.name, a)
        return self._named(
            ("+", a, b), f"{a.name} + {b.name}", f"{a.name} + {b.name}", PowerSeries("", straight=a.straight and b.straight)
        )

    def negative(self, a: PowerSeries) -> PowerSeries:
        return self._named(("-", a), f"-{a.name}", f"-{a.name}", a) if a.varies else self.constant(f"(-{a.name})")

    def times(self, a: PowerSeries, b: PowerSeries) -> PowerSeries:
        if not (a.varies or b.varies):
            return self.constant(f"({a.name} * {b.name})")
        if not (a.varies and b.varies):
            a, b = (a, b) if a.varies else (b, a)
            return self._named(("*", a, b), f"{b.name} * {a.name}", f"{b.name} * {a.name}", a)
        key = ("*", *sorted((a, b), key=lambda s: s.name))
        if key in self._known:
            return self._known[key]
        if a.straight or b.straight:
            a, b = (a, b) if a.straight else (b, a)
            at, other = self.row(a), self.row(b)
            later = f"work[{at}] * {b.name} + work[{at + 1}] * work[{other} + k - 1]"
        else:
            at, other = self.row(a), self.row(b)
            later = f"{self.convolved(at, other, 'k')} + (work[{at}] * {b.name} + {a.name} * work[{other}])"
        return self._named(key, f"{a.name} * {b.name}", later)

    def over(self, a: PowerSeries, b: PowerSeries) -> PowerSeries:
        if not b.varies:
            return self.times(a, self.constant(f"(1.0 / {b.name})")) if a.varies else self.constant(f"({a.name} / {b.name})")
        key = ("/", a, b)
        if key not in self._known:
            below, inverse = self.row(b), self._inverse(b)
            name = f"q{len(self._known)}"
            own = self.reserved(name)
            total = self.convolved(own, below, "k")
            numerator = a.name if a.varies else "0.0"
            later = f"({numerator} - (work[{own}] * {b.name} + {total})) * {inverse}"
            self._named(key, f"{a.name} / {b.name}", later)
            self.keep(name, own)
        return self._known[key]

    def _inverse(self, a: PowerSeries) -> str:
        """Reciprocal of the value of order 0."""
        return self._named(("inverse", a), f"1.0 / {a.name}", "").name

    def integral(
        self, key: tuple[object, ...], first: str, slopes: Iterable[tuple[PowerSeries, int]], sign: str = ""
    ) -> PowerSeries:
        """The quantity of a given value whose time derivative is the sum of ``der(a) * b``, b being given by its row."""
        if key not in self._known:
            terms = []
            for a, b in slopes:
                slope = self.slope_row(a)
                terms.append(f"work[{slope + 1}] * work[{b} + k - 1]" if a.straight else self.convolved(slope, b, "k + 1"))
            self._named(key, first, f"{sign}({' + '.join(terms)}) / k")
        return self._known[key]

    def pair(self, kind: str, a: PowerSeries, second: bool) -> PowerSeries:
        """Sine and cosine, or the hyperbolic ones, which are each other's derivatives."""
        one, other, sign = ("sin", "cos", "-") if kind == "circular" else ("sinh", "cosh", "")
        key = kind, a
        self.hides = self.hides or kind == "hyperbolic"
        if (*key, True) not in self._known:
            names = f"q{len(self._known)}", f"q{len(self._known) + 1}"
            rows = [self.reserved(name) for name in names]
            # both values of an order before either row is extended, which the next order reads
            self.integral((*key, False), f"{one}({a.name})", [(a, rows[1])])
            self.integral((*key, True), f"{other}({a.name})", [(a, rows[0])], sign)
            for name, row in zip(names, rows, strict=True):
                self.keep(name, row)
        return self._known[*key, second]

    def exponential(self, a: PowerSeries) -> PowerSeries:
        key = "exp", a
        self.pulses = self.pulses or not a.straight
        self.hides = self.hides or not a.straight
        if key not in self._known:
            self.slope_row(a)
            name = f"q{len(self._known)}"
            own = self.reserved(name)
            self.integral(key, f"exp({a.name})", [(a, own)])
            self.keep(name, own)
        return self._known[key]

    def tangent(self, name: str, a: PowerSeries) -> PowerSeries:
        """tan or tanh: the derivative is 1 plus or minus its square."""
        key, sign = (name, a), "" if name == "tan" else "-"
        self.hides = self.hides or name == "tanh"
        if key not in self._known:
            self.slope_row(a)
            slope = f"d{self.rows}"
            at = self.reserved(slope)
            found = self.integral(key, f"{name}({a.name})", [(a, at)])
            square = self.times(found, found)
            self.first.append(f"work[{at}] = 1.0 + {sign}{square.name}")
            self.later.append(f"work[{at} + k] = {sign}{square.name}")
        return self._known[key]

    def function(self, name: str, a: PowerSeries) -> PowerSeries:
        """An elementary function of a quantity that varies."""
        one = self.constant("1.0")
        match name:
            case "sin" | "cos":
                return self.pair("circular", a, name == "cos")
            case "sinh" | "cosh":
                return self.pair("hyperbolic", a, name == "cosh")
            case "tan" | "tanh":
                return self.tangent(name, a)
            case "exp":
                return self.exponential(a)
            case "sqrt":
                return self.root(a)
        self.hides = self.hides or name == "atan"
        square = a if name == "log" else self.times(a, a)
        inner: dict[str, Callable[[], PowerSeries]] = {
            "log": lambda: self.over(one, a),
            "atan": lambda: self.over(one, self.plus(square, one)),
            "atanh": lambda: self.over(one, self.plus(self.negative(square), one)),
            "asin": lambda: self.over(one, self.root(self.plus(self.negative(square), one))),
            "acos": lambda: self.over(self.constant("(-1.0)"), self.root(self.plus(self.negative(square), one))),
            "asinh": lambda: self.over(one, self.root(self.plus(square, one))),
            "acosh": lambda: self.over(one, self.root(self.plus(square, self.constant("(-1.0)")))),
        }
        if name not in inner:
            raise NoSeriesError(f"has no Taylor series for {name}(...)")
        return self.integral((name, a), f"{name}({a.name})", [(a, self.row(inner[name]()))])

    def angle(self, y: PowerSeries, x: PowerSeries) -> PowerSeries:
        """``atan2(y, x)``."""
        square = self.plus(self.times(x, x), self.times(y, y))
        a, b = self.over(x, square), self.negative(self.over(y, square))
        slopes = [(y, self.row(a))] * y.varies + [(x, self.row(b))] * x.varies
        return self.integral(("atan2", y, x), f"atan2({y.name}, {x.name})", slopes)

    def root(self, a: PowerSeries) -> PowerSeries:
        self.hides = True
        key = "sqrt", a
        if key not in self._known:
            name = f"q{len(self._known)}"
            own = self.reserved(name)
            total = self.convolved(own, own, "k")
            self._named(key, f"sqrt({a.name})", f"({a.name} - {total}) / (2.0 * work[{own}])")
            self.keep(name, own)
        return self._known[key]

    def power(self, a: PowerSeries, exponent: PowerSeries, number: float | None) -> PowerSeries:
        if not a.varies and not exponent.varies:
            return self.constant(f"({a.name} ** {exponent.name})")
        if exponent.varies:
            base = self.function("log", a) if a.varies else self.constant(f"log({a.name})")
            return self.exponential(self.times(exponent, base))
        if number is not None and number == int(number) and abs(number) <= INTEGER_POWERS:
            found = self._multiplied(a, abs(int(number)))
            return found if number >= 0 else self.over(self.constant("1.0"), found)
        self.hides = True
        key = ("**", a, exponent)
        if key not in self._known:  # n' a = exponent a' n
            below, slope, inverse = self.row(a), self.slope_row(a), self._inverse(a)
            name = f"q{len(self._known)}"
            own, own_slope = self.reserved(name), self.rows * ROW
            self.rows += 1
            one, other = self.convolved(slope, own, "k + 1"), self.convolved(own_slope, below, "k")
            self._named(key, f"{a.name} ** {exponent.name}", f"({exponent.name} * {one} - {other}) * {inverse} / k")
            self.keep(name, own)
            self.later.append(f"work[{own_slope} + k] = k * {name}")
        return self._known[key]

    def _multiplied(self, a: PowerSeries, exponent: int) -> PowerSeries:
        if exponent == 1:
            return a
        half = self._multiplied(a, exponent // 2)
        whole = self.times(half, half)
        return self.times(whole, a) if exponent % 2 else whole

    def compare(self, a: PowerSeries, b: PowerSeries) -> None:
        """Keep track of the difference of two quantities whose comparison chooses between expressions."""
        if a.varies or b.varies:
            self.branches = True
            difference = self.plus(a, self.negative(b))
            if difference not in self.compared:
                self.compared.append(difference)

    def chosen(self, test: str, a: PowerSeries, b: PowerSeries) -> PowerSeries:
        """One of two quantities, as a condition at the start of the step decides."""
        flag = self._named(("flag", test), f"1.0 if {test} else 0.0", "", PowerSeries("", varies=False)).name
        first = f"{a.name} if {flag} != 0.0 else {b.name}"
        if not (a.varies or b.varies):
            return self._named(("if", flag, a, b), first, "", PowerSeries("", varies=False))
        one, other = (s.name if s.varies else "0.0" for s in (a, b))
        straight = all(s.straight or not s.varies for s in (a, b))
        return self._named(
            ("if", flag, a, b), first, f"{one} if {flag} != 0.0 else {other}", PowerSeries("", straight=straight)
        )


class _Reader:
    """Translates expressions of the small language into statements of a writer; ``names`` are the quantities known so far."""

    def __init__(self, write: _Writer) -> None:
        self.write, self.names = write, dict[str, PowerSeries]()

    def read(self, node: ast.expr) -> PowerSeries:
        write = self.write
        match node:
            case ast.Constant(int() | float() as value):
                return write.constant(repr(float(value)))
            case ast.Name("t"):
                return write.time()
            case ast.Name(name) if name in CONSTANTS:
                return write.constant(name)
            case ast.Name(name):
                return self.names[name]
            case ast.Subscript():
                return write.constant(ast.unparse(node))
            case ast.UnaryOp(ast.USub(), operand):
                return write.negative(self.read(operand))
            case ast.BinOp(left, ast.Pow(), right):
                return write.power(self.read(left), self.read(right), _number(right))
            case ast.BinOp():
                return self._chain(node)
            case ast.IfExp(test, ast.Name(name), ast.UnaryOp(ast.USub(), ast.Name(other))) if name == other:
                return self._absolute(test, name)
            case ast.IfExp(test, body, orelse):
                return write.chosen(self.condition(test), self.read(body), self.read(orelse))
            case ast.Call(ast.Name(name), arguments):
                return self._call(name, [self.read(a) for a in arguments])
        raise NoSeriesError(f"has no Taylor series for {ast.unparse(node)[:60]}")

    def _chain(self, node: ast.BinOp) -> PowerSeries:
        """Sums and products, from left to right."""
        first, later = chain(node)
        result, write = self.read(first), self.write
        for outer in later:
            right = self.read(outer.right)
            match outer.op:
                case ast.Add():
                    result = write.plus(result, right)
                case ast.Sub():
                    result = write.plus(result, write.negative(right))
                case ast.Mult():
                    result = write.times(result, right)
                case ast.Div():
                    result = write.over(result, right)
                case _:
                    raise NoSeriesError(f"has no Taylor series for {ast.unparse(node)[:60]}")
        return result

    def _absolute(self, test: ast.expr, name: str) -> PowerSeries:
        """``a if test else -a``: one operation per order."""
        a, condition = self.names[name], self.condition(test)
        sign = self.write._named(("sign if", condition), f"1.0 if {condition} else -1.0", "", PowerSeries("", varies=False))
        return self.write.times(a, sign)

    def _call(self, name: str, arguments: list[PowerSeries]) -> PowerSeries:
        write = self.write
        if not any(a.varies for a in arguments):
            return write.constant(f"{name}({', '.join(a.name for a in arguments)})")
        match name, arguments:
            case "atan2", [y, x]:
                return write.angle(y, x)
            case _, [a]:
                return write.function(name, a)
        raise NoSeriesError(f"has no Taylor series for {name}(...)")

    def condition(self, node: ast.expr) -> str:
        """A condition on values at the start of the step."""
        match node:
            case ast.Compare(left, operators, comparators):
                last = self.read(left)
                parts = [last.name]
                for operator, right in zip(operators, map(self.read, comparators), strict=True):
                    parts += [ast.unparse(ast.Compare(ast.Name("a"), [operator], [ast.Name("b")]))[2:-2], right.name]
                    self.write.compare(last, right)
                    last = right
                return f"({' '.join(parts)})"
            case ast.BoolOp(operator, values):
                return f"({(' and ' if isinstance(operator, ast.And) else ' or ').join(map(self.condition, values))})"
            case ast.UnaryOp(ast.Not(), operand):
                return f"(not {self.condition(operand)})"
        raise NoSeriesError(f"has no Taylor series for a choice by {ast.unparse(node)[:60]}")


def _number(node: ast.expr) -> float | None:
    """The value of a literal exponent, such as 2, -1, 1/2."""
    try:
        return float(eval(compile(ast.Expression(node), "<exponent>", "eval"), {"__builtins__": {}}))
    except NameError:
        return None


def taylor_source(program: Program, layout: Layout) -> tuple[str, _Writer]:
    """Source of the function for the Taylor coefficients of a program's outputs, and its writer.

    Raises
    ------
    NoSeriesError
        The program is too large, iterates, or uses an operation without a series; the message is the rest of a sentence.
    """
    if any(isinstance(step, Newton) for step in program.steps):
        raise NoSeriesError("has no Taylor series for equations that are solved together, or by iteration, in each evaluation")
    if not is_small(program):
        raise NoSeriesError(f"takes up to {LONGEST} equations")
    write = _Writer()
    reader = _Reader(write)
    n = len(program.states)
    for i in range(n):
        reader.names[f"s{i}"] = PowerSeries(f"s{i}")
    for i in range(len(program.inputs)):
        reader.names[f"s{n + i}"] = write.constant(f"data[{layout.inputs + i}]")
    for slot, text in assignments(program, layout, lambda s: f"s{s}", lambda p: f"data[{p}]"):
        reader.names[f"s{slot}"] = reader.read(ast.parse(text, mode="eval").body)
    outputs = [reader.names[f"s{slot}"] for slot in program.output_slots.tolist()]
    if len(write.compared) > MOST_COMPARED:
        write.hides, write.compared = True, []
    for difference in write.compared:
        write.keep(difference.name, write.reserved(difference.name))
    lines = [f"s{i} = c[{i}]" for i in range(n)]
    lines += write.first
    lines += [f"n{i} = {a.name}" for i, a in enumerate(outputs)]
    lines += [line for i in range(n) for line in (f"c[size + {i}] = n{i}", f"s{i} = n{i}")]
    lines += ["for k in range(1, order):"]
    lines += [f"    {line}" for line in write.later]
    lines += ["    inverse, at = 1.0 / (k + 1), (k + 1) * size"]
    lines += [f"    n{i} = {f'{a.name} * inverse' if a.varies else '0.0'}" for i, a in enumerate(outputs)]
    lines += [f"    {line}" for i in range(n) for line in (f"c[at + {i}] = n{i}", f"s{i} = n{i}")]
    text = "\n".join([HEAD, *(f"    {line}" for line in lines), "    return 0", ""])
    return text, write


def taylor_series(program: Program, layout: Layout) -> TaylorSeries | str:
    """The compiled function for a program, or the reason why there is none, as the rest of a sentence."""
    try:
        text, write = taylor_source(program, layout)
    except NoSeriesError as reason:
        return str(reason)
    code = compiled(HEADER + text, "series")
    return TaylorSeries(
        code, write.rows, len(write.later), write.products, bool(program.guards), write.pulses, write.branches, write.hides,
        len(write.compared),
    )  # fmt: skip
