"""Arrangement of the boxes of a block diagram: what stands above what."""

from __future__ import annotations

from gearlib.drawing.arrangement import LEFT, RIGHT, arranged, port_sides
from gearlib.drawing.block_diagram import Net, Outline, Pin, Terminal


def law(name: str, *ports: str) -> Outline:
    return Outline(name, "Law", "", tuple(Terminal(port, "signal") for port in ports))


def test_the_lowest_port_of_a_box_is_above_the_highest_of_the_box_below() -> None:
    """So what they lead to stands in the same order, and the wires do not cross."""
    parts = (
        law("a", "y0", "y1", "y2"),
        law("b", "y0", "y1", "y2"),
        law("c", "u", "v"),
        law("d", "u"),
        law("e", "u"),
        law("f", "u", "v"),
    )
    ends = (
        ("a", "y0", "c", "u"), ("a", "y1", "c", "v"), ("a", "y2", "d", "u"),
        ("b", "y0", "e", "u"), ("b", "y1", "f", "u"), ("b", "y2", "f", "v"),
    )  # fmt: skip
    nets = tuple(Net((Pin(source, out), Pin(sink, into)), "signal") for source, out, sink, into in ends)
    found = arranged(Outline("all", "All", parts=parts, nets=nets), 2000.0)
    assert [box.part.name for box in sorted(found.boxes, key=lambda box: (box.x, box.y))] == [*"abcdef"]


def test_a_shaft_that_leads_nowhere_leaves_a_drive_at_its_right_and_a_load_at_its_left() -> None:
    parts = [Outline(name, name, icon, (Terminal("flange", "rotational"),)) for name, icon in (("m", "torque"), ("z", "load"))]
    assert port_sides(parts, (), (0, 0), {}, {}, ()) == {(0, "flange"): RIGHT, (1, "flange"): LEFT}
