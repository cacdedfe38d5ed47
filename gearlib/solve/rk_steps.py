"""One Runge-Kutta step, the first step size, and the sign of stiffness; compiled as parts of the loop in ``rk_loop``.

``native`` holds addresses: right-hand side, roots, update, data, index.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gearlib.solve.native_call import call_native, inner
from gearlib.solve.rk_stages import stage5, stage8
from gearlib.solve.tableaux import DOP853_C, TSIT5_C

__all__ = ["caution", "dense_stages", "first_step", "is_damped", "is_stiff", "note", "take_step"]

_C5 = np.array(TSIT5_C)
_C8 = np.array(DOP853_C)
FADE = 0.9  # of the means over some steps
DAMPED = 0.7  # cosine of the angle between an eigenvalue and the negative real axis


@inner()
def take_step(order: int, native: Any, t: float, h: float, x: Any, x_new: Any, k: Any, y: Any) -> int:
    """Fill ``x_new`` and the stages of a step from ``x``, whose right-hand side is ``k[0]``; the code of a failing one."""
    row = k.strides[0]
    k0, y0, new = k.ctypes.data, y.ctypes.data, x_new.ctypes.data
    if order == 5:
        for s in range(1, 6):
            stage5(s, x, h, k, y)
            code: int = call_native(native[0], t + _C5[s] * h, y0, k0 + s * row, native[3], native[4])
            if code != 0:
                return code
        stage5(6, x, h, k, x_new)
        code = call_native(native[0], t + h, new, k0 + 6 * row, native[3], native[4])
        return code
    for s in range(1, 12):
        stage8(s, x, h, k, y)
        code = call_native(native[0], t + _C8[s] * h, y0, k0 + s * row, native[3], native[4])
        if code != 0:
            return code
    stage8(12, x, h, k, x_new)
    code = call_native(native[0], t + h, new, k0 + 12 * row, native[3], native[4])
    return code


@inner()
def dense_stages(order: int, native: Any, t: float, h: float, x: Any, k: Any, y: Any) -> int:
    """Evaluate the stages that only the dense output of order 7 needs; returns how many right-hand sides that took."""
    if order == 5:
        return 0
    for s in range(13, 16):
        stage8(s, x, h, k, y)
        call_native(native[0], t + _C8[s] * h, y.ctypes.data, k.ctypes.data + s * k.strides[0], native[3], native[4])
    return 3


@inner()
def first_step(order: int, native: Any, t: float, x: Any, k: Any, y: Any, atol: Any, rtol: float, h_max: float) -> float:
    """Hairer's guess: the step over which an Euler step and the curvature of the solution stay within the tolerance."""
    n = x.size
    d0 = d1 = d2 = 0.0
    for i in range(n):
        weight = 1.0 / (atol[i] + rtol * abs(x[i]))
        d0 += (x[i] * weight) ** 2
        d1 += (k[0, i] * weight) ** 2
    h0 = 0.01 * math.sqrt(d0 / d1) if d0 > 1e-10 * n and d1 > 1e-10 * n else 1e-6 * h_max
    h0 = min(h0, h_max)
    for i in range(n):
        y[i] = x[i] + h0 * k[0, i]
    row = k.ctypes.data + k.strides[0]
    if call_native(native[0], t + h0, y.ctypes.data, row, native[3], native[4]) != 0:
        return 1e-3 * h0
    for i in range(n):
        weight = 1.0 / (atol[i] + rtol * abs(x[i]))
        d2 += ((k[1, i] - k[0, i]) * weight) ** 2
    largest = max(math.sqrt(d1 / n), math.sqrt(d2 / n) / h0)
    if not largest < math.inf:
        return 1e-3 * h0
    h1 = max(1e-6 * h_max, 1e-3 * h0) if largest <= 1e-15 else (0.01 / largest) ** (1.0 / order)
    return min(100.0 * h0, h1, h_max)


@inner()
def note(mean: Any, last: Any) -> None:
    """Take what the last two stages of a step say into the means over some steps, the last ones most.

    The stages belong to the same time: their differences show the fastest motion's eigenvalue, |h lambda| as in Hairer's codes,
    and by their angle how well it is damped. In one step both depend on the phase of a vibration and on the tolerances of its
    parts; in the mean over its phases they do so much less.
    """
    if last[0] < math.inf and last[1] < math.inf:
        for i in range(3):
            mean[i] = FADE * mean[i] + last[i]


@inner()
def is_damped(sums: Any) -> bool:
    """Whether the fastest motion is a decay rather than a vibration."""
    return bool(sums[2] < 0.0 and sums[2] * sums[2] > DAMPED * DAMPED * sums[0] * sums[1])


@inner()
def is_stiff(order: int, mean: Any) -> bool:
    """Whether stability limits the step. A motion as fast as this has died away: where it is alive, accuracy limits the step."""
    limit = 1.5 if order == 5 else 4.5
    return bool(mean[0] > limit * limit * mean[1])


@inner()
def caution(order: int, last: Any) -> float:
    """What the choice of the next step takes the error times where a vibration comes near the limit of stability; 1 to 12.

    A fast vibration that the solution hardly contains grows there until the estimate sees it: with Tsitouras' method to some
    400 times the tolerance. A sharper estimate costs no steps, since stability limits them all the same, and keeps it smaller.
    """
    near = 0.45 if order == 5 else 3.0
    share = last[0] / (near * near * last[1]) if last[1] > 0.0 else 0.0
    return 1.0 if not share > 1.0 or is_damped(last) else min(12.0, share * share)
