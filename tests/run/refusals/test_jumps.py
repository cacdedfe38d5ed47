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


def test_a_short_pulse_late_in_time_is_seen() -> None:
    pulse = gl.Piecewise((0.0, T < 1e7 + 0.5), (10.0, T < 1e7 + 0.501), (0.0, True))
    with pytest.raises(ModelError, match=r"w_ref has a jump at t = 10000000\.5 s"):
        gl.compile(Followed(ref=pulse)).simulate(1e7 + 1, t_start=1e7)["body.flange_a.tau"]


class Law(gl.Component):
    """A cam: an angle as a function of another, without losses."""

    flange_a, flange_b = gp.Flange("of the cam"), gp.Flange("of the follower")
    law = gl.Structural(None)

    def equations(self) -> list[Any]:
        a, b = self.flange_a, self.flange_b
        return [gl.Eq(b.phi, self.law(a.phi)), gl.Eq(a.tau * gl.der(a.phi) + b.tau * gl.der(b.phi), 0)]


class Cam(gl.Component):
    """It turns in the middle of a shaft, with 3 rad/s at first."""

    law = gl.Structural(None)

    def assemble(self) -> list[Any]:
        self.body, self.follower = gp.Inertia(J=1.0, start={"phi": 0.0, "w": 3.0}), gp.Inertia(J=0.7)
        self.cam = Law(law=self.law)
        return [
            gl.connect(self.body.flange_b, self.cam.flange_a),
            gl.connect(self.cam.flange_b, self.follower.flange_a),
        ]


KNOTS = [0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 1.5, 3.0, 3.2]
ROUGH = {
    "corner": (lambda x: gl.Max(x, 2 * x - 1), "kink", 1.0),
    "turn": (lambda x: abs(x - 1), "kink", 1.0),
    "step": (lambda x: gl.Piecewise((x, x < 1), (x + 1, True)), "jump", 1.0),
    "no event": (lambda x: gl.no_event(gl.Max(x, 2 * x - 1)), "kink", 1.0),
    "table": (gl.Table(*KNOTS), "kink", 1.0),
    "end of a table": (gl.Table([0.0, 1.0], [0.0, 2.0]), "kink", 1.0),
}
SMOOTH = {
    "not reached": lambda x: gl.Max(x, 2 * x - 10),
    "parabola": lambda x: x + gl.Max(x - 1, 0) ** 2,
    "table": gl.Table(*KNOTS, "akima"),
    "cubic": gl.Table(*KNOTS, "cubic"),
}


@pytest.mark.parametrize("law", ROUGH)
def test_a_rigid_cam_with_a_corner_is_refused_where_it_is_reached(law: str) -> None:
    """The follower's speed would jump, and energy come from nowhere."""
    given, kind, angle = ROUGH[law]
    system = gl.compile(Cam(law=given))
    for method in ("auto", "rk8", "ida"):
        with pytest.raises(ModelError, match=rf"cam: the equation .* has a {kind} at t = 0\.333333333 s.*make what it drives"):
            system.simulate(1.0, samples=2, method=method)
    before = system.simulate(0.3, samples=4)
    assert before["body.phi"].max() < angle
    slope = before["follower.w"] / before["body.w"]
    assert 0.5 * before["body.w"] ** 2 * (1 + 0.7 * slope**2) == pytest.approx(4.5 * (1 + 0.7 * slope[0] ** 2), rel=1e-6)
    stepped = system.stepper()
    stepped.advance(0.3)
    with pytest.raises(ModelError, match=f"has a {kind} at t = "):
        stepped.advance(0.5)


@pytest.mark.parametrize("law", SMOOTH)
def test_a_smooth_cam_keeps_its_energy(law: str) -> None:
    result = gl.compile(Cam(law=SMOOTH[law])).simulate(0.7, samples=15, rtol=1e-9)
    assert result["body.phi"][-1] > 1.2
    energy = 0.5 * result["body.w"] ** 2 + 0.35 * result["follower.w"] ** 2
    assert energy == pytest.approx(energy[0], rel=1e-7)


class Bouncing(gl.Component):
    """The cam, and a ball beside it."""

    def assemble(self) -> list[Any]:
        self.cam, self.ball = Cam(law=ROUGH["corner"][0]), Ball()
        return []


class Ball(gl.Component):
    h, v = gl.Variable("m", start=1.0), gl.Variable("m/s", start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.h), self.v),
            gl.Eq(gl.der(self.v), -9.81),
            gl.When(self.h < 0.8, gl.reinit(self.v, -0.8 * self.v)),
        ]


def test_what_other_events_set_is_no_impulse_of_the_cam() -> None:
    with pytest.raises(ModelError, match=r"cam\.cam: the equation .* has a kink at t = 0\.333333333 s"):
        gl.simulate(Bouncing(), 1.0)


class Behind(gl.Component):
    """A body that follows what another one does, which nothing else depends on."""

    law = gl.Structural(None)

    def assemble(self) -> list[Any]:
        self.ground, self.shaft = gp.Fixed(), gp.Spring(c=10.0)
        self.body, self.other = gp.Inertia(J=1.0, start={"phi": 1.0, "w": 0.0}), gp.Inertia(J=0.3)
        self.motion = gp.Position(exact=True, phi_ref=self.law(self.body.phi))
        return [
            gl.connect(self.ground.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.body.flange_a),
            gl.connect(self.motion.flange, self.other.flange_a),
        ]


def test_what_is_computed_after_the_run_is_refused_between_samples() -> None:
    kink = gl.simulate(Behind(law=lambda x: gl.Max(x, 0.5)), 1.0, times=[0.0, 0.2, 0.5, 0.9, 1.0])
    assert kink["other.w"] == pytest.approx(np.where(kink["body.phi"] > 0.5, kink["body.w"], 0.0))
    with pytest.raises(ModelError, match=r"motion: other\.phi has a kink between t = 0\.2 s and t = 0\.5 s"):
        kink["other.flange_a.tau"]
    step = gl.simulate(Behind(law=lambda x: gl.Piecewise((x, x > 0.5), (x - 1, True))), 1.0, samples=6)
    assert step["other.phi"] == pytest.approx(step["body.phi"] - (step["body.phi"] <= 0.5))
    with pytest.raises(ModelError, match=r"motion: other\.phi has a jump between t = 0\.2 s and t = 0\.4 s"):
        step["other.w"]
    with pytest.raises(ModelError, match="has a jump between"):
        step["other.w"]
    equal = gl.simulate(Behind(law=lambda x: gl.Piecewise((x, x > 0.5), (1 - x, True))), 0.3, samples=6)
    assert equal["other.flange_a.tau"] == pytest.approx(0.3 * equal["body.a"])  # no side is reached but the first


class Shifted(gl.Component):
    """Two bodies and a ratio that changes, with the impulse in the gear or without."""

    impulse = gl.Structural(False)
    w_a, w_b = gl.Variable("rad/s", start=10.0), gl.Variable("rad/s")
    tau = gl.Variable("N.m", "of the second body")
    second = gl.Discrete("whether the second speed is engaged")

    def equations(self) -> list[Any]:
        ratio = 1 + self.second
        shift: list[Any] = [gl.Eq(self.second, 1)] + (
            [gl.reinit(self.w_a, self.w_a * (2.0 + 1.5) / (2.0 + 4 * 1.5))] if self.impulse else []
        )
        return [
            gl.Eq(self.w_b, ratio * self.w_a),
            gl.Eq(1.5 * gl.der(self.w_b), self.tau),
            gl.Eq(2.0 * gl.der(self.w_a), -ratio * self.tau),
            gl.When(T > 0.5, *shift),
        ]


def test_a_rigid_shift_needs_its_impulse() -> None:
    with pytest.raises(
        ModelError, match=r"Shifted: the equation .* has a jump at t = 0\.5 s.*set the speeds after it by gl\.reinit"
    ):
        gl.compile(Shifted()).simulate(1.0)
    result = gl.compile(Shifted(impulse=True)).simulate(1.0, times=[0.0, 0.4, 0.6, 1.0])
    momentum = 2.0 * result["w_a"] + np.array([1, 1, 2, 2]) * 1.5 * result["w_b"]  # as the first shaft feels it
    assert momentum == pytest.approx(35.0)
    assert result["w_b"] == pytest.approx(np.array([1, 1, 2, 2]) * result["w_a"])
