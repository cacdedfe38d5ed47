"""State switching: a run continues with other states where those in use become singular, as a pendulum's coordinates do.

The states are local coordinates on the manifold of the motion. Where the constraints can no longer be solved for the other variables,
the run continues with states for which they can, as often as needed. Each part of the run is a segment.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearlib.errors import SolverError
from gearlib.program.build import build
from gearlib.program.interpret import evaluate, prepare
from gearlib.reduce.reduction import choose_again
from gearlib.run.methods.method import Integrates, explained
from gearlib.run.methods.method_table import integrate
from gearlib.run.methods.native_problem import Floats, memory
from gearlib.run.methods.run import Run
from gearlib.run.scene import Scene, guess_of, needed_states
from gearlib.run.start_values import Start
from gearlib.solvers.inputs.table import values
from gearlib.solvers.problem import Solution
from gearlib.structure.incidence import Node

Switched = dict[tuple[Node, ...], Scene]
SHORTEST = 1e-9  # of the run: minimum length of a segment


def integrate_through(run: Run, method: Integrates, switched: Switched) -> list[tuple[Run, Solution]]:
    """Integrate to the end with as many sets of states as the motion needs; each segment begins where the previous one ended.

    Parameters
    ----------
    run : Run
    method : Integrates
    switched : dict
        Scenes with other states that earlier runs needed; extended here.

    Raises
    ------
    ArgumentError, SolverError
        As `integrate` raises, or no set of states lasts.
    ModelError
        As `gearlib.run.refusals.jumps.refuse_switches` raises.
    """
    parts = [(run, integrate(run, method))]
    span = float(run.times[-1] - run.times[0])
    while parts[-1][1].status == "left":
        here, left = parts[-1]
        if len(parts) > 1 and left.t_last - here.times[0] < SHORTEST * span:
            failure = SolverError(f"the right-hand side cannot be evaluated beyond t = {left.t_last:.9g} s")
            raise explained(failure, here.scene)
        following = _following(here, left, switched)
        parts.append((following, integrate(following, method)))
    for part, solution in parts if run.scene.structure.changing else ():
        _refuse_switches(part, solution, method)
    return parts


def _refuse_switches(run: Run, solution: Solution, method: Integrates) -> None:
    """Refuse a run with an event that made a differentiated equation jump."""
    from gearlib.run.refusals.jumps import SampledMotion, refuse_switches
    from gearlib.run.segment import Segment

    structure, parameters = run.scene.structure, run.numbers.parameters

    def sampled(times: Floats) -> SampledMotion:
        again = replace(run, times=times, max_step=run.longest_step, tell=None, may_stop=False)
        found = Segment.of(again, integrate(again, method))
        return SampledMotion(structure, parameters, found.time, found.discrete, found.history)

    events = np.unique(solution.event_times)
    if len(events):
        refuse_switches(structure, run.scene.program, parameters, float(run.times[0]), events, solution.t_last, sampled)


def _following(run: Run, left: Solution, switched: Switched) -> Run:
    """The rest of a run, with another set of states if there is one."""
    scene, t, x = run.scene, np.array([left.t_last]), left.x_last
    if run.tangents is not None:
        raise SolverError(
            f"there are no sensitivities after t = {left.t_last:.9g} s: the states ({', '.join(scene.state_names[:6])}) determine "
            "the motion no further, and the run would go on with others; let it end there, or choose states that last: state='prefer'"
        )
    here, held = memory(run, left.data)
    here = here if left.branch is None else left.branch
    structure = scene.structure
    orders = structure.differentiation.orders
    known = np.zeros((max(2, *orders.values()), scene.model.n_variables))
    known[0] = run.start.guess
    known[0, scene.model.inputs] = values(run.signals, t)[:, 0]
    known[tuple(np.array(scene.states).T[::-1])] = x
    nodes = [
        n
        for v, order in orders.items()
        for k in range(order)
        if structure.computes(n := (v, k)) and not scene.missing(n) and n not in scene.place_of
    ]
    program = build(structure, nodes, scene.states, dynamic=False)
    guess = guess_of(program, run.start.guess)
    for node, slot in program.slots.items():  # on the solution branch of the run
        if node in scene.program.slots:
            guess[slot] = here[scene.program.slots[node]]
    inputs = values(run.signals, t)
    prepared = prepare(program, structure, run.numbers.parameters)
    slots = evaluate(prepared, t, x[:, None], inputs, held[:, None], guess)
    for (v, k), slot in program.slots.items():
        if k < len(known):
            known[k, v] = slots[slot, 0]
    later, discrete = np.concatenate([t, run.times[run.times > left.t_last]]), held if scene.n_discrete else None
    again = choose_again(structure, run.numbers.parameters, left.t_last, known)
    if again is None:  # the same states with smaller pivots
        start = replace(run.start, states=x, guess=known[0])
        return replace(run, start=start, times=later, discrete=discrete, slots=here)
    states = needed_states(again, scene.states)
    outputs = tuple(n for n in scene.outputs if n not in states)
    other = switched.setdefault(states, Scene(again, states, scene.wanted, outputs))
    start = Start(np.array([known[k, v] for v, k in states]), known[0], ())
    return replace(
        run, scene=other, numbers=other.numbers(run.numbers.parameters), start=start, times=later,
        atol=_tolerances(run, other), discrete=discrete, slots=None,
    )  # fmt: skip


def _tolerances(run: Run, other: Scene) -> Floats | None:
    """Absolute tolerances: kept for states in both sets, else in proportion to the nominal value."""
    if run.atol is None:
        return None
    given = dict(zip(run.scene.states, run.atol, strict=True))
    share = float(np.min(run.atol / run.scene.nominal))
    return np.array([given.get(s, share * nominal) for s, nominal in zip(other.states, other.nominal, strict=True)])
