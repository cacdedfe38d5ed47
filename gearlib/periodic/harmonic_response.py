"""Results of harmonic balance: periodic motions along a branch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import check_axes, one_name, shown, whole
from gearlib.drawing.quantities import axis_label, spelled
from gearlib.errors import ArgumentError, NameLookupError, nearest
from gearlib.optional import optional
from gearlib.periodic.periods import fourier

if TYPE_CHECKING:
    import pandas

Floats = NDArray[np.float64]
EDGE = 1e-15  # rounding of the size of a multiplier on the unit circle


@dataclass(frozen=True, eq=False)
class HarmonicBalance:
    """Periodic motions along a branch; returned by `harmonic_balance`.

    Attributes
    ----------
    omega : array (points,)
        Forcing frequency along the branch, rad/s; it turns back at folds.
    coefficients : array (points, 2 harmonics + 1, outputs)
        Mean, then cosine and sine of each harmonic, in the outputs' units.
    multipliers : complex array (points, states)
        Floquet multipliers of each motion, without those of rigid motions: NaN where there are more of these than elsewhere on the branch.
    folds : tuple of int
        Indices of the points at which the branch turns back, where the response jumps. See `fold_omega`.
    outputs, units : tuple of str
    complete : bool
        Whether the branch reached the end of the interval (or returned to its start).
    error : array (points,)
        Truncation error of the waveform, relative to the vibration of the state where it is largest: the residual in time, filtered by
        the train linearised about its mean.
    """

    omega: Floats
    coefficients: Floats
    multipliers: NDArray[np.complex128]
    folds: tuple[int, ...]
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    complete: bool
    error: Floats

    def __len__(self) -> int:
        return len(self.omega)

    def __repr__(self) -> str:
        span = f"{len(self)} points, {self.omega.min():g} .. {self.omega.max():g} rad/s" if len(self) else "no points"
        folds = f", folds at {', '.join(f'{w:.6g}' for w in self.fold_omega)} rad/s" if self.folds else ", no folds"
        part = "" if self.complete else ", incomplete"
        return f"<HarmonicBalance of {', '.join(self.outputs)}: {span}, {self.reached}{folds}{part}>"

    @property
    def frequencies(self) -> Floats:
        """Frequencies in Hz."""
        result: Floats = self.omega / (2 * np.pi)
        return result

    @property
    def harmonics(self) -> int:
        """Number of harmonics."""
        return int(self.coefficients.shape[1]) // 2

    @property
    def reached(self) -> str:
        """Number of harmonics, and the largest truncation error, in words."""
        harmonics = f"{self.harmonics} harmonic{'s' if self.harmonics > 1 else ''}"
        return f"{harmonics}, waveform within {self.error.max():.1g}" if len(self) else harmonics

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Whether small perturbations decay: all Floquet multipliers lie inside the unit circle.

        Those of trains without damping lie on it: their perturbations neither decay nor grow.
        """
        result: NDArray[np.bool_] = self._largest < 1.0 - EDGE
        return result

    @property
    def _largest(self) -> Floats:
        result: Floats = np.fmax.reduce(np.abs(self.multipliers), axis=1, initial=0.0)
        return result

    @property
    def fold_omega(self) -> Floats:
        """Frequencies of the folds, rad/s."""
        result: Floats = self.omega[list(self.folds)]
        return result

    def _column(self, output: str) -> int:
        if one_name("output", output, "mesh.q") not in self.outputs:
            raise NameLookupError(f"the response has no output '{output}'; {nearest(output, self.outputs)}")
        return self.outputs.index(output)

    def _complex(self, output: str, harmonic: int) -> NDArray[np.complex128]:
        expected = f"a whole number from 1 to {self.harmonics}"
        if whole("harmonic", harmonic, 1, expected) > self.harmonics:
            raise ArgumentError(f"harmonic is {shown(harmonic)}; expected {expected}")
        pair = self.coefficients[:, 2 * harmonic - 1 : 2 * harmonic + 1, self._column(output)]
        result: NDArray[np.complex128] = pair[:, 0] - 1j * pair[:, 1]
        return result

    def mean(self, output: str) -> Floats:
        """Mean value of an output along the branch."""
        result: Floats = self.coefficients[:, 0, self._column(output)]
        return result

    def amplitude(self, output: str, harmonic: int = 1) -> Floats:
        """Amplitude of a harmonic of an output along the branch."""
        return np.abs(self._complex(output, harmonic))

    def phase(self, output: str, harmonic: int = 1) -> Floats:
        """Phase of a harmonic against ``cos(harmonic w t)``, rad, in (-pi, pi]."""
        return np.angle(self._complex(output, harmonic))

    def rms(self, output: str) -> Floats:
        """Root mean square of an output's deviation from its mean, along the branch; of the harmonics that were taken."""
        result: Floats = np.sqrt((self.coefficients[:, 1:, self._column(output)] ** 2).sum(axis=1) / 2)
        return result

    def waveform(self, output: str, point: int, samples: int = 256) -> tuple[Floats, Floats]:
        """Time (s) and values of an output over one period at a point of the branch."""
        expected = f"the number of a point, 0 to {len(self) - 1}"
        if whole("point", point, -len(self), expected) >= len(self):
            raise ArgumentError(f"point is {shown(point)}; expected {expected}")
        count = whole("samples", samples, 1)
        phase = 2 * np.pi * np.arange(count) / count
        series = self.coefficients[point, :, self._column(output)]
        return phase / self.omega[point], fourier(phase, self.harmonics) @ series

    def to_dataframe(self) -> pandas.DataFrame:
        """Frequency (rad/s), stability, and mean and amplitudes of all outputs, one row per point."""
        pandas = optional("pandas")

        table: dict[str, Any] = {"omega": self.omega, "stable": self.stable, "error": self.error}
        for output in self.outputs:
            table[f"{output}, mean"] = self.mean(output)
            table |= {f"{output}, harmonic {k}": self.amplitude(output, k) for k in range(1, self.harmonics + 1)}
        return pandas.DataFrame(table)

    def plot(self, output: str | None = None, *, harmonic: int = 1, ax: Any = None) -> Any:
        """Plot the amplitude of an output (by default the first) over frequency.

        Motions that are not stable are dashed, folds are marked. Returns the matplotlib axes.
        """
        plt = optional("matplotlib.pyplot")

        name = self.outputs[0] if output is None else output
        amplitude, stable, f = self.amplitude(name, harmonic), self.stable, self.frequencies
        if ax is None:
            _, ax = plt.subplots(figsize=(8, 4.5), layout="constrained")
        check_axes(ax, 1, "ax")
        turns = [k for k in range(1, len(f)) if stable[k] != stable[k - 1]]
        labelled: set[bool] = set()
        other = "unstable" if (self._largest > 1.0 + EDGE).any() else "marginal"
        for first, end in zip([0, *turns], [*turns, len(f)]):
            kind, piece = bool(stable[first]), slice(first, end + 1)
            label = None if kind in labelled else ("stable" if kind else other)
            labelled.add(kind)
            ax.plot(f[piece], amplitude[piece], "C0-" if kind else "C3--", label=label)
        for n, k in enumerate(self.folds):
            ax.plot(f[k], amplitude[k], "ko", ms=4, label=None if n else "fold")
            ax.annotate(f"{f[k]:.4g} Hz", (f[k], amplitude[k]), textcoords="offset points", xytext=(6, 4), fontsize=8)
        ax.set_xlabel("forcing frequency, Hz")
        quantity = f"amplitude of {name}{f', harmonic {harmonic}' if self.harmonics > 1 else ''}"
        ax.set_ylabel(axis_label(quantity, spelled(self.units[self._column(name)])))
        ax.set_title(f"Harmonic balance, {self.reached}")
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8)
        return ax
