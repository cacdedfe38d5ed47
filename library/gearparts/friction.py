"""Coulomb friction: bearings, brakes and clutches that slip and lock.

The relation between torque and acceleration is written with a curve parameter ``sa`` (Otter, Elmqvist and Mattsson, "Hybrid
modeling in Modelica based on the synchronous data flow principle", 1999): locked, it is the torque; sliding, it is the acceleration
beyond the start of sliding. The speed stays a continuous state in every mode.
"""

from __future__ import annotations

from typing import Any

import gearlib as gl
from gearparts.interfaces import Compliant, Flange, TwoFlanges

BACKWARD, STUCK, FORWARD, FREE, UNKNOWN = -1, 0, 1, 2, 3


class Friction(gl.Component):
    """Declares the friction element: curve parameter, mode and the conditions between modes."""

    peak = gl.Parameter("1", "break-away over sliding torque at zero speed", default=1.0, min=1)
    sa = gl.Variable("1", "curve parameter: torque while locked, acceleration otherwise")
    v = gl.Variable("rad/s", "relative speed of the friction surfaces")
    tau0 = gl.Variable("N.m", "sliding torque at zero speed")
    mode = gl.Discrete("-1 backward, 0 stuck, 1 forward, 2 free, 3 unknown", start=UNKNOWN)
    was_stuck = gl.Discrete("whether the mode before the event was stuck; sa is compared with its limits only then")
    start_forward = gl.Discrete("starts to slide forward")
    start_backward = gl.Discrete("starts to slide backward")
    locked = gl.Discrete("no relative acceleration")

    def friction_equations(self, torque: Any, level: Any, free: Any) -> list[gl.Eq | gl.When]:
        """The element's laws, given its torque, the sliding torque at its speed, and when it is free."""
        tau0_max = self.peak * self.tau0
        was = gl.pre(self.mode)
        # compared only while a flag is set: otherwise the difference is replaced by one that cannot change sign
        starting, returning = gl.pre(self.start_forward), gl.pre(self.start_backward)
        over = self.was_stuck * (self.sa - tau0_max + 1) > 1
        under = self.was_stuck * (self.sa + tau0_max - 1) < -1
        still_over = starting * (self.sa - self.tau0 + 1) > 1
        still_under = returning * (self.sa + self.tau0 - 1) < -1
        forward = gl.Or(gl.holds(self.start_forward), gl.equals(self.mode, FORWARD))
        return [
            gl.Eq(
                gl.der(self.v),
                gl.Piecewise(
                    (0, gl.holds(self.locked)),
                    (self.sa, gl.equals(self.mode, FREE)),
                    (self.sa - tau0_max, forward),
                    (self.sa + tau0_max, True),
                ),
            ),
            gl.Eq(
                torque,
                gl.Piecewise(
                    (self.sa, gl.holds(self.locked)), (0, gl.equals(self.mode, FREE)), (level, forward), (-level, True)
                ),
            ),
            gl.Eq(self.was_stuck, gl.equals(was, STUCK)),
            gl.Eq(
                self.start_forward,
                gl.Or(
                    gl.And(gl.equals(was, STUCK), gl.Or(over, still_over)),
                    gl.And(gl.initial(), self.v > 0),
                ),
            ),
            gl.Eq(
                self.start_backward,
                gl.Or(
                    gl.And(gl.equals(was, STUCK), gl.Or(under, still_under)),
                    gl.And(gl.initial(), self.v < 0),
                ),
            ),
            gl.Eq(
                self.locked,
                gl.And(
                    gl.Not(free),
                    gl.Not(gl.equals(was, FORWARD)),
                    gl.Not(gl.equals(was, BACKWARD)),
                    gl.Not(gl.holds(self.start_forward)),
                    gl.Not(gl.holds(self.start_backward)),
                ),
            ),
            gl.Eq(
                self.mode,
                gl.Piecewise(
                    (FREE, free),
                    (
                        FORWARD,
                        gl.And(
                            gl.Or(gl.equals(was, FORWARD), gl.equals(was, FREE), gl.holds(self.start_forward)), self.v > 0
                        ),
                    ),
                    (
                        BACKWARD,
                        gl.And(
                            gl.Or(gl.equals(was, BACKWARD), gl.equals(was, FREE), gl.holds(self.start_backward)), self.v < 0
                        ),
                    ),
                    (STUCK, True),
                ),
            ),
        ]


class Clutch(Compliant, Friction):
    """Friction clutch between two shafts: slides with ``mu cgeo fn_max f_normalized``, or locks.

    ``f_normalized`` presses the plates together; the clutch is free where it is not positive.
    """

    cgeo = gl.Parameter("m", "geometry constant: torque per normal force and friction coefficient", default=1.0, min=0)
    fn_max = gl.Parameter("N", "largest normal force", min=0)
    mu = gl.Parameter("1", "sliding friction coefficient", default=0.5, min=0)
    f_normalized = gl.Input("1", "normal force over the largest one")

    def equations(self) -> list[gl.Eq | gl.When]:
        normal = self.fn_max * self.f_normalized
        return [
            *self.compliant_equations(),
            gl.Eq(self.v, self.w_rel),
            gl.Eq(self.tau0, gl.Piecewise((0, self.f_normalized <= 0), (self.mu * self.cgeo * normal, True))),
            *self.friction_equations(self.tau, self.mu * self.cgeo * normal, self.f_normalized <= 0),
        ]


class Brake(TwoFlanges, Friction):
    """Friction brake between a shaft and its housing: slides with ``mu cgeo fn_max f_normalized``, or locks."""

    use_support = gl.Structural(False, "whether the housing is a flange; otherwise it stands still")
    support = Flange("housing", when="use_support")
    cgeo = gl.Parameter("m", "geometry constant: torque per normal force and friction coefficient", default=1.0, min=0)
    fn_max = gl.Parameter("N", "largest normal force", min=0)
    mu = gl.Parameter("1", "sliding friction coefficient", default=0.5, min=0)
    f_normalized = gl.Input("1", "normal force over the largest one")
    phi = gl.Variable("rad", "angle relative to the housing")
    w = gl.Variable("rad/s", "speed relative to the housing")
    tau = gl.Variable("N.m", "braking torque")

    def equations(self) -> list[gl.Eq | gl.When]:
        normal = self.fn_max * self.f_normalized
        housing = self.support.phi if self.use_support else 0
        return [
            gl.Eq(self.flange_a.phi, self.flange_b.phi),
            gl.Eq(self.phi, self.flange_a.phi - housing),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(self.v, self.w),
            gl.Eq(self.flange_a.tau + self.flange_b.tau, self.tau),
            *([gl.Eq(self.support.tau, -self.tau)] if self.use_support else []),
            gl.Eq(self.tau0, gl.Piecewise((0, self.f_normalized <= 0), (self.mu * self.cgeo * normal, True))),
            *self.friction_equations(self.tau, self.mu * self.cgeo * normal, self.f_normalized <= 0),
        ]
