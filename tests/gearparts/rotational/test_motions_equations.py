"""Prescribed motions: equations that hold at motions worked out by hand, on a housing that turns or without."""

from __future__ import annotations

import math
from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits

TURNING = {
    "phi": 0.3, "w": 2.0, "der(phi)": 2.0, "support.phi": 0.25, "flange.tau": 1.5, "support.tau": -1.5, "f_crit": 0.5,
    "phi_ref": 0.7, "w_ref": 5.0, "a_ref": 11.0, "k": 3.0, "w_fixed": 2.0,
}  # fmt: skip
CRITICAL = math.pi  # rad/s, of half a turn a second


def values(use_support: bool, **more: float) -> dict[str, float]:
    return TURNING | {"flange.phi": 0.55 if use_support else 0.3, **more}


CASES: list[tuple[Any, dict[str, Any], dict[str, float]]] = [
    (gp.Position, {"phi_ref": 0.7}, {"phi_error": -0.4, "der(w)": (0.4 * CRITICAL - 1.3617 * 2.0) * CRITICAL / 0.6180}),
    (gp.Position, {"phi_ref": 0.7, "exact": True}, {"phi_error": 0.0, "phi_ref": 0.3}),
    (gp.Speed, {"w_ref": 5.0}, {"w_error": -3.0, "der(w)": 3.0 * CRITICAL}),
    (gp.Speed, {"w_ref": 5.0, "exact": True}, {"w_error": 0.0, "w_ref": 2.0}),
    (gp.Accelerate, {"a_ref": 11.0}, {"der(w)": 11.0}),
    (gp.Move, {"phi_ref": 0.7, "w_ref": 5.0, "a_ref": 11.0},
     {"phi_error": -0.4, "w_error": -3.0, "der(w)": 11.0 + 2 * 3.0 * 3.0 + 9.0 * 0.4}),
    (gp.ConstantSpeed, {"w_fixed": 2.0}, {}),
]  # fmt: skip


@pytest.mark.parametrize("use_support", [False, True])
@pytest.mark.parametrize(("kind", "given", "motion"), CASES)
def test_a_motion_is_relative_to_its_housing_and_obeys_its_law(
    kind: Any, given: dict[str, Any], motion: dict[str, float], use_support: bool
) -> None:
    assert misfits(kind(**given, use_support=use_support), values(use_support, **motion)) == []
