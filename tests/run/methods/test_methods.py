"""Methods by name and as instances: what fits, what is refused, methods of one's own."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, SolverError
from gearlib.run.methods.method_table import METHODS, method_of
from tests.benchmarks.users import Servo
from tests.run.test_continued_runs import Thermostat, temperature


class Midpoint(gl.ExplicitStepper):
    """Of order 2."""

    def __init__(self, h: float) -> None:
        self.h = h

    def advance(self, t: float, x: Any, stop: float) -> tuple[float, Any]:
        h = min(self.h, stop - t)
        return t + h, x + h * self.f(t + 0.5 * h, x + 0.5 * h * self.f(t, x))


class Fixed(gl.Method):
    """With fixed steps."""

    name = "midpoint"

    def __init__(self, h: float = 1e-3) -> None:
        self.h = h

    def fits(self, run: Any) -> str | None:
        return "needs ten states at most" if len(run.scene.states) > 10 else None

    def stepper(self, problem: Any) -> Midpoint:
        return Midpoint(self.h)


class Drive(gl.Component):
    def assemble(self) -> list[Any]:
        self.torque, self.load, self.drag, self.ground = gp.Torque(), gp.Inertia(J=2.0), gp.Damper(d=0.5), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.load.flange_a), gl.connect(self.load.flange_b, self.drag.flange_a),
            gl.connect(self.drag.flange_b, self.ground.flange),
        ]  # fmt: skip


def test_names_are_those_of_the_table() -> None:
    assert list(METHODS)[:7] == ["auto", "exact", "ida", "rk", "rk5", "rk8", "taylor"]
    for name, method in METHODS.items():
        assert method.name == name
        assert method_of(name) is method


@pytest.mark.parametrize("name", ["auto", "ida", "rk", "rk5", "rk8", "taylor"])
def test_every_method_but_exact_fits_a_hybrid_scene(name: str) -> None:
    system = gl.compile(Thermostat())
    assert system.simulate(12.0, samples=25, method=name)["T"] == pytest.approx(temperature(np.linspace(0, 12, 25)), abs=1e-5)
    with pytest.raises(ArgumentError, match=r"method='exact' needs a linear time-invariant scene: .*; use method='auto'"):
        system.simulate(12.0, method="exact")


def test_events_inputs_and_discrete_state_of_a_method_of_ones_own() -> None:
    result = gl.simulate(Thermostat(), 12.0, samples=25, method=Fixed())
    assert result["T"] == pytest.approx(temperature(result.time), abs=1e-6)
    assert result["cycles"][-1] == 2.0
    assert sorted({round(t, 5) for t, _ in result.events}) == [1.0, 5.0, 7.0, 11.0]
    assert (result.stats["method"], result.stats["why"]) == ("midpoint", "asked for")
    drive = gl.compile(Drive())
    for tau in (4.0, lambda t: 4.0, gl.Table([0.0, 1.0, 2.0], [4.0, 4.0, 4.0])):
        driven = drive.simulate(2.0, samples=5, method=Fixed(), inputs={"torque.tau": tau})
        assert driven["load.w"] == pytest.approx(8.0 * (1.0 - np.exp(-0.25 * driven.time)), rel=1e-6)


def test_a_large_scene_with_events_agrees_with_the_others() -> None:
    system = gl.compile(Servo(), outputs=["load.phi"])
    fine = system.simulate(0.2, samples=21, method="rk8", rtol=1e-9)["load.phi"]
    own = system.simulate(0.2, samples=21, method=Fixed(2e-5))["load.phi"]
    assert own == pytest.approx(fine, abs=1e-4 * np.abs(fine).max())


def test_what_a_method_lacks_is_said() -> None:
    class Row(gl.Component):
        def assemble(self) -> list[Any]:
            self.bodies = [gp.Inertia(J=1.0) for _ in range(12)]
            self.shafts = [gp.Spring(c=10.0) for _ in range(11)]
            return [
                gl.connect(a, b)
                for k, shaft in enumerate(self.shafts)
                for a, b in ((self.bodies[k].flange_b, shaft.flange_a), (shaft.flange_b, self.bodies[k + 1].flange_a))
            ]

    with pytest.raises(ArgumentError, match="method='midpoint' needs ten states at most; use method='auto', 'rk' or 'ida'"):
        gl.simulate(Row(), 1.0, method=Fixed())


def test_registered_methods_go_by_their_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(METHODS, "midpoint", raising=False)
    with pytest.raises(ArgumentError, match="there is no method 'midpoint'"):
        gl.simulate(Drive(), 1.0, inputs={"torque.tau": 0.0}, method="midpoint")
    gl.register_method(Fixed())
    monkeypatch.setitem(METHODS, "midpoint", METHODS["midpoint"])  # gone after the test
    result = gl.simulate(Drive(), 1.0, inputs={"torque.tau": 0.0}, method="midpoint", start={"load.w": 1.0})
    assert result["load.w"][-1] == pytest.approx(math.exp(-0.25), rel=1e-6)
    del METHODS["midpoint"]
    impostor = Fixed()
    impostor.name = "rk5"
    for wrong, text in (
        (Fixed, "an instance of a subclass"),
        ("rk4", "an instance"),
        (impostor, "there is a method 'rk5' in gearlib"),
    ):
        with pytest.raises(ArgumentError, match=text):
            gl.register_method(wrong)  # type: ignore[arg-type]


def test_results_know_the_method_also_from_files_and_other_processes(tmp_path: Any) -> None:
    result = gl.simulate(Drive(), 1.0, samples=3, inputs={"torque.tau": 1.0}, method=Fixed())
    result.save(tmp_path / "r.mat")
    assert gl.load_result(tmp_path / "r.mat")["load.w"] == pytest.approx(result["load.w"])
    again = pickle.loads(pickle.dumps(result))
    assert again.stats["method"] == "midpoint"
    assert again["load.w"].tolist() == result["load.w"].tolist()


def test_a_method_of_ones_own_can_be_stepped() -> None:
    run = gl.compile(Drive()).stepper(method=Fixed(), inputs={"torque.tau": 4.0})
    for k in range(1, 5):
        run.advance(0.5 * k)
    assert run["load.w"] == pytest.approx(8.0 * (1.0 - math.exp(-0.5)), rel=1e-6)


def test_errors_of_a_method_of_ones_own() -> None:
    class Growth(gl.Component):
        x = gl.Variable("1", "", start=-1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), gl.sqrt(-self.x))]

    with pytest.raises(SolverError, match=r"the right-hand side cannot be evaluated beyond t = (1\.9|2)"):
        gl.simulate(Growth(), 3.0, method=Fixed())
