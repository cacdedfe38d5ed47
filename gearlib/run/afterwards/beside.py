"""States that a run did not integrate, integrated beside its stored motion: they depend on it, and it does not depend on them.

Most are integrals: absolute angles, heat, work. Their derivatives are evaluated at Gauss' points between the ends of the run's steps
(`Trace`), for all times at once; integrals of integrals follow in turn. Everything is computed twice, the first time with a coarser
method and coarser polynomials. The run is repeated where the two disagree, or where an additional state depends on itself or on an event
that the run did not locate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.run.methods.run import is_function
from gearlib.run.scene import Scene
from gearlib.run.segment import Segment
from gearlib.solvers.drive.trace import Trace
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import reach

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Level = tuple[Node, ...]

FINER = (1, 4, 16)  # parts into which each step is divided, tried in turn
AGREE = 0.5  # times the tolerance: difference allowed between the two computations
AT_ONCE = 2_000_000  # numbers in the memory of an evaluation (16 MB)


class Gauss:
    """Gauss' method: points in 0 .. 1, weights, and the integrals of Lagrange's polynomials up to each point."""

    def __init__(self, order: int) -> None:
        roots, weights = np.polynomial.legendre.leggauss(order)
        self.points, self.weights = 0.5 * (1.0 + roots), 0.5 * weights
        powers = np.vander(self.points, increasing=True)
        self.up_to = powers * self.points[:, None] / np.arange(1, order + 1) @ np.linalg.inv(powers)


FINE, COARSE = Gauss(4), Gauss(3)


def integrated_beside(part: Segment, scene: Scene, start: Floats, rtol: float) -> Floats | None:
    """Histories of a scene with additional states that starts at ``start``, shape (samples, states); None: the run must be repeated."""
    added = tuple(s for s in scene.states if s not in part.scene.place_of)
    levels = _levels(scene, added)
    if part.trace is None or levels is None or not _known_discrete(part.scene, scene, levels):
        return None
    if any(is_function(signal) for signal in part.signals) or part.trace.times[0] > part.time[0]:
        return None
    kept = np.array([scene.place_of[s] for s in part.scene.states], np.int64)
    if not np.allclose(start[kept[part.trace.columns]], part.trace.states[0], rtol=1e-9, atol=1e-9 * rtol):
        return None  # the additional states take part in what the start is computed from
    beside = _Beside(part, scene, part.trace, levels, kept, start)
    tolerance = rtol * scene.nominal
    for m in FINER:
        with np.errstate(all="ignore"):  # values that are not finite: the run is repeated
            coarse, fine = beside.integrals(m, COARSE), beside.integrals(m, FINE)
        columns = [scene.place_of[s] for s in added]
        allowed = AGREE * (tolerance[columns] + rtol * np.abs(fine[:, columns]).max(axis=0))
        if (np.abs(fine - coarse)[:, columns].max(axis=0) <= allowed).all():
            return fine[beside.samples]
    return None


def _levels(scene: Scene, added: Sequence[Node]) -> list[Level] | None:
    """Additional states in groups, each of which depends on the groups before it; None if a state depends on itself."""
    needs: dict[Node, set[Node]] = {}
    for v, k in added:
        _, states = reach(scene.structure, [(v, k + 1)], dynamic=False, events=True)
        needs[v, k] = states & set(added)
    found: list[Level] = []
    while needs:
        ready = tuple(s for s, on in needs.items() if not on & needs.keys())
        if not ready:
            return None
        found.append(ready)
        for state in ready:
            del needs[state]
    return found


def _known_discrete(own: Scene, scene: Scene, levels: Sequence[Level]) -> bool:
    """Whether the run has tracked all relations in the derivatives, and these need no iteration."""
    if scene.relations is not None:
        theirs, ours = scene.relations, own.relations
        if ours is None or not set(theirs.used.tolist()) <= set(ours.used.tolist()):
            return False
        for one, other in ((theirs.discretes, ours.discretes), (theirs.reinits, ours.reinits)):
            if sum(len(b.targets) for b in one) != sum(len(b.targets) for b in other):
                return False
    for level in levels:
        scene.compute_together([(v, k + 1) for v, k in level])
    return not any(
        scene.computing((v, k + 1)).iterated for level in levels for v, k in level if (v, k + 1) not in scene.place_of
    )


@dataclass(frozen=True)
class _Beside:
    part: Segment
    scene: Scene
    trace: Trace
    levels: list[Level]
    kept: Integers  # places of the run's own states
    start: Floats

    @property
    def edges(self) -> Floats:
        """Ends of steps, and samples."""
        times = self.part.time
        inside = times[(times >= self.trace.times[0]) & (times <= self.trace.times[-1])]
        found: Floats = np.union1d(self.trace.times, inside)
        return found

    @property
    def samples(self) -> Integers:
        found: Integers = np.searchsorted(self.edges, np.minimum(self.part.time, self.trace.times[-1]))
        return found

    def integrals(self, m: int, method: Gauss) -> Floats:
        """The additional states at the edges, with each step divided into ``m`` parts; the coarse method also uses coarser polynomials."""
        edges, trace, points = self.edges, self.trace, method.points
        samples = self.part.time, self.part.states[:, trace.columns]
        found = np.tile(self.start, (len(edges), 1))
        each = max(1, AT_ONCE // (len(points) * m * (len(self.scene.model.parameters.names) + 20 * len(self.scene.states) + 1)))
        for first in range(0, len(edges) - 1, each):
            last = min(first + each, len(edges) - 1)
            begins, ends = edges[first:last], edges[first + 1 : last + 1]
            step = np.searchsorted(trace.times, begins, side="right") - 1
            h = np.repeat((ends - begins) / m, m)
            t = (np.repeat(begins, m) + h * np.tile(np.arange(m), last - first))[:, None] + h[:, None] * points
            steps = np.repeat(step, m * len(points))
            states = np.zeros((t.size, len(self.scene.states)))
            states[:, self.kept[trace.columns]] = trace.at(t.ravel(), steps, *samples)[method is COARSE]
            for level in self.levels:
                for state, rates in zip(level, self._rates(level, t.ravel(), states, trace.discrete[steps]), strict=True):
                    place, slope = self.scene.place_of[state], rates.reshape(t.shape)
                    at = found[first, place] + np.concatenate([[0.0], np.cumsum(h * (slope @ method.weights))])
                    found[first + 1 : last + 1, place] = at[m::m]
                    states[:, place] = (at[:-1, None] + h[:, None] * (slope @ method.up_to.T)).ravel()
        return found

    def _rates(self, level: Level, t: Floats, states: Floats, discrete: Floats) -> list[Floats]:
        """The derivatives of some additional states at some times."""
        part = self.part
        here = Segment(self.scene, t, states, discrete, part.parameters, part.signals, part.guess, part.begin, silent=True)
        return [here.history((v, k + 1)) for v, k in level]
