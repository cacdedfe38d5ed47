"""`Segment`: the part of a run with one set of states, and the variables computed from them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import all_finite
from gearlib.errors import ModelError, NameLookupError, SolverError
from gearlib.program.event_iteration import MOST_ITERATIONS
from gearlib.program.interpret import Prepared, evaluate, owner_of, prepare
from gearlib.program.program import Program
from gearlib.program.relations import Relations, relations_of
from gearlib.run.methods.run import Run
from gearlib.run.scene import Scene, guess_of, node_name, settle_once
from gearlib.run.start_values import Start
from gearlib.solvers.inputs.table import values_in_run
from gearlib.solvers.problem import Solution
from gearlib.structure.incidence import Node

if TYPE_CHECKING:
    from gearlib.run.afterwards.branch import Branch, Settle
    from gearlib.run.tangents.tangents import TangentHistory
    from gearlib.solvers.drive.trace import Trace

Floats = NDArray[np.float64]
# Statistics that add up over the segments or pieces of a run
ADDED = ("steps", "attempts", "rejected", "rhs", "jac", "events", "restarts", "work", "seconds")


@dataclass(frozen=True, eq=False)
class Segment:
    """States and discrete state at the samples; other variables are computed from them on demand."""

    scene: Scene
    time: Floats
    states: Floats  # (samples, states)
    discrete: Floats  # (samples, n_discrete)
    parameters: Floats
    signals: Sequence[Any]
    guess: Floats
    begin: float  # s; the first sample may be later
    tangents: TangentHistory | None = None
    known: dict[Node, Floats] = field(default_factory=dict)
    computed: list[tuple[Program, Floats]] = field(default_factory=list)  # programs and the histories of their slots
    events: Floats = field(default_factory=lambda: np.empty(0))
    finer: Callable[[Floats], Segment] | None = None  # returns the same segment at other times
    branches: list[Branch] = field(default_factory=list)  # tracked solution branches of nonlinear equations
    varied: dict[Node, Floats] = field(default_factory=dict)  # tangents already computed
    trace: Trace | None = None  # the ends of the run's steps
    begun: Callable[[Scene], Start] | None = None  # returns the start of the run for a scene with more states
    silent: bool = False  # whether values that are not finite are no reason for a warning

    @classmethod
    def of(
        cls, run: Run, solution: Solution, first: int = 0, finer: Callable[[Run, Floats], Segment] | None = None,
        begun: Callable[[Scene], Start] | None = None,
    ) -> Segment:  # fmt: skip
        """The solution of a run from one of its samples on; ``finer`` integrates the run again with other samples."""
        time, states, discrete = run.times[first : len(solution.x)], solution.x[first:], solution.discrete[first:]
        known = {node: history[first:] for node, history in solution.algebraic.items()}
        tangents = None
        if run.tangents is not None and solution.tangents is not None:
            from gearlib.run.tangents.tangents import TangentHistory, carried

            moving = carried(run.scene)
            discretes = run.tangents.discretes(moving, time)
            tangents = TangentHistory(run.tangents.directions, solution.tangents[first:], moving, discretes)
        happened = finer is not None or (run.handed or run.scene).relations is not None  # else the corners of tables only
        return cls(
            run.scene, time, states, discrete, run.numbers.parameters, run.signals, run.start.guess, float(run.times[0]), tangents,
            known, events=solution.event_times if happened else np.empty(0), finer=None if finer is None else partial(finer, run),
            trace=solution.trace, begun=begun,
        )  # fmt: skip

    def history(self, node: Node) -> Floats:
        """History of a variable that depends on the integrated states."""
        if node not in self.known:
            place = self.scene.place_of.get(node)
            inputs = self.scene.program.inputs
            if place is not None:
                self.known[node] = self.states[:, place].copy()
            elif node in inputs:
                self.known[node] = values_in_run([self.signals[inputs.index(node)]], self.time)[0]
            else:
                found = next((c for c in self.computed if node in c[0].slots), None) or self._compute(node)
                history = self.known[node] = found[1][found[0].slots[node]]
                if not (self.silent or all_finite(history)):
                    self._warn(node, history)
        return self.known[node]

    def guess_on_branch(self) -> Floats:
        """The guesses for iterations, at the first sample: on the solution branch of the run."""
        guess = self.guess.copy()
        for v in self.scene.program.undifferentiated[0].tolist():
            guess[v] = self.history((v, 0))[0]
        return guess

    def tangents_of(self, node: Node) -> Floats:
        """Tangents of a variable that depends on the integrated states, shape (samples, directions)."""
        assert self.tangents is not None, "the run was asked for sensitivities"
        place = self.scene.place_of.get(node)
        if place is not None:
            return self.tangents.states[:, place]
        if node not in self.varied:
            program, slots = next((c for c in self.computed if node in c[0].slots), None) or self._compute(node)
            prepared = prepare(program, self.scene.structure, self.parameters)
            discrete = self._discrete_for(program, self._inputs(program))
            wanted = np.array([program.slots[node]])
            found = self.tangents.of_slots(prepared, wanted, self.time, slots, discrete)
            self.varied[node] = found[:, 0]
        return self.varied[node]

    def _warn(self, node: Node, history: Floats) -> None:
        """Warn of values that are not finite."""
        bad = np.flatnonzero(~np.isfinite(history))
        more = f" and at {len(bad) - 1} more samples" if len(bad) > 1 else ""
        warnings.warn(
            f"{node_name(self.scene.model, node)} is {history[bad[0]]} at t = {self.time[bad[0]]:.9g} s{more}: its equations give it "
            "no finite value there",
            RuntimeWarning, stacklevel=5,
        )  # fmt: skip

    def discrete_variable(self, name: str) -> Floats:
        """History of a discrete variable."""
        scene, model = self.scene, self.scene.model
        used, place = scene.relations, model.n_relations + model.discretes.index(name)
        if used is None or not any(place in b.targets for b in used.discretes):
            raise NameLookupError(f"the discrete variable {name} was not needed in this run; name it in outputs=[...]")
        return self.discrete[:, place].copy()

    def discrete_at(self, program: Program, t: float) -> Floats:
        """The discrete state of a program at the last sample before a time."""
        return self._discrete_for(program, self._inputs(program))[:, int(np.searchsorted(self.time, t, side="right")) - 1]

    def _inputs(self, program: Program) -> Floats:
        """Values of the inputs at the samples; NaN of those that nothing in the program depends on."""
        read = program.inputs_read | (self.scene.n_discrete > 0)
        return values_in_run([signal if used else np.nan for signal, used in zip(self.signals, read, strict=True)], self.time)

    def _compute(self, node: Node) -> tuple[Program, Floats]:
        scene = self.scene
        program = scene.computing(node)
        prepared = prepare(program, scene.structure, self.parameters)
        inputs = self._inputs(program)
        discrete = self._discrete_for(program, inputs)
        guess = self._followed(prepared) if program.iterated else None
        found = program, evaluate(prepared, self.time, self.states.T, inputs, discrete, guess)
        self.computed.append(found)
        if scene.structure.changing and len(self.time):
            from gearlib.run.refusals.jumps import SampledMotion, refuse_jumps, refuse_switches_between

            motion = SampledMotion(scene.structure, self.parameters, self.time, discrete.T, self.history)
            try:
                refuse_jumps(scene.structure, program, self.parameters, float(self.time[0]), float(self.time[-1]))
                refuse_switches_between(motion, program)
            except ModelError:
                self.computed[:] = [other for other in self.computed if other is not found]
                raise
        return found

    def _followed(self, prepared: Prepared, settle: Settle | None = None) -> Floats:
        """Initial guess of a program's iterations at each sample, on the solution branch of the run.

        ``settle`` evaluates the relations that the run did not need; without it they are known at every time.
        """
        from gearlib.run.afterwards.branch import follow, iterated_unknowns

        program = prepared.program
        start = guess_of(program, self.guess)
        unknowns, nodes = iterated_unknowns(program)
        branch = next((b for b in self.branches if set(nodes) <= set(b.nodes)), None)
        if branch is None:
            if self.finer is None or not len(self.time) or self.time[-1] <= self.begin:
                return start
            finer = self.finer

            def path(times: Floats) -> tuple[Floats, Floats, Floats]:
                part = replace(finer(times), finer=None, branches=self.branches)
                inputs = part._inputs(program)
                discrete = part.discrete.T if settle is not None else part._discrete_for(program, inputs)
                chosen = np.searchsorted(part.time, times)
                return part.states.T[:, chosen], inputs[:, chosen], discrete[:, chosen]

            branch = follow(
                self.scene.compiled_program(prepared), path, self.begin, float(self.time[-1]), self.events, start, settle
            )
            self.branches.append(branch)
        guess = np.repeat(start[:, None], len(self.time), axis=1)
        guess[unknowns] = branch.guess(nodes, self.time)
        return guess

    def _discrete_for(self, program: Program, inputs: Floats) -> Floats:
        """The discrete state at all samples; relations that the run did not need are evaluated here."""
        scene, model = self.scene, self.scene.model
        discrete = self.discrete.T
        if not scene.n_discrete:
            return discrete
        found = relations_of(scene.structure, program)
        tracked = np.empty(0, np.int64) if scene.relations is None else scene.relations.used
        needed = {int(m) for b in found.discretes for m in b.targets}
        known = set() if scene.relations is None else {int(m) for b in scene.relations.discretes for m in b.targets}
        if needed - known:
            names = ", ".join(model.discretes[m - model.n_relations] for m in sorted(needed - known))
            raise NameLookupError(f"the discrete variables {names} were not needed in this run; name them in outputs=[...]")
        new = np.setdiff1d(found.used, tracked)
        if not len(new):
            return discrete
        prepared = prepare(found.program, scene.structure, self.parameters)
        settle = partial(_settled, scene, found, prepared, new)
        guess = self._followed(prepared, settle) if found.program.iterated else None
        return settle(self.time, self.states.T, inputs, discrete, guess)


def _settled(
    scene: Scene, found: Relations, prepared: Prepared, new: NDArray[np.int64], t: Floats, states: Floats, inputs: Floats,
    discrete: Floats, guess: Floats | None,
) -> Floats:  # fmt: skip
    """The discrete state after iterating some relations to a fixed point."""
    for _ in range(MOST_ITERATIONS):
        # as at a start, only what they settle to must admit a solution
        passed = settle_once(found, prepared, t, states, inputs, discrete, guess, forgiving=True)
        restless = passed[new] != discrete[new]
        if not restless.any():
            if found.program.iterated:
                settle_once(found, prepared, t, states, inputs, discrete, guess)
            return discrete
        discrete = discrete.copy()
        discrete[new] = passed[new]
    unsettled = set(new[restless.any(axis=1)].tolist())
    owners = dict.fromkeys(
        owner_of(scene.structure, int(e))
        for b in found.batches for e, target in zip(b.equations, b.targets.tolist(), strict=True) if target in unsettled
    )  # fmt: skip
    at = t[int(np.argmax(restless.any(axis=0)))]
    raise SolverError(f"a relation of {', '.join(owners)} holds if and only if it does not at t = {at:g} s: no value fits")
