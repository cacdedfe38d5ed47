"""A model's matrices and values at chosen states, for tests that compare components with closed forms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.flatten.flatten import flatten
from gearlib.program.build import build
from gearlib.program.derivatives import derivatives
from gearlib.program.interpret import evaluate, prepare
from gearlib.reduce.reduction import analyse


class Probe:
    """A flattened and sorted model whose variables can be read at any state, with no solver in between."""

    def __init__(self, component: gl.Component) -> None:
        model = self.model = flatten(component)
        parameters = model.parameters.defaults
        self.structure = analyse(model, parameters)
        self.nodes = [s for s in self.structure.states if s not in self.structure.angles]
        known = set(model.inputs.tolist())
        shown = sorted(set(model.representative[model.sign != 0].tolist()) - known)
        targets = [(v, k) for v in shown for k in (0, 1) if k == 0 or (v, 1) in self.structure.solved_by]
        self.program = build(self.structure, targets, None, True)
        self.prepared = prepare(self.program, self.structure, parameters)
        self.model = self.structure.model
        self.states = [model.name(v) for v, _ in self.nodes]

    def slots(self, states: Mapping[str, float], inputs: Mapping[str, float], t: float) -> Any:
        """All slots; states and inputs that are not named are zero."""
        model, program = self.model, self.program
        x = np.zeros((len(program.states), 1))
        for name, value in states.items():
            v = model.variable(name)
            x[program.states.index((int(model.representative[v]), 0)), 0] = value * int(model.sign[v])
        u = np.zeros((len(program.inputs), 1))
        for name, value in inputs.items():
            u[[v for v, _ in program.inputs].index(model.variable(name)), 0] = value
        return evaluate(self.prepared, np.array([t]), x, u, np.zeros((100, 1)))

    def values(
        self, states: Mapping[str, float], inputs: Mapping[str, float] | None = None, t: float = 0.0
    ) -> Callable[[str], float]:
        """A function that gives a variable's value, or that of "der(...)", by path."""
        slots = self.slots(states, inputs or {}, t)

        def value(name: str) -> float:
            order = int(name.startswith("der("))
            v = self.model.variable(name.removeprefix("der(").removesuffix(")") if order else name)
            sign = int(self.model.sign[v])
            return sign * float(slots[self.program.slots[int(self.model.representative[v]), order], 0]) if sign else 0.0

        return value

    @property
    def A(self) -> Any:
        """Of der(x) = A x + ..., for the states but the absolute angles that nothing depends on; at zero."""
        slots = [self.program.slots[v, k + 1] for v, k in self.nodes]
        seeds = [self.program.states.index(node) for node in self.nodes]
        matrix = derivatives(self.prepared, 0.0, self.slots({}, {}, 0.0)[:, 0], np.zeros(100), seeds)[slots]
        return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


@pytest.fixture
def probe() -> Callable[[gl.Component], Probe]:
    return Probe
