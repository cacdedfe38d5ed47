"""Every component's equations fit the units that it declares."""

from __future__ import annotations

import re
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import DeclarationError
from gearlib.language.units import dimension, name_of
from tests.gearparts.bench import needed_values, structural_choices
from tests.gearparts.test_components import COMPONENTS


@pytest.mark.parametrize("kind", COMPONENTS)
def test_equations_fit_the_declared_units(kind: type[gl.Component]) -> None:
    for choice in structural_choices(kind):
        assert gl.check_units(kind(**needed_values(kind, 1.0), **choice)) == []


def test_friction_and_tables_and_composites_are_looked_into() -> None:
    friction = {"friction": True, "stiffness": "sinusoidal", "error_terms": ((1.0, 1e-6, 0.0),), "use_support": True}
    assert gl.check_units(gp.DetailedExternalMesh(**friction)) == []
    details = {"planet_meshes": "separate", "Z_s": 20, "Z_p": 30, "Z_r": 80, "planets": 4, "sun_details": (("mu", 0.1),)}
    assert gl.check_units(gp.PlanetaryUnit(**details)) == []


class Base(gl.Component):
    """Declares quantities."""

    m = gl.Parameter("kg", "mass")
    k = gl.Parameter("N/m", "stiffness")
    x = gl.Variable("m", "place")
    v = gl.Variable("m/s", "speed")
    flange = gp.TranslationalFlange("rod")


WRONG: list[tuple[Any, str]] = [
    (lambda s: gl.Eq(s.m * gl.der(s.x), -s.k * s.x), r"der\(x\)\*m is in kg\.m\.s-1, -k\*x is in kg\.m\.s-2"),
    (lambda s: gl.Eq(gl.der(s.v), s.v + s.x), r"together in v \+ x|together in x \+ v"),
    (lambda s: gl.Eq(s.v, gl.sin(s.x) * s.v), r"x is in m, and has to be a pure number in sin\(x\)"),
    (lambda s: gl.Eq(s.v, gl.Piecewise((s.v, s.x > s.v), (0, True))), r"together in (x > v|v < x)"),
    (lambda s: gl.Eq(s.flange.f, s.k * s.v), r"flange\.f is in kg\.m\.s-2, k\*v is in kg\.m\.s-3"),
    (lambda s: gl.Eq(s.x, 2 * s.v), r"x is in m, 2\*v is in m\.s-1"),
    (lambda s: gl.Eq(s.x, s.v * gl.time**2), r"x is in m, time\*\*2\*v is in m\.s"),
    (lambda s: gl.Eq(gl.sqrt(s.k / s.m), s.v), r"is in s-1, v is in m\.s-1"),
    (lambda s: gl.When(s.x > s.v, gl.reinit(s.v, s.x)), r"together in (x > v|v < x)"),
]


@pytest.mark.parametrize(("law", "message"), WRONG)
def test_a_misfit_is_found(law: Any, message: str) -> None:
    kind = type("Wrong", (Base,), {"equations": lambda self: [law(self)]})
    assert any(re.search(message, error) for error in gl.check_units(kind()))


def test_a_misfit_of_a_value_given_to_a_part_is_found() -> None:
    class Wrong(gl.Component):
        R = gl.Parameter("m", "radius")
        C = gl.Parameter("N.s/m", "damping")

        def assemble(self) -> Any:
            self.right, self.wrong = gp.Damper(d=self.C * self.R**2), gp.Damper(d=self.C * self.R)
            return []

    assert gl.check_units(Wrong()) == ["Wrong: wrong.d is in kg.m2.s-1, its value C*R in kg.m.s-1"]


def test_a_misfit_is_refused_when_the_class_is_compiled() -> None:
    class Wrong(gl.Component):
        flange = gp.Flange("shaft")
        k = gl.Parameter("N.m/rad", "stiffness", default=2.0)
        w = gl.Variable("rad/s", "speed")
        a = gl.Derivative("w", "rad/s", "acceleration, with the unit of a speed")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.w, gl.der(self.flange.phi)), gl.Eq(self.flange.tau, self.k * self.w)]

    class Train(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.body, self.part = gp.Inertia(J=1.0), Wrong()
            return [gl.connect(self.body.flange_b, self.part.flange)]

    for _ in range(2):
        with pytest.raises(
            DeclarationError, match=r"units do not match .*check_units.*: Wrong: flange\.tau is in .*, k\*w is in"
        ):
            gl.compile(Train())
    assert len(gl.check_units(Train())) == 2
    assert "Wrong: a is in s-1, its value der(w) in s-2" in gl.check_units(Train())


def test_values_given_in_numbers_fit_every_unit() -> None:
    class Right(gl.Component):
        w = gl.Parameter("rad/s", "frequency", default=3.0)

        def assemble(self) -> list[gl.Connection]:
            self.body = gp.Inertia(J=2, start={"w": 2 * self.w})
            self.fan = gp.Torque(tau=-4 * self.body.w)
            self.torque = gp.Torque(tau=10 * gl.sin(2 * gl.pi * 5 * gl.time) + 1.0 * gl.cos(self.w * gl.time))
            return [gl.connect(self.torque.flange, self.body.flange_a, self.fan.flange)]

    assert gl.check_units(Right()) == []
    gl.compile(Right())


def test_a_model_in_numbers_needs_no_units() -> None:
    class Oscillator(gl.Component):
        x, v = gl.Variable("1", start=1.0), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), gl.sin(gl.time) - self.x + 1)]

    assert gl.check_units(Oscillator()) == []


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("rpm", r"'rpm' is not accepted: declare 'rad/s' instead, .*1 rpm is 0\.104719.*known: 1, rad, kg"),
        ("Nms", r"declare 'N\.m\.s' instead"),
        ("Nms/rad", r"has the factor 'Nms', .* declare 'N\.m\.s'"),
        ("kN", r"declare 'N' instead, .*1 kN is 1e3 N"),
        ("mm2", r"declare 'm' instead, .*1 mm is 1e-3 m"),
        ("deg", r"declare 'rad' instead"),
        ("N*m", r"join factors by dots"),
        ("parsec", r"'parsec' is not known; known: 1, rad"),
        ("N/", r"'N/' is not known"),
    ],
)
def test_units_that_are_refused(unit: str, message: str) -> None:
    for declaration in (gl.Parameter, gl.Variable, gl.Input, lambda u: gl.Derivative("x", u)):
        with pytest.raises(DeclarationError, match=message):
            declaration(unit)


def test_units_are_read() -> None:
    assert dimension("kg.m2/s2") == dimension("N.m") == dimension("J") == dimension("W.s/rad")
    assert name_of(dimension("N.m/rad")) == "kg.m2.s-2"
    assert name_of(dimension("rad")) == "1"
    assert dimension("W/(m2.K)") == dimension("W.m-2/K")
    assert dimension("V.A") == dimension("W")
    with pytest.raises(DeclarationError, match="has the factor 'lb'"):
        dimension("lb/m")
