"""Draws the pictures of docs/stability.md: `python -m tests.stress.draw`."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt

from tests.pictures import save
from tests.stress.test_long_runs import energy_drift
from tests.stress.test_stiffness import STIFFNESSES, distance_from_rigid, run

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"


def ladder() -> None:
    """How the elastic pair nears the rigid one, and what it costs."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
    climbed = [k for k in STIFFNESSES if k >= 1e4]
    left.loglog(climbed, [distance_from_rigid(k) for k in climbed], "o-")
    left.loglog(climbed, [1e4 / k for k in climbed], "k:", label="first order")
    left.set(xlabel="mesh stiffness, N/m", ylabel="distance from the rigid train, rad/s")
    left.legend()
    for ratio in (0.3, 1.0, 100.0):
        counts = [run(k, ratio, "ida", 1e-6).stats["steps"] for k in STIFFNESSES]
        right.loglog(STIFFNESSES, counts, ".-", label=f"ida, {ratio:g} of critical")
    results = [run(k, 1.0, "auto", 1e-6) for k in STIFFNESSES]
    right.loglog(STIFFNESSES, [r.stats["steps"] for r in results], "k+--", label="auto, 1 of critical")
    for k, result in zip(STIFFNESSES, results, strict=True):
        print(f"{k:.0e}", result.stats["method"], result.stats["steps"], result.stats["why"])
    right.set(xlabel="mesh stiffness, N/m", ylabel="steps for 0.5 s at rtol 1e-6", ylim=(50, 1e5))
    right.legend(fontsize=7)
    for axes in (left, right):
        axes.grid(alpha=0.3)
    save(figure, IMAGES / "stability_stiffness.png")
    plt.close(figure)


def energy() -> None:
    """Energy drift of an undamped train over the tolerance."""
    figure, axes = plt.subplots(figsize=(5, 3.2), layout="constrained")
    tolerances = [10.0**-k for k in range(3, 12)]
    for method in ("rk5", "rk8", "ida"):
        drifts = [energy_drift(method, 1000, rtol) for rtol in tolerances]
        print(method, [f"{d:.1e}" for d in drifts])
        axes.loglog(tolerances, drifts, "o-", ms=3, label=method)
    exact = energy_drift("exact", 1000, 1e-9)
    axes.axhline(exact, color="k", ls=":", label="exact")
    axes.set(xlabel="rtol", ylabel="drift of the energy over 1000 periods")
    axes.grid(alpha=0.3)
    axes.legend()
    save(figure, IMAGES / "stability_energy.png")
    plt.close(figure)


if __name__ == "__main__":
    ladder()
    energy()
