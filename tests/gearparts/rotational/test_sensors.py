"""Sensors at motions and torques worked out by hand."""

from __future__ import annotations

from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits, powers

MOVED = {"flange.phi": 0.75, "der(flange.phi)": 2.0, "flange_a.phi": 0.5, "flange_b.phi": 1.75, "flange.tau": 0.0}
MEASURED: list[tuple[Any, dict[str, float]]] = [
    (gp.AngleSensor, {"phi": 0.75}),
    (gp.SpeedSensor, {"w": 2.0}),
    (gp.AccSensor, {"w": 2.0, "der(w)": 3.0, "a": 3.0}),
    (gp.RelAngleSensor, {"phi_rel": 1.25}),
    (gp.RelSpeedSensor, {"phi_rel": 1.25, "der(phi_rel)": 2.0, "w_rel": 2.0}),
    (gp.RelAccSensor, {"phi_rel": 1.25, "der(phi_rel)": 2.0, "w_rel": 2.0, "der(w_rel)": 3.0, "a_rel": 3.0}),
    (gp.RelativeStates, {"phi_rel": 1.25, "der(phi_rel)": 2.0, "w_rel": 2.0, "der(w_rel)": 3.0, "a_rel": 3.0}),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "values"), MEASURED)
def test_sensors_of_motion_take_no_torque(kind: Any, values: dict[str, float]) -> None:
    assert misfits(kind(), MOVED | {"flange_a.tau": 0.0, "flange_b.tau": 0.0} | values) == []
    for loaded in ("flange.tau", "flange_a.tau", "flange_b.tau"):
        taken = MOVED | {"flange_a.tau": 0.0, "flange_b.tau": 0.0} | values | {loaded: 1.0}
        assert misfits(kind(), taken) in ([], [loaded])
    assert powers(kind(), {}) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("kind", "values"),
    [(gp.TorqueSensor, {"tau": 4.0}), (gp.PowerSensor, {"power": 8.0}), (gp.MultiSensor, {"w": 2.0, "tau": 4.0, "power": 8.0})],
)
def test_sensors_in_a_shaft_pass_its_torque_on(kind: Any, values: dict[str, float]) -> None:
    through = {"flange_a.phi": 0.5, "flange_b.phi": 0.5, "der(flange_a.phi)": 2.0, "flange_a.tau": 4.0, "flange_b.tau": -4.0}
    assert misfits(kind(), through | values) == []
