"""Mode tracking across runs, so that every branch keeps its number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.many_runs.samples import Samples
from gearlib.vibration.mode_matching import branches

Complexes = NDArray[np.complex128]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Branches:
    """Modes of many runs, with each branch in its own column.

    Attributes
    ----------
    eigenvalues : complex array (runs, branches)
        1/s; NaN where a branch has no mode.
    numbers : array (runs, branches)
        Index of the mode among the oscillating ones of the run, from the lowest; NaN where there is none.
    """

    eigenvalues: Complexes
    numbers: NDArray[np.float64]


def followed(samples: Samples, eigenvalues: Complexes, shapes: Complexes) -> Branches:
    """Track modes from each run to its nearest neighbours in parameter space.

    Parameters
    ----------
    samples : Samples
        Varied values.
    eigenvalues : complex array (runs, modes)
        Sorted by magnitude, padded with NaN.
    shapes : complex array (runs, states, modes)
    """
    count = np.isfinite(eigenvalues).sum(axis=1)
    sizes = [np.abs(values[:k]) for values, k in zip(eigenvalues, count, strict=True)]
    own = [table[:, :k] for table, k in zip(shapes, count, strict=True)]
    modes = branches(nearest_first(samples, np.flatnonzero(count)), own, sizes)
    there = modes >= 0
    found = np.full(modes.shape, np.nan + 0j)
    found[there] = eigenvalues[np.nonzero(there)[0], modes[there]]
    return Branches(found, np.where(there, modes, np.nan))


def nearest_first(samples: Samples, runs: Integers) -> list[tuple[int, int]]:
    """Order of the runs in which each follows a nearby earlier one, as pairs; the first one follows -1.

    The pairs are the minimum spanning tree of the runs in parameter space, with each parameter scaled to its range (Prim).

    >>> from gearlib.many_runs.samples import as_samples
    >>> nearest_first(as_samples({"a": [0.0, 3.0, 1.0, 2.0]}), np.arange(4))
    [(0, -1), (2, 0), (3, 2), (1, 3)]
    """
    if not len(runs):
        return []
    columns = [column[runs] for column in samples.numbers.values()] or [runs.astype(float)]
    place = np.column_stack(columns)
    width = np.ptp(place, axis=0)
    place = (place - place.min(axis=0)) / np.where(width > 0.0, width, 1.0)
    distance, nearest = np.full(len(runs), np.inf), np.full(len(runs), -1)
    open_, here, found = np.ones(len(runs), bool), 0, []
    for _ in range(len(runs)):
        found.append((int(runs[here]), int(runs[nearest[here]]) if nearest[here] >= 0 else -1))
        open_[here] = False
        new = np.square(place - place[here]).sum(axis=1)
        closer = open_ & (new < distance)
        distance[closer], nearest[closer] = new[closer], here
        here = int(np.argmin(np.where(open_, distance, np.inf)))
    return found
