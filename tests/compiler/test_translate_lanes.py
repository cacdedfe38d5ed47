"""Functions of lanes in the small language: how many arguments they take, and what their instructions are."""

from __future__ import annotations

import pytest

from gearlib.compiler.instructions import LANED, LANES, MASK, Unsupported
from gearlib.compiler.translate import intermediate

HEAD = "def f(x: lanes, y: lanes, n: int, p: floats) -> int32:\n    a, b = x[0], x[n]\n"


def text(body: str) -> str:
    return intermediate(f"{HEAD}    {body}\n    return 0\n")


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("y[0] = in_lanes(any_of(a > 0, b > 0))", "`any_of` with 2 arguments is not a function that can be compiled"),
        ("y[0] = in_lanes(any_of())", "`any_of` with 0 arguments is not a function that can be compiled"),
        ("y[0] = in_lanes(any_of(a))", "`any_of` with 1 arguments is not a function that can be compiled"),
        ("y[0] = where(both(a > 0), a, b)", "`both` with 1 arguments is not a function that can be compiled"),
        ("y[0] = where(either(a > 0), a, b)", "`either` with 1 arguments is not a function that can be compiled"),
        ("y[0] = where(a > 0, a)", "`where` with 2 arguments is not a function that can be compiled"),
        ("y[0] = where(a > 0, a, b, a)", "`where` with 4 arguments is not a function that can be compiled"),
        ("y[0] = in_lanes(1, 2)", "`in_lanes` with 2 arguments is not a function that can be compiled"),
        ("y[0] = in_lanes(total(p[0]))", "`total` with 1 arguments is not a function that can be compiled"),
        ("y[0] = in_lanes(total(a, b))", "`total` with 2 arguments is not a function that can be compiled"),
        ("y[0] = abs(a, b)", "`abs` with 2 arguments is not a function that can be compiled"),
        ("y[0] = sin(a, b)", "`sin` with 2 arguments is not a function that can be compiled"),
        ("y[0] = one_by_one(p)", "`one_by_one` with 1 arguments is not a function that can be compiled"),
        ("if a > 0: return 1", "a branch that some lanes take and others do not; select values, or ask any_of"),
        ("while a > b: y[0] = a", "a branch that some lanes take and others do not; select values, or ask any_of"),
        ("p[0] = a", f"a number of the kind {LANED} where double is needed"),
        ("n = 1 + 2 if any_of(a > 0) else p", None),
    ],
)
def test_what_lanes_do_not_take(body: str, said: str | None) -> None:
    with pytest.raises(Unsupported) as refused:
        text(body)
    assert said is None or str(refused.value) == f"line 3: {said}"


@pytest.mark.parametrize(
    ("body", "kinds"),
    [
        ("y[0] = where(a > 0, a, 1)", [f"fcmp ogt {LANED}", f"select {MASK}"]),
        ("y[0] = where(both(a > 0, b > 0, a > b), a, b)", [*[f"fcmp ogt {LANED}"] * 3, *[f"and {MASK}"] * 2, f"select {MASK}"]),
        ("y[0] = where(either(a > 0, b > 0), a, b)", [*[f"fcmp ogt {LANED}"] * 2, f"or {MASK}", f"select {MASK}"]),
        ("y[0] = a if a > 0 else b", [f"fcmp ogt {LANED}", f"select {MASK}"]),
        (
            "y[0] = 1 if a > 0 else (2 if b > 0 else 3.0)",
            [f"fcmp ogt {LANED}", f"select {MASK}", f"fcmp ogt {LANED}", f"select {MASK}"],
        ),
        ("y[0] = a + b * 2 - n / a", [f"fmul {LANED}", f"fadd {LANED}", f"fdiv {LANED}", f"fsub {LANED}"]),
        (
            "y[0] = a if not (a > 0 or b > 0) else b",
            [*[f"fcmp ogt {LANED}"] * 2, f"or {MASK}", f"xor {MASK}", f"select {MASK}"],
        ),
        ("y[n] = -a", [f"fneg {LANED}"]),
        ("if any_of(a > b): y[0] = a", [f"fcmp ogt {LANED}", f"call i1 @llvm.vector.reduce.or.v{LANES}i1"]),
        ("p[n] = total(a)", ["fadd double"] * (LANES - 1)),
    ],
)
def test_what_lanes_are_made_to_do(body: str, kinds: list[str]) -> None:
    """In this order, beside loads, conversions and places."""
    made = [line.split(" = ")[1] for line in text(body).partition("}")[0].splitlines() if " = " in line]
    beside = ("getelementptr", "load", "insertelement", "extractelement", "shufflevector", "sitofp")
    found = [line for line in made if not line.startswith(beside)]
    assert len(found) == len(kinds), found
    assert all(line.startswith(kind) for line, kind in zip(found, kinds, strict=True)), found
