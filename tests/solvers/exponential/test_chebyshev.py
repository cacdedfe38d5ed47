"""The compiled kernels of the sparse exponential with prescribed numbers, against numpy and plain searches."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
import pytest

from gearlib.solvers.exponential.chebyshev import TILE, Directions, Graph, Series, call


def matrix(n: int, offsets: list[int], alone: int, more: int, rng: Any) -> tuple[Any, dict[str, Any]]:
    """A matrix as diagonals and single entries, whose rows from ``alone`` on depend on no others; dense, and as the kernels take it."""
    rows, columns = np.indices((n, n))
    allowed = (rows < alone) | (columns >= alone)
    diagonals, dense = np.zeros((len(offsets), n)), np.zeros((n, n))
    for k, offset in enumerate(offsets):
        on = (columns - rows == offset) & allowed
        diagonals[k, rows[on]] = rng.normal(size=on.sum())
        dense[rows[on], columns[on]] = diagonals[k, rows[on]]
    margin = max(map(abs, offsets))
    free = np.argwhere(allowed & (dense == 0.0) & ((abs(columns - rows) <= margin) | (columns >= alone)))
    chosen = free[rng.choice(len(free), more, replace=False)]
    entries = rng.normal(size=more)
    dense[chosen[:, 0], chosen[:, 1]] = entries
    given = {"rows": chosen[:, 0].copy(), "columns": chosen[:, 1].copy(), "entries": entries, "diagonals": diagonals}
    return dense, given | {"offsets": np.array(offsets)}


def record_of(dense: Any, given: dict[str, Any], alone: int, beta: float, **more: Any) -> tuple[Series, dict[str, Any]]:
    n, margin = len(dense), int(abs(given["offsets"]).max())
    record = Series(
        n=n, n_offsets=len(given["offsets"]), n_entries=len(given["entries"]), margin=margin, alone=alone, beta=beta, **more
    )  # fmt: skip
    return record, {name: np.ascontiguousarray(a) for name, a in given.items()} | {"v": np.zeros(10 * (n + 2 * margin))}


def polynomials(dense: Any, beta: float, z: Any, count: int) -> Any:
    """z, M z / 2, and each next one M times the last one plus beta times the one before."""
    found = [z, 0.5 * dense @ z]
    while len(found) < count:
        found.append(dense @ found[-1] + beta * found[-2])
    return np.array(found[:count])


KINDS: dict[str, tuple[int, list[int], int, int]] = {  # states, offsets, rows that depend on others, single entries
    "diagonal alone": (5, [0], 5, 0),
    "two diagonals": (9, [-1, 0], 9, 3),
    "three": (30, [-1, 0, 1], 28, 5),
    "four, with inputs": (31, [-3, -1, 0, 2], 27, 9),
    "five": (30, [-2, -1, 0, 1, 2], 30, 0),
    "six, in tiles": (2 * TILE + 70, [-3, -2, -1, 0, 1, 3], 2 * TILE + 60, 12),
    "exactly two tiles": (2 * TILE, [-1, 0, 1], 2 * TILE, 0),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_march_sums_polynomials_of_the_matrix(kind: str) -> None:
    """Several steps ahead from the same ones, with more terms each; the last of them is where it goes on from."""
    n, offsets, alone, more = KINDS[kind]
    beta = 1.0 if n % 2 else -0.3
    rng = np.random.default_rng(n)
    dense, given = matrix(n, offsets, alone, more, rng)
    terms, count, several, width = np.array([2, 5, 10, 11]), 6, 4, 24
    coefficients = np.zeros((several, width))
    for j, used in enumerate(terms):
        coefficients[j, :used] = rng.normal(size=used) * 0.3 ** np.arange(used)
    z = rng.normal(size=n)
    expected, start = [], z.copy()
    for first in range(0, count, several):
        used = min(several, count - first)
        expected += [*(coefficients[:used, :11] @ polynomials(dense, beta, start, 11))]
        start = expected[-1]
    record, arrays = record_of(dense, given, alone, beta, width=width, several=several, repeats=1, count=count)
    out = np.full((count, n), np.nan)
    call("march", record, coefficients=coefficients, terms=terms, z=z, sums=np.empty((several, n)), out=out, **arrays)
    assert out == pytest.approx(np.array(expected), rel=1e-10, abs=1e-10 * abs(np.array(expected)).max())
    assert z.tolist() == out[-1].tolist()


@pytest.mark.parametrize("repeats", [1, 3])
def test_a_step_may_consist_of_substeps(repeats: int) -> None:
    rng = np.random.default_rng(repeats)
    dense, given = matrix(12, [-1, 0, 1], 12, 0, rng)
    coefficients = np.zeros((1, 16))
    coefficients[0, :7] = rng.normal(size=7) * 0.3 ** np.arange(7)
    one = coefficients[0, :7] @ polynomials(dense, 1.0, np.eye(12), 7).reshape(7, -1)
    step, z = np.linalg.matrix_power(one.reshape(12, 12), repeats), rng.normal(size=12)
    expected = np.array([np.linalg.matrix_power(step, k) @ z for k in range(1, 5)])
    record, arrays = record_of(dense, given, 12, 1.0, width=16, several=1, repeats=repeats, count=4)
    out = np.empty((4, 12))
    call("march", record, coefficients=coefficients, terms=np.array([7]), z=z, sums=np.empty((1, 12)), out=out, **arrays)
    assert out == pytest.approx(expected, rel=1e-9, abs=1e-10 * abs(expected).max())


@pytest.mark.parametrize("length", [2, 8, 9, 10, 17, 30])
def test_growth_is_the_largest_entry_of_every_eighth_polynomial_and_the_next(length: int) -> None:
    rng = np.random.default_rng(length)
    dense, given = matrix(9, [-1, 0, 2], 9, 3, rng)
    z = rng.normal(size=9)
    record, arrays = record_of(dense, given, 9, -1.0, length=length)
    call("growth", record, z=z, **arrays)
    seen = [k for k in range(2, length) if k % 8 < 2]
    assert record.largest == pytest.approx(abs(polynomials(dense, -1.0, z, 30)[seen]).max(initial=0.0), rel=1e-12)


def graph(n: int, edges: set[tuple[int, int]], weight: Any) -> dict[str, Any]:
    """Adjacency lists with a weight of each edge in its direction."""
    both = sorted(edges | {(j, i) for i, j in edges})
    indptr = np.searchsorted([i for i, _ in both], np.arange(n + 1))
    return {"indptr": indptr, "indices": np.array([j for _, j in both]), "weight": np.array([weight(i, j) for i, j in both])}


def random_edges(n: int, seed: int, share: float) -> set[tuple[int, int]]:
    rng = np.random.default_rng(seed)
    return {(i, j) for i in range(n) for j in range(i) if rng.random() < share}


@pytest.mark.parametrize("seed", range(4))
def test_scales_spread_along_edges_and_parts_are_labelled(seed: int) -> None:
    """Each part from its first node on, where the scale is one; with consistent weights any way gives the same."""
    n, edges = 24, random_edges(24, seed, 0.06)
    height = np.random.default_rng(seed).normal(size=n)
    own = graph(n, edges, lambda i, j: height[i] - height[j])
    own["indices"] = own["indices"] if len(own["indices"]) else np.zeros(1, np.int64)
    logs, label, record = np.full(n, np.nan), np.zeros(n, np.int64), Graph(n=n)
    call("spread", record, logs=logs, label=label, queue=np.empty(n, np.int64), **own)
    expected = np.full(n, -1)
    for root in range(n):
        if expected[root] < 0:
            number, queue = expected.max() + 1, deque([root])
            while queue:
                i = queue.pop()
                expected[i] = number
                queue += [j for a, b in edges for i_, j in ((a, b), (b, a)) if i_ == i and expected[j] < 0]
    assert label.tolist() == expected.tolist()
    assert record.components == expected.max() + 1
    roots = np.array([int(np.argmax(expected == label)) for label in range(record.components)])
    assert logs == pytest.approx(height - height[roots[label]], abs=1e-12)


def breadth_first(n: int, edges: set[tuple[int, int]], start: int) -> list[int]:
    near: list[list[int]] = [sorted(j for a, b in edges for k, j in ((a, b), (b, a)) if k == i) for i in range(n)]
    found = [start]
    for i in found:
        found += sorted((j for j in near[i] if j not in found), key=lambda j: len(near[j]))
    return found


@pytest.mark.parametrize("seed", range(4))
def test_the_narrow_order_is_cuthills_and_mckees(seed: int) -> None:
    """From a node that is farthest from one that is farthest from the first one, part by part."""
    n, edges = 30, random_edges(30, seed, 0.05)
    own = graph(n, edges, lambda i, j: 0.0)
    order = np.empty(n, np.int64)
    work = {name: np.zeros(n, np.int64) for name in ("queue", "mark", "label")}
    call("narrow_order", Graph(n=n), order=order, degree=np.diff(own["indptr"]), **own, **work)
    expected: list[int] = []
    for root in range(n):
        if root not in expected:
            part = breadth_first(n, edges, root)
            for _ in range(2):
                part = breadth_first(n, edges, part[-1])
            expected += part
    assert order.tolist() == expected


def test_bounds_are_gershgorins_of_the_hermitian_parts() -> None:
    rng = np.random.default_rng(3)
    A = np.where(rng.random((8, 8)) < 0.5, rng.normal(size=(8, 8)), 0.0) - np.diag(rng.uniform(1.0, 2.0, 8))
    rows, columns = np.nonzero((A != 0) | (A.T != 0))
    off = rows != columns
    rows, columns = rows[off], columns[off]
    angles = np.linspace(0.0, math.pi, 9)
    bounds = np.empty(9)
    call(
        "hermitian_bounds", Directions(n=8, n_entries=len(rows), count=9), diagonal=np.diag(A).copy(), rows=rows,
        symmetric=0.5 * (A + A.T)[rows, columns], skew=0.5 * (A - A.T)[rows, columns], cosines=np.cos(angles), sines=np.sin(angles),
        sums=np.empty(8), bounds=bounds,
    )  # fmt: skip
    for angle, bound in zip(angles, bounds, strict=True):
        H = 0.5 * (np.exp(-1j * angle) * A + np.exp(1j * angle) * A.T)
        assert bound == pytest.approx((np.diag(H).real + abs(H).sum(axis=1) - abs(np.diag(H))).max(), rel=1e-12)
