"""Choice of the integrator, and one interface to all: exact for linear scenes, Runge-Kutta and IDA for the others."""

from __future__ import annotations

import ctypes
import math
import time as clock
import warnings
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError, SolverError
from gearlib.native.layout import EACH, Shared, operations
from gearlib.native.scene_functions import NativeScene
from gearlib.program.interpret import owner_of
from gearlib.run.linear_form import linear_form
from gearlib.run.scene import Numbers, Scene, settle_once
from gearlib.run.start_values import Start
from gearlib.solvers.alternation import Leg, alternate
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.drive.driver import integrate as to_the_end
from gearlib.solvers.inputs.callback import Keep, feed
from gearlib.solvers.inputs.table import Table, breakpoints, values
from gearlib.solvers.problem import Effort, Native, Problem, Solution
from gearlib.solvers.rungekutta.rungekutta import RungeKutta

Floats = NDArray[np.float64]
BY_TURNS = "rk and ida"  # as "auto" does where a scene is not linear
METHODS = ("auto", "exact", "ida", "rk", "rk5", "rk8")
MOST_STEPS = 100_000_000
MOST_STEPS_CONSTRAINED = 500_000  # with nonlinear constraints: near a point where these are singular the steps shrink for ever
LARGEST_EXACT = 30_000  # states
MOST_CORNERED = 40  # states up to which tables are gone through from corner to corner with dense exponentials
LATE = 100.0  # times its length after zero a run has a clock that is coarse beside its steps
COUNTED = ("steps", "attempts", "rejected", "rhs", "jac", "events", "restarts", "work")  # over the legs of a run
LEAST_STEPS = 100  # that a run is thought to take before it is known how many
ORDERS = {"rk5": 5, "rk8": 8}
# Of tables: points from which on a pilot of so many steps of order 5 shows whether that suffices, and what its wanted step must then
# be beside the steps that the points leave
MANY_CORNERS, PILOT, CUT = 1000, 100, 0.6
FEW_CORNERS = 50  # of tables, up to which nothing is to be gained by a choice
SLOW_CORNER = 3e-4  # s, of a table that drives more states
# Measured, s: a step of Runge-Kutta and its part for each slot of the program; and how many radians of the fastest motion it spans
RK_STEP, RK_SLOT, REACH_OF_A_STEP = 1.5e-6, 3e-8, 3.0
# Measured, ns: of a native function's call, of an addition in it, of a Python function and of a table among its inputs
CALL, ADDITION, CALLBACK, LOOK_UP = 15.0, 0.3, 1500.0, 30.0


@dataclass(frozen=True)
class Run:
    """One integration: scene, numbers, start, inputs, times and tolerances."""

    scene: Scene
    numbers: Numbers
    start: Start
    signals: tuple[Any, ...]
    times: Floats
    rtol: float
    atol: Floats | None
    modes: Floats | None = None  # relations and discrete variables to begin with, where a run goes on
    max_step: float | None = None  # s
    slots: Floats | None = None  # of the scene's program, where a run goes on: its branch of nonlinear equations

    @property
    def longest_step(self) -> float:
        """What no event and no pulse that lasts longer is stepped over by.

        Where there are events that are searched for, a hundredth of the run by default; where time drives the scene, two sample
        intervals as well: a pulse between two steps would not be noticed.
        """
        if self.max_step is not None:
            return self.max_step
        scene, share = self.scene, 0.01 * float(self.times[-1] - self.times[0]) or math.inf
        if self.driven:
            return min(2.0 * float(np.diff(self.times).max(initial=0.0)), share) or math.inf
        return share if scene.relations is not None and not scene.relations.on_time.all() else math.inf

    @property
    def driven(self) -> bool:
        """Whether time drives the scene, other than by tables."""
        programs = [self.scene.program, *([self.scene.relations.program] if self.scene.relations is not None else [])]
        return any(p.on_time for p in programs) or any(map(_is_function, self.signals))

    def coarse_clock(self, steps: int) -> str:
        """What is to be said of a run that begins late, where time drives it and is known no better than the tolerance; or nothing."""
        late, span = float(np.abs(self.times[[0, -1]]).max()), float(self.times[-1] - self.times[0])
        resolution = math.ulp(late)
        if span == 0.0 or late < LATE * span or not self.driven or resolution <= self.rtol * span / max(steps, LEAST_STEPS):
            return ""
        return (
            f"at t = {late:.6g} s the clock's resolution is {resolution:.2g} s, too coarse for rtol={self.rtol:g}: what time drives is "
            "known no better than that. Let the run start at 0 and add the offset to the time of the drive's own expression, or allow "
            "a larger rtol"
        )

    @property
    def still(self) -> bool:
        """Whether nothing has a memory: no state, no discrete variable."""
        return not self.scene.states and (self.scene.relations is None or not self.scene.relations.discretes)


@dataclass(frozen=True)
class Left:
    """State of a run that stopped because its state set became singular."""

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
    elif method == BY_TURNS:
        outcome = _native(run, "rk", "asked for", hand_over=True)
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
            reason = _too_many_corners(run, form)
            if reason is None:
                return _exact(run, form, "the scene is linear and time-invariant")
            form = reason
        except SolverError as problem:
            form = str(problem)
    if run.start.steady and not run.driven and not any(isinstance(s, Table) for s in run.signals):
        # Stability limits explicit steps even where nothing moves, and what rounding excites then grows to the tolerance.
        return _native(run, "ida", f"{form}; the run begins in a steady state, which nothing leaves with time")
    return _native(run, "rk", form, hand_over=True)


@dataclass(frozen=True, eq=False)
class _Form:
    """A linear scene, and what drives it: tables from corner to corner where states are few, the rest recognised."""

    linear: Any
    cornered: tuple[int, ...]  # the inputs that go from corner to corner, and
    cuts: Any  # the intervals there
    forcing: Any  # of the other inputs; None where they are constant


def _exact_form(run: Run) -> _Form | str:
    scene = run.scene
    if len(scene.states) > LARGEST_EXACT:
        return f"{len(scene.states)} states are too many for an exponential"
    linear = linear_form(scene, run.numbers, run.signals)
    if isinstance(linear, str):
        return linear
    from gearlib.solvers.exponential.forcing import NotExact

    inputs, cuts = linear.inputs, None
    cornered: tuple[int, ...] = ()
    tables = [u for u in inputs if isinstance(u, Table)]
    if tables and len(scene.states) <= MOST_CORNERED:
        from gearlib.solvers.exponential.corners import Intervals

        cornered = tuple(k for k, u in enumerate(inputs) if isinstance(u, Table) or u.is_number)
        cuts = Intervals.of(run.times, tables)
        inputs = tuple(u for k, u in enumerate(inputs) if k not in cornered)
        if not inputs:
            return _Form(linear, cornered, cuts, None)
    forcing = _recognised(inputs, float(run.times[0]), float(run.times[-1]))
    if isinstance(forcing, NotExact):
        return forcing.reason
    return _Form(linear, cornered, cuts, forcing)


def _too_many_corners(run: Run, form: _Form) -> str | None:
    """The reason to leave tables to Runge-Kutta, which takes a step from one corner to the next, if that is faster."""
    corners = len(breakpoints(run.signals))
    if corners <= FEW_CORNERS:
        return None
    n, linear = len(run.scene.states), form.linear
    if form.cuts is None:
        exact_seconds, rate = corners * SLOW_CORNER, 0.0
    else:
        from gearlib.solvers.exponential.dense import balanced_norm

        rate = balanced_norm(np.asarray(linear.A if isinstance(linear.A, np.ndarray) else linear.A.toarray()))
        exact_seconds = min(form.cuts.costs(n, len(form.cornered), rate))
    steps = corners + rate * float(run.times[-1] - run.times[0]) / REACH_OF_A_STEP
    seconds = steps * (RK_STEP + RK_SLOT * run.scene.program.n_slots)
    if exact_seconds <= 1.2 * seconds:
        return None
    return (
        f"a table has {corners} points: exponentials from one to the next are estimated to take {exact_seconds:.2g} s, steps "
        f"of Runge-Kutta {seconds:.2g} s"
    )


_prepared: WeakKeyDictionary[Any, tuple[Any, ...]] = WeakKeyDictionary()  # linear form -> key, exponentials, forcing


@lru_cache(maxsize=256)
def _recognised(inputs: tuple[Any, ...], t0: float, t1: float) -> Any:
    """The inputs as outputs of linear systems; the same inputs come again with every other set of parameters."""
    from gearlib.solvers.exponential.forcing import recognise

    return recognise(inputs, t0, t1)


def _exact(run: Run, form: _Form | None, why: str) -> Outcome:
    n = len(run.scene.states)
    states = np.zeros((len(run.times), n))
    if form is not None:
        B, start = form.linear.B, run.start.states
        if form.forcing is not None:
            from gearlib.solvers.exponential import exact

            key = (id(form.forcing), run.times.tobytes(), run.rtol)
            known = _prepared.get(form.linear)
            if known is None or known[0] != key:
                smooth = [k for k in range(len(form.linear.inputs)) if k not in form.cornered]
                ready = exact.prepare(form.linear.A, B[:, smooth], form.forcing, run.times, rtol=min(run.rtol, 1e-9))
                known = _prepared[form.linear] = (key, ready, form.forcing)
            states, start = known[1].solve(start), np.zeros(n)
        if form.cuts is not None:  # linear: what each drives may be added
            from gearlib.solvers.exponential import corners

            A = form.linear.A if isinstance(form.linear.A, np.ndarray) else form.linear.A.toarray()
            drive = [u if isinstance(u, Table) else float(u) for u in (form.linear.inputs[k] for k in form.cornered)]
            states = states + corners.solve(A, B[:, form.cornered], drive, start, run.times, form.cuts)
    flags = run.scene.modes(run.numbers, run.times, states.T, values(run.signals, run.times, len(run.scene.program.inputs)))
    stats = {"method": "exact", "why": why, "states": n, "steps": 0, "rhs": 0, "events": 0}
    return Outcome(states, flags.T, [], stats)


def _native(run: Run, method: str, why: str, hand_over: bool = False) -> Outcome:
    scene = run.scene
    if run.still:
        return _exact(run, None, "there are no states")
    if not scene.states:  # events only: any method steps from one to the next
        method, why, hand_over = "rk", "there are no states, but discrete variables", False
    keep = Keep()
    try:
        with keep.listening() if any(map(_is_function, run.signals)) else nullcontext():
            if hand_over:
                outcome = _alternating(run, keep, why)
            else:
                outcome = _outcome(run, to_the_end(_driver(run, keep, method)), method, why)
    except SolverError as problem_:
        raise keep.failure() or _explained(problem_, scene) from None
    failure = keep.failure()
    if failure is not None:
        raise failure
    return outcome


def _is_function(signal: Any) -> bool:
    return callable(signal) and not isinstance(signal, Table)


def _driver(run: Run, keep: Keep, method: str) -> Driver:
    """A run on its way with a method."""
    if method == "ida":
        from gearlib.solvers.ida.ida import ida

        return Driver(_problem(run, keep, jacobian=True), ida())
    problem = _problem(run, keep, jacobian=False)
    return Driver(problem, RungeKutta(_order(run, problem, method)))


def _order(run: Run, problem: Problem, method: str) -> int:
    """The order of Runge-Kutta: by tolerance, but 5 where tables cut the steps so short that a higher one is of no use."""
    if method in ORDERS or run.rtol >= 1e-6:
        return ORDERS.get(method, 5)
    if len(problem.time_events) < MANY_CORNERS:
        return 8
    stepper = RungeKutta(5)
    pilot = Driver(problem, stepper)
    pilot.advance(PILOT)
    return 5 if stepper.wanted >= CUT * (pilot.t - run.times[0]) / PILOT else 8


def _alternating(run: Run, keep: Keep, why: str) -> Outcome:
    """Integrate with Runge-Kutta, and with IDA where that gets on faster."""
    from gearlib.solvers.ida.ida import ida
    from gearlib.solvers.ida.ida_stepper import trial

    start = _problem(run, keep, jacobian=False)
    order = _order(run, start, "rk")

    def explicit(legs: Sequence[Leg]) -> tuple[Driver, RungeKutta]:
        stepper = RungeKutta(order)
        return Driver(_problem(_rest(run, legs), keep, jacobian=False) if legs else start, stepper), stepper

    def implicit(legs: Sequence[Leg]) -> Driver:
        return Driver(_problem(_rest(run, legs), keep, jacobian=True), ida())

    return _joined(run, alternate(explicit, implicit, trial(start), float(run.times[-1])), why)


def _wanted(run: Run, legs: Sequence[Leg]) -> list[slice]:
    """The samples of each leg that are the run's: a leg begins where the one before ended, which may be no sample, or one more time."""
    found, done = [], 0
    for leg in legs:
        t = leg.solution.t
        first = 0 if done < len(run.times) and len(t) and t[0] == run.times[done] else 1
        found.append(slice(first, None))
        done += len(t) - first
    return found


def _rest(run: Run, legs: Sequence[Leg]) -> Run:
    """What is left of a run after some legs."""
    if not legs:
        return run
    scene, last = run.scene, legs[-1]
    done = sum(len(leg.solution.t[wanted]) for leg, wanted in zip(legs, _wanted(run, legs), strict=True))
    t, times = last.solution.t_last, run.times[done:]
    if not len(times) or times[0] > t:
        times = np.concatenate([[t], times])
    slots, held = _memory(scene, scene.native if last.method == "explicit" else scene.native_with_jacobian, last.solution)
    start, longest = replace(run.start, states=last.solution.x_last[: len(scene.states)]), run.longest_step
    return replace(
        run, start=start, times=times, modes=held, slots=slots, max_step=longest if longest < math.inf else None
    )  # fmt: skip


def _joined(run: Run, legs: Sequence[Leg], why: str) -> Outcome:
    """One outcome of all legs."""
    last = legs[-1]
    outcome = _outcome(run, last.solution, "ida" if last.method == "implicit" else "rk", why)
    if len(legs) == 1:
        return outcome
    wanted = _wanted(run, legs)
    n = len(run.scene.states)
    states = np.vstack([leg.solution.x[part, :n] for leg, part in zip(legs, wanted, strict=True)])
    modes = np.vstack([leg.solution.modes[part] for leg, part in zip(legs, wanted, strict=True)])
    stats = dict(outcome.stats)
    for counted in COUNTED:
        counts = [leg.solution.stats.get(counted, 0) for leg in legs]
        if counted in stats:  # scikit-sundae cannot tell the steps
            stats[counted] = None if None in counts else sum(counts)
    stats["why"] = f"{why}; {_told(legs)}"
    events = [event for leg in legs for event in _events(run, leg.solution)]
    return Outcome(states, modes, events, stats, outcome.left)


def _told(legs: Sequence[Leg]) -> str:
    """Which method went from where to where."""
    first, second = legs[0].solution, legs[1]
    text = f"explicit Runge-Kutta met stiffness at t = {first.t_last:.6g} s"
    stayed = sum(leg.method == "implicit" and leg.stayed for leg in legs)
    tried = sum(leg.method == "implicit" and not leg.stayed for leg in legs)
    if stayed and second.stayed:
        text += " and handed over to IDA"
    elif stayed:
        text += ", and handed over to IDA later on"
    backs = stayed - (legs[-1].method == "implicit")
    if backs:
        text += f", which handed back {'once' if backs == 1 else f'{backs} times'} where it was the slower one"
    if tried:
        text += f"; IDA was tried {'once' if tried == 1 else f'{tried} times'} and would have taken longer"
    return text


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


def _outcome(run: Run, solution: Solution, method: str, why: str) -> Outcome:
    if not np.isfinite(solution.x).all():
        bad = int(np.argmax(~np.isfinite(solution.x).all(axis=1)))
        raise SolverError(f"the solution is not finite at t = {solution.t[bad]:g} s")
    stats = {
        "method": method,
        "why": why,
        "states": len(run.scene.states),
        **solution.stats,
    }
    if said := run.coarse_clock(int(stats.get("steps") or 0)):
        warnings.warn(said, RuntimeWarning, stacklevel=2)
    stats["method"] = method if method == "ida" else f"rk{solution.stats.get('order', '')}"
    left = None
    if solution.status == "left":
        native = run.scene.native_with_jacobian if method == "ida" else run.scene.native
        failure = SolverError(f"the right-hand side cannot be evaluated beyond t = {solution.t_last:.9g} s")
        left = Left(
            solution.t_last, solution.x_last, *_memory(run.scene, native, solution), _explained(failure, run.scene)
        )  # fmt: skip
    return Outcome(solution.x[:, : len(run.scene.states)], solution.modes, _events(run, solution), stats, left)


def _memory(scene: Scene, native: NativeScene, solution: Solution) -> tuple[Floats, Floats]:
    """Slots and modes where a run ended: its branch of nonlinear equations, and friction's mode, are not forgotten."""
    data = solution.data
    slots = data[native.rhs.layout.slots :][: scene.program.n_slots]
    modes = data[native.shared.relations :][: native.shared.n_relations]
    return slots.copy(), modes.copy()


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
    for t, number in _switches(run):
        found.setdefault(t, []).append(run.scene.relation_names[number])
    return {t: "; ".join(dict.fromkeys(names)) for t, names in found.items()}


def _switches(run: Run) -> list[tuple[float, int]]:
    """When the conditions in time switch after the start, and which; what does so within rounding of the end does so there."""
    from gearlib.equations.switch_times import rounding

    t0, t1 = float(run.times[0]), float(run.times[-1])
    found = run.scene.time_switches(run.numbers.parameters, t0, t1 + 2.0 * rounding(t0, t1))
    return [(min(t, t1), number) for t, number in found]


def _problem(run: Run, keep: Keep, jacobian: bool) -> Problem:
    scene = run.scene
    native: NativeScene = scene.native_with_jacobian if jacobian else scene.native
    t0 = float(run.times[0])
    program = scene.program
    inputs = values(run.signals, run.times[:1], len(program.inputs))[:, 0]
    modes = run.modes
    if modes is None:
        modes = scene.modes(run.numbers, run.times[:1], run.start.states[:, None], inputs[:, None], start=run.start.guess)[:, 0]
    data = scene.data(native, run.numbers, inputs, modes, run.start.guess, run.slots)
    functions: dict[str, Any] = {name: getattr(native, name) for name in ("rhs", "jac", "roots", "update")}
    index = native.index
    tables = [(k, s) for k, s in enumerate(run.signals) if isinstance(s, Table)]
    if program.guards and any((np.diff(table.t) == 0.0).any() for _, table in tables):
        # a divisor may jump over zero with its input: no numerator is large beside infinity
        data[native.rhs.layout.guards :][: EACH * program.n_guards].reshape(-1, EACH)[:, 1] = np.inf
    if tables:
        from gearlib.solvers.inputs.table_lookup import fed

        functions, data, index = fed(native, data, tables)
    moving = [(k, s) for k, s in enumerate(run.signals) if _is_function(s)]

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
        culprit=partial(_culprit, run, native.shared), effort=_effort(scene, native, len(moving), len(tables)),
        times=run.times, rtol=run.rtol, atol=run.atol if scene.states else None,
        max_steps=MOST_STEPS_CONSTRAINED if program.iterated else MOST_STEPS, may_leave=any(s.constrained for s in program.iterated),
    )  # fmt: skip
    return problem


def _effort(scene: Scene, native: NativeScene, functions: int, tables: int) -> Effort:
    """What a call of each native function costs."""
    call = CALL + CALLBACK * functions + LOOK_UP * tables
    rhs = ADDITION * operations(scene.program, native.rhs.layout)
    entries = 0.0 if native.pattern is None else native.pattern.size
    relations = 0.0
    if scene.relations is not None and native.update is not None:
        relations = ADDITION * operations(scene.relations.program, native.update.layout)
    return Effort(call + rhs, call + 3.0 * rhs + 4.0 * ADDITION * entries, call + relations, call + 3.0 * relations)


def _culprit(run: Run, shared: Shared, t: float, x: Floats, data: Floats) -> str:
    """What cannot be evaluated where a run ended."""
    from gearlib.run.refusals.blame import culprit

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


def _time_events(run: Run, t0: float, t1: float) -> Floats:
    """Known times to step to exactly, after the start; at the end only where something may happen there."""
    found = breakpoints(run.signals)
    last = t1 if run.scene.relations is not None else math.nextafter(t1, t0)
    found = found[(found > t0) & (found <= last)]
    switches = _switches(run)
    return np.unique(np.concatenate([found, [t for t, _ in switches]])) if switches else found
