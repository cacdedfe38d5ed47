"""Signal sources, functions of time, as in Modelica.Blocks.Sources."""

from __future__ import annotations

from typing import Any

import gearlib as gl
from gearlib.language.expressions import alternates
from gearparts.blocks.interfaces import SHORTEST, SO, SignalSource

ROUNDING = 1e-12  # by which the parts of a period may exceed it


class Constant(SO):
    """A constant signal: ``y = k``."""

    k = gl.Parameter("any", "value")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.k)]


class RealExpression(SO):
    """An expression of variables as a signal: ``y = expression``, as in ``RealExpression(expression=2 * self.load.w)``."""

    expression = gl.Input("any", "the expression")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.expression)]


class BooleanExpression(SO):
    """A condition as a signal, 1 where it holds and 0 elsewhere: ``expression=gl.Piecewise((1, self.load.w > 2), (0, True))``."""

    expression = gl.Input("any", "1 or 0")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.expression)]


class Step(SignalSource):
    """A step: ``y = offset`` before ``start_time``, ``offset + height`` from then on."""

    height = gl.Parameter("any", "height of the step", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.offset + gl.Piecewise((0, gl.time < self.start_time), (self.height, True)))]


class Ramp(SignalSource):
    """A ramp: ``y = offset + height (time - start_time) / duration`` for ``duration``, constant before and after."""

    height = gl.Parameter("any", "height of the ramp", default=1.0)
    duration = gl.Parameter("s", "how long it rises", min=SHORTEST)

    def equations(self) -> list[gl.Eq]:
        since = gl.time - self.start_time
        rise = gl.Piecewise(
            (0, gl.time < self.start_time),
            (self.height * since / self.duration, gl.time < self.start_time + self.duration),
            (self.height, True),
        )
        return [gl.Eq(self.y, self.offset + rise)]


class Sine(SignalSource):
    """A sine: ``y = offset + amplitude sin(2 pi f (time - start_time) + phase)`` from ``start_time`` on, ``offset`` before."""

    amplitude = gl.Parameter("any", "amplitude", default=1.0)
    f = gl.Parameter("Hz", "frequency")
    phase = gl.Parameter("rad", "phase at start_time", default=0.0)

    def equations(self) -> list[gl.Eq]:
        angle = 2 * gl.pi * self.f * (gl.time - self.start_time) + self.phase
        return [
            gl.Eq(self.y, self.offset + gl.Piecewise((0, gl.time < self.start_time), (self.amplitude * gl.sin(angle), True)))
        ]


class Chirp(SignalSource):
    """Sine with linearly increasing frequency: ``y = offset + amplitude sin(2 pi (f_start s + (f_end - f_start) s**2 / (2 duration)))``.

    ``s = time - start_time``; before the start and after ``duration``, ``y = offset``.
    """

    amplitude = gl.Parameter("any", "amplitude", default=1.0)
    f_start = gl.Parameter("Hz", "frequency at start_time")
    f_end = gl.Parameter("Hz", "frequency at the end")
    duration = gl.Parameter("s", "how long it lasts", min=SHORTEST)

    def equations(self) -> list[gl.Eq]:
        since = gl.time - self.start_time
        angle = 2 * gl.pi * (self.f_start * since + (self.f_end - self.f_start) * since**2 / (2 * self.duration))
        wave = gl.Piecewise(
            (0, gl.time < self.start_time),
            (self.amplitude * gl.sin(angle), gl.time < self.start_time + self.duration),
            (0, True),
        )
        return [gl.Eq(self.y, self.offset + wave)]


class PeriodicSource(SignalSource):
    """Base of periodic sources: their period, and the number of periods."""

    period = gl.Parameter("s", "period", min=SHORTEST)
    n_period = gl.Parameter("1", "number of periods; negative: without end", default=-1.0)

    def over(self) -> Any:
        """Condition that all periods are over."""
        return gl.And(self.n_period >= 0, gl.time >= self.start_time + self.n_period * self.period)

    def between(self, begin: Any, end: Any) -> Any:
        """Condition that time is between ``begin`` and ``end`` (s after the start of a period); it switches at exact instants."""
        a, b = (alternates(self.period, self.start_time + since) for since in (begin, end))
        return gl.Or(gl.And(a, gl.Not(b)), gl.And(gl.Not(a), b))


class Pulse(PeriodicSource):
    """Pulses: ``y = offset + amplitude`` for the first ``width`` percent of each period, ``y = offset`` in the rest and before."""

    amplitude = gl.Parameter("any", "height of the pulses", default=1.0)
    width = gl.Parameter("1", "part of the period, percent", default=50.0, min=0, max=100)

    def equations(self) -> list[gl.Eq]:
        pulse = gl.Piecewise((0, self.over()), (self.amplitude, self.between(0, self.width * self.period / 100.0)), (0, True))
        return [gl.Eq(self.y, self.offset + pulse)]


class Trapezoid(PeriodicSource):
    """Trapezoidal pulses: a period that begins at ``T0`` rises by ``y = offset + amplitude (time - T0) / rising``, holds, falls, rests.

    It holds for ``width`` and falls for ``falling``.
    """

    amplitude = gl.Parameter("any", "height of the trapezoids", default=1.0)
    rising = gl.Parameter("s", "how long it rises", min=SHORTEST)
    width = gl.Parameter("s", "how long it stays up", min=0)
    falling = gl.Parameter("s", "how long it falls", min=SHORTEST)
    pause = gl.Parameter(
        "s", "rest of the period, which is not negative", min=0,
        default=lambda t: t.period * (1 + ROUNDING) - t.rising - t.width - t.falling,
    )  # fmt: skip
    T0 = gl.Discrete("start of the period")

    def equations(self) -> list[gl.Eq]:
        turn = 2 * gl.pi * (gl.time - self.start_time) / self.period
        angle = gl.atan2(gl.sin(turn), gl.cos(turn)) / (2 * gl.pi)
        since = self.period * gl.no_event(
            gl.Piecewise((angle, angle >= 0), (angle + 1, True))
        )  # if a run starts between instants
        instant, up, down = gl.sample(self.period, self.start_time), self.rising, self.rising + self.width
        rise = (gl.time - self.T0) / self.rising
        fall = 1 - (gl.time - self.T0 - down) / self.falling
        wave = gl.Piecewise(
            (0, self.over()), (rise, self.between(0, up)), (1, self.between(up, down)),
            (fall, self.between(down, down + self.falling)), (0, True),
        )  # fmt: skip
        return [
            gl.Eq(self.T0, gl.Piecewise((gl.time, instant), (gl.time - since, gl.initial()), (gl.pre(self.T0), True))),
            gl.Eq(self.y, self.offset + self.amplitude * wave),
        ]


class KinematicPTP(SO):
    """Acceleration of a time-optimal point-to-point motion within limits: ``y = qdd``.

    It begins at ``start_time``, accelerates with ``qdd_max`` to the speed ``qd_max``, continues at that speed, and brakes with
    ``-qdd_max``, so as to cover ``deltaq``; if ``deltaq`` is too short to reach that speed, it brakes half-way.
    """

    deltaq = gl.Parameter("any", "distance, with its sign", default=1.0)
    qd_max = gl.Parameter("any", "largest speed", default=1.0, min=SHORTEST)
    qdd_max = gl.Parameter("any", "largest acceleration", default=1.0, min=SHORTEST)
    start_time = gl.Parameter("s", "time at which it begins", default=0.0)
    t_accelerating = gl.Parameter(
        "s", "how long it accelerates", default=lambda p: gl.Min(p.qd_max / p.qdd_max, gl.sqrt(abs(p.deltaq) / p.qdd_max))
    )
    t_braking = gl.Parameter(
        "s", "when it begins to brake, after it began",
        default=lambda p: gl.Max(abs(p.deltaq) / p.qd_max, gl.sqrt(abs(p.deltaq) / p.qdd_max)),
    )  # fmt: skip

    def equations(self) -> list[gl.Eq]:
        begin, brake, most = self.start_time, self.start_time + self.t_braking, self.qdd_max * gl.sign(self.deltaq)
        acceleration = gl.Piecewise(
            (0, gl.time < begin), (most, gl.time < begin + self.t_accelerating), (0, gl.time < brake),
            (-most, gl.time < brake + self.t_accelerating), (0, True),
        )  # fmt: skip
        return [gl.Eq(self.y, acceleration)]
