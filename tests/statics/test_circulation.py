"""Circulating power: the circles of a power flow, by hand."""

from __future__ import annotations

import pytest

from gearlib.statics.circulation import PowerEdge, circulations


def test_the_shortest_circles_are_taken_out_first() -> None:
    short = [PowerEdge("a", 1, 5.0), PowerEdge("a", 2, -5.0), PowerEdge("b", 2, 2.0), PowerEdge("b", 1, -2.0)]
    long = [PowerEdge("c", 2, 3.0), PowerEdge("c", 3, -3.0), PowerEdge("d", 3, 3.0), PowerEdge("d", 1, -3.0)]
    assert [(c.power, c.components) for c in circulations([*long, *short])] == [(3.0, ("a", "c", "d")), (2.0, ("a", "b"))]
    assert circulations([]) == ()
    rounding = [PowerEdge("a", 1, 1.0), PowerEdge("a", 2, -1.0), PowerEdge("b", 2, 1.0), PowerEdge("b", 1, -1.0 + 1e-13)]
    assert len(circulations(rounding)) == 1


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_circles_of_any_size_are_found_and_rounding_makes_none(size: float) -> None:
    """Two circles through one part of 0.1 and 0.2, which are not quite 0.3 together."""
    flows = [("a", 0, 1, 0.3), ("b", 1, 0, 0.1), ("c", 1, 2, 0.2), ("d", 2, 0, 0.2)]
    edges = [
        PowerEdge(name, shaft, sign * power * size)
        for name, *ends, power in flows
        for sign, shaft in zip((1, -1), ends, strict=True)
    ]
    found = circulations(edges)
    assert [c.components for c in found] == [("a", "c", "d"), ("a", "b")]
    assert [c.power / size for c in found] == pytest.approx([0.2, 0.1], rel=1e-9)
    assert circulations(edges[:2]) == ()


def test_shortest_circles_come_first_wherever_they_are() -> None:
    """The long one leaves no other; the part whose name is the first is on that alone. A part may give to the shaft that it takes from."""
    ends = {"a": (1, 2), "b": (2, 3), "c": (3, 1), "e": (3, 2), "f": (1, 3)}
    edges = [PowerEdge(name, shaft, sign) for name, pair in ends.items() for shaft, sign in zip(pair, (1.0, -1.0), strict=True)]
    assert {c.components for c in circulations(edges)} == {("b", "e"), ("c", "f")}
    assert [c.components for c in circulations([PowerEdge("a", 1, 5.0), PowerEdge("a", 1, -5.0)])] == [("a",)]
