"""Structure diagrams of gear trains (Tables 1-3 of Zhou and Cui, 2022): units, and the nodes that connect their shafts.

A P unit (a gear pair on fixed axes) is a square with two shafts, an X unit (a planetary differential) a circle with three. Shafts meet
at nodes; a shaft with a free end is the train's input I or output O.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearlib.errors import ArgumentError, ConnectionError, NameLookupError, nearest
from gearlib.optional import optional

__all__ = ["StructureDiagram", "Unit", "single_loop", "unit_diagram"]

SHAFTS = {"P": ("alpha", "beta"), "X": ("a", "b", "c")}


@dataclass(frozen=True)
class Unit:
    """A P or X unit.

    Parameters
    ----------
    kind : str
        ``"P"`` or ``"X"``.
    name : str
        Label in the drawing.
    position : tuple of float
        Position in the drawing.
    """

    kind: str
    name: str
    position: tuple[float, float]

    def __post_init__(self) -> None:
        if self.kind not in SHAFTS:
            raise ArgumentError(f"unit '{self.name}': its kind is 'P' or 'X', not '{self.kind}'")

    @property
    def shafts(self) -> tuple[str, ...]:
        """Names of its shafts."""
        return SHAFTS[self.kind]


@dataclass(frozen=True)
class StructureDiagram:
    """Units, and the nodes at which their shafts meet.

    Parameters
    ----------
    name : str
        Title of the drawing.
    units : tuple of Unit
        The units.
    nodes : mapping
        Maps node names to positions.
    shafts : mapping
        Maps (unit name, shaft) to the name of the node at which that shaft ends.
    terminals : mapping
        Maps inputs and outputs to the nodes that they are led out of, where that node joins several shafts.

    Examples
    --------
    >>> single_loop("XP").degrees_of_freedom
    1
    """

    name: str
    units: tuple[Unit, ...]
    nodes: Mapping[str, tuple[float, float]]
    shafts: Mapping[tuple[str, str], str]
    terminals: Mapping[str, str]

    def __post_init__(self) -> None:
        known = {(unit.name, shaft) for unit in self.units for shaft in unit.shafts}
        for end in self.shafts:
            if end not in known:
                raise NameLookupError(f"{self.name}: no shaft {'.'.join(end)}: {nearest('.'.join(end), map('.'.join, known))}")
        for node in (*self.shafts.values(), *self.terminals, *self.terminals.values()):
            if node not in self.nodes:
                raise NameLookupError(f"{self.name}: no node '{node}': {nearest(node, self.nodes)}")
        if missing := sorted(".".join(end) for end in known - set(self.shafts)):
            raise ConnectionError(f"{self.name}: shafts without a node: {', '.join(missing)}")

    @property
    def degrees_of_freedom(self) -> int:
        """Independent speeds: one per node, minus the constraint that each unit imposes on its shafts."""
        return len(set(self.shafts.values())) - len(self.units)

    @property
    def loops(self) -> int:
        """Closed power loops: independent cycles in the graph of units and nodes."""
        return len(self.shafts) - len(self.units) - len(set(self.shafts.values())) + 1

    def draw(self, ax: Any = None) -> Any:
        """Draw the diagram.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw into; by default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            The drawing.
        """
        if ax is None:
            plt = optional("matplotlib.pyplot")

            _, ax = plt.subplots(figsize=(5, 3), layout="constrained")
        patches = optional("matplotlib.patches")

        units = {unit.name: unit for unit in self.units}
        for (name, shaft), node in self.shafts.items():
            (x, y), (x_end, y_end) = units[name].position, self.nodes[node]
            ax.plot([x, x_end, x_end], [y, y, y_end], color="0.2", lw=1.3)
            beside = (x + 0.2, y + 0.6 * np.sign(y_end - y)) if x == x_end else (x + 0.6 * np.sign(x_end - x), y + 0.16)
            ax.text(*beside, rf"$\{shaft}$" if len(shaft) > 1 else f"${shaft}$", ha="center", va="center", fontsize=9)
        for terminal, node in self.terminals.items():
            ax.plot(*np.transpose([self.nodes[terminal], self.nodes[node]]), color="0.2", lw=1.3)
        for unit in self.units:
            x, y = unit.position
            square = patches.Rectangle((x - 0.4, y - 0.4), 0.8, 0.8, fc="white", ec="black", lw=1.3, zorder=2)
            ax.add_patch(square if unit.kind == "P" else patches.Circle((x, y), 0.43, fc="white", ec="black", lw=1.3, zorder=2))
            ax.text(x, y, f"${unit.name}$", ha="center", va="center", fontsize=11)
        for node, (x, y) in self.nodes.items():
            ax.plot(x, y, "o", color="black", ms=5)
            from_above = any(end == node and units[name].position[1] > y for (name, _), end in self.shafts.items())
            ax.text(x, y - 0.3 if from_above else y + 0.28, f"${node}$", ha="center", va="center", fontsize=10)
        ax.set_title(self.name, fontsize=10)
        ax.set_aspect("equal")
        ax.set_axis_off()
        ax.margins(0.08)
        return ax


def unit_diagram(kind: str) -> StructureDiagram:
    """The diagram of a single unit: Table 1 for ``"P"``, Table 2 for ``"X"``.

    >>> unit_diagram("P").degrees_of_freedom, unit_diagram("X").degrees_of_freedom
    (1, 2)
    """
    unit = Unit(kind, kind, (0, 0))
    ends = dict(zip(unit.shafts, ("I", "O", "N"), strict=False))
    places = {"I": (-1.6, 0.0), "O": (1.6, 0.0), "N": (0.0, -1.4)}
    shafts = {(kind, shaft): node for shaft, node in ends.items()}
    return StructureDiagram(f"{kind} unit", (unit,), {node: places[node] for node in ends.values()}, shafts, {})


def single_loop(kind: str) -> StructureDiagram:
    """A single-loop train of two units (Table 3): ``"XP"``, ``"PX"`` or ``"XX"``.

    In ``XP`` the power enters at a shaft of the X unit, and the P unit and another shaft of the X unit meet at the output (output
    confluence: the train of the paper). In ``PX`` the input is split between both. In ``XX`` two differentials share two of their
    shafts.

    >>> [(kind, single_loop(kind).loops, single_loop(kind).degrees_of_freedom) for kind in ("XP", "PX", "XX")]
    [('XP', 1, 1), ('PX', 1, 1), ('XX', 1, 2)]
    """
    left, right, low_left, low_right = (0.0, 0.0), (2.6, 0.0), (0.0, -1.5), (2.6, -1.5)
    before, after, low_after, between = (-1.6, 0.0), (4.2, 0.0), (4.2, -1.5), (1.3, -1.5)
    if kind == "XP":
        return StructureDiagram(
            "XP: output confluence",
            (Unit("X", "X", left), Unit("P", "P", between)),
            {"I": before, "J_0": low_left, "J_1": right, "O": after},
            {("X", "a"): "I", ("X", "b"): "J_0", ("X", "c"): "J_1", ("P", "alpha"): "J_0", ("P", "beta"): "J_1"},
            {"O": "J_1"},
        )
    if kind == "PX":
        return StructureDiagram(
            "PX: input split",
            (Unit("X", "X", right), Unit("P", "P", between)),
            {"I": before, "J_0": left, "J_1": low_right, "O": after},
            {("X", "a"): "J_0", ("X", "b"): "J_1", ("X", "c"): "O", ("P", "alpha"): "J_0", ("P", "beta"): "J_1"},
            {"I": "J_0"},
        )
    if kind == "XX":
        first, second = Unit("X", "X_1", left), Unit("X", "X_2", low_right)
        ends = (
            dict(zip(first.shafts, ("I", "J_0", "J_1"), strict=True)),
            dict(zip(second.shafts, ("J_0", "O", "J_1"), strict=True)),
        )
        shafts = {
            (unit.name, shaft): node for unit, of in zip((first, second), ends, strict=True) for shaft, node in of.items()
        }
        nodes = {"I": before, "J_0": low_left, "J_1": right, "O": low_after}
        return StructureDiagram("XX: two differentials", (first, second), nodes, shafts, {})
    raise ArgumentError(f"no single-loop train '{kind}': {nearest(kind, ('XP', 'PX', 'XX'))}")
