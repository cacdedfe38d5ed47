"""The choice of ``auto`` on random trains: work of a few, and times of two hundred."""

from __future__ import annotations

import pytest

import gearlib as gl
from tests.stress.choice_campaign import ALLOWED, campaign
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train
from tests.stress.linear_reference import LinearTrain, start_values


@pytest.mark.parametrize(("seed", "rtol", "order"), [(88, 1e-6, 8), (42, 1e-8, 5), (42, 1e-6, 5), (88, 1e-8, 8)])
def test_the_order_is_that_which_takes_less_work(seed: int, rtol: float, order: int) -> None:
    """A fine tolerance does not need order 8 where something else limits the steps, nor does a coarse one always do without."""
    train = hybrid_train(seed)
    system = gl.compile(Model(train=train))
    given = {"start": start_values(LinearTrain(train)), "inputs": train.unbound(), "rtol": rtol, "samples": 21}
    stats = {method: system.simulate(train.t_end, method=method, **given).stats for method in ("auto", "rk5", "rk8")}
    assert stats["auto"]["method"] == f"rk{order}"
    assert stats["auto"]["work"] <= 1.5 * min(stats["rk5"]["work"], stats["rk8"]["work"])
    assert stats["auto"]["rhs"] > 0.6 * min(stats["rk5"]["rhs"], stats["rk8"]["rhs"])  # of both legs


@pytest.mark.stress
@pytest.mark.parametrize(("family", "count"), [("linear", 110), ("hybrid", 90)])
def test_never_more_than_twice_the_best_method(family: str, count: int) -> None:
    worst = [str(choice) for choice in campaign(family, 0, count) if choice.ratio > ALLOWED]
    assert not worst
