"""User data of the SUNDIALS callbacks: the record shared by Python and compiled code."""

from __future__ import annotations

from gearlib.compiler.small_language import record
from gearlib.solvers.drive.drive_record import DriveRecord


@record
class IdaRecord(DriveRecord):
    """IDA's part of a run's record; all fields are initially zero."""

    # addresses: the model's
    jac: int
    # addresses: SUNDIALS functions
    array_pointer: int
    solve: int
    reinit: int
    calc_ic: int
    get_ic: int
    root_info: int
    set_stop: int
    get_dky: int
    get_steps: int
    ls_setup: int
    ls_solve: int
    # addresses: IDA's memory and its vectors: state, derivative, interpolated state
    mem: int
    yy: int
    yp: int
    yd: int
    # addresses: numbers and work space
    f: int
    y: int  # the states in IDA's order
    dy: int
    natural: int  # work space for states in the model's order, followed by x' if the model needs it
    differential: int
    order: int
    atol: int
    probe: int
    between: int
    # addresses: consistent start values: linear solver, its matrix, right-hand side and solution, previous values and scales
    linear_solver: int
    sun_matrix: int
    defect_vector: int
    change_vector: int
    defect: int
    change: int
    y_before: int
    dy_before: int
    scale: int
    part: int
    # addresses: the Jacobian, the iteration matrix, and the positions of the former's entries in the latter
    values: int
    matrix: int
    position: int
    diagonal: int
    pattern: int
    pattern_source: int
    starts: int
    starts_source: int
    # addresses: events
    sides: int
    before: int
    g: int
    later: int
    scratch: int
    counter: int
    # integers
    nnz: int
    n_matrix: int  # size of the iteration matrix's storage
    factorised: int  # whether a factorisation was begun
    implicit: int  # whether the model computes F(t, x, x')
    n_diagonal: int
    n_pattern: int
    n_algebraic: int
    done: int  # accepted steps
    look_at: int
    n_rhs: int
    n_jac: int
    earlier: int  # steps before IDA was restarted
    attempts: int
    restarts: int
    refused: int
    patience: int
    bad_state: int
    # floating-point numbers
    since: float  # time of IDA's last restart, the zero of its own time
    span: float
    ic_span: float
    attempt_time: float
    step_begin: float
    step_end: float
    bad_time: float
    rtol: float
    first_reach: float
    first_guess: float
    looked_t: float
