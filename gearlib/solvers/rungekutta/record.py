"""State record of the explicit Runge-Kutta stepper, filled in by Python.

Passing an array to compiled code takes a microsecond, and a whole run of a small model fifty, so a single address is passed instead.
"""

from __future__ import annotations

from gearlib.compiler.small_language import record
from gearlib.solvers.drive.drive_record import DriveRecord

__all__ = ["LoopRecord"]


@record
class LoopRecord(DriveRecord):
    """The stepper's part of the record; all fields are initially zero."""

    # addresses of vectors; rows: stages, coefficients of the dense output
    x_new: int
    y: int
    atol: int
    k: int
    c: int
    # addresses of arrays for event location, see ``root_finding``
    phases: int
    g: int
    side: int
    order: int
    size: int  # number of states, padded to blocks
    detect: int  # whether to detect stiffness,
    detect_from: int  # from this step on
    stiff_first: int  # the step with which the current stiffness began; the number of events and (`stiff_t`) the time then
    stiff_events: int
    rejected: int
    evaluations: int
    stiff_steps: int
    calm_steps: int
    retry: int
    patience: int
    dense: int  # whether ``c`` belongs to the current step
    fresh: int  # no step accepted since the last restart
    known: int  # see ``step_size``
    unknown: int  # whether event functions could not be evaluated where the current step needs them
    resting: int  # whether one of them comes to rest at zero in the current step
    next_phase: int
    rtol: float
    span: float
    h_max: float
    h: float
    h_step: float  # size of the last step taken
    h_before_event: float
    h_cut: float
    log_error: float
    # of the current step, and the largest of recent ones: see ``stages.step_error``
    ratio: float
    ratios: float
    rough: float
    roughest: float
    # from the last two stages of the step, and their running means: see ``first_step.note``
    slope: float
    move: float
    product: float
    slopes: float
    moves: float
    products: float
    stiff_t: float
