"""Pseudo-arclength continuation: follow the solutions of ``r(z, w) = 0`` over w, round folds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError

Floats = NDArray[np.float64]
# (z, w, jacobian wanted) -> residual, derivative by z
Residual = Callable[[Floats, float, bool], tuple[Floats, Floats]]
CONVERGED = 1e-10


def follow(residual: Residual, z: Floats, start: float, end: float, step: float, points: int) -> list[tuple[Floats, float]]:
    """Follow a branch from a solution ``z`` at ``start`` until ``w`` leaves the interval or ``points`` are found.

    Steps grow and shrink with the number of Newton iterations. The last point lies at ``end`` exactly (or at ``start``, where the
    branch comes back).

    Raises
    ------
    SolverError
        Where even a tiny step does not converge.

    Examples
    --------
    Round the unit circle from (0, -1), w being the second coordinate:

    >>> def circle(z, w, jacobian=True):
    ...     return np.array([z[0] ** 2 + w**2 - 1]), np.array([[2 * z[0]]])
    >>> path = follow(circle, np.array([-0.6]), -0.8, 2.0, 0.02, 2000)
    >>> bool(max(w for _, w in path) > 0.9999), round(float(path[-1][0][0]), 6), path[-1][1]
    (True, 0.6, -0.8)
    """
    span = end - start
    current = np.append(z, 0.0)
    tangent = np.append(np.zeros(len(z)), 1.0)
    path = [(z, start)]
    length = step / 4

    def place(y: Floats) -> float:
        return start + span * float(y[-1])

    def extended(y: Floats) -> tuple[Floats, Floats]:
        r, matrix = residual(y[:-1], place(y), True)
        h = 1e-7
        ahead = residual(y[:-1], start + span * (float(y[-1]) + h), False)[0]
        behind = residual(y[:-1], start + span * (float(y[-1]) - h), False)[0]
        return r, np.column_stack([matrix, (ahead - behind) / (2 * h)])

    _, gradient = extended(current)
    tangent = _tangent(gradient, tangent)
    while len(path) < points:
        found = _corrected(extended, current + length * tangent, tangent, None)
        if found is None:
            length /= 2
            if length < 1e-7:
                raise SolverError(
                    f"the branch cannot be followed beyond {place(current):g}: steps of {length:.1g} do not converge"
                )
            continue
        new, gradient, iterations = found
        if not 0.0 <= new[-1] <= 1.0:  # finish exactly on the border
            border = 1.0 if new[-1] > 1.0 else 0.0
            share = (border - current[-1]) / (new[-1] - current[-1])
            last = _corrected(extended, current + share * (new - current), tangent, border)
            if last is not None:
                path.append((last[0][:-1], end if border else start))
            return path
        turned = _tangent(gradient, tangent)
        if turned @ tangent < 0.9 and length > 1e-4 * step:  # the branch bends more than a step should
            length /= 2
            continue
        current, tangent = new, turned
        path.append((current[:-1], place(current)))
        length = min(length * (1.5 if iterations <= 4 else 0.7), step)
    return path


def _tangent(gradient: Floats, before: Floats) -> Floats:
    """The direction of the branch that goes on as before."""
    matrix = np.vstack([gradient, before])
    right = np.zeros(len(before))
    right[-1] = 1.0
    direction = np.linalg.lstsq(matrix, right, rcond=None)[0]
    result: Floats = direction / np.linalg.norm(direction)
    return result


def _corrected(
    extended: Callable[[Floats], tuple[Floats, Floats]], guess: Floats, tangent: Floats, border: float | None
) -> tuple[Floats, Floats, int] | None:
    """Newton's method on the plane through the guess across the tangent, or at a fixed w."""
    y = guess.copy()
    normal = tangent if border is None else np.append(np.zeros(len(guess) - 1), 1.0)
    if border is not None:
        y[-1] = border
    for iteration in range(1, 13):
        r, gradient = extended(y)
        matrix = np.vstack([gradient, normal])
        distance = normal @ (y - guess) if border is None else 0.0
        change = np.linalg.lstsq(matrix, np.append(r, distance), rcond=None)[0]
        y = y - change
        if not np.isfinite(y).all():
            return None
        if np.linalg.norm(change) <= CONVERGED * (1.0 + np.linalg.norm(y)):
            return y, gradient, iteration
    return None
