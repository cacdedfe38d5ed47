"""Forms of a scene for IDA, by the algebraic unknowns left to it: from none (the ODE form) to all (the DAE).

Each is a `SceneForm`, with the interface of a `Scene`: program, native code, relations, names, data. It is made when a run first asks
for it, and cached in the scene.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.native.scene_functions import NativeScene, compile_scene
from gearlib.program.build import build
from gearlib.program.derivative_plan import state_plan
from gearlib.program.interpret import Prepared, evaluate, prepare
from gearlib.program.program import Program
from gearlib.program.relations import Relations, relations_of
from gearlib.program.residual_form import ResidualForm, index_reduced_form, torn_form
from gearlib.recent import recent
from gearlib.run.scene import Scene, data_block, discrete_at_start, guess_of, node_name, relation_names, root_names
from gearlib.run.start_values import Start
from gearlib.run.time_switches import TimeSwitches, time_switches
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SceneForm:
    """A scene with algebraic unknowns that are left to IDA.

    Attributes
    ----------
    scene : Scene
    equations : ResidualForm
    """

    scene: Scene
    equations: ResidualForm
    _prepared: dict[bytes, Prepared] = field(default_factory=dict)

    @property
    def program(self) -> Program:
        return self.equations.program

    @property
    def relations(self) -> Relations | None:
        return self.equations.relations

    @property
    def implicit(self) -> bool:
        return self.equations.implicit

    @cached_property
    def time_switches(self) -> TimeSwitches:
        return time_switches(self.relations)

    @cached_property
    def relation_names(self) -> dict[int, str]:
        return relation_names(self.scene.structure, self.relations)

    @cached_property
    def root_names(self) -> tuple[str, ...]:
        return root_names(self.relations, self.relation_names)

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        """Names of all unknowns."""
        return tuple(node_name(self.scene.model, node) for node in self.equations.unknowns)

    @cached_property
    def differential(self) -> NDArray[np.bool_]:
        """Mask of the unknowns that are states."""
        return np.arange(len(self.equations.unknowns)) < self.equations.n_states

    @cached_property
    def nominal(self) -> Floats:
        return np.array([self.scene.model.nominal[v] if k == 0 else 1.0 for v, k in self.equations.unknowns])

    @cached_property
    def slot_names(self) -> list[str]:
        """Names of the slots: unknowns, derivatives, inputs, and the residual of each equation, named after its matched unknown."""
        model, program, equations = self.scene.model, self.program, self.equations
        names = [""] * program.n_slots
        for node, slot in program.slots.items():
            names[slot] = names[slot] or node_name(model, node)
        rates = [f"rate of {node_name(model, s)}" for s in equations.unknowns[: equations.n_states]]
        for i, name in enumerate(rates if equations.implicit else []):
            names[len(equations.unknowns) + i] = names[len(equations.unknowns) + i] or name
        whose = [*rates, *(node_name(model, n) for n in equations.algebraic)] if equations.implicit else self.state_names
        for slot, name in zip(program.residuals, whose[-len(program.residuals) :] if program.residuals else (), strict=True):
            names[slot] = f"residual {name}"
        return [name or f"known_{i}" for i, name in enumerate(names)]

    @cached_property
    def native_with_jacobian(self) -> NativeScene:
        """Compiled functions with a Jacobian."""
        return compile_scene(self.program, self.relations, lambda: self.slot_names, self.scene.model, state_plan(self.program))

    def numbers(self, parameters: Floats) -> Prepared:
        """The program with one set of parameters, and that of its relations; the most recent sets are cached."""

        def found() -> Prepared:
            relations = None if self.relations is None else self.relations.program
            return prepare(self.program, self.scene.structure, parameters, relations)

        return recent(self._prepared, parameters.tobytes(), found)

    def data(self, parameters: Floats, inputs: Floats, discrete: Floats, start: Floats) -> Floats:
        """The data block of a run; remaining Newton iterations start from values of variables."""
        return data_block(self.native_with_jacobian, self.numbers(parameters), inputs, discrete, lambda p: guess_of(p, start))

    @cached_property
    def _start_relations(self) -> Relations | None:
        """Relations of the scene and of all its outputs, for the discrete state at the start."""
        scene = self.scene
        if not scene.outputs or self.relations is None or not self.implicit:
            return scene.relations
        return relations_of(scene.structure, build(scene.structure, scene.outputs, scene.states, dynamic=True), scene.wanted)

    def discrete(self, parameters: Floats, t: float, start: Start, inputs: Floats) -> Floats:
        """Relations and discrete variables at the start, shape (n_discrete,)."""
        scene, relations = self.scene, self._start_relations
        if relations is None:
            return np.zeros(scene.n_discrete)
        prepared = prepare(relations.program, scene.structure, parameters)
        guess = guess_of(relations.program, start.guess)
        at, states = np.array([t]), start.states[:, None]
        return discrete_at_start(scene.model, relations, prepared, at, states, inputs[:, None], guess=guess)[:, 0]

    def first(
        self, numbers: Prepared, t: float, start: Start, inputs: Floats, discrete: Floats, slots: Floats | None
    ) -> Floats:
        """The unknowns from which IDA computes consistent initial values.

        Where equations are nonlinear, the algebraic unknowns come from the scene's own program, which determines the solution branch.

        Parameters
        ----------
        numbers : Prepared
            Of the scene.
        t : float
        start : Start
        inputs, discrete : array
        slots : array, optional
            Of the scene's program, where a run continues.
        """
        program = self.scene.program
        guess = np.array([start.guess[v] if k == 0 else 0.0 for v, k in self.equations.algebraic])
        if slots is None and not program.is_linear:
            at = np.array([t])
            found = evaluate(
                numbers, at, start.states[:, None], inputs[: len(program.inputs), None], discrete[:, None],
                guess_of(program, start.guess), forgiving=True,
            )  # fmt: skip
            slots = found[:, 0]
        if slots is not None:
            for i, node in enumerate(self.equations.algebraic):
                if node in program.slots:
                    guess[i] = slots[program.slots[node]]
        return np.concatenate([start.states, guess])

    def slots(self, x: Floats) -> Floats:
        """Slots of the scene's program, as far as they are among the unknowns: the solution branch of the run."""
        program = self.scene.program
        result = np.zeros(program.n_slots)
        for node, value in zip(self.equations.unknowns, x, strict=True):
            if node in program.slots:
                result[program.slots[node]] = value
        return result

    def histories(self, x: Floats) -> dict[Node, Floats]:
        """The algebraic unknowns of an index-reduced form over time, shape (samples,) each."""
        if not self.implicit:
            return {}
        first = self.equations.n_states
        return {node: x[:, first + i].copy() for i, node in enumerate(self.equations.algebraic)}


def scene_form(scene: Scene, kind: str) -> SceneForm:
    """The torn form of a scene, or its index-reduced equations."""
    if kind not in scene.forms:
        if kind == "torn":
            equations = torn_form(scene.structure, scene.program, scene.relations, scene.wanted)
        else:
            equations = index_reduced_form(scene.structure, scene.states, scene.outputs, scene.wanted, bool(scene.n_discrete))
        scene.forms[kind] = SceneForm(scene, equations)
    found: SceneForm = scene.forms[kind]
    return found
