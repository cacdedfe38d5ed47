"""`ModeSensitivity`: derivatives of eigenvalues, natural frequencies and damping ratios with respect to a parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class ModeSensitivity:
    """Derivatives of a system's modes with respect to a parameter, per unit of the parameter.

    Attributes
    ----------
    parameter : str
    unit : str
        Unit of the parameter.
    value : float
        Value of the parameter.
    eigenvalues : complex array (modes,)
        1/s per unit; 0 for free motions.
    frequencies : array (modes,)
        Hz per unit.
    damping : array (modes,)
        Derivatives of the damping ratios, per unit.
    relative : array (modes,)
        Relative change of the natural frequency over that of the parameter: 0.5 where a mode consists of one spring and one mass. 0 for
        free motions.
    """

    parameter: str
    unit: str
    value: float
    eigenvalues: Complexes
    frequencies: Floats
    damping: Floats
    relative: Floats

    def __str__(self) -> str:
        per = f"per {self.unit}" if self.unit and self.unit != "1" else ""
        lines = [f"Change with {self.parameter} = {self.value:g}{f' {self.unit}' if per else ''}"]
        lines.append(f"mode  frequency, Hz {per:16s}  damping ratio    frequency, % per % of the parameter".rstrip())
        for k, (f, d, r) in enumerate(zip(self.frequencies, self.damping, self.relative, strict=True)):
            lines.append(f"{k:4d}  {f:30.6g}  {d:13.6g}    {r:.4f}")
        return "\n".join(lines)


def mode_sensitivity(parameter: str, unit: str, value: float, eigenvalues: Complexes, changes: Complexes) -> ModeSensitivity:
    """From some eigenvalues and their derivatives.

    >>> found = mode_sensitivity("c", "N/m", 4.0, np.array([2j]), np.array([0.25j]))     # omega = sqrt(c / m), m = 1
    >>> float(found.relative[0]), float(2 * np.pi * found.frequencies[0])
    (0.5, 0.25)
    """
    size = np.abs(eigenvalues)
    moving = np.where(size > 0, size, 1.0)
    faster = np.where(size > 0, (eigenvalues.conj() * changes).real / moving, 0.0)
    damping = np.where(size > 0, -(changes.real * moving - eigenvalues.real * faster) / moving**2, 0.0) + 0.0  # no -0
    return ModeSensitivity(parameter, unit, value, changes, faster / (2 * np.pi), damping, faster / moving * value)
