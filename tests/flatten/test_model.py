"""Flat models: parameters that follow from others, variables by name, and the variables in each derivative of an equation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.equations.kernel import differentiated
from gearlib.errors import NameLookupError
from gearlib.flatten.flatten import check_bounds, flatten, out_of_bounds
from gearlib.flatten.model import FlatModel, ParameterTable, alphabetical
from tests.stress.test_right_calls import given


class Part(gl.Component):
    """Some equations of every kind, and values that follow from others."""

    a = gl.Parameter("1", "free", default=2.0, min=-10, max=10)
    b = gl.Parameter("1", "of a", default=lambda s: s.a**2 + 1)
    c = gl.Parameter("1", "of both", default=lambda s: s.a * s.b, max=1e6)
    d = gl.Parameter("1", "free, too", default=0.5)
    x = gl.Variable("1", "state", start=1.0)
    y = gl.Variable("1", "its square", guess=4.0, min=-1.0)
    z = gl.Variable("1", "minus x", guess=9.0)
    rate = gl.Derivative("x", "1/s", "of x")
    n = gl.Discrete("count", start=3.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), -self.c * self.x + self.d),
            gl.Eq(self.y, self.x**2),
            gl.Eq(self.z, -self.x),
            gl.Eq(self.n, gl.Piecewise((gl.pre(self.n) + 1, self.x > 0.5), (0, True))),
        ]


class Whole(gl.Component):
    k = gl.Parameter("1", "of the whole", default=1.5)

    def assemble(self) -> list[Any]:
        self.part = [Part(a=self.k * 2), Part(d=self.k)]
        return []


class OfMany(gl.Component):
    """A part with fourteen variables."""

    def assemble(self) -> list[Any]:
        variables = {f"x{k}": gl.Variable("1") for k in range(14)}
        equations = {"equations": lambda part: [gl.Eq(getattr(part, name), k) for k, name in enumerate(variables)]}
        self.part = type("Many", (gl.Component,), variables | equations)()
        return []


@pytest.fixture(scope="module")
def model() -> FlatModel:
    return flatten(Whole())


def by_hand(k: float = 1.5, a: float | None = None, b: float | None = None) -> dict[str, float]:
    """Of the first part; ``a`` and ``b`` may be given themselves."""
    a = 2 * k if a is None else a
    b = a**2 + 1 if b is None else b
    other = {"part[1].a": 2.0, "part[1].b": 5.0, "part[1].c": 10.0, "part[1].d": k}
    return {"k": k, "part[0].a": a, "part[0].b": b, "part[0].c": a * b, "part[0].d": 0.5, **other}


def named(table: ParameterTable, values: Any) -> dict[str, float]:
    return {name: float(v) for name, v in zip(table.names, values, strict=True) if not name.startswith("start(")}


@pytest.mark.parametrize("some", [{}, {"k": 2.0}, {"a": -1.0}, {"k": 3.0, "b": 7.0}, {"a": 0.5, "b": 1.0}])
def test_what_follows_from_what_is_given_is_computed_again(model: FlatModel, some: dict[str, float]) -> None:
    table = model.parameters
    numbers = {table.number(n if n == "k" else f"part[0].{n}"): value for n, value in some.items()}
    assert named(table, table.evaluate(numbers)) == pytest.approx(by_hand(**some), rel=1e-15)
    assert named(table, table.evaluate(numbers)) == pytest.approx(by_hand(**some), rel=1e-15), "also for the second time"
    assert named(table, table.defaults) == pytest.approx(by_hand(), rel=1e-15), "the defaults are left as they were"
    many = table.evaluate_many({p: np.array([v, v + 1]) for p, v in numbers.items()}, 2)
    for run in range(2):
        assert named(table, many[:, run]) == pytest.approx(by_hand(**{n: v + run for n, v in some.items()}), rel=1e-15)


def test_rates_of_what_follows_from_parameters(model: FlatModel) -> None:
    table = model.parameters
    seeds, held = [table.number("k"), table.number("part[1].a")], [table.number("part[0].b")]
    for known in ([], held):
        values = table.evaluate({p: 7.0 for p in known})
        found = np.zeros((len(table.names), 2))
        for p, seed, rate in table.derivatives(values, seeds, known):
            found[p, seed] += rate
        for column, p in enumerate(seeds):
            h = 1e-6
            up, down = (table.evaluate({**{q: 7.0 for q in known}, p: values[p] + s * h}) for s in (1, -1))
            assert found[:, column] == pytest.approx((up - down) / (2 * h), rel=1e-8, abs=1e-8)


def test_bounds_are_inclusive_and_named(model: FlatModel) -> None:
    table = model.parameters
    a = table.number("part[1].a")
    for value, right in ((-10.0, True), (10.0, True), (-10.0001, False), (10.0001, False), (np.nan, False)):
        values = table.evaluate({a: value})
        assert (
            table.within_bounds(values)
            == table.within_bounds(values, {a: value})
            == right
            == (not out_of_bounds(table, values).any())
        )
    k = table.number("k")
    for value, right in ((5.0, True), (5.1, False)):  # which is half of part[0].a
        assert table.within_bounds(table.evaluate({k: value}), {k: value}) == right
        other = flatten(Whole()).parameters  # which did not compute them
        assert other.within_bounds(table.evaluate({k: value}), {k: value}) == right
    both = np.column_stack([table.defaults, table.evaluate({a: 11.0})])
    assert out_of_bounds(table, both).sum(axis=0).tolist() == [0, 1]
    wrong = {
        -10.5: r"part\[1\]\.a is -10\.5; expected at least -10",
        11.0: "is 11; expected at most 10",
        10.0000001: r"is 10\.0000001; expected at most 10\.0",
        np.inf: "is inf; expected a finite",
    }
    for value, message in wrong.items():
        with pytest.raises(gl.GearlibError, match=message):
            check_bounds(table, table.evaluate({a: value}))


def test_bounds_of_a_parameter_that_no_other_follows_from_are_inclusive() -> None:
    table = flatten(type("Alone", (gl.Component,), {"p": gl.Parameter("1", default=0.0, min=-2.0, max=3.0)})()).parameters
    for value, right in ((-2.0, True), (3.0, True), (-2.001, False), (3.001, False), (np.nan, False), (-np.inf, False)):
        assert table.within_bounds(table.evaluate({0: value}), {0: value}) == right
    free = flatten(type("Free", (gl.Component,), {"p": gl.Parameter("1", default=0.0)})()).parameters
    for value, right in ((-1e308, True), (1e308, True), (np.inf, False), (-np.inf, False), (np.nan, False)):
        assert free.within_bounds(free.evaluate({0: value}), {0: value}) == free.within_bounds(np.array([value])) == right


def test_rates_of_parameters_beside_one_that_is_given() -> None:
    """In a row of parts the middle one's b is given; those of the others follow from a: b = a^2 + 1, c = a b."""

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.part = [Part() for _ in range(3)]
            return []

    table = flatten(Row()).parameters
    seeds, held = [table.number(f"part[{k}].a") for k in range(3)], table.number("part[1].b")
    a = [1.5, -2.0, 3.0]
    values = table.evaluate({held: 7.0, **dict(zip(seeds, a, strict=True))})
    found = {(table.names[p], k): rate for p, k, rate in table.derivatives(values, seeds, [held])}
    expected = {(f"part[{k}].a", k): 1.0 for k in range(3)} | {("part[1].c", 1): 7.0}
    expected |= {(f"part[{k}].b", k): 2 * a[k] for k in (0, 2)} | {(f"part[{k}].c", k): 3 * a[k] ** 2 + 1 for k in (0, 2)}
    assert found == pytest.approx(expected)


def test_names_of_parameters(model: FlatModel) -> None:
    table = model.parameters
    assert set(table.own_names) == set(by_hand())
    assert [table.names[table.number(name)] for name in table.own_names] == table.own_names
    with pytest.raises(NameLookupError, match=r"the model has no parameter 'part\[0\]\.e' to be fitted; did you mean"):
        table.number("part[0].e", " to be fitted")


def test_variables_by_name(model: FlatModel) -> None:
    for name in model.names():
        assert model.name(model.variable(name)) == name
        assert model.find(name) == model.variable(name)
    assert model.find("part[0]") is model.find("part[2].x") is model.find("x") is None
    assert model.column("part[0].rate") == ("part[0].x", 1)
    assert model.column("der(der(part[0].rate))") == ("part[0].x", 3)
    assert model.column("der(part[1].x)") == ("part[1].x", 1)
    with pytest.raises(
        NameLookupError, match=r"'part\[0\]' is a component, no output; name one of its variables: part\[0\]\.x, "
    ):
        model.variable("part[0]", "output")
    with pytest.raises(NameLookupError) as told:
        flatten(OfMany()).variable("part")
    assert str(told.value).endswith(f"name one of its variables: {', '.join(f'part.x{k}' for k in range(12))}")  # of fourteen
    least = [(i, v.min) for i in range(model.auxiliary) if (v := model.declaration(i)) is not None and v.min > -1e300]
    assert list(model.bounded) == least == [(model.variable(f"part[{i}].y"), -1.0) for i in range(2)]


def test_what_a_wrong_name_may_mean_is_in_the_component_that_it_begins_with() -> None:
    class Outer(gl.Component):
        k = gl.Variable("1")

        def assemble(self) -> list[Any]:
            self.whole, self.many = Whole(), OfMany()
            return []

        def equations(self) -> list[Any]:
            return [gl.Eq(self.k, 1.0)]

    model = flatten(Outer())
    for name, known in (("whole.part[1].velocity", ["x", "y", "z"]), ("velocity", ["k"])):
        with pytest.raises(NameLookupError) as told:
            model.variable(name)
        prefix = name.removesuffix("velocity")
        assert str(told.value).endswith(f": {', '.join(prefix + local for local in known)}")
    with pytest.raises(NameLookupError, match=r"no variable 'nowhere\.velocity'; .*k, many\.part\.x0, "):
        model.variable("nowhere.velocity")


def test_start_values_and_guesses(model: FlatModel) -> None:
    """A fixed one comes last, so that it counts where both are of one variable; signs are those of the aliases."""
    defaults = model.parameters.defaults
    for found, names in ((model.guessed, "yzx"), (model.fixed, "x")):
        representatives, signs, slots = found
        assert len(slots) == 2 * len(names)
        start = {}
        for r, sign, slot in zip(representatives.tolist(), signs.tolist(), slots.tolist(), strict=True):
            start[r] = sign * defaults[slot]
        x, y = (int(model.representative[model.variable(f"part[0].{n}")]) for n in "xy")
        assert start[x] * model.sign[model.variable("part[0].x")] == 1.0
        assert start.get(y) == (4.0 if "y" in names else None)
    assert model.fixed_once

    class Twice(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = gp.Inertia(J=1.0, start={"phi": 1.0}), gp.Inertia(J=1.0, start={"phi": 1.0})
            return [gl.connect(self.one.flange_b, self.other.flange_a)]

    assert not flatten(Twice()).fixed_once


def test_the_discrete_state_before_anything_is_evaluated(model: FlatModel) -> None:
    """Relations are false, a discrete variable and its value before are where they start, and the run is being started."""
    assert model.discretes == ("part[0].n", "part[1].n")
    assert (model.n_relations, model.n_discrete) == (2, 7)
    assert model.initial_discrete().tolist() == [0, 0, 3, 3, 3, 3, 1]
    assert model.initial_discrete(np.array([5.0, 6.0])).tolist() == [0, 0, 5, 6, 5, 6, 1]
    assert model.same_names(model)
    assert not model.same_names(flatten(Part()))
    for other in ({"updates": ()}, {"discretes": ()}, {"instances": model.instances[:-1]}):
        assert not model.same_names(replace(model, **other))
        assert not replace(model, **other).same_names(model)
    assert flatten(gp.Inertia(J=1.0)).n_discrete == 0


def test_variables_in_the_derivatives_of_an_equation(model: FlatModel) -> None:
    for e, (g, i) in enumerate(model.places):
        group = model.groups[g]
        assert model.first_equations[g] + i == e
        assert model.owner(g, i) == f"part[{i}]"
        for k in range(3):
            expected = set()
            for name, order in differentiated(group.template, k).columns:
                j = group.template.locals.index(name)
                expected |= {(int(group.variables[i, j]), order)} if group.signs[i, j] else set()
            assert set(model.nodes(e, k)) == expected
            assert len(model.nodes(e, k)) == len(expected)


@pytest.mark.parametrize("signs", [[[1, 1]], [[0, 1]], [[0, -1], [1, -1], [0, 0]], [[-1, 0], [-1, -1]]])
def test_variables_that_are_zero_are_in_no_equation(model: FlatModel, signs: list[list[int]]) -> None:
    (group,) = (g for g in model.groups if set(g.template.columns) == {("y", 0), ("x", 0)})
    rows = np.zeros(len(signs), np.int64)
    some = replace(group.take(rows, group.template), signs=np.array(signs, np.int64))
    (whole,) = {tuple(nodes) for nodes in replace(some, signs=np.ones_like(some.signs)).nodes}
    columns = [j for j, _ in group.template.local_columns]
    assert some.nodes == [[node for node, j in zip(whole, columns, strict=True) if row[j]] for row in signs]


def test_ranks_do_not_depend_on_the_order_of_declaration() -> None:
    """The deepest first, then by name with numbers as numbers."""

    class Several(gl.Component):
        backwards = gl.Structural(False)

        def assemble(self) -> list[Any]:
            names = ["b", "a", "row"]
            for name in reversed(names) if self.backwards else names:
                setattr(self, name, [gp.Inertia(J=1.0) for _ in range(11)] if name == "row" else gp.Inertia(J=1.0))
            self.z_deep = Whole()  # whose parts come first
            return [gl.connect(self.a.flange_b, self.b.flange_a)]

    orders = []
    for backwards in (False, True):
        model = flatten(Several(backwards=backwards))
        names: dict[int, list[str]] = {}
        for name in sorted(model.names()):
            variable = model.variable(name)
            if model.sign[variable]:
                names.setdefault(int(model.representative[variable]), []).append(name)
        orders.append([names[v] for v in sorted(names, key=model.ranks.__getitem__)])
        declared = [f"{i.path}.{name}".lstrip(".") for i in model.instances for name in i.declared.variables]
        owner = {f"{i.path}.{name}".lstrip("."): i.path for i in model.instances for name in i.declared.variables}
        places = {
            name: k for k, name in enumerate(sorted(declared, key=lambda n: (-owner[n].count("."), alphabetical(owner[n]))))
        }
        assert {v: model.ranks[v] for v in names} == {v: max(places[n] for n in names[v]) for v in names}
    assert orders[0] == orders[1]
    rows = [names[0].split(".")[0] for names in orders[0] if names[0].endswith("].w")]
    assert rows == [f"row[{i}]" for i in range(11)]
    assert sorted(["b[10]", "b[9].x", "b", "a2", "a10", "a"], key=alphabetical) == ["a", "a2", "a10", "b", "b[9].x", "b[10]"]


class Governed(gl.Component):
    """A torque that depends on a comparison, a body, and a counter of its turns."""

    compared: Callable[[Any], Any] = staticmethod(lambda w: w > 0.5)
    low, J, start, step, least, nominal = 1.0, 2.0, 0.25, 2.0, 0.0, 3.0
    fixed, turned, reset, state, shifted = True, False, False, "default", False

    def assemble(self) -> list[Any]:
        start = {"start" if self.fixed else "guess": {"w": self.start}}
        self.body = gp.Inertia(J=self.J, nominal={"w": self.nominal}, state={"w": self.state}, **start)
        self.torque = gp.Torque(tau=gl.Piecewise((self.low, self.compared(self.body.w)), (4.0, True)))
        self.counter = self.counted()()
        return [gl.connect(self.torque.flange, self.body.flange_b if self.turned else self.body.flange_a)]

    def counted(self) -> type[gl.Component]:
        class Counter(gl.Component):
            p = gl.Parameter("1", default=self.step, min=self.least)
            q = gl.Parameter("1", default=(lambda part: part.p + 2) if self.shifted else lambda part: 2 * part.p)
            n = gl.Discrete("count", start=self.step)
            x = gl.Variable("1", start=0.0)

            def equations(part) -> list[Any]:  # noqa: N805
                law = [gl.Eq(part.n, gl.pre(part.n) + part.q), *([gl.reinit(part.x, 0.0)] if self.reset else [])]
                return [gl.When(part.x > 1, *law), gl.Eq(gl.der(part.x), part.p)]

        return Counter


def test_digests_tell_models_apart() -> None:
    """Also where nothing but the direction of a comparison differs, whose equation has no text of its own."""
    changes: list[dict[str, Any]] = [
        {}, {"compared": lambda w: w >= 0.5}, {"compared": lambda w: w < 0.5}, {"compared": lambda w: w <= 0.5},
        {"compared": lambda w: w > 0.75}, {"low": 3.0}, {"J": 5.0}, {"start": 0.5}, {"step": 5.0}, {"least": -1.0},
        {"nominal": 7.0}, {"fixed": False}, {"turned": True}, {"reset": True}, {"state": "avoid"}, {"shifted": True},
    ]  # fmt: skip
    found = []
    for change in changes:
        kind = type("Governed", (Governed,), {k: staticmethod(v) if callable(v) else v for k, v in change.items()})
        found.append(flatten(kind()).digest)
    assert len(set(found)) == len(found)
    assert flatten(Governed()).digest == found[0]
    assert flatten(type("Other", (Governed,), {})()).digest not in found


class Star(gl.Component):
    """So many bodies on one shaft that the sum of their torques is split, and a part with a signal of any unit."""

    bodies = gl.Structural(12)

    def assemble(self) -> list[Any]:
        self.body, self.torque = [gp.Inertia(J=1.0) for _ in range(self.bodies)], gp.Torque()
        self.gain = gp.blocks.Gain(k=2.0, u=self.body[0].w)
        return [gl.connect(self.torque.flange, *(body.flange_a for body in self.body))]


def test_variables_that_split_a_sum_have_names_but_no_declaration() -> None:
    """13 addends: two sums, of 7 and of 6 of them; their units are not known, as those of signals."""
    model = flatten(Star())
    assert model.n_variables == model.auxiliary + 1 == len(list(model.names())) + 1
    assert given(lambda: model.name(model.auxiliary)) == "flow_sum[0]"
    assert given(lambda: model.declaration(model.auxiliary)) is None
    assert model.unit(model.auxiliary) == ""
    last = model.auxiliary - 1
    assert (model.name(last), model.unit(last)) == ("gain.u", "any")
    owners = {
        (g.template.label.startswith("sum of"), model.owner(k, i)) for k, g in enumerate(model.groups) for i in range(len(g))
    }
    assert owners == {(True, "connection"), (False, "gain"), *((False, f"body[{k}]") for k in range(12))}
    assert flatten(gp.Inertia(J=1.0)).owner(0, 0) == "Inertia"
    two = flatten(Star(bodies=18))  # of 19
    assert [two.name(v) for v in range(two.auxiliary, two.n_variables)] == ["flow_sum[0]", "flow_sum[1]"]
    others = replace(model, flow=np.zeros_like(model.flow))
    assert others.name(model.auxiliary) == "sum[0]"
    known = {"rad": [0, 0, 0, 0, 0], "rad/s": [0, 0, -1, 0, 0], "rad/s2": [0, 0, -2, 0, 0], "N.m": [1, 2, -2, 0, 0]}
    unknown = [np.nan] * 5
    expected = [known.get(model.unit(v), unknown) for v in range(model.n_variables)]  # of kg, m, s, K, A
    np.testing.assert_array_equal(model.exponents, expected)
    assert {model.unit(v) for v in range(model.n_variables)} <= {*known, "any", ""}


def test_relations_are_numbered_group_by_group_with_those_of_updates_last(model: FlatModel) -> None:
    counts = [len(g.template.relations) * len(g) for g in model.groups]
    counts += [len(u.equations.template.relations) * len(u.equations) for u in model.updates]
    assert model.first_relations.tolist() == [sum(counts[:k]) for k in range(len(counts) + 1)]
    assert sum(counts) == 2
    assert model.n_relations == 2
    reduced = model.with_groups(model.groups[:1], 3)
    assert (len(reduced.groups), reduced.redundant, reduced.updates) == (1, 3, model.updates)


class Supervised(gl.Component):
    """Parts with laws of their own, and laws over their names, also at events."""

    p, q, r = (gl.Parameter("1", default=value) for value in (0.5, 0.75, 0.25))
    u, v = gl.Variable("1"), gl.Variable("1", start=0.0)
    m, n = gl.Discrete(), gl.Discrete(start=2.0)

    def assemble(self) -> list[Any]:
        self.part = [Part(), Part(d=self.q)]
        return []

    def equations(self) -> list[Any]:
        first, second = self.part
        return [
            gl.Eq(self.u, self.r * first.y + second.d * second.z),
            gl.Eq(gl.der(self.v), second.b * first.x),
            gl.When(self.u > self.q, gl.reinit(self.v, self.p * second.x), gl.Eq(self.n, gl.pre(self.n) + self.r * second.y)),
            gl.When(first.x > self.r, gl.Eq(self.m, gl.pre(self.n) + self.q * first.z)),
        ]


def test_equations_are_over_the_names_of_their_owner() -> None:
    """Those of several parts of a class, and of a composite, whose names have paths; events follow after equations."""

    class Outer(gl.Component):
        def assemble(self) -> list[Any]:
            self.other, self.one, self.two = Part(), Supervised(), Supervised()
            self.spring = [gp.SpringDamper(c=1.0, d=2.0) for _ in range(2)]
            return []

    model, names = flatten(Outer()), flatten(Outer()).parameters.names
    owners = set()
    for group in (*model.groups, *(update.equations for update in model.updates)):
        for i, owner in enumerate(group.owners.tolist()):
            path = model.instances[owner].path
            owners.add(path)
            assert [names[p] for p in group.parameters[i]] == [f"{path}.{name}" for name in group.template.parameters]
            numbers = [model.variable(f"{path}.{name}") for name in group.template.locals]
            assert group.variables[i].tolist() == model.representative[numbers].tolist()
            assert group.signs[i].tolist() == model.sign[numbers].tolist()
            for k, name in zip(group.discretes[i].tolist(), group.template.discretes, strict=True):
                assert (name.startswith("pre("), f"{path}.{name.removeprefix('pre(').removesuffix(')')}") == (
                    k >= len(model.discretes), model.discretes[k % len(model.discretes)],
                )  # fmt: skip
    composites = {f"{path}{part}" for path in ("one", "two") for part in ("", ".part[0]", ".part[1]")}
    assert owners == {"other", "spring[0]", "spring[1]", *composites}
    changed = [
        (model.name(target) if update.reinit else model.discretes[target], model.instances[owner].path)
        for update in model.updates
        for target, owner in zip(update.targets.tolist(), update.equations.owners.tolist(), strict=True)
    ]
    own = [(f"{path}.{name}", path) for path in ("one", "two") for name in ("v", "m", "n", "when_0", "when_1")]
    parts = ["other", *(f"{path}.part[{k}]" for path in ("one", "two") for k in range(2))]
    assert sorted(changed) == sorted([*own, *((f"{path}.n", path) for path in parts)])
