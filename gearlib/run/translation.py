"""`Translation`: a compiled model; `translate` makes one from a component, and runs and analyses work on it."""

from __future__ import annotations

import gc
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, real, shown
from gearlib.errors import ArgumentError, LoopError, ModelError, NameLookupError, SingularError, StartError, nearest
from gearlib.flatten.flatten import check_bounds, flatten
from gearlib.flatten.model import FlatModel
from gearlib.flatten.specialise import Special
from gearlib.language.component import Component
from gearlib.language.recipes import packed
from gearlib.recent import recent
from gearlib.reduce.coefficients import some
from gearlib.reduce.reduction import Structure, analyse, confirm, discrete_nodes
from gearlib.run.sampling.controllers import check_instants, controllers_of, read_by_controllers, refuse_programs
from gearlib.run.scene import Scene, needed_discretes, needed_inputs, needed_states
from gearlib.run.start_values import Seed, Start, start_values, start_variable
from gearlib.run.zeros import Sums, can_be_solved, factors, nothing_special, special_values, sums
from gearlib.solvers.inputs.table import FunctionInput, Table, as_table, values
from gearlib.structure.incidence import Node

if TYPE_CHECKING:
    from gearlib.flatten.energies import Audited
    from gearlib.reduce.combinations import CancellingSum
    from gearlib.run.sampling.controllers import Controller
    from gearlib.run.sampling.delays import Delay

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
States = tuple[Node, ...]
Rounds = tuple[tuple["CancellingSum", ...], ...]
NONE = np.empty(0, np.int64)
FLATTENED = 0.4  # share of flattening in the translation time of a large model
MOST_ROUNDS = 10  # rounds in which sums replace equations; each raises the index
MOST_COMBINED = 8  # cached translations with such sums


def translate(
    component: Component, outputs: tuple[str, ...] | None, tell: Callable[[float], None] = lambda done: None
) -> Translation:
    """Flatten a component, reduce its index and select its states, for the default values of its parameters.

    Parameters
    ----------
    component : Component
    outputs : tuple of str or None
        Requested variables; None makes everything available.
    tell : callable, optional
        Called with the fraction done, roughly, at the end of each phase.

    Raises
    ------
    ModelError, NameLookupError
        A defect of the model, or an output that it does not have.
    """
    with _uncollected():
        model = flatten(component)
        tell(FLATTENED)
        variants = Variants(component, outputs, model, factors(model), sums(model))
        defaults = model.parameters.defaults
        if special := variants.special(defaults):
            try:
                variants.chosen[special] = variants.tried(special, defaults)
                return variants.fitting(defaults)
            except SingularError:
                pass  # other parameters may be given for a run
        return variants.translated(frozenset(), defaults)


@contextmanager
def _uncollected() -> Iterator[None]:
    """Suspend Python's search for cyclic garbage: of the many objects that a translation makes, nearly all are kept.

    The search took a quarter of the time for a chain of 10 000 bodies.
    """
    searching = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if searching:
            gc.enable()


@dataclass(frozen=True, eq=False)
class Variants:
    """Translations of one component that differ in the parameter values substituted into the equations."""

    component: Component
    outputs: tuple[str, ...] | None
    model: FlatModel  # with nothing substituted
    factors: Integers  # parameters that multiply a variable
    sums: Sums  # coefficients that may cancel
    known: dict[Special, Translation] = field(default_factory=dict)  # keyed by the substituted values
    chosen: dict[Special, Translation] = field(default_factory=dict)  # keyed by the values that make a coefficient zero
    combined: dict[Special, dict[Rounds, Translation]] = field(default_factory=dict)  # with sums in place of equations
    _cancelled: dict[bytes, Special] = field(default_factory=dict)  # `special` for the most recent parameters in sums

    def special(self, parameters: Floats) -> Special:
        """The parameters, with their values, that make a variable's coefficient zero."""
        if self.sums and parameters[self.factors].all():
            return recent(
                self._cancelled, parameters[self._in_sums].tobytes(), lambda: special_values(NONE, self.sums, parameters)
            )
        return special_values(self.factors, self.sums, parameters)

    @cached_property
    def _in_sums(self) -> Integers:
        """The parameters in coefficients that may cancel; most runs change others."""
        return np.unique(np.concatenate([places.ravel() for _, places in self.sums]))

    def ordinary(self, parameters: Floats) -> NDArray[np.bool_]:
        """Mask of the runs in which no coefficient is zero; ``parameters`` has the shape (parameters, runs)."""
        return nothing_special(self.factors, self.sums, parameters)

    def translated(self, substituted: Special, parameters: Floats) -> Translation:
        """The translation with the values of some parameters substituted into its equations."""
        if substituted not in self.known:
            model = flatten(self.component, substituted, anew=False) if substituted else self.model
            structure = analyse(model, parameters)
            self.known[substituted] = Translation(structure, self.scene(structure), self, substituted)
        return self.known[substituted]

    def scene(self, structure: Structure) -> Scene:
        """The scene of a translation: for the requested outputs, and what sampled controllers read."""
        return asked_scene(structure, self.outputs, read_by_controllers(self.component))

    def fitting(self, parameters: Floats) -> Translation:
        """A translation that can be solved with these parameters: the general one, or one with the special values substituted.

        Raises
        ------
        ModelError
            Neither can be solved, or the component has changed since it was compiled.
        """
        special = self.special(parameters)
        if special not in self.chosen:
            if special and flatten(self.component, anew=False).digest != self.model.digest:
                raise stale(self.model, f"with {some(self.named(special))} the equations are derived anew")
            self.chosen[special] = self.tried(special, parameters)
        return self.without_cancelling(self.chosen[special], parameters)

    def without_cancelling(self, found: Translation, parameters: Floats) -> Translation:
        """A translation, or one with sums of equations in which the highest derivatives cancel; the former where none can be solved."""
        if found.scene.can_be_prepared(parameters):
            return found
        from gearlib.reduce.combinations import combinations

        known = self.combined.setdefault(found.substituted, {})
        for other in known.values():
            if other.cancels_as_before(parameters) and other.scene.can_be_prepared(parameters):
                return other
        other = found
        try:
            for _ in range(MOST_ROUNDS):
                sums = combinations(other.structure, parameters, other.scene.rates)
                if not sums:
                    return found
                other = other.with_sums(sums, parameters)
                if other.scene.can_be_prepared(parameters):
                    while len(known) >= MOST_COMBINED:
                        del known[next(iter(known))]
                    return known.setdefault(other.rounds, other)
        except ModelError:  # no equation is left that determines the unknowns that cancel
            pass
        return found

    def tried(self, special: Special, parameters: Floats) -> Translation:
        """As `fitting`, of the component as it is now."""
        if not special:
            return self.translated(special, parameters)
        general: Translation | None = None
        try:
            general = self.translated(frozenset(), parameters)
            if can_be_solved(general.scene, parameters):
                return general
        except ModelError:
            pass  # the general equations cannot be solved with these values: substitute them
        try:
            found = self.translated(special, parameters)
            self.without_cancelling(found, parameters).scene.prepared(parameters)
        except ModelError as problem:
            if general is not None and any(value for _, value in special):
                general.scene.numbers(parameters)  # names the coefficient that is divided by although it cancels
            raise SingularError(f"with {some(self.named(special))}: {problem}") from None
        return found

    def named(self, special: Special) -> list[str]:
        """Parameters as text, such as ``body.J = 0``."""
        names = self.model.parameters.names
        return [f"{names[p]} = {value:g}" for p, value in sorted(special)]


def stale(model: FlatModel, why: str) -> ModelError:
    """The error for a component that is no longer the compiled one."""
    return ModelError(
        f"{model.instances[0].kind} has changed since it was compiled, and {why}: something that its equations() or assemble() read (an "
        "attribute of a class, a constant of a module) is different now; compile it again"
    )


@dataclass(frozen=True, eq=False)
class Translation:
    """A compiled model.

    Attributes
    ----------
    structure : Structure
        Index-reduced equations and their matching.
    scene : Scene
        Integrated states, and the computation of the outputs.
    variants : Variants
        The component, and its other translations.
    substituted : frozenset of (int, float)
        Parameters whose values are substituted into the equations, since a coefficient vanishes there.
    rounds : tuple
        Sums of equations whose highest derivatives cancel, round by round; each replaces one of its equations.
    before : tuple of Structure
        Structure before each round.
    decisive : frozenset of (int, float)
        Parameters, with their values, on which the cancellation depends.
    scenes : dict
        Scenes with other states, made for runs and analyses; grows.
    switched : dict
        Scenes to which runs switched when their own states became singular; grows.
    """

    structure: Structure
    scene: Scene
    variants: Variants
    substituted: Special
    rounds: Rounds = ()
    before: tuple[Structure, ...] = ()
    decisive: Special = frozenset()
    scenes: dict[tuple[States, tuple[int, ...], States], Scene] = field(default_factory=dict)
    switched: dict[States, Scene] = field(default_factory=dict)
    asked: list[Any] = field(default_factory=list)  # the last checked arguments of a run, made by `checked_request`

    @property
    def component(self) -> Component:
        """The component that was translated."""
        return self.variants.component

    @property
    def outputs(self) -> tuple[str, ...] | None:
        """Requested outputs; None for everything."""
        return self.variants.outputs

    @property
    def name(self) -> str:
        """Class name of the component."""
        return type(self.component).__name__

    @property
    def model(self) -> FlatModel:
        """The flat equations."""
        return self.structure.model

    @property
    def states(self) -> tuple[str, ...]:
        """Paths of the integrated states."""
        return self.scene.state_names

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Paths of the unbound inputs."""
        return tuple(self.model.name(int(v)) for v in self.model.inputs)

    @cached_property
    def controllers(self) -> tuple[Controller | Delay, ...]:
        """The sampled controllers and delays, which set some of these."""
        return controllers_of(self.component, self.inputs, self.model.parameters.names)

    @cached_property
    def open_inputs(self) -> tuple[str, ...]:
        """Paths of the inputs that must be given: those that no sampled controller or delay sets."""
        given = {k for controller in self.controllers for k in controller.gives}
        return tuple(name for k, name in enumerate(self.inputs) if k not in given)

    @property
    def special(self) -> list[str]:
        """The parameters whose values are substituted into the equations, such as ``body.J = 0``."""
        return self.variants.named(self.substituted)

    @property
    def decided_by(self) -> Special:
        """Parameters, with their values, that decided which equation determines what."""
        return self.substituted | self.decisive

    def cancels_as_before(self, parameters: Floats) -> bool:
        """Whether the highest derivatives cancel in all sums of equations with these parameters, too."""
        from gearlib.reduce.combinations import cancel

        return all(cancel(s, sums, parameters) for s, sums in zip(self.before, self.rounds, strict=True))

    def with_sums(self, sums: tuple[CancellingSum, ...], parameters: Floats) -> Translation:
        """The translation with sums in place of equations.

        Raises
        ------
        ModelError
            The remaining equations do not determine the unknowns.
        """
        from gearlib.reduce.combinations import replaced

        model = replaced(self.structure, sums)
        structure = analyse(model, parameters)
        if structure.redundant or structure.closed:
            raise LoopError("what is left of equations says nothing new")
        structure = replace(
            structure,
            redundant=self.structure.redundant,
            closed=self.structure.closed,
            complete=self.structure.complete,
            declared=structure.declared if structure.model.n_relations else self.structure.declared,  # which number relations
        )
        decisive = self.decisive | {(p, float(parameters[p])) for each in sums for p in each.decisive}
        scene, before = self.variants.scene(structure), (*self.before, self.structure)
        return Translation(structure, scene, self.variants, self.substituted, (*self.rounds, sums), before, decisive)

    def unit(self, name: str) -> str:
        """Unit of a variable or derivative, if known; discrete variables have none."""
        if name in self.model.discretes:
            return ""
        base, order = self.model.column(name)
        unit = self.model.unit(self.model.variable(base))
        return unit and unit + "/s" * order

    @cached_property
    def parameter_units(self) -> dict[str, str]:
        """Units of the declared parameters, by path."""
        declared = [(i.path, name, p.unit) for i in self.model.instances for name, p in i.declared.parameters.items()]
        return {f"{path}.{name}" if path else name: unit for path, name, unit in declared}

    def nodes(self, outputs: Iterable[str]) -> list[Node]:
        """The nodes that must be computed for some outputs."""
        return output_nodes(self.structure, outputs)

    def with_states(self, states: States) -> Scene:
        """The scene that integrates some states, with the requested outputs and discrete variables."""
        return self.scene_of(states, self.scene.wanted, self.scene.outputs)

    def scene_of(self, states: States, wanted: tuple[int, ...] = (), outputs: States = ()) -> Scene:
        """The scene with some states, discrete variables and outputs; the translation's own if it has exactly these states."""
        own = self.scene
        if states == own.states and set(wanted) <= set(own.wanted) and set(outputs) <= set(own.outputs):
            return own
        key = states, wanted, outputs
        if key not in self.scenes:
            self.scenes[key] = Scene(self.structure, states, wanted, outputs)
        return self.scenes[key]

    @cached_property
    def energies(self) -> tuple[Audited, ...]:
        """Energies and powers of the components, for audits."""
        from gearlib.flatten.energies import audited

        return audited(self.component)

    @cached_property
    def energy_scene(self) -> Scene:
        """The scene that computes what the energies depend on, besides the outputs."""
        structure, model, own = self.structure, self.model, self.scene
        names = {n for p in self.energies for term in p.terms for n in term.names} - {"time", *model.parameters.index}
        discretes = sorted({model.discretes.index(n) for n in names if n in model.discretes})
        nodes: list[Node] = []
        for name in sorted(names):
            if name not in model.discretes:
                with suppress(NameLookupError):  # the component then counts as one of which nothing is known
                    node, sign = structure.named(name, "variable", ("is not computed", "is"))
                    nodes += [node] if sign else []
        targets = [*nodes, *(n for d in discretes for n in discrete_nodes(model, d))]
        states = tuple(sorted({*own.states, *needed_states(structure, targets)}))
        computed = tuple(n for n in dict.fromkeys(nodes) if n in structure.solved_by and n not in states)
        return self.scene_of(states, tuple(sorted({*own.wanted, *discretes})), computed)

    @cached_property
    def needed_inputs(self) -> tuple[str, ...]:
        """Unbound inputs that the outputs depend on; all of them if everything is available."""
        if self.outputs is None:
            return self.open_inputs
        names = self.model.discretes
        nodes = output_nodes(self.structure, [n for n in self.outputs if n not in names])
        decisive = [n for d, name in enumerate(names) if name in self.outputs for n in discrete_nodes(self.model, d)]
        return needed_inputs(self.structure, [*nodes, *decisive])

    def fitting(self, parameters: Floats) -> Translation:
        """A translation of the same component that fits the parameter values.

        Zeros may change the matching (a body without inertia has no acceleration of its own), so where a zero would be divided by, the
        model is translated again, once per set of zeros.
        """
        general = not self.substituted and not self.rounds and not self.variants.special(parameters)
        if general and self.scene.can_be_prepared(parameters):
            return self
        return self.variants.fitting(parameters)

    def fitted(self, given: Mapping[str, float] | None) -> tuple[Translation, Floats]:
        """The translation that fits parameters given by path, with the complete parameter table."""
        numbers = self.parameter_values(given)  # one table for all: they have the parameters of one component
        return self.fitting(numbers), numbers

    def parameter_values(self, given: Mapping[str, float] | None, bounded: bool = True) -> Floats:
        """Complete parameter table, with some values given by path; ``bounded``: whether their bounds are checked.

        Raises
        ------
        ArgumentError, NameLookupError, BoundError
            Not a number, an unknown parameter, or a value out of bounds.
        ModelError
            A redundant loop does not close with these values.
        """
        table = self.model.parameters
        given = by_name("parameters", given, "a mapping of paths to numbers", "load.J")
        if not given:
            return table.defaults
        chosen: dict[int, float] = {}
        for name, value in given.items():
            k = table.number(name)
            if type(value) is float:  # bounds: below
                chosen[k] = value
                continue
            if isinstance(value, (bool, np.timedelta64)) or not isinstance(value, (Real, np.integer, np.floating)):
                raise ArgumentError(f"parameter {name} is {shown(value)} ({type(value).__name__}); expected a number")
            chosen[k] = float(value) if isinstance(value, float) else real(f"parameter {name}", value)
        result = table.evaluate(chosen)
        if bounded:
            check_bounds(table, result, chosen)
        if self.structure.redundant:
            confirm(self.structure, result)
        return result

    def parameter_changes(self, names: Sequence[str], numbers: Floats, given: Iterable[str]) -> list[tuple[int, int, float]]:
        """Derivatives of all parameters with respect to some, each a seed, through bindings: (parameter, seed, weight).

        Parameters
        ----------
        names : sequence of str
            Paths.
        numbers : array
            Complete table, as `parameter_values` returns it.
        given : iterable of str
            Paths of those given explicitly, which follow from no other.

        Raises
        ------
        ArgumentError, NameLookupError
            Unknown parameter, or one whose value is substituted into the equations.
        LoopError
            A redundant loop closes only with this value of the parameter.
        """
        table = self.model.parameters
        seeds = [table.number(name) for name in names]
        fixed = {table.index[name] for name in given}
        changes = table.derivatives(numbers, seeds, fixed)
        inside = {p for p, _ in self.decided_by}
        for p, k, weight in changes:
            if p in inside and weight:
                what = f"{names[k]} changes {table.names[p]}, which" if table.names[p] != names[k] else names[k]
                raise ArgumentError(
                    f"{what} is {numbers[p]:g}, and that decided which equation determines what: there is no derivative with "
                    f"respect to it; give another value: parameters={{'{table.names[p]}': ...}}"
                )
        for k, name in enumerate(names if self.structure.redundant else ()):
            moved = numbers[seeds[k]] + 1e-4 * (abs(numbers[seeds[k]]) or 1.0)
            try:
                confirm(self.structure, table.evaluate({p: numbers[p] for p in fixed} | {seeds[k]: moved}))
            except LoopError:
                raise LoopError(
                    f"there is no derivative with respect to {name}: equations of {', '.join(self.structure.redundant)} follow from the "
                    "others with its present value only; bind the parameters of that loop to common ones, and take one of these"
                ) from None
        return changes

    def input_signals(self, given: Mapping[str, Any] | None) -> list[Any]:
        """A number, function of time or `Table` for every unbound input; 0 for those not given.

        Raises
        ------
        ArgumentError, NameLookupError
            Something else, or an unknown input.
        """
        names, open_names = self.inputs, self.open_inputs
        if not names and given is None:
            return []
        given = by_name("inputs", given, "a mapping of paths to numbers, functions of time or tables", "torque.tau")
        for name, value in given.items():
            if name not in open_names:
                bound = self.model.find(name) is not None
                hint = "it is bound in the model, or no input" if bound else nearest(name, open_names)
                raise NameLookupError(f"the model has no unbound input '{name}'; {hint}")
            given[name] = value = as_table(value)
            if not (isinstance(value, Table) or callable(value)):
                given[name] = real(f"input {name}", value, "a finite number, a function of time or a gl.Table")
        signals = [given.get(name, 0.0) for name in names]
        plain = [callable(signal) and not isinstance(signal, Table) for signal in signals]
        return [FunctionInput(name, s) if function else s for name, s, function in zip(names, signals, plain, strict=True)]

    def start(
        self, scene: Scene, parameters: Floats, t: float, start: Any, signals: Sequence[Any], accepts_discrete: bool = False,
        seeds: Sequence[Seed] | None = None, own_seeds: Sequence[Seed] = (),
    ) -> Start:  # fmt: skip
        """Start values of a scene.

        Parameters
        ----------
        scene : Scene
        parameters : array
        t : float
            s.
        start : None, mapping or "steady"
            Start values by path; or the steady state.
        signals : sequence
            As `input_signals` returns them.
        accepts_discrete : bool
            Whether start values of discrete variables are accepted as well.
        seeds, own_seeds : sequences of (parameter or variable, seed, weight), optional
            Derivatives of the parameters with respect to seeds, and start values that are seeds, as for `start_values`; gives
            ``changes`` of the start.

        Raises
        ------
        ArgumentError, NameLookupError, StartError
            Unknown start value, contradictory values, or no steady state.
        """
        overrides: dict[int, float] = {}
        discretes, known = None, self.model.discretes  # values, names
        if not (start is None or isinstance(start, Mapping) or (isinstance(start, str) and start == "steady")):
            raise ArgumentError(
                f"start is {shown(start)}; expected a mapping of start values, 'steady', a result, or (result, time)"
            )
        if start is not None and isinstance(start, Mapping):
            for name, value in by_name("start", start, "a mapping of paths to start values").items():
                if accepts_discrete and name in known:
                    discretes = self.model.discrete_starts.copy() if discretes is None else discretes
                    discretes[known.index(name)] = real(f"start of {name}", value)
                else:
                    overrides[start_variable(self.model, name)] = real(f"start of {name}", value)
        inputs = values(signals, np.array([t]))[:, 0]
        begin = start_values(scene, parameters, inputs, t, overrides, discretes, seeds, own_seeds)
        if start == "steady":
            from gearlib.run.afterwards.branch import variables_on_branch
            from gearlib.run.steady import search_steady, steady_changes

            numbers = scene.prepared(parameters)
            refuse_programs(self.component, "a steady state")
            check_instants(self.structure, scene.states, "a steady state")
            with self._explaining_delays():
                steady = search_steady(scene, numbers, begin, inputs, t)
            changes = None if seeds is None else steady_changes(scene, numbers, begin, inputs, t, steady, seeds)
            guess = variables_on_branch(scene, parameters, begin, inputs, t, steady)
            return Start(steady, guess, (), steady=True, changes=changes)
        if discretes is None:
            return begin
        numbers = scene.prepared(parameters)
        discrete = scene.discrete(numbers, np.array([t]), begin.states[:, None], inputs[:, None], discretes, begin.guess)
        return replace(begin, discrete=discrete[:, 0], given=discretes)

    @contextmanager
    def _explaining_delays(self) -> Iterator[None]:
        """Say of a steady state that is not found that the outputs of delays are held in its search, which cannot see their effect."""
        try:
            yield
        except StartError as why:
            if not self.controllers:
                raise
            raise StartError(
                f"no steady state was found while the outputs of {', '.join(delay.path for delay in self.controllers)} are held, as the "
                "search does with delays: one that only delayed signals bring about is not seen. Run the train until it rests, and go "
                f"on from that result, or put a gearparts.blocks.PadeDelay in their place. (While they are held, {why})"
            ) from why

    def __reduce__(self) -> tuple[Any, ...]:
        recipe = packed((self.component, self.outputs))
        return _translated_again, (recipe, self.variants.model.digest, self.substituted, self.rounds, self.decisive)


@lru_cache(maxsize=16)
def _translated_again(
    recipe: bytes, digest: str, substituted: Special, rounds: Rounds = (), decisive: Special = frozenset()
) -> Translation:
    """Unpickle a translation in another process, or a copy: translated once for all results from there."""
    component, outputs = pickle.loads(recipe)
    found = translate(component, outputs)
    if found.variants.model.digest != digest:
        raise stale(found.model, "this process derives its equations anew")
    numbers = found.model.parameters.defaults.copy()
    for p, value in substituted | decisive:
        numbers[p] = value
    if found.substituted != substituted or found.rounds != rounds:
        found = found.variants.translated(substituted, numbers)
        for sums in rounds:
            found = found.with_sums(sums, numbers)
    return found


def output_nodes(structure: Structure, outputs: Iterable[str]) -> list[Node]:
    """The nodes to compute for some outputs: all but those that are identically zero, such as the torque of a free flange."""
    named = [structure.named(n, "output", ("cannot be an output", "can")) for n in outputs]
    return [node for node, sign in named if sign]


def asked_scene(structure: Structure, outputs: tuple[str, ...] | None, read: tuple[str, ...] = ()) -> Scene:
    """The scene with the states and discrete variables that some outputs need or, with None, all but irrelevant absolute angles.

    Whatever sampled controllers read is included.
    """
    model = structure.model
    if outputs is None:
        discretes = list(range(len(model.discretes)))
        wanted = {
            s for s in structure.states if s not in structure.angles
        }  # whose rates depend on no angle; but their reinits may
        targets = [*(n for d in discretes for n in discrete_nodes(model, d)), *output_nodes(structure, read)]
        targets += [n for state, nodes in structure.at_reinits.items() if state in wanted for n in nodes]
        return Scene(structure, tuple(sorted({*wanted, *needed_states(structure, targets)})), tuple(discretes))
    discretes = [model.discretes.index(n) for n in outputs if n in model.discretes]
    nodes = output_nodes(structure, [*(n for n in outputs if n not in model.discretes), *read])
    if len(model.discretes):
        discretes = sorted({*discretes, *needed_discretes(structure, nodes)})
    states = needed_states(structure, [*nodes, *(n for d in discretes for n in discrete_nodes(model, d))])
    computed = [n for n in dict.fromkeys(nodes) if n in structure.solved_by and n not in states]
    return Scene(structure, states, tuple(discretes), tuple(computed))


class Compiled:
    """Public object that holds a translation: a `System`."""

    translation: Translation
