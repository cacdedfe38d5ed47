"""No answer depends on the order in which parts are declared, connected, or named in a connection."""

from __future__ import annotations

import pytest

import gearlib as gl
from tests.stress.analyses_campaign import analysed_train
from tests.stress.described import Model
from tests.stress.linear_draw import linear_train
from tests.stress.order import answers, differences, ordered_train, redundant


@pytest.mark.parametrize("seed", [3, 17, 31])
def test_a_few_trains(seed: int) -> None:
    """Rigid loops, prescribed speeds, elastic trains."""
    assert differences(analysed_train(seed), seed + 1) == []


def test_what_is_warned_of() -> None:
    """Torques between two flanges of one shaft: in any order the same inputs are named as those to which nothing responds."""
    one, other = (answers(linear_train(27), order, []) for order in (0, 28))
    assert len(one["response: warnings"]) == 2
    assert one["response: warnings"] == other["response: warnings"]


@pytest.mark.parametrize("seed", [100030, 100046])
def test_where_a_free_angle_starts(seed: int) -> None:
    assert differences(linear_train(seed), seed + 1, ["auto"]) == []


@pytest.mark.parametrize("order", [0, 5, 1100016])
def test_rigid_gears_that_stand_still_share_their_load(order: int) -> None:
    """Rounding leaves speeds of 1e-64 rad/s in some orders; as a factor in an equation of a sensor they must not scale a torque."""
    train = analysed_train(1100015)
    flow = gl.compile(Model(train=train, order=order)).power_flow(torques=train.unbound())
    half = train.part("torque0").value("tau").bias / 2
    assert [flow[f"{gear}.flange_a"].torque for gear in ("idealGear0", "idealGear2")] == pytest.approx([half, half], rel=1e-9)


def test_a_preload_that_is_zero_but_for_rounding_settles() -> None:
    """In some orders it is 4 N.m at first, and in each pass 1e15 times less."""
    train = ordered_train(1200036)
    for order in (0, 1, 2, 1200037):
        flow = gl.compile(Model(train=train, order=order)).power_flow(torques=train.unbound())  # without a warning
        assert abs(flow["spring0.flange_a"].torque) < 1e-12


@pytest.mark.parametrize("seed", [3, 32, 143, 152, 257, 353])
def test_what_is_redundant(seed: int) -> None:
    train = analysed_train(seed)
    found = [redundant(gl.compile(Model(train=train, order=order))) for order in (0, seed + 1, seed + 2)]
    assert found[0]
    assert found[0] == found[1] == found[2]


@pytest.mark.stress
@pytest.mark.parametrize("first", range(0, 1000, 50))
def test_many_trains(first: int) -> None:
    for seed in range(first, first + 50):
        wrong = differences(analysed_train(seed), seed + 1)
        assert wrong == [], f"train {seed}"
