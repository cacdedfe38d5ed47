"""Systems and results go to other processes and come back; what was not read there is computed here."""

from __future__ import annotations

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


class Drive(gl.Component):
    """A pulsing torque, a rigid gear, an elastic shaft and a load."""

    J = gl.Parameter("kg.m2", "of the load", default=2.0)

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.motor = gp.Torque(tau=5 * gl.sin(3 * gl.time)), gp.Inertia(J=0.1)
        self.gear, self.shaft = gp.IdealGear(ratio=3.0), gp.SpringDamper(c=400.0, d=2.0)
        self.load = gp.Inertia(J=self.J)
        return [
            gl.connect(self.torque.flange, self.motor.flange_a), gl.connect(self.motor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]  # fmt: skip


def run(system: gl.System, J: float) -> gl.Result:
    return system.simulate(1.0, samples=11, parameters={"J": J})


@pytest.fixture(scope="module")
def system() -> gl.System:
    return gl.compile(Drive())


@pytest.mark.parametrize("duplicate", [copy.deepcopy, copy.copy, lambda s: pickle.loads(pickle.dumps(s))])
def test_a_copy_of_a_system_gives_the_same(system: gl.System, duplicate: Any) -> None:
    other = duplicate(system)
    assert other.states == system.states
    assert (run(other, 3.0)["shaft.tau"] == run(system, 3.0)["shaft.tau"]).all()


@pytest.mark.parametrize("name", ["load.w", "shaft.tau", "motor.phi", "der(load.w)"])
def test_a_result_comes_back_whole(system: gl.System, name: str) -> None:
    result = run(system, 3.0)
    back = pickle.loads(pickle.dumps(result))
    assert (back[name] == result[name]).all()
    assert (back.time == result.time).all()
    assert (back.states == result.states).all()
    assert (back.stats, back.events, list(back)) == (result.stats, result.events, list(result))
    assert np.array_equal(back.with_sample(0.05)["load.w"][:1], result["load.w"][:1])  # integrated again


def test_a_system_that_was_assembled_goes_without_its_parts(system: gl.System) -> None:
    assert len(pickle.dumps(system)) < 600
    assert system.translation.component.load is system.translation.component.load  # and keeps them here


@pytest.mark.slow
def test_a_pool_of_processes() -> None:
    system = gl.compile(Drive())
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        results = list(pool.map(run, [system] * 3, [1.0, 2.0, 3.0]))
    for result, J in zip(results, [1.0, 2.0, 3.0], strict=True):
        assert (result["shaft.tau"] == run(system, J)["shaft.tau"]).all()
