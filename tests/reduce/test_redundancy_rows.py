"""Redundant equations of models that are only flattened."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BalanceError, LoopError
from gearlib.flatten.flatten import flatten
from gearlib.flatten.model import FlatModel
from gearlib.reduce.coefficients import at_start
from gearlib.reduce.reduction import analyse
from gearlib.reduce.redundancy import flow_rows, flows_beside, last_first, last_names, redundant_rows, without


class Halving(gl.Component):
    """A gear whose ratio is no parameter."""

    flange_a, flange_b = gp.Flange("fast"), gp.Flange("slow")

    def equations(self) -> list[gl.Eq]:
        a, b = self.flange_a, self.flange_b
        return [gl.Eq(a.phi, 2 * b.phi), gl.Eq(b.tau, -2 * a.tau)]


def side_by_side(**gears: Any) -> FlatModel:
    """Gears between two bodies, in the order in which they are given, the bodies behind them."""

    class Loop(gl.Component):
        def assemble(self) -> list[Any]:
            for name, make in gears.items():
                setattr(self, name, make())
            self.x, self.y = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            parts = [getattr(self, name) for name in gears]
            return [
                gl.connect(self.x.flange_a, *(p.flange_a for p in parts)),
                gl.connect(self.y.flange_a, *(p.flange_b for p in parts)),
            ]

    return flatten(Loop())


def found_in(model: FlatModel) -> dict[int, tuple[int, ...]]:
    parameters = model.parameters.defaults
    return redundant_rows(model, parameters, at_start(model, parameters))


@pytest.mark.parametrize("names", [("one", "two", "zero"), ("zero", "two", "one")])
def test_of_gears_side_by_side_those_are_redundant_whose_names_come_last(names: tuple[str, ...]) -> None:
    """Each with the equations of its loop; with and without a parameter as ratio."""
    made = dict(zip(names, (Halving, Halving, lambda: gp.IdealGear(ratio=2.0)), strict=True))
    model = side_by_side(**made)
    found = found_in(model)
    owner = {e: model.owner(*model.places[e]) for e in range(len(model.places))}
    assert len(found) == 2
    assert {owner[e] for e in found} == {"two", "zero"}
    for e, loop in found.items():
        assert e in loop
        assert len(loop) == 2
        assert len({owner[o] for o in loop}) == 2
    left = without(model, found)
    assert [row for e, row in enumerate(model.rows) if e not in found] == left.rows
    assert [owner[e] for e in owner if e not in found] == [left.owner(*place) for place in left.places]
    assert left.redundant == model.redundant + 2
    assert found_in(left) == {}
    structure = analyse(model, model.parameters.defaults)
    assert (len(structure.redundant), len(structure.closed), len(structure.states)) == (2, 2, 2)


@pytest.mark.parametrize("first", ["a", "b"])
def test_gears_that_contradict_each_other_force_shafts_to_stand_still(first: str) -> None:
    gears = {"a": lambda: gp.IdealGear(ratio=2.0), "b": lambda: gp.IdealGear(ratio=3.0)}
    model = side_by_side(**{name: gears[name] for name in sorted(gears, reverse=first == "b")})
    said = r"^the rigid loop through a, b cannot turn: its ratios force \S+\.phi to stand still; check the ratios"
    with pytest.raises(LoopError, match=said):
        found_in(model)


def test_equations_with_flows_rates_or_varying_coefficients_are_no_candidates() -> None:
    """Said twice, none of them is found: other checks tell of them."""

    class Twice(gl.Component):
        flange, k = gp.Flange("any"), gl.Parameter("N.m/rad", default=2.0)
        x, y, z, p, q = gl.Variable("1"), gl.Variable("1"), gl.Variable("1"), gl.Parameter("1"), gl.Parameter("1")

        def equations(self) -> list[Any]:
            flow = [
                gl.Eq(self.flange.tau, self.k * self.flange.phi),
                gl.Eq(self.p * self.flange.tau, self.q * self.k * self.flange.phi),
            ]
            rate = [gl.Eq(gl.der(self.x), 2 * self.y), gl.Eq(self.p * gl.der(self.x), 2 * self.q * self.y)]
            curved = [gl.Eq(gl.sin(self.z), self.y), gl.Eq(self.p * gl.sin(self.z), self.q * self.y)]
            plain = [gl.Eq(self.x, 3 * self.z), gl.Eq(self.p * self.x, 3 * self.q * self.z)]
            return [*flow, *rate, *curved, *plain]

    class Model(gl.Component):
        def assemble(self) -> list[Any]:
            self.twice, self.wall = Twice(p=1.5, q=1.5), gp.Torque(tau=1.0)
            return [gl.connect(self.twice.flange, self.wall.flange)]

    model = flatten(Model())
    found = found_in(model)
    assert len(found) == 1
    ((dropped, loop),) = found.items()
    x, z = (int(model.representative[model.variable(f"twice.{n}")]) for n in "xz")
    assert dropped in loop
    assert [sorted(model.rows[e]) for e in loop] == [sorted([(x, 0), (z, 0)])] * 2


def test_the_last_name_among_aliases_stands_for_all() -> None:
    model = side_by_side(one=Halving)
    shafts = {int(v) for v in model.representative[[model.variable("x.phi"), model.variable("y.phi")]]}
    assert set(last_names(model, shafts).values()) == {"x.phi", "y.phi"}
    flow = int(model.representative[model.variable("one.flange_a.tau")])
    aliases = [model.name(v) for v in np.flatnonzero(model.representative[: model.auxiliary] == flow)]
    assert last_names(model, [flow]) == {flow: max(aliases)}
    assert last_names(model, []) == {}


def losing(**more: Any) -> Any:
    return lambda: gp.LossyGear(ratio=2.0, loss_table=((0.0, 0.9, 0.8, 0.1, 0.1),), **more)


@pytest.mark.parametrize("second", [losing(), lambda: gp.IdealGear(ratio=2.0)])
def test_losses_in_one_of_two_paths_are_refused_with_a_remedy(second: Any) -> None:
    model = side_by_side(upper=losing(), lower=second)
    said = (
        r"^the model is not balanced\. A rigid loop goes through lower, upper: its paths share .* Make one of the paths elastic"
    )
    with pytest.raises(BalanceError, match=said):
        analyse(model, model.parameters.defaults)


def test_what_lacks_an_equation_beside_paths_with_losses_is_told_first() -> None:
    """As it is where there are no losses; two torques are open, too many for one loop."""

    class Paths(gl.Component):
        x, y = gl.Variable("1"), gl.Variable("1")

        def assemble(self) -> list[Any]:
            self.a, self.b, self.upper, self.lower = gp.Inertia(J=1.0), gp.Inertia(J=1.0), losing()(), losing()()
            return [
                gl.connect(self.a.flange_a, self.upper.flange_a, self.lower.flange_a),
                gl.connect(self.b.flange_a, self.upper.flange_b, self.lower.flange_b),
            ]

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.x + self.y, 1)]

    model = flatten(Paths())
    with pytest.raises(BalanceError, match=r"under-determined: .* x; y"):
        analyse(model, model.parameters.defaults)


def test_equations_too_many_beside_a_loop_are_told_as_such() -> None:
    class Over(gl.Component):
        x = gl.Variable("1")

        def assemble(self) -> list[Any]:
            self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            self.upper, self.lower = gp.IdealGear(ratio=2.0), gp.IdealGear(ratio=2.0)
            return [
                gl.connect(self.a.flange_a, self.upper.flange_a, self.lower.flange_a),
                gl.connect(self.b.flange_a, self.upper.flange_b, self.lower.flange_b),
            ]

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.x, gl.sin(gl.time)), gl.Eq(self.x**3, gl.exp(gl.time))]

    model = flatten(Over())
    with pytest.raises(BalanceError, match=r"over-determined: 2 equations for 1 variables, 1 too many"):
        analyse(model, model.parameters.defaults)


def test_beside_equations_of_connections_are_no_flows() -> None:
    """They belong to no component."""
    model = side_by_side(one=Halving, two=Halving)
    places = [(g, i) for g, i in model.places if model.owner(g, i) == "connection"]
    assert places
    assert flows_beside(model, places) == frozenset()
    assert flows_beside(model, model.places) == {
        int(model.representative[v]) for v in np.flatnonzero(model.flow[: model.auxiliary])
    }


@pytest.mark.parametrize(("ratios", "still"), [((2.0, 3.0), "slow"), ((20.0, 30.0), "fast")])
@pytest.mark.parametrize("swapped", [False, True])
def test_one_of_the_shafts_that_are_forced_to_stand_still_is_named(
    ratios: tuple[float, float], still: str, swapped: bool
) -> None:
    """The angle of the other is eliminated: the first by name, unless its factor is less than a tenth of the other's."""

    class Loop(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b = (gp.IdealGear(ratio=ratio) for ratio in ratios[:: -1 if swapped else 1])
            return [gl.connect(self.a.flange_a, self.b.flange_a), gl.connect(self.a.flange_b, self.b.flange_b)]

    model = flatten(Loop())
    side = {"fast": "flange_a", "slow": "flange_b"}
    shafts = {int(model.representative[model.variable(f"a.{flange}.phi")]): shaft for shaft, flange in side.items()}
    assert min(shafts) == 0
    with pytest.raises(
        LoopError, match=r"^the rigid loop through a, b cannot turn: its ratios force [ab]\.flange_[ab]\.phi to"
    ) as told:
        found_in(model)
    name = str(told.value).partition("force ")[2].partition(" ")[0]
    assert shafts[int(model.representative[model.variable(name)])] == still


def test_flows_are_set_to_zero_from_the_last_name_on_but_no_partial_sums() -> None:
    class Many(gl.Component):
        def assemble(self) -> list[Any]:
            self.body = [gp.Inertia(J=1.0) for _ in range(12)]
            return [gl.connect(*(b.flange_a for b in self.body))]

    model = flatten(Many())
    assert model.auxiliary < model.n_variables
    flows = sorted({int(v) for v in model.representative[model.flow & (model.sign != 0)]})
    assert flows[-1] >= model.auxiliary
    of = {n: int(model.representative[model.variable(f"body[{n}].flange_a.tau")]) for n in range(12)}
    assert last_first(model, flows, []) == [of[n] for n in reversed(range(12))]
    assert last_first(model, flows, [of[10], of[3]]) == [of[n] for n in (10, 3, 11, 9, 8, 7, 6, 5, 4, 2, 1, 0)]


def test_flows_count_with_their_coefficients_where_these_are_known() -> None:
    """With any other numbers where they vary, even if they vanish at rest; what only a sensor shows says nothing of them."""

    class Swashed(gl.Component):
        """A gear whose ratio is a variable, with a meter of its power, and a torque that is given."""

        flange_a, flange_b = gp.Flange("fast"), gp.Flange("slow")
        ratio, level, power, given = gl.Variable("1"), gl.Variable("1"), gl.Variable("W"), gl.Input("N.m")

        def equations(self) -> list[gl.Eq]:
            a, b = self.flange_a, self.flange_b
            return [
                gl.Eq(self.power, a.tau * gl.der(a.phi)), gl.Eq(gl.der(self.level), -self.level),
                gl.Eq(self.ratio, gl.sin(self.level)), gl.Eq(gl.der(a.phi), self.ratio * gl.der(b.phi)),
                gl.Eq(b.tau, self.given - self.ratio * a.tau),
            ]  # fmt: skip

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.swash, self.one, self.two = gp.Torque(), [Swashed(), Swashed()], Halving(), Halving()
            self.x, self.y, self.z, self.end = (gp.Inertia(J=1.0) for _ in range(4))
            return [
                gl.connect(self.drive.flange, self.x.flange_a, *(swash.flange_a for swash in self.swash)),
                gl.connect(self.end.flange_a, self.swash[1].flange_b),
                gl.connect(self.y.flange_a, self.swash[0].flange_b, self.one.flange_a, self.two.flange_a),
                gl.connect(self.z.flange_a, self.one.flange_b, self.two.flange_b),
            ]

    model = flatten(Train())
    parameters = model.parameters.defaults

    def flow(name: str) -> tuple[int, int]:
        v = model.variable(name)
        return int(model.representative[v]), int(model.sign[v])

    rows = [row for row in flow_rows(model, parameters, at_start(model, parameters)) if row]
    of_gears = []
    for name in ("one", "two", "swash[0]", "swash[1]"):
        (a, one), (b, other) = flow(f"{name}.flange_a.tau"), flow(f"{name}.flange_b.tau")
        own = [row for row in rows if set(row) == {a, b}]
        assert len(own) == 1
        of_gears.append(own[0][a] * one / (own[0][b] * other))
    assert of_gears[:2] == [2.0, 2.0]
    assert np.isfinite(of_gears).all()
    assert np.abs(of_gears).min() > 1e-3
    given = {int(v) for v in model.inputs}
    assert flow("drive.flange.tau")[0] in given
    assert not given & {v for row in rows for v in row}
    assert not [row for row in rows if set(row) in [{flow(f"swash[{k}].flange_a.tau")[0]} for k in (0, 1)]]


@pytest.mark.parametrize("used", [0, 1])
def test_a_power_that_is_used_tells_of_the_torque_in_it_and_a_meter_does_not(used: int) -> None:
    class Metered(gl.Component):
        flange, power = gp.Flange("shaft"), gl.Variable("W")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.power, self.flange.tau * gl.der(self.flange.phi))]

    class Model(gl.Component):
        x = gl.Variable("W", "half of it")

        def assemble(self) -> list[Any]:
            self.meter, self.body = [Metered(), Metered()], [gp.Inertia(J=1.0), gp.Inertia(J=1.0)]
            return [gl.connect(meter.flange, body.flange_a) for meter, body in zip(self.meter, self.body, strict=True)]

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(2 * self.x, self.meter[used].power)]

    model = flatten(Model())
    parameters = model.parameters.defaults
    torques = [int(model.representative[model.variable(f"meter[{k}].flange.tau")]) for k in (0, 1)]
    rows = [set(row) for row in flow_rows(model, parameters, at_start(model, parameters))]
    assert [rows.count({torque}) for torque in torques] == [2 if k == used else 1 for k in (0, 1)], (
        "the body's, and the meter's"
    )
