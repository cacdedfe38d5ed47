"""Families in block diagrams: members in a chain, of which the first and the last remain where that shortens it."""

from __future__ import annotations

import pytest

from gearlib.drawing.block_diagram import Net, Outline, Pin, Terminal, folded

PORTS = (Terminal("a"), Terminal("b"))


@pytest.mark.parametrize("count", [2, 3, 4, 7])
def test_a_chain_is_folded_where_two_or_more_stand_between_its_ends(count: int) -> None:
    wheels = tuple(Outline(f"wheel[{i}]", "Wheel", "inertia", PORTS) for i in range(count))
    load = Outline("load", "Load", "load", PORTS[:1])
    links = [(Pin(f"wheel[{i}]", "b"), Pin(f"wheel[{i + 1}]", "a")) for i in range(count - 1)]
    last = Net((Pin(f"wheel[{count - 1}]", "b"), Pin("load", "a")))
    found = folded(Outline("row", "Row", parts=(*wheels, load), nets=(*(Net(pins) for pins in links), last)))
    if count < 4:
        assert [part.name for part in found.parts] == [*(wheel.name for wheel in wheels), "load"]
        assert found.nets == (*(Net(pins) for pins in links), last)
        return
    assert [part.name for part in found.parts] == ["wheel[0]", "...", f"wheel[{count - 1}]", "load"]
    middle = found.parts[1]
    first, end = Terminal("wheel[1].a"), Terminal(f"wheel[{count - 2}].b")
    assert (middle.kind, middle.icon, middle.ports) == (f"{count - 2} × wheel", "chain", (first, end))
    assert middle.members == tuple(f"wheel[{i}]" for i in range(1, count - 1))
    assert middle.note == f"{count - 2} × wheel\nwheel[1] ... wheel[{count - 2}]"
    assert found.nets == (
        Net((links[0][0], Pin("...", first.name))), Net((Pin("...", end.name), Pin(f"wheel[{count - 1}]", "a"))), last,
    )  # fmt: skip
