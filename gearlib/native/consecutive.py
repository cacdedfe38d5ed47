"""Unit-stride loops over runs of consecutive slots: linear equations of neighbouring instances, vectorisable.

Slots are numbered so that neighbours in a chain are adjacent. A run is a range of rows in which every slot grows by one; within it the
loop reads and writes contiguous memory, which the compiler vectorises. The coefficients of a linear equation depend on parameters only,
so they are computed once before integration and stored contiguously as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import rest_of
from gearlib.program.program import Batch

Integers = NDArray[np.int64]
SHORTEST = 8  # average run length, in rows, below which unit-stride loops do not pay


def starts_of_runs(columns: Integers) -> Integers:
    """First rows of the runs of unit stride in all columns.

    >>> starts_of_runs(np.array([[0, 5], [1, 6], [2, 9], [3, 10]]))
    array([0, 2])
    >>> starts_of_runs(np.empty((0, 1)))
    array([], dtype=int64)
    """
    breaks = (np.diff(columns, axis=0) != 1).any(axis=1)
    return np.flatnonzero(np.concatenate([np.ones(len(columns[:1]), bool), breaks]))


def has_runs(batch: Batch) -> bool:
    """Whether a batch (of one sign pattern) is a linear equation in mostly unit-stride runs."""
    kernel = batch.kernel
    if len(batch) < SHORTEST or not kernel.columns or kernel.relations or (batch.argument_signs == 0).any():
        return False
    rest = rest_of(kernel)
    slopes = [batch.derivative(a).kernel for a in range(len(kernel.columns))]
    if rest.on_time or rest.relations or any(k.columns or k.relations or k.on_time for k in slopes):
        return False
    starts = starts_of_runs(np.column_stack([batch.targets, batch.arguments]))
    return len(batch) >= SHORTEST * len(starts)


def coefficient_batches(batch: Batch) -> list[Batch]:
    """Batches for the parameter-dependent coefficients and the constant term, computed before a run."""
    slopes = (batch.derivative(a) for a in range(len(batch.kernel.columns)))
    found = [slope for slope in slopes if slope.kernel.number is None]
    return found if rest_of(batch.kernel).is_zero else [*found, batch.rest]


def run_lines(batch: Batch, place: str) -> list[str]:
    """The loop over runs; ``place`` is the position of the index array made by `run_index`."""
    n_x, n_q = batch.arguments.shape[1], len(coefficient_batches(batch))
    width = 2 + n_x + n_q
    terms, q = [], 0
    for a in range(n_x):
        slope = batch.derivative(a)
        if slope.kernel.number is None:
            terms.append(f"+ data[q{q} + k] * data[x{a} + k]")
            q += 1
        else:
            number = slope.kernel.number * int(slope.signs[0])
            factor = "" if abs(number) == 1.0 else f"{abs(number)!r} * "
            terms.append(f"{'-' if number < 0 else '+'} {factor}data[x{a} + k]")
    if not rest_of(batch.kernel).is_zero:
        terms.append(f"+ data[q{q} + k]")
    label = batch.kernel.template.label.replace("\n", " ")
    return [
        f"# {label}",
        f"o = {place}",
        "for g in range(index[o]):",
        f"    h = o + 1 + {width} * g",
        "    y = index[h + 1]",
        *(f"    x{a} = index[h + {2 + a}]" for a in range(n_x)),
        *(f"    q{i} = index[h + {2 + n_x + i}]" for i in range(n_q)),
        "    for k in parallel(index[h]):",
        f"        data[y + k] = {' '.join(terms).removeprefix('+ ')}",
    ]


def run_index(batch: Batch, slots_at: int, coefficients_at: int) -> Integers:
    """Number of runs, then for each its length and the offsets in ``data`` of its first slots and its coefficients."""
    columns = np.column_stack([batch.targets, batch.arguments])
    starts = starts_of_runs(columns)
    lengths = np.diff([*starts, len(batch)])
    n_q = len(coefficient_batches(batch))
    places = coefficients_at + starts[:, None] + len(batch) * np.arange(n_q)[None, :]
    return np.concatenate([[len(starts)], np.column_stack([lengths, slots_at + columns[starts], places]).ravel()]).astype(
        np.int64
    )
