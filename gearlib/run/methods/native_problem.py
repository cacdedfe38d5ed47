"""`Problem` of a run, from its scene's native code and numbers; its solution translated back to the scene's names."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.native.layout import EACH, Shared, operations
from gearlib.records import altered
from gearlib.run.methods.run import Run, is_function
from gearlib.run.scene import Scene, settle_once
from gearlib.solvers.inputs.table import Table, breakpoints, values
from gearlib.solvers.problem import Problem, Solution

if TYPE_CHECKING:
    from gearlib.native.scene_functions import NativeScene
    from gearlib.run.scene_form import SceneForm
    from gearlib.solvers.inputs.moving import Callbacks

Floats = NDArray[np.float64]
NO_TIMES = np.empty(0)
MOST_STEPS = 100_000_000  # about a minute for the smallest models, at 0.5 us per step, hours for large ones: the run has no end
MOST_STEPS_CONSTRAINED = 500_000  # with nonlinear constraints, whose steps shrink without end near a singularity
_MODEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *(ctypes.c_void_p,) * 4)
# Measured, ns: call of a native function, one addition in it, call of a Python function, look-up in a table
CALL, ADDITION, CALLBACK, LOOK_UP = 15.0, 0.3, 1500.0, 30.0


def problem_of(run: Run, callbacks: Callbacks, jacobian: bool) -> Problem:
    """The problem that an integrator is given; ``jacobian``: whether it needs df/dx."""
    if (handed := run.handed) is not None:
        return _handed_problem(run, callbacks, handed)
    scene, tangents, code = run.scene, run.tangents, None
    if tangents is not None:
        from gearlib.run.tangents.tangents import carried, tangent_code

        if scene.states or carried(scene):
            code = tangent_code(scene, tangents.directions, jacobian)
    native: NativeScene = code.native if code else scene.native_with_jacobian if jacobian else scene.native
    inputs = values(run.signals, run.times[:1])[:, 0]
    discrete = run.discrete
    if discrete is None:
        discrete = starting_discrete(run, native, inputs)
    data = scene.data(native, run.numbers, inputs, discrete, run.start.guess, run.slots)
    if code is not None and tangents is not None:
        if run.slots is None:  # the run begins here
            tangents.noted.clear()
        code.fill(data, tangents.directions, run.numbers, tangents.discretes(code.discrete))
        atol = None if run.atol is None else np.append(run.atol, tangents.spread(run.atol))
        nominal = np.append(scene.nominal, tangents.spread(scene.nominal))
        x0 = np.append(run.start.states, tangents.start)
        if not scene.states:
            x0, nominal, atol = np.ones(1), np.ones(1), None
        problem = _wired(run, callbacks, scene, native, data, x0, atol)
        problem = altered(problem, nominal=nominal, differential=np.ones(len(x0), bool))
        if problem.update is None:
            return problem
        from gearlib.run.tangents.event_tangents import EventTangents

        return altered(problem, update=EventTangents(run, tangents, code, problem, callbacks).native)
    if not scene.states:
        return _wired(run, callbacks, scene, native, data, np.ones(1), None)
    return _wired(run, callbacks, scene, native, data, run.start.states, run.atol)


def starting_discrete(run: Run, native: NativeScene, inputs: Floats) -> Floats:
    """Relations and discrete variables in which a run begins, shape (n_discrete,): by the compiled event iteration where it settles.

    That does not re-initialise states, and comes to its end, where it sets the sides of all event functions, only if all equations on
    the way have a solution: friction that moves may be tried as stuck. The interpreter does all else.
    """
    scene, start, t = run.scene, run.start, float(run.times[0])
    relations = scene.relations
    if relations is None:
        return np.zeros(scene.n_discrete)
    if native.update is not None and scene.searched and not relations.reinits:
        data = scene.data(native, run.numbers, inputs, scene.model.initial_discrete(), start.guess)
        x, fired = start.states.copy(), np.zeros(len(relations.used), np.int32)
        update = _MODEL(native.update.address)
        if update(t, x.ctypes.data, fired.ctypes.data, data.ctypes.data, native.index.ctypes.data) >= 0 and fired[0]:
            return data[native.shared.relations :][: native.shared.n_discrete].copy()
    return scene.discrete(run.numbers, run.times[:1], start.states[:, None], inputs[:, None], start=start.guess)[:, 0]


def _handed_problem(run: Run, callbacks: Callbacks, form: SceneForm) -> Problem:
    """The problem in a form that leaves algebraic unknowns to IDA."""
    parameters, t0 = run.numbers.parameters, float(run.times[0])
    inputs = values(run.signals, run.times[:1])[:, 0]
    discrete = form.discrete(parameters, t0, run.start, inputs) if run.discrete is None else run.discrete
    data = form.data(parameters, inputs, discrete, run.start.guess)
    x0 = form.first(run.numbers, t0, run.start, inputs, discrete, run.slots)
    atol = None if run.atol is None else np.concatenate([run.atol, run.rtol * form.nominal[len(run.atol) :]])
    return _wired(run, callbacks, form, form.native_with_jacobian, data, x0, atol)


def _common(scene: Scene | SceneForm, native: NativeScene) -> Problem:
    """The common part of the problems of all runs with these functions; made once."""
    if native.common:
        known: Problem = native.common[0]
        return known
    form = None if isinstance(scene, Scene) else scene
    relations, pattern, program = scene.relations, native.pattern, (scene if form is None else form.scene).program
    n_roots = int((~relations.on_time).sum()) if relations is not None else 0
    nominal = scene.nominal if len(scene.nominal) else np.ones(1)  # integrators need a state: without one, a constant is added
    problem = Problem(
        rhs=native.rhs, x0=np.empty(0), data=np.empty(0), index=native.index,
        differential=np.ones(len(nominal), bool) if form is None else form.differential, nominal=nominal, jac=native.jac,
        jac_indptr=None if pattern is None else pattern.indptr, jac_indices=None if pattern is None else pattern.indices,
        matrix_plans={} if pattern is None else pattern.plans,
        roots=native.roots if n_roots else None, n_roots=n_roots, update=native.update,
        discrete=slice(native.shared.relations, native.shared.relations + native.shared.n_discrete),
        state_names=scene.state_names, root_names=scene.root_names, implicit=form is not None and form.implicit,
        series=partial(getattr, scene, "series"),
        max_steps=MOST_STEPS_CONSTRAINED if program.iterated else MOST_STEPS, may_leave=program.may_need_others,
    )  # fmt: skip
    problem = _with_costs(problem, scene, native, 0, 0)
    native.common[:] = [problem]
    return problem


def _wired(
    run: Run, callbacks: Callbacks, scene: Scene | SceneForm, native: NativeScene, data: Floats, x0: Floats, atol: Floats | None
) -> Problem:
    """The problem over native functions, with the run's inputs connected to them."""
    program, common, more = scene.program, _common(scene, native), dict[str, Any]()
    tables = [(k, s) for k, s in enumerate(run.signals) if isinstance(s, Table)]
    if program.guards and any((np.diff(table.t) == 0.0).any() for _, table in tables):
        # a divisor may jump over zero with its input: no numerator counts as large beside infinity
        data[native.rhs.layout.guards :][: EACH * program.n_guards].reshape(-1, EACH)[:, 1] = np.inf
    moving = [(k, s) for k, s in enumerate(run.signals) if is_function(s)]
    if tables or moving:
        from gearlib.solvers.inputs.moving import with_moving_inputs

        functions, data, index = with_moving_inputs(native, data, tables, moving, callbacks)
        more = {name: functions[name] for name in ("rhs", "jac", "roots", "update") if getattr(common, name) is not None}
        more |= {"index": index, "interval": len(data) - 2}
        common = _with_costs(common, scene, native, len(moving), len(tables))
    return altered(
        common, x0=x0, data=data, time_events=time_events(run), longest_step=run.longest_step,
        longest_expanded_step=run.longest_expanded_step, unsettled=partial(_unsettled, run, native.shared),
        culprit=partial(_culprit, run, native.shared), times=run.times, rtol=run.rtol, atol=atol, tell=_told(run, callbacks),
        may_stop=run.may_stop, traced=run.scene.feeding if run.traced and run.handed is None and run.tangents is None else None,
        **more,
    )  # fmt: skip


def _told(run: Run, callbacks: Callbacks) -> Callable[[float], None] | None:
    """What is told the time that was reached; it also answers an interrupt that a Python function met."""

    def told(t: float) -> None:
        callbacks.answer()
        if run.tell is not None:
            run.tell(t)

    return told if run.may_stop else run.tell


def _with_costs(problem: Problem, scene: Scene | SceneForm, native: NativeScene, functions: int, tables: int) -> Problem:
    """A problem with the estimated cost of a call of each of its native functions."""
    call = CALL + CALLBACK * functions + LOOK_UP * tables
    rhs = ADDITION * operations(scene.program, native.rhs.layout)
    entries = 0.0 if native.pattern is None else native.pattern.size
    relations = 0.0
    if scene.relations is not None and native.update is not None:
        relations = ADDITION * operations(scene.relations.program, native.update.layout)
    return altered(
        problem, rhs_cost=call + rhs, jac_cost=call + 3.0 * rhs + 4.0 * ADDITION * entries, roots_cost=call + relations,
        update_cost=call + 3.0 * relations,
    )  # fmt: skip


def _culprit(run: Run, shared: Shared, t: float, x: Floats, data: Floats) -> str:
    """Description of the expression that cannot be evaluated where a run ended."""
    from gearlib.run.refusals.blame import culprit

    discrete = data[shared.relations :][: shared.n_discrete].copy()
    inputs = values(run.signals, np.array([t]))[:, 0]
    span = float(run.times[-1] - run.times[0])
    return culprit(run.scene, run.numbers, t, span, x[: len(run.scene.states)], inputs, discrete)


def _unsettled(run: Run, shared: Shared, t: float, x: Floats, data: Floats) -> str:
    """Relations and discrete variables that keep changing in an event iteration without convergence."""
    scene, n = run.scene, run.scene.model.n_relations
    if scene.relations is None or run.numbers.relations is None:
        return ""
    discrete = data[shared.relations :][: shared.n_discrete, None]
    inputs = data[shared.inputs :][: shared.n_inputs, None]
    new = settle_once(scene.relations, run.numbers.relations, np.array([t]), x[: len(scene.states), None], inputs, discrete)
    places = np.flatnonzero((new != discrete)[:, 0]).tolist()
    names = [scene.model.discretes[i - n] for i in places if i >= n]
    return ", ".join(names) or "; ".join(dict.fromkeys(scene.relation_names[i] for i in places))


def time_events(run: Run) -> Floats:
    """Known event times to step to exactly, after the start; the end is included only if something may happen there."""
    if not run.signals and (run.handed or run.scene).relations is None:
        return NO_TIMES
    found, t0, t1 = breakpoints(run.signals), float(run.times[0]), float(run.times[-1])
    last = t1 if (run.handed or run.scene).relations is not None else math.nextafter(t1, t0)
    found = found[(found > t0) & (found <= (t1 - _at_end(run) if run.open_end else last))]
    switches = _switches(run)
    return np.unique(np.concatenate([found, [t for t, _ in switches]])) if switches else found


def begun_at_instants(run: Run, instants: Iterable[float] = ()) -> Run:
    """A run whose tables jump at an instant where they do so after it by rounding only: what acts there takes what follows.

    Instants are the switches of conditions on time, and those given.
    """
    if not any(isinstance(s, Table) and s.decisive.size for s in run.signals):
        return run
    from gearlib.equations.switch_times import rounding

    known = np.unique([*instants, *(t for found in switches(run) for t, _ in found)])
    same = rounding(float(run.times[0]), float(run.times[-1]))
    signals = tuple(s.beginning_at(known, same) if isinstance(s, Table) else s for s in run.signals)
    return replace(run, signals=signals)


def memory(run: Run, data: Floats) -> tuple[Floats, Floats]:
    """Slots and discrete state where a run ended: its branch of nonlinear equations, and what sticks, are carried on."""
    scene, program = run.scene, run.scene.program
    shared, layout = scene.shared, scene.layout
    if run.tangents is not None and scene.states:
        from gearlib.run.tangents.tangents import tangent_code

        layout = tangent_code(scene, run.tangents.directions, False).native.rhs.layout
    slots = data[layout.slots :][: program.n_slots]
    return slots.copy(), data[shared.relations :][: shared.n_discrete].copy()


def named_events(run: Run, solution: Solution) -> list[tuple[float, str]]:
    """Time of each event, and component with equation."""
    if not len(solution.event_times):
        return []
    integrated = run.handed or run.scene
    if integrated.relations is None:
        return []
    names, times, roots = integrated.root_names, solution.event_times.tolist(), solution.event_roots.tolist()
    if min(roots) >= 0:
        return list(zip(times, map(names.__getitem__, roots), strict=True))
    timed = _names_of_time_events(run)
    return [(t, names[r] if r >= 0 else timed.get(t, "an input")) for t, r in zip(times, roots, strict=True)]


def _names_of_time_events(run: Run) -> dict[float, str]:
    """Component and equation of the switches at a time, all of them if there are several."""
    found: dict[float, list[int]] = {}
    for t, number in _switches(run):
        found.setdefault(t, []).append(number)
    return {t: name_of_relations(run, numbers) for t, numbers in found.items()}


def name_of_relations(run: Run, numbers: Iterable[int]) -> str:
    """Component and equation of some relations."""
    names = (run.handed or run.scene).relation_names
    return "; ".join(dict.fromkeys(names[number] for number in numbers))


def _switches(run: Run) -> list[tuple[float, int]]:
    """Times at which conditions on time switch in a run, with their relations."""
    inside, at_end = switches(run)
    return inside if run.open_end else inside + at_end


def switches(run: Run) -> tuple[list[tuple[float, int]], list[tuple[float, int]]]:
    """Times at which conditions on time switch before the end, and those at the end within rounding, with their relations."""
    t0, t1 = float(run.times[0]), float(run.times[-1])
    integrated, same = run.handed or run.scene, _at_end(run)
    found = [(min(t, t1), number) for t, number in integrated.time_switches(run.numbers.parameters, t0, t1 + same)]
    return [s for s in found if s[0] <= t1 - same], [s for s in found if s[0] > t1 - same]


def _at_end(run: Run) -> float:
    """How far (s) from the end of a run times count as at the end."""
    from gearlib.equations.switch_times import rounding

    return 2.0 * rounding(float(run.times[0]), float(run.times[-1]))
