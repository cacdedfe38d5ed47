"""User data of the SUNDIALS callbacks: the record shared by Python and compiled code."""

from __future__ import annotations

import ctypes

from gearlib.compiler.small_language import record


@record
class IdaRecord(ctypes.Structure):
    """Addresses, whole numbers, reals; every field is zero at first."""

    # addresses: of the model
    rhs: int
    jac: int
    roots: int
    update: int
    # addresses: of SUNDIALS
    array_pointer: int
    solve: int
    reinit: int
    calc_ic: int
    get_ic: int
    root_info: int
    set_stop: int
    get_dky: int
    get_steps: int
    # addresses: IDA's memory and its vectors: state, derivative, state in between
    mem: int
    yy: int
    yp: int
    yd: int
    # addresses: numbers and work space
    data: int
    index: int
    x: int
    f: int
    y: int
    dy: int
    differential: int
    order: int
    atol: int
    probe: int
    between: int
    # addresses: the Jacobian, the iteration matrix, and where the one's entries stand in the other
    values: int
    matrix: int
    position: int
    diagonal: int
    pattern: int
    pattern_source: int
    starts: int
    starts_source: int
    # addresses: events
    fired: int
    sides: int
    before: int
    g: int
    later: int
    # addresses: samples and logs
    times: int
    out: int
    modes_out: int
    time_events: int
    event_times: int
    event_roots: int
    scratch: int
    counter: int
    # whole numbers
    n: int
    nnz: int
    n_diagonal: int
    n_pattern: int
    n_roots: int
    n_algebraic: int
    n_times: int
    n_time_events: int
    n_modes: int
    first_mode: int
    event_capacity: int
    started: int
    sample: int
    next_event: int
    events: int
    burst: int
    burst_limit: int
    max_steps: int
    pause_at: int
    done: int  # steps
    look_at: int
    flag: int
    n_rhs: int
    n_jac: int
    steps: int
    attempts: int
    restarts: int
    refused: int
    patience: int
    bad_state: int
    # reals
    t: float
    epoch: float  # s; all other times count from here, so that a late start takes no digits from them
    origin: float
    t_end: float
    window: float
    burst_start: float
    ic_span: float
    attempt_time: float
    step_begin: float
    step_end: float
    bad_time: float
    rtol: float
    first_reach: float
    first_guess: float
    slack: float
    looked_t: float
