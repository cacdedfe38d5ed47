"""Values and instructions of LLVM's language: constants to the last bit, kinds that fit, and as few operations as possible."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest

from gearlib.compiler.instructions import BLOCKED, LANED, LANES, MASK, Unsupported, Value, Writer, constant, real
from gearlib.compiler.small_language import BLOCK

X, K, B, I = Value("%x", "double"), Value("%k", "i64"), Value("%b", "i1"), Value("%i", "i32")


@pytest.mark.parametrize("number", [0.0, -0.0, 1.5, -1e-300, 0.1, math.pi, 5e-324, math.inf, -math.inf])
def test_numbers_keep_all_bits(number: float) -> None:
    found = real(number)
    assert found.kind == "double"
    (bits,) = struct.unpack("<d", struct.pack("<Q", int(found.text, 16)))
    assert (bits, math.copysign(1.0, bits)) == (number, math.copysign(1.0, number))
    assert constant(number) == found


def test_constants_have_the_kind_of_their_python_type() -> None:
    assert (constant(True), constant(False)) == (Value("true", "i1"), Value("false", "i1"))
    assert [constant(n) for n in (0, -7, 2**63 - 1, 1 - 2**63)] == [Value(str(n), "i64") for n in (0, -7, 2**63 - 1, 1 - 2**63)]
    for large in (2**63, -(2**63), 10**30):
        assert constant(large) == real(float(large))
    for other in ("1", None, 1j, [1]):
        with pytest.raises(Unsupported, match=r" is not a number$"):
            constant(other)


def test_values_with_their_kinds() -> None:
    assert [v.typed for v in (X, K, Value("%a", "double*"), Value("%r", "Record*"))] == [
        "double %x",
        "i64 %k",
        "ptr %a",
        "ptr %r",
    ]
    assert [v.whole for v in (constant(5), constant(-12), K, X, constant(2.0), constant(True))] == [
        5,
        -12,
        None,
        None,
        None,
        None,
    ]


def written(do: Any) -> tuple[Any, list[str]]:
    write = Writer({})
    found = do(write)
    return found, [line.strip() for line in write.lines]


def test_blocks_branches_and_joined_values() -> None:
    def do(w: Writer) -> Value:
        w.start("begin")
        w.fork(B, "yes", "no")
        w.go("end")
        return w.phi([(X, "yes"), (constant(1.0), "no")])

    found, lines = written(do)
    assert lines[:3] == ["begin:", "br i1 %b, label %yes, label %no", "br label %end"]
    assert lines[3] == f"{found.text} = phi double [ %x, %yes ], [ {real(1.0).text}, %no ]"
    with pytest.raises(Unsupported, match="a branch that some lanes take"):
        Writer({}).fork(Value("%m", MASK), "yes", "no")
    write = Writer({})
    assert len({write.new() for _ in range(5)} | {write.emit("f", "i64").text for _ in range(5)}) == 10


def test_memory_is_read_and_written_in_its_own_kind() -> None:
    """32-bit integers become 64-bit ones and back; other elements have eight bytes."""
    found, lines = written(lambda w: w.load(Value("%p", "double*")))
    assert (found.kind, lines) == ("double", [f"{found.text} = load double, ptr %p, align 8"])
    found, lines = written(lambda w: w.load(Value("%p", "i32*")))
    assert found.kind == "i64"
    assert [line.split(" = ")[1] for line in lines] == ["load i32, ptr %p, align 4", "sext i32 %v1 to i64"]
    _, lines = written(lambda w: w.store(Value("%p", "i32*"), K))
    assert lines == ["%v1 = trunc i64 %k to i32", "store i32 %v1, ptr %p, align 4"]
    _, lines = written(lambda w: w.store(Value("%p", "i32*"), B))
    assert lines[0] == "%v1 = zext i1 %b to i64"
    _, lines = written(lambda w: w.store(Value("%p", "double*"), K))
    assert lines == ["%v1 = sitofp i64 %k to double", "store double %v1, ptr %p, align 8"]
    found, lines = written(lambda w: w.field(Value("%r", "Record*"), 24, "i64"))
    assert (found.kind, lines) == ("i64*", ["%v1 = getelementptr inbounds i8, ptr %r, i64 24"])


def test_elements_of_arrays() -> None:
    array = Value("%a", "double*")
    assert written(lambda w: w.at(array, K))[0].kind == "double*"
    assert written(lambda w: w.at(array, K, LANED))[0].kind == f"{LANED}*"
    for wrong, index, vector in ((X, K, ""), (array, X, ""), (Value("%a", "i64*"), K, LANED)):
        with pytest.raises(Unsupported, match="no array with a whole number as its index"):
            Writer({}).at(wrong, index, vector)


def test_conversions_widen_only() -> None:
    cases = {(K, "double"): "sitofp i64 %k to double", (B, "double"): "uitofp i1 %b to double", (B, "i64"): "zext i1 %b to i64",
             (I, "i64"): "sext i32 %i to i64", (K, "i32"): "trunc i64 %k to i32"}  # fmt: skip
    for (value, kind), text in cases.items():
        found, lines = written(lambda w, v=value, k=kind: w.converted(v, k))
        assert (found.kind, lines) == (kind, [f"%v1 = {text}"])
    assert written(lambda w: w.converted(X, "double")) == (X, [])
    assert written(lambda w: w.converted(constant(3), "double")) == (real(3.0), [])
    assert written(lambda w: w.converted(constant(3), "i32")) == (Value("3", "i32"), [])
    for value, kind in ((X, "i64"), (X, "i1"), (K, "i1"), (Value("%a", "double*"), "double")):
        with pytest.raises(Unsupported, match=f"a number of the kind .* where {kind} is needed"):
            Writer({}).converted(value, kind)
    for kind, size in ((LANED, LANES), (BLOCKED, BLOCK)):
        found, lines = written(lambda w, k=kind: w.converted(X, k))
        assert found.kind == kind
        assert f"<{size} x i32> zeroinitializer" in lines[-1]
    assert written(lambda w: w.converted(B, MASK))[0].kind == MASK


@pytest.mark.parametrize(
    ("kinds", "common"),
    [
        ((K, K), "i64"),
        ((K, X), "double"),
        ((B, B), "i64"),
        ((B, X), "double"),
        ((X, Value("%l", LANED)), LANED),
        ((I, K), "i64"),
    ],
)
def test_operands_of_different_kinds(kinds: tuple[Value, ...], common: str) -> None:
    found, _ = written(lambda w: w.alike(kinds))
    assert [v.kind for v in found] == [common] * 2
    result, lines = written(lambda w: w.operated("add", *kinds))
    assert result.kind == common
    assert ("add nsw" in lines[-1]) == (common == "i64")
    assert ("fadd" in lines[-1]) == (common != "i64")


def test_division_is_of_real_numbers() -> None:
    found, lines = written(lambda w: w.operated("div", K, constant(2)))
    assert found.kind == "double"
    assert lines[-1].split(" = ")[1] == f"fdiv double %v1, {real(2.0).text}"
    with pytest.raises(Unsupported, match="are for whole numbers"):
        Writer({}).divided(X, K)


def test_vectors_may_be_fused_where_that_is_allowed() -> None:
    for fused in (False, True):
        write = Writer({}, fused)
        write.operated("mul", Value("%l", LANED), X)
        assert (" contract " in write.lines[-1]) == fused
        write.operated("mul", X, X)
        assert "contract" not in write.lines[-1]


@pytest.mark.parametrize("exponent", [*range(-9, 10), 15, 16, 31, 64])
def test_powers_take_few_multiplications(exponent: int) -> None:
    """One for each binary digit, and one for each that is set, but the first; a division for a negative exponent."""
    found, lines = written(lambda w: w.power(X, exponent))
    size = abs(exponent)
    products = 0 if size == 0 else size.bit_length() - 1 + size.bit_count() - 1
    assert sum("fmul" in line for line in lines) == products
    assert sum("fdiv" in line for line in lines) == (exponent < 0)
    assert found == (real(1.0) if exponent == 0 else X if exponent == 1 else Value(f"%v{len(lines)}", "double"))
    assert written(lambda w: w.power(K, 0))[0] == constant(1)


def test_signs() -> None:
    assert written(lambda w: w.negative(constant(4)))[0] == constant(-4)
    assert written(lambda w: w.negative(X))[1] == ["%v1 = fneg double %x"]
    assert written(lambda w: w.negative(Value("%l", LANED)))[1] == [f"%v1 = fneg {LANED} %l"]
    assert written(lambda w: w.negative(K))[1] == ["%v1 = sub nsw i64 0, %k"]
    assert [line.split(" = ")[1] for line in written(lambda w: w.absolute(K))[1]] == [
        "icmp slt i64 %k, 0", "sub nsw i64 0, %k", "select i1 %v1, i64 %v2, i64 %k",
    ]  # fmt: skip


def test_truth_and_its_opposite() -> None:
    assert written(lambda w: w.truth(B)) == (B, [])
    assert written(lambda w: w.truth(X))[1][-1].startswith("%v1 = fcmp une double %x, ")
    assert written(lambda w: w.truth(K))[1] == ["%v1 = icmp ne i64 %k, 0"]
    assert written(lambda w: w.denied(B))[1] == ["%v1 = xor i1 %b, true"]
    found, lines = written(lambda w: w.joined("or", [B, Value("%m", MASK), Value("%n", MASK)]))
    assert found.kind == MASK
    assert [line.split(" = ")[1].split(" <")[0] for line in lines[-2:]] == ["or", "or"]


def test_functions_are_declared_once_and_called() -> None:
    declarations: dict[str, str] = {}
    write = Writer(declarations)
    write.called("sin", [X])
    write.called("sin", [K])
    write.called("atan2", [X, K])
    assert declarations == {
        "llvm.sin.f64": "declare double @llvm.sin.f64(double)",
        "atan2": "declare double @atan2(double, double) nounwind willreturn memory(none)",
    }
    assert write.lines[0] == "  %v1 = call double @llvm.sin.f64(double %x)"
    lanes = Writer({})
    assert lanes.called("tanh", [Value("%l", LANED)]).kind == LANED
    assert sum("call double @tanh" in line for line in lanes.lines) == LANES
    one = Writer({})
    one.called("sqrt", [Value("%l", LANED)])
    assert [line.split(" = ")[1] for line in one.lines] == [f"call {LANED} @llvm.sqrt.v{LANES}f64({LANED} %l)"]


def test_sums_of_vectors_are_taken_in_pairs() -> None:
    for kind, size in ((BLOCKED, BLOCK), (LANED, LANES)):
        found, lines = written(lambda w, k=kind: w.total(Value("%l", k)))
        assert found.kind == "double"
        assert sum("extractelement" in line for line in lines) == size
        assert sum("fadd" in line for line in lines) == size - 1
