"""Native functions of a scene: generated source, machine code, and their data and index blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.object_code import CompiledFunction, compiled
from gearlib.flatten.model import FlatModel
from gearlib.native.identifiers import identifiers
from gearlib.native.layout import Layout, Shared, lay_out
from gearlib.native.linear_solve import SOLVE
from gearlib.native.source import HEADER, Body, function, is_small, looped, written_out
from gearlib.native.sparse_solve import SPARSE_SOLVE
from gearlib.program.derivative_plan import DerivativePlan
from gearlib.program.interpret import Prepared
from gearlib.program.program import Program
from gearlib.program.relations import Relations

if TYPE_CHECKING:
    from gearlib.native.jacobian import Pattern
    from gearlib.native.tangent_source import TangentVectors

Integers = NDArray[np.int64]


# Header entries of ``index``: offsets of the integers of each function, and of the tables
RHS, JAC, ROOTS, UPDATE, TABLES = range(5)


@dataclass(frozen=True)
class NativeFunction:
    """A compiled function with its sections of the data and index blocks."""

    machine_code: CompiledFunction
    body: Body
    layout: Layout
    source: str

    @property
    def address(self) -> int:
        return self.machine_code.address


@dataclass(frozen=True)
class NativeScene:
    """All native functions of a scene, sharing one data and one index block."""

    rhs: NativeFunction
    jac: NativeFunction | None
    pattern: Pattern | None
    roots: NativeFunction | None
    update: NativeFunction | None
    shared: Shared
    index: Integers
    size: int  # of the data block
    tangent_numbers: int = 0  # offset of the numbers of `tangent_body`
    vectors: TangentVectors | None = None  # where the right-hand side is that of `vector_body`
    noted_steps: int = 0  # offset of the outer iterations recorded by `update_body`
    common: list[Any] = field(default_factory=list)  # cache: what the problems of all runs have in common, made by `problem_of`
    filled: list[Any] = field(default_factory=list)  # cache of `data_block`: solution matrices, and a block with them

    def parts(self, numbers: Prepared, relations: Prepared | None) -> Iterator[tuple[NativeFunction, Prepared]]:
        """The functions, each with the numbers of its program."""
        for part in (self.rhs, self.jac):
            if part is not None:
                yield part, numbers
        if relations is not None:
            for part in (self.roots, self.update):
                if part is not None:
                    yield part, relations


def rhs_source(
    program: Program, layout: Layout, names: Callable[[], Sequence[str]], parameter_names: Sequence[str]
) -> tuple[str, Body]:
    """Source of the right-hand side: unrolled for small programs, else in loops, which need no names."""
    if is_small(program):
        body = written_out(program, layout, dict(enumerate(identifiers(names()))), parameter_names)
    else:
        body = looped(program, layout, guarded=True)
    return function("rhs", ["x", "dx", "data", "index"], body, RHS), body


def compile_scene(
    program: Program, relations: Relations | None, names: Callable[[], Sequence[str]], model: FlatModel,
    jacobian: DerivativePlan | None, tangents: DerivativePlan | None = None, changed: Sequence[tuple[int, int]] | None = None,
) -> NativeScene:  # fmt: skip
    """Compile the functions that a run needs.

    Parameters
    ----------
    program : Program
        Computes the derivatives of the states.
    relations : Relations, optional
        Given where the program uses relations.
    names : callable
        Returns the names of the slots.
    model : FlatModel
        The whole model, for its parameters and discrete state.
    jacobian : DerivativePlan, optional
        Derivatives of the outputs with respect to the states, where the analytic Jacobian is wanted.
    tangents : DerivativePlan, optional
        Their derivatives in directions, one seed each, where the right-hand side is extended by tangents.
    changed : sequence of (parameter, direction), optional
        Entries of the parameter table that directions change, where these change no discrete variables.
    """
    shared = Shared(len(model.parameters.names), model.n_discrete, len(program.inputs))
    vectors: TangentVectors | None = None
    layout = lay_out(program, shared, shared.size, None if tangents is None else tangents.multiplied, keep=True)
    if tangents is None:
        text, body = rhs_source(program, layout, names, model.parameters.names)
        weights = end = layout.size + body.n_coefficients
    else:
        from gearlib.native.jacobian import tangent_body
        from gearlib.native.tangent_source import vector_body

        found = None if changed is None else vector_body(program, layout, tangents, changed)
        if found is not None:
            text, body, vectors, end = found
            weights = vectors.place
        else:
            body, weights, end = tangent_body(program, layout, tangents)
            text = function("rhs", ["x", "dx", "data", "index"], body, RHS)
    rhs = compile_function("rhs", text, body, layout, fused=vectors is not None)
    guards = layout.guards, program.n_guards
    noted, jac, pattern, roots, update = 0, None, None, None, None
    if jacobian is not None:
        from gearlib.native.jacobian import jacobian_body, pattern_of

        layout = lay_out(program, shared, end, jacobian.multiplied, keep=True)
        copies = 0 if tangents is None else tangents.n_seeds
        pattern = pattern_of(jacobian, copies)
        body, end = jacobian_body(program, layout, jacobian, copies)
        jac = compile_function("jac", function("jac", ["x", "values", "data", "index"], body, JAC), body, layout)
    if relations is not None:
        from gearlib.native.events import MOST_STEPS, roots_body, update_body

        layout = lay_out(relations.program, shared, end, keep=True)
        if len(relations.searched):
            body = roots_body(relations, layout)
            roots = compile_function("roots", function("roots", ["x", "values", "data", "index"], body, ROOTS), body, layout)
        body = update_body(relations, layout, model, guards, tangents is not None)
        noted = end = layout.size + body.n_coefficients
        if tangents is not None:
            end += 1 + MOST_STEPS * (model.n_discrete + len(program.states))
        update = compile_function("update", function("update", ["x", "fired", "data", "index"], body, UPDATE), body, layout)
    packed: list[Integers] = []
    bases, base = [], 5
    for part in (rhs, jac, roots, update):
        bases.append(base)
        if part is not None:
            packed.append(part.body.packed(base))
            base += len(packed[-1])
    index = np.concatenate([np.array([*bases, 0], np.int64), *packed])
    return NativeScene(rhs, jac, pattern, roots, update, shared, index, end, weights, vectors, noted)


def compile_function(name: str, text: str, body: Body, layout: Layout, fused: bool = False) -> NativeFunction:
    """Compile one function; ``fused``: whether fused multiply-add instructions may be used."""
    full = HEADER + (SOLVE if " solve(" in text else "") + (SPARSE_SOLVE if "sparse_" in text else "") + text
    return NativeFunction(compiled(full, name, fused), body, layout, full)
