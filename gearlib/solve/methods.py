"""One interface to the integrators: exact for linear scenes, Runge-Kutta and IDA for the others, and the choice between them."""

from __future__ import annotations

import ctypes
import math
import time as clock
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from gearlib.codegen.evaluate import owner_of
from gearlib.codegen.layout import Shared
from gearlib.codegen.native import NativeScene
from gearlib.errors import ArgumentError, SolverError
from gearlib.solve.feed import Keep, feed
from gearlib.solve.initialize import Start
from gearlib.solve.lti import linear_form, time_conditions
from gearlib.solve.problem import Native, Problem, Solution
from gearlib.solve.scene import Numbers, Scene, settle_once
from gearlib.solve.table import Table, breakpoints, values

Floats = NDArray[np.float64]
METHODS = ("auto", "exact", "ida", "rk", "rk5", "rk8")
MOST_STEPS = 100_000_000
MOST_STEPS_CONSTRAINED = 500_000  # with nonlinear constraints: near a point where these are singular the steps shrink for ever
LARGEST_EXACT = 30_000  # states


@dataclass(frozen=True)
class Run:
    """What is to be integrated, from when to when, and how accurately."""

    scene: Scene
    numbers: Numbers
    start: Start
    signals: tuple[Any, ...]
    times: Floats
    rtol: float
    atol: Floats | None
    modes: Floats | None = None  # relations and discrete variables to begin with, where a run goes on
    max_step: float | None = None  # s

    @property
    def longest_step(self) -> float:
        """What no event and no pulse that lasts longer is stepped over by.

        Where there are events that are searched for, a hundredth of the run by default; where time drives the scene, two sample
        intervals as well: a pulse between two steps would not be noticed.
        """
        if self.max_step is not None:
            return self.max_step
        scene, share = self.scene, 0.01 * float(self.times[-1] - self.times[0]) or math.inf
        driven = scene.program.on_time or (scene.relations is not None and scene.relations.program.on_time)
        if driven or any(callable(s) and not isinstance(s, Table) for s in self.signals):
            return min(2.0 * float(np.diff(self.times).max(initial=0.0)), share) or math.inf
        return share if scene.relations is not None and not scene.relations.on_time.all() else math.inf

    @property
    def still(self) -> bool:
        """Whether nothing has a memory: no state, no discrete variable."""
        return not self.scene.states and (self.scene.relations is None or not self.scene.relations.discretes)


@dataclass(frozen=True)
class Left:
    """Where a run ended because its states do not determine the motion further on."""

    t: float
    x: Floats
    slots: Floats  # of the scene's program, there
    modes: Floats
    failure: SolverError  # to be raised where no other states do


@dataclass(frozen=True)
class Outcome:
    """States and relation values at the times (up to where the run ended), events and statistics."""

    states: Floats
    relations: Floats
    events: list[Any]
    stats: dict[str, Any]
    left: Left | None = None


def integrate(run: Run, method: str) -> Outcome:
    """Integrate with a method, or with the one that fits.

    Raises
    ------
    ArgumentError
        A method that cannot do this scene.
    SolverError
        The integration failed.
    """
    begin = clock.perf_counter()
    if method == "auto":
        outcome = _automatic(run)
    elif method == "exact":
        form = None if run.still else _exact_form(run)
        if isinstance(form, str):
            raise ArgumentError(f"method='exact' needs a linear time-invariant scene: {form}; use method='auto', 'rk' or 'ida'")
        outcome = _exact(run, form, "asked for")
    elif method == "ida":
        outcome = _native(run, "ida", "asked for")
    else:
        outcome = _native(run, method, "asked for")
    outcome.stats["seconds"] = clock.perf_counter() - begin
    return outcome


def _automatic(run: Run) -> Outcome:
    if run.still:
        return _exact(run, None, "there are no states")
    form = _exact_form(run)
    if not isinstance(form, str):
        try:
            return _exact(run, form, "the scene is linear and time-invariant")
        except SolverError as problem:
            form = str(problem)
    return _native(run, "rk", form, hand_over=True)


def _exact_form(run: Run) -> Any:
    if len(run.scene.states) > LARGEST_EXACT:
        return f"{len(run.scene.states)} states are too many for an exponential"
    form = linear_form(run.scene, run.numbers, run.signals)
    if isinstance(form, str):
        return form
    from gearlib.solve.forcing import NotExact

    forcing = _recognised(form.inputs, float(run.times[0]), float(run.times[-1]))
    if isinstance(forcing, NotExact):
        return forcing.reason
    return form, forcing


_prepared: WeakKeyDictionary[Any, tuple[Any, ...]] = WeakKeyDictionary()  # linear form -> key, exponentials, forcing


@lru_cache(maxsize=256)
def _recognised(inputs: tuple[Any, ...], t0: float, t1: float) -> Any:
    """The inputs as outputs of linear systems; the same inputs come again with every other set of parameters."""
    from gearlib.solve.forcing import recognise

    return recognise(inputs, t0, t1)


def _exact(run: Run, form: Any, why: str) -> Outcome:
    n = len(run.scene.states)
    if form is None:
        states = np.zeros((len(run.times), 0))
    else:
        from gearlib.solve import exact

        linear, forcing = form
        key = (id(forcing), run.times.tobytes(), run.rtol)
        known = _prepared.get(linear)
        if known is None or known[0] != key:
            known = (key, exact.prepare(linear.A, linear.B, forcing, run.times, rtol=min(run.rtol, 1e-9)), forcing)
            _prepared[linear] = known
        states = known[1].solve(run.start.states)
    flags = run.scene.modes(run.numbers, run.times, states.T, values(run.signals, run.times, len(run.scene.program.inputs)))
    stats = {"method": "exact", "why": why, "states": n, "steps": 0, "rhs": 0, "events": 0}
    return Outcome(states, flags.T, [], stats)


def _native(run: Run, method: str, why: str, hand_over: bool = False) -> Outcome:
    scene = run.scene
    if run.still:
        return _exact(run, None, "there are no states")
    if not scene.states:  # events only: any method steps from one to the next
        method, why, hand_over = "rk", "there are no states, but discrete variables", False
    problem, keep = _problem(run, jacobian=method == "ida")
    try:
        with keep.listening() if keep.callbacks else nullcontext():
            solution = _solved(run, problem, method, hand_over)
    except SolverError as problem_:
        raise keep.failure() or _explained(problem_, scene) from None
    failure = keep.failure()
    if failure is not None:
        raise failure
    if solution.status == "stiff":
        return _continue(run, solution, why)
    return _outcome(run, solution, method, why)


def _solved(run: Run, problem: Problem, method: str, hand_over: bool) -> Solution:
    """Hand a problem to an integrator."""
    iterated, atol = run.scene.program.iterated, run.atol if run.scene.states else None
    most, constrained = MOST_STEPS_CONSTRAINED if iterated else MOST_STEPS, any(s.constrained for s in iterated)
    if method == "ida":
        from gearlib.solve import ida

        return ida.integrate(problem, run.times, rtol=run.rtol, atol=atol, max_steps=most, may_leave=constrained)
    from gearlib.solve import rungekutta

    order = {"rk5": 5, "rk8": 8}.get(method) or (8 if run.rtol < 1e-6 else 5)
    return rungekutta.integrate(
        problem, run.times, rtol=run.rtol, atol=atol, order=order, detect_stiffness=hand_over, max_steps=most,
        may_leave=constrained,
    )  # fmt: skip


def _explained(problem: SolverError, scene: Scene) -> SolverError:
    """The same error; where nonlinear equations are solved on the way, with a word on these."""
    iterated = scene.program.iterated
    owners = dict.fromkeys(owner_of(scene.structure, int(e)) for s in iterated for e in s.equations)
    if not owners or "chatter" in str(problem):
        return problem
    names = ", ".join(owners)
    if not any(s.constrained for s in iterated):
        return SolverError(
            f"{problem}. The nonlinear equations of {names} may have no solution further on, or need better guesses: guess={{...}} of "
            "their variables"
        )
    return SolverError(
        f"{problem}. The constraints of {names} may have become singular there for the states in use "
        f"({', '.join(scene.state_names[:6])}): start nearer to the end, or declare other variables as state='prefer'"
    )


def _continue(run: Run, first: Solution, why: str) -> Outcome:
    """Go on with IDA from where the explicit method met stiffness."""
    done = int(np.searchsorted(run.times, first.t_last, side="left"))
    done = min(done, len(first.t))
    later = np.concatenate([[first.t_last], run.times[done:]])
    start = replace(run.start, states=first.x_last)
    held = None
    if "data" in first.stats:  # friction does not forget its mode
        shared = run.scene.native.shared
        held = first.stats["data"][shared.relations : shared.relations + shared.n_relations]
    rest = _native(replace(run, start=start, times=later, modes=held), "ida", why)
    states = np.vstack([first.x[:done], rest.states[1:]])
    modes = np.vstack([first.modes[:done], rest.relations[1:]])
    stats = dict(rest.stats)
    stats["why"] = f"{why}; explicit Runge-Kutta met stiffness at t = {first.t_last:.6g} s and handed over to IDA"
    for counted in ("steps", "rhs"):  # scikit-sundae cannot tell the steps
        stats[counted] = None if rest.stats.get(counted) is None else int(first.stats[counted]) + int(rest.stats[counted])
    return Outcome(states, modes, [*_events(run, first), *rest.events], stats, rest.left)


def _outcome(run: Run, solution: Solution, method: str, why: str) -> Outcome:
    if not np.isfinite(solution.x).all():
        bad = int(np.argmax(~np.isfinite(solution.x).all(axis=1)))
        raise SolverError(f"the solution is not finite at t = {solution.t[bad]:g} s")
    stats = {
        "method": method,
        "why": why,
        "states": len(run.scene.states),
        **{k: v for k, v in solution.stats.items() if k != "data"},
    }
    stats["method"] = method if method == "ida" else f"rk{solution.stats.get('order', '')}"
    left = None
    if solution.status == "left":
        data, native = solution.stats["data"], run.scene.native_with_jacobian if method == "ida" else run.scene.native
        slots = data[native.rhs.layout.slots :][: run.scene.program.n_slots]
        modes = data[native.shared.relations :][: native.shared.n_relations]
        failure = SolverError(f"the right-hand side cannot be evaluated beyond t = {solution.t_last:.9g} s")
        left = Left(solution.t_last, solution.x_last, slots.copy(), modes.copy(), _explained(failure, run.scene))
    return Outcome(solution.x[:, : len(run.scene.states)], solution.modes, _events(run, solution), stats, left)


def _events(run: Run, solution: Solution) -> list[Any]:
    """Time, and component with equation, of each event."""
    relations = run.scene.relations
    if relations is None or not len(solution.event_times):
        return []
    names, times, roots = run.scene.root_names, solution.event_times.tolist(), solution.event_roots.tolist()
    if min(roots) >= 0:
        return list(zip(times, map(names.__getitem__, roots), strict=True))
    timed = _names_of_time_events(run)
    return [(t, names[r] if r >= 0 else timed.get(t, "an input")) for t, r in zip(times, roots, strict=True)]


def _names_of_time_events(run: Run) -> dict[float, str]:
    """Component and equation of what switches at a time, all of them where there are several."""
    found: dict[float, list[str]] = {}
    for number, condition in time_conditions(run.scene, run.numbers):
        for t in _switches(condition, float(run.times[0]), float(run.times[-1])).tolist():
            found.setdefault(t, []).append(run.scene.relation_names[number])
    return {t: "; ".join(dict.fromkeys(names)) for t, names in found.items()}


def _problem(run: Run, jacobian: bool) -> tuple[Problem, Keep]:
    scene = run.scene
    native: NativeScene = scene.native_with_jacobian if jacobian else scene.native
    t0 = float(run.times[0])
    program = scene.program
    inputs = values(run.signals, run.times[:1], len(program.inputs))[:, 0]
    modes = run.modes
    if modes is None:
        modes = scene.modes(run.numbers, run.times[:1], run.start.states[:, None], inputs[:, None])[:, 0]
    data = scene.data(native, run.numbers, inputs, modes, scene.guess(program, run.start.guess))
    keep = Keep()
    functions: dict[str, Any] = {name: getattr(native, name) for name in ("rhs", "jac", "roots", "update")}
    index = native.index
    tables = [(k, s) for k, s in enumerate(run.signals) if isinstance(s, Table)]
    if tables:
        from gearlib.solve.table_feed import fed

        functions, data, index = fed(native, data, tables)
    moving = [(k, s) for k, s in enumerate(run.signals) if callable(s) and not isinstance(s, Table)]

    def wrap(name: str, third: Any) -> Native | None:
        function = functions[name]
        return feed(function, native.shared, moving, keep, third) if function is not None and moving else function

    double = ctypes.POINTER(ctypes.c_double)
    fired = ctypes.POINTER(ctypes.c_int32)
    relations = scene.relations
    n_roots = int((~relations.on_time).sum()) if relations is not None else 0
    pattern = native.pattern
    nothing = np.ones(0 if scene.states else 1)  # the integrators need a state: without any, one that stands still
    problem = Problem(
        rhs=wrap("rhs", double), x0=np.append(run.start.states, nothing), data=data, index=index,  # type: ignore[arg-type]
        differential=np.ones(max(len(scene.states), 1), bool), nominal=np.append(scene.nominal, nothing), jac=wrap("jac", double),
        jac_indptr=None if pattern is None else pattern.indptr, jac_indices=None if pattern is None else pattern.indices,
        roots=wrap("roots", double) if n_roots else None, n_roots=n_roots, update=wrap("update", fired),
        modes=slice(native.shared.relations, native.shared.relations + native.shared.n_relations),
        time_events=_time_events(run, t0, float(run.times[-1])), longest_step=run.longest_step,
        state_names=scene.state_names, root_names=scene.root_names, unsettled=partial(_unsettled, run, native.shared),
        culprit=partial(_culprit, run, native.shared),
    )  # fmt: skip
    return problem, keep


def _culprit(run: Run, shared: Shared, t: float, x: Floats, data: Floats) -> str:
    """What cannot be evaluated where a run ended."""
    from gearlib.solve.blame import culprit

    modes = data[shared.relations :][: shared.n_relations].copy()
    inputs = values(run.signals, np.array([t]), shared.n_inputs)[:, 0]
    span = float(run.times[-1] - run.times[0])
    return culprit(run.scene, run.numbers, t, span, x[: len(run.scene.states)], inputs, modes)


def _unsettled(run: Run, shared: Shared, t: float, x: Floats, data: Floats) -> str:
    """Relations and discrete variables that an event iteration which failed would change once more."""
    scene, n = run.scene, run.scene.model.n_relations
    if scene.relations is None or run.numbers.relations is None:
        return ""
    modes = data[shared.relations :][: shared.n_relations, None]
    inputs = data[shared.inputs :][: shared.n_inputs, None]
    new = settle_once(scene.relations, run.numbers.relations, np.array([t]), x[: len(scene.states), None], inputs, modes)
    places = np.flatnonzero((new != modes)[:, 0]).tolist()
    names = [scene.model.discretes.names[i - n] for i in places if i >= n]
    return ", ".join(names) or "; ".join(dict.fromkeys(scene.relation_names[i] for i in places))


def _switches(condition: Any, t0: float, t1: float) -> Floats:
    """The times after ``t0`` at which a condition of time switches; what does so within rounding of the end does so there."""
    from gearlib.solve.switches import rounding, times_of_breakpoints

    return np.minimum(times_of_breakpoints(condition, t0, t1 + 2.0 * rounding(t0, t1)), t1)


def _time_events(run: Run, t0: float, t1: float) -> Floats:
    """Known times to step to exactly, after the start; at the end only where something may happen there."""
    tables, conditions = breakpoints(run.signals), time_conditions(run.scene, run.numbers)
    last = t1 if run.scene.relations is not None else math.nextafter(t1, t0)
    tables = tables[(tables > t0) & (tables <= last)]
    return np.unique(np.concatenate([tables, *(_switches(c, t0, t1) for _, c in conditions)])) if conditions else tables
