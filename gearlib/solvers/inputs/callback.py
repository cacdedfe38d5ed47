"""Python functions of time as inputs: callbacks that native code asks for a value (see `table_lookup`)."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearlib.errors import GearlibError, SolverError

_KIND = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double)


class Callbacks:
    """Keeps Python callbacks alive during a run, and stores the exceptions that they raise.

    Attributes
    ----------
    alive : list
        What native code refers to.
    stopped : array, shape (1,)
        Whether one has failed, for native code.
    """

    def __init__(self) -> None:
        self.alive: list[Any] = []
        self.problem: BaseException | None = None
        self.stopped = np.zeros(1, np.int64)

    def asking(self, signal: Callable[[float], float]) -> tuple[int, int]:
        """Addresses of a native function of time that calls a Python function, and of the value that it leaves."""
        value = np.zeros(1)

        def call(t: float) -> int:
            try:
                value[0] = signal(t)
            # An exception must not propagate through native frames, nor an interrupt be lost there
            except BaseException as problem:
                self.stop(problem)
            return 0

        callback = _KIND(call)
        self.alive += [callback, value]
        return ctypes.cast(callback, ctypes.c_void_p).value or 0, value.ctypes.data

    def stop(self, problem: BaseException) -> None:
        """End the run, which then raises an exception."""
        self.problem, self.stopped[0] = problem, 1

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Also catch an interrupt at the entry or exit of a callback, which Python would otherwise report and discard."""
        before = sys.unraisablehook

        def lost(unraisable: Any) -> None:
            if isinstance(unraisable.exc_value, KeyboardInterrupt):
                self.stop(unraisable.exc_value)
            else:
                before(unraisable)

        sys.unraisablehook = lost
        try:
            yield
        finally:
            sys.unraisablehook = before

    def failure(self) -> BaseException | None:
        if self.problem is None or isinstance(self.problem, GearlibError) or not isinstance(self.problem, Exception):
            return self.problem
        return SolverError(f"the run was stopped by {type(self.problem).__name__}: {self.problem}")


@dataclass(frozen=True)
class Wrapped:
    """A native function wrapped so that inputs are first stored in its data."""

    address: int
