"""Structure diagrams: shafts and nodes, degrees of freedom, loops, drawings."""

from __future__ import annotations

import subprocess
import sys

import matplotlib.pyplot as plt
import pytest

from gearlib.errors import ArgumentError, ConnectionError, NameLookupError
from gearparts.trains.structure_diagram import StructureDiagram, Unit, single_loop, unit_diagram


@pytest.mark.parametrize(("kind", "freedom"), [("XP", 1), ("PX", 1), ("XX", 2)])
def test_single_loops(kind: str, freedom: int) -> None:
    diagram = single_loop(kind)
    assert (diagram.loops, diagram.degrees_of_freedom) == (1, freedom)
    ax = diagram.draw()
    assert {f"${name}$" for name in diagram.nodes} <= {text.get_text() for text in ax.texts}
    squares = sum(type(patch).__name__ == "Rectangle" for patch in ax.patches)
    assert (squares, len(ax.patches)) == (kind.count("P"), 2)
    plt.close(ax.figure)


def test_units() -> None:
    assert [(unit_diagram(k).degrees_of_freedom, unit_diagram(k).loops) for k in "PX"] == [(1, 0), (2, 0)]


def test_a_unit_stands_between_its_input_and_output_and_above_its_third_shaft() -> None:
    for kind in "PX":
        (unit,), nodes = unit_diagram(kind).units, unit_diagram(kind).nodes
        (x, y), (x_in, y_in), (x_out, y_out) = unit.position, nodes["I"], nodes["O"]
        assert y_in == y_out == y
        assert x - x_in == x_out - x > 1
        if kind == "X":
            assert nodes["N"][0] == x
            assert nodes["N"][1] < y - 1


def test_wrong_structure_is_named() -> None:
    with pytest.raises(ArgumentError, match="no single-loop train 'PP'"):
        single_loop("PP")
    with pytest.raises(ArgumentError, match="unit 'U': its kind is 'P' or 'X'"):
        Unit("Q", "U", (0, 0))
    unit = Unit("P", "P", (0, 0))
    with pytest.raises(NameLookupError, match=r"no shaft P.gamma"):
        StructureDiagram("S", (unit,), {"I": (1, 0)}, {("P", "gamma"): "I"}, {})
    with pytest.raises(NameLookupError, match="no node 'O'"):
        StructureDiagram("S", (unit,), {"I": (1, 0)}, {("P", "alpha"): "I", ("P", "beta"): "O"}, {})
    with pytest.raises(ConnectionError, match=r"shafts without a node: P.beta"):
        StructureDiagram("S", (unit,), {"I": (1, 0)}, {("P", "alpha"): "I"}, {})


def test_graphs_of_trains_do_not_import_matplotlib() -> None:
    code = (
        "import sys, gearparts.trains.paper_graphs, gearparts.trains.structure_diagram; sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, env={"PYTHONPATH": ":".join(sys.path)}).returncode == 0
