"""Passivity certificate: stored energy of a linear train that decreases by dissipation alone.

For x' = A x + B u the components declare the stored energy H = x' Q x / 2. If Q and W = -(Q A + A' Q) / 2 are positive semidefinite,
dH/dt = -x' W x + y' u with the outputs y = B' Q x: everything that the train stores and dissipates comes from outside, at every
amplitude, and no motion can grow. The eigenvalues of A are not used, but for motions that store no energy, such as those of signals.

References
----------
J. C. Willems, "Dissipative dynamical systems, part II: linear systems with quadratic supply rates", Archive for Rational Mechanics
and Analysis 45 (1972) 352-393. https://doi.org/10.1007/BF00276494 (Q is a solution of the Kalman-Yakubovich-Popov inequality.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.flatten.energies import Term
from gearlib.linear.linear_model import full
from gearlib.linear.linearize import linearized
from gearlib.linear.operating_point import fitting, parameters_at
from gearlib.linear.poles import poles
from gearlib.run.subject import translation_of
from gearlib.run.translation import Compiled, Translation

Floats = NDArray[np.float64]
ROUNDING = 1e-9  # relative to the largest coefficient, both scaled by the energy of each state
CANCELS = 1e-13  # relative to the terms: what is left where forces and speeds exchange energy without loss


@dataclass(frozen=True, eq=False)
class Passivity:
    """Result of a passivity analysis. ``print`` it to read it.

    Attributes
    ----------
    states : tuple of str
        Paths, in the order of the matrices.
    Q, W : array
        Stored energy ``x' Q x / 2`` (J) and dissipated power ``x' W x`` (W); shape (n, n).
    reason : str
        Why there is no certificate; empty if there is one.
    """

    states: tuple[str, ...]
    Q: Floats
    W: Floats
    reason: str = ""

    @property
    def holds(self) -> bool:
        """Whether the model is proved to be passive."""
        return not self.reason

    def __str__(self) -> str:
        if self.reason:
            return f"no certificate of passivity: {self.reason}"
        ranks = [np.linalg.matrix_rank(rescaled_form(m, self.Q), ROUNDING, hermitian=True) for m in (self.Q, self.W)]
        return (
            "passive: the stored energy x'Qx/2 >= 0 falls by the losses x'Wx >= 0 alone "
            f"({len(self.states)} states, rank of Q {ranks[0]}, of W {ranks[1]})"
        )


def passivity(system: Compiled, *, at: Any = None, parameters: Mapping[str, float] | None = None) -> Passivity:
    """Passivity certificate of a linear model, from the energies that its components declare.

    Parameters
    ----------
    system : System
        Must be linear with constant coefficients.
    at : None, "steady", mapping, or (Result, time), optional
        Operating point, if parameters of the linear model depend on it; see `System.linearize`.
    parameters : mapping, optional
        Values by path.

    Returns
    -------
    Passivity
        ``.holds``, ``.reason``; ``.Q`` and ``.W`` are the proof.

    Raises
    ------
    ArgumentError
        Not a compiled system.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> gl.passivity(gl.compile(gp.ZhouCui2022())).holds
    True
    """
    translation = fitting(translation_of(system), at, parameters)
    nothing = np.zeros((0, 0))
    if not translation.scene.program.is_linear:
        return Passivity((), nothing, nothing, "the equations are not linear with constant coefficients")
    parts = translation.energies
    if reason := undeclared(translation, parts):
        return Passivity((), nothing, nothing, reason)
    numbers = dict(zip(translation.model.parameters.names, parameters_at(translation, at, parameters).tolist(), strict=True))
    names = sorted({n for p in parts if p.stored for n in p.stored.names} - numbers.keys())
    try:
        model = linearized(translation, [], [*translation.states, *names], at, parameters, worded=False)
    except SolverError as problem:
        return Passivity((), nothing, nothing, str(problem))
    A, rows = full(model.A), dict(zip(model.outputs, full(model.C), strict=True))
    n = len(model.states)
    Q = np.zeros((n, n))
    for part in parts:
        if part.stored is None:
            continue
        form = quadratic(part.stored, numbers)
        if form is None:
            return Passivity(model.states, nothing, nothing, f"the energy of {part.path} ({part.kind}) is not quadratic")
        read = [rows[name] for name in part.stored.names if name in rows]
        own = np.array(read).reshape(len(read), n)
        Q += 2 * own.T @ form @ own
    W, terms = -(Q @ A + A.T @ Q) / 2, (np.abs(Q) @ np.abs(A) + np.abs(A.T) @ np.abs(Q)) / 2
    W[np.abs(W) <= CANCELS * terms] = 0.0
    return Passivity(model.states, Q, W, doubt(Q, W) or growth_beside(A, Q))


def undeclared(translation: Translation, parts: Sequence[Any]) -> str:
    """Why the declared energies do not cover the whole model."""
    for part in parts:
        if part.unknown or not part.declares:
            return f"{part.path} ({part.kind}) does not declare what it stores and loses"
        given = () if part.stored is None else part.stored.names
        if "time" in given or any(name in translation.model.discretes for name in given):
            return f"the energy of {part.path} ({part.kind}) changes with time"
    return ""


def quadratic(term: Term, numbers: Mapping[str, float]) -> Floats | None:
    """The matrix F of a term ``v' F v`` in its variables v; None if it is not a quadratic form."""
    places = [k for k, name in enumerate(term.names) if name not in numbers]
    count = len(places)
    constants = [numbers.get(name, 0.0) for name in term.names]

    def value(v: Floats) -> float:
        given = list(constants)
        for k, x in zip(places, v, strict=True):
            given[k] = float(x)
        return float(term.function(*given))

    unit = np.eye(count)
    alone = [value(unit[i]) for i in range(count)]
    F = np.diag(alone)
    for i in range(count):
        for j in range(i):
            F[i, j] = F[j, i] = (value(unit[i] + unit[j]) - alone[i] - alone[j]) / 2
    scale = float(np.abs(F).sum())
    for v in np.random.default_rng(0).normal(size=(3, count)) * 3:
        if not abs(value(v) - v @ F @ v) <= ROUNDING * scale * float(v @ v):
            return None
    return F if value(np.zeros(count)) == 0.0 else None


def doubt(Q: Floats, W: Floats) -> str:
    """Why the matrices prove nothing; empty if they do."""
    if not len(Q):
        return ""
    energy, lost = rescaled_form(Q, Q), rescaled_form(W, Q)
    if np.linalg.eigvalsh(energy).min() < -ROUNDING:
        return "a component declares a stored energy that is negative"
    if np.linalg.eigvalsh(lost).min() < -ROUNDING * np.abs(lost).max():
        return "there is a motion that gains energy without an input"
    return ""


def growth_beside(A: Floats, Q: Floats) -> str:
    """Whether a motion that stores no energy grows; empty if none does. By the matrices of a proof, such motions keep to themselves."""
    scale = scales(Q)
    sizes, basis = np.linalg.eigh(rescaled_form(Q, Q))
    without = basis[:, sizes <= ROUNDING]
    if poles(without.T @ (A * scale / scale[:, None]) @ without).right:
        return "a motion that stores no energy, of signals for example, grows"
    return ""


def scales(Q: Floats) -> Floats:
    """States that each store half a joule, where they store any."""
    diagonal = np.diag(Q)
    result: Floats = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    return result


def rescaled_form(matrix: Floats, Q: Floats) -> Floats:
    """A quadratic form, rescaled to states that each store half a joule at one."""
    scale = scales(Q)
    scaled: Floats = matrix * scale * scale[:, None]
    return scaled
