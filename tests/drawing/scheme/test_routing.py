"""Routing of stick diagrams: what an arrangement costs does not depend on how its shafts are numbered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearlib.drawing.scheme.routing import Choice, RouteSearch
from tests.drawing.scheme.test_stick_diagram import scheme_of


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
