"""Sliding friction: where the pairs touch, how they slide, and the torques of each on both gears, pair by pair."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import gearparts as gp
from tests.gearparts.laws import right_side

VALUES = {
    "mu": 0.06, "v_smooth": 0.3, "approach": 0.9, "pitch": 0.015, "tangent_a": 0.021, "tangent_b": 0.043, "f": -700.0,
    "w_a": 11.0, "w_b": -4.0,
}  # fmt: skip


def by_hand(sense: int, contact_ratio: float, phase: float) -> dict[str, float]:
    """Of pairs at ``come``, ``come + 1``, ... base pitches from where contact begins, as far as the path of contact goes."""
    x = VALUES
    come = phase / (2 * math.pi) % 1.0
    places = [come + k for k in range(4) if come + k < contact_ratio]
    beyond = [sense * x["pitch"] * (place - x["approach"]) for place in places]
    arms_a, arms_b = [x["tangent_a"] + s for s in beyond], [sense * x["tangent_b"] - s for s in beyond]
    sliding = [a * x["w_a"] + b * x["w_b"] for a, b in zip(arms_a, arms_b, strict=True)]
    signs = [math.tanh(v / x["v_smooth"]) for v in sliding]
    force = x["mu"] * 700.0 / len(places)
    return {
        "beyond": beyond[0],
        "sliding": sliding[0],
        "grip": float(np.mean(signs)),
        "grip_later": sum(k * sign for k, sign in enumerate(signs)) / len(signs),
        "tau_friction_a": force * sum(arm * sign for arm, sign in zip(arms_a, signs, strict=True)),
        "tau_friction_b": force * sum(arm * sign for arm, sign in zip(arms_b, signs, strict=True)),
    }


@pytest.mark.parametrize(("kind", "sense"), [(gp.DetailedExternalMesh, 1), (gp.DetailedInternalMesh, -1)])
@pytest.mark.parametrize("contact_ratio", [1.0, 1.6, 2.0, 2.7, 3.0])
def test_friction_of_each_pair_of_teeth(kind: Any, sense: int, contact_ratio: float) -> None:
    mesh = kind(r_a=0.1, r_b=0.2, c=1e8, d=0.0, friction=True, contact_ratio=contact_ratio)
    for phase in (0.4, 2.0, 4.1, 5.9, 2 * math.pi + 0.4, -1.0):
        expected = by_hand(sense, contact_ratio, phase)
        assert {
            name: right_side(mesh, name, phase=phase, **VALUES | {n: v for n, v in expected.items() if n != name})
            for name in expected
        } == pytest.approx(expected, rel=1e-12)  # fmt: skip
    rubbing = {"tau_friction_a": 3.0, "tau_friction_b": -5.0, "w_a": 2.0, "w_b": 7.0, "f": 11.0, "r_a": 0.1, "r_b": 0.2}
    assert right_side(mesh, "flange_a.tau", **rubbing) == pytest.approx(1.1 + 3.0)
    assert right_side(mesh, "flange_b.tau", **rubbing) == pytest.approx(sense * 2.2 - 5.0)
    assert right_side(mesh, "loss_power", d=0.5, v=8.0, **rubbing) == pytest.approx(32.0 + 6.0 - 35.0)


@pytest.mark.parametrize(("kind", "sense"), [(gp.DetailedExternalMesh, 1), (gp.DetailedInternalMesh, -1)])
def test_contact_begins_and_ends_between_the_tangent_points(kind: Any, sense: int) -> None:
    """0.9 base pitches before the pitch point and 0.8 behind it; of a ring both tangent points lie on one side."""
    mesh = kind(r_a=0.1, r_b=0.2, c=1e8, d=0.0, friction=True, contact_ratio=1.7)
    assert right_side(mesh, "from_tangent_a", **VALUES) == pytest.approx(0.021 - sense * 0.9 * 0.015)
    assert right_side(mesh, "to_tangent_b", **VALUES) == pytest.approx(0.043 - 0.8 * 0.015)


@pytest.mark.parametrize("kind", [gp.DetailedExternalMesh, gp.DetailedInternalMesh])
def test_without_friction_nothing_rubs(kind: Any) -> None:
    mesh = kind(r_a=0.1, r_b=0.2, c=1e8, d=0.0)
    for name in ("from_tangent_a", "to_tangent_b", *by_hand(1, 1.6, 0.4)):
        assert right_side(mesh, name, phase=0.4, **VALUES) == 0.0
    rubbing = {"tau_friction_a": 3.0, "tau_friction_b": -5.0, "w_a": 2.0, "w_b": 7.0}
    assert [right_side(mesh, name, **rubbing) for name in ("flange_a.tau", "flange_b.tau", "loss_power")] == [0.0, 0.0, 0.0]
