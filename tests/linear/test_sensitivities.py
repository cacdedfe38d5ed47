"""Derivatives of modes, responses, margins and steady states: against closed forms and differences of exact analyses."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import control
import numpy as np
import pytest
from numpy.typing import NDArray

import gearlib as gl
import gearparts as gp
from gearlib.linear.eigenvalue_changes import eigenvalue_changes
from gearlib.linear.linear_model import LinearModel
from tests.many_runs.models import Drive
from tests.stress.misuse import BadMapping

Floats = NDArray[np.float64]


def differences(f: Callable[[float], Any], at: float, step: float = 2e-3) -> Any:
    """Central differences of three step lengths, extrapolated: an error of the sixth power of the step."""
    h = step * abs(at)
    one, two, four = ((np.asarray(f(at + k * h)) - np.asarray(f(at - k * h))) / (2 * k * h) for k in (1, 2, 4))
    return ((64 * one - 20 * two + four) / 45)[()]


class Propeller(gl.Component):
    """Its torque grows with the square of the speed; the power is a variable that may have a start value."""

    flange = gp.Flange()
    k = gl.Parameter("N.m.s2/rad2")
    w = gl.Variable("rad/s")
    P = gl.Variable("W")

    def equations(self) -> list[gl.Eq]:
        turning = gl.Eq(gl.der(self.flange.phi), self.w)
        return [turning, gl.Eq(self.flange.tau, self.k * self.w**2), gl.Eq(self.P, self.k * self.w**3)]


class Fan(gl.Component):
    """A drive that a fan brakes, so that its linear model depends on parameters; the speed at the start follows from the power."""

    k = gl.Parameter("N.m.s2/rad2", default=0.02)
    w0 = gl.Parameter("rad/s", default=3.0)
    tau0 = gl.Parameter("N.m", default=8.0)

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.motor = gp.Torque(tau=self.tau0), gp.Inertia(J=0.5, start={"w": 2 * self.w0})
        self.gear, self.shaft = gp.IdealGear(ratio=2.0), gp.SpringDamper(c=400.0, d=2.0)
        self.load = gp.Inertia(J=2.0, guess={"w": 5.0})
        self.fan = Propeller(k=self.k, start={"P": 0.1 * self.tau0 * self.w0})
        return [
            gl.connect(self.torque.flange, self.motor.flange_a), gl.connect(self.motor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.fan.flange),
        ]  # fmt: skip


class Wheels(gl.Component):
    """Equal wheels on equal shafts: repeated modes."""

    number = gl.Structural(3)
    c = gl.Parameter("N.m/rad", default=100.0)

    def assemble(self) -> list[gl.Connection]:
        self.hub, self.ground = gp.Inertia(J=1.0), gp.Fixed()
        self.support = gp.Spring(c=5.0)
        self.shafts = [gp.Spring(c=self.c) for _ in range(self.number)]
        self.wheels = [gp.Inertia(J=0.3) for _ in range(self.number)]
        joints = [gl.connect(self.ground.flange, self.support.flange_a), gl.connect(self.support.flange_b, self.hub.flange_a)]
        for shaft, wheel in zip(self.shafts, self.wheels, strict=True):
            joints += [gl.connect(self.hub.flange_b, shaft.flange_a), gl.connect(shaft.flange_b, wheel.flange_a)]
        return joints


@cache
def compiled(kind: Any) -> gl.System:
    return gl.compile(kind())


@pytest.mark.parametrize("name", ["K_g", "R_s", "C_g", "I_r", "C_v"])
def test_modes_of_the_papers_train(name: str) -> None:
    """Most numbers in its equations follow from the parameter by several ways."""
    system = compiled(gp.ZhouCui2022)
    modes = gl.modes(system)
    found = modes.sensitivity(name)
    at = system.parameters[name]
    for what in ("eigenvalues", "frequencies", "damping"):
        right = differences(lambda p, what=what: getattr(gl.modes(system, parameters={name: p}), what), at)
        np.testing.assert_allclose(getattr(found, what), right, rtol=0, atol=1e-8 * np.abs(right).max())
    np.testing.assert_allclose(found.relative, found.frequencies * at / modes.frequencies, rtol=1e-12)
    assert (found.parameter, found.value, found.unit) == (name, at, system.parameter_units[name])


def test_one_mass_on_one_spring() -> None:
    class Rotor(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.ground, self.shaft, self.disc = gp.Fixed(), gp.SpringDamper(c=400.0, d=0.6), gp.Inertia(J=1.5)
            return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange_a)]

    found, c, d, J = gl.modes(gl.compile(Rotor())), 400.0, 0.6, 1.5  # omega^2 = c / J, zeta = d / (2 sqrt(c J))
    omega, zeta = np.sqrt(c / J), d / 2 / np.sqrt(c * J)
    for name, slope, damping in (("shaft.c", 0.5 / c, -0.5 / c), ("shaft.d", 0.0, 1 / d), ("disc.J", -0.5 / J, -0.5 / J)):
        change = found.sensitivity(name)
        np.testing.assert_allclose(2 * np.pi * change.frequencies[-1], omega * slope, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(change.damping[-1], zeta * damping, rtol=1e-12)
    text = str(found.sensitivity("shaft.d"))
    assert "frequency, Hz per N.m.s/rad" in text
    assert max(map(len, text.splitlines())) <= 100


@pytest.mark.parametrize("at", [None, {"fan.P": 30.0}, "steady"], ids=str)
@pytest.mark.parametrize("name", ["k", "w0", "load.J", "tau0", "gear.ratio"])
def test_the_operating_point_moves_with_the_parameter(at: Any, name: str) -> None:
    """Bound start values, some of which have to be solved for; and the steady state."""
    system = compiled(Fan)
    found = gl.modes(system, at=at).sensitivity(name)
    right = differences(lambda p: gl.modes(system, at=at, parameters={name: p}).eigenvalues, system.parameters[name])
    np.testing.assert_allclose(found.eigenvalues, right, rtol=1e-7, atol=1e-9 * max(np.abs(right).max(), 1e-3))
    poles = gl.stability(system, at=at).sensitivity(name).eigenvalues
    right = differences(lambda p: gl.stability(system, at=at, parameters={name: p}).eigenvalues, system.parameters[name])
    np.testing.assert_allclose(poles, right, rtol=1e-7, atol=1e-9 * max(np.abs(right).max(), 1e-3))


def test_a_moment_of_a_run_stays() -> None:
    system = compiled(Fan)
    at = system.simulate(1.0), 0.5
    found = gl.modes(system, at=at).sensitivity("k").eigenvalues
    right = differences(lambda p: gl.modes(system, at=at, parameters={"k": p}).eigenvalues, 0.02)
    np.testing.assert_allclose(found, right, rtol=1e-8, atol=1e-12)


def test_repeated_modes() -> None:
    """A change of all shafts keeps them together; one of a single wheel parts them: one branch stays, the other moves."""
    system = compiled(Wheels)
    modes = gl.modes(system)
    pair = np.flatnonzero(np.isclose(modes.omega, np.sqrt(100 / 0.3)))
    assert len(pair) == 2
    together = modes.sensitivity("c").frequencies[pair]
    np.testing.assert_allclose(2 * np.pi * together, 0.5 * np.sqrt(100 / 0.3) / 100, rtol=1e-12)
    apart = modes.sensitivity("wheels[1].J").eigenvalues[pair]

    def branches(J: float) -> Any:
        return gl.modes(system, parameters={"wheels[1].J": J}).eigenvalues[pair]

    forward, back = ((branches(0.3 + h) - modes.eigenvalues[pair]) / h for h in (1e-6, -1e-6))
    np.testing.assert_allclose(np.sort(apart.imag), np.sort(forward.imag), rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(np.sort(apart.imag), np.sort(back.imag), rtol=1e-4, atol=1e-4)
    assert abs(apart[0] - apart[1]) > 1.0


def test_a_double_pole_without_two_shapes_is_refused() -> None:
    class Critical(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.ground, self.shaft, self.disc = gp.Fixed(), gp.SpringDamper(c=4.0, d=4.0), gp.Inertia(J=1.0)
            return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange_a)]

    with pytest.raises(gl.GearlibError, match="repeated with too few independent shapes"):
        gl.stability(gl.compile(Critical())).sensitivity("shaft.d")
    with pytest.raises(gl.GearlibError, match="ask for all of them, not for 1"):
        eigenvalue_changes(np.diag([2.0, 2.0]), [np.diag([0.0, 1.0])], np.array([2.0 + 0j]))


def test_a_large_train() -> None:
    """Equal bodies on equal shafts: body i of n swings by sin(i a) in the mode with a = (2 k - 1) pi / (2 n + 1)."""
    n = 260

    class Row(gl.Component):
        c = gl.Parameter("N.m/rad", default=1e5)

        def assemble(self) -> list[gl.Connection]:
            self.ground, self.bodies = gp.Fixed(), [gp.Inertia(J=0.1) for _ in range(n)]
            self.shafts = [gp.Spring(c=self.c) for _ in range(n)]
            ends = [self.ground.flange, *(b.flange_b for b in self.bodies)]
            return [
                gl.connect(*pair)
                for a, s, b in zip(ends, self.shafts, self.bodies, strict=False)
                for pair in ((a, s.flange_a), (s.flange_b, b.flange_a))
            ]

    modes = gl.modes(gl.compile(Row()), 4)
    a = (2 * np.arange(1, 5) - 1) * np.pi / (2 * n + 1)
    np.testing.assert_allclose(modes.omega, 2 * np.sqrt(1e6) * np.sin(a / 2), rtol=1e-8)
    np.testing.assert_allclose(modes.sensitivity("c").relative, 0.5, rtol=1e-8)
    shapes = np.sin(np.outer(np.arange(1, n + 1), a))
    share = shapes[40] ** 2 / (shapes**2).sum(axis=0)
    np.testing.assert_allclose(modes.sensitivity("bodies[40].J").relative, -0.5 * share, rtol=1e-7)


def test_inverse_iteration_finds_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also of repeated modes."""
    for kind, name in ((gp.ZhouCui2022, "C_g"), (Wheels, "wheels[1].J"), (Wheels, "c")):
        modes = gl.modes(compiled(kind))
        full = modes.sensitivity(name).eigenvalues
        with monkeypatch.context() as patch:
            patch.setattr("gearlib.linear.eigenvalue_changes.MOST_FULL", 0)
            np.testing.assert_allclose(modes.sensitivity(name).eigenvalues, full, atol=1e-8 * np.abs(full).max())


@pytest.mark.parametrize("name", ["K_g", "R_s", "C_g"])
def test_frequency_responses(name: str) -> None:
    system, omega = compiled(gp.ZhouCui2022), np.geomspace(10.0, 1e5, 9)
    at = system.parameters[name]

    def both(**values: float) -> Any:
        first = gl.frequency_response(system, omega, ["tau_in"], ["w_out", "q_ring"], parameters=values)
        return first, gl.transmission_error_response(system, omega, ["q_ring"], parameters=values)

    for k, response in enumerate(both()):
        right = differences(lambda p, k=k: both(**{name: p})[k].values, at, 5e-4)
        size = np.abs(right).max(axis=2, keepdims=True)
        assert (np.abs(response.sensitivity(name) - right) <= 1e-6 * size).all()
        np.testing.assert_array_equal(response.sensitivities([name])[0], response.sensitivity(name))


@pytest.mark.parametrize("name", ["J", "shaft.c", "shaft.d", "brake.d"])
def test_margins(name: str) -> None:
    system = compiled(Drive)

    def report(**values: float) -> Any:
        return gl.stability(system, ("torque.tau", "load.w"), gain=300.0, parameters=values)

    found, at = report().sensitivity(name), system.parameters[name]
    for margin in ("gain_margin", "phase_margin", "delay_margin"):
        right = differences(lambda p, margin=margin: getattr(report(**{name: p}).loop.margins, margin), at)
        np.testing.assert_allclose(getattr(found, margin), right, rtol=1e-7)
    right = differences(lambda p: report(**{name: p}).loop.margins.modulus_margin, at)
    np.testing.assert_allclose(found.modulus_margin, right, rtol=1e-6)
    right = differences(lambda p: report(**{name: p}).loop.closed_poles.values, at)
    np.testing.assert_allclose(found.closed_eigenvalues, right, atol=1e-8 * np.abs(right).max())
    assert "gain margin" in str(found)
    assert max(map(len, str(found).splitlines())) <= 100


def test_a_locked_clutch() -> None:
    """The slip is a state that the mode holds: it is in no motion, and changes none."""

    class Locked(gl.Component):
        c = gl.Parameter("N.m/rad", default=300.0)

        def assemble(self) -> list[gl.Connection]:
            self.torque, self.a, self.b = gp.Torque(), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.clutch = gp.Clutch(fn_max=1e4, f_normalized=1.0)
            self.shaft, self.ground = gp.SpringDamper(c=self.c, d=1.0), gp.Fixed()
            return [
                gl.connect(self.torque.flange, self.a.flange_a), gl.connect(self.a.flange_b, self.clutch.flange_a),
                gl.connect(self.clutch.flange_b, self.b.flange_a), gl.connect(self.b.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.ground.flange),
            ]  # fmt: skip

    system = gl.compile(Locked())
    modes, omega = gl.modes(system), np.sqrt(300.0 / 3.0)
    assert modes.omega[-1] == pytest.approx(omega)
    np.testing.assert_allclose(2 * np.pi * modes.sensitivity("c").frequencies[-1], omega / 600, rtol=1e-9)
    np.testing.assert_allclose(2 * np.pi * modes.sensitivity("a.J").frequencies[-1], -omega / 6, rtol=1e-9)
    response = gl.frequency_response(system, [3.0], ["torque.tau"], ["b.w"])
    right = differences(
        lambda p: gl.frequency_response(system, [3.0], ["torque.tau"], ["b.w"], parameters={"a.J": p}).values, 1.0
    )
    np.testing.assert_allclose(response.sensitivity("a.J"), right, rtol=1e-8)


def test_steady_states() -> None:
    """k w^2 = 2 tau0 on the load's side of the gear; the shaft carries that torque."""
    found = gl.steady_state(compiled(Fan), ["load.w", "shaft.tau", "shaft.phi_rel", "motor.w"])
    w = np.sqrt(2 * 8.0 / 0.02)
    np.testing.assert_allclose(found.values, [w, -16.0, -16.0 / 400, 2 * w], rtol=1e-10)
    assert found.sensitivity("load.w", "k") == pytest.approx(-0.5 * w / 0.02, rel=1e-9)
    assert found.sensitivity("motor.w", "tau0") == pytest.approx(w / 8.0, rel=1e-9)
    assert found.sensitivity("shaft.phi_rel", "shaft.c") == pytest.approx(16.0 / 400**2, rel=1e-9)
    assert found.sensitivity("load.w", "w0") == pytest.approx(0.0, abs=1e-9)
    assert str(found).splitlines()[0].split() == ["load.w", f"{w:.6g}", "rad/s"]
    with pytest.raises(gl.GearlibError, match=r"was not asked for 'load\.J'"):
        found.sensitivity("load.J", "k")
    with pytest.warns(gl.InputWarning, match="in this state"):
        gl.steady_state(compiled(Drive), ["load.w"])
    with pytest.raises(
        gl.GearlibError, match=r"inputs is .*; expected a mapping of paths to numbers, functions of time or tables"
    ):
        gl.steady_state(compiled(Drive), ["load.w"], inputs=BadMapping())
    driven = gl.steady_state(compiled(Drive), ["load.w"], inputs={"torque.tau": 2.0}, parameters={"brake.d": 0.8})
    assert driven["load.w"] == pytest.approx(2.5)
    assert driven.sensitivity("load.w", "brake.d") == pytest.approx(-2.5 / 0.8)
    by_hand = LinearModel(np.eye(1), np.eye(1), np.eye(1), np.eye(1), ("x",), ("u",), ("y",))
    with pytest.raises(gl.GearlibError, match="not that of a System"):
        gl.frequency_response(by_hand, [1.0]).sensitivity("load.J")


def test_what_has_no_derivative() -> None:
    modes = gl.modes(compiled(Drive))
    with pytest.raises(gl.GearlibError, match=r"no parameter 'shaft.x'"):
        modes.sensitivity("shaft.x")
    with pytest.raises(gl.GearlibError, match="parameter is 3; expected a name"):
        modes.sensitivity(3)  # type: ignore[arg-type]
    with pytest.raises(gl.GearlibError, match="not that of a System"):
        gl.frequency_response(control.tf([1], [1, 1]), [1.0]).sensitivity("a")
    with pytest.raises(gl.GearlibError, match="not that of a System"):
        gl.stability(control.tf([1], [1, 1])).sensitivity("a")
    empty = gl.modes(compiled(Drive), parameters={"motor.J": 0.0})
    with pytest.raises(gl.GearlibError, match=r"motor\.J is 0, and that decided which equation determines what"):
        empty.sensitivity("motor.J")
    assert len(empty.sensitivity("shaft.c").frequencies) == len(empty)


def test_a_loop_that_closes_with_one_value_only() -> None:
    class Ring(gl.Component):
        n = gl.Parameter("1", default=2.0)

        def assemble(self) -> list[gl.Connection]:
            self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.one, self.other = gp.IdealGear(ratio=self.n), gp.IdealGear(ratio=2.0)
            self.shaft, self.ground = gp.Spring(c=10.0), gp.Fixed()
            return [
                gl.connect(self.a.flange_b, self.one.flange_a, self.other.flange_a),
                gl.connect(self.one.flange_b, self.other.flange_b, self.b.flange_a),
                gl.connect(self.b.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.ground.flange),
            ]  # fmt: skip

    modes = gl.modes(gl.compile(Ring()))
    assert modes.sensitivity("a.J").relative[-1] == pytest.approx(-0.5 * 4 / 6)
    with pytest.raises(gl.GearlibError, match="there is no derivative with respect to n: equations of"):
        modes.sensitivity("n")
