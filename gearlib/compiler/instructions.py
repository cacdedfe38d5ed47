"""Emitter of LLVM IR: typed values and one method per kind of instruction."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from gearlib.compiler.small_language import BLOCK

OWN = ("sin", "cos", "exp", "log", "sqrt", "copysign")  # LLVM intrinsics
LIBRARY = (  # functions of the C library
    "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "nextafter",
)  # fmt: skip
SYMBOLS = {**{name: f"llvm.{name}.f64" for name in OWN}, **{name: name for name in LIBRARY}}
SYMBOLS |= {"abs": "llvm.fabs.f64", "pow": "llvm.pow.f64"}
TWO_ARGUMENTS = ("atan2", "copysign", "nextafter", "pow")
COMPARISONS = {
    "==": ("oeq", "eq"), "!=": ("une", "ne"), "<": ("olt", "slt"), "<=": ("ole", "sle"), ">": ("ogt", "sgt"), ">=": ("oge", "sge"),
}  # fmt: skip
LANES = 8  # vector length of unrolled loops; LLVM splits it into as many instructions as the processor needs
LANED = f"<{LANES} x double>"
BLOCKED = f"<{BLOCK} x double>"
VECTORS = {LANED: LANES, BLOCKED: BLOCK}
MASK = f"<{LANES} x i1>"  # conditions side by side
OF_VECTORS = ("sqrt", "copysign")  # functions that processors have for vectors
CONVERSIONS = {
    ("i64", "double"): "sitofp", ("i1", "double"): "uitofp", ("i1", "i64"): "zext", ("i32", "i64"): "sext",
    ("i64", "i32"): "trunc",
}  # fmt: skip


class Unsupported(Exception):
    """Source outside the supported subset of Python; generated source never is."""


class Value(NamedTuple):
    """An IR value: its LLVM name or literal, and its type."""

    text: str
    kind: str  # double, i64, i32, i1, a vector, a record, a tuple in braces, or one of these followed by "*" (a pointer to it)

    @property
    def typed(self) -> str:
        return f"{'ptr' if self.kind.endswith('*') else self.kind} {self.text}"

    @property
    def whole(self) -> int | None:
        """The value of an integer constant."""
        return int(self.text) if self.kind == "i64" and self.text.lstrip("-").isdigit() else None


def real(number: float) -> Value:
    """A floating-point constant in hexadecimal, since decimal digits would be rounded again."""
    return Value(f"0x{struct.unpack('<Q', struct.pack('<d', number))[0]:016X}", "double")


def constant(number: object) -> Value:
    """A constant of the IR type that corresponds to the Python type."""
    if isinstance(number, bool):
        return Value("true" if number else "false", "i1")
    if isinstance(number, int) and abs(number) < 2**63:
        return Value(str(number), "i64")
    if isinstance(number, (int, float)):
        return real(float(number))
    raise Unsupported(f"{number!r} is not a number")


class Writer:
    """Instruction list of one function under construction.

    Attributes
    ----------
    lines : list of str
    block : str
        Label of the current basic block.
    declarations : dict of str to str
        Declarations of the mathematical functions in use.
    """

    def __init__(self, declarations: dict[str, str], fused: bool = False) -> None:
        self.declarations = declarations
        self.fused = " contract" if fused else ""  # allow fused multiply-add in vector code
        self.lines: list[str] = []
        self.block, self._count = "", 0

    # ------------------------------------------------------------ blocks

    def new(self) -> str:
        """A fresh name for a value or basic block."""
        self._count += 1
        return f"v{self._count}"

    def emit(self, instruction: str, kind: str) -> Value:
        name = f"%{self.new()}"
        self.lines.append(f"  {name} = {instruction}")
        return Value(name, kind)

    def start(self, block: str) -> None:
        self.block = block
        self.lines.append(f"{block}:")

    def go(self, block: str) -> None:
        self.lines.append(f"  br label %{block}")

    def fork(self, condition: Value, yes: str, no: str) -> None:
        if condition.kind != "i1":
            raise Unsupported("a branch that some lanes take and others do not; select values, or ask any_of")
        self.lines.append(f"  br i1 {condition.text}, label %{yes}, label %{no}")

    def phi(self, coming: Sequence[tuple[Value, str]]) -> Value:
        """A phi node: one value per predecessor block."""
        kind = coming[0][0].kind
        return self.emit(f"phi {kind} {', '.join(f'[ {value.text}, %{block} ]' for value, block in coming)}", kind)

    # ------------------------------------------------------------ memory

    def at(self, array: Value, index: Value, vector: str = "") -> Value:
        """Pointer to an array element, or to the first element of a vector."""
        element = array.kind.removesuffix("*")
        if not array.kind.endswith("*") or index.kind != "i64" or (vector and element != "double"):
            raise Unsupported("no array with a whole number as its index")
        return self.emit(f"getelementptr inbounds {element}, {array.typed}, {index.typed}", f"{vector or element}*")

    def field(self, record: Value, offset: int, kind: str) -> Value:
        """Pointer to a field of a record."""
        return self.emit(f"getelementptr inbounds i8, {record.typed}, i64 {offset}", f"{kind}*")

    def address(self, number: Value, kind: str) -> Value:
        """The array or record stored at an address."""
        return self.emit(f"inttoptr {number.typed} to ptr", kind)

    def one_by_one(self, place: Value) -> Value:
        """Load a vector element by element: store forwarding fails where one load covers several recent stores."""
        block = Value("poison", BLOCKED)
        for i in range(BLOCK):
            part = self.emit(f"getelementptr inbounds double, {place.typed}, i64 {i}", "double*")
            number = self.emit(
                f"load atomic double, {part.typed} unordered, align 8", "double"
            )  # volatile, or LLVM would merge the loads into one
            block = self.emit(f"insertelement {block.typed}, {number.typed}, i64 {i}", BLOCKED)
        return block

    def total(self, block: Value) -> Value:
        """Horizontal sum of a vector."""
        parts = [self.emit(f"extractelement {block.typed}, i64 {i}", "double") for i in range(VECTORS[block.kind])]
        while len(parts) > 1:
            parts = [self.operated("add", a, b) for a, b in zip(parts[::2], parts[1::2], strict=True)]
        return parts[0]

    def load(self, place: Value) -> Value:
        kind = place.kind.removesuffix("*")
        value = self.emit(f"load {kind}, {place.typed}, align {4 if kind == 'i32' else 8}", kind)
        return self.converted(value, "i64") if kind == "i32" else value

    def store(self, place: Value, value: Value) -> None:
        kind = place.kind.removesuffix("*")
        value = self.converted(self.converted(value, "i64"), "i32") if kind == "i32" else self.converted(value, kind)
        self.lines.append(f"  store {value.typed}, {place.typed}, align {4 if kind == 'i32' else 8}")

    # ------------------------------------------------------------ numbers

    def converted(self, value: Value, kind: str) -> Value:
        """Widening conversion: int to float, scalar to vector; large integers lose low bits."""
        if value.kind == kind:
            return value
        if kind == MASK and value.kind == "i1":
            first = self.emit(f"insertelement {MASK} poison, {value.typed}, i64 0", MASK)
            return self.emit(f"shufflevector {first.typed}, {MASK} poison, <{LANES} x i32> zeroinitializer", MASK)
        if kind in VECTORS:
            first = self.emit(f"insertelement {kind} poison, {self.converted(value, 'double').typed}, i64 0", kind)
            return self.emit(f"shufflevector {first.typed}, {kind} poison, <{VECTORS[kind]} x i32> zeroinitializer", kind)
        number = value.whole
        if number is not None and kind in ("double", "i32"):
            return real(float(number)) if kind == "double" else Value(value.text, kind)
        if (value.kind, kind) not in CONVERSIONS:
            raise Unsupported(f"a number of the kind {value.kind} where {kind} is needed")
        return self.emit(f"{CONVERSIONS[value.kind, kind]} {value.typed} to {kind}", kind)

    def alike(self, values: Sequence[Value]) -> list[Value]:
        """The usual arithmetic conversions: operands promoted to a common type."""
        kinds = {value.kind for value in values}
        kind = next((k for k in (*VECTORS, "double") if k in kinds), "i64")
        return [self.converted(value, kind) for value in values]

    def operated(self, operation: str, left: Value, right: Value) -> Value:
        """An arithmetic instruction; ``operation`` is add, sub, mul or div."""
        if operation == "div" and not {left.kind, right.kind} & VECTORS.keys():
            left, right = self.converted(left, "double"), self.converted(right, "double")
        left, right = self.alike((left, right))
        name = f"{operation} nsw" if left.kind == "i64" else f"f{operation}{self.fused if left.kind in VECTORS else ''}"
        return self.emit(f"{name} {left.typed}, {right.text}", left.kind)

    def divided(self, left: Value, right: Value) -> tuple[Value, Value]:
        """Integer floor division and modulo, rounded towards minus infinity as in Python."""
        left, right = self.alike((left, right))
        if left.kind != "i64":
            raise Unsupported("`//` and `%` are for whole numbers")
        quotient = self.emit(f"sdiv {left.typed}, {right.text}", "i64")
        rest = self.operated("sub", left, self.operated("mul", quotient, right))
        below = self.emit(f"xor {rest.typed}, {right.text}", "i64")  # negative where the signs differ
        wrong = self.emit(f"and i1 {self.compared('<', below, constant(0)).text}, {self.truth(rest).text}", "i1")
        less = self.operated("sub", quotient, constant(1))
        more = self.operated("add", rest, right)
        return self.selected(wrong, less, quotient), self.selected(wrong, more, rest)

    def absolute(self, value: Value) -> Value:
        if value.kind == "i64":
            return self.selected(self.compared("<", value, constant(0)), self.negative(value), value)
        if value.kind not in VECTORS:
            return self.called("abs", [value])
        symbol = f"llvm.fabs.v{VECTORS[value.kind]}f64"
        self.declarations[symbol] = f"declare {value.kind} @{symbol}({value.kind})"
        return self.emit(f"call {value.kind} @{symbol}({value.typed})", value.kind)

    def power(self, base: Value, exponent: int) -> Value:
        """Integer power by repeated multiplication."""
        left, result = abs(exponent), None
        while left:
            if left & 1:
                result = base if result is None else self.operated("mul", result, base)
            left >>= 1
            base = self.operated("mul", base, base) if left else base
        if result is None:
            return constant(1) if base.kind == "i64" else real(1.0)
        return result if exponent > 0 else self.operated("div", real(1.0), result)

    def negative(self, value: Value) -> Value:
        if value.kind == "double" or value.kind in VECTORS:
            return self.emit(f"fneg {value.typed}", value.kind)
        number = value.whole
        return self.operated("sub", constant(0), value) if number is None else constant(-number)

    def compared(self, comparison: str, left: Value, right: Value) -> Value:
        left, right = self.alike((left, right))
        whole = left.kind == "i64"
        kind = f"<{VECTORS[left.kind]} x i1>" if left.kind in VECTORS else "i1"
        return self.emit(f"{'icmp' if whole else 'fcmp'} {COMPARISONS[comparison][whole]} {left.typed}, {right.text}", kind)

    def truth(self, value: Value) -> Value:
        """Conversion to a truth value, or to one for each lane: not equal to zero."""
        return value if value.kind in ("i1", MASK) else self.compared("!=", value, constant(0))

    def denied(self, condition: Value) -> Value:
        return self.emit(f"xor {condition.typed}, {self.converted(constant(True), condition.kind).text}", condition.kind)

    def joined(self, operation: str, conditions: Sequence[Value]) -> Value:
        """Conditions of lanes joined by ``and`` or ``or``."""
        result, *others = [self.converted(condition, MASK) for condition in conditions]
        for other in others:
            result = self.emit(f"{operation} {result.typed}, {other.text}", MASK)
        return result

    def over_lanes(self, operation: str, condition: Value) -> Value:
        """Whether a condition holds in any of the lanes (``or``), or in all of them (``and``)."""
        symbol = f"llvm.vector.reduce.{operation}.v{LANES}i1"
        self.declarations[symbol] = f"declare i1 @{symbol}({MASK})"
        return self.emit(f"call i1 @{symbol}({condition.typed})", "i1")

    def selected(self, condition: Value, first: Value, second: Value) -> Value:
        if condition.kind == MASK:
            first, second = self.converted(first, LANED), self.converted(second, LANED)
        return self.emit(f"select {condition.typed}, {first.typed}, {second.typed}", first.kind)

    def extreme(self, comparison: str, values: Sequence[Value]) -> Value:
        """Maximum or minimum with Python's comparison order, which matters for NaN."""
        best, *others = self.alike(values)
        for other in others:
            best = self.selected(self.compared(comparison, other, best), other, best)
        return best

    def truncated(self, value: Value) -> Value:
        """Truncation of a float to an integer."""
        return self.emit(f"fptosi {value.typed} to i64", "i64") if value.kind == "double" else self.converted(value, "i64")

    def called(self, name: str, values: Sequence[Value]) -> Value:
        """Call of a libm function, declared free of side effects (errno is never read), so that LLVM merges equal calls."""
        if any(value.kind == LANED for value in values):
            return self._called_for_lanes(name, [self.converted(value, LANED) for value in values])
        symbol, numbers = SYMBOLS[name], [self.converted(value, "double").typed for value in values]
        known = "" if symbol.startswith("llvm.") else " nounwind willreturn memory(none)"
        self.declarations[symbol] = f"declare double @{symbol}({', '.join('double' for _ in numbers)}){known}"
        return self.emit(f"call double @{symbol}({', '.join(numbers)})", "double")

    def _called_for_lanes(self, name: str, values: Sequence[Value]) -> Value:
        """The same for all lanes: one instruction where there is one, else lane by lane."""
        if name in OF_VECTORS:
            symbol = f"llvm.{name}.v{LANES}f64"
            self.declarations[symbol] = f"declare {LANED} @{symbol}({', '.join(value.kind for value in values)})"
            return self.emit(f"call {LANED} @{symbol}({', '.join(value.typed for value in values)})", LANED)
        result = Value("poison", LANED)
        for i in range(LANES):
            parts = [self.emit(f"extractelement {value.typed}, i64 {i}", "double") for value in values]
            result = self.emit(f"insertelement {result.typed}, {self.called(name, parts).typed}, i64 {i}", LANED)
        return result
