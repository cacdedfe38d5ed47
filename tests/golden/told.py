"""What a picture shows, as lines of text that can be compared and read: elements of SVG, artists of matplotlib.

Each number is rounded to what can be seen, so that a line changes where a reader would see it; of long curves some points are told.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.ticker import FixedLocator

POINTS = 7  # of a long curve
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.(\d+))?(?:e([-+]\d+))?")


def differences(found: str, recorded: str) -> list[str]:
    """Lines that differ by more than a unit in the last place of a number, as "recorded -> found"."""
    one, other = found.splitlines(), recorded.splitlines()
    apart = [f"{b} -> {a}" for a, b in zip(one, other, strict=False) if a != b and not _close(a, b)]
    return apart + [f"-> {line}" for line in one[len(other) :]] + [f"{line} ->" for line in other[len(one) :]]


def _close(a: str, b: str) -> bool:
    if NUMBER.sub("#", a) != NUMBER.sub("#", b):
        return False
    pairs = zip(NUMBER.finditer(a), NUMBER.finditer(b), strict=True)
    return all(abs(float(x[0]) - float(y[0])) <= 1.01 * max(_unit(x), _unit(y)) for x, y in pairs if x[0] != y[0])


def _unit(number: re.Match[str]) -> float:
    """One in the last place; whole numbers are exact, unless they have an exponent."""
    decimals, exponent = len(number[1] or ""), int(number[2] or 0)
    return float(10.0 ** (exponent - decimals)) if decimals or number[2] else 0.0


def svg(text: str) -> str:
    """The elements of an SVG document, or a page of XHTML, in their order, a line each."""
    return "\n".join(_elements(ET.fromstring(text), ""))


def _elements(element: ET.Element, indent: str) -> Iterator[str]:
    values = " ".join(f"{key}={_shortened(value)}" for key, value in sorted(element.attrib.items()))
    tag = element.tag.split("}")[-1]
    yield f"{indent}{tag} {values} {(element.text or '').strip()}".rstrip()
    for child in element:
        yield from _elements(child, indent + " ")


def _shortened(value: str) -> str:
    parts = re.split(r"[ ;](?=[^ ;]+)", value)
    if len(parts) <= 3 * POINTS:
        return value
    return f"{len(parts)} of " + " ".join(parts[k] for k in np.linspace(0, len(parts) - 1, POINTS).astype(int))


def figure(shown: Any) -> str:
    """All axes of a figure, given by itself or by one of its axes, and what they show."""
    shown = getattr(np.ravel(shown)[0], "figure", shown)
    width, height = shown.get_size_inches()
    lines = [f"figure {width:.2f} x {height:.2f} {shown.get_suptitle()!r}", *map(_legend, shown.legends)]
    return "\n".join([*lines, *(line for axes in shown.axes for line in _axes(axes))])


def _axes(axes: Any) -> Iterator[str]:
    yield f"axes {axes.get_title()!r} {axes.get_xlabel()!r} {axes.get_ylabel()!r} aspect {axes.get_aspect()}"
    for name, axis, limits in (("x", axes.xaxis, axes.get_xlim()), ("y", axes.yaxis, axes.get_ylim())):
        fixed = isinstance(axis.get_major_locator(), FixedLocator)
        marks = ["ticks", _numbers(axis.get_ticklocs()), *(t.get_text() for t in axis.get_ticklabels())] if fixed else []
        yield " ".join([f" {name} {axis.get_scale()}", _numbers(limits, scale=axis.get_scale()), *marks])
    for line in axes.lines:
        x, y = (np.ravel(np.asarray(data, float)) for data in line.get_data())
        kept = np.unique(np.linspace(0, len(x) - 1, POINTS).astype(int)) if len(x) else np.zeros(0, int)
        mark = f"{line.get_marker()!r} {line.get_markersize():.2f}"
        style = f"{to_hex(line.get_color())} {line.get_linestyle()!r} {line.get_linewidth():.2f} {mark}"
        points = (
            f"{_numbers(x[kept], axes.get_xlim(), axes.get_xscale())} | {_numbers(y[kept], axes.get_ylim(), axes.get_yscale())}"
        )
        yield f" line {line.get_label()!r} {style} {line.get_zorder():.2f} {len(x)}: {points}"
    for patch in axes.patches:
        box = patch.get_path().get_extents(patch.get_patch_transform())
        yield f" patch {type(patch).__name__} {patch.get_label()!r} {to_hex(patch.get_facecolor())} {_numbers(box.get_points().ravel())}"
    for many in axes.collections:
        places = np.ma.filled(np.ma.asarray(many.get_offsets(), float), np.nan)
        spread = [np.nanmin(places), np.nanmax(places)] if np.isfinite(places).any() else []
        colours = " ".join(sorted({to_hex(c) for c in many.get_facecolor()}))[:60]
        heights = None if many.get_array() is None else np.ma.compressed(many.get_array())
        shade = "" if heights is None else _numbers([*np.percentile(heights, [5, 50, 95, 99]), *many.get_clim()])
        yield f" {type(many).__name__} {many.get_label()!r} {len(many.get_paths())} {colours} {_numbers(spread)} {shade}"
    for image in axes.images:
        shade = np.percentile(np.ma.compressed(image.get_array()), [5, 50, 95])
        yield f" image {_numbers(image.get_extent())} {_numbers(image.get_clim())} {_numbers(shade)}"
    for text in axes.texts:
        if text.get_text():
            place = getattr(text, "xy", text.get_position())
            how = f"{text.get_ha()} {text.get_va()} {to_hex(text.get_color())} {text.get_fontsize():.1f} {text.get_rotation():.0f}"
            yield f" text {text.get_text()!r} {_numbers(place)} {_numbers(text.get_position())} {how}"
    if axes.get_legend():
        yield _legend(axes.get_legend())


def _legend(legend: Any) -> str:
    return f" legend {[t.get_text() for t in legend.get_texts()]} {legend.get_title().get_text()!r}"


def _numbers(values: Any, limits: Any = None, scale: str = "linear") -> str:
    """Five digits of the largest, or of the axis' limits, so that rounding errors about zero are zeros; if logarithmic, four of each."""
    values = np.asarray(values, float)
    sizes = np.abs(values if limits is None else np.asarray(limits, float))
    largest = sizes[np.isfinite(sizes)].max(initial=0.0)
    if scale == "log":
        return " ".join(f"{v if abs(v) > 1e-9 * largest else 0.0:.3e}" for v in values)
    places = 4 - int(np.floor(np.log10(largest))) if largest > 0.0 else 0
    return " ".join(f"{v:.{max(places, 0)}f}" for v in np.round(values, places) + 0.0)
