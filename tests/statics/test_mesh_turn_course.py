"""The course of variables over a turn of the mesh, point by point, and means as means over these points."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.equations.kernel import partial_kernel, relation_kernel, residual_kernel
from gearlib.errors import InputWarning, ModelError
from gearlib.flatten.model import FlatModel
from gearlib.statics import mesh_turn
from gearlib.statics.mesh_turn import Turn, apply, argument, generic, mean, periodic_columns, steps_of, turn

COUNT = 32  # points of a turn


class Wavy(gl.Component):
    """A phase, what follows from it, and laws of it: with the rate of the phase, with conditions, with a chosen factor."""

    flange = gp.Flange("shaft")
    gain = gl.Parameter("1", default=1.0)
    newton_metre, second = gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)
    phase = gl.Variable("rad")
    w, y, z, free = (gl.Variable("1") for _ in range(4))
    m, k = (gl.Variable("N.m") for _ in range(2))
    n = gl.Discrete(start=2.0)

    def equations(self) -> list[gl.Eq]:
        y, z, w, free = self.y, self.z, self.w, self.free
        return [
            gl.Eq(self.n, gl.Piecewise((3, w > 4.0), (5, True))),
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(w, self.second * gl.der(self.flange.phi)),
            gl.Eq(-y, -self.gain * gl.sin(self.phase)),
            gl.Eq(z - 1, 2 * w * y),
            gl.Eq(gl.der(free), -free),
            gl.Eq(self.m, self.newton_metre * (y**2 * self.second * gl.der(self.phase) + self.n * z * gl.cos(self.phase))),
            gl.Eq(
                self.k,
                self.newton_metre
                * (
                    gl.Piecewise((y * free, y > 0.3), (free, z <= 1 + w / 7), (2, True))
                    + gl.Piecewise((y**2, w >= 4), (7, True))
                ),
            ),
            gl.Eq(self.flange.tau, self.m + self.k),
        ]


class Shaft(gl.Component):
    def assemble(self) -> list[Any]:
        self.drive, self.body, self.back = gp.Torque(), gp.Inertia(J=1.0), gp.IdealGear(ratio=-1.0)
        self.one, self.two = Wavy(gain=1.0), Wavy(gain=-2.0)
        return [
            gl.connect(self.drive.flange, self.body.flange_a, self.one.flange),
            gl.connect(self.body.flange_b, self.back.flange_a),
            gl.connect(self.back.flange_b, self.two.flange),
        ]


class Course:
    """A turn of a model about values that nothing singles out."""

    def __init__(self, model: FlatModel, numbers: Any) -> None:
        self.model, self.numbers = model, numbers
        self.a, self.b = np.random.default_rng(4).uniform(1.0, 2.0, (2, model.n_variables))
        self.discrete = np.arange(1.0, 1.0 + len(model.initial_discrete())) % 2
        first = model.n_relations
        self.discrete[first : first + len(model.discretes)] = 11.0 + np.arange(len(model.discretes))
        still = np.zeros(model.n_variables, bool)
        periodic = periodic_columns(model, numbers, self.a, self.b, self.discrete, still)
        found = turn(model, numbers, periodic, self.a, self.b, self.discrete)
        assert found is not None
        self.over: Turn = found

    def row(self, name: str) -> tuple[int, int]:
        v = self.model.variable(name)
        rep = int(self.model.representative[v])
        return int(self.over.place[rep]), int(self.model.sign[v])

    def values(self, name: str) -> Any:
        row, sign = self.row(name)
        assert row >= 0, name
        return sign * self.over.values[row]

    def at(self, name: str, rate: bool = False) -> float:
        v = self.model.variable(name)
        return float((self.b if rate else self.a)[self.model.representative[v]] * self.model.sign[v])


@pytest.fixture(autouse=True)
def few_points(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_turn, "PARTS", COUNT)


@cache
def course() -> Course:
    translation = gl.compile(Shaft()).translation
    return Course(translation.structure.complete, translation.parameter_values({}))


@pytest.mark.parametrize("part", ["one", "two"])
def test_a_turn_holds_what_follows_from_the_phase_each_with_its_own_mean(part: str) -> None:
    one = course()
    gain = 1.0 if part == "one" else -2.0
    phase, y, z = (one.values(f"{part}.{name}") for name in ("phase", "y", "z"))
    assert np.sort(phase) == pytest.approx(one.at(f"{part}.phase") + 2 * np.pi * ((np.arange(COUNT) + 0.5) / COUNT - 0.5))
    sine = gain * np.sin(phase)
    assert y == pytest.approx(one.at(f"{part}.y") + sine - sine.mean(), rel=1e-12)
    assert z == pytest.approx(one.at(f"{part}.z") + 2 * one.at(f"{part}.w") * (y - y.mean()), rel=1e-12)
    for name in ("w", "free", "flange.tau", "flange.phi"):
        assert one.row(f"{part}.{name}")[0] == -1, name
    followers = {one.row(f"{part}.{name}")[0] for part in ("one", "two") for name in ("phase", "y", "z", "m", "k")}
    assert followers == {*range(len(one.over.values))}
    assert (one.over.place >= 0).sum() == len(one.over.values) == 10


def test_arguments_of_columns_are_those_of_each_point_with_their_signs() -> None:
    one = course()
    seen = set()
    for group in one.model.groups:
        for name, order in group.template.columns:
            j = group.template.locals.index(name)
            v = group.variables[:, j]
            plain = argument(group, name, order, one.a, one.b)
            source = {0: one.a, 1: one.b}.get(order, np.zeros(len(one.a)))
            assert plain == pytest.approx(source[v] * group.signs[:, j])
            assert argument(group, name, 2, one.a, one.b).tolist() == [0.0] * len(group)
            found = one.over.argument(group, name, order, one.a, one.b)
            moved = one.over.place[v] >= 0
            assert one.over.moves(group, name) == moved.any()
            if order or not moved.any():
                assert found == pytest.approx(plain[:, None])
                continue
            seen.add(name)
            for i in range(len(group)):
                own = one.over.values[one.over.place[v[i]]] * group.signs[i, j] if moved[i] else np.full(COUNT, plain[i])
                assert found[i] == pytest.approx(own)
    assert {name.rpartition(".")[2] for name in seen} >= {"phase", "y", "z"}
    assert generic(one.a) - one.a == pytest.approx(np.full(len(one.a), 1.0), abs=0.5)


def test_a_mean_is_the_mean_of_the_values_at_all_points() -> None:
    """With conditions as they are at each point where they depend on the phase, and as they were elsewhere."""
    one = course()
    model, numbers, a, b, discrete, over = one.model, one.numbers, one.a, one.b, one.discrete, one.over
    differ = 0
    for g, group in enumerate(model.groups):
        template = group.template
        kernels = [residual_kernel(template), *(partial_kernel(template, c) for c in range(len(template.columns)))]
        for kernel in kernels:
            once = apply(model, kernel, g, group, numbers, a, b, discrete)
            assert mean(model, kernel, g, group, numbers, a, b, discrete, None) == pytest.approx(once, nan_ok=True)
            found = mean(model, kernel, g, group, numbers, a, b, discrete, over)
            if template.linear:
                assert found == pytest.approx(once)
                continue
            points = []
            for k in range(COUNT):
                x, flags = a.copy(), discrete.copy()
                moved = np.flatnonzero(over.place >= 0)
                x[moved] = over.values[over.place[moved], k]
                for c, relation in enumerate(template.relations):
                    compared = relation_kernel(template, c)
                    names = {name for name, _ in template.relation_columns}
                    if not any(over.moves(group, name) for name in names if name.rpartition(".")[2] != "w"):
                        continue
                    now = apply(model, compared, g, group, numbers, x, b, flags)
                    before = apply(model, compared, g, group, numbers, a, b, flags)
                    signed = -now if relation.negated else now
                    if (now != before).any():
                        place = model.first_relations[g] + np.arange(len(group)) * len(template.relations) + c
                        flags[place] = signed > 0 if relation.strict else signed >= 0
                points.append(apply(model, kernel, g, group, numbers, x, b, flags))
            assert found == pytest.approx(np.mean(points, axis=0), rel=1e-9, abs=1e-12), template.label
            differ += not np.allclose(found, once)
    assert differ > 5


def driven(load: gl.Component) -> gl.System:
    """A body with a load on it, driven at a speed that is given."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body, self.load = gp.Torque(), gp.Inertia(J=1.0), load
            return [gl.connect(self.drive.flange, self.body.flange_a, self.load.flange)]

    return gl.compile(Driven())


W, P = 5.0, 15.0  # rad/s, of the shaft and of the phase
WITH_RATES: list[tuple[Any, float]] = [
    (lambda s: s.y**2 * s.second * gl.der(s.phase), P / 2),
    (lambda s: s.y**2 * s.second * gl.der(s.flange.phi), W / 2),
    (lambda s: 4 * s.y**2 + s.second * gl.der(s.phase), 2.0 + P),
    (lambda s: s.m**2, P**2 / 2),
    (lambda s: s.m * s.y, P / 2),
    (lambda s: s.m + 1, 1.0),
    (lambda s: s.fast**2, 0.5),
    (lambda s: s.slow**2, 2.0),
]


class Beaten(gl.Component):
    """A load by a law of the rates, too; ``m = y der(phase)`` with ``y = sin(phase)``; with a condition on a rate."""

    flange = gp.Flange("shaft")
    law = gl.Structural(0)
    watched = gl.Structural(False)
    newton_metre, second = gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)
    phase = gl.Variable("rad")
    y, m, fast, slow, rate = (gl.Variable("1") for _ in range(5))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.rate, self.second * gl.der(self.y) if self.watched else 0),
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(self.y, gl.sin(self.phase)),
            gl.Eq(self.m, self.second * self.y * gl.der(self.phase)),
            gl.Eq(self.fast, gl.Piecewise((self.y, self.second * gl.der(self.phase) > 14.0), (2 * self.y, True))),
            gl.Eq(self.slow, gl.Piecewise((self.y, self.second * gl.der(self.phase) > 16.0), (2 * self.y, True))),
            gl.Eq(self.flange.tau, self.newton_metre * WITH_RATES[self.law][0](self)),
        ]


@pytest.mark.parametrize("watched", [False, True])
def test_the_mean_of_a_law_with_speeds_in_it(watched: bool) -> None:
    """What such an equation determines, and what stands beside a speed in one, has a course of its own; also if its rate is asked for."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.body = gp.Torque(), gp.Inertia(J=1.0)
            self.load = [Beaten(law=law, watched=watched) for law in range(len(WITH_RATES))]
            return [gl.connect(self.drive.flange, self.body.flange_a, *(load.flange for load in self.load))]

    flow = gl.power_flow(gl.compile(Driven()), speeds={"body.w": W})
    found = [flow[f"load[{k}].flange"].torque for k in range(len(WITH_RATES))]
    assert found == pytest.approx([mean for _, mean in WITH_RATES], rel=1e-9)


class Rising(gl.Component):
    """A load in proportion to the rate of what follows from its phase."""

    flange = gp.Flange("shaft")
    beside = gl.Structural(False)
    newton_metre, second = gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)
    phase, y = gl.Variable("rad"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        law = self.second * gl.der(self.y) * (gl.cos(self.phase) if self.beside else 1) + self.y**2
        return [
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(self.y, gl.sin(self.phase)),
            gl.Eq(self.flange.tau, self.newton_metre * law),
        ]


@pytest.mark.parametrize("beside", [False, True])
def test_the_rate_of_what_follows_from_a_phase_has_a_mean_of_zero_alone(beside: bool) -> None:
    """Beside something else that varies its course would be needed."""

    system = driven(Rising(beside=beside))
    if beside:
        with pytest.raises(
            ModelError, match=r"^Rising: .*: its mean .* is not known, since load\.y has a rate that varies with the phase$"
        ):
            gl.power_flow(system, speeds={"body.w": W})
        return
    assert gl.power_flow(system, speeds={"body.w": W})["load.flange"].torque == pytest.approx(0.5, rel=1e-9)


RATES: list[tuple[Any, float | None]] = [
    (lambda s: s.z + s.y**2, 0.5),
    (lambda s: s.doubled + s.acceleration + 3.0, 3.0),
    (lambda s: s.z * gl.cos(s.phase), None),
    (lambda s: s.doubled * gl.cos(s.phase), None),
    (lambda s: s.acceleration * s.y, None),
    (lambda s: s.doubled**2, None),
    (lambda s: s.late * s.y, None),
    (lambda s: gl.Piecewise((1.0, s.z > 0.5), (2.0, True)), None),
]


class RatesKept(gl.Component):
    """Rates of what follows from a phase, kept in variables of their own."""

    flange = gp.Flange("shaft")
    law = gl.Structural(0)
    newton_metre, second = gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)
    phase = gl.Variable("rad")
    y, z, doubled, acceleration, late = (gl.Variable("1") for _ in range(5))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(self.y, gl.sin(self.phase)),
            gl.Eq(self.z, self.second * gl.der(self.y)),
            gl.Eq(self.doubled, 2 * self.z),
            gl.Eq(self.acceleration, self.second * gl.der(self.z)),
            gl.Eq(self.late, self.doubled + gl.cos(self.phase)),
            gl.Eq(self.flange.tau, self.newton_metre * RATES[self.law][0](self)),
        ]


@pytest.mark.parametrize("law", range(len(RATES)))
def test_a_rate_that_is_kept_in_a_variable_has_a_course_that_is_not_known(law: int) -> None:
    """Its mean is zero alone. Beside what varies it is refused: with a rate of zero, ``z cos(phase)`` was 0 and not 7.5."""

    system = driven(RatesKept(law=law))
    expected = RATES[law][1]
    if expected is None:
        why = r"since load\.(z|doubled|acceleration|late) follows from rates that vary with the phase$"
        with pytest.raises(ModelError, match=r"^RatesKept: .*: its mean over a turn of the mesh is not known, " + why):
            gl.power_flow(system, speeds={"body.w": W})
        return
    assert gl.power_flow(system, speeds={"body.w": W})["load.flange"].torque == pytest.approx(expected, rel=1e-9)


SUMS: list[tuple[Any, float]] = [
    (lambda s: s.total * s.y, 0.5),
    (lambda s: s.half * s.y, 0.25),
    (lambda s: s.half**2, 0.25),
    (lambda s: s.behind * s.y, 1.0),
    (lambda s: s.fast * s.y, 0.5),
    (lambda s: s.fast**2, W**2 + 0.5),
    (lambda s: s.faster**2, 9 * W**2 + 2.0),
    (lambda s: s.faster * s.speed, 3 * W**2),
    (lambda s: s.scaled * s.y, 0.125),
    (lambda s: s.scaled**2 * s.four, 0.125),
]


class Summed(gl.Component):
    """Sums of what follows from a phase, with each other and with speeds; no equation shows by its form what it is for."""

    flange = gp.Flange("shaft")
    law = gl.Structural(0)
    newton_metre, second = gl.Parameter("N.m", default=1.0), gl.Parameter("s", default=1.0)
    phase = gl.Variable("rad")
    four = gl.Parameter("1", default=4.0)
    faster, fast, behind, half, total, scaled, y, speed = (gl.Variable("1") for _ in range(8))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(0, self.faster - 2 * self.fast - self.speed),
            gl.Eq(self.fast - self.speed, self.y),
            gl.Eq(self.behind + self.total, 2 * self.y + self.half * 2),
            gl.Eq(2 * self.half, self.total),
            gl.Eq(self.four * self.scaled, self.y),
            gl.Eq(self.total - self.y, gl.cos(self.phase)),
            gl.Eq(self.y, gl.sin(self.phase)),
            gl.Eq(self.speed, self.second * gl.der(self.flange.phi)),
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(self.flange.tau, self.newton_metre * SUMS[self.law][0](self)),
        ]


@pytest.mark.parametrize("law", range(len(SUMS)))
def test_sums_of_what_follows_from_a_phase_and_of_speeds_have_a_course(law: int) -> None:
    """``y = sin(phase)``, ``total = y + cos(phase)``; the means of products of such sums were those of products of means."""

    flow = gl.power_flow(driven(Summed(law=law)), speeds={"body.w": W})
    assert flow["load.flange"].torque == pytest.approx(SUMS[law][1], rel=1e-9)


TWO_PHASES: list[tuple[Any, float, float]] = [
    (lambda s: s.y * s.z, 2.0, 0.0),
    (lambda s: s.y**2 * s.z**2, 2.0, 0.25),
    (lambda s: gl.sin(s.phase) * gl.sin(s.other), 2.0, 0.0),
    (lambda s: gl.sin(2 * s.phase) * s.z, 2.0, 0.5),
    (lambda s: s.y * s.z, -1.0, -0.5),
    (lambda s: s.y * gl.cos(s.other), -1.0, 0.0),
    (lambda s: s.y * s.z, 1.0, 0.5),
    (lambda s: s.sum**2, 1.0, 2.0),
    (lambda s: s.sum**2, 0.3, 1.0),
    (lambda s: s.sum**2, -1.0, 0.0),
    (lambda s: gl.sin(3 * s.phase) * gl.sin(2 * s.other), 1.5, 0.5),
    (lambda s: gl.sin(23 * s.phase) * gl.sin(57 * s.other), 23 / 57, 0.5),
    (lambda s: s.y**2 * s.z**2, float(np.sqrt(3.0)), 0.25),
    (lambda s: s.y**2 * s.z**2, 1.0, 0.375),
    (lambda s: s.positive, float(np.sqrt(3.0)), 0.25),
    (lambda s: s.positive, 1.0, 0.5),
]


class TwoPhases(gl.Component):
    """A law of two meshes that turn at different rates."""

    flange = gp.Flange("shaft")
    law = gl.Structural(0)
    newton_metre = gl.Parameter("N.m", default=1.0)
    rate = gl.Parameter("1", default=1.0)
    phase, other = gl.Variable("rad"), gl.Variable("rad")
    y, z, sum, positive = (gl.Variable("1") for _ in range(4))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.phase), 3 * gl.der(self.flange.phi)),
            gl.Eq(gl.der(self.other), 3 * self.rate * gl.der(self.flange.phi)),
            gl.Eq(self.y, gl.sin(self.phase)),
            gl.Eq(self.z, gl.sin(self.other)),
            gl.Eq(self.sum, self.y + self.z),
            gl.Eq(self.positive, gl.Piecewise((gl.Piecewise((1.0, self.y > 0), (0.0, True)), self.z > 0), (0.0, True))),
            gl.Eq(self.flange.tau, self.newton_metre * TWO_PHASES[self.law][0](self)),
        ]


@pytest.mark.parametrize("law", range(len(TWO_PHASES)))
def test_the_mean_of_what_depends_on_two_phases_is_that_of_their_own_rates(law: int) -> None:
    """``y = sin(phase)``, ``z = sin(rate phase)``; both phases turned together, so that ``y z`` had the mean 0.5 at any rates."""
    _, rate, mean = TWO_PHASES[law]

    system = driven(TwoPhases(law=law, rate=rate))
    for speed in (W, -W):
        torque = gl.power_flow(system, speeds={"body.w": speed})["load.flange"].torque
        assert torque == pytest.approx(mean, rel=1e-9, abs=1e-3 if law >= 14 else 1e-9)  # a jump falls between points


@pytest.mark.parametrize("start", [{}, {"other": np.pi / 2}, {"phase": 1.0, "other": 1.0 + np.pi / 3}, {"phase": -0.3}])
def test_phases_of_one_rate_keep_the_difference_that_they_start_with(start: dict[str, float]) -> None:
    """The mean of ``sin(p) sin(p + d)`` is ``cos(d) / 2``."""

    torque = gl.power_flow(driven(TwoPhases(law=2, rate=1.0, start=start)), speeds={"body.w": W})["load.flange"].torque
    assert torque == pytest.approx(np.cos(start.get("other", 0.0) - start.get("phase", 0.0)) / 2, abs=1e-9)


class Swinging(gl.Component):
    """A torque by a law of signals that swing with time."""

    flange = gp.Flange("shaft")
    law = gl.Structural(0)
    newton_metre, amplitude = gl.Parameter("N.m", default=1.0), gl.Parameter("1", default=1.0)
    x, y, steady = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        laws = [
            10 * self.x**2, 10 * self.x * self.y, gl.Piecewise((1.0, self.x > 0), (0.0, True)), self.steady * self.y,
            3 + 10 * self.x, self.steady**2 + self.y,
        ]  # fmt: skip
        return [
            gl.Eq(self.x, self.amplitude * gl.sin(50 * gl.time)),
            gl.Eq(self.y - self.x, 2.0),
            gl.Eq(self.steady, 3.0),
            gl.Eq(self.flange.tau, -self.newton_metre * laws[self.law]),
        ]


@pytest.mark.parametrize(("law", "named"), [(0, "load.x swings"), (1, "load.x, load.y swing"), (2, "load.x swings")])
def test_products_of_what_swings_with_time_are_told(law: int, named: str) -> None:
    """The mean of a product is not the product of the means; where nothing swings, nothing is told."""
    system = gl.compile(torque_on_damper(law))
    with pytest.warns(
        InputWarning, match=f"^Driven: {named} with time, and counts? with (its mean|their means) in an equation"
    ):
        system.power_flow()
    flow = system.power_flow(parameters={"load.amplitude": 0.0})
    assert flow["body.flange_a"].speed == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("law", "mean"), [(3, 6.0), (4, 3.0), (5, 11.0)])
def test_sums_of_what_swings_with_time_count_with_their_mean(law: int, mean: float) -> None:
    assert gl.compile(torque_on_damper(law)).power_flow()["body.flange_a"].speed == pytest.approx(mean, rel=1e-12)


def torque_on_damper(law: int) -> gl.Component:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.load, self.body, self.damper, self.ground = Swinging(law=law), gp.Inertia(J=1.0), gp.Damper(d=1.0), gp.Fixed()
            return [
                gl.connect(self.load.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.damper.flange_a),
                gl.connect(self.damper.flange_b, self.ground.flange),
            ]  # fmt: skip

    return Driven()


@pytest.mark.parametrize(("swing", "geared"), [(30.0, True), (30.0, False), (0.0, True)])
def test_a_load_on_a_speed_that_is_prescribed_and_swings_is_told(swing: float, geared: bool) -> None:
    """The load grows with the square of a speed of 100 / 2; the swing would add 4.5 percent."""

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.source, self.body = gp.Speed(exact=True, w_ref=100 + swing * gl.sin(50 * gl.time)), gp.Inertia(J=1.0)
            self.gear = gp.IdealGear(ratio=2.0 if geared else 1.0)
            self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-8.0, w_nominal=10.0, torque_direction=False)
            return [
                gl.connect(self.source.flange, self.gear.flange_a), gl.connect(self.gear.flange_b, self.body.flange_a),
                gl.connect(self.body.flange_b, self.load.flange),
            ]  # fmt: skip

    system = gl.compile(Driven())
    if swing:
        with pytest.warns(InputWarning, match=r"^Driven: load\.w swings with time, and counts with its mean in an equation"):
            flow = system.power_flow()
    else:
        flow = system.power_flow()
    assert flow["load.flange"].torque == pytest.approx(200.0 if geared else 800.0, rel=1e-9)


@pytest.mark.parametrize("size", [1e-8, 1.0, 1e8 / 3, -1e4 / 7])
def test_phases_turn_as_often_as_their_rates_are_to_each_other_whatever_their_size(size: float) -> None:
    """Those without a common period, and those whose period would be too long, go their own way."""
    assert steps_of(size * np.array([10.0, -10.0, 15.0, 20.0, np.pi])).tolist() == [2, -2, 3, 4, 2533]
    assert steps_of(size * np.array([3.0, 3.0 * (1 + 1e-7)])).tolist() == [1, 2533]
    assert steps_of(size * np.array([1.0, 64.0, 65.0])).tolist() == [1, 64, 2533]
    assert steps_of(size * np.array([64.0, 1.0])).tolist() == [64, 1]
