"""Routing of stick diagrams: what an arrangement costs does not depend on how its shafts are numbered."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.scheme.routing import CLEAR, Choice, Line, RouteSearch, crossings
from tests.drawing.scheme.test_stick_diagram import scheme_of

ALONE: dict[str, Callable[[], gl.Component]] = {
    "spring": lambda: gp.Spring(c=1.0),
    "clutch": lambda: gp.Clutch(fn_max=1.0, f_normalized=1.0),
    "ratio": lambda: gp.IdealGear(ratio=2.0),
    "pair": lambda: gp.IdealGear(ratio=-2.0),
    "mesh": lambda: gp.ExternalMesh(r_a=0.02, r_b=0.09, c=1e8, d=0.0),
    "ring": lambda: gp.InternalMesh(r_a=0.09, r_b=0.03, c=1e8, d=0.0),
    "set": lambda: gp.IdealPlanetary(ratio=2.0),
    "double": lambda: gp.IdealPlanetary(ratio=-2.0),
    "brake": lambda: gp.Brake(fn_max=1.0, f_normalized=1.0),
    "torque": lambda: gp.Torque(tau=1.0),
}


@pytest.mark.parametrize("part", ALONE)
def test_a_part_alone_crosses_nothing_whichever_side_it_shows(part: str) -> None:
    axes = ALONE[part]().scheme().axes
    assert len(axes.symbols) == 1
    search = RouteSearch(axes)
    for turned, second in itertools.product((False, True), repeat=2):
        found = search.drawn(replace(search.first(), turned=(turned,), second=(second,)))
        assert (found.crossings, found.enclosed) == (0, 0)
        for shaft, (y, points) in found.spines.items():
            (line,) = (of for of in found.lines if of[4] == shaft and of[1] == of[3] == y and of[0] == points[0][2])
            assert line[2] == points[-1][2]


@pytest.mark.parametrize("name", ["two stages", "xp", "ravigneaux", "losses"])
def test_numbers_of_shafts_do_not_count(name: str) -> None:
    """Random arrangements have the same crossings, lines that block the outside, and places with other numbers."""
    random = np.random.default_rng(7)
    axes = scheme_of(name).axes
    search, shafts = RouteSearch(axes), len(axes.of)
    for _ in range(40):
        level = tuple(int(random.choice(levels)) for levels in search.levels)
        turned, second = (tuple(bool(b) for b in random.integers(0, 2, len(axes.symbols))) for _ in range(2))
        choice = Choice(tuple(int(i) for i in random.permutation(search.columns)), level, turned, second)
        found = search.drawn(choice)
        number = [int(n) for n in random.permutation(shafts)]  # the new one of each shaft
        old = np.argsort(number).tolist()
        symbols = tuple(replace(s, shafts=tuple(number[k] for k in s.shafts)) for s in axes.symbols)
        again = RouteSearch(replace(axes, symbols=symbols, of=tuple(axes.of[k] for k in old)))
        other = again.drawn(replace(choice, level=tuple(level[k] for k in old)))
        assert (other.crossings, other.enclosed, other.places) == (found.crossings, found.enclosed, found.places)
        assert sorted(line[:4] for line in other.lines) == sorted(line[:4] for line in found.lines)
        assert {number[k]: spine for k, spine in found.spines.items()} == other.spines


@pytest.mark.parametrize("seed", range(8))
def test_lines_of_other_shafts_cross_where_they_are_nearer_than_lines_may_be(seed: int) -> None:
    """On a grid of half that distance, lines are often just so far apart; they are counted one by one."""
    random = np.random.default_rng(seed)

    def some(count: int) -> list[Line]:
        ends = CLEAR / 2 * random.integers(0, 12, (count, 4))
        return [(a, b, a, d, k % 3) if k % 2 else (a, b, c, b, k % 3) for k, (a, b, c, d) in enumerate(ends.tolist())]

    def cross(one: Line, other: Line) -> bool:
        apart = [
            max(min(one[k], one[k + 2]), min(other[k], other[k + 2]))
            - min(max(one[k], one[k + 2]), max(other[k], other[k + 2]))
            for k in (0, 1)
        ]
        return one[4] != other[4] and max(apart) < CLEAR

    lines, bodies, outwards = some(7), some(5), some(4)
    inside = sum(cross(one, other) for one, other in itertools.combinations(lines + bodies, 2))
    blocked = sum(cross(one, other) for one in outwards for other in lines)
    assert crossings(lines, bodies, outwards) == (inside, blocked)
