"""The lowest eigenvalues of matrices with a known spectrum: every one in its place, as often as it is repeated, or None."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.linalg import block_diag

from gearlib.linear.balancing import similarity
from gearlib.vibration import lowest_eigenvalues
from gearlib.vibration.eigenvalue_count import missing_inside
from gearlib.vibration.lowest_eigenvalues import Lowest, joined, lowest

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
COMB = np.arange(1.0, 201.0)
FAR = 1e3 * (1 + 0.01 * np.arange(200))


def swings(w: Any, ratio: Any = 0.0, real: Any = (), zeros: int = 0, seed: int = 0) -> tuple[Any, Complexes]:
    """A matrix of oscillators and decays in scattered units and order, and its eigenvalues but for those at 0."""
    draw = np.random.default_rng(seed)
    w = np.asarray(w, float)
    ratio = np.broadcast_to(ratio, w.shape)
    units = 10.0 ** draw.uniform(-3, 3, len(w))
    blocks = [np.array([[0.0, x * u], [-x / u, -2 * r * x]]) for x, r, u in zip(w, ratio, units, strict=True)]
    A = sparse.csc_matrix(block_diag(*blocks, *([[x]] for x in real), *([[0.0]] for _ in range(zeros))))
    order = draw.permutation(A.shape[0])
    above = -ratio * w + 1j * w * np.sqrt(1 - ratio**2)
    return sparse.csc_matrix(A[order][:, order]), np.concatenate([above, above.conj(), np.array(real, complex)])


def by_size(values: Complexes) -> Complexes:
    return values[np.lexsort((values.imag, np.round(values.real, 9), np.round(np.abs(values), 9)))]


def check(found: Lowest | None, A: Any, values: Complexes, count: int) -> None:
    """All eigenvalues up to some radius, and no others, with independent vectors; enough of them oscillate."""
    assert found is not None
    ringing = found.values.imag > 1e-5 * np.abs(found.values)
    assert ringing.sum() >= count
    assert (np.diff(np.abs(found.values)) > -1e-9 * np.abs(found.values[1:])).all()
    inside = values[np.abs(values) <= np.abs(found.values).max() * (1 + 1e-6)]
    assert len(found.values) == len(inside)
    assert by_size(found.values) == pytest.approx(by_size(inside), rel=1e-7)
    scale = np.abs(found.vectors).max(axis=0)
    residual = np.abs(A @ found.vectors - found.vectors * found.values)
    terms = abs(A) @ np.abs(found.vectors) + np.abs(found.vectors * found.values)
    assert (scale > 0).all()
    assert (residual <= 1e-6 * terms.max(axis=0)).all()
    assert np.linalg.matrix_rank(found.vectors / scale, tol=1e-9) == len(inside)


def counts_in(radii: Floats, A: Any, values: Complexes) -> list[tuple[float, int | None, int]]:
    """Where the number of eigenvalues in a disc is another than that of the ``values`` in it: radius, number found, and right one."""
    scale = similarity(A)
    S = sparse.csc_matrix(sparse.diags(1 / scale) @ A @ sparse.diags(scale))
    found = [(float(r), missing_inside(S, float(r), np.empty(0, complex), 0), int((np.abs(values) < r).sum())) for r in radii]
    return [one for one in found if one[1] != one[2]]


@pytest.mark.parametrize(("ratio", "repeated"), [(0.0, 1), (0.05, 1), (0.001, 4)])
def test_many_alike_beyond_the_disc_are_not_taken_for_some_inside(ratio: float, repeated: int) -> None:
    """They turn the phase by whole turns from one point of the edge to the next, unless the points are close enough."""
    A, values = swings(np.r_[5.0, 40.0, np.repeat(100 + np.arange(200 // repeated) * 0.1, repeated)], ratio)
    assert counts_in(np.array([72.205, 74.603, 77.08, 88.3]), A, values) == []


@pytest.mark.parametrize(("damping", "radius"), [(0.05, 82.18777), (0.02, 82.4)])
def test_one_close_to_the_edge_and_many_behind_it(damping: float, radius: float) -> None:
    """Behind a point of the edge that is near an eigenvalue, the phase goes on as it did before."""
    A, values = swings(np.r_[2.0, 65.0, 70.0, 82.46883, np.repeat(100 + np.arange(62) * 0.0014, 4)], damping)
    assert counts_in(np.array([radius, 0.99 * radius, 1.02 * radius]), A, values) == []


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> list[int | None]:
    """What the counts of eigenvalues in discs found, as they are made."""
    found: list[int | None] = []

    def count(*given: Any) -> int | None:
        found.append(missing_inside(*given))
        return found[-1]

    monkeypatch.setattr(lowest_eigenvalues, "missing_inside", count)
    return found


@pytest.mark.parametrize(
    ("count", "w", "ratio", "real", "zeros"),
    [
        (1, COMB, 0.0, (), 0),
        (10, COMB, 0.0, (), 5),
        (3, COMB, 0.005 * np.sqrt(COMB / 200), (), 0),
        (3, COMB, np.linspace(0.95, 0.01, 200), (), 0),
        (3, COMB, -0.1, (), 0),
        (10, COMB, 0.02, -np.arange(0.5, 20.5), 0),
        (5, 2 * np.sin(np.pi * COMB / 402), 0.0, (), 1),
        (3, np.repeat(np.arange(1.0, 41.0), 5), 0.0, (), 0),
        (4, np.repeat(np.arange(1.0, 41.0), 5), 0.01, (-2.5, -2.5, 3.5), 2),
    ],
    ids=["comb", "zeros", "damped", "slow ones damped most", "growing", "decays", "chain", "fivefold", "fivefold with decays"],
)
def test_one_search_and_one_count_are_enough(
    count: int, w: Floats, ratio: Any, real: Any, zeros: int, counts: list[int | None]
) -> None:
    A, values = swings(w, ratio, real, zeros)
    found = lowest(A, count, zeros)
    check(found, A, values, count)
    assert found is not None
    assert len(found.values) <= 4 * count + 16
    assert counts == [0]


@pytest.mark.parametrize(
    ("count", "w", "real", "slow"),
    [
        (2, np.r_[1e-3, COMB], (), 2),
        (2, COMB, (-1e-4, -1e-6), 2),
        (8, np.r_[np.arange(1, 7) * 1e-3, COMB], (), 12),
        (2, 1e-7 * np.r_[1e-3, COMB], (), 2),
        (2, 1e7 * COMB, (-1e3, -10.0), 2),
    ],
    ids=["a swing", "decays", "six swings", "slow", "fast"],
)
def test_what_is_far_slower_than_the_rest_is_found_once_it_is_missed(
    count: int, w: Floats, real: Any, slow: int, counts: list[int | None]
) -> None:
    A, values = swings(w, 0.0, real)
    check(lowest(A, count, 0), A, values, count)
    assert counts == [slow, 0]


@pytest.mark.parametrize(
    ("count", "w", "ratio", "zeros", "most"),
    [
        (1, np.arange(1.0, 41.0), 0.0, 0, 2),
        (3, np.arange(1.0, 41.0), 0.0, 3, 9),
        (3, np.r_[1, 2, 3, FAR[:60]], 0.0, 0, 7),
        (5, np.geomspace(1, 1e6, 60), 0.0, 0, 14),
        (5, np.geomspace(1, 1e6, 60), 0.3, 0, 14),
        (3, np.repeat(np.arange(1.1, 13), 7), 0.0, 0, 14),
        (8, np.repeat(np.arange(1.1, 13), 9), 0.01, 0, 18),
    ],
    ids=["comb", "zeros", "far", "decades", "decades, damped", "sevenfold", "ninefold, damped"],
)
def test_what_the_first_search_misses_is_found(
    count: int, w: Floats, ratio: float, zeros: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of matrices too small for a long first search; also what is repeated more often than there are vectors in a block."""
    monkeypatch.setattr(lowest_eigenvalues, "FULL", 0)
    A, values = swings(w, ratio, (), zeros)
    found = lowest(A, count, zeros)
    check(found, A, values, count)
    assert found is not None
    assert len(found.values) <= 2 * most


def test_rings_are_searched_in_which_some_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a search all over the disc finds nothing, since there is none."""
    monkeypatch.setattr(lowest_eigenvalues, "FULL", 0)
    monkeypatch.setattr(lowest_eigenvalues, "SWEEP", ())
    A, values = swings(np.geomspace(1, 1e4, 40))
    check(lowest(A, 5, 0), A, values, 5)


@pytest.mark.parametrize(
    ("w", "real", "count"),
    [(np.full(40, 3.0), (), 3), (np.arange(1.0, 3.0), -np.arange(1.0, 60.0), 3), (np.arange(5.0, 7.0), (), 3)],
    ids=["all alike", "too few among decays", "too few"],
)
def test_where_there_is_no_disc_with_enough_there_is_no_answer(
    w: Floats, real: Any, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lowest_eigenvalues, "FULL", 0)
    assert lowest(swings(w, 0.0, real)[0], count, 0) is None


def test_small_matrices_are_not_searched_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Up to a number of states, all eigenvalues of the full matrix take no longer."""
    A, values = swings(np.r_[1, 2, 3, FAR[:60]])
    assert lowest(A, 3, 0) is None
    monkeypatch.setattr(lowest_eigenvalues, "FULL", 126)
    assert lowest(A, 3, 0) is None
    monkeypatch.setattr(lowest_eigenvalues, "FULL", 125)
    check(lowest(A, 3, 0), A, values, 3)


@pytest.mark.parametrize("size", [1e-7, 1.0, 1e7])
def test_what_is_found_again_is_joined_once(size: float) -> None:
    """Of a repeated eigenvalue only what no known vector, and none of the new ones before, is made of."""
    unit = np.eye(6, dtype=complex)
    known = Lowest(size * np.array([2j, -3j, 1.5j]), unit[:, :3])
    aside, behind = (unit[0] + unit[3]) / np.sqrt(2), (2 * unit[0] - 1j * unit[3]) / np.sqrt(5)
    new = [
        (2j, unit[0], False), (2j, aside, True), (2j, behind, False), (2j * (1 + 0.9e-6), aside, False), (2j, unit[4], True),
        (2j * (1 + 1.1e-6), unit[0], True), (3j, unit[1], True), (1j, unit[2], True), (-2j, unit[0], True),
        (-2.0, unit[4], True), (2j, unit[0] + 0.9e-3 * unit[5], False), (2j, unit[0] + 1.1e-3 * unit[5], True),
    ]  # fmt: skip
    values, vectors = size * np.array([value for value, _, _ in new]), np.column_stack([vector for _, vector, _ in new])
    found = joined(known, values, vectors)
    kept = [k for k, (_, _, fresh) in enumerate(new) if fresh]
    assert found.values.tolist() == [*known.values, *values[kept]]
    assert found.vectors == pytest.approx(np.hstack([known.vectors, vectors[:, kept]]))
    assert len(joined(found, values, vectors).values) == len(found.values)


class Script:
    """The parts of a search played by hand: what counts and windows find, and the eigenpairs of each further search."""

    def __init__(self, n: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.n, self.monkeypatch = n, monkeypatch
        self.radii: list[float] = []
        self.grown: list[int] = []
        self.shifts: list[complex] = []
        self.missing: list[int | None] = []
        self.windows: list[tuple[float, float, int] | None] = []
        self.new: list[list[complex]] = []
        monkeypatch.setattr(lowest_eigenvalues, "FULL", 0)
        monkeypatch.setattr(lowest_eigenvalues, "_swept", lambda S, size, radius, known: known)
        monkeypatch.setattr(lowest_eigenvalues, "_where_missing", lambda *given: self.windows.pop(0))
        monkeypatch.setattr(lowest_eigenvalues, "missing_inside", self.count)
        monkeypatch.setattr(lowest_eigenvalues, "_Space", self.space)

    def count(self, S: Any, radius: float, values: Complexes, at_zero: int) -> int | None:
        self.radii.append(radius)
        return self.missing.pop(0)

    def space(self, S: Any, shift: complex) -> Any:
        self.shifts.append(shift)
        return self

    def grow(self, dimension: int) -> None:
        self.grown.append(dimension)

    def pairs(self) -> tuple[Complexes, Complexes]:
        return self.vectors(self.new.pop(0))

    def vectors(self, values: list[complex]) -> tuple[Complexes, Complexes]:
        return np.array(values, complex), np.eye(self.n, dtype=complex)[:, : len(values)]

    def lowest(self, known: list[complex], radius: float, count: int) -> list[complex] | None:
        first = Lowest(*self.vectors(known)), radius, None
        self.monkeypatch.setattr(lowest_eigenvalues, "_first", lambda *given: first)
        found = lowest(100.0 * sparse.identity(self.n, format="csc"), count, 0)
        return None if found is None else found.values.tolist()


@pytest.mark.parametrize(("n", "grown"), [(300, [68, 128]), (200, [68, 100]), (60, [30, 30])])
def test_a_disc_grows_until_it_holds_enough_and_is_searched_until_none_is_missing(
    n: int, grown: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By little where its edge cuts an eigenvalue, by half where too few of those in it oscillate: a critically damped pair does not."""
    play = Script(n, monkeypatch)
    play.missing, play.windows = [None, 0, 2, 2, 0], [(4.0, 9.0, 2), (4.0, 9.0, 2)]
    play.new = [[1j, -1j], [6j, -6j, 2j]]
    known = [1j, -1j, 2j, -2j, -9 + 7e-5j, -9 - 7e-5j, 16j, -16j]
    assert play.lowest(known, 10.0, 3) == [1j, -1j, 2j, -2j, 6j, -6j, -9 + 7e-5j, -9 - 7e-5j]
    assert play.radii == pytest.approx([10.0, 10.03, 15.045, 15.045, 15.045])
    assert (play.grown, play.shifts) == (grown, [6j, 6j])


def test_a_search_that_finds_nothing_new_twice_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not one that finds something in between; nor is one begun without a ring, or beyond all eigenvalues."""
    play = Script(300, monkeypatch)
    play.missing, play.windows, play.new = [1] * 6, [(1.0, 4.0, 1)] * 6, [[1j], [3j], [1j], [1j]]
    assert play.lowest([1j, -1j], 10.0, 1) is None
    assert play.grown == [64, 124, 64, 124]
    for radius, window in ((10.0, None), (100.1, (1.0, 4.0, 1))):
        play = Script(300, monkeypatch)
        play.missing, play.windows, play.new = [1] * 6, [window] * 6, [[1j]]
        assert play.lowest([1j, -1j], radius, 1) is None
        assert play.grown == []
