"""One equation of a class, analysed once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
from gearlib.equations.kernel import partial_kernel
from gearlib.equations.template import (
    Template,
    lift_relations,
    parse_column,
    piecewise,
    relation_symbol,
    template_of,
    with_events,
    without_events,
)
from gearlib.errors import DeclarationError, NameLookupError

x, y, z, p, q = sympy.symbols("x y z p q", real=True)
time = gl.time


def der(s: Any, times: int = 1) -> Any:
    for _ in range(times):
        s = gl.der(s)
    return s


def make(left: Any, right: Any = 0) -> Template:
    return template_of(gl.Eq(left, right), "test", lambda name: name in {"p", "q"})


def test_columns_are_variables_with_the_order_of_their_derivative() -> None:
    t = make(p * der(x, 2) + y, time * x)
    assert set(t.columns) == {("x", 2), ("x", 0), ("y", 0)}
    assert t.parameters == ("p",)
    assert t.on_time
    assert set(t.locals) == {"x", "y"}


def test_partial_derivatives_and_linearity() -> None:
    t = make(p * x + q * y**2 + 3 * z + gl.sin(time))
    place = {name: c for c, (name, _) in enumerate(t.columns)}
    found = {name: partial_kernel(t, c) for name, c in place.items()}
    assert t.slopes[place["x"]] == p
    assert found["x"].constant
    assert t.fixed[place["x"]]
    assert found["x"].number is None
    assert found["z"].number == 3.0
    assert t.slopes[place["y"]] == 2 * q * y
    assert not found["y"].constant
    assert not t.fixed[place["y"]]
    assert not t.linear
    assert make(p * x + gl.sin(time)).linear
    assert not make(time * x).linear


@pytest.mark.parametrize(
    ("left", "right"),
    [
        (x**2 + y**2, p**2),
        (gl.sin(p * x) * der(y), time * q),
        (gl.exp(x / p) + gl.sqrt(y), z * time**2),
        (gl.atan2(y, x), gl.log(z)),
    ],
)
@pytest.mark.parametrize("times", [1, 2])
def test_derivative_along_a_curve(left: Any, right: Any, times: int) -> None:
    """Put functions of time into the symbols: the template's derivative is then the ordinary one."""
    t = sympy.Symbol("time", real=True)
    curves = {"x": 1 + sympy.sin(t) / 2, "y": 2 + t**2, "z": sympy.exp(-t)}
    template = make(left, right)
    derived = template
    for _ in range(times):
        derived = derived.derivative

    def put(u: Template) -> Any:
        table = {s: sympy.diff(curves[name], t, order) for s, (name, order) in zip(u.symbols, u.columns, strict=True)}
        return u.residual.subs(table).subs({p: 1.25, q: -0.5})

    expected = sympy.diff(put(template), t, times)
    for moment in (0.3, 0.9):
        assert float(put(derived).subs(t, moment)) == pytest.approx(float(expected.subs(t, moment)), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("template", "alias"),
    [
        (make(x, y), (0, 1, 1)),
        (make(x + y), (0, 1, -1)),
        (make(2 * x, 2 * y), None),
        (make(x), (0, -1, 0)),
        (make(3 * x), (0, -1, 0)),
        (make(x, 1), None),
        (make(x, p * y), None),
        (make(x, y + time), None),
        (make(x, der(y)), None),
        (make(x, y + z), None),
        (make(x * y), None),
    ],
)
def test_aliases(template: Template, alias: tuple[int, int, int] | None) -> None:
    assert template.alias == alias


def test_relations_are_lifted_and_hold_between_events() -> None:
    t = make(y, gl.Piecewise((p * x, x > q), (0, True)))
    assert len(t.relations) == 1
    relation = t.relations[0]
    assert relation.strict
    assert relation.g == (q - x if relation.negated else x - q)
    assert t.relation_columns == (("x", 0),)
    assert not t.linear
    assert make(y, gl.Piecewise((1, time > q), (0, True))).linear  # switches with time only


def test_one_relation_that_stands_twice_is_one() -> None:
    t = make(y, gl.Piecewise((1, x > 0), (0, True)) + z * gl.Piecewise((2, x > 0), (3, True)))
    assert len(t.relations) == 1


def test_absolute_value_sign_and_extrema_are_events() -> None:
    for expression, relations in ((abs(x), 1), (gl.sign(x), 2), (gl.Max(x, y), 1), (gl.Min(x, y, z), 3)):
        assert len(make(z, expression).relations) == relations
    assert make(z, gl.no_event(abs(x))).relations == ()


def test_extrema_that_keep_an_argument_in_its_domain_follow_it_within_a_step() -> None:
    """Their events are located, but the branch that holds up to there is not what is evaluated; so at any depth."""
    own, other = sympy.Piecewise((x, x >= 0), (-x, True)), sympy.Piecewise((p, p >= y), (y, True))
    for expression, relations, value in (
        (abs(x) ** 1.5, 1, own**1.5), (abs(x) ** q, 1, own**q), (gl.log(gl.Max(y, p)) + abs(x), 2, None), (abs(x) ** 2, 0, x**2),
        (gl.sqrt(abs(x) + gl.log(gl.Max(p, y))), 2, sympy.sqrt(own + sympy.log(other))),
        (abs(gl.no_event(abs(x)) - 1) ** 0.5 - abs(gl.no_event(abs(y)) - 2), 2, None),
    ):  # fmt: skip
        t = make(z, expression)
        assert len(t.relations) == relations
        assert {relation_symbol(k) for k in range(relations)} <= t.residual.free_symbols  # or no event would be looked for
        known = {s for r in t.relations for s in r.g.free_symbols} | t.residual.free_symbols
        assert all(s in (x, y, z, p, q) or s.name.startswith("relation") for s in known)
        for held in (0, 1) if value is not None else ():
            flags = {s: held for s in t.residual.free_symbols if s.name.startswith("relation")}
            for point in ({x: -0.7, y: 1.2, p: 1.5, q: 1.7}, {x: 0.3, y: 1.4, p: 1.1, q: -0.3}):
                assert abs(t.residual.subs(flags).subs({z: 0, **point})) == pytest.approx(abs(value.subs(point)))


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        (abs(gl.Piecewise((x, x > -1.2), (-0.12, True))) ** 1.7, lambda v: abs(v if v > -1.2 else -0.12) ** 1.7),
        (gl.sqrt(abs(gl.Table([0.0, 0.5, 2.0], [-1.0, -0.2, 3.0])(x))), lambda v: abs(np.interp(v, [0, 0.5, 2], [-1, -0.2, 3])) ** 0.5),
        (abs(gl.sign(x) * abs(x) ** 1.5) ** 1.7, lambda v: abs(v) ** 2.55),
        (gl.Max(x, gl.no_event(sympy.Float(0.3))) ** 0.5 + abs(gl.no_event(sympy.Float(-0.3))), lambda v: max(v, 0.3) ** 0.5 + 0.3),
    ],
)  # fmt: skip
def test_branches_that_are_not_taken_need_no_real_value(expression: Any, value: Any) -> None:
    """sympy takes the power of each branch."""
    t = make(z, expression)
    for at in (-2.5, -0.7, 0.2, 0.7):
        flags: dict[Any, float] = {}
        for k, r in enumerate(t.relations):
            g = float(r.g.subs(flags | {x: at}))
            flags[relation_symbol(k)] = float(
                g < 0 or (g == 0 and not r.strict) if r.negated else g > 0 or (g == 0 and not r.strict)
            )
        assert abs(float(t.residual.subs(flags | {x: at, z: 0}))) == pytest.approx(value(at))


def test_equality_is_no_event() -> None:
    with pytest.raises(DeclarationError, match="use <, <=, >, >="):
        make(y, gl.Piecewise((1, sympy.Ne(x, 0)), (0, True)))


def test_comparisons_of_discrete_variables_stay_and_those_beside_them_are_lifted() -> None:
    """They change at events only; whichever of the two comes first in the alphabet."""
    for discrete, variable in ((x, y), (y, x)):
        condition = gl.And(discrete > 0, variable > 2)
        lifted, relations = lift_relations(gl.Piecewise((p, condition), (0, True)), lambda name, own=discrete: name == own.name)
        assert [(r.g, r.strict, r.negated) for r in relations] == [(variable - 2, True, False)]
        assert lifted == sympy.Piecewise((p, (discrete > 0) & sympy.Ne(relation_symbol(0), 0)), (0, True))
    equal = sympy.Piecewise((1, sympy.Eq(x, 2)), (0, True))
    assert lift_relations(equal, lambda name: name == "x") == (equal, ())
    with pytest.raises(DeclarationError, match=r"the comparison Eq\(x, 2\): use <, <=, >, >=; equality"):
        lift_relations(equal)


def test_names_of_derivatives() -> None:
    assert parse_column("load.w") == ("load.w", 0)
    assert parse_column("der(der(planets[2].w))") == ("planets[2].w", 2)
    with pytest.raises(NameLookupError, match=r"3 is not a name; names are strings, such as 'load\.w'"):
        parse_column(3)  # type: ignore[arg-type]


def test_the_sign_of_zero_is_zero() -> None:
    written = piecewise(sympy.sign(x))
    assert [written.subs(x, value) for value in (-0.3, 0, 0.3)] == [-1, 0, 1]


def test_parameters_that_multiply_a_variable_are_factors() -> None:
    """At zero the equation loses that variable."""
    assert make(p * x + q * y**2 + z + 3).factors == {"p", "q"}
    assert make(x + p + q * gl.time).factors == set()
    assert make((1 - p) * x + y / q).factors == set()
    assert make(p * q * x + (p + q) * y).factors == {"p", "q"}
    assert make(p * x / gl.cosh(y / q) - z).factors == {"p"}  # no number where q is zero


def test_coefficients_that_may_cancel_are_sums_of_parameters() -> None:
    t = make((1 - p) * x + p * y + 2 * z + (p + q) * gl.time)
    assert [t.columns[c][0] for c in t.cancelling] == ["x"]
    assert make((x + 1) * y + p * z).cancelling == (), "coefficients that change during a run are not known beforehand"
    assert make(2 * x + 3 * y).cancelling == ()


def test_what_remains_at_rest() -> None:
    assert make(p * x + gl.cos(y) + q * time).rest == 1 + q * time
    assert make(x, p).rest == -p


def test_what_belongs_to_no_relation_and_what_to_no_equation() -> None:
    t = make(y, gl.Piecewise((1, gl.der(x) > p), (gl.Piecewise((2, z * x < time), (3, True)), True)))
    assert t.relation_columns == (("x", 1), ("x", 0), ("z", 0)) or set(t.relation_columns) == {("x", 1), ("x", 0), ("z", 0)}
    assert set(t.locals) == {"x", "y", "z"}
    assert t.columns == (("y", 0),)
    assert t.parameters == ("p",)
    assert t.on_time is False, "time decides, but does not stand in a value"


@pytest.mark.parametrize(
    ("condition", "strict", "at"),
    [(x > 1, True, False), (x >= 1, False, True), (x < 1, True, False), (x <= 1, False, True)],
)
def test_relations_know_what_holds_at_the_limit(condition: Any, strict: bool, at: bool) -> None:
    (relation,) = make(y, gl.Piecewise((1, condition), (0, True))).relations
    g = relation.g.subs(x, 1)
    assert (g, relation.strict, not relation.strict) == (0, strict, at)
    above = bool(relation.g.subs(x, 2) < 0) if relation.negated else bool(relation.g.subs(x, 2) > 0)
    assert above == bool(condition.subs(x, 2))


def test_a_parameter_has_no_derivative() -> None:
    """Neither is one by another name an unknown."""
    t = make(x + der(p) + der(q, 2), 3 * der(y))
    assert set(t.columns) == {("x", 0), ("y", 1)}
    assert t.parameters == ()
    assert t.residual == x - 3 * der(y)


@pytest.mark.parametrize(("larger", "extreme"), [(True, gl.Max), (False, gl.Min)])
def test_extrema_written_as_branches(larger: bool, extreme: Any) -> None:
    written = piecewise(extreme(x, y, z))
    assert not written.has(sympy.Max, sympy.Min)
    for point in ((1, 2, 3), (3, 1, 2), (2, 3, 1), (1, 1, 0), (0, 1, 1), (-2, -2, -2)):
        assert written.subs(dict(zip((x, y, z), point, strict=True))) == (max(point) if larger else min(point))
    assert [piecewise(abs(x)).subs(x, v) for v in (-2, 0, 2)] == [2, 0, 2]
    assert [piecewise(abs(sympy.sign(x))).subs(x, v) for v in (-2, 0, 2)] == [1, 0, 1]
    plain = x * y
    assert piecewise(plain) is plain


def test_what_is_decided_last_stands_in_a_comparison() -> None:
    """Its mark is no part of what is compared, and the comparison beside it is decided as any other."""
    t = make(z, gl.Piecewise((1, gl.settled(x - p) + y > 0), (2, x > 0), (0, True)))
    relations = {r.last: r.g for r in t.relations}
    assert relations == {True: x - p + y, False: x}
    for wrong in (gl.settled(x), x * gl.settled(y) + 1, gl.no_event(abs(gl.settled(x)))):
        with pytest.raises(DeclarationError, match=r"settled\([xy]\) is not compared"):
            make(z, wrong)


def test_no_event_means_no_event_at_any_depth() -> None:
    t = make(z, gl.no_event(abs(x) + gl.no_event(gl.Max(y, 1))) + gl.Piecewise((1, x > 0), (0, True)))
    assert len(t.relations) == 1
    free = {s: v for s, v in ((x, -2.0), (y, 3.0), (z, 0.0))}
    flag = next(s for s in t.residual.free_symbols if s.name.startswith("relation"))
    assert float(t.residual.subs(free).subs(flag, 0)) == -5.0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (sympy.oo * x, "expected a real expression"), (x / sympy.S.Zero, "expected a real expression"),
        (sympy.I * x, "expected a real expression"),
        (sympy.Float("1e400") * x, "which is too large for a computer"), (sympy.Function("g")(x), "which is not a function of gearlib$"),
        (sympy.Derivative(x, time), r"not a function of gearlib; the time derivative is gl\.der\(x\)$"),
        (sympy.gamma(x), "not a function of gearlib"),
        (sympy.Sum(x, (y, 1, 3)), "not a function"),
        (gl.Piecewise((1, gl.sample(0.1)), (2, True)), r"holds gl\.sample\(.*at single instants"),
        (sympy.Piecewise((1, x > 1)), r"end it with \(value, True\)"),
    ],
)  # fmt: skip
def test_what_cannot_be_computed_is_refused(wrong: Any, message: str) -> None:
    with pytest.raises(DeclarationError, match=f"^test: the residual .*{message}"):
        make(y + wrong)


def test_a_symbol_of_another_kind_is_the_real_one_of_its_name() -> None:
    t = make(sympy.Symbol("x") + sympy.Symbol("x", positive=True) - y)
    assert t.residual == 2 * x - y
    assert t.residual.free_symbols == {x, y}


class Growth(gl.Component):
    """x' = 2 x + 3 until 0.5 s, then back."""

    relation_0 = gl.Variable("1", "rate, named as the symbol of a relation might be")
    x = gl.Variable("1", "what grows", start=0.0)

    def equations(self) -> list[gl.Eq]:
        forth = gl.Piecewise((1.0, gl.time < 0.5), (-1.0, True))
        return [gl.Eq(self.relation_0, 2.0 * self.x + 3.0), gl.Eq(gl.der(self.x), self.relation_0 * forth)]


def test_a_variable_may_have_any_name_beside_a_relation() -> None:
    found = gl.compile(Growth()).simulate(1.0, samples=3, rtol=1e-10)
    np.testing.assert_allclose(found["x"], [0.0, 1.5 * (np.e - 1.0), 0.0], rtol=1e-8, atol=1e-8)


def test_what_depends_on_time() -> None:
    later = gl.Piecewise((p, time > q), (0, True))
    found = {e: make(y, e) for e in (x + p, x + time, later, gl.Piecewise((p, x > q), (0, True)), gl.sin(time) + later)}
    assert [t.on_time for t in found.values()] == [False, True, False, False, True]
    assert [t.timed for t in found.values()] == [False, True, True, False, True]


def test_comparisons_without_events_can_be_given_some() -> None:
    """Those of parameters alone do not change during a run; they and what had an event keep theirs."""
    silent = gl.no_event(gl.Piecewise((x, x > p), (2 * x, x <= -q), (z, p > q), (time, time >= 1), (3, x < 7), (4, True)))
    quiet = make(y, silent + gl.Piecewise((1, y > 0), (0, True)))
    assert len(quiet.relations) == 1
    found = without_events(quiet)
    assert [str(a) for a in found] == ["p < x", "q <= -x", "time >= 1", "x < 7"]
    chosen = [a for a in found if x in a.free_symbols]
    loud = with_events(quiet, chosen)
    assert loud.relations[0] is quiet.relations[0]
    assert [(r.g, r.strict) for r in loud.relations[1:]] == [
        (a.lhs - a.rhs, bool(a.func in (sympy.Lt, sympy.Gt))) for a in chosen
    ]
    assert [r.negated for r in loud.relations[1:]] == [isinstance(a, sympy.Lt | sympy.Le) for a in chosen]
    assert without_events(loud) == [a for a in found if a not in chosen]
    point = {y: 0.3, z: -4.0, p: 1.0, q: 2.0}
    for at in (-3.0, -2.0, 0.5, 1.0, 1.5, 9.0):
        for when in (0.5, 1.5):
            table = {**point, x: at, time: when}
            flags = {relation_symbol(0): 1} | {relation_symbol(k): int(bool(a.subs(table))) for k, a in enumerate(chosen, 1)}
            assert loud.residual.subs(flags).subs(table) == quiet.residual.subs(flags).subs(table)
