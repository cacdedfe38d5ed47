"""`operating_point`: the scene, parameter values and point of motion for a linearisation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import is_real, shown
from gearlib.errors import ArgumentError
from gearlib.program.interpret import Prepared, evaluate
from gearlib.program.program import Program
from gearlib.run.afterwards.branch import iterated_unknowns
from gearlib.run.refusals.limits import refuse_start
from gearlib.run.result import SimulatedResult
from gearlib.run.sampling.controllers import check_instants
from gearlib.run.scene import Scene, guess_of
from gearlib.run.simulate import kept_values
from gearlib.run.translation import Translation
from gearlib.solvers.inputs.table import values, values_in_run
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Point:
    """An operating point: time, and a value of every known state of the structure.

    ``discrete`` holds the relations and discrete variables of a program where a run determines them; otherwise they are those of a start.
    ``history`` returns the value of a node in that run, near which what is solved by iteration is searched for: the run's solution branch.
    ``change`` returns the derivatives of parameters and states with respect to some parameters, by path: (parameter, seed, weight), and
    a function that returns the derivative of each state of the structure, shape (seeds,). ``steady``: a steady state was searched for.
    """

    t: float
    states: dict[tuple[int, int], float]
    inputs: Floats
    guess: Floats
    discrete: Callable[[Program], Floats] | None = None
    change: Callable[[Sequence[str]], PointChange] | None = None
    history: Callable[[Node], float] | None = None
    steady: bool = False


@dataclass(frozen=True, eq=False)
class PointChange:
    """Derivatives of an operating point with respect to parameters.

    Attributes
    ----------
    parameters : list of (parameter, seed, weight)
        For the parameter table.
    find_states : callable
        Returns the derivatives of the states by node, each of shape (seeds,); not called where a model does not depend on its states.
    """

    parameters: list[tuple[int, int, float]]
    find_states: Callable[[], dict[Node, Floats]]


def operating_point(
    translation: Translation, states: tuple[Node, ...], at: Any = None, parameters: Mapping[str, float] | None = None,
    inputs: Mapping[str, float] | None = None, outputs: Sequence[Node] = (),
) -> tuple[Scene, Floats, Point]:  # fmt: skip
    """A scene with some states, the parameter values, and the point that ``at`` denotes (see `System.linearize`)."""
    check_instants(translation.structure, states, "a linear model", outputs)
    if isinstance(at, tuple) and len(at) == 2 and isinstance(at[0], SimulatedResult):
        return _moment(translation, states, at[0], at[1], parameters)
    numbers = translation.parameter_values(parameters)
    scene = translation.scene_of(states)
    signals = translation.input_signals(inputs)
    if not (at is None or (isinstance(at, str) and at == "steady") or isinstance(at, Mapping)):
        raise ArgumentError(f"at is {shown(at)}; expected start values by path, 'steady', or (result, time)")
    begin = translation.start(scene, numbers, 0.0, at, signals)
    now = values(signals, np.array([0.0]))[:, 0]
    refuse_start(scene, numbers, 0.0, now, begin)
    known = dict(zip(states, begin.states.tolist(), strict=True))

    def change(names: Sequence[str]) -> PointChange:
        rows = translation.parameter_changes(names, numbers, parameters or ())

        def find_states() -> dict[Node, Floats]:
            moved = translation.start(scene, numbers, 0.0, at, signals, seeds=rows).changes
            assert moved is not None, "seeds were given"
            return dict(zip(states, moved, strict=True))

        return PointChange(rows, find_states)

    return scene, numbers, Point(0.0, known, now, begin.guess, change=change, steady=isinstance(at, str))


def _moment(
    translation: Translation, states: tuple[Node, ...], result: SimulatedResult, t: Any, parameters: Mapping[str, float] | None
) -> tuple[Scene, Floats, Point]:
    """A moment of a run, with the run's inputs, and its parameters where no others are given."""
    if result.scene.structure is not translation.structure:
        raise ArgumentError(f"at names a run of another system than {translation.name}; simulate this one")
    if not is_real(t) or not result.time[0] <= t <= result.time[-1]:
        raise ArgumentError(f"at names the time {shown(t)}; the run goes from {result.time[0]:g} to {result.time[-1]:g} s")
    t = float(t)
    numbers, given = parameters_at(translation, (result, t), parameters), {*result.request.given, *(parameters or ())}
    scene = translation.scene_of(states)
    result = result.with_sample(t)
    sample = int(np.searchsorted(result.time, t))
    known = {s: float(result.history_of(s)[sample]) for s in states}
    part = result.segment_at(t)
    inputs = values_in_run(result.request.signals, np.array([t]))[:, 0]

    def change(names: Sequence[str]) -> PointChange:
        rows = translation.parameter_changes(names, numbers, given)
        return PointChange(rows, lambda: {s: np.zeros(len(names)) for s in states})

    def history(node: Node) -> float:
        return float(result.history_of(node)[sample])

    return scene, numbers, Point(t, known, inputs, part.guess, lambda program: part.discrete_at(program, t), change, history)


def slots_at(scene: Scene, parameters: Floats, prepared: Prepared, point: Point) -> tuple[Floats, Floats]:
    """Values of a program's slots, and of the discrete variables, at an operating point."""
    program = prepared.program
    x = np.array([point.states[s] for s in scene.states])
    u, now = point.inputs, np.array([point.t])
    if point.discrete is not None:
        discrete = point.discrete(program)[:, None]
    else:
        discrete = scene.discrete_of(prepared, now, x[:, None], u[:, None], point.guess)
    guess = guess_of(program, point.guess)
    if point.history is not None and program.iterated:
        slots, nodes = iterated_unknowns(program)
        guess[slots] = [point.history(node) for node in nodes]
    return evaluate(prepared, now, x[:, None], u[:, None], discrete, guess)[:, 0], discrete[:, 0]


def fitting(translation: Translation, at: Any = None, parameters: Mapping[str, float] | None = None) -> Translation:
    """The translation that fits the parameters, or those of the run in ``at``."""
    return translation.fitting(parameters_at(translation, at, parameters))


def parameters_at(translation: Translation, at: Any = None, parameters: Mapping[str, float] | None = None) -> Floats:
    """The values of all parameters: by the ones given, beside those of the run in ``at`` or in their place."""
    if isinstance(at, tuple) and len(at) == 2 and isinstance(at[0], SimulatedResult):
        parameters, _ = kept_values(at[0], parameters)
    return translation.parameter_values(parameters)
