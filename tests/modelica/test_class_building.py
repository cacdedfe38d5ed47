"""Classes of Modelica text as component classes: what they declare, which equations they have, and what is refused."""

from __future__ import annotations

import re
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import GearlibWarning, ModelicaError
from gearlib.language.component import equations_of
from gearlib.language.declarations import NO_VALUE, declared_by
from gearlib.language.interior import connections_of, parts_of

AROUND = """
package P
  import Modelica.Mechanics.Rotational.{Components, Interfaces, Sources};
  constant Real two = 2;
  type Level = enumeration(low, high);
  type Stiffness = Modelica.Units.SI.RotationalSpringConstant(min = 0, start = 3);
  type Hard = Stiffness(max = 10);
  connector Pin
    Real v(unit = "V") "level";
    flow Real i(unit = "A") "current";
  end Pin;
  connector Signal = input Real;
  partial model Base
    parameter Real k = 1;
    Real x(start = 1);
  end Base;
  function f input Real x; end f;
"""


def read(text: str) -> type[gl.Component]:
    return gl.read_modelica(f"{AROUND} model M {text} end M; end P;")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("parameter Real y = 3 \"why\";", gl.Parameter("any", "why", default=3.0)),
        ("parameter Real y;", gl.Parameter("any", "")),
        ("parameter Real y(min = 1, max = 2, unit = \"rad\") = 2;", gl.Parameter("rad", "", default=2.0, min=1.0, max=2.0)),
        ("parameter Real y(unit = \"km/h\") = 2;", gl.Parameter("any", "", default=2.0)),
        ("parameter Stiffness y = 4;", gl.Parameter("N.m/rad", "", default=4.0, min=0.0)),
        ("parameter Hard y(min = 2) = 4;", gl.Parameter("N.m/rad", "", default=4.0, min=2.0, max=10.0)),
        ("parameter Modelica.Units.SI.Unheard y = 4;", gl.Parameter("any", "", default=4.0)),
        ("parameter Integer y = 4;", gl.Structural(4, "")),
        ("parameter Integer n = 2; parameter Integer y = n + 1;", gl.Structural(None, "")),
        ("parameter Boolean y = two > 1;", gl.Structural(True, "")),
        ("parameter Level y = Level.high;", gl.Structural("high", "")),
        ("parameter StateSelect y = StateSelect.avoid;", gl.Structural("avoid", "")),
        ("parameter Modelica.Blocks.Types.Init y = Modelica.Blocks.Types.Init.NoInit;", gl.Structural("NoInit", "")),
        ("parameter String y = \"text\";", gl.Structural("text", "")),
        ("parameter Real y[2] = {1, 2};", gl.Structural((1, 2), "")),
        ("parameter Integer y;", gl.Structural(None, "")),
        ("constant Real y = 4;", None),
        ("input Real y;", gl.Input("any", "")),
        ("input Real y = 4;", gl.Input("any", "", default=4.0)),
        ("Signal y;", gl.Input("any", "")),
        ("Modelica.Blocks.Interfaces.RealInput y;", gl.Input("any", "")),
        ("Modelica.Blocks.Interfaces.RealOutput y;", gl.Variable("any", "")),
        ("output Real y \"out\";", gl.Variable("any", "out")),
        ("Real y(start = 3, nominal = 5);", gl.Variable("any", "", guess=3.0, nominal=5.0)),
        ("Real y(start = 3, fixed = true, stateSelect = StateSelect.always);", gl.Variable("any", "", start=3.0, state="prefer")),
        ("Real y(start = 3, fixed = false);", gl.Variable("any", "", guess=3.0)),
        ("Real y(fixed = true);", gl.Variable("any", "", start=0.0)),
        ("parameter Real k = 3; Real y(start = k, nominal = k);", gl.Variable("any", "")),
        ("Stiffness y;", gl.Variable("N.m/rad", "", guess=3.0, min=0.0)),
        ("Real y(min = 1, max = 2);", gl.Variable("any", "", min=1.0)),
        ("parameter Real k = 3; Real y(min = k);", gl.Variable("any", "")),
        ("discrete Real y;", gl.Discrete("")),
        ("discrete Real y(start = 3) \"held\";", gl.Discrete("held", start=3.0)),
        ("Integer y(start = two);", gl.Discrete("", start=2.0)),
        ("Boolean y(start = true);", gl.Discrete("", start=1.0)),
        ("Real y; equation when time > 1 then y = 1; end when;", gl.Discrete("")),
        ("Real y; initial equation y = 1;", gl.Variable("any", "")),
        ("extends Base(k = 2); Real y;", gl.Variable("any", "")),
    ],
)  # fmt: skip
def test_declarations(text: str, expected: Any) -> None:
    found = vars(read(text)).get("y")
    assert type(found) is type(expected)
    for name, value in vars(expected).items() if expected is not None else ():
        assert getattr(found, name) == value, name


def test_connectors() -> None:
    kind = read('Pin p "one"; parameter Boolean on = true; Pin q if on; Interfaces.Flange_a a "shaft";')
    pin, q, flange = (vars(kind)[name] for name in "pqa")
    assert {name: (type(v), v.unit, v.description) for name, v in pin.variables.items()} == {
        "v": (gl.Potential, "V", "level"), "i": (gl.Flow, "A", "current"),
    }  # fmt: skip
    assert (pin.description, pin.when, q.when, flange.description) == ("one", None, "on", "shaft")
    assert type(q) is type(pin)
    assert isinstance(flange, gp.Flange)
    assert set(declared_by(kind(on=False)).connectors) == {"p", "a"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Real x = 3; Real y = 2 * x;", ["x = 3", "y = 2.0*x"]),
        ("parameter Real k = 2; Real x(start = k, fixed = true); equation der(x) = 1;", ["x_from_start = -k + x", "der(x) = 1"]),
        ("parameter Real k = 2; Real x(start = k); equation der(x) = 1;", ["der(x) = 1"]),
        ("Real x; initial equation {x} = {3}; equation der(x) = 1;", ["initial_equation_1 = x - 3", "der(x) = 1"]),
        ("Real x; initial equation x = 3; equation der(x) = 1;", ["initial_equation_1 = x - 3", "der(x) = 1"]),
        ("Real x, y; initial equation x = 3; x = 2 * y; equation x = y; y = 1;",
         ["initial_equation_1 = x - 3", "initial_equation_2 = x - 2.0*y", "x = y", "y = 1"]),
        ("Real x, y; equation {x, y} = {1, 2};", ["x = 1", "y = 2"]),
        ("parameter Integer n = 2; Real x; equation for k in n:3 loop k = x + k; end for;", ["2 = x + 2", "3 = x + 3"]),
        ("parameter Integer n = 2; Real x; equation if n == 2 then x = 1; elseif n == 3 then x = 2; else x = 3; end if;", ["x = 1"]),
        ("parameter Integer n = 4; Real x; equation if n == 2 then x = 1; elseif n == 3 then x = 2; else x = 3; end if;", ["x = 3"]),
        ("parameter Integer n = 4; Real x; equation if n == 2 then x = 1; end if; x = 2;", ["x = 2"]),
        ("Real x, y; equation if x > 1 then x = 1; y = 2; else x = 3; 2 * y = x; end if;",
         ["x = Piecewise((1, x > 1), (3, True))", "Piecewise((y - 2, x > 1), (-x + 2.0*y, True)) = 0"]),
        ("Real x; equation if time > 1 then x = 1; elseif time > 2 then x = 2; else x = 3; end if;",
         ["x = Piecewise((1, time > 1), (2, time > 2), (3, True))"]),
        ("extends Base(k = 5); Real y; equation der(x) = k; y = two;", ["der(x) = k", "y = 2"]),
        ("Modelica.Blocks.Math.Gain g(k = 2); output Real y = g.y;", ["y = g.y"]),
        ("Modelica.Blocks.Math.Gain g[2](each k = 2); output Real y = sum(g.y);", ["y = g[0].y + g[1].y"]),
        ("Pin p; equation p.v = 2 * p.i;", ["p.v = 2.0*p.i"]),
        ("Real y[2] = {1, 2};", None),
    ],
)  # fmt: skip
def test_equations(text: str, expected: list[str] | None) -> None:
    if expected is None:
        with pytest.raises(ModelicaError, match="arrays of variables"):
            read(text)
        return
    component = read(text)()
    connections_of(component)
    assert [f"{e.left} = {e.right}" for e in equations_of(component)] == expected


def test_branches_of_when() -> None:
    component = read("""Real x; discrete Real d, e; equation der(x) = 1;
      when {x > 1, x > 2} then d = 1; e = 2; reinit(x, 3); elsewhen x > 4 then d = 5; e = 6; end when;""")()
    last = gl.When(component.x > 4, gl.Eq(component.d, 5), gl.Eq(component.e, 6))
    actions = gl.Eq(component.d, 1), gl.Eq(component.e, 2), gl.reinit(component.x, 3)
    expected = gl.When(component.x > 1, *actions, elsewhen=gl.When(component.x > 2, *actions, elsewhen=last))
    assert equations_of(component)[1] == expected


@pytest.mark.parametrize("never", ["false", "1 > 2", "sqrt(9) < 2"])
def test_conditions_that_never_become_true_leave_the_others(never: str) -> None:
    component = read(f"""discrete Real d; equation
      when {{time > 1, {never}, time > 2}} then d = 1; elsewhen {never} then d = 2; end when;""")()
    second = gl.When(gl.time > 2, gl.Eq(component.d, 1))
    assert equations_of(component) == [gl.When(gl.time > 1, gl.Eq(component.d, 1), elsewhen=second)]
    assert equations_of(read(f"discrete Real d; equation when {never} then d = 1; end when;")()) == []


@pytest.mark.parametrize(
    ("condition", "there"), [("sqrt(9) > 2", True), ("sqrt(9) < 2", False), ("3 <= two", False), ("3 > two", True)]
)
def test_parts_and_equations_under_conditions_of_constants(condition: str, there: bool) -> None:
    text = f"Components.Fixed part if {condition}; Real x; equation if {condition} then x = 1; else x = 2; end if;"
    component = read(text)()
    assert connections_of(component) == []
    assert ("part" in parts_of(component)) == there
    assert [str(equation.right) for equation in equations_of(component)] == ["1" if there else "2"]


def test_connections() -> None:
    component = read("""parameter Integer n = 3; parameter Boolean on = false; Components.Fixed f[n]; Components.Fixed absent if on;
      Components.Inertia a, b[n], c; Interfaces.Flange_a shaft; Interfaces.Flange_a away if on; equation
      connect(shaft, a.flange_a); connect(absent.flange, a.flange_b); connect(away, a.flange_b); connect(f.flange, b.flange_a);
      for k in 1:n - 1 loop connect(b[k].flange_b, b[k + 1].flange_a); end for;
      if on then connect(a.flange_b, c.flange_a); elseif n == 3 then connect(a.flange_b, c.flange_b); else connect(shaft, c.flange_a);
      end if; if on then connect(shaft, c.flange_a); end if;""")()
    found = [tuple(f"{port!r}" for port in connection.ports) for connection in connections_of(component)]
    inner = [(f"f[{k}].flange", f"b[{k}].flange_a") for k in range(3)] + [
        (f"b[{k}].flange_b", f"b[{k + 1}].flange_a") for k in range(2)
    ]
    assert [tuple(name[len("<Flange ") : -1].removeprefix("M.") for name in pair) for pair in found] == [
        ("shaft", "a.flange_a"), *inner, ("a.flange_b", "c.flange_b"),
    ]  # fmt: skip
    assert "absent" not in parts_of(component)


def test_values_of_a_base_class_of_the_library() -> None:
    kind = read("""extends Components.Inertia(J = 2 * k, phi(start = 1, fixed = true),
      w(start = 3, nominal = 2, stateSelect = StateSelect.never));
      parameter Real k = 4;""")
    assert issubclass(kind, gp.Inertia)
    declared = declared_by(kind())  # 2 k is 8
    assert (declared.variables["phi"].start, declared.variables["w"].start, declared.variables["w"].guess) == (1.0, None, 3.0)
    assert (declared.variables["w"].nominal, declared.variables["w"].state) == (2.0, "never")
    assert str(declared.parameters["J"].default(kind())) == "8.0"
    assert declared.parameters["k"].default == 4.0


def test_modifications_go_to_the_base_that_has_the_element() -> None:
    """The library's class, the class of the text, or, of what has no counterpart, none."""
    kind = gl.read_modelica(f"""{AROUND} model Lossy extends Modelica.Blocks.Nonlinear.Limiter(uMax = 3); parameter Real loss = 1;
      end Lossy; model M extends Lossy(loss = 2, uMin = -4, homotopyType = 3, strict = true); end M; end P;""")
    assert issubclass(kind, gp.blocks.Limiter)
    given = gl.compile(kind()).parameters
    assert {name: given[name] for name in ("y_max", "y_min", "loss")} == {"y_max": 3.0, "y_min": -4.0, "loss": 2.0}


def content(text: str) -> None:
    made = read(text)()
    connections_of(made)
    equations_of(made)


BEGIN = "'begin' is not an attribute of a variable; did you mean 'min'? "
BEGIN += "Valid names: displayUnit, fixed, max, min, nominal, quantity, start, stateSelect, unbounded, unit"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("outer Real x;", "'outer' is not supported"),
        ("stream Real x;", "'stream' is not supported"),
        ("Real _x;", "the name '_x' is reserved; give it another one"),
        ("Real start;", "the name 'start' is reserved; give it another one"),
        ("Pin p[2];", "arrays of connectors, such as 'p', are not supported; arrays of components are"),
        ("Pin p if time > 1;", "the condition of a connector is read as the name of a Boolean parameter only"),
        ("Real x; Pin p if x;", "the condition of a connector is read as the name of a Boolean parameter only"),
        ("Real x; initial equation der(x);", "expected an equation of variables, such as w = w_start"),
        ("discrete Real x; initial equation pre(x) = 1;", "expected an equation of variables, such as w = w_start"),
        ("Real x, y; initial equation {x, y} = {1, 2};",
         "an initial equation of arrays is not supported; write one for each variable"),
        ("Real x; initial equation x = {1};", "the two sides are arrays of different sizes"),
        ("Real x; Components.Inertia i(J = 1); initial equation i.flange_a = x;",
         "this is not a variable; a connector's variables are equated, or connectors connected"),
        ("Components.Inertia i(J = 1); Real x(start = i, fixed = true);",
         "this cannot be evaluated: unsupported operand type(s) for -: 'Symbol' and 'Inertia'"),
        ("parameter Boolean on = false; Components.Fixed f if on; Real x = f.phi0;",
         "f.phi0 is absent, since its condition is false; only connections may name it"),
        ("parameter Boolean on = false; Pin p if on; Real x = p.v;",
         "p.v is absent, since its condition is false; only connections may name it"),
        ("parameter Boolean on = false; Components.Fixed f if on; Components.Fixed g(phi0 = f.phi0);",
         "f.phi0 is absent, since its condition is false; only connections may name it"),
        ("String s;", "'s' is a string that may vary; only parameters are read"),
        ("Level s;", "'s' is a string that may vary; only parameters are read"),
        ("type Long Real x; end Long; Long y;",
         "this type is not supported; expected a short form, as in type Torque = Real(unit=\"N.m\")"),
        ("f y;", "P.f is a function; expected a model, a block, a connector or a type"),
        ("connector Bad Integer n; end Bad; Bad b;", "expected real variables in the connector P.M.Bad, without equations"),
        ("connector Bad Real n[2]; end Bad; Bad b;", "expected real variables in the connector P.M.Bad, without equations"),
        ("connector Bad Real n; equation n = 1; end Bad; Bad b;", "expected real variables in the connector P.M.Bad, without equations"),
        ("connector Bad Real n; flow Real j; stream Real k; end Bad; Bad b;", "stream variables are not supported"),
        ("Real x = f(2);", "user-defined functions, such as f, are not supported"),
        ("constant Real c; Real x = c;", "nothing is called 'c' here; Valid names: x"),
        ("parameter Real p = 1; Real x = p.q;", "p.q is not supported: what stands before '.q' is not a component"),
        ("Components.Inertia a; Real x = a.nothing;", None),
        ("Components.Inertia a; Real x; equation x = a.flange_a;",
         "this is not a variable; a connector's variables are equated, or connectors connected"),
        ("Components.Fixed a[2]; Components.Inertia b[3]; equation connect(a.flange, b.flange_a);",
         "arrays of different sizes cannot be connected"),
        ("Components.Fixed a[2]; Components.Inertia b; equation connect(a.flange, b.flange_a);",
         "arrays of different sizes cannot be connected"),
        ("Components.Fixed a; Components.Inertia b; equation if time > 1 then connect(a.flange, b.flange_a); end if;",
         "connections under a condition that may vary are not supported"),
        ("Components.Fixed a; Components.Inertia b; equation if time > 1 then connect(a.flange, b.flange_a); else end if;",
         "connections under a condition that may vary are not supported"),
        ("Components.Fixed a; Components.Inertia b; equation connect(a.flange, b.J);", None),
        ("Real x(start = 1e999);", "Variable: guess is inf; expected a finite number"),
        ("extends Components.Inertia(q = 2);", "this modification of Inertia is not supported"),
        ("extends Components.Inertia(w = 2);", "this modification of Inertia is not supported"),
        ("extends Components.Inertia(w(begin = 2));", BEGIN),
        ("Components.Inertia i(w(begin = 2));", BEGIN),
        ("Components.Inertia i(J(begin = 2));", BEGIN),
        ("Real x(begin = 2);", BEGIN),
        ("parameter Integer x(begin = 2);", BEGIN),
        ("connector Bad Real n(begin = 2); end Bad; Bad b;", BEGIN),
        ("type Bad = Real(begin = 2); Bad b;", BEGIN),
        ("constant Real n = 1.5; Components.Fixed f[n];", "the size of 'f' is 1.5; expected a whole number"),
        ("parameter Real x(min = time) = 2;", "this has to be a constant, known when the model is built; it depends on time"),
        *((f"Real x({name}(a = 1));", f"'{name}' has no value; expected one, as in {name} = 1")
          for name in ("start", "fixed", "nominal", "stateSelect", "min", "unit")),
        ("discrete Real d(start(a = 1)); equation when time > 1 then d = 1; end when;",
         "'start' has no value; expected one, as in start = 1"),
        *((f"{kind} Real x({name} = {value});", f"'{name}' is {said}; expected a number")
          for kind, name in (("parameter", "min"), ("parameter", "max"), ("", "start"), ("", "nominal"), ("discrete", "start"))
          for value, said in (("{1}", "(1,)"), ('"a"', "'a'"))),
        *((f"Real x(fixed = {value});", f"'fixed' is {said}; expected true or false")
          for value, said in (("{true}", "(True,)"), ("1", "1"), ('"true"', "'true'"))),
        *((f"Real x(stateSelect = {value});", f"'stateSelect' is {said}; expected one of never, avoid, default, prefer, always")
          for value, said in (("StateSelect.no", "'no'"), ("{1}", "(1,)"), ("true", "True"))),
    ],
)  # fmt: skip
def test_what_is_refused_of_classes(text: str, said: str | None) -> None:
    with pytest.raises(ModelicaError) as problem:
        content(text)
    assert str(problem.value).startswith("the text, line ")
    assert said is None or str(problem.value).partition(": ")[2] == said


def test_an_assertion_is_not_watched() -> None:
    made = read('Real x = time; equation assert(x < 1, "too late");')()
    with pytest.warns(GearlibWarning, match=r"line \d+, column \d+: an assertion is not watched"):
        assert len(equations_of(made)) == 1


def test_a_class_that_says_nothing_is_described_by_its_name() -> None:
    assert (read("").__doc__, read("")().__class__.__name__) == ("The Modelica class P.M.", "M")
    assert gl.read_modelica('model M "a train" end M;').__doc__ == "a train"
    assert declared_by(read("parameter Real y;")()).parameters["y"].default is NO_VALUE


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        ("parameter Integer n = 7 / 2;", "3.5 is given; expected an Integer, a whole number"),
        ("parameter Integer n[2] = {1, 2.5};", "2.5 is given; expected an Integer"),
        ("constant Integer n = 2.5;", "2.5 is given; expected an Integer"),
        ("parameter Integer n = true;", "True is given; expected an Integer"),
        ("parameter Boolean n = 3;", "3 is given; expected true or false"),
        ("parameter Real n = true;", "True is given; expected a number"),
        ("parameter String n = 1;", "1 is given; expected a string"),
        ("type E = enumeration(a, b); parameter E n = 3;", "3 is given; expected a string, or a literal of the enumeration"),
        ("type N = Integer(min = 1); parameter N n = 2.5;", "2.5 is given; expected an Integer"),
        (
            "parameter Integer m = 8; parameter Integer n = m / 2;",
            "a Real expression is given to 'n'; expected integer() or div()",
        ),
        ("parameter Integer m = 8; parameter Integer n[2] = {m ^ 2, m};", "a Real expression is given to 'n'"),
        ("parameter Real m = 8; parameter Integer n = if m > 2 then 3 else m;", "a Real expression is given to 'n'"),
        ("Integer k(start = 2.5); equation when time > 1 then k = 3; end when;", "2.5 is given; expected an Integer"),
        ("Integer k = if time > 1 then 2.5 else 1;", "a Real expression is given to 'k'; expected integer()"),
        (
            "parameter Integer m = 7; parameter Boolean n = m; Real x = if n then 1 else 2;",
            "7 is given; expected true or false",
        ),
        ("package P constant Integer n = 7 / 2; end P; Real x = P.n;", "3.5 is given; expected an Integer"),
        ("Integer k; equation when time > 1 then k = (pre(k) + 3) / 2; end when;", "a Real expression is given to 'k'"),
        (
            "Integer k; Real x = time; equation when time > 1 then k = max(pre(k), -x); end when;",
            "a Real expression is given to 'k'",
        ),
        (
            "Boolean b; equation when time > 1 then b = 2.5; end when;",
            "a Real expression is given to 'b'; expected a condition",
        ),
    ],
)
def test_values_have_the_type_of_what_they_are_given_to(declared: str, said: str) -> None:
    with pytest.raises(ModelicaError, match=f"line 1, column [0-9]+: {re.escape(said)}"):
        gl.compile(gl.read_modelica(f"model M {declared} end M;")())


def test_integers_are_computed_of_integers() -> None:
    declared = "parameter Integer m = 7; parameter Integer n = div(m, 2) * 2 + integer(m / 2); Integer k(start = 1); Real x = n * time;"
    when = "equation when time > 0.5 then k = max(pre(k) + 2 * n, if x > 0 then mod(m, 3) else sign(x)); end when;"
    assert gl.simulate(gl.read_modelica(f"model M {declared} {when} end M;")(), 1.0, samples=2)["k"].tolist() == [1.0, 19.0]


def test_whole_numbers_are_real_ones_too() -> None:
    model = gl.read_modelica("model M parameter Real n = 7; constant Real m[2] = {1, 2.5}; Real y = n + m[1]; end M;")
    assert gl.simulate(model(), 1.0, samples=2)["y"][-1] == 8.0
