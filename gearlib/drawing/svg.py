"""SVG text generation: escaped elements, with numbers to two decimals."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from gearlib.arguments import as_path, shown
from gearlib.errors import ArgumentError, FileError

FONT = "Helvetica, Arial, 'DejaVu Sans', sans-serif"
SPECIAL = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"}


def escaped(text: str) -> str:
    """Escape text for an element or attribute; characters that XML 1.0 does not allow are dropped.

    >>> escaped('a < "b"')
    'a &lt; &quot;b&quot;'
    """
    return "".join(
        SPECIAL.get(c, c) for c in text if c in "\t\n" or 0x20 <= ord(c) < 0xD800 or (c >= "\ue000" and c not in "\ufffe\uffff")
    )


def number(value: float) -> str:
    """A coordinate with at most two decimals.

    >>> number(12.5), number(-0.001), number(3)
    ('12.5', '0', '3')
    """
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def element(tag: str, content: str | None = None, /, **attributes: float | str | None) -> str:
    """An element; underscores in attribute names become hyphens, and a trailing one is dropped.

    >>> element("line", x1=0, x2=2.5, stroke_width=1)
    '<line x1="0" x2="2.5" stroke-width="1"/>'
    >>> element("text", "a", class_="b")
    '<text class="b">a</text>'
    """
    parts = [tag]
    for name, value in attributes.items():
        if value is not None:
            text = value if isinstance(value, str) else number(value)
            parts.append(f'{name.rstrip("_").replace("_", "-")}="{escaped(text)}"')
    head = " ".join(parts)
    return f"<{head}/>" if content is None else f"<{head}>{content}</{tag}>"


def line(x1: float, y1: float, x2: float, y2: float, **attributes: float | str | None) -> str:
    return element("line", x1=x1, y1=y1, x2=x2, y2=y2, **attributes)


def rectangle(x: float, y: float, width: float, height: float, **attributes: float | str | None) -> str:
    return element("rect", x=x, y=y, width=width, height=height, **attributes)


def circle(x: float, y: float, radius: float, **attributes: float | str | None) -> str:
    return element("circle", cx=x, cy=y, r=radius, **attributes)


def path(points: Iterable[tuple[float, float]], **attributes: float | str | None) -> str:
    """A polyline."""
    return element("path", d="M" + " L".join(f"{number(x)} {number(y)}" for x, y in points), **attributes)


def polygon(points: Iterable[tuple[float, float]], **attributes: float | str | None) -> str:
    return element("polygon", points=" ".join(f"{number(x)},{number(y)}" for x, y in points), **attributes)


def text(x: float, y: float, content: str, **attributes: float | str | None) -> str:
    return element("text", escaped(content), x=x, y=y, **attributes)


def group(content: Iterable[str], title: str | None = None, **attributes: float | str | None) -> str:
    """A group of elements, with an optional tooltip."""
    inside = [] if title is None else [element("title", escaped(title))]
    return element("g", "\n".join([*inside, *content]), **attributes)


def animated(attribute: str, values: Iterable[str], seconds: float, kind: str | None = None, **how: str) -> str:
    """Animation of an attribute of the enclosing element through values at equal intervals, without end.

    ``kind`` is "rotate" or "translate" for a transform.

    >>> animated("opacity", ["0", "1"], 2.0)
    '<animate attributeName="opacity" values="0;1" dur="2.00s" repeatCount="indefinite"/>'
    """
    return element(
        "animate" if kind is None else "animateTransform", attributeName=attribute, type=kind, values=";".join(values),
        dur=f"{seconds:.2f}s", repeatCount="indefinite", **how,
    )  # fmt: skip


def document(width: float, height: float, content: Iterable[str], description: str) -> str:
    """A complete document with a white background."""
    body = "\n".join([element("title", escaped(description)), rectangle(0, 0, width, height, fill="white"), *content])
    return element(
        "svg", f"\n{body}\n", xmlns="http://www.w3.org/2000/svg", width=width, height=height,
        viewBox=f"0 0 {number(width)} {number(height)}", font_family=FONT, font_size="11",
    )  # fmt: skip


def text_width(content: str, size: float = 11.0) -> float:
    """Approximate width of a text; letters of DejaVu Sans, the widest of the fonts used, average 0.62 of the font size."""
    return 0.62 * size * len(content)


class Picture:
    """An SVG picture: displayed in notebooks, and saved as a file; with ``html`` also as an HTML page that animates it."""

    def __init__(self, svg: str, html: str | None = None) -> None:
        self.svg, self.html = svg, html

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the picture to an ``.svg`` file (``.html``: the page that animates it, if there is one), and return its path.

        Raises
        ------
        ArgumentError
            Another suffix: no other format is written.
        FileError
            The file cannot be written.
        """
        target = as_path("path", path, "train.svg")
        suffix = target.suffix.lower()
        text = {".svg": self.svg, ".html": self.html}.get(suffix)
        if text is None:
            others = "" if self.html is None else ", or ....html for a page with a slider"
            raise ArgumentError(
                f"path is {shown(str(path))}; the picture is SVG: name it ....svg{others} (a browser prints it to PDF)"
            )
        try:
            target.write_text(text, encoding="utf-8")
        except OSError as problem:
            raise FileError(f"{target} cannot be written: {problem.strerror or problem}") from None
        return target
