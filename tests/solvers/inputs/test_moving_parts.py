"""Python functions that native code asks, without a run: values, exceptions and interrupts; and where the tables lie in the blocks."""

from __future__ import annotations

import ctypes
import sys
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import ArgumentError, SolverError
from gearlib.native.layout import Shared
from gearlib.native.scene_functions import TABLES
from gearlib.solvers.inputs.moving import Callbacks, with_moving_inputs
from gearlib.solvers.inputs.table import Table


def asked(callbacks: Callbacks, signal: Any) -> Any:
    """A Python function as native code asks it: what it leaves at a time."""
    function, place = callbacks.asking(signal)
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double)(function)

    def value(t: float) -> float:
        call(t)
        return ctypes.c_double.from_address(place).value

    return value


def test_a_function_leaves_its_value() -> None:
    own = Callbacks()
    one, other = asked(own, lambda t: 2.0 * t), asked(own, lambda t: -t)
    assert [one(1.5), other(4.0), one(0.25)] == [3.0, -4.0, 0.5]
    assert own.stopped.tolist() == [0]
    assert own.failure() is None
    own.answer()
    assert len(own.alive) == 4


@pytest.mark.parametrize("may_stop", [False, True])
def test_exceptions_stop_the_run(may_stop: bool) -> None:
    """Those of gearlib as they are, others in a word; what ends the process stays what it is."""
    for problem in (ArgumentError("mine"), ValueError("odd"), SystemExit(3)):
        own = Callbacks(may_stop)

        def failing(t: float, problem: BaseException = problem) -> float:
            raise problem

        assert asked(own, failing)(1.0) == 0.0
        assert own.stopped.tolist() == [1]
        if type(problem) is ValueError:
            found = own.failure()
            assert type(found) is SolverError
            assert str(found) == "the run was stopped by ValueError: odd"
        else:
            assert own.failure() is problem
        assert not own.interrupted


def test_an_interrupt_is_answered_after_the_step_if_it_may_be() -> None:
    for may_stop in (True, False):
        own, times = Callbacks(may_stop), []

        def signal(t: float) -> float:
            times.append(t)  # noqa: B023
            if len(times) == 1:  # noqa: B023
                raise KeyboardInterrupt
            return 7.0

        assert asked(own, signal)(1.5) == (7.0 if may_stop else 0.0)
        assert (times, own.interrupted, own.stopped.tolist()) == ([1.5] * (1 + may_stop), may_stop, [int(not may_stop)])
        if may_stop:
            assert own.failure() is None
            with pytest.raises(KeyboardInterrupt):
                own.answer()
        else:
            own.answer()
            assert isinstance(own.failure(), KeyboardInterrupt)


def test_interrupts_that_python_cannot_raise_are_heard() -> None:
    """Others are told as before; not in another thread, which no interrupt comes to."""
    told: list[Any] = []
    before, sys.unraisablehook = sys.unraisablehook, told.append
    try:
        own = Callbacks()
        with own.listening():
            assert sys.unraisablehook is not before
            sys.unraisablehook(SimpleNamespace(exc_value=ValueError("other")))
            assert (len(told), own.stopped.tolist()) == (1, [0])
            interrupt = KeyboardInterrupt()
            sys.unraisablehook(SimpleNamespace(exc_value=interrupt))
            assert (len(told), own.stopped.tolist()) == (1, [1])
            assert own.failure() is interrupt
        assert sys.unraisablehook == told.append
        seen: list[Any] = []

        def elsewhere() -> None:
            with Callbacks().listening():
                seen.append(sys.unraisablehook)

        thread = threading.Thread(target=elsewhere)
        thread.start()
        thread.join()
        assert seen == [told.append]
        with pytest.raises(KeyError), own.listening():
            raise KeyError
        assert sys.unraisablehook == told.append
    finally:
        sys.unraisablehook = before


def test_tables_and_functions_lie_behind_the_model() -> None:
    """Knots and coefficients behind the numbers; behind the integers what says where they are."""
    shared = Shared(3, 2, 4)
    functions = {
        "rhs": SimpleNamespace(address=11),
        "jac": None,
        "roots": SimpleNamespace(address=33),
        "update": SimpleNamespace(address=44),
    }
    scene: Any = SimpleNamespace(shared=shared, index=np.arange(100, 108), **functions)
    one, other = Table([0.0, 1.0, 2.0], [1.0, 3.0, 2.0]), Table([0.0, 5.0], [4.0, 4.5])
    callbacks, numbers = Callbacks(), np.arange(9.0)
    shells, data, index = with_moving_inputs(scene, numbers, [(1, one), (3, other)], [(2, lambda t: t)], callbacks)
    assert [name for name, shell in shells.items() if shell is None] == ["jac"]
    assert len({shell.address for shell in shells.values() if shell is not None}) == 3
    assert data[:9].tolist() == numbers.tolist()
    assert data[9:24].tolist() == [*one.t, *one.coefficients.ravel()]
    assert data[24:34].tolist() == [*other.t, *other.coefficients.ravel()]
    assert np.isnan(data[34])
    assert data[35:].tolist() == [-np.inf, np.inf]
    assert index[TABLES] == 8
    expected = np.arange(100, 108)
    expected[TABLES] = 8
    assert index[:8].tolist() == expected.tolist()
    block = index[8:].tolist()
    assert block[:5] == [11, 0, 33, 44, 2]
    assert block[5:11] == [shared.inputs + 1, 9, 3, shared.inputs + 3, 24, 2]
    assert block[11:14] == [1, 34, callbacks.stopped.ctypes.data]
    assert block[14] == shared.inputs + 2
    assert block[16] == callbacks.alive[1].ctypes.data
    assert len(block) == 17
