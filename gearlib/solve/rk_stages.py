"""Stages, error estimates and dense output of the two Runge-Kutta methods, compiled as parts of the loop in ``rk_loop``.

Row j of ``s.k`` is the right-hand side at stage j, ``s`` being the record of ``rk_frame``.
"""

from __future__ import annotations

import math
from typing import Any

from gearlib.solve.native_call import inner
from gearlib.solve.rk_vectors import combiner, measurer, mover, polynomial, rows_of, stepper
from gearlib.solve.tableaux import DOP853_A, DOP853_C, DOP853_D, DOP853_E, TSIT5_A, TSIT5_C, TSIT5_E, TSIT5_R

__all__ = ["add_slope", "dense_output", "interpolate", "last_stage", "move", "step_error", "take_step"]

# Order 8's estimate is the square of one of order 5 over one of order 3. The former passes through zero now and then: below DIP
# times what the last steps' proportion of the two, which goes with h^4, lets expect, it is not believed. Where the latter has
# grown by more than KINK times beyond its h^4, the right-hand side has a kink, and the former may be of any size.
DIP, KINK = 0.1, 50.0
TINY = 1e-250  # below it arithmetic may be slow: a load that nothing has reached yet is at rest


_B8 = (*DOP853_A[12], 0.0, 0.0, 0.0, 0.0)
_START8 = [1.0] + [0.0] * 15
_BOTH8 = [1.0] + [0.0] * 11 + [1.0] + [0.0] * 3
# Hairer's nested form: theta (F0 + u (F1 + theta (F2 + u (F3 + theta (F4 + u (F5 + theta F6)))))), u = 1 - theta, in units of h
_F8 = (
    _B8,
    [k - b for k, b in zip(_START8, _B8, strict=True)],
    [2.0 * b - k for k, b in zip(_BOTH8, _B8, strict=True)],
    *DOP853_D,
)
_F5 = tuple(zip(*TSIT5_R, strict=True))

_step5 = stepper(TSIT5_A, TSIT5_C, 1, 6, 6)
_step8 = stepper(DOP853_A, DOP853_C, 1, 12, 12)
_more8 = stepper(DOP853_A, DOP853_C, 13, 15, 12)
_errors5, _errors8 = measurer((TSIT5_E,), 6), measurer(DOP853_E, 12)
_coefficients5, _coefficients8 = rows_of(_F5), rows_of(_F8)
_polynomial5, _polynomial8 = polynomial(4), polynomial(7)
add_slope: Any = combiner((1.0,))  # (x, h, f, y, size): y = x + h f
move: Any = mover(TINY)


@inner()
def last_stage(s: Any) -> int:
    """Address of the right-hand side at the end of the step."""
    address: int = s.k + 8 * s.size * (6 if s.order == 5 else 12)
    return address


@inner()
def take_step(s: Any, t: float, h: float) -> int:
    """Fill ``x_new`` and the stages of a step from ``x``, whose right-hand side is ``k[0]``; the code of a failing one."""
    s.dense = 0
    if s.order == 5:
        code: int = _step5(s.rhs, s.data, s.index, t, h, s.x, s.y, s.x_new, s.k, s.size)
        s.evaluations += 6
    else:
        code = _step8(s.rhs, s.data, s.index, t, h, s.x, s.y, s.x_new, s.k, s.size)
        s.evaluations += 12
    return code


@inner()
def _doubted(s: Any, h4: float, error: float, coarse: float) -> float:
    """The estimate, or more where the estimate of order 3 makes it incredible."""
    if not error < math.inf:
        return error
    s.ratio, s.rough = error / (coarse * h4) if coarse > 0.0 else 0.0, coarse / h4
    error = max(error, DIP * s.ratios * coarse * h4)
    if s.roughest > 0.0 and coarse > 1.0 and s.rough > KINK * s.roughest:
        error = max(error, s.rough / s.roughest)
    return error


@inner()
def step_error(s: Any, h: float) -> float:
    """Root mean square of the error estimate over its tolerance; for order 8 Hairer's blend of two, of order 3 and 5.

    The argument of the last stage but one, in ``y``, belongs to the same time as the last one. How these two differ, over the
    tolerance, is noted: the squares of h times the right-hand side and of the argument, and their scalar product.
    """
    if s.order == 5:
        total, slopes, moves, product = _errors5(s.x, s.x_new, s.y, s.k, s.atol, s.rtol, s.size)
        error: float = h * math.sqrt(total / s.n)
    else:
        total3, total, slopes, moves, product = _errors8(s.x, s.x_new, s.y, s.k, s.atol, s.rtol, s.size)
        error = h * total / math.sqrt((total + 0.01 * total3) * s.n) if total != 0.0 else 0.0
        error = _doubted(s, h**4, error, h * math.sqrt(total3 / s.n))
    s.slope, s.move, s.product = h * h * slopes, moves, h * product
    return error


@inner()
def dense_output(s: Any, t: float, h: float) -> None:
    """Make the polynomials of the dense output, of order 4 or 7, unless this was done for the step; three more stages for the latter."""
    if s.dense == 1:
        return
    s.dense = 1
    if s.order == 5:
        _coefficients5(s.k, s.c, s.size)
    else:
        _more8(s.rhs, s.data, s.index, t, h, s.x, s.y, s.x_new, s.k, s.size)
        s.evaluations += 3
        _coefficients8(s.k, s.c, s.size)


@inner()
def interpolate(s: Any, theta: float, h: float, y: int) -> None:
    """``y`` = dense output at the part ``theta`` of the step."""
    if s.order == 5:
        _polynomial5(s.x, h * theta, theta, theta, s.c, y, s.size)
    else:
        _polynomial8(s.x, h * theta, theta, 1.0 - theta, s.c, y, s.size)
