"""A probe of models with comparisons: they hold what the state at hand says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import gearlib as gl
from gearlib.program.interpret import batch_values, evaluate, prepare
from gearlib.program.relations import relations_of
from tests.gearparts.conftest import Probe


class RelatedProbe(Probe):
    """As `Probe`, for models whose comparisons depend on states, inputs and time, and not on each other."""

    def __init__(self, component: gl.Component) -> None:
        super().__init__(component)
        self.relations = relations_of(self.structure, self.program)
        parameters = self.model.parameters.defaults
        self.helper = prepare(self.relations.program, self.structure, parameters)

    def slots(self, states: Mapping[str, float], inputs: Mapping[str, float], t: float) -> Any:
        slots = super().slots(states, inputs, t)
        flags, first = np.zeros((1000, 1)), self.model.first_relations
        x = slots[: len(self.program.states)]
        u = slots[len(self.program.states) :][: len(self.program.inputs)]
        compared = evaluate(self.helper, np.array([t]), x, u, flags)
        for batch in self.relations.batches:
            values = batch_values(batch, np.array([t]), compared, self.helper.parameters, flags)[:, 0]
            for target, value in zip(batch.targets.tolist(), values.tolist(), strict=True):
                g = int(np.searchsorted(first, target, side="right")) - 1
                relations = self.model.groups[g].template.relations
                relation = relations[(target - int(first[g])) % len(relations)]
                value = -value if relation.negated else value
                flags[target] = value > 0 if relation.strict else value >= 0
        return evaluate(self.prepared, np.array([t]), x, u, flags)
