"""The Laurent series of the resolvent at 0, whatever chains of poles there are: against Cauchy's integrals."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.linear.resolvent import laurent


@pytest.mark.parametrize(
    ("chains", "others"),
    [((), 3), ((1,), 0), ((1,), 3), ((1, 1), 0), ((1, 1), 3), ((2,), 0), ((2,), 3), ((3, 1), 0), ((3, 1), 3)],
)
def test_the_series_is_that_of_the_resolvent(chains: tuple[int, ...], others: int) -> None:
    rng = np.random.default_rng(len(chains) + others)
    n = sum(chains)
    A = np.zeros((n + others, n + others))
    begins = np.cumsum([0, *chains])
    for begin, length in zip(begins, chains, strict=False):
        A[begin : begin + length, begin : begin + length] = np.diag(np.ones(length - 1), 1)
    A[n:, n:] = np.diag(np.arange(-1.0, -1.0 - others, -1.0))
    basis = np.linalg.qr(rng.normal(size=A.shape))[0] * np.geomspace(1.0, 10.0, len(A))
    A = basis @ A @ np.linalg.inv(basis)
    poles, regular = laurent(A)
    assert len(poles) == max(chains, default=0)
    assert len(regular) == len(poles) + 1
    around = 0.3 * np.exp(2j * np.pi * np.arange(64) / 64)  # without a basis of the poles
    each = np.linalg.inv(around[:, None, None] * np.eye(len(A)) - A)
    for k, coefficient in [*((-k, m) for k, m in enumerate(poles, 1)), *enumerate(regular)]:
        assert coefficient == pytest.approx((each / around[:, None, None] ** k).mean(axis=0).real, abs=1e-8)
