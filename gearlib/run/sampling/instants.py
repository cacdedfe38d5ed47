"""Runs with sampled controllers and delays: the run is split at the sample instants, where Python functions set signals held up to the
next, and into pieces no longer than a delay, in which the delayed signals are those of earlier pieces.

Every piece continues from the state, the discrete state and the solution branch in which the one before ended, with the same
tolerances. The functions' return values are recorded, so that a run repeated for other variables or samples calls no function again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from types import NoneType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.switch_times import rounding
from gearlib.errors import ArgumentError, SolverError, StartError
from gearlib.program.newton import Correction, newton
from gearlib.run.methods.method import Integrates
from gearlib.run.methods.method_table import BY_TURNS, METHODS
from gearlib.run.methods.native_problem import begun_at_instants, name_of_relations, switches
from gearlib.run.methods.run import Run
from gearlib.run.sampling.controllers import Controller
from gearlib.run.sampling.delays import FEWEST, SHARE, Delay, DelayHistory, more_points, points, separate
from gearlib.run.segment import ADDED, Segment
from gearlib.run.start_values import Start
from gearlib.run.state_switching import Switched, integrate_through
from gearlib.solvers.inputs.table import Table, breakpoints, values
from gearlib.solvers.problem import Solution

if TYPE_CHECKING:
    from gearlib.flatten.model import FlatModel
    from gearlib.run.result import SimulatedResult

Floats = NDArray[np.float64]
MOST_CUTS = 1_000_000  # pieces of a run, each an integration of its own
MOST_PASSES = 30  # of the iteration for delayed signals at the start
EASY_PASSES = 3  # of these, without derivatives
STEPS = 8  # least number of steps in a piece with delays: a pulse in a delayed signal must not be stepped over


@dataclass(frozen=True)
class Pieces:
    """Recorded outputs of sampled controllers and delays.

    Attributes
    ----------
    times : tuple of float
        When its pieces begin, s.
    signals : tuple of tuple
        All inputs in each piece.
    histories : mapping of int to Table
        Inputs that delays set, by number, up to one delay after the end.
    after : tuple
        All inputs with which the run goes on.
    """

    times: tuple[float, ...]
    signals: tuple[tuple[Any, ...], ...]
    histories: Mapping[int, Table]
    after: tuple[Any, ...]


def integrate_sampled(
    first: Run, method: Integrates, switched: Switched, controllers: Sequence[Controller | Delay], known: Pieces | None = None,
    begun: bool = False, acted: bool = False,
) -> tuple[Run, Solution, Pieces]:  # fmt: skip
    """Integrate a run with sampled controllers and delays, as one run in which the inputs they set are tables.

    Parameters
    ----------
    first : Run
    method : Integrates
    switched : dict
        As for `integrate_through`.
    controllers : sequence of Controller and Delay
    known : Pieces, optional
        Recorded controller outputs of this run: the functions are not called again.
    begun, acted : bool
        Whether the run continues another one, and whether that one has already handled an instant at its start.

    Raises
    ------
    ArgumentError
        A function failed or returned something other than numbers, or the method cannot be interrupted.
    SolverError
        The integration failed.
    """
    if method is METHODS["exact"]:
        doing = "know the history" if isinstance(controllers[0], Delay) else "call the function"
        raise ArgumentError(f"method='exact' does not {doing} of {controllers[0].path}; use method='auto', 'rk' or 'ida'")
    method = BY_TURNS if method is METHODS["auto"] else method
    t0, t1 = float(first.times[0]), float(first.times[-1])
    others = np.array(sorted([*first.times.tolist(), *(t for t, _ in switches(first)[0])]))
    acting = _acting([c for c in controllers if isinstance(c, Controller)], t0, t1, others)
    if acted:
        acting.pop(t0, None)
    first = begun_at_instants(first, acting)
    histories = {
        d.gives[0]: DelayHistory.going_on(float(first.numbers.parameters[d.parameter]), first.signals[d.gives[0]], t0)
        for d in controllers if isinstance(d, Delay)
    }  # fmt: skip
    cuts = [_beside(t, others, rounding(t0, t1)) for t in cut_times(histories, acting, t0, t1)]
    begins, longest = sorted({t0, *acting, *cuts}), first.longest_step
    if histories and begins[-1] < t1 and switches(first)[1]:
        begins.append(t1)  # what acts there takes delayed signals as they are from there on
    here = replace(first, signals=_at(first.signals, controllers, t0), max_step=longest if longest < math.inf else None)
    for controller in controllers:
        if known is None and isinstance(controller, Controller) and hasattr(controller.part.function, "begin_run"):
            controller.part.function.begin_run(t0, [here.signals[k] for k in controller.gives] if begun else None)
    done: list[tuple[Run, Solution]] = []
    open_events: list[tuple[float, str]] = []
    count = FEWEST
    for n, (t, end) in enumerate(zip(begins, [*begins[1:], t1], strict=True)):
        if histories:
            windows = tuple(histories[k].window(t, end) if k in histories else s for k, s in enumerate(here.signals))
            here = begun_at_instants(replace(here, signals=windows, times=np.array([t, end])), [t])
        signals = known.signals[n] if known is not None else _asked(here, t, acting.get(t, ()))
        inner = first.times[(first.times > t) & (first.times < end)]
        piece = replace(here, times=np.array([t, *inner, end] if end > t else [t]), signals=signals, open_end=False)
        if n + 1 < len(begins) and (left := switches(piece)[1]):
            if piece.scene.structure.changing:
                integrate_through(piece, method, switched)  # refuses what would need an impulse at the end
            piece = replace(piece, open_end=True)
            open_events.append((end, name_of_relations(piece, [number for _, number in left])))
        if histories and known is None and end > t:
            parts, count = _with_history(piece, method, switched, controllers, histories, count)
        else:
            parts = integrate_through(piece, method, switched)
        if len(parts) > 1:
            raise SolverError(
                f"the states of the run become singular at t = {parts[0][1].t_last:.9g} s, and a run with sampled controllers does not go "
                "on with others: declare other variables as state='prefer'"
            )
        done += parts
        here = _following(*parts[0], end)
    at, same = np.unique([*begins, *others, t1]), rounding(t0, t1)
    following = {k: history.window(t1, t1 + history.delay).beginning_at(at, same) for k, history in histories.items()}
    after = tuple(following.get(k, s) for k, s in enumerate(done[-1][0].signals))
    whole = {k: history.whole(t0).beginning_at(at, same) for k, history in histories.items()}
    pieces = Pieces(tuple(begins), tuple(run.signals for run, _ in done), whole, after) if known is None else known
    return *_joined(first, done, pieces, controllers, open_events), pieces


def cut_times(histories: Mapping[int, DelayHistory], acting: Collection[float], t0: float, t1: float) -> list[float]:
    """Times at which the run is cut, so that no piece is longer than a delay; not next to the instants of controllers."""
    if not histories:
        return []
    least, shortest = min((h.delay, k) for k, h in histories.items())[0], rounding(t0, t1)
    if (t1 - t0) / least > MOST_CUTS:
        raise ArgumentError(f"a delay of {least:g} s cuts the run from {t0:g} to {t1:g} s into more than {MOST_CUTS} pieces")
    cuts, taken = t0 + least * np.arange(1, math.ceil((t1 - t0) / least)), np.array([-math.inf, *acting, t1])
    return [t for t in cuts.tolist() if np.abs(taken - t).min() > shortest]


def _with_history(
    run: Run, method: Integrates, switched: Switched, controllers: Sequence[Controller | Delay], histories: dict[int, DelayHistory],
    count: int,
) -> tuple[list[tuple[Run, Solution]], int]:  # fmt: skip
    """Integrate a piece, and append the signals that delays read to their histories, at enough points for accurate splines."""
    t, end = float(run.times[0]), float(run.times[-1])
    run = replace(run, max_step=min(run.longest_step, (end - t) / STEPS))
    bends = [b for history in histories.values() for b in history.bends if t < b < end]
    times = separate([*breakpoints(run.signals).tolist(), *bends], t, end)
    while True:
        grids = points(times, end, end - t, count)
        parts = integrate_through(replace(run, times=np.unique(np.concatenate([run.times, *grids]))), method, switched)
        piece, solution = parts[0]
        found = separate([*times[1:], *solution.event_times.tolist()], t, end)
        if len(parts) > 1:
            return parts, count
        if len(found) > len(times):
            times = found
            continue
        segment, read = Segment.of(piece, solution), {}
        for delay in controllers:
            if isinstance(delay, Delay):
                node, sign = run.scene.named(delay.reads[0])
                u = sign * segment.history(node) if sign else np.zeros(len(segment.time))
                read[delay.gives[0]] = [(grid, u[np.searchsorted(segment.time, grid)]) for grid in grids]
        if max(histories[k].error(points_read) for k, points_read in read.items()) <= SHARE * run.rtol:
            break
        count = more_points(count, controllers[0].path, end)
    for k, points_read in read.items():
        histories[k].add(times, points_read)
    return parts, count


def begun_with(begin: Callable[[tuple[Any, ...]], Start], run: Run, controllers: Sequence[Controller | Delay]) -> Run:
    """A run with its start; every delay sets its input to the value of its signal at the start.

    Parameters
    ----------
    begin : callable
        Returns the start with certain inputs.
    run : Run
        With the inputs, except for those that delays set.
    controllers : sequence of Controller and Delay

    Raises
    ------
    StartError
        A delayed signal at the start follows from itself, and it has no value that does, or infinitely many.
    """
    delays = [d for d in controllers if isinstance(d, Delay) and not isinstance(run.signals[d.gives[0]], Table)]

    def tried(given: Floats) -> tuple[Run, Floats]:
        """The run with some outputs of the delays, and the signals that they then take."""
        signals = list(run.signals)
        for delay, number in zip(delays, given.tolist(), strict=True):
            signals[delay.gives[0]] = number
        start = begin(tuple(signals))
        found = replace(run, signals=tuple(signals), start=start, discrete=start.discrete)
        taken = []
        for delay in delays:
            node, sign = run.scene.named(delay.reads[0])
            taken.append(float(sign * _segment(found, float(run.times[0])).history(node)[0]) if sign else 0.0)
        return found, np.array(taken)

    begun, unit = np.array([run.signals[d.gives[0]] for d in delays], float), np.eye(len(delays))
    found, slopes, passes, enough = run, np.zeros_like(unit), 0, False

    def equations(given: Floats) -> tuple[Floats, Correction]:
        nonlocal found, passes, enough
        found, taken = tried(given)
        gain = 1.0 + np.abs(slopes).sum(axis=1)
        passes, enough = passes + 1, bool((np.abs(taken - given) <= 1e-13 * gain * np.maximum(np.abs(taken), 1e-3)).all())

        def correction(error: Floats) -> Floats:
            nonlocal slopes
            if enough or passes <= EASY_PASSES:
                return error
            sizes = 1e-3 * np.maximum(np.maximum(np.abs(given), np.abs(taken)), 1e-3)
            slopes = (np.array([tried(given + step)[1] for step in np.diag(sizes)]) - taken).T / sizes
            if abs(np.linalg.det(unit - slopes)) < 1e-9:
                raise np.linalg.LinAlgError
            return np.asarray(np.linalg.solve(unit - slopes, error), float)

        return given - taken, correction

    if not delays:
        return tried(begun)[0]
    if newton(equations, begun, lambda *_: enough, MOST_PASSES).settled:
        return found
    raise StartError(
        f"the signal of {', '.join(d.path for d in delays)} at the start follows from itself: the delay gives at first what it takes, and "
        "the value does not settle. Let it pass a block with a state, such as gearparts.blocks.FirstOrder"
    )


def given_before(
    controllers: Sequence[Controller | Delay], earlier: SimulatedResult, signals: Sequence[Any], model: FlatModel, parameters: Floats
) -> tuple[Any, ...]:  # fmt: skip
    """Inputs of a run that goes on; outputs of controllers are those at the end of the earlier one, delays read its history.

    Parameters
    ----------
    controllers : sequence of Controller and Delay
    earlier : SimulatedResult
    signals : sequence
        Inputs of the run.
    model : FlatModel
    parameters : array
        The complete table of the run.

    Raises
    ------
    ArgumentError
        A delay has become longer than what the earlier run knows of its signal.
    """
    given = {k for controller in controllers for k in controller.gives}
    found = [earlier.request.signals[k] if k in given else s for k, s in enumerate(signals)]
    for delay in controllers:
        if not isinstance(delay, Delay):
            continue
        then = earlier.request.parameters[earlier.translation.model.parameters.index[model.parameters.names[delay.parameter]]]
        more, k = float(parameters[delay.parameter] - then), delay.gives[0]
        if more > 0.0 and not isinstance(earlier.request.start, (str, Mapping, NoneType)):
            raise ArgumentError(
                f"the delay of {delay.path} becomes {parameters[delay.parameter]:g} s, and the run that goes on, itself one that went on, "
                f"has kept its signal for {then:g} s; give it no longer one, or begin at the beginning"
            )
        if more and isinstance(found[k], Table):
            found[k] = found[k].later(more)
    return tuple(found)


def _acting(
    controllers: Sequence[Controller], t0: float, t1: float, others: Floats
) -> dict[float, tuple[tuple[float, Controller], ...]]:
    """The controllers that act at each instant, with the times that they are told.

    Instants that differ by rounding, also from an end of the run, are merged; so are those just behind ``others``, times at which
    something else happens: samples, or what conditions on time switch.
    """
    found: dict[float, tuple[tuple[float, Controller], ...]] = {}
    last, same = t0, rounding(t0, t1)
    for t, k in sorted((t, k) for k, controller in enumerate(controllers) for t in controller.instants(t0, t1)):
        if t - last > same:
            last = t1 if t1 - t <= same else _beside(t, others, same)
        found[last] = (*found.get(last, ()), (t, controllers[k]))
    return found


def _beside(t: float, others: Floats, same: float) -> float:
    """A time, or the first one of ``others`` that it comes after by rounding only."""
    earlier: list[float] = others[np.searchsorted(others, t - same) :][:1].tolist()
    return min([t, *earlier])


def _at(signals: Sequence[Any], controllers: Sequence[Controller | Delay], t: float) -> tuple[Any, ...]:
    """Inputs from a time on: recorded controller outputs of an earlier run, held constant."""
    given = {k for controller in controllers if isinstance(controller, Controller) for k in controller.gives}
    return tuple(float(s(t)) if k in given and isinstance(s, Table) else s for k, s in enumerate(signals))


def _asked(run: Run, t: float, acting: Sequence[tuple[float, Controller]]) -> tuple[Any, ...]:
    """The inputs from a time on, as set by controllers that act then."""
    signals = list(run.signals)
    if acting:
        segment = _segment(run, t)
        for told, controller in acting:
            named = [run.scene.named(name) for name in controller.reads]
            read = np.array([sign * segment.history(node)[0] if sign else 0.0 for node, sign in named], float)
            for k, number in zip(controller.gives, controller(told, read), strict=True):
                signals[k] = number
    return tuple(signals)


def _segment(run: Run, t: float) -> Segment:
    """A run at its start, from which other variables are computed."""
    times, states = np.array([t]), run.start.states[None, :]
    discrete = run.discrete
    if discrete is None or run.open_end:  # the latter: of the run before, whose end is this start
        inputs = values(run.signals, times)
        discrete = run.scene.discrete(run.numbers, times, states.T, inputs, start=run.start.guess, before=discrete)[:, 0]
    return Segment(run.scene, times, states, discrete[None, :], run.numbers.parameters, run.signals, run.start.guess, t)


def _following(run: Run, solution: Solution, t: float) -> Run:
    """The continuation of a run after a piece."""
    discrete = solution.discrete[-1].copy() if run.scene.n_discrete else None
    here = replace(run, start=replace(run.start, states=solution.x[-1].copy(), steady=False), discrete=discrete, slots=None)
    if run.scene.program.iterated:
        here = replace(here, start=replace(here.start, guess=_segment(here, t).guess_on_branch()))
    return here


def _joined(
    first: Run, done: Sequence[tuple[Run, Solution]], pieces: Pieces, controllers: Sequence[Controller | Delay],
    open_events: Sequence[tuple[float, str]],
) -> tuple[Run, Solution]:  # fmt: skip
    """The pieces joined into one run with its own samples; a sample at an instant holds the right-hand limit."""
    chosen = np.searchsorted(np.concatenate([run.times for run, _ in done]), first.times, side="right") - 1
    states = np.concatenate([s.x for _, s in done])[chosen]
    discrete = np.concatenate([s.discrete for _, s in done])[chosen]
    last = done[-1][1]
    stats = dict(last.stats)
    for counted in ADDED:
        counts = [s.stats.get(counted) for _, s in done]
        if counted in stats and None not in counts:
            stats[counted] = sum(counts)
    if open_events:
        stats["events"] += len(open_events)
    stats |= {"pieces": len(done), "why": f"{stats['why']}; cut at the instants of {', '.join(c.path for c in controllers)}"}
    signals = list(pieces.signals[-1])
    for k in (k for controller in controllers for k in controller.gives):
        signals[k] = (
            pieces.histories[k]
            if k in pieces.histories
            else Table(pieces.times, [piece[k] for piece in pieces.signals], interpolation="previous")
        )

    def events() -> list[tuple[float, str]]:
        return sorted([*(event for _, s in done for event in s.events()), *open_events], key=itemgetter(0))

    return replace(first, signals=tuple(signals)), replace(
        last, t=first.times, x=states, discrete=discrete, events=events, stats=stats
    )
