"""`Identifiability`: the combinations of parameters that data determines, by singular values of the scaled sensitivities.

References
----------
R. Brun, P. Reichert, H. R. Kuensch, "Practical identifiability analysis of large environmental simulation models", Water Resources
Research 37 (2001), doi 10.1029/2000WR900350
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
NOTHING = 1e-8  # relative to the largest singular value: a smaller one is rounding
SHARE = 0.1  # component of a unit direction below which a parameter is not mentioned in words
TOUCHED = 1e-3  # component of an undetermined unit direction above which a parameter is undetermined


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Identifiability of parameters, each in units of the width of its range (of its logarithm, if the bounds are positive).

    Attributes
    ----------
    names : tuple of str
    singular_values : array (parameters,)
        Change of the data, in standard deviations of the noise, along each direction over the whole range, largest first. The inverse
        is the standard deviation along the direction as a fraction of the range.
    directions : array (parameters, parameters)
        The directions, one row per singular value.
    determined : array of bool (parameters,)
        Whether the data confines a direction to less than its range.
    noise : float
        Standard deviation of the residuals: 1 if the noise is known, otherwise estimated after the fit; NaN if no residual is left for it.
    covariance : array (parameters, parameters)
        In widths of the ranges; infinite for parameters involved in an undetermined direction, otherwise NaN if the noise is.
    """

    names: tuple[str, ...]
    singular_values: Floats
    directions: Floats
    determined: NDArray[np.bool_]
    noise: float
    covariance: Floats

    @property
    def complete(self) -> bool:
        """Whether every direction is determined."""
        return bool(self.determined.all())

    @property
    def open_directions(self) -> tuple[dict[str, float], ...]:
        """For each undetermined direction, the parameters involved with their components, largest first."""
        found = []
        for row in self.directions[~self.determined]:
            row = row * np.sign(row[np.argmax(np.abs(row))])
            order = [k for k in np.argsort(-np.abs(row), kind="stable") if abs(row[k]) > SHARE]
            found.append({self.names[k]: float(row[k]) for k in order})
        return tuple(found)


def identifiability(slopes: Floats, residuals: Floats, names: tuple[str, ...], known: bool) -> Identifiability:
    """From the derivatives of the residuals with respect to the parameters in widths of their ranges.

    Parameters
    ----------
    slopes : array (residuals, parameters)
    residuals : array
        Divided by the noise if that is ``known``; otherwise the noise is estimated from them.
    names : tuple of str
    known : bool

    Examples
    --------
    Two springs in series, of which only the sum is observable:

    >>> found = identifiability(np.array([[3.0, 3.0], [5.0, 5.0]]), np.zeros(2), ("a.c", "b.c"), True)
    >>> found.complete, [{n: round(x, 2) for n, x in d.items()} for d in found.open_directions]
    (False, [{'a.c': 0.71, 'b.c': -0.71}])
    """
    n = len(names)
    _, sizes, directions = np.linalg.svd(np.linalg.qr(slopes, mode="r"), full_matrices=True)
    sizes = np.concatenate([sizes, np.zeros(n - len(sizes))])
    above_rounding = sizes > NOTHING * sizes.max()
    freedom = len(residuals) - int(above_rounding.sum())
    noise = 1.0 if known else float(np.sqrt((residuals**2).sum() / freedom)) if freedom > 0 else np.nan
    determined = ~(sizes <= noise) & above_rounding
    inverse = np.divide(noise, sizes, out=np.zeros(n), where=determined)
    covariance = (directions.T * inverse**2) @ directions
    touched = (np.abs(directions[~determined]) > TOUCHED).any(axis=0)
    covariance[touched] = covariance[:, touched] = np.nan
    covariance[touched, touched] = np.inf
    return Identifiability(names, sizes, directions, determined, noise, covariance)
