"""The involute function and its inverse."""

from __future__ import annotations

import math


def involute(alpha: float) -> float:
    """``tan(alpha) - alpha``, the polar angle of an involute at the pressure angle ``alpha`` (rad).

    Examples
    --------
    >>> round(involute(math.radians(20)), 8)
    0.01490438
    """
    return math.tan(alpha) - alpha


def involute_angle(value: float) -> float:
    """The pressure angle (rad) whose involute function is ``value``.

    Examples
    --------
    >>> round(math.degrees(involute_angle(involute(0.4))), 12) == round(math.degrees(0.4), 12)
    True
    """
    # tan(a) - a is more than a**3 / 3 and than tan(a) - pi / 2: from above Newton's method converges monotonically
    alpha = min(math.cbrt(3 * value), math.atan(value + math.pi / 2))
    for _ in range(60):
        step = (involute(alpha) - value) / math.tan(alpha) ** 2 if alpha else 0.0
        alpha -= step
        if abs(step) < 1e-15:
            break
    return alpha
