"""Arrangement of the boxes of a block diagram: what stands above what."""

from __future__ import annotations

from gearlib.drawing.arrangement import arranged
from gearlib.drawing.block_diagram import Net, Outline, Pin, Terminal


def test_the_lowest_port_of_a_box_is_above_the_highest_of_the_box_below() -> None:
    """So what they lead to stands in the same order, and the wires do not cross."""
    sources = tuple(Outline(name, "Law", "", tuple(Terminal(f"y{k}", "signal") for k in range(3))) for name in "ab")
    sinks = tuple(Outline(name, "Law", "", (Terminal("u", "signal"),)) for name in "cd")
    nets = (Net((Pin("a", "y2"), Pin("c", "u")), "signal"), Net((Pin("b", "y0"), Pin("d", "u")), "signal"))
    found = arranged(Outline("all", "All", parts=(*sources, *sinks), nets=nets), 2000.0)
    assert [box.part.name for box in sorted(found.boxes, key=lambda box: (box.x, box.y))] == ["a", "b", "c", "d"]
