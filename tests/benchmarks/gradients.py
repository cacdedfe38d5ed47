"""Time of runs with sensitivities; writes the tables of docs/gradients.md: ``python -m tests.benchmarks.gradients``.

Processor time, the least of some runs of the XP train (0.5 s, 501 samples, rtol 1e-6), reading the outputs included. Then what columns of
tangents cost in evaluations of the right-hand side, in one process.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import gearlib as gl
import gearparts as gp
from gearlib.run.methods.explicit import Explicit5
from gearlib.solvers.problem import Problem
from gearlib.solvers.rungekutta.rungekutta import RungeKutta
from tests.benchmarks.calls import nanoseconds
from tests.benchmarks.equations import BacklashPair
from tests.measured import Part, table
from tests.run.tangents.test_event_tangents import Shift
from tests.run.tangents.test_sensitivities import Closed
from tests.trains import Chain

NAMES = ["K_g", "C_g", "I_s", "I_p", "I_r", "I_h", "C_v", "R_s"]
METHODS = ("exact", "rk8")


def least(system: gl.System, method: str, names: list[str], repeat: int = 5) -> float:
    """Milliseconds of a run."""
    times = []
    for _ in range(repeat + 1):  # the first one compiles
        begin = time.process_time()
        run = system.simulate(0.5, samples=501, method=method, sensitivities=names)
        for name in names:
            run.sensitivity("q_ring", name)
        run["w_out"]
        times.append(1e3 * (time.process_time() - begin))
    return min(times[1:])


def measured() -> list[dict[str, Any]]:
    system = gl.compile(gp.ZhouCui2022(tau_in=100.0), outputs=["w_out", "q_ring"])
    return [{"method": m, "ms": [least(system, m, NAMES[:count]) for count in (0, 1, 8)]} for m in METHODS]


def text(rows: list[dict[str, Any]]) -> str:
    """The table."""
    head = ["XP train, a run of 0.5 s", "no sensitivities, ms", "one, ms", "eight, ms"]
    return table(head, [[f'`"{r["method"]}"`', *(f"{ms:.2g}" for ms in r["ms"])] for r in rows])


class Probe(Explicit5):
    """Runge-Kutta that notes what a call of the right-hand side takes at the start, ns."""

    name = "probe"

    def __init__(self) -> None:
        self.found: list[float] = []

    def stepper(self, problem: Problem) -> RungeKutta:
        x, data = problem.x0.copy(), problem.data.copy()
        arrays = {"x": x, "dx": np.zeros_like(x), "data": data, "index": problem.index}
        self.found.append(nanoseconds(problem.rhs.address, float(problem.times[0]) + 0.01, **arrays))
        return super().stepper(problem)


def cases() -> Iterator[tuple[str, gl.System, list[str]]]:
    """Models with eight names each."""
    train = gp.ZhouCui2022(tau_in=100.0, e_amplitude=1e-5, e_omega=500.0)
    yield "XP train", gl.compile(train, outputs=["w_out", "q_ring"]), [*NAMES[:7], "start(w_in)"]
    loop = ["load.J", "motor.J", "planetary.ratio", "closing.ratio", "shaft.c", "fan.tau_nominal", "ring.J", "carrier.J"]
    yield "rigid gear loop with a fan", gl.compile(Closed()), loop
    pair = gl.compile(BacklashPair(start={"w_1": 800.0, "w_2": 400.0}), outputs=["w_1", "F"])
    yield "gear pair with backlash", pair, ["k", "d", "b", "J_1", "r_1", "start(w_1)", "start(w_2)", "J_2"]
    chain = ["J", "c", "d", "d_load", "body[1].J", "body[2].J", "shaft[1].c", "start(body[0].w)"]
    yield "chain of ten bodies", gl.compile(Chain(n=10, grounded=True, d=0.4)), chain
    shift = [
        "t_shift",
        "engine.J",
        "planetary.ratio",
        "clutch.fn_max",
        "load.J",
        "drag.tau_nominal",
        "drag.w_nominal",
        "torque",
    ]
    yield "shift of a clutch", gl.compile(Shift()), shift


def measured_columns() -> list[dict[str, Any]]:
    rows = []
    for name, system, names in cases():
        probe = Probe()
        inputs = dict.fromkeys(system.inputs, 1.0)
        for count in (0, 1, 8):
            system.simulate(0.02, samples=3, method=probe, sensitivities=names[:count], inputs=inputs)
        alone, one, eight = probe.found
        rows.append({"model": name, "ns": alone, "one": (one - alone) / alone, "eight": (eight - alone) / alone})
    return rows


WHY = {
    "chain of ten bodies": "loading and storing 160 tangents takes as long as the equations",
    "shift of a clutch": "friction is solved for in each evaluation; the states alone use an inverse kept since the last event",
}


def text_of_columns(rows: list[dict[str, Any]]) -> str:
    """The table of what columns cost."""
    head = ["model", "right-hand side, ns", "one column (aim: 1.3)", "eight columns (aim: 2.5)", "why not"]
    return table(head, [
        [r["model"], f"{r['ns']:.0f}", f"{r['one']:.1f}", f"{r['eight']:.1f}",
         WHY.get(r["model"], "") if r["one"] > 1.3 or r["eight"] > 2.5 else ""]
        for r in rows
    ])  # fmt: skip


TABLE = Part("gradients", "gradients", text)
COLUMNS = Part("columns", "gradients", text_of_columns)
PARTS = [TABLE, COLUMNS]


if __name__ == "__main__":
    TABLE.store(measured())
    COLUMNS.store(measured_columns())
    print(TABLE.shown(), COLUMNS.shown(), sep="\n\n")
