"""Taylor polynomials of a step: coefficients, dense output, error; inlined into ``taylor_loop``.

``dense_output``, ``interpolate`` and ``last_stage`` are what `gearlib.solvers.rungekutta.root_finding` and ``within_step`` call.
"""

from __future__ import annotations

import math

from gearlib.compiler.small_language import block, blocks, floats_at, native, total
from gearlib.solvers.rungekutta.record import LoopRecord
from gearlib.solvers.taylor.series_record import SeriesRecord

__all__ = ["defect", "dense_output", "evaluate", "interpolate", "last_stage", "norm", "product", "reach", "weigh"]


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
def weigh(s: SeriesRecord) -> None:
    """``weights`` = reciprocals of the tolerances of the states at the start of the step."""
    x, atol, weights, rtol = floats_at(s.x), floats_at(s.atol), floats_at(s.weights), s.rtol
    for i in blocks(s.size):
        weights[i] = 1.0 / (atol[i] + rtol * abs(x[i]))


@native
def norm(s: SeriesRecord, k: int) -> float:
    """Root mean square of the coefficients of order k relative to the tolerance."""
    c, weights, size, row = floats_at(s.c), floats_at(s.weights), s.size, k * s.size
    squares = block(0.0)
    for i in blocks(size):
        e = c[i + row] * weights[i]
        squares += e * e
    return math.sqrt(total(squares) / s.n)


@native
def product(s: SeriesRecord) -> float:
    """Mean product of the last two coefficients relative to the tolerance: negative for a decay."""
    c, weights, size, row = floats_at(s.c), floats_at(s.weights), s.size, s.order * s.size
    products = block(0.0)
    for i in blocks(size):
        products += c[i + row] * weights[i] * (c[i + row - size] * weights[i])
    return total(products) / s.n


@native
def reach(size: float, before: float, k: int) -> float:
    """Step over which the term of order k stays within ``LAST`` tolerances, and the one before within ``LAST * DECAY``."""
    exponent = math.inf
    if size > 0.0:
        exponent = math.log(LAST / size) / k
    if before > 0.0:
        exponent = min(exponent, math.log(LAST * DECAY / before) / (k - 1))
    return math.exp(exponent)


LAST = 0.02  # largest last term of a step, in tolerances: errors of thousands of steps add up
DECAY = 5.0  # and that of the last but one, relative to it: both, since every other one may vanish


@native
def evaluate(s: SeriesRecord, h: float, x: int, slopes: int) -> None:
    """``x`` = Taylor polynomial at ``h`` from the start of the step, and ``slopes`` its derivative."""
    c, values, rates, size, order = floats_at(s.c), floats_at(x), floats_at(slopes), s.size, s.order
    for i in blocks(size):
        value = c[i + order * size]
        slope = 0.0 * value
        for k in range(order - 1, -1, -1):
            slope = slope * h + value
            value = value * h + c[i + k * size]
        values[i] = value
        rates[i] = slope


@native
def defect(s: SeriesRecord, h: float, slopes: int) -> float:
    """Estimated error of the step over the tolerance, from ``y`` and the right-hand side at its end; infinite if not finite.

    The defect, the derivative of the polynomial less the right-hand side, estimates the first term left out. It also reveals what the
    coefficients do not contain: a kink within the step, or a series that converges no further.
    """
    f, y, weights, size, squares = floats_at(slopes), floats_at(s.y), floats_at(s.weights), s.size, block(0.0)
    for i in blocks(size):
        e = (f[i] - y[i]) * weights[i]
        squares += e * e
    error = h / (s.order + 1) * math.sqrt(total(squares) / s.n)
    return error if error < math.inf else math.inf
