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
    values = driven.roots(grid, x, discrete)
    found = [_crossing(values, np.flatnonzero(discrete[:, k] != following[:, k]), int(k)) for k in switches]
    step = 2 * np.pi / samples
    cuts = np.array([(k + share) * step for k, (share, _) in zip(switches, found, strict=True)])
    phases, weights, pieces = [], [], []
    for i, k in enumerate(switches):
        begin, end = cuts[i], cuts[i + 1] if i + 1 < len(cuts) else cuts[0] + 2 * np.pi
        panels = max(1, int(np.ceil((end - begin) / (GAUSS * step))))
        width = (end - begin) / panels
        middle = begin + width * (np.arange(panels) + 0.5)
        phases.append((middle[:, None] + width / 2 * GAUSS_NODES).ravel())
        weights.append(np.tile(GAUSS_WEIGHTS * width / (4 * np.pi), panels))
        pieces.append(np.repeat(following[:, [k]], panels * GAUSS, axis=1))
    relation = np.array([r for _, r in found], np.int64)
    return Moments(np.concatenate(phases), np.concatenate(weights), np.concatenate(pieces, axis=1), cuts, discrete[:, switches],
                   following[:, switches], relation)  # fmt: skip


def _crossing(values: Floats, changed: Integers, k: int) -> tuple[float, int]:
    """Position (fraction of the step) of the switch between samples k and k + 1, by a cubic through four samples; and its relation."""
    around = values[np.ix_(changed, (k + np.arange(-1, 3)) % values.shape[1])]
    crosses = np.flatnonzero(around[:, 1] * around[:, 2] <= 0)
    rise = np.abs(around[:, 2] - around[:, 1])
    crosses = crosses[rise[crosses] > 0]
    if not len(crosses):
        return 0.5, int(changed[0])
    rough = np.abs(around @ np.array([1.0, -3.0, 3.0, -1.0]))[crosses] / rise[crosses]
    i = int(crosses[np.argmin(rough)])  # the smoothest of those that switch simultaneously
    a, b, c, d = np.linalg.solve(np.vander([-1.0, 0.0, 1.0, 2.0]), around[i]).tolist()
    low, high = 0.0, 1.0
    share = float(around[i, 1] / (around[i, 1] - around[i, 2]))
    for _ in range(40):
        value, slope = ((a * share + b) * share + c) * share + d, (3 * a * share + 2 * b) * share + c
        low, high = (share, high) if value * around[i, 2] < 0 else (low, share)
        new = share - value / slope if slope else 0.5 * (low + high)
        new = new if low <= new <= high else 0.5 * (low + high)
        if abs(new - share) < 1e-14:
            break
        share = new
    return new, int(changed[i])


@dataclass(frozen=True, eq=False)
class Cuts:
    """Jumps of the rates at switches.

    Attributes
    ----------
    phase : array (jumps,)
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
    return Cuts(phase[kept], jump[some][kept], gradient[kept], slope[kept], rate[kept])
