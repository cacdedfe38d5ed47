"""Native IDA backend: SUNDIALS driven by compiled callbacks and a compiled loop."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gearlib.compiler.native_module import native_functions
from gearlib.compiler.translate import Prototype
from gearlib.solvers.ida import callbacks
from gearlib.solvers.ida.ida_request import BURST, CHUNK, IdaOutcome, IdaRequest
from gearlib.solvers.ida.sundials import Solver, Sundials
from gearlib.solvers.ida.user_data import IdaRecord
from gearlib.solvers.problem import Floats, late_start

_FUNCTIONS = {
    "array_pointer": "N_VGetArrayPointer",
    "solve": "IDASolve",
    "reinit": "IDAReInit",
    "calc_ic": "IDACalcIC",
    "get_ic": "IDAGetConsistentIC",
    "root_info": "IDAGetRootInfo",
    "set_stop": "IDASetStopTime",
    "get_dky": "IDAGetDky",
    "get_steps": "IDAGetNumSteps",
}
_LOG = 256  # events; grows


def _functions() -> Mapping[str, int]:
    """Addresses of the compiled callbacks and of the loop."""
    return native_functions(callbacks.__name__).addresses


def run(sundials: Sundials, asked: IdaRequest) -> IdaOutcome:
    """Integrate natively.

    Parameters
    ----------
    sundials
        The libraries, from `gearlib.solvers.ida.sundials.load`.
    asked
        The problem and what is wanted of it.
    """
    drive = Drive(sundials, asked)
    try:
        while drive.advance(CHUNK) == callbacks.PAUSE:
            pass
        return drive.outcome()
    finally:
        drive.close()


class Drive:
    """IDA on its way through a problem; `close` frees its memory.

    Attributes
    ----------
    status : int
        As `callbacks.drive` returned it last.
    """

    def __init__(self, sundials: Sundials, asked: IdaRequest) -> None:
        self.epoch = late_start(float(asked.times[0]), float(asked.times[-1]))
        self.asked = asked
        if self.epoch:  # all times in the record count from there
            self.asked = replace(asked, times=asked.times - self.epoch, time_events=asked.time_events - self.epoch)
        x0, order = np.asarray(asked.problem.x0, dtype=np.float64), asked.matrix.order
        y, dy = np.array(x0 if order is None else x0[order]), np.zeros(len(x0))
        self.record = IdaRecord()  # that the compiled code works on
        self.arrays: dict[str, Any] = {}  # that it points to
        self.status, self.solver = callbacks.PAUSE, Solver(sundials, y, dy)
        try:
            _prepare(sundials, self, y, dy)
        except BaseException:
            self.solver.close()
            raise
        self.record.epoch = self.epoch
        self._drive = Prototype("int32", ("int",))

    def point(self, **arrays: Any) -> None:
        """Let the record point to arrays, and keep them alive."""
        for name, array in arrays.items():
            self.arrays[name] = array
            setattr(self.record, name, array.ctypes.data if array.size else 0)

    def log_space(self, capacity: int) -> None:
        """Make room for so many events, keeping those already logged."""
        times, roots = np.zeros(capacity), np.zeros(capacity, dtype=np.int64)
        if "event_times" in self.arrays:
            used = self.record.events
            times[:used], roots[:used] = self.arrays["event_times"][:used], self.arrays["event_roots"][:used]
        self.point(event_times=times, event_roots=roots)
        self.record.event_capacity = capacity

    def advance(self, steps: int) -> int:
        """Go on by so many steps, or until something happens; returns the status."""
        record = self.record
        record.pause_at = min(self.steps + steps, record.max_steps)
        self.status = callbacks.LOG_FULL
        while self.status == callbacks.LOG_FULL:
            self.status = self._drive(_functions()["drive"], ctypes.addressof(record))
            if self.status == callbacks.LOG_FULL:
                self.log_space(2 * record.event_capacity + self.asked.problem.n_roots)
        return self.status

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return self.record.done

    @property
    def t(self) -> float:
        """Where it is, s."""
        return self.epoch + self.record.t

    @property
    def x(self) -> Floats:
        """The states there."""
        y: Floats = self.arrays["y"]
        order = self.asked.matrix.order
        return y.copy() if order is None else y[np.argsort(order)]

    def outcome(self) -> IdaOutcome:
        """What has been found so far."""
        found = _outcome(self)
        if not self.epoch:
            return found
        bad = None if found.bad_time is None else self.epoch + found.bad_time
        return replace(found, t=self.epoch + found.t, event_times=self.epoch + found.event_times, bad_time=bad)

    def close(self) -> None:
        """Free IDA's memory."""
        self.solver.close()


def _prepare(sundials: Sundials, drive: Drive, y: Floats, dy: Floats) -> None:
    asked, solver, record = drive.asked, drive.solver, drive.record
    problem, matrix = asked.problem, asked.matrix
    n, samples, n_roots = len(y), len(asked.times), problem.n_roots if problem.roots is not None else 0
    n_modes = asked.modes.stop - asked.modes.start
    permuted = slice(None) if matrix.order is None else matrix.order
    differential = np.asarray(problem.differential, dtype=np.float64)[permuted]

    between = np.zeros(n)
    drive.point(
        data=asked.data,
        index=np.ascontiguousarray(problem.index, dtype=np.int64),
        x=y if matrix.order is None else np.zeros(n),
        f=np.zeros(n), y=y, dy=dy, differential=differential,
        order=np.empty(0) if matrix.order is None else matrix.order, atol=asked.atol[permuted], probe=np.zeros(n), between=between,
        values=np.zeros(len(matrix.position)), position=matrix.position, diagonal=matrix.diagonal,
        fired=np.zeros(2 * n_roots, dtype=np.int32), sides=np.zeros(n_roots, dtype=np.int32),
        before=np.zeros(n_roots, dtype=np.int32), g=np.zeros(n_roots), later=np.zeros(n_roots),
        times=asked.times, out=np.full((samples, n), np.nan), modes_out=np.full((samples, n_modes), np.nan),
        time_events=asked.time_events, scratch=np.zeros(1), counter=np.zeros(1, dtype=np.int64),
    )  # fmt: skip
    drive.log_space(_LOG + n_roots)
    numbers = {
        "n": n, "nnz": len(matrix.position), "n_diagonal": len(matrix.diagonal), "n_roots": n_roots,
        "n_algebraic": n - int(np.count_nonzero(differential)), "n_times": samples,
        "n_time_events": len(asked.time_events), "n_modes": n_modes, "first_mode": asked.modes.start,
        "max_steps": asked.max_steps, "patience": asked.patience, "burst_limit": BURST, "t": asked.times[0], "t_end": asked.times[-1],
        "window": asked.window, "burst_start": asked.times[0], "ic_span": asked.start_span, "rtol": asked.rtol,
        "slack": asked.slack, "look_at": CHUNK, "looked_t": asked.times[0],
    }  # fmt: skip
    for name, number in numbers.items():
        setattr(record, name, number)
    for name in ("rhs", "jac", "roots", "update"):
        function = getattr(problem, name)
        setattr(record, name, 0 if function is None else function.address)
    for name, function in _FUNCTIONS.items():
        setattr(record, name, sundials.address(function))
    _attach(drive, differential, permuted, n_roots)
    record.mem, record.yy, record.yp, record.yd = solver.mem, solver.yy, solver.yp, solver.vector(between)


def _attach(drive: Drive, differential: Floats, permuted: Any, n_roots: int) -> None:
    solver, asked, record = drive.solver, drive.asked, drive.record
    matrix = asked.matrix
    t, user_data = float(asked.times[0]), ctypes.addressof(record)
    solver.create(_functions()["residual"], t, user_data, asked.rtol, asked.atol[permuted], differential)
    solver.sundials.IDASetNonlinConvCoef(solver.mem, asked.newton)
    if asked.problem.longest_step < math.inf:
        solver.sundials.IDASetMaxStep(solver.mem, asked.problem.longest_step)
    if matrix.pattern is not None:
        starts, rows = matrix.pattern
        record.matrix, record.pattern, record.starts = solver.use_sparse(len(rows))
        record.n_pattern = len(rows)
        drive.point(pattern_source=rows, starts_source=starts)
    else:
        record.matrix = solver.use_band(matrix.upper, matrix.lower) if matrix.kind == "band" else solver.use_dense()
    directions = np.repeat(np.array([0, 1], np.int32), n_roots)  # the second half: functions that turn away from zero
    solver.attach(None if asked.problem.jac is None else _functions()["jacobian"], _functions()["roots"], directions)


def _outcome(drive: Drive) -> IdaOutcome:
    s, status, solver = drive.record, drive.status, drive.solver
    order, events = drive.asked.matrix.order, s.events
    worst = solver.worst() if status < 0 and s.steps > 0 else -1
    y = drive.arrays["y"]
    return IdaOutcome(
        status=status,
        t=s.t,
        x=drive.arrays["out"],
        modes=drive.arrays["modes_out"],
        event_times=drive.arrays["event_times"][:events].copy(),
        event_roots=drive.arrays["event_roots"][:events].copy(),
        rhs=s.n_rhs,
        jac=s.n_jac,
        attempts=s.attempts,
        restarts=s.restarts - 1,
        steps=s.steps,
        order=solver.number("IDAGetLastOrder", ctypes.c_int),
        step_size=solver.number("IDAGetCurrentStep"),
        worst_state=int(order[worst]) if order is not None and worst >= 0 else worst,
        bad_time=s.bad_time if s.refused > 0 else None,
        bad_state=s.bad_state,
        x_failed=None if status >= 0 else (y.copy() if order is None else y[np.argsort(order)]),
    )
