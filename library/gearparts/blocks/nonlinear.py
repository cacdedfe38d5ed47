"""Limiters, dead zones, hysteresis and switches, as in Modelica.Blocks.Nonlinear and Modelica.Blocks.Logical.

Boolean signals are 1 and 0; above 0.5 means true.
"""

from __future__ import annotations

import gearlib as gl
from gearparts.blocks.interfaces import SHORTEST, SISO, SO


class Limiter(SISO):
    """Limiter: ``y = min(max(u, y_min), y_max)``."""

    y_max = gl.Parameter("any", "upper limit")
    y_min = gl.Parameter("any", "lower limit", default=lambda block: -block.y_max)
    room = gl.Parameter("any", "y_max - y_min, which is not negative", default=lambda b: b.y_max - b.y_min, min=0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.y, gl.Piecewise((self.y_max, self.u > self.y_max), (self.y_min, self.u < self.y_min), (self.u, True)))
        ]


class RateLimiter(SISO):
    """Rate limiter: ``der(y) = min(max((u - y) / Td, falling), rising)``; Modelica's SlewRateLimiter.

    ``Td`` is its lag behind a slowly changing signal.
    """

    rising = gl.Parameter("any", "largest rate, in the signal's unit per s", default=1.0, min=0)
    falling = gl.Parameter("any", "lowest rate, negative", default=lambda block: -block.rising, max=0)
    Td = gl.Parameter("s", "time constant of the lag", default=1e-3, min=SHORTEST)

    def equations(self) -> list[gl.Eq]:
        rate = (self.u - self.y) / self.Td
        return [
            gl.Eq(
                gl.der(self.y),
                gl.Piecewise((self.rising, rate > self.rising), (self.falling, rate < self.falling), (rate, True)),
            )
        ]


class DeadZone(SISO):
    """Dead zone: ``y = u - u_max`` above it, ``y = u - u_min`` below it, ``y = 0`` in it."""

    u_max = gl.Parameter("any", "upper end of the dead zone")
    u_min = gl.Parameter("any", "lower end of the dead zone", default=lambda block: -block.u_max)
    room = gl.Parameter("any", "u_max - u_min, which is not negative", default=lambda b: b.u_max - b.u_min, min=0)

    def equations(self) -> list[gl.Eq]:
        above, below = (self.u - self.u_max, self.u > self.u_max), (self.u - self.u_min, self.u < self.u_min)
        return [gl.Eq(self.y, gl.Piecewise(above, below, (0, True)))]


class Hysteresis(SISO):
    """Two-point switch with hysteresis: ``y = 1`` from ``u > u_high`` until ``u < u_low``, ``y = 0`` otherwise.

    Between the limits it begins at 0, or at 1 with ``start={"on": 1}``.
    """

    u_low = gl.Parameter("any", "below, y becomes 0")
    u_high = gl.Parameter("any", "above, y becomes 1")
    room = gl.Parameter("any", "u_high - u_low, which is not negative", default=lambda b: b.u_high - b.u_low, min=0)
    on = gl.Discrete("1 where it is switched on")

    def equations(self) -> list[gl.Eq]:
        stays = gl.And(gl.holds(gl.pre(self.on)), self.u >= self.u_low)
        return [gl.Eq(self.on, gl.Piecewise((1, gl.Or(self.u > self.u_high, stays)), (0, True))), gl.Eq(self.y, self.on)]


class Switch(SO):
    """Switch between two signals: ``y = u1`` where ``u2 > 0.5``, ``y = u3`` otherwise."""

    u1 = gl.Input("any", "signal where u2 is 1")
    u2 = gl.Input("1", "1 or 0: which signal")
    u3 = gl.Input("any", "signal where u2 is 0")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, gl.Piecewise((self.u1, self.u2 > 0.5), (self.u3, True)))]


class LogicalSwitch(SO):
    """Switch between two Boolean signals: ``y = 1`` if the selected one is above 0.5, ``y = 0`` otherwise.

    The selected one is ``u1`` where ``u2 > 0.5``, and ``u3`` otherwise.
    """

    u1 = gl.Input("1", "1 or 0, where u2 is 1")
    u2 = gl.Input("1", "1 or 0: which signal")
    u3 = gl.Input("1", "1 or 0, where u2 is 0")

    def equations(self) -> list[gl.Eq]:
        first = gl.And(self.u2 > 0.5, self.u1 > 0.5)
        return [gl.Eq(self.y, gl.Piecewise((1, gl.Or(first, gl.And(self.u2 <= 0.5, self.u3 > 0.5))), (0, True)))]
