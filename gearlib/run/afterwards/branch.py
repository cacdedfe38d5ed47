"""Solution branches of nonlinear algebraic equations, tracked along a run independently of the samples.

sin(b - a) = 0.3 sin(b) has many solutions b for one a. The run follows one of them from its start; variables computed after the run must
be on the same branch. So the equations are solved along the run, at times independent of the samples, in steps that are halved until
the values and slopes at both ends agree: the slope, taken over a tiny interval, reveals a jump to another branch or a lost turn. At
events the unknowns may jump, so that steps end just before them. Iterations for the samples start from interpolated values.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.program.interpret import Prepared, evaluate, prepare
from gearlib.program.program import Program
from gearlib.run.scene import Scene, guess_of
from gearlib.run.start_values import Start
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
Path = Callable[[Floats], tuple[Floats, Floats, Floats]]  # times -> states, inputs, discrete state, each (number, times)
# times, states, inputs, discrete state, guess -> discrete state
Settle = Callable[[Floats, Floats, Floats, Floats, Floats | None], Floats]

POINTS, LONGEST = 2048, 32  # number of candidate step ends, and how many of them one step may pass
BESIDE = 256  # candidate step ends on the way to a single point
SLOPE = 1 / 64  # of the distance between two candidates: the interval over which a slope is taken
AGREE, SMALL = 0.02, 0.001  # of a step's length and of the range so far: agreement required of values and slopes
BETWEEN, NARROWEST = 16, 1e-10  # points inserted where a step fails; fraction of the run below which that is a jump
BEFORE = 1e-12  # of the largest time: distance of the point just before an event
MOST_EVENTS = 2000  # events at which the trajectory is evaluated on both sides


@dataclass(frozen=True)
class Branch:
    """A tracked solution branch: values and slopes of algebraic unknowns at the ends of steps."""

    nodes: tuple[Node, ...]
    times: Floats
    values: Floats  # (times, nodes)
    slopes: Floats

    def guess(self, nodes: Sequence[Node], times: Floats) -> Floats:
        """Values between the steps by cubic interpolation, (nodes, times)."""
        columns = [self.nodes.index(node) for node in nodes]
        i = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, max(len(self.times) - 2, 0))
        values, slopes = self.values[:, columns], self.slopes[:, columns]
        if len(self.times) == 1:
            return np.repeat(values.T, len(times), axis=1)
        h = (self.times[i + 1] - self.times[i])[:, None]
        s = ((times - self.times[i])[:, None] / h).clip(0.0, 1.0)
        u = 1.0 - s
        cubic = (
            values[i] * u**2 * (1 + 2 * s)
            + values[i + 1] * s**2 * (3 - 2 * s)
            + h * s * u * (u * slopes[i] - s * slopes[i + 1])
        )
        result: Floats = cubic.T
        return result


def iterated_unknowns(program: Program) -> tuple[NDArray[np.int64], tuple[Node, ...]]:
    """Slots of the unknowns of a program's nonlinear blocks, and the variables that they hold."""
    unknowns = np.concatenate([step.unknowns for step in program.iterated])
    by_slot = {slot: node for node, slot in program.slots.items()}
    return unknowns, tuple(by_slot[slot] for slot in unknowns.tolist())


def follow(
    prepared: Prepared, path: Path, begin: float, end: float, events: Floats, guess: Floats, settle: Settle | None = None,
    points: int = POINTS,
) -> Branch:  # fmt: skip
    """Track the unknowns of a program's nonlinear blocks from the start of a run.

    Parameters
    ----------
    prepared : Prepared
    path : callable
        The run's trajectory at any times.
    begin, end : float
        Interval of the run (s).
    events : array
        Times of events.
    guess : array, shape (slots,)
        Start of the iterations at the beginning.
    settle : callable, optional
        Finds the discrete state that is not part of the path since it depends on the unknowns.
    points : int
        Number of candidate step ends, before some are inserted.

    Raises
    ------
    SolverError
        The equations have no solution at some time.
    """
    return _Tracking(prepared, path, begin, end, events, guess, settle, points).whole()


def slots_on_branch(scene: Scene, prepared: Prepared, start: Start, inputs: Floats, t: float, x: Floats) -> Floats:
    """Start of a program's iterations at some states, on the branch that leads there from the start of a run, shape (slots,).

    The states go there on a straight line.
    """
    program = prepared.program
    guess = guess_of(program, start.guess)
    if not program.iterated or (x == start.states).all():
        return guess
    numbers = scene.numbers(prepared.parameters)

    def path(parts: Floats) -> tuple[Floats, Floats, Floats]:
        states = start.states[:, None] + (x - start.states)[:, None] * parts
        given, now = np.repeat(inputs[:, None], len(parts), axis=1), np.full(len(parts), t)
        return states, given, scene.discrete(numbers, now, states, given, start=start.guess)

    branch = follow(prepared, path, 0.0, 1.0, np.empty(0), guess, points=BESIDE)
    guess[iterated_unknowns(program)[0]] = branch.values[-1]
    return guess


def variables_on_branch(scene: Scene, parameters: Floats, start: Start, inputs: Floats, t: float, x: Floats) -> Floats:
    """Start of iterations at some states, on the branch that leads there from the start of a run, shape (variables,)."""
    program, guess = scene.iterating, start.guess.copy()
    if program is not None:
        found = slots_on_branch(scene, prepare(program, scene.structure, parameters), start, inputs, t, x)
        for slot, (v, k) in zip(*iterated_unknowns(program), strict=True):
            if not k:
                guess[v] = found[slot]
    return guess


class _Tracking:
    """Candidate points along a run, what is known there, and how far the unknowns have been tracked."""

    def __init__(
        self, prepared: Prepared, path: Path, begin: float, end: float, events: Floats, guess: Floats, settle: Settle | None,
        points: int,
    ) -> None:  # fmt: skip
        self.prepared, self.path, self.start, self.settle = prepared, path, guess, settle
        self.unknowns, self.nodes = iterated_unknowns(prepared.program)
        self.span = end - begin
        inside = np.unique(events[(events > begin) & (events <= end)])[:MOST_EVENTS]
        before = inside - BEFORE * max(abs(begin), abs(end))
        self.events, self.jumps = inside, set(inside.tolist())
        self.places = np.unique(np.concatenate([np.linspace(begin, end, points + 1), before[before > begin], inside]))
        # Path at known times, with the index of the time in its batch
        self.known: dict[float, tuple[tuple[Floats, Floats, Floats], int]] = {}
        self.delta: dict[float, float] = {}
        self._look(self.places, self.span / points, end)

    def _look(self, places: Floats, apart: float, end: float) -> None:
        """Evaluate the trajectory at some points, and beside them for slopes: after them, unless an event or the end comes first."""
        after = places + SLOPE * apart
        passed = np.searchsorted(self.events, after, side="right") > np.searchsorted(self.events, places, side="right")
        near = np.maximum(np.where(passed | (after > end), places - SLOPE * apart, after), self.places[0])
        self.delta |= dict(zip(places.tolist(), near.tolist(), strict=True))
        times = np.unique(np.concatenate([places, near]))
        along = self.path(times)
        self.known |= {t: (along, i) for i, t in enumerate(times.tolist())}

    def _solve(self, t: float, z: Floats) -> Floats:
        guess = self.start.copy()
        guess[self.unknowns] = z
        along, i = self.known[t]
        x, u, discrete = (given[:, i : i + 1] for given in along)
        if self.settle is not None:
            discrete = self.settle(np.array([t]), x, u, discrete, guess)
        solved: Floats = evaluate(self.prepared, np.array([t]), x, u, discrete, guess)[self.unknowns, 0]
        return solved

    def _slope(self, t: float, z: Floats) -> Floats:
        near = self.delta[t]
        if near == t:
            return np.zeros(len(z))
        return (self._solve(near, z) - z) / (near - t)

    def whole(self) -> Branch:
        t = float(self.places[0])
        z = self._solve(t, self.start[self.unknowns])
        found = [(t, z, self._slope(t, z))]
        low, high = z.copy(), z.copy()
        i, stride = 0, LONGEST // 4
        while i < len(self.places) - 1:
            t, z, slope = found[-1]
            jump = float(self.places[i + 1]) in self.jumps
            j = i + 1 if jump else self._reach(i, stride)
            following = float(self.places[j])
            narrow = following - t <= NARROWEST * self.span
            step = self._step(t, z, slope, following, float(self.places[(i + j) // 2]), high - low, jump or narrow)
            if step is None and j > i + 1:
                stride = max(1, (j - i) // 2)
            elif step is None:
                apart = (following - t) / (BETWEEN + 1)
                more = np.linspace(t, following, BETWEEN + 2)[1:-1]
                self._look(more, apart, following)
                self.places = np.concatenate([self.places[: i + 1], more, self.places[i + 1 :]])
            else:
                found.append((following, *step))
                low, high = np.minimum(low, step[0]), np.maximum(high, step[0])
                i, stride = j, min(LONGEST, 2 * stride)
        times, values, slopes = zip(*found, strict=True)
        return Branch(self.nodes, np.array(times), np.array(values), np.array(slopes))

    def _reach(self, i: int, stride: int) -> int:
        """Index of the point to step to: at most just before the next event."""
        for j in range(i + 1, min(i + stride, len(self.places) - 1)):
            if float(self.places[j + 1]) in self.jumps:
                return j
        return min(i + stride, len(self.places) - 1)

    def _step(
        self, t: float, z: Floats, slope: Floats, end: float, middle: float, covered: Floats, jump: bool
    ) -> tuple[Floats, Floats] | None:
        """Value and slope at the end of a step; None if they disagree with those at its beginning or midpoint."""
        h = end - t
        try:
            later = self._solve(end, z if jump else z + h * slope)
            later_slope = self._slope(end, later)
            if jump:
                return later, later_slope
            ends = Branch(self.nodes, np.array([t, end]), np.array([z, later]), np.array([slope, later_slope]))
            between = ends.guess(self.nodes, np.array([middle]))[:, 0]
            halfway = self._solve(middle, between)
        except SolverError:
            if jump:
                raise
            return None
        allowed = 0.5 * AGREE * h * (np.abs(slope) + np.abs(later_slope)) + SMALL * covered + 1e-9 * np.abs(z)
        error = np.abs(later - z - 0.5 * h * (slope + later_slope))
        agree = bool((error <= allowed).all() and (np.abs(halfway - between) <= allowed).all())
        return (later, later_slope) if agree else None
