"""Equations of a steady motion part by part: rows that are put together, rows that hang together, and what is refused by name."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.statics import steady_motion
from gearlib.statics.steady_motion import (
    Given,
    MatrixAssembly,
    MotionEquations,
    guesses,
    kinematics,
    motion_from,
    refuse_contradiction,
    refuse_unsettled,
    unit_sizes,
)


def test_blocks_of_rows_stand_below_each_other() -> None:
    entries = MatrixAssembly()
    entries.put(np.array([0, 1]), np.array([2, 0]), np.array([5.0, 6.0]))
    entries.put(np.array([1]), np.array([1]), np.array([7]))
    entries.count += 2
    entries.put(np.array([0]), np.array([2]), np.array([8.0]))
    entries.put(np.array([0]), np.array([2]), np.array([1.5]))
    entries.count += 1
    assert entries.matrix(4).toarray().tolist() == [[0, 0, 5, 0], [6, 7, 0, 0], [0, 0, 9.5, 0]]
    assert entries.matrix(3).dtype == np.float64


def test_rows_on_which_an_unknown_depends_are_those_that_hang_together() -> None:
    """A zero joins nothing, nor does a row with torques."""
    table = np.array(
        [[1, 1, 0, 0, 0, 0], [0, 1, 2, 0, 0, 0], [0, 0, 3, 1, 0, 0], [0, 0, 0, 1, 1, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 4]], float
    )  # fmt: skip
    matrix = sparse.csr_matrix(table)
    matrix.data[4] = 0.0  # in the third row, at the third unknown
    kinematic = np.array([True, True, True, False, True, True])
    rows = MotionEquations(matrix, np.zeros(6), kinematic, str, np.ones(6), np.zeros(3, bool))
    for wanted, chosen in (([0], [0, 1]), ([2], [0, 1]), ([3], [2]), ([4], [4]), ([5], [5]), ([1, 5], [0, 1, 5])):
        factors, found = steady_motion.connected(rows, np.array(wanted))
        assert found.tolist() == chosen, wanted
        assert factors.matrix.toarray() == pytest.approx(matrix.toarray()[chosen])


class Product(gl.Component):
    """A gear whose ratio follows from a variable that is twice a parameter."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    half = gl.Parameter("1", default=1.5)
    ratio, wa, wb = gl.Variable("1"), gl.Variable("rad/s"), gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        return [
            gl.Eq(self.ratio, 2 * self.half), gl.Eq(self.wa, gl.der(a.phi)), gl.Eq(self.wb, gl.der(b.phi)),
            gl.Eq(self.wa, self.ratio * self.wb), gl.Eq(b.tau, -self.ratio * a.tau),
        ]  # fmt: skip


@cache
def variable() -> gl.System:
    class Geared(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.gear, self.b = gp.Inertia(J=1.0, start={"w": 6.0}), Product(), gp.Inertia(J=1.0, guess={"w": -2.0})
            return [gl.connect(self.a.flange_b, self.gear.flange_a), gl.connect(self.gear.flange_b, self.b.flange_a)]

    return gl.compile(Geared())


@pytest.mark.parametrize("half", [1.5, -0.25])
def test_a_ratio_that_follows_from_other_equations_counts_with_its_value(half: float) -> None:
    """Kinematic equations are linear about it, with residuals at zero unknowns."""
    system = variable()
    assert gl.speed_ratio(system, "a.w", "b.w", parameters={"gear.half": half}) == pytest.approx(2 * half)
    assert gl.mobility(system, parameters={"gear.half": half}) == 1
    translation = system.translation
    model, numbers = translation.model, translation.parameter_values({"gear.half": half})
    rows = steady_motion.kinematic_rows(model, numbers, [], model.initial_discrete())
    n = model.n_variables

    def place(name: str) -> tuple[int, int]:
        v = model.variable(name)
        return int(model.representative[v]), int(model.sign[v])

    x = np.zeros(2 * n)
    for name, value in (
        ("gear.ratio", 2 * half),
        ("gear.wa", 2 * half * 7.0),
        ("gear.wb", 7.0),
        ("a.w", 14 * half),
        ("b.w", 7.0),
    ):
        v, sign = place(name)
        x[v] = sign * value
    for name, rate in (("gear.flange_a.phi", 14 * half), ("gear.flange_b.phi", 7.0)):
        v, sign = place(name)
        x[n + v] = sign * rate
    met = (rows.residual + rows.matrix @ x)[rows.kinematic]
    assert met == pytest.approx(np.zeros(len(met)), abs=1e-12)
    again, factors, chosen = kinematics(model, numbers, np.array([place("a.w")[0]]))
    assert again.kinematic[chosen].all()
    assert factors.matrix.toarray() == pytest.approx(again.matrix.toarray()[chosen])


def test_start_values_and_guesses_of_speeds_say_near_which_motion_to_look() -> None:
    class Started(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0, start={"w": 6.0, "phi": 4.0}), gp.Inertia(J=1.0, guess={"w": -2.0})
            self.c, self.shaft = gp.Inertia(J=1.0, start={"w": 0.0}), gp.SpringDamper(c=9.0, d=1.0, start={"phi_rel": 0.5})
            return [gl.connect(self.a.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.b.flange_a)]

    translation = gl.compile(Started()).translation
    model = translation.structure.complete
    found = guesses(model, translation.parameter_values({}))
    expected = {}
    for name, value in (("a.w", 6.0), ("b.w", -2.0), ("shaft.phi_rel", 0.5)):
        v = model.variable(name)
        expected[int(model.representative[v])] = value * int(model.sign[v])
    assert {g.variable: g.value for g in found} == expected
    assert {(g.name, g.order) for g in found} == {("guess", 0)}


def test_each_row_is_that_of_the_component_whose_variables_it_holds() -> None:
    """Three of a kind each; below them stand torques that do not grow, then what is given."""

    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.body = [gp.Inertia(J=1.0) for _ in range(4)]
            self.gear = [Product() for _ in range(3)]
            ends = zip(self.body, self.gear, self.body[1:], strict=False)
            return [
                link
                for a, gear, b in ends
                for link in (gl.connect(a.flange_b, gear.flange_a), gl.connect(gear.flange_b, b.flange_a))
            ]

    translation = gl.compile(Row()).translation
    model, n = translation.structure.complete, translation.structure.complete.n_variables
    given = [Given("the speed", int(model.representative[model.variable("body[0].w")]), 0, 3.0)]
    x = np.linspace(1.0, 2.0, n)
    rows = steady_motion.assemble(model, translation.parameter_values({}), given, x, x, model.initial_discrete())
    names = list(model.names())
    held: dict[str, set[int]] = {}
    for name in names:
        held.setdefault(name.split(".")[0], set()).add(int(model.representative[model.variable(name)]))
    owners: list[str] = []
    for i in range(rows.matrix.shape[0]):
        owners.append(rows.owner(i))
        found = set((rows.matrix[i].indices[rows.matrix[i].data != 0.0] % n).tolist())
        assert owners[-1] in ("connection", "the speed") or found <= held[owners[-1]], (i, owners[-1])
    assert owners[-1] == "the speed"
    steady = int((model.flow & (model.representative == np.arange(n))).sum())
    assert owners[-1 - steady : -1] == ["connection"] * steady
    assert {*owners} == {*held, "connection", "the speed"}


@pytest.mark.parametrize(
    ("law", "start", "reached"),
    [(lambda w: w**3 - 2 * w + 2, -1.5, -1.7692923542386314), (lambda w: (w - 1) * (w - 10), 9.0, 1.0)],
    ids=["in a circle", "to another"],
)  # fmt: skip
def test_where_no_motion_is_reached_from_rest_the_start_values_are_where_to_begin(
    law: Any, start: float, reached: float
) -> None:
    """From 0 Newton's method goes to 1 and back again; where it arrives, that is the motion, whatever the start value."""

    class Load(gl.Component):
        flange, w = gp.Flange("shaft"), gl.Variable("1")
        second, torque = gl.Parameter("s", default=1.0), gl.Parameter("N.m", default=1.0)

        def equations(self) -> list[gl.Eq]:
            speed = gl.Eq(self.w, self.second * gl.der(self.flange.phi))
            return [speed, gl.Eq(self.flange.tau, self.torque * law(self.w))]

    class Loaded(gl.Component):
        def assemble(self) -> list[Any]:
            self.load, self.body = Load(), gp.Inertia(J=1.0, start={"w": start})
            return [gl.connect(self.body.flange_a, self.load.flange)]

    translation = gl.compile(Loaded()).translation
    model = translation.structure.complete
    found = steady_motion.solve(model, translation.parameter_values({}), [])
    assert found.constants[model.representative[model.variable("load.w")]] == pytest.approx(reached, rel=1e-12)
    assert found.residual.max() < 1e-9


def stub(residual: list[float], weights: dict[int, list[float]], owners: list[str]) -> Any:
    factors = SimpleNamespace(combined=lambda row: np.array(weights[row]))
    return SimpleNamespace(residual=np.array(residual), factors=factors, owner=lambda i: owners[i])


GIVEN = [Given("a.w", 0, 0, 1.0), Given("b.tau", 1, 0, 2.0)]


@pytest.mark.parametrize(
    ("weights", "named"),
    [
        ([0.0, 1.0, -3.0, 2.0, 0.0], "third, fourth, second"), ([0.0, 0.0, 1.0, 1.1e-9, 0.9e-9], "third, fourth"),
        ([1.0, 1.0, 1.0, 0.0, 0.0], "third, second"), ([0.0, 0.0, 1e-30, 0.0, -2e-30], "third, fifth"),
    ],
)  # fmt: skip
def test_equations_that_cannot_hold_are_named_with_those_that_contradict_them(weights: list[float], named: str) -> None:
    """The worst first, then by weight; neither connections nor what is given."""
    motion = stub([0.0, 2e-8, 5e-8, 1e-9, 0.0], {2: weights}, ["connection", "second", "third", "fourth", "fifth"])
    with pytest.raises(ArgumentError) as refused:
        refuse_contradiction(motion, GIVEN)
    said = str(refused.value)
    assert said.startswith(
        f"no steady motion has the given a.w, b.tau: the equations of {named} cannot hold; give fewer values"
    )
    with pytest.raises(ArgumentError, match=r"^no steady motion has the given torques: the equations of"):
        refuse_contradiction(motion, [])


def test_six_components_are_named_at_most_and_what_holds_is_no_contradiction() -> None:
    owners = ["a.w", *(f"part[{k}]" for k in range(8))]
    with pytest.raises(ArgumentError) as refused:
        refuse_contradiction(stub([1.0, *[0.0] * 8], {0: list(np.arange(9.0, 0.0, -1.0))}, owners), GIVEN)
    assert "equations of part[0], part[1], part[2], part[3], part[4], part[5] cannot hold" in str(refused.value)
    for residual in ([0.0] * 9, [1e-8] * 9):
        refuse_contradiction(stub(residual, {}, owners), GIVEN)


def test_at_most_six_variables_that_never_settle_are_named() -> None:
    class One(gl.Component):
        a, b, c, d, e, f, g, h = (gl.Discrete(start=float(k)) for k in range(8))
        x = gl.Variable("1")

        def equations(self) -> list[Any]:
            flips = [self.b, self.c, self.d, self.e, self.f, self.g, self.h]
            return [gl.Eq(gl.der(self.x), -self.x), gl.Eq(self.a, 3.0 + self.x), *(gl.Eq(n, 1 - gl.pre(n)) for n in flips)]

    translation = gl.compile(One()).translation
    model, numbers = translation.structure.complete, translation.parameter_values({})
    motion = motion_from(model, numbers, [], np.zeros(2 * model.n_variables))
    with pytest.raises(ArgumentError) as refused:
        refuse_unsettled(model, numbers, motion)
    assert str(refused.value) == "there is no steady motion: b, c, d, e, f, g does not settle, each event changes it"


def test_a_speed_and_the_rate_of_its_angle_are_of_one_size() -> None:
    """That in which a damper of 1e-4 N.m.s/rad has a coefficient of about 1, whatever the unit of time."""

    class Damped(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.brake, self.ground = gp.Inertia(J=1.0), gp.Damper(d=1e-4), gp.Fixed()
            return [
                gl.connect(self.body.flange_b, self.brake.flange_a),
                gl.connect(self.brake.flange_b, self.ground.flange),
            ]

    translation = gl.compile(Damped()).translation
    model = translation.structure.complete
    n, zero = model.n_variables, np.zeros(model.n_variables)
    sizes = steady_motion.assemble(model, translation.parameter_values({}), [], zero, zero, model.initial_discrete()).sizes
    speed, angle, torque = (
        int(model.representative[model.variable(name)]) for name in ("body.w", "body.phi", "brake.flange_a.tau")
    )
    assert sizes[speed] == pytest.approx(sizes[n + angle])
    assert sizes[n + speed] * sizes[angle] == pytest.approx(sizes[speed] ** 2)
    assert 1e-4 * sizes[speed] / sizes[torque] == pytest.approx(1.0, rel=0.5)


def test_equations_of_a_single_coefficient_say_nothing_of_units() -> None:
    rng = np.random.default_rng(5)
    exponents = rng.integers(-2, 3, (6, 2)).astype(float)
    table = np.where(rng.random((9, 6)) < 0.6, 10.0 ** rng.uniform(-3, 3, (9, 6)), 0.0)
    table[(table != 0).sum(axis=1) < 2] = 0.0
    alone = np.diag(10.0 ** rng.uniform(-9, 9, 6))
    found = unit_sizes(sparse.csr_matrix(np.vstack([table, alone])), exponents, np.ones(15, bool))
    assert found == pytest.approx(unit_sizes(sparse.csr_matrix(table), exponents, np.ones(9, bool)), rel=1e-9)


class Cubic(gl.Component):
    """A spring without any stiffness at rest."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    k, twist = gl.Parameter("N.m/rad3", default=40.0), gl.Variable("rad", start=0.0)

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        torque = self.k * self.twist**3
        rate = gl.Eq(gl.der(self.twist), gl.der(b.phi) - gl.der(a.phi))
        return [rate, gl.Eq(b.tau, torque), gl.Eq(a.tau, -torque)]


class CubicOfTurns(gl.Component):
    """The same law of the difference of two angles that are counted from the start; both grow."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    k, x, y = gl.Parameter("N.m/rad3", default=40.0), gl.Variable("rad"), gl.Variable("rad")

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        torque = self.k * (self.y - self.x) ** 3
        rates = [gl.Eq(gl.der(self.x), gl.der(a.phi)), gl.Eq(gl.der(self.y), gl.der(b.phi))]
        return [*rates, gl.Eq(b.tau, torque), gl.Eq(a.tau, -torque)]


@pytest.mark.parametrize("kind", [Cubic, CubicOfTurns])
@pytest.mark.parametrize("tau", [-8.0, 0.0, 0.002, 500.0])
def test_a_spring_without_stiffness_at_rest_carries_a_load(kind: type[gl.Component], tau: float) -> None:
    class Row(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.drive, self.load, self.soft = gp.Torque(), gp.ConstantTorque(tau_constant=-tau), kind()
            self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            return [
                gl.connect(self.drive.flange, self.a.flange_a), gl.connect(self.a.flange_b, self.soft.flange_a),
                gl.connect(self.soft.flange_b, self.b.flange_a), gl.connect(self.b.flange_b, self.load.flange),
            ]  # fmt: skip

    flow = gl.power_flow(gl.compile(Row()), speeds={"a.w": 3.0})
    assert [flow[name].torque for name in ("drive.flange", "soft.flange_a", "soft.flange_b")] == pytest.approx(
        [-tau, tau, -tau], rel=1e-9, abs=1e-12
    )
    assert flow["soft.flange_b"].speed == pytest.approx(3.0, rel=1e-9)


def test_a_spring_that_carries_nothing_holds_its_ends_together_if_it_stiffens() -> None:
    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.c = (gp.Inertia(J=1.0) for _ in range(3))
            self.soft, self.other = Cubic(), Cubic(k=1.0)
            return [
                gl.connect(self.a.flange_b, self.soft.flange_a), gl.connect(self.soft.flange_b, self.b.flange_a),
                gl.connect(self.b.flange_b, self.other.flange_a), gl.connect(self.other.flange_b, self.c.flange_a),
            ]  # fmt: skip

    translation = gl.compile(Row()).translation
    model = translation.structure.complete
    v = model.variable("a.w")
    given = Given("a.w", int(model.representative[v]), 0, 3.0 * int(model.sign[v]))
    found = steady_motion.solve(model, translation.parameter_values({}), [given])
    speeds = np.array([model.n_variables + int(model.representative[model.variable(f"{name}.phi")]) for name in "abc"])
    assert found.undetermined[speeds] == pytest.approx([0.0] * 3, abs=1e-9)
    assert found.rates[speeds - model.n_variables] == pytest.approx([3.0] * 3, rel=1e-9)
    assert found.residual.max() < 1e-9


def test_what_grows_as_a_multiple_of_what_grows_has_the_rate_of_the_factor_that_is_found() -> None:
    """A ratio of 2 by Newton's method, r + r**3 / 10 = 2.8, of a travel that grows by 3 each second."""

    class Travel(gl.Component):
        second = gl.Parameter("s", default=1.0)
        ratio, one, other = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(self.ratio + self.ratio**3 / 10, 2.8), gl.Eq(self.second * gl.der(self.one), 3.0),
                gl.Eq(self.other, self.ratio * self.one),
            ]  # fmt: skip

    translation = gl.compile(Travel()).translation
    model = translation.structure.complete
    found = steady_motion.solve(model, translation.parameter_values({}), [])
    ratio, one, other = (int(model.representative[model.variable(name)]) for name in ("ratio", "one", "other"))
    assert found.constants[ratio] == pytest.approx(2.0, rel=1e-12)
    assert found.rates[[one, other]] == pytest.approx([3.0, 6.0], rel=1e-12)
    assert found.residual.max() < 1e-12


class Stepped(gl.Component):
    """A gear with one ratio below a limit and another above it."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    x = gl.Parameter("1", default=0.5)
    level, ratio = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        return [
            gl.Eq(self.level, self.x), gl.Eq(self.ratio, gl.Piecewise((3, self.level > 1), (2, True))),
            gl.Eq(gl.der(a.phi), self.ratio * gl.der(b.phi)), gl.Eq(b.tau, -self.ratio * a.tau),
        ]  # fmt: skip


@cache
def between(gear: Any) -> gl.System:
    class Geared(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.gear, self.b = gp.Inertia(J=1.0), gear(), gp.Inertia(J=1.0)
            return [gl.connect(self.a.flange_b, self.gear.flange_a), gl.connect(self.gear.flange_b, self.b.flange_a)]

    return gl.compile(Geared())


def test_conditions_count_as_at_first_where_touching_joins_no_more() -> None:
    system = between(Stepped)
    assert gl.speed_ratio(system, "a.w", "b.w") == pytest.approx(2.0, rel=1e-12)
    assert gl.mobility(system) == 1


class Squares(gl.Component):
    """A ratio at the end of a chain of squares."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    x = gl.Parameter("1", default=1.1)
    one, two, three, four, five = (gl.Variable("1") for _ in range(5))

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        return [
            gl.Eq(self.one, self.x), gl.Eq(self.two, self.one**2), gl.Eq(self.three, self.two**2),
            gl.Eq(self.four, self.three**2), gl.Eq(self.five, self.four**2), gl.Eq(gl.der(a.phi), self.five * gl.der(b.phi)),
            gl.Eq(b.tau, -self.five * a.tau),
        ]  # fmt: skip


class Plain(Squares):
    """The same with unknowns of which no unit is known."""

    one, two, three, four, five = (gl.Variable("any") for _ in range(5))


@pytest.mark.parametrize("squares", [Squares, Plain])
@pytest.mark.parametrize("x", [1.1, 0.9, -1.05])
def test_a_ratio_may_follow_from_several_equations_behind_each_other(x: float, squares: Any) -> None:
    """Each of which is not linear: x to the 16th."""
    system = between(squares)
    assert gl.speed_ratio(system, "a.w", "b.w", parameters={"gear.x": x}) == pytest.approx(x**16, rel=1e-9)
    assert gl.mobility(system, parameters={"gear.x": x}) == 1


class Warm(gl.Connector):
    """Thermal."""

    T = gl.Potential("K")
    P = gl.Flow("W")


class Root(gl.Component):
    """Equations of the model itself and of a part, at flanges with nothing behind them."""

    class Part(gl.Component):
        flange, housing = gp.Flange("shaft"), Warm("housing")
        d, warmth = gl.Parameter("N.m.s/rad", default=2.0), gl.Parameter("W/K", default=3.0)
        T, inner = gl.Variable("K"), gl.Variable("N.m")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(self.inner, self.d * gl.der(self.flange.phi)), gl.Eq(self.flange.tau, self.inner), gl.Eq(self.T, 300.0),
                gl.Eq(self.housing.P, self.warmth * (self.housing.T - self.T)),
            ]  # fmt: skip

    flange = gp.Flange("of the model itself")
    d = gl.Parameter("N.m.s/rad", default=2.0)

    def assemble(self) -> list[Any]:
        self.part, self.body = self.Part(), gp.Inertia(J=1.0)
        return [gl.connect(self.part.flange, self.body.flange_a)]

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, self.d * gl.der(self.flange.phi))]


def test_torques_forces_and_whatever_flows_are_told_from_other_variables() -> None:
    """By what their owner declares; in connections nothing is declared."""
    model = gl.compile(Root()).translation.structure.complete
    seen = set()
    for g, group in enumerate(model.groups):
        for name in group.template.locals:
            found = steady_motion.forces(model, g, name)
            assert found.dtype == bool
            for i, owner in enumerate(group.owners.tolist()):
                own = name if owner >= 0 else None
                assert found[i] == (own is not None and own.rpartition(".")[2] in ("tau", "P", "inner")), (
                    group.template.label,
                    name,
                )
                seen.add((owner == 0, own.rpartition(".")[2] if own else None))
    assert seen >= {(True, "tau"), (True, "phi"), (False, "P"), (False, "T"), (False, "inner"), (False, "w")}


class Against(gl.Component):
    """A shaft that slips against one that never turns, by a share of its own speed."""

    flange, share = gp.Flange("shaft"), gl.Parameter("1", default=2.0)
    w, still = gl.Variable("rad/s"), gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.w, gl.der(self.flange.phi)),
            gl.Eq(self.still, 0),
            gl.Eq(self.share * self.w, self.share * 3 * self.still),
        ]


def test_a_speed_of_zero_in_an_equation_makes_it_no_equation_of_torques() -> None:
    """Two of three bodies are held by what never turns."""

    class Three(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.against = [gp.Inertia(J=1.0) for _ in range(3)], [Against() for _ in range(2)]
            return [gl.connect(body.flange_b, part.flange) for body, part in zip(self.body, self.against, strict=False)]

    assert gl.mobility(gl.compile(Three())) == 1


@pytest.mark.parametrize(
    ("change", "x", "sizes", "settled"),
    [
        ([0.0, 0.0], [0.0, 0.0], [1.0, 1.0], True), ([1e-8, 0.0], [1e6, 1.0], [1e6, 1.0], True),
        ([1e-8, 0.0], [1e6, 1.0], [1e-6, 1.0], True), ([0.0, 1e-8], [1e6, 1.0], [1e6, 1.0], False),
        ([1e-12, 0.0], [1.0, 0.0], [1.0, 1.0], False), ([1e-300, 0.0], [0.0, 0.0], [1.0, 1.0], False),
    ],
)  # fmt: skip
def test_changes_are_rounding_beside_the_largest_unknown_in_its_own_size(
    change: list[float], x: list[float], sizes: list[float], settled: bool
) -> None:
    assert steady_motion.is_rounding(np.array(change), np.array(x), np.array(sizes)) == settled


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("beyond", "holds"), [(1e-10, True), (-1e-10, False), (1e-15, False), (0.0, False)])
def test_what_is_compared_is_equal_to_rounding_of_its_own_size(size: float, beyond: float, holds: bool) -> None:
    """A sweep over the comparisons takes for equal what differs by rounding alone."""

    class Limited(gl.Component):
        limit, x, y = gl.Parameter("1", default=size), gl.Variable("1", start=size), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), -self.x), gl.Eq(self.y, gl.Piecewise((1.0, self.x > self.limit), (0.0, True)))]

    translation = gl.compile(Limited()).translation
    model, a = translation.structure.complete, np.zeros(translation.structure.complete.n_variables)
    a[model.representative[model.variable("x")]] = size * (1 + beyond)
    found = steady_motion.settled_discrete(model, translation.parameter_values({}), a, 0 * a)
    assert found[: model.n_relations].tolist() == [float(holds)]
