"""The sparse exponential's preparation: order, scaling, and the ellipse around the field of values."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.sparse import csr_array
from scipy.sparse.linalg import expm_multiply
from scipy.special import gammainc

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


@pytest.mark.parametrize(("n", "rate"), [(9, 0.1), (39, 0.1), (39, 0.2), (39, 0.5)])
def test_a_lag_that_follows_a_vibration(n: int, rate: float) -> None:
    """Its rate moves the centre of the ellipses, both of which are rounded."""
    A = np.zeros((n + 1, n + 1))
    A[:n, :n] = chain(n)
    fastest = np.abs(np.linalg.eigvals(A).imag).max()
    A[n, 0], A[n, n] = rate * fastest, -rate * fastest
    z, h = np.append(1.0 + np.arange(n) % 2 * 400.0, 0.0), 20.0 / fastest
    expected = expm(A * h) @ z
    assert prepare(triplets(A), np.arange(n + 1), span=1.0).advance(z, h, 1, 1e-10)[0] == pytest.approx(
        expected, rel=1e-9, abs=1e-9 * np.abs(expected).max()
    )


@pytest.mark.parametrize("vibrates", [False, True])
@pytest.mark.parametrize("t", [10.0, 50.0])
def test_a_cascade_of_lags_keeps_its_digits(t: float, vibrates: bool) -> None:
    """Of 20 lags of 1 s, driven by a constant input; of 10 oscillators that are damped critically, each driven by the one before."""
    n, A = 20, np.zeros((21, 21))
    if vibrates:
        for k in range(0, n, 2):
            A[k, k + 1], A[k + 1, k], A[k + 1, k + 1], A[k + 1, k - 2 if k else n] = 1.0, -1.0, -2.0, 1.0
    else:
        A[:n, :n] = np.diag(-np.ones(n)) + np.diag(np.ones(n - 1), -1)
        A[0, n] = 1.0
    x = prepare(triplets(A), np.arange(n + 1), span=t, inputs=1).advance(np.append(np.zeros(n), 1.0), t / 20, 20, 1e-9)[-1]
    expected = gammainc(np.arange(1, n + 1), t)
    assert x[0:n:2] == pytest.approx(expected[1::2], abs=1e-6) if vibrates else x[:n] == pytest.approx(expected, abs=1e-6)


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


ELLIPSES = {
    "undamped": Ellipse(0.0, 1e-3, 2.0), "diffusion": Ellipse(-3.0, 3.0, 0.4), "lightly damped": Ellipse(-1.0, 1.0, 2.0),
    "circle": Ellipse(-1.0, 1.0, 1.0), "growing": Ellipse(0.5, 0.7, 1.5),
}  # fmt: skip


@pytest.mark.parametrize("tolerance", [1e-5, 1e-12])
@pytest.mark.parametrize("h", [0.01, 1.0, 40.0])
@pytest.mark.parametrize("kind", ELLIPSES)
def test_a_series_is_the_exponential_on_the_ellipse(kind: str, h: float, tolerance: float) -> None:
    """On its boundary and inside; no longer than the tolerance asks for. The polynomials are Chebyshev's, by their recurrence."""
    e = ELLIPSES[kind].with_foci()
    assert (e.centre, e.real) == (ELLIPSES[kind].centre, ELLIPSES[kind].real)
    assert e.imaginary == (pytest.approx(math.hypot(1.0, 0.5)) if kind == "circle" else ELLIPSES[kind].imaginary)
    turn = np.exp(1j * np.linspace(0.0, 2.0 * math.pi, 41))
    z = e.centre + np.outer([0.3, 1.0], e.real * turn.real + 1j * e.imaginary * turn.imag).ravel()
    focus = math.sqrt(abs(e.real**2 - e.imaginary**2))
    sign, radius = (1.0 if e.imaginary > e.real else -1.0), (e.real + e.imaginary) / focus
    x = (z - e.centre) / (focus * radius)
    last, now = np.ones_like(x), x
    c = e.series(h, tolerance)
    total = c[0] + c[1] * now
    for value in c[2:]:
        last, now = now, 2.0 * x * now + sign / radius**2 * last
        total = total + value * now
    largest = math.exp(h * (e.centre + e.real))
    allowed = max(tolerance, 1e-14 * largest)
    assert np.abs(total - np.exp(h * z)).max() < 10.0 * allowed
    assert len(c) == 2 or abs(c[-1]) > 0.2 * allowed


@pytest.mark.parametrize("growth", [0.0, 3.0])
@pytest.mark.parametrize(("h", "count"), [(0.002, 1), (0.002, 20), (0.02, 5), (2.0, 3)])
def test_steps_shorter_and_longer_than_a_series(h: float, count: int, growth: float) -> None:
    """Up to eight output steps share a series, the last ones fewer; a long step takes several."""
    A = chain(9) + growth * np.eye(9)
    z = np.where(np.arange(9) % 2, 400.0, 1.0)
    found = prepare(triplets(A), np.arange(9), span=1.0).advance(z, h, count, 1e-12)
    expected = np.array([expm((k + 1) * h * A) @ z for k in range(count)])
    size = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected) / size).max() < 1e-9


def test_what_a_matrix_costs_grows_with_its_work() -> None:
    """Estimated: as the number of steps, with their length beyond that of a series, and with the number of nonzeros."""
    small, large = (prepare(triplets(chain(n)), np.arange(n), span=1.0) for n in (59, 599))
    several = [small.seconds(0.1, count, 1e-9) - 1e-4 for count in (100, 200)]
    assert several[1] == pytest.approx(2.0 * several[0], rel=0.05)
    longer = [small.seconds(h, 10, 1e-9) - 1e-4 for h in (1.0, 4.0)]
    assert longer[1] == pytest.approx(4.0 * longer[0], rel=0.1)
    assert 2.0 < (large.seconds(0.1, 100, 1e-9) - 1e-4) / several[0] < 10.0
