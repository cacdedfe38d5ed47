"""Matrices that only events change: kept between events, and the same as an elimination in each evaluation."""

from __future__ import annotations

import ctypes
import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import SolverError
from gearlib.native.layout import Shared, lay_out, operations
from gearlib.program.interpret import evaluate
from gearlib.program.program import Newton
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train

MODEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[ctypes.c_void_p] * 4)


class Gearbox(gl.Component):
    """Two planetary sets with two brakes and two clutches; the second clutch is on a path that the first may close, too."""

    parallel = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.engine, self.shaft = gp.ConstantTorque(tau_constant=40.0), gp.Inertia(J=0.3, start={"w": 30.0})
        self.p, self.q = gp.IdealPlanetary(ratio=2.0), gp.IdealPlanetary(ratio=1.6)
        self.A, self.B = gp.Brake(fn_max=100.0), gp.Brake(fn_max=150.0)
        self.C, self.D = gp.Clutch(fn_max=120.0), gp.Clutch(fn_max=130.0)
        self.sun, self.ring, self.out = gp.Inertia(J=0.02), gp.Inertia(J=0.03), gp.Inertia(J=2.0)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-20.0, w_nominal=10.0)
        ends = (self.C.flange_a, self.C.flange_b) if self.parallel else (self.sun.flange_a, self.out.flange_b)
        return [
            gl.connect(self.engine.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.p.carrier, self.C.flange_a),
            gl.connect(self.p.sun, self.sun.flange_a, self.A.flange_a),
            gl.connect(self.p.ring, self.q.sun, self.ring.flange_a, self.C.flange_b),
            gl.connect(self.q.ring, self.B.flange_a),
            gl.connect(self.q.carrier, self.out.flange_a),
            gl.connect(self.D.flange_a, ends[0]),
            gl.connect(self.D.flange_b, ends[1]),
            gl.connect(self.out.flange_b, self.fan.flange),
        ]


class Star(gl.Component):
    """Lossy gears on one hub, each with a load that brakes."""

    branches = gl.Structural(60)
    joined = gl.Structural(1)  # equal branches that each of them stands for

    def assemble(self) -> list[Any]:
        self.torque, self.hub = gp.ConstantTorque(tau_constant=30.0), gp.Inertia(J=1.0, start={"w": 100.0})
        n = range(self.branches)
        self.gears = [gp.LossyGear(ratio=2.0, loss_table=[[0.0, 0.95, 0.9, 0.0, 0.0]]) for _ in n]
        self.loads = [gp.Inertia(J=0.01 * self.joined) for _ in n]
        self.fans = [gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0 * self.joined, w_nominal=50.0) for _ in n]
        found = [gl.connect(self.torque.flange, self.hub.flange_a)]
        for gear, load, fan in zip(self.gears, self.loads, self.fans, strict=True):
            found += [gl.connect(self.hub.flange_b, gear.flange_a), gl.connect(gear.flange_b, load.flange_a)]
            found.append(gl.connect(load.flange_b, fan.flange))
        return found


@cache
def compiled(parallel: bool) -> gl.System:
    return gl.compile(Gearbox(parallel=parallel), outputs=["shaft.w", "out.w"])


@cache
def star(branches: int) -> gl.System:
    return gl.compile(Star(branches=branches), outputs=["hub.w"])


@pytest.mark.parametrize("parallel", [False, True])
def test_rates_agree_with_the_interpreter_in_every_order_of_modes(parallel: bool) -> None:
    check_rates(compiled(parallel))


# how a matrix is stored, and what makes it so where blocks are small
STORED: dict[str, dict[str, Any]] = {
    "rows of the dense inverse": {},
    "rows of the sparse inverse": {"INDIRECT": 100.0},
    "columns of the sparse inverse": {"INDIRECT": 100.0, "KeptMatrix.by_rows": False},
    "sparse factors": {"INDIRECT": 0.01},
    "not at all": {"MOST_KEPT": 0},
}


@pytest.mark.parametrize("stored", STORED)
def test_rates_agree_with_the_interpreter_however_a_matrix_is_stored(stored: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in STORED[stored].items():
        monkeypatch.setattr(f"gearlib.native.layout.{name}", value)
    if "sparse" in stored:
        for name, value in {"program.LARGE": 4, "program.SPARSE": 1.0, "interpret.MOST_DENSE": 4}.items():
            monkeypatch.setattr(f"gearlib.program.{name}", value)
    system = gl.compile(Model(train=hybrid_train(79)))
    (kept,) = system.translation.scene.native.rhs.layout.kept
    assert (kept is None) == (stored == "not at all")
    assert (kept is not None and kept.factors is not None) == (stored == "sparse factors")
    check_rates(system, turns=24)


def check_rates(system: gl.System, turns: int = 60) -> None:
    scene = system.translation.scene
    rng, model, program = np.random.default_rng(4), scene.model, scene.program
    (block,) = [s for s in program.steps if isinstance(s, Newton)]
    assert block.switched
    numbers = scene.prepared(system.translation.parameter_values({}))
    flags = scene.discrete(numbers, np.zeros(1), np.zeros((len(scene.states), 1)), np.full((len(program.inputs), 1), 0.5))[:, 0]
    data = scene.data(scene.native, numbers, np.zeros(len(program.inputs)), flags, np.zeros(model.n_variables))
    shared, rhs = scene.native.shared, MODEL(scene.native.rhs.address)
    (kept,), agreed = scene.native.rhs.layout.kept, 0
    patterns = [np.where(rng.random(len(flags)) < 0.3, 1.0 - flags, flags) for _ in range(12)]
    now = patterns[0]
    for turn in range(turns):
        now = patterns[int(rng.integers(len(patterns)))] if turn % 3 == 0 else now  # each is met again, after others
        x, u = rng.normal(size=len(scene.states)), rng.random(len(program.inputs))
        data[shared.relations :][: shared.n_discrete] = now
        data[shared.inputs :][: shared.n_inputs] = u
        rates = np.empty(len(scene.states))
        status = rhs(0.1, x.ctypes.data, rates.ctypes.data, data.ctypes.data, scene.native.index.ctypes.data)
        try:
            slots = evaluate(numbers, np.array([0.1]), x[:, None], u[:, None], now[:, None])[:, 0]
        except SolverError:
            assert status != 0
            continue
        assert status == 0
        assert kept is None or data[kept.place] in (1.0, 2.0)  # computed, or found to be singular
        right = slots[program.output_slots]
        rounding = 1e-9 * float(np.abs(right).max()) + 1e-11  # where it is stuck, zero is a difference of some 100 rad/s2
        assert rates == pytest.approx(right, rel=1e-9, abs=rounding)
        agreed += 1
    assert agreed > turns / 3


def test_an_evaluation_costs_a_product_and_no_elimination() -> None:
    program = compiled(False).translation.scene.program
    layout = compiled(False).translation.scene.native.rhs.layout
    without = lay_out(program, layout.shared, layout.shared.size)
    assert 10.0 * operations(program, layout) < operations(program, without)


def test_parallel_clutches_stuck_together_share_a_torque() -> None:
    """Both close on one path, so that their equations depend on each other: the train turns as with one clutch of both capacities."""
    system = compiled(True)
    pressed = {"A.f_normalized": 0.0, "B.f_normalized": 1.0, "C.f_normalized": 0.5, "D.f_normalized": 0.5}
    run = system.simulate(2.0, inputs=pressed, rtol=1e-8)
    closed = {**pressed, "C.f_normalized": 0.5 + 0.5 * 130 / 120, "D.f_normalized": 0.0}
    other = system.simulate(2.0, inputs=closed, rtol=1e-8)
    assert run["out.w"] == pytest.approx(other["out.w"], rel=1e-6)
    assert math.isfinite(float(run["shaft.w"][-1]))


def test_a_star_turns_as_one_gear_for_all_equal_branches() -> None:
    """The scene of a hub with many gears; its friction torques are proportional to what a branch transmits."""
    one = gl.compile(Star(branches=1, joined=30), outputs=["hub.w"]).simulate(0.5, rtol=1e-9)
    assert star(30).simulate(0.5, rtol=1e-9)["hub.w"] == pytest.approx(one["hub.w"], rel=1e-7)


def test_an_evaluation_of_a_star_costs_what_its_branches_cost() -> None:
    costs = []
    for branches in (30, 120):
        program = star(branches).translation.scene.program
        shared = Shared(len(star(branches).translation.model.parameters.names), star(branches).translation.scene.n_discrete, 0)
        costs += [operations(program, lay_out(program, shared, shared.size, keep=keep)) for keep in (True, False)]
    assert costs[2] < 4.5 * costs[0]
    assert costs[3] < 4.5 * costs[1]
