"""Jumps of tangents at events.

An event function g(t, x, p) with a zero at t_e determines dt_e/dp = -(dg/dx S + dg/dp) / (dg/dx f + dg/dt). The total derivative of the
state at the event is T = S + f dt_e/dp. Where the event re-initialises states, x = R(t, x, p), T becomes dR/dx T + dR/dt dt_e/dp +
dR/dp, and discrete variables set from continuous ones get tangents of their own. After the event S = T - f dt_e/dp with the new
right-hand side f: together S+ = S- + (f- - f+) dt_e/dp where no state is re-initialised.

References
----------
I. A. Hiskens, M. A. Pai, "Trajectory sensitivity analysis of hybrid systems", IEEE Trans. Circuits and Systems I 47 (2000),
doi:10.1109/81.828574.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.native.events import MOST_STEPS
from gearlib.program.derivative_plan import TIME, DerivativePlan, derivative_plan, discrete_entry
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import Prepared, evaluate
from gearlib.program.program import Program
from gearlib.run.methods.run import Run
from gearlib.run.scene import Scene, discrete_at_start, guess_of
from gearlib.run.tangents.directions import TangentDirections
from gearlib.run.tangents.tangents import TangentCode, Tangents
from gearlib.solvers.inputs.moving import Callbacks, Wrapped
from gearlib.solvers.inputs.table import slopes_before, values
from gearlib.solvers.problem import Problem

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
SAME = 100.0  # tolerances by which two events that are one may differ in how they move
MOST_TOGETHER = 3  # events at one time, whose orders are tried
MOST_PASSES = 100  # for the tangents of discrete variables that follow from each other


@dataclass(frozen=True, eq=False)
class EventPlan:
    """Program of a scene's relations with event functions and new values as slots, and their derivatives in directions.

    Attributes
    ----------
    program : Program
    functions, discretes, reinits : arrays, shape (number, 2)
        Relation, entry of the discrete state, or state; and the slot of its event function or new value.
    plan : DerivativePlan
        Derivatives of these slots in the directions, and in one more along which no parameter changes. Seeds enter at states,
        parameters, time, inputs, and carried discrete variables.
    setting, set_discrete : arrays of int
        Rows of ``discretes`` that set carried entries, and these entries.
    discrete_after, discrete_before : arrays of int
        Carried entries, and the same entries before an event.
    """

    program: Program
    functions: Integers
    discretes: Integers
    reinits: Integers
    plan: DerivativePlan
    setting: Integers
    set_discrete: Integers
    discrete_after: Integers
    discrete_before: Integers


def event_plan(scene: Scene, directions: TangentDirections, discrete: Sequence[int]) -> EventPlan:
    """The event plan of a scene, cached in the scene."""
    key = "events", len(directions), directions.entries
    found: EventPlan | None = scene.tangent_codes.get(key)
    if found is None:
        found = scene.tangent_codes[key] = _planned(scene, directions, discrete)
    return found


def _planned(scene: Scene, directions: TangentDirections, discrete: Sequence[int]) -> EventPlan:
    relations = scene.relations
    assert relations is not None, "there are events"
    steps, first = list(relations.program.steps), relations.program.n_slots
    found = []
    for batches in (relations.batches, relations.discretes, relations.reinits):
        pairs = np.empty((0, 2), np.int64)
        for batch in batches:
            slots = np.arange(first, first + len(batch))
            steps.append(replace(batch, targets=slots))
            pairs = np.concatenate([pairs, np.column_stack([batch.targets, slots])])
            first += len(batch)
        found.append(pairs)
    program = replace(relations.program, steps=tuple(steps), n_slots=first)
    functions, discretes, reinits = found
    n_states, columns = len(scene.states), range(len(directions) + 1)
    entering = [(i, k) for i in range(n_states) for k in columns]
    entering += [(program.n_slots + p, k) for p, k in directions.entries]
    entering += [(TIME, k) for k in columns]
    entering += [(n_states + j, k) for j in range(len(program.inputs)) for k in columns]
    entering += [(discrete_entry(m), k) for m in discrete for k in range(len(directions))]
    wanted = np.concatenate([pairs[:, 1] for pairs in found])
    plan = derivative_plan(program, entering, wanted, len(columns))
    place = {m: i for i, m in enumerate(discrete)}
    n, d = scene.model.n_relations, len(scene.model.discretes)
    setting = _pairs((i, place[m]) for i, m in enumerate(discretes[:, 0].tolist()) if m in place)
    before = _pairs((place[m], place[m + d]) for m in discrete if n <= m < n + d)
    return EventPlan(program, functions, discretes, reinits, plan, *setting, *before)


def _pairs(pairs: Iterable[tuple[int, int]]) -> Integers:
    """First and second numbers of pairs, as two rows."""
    return np.array(list(pairs), np.int64).reshape(-1, 2).T


class EventTangents:
    """The event iteration of a run, including the jumps of its tangents."""

    def __init__(self, run: Run, tangents: Tangents, code: TangentCode, problem: Problem, callbacks: Callbacks) -> None:
        scene, relations = run.scene, run.scene.relations
        assert relations is not None, "there are events"
        assert run.numbers.relations is not None, "with numbers"
        assert problem.update is not None, "and an iteration"
        self.run, self.tangents, self.code, self.callbacks = run, tangents, code, callbacks
        self.relations, self.shared = relations, code.native.shared
        self.n, self.count = len(scene.states), len(tangents.directions)
        self.events = event_plan(scene, tangents.directions, code.discrete)
        prepared = run.numbers.relations
        self.prepared = Prepared(self.events.program, prepared.structure, prepared.parameters, prepared.solutions)
        self.discretes = tangents.discretes(code.discrete)
        self.started = False
        # time, states and delay of the last event; where several met, they have no common delay
        self.last: tuple[float, Floats, Floats | None] | None = None
        double, whole = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int64)
        kind = partial(ctypes.CFUNCTYPE, ctypes.c_int32, ctypes.c_double, double)
        update = kind(ctypes.POINTER(ctypes.c_int32), double, whole)
        self._update, self._rhs = update(problem.update.address), kind(double, double, whole)(problem.rhs.address)
        self._callback = update(self._called)
        callbacks.alive += [self._callback, self._update, self._rhs]
        self.size = len(problem.data)
        others = relations.program
        both = [n for n in scene.program.slots if n in others.slots] if others.iterated else []
        self.first_guess = guess_of(others, run.start.guess)
        self.shared_slots = (
            np.array([scene.program.slots[n] for n in both], np.int64), np.array([others.slots[n] for n in both], np.int64),
        )  # fmt: skip

    @property
    def native(self) -> Wrapped:
        """The iteration as a native callback."""
        return Wrapped(ctypes.cast(self._callback, ctypes.c_void_p).value or 0)

    def _called(self, t: float, x: Any, fired: Any, data: Any, index: Any) -> int:
        try:
            return self._iterated(t, x, fired, data, index)
        except BaseException as problem:  # an exception must not propagate through native frames
            self.callbacks.stop(problem)
            return -1

    def _iterated(self, t: float, x: Any, fired: Any, data: Any, index: Any) -> int:
        everything = np.ctypeslib.as_array(x, (self.n * (1 + self.count),))
        numbers = np.ctypeslib.as_array(data, (self.size,))
        held = numbers[self.shared.relations :][: self.shared.n_discrete]
        count, begun = len(self.relations.searched), (everything.copy(), numbers.copy())
        states, before = begun[0][: self.n], held.copy()
        sides = np.sign(np.ctypeslib.as_array(fired, (count,))) if count else np.empty(0, np.int32)
        starting, self.started = not self.started, True
        first = starting and not any(since < t for since, _ in self.tangents.noted)
        f = np.zeros(self.n) if starting else self._rates(t, x, data, index)
        code = int(self._update(t, x, fired, data, index))
        if first and code >= 0:
            self._check_start(t, (x, data, index))
        if code < 0 or (code == 0 and not (starting and self.code.discrete)):
            return code
        here = everything[self.n :].reshape(self.n, self.count).copy()
        delay = np.zeros(self.count)
        again = self.last if self.last is not None and self.last[0] == t and (self.last[1] == states).all() else None
        if again is not None:  # what has jumped across zero at an event changes with it, whatever its own function does
            if again[2] is None:
                self._refuse_together(t, self.relations.searched[sides != 0].tolist())
            delay = again[2]
        elif not starting:
            switched = self.relations.timed[held[self.relations.timed] != before[self.relations.timed]]
            delays = self._delays(
                t, numbers, states, before, f, np.union1d(self.relations.searched[sides != 0], switched), here
            )
            delay = next(iter(delays.values()), delay)
            spread = np.ptp([*delays.values(), delay], axis=0)
            if (spread > SAME * self.run.rtol * np.abs(delay)).any():
                changed, after = set(np.flatnonzero(held != before).tolist()), held.copy()
                carried = len(self.events.reinits) > 0 or not changed.isdisjoint(self.code.discrete)
                effect = np.outer(self._rates(t, x, data, index) - f, spread)
                if carried or (np.abs(effect) > SAME * self.run.rtol * np.abs(here).max(axis=0, initial=0.0)).any():
                    if carried or not changed <= delays.keys():
                        everything[self.n :] = self._in_any_order(t, (x, data, index), begun, sides, delays)
                        self.last = t, everything[: self.n].copy(), None
                        return code
                    held[:] = before
                    for relation, own in delays.items():  # one after another
                        held[relation] = after[relation]
                        last, f = f, self._rates(t, x, data, index)
                        here += np.outer(last - f, own)
        steps = self._first_steps(t, states) if first and self.code.discrete else None
        everything[self.n :] = self._jumped(t, (x, data, index), f, here, delay, steps, starting).ravel()
        self.last = t, everything[: self.n].copy(), delay
        return code

    def _jumped(
        self, t: float, native: Any, f: Floats, here: Floats, delay: Floats,
        steps: list[tuple[Floats, Floats]] | None = None, starting: bool = False,
    ) -> Floats:  # fmt: skip
        """Tangents of the states after an event that has been handled, with the delay dt_e/dp and the rates before it."""
        numbers = np.ctypeslib.as_array(native[1], (self.size,))
        moved = here + np.outer(f, delay)
        if self.code.discrete or (len(self.events.reinits) and not starting):  # also where a new value is the old one
            moved = self._stepped(t, numbers, moved, delay, self._noted_steps(t, numbers) if steps is None else steps, starting)
            if self.code.discrete:
                self.tangents.note(t, self.discretes)
                self.code.weigh(numbers, self.tangents.directions, self.discretes)
        return moved if starting else moved - np.outer(self._rates(t, *native), delay)

    def _in_any_order(
        self,
        t: float,
        native: tuple[Any, Any, Any],
        begun: tuple[Floats, Floats],
        sides: NDArray[Any],
        delays: dict[int, Floats],
    ) -> Floats:
        """Tangents after events at one time of which each moves by itself, if it does not matter which of them is first.

        ``begun`` holds states and data before, ``sides`` where each event function crosses zero.
        """
        searched, timed = self.relations.searched, set(self.relations.timed.tolist())
        groups: list[tuple[Floats, list[int]]] = []
        for relation, delay in delays.items():
            same = (g for d, g in groups if (np.abs(delay - d) <= SAME * self.run.rtol * np.abs(d)).all())
            if (group := next(same, None)) is None:
                groups.append((delay, group := []))
            group.append(relation)
        if len(groups) > MOST_TOGETHER or sum(not timed.isdisjoint(group) for _, group in groups) > 1:
            self._refuse_together(t, delays)
        x, data, index = native
        everything = np.ctypeslib.as_array(x, (self.n * (1 + self.count),))
        numbers = np.ctypeslib.as_array(data, (self.size,))
        handled, discretes = (everything.copy(), numbers.copy()), self.discretes
        held = slice(self.shared.relations, self.shared.relations + self.shared.n_discrete)
        found: Floats | None = None
        for order in permutations(group for _, group in groups):
            everything[:], numbers[:], self.discretes = *begun, discretes
            here, waiting = everything[self.n :].reshape(self.n, self.count).copy(), set(delays)
            for relations in order:
                waiting -= set(relations)
                now = t - 4e-12 * max(abs(t), 1e-3) if waiting & timed else t  # conditions on time hold as they do just after
                fired = (ctypes.c_int32 * max(1, len(sides)))(
                    *(-s if k in waiting else s for k, s in zip(searched.tolist(), sides.tolist(), strict=True))
                )
                states, before, f = everything[: self.n].copy(), numbers[held].copy(), self._rates(now, *native)
                if self._update(now, x, fired, data, index) < 0:
                    self._refuse_together(t, delays)
                own = self._delays(t, numbers, states, before, f, np.array(relations), here)
                here = self._jumped(t, native, f, here, next(iter(own.values()), np.zeros(self.count)))
            tangents = np.concatenate([here, self.discretes])
            found = tangents if found is None else found
            ends = (handled[0][: self.n], everything[: self.n]), (handled[1][held], numbers[held]), (found, tangents)
            if not all(np.allclose(a, b, 1e-9 + self.run.rtol, 1e-10 * np.abs(b).max(initial=0.0)) for a, b in ends):
                self._refuse_together(t, delays)
        everything[:], numbers[:] = handled
        if self.code.discrete:
            self.code.weigh(numbers, self.tangents.directions, self.discretes)
        assert found is not None, "there are several"
        return found[: self.n].ravel()

    def _rates(self, t: float, x: Any, data: Any, index: Any) -> Floats:
        """Derivatives of the states."""
        out = (ctypes.c_double * max(1, self.n * (1 + self.count)))()
        if self._rhs(t, x, out, data, index) != 0:
            raise SolverError(f"the right-hand side cannot be evaluated at an event, at t = {t:.9g} s")
        return np.array(out[: self.n])

    def _inputs(self, t: float) -> tuple[Floats, Floats]:
        """Inputs, and their slopes just before ``t``."""
        signals, since = self.run.signals, t - float(self.run.times[0])
        return values(signals, np.array([t])), slopes_before(signals, t, 0.5 * since)

    def _varied(
        self, t: float, numbers: Floats, states: Floats, discrete: Floats, moved: Floats, delay: Floats, discretes: Floats
    ) -> Floats:
        """Directional derivatives of event functions and new values, shape (wanted slots, directions + 1), given those of
        states and time.

        The last column belongs to ``moved`` and ``delay`` alone: no parameter changes along it.
        """
        inputs, slopes = self._inputs(t)
        now = np.array([t])
        slots = evaluate(self.prepared, now, states[:, None], inputs, discrete[:, None], self._guess(numbers))
        driven = np.outer(slopes, delay)
        weights = np.concatenate([moved.ravel(), self.tangents.directions.weights, delay, driven.ravel(), discretes.ravel()])
        found: Floats = dense(
            self.events.plan, entries(self.events.plan, At(self.prepared, now, slots, discrete[:, None]), weights)
        )[0]
        return found

    def _guess(self, numbers: Floats) -> Floats:
        """Initial guess of the iterations, on the solution branch of the run."""
        found = np.zeros(self.events.program.n_slots)
        here, there = self.shared_slots
        found[: len(self.first_guess)] = self.first_guess
        found[there] = numbers[self.code.native.rhs.layout.slots + here]
        return found

    def _delays(
        self, t: float, numbers: Floats, states: Floats, discrete: Floats, f: Floats, crossed: Integers, here: Floats
    ) -> dict[int, Floats]:
        """dt_e/dp of the event at which some relations have changed, shape (directions,), as each of them has it, the steepest first."""
        rows = np.flatnonzero(np.isin(self.events.functions[:, 0], crossed))
        if not len(rows):
            return {}
        moved = np.column_stack([here, f])
        along = np.append(np.zeros(self.count), 1.0)
        found = self._varied(t, numbers, states, discrete, moved, along, self.discretes)[rows]
        order = np.argsort(-np.abs(found[:, -1]), kind="stable")
        slopes, change, relations = found[order, -1], found[order, :-1], self.events.functions[rows[order], 0].tolist()
        delays = -change[slopes != 0.0] / slopes[slopes != 0.0, None]
        if not np.isfinite(delays).all() or (not len(delays) and change[0].any()):
            raise SolverError(
                f"there are no sensitivities after t = {t:.9g} s: the event function of {self.run.scene.relation_names[relations[0]]} "
                "touches zero there without crossing it, and whether there is an event depends on the parameters"
            )
        return dict(zip(relations, delays, strict=False))

    def _check_start(self, t: float, native: tuple[Any, Any, Any]) -> None:
        """Refuse directions that move an event function which is zero at the start: what happens differs on its two sides.

        A bend is no matter, as of a gap that closes there: the rates are the same on both sides.
        """
        everything = np.ctypeslib.as_array(native[0], (self.n * (1 + self.count),))
        numbers = np.ctypeslib.as_array(native[1], (self.size,))
        states, here = everything[: self.n], everything[self.n :].reshape(self.n, self.count)
        held = numbers[self.shared.relations :][: self.shared.n_discrete]
        now = np.array([t])
        slots = evaluate(self.prepared, now, states[:, None], self._inputs(t)[0], held[:, None].copy(), self._guess(numbers))
        moved, along = np.column_stack([here, np.zeros(self.n)]), np.zeros(self.count + 1)
        changes = self._varied(t, numbers, states, held.copy(), moved, along, self.discretes)[:, :-1]
        f = self._rates(t, *native)
        acting = {int(r) for b in (*self.relations.discretes, *self.relations.reinits) for r in b.relations.ravel()}
        for row, (relation, slot) in enumerate(self.events.functions.tolist()):
            if slots[slot, 0] == 0.0 and changes[row].any():
                held[relation] = 1.0 - held[relation]
                jump = np.abs(self._rates(t, *native) - f).max(initial=0.0)
                held[relation] = 1.0 - held[relation]
                if relation in acting or jump > SAME * self.run.rtol * np.abs(f).max(initial=0.0):
                    name = self.tangents.directions.names[int(np.flatnonzero(changes[row])[0])]
                    raise SolverError(
                        f"there is no sensitivity to {name!r}: the event function of {self.run.scene.relation_names[relation]} is zero at "
                        f"the start, t = {t:.9g} s, and what follows differs on its two sides; let the run begin beside it"
                    )

    def _refuse_together(self, t: float, relations: Iterable[int]) -> NoReturn:
        names = " and ".join(self.run.scene.relation_names[k] for k in relations)
        raise SolverError(
            f"there are no sensitivities after t = {t:.9g} s: {names} change there together, and which of them does first depends on the "
            "parameters; give these values that keep them apart"
        )

    def _first_steps(self, t: float, states: Floats) -> list[tuple[Floats, Floats]]:
        """Discrete state and states at the outer iterations by which the discrete state of a run's start was found."""
        run, steps = self.run, list[Floats]()
        assert run.numbers.relations is not None, "there are events"
        now, inputs = np.array([t]), self._inputs(t)[0]
        discrete_at_start(
            run.scene.model,
            self.relations,
            run.numbers.relations,
            now,
            states[:, None],
            inputs,
            run.start.given,
            self.first_guess,
            steps,
        )
        return [(step[:, 0], states) for step in steps]

    def _noted_steps(self, t: float, numbers: Floats) -> list[tuple[Floats, Floats]]:
        """The same of those that the event iteration has recorded."""
        at, n_discrete = self.code.native.noted_steps, self.shared.n_discrete
        count = int(numbers[at])
        if count > MOST_STEPS:
            raise SolverError(
                f"an event at t = {t:.9g} s gives states new values {count} times; sensitivities follow {MOST_STEPS}"
            )
        rows = numbers[at + 1 :][: count * (n_discrete + self.n)].reshape(count, -1)
        return [(row[:n_discrete], row[n_discrete:]) for row in rows]

    def _stepped(
        self, t: float, numbers: Floats, moved: Floats, delay: Floats, steps: list[tuple[Floats, Floats]], starting: bool
    ) -> Floats:
        """Tangents of the states after some steps; those of discrete variables are set. At the start, start values of states hold."""
        functions, d = len(self.events.functions), len(self.events.discretes)
        along, moved = np.append(delay, 0.0), np.column_stack([moved, np.zeros(self.n)])
        for discrete, states in steps:
            for _ in range(MOST_PASSES):
                found = self._varied(t, numbers, states, discrete, moved, along, self.discretes)
                new = self.discretes.copy()
                new[self.events.set_discrete] = found[functions + self.events.setting, :-1]
                settled, self.discretes = bool((new == self.discretes).all()), new
                if settled:
                    break
            if not starting:
                moved = moved.copy()
                moved[self.events.reinits[:, 0]] = found[functions + d :]
            self.discretes = self.discretes.copy()
            self.discretes[self.events.discrete_before] = self.discretes[self.events.discrete_after]
        return moved[:, :-1]
