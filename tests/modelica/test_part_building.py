"""Modifications of parts: what they give to which part, and which are allowed."""

from __future__ import annotations

from typing import Any

import pytest
import sympy

import gearlib as gl
from gearlib.errors import ModelicaError
from gearlib.language.component import equations_of, given_to
from gearlib.language.declarations import declared_by
from gearlib.language.expressions import real_symbol
from gearlib.language.interior import connections_of, parts_of

PACKAGE = """
package P
  import Modelica.Mechanics.Rotational.{Components, Interfaces, Sources};
  import Modelica.Blocks.{Continuous, Math};
  type Level = enumeration(low, high);
  connector Pin "of one's own"
    Real v;
    flow Real i;
  end Pin;
  model Small "one of everything"
    parameter Real k = 1;
    final parameter Real f = 4;
    constant Real c = 5;
    parameter Integer n = 2;
    parameter Boolean on = true;
    parameter Level level = Level.low;
    input Real u;
    Real x(start = 3);
    discrete Real d(start = 1);
    Pin pin;
    Interfaces.Flange_a flange;
    Components.Inertia body(J = k);
    Sources.Torque torque;
  end Small;
  model Large
    parameter Real j = 7;
    Small s(k = 2 * j, body(w(start = j)));
    replaceable Components.Inertia some(J = 3) constrainedby Interfaces.PartialTwoFlanges;
  end Large;
  model Row
    Components.Inertia b[2](each J = 1);
    Components.LossyGear g[2](each ratio = 1);
    Sources.Move m;
  end Row;
  model Lossy
    extends Components.Inertia(J = 6, w.start = 2);
    parameter Real loss = 1;
  end Lossy;
"""


LARGE = {
    "l.s": {"values": {"k": "2.0*j"}, "guess": {"body.w": "j"}},
    "l.s.body": {"values": {"J": "k"}},
}  # what Large says itself


def parts(text: str, package: str = PACKAGE) -> dict[str, Any]:
    """The parts of a model with these declarations, by path, to any depth."""
    found: dict[str, Any] = {}

    def look(component: gl.Component, prefix: str) -> None:
        connections_of(component)  # makes the parts
        for name, part in parts_of(component).items():
            found[prefix + name] = part
            look(part, f"{prefix}{name}.")

    look(gl.read_modelica(f"{package} model M parameter Real p = 9; {text} end M; end P;")(), "")
    return found


def given(text: str) -> dict[str, dict[str, Any]]:
    """What the parts of a model are given, without what is empty."""
    found: dict[str, dict[str, Any]] = {}
    for name, part in parts(text).items():
        for kind, values in vars(given_to(part)).items():
            if values:
                found.setdefault(name, {})[kind] = {k: str(v) if isinstance(v, sympy.Expr) else v for k, v in values.items()}
    return found


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Components.Inertia i(J = 2);", {"i": {"values": {"J": 2}}}),
        ("Components.Inertia i(J = 2, phi(start = 1, fixed = true), w(start = 3));",
         {"i": {"values": {"J": 2}, "start": {"phi": 1}, "guess": {"w": 3}}}),
        ("Components.Inertia i(w(fixed = true));", {"i": {"start": {"w": 0.0}}}),
        ("Components.Inertia i(w(start = 3, fixed = false));", {"i": {"guess": {"w": 3}}}),
        ("Components.Inertia i(w.start = 3, w.fixed = true, w.nominal = 2);", {"i": {"start": {"w": 3}, "nominal": {"w": 2.0}}}),
        ("Components.Inertia i(a(start = 3, nominal = 4));", {"i": {"nominal": {"a": 4.0}}}),
        ("Components.Inertia i(stateSelect = StateSelect.always);", {"i": {"state": {"phi": "prefer", "w": "prefer"}}}),
        ("Components.Inertia i(w(stateSelect = StateSelect.avoid, unit = \"rad/s\"));", {"i": {"state": {"w": "avoid"}}}),
        ("Components.Inertia i(flange_a(phi(start = 3, fixed = true)));", {"i": {"start": {"flange_a.phi": 3}}}),
        ("Components.Inertia i(J(min = 1));", {}),
        ("Components.RelativeStates r(phi_nominal = 3, stateSelect = StateSelect.never);",
         {"r": {"nominal": {"phi_rel": 3}, "state": {"phi_rel": "never", "w_rel": "never"}}}),
        ("Components.InitializeFlange z(stateSelect = StateSelect.never);", {}),
        ("Small s(body(J = abs(p - 9)), torque(tau = abs(time - 1)));",  # a parameter does not pass through zero
         {"s": {"values": {"body__J": "Abs(p - 9)", "torque__tau": "no_event(Abs(time - 1))"}},
          "s.body": {"values": {"J": "body__J"}}, "s.torque": {"values": {"tau": "torque__tau"}}}),
        ("Components.Inertia i(w(start = abs(p - 9)));", {"i": {"guess": {"w": "Abs(p - 9)"}}}),
        ("Components.Fixed f[3](phi0 = {1, 2, 3});", {f"f[{k}]": {"values": {"phi0": k + 1}} for k in range(3)}),
        ("Components.Fixed f[2](each phi0 = 4);", {f"f[{k}]": {"values": {"phi0": 4}} for k in range(2)}),
        ("Components.Fixed f[0](each phi0 = 4);", {}),
        ("Components.Inertia i[2](w(start = {1, 2}, each fixed = true));", {f"i[{k}]": {"start": {"w": k + 1}} for k in range(2)}),
        ("Continuous.Integrator g(k = 2, y_start = 3, initType = Modelica.Blocks.Types.Init.InitialState);",
         {"g": {"values": {"k": 2}, "start": {"y": 3}}}),
        ("Sources.Move m(u = {time, 1, 0});", {"m": {"values": {"phi_ref": "time", "w_ref": 1, "a_ref": 0}}}),
        ("Sources.SignTorque s(tau_nominal = 1, reg = Modelica.Blocks.Types.Regularization.CoSine);",
         {"s": {"values": {"tau_nominal": 1}, "choices": {"reg": "cosine"}}}),
        ("parameter Boolean on = false; Components.Fixed f(phi0 = 1) if on; Components.Fixed g(phi0 = 2) if not on;",
         {"g": {"values": {"phi0": 2}}}),
        ("Components.Fixed f(phi0 = 1) if p > 0 and p <= 0; Components.Fixed g(phi0 = 2) if p > 0 or p <= 0;",
         {"g": {"values": {"phi0": 2}}}),
        ("Small s;", {"s.body": {"values": {"J": "k"}}}),
        ("Small s(k = 3, n = 4, on = false, level = Level.high, u = time);",
         {"s": {"values": {"k": 3, "u": "time"}, "choices": {"n": 4, "on": False, "level": "high"}}, "s.body": {"values": {"J": "k"}}}),
        ("Small s(x(start = 5), pin(v(start = 6, nominal = 2)), flange(phi(start = 7, fixed = true)));",
         {"s": {"guess": {"x": 5, "pin.v": 6}, "start": {"flange.phi": 7}, "nominal": {"pin.v": 2.0}}, "s.body": {"values": {"J": "k"}}}),
        ("Small s(d(start = 5), x(fixed = true));", {"s": {"start": {"d": 5}}, "s.body": {"values": {"J": "k"}}}),
        ("Small s(body(J = 5, w(start = 2, fixed = true)));",
         {"s": {"values": {"body__J": 5}, "start": {"body.w": 2}}, "s.body": {"values": {"J": "body__J"}}}),
        ("Small s(torque(tau = time));",
         {"s": {"values": {"torque__tau": "time"}}, "s.body": {"values": {"J": "k"}}, "s.torque": {"values": {"tau": "torque__tau"}}}),
        ("Large l(j = 2);",
         {"l": {"values": {"j": 2}}, "l.some": {"values": {"J": 3}}, **LARGE}),
        ("Large l(s(k = 4, body(J = 8, phi(fixed = true))));",
         {"l": {"values": {"s__k": 4, "s__body__J": 8}},
          "l.s": {"values": {"k": "s__k", "body__J": "s__body__J"}, "guess": {"body.w": "j"}},
          "l.s.body": {"values": {"J": "body__J"}, "start": {"phi": 0.0}},
          "l.some": {"values": {"J": 3}}}),
        ("Large l(some(J = 5));", {"l": {"values": {"some__J": 5}}, "l.some": {"values": {"J": "some__J"}}, **LARGE}),
        ("Large l(redeclare Components.Disc some(deltaPhi = 5));",
         {"l": {"values": {"some__deltaPhi": 5}}, "l.some": {"values": {"delta_phi": "some__deltaPhi"}}, **LARGE}),
        ("Lossy l(J = 3, loss = 2, w(start = 8));", {"l": {"values": {"J": 3, "loss": 2}, "guess": {"w": 8}}}),
    ],
)  # fmt: skip
def test_what_modifications_give_to_parts(text: str, expected: Any) -> None:
    """Names in quotes stand for parameters of the enclosing class."""
    assert given(text) == expected


STARTED = """
package P
  import Modelica.Mechanics.Rotational.Components;
  model A parameter Real k = 4; Real x(start = 3); equation der(x) = -k * x; end A;
  model F parameter Real k = 4; Real x(start = 3, fixed = true); equation der(x) = -k * x; end F;
  model K parameter Real k = 4; Real x(start = k); equation der(x) = -x; end K;
  model N parameter Real k = 4; Real x; equation der(x) = -k * x; end N;
  model Holds A a; end Holds;
  model Sets A a(x(start = 5)); end Sets;
  model Body Components.Inertia a(J = 1, w(start = 7)); end Body;
  model Wheel extends Components.Inertia(J = 1, w(start = 7)); end Wheel;
  model Pair A a[2]; Components.Inertia b[2](each J = 1); end Pair;
  connector Pin Real v; flow Real i; end Pin;
  connector Live Real v(start = 2, fixed = true); flow Real i; end Live;
  model Plug Pin p; equation der(p.v) = -p.v; end Plug;
  model Hot Pin p(v(start = 7)); equation der(p.v) = -p.v; end Hot;
  model Socket parameter Real k = 4; Live p; Pin q(v(start = k, fixed = true)); equation der(p.v) = -p.v; der(q.v) = -q.v; end Socket;
  model Started extends Components.Inertia(J = 1, w(start = 7, fixed = true)); end Started;
  model Inner Started a; Wheel b; end Inner;
  model Outer Inner c; end Outer;
"""


@pytest.mark.parametrize(
    ("text", "name", "expected"),
    [
        ("A a(x(fixed = true));", "a.x", 3), ("extends A(x(fixed = true));", "x", 3), ("A a[2](each x(fixed = true));", "a[1].x", 3),
        ("A a[2](x(fixed = {true, true}, start = {8, 9}));", "a[1].x", 9), ("A a(x(fixed = true, start = 8));", "a.x", 8),
        ("K a(x(fixed = true));", "a.x", 4), ("K a(k = 6, x(fixed = true));", "a.x", 6), ("N a(x(fixed = true));", "a.x", 0),
        ("Holds b(a(x(fixed = true)));", "b.a.x", 3), ("Sets b(a(x(fixed = true)));", "b.a.x", 5),
        ("Sets b(a(x(fixed = true, start = 8)));", "b.a.x", 8), ("Body b(a(w(fixed = true)));", "b.a.w", 7),
        ("Wheel b(w(fixed = true));", "b.w", 7), ("Wheel b(w(fixed = true, start = 8));", "b.w", 8),
        ("F a(x(start = 8));", "a.x", 8), ("F a(x(nominal = 8));", "a.x", 3), ("Started b(w(start = 8));", "b.w", 8),
        ("F a(x(fixed = false)); initial equation a.x = 6;", "a.x", 6), ("A a(x(fixed = false)); initial equation a.x = 6;", "a.x", 6),
        ("F a(x(fixed = false, start = 8)); initial equation a.x = 6;", "a.x", 6),
        ("Plug h(p(v(start = 8, fixed = true)));", "h.p.v", 8), ("Plug h(p(v(fixed = true)));", "h.p.v", 0),
        ("Hot h(p(v(fixed = true)));", "h.p.v", 7), ("extends Hot(p(v(fixed = true)));", "p.v", 7),
        ("extends Plug(p(v(start = 8, fixed = true)));", "p.v", 8), ("Socket s;", "s.p.v", 2), ("Socket s;", "s.q.v", 4),
        ("Socket s(k = 6, p(v(start = 9, fixed = true)));", "s.p.v", 9), ("Socket s(k = 6);", "s.q.v", 6),
        ("Pair d(a(x(start = {8, 9}, each fixed = true)));", "d.a[1].x", 9), ("Pair d(a(each x(fixed = true)));", "d.a[1].x", 3),
        ("Pair d[2](a(x(start = {{6, 7}, {8, 9}}, each fixed = true)));", "d[1].a[0].x", 8),
        ("Pair d[2](each a(x(start = {6, 7}, fixed = {true, true})));", "d[0].a[1].x", 7),
        ("Pair d(b(each w(start = k, fixed = true))); parameter Real k = 8;", "d.b[0].w", 8),
        ("Pair d(b(each flange_a(phi(start = 8, fixed = true))));", "d.b[1].phi", 8),
        ("Inner b(a(w(start = 8)));", "b.a.w", 8), ("Inner b(b(w(fixed = true)));", "b.b.w", 7),
        ("Outer d(c(a(J = 5, w(start = 8))));", "d.c.a.w", 8), ("Outer d(c(a(J = 5), b(w(fixed = true))));", "d.c.b.w", 7),
        ("Inner b[2](a(w(start = {8, 9})));", "b[1].a.w", 9), ("Inner b[2](each a(J = 5, w(start = 8)));", "b[0].a.w", 8),
        ("Started b(w(fixed = false)); initial equation b.w = 6;", "b.w", 6),
    ],
)  # fmt: skip
def test_a_part_starts_with_the_last_start_value_where_any_says_that_it_is_fixed(text: str, name: str, expected: float) -> None:
    """The declaration gives what the modification leaves open."""
    system = gl.compile(gl.read_modelica(f"{STARTED} model M {text} end M; end P;", "M")())
    assert system.simulate(1e-3, samples=2)[name][0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Row r(b(J = {3, 4}));", {"r.b[0]": 3, "r.b[1]": 4}),
        ("Row r(b(each J = 3));", {"r.b[0]": 3, "r.b[1]": 3}),
        ("Row r[3](each b(J = {3, 4}));", {f"r[{k}].b[{i}]": 3 + i for k in range(3) for i in range(2)}),
        ("Row r[3](b(J = {{3, 4}, {5, 6}, {7, 8}}));", {f"r[{k}].b[{i}]": 3 + 2 * k + i for k in range(3) for i in range(2)}),
        ("Row r[3](b(each J = 3));", {f"r[{k}].b[{i}]": 3 for k in range(3) for i in range(2)}),
        ("model Rows Row r[2](b(each J = 2)); end Rows; Rows s(r(b(J = {{3, 4}, {5, 6}})));",
         {f"s.r[{k}].b[{i}]": 3 + 2 * k + i for k in range(2) for i in range(2)}),
        ("Large l[2](some(J = {5, p}));", {"l[0].some": 5, "l[1].some": 9}),
    ],
)  # fmt: skip
def test_each_part_of_an_array_within_a_part_has_its_own_value(text: str, expected: dict[str, float]) -> None:
    """However deep: an index for each array that is not within ``each``."""
    found = parts(text)

    def number(name: str) -> float:
        """The value of a part's inertia: a number, or a parameter of the class around it."""
        value, (above, _, _) = given_to(found[name]).values["J"], name.rpartition(".")
        while isinstance(value, sympy.Symbol) and str(value) != "p":
            value, (above, _, _) = given_to(found[above]).values[str(value)], above.rpartition(".")
        return 9.0 if str(value) == "p" else float(value)

    assert {name: number(name) for name in expected} == expected


def test_tables_and_signals_of_an_array_within_a_part() -> None:
    one, other = ((0, 0.9, 0.8, 0, 0),), ((0, 0.5, 0.4, 0, 0),)
    tables = {"one": "[0, 0.9, 0.8, 0, 0]", "other": "[0, 0.5, 0.4, 0, 0]"}
    for text, expected in (
        ("each lossTable = {one}", (one, one)),
        ("lossTable = {{{one}, {other}}}", (one, other)),
    ):
        found = parts(f"Row r(g({text.format(**tables)}));")
        assert tuple(given_to(found[f"r.g[{k}]"]).choices["loss_table"] for k in range(2)) == expected
    found = parts("Row r(m(u = {time, 1, 0}));")
    assert given_to(found["r"]).values == {"m__u__1": gl.time, "m__u__2": 1, "m__u__3": 0}
    assert {n: str(v) for n, v in given_to(found["r.m"]).values.items()} == {
        "phi_ref": "m__u__1", "w_ref": "m__u__2", "a_ref": "m__u__3",
    }  # fmt: skip


GAINS = "Math.Gain c(k = 1, u = b.y); Math.Gain b(k = 2, u = a.y); Math.Gain a(k = 3, u = {}); Math.Gain d(k = 4, u = time);"


def test_parts_are_made_after_those_that_their_values_refer_to() -> None:
    """In rounds; in a loop, one of them refers to a hidden signal."""
    assert list(parts(GAINS.format("time"))) == ["a", "d", "b", "c"]
    assert list(parts(GAINS.format("c.y"))) == ["d", "c", "a", "b"]
    assert {name: values["values"]["u"] for name, values in given(GAINS.format("c.y")).items()} == {
        "d": "time", "c": "c_u_signal", "a": "c.y", "b": "a.y",
    }  # fmt: skip
    assert list(parts("Math.Gain g(k = 1, u = time); Components.Fixed f; Math.Gain h(k = 1, u = g.y);")) == ["g", "f", "h"]


REDECLARED = """
package P
  model A parameter Real k = 1; Real x = 10 + k; end A;
  model B parameter Real k = 2; Real x = 20 + k; end B;
"""


@pytest.mark.parametrize(
    ("declared", "used", "expected"),
    [
        ("A s;", "C c;", 11),
        ("A s(k = 3);", "C c;", 13),
        ("A s constrainedby A(k = 5);", "C c;", 15),
        ("A s(k = 3) constrainedby A(k = 5);", "C c;", 13),
        ("A s;", "C c(redeclare B s);", 22),
        ("A s(k = 3);", "C c(redeclare B s);", 23),
        ("A s(k = 3) constrainedby A;", "C c(redeclare B s);", 22),
        ("A s(k = 3) constrainedby A(k = 5);", "C c(redeclare B s);", 25),
        ("A s(k = 3) constrainedby A(k = 5);", "C c(redeclare B s(k = 7));", 27),
        ("A s(k = 3);", "C c(redeclare B s constrainedby B(k = 7));", 27),
        ("A s(k = 3);", "extends C(redeclare B s);", 23),
        ("A s(k = 3);", "extends C; redeclare B s;", 23),
        ("A s(k = 3);", "extends C; redeclare B s(k = 4);", 24),
        ("model S = A; S s;", "C c;", 11),
        ("model S = A(k = 3); S s;", "C c;", 13),
        ("model S = A constrainedby A(k = 5); S s;", "C c;", 15),
        ("model S = A(k = 3) constrainedby A(k = 5); S s;", "C c;", 13),
        ("model S = A; S s;", "C c(redeclare model S = B);", 22),
        ("model S = A(k = 3); S s;", "C c(redeclare model S = B);", 23),
        ("model S = A(k = 3) constrainedby A; S s;", "C c(redeclare model S = B);", 22),
        ("model S = A(k = 3) constrainedby A(k = 5); S s;", "C c(redeclare model S = B);", 25),
        ("model S = A(k = 3) constrainedby A(k = 5); S s;", "C c(redeclare model S = B(k = 7));", 27),
        ("model S = A(k = 3); S s;", "C c(redeclare model S = B constrainedby B(k = 7));", 27),
        ("model S = A(k = 3); S s;", "extends C(redeclare model S = B);", 23),
        ("model S = A(k = 3); S s;", "extends C; redeclare model S = B;", 23),
        ("model S = A(k = 3); S s(k = 8);", "C c(redeclare model S = B);", 28),
        ("model S extends A(k = 6); end S; S s;", "C c(redeclare model S = B);", 22),
    ],
)
def test_redeclarations_keep_what_the_specification_says(declared: str, used: str, expected: int) -> None:
    """Modelica 3.6, 7.3.2: the constraint's modifications, or those of the first declaration if it has no constraint."""
    found = parts(used, f"{REDECLARED} model C replaceable {declared} end C;")
    (part,) = (part for path, part in found.items() if path.rpartition(".")[2] == "s")
    k = given_to(part).values.get("k", declared_by(part).parameters["k"].default)
    (equation,) = equations_of(part)
    outer = {
        real_symbol(name): value
        for whole in found.values()
        for name, value in given_to(whole).values.items()
        if whole is not part
    }
    assert float(equation.right.subs(real_symbol("k"), k).subs(outer)) == expected


@pytest.mark.parametrize("used", ["Q.D d(c(redeclare B s));", "Q.D d(c.s(k = 5), c(redeclare B s));"])
def test_a_redeclaration_at_any_depth_means_a_class_of_where_it_is_written(used: str) -> None:
    inside = f"package Q {REDECLARED.partition('P')[2]} model C replaceable A s; end C; model D C c; end D; end Q;"
    found = parts(used, f"package P {inside} model B parameter Real k = 3; Real x = 30 + k; end B;")
    assert [e.right for e in equations_of(found["d.c.s"])] == [real_symbol("k") + 30]


@pytest.mark.parametrize(("used", "size"), [("redeclare B s", 2), ("redeclare B s[2]", 2), ("redeclare B s[3]", 3)])
def test_a_redeclared_array_has_the_size_of_the_first_unless_it_states_its_own(used: str, size: int) -> None:
    found = parts(f"C c({used});", f"{REDECLARED} model C replaceable A s[2]; end C;")
    assert {name: equations_of(part)[0].right for name, part in found.items() if ".s" in name} == {
        f"c.s[{k}]": real_symbol("k") + 20 for k in range(size)
    }


@pytest.mark.parametrize("used", ["redeclare model S = B, m = 4", "m = 4, redeclare model S = B"])
def test_values_stand_before_or_behind_a_redeclaration(used: str) -> None:
    found = parts(f"C c({used});", f"{REDECLARED} model C parameter Real m = 1; replaceable model S = A; S s; end C;")
    assert given_to(found["c"]).values == {"m": 4}
    assert declared_by(found["c.s"]).parameters["k"].default == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Small s(f = 3);", "'f' is final, and cannot be modified"),
        ("Small s(c = 3);", "'c' is a constant, and cannot be modified"),
        ("Small s(kk = 3);", "P.Small has no element 'kk' to be modified; did you mean 'k'?"),
        ("extends Small(kk = 3);", "P.Small has no element 'kk' to be modified; did you mean 'k'?"),
        ("extends Small(f = 3);", "f is final, and cannot be modified"),
        ("extends Small(c = 3);", "c is a constant, and cannot be modified"),
        ("Small s(x = 3);", "'x' is a variable of a part; an equation gives its value"),
        ("Small s(x(begin = 3));", "'begin' is not an attribute of a variable; "),
        ("Small s(body(I = 3));", "Inertia has no 'I' that can be modified; "),
        ("Pin q(w(start = 3));", "'q' has no 'w'; "),
        ("Pin q(v(begin = 3));", "'begin' is not an attribute of a variable; "),
        ("Small s(pin(w(start = 3)));", "'pin' has no 'w'; "),
        ("Components.Inertia i(flange_a(psi(fixed = true)));", "'flange_a' has no 'psi'; did you mean 'phi'?"),
        ("Components.Inertia i(I = 3);", "Inertia has no 'I' that can be modified; "),
        ("Components.Inertia i(w = 3);", "Inertia has no 'w' that can be modified; "),
        ("Components.Inertia i(a(start = 1, fixed = true));",
         "'a' is a derivative, whose start value cannot be fixed; use InitializeFlange"),
        ("Components.Inertia i(redeclare Components.Fixed J);", "'J' cannot be redeclared here"),
        *((f"Components.Inertia i(w({name}(a = 1)));", f"'{name}' has no value; expected one, as in {name} = 1")
          for name in ("start", "fixed", "nominal", "stateSelect")),
        ("Components.RelativeStates r(phi_nominal(a = 1));", "'phi_nominal' has no value; expected one, as in phi_nominal = 1"),
        ("Components.RelativeStates r(phi_nominal = {1});", "'phi_nominal' is (1,); expected a number"),
        ("Components.Inertia i(stateSelect(a = 1));", "'stateSelect' has no value; expected one, as in stateSelect = 1"),
        ("Components.Inertia i(stateSelect = 3);", "'stateSelect' is 3; expected one of never, avoid, default, prefer, always"),
        ("Continuous.Integrator g(y_start(a = 1));", "'y_start' has no value; expected one, as in y_start = 1"),
        ("Components.Inertia i(w(nominal = \"a\"));", "'nominal' is 'a'; expected a number"),
        ("Components.Inertia i(w(fixed = 1));", "'fixed' is 1; expected true or false"),
        ("Components.Inertia i(w(stateSelect = StateSelect.no));",
         "'stateSelect' is 'no'; expected one of never, avoid, default, prefer, always"),
        ("Components.Fixed f[3](phi0 = {1, 2});", "2 values; the array has 3 elements"),
        ("Components.Fixed f[2](phi0 = {1, 2, 3});", "3 values; the array has 2 elements"),
        ("Row r(b(J = {1, 2, 3}));", "3 values; the array has 2 elements"),
        ("Row r[3](b(J = {1, 2}));", "2 values; the array has 3 elements"),
        ("Components.Fixed f[2, 2];", "arrays of components with several dimensions are not supported"),
        ("Components.Fixed f[1.5];", "the size of 'f' is 1.5; expected a whole number"),
        ("Components.Fixed f[-1];", "the size of 'f' is -1; expected a whole number"),
        ("Components.Fixed f[true];", "the size of 'f' is True; expected a whole number"),
        ("Components.Fixed f if p > 10;", "the condition of a component has to be known when the model is built"),
        ("Components.Fixed f = 3;", "'f' is a component; modifications give values to it, as in f(J = 2)"),
        ("Sources.Move m(u = {time, 1});", "'u' is an array of 3 signals"),
        ("Sources.Move m(u = time);", "'u' is an array of 3 signals"),
        ("Sources.SignTorque s(reg = Modelica.Blocks.Types.Regularization.Cosine);", "reg = Cosine is not supported; "),
        ("Continuous.PI c(initType = Modelica.Blocks.Types.Init.SteadyState);",
         "initType = SteadyState is not supported; expected InitialState or NoInit"),
        ("Small s(n = p);", "this has to be a constant, known when the model is built; it depends on p"),
        ("extends Q;", "the class Q is not known; "),
        ("Small s; Small s(k = 2);", "'s' is declared twice"),
    ],
)  # fmt: skip
def test_what_cannot_be_modified(text: str, said: str) -> None:
    with pytest.raises(ModelicaError) as problem:
        parts(text)
    assert str(problem.value).partition(": ")[2].startswith(said)


@pytest.mark.parametrize(
    ("replaced", "said"),
    [
        ("model S extends A; end S constrainedby A(k = 5);",
         "a constraint with modifications is supported for short classes and components only"),
        ("model S = A(k = 3);", "only a short class can redeclare one that is declared with modifications"),
    ],
)  # fmt: skip
def test_long_classes_are_redeclared_without_modifications(replaced: str, said: str) -> None:
    with pytest.raises(ModelicaError, match=said):
        parts("C c(redeclare model S extends B; end S);", f"{REDECLARED} model C replaceable {replaced} S s; end C;")
