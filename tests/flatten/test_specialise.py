"""Variables that are one, or zero, are put into an equation before anything else is done with it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.equations.template import relation_symbol, template_of
from gearlib.errors import ModelError, SingularError
from gearlib.flatten.aliases import Aliases
from gearlib.flatten.model import EquationGroup
from gearlib.flatten.specialise import by_pattern, merged, simplified, specialised, with_values
from gearlib.program.schedule import levels

c = gl.connect

ACROSS: dict[str, Any] = {
    "spring": lambda: gp.Spring(c=10.0),
    "damper": lambda: gp.Damper(d=1.0),
    "spring_damper": lambda: gp.SpringDamper(c=10.0, d=1.0),
    "backlash": lambda: gp.ElastoBacklash(c=1.0, d=1.0, b=0.1),
    "sensor": lambda: gp.RelSpeedSensor(),
    "angle_sensor": lambda: gp.RelAngleSensor(),
    "clutch": lambda: gp.Clutch(fn_max=1.0, f_normalized=1.0),
    "one_way": lambda: gp.OneWayClutch(fn_max=1.0, f_normalized=1.0),
    "body": lambda: gp.Inertia(J=1.0),
    "unit_gear": lambda: gp.IdealGear(ratio=1.0),
    "disc": lambda: gp.Disc(delta_phi=0.0),
}


class Across(gl.Component):
    """Two bodies that are rigidly one, and a part from the one to the other."""

    part = gl.Structural("spring")

    def assemble(self) -> list[Any]:
        self.torque, self.a, self.b = gp.Torque(), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.s = ACROSS[self.part]()
        return [
            c(self.torque.flange, self.a.flange_a), c(self.a.flange_b, self.b.flange_a),
            c(self.s.flange_a, self.a.flange_a), c(self.s.flange_b, self.b.flange_b),
        ]  # fmt: skip


@pytest.mark.parametrize("part", ACROSS)
def test_a_part_across_one_rigid_set_is_inert(part: str) -> None:
    system = gl.compile(Across(part=part))
    inertia = 4.0 if part == "body" else 3.0
    for method in ("auto", "rk", "ida"):
        result = system.simulate(1.0, samples=3, start={"a.w": 2.0}, inputs={"torque.tau": 6.0}, method=method)
        assert result["b.w"] == pytest.approx(2.0 + 6.0 / inertia * result.time, rel=1e-6)
    model = system.linearize(["torque.tau"], ["a.w"], sparse=True)
    assert np.asarray(model.B.sum()) == pytest.approx(1 / inertia)
    assert gl.mobility(system) == 1


def test_symbols_are_put_in_and_relations_decided() -> None:
    a, b, k = (sympy.Symbol(name, real=True) for name in "abk")
    equation = gl.Eq(a, k * (a - b) + gl.Piecewise((1, a - b > 0), (2, True)))
    template = template_of(equation, "Leaf: law", lambda name: name == "k")
    one = specialised(template, ((0, 1), (0, 1)))
    assert (one.columns, one.parameters, one.relations) == ((("a", 0),), (), ())
    assert one.residual == a - 2
    opposite = specialised(template, ((0, 1), (0, -1)))
    assert opposite.columns == (("a", 0),)
    assert len(opposite.relations) == 1
    assert specialised(template, ((0, 1), (1, 1)), frozenset({("k", 0.0)})).residual.free_symbols >= {a}


class Opposite(gl.Component):
    """``2 T = k (flange_a.tau - flange_b.tau)`` where one torque is the other's negative."""

    flange_a = gp.Flange()
    flange_b = gp.Flange()
    k = gl.Parameter("1", "a factor", default=1.0)
    T = gl.Variable("N.m", "half of it")
    d = gl.Variable("rad", "twist")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.d, self.flange_b.phi - self.flange_a.phi),
            gl.Eq(self.flange_b.tau, 5.0 * self.d),
            gl.Eq(self.flange_a.tau, -self.flange_b.tau),
            gl.Eq(2 * self.T, self.k * (self.flange_b.tau - self.flange_a.tau)),
        ]


def test_a_coefficient_that_is_a_parameter_cancels_only_where_it_does() -> None:
    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.wall, self.s, self.b = gp.Fixed(), Opposite(), gp.Inertia(J=1.0, start={"phi": 0.1})
            return [c(self.wall.flange, self.s.flange_a), c(self.s.flange_b, self.b.flange_a)]

    result = gl.simulate(Train(), 1.0, samples=11, rtol=1e-10)
    assert result["s.T"] == pytest.approx(0.5 * np.cos(np.sqrt(5.0) * result.time), abs=1e-7)


def test_an_order_of_computation_that_goes_in_a_circle_is_an_error_not_a_loop_without_end() -> None:
    with pytest.raises(ModelError, match="computed from itself"):
        levels([[1], [0]], [0, 1], 0)
    with pytest.raises(ModelError, match="that no equation determines"):
        levels([[1]], [0, -1], 0)
    assert levels([[], [0], [0, 1]], [0, 1, 2], 0) == [1, 2, 3]


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        (((0, 1), (0, 1), (2, 1)), "z**2"),
        (((0, 1), (1, 1), (1, -1)), "y**2 + sin(x - y)"),
        (((0, 1), (1, 1), (0, 1)), "z**2 + sin(z - y)"),
    ],
)
def test_locals_that_are_one_variable_are_merged_whichever_comes_first(pattern: Any, expected: str) -> None:
    x, y, z = sympy.symbols("x y z", real=True)
    template = template_of(gl.Eq(sympy.sin(x - y) + z**2, 0), "test", lambda name: False)
    assert template.locals == ("x", "y", "z")
    wanted = {"x": x, "y": y, "z": z}
    right = (
        sympy.sympify(expected, locals=wanted).subs(z, x) if pattern[2] == (0, 1) else sympy.sympify(expected, locals=wanted)
    )
    assert sympy.simplify(merged(template, pattern).residual - right) == 0


@pytest.mark.parametrize(
    ("condition", "holds"),
    [(lambda d: d > 0, False), (lambda d: d >= 0, True), (lambda d: d < 0, False), (lambda d: d <= 0, True),
     (lambda d: d + 1 > 0, True), (lambda d: d < 1, True), (lambda d: d - 1 >= 0, False)],
)  # fmt: skip
def test_a_relation_between_aliases_is_decided(condition: Any, holds: bool) -> None:
    a, b = (sympy.Symbol(name, real=True) for name in "ab")
    template = template_of(gl.Eq(a, gl.Piecewise((3, condition(a - b)), (5, True))), "Leaf: law", lambda name: False)
    assert specialised(template, ((0, 1), (0, 1))).residual == a - (3 if holds else 5)
    assert specialised(template, ((0, 1), (0, 1))).relations == ()


def test_relations_that_are_left_keep_their_order() -> None:
    a, b, t = (sympy.Symbol(name, real=True) for name in ("a", "b", "time"))
    law = gl.Piecewise((1, a - b > 0), (2, a > t), (3, b < t - 1), (4, True))
    template = template_of(gl.Eq(a, law), "Leaf: law", lambda name: False)
    found = specialised(template, ((0, 1), (0, 1)))
    assert (len(template.relations), len(found.relations)) == (3, 2)
    for at in (0.0, 0.5, 2.0):
        point = {a: 0.75, t: at}
        signs = [-r.g.subs(point) if r.negated else r.g.subs(point) for r in found.relations]
        flags = {relation_symbol(k): int(bool(sign > 0)) for k, sign in enumerate(signs)}
        assert found.residual.subs(flags).subs(point) == 0.75 - law.subs(b, a).subs(point)


@pytest.mark.parametrize(
    ("value", "kept"), [(0.5, sympy.Rational(1, 2)), (1e-3, sympy.Rational(1, 1000)), (0.1, 0.1), (1 / 3, 1 / 3)]
)
def test_values_are_exact_and_fractions_of_large_denominators_are_decimal(value: float, kept: Any) -> None:
    a, k = (sympy.Symbol(name, real=True) for name in "ak")
    template = template_of(gl.Eq(k * a, 0), "Leaf: law", lambda name: name == "k")
    (slope,) = specialised(template, ((0, 1),), frozenset({("k", value)})).slopes
    assert float(slope) == float(kept)
    assert slope.is_Float == (kept != sympy.Rational(1, 2))


def group(template: Any, parameters: list[list[int]], variables: list[list[int]]) -> EquationGroup:
    none = np.empty((len(variables), 0), np.int64)
    return EquationGroup(
        template, np.array(variables), np.ones_like(variables), np.array(parameters), np.arange(len(variables)), none
    )


def test_rows_with_the_same_values_share_a_template() -> None:
    a, b, k, m = (sympy.Symbol(name, real=True) for name in "abkm")
    template = template_of(gl.Eq(k * a, b / m), "Leaf: law", lambda name: name in {"k", "m"})
    raw = group(template, [[0, 1], [2, 3], [4, 5], [0, 3]], [[0, 1], [2, 3], [4, 5], [6, 7]])
    assert with_values(raw, {9: 0.0}, [])[0] is raw
    pieces = with_values(raw, {0: 0.0, 3: 2.0}, [f"p{i}" for i in range(6)])
    assert sorted((p.owners.tolist(), str(p.template.residual)) for p in pieces) == [
        ([0], "-b/m"),
        ([1], "a*k - b/2"),
        ([2], "a*k - b/m"),
        ([3], "-b/2"),
    ]
    with pytest.raises(SingularError, match=r"Leaf: law divides by zero: p1 may not be 0"):
        with_values(raw, {1: 0.0, 0: 3.0}, [f"p{i}" for i in range(6)])


@given(st.integers(0, 10_000))
def test_patterns_say_which_locals_are_one_variable_or_none(seed: int) -> None:
    """Brute force over random variables, signs and aliases."""
    rng = np.random.default_rng(seed)
    names = [sympy.Symbol(f"x{j}", real=True) for j in range(int(rng.integers(1, 4)))]
    template = template_of(gl.Eq(sympy.Add(*(sympy.sin(x) for x in names)), 0), "test", lambda name: False)
    rows, n = int(rng.integers(1, 5)), 5
    raw = group(template, [[] for _ in range(rows)], rng.integers(0, n, (rows, len(names))).tolist())
    sign = rng.choice([-1, 0, 1], n, p=[0.25, 0.15, 0.6])
    aliases = Aliases(np.array([0, 0, 2, 2, 4]), sign, 0)
    expected: dict[int, tuple[tuple[int, int], ...]] = {}
    for i, row in enumerate(raw.variables.tolist()):
        values = [(int(aliases.representative[v]), int(sign[v])) for v in row]
        pattern = []
        for v, s in values:
            lead = next((k for k, (u, r) in enumerate(values) if u == v and r), -1) if s else -1
            pattern.append((lead, s * values[lead][1] if s else 0))
        if any(lead != j for j, (lead, _) in enumerate(pattern)):
            expected[i] = tuple(pattern)
    found = {int(i): pattern for some, pattern in by_pattern(raw, aliases) for i in some}
    assert found == expected
    assert {type(n) for pattern in found.values() for pair in pattern for n in pair} <= {int}, (
        "decimals would spoil expressions"
    )


def test_a_variable_that_is_zero_leaves_an_equation() -> None:
    """Also a derivative of it, and where it is the argument of a function."""
    x, y, z, rate = (sympy.Symbol(name, real=True) for name in ("x", "y", "z", "der(x)"))
    template = template_of(gl.Eq(sympy.cos(x) * y + 3 * rate - x * z, z), "test", lambda name: False)
    assert template.locals == ("x", "y", "z")
    assert specialised(template, ((-1, 0), (1, 1), (2, 1))).residual == y - z
    assert specialised(template, ((0, 1), (-1, 0), (2, 1))).residual == 3 * rate - x * z - z
    linear = template_of(gl.Eq(x + y, 2 * z), "test", lambda name: False)
    assert merged(linear, ((-1, 0), (1, 1), (2, 1))) is linear, "it is no alias without it"
    half = template_of(gl.Eq(x + y, z), "test", lambda name: False)
    assert merged(half, ((-1, 0), (1, 1), (2, 1))).alias == (0, 1, 1)
    assert merged(half, ((-1, 0), (1, 1), (-1, 0))).alias == (0, -1, 0)
    assert merged(half, ((-1, 0), (-1, 0), (-1, 0))).columns == ()


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([[0, 1, 4], [4, 1, 0]], [([0, 1], "x + y - z")]),
        ([[0, 1, 5]], [([0], "x + y")]),  # variable 5 is zero, so that the first two are opposite
        ([[0, 1, 4], [0, 1, 5], [4, 1, 0], [5, 4, 1]], [([0, 2], "x + y - z"), ([1], "x + y"), ([3], "y - z")]),
        ([[0, 1, 5], [1, 4, 5]], [([0, 1], "x + y")]), ([[0, 2, 4], [0, 1, 4]], [([1], "x + y - z"), ([0], "2*x - z")]),
    ],
)  # fmt: skip
def test_each_row_has_one_template(rows: list[list[int]], expected: list[tuple[list[int], str]]) -> None:
    """Those without aliases keep theirs, and come first; variables 0 and 2 are one, and 5 is zero."""
    x, y, z = (sympy.Symbol(name, real=True) for name in "xyz")
    template = template_of(gl.Eq(x + y, z), "test", lambda name: False)
    raw = group(template, [[] for _ in rows], rows)
    aliases = Aliases(np.array([0, 1, 0, 3, 4, 5]), np.array([1, 1, 1, 1, 1, 0]), 0)
    found = simplified(raw, aliases)
    assert [(some.tolist(), str(fitting.residual)) for some, fitting in found] == expected


def test_rows_with_zeros_that_are_no_aliases_keep_their_template() -> None:
    w, x, y, z = (sympy.Symbol(name, real=True) for name in "wxyz")
    template = template_of(gl.Eq(w + x + y, z), "test", lambda name: False)
    raw = group(template, [[], []], [[0, 1, 2, 3], [1, 2, 0, 3]])
    ((some, fitting),) = simplified(raw, Aliases(np.arange(4), np.array([0, 1, 1, 1]), 0))
    assert some.tolist() == [0, 1]
    assert fitting is template
