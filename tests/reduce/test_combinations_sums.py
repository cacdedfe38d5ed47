"""Sums in which derivatives cancel, against the sums of their equations' residuals at random values."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.equations.kernel import differentiated
from gearlib.equations.template import column_symbol, relation_symbol
from gearlib.flatten.flatten import flatten
from gearlib.flatten.model import EquationGroup, FlatModel
from gearlib.language.expressions import real_symbol, time
from gearlib.reduce import combinations as rules
from gearlib.reduce.combinations import CancellingSum, cancel, combinations, dependent_rows, replaced
from gearlib.reduce.reduction import Structure, analyse
from tests.reduce.test_combinations import Block, Counting, Geared, Leaking, Pushed, Stiffening
from tests.stress.test_right_calls import given


class Law(gl.Component):
    """One equation, with a mode, and another value while a run is started."""

    a, b, s = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    k, c = gl.Parameter("1"), gl.Parameter("1", default=1.0)
    on = gl.Discrete("mode", start=0.0)

    def equations(self) -> list[Any]:
        started = gl.Piecewise((self.k, gl.initial()), (2, True))
        mode = gl.Eq(self.on, gl.Piecewise((self.k, gl.time > self.k), (gl.pre(self.on), True)))
        steps = gl.Piecewise((self.s, self.s > 1), (1, True)) + gl.Piecewise((self.s**2, self.s > 3), (9, True))
        left = self.c * self.a + self.c * self.b
        return [mode, gl.Eq(left, self.k * self.s + gl.pre(self.on) * started + steps)]


class Laws(gl.Component):
    """Two of these for u + v, each with its own mode."""

    x, y, u, v = gl.Variable("1", start=1.0), gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

    def assemble(self) -> list[Any]:
        self.one, self.other = Law(k=1.5), Law(k=0.7, c=3.0)
        return []

    def equations(self) -> list[Any]:
        pairs = [(self.one, self.x), (self.other, self.y)]
        same = [gl.Eq(getattr(law, n), value) for law, s in pairs for n, value in (("a", self.u), ("b", self.v), ("s", s))]
        return [gl.Eq(gl.der(self.x), self.u), gl.Eq(gl.der(self.y), 2 * self.v), *same]


MODELS = {
    "laws": lambda: Laws(),
    "block": lambda: Block(),
    "pushed": lambda: Block(planetary=Pushed),
    "leaking": lambda: Block(planetary=Leaking),
    "counting": lambda: Block(planetary=Counting),
    "stiffening": lambda: Block(spring=Stiffening),
    "geared": lambda: Geared(),
}
FOUND: dict[str, tuple[Structure, Any, tuple[CancellingSum, ...]]] = {}


def found_in(name: str) -> tuple[Structure, Any, tuple[CancellingSum, ...]]:
    """The structure of a model without the inertia of a wheel, its parameters, and the sums."""
    if name not in FOUND:
        model = flatten(MODELS[name]())
        index = model.parameters.index
        if "wheel.J" in index:
            model = flatten(MODELS[name](), frozenset({(index["wheel.J"], 0.0)}))
        parameters = model.parameters.defaults
        structure = analyse(model, parameters)
        FOUND[name] = structure, parameters, combinations(structure, parameters, [(v, k + 1) for v, k in structure.states])
    return FOUND[name]


class Point:
    """Random values of time, of all variables and their derivatives, of relations and of discrete variables."""

    def __init__(self, model: FlatModel, parameters: Any, flags: list[int], seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.t, self.nodes = 0.7, rng.uniform(-2, 2, (model.n_variables, 6))
        self.discretes = rng.uniform(-2, 2, 2 * len(model.discretes) + 1)
        self.parameters, self.flags = parameters, flags

    def residual(self, group: EquationGroup, i: int, times: int, first_flag: int = 0) -> float:
        template, own = differentiated(group.template, times), group.template
        where = {name: j for j, name in enumerate(own.locals)}
        values: dict[Any, Any] = {time: self.t}
        for name, order in template.columns:
            values[column_symbol((name, order))] = (
                group.signs[i, where[name]] * self.nodes[group.variables[i, where[name]], order]
            )
        values |= {real_symbol(n): self.parameters[group.parameters[i, j]] for j, n in enumerate(own.parameters)}
        values |= {real_symbol(n): self.discretes[group.discretes[i, j]] for j, n in enumerate(own.discretes)}
        values |= {relation_symbol(j): self.flags[first_flag + j] for j in range(len(own.relations))}
        value = template.residual.xreplace(values)
        assert not getattr(value, "free_symbols", ()), "what it depends on is all named"
        return float(value)

    def relations(self, group: EquationGroup, i: int) -> list[tuple[float, bool, bool]]:
        where = {name: j for j, name in enumerate(group.template.locals)}
        values: dict[Any, Any] = {time: self.t}
        for name, order in group.template.relation_columns:
            j = where[name]
            values[column_symbol((name, order))] = group.signs[i, j] * self.nodes[group.variables[i, j], order]
        values |= {real_symbol(n): self.parameters[group.parameters[i, j]] for j, n in enumerate(group.template.parameters)}
        values |= {real_symbol(n): self.discretes[group.discretes[i, j]] for j, n in enumerate(group.template.discretes)}
        return [(float(r.g.xreplace(values)), r.strict, r.negated) for r in group.template.relations]


@pytest.mark.parametrize("name", MODELS)
def test_a_sum_is_what_its_equations_leave_of_each_other(name: str) -> None:
    """With any values of what cancels, any states of relations and of discrete variables."""
    structure, parameters, found = found_in(name)
    model = structure.model
    assert len(found) == (1 if name == "laws" else 2)
    for number, c in enumerate(found):
        terms = [(model.groups[model.places[e][0]], model.places[e][1], k, w) for e, k, w in c.terms]
        without = given(partial(replaced, structure, [c]))
        (group,) = [g for g in without.groups if g.template.label.startswith("what ")]
        assert len(without.places) == len(model.places)
        assert c.replaced in [e for e, k, _ in c.terms if k == 0]
        g, i = model.places[c.replaced]
        assert group.owners.tolist() == [model.groups[g].owners[i]]
        held = {(v, order) for v, order in group.nodes[0]}
        assert held
        assert not held & set(c.gone)
        before = [{n for e, k, _ in c.terms for n in model.nodes(e, k)}]
        assert held | set(c.gone) == before[0]
        asked = {s.name for s in group.template.residual.free_symbols if s.name.startswith("relation(")}
        assert asked <= {relation_symbol(j).name for j in range(len(group.template.relations))}
        flags = [(number + j) % 2 for j in range(9)]
        for seed in range(2):
            point = Point(model, parameters, flags, seed)
            total, taken, compared = 0.0, 0, []
            for own, row, k, weight in terms:
                total += weight * point.residual(own, row, k, taken)
                compared += point.relations(own, row)
                taken += len(own.template.relations)
            assert point.residual(group, 0, 0) == pytest.approx(total, rel=1e-9, abs=1e-9)
            assert point.relations(group, 0) == [(pytest.approx(g), strict, negated) for g, strict, negated in compared]


@pytest.mark.parametrize(
    ("name", "decisive"),
    [
        ("block", [set(), {"p.ratio"}]), ("pushed", [set(), {"p.ratio"}]), ("leaking", [{"p.share"}, {"p.ratio"}]),
        ("geared", [{"first.ratio", "second.ratio"}] * 2),
    ],
)  # fmt: skip
def test_values_are_decisive_without_which_nothing_cancels(name: str, decisive: list[set[str]]) -> None:
    structure, parameters, found = found_in(name)
    names = structure.model.parameters.names
    assert [{names[p] for p in c.decisive} for c in found] == decisive
    assert cancel(structure, found, parameters)
    for p in range(len(names)):
        beside = parameters.copy()
        beside[p] += 0.01
        assert cancel(structure, found, beside) == (names[p] not in set().union(*decisive)), names[p]


def test_labels_name_the_components_whose_equations_are_added() -> None:
    structure, _, found = found_in("block")
    labels = {g.template.label for g in replaced(structure, found).groups if g.template.label.startswith("what ")}
    assert labels == {"what the equations of p leave of each other", "what the equations of d, p leave of each other"}


def test_only_the_unknowns_of_some_targets_are_examined() -> None:
    structure, parameters, _ = found_in("block")
    assert combinations(structure, parameters, []) == ()


@pytest.mark.parametrize("seed", range(5))
def test_weights_of_dependent_rows_span_the_left_null_space(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, rank, n = (int(k) for k in (rng.integers(3, 8), rng.integers(1, 3), rng.integers(3, 7)))
    matrix = rng.integers(-2, 3, (m, rank)) @ rng.integers(-2, 3, (rank, n)) * 1.0
    matrix[~matrix.any(axis=1)] = 1.0
    matrix *= 10.0 ** rng.integers(-4, 5, (m, 1))
    found = dependent_rows(matrix)
    scaled = matrix / np.abs(matrix).max(axis=1, keepdims=True)
    assert len(found) == m - np.linalg.matrix_rank(scaled)
    for weights in found:
        assert np.abs(weights @ matrix).max() <= 1e-9 * np.abs(weights[:, None] * matrix).max()
        assert weights[np.flatnonzero(weights)[0]] == 1.0
    leads = [np.flatnonzero(w)[0] for w in found]
    assert leads == sorted(set(leads))
    assert all(w[other] == 0 for k, w in enumerate(found) for j, other in enumerate(leads) if j != k)


class Pair(gl.Component):
    """Two equations for u + v leave x = y, of which the derivative gives u = 2 v: so x' = 2 x / 3."""

    x, y, z = gl.Variable("1", start=1.0), gl.Variable("1"), gl.Variable("1", start=0.0)
    u, v = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.u),
            gl.Eq(gl.der(self.y), 2 * self.v),
            gl.Eq(gl.der(self.z), self.x),
            gl.Eq(self.u + self.v, self.x),
            gl.Eq(self.u + self.v, self.y),
        ]


def test_two_equations_that_say_almost_the_same() -> None:
    result = gl.simulate(Pair(), 1.0, samples=2, rtol=1e-9)
    assert result["x"] == pytest.approx(np.exp([0.0, 2 / 3]), rel=1e-7)
    assert result["y"] == pytest.approx(result["x"])
    assert result["z"][-1] == pytest.approx(1.5 * (np.exp(2 / 3) - 1), rel=1e-7)


@pytest.mark.parametrize(("most", "count"), [(1, 0), (2, 1), (400, 1)])
def test_blocks_up_to_a_size_are_examined_that_some_rates_need(most: int, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """That of z needs x, the rate of which is in the block."""
    monkeypatch.setattr(rules, "MOST", most)
    model = flatten(Pair())
    structure = analyse(model, model.parameters.defaults)
    node = {name: int(model.representative[model.variable(name)]) for name in "xyzuv"}
    found = combinations(structure, model.parameters.defaults, [(node["z"], 1)])
    assert len(found) == count
    for c in found:
        assert [(k, weight) for _, k, weight in c.terms] == [(0, 1.0), (0, -1.0)]
        assert c.replaced == c.terms[0][0]
        assert set(c.gone) == {(node["u"], 0), (node["v"], 0)}
        assert c.decisive == ()


def test_coefficients_that_are_not_finite_leave_nothing_of_each_other() -> None:
    class Divided(gl.Component):
        p, x = gl.Parameter("1", default=1.0), gl.Variable("1", start=1.0)
        u, v = gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            law, other = gl.Eq(self.u / self.p + self.v, self.x), gl.Eq(self.u - self.v, gl.sin(self.x))
            return [gl.Eq(gl.der(self.x), self.u), law, other]

    model = flatten(Divided())
    structure = analyse(model, model.parameters.defaults)
    for p in (0.0, np.nan):
        values = model.parameters.defaults.copy()
        values[model.parameters.index["p"]] = p
        assert combinations(structure, values, [(v, k + 1) for v, k in structure.states]) == ()


def test_a_sum_of_which_nothing_is_left_is_none() -> None:
    class Same(gl.Component):
        p, q = gl.Parameter("1", default=2.0), gl.Parameter("1", default=2.0)
        x, u, v = gl.Variable("1", start=1.0), gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            one, rate = self.u + self.v, gl.der(self.x)
            return [gl.Eq(rate, self.u), gl.Eq(one, rate), gl.Eq(self.p * self.u + self.q * self.v, self.q * rate)]

    model = flatten(Same())
    structure = analyse(model, model.parameters.defaults)
    assert combinations(structure, model.parameters.defaults, [(v, k + 1) for v, k in structure.states]) == ()


@pytest.mark.parametrize("size", [1e-13, 1e-8, 1e9])
def test_columns_of_any_size_tell_rows_apart(size: float) -> None:
    assert dependent_rows(np.array([[1.0, size], [1.0, 2 * size]])) == []
    (weights,) = dependent_rows(np.array([[1.0, size], [-2.0, -2 * size]]))
    assert weights == pytest.approx([1.0, 0.5], rel=1e-12)


@pytest.mark.parametrize("size", [0.1, 1e6 / 3])
def test_coefficients_of_any_size_cancel_and_values_of_any_size_are_decisive(size: float) -> None:
    """As the pair, with equations of other sizes, and parameters without which u would not cancel."""

    def equations(self: Any) -> list[gl.Eq]:
        law = gl.Eq(size * self.u + size * self.v, size * self.x)
        other = gl.Eq(self.p * self.u + self.q * self.v, self.q * self.y)
        return [gl.Eq(gl.der(self.x), self.u), gl.Eq(gl.der(self.y), 2 * self.v), gl.Eq(gl.der(self.z), self.x), law, other]

    declared = {n: gl.Variable("1", start=1.0) if n == "x" else gl.Variable("1") for n in "xyzuv"}
    declared |= {n: gl.Parameter("1", default=3.3 * size) for n in "pq"}
    model = flatten(type("Sized", (gl.Component,), {**declared, "equations": equations})())
    structure = analyse(model, model.parameters.defaults)
    found = combinations(structure, model.parameters.defaults, [(v, k + 1) for v, k in structure.states])
    assert len(found) == 1
    c = found[0]
    assert {model.parameters.names[p] for p in c.decisive} == {"p", "q"}
    assert [weight for _, _, weight in c.terms] == pytest.approx([1.0, -1 / 3.3])


def test_whole_weights_are_whole() -> None:
    one, other = np.array([0.1, 0.7, 0.3]), np.array([0.3, 0.2, 0.7])
    for factor in (7.0, 300.0):
        (weights,) = dependent_rows(np.array([one, other, one + factor * other]))
        assert weights.tolist() == [1.0, factor, -1.0]


def test_what_a_relation_compares_is_examined_too() -> None:
    class Watched(gl.Component):
        x, y, z = gl.Variable("1", start=1.0), gl.Variable("1"), gl.Variable("1", start=0.0)
        u, v = gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            laws = [gl.Eq(self.u + self.v, self.x), gl.Eq(self.u + self.v, self.y)]
            watched = gl.Piecewise((1, self.u > 0.5), (2, True))
            return [gl.Eq(gl.der(self.x), self.u), gl.Eq(gl.der(self.y), 2 * self.v), gl.Eq(gl.der(self.z), watched), *laws]

    model = flatten(Watched())
    structure = analyse(model, model.parameters.defaults)
    z = int(model.representative[model.variable("z")])
    assert len(combinations(structure, model.parameters.defaults, [(z, 1)])) == 1


@pytest.mark.parametrize("swapped", [False, True])
def test_the_sum_stands_for_the_equation_that_is_differentiated_least_often(swapped: bool) -> None:
    """Of p + q = x and p' + q' = y the derivative of the first leaves x' = y: with x' = -x and y' = 2 q', q' is x / 2."""

    class Rates(gl.Component):
        x, y, q = gl.Variable("1", start=1.0), gl.Variable("1"), gl.Variable("1", start=3.0)
        p = gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            rate = gl.der(self.p) + gl.der(self.q)
            laws = [gl.Eq(self.p + self.q, self.x), gl.Eq(rate, self.y)]
            return [gl.Eq(gl.der(self.x), -self.x), gl.Eq(gl.der(self.y), 2 * gl.der(self.q)), *laws[:: -1 if swapped else 1]]

    model = flatten(Rates())
    structure = analyse(model, model.parameters.defaults)
    node = {n: int(model.representative[model.variable(n)]) for n in "xypq"}
    of = {frozenset(row): e for e, row in enumerate(structure.model.rows)}
    law, rate = (
        of[frozenset((node[n], k) for n, k in row)] for row in ([("p", 0), ("q", 0), ("x", 0)], [("p", 1), ("q", 1), ("y", 0)])
    )
    assert (law < rate) != swapped
    (found,) = combinations(structure, model.parameters.defaults, [(v, k + 1) for v, k in structure.states])
    assert found.terms == ((rate, 0, 1.0), (law, 1, -1.0))
    assert found.replaced == rate
    assert found.gone == tuple(sorted([(node["p"], 1), (node["q"], 1)]))
    result = gl.simulate(Rates(), 1.0, samples=3, rtol=1e-9)
    assert result["y"] == pytest.approx(-np.exp(-result.time), rel=1e-7)
    assert result["q"] == pytest.approx(3.5 - np.exp(-result.time) / 2, rel=1e-7)
