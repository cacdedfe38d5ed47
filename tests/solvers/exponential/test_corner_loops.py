"""The compiled loops from corner to corner, with prescribed matrices and intervals, against numpy and closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.compiler.native_module import native_functions
from gearlib.solvers.exponential import corner_loops
from gearlib.solvers.exponential.corner_loops import Corners


def run(name: str, record: Corners, out: Any, **arrays: Any) -> Any:
    """What a loop writes, with the states that it leaves."""
    assert native_functions(corner_loops.__name__).call(name, record, out=out, **arrays) == 0
    assert arrays["x"].tolist() == out[-1].tolist()
    return out


@pytest.mark.parametrize(("n", "inputs", "count"), [(1, 1, 1), (3, 1, 4), (2, 3, 6), (4, 0, 3)])
def test_each_interval_has_the_matrix_of_its_length(n: int, inputs: int, count: int) -> None:
    """The states change by the first columns times them and the others times the values and slopes of its inputs."""
    rng = np.random.default_rng(n)
    matrices, drive, x = rng.normal(size=(3, n, n + 2 * inputs)), rng.normal(size=(count, 2 * inputs)), rng.normal(size=n)
    which, expected = rng.integers(0, 3, count), [x]
    for i, u in zip(which, drive, strict=True):
        expected.append(expected[-1] + matrices[i] @ np.concatenate([expected[-1], u]))
    record = Corners(n=n, inputs=inputs, count=count)
    out = run(
        "by_matrices", record, np.empty((count, n)), matrices=matrices, which=which, drive=drive, x=x.copy(), z=np.empty(n)
    )
    assert out == pytest.approx(np.array(expected[1:]), rel=1e-13)


def by_series(A: Any, B: Any, x: Any, lengths: Any, drive: Any, rate: float, reach: float = 1.0) -> Any:
    """States at the ends of intervals by the series; B times the inputs drives them."""
    n, m = B.shape
    G = np.zeros((n, n + 2 * m))
    G[:, :n], G[:, n : n + m] = A, B
    work = {name: np.empty(n + 2 * m) for name in ("z", "term", "following")}
    record = Corners(n=n, inputs=m, count=len(lengths), rate=rate, reach=reach)
    return run(
        "by_series", record, np.empty((len(lengths), n)), G=G, lengths=np.array(lengths), drive=drive, x=np.array(x), **work
    )


@pytest.mark.parametrize(("n", "inputs"), [(1, 1), (3, 2), (2, 3), (4, 0)])
@pytest.mark.parametrize("reach", [0.25, 1.0])
def test_series_are_exponentials(n: int, inputs: int, reach: float) -> None:
    """Of intervals as long as they like, down to none, each with its own values and slopes."""
    rng = np.random.default_rng(10 + n)
    A, B, x = rng.normal(size=(n, n)), rng.normal(size=(n, inputs)), rng.normal(size=n)
    lengths, drive = [0.3, 0.0, 1e-3, 2.0, 0.7], rng.normal(size=(5, 2 * inputs))
    whole, expected = np.zeros((n + 2 * inputs,) * 2), [x]
    whole[:n, :n], whole[:n, n : n + inputs] = A, B
    whole[n : n + inputs, n + inputs :] = np.eye(inputs)
    for h, u in zip(lengths, drive, strict=True):
        expected.append((expm(whole * h) @ np.concatenate([expected[-1], u]))[:n])
    found = by_series(A, B, x, lengths, drive, float(np.linalg.norm(A, 2)), reach)
    assert found == pytest.approx(np.array(expected[1:]), rel=1e-12)


@pytest.mark.parametrize("product", [0.999, 1.0, 1.001, 7.3, 30.0])
def test_long_intervals_are_divided(product: float) -> None:
    """A decay of thirty: one series of forty terms would lose all digits to cancellation."""
    found = by_series(np.array([[-product]]), np.zeros((1, 1)), [1.0], [1.0], np.zeros((1, 2)), product)
    assert found[0, 0] == pytest.approx(math.exp(-product), rel=1e-13)


def test_terms_are_added_while_they_count() -> None:
    """Also where the rate says that they do not: a chain of integrators, whose last state is reached by the last term."""
    n = 12
    found = by_series(np.diag(np.ones(n - 1), -1), np.eye(n)[:, :1], np.zeros(n), [0.5], np.array([[2.0, 3.0]]), 1e-9)
    expected = [2.0 * 0.5**k / math.factorial(k) + 3.0 * 0.5 ** (k + 1) / math.factorial(k + 1) for k in range(1, n + 1)]
    assert found[0] == pytest.approx(expected, rel=1e-12, abs=0.0)
