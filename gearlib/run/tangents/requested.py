"""Directions of differentiation by name: parameters with everything bound to them, and start values."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import name_list
from gearlib.errors import ArgumentError, GearlibError, NameLookupError, nearest
from gearlib.flatten.model import FlatModel
from gearlib.language.declarations import Structural
from gearlib.program.held_speeds import held_speeds
from gearlib.program.interpret import evaluate
from gearlib.run.scene import Scene, guess_of
from gearlib.run.start_values import Start, start_named, start_variable
from gearlib.run.tangents.directions import TangentDirections
from gearlib.run.translation import Translation

Floats = NDArray[np.float64]
ROUNDING = 1e-9  # relative to its terms: a smaller change of a speed is zero
CONTINUED = (
    "sensitivities are those of a whole run: a run that goes on from a result does not know how its start changes; "
    "begin at the beginning, or give start values: start={'load.w': ...}"
)


def refuse_form(translation: Translation, form: str) -> None:
    """Check that the equations of a run can be differentiated.

    Raises
    ------
    ArgumentError
        Sampled controllers, or a form of the equations that leaves unknowns to IDA.
    """
    if form != "ode":
        raise ArgumentError(
            f"sensitivities need form='ode', in which all unknowns follow from the states; the form is {form!r}"
        )
    if translation.controllers:
        raise ArgumentError(
            f"{translation.name} has sampled controllers, functions of Python, or delays: how what they give changes with a parameter is "
            "not known, so that there are no sensitivities; write the controller as equations"
        )


def directions(
    translation: Translation, names: Any, parameters: Floats, given: Collection[str], start: Any
) -> TangentDirections | None:
    """Directions of differentiation for some names; None where there are none.

    Parameters
    ----------
    translation : Translation
    names : sequence of str
        Names given by the user.
    parameters : array
        The complete parameter table.
    given : collection of str
        Parameters given for this run, which do not follow from others.
    start : object
        As for `System.simulate`.

    Raises
    ------
    ArgumentError, NameLookupError
        Not a list of names, an unknown parameter or start value, or one without a derivative.
    """
    chosen = name_list("sensitivities", names, "shaft.c")
    if not chosen:
        return None
    twice = next((name for k, name in enumerate(chosen) if name in chosen[:k]), None)
    if twice is not None:
        raise ArgumentError(f"sensitivities names {twice!r} twice")
    model, table = translation.model, translation.model.parameters
    paths: list[str] = []
    columns: list[int] = []
    starts: list[tuple[int, int, int]] = []
    sizes = np.ones(len(chosen))
    for k, name in enumerate(chosen):
        if (own := start_named(name)) is not None:
            v = start_variable(model, own)
            rep, sign = int(model.representative[v]), int(model.sign[v])
            if sign == 0:
                raise ArgumentError(f"sensitivities names {name!r}, and {own} is always zero")
            if not (
                _starts_by_itself(translation, rep)
                or (isinstance(start, Mapping) and any(rep == _start(model, n) for n in start))
            ):
                raise ArgumentError(
                    f"sensitivities names {name!r}, and {own} has no start value: it follows from those of the states. Give it one: "
                    f"start={{{own!r}: ...}}"
                )
            starts.append((rep, k, sign))
            sizes[k] = model.nominal[rep]
            continue
        sizes[k] = abs(parameters[_parameter(translation, name)]) or 1.0
        paths.append(name)
        columns.append(k)
    changes = translation.parameter_changes(paths, parameters, [name for name in given if name in table.index]) if paths else []
    moved = [(p, columns[c], weight) for p, c, weight in changes if weight != 0.0]
    pairs = tuple((p, k) for p, k, _ in moved)
    return TangentDirections(tuple(chosen), pairs, np.array([weight for *_, weight in moved]), tuple(starts), sizes)


def refuse_held(
    scene: Scene, parameters: Floats, t: float, inputs: Floats, start: Start, directions: TangentDirections
) -> None:
    """Refuse directions that move what sticks at the start: it would slide until it sticks again, but its tangent would stay for ever.

    Raises
    ------
    ArgumentError
        The message names the direction, and the states that it moves.
    """
    if scene.relations is None or start.steady or start.changes is None:  # a steady state moves nothing
        return
    prepared, now, x, u = scene.prepared(parameters), np.array([t]), start.states[:, None], inputs[:, None]
    discrete = scene.discrete(prepared, now, x, u, start=start.guess) if start.discrete is None else start.discrete[:, None]
    slots = evaluate(prepared, now, x, u, discrete, guess_of(scene.program, start.guess))[:, 0]
    held = held_speeds(scene.structure, prepared, t, slots, discrete[:, 0])
    moved = np.abs(held @ start.changes) > ROUNDING * (np.abs(held) @ np.abs(start.changes))
    for row, k in np.argwhere(moved).tolist():
        states = ", ".join(name for name, c in zip(scene.state_names, held[row], strict=True) if c)
        raise ArgumentError(
            f"sensitivities names {directions.names[k]!r}, which moves {states} at the start, where something sticks: it would slide until "
            "it sticks again, and tangents of a run that begins stuck do not follow that; begin with a slip, or vary what moves both sides"
        )


def _parameter(translation: Translation, name: str) -> int:
    """The parameter-table entry that a name stands for."""
    model, table = translation.model, translation.model.parameters
    if name in table.index:
        return table.index[name]
    if _is_choice(translation, name):
        raise NameLookupError(
            f"sensitivities names {name!r}, a structural choice: the equations are others with another value, and there is no derivative "
            f"with respect to it; {nearest(name, table.own_names)}"
        )
    if model.find(model.column(name)[0]) is not None:
        base = model.column(name)[0]
        what = (
            f"an input; a run is differentiated with respect to parameters: bind {base} to an expression of one"
            if base in translation.inputs
            else f"a variable; with respect to its start value write 'start({base})'"
        )
        raise NameLookupError(f"sensitivities names {name!r}, {what}")
    return table.number(name, " to differentiate with respect to")


def _start(model: FlatModel, name: str) -> int:
    """The representative of the variable that a start value was given for; -1 for a discrete one."""
    v = model.find(name)
    return -1 if v is None else int(model.representative[v])


def _starts_by_itself(translation: Translation, variable: int) -> bool:
    """Whether the start value of a representative is fixed, or is that of a state."""
    return (variable, 0) in translation.structure.states or variable in translation.model.fixed[0]


def _is_choice(translation: Translation, name: str) -> bool:
    """Whether a path is that of a structural choice."""
    path, _, local = name.rpartition(".")
    owner: Any = translation.component
    for step in filter(None, path.replace("[", ".").replace("]", "").split(".")):
        try:
            owner = owner[int(step)] if step.isdigit() else getattr(owner, step)
        except (GearlibError, AttributeError, LookupError, TypeError):
            return False
    return isinstance(getattr(type(owner), local, None), Structural)
