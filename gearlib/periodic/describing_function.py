"""Describing functions of backlash under preload, and the amplitude-dependent stiffness of a gear pair with backlash."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import real, reals, shown
from gearlib.errors import ArgumentError

Floats = NDArray[np.float64]


def _check_spring(c: float, b: float, preload: float) -> None:
    if not real("c", c, "a positive stiffness") > 0:
        raise ArgumentError(f"c is {shown(c)}; expected a positive stiffness")
    real("preload", preload, "a finite force")
    _check_backlash(b)


def _check_backlash(b: float) -> None:
    if not real("b", b, "a backlash that is not negative") >= 0:
        raise ArgumentError(f"b is {shown(b)}; expected a backlash that is not negative")


def _first(z: Floats) -> Floats:
    """Twice the mean of ``max(cos(u) - z, 0) cos(u)``: first harmonic beyond an edge at z."""
    x = np.clip(z, -1.0, 1.0)
    result: Floats = (np.arccos(x) - x * np.sqrt(1 - x**2)) / np.pi
    return result


def _mean(z: Floats) -> Floats:
    """Mean of ``max(cos(u) - z, 0)``."""
    x = np.clip(z, -1.0, 1.0)
    result: Floats = (np.sqrt(1 - x**2) - x * np.arccos(x)) / np.pi + (x - z) * (z < -1)
    return result


def backlash_describing_function(
    amplitude: ArrayLike, mean: ArrayLike = 0.0, *, c: float = 1.0, b: float = 1.0, c_gap: float = 0.0
) -> tuple[Any, Any]:
    """Describing functions of a spring with backlash for a deflection ``mean + amplitude cos(w t)``.

    The force is ``c (x - b/2)`` above the gap, ``c (x + b/2)`` below it and ``c_gap x`` inside (continued at the edges). The two
    functions describe its part ``F0 + N1 amplitude cos(w t)``; there is no quadrature component, since the force has no memory.

    Parameters
    ----------
    amplitude : array
        Amplitude of the deflection, > 0, m (rad).
    mean : array
        Mean deflection, caused by the preload, m (rad).
    c : float
        Stiffness in contact, N/m (N.m/rad).
    b : float
        Total backlash, m (rad).
    c_gap : float
        Stiffness inside the gap.

    Returns
    -------
    F0 : array
        Mean force, N (N.m).
    N1 : array
        First harmonic of the force over the amplitude: the equivalent stiffness, N/m (N.m/rad).

    References
    ----------
    A. Gelb, W. E. Vander Velde, "Multiple-Input Describing Functions and Nonlinear System Design", McGraw-Hill, 1968.
    A. Kahraman, R. Singh, "Non-linear dynamics of a spur gear pair", Journal of Sound and Vibration 142 (1990) 49-75,
    https://doi.org/10.1016/0022-460X(90)90582-K.

    Examples
    --------
    Permanently in contact, then permanently inside the gap:

    >>> F0, N1 = backlash_describing_function(0.5, 2.0, c=100.0, b=1.0)
    >>> float(F0), float(N1)
    (150.0, 100.0)
    >>> float(backlash_describing_function(0.4, 0.0)[1])
    0.0
    """
    a, m = reals("amplitude", amplitude, "positive numbers"), reals("mean", mean, "finite numbers")
    c, c_gap = real("c", c), real("c_gap", c_gap)
    if not (a > 0).all():
        raise ArgumentError(f"amplitude is {shown(amplitude)}; expected positive numbers")
    _check_backlash(b)
    b = float(b)
    try:
        a, m = np.broadcast_arrays(a, m)
    except ValueError:
        raise ArgumentError(
            f"amplitude and mean have the shapes {a.shape} and {m.shape}; expected one that fits both"
        ) from None
    a = np.maximum(a, 1e-150 * (b + np.abs(m)))  # a smaller amplitude is negligible beside the edges
    above, below = (b / 2 - m) / a, (b / 2 + m) / a
    N1 = c_gap + (c - c_gap) * (_first(above) + _first(below))
    F0 = c_gap * m + (c - c_gap) * a * (_mean(above) - _mean(below))
    return F0, N1


class PreloadedBacklash(control.DescribingFunctionNonlinearity):  # type: ignore[misc]
    """Spring with backlash under preload, for `control.describing_function_plot` and `control.describing_function`.

    Its input is the vibration about the mean deflection at which the spring carries the preload, its output the force in excess of the
    preload. The mean moves with the amplitude so that the mean force remains the preload.

    Parameters
    ----------
    c, b : float
        Stiffness in contact, and total backlash.
    preload : float
        Mean force, N (N.m).

    Examples
    --------
    >>> import control
    >>> spring = PreloadedBacklash(c=100.0, b=1.0, preload=20.0)
    >>> spring.describing_function(0.1)
    100.0
    >>> bool(abs(control.describing_function(spring, 0.5) - spring.describing_function(0.5)) < 1.0)
    True
    """

    def __init__(self, c: float, b: float, preload: float) -> None:
        _check_spring(c, b, preload)
        super().__init__()
        self.c, self.b, self.preload = float(c), float(b), float(preload)

    def __call__(self, x: float) -> float:
        """Force in excess of the preload during a vibration about the static deflection."""
        x = real("x", x)
        rest = self.preload / self.c + np.sign(self.preload) * self.b / 2
        q = x + rest
        return float(self.c * (max(q - self.b / 2, 0.0) + min(q + self.b / 2, 0.0)) - self.preload)

    def _isstatic(self) -> bool:
        return True

    def mean(self, amplitude: float) -> float:
        """Mean deflection at an amplitude."""
        return mean_deflection(amplitude, self.preload, c=self.c, b=self.b)

    def describing_function(self, amplitude: float) -> float:
        """Equivalent stiffness at an amplitude."""
        _, n1 = backlash_describing_function(amplitude, self.mean(amplitude), c=self.c, b=self.b)
        return float(n1)


def mean_deflection(amplitude: float, preload: float, *, c: float, b: float) -> float:
    """Mean deflection at which a vibrating spring with backlash carries a preload.

    Examples
    --------
    >>> round(mean_deflection(0.1, 20.0, c=100.0, b=1.0), 12)
    0.7
    """
    from scipy.optimize import brentq

    if not real("amplitude", amplitude, "a positive number") > 0:
        raise ArgumentError(f"amplitude is {shown(amplitude)}; expected a positive number")
    _check_spring(c, b, preload)
    amplitude, c, b, preload = float(amplitude), float(c), float(b), float(preload)
    reach = abs(preload) / c + b / 2 + amplitude

    def excess(m: float) -> float:
        return float(backlash_describing_function(amplitude, m, c=c, b=b)[0]) - preload

    return float(brentq(excess, -reach, reach, xtol=1e-15 * reach, rtol=8.9e-16)) if preload else 0.0


def equivalent_stiffness(amplitude: ArrayLike, preload: float = 0.0, *, c: float, b: float) -> Floats:
    """Stiffness of a gear pair with backlash as a function of its deflection amplitude.

    Parameters
    ----------
    amplitude : array
        Amplitude of the deflection about its mean, m (rad).
    preload : float
        Mean force, N (N.m).
    c, b : float
        Stiffness in contact, N/m (N.m/rad), and total backlash, m (rad).

    Returns
    -------
    array
        N/m (N.m/rad). It equals ``c`` while the contact is permanent (amplitude below ``preload / c``), then falls, and rises again
        once the other flank is hit.

    Examples
    --------
    >>> equivalent_stiffness([0.1, 0.4, 50.0], 20.0, c=100.0, b=1.0).round(1)
    array([100. ,  70.5,  98.7])
    """
    grid = reals("amplitude", amplitude, "positive numbers")
    means = np.array([mean_deflection(float(x), preload, c=c, b=b) for x in grid.ravel()]).reshape(grid.shape)
    return np.asarray(backlash_describing_function(grid, means, c=c, b=b)[1])
