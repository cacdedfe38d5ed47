"""Taylor polynomials of a step: coefficients, dense output, error; inlined into ``taylor_loop``.

``dense_output``, ``interpolate`` and ``last_stage`` are what `gearlib.solvers.rungekutta.root_finding` and ``within_step`` call.
"""

from __future__ import annotations

import math

from gearlib.compiler.small_language import block, blocks, floats_at, native, total
from gearlib.native.layout import MODEL
from gearlib.solvers.rungekutta.record import LoopRecord
from gearlib.solvers.taylor.series_record import SeriesRecord

__all__ = ["dense_output", "interpolate", "last_stage", "norm", "reach", "step_error"]


@native
def last_stage(s: LoopRecord) -> int:
    """Address of the right-hand side at the end of the step."""
    return s.k + 8 * s.size


@native
def dense_output(s: LoopRecord, t: float, h: float) -> None:
    """Nothing to do: the Taylor polynomial is the dense output."""


@native
def interpolate(s: LoopRecord, theta: float, h: float, y: int) -> None:
    """``y`` = Taylor polynomial at the fraction ``theta`` of the step, by Horner's rule."""
    c, out, size, order, u = floats_at(s.c), floats_at(y), s.size, s.order, theta * h
    for i in blocks(size):
        value = c[i + order * size]
        for k in range(order - 1, -1, -1):
            value = value * u + c[i + k * size]
        out[i] = value


@native
def norm(s: SeriesRecord, k: int) -> float:
    """Root mean square of the coefficients of order k relative to the tolerance."""
    x, c, atol, size, rtol, row = floats_at(s.x), floats_at(s.c), floats_at(s.atol), s.size, s.rtol, k * s.size
    squares = block(0.0)
    for i in blocks(size):
        e = c[i + row] / (atol[i] + rtol * abs(x[i]))
        squares += e * e
    return math.sqrt(total(squares) / s.n)


@native
def reach(size: float, before: float, k: int) -> float:
    """Step over which the term of order k stays within ``LAST`` tolerances, and the one before within ``LAST * DECAY``."""
    h = math.inf
    if size > 0.0:
        h = math.exp(math.log(LAST / size) / k)
    if before > 0.0:
        h = min(h, math.exp(math.log(LAST * DECAY / before) / (k - 1)))
    return h


LAST = 0.02  # largest last term of a step, in tolerances: errors of thousands of steps add up
DECAY = 5.0  # and that of the last but one, relative to it: both, since every other one may vanish


@native
def step_error(s: SeriesRecord, t: float, h: float) -> float:
    """Evaluate ``x_new`` and the right-hand side there; returns the estimated error relative to the tolerance, infinite where that fails.

    The defect, the derivative of the polynomial less the right-hand side, estimates the first term left out. It also reveals what the
    coefficients do not contain: a kink within the step, or a series that converges no further.
    """
    x, c, x_new, y = floats_at(s.x), floats_at(s.c), floats_at(s.x_new), floats_at(s.y)
    size, order = s.size, s.order
    for i in blocks(size):
        value = c[i + order * size]
        slope = 0.0 * value
        for k in range(order - 1, -1, -1):
            slope = slope * h + value
            value = value * h + c[i + k * size]
        x_new[i] = value
        y[i] = slope
    s.evaluations += 1
    code = MODEL(s.rhs, s.origin + (t + h), s.x_new, s.k + 8 * size, s.data, s.index)
    if code < 0:
        return -1.0
    if code > 0:
        return math.inf
    f, atol, rtol = floats_at(s.k + 8 * size), floats_at(s.atol), s.rtol
    squares = block(0.0)
    for i in blocks(size):
        e = (f[i] - y[i]) / (atol[i] + rtol * max(abs(x_new[i]), abs(x[i])))
        squares += e * e
    error = h / (order + 1) * math.sqrt(total(squares) / s.n)
    return error if error < math.inf else math.inf
