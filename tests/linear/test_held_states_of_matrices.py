"""Held states of matrices by hand: the subspace that is left is invariant, and holds all that can move."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from numpy.typing import NDArray

from gearlib.linear import held_states as module
from gearlib.linear.held_states import Remaining, remaining

Floats = NDArray[np.float64]
FORMS = [np.asarray, sparse.csr_matrix]


def restricted(
    monkeypatch: pytest.MonkeyPatch, form: Any, held: Any, A: Any, B: Any = None, positions: int = 0, nodes: Any = None
) -> Remaining | None:
    """What remains where some combinations of states are held; the first states are positions, integrals of declared speeds."""
    states = nodes or tuple((v, 0) for v in range(len(A)))
    rows = np.array(held, float).reshape(-1, len(A))
    monkeypatch.setattr(module, "held_speeds", lambda *_: rows)
    monkeypatch.setattr(module, "integrals", lambda _: set(range(positions)))
    structure: Any = SimpleNamespace(model=None)
    prepared: Any = SimpleNamespace(program=SimpleNamespace(states=states))
    nothing = np.empty(0)
    return remaining(structure, prepared, 0.0, nothing, nothing, form(A), None if B is None else form(B))


def full(matrix: Any) -> Floats:
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seed", range(12))
def test_what_is_left_is_invariant_and_as_large_as_it_can_be(seed: int, form: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Speeds of which some combinations are held; positions with rates of them; and a heat, which is no position."""
    rng = np.random.default_rng(seed)
    speeds, held, places = int(rng.integers(2, 7)), int(rng.integers(1, 3)), int(rng.integers(0, 5))
    n = places + 1 + speeds
    H = rng.normal(size=(held, speeds)) * 10.0 ** rng.uniform(-3, 3, (held, 1))
    if seed % 3 == 0:
        H[0] = np.eye(speeds)[-1]  # a speed that is a state
    R = rng.normal(size=(places, speeds))
    inside = rng.random(places) < 0.5
    R[inside] = rng.normal(size=(inside.sum(), held)) @ H  # held with them
    A, B = np.zeros((n, n)), np.zeros((n, 2))
    A[:places, places + 1 :], A[places, places + 1 :] = R * 10.0 ** rng.uniform(-3, 3, (places, 1)), H[0]
    free = np.eye(speeds) - np.linalg.pinv(H) @ H
    A[places + 1 :], B[places + 1 :] = free @ rng.normal(size=(speeds, n)), free @ rng.normal(size=(speeds, 2))
    told = np.vstack([H[:1], -3 * H[:1], H, H[0] + 2 * H[-1]])  # some of them depend on others
    rows = np.hstack([np.zeros((len(told), places + 1)), told])
    found = restricted(monkeypatch, form, rows, A, B, places)
    assert found is not None
    basis, keep = full(found.basis), found.keep
    both = np.linalg.matrix_rank(R) + np.linalg.matrix_rank(H) - np.linalg.matrix_rank(np.vstack([R, H]))
    assert len(keep) == n - np.linalg.matrix_rank(H) - both
    assert basis.shape == (n, len(keep))
    assert places in keep
    assert basis[keep] == pytest.approx(np.eye(len(keep)), abs=1e-12)
    size = np.abs(A).max()
    assert A @ basis == pytest.approx(basis @ A[keep] @ basis, abs=1e-8 * size)
    assert basis @ B[keep] == pytest.approx(B, abs=1e-9)
    assert H @ basis[places + 1 :] == pytest.approx(np.zeros((held, len(keep))), abs=1e-8 * np.abs(H).max())


@pytest.mark.parametrize("form", FORMS)
def test_nothing_is_left_out_where_nothing_is_held(form: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor where a combination is held at this point alone: its rate depends on a state. Inputs change none."""
    A = np.array([[-1.0, 2.0, 0.0], [-1.0, 2.0, 0.0], [0.0, 1.0, 0.0]])
    assert restricted(monkeypatch, form, np.empty((0, 3)), A) is None
    assert restricted(monkeypatch, form, [[1.0, 1.0, 0.0]], A) is None
    found = restricted(monkeypatch, form, [[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]], A, np.array([[1.0], [1.0], [3.0]]))
    assert found is not None
    assert (found.keep.tolist(), full(found.basis).tolist()) == ([1, 2], [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_a_rate_is_zero_by_its_own_terms(form: Any, size: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative to the largest rate of each state; a state's own rate is zero by its equation, whatever rounding says."""
    A = size * np.array([[1.0, 3.0], [1.0, 3.0 * (1 + 1e-13)]])
    found = restricted(monkeypatch, form, [[1.0, -1.0]], A)
    assert found is not None
    assert full(found.basis).tolist() == [[1.0], [1.0]]
    A[1, 1] = size * 3.0 * (1 + 1e-6)
    assert restricted(monkeypatch, form, [[1.0, -1.0]], A) is None
    found = restricted(monkeypatch, form, [[0.0, 2.0]], A)
    assert found is not None
    assert (found.keep.tolist(), full(found.basis).tolist()) == ([0], [[1.0], [0.0]])


@pytest.mark.parametrize("form", FORMS)
def test_angles_of_held_speeds_are_held_if_they_move_otherwise(form: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """By their name as integrals, or since their speed is a state; what depends on nothing stays."""
    A = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    for positions, nodes, kept in (
        (2, None, [1]), (0, None, [0, 1]), (0, ((7, 0), (8, 0), (7, 1)), [1]), (0, ((7, 0), (8, 0), (9, 1)), [0, 1]),
    ):  # fmt: skip
        found = restricted(monkeypatch, form, [[0.0, 0.0, 5.0]], A, None, positions, nodes)
        assert found is not None
        assert found.keep.tolist() == kept
        assert full(found.basis).tolist() == np.eye(3)[:, kept].tolist()
    still = restricted(monkeypatch, form, [[0.0, 0.0, 5.0]], 0 * A, None, 2)
    assert still is not None
    assert still.keep.tolist() == [0, 1]
    pushed = restricted(monkeypatch, form, [[0.0, 0.0, 5.0]], A, np.array([[1.0], [0.0], [0.0]]), 2)  # an input moves it, too
    assert pushed is not None
    assert pushed.keep.tolist() == [0, 1]
