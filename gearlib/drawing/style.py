"""Common style of plots: colours distinguishable in print and by colour-blind readers, and legends that do not cover data."""

from __future__ import annotations

from typing import Any

from gearlib.arguments import check_axes
from gearlib.optional import optional

COLOURS = ("#0b5394", "#d1495b", "#2e8b57", "#e08e0b", "#6a3d9a", "#00838f", "#8d5524", "#c2185b")
"""Of curves, in turn; blue, red, green, orange, violet, teal, brown, pink."""
MARK = "#b22222"


def figure(axes: Any, count: int = 1, size: tuple[float, float] = (8.0, 4.0), **subplots: Any) -> Any:
    """The given axes, validated, or new ones stacked vertically.

    Returns
    -------
    matplotlib Axes, or array of them if ``count`` is more than one.
    """
    plt = optional("matplotlib.pyplot")
    if axes is None:
        _, axes = plt.subplots(count, 1, figsize=size, layout="constrained", **subplots)
    check_axes(axes, count)
    return axes


def legend(axes: Any, **how: Any) -> None:
    """Add a legend that covers no data: inside if there is room, otherwise to the right of the axes."""
    if not axes.get_legend_handles_labels()[0]:
        return
    made = axes.legend(fontsize=8, loc="best", **how)
    axes.figure.draw_without_rendering()
    box = made.get_window_extent().padded(2)
    lines = [line for line in axes.lines if line.get_transform() == axes.transData]
    covered = any(line.get_transform().transform_path(line.get_path()).intersects_bbox(box, filled=False) for line in lines)
    covered = covered or any(patch.get_window_extent().overlaps(box) for patch in axes.patches)
    if covered:
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, frameon=False, **how)
