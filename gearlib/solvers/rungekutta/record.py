"""State record of the explicit Runge-Kutta stepper, filled in by Python.

Passing an array to compiled code takes a microsecond, and a run of a small model takes fifty: it gets one address instead.
"""

from __future__ import annotations

from gearlib.compiler.small_language import record
from gearlib.solvers.drive.drive_record import DriveRecord

__all__ = ["LoopRecord"]


@record
class LoopRecord(DriveRecord):
    """The stepper's own part; every field is zero at first."""

    # addresses of vectors; rows: stages, coefficients of the dense output
    x_new: int
    y: int
    atol: int
    k: int
    c: int
    # addresses of what event functions need, see ``root_finding``
    phases: int
    g: int
    side: int
    order: int
    size: int  # states in whole blocks
    detect: int  # whether to look for stiffness, and
    detect_from: int  # after so many steps
    stiff_first: int  # the step with which the present stiffness began, the number of events and (`stiff_t`) the time there
    stiff_events: int
    rejected: int
    evaluations: int
    stiff_steps: int
    calm_steps: int
    retry: int
    patience: int
    dense: int  # whether ``c`` is that of the step
    fresh: int  # no step accepted since the last restart
    known: int  # see ``step_size``
    next_phase: int
    rtol: float
    span: float
    h_max: float
    h: float
    h_step: float  # of the step that was taken last
    h_before_event: float
    h_cut: float
    log_error: float
    # of the step, and the largest of the last ones: see ``stages.step_error``
    ratio: float
    ratios: float
    rough: float
    roughest: float
    # what the last two stages of the step say, and their means: see ``first_step.note``
    slope: float
    move: float
    product: float
    slopes: float
    moves: float
    products: float
    stiff_t: float
