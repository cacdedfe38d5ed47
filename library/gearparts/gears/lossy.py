"""Gears with mesh efficiency and bearing friction, with self-locking."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import gearlib as gl
from gearlib.errors import BindingError
from gearparts.interfaces import Dissipative, Flange, MaybeHeated, TwoFlanges, TwoFlangesAndSupport
from gearparts.rotational.backlash import ElastoBacklash
from gearparts.rotational.friction import BACKWARD, FORWARD, FREE, ROUNDING, STUCK, excess, sign_while
from gearparts.tables import SMOOTHNESS, Rows, at_zero, check_rows, extremes, interpolated, piecewise_without_events, reaches

if TYPE_CHECKING:
    from gearlib.language.component import Connection

# Like `gearparts.rotational.friction.YIELD`, but a million times as large: other locked elements hold first. A gear's break-away torque
# changes with the torque that the others leave, and where it slid before them, neither side of its mesh might drive.
LAST = 1e-21
SMALLEST = 1e-15  # keeps a quotient finite that is not used where both efficiencies are 1
IDEAL: Rows = ((0.0, 1.0, 1.0, 0.0, 0.0),)
LIMITS = {1: (0.0, 1.0), 2: (1e-9, 1.0), 3: (0.0, math.inf), 4: (0.0, math.inf)}  # of the columns beyond the last row


class LossyGear(TwoFlangesAndSupport, Dissipative):
    """Gear pair with mesh efficiency and bearing friction: ``tau_b = -ratio (tau_a - tau_loss)``, ``phi_a = ratio phi_b``.

    A row of ``loss_table`` holds a speed of flange_a, the efficiencies ``eta1`` (flange_a drives) and ``eta2`` (flange_b drives) and
    the bearing torques ``B1``, ``B2`` in these cases, referred to flange_a. With ``T = tau_a``, for forward rotation of flange_a::

        tau_loss = (1 - eta1) T + B1      where T >= B_a, so that flange_a drives
        tau_loss = (1 - 1 / eta2) T + B2  otherwise

    with ``B_a = (B1 - B2) / (eta1 - 1 / eta2)``, the bearing torque at flange_a. For backward rotation the signs of B1, B2 and B_a
    change, and so does the driving side. At rest ``der(w_a) = 0`` as long as the loss lies between its values for the two directions.
    Beyond the last row the table is extrapolated, efficiencies to 1 and bearing torques to 0 at most.

    References
    ----------
    C. Pelchen, C. Schweiger, M. Otter, "Modeling and simulating the efficiency of gearboxes and of planetary gearboxes",
    2nd International Modelica Conference, 2002, pp. 257-266.
    """

    icon = "lossy_gear"
    radii = ("ratio",)

    loss_table = gl.Structural(IDEAL, "rows of speed (rad/s), eta1, eta2, B1 (N.m), B2 (N.m)")
    smoothness = gl.Structural("linear", "how the rows are interpolated", choices=SMOOTHNESS)
    ratio = gl.Parameter("1", "transmission ratio, flange_a over flange_b")
    phi_a = gl.Variable("rad", "angle of flange_a relative to the housing")
    w_a = gl.Variable("rad/s", "speed of flange_a relative to the housing")
    a_a = gl.Derivative("w_a", "rad/s2", "acceleration of flange_a relative to the housing")
    sa = gl.Variable("any", "curve parameter: loss while locked, acceleration otherwise")
    tau_loss = gl.Variable("N.m", "torque lost, at flange_a")
    tau_eta = gl.Variable("N.m", "torque that tells which side drives")
    tau_out = gl.Variable("N.m", "torque passed on beyond that at which the sides change; it has the sign of tau_eta")
    tau_driving = gl.Variable("N.m", "tau_eta, or what keeps the side where rounding decides its sign")
    loss_forward = gl.Variable("N.m", "loss at which it starts to turn forward")
    loss_backward = gl.Variable("N.m", "loss at which it starts to turn backward")
    mode = gl.Discrete("-1 backward, 0 stuck, 1 forward, 2 free of losses", start=FREE)
    moving = gl.Discrete("sign of the speed, 0 while locked")
    was_stuck = gl.Discrete("whether it was stuck before the event")
    start_forward = gl.Discrete("starts to turn forward")
    start_backward = gl.Discrete("starts to turn backward")
    locked = gl.Discrete("no acceleration")
    drives = gl.Discrete("whether flange_a drives")

    def equations(self) -> list[gl.Eq]:
        rows = check_rows("LossyGear.loss_table", self.loss_table, 5)
        for row in rows:
            if not _dissipative(row[1:]):
                raise BindingError(
                    f"LossyGear.loss_table has the row {row}; expected a speed, eta1 from 0 to 1, eta2 above 0 up to 1, and B1, B2 "
                    "of 0 or more"
                )
        housing = self.support.phi if self.use_support else 0
        laws = self._ideal() if rows == IDEAL else [*self._losses(rows), *self._modes()]
        return [
            gl.Eq(self.phi_a, self.flange_a.phi - housing),
            gl.Eq(self.phi_a, self.ratio * (self.flange_b.phi - housing)),
            gl.Eq(self.w_a, gl.der(self.phi_a)),
            gl.Eq(self.flange_b.tau, -self.ratio * (self.flange_a.tau - self.tau_loss)),
            gl.Eq(self.loss_power, self.tau_loss * self.w_a),
            *laws,
        ]

    def _check_between(self, rows: Rows) -> None:
        """Refuse a curve that goes beyond what losses can be between the rows."""
        for column, (low, high) in LIMITS.items():
            least, most = extremes(rows, column, self.smoothness)
            if least < min(low, *(row[column] for row in rows)) - ROUNDING or most > high + ROUNDING:
                raise BindingError(
                    f"LossyGear.loss_table: the {self.smoothness} curve of {('eta1', 'eta2', 'B1', 'B2')[column - 1]} goes from "
                    f"{least:.6g} to {most:.6g} between rows; expected eta1 from 0 to 1, eta2 above 0 up to 1, and B1, B2 of 0 or more: "
                    "give more rows there, or smoothness='linear'"
                )

    def _ideal(self) -> list[gl.Eq]:
        none = (self.tau_loss, self.loss_forward, self.loss_backward)
        never = (self.moving, self.was_stuck, self.start_forward, self.start_backward, self.locked)
        return [
            *(gl.Eq(x, 0) for x in (*none, *never)),
            gl.Eq(self.sa, gl.der(self.w_a)),
            gl.Eq(self.tau_eta, self.flange_a.tau),
            gl.Eq(self.tau_out, self.tau_eta),
            gl.Eq(self.tau_driving, self.tau_eta),
            gl.Eq(self.drives, 1),
            gl.Eq(self.mode, FREE),
        ]

    def _losses(self, rows: Rows) -> list[gl.Eq]:
        self._check_between(rows)
        torque = self.flange_a.tau
        ahead = gl.Or(gl.holds(self.start_forward), gl.equals(gl.pre(self.mode), FORWARD))
        at_rest = [at_zero(rows, column, self.smoothness) for column in LIMITS]
        if not _dissipative(at_rest, 1e-12):
            raise BindingError(
                f"LossyGear.loss_table extrapolated to the speed 0 has the row {at_rest}; expected a row for it in the table"
            )
        there = [
            [interpolated(rows, sense * self.w_a, column, self.smoothness, limits) for column, limits in LIMITS.items()]
            for sense in (1, -1)
        ]
        ideal = _without_mesh_losses(rows, self.smoothness)
        still = _on_side_a(at_rest, 0.0, [(-math.inf, math.inf)] if at_rest[0] == at_rest[1] == 1 else [])
        side_forward, side_backward = (
            _on_side_a(row, sense * self.w_a, ideal) for row, sense in zip(there, (1, -1), strict=True)
        )
        drives = gl.holds(self.drives)  # also while locked: it starts with the side that drives then
        forward = gl.Piecewise((_a_drives(torque, 1, there[0]), drives), (_b_drives(torque, 1, there[0]), True))
        backward = gl.Piecewise((_b_drives(torque, -1, there[1]), drives), (_a_drives(torque, -1, there[1]), True))
        change_forward, change_backward = (
            row[0] * side - row[2] for row, side in zip(there, (side_forward, side_backward), strict=True)
        )
        return [
            gl.Eq(
                self.tau_out,
                gl.Piecewise((-change_forward, ahead), (change_backward, True)) - self.flange_b.tau / self.ratio,
            ),
            gl.Eq(self.tau_driving, self._telling(rows, ideal)),
            gl.Eq(
                self.tau_eta,
                torque + gl.Piecewise((0, gl.holds(self.locked)), (-side_forward, ahead), (side_backward, True)),
            ),
            gl.Eq(self.tau_loss, gl.Piecewise((self.sa, gl.holds(self.locked)), (forward, ahead), (backward, True))),
            gl.Eq(gl.der(self.w_a), gl.Piecewise((LAST * self.sa, gl.holds(self.locked)), (self.sa, True))),
            gl.Eq(
                self.loss_forward,
                piecewise_without_events(
                    (_a_drives(torque, 1, at_rest), torque > still), (_b_drives(torque, 1, at_rest), True)
                ),
            ),
            gl.Eq(
                self.loss_backward,
                piecewise_without_events(
                    (_b_drives(torque, -1, at_rest), torque > -still), (_a_drives(torque, -1, at_rest), True)
                ),
            ),
        ]

    def _telling(self, rows: Rows, ideal: list[tuple[float, float]]) -> Any:
        """``tau_eta``, but what keeps the side where it differs in sign from ``tau_out``, which it does by rounding alone.

        Both vanish together, and stay so behind an open gap where the bearings load flange_a only, or not at all: one of the torques is
        known there, and rounding of the other one may change its sign with the side. Without mesh losses (in the ``ideal`` intervals of
        speed), at rest, and where flange_a cannot drive, ``tau_out`` tells nothing.
        """
        if min(row[1] for row in rows) <= 0 or math.isfinite(reaches(rows, 1, 0.0, self.smoothness)):
            return self.tau_eta
        told = gl.Or(gl.holds(self.locked), self.tau_eta * self.tau_out > 0)
        return piecewise_without_events(
            (self.tau_eta, told), *_by_speed(abs(self.w_a), ideal, self.tau_eta, 1.0 * self.drives - 0.5)
        )

    def _modes(self) -> list[gl.Eq]:
        was = gl.pre(self.mode)
        ahead = gl.Or(gl.equals(was, FORWARD), gl.holds(self.start_forward))
        back = gl.Or(gl.equals(was, BACKWARD), gl.holds(self.start_backward))
        return [
            gl.Eq(self.drives, gl.Piecewise((gl.pre(self.drives), self._is_held()), (1, self.tau_driving >= 0), (0, True))),
            gl.Eq(self.moving, sign_while(1 - gl.pre(self.locked), self.w_a, gl.pre(self.moving), self.sa)),
            gl.Eq(self.was_stuck, gl.equals(was, STUCK)),
            gl.Eq(self.start_forward, self._starts(1, self.sa, self.loss_forward, self.start_forward, self.start_backward)),
            gl.Eq(
                self.start_backward, self._starts(-1, -self.sa, -self.loss_backward, self.start_backward, self.start_forward)
            ),
            gl.Eq(self.locked, gl.And(gl.Not(ahead), gl.Not(back))),
            gl.Eq(
                self.mode,
                gl.Piecewise(
                    (FORWARD, gl.And(ahead, gl.equals(self.moving, 1))),
                    (BACKWARD, gl.And(back, gl.equals(self.moving, -1))),
                    (STUCK, True),
                ),
            ),
        ]

    def _is_held(self) -> Any:
        """Whether it has started, but others hold it.

        Its side of the loss stays there, which no motion confirms: what the others hold depends on it, and neither side might drive.
        """
        return gl.And(gl.Or(gl.holds(self.start_forward), gl.holds(self.start_backward)), gl.equals(gl.pre(self.mode), STUCK))

    def _starts(self, sense: int, curve: Any, limit: Any, starts: Any, starts_opposite: Any) -> Any:
        """Breakaway condition for one direction; multiplied by flags, since the comparison is meaningful only while the gear is stuck.

        A gear that has started in the opposite direction locks first: until then its curve parameter is not a torque.
        """
        limit = limit * (1 - ROUNDING * gl.pre(starts))
        pushed = gl.settled(self.was_stuck * (1 - starts_opposite) * excess(curve, limit, starts)) > 0
        return gl.Or(pushed, gl.And(gl.initial(), gl.equals(self.moving, sense)))

    def energies(self) -> gl.Energy:
        return gl.Energy(heat=self.loss_power)


def _dissipative(row: Sequence[float], rounding: float = 0.0) -> bool:
    """Whether efficiencies and bearing torques are those of losses."""
    return -rounding <= row[0] <= 1 + rounding and 0 < row[1] <= 1 + rounding and min(row[2:]) >= -rounding


def _a_drives(torque: Any, sense: int, row: list[Any]) -> Any:
    """Loss torque with flange_a driving, for one direction of rotation."""
    return (1 - row[0]) * torque + sense * row[2]


def _b_drives(torque: Any, sense: int, row: list[Any]) -> Any:
    """Loss torque with flange_b driving, for one direction of rotation of flange_a."""
    return (1 - 1 / row[1]) * torque + sense * row[3]


def _on_side_a(row: list[Any], speed: Any, ideal: list[tuple[float, float]]) -> Any:
    """The part of the bearing friction at flange_a; half of it where both efficiencies are 1 and it is indeterminate, as in Modelica.

    ``ideal``: the intervals of speed where they are.
    """
    part = (row[2] - row[3]) / (row[0] - 1 / row[1] - SMALLEST)
    return piecewise_without_events(*_by_speed(speed, ideal, row[2] / 2, part))


def _by_speed(speed: Any, intervals: list[tuple[float, float]], inside: Any, outside: Any) -> list[tuple[Any, Any]]:
    """Branches of a piecewise expression that has one value inside of some intervals of speed, in rising order, and another outside."""
    branches: list[tuple[Any, Any]] = []
    for low, high in intervals:
        branches += [(outside, speed < low)] if low > -math.inf else []
        branches.append((inside, speed < high if high < math.inf else True))
    return branches if branches and branches[-1][1] is True else [*branches, (outside, True)]


def _without_mesh_losses(rows: Rows, smoothness: str) -> list[tuple[float, float]]:
    """Intervals of speed in which both efficiencies are 1, in rising order; the first row holds below it, too."""
    reached = max(reaches(rows, column, 1.0, smoothness) for column in (1, 2))
    spans = [(left[0], right[0]) for left, right in pairwise(rows)] + ([(reached, math.inf)] if math.isfinite(reached) else [])

    def is_ideal(speed: float) -> bool:
        shifted = tuple((row[0] - speed, *row[1:]) for row in rows)
        return all(at_zero(shifted, column, smoothness) >= 1 for column in (1, 2))

    return [
        (low if low > rows[0][0] else -math.inf, high)
        for low, high in spans
        if all(is_ideal(low + share * min(high - low, 1.0)) for share in (0.25, 0.5, 0.75))
    ]


class Gearbox(TwoFlanges, MaybeHeated):
    """`LossyGear` in series with `ElastoBacklash`: ``phi_rel = flange_b.phi - lossyGear.flange_b.phi``.

    Its losses are those of both parts.
    """

    icon = "lossy_gear"
    radii = ("ratio",)

    use_support = gl.Structural(False, "whether the housing is a flange; otherwise it stands still")
    loss_table = gl.Structural(IDEAL, "rows of speed (rad/s), eta1, eta2, B1 (N.m), B2 (N.m)")
    support = Flange("housing", when="use_support")
    ratio = gl.Parameter("1", "transmission ratio, flange_a over flange_b")
    c = gl.Parameter("N.m/rad", "stiffness at flange_b", min=0)
    d = gl.Parameter("N.m.s/rad", "damping at flange_b", min=0)
    b = gl.Parameter("rad", "total backlash at flange_b", default=0.0, min=0)
    phi_rel = gl.Variable("rad", "deflection, flange_b against the gear", nominal=1e-4)
    w_rel = gl.Variable("rad/s", "rate of deflection")
    a_rel = gl.Derivative("w_rel", "rad/s2", "its acceleration")
    loss_power = gl.Variable("W", "power lost to heat")

    def assemble(self) -> list[Connection]:
        self.lossyGear = LossyGear(
            ratio=self.ratio, loss_table=self.loss_table, use_support=self.use_support, use_heat_port=self.use_heat_port
        )
        self.elastoBacklash = ElastoBacklash(c=self.c, d=self.d, b=self.b, use_heat_port=self.use_heat_port)
        links = [
            gl.connect(self.flange_a, self.lossyGear.flange_a),
            gl.connect(self.lossyGear.flange_b, self.elastoBacklash.flange_a),
            gl.connect(self.elastoBacklash.flange_b, self.flange_b),
        ]
        if self.use_support:
            links.append(gl.connect(self.support, self.lossyGear.support))
        if self.use_heat_port:
            links.append(gl.connect(self.heat_port, self.lossyGear.heat_port, self.elastoBacklash.heat_port))
        return links

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.phi_rel, self.elastoBacklash.phi_rel),
            gl.Eq(self.w_rel, self.elastoBacklash.w_rel),
            gl.Eq(self.loss_power, self.lossyGear.loss_power + self.elastoBacklash.loss_power),
        ]
