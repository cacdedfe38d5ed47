"""From a tree of components to flat equations: names, parameters, connection sets, aliases."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
import gearparts as gp
from gearlib.equations.class_record import class_record
from gearlib.errors import BindingError, BoundError, ConnectionError, NameLookupError
from gearlib.flatten.connections import connection_sets, split_sum
from gearlib.flatten.flatten import flatten
from gearlib.flatten.model import FlatModel

c = gl.connect


def values(model: FlatModel) -> dict[str, float]:
    table = model.parameters
    return dict(zip(table.names, table.defaults.tolist(), strict=True))


class Inner(gl.Component):
    """Takes an expression of its parent's parameter, and has one that follows from its own."""

    R = gl.Parameter("m", "radius", min=0)
    A = gl.Parameter("m2", "area", default=lambda inner: gl.pi * inner.R**2)

    def assemble(self) -> list[Any]:
        self.body = gp.Inertia(J=2 * self.A)
        return []


class Middle(gl.Component):
    D = gl.Parameter("m", "diameter")

    def assemble(self) -> list[Any]:
        self.inner = [Inner(R=self.D / 2), Inner(R=self.D, A=7.0)]
        return []


class Outer(gl.Component):
    size = gl.Parameter("m", "size", default=3.0)

    def assemble(self) -> list[Any]:
        self.middle = Middle(D=self.size + 1)
        return []


def test_parameter_expressions_through_four_levels() -> None:
    found = values(flatten(Outer()))
    assert found["middle.D"] == 4.0
    assert found["middle.inner[0].R"] == 2.0
    assert found["middle.inner[0].A"] == pytest.approx(4 * np.pi, rel=1e-15)
    assert found["middle.inner[0].body.J"] == pytest.approx(8 * np.pi, rel=1e-15)
    assert found["middle.inner[1].body.J"] == 14.0


def test_a_given_parameter_moves_all_that_follow_and_no_other() -> None:
    system = gl.compile(Outer())
    table = system.translation.model.parameters

    def after(**given: float) -> dict[str, float]:
        return dict(
            zip(
                table.names,
                system.translation.parameter_values({k.replace("__", "."): v for k, v in given.items()}),
                strict=True,
            )
        )

    assert after(size=1.0)["middle.inner[0].body.J"] == pytest.approx(2 * np.pi, rel=1e-15)
    assert after(middle__D=6.0)["middle.inner[0].R"] == 3.0
    assert after(middle__D=6.0)["size"] == 3.0


def test_defaults_that_follow_from_one_another_in_any_order() -> None:
    class Chained(gl.Component):
        a = gl.Parameter("1", "last", default=lambda s: s.b + 1)
        b = gl.Parameter("1", "second", default=lambda s: s.c + 1)
        c = gl.Parameter("1", "first", default=1.0)

    assert values(flatten(Chained())) == {"a": 3.0, "b": 2.0, "c": 1.0}
    assert gl.compile(Chained(**gl.offered({"c": 5.0}))).parameters == {"a": 7.0, "b": 6.0, "c": 5.0}


def test_parameters_in_a_circle() -> None:
    class Circle(gl.Component):
        a = gl.Parameter("1", "one", default=lambda s: s.b)
        b = gl.Parameter("1", "other", default=lambda s: s.a)

    with pytest.raises(BindingError, match="the parameters a, b depend on each other cyclically"):
        flatten(Circle())


def test_what_leads_into_a_circle_is_not_part_of_it() -> None:
    class Leading(gl.Component):
        a = gl.Parameter("1", "leads there", default=lambda s: s.b + s.e)
        b = gl.Parameter("1", "one", default=lambda s: s.c)
        c = gl.Parameter("1", "other", default=lambda s: 2 * s.d)
        d = gl.Parameter("1", "third", default=lambda s: s.b - s.e)
        e = gl.Parameter("1", "in none", default=1.0)

    with pytest.raises(BindingError, match=r"^the parameters b, c, d depend on each other cyclically; give one of them a"):
        flatten(Leading())

    class Alone(gl.Component):
        a = gl.Parameter("1", "of itself", default=lambda s: s.a + 1)

    with pytest.raises(BindingError, match=r"^the parameter a depends on itself; give it a number"):
        flatten(Alone())


def part(**given: Any) -> gl.Component:
    class Model(gl.Component):
        q = gl.Parameter("any", "own parameter", default=1.0)

        def assemble(self) -> list[Any]:
            self.other = gp.Inertia(J=1.0)
            self.m = gp.Inertia(**{k: v(self) if callable(v) and k == "late" else v for k, v in given.items()})
            return []

    return Model()


@pytest.mark.parametrize(
    ("value", "error", "message"),
    [
        ("1", BindingError, r"m\.J is '1' \(str\); expected a number in kg\.m2 \(moment of inertia\)"),
        (True, BindingError, r"m\.J is True \(bool\); expected a number"),
        (1j, BindingError, r"m\.J is 1j \(complex\); expected a number"),
        ([1.0], BindingError, r"m\.J is \[1\.0\] \(list\); expected a number"),
        (np.ones(2), BindingError, r"m\.J is array\(\[1\., 1\.\]\) \(ndarray\); expected a number"),
        (None, BindingError, r"m\.J has no value; give one in kg\.m2 \(moment of inertia\): J=\.\.\."),
        (float("nan"), BoundError, r"m\.J is nan; expected a finite number"),
        (float("inf"), BoundError, r"m\.J is inf; expected a finite number"),
        (10**400, BoundError, r"m\.J is too large"),
        (-1.0, BoundError, r"m\.J is -1; expected at least 0"),
        (gl.time, BindingError, r"m\.J: depends on 'time'.*only parameters of the enclosing component"),
        (lambda s: s.other.w, BindingError, r"m\.J: depends on 'other\.w', which is a variable; only parameters"),
        (lambda s: s.nothing, BindingError, r"m\.J: its function raised AttributeNameError: Model has no 'nothing'"),
        (lambda s: s.q - 3, BoundError, r"m\.J is -2; expected at least 0"),
        (lambda s: 1 / (s.q - 1), BoundError, r"m\.J is inf; expected a finite number"),
        (lambda s: gl.sqrt(-s.q), BoundError, r"m\.J is nan; expected a finite number"),
        (lambda s: sympy.gamma(s.q), BindingError, r"m\.J is gamma\(q\), which holds a function that is not gearlib's"),
        (lambda s: 2 * sympy.besselj(1, s.q), BindingError, r"m\.J is 2\*besselj\(1, q\), which holds a function that is not"),
    ],
)
def test_wrong_values_of_a_parameter(value: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        flatten(part(J=value))


def test_missing_parameter() -> None:
    with pytest.raises(BindingError, match=r"m\.J has no value; give one in kg\.m2"):
        flatten(part())


@pytest.mark.parametrize("value", [2, np.float64(2.0), np.int64(2), gl.sqrt(4), lambda s: 2 * s.q])
def test_right_values_of_a_parameter(value: Any) -> None:
    assert values(flatten(part(J=value)))["m.J"] == 2.0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"start": {"ww": 1}}, r"m: start value for 'ww', which is not a variable of Inertia; did you mean 'w'"),
        ({"guess": {"ww": 1}}, r"m: guess value for 'ww', which is not a variable of Inertia"),
        ({"start": {"w": "1"}}, r"start\(m\.w\) is '1' \(str\); expected a number in rad/s"),
        ({"start": {"w": None}}, r"start\(m\.w\) has no value; give one in rad/s"),
    ],
)
def test_wrong_start_values(given: dict[str, Any], message: str) -> None:
    with pytest.raises(BindingError, match=message):
        flatten(part(J=1.0, **given))


def test_start_that_is_not_finite() -> None:
    with pytest.raises(BoundError, match=r"start\(m\.w\) is nan; expected a finite number in rad/s"):
        flatten(part(J=1.0, start={"w": float("nan")}))


@pytest.mark.parametrize(
    ("tau", "error", "message"),
    [
        ("1", BindingError, r"torque\.tau is '1' \(str\); expected a number in N\.m"),
        (float("nan"), BoundError, r"torque\.tau is nan"),
        (lambda t: t, BindingError, r"torque\.tau is bound to the function.*simulate\(inputs=\{'torque\.tau'"),
        (gl.time * 1j, gl.GearlibError, r"torque\.tau is .*expected a real expression"),
    ],
)
def test_wrong_inputs(tau: Any, error: type[Exception], message: str) -> None:
    class Model(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.load = gp.Torque(tau=tau), gp.Inertia(J=1.0)
            return [c(self.torque.flange, self.load.flange_a)]

    with pytest.raises(error, match=message):
        flatten(Model())


def test_an_input_may_be_bound_to_a_variable_of_another_part() -> None:
    class Fan(gl.Component):
        def assemble(self) -> list[Any]:
            self.load = gp.Inertia(J=2.0, start={"w": 3.0})
            self.torque = gp.Torque(tau=-4 * self.load.w)
            return [c(self.torque.flange, self.load.flange_a)]

    result = gl.simulate(Fan(), 1.0, samples=5)
    assert result["load.w"] == pytest.approx(3 * np.exp(-2 * result.time), rel=1e-10)


def test_numbers_of_an_input_are_parameters_and_share_one_equation() -> None:
    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque = [gp.Torque(tau=a * gl.sin(b * gl.time)) for a, b in ((10, 3.5), (20, 7.25))]
            self.load = gp.Inertia(J=1.0)
            return [c(t.flange, self.load.flange_a) for t in self.torque]

    model = flatten(Two())
    assert sum(g.template.binds for g in model.groups) == 1


def test_a_class_is_analysed_once_for_each_structural_choice() -> None:
    assert class_record(gp.Inertia(J=1.0)) is class_record(gp.Inertia(J=2.0))
    assert class_record(gp.IdealGear(ratio=1.0)) is not class_record(gp.IdealGear(ratio=1.0, use_support=True))


def test_equations_are_grouped_by_template() -> None:
    class Bodies(gl.Component):
        n = gl.Structural(20)

        def assemble(self) -> list[Any]:
            self.body = [gp.Inertia(J=1.0) for _ in range(self.n)]
            return []

    small, large = flatten(Bodies(n=2)), flatten(Bodies(n=20))
    assert len(small.groups) == len(large.groups)
    assert {len(g) for g in large.groups} == {20}


def test_connection_sets_join_what_shares_a_node() -> None:
    assert connection_sets([(1, 2), (3, 4), (2, 3), (7, 8)]) == [[1, 2, 3, 4], [7, 8]]


def test_potentials_are_equal_and_flows_sum_to_zero() -> None:
    class Star(gl.Component):
        def assemble(self) -> list[Any]:
            self.body = [gp.Inertia(J=float(j), start={"w": 1.0} if j == 1 else {}) for j in (1, 2, 3)]
            self.torque = gp.Torque(tau=12.0)
            return [c(self.torque.flange, *(b.flange_a for b in self.body))]

    result = gl.simulate(Star(), 1.0, samples=3)
    assert result["body[2].w"] == pytest.approx(1 + 2 * result.time)
    assert sum(result[f"body[{i}].flange_a.tau"] for i in range(3)) == pytest.approx(12.0)
    assert result["torque.flange.tau"] == pytest.approx(-12.0)
    assert result["body[1].flange_b.tau"].tolist() == [0.0, 0.0, 0.0]  # not connected


def test_a_composites_own_flange_passes_the_torque_on() -> None:
    class Box(gl.Component):
        flange = gp.Flange("outside")

        def assemble(self) -> list[Any]:
            self.inside = gp.Inertia(J=2.0)
            return [c(self.flange, self.inside.flange_a)]

    class Model(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.box, self.more = gp.Torque(tau=8.0), Box(), gp.Inertia(J=2.0)
            return [c(self.torque.flange, self.box.flange), c(self.box.flange, self.more.flange_a)]

    result = gl.simulate(Model(), 1.0, samples=2)
    assert result["box.inside.w"][-1] == pytest.approx(2.0)
    assert result["box.flange.tau"][-1] == pytest.approx(4.0)  # positive into the box
    assert result["box.inside.flange_a.tau"][-1] == pytest.approx(4.0)


def test_long_sums_are_split() -> None:
    sums, following = split_sum(tuple((v, 1) for v in range(20)), 100)
    assert following == 100 + len(sums) - 1
    assert max(len(s) for s in sums) <= 8
    rng = np.random.default_rng(0)
    x = rng.normal(size=20)
    known = dict(enumerate(x))
    for s in sums[:-1]:  # each new variable is determined by its own sum
        *addends, (new, sign) = s
        known[new] = -sign * sum(sign * known[v] for v, sign in addends)
    assert sum(sign * known[v] for v, sign in sums[-1]) == pytest.approx(x.sum())


def test_a_hundred_bodies_on_one_shaft() -> None:
    class Shaft(gl.Component):
        def assemble(self) -> list[Any]:
            self.body = [gp.Inertia(J=0.5) for _ in range(100)]
            self.torque = gp.Torque(tau=100.0)
            return [c(self.torque.flange, *(b.flange_a for b in self.body))]

    result = gl.simulate(Shaft(), 1.0, samples=2, outputs=["body[99].w", "body[3].flange_a.tau"])
    assert result["body[99].w"][-1] == pytest.approx(2.0)
    assert result["body[3].flange_a.tau"][-1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("m.ww", r"the model has no variable 'm\.ww'; did you mean 'm\.w'"),
        ("n.w", r"the model has no variable 'n\.w'; did you mean 'm\.w'"),
        ("m", r"'m' is a component, no variable; name one of its variables: m\.flange_a\.phi"),
        ("typo", r"the model has no variable 'typo'; .*other\.w"),
        ("", "the model has no variable ''"),
        (3, "3 is not a name; names are strings"),
    ],
)
def test_unknown_variables(name: Any, message: str) -> None:
    with pytest.raises(NameLookupError, match=message):
        flatten(part(J=1.0)).variable(name)


def test_names_with_units_and_descriptions_are_kept() -> None:
    model = flatten(part(J=1.0))
    declared = model.declaration(model.variable("m.w"))
    assert declared is not None
    assert (declared.unit, declared.description) == ("rad/s", "angular velocity")
    assert [model.name(model.variable(n)) for n in model.names()] == list(model.names())


def test_error_of_a_foreign_connection_names_the_composite() -> None:
    class Inside(gl.Component):
        def assemble(self) -> list[Any]:
            self.a = gp.Inertia(J=1.0)
            return [c(self.a.flange_a, gp.Inertia(J=1.0).flange_a)]

    class Model(gl.Component):
        def assemble(self) -> list[Any]:
            self.inside = Inside()
            return []

    with pytest.raises(ConnectionError, match="inside: connects Inertia 'flange_a', which is not part of it"):
        flatten(Model())


class Chain(gl.Component):
    """A torque on a row of bodies, each joined to the next; or the last one twice, by both of its flanges."""

    bodies = gl.Structural(3)
    ring = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.torque, self.body = gp.Torque(), [gp.Inertia(J=1.0) for _ in range(self.bodies)]
        flanges = [self.torque.flange, *(f for body in self.body for f in (body.flange_a, body.flange_b))]
        last = [c(self.body[-1].flange_b, self.body[0].flange_a)] if self.ring else []
        return [*(c(one, other) for one, other in zip(flanges[::2], flanges[1::2], strict=False)), *last]


@pytest.mark.parametrize("ring", [False, True])
@pytest.mark.parametrize("bodies", [1, 3])
def test_equations_are_counted(bodies: int, ring: bool) -> None:
    """As many as there are variables but the input; what an equation says again of aliases is counted apart."""
    model = flatten(Chain(bodies=bodies, ring=ring))
    assert model.n_equations == model.n_variables - 1
    assert model.n_connection_sets == bodies
    left = sum(map(len, model.groups))
    unknown = {int(model.representative[v]) for v in range(model.n_variables) if model.sign[v]} - {*model.inputs.tolist()}
    assert left == model.n_equations - model.n_aliases - model.redundant
    assert model.redundant == ring, "the angles of a ring of rigid bodies are equal by all equations but one"
    assert len(unknown) == left + ring


@pytest.mark.parametrize("springs", [4, 5])
def test_a_sum_whose_flows_all_cancel_is_an_equation_that_says_nothing(springs: int) -> None:
    """Whether it is long enough to be looked at before it is split or not; springs between a node and itself."""

    class Node(gl.Component):
        def assemble(self) -> list[Any]:
            self.spring = [gp.Spring(c=1.0) for _ in range(springs)]
            return [c(*(f for s in self.spring for f in (s.flange_a, s.flange_b)))]

    model = flatten(Node())
    assert model.n_equations == model.n_variables == model.auxiliary
    left = sum(map(len, model.groups))
    assert (left, model.redundant) == (springs, 1), "the law of each spring is left"
    assert model.n_aliases == model.n_equations - springs - 1
    still = {name for name in model.names() if not model.sign[model.variable(name)]}
    assert still == {f"spring[{k}].{name}" for k in range(springs) for name in ("phi_rel", "w_rel")}


def test_a_flow_that_is_left_alone_in_a_long_sum_is_zero() -> None:
    """Of five springs between a node and itself and a body there: as many equations as unknowns are left."""

    class Node(gl.Component):
        def assemble(self) -> list[Any]:
            self.spring, self.body = [gp.Spring(c=1.0) for _ in range(5)], gp.Inertia(J=1.0)
            return [c(self.body.flange_a, *(f for s in self.spring for f in (s.flange_a, s.flange_b)))]

    model = flatten(Node())
    assert model.n_equations == model.n_variables == model.auxiliary
    alone = [g for g in model.groups if g.variables.shape[1] == 1 and model.owner(model.groups.index(g), 0) == "connection"]
    assert [g.variables.tolist() for g in alone] == [[[model.representative[model.variable("body.flange_a.tau")]]]]
    unknown = {int(model.representative[v]) for v in range(model.n_variables) if model.sign[v]}
    assert sum(map(len, model.groups)) == len(unknown)


def test_an_equation_that_says_nothing_of_equal_variables_is_redundant() -> None:
    """Where x = y, x' = y' is 0 = 0; no other variable is changed by it."""

    class Repeated(gl.Component):
        free, other, w, x, y = (gl.Variable("1") for _ in range(5))

        def equations(self) -> list[gl.Eq]:
            law = [gl.Eq(self.w * self.free, 1.0), gl.Eq(gl.der(self.x), self.w)]
            return [*law, gl.Eq(self.x, self.y), gl.Eq(gl.der(self.x), gl.der(self.y))]

    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = [Repeated(), Repeated()]
            return []

    model = flatten(Two())
    assert (model.n_equations, model.n_aliases, model.redundant) == (8, 2, 2)
    assert sum(map(len, model.groups)) == 4
    assert model.sign.tolist() == [1] * 10
    assert model.representative.tolist() == [0, 1, 2, 3, 3, 5, 6, 7, 8, 8]


@pytest.mark.parametrize("across", [False, True])
def test_what_lies_in_series_with_parts_side_by_side_carries_the_same(across: bool) -> None:
    """Also where a part beside them lies across one rigid set, whose equations are simplified first."""

    class Model(gl.Component):
        def assemble(self) -> list[Any]:
            self.wall, self.front, self.damper = gp.Fixed(), gp.Spring(c=1.0), [gp.Damper(d=1.0), gp.Damper(d=2.0)]
            self.body, self.other = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            one, two = self.damper
            links = [c(self.wall.flange, self.front.flange_a), c(self.body.flange_b, self.other.flange_a)]
            if across:
                self.spring = gp.Spring(c=1.0)
                links += [c(self.spring.flange_a, self.body.flange_b), c(self.spring.flange_b, self.other.flange_b)]
            between = [c(self.front.flange_b, one.flange_a, two.flange_a), c(one.flange_b, two.flange_b, self.body.flange_a)]
            return [*links, *between]

    model = flatten(Model())
    carried = {int(model.representative[model.variable(name)]) for name in ("front.tau", "body.flange_a.tau")}
    assert len(carried) == 1
    assert model.n_equations == model.n_variables
    unknown = {int(model.representative[v]) for v in range(model.n_variables) if model.sign[v]}
    assert sum(map(len, model.groups)) == len(unknown)


def test_the_first_value_out_of_its_bounds_is_named() -> None:
    class Pair(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other, self.third = (gp.Inertia(J=j) for j in (1.0, -2.0, -3.0))
            return []

    with pytest.raises(BoundError, match=r"^other\.J is -2; expected at least 0$"):
        flatten(Pair())
