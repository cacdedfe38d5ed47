"""Parts side by side in series with others, without inertia between."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.equations.template import template_of
from gearlib.flatten.aliases import Aliases, unite
from gearlib.flatten.connections import (
    MOST_ADDENDS,
    connection_sets,
    series_of_parallels,
    split_sum,
    sum_groups,
    sum_template,
    without_opposites,
)
from gearlib.flatten.model import EquationGroup
from gearlib.language.expressions import real_symbol


@given(st.lists(st.lists(st.integers(0, 12), min_size=1, max_size=4), max_size=8))
def test_connection_sets_are_the_components_of_a_graph(links: list[list[int]]) -> None:
    graph = nx.Graph()
    for link in links:
        nx.add_path(graph, link)
        graph.add_node(link[0])
    assert connection_sets(links) == sorted(sorted(s) for s in nx.connected_components(graph))


@pytest.mark.parametrize("n", [1, MOST_ADDENDS, MOST_ADDENDS + 1, 2 * MOST_ADDENDS - 2, 2 * MOST_ADDENDS - 1, 50])
def test_a_sum_is_split_into_the_fewest_that_are_short_enough(n: int) -> None:
    """Each but the last holds one new variable that the next one takes up: n + 2 k addends in k + 1 sums."""
    members = tuple((v, (-1) ** v) for v in range(n))
    sums, following = split_sum(members, 100)
    new = following - 100
    assert new == max(0, -(-(n - MOST_ADDENDS) // (MOST_ADDENDS - 2)))
    assert len(sums) == new + 1
    assert all(len(s) == MOST_ADDENDS for s in sums[:-1])
    assert 1 <= len(sums[-1]) <= MOST_ADDENDS
    total: dict[int, int] = {}
    for v, sign in (member for s in sums for member in s):
        total[v] = total.get(v, 0) + sign
    assert {v: sign for v, sign in total.items() if sign} == dict(members)


def aliases_of(n: int, *equal: tuple[int, int, int]) -> Aliases:
    left, right, sign = np.array(equal, np.int64).reshape(-1, 3).T
    return unite(n, left, right, sign, np.zeros(n, np.int64))


def test_flows_that_are_zero_or_equal_and_opposite_leave_a_sum() -> None:
    aliases = aliases_of(6, (1, 0, -1), (2, -1, 0), (4, 3, 1))
    assert without_opposites(((0, 1), (1, 1), (5, 1)), aliases) == ((5, 1),)
    assert without_opposites(((0, 1), (1, -1), (5, -1)), aliases) == ((0, 1), (1, -1), (5, -1)), "these add up"
    assert without_opposites(((2, 1), (3, 1), (4, -1)), aliases) == ()
    assert without_opposites(((3, 1), (3, -1), (3, 1), (5, 1)), aliases) == ((3, 1), (3, -1), (3, 1), (5, 1))


def sums_of(rows: list[list[int]], signs: list[list[int]]) -> EquationGroup:
    """A group of sums."""
    n = len(rows)
    none = np.empty((n, 0), np.int64)
    return EquationGroup(sum_template(len(rows[0])), np.array(rows), np.array(signs), none, np.full(n, -1), none)


@given(st.integers(0, 10_000))
def test_sums_that_share_all_but_one_flow_say_the_same_as_before(seed: int) -> None:
    """What is left and the equalities have the solutions of the sums, and fewer long sums."""
    rng = np.random.default_rng(seed)
    n, length = 7, int(rng.integers(2, 5))
    base = rng.permutation(n)[:length]
    rows, signs = [], []
    for _ in range(int(rng.integers(1, 5))):
        row = base.copy()
        if rng.random() < 0.7:
            row[rng.integers(length)] = rng.integers(n)
        rows.append(rng.permutation(row).tolist())
        signs.append(rng.choice([-1, 1], length).tolist())
    aliases = aliases_of(n, (6, 5, -1)) if rng.random() < 0.5 else aliases_of(n)

    def matrix(groups: list[EquationGroup], equal: list[tuple[int, int, int]]) -> Any:
        lines = []
        for group in groups:
            for row, sign in zip(group.variables, group.signs, strict=True):
                line = np.zeros(n)
                np.add.at(line, aliases.representative[row], sign * aliases.sign[row])
                lines.append(line)
        for a, b, s in equal:
            line = np.zeros(n)
            line[a] += 1
            line[b] -= s
            lines.append(line)
        return np.array(lines).reshape(-1, n)

    before = sums_of(rows, signs)
    equal, rest = series_of_parallels([before], aliases)
    one, other = matrix([before], []), matrix(rest, equal)
    rank = np.linalg.matrix_rank(one)
    assert np.linalg.matrix_rank(other) == rank == np.linalg.matrix_rank(np.vstack([one, other]))
    assert len(other) == len(one)
    kept = matrix(rest, [])
    terms = [{int(v): int(c) for v, c in enumerate(line) if c} for line in kept]
    if length > 2:
        for i, a in enumerate(terms):
            for b in terms[:i]:
                common = set(a) & set(b)
                related = (
                    len(common) >= 2
                    and (len({a[v] * b[v] for v in common}) == 1)
                    and len(set(a) - common) == len(set(b) - common) == 1
                )
                assert not (related and len(a) == len(b) == length), "such a pair is simplified"


def test_parallel_parts_in_series_carry_the_same() -> None:
    aliases = aliases_of(5)
    group = sums_of([[0, 2, 3], [1, 2, 3]], [[1, 1, 1], [1, -1, -1]])
    equal, (rest,) = series_of_parallels([group], aliases)
    assert rest.variables.tolist() == [[0, 2, 3]]
    ((a, b, sign),) = equal
    assert ({a, b}, sign) == ({0, 1}, -1), "x + a + b = 0 and y - a - b = 0 say x = -y"
    two = sums_of([[0, 2], [1, 2]], [[1, 1], [1, -1]])
    assert series_of_parallels([two], aliases) == ([], [two]), "sums of two are equalities anyway"
    apart = sums_of([[0, 2, 3], [1, 2, 3]], [[1, 1, 1], [1, -1, 1]])
    assert series_of_parallels([apart], aliases) == ([], [apart])
    same = sums_of([[0, 2, 3], [3, 0, 2]], [[1, 1, 1], [-1, -1, -1]])
    assert series_of_parallels([same], aliases) == ([], [same]), "one of them is redundant, which is found later"
    law = template_of(gl.Eq(sum(real_symbol(name) ** 2 for name in "xyz"), 0), "no sum", lambda name: False)
    lawful = replace(group, template=law)
    assert series_of_parallels([lawful], aliases) == ([], [lawful])


def test_sums_of_one_length_are_one_group() -> None:
    """With their signs and owners in the order of their sums; they have neither parameters nor discrete variables."""
    owned = [(((4, 1), (2, -1), (0, 1)), 5), (((1, -1), (3, 1)), -1), (((6, -1), (5, -1), (7, 1)), 2)]
    two, three = sum_groups(owned)
    assert (two.variables.tolist(), two.signs.tolist(), two.owners.tolist()) == ([[1, 3]], [[-1, 1]], [-1])
    assert (three.variables.tolist(), three.owners.tolist()) == ([[4, 2, 0], [6, 5, 7]], [5, 2])
    assert three.signs.tolist() == [[1, -1, 1], [-1, -1, 1]]
    assert two.parameters.shape == two.discretes.shape == (1, 0)
    assert three.parameters.shape == three.discretes.shape == (2, 0)
    assert three.template.residual == sum(real_symbol(f"flow_{k}") for k in range(3))


class SideBySide(gl.Component):
    """A body on a ring of two springs and a few spring-dampers side by side, massless nodes between; or one that is all of these."""

    dampers = gl.Structural(2)
    d_0 = gl.Structural(0.0)
    dangling = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.body = gp.Inertia(J=0.8, start={"w": 1.0})
        self.front, self.back = gp.SpringDamper(c=5e3, d=self.d_0), gp.Spring(c=240.0)
        self.spring = gp.SpringDamper(c=6e3, d=5.5 if self.dampers == 0 else 5.0)
        self.more = [gp.SpringDamper(c=0.0, d=0.5 / self.dampers) for _ in range(self.dampers)]
        between = [self.spring, *self.more]
        links = [
            gl.connect(self.body.flange_b, self.front.flange_b, self.back.flange_b),
            gl.connect(self.front.flange_a, *(p.flange_a for p in between)),
            gl.connect(*(p.flange_b for p in between), self.back.flange_a),
        ]
        if self.dangling:
            self.loose = gp.Spring(c=5e3)
            links.append(gl.connect(self.loose.flange_a, self.spring.flange_b))
        return links


@cache
def side_by_side(dampers: int, dangling: bool) -> gl.System:
    return gl.compile(SideBySide(dampers=dampers, dangling=dangling))


@pytest.mark.parametrize("dangling", [False, True])
@pytest.mark.parametrize("dampers", [1, 2, 9])
@pytest.mark.parametrize("method", ["exact", "ida", "rk"])
def test_dampers_side_by_side_in_series_with_springs(dampers: int, dangling: bool, method: str) -> None:
    """They are one spring-damper; its deflection dies away as by hand: springs of 5000 and 240 N.m/rad in series, and 6000 beside."""
    result = side_by_side(dampers, dangling).simulate(
        0.01, samples=21, start={"spring.phi_rel": 0.01, "body.phi": 0.0}, method=method, rtol=1e-9
    )
    series = 5000.0 * 240.0 / 5240.0
    expected = 0.01 * np.exp(-(6000.0 + series) / 5.5 * result.time)
    assert result["spring.phi_rel"] == pytest.approx(expected, abs=1e-9)
    total = result["spring.tau"] + sum(result[f"more[{k}].tau"] for k in range(dampers))
    assert total == pytest.approx(-series * expected, abs=1e-6)  # the ring closes: the others are stretched by as much
    assert result["front.tau"] == pytest.approx(-total, abs=1e-9)  # its other flange is at the node
    assert result["body.w"] == pytest.approx(np.ones(21), abs=1e-9)


@pytest.mark.parametrize("dangling", [False, True])
@pytest.mark.parametrize("dampers", [1, 2, 9])
def test_flows_through_parts_side_by_side_are_made_equal(dampers: int, dangling: bool) -> None:
    """Rather than found later, among sums of equations in which the rates of massless nodes cancel."""
    assert "derivatives cancel" not in side_by_side(dampers, dangling).summary()


def test_what_lies_side_by_side_is_not_seen_from_outside() -> None:
    start = {"spring.phi_rel": 0.01, "front.phi_rel": 0.0}
    one, three = (gl.compile(SideBySide(dampers=n, d_0=2.0)).simulate(0.05, samples=11, start=start, rtol=1e-9) for n in (0, 2))
    for name in ("body.w", "front.tau", "back.tau", "spring.phi_rel"):
        assert three[name] == pytest.approx(one[name], abs=1e-7), name


class Delta(gl.Component):
    """Three dampers between three nodes without inertia, and a spring from each to the body."""

    def assemble(self) -> list[Any]:
        self.body = gp.Inertia(J=0.8)
        self.springs, self.dampers = [gp.Spring(c=5e3) for _ in range(3)], [gp.Damper(d=1.0) for _ in range(3)]
        return [
            gl.connect(self.body.flange_b, *(s.flange_b for s in self.springs)),
            *(gl.connect(self.springs[k].flange_a, self.dampers[k].flange_a, self.dampers[k - 1].flange_b) for k in range(3)),
        ]


def test_springs_against_a_delta_of_dampers() -> None:
    """By hand: the springs' torques balance each other, c q = -3 d q', and the body stays where it is."""
    start = {"springs[1].phi_rel": 0.01, "springs[2].phi_rel": -0.004}
    result = gl.compile(Delta()).simulate(1e-3, samples=11, start=start, rtol=1e-9)
    decay = np.exp(-5e3 / 3.0 * result.time)
    for k, first in enumerate((-0.006, 0.01, -0.004)):
        assert result[f"springs[{k}].phi_rel"] == pytest.approx(first * decay, abs=1e-9)
        assert np.abs(result[f"springs[{k}].tau"]) == pytest.approx(5e3 * abs(first) * decay, abs=1e-4)
    assert result["body.w"] == pytest.approx(np.zeros(11), abs=1e-9)


class Bundle(gl.Component):
    """Torques between two flanges of one shaft, which a long connection set contains in an order that a seed gives."""

    seed = gl.Structural(0)
    bodies = gl.Structural(1)

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque2()
        self.parts = [gp.Spring(c=3.0) for _ in range(5)]
        flanges = [f for p in (self.torque, *self.parts) for f in (p.flange_a, p.flange_b)]
        if self.bodies:
            self.body, self.drag = gp.Inertia(J=2.0), gp.Damper(d=0.5)
            self.drive, self.ground = gp.Torque(), gp.Fixed()
            flanges += [self.body.flange_a, self.drag.flange_a, self.drive.flange]
        np.random.default_rng(self.seed).shuffle(flanges)
        return [gl.connect(*flanges), *([gl.connect(self.drag.flange_b, self.ground.flange)] if self.bodies else [])]


@pytest.mark.parametrize("seed", range(4))
def test_flows_that_cancel_leave_a_connection_set_before_it_is_split(seed: int) -> None:
    system = gl.compile(Bundle(seed=seed))
    assert not any(
        "flow_sum" in system.translation.model.name(v) for g in system.translation.model.groups for v in g.variables.flat
    )
    with pytest.warns(gl.InputWarning, match=r"no equation contains the input torque\.tau"):
        model = system.linearize(["torque.tau", "drive.tau"], ["body.w"])
    assert model(0.5j) == pytest.approx(np.array([[0.0, 1.0 / (2.0 * 0.5j + 0.5)]]))


def test_a_connection_set_in_which_all_flows_cancel_determines_nothing() -> None:
    with pytest.raises(gl.GearlibError, match=r"torque\.flange_a\.phi"):
        gl.compile(Bundle(bodies=0))


class Coupled(gl.Component):
    """A driven body and a loaded one with a spring between them, which may be two in parallel."""

    between = gl.Structural("one", choices=("one", "two", "turned"))

    def assemble(self) -> list[Any]:
        alone = self.between == "one"
        self.drive, self.motor, self.load = gp.Torque(), gp.Inertia(J=0.07), gp.Inertia(J=0.4)
        self.fan = gp.LinearSpeedDependentTorque(tau_nominal=-3.0, w_nominal=10.0, torque_direction=False)
        self.spring = gp.CubicSpringDamper(c=400.0 if alone else 300.0, c_3=1e4, d=2.0 if alone else 0.0)
        links = [
            gl.connect(self.drive.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.fan.flange),
        ]
        if alone:
            return links
        self.beside = gp.SpringDamper(c=100.0, d=2.0)
        a, b = (self.beside.flange_a, self.beside.flange_b)[:: 1 if self.between == "two" else -1]
        return [*links, gl.connect(self.spring.flange_a, a), gl.connect(self.spring.flange_b, b)]


@pytest.mark.parametrize(("between", "sign"), [("two", 1), ("turned", -1)])
def test_parts_side_by_side_have_one_twist(between: str, sign: int) -> None:
    """So the second one makes no absolute angle a state: a pole at zero, and no periodic motion of a train that turns."""
    one, two = (gl.compile(Coupled(between=b)) for b in ("one", between))
    assert len(one.states) == len(two.states) == 3
    assert gl.stability(one).poles.verdict == gl.stability(two).poles.verdict == "stable"
    push, outputs = {"drive.tau": lambda phase, omega: 3 * np.cos(phase) + 0.4}, ["load.w", "spring.phi_rel"]
    known, found = (gl.harmonic_balance(s, 20.0, 26.0, inputs=push, points=2, outputs=outputs) for s in (one, two))
    assert found.mean("load.w") == pytest.approx(0.4 / 0.3)
    assert found.amplitude("load.w") == pytest.approx(known.amplitude("load.w"), rel=1e-6)
    result = two.simulate(0.1, start={"spring.phi_rel": 0.1}, inputs={"drive.tau": 1.0}, samples=5)
    assert result["beside.phi_rel"] == pytest.approx(sign * result["spring.phi_rel"], rel=1e-12)
