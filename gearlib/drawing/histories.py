"""Plots of variables over time: one diagram per unit, event marks, and comparison of runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, one_name
from gearlib.drawing.quantities import NAMES, Shown, axis_label, in_unit, spelled
from gearlib.drawing.style import COLOURS, MARK, figure, legend
from gearlib.errors import ArgumentError

Floats = NDArray[np.float64]
DASHES = ((0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1, 2)), (0, (3, 1, 1, 1, 1, 1)))
MOST_LINES = 40  # number of events up to which they are drawn as lines; beyond that as ticks at the edge


@dataclass(frozen=True, eq=False)
class History:
    """A variable over time.

    Parameters
    ----------
    name, unit : str
        In SI units.
    time, values : arrays
    run : str
        Label of the run; empty for the first.
    """

    name: str
    unit: str
    time: Floats
    values: Floats
    run: str = ""


def shown_units(histories: Sequence[History], units: Mapping[str, str] | None) -> list[Shown]:
    """The display unit of each history: chosen by the variable's name, or by its SI unit.

    Raises
    ------
    ArgumentError
        A unit of another dimension, or a choice for something that is not shown.
    """
    chosen = {} if units is None else by_name("units", units, "units by name or by SI unit, such as {'m': 'µm'}", "m")
    for key, wanted in chosen.items():
        one_name(f"units[{key!r}]", wanted, "kN.m")
    by_unit = {spelled(key): value for key, value in chosen.items()}
    known = {h.name for h in histories} | {spelled(h.unit) for h in histories} | {"s"}
    for key in chosen:
        if key not in known and spelled(key) not in known:
            raise ArgumentError(
                f"units: nothing that is shown is called '{key}' or is in that unit; shown: {', '.join(sorted(filter(None, known)))}"
            )
    return [in_unit(h.unit, chosen.get(h.name, by_unit.get(spelled(h.unit)))) for h in histories]


def plot_histories(
    histories: Sequence[History], events: Sequence[tuple[float, str]] = (), *, units: Mapping[str, str] | None = None,
    axes: Any = None,
) -> Any:  # fmt: skip
    """Plot histories over time, one diagram per unit.

    Parameters
    ----------
    histories : sequence of History
        Histories of other runs have the colour of the same variable, and are dashed.
    events : sequence of (time, name)
        Marked in all diagrams.
    units : mapping of str to str, optional
        Display units, by variable or by SI unit: ``{"m": "µm", "s": "ms"}``.
    axes : matplotlib Axes, or one for each unit, optional

    Returns
    -------
    An array if there are several units.
    """
    found = shown_units(histories, units)
    time = in_unit("s", None if units is None else dict(units).get("s"))
    groups: dict[str, list[int]] = {}
    for i, shown in enumerate(found):
        groups.setdefault(shown.text, []).append(i)
    rows = figure(axes, len(groups), (8.0, 1.2 + 2.3 * len(groups)), sharex=True) if axes is None else figure(axes, len(groups))
    names = list(dict.fromkeys(h.name for h in histories))
    runs = list(dict.fromkeys(h.run for h in histories))
    for row, (unit, members) in zip(np.atleast_1d(rows), groups.items(), strict=True):
        here = list(dict.fromkeys(histories[i].name for i in members))
        for i in members:
            history, shown = histories[i], found[i]
            run = runs.index(history.run)
            label = history.name + (f" ({history.run})" if history.run else "")
            row.plot(
                history.time * time.factor, history.values * shown.factor, label=label, lw=1.4 if run == 0 else 1.2,
                color=COLOURS[names.index(history.name) % len(COLOURS)], ls="-" if run == 0 else DASHES[(run - 1) % len(DASHES)],
            )  # fmt: skip
        quantities = {NAMES.get(spelled(histories[i].unit), "") for i in members}
        quantity = quantities.pop() if len(quantities) == 1 else ""
        single = len(here) == 1
        row.set_ylabel(axis_label(here[0] if single else quantity or "value", unit))
        row.grid(alpha=0.3)
        _mark(row, [(t * time.factor, name) for t, name in events])
        if len(members) > 1 or events:
            legend(row)
    np.atleast_1d(rows)[-1].set_xlabel(axis_label("time", time.text))
    return rows


def _mark(axes: Any, events: Sequence[tuple[float, str]]) -> None:
    """Mark events at the upper edge, and by thin lines if there are few."""
    if not events:
        return
    times = [t for t, _ in events]
    above = axes.get_xaxis_transform()
    axes.plot(times, np.full(len(times), 0.985), "v", color=MARK, ms=4, transform=above, clip_on=False, label="events", lw=0)
    if len(times) <= MOST_LINES:
        axes.vlines(times, 0, 1, color=MARK, lw=0.5, ls=":", transform=above, zorder=0)
