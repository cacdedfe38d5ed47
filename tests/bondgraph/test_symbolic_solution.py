"""Solutions in symbols against numbers: what the blocks give at random points, and against sympy's elimination."""

from __future__ import annotations

import random

import pytest
import sympy as sp

from gearlib.bondgraph import BondGraph, C, I, One, R, Se, state_equations
from gearlib.bondgraph.symbolic_solution import solved_by_blocks
from gearparts.trains.paper_graphs import PREFERENCE, planetary_unit, single_loop_train


def at_random(symbols: set[sp.Symbol], seed: int) -> dict[sp.Symbol, sp.Rational]:
    draw = random.Random(seed)
    return {s: sp.Rational(draw.randint(50, 200), 97) for s in sorted(symbols, key=str)}


@pytest.mark.parametrize(("figure", "preferred"), [(planetary_unit, (81,)), (single_loop_train, PREFERENCE)])
def test_rates_of_the_papers_units_in_symbols(figure, preferred):
    equations = state_equations(figure().graph, preferred)
    rates = equations.explicit()
    assert tuple(rates) == equations.unknowns
    assert max(map(sp.count_ops, rates.values())) < 600  # multiplied out, the longest has some 10 000
    values = at_random(set().union(*(v.free_symbols for v in rates.values()), equations.mass_matrix.free_symbols), 1)
    expected = equations.mass_matrix.xreplace(values).LUsolve(equations.right_side.xreplace(values))
    assert [v.xreplace(values) for v in rates.values()] == list(expected)  # rational numbers: equal, not close


@pytest.mark.parametrize("seed", range(12))
def test_random_sparse_systems(seed):
    draw = random.Random(seed)
    size = draw.randint(1, 6)
    entries = iter(sp.symbols("a0:99"))
    matrix = sp.zeros(size, size)
    for i in range(size):
        matrix[i, (i + seed) % size] = next(entries)
        for j in range(size):
            if draw.random() < 0.3:
                matrix[i, j] += next(entries) - draw.randint(0, 1)
    sides = sp.Matrix([next(entries) * draw.randint(0, 2) for _ in range(size)])
    values = at_random(matrix.free_symbols | sides.free_symbols, seed)
    found = [sp.sympify(y).xreplace(values) for y in solved_by_blocks(matrix, sides)]
    assert found == list(matrix.xreplace(values).LUsolve(sides.xreplace(values)))


def test_a_determinant_whose_terms_cancel_is_zero():
    a, b, c = sp.symbols("a b c")
    with pytest.raises(ZeroDivisionError):
        solved_by_blocks(sp.Matrix([[a, a * b], [c, b * c]]), sp.Matrix([1, 2]))
    with pytest.raises(ZeroDivisionError):
        solved_by_blocks(sp.Matrix([[0.1, 0.3], [0.2, 0.6]]), sp.Matrix([1, 2]))
    with pytest.raises(ZeroDivisionError):
        solved_by_blocks(sp.Matrix([[0, a], [0, b]]), sp.Matrix([1, 2]))


def test_shared_sums_are_printed_once():
    text = state_equations(single_loop_train().graph, PREFERENCE).latex(solved=True)
    assert text.count("s_{1} &=") == 1
    assert r"\dot{p}_{11} &= \frac{- s_{2} s_{6} + s_{4} s_{5}}{- s_{1} s_{2} + s_{3} s_{4}}" in text


def test_solved_sums_are_broken_into_lines_and_quotients_stay_whole() -> None:
    v = One("v")
    equations = state_equations(BondGraph((1, Se(), v), (2, v, I()), (3, v, C()), (4, v, R())))
    lines = equations.latex(solved=True, terms=2).splitlines()
    assert lines[1:-1] == [
        r"\dot{p}_{2} &= - \frac{R_{4}}{I_{2}} p_{2} - \frac{1}{C_{3}} q_{3} \\",
        r"&\quad + Se_{1} \\",
        r"\dot{q}_{3} &= \frac{p_{2}}{I_{2}}",
    ]


@pytest.mark.parametrize("seed", range(6))
def test_systems_of_small_whole_numbers(seed: int) -> None:
    """Many zeros, ones and minus ones; what is singular is refused."""
    draw = random.Random(seed)
    for size in (1, 2, 3, 4):
        matrix = sp.Matrix(size, size, lambda i, j: draw.choice((-1, 0, 0, 1, -1, 2)))
        sides = sp.Matrix([draw.randint(-2, 2) for _ in range(size)])
        if matrix.det() == 0:
            with pytest.raises(ZeroDivisionError):
                solved_by_blocks(matrix, sides)
        else:
            assert list(matrix * sp.Matrix(solved_by_blocks(matrix, sides))) == list(sides)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_numbers_are_singular_up_to_rounding_whatever_their_unit(unit: float) -> None:
    with pytest.raises(ZeroDivisionError):
        solved_by_blocks(unit * sp.Matrix([[1.0, 1.0], [1.0, 1.0 + 1e-14]]), sp.Matrix([1, 2]))
    found = solved_by_blocks(unit * sp.Matrix([[1.0, 1.0], [1.0, 1.0 + 1e-6]]), sp.Matrix([1, 2]))
    assert [float(y) for y in found] == pytest.approx([(1 - 1e6) / unit, 1e6 / unit], rel=1e-8)


def test_short_values_are_simplified_and_long_ones_are_left_as_they_are() -> None:
    a, b, c, d = sp.symbols("a b c d")
    assert solved_by_blocks(sp.Matrix([[a, 0], [b, c]]), sp.Matrix([1, 1])) == [1 / a, (a - b) / (a * c)]
    many = sp.symbols("x0:24")
    long = sum(x * (d + 1) for x in many) - sum(x * d for x in many)
    assert sp.count_ops(long) > 60
    assert solved_by_blocks(sp.Matrix([[a]]), sp.Matrix([long])) == [long / a]
