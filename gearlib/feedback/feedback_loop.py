"""`Loop`: a feedback loop over one input and one output of a linear model; its frequency response and crossings.

Everything is computed from state-space matrices. The polynomials of a stiff train have coefficients from 1 to 1e40, and their roots,
which python-control's `stability_margins` uses, are lost in rounding; on small, well-scaled systems both agree (see the tests).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, real, shown
from gearlib.drawing.quantities import spelled
from gearlib.errors import ArgumentError, NameLookupError, nearest
from gearlib.linear.balancing import balance
from gearlib.linear.linear_model import LinearModel, Matrices, label, matrices
from gearlib.linear.linearize import linearized, states_of_outputs
from gearlib.linear.poles import Poles, poles, warn_of_rounding
from gearlib.linear.resolvent import laurent
from gearlib.run.subject import is_compiled, translation_of

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
SEEN = 1e-12  # of the product of the sizes of its factors: a smaller residue of a pole at 0 is rounding


@dataclass(frozen=True, eq=False)
class Loop:
    """dx/dt = A x + b u, y = c x + d u, closed by u = r - y.

    Attributes
    ----------
    A, b, c, d : array (n, n), array (n,), array (n,), float
    input, output : str
    whole : Matrices, optional
        Restricted to one input and one output, before the elimination of held states.
    changes : callable, optional
        Derivatives of these with respect to parameters, by path; available for loops in a System.
    gain : str
        Its value with its unit, which makes the loop a pure number; empty where the units of the signals are not known.
    """

    A: Floats
    b: Floats
    c: Floats
    d: float
    input: str
    output: str
    whole: Matrices | None = None
    changes: Callable[[Sequence[str]], list[Matrices]] | None = None
    gain: str = ""

    @cached_property
    def _balanced(self) -> tuple[Floats, Floats, Floats]:
        """A, b and c in units of the states that suit them."""
        if not len(self.A):
            return self.A, self.b, self.c
        # Balanced with the way from the output back to the input: alone, states in series would be scaled until their couplings are
        # lost. The gain on that way is one at which the loop is of the size 1, so that the scales do not depend on its units.
        n = len(self.A)
        ring, scale = balance(np.block([[self.A, self.b[:, None] / self._size], [self.c, 0.0]]))
        return ring[:n, :n], self.b * scale[n] / scale[:n], self.c * scale[:n] / scale[n]

    @cached_property
    def _schur(self) -> tuple[Complexes, Complexes, Complexes]:
        from scipy.linalg import schur

        A, b, c = self._balanced
        if not len(A):
            return np.empty((0, 0), complex), np.empty(0, complex), np.empty(0, complex)
        triangle, basis = schur(A, output="complex")
        return triangle, basis.conj().T @ b, c @ basis

    @cached_property
    def at_rest(self) -> tuple[float, float]:
        """The transfer function at s = 0, and a bound of its rounding error; infinite if it has a pole there.

        A pole at 0 that the input does not reach, or the output does not show, is none of it: that of a train which turns freely is not
        seen in a deflection.
        """
        if not self.open_poles.at_zero:
            return float(self.response(0.0).real), float(self.rounding(0.0))
        A, b, c = self._balanced
        sizes, (poles_there, regular) = np.linalg.norm(b) * np.linalg.norm(c), laurent(A)
        seen = (abs(c @ term @ b) > SEEN * sizes * np.linalg.norm(term) for term in poles_there)
        if not poles_there or any(seen):
            return np.inf, 0.0
        error = 1e2 * np.finfo(float).eps * (sizes * np.linalg.norm(regular[0]) + abs(self.d))
        return float(c @ regular[0] @ b + self.d), float(error)

    @cached_property
    def _size(self) -> float:
        """Largest magnitude of the transfer function without its feedthrough, between the slowest and the fastest pole."""
        speeds = np.abs(self.open_poles.values[self.open_poles.values != 0])
        points = np.geomspace(speeds.min(), speeds.max(), 9) if len(speeds) else np.array(self.scale)
        A, scale = balance(self.A)
        x = np.linalg.solve(np.exp(1j) * points[:, None, None] * np.eye(len(A)) - A, (self.b / scale)[:, None])[:, :, 0]
        sizes = np.abs(x @ (self.c * scale))
        return float(sizes.max()) or 1.0

    def response(self, s: Any) -> Complexes:
        """Transfer function at complex frequencies, by back substitution in a Schur form."""
        points = np.asarray(s, complex)
        with np.errstate(divide="ignore", invalid="ignore"):
            result: Complexes = (self._schur[2] @ _substituted(*self._schur[:2], points.ravel()) + self.d).reshape(points.shape)
        return result

    def rounding(self, s: Any) -> Floats:
        """Bound on the rounding error of the transfer function: small differences of large terms, and the matrix's own rounding."""
        points = np.asarray(s, complex)
        triangle, b, c = self._schur
        x, y = _substituted(triangle, b, points.ravel()), _substituted(triangle.T[::-1, ::-1], c[::-1], points.ravel())
        terms = 1e2 * (np.abs(c) @ np.abs(x) + abs(self.d))
        with np.errstate(invalid="ignore", over="ignore"):
            terms += 4 * np.linalg.norm(triangle) * np.linalg.norm(x, axis=0) * np.linalg.norm(y, axis=0)
        result: Floats = (np.finfo(float).eps * terms).reshape(points.shape)
        return result

    @cached_property
    def open_poles(self) -> Poles:
        return poles(self.A)

    @cached_property
    def closed_poles(self) -> Poles:
        return poles(self.closed(1.0))

    def closed(self, factor: float) -> Floats:
        """State matrix of the closed loop, with its gain multiplied by a factor."""
        if 1 + factor * self.d == 0:
            times = "" if factor == 1 else f" with {factor:.6g} times its gain"
            raise ArgumentError(
                f"the loop {self.input} -> {self.output} cannot be closed{times}: 1 + L is 0 at infinite frequency"
            )
        found: Floats = self.A - np.outer(self.b, self.c) * factor / (1 + factor * self.d)
        return found

    @cached_property
    def zeros(self) -> Complexes:
        """Finite zeros of the transfer function."""
        from scipy.linalg import eig

        n = len(self.A)
        if not n:
            return np.empty(0, complex)
        sizes = max(np.abs(self.b).max(), 1e-300), max(np.abs(self.c).max(), 1e-300)
        left = np.zeros((n + 1, n + 1))
        left[:n, :n], left[:n, n], left[n, :n] = self.A, self.b / sizes[0], self.c / sizes[1]
        left[n, n] = self.d / sizes[0] / sizes[1]
        right = np.diag([*np.ones(n), 0.0])
        alpha, beta = eig(left, right, right=False, homogeneous_eigvals=True)
        limit = 1e4 * max(np.abs(self.open_poles.values).max(), 1e-300)
        finite = np.abs(beta) * limit > np.abs(alpha)
        found: Complexes = alpha[finite] / beta[finite]
        return found

    @cached_property
    def critical(self) -> Complexes:
        """Open-loop and closed-loop poles: where 1 + L changes rapidly."""
        return np.concatenate([self.open_poles.values, self.closed_poles.values])

    @cached_property
    def scale(self) -> tuple[float, float]:
        """Smallest and largest magnitude of nonzero poles, rad/s."""
        sizes = np.abs(self.critical)
        sizes = sizes[sizes > 0]
        return (float(sizes.min()), float(sizes.max())) if len(sizes) else (1.0, 1.0)

    def frequencies(self, decades: float = 2.0, step: float = 0.1) -> Floats:
        """Angular frequencies (rad/s) that resolve the loop's behaviour: dense near poles and zeros."""
        low, high = self.scale
        start, end = low / 10**decades, high * 10**decades
        marks = np.geomspace(start, end, 200)
        features = np.concatenate([self.critical, self.zeros])
        features = features[np.abs(features) > 0]
        points = refine(marks, lambda x: 1j * x, features, step)
        return points[~np.isin(points, self.open_poles.on_axis)]


def _substituted(triangle: Complexes, b: Complexes, s: Complexes) -> Complexes:
    """Solutions of ``(s - triangle) x = b`` by back substitution."""
    x = np.zeros((len(b), len(s)), complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        for i in range(len(b) - 1, -1, -1):
            x[i] = (b[i] + triangle[i, i + 1 :] @ x[i + 1 :]) / (s - triangle[i, i])
    return x


def refine(marks: Floats, path: Any, features: Complexes, step: float) -> Floats:
    """Refine a path's parameter grid until no factor ``s - feature`` can change phase too much between points.

    On an interval of length h the phase of a rational function changes by less than the sum of h / distance over its poles and zeros.
    Intervals are halved until this sum is below ``step``.
    """
    for _ in range(80):
        middles = (marks[1:] + marks[:-1]) / 2
        s = path(middles)
        length = np.abs(path(marks[1:]) - path(marks[:-1]))
        distance = np.abs(s[:, None] - features[None, :]) - length[:, None] / 2
        turn = (length[:, None] / np.maximum(distance, 1e-9 * length[:, None])).sum(axis=1)
        wide = (turn > step) & (length > 1e-9 * np.abs(s))
        if not wide.any() or len(marks) > 400_000:
            break
        marks = np.sort(np.concatenate([marks, middles[wide]]))
    return marks


def as_loop(
    model: Any, loop: Sequence[Any] | None = None, *, gain: float = 1.0, at: Any = None,
    parameters: Mapping[str, float] | None = None,
) -> Loop:  # fmt: skip
    """The loop from an input to an output of a system or of a linear model.

    Parameters
    ----------
    model : System, control.StateSpace, control.TransferFunction or LinearModel
    loop : (input, output), optional
        Names, or indices of signals; may be omitted if there is one of each.
    gain : float
        Loop gain factor; -1 for positive feedback.
    at, parameters
        Operating point and parameters of a System, as for `System.linearize`.

    Raises
    ------
    ArgumentError, NameLookupError
        Unknown signal, or several and none chosen.
    """
    if loop is not None and (isinstance(loop, str) or not isinstance(loop, Sequence) or len(loop) != 2):
        raise ArgumentError(f"loop is {shown(loop)}; expected (input, output)")
    gain = real("gain", gain)
    translation = None
    if is_compiled(model):
        translation = translation_of(model)
        inputs = outputs = None
        if loop is not None:  # with all states: what the loop does not see may grow all the same
            inputs, outputs = [loop[0]], [*dict.fromkeys((loop[1], *states_of_outputs(translation)))]
        model = linearized(translation, inputs, outputs, at, parameters)
    elif at is not None or by_name("parameters", parameters, "a mapping of paths to numbers"):
        raise ArgumentError("at and parameters belong to a System; a linear model has its numbers already")
    A, B, C, D, ins, outs = matrices(model)
    j = _signal("input", loop and loop[0], ins)
    i = _signal("output", loop and loop[1], outs)

    def one(m: Matrices) -> Matrices:
        """Single-input single-output part of a model's matrices."""
        return Matrices(m.A, m.B[:, [j]] * gain, m.C[[i]], m.D[[i]][:, [j]] * gain)

    whole = changes = None
    if isinstance(model, LinearModel) and model.whole is not None and (known := model.changes) is not None:
        whole = one(model.whole)

        def changes(names: Sequence[str]) -> list[Matrices]:
            return [one(m) for m in known(names)]

    said = ""
    if translation is not None:
        unit, per = (spelled(translation.unit(name)) for name in (ins[j], outs[i]))
        said = f"{gain:g}" if unit == per else f"{gain:g} {unit or '1'} per {per or '1'}"
    found = Loop(A, B[:, j] * gain, C[i], float(D[i, j]) * gain, ins[j], outs[i], whole, changes, said)
    if translation is not None:
        warn_of_rounding(translation.name, model.states, A, found.open_poles)
    return found


def _signal(what: str, chosen: Any, names: Sequence[str]) -> int:
    if chosen is None:
        if len(names) != 1:
            raise ArgumentError(f"choose a loop: the model has {len(names)} {what}s ({', '.join(names[:8])})")
        return 0
    if isinstance(chosen, int) and 0 <= chosen < len(names):
        return chosen
    for candidate in (chosen, label(str(chosen))):  # python-control's names contain no dots
        if candidate in names:
            return list(names).index(candidate)
    raise NameLookupError(f"the linear model has no {what} '{chosen}'; {nearest(str(chosen), names)}")
