"""Coefficients of the Runge-Kutta methods: order conditions, and SciPy's copy of Dormand and Prince's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import DOP853

from gearlib.solvers.rungekutta.tableaux import (
    DOP853_A,
    DOP853_C,
    DOP853_D,
    DOP853_E,
    TSIT5_A,
    TSIT5_C,
    TSIT5_E,
    TSIT5_R,
)


def table(rows: Sequence[Sequence[float]], n: int) -> Any:
    """Rows padded with zeros to ``n`` columns."""
    return np.array([[*row, *[0.0] * (n - len(row))] for row in rows])


def test_dormand_and_prince_are_scipys() -> None:
    A, n = table(DOP853_A, 16), DOP853.n_stages
    assert pytest.approx(DOP853.A, rel=1e-14) == A[:n, :n]
    assert pytest.approx(DOP853.B, rel=1e-14) == A[n, :n]
    assert pytest.approx(DOP853.A_EXTRA, rel=1e-14) == A[n + 1 :]
    assert pytest.approx([*DOP853.C, 1.0, *DOP853.C_EXTRA], rel=1e-14) == DOP853_C
    for mine, other in zip(DOP853_E, (DOP853.E3, DOP853.E5), strict=True):
        assert pytest.approx(other, rel=1e-13, abs=1e-16) == [*mine, 0.0]
    assert pytest.approx(DOP853.D, rel=1e-13) == table(DOP853_D, 16)


def test_a_stage_is_at_the_time_of_its_argument() -> None:
    """The rows of A sum to c: a right-hand side of 1 gives x(t + c h) = x + c h."""
    for A, c in ((TSIT5_A, TSIT5_C), (DOP853_A, DOP853_C)):
        assert [sum(row) for row in A] == pytest.approx(c, abs=1e-14)


def test_conditions_of_order_five() -> None:
    """All 17 of them, as for trees of up to five nodes."""
    A, c = table(TSIT5_A, 7), np.array(TSIT5_C)
    b, Ac, Ac2 = A[6], A @ np.array(TSIT5_C), A @ np.array(TSIT5_C) ** 2
    conditions = {
        1: [b.sum()], 2: [b @ c], 3: [b @ c**2], 6: [b @ Ac], 4: [b @ c**3], 8: [b @ (c * Ac)], 12: [b @ Ac2], 24: [b @ (A @ Ac)],
        5: [b @ c**4], 10: [b @ (c**2 * Ac)], 15: [b @ (c * Ac2)], 30: [b @ (c * (A @ Ac))], 20: [b @ Ac**2, b @ (A @ c**3)],
        40: [b @ (A @ (c * Ac))], 60: [b @ (A @ Ac2)], 120: [b @ (A @ (A @ Ac))],
    }  # fmt: skip
    for share, found in conditions.items():
        assert found == pytest.approx([1 / share] * len(found), abs=1e-14)


def test_the_embedded_method_is_of_order_four_and_no_more() -> None:
    """The error estimate vanishes for trees of up to four nodes; of those of five it is of some size."""
    A, c, e = table(TSIT5_A, 7), np.array(TSIT5_C), np.array(TSIT5_E)
    Ac = A @ c
    assert [e.sum(), e @ c, e @ c**2, e @ Ac, e @ c**3, e @ (c * Ac), e @ (A @ c**2), e @ (A @ Ac)] == pytest.approx(
        [0.0] * 8, abs=1e-14
    )
    assert 1e-4 < abs(e @ c**4) < 1e-2


def test_the_free_interpolant_is_of_order_four_throughout_the_step() -> None:
    """It integrates cubics exactly up to any fraction of the step; at the end it is the step itself."""
    c, weights = np.array(TSIT5_C), [Polynomial([0.0, *row]) for row in TSIT5_R]
    for theta in (0.1, 0.37, 0.8, 1.0):
        b = np.array([weight(theta) for weight in weights])
        for k in range(4):
            assert b @ c**k == pytest.approx(theta ** (k + 1) / (k + 1), abs=1e-14)
    assert [weight(1.0) for weight in weights] == pytest.approx([*TSIT5_A[6], 0.0], abs=1e-13)
    slopes = [weight.deriv()(1.0) for weight in weights]
    assert slopes == pytest.approx([0.0] * 6 + [1.0], abs=1e-12)  # the slope at the end is that of the next step
