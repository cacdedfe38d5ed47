"""Corners without events in equations that are differentiated, and which relations and modes jump."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ModelError
from gearlib.flatten.flatten import flatten
from gearlib.flatten.model import FlatModel
from gearlib.reduce.discontinuities import jumping, with_corners
from tests.stress.test_right_calls import given


class Silent(gl.Component):
    """Laws that bend or jump without an event; the last one bends at b, is curved from 2 b on, and is held at 3 b by an event."""

    x, b = gl.Variable("1", start=0.0), gl.Parameter("1", default=0.3)
    bend, curve, step, several = (gl.Variable("1") for _ in range(4))

    def equations(self) -> list[Any]:
        x, b, zero = self.x, self.b, (0, True)
        bend, curve = gl.Piecewise((x - b, x > b), zero), gl.Piecewise(((x - 2 * b) ** 2, x > 2 * b), zero)
        laws = {"bend": bend, "curve": curve, "step": gl.Piecewise((1, x > b), zero), "several": bend + curve}
        held = {"several": gl.Piecewise((x, x < 3 * b), (3 * b, True))}
        return [gl.Eq(gl.der(x), 1), *(gl.Eq(getattr(self, n), gl.no_event(e) + held.get(n, 0)) for n, e in laws.items())]


class Two(gl.Component):
    def assemble(self) -> list[Any]:
        self.one, self.other = Silent(), Silent(b=0.5)
        return []


@pytest.fixture(scope="module")
def model() -> FlatModel:
    return flatten(Two())


def equation_of(model: FlatModel, name: str) -> int:
    (e,) = [e for e, row in enumerate(model.rows) if (int(model.representative[model.variable(name)]), 0) in row]
    return e


@pytest.mark.parametrize("part", ["one", "other"])
@pytest.mark.parametrize(
    ("law", "corners"),
    [("bend", [0, 0, 1, 1]), ("curve", [0, 0, 0, 1]), ("step", [0, 1, 1, 1]), ("several", [0, 0, 1, 2])],
)
def test_what_jumps_at_an_order_up_to_which_it_is_differentiated_has_events(
    model: FlatModel, law: str, corners: list[int], part: str
) -> None:
    """For each number of times, from 0 on; an equation that is not differentiated keeps its corners."""
    for times, count in enumerate(corners):
        e = equation_of(model, f"{part}.{law}")
        counts = [times if k == e else 0 for k in range(len(model.places))]
        own = model.groups[model.places[e][0]].template
        found = given(partial(with_corners, model, counts, model.parameters.defaults))
        assert len(found) == (count > 0)
        for before, after in found.items():
            assert before is own
            assert after.relations[: len(own.relations)] == own.relations
            new = after.relations[len(own.relations) :]
            assert len(new) == count
            x, b = (next(s for s in r.g.free_symbols if s.name == n) for r in new[:1] for n in "xb")
            places = {float(abs(r.g.subs({x: 0, b: 1}))) for r in new}
            assert places == ({1.0, 2.0} if count == 2 else {2.0 if law == "curve" else 1.0})
    assert with_corners(model, [0] * len(model.places), model.parameters.defaults) == {}


class Switched(gl.Component):
    """Two relations and two modes in one equation."""

    x, y, b = gl.Variable("1", start=0.0), gl.Variable("1"), gl.Parameter("1", default=0.3)
    low, high = gl.Discrete("mode"), gl.Discrete("another")

    def equations(self) -> list[Any]:
        x, b = self.x, self.b
        step, bend = gl.Piecewise((2, x > b), (0, True)), gl.Piecewise((x - 2 * b, x > 2 * b), (0, True))
        modes = [gl.Eq(mode, gl.Piecewise((1, gl.time > t), (0, True))) for mode, t in ((self.low, 1), (self.high, 2))]
        start = gl.Piecewise((1, gl.initial()), (0, True))
        return [gl.Eq(gl.der(x), 1), *modes, gl.Eq(self.y, step + bend + self.low * x + self.high * x**2 + start)]


def test_relations_that_jump_are_listed_before_modes() -> None:
    """The step jumps, the bend only when differentiated, where the step is gone; modes do at any order."""
    model = flatten(Switched())
    g, i = model.places[equation_of(model, "y")]
    template = model.groups[g].template
    at = [float(abs(r.g.subs({s: {"x": 0, "b": 1}[s.name] for s in r.g.free_symbols}))) for r in template.relations]
    step, bend = at.index(1.0), at.index(2.0)
    modes = [2 + d for d, name in enumerate(template.discretes) if name in ("low", "high")]
    assert len(modes) == 2
    found = [jumping(model.groups[g], i, level, model.parameters.defaults) for level in range(3)]
    assert found == [[step, *modes], [bend, *modes], [bend, *modes]]


@pytest.mark.parametrize("place", [0.0, -2.0, 1e-7, 5e3])
def test_a_step_jumps_wherever_it_is_and_a_bend_does_not(place: float) -> None:
    class Placed(gl.Component):
        x, y, z = gl.Variable("1", start=0.0), gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[Any]:
            step = gl.Piecewise((1, self.x > place), (0, True))
            bend = gl.Piecewise((self.x - place, self.x > place), (0, True))
            return [gl.Eq(gl.der(self.x), 1), gl.Eq(self.y, step), gl.Eq(self.z, bend)]

    found = flatten(Placed())
    for name, levels in (("y", [[0], []]), ("z", [[], [0]])):
        g, i = found.places[equation_of(found, name)]
        assert [jumping(found.groups[g], i, level, found.parameters.defaults) for level in (0, 1)] == levels


def test_both_sides_are_compared_with_what_is_around_and_at_values_of_either_sign() -> None:
    """1e9 sin(x), from where it is positive on, is 1e-4 off zero there by rounding; a step by y where y < 0 is one."""

    class Mixed(gl.Component):
        x, y, stiff, once, never = gl.Variable("1", start=0.0), gl.Variable("1"), *(gl.Variable("1") for _ in range(3))

        def equations(self) -> list[Any]:
            x, y, zero = self.x, self.y, (0, True)
            return [
                gl.Eq(gl.der(x), 1), gl.Eq(gl.der(y), 1), gl.Eq(self.stiff, gl.Piecewise((1e9 * gl.sin(x), gl.sin(x) > 0), zero)),
                gl.Eq(self.once, gl.Piecewise((gl.Piecewise((y, y < 0), zero), x > 2), zero)),
                gl.Eq(self.never, gl.Piecewise((gl.Piecewise((x - 2, y < 0), zero), x > 2), zero)),
            ]  # fmt: skip

    found = flatten(Mixed())
    jumps = {}
    for name in ("stiff", "once", "never"):
        g, i = found.places[equation_of(found, name)]
        relations = found.groups[g].template.relations
        jumps[name] = [str(relations[j].g) for j in jumping(found.groups[g], i, 0, found.parameters.defaults)]
    assert jumps["stiff"] == []
    assert [g.replace(" ", "") for g in jumps["once"]] == ["x-2"]
    assert jumps["never"] == ["y"]


class Scaled(gl.Component):
    """A bend times a mode, which is 0 or 1 from the start on: with an event or without."""

    x, y, w, a = gl.Variable("1", start=0.0), *(gl.Variable("1") for _ in range(3))
    on, value, silent = gl.Discrete("mode", start=1.0), gl.Parameter("1", default=1.0), gl.Structural(False)

    def equations(self) -> list[Any]:
        bend = gl.Piecewise((self.x - 0.3, self.x > 0.3), (0, True))
        law = gl.pre(self.on) * (gl.no_event(bend) if self.silent else bend)
        mode = gl.Eq(self.on, gl.Piecewise((9.0, gl.time > 10), (self.value, True)))
        return [
            gl.Eq(gl.der(self.x), 1),
            mode,
            gl.Eq(self.y, law),
            gl.Eq(self.w, gl.der(self.y)),
            gl.Eq(self.a, gl.der(self.w)),
        ]


@pytest.mark.parametrize("silent", [False, True])
def test_a_bend_that_a_mode_scales_cannot_be_differentiated_twice(silent: bool) -> None:
    """Its rate jumps unless the mode is zero. (With a mode of zero, no jump was seen whatever the mode was.)"""
    found = flatten(Scaled(silent=silent))
    e = equation_of(found, "y")
    counts = [2 if k == e else 0 for k in range(len(found.places))]
    g, i = found.places[e]
    template = found.groups[g].template
    if silent:
        (template,) = with_corners(found, counts, found.parameters.defaults).values()
    assert len(template.relations) == 1
    group = found.groups[g].take(np.array([i]), template)
    levels = [jumping(group, 0, level, found.parameters.defaults) for level in (0, 1)]
    assert levels == [[1], [0, 1]], "the mode at both, the relation at the second"
    if silent:
        return
    system = gl.compile(Scaled(), ["a"])
    with pytest.raises(ModelError, match=r"has a kink between t = 0.2 s and t = 0.4 s, but must be differentiated"):
        system.simulate(0.6, samples=4)["a"]
    flat = gl.compile(Scaled(value=0.0, start={"on": 0.0}), ["a"]).simulate(0.6, samples=4)
    assert flat["a"].tolist() == [0.0] * 4
