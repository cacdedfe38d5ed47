"""`TangentDirections`: the directions in which a run is differentiated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Entry = tuple[int, int]  # entry of the parameter table, column


@dataclass(frozen=True, eq=False)
class TangentDirections:
    """One column per name.

    Attributes
    ----------
    names : tuple of str
        Paths of parameters, and of start values as ``"start(load.w)"``.
    entries : tuple of (parameter, column)
        Entries of the parameter table that a column changes.
    weights : array
        Derivative of each of these entries along its column.
    starts : tuple of (variable, column, sign)
        Start values that are themselves directions, by representative variable.
    sizes : array
        Typical size of each direction, in its unit.
    """

    names: tuple[str, ...]
    entries: tuple[Entry, ...]
    weights: Floats
    starts: tuple[tuple[int, int, int], ...]
    sizes: Floats

    def __len__(self) -> int:
        return len(self.names)

    @property
    def seeds(self) -> list[tuple[int, int, float]]:
        """Derivatives of the parameter table: (parameter, column, weight)."""
        return [(p, k, weight) for (p, k), weight in zip(self.entries, self.weights.tolist(), strict=True)]

    @cached_property
    def place(self) -> dict[str, int]:
        """Column of each name."""
        return {name: k for k, name in enumerate(self.names)}
