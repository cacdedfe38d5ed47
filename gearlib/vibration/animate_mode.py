"""Animation of a mode shape."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearlib.arguments import real, shown, whole
from gearlib.errors import ArgumentError
from gearlib.optional import optional
from gearlib.vibration.draw_mode import MOTION, ModePicture, aligned, largest

COLUMNS = 6  # of discs, side by side
BODY, SLIDER = "#cfd8e3", "#66a61e"


def animate_mode(mode: ModePicture, frames: int = 48, degrees: float = 40.0) -> Any:
    """A matplotlib animation over one period; the body with the largest swing turns by ``degrees`` (a slider: half its cell).

    Discs rotate, squares slide. The amplitude is constant over the period, even for damped modes.
    """
    plt = optional("matplotlib.pyplot")
    FuncAnimation = optional("matplotlib.animation").FuncAnimation
    patches = optional("matplotlib.patches")

    frames = whole("frames", frames, 2)
    if not 0 < real("degrees", degrees, "a number above 0, up to 180") <= 180:
        raise ArgumentError(f"degrees is {shown(degrees)}; expected a number above 0, up to 180")
    bodies, left_out = largest(aligned(mode.motions), lambda m: abs(m[2]))
    columns = min(COLUMNS, max(1, len(bodies)))
    rows = max(1, -(-len(bodies) // COLUMNS))
    figure, ax = plt.subplots(figsize=(1.9 * columns + 0.4, 1.9 * rows + 0.9), layout="constrained")
    ax.set(xlim=(-0.1, 3 * columns + 0.1), ylim=(-3 * rows, 0.6), aspect="equal")
    ax.axis("off")
    note = f"; {left_out} bodies at rest not shown" if left_out else ""
    ax.set_title(f"{mode.title}{note}")
    moving: list[tuple[Any, str, float, float, complex]] = []
    for k, (name, unit, amplitude) in enumerate(bodies):
        x, y = 3 * (k % columns) + 1.5, -3 * (k // columns) - 1.1
        ax.text(x, y - 1.3, _short(name), ha="center", va="top", fontsize=7)
        if unit == "rad":
            ax.add_patch(patches.Circle((x, y), 1.0, facecolor=BODY, edgecolor=MOTION))
            ax.plot([x, x], [y + 1.0, y + 1.25], color="0.7", lw=1)  # rest position of the spoke
            mark: Any = ax.plot([x, x], [y, y + 1.0], color="black", lw=2.5, solid_capstyle="round")[0]
        else:
            ax.plot([x - 1.2, x + 1.2], [y - 0.5, y - 0.5], color="0.7", lw=1)
            mark = ax.add_patch(patches.Rectangle((x - 0.4, y - 0.45), 0.8, 0.8, facecolor=SLIDER, edgecolor=MOTION))
        moving.append((mark, unit, x, y, amplitude))

    def update(frame: int) -> list[Any]:
        turn = np.exp(2j * np.pi * frame / frames)
        for mark, unit, x, y, amplitude in moving:
            value = float((amplitude * turn).real)
            if unit == "rad":
                angle = np.deg2rad(degrees) * value
                mark.set_data([x, x - np.sin(angle)], [y, y + np.cos(angle)])
            else:
                mark.set_x(x - 0.4 + 0.7 * value)
        return [m[0] for m in moving]

    return FuncAnimation(figure, update, frames=frames, interval=40)


def _short(name: str) -> str:
    """A path split into lines of moderate length."""
    parts, lines = name.split("."), [""]
    for part in parts:
        joined = f"{lines[-1]}.{part}" if lines[-1] else part
        lines = [*lines[:-1], joined] if len(joined) <= 16 else [*lines, part]
    return "\n".join(line for line in lines if line)
