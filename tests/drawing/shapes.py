"""What an SVG picture shows: every element at its place in the picture, all transforms carried out."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.drawing.svg import text_width

Floats = NDArray[np.float64]
NUMBER = r"-?\d+(?:\.\d+)?"
CLOSE = 0.03  # numbers have two decimals, and several add up


@dataclass(frozen=True, eq=False)
class Shape:
    """An element: corners of a line, a polyline, a polygon or a rectangle; centre and radius of a circle; base point of a text.

    ``title`` is that of the innermost group with one.
    """

    kind: str
    points: Floats
    radius: float
    text: str
    title: str
    attributes: dict[str, str]

    @property
    def closed(self) -> bool:
        return self.kind in ("rect", "polygon", "circle")

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, upper, right and lower edge; of letters about what they cover, from ascenders to descenders."""
        (left, upper), (right, lower) = self.points.min(axis=0), self.points.max(axis=0)
        if self.kind == "text":
            size = self.size
            wide = text_width(self.text, size)
            left -= wide * {"start": 0.0, "middle": 0.5, "end": 1.0}[self.attributes.get("text-anchor", "start")]
            return float(left), float(upper - 0.75 * size), float(left + wide), float(lower + 0.2 * size)
        return float(left - self.radius), float(upper - self.radius), float(right + self.radius), float(lower + self.radius)

    @property
    def size(self) -> float:
        return float(self.attributes.get("font-size", 11.0))

    @property
    def middle(self) -> Floats:
        left, upper, right, lower = self.box
        return np.array([(left + right) / 2, (upper + lower) / 2])

    def distance(self, point: Floats) -> float:
        """Of a point from the outline."""
        if self.kind == "circle":
            return abs(float(np.hypot(*(point - self.points[0]))) - self.radius)
        corners = np.vstack([self.points, self.points[:1]]) if self.closed else self.points
        found = []
        for a, b in zip(corners[:-1], corners[1:], strict=True):
            along = b - a
            share = float(np.clip((point - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0))
            found.append(float(np.hypot(*(a + share * along - point))))
        return min(found, default=float(np.hypot(*(self.points[0] - point))))


def shapes(svg: str) -> list[Shape]:
    """All that an SVG text draws, in order; an icon's elements without a document will do."""
    root = ET.fromstring(svg if svg.startswith(("<svg", "<g")) else f"<g>{svg}</g>")
    return list(_inside(root, np.eye(3), ""))


def _inside(element: ET.Element, place: Floats, title: str) -> Iterator[Shape]:
    place = place @ _transform(element.get("transform", ""))
    own = next((child.text or "" for child in element if child.tag.endswith("title")), None)
    title = title if own is None or element.tag.endswith("svg") else own
    tag, a = element.tag.split("}")[-1], dict(element.attrib)

    def at(*numbers: float) -> Floats:
        points = np.array(numbers, float).reshape(-1, 2)
        return points @ place[:2, :2].T + place[:2, 2]

    def value(name: str) -> float:
        return float(a.get(name, 0.0))

    if tag == "line":
        yield Shape(tag, at(value("x1"), value("y1"), value("x2"), value("y2")), 0.0, "", title, a)
    elif tag == "rect":
        x, y, w, h = (value(name) for name in ("x", "y", "width", "height"))
        yield Shape(tag, at(x, y, x + w, y, x + w, y + h, x, y + h), 0.0, "", title, a)
    elif tag == "circle":
        yield Shape(tag, at(value("cx"), value("cy")), value("r"), "", title, a)
    elif tag == "text":
        yield Shape(tag, at(value("x"), value("y")), 0.0, element.text or "", title, a)
    elif tag in ("path", "polygon"):
        corners = re.sub(rf"A(?:{NUMBER} ){{5}}", "", a["d"]) if tag == "path" else a["points"]  # of an arc its end
        numbers = [float(n) for n in re.findall(NUMBER, corners)]
        yield Shape(tag, at(*numbers), 0.0, "", title, a)
    for child in element:
        yield from _inside(child, place, title)


def _transform(text: str) -> Floats:
    """Matrix of a transform."""
    result = np.eye(3)
    for kind, given in re.findall(r"(\w+)\(([^)]*)\)", text):
        v = [float(n) for n in re.findall(NUMBER, given)]
        step = np.eye(3)
        if kind == "translate":
            step[:2, 2] = v[0], v[1] if len(v) > 1 else 0.0
        elif kind == "scale":
            step[0, 0], step[1, 1] = v[0], v[-1]
        else:
            assert kind == "rotate", text
            c, s = np.cos(np.deg2rad(v[0])), np.sin(np.deg2rad(v[0]))
            about = np.array(v[1:3] if len(v) > 1 else [0.0, 0.0])
            step[:2, :2] = [[c, -s], [s, c]]
            step[:2, 2] = about - step[:2, :2] @ about
        result = result @ step
    return result


def same(some: list[Shape], others: list[Shape]) -> bool:
    """Whether two lists show the same, in whatever order and direction."""

    def key(shape: Shape) -> tuple[object, ...]:
        points = [(round(float(x), 1) + 0.0, round(float(y), 1) + 0.0) for x, y in shape.points]
        return shape.kind, round(shape.radius, 1), shape.text, tuple(sorted(points)), shape.attributes.get("fill", "")

    return sorted(map(key, some)) == sorted(map(key, others))
