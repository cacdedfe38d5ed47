"""Run-time choice between an explicit and an implicit method, by their progress per unit of work.

The explicit method begins. Where stability limits its steps, its pace is known: seconds of motion per unit of work. If the rest of the
run would then cost much more than a trial, the implicit method takes over for a bounded amount of work. It stays as long as its pace is
the better one; otherwise the explicit method continues from where the trial ended, and the next trial comes after twice as much work.
So the worse method costs only a small share of the run, whichever it is.

Work is counted (right-hand sides, Jacobians, factorisations, steps, each weighted by its operations) rather than timed: a run makes the
same choice on every machine, under any load, and for any samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from gearlib.errors import SolverError
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.problem import Solution

# All of these were chosen on the random trains of tests/stress/choice_campaign.py: at equal rtol, the processor time of the choice over
# that of the best method, in the median and in the worst cases.
# Remaining work, in trials, that justifies one: where a decay limits the steps, and where a vibration does
WORTH_DECAY, WORTH_VIBRATION = 2.0, 4.0
SETTLE, WINDOW = 60, 40  # steps of a trial before its pace is measured, and over which it is measured
SHARE = 0.1  # largest share of a trial in the work so far, and in the work that remains between two trials
# Share of the remaining work, at the explicit pace, that a trial may take: IDA speeds up once fast vibrations have died out
EARLY = 0.03
APART = 10.0  # least work between two trials, in trials
SOON = 4.0  # the same after the first one where the work that remains is small
CLOSE = 0.5  # share of the explicit pace from which a trial is extended
LOST = 2.0  # work, in trials, that the implicit method may lose against the explicit pace before it hands back


class Watchful(Protocol):
    """A stepper that detects when stability limits its steps; told to watch, it then stops with the status "stiff"."""

    @property
    def pace(self) -> float:
        """Seconds of motion per nanosecond of work, since stability has limited the steps."""

    @property
    def damped(self) -> bool:
        """Whether the motion that limits the steps is a decay rather than a vibration."""

    def watch(self, work_first: float = ...) -> None:
        """Watch for stiffness, and stop once it limits the steps, after a given amount of further work."""


@dataclass(frozen=True)
class Leg:
    """The part of a run that one method integrated; ``stayed``: by choice, rather than on trial."""

    method: str  # "explicit" or "implicit"
    run: Driver  # at its end
    solution: Solution
    stayed: bool = True


def alternate(
    explicit: Callable[[list[Leg]], tuple[Driver, Watchful]],
    implicit: Callable[[Sequence[Leg]], Driver],
    trial: Callable[[], tuple[float, float]],
    t_end: float,
) -> list[Leg]:
    """Integrate to the end, or to where a method reports that its states have become singular.

    Parameters
    ----------
    explicit, implicit : callable
        Make the run of a method, continuing from the last of the given legs, or from the start if there are none; the explicit one
        comes with its stepper, and may add a leg at the start.
    trial : callable
        Returns the work of starting the implicit method and of leaving it again, and of the steps of the shortest trial.
    t_end : float
        s.

    Raises
    ------
    SolverError
        The active method failed. If a method on trial fails, the explicit one continues.
    """
    legs: list[Leg] = []
    (run, stepper), wait, before = explicit(legs), 0.0, -1.0
    stepper.watch()
    while True:
        if _to_the_end(run):
            return [*legs, Leg("explicit", run, run.solution())]
        if before < 0.0:
            (start, steps), before = trial(), sum(leg.run.work for leg in legs)
            shortest = start + steps
        pace = max(stepper.pace, 1e-300)
        left = (t_end - run.t) / pace
        if left < (WORTH_DECAY if stepper.damped else WORTH_VIBRATION) * shortest:
            stepper.watch(left / 2)  # the remaining work decreases; it may also become harder
            continue
        here, spent = Leg("explicit", run, run.solution()), before + run.work
        other = implicit([*legs, here])
        try:
            most = max(steps, SHARE * min(spent, left / 2) - start, EARLY * left)
            faster = tried(other, pace, most, max(most, shortest))
        except SolverError:
            other.close()
            wait = max(2.0 * wait, APART * shortest)
            stepper.watch(wait)
            continue
        try:
            legs.append(here)
            to_the_end = faster and stays(other, pace, spent, shortest)
            legs.append(Leg("implicit", other, other.solution(), stayed=faster))
            if to_the_end:
                return legs
            before = spent + other.work
            if faster:
                wait = APART * shortest
            elif wait or EARLY * left > start:
                wait = max(min(2.0 * wait, SHARE * left), APART * (start + other.work))
            else:  # a short run, in which vibrations may die out soon
                wait = SOON * (start + other.work)
        finally:
            other.close()
        run, stepper = explicit(legs)
        stepper.watch(wait)


def _to_the_end(run: Driver) -> bool:
    """Continue until stability limits the steps (False), or to the end."""
    while run.advance() == "more":
        pass
    return run.status != "stiff"


def tried(other: Driver, pace: float, most: float, most_if_close: float) -> bool:
    """Whether the implicit method makes faster progress than the explicit one did, within a bounded amount of work.

    Where it comes close, it is given more of it: waiting then costs little, and fast vibrations may be about to die out.
    """
    if other.advance(SETTLE) != "more":
        return True
    close = False
    while other.work <= (most_if_close if close else most):
        t, work = other.t, other.work
        if other.advance(WINDOW) != "more":
            return True
        reached = (other.t - t) / (other.work - work)
        if reached >= pace:
            return True
        close = reached >= CLOSE * pace
    return False


def stays(other: Driver, pace: float, spent: float, trial: float) -> bool:
    """Continue as long as not too much is lost against a pace in one stretch; returns whether the end was reached.

    After an event the implicit method is slow for a while, which is no reason to leave it.
    """
    lost, steps = 0.0, 0
    while other.status == "more":
        t, work, window = other.t, other.work, max(WINDOW, int(SHARE * steps))  # a call takes as long as several steps
        other.advance(window)
        steps += window
        lost = max(0.0, lost + other.work - work - (other.t - t) / pace)
        if other.status == "more" and lost > max(LOST * trial, SHARE * (spent + other.work)):
            return False
    return True
