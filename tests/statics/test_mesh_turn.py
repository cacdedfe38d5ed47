"""Means over a turn of the mesh: what depends on the phase of a mesh takes the mean of a period, by closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ModelError
from gearlib.statics.mesh_turn import nonlinear_columns, repeating_columns

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

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body, self.load = gp.Torque(), gp.Inertia(J=1.0), Spare()
            return [gl.connect(self.drive.flange, self.body.flange_a, self.load.flange)]

    flow = gl.power_flow(gl.compile(Driven()), speeds={"body.w": W})
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


def test_an_equation_that_is_written_for_one_variable_determines_no_other() -> None:
    """The mean of 2 (sin(phase) + 6)."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body, self.load = gp.Torque(), gp.Inertia(J=1.0), Lagging()
            return [gl.connect(self.drive.flange, self.body.flange_a, self.load.flange)]

    flow = gl.power_flow(gl.compile(Driven()), speeds={"body.w": W})
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
    repeating = repeating_columns(model, translation.parameter_values({}), a, b, model.initial_discrete())
    found: dict[str, bool | None] = dict.fromkeys(COURSES)
    angle = model.variable("body.phi")
    for g, columns in repeating.items():
        group = model.groups[g]
        for c, grows in columns.items():
            name, order = group.template.columns[c]
            assert order == 0
            assert (group.variables[:, group.template.locals.index(name)] == model.representative[angle]).all()
            for i, each in enumerate(grows.tolist()):
                found[list(COURSES)[int(model.owner(g, i).removeprefix("each[").removesuffix("]"))]] = each
    assert found == {course: grows for course, (_, grows) in COURSES.items()}
    for group in model.groups:
        names = [group.template.columns[c][0] for c in nonlinear_columns(group.template)]
        assert all(name.endswith(("phi", "r")) for name in names)
        assert bool(names) == (not group.template.linear)
