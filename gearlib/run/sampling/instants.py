"""Runs with sampled controllers: the run is split at the sample instants, where Python functions set signals held up to the next.

Every piece continues from the state, the discrete state and the solution branch in which the one before ended, with the same
tolerances. The functions' return values are recorded, so that a run repeated for other variables or samples calls no function again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.switch_times import rounding
from gearlib.errors import ArgumentError, SolverError
from gearlib.run.methods.method import Integrates
from gearlib.run.methods.method_table import BY_TURNS, METHODS
from gearlib.run.methods.run import Run
from gearlib.run.sampling.controllers import Controller
from gearlib.run.segment import Segment
from gearlib.run.state_switching import Switched, integrate_through
from gearlib.solvers.inputs.table import Table, values
from gearlib.solvers.problem import Solution

Floats = NDArray[np.float64]
ADDED = ("steps", "attempts", "rejected", "rhs", "jac", "events", "restarts", "work", "seconds")  # over the pieces of a run


@dataclass(frozen=True)
class Pieces:
    """Recorded outputs of sampled controllers: the times at which pieces of a run begin, and all inputs from there on."""

    times: tuple[float, ...]
    signals: tuple[tuple[Any, ...], ...]


def integrate_sampled(
    first: Run, method: Integrates, switched: Switched, controllers: Sequence[Controller], known: Pieces | None = None,
    begun: bool = False,
) -> tuple[Run, Solution, Pieces]:  # fmt: skip
    """Integrate a run with sampled controllers, as one run in which the inputs they set are tables.

    Parameters
    ----------
    first : Run
    method : Integrates
    switched : dict
        As for `integrate_through`.
    controllers : sequence of Controller
    known : Pieces, optional
        Recorded controller outputs of this run: the functions are not called again.
    begun : bool
        Whether the run continues one that has already handled an instant at its start.

    Raises
    ------
    ArgumentError
        A function failed or returned something other than numbers, or the method cannot be interrupted.
    SolverError
        The integration failed.
    """
    if method is METHODS["exact"]:
        raise ArgumentError(
            f"method='exact' does not call the function of {controllers[0].path}; use method='auto', 'rk' or 'ida'"
        )
    method = BY_TURNS if method is METHODS["auto"] else method
    t0, t1 = float(first.times[0]), float(first.times[-1])
    acting = _acting(controllers, t0, t1)
    if begun:
        acting.pop(t0, None)
    begins, longest = sorted({t0, *acting}), first.longest_step
    here = replace(first, signals=_at(first.signals, controllers, t0), max_step=longest if longest < math.inf else None)
    done: list[tuple[Run, Solution]] = []
    for n, (t, end) in enumerate(zip(begins, [*begins[1:], t1], strict=True)):
        signals = known.signals[n] if known is not None else _asked(here, t, acting.get(t, ()))
        inner = first.times[(first.times > t) & (first.times < end)]
        parts = integrate_through(
            replace(here, times=np.array([t, *inner, end] if end > t else [t]), signals=signals), method, switched
        )
        if len(parts) > 1:
            raise SolverError(
                f"the states of the run become singular at t = {parts[0][1].t_last:.9g} s, and a run with sampled controllers does not go "
                "on with others: declare other variables as state='prefer'"
            )
        done += parts
        here = _following(*parts[0], end)
    pieces = Pieces(tuple(begins), tuple(run.signals for run, _ in done))
    return *_joined(first, done, pieces, controllers), pieces


def _acting(controllers: Sequence[Controller], t0: float, t1: float) -> dict[float, tuple[Controller, ...]]:
    """Which controllers act at which time; instants that differ by rounding are merged."""
    found: dict[float, tuple[Controller, ...]] = {}
    last, same = -math.inf, rounding(t0, t1)
    for t, k in sorted((t, k) for k, controller in enumerate(controllers) for t in controller.instants(t0, t1)):
        last = last if t - last <= same else t
        found[last] = (*found.get(last, ()), controllers[k])
    return found


def _at(signals: Sequence[Any], controllers: Sequence[Controller], t: float) -> tuple[Any, ...]:
    """Inputs from a time on: recorded controller outputs of an earlier run, held constant."""
    given = {k for controller in controllers for k in controller.gives}
    return tuple(float(s(t)) if k in given and isinstance(s, Table) else s for k, s in enumerate(signals))


def _asked(run: Run, t: float, controllers: Sequence[Controller]) -> tuple[Any, ...]:
    """The inputs from a time on, after controllers were called."""
    signals = list(run.signals)
    if controllers:
        segment = _segment(run, t)
        for controller in controllers:
            named = [run.scene.named(name) for name in controller.reads]
            read = np.array([sign * segment.history(node)[0] if sign else 0.0 for node, sign in named], float)
            for k, number in zip(controller.gives, controller(t, read), strict=True):
                signals[k] = number
    return tuple(signals)


def _segment(run: Run, t: float) -> Segment:
    """A run at its start, from which other variables are computed."""
    times, states = np.array([t]), run.start.states[None, :]
    modes = run.modes
    if modes is None:
        inputs = values(run.signals, times, len(run.scene.program.inputs))
        modes = run.scene.modes(run.numbers, times, states.T, inputs, start=run.start.guess)[:, 0]
    return Segment(run.scene, times, states, modes[None, :], run.numbers.parameters, run.signals, run.start.guess, t)


def _following(run: Run, solution: Solution, t: float) -> Run:
    """The continuation of a run after a piece."""
    modes = solution.modes[-1].copy() if run.scene.n_modes else None
    here = replace(run, start=replace(run.start, states=solution.x[-1].copy(), steady=False), modes=modes, slots=None)
    program = run.scene.program
    if program.iterated:  # on the solution branch of the run
        segment, guess = _segment(here, t), run.start.guess.copy()
        for v in program.undifferentiated[0].tolist():
            guess[v] = segment.history((v, 0))[0]
        here = replace(here, start=replace(here.start, guess=guess))
    return here


def _joined(
    first: Run, done: Sequence[tuple[Run, Solution]], pieces: Pieces, controllers: Sequence[Controller]
) -> tuple[Run, Solution]:
    """The pieces joined into one run with its own samples; a sample at an instant holds the right-hand limit."""
    chosen = np.searchsorted(np.concatenate([run.times for run, _ in done]), first.times, side="right") - 1
    states = np.concatenate([s.x for _, s in done])[chosen]
    modes = np.concatenate([s.modes for _, s in done])[chosen]
    last = done[-1][1]
    stats = dict(last.stats)
    for counted in ADDED:
        counts = [s.stats.get(counted) for _, s in done]
        if counted in stats and None not in counts:
            stats[counted] = sum(counts)
    stats |= {"pieces": len(done), "why": f"{stats['why']}; cut at the instants of {', '.join(c.path for c in controllers)}"}
    signals = list(pieces.signals[-1])
    for k in (k for controller in controllers for k in controller.gives):
        signals[k] = Table(pieces.times, [piece[k] for piece in pieces.signals], interpolation="previous")
    events = [event for _, s in done for event in s.events]
    return replace(first, signals=tuple(signals)), replace(
        last, t=first.times, x=states, modes=modes, events=events, stats=stats
    )
