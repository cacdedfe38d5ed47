"""Sums around rings say the same as the equations in whose place they stand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.flatten.attributes import PREFERENCE
from gearlib.flatten.flatten import flatten
from gearlib.flatten.model import FlatModel
from gearlib.reduce.rings import with_sums_around_rings
from tests.reduce.test_rings import JOINED, Net


def rows_of(model: FlatModel, n: int) -> tuple[Any, list[tuple[str, tuple[float, ...]]]]:
    """All equations that are sums with plain factors, as rows over n variables, and all others by what they hold."""
    rows, others = [], []
    for g, group in enumerate(model.groups):
        for i in range(len(group)):
            weights = group.template.weights
            if weights is None:
                others.append((model.owner(g, i), group.template.label, tuple(group.variables[i])))
                continue
            row = np.zeros(n)
            for v, sign, weight in zip(group.variables[i], group.signs[i], weights, strict=True):
                row[v] += sign * weight
            rows.append(row)
    return np.array(rows), sorted(others)


class Wheel(gl.Component):
    """A ring of some springs, long enough that its sum is split."""

    n = gl.Structural(12)

    def assemble(self) -> list[Any]:
        self.body = [gp.Inertia(J=0.1) for _ in range(self.n)]
        self.spring = [gp.SpringDamper(c=100.0, d=0.1) for _ in range(self.n)]
        follow = [*self.body[1:], self.body[0]]
        return [
            *(gl.connect(b.flange_b, s.flange_a) for b, s in zip(self.body, self.spring, strict=True)),
            *(gl.connect(s.flange_b, b.flange_a) for s, b in zip(self.spring, follow, strict=True)),
        ]


RINGS = {"triangle": 1, "turned": 1, "square with a diagonal": 2, "two beside one": 3, "star and ring": 2}


@pytest.mark.parametrize("name", [*JOINED, "wheel"])
def test_sums_around_rings_say_the_same_without_absolute_angles(name: str) -> None:
    before = flatten(Wheel() if name == "wheel" else Net(joined=name, order=3))
    after = with_sums_around_rings(before)
    n = after.n_variables
    assert len(after.places) == len(before.places) + n - before.n_variables
    for values in (after.sign, after.preference, after.potential, after.flow, after.nominal):
        assert len(values) == n
    (old, others), (new, still) = rows_of(before, n), rows_of(after, n)
    assert others == still
    rank = np.linalg.matrix_rank
    assert rank(np.vstack([old, new])) == rank(new) == rank(old) + n - before.n_variables
    changed = [row for row in new if not (old == row).all(axis=1).any()]
    absolute = np.flatnonzero((after.preference <= PREFERENCE["avoid"]) & ~after.flow)
    kept = absolute[absolute < before.n_variables]
    assert len(changed) - (n - before.n_variables) == RINGS.get(name, 1)
    for row in changed:
        assert not row[kept].any()
        assert set(np.abs(row[row != 0])) == {1.0}
    if name == "wheel":
        assert n > before.n_variables
        extra = slice(before.n_variables, n)
        assert after.representative[extra].tolist() == list(range(before.n_variables, n))
        assert (after.sign[extra] == 1).all()
        assert (after.preference[extra] == PREFERENCE["avoid"]).all()
        assert not after.potential[extra].any()
        assert not after.flow[extra].any()
        assert (after.nominal[extra] == 1).all()
    assert after.redundant == before.redundant


def test_without_a_ring_a_model_is_what_it_was() -> None:
    class Line(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.spring = gp.Inertia(J=1.0), gp.Inertia(J=1.0), gp.SpringDamper(c=1.0, d=1.0)
            return [gl.connect(self.a.flange_b, self.spring.flange_a), gl.connect(self.spring.flange_b, self.b.flange_a)]

    model = flatten(Line())
    assert with_sums_around_rings(model) is model


class Set(gl.Component):
    """A spring that is turned by an angle given from outside, or not at all."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    turned, twist = gl.Input("rad"), gl.Variable("rad")
    c, given = gl.Parameter("N.m/rad", default=3.0), gl.Structural(1)

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        return [
            gl.Eq(self.twist, b.phi - a.phi - self.given * self.turned),
            gl.Eq(b.tau, self.c * self.twist),
            gl.Eq(a.tau, -b.tau),
        ]


@pytest.mark.parametrize("given", [1, -1, 0])
def test_what_is_given_from_outside_is_in_no_sum(given: int) -> None:
    class Pair(gl.Component):
        def assemble(self) -> list[Any]:
            self.x, self.y, self.one, self.two = gp.Inertia(J=1.0), gp.Inertia(J=1.0), Set(given=given), Set(given=given)
            return [
                gl.connect(self.x.flange_a, self.one.flange_a, self.two.flange_a),
                gl.connect(self.y.flange_a, self.one.flange_b, self.two.flange_b),
            ]

    model = flatten(Pair())
    assert (with_sums_around_rings(model) is model) == bool(given)


def test_sums_of_what_is_no_angle_stay() -> None:
    class Sums(gl.Component):
        x, y, z = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), 1), gl.Eq(gl.der(self.y), 2), gl.Eq(self.z, self.x + self.y)]

    model = flatten(Sums())
    assert with_sums_around_rings(model) is model


class Written(gl.Component):
    """A spring between the sum of two angles and zero, or between their difference and a given angle; its law is written in two ways."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    turned, twist, c = gl.Input("rad"), gl.Variable("rad"), gl.Parameter("N.m/rad", default=3.0)
    way = gl.Structural("a", choices=("a", "b", "c", "d"))

    def equations(self) -> list[gl.Eq]:
        a, b, twist, turned = self.flange_a, self.flange_b, self.twist, self.turned
        law = {
            "a": gl.Eq(twist, a.phi + b.phi),
            "b": gl.Eq(a.phi + b.phi, twist),
            "c": gl.Eq(twist + turned, b.phi - a.phi),
            "d": gl.Eq(twist, b.phi - a.phi + turned),
        }[self.way]
        side = 1 if self.way in "ab" else -1
        return [law, gl.Eq(b.tau, self.c * twist), gl.Eq(a.tau, side * b.tau)]


@pytest.mark.parametrize(
    ("ways", "ring"), [("aa", True), ("bb", True), ("ab", True), ("cc", False), ("dd", False), ("cd", False)]
)
def test_a_ring_is_one_however_its_equations_are_written(ways: str, ring: bool) -> None:
    """Two springs side by side have the same twist; with angles from outside there is no ring."""

    class Pair(gl.Component):
        def assemble(self) -> list[Any]:
            self.x, self.y = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            self.one, self.two = (Written(way=way) for way in ways)
            return [
                gl.connect(self.x.flange_a, self.one.flange_a, self.two.flange_a),
                gl.connect(self.y.flange_a, self.one.flange_b, self.two.flange_b),
            ]

    before = flatten(Pair())
    after = with_sums_around_rings(before)
    assert (after is not before) == ring
    if ring:
        (old, _), (new, _) = rows_of(before, before.n_variables), rows_of(after, before.n_variables)
        (row,) = [row for row in new if not (old == row).all(axis=1).any()]
        twists = [int(before.representative[before.variable(f"{spring}.twist")]) for spring in ("one", "two")]
        assert np.flatnonzero(row).tolist() == sorted(twists)
        assert row[twists].tolist() in ([1.0, -1.0], [-1.0, 1.0])
