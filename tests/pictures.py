"""Figures for the documentation: few colours, so that the files stay small."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

COLOURS = 40


def save(figure: Any, path: Path, dpi: int = 80) -> None:
    """Write a figure as a PNG with a palette."""
    from PIL import Image  # comes with matplotlib

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    reduce(Image.open(buffer), path)


def reduce(image: Any, path: Path) -> None:
    image.convert("RGB").quantize(COLOURS, dither=0).save(path, optimize=True)
