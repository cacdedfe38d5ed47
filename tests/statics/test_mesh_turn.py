"""Means over a turn of the mesh: what depends on the phase of a mesh takes the mean of a period, by closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0, j1

import gearlib as gl
import gearparts as gp
from gearlib.errors import ModelError
from gearlib.statics.mesh_turn import PARTS, nonlinear_columns, periodic_columns
from gearlib.statics.steady_motion import Given, solve
from tests.statics.test_mesh_turn_course import driven

Law = Callable[[Any, Any, Any], Any]  # of y = sin(phase), z = 1 + 2 w y and w

W = 5.0  # speed of the shaft, rad/s
LAWS: dict[str, tuple[Law, float]] = {
    "constant": (lambda y, z, w: 2 * w, 2 * W),
    "linear": (lambda y, z, w: 3 + y, 3.0),
    "square": (lambda y, z, w: 4 * y**2, 2.0),
    "cube": (lambda y, z, w: 1 + y**3, 1.0),
    "second follower": (lambda y, z, w: z**2, 1 + 4 * W**2 / 2),
    "both followers": (lambda y, z, w: y * z, W),
    "with the speed": (lambda y, z, w: w * y**2, W / 2),
    "above": (lambda y, z, w: gl.Piecewise((1, y > 0.5), (4, True)), 1 / 3 + 4 * 2 / 3),
    "below": (lambda y, z, w: gl.Piecewise((1, y < 0.5), (4, True)), 2 / 3 + 4 / 3),
    "beside the speed": (lambda y, z, w: gl.Piecewise((w, z > 1 + w), (4 * w, True)), W / 3 + 8 * W / 3),
    "of the speed alone": (lambda y, z, w: gl.Piecewise((y**2, w > 4.0), (7, True)), 0.5),
    "not of the speed": (lambda y, z, w: gl.Piecewise((7, w < 4.0), (y**2, True)), 0.5),
    "half a turn at zero": (lambda y, z, w: gl.Piecewise((1, gl.Max(y, 0) > 0), (2, True)), 1.5),
    "all of it at zero or above": (lambda y, z, w: gl.Piecewise((1, gl.Max(y, 0) >= 0), (2, True)), 1.0),
    "never below zero": (lambda y, z, w: gl.Piecewise((1, gl.Max(y, 0) < 0), (2, True)), 2.0),
    "half a turn not above": (lambda y, z, w: gl.Piecewise((1, gl.Max(y, 0) <= 0), (3, True)), 2.0),
    "rectified": (lambda y, z, w: abs(y), 2 / np.pi),
}  # fmt: skip


class Ripple(gl.Component):
    """A load whose torque depends on a phase that turns three times as fast as the shaft."""

    flange = gp.Flange("shaft")
    phase0 = gl.Parameter("rad", "where the turn begins", default=0.0)
    law = gl.Structural("constant")
    second = gl.Parameter("s", "unit of time", default=1.0)
    newton_metre = gl.Parameter("N.m", "unit of torque", default=1.0)
    w = gl.Variable("1", "speed")
    phase = gl.Variable("rad")
    y = gl.Variable("1")
    z = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.w, self.second * gl.der(self.flange.phi)),
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(-self.y, -gl.sin(self.phase + self.phase0)),
            gl.Eq(self.z - 1, 2 * self.w * self.y),
            gl.Eq(self.flange.tau, self.newton_metre * LAWS[self.law][0](self.y, self.z, self.w)),
        ]


class Shaft(gl.Component):
    phase0 = gl.Parameter("rad", default=0.0)

    def assemble(self) -> list[Any]:
        self.drive, self.body = gp.Torque(), gp.Inertia(J=1.0)
        self.load = [Ripple(law=law, phase0=self.phase0) for law in LAWS]
        return [gl.connect(self.drive.flange, self.body.flange_a, *(load.flange for load in self.load))]


@pytest.fixture(scope="module")
def shaft() -> gl.System:
    return gl.compile(Shaft())


@pytest.mark.parametrize("phase0", [2.0])
def test_torques_are_means_over_the_turn_wherever_it_begins(shaft: gl.System, phase0: float) -> None:
    flow = gl.power_flow(shaft, speeds={"body.w": W}, parameters={"phase0": phase0})
    found = {law: flow[f"load[{k}].flange"].torque for k, law in enumerate(LAWS)}
    for law, (_, expected) in LAWS.items():
        assert found[law] == pytest.approx(expected, abs=2e-3), law
    assert flow["drive.flange"].torque == pytest.approx(-sum(found.values()), rel=1e-12)
    assert flow["load[3].flange"].speed == W


class Spare(gl.Component):
    """``2 y = sin(phase) + 5 tau``, where tau is the torque at a flange that nothing is connected to; and a load of 4 y^2."""

    flange, spare = gp.Flange("shaft"), gp.Flange("free end")
    newton_metre = gl.Parameter("N.m", "unit of torque", default=1.0)
    phase, y = gl.Variable("rad"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(self.spare.phi, self.flange.phi),
            gl.Eq(2 * self.y, gl.sin(self.phase) + 5 * self.spare.tau / self.newton_metre),
            gl.Eq(self.flange.tau, self.newton_metre * 4 * self.y**2),
        ]


def test_what_is_zero_everywhere_hides_nothing_that_follows_from_the_phase() -> None:
    """The mean of (sin(phase) / 2)^2 is 1 / 8."""
    flow = gl.power_flow(driven(Spare()), speeds={"body.w": W})
    assert flow["load.flange"].torque == pytest.approx(0.5, rel=1e-9)


class Lagging(gl.Component):
    """``x = sin(phase) + 3 u``, where u has a rate of its own that brings it to 2; and a load of u x."""

    flange = gp.Flange("shaft")
    newton_metre, second = gl.Parameter("N.m", "unit of torque", default=1.0), gl.Parameter("s", default=1.0)
    phase, x, u = gl.Variable("rad"), gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(self.x, gl.sin(self.phase) + 3 * self.u),
            gl.Eq(self.second * gl.der(self.u), 2 - self.u),
            gl.Eq(self.flange.tau, self.newton_metre * self.u * self.x),
        ]


DIRECT: dict[str, tuple[Law, float]] = {  # of the phase, of the angle that turns a third as fast, and of the speed
    "compared": (lambda x, y, w: gl.Piecewise((1, gl.sin(x) > 0.5), (4, True)), 1 / 3 + 4 * 2 / 3),
    # sin(x) > 0.5 for 120 degrees of the angle, of which 40 are among the 120 where sin(y) > 0.5
    "both compared": (
        lambda x, y, w: gl.Piecewise((1, gl.sin(x) > 0.5), (4, gl.sin(y) > 0.5), (7, True)),
        (120 + 4 * 80 + 7 * 160) / 360,
    ),
    "square": (lambda x, y, w: 4 * gl.sin(x) ** 2, 2.0),
    "beside the speed": (lambda x, y, w: w * gl.cos(x + y) ** 2, W / 2),
}


class Direct(gl.Component):
    """A load by a law of two phases themselves."""

    flange, law = gp.Flange("shaft"), gl.Structural("square")
    newton_metre, second = gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)
    x, y, w = gl.Variable("rad"), gl.Variable("rad"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), 3 * gl.der(self.flange.phi)), gl.Eq(gl.der(self.y), gl.der(self.flange.phi)),
            gl.Eq(self.w, self.second * gl.der(self.flange.phi)),
            gl.Eq(self.flange.tau, self.newton_metre * DIRECT[self.law][0](self.x, self.y, self.w)),
        ]  # fmt: skip


@cache
def direct(law: str) -> gl.System:
    return driven(Direct(law=law))


@pytest.mark.parametrize("size", [1e-7, 1.0, 1e9])
@pytest.mark.parametrize("law", DIRECT)
def test_phases_count_with_their_turn_where_they_stand_in_the_law_itself(law: str, size: float) -> None:
    """Also if they are only compared, and whatever the unit of torque."""
    flow = gl.power_flow(direct(law), speeds={"body.w": W}, parameters={"load.newton_metre": size})
    assert flow["load.flange"].torque == pytest.approx(size * DIRECT[law][1], rel=2e-3)


def test_an_equation_that_is_written_for_one_variable_determines_no_other() -> None:
    """The mean of 2 (sin(phase) + 6)."""
    flow = gl.power_flow(driven(Lagging()), speeds={"body.w": W})
    assert flow["load.flange"].torque == pytest.approx(12.0, rel=1e-9)


RATES: dict[
    str, tuple[Law, float | None]
] = {  # of the rates of sin(phase), of the phase and of u, and the mean, if it is known
    "linear": (lambda y, p, u: 2 + y + 3 * u, 2.0),
    "condition": (lambda y, p, u: gl.Piecewise((1, y > 0), (4, True)), None),
    "square": (lambda y, p, u: y**2, None),
    "product with the rate of the phase": (lambda y, p, u: 2 + p * y, 2.0),
    "condition on the rate of the phase": (lambda y, p, u: gl.Piecewise((1, p > 14.0), (4, True)), 1.0),
    "square of the rate of the phase": (lambda y, p, u: p**2, 225.0),
    "condition on the rate of a loop": (lambda y, p, u: gl.Piecewise((1, u > 0), (4, True)), None),
}


class Rated(gl.Component):
    """``y = sin(phase)``, ``u = sin(phase) + v / 2`` and ``v = 0.4 u``; and a torque that depends on their rates."""

    flange = gp.Flange("shaft")
    law = gl.Structural("linear")
    newton_metre, second = gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)
    phase = gl.Variable("rad")
    y, u, v = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        rates = [self.second * gl.der(x) for x in (self.y, self.phase, self.u)]
        return [
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(self.y, gl.sin(self.phase)),
            gl.Eq(self.u, gl.sin(self.phase) + self.v / 2),
            gl.Eq(self.v, 0.4 * self.u),
            gl.Eq(self.flange.tau, self.newton_metre * RATES[self.law][0](*rates)),
        ]


@pytest.mark.parametrize("law", RATES)
def test_rates_that_vary_with_the_phase_have_means_only(law: str) -> None:
    """The phase has the constant rate 15 rad/s; rates that change sign within the turn are in no condition, square or product."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body, self.load = gp.Torque(), gp.Inertia(J=1.0), Rated(law=law)
            return [gl.connect(self.drive.flange, self.body.flange_a, self.load.flange)]

    system, expected = gl.compile(Driven()), RATES[law][1]
    if expected is not None:
        assert gl.power_flow(system, speeds={"body.w": W})["load.flange"].torque == pytest.approx(expected, abs=1e-9)
        return
    with pytest.raises(
        ModelError, match=r"^Rated: flange\.tau = .*: its mean .* is not known, since load\.[yu] has a rate that varies"
    ):
        gl.power_flow(system, speeds={"body.w": W})


class Coupled(gl.Component):
    """``u = sin(phase) + v / 2`` and ``v = 0.4 u``, so ``u = 1.25 sin(phase)``; and a torque that depends on them."""

    flange = gp.Flange("shaft")
    law = gl.Structural("linear")
    newton_metre = gl.Parameter("N.m", "unit of torque", default=1.0)
    phase = gl.Variable("rad")
    u, v = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        laws = {
            "linear": 2 + self.u + 3 * self.v, "square": 2 + self.u**2, "product": 2 + self.v * gl.cos(self.phase),
            "condition": gl.Piecewise((1, self.v > 0.5), (2, True)),
        }  # fmt: skip
        return [
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(self.u, gl.sin(self.phase) + self.v / 2),
            gl.Eq(self.v, 0.4 * self.u),
            gl.Eq(self.flange.tau, self.newton_metre * laws[self.law]),
        ]


@pytest.mark.parametrize("law", ["linear", "square", "product", "condition"])
def test_variables_that_determine_each_other_have_means_only(law: str) -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body, self.load = gp.Torque(), gp.Inertia(J=1.0), Coupled(law=law)
            return [gl.connect(self.drive.flange, self.body.flange_a, self.load.flange)]

    system = gl.compile(Driven())
    if law == "linear":
        flow = gl.power_flow(system, speeds={"body.w": W})
        assert flow["load.flange"].torque == pytest.approx(2.0, abs=1e-9)
        return
    with pytest.raises(
        ModelError, match=r"^Coupled: flange\.tau = .*: its mean .* is not known, since load\.[uv] follows from"
    ):
        gl.power_flow(system, speeds={"body.w": W})


class Beside(gl.Component):
    """``u = w / 10 + v / 2`` and ``v = 0.4 u``, so ``u = w / 8``: a loop that the phase has no part in; and a gear that is chosen."""

    flange = gp.Flange("shaft")
    newton_metre, second = gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)
    phase = gl.Variable("rad")
    u, v, w = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    n = gl.Discrete(start=1.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.n, gl.Piecewise((3, self.w > 4.0), (1, True))),
            gl.Eq(self.w, self.second * gl.der(self.flange.phi)),
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(self.u, self.w / 10 + self.v / 2),
            gl.Eq(self.v, 0.4 * self.u),
            gl.Eq(self.flange.tau, self.newton_metre * (2 + self.u**2 + self.n * gl.sin(self.phase) ** 2)),
        ]


def test_a_loop_beside_the_phase_is_solved() -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body, self.load = gp.Torque(), gp.Inertia(J=1.0), Beside()
            return [gl.connect(self.drive.flange, self.body.flange_a, self.load.flange)]

    system = gl.compile(Driven())
    for w, n in ((W, 3), (3.0, 1)):
        flow = gl.power_flow(system, speeds={"body.w": w})
        assert flow["load.flange"].torque == pytest.approx(2 + n / 2 + (w / 8) ** 2, rel=1e-9)


class Yielding(gl.Component):
    """A shaft whose stiffness varies with its phase, and which loses a torque that grows with the square of what it carries."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    c, loss = gl.Parameter("N.m/rad", default=400.0), gl.Parameter("1/(N.m)", default=0.01)
    phase, q, half = gl.Variable("rad"), gl.Variable("rad", start=0.0), gl.Variable("N.m", "half of what it carries")

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        return [
            gl.Eq(gl.der(self.phase), 3 * gl.der(a.phi)),
            gl.Eq(gl.der(self.q), gl.der(a.phi) - gl.der(b.phi)),
            gl.Eq(self.half, self.c * (1 + gl.cos(self.phase) / 2) * self.q),
            gl.Eq(a.tau, 2 * self.half),
            gl.Eq(b.tau, -2 * self.half + self.loss * (2 * self.half) ** 2),
        ]


def test_a_deflection_adapts_to_the_torque_at_each_phase() -> None:
    """The torque is the same at each phase, not the deflection: what is lost is the square of the mean."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.load, self.shaft = gp.Torque(), gp.Torque(), Yielding()
            self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            return [
                gl.connect(self.drive.flange, self.a.flange_a), gl.connect(self.a.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.b.flange_a), gl.connect(self.b.flange_b, self.load.flange),
            ]  # fmt: skip

    flow = gl.power_flow(gl.compile(Driven()), speeds={"a.w": W}, torques={"drive.tau": 10.0})
    assert flow["shaft.flange_a"].torque == pytest.approx(10.0, rel=1e-12)
    assert flow["shaft.flange_b"].torque == pytest.approx(-9.0, rel=1e-9)
    assert flow["b.flange_a"].speed == pytest.approx(W, rel=1e-12)


COURSES: dict[str, tuple[Callable[[Any, Any], Any], bool | None]] = {  # whether it grows in a turn; None: it does not repeat
    "sine": (lambda x, r: gl.sin(x + 0.3), False),
    "grows": (lambda x, r: x + gl.sin(x) / 2, True),
    "falls": (lambda x, r: r * (gl.cos(x) - 4 * x), True),
    "half as fast": (lambda x, r: gl.sin(x / 2), None),
    "square": (lambda x, r: x**2 / 10, None),
    "square beside a condition": (lambda x, r: x**2 / 10 + gl.Piecewise((1, gl.sin(x) > 0), (0, True)), None),
    "product": (lambda x, r: r * x * gl.sin(x), None),
    "linear": (lambda x, r: 3 * x, None),
    "beside a magnitude": (lambda x, r: gl.sin(x) + abs(r), False),  # far from zero that grows evenly, too
}


class Courses(gl.Component):
    """A function of an absolute angle each, with another variable beside it."""

    flange = gp.Flange("shaft")
    course = gl.Structural("sine")
    r, y = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        law = COURSES[self.course][0](self.flange.phi, self.r)
        return [gl.Eq(self.y, law), gl.Eq(gl.der(self.r), -self.y), gl.Eq(self.flange.tau, 0.01 * self.r)]


def test_what_repeats_in_every_turn_is_found() -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body = gp.Torque(), gp.Inertia(J=1.0)
            self.each = [Courses(course=course) for course in COURSES]
            return [gl.connect(self.drive.flange, self.body.flange_a, *(one.flange for one in self.each))]

    translation = gl.compile(Driven()).translation
    model = translation.structure.complete
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, model.n_variables)) + 50.0
    nothing = np.zeros(model.n_variables, bool)
    periodic = periodic_columns(model, translation.parameter_values({}), a, b, model.initial_discrete(), nothing)
    found: dict[str, bool | None] = dict.fromkeys(COURSES)
    angle = model.variable("body.phi")
    for g, columns in periodic.items():
        group = model.groups[g]
        for c, column in columns.items():
            name, order = (*group.template.columns, *group.template.relation_columns)[c]
            assert order == 0
            assert (group.variables[:, group.template.locals.index(name)] == model.representative[angle]).all()
            assert column.turns.all()
            for i, each in enumerate(column.grow.tolist()):
                found[list(COURSES)[int(model.owner(g, i).removeprefix("each[").removesuffix("]"))]] = each
    assert found == {course: grows for course, (_, grows) in COURSES.items()}
    for group in model.groups:
        names = [group.template.columns[c][0] for c in nonlinear_columns(group.template)]
        assert all(name.endswith(("phi", "r")) for name in names)
        assert bool(names) == (not group.template.linear)


class Sinusoidal(gl.Component):
    """A load of 1 N.m times a function of what follows from a phase of three turns for each of the shaft, or from a number."""

    flange = gp.Flange("shaft")
    law = gl.Structural("constant")
    alpha, phase, x = gl.Parameter("rad", default=0.5), gl.Variable("rad"), gl.Variable("rad")
    n = gl.Parameter("N.m", default=1.0)

    def equations(self) -> list[Any]:
        followed, torque = {
            "constant": (self.alpha, 3 + 2 * gl.sin(self.x)),
            "bounded": (self.alpha * gl.sin(self.phase), gl.cos(self.x)),
            "its square": (self.alpha * gl.sin(self.phase), gl.cos(self.x) ** 2),
            "a ramp with a ripple": (self.phase + self.alpha * gl.sin(self.phase), gl.cos(self.x)),
            "twice": (2 * self.phase, gl.cos(self.x) * gl.cos(self.phase) ** 2),
            "the phase": (self.phase, 3 + 2 * gl.sin(self.x)),
            "four times a turn": (self.phase, 3 + 2 * gl.sin(4 * self.x) ** 2),
            "a condition": (self.phase, gl.Piecewise((1, gl.sin(self.x) > 0.5), (4, True))),
            "the least": (self.phase, gl.Min(gl.sin(self.x), -0.5)),
            "the least, and its square": (gl.Min(gl.sin(self.phase), -0.5), self.x**2),
        }[self.law]
        turns = gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi))
        return [turns, gl.Eq(self.x, followed), gl.Eq(self.flange.tau, self.n * torque)]


MEANS = {
    "constant": 3 + 2 * math.sin(0.5), "bounded": j0(0.5), "its square": (1 + j0(1.0)) / 2, "a ramp with a ripple": -j1(0.5),
    "twice": 0.25, "the phase": 3.0, "four times a turn": 4.0, "a condition": 3.0, "the least": -1 / 3 - math.sqrt(3) / (2 * math.pi),
    "the least, and its square": 1 / 3 + math.sqrt(3) / (8 * math.pi),
}  # fmt: skip


WITH_ALPHA = ("constant", "bounded", "its square", "a ramp with a ripple")


@pytest.mark.parametrize("law", MEANS)
def test_what_follows_from_a_phase_or_a_number_does_not_turn_by_itself(law: str) -> None:
    """Means over a turn as integrals of Bessel, of two such loads: the number of the second has the other sign."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body = gp.Torque(), gp.Inertia(J=1.0)
            self.loads = [
                Sinusoidal(law=law),
                Sinusoidal(law=law, **({"alpha": -0.5} if law in WITH_ALPHA else {})),
            ]
            return [gl.connect(self.drive.flange, self.body.flange_a, *(load.flange for load in self.loads))]

    flow = gl.power_flow(gl.compile(Driven()), speeds={"body.w": 5.0})
    other = {"constant": 3 - 2 * math.sin(0.5), "a ramp with a ripple": j1(0.5)}.get(law, MEANS[law])
    error = 3 / PARTS if law == "a condition" else 1e-8  # a jump is placed to a point
    assert flow["loads[0].flange"].torque == pytest.approx(MEANS[law], abs=error)
    assert flow["loads[1].flange"].torque == pytest.approx(other, abs=error)
    assert flow["drive.flange"].torque == pytest.approx(-MEANS[law] - other, abs=2 * error)


class TwoPhases(gl.Component):
    """A load of two phases, the second of which begins at an angle, and of two variables that follow from each other."""

    flange, p, q = gp.Flange("shaft"), gl.Variable("rad", start=0.0), gl.Variable("rad")
    rates, law, n = gl.Structural((1, 1)), gl.Structural(None), gl.Parameter("N.m", default=1.0)
    w, u, v, z = gl.Variable("1"), gl.Variable("1"), gl.Variable("1"), gl.Variable("1", "a wave beside the speed")
    s = gl.Parameter("s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        turned = [gl.Eq(gl.der(x), r * gl.der(self.flange.phi)) for x, r in zip((self.p, self.q), self.rates, strict=True)]
        loop = [gl.Eq(self.u + 2 * self.v, 3 + gl.sin(self.p)), gl.Eq(self.u - 4 * self.v, 0)]
        speed = [gl.Eq(x, y + self.s * gl.der(self.flange.phi)) for x, y in ((self.w, 0.0), (self.z, gl.sin(self.p)))]
        return [*turned, *loop, *speed, gl.Eq(self.flange.tau, self.n * self.law(self.p, self.q, self.u, self.w, self.z))]


BEGIN = 0.7
TOGETHER = {  # rates, law, mean over time at 5 rad/s
    "of one rate": ((1, 1), lambda p, q, u, w, z: gl.cos(p) * gl.cos(q), math.cos(BEGIN) / 2),
    "against each other": ((3, -3), lambda p, q, u, w, z: gl.cos(p) * gl.cos(q), math.cos(BEGIN) / 2),
    "of other rates": ((1, 2), lambda p, q, u, w, z: gl.cos(p) * gl.cos(q), 0.0),
    "the square with twice the angle": ((1, 2), lambda p, q, u, w, z: gl.cos(p) ** 2 * gl.cos(q), math.cos(BEGIN) / 4),
    "2 to 3": ((2, 3), lambda p, q, u, w, z: gl.cos(3 * p) * gl.cos(2 * q), math.cos(2 * BEGIN) / 2),
    "a loop times a speed": ((1, 1), lambda p, q, u, w, z: w * u, 10.0),
    "a wave beside a steady rate": ((1, 1), lambda p, q, u, w, z: z**2, 25.5),
}


@pytest.mark.parametrize("law", TOGETHER)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_two_phases_meet_as_their_rates_and_beginnings_are(law: str, way: float) -> None:
    """The steps of each phase are as the rates are, where phases meet in a product alone, too."""
    rates, torque, mean = TOGETHER[law]

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body = gp.Torque(), gp.Inertia(J=1.0)
            self.load = TwoPhases(rates=rates, law=torque, start={"q": BEGIN})
            return [gl.connect(self.drive.flange, self.body.flange_a, self.load.flange)]

    system, mean = gl.compile(Driven()), mean * (way if "speed" in law else 1.0)
    flow = gl.power_flow(system, speeds={"body.w": way * 5.0})
    assert flow["load.flange"].torque == pytest.approx(mean, abs=1e-9)
    model, numbers = (
        system.translation.structure.complete,
        system.translation.parameter_values({}),
    )  # also without a point to begin
    speed, tau = (model.variable(name) for name in ("body.w", "load.flange.tau"))
    given = Given("w", int(model.representative[speed]), 0, way * 5.0 * int(model.sign[speed]))
    motion = solve(model, numbers, [given])
    assert motion.constants[model.representative[tau]] * model.sign[tau] == pytest.approx(mean, abs=1e-9)


@pytest.mark.parametrize("speed", [1 / 3, -1 / 3])
def test_a_phase_of_one_radian_in_a_second_turns(speed: float) -> None:
    """What repeats every turn is averaged at any rate."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body, self.load = gp.Torque(), gp.Inertia(J=1.0), Sinusoidal(law="a ramp with a ripple")
            return [gl.connect(self.drive.flange, self.body.flange_a, self.load.flange)]

    flow = gl.power_flow(gl.compile(Driven()), speeds={"body.w": speed})
    assert flow["load.flange"].torque == pytest.approx(-j1(0.5), abs=1e-8)


class Leaning(gl.Component):
    """A load that depends on its angle, as that of a pendulum."""

    flange, n = gp.Flange("shaft"), gl.Parameter("N.m", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, self.n * (3 + 2 * gl.sin(self.flange.phi)))]


@pytest.mark.parametrize("c", [math.inf, 100.0, 5.0])
def test_an_angle_that_stands_still_is_not_averaged(c: float) -> None:
    """At 0.3 rad on the ground, or behind a spring; beside another one on a shaft that turns."""

    class Held(gl.Component):
        def assemble(self) -> list[Any]:
            self.ground, self.leaning, self.drive = gp.Fixed(phi0=0.3), Leaning(), gp.Torque()
            self.body, self.turned = gp.Inertia(J=1.0), Leaning()
            links = [gl.connect(self.drive.flange, self.body.flange_a, self.turned.flange)]
            if math.isinf(c):
                return [*links, gl.connect(self.ground.flange, self.leaning.flange)]
            self.spring = gp.Spring(c=c)
            return [
                *links, gl.connect(self.ground.flange, self.spring.flange_a),
                gl.connect(self.spring.flange_b, self.leaning.flange),
            ]  # fmt: skip

    flow = gl.power_flow(gl.compile(Held()), speeds={"body.w": 5.0})
    angle = 0.3 if math.isinf(c) else brentq(lambda phi: c * (phi - 0.3) + 3 + 2 * math.sin(phi), -2.0, 1.0, xtol=1e-14)
    assert flow["leaning.flange"].torque == pytest.approx(3 + 2 * math.sin(angle), rel=1e-9)
    assert flow["ground.flange"].torque == pytest.approx(-3 - 2 * math.sin(angle), rel=1e-9)
    assert flow["turned.flange"].torque == pytest.approx(3.0, rel=1e-9)


class Magnetic(gl.Component):
    """A coupling whose torque is a sinusoid of its twist."""

    a, b, twist = gp.Flange("one end"), gp.Flange("other end"), gl.Variable("rad", "twist")
    most = gl.Parameter("N.m", "pull-out torque")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.twist, self.b.phi - self.a.phi),
            gl.Eq(self.b.tau, self.most * gl.sin(self.twist)),
            gl.Eq(self.a.tau, -self.b.tau),
        ]


@pytest.mark.parametrize("most", [10.0, 4.5, -5.0, 3.5])
def test_a_twist_that_must_stand_still_holds_the_torque_up_to_that_of_pulling_out(most: float) -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.motor, self.coupling = gp.Torque(), Magnetic(most=most)
            self.load = gp.LinearSpeedDependentTorque(tau_nominal=-4.0, w_nominal=5.0)
            self.body, self.other = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            return [
                gl.connect(self.motor.flange, self.body.flange_a),
                gl.connect(self.body.flange_b, self.coupling.a),
                gl.connect(self.coupling.b, self.other.flange_a),
                gl.connect(self.other.flange_b, self.load.flange),
            ]

    system = gl.compile(Driven())
    if abs(most) < 4.0:
        with pytest.raises(gl.GearlibError, match="no steady motion"):
            gl.power_flow(system, speeds={"other.w": 5.0})
        return
    flow = gl.power_flow(system, speeds={"other.w": 5.0})
    assert [flow[f"coupling.{end}"].torque for end in "ab"] == pytest.approx([4.0, -4.0], rel=1e-9)
    assert flow["motor.flange"].power == pytest.approx(-20.0, rel=1e-9)
