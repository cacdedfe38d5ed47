"""`same_modes`: matching of modes between operating points, by similarity of shapes and frequencies; `branches`: along many points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def same_modes(before: Any, frequencies_before: Floats, now: Any, frequencies_now: Floats) -> tuple[Integers, Integers]:
    """Match modes with the same modes elsewhere, maximising total similarity.

    Similarity is the square root of the modal assurance criterion (over states scaled to equal size) minus the distance of the
    frequencies (logarithm of their ratio), so that modes with indistinct shapes are matched by frequency.

    Parameters
    ----------
    before, now : complex arrays (states, modes)
        Mode shapes.
    frequencies_before, frequencies_now : arrays (modes,)
        Hz.

    Returns
    -------
    arrays of int
        Indices of modes before, and of the same modes now; as many as the smaller of the two sets.

    References
    ----------
    R. J. Allemang, "The modal assurance criterion", Sound and Vibration 37 (2003).

    Examples
    --------
    >>> shapes = np.eye(2)
    >>> same_modes(shapes, np.array([1.0, 2.0]), shapes[:, ::-1], np.array([1.4, 1.6]))[1]
    array([1, 0])
    """
    from scipy.optimize import linear_sum_assignment

    scale = np.maximum(np.abs(before).max(axis=1, initial=0.0), np.abs(now).max(axis=1, initial=0.0))
    before, now = (m / np.where(scale > 0, scale, 1.0)[:, None] for m in (before, now))
    mac = np.abs(before.conj().T @ now) / np.linalg.norm(before, axis=0)[:, None] / np.linalg.norm(now, axis=0)[None, :]
    apart = np.abs(np.log(frequencies_before[:, None] / frequencies_now[None, :]))
    first, second = linear_sum_assignment(apart - mac)
    return first, second


def branches(order: Iterable[tuple[int, int]], shapes: Sequence[Any], frequencies: Sequence[Floats]) -> Integers:
    """Index of the mode of each branch at each point, shape (points, branches); -1 where a branch has none.

    ``order`` are pairs of a point and an earlier one that it follows, -1 for none. A branch that ends (where its mode is overdamped, for
    instance) is remembered as it was last, and may go on later.
    """
    found = np.full((len(shapes), max(map(len, frequencies), default=0)), -1)
    kept: dict[int, tuple[Any, Floats]] = {}
    for point, before in order:
        now, sizes = shapes[point], frequencies[point]
        known, known_sizes = kept.get(before, (now[:, :0], sizes[:0]))
        there, modes = same_modes(known, known_sizes, now, sizes)
        new = np.setdiff1d(np.arange(len(sizes)), modes)
        there, modes = np.append(there, len(known_sizes) + np.arange(len(new))), np.append(modes, new)
        known, known_sizes = np.hstack([known, now[:, new]]), np.append(known_sizes, sizes[new])
        known[:, there], known_sizes[there] = now[:, modes], sizes[modes]
        kept[point] = known, known_sizes
        found[point, there] = modes
    return found
