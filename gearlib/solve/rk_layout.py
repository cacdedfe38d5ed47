"""What the Runge-Kutta loop works on: one record of numbers and addresses, filled in Python.

Passing an array to compiled code takes a microsecond, and a run of a small model takes fifty: the loop gets one address instead.
"""

from __future__ import annotations

import ctypes

__all__ = ["BLOCK", "Frame"]

BLOCK = 4  # states are handled in blocks of so many, see ``rk_vectors``
_ADDRESSES = (
    "rhs", "roots", "update", "data", "index",  # the model; 0: none
    "x", "x_new", "y", "atol", "k", "c", "past",  # states; rows: stages, coefficients of the dense output
    "phases", "g", "side", "fired",  # event functions, see ``rk_events``
    "times", "stops", "out", "modes", "log_t", "log_root",
)  # fmt: skip
_INTEGERS = (
    "order", "n", "size",  # states, the same in whole blocks
    "n_roots", "n_times", "n_stops", "n_timed", "n_modes", "first_mode",  # the first stops are time events, a last one may be an end
    "capacity", "budget", "detect",  # of the event log; steps to take before returning; whether to look for stiffness
    "started", "sample", "stop", "steps", "rejected", "evaluations", "events", "stiff_steps", "calm_steps", "n_past", "retry", "patience",
    "dense",  # whether ``c`` is that of the step
    "fresh", "known", "next_phase",  # no step accepted since the last restart; see ``rk_phases``
)  # fmt: skip
_REALS = (
    "rtol", "span", "h_max", "t", "h", "h_held", "h_cut", "log_error",
    "ratio", "ratios", "rough", "roughest",  # of the step, and the largest of the last ones: see ``rk_stages.step_error``
    "slope", "move", "product",  # what the last two stages of the step say, see ``rk_steps.note``
    "slopes", "moves", "products",  # their means
    "t_past_1", "t_past_2", "t_past_3", "surprise",  # see ``rk_steps.look_back``
)  # fmt: skip


class Frame(ctypes.Structure):
    """The record; every member is zero at first."""

    _fields_ = [(name, ctypes.c_int64) for name in _ADDRESSES + _INTEGERS] + [(name, ctypes.c_double) for name in _REALS]
