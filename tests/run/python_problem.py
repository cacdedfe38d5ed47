"""Initial value problems of Python functions, for tests of the integrators."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from gearlib.solvers.drive.driver import Driver, Stepper
from gearlib.solvers.drive.driver import integrate as to_the_end
from gearlib.solvers.ida.ida import ida
from gearlib.solvers.problem import Problem, Solution
from gearlib.solvers.rungekutta.rungekutta import RungeKutta

_DOUBLES, _INTS, _LONGS = (ctypes.POINTER(t) for t in (ctypes.c_double, ctypes.c_int32, ctypes.c_int64))


def native(function: Callable[..., int | None], out: Any = _DOUBLES) -> Any:
    """A Python function (t, x, out, data) as the C function that the integrator calls."""
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, _DOUBLES, out, _DOUBLES, _LONGS)
    wrapped = kind(lambda t, x, out, data, index: function(t, x, out, data) or 0)
    return SimpleNamespace(address=ctypes.cast(wrapped, ctypes.c_void_p).value, keep=wrapped)


def problem(rhs: Callable[..., int | None], x0: Any, **more: Any) -> Problem:
    """An explicit problem of Python functions."""
    x0 = np.array(x0, dtype=float)
    for name in ("roots", "update"):
        if name in more:
            more[name] = native(more[name], _INTS if name == "update" else _DOUBLES)
    more.setdefault("data", np.zeros(4))
    more.setdefault("nominal", np.ones(x0.size))
    return Problem(native(rhs), x0, index=np.zeros(1, dtype=np.int64), differential=np.ones(x0.size, dtype=np.bool_), **more)


def driver(problem: Problem, times: Any, stepper: Stepper, **asked: Any) -> Driver:
    """A run of a problem with other times, tolerances and limits."""
    return Driver(replace(problem, times=np.asarray(times, dtype=float), **asked), stepper)


def rk(problem: Problem, times: Any, order: int = 5, first_step: float | None = None, **asked: Any) -> Solution:
    """A problem's solution by Runge-Kutta."""
    return to_the_end(driver(problem, times, RungeKutta(order, first_step), **asked))


def by_ida(problem: Problem, times: Any, native: bool = True, linear_solver: str | None = None, **asked: Any) -> Solution:
    """A problem's solution by IDA."""
    return to_the_end(driver(problem, times, ida(native, linear_solver), **asked))
