"""Speeds that a locked element holds at rest, such as the slip of a locked clutch.

A held speed differs from one that merely stays constant (as that of a coasting rotor) by a reaction: an unknown that occurs in the
equation ``der(v) = 0`` in another discrete state, but not in this one, and that responds when the equation is perturbed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.program.build import build
from gearlib.program.derivatives import SINGULAR, At, derivatives, equilibrating, newton_matrix, slopes
from gearlib.program.interpret import COMPLIANCE, Prepared, evaluate, prepare
from gearlib.program.program import Newton
from gearlib.reduce.reduction import Structure
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
REACTION = 1e-13  # relative to the largest response in a block, or to the terms of a response: smaller ones are rounding


def held_speeds(structure: Structure, prepared: Prepared, t: float, slots: Floats, discrete: Floats) -> Floats:
    """The speeds ``v = c x`` that the discrete state at a point holds, as rows c over the states of a program.

    Parameters
    ----------
    structure : Structure
    prepared : Prepared
        The program that computes the rates of the states. A speed that needs states outside it is omitted.
    t : float
    slots, discrete : arrays
        Values of the program's slots, and discrete state, at the point.
    """
    speeds = _nodes(prepared, t, slots, discrete)
    states = prepared.program.states
    place = {node: i for i, node in enumerate(states)}
    rows = [np.eye(len(states))[place[v]] for v in speeds if v in place]
    others = [v for v in speeds if v not in place]
    if others:
        program = build(structure, others, None, dynamic=False)
        if set(program.states) <= set(states):
            program = build(structure, others, states, dynamic=False)
            ready = prepare(program, structure, prepared.parameters)
            known, inputs, _ = np.split(slots[:, None], np.cumsum([len(states), len(program.inputs)]))
            values = evaluate(ready, np.array([t]), known, inputs, discrete[:, None])[:, 0]
            d = derivatives(ready, t, values, discrete, range(len(states)), wanted=program.output_slots)
            rows += list(d.toarray() if hasattr(d, "toarray") else d)
    return np.array(rows, float).reshape(len(rows), len(states))


def _nodes(prepared: Prepared, t: float, slots: Floats, discrete: Floats) -> list[Node]:
    """Nodes v for which an equation imposes ``der(v) = 0`` in this discrete state, maintained by a reaction."""
    blocks = [s for s in prepared.program.steps if isinstance(s, Newton)]
    if not blocks:
        return []
    nodes = {slot: node for node, slot in prepared.program.slots.items() if node[1] > 0}
    found: list[Node] = []
    for step in blocks:
        changing = [b for b in step.residuals if b.relations.shape[1]]
        if changing:
            found += _held_in(step, changing, nodes, prepared, t, slots, discrete)
    return list(dict.fromkeys(found))


def _held_in(
    step: Newton, changing: list[Any], nodes: dict[int, Node], prepared: Prepared, t: float, slots: Floats, discrete: Floats
) -> list[Node]:
    at = At(prepared, np.array([t]), slots[:, None], discrete[:, None])
    place = {int(slot): i for i, slot in enumerate(step.unknowns)}
    found = []
    response: tuple[Floats, Floats] | None = None  # of the unknowns to each equation, and the terms of its rounding
    for batch in changing:
        terms: dict[int, dict[int, float]] = {}
        for rows, columns, values in slopes(batch, at):
            for r, c, value in zip(rows.tolist(), columns.tolist(), np.abs(values).tolist(), strict=True):
                terms.setdefault(r, {})[c] = value
        for r, sizes in terms.items():
            only = [c for c, size in sizes.items() if size > COMPLIANCE * max(sizes.values())]
            if len(only) != 1 or (slot := only[0]) not in place or slot not in nodes:
                continue
            others = [place[c] for c in batch.arguments[r].tolist() if c in place and c != slot]
            if response is None:
                response = _response(newton_matrix(step, at)[0])
            answer, rounded = (answers[:, batch.targets[r]] for answers in response)
            if (answer > REACTION * np.minimum(answer.max(), rounded))[others].any():
                v, k = nodes[slot]
                found.append((v, k - 1))
    return found


def _response(matrix: Floats) -> tuple[Floats, Floats]:
    """Response of each unknown of a block to a perturbation of each equation, with its terms; elements in parallel share it."""
    rows, columns = equilibrating(matrix)
    scaled = matrix * rows[:, None] * columns
    if np.linalg.cond(scaled) < SINGULAR:
        answers: Floats = np.abs(np.linalg.inv(matrix))
    else:  # an inverse would be that of rounding errors
        answers = np.abs(np.linalg.pinv(scaled, rcond=1 / SINGULAR)) * columns[:, None] * rows
    return answers, answers @ np.abs(matrix) @ answers
