"""State record of the Taylor stepper, filled in by Python."""

from __future__ import annotations

from gearlib.compiler.small_language import record
from gearlib.solvers.rungekutta.record import LoopRecord

__all__ = ["SeriesRecord"]


@record
class SeriesRecord(LoopRecord):
    """The stepper's part of the record; ``c`` holds the Taylor coefficients, a row per order, and ``order`` the current order."""

    series: int  # addresses of the function for the coefficients, of its work space, and of the norms of the rows
    work: int
    norms: int
    weights: int  # address of the reciprocals of the tolerances
    ahead: int  # address of the coefficients at the end of the step, those of the next one
    order_ahead: int
    next_order: int  # order of the next expansion
    highest: int  # order
    ready: int  # whether ``ahead`` belongs to the states at which the next step begins
    guarded: int  # whether only the right-hand side itself notices divisors that change sign
    looks: int  # whether the right-hand side is looked at within each step, where coefficients do not show all that happens
    compared: int  # number of differences whose sign chooses between expressions, and the place of the first one's coefficients
    compared_at: int
    expansions: int  # coefficients computed, counted in orders
    looked: int  # steps since the order was chosen
    since: int  # steps since the last event
    # cost of a step besides its coefficients, of an order, and of an order per order before it, ns
    cost_step: float
    cost_order: float
    cost_product: float
    cosine: float  # of the angle between the last two coefficients
