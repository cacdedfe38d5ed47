"""Drawing of a mode: amplitudes of the bodies and energy distribution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearlib.arguments import check_axes
from gearlib.optional import optional

MOST_BARS = 30  # the largest ones are drawn
KINETIC, POTENTIAL, MOTION = "#1f6fb4", "#d95f02", "0.35"
NAMES = {"rad": "turning", "m": "displacement"}


@dataclass(frozen=True)
class ModePicture:
    """Data for drawing a mode.

    Attributes
    ----------
    number : int
    frequency, damping : float
        Frequency in Hz (0 for a free motion), and damping ratio.
    motions : list of (str, str, complex)
        Body, "rad" or "m", and amplitude.
    shares : list of (str, float, float)
        Component, and its shares of kinetic and potential energy, percent.
    not_given : str or None
        Why there are no shares.
    """

    number: int
    frequency: float
    damping: float
    motions: list[tuple[str, str, complex]]
    shares: list[tuple[str, float, float]]
    not_given: str | None = None

    @property
    def title(self) -> str:
        """Mode, frequency and damping."""
        what = f"{self.frequency:.5g} Hz, damping ratio {self.damping:.3g}" if self.frequency else "free motion"
        return f"Mode {self.number}: {what}"


def draw_mode(mode: ModePicture, axes: Any = None) -> Any:
    """Bars of amplitudes (relative to the largest of their kind) and of energy shares; returns two axes."""
    plt = optional("matplotlib.pyplot")

    motions, left_out = largest(mode.motions, lambda m: abs(m[2]))
    shares, energy_left_out = largest(mode.shares, lambda s: max(s[1], s[2]))
    if axes is None:
        height = 1.6 + 0.2 * max(len(motions), len(shares), 4)
        _, axes = plt.subplots(1, 2, figsize=(10, height), layout="constrained")
    check_axes(axes, 2)
    _motion_bars(axes[0], motions, left_out)
    _energy_bars(axes[1], shares, energy_left_out)
    if mode.not_given:
        axes[1].text(
            0.5,
            0.5,
            f"not given:\n{mode.not_given}",
            transform=axes[1].transAxes,
            ha="center",
            va="center",
            fontsize=8,
            wrap=True,
        )
    axes[0].figure.suptitle(mode.title)
    return axes


def largest(items: list[Any], size: Any) -> tuple[list[Any], int]:
    """The items large enough for a bar, in their order, and the number of items left out."""
    ranked = sorted(range(len(items)), key=lambda i: -size(items[i]))[:MOST_BARS]
    top = max((size(items[i]) for i in ranked), default=0.0)
    kept = sorted(i for i in ranked if size(items[i]) > 1e-6 * top)
    return [items[i] for i in kept], len(items) - len(kept)


def aligned(motions: list[tuple[str, str, complex]]) -> list[tuple[str, str, complex]]:
    """Amplitudes relative to the largest of their kind, rotated to be as real as possible, with the largest one positive.

    >>> [round(m[2].real, 9) for m in aligned([("a", "rad", 1j), ("b", "rad", -2j), ("c", "m", 3j)])]
    [-0.5, 1.0, -1.0]
    """
    units = [u for u in ("rad", "m") if any(m[1] == u for m in motions)]
    if not units:
        return []
    phase = np.sqrt(complex(sum(m[2] ** 2 for m in motions if m[1] == units[0]))) or 1.0
    phase *= np.sign(np.real(max((m[2] / phase for m in motions if m[1] == units[0]), key=abs))) or 1.0
    largest = {u: max(abs(m[2]) for m in motions if m[1] == u) or 1.0 for u in units}
    return [(name, unit, complex(value / phase * abs(phase) / largest[unit])) for name, unit, value in motions]


def _motion_bars(ax: Any, motions: list[tuple[str, str, complex]], left_out: int) -> None:
    units = [u for u in ("rad", "m") if any(m[1] == u for m in motions)]
    place = np.arange(len(motions))[::-1]
    scaled = aligned(motions)
    for unit in units:
        largest = max(abs(m[2]) for m in motions if m[1] == unit)
        values = [m[2] if m[1] == unit else np.nan for m in scaled]
        label = f"{NAMES[unit]} (largest {largest / max(abs(m[2]) for m in motions if m[1] == units[0]):.3g} {unit})"
        ax.barh(place, np.real(values), color=MOTION if unit == units[0] else "#66a61e", height=0.7, label=label)
        if np.nanmax(np.abs(np.imag(values))) > 0.02:
            ax.plot(np.imag(values), place, "|", color="black", ms=9, label=f"{NAMES[unit]}, a quarter period later")
    ax.axvline(0, color="black", lw=0.8)
    ax.set_yticks(place, [m[0] for m in motions], fontsize=8)
    ax.set_xlim(-1.1, 1.1)
    ax.set_xlabel("amplitude over the largest" + (f" ({left_out} at rest not shown)" if left_out else ""))
    ax.set_title("Motion")
    _legend_below(ax)
    ax.grid(axis="x", alpha=0.3)


def _energy_bars(ax: Any, shares: list[tuple[str, float, float]], left_out: int) -> None:
    place = np.arange(len(shares))[::-1]
    ax.barh(place, [s[1] for s in shares], color=KINETIC, height=0.7, label="kinetic")
    ax.barh(place, [-s[2] for s in shares], color=POTENTIAL, height=0.7, label="potential")
    ax.axvline(0, color="black", lw=0.8)
    ax.set_yticks(place, [s[0] for s in shares], fontsize=8)
    ax.set_xlim(-105, 105)
    ax.set_xticks([-100, -50, 0, 50, 100], ["100", "50", "0", "50", "100"])
    ax.set_xlabel("share of energy, %" + (f" ({left_out} components with none not shown)" if left_out else ""))
    ax.set_title("Energy")
    _legend_below(ax)
    ax.grid(axis="x", alpha=0.3)


def _legend_below(ax: Any) -> None:
    """Place the legend below the axis label, at a fixed distance independent of the height of the axes."""
    ScaledTranslation = optional("matplotlib.transforms").ScaledTranslation

    down = ax.transAxes + ScaledTranslation(0, -34 / 72, ax.figure.dpi_scale_trans)
    ax.legend(
        fontsize=8,
        loc="upper center",
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=down,
        borderaxespad=0.0,
        ncols=2,
        frameon=False,
    )
