"""`LiveRun`: a driver that persists between advances, with the step sizes, orders and Jacobians of its method."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.switch_times import rounding
from gearlib.errors import SolverError
from gearlib.native.layout import Shared
from gearlib.program.relations import jumps_below
from gearlib.run.methods.automatic import handed_over
from gearlib.run.methods.explicit import Explicit
from gearlib.run.methods.implicit import Implicit
from gearlib.run.methods.method import Integrates, Method, explained
from gearlib.run.methods.method_table import BY_TURNS
from gearlib.run.methods.native_problem import named_events, problem_of, time_events
from gearlib.run.methods.run import Run, is_function
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.ida.ida_stepper import trial
from gearlib.solvers.inputs.moving import Callbacks
from gearlib.solvers.inputs.table import Table
from gearlib.solvers.rungekutta.rungekutta import RungeKutta

Floats = NDArray[np.float64]
AHEAD = 200.0  # number of advances for which time events are computed at a time
LONG = 10.0  # work of stiff Runge-Kutta steps, in trials of IDA, before IDA takes over; and of IDA before the two are compared again


def can_live(run: Run, method: Integrates) -> bool:
    """Whether a run's driver can persist: tables, scenes without states, and such whose equations may jump restart at each advance."""
    scene, stepped = run.scene, method is BY_TURNS or (isinstance(method, Method) and method.steps)
    if not stepped or not scene.states or jumps_below(scene.structure, scene.program, run.numbers.parameters):
        return False
    return not any(isinstance(s, Table) for s in run.signals)


class LiveRun:
    """A driver that persists from one advance to the next.

    If the method is automatic, Runge-Kutta integrates until stability has limited its steps for long, then IDA, as long as that makes
    faster progress for the same work.

    Parameters
    ----------
    run : Run
        From the current time to the first time to advance to.
    method : Integrates
        A method that passes `can_live`.

    Attributes
    ----------
    events : list of (float, str)
        Those of the last advance.
    """

    events: list[tuple[float, str]]

    def __init__(self, run: Run, method: Integrates) -> None:
        self.run, self.signals = run, run.signals
        self._turns, self._wait, self._rival_pace = method is BY_TURNS, 1.0, 0.0  # s of motion per ns of work
        self._method = method if isinstance(method, Method) else Explicit()
        self._known, self._known_until, self._reached = np.empty(0), -np.inf, -np.inf
        self.callbacks, self._seen = Callbacks(), 0
        self._begin()

    def _begin(self, before: Driver | None = None) -> None:
        """Start the run's method, initially or where another one has stopped."""
        run, jacobian = self.run, self._method.jacobian
        if before is None:
            problem = problem_of(run, self.callbacks, jacobian)
            stepper = self._method.stepper(problem)
            self.driver = Driver(problem, stepper)
        else:
            stepper = self._method.stepper(before.problem)
            self.driver = handed_over(run, self.callbacks, before, stepper, jacobian)
            before.close()
        self._new, self._discrete, self._t = True, self.driver.problem.discrete, self.driver.t
        self._trial = sum(trial(self.driver.problem))
        if self._turns and isinstance(stepper, RungeKutta):
            stepper.watch(self._wait * LONG * self._trial)

    def _change(self, method: Method) -> None:
        """Hand over to another method."""
        self._method = method
        self._begin(self.driver)

    @property
    def states(self) -> Floats:
        """Current states."""
        return self.driver.x[: len(self.run.scene.states)].copy()

    @property
    def discrete(self) -> Floats | None:
        """Current relations and discrete variables."""
        return self.driver.data[self._discrete].copy() if self.run.scene.n_discrete else None

    def takes(self, signals: tuple[Any, ...]) -> bool:
        """Set inputs from now on; returns whether that was possible without a restart."""
        changed = [k for k, (a, b) in enumerate(zip(self.signals, signals, strict=True)) if a is not b]
        if not all(isinstance(s[k], Real) for s in (self.signals, signals) for k in changed):
            return False
        if changed:
            scene = self.run.scene
            program = scene.program
            place = Shared(len(scene.model.parameters.names), scene.n_discrete, len(program.inputs)).inputs
            for k in changed:
                if k < len(program.inputs):
                    self.driver.data[place + k] = float(signals[k])
            self.signals = signals
            self.run = replace(self.run, signals=signals)
            self.driver.begin_anew()
        return True

    def to(self, run: Run) -> bool:
        """Advance to the end of a run that begins here; False if its states become singular on the way.

        Raises
        ------
        SolverError
            The integration failed.
        """
        self.run, self.events = run, []
        t0, t = float(run.times[0]), float(run.times[-1])
        if self._turns and isinstance(self._method, Implicit) and self.driver.work > LONG * self._trial:
            if self.driver.t - self._t < self._rival_pace * self.driver.work:
                self._wait *= 2.0
                self._change(Explicit())
        events = self._time_events(t0, t)
        if not self._new:
            self.driver.go_on(t, events, run.longest_step)
        try:
            with self.callbacks.listening() if any(map(is_function, run.signals)) else nullcontext():
                status = self._arrive()
        except SolverError as problem:
            raise self.callbacks.failure() or explained(problem, run.scene) from None
        if (failure := self.callbacks.failure()) is not None:
            raise failure
        self._log()
        self._new = False
        return status == "done"

    def _arrive(self) -> str:
        """Take the steps, handing over to IDA where stability limits them."""
        while (status := self.driver.advance()) in ("more", "stiff"):
            stepper = self.driver.stepper
            if status == "stiff" and isinstance(stepper, RungeKutta) and self.driver.t < self.driver.t_end:
                self._rival_pace = stepper.pace
                self._log()
                self._change(Implicit())
        return status

    def _time_events(self, t0: float, t: float) -> Floats:
        """Known event times to step to exactly, computed many advances ahead: those that no advance before has reached."""
        reached, self._reached = self._reached, _reach(t0, t)
        if self._new or not self.run.scene.time_switches.timed:
            return self._known
        if t > self._known_until:
            self._known_until = t0 + AHEAD * (t - t0)
            before = t0 - (t - t0) - 2.0 * rounding(t0, self._known_until)  # none are known next to where a run begins
            self._known = time_events(replace(self.run, times=np.array([before, self._known_until])))
        return np.minimum(self._known[(self._known >= reached) & (self._known < self._reached)], t)

    def _log(self) -> None:
        """Append the new events."""
        seen, self._seen = self._seen, self.driver.record.events
        if self._seen > seen:
            self.events += named_events(self.run, self.driver.solution())[seen:]

    def __del__(self) -> None:
        if "driver" in vars(self):
            self.close()

    def close(self) -> None:
        """Release the resources of the method."""
        self.driver.close()


def _reach(t0: float, t: float) -> float:
    """Time before which `time_events` of a run from ``t0`` to ``t`` knows what switches: within rounding behind its end."""
    beyond = t + 2.0 * rounding(t0, t)
    return beyond - rounding(t0, beyond)
