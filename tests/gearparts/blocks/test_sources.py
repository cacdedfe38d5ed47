"""Sources against their formulas."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import chirp

import gearlib as gl
import gearparts as gp
from tests.gearparts.blocks.bench import Driven, answer, close

B = gp.blocks
METHODS = ["auto", "rk", "ida"]


def test_constant_and_step() -> None:
    _, y = answer(B.Constant, k=-3.0)
    assert (y == -3.0).all()
    t, y = answer(B.Step, height=2.0, offset=0.5, start_time=0.7)
    assert (y == np.where(t < 0.7, 0.5, 2.5)).all()


def test_ramp() -> None:
    t, y = answer(B.Ramp, height=-2.0, duration=0.8, offset=1.0, start_time=0.5)
    assert close(y, np.interp(t, [0.5, 1.3], [1.0, -1.0]), 1e-14)


def test_sine() -> None:
    t, y = answer(B.Sine, amplitude=2.0, f=1.5, phase=0.3, offset=0.25, start_time=0.5)
    assert close(y, 0.25 + np.where(t < 0.5, 0.0, 2.0 * np.sin(3.0 * np.pi * (t - 0.5) + 0.3)), 1e-13)


def test_chirp() -> None:
    t, y = answer(B.Chirp, amplitude=3.0, f_start=1.0, f_end=9.0, duration=1.5, offset=1.0, start_time=0.25)
    sweep = 3.0 * chirp(t - 0.25, 1.0, 1.5, 9.0, phi=-90.0)
    assert close(y, 1.0 + np.where((t >= 0.25) & (t < 1.75), sweep, 0.0), 1e-12)


@pytest.mark.parametrize("deltaq", [2.0, -2.0, 0.3, 0.0])
def test_a_motion_from_place_to_place_ends_there_at_rest_within_its_limits(deltaq: float) -> None:
    class Motion(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.plan = B.KinematicPTP(deltaq=deltaq, qd_max=0.8, qdd_max=2.0, start_time=0.25)
            self.speed, self.place = B.Integrator(), B.Integrator()
            return [gl.connect(self.plan.y, self.speed.u), gl.connect(self.speed.y, self.place.u)]

    r = gl.simulate(Motion(), 4.0, samples=801, rtol=1e-10)
    assert r["place.y"][-1] == pytest.approx(deltaq, abs=1e-12)
    assert r["speed.y"][-1] == pytest.approx(0.0, abs=1e-12)
    reached = np.sign(deltaq) * min(0.8, np.sqrt(abs(deltaq) * 2.0))
    assert r["speed.y"][np.abs(r["speed.y"]).argmax()] == pytest.approx(reached, abs=1e-2)
    assert (r["speed.y"][r.time <= 0.25] == 0).all()
    quickest = 0.25 + (abs(deltaq) / 0.8 + 0.4 if abs(deltaq) >= 0.32 else 2 * np.sqrt(abs(deltaq) / 2.0))
    assert np.flatnonzero(r["plan.y"])[-1:] < quickest / 0.005 if deltaq else not r["plan.y"].any()


@pytest.mark.parametrize("method", METHODS)
def test_a_source_drives_a_load_exactly(method: str) -> None:
    class Drive(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.step, self.torque, self.load = B.Step(height=3.0, start_time=0.3), gp.Torque(), gp.Inertia(J=1.5)
            return [gl.connect(self.step.y, self.torque.tau), gl.connect(self.torque.flange, self.load.flange_a)]

    r = gl.simulate(Drive(), 1.0, samples=11, method=method)
    assert close(r["load.w"], 2.0 * np.maximum(r.time - 0.3, 0.0), 1e-12)
    assert r.energy_balance().residual == pytest.approx(0.0, abs=1e-9)


def test_parameters_have_bounds() -> None:
    with pytest.raises(gl.GearlibError, match=r"block\.duration is 0; expected at least"):
        gl.compile(Driven(make=lambda: B.Ramp(duration=0.0)))
    with pytest.raises(gl.GearlibError, match=r"Valid names|did you mean 'f'|no parameter"):
        B.Sine(frequency=3.0)


def test_parameters_stay_open() -> None:
    system = gl.compile(Driven(make=lambda: B.Ramp(duration=1.0)))
    other: NDArray[np.float64] = system.simulate(1.0, samples=3, parameters={"block.height": 4.0})["block.y"]
    assert other.tolist() == [0.0, 2.0, 4.0]
