"""Refusal of runs in which a variable falls below its declared minimum.

The equations of a one-sided element (a freewheel) rely on a variable never passing its limit. Started beyond it they would stay there:
no equation is violated, so that nothing else would notice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError, GearlibWarning, SolverError, StartError, warn
from gearlib.flatten.model import FlatModel
from gearlib.program.interpret import Prepared, evaluate, prepare
from gearlib.reduce.coefficients import some
from gearlib.reduce.reduction import Structure
from gearlib.run.scene import Scene, guess_of
from gearlib.run.segment import Segment
from gearlib.run.start_values import Start
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import reach

Floats = NDArray[np.float64]
MISSED = 10.0  # tolerances by which a variable may fall short of its minimum, relative to the largest operand that it is computed from
ACCURATE = 1e-9  # tolerance of a state at the start, where no integration error exists


def refuse_too_small(parts: Sequence[Segment], rtol: float, goes_on: bool = False) -> None:
    """Refuse a run in which a variable is below its minimum; one that ``goes_on`` may begin where rounding left it.

    Raises
    ------
    StartError
        A variable is below its minimum at the first sample.
    SolverError
        A variable falls below it later.
    """
    for number, part in enumerate(parts):
        if not part.scene.model.bounded:
            continue
        for v, least, node in bounded_variables(part.scene):
            values = int(part.scene.model.sign[v]) * part.history(node)
            rounded = min(least, float(values[0])) if goes_on and number == 0 else least
            wrong = values < rounded - MISSED * rtol * _size(part.scene, node, part.states, values)
            if wrong.any():
                first = int(np.argmax(wrong))
                at_start = number == 0 and first == 0
                text = _text(part.scene.model, v, float(values[first]), least)
                raise (StartError if at_start else SolverError)(
                    f"{text} at t = {part.time[first]:g} s; {_fix(part.scene.model, v, least, at_start)}"
                )


def warn_of_unchecked(structure: Structure) -> None:
    """Warn of variables whose minimum no run can check."""
    model = structure.model
    nodes = {v: (int(model.representative[v]), 0) for v, _ in model.bounded if model.sign[v]}
    names = [model.name(v) for v, node in nodes.items() if node in structure.solved_by and not structure.computes(node)]
    if names:
        what = f"the minimum of {names[0]} is" if len(names) == 1 else f"the minima of {some(names, ', ')} are"
        warn(f"{what} not checked: this needs the derivative of an input, which a run does not have", GearlibWarning)


def refuse_start(scene: Scene, parameters: Floats, t: float, inputs: Floats, begin: Start) -> None:
    """Refuse such start values, whether or not the run has a sample there.

    Raises
    ------
    StartError
        A variable starts below its minimum.
    """
    found = _too_small(scene, scene.prepared(parameters), t, begin.states, inputs, begin) if scene.model.bounded else None
    if found is not None:
        v, value, least = found
        text = _text(scene.model, v, value, least)
        raise StartError(f"{text} at t = {t:g} s; {_fix(scene.model, v, least, at_start=True)}")


def refuse_too_small_in(model: FlatModel, values: Floats) -> None:
    """Refuse values of the representative variables of which one is below its minimum.

    Raises
    ------
    ArgumentError
        Names the variable.
    """
    for v, least in model.bounded:
        rep, sign = int(model.representative[v]), int(model.sign[v])
        if sign * values[rep] < least - MISSED * ACCURATE * max(float(model.nominal[rep]), abs(float(values[rep]))):
            raise ArgumentError(f"{_text(model, v, float(sign * values[rep]), least)}; {_fix(model, v, least, at_start=True)}")


def too_small(scene: Scene, numbers: Prepared, t: float, x: Floats, inputs: Floats, begin: Start) -> str:
    """Description of the variable that is below its minimum in a state; empty if there is none."""
    found = _too_small(scene, numbers, t, x, inputs, begin)
    return "" if found is None else _text(scene.model, *found)


def _too_small(
    scene: Scene, numbers: Prepared, t: float, x: Floats, inputs: Floats, begin: Start
) -> tuple[int, float, float] | None:
    """The variable that is below its minimum in a state, its value and the minimum."""
    bounded = list(bounded_variables(scene))
    if not bounded:
        return None
    now, column = np.array([t]), x[:, None]
    for v, least, node in bounded:
        if node in scene.place_of:
            value = int(scene.model.sign[v]) * column[scene.place_of[node]]
        else:
            program = scene.computing(node)
            prepared = prepare(program, scene.structure, numbers.parameters)
            discrete = scene.discrete_of(prepared, now, column, inputs[:, None], begin.guess)
            slots = evaluate(prepared, now, column, inputs[:, None], discrete, guess_of(program, begin.guess))
            value = int(scene.model.sign[v]) * slots[program.slots[node]]
        if value[0] < least - MISSED * ACCURATE * _size(scene, node, column.T, value):
            return v, float(value[0]), least
    return None


def bounded_variables(scene: Scene) -> Iterator[tuple[int, float, Node]]:
    """Variables with a declared minimum that the scene determines."""
    model = scene.model
    for v, least in model.bounded:
        node = (int(model.representative[v]), 0)
        if model.sign[v] and scene.structure.computes(node) and not scene.missing(node):
            yield v, least, node


def _size(scene: Scene, node: Node, states: Floats, values: Floats) -> float:
    """The largest operand from which a variable is computed, including its own value and nominal value."""
    return max(
        float(scene.model.nominal[node[0]]),
        float(np.abs(values).max(initial=0.0)),
        float(np.abs(states[:, states_below(scene, node)]).max(initial=0.0)),
    )


def states_below(scene: Scene, node: Node) -> list[int]:
    """Places of the states from which a variable is computed."""
    found = reach(scene.structure, [node], dynamic=False, events=False)[1]
    return [scene.place_of[s] for s in found if s in scene.place_of]


def _text(model: FlatModel, v: int, value: float, least: float) -> str:
    declared = model.declaration(v)
    what = "" if declared is None or declared.unit in ("1", "any") else f" {declared.unit}"
    if declared is not None and declared.description:
        what += f" ({declared.description})"
    digits = 6 if f"{value:.6g}" != f"{least:.6g}" else 15  # what is just below must not look like the bound itself
    return f"{model.name(v)} is {value:.{digits}g}{what}, but it cannot be below {least:g}"


def _fix(model: FlatModel, v: int, least: float, at_start: bool) -> str:
    name = model.name(v)
    if model.unit(v) not in ("rad/s", "m/s"):
        return f"the equations hold down to there; let start values, parameters and inputs leave {name} at {least:g} or more"
    if at_start:
        return f"choose start values that make {name} {least:g} or more (start={{...}}), or turn the part round"
    return (
        f"only a reinit, or motions that are prescribed on both sides, take it there: let them leave {name} at {least:g} or more, "
        "or give one side an inertia and a spring"
    )
