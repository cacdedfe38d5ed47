"""The linear combinations of a Runge-Kutta step, compiled as parts of the loop in ``rk_loop``.

``k[j]`` is the right-hand side at stage j. Each combination is one loop over the states with the coefficients as constants,
which LLVM turns into vector instructions.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending, types

from gearlib.solve.native_call import inner
from gearlib.solve.tableaux import DOP853_A, DOP853_D, DOP853_E, TSIT5_A, TSIT5_E, TSIT5_R

__all__ = ["error5", "error8", "interpolate", "interpolation_weights", "stage5", "stage8"]

_TABLES = (TSIT5_A, DOP853_A, (TSIT5_E,), DOP853_E)
A5, A8, E5, E8 = range(4)
_R5 = np.array(TSIT5_R)
_B8 = np.array(DOP853_A[12])
_D8 = np.array(DOP853_D)
# sums may be reordered and fused, but not-a-number is kept: it is how a failed step is recognised
_FAST = {"contract", "reassoc", "nsz"}


def _make_sum(typing_context: Any, table: Any, row: Any, k: Any, i: Any) -> Any:
    """``_sum(table, row, k, i)``: ``sum_j a[j] k[j, i]`` over the coefficients a, not zero, of a row of a table, both literal.

    Written out in Python, the 150 products of both methods take numba 10 s longer to compile.
    """
    coefficients = _TABLES[table.literal_value][row.literal_value]

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[2])(context, builder, arguments[2])
        columns = builder.extract_value(array.shape, 1)
        total = None
        for j, a in enumerate(coefficients):
            if a != 0.0:
                place = builder.add(builder.mul(columns, ir.Constant(columns.type, j)), arguments[3])
                value = builder.load(builder.gep(array.data, [place], inbounds=True))
                product = builder.fmul(ir.Constant(ir.DoubleType(), a), value, flags=("contract",))
                total = product if total is None else builder.fadd(total, product, flags=("contract",))
        return total

    return types.float64(table, row, k, types.intp), generate


_intrinsic: Any = extending.intrinsic
_sum: Any = _intrinsic(prefer_literal=True)(_make_sum)


@inner()
def _larger(a: float, b: float) -> float:
    a, b = abs(a), abs(b)
    return a if a > b else b


@inner(fastmath={"contract"})
def stage5(s: int, x: Any, h: float, k: Any, y: Any) -> None:
    """``y`` = argument of stage ``s`` of Tsitouras' method; stage 6 is the new state."""
    n = x.size
    if s == 1:
        for i in range(n):
            y[i] = x[i] + h * _sum(A5, 1, k, i)
    elif s == 2:
        for i in range(n):
            y[i] = x[i] + h * _sum(A5, 2, k, i)
    elif s == 3:
        for i in range(n):
            y[i] = x[i] + h * _sum(A5, 3, k, i)
    elif s == 4:
        for i in range(n):
            y[i] = x[i] + h * _sum(A5, 4, k, i)
    elif s == 5:
        for i in range(n):
            y[i] = x[i] + h * _sum(A5, 5, k, i)
    else:
        for i in range(n):
            y[i] = x[i] + h * _sum(A5, 6, k, i)


@inner(fastmath={"contract"})
def stage8(s: int, x: Any, h: float, k: Any, y: Any) -> None:
    """``y`` = argument of stage ``s`` of DOP853; stage 12 is the new state, 13 to 15 serve the dense output."""
    n = x.size
    if s == 1:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 1, k, i)
    elif s == 2:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 2, k, i)
    elif s == 3:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 3, k, i)
    elif s == 4:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 4, k, i)
    elif s == 5:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 5, k, i)
    elif s == 6:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 6, k, i)
    elif s == 7:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 7, k, i)
    elif s == 8:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 8, k, i)
    elif s == 9:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 9, k, i)
    elif s == 10:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 10, k, i)
    elif s == 11:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 11, k, i)
    elif s == 12:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 12, k, i)
    elif s == 13:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 13, k, i)
    elif s == 14:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 14, k, i)
    else:
        for i in range(n):
            y[i] = x[i] + h * _sum(A8, 15, k, i)


@inner(fastmath=_FAST)
def error5(x: Any, x_new: Any, h: float, k: Any, y: Any, atol: Any, rtol: float, last: Any) -> float:
    """Root mean square of the error estimate over its tolerance.

    ``y`` is the argument of the last stage but one, which belongs to the same time as the last one. ``last`` gets how these two
    differ, over the tolerance: the squares of h times the right-hand side and of the argument, and their scalar product.
    """
    total = slopes = moves = product = 0.0
    for i in range(x.size):
        weight = 1.0 / (atol[i] + rtol * _larger(x[i], x_new[i]))
        total += (weight * _sum(E5, 0, k, i)) ** 2
        slope, move = weight * (k[6, i] - k[5, i]), weight * (x_new[i] - y[i])
        slopes += slope * slope
        moves += move * move
        product += slope * move
    last[0], last[1], last[2] = h * h * slopes, moves, h * product
    return h * math.sqrt(total / x.size)


@inner(fastmath=_FAST)
def error8(x: Any, x_new: Any, h: float, k: Any, y: Any, atol: Any, rtol: float, last: Any) -> float:
    """Hairer's blend of the root mean squares of two estimates, of order 3 and 5, over their tolerance; ``last`` as above."""
    total3 = total5 = slopes = moves = product = 0.0
    for i in range(x.size):
        weight = 1.0 / (atol[i] + rtol * _larger(x[i], x_new[i]))
        total3 += (weight * _sum(E8, 0, k, i)) ** 2
        total5 += (weight * _sum(E8, 1, k, i)) ** 2
        slope, move = weight * (k[12, i] - k[11, i]), weight * (x_new[i] - y[i])
        slopes += slope * slope
        moves += move * move
        product += slope * move
    last[0], last[1], last[2] = h * h * slopes, moves, h * product
    if total5 == 0.0:
        return 0.0
    return h * total5 / math.sqrt((total5 + 0.01 * total3) * x.size)


@inner()
def interpolation_weights(order: int, theta: float, b: Any) -> None:
    """``b`` = weights of the stages in the dense output at ``t + theta h``."""
    if order == 5:
        for i in range(7):
            b[i] = theta * (_R5[i, 0] + theta * (_R5[i, 1] + theta * (_R5[i, 2] + theta * _R5[i, 3])))
        return
    # nested form of Hairer et al.: theta (F0 + u (F1 + theta (F2 + u (F3 + theta (F4 + u (F5 + theta F6)))))), u = 1 - theta
    u = 1.0 - theta
    p0 = theta
    p1 = p0 * u
    p2 = p1 * theta
    p3 = p2 * u
    p4 = p3 * theta
    p5 = p4 * u
    p6 = p5 * theta
    for i in range(16):
        b[i] = p3 * _D8[0, i] + p4 * _D8[1, i] + p5 * _D8[2, i] + p6 * _D8[3, i]
        if i < 12:
            b[i] += (p0 - p1 + 2.0 * p2) * _B8[i]
    b[0] += p1 - p2
    b[12] -= p2


@inner(fastmath=_FAST)
def interpolate(order: int, x: Any, h: float, k: Any, b: Any, y: Any) -> None:
    """``y`` = dense output with the weights ``b``."""
    if order == 5:
        for i in range(x.size):
            y[i] = x[i] + h * (
                b[0] * k[0, i] + b[1] * k[1, i] + b[2] * k[2, i] + b[3] * k[3, i] + b[4] * k[4, i] + b[5] * k[5, i]
                + b[6] * k[6, i]
            )  # fmt: skip
    else:
        for i in range(x.size):
            y[i] = x[i] + h * (
                b[0] * k[0, i] + b[5] * k[5, i] + b[6] * k[6, i] + b[7] * k[7, i] + b[8] * k[8, i] + b[9] * k[9, i]
                + b[10] * k[10, i] + b[11] * k[11, i] + b[12] * k[12, i] + b[13] * k[13, i] + b[14] * k[14, i]
                + b[15] * k[15, i]
            )  # fmt: skip
