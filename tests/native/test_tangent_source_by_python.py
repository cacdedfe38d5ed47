"""Tangents in vectors, carried out by Python with the memory as it lies: products with the derivatives by states and parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gearlib.compiler.instructions import LANES
from gearlib.native.jacobian import inverted_blocks
from gearlib.native.layout import fill, lay_out
from gearlib.native.tangent_source import MOST_LINES, TangentVectors, vector_body
from gearlib.program.derivative_plan import derivative_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import block_solve
from gearlib.program.program import Linear
from tests.compiler.test_translate import SCOPE
from tests.native.test_generated import Carried, at_point, close


class Memory:
    """Arrays at addresses, a million numbers apart; a vector is read and written at its address."""

    def __init__(self, *arrays: Any) -> None:
        self.arrays = arrays

    def at(self, address: int) -> Any:
        number, offset = divmod(address, 8_000_000)
        assert offset % 8 == 0
        return self.arrays[number - 1][offset // 8 :]

    class Vector:
        def __init__(self, numbers: Any) -> None:
            self.numbers = numbers[:LANES]
            assert len(self.numbers) == LANES, "beyond the end"

        def __getitem__(self, place: int) -> Any:
            assert place == 0
            return self.numbers.copy()

        def __setitem__(self, place: int, values: Any) -> None:
            assert place == 0
            self.numbers[:] = values

    def vector(self, address: int) -> Any:
        return self.Vector(self.at(address))


def carried_out(text: str, t: float, x: Any, out: Any, data: Any, index: Any) -> int:
    memory = Memory(x, out, data)
    names: dict[str, Any] = SCOPE | {
        "floats_at": memory.at,
        "lanes_at": memory.vector,
        "in_lanes": lambda v: np.full(LANES, float(v)),
    }
    exec("from __future__ import annotations\n" + text, names)
    return int(names["rhs"](t, 8_000_000, 16_000_000, 24_000_000, index))


@pytest.mark.parametrize("kind", ["bound", "quotients", "blocks", "chain"])
@pytest.mark.parametrize("count", [1, 2, 3, 8, 9, 10, 11, 17])
def test_tangents_are_products_with_derivatives(kind: str, count: int) -> None:
    """In vectors of eight, the last of which may be shorter; one or two columns that remain are numbers."""
    p = at_point(kind)
    n, n_slots, outputs = len(p.program.states), p.program.n_slots, p.program.output_slots
    used = sorted({int(q) for batch in p.batches for q in batch.parameters.ravel()})
    rng = np.random.default_rng(count)
    changed = [(q, k) for q in used for k in range(count) if rng.random() < 0.6 or q == used[0]]
    whole = derivative_plan(p.program, [(k, k) for k in range(n)] + [(n_slots + q, n + i) for i, q in enumerate(used)], outputs)
    matrices = dense(whole, entries(whole, At(p.numbers, p.t, p.slots, p.flags)))
    seeds = [(i, k) for i in range(n) for k in range(count)] + [(n_slots + q, k) for q, k in changed]
    plan = derivative_plan(p.program, seeds, outputs, count)
    tangents, amounts = rng.normal(size=(n, count)), rng.normal(size=len(changed))
    weights = np.zeros((len(used), count))
    for (q, k), amount in zip(changed, amounts, strict=True):
        weights[used.index(q), k] = amount
    which = 1
    own = Carried(p, which)
    layout = lay_out(p.program, own.shared, own.shared.size, plan.multiplied, keep=True)
    found = vector_body(p.program, layout, plan, changed)
    assert found is not None
    text, body, vectors, end = found
    assert vectors.parameters == tuple(dict.fromkeys(q for q, _ in changed))
    assert vectors.width == LANES * -(-count // LANES)
    assert vectors.place == layout.size + body.n_coefficients
    data = np.full(end, np.nan)
    data[: own.shared.n_parameters] = p.numbers.parameters
    data[own.shared.relations : own.shared.inputs] = p.flags[:, which]
    data[own.shared.inputs : own.shared.size] = p.slots[n : n + own.shared.n_inputs, which]
    data[layout.guards : layout.size] = 0.0
    fill(data, layout, body.coefficients, p.numbers)
    data[vectors.place : vectors.place + vectors.size] = vectors.weights(changed, amounts.tolist())
    at = vectors.place + vectors.size
    for step, equations in inverted_blocks(plan):
        assert isinstance(step.step, Linear)
        part = block_solve(p.numbers, step.block, np.eye(len(step.step.unknowns))[:, equations])[step.rows].ravel()
        data[at : at + len(part)] = part
        at += len(part)
    assert end == at + LANES
    kept = data[:at].copy()
    beyond = np.full(LANES, np.nan)  # is neither read nor written
    x, out = np.concatenate([own.states, tangents.ravel(), beyond]), np.full(n * (1 + count) + LANES, np.nan)
    index = np.concatenate([np.array([5, 0, 0, 0, 0], np.int64), body.packed(5)]).tolist()
    assert carried_out(text, float(p.t[which]), x, out, data, index) == 0
    changes = ~np.isclose(data[:at], kept, rtol=0.0, atol=0.0, equal_nan=True)
    changes[layout.guards : layout.size] = False
    assert not changes.any()
    close(out[:n], p.slots[outputs, which])
    expected = matrices[which][:, :n] @ tangents + matrices[which][:, n:] @ weights
    assert np.isnan(out[n * (1 + count) :]).all()
    close(out[n : n * (1 + count)].reshape(n, count), expected, np.abs(matrices[which]).max())


def test_weights_lie_in_rows_of_whole_vectors() -> None:
    """Those of one parameter and column add up."""
    own = TangentVectors(100, (7, 3), 8)
    found = own.weights([(3, 0), (7, 5), (3, 0), (3, 7)], [1.0, 2.0, 4.0, 8.0]).reshape(2, 8)
    expected = np.zeros((2, 8))
    expected[1, 0], expected[0, 5], expected[1, 7] = 5.0, 2.0, 8.0
    assert found.tolist() == expected.tolist()
    assert own.size == 16


def test_only_small_programs_are_written_in_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that are written out, with two thousand vectors at most."""
    p = at_point("chain")
    n, rows = len(p.program.states), sum(len(s.targets if not isinstance(s, Linear) else s.unknowns) for s in p.program.steps)  # type: ignore[union-attr]
    own = Carried(p, 0)
    for count, most, small in ((8, rows, True), (8, rows - 1, False), (9, 2 * rows, True), (9, 2 * rows - 1, False)):
        monkeypatch.setattr("gearlib.native.tangent_source.MOST_LINES", most)
        plan = derivative_plan(p.program, [(i, k) for i in range(n) for k in range(count)], p.program.output_slots, count)
        layout = lay_out(p.program, own.shared, own.shared.size, plan.multiplied, keep=True)
        assert (vector_body(p.program, layout, plan, []) is not None) == small
    monkeypatch.setattr("gearlib.native.tangent_source.MOST_LINES", MOST_LINES)
    assert vector_body(p.program, layout, plan, []) is not None
    monkeypatch.setattr("gearlib.native.source.LONGEST", 1)
    assert vector_body(p.program, layout, plan, []) is None
