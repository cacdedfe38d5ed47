"""Collocation points within a period, and the quadrature weights of Fourier integrals, piecewise between switches.

Where nothing switches, the points are equidistant, which is exact up to the harmonics that they resolve. Where a flank separates or
makes contact, the period is split and each piece is integrated separately (Gauss-Legendre), so that neither kinks nor jumps of a force
limit the accuracy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.native.evaluator import Evaluator
from gearlib.program.interpret import Prepared, batch_values, evaluate
from gearlib.run.scene import Scene

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
GAUSS = 8  # points per panel
GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(GAUSS)
JUMP = 1e-9  # relative to the largest rate: a smaller jump is rounding
APART = 1e-9  # of a step: switches that are nearer to each other are simultaneous
ROUNDING = 1e-12  # relative to the change between two samples
ROUGH = 0.5  # third difference relative to the first: an expression that jumps has 2, since another relation on which it depends switched


def fourier(phase: Floats, harmonics: int) -> Floats:
    """``1, cos(p), sin(p), cos(2 p), ...`` at some phases, shape (phases, 2 harmonics + 1)."""
    angle = phase[:, None] * np.arange(1, harmonics + 1)
    result = np.ones((len(phase), 2 * harmonics + 1))
    result[:, 1::2], result[:, 2::2] = np.cos(angle), np.sin(angle)
    return result


def turn(harmonics: int) -> Floats:
    """Matrix that maps Fourier coefficients to those of the derivative with respect to phase."""
    result = np.zeros((2 * harmonics + 1, 2 * harmonics + 1))
    for k in range(1, harmonics + 1):
        result[2 * k - 1, 2 * k], result[2 * k, 2 * k - 1] = k, -k
    return result


def transform(weights: Floats, basis: Floats) -> Floats:
    """Matrix that maps values at collocation points to Fourier coefficients."""
    result: Floats = (basis * (2 * weights)[:, None]).T
    result[0] /= 2
    return result


@dataclass(frozen=True, eq=False)
class Driven:
    """A scene at one frequency: rates as functions of phase."""

    scene: Scene
    numbers: Prepared
    evaluator: Evaluator
    inputs: Callable[[Floats, float], Floats]  # (phases, frequency) -> (inputs, phases)
    omega: float
    growth: Floats  # growth of the states per radian of phase: mesh phases grow, everything else is periodic

    def states(self, phase: Floats, coefficients: Floats) -> Floats:
        """Values of the states, shape (states, phases)."""
        repeating = fourier(phase, len(coefficients) // 2) @ coefficients
        result: Floats = repeating.T + self.growth[:, None] * phase
        return result

    def discrete(self, phase: Floats, x: Floats) -> Floats:
        return self.scene.discrete(self.numbers, phase / self.omega, x, self.inputs(phase, self.omega))

    def rates(self, phase: Floats, x: Floats, discrete: Floats) -> Floats:
        """Derivatives of the states, shape (states, phases)."""
        slots = evaluate(self.numbers, phase / self.omega, x, self.inputs(phase, self.omega), discrete)
        result: Floats = slots[self.scene.program.output_slots]
        return result

    def linear_rates(self, phase: Floats, x: Floats, discrete: Floats) -> tuple[Floats, Floats]:
        """Rates, and their derivatives with respect to the states, shape (phases, states, states)."""
        slots, slopes = self.evaluator.derivatives(phase / self.omega, x, self.inputs(phase, self.omega), discrete)
        return slots[self.scene.program.output_slots], slopes

    def roots(self, phase: Floats, x: Floats, discrete: Floats) -> Floats:
        """Expressions that the relations compare with zero, by relation number, shape (n_discrete, phases)."""
        relations, prepared = self.scene.relations, self.numbers.relations
        assert relations is not None, "something switches"
        assert prepared is not None
        result = np.zeros((self.scene.n_discrete, len(phase)))
        t = phase / self.omega
        slots = evaluate(prepared, t, x, self.inputs(phase, self.omega), discrete)
        for batch in relations.batches:
            result[batch.targets] = batch_values(batch, t, slots, prepared.parameters, discrete)
        return result


@dataclass(frozen=True, eq=False)
class Moments:
    """Collocation points of a period, in smooth pieces between switches.

    Attributes
    ----------
    phase, weights : arrays (moments,)
        The weights sum to 1.
    discrete : array (n_discrete, moments)
    cuts : array (pieces,)
        Phases at which something switches.
    before, after : arrays (n_discrete, pieces)
        Flags on either side of a cut.
    relation : array (pieces,)
        Relation that switches there.
    """

    phase: Floats
    weights: Floats
    discrete: Floats
    cuts: Floats
    before: Floats
    after: Floats
    relation: Integers

    @property
    def pieces(self) -> list[tuple[float, float, Floats]]:
        """Begin, end and discrete state of each piece."""
        if not len(self.cuts):
            return [(0.0, 2 * np.pi, self.discrete[:, 0])]
        ends = [*self.cuts[1:], self.cuts[0] + 2 * np.pi]
        return [(float(a), float(b), self.after[:, i]) for i, (a, b) in enumerate(zip(self.cuts, ends, strict=True))]


def moments(driven: Driven, coefficients: Floats, samples: int) -> Moments:
    """Collocation points for the rates along a Fourier series: ``samples`` or slightly more."""
    grid = 2 * np.pi * np.arange(samples) / samples
    x = driven.states(grid, coefficients)
    discrete = driven.discrete(grid, x)
    following = np.roll(discrete, -1, axis=1)
    switches = np.flatnonzero((discrete != following).any(axis=0))
    if not len(switches):
        none = np.empty((len(discrete), 0))
        return Moments(grid, np.full(samples, 1 / samples), discrete, np.empty(0), none, none, np.empty(0, np.int64))
    cuts, before, after, relation = _cuts(driven, coefficients, discrete, driven.roots(grid, x, discrete), switches)
    step = 2 * np.pi / samples
    phases, weights, pieces = [], [], []
    for begin, end, flags in zip(cuts, [*cuts[1:], cuts[0] + 2 * np.pi], after.T, strict=True):
        panels = int(np.ceil((end - begin) / (GAUSS * step)))
        width = (end - begin) / max(panels, 1)
        middle = begin + width * (np.arange(panels) + 0.5)
        phases.append((middle[:, None] + width / 2 * GAUSS_NODES).ravel())
        weights.append(np.tile(GAUSS_WEIGHTS * width / (4 * np.pi), panels))
        pieces.append(np.repeat(flags[:, None], panels * GAUSS, axis=1))
    return Moments(
        np.concatenate(phases), np.concatenate(weights), np.concatenate(pieces, axis=1), cuts, before, after, relation
    )


def _cuts(
    driven: Driven, coefficients: Floats, discrete: Floats, values: Floats, switches: Integers
) -> tuple[Floats, Floats, Floats, Integers]:
    """Phases at which relations switch, in order; the flags before and after each, one column per cut; and the relation that switches.

    Relations that switch between the same two samples have a cut each, if they are not a consequence of one another: the flags between
    them tell. Those that switch at the same time follow each other in cuts of the same phase.
    """
    samples = discrete.shape[1]
    following = np.roll(discrete, -1, axis=1)
    found = [_crossings(values, np.flatnonzero(discrete[:, k] != following[:, k]), int(k)) for k in switches]
    middles = [[(a.share + b.share) / 2 for a, b in zip(near, near[1:]) if b.share - a.share > APART] for near in found]
    at = np.array([(k + share) * 2 * np.pi / samples for k, shares in zip(switches, middles, strict=True) for share in shares])
    between = iter(driven.discrete(at, driven.states(at, coefficients)).T if len(at) else ())
    cuts = list[tuple[float, Floats, Floats, int]]()
    for k, near, shares in zip(switches, found, middles, strict=True):
        edges, flags = [0.0, *shares, 1.0], [discrete[:, k], *(next(between) for _ in shares), following[:, k]]
        for low, high, before, after in zip(edges, edges[1:], flags, flags[1:], strict=False):
            changed = np.flatnonzero(before != after)
            if not len(changed):
                continue
            share, relations = (low + high) / 2, [int(changed[0])]
            own = [c for c in near if c.relation in changed]
            if own:
                smoothest = min(own, key=lambda c: c.roughness)
                share = min(max(smoothest.share, low), high)
                relations = [c.relation for c in own if c is smoothest or c.roughness < ROUGH]
            for r in relations[:-1]:
                partly = before.copy()
                partly[r] = after[r]
                cuts.append(((k + share) * 2 * np.pi / samples, before, partly, r))
                before = partly
            cuts.append(((k + share) * 2 * np.pi / samples, before, after, relations[-1]))
    phases, befores, afters, relation = zip(*cuts, strict=True)
    return np.array(phases), np.column_stack(befores), np.column_stack(afters), np.array(relation, np.int64)


@dataclass(frozen=True)
class _Crossing:
    """Where a relation switches between two samples: the fraction of the step, and how far its expression is from smooth."""

    share: float
    relation: int
    roughness: float


def _crossings(values: Floats, changed: Integers, k: int) -> list[_Crossing]:
    """Where the expressions of relations pass zero between samples k and k + 1, in order; nowhere, if none does."""
    around = values[np.ix_(changed, (k + np.arange(-1, 3)) % values.shape[1])]
    rise = np.abs(around[:, 2] - around[:, 1])
    # an expression of time is taken just after a sample: it may have switched where its value is a rounding error before zero
    around = np.where(np.abs(around) <= ROUNDING * rise[:, None], 0.0, around)
    crosses = np.flatnonzero((around[:, 1] * around[:, 2] <= 0) & (rise > 0))
    rough = np.abs(around[crosses] @ np.array([1.0, -3.0, 3.0, -1.0])) / rise[crosses]
    found = [_Crossing(zero(around[i]), int(changed[i]), float(r)) for i, r in zip(crosses, rough, strict=True)]
    return sorted(found, key=lambda c: c.share)


def zero(around: Floats) -> float:
    """Zero between 0 and 1 of the cubic through values at -1, 0, 1 and 2."""
    a, b, c, d = np.linalg.solve(np.vander([-1.0, 0.0, 1.0, 2.0]), around).tolist()
    if not around[1] or not around[2]:
        return 1.0 if around[1] else 0.0
    low, high = 0.0, 1.0
    new = share = float(around[1] / (around[1] - around[2]))
    for _ in range(40):
        value, slope = ((a * share + b) * share + c) * share + d, (3 * a * share + 2 * b) * share + c
        low, high = (share, high) if value * around[2] < 0 else (low, share)
        new = share - value / slope if slope else 0.5 * (low + high)
        new = new if low <= new <= high else 0.5 * (low + high)
        if abs(new - share) < 1e-14:
            break
        share = new
    return new


@dataclass(frozen=True, eq=False)
class Cuts:
    """Jumps of the rates at switches.

    Attributes
    ----------
    phase : array (jumps,)
    piece : array (jumps,)
        Number of the piece that begins there.
    jump : array (jumps, states)
        Rates after it minus rates before it.
    gradient : array (jumps, states)
        Derivative of the switching function with respect to the states.
    slope : array (jumps,)
        Its derivative with respect to phase along the Fourier series.
    rate : array (jumps,)
        Its time derivative along the rates before the cut, which the smooth series does not represent.
    """

    phase: Floats
    piece: Integers
    jump: Floats
    gradient: Floats
    slope: Floats
    rate: Floats


def jumps(driven: Driven, coefficients: Floats, found: Moments, scale: Floats) -> Cuts | None:
    """The jumps of the rates at the cuts, if there are any."""
    if not len(found.cuts):
        return None
    x = driven.states(found.cuts, coefficients)
    before, after = driven.rates(found.cuts, x, found.before), driven.rates(found.cuts, x, found.after)
    jump = (after - before).T
    size = np.abs(before).max(axis=1) + np.abs(after).max(axis=1)
    some = np.flatnonzero((np.abs(jump) > JUMP * size).any(axis=1))
    if not len(some):
        return None
    phase, discrete, relation = found.cuts[some], found.before[:, some], found.relation[some]
    count, n = len(some), len(scale)
    rows = np.arange(count)

    def crossing(p: Floats, states: Floats) -> Floats:
        copies = len(p) // count
        values = driven.roots(p, states, np.tile(discrete, (1, copies)))
        chosen: Floats = values[np.tile(relation, copies), np.arange(len(p))]
        return chosen.reshape(copies, count)

    step = 1e-5 * scale
    here = x[:, some]
    moved = np.concatenate([here + s * step[:, None] * np.eye(n)[:, [i]] for i in range(n) for s in (1, -1)], axis=1)
    values = crossing(np.tile(phase, 2 * n), moved).reshape(n, 2, count)
    gradient = ((values[:, 0] - values[:, 1]) / (2 * step[:, None])).T
    h = 1e-5
    ahead = [driven.states(phase + s, coefficients) for s in (h, -h)]
    along = crossing(np.concatenate([phase + h, phase - h]), np.concatenate(ahead, axis=1))
    slope = (along[0] - along[1]) / (2 * h)
    fixed = crossing(np.concatenate([phase + h, phase - h]), np.tile(here, (1, 2)))
    rate = (gradient * before[:, some].T).sum(axis=1) + (fixed[0] - fixed[1]) / (2 * h) * driven.omega
    kept = rows[(slope != 0) & (rate != 0)]
    return Cuts(phase[kept], some[kept], jump[some][kept], gradient[kept], slope[kept], rate[kept])
