"""`Scene`: a reduced model with the states that a run integrates; programs and native code are made on first use."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import is_
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.template import memoised
from gearlib.errors import SingularError
from gearlib.flatten.model import FlatModel
from gearlib.language.expressions import JustBefore
from gearlib.native.layout import Layout, Shared, fill, lay_out
from gearlib.program.build import build
from gearlib.program.derivative_plan import DerivativePlan, state_plan
from gearlib.program.event_iteration import MOST_ITERATIONS, DiscretesPhase, RelationsPhase, UnknownsPhase, right_hand
from gearlib.program.interpret import Prepared, batch_values, evaluate, labelled, prepare
from gearlib.program.program import Newton, Program
from gearlib.program.relations import Relations, relations_of
from gearlib.recent import recent
from gearlib.reduce.reduction import Structure
from gearlib.run.time_switches import FastestDrive, TimeSwitches, driven, fastest_drive, time_switches
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import reach

if TYPE_CHECKING:
    from gearlib.native.evaluator import CompiledProgram, Evaluator
    from gearlib.native.scene_functions import NativeScene
    from gearlib.native.series_source import TaylorSeries

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
MOST_FILLED = 20_000  # numbers of the largest data block that is cached for the next run


def node_name(model: FlatModel, node: Node) -> str:
    """Path of a variable, or ``"der(path)"`` for its derivative."""
    return "der(" * node[1] + model.name(node[0]) + ")" * node[1]


@dataclass(frozen=True, eq=False)
class Scene:
    """Integrated states and requested outputs, with programs and native code.

    Attributes
    ----------
    structure : Structure
    states : tuple of nodes
        In integration order.
    wanted : tuple of int
        Discrete variables that are outputs.
    outputs : tuple of nodes
        Outputs that are not states; one program computes them together.
    """

    structure: Structure
    states: tuple[Node, ...]
    wanted: tuple[int, ...] = ()
    outputs: tuple[Node, ...] = ()
    _named: dict[str, tuple[Node, int]] = field(default_factory=dict)
    _computing: dict[Node, Program] = field(default_factory=dict)
    _missing: dict[Node, tuple[Node, ...]] = field(default_factory=dict)
    _prepared: dict[bytes, Prepared] = field(default_factory=dict)
    _compiled: dict[tuple[Program, DerivativePlan | None], CompiledProgram] = field(default_factory=dict)
    constraints: dict[tuple[Node, ...], Any] = field(default_factory=dict)  # on start values, made by `start_values`
    started: dict[tuple[Any, ...], Any] = field(default_factory=dict)  # the last start values that equations were solved for
    forms: dict[str, Any] = field(default_factory=dict)  # made by `scene_form`, `linear_form` and for lanes
    tangent_codes: dict[Any, Any] = field(default_factory=dict)  # made by `gearlib.run.tangents.tangents`

    @cached_property
    def model(self) -> FlatModel:
        return self.structure.model

    @cached_property
    def program(self) -> Program:
        """Computes the derivatives of the states."""
        return build(self.structure, self.rates, self.states, dynamic=True)

    @property
    def rates(self) -> list[Node]:
        """The derivatives of the states."""
        return [(v, k + 1) for v, k in self.states]

    @cached_property
    def jacobian(self) -> DerivativePlan:
        """Derivative plan of the rates with respect to the states."""
        return state_plan(self.program)

    @cached_property
    def place_of(self) -> dict[Node, int]:
        """Index of each state."""
        return {node: i for i, node in enumerate(self.states)}

    def named(self, name: str) -> tuple[Node, int]:
        """The node that a name stands for, and its sign (0: identically zero).

        Raises
        ------
        NameLookupError
            The model has no such variable, or its equations do not contain it.
        """
        if name not in self._named:
            self._named[name] = self.structure.named(name, "variable", ("is not computed", "is"))
        return self._named[name]

    def missing(self, node: Node) -> tuple[Node, ...]:
        """Additional states that must be integrated to compute a variable."""
        if node not in self._missing:
            self._missing[node] = tuple(s for s in needed_states(self.structure, [node]) if s not in self.place_of)
        return self._missing[node]

    def computing(self, node: Node) -> Program:
        """Program that computes a variable from the states; cached."""
        if node not in self._computing:
            together = self.outputs if node in self.outputs else (node,)
            program = build(self.structure, together, self.states, dynamic=False)
            self._computing.update(dict.fromkeys(together, program))
        return self._computing[node]

    def compute_together(self, nodes: Iterable[Node]) -> None:
        """Compute some variables by one program, as soon as one of them is requested."""
        new = [n for n in dict.fromkeys(nodes) if n not in self._computing and n not in self.outputs and n not in self.place_of]
        if new:
            self._computing.update(dict.fromkeys(new, build(self.structure, new, self.states, dynamic=False)))

    @cached_property
    def iterating(self) -> Program | None:
        """Program of the variables that nonlinear equations determine, if it solves some of these by iteration."""
        structure, model = self.structure, self.model
        nonlinear = {g for g, group in enumerate(model.groups) if not group.template.linear}
        determined = [n for n in structure.solved_by if n[1] == 0 and model.places[structure.equation(n)[0]][0] in nonlinear]
        nodes = [n for n in determined if structure.computes(n)]
        if not set(needed_states(structure, nodes)) <= set(self.states):
            nodes = [n for n in nodes if set(needed_states(structure, [n])) <= set(self.states)]
        program = build(structure, nodes, self.states, dynamic=False) if nodes else None
        return program if program is not None and program.iterated else None

    @cached_property
    def n_discrete(self) -> int:
        return self.model.n_discrete

    @cached_property
    def feeding(self) -> Integers | None:
        """Indices of the integrated states on which the others depend; None if all states are integrated."""
        targets = [(v, k + 1) for v, k in self.structure.states if (v, k) not in self.place_of]
        if not targets:
            return None
        _, needed = reach(self.structure, targets, dynamic=False, events=True)
        return np.array(sorted(self.place_of[s] for s in needed if s in self.place_of), np.int64)

    @cached_property
    def relations(self) -> Relations | None:
        """Update rules of the discrete state, if there is one."""
        if not self.n_discrete:
            return None
        found = relations_of(self.structure, self.program, self.wanted)
        return found if len(found.used) or found.discretes or found.reinits else None

    @cached_property
    def searched(self) -> bool:
        """Whether there are events located by root search: relations that do not depend on time only."""
        return self.relations is not None and not self.relations.on_time.all()

    @cached_property
    def on_time(self) -> bool:
        """Whether the equations or relations depend on time explicitly, other than conditions on time alone."""
        return any(True for _ in driven(self.program, self.relations))

    @cached_property
    def time_switches(self) -> TimeSwitches:
        """Switching times of conditions on time."""
        return time_switches(self.relations)

    @cached_property
    def fastest_drive(self) -> FastestDrive:
        """The fastest explicit function of time in the equations."""
        return fastest_drive(self.program, self.relations)

    @cached_property
    def slot_names(self) -> list[str]:
        names = [""] * self.program.n_slots
        for node, slot in self.program.slots.items():
            names[slot] = names[slot] or node_name(self.model, node)  # copies share a slot
        return [name or f"known_{i}" for i, name in enumerate(names)]

    @cached_property
    def shared(self) -> Shared:
        """Common head of the data of native code."""
        return Shared(len(self.model.parameters.names), self.n_discrete, len(self.program.inputs))

    @cached_property
    def layout(self) -> Layout:
        """Memory layout of the derivatives in native code without tangents."""
        return lay_out(self.program, self.shared, self.shared.size, keep=True)

    @cached_property
    def source(self) -> str:
        """The generated source of the derivatives."""
        from gearlib.native.scene_functions import rhs_source

        return rhs_source(self.program, self.layout, lambda: self.slot_names, self.model.parameters.names)[0]

    @cached_property
    def series(self) -> TaylorSeries | str:
        """The compiled function for the Taylor coefficients of the states, or the reason why there is none."""
        from gearlib.native.series_source import taylor_series

        return taylor_series(self.program, self.layout)

    @cached_property
    def native(self) -> NativeScene:
        """Compiled functions without a Jacobian."""
        return self.compiled(False)

    @cached_property
    def native_with_jacobian(self) -> NativeScene:
        """Compiled functions with a Jacobian."""
        return self.compiled(True)

    def compiled(
        self, jacobian: bool, tangents: DerivativePlan | None = None, changed: Sequence[tuple[int, int]] | None = None
    ) -> NativeScene:
        """Compiled functions with or without a Jacobian, and with a right-hand side extended by the tangents of a plan.

        ``changed``: as for `compile_scene`.
        """
        from gearlib.native.scene_functions import compile_scene

        return compile_scene(self.program, self.relations, lambda: self.slot_names, self.model,
                             self.jacobian if jacobian else None, tangents, changed)  # fmt: skip

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        return tuple(node_name(self.model, s) for s in self.states)

    @cached_property
    def root_names(self) -> tuple[str, ...]:
        """Component and equation of each root function."""
        return root_names(self.relations, self.relation_names)

    @cached_property
    def relation_names(self) -> dict[int, str]:
        """Component and equation of each relation in use."""
        return relation_names(self.structure, self.relations)

    @cached_property
    def nominal(self) -> Floats:
        return np.array([self.model.nominal[v] if k == 0 else 1.0 for v, k in self.states])

    @cached_property
    def everything(self) -> tuple[Integers, Integers]:
        """Variable and derivative order of every state of the structure."""
        table = np.array(self.structure.states, np.int64).reshape(-1, 2)
        return table[:, 0], table[:, 1]

    @cached_property
    def places(self) -> Integers:
        """Indices of the scene's states among those of the structure."""
        place = {node: i for i, node in enumerate(self.structure.states)}
        return np.array([place[s] for s in self.states], np.int64)

    @cached_property
    def starting(self) -> tuple[Integers, Integers]:
        """Variable of each of the scene's states, and which states are derivatives."""
        table = np.array(self.states, np.int64).reshape(-1, 2)
        return table[:, 0].copy(), np.flatnonzero(table[:, 1])

    @cached_property
    def unfixed(self) -> tuple[str, ...] | None:
        """States that no start value fixes; None where fixed variables are not states, so that equations must be solved."""
        fixed = set(self.model.fixed[0].tolist())
        if any((v, 0) in self.structure.solved_by for v in fixed - {v for v, k in self.structure.states if k == 0}):
            return None
        return tuple(name for name, (v, k) in zip(self.state_names, self.states, strict=True) if k or v not in fixed)

    def numbers(self, parameters: Floats) -> Prepared:
        """The program with one set of parameters, and that of its relations."""
        return prepare(self.program, self.structure, parameters, None if self.relations is None else self.relations.program)

    def _evaluator(self, prepared: Prepared, plan: DerivativePlan | None = None) -> Evaluator:
        """Compiled evaluation of a program, and of the derivatives in a plan, at many points; the machine code is cached."""
        key = prepared.program, plan
        if key not in self._compiled:
            from gearlib.native.evaluator import CompiledProgram

            self._compiled[key] = CompiledProgram(prepared.program, len(self.model.parameters.names), self.n_discrete, plan)
        return self._compiled[key].evaluator(prepared)

    def compiled_program(self, prepared: Prepared) -> Prepared:
        """A prepared program, evaluated by compiled code: pays for many points, one after another."""
        return replace(prepared, compiled=self._evaluator(prepared).slots)

    def compiled_numbers(self, parameters: Floats) -> tuple[Prepared, Evaluator]:
        """`numbers` with programs that run as compiled code, and an evaluator that also computes derivatives."""
        numbers = self.numbers(parameters)
        evaluator, relations = self._evaluator(numbers, self.jacobian), numbers.relations
        if relations is not None:
            relations = self.compiled_program(relations)
        return replace(numbers, compiled=evaluator.slots, relations=relations), evaluator

    def prepared(self, parameters: Floats) -> Prepared:
        """`numbers`, cached for the most recent parameters."""
        return recent(self._prepared, parameters.tobytes(), lambda: self.numbers(parameters))

    def can_be_prepared(self, parameters: Floats) -> bool:
        """Whether all blocks with constant coefficients are regular."""
        try:
            self.prepared(parameters)
        except SingularError:
            return False
        return True

    def discrete(
        self, numbers: Prepared, t: Floats, states: Floats, inputs: Floats, discretes: Floats | None = None,
        start: Floats | None = None, before: Floats | None = None,
    ) -> Floats:  # fmt: skip
        """Relations and discrete variables at some times, each time independently, shape (n_discrete, times).

        Discrete variables are those of a run started at that time, from the given values or the model's; or of one that goes on there
        from the discrete state ``before``. ``start``: values of variables at which iterations start.
        """
        if self.relations is None or numbers.relations is None:
            return np.zeros((self.n_discrete, len(t)))
        guess = None if start is None else guess_of(self.relations.program, start)
        return discrete_at_start(
            self.model, self.relations, numbers.relations, t, states, inputs, discretes, guess, before=before
        )

    def going_on(self, discrete: Floats | None, was: tuple[float, Floats], now: tuple[float, Floats]) -> Floats | None:
        """The discrete state of a run that goes on: where time or parameters changed, `gl.sample` is on its side of the new instants.

        An instant at which it goes on counts, unless the run before had one there. ``was``, ``now``: times (s) and parameters.
        """
        if discrete is None or self.relations is None or (was[0] == now[0] and np.array_equal(was[1], now[1])):
            return discrete
        n, names, slots, found = (
            self.model.n_relations, self.model.discretes, np.zeros((self.relations.program.n_slots, 1)), discrete.copy(),
        )  # fmt: skip
        started = np.append(discrete[:-1], 1.0)[:, None]  # the flag of the start of a run
        for batch in self.relations.discretes:
            if not batch.kernel.template.residual.has(JustBefore):
                continue
            sides = [  # before and after either time
                batch_values(batch, np.array([at]), slots, parameters, started)[:, 0]
                for t, parameters in (was, now)
                for at in (t, t + 3e-12 * max(abs(t), 1e-3))
            ]
            had = (was[0] == now[0]) & (sides[0] != sides[1])
            for before, side in zip(batch.targets.tolist(), np.where(had, sides[3], sides[2]).tolist(), strict=True):
                own = n + names.index(names[before - n].removesuffix("_before"))
                found[[before, before + len(names), own, own + len(names)]] = side
        return found

    def discrete_of(
        self, prepared: Prepared, t: Floats, states: Floats, inputs: Floats, start: Floats, before: Floats | None = None
    ) -> Floats:
        """`discrete` of the relations on which a program of these states depends, also where their derivatives do not.

        ``before``: the discrete state from which they go on, as at an event of a run; else they are those of its start.
        """
        if not self.n_discrete:
            return np.zeros((0, len(t)))
        relations = _relations_of(prepared.program, self.structure)
        numbers = prepare(relations.program, self.structure, prepared.parameters)
        return discrete_at_start(
            self.model, relations, numbers, t, states, inputs, None, guess_of(relations.program, start), before=before
        )

    def data(
        self, native: NativeScene, numbers: Prepared, inputs: Floats, discrete: Floats, start: Floats,
        slots: Floats | None = None,
    ) -> Floats:  # fmt: skip
        """The data block of a run; iterations start at values of variables, or at slots of the main program where it continues."""
        guess = guess_of(self.program, start) if slots is None else slots

        def guesses(program: Program) -> Floats:
            if program is self.program:
                return guess
            others = guess_of(program, start)
            for node in self.program.slots.keys() & program.slots.keys() if slots is not None and program.iterated else ():
                others[program.slots[node]] = guess[self.program.slots[node]]
            return others

        return data_block(native, numbers, inputs, discrete, guesses)


@memoised
def _relations_of(program: Program, structure: Structure) -> Relations:
    return relations_of(structure, program)


def guess_of(program: Program, start: Floats) -> Floats:
    """Initial guess of Newton's iterations: the start values of variables, zero for their derivatives."""
    result = np.zeros(program.n_slots)
    variables, slots = program.undifferentiated
    result[slots] = start[variables]
    return result


def data_block(
    native: NativeScene, numbers: Prepared, inputs: Floats, discrete: Floats, guess: Callable[[Program], Floats]
) -> Floats:  # fmt: skip
    """The data block of native functions; ``guess`` returns the slots at which a program's iterations start."""
    shared, relations = native.shared, numbers.relations
    solutions = numbers.solutions if relations is None else numbers.solutions + relations.solutions
    known = native.filled[0] if native.filled else None
    if known is not None and len(known[0]) == len(solutions) and all(map(is_, known[0], solutions)):
        data: Floats = known[1].copy()
    else:
        data = np.zeros(native.size)
        for part, own in native.parts(numbers, relations):
            fill(data, part.layout, part.body.coefficients, own)
        if native.size <= MOST_FILLED and not any(part.body.coefficients for part, _ in native.parts(numbers, relations)):
            native.filled[:] = [(solutions, data.copy())]
    data[: shared.n_parameters] = numbers.parameters
    if shared.n_discrete:
        data[shared.relations : shared.relations + shared.n_discrete] = discrete
    if shared.n_inputs:
        data[shared.inputs : shared.inputs + shared.n_inputs] = inputs
    guesses: dict[Program, Floats] = {}
    for part, own in native.parts(numbers, relations):
        if own.program not in guesses:
            guesses[own.program] = guess(own.program)
        slots = guesses[own.program]
        data[part.layout.slots : part.layout.slots + len(slots)] = slots
    return data


def relation_names(structure: Structure, relations: Relations | None) -> dict[int, str]:
    """Component and equation of each relation."""
    owner: dict[int, str] = {}
    for batch in () if relations is None else relations.batches:
        for i, number in enumerate(batch.targets.tolist()):
            owner[number] = labelled(structure, batch, i)
    return owner


def root_names(relations: Relations | None, names: Mapping[int, str]) -> tuple[str, ...]:
    """Names of the root functions, from those of all relations."""
    return () if relations is None else tuple(names[int(n)] for n in relations.searched)


def discrete_at_start(
    model: FlatModel, relations: Relations, prepared: Prepared, t: Floats, states: Floats, inputs: Floats,
    discretes: Floats | None = None, guess: Floats | None = None, steps: list[Floats] | None = None,
    before: Floats | None = None,
) -> Floats:  # fmt: skip
    """Relations and discrete variables of a run that starts at a time, or goes on from those ``before``, shape (n_discrete, times).

    ``steps`` collects them after each outer iteration, together with the values before it.
    """
    n, d = model.n_relations, len(model.discretes)
    discrete = np.repeat((model.initial_discrete(discretes) if before is None else before)[:, None], len(t), axis=1)
    last = False
    for _ in range(MOST_ITERATIONS):
        for _ in range(MOST_ITERATIONS):
            # only the final discrete state must admit a solution: on the way, a moving friction element may be tried as stuck
            new = settle_once(relations, prepared, t, states, inputs, discrete, guess, forgiving=True, last=last)
            settled, discrete = bool((new == discrete).all()), new
            if settled:
                break
        previous = discrete[n + d : n + 2 * d].copy()
        if steps is not None:
            steps.append(discrete.copy())
        discrete[n + d : n + 2 * d] = discrete[n : n + d]
        if d:
            discrete[n + 2 * d] = 0.0
        still = bool((previous == discrete[n + d : n + 2 * d]).all())
        if not settled or (still and (last or not relations.event_iteration.has_last)):
            break  # the run's own event iteration may settle the rest, or name it
        last = still
    if any(isinstance(step, Newton) for step in prepared.program.steps):
        settle_once(relations, prepared, t, states, inputs, discrete, guess)
    return discrete


def settle_once(
    relations: Relations, prepared: Prepared, t: Floats, states: Floats, inputs: Floats, discrete: Floats,
    guess: Floats | None = None, forgiving: bool = False, last: bool = True,
) -> Floats:  # fmt: skip
    """One pass of the event iteration, with or without the relations that are decided last."""
    new = discrete.copy()
    slots = np.zeros((prepared.program.n_slots, len(t)))
    for phase in relations.event_iteration.passed:
        match phase:
            case UnknownsPhase():
                slots = evaluate(prepared, t, states, inputs, new, guess, forgiving)
            case DiscretesPhase(batch):
                new[batch.targets] = batch_values(batch, t, slots, prepared.parameters, new)
            case RelationsPhase(batch, on_time, _) if last or not phase.last:
                values = batch_values(batch, right_hand(t) if on_time else t, slots, prepared.parameters, new)
                new[batch.targets] = phase.hold(values)
    return new


def needed_states(structure: Structure, targets: Iterable[Node]) -> tuple[Node, ...]:
    """The states that must be integrated to compute some variables."""
    _, states = reach(structure, targets, dynamic=True, events=True)
    return tuple(sorted(states))


def needed_discretes(structure: Structure, targets: Iterable[Node]) -> tuple[int, ...]:
    """The discrete variables that some variables depend on at the same instant, transitively."""
    model = structure.model
    known = len(model.discretes)
    unknowns, _ = reach(structure, targets, dynamic=False, events=True)
    found: set[int] = set()
    waiting: list[int] = []
    for node in unknowns:
        g, i = structure.model.places[structure.equation(node)[0]]
        waiting += model.groups[g].discretes[i].tolist()
    while waiting:
        place = waiting.pop()
        if place >= 2 * known or place % known in found:  # the last entry is the flag of the start of a run
            continue
        found.add(place % known)
        for group, i in model.assignments[place % known]:
            waiting += group.discretes[i].tolist()
    return tuple(sorted(found))


def needed_inputs(structure: Structure, targets: Iterable[Node]) -> tuple[str, ...]:
    """The unbound inputs that some variables depend on, through their states and through events."""
    model = structure.model
    targets = list(targets)
    unknowns, _ = reach(structure, targets, dynamic=True, events=True)
    met = {v for v, _ in targets}
    for node in unknowns:
        e, k = structure.equation(node)
        met |= {v for v, _ in (*structure.columns(e, k), *structure.at_events.get(e, ()))}
    for update in model.updates:  # conservatively, the targets are taken to depend on all of them
        met |= set(update.equations.variables.ravel().tolist())
    return tuple(model.name(v) for v in model.inputs.tolist() if v in met)
