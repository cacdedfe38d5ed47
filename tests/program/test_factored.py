"""The solution operator of a large linear block is minus the columns of the dense inverse, however it is applied."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from gearlib.program import factored
from gearlib.program.factored import Factored


@pytest.mark.parametrize("n_known", [3, 7, 12])
@pytest.mark.parametrize("chunk", [1, 5, 256])
def test_products_rows_and_solutions(n_known: int, chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(factored, "CHUNK", chunk)
    n, rng = 12, np.random.default_rng(n_known)
    matrix = np.where(rng.random((n, n)) < 0.3, rng.normal(size=(n, n)), 0.0) + 4.0 * np.eye(n)
    known = np.sort(rng.permutation(n)[:n_known])
    operator = Factored(splu(sparse.csc_matrix(matrix)), known)
    right: Any = -np.linalg.inv(matrix)[:, known]
    few, many = rng.normal(size=(n_known, 17)), rng.normal(size=(n, 17))
    assert operator.shape == right.shape
    np.testing.assert_allclose(operator @ few, right @ few, atol=1e-14)
    np.testing.assert_allclose(operator.transposed(many), right.T @ many, atol=1e-14)
    np.testing.assert_allclose(operator.solve(many), np.linalg.solve(matrix, many), atol=1e-14)
    for rows in ([5], [4, 0, 4], list(range(n_known)), list(range(n))):
        np.testing.assert_allclose(operator[rows], right[rows], atol=1e-14)
    np.testing.assert_allclose(operator.tolist(), right, atol=1e-14)
