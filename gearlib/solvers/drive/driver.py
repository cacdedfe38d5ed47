"""`Driver`: integrates a problem with any `Stepper`; `integrate` runs it to the end."""

from __future__ import annotations

import ctypes
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import all_finite, shown
from gearlib.compiler.small_language import BLOCK
from gearlib.errors import ArgumentError, GearlibError, SolverError, StartError
from gearlib.recent import recent
from gearlib.solvers.drive import drive_loop
from gearlib.solvers.drive.drive_record import DriveRecord
from gearlib.solvers.problem import Floats, Integers, Problem, Solution, late_start

__all__ = ["Driver", "Stepper", "address_of", "integrate"]

STEPS_PER_CALL = 1000  # Python handles interrupts in between
LONGEST_CALL = 0.1  # s; after a call that takes longer the next one has fewer steps
PATIENCE = 12  # failed evaluations, with ever smaller steps, before a run counts as having left the domain of its states
_EVENTS_AT_FIRST = 256  # entries of the event log (16 bytes each), which doubles when it is full
MOST_LAYOUTS = 8  # layouts of memory that a problem keeps
LASTING = ("times", "out", "discrete", "log_t", "log_root")  # handed over from one method to the next
_NO_EVENTS, _NO_ROOTS = np.empty(0), np.empty(0, np.int64)
_STATUS = {drive_loop.DONE: "done", drive_loop.MORE: "more", drive_loop.LOG_FULL: "more", drive_loop.STIFF: "stiff"}


class Stepper(ABC):
    """An integration method working on one problem: its functions, statistics and error messages.

    `attach` writes the addresses of its functions into the run's record; `drive_loop` specifies them.
    """

    Record: type[DriveRecord] = DriveRecord
    steps: bool = True  # False: it computes all samples at once, outside the compiled loop
    looks_every: int = STEPS_PER_CALL  # steps between two calls of `spent`
    raised: BaseException | None = None  # exception raised by one of its functions, if these are Python's

    def memory(self, size: int, n_roots: int) -> dict[str, int]:
        """Fields of the record that point to the stepper's own arrays, with their sizes; ``size``: number of states, padded to blocks."""
        return {}

    @abstractmethod
    def attach(self, driver: Driver, memory: Callable[[str], Floats]) -> None:
        """Prepare to integrate; the record is complete except for the stepper's part. ``memory`` holds the requested arrays.

        A reference to the driver must be weak, or the samples of finished runs would wait for the garbage collector.
        """

    @property
    @abstractmethod
    def work(self) -> float:
        """Work so far (ns), estimated from counted operations."""

    @abstractmethod
    def stats(self) -> dict[str, Any]:
        """Statistics of the run."""

    @abstractmethod
    def failure(self, code: int) -> GearlibError:
        """The exception for a failure code of the stepper's own."""

    def carry_on(self, driver: Driver) -> int:
        """Continue for at most ``record.budget`` steps; returns a result code of ``drive_loop.advance``, the default implementation."""
        from gearlib.compiler.native_module import native_functions

        return native_functions(drive_loop.__name__).loop("advance")(driver.record.address)

    def until(self, t: float, longest_step: float) -> None:  # noqa: B027  (most have nothing to do)
        """Extend a finished run to a later time (s), with a maximum step size."""

    def recovers(self, code: int) -> bool:
        """Whether the run can continue after a failure, since the stepper has found a remedy."""
        return False

    def leaves(self, code: int) -> bool:
        """Whether a failure means that the right-hand side is undefined beyond this point."""
        return False

    def spent(self) -> bool:
        """Whether the states are close to singular, so that the run must continue with others."""
        return False

    def close(self) -> None:  # noqa: B027  (most have nothing to free)
        """Release resources that Python does not manage."""


class Driver:
    """A run in progress: a problem and the stepper that integrates it.

    Parameters
    ----------
    problem
        The run begins, or is handed over, at its start values.
    stepper
    before
        The driver of the same run with the previous stepper. Samples and events are appended to its own; it may itself continue if the
        hand-over fails.

    Attributes
    ----------
    status : str
        ``"more"``, ``"done"``; ``"left"`` where the right-hand side is undefined beyond this point and the problem allows that;
        ``"stiff"`` where stability limits the steps of an explicit method that was told to watch; ``"interrupted"``.
    out : array, shape (samples, states)
        States at the samples reached so far.
    """

    record: DriveRecord

    def __init__(self, problem: Problem, stepper: Stepper, before: Driver | None = None) -> None:
        self.problem, self.stepper, self.status = problem, stepper, "more"
        if stepper.steps:
            _check(problem)
        self.t_end, self._steps_before, self.events_before = float(problem.times[-1]), 0, 0
        self._most_steps = STEPS_PER_CALL  # of a call
        self._since_look = 0  # steps since the stepper was last asked whether it is spent
        if stepper.steps:
            self._lay_out(before)
        else:
            self._lay_out_samples()

    def _lay_out_samples(self) -> None:
        """Allocate the samples for a stepper that computes them all at once; its record holds times and counts only."""
        problem, n_times = self.problem, self.problem.times.size
        self.record = self.stepper.Record()
        self.record.t, self.record.n_times, self.record.capacity = float(problem.times[0]), n_times, 2
        self.x, self.data = problem.x0.copy(), problem.data
        self.out, self._discrete = np.empty((n_times, problem.x0.size)), np.empty((n_times, 0))
        self._lasting = {"log_t": _NO_EVENTS, "log_root": _NO_EVENTS}

    def _lay_out(self, before: Driver | None) -> None:
        """Allocate the record and all arrays of the compiled loop."""
        problem, stepper, times = self.problem, self.stepper, self.problem.times
        self.events_before = 0 if before is None else before.record.events
        n, n_roots = problem.x0.size, problem.n_roots if problem.roots is not None else 0
        first, last = float(times[0]) if before is None else before.t, self.t_end
        stops, n_timed = stops_in(problem.time_events, first, last)
        origin = late_start(first, last) if before is None else before.record.origin
        size = BLOCK * max(1, -(-n // BLOCK))
        own = {"x": 2 * size if problem.implicit else size} | stepper.memory(size, n_roots)
        sizes = (
            n, n_roots, problem.data.size, problem.index.size, stops.size, n_timed, 0 if before is not None else times.size,
            problem.discrete.indices(problem.data.size)[:2],
        )  # fmt: skip
        key = stepper.Record, *own.values(), *sizes
        words, relative, places = recent(problem.layouts, key, lambda: layout(stepper.Record, own, *sizes), MOST_LAYOUTS)
        # one allocation: a call of numpy takes as long as several steps of a small model
        whole = np.empty(places["end"].stop)
        here = whole[: words.size].view(np.int64)
        np.multiply(relative, address_of(whole), out=here)
        here += words
        buffer: Any = whole
        self.record = record = stepper.Record.from_buffer(buffer)
        whole[places["zero"]] = 0.0
        self.x, self.data, self.stops = whole[places["x"]][:n], whole[places["data"]], whole[places["stops"]]
        self.x[:], self.data[:] = problem.x0, problem.data
        np.subtract(stops, origin, out=self.stops)
        whole[places["index"]].view(np.int64)[:] = problem.index
        if before is None:
            self._lasting = {name: whole[places[name]] for name in LASTING}
            np.subtract(times, origin, out=self._lasting["times"])
            self.out = self._lasting["out"].reshape(times.size, n)
            self._discrete = self._lasting["discrete"].reshape(times.size, record.n_discrete)
        else:
            self._lasting, self.out, self._discrete = dict(before._lasting), before.out, before._discrete
            for name in (*LASTING, "n_times", "capacity", "sample", "events"):
                setattr(record, name, getattr(before.record, name))
        record.rhs = problem.rhs.address
        record.roots = problem.roots.address if problem.roots is not None else 0
        record.update = problem.update.address if problem.update is not None else 0
        record.interval = 0 if problem.interval is None else record.data + 8 * problem.interval
        record.origin, record.t, record.burst_start = origin, first - origin, first - origin
        record.window = 1e-9 * (last - float(times[0]))
        self.fired = whole[places["fired"]].view(np.int32)[:n_roots]
        self.times = self._lasting["times"]  # these and the stops count from the record's origin
        stepper.attach(self, lambda name: whole[places[name]])
        self._traced: list[Floats] | None = None
        if problem.traced is not None and record.rates and (before is None or before._traced is not None):
            record.traced, record.n_traced = address_of(problem.traced) if problem.traced.size else 0, problem.traced.size
            self._traced = [] if before is None or before._traced is None else [*before._traced[:-1], before._last_traced]
            self._go_on_tracing()

    @property
    def _last_traced(self) -> Floats:
        """The rows of the last piece of the trace."""
        assert self._traced is not None, "only then"
        return self._traced[-1][: self.record.trace_rows]

    def _go_on_tracing(self) -> None:
        """A further piece of the trace, twice as long as the last one; none where it becomes too long."""
        from gearlib.solvers.drive.trace import FIRST, GROWTH, MOST, width

        record, pieces = self.record, self._traced
        assert pieces is not None, "only then"
        if pieces and record.trace:
            pieces[-1] = self._last_traced
        columns = width(record.n_traced, record.n_discrete)
        rows = max(FIRST * GROWTH ** len(pieces) // columns, 2 * drive_loop.MARGIN)
        if columns * rows > MOST:
            self._traced, record.trace = None, 0
            return
        pieces.append(np.empty((rows, columns)))
        record.trace, record.trace_rows, record.trace_capacity = address_of(pieces[-1]), 0, rows

    @property
    def t(self) -> float:
        """Current time, s."""
        return self.record.origin + self.record.t

    @property
    def work(self) -> float:
        """Work so far (ns), estimated from counted operations."""
        return self.stepper.work

    @property
    def blamed(self) -> str:
        """What cannot be evaluated where the run stands, as part of a message."""
        return self.problem.blamed(self.t, self.x, self.data)

    @property
    def event_times(self) -> Floats:
        """Times of the events, s."""
        if not self.record.events:
            return _NO_EVENTS
        return self.record.origin + self._lasting["log_t"][: self.record.events]

    @property
    def event_roots(self) -> NDArray[np.int64]:
        """Index of the event function that crossed zero, -1 for a time event."""
        if not self.record.events:
            return _NO_ROOTS
        return self._lasting["log_root"].view(np.int64)[: self.record.events].copy()

    def advance(self, steps: int = STEPS_PER_CALL) -> str:
        """Continue for a number of steps, or until something happens; returns the status."""
        try:
            self._advance(steps)
        except KeyboardInterrupt:
            if not self.problem.may_stop:
                raise
            self.status = "interrupted"
        return self.status

    def _advance(self, steps: int) -> None:
        record, left = self.record, self.problem.max_steps + self._steps_before - self.record.steps
        if left <= 0 and self.t < self.t_end:
            raise self._failure(drive_loop.STEP_LIMIT)
        self._make_room()
        budget = max(1, min(steps, left, self.stepper.looks_every))
        record.budget, begin = min(budget, self._most_steps), perf_counter()
        code = self.stepper.carry_on(self)
        if self.problem.tell is not None:
            self.problem.tell(self.t)
        if (seconds := perf_counter() - begin) > LONGEST_CALL:
            self._most_steps = max(1, int(0.5 * record.budget * LONGEST_CALL / seconds))
        elif seconds < 0.25 * LONGEST_CALL:  # the machine may have been busy, or the process suspended
            self._most_steps = min(2 * self._most_steps, STEPS_PER_CALL)
        self._since_look += record.budget
        if code >= 0:
            self.status = _STATUS[code]
            if self.status == "more" and self._since_look >= budget:
                self._since_look = 0
                if self.stepper.spent():
                    self.status = "left"
        elif self.stepper.raised is not None:
            raise self.stepper.raised
        elif self.stepper.recovers(code):
            self.status = "more"
        elif self.problem.may_leave and self.stepper.leaves(code):
            self.status = "left"
        else:
            raise self._failure(code)

    def _failure(self, code: int) -> GearlibError:
        """The exception for a negative result code."""
        problem, where = self.problem, f"at t = {self.t:.9g} s after {self.record.steps} steps"
        if code == drive_loop.CHATTER:
            last = self.event_roots[self.event_times >= self.t - self.record.window]
            names = "; ".join(dict.fromkeys(problem.root_name(int(k)) for k in np.unique(last) if k >= 0))
            return SolverError(
                f"events chatter {where}: more than {drive_loop.BURST} of them within {self.record.window:.3g} s, of {names}"
            )
        if code == drive_loop.UPDATE_FAILED:
            return SolverError(f"an event could not be handled {where}{problem.not_settled(self.t, self.x, self.data)}")
        if code == drive_loop.UNSETTLED:
            names = "; ".join(dict.fromkeys(problem.root_name(int(k)) for k in np.flatnonzero(np.abs(self.fired) == 1)))
            told = f"the event iteration does not settle {where}: what it changes carries event functions to and fro: {names}"
            algebraic = not np.all(problem.differential)
            return SolverError(f"{told}; take form='ode', which solves for algebraic unknowns in it" if algebraic else told)
        if code == drive_loop.STEP_LIMIT:
            return SolverError(f"gave up {where} towards t = {self.t_end:.9g} s: max_steps is {problem.max_steps}")
        return self.stepper.failure(code)

    def go_on(self, t: float, time_events: Floats, longest_step: float) -> None:
        """Extend a finished run to a later time (s) as if it had not stopped; it takes no more samples.

        Parameters
        ----------
        t
            s, later than the current time.
        time_events
            Known times in between to step to exactly.
        longest_step
            s.
        """
        record, self.t_end, self.status = self.record, t, "more"
        self._steps_before = record.steps
        stops, record.n_timed = stops_in(time_events, self.t, t)
        self.stops = stops - record.origin
        record.stops, record.n_stops, record.stop = address_of(self.stops), stops.size, 0
        record.n_times = record.sample = 0
        self.stepper.until(t, longest_step)

    def begin_anew(self) -> None:
        """Restart with an event iteration at the next step, since something that the model depends on was set from outside."""
        self.record.started = 0
        self.fired[:] = 0

    def _make_room(self) -> None:
        """Grow the event log, or the trace, if a step may fill it."""
        record = self.record
        if record.trace and record.trace_capacity - record.trace_rows < drive_loop.MARGIN:
            self._go_on_tracing()
        if record.capacity < record.events + record.n_roots + 2:
            record.capacity = 2 * record.capacity + record.n_roots
            for name in ("log_t", "log_root"):
                self._lasting[name] = np.resize(self._lasting[name], record.capacity)
                setattr(record, name, address_of(self._lasting[name]))

    def solution(self) -> Solution:
        """The solution found so far."""
        samples = self.record.sample
        trace = None
        if self.problem.traced is not None and self._traced is not None:
            from gearlib.solvers.drive.trace import Trace

            trace = Trace([*self._traced[:-1], self._last_traced], self.problem.traced, self.record.origin)
        return Solution(
            t=self.problem.times[:samples], x=self.out[:samples], discrete=self._discrete[:samples], status=self.status, t_last=self.t,
            x_last=self.x.copy(), data=self.data, event_times=self.event_times, event_roots=self.event_roots,
            stats={**self.stepper.stats(), "events": self.record.events, "work": self.stepper.work},
            trace=trace,
        )  # fmt: skip

    def close(self) -> None:
        """Release resources that Python does not manage."""
        self.stepper.close()


def integrate(driver: Driver) -> Solution:
    """Continue to the end, or to where the stepper stops.

    Raises
    ------
    SolverError
        The integration failed; the message says when, and in which state or event function.
    """
    try:
        while driver.advance() == "more":
            pass
        return driver.solution()
    finally:
        driver.close()


def no_further_step(driver: Driver, where: str, unknown: str | None) -> SolverError:
    """The exception of an explicit stepper: what cannot be evaluated, or that its steps became too small."""
    text = f"{unknown} cannot be evaluated {where}"
    if unknown is None:
        text = f"the step became too small {where}: the solution goes to infinity, jumps, or cannot be evaluated further on"
    return SolverError(text + driver.blamed)


def address_of(array: NDArray[Any]) -> int:
    """Address of an array's data."""
    buffer: Any = array
    return ctypes.addressof(ctypes.c_char.from_buffer(buffer))  # takes a third of the time of ``array.ctypes.data``


def layout(
    Record: type[DriveRecord], own: dict[str, int], n: int, n_roots: int, n_data: int, n_index: int, n_stops: int, n_timed: int,
    n_times: int, discrete: tuple[int, int],
) -> tuple[Integers, Integers, dict[str, slice]]:  # fmt: skip
    """Layout of a driver's memory: a record, and the arrays that it points to.

    Returns
    -------
    words : array
        The record as it is at first, with offsets (bytes) for addresses.
    relative : array
        1 where a word is an offset, else 0.
    places : dict of str to slice
        The arrays by name, in numbers of 8 bytes; ``"zero"`` is what is zero at first, ``"end"`` the end of all.
    """
    first, last = discrete
    n_discrete = max(last - first, 0)
    capacity = n_roots + (_EVENTS_AT_FIRST if n_roots or n_timed else 2)
    lengths = {**own, "fired": n_roots, "data": n_data, "index": n_index, "stops": n_stops}
    if n_times:
        lengths |= dict(zip(LASTING, (n_times, n_times * n, n_times * n_discrete, capacity, capacity), strict=True))
    begin = at = BLOCK * -(-ctypes.sizeof(Record) // (8 * BLOCK))
    record, pointers = Record(), Record()
    places: dict[str, slice] = {}
    pointers.address = 1
    for name, length in lengths.items():
        setattr(record, name, 8 * at)
        setattr(pointers, name, 1)
        places[name] = slice(at, at + length)
        at += length
    record.n, record.n_roots, record.n_stops, record.n_timed = n, n_roots, n_stops, n_timed
    record.n_discrete, record.first_discrete, record.n_times, record.capacity = n_discrete, first, n_times, capacity
    places |= {"zero": slice(begin, places["data"].start), "end": slice(at, at)}
    return np.frombuffer(bytes(record), np.int64), np.frombuffer(bytes(pointers), np.int64), places


def stops_in(time_events: Floats, first: float, last: float) -> tuple[Floats, int]:
    """Times to step to exactly, the time events in the interval followed by its end, and the number of time events."""
    if time_events.size == 0:
        return np.array([last]), 0
    inside = np.unique(time_events[(time_events > first) & (time_events <= last)])
    if inside.size == 0 or inside[-1] < last:
        return np.append(inside, last), inside.size
    return inside, inside.size


def _check(problem: Problem) -> None:
    """Raise `ArgumentError` for invalid times or tolerances, and `StartError` for start values that are not finite."""
    times, nominal = problem.times, problem.nominal
    known = problem.layouts.get(_check, (None, None, None)) if problem.atol is None else (None, None, None)
    if times.flags.writeable or known[0] is not times or known[1] is not nominal or known[2] != problem.rtol:
        _check_tolerances(problem)
        if problem.atol is None:
            problem.layouts[_check] = times, nominal, problem.rtol
    if problem.max_steps < 1:
        raise ArgumentError(f"max_steps must be at least 1, not {problem.max_steps}")
    if not all_finite(problem.x0):
        raise StartError(f"{problem.state_name(int(np.argmin(np.isfinite(problem.x0))))} starts at a value that is not finite")


def _check_tolerances(problem: Problem) -> None:
    """Raise `ArgumentError` for invalid times or tolerances."""
    times, tolerance = problem.times, problem.absolute_tolerance
    # ufunc reductions take a third of the time of array methods
    sorted_ = times.ndim == 1 and times.size > 0 and bool(np.logical_and.reduce(times[1:] >= times[:-1]))
    if not sorted_ or not math.isfinite(times[0]) or not math.isfinite(times[-1]):
        raise ArgumentError("times must be finite and not decrease, and there must be one at least")
    if not 0.0 < problem.rtol < 1.0:
        raise ArgumentError(f"rtol must lie between 0 and 1, not {shown(problem.rtol)}")
    if tolerance.shape not in ((), (1,), problem.x0.shape):
        raise ArgumentError(f"atol is one number or {problem.x0.size} of them")
    if not (np.minimum.reduce(tolerance, axis=None) > 0.0 and np.maximum.reduce(tolerance, axis=None) < math.inf):
        raise ArgumentError("absolute tolerances must be positive and finite")
