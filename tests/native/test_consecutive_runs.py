"""Runs of consecutive slots: where they begin, what has them, and loops over them against the interpreter."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.native.consecutive import SHORTEST, coefficient_batches, has_runs, run_index, run_lines, starts_of_runs
from gearlib.native.source import sign_groups
from gearlib.program.interpret import batch_values, constant_values
from gearlib.program.program import Batch
from tests.compiler.test_translate import Chain


@cache
def long_chain() -> Any:
    """The scene of a chain, its numbers, and the rows of its equations that have one pattern of signs."""
    translation = gl.compile(Chain(n=30)).translation
    parts = [s.take(rows) for s in translation.scene.program.steps if isinstance(s, Batch) for rows in sign_groups(s)]
    return translation.scene, translation.scene.numbers(translation.parameter_values({})), parts


@pytest.mark.parametrize("seed", range(5))
def test_a_run_ends_where_any_column_does_not_grow_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = np.cumsum(np.where(rng.random((40, 3)) < 0.9, 1, rng.integers(-3, 4, (40, 3))), axis=0)
    starts = starts_of_runs(columns).tolist()
    assert starts[0] == 0
    for i in range(1, 40):
        assert (i in starts) == bool((columns[i] - columns[i - 1] != 1).any())
    assert starts_of_runs(columns[:1]).tolist() == [0]


def test_linear_equations_of_neighbours_have_runs() -> None:
    """Of eight rows on average at least; nothing that is short, nonlinear, or of time."""
    _, _, parts = long_chain()
    found = [part for part in parts if has_runs(part)]
    assert len(found) > 2
    for part in parts:
        starts = starts_of_runs(np.column_stack([part.targets, part.arguments]))
        slopes = [part.derivative(a).kernel for a in range(len(part.kernel.columns))]
        linear = (
            bool(slopes) and not any(k.columns or k.relations or k.on_time for k in slopes) and not part.rest.kernel.on_time
        )
        assert has_runs(part) == (linear and len(part) >= SHORTEST * len(starts))
    part = found[0]
    assert has_runs(part.take(np.arange(SHORTEST)))
    assert not has_runs(part.take(np.arange(SHORTEST - 1)))
    assert not has_runs(part.take(np.arange(len(part))[::-1]))
    assert not has_runs(part.rest)  # has no slots to read
    signs = part.argument_signs.copy()
    signs[0, 0] = 0
    assert not has_runs(replace(part, argument_signs=signs))


@pytest.mark.parametrize("gaps", [(), (9,), (3, 4, 20)])
@pytest.mark.parametrize("number", range(3))
def test_loops_over_runs_compute_what_the_interpreter_does(number: int, gaps: tuple[int, ...]) -> None:
    """The lines are carried out by Python, on a block with the slots at 5 and the coefficients behind them; rows left out are ``gaps``."""
    scene, numbers, parts = long_chain()
    part = [part for part in parts if has_runs(part)][number]
    part = part.take(np.delete(np.arange(len(part)), gaps))
    rng, n = np.random.default_rng(number), scene.program.n_slots
    slots = rng.normal(size=n)
    coefficients = [constant_values(b, numbers.parameters) for b in coefficient_batches(part)]
    data = np.concatenate([np.full(5, np.nan), slots, *coefficients])
    index = np.concatenate([[99, 98], run_index(part, 5, 5 + n)])
    scope = {"data": data, "index": index, "parallel": range}
    exec("\n".join(run_lines(part, "2")), scope)
    none = np.zeros((scene.n_discrete, 1))
    expected = batch_values(part, np.zeros(1), slots[:, None], numbers.parameters, none)[:, 0]
    assert data[5 + part.targets] == pytest.approx(expected, rel=1e-13, abs=1e-13 * np.abs(expected).max())
    others = np.setdiff1d(np.arange(n), part.targets)
    assert data[5 + others].tolist() == slots[others].tolist()
    assert index[2] == len(starts_of_runs(np.column_stack([part.targets, part.arguments])))
