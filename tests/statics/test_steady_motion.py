"""Equations of a steady motion ``a + b t``: their residuals by hand, their matrix by differences, and the motions that follow."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.optimize import minimize

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.flatten.model import FlatModel
from gearlib.statics.steady_motion import (
    Given,
    assemble,
    guesses,
    held,
    motion_from,
    settled_discrete,
    solve,
    speeds_near,
    unit_sizes,
)
from gearparts.interfaces import Compliant


class Hardening(Compliant):
    """A spring with a cubic part."""

    c = gl.Parameter("N.m/rad", "stiffness", default=7.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.tau, self.c * (self.phi_rel + self.phi_rel**3 / 4))]


class Train(gl.Component):
    """A motor, a gear, a hardening spring, a body, and a load that grows with the square of the speed."""

    def assemble(self) -> list[Any]:
        self.motor, self.rotor, self.gear = gp.Torque(), gp.Inertia(J=0.5), gp.IdealGear(ratio=-2.0)
        self.shaft, self.body = Hardening(), gp.Inertia(J=2.0, guess={"w": -3.0})
        self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-8.0, w_nominal=10.0, torque_direction=False)
        return [
            gl.connect(self.motor.flange, self.rotor.flange_a), gl.connect(self.rotor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.body.flange_a),
            gl.connect(self.body.flange_b, self.load.flange),
        ]  # fmt: skip


@pytest.fixture(scope="module")
def train() -> tuple[FlatModel, Any]:
    translation = gl.compile(Train()).translation
    return translation.model, translation.parameter_values({})


def place(model: FlatModel, name: str) -> tuple[int, int]:
    v = model.variable(name)
    return int(model.representative[v]), int(model.sign[v])


def test_the_matrix_is_the_derivative_of_the_residual(train: tuple[FlatModel, Any]) -> None:
    """Of the constant parts in all unknowns; the growing parts are linear in the rates, with the same coefficients."""
    model, numbers = train
    n, rng = model.n_variables, np.random.default_rng(3)
    x = rng.uniform(0.5, 2.0, 2 * n)
    given = [Given("speed", place(model, "body.w")[0], 0, 4.0), Given("rate", place(model, "shaft.phi_rel")[0], 1, 0.25)]
    discrete = settled_discrete(model, numbers, x[:n], x[n:])

    def rows(at: Any) -> Any:
        return assemble(model, numbers, given, at[:n], at[n:], discrete)

    found, h = rows(x), 1e-6
    matrix = found.matrix.toarray()
    slopes = np.column_stack([(rows(x + h * e).residual - rows(x - h * e).residual) / (2 * h) for e in np.eye(2 * n)])
    first = 0
    for g, group in enumerate(model.groups):
        constant = slice(first, first + len(group))
        growing = slice(first + len(group), first + 2 * len(group))
        assert matrix[constant] == pytest.approx(slopes[constant], abs=1e-6), group.template.label
        assert found.residual[growing] == pytest.approx(matrix[growing] @ x), group.template.label
        assert matrix[growing, n:] == pytest.approx(matrix[constant, :n]), group.template.label
        assert not matrix[growing, :n].any()
        torques = (np.abs(matrix[constant, :n]) > 0) @ model.flow > 0
        assert found.kinematic[constant].tolist() == (~torques).tolist(), group.template.label
        assert found.kinematic[growing].all()
        owners = [model.owner(g, i) for i in range(len(group))]
        assert [found.owner(r) for r in range(first, first + 2 * len(group))] == owners * 2
        first += 2 * len(group)
    flows = sorted({int(r) for r in model.representative[model.flow[model.representative]]})
    steady = slice(first, first + len(flows))
    assert found.residual[steady] == pytest.approx(x[n + np.array(flows)])
    assert matrix[steady] == pytest.approx(np.eye(2 * n)[n + np.array(flows)])
    assert {found.owner(r) for r in range(first, first + len(flows))} == {"connection"}
    ends = np.array([given[0].variable, n + given[1].variable])
    assert found.residual[-2:] == pytest.approx(x[ends] - [4.0, 0.25])
    assert matrix[-2:] == pytest.approx(np.eye(2 * n)[ends])
    assert [found.owner(len(matrix) - 2 + k) for k in range(2)] == ["speed", "rate"]
    assert found.kinematic[-2:].all()


def test_a_binding_that_is_replaced_leaves_its_row(train: tuple[FlatModel, Any]) -> None:
    class Bound(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.two = gp.Torque(tau=3.0 + gl.sin(gl.time)), gp.Torque(tau=5.0)
            self.body, self.drag, self.wall = gp.Inertia(J=1.0), gp.Damper(d=2.0), gp.Fixed()
            ends = [self.one.flange, self.two.flange, self.body.flange_a, self.drag.flange_a]
            return [gl.connect(*ends), gl.connect(self.drag.flange_b, self.wall.flange)]

    translation = gl.compile(Bound()).translation
    model, numbers = translation.model, translation.parameter_values({})
    torque = place(model, "two.tau")
    for given, speed in (([], 4.0), ([Given("two.tau", torque[0], 0, torque[1] * -1.0)], 1.0)):
        motion = solve(model, numbers, given)  # a sinusoid counts with its mean
        w, sign = place(model, "body.w")
        assert sign * motion.constants[w] == pytest.approx(speed, rel=1e-12)
        phi, sign = place(model, "body.phi")
        assert sign * motion.rates[phi] == pytest.approx(speed, rel=1e-12)
        assert motion.residual.max() < 1e-12


def test_a_motion_meets_what_is_given_from_the_guess_of_the_model(train: tuple[FlatModel, Any]) -> None:
    """8 N.m at -10 rad/s behind the gear; the spring carries it: 7 (x + x^3 / 4) = 8."""
    model, numbers = train
    motor, sign = place(model, "motor.tau")
    (guess,) = guesses(model, numbers)
    w, turned = place(model, "body.w")
    assert (guess.variable, guess.order, turned * guess.value) == (w, 0, -3.0)
    given = [Given("motor.tau", motor, 0, sign * 4.0)]
    motion = solve(model, numbers, given)
    assert turned * motion.constants[w] == pytest.approx(-10.0, rel=1e-9)
    deflection, sense = place(model, "shaft.phi_rel")
    (root,) = [r.real for r in np.roots([7 / 4, 0, 7, -8]) if abs(r.imag) < 1e-9]
    assert abs(sense * motion.constants[deflection]) == pytest.approx(root, rel=1e-9)
    assert motion.rates[deflection] == pytest.approx(0.0, abs=1e-12)
    at = speeds_near(model, numbers, [], [Given("near", w, 0, turned * 5.0)])
    rotor, forwards = place(model, "rotor.w")
    assert forwards * at[rotor] == pytest.approx(-10.0, rel=1e-12)
    same = motion_from(model, numbers, given, np.concatenate([motion.constants, motion.rates]))
    assert same.constants == pytest.approx(motion.constants, abs=1e-12)


@pytest.mark.parametrize("size", [1e-8, 1e8])
def test_stiff_and_soft_springs_are_as_exact(train: tuple[FlatModel, Any], size: float) -> None:
    """As much more torque on as much more stiffness: the same deflection, at a speed that grows with the root of the torque."""
    model = train[0]
    numbers = gl.compile(Train()).translation.parameter_values({"shaft.c": 7.0 * size})
    motor, sign = place(model, "motor.tau")
    motion = solve(model, numbers, [Given("motor.tau", motor, 0, sign * 4.0 * size)])
    (w, turned), (deflection, sense) = place(model, "body.w"), place(model, "shaft.phi_rel")
    assert turned * motion.constants[w] == pytest.approx(-10.0 * np.sqrt(size), rel=1e-9)
    x = abs(sense * motion.constants[deflection])
    assert x + x**3 / 4 == pytest.approx(8 / 7, rel=1e-9)


class Switches(gl.Component):
    """Relations at their edges, and discrete variables that follow from each other."""

    x, y, z = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    one, two, last = gl.Discrete(), gl.Discrete(), gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), gl.Piecewise((1, self.y > 0), (2, True))),
            gl.Eq(gl.der(self.y), gl.Piecewise((1, self.y >= 0), (2, True))),
            gl.Eq(
                gl.der(self.z), gl.Piecewise((1, self.y < 0), (2, True)) + gl.Piecewise((1, self.y <= 0), (2, True)) + self.last
            ),
            gl.Eq(self.one, gl.Piecewise((3, self.x > 1), (1, True))),
            gl.Eq(self.two, gl.pre(self.one) + gl.Piecewise((1, self.x < 7), (2, True))),
            gl.Eq(self.last, 2 * gl.pre(self.two) + gl.Piecewise((100, gl.initial()), (0, True))),
        ]


class Panel(gl.Component):
    def assemble(self) -> list[Any]:
        self.switch = [Switches() for _ in range(3)]
        return []


@pytest.mark.parametrize("y", [-1.0, 0.0, 1.0])
@pytest.mark.parametrize("x", [0.5, 1.5])
def test_relations_and_discrete_variables_are_settled(x: float, y: float) -> None:
    """Of each of three; the second one has other values."""
    translation = panel().translation
    model = translation.model
    a = np.zeros(model.n_variables)
    values = {"switch[0]": (x, y), "switch[1]": (2.0 - x, -y), "switch[2]": (x, y)}
    for path, (own_x, own_y) in values.items():
        for name, value in (("x", own_x), ("y", own_y)):
            v, sign = place(model, f"{path}.{name}")
            a[v] = sign * value
    found = settled_discrete(model, translation.parameter_values({}), a, np.zeros(len(a)))
    first, count = model.n_relations, len(model.discretes)
    now = dict(zip(model.discretes, found[first : first + count].tolist(), strict=True))
    expected = {}
    for path, (own_x, _) in values.items():
        one = 3.0 if own_x > 1 else 1.0
        expected |= {f"{path}.one": one, f"{path}.two": one + 1, f"{path}.last": 2 * (one + 1)}
    assert now == expected
    assert found[first + count : first + 2 * count].tolist() == list(now.values())
    assert found[first + 2 * count] == 0.0
    for g, group in enumerate(model.groups):
        relations = group.template.relations
        for i in range(len(group)):
            at = values[model.owner(g, i)][1]
            for c, relation in enumerate(relations):
                holds = {(True, False): at > 0, (False, False): at >= 0, (True, True): at < 0, (False, True): at <= 0}
                flag = found[model.first_relations[g] + i * len(relations) + c]
                assert flag == holds[relation.strict, relation.negated], group.template.label


@cache
def panel() -> gl.System:
    return gl.compile(Panel())


class Watched(gl.Component):
    """Two switches, of which the one that is stated first follows the other, and a memory of any difference between them."""

    x = gl.Variable("1")
    behind, ahead, parted = (gl.Discrete() for _ in range(3))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), 0.0),
            gl.Eq(self.behind, self.ahead),
            gl.Eq(self.ahead, gl.Piecewise((1, self.x > 0.5), (0, True))),
            gl.Eq(self.parted, gl.pre(self.parted) + self.ahead - self.behind),
        ]


def test_what_follows_at_the_same_instant_is_never_apart() -> None:
    translation = gl.compile(Watched()).translation
    model = translation.structure.complete
    x, sign = place(model, "x")
    a = np.zeros(model.n_variables)
    a[x] = sign * 1.0
    found = settled_discrete(model, translation.parameter_values({}), a, np.zeros(len(a)))
    now = dict(zip(model.discretes, found[model.n_relations :].tolist(), strict=False))
    assert now == {"behind": 1.0, "ahead": 1.0, "parted": 0.0}


def test_a_discrete_variable_that_each_event_changes_has_no_steady_value() -> None:
    class Alternating(gl.Component):
        flange = gp.Flange()
        again = gl.Parameter("1", default=1.0)
        n = gl.Discrete(start=0.0)

        def equations(self) -> list[Any]:
            next_ = gl.Piecewise((1 - gl.pre(self.n), self.again > 0.5), (4.0, True))
            return [gl.Eq(self.n, next_), gl.Eq(self.flange.tau, self.n)]

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.gear, self.brake = gp.ConstantSpeed(w_fixed=10.0), gp.IdealGear(ratio=2.0), Alternating()
            return [gl.connect(self.motor.flange, self.gear.flange_a), gl.connect(self.gear.flange_b, self.brake.flange)]

    system = gl.compile(Driven())
    for ask in (system.power_flow, lambda: system.simulate(1.0, start="steady")):
        with pytest.raises(gl.GearlibError, match=r"does not settle.*brake\.n|brake\.n does not settle, each event changes it"):
            ask()
    assert system.power_flow(parameters={"brake.again": 0.0})["gear.flange_a"].torque == pytest.approx(2.0)


@pytest.mark.parametrize(("link", "free"), [("gap", 1), ("mesh", 1), ("spring", 1), ("damper", 2), ("clutch", 2)])
def test_a_gap_is_closed_where_that_joins_more(link: str, free: int) -> None:
    class Joined(gl.Component):
        def assemble(self) -> list[Any]:
            made = {
                "gap": lambda: gp.ElastoBacklash(c=5.0, d=1.0, b=0.1), "spring": lambda: gp.Spring(c=5.0),
                "damper": lambda: gp.Damper(d=1.0), "clutch": lambda: gp.Clutch(fn_max=1.0),
                "mesh": lambda: gp.DetailedExternalMesh(r_a=0.05, r_b=0.1, c=1e7, d=3e3, backlash=True, b=1e-4),
            }  # fmt: skip
            self.a, self.b, self.link = gp.Inertia(J=1.0), gp.Inertia(J=1.0), made[link]()
            return [gl.connect(self.a.flange_b, self.link.flange_a), gl.connect(self.link.flange_b, self.b.flange_a)]

    system = gl.compile(Joined())
    assert gl.mobility(system) == free
    if free == 1:
        assert gl.speed_ratio(system, "a.w", "b.w") == pytest.approx(-2.0 if link == "mesh" else 1.0, rel=1e-12)
    else:
        with pytest.raises(gl.GearlibError, match=r"^b\.w does not follow from a\.w alone; name the speeds that are held"):
            gl.speed_ratio(system, "a.w", "b.w")


class Geared(gl.Component):
    """A drive at the sun of a set, a brake on its ring, and a drag on its carrier."""

    def assemble(self) -> list[Any]:
        self.drive, self.set, self.brake = gp.Torque(), gp.IdealPlanetary(ratio=2.0), gp.Brake(fn_max=100.0, f_normalized=1.0)
        self.a, self.ring, self.b = (gp.Inertia(J=1.0) for _ in range(3))
        self.load = gp.LinearSpeedDependentTorque(tau_nominal=-1.0, w_nominal=1.0, torque_direction=False)
        return [
            gl.connect(self.drive.flange, self.a.flange_a, self.set.sun),
            gl.connect(self.set.ring, self.ring.flange_a, self.brake.flange_a),
            gl.connect(self.set.carrier, self.b.flange_a, self.load.flange),
        ]


def test_a_brake_holds_what_it_holds_in_the_steady_state() -> None:
    """The drag is as large as the speed, three times the torque of the sun; the brake carries twice that of the sun."""
    system = gl.compile(Geared())
    flow = system.power_flow(torques={"drive.tau": 10.0})
    assert [flow[f"{body}.flange_a"].speed for body in ("a", "ring", "b")] == pytest.approx([90.0, 0.0, 30.0], abs=1e-9)
    assert flow["brake.flange_a"].torque == pytest.approx(-20.0)
    assert flow.losses == {}
    given = system.power_flow(speeds={"a.w": 90.0, "ring.w": 0.0})
    assert given["drive.flange"].torque == pytest.approx(-10.0)


@pytest.mark.parametrize("seed", range(3))
def test_sizes_are_those_of_units_in_which_all_coefficients_are_alike(seed: int) -> None:
    """Equations of coefficients 1 or -1, in other units, each times a factor of its own: the units are found again."""
    rng = np.random.default_rng(seed)
    exponents, size = rng.integers(-2, 3, (9, 3)).astype(float), rng.uniform(-5, 5, 3)
    pattern = (rng.random((14, 9)) < 0.5) * rng.choice([-1.0, 1.0], (14, 9))
    pattern[5] = 0.0  # an equation without coefficients
    right = np.exp(exponents @ size)
    matrix = pattern * 10.0 ** rng.uniform(-9, 9, (14, 1)) / right
    linear = np.ones(14, bool)
    below = np.vstack([matrix, 10.0 ** rng.uniform(-9, 9, (3, 9))])  # rows that do not count
    assert unit_sizes(sparse.csr_matrix(below), exponents, linear) == pytest.approx(right, rel=1e-9)
    # What may be rounding in an equation that is not linear does not count, either; nor what has no unit
    linear[3] = False
    place = int(np.flatnonzero(pattern[3] == 0)[0])
    rounded = matrix.copy()
    rounded[3, place] = 0.9e-13 * abs(matrix[3]).max()
    exponents[8] = np.nan
    found = unit_sizes(sparse.csr_matrix(rounded), exponents, linear)
    assert found[:8] == pytest.approx(right[:8], rel=1e-9)
    assert np.isnan(found[8])


def test_few_coefficients_far_from_the_others_have_little_effect() -> None:
    """The minimum of a sum of squares near zero, and of magnitudes elsewhere, by another way."""
    rng = np.random.default_rng(1)
    exponents = rng.integers(-2, 3, (9, 2)).astype(float)
    logarithms = rng.normal(size=(30, 9)) * np.where(rng.random((30, 9)) < 0.1, 9.0, 0.5)
    kept = rng.random((30, 9)) < 0.5
    found = unit_sizes(sparse.csr_matrix(np.where(kept, np.exp(logarithms), 0.0)), exponents, np.ones(30, bool))

    def cost(size: Any) -> float:
        terms = logarithms + exponents @ size
        rest = np.concatenate([row[mask] - row[mask].mean() for row, mask in zip(terms, kept, strict=True)])
        return float(np.where(np.abs(rest) < 1, rest**2 / 2, np.abs(rest) - 0.5).sum())

    best = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-12}).x
    assert np.log(found) == pytest.approx(exponents @ best, abs=1e-3)


class Cruise(gl.Component):
    """Holds the speed that a shaft has, or brakes it; friction in proportion to another speed may be added."""

    flange = gp.Flange("shaft")
    holds = gl.Parameter("1", default=1.0)
    slip = gl.Parameter("1/(kg.m2)", default=0.0)
    drag, inertia = gl.Parameter("N.m.s/rad", default=0.3), gl.Parameter("kg.m2", default=1.0)
    w = gl.Variable("rad/s", "speed")

    def equations(self) -> list[gl.Eq]:
        tau = self.flange.tau
        return [
            gl.Eq(gl.der(self.flange.phi), self.w),
            gl.Eq(
                gl.Piecewise(
                    (gl.der(self.w) + self.slip * tau, self.holds > 0.5), ((tau - self.drag * self.w) / self.inertia, True)
                ),
                0,
            ),
        ]


@pytest.mark.parametrize(
    ("holds", "slip", "w", "right"),
    [(1.0, 0.0, 7.0, 7.0), (1.0, 0.0, -7.0, -7.0), (1.0, 0.0, 1e-10, 0.0), (0.0, 0.0, 7.0, None), (1.0, 1e-6, 7.0, None)],
)
def test_a_speed_is_held_where_nothing_but_its_rate_is_determined(
    holds: float, slip: float, w: float, right: float | None
) -> None:
    translation = cruising().translation
    model, numbers = translation.model, translation.parameter_values({"one.holds": holds, "one.slip": slip})
    v, sign = place(model, "one.w")
    motion = motion_from(model, numbers, [Given("w", v, 0, sign * w)], np.zeros(2 * model.n_variables))
    found = [(item.variable, item.order, item.value) for item in held(model, numbers, motion)]
    assert found == ([] if right is None else [(v, 0, sign * right)])


@cache
def cruising() -> gl.System:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.one = gp.Inertia(J=2.0), Cruise()
            self.torque, self.gear = gp.Torque(), gp.IdealGear(ratio=-1.0)
            return [
                gl.connect(self.torque.flange, self.body.flange_a),
                gl.connect(self.body.flange_b, self.gear.flange_a),
                gl.connect(self.gear.flange_b, self.one.flange),
            ]

    return gl.compile(Driven())


def test_equations_of_torques_at_loose_flanges_are_no_kinematics() -> None:
    """Though these torques are zero, and no unknowns; a connection of angles is."""

    class Loose(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.body, self.gear = gp.Torque(), gp.Inertia(J=1.0), gp.IdealGear(ratio=3.0)
            self.mesh, self.spring = gp.ExternalMesh(r_a=0.1, r_b=0.2, c=1e6, d=1e2), gp.Spring(c=3.0)
            ends = [self.torque.flange, self.body.flange_a, self.mesh.flange_a, self.spring.flange_a, self.gear.flange_a]
            return [gl.connect(*ends)]

    translation = gl.compile(Loose()).translation
    model, numbers = translation.structure.complete, translation.parameter_values({})
    zero = np.zeros(model.n_variables)
    found, first = assemble(model, numbers, [], zero, zero, model.initial_discrete()).kinematic, 0
    for group in model.groups:
        names = [name.rpartition(".")[2] for name, _ in group.template.columns]
        kinematic = "tau" not in names and not group.template.label.startswith("sum of")  # of the torques in a connection
        assert found[first : first + len(group)].tolist() == [kinematic] * len(group), group.template.label
        first += 2 * len(group)


class Meter(gl.Component):
    """A reading that grows with the cube of the torque that is passed on."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    newton_metre = gl.Parameter("N.m", default=1.0)
    reading = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        return [gl.Eq(a.phi, b.phi), gl.Eq(a.tau, -b.tau), gl.Eq(self.reading, (b.tau / self.newton_metre) ** 3)]


def test_a_torque_that_is_always_zero_may_enter_by_its_cube() -> None:
    """Of two meters one has nothing behind it."""

    class Metered(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.body, self.meter, self.loose = gp.Torque(), gp.Inertia(J=1.0), Meter(), Meter()
            self.ground, self.brake = gp.Fixed(), gp.Damper(d=0.5)
            return [
                gl.connect(self.torque.flange, self.body.flange_a, self.meter.flange_a, self.loose.flange_a),
                gl.connect(self.meter.flange_b, self.brake.flange_a),
                gl.connect(self.brake.flange_b, self.ground.flange),
            ]

    translation = gl.compile(Metered()).translation
    model, numbers = translation.structure.complete, translation.parameter_values({})
    speed, sign = place(model, "body.w")
    motion = solve(model, numbers, [Given("w", speed, 0, sign * 4.0)])
    assert motion.residual.max() < 1e-9
    for name, right in (("meter.reading", -8.0), ("loose.reading", 0.0)):  # 2 N.m from the brake
        v, turned = place(model, name)
        assert turned * motion.constants[v] == pytest.approx(right, abs=1e-12)


class Compared(gl.Component):
    """What two values are compared for, which a rounding error may part."""

    x, y, strictly, at_least, less, at_most = (gl.Variable("1") for _ in range(6))

    def equations(self) -> list[gl.Eq]:
        conditions = {self.strictly: self.x > self.y, self.at_least: self.x >= self.y, self.less: self.x < self.y}
        conditions |= {self.at_most: self.x <= self.y}
        flags = [gl.Eq(flag, gl.Piecewise((1.0, condition), (0.0, True))) for flag, condition in conditions.items()]
        return [gl.Eq(gl.der(self.x), 0.0), gl.Eq(gl.der(self.y), 0.0), *flags]


@pytest.mark.parametrize("ulps", [-3, -1, 0, 1, 3])
def test_what_differs_by_rounding_is_equal_in_a_comparison(ulps: int) -> None:
    """Friction that starts at its limit sticks, on whichever processor its torque was computed; a relative 1e-9 counts."""
    translation = gl.compile(Compared()).translation
    model = translation.structure.complete
    numbers, a = translation.parameter_values({}), np.zeros(model.n_variables)
    x, y = (place(model, name)[0] for name in ("x", "y"))

    def flags(value: float, other: float) -> list[float]:
        a[x], a[y] = value, other
        return settled_discrete(model, numbers, a, np.zeros(len(a)))[: model.n_relations].tolist()

    equal, more, less = [0.0, 1.0, 0.0, 1.0], [1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]
    for y_ in (50.0, -50.0, 0.25):
        assert [flags(y_ - 5e-8, y_), flags(y_ - 0.2, y_), flags(y_, y_), flags(y_ + 0.2, y_)] == [less, less, equal, more]
    for size in (50.0, -50.0, 3e-9, 7e11):
        assert flags(size + ulps * np.spacing(size), size) == equal
    assert flags(1e-30, 0.0) == more
    assert flags(-1e-30, 0.0) == less


class BetweenAngles(gl.Component):
    """A torque over the difference of two flanges' angles, without a variable for it."""

    flange_a, flange_b = gp.Flange("left"), gp.Flange("right")
    law, n, c = gl.Structural(None), gl.Parameter("N.m", default=8.0), gl.Parameter("N.m/rad3", default=5.0)

    def equations(self) -> list[gl.Eq]:
        torque = self.law(self.n, self.c, self.flange_b.phi - self.flange_a.phi)
        return [gl.Eq(self.flange_b.tau, torque), gl.Eq(self.flange_a.tau, -self.flange_b.tau)]


BETWEEN = {
    "cubic": lambda n, c, x: n * x + c * x**3,
    "without a linear term": lambda n, c, x: c * x**3,
    "levels off": lambda n, c, x: n * gl.tanh(x),
    "exponential": lambda n, c, x: n * (1 - gl.exp(-x)),
}


@pytest.mark.parametrize("law", BETWEEN)
@pytest.mark.parametrize("turning", [True, False])
def test_a_law_of_two_angles_carries_the_load_by_their_difference(law: str, turning: bool) -> None:
    """4 N.m, whatever the law, to a load that turns at the speed of the drive, or to the ground."""

    class Driven(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.drive, self.body, self.other = gp.Torque(), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.coupling = BetweenAngles(law=BETWEEN[law])
            self.load = gp.LinearSpeedDependentTorque(tau_nominal=-4.0, w_nominal=5.0) if turning else gp.Fixed(phi0=0.7)
            return [
                gl.connect(self.drive.flange, self.body.flange_a),
                gl.connect(self.body.flange_b, self.coupling.flange_a),
                gl.connect(self.coupling.flange_b, self.other.flange_a),
                gl.connect(self.other.flange_b, self.load.flange),
            ]

    given: dict[str, Any] = {"speeds": {"body.w": 5.0}} if turning else {"torques": {"drive.tau": 4.0}}
    flow = gl.power_flow(gl.compile(Driven()), **given)
    assert [flow[f"coupling.flange_{end}"].torque for end in "ab"] == pytest.approx([4.0, -4.0], rel=1e-9)
    assert flow["load.flange"].torque == pytest.approx(4.0, rel=1e-9)
    assert flow["load.flange"].speed == pytest.approx(5.0 if turning else 0.0, rel=1e-9)


class OfItsAngle(gl.Component):
    """A load that depends on its speed and on its angle."""

    flange, law, w = gp.Flange("shaft"), gl.Structural(None), gl.Variable("rad/s")
    c, d, n = gl.Parameter("N.m/rad", default=2.0), gl.Parameter("N.m.s/rad", default=0.1), gl.Parameter("N.m", default=3.0)

    def equations(self) -> list[gl.Eq]:
        angle, speed = self.flange.phi, self.w
        return [gl.Eq(self.w, gl.der(angle)), gl.Eq(self.flange.tau, self.law(self, angle, speed))]


BEGINNING_FLAT = gl.Table([-100.0, 0.0, 5.0, 10.0], [0.0, 0.0, 0.0, 100.0])
GROWING = {
    "beside what is curved in the speed": lambda own, phi, w: own.c * phi + own.n * gl.tanh(own.d * w / own.n),
    "square": lambda own, phi, w: own.c * phi**2 + own.d * w,
    "times the speed": lambda own, phi, w: own.d * phi * w + own.d * w,
    "size": lambda own, phi, w: own.c * abs(phi) + own.d * w,
    "levels off": lambda own, phi, w: own.n * gl.tanh(phi) + own.d * w,
    "cut by what repeats": lambda own, phi, w: gl.Piecewise((own.c * phi, gl.sin(phi) > 0.5), (2 * own.c * phi, True)),
    "a table that is flat at first": lambda own, phi, w: own.n * BEGINNING_FLAT(phi) + own.d * w,
    "a stop without an event": lambda own, phi, w: gl.no_event(gl.Max(own.c * (phi - 7), 0)) + own.d * w,
    "a stop": lambda own, phi, w: gl.Max(own.c * (phi - 7), 0) + own.d * w,
}


@pytest.mark.parametrize("law", GROWING)
def test_a_torque_that_changes_as_the_shaft_turns_on_has_no_steady_motion(law: str) -> None:
    """No angle is better than another, and over a turn it does not repeat."""

    class Driven(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.drive, self.body, self.load = gp.Torque(), gp.Inertia(J=1.0), OfItsAngle(law=GROWING[law])
            return [gl.connect(self.drive.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.load.flange)]

    with pytest.raises(
        ArgumentError, match=r"no steady motion has the given body\.w: (the equations of|in load a gap is open)"
    ):
        gl.power_flow(gl.compile(Driven()), speeds={"body.w": 5.0})
