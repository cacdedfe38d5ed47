"""Derivatives of transfer functions against differences of transfer functions of random matrices."""

import numpy as np
import pytest
import scipy.sparse as sparse

from gearlib.errors import ArgumentError
from gearlib.linear.linear_model import Matrices
from gearlib.linear.response_changes import frequency_direction, response_changes

S = 1j * np.array([0.3, 2.0, 11.0]) + 0.1


def drawn(rng: np.random.Generator) -> Matrices:
    return Matrices(*(rng.normal(size=shape) for shape in ((5, 5), (5, 2), (3, 5), (3, 2))))


def response(model: Matrices, s: complex) -> np.ndarray:
    return model.C @ np.linalg.solve(s * np.eye(5) - model.A, model.B) + model.D


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", [np.asarray, sparse.csr_array])
def test_changes_of_every_matrix(seed: int, kind: type) -> None:
    """Each matrix alone and all together; and the frequency, whose change is one of A."""
    rng, h = np.random.default_rng(seed), 1e-5
    model, whole = drawn(rng), drawn(rng)
    names = ("A", "B", "C", "D")
    for changed in (*names, names):
        change = Matrices(*(getattr(whole, name) * (name in changed) for name in names))

        def moved(step: float, change: Matrices = change) -> Matrices:
            return Matrices(*(getattr(model, name) + step * getattr(change, name) for name in names))

        found = response_changes(*(Matrices(kind(m.A), m.B, m.C, m.D) for m in (model, change)), S)
        for k, s in enumerate(S):
            expected = (response(moved(h), s) - response(moved(-h), s)) / (2 * h)
            assert found[:, :, k] == pytest.approx(expected, rel=1e-6, abs=1e-7)
    sparse_model = Matrices(kind(model.A), model.B, model.C, model.D)
    found = response_changes(sparse_model, frequency_direction(sparse_model), S)
    for k, s in enumerate(S):
        assert found[:, :, k] == pytest.approx((response(model, s + h) - response(model, s - h)) / (2 * h), rel=1e-6, abs=1e-7)


def test_large_matrices_with_few_entries_change_the_response_as_full_ones_do() -> None:
    """Eighty-four states: at several frequencies, and at a pole."""
    rng, n = np.random.default_rng(5), 84
    A, dA = (np.diag(rng.uniform(-2, -1, n)) + np.diag(rng.normal(size=n - 1), k) for k in (1, -1))
    others = [[rng.normal(size=shape) for shape in ((n, 2), (3, n), (3, 2))] for _ in range(2)]
    model, change = (Matrices(sparse.csr_array(m), *more) for m, more in zip((A, dA), others, strict=True))
    found = response_changes(model, change, S)
    for k, s in enumerate(S):
        inverse = np.linalg.inv(s * np.eye(n) - A)
        x = inverse @ model.B
        expected = change.D + change.C @ x + model.C @ inverse @ (dA @ x + change.B)
        assert found[:, :, k] == pytest.approx(expected, rel=1e-9)
    rate = response_changes(model, frequency_direction(model), S[:1])[:, :, 0]
    inverse = np.linalg.inv(S[0] * np.eye(n) - A)
    assert rate == pytest.approx(-model.C @ inverse @ inverse @ model.B, rel=1e-9)
    still = Matrices(sparse.csr_array(np.diag(np.arange(n) * 1.0)), *others[0])
    with pytest.raises(ArgumentError, match=r"the model has a pole at 3\+0j rad/s: the response there has no derivative"):
        response_changes(still, change, [3.0])


@pytest.mark.parametrize("kind", [np.asarray, sparse.csr_array])
def test_a_pole_is_named(kind: type) -> None:
    model = Matrices(kind(np.diag([0.0, -1.0])), np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)))
    with pytest.raises(ArgumentError, match=r"pole at 0\+0j rad/s"):
        response_changes(model, frequency_direction(model), [0.0])


def test_without_states_the_change_is_that_of_what_is_fed_through() -> None:
    def fed_through(value: float) -> Matrices:
        return Matrices(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[value]]))

    assert response_changes(fed_through(3.0), fed_through(0.5), [1j, 2j]).tolist() == [[[0.5, 0.5]]]
