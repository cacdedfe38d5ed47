"""`PythonStepper`: a stepper implemented as a Python class."""

from __future__ import annotations

import ctypes
from abc import abstractmethod
from collections.abc import Callable
from typing import Any
from weakref import proxy

import numpy as np

from gearlib.solvers.drive.driver import Driver, Stepper
from gearlib.solvers.problem import Floats

__all__ = ["FailedError", "PythonStepper"]

_pointer = ctypes.c_void_p
_MODEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *(_pointer,) * 4)
_KINDS: dict[str, Any] = {
    "step": ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_double),
    "interpolate": ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_double, ctypes.c_int64),
    "accept": ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64),
    "restart": ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64, ctypes.c_int32, ctypes.c_int32),
}
RAISED = -120  # a method has raised an exception


class FailedError(Exception):
    """A failed step, with its failure code."""


class PythonStepper(Stepper):
    """A stepper in Python. Times passed to its methods count from the record's ``origin``, like all times in the record.

    An exception in a method ends the run and propagates to the caller; `FailedError` ends it with a failure code.
    """

    def attach(self, driver: Driver, memory: Callable[[str], Floats]) -> None:
        self.driver, self.problem, self.record = proxy(driver), driver.problem, driver.record
        self._rhs, self._roots = _MODEL(self.record.rhs), _MODEL(self.record.roots) if self.record.roots else None
        methods: dict[str, Callable[..., int | None]] = {
            "step": self.step, "interpolate": self._interpolate, "accept": self.accept, "restart": self.restart,
        }  # fmt: skip
        self._callbacks = [self._guarded(_KINDS[name], method) for name, method in methods.items()]
        for name, callback in zip(methods, self._callbacks, strict=True):
            setattr(self.record, name, ctypes.cast(callback, _pointer).value or 0)

    def _guarded(self, kind: Any, method: Callable[..., int | None]) -> Any:
        """A method as a C callback: no exception may propagate through the compiled loop."""

        def call(_: int, *arguments: float) -> int:
            try:
                return method(*arguments) or 0
            except FailedError as failed:
                self.raised = None
                return int(failed.args[0])
            except BaseException as problem:
                self.raised = problem
                return RAISED

        return kind(call)

    @abstractmethod
    def step(self, stop: float) -> int:
        """One step; see `gearlib.solvers.drive.drive_loop`."""

    @abstractmethod
    def interpolate(self, t: float) -> Floats:
        """States at a time within the last step."""

    def _interpolate(self, t: float, out: int) -> None:
        np.ctypeslib.as_array(ctypes.cast(out, ctypes.POINTER(ctypes.c_double)), (self.driver.x.size,))[:] = self.interpolate(t)

    @abstractmethod
    def accept(self) -> None:
        """Write the states at the end of the step into ``driver.x``."""

    @abstractmethod
    def restart(self, changed: int, why: int) -> int | None:
        """Restart from ``driver.x``."""

    def rhs(self, t: float, x: Floats, out: Floats) -> int:
        """Evaluate the model's right-hand side into an array; 0 on success."""
        record = self.record
        return int(self._rhs(record.origin + t, x.ctypes.data, out.ctypes.data, record.data, record.index))

    def root_values(self, t: float, x: Floats, out: Floats) -> int:
        """Evaluate the model's event functions into an array; 0 on success."""
        record = self.record
        return (
            int(self._roots(record.origin + t, x.ctypes.data, out.ctypes.data, record.data, record.index)) if self._roots else 0
        )
