"""Stable gains of a loop: intervals between the gains at which its Nyquist curve meets -1, decided by eigenvalues."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearlib.feedback.feedback_loop import Loop
from gearlib.feedback.margins import PhaseCrossing
from gearlib.linear.poles import poles


def stable_gains(loop: Loop, crossings: Sequence[PhaseCrossing]) -> tuple[tuple[float, float], ...]:
    """Intervals of gain factors without closed-loop poles in the right half-plane.

    Parameters
    ----------
    loop : Loop
    crossings : sequence of PhaseCrossing
        All crossings of the negative real axis, as found by `margins`: only at these gains do poles cross the imaginary axis.

    Returns
    -------
    tuple of (float, float)
        From 0 to infinity, sorted; adjacent intervals are merged.

    Examples
    --------
    >>> import control
    >>> from gearlib.feedback.feedback_loop import as_loop
    >>> from gearlib.feedback.margins import margins
    >>> loop = as_loop(control.tf([1], [1, 2, 1, 0]))       # k / (s (s + 1)^2) is stable up to k = 2
    >>> [(low, round(high, 9)) for low, high in stable_gains(loop, margins(loop).phase_crossings)]
    [(0.0, 2.0)]
    """
    edges = [0.0, *sorted({c.gain_margin for c in crossings if 0 < c.gain_margin < np.inf}), np.inf]
    found: list[tuple[float, float]] = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        # as near to 1 as it is clear of the ends: poles of an extreme gain are lost in the rounding of its fastest ones
        factor = float(np.clip(1.0, 2 * low, high / 2)) if high > 4 * low else float(np.sqrt(low * high))
        if not poles(loop.closed(factor)).right:
            joined = found and found[-1][1] == low
            found[-1:] = [(found[-1][0], high)] if joined else [*found[-1:], (low, high)]
    return tuple(found)


def gains_in_words(ranges: Sequence[tuple[float, float]]) -> str:
    """A line for the report; the present gain is 1.

    >>> gains_in_words([(0.0, 2.0), (5.0, float("inf"))])
    'stable for less than 2 (+6.021 dB), and for more than 5 (+13.979 dB) times the present gain'
    """
    if not ranges:
        return "no positive gain makes it stable"
    if ranges[0] == (0.0, np.inf):
        return "stable for every positive gain"
    return f"stable for {', and for '.join(_between(low, high) for low, high in ranges)} times the present gain"


def _between(low: float, high: float) -> str:
    if not low:
        return f"less than {_factor(high)}"
    return f"more than {_factor(low)}" if high == np.inf else f"{_factor(low)} to {_factor(high)}"


def _factor(value: float) -> str:
    return f"{value:.6g} ({20 * np.log10(value):+.3f} dB)"
