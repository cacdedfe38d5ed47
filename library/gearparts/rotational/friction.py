"""Coulomb friction with stick and slip: bearings, brakes, clutches, freewheels.

The relation between torque and acceleration is parametrised by a curve parameter ``sa`` (Otter, Elmqvist and Mattsson, "Hybrid modeling
in Modelica based on the synchronous data flow principle", 1999, https://doi.org/10.1109/CACSD.1999.808640): locked, it is the torque;
sliding, it is the acceleration. The speed is a continuous state in every mode.
"""

from __future__ import annotations

import math
from typing import Any

import gearlib as gl
from gearlib.arguments import shown
from gearlib.errors import BindingError
from gearparts.interfaces import SLOW, Compliant, Dissipative, Flange, TwoFlanges
from gearparts.tables import SMOOTHNESS, Rows, at_zero, check_rows, extremes, interpolated

BACKWARD, STUCK, FORWARD, FREE, UNKNOWN = -1, 0, 1, 2, 3
HYSTERESIS = 1e-4  # relative, for a one-way clutch's break-away torque
ROUNDING = 1e-10  # of a torque, relative to its limit
NO_ACCELERATION = 1e-7  # rad/s2: rounding of that of an element that could slide, but is held by another one
# While locked, the curve parameter is the torque and does not affect the acceleration. Under prescribed motion that would leave the
# torque undetermined, and a motion that starts or passes through zero would have no solution. With this compliance (rad/s2 per N.m) the
# torque of a locked element is zero on a prescribed motion at rest, and beyond any limit on one that moves, so that the element slides.
# Everywhere else it is below the rounding of the acceleration. Several locked elements on one rigid path share the torque by it.
YIELD = 1e-27
BEYOND = 1e15  # N.m: beyond any real shaft; only prescribed motions require it, and as a bound it is none
AT_REST = 1e-11  # rad/s: below it, an element at rest has not begun to move; a solver's rounding has no meaningful sign
LEFT = 1e-12  # rad/s and rad/s2: what rounding leaves of the speed and acceleration of an element that another one has stopped


def words(part: str) -> dict[float, str]:
    """Descriptions of the values of `Friction.contact`, for a kind of part."""
    return {0.0: f"open: {part} {{}}", 1.0: f"stuck: {part} {{}}", 2.0: f"sliding: {part} {{}}"}


class SlidingSurfaces(gl.Component):
    """Base of friction elements: curve parameter, sliding torque over speed, and release at zero normal force.

    A derived class equates ``tau0``, ``free`` and the transitions, and defines by ``level`` how the sliding torque depends on the speed.
    """

    sa = gl.Variable("any", "curve parameter: torque while locked, acceleration otherwise")
    tau0 = gl.Variable("N.m", "sliding torque at zero speed")
    free = gl.Discrete("nothing presses the surfaces together")
    was_stuck = gl.Discrete("whether it was stuck before the event")
    start_forward = gl.Discrete("starts to slide forward")
    locked = gl.Discrete("no relative acceleration")

    def level(self, speed: Any) -> Any:
        """Sliding torque at a positive speed."""
        raise NotImplementedError

    def sense(self) -> Any:
        """Direction in which it starts to slide, 0 where it does not."""
        return self.start_forward


class Friction(SlidingSurfaces, Dissipative):
    """Base of stick-slip elements: curve parameter, contact state and its transitions.

    A derived class equates ``v`` with the sliding speed, and defines where ``tau`` acts.
    """

    peak = gl.Parameter("1", "break-away over sliding torque at zero speed", default=1.0, min=1)
    w_small = gl.Parameter(
        "rad/s", "speed that only a reinit can have reached against the direction of sliding", default=1e10, min=0
    )
    v = gl.Variable("rad/s", "relative speed of the friction surfaces")
    tau = gl.Variable("N.m", "friction torque; acts against the motion when positive")
    contact = gl.Variable("1", "0 open, 1 stuck, 2 sliding")  # each kind of part declares its words
    mode = gl.Discrete("-1 backward, 0 stuck, 1 forward, 2 free, 3 unknown", start=UNKNOWN)
    moving = gl.Discrete("sign of the speed, 0 while locked or free")
    slid = gl.Discrete("direction in which it slid before the event, 0 where it did not")
    turned = gl.Discrete("whether a reinit has reversed that direction")
    start_backward = gl.Discrete("starts to slide backward")

    def equations(self) -> list[gl.Eq]:
        locked, is_free = gl.holds(self.locked), gl.holds(self.free)
        was = gl.pre(self.mode)
        forward = gl.Or(gl.holds(self.start_forward), gl.equals(was, FORWARD))
        backward = gl.Or(gl.holds(self.start_backward), gl.equals(was, BACKWARD))
        return [
            gl.Eq(gl.der(self.v), gl.Piecewise((YIELD * self.sa, locked), (self.sa, True))),
            gl.Eq(
                self.tau,
                gl.Piecewise((self.sa, locked), (0, is_free), (self.level(self.v), forward), (-self.level(-self.v), True)),
            ),
            gl.Eq(self.loss_power, self.tau * self.v),
            gl.Eq(self.moving, sign_while((1 - gl.pre(self.locked)) * (1 - self.free), self.v, gl.pre(self.moving), self.sa)),
            gl.Eq(self.was_stuck, gl.equals(was, STUCK)),
            gl.Eq(self.slid, gl.Piecewise((was, gl.Or(gl.equals(was, FORWARD), gl.equals(was, BACKWARD))), (0, True))),
            gl.Eq(self.turned, self.slid * self.v < -self.w_small),
            gl.Eq(self.start_forward, self._starts(1, self.sa, self.start_forward, self.start_backward)),
            gl.Eq(self.start_backward, self._starts(-1, -self.sa, self.start_backward, self.start_forward)),
            gl.Eq(self.locked, gl.And(gl.Not(is_free), gl.Not(forward), gl.Not(backward))),
            gl.Eq(self.contact, gl.Piecewise((0, is_free), (1, locked), (2, True))),
            gl.Eq(
                self.mode,
                gl.Piecewise(
                    (FREE, is_free),
                    (FORWARD, gl.And(forward, gl.equals(self.moving, 1))),
                    (BACKWARD, gl.And(backward, gl.equals(self.moving, -1))),
                    (STUCK, True),
                ),
            ),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(heat=self.loss_power)

    def sense(self) -> Any:
        return self.start_forward - self.start_backward

    def _starts(self, sense: int, curve: Any, starts: Any, starts_opposite: Any) -> Any:
        """Whether sliding starts in a direction, with the curve parameter counted in that direction.

        While stuck, the torque must exceed its limit, or the sliding torque if it had started already. One that has started in the
        opposite direction locks first: until then its curve parameter is not a torque, and two elements on one shaft would drive each
        other back and forth. The comparison is multiplied by flags: where none is set, it would raise meaningless events.
        """
        started = gl.pre(starts)
        limit = self.peak * self.tau0 * (1 - started) + (1 - ROUNDING) * self.tau0 * started
        pushed = gl.settled(self.was_stuck * (1 - starts_opposite) * excess(curve, limit, starts)) > 0
        thrown = gl.And(gl.holds(self.turned), gl.equals(self.slid, -sense))
        engaged_now = gl.And(gl.equals(gl.pre(self.mode), FREE), gl.Not(gl.holds(self.free)))
        return gl.Or(pushed, thrown, gl.And(gl.Or(gl.initial(), engaged_now), gl.equals(self.moving, sense)))


def excess(curve: Any, limit: Any, starts: Any) -> Any:
    """What is positive while an element starts to slide: its torque beyond the limit, or its acceleration once it ``starts``.

    An element that could slide, but is held by another one, has no acceleration, and keeps starting.
    """
    return curve - limit * (1 - starts) + NO_ACCELERATION * starts


def sign_while(flag: Any, speed: Any, was: Any, acceleration: Any) -> Any:
    """Sign of a speed while a flag is 1; zero while it is 0, since the speed may then be rounding.

    ``was`` is the previous sign: from rest the speed must exceed `AT_REST`; in motion the sign lasts until the speed crosses zero, or
    rounding is left of it where another element has stopped both. An element at rest that counted as moving would push for ever.
    """
    return gl.Piecewise(
        (1, flag * speed > least_speed(was * (was + 1) / 2, acceleration)),
        (-1, flag * speed < -least_speed(was * (was - 1) / 2, acceleration)),
        (0, True),
    )


def least_speed(moved: Any, acceleration: Any) -> Any:
    """Speed above which an element moves, if it did or did not move before: without any acceleration less than `LEFT` is rounding."""
    return AT_REST * (1 - moved) + moved * gl.no_event(gl.Max(0, LEFT - abs(acceleration)))


def _checked(owner: str, rows: Any, smoothness: str) -> Rows:
    """Rows of speed and friction, checked to be dissipative."""
    table = check_rows(owner, rows, 2)
    if any(row[1] < 0 for row in table):
        raise BindingError(f"{owner} is {shown(rows)}; expected friction of 0 or more in the second column")
    if at_zero(table, 1, smoothness) < -1e-12 * table[0][1]:  # less is rounding
        raise BindingError(f"{owner} is {shown(rows)}, whose extrapolation to the speed 0 is negative; expected a row for it")
    least, most = extremes(table, 1, smoothness)
    if least < -1e-12 * most:
        raise BindingError(
            f"{owner} is {shown(rows)}, whose {smoothness} curve falls to {least:.3g} between rows; expected friction of 0 or more: give "
            "more rows there, or smoothness='linear'"
        )
    return table


def _sliding(rows: Rows, speed: Any, smoothness: str) -> Any:
    """Friction at a positive speed; beyond the last row it falls to 0 at most."""
    return interpolated(rows, speed, 1, smoothness, (0.0, math.inf))


class FrictionOnHousing(TwoFlanges, Friction):
    """Base of bearings and brakes: friction between one shaft and the housing."""

    use_support = gl.Structural(False, "whether the housing is a flange; otherwise it stands still")
    support = Flange("housing", when="use_support")
    phi = gl.Variable("rad", "angle relative to the housing")
    w = gl.Variable("rad/s", "speed relative to the housing")
    a = gl.Derivative("w", "rad/s2", "acceleration relative to the housing")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.flange_a.phi, self.flange_b.phi),
            gl.Eq(self.phi, self.flange_a.phi - (self.support.phi if self.use_support else 0)),
            gl.Eq(self.w, gl.der(self.phi)),
            gl.Eq(self.v, self.w),
            gl.Eq(self.flange_a.tau + self.flange_b.tau, self.tau),
            *([gl.Eq(self.support.tau, -self.tau)] if self.use_support else []),
        ]


class BearingFriction(FrictionOnHousing):
    """Bearing friction with stick and slip: ``tau = tau_pos(w)`` for ``w > 0``, ``tau = -tau_pos(-w)`` for ``w < 0``.

    At rest ``der(w) = 0`` as long as ``abs(tau) <= peak tau_pos(0)``. ``tau_pos`` holds rows of speed and torque, which are
    interpolated, and extrapolated from the last two, down to 0 at most.
    """

    icon = "bearing"

    tau_pos = gl.Structural(((0.0, 1.0),), "rows of speed (rad/s) and sliding torque (N.m)")
    smoothness = gl.Structural("linear", "how the rows are interpolated", choices=SMOOTHNESS)
    contact = gl.Variable("1", "0 open, 1 stuck, 2 sliding", words=words("bearing"))

    def level(self, speed: Any) -> Any:
        return _sliding(self._rows(), speed, self.smoothness)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.tau0, at_zero(self._rows(), 1, self.smoothness)), gl.Eq(self.free, False)]

    def _rows(self) -> Rows:
        return _checked("BearingFriction.tau_pos", self.tau_pos, self.smoothness)


class Pressed(SlidingSurfaces):
    """Base of brakes and clutches: friction proportional to a normal force.

    One that begins to slide, but is held by others, keeps its torque when it is pressed harder: a brake that is pressed on a shaft that
    a bearing holds takes nothing of the load until the bearing lets go.
    """

    mu_pos = gl.Structural(((0.0, 0.5),), "rows of speed (rad/s) and sliding friction coefficient")
    smoothness = gl.Structural("linear", "how the rows are interpolated", choices=SMOOTHNESS)
    cgeo = gl.Parameter("m", "geometry constant: torque per normal force and friction coefficient", default=1.0, min=0)
    fn_max = gl.Parameter("N", "largest normal force", min=0)
    f_normalized = gl.Input("1", "normal force over the largest one")
    kept = gl.Discrete("sliding torque at which it began to slide; beyond any once others have let go")
    is_held = gl.Discrete("began to slide, but is held by others, and has been pressed harder since")

    def level(self, speed: Any) -> Any:
        sliding = _sliding(self._rows(), speed, self.smoothness) * self.cgeo * self.fn_max * self.f_normalized
        return gl.Piecewise((gl.no_event(gl.Min(self.kept, sliding)), gl.holds(self.is_held)), (sliding, True))

    def level_at_rest(self) -> Any:
        """Sliding torque at zero speed."""
        return at_zero(self._rows(), 1, self.smoothness) * self.cgeo * self.fn_max * self.f_normalized

    def _rows(self) -> Rows:
        return _checked(f"{type(self).__name__}.mu_pos", self.mu_pos, self.smoothness)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.tau0, gl.Piecewise((0, gl.holds(self.free)), (self.level_at_rest(), True))),
            gl.Eq(self.free, self.f_normalized <= 0),
            gl.Eq(
                self.kept,
                gl.Piecewise(
                    (self.tau0, gl.holds(gl.pre(self.locked))),
                    (BEYOND, gl.holds(gl.pre(self.is_held) * (1 - self.is_held))),
                    (gl.pre(self.kept), True),
                ),
            ),
            gl.Eq(
                self.is_held,
                gl.settled(
                    self.was_stuck
                    * self.sense() ** 2
                    * ((self.tau0 - self.kept) * (1 - self.is_held) + (NO_ACCELERATION - self.sense() * self.sa) * self.is_held)
                )
                > 0,
            ),
        ]


class Brake(FrictionOnHousing, Pressed):
    """Friction brake between a shaft and its housing: slides with ``tau = mu_pos(w) cgeo fn_max f_normalized``, or locks.

    The torque is opposite for ``w < 0``. At rest ``der(w) = 0`` as long as ``abs(tau)`` does not exceed ``peak`` times the sliding
    torque at zero speed. It is released unless ``f_normalized > 0``.
    """

    icon = "brake"

    contact = gl.Variable("1", "0 open, 1 stuck, 2 sliding", words=words("brake"))


class Clutch(Compliant, Friction, Pressed):
    """Friction clutch between two shafts: slides with ``tau = mu_pos(w_rel) cgeo fn_max f_normalized``, or locks.

    The torque is opposite for ``w_rel < 0``. At rest ``der(w_rel) = 0`` as long as ``abs(tau)`` does not exceed ``peak`` times the
    sliding torque at zero speed. It is released unless ``f_normalized > 0``.
    """

    icon = "clutch"

    contact = gl.Variable("1", "0 open, 1 stuck, 2 sliding", words=words("clutch"))

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.v, self.w_rel)]


class OneWayClutch(Compliant, Pressed, Dissipative):
    """Freewheel in parallel with a friction clutch: ``w_rel >= 0``, sliding with ``tau = mu_pos(w_rel) cgeo fn_max f_normalized``.

    Flange_a cannot overtake flange_b: locked, ``der(w_rel) = 0`` with any ``tau < 0``, and with ``tau > 0`` up to ``peak`` times the
    sliding torque at zero speed. Unless ``f_normalized > 0``, flange_b overruns without torque; as in Modelica, it breaks away at 1e-4
    of the sliding torque at ``f_normalized = 1`` then, so that ``fn_max`` should be that of the friction, not of the freewheel, which
    locks with any torque. A start with ``w_rel < 0`` is refused, and so is a run in which prescribed motions on both sides make
    flange_a overtake.
    """

    icon = "one_way_clutch"

    w_rel = gl.Variable("rad/s", "relative speed; flange_a cannot overtake flange_b", nominal=SLOW, min=0)
    peak = gl.Parameter("1", "break-away over sliding torque at zero speed", default=1.0, min=1)
    w_small = gl.Parameter("rad/s", "speed that only a reinit can have reached while stuck", default=1e10, min=0)
    tau0_max = gl.Variable("N.m", "torque at which it breaks away")
    stuck = gl.Discrete("locked, or not yet sliding")
    moving = gl.Discrete("1 where flange_b overruns")
    forced = gl.Discrete("locked, but driven on by motions that are prescribed on both sides")
    contact = gl.Variable("1", "0 overruns without a torque, 1 stuck, 2 sliding", words=words("one-way clutch"))

    def equations(self) -> list[gl.Eq]:
        locked, is_free, was_stuck = gl.holds(self.locked), gl.holds(self.free), gl.holds(gl.pre(self.stuck))
        largest_at_rest = self.level_at_rest().subs(self.f_normalized, 1)
        peak = gl.no_event(gl.Max(self.peak, 1 + HYSTERESIS))
        started = gl.pre(self.start_forward)
        limit = self.tau0_max * (1 - started) + (self.tau0 - ROUNDING * largest_at_rest) * started
        return [
            gl.Eq(self.tau0_max, gl.Piecewise((HYSTERESIS * largest_at_rest, is_free), (peak * self.tau0, True))),
            gl.Eq(
                gl.der(self.w_rel),
                gl.Piecewise((0, gl.holds(self.forced)), (YIELD * self.sa, locked), (self.sa, True)),
            ),
            gl.Eq(self.tau, gl.Piecewise((self.sa, locked), (0, is_free), (self.level(self.w_rel), True))),
            gl.Eq(self.moving, (1 - gl.pre(self.locked)) * self.w_rel > least_speed(gl.pre(self.moving), self.sa)),
            gl.Eq(self.was_stuck, was_stuck),
            gl.Eq(
                self.start_forward,
                gl.Or(
                    gl.settled(self.was_stuck * excess(self.sa, limit, self.start_forward)) > 0,
                    gl.And(was_stuck, self.w_rel > self.w_small),
                    gl.And(gl.initial(), gl.holds(self.moving)),
                ),
            ),
            gl.Eq(self.locked, gl.And(was_stuck, gl.Not(gl.holds(self.start_forward)))),
            gl.Eq(self.forced, self.locked * self.sa < -BEYOND),
            gl.Eq(self.stuck, gl.Or(locked, gl.Not(gl.holds(self.moving)))),
            gl.Eq(self.contact, gl.Piecewise((1, locked), (0, is_free), (2, True))),
            gl.Eq(self.loss_power, gl.Piecewise((0, gl.holds(self.stuck)), (self.tau * self.w_rel, True))),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(heat=self.loss_power)
