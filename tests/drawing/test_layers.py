"""Which part of a block diagram stands before which: the order of layers where the sides of ends leave it open."""

from __future__ import annotations

from gearlib.drawing.layers import layers, ordered, positions


def test_only_ends_of_different_sides_or_far_apart_have_an_order() -> None:
    """Of two parts that both drive a third one, neither is before the other; nor are two any ends close to each other."""
    nets = [[(0, 1), (2, -1)], [(1, 0), (2, -1)], [(0, 1), (1, 1)]]
    x = positions(3, nets)
    assert 0.2 < x[1] - x[0] < 0.45
    assert layers(3, nets, {}) == [0, 0, 1]
    near = [[(0, 1), (2, -1)], [(1, 1), (2, -1)], [(0, 1), (1, 0)]]
    x = positions(3, near)
    assert 0 < x[1] - x[0] < 0.2
    assert layers(3, near, {}) == [0, 0, 1]


def test_the_first_layer_keeps_its_order_where_the_next_one_can_follow() -> None:
    assert ordered([[0, 1], [2, 3]], {0: [(0, 0.0)], 1: [(1, 0.0)], 2: [(1, 0.0)], 3: [(0, 0.0)]}) == [[0, 1], [3, 2]]
