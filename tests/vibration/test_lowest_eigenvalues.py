"""The lowest modes of large trains against matrices by hand: none missing, whatever is repeated, damped, or slow beside fast ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.linalg import eig, eigh

import gearlib as gl
import gearparts as gp
from gearlib.linear.balancing import similarity
from gearlib.vibration import spectrum
from gearlib.vibration.eigenvalue_count import missing_inside
from gearlib.vibration.lowest_eigenvalues import lowest
from tests.benchmarks.scenes import DRAG, C, Chain, D

Floats = NDArray[np.float64]
J, K, J_1, J_2 = 0.8, 5e4, 0.3, 1.7


class Shafts(gl.Component):
    """Uniform shafts, each between two discs."""

    n = gl.Structural(10)
    shafts = gl.Structural(1)
    d = gl.Parameter("N.m.s/rad", "of the material", default=0.0)

    def assemble(self) -> list[Any]:
        self.left = [gp.Inertia(J=J_1) for _ in range(self.shafts)]
        self.shaft = [gp.TorsionalShaft(J=J, c=K, segments=self.n, d=self.d) for _ in range(self.shafts)]
        self.right = [gp.Inertia(J=J_2) for _ in range(self.shafts)]
        parts = zip(self.left, self.shaft, self.right, strict=True)
        return [
            link
            for a, shaft, b in parts
            for link in (gl.connect(a.flange_b, shaft.flange_a), gl.connect(shaft.flange_b, b.flange_a))
        ]


def frequencies(n: int) -> Floats:
    """Of one shaft, rad/s, from K x = w^2 M x."""
    mass = np.diag([J_1 + J / (2 * n)] + [J / n] * (n - 1) + [J_2 + J / (2 * n)])
    stiffness = np.zeros((n + 1, n + 1))
    for i in range(n):
        stiffness[i : i + 2, i : i + 2] += n * K * np.array([[1, -1], [-1, 1]])
    squares: Floats = eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(np.maximum(squares[1:], 0))


@pytest.fixture(scope="module", params=[400, pytest.param(600, marks=pytest.mark.slow)])
def shaft(request: pytest.FixtureRequest) -> tuple[gl.System, Floats]:
    return gl.compile(Shafts(n=request.param)), frequencies(request.param)


@pytest.mark.parametrize("count", [5, 20, 60])
@pytest.mark.parametrize("d", [0.0, 1.0])
def test_uniform_shaft(shaft: tuple[gl.System, Floats], d: float, count: int) -> None:
    """Damping in proportion to stiffness leaves the magnitudes of the eigenvalues, and has the ratios w d / (2 c)."""
    system, hand = shaft
    found = gl.modes(system, count, parameters={"d": d})
    assert found.free == 1
    assert len(found) == count + 1
    assert found.omega[1:] == pytest.approx(hand[:count], rel=1e-9)
    assert found.damping[1:] == pytest.approx(hand[:count] * d / (2 * K), rel=1e-7, abs=1e-10)


@pytest.fixture(scope="module")
def three_shafts() -> gl.System:
    return gl.compile(Shafts(n=150, shafts=3))


@pytest.mark.parametrize("count", [4, 5, 20])
def test_repeated_frequencies_are_found_as_often_as_they_are_repeated(three_shafts: gl.System, count: int) -> None:
    found = gl.modes(three_shafts, count)
    assert found.free == 3
    assert found.omega[3:] == pytest.approx(np.repeat(frequencies(150), 3)[:count], rel=1e-9)
    assert np.linalg.matrix_rank(found.shapes[:, 3:], tol=1e-6) == count


def test_campbell_diagram_of_a_large_train(shaft: tuple[gl.System, Floats]) -> None:
    system, hand = shaft
    diagram = gl.campbell(system, [0.0, 1e4], {"mesh": 1.0}, count=5)
    assert diagram.frequencies[0] == pytest.approx(hand[:5] / (2 * np.pi), rel=1e-9)
    assert [c.speed for c in diagram.crossings] == pytest.approx(hand[:5], rel=1e-9)


@pytest.mark.parametrize("n", [300, pytest.param(1000, marks=pytest.mark.slow)])
def test_chain_with_a_damper_at_its_end(n: int) -> None:
    """Damping that is not proportional, against all eigenvalues of a matrix by hand."""
    inertia = 0.01 * (1 + np.arange(n) / n)
    twist = np.zeros((n - 1, n))
    twist[np.arange(n - 1), np.arange(n - 1)], twist[np.arange(n - 1), np.arange(1, n)] = 1.0, -1.0
    scale = np.sqrt(C / inertia[0])
    drag = np.zeros((n, n))
    drag[-1, -1] = DRAG
    A = np.block(
        [
            [np.zeros((n - 1, n - 1)), scale * twist],
            [-C / scale * twist.T / inertia[:, None], -(D * twist.T @ twist + drag) / inertia[:, None]],
        ]
    )
    values = np.linalg.eigvals(A)
    ringing = values[values.imag > 1e-9 * np.abs(values)]
    expected = ringing[np.argsort(np.abs(ringing))][:20]
    found = gl.modes(gl.compile(Chain(N=n)), 20)
    assert found.eigenvalues[found.free :] == pytest.approx(expected, rel=1e-8)
    decays = np.sort(values[np.abs(values.imag) <= 1e-9 * np.abs(values)].real)[::-1]
    assert found.decays == pytest.approx(decays[: len(found.decays)], rel=1e-6)


def pairs(w: Floats, ratio: float = 0.0) -> Any:
    """A matrix with eigenvalues of the magnitudes w, in scattered units and order."""
    blocks = [sparse.coo_array([[0.0, x * 1e3], [-x / 1e3, -2 * ratio * x]]) for x in w]
    return sparse.csc_matrix(sparse.block_diag(blocks))


@pytest.mark.parametrize("ratio", [0.0, 0.02])
def test_slow_modes_beside_fast_ones_and_dense_clusters(ratio: float) -> None:
    w = np.concatenate([[0.2, 0.21, 3.0], 1e3 * (1 + 0.01 * np.arange(60)), 2e5 * (1 + 1e-3 * np.arange(420))])
    for count in (1, 3, 10):
        found = lowest(pairs(w, ratio), count, 0)
        assert found is not None
        ringing = np.abs(found.values[found.values.imag > 0])
        assert len(ringing) >= count
        assert ringing == pytest.approx(w[: len(ringing)], rel=1e-8)


def test_count_in_a_disc() -> None:
    w = np.arange(1.0, 150.0)
    A = sparse.block_diag([pairs(w), sparse.csc_matrix(np.diag([0.0, 0.0, -40.5, 17.0]))]).tocsc()
    scale = similarity(A)
    S = sparse.csc_matrix(sparse.diags(1 / scale) @ A @ sparse.diags(scale))
    assert abs(S + S.T)[:298, :298].max() < 1e-9
    all_of_them = np.concatenate([1j * w, -1j * w, [-40.5, 17.0]])
    for radius in (0.5, 10.5, 60.5, 120.5):
        inside = np.flatnonzero(np.abs(all_of_them) < radius)
        assert missing_inside(S, radius, all_of_them, 2) == 0
        assert missing_inside(S, radius, np.empty(0, complex), 2) == len(inside)
        assert missing_inside(S, radius, all_of_them, 0) == 2
        for left_out in inside[:: max(len(inside) // 3, 1)]:
            value = all_of_them[left_out]
            rest = all_of_them[(all_of_them != value) & (all_of_them != value.conj())]
            assert missing_inside(S, radius, rest, 2) == (2 if value.imag else 1)


def test_where_decays_take_the_places_all_eigenvalues_are_computed_or_an_error_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most motions of a heavily damped shaft do not oscillate, and their decays gather below the modes that do."""
    system, n = gl.compile(Shafts(n=300)), 300
    d = 1.5 * 2 * K / frequencies(n)[10]
    hand = frequencies(n)
    ringing = hand[hand * d / (2 * K) < 1]
    found = gl.modes(system, 20, parameters={"d": d})
    assert found.omega[1:] == pytest.approx(ringing[:20], rel=1e-6)
    monkeypatch.setattr(spectrum, "MOST_FULL", 100)
    with pytest.raises(gl.GearlibError, match="the lowest 20 modes of 601 states could not be told"):
        gl.modes(system, 20, parameters={"d": d})


@pytest.mark.parametrize(("n", "count", "damping"), [(60, 5, 0.0), (60, 5, 2.0)])
def test_what_the_first_search_misses_is_searched_for(
    n: int, count: int, damping: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A free shaft of equal bodies, with too few dimensions for the first search; against all eigenvalues."""
    monkeypatch.setattr("gearlib.vibration.lowest_eigenvalues.FULL", 20)
    twist = np.zeros((n - 1, n))
    twist[np.arange(n - 1), np.arange(n - 1)], twist[np.arange(n - 1), np.arange(1, n)] = 1.0, -1.0
    A = np.block([[np.zeros((n - 1, n - 1)), twist], [-9.0 * twist.T, -damping / 2 * twist.T @ twist]])
    values = eig(A, right=False)
    expected = np.sort(np.abs(values[values.imag > 1e-6]))
    found = lowest(sparse.csc_matrix(A), count, 1)
    assert found is not None
    ringing = found.values[found.values.imag > 1e-5 * np.abs(found.values)]
    assert len(ringing) >= count
    assert np.abs(ringing) == pytest.approx(expected[: len(ringing)], rel=1e-8)
    assert A @ found.vectors == pytest.approx(found.vectors * found.values, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 5])
def test_what_a_sweep_of_the_disc_misses_is_searched_for_in_windows(seed: int) -> None:
    """A chain on springs and dampers to the ground: decays lie between modes of very different damping; against all eigenvalues."""
    draw, n = np.random.default_rng(seed), 410
    links = 10 ** draw.uniform(2, 5, n - 1)
    losses = links * 10 ** draw.uniform(-6, -1, n - 1)
    springs = np.where(draw.random(n) < 0.3, 10 ** draw.uniform(0, 5, n), 0.0)
    dampers = np.where(draw.random(n) < 0.25, 10 ** draw.uniform(-2, 3, n), 0.0)
    springs[0] += 1e3
    inverse = sparse.diags(1 / 10 ** draw.uniform(-1, 1, n))

    def forces(between: Floats, ground: Floats) -> Any:
        return inverse @ sparse.diags([np.r_[between, 0] + np.r_[0, between] + ground, -between, -between], [0, 1, -1])

    A = sparse.csc_matrix(sparse.bmat([[None, sparse.identity(n)], [-forces(links, springs), -forces(losses, dampers)]]))
    found = lowest(A, 5, 0)
    assert found is not None
    expected = np.sort(np.abs(eig(A.toarray(), right=False)))[: len(found.values)]
    assert np.abs(found.values) == pytest.approx(expected, rel=1e-6)
    assert (found.values.imag > 1e-5 * np.abs(found.values)).sum() >= 5


def test_random_trains_of_springs_and_bodies() -> None:
    rng = np.random.default_rng(3)
    n = 260
    for spread, damping in ((0.5, 0.0), (1.5, 0.0), (0.8, 1e-5)):
        mass, stiffness = np.exp(spread * rng.normal(size=n)), np.exp(spread * rng.normal(size=n + 19) + 10)
        edges = [(int(rng.integers(max(0, i - 4), i)), i) for i in range(1, n)]
        edges += [tuple(int(e) for e in rng.choice(n, 2, replace=False)) for _ in range(20)]
        B = np.zeros((len(edges), n))
        for row, (a, b) in enumerate(edges):
            B[row, a], B[row, b] = -1.0, 1.0
        A = np.block(
            [
                [np.zeros((len(B), len(B))), B],
                [-(B.T * stiffness) / mass[:, None], -damping * (B.T * stiffness) @ B / mass[:, None]],
            ]
        )
        values = eig(A, right=False)
        expected = np.sort(np.abs(values[values.imag > 1e-4]))
        found = lowest(sparse.csc_matrix(A), 10, len(A) - np.linalg.matrix_rank(A))
        if found is not None:  # small enough for the full matrix
            ringing = np.abs(found.values[found.values.imag > 0])
            assert len(ringing) >= 10
            assert ringing == pytest.approx(expected[: len(ringing)], rel=1e-7)
