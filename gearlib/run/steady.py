"""Steady states: directions in which a motion may grow, and a solver for states where all other rates vanish.

A motion is steady if every state grows at a constant rate without any effect on the equations: ``x(t) = x + v t`` with ``f(x) = v`` and
``f`` invariant along ``v``. The admissible directions (rotation of the whole train, phases of meshes without a periodic law, slip of an
open clutch) are the symmetries of the equations, `gearlib.program.invariance`. In all other directions the rates must vanish. These
equations are solved by pseudo-transient continuation: linearly implicit Euler steps from the start values, which follow the transient
while the equations are nonlinear and grow into Newton steps at the end. So of several steady states it finds the one that the train
settles to.

References
----------
C. T. Kelley, D. E. Keyes, "Convergence analysis of pseudo-transient continuation", SIAM Journal on Numerical Analysis 35 (1998)
508-523, doi 10.1137/S0036142996304796

P. Deuflhard, "Newton Methods for Nonlinear Problems", Springer, 2004, section 6.4 (steps as long as the correction contracts).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import GearlibWarning, SolverError, StartError, warn
from gearlib.program.build import build
from gearlib.program.derivative_plan import DerivativePlan, derivative_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import Prepared, batch_values, evaluate, prepare
from gearlib.program.invariance import symmetries
from gearlib.program.newton import Correction, newton
from gearlib.program.program import Newton
from gearlib.program.relations import relations_of
from gearlib.run.afterwards.branch import slots_on_branch
from gearlib.run.methods.implicit import Implicit
from gearlib.run.methods.method_table import integrate
from gearlib.run.methods.run import Run
from gearlib.run.refusals.limits import too_small
from gearlib.run.scene import Scene, guess_of, node_name
from gearlib.run.start_values import Start
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import reach

Floats = NDArray[np.float64]
CONTRACTS = 0.5  # ratio of a correction to the step before it: the step follows the implicit equation
AIM = 0.1  # contraction targeted by step-size control
LONGER, SHORTER = 100.0, 0.05  # bounds on the change of the step size
LONGEST = 1e10  # step times the largest rate of the linearised equations: slower modes count as not moving
MOST_STEPS = 400  # before the search gives up; growing by `LONGER`, the step takes six of them from the shortest to the longest
ACROSS = 1e-3  # step times the largest rate met so far: a step this short may cross a jump
MOST_JUMPS = 10  # of these, after which something sticks: the rates push the states back across the same jump
RUNS = (0.1, 1.0, 10.0, 100.0, 1000.0)  # s
LONGEST_RUN = 2e4  # times the largest rate, from a state that the motion may leave
STIFF = 1e3  # step times the largest rate at which the fast transients have decayed
# Relative change of the states in a step at which Newton's method is tried, and bound on the change that it may make.
NEAR, LOCAL = 1e-4, 0.1
SETTLED = 1e-9  # last correction of a state relative to its size
LATER = 1e3  # growth of the fastest angle, in nominal values, after which the motion is checked again
ROUNDING = 1e3  # unit roundoffs of the terms of an equation that count as zero
UNSTABLE = 1e-9  # growth rate over the largest rate beyond which a motion is unstable
LEFT = 1e-6  # the same, beyond which a motion leaves a steady state, and not by the rounding of a repeated eigenvalue
LARGEST_EXAMINED = 400  # states
NOTHING = 1e-15  # relative to the largest derivative of a rate: smaller ones are rounding
NEVER = 1e-18  # 1/s: smaller derivatives of rates count as zero, also where all rates are as small (everything sticks)
LOCKED = 1e3  # times the rounding of a rate that no state affects: stuck elements must not creep
GROWN = 1e3  # factor by which the rounding of a rate may exceed that at the start values, if it hides the rate met there
MARGIN = 1e-11  # by which a relation that a run holds is satisfied where states are moved to it
SINGULAR = 1e-12  # singular value of scaled equations that counts as zero
STEP = 1e-4  # of the states, for differences of derivatives
KEPT = 1e-8  # cosine between what the rates keep and a direction in which none changes; a smaller one is rounding


@dataclass(frozen=True, eq=False)
class Search:
    """Equations of a steady state at one instant: rates of the states in the scaled directions that may not grow.

    Attributes
    ----------
    grows : array, shape (states, symmetries)
        Orthonormal directions, in nominal values of the states, in which the states may grow.
    held : array, shape (states, directions), optional
        Orthonormal directions in which the states must not change, such as the slip of what sticks.
    """

    scene: Scene
    numbers: Prepared
    begin: Start
    inputs: Floats
    t: float
    grows: Floats
    held: Floats | None = None

    @cached_property
    def scale(self) -> Floats:
        return np.maximum(self.scene.nominal, 1e-300)

    @cached_property
    def stationary(self) -> Floats:
        """Orthonormal directions in which nothing may change; unit vectors where these are single states."""
        n, k = self.grows.shape
        if not k:
            return np.eye(n)
        moving = self.grows.any(axis=1)
        if moving.sum() == k:
            return np.eye(n)[:, ~moving]
        whole = np.linalg.qr(self.grows[moving], mode="complete")[0][:, k:]
        stationary = np.zeros((n, n - k))
        stationary[moving, : whole.shape[1]] = whole
        stationary[~moving, whole.shape[1] :] = np.eye(n - int(moving.sum()))
        return stationary

    @cached_property
    def movable(self) -> Floats:
        """Orthonormal directions in which the states may be changed to make the rates vanish."""
        if self.held is None:
            return self.stationary
        across, sizes, _ = np.linalg.svd(self.stationary.T @ self.held)
        return np.asarray(self.stationary @ across[:, int((sizes > SINGULAR).sum()) :], float)

    @cached_property
    def _plan(self) -> DerivativePlan:
        """Derivatives of the rates with respect to the states and to perturbations of each computed slot."""
        program = self.scene.program
        n = len(program.states)
        computed = range(n + len(program.inputs), program.n_slots)
        entering = [*((i, i) for i in range(n)), *((slot, n + k) for k, slot in enumerate(computed))]
        return derivative_plan(program, entering, program.output_slots, n + len(computed))

    def rates(self, x: Floats) -> tuple[Floats, Floats]:
        """Scaled rates of all states, zero where they are rounding, and their derivatives.

        Raises
        ------
        SolverError
            The rates cannot be evaluated at x.
        """
        f, gradient, noise = self.equations(x)
        return np.where(np.abs(f) <= noise, 0.0, f), gradient

    def discrete(self, x: Floats) -> Floats:
        """Relations and discrete variables of a run that starts at x, shape (n_discrete, 1)."""
        return self.scene.discrete(self.numbers, np.array([self.t]), x[:, None], self.inputs[:, None], start=self.begin.guess)

    def at(self, x: Floats) -> At:
        """The program linearised at x."""
        scene, now, column, inputs = self.scene, np.array([self.t]), x[:, None], self.inputs[:, None]
        discrete = self.discrete(x)
        guess = slots_on_branch(scene, self.numbers, self.begin, self.inputs, self.t, x)
        return At(self.numbers, now, evaluate(self.numbers, now, column, inputs, discrete, guess), discrete)

    def equations(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Scaled rates, their derivatives, and a bound on the rounding error from all terms in their equations."""
        scene, at = self.scene, self.at(x)
        program, n, slots = scene.program, len(x), at.slots[:, 0]
        size = np.abs(slots)
        for step in program.steps:
            if isinstance(step, Newton):  # accurate relative to the largest unknown
                size[step.unknowns] = size[step.unknowns].max()
        plan, first = self._plan, n + len(program.inputs)
        weights = np.concatenate([np.ones(n), size[first:]])
        found = entries(plan, at, weights)[:, 0]
        inner = plan.seeds < n
        slopes = np.zeros((n, n))
        slopes[plan.rows[inner], plan.seeds[inner]] = found[inner]
        others = ~inner & (weights[plan.seeds] > 0)
        with np.errstate(invalid="ignore"):  # infinite slopes are refused below
            terms = np.abs(slopes) @ np.abs(x)
        terms += np.bincount(plan.rows[others], np.abs(found[others]), n)
        f, gradient = slots[program.output_slots] / self.scale, slopes * self.scale / self.scale[:, None]
        if not (np.isfinite(f).all() and np.isfinite(gradient).all()):
            worst = int(np.argmin(np.isfinite(f) & np.isfinite(gradient).all(axis=1)))
            raise SolverError(f"der({node_name(scene.model, scene.states[worst])}) cannot be computed")
        noise = ROUNDING * np.finfo(float).eps * terms / self.scale
        stuck = np.abs(gradient).max(axis=1) <= max(NOTHING * np.abs(gradient).max(), NEVER)
        gradient[stuck] = 0.0
        return f, gradient, np.where(stuck, LOCKED, 1.0) * noise

    @cached_property
    def _first(self) -> tuple[float, float]:
        """The largest rate at the start values, and the largest bound on the rounding of one."""
        f, _, noise = self.equations(self.begin.states)
        return float(np.abs(f).max()), float(noise.max())

    def hidden(self, noise: Floats) -> bool:
        """Whether rounding at this point, far from the start, is so large that it would hide even the rates at the start values."""
        try:
            first, rounding = self._first
        except SolverError:
            return False
        return float(noise.max()) > max(first, GROWN * rounding)

    def largest(self, gradient: Floats) -> float:
        """Largest entry of the Jacobian of the equations (1/s): a bound on the fastest time constant."""
        return float(np.abs(self.stationary.T @ gradient @ self.stationary).max(initial=0.0))

    def attracts(self, x: Floats) -> bool:
        """Whether motions near a steady state do not leave it exponentially."""
        gradient = self.rates(x)[1]
        longest = self.longest_stable(gradient)
        return longest == np.inf or longest * self.largest(gradient) > 0.5 / LEFT

    def longest_stable(self, gradient: Floats) -> float:
        """Largest stable step: a longer implicit one would follow a growing exponential to the wrong side."""
        stationary = self.stationary.T @ gradient @ self.stationary
        if stationary.shape[0] > LARGEST_EXAMINED:
            return np.inf
        growth = float(np.linalg.eigvals(stationary).real.max(initial=0.0))
        return 0.5 / growth if growth > UNSTABLE * self.largest(gradient) else np.inf


@dataclass(frozen=True)
class End:
    """End of a search: the states, and whether they are steady."""

    x: Floats
    steady: bool
    free: bool = False  # the equations are singular in a direction that would have to change
    forbidden: bool = False  # steady, but a variable is below its minimum: a step crossed an event
    one_of_many: bool = False  # steady, but not known to be the one of a continuum where the motion ends
    sticks: bool = False  # the rates point at each other across a jump, where only the events of a run hold the states


def search_steady(scene: Scene, numbers: Prepared, start: Start, inputs: Floats, t: float) -> Floats:
    """A steady state: all rates vanish, except those of variables on which no equation depends, such as the angles of the train.

    Growing states keep their start values. Of several steady states it is the one that the motion from the start values reaches.

    Raises
    ------
    StartError
        There is none, or the search does not find it; the message says what keeps changing, and why.
    """
    if not scene.states:
        return start.states.copy()
    search = Search(scene, numbers, start, inputs, t, growing(scene, numbers))
    end = _found(search)
    astray = end.steady and not scene.program.is_linear and not search.attracts(end.x)
    if end.steady and not astray and _left_to_motion(search, end.x):
        end = replace(end, one_of_many=True)
    if astray or end.one_of_many or (not end.steady and scene.relations is not None):
        ran = _run_to_rest(search, replace(end, x=start.states, steady=False), near=astray)
        end = ran if ran.steady and not (ran.one_of_many and end.steady) else end
    if end.one_of_many:
        warn(
            "the steady state is one of many side by side (where friction holds, or in an open gap), and need not be the one where the "
            "motion ends, which does not come to rest soon; run the train until it rests, and go on from that result",
            GearlibWarning,
        )
    if not end.steady:
        rest = _at_rest(search, end.x)
        end = rest if rest.steady else end
    if not end.steady:
        raise StartError(f"no steady state was found: {_reason(search, end)}")
    return end.x


def steady_changes(
    scene: Scene, numbers: Prepared, start: Start, inputs: Floats, t: float, x: Floats, seeds: Sequence[tuple[int, int, float]]
) -> Floats:
    """Derivatives of a steady state with respect to parameters, by the implicit function theorem, shape (states, seeds).

    The vanishing rates stay zero: of all changes of the states that achieve this it is the one that keeps what the rates keep, as a
    momentum, and then the one nearest to the change of the start values (states that grow keep their start values).

    Parameters
    ----------
    scene, numbers, start, inputs, t
        As for `search_steady`; the start includes the derivatives of its states.
    x : array
        The steady state.
    seeds : sequence of (parameter, seed, weight)
        Derivatives of the parameters with respect to seeds.

    Raises
    ------
    StartError
        The steady state ceases to exist: no change of the states compensates for that of a parameter; or it is one of many side by
        side, of which only the whole motion tells where it ends.
    """
    assert start.changes is not None, "the start values were found with these seeds"
    if not scene.states:
        return start.changes.copy()
    search = Search(scene, numbers, start, inputs, t, growing(scene, numbers))
    if _left_to_motion(search, x):
        raise StartError(
            "the steady state is one of many side by side, where friction holds or in an open gap, and which of them follows from the "
            "whole motion: run the train until it rests, with simulate(..., sensitivities=[...])"
        )
    program, begin = scene.program, start.changes
    plan = derivative_plan(program, [(program.n_slots + p, k) for p, k, _ in seeds], program.output_slots, begin.shape[1])
    weights = np.array([weight for *_, weight in seeds])

    def by_seeds(x: Floats) -> Floats:
        return np.asarray(dense(plan, entries(plan, search.at(x), weights))[0] / search.scale[:, None], float)

    _, gradient, noise = search.equations(x)
    ahead = by_seeds(x) + gradient @ (begin / search.scale[:, None])
    equations = SteadyEquations(search, gradient)
    changes = equations.change(ahead)
    # What the rates keep, as a momentum l x, has l that follow the parameters: l' (x - start) = l' gradient e = -l gradient' e
    e = equations.change((start.states - x) / search.scale)
    if e.any() and equations.open.size:
        step = STEP * (1 + np.abs(x / search.scale).max()) / np.abs(e).max()
        ahead_of, behind = by_seeds(x + step * e * search.scale), by_seeds(x - step * e * search.scale)
        changes += equations.along(ahead_of - behind) / (2 * step)
    stuck = np.where(gradient.any(axis=1), 0.0, NEVER)  # what sticks yields to a parameter, too
    per = np.zeros(begin.shape[1])  # relative change of the parameters with each seed
    for p, k, weight in seeds:
        per[k] += abs(weight / numbers.parameters[p]) if numbers.parameters[p] else 0.0
    for k in range(begin.shape[1]):
        if not equations.hold(ahead[:, k], 1e-9 * np.abs(ahead[:, k]) + per[k] * noise + stuck):
            raise StartError(
                "the steady state does not go on where the parameter changes: no change of the states makes up for that of the "
                "rates; a load that grows with the speed is missing, or the torques balance at these parameters only"
            )
    return np.asarray(begin + search.scale[:, None] * changes, float)


def growing(scene: Scene, numbers: Prepared) -> Floats:
    """Directions in which the states may grow steadily, orthonormal in nominal values, shape (states, directions).

    A speed that nothing depends on is not such a direction: its angle would grow at an increasing rate. That angle counts whether or
    not the scene integrates it. Nor is a direction along which a torque or force grows that some rate depends on: two springs that wind
    each other up may leave all rates unchanged.
    """
    structure, states = scene.structure, set(scene.states)
    rates: list[Node] = [(v, k + 1) for v, k in scene.states]
    for v, k in structure.states:
        if (v, k) not in states and k == 0 and ((v, k) in structure.angles or structure.model.potential[v]):
            if reach(structure, [(v, 1)], dynamic=False, events=True)[1] <= states:
                rates.append((v, 1))
    program = build(structure, rates, scene.states, dynamic=True)
    prepared = prepare(program, structure, numbers.parameters)
    events = None
    if scene.relations is not None:
        relations = relations_of(structure, program)
        events = relations, prepare(relations.program, structure, numbers.parameters)
    flows = [(v, k) for v, k in program.slots if k == 0 and structure.model.flow[v]]
    return symmetries(prepared, [program.slots[node] for node in (*rates, *flows)], events, np.maximum(scene.nominal, 1e-300))


def _found(search: Search) -> End:
    """Newton's method for a linear scene; for others pseudo-transient continuation, finished by Newton's method.

    An unstable steady state is found only where the motion reaches no other.
    """
    x, program = search.begin.states.copy(), search.scene.program
    linear = program.is_linear and search.scene.relations is None
    if linear and (end := _closed(search, x)).steady:
        return end
    if not linear and ((end := continued(search, x, stable=True)).steady or end.forbidden or end.sticks):
        return end
    return continued(search, x, stable=False)


def continued(search: Search, x: Floats, stable: bool) -> End:
    """Pseudo-transient continuation; ``stable`` steps follow a diverging motion and do not turn back."""
    try:
        f, gradient = search.rates(x)
    except SolverError:  # at the start values themselves
        return End(x, False)
    fastest = max(search.largest(gradient), float(np.abs(search.stationary.T @ f).max(initial=0.0)), NEVER)
    step, stalled, jumps = 0.1 / fastest, 0, 0
    for _ in range(MOST_STEPS):
        longest = LONGEST / max(search.largest(gradient), 1e-6 * fastest)
        step = min(step, longest, search.longest_stable(gradient) if stable else np.inf)
        solved = _implicit(search, gradient, step)
        change = solved(f)
        try:
            ahead, slopes = search.rates(x + search.scale * change)
        except SolverError:
            step *= SHORTER
            continue
        correction = solved(ahead - f - gradient @ change)
        contraction = float(np.abs(correction).max()) / max(float(np.abs(change).max()), 1e-300)
        fastest = max(fastest, search.largest(slopes))
        if contraction > CONTRACTS:
            if step * fastest > ACROSS:
                step *= max(AIM / contraction, SHORTER)
                continue
            jumps += 1
            if jumps > MOST_JUMPS:
                return End(x, False, sticks=True)
        before, x, f, gradient = f, x + search.scale * change, ahead, slopes
        size = float(np.abs(x / search.scale).max())
        if step == longest or (step * search.largest(gradient) > STIFF and np.abs(change).max() <= NEAR * size):
            end = _closed(search, x)
            if end.forbidden:
                return end
            if end.steady and (step == longest or np.abs((end.x - x) / search.scale).max() <= LOCAL * size):
                return end
            left, last = (np.abs(search.stationary.T @ rates).max(initial=0.0) for rates in (f, before))
            stalled = stalled + 1 if step == longest and left >= 0.5 * last else 0
            if stalled > 5:
                break
        step *= min(max(AIM / max(contraction, 1e-12), SHORTER), LONGER)
    end = _closed(search, x)
    return end if end.steady else replace(end, x=x)


def _run_to_rest(search: Search, end: End, near: bool = False) -> End:
    """Fallback where steps do not follow the motion, as across events (friction that comes to rest): simulations of growing length.

    ``near``: up to a state from which Newton's method leads no further.
    """
    scene, left, found = search.scene, np.inf, replace(end, steady=False, one_of_many=False)
    discrete: Floats | None = None
    fastest = search.largest(search.rates(end.x)[1]) if near else 0.0
    for seconds in RUNS:
        if fastest * seconds > LONGEST_RUN:
            return found
        begin = replace(search.begin, states=end.x)
        span = np.array([search.t, search.t + seconds])
        signals = tuple(search.inputs[: len(scene.model.inputs)].tolist())
        try:
            outcome = integrate(Run(scene, search.numbers, begin, signals, span, 1e-8, None, discrete), Implicit())
            if outcome.status == "left":
                return found
            discrete = outcome.discrete[-1]
            x, held = (outcome.x[-1], None) if scene.relations is None else sticking(search, outcome.x[-1], discrete)
            end = _closed(replace(search, held=held), x)
            if held is not None and not end.steady:  # the directions that are left cannot absorb the rounding errors of the run
                end = _closed(search, x)
            if end.steady:
                change, size = np.abs((end.x - x) / search.scale), np.abs(x / search.scale)
                many = _left_to_motion(search, end.x)
                if (change <= NEAR * (size + 1)).all() if many else not near or change.max() <= LOCAL * size.max():
                    return end
                found = replace(end, one_of_many=True) if many else found
            end, last = replace(end, x=outcome.x[-1], steady=False), left
            left = float(np.abs(search.stationary.T @ search.rates(x)[0]).max())
        except SolverError:
            return found
        if seconds >= 10.0 and left > 0.5 * last:
            break
    return found if found.steady else end


def _left_to_motion(search: Search, x: Floats) -> bool:
    """Whether a steady state is one of many side by side, and only the whole motion tells which of them it comes to.

    Of some it is told by what the rates keep from the start to the end, as a momentum.
    """
    start, events = search.begin.states, search.scene.relations is not None
    if (search.scene.program.is_linear and not events) or (np.abs(x - start) <= SETTLED * np.abs(x)).all():
        return False
    own = replace(search, held=sticking(search, x, search.discrete(x)[:, 0])[1]) if events else search
    equations = SteadyEquations(own, search.rates(x)[1])
    if not equations.open.size:
        return False
    f, gradient = search.rates(start)
    moved = np.column_stack([f, gradient, (x - start) / search.scale])
    size = np.column_stack([np.abs(f), np.abs(gradient), (np.abs(x) + np.abs(start)) / search.scale])
    return bool((np.abs(equations.kept.T @ moved) > SETTLED * (np.abs(equations.kept.T) @ size)).any())


def sticking(search: Search, x: Floats, discrete: Floats) -> tuple[Floats, Floats | None]:
    """States of a run moved to where all relations hold that hold in the run, and the directions in which these would change.

    What locks during a run keeps a slip of the size of the solver's tolerance, with which it would start as sliding.
    """
    scene, relations, n = search.scene, search.scene.relations, len(x)
    assert relations is not None, "something came to rest"
    now, prepared, states = np.array([search.t]), search.numbers.relations, scene.model.discrete_starts
    assert prepared is not None
    first = np.zeros(scene.n_discrete)  # as a run starts: nothing sticks yet, so that speeds count
    if len(states):
        at = scene.model.n_relations
        first[at : at + 2 * len(states)], first[-1] = np.tile(states, 2), 1.0
    guess, before = guess_of(relations.program, search.begin.guess), x
    rows: list[Floats] = []
    for _ in range(5):
        fresh = search.discrete(x)[:, 0]
        steps = 1e-6 * np.maximum(search.scale, np.abs(x))
        beside = np.column_stack([x, x[:, None] + np.diag(steps)])
        many, inputs, starting = (np.repeat(a[:, None], n + 1, axis=1) for a in (now, search.inputs, first))
        slots = evaluate(prepared, many[0], beside, inputs, starting, guess, forgiving=True)
        gaps: list[float] = []
        rows = []
        for phase in relations.event_iteration.event_functions:
            values = batch_values(phase.batch, many[0], slots, search.numbers.parameters, starting)
            slopes = (values[:, 1:] - values[:, :1]) / steps * search.scale
            for k, relation in enumerate(phase.batch.targets.tolist()):
                differs = fresh[relation] != discrete[relation]
                if not np.abs(slopes[k]).max(initial=0.0) > 0 or not (differs or abs(values[k, 0]) <= 2 * MARGIN):
                    continue
                above = (phase.comparison in (">", ">=")) == bool(discrete[relation])
                rows.append(slopes[k])
                gaps.append(float((MARGIN if above else -MARGIN) - values[k, 0]) if differs else 0.0)
        if not np.any(gaps):
            break
        change = np.linalg.lstsq(np.array(rows), np.array(gaps), rcond=None)[0]
        if np.abs(change).max() > NEAR * np.abs(x / search.scale).max():
            return before, None
        x = x + search.scale * change
    held, sizes, _ = np.linalg.svd(np.reshape(rows, (-1, n)).T, full_matrices=False)  # several may hold one direction
    return x, held[:, sizes > SINGULAR * sizes[0]] if rows else None


def _at_rest(search: Search, x: Floats) -> End:
    """Newton's method from where all that fades has vanished: some drags stop a train only in the limit."""
    size = np.abs(x / search.scale)
    change = np.where(size <= LOCAL * np.abs(search.begin.states / search.scale).max(), -x / search.scale, 0.0)
    return _closed(search, x + search.scale * (search.stationary @ (search.stationary.T @ change)))


def _implicit(search: Search, gradient: Floats, step: float) -> Callable[[Floats], Floats]:
    """Linearly implicit Euler: change of the stationary directions over a step, from scaled rates."""
    from scipy.linalg import lu_factor, lu_solve

    stationary = search.stationary
    factors = lu_factor(np.eye(stationary.shape[1]) / step - stationary.T @ gradient @ stationary, check_finite=False)
    return lambda rates: np.asarray(stationary @ lu_solve(factors, stationary.T @ rates, check_finite=False), float)


def _closed(search: Search, x: Floats) -> End:
    """Newton's method down to rounding, and whether its limit is steady.

    It is steady where each rate vanishes up to the rounding of its own terms, or would after a change of the states that is small
    beside these. Components that no equation constrains are not changed.
    """
    last = np.inf
    point: tuple[Floats, Floats, Floats, SteadyEquations]

    def equations(x: Floats) -> tuple[Floats, Correction]:
        nonlocal point
        f, gradient, noise = search.equations(x)
        linear = SteadyEquations(search, gradient)
        point = x, f, noise, linear
        return f, lambda f: -search.scale * linear.change(f)

    def settled(_: Floats, step: Floats, f: Floats) -> bool:
        """Whether the steps are small, shrink no further, or are rounding (of a state at zero they may shrink for ever)."""
        nonlocal last
        last, before = float(np.abs(step / search.scale).max()), last
        return small(step / search.scale) or last >= 0.5 * before

    def small(change: Floats) -> bool:
        x, _, noise, linear = point
        return bool((np.abs(change) <= SETTLED * np.abs(x / search.scale) + linear.largest_change(noise)).all())

    try:
        found = newton(equations, x, settled, 30)
    except SolverError:
        return End(x, False)
    if not found.settled:
        return End(found.x, False)
    x, f, noise, linear = point
    free = not linear.hold(f, noise)
    if free or not small(linear.change(f)) or search.hidden(noise):
        return End(x, False, free)
    discrete, at_end = (search.discrete(y)[:, 0] for y in (x, found.x))
    if search.held is None and (discrete != at_end).any():  # the last step, of the size of rounding, has set off what sticks
        back, held = sticking(search, found.x, discrete)
        if held is not None:
            return _closed(replace(search, held=held), back)
    forbidden = _forbidden(search, found.x)
    return End(found.x, not forbidden and _goes_on(search, found.x), forbidden=forbidden)


def _forbidden(search: Search, x: Floats) -> bool:
    """Whether a step across the locking event of a freewheel has reached an impossible state."""
    return bool(too_small(search.scene, search.numbers, search.t, x, search.inputs, search.begin))


def _goes_on(search: Search, x: Floats) -> bool:
    """Whether the motion is still steady after the growing states have grown."""
    turned = search.grows @ (search.grows.T @ search.rates(x)[0])
    if not turned.any():
        return True
    later = x + search.scale * (turned / np.abs(turned).max()) * LATER
    f, gradient = search.rates(later)
    change = SteadyEquations(search, gradient).change(f)
    return bool((np.abs(change) <= NEAR * np.abs(x / search.scale).max()).all())


class SteadyEquations:
    """Linearised equations for the rates that must vanish, reduced to independent ones."""

    def __init__(self, search: Search, gradient: Floats) -> None:
        self._stationary, self._movable = search.stationary, search.movable
        matrix = self._stationary.T @ gradient @ self._movable
        self._row = np.abs(matrix).max(axis=1, initial=0.0)
        self._row[self._row == 0] = 1.0
        self._column = np.abs(matrix / self._row[:, None]).max(axis=0, initial=0.0)
        self._column[self._column == 0] = 1.0
        left, self._sizes, right = np.linalg.svd(matrix / self._row[:, None] / self._column)
        rank = int((self._sizes > SINGULAR * self._sizes.max(initial=1e-300)).sum())
        self._left, self._right, self._rest = left[:, :rank], right[:rank].T, left[:, rank:]
        self._sizes = self._sizes[:rank]
        self.open = self._movable @ (right[rank:].T / self._column[:, None])  # directions in which no rate changes
        self.kept = self._stationary @ (self._rest / self._row[:, None])  # what does not change, as a momentum
        self._oblique = _oblique(self.open, self.kept)

    def change(self, f: Floats) -> Floats:
        """Change of the states that makes these rates vanish, as far as possible: the one that keeps what they keep.

        Of the rest it is the one of minimum norm.
        """
        row, sizes, column = (a.reshape(-1, *[1] * (f.ndim - 1)) for a in (self._row, self._sizes, self._column))
        solved = self._right @ ((self._left.T @ (self._stationary.T @ f / row)) / sizes)
        change = -np.asarray(self._movable @ (solved / column), float)
        return np.asarray(change - self.along(change), float)

    def along(self, change: Floats) -> Floats:
        """The change in directions in which no rate changes that changes what the rates keep as this one does."""
        return np.asarray(self._oblique @ change, float)

    def hold(self, f: Floats, noise: Floats) -> bool:
        """Whether the rates that no change of the states affects vanish."""
        left, noise = self._stationary.T @ f / self._row, np.abs(self._stationary.T) @ noise / self._row
        return bool((np.abs(self._rest.T @ left) <= np.abs(self._rest.T) @ noise).all())

    def largest_change(self, noise: Floats) -> Floats:
        """Bound on the change of the states that rounding in the rates may cause."""
        solved = np.abs(self._right) @ ((np.abs(self._left.T) @ (np.abs(self._stationary.T) @ noise / self._row)) / self._sizes)
        bound = np.abs(self._movable) @ (solved / self._column)
        return np.asarray(bound + np.abs(self._oblique) @ bound, float)


def _oblique(onto: Floats, across: Floats) -> Floats:
    """Projection onto directions that leaves nothing ``across``, as far as the directions reach it."""
    if not (onto.size and across.size):
        return np.zeros((len(onto), len(onto)))
    onto, across = (a / np.linalg.norm(a, axis=0) for a in (onto, across))
    left, sizes, right = np.linalg.svd(across.T @ onto, full_matrices=False)
    reached = sizes > KEPT
    return np.asarray(onto @ (right[reached].T / sizes[reached]) @ left[:, reached].T @ across.T, float)


def _reason(search: Search, end: End) -> str:
    """Description of what keeps changing, and why."""
    scene = search.scene
    try:
        f = search.rates(end.x)[0]
    except SolverError as problem:
        return f"{problem}; give start values near it: guess={{...}}"
    left = np.abs(search.stationary @ (search.stationary.T @ f))
    worst = int(np.argmax(left))
    where = f"der({node_name(scene.model, scene.states[worst])}) stays at {f[worst] * search.scale[worst]:g}"
    cyclic = _cyclic(search, end.x)
    if cyclic:
        names = [node_name(scene.model, scene.states[i]) for i in cyclic]
        return (
            f"the equations vary with {', '.join(names)}, which would grow for ever, and repeat every turn of two pi; such a train has a "
            "periodic motion instead. Run it until it repeats, and take a moment of that run, or use gearlib.harmonic_balance"
        )
    if end.free:
        return (
            f"{where}, and no speed, angle or deflection has an effect on that; a load that grows with the speed is missing there (a "
            "damper to the housing, a fan, a speed-dependent torque), or the torques must balance"
        )
    return (
        f"{where} where the search ended; no state is known near it at which the loads balance the drive. Start nearer to one "
        "(guess={...}), or run the train to see where it goes"
    )


def _cyclic(search: Search, x: Floats) -> list[int]:
    """Angles in which the rates are periodic and that grow in an otherwise steady motion."""
    scene, model = search.scene, search.scene.model
    found = []
    for i, (v, k) in enumerate(scene.states):
        if k or model.unit(v) != "rad" or not (search.grows[i] == 0).all():
            continue
        turn = np.zeros(len(x))
        turn[i] = 2 * np.pi
        try:
            f, there = search.rates(x)[0], search.rates(x + turn)[0]
        except SolverError:
            continue
        if np.abs(there - f).max() <= NEAR * np.abs(f).max():
            found.append(i)
    if not found:
        return []
    more = np.linalg.qr(np.hstack([search.grows, np.eye(len(x))[:, found]]))[0]
    other = replace(search, grows=more)
    f = other.rates(_found(other).x)[0]
    return [i for i in found if abs(f[i]) > NEAR * np.abs(f).max()]
