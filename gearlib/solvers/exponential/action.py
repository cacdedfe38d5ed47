"""Action of the exponential of a large sparse matrix, exp(A h) z, by Chebyshev series (never forms exp(A h)).

The field of values of A, after a diagonal scaling of the states that makes A as close to symmetric in magnitude as possible, lies in an
ellipse. The Faber polynomials of an ellipse are scaled Chebyshev polynomials, so that the series of exp is a three-term recurrence of
products with A, and its truncation error is at most a few times the first omitted coefficient. A vibration through w h radians takes
little more than w h products, whatever the accuracy; diffusion takes the square root of that.

References
----------
Tal-Ezer and Kosloff, J. Chem. Phys. 81 (1984) 3967-3971, doi:10.1063/1.448136. Beckermann, C. R. Acad. Sci. Paris I 340 (2005)
855-860, doi:10.1016/j.crma.2005.04.027 (Faber polynomials of a matrix are bounded by 2 on its field of values).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gearlib.recent import recent
from gearlib.solvers.exponential.chebyshev import TILE, Directions, Graph, Series, call
from gearlib.solvers.exponential.forcing import MOST_KNOWN, Known

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_COUPLING = 0.02  # relative to the largest row: size of one-way couplings (inputs, integrated angles) after scaling
_LOST = math.log(1e3)  # logarithm of the largest factor by which the end of a cascade may be small in these units
_ANGLES = np.linspace(0.0, math.pi, 17)  # directions in which the field of values is bounded
_MARGIN = 1.02  # safety factor for the directions in between
_PROBE = 192  # terms over which an ellipse is tested: a series over `_TURN` has 187 at a tolerance of 1e-16
_GROWTH = 10.0  # relative to the largest entry: bound on the polynomials of an ellipse that encloses the field of values
_TURN = 130.0  # radians per series: 1.35 terms per radian at 1e-12; 1.6 at half of it, 1.2 at twice, beyond the terms that are tested
_DIFFUSION = 1e4  # the same where real eigenvalues dominate: the terms grow with its square root only (860 at 1e-16)
_SEVERAL = 8  # output steps per series, at most; each has a sum of its own, as long as the state


@dataclass(frozen=True)
class Ellipse:
    """Ellipse that encloses the field of values: centre on the real axis, semi-axes along the real and imaginary axes (1/s)."""

    centre: float
    real: float
    imaginary: float

    @property
    def focus(self) -> float:
        return math.sqrt(abs(self.real**2 - self.imaginary**2))

    @property
    def radius(self) -> float:
        """Radius of the circle that the ellipse is the conformal image of."""
        return (self.real + self.imaginary) / self.focus

    @property
    def sign(self) -> float:
        """Sign of the recurrence P_{k+1} = 2 X P_k + sign P_{k-1}: the foci are imaginary (+1) or real (-1)."""
        return 1.0 if self.imaginary >= self.real else -1.0

    def with_foci(self) -> Ellipse:
        """The ellipse, or an elongated one if it is a circle, which has no foci to expand between."""
        if abs(self.real**2 - self.imaginary**2) >= 0.1 * max(self.real, self.imaginary) ** 2:
            return self
        return Ellipse(self.centre, self.real, math.hypot(max(self.real, self.imaginary), 0.5 * self.real))

    def rounded(self) -> Ellipse:
        """A slightly larger ellipse with rounded numbers, so that the matrices of nearly equal parameters share a series."""
        grain = 2.0 ** (math.frexp(max(self.real, self.imaginary))[1] - 10)
        up = [grain * math.ceil(axis / grain + 0.5) for axis in (self.real, self.imaginary)]
        return Ellipse(grain * round(self.centre / grain), *up)

    @lru_cache(maxsize=64)  # noqa: B019  (an ellipse is three numbers)
    def series(self, h: float, tolerance: float) -> Floats:
        """Coefficients of exp(h z) in the polynomials scaled to 1 on the ellipse, to an absolute tolerance."""
        points = 256
        while True:
            t = self.radius * np.exp(2j * math.pi / points * np.arange(points))
            values = np.exp(h * (self.centre + 0.5 * self.focus * (t - self.sign / t)))
            c = np.fft.fft(values).real / points
            large = np.flatnonzero(np.abs(c[: points // 2]) > max(0.5 * tolerance, 2.0**-50 * abs(values[0])))
            if len(large) == 0 or large[-1] < 0.45 * points:
                break
            points *= 2
        c = c[: max(2, int(large[-1]) + 1 if len(large) else 0)]
        c[1:] *= 2.0
        return c


@dataclass(frozen=True, eq=False)
class Triplets:
    """A sparse matrix in coordinate format without duplicates."""

    rows: Integers
    columns: Integers
    entries: Floats


@dataclass(frozen=True, eq=False)
class Action:
    """A scaled, bounded matrix and the series for the action of its exponential.

    Examples
    --------
    >>> rotation = Triplets(np.array([0, 1]), np.array([1, 0]), np.array([1.0, -4.0]))
    >>> action = prepare(rotation, np.arange(2), span=1.0)
    >>> action.advance(np.array([1.0, 0.0]), math.pi / 2, 2, 1e-12)  # half a turn each
    array([[-1., 0.],
           [ 1., 0.]])
    """

    scale: Floats  # nominal size of each state
    order: Integers  # position -> state
    ellipse: Ellipse
    offsets: Integers
    diagonals: Floats  # the full diagonals of 2/r (A - centre)/focus
    rows: Integers
    columns: Integers
    entries: Floats  # entries off these diagonals
    # Position from which on states depend on no others (before it, only within the band or on these); 0: there is none
    alone: int

    def _steps(self, h: float, count: int) -> tuple[int, int]:
        """Output steps per series, and series per output step; one of the two is 1."""
        e = self.ellipse
        limit = _DIFFUSION if e.real > 4.0 * e.imaginary else _TURN
        reach = min(limit / (e.real + e.imaginary), 2.0 / max(e.centre + e.real, 1e-300))
        if h > reach:
            return 1, math.ceil(h / reach)
        return min(_SEVERAL, int(min(reach / h, 1e6)), count), 1

    def _tolerance(self, rtol: float, count: int, repeats: int) -> float:
        return max(rtol / (100.0 + float(count) * repeats), 1e-16)

    def seconds(self, h: float, count: int, rtol: float) -> float:
        """Estimated run time of `advance`."""
        several, repeats = self._steps(h, count)
        terms = len(self.ellipse.series(h * several / repeats, self._tolerance(rtol, count, repeats)))
        product = 6e-8 + 1.4e-10 * len(self.scale) * (len(self.offsets) + 1.5) + 1.5e-9 * len(self.entries)
        return 1e-4 + product * terms * repeats * count / several

    def advance(self, z: Floats, h: float, count: int, rtol: float) -> Floats:
        """The ``count`` states (count, n) that follow ``z`` in steps of ``h`` (s), to about ``rtol`` relative to the largest."""
        several, repeats = self._steps(h, count)
        tolerance = self._tolerance(rtol, count, repeats)
        series = [self.ellipse.series((j + 1) * h / repeats, tolerance) for j in range(several)]
        terms = np.array([len(c) for c in series])
        coefficients = np.zeros((several, int(terms.max()) + 8))
        for row, c in zip(coefficients, series, strict=True):
            row[: len(c)] = c
        out = np.empty((count, len(z)))
        record = _series(self.ellipse, self.offsets, self.rows, len(z))
        record.alone, record.several, record.repeats = self.alone, several, repeats
        record.count, record.width = count, coefficients.shape[1]
        call(
            "march", record, offsets=self.offsets, diagonals=self.diagonals, rows=self.rows, columns=self.columns,
            entries=self.entries, coefficients=coefficients, terms=np.maximum.accumulate(terms), z=(z / self.scale)[self.order],
            v=_room(10, record), sums=np.zeros((several, len(z))), out=out,
        )  # fmt: skip
        x = np.empty_like(out)
        x[:, self.order] = out
        x *= self.scale
        return x


def prepare(A: Triplets, order: Integers, span: float, inputs: int = 0, known: Known | None = None) -> Action:
    """Scale and bound a sparse matrix.

    Parameters
    ----------
    A : Triplets
        Nonzeros (1/s) of a square matrix.
    order : ndarray
        Permutation (position -> state) under which the matrix has a narrow band.
    span : float
        Time span (s) of the exponential; sets the scale of a matrix without rates of its own.
    inputs : int
        Number of states at the end of the order that depend only on each other.
    known : dict, optional
        What is known of the pattern.
    """
    n = len(order)
    on = A.rows == A.columns
    diagonal = np.zeros(n)
    diagonal[A.rows[on]] = A.entries[on]
    rows, columns, entries = A.rows[~on], A.columns[~on], A.entries[~on]
    key = "mirror", n, rows.tobytes(), columns.tobytes()
    places, there = recent({} if known is None else known, key, lambda: transposes(n, rows, columns), MOST_KNOWN)
    mirrored = np.where(there, entries[places], 0.0)  # of each entry (i, j) the entry (j, i), zero where there is none
    scale = balance(rows, columns, entries, mirrored, diagonal, span)
    gain = scale[columns] / scale[rows]
    entries, mirrored = entries * gain, mirrored / gain
    tight, safe = enclosing(diagonal, rows, columns, entries, mirrored, span)
    place = np.empty(n, np.int64)
    place[order] = np.arange(n)
    parts = split(place[rows], place[columns], entries, diagonal[order])
    main = int(np.searchsorted(parts[0], 0))
    alone = n - inputs if n > 2 * TILE and (parts[3] >= n - inputs).all() else 0
    probe = np.where(np.cos(np.arange(n) ** 2 + 0.5) > 0, 1.0, -1.0)  # excites every mode
    while True:
        ellipse = tight if tight.imaginary < safe.imaginary else safe
        factor = 2.0 / (ellipse.radius * ellipse.focus)
        diagonals, others = parts[1] * factor, parts[4] * factor
        diagonals[main] = (diagonal[order] - ellipse.centre) * factor  # both ellipses are rounded, each to a centre of its own
        if ellipse == safe or growth(ellipse, parts[0], diagonals, parts[2], parts[3], others, probe) < _GROWTH:
            return Action(scale, order, ellipse, parts[0], diagonals, parts[2], parts[3], others, alone)
        tight = Ellipse(tight.centre, 1.1 * tight.real, 1.1 * tight.imaginary)


def _series(ellipse: Ellipse, offsets: Integers, rows: Integers, n: int) -> Series:
    """The record of a series for a matrix of ``n`` rows."""
    margin = int(np.abs(offsets).max())
    return Series(n=n, n_offsets=len(offsets), n_entries=len(rows), margin=margin, beta=ellipse.sign / ellipse.radius**2)


def _room(vectors: int, record: Series) -> Floats:
    return np.zeros((vectors, record.n + 2 * record.margin))


def growth(
    ellipse: Ellipse, offsets: Integers, diagonals: Floats, rows: Integers, columns: Integers, entries: Floats, probe: Floats
) -> float:
    """Growth of the polynomials of a matrix: more than a few where the ellipse does not enclose its field of values."""
    record = _series(ellipse, offsets, rows, len(probe))
    record.length = _PROBE
    call(
        "growth", record, offsets=offsets, diagonals=diagonals, rows=rows, columns=columns, entries=entries, z=probe,
        v=_room(3, record),
    )  # fmt: skip
    return record.largest


def band_order(A: Triplets, n: int) -> Integers:
    """Permutation (position -> state) under which a matrix of ``n`` states has a narrow band."""
    i, j = A.rows, A.columns
    pattern = np.unique(np.concatenate([i * n + j, j * n + i]))
    indptr = np.searchsorted(pattern, np.arange(n + 1) * n)
    order = np.empty(n, np.int64)
    call(
        "narrow_order", Graph(n=n), indptr=indptr, indices=pattern % n, degree=np.diff(indptr), order=order,
        queue=np.empty(n, np.int64), mark=np.zeros(n, np.int64), label=np.zeros(n, np.int64),
    )  # fmt: skip
    return order


def split(
    rows: Integers, columns: Integers, entries: Floats, diagonal: Floats
) -> tuple[Integers, Floats, Integers, Integers, Floats]:
    """A matrix as its well-filled diagonals, and the remaining entries by row, column and value."""
    n = len(diagonal)
    filled = np.bincount(columns - rows + n, minlength=2 * n)
    filled[n] = n
    offsets = np.flatnonzero(filled >= n / 8) - n
    number = np.full(2 * n, -1)
    number[offsets + n] = np.arange(len(offsets))
    which = number[columns - rows + n]
    on = which >= 0
    diagonals = np.zeros((len(offsets), n))
    diagonals[which[on], rows[on]] = entries[on]
    diagonals[number[n]] = diagonal
    return offsets, diagonals, rows[~on], columns[~on], entries[~on]


def transposes(n: int, i: Integers, j: Integers) -> tuple[Integers, NDArray[np.bool_]]:
    """Index of the transpose of each entry (i, j), and whether it is present."""
    key, mirror = i * n + j, j * n + i
    by_key = np.argsort(key)
    at = np.minimum(np.searchsorted(key, mirror, sorter=by_key), max(len(key) - 1, 0))
    places = by_key[at] if len(key) else by_key
    return places, key[places] == mirror


def balance(rows: Integers, columns: Integers, entries: Floats, mirrored: Floats, diagonal: Floats, span: float) -> Floats:
    """State scales under which entries (i, j) and (j, i) have equal magnitude and one-way couplings are small.

    For a spring and an inertia, deflections in units of 1/sqrt(c) and speeds in units of 1/sqrt(J) make the squared norm an energy.
    What follows another quantity at a rate far above that of a coupling is small in such units: along a cascade of lags its digits
    would be lost, so that the couplings of a long one are larger.
    """
    both, n = mirrored != 0, len(diagonal)
    i, j = rows[both], columns[both]
    weight = 0.5 * np.log(np.abs(entries[both] / mirrored[both]))  # log scale[i] - log scale[j]
    by_row = np.argsort(i, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(i, minlength=n))])
    logs, label = np.zeros(n), np.zeros(n, np.int64)
    graph = Graph(n=n)
    call(
        "spread", graph, indptr=starts, indices=j[by_row], weight=weight[by_row], logs=logs, label=label, queue=np.empty(n, np.int64),
    )  # fmt: skip
    groups = graph.components
    if not both.all():
        row_sums = np.bincount(i, np.sqrt(np.abs(entries[both] * mirrored[both])), n)
        target = math.log(max(_COUPLING * float(row_sums.max()), 1.0 / span))
        to, of = label[rows[~both]], label[columns[~both]]
        across = to != of
        to, of = to[across], of[across]
        size = (np.log(np.abs(entries[~both])) + logs[columns[~both]] - logs[rows[~both]])[across] - target
        rate = np.full(groups, math.exp(target))
        np.maximum.at(rate, label, np.abs(diagonal) + row_sums)
        smaller = (np.log(rate) - target)[to]  # than in units of what it follows
        lost = float(levels(to, of, smaller, groups).max())
        if lost > _LOST:
            size -= (1.0 - _LOST / lost) * smaller
        logs += levels(to, of, size, groups)[label]
    scale: Floats = np.exp(logs)
    return scale


def levels(to: Integers, of: Integers, size: Floats, groups: int) -> Floats:
    """Largest sum of ``size`` along the one-way couplings that lead to each group; zero everywhere if there are cycles."""
    level = np.zeros(groups)
    for _ in range(30):  # longest chain of one-way couplings; cycles among groups are not resolved further
        higher = np.full(groups, -math.inf)
        np.maximum.at(higher, to, size + level[of])
        higher = np.where(np.isfinite(higher), higher, 0.0)
        if np.array_equal(higher, level):
            return level
        level = higher
    return np.zeros(groups)


def enclosing(diagonal: Floats, rows: Integers, columns: Integers, entries: Floats, mirrored: Floats, span: float
             ) -> tuple[Ellipse, Ellipse]:  # fmt: skip
    """Two ellipses for the field of values: one that may cut its corners, and one that encloses it.

    The bounds are Gershgorin's, for the Hermitian part of exp(-i angle) A. They ignore that the fastest vibrations are also the most
    damped ones, so that a safe ellipse is larger than most scenes need.
    """
    single = mirrored == 0
    rows = np.concatenate([rows, columns[single]])
    symmetric = 0.5 * np.concatenate([entries + mirrored, entries[single]])
    skew = 0.5 * np.concatenate([entries - mirrored, entries[single]])
    c, s = np.cos(_ANGLES), np.sin(_ANGLES)
    bounds = np.empty(len(c))
    call(
        "hermitian_bounds", Directions(n=len(diagonal), n_entries=len(rows), count=len(c)), diagonal=diagonal, rows=rows,
        symmetric=symmetric, skew=skew, cosines=c, sines=s, sums=np.empty(len(diagonal)), bounds=bounds,
    )  # fmt: skip
    centre, real = 0.5 * (bounds[0] - bounds[-1]), 0.5 * (bounds[0] + bounds[-1])
    imaginary = bounds[len(bounds) // 2]
    size = max(real, imaginary, 1e-3 / span)
    real, imaginary = _MARGIN * max(real, 1e-3 * size), _MARGIN * max(imaginary, 1e-3 * size)
    grow = max(1.0, _MARGIN * float(np.max((bounds - centre * c) / np.hypot(real * c, imaginary * s))))
    tight, safe = (Ellipse(float(centre), float(g * real), float(g * imaginary)).rounded().with_foci() for g in (1.0, grow))
    return (tight if imaginary > real else safe), safe
