"""Sections of the data block: native functions write into their own, and nothing else."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.native.layout import INDIRECT, Layout, operations, substitution
from gearlib.program.program import Batch
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
