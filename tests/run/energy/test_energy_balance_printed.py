"""What an energy balance says of itself: its largest residual, the component to blame, and its table, from made-up numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gearlib.run.energy.energy_balance import EnergyBalance


def made(**given: Any) -> EnergyBalance:
    """A balance of one second, in which nothing happens but what is given."""
    nothing: dict[str, Any] = {kind: {} for kind in ("work", "stored", "heat", "jumps", "unaccounted", "residuals")}
    known = {"time": np.array([0.0, 1.0]), "returned": np.zeros(2), "unknown": (), "residual": np.zeros(2), "throughput": 0.0}
    return EnergyBalance(**{**nothing, **known, "quadrature": 0.0, "rtol": 1e-6, **given})


def over(*numbers: float) -> Any:
    return np.array(numbers)


@pytest.mark.parametrize(
    ("whole", "parts", "stored", "largest"),
    [
        (over(0, 3, -4), {}, {}, 4.0),
        (over(0, 3, -4), {"a": over(0, 5, 1), "b": over(0, -6, 0)}, {}, 6.0),
        (over(0, 0, 0), {"a": over(0, 0, 0)}, {}, 0.0),
        (over(0, 1e-3), {}, {"a": over(1e8, -3e8), "b": over(0.0, 2e8)}, 1e-3 - 5e-4),  # rounding: 1e-12 of what is stored
        (over(0, 1e-4), {}, {"a": over(1e8, -3e8)}, 0.0),
    ],
)
def test_the_largest_residual_is_beyond_the_rounding_of_what_is_stored(
    whole: Any, parts: Any, stored: Any, largest: float
) -> None:
    found = made(residual=whole, residuals=parts, stored=stored)
    assert found.largest_residual == pytest.approx(largest, rel=1e-12)


def test_a_residual_is_relative_to_what_is_exchanged() -> None:
    """And to what torques exchange at the speed of the tolerance; without either it counts as none."""
    assert made(residual=over(0, 3.0), throughput=5.0, unresolved=1.0).relative_residual == 0.5
    assert made(residual=over(0, 3.0), throughput=6.0).scale == 6.0
    assert made(residual=over(0, 3.0), unresolved=1.5).relative_residual == 2.0
    assert made(residual=over(0, 3.0)).relative_residual == 0.0


def test_the_worst_component() -> None:
    assert made(residuals={"a": over(0, 2, 1), "b": over(0, -3, 0), "c": over(0, 2.5, 2.5)}).worst == "b"
    assert made().worst == ""


def row(label: str, value: str) -> str:
    return f"{label:<40}{value:>14}"


def test_the_table_of_a_run() -> None:
    """Values at the end, the largest of a kind first, whatever their signs; what is stored is told by its change."""
    found = made(
        time=np.array([0.5, 1.0, 2.5]),
        work={"motor": over(0, 5, 9), "wall": over(0, 0, -0.25)},
        stored={"a": over(2, 7, 3), "b": over(4, 1, 1.5)},
        heat={"brake": over(0, 1, 1.25), "gear": over(0, 1, 8), "cooler": over(0, 0, -2)},
        residual=over(0, 3, 0.0123),
    )
    assert str(found).splitlines() == [
        "energy balance, 0.5 .. 2.5 s, J",
        row("work put in", "8.75"),
        row("  motor", "9"),
        row("  wall", "-0.25"),
        row("heat", "7.25"),
        row("  gear", "8"),
        row("  cooler", "-2"),
        row("  brake", "1.25"),
        row("stored, change", "-1.5"),
        row("  b", "-2.5"),
        row("  a", "1"),
        row("residual", "0.012"),
    ]


def test_the_table_of_a_run_with_everything() -> None:
    found = made(
        jumps={"spring": over(0, 0.5)}, unaccounted={"x": over(0, 1), "y": over(0, -3)}, returned=over(0, 0.125),
        unknown=("one", "other"),
    )  # fmt: skip
    assert str(found).splitlines() == [
        "energy balance, 0 .. 1 s, J",
        row("work put in", "0"),
        row("heat", "0"),
        row("stored, change", "0"),
        row("jumps at events", "0.5"),
        row("  spring", "0.5"),
        row("unaccounted for", "-2"),
        row("  y", "-3"),
        row("  x", "1"),
        row("heat that stays, through heat ports", "0.125"),
        row("residual", "0"),
        "not known how much power flows into one, other",
    ]
    assert "heat that stays" in str(made(returned=over(0.0, 2.0, 0.0)))  # at times, if not at the end


@pytest.mark.parametrize(("count", "more"), [(12, None), (13, "  ... and 1 more"), (20, "  ... and 8 more")])
def test_twelve_rows_of_a_kind_at_most(count: int, more: str | None) -> None:
    lines = str(made(heat={f"p{k}": over(0, k + 1.0) for k in range(count)})).splitlines()
    first = lines.index(row("heat", f"{count * (count + 1) / 2:g}")) + 1
    assert lines[first : first + 12] == [row(f"  p{k}", f"{k + 1}") for k in range(count - 1, count - 13, -1)]
    assert lines[first + 12] == (row("stored, change", "0") if more is None else more)


def test_the_table_fits_a_terminal() -> None:
    """Longer paths are cut in the middle, at 80 columns, and longer lines are wrapped."""
    path = "train." + "x" * 100
    lines = str(made(heat={path: over(0, 3.0)}, unknown=tuple(f"component_{k}" for k in range(20)))).splitlines()
    (line,) = [line for line in lines if "xxx" in line]
    assert line == f"  {path[:38]}...{path[-39:]}{'3':>14}"
    assert max(map(len, lines)) <= 100
