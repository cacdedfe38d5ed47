"""`ExportedModel`: the part of a compiled model that an FMU contains, and refusal of what it cannot contain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, name_list, real, shown
from gearlib.errors import ArgumentError, GearlibWarning, ModelError, NameLookupError, nearest, warn
from gearlib.flatten.model import FlatModel
from gearlib.language.expressions import JustBefore
from gearlib.program.build import build
from gearlib.program.derivative_plan import DerivativePlan, derivative_plan
from gearlib.program.program import Batch, Linear, Newton, Program
from gearlib.program.relations import Relations, jumps_below, relations_of
from gearlib.reduce.coefficients import some
from gearlib.reduce.reduction import confirm
from gearlib.run.refusals.jumps import refuse_jumps
from gearlib.run.refusals.limits import bounded_variables, warn_of_unchecked
from gearlib.run.sampling.controllers import refuse_controllers
from gearlib.run.scene import Scene, node_name
from gearlib.run.simulate import warn_of_zero_inputs
from gearlib.run.start_values import StartConstraints, fixed_values, start_values
from gearlib.run.time_switches import Timed, time_switches
from gearlib.run.translation import Translation, asked_scene
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
PERTURBED = 1.0 + 2.0**-6  # factor on a parameter to test whether a redundant loop still closes
MOST_DENSE = 1500  # unknowns of a linear block whose matrix an FMU can factorise


@dataclass(frozen=True)
class Output:
    """An output of an FMU.

    Attributes
    ----------
    name : str
    variable : int
        Number in the model, -1 for a discrete variable.
    order : int
        Derivative order.
    slot : int
        Index among the values of the observed program; -1 for a discrete variable, or one that is identically zero.
    discrete : int
        Index in the discrete state; -1 for a continuous variable.
    sign : int
    """

    name: str
    variable: int
    order: int
    slot: int
    discrete: int
    sign: int


@dataclass(frozen=True, eq=False)
class ExportedModel:
    """A scene with the inputs and outputs of an FMU.

    Attributes
    ----------
    translation : Translation
    numbers : array
        Values of all parameters unless the importing tool sets others.
    scene : Scene
        Its states are the FMU's.
    inputs : tuple of int
        Those that the importing tool provides, by number among the model's; the others are parameters.
    input_starts : array
        A value for each of the model's inputs.
    names : tuple of str
        Names of the outputs.
    """

    translation: Translation
    numbers: Floats
    scene: Scene
    inputs: tuple[int, ...]
    input_starts: Floats
    names: tuple[str, ...]

    @property
    def model(self) -> FlatModel:
        return self.scene.model

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """The nodes computed for the outputs, which are neither discrete nor identically zero, and those that have a minimum."""
        found = [self._node(name) for name in self.names if name not in self.model.discretes]
        return tuple(dict.fromkeys([*(node for node, sign in found if sign), *(node for _, _, node in self.bounded)]))

    @cached_property
    def bounded(self) -> tuple[tuple[int, float, Node], ...]:
        """Variables with a declared minimum, which the FMU checks at the start and after each step."""
        return tuple(bounded_variables(self.scene))

    def _node(self, name: str) -> tuple[Node, int]:
        return self.scene.structure.named(name, "output", ("cannot be an output", "can"))

    @cached_property
    def observed(self) -> Program:
        """Computes the derivatives of the states, followed by the variables that the outputs need."""
        rates = [(v, k + 1) for v, k in self.scene.states]
        return build(self.scene.structure, [*rates, *self.nodes], self.scene.states, dynamic=False)

    @cached_property
    def outputs(self) -> tuple[Output, ...]:
        """The outputs that are neither states nor named derivatives of states, in the requested order."""
        known, model, found = list(self.observed.outputs), self.model, []
        own = {node_name(model, (v, order)) for v, k in self.scene.states for order in (k, k + 1)}
        for name in self.names:
            if name in own:
                continue
            if name in model.discretes:
                found.append(Output(name, -1, 0, -1, model.n_relations + model.discretes.index(name), 1))
                continue
            node, sign = self._node(name)
            base, order = model.column(name)
            found.append(Output(name, model.variable(base), order, known.index(node) if sign else -1, -1, sign))
        return tuple(found)

    @cached_property
    def all_relations(self) -> Relations | None:
        """Update rules of the discrete state, for the states and the outputs."""
        if not self.scene.n_discrete:
            return None
        found = relations_of(self.scene.structure, self.observed, self.scene.wanted)
        return found if len(found.used) or found.discretes or found.reinits else None

    @cached_property
    def timed(self) -> tuple[Timed, ...]:
        """Time conditions whose switching times are given by a formula in the parameters."""
        return tuple(t for t in time_switches(self.all_relations).timed if t.terms is not None or t.wave is not None)

    @cached_property
    def relations(self) -> Relations | None:
        """The same relations; time conditions without such a formula are located by root search."""
        found = self.all_relations
        if found is None:
            return None
        by_formula = {int(k) for t in self.timed for k in t.numbers}
        return replace(found, on_time=np.array([int(k) in by_formula for k in found.used], bool))

    @cached_property
    def plan(self) -> DerivativePlan:
        """Derivatives of the rates and outputs with respect to states and inputs."""
        n = len(self.scene.states)
        entering = [(i, i) for i in range(n)] + [(n + k, n + j) for j, k in enumerate(self.inputs)]
        return derivative_plan(self.observed, entering, self.observed.output_slots, n + len(self.inputs))

    # ------------------------------------------------------------ parameters

    @cached_property
    def parameters(self) -> tuple[int, ...]:
        """Parameters that are variables of the FMU: those that a user knows by name."""
        return self.model.parameters.own

    @cached_property
    def dependent(self) -> frozenset[int]:
        """Parameters computed from others."""
        return frozenset(int(t) for d in self.model.parameters.dependents for t in d.targets)

    @cached_property
    def constants(self) -> dict[int, str]:
        """Parameters that are constant in the FMU, with the reasons."""
        decided = frozenset(p for p, _ in self.translation.decided_by)
        found = dict.fromkeys(self._leading_to(decided), "its value is part of the equations")
        if self.computed_starts is not None:
            for p in self._leading_to(self.computed_starts):
                found.setdefault(p, "start values are computed from it")
        for p in self._closing():
            found.setdefault(p, "a rigid loop closes with it")
        return found

    @cached_property
    def fixed(self) -> frozenset[int]:
        """Parameters that cannot change during a run: instants that repeat (`gl.sample`) would be counted from another one."""
        batches = () if self.all_relations is None else self.all_relations.discretes
        given = [b.parameters.ravel().tolist() for b in batches if b.kernel.template.residual.has(JustBefore)]
        return frozenset(self._leading_to(frozenset().union(*given)))

    def _leading_to(self, slots: frozenset[int]) -> set[int]:
        """The parameters from which some entries of the table are computed, including these."""
        reached = set(slots)
        for d in reversed(self.model.parameters.dependents):
            for target, arguments in zip(d.targets.tolist(), d.arguments.tolist(), strict=True):
                if target in reached:
                    reached.update(arguments)
        return reached

    @property
    def given(self) -> dict[int, float]:
        """Independent parameters, with their values."""
        return {p: float(self.numbers[p]) for p in range(len(self.numbers)) if p not in self.dependent}

    def _closing(self) -> list[int]:
        """Parameters that cannot change on their own, since a redundant loop would no longer close."""
        structure, table = self.scene.structure, self.model.parameters
        if not structure.redundant:
            return []
        found = []
        for p in self.parameters:
            if p in self.dependent:
                continue
            value = float(self.numbers[p])
            numbers = table.evaluate(self.given | {p: value * PERTURBED if value else PERTURBED - 1.0})
            try:
                confirm(structure, numbers)
            except ModelError:
                found.append(p)
        return found

    @cached_property
    def start_constraints(self) -> StartConstraints | None:
        """Equations that start values are computed from, where these are not those of the states themselves; else None."""
        scene = self.scene
        if scene.unfixed is not None:
            return None
        structure = scene.structure
        place = set(structure.states)
        fixed = fixed_values(scene.model, self.numbers, {})
        return StartConstraints.of(structure, [(v, 0) for v in fixed if (v, 0) not in place and (v, 0) in structure.solved_by])

    @cached_property
    def computed_starts(self) -> frozenset[int] | None:
        """Parameters that computed start values depend on; None where there are none."""
        found = self.start_constraints
        if found is None:
            return None
        used = [used_parameters(p) for p in found.programs] + [set(b.parameters.ravel().tolist()) for b in found.rules]
        return frozenset().union(self.model.start_slots.tolist(), *used)

    @cached_property
    def own_starts(self) -> tuple[bool, ...]:
        """For each state, whether its start value may be set rather than computed from parameters."""
        model = self.model
        if self.computed_starts is not None:
            return (True,) * len(self.scene.states)
        slots = dict(zip(model.guessed[0].tolist(), model.guessed[2].tolist(), strict=True))
        return tuple(bool(k) or slots.get(v, -1) not in self.dependent for v, k in self.scene.states)

    @property
    def driven(self) -> bool:
        """Whether time drives the model."""
        programs = [self.observed, *([self.relations.program] if self.relations is not None else [])]
        return any(p.on_time for p in programs)

    @cached_property
    def start(self) -> Floats:
        """The states at the start for the default parameters."""
        return start_values(self.scene, self.numbers, self.input_starts, 0.0, {}).states


def following_events(program: Program) -> NDArray[np.bool_]:
    """Which slots follow from the discrete state: an event may change them at once, by whatever its condition depends on."""
    follows = np.zeros(program.n_slots, bool)

    def rows(batch: Batch) -> NDArray[np.bool_]:
        known = follows[batch.arguments] & (batch.argument_signs != 0)
        return np.asarray(known.any(axis=1) | (batch.relations.shape[1] > 0))

    for step in program.steps:
        match step:
            case Batch():
                follows[step.targets] |= rows(step)
            case Linear():
                follows[step.unknowns] = follows[step.known].any()
            case Newton():
                follows[step.unknowns] = any(rows(batch).any() for batch in (*step.residuals, *step.jacobian))
    return follows


def used_parameters(program: Program) -> set[int]:
    """Entries of the parameter table that a program reads."""
    found: set[int] = set()
    for step in program.steps:
        match step:
            case Batch():
                parts: Sequence[Batch] = [step]
            case Linear():
                parts = step.matrix
            case Newton():
                parts = [*step.residuals, *step.jacobian]
        for batch in parts:
            found.update(batch.parameters.ravel().tolist())
    return found


def exported_model(
    translation: Translation, parameters: Any, inputs: Any, outputs: Any, stop_time: float = 1.0
) -> ExportedModel:
    """Determine what goes into an FMU.

    Parameters
    ----------
    translation : Translation
    parameters : None or mapping of str to float
        Default values in the FMU.
    inputs : None, sequence of str, or mapping of str to float
        Unbound inputs that the importing tool provides, or their start values; by default all.
    outputs : None or sequence of str
        By default those that the model was compiled for, or its states.
    stop_time : float
        s; jumps before it are refused as in a run.

    Raises
    ------
    ArgumentError, NameLookupError
        The message names what cannot be exported.
    """
    refuse_controllers(translation.component, "an FMU")
    translation, values = translation.fitted(parameters)
    structure = translation.structure
    if outputs is None:
        scene = translation.scene
        names = translation.outputs if translation.outputs is not None else scene.state_names
    else:
        names = tuple(name_list("outputs", outputs, "load.w"))
        scene = asked_scene(structure, names)
    chosen, starts = _inputs(translation, inputs)
    left = tuple(name for k, name in enumerate(translation.inputs) if k not in chosen)
    warn_of_zero_inputs(translation, left, "the FMU", "export_fmu")
    given = [n for n in names if n in translation.inputs]
    if given:
        raise ArgumentError(f"{given[0]} is an input of the FMU, so it cannot be an output; leave it out of outputs")
    found = ExportedModel(translation, values, scene, chosen, starts, tuple(dict.fromkeys(names)))
    for name in parameters or ():
        if translation.model.parameters.index[name] in found.dependent:
            raise ArgumentError(f"{name} follows from other parameters, and does so in the FMU: give those, not {name}")
    _refuse(found, stop_time)
    return found


def _inputs(translation: Translation, inputs: Any) -> tuple[tuple[int, ...], Floats]:
    """Numbers of the FMU's inputs, and the start values of all inputs of the model."""
    known = translation.inputs
    starts = np.zeros(len(known))
    if inputs is None:
        return tuple(range(len(known))), starts
    if isinstance(inputs, Mapping):
        inputs = by_name("inputs", inputs, "a mapping of inputs to numbers", "torque.tau")
    names = list(inputs) if isinstance(inputs, Mapping) else name_list("inputs", inputs, "torque.tau")
    for name in names:
        if name not in known:
            bound = isinstance(name, str) and translation.model.find(name) is not None
            hint = "it is bound in the model, or no input" if bound else nearest(str(name), known)
            raise NameLookupError(f"the model has no unbound input '{name}'; {hint}")
        if isinstance(inputs, Mapping):
            value = inputs[name]
            if callable(value):
                raise ArgumentError(
                    f"the input {name} is {shown(value)}: an FMU holds no Python and no table. Leave it to the tool that imports the "
                    f"FMU (inputs=[{name!r}]), or bind it in the model to an expression of gl.time or to a gl.Table of gl.time"
                )
            starts[known.index(name)] = real(f"input {name}", value)
    return tuple(known.index(name) for name in names), starts


def _refuse(found: ExportedModel, stop_time: float) -> None:
    """Raise an error for anything that an FMU cannot contain."""
    scene, name = found.scene, found.translation.name
    warn_of_unchecked(scene.structure)
    for step in (*scene.program.steps, *found.observed.steps):
        if isinstance(step, Linear) and len(step.unknowns) > MOST_DENSE:
            raise ArgumentError(
                f"{name}: {len(step.unknowns)} equations are solved together, and an FMU factorises {MOST_DENSE} at most; make some "
                "of the rigid connections elastic"
            )
    if scene.structure.switching:
        refuse_jumps(scene.structure, found.observed, found.numbers, 0.0, stop_time)
    if jumps := jumps_below(scene.structure, found.observed, found.numbers):
        model = scene.model
        owners = dict.fromkeys(model.owner(*model.places[jump.equation]) for jump in jumps)
        warn(
            f"{name}: {some(list(owners), ', ')}: an equation that has to be differentiated may jump or have a corner, where the bodies "
            "that it couples need an impulse. gearlib refuses runs that reach that point; an FMU goes on without the impulse",
            GearlibWarning,
        )
