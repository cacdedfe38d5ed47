"""Steady states: what grows, what vanishes, which of several it is, and what is refused."""

from __future__ import annotations

import warnings
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.errors import StartError
from gearlib.run import steady
from gearlib.run.steady import Search, continued
from tests.gearparts.msl_examples import CompareBrakingTorque
from tests.gearparts.msl_hybrid_examples import Backlash

c = gl.connect


def drag(tau: float, w: float) -> gp.LinearSpeedDependentTorque:
    """A load of tau at the speed w, in proportion to the speed."""
    return gp.LinearSpeedDependentTorque(tau_nominal=-tau, w_nominal=w, torque_direction=False)


class Between(gl.Component):
    """Torque, body, what is given between two bodies (side by side), body, load of 1 N.m at 3 rad/s: at 7 N.m it turns at 21 rad/s."""

    links = gl.Structural(())
    tau = gl.Parameter("N.m", default=7.0)

    def assemble(self) -> list[Any]:
        self.torque, self.a, self.b = gp.Torque(tau=self.tau), gp.Inertia(J=0.1), gp.Inertia(J=4.0)
        self.load, self.links_ = drag(1.0, 3.0), [make() for make in self.links]
        return [
            c(self.torque.flange, self.a.flange_a),
            c(self.a.flange_b, *(link.flange_a for link in self.links_)),
            c(*(link.flange_b for link in self.links_), self.b.flange_a),
            c(self.b.flange_b, self.load.flange),
        ]


LINKS = {
    "spring": (lambda: gp.SpringDamper(c=1e3, d=1.0),),
    "two springs": (lambda: gp.SpringDamper(c=1e3, d=1.0), lambda: gp.Spring(c=400.0)),
    "spring, twisted spring and damper": (
        lambda: gp.Spring(c=1e3),
        lambda: gp.Spring(c=400.0, phi_rel0=0.01),
        lambda: gp.Damper(d=1.0),
    ),
    "disc": (lambda: gp.Disc(delta_phi=0.45),),
    "hardening spring": (lambda: gp.CubicSpringDamper(c=1e3, c_3=1e5, d=1.0),),
    "gap": (lambda: gp.ElastoBacklash(c=1e3, d=1.0, b=0.1),),
    "gap and spring": (lambda: gp.ElastoBacklash(c=1e3, d=1.0, b=0.1), lambda: gp.Spring(c=400.0)),
    "clutch": (lambda: gp.Clutch(fn_max=100.0, f_normalized=1.0),),
    "coupling": (lambda: gp.ElasticCoupling(J_a=0.1, J_b=0.2, c=1e3, d=1.0),),
    "shaft": (lambda: gp.TorsionalShaft(segments=3, J=0.3, c=1e3, d=1.0),),
}


@pytest.mark.parametrize("kind", LINKS)
def test_both_sides_turn_at_the_speed_of_the_load(kind: str) -> None:
    run = gl.compile(Between(links=LINKS[kind])).simulate(5.0, start="steady", samples=3, rtol=1e-9)
    for body in ("a", "b"):
        assert run[f"{body}.w"] == pytest.approx(np.full(3, 21.0), rel=1e-6)
        assert abs(run[f"der({body}.w)"]).max() < 1e-5


class MeshPair(gl.Component):
    """Torque on a pinion, a detailed mesh 1:2, a wheel with a damper to ground."""

    backlash = gl.Structural(False)
    stiffness = gl.Structural("constant")
    tau = gl.Parameter("N.m", default=2.0)

    def assemble(self) -> list[Any]:
        self.t, self.a, self.z = gp.Torque(tau=self.tau), gp.Inertia(J=0.01), gp.Inertia(J=0.1)
        self.m = gp.DetailedExternalMesh(
            r_a=0.05, r_b=0.1, c=1e8, d=500.0, backlash=self.backlash, stiffness=self.stiffness,
            **gl.offered({"b": 1e-4, "c_amplitude": 0.2}),
        )  # fmt: skip
        self.f, self.g = gp.Damper(d=0.1), gp.Fixed()
        return [
            c(self.t.flange, self.a.flange_a), c(self.a.flange_b, self.m.flange_a), c(self.m.flange_b, self.z.flange_a),
            c(self.z.flange_b, self.f.flange_a), c(self.f.flange_b, self.g.flange),
        ]  # fmt: skip


@pytest.mark.parametrize("outputs", [None, ["z.w"], ["z.phi", "a.phi", "m.q"], ["m.f"]])
@pytest.mark.parametrize("backlash", [False, True])
def test_a_detailed_mesh_turns(outputs: list[str] | None, backlash: bool) -> None:
    """2 N.m on r = 0.05 m press with 40 N on r = 0.1 m: 4 N.m against 0.1 w."""
    run = gl.compile(MeshPair(backlash=backlash), outputs).simulate(1.0, start="steady", samples=3)
    assert run["z.w"] == pytest.approx(np.full(3, -40.0), rel=1e-6)
    assert run["m.f"] == pytest.approx(np.full(3, 40.0), rel=1e-4)


def test_a_stiffness_that_varies_with_the_turning_has_no_steady_state() -> None:
    system = gl.compile(MeshPair(stiffness="sinusoidal"))
    with pytest.raises(StartError, match=r"no steady state was found: the equations vary with m\.turned.*periodic"):
        system.simulate(1.0, start="steady")
    still = system.simulate(1.0, start="steady", parameters={"tau": 0.0}, samples=2)
    assert abs(still["z.w"]).max() < 1e-12


@pytest.mark.parametrize("backlash", [False, True])
def test_poles_are_those_of_the_teeth_in_contact(backlash: bool) -> None:
    r"""Also where the search begins inside the open gap: those of a w' = T - r (c q + d q'), z w' = ..., q' = r w."""
    J, r, load = np.array([0.01, 0.1]), np.array([0.05, 0.1]), np.diag([0.0, 0.1])
    A = np.block([[(-500.0 * np.outer(r, r) - load) / J[:, None], (-1e8 * r / J)[:, None]], [r, np.zeros(1)]])
    poles = np.asarray(gl.stability(gl.compile(MeshPair(backlash=backlash)), at="steady").eigenvalues)
    turning = np.sort_complex(poles[abs(poles) > 1e-9])
    assert turning == pytest.approx(np.sort_complex(np.linalg.eigvals(A)), rel=1e-6)


def free(tau: float, load: list[Any]) -> gl.System:
    """Torque, body, spring and damper, body, and loads on that."""

    class Free(gl.Component):
        def assemble(self) -> list[Any]:
            self.t, self.a, self.s, self.b = (
                gp.Torque(tau=tau),
                gp.Inertia(J=0.01),
                gp.SpringDamper(c=1e4, d=0.1),
                gp.Inertia(J=0.1),
            )
            self.loads = load
            return [
                c(self.t.flange, self.a.flange_a),
                c(self.a.flange_b, self.s.flange_a),
                c(self.s.flange_b, self.b.flange_a, *(one.flange for one in self.loads)),
            ]

    return gl.compile(Free())


def test_without_a_load_there_is_none() -> None:
    """2 N.m on 0.11 kg.m2 in all."""
    with pytest.raises(StartError, match=r"der\((a|b)\.w\) stays at 18\.18.*a load that grows with the speed is missing there"):
        free(2.0, []).simulate(1.0, start="steady")
    with pytest.raises(StartError, match=r"grows with the speed is missing there"):  # one that pushes as much as the drive
        free(2.0, [gp.ConstantTorque(tau_constant=2.0)]).simulate(1.0, start="steady")


@pytest.mark.parametrize("tau", [0.3, 1e-9, 3e5])
def test_torques_that_balance_keep_the_speed(tau: float) -> None:
    loads = [gp.ConstantTorque(tau_constant=-tau / 3), gp.ConstantTorque(tau_constant=-2 * tau / 3)]
    system = free(tau, loads)
    run = system.simulate(1.0, start="steady", samples=2)
    assert run["a.w"] == pytest.approx(np.zeros(2), abs=1e-9 * tau)
    assert run["s.phi_rel"] == pytest.approx(np.full(2, -tau / 1e4), rel=1e-9)
    with pytest.raises(StartError, match="a load that grows with the speed is missing"):
        system.simulate(1.0, start="steady", parameters={"loads[1].tau_constant": -0.66 * tau})


@pytest.mark.parametrize("nominal", [1e-3, 30.0, 1e6])
def test_a_weak_load_is_found_without_a_guess(nominal: float) -> None:
    """From rest, where a load that grows with the square of the speed has no slope: 2 = 1 (w / nominal)^2, and not -w."""
    system = free(2.0, [gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=nominal)])
    run = system.simulate(1.0, start="steady", samples=2)
    assert run["b.w"] == pytest.approx(np.full(2, nominal * np.sqrt(2)), rel=1e-6)


class Drag(gl.Component):
    """A torque against the rotation that grows with a power of the speed."""

    power = gl.Structural(2, "exponent of the speed")
    flange = gp.Flange()
    w = gl.Variable("rad/s", "speed")

    def equations(self) -> list[Any]:
        return [gl.Eq(self.w, gl.der(self.flange.phi)), gl.Eq(self.flange.tau, 0.01 * self.w**self.power)]


class Coasting(gl.Component):
    """Two inertias with an elastic shaft and a gear between them, stopped by a drag."""

    power = gl.Structural(2, "exponent of the drag")

    def assemble(self) -> list[Any]:
        self.rotor, self.hub = gp.Inertia(J=1.0, start={"w": 100.0, "phi": 0.3}), gp.Inertia(J=0.1)
        self.gear, self.shaft, self.drag = gp.IdealGear(ratio=5.0), gp.SpringDamper(c=1e5, d=10.0), Drag(power=self.power)
        return [
            gl.connect(self.rotor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.hub.flange_a),
            gl.connect(self.hub.flange_b, self.drag.flange),
        ]


@pytest.mark.parametrize("power", [1, 2, 3, 4, 7])
def test_a_train_that_coasts_comes_to_rest_where_it_is(power: int) -> None:
    """A drag without a linear part leaves no slope at rest, so that the speeds only fade; angles keep their start values."""
    system = gl.compile(Coasting(power=power), outputs=["rotor.w", "rotor.phi", "hub.w", "shaft.tau"])
    found = gl.steady_state(system)
    np.testing.assert_allclose([found[n] for n in ("rotor.w", "hub.w", "shaft.tau")], 0.0, atol=1e-10)
    assert found["rotor.phi"] == pytest.approx(0.3, abs=1e-9)


@pytest.mark.parametrize("example", [CompareBrakingTorque, Backlash])
def test_what_is_braked_or_rattles_to_rest_has_stopped(example: type[gl.Component]) -> None:
    """Each has a speed that fades with a power of time: under a quadratic torque, and in a gap, where it stops nobody knows."""
    system = gl.compile(example())
    with (
        nullcontext() if example is CompareBrakingTorque else pytest.warns(gl.GearlibWarning, match="one of many side by side")
    ):
        found = gl.steady_state(system)
    assert all(abs(found[name]) <= 1e-12 for name in system.states if name.endswith(".w"))


def test_of_several_it_is_the_one_that_the_motion_goes_to() -> None:
    """A motor with 40 w / (100 + w^2) - 0.05 w against a constant load: a slow, an unstable and a fast steady state."""

    class Motor(gl.Component):
        flange = gp.Flange()
        d = gl.Parameter("N.m.s/rad", default=0.05)
        power = gl.Parameter("N.m.rad/s", default=40.0)
        w_most = gl.Parameter("rad/s", "speed of the largest torque", default=10.0)
        w = gl.Variable("rad/s", "speed")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(self.w, gl.der(self.flange.phi)),
                gl.Eq(self.flange.tau, self.d * self.w - self.power * self.w / (self.w_most**2 + self.w**2)),
            ]

    class Train(gl.Component):
        w0 = gl.Parameter("rad/s", default=0.0)

        def assemble(self) -> list[Any]:
            self.motor, self.body = Motor(), gp.Inertia(J=1.0, start={"w": self.w0})
            self.drag = gp.ConstantTorque(tau_constant=-0.3)
            return [c(self.motor.flange, self.body.flange_a), c(self.body.flange_b, self.drag.flange)]

    system, ends = gl.compile(Train()), set()
    for w0 in (-50.0, 0.0, 0.8, 0.9, 5.0, 100.0):
        run = system.simulate(3000.0, samples=2, rtol=1e-9, parameters={"w0": w0})
        found = system.simulate(1.0, start="steady", samples=2, parameters={"w0": w0})
        assert found["body.w"][0] == pytest.approx(run["body.w"][-1], rel=1e-6), w0
        ends.add(round(float(run["body.w"][-1]), 3))
    assert len(ends) == 2


class Excited(gl.Component):
    """A vibration about ``middle`` that excites itself, up to a limit."""

    growth = gl.Parameter("1/s", default=1.0)
    rate = gl.Parameter("rad/s", default=1.0)
    middle = gl.Parameter("rad", default=0.0)
    x = gl.Variable("rad", start=0.1)
    v = gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        beside = self.x - self.middle
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.growth * (1 - beside**2) * self.v - self.rate**2 * beside),
        ]


@pytest.mark.parametrize("middle", [0.0, -2.0])
@pytest.mark.parametrize("growth", [0.01, 0.1, 1.0, 3.0, 30.0])
def test_where_the_motion_reaches_none_it_is_one_that_exists(growth: float, middle: float) -> None:
    system, values = gl.compile(Excited()), {"growth": growth, "middle": middle}
    with pytest.warns(
        gl.GearlibWarning, match=r"Excited: the steady state is unstable, a motion near it grows by a factor of e in "
    ):
        found = gl.steady_state(system, parameters=values)
    assert found.values == pytest.approx([middle, 0.0], abs=1e-12)
    assert system.simulate(1.0, start="steady", parameters=values)["x"] == pytest.approx(middle, abs=1e-9)
    assert max(gl.stability(system, at="steady", parameters=values).eigenvalues.real) == pytest.approx(
        np.roots([1, -growth, 1]).real.max(), rel=1e-9
    )


@pytest.mark.parametrize(("most", "warned"), [(1, False), (2, True)])
def test_poles_of_a_steady_state_are_examined_up_to_a_number_of_states(
    most: int, warned: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gearlib.linear.steady_state.MOST_EXAMINED", most)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        gl.steady_state(gl.compile(Excited()), parameters={"growth": 0.1})
    assert [str(one.message).startswith("Excited: the steady state is unstable") for one in told] == [True] * warned


class Belt(gl.Component):
    """A body drawn by a spring over a surface whose friction falls with the speed: stick and slip for ever."""

    def assemble(self) -> list[Any]:
        self.drive, self.spring = gp.Speed(w_ref=1.0, exact=True), gp.SpringDamper(c=100.0, d=0.1)
        self.body, self.friction = gp.Inertia(J=1.0), Falling()
        return [
            c(self.drive.flange, self.spring.flange_a),
            c(self.spring.flange_b, self.body.flange_a),
            c(self.body.flange_b, self.friction.flange),
        ]


class Falling(gl.Component):
    flange = gp.Flange()
    most = gl.Parameter("N.m", default=5.0)
    w_fall = gl.Parameter("rad/s", default=3.0)
    w_rise = gl.Parameter("rad/s", default=0.05)
    w = gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        fallen = gl.exp(-gl.sqrt(self.w**2) / self.w_fall)
        return [
            gl.Eq(self.w, gl.der(self.flange.phi)),
            gl.Eq(self.flange.tau, self.most * fallen * gl.tanh(self.w / self.w_rise)),
        ]


def test_a_body_that_sticks_and_slips_has_an_unstable_steady_state() -> None:
    system = gl.compile(Belt())
    with pytest.warns(gl.GearlibWarning, match="Belt: the steady state is unstable"):
        found = gl.steady_state(system, ["body.w", "spring.tau"])
    assert found.values == pytest.approx([1.0, -5.0 * np.exp(-1 / 3) * np.tanh(20.0)], rel=1e-9)


class Coupled(gl.Component):
    """Three drags and drives, of which the start lies near the border between two steady states."""

    rate = gl.Parameter("1/s", default=1.0)
    x, y, z = gl.Variable("1", start=0.55), gl.Variable("1", start=0.7), gl.Variable("1", start=3.36)

    def equations(self) -> list[gl.Eq]:
        x, y, z = self.x, self.y, self.z
        terms = sympy.Matrix([x, y, z, -(x**3), gl.tanh(y), gl.tanh(z), 1.0])
        matrix = sympy.Matrix(
            [
                [-2.02, 0.24, 0.25, -0.58, 0.72, -0.59, -0.72],
                [0.18, -2.2, -0.33, -1.7, 0.07, -0.5, -1.58],
                [0.26, -0.32, -1.97, -0.07, 0.48, 2.1, -0.94],
            ]
        )
        return [gl.Eq(gl.der(v), self.rate * drive) for v, drive in zip((x, y, z), matrix * terms, strict=True)]


def test_a_motion_that_the_steps_lose_is_followed() -> None:
    system = gl.compile(Coupled())
    run = system.simulate(100.0, rtol=1e-9)
    assert gl.steady_state(system).values == pytest.approx([run[name][-1] for name in system.states], rel=1e-6)


class Linkage(gl.Component):
    """An angle b that follows a by sin(b - a) = 0.3 sin(b), one of many solutions, and y that follows b."""

    end = gl.Parameter("rad", default=6.0)
    rate = gl.Parameter("1/s", default=1.0)
    a, b, y = gl.Variable("rad", start=0.0), gl.Variable("rad"), gl.Variable("rad", start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.a), self.rate * (self.end - self.a)),
            gl.Eq(gl.sin(self.b - self.a), 0.3 * gl.sin(self.b)),
            gl.Eq(gl.der(self.y), self.rate * (self.b - self.y)),
        ]


@pytest.mark.parametrize("end", [1.0, 3.0, 15.0, -7.0])
@pytest.mark.parametrize("outputs", [["a", "b"], ["b", "y"]])
def test_it_is_on_the_branch_that_the_motion_follows(end: float, outputs: list[str]) -> None:
    """b - a = atan2(0.3 sin a, 1 - 0.3 cos a) within half a turn, since |b - a| stays below asin(0.3)."""
    system, values = gl.compile(Linkage(), outputs=outputs), {"end": end}
    b = end + np.arctan2(0.3 * np.sin(end), 1 - 0.3 * np.cos(end))
    there = {"a": end, "b": b, "y": b}
    assert gl.steady_state(system, parameters=values).values == pytest.approx([there[name] for name in outputs], rel=1e-9)
    stays = system.simulate(1.0, samples=3, start="steady", parameters=values)
    assert stays["b"] == pytest.approx(b, rel=1e-9)
    slope = system.linearize([], ["b"], at="steady", parameters=values).C
    if outputs == ["a", "b"]:
        assert slope == pytest.approx(np.cos(b - end) / (np.cos(b - end) - 0.3 * np.cos(b)), rel=1e-6)


class WoundUp(gl.Component):
    """A prescribed speed between the ends of two springs in series, whose middle has a load: by hand, the springs are wound up for ever."""

    J = gl.Structural(0.0)

    def assemble(self) -> list[Any]:
        self.spring, self.damped = gp.Spring(c=129.0), gp.SpringDamper(c=1.0, d=1.0)
        self.speed = gp.ConstantSpeed(w_fixed=1.0, use_support=True)
        self.load = gp.LinearSpeedDependentTorque(tau_nominal=-3.0, w_nominal=4.0, torque_direction=False)
        middle = [self.spring.flange_b, self.damped.flange_b, self.load.flange]
        if self.J:
            self.body = gp.Inertia(J=self.J)
            middle.append(self.body.flange_a)
        return [
            gl.connect(self.speed.support, self.spring.flange_a),
            gl.connect(*middle),
            gl.connect(self.speed.flange, self.damped.flange_a),
        ]


@pytest.mark.parametrize("J", [0.0, 2.0])
def test_torques_that_grow_are_not_steady_where_no_speed_changes_with_them(J: float) -> None:
    system = gl.compile(WoundUp(J=J))
    with pytest.raises(StartError, match=r"der\((spring|damped)\.phi_rel\) stays at"):
        system.simulate(1.0, start="steady", samples=2)
    run = system.simulate(200.0, samples=3)
    assert run["spring.tau"][2] - run["spring.tau"][1] == pytest.approx(100.0 * 129.0 / 130.0, rel=1e-3)


@pytest.mark.parametrize("J", [0.05, 0.7])
def test_a_clutch_that_locks_on_a_prescribed_speed(J: float) -> None:
    """The run locks it with a slip of the size of its tolerance, with which it would start as sliding."""

    class Engaged(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.clutch = gp.ConstantSpeed(w_fixed=-4.0), gp.Clutch(fn_max=1e4, f_normalized=1.0)
            self.body, self.load = gp.Inertia(J=J), drag(1.0, 3.0)
            return [
                c(self.drive.flange, self.clutch.flange_a), c(self.clutch.flange_b, self.body.flange_a),
                c(self.body.flange_b, self.load.flange),
            ]  # fmt: skip

    system = gl.compile(Engaged())
    run = system.simulate(5.0, start="steady", samples=3)
    assert run["body.w"] == pytest.approx(-4.0, abs=1e-10)
    assert run["clutch.tau"] == pytest.approx(4.0 / 3.0)
    assert run["clutch.contact"].tolist() == [1.0, 1.0, 1.0]


class Counted(Search):
    """A search that counts how often its equations are evaluated."""

    evaluations: list[int]

    def equations(self, x: Any) -> Any:
        self.evaluations.append(1)
        return self.jumping(x)

    def jumping(self, x: Any) -> Any:
        """Coulomb friction of 1000 against a drive of 300, in rates; away from x = 0 nothing acts but these."""
        return 300.0 - 1000.0 * np.sign(x), np.zeros((1, 1)), np.zeros(1)


@pytest.mark.parametrize("begin", [-0.7, 3.0])
def test_what_sticks_is_left_to_a_run(begin: float) -> None:
    """Implicit steps would go back and forth across the jump for ever; a run, whose events know both sides, comes to rest there."""
    search = Counted(SimpleNamespace(nominal=np.ones(1)), None, None, None, 0.0, np.zeros((1, 0)))  # type: ignore[arg-type]
    object.__setattr__(search, "evaluations", [])
    end = continued(search, np.array([begin]), stable=True)
    assert (end.steady, end.sticks) == (False, True)
    assert abs(end.x[0]) < 1e-2
    assert len(search.evaluations) < 150


def test_the_search_of_a_bearing_that_holds_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once it holds, its yield is all that is left of the rates: compared with itself it would seem to be a motion."""

    class Held(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.body = gp.Torque(tau=0.5), gp.Inertia(J=0.1, guess={"w": 10.0})
            self.bearing = gp.BearingFriction(tau_pos=((0.0, 1.0),))
            return [c(self.torque.flange, self.body.flange_a), c(self.body.flange_b, self.bearing.flange_a)]

    evaluated, at = [], Search.at

    def counted(search: Search, x: Any) -> Any:
        evaluated.append(x)
        return at(search, x)

    monkeypatch.setattr(Search, "at", counted)
    run = gl.compile(Held(), ["body.w", "bearing.tau"]).simulate(1.0, start="steady", samples=2)
    assert len(evaluated) < 200
    assert run["body.w"] == pytest.approx(np.zeros(2), abs=1e-12)
    assert run["bearing.tau"] == pytest.approx(np.full(2, 0.5))


@pytest.mark.parametrize("tau", [0.1, -0.29])
def test_a_gap_pressed_against_a_bearing_that_holds(tau: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run ends at rest; the gap is closed by as much as the torque twists its spring."""
    monkeypatch.setattr(steady, "MOST_STEPS", 10)  # the search finds nothing that sticks: what is tested is the run after it

    class Pressed(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.a, self.z = gp.Torque(tau=tau), gp.Inertia(J=0.5), gp.Inertia(J=1.0)
            self.gap = gp.ElastoBacklash(c=200.0, d=0.4, b=0.02)
            self.bearing = gp.BearingFriction(tau_pos=((0.0, 0.3), (10.0, 0.4)))
            return [
                c(self.torque.flange, self.a.flange_a), c(self.a.flange_b, self.gap.flange_a),
                c(self.gap.flange_b, self.z.flange_a), c(self.z.flange_b, self.bearing.flange_a),
            ]  # fmt: skip

    run = gl.compile(Pressed(), ["gap.phi_rel", "z.w"]).simulate(1.0, start="steady", samples=2)
    assert run["gap.phi_rel"] == pytest.approx(np.full(2, -np.sign(tau) * 0.01 - tau / 200.0), rel=1e-9)
    assert run["z.w"] == pytest.approx(np.zeros(2), abs=1e-12)


class EqualGears(gl.Component):
    """A driven body, two gears of the same ratio to one wheel, and a spring between what they turn alike: its twist cancels."""

    ratio = gl.Parameter("1", default=1.3006890565550573)

    def assemble(self) -> list[Any]:
        self.body, self.drive = gp.Inertia(J=1.0), gp.ConstantTorque(tau_constant=1.0)
        self.spring = gp.Spring(c=2.0)
        self.first, self.second = gp.IdealGear(ratio=self.ratio), gp.IdealGear(ratio=self.ratio)
        self.load = gp.LinearSpeedDependentTorque(tau_nominal=-3.0, w_nominal=2.0, torque_direction=False)
        return [
            c(self.body.flange_b, self.drive.flange, self.load.flange, self.first.flange_a, self.spring.flange_b),
            c(self.second.flange_a, self.spring.flange_a), c(self.first.flange_b, self.second.flange_b),
        ]  # fmt: skip


@pytest.mark.parametrize("ratio", [1.3006890565550573, 2.7, 0.1, 4.9])
def test_a_twist_that_cancels_up_to_rounding_is_no_support(ratio: float) -> None:
    run = gl.compile(EqualGears(ratio=ratio)).simulate(1.0, start="steady", samples=3, rtol=1e-9)
    assert run["body.w"] == pytest.approx(np.full(3, 2.0 / 3.0), rel=1e-9)
    assert abs(run["spring.tau"]).max() < 1e-9


def test_what_rounding_hides_far_away_is_not_steady(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.program.invariance.CANCELLED", 0.0)  # rounding counts as a spring that takes the torque
    with pytest.raises(StartError, match="no steady state was found"):
        gl.compile(EqualGears()).simulate(1.0, start="steady")


class Floating(gl.Component):
    """Bodies in a tree of dampers, and of springs with dampers, with torques between them that balance."""

    links = gl.Structural(())

    def assemble(self) -> list[Any]:
        rng = np.random.default_rng(len(self.links) + 10 * sum(self.links))
        count = len(self.links) + 1
        J, w = 10 ** rng.uniform(-1, 1, count), rng.uniform(-5, 5, count)
        self.body = [gp.Inertia(J=J[k], start={"w": w[k]}) for k in range(count)]
        self.link = [gp.SpringDamper(c=rng.choice([0.0, 50.0]), d=10 ** rng.uniform(-0.5, 0.5)) for _ in self.links]
        self.push = [gp.Torque2(tau=rng.uniform(-1, 1)) for _ in self.links]
        flanges = [body.flange_a for body in self.body]
        joined = [gl.connect(link.flange_a, flanges[i]) for link, i in zip(self.link, self.links, strict=True)]
        joined += [gl.connect(link.flange_b, flange) for link, flange in zip(self.link, flanges[1:], strict=True)]
        joined += [gl.connect(push.flange_a, flange) for push, flange in zip(self.push, flanges, strict=False)]
        return [*joined, *(gl.connect(push.flange_b, flange) for push, flange in zip(self.push, flanges[1:], strict=True))]


@pytest.mark.parametrize("links", [(0,), (0, 0), (0, 1, 1), (0, 1, 0, 2)])
def test_a_train_without_a_load_keeps_its_momentum(links: tuple[int, ...]) -> None:
    """The steady state is where a run ends, and moves with parameters as differences say."""
    bodies = [f"body[{k}].w" for k in range(len(links) + 1)]
    system = gl.compile(Floating(links=links), outputs=bodies)
    found, run = gl.steady_state(system), system.simulate(2000.0, samples=2, rtol=1e-10)
    assert found.values == pytest.approx(np.array([run[name][-1] for name in bodies]), rel=1e-8)
    numbers = system.translation.parameter_values({})
    for name in ("body[1].J", "link[0].d"):
        p = float(numbers[system.translation.model.parameters.index[name]])
        beside = [gl.steady_state(system, parameters={name: p + h * p}).values for h in (1e-4, -1e-4)]
        slopes = [found.sensitivity(body, name) for body in bodies]
        assert slopes == pytest.approx((beside[0] - beside[1]) / (2e-4 * p), rel=1e-6, abs=1e-7)
