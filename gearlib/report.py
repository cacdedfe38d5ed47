"""`System.report`: a self-contained HTML report of a model."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearlib.arguments import as_path, by_name, name_list, shown
from gearlib.drawing.histories import shown_units
from gearlib.drawing.page import Curve, Section, chart, page, paragraph, picture, preformatted, table
from gearlib.drawing.quantities import NAMES, axis_label, spelled
from gearlib.drawing.style import COLOURS
from gearlib.errors import ArgumentError, GearlibError
from gearlib.files.replacing import replacing
from gearlib.run.result import Result
from gearlib.statics.power_flow import PowerFlow
from gearlib.vibration.campbell import RPM, Campbell
from gearlib.vibration.modes import Modes, modes

if TYPE_CHECKING:
    from gearlib.flatten.model import FlatModel
    from gearlib.language.component import Component

DASHES = ("", "7 3", "2 3", "9 3 2 3")
HINT = '<p class="hint">Drag to zoom, double click to see everything, click a name to hide its curve.</p>'


def write_report(
    system: Any, component: Component, model: FlatModel, path: str | os.PathLike[str], *,
    result: Result | Mapping[str, Result] | None = None,
    names: Sequence[str] | None = None, campbell: Campbell | None = None, power_flow: PowerFlow | None = None,
    units: Mapping[str, str] | None = None, depth: int = 2,
) -> Path:  # fmt: skip
    """Write the report of a system; arguments as for `System.report`."""
    target = as_path("path", path, "train.html")
    if target.suffix.lower() not in (".html", ".htm"):
        raise ArgumentError(f"path is {shown(str(path))}; a report is a page of HTML: name it ....html")
    for what, given, kind in (("campbell", campbell, Campbell), ("power_flow", power_flow, PowerFlow)):
        if given is not None and not isinstance(given, kind):
            raise ArgumentError(f"{what} is {shown(given)}; expected a {kind.__name__}, as gl.{what}(...) gives it")
    runs = _runs(result)
    sections = [
        Section("Diagram", picture(component.diagram(depth).svg)),
        Section("Summary", preformatted(system.summary())),
        Section("Parameters", _parameters(system, model)),
        Section("States", _states(system, model, next(iter(runs.values()), None))),
    ]
    if runs:
        sections.append(Section("Histories", _histories(runs, names, units)))
    sections.append(Section("Modes", _modes(system)))
    if campbell is not None:
        sections.append(Section("Critical speeds", _campbell(campbell)))
    if power_flow is not None:
        sections.append(Section("Power flow", picture(power_flow.sankey().svg) + preformatted(str(power_flow))))
    about = (type(component).__doc__ or "").strip().partition("\n")[0].replace("`", "")
    with replacing(target) as beside:
        beside.write_text(page(system.name, about, sections), encoding="utf-8")
    return target


def _runs(result: Any) -> dict[str, Result]:
    if result is None:
        return {}
    expected = "the result of simulate(), or such results by name"
    runs = by_name("result", result, expected, "full load") if isinstance(result, Mapping) else {"": result}
    for run in runs.values():
        if not isinstance(run, Result):
            raise ArgumentError(f"result is {shown(run)}; expected {expected}")
    return runs


def _declared(model: FlatModel) -> dict[str, tuple[str, str]]:
    """Unit and description of every variable and parameter, by path."""
    found: dict[str, tuple[str, str]] = {}
    for part in model.instances:
        prefix = f"{part.path}." if part.path else ""
        found |= {prefix + name: (v.unit, v.description) for name, v in part.declared.variables.items()}
        found |= {prefix + name: (p.unit, p.description) for name, p in part.declared.parameters.items()}
    return found


def _parameters(system: Any, model: FlatModel) -> str:
    known, values = _declared(model), system.parameters
    if not values:
        return paragraph("The model has none.")
    rows = [[n, v, spelled(known[n][0]) if n in known else "", known[n][1] if n in known else ""] for n, v in values.items()]
    return f'<div class="scroll">{table(["parameter", "value", "unit", "meaning"], rows)}</div>'


def _states(system: Any, model: FlatModel, run: Result | None) -> str:
    known = _declared(model)
    rows: list[list[str | float]] = []
    for name in system.states:
        unit, meaning = known.get(name, ("", ""))
        rows.append([name, *([] if run is None else [float(run[name][0]), float(run[name][-1])]), spelled(unit), meaning])
    if not rows:
        return paragraph("The model has none.")
    head = ["state", *([] if run is None else ["at the start", "at the end"]), "unit", "meaning"]
    return f'<div class="scroll">{table(head, rows)}</div>'


def _histories(runs: Mapping[str, Result], names: Sequence[str] | None, units: Mapping[str, str] | None) -> str:
    """One chart per unit; several runs share colours and differ in dashes."""
    chosen = list(next(iter(runs.values()))) if names is None else name_list("names", names, "load.w")
    found = [run.history(name, label) for label, run in runs.items() for name in chosen]
    shown_as = shown_units(found, units)
    groups: dict[str, list[int]] = {}
    for i, own in enumerate(shown_as):
        groups.setdefault(own.text, []).append(i)
    events = [t for t, _ in next(iter(runs.values())).events]
    labels = list(runs)
    charts = []
    for unit, members in groups.items():
        curves = [
            Curve(
                h.name + (f" ({h.run})" if h.run else ""), h.time, h.values * shown_as[i].factor,
                COLOURS[chosen.index(h.name) % len(COLOURS)], DASHES[labels.index(h.run) % len(DASHES)],
            )
            for i in members for h in [found[i]]
        ]  # fmt: skip
        quantity = NAMES.get(spelled(found[members[0]].unit), "value")
        charts.append(chart(curves, "time, s", axis_label(quantity, unit), events=events))
    stats = next(iter(runs.values())).stats
    said = ", ".join(f"{key} {stats[key]}" for key in ("method", "steps", "events") if key in stats)
    return HINT + "".join(charts) + f'<p class="about">{said}</p>'


def _modes(system: Any) -> str:
    try:
        found: Modes = modes(system)
    except GearlibError as why:
        return paragraph(f"Not given: {why}")
    return preformatted(str(found))


def _campbell(found: Campbell) -> str:
    rpm = found.speeds * RPM
    curves = [
        Curve("natural frequencies" if not k else "", rpm, found.frequencies[:, k], "#1b2a41")
        for k in range(found.frequencies.shape[1])
    ]
    curves += [
        Curve(f"{name} (order {order:g})", rpm, order * found.speeds / (2 * np.pi), COLOURS[(k + 1) % len(COLOURS)], "6 4")
        for k, (name, order) in enumerate(found.orders.items())
    ]
    points = [(c.speed * RPM, c.frequency, str(c.mode)) for c in found.crossings]
    top = found.highest
    drawn = chart(curves, "speed of the reference shaft, 1/min", "frequency, Hz", points=points, ylim=(0.0, top), height=420)
    return HINT + drawn + preformatted(str(found))
