"""Programs of some compiled models with values for everything that they read: states, inputs, relations, time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

import gearlib as gl
from gearlib.program.interpret import Prepared, evaluate
from gearlib.program.program import Batch, Linear, Newton, Program
from tests.program.test_derivatives import Bound, Held, Loop
from tests.program.test_event_iteration import Latch
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train

KINDS = {"bound": Bound, "held": Held, "loop": Loop, "latch": Latch, "switching train": lambda: Model(train=hybrid_train(23))}


@dataclass(frozen=True, eq=False)
class Point:
    """A program at two times."""

    scene: Any
    numbers: Prepared
    t: Any
    slots: Any
    flags: Any

    @property
    def program(self) -> Program:
        return self.numbers.program

    @property
    def batches(self) -> list[Batch]:
        """Everything that is evaluated, with the matrices of blocks."""
        found: list[Batch] = []
        for step in self.program.steps:
            if isinstance(step, Batch):
                found.append(step)
            else:
                found += step.matrix if isinstance(step, Linear) else (*step.residuals, *step.jacobian)
        return found


@cache
def compiled(kind: str) -> gl.System:
    return gl.compile(KINDS[kind]())


@cache
def point(kind: str) -> Point:
    translation = compiled(kind).translation
    scene, rng = translation.scene, np.random.default_rng(3)
    numbers = scene.numbers(translation.parameter_values({}))
    t, x = np.array([0.3, 1.7]), scene.nominal[:, None] * rng.uniform(0.2, 1.0, (len(scene.states), 2))
    u = rng.normal(size=(len(scene.program.inputs), 2))
    if any(isinstance(step, Newton) for step in scene.program.steps):
        flags = scene.discrete(numbers, t, x, u)
    else:
        flags = (rng.random((scene.n_discrete, 2)) < 0.5).astype(float)
    return Point(scene, numbers, t, evaluate(numbers, t, x, u, flags), flags)
