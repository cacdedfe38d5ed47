"""Description of an operating point in words: open meshes, and states without influence.

Components declare the meaning of a state's values, ``gl.Variable(..., words={0: "open: mesh {}"})``.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.flatten.model import FlatModel
from gearlib.language.declarations import Variable
from gearlib.linear.operating_point import Point, slots_at
from gearlib.program.build import build
from gearlib.program.interpret import prepare
from gearlib.reduce.reduction import Structure
from gearlib.run.scene import Scene, needed_states
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]


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
