"""Tables as expressions, against NumPy's and SciPy's interpolation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy
from scipy.interpolate import CubicSpline, RegularGridInterpolator

import gearlib as gl
from gearlib.equations.kernel import array_function
from gearlib.equations.template import lift_relations
from gearlib.errors import ArgumentError
from gearlib.language import tabulated
from gearlib.language.tabulated import bilinear, is_symbolic, piecewise_polynomial

x, y = sympy.symbols("x y", real=True)


def at(law: Any, *points: Any) -> Any:
    plain = law.replace(lambda e: getattr(e.func, "__name__", "") == "no_event", lambda e: e.args[0])
    return array_function((x, y)[: len(points)], plain)(*points)


def linear(knots: Any, values: Any) -> Any:
    slopes = np.append(np.diff(values) / np.where(np.diff(knots) > 0, np.diff(knots), 1.0), 0.0)
    return np.array([values, slopes, np.zeros(len(knots)), np.zeros(len(knots))])


@pytest.mark.parametrize("events", [True, False])
@pytest.mark.parametrize("n", [2, 3, 7])
def test_pieces_join_and_are_constant_outside(n: int, events: bool) -> None:
    rng = np.random.default_rng(n)
    knots, values = np.sort(rng.normal(size=n)), rng.normal(size=n)
    points = np.concatenate([np.linspace(-3, 3, 101), knots])
    law = piecewise_polynomial("a table", x, knots, linear(knots, values), events)
    assert at(law, points) == pytest.approx(np.interp(points, knots, values), rel=1e-12, abs=1e-12)
    assert len(lift_relations(law)[1]) == (n if events else 0)
    if n > 2:
        spline = CubicSpline(knots, values)
        pieces = np.column_stack([spline.c[::-1], [values[-1], 0, 0, 0]])
        cubic = piecewise_polynomial("a table", x, knots, pieces, events)
        inside = np.clip(points, knots[0], knots[-1])
        assert at(cubic, points) == pytest.approx(spline(inside), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("events", [True, False])
def test_a_jump_is_an_event_and_belongs_to_what_comes_after(events: bool) -> None:
    knots, values = np.array([0.0, 1.0, 1.0, 2.0, 2.0, 3.0]), np.array([0.0, 1.0, 5.0, 6.0, 6.0, 0.0])
    law = piecewise_polynomial("a table", x, knots, linear(knots, values), events)
    points = np.array([-1.0, 0.0, 0.5, 1 - 1e-9, 1.0, 1.5, 2.0, 2.5, 3.0, 9.0])
    assert at(law, points) == pytest.approx([0, 0, 0.5, 1, 5, 5.5, 6, 3, 0, 0], abs=1e-7)
    if not events:
        (relation,) = lift_relations(law)[1]
        assert float(relation.g.subs(x, 1.0)) == 0.0


@pytest.mark.parametrize("events", [True, False])
@pytest.mark.parametrize("place", [0, 2, 4])
def test_of_several_points_at_one_place_the_first_and_the_last_count(place: int, events: bool) -> None:
    """A table with steps between them, as a function of time and in an equation."""
    table = gl.Table(
        np.insert(np.arange(4.0), place, [min(place, 3.0)] * 3), np.insert(np.arange(4.0), place, [7.0, 9.0, -2.0])
    )
    points = np.concatenate([np.linspace(-1.0, 4.0, 23), np.arange(4.0), np.arange(4.0) - 1e-9])
    assert at(table(x, events=events), points) == pytest.approx(table(points), rel=1e-7, abs=1e-7)
    if not events:
        assert [float(step.g.subs(x, min(place, 3.0))) for step in lift_relations(table(x))[1]] == [0.0]
    flat = gl.Table([0.0, 1.0, 1.0, 1.0, 2.0], [0.0, 1.0, 5.0, 1.0, 2.0])(x, events=events)
    assert at(flat, points) == pytest.approx(np.clip(points, 0.0, 2.0), abs=1e-12)
    assert len(lift_relations(flat)[1]) == (3 if events else 0), "no jump is left at 1"


@pytest.mark.parametrize(
    "pieces", [(0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0), (5, 0, 1, 0), (0, 0, 0, 1), (1, 1, 0, 1), (2, 0, -1, 0)]
)
def test_pieces_of_zeros_and_ones(pieces: tuple[int, ...]) -> None:
    """Terms that vanish are left out, and powers are those of the terms that remain."""
    law = piecewise_polynomial("a table", x, np.array([-1.0, 9.0]), np.array([pieces, (7, 0, 0, 0)], float).T, True)
    points = np.array([-1.0, -0.5, 1.0, 2.5])
    assert at(law, points) == pytest.approx(np.polynomial.Polynomial(pieces)(points + 1.0), rel=1e-14)
    assert at(law, np.array([-3.0, 9.0, 10.0])) == pytest.approx([pieces[0], 7.0, 7.0])


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_between_steps_a_table_is_what_it_is_by_itself(steps: int) -> None:
    rng = np.random.default_rng(steps)
    table = gl.Table(np.repeat(np.arange(steps + 2.0), 2)[1:-1], rng.normal(size=2 * steps + 2))
    law, points = table(x), np.linspace(-1.0, steps + 2.0, 41)
    assert at(law, points) == pytest.approx(table(points), rel=1e-12, abs=1e-12)
    assert len(lift_relations(law)[1]) == steps


@pytest.mark.parametrize("shape", [(2, 2), (3, 2), (2, 4), (5, 3)])
@pytest.mark.parametrize("events", [True, False])
def test_maps_are_bilinear_and_constant_outside(shape: tuple[int, int], events: bool) -> None:
    rng = np.random.default_rng(sum(shape))
    xs, ys = (np.cumsum(rng.uniform(0.5, 2.0, n)) for n in shape)
    z = rng.normal(size=shape)
    law = bilinear("a map", x, y, xs, ys, z, events)
    px, py = rng.uniform(-1, 12, (2, 200))
    inside = np.column_stack([np.clip(px, xs[0], xs[-1]), np.clip(py, ys[0], ys[-1])])
    assert at(law, px, py) == pytest.approx(RegularGridInterpolator((xs, ys), z)(inside), rel=1e-12, abs=1e-12)
    assert bool(lift_relations(law)[1]) == events


def test_tables_of_as_many_points_as_are_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tabulated, "MOST_PIECES", 5)
    knots = np.arange(6.0)
    piecewise_polynomial("a table", x, knots[:5], linear(knots[:5], knots[:5]), True)
    with pytest.raises(ArgumentError, match="a table has 6 points; in an equation, at most 5 are taken"):
        piecewise_polynomial("a table", x, knots, linear(knots, knots), True)
    bilinear("a map", 1.0, 2.0, knots[:4], knots[:3], np.ones((4, 3)), True)  # 5 x 4 cells, counted with those outside
    for n, m in ((5, 3), (4, 4)):
        with pytest.raises(ArgumentError, match=f"a map has {n} x {m} points; expected 20 in all or fewer"):
            bilinear("a map", 1.0, 2.0, knots[:n], knots[:m], np.ones((n, m)), True)


@pytest.mark.parametrize("wrong", [sympy.oo, sympy.nan, sympy.I * x, x / sympy.S.Zero])
def test_arguments_are_real_and_finite(wrong: Any) -> None:
    knots = np.array([0.0, 1.0])
    with pytest.raises(ArgumentError, match=r"a table is given .*; expected a finite real number"):
        piecewise_polynomial("a table", wrong, knots, linear(knots, knots), True)
    with pytest.raises(ArgumentError, match="a map is given"):
        bilinear("a map", x, wrong, knots, knots, np.ones((2, 2)), True)


@pytest.mark.parametrize("branched", [abs(x), gl.Max(x, y), gl.Min(x, 1), gl.sign(x), gl.Piecewise((1, x > 0), (y, True))])
def test_arguments_have_no_branches(branched: Any) -> None:
    knots = np.array([0.0, 1.0])
    with pytest.raises(ArgumentError, match="with branches; give this to a variable with an equation of its own"):
        piecewise_polynomial("a table", branched, knots, linear(knots, knots), True)


def test_what_is_symbolic() -> None:
    assert [is_symbolic(v) for v in (x, gl.time + 1, 2.0, np.ones(2), "x")] == [True, True, False, False, False]
