"""Exponentials of many small systems at once: each run as SciPy's exponential of its own matrix."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy
from scipy.linalg import expm

from gearlib.equations.quasipolynomials import TIME
from gearlib.solvers.exponential import many
from gearlib.solvers.exponential.forcing import Forcing, recognise
from gearlib.solvers.exponential.many import RepeatedSteps, histories
from gearlib.solvers.exponential.stretches import stretches

RUNS = 5


def systems(n: int, scales: float = 1.0) -> Any:
    """Matrices of unlike sizes, in unlike units of the states."""
    rng = np.random.default_rng(n)
    units = scales ** rng.uniform(-1, 1, (RUNS, n))
    A = rng.normal(size=(RUNS, n, n)) * 10.0 ** rng.uniform(-2, 1, (RUNS, 1, 1))
    A[0] = 0.0
    return A * units[:, :, None] / units[:, None, :], rng.normal(size=(RUNS, n)) * units


@pytest.mark.parametrize("count", [1, 2, 3, 4, 17, 100])
@pytest.mark.parametrize("columns", [[0], [2, 0], [0, 1, 2]])
def test_samples_are_entries_of_powers(count: int, columns: list[int]) -> None:
    A, z = systems(3)
    steps = RepeatedSteps(A, 0.05, np.ones((RUNS, 3)))
    found = steps.samples(z, count, np.array(columns))
    assert found.shape == (RUNS, count, len(columns))
    for run in range(RUNS):
        exact = np.array([expm(A[run] * 0.05 * (k + 1)) @ z[run] for k in range(count)])
        assert found[run] == pytest.approx(exact[:, columns], rel=1e-11, abs=1e-11 * np.abs(exact).max())
        assert steps.after(z, count)[run] == pytest.approx(exact[-1], rel=1e-11, abs=1e-11 * np.abs(exact).max())
    assert steps.after(z, 0) == pytest.approx(z, abs=0.0)


@pytest.mark.parametrize("at_once", [2, 64])
@pytest.mark.parametrize("scales", [1.0, 1e8])
def test_histories_with_inputs_that_switch(scales: float, at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """u = (t, then 1; 2 throughout), with samples before, at and after the switch, two at one time, and ever shorter steps at last."""
    monkeypatch.setattr(many, "AT_ONCE", at_once)
    A, x = systems(3, scales)
    B = np.random.default_rng(1).normal(size=(RUNS, 3, 2)) * np.abs(x)[:, :, None]
    times = np.array([0.0, 0.1, 0.2, 0.5, 0.75, 0.75, 0.9, 1.0])
    forcing = recognise([sympy.Piecewise((TIME, TIME < 0.5), (1, True)), sympy.Integer(2)], 0.0, 1.0)
    assert isinstance(forcing, Forcing)
    columns = np.array([2, 1])
    out = np.full((RUNS, len(times), 2), 7.0)
    found = histories(A, B, forcing, stretches(times, 0.0, forcing.breakpoints), x, columns, out)
    assert found is out
    assert (out[:, 0] == 7.0).all()  # rows at the start are left as they are
    for run in range(RUNS):
        G = np.zeros((6, 6))  # states; the two inputs, and the slope of the first
        G[:3, :3], G[:3, 3:5], G[3, 5] = A[run], B[run], 1.0
        middle = expm(0.5 * G) @ [*x[run], 0.0, 2.0, 1.0]
        for k, t in enumerate(times[1:], 1):
            z = expm(t * G) @ [*x[run], 0.0, 2.0, 1.0] if t <= 0.5 else expm((t - 0.5) * G) @ [*middle[:3], 1.0, 2.0, 0.0]
            assert out[run, k] == pytest.approx(z[columns], rel=1e-10, abs=1e-10 * np.abs(z[columns]).max())


def test_a_run_that_overflows_does_not_harm_others() -> None:
    A, x = np.array([[[1e4]], [[-1.0]], [[np.nan]]]), np.ones((3, 1))
    forcing, times = recognise([sympy.Integer(0)], 0.0, 1.0), np.array([0.0, 0.5, 1.0])
    assert isinstance(forcing, Forcing)
    cuts = stretches(times, 0.0, forcing.breakpoints)
    out = histories(A, np.zeros((3, 1, 1)), forcing, cuts, x, np.array([0]), np.ones((3, 3, 1)))
    assert out[1, :, 0] == pytest.approx(np.exp(-times), rel=1e-14)
    assert not np.isfinite(out[[0, 2], 2]).any()


def test_rows_are_doubled_as_often_as_columns() -> None:
    """For one state; for more of them fewer, since each row costs a product with every column. A single sample needs none."""
    for count, columns, doublings in (
        (1, 1, 0), (2, 1, 0), (3, 1, 1), (16, 1, 2), (17, 1, 2), (64, 1, 3), (100, 1, 3), (1024, 1, 5), (1024, 4, 4), (1024, 16, 3),
        (1024, 1024, 0), (16, 100, 0),
    ):  # fmt: skip
        assert many.rows_for(count, columns) == doublings
    for count in range(1, 300):
        assert 2 ** many.rows_for(count, 1) <= 2 * count


@pytest.mark.parametrize("h", [0.3, -0.3, 40.0, 1e-9])
def test_each_matrix_has_as_many_doublings_as_it_needs(h: float) -> None:
    """Whatever the units of its states and the size of what drives them."""
    rng = np.random.default_rng(7)
    H = np.zeros((5, 4, 4))
    H[:, :3, :3] = rng.normal(size=(5, 3, 3)) * np.array([1e-6, 1e-2, 1.0, 0.3, 0.0])[:, None, None] - 0.5 * np.eye(3)
    H[:, :3, 3] = rng.normal(size=(5, 3))
    units = np.append(10.0 ** rng.uniform(-3, 3, (5, 3)), np.full((5, 1), 1e-5), axis=1)
    G = H * units[:, :, None] / units[:, None, :]
    scales = many.balanced(G[:, :3, :3])
    assert scales.shape == (5, 3)
    assert (np.log2(scales) % 1.0 == 0.0).all()
    balanced = G[:, :3, :3] / scales[:, :, None] * scales[:, None, :]
    assert np.abs(balanced).sum(axis=1).max() < 20.0
    found = many.deviations(G, h, scales)
    for own, exact, unit in zip(found, H, units, strict=True):
        expected = expm(exact * h) - np.eye(4)
        assert own / unit[:, None] * unit == pytest.approx(expected, rel=1e-9, abs=1e-14 + 1e-12 * np.abs(expected).max())
    wrong = np.where(np.arange(5)[:, None, None] == 2, np.nan, G)
    others = many.deviations(wrong, h, many.balanced(wrong[:, :3, :3]))
    assert not np.isfinite(others[2]).any()
    assert others[:2] == pytest.approx(found[:2], rel=1e-12)
