"""What is written of a component: each declaration, given value, part and connection, in classes and flat."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, ModelicaError
from gearlib.language.component import equations_of
from gearlib.language.declarations import declared_by
from gearlib.modelica.class_writing import integer_discretes


class Inner(gl.Component):
    """Inner part
    with a second line."""

    k = gl.Parameter("1", 'gain "k"', default=2.0, max=5)
    twice = gl.Parameter("any", default=lambda c: 2 * c.k)
    free = gl.Parameter("any", min=-1)
    u = gl.Input("rad", "drive")
    held = gl.Input("any", default=4.0)
    x = gl.Variable("m", start=1.0, nominal=3.0)
    y = gl.Variable("m", guess=2.0, min=0, state="avoid")
    end = gl.Variable("any")
    n = gl.Discrete("count", start=2)
    d = gl.Discrete("held", start=0.5)
    flange = gp.Flange("shaft")

    def equations(self) -> Iterator[Any]:
        yield gl.Eq(gl.der(self.x), self.u * self.k)
        yield gl.Eq(self.y, gl.Piecewise((self.x, self.x > 1), (2, True)))
        yield gl.Eq(self.end, -self.y / 3)
        yield gl.Eq(self.flange.tau, self.n)
        last = gl.When(self.x < 0, gl.Eq(self.d, self.x))
        yield gl.When(self.x > 2, gl.Eq(self.n, gl.pre(self.n) + 1), gl.reinit(self.x, 0), elsewhen=last)


class Outer(gl.Component):
    """A backslash \\ here."""

    J = gl.Parameter("kg.m2", default=2.0, min=0)
    given = gl.Input("any", default=4.0)
    real = gl.Variable("any")
    shaft = gp.Flange()

    def assemble(self) -> Any:
        self.a = Inner(k=3, free=0, u=gl.time, start={"x": 5}, guess={"y": 1}, nominal={"x": 7}, state={"y": "prefer"})
        self.b = [Inner(k=self.J * (i + 1), free=0, start={"x": 5}) for i in range(2)]
        self.i = gp.Inertia(J=self.J, start={"w": 3.0})
        return [gl.connect(self.shaft, self.i.flange_a, self.a.flange), gl.connect(self.b[0].flange, self.b[1].flange)]

    def equations(self) -> Any:
        return [gl.Eq(self.real, self.given + self.a.x)]


def outer() -> gl.Component:
    return Outer(J=9, start={"a.x": 6, "i.w": 4}, guess={"real": 8}, nominal={"real": 10}, state={"a.y": "never"})


def test_declarations_and_equations_of_a_class() -> None:
    text = gl.to_modelica(outer(), name="Train")
    assert text.startswith("package Train\n")
    assert text.endswith("\nend Train;")
    assert (
        text.partition("  model Inner ")[2].partition("  end Inner;")[0]
        == """"Inner part"
    parameter Real k(unit = "1", max = 5.0) = 2.0 "gain \\"k\\"";
    parameter Real twice = 2*k;
    parameter Real free(min = -1.0);
    Modelica.Mechanics.Rotational.Interfaces.Flange_a flange "shaft";
    input Real u(unit = "rad") "drive";
    input Real held = 4.0;
    Real x(unit = "m", start = 1.0, fixed = true, nominal = 3.0);
    Real y(unit = "m", start = 2.0, min = 0.0, stateSelect = StateSelect.avoid);
    Real end_;
    Integer n(start = 2, fixed = true) "count";
    discrete Real d(start = 0.5, fixed = true) "held";
  equation
    der(x) = k*u;
    y = (if x > 1 then x else 2);
    end_ = -y/3;
    flange.tau = n;
    when x > 2 then
      n = pre(n) + 1;
      reinit(x, 0);
      d = pre(d);
    elsewhen x < 0 then
      d = x;
      n = pre(n);
    end when;
"""
    )


def test_parts_with_what_they_are_given() -> None:
    """Values of the root take precedence; what nothing gives becomes an input."""
    assert (
        gl.to_modelica(outer()).partition("  model Outer ")[2]
        == """"A backslash \\\\ here."
    parameter Real J(unit = "kg.m2", min = 0.0) = 9;
    Modelica.Mechanics.Rotational.Interfaces.Flange_a shaft;
    Real given = 4.0;
    Real real(start = 8, nominal = 10.0);
    input Real b_0_u(unit = "rad") "drive";
    input Real b_1_u(unit = "rad") "drive";
    Inner a(k = 3, free = 0, u = time, y(start = 1, stateSelect = StateSelect.never), x(start = 6, fixed = true, nominal = 7.0));
    Inner b[2](k = {J, 2*J}, each free = 0, x(each start = 5, each fixed = true), u = {b_0_u, b_1_u});
    Modelica.Mechanics.Rotational.Components.Inertia i(J = J, w(start = 4, fixed = true));
  equation
    real = a.x + given;
    connect(shaft, i.flange_a);
    connect(shaft, a.flange);
    connect(b[1].flange, b[2].flange);
  end Outer;
end OuterPackage;"""
    )


def test_a_start_value_of_the_root_is_fixed_in_its_part_and_a_guess_is_not() -> None:
    for given, text in (("start", "y(start = 2.5, fixed = true, "), ("guess", "y(start = 2.5, stateSelect")):
        assert text in gl.to_modelica(Outer(**{given: {"a.y": 2.5}}))


@pytest.mark.parametrize("flat", [False, True])
def test_start_values_and_guesses_of_the_root_itself(flat: bool) -> None:
    """A guess in place of a start value leaves the variable free, and the other way round."""
    for given, x, y in (
        ({}, {"start = 1.0", "fixed = true"}, {"start = 2.0"}),
        ({"start": {"x": 4, "y": 5}}, {"start = 4", "fixed = true"}, {"start = 5", "fixed = true"}),
        ({"guess": {"y": 5}, "start": {"x": 4}}, {"start = 4", "fixed = true"}, {"start = 5"}),
        ({"guess": {"y": 5}, "start": {"y": 6}}, {"start = 1.0", "fixed = true"}, {"start = 6", "fixed = true"}),
    ):
        text = gl.to_modelica(Inner(free=1, **given), flat=flat)
        for name, expected in (("x", x), ("y", y)):
            (attributes,) = re.findall(rf"^ +Real {name}\((.*)\);", text, re.MULTILINE)
            assert {a for a in attributes.split(", ") if a.startswith(("start", "fixed"))} == expected


def test_flat_models_have_the_same_declarations_and_expanded_connections() -> None:
    lines = gl.to_modelica(outer(), flat=True).splitlines()
    assert (lines[0], lines[-1]) == ('model Outer "A backslash \\\\ here."', "end Outer;")
    for line in (
        'parameter Real J(unit = "kg.m2", min = 0.0) = 9;',
        "Real given = 4.0;",
        "Real real(start = 8, nominal = 10.0);",
        'Real shaft_phi(unit = "rad") "absolute angle";',
        'parameter Real a_k(unit = "1", max = 5.0) = 3 "gain \\"k\\"";',
        "parameter Real a_twice = 2*a_k;",
        "parameter Real a_free(min = -1.0) = 0;",
        'Integer a_n(start = 2, fixed = true) "count";',
        'discrete Real b_1_d(start = 0.5, fixed = true) "held";',
        'Real a_u(unit = "rad") = time "drive";',
        "Real a_held = 4.0;",
        'Real a_x(unit = "m", start = 6, fixed = true, nominal = 7.0);',
        'Real a_y(unit = "m", start = 1, min = 0.0, stateSelect = StateSelect.never);',
        'input Real b_2_u(unit = "rad") "drive";',
        'parameter Real b_2_k(unit = "1", max = 5.0) = 2*J "gain \\"k\\"";',
        'Real b_2_y(unit = "m", start = 2.0, min = 0.0, stateSelect = StateSelect.avoid);',
        'Real i_w(unit = "rad/s", nominal = 0.01, start = 4, fixed = true) "angular velocity";',
        "real = a_x + given;",
        "der(b_1_x) = b_1_k*b_1_u;",
        "shaft_phi = a_flange_phi;",
        "i_flange_a_phi = a_flange_phi;",
        "a_flange_tau + i_flange_a_tau - shaft_tau = 0;",
        "b_1_flange_tau + b_2_flange_tau = 0;",
        "i_flange_b_tau = 0;",
        "shaft_tau = 0;",
    ):
        assert lines.count(f"  {line}") == 1, line


def test_flat_text_declares_what_the_classes_do() -> None:
    """Read back: the same start values, guesses, nominal values and wishes for each variable."""
    nested = declared_by(gl.read_modelica(gl.to_modelica(Inner(free=1)))()).variables
    flat = declared_by(gl.read_modelica(gl.to_modelica(Inner(free=1), flat=True))()).variables
    for name in ("x", "y", "end_", "u"):
        for own in ("start", "guess", "nominal", "state", "unit"):
            assert getattr(flat[name], own) == getattr(nested[name], own), (name, own)


class Whole(gl.Component):
    """Discrete variables: whole as long as all that is assigned to them is."""

    a, b, c, d, e, f = (gl.Discrete(start=1) for _ in range(6))
    g = gl.Discrete(start=0.5)

    def equations(self) -> Any:
        late = gl.time > 1
        return [
            gl.When(late, gl.Eq(self.a, gl.pre(self.a) * 2 - 1), gl.Eq(self.b, self.a + self.c), gl.Eq(self.c, gl.time)),
            gl.When(gl.time > 2, gl.Eq(self.d, 0.5), elsewhen=gl.When(gl.time > 3, gl.Eq(self.d, 2))),
            gl.Eq(self.e, gl.Piecewise((1, late), (self.a, gl.time > 2), (3, True))),
            gl.Eq(self.f, gl.Piecewise((1, late), (gl.time, True))),
            gl.When(late, gl.Eq(self.g, 2)),
        ]


def test_discrete_variables_with_whole_values_are_integers() -> None:
    component = Whole()
    assert integer_discretes(equations_of(component), declared_by(component).discretes) == {"a", "e"}


def composite(make: Callable[[Any], Any]) -> Any:
    return type("Composite", (gl.Component,), {"__doc__": None, "assemble": lambda self: make(self) or []})()


def members(make: Callable[[Any], Any], **options: Any) -> list[str]:
    """The declarations of a component with parts."""
    text = gl.to_modelica(composite(make), **options)
    return [line.strip() for line in text.partition("  model Composite\n")[2].partition("  end Composite;")[0].splitlines()]


def test_members_of_a_family_that_differ_stand_alone() -> None:
    def make(self: Any) -> Any:
        self.links = [gp.Spring(c=2.0), gp.Damper(d=3.0)]
        self.same = [gp.Spring(c=2.0), gp.Spring(c=2.0), gp.Spring(c=2.0)]
        self.apart = [gp.Fixed(phi0=1.0), gp.Fixed()]
        self.outer = gp.Fixed()
        return [
            gl.connect(self.links[0].flange_a, self.links[1].flange_a),
            gl.connect(self.same[2].flange_a, self.outer.flange),
        ]

    parts = "Modelica.Mechanics.Rotational.Components"
    assert members(make) == [
        f"{parts}.Spring links_0(c = 2.0);", f"{parts}.Damper links_1(d = 3.0);", f"{parts}.Spring same[3](each c = 2.0);",
        f"{parts}.Fixed apart_0(phi0 = 1.0);", f"{parts}.Fixed apart_1;", f"{parts}.Fixed outer_;",
        "equation", "connect(links_0.flange_a, links_1.flange_a);", "connect(same[3].flange_a, outer_.flange);",
    ]  # fmt: skip


def test_choices_are_written_as_modelica_has_them() -> None:
    def make(self: Any) -> Any:
        self.gear = gp.IdealGear(ratio=2.0, use_support=True)
        self.sign = gp.SignTorque(tau_nominal=1.0, reg="cosine")
        self.table = gp.blocks.CombiTimeTable(table=((0, 1), (1, 2)))
        self.step = gp.blocks.Step(height=2.0)

    assert members(make)[:4] == [
        "Modelica.Mechanics.Rotational.Components.IdealGear gear(useSupport = true, ratio = 2.0);",
        "Modelica.Mechanics.Rotational.Sources.SignTorque sign(reg = Modelica.Blocks.Types.Regularization.CoSine, tau_nominal = 1.0);",
        "Modelica.Blocks.Sources.CombiTimeTable table(table = [0.0, 1.0; 1.0, 2.0]);",
        "Modelica.Blocks.Sources.Step step(height = 2.0);",
    ]


def test_what_the_library_does_not_have_is_written_as_a_class() -> None:
    """A value of a parameter that Modelica's class lacks, and two sets of choices of one class."""

    def make(self: Any) -> Any:
        self.plain, self.other = gp.IdealGear(ratio=2.0), gp.IdealGear(ratio=3.0, use_support=True)
        self.again = gp.IdealGear(ratio=4.0)

    found = members(make, standard_library=False)
    assert found == ["IdealGear plain(ratio = 2.0);", "IdealGear_2 other(ratio = 3.0);", "IdealGear again(ratio = 4.0);"]
    assert gl.to_modelica(type("Real", (gl.Component,), {})(), name="P") == "package P\n  model Real_\n  end Real_;\nend P;"


class Accelerated(gl.Component):
    y = gl.Variable("rad/s2")

    def assemble(self) -> Any:
        self.i = gp.Inertia(J=2.0)
        return []

    def equations(self) -> Any:
        return [gl.Eq(self.y, 2 * self.i.a)]


class Left(gl.Connector):
    """Of one module."""

    v, i = gl.Potential("V"), gl.Flow("V")


class Right(gl.Connector):
    """Of another."""

    p, q = gl.Potential("Pa"), gl.Flow("Pa")


Left.__name__ = Right.__name__ = "Pin"


def test_classes_of_one_name_are_told_apart() -> None:
    """Connectors, and the classes of parts with one of their names."""

    def of(pin: gl.Connector, name: str) -> gl.Component:
        equations = lambda self: [gl.Eq(*(getattr(self.pin, variable) for variable in pin.variables))]  # noqa: E731
        return type(name, (gl.Component,), {"pin": pin, "equations": equations})()

    def make(self: Any) -> Any:
        self.a, self.b, self.c, self.d = (
            of(Left("end"), "A"),
            of(Right("end"), "B"),
            of(Left("end"), "C"),
            of(Right("end"), "Pin"),
        )

    text = gl.to_modelica(composite(make))
    declared = [line.strip() for line in text.splitlines() if line.startswith(("  connector", "  model", "    Pin"))]
    assert declared == [
        'connector Pin "Of one module."', "model A", 'Pin pin "end";', 'connector Pin_2 "Of another."', "model B", 'Pin_2 pin "end";',
        "model C", 'Pin pin "end";', "model Pin_3", 'Pin_2 pin "end";', "model Composite", "Pin_3 d;",
    ]  # fmt: skip
    read = gl.compile(gl.read_modelica(text)()).translation
    assert [read.unit(f"{part}.pin.{name}") for part, name in (("a", "v"), ("b", "q"), ("c", "i"), ("d", "p"))] == [
        "V",
        "Pa",
    ] * 2


def test_names_in_a_class_are_unique() -> None:
    """What is made of a member's name, or of an input within a part, gives way to what has that name already."""

    def taking(name: str) -> gl.Component:
        equations = lambda self: [gl.Eq(self.y, getattr(self, name))]  # noqa: E731
        return type(f"Taking_{name}", (gl.Component,), {name: gl.Input("m"), "y": gl.Variable("m"), "equations": equations})()

    def make(self: Any) -> Any:
        self.links, self.links_0 = [gp.Spring(c=1.0), gp.Damper(d=2.0)], gp.Inertia(J=3.0)
        self.a, self.a_b, self.a_b_c = taking("b_c"), taking("c"), taking("d")
        return [gl.connect(self.links[0].flange_a, self.links_0.flange_b)]

    parts = "Modelica.Mechanics.Rotational.Components"
    assert members(make) == [
        *(f'input Real {name}(unit = "m");' for name in ("a_b_c_2", "a_b_c_3", "a_b_c_d")),
        f"{parts}.Spring links_0_2(c = 1.0);", f"{parts}.Damper links_1(d = 2.0);", f"{parts}.Inertia links_0(J = 3.0);",
        "Taking_b_c a(b_c = a_b_c_2);", "Taking_c a_b(c = a_b_c_3);", "Taking_d a_b_c(d = a_b_c_d);",
        "equation", "connect(links_0_2.flange_a, links_0.flange_b);",
    ]  # fmt: skip


class Nested(gl.Component):
    """Members that stand alone, a name that Modelica has taken, and a family."""

    def assemble(self) -> Any:
        self.links, self.outer = [gp.Inertia(J=1.0), gp.Damper(d=1.0)], gp.Inertia(J=2.0)
        self.own, self.spin = [Accelerated(), gp.Fixed()], [gp.Inertia(J=1.0), gp.Inertia(J=2.0)]
        return []


def test_what_is_given_from_above_reaches_parts_by_their_written_names() -> None:
    def make(self: Any) -> Any:
        self.sub = Nested(start={"links[0].w": 2.0}, nominal={"outer.w": 3.0}, state={"own[0].i.w": "prefer"})

    assert members(make) == [
        "Nested sub(links_0(w(start = 2.0, fixed = true)), outer_(w(nominal = 3.0)), own_0(i(w(stateSelect = StateSelect.prefer))));",
    ]


def partly(self: Any) -> Any:
    self.i = [gp.Inertia(J=1.0, nominal={"w": 2.0}), gp.Inertia(J=2.0)]


def within_a_family(self: Any) -> Any:
    self.sub = Nested(start={"spin[1].w": 2.0})


def taken_twice(self: Any) -> Any:
    self.outer, self.outer_ = gp.Inertia(J=1.0), gp.Inertia(J=2.0)


def beneath(self: Any) -> Any:
    self.a, self.b = Outer(), gp.Inertia(J=1.0)
    return [gl.connect(self.a.i.flange_b, self.b.flange_a)]


def signalled(self: Any) -> Any:
    self.a, self.b = Outer(), gp.Inertia(J=1.0)
    return [gl.connect(self.b.w, self.a.a.u)]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (partly, "'nominal' is given to some parts of a family only; flat=True writes such a model"),
        (within_a_family, "sub.spin[1].w is one of a family in its class, or a derivative; flat=True writes such a model"),
        (taken_twice, "Composite: outer_ would be called outer_, as another one is; flat=True writes such a model"),
        (signalled, "u of a part within a part takes a signal; flat=True writes such a model"),
        (beneath, "<Flange a.i.flange_b> is a connector of a part within a part, which Modelica does not connect; "
                      "flat=True writes such a model"),
    ],
)  # fmt: skip
def test_what_only_flat_models_can_say(make: Callable[[Any], Any], said: str) -> None:
    with pytest.raises(ModelicaError) as problem:
        gl.to_modelica(composite(make))
    assert str(problem.value) == said
    assert gl.to_modelica(composite(make), flat=True)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"flat": 1}, "to_modelica: flat is 1; expected True or False"),
        ({"standard_library": None}, "to_modelica: standard_library is None; expected True or False"),
        ({"name": "2x"}, "to_modelica: name is '2x'; expected letters, digits and underscores, such as 'Drive'"),
        ({"name": 3}, "to_modelica: name is 3; expected letters, digits and underscores, such as 'Drive'"),
        ({"name": "a b"}, "to_modelica: name is 'a b'; expected letters, digits and underscores, such as 'Drive'"),
    ],
)
def test_options_are_checked(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError) as problem:
        gl.to_modelica(Inner(), **options)
    assert str(problem.value) == said


def test_a_derivative_with_a_name_of_its_own_is_written_as_one() -> None:
    assert "  y = 2*der(i_w);" in gl.to_modelica(Accelerated(), flat=True).splitlines()
    assert "    y = 2*der(i.w);" in gl.to_modelica(Accelerated()).splitlines()


class Jerk(gl.Component):
    """A derivative of a derivative, both with names."""

    w, y = gl.Variable("rad/s"), gl.Variable("rad/s3")
    a, j = gl.Derivative("w"), gl.Derivative("a")

    def equations(self) -> Any:
        return [gl.Eq(self.w, gl.sin(gl.time)), gl.Eq(self.y, self.j)]


class Shaken(gl.Component):
    y = gl.Variable("rad/s3")

    def assemble(self) -> Any:
        self.jerk = Jerk()
        return []

    def equations(self) -> Any:
        return [gl.Eq(self.y, 2 * self.jerk.j)]


def test_names_of_derivatives_are_written_as_what_they_stand_for() -> None:
    lines = [line.strip() for line in gl.to_modelica(Shaken()).splitlines()]
    assert "y = der(der(w));" in lines
    assert "y = 2*der(der(jerk.w));" in lines
    flat = [line.strip() for line in gl.to_modelica(Shaken(), flat=True).splitlines()]
    assert "jerk_y = der(der(jerk_w));" in flat
    assert "y = 2*der(der(jerk_w));" in flat


def test_flat_names_are_unique() -> None:
    class Twice(gl.Component):
        a_x = gl.Variable("any", start=math.pi)

        def assemble(self) -> Any:
            self.a, self.a_ = [Inner(u=1, free=1)], Inner(u=2, free=1)
            self.a_1 = Inner(u=3, free=1)
            return []

        def equations(self) -> Any:
            return [gl.Eq(gl.der(self.a_x), self.a[0].x + self.a_1.x)]

    text = gl.to_modelica(Twice(), flat=True)
    assert "  der(a_x) = a_1_x + a_1_x_2;" in text
    assert '  Real a_1_u_2(unit = "rad") = 3 "drive";' in text
    assert f"  Real a_x(start = {math.pi}, fixed = true);" in text


class Sampling(gl.Component):
    """Blocks whose names, arrays or start values are others in Modelica's library."""

    def assemble(self) -> list[gl.Connection]:
        B = gp.blocks
        self.plan, self.wave = B.KinematicPTP(deltaq=4.0, qd_max=2.0, qdd_max=4.0), B.Sine(f=2.0)
        self.twice, self.late = B.Gain(k=2.0), B.UnitDelay(sample_period=0.1, u=gl.time, start={"taken": 7.0})
        self.taken = B.TriggeredSampler(u=gl.time, trigger=0.0, start={"held": 3.0})
        self.switch = B.Hysteresis(u_low=-1.0, u_high=2.0, u=gl.time, start={"on": 1.0})
        return [gl.connect(self.plan.y, self.twice.u)]


def test_what_the_standard_library_has_not_is_not_modified_in_its_classes() -> None:
    text = gl.to_modelica(Sampling())
    for line in (
        "Modelica.Blocks.Sources.KinematicPTP plan(deltaq = {4.0}, qd_max = {2.0}, qdd_max = {4.0});",
        "Modelica.Blocks.Sources.Sine wave(f = 2.0);",
        "Modelica.Blocks.Math.Gain twice(k = 2.0, u = plan.y[1]);",
        "  UnitDelay late(sample_period = 0.1, u = time, taken(start = 7.0, fixed = true));",
        "  TriggeredSampler taken(u = time, trigger = 0.0, held(start = 3.0, fixed = true));",
        "  Hysteresis switch(u_low = -1.0, u_high = 2.0, u = time, on(start = 1.0, fixed = true));",
    ):
        assert line in text
    times = np.linspace(0.03, 2.97, 22)
    ours = gl.simulate(Sampling(), t_end=3.0, times=times)
    for standard_library in (True, False):
        read = gl.simulate(
            gl.read_modelica(gl.to_modelica(Sampling(), standard_library=standard_library))(), t_end=3.0, times=times
        )
        for name in ("twice.y", "wave.y", "late.y", "taken.y", "switch.y"):
            assert read[name] == pytest.approx(ours[name], abs=1e-9), name
