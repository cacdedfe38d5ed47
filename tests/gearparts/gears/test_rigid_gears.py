"""Rigid gears: their equations hold at motions and torques worked out by hand, and nothing is stored or lost."""

from __future__ import annotations

from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits, powers


def test_a_gear_pair_turns_and_is_loaded_by_its_ratio() -> None:
    """Relative to its housing, which takes what is left of both torques."""
    values = {"ratio": 2.5, "flange_b.phi": 0.3, "flange_a.phi": 0.75, "flange_a.tau": 4.0, "flange_b.tau": -10.0}
    assert misfits(gp.IdealGear(ratio=2.5), values) == []
    on_housing = values | {"support.phi": 0.1, "flange_a.phi": 0.1 + 2.5 * 0.2, "support.tau": 6.0}
    assert misfits(gp.IdealGear(ratio=2.5, use_support=True), on_housing) == []


def test_a_planetary_set_turns_as_willis_says_and_shares_torque_by_its_ratio() -> None:
    """In the carrier's frame the ring turns against the sun, 2.5 times as slowly; the three torques add up to nothing."""
    carrier, sun = 0.4, 1.9
    ring = carrier - (sun - carrier) / 2.5
    values = {"ratio": 2.5, "sun.phi": sun, "carrier.phi": carrier, "ring.phi": ring}
    torques = {"sun.tau": 4.0, "ring.tau": 10.0, "carrier.tau": -14.0}
    assert misfits(gp.IdealPlanetary(ratio=2.5), values | torques) == []


@pytest.mark.parametrize("use_support_r", [False, True])
@pytest.mark.parametrize("use_support_t", [False, True])
@pytest.mark.parametrize(("kind", "size"), [(gp.IdealGearR2T, {"ratio": 8.0}), (gp.IdealRollingWheel, {"radius": 0.125})])
def test_a_rack_and_a_wheel_of_an_eighth_of_a_metre(
    kind: Any, size: dict[str, float], use_support_r: bool, use_support_t: bool
) -> None:
    """8 rad for each metre, a torque of an eighth of the force; both relative to housings, which take them."""
    part = kind(**size, use_support_r=use_support_r, use_support_t=use_support_t)
    turned, moved = 0.3 * use_support_r, 0.7 * use_support_t
    values = {
        **size, "support_r.phi": turned, "support_t.s": moved, "flange_t.s": moved + 0.2,
        "flange_r.phi": turned + 1.6, "flange_r.tau": 0.5, "flange_t.f": -4.0, "support_r.tau": -0.5, "support_t.f": 4.0,
    }  # fmt: skip
    assert misfits(part, values) == []


@pytest.mark.parametrize(
    "part",
    [gp.IdealGear(ratio=2.0), gp.IdealPlanetary(ratio=2.0), gp.IdealGearR2T(ratio=2.0), gp.IdealRollingWheel(radius=2.0)],
)
def test_rigid_gears_store_and_lose_nothing(part: Any) -> None:
    assert powers(part, {}) == (0.0, 0.0, 0.0)
