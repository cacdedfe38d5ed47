"""How the closed loop's matrix moves with a parameter, against differences, also with a feedthrough."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.feedback.stability_sensitivity import closed_loop, closed_loop_change
from gearlib.linear.linear_model import Matrices


@pytest.mark.parametrize("feedthrough", [0.0, 0.7, -3.0])
def test_the_closed_loop_moves_as_differences_say(feedthrough: float) -> None:
    rng = np.random.default_rng(2)
    shapes = (4, 4), (4, 1), (1, 4), (1, 1)
    here = [*(rng.normal(size=shape) for shape in shapes[:3]), np.array([[feedthrough]])]
    change = [rng.normal(size=shape) for shape in shapes]
    h = 1e-5
    low, high = (closed_loop(Matrices(*(m + side * dm for m, dm in zip(here, change, strict=True)))) for side in (-h, h))
    assert closed_loop_change(Matrices(*here), Matrices(*change)) == pytest.approx((high - low) / (2 * h), rel=1e-6, abs=1e-7)
