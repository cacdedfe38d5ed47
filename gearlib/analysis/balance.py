"""The equations of harmonic balance of one system: Fourier coefficients of its states, and what is left of their rates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.analysis.floquet import multipliers
from gearlib.analysis.periods import Cuts, Driven, Moments, fourier, jumps, moments, turn
from gearlib.errors import SolverError

Floats = NDArray[np.float64]
RIGID = 1e-9  # relative singular value of a motion that nothing holds back
UNBALANCED = 1e-7  # of the sizes of the rates: a mean that nothing can balance


@dataclass(frozen=True, eq=False)
class Rigid:
    """Motions that nothing holds back (a free-turning train), and sums of the rates that no state has an influence on.

    Attributes
    ----------
    motions, sums : arrays (states, number)
        Orthonormal, in scaled states.
    means : array (states,)
        Of the states; their part along the motions stays as it is here.
    """

    motions: Floats
    sums: Floats
    means: Floats


@dataclass(frozen=True, eq=False)
class Balance:
    """Harmonic balance: ``w D c - transform(f(t, x)) = 0`` with ``x = c_0 + sum(c_k cos(k w t) + s_k sin(k w t))``.

    Attributes
    ----------
    driven : callable
        The scene at a frequency.
    harmonics, samples : int
    scale : array (states,)
        Of the states; unknowns ``z`` are the coefficients over it, residuals the rates over it and over w.
    rigid : Rigid
    varies : bool
        Whether the frequency enters otherwise than through the phase.
    """

    driven: Callable[[float], Driven]
    harmonics: int
    samples: int
    scale: Floats
    rigid: Rigid
    varies: bool

    def coefficients(self, z: Floats) -> Floats:
        result: Floats = z.reshape(2 * self.harmonics + 1, len(self.scale)) * self.scale
        return result

    def unknowns(self, coefficients: Floats) -> Floats:
        result: Floats = (coefficients / self.scale).ravel()
        return result

    def equations(self, z: Floats, omega: float) -> tuple[Floats, Floats, Floats]:
        """Residual, and its derivatives by the unknowns and by the frequency."""
        driven, c = self.driven(omega), self.coefficients(z)
        found = moments(driven, c, self.samples)
        cuts = jumps(driven, c, found, self._step(c))
        basis = fourier(found.phase, self.harmonics)
        back = self._back(found.phase, found.weights, basis)
        f, slopes = driven.linear_rates(found.phase, driven.states(found.phase, c), found.modes)
        mean = back @ (f / self.scale[:, None]).T
        derivative = turn(self.harmonics)
        rest = derivative @ z.reshape(mean.shape) - mean / omega
        rest[0] += driven.growth / self.scale
        by_z = np.kron(derivative, np.eye(len(self.scale))) - self._blocks(basis, back, slopes, cuts) / omega
        by_w = mean / omega**2 - self._explicit(found, c, omega) / omega
        self._check(rest[0], mean, omega)
        return self._held(z, rest, by_z, by_w)

    def _step(self, c: Floats) -> Floats:
        size: Floats = np.maximum(np.abs(c).max(axis=0), 1e-3 * self.scale)
        return size

    def _back(self, phase: Floats, weights: Floats, basis: Floats) -> Floats:
        """The matrix that takes values at the moments to Fourier coefficients."""
        result: Floats = (basis * (2 * weights)[:, None]).T
        result[0] /= 2
        return result

    def _blocks(self, basis: Floats, back: Floats, slopes: Floats, cuts: Cuts | None) -> Floats:
        """Derivative of the mean rates by the unknowns."""
        n, size = len(self.scale), basis.shape[1]
        scaled = slopes * self.scale / self.scale[:, None]
        pairs = (back[:, None, :] * basis.T).reshape(size * size, -1)
        blocks = (pairs @ scaled.reshape(-1, n * n)).reshape(size, size, n, n).transpose(0, 2, 1, 3)
        if cuts is not None:  # a cut moves with the unknowns
            at = fourier(cuts.phase, self.harmonics)
            there = self._back(cuts.phase, np.full(len(at), 1 / (2 * np.pi)), at)
            moved = cuts.gradient * self.scale / cuts.slope[:, None]
            blocks = blocks + np.einsum("kc,ci,cl,cj->kilj", there, cuts.jump / self.scale, at, moved, optimize=True)
        return np.asarray(blocks.reshape(size * n, size * n))

    def _explicit(self, found: Moments, c: Floats, omega: float) -> Floats:
        """Derivative of the mean rates by the frequency, at fixed phases."""
        if not self.varies:
            return np.zeros((len(c), len(self.scale)))
        h = 1e-6 * omega
        basis = fourier(found.phase, self.harmonics)
        x = self.driven(omega).states(found.phase, c)
        ahead, behind = (self.driven(omega + s).rates(found.phase, x, found.modes) for s in (h, -h))
        slope = (ahead - behind) / (2 * h * self.scale[:, None])
        result: Floats = self._back(found.phase, found.weights, basis) @ slope.T
        return result

    def _check(self, first: Floats, mean: Floats, omega: float) -> None:
        """Mean rates that no state can balance must vanish by themselves."""
        if not self.rigid.sums.shape[1]:
            return
        rest = -omega * self.rigid.sums @ (self.rigid.sums.T @ first)
        worst = int(np.argmax(np.abs(rest)))
        if abs(rest[worst]) > UNBALANCED * max(float(np.abs(mean).max()), 1e-300):
            driven = self.driven(omega)
            if driven.growth.any():
                raise _other_speed(driven)
            name = driven.scene.state_names[worst]
            raise SolverError(
                f"there is no periodic motion at {omega:g} rad/s: {name} changes by {rest[worst] * self.scale[worst]:.3g} per second on "
                "average, and nothing in the train can hold it back. Balance the mean torques, add a load that grows with speed, or "
                "leave out outputs that are absolute angles"
            )

    def _held(self, z: Floats, rest: Floats, by_z: Floats, by_w: Floats) -> tuple[Floats, Floats, Floats]:
        """Replace the equations that are redundant by ones that hold the rigid motions where they are."""
        motions, sums = self.rigid.motions, self.rigid.sums
        if motions.shape[1]:
            n = len(self.scale)
            keep = np.eye(n) - sums @ sums.T
            rest[0] = keep @ rest[0] + sums @ (motions.T @ (z[:n] - self.rigid.means / self.scale))
            by_z[:n] = keep @ by_z[:n]
            by_z[:n, :n] += sums @ motions.T
            by_w[0] = keep @ by_w[0]
        return rest.ravel(), by_z, by_w.ravel()

    def multipliers(self, z: Floats, omega: float) -> NDArray[np.complex128]:
        """Floquet multipliers of the motion; those of rigid motions and of the phase (1) are left out."""
        driven, c = self.driven(omega), self.coefficients(z)
        found = moments(driven, c, self.samples)
        cuts = jumps(driven, c, found, self._step(c))
        all_ = multipliers(driven, c, found, cuts, self.samples)
        order = np.argsort(np.abs(all_ - 1.0))
        free = self.rigid.motions.shape[1] + bool(driven.growth.any())  # turning and speeding up go together
        result: NDArray[np.complex128] = all_[np.sort(order[free:])]
        return result


def rigid_motions(driven: Driven, means: Floats, scale: Floats, nominal: Floats) -> Rigid:
    """Find them: directions in which no rate depends on the states, wherever these are.

    The states are drawn at random over many decades, so that a coupling that has play at one of them is closed at others.
    """
    n = len(scale)
    random = np.random.default_rng(1)
    count = max(64, 4 * n)
    size = nominal[:, None] * 10.0 ** random.uniform(-2, 6, (n, count))
    x = means[:, None] + np.where(random.random((n, count)) < 0.5, -1, 1) * size
    phase = random.uniform(0, 2 * np.pi, count)
    with np.errstate(all="ignore"):
        _, slopes = driven.linear_rates(phase, x, driven.modes(phase, x))
    slopes = slopes[np.isfinite(slopes).all(axis=(1, 2))] * scale / scale[:, None] / driven.omega
    if not len(slopes):
        return Rigid(np.empty((n, 0)), np.empty((n, 0)), means)
    motions, sums = _kernel(slopes.reshape(-1, n)), _kernel(np.swapaxes(slopes, 1, 2).reshape(-1, n))
    turning = np.eye(n)[:, driven.growth != 0]  # where in its period a mesh starts is a matter of choice
    number = min(motions.shape[1] + turning.shape[1], sums.shape[1])
    if number < turning.shape[1]:
        raise _other_speed(driven)
    held = np.hstack([turning, motions])[:, :number]
    return Rigid(held, sums[:, :number], means)


def _kernel(matrix: Floats) -> Floats:
    """Orthonormal basis of what a matrix takes to zero."""
    row = np.abs(matrix).max(axis=1)
    matrix = matrix[row > 0] / row[row > 0, None]
    if not len(matrix):
        return np.eye(matrix.shape[1])
    _, s, vt = np.linalg.svd(matrix, full_matrices=len(matrix) < matrix.shape[1])
    rank = int((s > RIGID * s[0]).sum())
    result: Floats = vt[rank:].T.copy()
    return result


def _other_speed(driven: Driven) -> SolverError:
    names = ", ".join(s for s, g in zip(driven.scene.state_names, driven.growth.tolist(), strict=True) if g)
    return SolverError(
        f"the train turns with {names} at a speed that its torques determine, which is not the one that {driven.omega:g} rad/s asks for; "
        "make the torques that drive and load it constant, and let them balance"
    )
