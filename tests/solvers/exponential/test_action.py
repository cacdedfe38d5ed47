"""The sparse exponential's preparation: order, scaling, and the ellipse around the field of values."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.sparse import csr_array
from scipy.sparse.linalg import expm_multiply

from gearlib.solvers.exponential.action import Ellipse, Triplets, band_order, enclosing, prepare


def triplets(A: np.ndarray) -> Triplets:
    rows, columns = np.nonzero(A)
    return Triplets(rows, columns, A[rows, columns])


def chain(n: int) -> np.ndarray:
    """Inertias (even states) and springs (odd states) in turn, of unlike sizes."""
    stiff = np.where(np.arange(n - 1) % 2, 2e5, 1.0) * (1.0 + np.arange(n - 1) / n)
    return np.diag(stiff, 1) - np.diag(2e5 / stiff, -1)


def test_an_ellipse_that_cuts_off_eigenvalues_is_widened() -> None:
    rotation, n = np.array([[0.0, 1.0], [-1.0, 0.0]]), 40
    A = np.kron(np.eye(n), 1000.0 * rotation) - np.diag(np.repeat(np.linspace(0.0, 800.0, n), 2))  # they fill a rectangle
    action = prepare(triplets(A), np.arange(2 * n), span=1.0)
    e = action.ellipse
    corners = np.array([1000j, -800 + 1000j])
    assert (np.hypot((corners.real - e.centre) / e.real, corners.imag / e.imaginary) < 1.1).all()
    x = action.advance(np.ones(2 * n), 0.1, 3, 1e-12)
    assert np.abs(x[-1] - expm(0.3 * A) @ np.ones(2 * n)).max() < 1e-12


@pytest.mark.parametrize("seed", range(5))
def test_the_safe_ellipse_contains_the_field_of_values(seed: int) -> None:
    random = np.random.default_rng(seed)
    A = np.where(random.random((12, 12)) < 0.3, random.standard_normal((12, 12)), 0.0) - np.diag(random.uniform(0, 3, 12))
    if seed == 4:
        A = np.outer(np.ones(26), np.eye(26)[0])  # one state acts on all others
    off = triplets(A - np.diag(np.diag(A)))
    mirrored = A[off.columns, off.rows]
    _, safe = enclosing(np.diag(A).copy(), off.rows, off.columns, off.entries, mirrored, 1.0)
    for angle in np.linspace(0, math.pi, 50):
        turned = np.exp(-1j * angle) * A
        support = safe.centre * math.cos(angle) + math.hypot(safe.real * math.cos(angle), safe.imaginary * math.sin(angle))
        assert np.linalg.eigvalsh((turned + turned.conj().T) / 2).max() <= support


@pytest.mark.parametrize("seed", range(20))
def test_an_ellipse_of_round_numbers_contains_the_exact_one(seed: int) -> None:
    random = np.random.default_rng(seed)
    centre, real, imaginary = -(10 ** random.uniform(-3, 6)), *(10 ** random.uniform(-3, 6, 2))
    exact, rounded = Ellipse(centre, real, imaginary), Ellipse(centre, real, imaginary).rounded()
    assert rounded.centre + rounded.real >= centre + real
    assert rounded.centre - rounded.real <= centre - real
    assert rounded.imaginary >= imaginary
    longest = max(real, imaginary)
    assert max(rounded.real - exact.real, rounded.imaginary - exact.imaginary) <= 2.0 / 512 * longest


def test_an_undamped_chain_has_a_flat_ellipse() -> None:
    A = chain(59)
    e = prepare(triplets(A), np.arange(59), span=1.0).ellipse
    fastest = np.abs(np.linalg.eigvals(A).imag).max()
    assert fastest < e.imaginary < 1.1 * fastest
    assert e.real < 0.01 * fastest


def test_a_shuffled_chain_is_found_to_be_narrow() -> None:
    mixed = np.random.default_rng(1).permutation(59)
    A = chain(59)[mixed][:, mixed]
    order = band_order(triplets(A), 59)
    rows, columns = np.nonzero(A[order][:, order])
    assert sorted(order) == list(range(59))
    assert np.abs(rows - columns).max() == 1


def test_one_way_couplings_cost_nothing() -> None:
    A = chain(39)
    plain = prepare(triplets(A), np.arange(39), span=1.0).ellipse
    G = np.zeros((60, 60))  # one strong input, the states it acts on, the integrals of these
    G[:39, :39], G[:20, 39], G[40:, :20] = A, 1e7, np.eye(20)
    coupled = prepare(triplets(G), np.arange(60), span=1.0).ellipse
    assert coupled.imaginary < 1.1 * plain.imaginary


@pytest.mark.parametrize("n", [1201, 601])
def test_a_long_chain_with_an_input(n: int) -> None:
    """Long enough to be computed tile by tile, and not."""
    stiff = np.where(np.arange(n - 1) % 2, 2e5, 1.0)
    A = csr_array(np.pad(np.diag(stiff, 1) - np.diag(2e5 / stiff, -1), ((0, 2), (0, 2))))
    A += csr_array(([3e3, 70.0, -70.0], ([n // 2, n, n + 1], [n, n + 1, n])), shape=A.shape)
    z = np.append(np.random.default_rng(2).standard_normal(n), [1.0, 0.0])
    z[1:n:2] *= 400.0  # springs and inertias of equal energy
    found = prepare(Triplets(*A.nonzero(), A.data), np.arange(n + 2), span=0.1, inputs=2).advance(z, 0.003, 8, 1e-12)
    expected = expm_multiply(A, z, 0.003, 0.024, 8, endpoint=True)
    error = np.abs(found - expected)
    assert error[:, :n:2].max() < 1e-11 * np.abs(expected[:, :n:2]).max()
    assert error[:, 1:n:2].max() < 1e-11 * np.abs(expected[:, 1:n:2]).max()
