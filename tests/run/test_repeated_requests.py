"""What is kept from one run to the next never changes a result: each run is that of a system which has not run before."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

OUTPUTS = ["load.w", "motor.w", "shaft.tau", "brake.tau"]


class Line(gl.Component):
    """A motor with a gear, an elastic shaft, a brake that locks and slips, and a fan."""

    def assemble(self) -> list[Any]:
        self.drive = gp.Torque(tau=2.0 + gl.sin(3.0 * gl.time))
        self.motor = gp.Inertia(J=0.2)
        self.gear = gp.IdealGear(ratio=3.0)
        self.wheel = gp.Inertia(J=0.5)
        self.shaft = gp.SpringDamper(c=300.0, d=0.4)
        self.load = gp.Inertia(J=1.0)
        self.brake = gp.BearingFriction(tau_pos=((0.0, 1.5), (10.0, 2.0)))
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=5.0)
        return [
            gl.connect(self.drive.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.brake.flange_a, self.fan.flange),
        ]


SETS: list[dict[str, float]] = [
    {}, {"motor.J": 0.3}, {"gear.ratio": 2.0}, {"shaft.c": 500.0}, {}, {"motor.J": 0.3, "load.J": 0.4}, {"shaft.d": 0.0}, {"load.J": 0.4},
]  # fmt: skip


def asked(system: gl.System, parameters: dict[str, float], method: str) -> list[Any]:
    result = system.simulate(1.0, samples=5, parameters=parameters, method=method)
    return [result[name].tolist() for name in OUTPUTS] + [[t for t, _ in result.events]]


@pytest.mark.parametrize("method", ["auto", "rk5", "ida"])
def test_parameters_that_come_and_go(method: str) -> None:
    """Bit for bit, also in several threads."""
    fresh = [asked(gl.compile(Line(), OUTPUTS), p, method) for p in SETS]
    system = gl.compile(Line(), OUTPUTS)
    assert [asked(system, p, method) for p in SETS] == fresh
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda p: asked(system, p, method), SETS * 3)) == fresh * 3


def test_times_that_are_changed_in_place() -> None:
    system = gl.compile(Line(), OUTPUTS)
    for times in (np.linspace(0.0, 1.0, 4), [0.0, 0.25, 0.5, 1.0]):
        first = system.simulate(1.0, times=times)
        kept = first.time.copy()
        times[1] = 0.125
        second = system.simulate(1.0, times=times)
        assert second.time[1] == 0.125
        assert first.time.tolist() == kept.tolist()
        assert system.simulate(1.0, samples=5).time.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_equal_but_of_another_kind() -> None:
    """``True == 1.0``; what a first run refuses, a second one does, too."""
    system = gl.compile(Line(), OUTPUTS)
    system.simulate(1.0, samples=2)
    for wrong in ({"t_end": True}, {"t_end": 1.0, "samples": 2.0}, {"t_end": 1.0, "rtol": np.array([1e-6])}, {"t_end": "1.0"}):
        for _ in range(2):
            with pytest.raises(gl.GearlibError):
                system.simulate(**{"samples": 2, **wrong})
    assert system.simulate(1.0, samples=2).time.tolist() == [0.0, 1.0]


def test_a_result_s_times_are_not_those_of_the_next_run() -> None:
    """A user who shifts the time axis of one result shifts no other."""
    system = gl.compile(Line(), OUTPUTS)
    result = system.simulate(1.0, samples=3)
    before = result["load.w"].copy()
    try:
        result.time[:] += 5.0
        result["load.w"][:] = 0.0
    except ValueError:  # read-only
        pass
    again = system.simulate(1.0, samples=3)
    assert again.time.tolist() == [0.0, 0.5, 1.0]
    assert again["load.w"].tolist() == before.tolist()
