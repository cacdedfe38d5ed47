"""Nonlinear blocks at and around their limits, at numbers."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.laws import right_side
from tests.gearparts.test_declared_numbers import parameters

B = gp.blocks


def test_true_is_above_one_half() -> None:
    """As a selector and as a signal that is selected."""
    levels = (0.0, 0.5, 0.75, 1.0)
    for u1, u2, u3 in itertools.product(levels, repeat=3):
        chosen = u1 if u2 > 0.5 else u3
        given = {"u1": u1, "u2": u2, "u3": u3}
        assert right_side(B.Switch(), "y", **given) == chosen
        assert right_side(B.LogicalSwitch(), "y", **given) == float(chosen > 0.5), given


@pytest.mark.parametrize("rest", [{"u_max": 1.5, "u_min": -0.5}, {"u_max": 3.0, "u_min": 1.0}])
def test_a_dead_zone_begins_and_ends_with_nothing(rest: dict[str, float]) -> None:
    low, high, zone = rest["u_min"], rest["u_max"], B.DeadZone(**rest)
    for u, y in ((low - 0.25, -0.25), (low, 0.0), ((low + high) / 2, 0.0), (high, 0.0), (high + 0.25, 0.25)):
        assert right_side(zone, "y", u=u, **rest) == y


def test_a_limiter_passes_what_is_at_its_limits() -> None:
    for u, y in ((-2.0, -0.5), (-0.5, -0.5), (0.25, 0.25), (1.5, 1.5), (2.0, 1.5)):
        assert right_side(B.Limiter(y_max=1.5), "y", u=u, y_max=1.5, y_min=-0.5) == y


def test_a_limited_rate_is_the_lag_s_between_its_limits() -> None:
    limits = {"rising": 2.0, "falling": -3.0, "Td": 0.5}
    for u, rate in ((0.0, -3.0), (2.5, -3.0), (3.5, -1.0), (4.0, 0.0), (4.75, 1.5), (5.0, 2.0), (9.0, 2.0)):
        assert right_side(B.RateLimiter(), "der(y)", u=u, y=4.0, **limits) == rate


def test_a_switch_with_hysteresis_remembers_from_limit_to_limit() -> None:
    limits = {"u_low": -1.0, "u_high": 2.0}
    for u, from_off, from_on in ((-1.5, 0, 0), (-1.0, 0, 1), (0.5, 0, 1), (2.0, 0, 1), (2.5, 1, 1)):
        block = B.Hysteresis(**limits)
        assert [right_side(block, "on", u=u, pre_on=was, **limits) for was in (0.0, 1.0)] == [from_off, from_on]


@pytest.mark.parametrize(
    ("kind", "upper", "lower"),
    [(B.Limiter, "y_max", "y_min"), (B.DeadZone, "u_max", "u_min"), (B.Hysteresis, "u_high", "u_low")],
)
def test_limits_may_be_farther_below_zero_than_above(kind: Any, upper: str, lower: str) -> None:
    assert parameters(kind(**{upper: 2.0, lower: -3.0}))["room"] == 5.0
    if kind is not B.Hysteresis:  # whose limits are both given
        assert parameters(kind(**{upper: 2.0}))[lower] == -2.0


def test_a_rate_is_limited_alike_in_both_directions_unless_told_otherwise() -> None:
    assert parameters(B.RateLimiter(rising=2.0))["falling"] == -2.0
