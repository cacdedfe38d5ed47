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


def test_units_are_read() -> None:
    assert dimension("kg.m2/s2") == dimension("N.m") == dimension("J") == dimension("W.s/rad")
    assert name_of(dimension("N.m/rad")) == "kg.m2.s-2"
    assert name_of(dimension("rad")) == "1"
    with pytest.raises(DeclarationError, match="has the factor 'lb'"):
        dimension("lb/m")
