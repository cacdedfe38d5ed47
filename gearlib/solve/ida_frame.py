"""The record that SUNDIALS hands to every callback of `ida_compiled` as its user data: addresses, whole numbers, reals."""

from __future__ import annotations

import numpy as np

_addresses = [
    "rhs", "jac", "roots", "update",  # the model
    "array_pointer", "solve", "reinit", "calc_ic", "get_ic", "root_info", "set_stop", "set_max_steps", "get_steps",  # SUNDIALS
    "mem", "yy", "yp",
    "data", "index", "x", "f", "y", "dy", "differential", "order", "atol", "probe",
    "values", "matrix", "position", "diagonal", "pattern", "pattern_source", "starts", "starts_source",
    "fired", "sides", "before", "g", "later", "times", "out", "modes_out", "time_events", "event_times", "event_roots", "scratch",
    "counter",
]  # fmt: skip
_integers = [
    "n", "nnz", "n_diagonal", "n_pattern", "n_roots", "n_algebraic", "n_times", "n_time_events", "n_modes", "first_mode",
    "event_capacity", "started", "sample", "next_event", "events", "burst", "burst_limit", "max_steps", "flag",
    "n_rhs", "n_jac", "steps", "attempts", "restarts", "refused", "patience", "bad_state",
]  # fmt: skip
_reals = [
    "t", "origin", "t_end", "window", "burst_start", "ic_span", "attempt_time", "step_begin", "step_end", "bad_time", "rtol",
    "first_reach", "first_guess", "slack",
]  # fmt: skip

FRAME = np.dtype([(name, np.int64) for name in _addresses + _integers] + [(name, np.float64) for name in _reals])
