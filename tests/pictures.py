"""Figures for the documentation: few colours, so that the files stay small; those of the curves are kept exactly."""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

COLOURS = 48
GREYS = tuple((level, level, level) for level in range(0, 256, 15))  # of lines, letters and grids


def save(figure: Any, path: Path, dpi: int = 80) -> None:
    """Write a figure as a PNG with a palette, in which each curve has the colour it was given."""
    from matplotlib.colors import to_rgb
    from PIL import Image  # comes with matplotlib

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    drawn = {to_rgb(line.get_color()) for axes in figure.axes for line in axes.lines}
    reduce(Image.open(buffer), path, [tuple(round(255 * c) for c in colour) for colour in sorted(drawn)])


def reduce(image: Any, path: Path, colours: Iterable[tuple[int, ...]] = ()) -> None:
    """Write an image with a palette of the colours that cover its own best, and of the given ones."""
    from PIL import Image

    whole = image.convert("RGB")
    found = whole.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE).getpalette()[: 3 * COLOURS]
    palette = Image.new("P", (1, 1))
    palette.putpalette(found + [part for colour in (*GREYS, *colours) for part in colour])
    whole.quantize(palette=palette, dither=Image.Dither.NONE).save(path, optimize=True)
