"""The linear combinations of a Runge-Kutta step, compiled as parts of the loop in ``rk_loop``.

``k[j]`` is the right-hand side at stage j. The formulas are written out: LLVM then keeps the coefficients as constants and works
on several states at once, at the speed of the same lines in C. ``noalias`` holds because no array is passed twice.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from gearlib.solve.tableaux import DOP853_A, DOP853_D, DOP853_E, TSIT5_A, TSIT5_E, TSIT5_R

__all__ = ["error5", "error8", "interpolate", "interpolation_weights", "stage5", "stage8"]

A5, E5 = TSIT5_A, TSIT5_E
A8, E8 = DOP853_A, DOP853_E
# sums may be reordered and fused, but not-a-number is kept: it is how a failed step is recognised
_FAST = {"contract", "reassoc", "nsz"}
_R5 = np.array(TSIT5_R)
_B8 = np.array(DOP853_A[12])
_D8 = np.array(DOP853_D)


@njit(error_model="numpy")  # type: ignore[untyped-decorator]
def _larger(a: float, b: float) -> float:
    a, b = abs(a), abs(b)
    return a if a > b else b


@njit(noalias=True, fastmath=_FAST, error_model="numpy")  # type: ignore[untyped-decorator]
def stage5(s: int, x: Any, h: float, k: Any, y: Any) -> None:
    """``y`` = argument of stage ``s`` of Tsitouras' method; stage 6 is the new state."""
    n = x.size
    if s == 1:
        for i in range(n):
            y[i] = x[i] + h * (A5[1][0] * k[0, i])
    elif s == 2:
        for i in range(n):
            y[i] = x[i] + h * (A5[2][0] * k[0, i] + A5[2][1] * k[1, i])
    elif s == 3:
        for i in range(n):
            y[i] = x[i] + h * (A5[3][0] * k[0, i] + A5[3][1] * k[1, i] + A5[3][2] * k[2, i])
    elif s == 4:
        for i in range(n):
            y[i] = x[i] + h * (A5[4][0] * k[0, i] + A5[4][1] * k[1, i] + A5[4][2] * k[2, i] + A5[4][3] * k[3, i])
    elif s == 5:
        for i in range(n):
            y[i] = x[i] + h * (
                A5[5][0] * k[0, i] + A5[5][1] * k[1, i] + A5[5][2] * k[2, i] + A5[5][3] * k[3, i] + A5[5][4] * k[4, i]
            )
    else:
        for i in range(n):
            y[i] = x[i] + h * (
                A5[6][0] * k[0, i] + A5[6][1] * k[1, i] + A5[6][2] * k[2, i] + A5[6][3] * k[3, i] + A5[6][4] * k[4, i]
                + A5[6][5] * k[5, i]
            )  # fmt: skip


@njit(noalias=True, fastmath=_FAST, error_model="numpy")  # type: ignore[untyped-decorator]
def error5(x: Any, x_new: Any, h: float, k: Any, atol: Any, rtol: float) -> float:
    """Root mean square of the error estimate over its tolerance."""
    total = 0.0
    for i in range(x.size):
        e = (
            E5[0] * k[0, i] + E5[1] * k[1, i] + E5[2] * k[2, i] + E5[3] * k[3, i] + E5[4] * k[4, i] + E5[5] * k[5, i]
            + E5[6] * k[6, i]
        )  # fmt: skip
        e /= atol[i] + rtol * _larger(x[i], x_new[i])
        total += e * e
    return abs(h) * math.sqrt(total / x.size)


@njit(noalias=True, fastmath=_FAST, error_model="numpy")  # type: ignore[untyped-decorator]
def stage8(s: int, x: Any, h: float, k: Any, y: Any) -> None:
    """``y`` = argument of stage ``s`` of DOP853; stage 12 is the new state, 13 to 15 serve the dense output."""
    n = x.size
    if s == 1:
        for i in range(n):
            y[i] = x[i] + h * (A8[1][0] * k[0, i])
    elif s == 2:
        for i in range(n):
            y[i] = x[i] + h * (A8[2][0] * k[0, i] + A8[2][1] * k[1, i])
    elif s == 3:
        for i in range(n):
            y[i] = x[i] + h * (A8[3][0] * k[0, i] + A8[3][2] * k[2, i])
    elif s == 4:
        for i in range(n):
            y[i] = x[i] + h * (A8[4][0] * k[0, i] + A8[4][2] * k[2, i] + A8[4][3] * k[3, i])
    elif s == 5:
        for i in range(n):
            y[i] = x[i] + h * (A8[5][0] * k[0, i] + A8[5][3] * k[3, i] + A8[5][4] * k[4, i])
    elif s == 6:
        for i in range(n):
            y[i] = x[i] + h * (A8[6][0] * k[0, i] + A8[6][3] * k[3, i] + A8[6][4] * k[4, i] + A8[6][5] * k[5, i])
    elif s == 7:
        for i in range(n):
            y[i] = x[i] + h * (
                A8[7][0] * k[0, i] + A8[7][3] * k[3, i] + A8[7][4] * k[4, i] + A8[7][5] * k[5, i] + A8[7][6] * k[6, i]
            )
    elif s == 8:
        for i in range(n):
            y[i] = x[i] + h * (
                A8[8][0] * k[0, i] + A8[8][3] * k[3, i] + A8[8][4] * k[4, i] + A8[8][5] * k[5, i] + A8[8][6] * k[6, i]
                + A8[8][7] * k[7, i]
            )  # fmt: skip
    elif s == 9:
        for i in range(n):
            y[i] = x[i] + h * (
                A8[9][0] * k[0, i] + A8[9][3] * k[3, i] + A8[9][4] * k[4, i] + A8[9][5] * k[5, i] + A8[9][6] * k[6, i]
                + A8[9][7] * k[7, i] + A8[9][8] * k[8, i]
            )  # fmt: skip
    elif s == 10:
        for i in range(n):
            y[i] = x[i] + h * (
                A8[10][0] * k[0, i] + A8[10][3] * k[3, i] + A8[10][4] * k[4, i] + A8[10][5] * k[5, i]
                + A8[10][6] * k[6, i] + A8[10][7] * k[7, i] + A8[10][8] * k[8, i] + A8[10][9] * k[9, i]
            )  # fmt: skip
    elif s == 11:
        for i in range(n):
            y[i] = x[i] + h * (
                A8[11][0] * k[0, i] + A8[11][3] * k[3, i] + A8[11][4] * k[4, i] + A8[11][5] * k[5, i]
                + A8[11][6] * k[6, i] + A8[11][7] * k[7, i] + A8[11][8] * k[8, i] + A8[11][9] * k[9, i]
                + A8[11][10] * k[10, i]
            )  # fmt: skip
    elif s == 12:
        for i in range(n):
            y[i] = x[i] + h * (
                A8[12][0] * k[0, i] + A8[12][5] * k[5, i] + A8[12][6] * k[6, i] + A8[12][7] * k[7, i]
                + A8[12][8] * k[8, i] + A8[12][9] * k[9, i] + A8[12][10] * k[10, i] + A8[12][11] * k[11, i]
            )  # fmt: skip
    elif s == 13:
        for i in range(n):
            y[i] = x[i] + h * (
                A8[13][0] * k[0, i] + A8[13][6] * k[6, i] + A8[13][7] * k[7, i] + A8[13][8] * k[8, i]
                + A8[13][9] * k[9, i] + A8[13][10] * k[10, i] + A8[13][11] * k[11, i] + A8[13][12] * k[12, i]
            )  # fmt: skip
    elif s == 14:
        for i in range(n):
            y[i] = x[i] + h * (
                A8[14][0] * k[0, i] + A8[14][5] * k[5, i] + A8[14][6] * k[6, i] + A8[14][7] * k[7, i]
                + A8[14][10] * k[10, i] + A8[14][11] * k[11, i] + A8[14][12] * k[12, i] + A8[14][13] * k[13, i]
            )  # fmt: skip
    else:
        for i in range(n):
            y[i] = x[i] + h * (
                A8[15][0] * k[0, i] + A8[15][5] * k[5, i] + A8[15][6] * k[6, i] + A8[15][7] * k[7, i]
                + A8[15][8] * k[8, i] + A8[15][12] * k[12, i] + A8[15][13] * k[13, i] + A8[15][14] * k[14, i]
            )  # fmt: skip


@njit(noalias=True, fastmath=_FAST, error_model="numpy")  # type: ignore[untyped-decorator]
def error8(x: Any, x_new: Any, h: float, k: Any, atol: Any, rtol: float) -> float:
    """Hairer's blend of the root mean squares of two estimates, of order 5 and 3, over their tolerance."""
    total3 = 0.0
    total5 = 0.0
    for i in range(x.size):
        e3 = (
            E8[0][0] * k[0, i] + E8[0][5] * k[5, i] + E8[0][6] * k[6, i] + E8[0][7] * k[7, i] + E8[0][8] * k[8, i]
            + E8[0][9] * k[9, i] + E8[0][10] * k[10, i] + E8[0][11] * k[11, i]
        )  # fmt: skip
        e5 = (
            E8[1][0] * k[0, i] + E8[1][5] * k[5, i] + E8[1][6] * k[6, i] + E8[1][7] * k[7, i] + E8[1][8] * k[8, i]
            + E8[1][9] * k[9, i] + E8[1][10] * k[10, i] + E8[1][11] * k[11, i]
        )  # fmt: skip
        weight = 1.0 / (atol[i] + rtol * _larger(x[i], x_new[i]))
        total3 += (e3 * weight) ** 2
        total5 += (e5 * weight) ** 2
    if total5 == 0.0:
        return 0.0
    return abs(h) * total5 / math.sqrt((total5 + 0.01 * total3) * x.size)


@njit(error_model="numpy")  # type: ignore[untyped-decorator]
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


@njit(noalias=True, fastmath=_FAST, error_model="numpy")  # type: ignore[untyped-decorator]
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
