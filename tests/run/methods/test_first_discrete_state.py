"""The discrete state in which a run begins: the compiled event iteration finds what the interpreter finds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.run.methods import native_problem
from gearlib.run.scene import Scene
from tests.gearparts import msl_hybrid_examples as msl
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train


def begins_alike(system: gl.System, monkeypatch: pytest.MonkeyPatch, compiled: bool | None = None) -> None:
    """The discrete state at the start of a run is the one that the interpreter finds; whether it was asked for them."""
    found: list[tuple[Any, Any]] = []
    asked: list[bool] = []
    original, interpreted = native_problem.starting_discrete, Scene.discrete

    def watched(run: Any, native: Any, inputs: Any) -> Any:
        begin = run.start
        right = interpreted(run.scene, run.numbers, run.times[:1], begin.states[:, None], inputs[:, None], start=begin.guess)
        found.append((original(run, native, inputs), right[:, 0]))
        return found[-1][0]

    def counted(self: Scene, *arguments: Any, **named: Any) -> Any:
        asked.append(True)
        return interpreted(self, *arguments, **named)

    with monkeypatch.context() as patch:
        patch.setattr(native_problem, "starting_discrete", watched)
        patch.setattr(Scene, "discrete", counted)
        system.simulate(0.01, samples=2, inputs=dict.fromkeys(system.translation.open_inputs, 0.0), method="rk")
    assert found
    for own, right in found:
        np.testing.assert_array_equal(own, right)
    assert compiled is None or compiled == (not asked)


@pytest.mark.parametrize("name", ["CoupledClutches", "Friction", "SimpleGearShift", "LossyGearDemo1", "LossyGearDemo2"])
def test_friction_begins_in_compiled_code(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    begins_alike(gl.compile(getattr(msl, name)()), monkeypatch, compiled=True)


@pytest.mark.parametrize("seed", range(4))
def test_random_trains_begin_alike(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    begins_alike(gl.compile(Model(train=hybrid_train(seed))), monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4, 60))
def test_many_random_trains_begin_alike(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    begins_alike(gl.compile(Model(train=hybrid_train(seed))), monkeypatch)


def test_a_start_is_found_once_for_the_same_numbers() -> None:
    system = gl.compile(msl.CoupledClutches())
    translation = system.translation
    scene, numbers = translation.scene, translation.parameter_values({})
    none = [0.0] * len(translation.inputs)
    first = translation.start(scene, numbers, 0.0, None, none)
    first.states[:] = np.nan  # whoever changes what was returned changes nothing else
    first.guess[:] = np.nan
    second = translation.start(scene, numbers, 0.0, None, none)
    assert np.isfinite(second.states).all()
    for other in ({"J1.w": 5.0}, None):
        again = translation.start(scene, numbers, 0.0, other, none)
        scene.started.clear()
        anew = translation.start(scene, numbers, 0.0, other, none)
        np.testing.assert_array_equal(again.states, anew.states)
        np.testing.assert_array_equal(again.guess, anew.guess)
        assert again.free == anew.free
    assert not np.array_equal(translation.start(scene, numbers, 0.0, {"J1.w": 5.0}, none).states, second.states)


def test_constraints_on_start_values_are_analysed_once() -> None:
    system = gl.compile(msl.CoupledClutches())
    scene = system.translation.scene
    system.simulate(0.1, samples=2)
    known = dict(scene.constraints)
    assert len(known) == 1
    system.simulate(0.1, samples=2, start={"J1.w": 5.0})
    assert all(scene.constraints[key] is value for key, value in known.items())
