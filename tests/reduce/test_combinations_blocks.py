"""Sums of the equations of small blocks: which are found, and what cancels in them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.flatten.flatten import flatten
from gearlib.reduce.combinations import CancellingSum, combinations
from gearlib.reduce.reduction import Structure, analyse


def found_in(component: gl.Component) -> tuple[Structure, dict[str, int], tuple[CancellingSum, ...]]:
    """The structure of a model, its variables by name, and the sums."""
    model = flatten(component)
    structure = analyse(model, model.parameters.defaults)
    node = {model.name(v): v for v in range(model.n_variables)}
    return structure, node, combinations(structure, model.parameters.defaults, [(v, k + 1) for v, k in structure.states])


class Twice(gl.Component):
    """p + q = x and p + q = y, differentiated for r = p': with x' = -x and y' = q - 2 y, x = y gives q = x, so that p = r = 0."""

    x, y, q = gl.Variable("1", start=1.0), gl.Variable("1"), gl.Variable("1")
    p, r = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        laws = [gl.Eq(self.p + self.q, self.x), gl.Eq(self.p + self.q, self.y)]
        slopes = [gl.Eq(gl.der(self.x), -self.x), gl.Eq(gl.der(self.y), self.q - 2 * self.y)]
        return [*slopes, *laws, gl.Eq(self.r, gl.der(self.p))]


def test_equations_that_are_all_differentiated_are_added_as_they_are_written() -> None:
    structure, node, (found,) = found_in(Twice())
    assert [(k, weight) for _, k, weight in found.terms] == [(0, 1.0), (0, -1.0)]
    rows = {frozenset(structure.model.rows[e]) for e, _, _ in found.terms}
    assert rows == {frozenset((node[n], 0) for n in names) for names in ("pqx", "pqy")}
    assert all(structure.differentiation.counts[e] == 1 for e, _, _ in found.terms)
    assert found.gone == tuple(sorted((node[n], 0) for n in "pq"))
    assert found.replaced in [e for e, _, _ in found.terms]
    result = gl.simulate(Twice(), 1.0, samples=3, rtol=1e-9)
    for name, value in (
        ("x", np.exp(-result.time)),
        ("y", np.exp(-result.time)),
        ("q", np.exp(-result.time)),
        ("p", 0),
        ("r", 0),
    ):
        assert result[name] == pytest.approx(value + 0 * result.time, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize(("small", "count"), [(0.0, 1), (1e-13, 0)])
@pytest.mark.parametrize("rates", [False, True])
def test_an_unknown_of_the_block_that_is_left_however_small_its_factor_leaves_no_constraint(
    small: float, count: int, rates: bool
) -> None:
    """z in the sums of p and q, with its own factor in each."""

    class Left(gl.Component):
        x, y = gl.Variable("1", start=1.0), gl.Variable("1", start=1.0)
        p, q, r, z = gl.Variable("1"), gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
        a, b = gl.Parameter("1", default=small), gl.Parameter("1", default=2 * small)

        def equations(self) -> list[gl.Eq]:
            one, other = (self.p + self.q + factor * self.z for factor in (self.a, self.b))
            slopes = [gl.Eq(gl.der(self.x), -self.x), gl.Eq(gl.der(self.y), self.q - 2 * self.y)]
            laws = [gl.Eq(one, self.x), gl.Eq(other, self.y), gl.Eq(self.z + self.p, gl.sin(gl.time))]
            return [*slopes, *laws, gl.Eq(self.r, gl.der(self.p) if rates else self.p)]

    structure, node, found = found_in(Left())
    assert max(structure.differentiation.counts) == rates
    assert len(found) == count
    for c in found:
        assert {k for _, k, _ in c.terms} == {0}
        assert set(c.gone) == {(node[n], 0) for n in "pqz"}
        assert {structure.model.parameters.names[p] for p in c.decisive} == {"a", "b"}


@pytest.mark.parametrize("factor", [0.0, 0.5])
def test_a_factor_of_zero_cancels_and_is_decisive(factor: float) -> None:
    class Zero(gl.Component):
        x, y, c = gl.Variable("1", start=1.0), gl.Variable("1", start=1.0), gl.Parameter("1", default=factor)
        u, v, w = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[Any]:
            laws = [gl.Eq(self.u + self.v + self.c * self.w, self.x), gl.Eq(self.u + self.v, self.y)]
            return [gl.Eq(gl.der(self.x), self.u), gl.Eq(gl.der(self.y), 2 * self.v), *laws, gl.Eq(self.w - self.u, gl.time)]

    structure, node, found = found_in(Zero())
    assert len(found) == (factor == 0.0)
    for c in found:
        assert set(c.gone) == {(node[n], 0) for n in "uvw"}
        assert [structure.model.parameters.names[p] for p in c.decisive] == ["c"]


def test_a_sum_of_which_nothing_is_left_does_not_hide_another() -> None:
    """The first two of four equations say the same where k = m; the others leave ``q = r``."""

    class Twice(gl.Component):
        p, q, r, s = (gl.Variable("1", start=1.0) for _ in range(4))
        k, m = gl.Parameter("1", default=2.0), gl.Parameter("1", default=2.0)

        def equations(self) -> list[Any]:
            one, other = gl.der(self.p) + gl.der(self.q), gl.der(self.r) + gl.der(self.s)
            same = [gl.Eq(one + other, -self.p), gl.Eq(self.k * (one + other), -self.m * self.p)]
            return [*same, gl.Eq(one - other, self.q), gl.Eq(one - other, self.r)]

    structure, node, found = found_in(Twice())
    assert [set(c.gone) for c in found] == [{(node[n], 1) for n in "pqrs"}]
    c = found[0]
    held = {n for e, k, _ in c.terms for n in structure.model.nodes(e, k)}
    assert held - set(c.gone) == {(node["q"], 0), (node["r"], 0)}
