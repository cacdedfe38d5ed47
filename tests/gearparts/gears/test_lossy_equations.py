"""Kinematics, torques and power of lossy gears on a housing or without: equations that hold at a motion worked out by hand."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import pytest

import gearparts as gp
from gearlib.errors import BindingError
from gearparts.gears.lossy import Gearbox, LossyGear
from tests.gearparts.laws import misfits, powers
from tests.gearparts.test_declared_numbers import parameters

LOSSES = ((0.0, 0.9, 0.8, 0.5, 0.3),)


@pytest.mark.parametrize("use_support", [False, True])
@pytest.mark.parametrize("loss_table", [((0.0, 1.0, 1.0, 0.0, 0.0),), LOSSES])
@pytest.mark.parametrize("use_heat_port", [False, True])
def test_a_gear_turns_by_its_ratio_and_passes_on_what_is_not_lost(
    use_support: bool, loss_table: Any, use_heat_port: bool
) -> None:
    """Against a housing at 0.1 rad, if there is one; forward, with flange_a driving by 4 N.m and a loss of 0.4 + 0.5 N.m."""
    lossless = loss_table is not LOSSES
    gear = LossyGear(ratio=2.5, loss_table=loss_table, use_support=use_support, use_heat_port=use_heat_port)
    housing, loss = 0.1 if use_support else 0.0, 0.0 if lossless else 0.9
    values = {
        "ratio": 2.5, "support.phi": housing, "flange_b.phi": housing + 0.2, "phi_a": 0.5, "flange_a.phi": housing + 0.5,
        "w_a": 6.0, "der(phi_a)": 6.0, "flange_a.tau": 4.0, "tau_loss": loss, "flange_b.tau": -2.5 * (4.0 - loss),
        "support.tau": -4.0 + 2.5 * (4.0 - loss), "loss_power": 6.0 * loss, "heat_port.Q_flow": -6.0 * loss,
        "der(w_a)": 1.25, "sa": 1.25, "tau_eta": 4.0 if lossless else 4.0 - 0.2 / (0.9 - 1 / 0.8),
        "loss_forward": loss, "loss_backward": 0.0 if lossless else (1 - 1 / 0.8) * 4.0 - 0.3,
    }  # fmt: skip
    modes = {"mode": 2.0} if lossless else {"mode": 1.0, "pre(mode)": 1.0, "moving": 1.0, "pre(moving)": 1.0}
    out = 4.0 if lossless else 0.9 * values["tau_eta"]  # T / eta2 or eta1 T, beyond its value where the sides change
    modes |= {"drives": 1.0, "tau_driving": values["tau_eta"], "tau_out": out}
    found = misfits(gear, defaultdict(float, values | modes))
    assert found == []
    assert powers(gear, defaultdict(float, values)) == (0.0, 6.0 * loss, 0.0)


@pytest.mark.parametrize(
    ("column", "values", "said"),
    [  # through 1, 0, 0, 1 Akima's curve falls to -1/8, as his formula gives by hand
        (1, (0.5, 1.0, 1.0, 0.5), "eta1 goes from 0.5 to 1.0625"),
        (1, (0.5, 0.0, 0.0, 0.5), "eta1 goes from -0.0625 to 0.5"),
        (2, (0.5, 1.0, 1.0, 0.5), "eta2 goes from 0.5 to 1.0625"),
        (2, (0.5, 1e-9, 1e-9, 0.5), "eta2 goes from -0.0625 to 0.5"),
        (3, (4.0, 0.0, 0.0, 4.0), "B1 goes from -0.5 to 4"),
        (4, (4.0, 0.0, 0.0, 4.0), "B2 goes from -0.5 to 4"),
        (3, (0.0, 4.0, 4.0, 0.0), None),  # sliding torques may be as large as they are
    ],
)
def test_between_rows_losses_stay_losses(column: int, values: tuple[float, ...], said: str | None) -> None:
    rows = [[speed, 0.8, 0.8, 0.5, 0.5] for speed in (0.0, 1.0, 2.0, 3.0)]
    for row, value in zip(rows, values, strict=True):
        row[column] = value
    table = tuple(map(tuple, rows))
    for smoothness in ("linear", "constant", "akima"):
        gear = LossyGear(ratio=2.0, loss_table=table, smoothness=smoothness)
        if smoothness == "akima" and said:
            with pytest.raises(
                BindingError, match=rf"^LossyGear\.loss_table: the akima curve of {said} between rows; expected eta1"
            ):
                gear._check_between(table)
        else:
            gear._check_between(table)


def test_losses_at_their_limits_are_losses_between_rows_too() -> None:
    table = ((0.0, 0.0, 1e-12, 0.0, 0.0), (1.0, 1.0, 1.0, 0.0, 9.0), (2.0, 1.0, 1.0, 9.0, 0.0), (3.0, 0.0, 1e-12, 0.0, 0.0))
    LossyGear(ratio=2.0, loss_table=table)._check_between(table)


def test_a_gearbox_hands_its_values_to_a_gear_and_a_coupling() -> None:
    found = parameters(Gearbox(ratio=2.5, loss_table=LOSSES, c=3.0, d=4.0, b=0.5, use_support=True, use_heat_port=True))
    expected = {"lossyGear.ratio": 2.5, "elastoBacklash.c": 3.0, "elastoBacklash.d": 4.0, "elastoBacklash.b": 0.5}
    assert {name: found[name] for name in expected} == expected
    box = gp.Gearbox(ratio=2.5, loss_table=LOSSES, c=3.0, d=4.0)
    assert (box.lossyGear.loss_table, box.lossyGear.use_support, box.lossyGear.use_heat_port) == (LOSSES, False, False)
    values = {
        "elastoBacklash.phi_rel": 0.3,
        "elastoBacklash.w_rel": 0.4,
        "lossyGear.loss_power": 5.0,
        "elastoBacklash.loss_power": 7.0,
    }
    assert misfits(box, values | {"phi_rel": 0.3, "w_rel": 0.4, "loss_power": 12.0}) == []
