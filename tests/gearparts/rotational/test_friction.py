"""Bearings, brakes, clutches and freewheels: reference trajectories, modes by hand, laws of Coulomb friction, energy."""

from __future__ import annotations

import itertools
import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.interpolate import Akima1DInterpolator
from scipy.optimize import brentq

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError, SolverError
from gearlib.flatten.flatten import flatten
from gearparts.rotational.friction import BEYOND, BearingFriction, Brake, Clutch, words
from gearparts.rotational.friction import OneWayClutch as OneWayClutchPart
from gearparts.tables import at_zero, check_rows, extremes, interpolated
from tests.gearparts import heat_losses_by_hand
from tests.gearparts import msl_hybrid_examples as msl
from tests.gearparts.laws import right_side
from tests.gearparts.rotational.friction_by_hand import Bodies, Element
from tests.gearparts.test_msl_examples import agree, reference

METHODS = ["rk", "ida"]


def run(component: gl.Component, outputs: list[str], times: np.ndarray, method: str, rtol: float = 1e-9) -> Any:
    return gl.compile(component, outputs=outputs).simulate(times[-1], times=times, method=method, rtol=rtol)


def modes_agree(result: Any, expected: dict[str, np.ndarray]) -> None:
    """Modes are compared where they last: at a sample on an event itself, either side may be meant."""
    for name, signal in expected.items():
        lasting = np.ones(len(signal), bool)
        lasting[1:] &= signal[1:] == signal[:-1]
        lasting[0] = signal[0] == signal[1]
        lasting[0] &= result[name][0] != 0  # a start at rest
        assert (result[name][lasting] == signal[lasting]).all(), name


def check_against_reference(component: gl.Component, name: str, method: str) -> Any:
    expected = reference(name)
    times = expected.pop("time")
    result = run(component, list(expected), times, method)
    modes = {k: expected.pop(k) for k in list(expected) if k.endswith(".mode")}
    agree(result, {k: np.where(np.isnan(v), result[k], v) for k, v in expected.items()})
    modes_agree(result, modes)
    return result


@pytest.mark.parametrize("method", METHODS)
def test_friction(method: str) -> None:
    check_against_reference(msl.Friction(), "Friction", method)


@pytest.mark.parametrize("method", METHODS)
def test_simple_gear_shift(method: str) -> None:
    result = check_against_reference(msl.SimpleGearShift(), "SimpleGearShift", method)
    assert result.stats["events"] < 30  # no chatter of the surfaces that stick


def clutch(bodies: int, at: int, level: Any, peak: float) -> Element:
    speed = np.zeros(bodies)
    speed[at], speed[at + 1] = -1.0, 1.0
    return Element(speed, lambda t, v: level(t), lambda t: peak * level(t))


LEVELS = (
    lambda t: 10 * max(math.cos(0.4 * math.pi * t), 0.0), lambda t: 10.0 if t >= 0.4 else 0.0, lambda t: 10.0 if t >= 0.9 else 0.0,
)  # fmt: skip


@cache
def coupled_by_hand() -> Any:
    """Times, angles, speeds and modes of the clutches."""
    times = np.linspace(0.0, 1.5, 151)
    by_hand = Bodies(
        np.ones(4), lambda t: np.array([10 * math.sin(10 * math.pi * t), 0, 0, 0]),
        [clutch(4, i, level, 1.1) for i, level in enumerate(LEVELS)],
    )  # fmt: skip
    return times, *by_hand.integrate(np.array([10.0, 0, 0, 0]), times, [0.4, 0.9, 1.25])


@pytest.mark.parametrize("method", METHODS)
def test_coupled_clutches(method: str) -> None:
    times, phi, w, modes = coupled_by_hand()
    expected = {f"J{i + 1}.w": w[i] for i in range(4)} | {f"J{i + 1}.phi": phi[i] for i in range(4)}
    expected |= {f"clutch{i + 1}.w_rel": w[i + 1] - w[i] for i in range(3)}
    expected |= {f"clutch{i + 1}.phi_rel": phi[i + 1] - phi[i] for i in range(3)}
    free = [[level(t + 1e-9) <= 0 for t in times] for level in LEVELS]
    signals = {f"clutch{i + 1}.mode": np.where(free[i], 2, modes[i]) for i in range(3)}
    result = run(msl.CoupledClutches(), [*expected, *signals], times, method)
    agree(result, expected, 1e-7)
    modes_agree(result, signals)


@cache
def one_way_by_hand(load: float, f: float, offset: float, force: Any, stops: tuple[float, ...]) -> Any:
    """Angles, speeds and modes, at 201 times up to 2 s."""
    times = np.linspace(0.0, 2.0, 201)
    small = 1e-4 * 0.5 * 3.0
    element = Element(
        np.array([-1.0, 1.0]),
        lambda t, v: 1.5 * force(t),
        lambda t: 25 * 1.5 * force(t) if force(t) > 0 else small,
        freewheel=True,
    )
    return Bodies(
        np.ones(2), lambda t: np.array([offset + 10 * math.sin(2 * math.pi * f * t), load]), [element]
    ).integrate(np.array([-0.5, 0.0]), times, list(stops))  # fmt: skip


def pressed(t: float) -> float:
    return 1.0 if 0.3 <= t < 0.95 or t >= 1.6 else 0.0


def released(t: float) -> float:
    return 0.0


@pytest.mark.parametrize("method", METHODS)
def test_one_way_clutch(method: str) -> None:
    times = np.linspace(0.0, 2.0, 201)
    phi, w, modes = one_way_by_hand(0.0, 3.0, 0.0, pressed, (0.3, 0.95, 1.6))
    expected = {"inertiaIn.w": w[0], "inertiaOut.w": w[1], "inertiaIn.phi": phi[0], "inertiaOut.phi": phi[1]}
    expected |= {"oneWayClutch.w_rel": w[1] - w[0], "oneWayClutch.phi_rel": phi[1] - phi[0]}
    result = run(msl.OneWayClutch(), [*expected, "oneWayClutch.stuck", "oneWayClutch.loss_power"], times, method)
    agree(result, expected, 1e-6)
    touches = (modes[0] == 1) & (w[1] - w[0] < 1e-6)  # at 1.5 s, where both speeds are the same for an instant
    stuck = np.where(touches, result["oneWayClutch.stuck"], 1 - modes[0])
    modes_agree(result, {"oneWayClutch.stuck": stuck})
    assert touches.sum() < 5
    assert (result["inertiaOut.w"] - result["inertiaIn.w"]).min() > -1e-8
    assert result["oneWayClutch.loss_power"].min() >= 0


@pytest.mark.parametrize("method", METHODS)
def test_one_way_clutch_disengaged(method: str) -> None:
    times = np.linspace(0.0, 2.0, 201)
    phi, w, _ = one_way_by_hand(-0.3, 2.0, 0.3, released, ())
    expected = {"inertiaIn.w": w[0], "inertiaOut.w": w[1], "inertiaIn.phi": phi[0], "inertiaOut.phi": phi[1]}
    expected |= {"oneWayClutch.w_rel": w[1] - w[0], "oneWayClutch.phi_rel": phi[1] - phi[0]}
    agree(run(msl.OneWayClutchDisengaged(), [*expected], times, method), expected, 1e-6)


class Coasting(gl.Component):
    """A body that coasts to rest in a bearing, and is pushed again later."""

    tau_pos = gl.Structural(((0.0, 1.0),))
    peak = gl.Parameter("1", default=1.0)
    push = gl.Input("N.m", default=0.0)

    def assemble(self) -> Any:
        self.body = gp.Inertia(J=2.0, start={"phi": 0.0, "w": -6.0})
        self.bearing = BearingFriction(tau_pos=self.tau_pos, peak=self.peak)
        self.torque = gp.Torque(tau=self.push)
        return [
            gl.connect(self.torque.flange, self.bearing.flange_a),
            gl.connect(self.bearing.flange_b, self.body.flange_a),
        ]


def test_a_body_coasts_to_rest_in_its_bearing() -> None:
    t = np.linspace(0.0, 20.0, 401)
    result = run(Coasting(), ["body.w", "body.phi", "bearing.mode", "bearing.contact", "bearing.loss_power"], t, "rk")
    assert (result["bearing.contact"] == np.where(t < 12.0, 2, 1))[t != 12.0].all()
    agree(result, {"body.w": np.minimum(-6 + 0.5 * t, 0.0)}, 1e-9)
    assert result["body.phi"][-1] == pytest.approx(-36.0, rel=1e-9)
    assert (result["bearing.mode"] == np.where(t < 12.0, -1, 0))[t != 12.0].all()
    assert np.trapezoid(result["bearing.loss_power"], t) == pytest.approx(36.0, rel=1e-9)


def test_a_table_of_bearing_torques_is_interpolated_and_extrapolated() -> None:
    # 2 w' = -(1 + w) to w = 1, -(2 + 3 (w - 1)) from there on, also beyond the last row
    rows = ((0.0, 1.0), (1.0, 2.0), (3.0, 8.0))
    t = np.linspace(0.0, 3.0, 121)
    t1 = 2 / 3 * math.log((6 - 1 / 3) / (1 - 1 / 3))
    t0 = t1 + 2 * math.log(2.0)
    w = np.select(
        [t < t1, t < t0], [1 / 3 + (6 - 1 / 3) * np.exp(-1.5 * t), -1 + 2 * np.exp(-0.5 * (t - t1))], 0.0
    )  # fmt: skip
    result = run(Coasting(tau_pos=rows), ["body.w"], t, "rk")
    agree(result, {"body.w": -w}, 1e-8)


def test_peak_holds_what_the_sliding_torque_would_not() -> None:
    t = np.linspace(0.0, 30.0, 301)
    push = gl.Piecewise((0, gl.time < 15), (0.2 * (gl.time - 15), True))
    result = run(Coasting(peak=1.5, push=push), ["body.w", "bearing.mode"], t, "rk")
    late = np.maximum(t - 22.5, 0.0)  # 1.5 N.m are reached there
    expected = np.minimum(-6 + 0.5 * t, 0.0) + (0.5 * late + 0.1 * late**2) / 2
    agree(result, {"body.w": expected}, 1e-8)
    assert (result["bearing.mode"][t > 22.6] == 1).all()


def coulomb(name: str, v: np.ndarray, tau: np.ndarray, level: np.ndarray) -> None:
    """Coulomb's law at every sample, whatever the modes say."""
    moving = np.abs(v) > 1e-9
    assert tau[moving] == pytest.approx((np.sign(v) * level)[moving], rel=1e-6, abs=1e-9), name
    assert (np.abs(tau) <= level * (1 + 1e-6) + 1e-9).all(), name


HEAT = [f"inertia{i}.w" for i in range(1, 7)]
LOSSES = ["damper", "springDamper", "elastoBacklash", "bearingFriction", "lossyGear", "clutch", "oneWayClutch", "brake"]


@pytest.fixture(scope="module")
def heat_losses() -> Any:
    outputs = [
        *HEAT, *(f"{part}.loss_power" for part in LOSSES), "bearingFriction.tau", "bearingFriction.w", "clutch.tau", "clutch.w_rel",
        "brake.tau", "brake.w", "oneWayClutch.tau", "oneWayClutch.w_rel", "oneWayClutch.stuck", "lossyGear.flange_a.tau",
        "lossyGear.tau_loss", "lossyGear.w_a", "TAmbient.port.Q_flow", "springDamper.phi_rel", "spring3.phi_rel",
        "elastoBacklash.tau_c", "lossyGear.flange_b.tau",
    ]  # fmt: skip
    return run(msl.HeatLosses(), outputs, np.linspace(0.0, 1.0, 2001), "rk")


@pytest.mark.slow  # to compile
def test_heat_losses_obeys_the_laws_of_friction(heat_losses: Any) -> None:
    r, t = heat_losses, heat_losses.time
    f = np.sin(0.4 * np.pi * t)
    w, T, L = r["lossyGear.w_a"], r["lossyGear.flange_a.tau"], r["lossyGear.tau_loss"]
    # at first the gear and the brake both hold the shaft between them, in no unique way, until neither can any more
    rest = t < t[np.argmax(np.abs(w) > 1e-12)]
    assert 70 < rest.sum() < 90
    strongest = (1 + 0.5 * f) / 0.8
    assert (T[rest] <= strongest[rest]).all()
    assert T[rest][-1] + 1.1 * (T[rest][-1] - T[rest][-2]) > strongest[rest][-1]
    go = ~rest
    coulomb("bearing", r["bearingFriction.w"], r["bearingFriction.tau"], np.ones(len(f)))
    coulomb("clutch", r["clutch.w_rel"], r["clutch.tau"], 5 * f)
    coulomb("brake", r["brake.w"][go], r["brake.tau"][go], f[go])
    v, tau = r["oneWayClutch.w_rel"], r["oneWayClutch.tau"]
    overruns = v > 1e-9
    assert v.min() > -1e-8
    assert tau[overruns] == pytest.approx(0.5 * f[overruns], rel=1e-6, abs=1e-9)
    assert (tau <= 0.5 * f * (1 + 1.1e-4) + 1e-4)[go].all()
    eta, B = 0.8 - 0.1 * np.abs(w), 1 + np.abs(w)
    drives = np.where(w > 0, T >= 0, T < 0)  # B1 = B2: no bearing torque on side a
    loss = np.where(drives, (1 - eta) * T, (1 - 1 / eta) * T) + np.sign(w) * B
    moving = np.abs(w) > 1e-9
    assert L[moving] == pytest.approx(loss[moving], rel=1e-6, abs=1e-9)
    assert r["lossyGear.flange_b.tau"] == pytest.approx(-2 * (T - L), rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_heat_losses_conserves_energy(heat_losses: Any) -> None:
    r, t = heat_losses, heat_losses.time
    lost = sum(r[f"{part}.loss_power"] for part in LOSSES)
    assert r["TAmbient.port.Q_flow"] == pytest.approx(lost, rel=1e-9, abs=1e-12)
    assert all((r[f"{part}.loss_power"] >= -1e-9).all() for part in LOSSES)
    stored = sum(r[name] ** 2 for name in HEAT) + 5e3 * (r["springDamper.phi_rel"] ** 2 + r["spring3.phi_rel"] ** 2)
    stored = stored + r["elastoBacklash.tau_c"] ** 2 / 2e5
    work = np.trapezoid(20 * np.sin(10 * np.pi * t) * r["inertia1.w"], t)
    assert stored[-1] + np.trapezoid(lost, t) == pytest.approx(work, rel=2e-4)  # as good as the trapezoids


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_heat_losses_agrees_with_modes_by_hand(method: str) -> None:
    times = np.linspace(0.0, 1.0, 501)
    y, modes = heat_losses_by_hand.integrate(times)
    phi, w = y[:6], y[6:12]
    expected = {f"inertia{i + 1}.phi": phi[i] for i in range(6)} | {f"inertia{i + 1}.w": w[i] for i in range(6)}
    pairs = {"springDamper": (0, 1), "elastoBacklash": (1, 2), "oneWayClutch": (4, 5)}
    expected |= {f"{part}.phi_rel": phi[b] - phi[a] for part, (a, b) in pairs.items()}
    expected |= {f"{part}.w_rel": w[b] - w[a] for part, (a, b) in pairs.items()}
    expected |= {"clutch.phi_rel": phi[4] - phi[3] / 2, "clutch.w_rel": w[4] - w[3] / 2, "damper.w_rel": w[0]}
    signals = {"bearingFriction.mode": 0, "lossyGear.mode": 1, "clutch.mode": 2, "oneWayClutch.stuck": 3, "brake.mode": 4}
    result = run(msl.HeatLosses(), [*expected, *signals], times, method)
    agree(result, expected, 1e-7)
    for name, row in signals.items():
        lasting = np.append(False, modes[row, 1:] == modes[row, :-1])
        mode = 1 - modes[row] if name.endswith("stuck") else modes[row]
        assert (result[name] == mode)[lasting].all(), name


class Warm(gl.Component):
    """A part between a driving and a driven body, with its heat port on a body."""

    kind = gl.Structural(Clutch)

    def assemble(self) -> Any:
        self.a, self.b = gp.Inertia(J=1.0, start={"w": 1.0}), gp.Inertia(J=1.0, start={"w": 5.0})
        self.part = self.kind(fn_max=4.0, f_normalized=1.0, use_heat_port=True)
        self.metal = gp.HeatCapacitor(C=10.0, start={"T": 300.0})
        return [
            gl.connect(self.a.flange_b, self.part.flange_a),
            gl.connect(self.part.flange_b, self.b.flange_a),
            gl.connect(self.part.heat_port, self.metal.port),
        ]


@pytest.mark.parametrize("kind", [Clutch, OneWayClutchPart])
def test_a_clutch_heats_up_by_the_energy_it_takes(kind: type[gl.Component]) -> None:
    result = gl.simulate(Warm(kind=kind), t_end=3.0, samples=31, method="rk", rtol=1e-9)
    assert result["metal.T"][-1] == pytest.approx(300 + (0.5 + 12.5 - 9.0) / 10, rel=1e-9)
    assert result["a.w"] == pytest.approx(np.minimum(1 + 2 * result.time, 3.0), rel=1e-9)


class Braked(gl.Component):
    """A brake whose housing rides on a body."""

    def assemble(self) -> Any:
        self.shaft, self.housing = gp.Inertia(J=1.0, start={"w": 9.0}), gp.Inertia(J=2.0, start={"w": 0.0})
        self.brake = Brake(fn_max=2.0, mu_pos=((0.0, 0.75),), cgeo=2.0, f_normalized=1.0, use_support=True)
        return [
            gl.connect(self.shaft.flange_b, self.brake.flange_a),
            gl.connect(self.brake.support, self.housing.flange_a),
        ]


def test_a_brake_drags_its_housing_along() -> None:
    result = gl.simulate(Braked(), t_end=4.0, samples=41, method="rk", rtol=1e-9)
    assert result["shaft.w"] == pytest.approx(np.maximum(9 - 3 * result.time, 3.0), rel=1e-9)
    assert result["housing.w"] == pytest.approx(np.minimum(1.5 * result.time, 3.0), rel=1e-9, abs=1e-12)


class HeldShaft(gl.Component):
    """A shaft that a brake stops, and that a freewheel then keeps from turning back."""

    def assemble(self) -> Any:
        self.torque = gp.Torque(tau=gl.Piecewise((-6.0, gl.time < 1), (8.0, True)))
        self.shaft, self.ground = gp.Inertia(J=1.0, start={"phi": 0, "w": 2.2}), gp.Fixed()
        self.brake, self.freewheel = Brake(fn_max=10, f_normalized=1.0), OneWayClutchPart(fn_max=8, f_normalized=0.0)
        return [
            gl.connect(self.torque.flange, self.shaft.flange_a, self.brake.flange_a, self.freewheel.flange_b),
            gl.connect(self.freewheel.flange_a, self.ground.flange),
        ]


@pytest.mark.parametrize("method", METHODS)
def test_a_freewheel_holds_what_a_brake_alone_would_not(method: str) -> None:
    """The brake is at its limit of 5 N.m, the freewheel takes the rest; forward only the brake acts."""
    outputs = ["shaft.w", "brake.tau", "freewheel.tau", "brake.contact", "freewheel.contact"]
    result = run(HeldShaft(), outputs, np.linspace(0.0, 2.0, 41), method)
    t = result.time
    assert result["shaft.w"] == pytest.approx(np.where(t < 0.2, 2.2 - 11 * t, 3 * np.maximum(t - 1, 0)), abs=1e-8)
    held = (t > 0.2) & (t < 1)
    assert result["brake.tau"][held] + result["freewheel.tau"][held] == pytest.approx(-6.0)
    assert (np.abs(result["brake.tau"][held]) <= 5 + 1e-9).all()
    assert (result["freewheel.contact"][held] == 1).all()
    slides = (t < 0.2) | (t > 1)
    assert (result["freewheel.contact"][slides] == 0).all()  # nothing presses it: it overruns freely
    assert (result["brake.contact"][slides] == 2).all()


@pytest.mark.parametrize("rows", [(), ((0.0, 1.0, 2.0),), ((0.0, 1.0), (0.0, 2.0)), (3.0,), ((0.0, math.nan),)])
def test_a_table_that_is_none_is_named(rows: Any) -> None:
    with pytest.raises(BindingError, match="tau_pos"):
        check_rows("BearingFriction.tau_pos", rows, 2)


TABLE = ((0.0, 0.5), (1.0, 0.3), (2.5, 0.35), (4.0, 0.35), (5.0, 0.8))
KINK = (
    (0.0, 2.0),
    (1.0, 1.0),
    (2.0, 0.0),
    (3.0, 1.0),
    (5.0, 3.0),
)  # straight on both sides: Akima takes the mean of the slopes


@pytest.mark.parametrize("rows", [TABLE, KINK])
@pytest.mark.parametrize("smoothness", ["linear", "constant", "akima"])
def test_tables_are_interpolated_as_asked(smoothness: str, rows: Any) -> None:
    x = sympy.Symbol("x", real=True)
    law = interpolated(rows, x, 1, smoothness)
    law = law if smoothness == "constant" else law.args[0]
    at = np.linspace(-1.0, 6.0, 141)
    left, right = np.array(rows).T
    ends = [0, -1]
    if smoothness == "constant":
        expected = right[np.clip(np.searchsorted(left, at, side="right") - 1, 0, 4)]
        assert not law.has(gl.no_event(x).func), "jumps are events"
    else:
        inner = Akima1DInterpolator(left, right)
        slope = inner.derivative()(left[ends]) if smoothness == "akima" else (np.diff(right) / np.diff(left))[ends]
        curve = inner(at) if smoothness == "akima" else np.interp(at, left, right)
        expected = np.select([at < 0, at > 5], [right[0] + slope[0] * at, right[-1] + slope[1] * (at - 5)], curve)
    assert [float(law.subs(x, t)) for t in at] == pytest.approx(expected, abs=1e-12)


def test_a_table_may_be_a_list_or_an_array() -> None:
    rows = [[0.0, 0.75], [10.0, 0.5]]
    for table in (rows, np.array(rows), tuple(map(tuple, rows))):
        clutch = gp.Clutch(fn_max=1.0, f_normalized=1.0, mu_pos=table)
        assert clutch.mu_pos == ((0.0, 0.75), (10.0, 0.5))


def test_at_zero_is_interpolated_from_rows_to_both_sides() -> None:
    assert at_zero(((-1.0, 2.0), (3.0, 6.0))) == pytest.approx(3.0)
    assert at_zero(((1.0, 2.0), (3.0, 6.0))) == pytest.approx(0.0)
    rows = ((-2.0, 1.0), (-1.0, 2.0), (1.0, -1.0), (3.0, 6.0))
    assert at_zero(rows, 1, "akima") == pytest.approx(float(Akima1DInterpolator(*np.array(rows).T)(0.0)))


@pytest.mark.parametrize(("make", "name"), [
    (lambda rows: Brake(fn_max=1.0, f_normalized=1.0, mu_pos=rows), r"Brake\.mu_pos"),
    (lambda rows: Clutch(fn_max=1.0, f_normalized=1.0, mu_pos=rows), r"Clutch\.mu_pos"),
    (lambda rows: BearingFriction(tau_pos=rows), r"BearingFriction\.tau_pos"),
])  # fmt: skip
def test_friction_that_would_drive_is_named(make: Any, name: str) -> None:
    for rows in (((0.0, -0.5),), ((0.0, 0.5), (1.0, -1e-9))):
        with pytest.raises(BindingError, match=f"{name} .* expected friction of 0 or more"):
            flatten(make(rows))
    flatten(make(((0.0, 0.5), (1.0, 0.0))))
    flatten(make(((1.0, 0.3), (3.0, 0.9))))  # 0 at rest, but for rounding
    steep = ((0.1, 1e5), (0.1 * 3, 0.1 * 3 * 1e6))
    assert -1e-9 < at_zero(steep) < -1e-12
    flatten(make(steep))
    with pytest.raises(
        BindingError, match=rf"{name} is .*, whose extrapolation to the speed 0 is negative; expected a row for it"
    ):
        flatten(make(((1.0, 0.3), (3.0, 0.9 + 1e-10))))


@pytest.mark.parametrize(("make", "name"), [
    (lambda rows, how: Brake(fn_max=1.0, f_normalized=1.0, mu_pos=rows, smoothness=how), r"Brake\.mu_pos"),
    (lambda rows, how: BearingFriction(tau_pos=rows, smoothness=how), r"BearingFriction\.tau_pos"),
])  # fmt: skip
def test_friction_whose_curve_would_drive_between_rows_is_named(make: Any, name: str) -> None:
    deep = ((0.0, 0.5), (1.0, 0.02), (2.0, 0.02), (3.0, 0.5))
    with pytest.raises(
        BindingError, match=rf"{name} is .*, whose akima curve falls to -0\.04 between rows; .* smoothness='linear'"
    ):
        flatten(make(deep, "akima"))
    flatten(make(deep, "linear"))
    flatten(make(((0.0, 0.5), (1.0, 0.2), (2.0, 0.2), (3.0, 0.5)), "akima"))


@pytest.mark.parametrize("seed", range(8))
def test_the_extremes_of_a_curve_are_those_of_many_points(seed: int) -> None:
    random = np.random.default_rng(seed)
    left = np.cumsum(random.uniform(0.1, 2.0, 6)) - 2.0
    right = random.choice([0.0, 0.2, 0.9, 1.0], 6)
    rows = tuple(zip(left.tolist(), right.tolist(), strict=True))
    at = np.linspace(max(left[0], 0.0), left[-1], 20001)
    curve = Akima1DInterpolator(left, right)(at)
    low, high = extremes(rows, 1, "akima")
    assert low == pytest.approx(min(curve.min(), right.min()), abs=1e-6)
    assert high == pytest.approx(max(curve.max(), right.max()), abs=1e-6)
    assert extremes(rows) == extremes(rows, 1, "constant") == (right.min(), right.max())


@pytest.mark.parametrize("smoothness", ["linear", "akima"])
def test_friction_that_falls_over_the_speed_ends_at_zero(smoothness: str) -> None:
    """Extrapolated on, it would drive."""
    x, rows = sympy.Symbol("x", real=True), ((0.0, 4.0), (1.0, 3.0), (2.0, 2.0))
    law = interpolated(rows, x, 1, smoothness, (0.0, math.inf)).args[0]
    assert [float(law.subs(x, at)) for at in (1.5, 3.0, 3.99, 4.0, 5.0, 1e6)] == pytest.approx([2.5, 1.0, 0.01, 0.0, 0.0, 0.0])
    law = interpolated(((0.0, 0.4), (1.0, 0.8)), x, 1, smoothness, (0.0, 1.0)).args[0]
    assert [float(law.subs(x, at)) for at in (1.0, 1.25, 1.5, 1.75)] == pytest.approx([0.8, 0.9, 1.0, 1.0])
    bearing = BearingFriction(tau_pos=rows, smoothness=smoothness)
    pressed = [kind(mu_pos=rows, smoothness=smoothness, fn_max=1.0) for kind in (Brake, Clutch)]
    for part, sense in itertools.product((bearing, *pressed), (1, -1)):
        values = {"cgeo": 1.0, "fn_max": 1.0, "f_normalized": 1.0, "pre_mode": sense}
        assert [right_side(part, "tau", v=sense * v, **values) for v in (3.5, 4.5)] == pytest.approx([0.5 * sense, 0.0])


def test_a_body_beyond_its_friction_coasts() -> None:
    result = run(Coasting(tau_pos=((0.0, 1.0), (1.0, 0.8))), ["body.w"], np.linspace(0.0, 20.0, 3), "rk")
    assert result["body.w"].tolist() == [-6.0] * 3


class Rig(gl.Component):
    """A bearing on a shaft whose speed is prescribed."""

    w = gl.Parameter("rad/s", "mean speed", default=4.0)

    def assemble(self) -> list[Any]:
        self.drive = gp.Speed(exact=True, w_ref=self.w + gl.sin(gl.time))
        self.bearing = gp.BearingFriction(tau_pos=((0.0, 0.5), (1.0, 0.9)))
        return [gl.connect(self.drive.flange, self.bearing.flange_a)]


@pytest.mark.parametrize("method", ["rk", "ida"])
@pytest.mark.parametrize("w", [4.0, -4.0, 0.5])
def test_a_bearing_on_a_prescribed_motion(w: float, method: str) -> None:
    """It slips from the start, and through zero from one direction to the other: stuck, the motion would have no solution."""
    result = gl.compile(Rig()).simulate(10.0, samples=51, method=method, parameters={"w": w})
    speed = w + np.sin(result.time)
    assert result["bearing.tau"] == pytest.approx(np.sign(speed) * (0.5 + 0.4 * abs(speed)), abs=1e-9)


STARTS = [gl.Piecewise((0.0, gl.time < 0.2), (10.0, True)), 10.0]  # at rest for a while, and not at all


class Prescribed(gl.Component):
    """A friction element and a body behind it on a shaft whose acceleration is prescribed."""

    kind = gl.Structural("bearing", choices=("bearing", "brake", "gear"))
    a = gl.Structural(None)
    w0 = gl.Parameter("rad/s", "speed at the start", default=0.0)

    def assemble(self) -> list[Any]:
        self.m, self.j = gp.Accelerate(a_ref=self.a, start={"w": self.w0}), gp.Inertia(J=0.1)
        self.g = {
            "bearing": lambda: gp.BearingFriction(tau_pos=((0, 0.5), (100, 1.0))),
            "brake": lambda: gp.Brake(fn_max=1.0, f_normalized=1.0, mu_pos=((0, 0.5), (100, 1.0)), peak=1.3),
            "gear": lambda: gp.LossyGear(ratio=1.0, loss_table=((0, 1, 1, 0.5, 0.5), (100, 1, 1, 1.0, 1.0))),
        }[self.kind]()
        return [gl.connect(self.m.flange, self.g.flange_a), gl.connect(self.g.flange_b, self.j.flange_a)]


@cache
def prescribed(kind: str, a: Any) -> gl.System:
    return gl.compile(Prescribed(kind=kind, a=a))


@pytest.mark.parametrize("method", ["rk", "ida"])
@pytest.mark.parametrize("kind", ["bearing", "brake", "gear"])
@pytest.mark.parametrize(("a", "w0"), [(STARTS[0], 0.0), (STARTS[1], 0.0), (-10.0, 0.0), (-10.0, 3.0), (8.0, -2.0)])
def test_friction_on_a_motion_that_starts_from_rest_or_passes_through_it(kind: str, method: str, a: Any, w0: float) -> None:
    """The shaft slides as soon as it moves, and has no friction torque while it is held at rest."""
    result = prescribed(kind, a).simulate(1.0, samples=24, method=method, rtol=1e-9, parameters={"w0": w0})
    t = result.time
    rate = np.where(t < 0.2, 0.0, 10.0) if a is STARTS[0] else np.full_like(t, a)
    w = 10.0 * np.maximum(t - 0.2, 0.0) if a is STARTS[0] else w0 + a * t
    friction = np.where((w == 0) & (rate == 0), 0.0, np.sign(np.where(w == 0, rate, w)) * (0.5 + 0.005 * abs(w)))
    assert result["j.w"] == pytest.approx(w, abs=1e-8)
    assert -result["m.flange.tau"] == pytest.approx(0.1 * rate + friction, abs=1e-8)


def test_a_clutch_between_two_prescribed_motions_slides() -> None:
    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Accelerate(a_ref=-10.0, start={"w": 3.0}), gp.Accelerate(a_ref=-5.0, start={"w": 1.0})
            self.c = gp.Clutch(fn_max=2.0, f_normalized=1.0)
            return [gl.connect(self.a.flange, self.c.flange_a), gl.connect(self.c.flange_b, self.b.flange)]

    for method in ("rk", "ida"):
        result = gl.simulate(Two(), 1.0, samples=8, method=method)
        assert result["c.tau"] == pytest.approx(np.where(result.time < 0.4, -1.0, 1.0) * np.sign(1.0), abs=1e-9)


class Overrunning(gl.Component):
    """A freewheel between two prescribed motions: ``w_rel = w_b - w_a``."""

    w = gl.Structural(None)

    def assemble(self) -> list[Any]:
        self.wall, self.drive = gp.Fixed(), gp.Speed(w_ref=self.w, exact=True)
        self.c = gp.OneWayClutch(fn_max=20.0, f_normalized=1.0)
        return [gl.connect(self.wall.flange, self.c.flange_a), gl.connect(self.c.flange_b, self.drive.flange)]


@pytest.mark.parametrize("method", ["rk", "ida"])
@pytest.mark.parametrize("outputs", [None, ["c.tau"], ["drive.flange.tau"]])
def test_a_freewheel_between_prescribed_motions_slides(method: str, outputs: Any) -> None:
    """From rest, and again after a rest: locked, the motion would have no solution."""
    w = gl.Piecewise((gl.sin(gl.time) ** 2, gl.time < 2 * gl.pi), (0.0, gl.time < 7.0), ((gl.time - 7.0) ** 2, True))
    result = gl.compile(Overrunning(w=w), outputs=outputs).simulate(
        8.0, times=[0.0, 1.0, 2.0, 5.0, 6.5, 7.5, 8.0], method=method
    )
    sliding = [1, 2, 3, 5, 6]  # at rest nothing says what the torque is
    assert np.abs(result["drive.flange.tau"][sliding]) == pytest.approx(10.0, abs=1e-9)


@pytest.mark.parametrize("method", ["rk", "ida", "auto"])
@pytest.mark.parametrize("outputs", [None, ["c.tau"]])
@pytest.mark.parametrize("times", [[0.0, 1.0, 2.0, 4.0], [0.0, 1.0, 4.0]])
def test_a_freewheel_that_prescribed_motions_force_backward_is_refused(method: str, outputs: Any, times: Any) -> None:
    """Between pi/2 and pi flange_a would overtake, whether or not a sample lies there."""
    system = gl.compile(Overrunning(w=gl.sin(2 * gl.time)), outputs=outputs)
    with pytest.raises(
        SolverError, match=r"event functions cannot be evaluated .*equations c: OneWayClutch: .* at t = 1\.5708 s"
    ):
        _ = system.simulate(4.0, times=times, method=method)["c.tau"]


@pytest.mark.parametrize("kind", [gp.Brake, gp.BearingFriction])
def test_the_torque_of_friction_is_an_output_where_no_state_depends_on_it(kind: type[gl.Component]) -> None:
    """Discrete variables that only an output needs are kept by the run."""

    class Held(gl.Component):
        def assemble(self) -> list[Any]:
            numbers = (
                {"fn_max": 2.0, "f_normalized": 1.0, "mu_pos": ((0.0, 0.5),)}
                if kind is gp.Brake
                else {"tau_pos": ((0.0, 1.0),)}
            )
            self.drive, self.b = gp.Speed(w_ref=gl.cos(gl.time), exact=True), kind(**numbers)
            return [gl.connect(self.drive.flange, self.b.flange_a)]

    result = gl.compile(Held(), outputs=["b.tau"]).simulate(3.0, samples=4)
    assert result["b.tau"] == pytest.approx(np.sign(np.cos(result.time)), abs=1e-9)


class OpeningInSeries(gl.Component):
    """A spring-damper in series with a clutch that opens, between two bodies; with or without inertia between the two."""

    clutch_first = gl.Structural(False)
    J = gl.Structural(0.0)

    def assemble(self) -> list[Any]:
        self.drive, self.a, self.b = gp.Torque(tau=5.0), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.coupling = gp.SpringDamper(c=1000.0, d=2.0)
        self.clutch = gp.Clutch(fn_max=500.0, f_normalized=gl.Piecewise((1.0, gl.time < 0.5), (0.0, True)))
        one, two = (self.clutch, self.coupling) if self.clutch_first else (self.coupling, self.clutch)
        ends = [(self.drive.flange, self.a.flange_a), (self.a.flange_b, one.flange_a), (two.flange_b, self.b.flange_a)]
        if self.J:
            self.between = gp.Inertia(J=self.J)
            ends += [(one.flange_b, self.between.flange_a), (self.between.flange_b, two.flange_a)]
        else:
            ends.append((one.flange_b, two.flange_a))
        return [gl.connect(*pair) for pair in ends]


@pytest.mark.parametrize("clutch_first", [False, True])
@pytest.mark.parametrize("method", ["ida", "rk"])
def test_friction_at_a_node_without_inertia_is_named(clutch_first: bool, method: str) -> None:
    """Locked, its speed is given and its torque found; open, the other way round: the states are not the same."""
    system = gl.compile(OpeningInSeries(clutch_first=clutch_first))
    with pytest.raises(SolverError, match=r"clutch: Clutch: tau = .* have no solution at t = 0\.5 s.*put an Inertia there"):
        system.simulate(1.0, samples=11, method=method)
    with_inertia = gl.compile(OpeningInSeries(clutch_first=clutch_first, J=1e-3))
    result = with_inertia.simulate(1.0, samples=3, method=method, rtol=1e-8)
    driven, alone = (1.0, 2.001) if clutch_first else (1.001, 2.0)  # once it is open
    momentum = (
        driven * result["a.w"] + alone * result["b.w"]
    )  # of the vibration against the small body nothing is left at the end
    assert momentum[-1] == pytest.approx(5.0, rel=1e-6)
    assert result["a.w"][-1] > result["b.w"][-1] + 1.0
    assert (result["clutch.contact"][0], result["clutch.contact"][-1]) == (1, 0)


class FrictionOnPositions(gl.Component):
    """``ModelicaTest.Rotational.TestFrictionPosition``: bearings whose angles are given, and one that a torque drives."""

    def assemble(self) -> list[Any]:
        def wave(amplitude: float, phase: float) -> Any:
            return 0.5 + amplitude * gl.sin(2 * gl.pi * gl.time + phase)

        def bearing() -> Any:
            return gp.BearingFriction(tau_pos=((0.0, 5.0), (100.0, 5.0)), peak=1.001)

        self.given, self.other = (
            gp.Position(exact=True, phi_ref=wave(0.1, math.pi / 4)),
            gp.Position(exact=True, phi_ref=wave(0.3, 3 * math.pi / 4)),
        )
        self.bearing, self.bearing_1, self.bearing_2 = bearing(), bearing(), bearing()
        self.torque, self.inertia = gp.Torque(tau=wave(25.0, math.pi / 4)), gp.Inertia(J=1.0, start={"w": -2.0})
        return [
            gl.connect(self.given.flange, self.bearing.flange_a),
            gl.connect(self.other.flange, self.bearing_2.flange_a),
            gl.connect(self.torque.flange, self.bearing_1.flange_a),
            gl.connect(self.bearing_1.flange_b, self.inertia.flange_a),
        ]


@cache
def by_hand_from_stop_to_stop(t_end: float) -> float:
    """Speed of the body that the torque drives, J = 1: exact between its stops."""

    def torque(t: float) -> float:
        return float(0.5 + 25 * np.sin(2 * np.pi * t + np.pi / 4))

    def impulse(t: float) -> float:
        return float(0.5 * t - 25 * np.cos(2 * np.pi * t + np.pi / 4) / (2 * np.pi))

    def crossing(f: Any, begin: float) -> float:
        times = np.linspace(begin, t_end, 20001)[1:]
        signs = np.sign([f(t) for t in times])
        changes = np.flatnonzero(signs[1:] != signs[:-1])
        return float(brentq(f, times[changes[0]], times[changes[0] + 1], xtol=1e-14)) if len(changes) else t_end

    t, w, sense = 0.0, -2.0, -1.0
    while True:

        def speed(later: float, t: float = t, w: float = w, sense: float = sense) -> float:
            return w + impulse(later) - impulse(t) - 5.0 * sense * (later - t)

        stop = crossing(speed, t)
        if stop == t_end:
            return speed(t_end)
        if abs(torque(stop)) < 5.005:  # it sticks until the torque breaks it away
            stop = crossing(lambda later: abs(torque(later)) - 5.005, stop)
        if stop == t_end:
            return 0.0
        t, w, sense = stop, 0.0, float(np.sign(torque(stop)))


@pytest.mark.parametrize("method", ["ida", "rk", "auto"])
def test_friction_on_given_positions(method: str) -> None:
    """Modelica's bearings lock where a given motion turns and have no solution from there on; physics has one: they go on sliding."""
    result = gl.compile(FrictionOnPositions()).simulate(2.0, samples=2001, method=method, rtol=1e-9)
    for name, amplitude, phase in (("bearing", 0.1, np.pi / 4), ("bearing_2", 0.3, 3 * np.pi / 4)):
        w = amplitude * 2 * np.pi * np.cos(2 * np.pi * result.time + phase)
        turning = np.abs(w) > 1e-6
        assert turning.sum() > 1990
        assert result[f"{name}.v"] == pytest.approx(w, abs=1e-12)
        assert result[f"{name}.tau"][turning] == pytest.approx(5.0 * np.sign(w[turning]), rel=1e-12)
    for k in (400, 1000, 2000):
        assert result["inertia.w"][k] == pytest.approx(by_hand_from_stop_to_stop(float(result.time[k])), abs=1e-6)


FREE, FORWARD, BACKWARD, STUCK = 2, 1, -1, 0
BRAKE: dict[str, float] = {"peak": 1.5, "tau0": 2.0, "cgeo": 0.5, "fn_max": 8.0, "f_normalized": 1.0, "w_small": 100.0}


@pytest.fixture(scope="module")
def brake() -> gl.Component:
    """With a sliding torque of 2 N.m at rest, which grows by 0.4 N.m in a rad/s, and breaks away at 3 N.m."""
    return gp.Brake(mu_pos=((0.0, 0.5), (10.0, 1.5)), fn_max=8.0)


@pytest.mark.parametrize(
    ("state", "v", "tau", "rate", "contact"),
    [
        ({"locked": 1}, 0.0, 7.0, 0.0, 1), ({"free": 1}, -4.0, 0.0, 7.0, 0), ({"pre_mode": FORWARD}, 5.0, 4.0, 7.0, 2),
        ({"start_forward": 1}, 0.0, 2.0, 7.0, 2), ({"pre_mode": BACKWARD}, -5.0, -4.0, 7.0, 2),
        ({"start_backward": 1}, -2.5, -3.0, 7.0, 2), ({"locked": 1, "pre_mode": FORWARD}, 0.0, 7.0, 0.0, 1),
    ],
)  # fmt: skip
def test_torque_and_acceleration_in_each_state(
    brake: gl.Component, state: Any, v: float, tau: float, rate: float, contact: int
) -> None:
    """The curve parameter, here 7, is the torque while locked, and else the acceleration."""
    values = {**BRAKE, **state, "sa": 7.0, "v": v}
    assert right_side(brake, "tau", **values) == pytest.approx(tau, rel=1e-14)
    assert right_side(brake, "contact", **values) == contact
    assert right_side(brake, "der(v)", **values) == pytest.approx(rate, abs=1e-20)
    assert right_side(brake, "loss_power", tau=3.0, v=-2.0) == -6.0


def test_level_and_release_of_a_brake(brake: gl.Component) -> None:
    for pressed, free in ((1.0, 0), (1e-9, 0), (0.0, 1), (-0.5, 1)):
        values = {**BRAKE, "f_normalized": pressed, "free": free}
        assert right_side(brake, "free", **values) == free
        assert right_side(brake, "tau0", **values) == pytest.approx(0.0 if free else 2.0 * pressed, rel=1e-14)


@pytest.mark.parametrize("sense", [1, -1])
def test_when_sliding_starts(brake: gl.Component, sense: int) -> None:
    """Beyond the break-away torque; once started, beyond the sliding torque; held by another element, without acceleration."""
    own, other = ("start_forward", "start_backward")[::sense]

    def starts(torque: float, **state: float) -> bool:
        return bool(right_side(brake, own, **BRAKE, sa=sense * torque, **state))

    stuck = {"was_stuck": 1.0}
    assert [starts(torque, **stuck) for torque in (2.9, 3.0, 3.0001)] == [False, False, True]
    for before in (0.0, 1.0):
        started = {own: 1.0, f"pre_{own}": before}
        assert [starts(rate, **stuck, **started) for rate in (-1e-6, 0.0, 1e-6)] == [False, True, True]
    assert [starts(torque, **stuck, **{f"pre_{own}": 1.0}) for torque in (1.9, 2.0)] == [False, True]
    assert not starts(5.0)
    assert not starts(-5.0, **stuck)
    assert not starts(5.0, **stuck, **{other: 1.0})
    thrown = [(turned, slid) for turned in (0, 1) for slid in (-1, 0, 1) if starts(0.0, turned=turned, slid=slid)]
    assert thrown == [(1, -sense)]
    for moving, begins in ((sense, True), (-sense, False), (0, False)):
        assert starts(0.0, initial=1.0, moving=moving) == begins
        assert starts(0.0, pre_mode=FREE, moving=moving) == begins, "pressed just now"
        assert not starts(0.0, pre_mode=FREE, moving=moving, free=1.0)
        assert not starts(0.0, pre_mode=STUCK, moving=moving)


def test_what_is_held_keeps_its_torque_until_others_let_go(brake: gl.Component, freewheel: gl.Component) -> None:
    for part, sense, own in ((brake, 1, "start_forward"), (brake, -1, "start_backward"), (freewheel, 1, "start_forward")):
        started = {own: 1.0, "was_stuck": 1.0}
        assert right_side(part, "kept", tau0=2.0, pre_locked=1.0, pre_kept=1.5) == 2.0
        kept = [
            right_side(part, "kept", tau0=2.0, pre_kept=1.5, pre_is_held=was, is_held=held) for was in (0, 1) for held in (0, 1)
        ]
        assert kept == [1.5, 1.5, BEYOND, 1.5], "no longer, once others have let go"
        held = [right_side(part, "is_held", tau0=tau0, kept=2.0, **started) for tau0 in (1.9, 2.0, 2.1)]
        assert held == [0, 0, 1], "only what is pressed harder"
        for state in ({own: 1.0}, {"was_stuck": 1.0}):
            assert not right_side(part, "is_held", tau0=2.1, kept=2.0, **state)
        for tau0 in (1.9, 2.1):
            values = {"is_held": 1.0, "tau0": tau0, "kept": 2.0, **started}
            rates = [right_side(part, "is_held", sa=sense * rate, **values) for rate in (-1.0, 0.0, 0.9e-7, 1.1e-7)]
            assert rates == [1, 1, 1, 0]
        speed = "w_rel" if part is freewheel else "v"
        for kept, taus in ((1.25, [2.0, 1.25]), (3.0, [2.0, 2.0])):
            values = {**BRAKE, **started, "kept": kept, speed: 0.0}
            assert [sense * right_side(part, "tau", is_held=held, **values) for held in (0, 1)] == taus


@pytest.mark.parametrize("free", [0, 1])
@pytest.mark.parametrize("was", [FREE, FORWARD, BACKWARD, STUCK])
@pytest.mark.parametrize("starts", ["", "start_forward", "start_backward"])
@pytest.mark.parametrize("moving", [-1, 0, 1])
def test_modes_after_an_event(brake: gl.Component, free: int, was: int, starts: str, moving: int) -> None:
    values = {"pre_mode": was, "free": free, "moving": moving} | ({starts: 1} if starts else {})
    forward, backward = was == FORWARD or starts == "start_forward", was == BACKWARD or starts == "start_backward"
    assert right_side(brake, "locked", **values) == (not free and not forward and not backward)
    slides = FORWARD if forward and moving == 1 else BACKWARD if backward and moving == -1 else STUCK
    assert right_side(brake, "mode", **values) == (FREE if free else slides)
    assert right_side(brake, "slid", **values) == (was if was in (FORWARD, BACKWARD) else 0)
    assert right_side(brake, "was_stuck", **values) == (was == STUCK)
    for v in (99.0, 101.0):
        assert [right_side(brake, "turned", **BRAKE, slid=slid, v=-v) for slid in (1, -1, 0)] == [v > 100.0, 0, 0]
        assert [right_side(brake, "turned", **BRAKE, slid=slid, v=v) for slid in (1, -1, 0)] == [0, v > 100.0, 0]


@pytest.mark.parametrize(("was", "speed", "sign"), [
    (0, 2e-11, 1), (0, 0.5e-11, 0), (0, 0.0, 0), (0, -0.5e-11, 0), (0, -2e-11, -1), (1, 1e-30, 1), (1, 0.0, 0), (1, -0.5e-11, 0),
    (1, -2e-11, -1), (-1, -1e-30, -1), (-1, 0.0, 0), (-1, 0.5e-11, 0), (-1, 2e-11, 1), (0, 300.0, 1), (1, -40.0, -1),
])  # fmt: skip
def test_a_sign_begins_beyond_rounding_and_lasts_until_the_speed_is_zero(
    brake: gl.Component, was: int, speed: float, sign: int
) -> None:
    for acceleration in (-2.0, 2.0, 1e-9):
        assert right_side(brake, "moving", v=speed, pre_moving=was, sa=acceleration) == sign
        for held in ({"pre_locked": 1.0}, {"free": 1.0}):
            assert right_side(brake, "moving", v=speed, pre_moving=was, sa=acceleration, **held) == 0


@pytest.mark.parametrize("was", [-1, 1])
def test_what_another_element_has_stopped_is_at_rest_whatever_rounding_leaves_of_its_speed(
    brake: gl.Component, freewheel: gl.Component, was: int
) -> None:
    for speed, acceleration, moves in ((1e-15, 0.0, False), (9e-13, 1e-25, False), (2e-12, 0.0, True), (1e-15, 1e-11, True)):
        for sense in (-1, 1):
            assert right_side(brake, "moving", v=was * speed, pre_moving=was, sa=sense * acceleration) == was * moves
            assert right_side(freewheel, "moving", w_rel=speed, pre_moving=1, sa=sense * acceleration) == moves


@pytest.fixture(scope="module")
def freewheel() -> gl.Component:
    return gp.OneWayClutch(mu_pos=((0.0, 0.5), (10.0, 1.5)), fn_max=8.0)


@pytest.mark.parametrize(
    ("state", "tau", "rate", "contact", "lost"),
    [
        ({"locked": 1, "stuck": 1}, -7.0, 0.0, 1, 0.0), ({"locked": 1, "forced": 1, "stuck": 1}, -7.0, 0.0, 1, 0.0),
        ({"free": 1}, 0.0, -7.0, 0, 0.0), ({}, 4.0, -7.0, 2, 20.0), ({"stuck": 1}, 4.0, -7.0, 2, 0.0),
    ],
)  # fmt: skip
def test_torque_and_acceleration_of_a_freewheel(
    freewheel: gl.Component, state: Any, tau: float, rate: float, contact: int, lost: float
) -> None:
    values = {**BRAKE, **state, "sa": -7.0, "w_rel": 5.0, "tau": tau}
    assert right_side(freewheel, "tau", **values) == tau
    assert right_side(freewheel, "der(w_rel)", **values) == pytest.approx(rate, abs=1e-20)
    assert right_side(freewheel, "contact", **values) == contact
    assert right_side(freewheel, "loss_power", **values) == lost


def test_when_a_freewheel_lets_go(freewheel: gl.Component) -> None:
    """Forward only: beyond its break-away torque, or after a reinit; it holds whatever drives it backward."""

    def starts(torque: float, **state: float) -> bool:
        return bool(right_side(freewheel, "start_forward", **{**BRAKE, "tau0_max": 3.0, "sa": torque, **state}))

    assert [starts(torque, was_stuck=1.0) for torque in (-1e6, 2.9, 3.0, 3.0001)] == [False, False, False, True]
    assert [starts(torque, was_stuck=1.0, pre_start_forward=1.0) for torque in (1.9, 2.0)] == [False, True]
    assert [starts(rate, was_stuck=1.0, start_forward=1.0) for rate in (-1e-6, 0.0, 1e-6)] == [False, True, True]
    assert not starts(5.0)
    assert [starts(0.0, pre_stuck=1.0, w_rel=w) for w in (99.0, 101.0)] == [False, True]
    assert not starts(0.0, w_rel=101.0)
    assert [starts(0.0, initial=1.0, moving=m) for m in (0.0, 1.0)] == [False, True]
    for pre_stuck, started in ((1.0, 0.0), (1.0, 1.0), (0.0, 0.0)):
        state = {"pre_stuck": pre_stuck, "start_forward": started}
        assert right_side(freewheel, "locked", **state) == (pre_stuck and not started)
    for moving, locked in ((0, 0), (0, 1), (1, 0), (1, 1)):
        assert right_side(freewheel, "stuck", moving=moving, locked=locked) == (locked or not moving)
    assert [right_side(freewheel, "moving", w_rel=w, pre_moving=m, pre_locked=held, sa=1.0) for w, m, held in (
        (2e-11, 0, 0), (0.5e-11, 0, 0), (1e-30, 1, 0), (0.0, 1, 0), (3.0, 0, 1), (-3.0, 1, 0)
    )] == [1, 0, 1, 0, 0, 0]  # fmt: skip
    assert [right_side(freewheel, "forced", locked=1, sa=sa) for sa in (-1e14, -1e16, 1e16)] == [0, 1, 0]
    peak = {**BRAKE, "f_normalized": 1.0}
    assert right_side(freewheel, "tau0_max", **peak) == pytest.approx(3.0, rel=1e-14)
    assert right_side(freewheel, "tau0_max", **{**peak, "peak": 1.0}) == pytest.approx(2.0, rel=1e-3)
    assert right_side(freewheel, "tau0_max", **{**peak, "peak": 1.0}) > 2.0, "no chatter at the sliding torque itself"
    assert 0.0 < right_side(freewheel, "tau0_max", **{**peak, "free": 1.0}) < 1e-3


def test_words_of_a_part_tell_the_state_of_its_contact() -> None:
    """0 open, 1 stuck, 2 sliding."""
    assert [words("brake")[state].partition(":")[0] for state in (0.0, 1.0, 2.0)] == ["open", "stuck", "sliding"]
    assert all(said.format("a.b").endswith(": brake a.b") for said in words("brake").values())


def test_a_curve_s_extreme_may_be_at_rest() -> None:
    """Rows that are alike in both directions have their least value at zero; those of two rows are the rows."""
    rows = ((-2.0, 3.0), (-1.0, 1.0), (1.0, 1.0), (2.0, 3.0))
    least = float(Akima1DInterpolator(*np.array(rows).T)(0.0))
    assert least < 0.9
    assert extremes(rows, 1, "akima") == pytest.approx((least, 3.0), rel=1e-14)
    assert extremes(((-3.0, 3.0), *rows[1:]), 1, "linear") == (1.0, 3.0)
    assert extremes(((0.0, 2.0), (1.0, 1.0)), 1, "akima") == (1.0, 2.0)


@pytest.mark.parametrize("on_flange", [False, True])
def test_the_angle_of_a_bearing_is_that_of_its_shaft_in_the_housing(on_flange: bool) -> None:
    class Mounted(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.shaft = gp.Torque(tau=3.0), gp.Inertia(J=1.0, start={"phi": 0.5})
            self.bearing = gp.BearingFriction(tau_pos=((0.0, 0.5), (1.0, 0.5)), use_support=on_flange)
            self.housing = gp.Inertia(J=2.0, start={"phi": 0.25})
            connected = [gl.connect(self.bearing.support, self.housing.flange_a)] if on_flange else []
            return [
                gl.connect(self.drive.flange, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.bearing.flange_a),
                *connected,
            ]

    result = gl.simulate(Mounted(), 0.5, samples=6, rtol=1e-9)
    t = result.time
    housing = 0.25 + 0.5 / 2.0 * t**2 / 2 if on_flange else 0.0  # the friction slides from the start
    assert result["bearing.phi"] == pytest.approx(0.5 + 2.5 * t**2 / 2 - housing, rel=1e-8)


class TwoBearings(gl.Component):
    """A shaft whose two bearings break away harder than they slide: which of them goes first is not determined."""

    drive = gl.Structural(())
    first = gl.Structural(0)

    def assemble(self) -> list[gl.Connection]:
        values = {"f1": (4.1, 1.3), "f2": (4.9, 1.0)} if self.first else {"f2": (4.9, 1.0), "f1": (4.1, 1.3)}
        self.torque = gp.Torque(tau=gl.Table(range(len(self.drive)), self.drive)(gl.time))
        self.body = gp.Inertia(J=1.0)
        for name, (level, peak) in values.items():
            setattr(self, name, BearingFriction(tau_pos=((0.0, level),), peak=peak))
        ends = [self.torque.flange, self.f2.flange_a, self.f1.flange_a, self.body.flange_a]
        return [gl.connect(*(ends if self.first else ends[::-1]))]


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "drive", [(0, 12.4, 1.7, -6.4, -6.9, 10.3), (0, 4.7, -9.4, -16.4, 9.0, -16.0), (0, -13.8, 16.6, 13.6, 7.3, 20.0)]
)
def test_friction_that_broke_away_and_is_held_by_other_friction_never_drives(drive: Any, method: str, first: int) -> None:
    r = gl.simulate(TwoBearings(drive=drive, first=first), 5.0, samples=501, method=method, rtol=1e-8)
    w, tau = r["body.w"], np.interp(r.time, np.arange(6), drive)
    moves = np.abs(w) > 1e-5
    assert 20 < moves.sum() < 480
    assert r["body.a"][moves] == pytest.approx((tau - 9.0 * np.sign(w))[moves], abs=1e-6)
    assert (np.abs(tau[~moves]) < 1.3 * 4.1 + 4.9 + 1e-2).all()


class Stages(gl.Component):
    """Rigid stages with two bearings each, made in an order of the seed; the torque grows, and turns."""

    limits, peaks, ratios = gl.Structural(()), gl.Structural(()), gl.Structural(())
    seed = gl.Structural(0)

    def assemble(self) -> list[gl.Connection]:
        n, rng = len(self.ratios) + 1, np.random.default_rng(self.seed)
        self.torque = gp.Torque(tau=gl.Table(range(4), TURNING)(gl.time))
        parts = {f"body{i}": (gp.Inertia, {"J": 1.0 / (1 + i)}) for i in range(n)}
        parts |= {f"gear{i}": (gp.IdealGear, {"ratio": ratio}) for i, ratio in enumerate(self.ratios)}
        for i, (limit, peak) in enumerate(zip(self.limits, self.peaks, strict=True)):
            parts[f"f{i}"] = (BearingFriction, {"tau_pos": ((0.0, limit),), "peak": peak})
        for name in rng.permutation(sorted(parts)) if self.seed else parts:
            setattr(self, name, parts[name][0](**parts[name][1]))
        sets = []
        for i in range(n):
            ends = [
                self.torque.flange if i == 0 else getattr(self, f"gear{i - 1}").flange_b,
                getattr(self, f"body{i}").flange_a,
            ]
            ends += [getattr(self, f"f{k}").flange_a for k in (2 * i, 2 * i + 1)]
            ends += [getattr(self, f"gear{i}").flange_a] if i < n - 1 else []
            sets.append(gl.connect(*[ends[k] for k in rng.permutation(len(ends))]))
        return sets


TURNING = (0.0, 40.0, -60.0, 0.0)


@pytest.mark.parametrize(
    ("limits", "peaks", "ratios"),
    [
        ((1.0, 5.0), (1.0, 1.0), ()),
        ((4.1, 4.9), (1.3, 1.0), ()),
        ((1.0, 3.0, 0.7, 2.0), (1.0, 1.5, 1.2, 1.0), (10 / 3,)),
        ((1.0, 2.0, 0.5, 0.7, 0.3, 1.1), (2.0, 1.0, 1.4, 1.0, 1.0, 1.2), (-0.7, 1.7)),
        ((0.4, 0.5, 0.5, 0.3, 0.3, 0.6, 0.2, 0.1, 0.3, 0.2), (1.4, 1.0) * 5, (-0.7, 1.7, 10 / 3, -1.5)),  # a sparse block
    ],
)
def test_stuck_elements_on_one_rigid_path_share_a_torque_in_any_order_of_declaration(
    limits: tuple[float, ...], peaks: tuple[float, ...], ratios: tuple[float, ...]
) -> None:
    """Each bears what the smallest squares give it; beyond its break-away torque it slides, and the others take the rest."""
    turns = np.repeat(1.0 / np.cumprod([1.0, *ratios]), 2)  # speed of each bearing for that of the first
    stuck, slid, moves = list(range(len(limits))), 0.0, 0.0
    all_stuck = min(limits[k] * peaks[k] * (turns**2).sum() / abs(turns[k]) for k in stuck)
    while stuck:  # the first whose limit is reached as the torque grows
        loads = [slid + limits[k] * peaks[k] * (turns[stuck] ** 2).sum() / abs(turns[k]) for k in stuck]
        moves = max(moves, min(loads))
        gone = stuck.pop(int(np.argmin(loads)))
        slid += limits[gone] * abs(turns[gone])
    times = np.linspace(0.0, 3.0, 121)
    runs = [
        gl.simulate(Stages(limits=limits, peaks=peaks, ratios=ratios, seed=seed), 3.0, times=times, method=method, rtol=1e-9)
        for seed, method in ((0, "rk"), (1, "ida"), (2, "rk"))
    ]
    w, taus = runs[0]["body0.w"], np.array([runs[0][f"f{k}.tau"] for k in range(len(limits))])
    torque = np.interp(times, range(4), TURNING)
    assert max(time for time, _ in runs[0].events if time < 1.0) == pytest.approx(
        moves / 40.0, abs=2e-6
    )  # and 1e-11 rad/s later
    early = (torque < all_stuck) & (times < 1.0)
    assert taus[:, early] == pytest.approx(np.outer(turns / (turns**2).sum(), torque[early]), rel=1e-7, abs=1e-9)
    for other in runs[1:]:
        assert other["body0.w"] == pytest.approx(w, abs=1e-6 * np.abs(w).max())
        assert np.array([other[f"f{k}.tau"] for k in range(len(limits))]) == pytest.approx(taus, abs=1e-6 * np.abs(taus).max())


class PressedAtRest(gl.Component):
    """A load on a body that a bearing holds; a brake, or a clutch or freewheel to a second body with a bearing, is pressed meanwhile."""

    kind = gl.Structural("brake", choices=("brake", "clutch", "freewheel"))
    first = gl.Structural(0)
    sense = gl.Structural(1.0)

    def assemble(self) -> list[gl.Connection]:
        t = gl.time
        load = gl.Piecewise((1.0, t < 3.0), (5.0 * t - 14.0, True))
        pressed = {"fn_max": 10.0, "mu_pos": ((0.0, 1.0),), "f_normalized": gl.Piecewise((0, t < 1), (t - 1, t < 2), (1, True))}
        parts = {
            "part": lambda: {"brake": Brake, "clutch": Clutch, "freewheel": OneWayClutchPart}[self.kind](**pressed),
            "bearing": lambda: BearingFriction(tau_pos=((0.0, 5.0),)),
            "other": lambda: BearingFriction(tau_pos=((0.0, 20.0),)),
        }
        for name in list(parts)[:: -1 if self.first else 1]:
            setattr(self, name, parts[name]())
        self.torque, self.body, self.far = gp.Torque(tau=self.sense * load), gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        behind = [] if self.kind == "brake" else [self.part.flange_a]
        return [
            gl.connect(self.torque.flange, self.body.flange_a, self.bearing.flange_a, self.part.flange_b),
            gl.connect(self.far.flange_a, self.other.flange_a, *behind),
        ]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize(
    ("kind", "sense"), [("brake", 1.0), ("brake", -1.0), ("clutch", 1.0), ("clutch", -1.0), ("freewheel", 1.0)]
)
def test_what_is_pressed_at_rest_takes_nothing_of_what_others_hold(kind: str, sense: float, first: int, method: str) -> None:
    """Pressing changes no torque. The load breaks all away at the sum of their limits, and the body moves as by hand."""
    r = gl.simulate(PressedAtRest(kind=kind, first=first, sense=sense), 6.5, samples=131, method=method, rtol=1e-9)
    early = r.time < 3.75
    load = np.where(r.time < 3.0, 1.0, 5.0 * r.time - 14.0)
    assert r["part.tau"][early] == pytest.approx(0.0, abs=1e-9)
    assert sense * r["bearing.tau"][early] == pytest.approx(load[early], rel=1e-9)
    assert np.abs(r["body.w"][load < 15.0 - 1e-6]).max() < 1e-6
    beyond = np.maximum(r.time - 5.8, 0.0)
    assert sense * r["body.w"] == pytest.approx(2.5 * beyond**2, abs=1e-6)
    held = sense * r["bearing.tau"] + np.abs(r["part.tau"])
    assert held[load < 15.0] == pytest.approx(load[load < 15.0], rel=1e-9)


class TwoClutches(gl.Component):
    """Clutches side by side and two bearings; torques and inertias are multiplied by ``large``, times by ``long``."""

    large, long = gl.Structural(1.0), gl.Structural(1.0)

    def assemble(self) -> list[gl.Connection]:
        unit = self.large / self.long**2
        self.a, self.b = gp.Inertia(J=self.large), gp.Inertia(J=0.7 * self.large)
        self.torque = gp.Torque(tau=7.0 * unit * gl.sin(3.0 * gl.time / self.long))
        self.c1 = Clutch(mu_pos=((0.0, 0.5),), fn_max=2.0 * unit, f_normalized=1.0)
        self.c2 = Clutch(mu_pos=((0.0, 0.3),), fn_max=3.0 * unit, f_normalized=1.0)
        self.f1, self.f2 = BearingFriction(tau_pos=((0.0, 1.1 * unit),)), BearingFriction(tau_pos=((0.0, 0.4 * unit),))
        return [
            gl.connect(self.torque.flange, self.a.flange_a, self.c1.flange_a, self.c2.flange_a),
            gl.connect(self.c1.flange_b, self.c2.flange_b, self.b.flange_a, self.f1.flange_a, self.f2.flange_a),
        ]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("large", "long"), [(1e-9, 1.0), (1e9, 1.0), (1.0, 1e-4), (1e-9, 1e-3), (1e6, 10.0)])
def test_friction_that_holds_other_friction_is_the_same_in_a_watch_and_in_a_mill(
    large: float, long: float, method: str
) -> None:
    one, other = (
        gl.simulate(TwoClutches(large=m, long=t), 5.0 * t, samples=11, method=method, rtol=1e-9)
        for m, t in ((1.0, 1.0), (large, long))
    )
    for name in ("a.w", "b.w"):
        assert other[name] * long == pytest.approx(one[name], abs=1e-6)
