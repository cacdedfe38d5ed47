"""Which expression is to blame where a run ended, from states that are given: ahead of them, at them, or the fastest."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.run.refusals.blame import culprit


@cache
def translation(model: type[gl.Component]) -> Any:
    return gl.compile(model()).translation


def said(model: type[gl.Component], at: dict[str, float], t: float = 0.0, span: float = 1.0, **numbers: float) -> str:
    """What `culprit` says of a model's states at a time of a run that was to last so long."""
    scene, table = translation(model).scene, translation(model).parameter_values(numbers)
    x = np.array([at[name] for name in scene.state_names])
    return culprit(scene, scene.numbers(table), t, span, x, np.empty(0), np.zeros(scene.n_discrete))


class Fast(gl.Component):
    """Two states with rates that are given."""

    p, q = gl.Parameter("1/s", default=0.0), gl.Parameter("1/s", default=0.0)
    a, b = gl.Variable("1", nominal=10.0), gl.Variable("1")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.a), self.p * (1 + 0 * self.a)), gl.Eq(gl.der(self.b), self.q * (2 + self.b))]


class Late(gl.Component):
    """Cannot be evaluated from 1 s on."""

    x = gl.Variable("1", start=1.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), gl.sqrt(1 - gl.time))]


class Pole(gl.Component):
    """Divided by what is zero at x = 3."""

    k = gl.Parameter("1/s", default=2.0)
    x = gl.Variable("1", start=1.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.k / (self.x - 3))]


class Coupled(gl.Component):
    """Rates that two equations determine together: p and -p, and then a third state, whose rate is the logarithm of one of them."""

    p = gl.Parameter("1/s", default=1.0)
    a, b, c = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    of_b = gl.Variable("1/s", "rate of b")

    def equations(self) -> list[Any]:
        return [
            gl.Eq(2 * gl.der(self.a) + self.of_b, self.p),
            gl.Eq(gl.der(self.a) + 2 * self.of_b, -self.p),
            gl.Eq(gl.der(self.b), self.of_b),
            gl.Eq(gl.der(self.c), self.p * (1 + gl.log(-self.of_b / self.p))),
        ]


class Still(gl.Component):
    y = gl.Variable("1")

    def equations(self) -> list[Any]:
        return [gl.Eq(self.y, gl.time)]


def test_states_without_a_value_blame_nothing() -> None:
    assert said(Pole, {"x": np.nan}) == said(Pole, {"x": np.inf}) == ""


def test_what_has_no_value_at_the_end() -> None:
    """With its operands: variables, parameters, and time where it is one."""
    assert said(Pole, {"x": 3.0}) == "; der(x) is inf there, from Pole: der(x) = k/(x - 3), with x = 3, k = 2"
    assert said(Late, {"x": 3.0}, t=1.25) == "; der(x) is nan there, from Late: der(x) = sqrt(1 - time), with time = 1.25"


@pytest.mark.parametrize(("before", "seen"), [(0.9e-3, True), (1.1e-3, False)])
def test_what_has_no_value_soon_after(before: float, seen: bool) -> None:
    """Within a thousandth of the run, where the states go on as they do now, and time does."""
    for span in (0.1, 1.0, 50.0):
        assert said(Late, {"x": 1.0}, t=1 - before * span, span=span).startswith("; der(x) is nan there") == seen


def test_nothing_moves_fast() -> None:
    """A state goes fast if it would change a thousand times over in the run: relative to its value, or to its nominal one."""
    assert said(Still, {}) == ""
    assert said(Fast, {"a": 1.0, "b": 1.0}, p=9.999e3) == ""
    assert said(Fast, {"a": 20.0, "b": 1.0}, p=-1.9999e4) == ""
    assert said(Fast, {"a": 1.0, "b": 0.0}, q=0.49e3) == ""
    assert said(Fast, {"a": 1.0, "b": 1.0}, p=9.9e2, span=9.9) == ""


@pytest.mark.parametrize(
    ("at", "numbers", "span", "text"),
    [
        ({"a": 1.0, "b": 1.0}, {"p": 1.01e4}, 1.0, "; fastest of all goes a = 1, with der(a) = 10100 from Fast: der(a) = "),
        ({"a": 20.0, "b": 1.0}, {"p": -2.01e4}, 1.0, "; fastest of all goes a = 20, with der(a) = -20100 from Fast: der(a) = "),
        ({"a": 1.0, "b": 0.0}, {"q": 0.51e3}, 1.0, "; fastest of all goes b = 0, with der(b) = 1020 from Fast: der(b) = "),
        ({"a": 1.0, "b": 1.0}, {"p": 1.01e3}, 10.0, "; fastest of all goes a = 1, with der(a) = 1010 from Fast: der(a) = "),
        (
            {"a": 1.0, "b": 1.0},
            {"p": 2e4, "q": 1e3},
            1.0,
            "; fastest of all goes b = 1, with der(b) = 3000 from Fast: der(b) = ",
        ),
        (
            {"a": 1.0, "b": 9.0},
            {"p": 2e4, "q": 1.7e3},
            1.0,
            "; fastest of all goes b = 9, with der(b) = 18700 from Fast: der(b) = ",
        ),
        (
            {"a": 1.0, "b": 9.0},
            {"p": 2e4, "q": 1.6e3},
            1.0,
            "; fastest of all goes a = 1, with der(a) = 20000 from Fast: der(a) = ",
        ),
    ],
)
def test_the_fastest_state(at: dict[str, float], numbers: dict[str, float], span: float, text: str) -> None:
    assert said(Fast, at, span=span, **numbers).startswith(text)


def test_rates_that_are_determined_together() -> None:
    """No single equation gives the fastest; behind them stands one that has no value where the parameter is zero."""
    at = {"a": 1.0, "b": 3.0, "c": 1e9}
    assert said(Coupled, at, p=2e3) == "; fastest of all goes a = 1, with der(a) = 2000"
    found = said(Coupled, at, p=0.0)
    assert found.startswith("; der(c) is nan there, from Coupled: der(c) = ")
    assert found.endswith(("with of_b = 0, p = 0", "with der(b) = 0, p = 0", "of_b = -0, p = 0", "der(b) = -0, p = 0"))
