"""Pseudo-arclength continuation of the solutions of ``r(z, w) = 0`` over w, through folds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.program.newton import Correction, newton

Floats = NDArray[np.float64]
# (z, w) -> residual, derivatives with respect to z and w
Equations = Callable[[Floats, float], tuple[Floats, Floats, Floats]]
CONVERGED = 1e-7  # last change of Newton's iteration, whose error is of the order of its square
STALLED = 1e-5  # relative to z: smaller changes that do not get smaller any more are rounding, as of a weakly held mean
GROWTH = 0.2  # arclength of a growth of z by its own size, relative to the interval
LEAST = 0.05  # relative to the largest size so far: lower limit of the scale of z
STRAIGHT = 0.9  # minimum cosine of the angle between tangents at the ends of a step
OFF = 0.3  # largest prediction error, relative to the step
SHORTEST = 1e-6  # relative to the largest step


@dataclass(frozen=True, eq=False)
class Path:
    """A solution branch as a sequence of points.

    Attributes
    ----------
    z : array (points, unknowns)
    w : array (points,)
    folds : tuple of int
        Indices of the points at which w turns back.
    complete : bool
        Whether the branch reached an end of the interval; False if it ran out of points, or one was rejected.
    """

    z: Floats
    w: Floats
    folds: tuple[int, ...]
    complete: bool


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A solution with the branch's unit tangent; w is scaled to 0 at the start and 1 at the end."""

    y: Floats
    tangent: Floats
    iterations: int
    largest: float  # largest size of z so far


def follow(
    equations: Equations, z: Floats, start: float, end: float, step: float, points: int, skipped: int = 0,
    accept: Callable[[Floats, float], bool] = lambda z, w: True,
) -> Path:  # fmt: skip
    """Follow a branch from a solution ``z`` at ``start`` until ``w`` leaves the interval or ``points`` are found.

    The step size adapts to Newton's iterations and to the curvature of the branch. Folds are located, and are points themselves. The
    last point lies exactly at ``end`` (or at ``start``, if the branch returns).

    Parameters
    ----------
    equations : callable
    z : array (unknowns,)
    start, end : float
    step : float
        Largest step, relative to the length of the whole interval; a growth of z by its own size counts 0.2.
    points : int
        Largest number of points.
    skipped : int
        Number of leading unknowns that are excluded from arclength.
    accept : callable, optional
        Called with every point but the first, ``accept(z, w)``; if it returns False, the branch ends after that point.

    Raises
    ------
    SolverError
        Even a tiny step does not converge.

    Examples
    --------
    Around the unit circle from (-0.6, -0.8), with w as the second coordinate:

    >>> def circle(z, w):
    ...     return np.array([z[0] ** 2 + w**2 - 1]), np.array([[2 * z[0]]]), np.array([2 * w])
    >>> path = follow(circle, np.array([-0.6]), -0.8, 2.0, 0.02, 2000)
    >>> [round(float(path.w[i]), 9) for i in path.folds], round(float(path.z[-1, 0]), 9), float(path.w[-1])
    ([1.0], 0.6, -0.8)
    """
    continuation = Continuation(equations, start, end, skipped)
    point = continuation.begin(z)
    branch, length = [point], step / 4
    folds, complete = list[int](), False

    def added(found: BranchPoint) -> bool:
        branch.append(found)
        return accept(found.y[:-1], continuation.place(found.y))

    while len(branch) < points:
        new = continuation.corrected(point, length)
        if new is None or (length > 1e-3 * step and continuation.strayed(point, new, length)):
            length /= 2
            if length < SHORTEST * step:
                raise SolverError(
                    f"the branch cannot be followed beyond {continuation.place(point.y):g} rad/s, after {len(branch)} points: steps of "
                    f"{length:.1g} of the interval do not converge; take more samples, or fewer harmonics"
                )
            continue
        if not 0.0 <= new.y[-1] <= 1.0:
            last = continuation.at_border(point, new, min(max(float(new.y[-1]), 0.0), 1.0))
            complete = last is not None and added(last)
            break
        if new.tangent[-1] * point.tangent[-1] < 0:
            fold = continuation.fold(point, new, length)
            if fold is not None:
                folds.append(len(branch))
                if not added(fold) or len(branch) == points:
                    break
        point = new
        if not added(point):
            break
        length = min(length * (1.5 if new.iterations <= 3 else 1.0 if new.iterations <= 5 else 0.6), step)
    z, w = np.array([s.y[:-1] for s in branch]), np.array([continuation.place(s.y) for s in branch])
    return Path(z, w, tuple(folds), complete)


@dataclass(frozen=True, eq=False)
class Continuation:
    """Steps along a branch, in ``y``: the unknowns and the scaled w."""

    equations: Equations
    start: float
    end: float
    skipped: int

    def place(self, y: Floats) -> float:
        return self.start * (1.0 - float(y[-1])) + self.end * float(y[-1])

    def extended(self, y: Floats) -> tuple[Floats, Floats]:
        r, by_z, by_w = self.equations(y[:-1], self.place(y))
        return r, np.column_stack([by_z, (self.end - self.start) * by_w])

    def size(self, y: Floats, largest: float = 0.0) -> float:
        return max(float(np.linalg.norm(y[self.skipped : -1])), LEAST * largest, 1e-100)

    def inner(self, a: Floats, b: Floats, point: BranchPoint) -> float:
        """Inner product that measures arclength near a point."""
        k = self.skipped
        return float((GROWTH / self.size(point.y, point.largest)) ** 2 * (a[k:-1] @ b[k:-1]) + a[-1] * b[-1])

    def strayed(self, point: BranchPoint, new: BranchPoint, length: float) -> bool:
        """Whether the branch bends so strongly that the new point may lie on another one."""
        off = np.asarray(new.y - point.y - length * point.tangent, np.float64)
        turned = self.inner(new.tangent, point.tangent, point) / np.sqrt(self.inner(new.tangent, new.tangent, point))
        return bool(turned < STRAIGHT or self.inner(off, off, point) > (OFF * length) ** 2)

    def begin(self, z: Floats) -> BranchPoint:
        y = np.append(z, 0.0)
        _, gradient = self.extended(y)
        forward = np.append(np.zeros(len(z)), 1.0)
        point = BranchPoint(y, forward, 0, self.size(y))
        try:
            direction = np.asarray(np.linalg.solve(np.vstack([gradient, self.normal(point)]), forward), np.float64)
        except np.linalg.LinAlgError:
            return point
        return replace(point, tangent=direction / np.sqrt(self.inner(direction, direction, point)))

    def normal(self, point: BranchPoint) -> Floats:
        """Row vector whose product with a change is its arclength along the tangent."""
        size = GROWTH / self.size(point.y, point.largest)
        row = np.append(size**2 * point.tangent[:-1], point.tangent[-1])
        row[: self.skipped] = 0.0
        return row

    def corrected(self, point: BranchPoint, length: float) -> BranchPoint | None:
        """Newton's method in the plane orthogonal to the tangent, at a given distance ahead."""
        return self.on_plane(point.y + length * point.tangent, self.normal(point), point)

    def on_plane(self, guess: Floats, normal: Floats, before: BranchPoint) -> BranchPoint | None:
        """The branch's point on a plane through a guess."""
        right = np.zeros((len(guess), 2))
        right[-1, 1] = 1.0  # the second column yields the tangent
        direction = before.tangent

        def equations(y: Floats) -> tuple[Floats, Correction]:
            if self.place(y) <= 0.0 < self.start:
                raise np.linalg.LinAlgError("no frequency")
            rest, gradient = self.extended(y)
            matrix = np.vstack([gradient, normal])

            def correction(rest: Floats) -> Floats:
                nonlocal direction
                right[:, 0] = rest
                change, direction = np.linalg.solve(matrix, right).T
                return np.asarray(change, np.float64)

            return np.append(rest, normal @ (y - guess)), correction

        last = np.inf

        def settled(y: Floats, change: Floats, _: Floats) -> bool:
            nonlocal last
            size = float(np.linalg.norm(change))
            rounding, last = last / 2 < size < STALLED * self.size(y) and last < STALLED * self.size(y), size
            return bool(rounding or size <= CONVERGED * (1.0 + np.linalg.norm(y)))

        found = newton(equations, guess, settled, 12)
        if not found.settled or self.place(found.x) <= 0.0 < self.start:
            return None
        reached = BranchPoint(found.x, direction, found.iterations, max(before.largest, self.size(found.x)))
        return replace(reached, tangent=direction / np.sqrt(self.inner(direction, direction, reached)))

    def at_border(self, point: BranchPoint, beyond: BranchPoint, border: float) -> BranchPoint | None:
        """Point at which the branch leaves the interval."""
        share = (border - point.y[-1]) / (beyond.y[-1] - point.y[-1])
        guess = point.y + share * (beyond.y - point.y)
        guess[-1] = border
        found = self.on_plane(guess, np.append(np.zeros(len(guess) - 1), 1.0), point)
        if found is not None:
            found.y[-1] = border
        return found

    def fold(self, point: BranchPoint, beyond: BranchPoint, length: float) -> BranchPoint | None:
        """Fold between two points, where the w-component of the tangent vanishes (regula falsi, Illinois)."""
        low, high = 0.0, length
        f_low, f_high = float(point.tangent[-1]), float(beyond.tangent[-1])
        found = None
        for _ in range(12):
            middle = (low * f_high - high * f_low) / (f_high - f_low)
            tried = self.corrected(point, middle)
            if tried is None:
                return found
            found, value = tried, float(tried.tangent[-1])
            if abs(value) < 1e-6 * abs(float(point.tangent[-1]) - float(beyond.tangent[-1])):
                return found
            if value * f_high < 0:
                low, f_low = high, f_high
            else:
                f_low /= 2
            high, f_high = middle, value
        return found
