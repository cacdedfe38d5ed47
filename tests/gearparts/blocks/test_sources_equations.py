"""Sources at the very instants at which they begin and end, at numbers, and what they derive from their values."""

from __future__ import annotations

import math

import pytest

import gearlib as gl
import gearparts as gp
from tests.gearparts.blocks.bench import Driven
from tests.gearparts.laws import right_side
from tests.gearparts.test_declared_numbers import parameters

B = gp.blocks


def test_a_step_is_up_from_its_time_on() -> None:
    values = {"offset": 0.5, "height": 2.0, "start_time": 0.75}
    assert [right_side(B.Step(), "y", time=t, **values) for t in (0.5, 0.75, 1.0)] == [0.5, 2.5, 2.5]


def test_a_ramp_rises_between_two_times() -> None:
    values = {"offset": 0.5, "height": 2.0, "start_time": 0.75, "duration": 0.5}
    found = [right_side(B.Ramp(duration=1.0), "y", time=t, **values) for t in (0.5, 0.75, 0.875, 1.25, 1.5)]
    assert found == [0.5, 0.5, 1.0, 2.5, 2.5]


def test_a_sine_begins_with_its_phase() -> None:
    values = {"offset": 0.5, "amplitude": 2.0, "start_time": 0.75, "f": 0.5, "phase": 0.3}
    found = [right_side(B.Sine(f=0.5), "y", time=t, **values) for t in (0.7, 0.75, 1.0)]
    assert found == pytest.approx([0.5, 0.5 + 2 * math.sin(0.3), 0.5 + 2 * math.sin(math.pi / 4 + 0.3)], rel=1e-14)


def test_a_chirp_ends_at_its_offset() -> None:
    """From 1 to 2 Hz in half a second: 0.75 turns in all, and 0.3125 up to the middle."""
    values = {"offset": 0.5, "amplitude": 2.0, "start_time": 0.75, "f_start": 1.0, "f_end": 2.0, "duration": 0.5}
    block = B.Chirp(f_start=1.0, f_end=2.0, duration=0.5)
    found = [right_side(block, "y", time=t, **values) for t in (0.5, 0.75, 1.0, 1.2499999999, 1.25, 1.5)]
    middle = 0.5 + 2 * math.sin(2 * math.pi * 0.3125)
    assert found == pytest.approx([0.5, 0.5, middle, -1.5, 0.5, 0.5], abs=1e-8)


def test_pulses_begin_and_end_at_exact_instants_until_all_are_over() -> None:
    class Both(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.twice = B.Pulse(period=0.5, width=25.0, n_period=2.0, start_time=0.25, amplitude=3.0, offset=-1.0)
            self.slopes = B.Trapezoid(
                period=0.5, rising=0.125, width=0.125, falling=0.0625, n_period=2.0, start_time=0.25, amplitude=3.0, offset=-1.0
            )
            return []

    times = [0.0, 0.25, 0.3125, 0.375, 0.5, 0.53125, 0.625, 0.75, 0.8125, 0.9375, 1.03125, 1.25, 1.3125, 1.75, 1.8125]
    r = gl.simulate(Both(), 2.0, times=times)
    up = [0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0]
    assert r["twice.y"].tolist() == [3.0 * on - 1.0 for on in up]
    slopes = [0, 0, 0.5, 1, 1, 0.5, 0, 0, 0.5, 1, 0.5, 0, 0, 0, 0]
    assert r["slopes.y"] == pytest.approx([3.0 * part - 1.0 for part in slopes], abs=1e-9)


@pytest.mark.parametrize(
    ("t_start", "since"), [(0.25, 0.0), (0.375, 0.125), (0.5, 0.25), (0.6875, 0.4375), (0.75, 0.0), (1.6875, 0.4375)]
)
def test_a_trapezoid_knows_its_period_wherever_a_run_starts(t_start: float, since: float) -> None:
    block = Driven(make=lambda: B.Trapezoid(period=0.5, rising=0.25, width=0.125, falling=0.125, start_time=0.25))
    r = gl.simulate(block, t_start + 0.01, t_start=t_start, samples=2)
    assert r["block.T0"][0] == pytest.approx(t_start - since, abs=1e-12)


def test_the_rest_of_a_period_is_what_its_parts_leave() -> None:
    found = parameters(B.Trapezoid(period=2.0, rising=0.3, width=0.5, falling=0.7))
    assert found["pause"] == pytest.approx(0.5, abs=1e-11)


@pytest.mark.parametrize(
    ("deltaq", "accelerating", "braking"),
    [(8.0, 0.5, 4.0), (-8.0, 0.5, 4.0), (0.25, 0.25, 0.25), (-0.25, 0.25, 0.25), (1.0, 0.5, 0.5)],
)
def test_a_motion_from_place_to_place_is_as_quick_as_its_limits_allow(
    deltaq: float, accelerating: float, braking: float
) -> None:
    """With 4 m/s2 up to 2 m/s: 0.5 s over 0.5 m; less than 1 m is half accelerated, half braked."""
    values = {"deltaq": deltaq, "qd_max": 2.0, "qdd_max": 4.0, "start_time": 0.5}
    block = B.KinematicPTP(**values)
    found = parameters(block)
    assert (found["t_accelerating"], found["t_braking"]) == pytest.approx((accelerating, braking), rel=1e-14)
    values |= {"t_accelerating": accelerating, "t_braking": braking}
    most, stops = math.copysign(4.0, deltaq), 0.5 + braking + accelerating
    instants = [
        (0.25, 0.0), (0.5, most), (0.4375 + accelerating, most),
        (0.5 + accelerating, 0.0 if braking > accelerating else -most), (0.5 + braking, -most), (stops - 0.0625, -most),
        (stops, 0.0), (stops + 1.0, 0.0),
    ]  # fmt: skip
    for t, acceleration in instants:
        assert right_side(block, "y", time=t, **values) == acceleration, t
