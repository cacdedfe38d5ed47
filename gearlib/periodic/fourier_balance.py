"""Harmonic balance equations: Fourier coefficients of the states, residuals of their rates, and the Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import SolverError
from gearlib.linear.balancing import balance
from gearlib.periodic.floquet import monodromy, vibration_multipliers
from gearlib.periodic.periods import Cuts, Driven, Moments, fourier, jumps, moments, transform, turn
from gearlib.run.steady import growing

Floats = NDArray[np.float64]
RIGID = 1e-13  # relative singular value of an unrestrained motion: rounding
BLURRED = 1e-8  # relative to the terms of its rate: lower limit of a state's vibration, below which rounding may be all of it
KEPT = 1e-6  # of a unit direction: a conserved quantity with a smaller component does not determine it
UNBALANCED = 1e-7  # relative to the rates: a mean that nothing can balance


@dataclass(frozen=True, eq=False)
class Rigid:
    """Rigid-body motions: combinations of rates that no state affects, and the conditions that determine their means instead.

    Each such combination is a conserved quantity of the train: the momentum of a freely rotating train, the preload of a loop of
    meshes. Its mean remains at the start value. Where that does not determine the means (an angle, the phase of a mesh), the
    unrestrained motion remains where it starts. Directions in which the train may turn steadily (`gearlib.run.steady.growing`) are no
    unknowns: whatever their mean rate is, nothing depends on them.

    Attributes
    ----------
    sums : array (states, number)
        Orthonormal, in scaled rates, and orthogonal to the free directions.
    rows : array (number, states)
        Combinations of the scaled means that stay as in ``means``.
    means : array (states,)
        Means of the states.
    free : array (states, number)
        Orthonormal directions of the scaled states in which the motion may grow: absolute angles.
    natural : array (states,)
        Units of the states in which each acts upon the others as they act upon it. In those of the vibration, of which a heavy body may
        have hardly any, momentum and motion of a train would be at right angles, as if they belonged to two rigid motions.
    kept : array (states, number)
        The combinations ``sums``, orthonormal in natural units.
    idle : array (states, number)
        Directions of the states on which no rate depends, absolute angles; orthonormal in natural units.
    """

    sums: Floats
    rows: Floats
    means: Floats
    free: Floats
    natural: Floats
    kept: Floats
    idle: Floats

    def without_free(self, vectors: Floats) -> Floats:
        """Vectors, or the columns of a matrix, without their components in the free directions."""
        result: Floats = vectors - self.free @ (self.free.T @ vectors)
        return result


@dataclass(frozen=True, eq=False)
class HarmonicEquations:
    """Harmonic balance: ``w D c - transform(f(t, x)) = 0`` with ``x = c_0 + sum(c_k cos(k w t) + s_k sin(k w t))``.

    Attributes
    ----------
    driven : callable
        Returns the scene at a frequency.
    harmonics, samples : int
    scale : array (states,)
        Scale of each state; unknowns ``z`` are scaled coefficients, residuals are rates divided by the scale and by w.
    rigid : Rigid
    varies : bool
        Whether the frequency enters other than through the phase.
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
        """Residual, and its derivatives with respect to the unknowns and the frequency."""
        driven, c = self.driven(omega), self.coefficients(z)
        found = moments(driven, c, self.samples)
        cuts = jumps(driven, c, found, self._step(c))
        basis = fourier(found.phase, self.harmonics)
        back = transform(found.weights, basis)
        f, slopes = driven.linear_rates(found.phase, driven.states(found.phase, c), found.discrete)
        mean = back @ (f / self.scale[:, None]).T
        derivative = turn(self.harmonics)
        rest = derivative @ z.reshape(mean.shape) - mean / omega
        rest[0] += driven.growth / self.scale
        by_z = np.kron(derivative, np.eye(len(self.scale))) - self._blocks(basis, back, slopes, cuts) / omega
        by_w = mean / omega**2 - self._explicit(found, c, omega, f) / omega
        self._check(rest[0], mean, omega)
        return self._held(z, rest, by_z, by_w)

    def _step(self, c: Floats) -> Floats:
        size: Floats = np.maximum(np.abs(c).max(axis=0), 1e-3 * self.scale)
        return size

    def _blocks(self, basis: Floats, back: Floats, slopes: Floats, cuts: Cuts | None) -> Floats:
        """Derivative of the mean rates with respect to the unknowns."""
        n, size = len(self.scale), basis.shape[1]
        scaled = slopes * self.scale / self.scale[:, None]
        pairs = (back[:, None, :] * basis.T).reshape(size * size, -1)
        blocks = (pairs @ scaled.reshape(-1, n * n)).reshape(size, size, n, n).transpose(0, 2, 1, 3)
        if cuts is not None:  # cuts move with the unknowns
            at = fourier(cuts.phase, self.harmonics)
            there = transform(np.full(len(at), 1 / (2 * np.pi)), at)
            moved = cuts.gradient * self.scale / cuts.slope[:, None]
            blocks = blocks + np.einsum("kc,ci,cl,cj->kilj", there, cuts.jump / self.scale, at, moved, optimize=True)
        return np.asarray(blocks.reshape(size * n, size * n))

    def _explicit(self, found: Moments, c: Floats, omega: float, rates: Floats) -> Floats:
        """Derivative of the mean rates with respect to the frequency, at fixed phases; a forward difference is enough for Newton."""
        if not self.varies:
            return np.zeros((len(c), len(self.scale)))
        h = 1e-6 * omega
        basis = fourier(found.phase, self.harmonics)
        x = self.driven(omega).states(found.phase, c)
        slope = (self.driven(omega + h).rates(found.phase, x, found.discrete) - rates) / (h * self.scale[:, None])
        result: Floats = transform(found.weights, basis) @ slope.T
        return result

    def _check(self, first: Floats, mean: Floats, omega: float) -> None:
        """Check that mean rates which no state can balance vanish."""
        if not self.rigid.sums.shape[1]:
            return
        rest = -omega * self.rigid.sums @ (self.rigid.sums.T @ first)
        worst = int(np.argmax(np.abs(rest)))
        if abs(rest[worst]) > UNBALANCED * max(float(np.abs(mean).max()), 1e-300):
            driven = self.driven(omega)
            if driven.growth.any():
                raise other_speed(driven)
            name = driven.scene.state_names[worst]
            raise SolverError(
                f"there is no periodic motion at {omega:g} rad/s: {name} changes by {rest[worst] * self.scale[worst]:.3g} per second on "
                "average, and nothing in the train can hold it back. Balance the mean torques, or add a load that grows with speed"
            )

    def _held(self, z: Floats, rest: Floats, by_z: Floats, by_w: Floats) -> tuple[Floats, Floats, Floats]:
        """Replace redundant equations by conservation conditions."""
        rows, sums = np.vstack([self.rigid.rows, self.rigid.free.T]), np.hstack([self.rigid.sums, self.rigid.free])
        if len(rows):
            n = len(self.scale)
            keep = np.eye(n) - sums @ sums.T
            rest[0] = keep @ rest[0] + sums @ (rows @ (z[:n] - self.rigid.means / self.scale))
            by_z[:n] = keep @ by_z[:n]
            by_z[:n, :n] += sums @ rows
            by_w[0] = keep @ by_w[0]
        return rest.ravel(), by_z, by_w.ravel()

    def error(self, z: Floats, omega: float) -> tuple[float, float]:
        """Error of the motion in time relative to a state's vibration: at its own harmonics, and at the truncated ones.

        The rates are evaluated at other points, and transformed to more harmonics than the motion has. The response to the difference
        of the train linearised about its mean is the missing correction.
        """
        driven, c = self.driven(omega), self.coefficients(z)
        many = 2 * self.harmonics + 8
        found = moments(driven, c, max(self.samples + self.samples // 2 + 1, 8 * many))
        basis = fourier(found.phase, many)
        f, slopes = driven.linear_rates(found.phase, driven.states(found.phase, c), found.discrete)
        padded = np.zeros((2 * many + 1, len(self.scale)))
        padded[: len(c)] = c / self.scale
        rest = turn(many) @ padded - transform(found.weights, basis) @ (f / self.scale[:, None]).T / omega
        rest[0] += driven.growth / self.scale
        mean = np.tensordot(found.weights, slopes, 1) * self.scale / self.scale[:, None] / omega
        rest[0] = self.rigid.without_free(rest[0])
        k = np.arange(1, many + 1)
        swings = 1j * k[:, None, None] * np.eye(len(mean)) - mean
        try:
            missing = np.linalg.solve(swings, (rest[1::2] - 1j * rest[2::2])[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:
            return np.inf, np.inf
        constant = np.linalg.lstsq(self.rigid.without_free(mean), rest[0], rcond=1e-9)[0]
        wave = np.exp(1j * np.outer(2 * np.pi * np.arange(4 * many) / (4 * many), k))
        low = (wave[:, : self.harmonics] @ missing[: self.harmonics]).real - constant
        high = (wave[:, self.harmonics :] @ missing[self.harmonics :]).real
        swing = np.ptp(fourier(found.phase, self.harmonics) @ c, axis=0) / 2
        blurred = BLURRED * terms(driven, found, slopes, swing + np.abs(c[0]))
        size = np.maximum(np.maximum(swing, blurred) / self.scale, 1e-300)
        return float((np.abs(low) / size).max()), float((np.abs(low + high) / size).max())

    def growth(self, z: Floats, omega: float) -> Floats:
        """Growth of the states per radian of phase, as far as nothing depends on it."""
        driven, c = self.driven(omega), self.coefficients(z)
        found = moments(driven, c, self.samples)
        rates = driven.rates(found.phase, driven.states(found.phase, c), found.discrete) @ found.weights / (omega * self.scale)
        result: Floats = driven.growth + self.scale * (self.rigid.free @ (self.rigid.free.T @ rates))
        return result

    def multipliers(self, z: Floats, omega: float) -> NDArray[np.complex128]:
        """Floquet multipliers of the motion, without those of rigid motions and of the phase (1)."""
        driven, c = self.driven(omega), self.coefficients(z)
        found = moments(driven, c, self.samples)
        cuts = jumps(driven, c, found, self._step(c))
        natural = self.rigid.natural
        over_period = monodromy(driven, c, found, cuts, self.samples) * natural / natural[:, None]
        return vibration_multipliers(over_period, self.rigid.kept, self.rigid.idle, driven.growth / natural)


def terms(driven: Driven, found: Moments, slopes: Floats, sizes: Floats) -> Floats:
    """Size of the motion of each state that the terms of its rate make, before they cancel; ``sizes`` are those of all states."""
    result: Floats = np.tensordot(found.weights, np.abs(slopes), 1) @ sizes / driven.omega + np.abs(driven.growth)
    return result


def rigid_motions(driven: Driven, means: Floats, scale: Floats, nominal: Floats) -> Rigid:
    """Find combinations of rates that depend on no state, anywhere in state space.

    States are sampled at random over many decades, so that a coupling inside its gap at one sample is closed at others.
    """
    n = len(scale)
    random = np.random.default_rng(1)
    count = max(64, 4 * n)
    size = nominal[:, None] * 10.0 ** random.uniform(-2, 6, (n, count))
    x = means[:, None] + np.where(random.random((n, count)) < 0.5, -1, 1) * size
    phase = random.uniform(0, 2 * np.pi, count)
    with np.errstate(all="ignore"):
        _, slopes = driven.linear_rates(phase, x, driven.discrete(phase, x))
    slopes = slopes[np.isfinite(slopes).all(axis=(1, 2))] / driven.omega
    natural = natural_units(slopes) if len(slopes) else scale
    turning = np.eye(n)[:, driven.growth != 0]  # the initial phase of a mesh is arbitrary
    free, ratio = free_directions(driven, natural, turning), scale / natural
    scaled_free = np.linalg.qr(free / ratio[:, None])[0]
    if not len(slopes):
        none = np.empty((n, 0))
        return Rigid(none, none.T, means, scaled_free, natural, none, none)
    slopes = slopes * natural / natural[:, None]
    idle = kernel(slopes.reshape(-1, n))
    slopes = slopes - free @ (free.T @ slopes)
    kept = kernel(np.vstack([np.swapaxes(slopes, 1, 2).reshape(-1, n), free.T]))
    if kept.shape[1] < turning.shape[1]:
        raise other_speed(driven)
    # With everything in contact, the means are undetermined in as few directions as possible.
    rest = min((kernel(np.vstack([slope, free.T])) for slope in slopes), key=lambda directions: directions.shape[1])
    rows = np.empty((0, n))
    # The frequency determines the mesh speed, so that only its phase is free; conserved quantities take precedence over held ones.
    for candidates in (turning, kept, idle):
        left, sizes, right = np.linalg.svd(candidates.T @ rest)
        rank = min(int((sizes > KEPT).sum()), kept.shape[1] - len(rows))
        rows = np.vstack([rows, left[:, :rank].T @ candidates.T])
        rest = rest @ right[rank:].T
    if len(rows) < kept.shape[1]:
        name = driven.scene.state_names[int(np.argmax(np.abs(rest).max(axis=1, initial=0.0)))] if rest.size else "a state"
        raise SolverError(
            f"the mean of {name} is undetermined: nothing in the train holds it, and no quantity that it keeps does; add a load or a "
            "support, or leave out outputs that need it"
        )
    sums, held = (np.linalg.qr(vectors * ratio[:, None])[0] for vectors in (kept, rows.T))
    return Rigid(sums, held.T, means, scaled_free, natural, kept, idle)


def natural_units(slopes: Floats) -> Floats:
    """Units in which each state acts upon the others as they act upon it, for derivatives of the rates at many places."""
    sizes = np.abs(slopes)
    usual = np.median(sizes, axis=0)
    return balance(np.where(usual > 0, usual, sizes.mean(axis=0)))[1]


def free_directions(driven: Driven, scale: Floats, turning: Floats) -> Floats:
    """Orthonormal directions of the scaled states in which the train may turn steadily, apart from those given as turning."""
    directions = growing(driven.scene, driven.numbers) * (driven.scene.nominal / scale)[:, None]
    if turning.shape[1] and directions.shape[1]:
        directions = directions @ kernel(turning.T @ directions)
    result: Floats = np.linalg.qr(directions)[0]
    return result


def kernel(matrix: Floats) -> Floats:
    """Orthonormal basis of the null space of a matrix."""
    row = np.abs(matrix).max(axis=1)
    matrix = matrix[row > 0] / row[row > 0, None]
    _, s, vt = np.linalg.svd(matrix, full_matrices=len(matrix) < matrix.shape[1])
    rank = int((s > RIGID * s.max(initial=0.0)).sum())
    result: Floats = vt[rank:].T.copy()
    return result


def other_speed(driven: Driven) -> SolverError:
    names = [s for s, g in zip(driven.scene.state_names, driven.growth.tolist(), strict=True) if g]
    text = (
        f"the train turns with {', '.join(names)} at a speed that its torques determine, which is not the one that {driven.omega:g} rad/s "
        "asks for; make the torques that drive and load it constant, and let them balance"
    )
    if len(names) > 1:
        text += (
            ". Transmission errors of meshes in a row determine it as well: give them as functions of time, and frequency=..."
        )
    return SolverError(text)
