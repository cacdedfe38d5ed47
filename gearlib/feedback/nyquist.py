"""Nyquist criterion: encirclements of -1 along a closed contour in the s plane.

The contour runs up the imaginary axis, around every pole on it through the right half-plane, and back through infinity. Its points are
so dense that 1 + L cannot turn by half a turn between two of them, so the count is the sum of the observed turns, without any
assumption about closed-loop poles (their positions only determine the density of points).

References
----------
H. Nyquist, "Regeneration theory", Bell System Technical Journal 11 (1932) 126-147, doi 10.1002/j.1538-7305.1932.tb02344.x
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.feedback.feedback_loop import Loop, refine
from gearlib.linear.poles import Poles, Verdict

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
SAME = 1e-9  # relative to a pole's magnitude: other poles on the axis this close share a detour
FARTHEST = 1e3  # radius of the contour over the largest pole


@dataclass(frozen=True)
class NyquistCount:
    """Encirclements of -1, with the poles and verdict that follow.

    Attributes
    ----------
    clockwise : int
        Clockwise encirclements of -1 by L(s) (negative: counter-clockwise), with poles on the imaginary axis passed on the right.
    open_right : int
        Open-loop poles in the right half-plane.
    through : tuple of float
        Frequencies (rad/s) of closed-loop poles on the imaginary axis: the curve passes through -1 there, or a motion on the axis is
        unobservable or uncontrollable in the loop.
    drifting : bool
        Whether such a pole is defective, so that motions grow with time.
    """

    clockwise: int
    open_right: int
    through: tuple[float, ...]
    drifting: bool = False

    @property
    def closed_right(self) -> int:
        """Closed-loop poles in the right half-plane: Z = N + P."""
        return self.clockwise + self.open_right

    @property
    def verdict(self) -> Verdict:
        if self.closed_right:
            return "unstable"
        if self.drifting:
            return "drifting"
        return "marginal" if self.through else "stable"

    def __str__(self) -> str:
        n = abs(self.clockwise)
        turns = (
            "does not encircle -1" if not n else f"encircles -1 {_times(n)} {'' if self.clockwise > 0 else 'counter-'}clockwise"
        )
        text = (
            f"Over all frequencies the curve {turns} (N = {self.clockwise}). The open loop has {_poles(self.open_right)} in the "
            f"right half-plane (P = {self.open_right}), so the closed loop has {_poles(self.closed_right)} there "
            f"(Z = N + P = {self.closed_right})"
        )
        if self.through:
            text += f" and poles on the imaginary axis at {', '.join(f'{w:.6g}' for w in self.through)} rad/s"
        return f"{text}: the closed loop is {self.verdict}."


def _times(n: int) -> str:
    return {1: "once", 2: "twice"}.get(n, f"{n} times")


def _poles(n: int) -> str:
    return {0: "no pole", 1: "one pole"}.get(n, f"{n} poles")


def nyquist_count(loop: Loop) -> NyquistCount:
    """Count encirclements of -1 by L(s).

    Parameters
    ----------
    loop : Loop

    Returns
    -------
    NyquistCount

    Raises
    ------
    SolverError
        The sum of the turns is not an integer, or not that of the closed loop's eigenvalues: the curve passes -1, or a pole the
        imaginary axis, more closely than rounding can resolve.

    Examples
    --------
    >>> import control
    >>> from gearlib.feedback.feedback_loop import as_loop
    >>> print(nyquist_count(as_loop(control.tf([10], [1, 2, 1, 0]))))
    Over all frequencies the curve encircles -1 twice clockwise (N = 2). The open loop has no pole in the right half-plane (P = 0),
    so the closed loop has 2 poles there (Z = N + P = 2): the closed loop is unstable.
    """
    closed = loop.closed_poles
    turned = 0.0
    for points in contour(loop):
        f = 1 + loop.response(points)
        turned += float(np.angle(f[1:] / f[:-1]).sum())
    count = -turned / np.pi  # half of the contour; the other half is its mirror image
    if not abs(count - round(count)) < 0.05:
        raise SolverError(
            f"the curve of {loop.input} -> {loop.output} passes -1 closer than rounding can tell (count {count:.3f})"
        )
    if round(count) + loop.open_poles.right != closed.right:
        raise SolverError(
            f"the curve of {loop.input} -> {loop.output} gives {_poles(round(count) + loop.open_poles.right)} of the closed loop in the "
            f"right half-plane, the eigenvalues {_poles(closed.right)}: some lie closer to the imaginary axis than rounding can tell"
        )
    drifting = len(closed.chains) > 1 or bool(closed.chained)
    # Turns of 1 + L count zeros minus poles inside the contour.
    return NyquistCount(round(count), loop.open_poles.right, tuple(closed.on_axis.tolist()), drifting)


def contour(loop: Loop) -> list[Complexes]:
    """Points on the upper half of the contour, piece by piece: axis, detours to the right of poles on it, and the arc at infinity."""
    groups = together([*on_axis(loop.open_poles), *on_axis(loop.closed_poles)], loop.scale[0])
    high = FARTHEST * loop.scale[1]
    pieces: list[Complexes] = []
    here = 0.0
    critical = loop.critical
    for low, up in groups:
        centre, radius = (low + up) / 2, detour_radius(low, up, critical)
        if centre - radius > here:
            pieces.append(_points(lambda x: 1j * x, here, centre - radius, critical))
        arc = _arc(1j * centre, radius)
        pieces.append(_points(arc, -np.pi / 2 if centre > 0 else 0.0, np.pi / 2, critical))
        if centre == 0:  # from the real axis to the imaginary one
            pieces[-1] = pieces[-1][pieces[-1].imag >= 0]
        here = centre + radius
    pieces.append(_points(lambda x: 1j * x, here, high, critical))
    pieces.append(_points(lambda x: high * np.exp(1j * (np.pi / 2 - x)), 0.0, np.pi / 2, critical))
    return pieces


def _arc(centre: complex, radius: float) -> Callable[[Any], Any]:
    return lambda angle: centre + radius * np.exp(1j * angle)


def _points(path: Callable[[Any], Any], start: float, end: float, critical: Complexes) -> Complexes:
    points: Complexes = np.asarray(path(refine(np.linspace(start, end, 9), path, critical, 0.7)), complex)
    return points


def on_axis(found: Poles) -> list[tuple[float, float]]:
    """Intervals of the axis that contain its poles: the response has them where its own rounding puts them."""
    near = (found.values.real == 0) & (found.values.imag >= 0)
    intervals = zip(found.values.imag[near], found.tolerances[near], strict=True)
    return [(max(float(w - t), 0.0) if w else 0.0, float(w + t)) for w, t in intervals]


def together(intervals: list[tuple[float, float]], smallest: float) -> list[tuple[float, float]]:
    """Open-loop and closed-loop poles that rounding cannot separate, as intervals of the axis."""
    groups: list[tuple[float, float]] = []
    for low, up in sorted(intervals):
        if groups and low - groups[-1][1] <= SAME * max(low, smallest):
            groups[-1] = groups[-1][0], max(up, groups[-1][1])
        else:
            groups.append((low, up))
    return groups


def detour_radius(low: float, up: float, critical: Complexes) -> float:
    """Detour radius: large enough to enclose the poles between two points of the axis, small enough to exclude all others."""
    inside = (critical.real == 0) & (np.abs(critical.imag) >= low) & (np.abs(critical.imag) <= up)
    others = np.abs(critical[~inside] - 0.5j * (low + up))
    gap = float(others.min()) if len(others) else 1.0
    if low > 0:
        gap = min(gap, (low + up) / 2)
    half = (up - low) / 2
    return half + 0.25 * (gap - half)
