"""Rings: where springs join shafts in a ring, or side by side, the twist of one is the sum of those of the others.

Each spring defines its twist by the absolute angles of its two shafts. Around a ring these equations constrain the twists among
themselves, so that one twist is no state; but computed by its own equation it depends, in structure, on an absolute angle, which would
have to be a state although it cancels. So that equation is replaced by the sum around the ring, in which no absolute angle is left.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gearlib.flatten.attributes import PREFERENCE
from gearlib.flatten.connections import SignedSum, split_sum, sum_groups
from gearlib.flatten.model import FlatModel
from gearlib.reduce.redundancy import rows_by_name, without
from gearlib.structure.rigid_loops import examine

Row = dict[int, int]
"""Variables with their factors, +1 or -1, whose sum is zero."""


def with_sums_around_rings(model: FlatModel) -> FlatModel:
    """The model with the sum around each ring in place of one of its equations.

    The rings are those of equations between positions without any parameters, so that they are rings for all parameters.
    """
    absolute = (model.preference <= PREFERENCE["avoid"]) & ~model.flow
    candidates, rows = _sums_of_positions(model, absolute)
    angles = [{v: float(c) for v, c in row.items() if absolute[v]} for row in rows]
    order, angles, _ = rows_by_name(model, candidates, angles)
    rings, _ = examine(angles, [0.0] * len(order))
    sums: dict[int, SignedSum] = {}
    for ring in rings:
        total = _added([rows[order[r]] for r in ring.rows], ring.multipliers)
        if total:
            sums[candidates[order[ring.last]]] = total
    return _replaced(model, sums) if sums else model


def _sums_of_positions(model: FlatModel, absolute: NDArray[np.bool_]) -> tuple[list[int], list[Row]]:
    """The equations that state nothing but a sum of positions, absolute ones among them, and their terms."""
    other = model.flow.copy()
    other[model.inputs] = True
    candidates: list[int] = []
    rows: list[Row] = []
    for g, group in enumerate(model.groups):
        weights = np.array(group.template.weights or ())
        if not len(weights) or (np.abs(weights) != 1.0).any():
            continue
        factors = group.signs * weights.astype(np.int64)
        fit = (absolute[group.variables] & (factors != 0)).any(axis=1) & ~(other[group.variables] & (factors != 0)).any(axis=1)
        for i in np.flatnonzero(fit).tolist():
            candidates.append(model.first_equations[g] + i)
            rows.append({v: c for v, c in zip(group.variables[i].tolist(), factors[i].tolist(), strict=True) if c})
    return candidates, rows


def _added(rows: Sequence[Row], multipliers: Sequence[float]) -> SignedSum:
    """What is left of the sum of some rows; nothing if the factors in it are not equal but for their signs."""
    total: dict[int, float] = defaultdict(float)
    for row, multiplier in zip(rows, multipliers, strict=True):
        for v, factor in row.items():
            total[v] += multiplier * factor
    left = {v: factor for v, factor in sorted(total.items()) if factor}
    return tuple((v, int(np.sign(f))) for v, f in left.items()) if len({abs(f) for f in left.values()}) == 1 else ()


def _replaced(model: FlatModel, sums: dict[int, SignedSum]) -> FlatModel:
    """The model with sums in place of equations; long ones are split over auxiliary variables."""
    n = model.n_variables
    owned: list[tuple[SignedSum, int]] = []
    for e, total in sums.items():
        g, i = model.places[e]
        parts, n = split_sum(total, n)
        owned += [(part, int(model.groups[g].owners[i])) for part in parts]
    added = n - model.n_variables
    model = replace(
        model,
        representative=np.append(model.representative, np.arange(n - added, n)),
        sign=np.append(model.sign, np.ones(added, np.int64)),
        preference=np.append(model.preference, np.full(added, PREFERENCE["avoid"])),
        potential=np.append(model.potential, np.zeros(added, bool)),
        flow=np.append(model.flow, np.zeros(added, bool)),
        nominal=np.append(model.nominal, np.ones(added)),
    )
    return model.with_groups((*without(model, sums).groups, *sum_groups(owned)), model.redundant)
