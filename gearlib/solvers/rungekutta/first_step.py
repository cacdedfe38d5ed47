"""Initial step size and stiffness detection; inlined into ``loop``."""

from __future__ import annotations

import math

from gearlib.compiler.small_language import floats_at, native
from gearlib.native.layout import MODEL
from gearlib.solvers.rungekutta.record import LoopRecord
from gearlib.solvers.rungekutta.vectors import add_slope

__all__ = ["caution", "first_step", "is_damped", "is_stiff", "note"]

FADE = 0.9  # forgetting factor of the running means, which then extend over some ten steps
DAMPED = 0.7  # cosine of the angle between an eigenvalue and the negative real axis: 45 degrees
# Mean |h lambda| from which steps count as limited by stability, for order 5 and 8. Measured on x' = lambda (x - cos t) with the step
# control of ``step_size``: where stability limits the steps it is 3.5 and 6.4 for a decay, 2.2 and 5.5 at a damping ratio of 0.016; where
# accuracy limits them at most 1.1 and 4.2. Hairer's 3.25 and 6.1 for single steps would miss vibrations.
STIFF5, STIFF8 = 1.5, 4.5
# |h lambda| of an undamped vibration above which `caution` acts: just below the limit of 0.48 on the imaginary axis for order 5; half
# that limit, 5.96, for order 8.
NEAR5, NEAR8 = 0.45, 3.0


@native
def first_step(s: LoopRecord) -> float:
    """Hairer's initial step size: an Euler step and the curvature of the solution stay within the tolerance over it."""
    n: int = s.n
    h_max: float = s.h_max
    x, f, atol = floats_at(s.x), floats_at(s.k), floats_at(s.atol)
    d0 = d1 = d2 = 0.0
    for i in range(n):
        weight = 1.0 / (atol[i] + s.rtol * abs(x[i]))
        d0 += (x[i] * weight) ** 2
        d1 += (f[i] * weight) ** 2
    h0 = 0.01 * math.sqrt(d0 / d1) if d0 > 1e-10 * n and d1 > 1e-10 * n else 1e-6 * h_max
    h0 = min(h0, h_max)
    add_slope(s.x, h0, s.k, s.y, s.size)
    s.evaluations += 1
    if MODEL(s.rhs, s.origin + (s.t + h0), s.y, s.k + 8 * s.size, s.data, s.index) != 0:
        return 1e-3 * h0
    later = floats_at(s.k + 8 * s.size)
    for i in range(n):
        weight = 1.0 / (atol[i] + s.rtol * abs(x[i]))
        d2 += ((later[i] - f[i]) * weight) ** 2
    largest = max(math.sqrt(d1 / n), math.sqrt(d2 / n) / h0)
    if not largest < math.inf:
        return 1e-3 * h0
    h1 = max(1e-6 * h_max, 1e-3 * h0) if largest <= 1e-15 else (0.01 / largest) ** (1.0 / s.order)
    return min(100.0 * h0, h1, h_max)


@native
def note(s: LoopRecord) -> None:
    """Update running means, weighted towards recent steps, from the last two stages of a step.

    The two stages belong to the same time: their differences reveal the eigenvalue of the fastest motion, |h lambda| as in Hairer's
    codes, and by their angle its damping. In a single step both depend on the phase of a vibration and on the tolerances of its
    components; averaged over its phases they do so much less.
    """
    if s.slope < math.inf and s.move < math.inf:
        s.slopes = FADE * s.slopes + s.slope
        s.moves = FADE * s.moves + s.move
        s.products = FADE * s.products + s.product


@native
def is_damped(slope: float, move: float, product: float) -> bool:
    """Whether the fastest motion is a decay rather than a vibration."""
    return product < 0.0 and product * product > DAMPED * DAMPED * slope * move


@native
def is_stiff(s: LoopRecord) -> bool:
    """Whether stability limits the step size. A motion that fast has died out: where it is active, accuracy limits the step."""
    limit = STIFF5 if s.order == 5 else STIFF8
    return s.slopes > limit * limit * s.moves


@native
def caution(s: LoopRecord) -> float:
    """Factor (1 to 12) on the error for step-size control where a vibration approaches the stability limit.

    A fast vibration that the solution hardly contains grows there until the error estimate sees it: with Tsitouras' method to some 400
    times the tolerance. Inflating the estimate costs no steps, since stability limits them anyway, and keeps the vibration smaller.
    """
    near = NEAR5 if s.order == 5 else NEAR8
    share = s.slope / (near * near * s.move) if s.move > 0.0 else 0.0
    return 1.0 if not share > 1.0 or is_damped(s.slope, s.move, s.product) else min(12.0, share * share)
