"""References that are followed exactly: they are differentiated, so they must not jump."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.errors import ModelError

T = gl.time
STEP = gl.Piecewise((0, T < 0.5), (10, True))
RAMP = gl.Piecewise((0, T < 0.5), (10 * (T - 0.5), True))
ROUNDED = gl.Piecewise((0, T < 0.5), (10 * (T - 0.5) ** 2, True))


class Followed(gl.Component):
    """A body that follows a reference, and one on an elastic shaft behind it."""

    ref = gl.Structural(None)
    angle = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.motion = gp.Position(exact=True, phi_ref=self.ref) if self.angle else gp.Speed(exact=True, w_ref=self.ref)
        self.body = gp.Inertia(J=2.0, start={"w": 0.0})
        self.shaft, self.load = gp.SpringDamper(c=50.0, d=1.0), gp.Inertia(J=1.0)
        return [
            gl.connect(self.motion.flange, self.body.flange_a),
            gl.connect(self.body.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]


@pytest.mark.parametrize(
    ("ref", "angle", "message"),
    [
        (STEP, False, r"motion: motion\.w_ref has a jump at t = 0\.5 s, but must be differentiated"),
        (2 + gl.sign(gl.sin(10 * T)), False, r"motion\.w_ref has a jump at t = 0\.314159265 s"),
        (STEP, True, r"motion\.phi_ref has a jump at t = 0\.5 s"),
        (RAMP, True, r"motion\.phi_ref has a kink at t = 0\.5 s"),
    ],
)
def test_reference_that_jumps_is_refused(ref: Any, angle: bool, message: str) -> None:
    start = {"body.w": 3.0} if ref.has(sympy.sin) and not angle else {}
    system = gl.compile(Followed(ref=ref, angle=angle))
    with pytest.raises(ModelError, match=message):
        system.simulate(1.0, start=start)["body.flange_a.tau"]
    assert system.simulate(0.3, start=start).time[-1] == 0.3  # it is not reached


@pytest.mark.parametrize(("ref", "angle", "slope"), [(RAMP, False, 10.0), (ROUNDED, True, 20.0)])
def test_reference_without_a_jump_is_followed(ref: Any, angle: bool, slope: float) -> None:
    """Its last piece is not 0 at the start, but that piece does not hold there."""
    result = gl.simulate(Followed(ref=ref, angle=angle), 1.0, samples=101, rtol=1e-9)
    assert result["body.w"] == pytest.approx(slope * np.maximum(result.time - 0.5, 0.0), abs=1e-9)
    torque = result["body.flange_a.tau"] - result["shaft.tau"] * -1
    assert torque[:50] == pytest.approx(0.0, abs=1e-9)
    assert torque[51:] == pytest.approx(2.0 * slope, rel=1e-9)


def _cycloid(s: Any) -> Any:
    return s - gl.sin(2 * gl.pi * s) / (2 * gl.pi)


def _polynomial(s: Any) -> Any:
    return 10 * s**3 - 15 * s**4 + 6 * s**5


@pytest.mark.parametrize("law", [_cycloid, _polynomial])
@pytest.mark.parametrize(("begin", "lasts", "angle"), [(0.37, 0.111, 1e4), (1 / 3, 1 / 7, 5.0), (0.1, 0.2, 1e-3)])
def test_motion_laws_of_cams_are_no_jumps(law: Any, begin: float, lasts: float, angle: float) -> None:
    """Their angles, speeds and accelerations agree at the ends but for rounding; the acceleration is the derivative's."""
    ref = gl.Piecewise((0, begin > T), (angle * law((T - begin) / lasts), begin + lasts > T), (angle, True))
    result = gl.compile(Followed(ref=ref, angle=True)).simulate(0.9, samples=91)
    s = (result.time - begin) / lasts
    second = {_cycloid: 2 * np.pi * np.sin(2 * np.pi * s), _polynomial: 60 * s - 180 * s**2 + 120 * s**3}[law]
    expected = np.where((s > 0) & (s < 1), angle / lasts**2 * second, 0.0)
    assert result["body.a"] == pytest.approx(expected, abs=1e-9 * angle / lasts**2)


def test_jump_that_nothing_with_inertia_follows_is_a_motion() -> None:
    class Kinematic(gl.Component):
        def assemble(self) -> list[Any]:
            self.motion, self.shaft, self.load = gp.Speed(exact=True, w_ref=STEP), gp.Damper(d=2.0), gp.Inertia(J=1.0)
            return [
                gl.connect(self.motion.flange, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.load.flange_a),
            ]

    result = gl.simulate(Kinematic(), 1.0, samples=101, rtol=1e-9)
    expected = np.where(result.time < 0.5, 0.0, 10 * (1 - np.exp(-2 * (result.time - 0.5))))
    assert result["load.w"] == pytest.approx(expected, abs=1e-8)


def test_a_jump_matters_only_where_it_is_needed() -> None:
    """The body's speed is the reference; only its torque would be infinite."""
    result = gl.compile(Followed(ref=STEP)).simulate(0.4)
    assert not result["body.w"].any()
    with pytest.raises(ModelError, match="has a jump"):
        gl.compile(Followed(ref=STEP), outputs=["shaft.tau", "body.flange_a.tau"]).simulate(1.0)["body.flange_a.tau"]
    assert gl.compile(Followed(ref=STEP), outputs=["body.w"]).simulate(1.0, start={"body.w": 0.0})["body.w"][-1] == 10.0
