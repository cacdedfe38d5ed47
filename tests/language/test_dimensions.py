"""What is compared with a declared unit when the values of parts are checked."""

from __future__ import annotations

from typing import Any

import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.errors import DeclarationError, ModelError
from gearlib.language.dimensions import values_given
from gearlib.language.units import dimension


class Given(gl.Component):
    """Numbers and expressions, as parameters, start values and guesses."""

    angle = gl.Parameter("rad", default=0.1)
    inertia = gl.Parameter("kg.m2", default=2.0)

    def assemble(self) -> list[Any]:
        self.body = gp.Inertia(J=self.inertia, start={"w": 3.0, "phi": self.angle})
        self.load = gp.Inertia(J=1.0, start={"phi": 2}, guess={"w": 2 * self.angle})
        return [gl.connect(self.body.flange_b, self.load.flange_a)]


def test_expressions_are_compared_and_plain_numbers_are_in_the_declared_unit() -> None:
    given = Given()
    assert sorted((str(value), unit, where) for value, unit, where in values_given(given)) == [
        ("2*angle", dimension("rad/s"), "the start value of load.w"),
        ("angle", dimension("rad"), "the start value of body.phi"),
        ("inertia", dimension("kg.m2"), "body.J"),
    ]


class Leaf(gl.Component):
    """Names of several units, for one equation."""

    flange = gp.Flange("shaft")
    m, L, n = gl.Parameter("kg", "mass"), gl.Parameter("m", "length"), gl.Parameter("1", "number")
    x, v, phi = gl.Variable("m", "place"), gl.Variable("m/s", "speed"), gl.Variable("rad", "angle")
    y, mode = gl.Variable("any", "signal"), gl.Discrete("mode")


class Symbols:
    """The symbols of a leaf, as messages print them."""

    def __getattr__(self, name: str) -> Any:
        return Symbols() if name == "flange" else sympy.Symbol("flange.tau" if name == "tau" else name, real=True)


def errors(left: Any, right: Any) -> list[str]:
    return gl.check_units(type("Leaf", (Leaf,), {"equations": lambda s: [gl.Eq(left(s), right(s))]})())


@pytest.mark.parametrize(
    ("left", "right"),
    [
        (lambda s: s.v, lambda s: gl.der(s.x)), (lambda s: s.x, lambda s: 0), (lambda s: s.x, lambda s: 2.5),
        (lambda s: s.x, lambda s: gl.sin(3 * gl.time)),
        (lambda s: s.m * s.v**2 / 2, lambda s: s.flange.tau * s.phi), (lambda s: s.x, lambda s: s.L * gl.sin(s.phi)),
        (lambda s: s.v, lambda s: 9.81 * gl.time),
        (lambda s: s.x, lambda s: gl.sqrt(s.L * s.x)), (lambda s: s.phi, lambda s: gl.atan2(s.x, s.L)),
        (lambda s: s.n, lambda s: gl.sign(s.v)),
        (lambda s: s.x, lambda s: gl.Piecewise((s.L, s.v > 0), (0, True))), (lambda s: s.x, lambda s: gl.Max(s.L, 3.0)),
        (lambda s: s.y, lambda s: s.x),
        (lambda s: s.x + s.y, lambda s: s.v), (lambda s: gl.der(s.y), lambda s: s.m), (lambda s: s.x, lambda s: s.mode * s.L),
        (lambda s: s.x, lambda s: 2.5 * s.v),
        (lambda s: s.n, lambda s: gl.exp(s.x / s.L)), (lambda s: s.x, lambda s: abs(s.L)), (lambda s: s.x, lambda s: s.v * gl.time),
        (lambda s: s.x, lambda s: (s.L * s.x) ** 0.5),
        (lambda s: gl.der(s.n) * s.L, lambda s: s.v), (lambda s: s.x / s.L**3, lambda s: (s.L * s.x) ** -1),
        (lambda s: s.x, lambda s: s.L * s.n**s.n),
        (lambda s: s.flange.phi, lambda s: s.phi * gl.cos(2 * gl.time)), (lambda s: s.x, lambda s: s.v * gl.time**2 / gl.time),
        (lambda s: s.x, lambda s: gl.no_event(s.L)), (lambda s: s.x, lambda s: s.v * (1 + gl.time)),
        (lambda s: s.x, lambda s: s.L * gl.exp(-gl.time) * gl.sin(gl.time)),
        (lambda s: s.x, lambda s: s.v**sympy.oo), (lambda s: s.x, lambda s: s.v ** sympy.Rational(10**400, 3)),
    ],
)  # fmt: skip
def test_sides_that_fit(left: Any, right: Any) -> None:
    assert errors(left, right) == []
    assert errors(right, left) == []


@pytest.mark.parametrize(
    ("left", "right", "message"),
    [
        (lambda s: s.v, lambda s: s.x, "Leaf: v is in m.s-1, x is in m"),
        (lambda s: s.x, lambda s: 2 * s.v, "Leaf: x is in m, 2*v is in m.s-1"),
        (lambda s: s.x, lambda s: s.L + s.v, "Leaf: L is in m, v is in m.s-1, together in L + v (in x = L + v)"),
        (lambda s: s.x, lambda s: s.L**2, "Leaf: x is in m, L**2 is in m2"),
        (lambda s: s.n, lambda s: gl.sin(s.x), "Leaf: x is in m, and has to be a pure number in sin(x) (in n = sin(x))"),
        (lambda s: s.n, lambda s: 2 * s.x / s.v, "Leaf: n is in 1, 2*x/v is in s"),
        (lambda s: s.n, lambda s: s.n**s.L, "Leaf: L is in m, and has to be a pure number in n**L (in n = n**L)"),
        (lambda s: s.x, lambda s: gl.sqrt(s.L), "Leaf: x is in m, sqrt(L) is in m1/2"),
        (lambda s: s.n, lambda s: gl.atan2(s.x, s.v), "Leaf: x is in m, v is in m.s-1, together in atan2(x, v) (in n = atan2(x, v))"),
        (lambda s: s.x, lambda s: s.L * gl.time, "Leaf: x is in m, L*time is in m.s"),
        (lambda s: s.x, lambda s: gl.Max(s.L, s.v), "Leaf: L is in m, v is in m.s-1, together in Max(L, v) (in x = Max(L, v))"),
        (lambda s: s.x, lambda s: s.n * s.phi, "Leaf: x is in m, n*phi is in 1"),
        (lambda s: s.x, lambda s: gl.Piecewise((s.L, s.v > s.x), (0, True)),
         "Leaf: v is in m.s-1, x is in m, together in v > x (in x = {})"),
        (lambda s: s.x, lambda s: gl.Piecewise((s.L, s.v > 0), (s.v, True)),
         "Leaf: L is in m, v is in m.s-1, together in {0} (in x = {0})"),
        (lambda s: s.x, lambda s: gl.Piecewise((0, s.v > 0), (s.L, s.v > -1), (s.v, True)),
         "Leaf: L is in m, v is in m.s-1, together in {0} (in x = {0})"),
        (lambda s: s.v, lambda s: gl.der(gl.der(s.x)), "Leaf: v is in m.s-1, der(der(x)) is in m.s-2"),
        (lambda s: s.m, lambda s: s.flange.tau, "Leaf: m is in kg, flange.tau is in kg.m2.s-2"),
        (lambda s: s.x, lambda s: s.v * gl.sin(3 * gl.time), "Leaf: x is in m, v*sin(3*time) is in m.s-1"),
        (lambda s: s.x, lambda s: s.L * gl.time**2, "Leaf: x is in m, L*time**2 is in m.s2"),
    ],
)  # fmt: skip
def test_sides_that_do_not_fit(left: Any, right: Any, message: str) -> None:
    assert errors(left, right) == [message.format(right(Symbols()))]


class Holder(gl.Component):
    """Gives an expression to a part."""

    J, k, w_0 = gl.Parameter("kg.m2", default=1.0), gl.Parameter("N.m.s/rad", default=1.0), gl.Parameter("rad/s", default=1.0)
    ratio = gl.Parameter("1", default=2.0)
    given: Any = None

    def assemble(self) -> list[Any]:
        self.load = gp.Inertia(J=self.J)
        self.torque = gp.Torque(**type(self).given(self))
        return [gl.connect(self.torque.flange, self.load.flange_a)]


@pytest.mark.parametrize(
    ("given", "found"),
    [
        (lambda s: {"tau": -s.k * s.load.w}, []), (lambda s: {"tau": -4 * s.load.w}, []), (lambda s: {"tau": 4}, []),
        (lambda s: {"tau": 5 * s.ratio}, []),
        (lambda s: {"tau": -s.load.w}, ["Holder: torque.tau is in kg.m2.s-2, its value -load.w in s-1"]),
        (lambda s: {"tau": s.ratio}, []),
        (lambda s: {"tau": s.k * s.J}, ["Holder: torque.tau is in kg.m2.s-2, its value J*k in kg2.m4.s-1"]),
        (lambda s: {"tau": gl.sin(3 * gl.time)}, []),
        (lambda s: {"tau": s.k + s.J}, ["Holder: J is in kg.m2, k is in kg.m2.s-1, together in J + k (in the value of torque.tau)"]),
    ],
)  # fmt: skip
def test_values_given_to_parts(given: Any, found: list[str]) -> None:
    """A number in front may carry a unit there, but nothing else may; a pure number is in the declared unit."""
    assert gl.check_units(type("Holder", (Holder,), {"given": staticmethod(given)})()) == found


def test_names_are_looked_up_in_parts_of_parts_and_in_their_connectors() -> None:
    class Outer(gl.Component):
        def assemble(self) -> list[Any]:
            self.box = Holder()
            load = self.box.load
            self.right, self.one = gp.Torque(tau=2 * load.flange_a.tau), gp.Torque(tau=-load.w)
            self.two, self.three = (
                gp.Torque(tau=load.flange_a.phi * load.w),
                gp.Torque(tau=gl.der(load.w) * self.box.J * load.w),
            )
            return []

    class Holder(gl.Component):
        J = gl.Parameter("kg.m2", default=1.0)

        def assemble(self) -> list[Any]:
            self.load = gp.Inertia(J=self.J)
            return []

    found = {message.split(".")[0]: message.rpartition(" in ")[2] for message in gl.check_units(Outer())}
    assert found == {"Outer: one": "s-1", "Outer: two": "s-1", "Outer: three": "kg.m2.s-3"}


def test_of_expressions_that_are_too_deep_the_place_is_named() -> None:
    def deep(x: Any) -> Any:
        for _ in range(131):
            x = sympy.sin(x, evaluate=False)
        return x

    for left, right in ((lambda s: deep(s.n), lambda s: 1), (lambda s: s.n, lambda s: deep(s.n))):
        with pytest.raises(DeclarationError, match=r"^Leaf: an expression is nested too deeply"):
            errors(left, right)
    with pytest.raises(DeclarationError, match=r"^torque\.tau: an expression is nested too deeply"):
        gl.check_units(type("Holder", (Holder,), {"given": lambda s: {"tau": deep(s.ratio)}})())


def test_defaults_and_derivatives_and_actions_are_compared() -> None:
    class Wrong(gl.Component):
        L, area = gl.Parameter("m", default=1.0), gl.Parameter("m2", "area", default=lambda s: s.L**3)
        x, a = gl.Variable("m", "place"), gl.Derivative("x", "m/s2", "rate")
        n = gl.Discrete("count")

        def equations(self) -> list[Any]:
            jump = gl.When(self.x > self.area, gl.reinit(self.x, self.area), gl.Eq(self.n, gl.pre(self.n) + 1))
            return [gl.Eq(gl.der(self.x), -self.x * gl.time), jump]

    assert sorted(gl.check_units(Wrong())) == [
        "Wrong: a is in m.s-2, its value der(x) in m.s-1",
        "Wrong: area is in m2, x is in m, together in area < x (in x > area = 0)",
        "Wrong: der(x) is in m.s-1, -time*x is in m.s",
        "Wrong: the default of area is in m2, its value L**3 in m3",
        "Wrong: x is in m, area is in m2",
    ]


def test_defaults_of_a_component_with_nothing_but_parameters_are_compared() -> None:
    class Sizes(gl.Component):
        L, area = gl.Parameter("m", default=1.0), gl.Parameter("m2", default=lambda s: s.L**3)

    assert gl.check_units(Sizes()) == ["Sizes: the default of area is in m2, its value L**3 in m3"]


@pytest.mark.parametrize(
    ("of", "unit"), [("v", "m/s2"), ("flange.phi", "rad/s"), ("flange.tau", "N.m/s"), ("mode", "m"), ("y", "m"), ("other", "m")]
)
def test_the_unit_of_a_derivative_is_that_of_its_variable_per_second(of: str, unit: str) -> None:
    """Also of a connector's; what has no unit or is not there may have any."""
    assert gl.check_units(type("Right", (Leaf,), {"rate": gl.Derivative(of, unit)})()) == []
    found = gl.check_units(type("Wrong", (Leaf,), {"rate": gl.Derivative(of, "kg")})())
    assert [message.partition(", its value")[0] for message in found] == ([] if unit == "m" else ["Wrong: rate is in kg"])


def test_signals_that_are_joined_have_the_unit_of_the_first() -> None:
    """Each of them is compared; angles count as numbers."""

    def found(*names: str) -> list[str]:
        class Joined(gl.Component):
            def assemble(self) -> list[Any]:
                self.one, self.other, self.speed, self.angle = gp.Torque(), gp.Torque(), gp.SpeedSensor(), gp.AngleSensor()
                signals = {"one": self.one.tau, "other": self.other.tau, "speed": self.speed.w, "angle": self.angle.phi}
                return [gl.connect(*(signals[name] for name in names))]

        return gl.check_units(Joined())

    assert found("one", "other") == []
    assert found("one", "speed") == ["Joined: one.tau is in kg.m2.s-2, speed.w is in s-1"]
    assert found("speed", "one", "other") == [
        f"Joined: speed.w is in s-1, {name}.tau is in kg.m2.s-2" for name in ("one", "other")
    ]
    assert found("one", "other", "angle") == ["Joined: one.tau is in kg.m2.s-2, angle.phi is in 1"]


def test_powers_without_a_dimension_hide_no_other_mismatch() -> None:
    """Of a number with a unit that is not known, and with an exponent that is none."""

    class Raised(gl.Component):
        x, y = gl.Variable("m"), gl.Variable("m")
        factor, exponent = gl.Structural(1.0), gl.Structural(None)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.x), gl.Eq(self.y, sympy.Pow(self.factor * (self.x + 0.5), self.exponent))]

    for factor in (1.0, 2.5):
        with pytest.raises(DeclarationError, match=r"units do not match .*: Raised: der\(x\) is in m\.s-1, x is in m"):
            gl.compile(Raised(factor=factor, exponent=2))
        for endless in (sympy.oo, -sympy.oo):
            with pytest.raises(
                DeclarationError, match=r"^Raised: y = .*; expected a real expression of variables and parameters"
            ):
                gl.compile(Raised(factor=factor, exponent=endless))


def test_only_components_have_units_to_check() -> None:
    with pytest.raises(ModelError, match=r"expected a component, got <class .*Leaf'>; make an instance: Leaf\(\)"):
        gl.check_units(Leaf)  # type: ignore[arg-type]
