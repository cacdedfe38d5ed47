"""Right-hand sides for lanes: each lane as the interpreter computes its run."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.compiler.instructions import LANES
from gearlib.native.lane_source import lane_code, why_scalar
from gearlib.program.interpret import evaluate, prepare, solutions_of_runs
from tests.native.test_layout import Divided
from tests.program.test_derivatives import Bound, Loop
from tests.program.test_event_iteration import Latch
from tests.stress.trains import RandomTrain

CALL = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_void_p] * 4)


class Fan(gl.Component):
    """A linear block, terms that are constant, of time and quadratic, and three open inputs."""

    def assemble(self) -> list[Any]:
        self.torque, self.drive = gp.Torque(), gp.Torque(tau=2.0 + gl.sin(3 * gl.time))
        self.load, self.brake = gp.Torque(), gp.Torque()
        self.a, self.b, self.gear = gp.Inertia(J=0.3), gp.Inertia(J=1.2), gp.IdealGear(ratio=2.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-1.5, w_nominal=2.0)
        self.spring, self.ground = gp.SpringDamper(c=7.0, d=0.4, phi_rel0=0.1), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.drive.flange, self.a.flange_a), gl.connect(self.a.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.b.flange_a, self.fan.flange, self.load.flange, self.brake.flange),
            gl.connect(self.b.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.ground.flange),
        ]  # fmt: skip


class Bent(gl.Component):
    """Functions of a state, of what is twice a state, of a sum, of a parameter's multiple, and of what cancels."""

    rate, factor = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=3.0)
    x, y = gl.Variable("1"), gl.Variable("1")
    same, twice, total, scaled, nothing, one, other = (gl.Variable("1") for _ in range(7))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.same, self.x), gl.Eq(self.twice, 2 * self.x), gl.Eq(self.total, self.x + self.y),
            gl.Eq(self.scaled, self.factor * self.x), gl.Eq(self.nothing, self.twice - 2 * self.x),
            gl.Eq(self.one, gl.sin(self.same) + self.twice**2 - gl.cos(self.nothing)),
            gl.Eq(self.other, gl.sin(self.total) + self.scaled**3 + gl.sin(-self.y)),
            gl.Eq(gl.der(self.x), self.rate * self.one), gl.Eq(gl.der(self.y), self.rate * self.other),
        ]  # fmt: skip


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("number", range(4))
def test_lanes_are_runs(number: int, moving: bool) -> None:
    """With parameters and inputs of their own; an input that is a straight line in time takes its value and slope from the numbers."""
    system = gl.compile([Fan(), Bound(), RandomTrain(seed=6), Bent()][number])
    scene, model, rng = system.translation.scene, system.translation.model, np.random.default_rng(number)
    program, n, m = scene.program, len(scene.states), len(scene.program.inputs)
    tables = tuple(range(m)) if moving else ()
    table = system.translation.parameter_values({})
    parameters = table[:, None] * rng.uniform(0.9, 1.1, (len(table), LANES))
    solutions, solved = solutions_of_runs(program, parameters)
    assert solved.all()
    x, u, slopes = rng.normal(size=(n, LANES)), rng.normal(size=(m, LANES)), rng.normal(size=(m, LANES))
    code = lane_code(program, len(model.parameters.names), tables)
    numbers = code.numbers(parameters, u, solutions)
    assert numbers.shape[0] == LANES
    for j, k in enumerate(tables):
        numbers[:, 2 * j], numbers[:, 2 * j + 1] = u[k], slopes[k]
    t = rng.uniform(0.0, 2.0, LANES)
    data, out = np.ascontiguousarray(numbers.T), np.empty((n, LANES))
    assert CALL(code.function.address)(*(a.ctypes.data for a in (t, x, out, data))) == 0
    for lane in range(LANES):
        own = prepare(program, scene.structure, parameters[:, lane].copy())
        given = (u[:, lane] + (t[lane] * slopes[:, lane] if moving else 0.0))[:, None]
        slots = evaluate(own, t[lane : lane + 1], x[:, lane : lane + 1], given, np.zeros((scene.n_discrete, 1)))
        expected = slots[program.output_slots, 0]
        assert out[:, lane] == pytest.approx(expected, rel=1e-10, abs=1e-12 * np.abs(slots).max())


def test_numbers_that_are_the_same_in_all_runs_are_written() -> None:
    """So that a chain of linear equations with the same numbers is one line, and reads no coefficient at all."""

    class Line(gl.Component):
        x, y, z = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.y - self.z), gl.Eq(self.y, 2 * self.x), gl.Eq(self.z, -9.0 - self.y)]

    scene = gl.compile(Line()).translation.scene
    code = lane_code(scene.program, len(scene.model.parameters.names))
    lines = [line.strip() for line in code.source.splitlines()[1:]]
    assert lines == ["t = time[0]", "v0 = x[0]", "dx[0] = 9.0 + 4.0 * v0", "return 0"]
    assert (code.tables, code.kept) == ((), frozenset())


def test_what_cancels_in_all_runs_is_not_computed() -> None:
    """Sums of which nothing or one term is left; otherwise constants come first, then slots in order."""

    class Cancelled(gl.Component):
        x, y, z = (gl.Variable("1") for _ in range(3))
        a, b, c = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(self.a, 2 * self.x - self.y), gl.Eq(self.b, self.a + self.y), gl.Eq(self.c, 2 * self.x),
                gl.Eq(gl.der(self.x), self.c - self.b), gl.Eq(gl.der(self.y), self.c - self.a),
                gl.Eq(gl.der(self.z), 3 - 0.5 * self.y + self.x),
            ]  # fmt: skip

    scene = gl.compile(Cancelled(), outputs=["x", "y", "z"]).translation.scene
    code = lane_code(scene.program, len(scene.model.parameters.names))
    assert scene.state_names == ("x", "y", "z")
    lines = [line.strip() for line in code.source.splitlines()[5:-1]]
    assert lines == ["dx[0] = 0.0", "dx[1] = v1", "dx[2] = 3.0 + v0 - 0.5 * v1"]


def test_what_is_used_twice_is_computed_once() -> None:
    """A sum of three parameters' products that two equations take; a sine of time is called before the states are read."""

    class Shared(gl.Component):
        p, q = gl.Parameter("1", default=2.0), gl.Parameter("1", default=3.0)
        rate = gl.Parameter("1/s", default=1.0)
        a, b, c, s = (gl.Variable("1") for _ in range(4))

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(self.s, self.p * self.a + self.q * self.b + self.p * self.q * self.c), gl.Eq(gl.der(self.a), self.rate * self.s),
                gl.Eq(gl.der(self.b), self.rate * (self.a - self.s)),
                gl.Eq(gl.der(self.c), self.rate * (self.s + gl.sin(self.rate * gl.time))),
            ]  # fmt: skip

    scene = gl.compile(Shared()).translation.scene
    code = lane_code(scene.program, len(scene.model.parameters.names))
    lines = [line.strip() for line in code.source.partition("def rhs")[2].splitlines()[1:]]
    s = scene.program.slots[scene.model.variable("s"), 0]
    assert code.kept >= {s}
    assert sum(line.startswith(f"v{s} = ") for line in lines) == 1
    sine = next(i for i, line in enumerate(lines) if "sin(" in line)
    assert sine < lines.index("v0 = x[0]")


@pytest.mark.parametrize(
    ("model", "reason"),
    [
        (Loop(), "equations are solved by iteration"), (Divided(), "equations are solved by iteration"),
        (Latch(), "there are events"), (Bound(), None), (RandomTrain(seed=6), None),
    ],
)  # fmt: skip
def test_what_lanes_cannot_compute(model: gl.Component, reason: str | None) -> None:
    assert why_scalar(gl.compile(model).translation.scene.program) == reason


def test_a_divisor_that_moves_is_left_to_scalar_code() -> None:
    class Quotient(gl.Component):
        x, y = gl.Variable("1", start=0.5), gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(self.y * (2.0 + self.x), 1.0)]

    assert why_scalar(gl.compile(Quotient()).translation.scene.program) == "it is divided by what moves"
