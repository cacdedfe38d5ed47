"""The equation of each node, and which derivatives equations give on demand."""

from __future__ import annotations

import pytest

from gearlib.structure.dependence import Dependence

# x' = u + y, y = g(x); u is given from outside, z = u
COLUMNS = {0: [(0, 1), (1, 0), (9, 0)], 1: [(1, 0), (0, 0)], 2: [(2, 0), (9, 0)]}
SOLVED = {(0, 1): (0, 0), (1, 0): (1, 0), (2, 0): (2, 0)}


def dependence() -> Dependence:
    def columns(e: int, k: int) -> list[tuple[int, int]]:
        return [(v, order + k) for v, order in COLUMNS[e]]

    return Dependence(((0, 0),), SOLVED, columns, frozenset({9}))


def test_an_unknown_is_solved_from_its_equation_and_its_derivative_from_the_derivative_of_that() -> None:
    assert dependence().equation((1, 0)) == (1, 0)
    assert dependence().equation((1, 2)) == (1, 2)
    assert dependence().equation((0, 3)) == (0, 2)
    assert dependence().of((1, 1)) == [(0, 1)]
    assert dependence().of((0, 1)) == [(1, 0)], "neither itself nor what is given"


@pytest.mark.parametrize("node", [(0, 0), (9, 0), (7, 1)], ids=["a state", "given", "in no equation"])
def test_no_equation_determines_what_is_known_or_nowhere(node: tuple[int, int]) -> None:
    with pytest.raises(KeyError) as missing:
        dependence().equation(node)
    assert missing.value.args == ((node[0], 0),)


def test_what_hangs_on_the_rate_of_what_is_given_has_no_derivative() -> None:
    """x' = u', y = x: the equation of y' holds x', which is an unknown of the model, and cannot be computed."""
    columns = {0: [(0, 1), (9, 1)], 1: [(1, 0), (0, 0)]}
    solved_by = {(0, 1): (0, 0), (1, 0): (1, 0)}
    found = Dependence(((0, 0),), solved_by, lambda e, k: [(v, order + k) for v, order in columns[e]], frozenset({9}))
    assert {node: found.computes(node) for node in [(0, 0), (0, 1), (1, 0), (1, 1), (9, 0), (9, 1)]} == {
        (0, 0): True, (0, 1): False, (1, 0): True, (1, 1): False, (9, 0): True, (9, 1): False,
    }  # fmt: skip
    assert found.needing({(0, 0)}) == {(0, 1)}
    assert found.with_rates_of_given == {(0, 0)}


def test_what_is_computed() -> None:
    found = dependence()
    assert all(found.computes(node) for node in [(0, 0), (0, 1), (1, 0), (1, 1), (9, 0), (2, 0)])
    assert not found.computes((9, 1))
    assert not found.computes((2, 1)), "its equation holds the derivative of what is given"
    assert not found.computes((1, 2)), "x'' holds it"
    assert not found.computes((7, 0))


def test_no_equation_determines_a_state_though_one_determines_what_it_is_the_derivative_of() -> None:
    """x is solved for, and its derivative is a state: x'' = x' and x = x' / 2."""
    found = Dependence(((0, 1),), {(0, 2): (0, 0), (0, 0): (1, 0)}, lambda e, k: [(0, 2 - 2 * e), (0, 1)])
    assert (found.equation((0, 0)), found.equation((0, 2)), found.equation((0, 3))) == ((1, 0), (0, 0), (0, 1))
    with pytest.raises(KeyError):
        found.equation((0, 1))
