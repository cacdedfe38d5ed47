"""Structures at the edge: redundant, nearly redundant and contradictory loops, vanishing pivots, terms switched off, wide scales."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import GearlibError, LoopError, SingularError

c = gl.connect
TIMES = np.linspace(0.0, 1.0, 11)


class TwoPaths(gl.Component):
    """Two rigid gears side by side between the same bodies."""

    first = gl.Parameter("1", "ratio of one path", default=2.0)
    second = gl.Parameter("1", "ratio of the other", default=2.0)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=3.0)
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.one, self.other = gp.IdealGear(ratio=self.first), gp.IdealGear(ratio=self.second)
        return [
            c(self.torque.flange, self.a.flange_a), c(self.a.flange_b, self.one.flange_a, self.other.flange_a),
            c(self.b.flange_a, self.one.flange_b, self.other.flange_b),
        ]  # fmt: skip


ACCELERATION = 3.0 / (1.0 + 2.0 / 4)


@pytest.mark.parametrize("method", ["exact", "rk8", "ida"])
def test_two_equal_paths(method: str) -> None:
    result = gl.simulate(TwoPaths(), 1.0, times=TIMES, method=method, rtol=1e-10, outputs=["a.w", "b.w"])
    assert result["a.w"] == pytest.approx(ACCELERATION * TIMES, rel=1e-9)
    assert result["b.w"] == pytest.approx(ACCELERATION * TIMES / 2, rel=1e-9)


@pytest.mark.parametrize("near", [1e-13, -1e-13, 1e-12])
def test_two_nearly_equal_paths(near: float) -> None:
    """Ratios that differ by rounding are the same ratio: the train turns, it does not lock."""
    component = TwoPaths(second=2.0 * (1 + near))
    result = gl.simulate(component, 1.0, times=TIMES, rtol=1e-10, outputs=["a.w", "b.w"])
    assert result["a.w"] == pytest.approx(ACCELERATION * TIMES, rel=1e-6)


@pytest.mark.parametrize("off", [1e-9, 1e-3, 0.5])
def test_two_contradictory_paths(off: float) -> None:
    """A difference that rounding cannot explain locks the train: an error, when compiled so and when a parameter makes it so."""
    with pytest.raises(LoopError, match="loop through one, other"):
        gl.simulate(TwoPaths(second=2.0 * (1 + off)), 1.0, times=TIMES, outputs=["a.w"])
    system = gl.compile(TwoPaths(), outputs=["a.w"])
    with pytest.raises(LoopError, match="loop through one, other"):
        system.simulate(1.0, times=TIMES, parameters={"second": 2.0 * (1 + off)})


class TwoSets(gl.Component):
    """Two planetary sets side by side between the same three bodies."""

    second = gl.Parameter("1", "ring over sun of the other set", default=3.0)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=5.0)
        self.sun, self.carrier, self.ring = gp.Inertia(J=0.1), gp.Inertia(J=1.0), gp.Inertia(J=0.5)
        self.one, self.other = gp.IdealPlanetary(ratio=3.0), gp.IdealPlanetary(ratio=self.second)
        return [
            c(self.torque.flange, self.sun.flange_a), c(self.sun.flange_b, self.one.sun, self.other.sun),
            c(self.carrier.flange_a, self.one.carrier, self.other.carrier),
            c(self.ring.flange_a, self.one.ring, self.other.ring),
        ]  # fmt: skip


SET = np.array([1.0, -4.0, 3.0])  # w_sun - (1 + i0) w_carrier + i0 w_ring = 0
MASSES = np.diag([0.1, 1.0, 0.5])


@pytest.mark.parametrize("off", [0.0, 1e-13, -1e-13])
@pytest.mark.parametrize("overridden", [False, True])
def test_two_equal_planetary_sets(off: float, overridden: bool) -> None:
    system = gl.compile(TwoSets(second=3.0 if overridden else 3.0 * (1 + off)), outputs=["sun.w", "carrier.w", "ring.w"])
    result = system.simulate(1.0, times=TIMES, parameters={"second": 3.0 * (1 + off)})
    full = np.block([[MASSES, SET[:, None]], [SET[None, :], np.zeros((1, 1))]])
    acceleration = np.linalg.solve(full, [5.0, 0.0, 0.0, 0.0])
    for name, expected in zip(("sun", "carrier", "ring"), acceleration, strict=False):
        assert result[f"{name}.w"] == pytest.approx(expected * TIMES, rel=1e-9)


def test_two_different_planetary_sets() -> None:
    """Two constraints instead of one: all bodies turn together. A model compiled for equal sets says that it does not hold."""
    outputs = ["sun.w", "carrier.w", "ring.w"]
    result = gl.simulate(TwoSets(second=2.0), 1.0, times=TIMES, outputs=outputs)
    for name in outputs:
        assert result[name] == pytest.approx(5.0 / 1.6 * TIMES, rel=1e-9)
    with pytest.raises(LoopError, match="compile again"):
        gl.compile(TwoSets(), outputs=outputs).simulate(1.0, times=TIMES, parameters={"second": 2.0})


class Loop(gl.Component):
    """A planetary set closed by a gear from carrier to sun; torque on the carrier."""

    i0 = gl.Parameter("1", "ring over sun", default=3.0)
    closing = gl.Parameter("1", "speed of the sun over that of the carrier", default=4.0)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=5.0)
        self.sun, self.carrier, self.ring = gp.Inertia(J=0.1), gp.Inertia(J=1.0), gp.Inertia(J=0.5)
        self.set, self.gear = gp.IdealPlanetary(ratio=self.i0), gp.IdealGear(ratio=self.closing)
        return [
            c(self.torque.flange, self.carrier.flange_a), c(self.carrier.flange_b, self.set.carrier, self.gear.flange_b),
            c(self.sun.flange_a, self.set.sun, self.gear.flange_a), c(self.ring.flange_a, self.set.ring),
        ]  # fmt: skip


@pytest.mark.parametrize("closing", [4.0, 1.0, 0.0001, -3.0])
@pytest.mark.parametrize("overridden", [False, True])
def test_planetary_loops_with_a_vanishing_pivot(closing: float, overridden: bool) -> None:
    """At 4 the ring stands still (its coefficient is 1 + i0 - closing); at 1 all turn together."""
    system = gl.compile(Loop(closing=2.0 if overridden else closing), outputs=["carrier.w", "ring.w", "sun.w"])
    try:
        result = system.simulate(1.0, times=TIMES, parameters={"closing": closing})
        found = {name: result[f"{name}.w"] for name in ("carrier", "ring", "sun")}
    except SingularError as problem:  # the states were chosen for other numbers: an error that names the parts is right, too
        assert overridden
        assert closing == 4.0
        assert re.search("equations of gear, set are singular", str(problem))
        return
    ring = (1 + 3.0 - closing) / 3.0
    acceleration = 5.0 / (1.0 + 0.1 * closing**2 + 0.5 * ring**2)
    assert found["carrier"] == pytest.approx(acceleration * TIMES, rel=1e-9)
    assert found["ring"] == pytest.approx(ring * acceleration * TIMES, rel=1e-9, abs=1e-12)
    assert found["sun"] == pytest.approx(closing * acceleration * TIMES, rel=1e-9)


class Shaft(gl.Component):
    """Two bodies and a spring-damper."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=2.0)
        self.a, self.b = gp.Inertia(J=0.5), gp.Inertia(J=1.0, start={"w": 1.0})
        self.shaft = gp.SpringDamper(c=1e4, d=1.0)
        return [
            c(self.torque.flange, self.a.flange_a),
            c(self.a.flange_b, self.shaft.flange_a),
            c(self.shaft.flange_b, self.b.flange_a),
        ]


@pytest.mark.parametrize("method", ["exact", "rk5", "rk8", "ida"])
def test_terms_switched_off(method: str) -> None:
    system = gl.compile(Shaft(), outputs=["a.w", "b.w", "shaft.phi_rel"])
    result = system.simulate(1.0, times=TIMES, method=method, parameters={"shaft.c": 0.0, "shaft.d": 0.0}, rtol=1e-9)
    assert result["a.w"] == pytest.approx(4.0 * TIMES, abs=1e-8)
    assert result["b.w"] == pytest.approx(np.ones(11), abs=1e-8)
    assert result["shaft.phi_rel"] == pytest.approx(TIMES - 2 * TIMES**2, abs=1e-8)


@pytest.mark.parametrize("method", ["auto", "exact", "rk8", "ida"])
def test_a_body_without_inertia(method: str) -> None:
    """What is left of it is a node that the twist, which has no torque to hold it, leaves with c / d = 1e4 1/s."""
    result = gl.compile(Shaft(), outputs=["b.w"]).simulate(1.0, times=TIMES, method=method, parameters={"b.J": 0.0}, rtol=1e-9)
    assert result["b.w"] == pytest.approx(4.0 * TIMES + np.exp(-1e4 * TIMES), abs=1e-7)


@pytest.mark.parametrize("method", ["exact", "rk5", "rk8", "ida"])
def test_a_billion_radians_beside_a_nanometre(method: str) -> None:
    class Mesh(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.brake = gp.Torque(tau=0.1), gp.Torque(tau=-0.1)
            self.a, self.b = gp.Inertia(J=0.01, start={"phi": 1e9, "w": 1e5}), gp.Inertia(J=0.04, start={"w": -5e4})
            self.mesh = gp.ExternalMesh(r_a=0.05, r_b=0.1, c=1e9, d=1e4)
            return [
                c(self.drive.flange, self.a.flange_a), c(self.a.flange_b, self.mesh.flange_a),
                c(self.mesh.flange_b, self.b.flange_a), c(self.b.flange_b, self.brake.flange),
            ]  # fmt: skip

    result = gl.simulate(Mesh(), 0.5, samples=6, method=method, rtol=1e-9, outputs=["mesh.q", "a.phi", "mesh.f"])
    # q'' + (d q' + c q) (r1^2/J1 + r2^2/J2) = r1 tau1 / J1 + r2 tau2 / J2
    stiffness = (0.05**2 / 0.01 + 0.1**2 / 0.04) * 1e9
    settled = (0.05 * 0.1 / 0.01 - 0.1 * 0.1 / 0.04) / stiffness
    assert 1e-10 < settled < 1e-9
    # the tolerance is 1e-9 of the nominal deflection, 1e-6 m, so a nanometre has its first five digits
    assert result["mesh.q"][1:] == pytest.approx(np.full(5, settled), abs=1e-9 * 1e-6 * 10)
    turn = 0.5 * result.time**2 * (0.1 - 0.05 * 1e9 * settled) / 0.01
    assert result["a.phi"] == pytest.approx(1e9 + 1e5 * result.time + turn, rel=1e-12 if method == "exact" else 1e-9)


@pytest.mark.parametrize("method", ["exact", "rk8", "ida", "auto"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_no_silent_nan(method: str, bad: float) -> None:
    class Open(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.a = gp.Torque(), gp.Inertia(J=0.5)
            self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=1.0)
            return [c(self.torque.flange, self.a.flange_a), c(self.a.flange_b, self.fan.flange)]

    system = gl.compile(Open(), outputs=["a.w"])
    with pytest.raises(GearlibError):
        system.simulate(1.0, method=method, inputs={"torque.tau": lambda t: 1.0 if t < 0.5 else bad})


def test_a_run_that_explodes_says_so() -> None:
    class Explosion(gl.Component):
        x = gl.Variable("1", "grows to infinity at t = 1", start=1.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.x**2)]

    for method in ("auto", "rk5", "rk8", "ida"):
        with pytest.raises(GearlibError, match=r"t ?= ?(1|0\.9999|1\.0)"):
            gl.simulate(Explosion(), 2.0, method=method)
