"""Self-contained HTML pages: sections, tables, pictures, and zoomable charts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from gearlib.drawing.svg import escaped

Floats = NDArray[np.float64]
MOST_POINTS = 4000  # points per curve in a chart; beyond that only the extremes of each piece are kept


@dataclass(frozen=True)
class Section:
    """A section of a page: its heading, and HTML."""

    title: str
    html: str


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of a chart; unnamed curves are not in the legend."""

    name: str
    x: Floats
    y: Floats
    colour: str
    dash: str = ""


def preformatted(text: str) -> str:
    return f"<pre>{escaped(text)}</pre>"


def paragraph(text: str) -> str:
    return f"<p>{escaped(text)}</p>"


def table(head: Sequence[str], rows: Sequence[Sequence[str | float]]) -> str:
    """An HTML table; numbers have six digits and are right-aligned.

    >>> table(["a"], [[1.5]])
    '<table><thead><tr><th>a</th></tr></thead><tbody><tr><td class="number">1.5</td></tr></tbody></table>'
    """
    top = "".join(f"<th>{escaped(name)}</th>" for name in head)
    body = "".join("<tr>" + "".join(map(_cell, row)) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: str | float) -> str:
    return f"<td>{escaped(value)}</td>" if isinstance(value, str) else f'<td class="number">{value:.6g}</td>'


def picture(svg: str) -> str:
    return f'<div class="picture">{svg}</div>'


def thinned(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Downsample a curve without visible change: for every piece the ends and the extreme values are kept.

    >>> x = np.linspace(0, 1, 100_001)
    >>> a, b = thinned(x, np.where(x == 0.5, 7.0, 0.0))
    >>> len(a) <= MOST_POINTS, float(b.max())
    (True, 7.0)
    """
    if len(x) <= MOST_POINTS:
        return x, y
    known = np.where(np.isfinite(y), y, 0.0)
    kept = {0, len(x) - 1}
    for piece in np.array_split(np.arange(len(x)), MOST_POINTS // 2 - 1):
        kept |= {int(piece[known[piece].argmin()]), int(piece[known[piece].argmax()])}
    place = np.array(sorted(kept))
    return x[place], y[place]


def chart(
    curves: Sequence[Curve], x: str, y: str, *, events: Sequence[float] = (), points: Sequence[tuple[float, float, str]] = (),
    ylim: tuple[float, float] | None = None, height: int = 260,
) -> str:  # fmt: skip
    """A chart drawn by the page's script.

    Parameters
    ----------
    curves : sequence of Curve
    Axis labels.
        Labels of the axes.
    events : sequence of float
        Marked at the upper edge.
    points : sequence of (x, y, text)
    ylim : pair of float, optional
    height : int
        In pixels.
    """
    spec = {
        "x": x, "y": y, "height": height, "events": _numbers(np.asarray(events, float)),
        "points": [{"x": px, "y": py, "text": text} for px, py, text in points],
        "curves": [
            {"name": c.name, "x": _numbers(a), "y": _numbers(b), "colour": c.colour, "dash": c.dash}
            for c in curves for a, b in [thinned(c.x, c.y)]
        ],
        "ylim": ylim,
    }  # fmt: skip
    data = json.dumps(spec, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'<div class="chart"><div class="legend"></div><script type="application/json">{data}</script></div>'


def _numbers(values: Floats) -> list[float | None]:
    """Numbers of seven digits; non-finite values become gaps."""
    return [float(f"{v:.7g}") if np.isfinite(v) else None for v in values.tolist()]


def page(title: str, about: str, sections: Sequence[Section]) -> str:
    """The complete page, including style, script and pictures; nothing is loaded from elsewhere."""
    here = files("gearlib.drawing")
    style, script = (here.joinpath(name).read_text(encoding="utf-8") for name in ("page.css", "chart.js"))
    links = "".join(f'<a href="#s{k}">{escaped(s.title)}</a>' for k, s in enumerate(sections))
    body = "\n".join(f'<section><h2 id="s{k}">{escaped(s.title)}</h2>\n{s.html}</section>' for k, s in enumerate(sections))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escaped(title)}</title>\n'
        '<link rel="icon" href="data:,">\n'
        f"<style>\n{style}</style></head>\n<body><h1>{escaped(title)}</h1>\n"
        f'<p class="about">{escaped(about)}</p>\n<nav>{links}</nav>\n{body}\n<script>\n{script}</script></body></html>\n'
    )
