"""Diagnosis of failed runs: the variable, component and expression that could not be evaluated, found with NumPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.program.interpret import Prepared, batch_values, evaluate, labelled
from gearlib.program.program import Batch
from gearlib.run.scene import Scene, node_name

Floats = NDArray[np.float64]
AHEAD = (0.0, *np.logspace(-16, -3, 14).tolist())  # fractions of the run at which the tangent to the solution is evaluated


def culprit(scene: Scene, numbers: Prepared, t: float, span: float, x: Floats, inputs: Floats, discrete: Floats) -> str:
    """The expression that cannot be evaluated at the end of a failed run, as part of its message; else the state that changes fastest.

    Parameters
    ----------
    scene, numbers : Scene, Prepared
    t, span : float
        Time at which the run ended, and its intended length (s).
    x, inputs, discrete : arrays
        States, inputs and discrete state at that time.
    """
    program, n = scene.program, len(scene.states)
    if not np.isfinite(x).all():
        return ""
    rate = np.zeros(n)
    for share in AHEAD:
        now = np.array([t + share * span])
        with np.errstate(all="ignore"):
            try:
                at = now, (x + share * span * rate)[:, None], inputs[:, None], discrete[:, None], None
                slots = evaluate(numbers, *at)
                if numbers.relations is not None:
                    evaluate(numbers.relations, *at)
            except SolverError as unsolved:  # if no guess matters, the compiled code met the same
                return "" if program.iterated else f"; {unsolved}"
        if not np.isfinite(slots).all():
            return _first(scene, numbers, now, slots, discrete)
        if not share:
            rate = slots[program.output_slots, 0]
    if not n:
        return ""
    pace = np.abs(rate) / np.maximum(np.abs(x), scene.nominal)
    i = int(np.argmax(pace))
    if not pace[i] * span > 1e3:
        return ""
    return (
        f"; fastest of all goes {scene.state_names[i]} = {x[i]:.6g}, with der({scene.state_names[i]}) = {rate[i]:.6g}"
        + _solved(scene, int(program.output_slots[i]))
    )


def _solved(scene: Scene, slot: int) -> str:
    """The equation that a slot is computed from."""
    for step in scene.program.steps:
        if isinstance(step, Batch) and slot in step.targets:
            row = int(np.flatnonzero(step.targets == slot)[0])
            return f" from {labelled(scene.structure, step, row)}"
    return ""


def _first(scene: Scene, numbers: Prepared, t: Floats, slots: Floats, discrete: Floats) -> str:
    """The first non-finite value, the equation that it comes from, and the operands."""
    for step in scene.program.steps:
        if not isinstance(step, Batch):
            continue
        values = batch_values(step, t, slots, numbers.parameters, discrete[:, None]) * np.ones((len(step), 1))
        wrong = np.flatnonzero(~np.isfinite(values[:, 0]))
        if len(wrong):
            row = int(wrong[0])
            node = next((n for n, slot in scene.program.slots.items() if slot == step.targets[row]), None)
            name = "a value" if node is None else node_name(scene.model, node)
            return f"; {name} is {values[row, 0]:g} there, from {labelled(scene.structure, step, row)}" + _numbers(
                scene, step, row, t, slots, numbers
            )
    return ""


def _numbers(scene: Scene, batch: Batch, row: int, t: Floats, slots: Floats, numbers: Prepared) -> str:
    """The operands of an equation, by name."""
    known = {slot: node_name(scene.model, node) for node, slot in scene.program.slots.items()}
    found = {known.get(slot, "a value"): slots[slot, 0] for slot in batch.arguments[row].tolist()}
    found |= {scene.model.parameters.names[p]: numbers.parameters[p] for p in batch.parameters[row].tolist()}
    found |= {"time": t[0]} if batch.kernel.on_time else {}
    return ", with " + ", ".join(f"{name} = {value:.6g}" for name, value in found.items()) if found else ""
