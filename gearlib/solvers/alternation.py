"""The choice between an explicit and an implicit method while a run goes on, by how far a unit of work takes each of them.

The explicit method begins. Where stability limits its steps, its pace is known: seconds of the motion for each unit of work. If what
is left would then cost much more than a trial, the implicit method goes on from there for a bounded amount of work. It stays as
long as its pace is the better one; if it is not, the explicit method goes on from where the trial ended, and the next trial comes
after twice as much work as this one. What the worse method costs is so a small share of the run, whichever it is.

Work is counted (right-hand sides, Jacobians, factorisations, steps, each weighted by its operations), not measured: the same run
makes the same choice on every machine, however busy it is, and whatever samples are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from gearlib.errors import SolverError
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.problem import Solution

WORTH_DECAY, WORTH_VIBRATION = 2.0, 4.0  # trials that must be left, where a decay limits the steps, and where a vibration does
SETTLE, WINDOW = 60, 40  # steps of a trial before its pace is looked at, and over which that is taken
SHARE = 0.1  # of all work so far that a trial may take, and of what is left, at most, between two trials
EARLY = 0.03  # of what is left, by the explicit method's pace, that a trial may take: IDA must let a fast vibration die before it gets on
APART = 10.0  # trials' work between two trials, at least
LOST = 2.0  # trials' work that the implicit method may lose against the explicit one's pace before it hands back


class Watchful(Protocol):
    """A stepper that knows when stability limits its steps: it then stops with the status "stiff", if it was told to watch."""

    @property
    def pace(self) -> float: ...

    @property
    def damped(self) -> bool: ...

    def watch(self, work_first: float = ...) -> None: ...


@dataclass(frozen=True)
class Leg:
    """A part of a run that one method went; ``stayed``: by choice, rather than on trial."""

    method: str  # "explicit" or "implicit"
    run: Driver  # as it ended
    solution: Solution
    stayed: bool = True


def alternate(
    explicit: Callable[[Sequence[Leg]], tuple[Driver, Watchful]],
    implicit: Callable[[Sequence[Leg]], Driver],
    trial: float,
    t_end: float,
) -> list[Leg]:
    """Integrate to the end, or to where a method leaves what its states describe.

    Parameters
    ----------
    explicit, implicit : callable
        Make a method's run, which goes on from where the last of some legs ended, from the start where there is none; the explicit one
        with its stepper.
    trial : float
        The work of the shortest trial, with all that it takes to begin one.
    t_end : float
        s.

    Raises
    ------
    SolverError
        The method that was at work failed. If one on trial does, the explicit one goes on.
    """
    legs: list[Leg] = []
    (run, stepper), wait, before = explicit(legs), 0.0, 0.0
    stepper.watch()
    while True:
        if _to_the_end(run):
            return [*legs, Leg("explicit", run, run.solution())]
        pace = max(stepper.pace, 1e-300)
        left = (t_end - run.t) / pace
        if left < (WORTH_DECAY if stepper.damped else WORTH_VIBRATION) * trial:
            stepper.watch(left / 2)  # what is left becomes less; it may also become harder
            continue
        here, spent = Leg("explicit", run, run.solution()), before + run.work
        other = implicit([*legs, here])
        try:
            faster = _tried(other, pace, max(trial, SHARE * min(spent, left / 2), EARLY * left))
        except SolverError:
            other.close()
            wait = max(2.0 * wait, APART * trial)
            stepper.watch(wait)
            continue
        try:
            legs.append(here)
            to_the_end = faster and _stays(other, pace, spent, trial)
            legs.append(Leg("implicit", other, other.solution(), stayed=faster))
            if to_the_end:
                return legs
            before = spent + other.work
            wait = APART * trial if faster else _longer(wait, max(trial, other.work), left)
        finally:
            other.close()
        run, stepper = explicit(legs)
        stepper.watch(wait)


def _longer(wait: float, trial: float, left: float) -> float:
    """The work until the next trial, after one that has come to nothing."""
    return max(min(2.0 * wait, SHARE * left), APART * trial)


def _to_the_end(run: Driver) -> bool:
    """Go on until stability limits the steps (False), or to the end."""
    while run.advance() == "more":
        pass
    return run.status != "stiff"


def _tried(other: Driver, pace: float, most: float) -> bool:
    """Whether the implicit method gets on faster than the explicit one did, after no more than some work."""
    if other.advance(SETTLE) != "more":
        return True
    while other.work <= most:
        t, work = other.t, other.work
        if other.advance(WINDOW) != "more":
            return True
        if (other.t - t) / (other.work - work) >= pace:
            return True
    return False


def _stays(other: Driver, pace: float, spent: float, trial: float) -> bool:
    """Go on as long as not too much is lost against a pace in one stretch; whether that was to the end.

    After an event the implicit method is slow for a while, which is no reason to leave it.
    """
    lost = 0.0
    while other.status == "more":
        t, work = other.t, other.work
        other.advance(WINDOW)
        lost = max(0.0, lost + other.work - work - (other.t - t) / pace)
        if other.status == "more" and lost > max(LOST * trial, SHARE * (spent + other.work)):
            return False
    return True
