"""What ``auto`` does on users' scenes: its counted work against that of each method, which does not depend on how busy a machine is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.solvers.alternation import WORTH_DECAY
from gearlib.solvers.ida.ida_stepper import START
from tests.benchmarks.users import USERS
from tests.run.methods.test_integrate import Drive

SHORT = {
    "fan": 0.05,
    "gearbox": 0.04,
    "vehicle": 0.6,
    "crank train": 0.02,
    "wind turbine": 20.0,
    "planets": 0.04,
    "servo": 0.15,
}
NO_SERIES = ("crank train", "wind turbine", "servo")
SLOW = {("crank train", "ida"), ("servo", "rk8")}  # hopeless, and long


def run(system: gl.System, name: str, **options: Any) -> gl.Result:
    scene = USERS[name]
    return system.simulate(scene.times[-1], times=scene.times, inputs=scene.inputs, **options)


@pytest.mark.parametrize("name", SHORT)
def test_no_more_work_than_the_best_method(name: str) -> None:
    """At equal rtol. The scenes with clutches are compared at equal error, by `make bench`: order 8 is far more accurate there."""
    system = gl.compile(USERS[name].component(), outputs=list(USERS[name].outputs))
    for rtol in (1e-4, 1e-6, 1e-8):
        own = [m for m in ("rk5", "rk8", "taylor", "ida") if (name, m) not in SLOW and (m != "taylor" or name not in NO_SERIES)]
        work = {m: run(system, name, method=m, rtol=rtol).stats["work"] for m in own}
        found = run(system, name, rtol=rtol)
        assert found.stats["work"] <= 1.3 * min(work.values()), (rtol, work, found.stats["why"])


@pytest.mark.parametrize("name", SHORT)
def test_right_on_the_way(name: str) -> None:
    """The first part against the reference; the whole is compared by `make bench`, the other scenes by `test_user_scenes`."""
    scene = USERS[name]
    times = np.linspace(0.0, SHORT[name], 41)
    system = gl.compile(scene.component(), outputs=list(scene.outputs))
    result = system.simulate(times[-1], times=times, inputs=scene.inputs)
    assert scene.error(np.column_stack([result[output] for output in scene.outputs]), times) < 2e-5


@pytest.mark.parametrize("name", ["gearbox", "planets", "servo"])
def test_samples_have_no_part_in_the_choice(name: str) -> None:
    scene = USERS[name]
    system = gl.compile(scene.component(), outputs=list(scene.outputs))
    few, many = (system.simulate(scene.times[-1], samples=n, max_step=1e-3) for n in (2, 4001))
    for counted in ("steps", "work", "why", "method"):
        assert few.stats[counted] == many.stats[counted]
    for output in scene.outputs:
        assert few[output][-1] == many[output][-1]


def test_the_choice_can_be_read() -> None:
    gearbox = gl.compile(USERS["gearbox"].component())
    assert gearbox.simulate(0.1, samples=2).stats["method"] == "taylor"
    assert gearbox.simulate(0.1, samples=2, sensitivities=["load.J"]).stats["method"] in ("rk5", "rk8")
    said = gearbox.simulate(10.0, samples=2, rtol=1e-4).stats
    assert said["method"] == "taylor"
    assert "the Taylor series met stiffness" in said["why"]
    assert said["why"].endswith("and would have taken longer")
    said = gl.compile(Drive()).simulate(1.0, samples=2).stats
    assert said["method"] == "ida"
    assert "the Taylor series met stiffness" in said["why"]
    assert said["why"].endswith("handed over to IDA")


@pytest.mark.parametrize("d", [1.0, 10.0, 30.0, 100.0, 300.0, 1e3])
@pytest.mark.parametrize("rtol", [1e-4, 1e-8])
def test_a_decay_that_limits_the_steps_is_left_to_ida(d: float, rtol: float) -> None:
    system = gl.compile(Drive())
    work = {
        m: system.simulate(1.0, samples=2, method=m, rtol=rtol, parameters={"d": d}).stats["work"]
        for m in ("taylor", "rk8", "ida")
    }
    found = system.simulate(1.0, samples=2, rtol=rtol, parameters={"d": d}).stats
    assert found["work"] <= 1.3 * min(work["taylor"], work["rk8"], WORTH_DECAY * (START + work["ida"]))


class Power(gl.Component):
    """A quantity whose second derivative is infinite at the start."""

    x = gl.Variable("1", "quantity", start=0.0)
    rate = gl.Parameter("1/s", "makes time a number", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), (self.rate * gl.time) ** 1.5 + 0 * self.x**2)]


def test_runge_kutta_goes_on_where_a_series_ends() -> None:
    result = gl.simulate(Power(), 2.0, samples=21)
    assert result.stats["method"] in ("rk5", "rk8")
    assert result["x"] == pytest.approx(result.time**2.5 / 2.5, abs=1e-6)
