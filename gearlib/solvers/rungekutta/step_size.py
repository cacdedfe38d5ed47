"""Step-size control, and warm starts of the step size after events; inlined into ``loop``.

Between two events the discrete state is constant, and the same phase often recurs: contact, flight, contact. The step size that suited
the beginning of a phase is remembered with its discrete state. An unknown phase begins with a fraction of the previous step.
"""

from __future__ import annotations

import math

from gearlib.compiler.small_language import floats_at, native
from gearlib.solvers.rungekutta.first_step import caution
from gearlib.solvers.rungekutta.record import LoopRecord

__all__ = ["adapt", "begin_phase"]

PHASES = 8  # phases remembered
UNKNOWN = 0.2  # fraction of the last step with which an unknown phase begins
# Logarithm of the target error for the first step of a phase. The estimate of a single step may be small by chance, all the more so for
# a long step, and a remembered step is used hundreds of times.
AIM5, AIM8 = -2.0, -5.0
SMALL = math.log(1e-4)  # smaller errors count as this, or one step much too small would keep all later ones small
GROWTH_KNOWN, GROWTH_SECOND = 1.1, 1.2  # growth of the remembered step, and from the first step of a phase to the second


@native
def _signature(s: LoopRecord) -> float:
    """A hash of the discrete state."""
    discrete, total = floats_at(s.data + 8 * s.first_discrete), 0.0
    for i in range(s.n_discrete):
        total += (1.0 + 0.6180339887 * i) * discrete[i]
    return total


@native
def _find(s: LoopRecord, signature: float) -> int:
    """Index of the phase with this discrete state; -1 if there is none."""
    known = floats_at(s.phases)
    for i in range(PHASES):
        if known[PHASES + i] > 0.0 and known[i] == signature:
            return i
    return -1


@native
def begin_phase(s: LoopRecord, changed: bool) -> None:
    """Choose the first step after an event: that of an earlier phase with the same discrete state, if it changed."""
    before = s.h_before_event
    s.h_before_event = s.h
    s.h = min(s.h, before)
    if changed:
        place = _find(s, _signature(s))
        s.fresh, s.known = 1, place >= 0
        s.h = floats_at(s.phases)[PHASES + place] if place >= 0 else UNKNOWN * s.h


@native
def _remember(s: LoopRecord, h: float) -> None:
    signature = _signature(s)
    place, known = _find(s, signature), floats_at(s.phases)
    if place < 0:
        place = s.next_phase
        s.next_phase = (place + 1) % PHASES
    known[place], known[PHASES + place] = signature, h


@native
def adapt(s: LoopRecord, h: float, error: float) -> bool:
    """Choose the next step size; returns whether the step is accepted.

    PI control (Gustafsson, 1991): h grows with error^-alpha, damped by the error of the previous step. With his alpha = 0.7 / order and
    beta = 0.4 / order hardly a step is rejected, and steps at the stability limit are much more accurate than with alpha = 1 / order and
    beta = 0.
    """
    if not error <= 1.0:
        s.rejected += 1
        s.retry = 1
        s.h = h * (max(0.2, 0.9 * error ** (-1.0 / s.order)) if error < math.inf else 0.25)
        return False
    log_error = math.log(max(error * caution(s), 1e-10))
    if s.fresh == 1:
        s.fresh = 0
        growth = min(10.0, max(0.2, math.exp(((AIM5 if s.order == 5 else AIM8) - log_error) / s.order)))
        if h >= s.h:
            _remember(s, h * min(growth, 1.0 if s.retry == 1 else (GROWTH_KNOWN if s.known == 1 else 10.0)))
        if log_error > SMALL:
            growth = min(growth, GROWTH_SECOND)
    else:
        alpha, beta = 0.14 if s.order == 5 else 0.0875, 0.08 if s.order == 5 else 0.05
        growth = min(10.0, max(0.2, 0.9 * math.exp(beta * s.log_error - alpha * log_error)))
    if s.retry == 1:
        growth = min(growth, 1.0)
    # a step cut short to meet a stop says nothing against the size wanted before
    s.h = max(h * growth, s.h) if h < s.h else h * growth
    s.log_error = max(log_error, SMALL)
    s.ratios, s.roughest = max(s.ratio, 0.2 * s.ratios), max(s.rough, 0.5 * s.roughest)  # see ``stages._doubted``
    s.retry = 0
    return True
