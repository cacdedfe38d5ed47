"""Sampled blocks, as in Modelica.Blocks.Discrete: they act at the instants ``start_time + k * sample_period`` and hold in between."""

from __future__ import annotations

import gearlib as gl
from gearparts.blocks.interfaces import SHORTEST, SISO, SO


class SampledBlock(SO):
    """Base of sampled blocks: the sample instants, and an output held by a discrete variable."""

    sample_period = gl.Parameter("s", "time between two instants", min=SHORTEST)
    start_time = gl.Parameter("s", "first instant", default=0.0)
    held = gl.Discrete("output between the instants")

    def equations(self) -> list[gl.Eq | gl.When]:
        return [gl.Eq(self.y, self.held)]


class Sampler(SampledBlock):
    """Ideal sampler: ``y = u`` at the instants, held in between."""

    u = gl.Input("any", "input signal")

    def equations(self) -> list[gl.Eq | gl.When]:
        return [gl.When(gl.sample(self.sample_period, self.start_time), gl.Eq(self.held, self.u))]


class ZeroOrderHold(SampledBlock):
    """Sampler whose output follows ``y = u`` just after the instant, so that an algebraic loop may pass through it."""

    u = gl.Input("any", "input signal")
    taken = gl.Discrete("value at the instant")

    def equations(self) -> list[gl.Eq | gl.When]:
        return [
            gl.When(gl.sample(self.sample_period, self.start_time), gl.Eq(self.taken, self.u)),
            gl.Eq(self.held, gl.pre(self.taken)),
        ]


class UnitDelay(SampledBlock):
    """Delay by one period: ``y(t_k) = u(t_k - sample_period)``. Its initial value is 0, or set by ``start={"taken": 2.0}``."""

    u = gl.Input("any", "input signal")
    taken = gl.Discrete("input at the last instant, and just after it, where a `ZeroOrderHold` follows")
    now = gl.Discrete("1 at an instant")

    def equations(self) -> list[gl.Eq | gl.When]:
        instant = gl.sample(self.sample_period, self.start_time)
        taking = gl.Or(instant, gl.holds(gl.pre(self.now)))
        return [
            gl.When(instant, gl.Eq(self.held, gl.pre(self.taken))),
            gl.Eq(self.now, instant),
            gl.Eq(self.taken, gl.Piecewise((self.u, taking), (gl.pre(self.taken), True))),
        ]


class TriggeredSampler(SISO):
    """Triggered sampler: ``y = u`` when ``trigger`` rises above 0.5, held until the next time."""

    trigger = gl.Input("1", "1 or 0; rises where the input is sampled")
    held = gl.Discrete("output between the instants")

    def equations(self) -> list[gl.Eq | gl.When]:
        return [gl.When(self.trigger > 0.5, gl.Eq(self.held, self.u)), gl.Eq(self.y, self.held)]


class DiscretePID(SampledBlock):
    """Digital PID controller with limited output and anti-windup: ``v_k = k (wp u_s - u_m) + I_k + D_k``.

    ``y = min(max(v, y_min), y_max)``; the integral by forward differences, ``I_{k+1} = I_k + k h / Ti (u_s - u_m) + h / (Ni Ti) (y -
    v)`` with ``h = sample_period``; the derivative of the measurement by backward differences, filtered with the time constant ``Td /
    Nd``, ``D_k = (Td D_{k-1} - k Td Nd (u_m - u_m_{k-1})) / (Td + Nd h)``, 0 at the first instant.

    References
    ----------
    K. J. Astrom, B. Wittenmark, "Computer-Controlled Systems", 3rd ed., Prentice Hall 1997, section 8.5.
    """

    u_s = gl.Input("any", "set-point")
    u_m = gl.Input("any", "measurement")
    k = gl.Parameter("any", "gain", default=1.0)
    Ti = gl.Parameter("s", "integral time", default=0.5, min=SHORTEST)
    Td = gl.Parameter("s", "derivative time", default=0.0, min=0)
    y_max = gl.Parameter("any", "upper limit of the output")
    y_min = gl.Parameter("any", "lower limit of the output", default=lambda controller: -controller.y_max)
    room = gl.Parameter("any", "y_max - y_min, which is not negative", default=lambda b: b.y_max - b.y_min, min=0)
    wp = gl.Parameter("1", "weight of the set-point in the proportional part", default=1.0, min=0)
    Ni = gl.Parameter("1", "Ni Ti is the time constant of the anti-windup compensation", default=0.9, min=SHORTEST)
    Nd = gl.Parameter("1", "the higher, the less the derivative lags", default=10.0, min=SHORTEST)
    integral = gl.Discrete("integral part of the next instant")
    derivative = gl.Discrete("derivative part")
    last = gl.Discrete("measurement at the last instant")
    begun = gl.Discrete("1 from the first instant on")
    v = gl.Discrete("output before it is limited")

    def equations(self) -> list[gl.Eq | gl.When]:
        h = self.sample_period
        change = gl.Piecewise((self.u_m - gl.pre(self.last), gl.holds(gl.pre(self.begun))), (0, True))
        derivative = (self.Td * gl.pre(self.derivative) - self.k * self.Td * self.Nd * change) / (self.Td + self.Nd * h)
        limited = gl.no_event(
            gl.Piecewise((self.y_max, self.v > self.y_max), (self.y_min, self.v < self.y_min), (self.v, True))
        )
        rate = self.k * (self.u_s - self.u_m) / self.Ti + (self.held - self.v) / (self.Ni * self.Ti)
        return [
            gl.When(
                gl.sample(h, self.start_time),
                gl.Eq(self.derivative, derivative),
                gl.Eq(self.v, self.k * (self.wp * self.u_s - self.u_m) + gl.pre(self.integral) + self.derivative),
                gl.Eq(self.held, limited),
                gl.Eq(self.integral, gl.pre(self.integral) + h * rate),
                gl.Eq(self.last, self.u_m),
                gl.Eq(self.begun, 1),
            )
        ]
