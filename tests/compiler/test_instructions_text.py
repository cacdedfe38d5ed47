"""Instructions of comparisons, choices, vectors and calls as LLVM's language writes them, with the kinds of their results."""

from __future__ import annotations

from typing import Any

import pytest

from gearlib.compiler.instructions import (
    BLOCKED,
    LANED,
    LANES,
    MASK,
    SYMBOLS,
    TWO_ARGUMENTS,
    Unsupported,
    Value,
    Writer,
    constant,
    real,
)
from gearlib.compiler.small_language import BLOCK

X, Y, K, B = Value("%x", "double"), Value("%y", "double"), Value("%k", "i64"), Value("%b", "i1")
L, M, N = Value("%l", LANED), Value("%m", MASK), Value("%n", MASK)


def written(do: Any) -> tuple[Any, list[str]]:
    write = Writer({})
    found = do(write)
    return found, [line.strip() for line in write.lines]


@pytest.mark.parametrize(
    ("sign", "real_", "whole"),
    [
        ("==", "oeq", "eq"),
        ("!=", "une", "ne"),
        ("<", "olt", "slt"),
        ("<=", "ole", "sle"),
        (">", "ogt", "sgt"),
        (">=", "oge", "sge"),
    ],
)
def test_comparisons(sign: str, real_: str, whole: str) -> None:
    """What is not a number equals nothing, and is different from all."""
    assert written(lambda w: w.compared(sign, X, Y)) == (Value("%v1", "i1"), [f"%v1 = fcmp {real_} double %x, %y"])
    assert written(lambda w: w.compared(sign, K, constant(3))) == (Value("%v1", "i1"), [f"%v1 = icmp {whole} i64 %k, 3"])
    found, lines = written(lambda w: w.compared(sign, X, constant(3)))
    assert (found.kind, lines) == ("i1", [f"%v1 = fcmp {real_} double %x, {real(3.0).text}"])
    found, lines = written(lambda w: w.compared(sign, L, X))
    assert (found.kind, lines[-1]) == (MASK, f"%v3 = fcmp {real_} {LANED} %l, %v2")
    found, _ = written(lambda w: w.compared(sign, Value("%v", BLOCKED), X))
    assert found.kind == f"<{BLOCK} x i1>"


def test_truth_is_a_difference_from_zero_in_each_lane() -> None:
    found, lines = written(lambda w: w.truth(L))
    assert found.kind == MASK
    assert lines[-1] == f"{found.text} = fcmp une {LANED} %l, %v2"
    assert real(0.0).text in lines[0]
    assert written(lambda w: w.truth(M)) == (M, [])
    found, lines = written(lambda w: w.denied(M))
    assert found.kind == MASK
    assert lines[-1] == f"{found.text} = xor {MASK} %m, %v2"
    assert lines[0].endswith("i1 true, i64 0")


def test_choices() -> None:
    assert written(lambda w: w.selected(B, X, Y)) == (Value("%v1", "double"), ["%v1 = select i1 %b, double %x, double %y"])
    assert written(lambda w: w.selected(M, L, L)) == (Value("%v1", LANED), [f"%v1 = select {MASK} %m, {LANED} %l, {LANED} %l"])
    found, lines = written(lambda w: w.selected(M, X, L))
    assert (found.kind, lines[-1]) == (LANED, f"%v3 = select {MASK} %m, {LANED} %v2, {LANED} %l")
    found, lines = written(lambda w: w.selected(M, L, X))
    assert (found.kind, lines[-1]) == (LANED, f"%v3 = select {MASK} %m, {LANED} %l, {LANED} %v2")


@pytest.mark.parametrize(("sign", "name"), [(">", "ogt"), ("<", "olt")])
def test_the_first_of_several_extremes_stays(sign: str, name: str) -> None:
    """As in Python: another one takes its place only where it is beyond it."""
    found, lines = written(lambda w: w.extreme(sign, [X, Y, constant(1)]))
    assert lines == [
        f"%v1 = fcmp {name} double %y, %x", "%v2 = select i1 %v1, double %y, double %x", f"%v3 = fcmp {name} double {real(1.0).text}, %v2",
        f"%v4 = select i1 %v3, double {real(1.0).text}, double %v2",
    ]  # fmt: skip
    assert found == Value("%v4", "double")
    assert written(lambda w: w.extreme(sign, [K, constant(2)]))[0].kind == "i64"


def test_whole_parts_and_magnitudes() -> None:
    assert written(lambda w: w.truncated(X)) == (Value("%v1", "i64"), ["%v1 = fptosi double %x to i64"])
    assert written(lambda w: w.truncated(K)) == (K, [])
    assert written(lambda w: w.truncated(B)) == (Value("%v1", "i64"), ["%v1 = zext i1 %b to i64"])
    assert written(lambda w: w.absolute(X)) == (Value("%v1", "double"), ["%v1 = call double @llvm.fabs.f64(double %x)"])
    for kind, size in ((LANED, LANES), (BLOCKED, BLOCK)):
        write = Writer({})
        assert write.absolute(Value("%l", kind)) == Value("%v1", kind)
        assert write.lines == [f"  %v1 = call {kind} @llvm.fabs.v{size}f64({kind} %l)"]
        assert write.declarations == {f"llvm.fabs.v{size}f64": f"declare {kind} @llvm.fabs.v{size}f64({kind})"}


def test_whole_numbers_are_divided_towards_minus_infinity() -> None:
    (quotient, rest), lines = written(lambda w: w.divided(K, constant(3)))
    assert [line.split(" = ")[1] for line in lines] == [
        "sdiv i64 %k, 3", "mul nsw i64 %v1, 3", "sub nsw i64 %k, %v2", "xor i64 %v3, 3", "icmp slt i64 %v4, 0", "icmp ne i64 %v3, 0",
        "and i1 %v5, %v6", "sub nsw i64 %v1, 1", "add nsw i64 %v3, 3", "select i1 %v7, i64 %v8, i64 %v1",
        "select i1 %v7, i64 %v9, i64 %v3",
    ]  # fmt: skip
    assert (quotient, rest) == (Value("%v10", "i64"), Value("%v11", "i64"))


def test_masks_are_joined_and_looked_at_in_all_lanes() -> None:
    found, lines = written(lambda w: w.joined("and", [M, N, M]))
    assert (found.kind, lines) == (MASK, [f"%v1 = and {MASK} %m, %n", f"%v2 = and {MASK} %v1, %m"])
    assert written(lambda w: w.joined("or", [M])) == (M, [])
    for operation in ("or", "and"):
        write = Writer({})
        symbol = f"llvm.vector.reduce.{operation}.v{LANES}i1"
        assert write.over_lanes(operation, M) == Value("%v1", "i1")
        assert write.lines == [f"  %v1 = call i1 @{symbol}({MASK} %m)"]
        assert write.declarations == {symbol: f"declare i1 @{symbol}({MASK})"}


def test_numbers_are_spread_over_vectors() -> None:
    for value, kind, size in ((X, LANED, LANES), (X, BLOCKED, BLOCK), (B, MASK, LANES)):
        found, lines = written(lambda w, v=value, k=kind: w.converted(v, k))
        assert lines == [
            f"%v1 = insertelement {kind} poison, {value.typed}, i64 0",
            f"%v2 = shufflevector {kind} %v1, {kind} poison, <{size} x i32> zeroinitializer",
        ]
        assert found == Value("%v2", kind)
    _, lines = written(lambda w: w.converted(constant(2), LANED))
    assert lines[0] == f"%v1 = insertelement {LANED} poison, double {real(2.0).text}, i64 0"
    with pytest.raises(Unsupported, match=f"^a number of the kind double where {MASK} is needed$"):
        Writer({}).converted(X, MASK)


def test_elements_that_were_just_stored_are_loaded_one_by_one() -> None:
    found, lines = written(lambda w: w.one_by_one(Value("%p", "double*")))
    assert found.kind == BLOCKED
    expected, before = [], "poison"
    for i in range(BLOCK):
        n = 3 * i
        expected += [
            f"%v{n + 1} = getelementptr inbounds double, ptr %p, i64 {i}",
            f"%v{n + 2} = load atomic double, ptr %v{n + 1} unordered, align 8",
            f"%v{n + 3} = insertelement {BLOCKED} {before}, double %v{n + 2}, i64 {i}",
        ]
        before = f"%v{n + 3}"
    assert lines == expected
    assert found.text == before


@pytest.mark.parametrize("name", sorted(SYMBOLS))
def test_functions_of_numbers_and_of_lanes(name: str) -> None:
    """One call for a number; of lanes one where there is such an instruction, and else one for each."""
    count = 2 if name in TWO_ARGUMENTS else 1
    symbol = SYMBOLS[name]
    write = Writer({})
    assert write.called(name, [X, K][:count]).kind == "double"
    given = ["double %x", "double %v1"][:count]
    assert write.lines[-1].split(" = ")[1] == f"call double @{symbol}({', '.join(given)})"
    known = "" if symbol.startswith("llvm.") else " nounwind willreturn memory(none)"
    assert write.declarations == {symbol: f"declare double @{symbol}({', '.join(['double'] * count)}){known}"}
    lanes = Writer({})
    assert lanes.called(name, [L, X][:count]).kind == LANED
    calls = [line.split(" = ")[1] for line in lanes.lines if " = call " in line]
    if name in ("sqrt", "copysign"):
        (call,) = calls
        assert call == f"call {LANED} @llvm.{name}.v{LANES}f64({', '.join([f'{LANED} %l', f'{LANED} %v2'][:count])})"
        assert lanes.declarations == {
            f"llvm.{name}.v{LANES}f64": f"declare {LANED} @llvm.{name}.v{LANES}f64({', '.join([LANED] * count)})"
        }
        return
    assert len(calls) == LANES
    places = [line.split(", i64 ")[1] for line in lanes.lines if f"extractelement {LANED} %l" in line]
    assert places == [str(i) for i in range(LANES)]
    assert [line.split(", i64 ")[1] for line in lanes.lines if "insertelement" in line][-LANES:] == places
    assert lanes.lines[-1].split(" = ")[1].startswith(f"insertelement {LANED} %v")


def test_sums_are_taken_of_neighbours_first() -> None:
    _, lines = written(lambda w: w.total(Value("%l", BLOCKED)))
    assert [line.split(" = ")[1] for line in lines[BLOCK:]] == [
        "fadd double %v1, %v2",
        "fadd double %v3, %v4",
        "fadd double %v5, %v6",
    ]
