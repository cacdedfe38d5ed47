"""Heat: equations and energies at numbers worked out by hand."""

from __future__ import annotations

from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits, powers


def test_a_body_is_warmed_by_what_flows_into_it() -> None:
    values = {"C": 4.0, "T": 310.0, "port.T": 310.0, "der(T)": 2.5, "port.Q_flow": 10.0}
    assert misfits(gp.HeatCapacitor(C=4.0), values) == []
    assert powers(gp.HeatCapacitor(C=4.0), values) == (1240.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("part", "ends", "conductance"),
    [(gp.ThermalConductor(G=3.0), ("port_a", "port_b"), "G"), (gp.Convection(Gc=3.0), ("solid", "fluid"), "Gc")],
)
def test_heat_flows_to_the_colder_end(part: Any, ends: tuple[str, str], conductance: str) -> None:
    warm, cold = ends
    values = {
        conductance: 3.0, f"{warm}.T": 320.0, f"{cold}.T": 300.0, "dT": 20.0, "Q_flow": 60.0, f"{warm}.Q_flow": 60.0,
        f"{cold}.Q_flow": -60.0,
    }  # fmt: skip
    assert misfits(part, values) == []
    assert powers(part, values) == (0.0, 0.0, 0.0)


def test_surroundings_keep_their_temperature_and_take_all_heat() -> None:
    values = {"T": 290.0, "port.T": 290.0, "port.Q_flow": 7.0}
    assert misfits(gp.FixedTemperature(T=290.0), values) == []
    assert powers(gp.FixedTemperature(T=290.0), values) == (0.0, 7.0, 0.0)
