"""Description of an operating point in words: open meshes, states without influence, and what is frozen there.

Components declare the meaning of a state's values, ``gl.Variable(..., words={0: "open: mesh {}"})``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import relation_kernel
from gearlib.errors import GearlibError
from gearlib.flatten.model import FlatModel
from gearlib.flatten.time_means import held_in_time
from gearlib.language.declarations import Variable
from gearlib.linear.linearized_program import LinearizedProgram
from gearlib.linear.operating_point import Point, slots_at
from gearlib.program.build import build
from gearlib.program.interpret import prepare
from gearlib.reduce.coefficients import some
from gearlib.reduce.reduction import Structure
from gearlib.run.scene import Scene, needed_states
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
MOVING = 1e-6  # rad/s: an angle that turns more slowly is at rest
MOST_FROZEN = 20  # angles that are tried one by one
SAME = 1e-9  # of the derivatives: a smaller change is rounding
STEPS = np.arange(1, 10) / 10.3  # of a turn, and of ten seconds


@dataclass(frozen=True)
class Conditions:
    """Descriptions of an operating point, and the paths of components that are open there (those described by the words for 0)."""

    said: tuple[str, ...] = ()
    open: frozenset[str] = frozenset()


def conditions(scene: Scene, parameters: Floats, point: Point) -> Conditions:
    """Sentences such as "open: mesh m1, m2", in model order.

    Parameters
    ----------
    scene : Scene
        With the states that are known at the point.
    parameters : array
    point : Point
    """
    structure, model = scene.structure, scene.model
    worded, known = _worded(model), set(scene.states)
    # Some have no effect on the requested outputs
    if not set(needed_states(structure, [(v, 0) for v, _, _ in worded])) <= known:
        worded = [item for item in worded if set(needed_states(structure, [(item[0], 0)])) <= known]
    nodes = [(v, 0) for v, _, _ in worded]
    if not nodes:
        return Conditions()
    program = build(structure, nodes, scene.states, dynamic=False)
    values, _ = slots_at(scene, parameters, prepare(program, structure, parameters), point)
    found: dict[str, list[str]] = defaultdict(list)
    open_ = set()
    for (_, path, declared), slot in zip(worded, program.output_slots.tolist(), strict=True):
        assert declared.words is not None
        value = float(np.round(values[slot]))
        word = declared.words.get(value)
        if word is not None:
            found[word].append(path or model.instances[0].kind)
        if not value:
            open_.add(path)
    return Conditions(tuple(word.format(", ".join(paths)) for word, paths in found.items()), frozenset(open_))


def _worded(model: FlatModel) -> list[tuple[int, str, Variable]]:
    """(variable, path of its component, declaration) of all variables with words, except constant ones."""
    kinds = {i.kind for i in model.instances if any(d.words for d in i.declared.variables.values())}
    if not kinds:
        return []
    changing = np.zeros(model.n_variables, bool)
    for group in model.groups:
        if len(group.template.locals) > 1 or group.template.discretes:
            changing[group.variables[group.signs != 0]] = True
    return [
        # Never an alias of opposite sign: the words belong to this name
        (int(model.representative[v]), instance.path, declared)
        for instance in model.instances
        if instance.kind in kinds
        for v, declared in enumerate(instance.declared.variables.values(), instance.first_variable)
        if declared.words and model.sign[v] and changing[model.representative[v]]
    ]


def frozen(linearized: LinearizedProgram, rows: Sequence[int], outputs: Sequence[Node] = ()) -> list[str]:
    """Angles that turn or that nothing holds, and time, where derivatives vary with them: a linear model has those of one.

    With an angle, they repeat every turn. ``rows`` are those of `LinearizedProgram.derivatives` for the rates of all states and for the
    outputs.
    """
    scene, point = linearized.scene, replace(linearized.point, discrete=None)  # conditions are those of each angle
    structure, program = scene.structure, linearized.prepared.program
    # The program of modes computes all variables; without outputs only the rates count
    if not scene.states or program.is_linear or (not outputs and scene.program.is_linear):
        return []
    held = held_in_time(structure.complete, linearized.prepared.parameters, means=False) if point.steady else []
    steady = [f"steady with the values at t = 0 of what changes with time: {some(held, ', ')}"] if held else []

    def slopes(states: Sequence[Node], angle: float, later: float = 0.0) -> Any:
        moved = {**point.states, **{state: point.states[state] + angle for state in states}}
        return replace(linearized, point=replace(point, t=point.t + later, states=moved)).derivatives[rows]

    def differ(one: Any, other: Any) -> bool:
        return bool(abs(other - one).max() > SAME * abs(one).max())

    def vary(states: Sequence[Node]) -> bool:
        return any(differ(here, slopes(states, 2 * np.pi * step)) for step in STEPS)

    speeds = np.abs(linearized.slots[[program.slots[v, k + 1] for v, k in scene.states]])
    column = np.asarray(abs(linearized.derivatives[rows]).sum(axis=0)).ravel()
    order = [i for i in np.argsort(-speeds, kind="stable") if speeds[i] > MOVING or not column[i]]
    angles = [scene.states[i] for i in order if _is_angle(structure.model, scene.states[i])]
    others = needed_states(structure, [(v, k + 1) for v, k in {*scene.states} - {*angles}] + [*outputs])
    angles = [angle for angle in angles if angle in others][:MOST_FROZEN]
    templates = [group.template for group in structure.model.groups]
    on_time = program.on_time or any(relation_kernel(t, c).on_time for t in templates for c in range(len(t.relations)))
    found: list[str] = []
    if not angles and not on_time:
        return steady
    with suppress(GearlibError):  # an angle or a time at which the train cannot be
        here = slopes((), 0.0)
        if angles and vary(angles):
            turning = [a for a in angles if not differ(here, slopes([a], 2 * np.pi)) and vary([a])]
            found += [f"{structure.model.name(v)} = {point.states[v, k]:g} rad" for v, k in turning]
        if on_time and any(differ(here, slopes((), 0.0, 10 * step)) for step in STEPS):
            found.append(f"t = {point.t:g} s")
    return [*steady, f"frozen at {', '.join(sorted(found))}, with which the coefficients vary"] if found else steady


def _is_angle(model: FlatModel, node: Node) -> bool:
    return model.unit(node[0]) == "rad" and not node[1]


def described(structure: Structure, node: Node) -> str:
    """A state with its declared description: "m.turned (mesh phase beyond phase0)"."""
    v, k = node
    name = "der(" * k + structure.model.name(v) + ")" * k
    declared = structure.model.declaration(v)
    return f"{name} ({declared.description})" if declared is not None and declared.description and not k else name


def matters_elsewhere(structure: Structure, states: tuple[Node, ...], node: Node) -> bool:
    """Whether the rate of another state can depend on this one, at another operating point."""
    others = [(v, k + 1) for v, k in states if (v, k) != node]
    return node in needed_states(structure, others)
