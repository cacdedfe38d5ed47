"""Native functions of a scene: generated source, machine code, and their data and index blocks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.object_code import CompiledFunction, compiled
from gearlib.native.events import MOST_STEPS, root_numbers, roots_body, update_body
from gearlib.native.identifiers import identifiers
from gearlib.native.jacobian import Pattern, jacobian_body, pattern_of, tangent_body
from gearlib.native.layout import Layout, Shared, lay_out
from gearlib.native.linear_solve import SOLVE
from gearlib.native.source import HEADER, Body, function, is_small, looped, written_out
from gearlib.program.derivative_plan import DerivativePlan
from gearlib.program.program import Program
from gearlib.program.relations import Relations

Integers = NDArray[np.int64]


RHS, JAC, ROOTS, UPDATE, TABLES = range(5)  # entries of ``index`` that say where each function's integers begin, and tables'


@dataclass(frozen=True)
class NativeFunction:
    """A compiled function and its parts of the data and index blocks."""

    machine_code: CompiledFunction
    body: Body
    layout: Layout
    source: str

    @property
    def address(self) -> int:
        return self.machine_code.address


@dataclass(frozen=True)
class NativeScene:
    """All native functions of a scene, with one data and one index block between them."""

    rhs: NativeFunction
    jac: NativeFunction | None
    pattern: Pattern | None
    roots: NativeFunction | None
    update: NativeFunction | None
    shared: Shared
    index: Integers
    size: int  # of the data block
    tangent_numbers: int = 0  # where in it those of `tangent_body` begin, and
    noted_steps: int = 0  # where `update_body` notes its steps


def rhs_source(
    program: Program, layout: Layout, names: Callable[[], Sequence[str]], parameter_names: Sequence[str]
) -> tuple[str, Body]:
    """Source of the right-hand side: written out where it is small, else in loops, which need no names."""
    if is_small(program):
        body = written_out(program, layout, dict(enumerate(identifiers(names()))), parameter_names)
    else:
        body = looped(program, layout, guarded=True)
    return function("rhs", ["x", "dx", "data", "index"], body, RHS), body


def compile_scene(
    program: Program, relations: Relations | None, names: Callable[[], Sequence[str]], parameter_names: Sequence[str],
    n_relations: int, n_discrete: int, jacobian: DerivativePlan | None, tangents: DerivativePlan | None = None,
) -> NativeScene:  # fmt: skip
    """Compile what a run needs.

    Parameters
    ----------
    program : Program
        Computes the derivatives of the states.
    relations : Relations, optional
        Where the program uses relations.
    names : callable
        Gives those of the slots.
    parameter_names : sequence of str
    n_relations, n_discrete : int
        Of the whole model.
    jacobian : DerivativePlan, optional
        The derivatives of the outputs with respect to the states, where the analytic Jacobian is wanted.
    tangents : DerivativePlan, optional
        Their derivatives in directions, a seed each, where the right-hand side goes on with tangents.
    """
    n_modes = n_relations + (2 * n_discrete + 1 if n_discrete else 0)
    shared = Shared(len(parameter_names), n_modes, len(program.inputs))
    layout = lay_out(program, shared, shared.size, None if tangents is None else tangents.multiplied)
    if tangents is None:
        text, body = rhs_source(program, layout, names, parameter_names)
        weights = end = layout.size + body.n_coefficients
    else:
        body, weights, end = tangent_body(program, layout, tangents)
        text = function("rhs", ["x", "dx", "data", "index"], body, RHS)
    rhs = compile_function("rhs", text, body, layout)
    guards = layout.guards, program.n_guards
    noted, jac, pattern, roots, update = 0, None, None, None, None
    if jacobian is not None:
        layout = lay_out(program, shared, end, jacobian.multiplied)
        copies = 0 if tangents is None else tangents.n_seeds
        pattern = pattern_of(jacobian, copies)
        body, end = jacobian_body(program, layout, jacobian, copies)
        jac = compile_function("jac", function("jac", ["x", "values", "data", "index"], body, JAC), body, layout)
    if relations is not None:
        layout = lay_out(relations.program, shared, end)
        if len(root_numbers(relations)):
            body = roots_body(relations, layout)
            roots = compile_function("roots", function("roots", ["x", "values", "data", "index"], body, ROOTS), body, layout)
        body = update_body(relations, layout, n_relations, n_discrete, guards, tangents is not None)
        noted = end = layout.size + body.n_coefficients
        if tangents is not None:
            end += 1 + MOST_STEPS * (n_modes + len(program.states))
        update = compile_function("update", function("update", ["x", "fired", "data", "index"], body, UPDATE), body, layout)
    packed: list[Integers] = []
    bases, base = [], 5
    for part in (rhs, jac, roots, update):
        bases.append(base)
        if part is not None:
            packed.append(part.body.packed(base))
            base += len(packed[-1])
    index = np.concatenate([np.array([*bases, 0], np.int64), *packed])
    return NativeScene(rhs, jac, pattern, roots, update, shared, index, end, weights, noted)


def compile_function(name: str, text: str, body: Body, layout: Layout) -> NativeFunction:
    """Compile the source of one function."""
    full = HEADER + (SOLVE if "solve(" in text else "") + text
    return NativeFunction(compiled(full, name), body, layout, full)
