"""A Simpson set is shifted from first to third gear under load, clutch to clutch, with 180 N.m of the engine all the time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

FRONT, REAR = 2.2, 2.4  # ring over sun of the sets
PRESSURES: dict[str, tuple[tuple[float, float], ...]] = {  # (time, share)
    "first": ((0.0, 1.0), (1.0, 1.0), (1.15, 0.0), (10.0, 0.0)),
    "second": ((0.0, 0.0), (1.0, 0.0), (1.6, 1.0), (2.6, 1.0), (2.8, 0.0), (10.0, 0.0)),
    "third": ((0.0, 0.0), (2.6, 0.0), (3.3, 1.0), (10.0, 1.0)),
}


def pressure(name: str) -> Any:
    rows = PRESSURES[name]
    pieces = [
        (y0 + (y1 - y0) * (gl.time - t0) / (t1 - t0), gl.time < t1) for (t0, y0), (t1, y1) in zip(rows, rows[1:], strict=False)
    ]
    return gl.Piecewise(*pieces, (rows[-1][1], True))


class Shift(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.engine, self.inlet = gp.Torque(tau=180.0), gp.Inertia(J=0.15)
        law: dict[str, Any] = {"cgeo": 0.3, "mu_pos": ((0.0, 0.13), (400.0, 0.11)), "peak": 1.1}
        self.forward = gp.Clutch(fn_max=6000.0, f_normalized=1.0, **law)
        self.direct = gp.Clutch(fn_max=6000.0, f_normalized=pressure("third"), **law)
        self.sun_brake = gp.Brake(fn_max=5000.0, f_normalized=pressure("second"), **law)
        self.carrier_brake = gp.Brake(fn_max=9000.0, f_normalized=pressure("first"), **law)
        self.set = gp.Simpson(ratio_front=FRONT, ratio_rear=REAR)
        self.ring, self.sun, self.carrier = gp.Inertia(J=0.02), gp.Inertia(J=0.01), gp.Inertia(J=0.015)
        self.outlet = gp.Inertia(J=20.0)
        self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-0.02, w_nominal=1.0)
        self.grade = gp.ConstantTorque(tau_constant=-60.0)
        return [
            gl.connect(self.engine.flange, self.inlet.flange_a),
            gl.connect(self.inlet.flange_b, self.forward.flange_a, self.direct.flange_a),
            gl.connect(self.forward.flange_b, self.ring.flange_a), gl.connect(self.ring.flange_b, self.set.ring),
            gl.connect(self.direct.flange_b, self.sun.flange_a, self.sun_brake.flange_a),
            gl.connect(self.sun.flange_b, self.set.sun), gl.connect(self.carrier_brake.flange_a, self.carrier.flange_a),
            gl.connect(self.carrier.flange_b, self.set.rear_carrier), gl.connect(self.set.output, self.outlet.flange_a),
            gl.connect(self.outlet.flange_b, self.load.flange, self.grade.flange),
        ]  # fmt: skip


START = {"inlet.w": (1 + FRONT + REAR) / FRONT * 20.0, "outlet.w": 20.0, "carrier.w": 0.0}  # by Willis, in first gear
START |= {"ring.w": START["inlet.w"], "sun.w": -REAR * 20.0}


@pytest.fixture(scope="module")
def system() -> gl.System:
    return gl.compile(Shift())


@pytest.fixture(scope="module")
def explicit(system: gl.System) -> gl.Result:
    return system.simulate(4.0, samples=801, method="rk8", rtol=1e-11, start=START)


def test_ratios_of_the_gears(explicit: gl.Result) -> None:
    """By Willis: the sun's brake gives (1 + f) / f, both clutches 1; the rear carrier's brake (1 + f + r) / f."""
    ratio = explicit["inlet.w"] / explicit["outlet.w"]
    for t, expected in ((0.9, (1 + FRONT + REAR) / FRONT), (2.5, (1 + FRONT) / FRONT), (4.0, 1.0)):
        assert ratio[np.searchsorted(explicit.time, t)] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("rtol", [1e-6, 1e-10, 8e-11, 2e-11])
def test_ida_passes_speeds_through_zero(system: gl.System, explicit: gl.Result, rtol: float) -> None:
    """The rear carrier's speed goes through zero among speeds whose rounding is larger than a fiftieth of its tolerance."""
    result = system.simulate(4.0, samples=801, method="ida", rtol=rtol, start=START)
    for name in ("inlet.w", "outlet.w", "carrier.w", "sun.w"):
        assert np.abs(result[name] - explicit[name]).max() < 100 * max(rtol, 1e-10) * np.abs(explicit[name]).max()
