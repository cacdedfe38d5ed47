"""Floquet multipliers: stability of periodic motions."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from gearlib.linear.balancing import balance
from gearlib.periodic.periods import Cuts, Driven, Moments

Floats = NDArray[np.float64]
FINE = 0.3  # largest phase or decay of the fastest free vibration within a panel
MOST = 4096  # panels of a period
ROUNDING = 1e-12  # of a product of that many matrices, relative to their norm
KEPT = 1e-6  # of a unit direction: what a monodromy matrix changes by less, it keeps


def monodromy(driven: Driven, coefficients: Floats, found: Moments, cuts: Cuts | None, samples: int) -> Floats:
    """Monodromy matrix of a motion, which propagates a perturbation over one period.

    Between switches the variational equations are integrated by Magnus expansion to fourth order with a Padé approximant of the
    exponential; where the rates jump, the perturbation jumps as well (saltation). Panels are as short as the fastest free vibration
    asks for, unless a period had more than `MOST` of them: then they are integrated as with constant coefficients.

    References
    ----------
    S. Blanes, F. Casas, J. A. Oteo, J. Ros, Physics Reports 470 (2009) 151-238, https://doi.org/10.1016/j.physrep.2008.11.001.
    R. I. Leine, H. Nijmeijer, "Dynamics and Bifurcations of Non-Smooth Mechanical Systems", Springer 2004,
    https://doi.org/10.1007/978-3-540-44398-8.
    """
    n = coefficients.shape[1]
    starts, length, discrete, last = panels_of(found, 4 * np.pi / samples)
    phase = starts + length / 2
    some = np.unique(np.concatenate([np.cumsum([0, *last[:-1]]), np.arange(0, len(phase), max(1, len(phase) // 16))]))
    _, slopes = driven.linear_rates(phase[some], driven.states(phase[some], coefficients), discrete[:, some])
    rate = float(np.abs(np.linalg.eigvals(slopes)).max()) / driven.omega
    if rate * length.max() > FINE:
        starts, length, discrete, last = panels_of(found, max(FINE / rate, 2 * np.pi / MOST))
    offset = length * np.sqrt(3) / 6
    phase = np.concatenate([starts + length / 2 - offset, starts + length / 2 + offset])
    x = driven.states(phase, coefficients)
    _, slopes = driven.linear_rates(phase, x, np.tile(discrete, (1, 2)))
    first, second = slopes[: len(starts)], slopes[len(starts) :]
    h = (length / driven.omega)[:, None, None]
    exponent = h / 2 * (first + second)
    if rate * length.max() <= 2 * FINE:
        exponent -= np.sqrt(3) / 12 * h**2 * (first @ second - second @ first)
    halvings = max(0, int(np.ceil(np.log2(max(rate * length.max() / FINE, 1.0)))))
    exponent /= 2**halvings
    square = exponent @ exponent
    even, odd = np.eye(n) + square / 10, exponent / 2 + exponent @ square / 120
    steps = np.asarray(np.linalg.solve(even - odd, even + odd), np.float64)
    for _ in range(halvings):
        steps = steps @ steps
    jumped = {} if cuts is None else {int(piece): i for i, piece in enumerate(cuts.piece)}
    whole, at = np.eye(n), 0
    for piece, panels in enumerate(last):
        i = jumped.get(piece)
        if cuts is not None and i is not None:
            whole = whole + np.outer(cuts.jump[i], cuts.gradient[i] @ whole) / cuts.rate[i]
        whole = product(steps[at : at + panels]) @ whole
        at += panels
    return whole


def panels_of(found: Moments, longest: float) -> tuple[Floats, Floats, Floats, list[int]]:
    """Begins and lengths of panels of the pieces, their flags, and the number of panels of each piece."""
    begins, widths, pieces, last = [], [], [], []
    for begin, end, discrete in found.pieces:
        panels = max(1, int(np.ceil((end - begin) / longest)))
        width = (end - begin) / panels
        begins.append(begin + width * np.arange(panels))
        widths.append(np.full(panels, width))
        pieces.append(np.repeat(discrete[:, None], panels, axis=1))
        last.append(panels)
    return np.concatenate(begins), np.concatenate(widths), np.concatenate(pieces, axis=1), last


def vibration_multipliers(over_period: Floats, sums: Floats, idle: Floats, growth: Floats) -> NDArray[np.complex128]:
    """Eigenvalues of a monodromy matrix without the multipliers 1 of rigid motions and of the phase.

    What a train keeps, the combinations ``sums`` of its states, are left eigenvectors. Perturbations that leave them alone are an
    invariant subspace; in it the directions ``idle``, on which nothing depends, are right eigenvectors. Both are removed as such, and
    not by the size of an eigenvalue: a multiplier that passes 1, at a fold, stays. Only the phase of a turning train, a perturbation
    along the motion itself, is the eigenvalue nearest to 1 of those that remain.

    Parameters
    ----------
    over_period : array (states, states)
    sums, idle : arrays (states, number)
        Candidates; those combinations are taken that the matrix keeps, since a force that jumps can depend on either.
    growth : array (states,)
        Direction of the growing mesh phases; zero if the motion is forced.

    Examples
    --------
    A freely turning wheel (angle, speed) beside a stable motion:

    >>> over_period = np.array([[1.0, 2.0, 0.3], [0.0, 1.0, 0.0], [0.0, 0.5, 0.9]])
    >>> speed, angle = np.eye(3)[:, 1:2], np.eye(3)[:, 0:1]
    >>> vibration_multipliers(over_period, speed, angle, np.zeros(3)).real.tolist()
    [0.9]
    """
    n = len(over_period)
    change = over_period - np.eye(n)
    kept = sums @ null(change.T @ sums)
    inside = null(kept.T) if kept.shape[1] else np.eye(n)
    fixed = idle @ null(np.vstack([change @ idle, kept.T @ idle]))
    other = inside @ null((inside.T @ fixed).T) if fixed.shape[1] else inside
    result = eigenvalues(other.T @ over_period @ other)
    if growth.any() and np.linalg.norm(growth - fixed @ (fixed.T @ growth)) > KEPT * np.linalg.norm(growth):
        result = np.delete(result, np.argmin(np.abs(result - 1.0)))
    return result


def eigenvalues(matrix: Floats) -> NDArray[np.complex128]:
    """Eigenvalues; those whose distance from the unit circle may be rounding lie on it."""
    if not matrix.size:
        return np.empty(0, np.complex128)
    balanced = np.eye(len(matrix)) + balance(matrix - np.eye(len(matrix)))[0]
    values, left, right = scipy.linalg.eig(balanced, left=True, right=True)
    steady = np.maximum(np.abs((left.conj() * right).sum(axis=0)), 1e-300)  # the reciprocal of the condition
    near = np.abs(np.abs(values) - 1.0) <= ROUNDING * np.linalg.norm(balanced, 2) / steady
    return np.asarray(np.where(near, values / np.where(near, np.abs(values), 1.0), values), np.complex128)


def null(matrix: Floats) -> Floats:
    """Orthonormal basis of the vectors that a matrix takes to zero, or to a rounding error."""
    _, sizes, right = np.linalg.svd(matrix)
    result: Floats = right[int((sizes > KEPT).sum()) :].T
    return result


def product(steps: Floats) -> Floats:
    """Product of matrices, the first one rightmost, computed pairwise."""
    while len(steps) > 1:
        odd = steps[-1:] if len(steps) % 2 else steps[:0]
        even = steps[: len(steps) - len(odd)]
        steps = np.concatenate([even[1::2] @ even[::2], odd])
    result: Floats = steps[0]
    return result
