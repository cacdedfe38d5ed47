"""Sankey diagrams: every power is drawn, as wide as it is."""

import re
import xml.etree.ElementTree as ET

import networkx as nx
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.drawing.sankey import WIDEST, Band, returning, sankey

NODES = "abcdef"


def widths(picture) -> dict[str, float]:
    """Width of every band, by its title."""
    root = ET.fromstring(picture.svg)
    found = {}
    for group in root.iter("{http://www.w3.org/2000/svg}g"):
        title, band = group.find("{*}title"), group.find("{*}path")
        if title is not None and band is not None:
            found[title.text] = float(band.get("stroke-width"))
    return found


class Loop(gl.Component):
    """Ring driven; the sun leads through a gear back to the carrier, which is the output."""

    def assemble(self):
        self.drive, self.load, self.shaft = gp.Torque(), gp.Torque(), gp.Inertia(J=0.1)
        self.x, self.p = gp.IdealPlanetary(ratio=4.2), gp.IdealGear(ratio=1.7)
        return [
            gl.connect(self.drive.flange, self.x.ring),
            gl.connect(self.x.sun, self.p.flange_a),
            gl.connect(self.p.flange_b, self.x.carrier, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange),
        ]


def test_a_closed_loop():
    """Widths stand to each other as the powers do, and exactly one band flows back: the circulating power."""
    flow = gl.compile(Loop()).power_flow(speeds={"shaft.w": 12.0}, torques={"load.tau": -70.0})
    picture = flow.sankey()
    found = {re.match(r"(.*): ", title)[1]: width for title, width in widths(picture).items()}
    assert found["drive → x"] / WIDEST == pytest.approx(
        flow.input_power / (flow.input_power + flow.circulating_power), rel=1e-2
    )
    assert found["p → x" if "p → x" in found else "x → p"] / WIDEST == pytest.approx(
        flow.circulating_power / (flow.input_power + flow.circulating_power), rel=1e-2
    )
    assert picture.svg.count("flows back") == 1


@example([("a", "b", 1.0), ("a", "d", 1.0), ("b", "d", 1.0), ("c", "a", 1.0), ("c", "b", 1.0), ("d", "a", 1.0)])
@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(NODES), st.sampled_from(NODES), st.floats(1.0, 1e6)), min_size=1, max_size=14))
def test_random_flows(triples):
    flows = [Band(a, b, p) for a, b, p in {(a, b): (a, b, p) for a, b, p in triples if a != b}.values()]
    back = returning(flows)
    graph = nx.DiGraph((f.source, f.target) for k, f in enumerate(flows) if k not in back)
    assert nx.is_directed_acyclic_graph(graph)
    for k in back:  # none flows back without need
        graph.add_edge(flows[k].source, flows[k].target)
        assert not nx.is_directed_acyclic_graph(graph)
        graph.remove_edge(flows[k].source, flows[k].target)
    picture = sankey(flows, {}, "<&>")
    top = max((f.power for f in flows), default=1.0)
    drawn = sorted(widths(picture).values())
    assert drawn == pytest.approx(sorted(max(f.power / top * WIDEST, 0.8) for f in flows), abs=6e-3)


def test_only_parts_with_losses_have_an_arrow_of_losses() -> None:
    picture = sankey([Band("drive", "gear", 3.0), Band("gear", "load", 2.5)], {"gear": 0.5}, "power")
    assert re.findall(r"loss ([^<]*)<", picture.svg) == ["0.5 W"]
    assert picture.svg.count("<polygon") == 1
