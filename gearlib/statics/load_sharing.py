"""Load sharing of parallel paths in steady motion, where equilibrium alone leaves it undetermined.

With several planets each mesh may carry a preload that the others balance. A train assembled without preload has none: among all
deflections in equilibrium with the loads, it takes the one in which self-equilibrated forces do no work (Castigliano's and Menabrea's
theorem), so that the load is shared by stiffness, equally among equal planets. On rigid parallel paths what is locked shares as in
a run, with the smallest sum of squares; of other torques those of smallest norm are taken.

References
----------
S. P. Timoshenko, "History of Strength of Materials", McGraw-Hill, 1953, chapters 63 and 64 (Castigliano, Menabrea).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import partial_kernel
from gearlib.errors import InputWarning, warn
from gearlib.flatten.model import FlatModel
from gearlib.statics.mesh_turn import apply
from gearlib.statics.steady_motion import Given, Motion, motion_from, yields
from gearlib.structure.sparse_elimination import Factors

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
CONJUGATE = {"N": "m", "N.m": "rad"}
NOTHING = 1e-12  # relative to the terms: smaller sums are rounding
MOVES = 1e-8  # smallest change of a scaled unknown in a direction of norm about 1


def shared(model: FlatModel, parameters: Floats, given: Sequence[Given], motion: Motion, torques: Integers) -> Motion:
    """The motion with the load shared among parallel paths; ``torques`` are all torques and forces at flanges.

    Where losses depend on the direction of power, the load sharing and that direction are determined alternately.

    Warns
    -----
    InputWarning
        They do not settle: what sticks or touches depends on a preload.
    """
    n, size = model.n_variables, 0.0
    for _ in range(20):
        free = self_balanced(motion.factors, torques)[:n]
        constants = balanced(model, parameters, motion, free, torques)
        change = np.abs(constants - motion.constants)[torques]
        # Of the largest torques so far: what is a preload alone becomes smaller with every pass
        size = max(size, float(np.abs([constants[torques], motion.constants[torques]]).max(initial=0.0)))
        if change.max(initial=0.0) <= 1e-13 * size:
            return motion
        motion = motion_from(model, parameters, given, np.concatenate([constants, motion.rates]))
    warn(
        f"the load of parallel paths is one of many: {model.name(int(torques[np.argmax(change)]))} depends on a preload, without which a "
        "gap opens, or what sticks slides; simulate, or close gaps (backlash parameters = 0)",
        InputWarning,
    )
    return motion


def self_balanced(factors: Factors, places: Integers) -> Floats:
    """Basis of the free motions that change the unknowns at ``places``, shape (unknowns, how many), in original units."""
    looks = 8
    while True:
        found = factors.directions(looks)
        _, sizes, rows = np.linalg.svd(found[places], full_matrices=False)
        rank = int((sizes > MOVES * max(1.0, float(sizes.max(initial=0.0)))).sum())
        if rank < looks:
            basis = found @ rows[:rank].T
            basis[np.abs(basis) <= NOTHING * np.abs(basis).max(axis=0, initial=0.0)] = 0.0
            return np.asarray(factors.column[:, None] * basis)
        looks *= 4


def balanced(model: FlatModel, parameters: Floats, motion: Motion, free: Floats, torques: Integers) -> Floats:
    """Constant parts for which the self-equilibrated forces ``free`` do no work."""
    constants = motion.constants.copy()
    deflection, force = elastic(model, parameters, motion)
    stretched, pulled = exact(deflection, free), exact(force, free)
    left, values, right = np.linalg.svd(stretched.T @ pulled)
    rank = int((values > 1e-10 * values.max(initial=0.0)).sum())
    work = stretched.T @ (force @ constants)
    constants -= free @ (right[:rank].T @ ((left[:, :rank].T @ work) / values[:rank]))
    rigid = free @ right[rank:].T
    if rigid.shape[1] and (soft := np.flatnonzero(compliance := yields(model, parameters, motion))).size:
        # As in a run, the sum of the squares of what is locked, each times its compliance, is least
        weights = np.sqrt(compliance[soft] / compliance.max())
        pulled = weights[:, None] * rigid[soft]
        _, values, right = np.linalg.svd(pulled)
        rank = int((values > 1e-10 * values.max(initial=0.0)).sum())
        constants -= rigid @ np.linalg.lstsq(pulled, weights * constants[soft], rcond=1e-10)[0]
        rigid = rigid @ right[rank:].T
    constants -= rigid @ np.linalg.lstsq(rigid[torques], constants[torques], rcond=None)[0]
    return constants


def exact(matrix: Any, columns: Floats) -> Floats:
    """The product of two matrices, with 0 for entries that are rounding: rigid paths must not look elastic."""
    product = np.asarray(matrix @ columns)
    return np.where(np.abs(product) > NOTHING * np.asarray(abs(matrix) @ np.abs(columns)), product, 0.0)


def elastic(model: FlatModel, parameters: Floats, motion: Motion) -> tuple[Any, Any]:
    """Matrices for the deflection, and the conjugate force, of every equation that relates a force to a deflection."""
    import scipy.sparse as sparse

    entries: tuple[list[Any], list[Any]] = ([], [])
    seen: set[tuple[int, ...]] = set()
    count = 0
    for g, group in enumerate(model.groups):
        template = group.template
        kinds = [
            kind_of(model, int(group.variables[0, template.locals.index(name)]), order) for name, order in template.columns
        ]
        slopes, places = [], []
        for c, (name, _) in enumerate(template.columns):
            j = template.locals.index(name)
            p = apply(model, partial_kernel(template, c), g, group, parameters, motion.constants, motion.rates, motion.discrete)
            slopes.append(np.where(np.isfinite(p), p, 0.0) * group.signs[:, j])
            places.append(group.variables[:, j])
        for unit, lengths in CONJUGATE.items():
            parts = [[c for c, kind in enumerate(kinds) if kind == wanted] for wanted in (lengths, unit)]
            for row in range(len(group)) if all(parts) else ():
                key = tuple(sorted({int(places[c][row]) for c in parts[0] if slopes[c][row]}))
                sizes = [max(abs(slopes[c][row]) for c in part) for part in parts]
                if key in seen or not all(sizes):
                    continue  # the same spring in another equation
                seen.add(key)
                for k in (0, 1):
                    entries[k].extend((count, int(places[c][row]), slopes[c][row] / sizes[k]) for c in parts[k])
                count += 1
    shape = (count, model.n_variables)
    made = []
    for found in entries:
        rows, columns, values = (np.array([entry[k] for entry in found]) for k in range(3))
        made.append(sparse.csr_matrix((values, (rows.astype(int), columns.astype(int))), shape=shape))
    return made[0], made[1]


def kind_of(model: FlatModel, variable: int, order: int) -> str:
    """Unit of a deflection or a force; empty for anything else."""
    if order:
        return ""
    units = {model.unit(int(v)) for v in np.flatnonzero(model.representative == variable)}
    return next((u for u in ("N", "N.m", "m", "rad") if u in units), "")
