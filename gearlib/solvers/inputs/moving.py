"""Inputs that move, in native code: trampolines that interpolate tables and ask Python functions, and then call the model.

The knots of the tables and their cubic coefficients follow the model's numbers in ``data``, then the last time for which Python functions
were asked, and the interval in which tables are looked up (``Problem.interval``). A block behind its integers, which ``index[TABLES]``
points to, holds the addresses of the model's functions, for each table the input's number, the offset of its knots and their count, and for
each Python function the input's number and the addresses of a callback and of the value that it leaves.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.native_module import native_functions
from gearlib.compiler.small_language import Prototype, floats_at, int32, ints_at, native
from gearlib.errors import GearlibError, SolverError
from gearlib.native.layout import MODEL
from gearlib.native.scene_functions import TABLES, NativeScene
from gearlib.solvers.inputs.table import Table

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
ASK = Prototype("int32", ("float",))
FUNCTIONS = ("rhs", "jac", "roots", "update")

_KIND = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double)


class Callbacks:
    """Keeps Python callbacks alive during a run, and stores the exceptions that they raise.

    Attributes
    ----------
    may_stop : bool
        Whether an interrupt is to end the run where it is; ``interrupted`` says that a function met one.
    alive : list
        What native code refers to.
    stopped : array, shape (1,)
        Whether one has failed, for native code.
    """

    def __init__(self, may_stop: bool = False) -> None:
        self.may_stop, self.interrupted = may_stop, False
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
                if self.may_stop and isinstance(problem, KeyboardInterrupt):
                    self.interrupted = True  # the step is completed first
                    return call(t)
                self.stop(problem)
            return 0

        callback = _KIND(call)
        self.alive += [callback, value]
        return ctypes.cast(callback, ctypes.c_void_p).value or 0, value.ctypes.data

    def answer(self) -> None:
        """Raise the interrupt that a function met."""
        if self.interrupted:
            raise KeyboardInterrupt

    def stop(self, problem: BaseException) -> None:
        """End the run, which then raises an exception."""
        self.problem, self.stopped[0] = problem, 1

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Also catch an interrupt at the entry or exit of a callback, which Python would otherwise report and discard."""
        if threading.current_thread() is not threading.main_thread():  # the only one that interrupts come to
            yield
            return
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


@native
def _look_up(t: float, data_address: int, index_address: int, kind: int) -> int:
    """Write the tables' values at a time into the inputs; returns the address of the model's function."""
    data, index = floats_at(data_address), ints_at(index_address)
    block = index[TABLES]
    asked = block + 5 + 3 * index[block + 4]
    last = index[asked + 1]
    at = min(max(t, data[last + 1]), data[last + 2])
    for j in range(index[block + 4]):
        place = block + 5 + 3 * j
        first, n = index[place + 1], index[place + 2]
        low, high = 0, n  # bracket of knots around t
        while low < high:
            middle = (low + high) // 2
            if data[first + middle] <= at:
                low = middle + 1
            else:
                high = middle
        if low == 0:
            value = data[first + n]
        else:
            k = first + low - 1
            since = at - data[k]
            value = data[k + n] + since * (data[k + 2 * n] + since * (data[k + 3 * n] + since * data[k + 4 * n]))
        data[index[place]] = value
    if index[asked] > 0:
        if data[last] != t:
            for j in range(index[asked]):
                place = asked + 3 + 3 * j
                ASK(index[place + 1], t)
                data[index[place]] = floats_at(index[place + 2])[0]
            data[last] = t
        if ints_at(index[asked + 2])[0] != 0:
            return 0
    return index[block + kind]


@native
def _called(function: int, t: float, x: int, out: int, data: int, index: int) -> int:
    """Call a function of the model; a failure where a Python function has failed."""
    return MODEL(function, t, x, out, data, index) if function != 0 else -1


@native
def rhs(t: float, x: int, out: int, data: int, index: int) -> int32:
    return _called(_look_up(t, data, index, 0), t, x, out, data, index)


@native
def jac(t: float, x: int, out: int, data: int, index: int) -> int32:
    return _called(_look_up(t, data, index, 1), t, x, out, data, index)


@native
def roots(t: float, x: int, out: int, data: int, index: int) -> int32:
    return _called(_look_up(t, data, index, 2), t, x, out, data, index)


@native
def update(t: float, x: int, out: int, data: int, index: int) -> int32:
    return _called(_look_up(t, data, index, 3), t, x, out, data, index)


def with_moving_inputs(
    scene: NativeScene, data: Floats, tables: Sequence[tuple[int, Table]],
    functions: Sequence[tuple[int, Callable[[float], float]]], callbacks: Callbacks,
) -> tuple[dict[str, Wrapped | None], Floats, Integers]:  # fmt: skip
    """The functions of a scene with tables and Python functions as inputs, and their data and index blocks.

    Parameters
    ----------
    scene : NativeScene
    data : array
        The scene's data block.
    tables : sequence of (number of the input, Table)
    functions : sequence of (number of the input, function of time)
    callbacks : Callbacks
    """
    models = [getattr(scene, name) for name in FUNCTIONS]
    block = [0 if f is None else f.address for f in models] + [len(tables)]
    at = len(data)
    for k, table in tables:
        block += [scene.shared.inputs + k, at, len(table.t)]
        at += 5 * len(table.t)
    block += [len(functions), at, callbacks.stopped.ctypes.data]
    for k, function in functions:
        block += [scene.shared.inputs + k, *callbacks.asking(function)]
    index = np.concatenate([scene.index, np.array(block, np.int64)])
    index[TABLES] = len(scene.index)
    knots = [part for _, table in tables for part in (table.t, *table.coefficients)]
    addresses = native_functions(__name__).addresses
    shells = {name: None if f is None else Wrapped(addresses[name]) for name, f in zip(FUNCTIONS, models, strict=True)}
    return shells, np.concatenate([data, *knots, [np.nan, -np.inf, np.inf]]), index
