"""Gears with losses: a reference trajectory, motions worked out by hand, efficiencies, self-locking, energy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.flatten import flatten
from gearparts.gears.lossy import LIMITS, Gearbox, LossyGear
from tests.gearparts import msl_hybrid_examples as msl
from tests.gearparts.laws import right_side
from tests.gearparts.rotational.test_friction import METHODS, check_against_reference, run
from tests.gearparts.test_msl_examples import agree


@pytest.mark.parametrize("method", METHODS)
def test_lossy_gear_demo_1(method: str) -> None:
    result = check_against_reference(msl.LossyGearDemo1(), "LossyGearDemo1", method)
    given = result["Inertia1.w"] * result["gear.flange_a.tau"] + result["Inertia2.w"] * result["gear.flange_b.tau"]
    assert result["gear.loss_power"] == pytest.approx(given, abs=1e-12)
    assert result["gear.loss_power"].min() > -1e-9


@dataclass(frozen=True)
class TwoBodies:
    """Two bodies, a lossy gear between them, and a bearing on the first: one speed, that of the first body."""

    J1: float
    J2: float
    ratio: float
    row: tuple[float, float, float, float]
    torque1: Callable[[float], float]
    torque2: Callable[[float], float]
    bearing: Callable[[float], float]  # sliding torque over speed

    def acceleration(self, t: float, speed: float, sense: int) -> float:
        """Turning in a sense, with the side that turns out to drive."""
        eta1, eta2, B1, B2 = self.row
        side_a = 0.0 if eta1 == 1 == eta2 else (B1 - B2) / (eta1 - 1 / eta2)
        found = []
        for a_drives in (True, False):
            # J1 w' = torque1 - bearing - T; J2 w' / ratio = torque2 + ratio (T - L); L = p T + r
            by_a = a_drives if sense > 0 else not a_drives
            p, r = (1 - eta1, sense * B1) if by_a else (1 - 1 / eta2, sense * B2)
            known = self.torque1(t) - sense * self.bearing(abs(speed))
            w_dot = (self.torque2(t) / self.ratio + (1 - p) * known - r) / (self.J2 / self.ratio**2 + (1 - p) * self.J1)
            if (known - self.J1 * w_dot - sense * side_a >= -1e-12) == a_drives or math.isclose(p, 0.0):
                found.append(w_dot)
        return found[0] if found else w_dot

    def integrate(self, w0: float, times: np.ndarray, stops: list[float]) -> tuple[np.ndarray, np.ndarray]:
        """Angle and speed of the first body."""
        out = np.zeros((2, len(times)))
        t, y, end = float(times[0]), np.array([0.0, w0]), float(times[-1])
        while t < end:
            sense = int(np.sign(y[1])) or next((s for s in (1, -1) if s * self.acceleration(t + 1e-9, 0.0, s) > 1e-12), 0)
            limit = min([s for s in stops if s > t] + [end])
            if sense == 0:
                t_new = self._release(t, limit)
                inside = (times >= t) & (times <= t_new)
                out[:, inside] = y[:, None]
            else:
                rest: Any = lambda at, x: sense * x[1] + (1e-9 if at - t < 1e-7 else 0.0)  # noqa: B023, E731
                rest.terminal, rest.direction = True, -1
                solution = solve_ivp(
                    lambda at, x: [x[1], self.acceleration(at, x[1], sense)],  # noqa: B023
                    (t, limit), y, "DOP853", dense_output=True, events=rest, rtol=1e-12, atol=1e-15, max_step=0.01,
                )  # fmt: skip
                t_new, y = float(solution.t[-1]), solution.y[:, -1].copy()
                inside = (times >= t) & (times <= t_new)
                if inside.any():
                    out[:, inside] = solution.sol(times[inside])
                if solution.status == 1:
                    y[1] = 0.0
            t = t_new
        return out[0], out[1]

    def _release(self, t: float, end: float) -> float:
        """When it starts to turn again."""
        grid = np.linspace(t, end, 2001)
        for before, after in zip(grid, grid[1:], strict=False):
            for s in (1, -1):
                if s * self.acceleration(after, 0.0, s) > 0:
                    return float(brentq(lambda at: s * self.acceleration(at, 0.0, s), before, after, xtol=1e-14))  # noqa: B023
        return end


def test_equations_by_hand_agree_with_the_reference_of_demo_1() -> None:
    from tests.gearparts.test_msl_examples import reference

    expected = reference("LossyGearDemo1")
    w = demo(lambda w: 0.0).integrate(0.0, expected["time"], [])[1]
    assert w / 2 == pytest.approx(expected["Inertia2.w"], abs=1e-8 * np.abs(expected["Inertia2.w"]).max())


def demo(bearing: Callable[[float], float]) -> TwoBodies:
    return TwoBodies(
        1.0, 1.5, 2.0, (0.5, 0.5, 0.0, 0.0), lambda t: 10 * math.sin(2 * math.pi * t), lambda t: -10 + 2.5 * t, bearing
    )


@cache
def demo_2() -> Any:
    """Times, angle and speed by hand."""
    times = np.linspace(0.0, 0.5, 201)
    return times, *demo(lambda w: 0.5 + 0.5 * w).integrate(0.0, times, [])


@pytest.mark.parametrize("method", METHODS)
def test_lossy_gear_demo_2(method: str) -> None:
    times, phi, w = demo_2()
    expected = {"Inertia1.w": w, "Inertia1.phi": phi, "Inertia2.w": w / 2, "Inertia2.phi": phi / 2}
    assert (np.abs(w) < 1e-12).sum() > 50  # stuck for long: two elements share the torque
    result = run(msl.LossyGearDemo2(), [*expected, "gear.mode", "bearingFriction.mode"], times, method)
    agree(result, expected, 1e-7)
    for name in ("gear.mode", "bearingFriction.mode"):  # stuck, they depend on how the torque is shared
        assert (result[name] == np.sign(w))[np.abs(w) > 1e-6].all()


@cache
def demo_3() -> Any:
    """Times, angle and speed by hand."""
    times = np.linspace(0.0, 1.0, 201)
    by_hand = TwoBodies(
        1e-3, 1e-3, 1.0, (0.25, 0.25, 0.625, 2.5), lambda t: 0.0, lambda t: 1.0 if t >= 0.5 else 0.0, lambda w: 0.0
    )
    return times, *by_hand.integrate(10.0, times, [0.5])


@pytest.mark.parametrize("method", METHODS)
def test_lossy_gear_demo_3(method: str) -> None:
    # at the border between both sides driving, T = 0.5 N.m: it comes to rest after 20 ms, and 1 N.m at the load does not move it
    times, phi, w = demo_3()
    assert w == pytest.approx(np.maximum(10 - 500 * times, 0.0), abs=1e-9)
    result = run(msl.LossyGearDemo3(), ["Inertia1.w", "Inertia2.w", "Inertia2.phi", "gear.mode"], times, method)
    agree(result, {"Inertia1.w": w, "Inertia2.w": w, "Inertia2.phi": phi}, 1e-8)
    assert (result["gear.mode"][5:] == 0).all()


class Swinging(gl.Component):
    """Swinging torques on two bodies, with a bearing and a lossy gear between them that lock at the same instant."""

    loss_table = gl.Structural(((0.0, 0.95, 0.92, 0.4, 0.5),))
    ratio = gl.Parameter("1", default=3.0)

    def assemble(self) -> Any:
        self.a, self.b = gp.Inertia(J=0.02), gp.Inertia(J=0.5)
        self.bearing = gp.BearingFriction(tau_pos=((0.0, 0.8), (100.0, 1.5)))
        self.gear = LossyGear(ratio=self.ratio, loss_table=self.loss_table)
        self.torque_a = gp.Torque(tau=1.8 * gl.sin(7 * gl.time) + 0.3)
        self.torque_b = gp.Torque(tau=gl.sin(5 * gl.time))
        return [
            gl.connect(self.torque_a.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.bearing.flange_a),
            gl.connect(self.bearing.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.b.flange_a),
            gl.connect(self.b.flange_b, self.torque_b.flange),
        ]


@pytest.mark.parametrize(
    ("ratio", "row"), [(3.0, (0.95, 0.92, 0.4, 0.5)), (2.0, (1.0, 1.0, 0.4, 0.4)), (-2.0, (0.95, 0.92, 0.0, 0.0))]
)
def test_a_bearing_and_a_gear_that_lock_together(ratio: float, row: tuple[float, float, float, float]) -> None:
    times = np.linspace(0.0, 3.0, 201)
    torques = lambda t: 1.8 * math.sin(7 * t) + 0.3, lambda t: math.sin(5 * t)
    w = TwoBodies(0.02, 0.5, ratio, row, *torques, lambda w: 0.8 + 0.007 * w).integrate(0.0, times, [])[1]
    assert (w == 0).sum() > 5
    assert w.min() < 0 < w.max()
    agree(run(Swinging(ratio=ratio, loss_table=((0.0, *row),)), ["a.w"], times, "rk"), {"a.w": w}, 1e-7)


class Driven(gl.Component):
    """A gear between a driving and a driven body, both under torque."""

    loss_table = gl.Structural(((0.0, 1.0, 1.0, 0.0, 0.0),))
    ratio = gl.Parameter("1", default=3.0)
    tau_a = gl.Parameter("N.m", default=2.0)
    tau_b = gl.Parameter("N.m", default=0.0)
    w0 = gl.Parameter("rad/s", default=30.0)

    def assemble(self) -> Any:
        self.a, self.b = gp.Inertia(J=0.1), gp.Inertia(J=0.5)
        self.gear = LossyGear(ratio=self.ratio, loss_table=self.loss_table, use_heat_port=True, start={"w_a": self.w0})
        self.torque_a, self.torque_b = gp.Torque(tau=self.tau_a), gp.Torque(tau=self.tau_b)
        self.metal = gp.HeatCapacitor(C=1.0, start={"T": 300.0})
        return [
            gl.connect(self.torque_a.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.b.flange_a),
            gl.connect(self.b.flange_b, self.torque_b.flange),
            gl.connect(self.gear.heat_port, self.metal.port),
        ]


ROW = (0.0, 0.9, 0.8, 0.3, 0.5)


@cache
def driven() -> gl.System:
    return gl.compile(Driven(loss_table=(ROW,)), outputs=["gear.w_a", "metal.T", "gear.flange_a.tau", "gear.tau_loss"])


@pytest.mark.parametrize(("tau_a", "tau_b"), [(8.0, -3.0), (-4.0, 9.0), (-8.0, 3.0), (4.0, -30.0)])
@pytest.mark.parametrize("w0", [30.0, -30.0])
@pytest.mark.parametrize("ratio", [3.0, -2.0])
def test_all_quadrants(tau_a: float, tau_b: float, w0: float, ratio: float) -> None:
    values = {"tau_a": tau_a, "tau_b": tau_b, "w0": w0, "ratio": ratio}
    times = np.linspace(0.0, 2.0, 101)
    result = driven().simulate(2.0, times=times, method="rk", rtol=1e-9, parameters=values)
    by_hand = TwoBodies(0.1, 0.5, ratio, ROW[1:], lambda t: tau_a, lambda t: tau_b, lambda w: 0.0)
    phi, w = by_hand.integrate(w0, times, [])
    agree(result, {"gear.w_a": w}, 1e-7)
    stored = (0.05 + 0.25 / ratio**2) * (w**2 - w0**2)
    assert result["metal.T"] - 300 == pytest.approx((tau_a + tau_b / ratio) * phi - stored, rel=1e-6, abs=1e-5)


@pytest.mark.parametrize("tau_a", [4.0, 0.3, -0.3, -4.0])
def test_it_starts_where_the_torque_exceeds_the_losses_of_that_direction(tau_a: float) -> None:
    """At rest, for either side driving: tau_b = ratio (loss - tau_a) with the loss of the direction in which it would turn."""
    eta1, eta2, B1, B2 = ROW[1:]
    side_a = (B1 - B2) / (eta1 - 1 / eta2)
    forward = (1 - eta1) * tau_a + B1 if tau_a >= side_a else (1 - 1 / eta2) * tau_a + B2
    backward = (1 - 1 / eta2) * tau_a - B2 if tau_a > -side_a else (1 - eta1) * tau_a - B1
    system = gl.compile(Driven(loss_table=(ROW,)), outputs=["gear.w_a"])
    for loss, beyond, sense in ((forward, 1e-3, 1), (forward, -1e-3, 0), (backward, 1e-3, 0), (backward, -1e-3, -1)):
        values = {"tau_a": tau_a, "tau_b": 3.0 * (loss - tau_a + beyond), "w0": 0.0}
        w = system.simulate(0.5, samples=2, parameters=values)["gear.w_a"][-1]
        assert np.sign(np.round(w, 7)) == sense, (loss, beyond)


def test_a_table_of_losses_is_interpolated() -> None:
    # no mesh losses, bearing torque 1 + w / 10 up to w = 20 and beyond: (0.1 + 0.5 / 9) w' = 2 - 1 - w / 10
    rows = ((0.0, 1.0, 1.0, 1.0, 1.0), (10.0, 1.0, 1.0, 2.0, 2.0), (20.0, 1.0, 1.0, 3.0, 3.0))
    times = np.linspace(0.0, 3.0, 61)
    result = run(Driven(loss_table=rows), ["gear.w_a"], times, "rk")
    agree(result, {"gear.w_a": 10 + 20 * np.exp(-0.1 * times / (0.1 + 0.5 / 9))}, 1e-8)


def test_without_losses_it_is_an_ideal_gear() -> None:
    times = np.linspace(0.0, 1.0, 11)
    result = run(Driven(), ["gear.w_a", "gear.mode", "gear.loss_power"], times, "auto")
    agree(result, {"gear.w_a": 30 + 2 * times / (0.1 + 0.5 / 9)}, 1e-9)
    assert (result["gear.mode"] == 2).all()
    assert (result["gear.loss_power"] == 0).all()


class Geared(gl.Component):
    """A gearbox on a housing that is held, between two bodies."""

    kind = gl.Structural(Gearbox)
    options = gl.Structural(())

    def assemble(self) -> Any:
        self.motor, self.load = gp.Inertia(J=0.1, start={"w": 0.0}), gp.Inertia(J=2.0, start={"w": 0.0})
        self.gearbox = Gearbox(
            ratio=5.0, c=1e4, d=20.0, use_support=True, use_heat_port=True, start={"phi_rel": 0.0}, **dict(self.options)
        )
        self.torque = gp.Torque(tau=3.0)
        self.ground, self.metal = gp.Fixed(), gp.HeatCapacitor(C=1.0, start={"T": 0.0})
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.gearbox.flange_a),
            gl.connect(self.gearbox.flange_b, self.load.flange_a),
            gl.connect(self.gearbox.support, self.ground.flange),
            gl.connect(self.gearbox.heat_port, self.metal.port),
        ]


@pytest.mark.parametrize("b", [0.0, 0.02])
def test_a_gearbox_is_a_lossy_gear_and_a_coupling_with_backlash(b: float) -> None:
    options = (("loss_table", ((0.0, 0.8, 0.7, 0.2, 0.3),)), ("b", b))
    outputs = [
        "motor.w", "motor.phi", "load.w", "load.phi", "gearbox.phi_rel", "gearbox.w_rel", "metal.T", "gearbox.loss_power",
        "gearbox.support.tau", "gearbox.flange_a.tau", "gearbox.flange_b.tau", "gearbox.elastoBacklash.tau_c",
    ]  # fmt: skip
    times = np.linspace(0.0, 0.5, 101)
    r = run(Geared(options=options), outputs, times, "rk")

    def rate(t: float, x: np.ndarray) -> list[float]:
        deflection, w_rel = x[3] - x[1] / 5, x[2] - x[0] / 5
        beyond = math.copysign(max(abs(deflection) - b / 2, 0.0), deflection)
        spring, damper = 1e4 * beyond, 20.0 * w_rel
        if b == 0:
            tau = spring + damper
        elif spring > 0:
            tau = max(0.0, spring + min(spring, damper))
        else:
            tau = min(0.0, spring + max(spring, damper))
        out = -tau  # torque that the gear delivers: ratio (T - L); forward it is 5 (eta1 T - B1) or 5 (T / eta2 - B2)
        T = (out / 5 + 0.2) / 0.8
        side_a = (0.2 - 0.3) / (0.8 - 1 / 0.7)
        if side_a > T:
            T = (out / 5 + 0.3) * 0.7
        return [(3.0 - T) / 0.1, x[0], out / 2.0, x[2]]

    x = solve_ivp(rate, (0, 0.5), np.zeros(4), "DOP853", times, rtol=1e-10, atol=1e-13, max_step=1e-3).y
    expected = {"motor.w": x[0], "motor.phi": x[1], "load.w": x[2], "load.phi": x[3]}
    expected["gearbox.phi_rel"] = x[3] - x[1] / 5
    agree(r, expected, 1e-6)
    stored = 0.05 * r["motor.w"] ** 2 + r["load.w"] ** 2 + r["gearbox.elastoBacklash.tau_c"] ** 2 / 2e4
    assert stored + r["metal.T"] == pytest.approx(3.0 * r["motor.phi"], rel=1e-6, abs=1e-7)
    assert r["gearbox.support.tau"] == pytest.approx(-r["gearbox.flange_a.tau"] - r["gearbox.flange_b.tau"], abs=1e-9)


def test_a_wrong_table_is_named() -> None:
    with pytest.raises(BindingError, match=r"LossyGear\.loss_table .* rows of 5 numbers"):
        gl.compile(Driven(loss_table=((0.0, 0.5),)))


@pytest.mark.parametrize("column", [1, 2, 3, 4])
def test_losses_that_would_drive_are_named(column: int) -> None:
    """Efficiencies from 0 to 1, where flange_b could not drive with none; bearing torques of 0 or more."""
    valid = {1: (0.0, 1.0), 2: (1e-9, 1.0), 3: (0.0, 50.0), 4: (0.0, 50.0)}[column]
    wrong = {1: (-1e-9, 1 + 1e-9), 2: (0.0, 1 + 1e-9), 3: (-1e-9,), 4: (-1e-9,)}[column]
    for value in (*valid, *wrong):
        row = [0.0, 0.9, 0.9, 0.1, 0.1]
        row[column] = value
        model = Driven(loss_table=((-1.0, 0.9, 0.9, 0.1, 0.1), tuple(row)))
        if value in valid:
            flatten(model)
        else:
            with pytest.raises(BindingError, match=rf"loss_table has the row .*{value}.* eta2 above 0"):
                flatten(model)


@pytest.mark.parametrize("column", [1, 2, 3, 4])
def test_a_table_whose_losses_would_drive_at_rest_is_named(column: int) -> None:
    """Extrapolated to rest from its first two rows; one that just reaches a limit there is valid."""
    at_rest = {1: (1.0, 1.1, -0.1, 0.0), 2: (1.0, 1.1, -0.1), 3: (0.0, -0.1), 4: (0.0, -0.1)}[column]
    for value in at_rest:
        first, second = [10.0, 0.7, 0.7, 0.7, 0.7], [20.0, 0.7, 0.7, 0.7, 0.7]
        first[column], second[column] = value + 0.35 * (0.5 - value), value + 0.7 * (0.5 - value)
        model = Driven(loss_table=(tuple(first), tuple(second)))
        if 0.0 <= value <= 1.0:
            flatten(model)
        else:
            said = r"loss_table extrapolated to the speed 0 has the row \[.*\]; expected a row for it in the table"
            with pytest.raises(BindingError, match=said):
                flatten(model)


@pytest.mark.parametrize(("column", "name"), [(1, "eta1"), (2, "eta2"), (3, "B1"), (4, "B2")])
def test_losses_whose_curve_would_drive_between_rows_are_named(column: int, name: str) -> None:
    rows = [[speed, 0.8, 0.8, 0.5, 0.5] for speed in (0.0, 1.0, 2.0, 3.0)]
    for row, value in zip(rows, (0.5, 1.0, 1.0, 0.5) if column < 3 else (0.5, 0.0, 0.0, 0.5), strict=True):
        row[column] = value
    table = tuple(map(tuple, rows))
    with pytest.raises(
        BindingError, match=rf"LossyGear\.loss_table: the akima curve of {name} goes from .* smoothness='linear'"
    ):
        flatten(LossyGear(ratio=2.0, loss_table=table, smoothness="akima"))
    flatten(LossyGear(ratio=2.0, loss_table=table))


@pytest.mark.parametrize("sense", [1, -1])
def test_losses_far_beyond_their_table_do_not_drive(sense: int) -> None:
    """Each column is extrapolated to a limit: falling from half its value at rest, or growing by half."""
    torque, first = 3.0, (0.8, 0.6, 0.5, 0.4)
    for factor, limits in ((0.5, (0.0, 1e-9, 0.0, 0.0)), (1.25, (1.0, 1.0, 250.75, 200.6))):
        for column, limit in enumerate(limits):
            second, far = list(first), list(first)
            second[column], far[column] = factor * first[column], limit
            gear = LossyGear(ratio=2.0, loss_table=((0.0, *first), (2.0, *second)))
            by_one, by_other = (1 - far[0]) * torque + sense * far[2], (1 - 1 / far[1]) * torque + sense * far[3]
            for drives in (1.0, -1.0):
                values = {
                    "drives": float(drives > 0.0),
                    "flange_a__tau": torque,
                    "w_a": 4004.0 * sense,
                    "pre_mode": float(sense),
                }
                assert right_side(gear, "tau_loss", **values) == pytest.approx(by_one if drives * sense > 0 else by_other)


ETA_1, ETA_2, B_1, B_2 = 0.9, 0.8, 0.5, 0.3
AT_A = (B_1 - B_2) / (ETA_1 - 1 / ETA_2)  # the bearings' torque on the side of flange_a: here negative


@pytest.fixture(scope="module")
def lossy() -> gl.Component:
    """Its losses grow to twice the sliding torques at 10 rad/s."""
    return LossyGear(ratio=2.0, loss_table=((0.0, ETA_1, ETA_2, B_1, B_2), (10.0, ETA_1, ETA_2, 2 * B_1, 2 * B_2)))


def by_a(torque: float, sense: int, size: float = 1.0) -> float:
    return (1 - ETA_1) * torque + sense * B_1 * size


def by_b(torque: float, sense: int, size: float = 1.0) -> float:
    return (1 - 1 / ETA_2) * torque + sense * B_2 * size


@pytest.mark.parametrize("w", [0.0, 5.0])
def test_losses_in_each_state_are_those_of_the_docstring(lossy: gl.Component, w: float) -> None:
    """The curve parameter, here 7, is the loss while locked, and else the acceleration."""
    size = 1 + w / 10
    for torque in (4.0, -3.0):
        values = {"flange_a__tau": torque, "sa": 7.0}
        for ahead in ({"start_forward": 1}, {"pre_mode": 1}):
            assert right_side(lossy, "tau_eta", w_a=w, **values, **ahead) == pytest.approx(torque - AT_A * size)
            for drives, loss in ((1, by_a(torque, 1, size)), (0, by_b(torque, 1, size))):
                assert right_side(lossy, "tau_loss", w_a=w, drives=drives, **values, **ahead) == pytest.approx(loss)
        assert right_side(lossy, "tau_eta", w_a=-w, **values) == pytest.approx(torque + AT_A * size)
        for drives, loss in ((1, by_b(torque, -1, size)), (0, by_a(torque, -1, size))):
            assert right_side(lossy, "tau_loss", w_a=-w, drives=drives, **values) == pytest.approx(loss)
        assert right_side(lossy, "tau_eta", w_a=w, locked=1, **values) == torque
        assert right_side(lossy, "tau_loss", w_a=w, locked=1, **values) == 7.0
    assert right_side(lossy, "der(w_a)", sa=7.0, tau_loss=3.0) == 7.0
    assert right_side(lossy, "der(w_a)", sa=7.0, tau_loss=3.0, locked=1) == pytest.approx(0.0, abs=1e-20)
    assert right_side(lossy, "loss_power", tau_loss=3.0, w_a=-2.0) == -6.0


@pytest.mark.parametrize("torque", [4.0, 0.1, -0.1, -4.0, AT_A, -AT_A])
def test_losses_at_which_a_gear_starts_are_those_of_either_direction(lossy: gl.Component, torque: float) -> None:
    forward = by_a(torque, 1) if torque > AT_A else by_b(torque, 1)
    backward = by_b(torque, -1) if torque > -AT_A else by_a(torque, -1)
    for w in (0.0, 5.0):  # those at rest
        assert right_side(lossy, "loss_forward", flange_a__tau=torque, w_a=w) == pytest.approx(forward)
        assert right_side(lossy, "loss_backward", flange_a__tau=torque, w_a=w) == pytest.approx(backward)


def test_bearings_of_a_gear_without_mesh_losses_share_the_friction_b1() -> None:
    even = LossyGear(ratio=2.0, loss_table=((0.0, 1.0, 1.0, 0.6, 0.2),))
    assert right_side(even, "tau_eta", flange_a__tau=1.0, pre_mode=1) == pytest.approx(0.7)
    assert right_side(even, "tau_eta", flange_a__tau=1.0) == pytest.approx(1.3)


@pytest.mark.parametrize("smoothness", ["linear", "constant"])
@pytest.mark.parametrize("seed", range(8))
def test_the_driving_side_by_tables_at_random(seed: int, smoothness: str) -> None:
    """At any speed, of tables of which some rows have no mesh losses: tau_eta is what the docstring says, of the table's values."""
    random = np.random.default_rng(seed)
    speeds = np.array([0.0, *np.sort(random.uniform(1.0, 100.0, random.integers(0, 4)))])
    columns = np.vstack([random.uniform(0.3, 1.0, (2, len(speeds))), random.uniform(0.0, 2.0, (2, len(speeds)))])
    columns[:2, random.random(len(speeds)) < 0.5] = 1.0
    gear = LossyGear(ratio=2.0, loss_table=np.vstack([speeds, columns]).T.tolist(), smoothness=smoothness)

    def at(w: float, column: Any, low: float, high: float) -> float:
        k = max(min(int(np.searchsorted(speeds, w, side="right")) - 1, len(speeds) - (1 if smoothness == "constant" else 2)), 0)
        if smoothness == "constant" or len(speeds) == 1:
            return float(column[k])
        share = (w - speeds[k]) / (speeds[k + 1] - speeds[k])
        return float(np.clip(column[k] + share * (column[k + 1] - column[k]), low, high))

    for w in random.uniform(0.0, 200.0, 12):
        eta1, eta2, B1, B2 = (at(w, c, *limits) for c, limits in zip(columns, LIMITS.values(), strict=True))
        side_a = B1 / 2 if eta1 == eta2 == 1 else (B1 - B2) / (eta1 - 1 / eta2)
        for sense, ahead in ((1, {"pre_mode": 1}), (-1, {})):
            found = right_side(gear, "tau_eta", flange_a__tau=1.0, w_a=sense * w, **ahead)
            assert found == pytest.approx(1.0 - sense * side_a, rel=1e-6), w


def test_losses_of_several_rows_are_written_in_modelica() -> None:
    rows = ((0.0, 0.9, 0.8, 0.1, 0.2), (10.0, 1.0, 1.0, 0.2, 0.3), (20.0, 1.0, 1.0, 0.2, 0.3))
    ours = gl.simulate(Driven(loss_table=rows), 2.0, samples=21)["gear.w_a"]
    for options, name in (({"standard_library": False}, "gear.w_a"), ({"flat": True}, "gear_w_a")):
        read = gl.read_modelica(gl.to_modelica(Driven(loss_table=rows), **options))
        assert gl.simulate(read(), 2.0, samples=21)[name] == pytest.approx(ours, rel=1e-5)


ALSO_AT_REST = ((0.0, 1.0, 1.0, 0.6, 0.2), (10.0, 1.0, 1.0, 0.6, 0.2), (20.0, 0.9, 0.9, 0.6, 0.2))
FROM_10_ON = ((0.0, 0.5, 0.5, 0.6, 0.2), (10.0, 1.0, 1.0, 0.6, 0.2), (20.0, 1.0, 1.0, 0.6, 0.2))
FAR_BEYOND = ((0.0, 0.5, 0.5, 0.6, 0.2), (10.0, 0.9, 0.9, 0.6, 0.2))


@pytest.mark.parametrize(("rows", "w"), [(ALSO_AT_REST, 5.0), (FROM_10_ON, 15.0), (FAR_BEYOND, 50.0)])
def test_bearings_share_the_friction_b1_at_speeds_without_mesh_losses(rows: Any, w: float) -> None:
    """There (B1 - B2) / (eta1 - 1 / eta2) is infinite, and one flange would count as driving, whatever its torque."""
    gear = LossyGear(ratio=2.0, loss_table=rows)
    assert right_side(gear, "tau_eta", flange_a__tau=1.0, w_a=w, pre_mode=1) == pytest.approx(0.7)
    assert right_side(gear, "tau_eta", flange_a__tau=1.0, w_a=-w) == pytest.approx(1.3)
    system = gl.compile(Driven(loss_table=rows), outputs=["gear.tau_loss"])
    for tau_a, loss in ((-20.0, 0.2), (20.0, 0.6)):
        values = {"tau_a": tau_a, "tau_b": -3.0 * tau_a, "w0": w}
        assert system.simulate(1e-6, samples=2, parameters=values)["gear.tau_loss"][0] == pytest.approx(loss)


@pytest.mark.parametrize(
    ("torque", "forward", "backward"), [(0.4, 0.6, -0.2), (0.2, 0.2, -0.2), (-0.2, 0.2, -0.2), (-0.4, 0.2, -0.6)]
)
def test_a_gear_without_mesh_losses_at_rest_starts_by_the_friction_of_the_driving_flange(
    torque: float, forward: float, backward: float
) -> None:
    gear = LossyGear(ratio=2.0, loss_table=ALSO_AT_REST)
    assert right_side(gear, "loss_forward", flange_a__tau=torque) == pytest.approx(forward)
    assert right_side(gear, "loss_backward", flange_a__tau=torque) == pytest.approx(backward)


@pytest.mark.parametrize("sense", [1, -1])
def test_when_a_gear_starts(lossy: gl.Component, sense: int) -> None:
    own, other = ("start_forward", "start_backward")[::sense]
    limit = "loss_forward" if sense == 1 else "loss_backward"

    def starts(loss: float, **state: float) -> bool:
        return bool(right_side(lossy, own, sa=sense * loss, **{limit: sense * 2.0}, **state))

    stuck = {"was_stuck": 1.0}
    assert [starts(loss, **stuck) for loss in (-9.0, 1.9, 2.0, 2.0001)] == [False, False, False, True]
    assert [starts(loss, **stuck, **{f"pre_{own}": 1.0}) for loss in (1.9, 2.0)] == [False, True]
    # Held by another element it has no acceleration, and keeps starting
    assert [starts(rate, **stuck, **{own: 1.0}) for rate in (-1e-6, 0.0, 1e-6)] == [False, True, True]
    assert not starts(5.0)
    assert not starts(5.0, **stuck, **{other: 1.0})
    assert [starts(0.0, initial=1.0, moving=m) for m in (sense, -sense, 0)] == [True, False, False]
    assert not starts(0.0, moving=sense)


@pytest.mark.parametrize("was", [1, -1, 0, 2])
@pytest.mark.parametrize("starts", ["", "start_forward", "start_backward"])
@pytest.mark.parametrize("moving", [-1, 0, 1])
def test_modes_of_a_gear_after_an_event(lossy: gl.Component, was: int, starts: str, moving: int) -> None:
    values = {"pre_mode": was, "moving": moving} | ({starts: 1} if starts else {})
    ahead, back = was == 1 or starts == "start_forward", was == -1 or starts == "start_backward"
    assert right_side(lossy, "locked", **values) == (not ahead and not back)
    assert right_side(lossy, "mode", **values) == (1 if ahead and moving == 1 else -1 if back and moving == -1 else 0)
    assert right_side(lossy, "was_stuck", **values) == (was == 0)
    for speed in (-1.0, 1e-12, 1.0):
        moves = 0 if speed == 1e-12 else speed
        assert [right_side(lossy, "moving", w_a=speed, pre_locked=held) for held in (0, 1)] == [moves, 0]


@pytest.mark.parametrize("starts", ["start_forward", "start_backward"])
def test_the_side_that_drives_is_that_of_the_torque_unless_others_hold_a_gear_that_starts(
    lossy: gl.Component, starts: str
) -> None:
    for torque, side in ((1e-9, 1), (0.0, 1), (-1e-9, 0)):
        for before in (0, 1):
            values = {"tau_driving": torque, "pre_drives": before}
            for was in (1, -1, 2):
                assert right_side(lossy, "drives", **values, **{starts: 1.0}, pre_mode=was) == side
            assert right_side(lossy, "drives", **values) == side
            assert right_side(lossy, "drives", **values, **{starts: 1.0}, pre_mode=0) == before


def test_rounding_keeps_the_side_that_drives_but_at_rest_and_without_mesh_losses() -> None:
    gear = LossyGear(ratio=2.0, loss_table=((0.0, 0.9, 0.8, 0.1, 0.2), (10.0, 1.0, 1.0, 0.1, 0.2), (20.0, 1.0, 1.0, 0.1, 0.2)))
    for tau_eta, tau_out, told in ((3.0, 2.0, True), (-3.0, -2.0, True), (1e-17, 0.0, False), (1e-17, -1e-17, False)):
        for drives, kept in ((0, -0.5), (1, 0.5)):
            values = {"tau_eta": tau_eta, "tau_out": tau_out, "drives": drives}
            for w, locked in ((-5.0, 0), (5.0, 0), (15.0, 0), (-15.0, 0), (0.0, 1)):
                expected = tau_eta if told or locked or abs(w) > 10 else kept
                assert right_side(gear, "tau_driving", **values, w_a=w, locked=locked) == expected
    never = LossyGear(ratio=2.0, loss_table=((0.0, 0.0, 0.8, 0.1, 0.2),))
    assert right_side(never, "tau_driving", tau_eta=1e-17, w_a=5.0) == 1e-17


@pytest.mark.parametrize("sense", [1, -1])
def test_torques_at_both_flanges_tell_one_side(lossy: gl.Component, sense: int) -> None:
    """Forward ``out = eta1 (T - B_a)`` with flange_a driving, ``(T - B_a) / eta2`` otherwise; backward the other way round."""
    ahead = {"pre_mode": 1} if sense > 0 else {}
    for torque in (4.0, 0.1, -0.1, -3.0):
        told = right_side(lossy, "tau_eta", flange_a__tau=torque, w_a=sense * 1e-9, **ahead)
        by_flange_a = (told > 0) == (sense > 0)
        loss = by_a(torque, sense) if by_flange_a else by_b(torque, sense)
        values = {"flange_b__tau": -2.0 * (torque - loss), "ratio": 2.0, "w_a": sense * 1e-9}
        assert right_side(lossy, "tau_out", **values, **ahead) == pytest.approx(told * (ETA_1 if by_flange_a else 1 / ETA_2))


class Reversing(gl.Component):
    """A gearbox with a bearing on its first shaft that a torque drives to and fro, through its gap, and a body behind it."""

    bearing = gl.Structural(0.0)

    def assemble(self) -> Any:
        table = ((0.0, 0.9, 0.8, 0.9 * self.bearing, self.bearing / 0.8),)
        self.torque, self.motor = gp.Torque(tau=10 * gl.sin(7 * gl.time + 3 / 11)), gp.Inertia(J=0.5, start={"w": 14.5})
        self.box = Gearbox(ratio=-2.9, c=400.0, d=1.6, b=0.0145, loss_table=table, start={"phi_rel": 0.0})
        self.load = gp.Inertia(J=1.4, start={"w": -5.0})
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.box.flange_a),
            gl.connect(self.box.flange_b, self.load.flange_a),
        ]


@pytest.mark.parametrize("bearing", [0.0, 0.3])
@pytest.mark.parametrize("method", ["rk5", "rk8", "ida"])
def test_a_gearbox_goes_through_its_gap_while_nothing_loads_its_mesh(bearing: float, method: str) -> None:
    times = np.linspace(0.0, 1.2, 61)
    r = gl.compile(Reversing(bearing=bearing), outputs=["motor.w", "load.w", "box.phi_rel"]).simulate(
        1.2, times=times, method=method, rtol=1e-8
    )

    def rate(t: float, x: np.ndarray) -> list[float]:
        w_rel = x[1] + x[0] / 2.9
        spring = 400.0 * math.copysign(max(abs(x[2]) - 0.0145 / 2, 0.0), x[2])
        tau = max(0.0, spring + min(spring, 1.6 * w_rel)) if spring > 0 else min(0.0, spring + max(spring, 1.6 * w_rel))
        lossless = tau / 2.9  # torque at the motor
        loaded = lossless / 0.9 if lossless * x[0] > 0 else lossless * 0.8
        return [(10 * math.sin(7 * t + 3 / 11) - bearing - loaded) / 0.5, -tau / 1.4, w_rel]

    x = solve_ivp(rate, (0, 1.2), [14.5, -5.0, 0.0], "DOP853", times, rtol=1e-9, atol=1e-12, max_step=1e-3).y
    assert r["box.phi_rel"].min() < -0.0145 / 2
    assert r["box.phi_rel"].max() > 0.0145 / 2
    agree(r, {"motor.w": x[0], "load.w": x[1], "box.phi_rel": x[2]}, 2e-5)


def test_a_gear_without_losses_has_no_modes() -> None:
    ideal = LossyGear(ratio=2.0)
    for name in (
        "tau_loss",
        "loss_forward",
        "loss_backward",
        "moving",
        "was_stuck",
        "start_forward",
        "start_backward",
        "locked",
    ):
        assert right_side(ideal, name, sa=3.0, w_a=4.0, flange_a__tau=5.0) == 0
    assert right_side(ideal, "mode") == 2
    assert right_side(ideal, "drives") == 1
    assert right_side(ideal, "tau_eta", flange_a__tau=5.0) == 5.0
