"""Tangents of small programs in vectors: those of the loops, for any number of columns, and those of matrix exponentials."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.run.tangents.requested import directions
from gearlib.run.tangents.tangents import TangentCode, tangent_plan
from tests.benchmarks.equations import BacklashPair, RigidLoop
from tests.native.test_generated import Quotients
from tests.run.tangents.other_runs import off
from tests.trains import Chain

XP = ["K_g", "I_r", "start(w_in)", "R_s", "I_s", "e_omega", "C_v", "start(q_ring)", "e_amplitude", "C_g", "R_p"]


class Driven(Chain):
    """A chain whose torque and damping grow with time and speed."""

    def assemble(self) -> list[Any]:
        links = super().assemble()
        self.push = gp.Torque(tau=3.0 * gl.sin(7.0 * gl.time))
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-2.0, w_nominal=3.0)
        return [
            *links,
            gl.connect(self.push.flange, self.body[0].flange_a),
            gl.connect(self.fan.flange, self.body[-1].flange_b),
        ]


@pytest.fixture(scope="module")
def train() -> gl.System:
    return gl.compile(gp.ZhouCui2022(tau_in=100.0, e_amplitude=1e-5, e_omega=500.0, e_phase=0.3), outputs=["w_out", "q_ring"])


def rates(code: TangentCode, system: gl.System, varied: Any, x: Any, flags: Any) -> np.ndarray:
    own = system.translation
    scene, numbers = own.scene, own.scene.prepared(own.model.parameters.defaults)
    data = scene.data(code.native, numbers, np.zeros(len(scene.program.inputs)), flags, np.zeros(own.model.n_variables))
    code.fill(data, varied, numbers, np.zeros((0, len(varied))))
    out = np.full(len(x) + 8, 7.0)  # nothing beyond the last tangent is written
    function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *(ctypes.c_void_p,) * 4)(code.native.rhs.address)
    arrays = x, out, data, code.native.index
    assert function(0.37, *(a.ctypes.data for a in arrays)) == 0
    assert (out[len(x) :] == 7.0).all()
    return out[: len(x)]


@pytest.mark.parametrize("count", [1, 3, 8, 10])
def test_any_number_of_columns(train: gl.System, count: int) -> None:
    agree(train, XP[:count])


@pytest.mark.parametrize(
    ("component", "names"),
    [
        (Driven(n=5, grounded=True, d=0.4), ["J", "c", "fan.w_nominal", "start(body[0].w)", "body[1].J"]),
        (BacklashPair(start={"w_1": 800.0, "w_2": 400.0}), ["k", "d", "b", "J_1", "r_1"]),
        (RigidLoop(), ["load.J", "motor.J", "planetary.ratio"]),
        (Quotients(), ["p", "q"]),
    ],
)
def test_blocks_conditions_and_functions(component: Any, names: list[str]) -> None:
    agree(gl.compile(component), names)


def agree(system: gl.System, names: list[str]) -> None:
    """The vectors and the loops give the same rates, whatever the states and relations."""
    own, rng = system.translation, np.random.default_rng(len(names))
    scene, start = own.scene, {"start": {name[6:-1]: 1.0 for name in names if name.startswith("start")}}
    varied = directions(own, names, own.model.parameters.defaults, [], start["start"])
    assert varied is not None
    plan = tangent_plan(scene.program, (len(varied), varied.entries), scene.program.output_slots)
    vectors, loops = (TangentCode(plan, scene.compiled(False, plan, given), ()) for given in (varied.entries, None))
    assert vectors.native.vectors is not None
    assert loops.native.vectors is None
    sizes = np.append(scene.nominal, np.outer(scene.nominal, 1.0 / varied.sizes).ravel())
    for _ in range(3):
        x, flags = rng.normal(size=len(sizes)) * sizes, rng.integers(0, 2, scene.n_discrete).astype(float)
        found, right = (rates(code, system, varied, x, flags) for code in (vectors, loops))
        assert np.allclose(found, right, rtol=1e-11, atol=1e-11 * np.abs(right).min(initial=1.0, where=right != 0.0))


def test_columns_of_steps_are_those_of_exponentials(train: gl.System) -> None:
    names = XP
    steps, exact = (train.simulate(0.01, samples=5, rtol=1e-11, method=m, sensitivities=names) for m in ("rk8", "exact"))
    for name in names:
        assert off(steps.sensitivity("q_ring", name), exact.sensitivity("q_ring", name)) < 1e-8, name
