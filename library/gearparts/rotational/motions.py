"""Prescribed motions: a shaft follows a given angle, speed or acceleration; the torque is the result.

If a start value depends on a signal, the deviation from the signal is a variable that starts at zero.
"""

from __future__ import annotations

import gearlib as gl
from gearparts.interfaces import OneFlange


class Position(OneFlange):
    """Follows an angle: ``phi = phi_ref`` if ``exact``, which must be twice differentiable; otherwise low-pass filtered.

    The filter is a second-order Bessel filter that starts at ``phi_ref``:
    ``der(w) = ((phi_ref - phi) w_crit - 1.3617 w) w_crit / 0.6180`` with ``w = der(phi)``, ``w_crit = 2 pi f_crit``.
    """

    icon = "angle"

    exact = gl.Structural(False, "follow exactly, without a filter")
    f_crit = gl.Parameter("Hz", "critical frequency of the filter", default=50.0, min=0)
    phi_ref = gl.Input("rad", "reference angle relative to the support")
    phi = gl.Variable("rad", "angle relative to the support", state="prefer")
    w = gl.Variable("rad/s", "speed relative to the support", state="prefer")
    a = gl.Derivative("w", "rad/s2", "acceleration relative to the support")
    phi_error = gl.Variable("rad", "phi - phi_ref", start=0.0)

    def equations(self) -> list[gl.Eq]:
        w_crit = 2 * gl.pi * self.f_crit
        filtered = gl.Eq(gl.der(self.w), ((self.phi_ref - self.phi) * w_crit - 1.3617 * self.w) * w_crit / 0.6180)
        return [
            gl.Eq(self.phi, self.angle()),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(self.phi_error, 0 if self.exact else self.phi - self.phi_ref),
            gl.Eq(self.phi, self.phi_ref) if self.exact else filtered,
        ]


class Speed(OneFlange):
    """Follows a speed: ``w = w_ref`` if ``exact``, which must be differentiable; otherwise low-pass filtered.

    The filter ``der(w) = (w_ref - w) 2 pi f_crit`` starts at ``w_ref``. The angle starts at 0.
    """

    icon = "speed"

    exact = gl.Structural(False, "follow exactly, without a filter")
    f_crit = gl.Parameter("Hz", "critical frequency of the filter", default=50.0, min=0)
    w_ref = gl.Input("rad/s", "reference speed relative to the support")
    phi = gl.Variable("rad", "angle relative to the support", state="prefer", start=0.0)
    w = gl.Variable("rad/s", "speed relative to the support", state="prefer")
    a = gl.Derivative("w", "rad/s2", "acceleration relative to the support")
    w_error = gl.Variable("rad/s", "w - w_ref", start=0.0)

    def equations(self) -> list[gl.Eq]:
        filtered = gl.Eq(gl.der(self.w), (self.w_ref - self.w) * 2 * gl.pi * self.f_crit)
        return [
            gl.Eq(self.phi, self.angle()),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(self.w_error, 0 if self.exact else self.w - self.w_ref),
            gl.Eq(self.w, self.w_ref) if self.exact else filtered,
        ]


class Accelerate(OneFlange):
    """Follows an acceleration: ``der(phi) = w``, ``der(w) = a_ref``. Both start at 0 unless ``start`` is given."""

    icon = "acceleration"

    a_ref = gl.Input("rad/s2", "reference acceleration relative to the support")
    phi = gl.Variable("rad", "angle relative to the support", state="prefer", start=0.0)
    w = gl.Variable("rad/s", "speed relative to the support", state="prefer", start=0.0)
    a = gl.Derivative("w", "rad/s2", "acceleration relative to the support")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.phi, self.angle()),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(gl.der(self.w), self.a_ref),
        ]


class Move(OneFlange):
    """Follows consistent signals of angle, speed and acceleration, without differentiating any of them.

    The acceleration is integrated from the initial angle and speed: ``der(w) = a_ref + 2 k (w_ref - w) + k**2 (phi_ref - phi)``, ``w =
    der(phi)``. If the signals are each other's derivatives, the corrections only prevent the growth of rounding and integration errors.
    """

    icon = "angle"

    phi_ref = gl.Input("rad", "reference angle relative to the support")
    w_ref = gl.Input("rad/s", "reference speed, the derivative of phi_ref")
    a_ref = gl.Input("rad/s2", "reference acceleration, the derivative of w_ref")
    k = gl.Parameter("1/s", "rate at which deviations decay", default=10.0, min=0)
    phi = gl.Variable("rad", "angle relative to the support", state="prefer")
    w = gl.Variable("rad/s", "speed relative to the support", state="prefer")
    a = gl.Derivative("w", "rad/s2", "acceleration relative to the support")
    phi_error = gl.Variable("rad", "phi - phi_ref", start=0.0)
    w_error = gl.Variable("rad/s", "w - w_ref", start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.phi, self.angle()),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(self.phi_error, self.phi - self.phi_ref),
            gl.Eq(self.w_error, self.w - self.w_ref),
            gl.Eq(gl.der(self.w), self.a_ref - 2 * self.k * self.w_error - self.k**2 * self.phi_error),
        ]


class ConstantSpeed(OneFlange):
    """Turns at a constant speed: ``der(phi) = w_fixed``."""

    icon = "speed"

    w_fixed = gl.Parameter("rad/s", "speed relative to the support")
    phi = gl.Variable("rad", "angle relative to the support")
    w = gl.Variable("rad/s", "speed relative to the support", state="avoid")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.phi, self.angle()),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(self.w, self.w_fixed),
        ]
