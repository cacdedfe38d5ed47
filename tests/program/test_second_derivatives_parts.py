"""Second derivatives against differences of first ones, and changes of batches against those of values: quick, to six digits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gearlib.program.derivative_plan import derivative_plan
from gearlib.program.derivatives import At, entries
from gearlib.program.interpret import batch_values, evaluate
from gearlib.program.second_derivatives import Direction, entry_changes
from tests.program.programs import KINDS, point

H = 1e-6


def differ(high: Any, low: Any, found: Any, h: float = H) -> None:
    expected = (high - low) / (2 * h)
    largest = max(float(np.abs(found).max(initial=0.0)), float(np.abs(expected).max(initial=0.0)))
    noise = 1e-6 * np.maximum(np.abs(found), np.abs(expected)) + 1e-8 * largest + 4e-16 / h * (np.abs(high) + np.abs(low))
    np.testing.assert_array_less(np.abs(found - expected), noise + 1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_changes_of_batches(kind: str) -> None:
    """Along two directions of slots and parameters at once, along slots alone, and along parameters alone."""
    p, rng = point(kind), np.random.default_rng(2)
    now, slots, flags, table = p.t[:1], p.slots[:, :1], p.flags[:, :1], p.numbers.parameters
    at = At(p.numbers, now, slots, flags)
    ways = rng.normal(size=(len(slots), 2)) * np.maximum(np.abs(slots), 1e-2)
    moves = rng.normal(size=(len(table), 2)) * np.where(rng.random((len(table), 1)) < 0.7, np.abs(table)[:, None], 0.0)
    batches = sorted(p.batches, key=len)
    for along in (Direction(ways, moves), Direction(ways, 0 * moves), Direction(0 * ways, moves)):
        assert along.still == (not along.slots.any())
        for batch in batches:
            found = along.of(batch, at)
            assert found.shape == (len(batch), 2)
            for k in range(2):
                high, low = (
                    np.broadcast_to(
                        batch_values(batch, now, slots + s * along.slots[:, [k]], table + s * along.parameters[:, k], flags),
                        (len(batch), 1),
                    )
                    for s in (H, -H)
                )
                differ(high[:, 0], low[:, 0], found[:, k])
    for batch in batches:  # each direction by itself
        single = [Direction(ways[:, [k]], moves[:, [k]]).of(batch, at) for k in range(2)]
        assert [one.shape for one in single] == [(len(batch), 1)] * 2
        assert np.concatenate(single, axis=1) == pytest.approx(Direction(ways, moves).of(batch, at), rel=1e-13)


@pytest.mark.parametrize("by", ["states", "parameters", "both"])
@pytest.mark.parametrize("kind", KINDS)
def test_changes_of_derivatives(kind: str, by: str) -> None:
    """With respect to states, inputs, parameters and a slot, along two directions of states, inputs and parameters."""
    p, rng = point(kind), np.random.default_rng(4)
    program, table, states = p.program, p.numbers.parameters, len(p.program.states)
    n = states + len(program.inputs)
    now, flags, start = p.t[:1], p.flags[:, :1].copy(), p.slots[:, :1]
    if kind == "held":
        flags[p.scene.model.n_relations] = 1.3
    used = sorted({int(q) for b in p.batches for q in b.parameters.ravel()})
    places = [*range(n), *(program.n_slots + q for q in used[:3]), int(program.output_slots[-1])]
    plan = derivative_plan(program, [(place, k) for k, place in enumerate(places)])
    weights = rng.uniform(0.5, 2.0, len(places))
    known = rng.normal(size=(n, 2)) * np.maximum(np.abs(start[:n]), 1e-2) * (by != "parameters")
    moves = np.zeros((len(table), 2))
    if by != "states":
        moves[used] = rng.normal(size=(len(used), 2)) * np.abs(table[used])[:, None]

    def moved(k: int, h: float) -> tuple[At, Any]:
        """The point at some distance along a direction, and the derivatives there."""
        numbers, x = p.scene.numbers(table + h * moves[:, k]), start[:n] + h * known[:, [k]]
        at = At(numbers, now, evaluate(numbers, now, x[:states], x[states:], flags, start), flags)
        return at, entries(plan, at, weights)[:, 0]

    sides = [[moved(k, h) for h in (H, -H)] for k in range(2)]
    ways = np.concatenate([(high.slots - low.slots) / (2 * H) for (high, _), (low, _) in sides], axis=1)
    if by == "parameters":
        ways[:n] = 0.0
    found = entry_changes(plan, moved(0, 0.0)[0], Direction(ways, moves), weights)
    assert found.shape == (len(plan.sources), 2)
    for k, ((_, high), (_, low)) in enumerate(sides):
        differ(high, low, found[:, k])
    assert found.any() or kind == "latch" or (kind, by) == ("bound", "states")
