"""Harmonic balance of a periodically forced train: periodic motions followed over frequency, round folds and onto unstable branches.

The states are Fourier series, ``x(t) = c_0 + sum_k (c_k cos(k w t) + s_k sin(k w t))``. Rates are evaluated at equidistant moments of
a period and transformed back (alternating frequency-time method), which takes any nonlinearity that has no memory. Branches are
followed by pseudo-arclength continuation, and stability is that of the motion's Floquet multipliers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.analysis.continuation import follow
from gearlib.codegen.evaluate import evaluate
from gearlib.errors import ArgumentError, NameLookupError, SolverError, nearest

if TYPE_CHECKING:
    from gearlib.system import System

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HarmonicResponse:
    """Periodic motions along a branch.

    Attributes
    ----------
    omega : array (points,)
        Forcing frequency in the order of the branch, rad/s; it turns back at folds.
    coefficients : array (points, 2 harmonics + 1, states)
        Mean, then cosine and sine of each harmonic.
    multipliers : complex array (points, states)
        Floquet multipliers of one period.
    states : tuple of str
    """

    omega: Floats
    coefficients: Floats
    multipliers: NDArray[np.complex128]
    states: tuple[str, ...]

    @property
    def harmonics(self) -> int:
        """Number of harmonics."""
        return int(self.coefficients.shape[1]) // 2

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Whether small disturbances die out."""
        result: NDArray[np.bool_] = np.abs(self.multipliers).max(axis=1, initial=0.0) < 1.0
        return result

    @property
    def folds(self) -> Floats:
        """Frequencies at which the branch turns back: where the response jumps, rad/s."""
        turned = np.sign(np.diff(self.omega))
        result: Floats = self.omega[1:-1][turned[1:] * turned[:-1] < 0]
        return result

    def _column(self, name: str) -> int:
        if name not in self.states:
            raise NameLookupError(f"the response has no state '{name}'; {nearest(str(name), self.states)}")
        return self.states.index(name)

    def mean(self, name: str) -> Floats:
        """Mean value of a state along the branch."""
        result: Floats = self.coefficients[:, 0, self._column(name)]
        return result

    def amplitude(self, name: str, harmonic: int = 1) -> Floats:
        """Amplitude of a harmonic of a state along the branch."""
        if not 1 <= harmonic <= self.harmonics:
            raise ArgumentError(f"harmonic is {harmonic!r}; expected 1 to {self.harmonics}")
        column = self._column(name)
        result: Floats = np.hypot(self.coefficients[:, 2 * harmonic - 1, column], self.coefficients[:, 2 * harmonic, column])
        return result

    def waveform(self, name: str, point: int, samples: int = 256) -> tuple[Floats, Floats]:
        """Time (s) and values of a state over one period at a point of the branch."""
        t = np.arange(samples) * 2 * np.pi / (self.omega[point] * samples)
        return t, fourier(samples, self.harmonics)[0] @ self.coefficients[point, :, self._column(name)]

    def rms(self, name: str) -> Floats:
        """Root mean square of a state about its mean, along the branch."""
        result: Floats = np.sqrt((self.coefficients[:, 1:, self._column(name)] ** 2).sum(axis=1) / 2)
        return result

    def plot(self, name: str, *, harmonic: int = 1, ax: Any = None) -> Any:
        """Draw the amplitude of a state over frequency, unstable parts dashed; returns the matplotlib axes."""
        import matplotlib.pyplot as plt

        if ax is None:
            _, ax = plt.subplots(figsize=(8, 4.5), layout="constrained")
        amplitude, stable = self.amplitude(name, harmonic), self.stable
        starts = np.flatnonzero(np.diff(stable.astype(int))) + 1
        shown: set[bool] = set()
        for piece in np.split(np.arange(len(stable)), starts):
            kind = bool(stable[piece[0]])
            joined = np.append(piece, min(piece[-1] + 1, len(stable) - 1))
            label = None if kind in shown else ("stable" if kind else "unstable")
            shown.add(kind)
            ax.plot(self.omega[joined], amplitude[joined], "C0-" if kind else "C3--", label=label)
        ax.set_xlabel("forcing frequency, rad/s")
        ax.set_ylabel(f"amplitude of {name}" + (f", harmonic {harmonic}" if harmonic > 1 else ""))
        ax.grid(alpha=0.3)
        ax.legend()
        return ax


def fourier(samples: int, harmonics: int) -> tuple[Floats, Floats]:
    """From coefficients to values at equidistant moments of a period, and back."""
    phase = 2 * np.pi * np.arange(samples)[:, None] / samples * np.arange(1, harmonics + 1)
    back = np.ones((samples, 2 * harmonics + 1))
    back[:, 1::2], back[:, 2::2] = np.cos(phase), np.sin(phase)
    forth = back.T * (2.0 / samples)
    forth[0] /= 2
    return back, forth


@dataclass(frozen=True, eq=False)
class Balance:
    """The equations of harmonic balance of one system."""

    system: System
    parameter: str
    parameters: dict[str, float]
    inputs: Floats
    harmonics: int
    samples: int
    scale: Floats  # of the states

    def rates(self, t: Floats, x: Floats, omega: float) -> Floats:
        """Derivatives of the states, shapes (states, moments)."""
        scene = self.system._scene
        numbers = self.system._prepared(scene, self.system._parameters({**self.parameters, self.parameter: omega}))
        u = np.repeat(self.inputs[:, None], len(t), axis=1)
        modes = scene.modes(numbers, t, x, u)
        slots = evaluate(numbers.main, t, x, u, modes)
        result: Floats = slots[scene.program.output_slots]
        return result

    def linear_rates(self, t: Floats, x: Floats, omega: float) -> tuple[Floats, Floats]:
        """Rates, and their derivatives by the states, shape (moments, states, states), by central differences."""
        n, m = x.shape
        step = 1e-6 * np.maximum(np.abs(x).max(axis=1), self.scale)
        moved = np.concatenate([x, *(x + s * step[i] * np.eye(n)[:, [i]] for i in range(n) for s in (1, -1))], axis=1)
        values = self.rates(np.tile(t, 2 * n + 1), moved, omega).reshape(n, 2 * n + 1, m)
        slopes = (values[:, 1::2] - values[:, 2::2]) / (2 * step[None, :, None])
        return values[:, 0], np.asarray(np.moveaxis(slopes, 2, 0), float)

    def moments(self, omega: float) -> Floats:
        """Equidistant moments of a period."""
        return np.asarray(np.arange(self.samples) * (2 * np.pi / (omega * self.samples)), float)

    def residual(self, z: Floats, omega: float, jacobian: bool = True) -> tuple[Floats, Floats]:
        """``w D c - transform(f(t, x))`` over the scale of rates, and its derivative by the scaled coefficients ``z``."""
        n, size = len(self.scale), 2 * self.harmonics + 1
        back, forth = fourier(self.samples, self.harmonics)
        coefficients = z.reshape(size, n) * self.scale
        t, x = self.moments(omega), (back @ coefficients).T
        turn = np.zeros((size, size))
        for k in range(1, self.harmonics + 1):
            turn[2 * k - 1, 2 * k], turn[2 * k, 2 * k - 1] = k, -k
        f, slopes = self.linear_rates(t, x, omega) if jacobian else (self.rates(t, x, omega), np.empty(0))
        rest = (omega * turn @ coefficients - forth @ f.T) / self.scale / omega
        if not jacobian:
            return rest.ravel(), np.empty(0)
        scaled = slopes * self.scale[None, None, :] / self.scale[None, :, None]
        blocks = np.einsum("kt,tij,tl->kilj", forth, scaled, back, optimize=True)
        matrix = np.kron(turn, np.eye(n)) - blocks.reshape(size * n, size * n) / omega
        return rest.ravel(), matrix

    def multipliers(self, z: Floats, omega: float) -> NDArray[np.complex128]:
        """Floquet multipliers of a period, with the linear rates taken constant between moments."""
        from scipy.linalg import expm

        back, _ = fourier(self.samples, self.harmonics)
        x = (back @ (z.reshape(-1, len(self.scale)) * self.scale)).T
        _, slopes = self.linear_rates(self.moments(omega), x, omega)
        product = np.eye(len(self.scale))
        for step in expm(slopes * (2 * np.pi / (omega * self.samples))):
            product = step @ product
        return np.linalg.eigvals(product).astype(complex)


def harmonic_balance(
    system: System, parameter: str, start: float, end: float, *, harmonics: int = 1, samples: int | None = None,
    guess: Mapping[str, float] | None = None, parameters: Mapping[str, float] | None = None,
    inputs: Mapping[str, float] | None = None, step: float = 0.02, points: int = 1000,
) -> HarmonicResponse:  # fmt: skip
    """Follow the periodic response of a forced system over its forcing frequency.

    Parameters
    ----------
    system : System
        Its states must be periodic: deflections and speeds about a mean, no angle in which it turns.
    parameter : str
        The parameter that is the forcing's angular frequency, rad/s; all functions of time must repeat with it.
    start, end : float
        Frequencies at which to start and to end, rad/s; the branch goes round folds in between.
    harmonics : int
        Number of harmonics.
    samples : int, optional
        Moments of a period at which the system is evaluated (at least 64, and 8 for each harmonic).
    guess : mapping, optional
        Mean values of states to start from, by path; otherwise the start values.
    parameters, inputs : mapping, optional
        Values by path.
    step : float
        Largest arclength of one step; the length of the way from ``start`` to ``end`` counts 1, an amplitude's growth by as much as
        the first amplitude 0.1.
    points : int
        Largest number of points.

    Returns
    -------
    HarmonicResponse

    Raises
    ------
    SolverError
        There is no convergence at ``start``, or a step became too small.

    References
    ----------
    T. M. Cameron, J. H. Griffin, Journal of Applied Mechanics 56 (1989) 149-154, https://doi.org/10.1115/1.3176036.
    M. Krack, J. Gross, "Harmonic Balance for Nonlinear Vibration Problems", Springer 2019,
    https://doi.org/10.1007/978-3-030-14023-6.

    Examples
    --------
    >>> import gearlib as gl, numpy as np
    >>> class Oscillator(gl.Component):
    ...     w = gl.Parameter("rad/s", default=0.5)
    ...     x = gl.Variable("m")
    ...     v = gl.Variable("m/s")
    ...     def equations(self):
    ...         force = gl.cos(self.w * gl.time) - self.x - 0.2 * self.v
    ...         return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), force)]
    >>> response = harmonic_balance(gl.compile(Oscillator()), "w", 0.5, 1.5)
    >>> w = response.omega
    >>> bool(np.allclose(response.amplitude("x"), 1 / np.abs(1 - w**2 + 0.2j * w), rtol=1e-8))
    True
    """
    if not (start > 0 and end > 0 and start != end and np.isfinite([start, end]).all()):
        raise ArgumentError(f"start and end are {start!r} and {end!r}; expected two different positive frequencies, rad/s")
    if not (isinstance(harmonics, int) and harmonics >= 1):
        raise ArgumentError(f"harmonics is {harmonics!r}; expected a whole number, 1 or more")
    count = samples or max(64, 8 * harmonics)
    if count < 2 * harmonics + 1:
        raise ArgumentError(f"samples is {samples!r}; {harmonics} harmonics need at least {2 * harmonics + 1}")
    scene = system._scene
    if not scene.states:
        raise ArgumentError("the system has no states, so there is nothing to balance")
    numbers = system._parameters({**(parameters or {}), parameter: float(start)})
    signals = system._signals(inputs)
    if any(not isinstance(s, (int, float, np.number)) for s in signals):
        raise ArgumentError("inputs must be numbers here; bind a periodic input to an expression of gl.time and the frequency")
    begin = system._start(scene, numbers, 0.0, dict(guess) if guess else None, signals, None)
    missing = len(scene.program.inputs) - len(signals)
    fixed = np.concatenate([np.array(signals, float), np.zeros(missing)])
    balance = Balance(system, parameter, dict(parameters or {}), fixed, harmonics, count, np.ones(len(scene.states)))
    first = np.zeros((2 * harmonics + 1, len(scene.states)))
    first[0] = begin.states
    z = _converged(balance, first.ravel(), float(start))
    spread = np.abs(z.reshape(first.shape)[1:]).max(axis=0)
    scale = 10 * np.where(spread > 1e-9 * spread.max(), spread, max(float(spread.max()), 1e-12))
    balance = Balance(system, parameter, dict(parameters or {}), fixed, harmonics, count, scale)
    z = (z.reshape(first.shape) / scale).ravel()
    path = follow(balance.residual, z, float(start), float(end), step, points)
    coefficients = np.array([p.reshape(first.shape) * scale for p, _ in path])
    multipliers = np.array([balance.multipliers(p, w) for p, w in path])
    return HarmonicResponse(np.array([w for _, w in path]), coefficients, multipliers, system.states)


def _converged(balance: Balance, z: Floats, omega: float) -> Floats:
    for _ in range(60):
        residual, matrix = balance.residual(z, omega)
        change = np.linalg.lstsq(matrix, residual, rcond=None)[0]
        z = z - change
        if np.abs(change).max() <= 1e-9 * np.abs(z).max() + 1e-300:
            return z
    raise SolverError(f"no periodic motion was found at {omega:g} rad/s; start elsewhere, or give a guess of the means")
