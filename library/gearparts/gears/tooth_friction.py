"""Sliding friction of the tooth pairs in contact: its torques on both gears."""

from __future__ import annotations

from typing import Any, ClassVar

import gearlib as gl
from gearparts.gears.flanks import Flanks
from gearparts.gears.mesh_phase import contact_intervals


class ToothFriction(Flanks):
    """Base of meshes with sliding friction: sliding velocities and friction torques of the pairs in contact."""

    turns_against: ClassVar[int]  # 1 if the gears counter-rotate, -1 otherwise

    friction = gl.Structural(False, "whether the teeth slide with friction")
    mu = gl.Parameter("1", "friction: coefficient of the sliding teeth", default=0.05, min=0)
    v_smooth = gl.Parameter("m/s", "friction: sliding speed at which it has 76 % of its full size", default=1e-3, min=1e-12)
    alpha = gl.Parameter("rad", "friction: working pressure angle in the transverse section", default=gl.pi / 9, min=0, max=1.5)
    approach = gl.Parameter(
        "1", "friction: part of the contact ratio before the pitch point", default=lambda mesh: mesh.contact_ratio / 2, min=0
    )
    pitch = gl.Parameter("m", "friction: base pitch", default=lambda mesh: 2 * gl.pi * mesh.r_a / mesh.z_a, min=0)
    tangent_a = gl.Parameter(
        "m",
        "friction: way from gear a's tangent point to the pitch point",
        default=lambda mesh: mesh.r_a * gl.tan(mesh.alpha),
        min=0,
    )
    tangent_b = gl.Parameter(
        "m",
        "friction: way from gear b's tangent point to the pitch point",
        default=lambda mesh: mesh.r_b * gl.tan(mesh.alpha),
        min=0,
    )
    from_tangent_a = gl.Variable("m", "friction: way from gear a's tangent point to where pairs come into contact", min=0)
    to_tangent_b = gl.Variable("m", "friction: way from where pairs leave contact to gear b's tangent point", min=0)
    beyond = gl.Variable(
        "m", "friction: way of the newest pair from the pitch point, away from gear a's tangent point", state="never"
    )
    sliding = gl.Variable("m/s", "friction: sliding speed of the newest pair")
    grip = gl.Variable("1", "friction: mean over the pairs of their smoothed signs of sliding")
    grip_later = gl.Variable("1", "friction: the same, each times the base pitches that the pair is ahead of the newest")
    tau_friction_a = gl.Variable("N.m", "torque of the sliding friction on flange_a")
    tau_friction_b = gl.Variable("N.m", "torque of the sliding friction on flange_b")

    def equations(self) -> list[gl.Eq]:
        laws = (
            self.from_tangent_a, self.to_tangent_b,
            self.beyond, self.sliding, self.grip, self.grip_later, self.tau_friction_a, self.tau_friction_b,
        )  # fmt: skip
        if not self.friction:
            return [gl.Eq(law, 0) for law in laws]
        step, opposite = self.turns_against * self.pitch, self.turns_against * self.tangent_b
        early, late = contact_intervals(type(self).__name__, self.contact_ratio)
        inside = early.within(self.phase)
        newest = gl.Piecewise((early.newest(self.phase), inside), (late.newest(self.phase), True))

        def mean(weight: int) -> Any:
            """Mean of the friction signs over the pairs, weighted by 1, or by the distance in pitches ahead of the newest pair."""
            speeds = [self.sliding + pair * step * (self.w_a - self.w_b) for pair in range(early.pairs)]
            signs = [pair**weight * gl.tanh(speed / self.v_smooth) for pair, speed in enumerate(speeds)]
            return gl.Piecewise(*((sum(signs[: s.pairs]) / s.pairs, when) for s, when in ((early, inside), (late, True))))

        pressed = self.mu * gl.no_event(abs(self.f))
        arm_a, arm_b = self.tangent_a + self.beyond, opposite - self.beyond
        values = (
            self.tangent_a - self.turns_against * self.approach * self.pitch,
            self.tangent_b - (self.contact_ratio - self.approach) * self.pitch,
            step * (newest - self.approach),
            arm_a * self.w_a + arm_b * self.w_b,
            mean(0),
            mean(1),
            pressed * (arm_a * self.grip + step * self.grip_later),
            pressed * (arm_b * self.grip - step * self.grip_later),
        )
        return [gl.Eq(law, value) for law, value in zip(laws, values, strict=True)]

    def friction_torques(self) -> tuple[Any, Any]:
        """Friction torques on both gears."""
        return (self.tau_friction_a, self.tau_friction_b) if self.friction else (0, 0)
