"""The bond graphs of Zhou and Cui (2022): P unit (Fig. 1), X unit (Fig. 2) and XP single-loop train (Fig. 3); see `zhou_cui_2022`.

The numbers of the storage elements, resistances and sources are the paper's, as used in equations (2)-(9). The figures are not
reprinted here, and the numbers of the other bonds are chosen so that all run from 1 to 85. The 0-junction of bonds 67 and 68, at the
end of the shaft, is the place for a shaft compliance. The modulus m7 occurs in no equation, and in no graph.

All rotations are angular velocities and torques, the meshes are deflection rates and forces along the line of action.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from typing import Any

from gearlib.bondgraph.causality import Causality, assign_causality
from gearlib.bondgraph.draw import draw
from gearlib.bondgraph.elements import TF, C, Element, I, One, R, Se, Sf, Zero, symbol
from gearlib.bondgraph.graph import BondGraph
from gearlib.optional import optional

__all__ = ["PREFERENCE", "Figure", "fixed_axis_unit", "planetary_unit", "single_loop_train"]

PREFERENCE = (2, 6, 11, 26, 30, 35, 74, 78)
"""Bonds whose p and q the paper takes as states."""

Ends = tuple[int, Element, Element]
Point = tuple[float, float]


@dataclass(frozen=True)
class Figure:
    """A bond graph, with the positions of its elements and the routes of its bonds in the drawing."""

    graph: BondGraph
    positions: Mapping[Element, Point]
    routes: Mapping[int, tuple[Point, ...]]

    def draw(self, causality: Causality | None = None, ax: Any = None, scale: float = 0.5) -> Any:
        """The drawing made by :func:`gearlib.bondgraph.draw`."""
        return draw(self.graph, self.positions, routes=self.routes, causality=causality, ax=ax, scale=scale)

    def _repr_svg_(self) -> str:
        """The drawing with the causality that the paper's preference gives, for notebooks and pages."""
        plt = optional("matplotlib.pyplot")
        storage = self.graph.of_kind(I, C)
        figure = self.draw(assign_causality(self.graph, [bond for bond in (*PREFERENCE, 81) if bond in storage])).figure
        text = StringIO()
        figure.savefig(text, format="svg")
        plt.close(figure)
        return text.getvalue()


class _Sketch:
    """Bonds and positions of a figure under construction."""

    def __init__(self) -> None:
        self.bonds: list[Ends] = []
        self.positions: dict[Element, Point] = {}
        self.routes: dict[int, tuple[Point, ...]] = {}

    def put(self, element: Element, x: float, y: float) -> Any:
        self.positions[element] = (x, y)
        return element

    def one(self, name: str, x: float, y: float) -> One:
        return self.put(One(name), x, y)  # type: ignore[no-any-return]

    def zero(self, name: str, x: float, y: float) -> Zero:
        return self.put(Zero(name), x, y)  # type: ignore[no-any-return]

    def port(self, number: int, junction: Element, element: Element, dx: float, dy: float) -> None:
        """A one-port beside a junction; sources point to it, all others away from it."""
        x, y = self.positions[junction]
        self.put(element, x + dx, y + dy)
        source = isinstance(element, Se | Sf)
        self.bonds.append((number, element, junction) if source else (number, junction, element))

    def transformer(self, first: int, second: int, tail: Element, head: Element, modulus: Any) -> None:
        """tail -> TF -> head; the flow at the head is ``modulus`` times the one at the tail."""
        (x1, y1), (x2, y2) = self.positions[tail], self.positions[head]
        element = self.put(TF(modulus), (x1 + x2) / 2, (y1 + y2) / 2)
        self.bonds += [(first, tail, element), (second, element, head)]

    def figure(self, name: str) -> Figure:
        return Figure(BondGraph(*self.bonds, name=name), self.positions, self.routes)


def _m(index: int) -> Any:
    return symbol(f"m_{index}")


def _mesh(sketch: _Sketch, sum_of: Zero, source: int, bond: int, spring: int, damper: int, up: float) -> None:
    """Mesh compliance and damping on the 0-junction that sums the deflection rates, and the rate of the transmission error."""
    x, y = sketch.positions[sum_of]
    deflection = sketch.one(f"deflection {spring}", x, y + up)
    sketch.bonds.append((bond, sum_of, deflection))
    sketch.port(spring, deflection, C(), -up, up)
    sketch.port(damper, deflection, R(), up, up)
    sketch.port(source, sum_of, Sf(), 0, -up)


def _planet(sketch: _Sketch, y: float, bonds: tuple[int, ...], moduli: tuple[int, ...], ends: tuple[One, One, One]) -> None:
    """One planet: spin and orbit, connected to the ring side, the sun side and the carrier.

    ``bonds`` are those to the ring side, the sun side and the carrier, the damper's, and the first of ten consecutive ones that make up
    the planet.
    """
    to_ring, to_sun, link, damper, first = bonds
    spins, seen, carried, turns = (_m(index) for index in moduli)
    ring_side, sun_side, carrier = ends
    number = 86 - damper  # the paper's dampers of planets 1 to 3 are R85, R84 and R83
    at_ring, at_sun = sketch.zero(f"slip {number}", 6.4, y), sketch.zero(f"support {number}", 13.6, y)
    turning, moving = sketch.one(f"planet {number} spin", 10, y + 1.2), sketch.one(f"planet {number} orbit", 10, y - 1.2)
    sketch.bonds += [(to_ring, at_ring, ring_side), (to_sun, at_sun, sun_side), (link, carrier, moving)]
    sketch.transformer(first, first + 1, at_ring, turning, spins)
    sketch.transformer(first + 3, first + 4, turning, at_sun, seen)
    sketch.transformer(first + 5, first + 6, moving, at_sun, carried)
    sketch.transformer(first + 8, first + 9, moving, at_ring, turns)
    sketch.port(first + 2, turning, I(), 0, 1)
    sketch.port(first + 7, moving, I(), 0, 1)
    sketch.port(damper, at_sun, R(), -0.4, -1.2)


def _planetary(sketch: _Sketch) -> tuple[One, One]:
    """The X unit; returns the junctions of sun and carrier."""
    ring, ring_mesh = sketch.one("ring", -1.3, 0), sketch.zero("ring mesh", 1.5, 0)
    sun, sun_mesh = sketch.one("sun", 21.3, 0), sketch.zero("sun mesh", 18.5, 0)
    ring_side, sun_side = sketch.one("planets, ring", 4.4, 0), sketch.one("planets, sun", 15.6, 0)
    carrier = sketch.one("carrier", 10, -9.2)
    sketch.port(1, ring, Se(), -1.5, 0)
    sketch.port(2, ring, I(), 0, -1.2)
    sketch.transformer(3, 4, ring, ring_mesh, 1 / _m(1))
    _mesh(sketch, ring_mesh, 8, 5, 6, 7, 1.3)
    sketch.transformer(9, 10, ring_mesh, ring_side, 1 / _m(2))
    sketch.port(11, ring_side, I(), -0.6, -1.3)
    ends = (ring_side, sun_side, carrier)
    _planet(sketch, 4.8, (12, 36, 25, 85, 15), (5, 6, 8, 9), ends)
    _planet(sketch, 0, (13, 37, 65, 84, 39), (10, 11, 12, 13), ends)
    _planet(sketch, -4.8, (14, 38, 59, 83, 49), (14, 15, 16, 17), ends)
    sketch.routes |= {25: ((10.9, -8.4), (10.55, -7.9), (10.55, 2.9)), 65: ((9.1, -8.4), (9.45, -7.9), (9.45, -1.9))}
    sketch.port(26, sun, I(), 0, 1.2)
    sketch.transformer(27, 28, sun, sun_mesh, 1 / _m(3))
    _mesh(sketch, sun_mesh, 32, 29, 30, 31, 1.3)
    sketch.transformer(33, 34, sun_mesh, sun_side, 1 / _m(4))
    sketch.port(35, sun_side, I(), 0.6, -1.3)
    sketch.port(81, carrier, I(), 0, -1.2)
    sketch.port(82, carrier, R(), -1.5, 0)
    return sun, carrier


def _fixed_axis(sketch: _Sketch, x: float, y: float) -> tuple[One, One]:
    """The P unit; returns the junctions of gear 1 and gear 2."""
    gear_1, mesh, gear_2 = sketch.one("gear 1", x, y), sketch.zero("P mesh", x - 3, y), sketch.one("gear 2", x - 6, y)
    sketch.port(69, gear_1, I(), 0, -1.2)
    sketch.transformer(71, 70, mesh, gear_1, 1 / _m(20))
    _mesh(sketch, mesh, 72, 73, 74, 75, -1.3)
    sketch.transformer(76, 77, mesh, gear_2, 1 / _m(21))
    sketch.port(78, gear_2, I(), 0, -1.2)
    return gear_1, gear_2


def fixed_axis_unit() -> Figure:
    """The P unit (Fig. 1), a gear pair on fixed axes, with the numbers of Fig. 3 and torques on bonds 68 and 79.

    >>> from gearlib.bondgraph import assign_causality
    >>> assign_causality(fixed_axis_unit().graph).integral
    (69, 74, 78)
    """
    sketch = _Sketch()
    gear_1, gear_2 = _fixed_axis(sketch, 0, 0)
    sketch.port(68, gear_1, Se(), 1.5, 0)
    sketch.port(79, gear_2, Se(), -1.5, 0)
    return sketch.figure("P unit")


def planetary_unit() -> Figure:
    """The X unit (Fig. 2), a planetary differential, with the numbers of Fig. 3 and torques on bonds 1, 60 and 80.

    >>> from gearlib.bondgraph import assign_causality
    >>> assign_causality(planetary_unit().graph, prefer=[81]).integral
    (2, 6, 11, 26, 30, 35, 81)
    """
    sketch = _Sketch()
    sun, carrier = _planetary(sketch)
    sketch.port(60, sun, Se(), 1.5, 0)
    sketch.port(80, carrier, Se(), 1.5, 0)
    return sketch.figure("X unit")


def single_loop_train() -> Figure:
    """The XP single-loop train (Fig. 3).

    >>> from gearlib.bondgraph import assign_causality
    >>> causality = assign_causality(single_loop_train().graph, prefer=PREFERENCE)
    >>> causality.integral
    (2, 6, 11, 26, 30, 35, 74, 78)
    >>> causality.derivative
    (17, 22, 41, 46, 51, 56, 62, 66, 69, 81)
    """
    sketch = _Sketch()
    sun, carrier = _planetary(sketch)
    gear_1, gear_2 = _fixed_axis(sketch, 21.3, -9.2)
    shaft, end = sketch.one("shaft", 21.3, -2.8), sketch.one("shaft end", 21.3, -5.6)
    rigid = sketch.zero("rigid shaft", 21.3, -7.3)
    sketch.transformer(60, 61, sun, shaft, _m(18))
    sketch.port(62, shaft, I(), -1.2, 0)
    sketch.transformer(63, 64, shaft, end, _m(19))
    sketch.port(66, end, I(), -1.2, 0)
    sketch.bonds += [(67, end, rigid), (68, rigid, gear_1)]
    sketch.transformer(79, 80, gear_2, carrier, -1 / _m(22))
    return sketch.figure("XP single-loop train")
