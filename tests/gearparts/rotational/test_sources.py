"""Torques as functions of speed and time, and forced motions, against their formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lsim, lti

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError, BoundError, StartError

TAU, WN, W0 = -2.5, 2.0, 0.6


class Sweep(gl.Component):
    """Every torque on one shaft whose speed goes from -3 to 3 rad/s at 1 rad/s2, and their angular impulse."""

    impulse = gl.Variable("N.m.s", "angular impulse of all torques")

    def assemble(self) -> Any:
        self.drive = gp.Accelerate(a_ref=1.0, start={"w": -3.0})
        nominal = {"tau_nominal": TAU, "w_nominal": WN}
        self.linear = gp.LinearSpeedDependentTorque(**nominal)
        self.linear_both = gp.LinearSpeedDependentTorque(**nominal, torque_direction=False)
        self.quadratic = gp.QuadraticSpeedDependentTorque(**nominal)
        self.quadratic_both = gp.QuadraticSpeedDependentTorque(**nominal, torque_direction=False)
        self.inverse = gp.InverseSpeedDependentTorque(**nominal, w0=W0)
        self.inverse_both = gp.InverseSpeedDependentTorque(**nominal, w0=W0, torque_direction=False)
        for reg in ("exp", "sine", "linear", "cosine"):
            setattr(self, f"sign_{reg}", gp.SignTorque(tau_nominal=TAU, w0=W0, reg=reg))
        self.eddy = gp.EddyCurrentTorque(
            tau_nominal=-TAU, w_nominal=WN, alpha20=3.92e-3, T_ref=313.15, T=353.15, excitation=0.8
        )
        self.constant = gp.ConstantTorque(tau_constant=TAU)
        self.step = gp.TorqueStep(step_torque=2.0, offset_torque=0.5, start_time=1.25)
        loads = [p for p in self._parts.values() if p is not self.drive]
        return [gl.connect(self.drive.flange, *(load.flange for load in loads))]

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.impulse), self.drive.flange.tau)]


def laws(w: np.ndarray) -> dict[str, np.ndarray]:
    """The formulas, as in the Modelica Standard Library."""
    near, sign = np.abs(w) < W0, np.sign(w)
    x, angle = w / W0, np.pi / 2 * w / W0
    safe = np.where(w == 0, 1.0, w)
    alpha = 3.92e-3 / (1 + 3.92e-3 * 20)
    wn = w / (WN * (1 + alpha * 40))
    return {
        "linear": TAU * np.abs(w / WN),
        "linear_both": TAU * w / WN,
        "quadratic": TAU * (w / WN) ** 2,
        "quadratic_both": TAU * sign * (w / WN) ** 2,
        "inverse": np.where(near, TAU * WN / W0, TAU * WN / np.abs(safe)),
        "inverse_both": np.where(near, TAU * w / W0, TAU * WN / safe),
        "sign_exp": TAU * (2 / (1 + np.exp(-w / (0.01 * W0))) - 1),
        "sign_sine": TAU * np.where(near, np.sin(angle), sign),
        "sign_linear": TAU * np.where(near, x, sign),
        "sign_cosine": TAU * np.where(near, sign * (1 - np.cos(angle)), sign),
        "eddy": -2 * -TAU * 0.8**2 * wn / (1 + wn**2),
        "constant": np.full_like(w, TAU),
    }


def test_torques_follow_their_laws() -> None:
    # 122 intervals: no sample falls on a speed at which a torque jumps
    result = gl.simulate(Sweep(), t_end=6.0, samples=123, rtol=1e-10, outputs=["impulse"])
    w = result.time - 3.0
    assert result["drive.w"] == pytest.approx(w, abs=1e-12)
    for name, torque in laws(w).items():
        assert -result[f"{name}.flange.tau"] == pytest.approx(torque, abs=1e-11), name
    assert result["eddy.tau"] == pytest.approx(-laws(w)["eddy"], abs=1e-11)  # as in Modelica: positive where it brakes
    assert result["inverse.tau"] == pytest.approx(laws(w)["inverse"], abs=1e-11)
    step = np.where(result.time < 1.25, 0.5, 2.5)
    assert result["step.tau"] == pytest.approx(step, abs=1e-15)
    total = sum(laws(w).values()) + step
    assert result["drive.flange.tau"] == pytest.approx(total, abs=1e-10)  # it takes what the others give: no inertia here
    # Odd laws cancel over the sweep; the others by hand.
    even = TAU * 9 / WN + TAU * 18 / WN**2 + 2 * TAU * WN * (1 + np.log(3 / W0)) + 6 * TAU
    assert result["impulse"][-1] == pytest.approx(even + 0.5 * 1.25 + 2.5 * 4.75, abs=1e-8)


@pytest.mark.parametrize("kind", [gp.LinearSpeedDependentTorque, gp.QuadraticSpeedDependentTorque])
def test_nominal_speed_is_positive(kind: Any) -> None:
    class Model(gl.Component):
        def assemble(self) -> Any:
            self.load = kind(tau_nominal=1.0, w_nominal=0.0)
            return []

    with pytest.raises(BoundError, match=r"load\.w_nominal is 0"):
        gl.compile(Model())
    with pytest.raises(BindingError, match="'exp', 'sine', 'linear', 'cosine'"):
        gp.SignTorque(tau_nominal=1.0, w0=1.0, reg="Exp")


class Reaction(gl.Component):
    """A torque between a shaft and a housing that turns, by a source with support and by Torque2."""

    def assemble(self) -> Any:
        self.shaft, self.housing = gp.Inertia(J=2.0), gp.Inertia(J=5.0)
        self.first, self.second = gp.Torque(tau=3.0, use_support=True), gp.Torque2(tau=1.0)
        return [
            gl.connect(self.first.flange, self.shaft.flange_a),
            gl.connect(self.first.support, self.housing.flange_a),
            gl.connect(self.second.flange_b, self.shaft.flange_b),
            gl.connect(self.second.flange_a, self.housing.flange_b),
        ]


def test_reactions_go_to_the_housing() -> None:
    result = gl.simulate(Reaction(), t_end=2.0, samples=2)
    assert result["shaft.w"][-1] == pytest.approx(4.0 / 2.0 * 2.0, rel=1e-12)
    assert result["housing.w"][-1] == pytest.approx(-4.0 / 5.0 * 2.0, rel=1e-12)


class Forced(gl.Component):
    """A forced shaft that drives a body through a spring and a damper."""

    source = gl.Structural("Position")
    exact = gl.Structural(False)

    def assemble(self) -> Any:
        signal = 0.3 * gl.sin(5 * gl.time + 1)
        self.source_part = {
            "Position": lambda: gp.Position(phi_ref=signal, exact=self.exact, **gl.offered({"f_crit": 2.0})),
            "Speed": lambda: gp.Speed(w_ref=signal, exact=self.exact, **gl.offered({"f_crit": 2.0})),
            "Accelerate": lambda: gp.Accelerate(a_ref=signal, start={"phi": 0.2, "w": 0.5}),
            "Move": lambda: gp.Move(phi_ref=signal, w_ref=gl.der(signal), a_ref=-25 * signal),
            "ConstantSpeed": lambda: gp.ConstantSpeed(w_fixed=1.5),
        }[self.source]()
        self.body, self.spring, self.end = gp.Inertia(J=2.0), gp.SpringDamper(c=40.0, d=1.0), gp.Inertia(J=1.0)
        return [
            gl.connect(self.source_part.flange, self.body.flange_a),
            gl.connect(self.body.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.end.flange_a),
        ]


def motion(source: str, exact: bool, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle and speed of the forced shaft, from closed forms and from SciPy."""
    value, rate = 0.3 * np.sin(5 * t + 1), 1.5 * np.cos(5 * t + 1)
    if source == "ConstantSpeed":
        return 1.5 * t, np.full_like(t, 1.5)
    if source == "Accelerate":
        w = 0.5 + 0.06 * (np.cos(1) - np.cos(5 * t + 1))
        return 0.2 + (0.5 + 0.06 * np.cos(1)) * t - 0.012 * (np.sin(5 * t + 1) - np.sin(1)), w
    if source == "Move" or (source, exact) == ("Position", True):
        return value, rate
    if source == "Speed" and exact:
        return 0.06 * (np.cos(1) - np.cos(5 * t + 1)), value
    wc = 4 * np.pi

    def filtered(t: float, x: np.ndarray) -> list[float]:
        u = 0.3 * np.sin(5 * t + 1)
        return [x[1], ((u - x[0]) * wc - 1.3617 * x[1]) * wc / 0.618 if source == "Position" else (u - x[1]) * wc]

    start = [0.3 * np.sin(1), 0.0] if source == "Position" else [0.0, 0.3 * np.sin(1)]
    x = solve_ivp(filtered, (0, t[-1]), start, "DOP853", t, rtol=1e-12, atol=1e-13).y
    return x[0], x[1]


FORCED = [
    ("Position", False), ("Position", True), ("Speed", False), ("Speed", True), ("Accelerate", False), ("Move", False),
    ("ConstantSpeed", False),
]  # fmt: skip


@pytest.mark.parametrize(("e0", "w0", "k"), [(0.1, 0.0, 10.0), (0.0, -2.0, 10.0), (0.3, 1.7, 2.5), (-0.2, 0.4, 40.0)])
def test_move_returns_to_its_reference(e0: float, w0: float, k: float) -> None:
    """Off it by e with e'' + 2 k e' + k^2 e = 0: e = (e0 + (w0 + k e0) t) exp(-k t), which neither overshoots early nor lags."""

    class Deviating(gl.Component):
        def assemble(self) -> Any:
            signal = 0.3 * gl.sin(5 * gl.time + 1)
            self.move = gp.Move(
                phi_ref=signal, w_ref=gl.der(signal), a_ref=-25 * signal, k=k, start={"phi_error": e0, "w_error": w0}
            )
            self.body = gp.Inertia(J=2.0)
            return [gl.connect(self.move.flange, self.body.flange_a)]

    result = gl.simulate(Deviating(), t_end=2.0, samples=41, rtol=1e-10)
    t, decay = result.time, np.exp(-k * result.time)
    e, rate = (e0 + (w0 + k * e0) * t) * decay, (w0 - k * (w0 + k * e0) * t) * decay
    assert result["move.phi_error"] == pytest.approx(e, abs=1e-9)
    assert result["body.phi"] == pytest.approx(0.3 * np.sin(5 * t + 1) + e, abs=1e-9)
    assert result["body.w"] == pytest.approx(1.5 * np.cos(5 * t + 1) + rate, abs=1e-8)


@pytest.mark.parametrize(("source", "exact"), FORCED)
def test_forced_motions(source: str, exact: bool) -> None:
    result = gl.simulate(Forced(source=source, exact=exact), t_end=2.0, samples=41, rtol=1e-10)
    phi, w = motion(source, exact, result.time)
    assert result["body.phi"] == pytest.approx(phi, abs=1e-9)
    assert result["body.w"] == pytest.approx(w, abs=1e-9)
    # The torque that the motion takes accelerates both bodies: its angular impulse is their angular momentum.
    momentum = 2.0 * result["body.w"] + result["end.w"]
    fine = gl.simulate(Forced(source=source, exact=exact), t_end=2.0, samples=4001, rtol=1e-10)
    impulse = np.trapezoid(-fine["source_part.flange.tau"], fine.time)
    assert momentum[-1] - momentum[0] == pytest.approx(impulse, abs=2e-5)


class Filtered(gl.Component):
    """A filtered position whose reference comes from outside."""

    def assemble(self) -> Any:
        self.drive, self.body = gp.Position(f_crit=3.0), gp.Inertia(J=1.0)
        return [gl.connect(self.drive.flange, self.body.flange_a)]


def test_an_unbound_reference_starts_the_filter() -> None:
    t = np.linspace(0.0, 1.0, 11)
    reference = gl.Table([0.0, 0.4, 1.0], [0.2, 0.5, 0.1])
    result = gl.compile(Filtered()).simulate(1.0, times=t, inputs={"drive.phi_ref": reference}, rtol=1e-10)
    wc, fine = 6 * np.pi, np.linspace(0.0, 1.0, 10001)
    bessel = lti([wc**2 / 0.618], [1.0, 1.3617 * wc / 0.618, wc**2 / 0.618])
    _, y, _ = lsim(bessel, np.interp(fine, [0.0, 0.4, 1.0], [0.2, 0.5, 0.1]) - 0.2, fine)
    assert result["body.phi"] == pytest.approx(0.2 + y[::1000], abs=1e-9)


@pytest.mark.parametrize(("source", "lag"), [("Position", 1.3617), ("Speed", 1.0)])
def test_filters_cut_off_at_50_hz_unless_told_otherwise(source: str, lag: float) -> None:
    """A filter follows a ramp of slope 1 with a delay: the coefficient of its first derivative over the angular frequency."""

    class Ramp(gl.Component):
        def assemble(self) -> Any:
            self.drive = gp.Position(phi_ref=gl.time) if source == "Position" else gp.Speed(w_ref=gl.time)
            self.body = gp.Inertia(J=1.0)
            return [gl.connect(self.drive.flange, self.body.flange_a)]

    error = "drive.phi_error" if source == "Position" else "drive.w_error"
    assert gl.simulate(Ramp(), t_end=1.0, samples=2, rtol=1e-9)[error][-1] == pytest.approx(-lag / (100 * np.pi), rel=1e-6)


class Braked(gl.Component):
    """An eddy current brake of copper on a turning body."""

    def assemble(self) -> Any:
        self.body = gp.Inertia(J=1.0, start={"w": 1.0})
        self.brake = gp.EddyCurrentTorque(tau_nominal=10.0, w_nominal=20.0, alpha20=0.004, T=300.0)
        return [gl.connect(self.body.flange_a, self.brake.flange)]


@pytest.mark.parametrize("method", ["rk", "ida", "auto"])
def test_an_eddy_current_brake_is_refused_where_its_disc_would_have_a_negative_resistance(method: str) -> None:
    """1 + 0.004 (T - 293.15) vanishes at 43.15 K."""
    system = gl.compile(Braked())
    result = system.simulate(1e-3, samples=2, method=method, parameters={"brake.T": 43.65})
    assert result["brake.resistance"][-1] == pytest.approx(0.002, rel=1e-12)
    assert result["body.w"][-1] < 1.0
    with pytest.raises(StartError, match=r"brake.resistance is -0.002 .* let start values, parameters and inputs"):
        system.simulate(1e-3, samples=2, method=method, parameters={"brake.T": 42.65})
