"""One equation of a class, analysed once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
from gearlib.equations.kernel import partial_kernel
from gearlib.equations.template import Template, parse_column, piecewise, template_of
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


def test_equality_is_no_event() -> None:
    with pytest.raises(DeclarationError, match="use <, <=, >, >="):
        make(y, gl.Piecewise((1, sympy.Ne(x, 0)), (0, True)))


def test_names_of_derivatives() -> None:
    assert parse_column("load.w") == ("load.w", 0)
    assert parse_column("der(der(planets[2].w))") == ("planets[2].w", 2)
    with pytest.raises(NameLookupError, match=r"3 is not a name; names are strings, such as 'load\.w'"):
        parse_column(3)  # type: ignore[arg-type]


def test_the_sign_of_zero_is_zero() -> None:
    written = piecewise(sympy.sign(x))
    assert [written.subs(x, value) for value in (-0.3, 0, 0.3)] == [-1, 0, 1]


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
