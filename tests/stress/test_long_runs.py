"""Long runs: the XP train for a million revolutions, undamped trains for 1e5 periods, memory with few outputs."""

from __future__ import annotations

import math
import resource
import tracemalloc
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

PERIOD = 2 * math.pi / 28.0  # s, of the paper's transmission error
FORCES = ("train.x_unit.ring_mesh.f", "train.x_unit.sun_mesh.f", "train.p_unit.mesh.f")
OUTPUTS = [*FORCES, "w_in", "w_out", "load.tau"]
c = gl.connect


@cache
def train() -> gl.System:
    return gl.compile(gp.ZhouCui2022(tau_in=100.0), outputs=OUTPUTS)


def first_and_last(method: str, revolutions: float, rtol: float = 1e-10) -> tuple[Any, Any]:
    """Mesh forces and efficiency in the first settled second, and in the last one at the same phases of the excitation."""
    speed = abs(train().simulate(50 * PERIOD, samples=1001, method="exact")["w_out"][-200:].mean())
    periods = math.ceil(2 * math.pi * revolutions / speed / PERIOD)
    moments = np.linspace(0.0, 4 * PERIOD, 41)
    times = np.concatenate(([0.0], 5 * PERIOD + moments, periods * PERIOD + moments))
    result = train().simulate(times[-1], times=times, method=method, rtol=rtol)
    values = np.column_stack([result[name] for name in FORCES])[1:]
    efficiency = (result["load.tau"] * result["w_out"])[1:] / (100.0 * result["w_in"][1:])
    values = np.column_stack([values, efficiency])
    return values[:41], values[41:]


def largest_change(first: Any, last: Any) -> float:
    return float((np.abs(last - first).max(axis=0) / np.abs(first).max(axis=0)).max())


def test_a_million_revolutions_exactly() -> None:
    first, last = first_and_last("exact", 1e6)
    assert np.isfinite(last).all()
    assert abs(first[:, 3]).min() > 0.1
    assert abs(first[:, 3]).max() < 1.5
    assert largest_change(first, last) < 1e-9


@pytest.mark.stress
@pytest.mark.parametrize(("method", "revolutions", "rtol", "bar"), [("rk8", 100, 1e-10, 1e-9), ("ida", 1000, 1e-6, 1e-4)])
def test_revolutions_step_by_step(method: str, revolutions: float, rtol: float, bar: float) -> None:
    first, last = first_and_last(method, revolutions, rtol)
    assert largest_change(first, last) < bar


class Vibration(gl.Component):
    """Two bodies and an undamped spring between them."""

    def assemble(self) -> list[Any]:
        self.left, self.right = gp.Inertia(J=1.0, start={"w": 1.0}), gp.Inertia(J=2.0, start={"w": -0.5})
        self.spring = gp.Spring(c=4 * math.pi**2 / 1.5)  # one period a second
        return [c(self.left.flange_b, self.spring.flange_a), c(self.spring.flange_b, self.right.flange_a)]


@cache
def vibration() -> gl.System:
    return gl.compile(Vibration(), outputs=["left.w", "right.w", "spring.phi_rel"])


def energy_drift(method: str, periods: int, rtol: float) -> float:
    """Largest relative change of the energy, over a run with a hundred outputs at odd moments."""
    result = vibration().simulate(periods + 0.37, samples=101, method=method, rtol=rtol)
    energy = (result["left.w"] ** 2 + 2 * result["right.w"] ** 2 + 4 * math.pi**2 / 1.5 * result["spring.phi_rel"] ** 2) / 2
    return float(np.abs(energy / energy[0] - 1).max())


def test_energy_of_an_undamped_train() -> None:
    assert energy_drift("exact", 100_000, 1e-9) < 1e-9
    for method in ("rk5", "rk8"):
        drifts = [energy_drift(method, 300, rtol) for rtol in (1e-6, 1e-8, 1e-10)]
        assert all(d < 3 * 300 * rtol for d, rtol in zip(drifts, (1e-6, 1e-8, 1e-10), strict=True)), (method, drifts)
        assert drifts[0] > 30 * drifts[1] > 900 * drifts[2], (method, drifts)


@pytest.mark.stress
@pytest.mark.parametrize(("method", "rtol"), [("rk5", 1e-7), ("rk8", 1e-9), ("rk8", 1e-11), ("ida", 1e-6), ("ida", 1e-8)])
def test_energy_over_1e5_periods(method: str, rtol: float) -> None:
    """The drift is in proportion to time, and per period less than the tolerance (IDA: five times)."""
    assert energy_drift(method, 100_000, rtol) < (5.0 if method == "ida" else 1.0) * 100_000 * rtol


@pytest.mark.stress
def test_energy_of_ida_follows_the_tolerance() -> None:
    drifts = [energy_drift("ida", 1000, rtol) for rtol in (1e-4, 1e-6, 1e-8)]
    assert all(d < 3000 * rtol for d, rtol in zip(drifts, (1e-4, 1e-6, 1e-8), strict=True)), drifts
    assert drifts[0] > drifts[1] > drifts[2], drifts


def growth(method: str, periods: int) -> tuple[float, float]:
    """Megabytes that Python holds at most during a run with few outputs, and that the process grew by."""
    vibration().simulate(10.0, samples=3, method=method)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    tracemalloc.start()
    try:
        vibration().simulate(float(periods), samples=3, method=method, rtol=1e-8)
        held = tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()
    return held, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3


@pytest.mark.parametrize("method", ["exact", "rk8"])
def test_memory_does_not_grow(method: str) -> None:
    held, grown = growth(method, 10_000)
    assert held < 2.0
    assert grown < 20.0


@pytest.mark.stress
@pytest.mark.parametrize("method", ["exact", "rk8", "ida"])
def test_memory_does_not_grow_at_length(method: str) -> None:
    held, grown = growth(method, 300_000 if method != "ida" else 10_000)
    assert held < 2.0
    assert grown < 20.0
