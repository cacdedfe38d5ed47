"""Equations of a class taken apart: continuous ones, updates at events, hidden discrete variables."""

from __future__ import annotations

from typing import Any

import pytest
import sympy

import gearlib as gl
from gearlib.equations.discrete_updates import Update, split_equations
from gearlib.errors import DeclarationError
from gearlib.language.declarations import Discrete

x, n, m, p = sympy.symbols("x n m p", real=True)


def split(*equations: Any) -> tuple[list[gl.Eq], tuple[Update, ...], dict[str, Discrete]]:
    discretes = {"n": Discrete("count"), "m": Discrete("another")}
    return split_equations("Part", equations, discretes, lambda name: name == "p", {"x": gl.Variable("1")})


def test_each_discrete_variable_and_each_reinit_has_one_update() -> None:
    flow = gl.Eq(gl.der(x), p)
    actions = gl.Eq(n, gl.pre(n) + 1), gl.reinit(x, 0), gl.reinit(x, 1)
    continuous, updates, known = split(flow, gl.When(x > 1, *actions), gl.Eq(m, n))
    assert continuous == [flow]
    assert sorted((u.target, u.reinit) for u in updates) == [("m", False), ("n", False), ("when_0", False), ("x", True)]
    assert set(known) == {"n", "m", "when_0"}
    assert known["when_0"].start == 1.0  # a condition that holds at the start does not become true


def test_what_becomes_true_at_the_start_is_false_before() -> None:
    _, updates, known = split(gl.When(gl.initial(), gl.Eq(n, 2)), gl.When(gl.sample(p), gl.Eq(m, x)))
    assert [known[name].start for name in ("when_0", "when_1")] == [0.0, 0.0]
    assert {u.target for u in updates} == set(known) == {"n", "m", "when_0", "when_1", "sample_0", "sample_0_before"}


@pytest.mark.parametrize(
    ("equations", "message"),
    [
        ([gl.Eq(n, 1)], "'m' has 0 equations; expected one"),
        ([gl.Eq(n, 1), gl.Eq(m, 0), gl.Eq(n, 2)], "'n' has 2 equations; expected one"),
        ([gl.Eq(n, 1), gl.When(x > 1, gl.Eq(m, 1)), gl.When(x > 2, gl.Eq(m, 2))], "'m' has 2 equations; expected one"),
        ([gl.Eq(n, 1), gl.When(x > 1, gl.Eq(m, 1), gl.Eq(m, 2))], "'m' has 2 equations; expected one"),
        ([gl.When(x > 1, gl.reinit(p, 1))], r"reinit\(p\): no variable of the class"),
        ([gl.When(x > 1, gl.Eq(n, n + 1))], r"the new value is given by itself; .* is gl\.pre\(self\.n\)"),
        ([gl.When(x > 1, gl.Eq(x, 1))], r"in When: expected gl\.Eq\(discrete variable, \.\.\.\) or gl\.reinit"),
        ([gl.When(p > 1, gl.Eq(n, 1))], r"the condition holds parameters only, and never becomes true"),
        ([gl.When(gl.initial(), gl.reinit(x, 1))], r"reinit in a When of gl\.initial\(\)"),
        ([gl.When(gl.sample(x), gl.Eq(n, 1))], r"depends on x; its instants are given by numbers and parameters"),
    ],
)  # fmt: skip
def test_what_is_refused(equations: list[Any], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        split(*equations)
