"""Friction elements that stop in one instant, against time stepping written by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import gearlib as gl
import gearparts as gp

Floats = NDArray[np.float64]
SPEEDS = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, 1.0]])  # of the bearings' and the clutch's surfaces, from those of the bodies
REST = 1e-9


class Coupled(gl.Component):
    """Two bodies on bearings with a clutch between them; a torque drives the first to and fro."""

    tau = gl.Structural(8.0)
    pulsation = gl.Structural(5.0)
    J = gl.Structural((1.0, 1.0))
    limits = gl.Structural((1.0, 1.0, 1.0))
    peaks = gl.Structural((1.0, 1.0, 1.0))
    pressing = gl.Structural(0.0, "pulsation at which the clutch is pressed and released")

    def assemble(self) -> list[gl.Connection]:
        self.torque = gp.Torque(tau=self.tau * gl.sin(self.pulsation * gl.time))
        self.body = [gp.Inertia(J=J) for J in self.J]
        pressed = 0.5 - 0.6 * gl.cos(self.pressing * gl.time) if self.pressing else 1.0
        self.clutch = gp.Clutch(fn_max=1.0, f_normalized=pressed, mu_pos=((0.0, self.limits[1]),), peak=self.peaks[1])
        self.bearing = [gp.BearingFriction(tau_pos=((0.0, self.limits[k]),), peak=self.peaks[k]) for k in (0, 2)]
        return [
            gl.connect(self.torque.flange, self.body[0].flange_a),
            gl.connect(self.body[0].flange_b, self.clutch.flange_a, self.bearing[0].flange_a),
            gl.connect(self.clutch.flange_b, self.body[1].flange_a),
            gl.connect(self.body[1].flange_b, self.bearing[1].flange_a),
        ]


def by_hand(
    tau: float, pulsation: float, J: tuple[float, float], limits: Any, peaks: Any, t_end: float, dt: float, pressing: float = 0.0
) -> Floats:  # fmt: skip
    """Speeds of the bodies at the ends of equal steps, shape (steps + 1, 2).

    The direction of each element is 0 while it is stuck. Stuck ones share a torque so that the sum of its squares is least; one whose
    share is beyond its limit slides, or stays at its sliding torque where others hold it.
    """
    inertia = np.array(J)
    speed, direction, found = np.zeros(2), np.zeros(3), []

    def limit(t: float) -> Floats:
        pressed = max(0.0, 0.5 - 0.6 * np.cos(pressing * t)) if pressing else 1.0
        return np.array(limits) * [1.0, pressed, 1.0]

    def solved(t: float) -> tuple[Floats, Floats]:
        """Accelerations and torques."""
        torques, stuck = limit(t) * direction, SPEEDS[direction == 0]
        free = (np.array([tau * np.sin(pulsation * t), 0.0]) - SPEEDS.T @ torques) / inertia
        if len(stuck):
            torques[direction == 0] = np.linalg.lstsq((stuck / inertia) @ stuck.T, stuck @ free, rcond=1e-10)[0]
        return free - (SPEEDS.T @ np.where(direction == 0, torques, 0.0)) / inertia, torques

    def overloaded(t: float, torques: Floats) -> NDArray[np.bool_]:
        return np.asarray((direction == 0) & (np.abs(torques) > limit(t) * peaks))

    def decide(t: float) -> None:
        for _ in range(20):
            rates, torques = solved(t)
            reverses = (np.abs(SPEEDS @ speed) < REST) & (direction * (SPEEDS @ rates) < -REST)
            beyond = overloaded(t, torques)
            if not (reverses | beyond).any():
                return
            direction[:] = np.where(reverses, 0, direction) if reverses.any() else np.where(beyond, np.sign(torques), direction)
        raise AssertionError("no directions fit")

    for k in range(round(t_end / dt) + 1):
        found.append(speed.copy())
        t, rest = k * dt, dt
        decide(t)
        while rest > 0.0:
            early, late = 0.0, rest
            while overloaded(t + late, solved(t + late)[1]).any() and late - early > 1e-9:
                middle = (early + late) / 2
                early, late = (early, middle) if overloaded(t + middle, solved(t + middle)[1]).any() else (middle, late)
            rates, _ = solved(t + late / 2)
            slides, growth = direction * (SPEEDS @ speed), direction * (SPEEDS @ rates)
            stops = np.where((slides > REST) & (growth < 0.0), slides / np.where(growth < 0.0, -growth, 1.0), np.inf)
            step = min(late, float(stops.min()))
            speed += step * rates
            t, rest = t + step, rest - step
            if rest > 0.0:
                direction[np.abs(SPEEDS @ speed) < REST] = 0
                decide(t)
    return np.array(found)


@pytest.mark.parametrize("method", ["ida", "rk"])
@pytest.mark.parametrize(
    "values",
    [
        {"tau": 10.4, "pulsation": 4.1, "J": (1.9, 1.1), "limits": (1.3, 3.3, 0.7), "peaks": (1.1, 1.2, 1.1)},
        {"tau": 8.1, "pulsation": 6.3, "J": (1.2, 0.6), "limits": (2.5, 4.2, 2.0), "peaks": (1.1, 1.3, 1.2)},
        {"tau": 7.7, "pulsation": 10.1, "J": (1.9, 0.7), "limits": (2.3, 3.7, 2.1), "peaks": (1.1, 1.0, 1.2)},
        {"tau": 7.5, "pulsation": 10.6, "J": (0.4, 0.9), "limits": (0.3, 3.4, 0.7), "peaks": (1.2, 1.4, 1.0)},
        {"tau": 8.6, "pulsation": 7.0, "J": (0.6, 1.4), "limits": (2.2, 4.6, 1.7), "peaks": (1.0, 1.0, 1.0), "pressing": 3.1},
        {"tau": 6.5, "pulsation": 4.4, "J": (1.3, 0.8), "limits": (1.9, 3.0, 0.9), "peaks": (1.0, 1.0, 1.0), "pressing": 7.3},
    ],
)
def test_what_stops_together_is_at_rest_before_anything_breaks_away(values: Any, method: str) -> None:
    """A bearing that stops an instant before the other one loads a clutch that is stuck; it does not break away by that."""
    expected = by_hand(**values, t_end=4.0, dt=1e-3)[::100]
    run = gl.compile(Coupled(**values)).simulate(4.0, samples=len(expected), rtol=1e-9, method=method)
    assert np.column_stack([run["body[0].w"], run["body[1].w"]]) == pytest.approx(expected, abs=2e-4)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(100))
def test_random_trains_stop_and_break_away_as_by_hand(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values: dict[str, Any] = {
        "tau": rng.uniform(3.0, 12.0), "pulsation": rng.uniform(2.0, 12.0), "J": tuple(rng.uniform(0.2, 2.0, 2)),
        "limits": tuple(rng.uniform((0.2, 0.5, 0.2), (3.0, 5.0, 3.0))), "peaks": tuple(rng.uniform(1.0, 1.5, 3)),
    }  # fmt: skip
    if seed % 2:  # with peaks, what breaks away would depend on the shares
        values |= {"pressing": rng.uniform(1.0, 9.0), "peaks": (1.0, 1.0, 1.0)}
    expected = by_hand(**values, t_end=4.0, dt=1e-3)[::100]
    system = gl.compile(Coupled(**values))
    for method in ("ida", "rk"):
        run = system.simulate(4.0, samples=len(expected), rtol=1e-9, method=method)
        found = np.column_stack([run["body[0].w"], run["body[1].w"]])
        assert found == pytest.approx(expected, abs=1e-3), method


class Geared(gl.Component):
    """A body behind a clutch drives another one through a gear with losses; all have bearings."""

    tau = gl.Structural(8.0)
    pulsation = gl.Structural(5.0)
    J = gl.Structural((1.0, 1.0))
    losses = gl.Structural((0.6, 0.7, 0.0, 0.5))
    ratio = gl.Structural(2.0)
    clutch_limit = gl.Structural(1.0)
    clutch_peak = gl.Structural(1.0)
    limits = gl.Structural((1.0, 1.0, 1.0, 1.0, 1.0))
    peaks = gl.Structural((1.0, 1.0, 1.0, 1.0, 1.0))

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.first = gp.Torque(tau=self.tau * gl.sin(self.pulsation * gl.time)), gp.Inertia(J=0.5)
        self.clutch = gp.Clutch(fn_max=1.0, f_normalized=1.0, mu_pos=((0.0, self.clutch_limit),), peak=self.clutch_peak)
        self.body = [gp.Inertia(J=J) for J in self.J]
        self.gear = gp.LossyGear(ratio=self.ratio, loss_table=((0.0, *self.losses),))
        self.bearing = [
            gp.BearingFriction(tau_pos=((0.0, limit),), peak=peak) for limit, peak in zip(self.limits, self.peaks, strict=True)
        ]
        on_first, *on_bodies = (bearing.flange_a for bearing in self.bearing)
        return [
            gl.connect(self.torque.flange, self.first.flange_a),
            gl.connect(self.first.flange_b, self.clutch.flange_a, on_first),
            gl.connect(self.clutch.flange_b, self.body[0].flange_a),
            gl.connect(self.body[0].flange_b, self.gear.flange_a, *on_bodies[:2]),
            gl.connect(self.gear.flange_b, self.body[1].flange_a),
            gl.connect(self.body[1].flange_b, *on_bodies[2:]),
        ]


HELD = [
    {"tau": 4.2, "pulsation": 10.5, "J": (1.6, 0.7), "losses": (0.7, 0.7, 0.3, 0.4), "ratio": 2.0, "clutch_limit": 1.7,
     "clutch_peak": 1.4, "limits": (1.8, 0.4, 0.3, 1.7, 1.0), "peaks": (1.3, 1.4, 1.0, 1.2, 1.4)},
    {"tau": 5.1, "pulsation": 3.0, "J": (0.9, 0.5), "losses": (0.5, 0.7, 0.5, 0.4), "ratio": 2.0, "clutch_limit": 3.5,
     "clutch_peak": 1.3, "limits": (1.6, 1.6, 0.6, 1.2, 0.7), "peaks": (1.3, 1.1, 1.1, 1.1, 1.5)},
    {"tau": 9.7, "pulsation": 4.0, "J": (0.6, 1.3), "losses": (0.5, 0.9, 0.4, 0.0), "ratio": 2.0, "clutch_limit": 3.9,
     "clutch_peak": 1.0, "limits": (1.9, 1.4, 1.1, 1.3, 1.9), "peaks": (1.3, 1.5, 1.2, 1.4, 1.4)},
    {"tau": 5.4, "pulsation": 6.9, "J": (0.3, 0.8), "losses": (0.5, 0.5, 0.1, 0.1), "ratio": -1.0, "clutch_limit": 3.5,
     "clutch_peak": 1.3, "limits": (0.3, 0.8, 1.5, 0.3, 1.3), "peaks": (1.3, 1.1, 1.4, 1.4, 1.1)},
    {"tau": 11.4, "pulsation": 3.7, "J": (1.9, 0.6), "losses": (0.7, 0.9, 0.2, 0.3), "ratio": 2.0, "clutch_limit": 2.0,
     "clutch_peak": 1.2, "limits": (0.5, 0.5, 1.9, 2.0, 0.5), "peaks": (1.3, 1.1, 1.2, 1.3, 1.4)},
]  # fmt: skip


@pytest.mark.parametrize("values", HELD)
def test_a_gear_that_others_hold_needs_no_side_that_drives(values: Any) -> None:
    """Whichever side of its loss it is given, what follows might ask for the other one: such trains were refused."""
    system = gl.compile(Geared(**values))
    runs = [system.simulate(4.0, samples=401, rtol=1e-9, method=method) for method in ("ida", "rk")]
    for name in ("first.w", "body[0].w", "body[1].w"):
        assert runs[0][name] == pytest.approx(runs[1][name], abs=1e-6)
    run, (eta_1, eta_2, b_1, b_2) = runs[0], values["losses"]
    torque, loss = run["gear.flange_a.tau"], run["gear.tau_loss"]
    forward = np.maximum((1 - eta_1) * torque + b_1, (1 - 1 / eta_2) * torque + b_2)
    backward = np.minimum((1 - eta_1) * torque - b_1, (1 - 1 / eta_2) * torque - b_2)
    assert (loss <= forward + 1e-8).all()
    assert (loss >= backward - 1e-8).all()
    assert np.abs(run["gear.w_a"]).max() < 1e-9
    for k, (limit, peak) in enumerate(zip(values["limits"], values["peaks"], strict=True)):
        assert (np.abs(run[f"bearing[{k}].tau"]) <= limit * peak * (1 + 1e-8)).all()
