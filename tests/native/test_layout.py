"""Sections of the data block: native functions write into their own, and nothing else."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.native.layout import (
    CHECKED,
    EACH,
    FACTORISED,
    INDIRECT,
    SEARCH,
    KeptMatrix,
    Layout,
    Shared,
    fill,
    lay_out,
    operations,
    substitution,
)
from gearlib.native.sparse_solve import factors_size
from gearlib.program.interpret import constant_values
from gearlib.program.program import Batch, Linear, Newton
from gearlib.structure.elimination_order import elimination_order
from tests.native.test_evaluator import Crank
from tests.native.test_held_matrices import Gearbox
from tests.program.test_derivatives import Bound, Held
from tests.program.test_interpret import CONSTANT

MODEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[ctypes.c_void_p] * 4)


class Divided(gl.Component):
    """A quotient whose divisor moves, beside equations that are solved together."""

    x = gl.Variable("1", start=0.5)
    y = gl.Variable("1")
    z = gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.rate * self.y),
            gl.Eq(self.y * (2.0 + self.x), 1.0 + self.z),
            gl.Eq(self.z**3 + self.z, self.x),
        ]


class Slipping(gl.Component):
    """A gear with friction between two bodies: a small block that only events change."""

    def assemble(self) -> list[Any]:
        self.one, self.other = gp.Inertia(J=0.1), gp.Inertia(J=0.4)
        self.gear = gp.LossyGear(ratio=2.0, loss_table=[[0.0, 0.9, 0.8, 0.1, 0.2]])
        return [gl.connect(self.one.flange_b, self.gear.flange_a), gl.connect(self.gear.flange_b, self.other.flange_a)]


@pytest.mark.parametrize(
    ("model", "longest"),
    [
        (Bound(), 0),
        (Held(), 0),
        (Crank(), 260),
        (Divided(), 0),
        (Divided(), 260),
        (Gearbox(parallel=True), 260),
        (Slipping(), 260),
    ],
    ids=lambda m: {0: "loops", 260: "statements"}.get(m, type(m).__name__),
)
def test_native_functions_write_into_their_own_section(
    model: gl.Component, longest: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gearlib.native.source.LONGEST", longest)
    system = gl.compile(model)
    scene = system.translation.scene
    native, rng = scene.native_with_jacobian, np.random.default_rng(1)
    numbers = scene.numbers(system.translation.parameter_values({}))
    n, inputs = len(scene.states), np.zeros(len(scene.program.inputs))
    flags = scene.discrete(numbers, np.zeros(1), np.full((n, 1), 0.3), inputs[:, None])[:, 0]
    given = scene.data(native, numbers, inputs, flags, np.zeros(scene.model.n_variables))
    assert len(given) == native.size
    given = np.append(given, np.full(8, 12345.0))  # of something else
    parts = [part for part in (native.rhs, native.jac, native.roots, native.update) if part is not None]
    firsts = sorted({first(part.layout) for part in parts})
    for part in parts:
        data, x, out = given.copy(), rng.uniform(0.2, 0.4, n), np.zeros(64 + n * n)
        assert MODEL(part.address)(0.1, *(a.ctypes.data for a in (x, out, data, native.index))) >= 0
        changed = np.flatnonzero(data != given)
        end = next((at for at in firsts if at > part.layout.slots), native.size)
        own = (changed >= first(part.layout)) & (changed < end)
        if part is native.update:
            own |= (changed >= native.shared.relations) & (changed < native.shared.inputs)
        assert own.all(), changed


def first(layout: Layout) -> int:
    """Where the section of a function begins."""
    return min(*layout.solutions, *(matrix.place for matrix in layout.kept if matrix is not None), layout.slots, layout.slots)


def test_cost_of_an_evaluation_is_that_of_its_operations() -> None:
    """Two for each entry of the solution matrix of a constant block; for sparse factors twice those entries, and a few per unknown."""
    program = CONSTANT.scene.program
    of_batches = sum(len(step) * step.kernel.operations for step in program.steps if isinstance(step, Batch))
    assert operations(program, CONSTANT.scene.layout) == of_batches + 2 * 3 * 2
    costs = {n: substitution(elimination_order(n, np.flatnonzero(np.tri(n)))) for n in (20, 40)}  # n (n + 1) / 2 entries
    for n, cost in costs.items():
        assert 2 * n**2 / 2 < cost < 4 * INDIRECT * n**2
    assert costs[40] == pytest.approx(4 * costs[20], rel=0.1)


def test_parameters_discrete_state_and_inputs_come_first() -> None:
    shared = Shared(5, 3, 2)
    assert (shared.relations, shared.inputs, shared.size) == (5, 8, 10)


@pytest.mark.parametrize("keep", [False, True])
@pytest.mark.parametrize(
    "model", [Bound(), Held(), Divided(), Slipping(), Gearbox(parallel=True)], ids=lambda m: type(m).__name__
)
def test_sections_follow_each_other(model: gl.Component, keep: bool) -> None:
    """Solution matrices, kept matrices, slots, scratch space, determinants, divisors: each as long as what it holds.

    The scratch space of a dense block: right-hand sides, matrix, order of the columns, determinant, magnitudes, compliances.
    """
    program, base = gl.compile(model).translation.scene.program, 100
    found = lay_out(program, Shared(50, 40, 10), base, keep=keep)
    assert (found.relations, found.inputs) == (50, 90)
    at, needed, kept = base, iter(found.needed), iter(found.kept)
    used = {int(s) for s in program.output_slots} | {
        int(a) for s in program.steps if isinstance(s, Batch) for a in s.arguments[s.argument_signs != 0]
    }
    scratch, blocks = 0, 0
    for step in program.steps:
        if isinstance(step, Linear):
            rows = next(needed).tolist()
            assert {int(u) for u in step.unknowns} & used <= {int(step.unknowns[r]) for r in rows}
            assert found.solutions[blocks] == at
            at, blocks = at + len(rows) * len(step.known), blocks + 1
        elif isinstance(step, Newton):
            n, matrix, order = len(step.unknowns), next(kept), step.order
            assert (matrix is not None) == (keep and step.switched)
            if matrix is not None:
                assert matrix.place == at
                rests = {int(t) for b in step.rests for t in b.targets}
                assert set(matrix.known.tolist()) == rests
                assert {int(step.unknowns[r]) for r in matrix.needed} == {int(u) for u in step.unknowns} & used
                stored = len(matrix.needed) * len(rests) if matrix.factors is None else factors_size(matrix.factors)
                assert matrix.size == 1 + len(step.discrete) + stored
                at += matrix.size
            sides = 1 if matrix is None else 1 + len(matrix.known)
            dense, sparse = (
                2 * n * n + sides * n + 2 * n + 1,
                0 if order is None else n + len(order.places) + factors_size(order),
            )
            scratch = max(scratch, sparse or dense)
    assert found.slots == at
    assert found.scratch == at + program.n_slots
    assert found.memory == found.scratch + scratch
    assert found.guards == found.memory + len(program.iterated)
    assert found.size == found.guards + EACH * program.n_guards


def test_unknowns_that_are_read_besides_are_needed() -> None:
    """All slots, of whichever block."""
    for model in (Bound(), Slipping()):
        program = gl.compile(model).translation.scene.program
        found = lay_out(program, Shared(0, 0, 0), 0, np.arange(program.n_slots), keep=True)
        for step, rows in zip((s for s in program.steps if isinstance(s, Linear)), found.needed, strict=True):
            assert rows.tolist() == list(range(len(step.unknowns)))
        for step, matrix in zip((s for s in program.steps if isinstance(s, Newton)), found.kept, strict=True):
            assert matrix is None or matrix.needed.tolist() == list(range(len(step.unknowns)))


def test_numbers_are_written_behind_each_other() -> None:
    system = gl.compile(Bound())
    scene = system.translation.scene
    numbers = scene.numbers(system.translation.parameter_values({}))
    constants = scene.program.linear_blocks[0].matrix[:2]
    assert all(b.of_parameters for b in constants)
    layout = scene.layout
    data = np.full(layout.size + sum(map(len, constants)) + 3, np.nan)
    fill(data, layout, constants, numbers)
    (rows,), (at,), (solution,) = layout.needed, layout.solutions, numbers.solutions
    expected = np.asarray(solution)[rows].ravel()
    assert data[at : at + len(expected)].tolist() == expected.tolist()
    behind = np.concatenate([constant_values(b, numbers.parameters) for b in constants])
    assert data[layout.size : layout.size + len(behind)].tolist() == behind.tolist()
    assert np.isnan(data).sum() == len(data) - len(expected) - len(behind)


def test_cost_of_a_solution_with_a_kept_matrix() -> None:
    """A product, or a substitution where that is stored; made by rows where there are fewer of them."""
    none: Any = np.empty(0, np.int64)
    order = elimination_order(20, np.flatnonzero(np.tri(20)))
    for rows, columns in ((2, 3), (3, 2), (3, 3)):
        matrix = KeptMatrix(0, none, np.arange(rows), (), np.arange(columns), None)
        assert matrix.operations == CHECKED + 2.0 * rows * columns
        assert matrix.by_rows == (rows < columns)
        assert KeptMatrix(0, none, np.arange(rows), (), np.arange(columns), order).operations == CHECKED + substitution(order)
    assert substitution(order) == INDIRECT * (4.0 * order.fill + 2.0 * 20)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize(("model", "turns"), [(Crank(), 2), (Slipping(), 1)])
def test_cost_of_equations_that_are_solved_in_each_evaluation(
    model: gl.Component, turns: int, sparse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their residuals and matrix, and an elimination, with pivots or by the pattern; twice where they are not linear."""
    monkeypatch.setattr("gearlib.program.program.LARGE", 1 if sparse else 1000)
    monkeypatch.setattr("gearlib.program.program.SPARSE", 1.0)
    program = gl.compile(model).translation.scene.program
    layout = lay_out(program, Shared(0, 0, 0), 0)
    (block,) = [step for step in program.steps if isinstance(step, Newton)]
    n, batches = len(block.unknowns), (*block.residuals, *block.jacobian)
    assert (block.order is not None) == sparse
    own = sum(len(b) * (1 + b.kernel.operations) for b in batches)
    own += SEARCH * (2 * n**3 / 3 + 2 * n**2) if block.order is None else FACTORISED * substitution(block.order)
    others = sum(len(s) * s.kernel.operations for s in program.steps if isinstance(s, Batch))
    blocks = sum(2.0 * len(layout.needed[k]) * len(s.known) for k, s in enumerate(program.linear_blocks))
    assert operations(program, layout) == pytest.approx(others + blocks + turns * own)
