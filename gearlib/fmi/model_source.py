"""The functions of an FMU's model in the small language, with their data and index blocks.

They have the signature of all native functions, ``int32 f(double t, double *x, double *values, double *data, int64 *index)``::

    rhs        derivatives of the states
    observe    these and what the outputs need
    jac        nonzeros of their derivatives with respect to states and inputs, by columns
    roots      event functions
    update     event iteration; ``values`` are int32, as in `gearlib.solvers.problem`
    settle     event iteration at the start
    prepare    all of ``data`` that follows from the parameters
    begin      start values: ``x``
    next_time  when a condition of time switches next
    longest_step  what time drives is not stepped over by one

``prepare`` and ``begin`` return 0, or the number of the failed check, counted from 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.fmi.exported_model import ExportedModel
from gearlib.fmi.preparation import INVERT, Part, begin_body, longest_step_body, next_time_body, preparation_body
from gearlib.native.events import roots_body, settle_body, update_body
from gearlib.native.jacobian import Pattern, jacobian_body, pattern_of
from gearlib.native.layout import Shared, lay_out
from gearlib.native.linear_solve import SOLVE
from gearlib.native.scene_functions import rhs_source
from gearlib.native.source import HEADER, Body, function, looped
from gearlib.native.sparse_solve import SPARSE_SOLVE

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
RHS, OBSERVE, JAC, ROOTS, UPDATE, SETTLE, PREPARE, BEGIN, NEXT_TIME, LONGEST_STEP = range(10)
NAMES = ("rhs", "observe", "jac", "roots", "update", "settle", "prepare", "begin", "next_time", "longest_step")


@dataclass(frozen=True, eq=False)
class ModelSource:
    """Source and data of an FMU's model.

    Attributes
    ----------
    text : str
        Source of all functions.
    shared : Shared
        Offsets of parameters, discrete state and inputs in ``data``.
    data : array
        State before `prepare`.
    index : array of int
    pattern : Pattern
        Sparsity pattern of the nonzeros that ``jac`` computes.
    n_roots : int
    checks : tuple of str
        Error messages for the nonzero return values of ``prepare`` and ``begin``.
    """

    text: str
    shared: Shared
    data: Floats
    index: Integers
    pattern: Pattern
    n_roots: int
    checks: tuple[str, ...]


def model_source(exported: ExportedModel) -> ModelSource:
    """Generate the functions of an exported model."""
    scene, model, relations, observed = exported.scene, exported.model, exported.relations, exported.observed
    names = model.parameters.names
    shared = Shared(len(names), scene.n_discrete, len(scene.program.inputs))
    texts: list[str] = []
    bodies: list[Body] = []

    def add(number: int, body: Body, text: str | None = None, fired: bool = False) -> None:
        bodies.append(body)
        arguments = ["x", "fired" if fired else "values", "data", "index"]
        texts.append(text if text is not None else function(NAMES[number], arguments, body, number))

    layout = lay_out(scene.program, shared, shared.size)
    text, body = rhs_source(scene.program, layout, lambda: scene.slot_names, names)
    add(RHS, body, text)
    guards = layout.guards, scene.program.n_guards
    parts = [Part(scene.program, layout, tuple(body.coefficients))]

    wanted = np.concatenate([exported.plan.multiplied, observed.output_slots])
    layout = lay_out(observed, shared, layout.size + body.n_coefficients, wanted)
    body = looped(observed, layout)
    body.lines = [line.replace("dx[", "values[") for line in body.lines]
    add(OBSERVE, body)
    parts.append(Part(observed, layout, tuple(body.coefficients)))
    body, end = jacobian_body(observed, layout, exported.plan)
    add(JAC, body)

    n_roots = 0
    if relations is None:
        for number in (ROOTS, UPDATE, SETTLE):
            add(number, Body(), fired=number == UPDATE)
    else:
        n_roots = len(relations.searched)
        layout = lay_out(relations.program, shared, end)
        body = roots_body(relations, layout) if n_roots else Body()
        add(ROOTS, body)
        body = update_body(relations, layout, model, guards)
        add(UPDATE, body, fired=True)
        parts.append(Part(relations.program, layout, tuple(body.coefficients)))
        end = layout.size + body.n_coefficients
        add(SETTLE, settle_body(relations, layout, model))
    checks: list[str] = []
    body, end = preparation_body(exported, parts, end, checks)
    add(PREPARE, body)
    add(BEGIN, begin_body(exported, parts, shared.inputs, checks))
    add(NEXT_TIME, next_time_body(exported))
    add(LONGEST_STEP, longest_step_body(exported))

    packed: list[Integers] = []
    bases, base = [], len(NAMES)
    for body in bodies:
        bases.append(base)
        packed.append(body.packed(base))
        base += len(packed[-1])
    data = np.zeros(end)
    data[: len(names)] = exported.numbers
    data[shared.relations : shared.inputs] = model.initial_discrete()
    data[shared.inputs : shared.inputs + len(exported.input_starts)] = exported.input_starts
    source = "\n\n".join([HEADER.rstrip(), SOLVE.strip(), SPARSE_SOLVE.strip(), INVERT.strip(), *texts])
    index = np.concatenate([np.array(bases, np.int64), *packed])
    return ModelSource(source, shared, data, index, pattern_of(exported.plan), n_roots, tuple(checks))
