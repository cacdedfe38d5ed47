"""Measures what docs/stability.md tells, draws its pictures and fills its tables: `python -m tests.stress.draw`."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt

from tests.benchmarks.page import LINES
from tests.benchmarks.references import SCENES
from tests.measured import ROOT
from tests.pictures import save
from tests.stress import tables
from tests.stress.tables import STEPPED
from tests.stress.test_error_band import TOLERANCES, ratio
from tests.stress.test_long_runs import energy_drift, first_and_last, growth, largest_change
from tests.stress.test_stiffness import STIFFNESSES, distance_from_rigid, run, slopes


def finish(figure: Any, name: str) -> None:
    for axes in figure.axes:
        axes.grid(alpha=0.3)
    save(figure, ROOT / "docs" / "images" / f"stability_{name}.png")
    plt.close(figure)


def ladder() -> None:
    """How the elastic pair nears the rigid one, and what it costs."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
    climbed = tuple(k for k in STIFFNESSES if k >= 1e4)
    distances = [distance_from_rigid(k) for k in climbed]
    left.loglog(climbed, distances, "o-")
    left.loglog(climbed, [1e4 / k for k in climbed], "k:", label="first order")
    left.set(xlabel="mesh stiffness, N/m", ylabel="distance from the rigid train, rad/s")
    left.legend()
    for damped in (0.3, 1.0, 100.0):
        counts = [run(k, damped, "ida", 1e-6).stats["steps"] for k in STIFFNESSES]
        right.loglog(STIFFNESSES, counts, ".-", label=f"ida, {damped:g} of critical")
    results = [run(k, 1.0, "auto", 1e-6) for k in STIFFNESSES]
    right.loglog(STIFFNESSES, [r.stats["steps"] for r in results], "k+--", label="auto, 1 of critical")
    right.set(xlabel="mesh stiffness, N/m", ylabel="steps for 0.5 s at rtol 1e-6", ylim=(50, 1e5))
    right.legend(fontsize=7)
    finish(figure, "stiffness")

    away = dict(zip(climbed, distances, strict=True))
    order = dict(zip(climbed[1:], slopes(climbed, distances), strict=True))
    rows = []
    for k, result in zip(STIFFNESSES, results, strict=True):
        steps = {
            "ida": run(k, 1.0, "ida", 1e-6).stats["steps"],
            "auto": result.stats["steps"],
            "method": result.stats["method"],
        }
        rows.append({"k": k, "distance": away.get(k), "order": order.get(k) if k <= 1e10 else None, **steps})
    tables.STIFFNESS.store(rows)


def long_runs() -> None:
    """Changes between the first settled second and the last one, and memory."""
    changes = []
    for method, revolutions, rtol in (("exact", 1e6, 1e-10), ("rk8", 100, 1e-10), ("ida", 1000, 1e-6)):
        change = largest_change(*first_and_last(method, revolutions, rtol))
        changes.append({"method": method, "revolutions": revolutions, "rtol": rtol, "change": change})
    tables.REVOLUTIONS.store(changes)
    counts = (("exact", 300_000), ("rk8", 300_000), ("ida", 10_000))
    tables.MEMORY.store([{"method": m, "periods": n, "megabytes": growth(m, n)[0]} for m, n in counts])


def energy() -> None:
    """Energy drift of an undamped train over the tolerance."""
    figure, axes = plt.subplots(figsize=(5, 3.2), layout="constrained")
    tolerances = [10.0**-k for k in range(3, 12)]
    rows: list[dict[str, Any]] = []
    for method in ("rk5", "rk8", "ida"):
        drifts = [energy_drift(method, 1000, rtol) for rtol in tolerances]
        axes.loglog(tolerances, drifts, "o-", ms=3, label=method, color=LINES[f"gearlib {method}"]["color"])
        kept = [(d, rtol) for d, rtol in zip(drifts, tolerances, strict=True) if rtol < 2e-5]  # above, all is lost
        shares = [d / 1000 / rtol for d, rtol in kept]
        fine = 1e-8 if method == "ida" else 1e-9
        long = energy_drift(method, 100_000, fine) / 1e5 / fine
        rows.append({"method": method, "short": [min(shares), max(shares)], "long": long, "rtol": fine})
    exact = energy_drift("exact", 1000, 1e-9)
    axes.axhline(exact, color=LINES["gearlib exact"]["color"], ls=":", label="exact")
    axes.set(xlabel="rtol", ylabel="drift of the energy over 1000 periods")
    axes.legend()
    finish(figure, "energy")
    rows.append({"method": "exact", "short": exact, "long": energy_drift("exact", 100_000, 1e-9)})
    tables.ENERGY.store(rows)


def band() -> None:
    """Error over tolerance of every scene and method."""
    figure, panels = plt.subplots(1, 3, figsize=(9.5, 3.2), layout="constrained", sharey=True)
    rows: dict[str, dict[str, Any]] = {name: {"scene": name} for name in SCENES}
    for axes, method in zip(panels, STEPPED, strict=True):
        for name, mark in zip(SCENES, "osv^DX*", strict=True):
            found = [ratio(name, method, rtol) for rtol in TOLERANCES]
            axes.loglog(TOLERANCES, found, f"{mark}-", ms=4, lw=1, label=name)
            rows[name][method] = [min(found), max(found)]
        axes.axhspan(0.01, 100.0, color="0.92", zorder=0)
        axes.set(xlabel="rtol", title=method)
    panels[0].set(ylabel="error / rtol")
    panels[-1].legend(fontsize=6)
    finish(figure, "error")
    for name, scene in SCENES.items():
        rows[name]["exact"] = max(ratio(name, "exact", rtol) * rtol for rtol in TOLERANCES) if scene.linear else None
    tables.ERROR.store(list(rows.values()))


if __name__ == "__main__":
    ladder()
    long_runs()
    energy()
    band()
