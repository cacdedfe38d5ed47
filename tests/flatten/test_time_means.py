"""How far what changes with time is off its mean at time 0, against averages of many samples."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.flatten.flatten import flatten
from gearlib.flatten.time_means import held_in_time, in_words, off_mean

Law = Callable[[Any, Any], Any]


class Led(gl.Component):
    """A variable that follows a law of time, beside one that does not; a and w are parameters of the law."""

    law: Law = staticmethod(lambda m, t: 0.0)
    a, w = gl.Parameter("1", default=1.5), gl.Parameter("rad/s", default=2.0)
    x, y = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), -self.x + type(self).law(self, gl.time)), gl.Eq(self.y, 2 * self.x)]


def led(law: Any) -> Any:
    return type("Led", (Led,), {"law": staticmethod(law)})


def branch(condition: Any, one: Any, other: Any) -> Any:
    return gl.Piecewise((one, condition), (other, True))


@pytest.mark.parametrize(
    "law",
    [
        lambda s, m, t: 3.0 + m.sin(t), lambda s, m, t: m.cos(s.w * t) - 1, lambda s, m, t: s.a * m.sin(3 * t + 0.5) ** 2,
        lambda s, m, t: m.cos(t) * m.cos(2 * t) * m.cos(3 * t) + s.a, lambda s, m, t: s.a * m.cos(s.w * t) ** 2 + 0.25 * m.sin(t),
    ],
)  # fmt: skip
def test_a_periodic_law_is_off_its_mean(law: Any) -> None:
    """Of the equation x' + x - law; two parts with other parameters each have their own."""
    numbers = [{"a": 1.5, "w": 2.0}, {"a": -0.5, "w": 3.0}]

    class Both(gl.Component):
        def assemble(self) -> list[Any]:
            kind = led(lambda s, t: law(s, gl, t))
            self.part = [kind(**gl.offered(given)) for given in numbers]
            return []

    model = flatten(Both())
    found = {g.template.timed: off_mean(g, model.parameters.defaults) for g in model.groups}
    t = 2 * np.pi * np.arange(64) / 64  # one period of all
    values = [np.broadcast_to(law(type("Numbers", (), given), np, t), 64) for given in numbers]
    np.testing.assert_allclose(found[True], [v.mean() - v[0] for v in values], atol=1e-14)
    assert found[False].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("law", "off"),
    [
        (lambda s, t: branch(t < 0, 5 + gl.sin(t), gl.cos(t)), -1.0), (lambda s, t: branch(t <= -1, 5 + gl.sin(t), gl.cos(t)), -1.0),
        (lambda s, t: branch(t > -1, gl.cos(t), 5 + gl.sin(t)), -1.0), (lambda s, t: branch(t >= 0, gl.cos(t), 5 + gl.sin(t)), -1.0),
        (lambda s, t: branch(gl.cos(s.w * t) > s.a, gl.sin(t), gl.cos(t)), -1.0),
        (lambda s, t: branch(gl.cos(s.w * t) < s.a, gl.sin(t), gl.cos(t)), 0.0),
        (lambda s, t: branch(gl.cos(t) > 1.25, gl.sin(t), gl.cos(t)), -1.0),
        (lambda s, t: branch(gl.cos(2 * t) < -1.25, gl.sin(t), gl.cos(t)), -1.0),
        (lambda s, t: branch(0.1 * gl.cos(t) > -0.5, gl.cos(t), gl.sin(t)), -1.0),
        (lambda s, t: branch(0.1 * gl.cos(t) > 0.5, gl.sin(t), gl.cos(t)), -1.0),
        (lambda s, t: branch(0.1 * gl.cos(t) <= 0.5, gl.cos(t), gl.sin(t)), -1.0),
        (lambda s, t: branch(0.1 * gl.cos(t) <= -0.5, gl.sin(t), gl.cos(t)), -1.0),
        (lambda s, t: branch(t > 1, 1, 2), np.nan), (lambda s, t: branch(t < 1e-4, 1, 2), np.nan),
        (lambda s, t: branch(t < 1e6, 1, 2), np.nan),
        (lambda s, t: branch(gl.sin(t) > 0.5, 1, 2), np.nan), (lambda s, t: t, np.nan), (lambda s, t: gl.exp(-t), np.nan),
        (lambda s, t: t * gl.sin(t), np.nan), (lambda s, t: (s.x + 1) * gl.sin(t), np.nan), (lambda s, t: branch(s.x > t, 1, 2), np.nan),
        (lambda s, t: branch(s.x > 0, gl.cos(t), gl.sin(t)), np.nan), (lambda s, t: branch(s.x > 0, 1, 2) + gl.cos(t), -1.0),
        (lambda s, t: s.a * gl.sin(t + 1e-14), 0.0), (lambda s, t: 1e-9 * gl.cos(t), -1e-9),
    ],
)  # fmt: skip
def test_conditions_of_time_hold_for_ever_or_there_is_no_mean(law: Any, off: float) -> None:
    """With one that cannot change, the mean is that of its branch; what is off by rounding is not off."""
    model = flatten(led(law)())
    (group,) = (g for g in model.groups if g.template.timed)
    found = off_mean(group, model.parameters.defaults)
    np.testing.assert_allclose(found, [off], rtol=1e-12, atol=0)
    for means in (False, True):
        counted = np.isnan(off) if means else off != 0
        assert held_in_time(model, model.parameters.defaults, means) == ["Led"] * bool(counted)


class Passing(gl.Component):
    """Hands its torque to a source."""

    flange = gp.Flange("shaft")
    u = gl.Input("N.m", "torque")

    def assemble(self) -> list[Any]:
        self.w = gp.Torque(tau=self.u)
        return [gl.connect(self.flange, self.w.flange)]


class Driven(gl.Component):
    """Sources on one shaft, whose torques are a step, sinusoids and numbers."""

    def assemble(self) -> list[Any]:
        t = gl.time
        laws = [gl.sin(t), gl.cos(t), 3.0, *[gl.cos(t)] * 7, branch(t < 1, 0.0, 1.0)]
        self.torque = [gp.Torque(tau=law) for law in laws]
        self.a = Passing(u=branch(t < 2, 1.0, 0.0))
        self.load, self.drag = gp.Inertia(J=1.0), gp.Damper(d=0.5)
        self.ground = gp.Fixed()
        shaft = [*(source.flange for source in self.torque), self.a.flange, self.load.flange_a, self.drag.flange_a]
        return [gl.connect(*shaft), gl.connect(self.drag.flange_b, self.ground.flange)]


def test_inputs_are_named_once_and_in_order() -> None:
    """A sine is at its mean; of an input that is handed down, the first name counts."""
    model = flatten(Driven())
    numbers = model.parameters.defaults
    assert held_in_time(model, numbers, means=True) == ["a.u", "torque[10].tau"]
    cosines = [f"torque[{k}].tau" for k in (1, *range(3, 10))]
    assert held_in_time(model, numbers, means=False) == ["a.u", *cosines, "torque[10].tau"]
    assert in_words(["a.u"]) == "changes with time, and counts with its value at t = 0"
    assert in_words(["a.u", "b.u"]) == "change with time, and count with their values at t = 0"


def test_the_power_flow_has_the_mean_of_the_branch_that_holds() -> None:
    """A drive of 3 + cos(t) N.m, written with a branch for times before 0, against a drag of 0.5 N.m.s: 9 / 0.5 W."""

    class Turned(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque = gp.Torque(tau=branch(gl.time < 0, 8.0 + gl.sin(gl.time), 3.0 + gl.cos(gl.time)))
            self.load, self.drag, self.ground = gp.Inertia(J=1.0), gp.Damper(d=0.5), gp.Fixed()
            return [
                gl.connect(self.torque.flange, self.load.flange_a), gl.connect(self.load.flange_b, self.drag.flange_a),
                gl.connect(self.drag.flange_b, self.ground.flange),
            ]  # fmt: skip

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        flow = gl.power_flow(gl.compile(Turned()))
    assert flow["load.flange_a"].speed == pytest.approx(6.0)
