"""Python callbacks as inputs: evaluated and stored in the model's data before each call of a native function."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from gearlib.errors import GearlibError, SolverError
from gearlib.native.layout import Shared


class Callbacks:
    """Keeps Python callbacks alive during a run, and stores the exceptions that they raise."""

    def __init__(self) -> None:
        self.callbacks: list[Any] = []
        self.problem: BaseException | None = None

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Also catch an interrupt at the entry or exit of a callback, which Python would otherwise report and discard."""
        before = sys.unraisablehook

        def lost(unraisable: Any) -> None:
            if isinstance(unraisable.exc_value, KeyboardInterrupt):
                self.problem = unraisable.exc_value
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


def with_callbacks(
    function: Any, shared: Shared, moving: Sequence[tuple[int, Callable[[float], float]]], callbacks: Callbacks, third: Any
) -> Wrapped:
    """Wrap a native function to evaluate the ``moving`` inputs, by number, first; ``third`` is the type of its third argument."""
    double, whole = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int64)
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, double, third, double, whole)
    native = kind(function.address)

    def call(t: float, x: Any, out: Any, data: Any, index: Any) -> int:
        try:
            for k, signal in moving:
                data[shared.inputs + k] = signal(t)
            return -1 if callbacks.problem is not None else int(native(t, x, out, data, index))
        # An exception must not propagate through native frames, nor an interrupt be lost there
        except BaseException as problem:
            callbacks.problem = problem
            return -1

    callback = kind(call)
    callbacks.callbacks += [callback, native]
    return Wrapped(ctypes.cast(callback, ctypes.c_void_p).value or 0)
