"""Adaptors between flanges and signals, against motions in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


class Braked(gl.Component):
    """A body that a signal brakes through an adaptor."""

    use_w = gl.Structural(True)
    use_a = gl.Structural(True)

    def assemble(self) -> Any:
        self.body = gp.Inertia(J=2.0, start={"phi": 0.5, "w": 3.0})
        self.adaptor = gp.TorqueToAngleAdaptor(tau=4.0, use_w=self.use_w, use_a=self.use_a)
        return [gl.connect(self.body.flange_b, self.adaptor.flange)]


@pytest.mark.parametrize(("use_w", "use_a"), [(True, True), (True, False), (False, False)])
def test_a_torque_signal_brakes_and_the_motion_comes_out(use_w: bool, use_a: bool) -> None:
    r = gl.simulate(Braked(use_w=use_w, use_a=use_a), t_end=1.0, samples=11)
    assert r["adaptor.phi"] == pytest.approx(0.5 + 3 * r.time - r.time**2)
    assert r["adaptor.w"] == pytest.approx((3 - 2 * r.time) * use_w)
    assert r["adaptor.a"] == pytest.approx(np.full(11, -2.0 * use_a))


class Led(gl.Component):
    """A body that an adaptor leads along a sine."""

    use_w = gl.Structural(True)

    def assemble(self) -> Any:
        t = gl.time
        self.body = gp.Inertia(J=2.0)
        signals = {"w_ref": 3 * gl.cos(3 * t), "a_ref": -9 * gl.sin(3 * t)} if self.use_w else {}
        self.adaptor = gp.AngleToTorqueAdaptor(phi_ref=1 + gl.sin(3 * t), use_w=self.use_w, use_a=self.use_w, **signals)
        return [gl.connect(self.body.flange_b, self.adaptor.flange)]


@pytest.mark.parametrize("use_w", [True, False])
def test_angle_signals_lead_and_the_torque_comes_out(use_w: bool) -> None:
    r = gl.simulate(Led(use_w=use_w), t_end=2.0, samples=21, rtol=1e-10)
    assert r["body.phi"] == pytest.approx(1 + np.sin(3 * r.time), abs=1e-8)
    assert r["adaptor.w"] == pytest.approx(3 * np.cos(3 * r.time), abs=1e-8)
    assert r["adaptor.tau"] == pytest.approx(-18 * np.sin(3 * r.time), abs=1e-7), "what the motion takes: J a"
