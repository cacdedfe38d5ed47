"""Consistent start values: fixed values hold, guesses give way, contradictions are reported."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import NameLookupError, StartError
from gearlib.flatten.model import FlatModel
from gearlib.program.build import build
from gearlib.program.derivative_plan import DerivativePlan, derivative_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import evaluate, prepare
from gearlib.program.newton import Correction, newton
from gearlib.program.program import Batch, Program
from gearlib.program.relations import Relations, relations_of
from gearlib.reduce.coefficients import start_guess
from gearlib.reduce.reduction import Structure
from gearlib.run.scene import Scene, discrete_at_start, guess_of, node_name
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
Seed = tuple[int, int, float]  # parameter or variable, seed, weight
ROUNDING = 1e-10  # relative to the terms of a start value: admissible mismatch, as of values printed by another program
NOTHING = 1e-12  # largest remainder of computed start values where zero is exact
LEAST = 1e-11  # of a variable's nominal value: a smaller start value counts as zero (rounding of angles of some radians)


@dataclass(frozen=True)
class Start:
    """Consistent start values of a run."""

    states: Floats  # of the scene
    guess: Floats  # of every representative variable, for iterations
    free: tuple[str, ...]  # states that nothing fixes
    discrete: Floats | None = None  # relations and discrete variables, where these do not follow from the model and the states
    given: Floats | None = None  # start values of all discrete variables, where some are given for the run
    steady: bool = False  # whether the states are steady
    changes: Floats | None = None  # derivatives of the states with respect to parameters, (states, seeds), if requested


def start_named(name: str) -> str | None:
    """The variable whose start value a name stands for; None of another name.

    >>> start_named("start(load.w)"), start_named("load.w")
    ('load.w', None)
    """
    return name[len("start(") : -1] if name.startswith("start(") and name.endswith(")") else None


def start_variable(model: FlatModel, name: str) -> int:
    """Number of the variable that a start value is given for.

    Raises
    ------
    NameLookupError
        Unknown variable, or one without a start value: a derivative, a discrete variable, an input.
    """
    if isinstance(name, str):
        base, order = model.column(name)
        if order and model.find(base) is not None:
            raise NameLookupError(f"{name} is a derivative, which has no start value; {base} has one")
        if name in model.discretes:
            part, _, local = name.rpartition(".")
            raise NameLookupError(
                f"{name} is a discrete variable; its start value is part of the model: start={{'{local}': ...}} of {part or 'it'}"
            )
    found = model.variable(name)
    if model.representative[found] in model.inputs:
        raise NameLookupError(f"{name} is an input, which has no start value; give inputs={{'{name}': ...}}")
    return found


def fixed_values(model: FlatModel, parameters: Floats, overrides: Mapping[int, float]) -> dict[int, tuple[float, str]]:
    """Fixed start values by representative variable, with the names under which they were given; those of the run take precedence."""
    fixed: dict[int, tuple[float, str]] = {}
    own = {int(model.representative[v]) for v in overrides}
    given = [
        (int(v), float(parameters[slot]))
        for v, slot, is_fixed in zip(model.started, model.start_slots, model.start_fixed, strict=True)
        if is_fixed and int(model.representative[v]) not in own
    ]
    nothing = _rounding(value for _, value in [*given, *overrides.items()])
    for v, value in [*given, *overrides.items()]:
        rep, sign = int(model.representative[v]), int(model.sign[v])
        if sign == 0:
            if abs(value) > max(nothing, LEAST * model.nominal[rep]):
                raise StartError(f"start of {model.name(v)} is {value:g}, but it is always zero")
            continue
        least = LEAST * model.nominal[rep]
        here, there = (x if abs(x) > least else 0.0 for x in (sign * value, fixed[rep][0] if rep in fixed else sign * value))
        if abs(here - there) > ROUNDING * max(abs(here), abs(there)) + nothing:
            other = fixed[rep][1]
            raise StartError(
                f"start values contradict each other: {other} and {model.name(v)} are one variable (up to its sign), but are "
                f"fixed at {fixed[rep][0]:{_digits(fixed[rep][0], sign * value)}} and {sign * value:{_digits(fixed[rep][0], sign * value)}}"
            )
        fixed[rep] = (sign * value, model.name(v))
    return fixed


def _rounding(values: Iterable[float]) -> float:
    """Magnitude below which start values computed from each other count as zero."""
    return min(NOTHING, ROUNDING * max(map(abs, values), default=0.0))


def _agree(model: FlatModel, parameters: Floats, guess: Floats) -> bool:
    """Whether all fixed start values agree with ``guess``."""
    if model.fixed_once:  # then the guess is made of them
        return True
    representatives, signs, slots = model.fixed
    return bool(
        (guess[representatives] == signs * parameters[slots]).all() and (signs.all() or not parameters[slots][signs == 0].any())
    )


def starts_of_runs(scene: Scene, parameters: Floats) -> Floats | None:
    """Start values of the states in many runs, (runs, states), or None where equations have to be solved for them.

    ``parameters`` has the shape (parameters, runs); runs whose fixed values contradict each other get no numbers.
    """
    if scene.unfixed is None:
        return None
    representatives, signs, slots = scene.model.guessed
    guess = np.zeros((scene.model.n_variables, parameters.shape[1]))
    guess[representatives] = signs[:, None] * parameters[slots]
    representatives, signs, slots = scene.model.fixed
    agree = (guess[representatives] == signs[:, None] * parameters[slots]).all(axis=0)
    agree &= ~parameters[slots][signs == 0].any(axis=0)
    variables, orders = scene.everything
    x = np.where(orders[:, None] == 0, guess[variables], 0.0)[scene.places]
    states: Floats = np.where(agree, x, np.nan).T
    return states


def start_values(
    scene: Scene, parameters: Floats, inputs: Floats, t: float, overrides: Mapping[int, float], discretes: Floats | None = None,
    seeds: Sequence[Seed] | None = None, own_seeds: Sequence[Seed] = (),
) -> Start:  # fmt: skip
    """Compute consistent start values of a run.

    Parameters
    ----------
    scene : Scene
    parameters : array
    inputs : array, shape (inputs,)
        Values of the inputs at the start.
    t : float
    overrides : mapping of int to float
        Start values given for this run, by variable.
    discretes : array, optional
        Start values of all discrete variables, replacing the model's.
    seeds : sequence of (parameter, seed, weight), optional
        Derivatives of the parameters with respect to seeds, as `ParameterTable.derivatives` returns them; gives ``changes`` of the
        start.
    own_seeds : sequence of (variable, seed, sign), optional
        Start values that are themselves seeds, of representative variables.

    Raises
    ------
    StartError
        Fixed values contradict each other.
    """
    structure, model = scene.structure, scene.model
    guess = start_guess(model, parameters)
    if not overrides and scene.unfixed is not None and _agree(model, parameters, guess):
        variables, differentiated = scene.starting
        x = guess[variables]
        x[differentiated] = 0.0
        moved = None if seeds is None else _Change.of_guess(scene, seeds, overrides, own_seeds).states[scene.places]
        return Start(x, guess, scene.unfixed, changes=moved)
    everything = structure.states
    variables, orders = scene.everything
    key = (
        parameters.tobytes(),
        inputs.tobytes(),
        t,
        tuple(overrides.items()),
        discretes if discretes is None else discretes.tobytes(),
    )
    if seeds is None and (known := scene.started.get(key)) is not None:
        again: Start = replace(known, states=known.states.copy(), guess=known.guess.copy())
        return again
    fixed = fixed_values(model, parameters, overrides)
    for v, (value, _) in fixed.items():
        guess[v] = value
    x = np.where(orders == 0, guess[variables], 0.0)
    place = {node: i for i, node in enumerate(everything)}
    direct = {place[v, 0] for v in fixed if (v, 0) in place}
    others = [(v, 0) for v in fixed if (v, 0) not in place and (v, 0) in structure.solved_by]
    for v in (v for v, k in others if not structure.computes((v, k))):
        raise StartError(f"start of {fixed[v][1]}: it needs the derivative of an input, so it cannot be given a start value")
    free = [i for i in range(len(everything)) if i not in direct]
    settled = set(direct)
    change = None if seeds is None else _Change.of_guess(scene, seeds, overrides, own_seeds)
    if others:
        own = {int(model.representative[v]) for v in overrides}
        settled |= _satisfy(structure, scene, parameters, inputs, t, x, guess, others, fixed, free, own, discretes, change)
    open_ = tuple(name for name, i in zip(scene.state_names, scene.places.tolist(), strict=True) if i not in settled)
    if change is not None:
        return Start(x[scene.places], guess, open_, changes=change.states[scene.places])
    scene.started.clear()
    scene.started[key] = Start(x[scene.places], guess.copy(), open_)
    return Start(x[scene.places], guess, open_)


@dataclass(frozen=True, eq=False)
class _Change:
    """Derivatives of start values with respect to seeds.

    ``seeds`` are (parameter, seed, weight); ``given`` is the derivative of all variables' start and guess values, (variables, seeds),
    ``states`` that of all states, (states, seeds).
    """

    seeds: Sequence[Seed]
    given: Floats
    states: Floats

    @classmethod
    def of_guess(cls, scene: Scene, seeds: Sequence[Seed], overrides: Collection[int], own: Sequence[Seed] = ()) -> _Change:
        """Case without equations to solve; start values given for a run are numbers, independent of the parameters."""
        model = scene.model
        table = np.zeros((len(model.parameters.names), 1 + max(k for _, k, _ in (*seeds, *own))))
        for p, k, weight in seeds:
            table[p, k] = weight
        representatives, signs, slots = model.guessed
        given = np.zeros((model.n_variables, table.shape[1]))
        given[representatives] = signs[:, None] * table[slots]
        given[[int(model.representative[v]) for v in overrides]] = 0.0
        for v, k, sign in own:
            given[v, k] = sign
        variables, orders = scene.everything
        return cls(seeds, given, np.where(orders[:, None] == 0, given[variables], 0.0))


@dataclass(frozen=True, eq=False)
class StartConstraints:
    """Equations of fixed start values that are no states: the program that computes these from all states, and its derivatives."""

    here: Scene  # with all states
    program: Program
    plan: DerivativePlan
    relations: Relations | None

    @property
    def programs(self) -> tuple[Program, ...]:
        return (self.program,) if self.relations is None else (self.program, self.relations.program)

    @property
    def rules(self) -> tuple[Batch, ...]:
        """What determines the discrete state."""
        return () if self.relations is None else (*self.relations.batches, *self.relations.discretes)

    @property
    def inputs(self) -> NDArray[np.bool_]:
        """Which of the inputs they depend on."""
        read = np.any([p.inputs_read for p in self.programs], axis=0)
        used = np.concatenate([np.empty(0, np.int64), *(b.arguments.ravel() for b in self.rules)])
        return np.asarray(read | np.isin(len(self.program.states) + np.arange(len(read)), used))

    @property
    def on_time(self) -> bool:
        """Whether they depend on time explicitly."""
        return any(p.on_time for p in self.programs) or any(b.kernel.on_time for b in self.rules)

    @classmethod
    def of(cls, structure: Structure, others: Sequence[Node]) -> StartConstraints:
        n, program = len(structure.states), build(structure, others, structure.states, dynamic=False)
        plan = derivative_plan(program, [(i, i) for i in range(n)], program.output_slots, n)
        relations = relations_of(structure, program) if structure.model.n_discrete else None
        used = relations is not None and (len(relations.used) > 0 or bool(relations.discretes))
        return cls(Scene(structure, structure.states), program, plan, relations if used else None)

    def discrete(
        self, parameters: Floats, t: Floats, inputs: Floats, guess: Floats, discretes: Floats | None
    ) -> Callable[[Floats], Floats]:  # fmt: skip
        """The discrete state of the program at a start, as a function of the states."""
        model, relations = self.here.model, self.relations
        if relations is None:
            none = np.zeros((model.n_discrete, 1))
            return lambda x: none
        prepared = prepare(relations.program, self.here.structure, parameters)
        start = guess_of(relations.program, guess)
        return lambda x: discrete_at_start(model, relations, prepared, t, x[:, None], inputs, discretes, start)


def _satisfy(
    structure: Structure, scene: Scene, parameters: Floats, inputs: Floats, t: float, x: Floats, guess: Floats,
    others: list[Node], fixed: dict[int, tuple[float, str]], free: list[int], own: Collection[int] = (),
    discretes: Floats | None = None, change: _Change | None = None,
) -> set[int]:  # fmt: skip
    """Move the free states as little as possible until the other fixed values hold. Changes ``x``; returns the moved states.

    A variable given for this run (one of ``own``) that follows from a single state stands for that state, so that the model's start
    value of the state gives way.
    """
    constraints = scene.constraints.get(tuple(others))
    if constraints is None:
        constraints = scene.constraints[tuple(others)] = StartConstraints.of(structure, others)
    here, program, plan = constraints.here, constraints.program, constraints.plan
    prepared = prepare(program, structure, parameters)
    wanted = np.array([fixed[v][0] for v, _ in others])
    start = guess_of(program, guess)
    slots_of = program.output_slots
    u, now = inputs[:, None], np.array([t])
    settle = constraints.discrete(parameters, now, u, guess, discretes)
    discrete = settle(x)

    def gradients(slots: Floats) -> Floats:
        gradient: Floats = dense(plan, entries(plan, At(prepared, now, slots, discrete)))[0]
        return gradient

    if own:
        rows = gradients(evaluate(prepared, now, x[:, None], u, discrete, start))
        for row, (v, _) in zip(rows, others, strict=True):
            needed = np.flatnonzero(row).tolist() if v in own else []
            if len(needed) == 1 and needed[0] not in free and structure.states[needed[0]][0] not in own:
                free = [*free, needed[0]]
                fixed.pop(structure.states[needed[0]][0])
    scale = here.nominal[free] if free else np.empty(0)
    moved: set[int] = set()
    nothing = _rounding(value for value, _ in fixed.values())
    least = LEAST * structure.model.nominal[[v for v, _ in others]]
    last = np.inf
    slots, found, gradient, allowed, wrong = (np.empty(0) for _ in range(5))

    def equations(free_states: Floats) -> tuple[Floats, Correction]:
        nonlocal slots, discrete, found, gradient, allowed, wrong, moved
        if (x[free] != free_states).any():
            x[free] = free_states
            discrete = settle(x)
        slots = evaluate(prepared, now, x[:, None], u, discrete, start)
        found, gradient = slots[slots_of, 0], gradients(slots)
        if not moved and free:
            moved = {free[i] for i in _independent(gradient[:, free] * scale)}
        # an error is relative to its own terms, not to other values: even at 1e9 rad, 3 rad are not rounding
        terms = np.abs(gradient) @ np.abs(x) + np.abs(found - gradient @ x) + np.abs(wanted)
        allowed = ROUNDING * terms + nothing + least * (np.abs(wanted) <= least)
        wrong = ~(np.abs(found - wanted) <= allowed)
        return found - wanted, correction

    def correction(error: Floats) -> Floats:
        """Nothing once the errors are rounding and fall no further."""
        nonlocal last
        worst, before = float(np.abs(error).max()), last
        if not wrong.any() and not worst < 0.1 * before:
            return np.zeros(len(free))
        last = worst
        return _basic_solution(gradient[:, free] * scale, error, allowed) * scale

    newton(equations, x[free], lambda _, step, error: not step.any(), 30)
    bad = np.flatnonzero(wrong)
    if len(bad):
        i = int(bad[0])
        made = found[i]
        if len(bad) > 1 and free:  # the states share the errors: what it would be if the others held
            rows = np.arange(len(others)) != i
            shift = _basic_solution(gradient[np.ix_(rows, free)] * scale, (found - wanted)[rows]) * scale
            made = made - gradient[i, free] @ shift
        name, digits = fixed[others[i][0]][1], _digits(made, wanted[i])
        sign = int(structure.model.sign[structure.model.variable(name)])  # of the one that was named, against what is computed
        rest = [fixed[v][1] for v in fixed if v != others[i][0]]
        others_text = f"the other fixed values ({', '.join(rest[:6])}{', ...' if len(rest) > 6 else ''}) and " if rest else ""
        raise StartError(
            f"start values contradict each other: {name} is fixed at {sign * wanted[i]:{digits}}, but {others_text}the "
            f"equations make it {sign * made:{digits}}; fix fewer, or give some of them as guess={{...}}"
            + _follows(structure, name, gradient[i])
        )
    if change is not None and free:  # found(x, p) = wanted(p) is to stay satisfied: x' solves the linearised equations
        entering = [(program.n_slots + p, k) for p, k, _ in change.seeds]
        by_seeds = derivative_plan(program, entering, slots_of, change.states.shape[1])
        weights = np.array([weight for *_, weight in change.seeds])
        found_moves = dense(by_seeds, entries(by_seeds, At(prepared, now, slots, discrete), weights))[0]
        ahead = gradient @ change.states + found_moves - change.given[[v for v, _ in others]]
        change.states[free] += _basic_solution(gradient[:, free] * scale, -ahead) * scale[:, None]
    return moved


def _digits(one: float, other: float) -> str:
    """A number format in which two values differ."""
    return next((style for style in (".6g", ".9g", ".12g") if f"{one:{style}}" != f"{other:{style}}"), ".17g")


def _follows(structure: Structure, name: str, gradient: Floats) -> str:
    """The states that a variable is computed from, as the end of a message."""
    states = [node_name(structure.model, structure.states[i]) for i in np.flatnonzero(gradient).tolist()]
    return f"; {name} follows from {', '.join(states[:6])}{', ...' if len(states) > 6 else ''}" if states else ""


def _independent(matrix: Floats) -> NDArray[np.int64]:
    """Columns that span all others (QR with column pivoting)."""
    from scipy.linalg import qr

    if not matrix.size:
        return np.empty(0, np.int64)
    _, r, order = qr(matrix, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(r))
    chosen: NDArray[np.int64] = order[: int((diagonal > 1e-11 * max(diagonal[0], 1e-300)).sum())]
    return chosen


def _basic_solution(matrix: Floats, rhs: Floats, allowed: Floats | None = None) -> Floats:
    """A least-squares solution with few nonzero entries; each error counts by what is ``allowed`` there, within eight decades."""
    chosen = _independent(matrix)
    result = np.zeros((matrix.shape[1], *rhs.shape[1:]))
    if len(chosen):
        rows = matrix[:, chosen]
        if allowed is not None and (most := allowed.max()) > 0:
            size = np.maximum(allowed, 1e-8 * most)
            rows, rhs = rows / size[:, None], rhs / size
        result[chosen] = np.linalg.lstsq(rows, rhs, rcond=None)[0]
    return result
