"""Lines of a power flow's table and of its balance, letter by letter."""

from __future__ import annotations

import math

import pytest

from gearlib.statics import power_flow
from gearlib.statics.power_flow import FlangePower, PowerFlow


def flange(component: str, name: str, speed: float, torque: float, shaft: int = 0, sliding: bool = False) -> FlangePower:
    return FlangePower(component, name, speed, torque, speed * torque, shaft, True, sliding)


def test_columns_are_thirteen_letters_wide_behind_the_names() -> None:
    turns, slides = flange("motor", "flange", 100.0, -12.5), flange("a", "b", -0.25, 4e6, sliding=True)
    assert power_flow.table_of([turns], (100.0, 12.5)) == [
        "flange         speed, rad/s  speed, 1/min   torque, N.m      power, W",
        "motor.flange            100        954.93         -12.5         -1250",
        "(torque and power are positive into the component: a drive's power is negative, a load's positive)",
    ]
    assert power_flow.table_of([turns, slides], (100.0, 4e6))[1:3] == [
        "motor.flange            100        954.93         -12.5         -1250",
        "a.b                   -0.25             -         4e+06        -1e+06  (m/s, N)",
    ]
    assert power_flow.table_of([], (0.0, 0.0))[0].startswith("flange   speed, rad/s")


@pytest.mark.parametrize("length", [5, 31, 32, 33, 41, 42, 43, 60])
@pytest.mark.parametrize("sliding", [False, True])
def test_names_of_up_to_42_letters_are_whole(length: int, sliding: bool) -> None:
    """Fewer where rows end with the units of what slides, so that no line is longer than 100 letters."""
    most = 32 if sliding else 42
    flanges = [flange("abcde" * 12, "f", 1.0, 2.0)]
    flanges[0] = FlangePower(("0123456789" * 6)[: length - 2], "f", 1.0, 2.0, 2.0, 0, True)
    if sliding:
        flanges.append(flange("s", "f", 1.0, 2.0, sliding=True))
    head, first, *_ = power_flow.table_of(flanges, (1.0, 2.0))
    width = min(length, most)
    assert head.startswith("flange".ljust(width) + "   speed, rad/s")
    assert (first[:width] == flanges[0].name) == (length <= most)
    assert first[width : width + 15] == "1".rjust(15)
    assert all(len(line) <= 100 for line in power_flow.table_of(flanges, (1.0, 2.0)))


@pytest.mark.parametrize(
    ("speed", "torque", "shown"),
    [
        (0.9e-12, 5.0, ["0", "0", "5", "0"]), (1.1e-12, 5.0, ["1.1e-12", "1.05042e-11", "5", "5.5e-12"]),
        (-0.9e-12, -5.0, ["0", "0", "-5", "0"]),
        (1.0, 4.9e-12, ["1", "9.5493", "0", "0"]), (-1.0, -5.1e-12, ["-1", "-9.5493", "-5.1e-12", "5.1e-12"]),
        (-1.0, 0.0, ["-1", "-9.5493", "0", "0"]), (-1.0, -4.9e-12, ["-1", "-9.5493", "0", "0"]),
    ],
)  # fmt: skip
def test_what_is_rounding_beside_the_largest_is_shown_as_zero(speed: float, torque: float, shown: list[str]) -> None:
    _, line, _ = power_flow.table_of([flange("a", "b", speed, torque)], (1.0, 5.0))
    assert line.split() == ["a.b", *shown]


def test_the_balance_of_a_train_with_losses() -> None:
    flanges = (
        flange("motor", "f", 10.0, -8.0, 0), flange("gear", "a", 10.0, 8.0, 0), flange("gear", "b", 5.0, -12.0, 1),
        flange("belt", "a", 5.0, 4.0, 1), flange("belt", "b", 4.0, -4.0, 2), flange("fan", "f", 4.0, 4.0, 2),
        flange("pump", "f", 5.0, 8.0, 1),
    )  # fmt: skip
    flow = PowerFlow(flanges, 1)
    assert flow._balance == [
        "input power        80 W from motor", "output power       56 W to fan, pump", "losses             24 W: gear 20, belt 4",
        "efficiency         0.7", "circulating power  none",
    ]  # fmt: skip
    assert flow._scales == (10.0, 12.0)
    assert flow._left_out == flow._sharing == []
    assert flow._title == "Steady power flow: mobility 1 (1 degree of freedom)"
    assert [f.name for f in flow._shown] == ["motor.f", "gear.a", "gear.b", "belt.a", "belt.b", "fan.f", "pump.f"]
    assert [(b.component, b.shaft, b.power) for b in flow._branches] == [
        ("motor", 0, -80.0), ("gear", 0, 80.0), ("gear", 1, -60.0), ("belt", 1, 20.0), ("belt", 2, -16.0), ("fan", 2, 16.0),
        ("pump", 1, 40.0),
    ]  # fmt: skip


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_powers_that_are_rounding_count_neither_as_losses_nor_as_branches(size: float) -> None:
    """Below 1e-12 of the largest; a part that gives that much between two shafts is no drive."""
    part = [flange("part", "a", 1.0, 0.5 * size, 0), flange("part", "b", 1.0, (-0.5 - 0.9e-12) * size, 1)]
    ends = [flange("motor", "f", 1.0, -size, 0), flange("load", "f", 1.0, size, 1)]
    flow = PowerFlow((*ends, *part), 1)
    assert flow.losses == {}
    assert flow.outer == ("motor", "load")
    assert {b.component for b in flow._branches} == {"motor", "load", "part"}
    part[1] = flange("part", "b", 1.0, (-0.5 + 1.1e-12) * size, 1)
    assert list(PowerFlow((*ends, *part), 1).losses) == ["part"]
    part[1] = flange("part", "b", 1.0, (-0.5 - 1.1e-12) * size, 1)
    assert PowerFlow((*ends, *part), 1).outer == ("motor", "load", "part")
    small = [flange("small", "a", 1.0, factor * 1e-12 * size, 3 + k) for k, factor in enumerate((0.9, 1.1))]
    assert [b.shaft for b in PowerFlow((*ends, *small), 1)._branches] == [0, 1, 4]


def test_parts_are_sums_over_their_flanges_on_a_shaft() -> None:
    """Two flanges of one part on one shaft are one branch; flanges of composites count for nothing."""
    own = (flange("a", "x", 2.0, 3.0, 0), flange("a", "y", 2.0, 4.0, 0), flange("a", "z", 1.0, -5.0, 1))
    box = FlangePower("box", "x", 2.0, 300.0, 600.0, 0, False)
    flow = PowerFlow((*own, box), 2)
    assert [(b.component, b.shaft, b.power) for b in flow._branches] == [("a", 0, 14.0), ("a", 1, -5.0)]
    assert flow.absorbed == {"a": 9.0}
    assert flow.largest == 600.0
    assert flow.imbalance == 9.0 / 600.0
    assert flow._title == "Steady power flow: mobility 2 (2 degrees of freedom)"
    assert math.isnan(flow.efficiency)
    assert [f.name for f in flow._shown] == ["a.x", "a.y", "a.z"]
