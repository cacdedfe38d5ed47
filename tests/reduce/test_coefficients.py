"""Numbers at the start values, as structure asks for them."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.flatten.flatten import flatten
from gearlib.reduce.coefficients import at_start, listed, partials_at, rest_at, some, start_guess
from tests.stress.test_right_calls import given


class Leaf(gl.Component):
    """y is -z, so one of them stands for both."""

    x = gl.Variable("1", "product", guess=5.0)
    y = gl.Variable("1", "one", start=-2.0)
    z = gl.Variable("1", "its opposite")
    p = gl.Parameter("1", "factor", default=3.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.y, -self.z),
            gl.Eq(self.p * self.x * (1 + self.z), self.p**2 + gl.time),
            gl.Eq(gl.der(self.y), 1 + self.p),
        ]


def test_partial_derivatives_at_the_start() -> None:
    model = flatten(Leaf())
    parameters = model.parameters.defaults
    guess = start_guess(model, parameters)
    assert guess[model.representative[model.variable("y")]] * model.sign[model.variable("y")] == -2.0
    assert guess[model.representative[model.variable("z")]] * model.sign[model.variable("z")] == 2.0
    known = at_start(model, parameters)
    for g, group in enumerate(model.groups):
        found = {
            name: float(partials_at(model, g, i, parameters, known)[0]) for i, (name, _) in enumerate(group.template.columns)
        }
        if "x" in found:
            assert found == {"x": 3.0 * (1 + 2), "z": 3.0 * 5.0}
            assert np.isnan(rest_at(model, g, parameters, known)).all()  # varies with time
        else:
            assert found == {"y": 1.0}
            assert rest_at(model, g, parameters, known).tolist() == [-4.0]


@pytest.mark.parametrize("n", [0, 1, 7, 8, 9, 30])
def test_long_lists_are_cut_and_counted(n: int) -> None:
    items = [f"i{k}" for k in range(n)]
    shown = some(items, ", ").split(", ") if n else []
    assert shown == [*items[:8], *([f"and {n - 8} more"] if n > 8 else [])]
    assert some(["a", "b"]) == "a; b"


def test_equations_are_listed_with_their_components() -> None:
    model = flatten(Leaf())
    assert listed(model, range(len(model.places))).count("Leaf (Leaf: ") == len(model.places) == 2


def test_derivatives_that_are_not_known_count_as_zero() -> None:
    class Rates(gl.Component):
        x, y = gl.Variable("1", start=3.0), gl.Variable("1", start=2.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x) ** 2 * self.y, self.x), gl.Eq(self.y * self.x, gl.time)]

    model = flatten(Rates())
    known = at_start(model, model.parameters.defaults)
    rate = np.zeros((2, model.n_variables))
    rate[0], rate[1] = known[0], 5.0
    found: dict[tuple[str, int], list[float]] = {}
    for g, group in enumerate(model.groups):
        for c, column in enumerate(group.template.columns):
            at = partial(partials_at, model, g, c, model.parameters.defaults)
            values = [given(partial(at, k))[0] for k in (known, rate)]
            found[column] = [float(v) for v in values] if group.template.on_time is False else found.get(column, [])
    assert found["x", 1] == [0.0, 2 * 5.0 * 2.0]
    assert found["y", 0] == [0.0, 25.0]


def test_what_is_identically_zero_counts_as_zero_in_coefficients() -> None:
    """The torque of a flange that nothing is connected to."""

    class Loose(gl.Component):
        flange = gp.Flange("free")
        x = gl.Variable("1", start=3.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.x * (2 + self.flange.tau)), gl.Eq(self.flange.phi, gl.time)]

    model = flatten(Loose())
    known = at_start(model, model.parameters.defaults)
    assert model.sign[model.variable("flange.tau")] == 0
    (g,) = [g for g, group in enumerate(model.groups) if ("x", 0) in group.template.columns]
    column = model.groups[g].template.columns.index(("x", 0))
    assert abs(float(partials_at(model, g, column, model.parameters.defaults, known)[0])) == 2.0


class Kept(gl.Component):
    """Two unknowns whose equations contain a discrete variable, a condition, or numbers."""

    k = gl.Parameter("any", default=2.0)
    x, p, q, r = gl.Variable("any"), gl.Variable("any"), gl.Variable("any"), gl.Variable("any")
    h = gl.Discrete(start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.p),
            gl.Eq(self.p + 3 * self.q, self.k * self.h),
            gl.Eq(3 * self.p + self.q, gl.Piecewise((self.k, self.x > 0.5), (0.0, True))),
            gl.Eq(self.r + 2 * self.q, self.k),
            gl.When(gl.time >= 1.0, gl.Eq(self.h, 1.0)),
        ]


def test_right_hand_sides_that_change_at_events_are_no_constants() -> None:
    model = flatten(Kept())
    parameters = model.parameters.defaults
    known = at_start(model, parameters)
    found = {group.template.label: rest_at(model, g, parameters, known).tolist() for g, group in enumerate(model.groups)}
    kept, condition = (next(v for label, v in found.items() if mark in label) for mark in ("h*k", "Piecewise"))
    assert np.isnan([*kept, *condition]).all()
    assert next(v for label, v in found.items() if label.endswith("2*q + r = k")) == [-2.0]


@pytest.mark.parametrize("first", [0.0, 1.0])
def test_two_unknowns_of_what_is_kept_do_not_contradict_each_other(first: float) -> None:
    """p + 3 q = h k and 3 p + q = -h k, whatever h is at first: p = -h k / 2 and q = h k / 2."""

    class Pair(gl.Component):
        k = gl.Parameter("any", default=2.0)
        p, q, h = gl.Variable("any"), gl.Variable("any"), gl.Discrete(start=first)

        def equations(self) -> list[Any]:
            return [
                gl.Eq(self.p + 3 * self.q, self.k * self.h),
                gl.Eq(3 * self.p + self.q, -self.k * self.h),
                gl.When(gl.time >= 1.0, gl.Eq(self.h, 4.0)),
            ]

    run = gl.compile(Pair()).simulate(2.0, times=[0.0, 0.5, 1.5])
    assert run["p"] == pytest.approx([-first, -first, -4.0])
    assert run["q"] == pytest.approx([first, first, 4.0])
