"""`Fit`: the estimated parameters, their uncertainty, and the residuals."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import check_axes, one_name
from gearlib.drawing.quantities import axis_label, spelled
from gearlib.errors import NameLookupError, nearest
from gearlib.fitting.identifiability import Identifiability
from gearlib.optional import optional

if TYPE_CHECKING:
    import pandas

Floats = NDArray[np.float64]
WIDE = 100  # columns of printed output
AT_BOUND = 1e-6  # of its range, size or standard error: a value this close to a bound counts as at the bound
MOST_DRAWN = 6  # series shown in a plot


@dataclass(frozen=True, eq=False)
class FittedSeries:
    """One measured quantity, with the prediction of the fitted system.

    Attributes
    ----------
    name, unit : str
    x : array
        Times, frequencies, or indices, as ``along`` says.
    along : str
    measured, predicted : arrays, real or complex
    noise : float
        Standard deviation, given or estimated; NaN if there is nothing to estimate it from.
    """

    name: str
    unit: str
    x: Floats
    along: str
    measured: Any
    predicted: Any
    noise: float

    @property
    def residuals(self) -> Any:
        """Predicted minus measured."""
        return self.predicted - self.measured


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of `fit`. ``print`` it to read it; ``found["shaft.c"]`` is a value.

    Attributes
    ----------
    system : str
    names : tuple of str
        Names of the free parameters.
    numbers : array (parameters,)
        Their values.
    units : tuple of str
    bounds : array (parameters, 2)
    begin : array (parameters,)
        Initial guess.
    covariance : array (parameters, parameters)
        In the parameters' own units, linearised about the values; infinite (off the diagonal NaN) for parameters that the data does not
        determine; NaN if the noise was not given and no number is left over to estimate it from.
    identifiability : Identifiability
        Singular values of the scaled sensitivities, and the undetermined directions.
    series : tuple of FittedSeries
        Measurements and predictions.
    residuals : array
        Predicted minus measured, divided by the noise or the spread, for all series; real and imaginary parts separately.
    experiments, evaluations : int
    converged : bool
        Whether the search converged within ``evaluations``.
    noise_given : bool
        Whether the noise was given; otherwise it is estimated from the residuals, which are then divided by the spread of each series.
    approximate : str
        Why derivatives of histories are finite differences; empty if they are exact.
    """

    system: str
    names: tuple[str, ...]
    numbers: Floats
    units: tuple[str, ...]
    bounds: Floats
    begin: Floats
    covariance: Floats
    identifiability: Identifiability
    series: tuple[FittedSeries, ...]
    residuals: Floats
    experiments: int
    evaluations: int
    converged: bool
    noise_given: bool
    approximate: str = ""

    def __getitem__(self, name: str) -> float:
        """Value of a parameter."""
        return float(self.numbers[self._place(name)])

    def _place(self, name: str) -> int:
        if one_name("name", name, "shaft.c") not in self.names:
            raise NameLookupError(f"'{name}' was not free; {nearest(name, self.names)}")
        return self.names.index(name)

    @property
    def values(self) -> dict[str, float]:
        """Values by path; those of parameters can be passed to ``simulate(parameters=...)``."""
        return dict(zip(self.names, self.numbers.tolist(), strict=True))

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard deviations by path, linearised about the values; infinite for undetermined parameters, NaN without any noise."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def correlation(self) -> Floats:
        """Correlation matrix of the parameters; NaN for undetermined ones."""
        size = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore"):
            found: Floats = self.covariance / np.outer(size, size)
        return found

    @property
    def identifiable(self) -> bool:
        """Whether the data determines all free parameters."""
        return self.identifiability.complete

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Parameters at a bound."""
        low, high = self.bounds.T
        # A value that tends to a bound of 0 has no size but that of its standard error.
        errors = np.nan_to_num(list(self.standard_errors.values()), posinf=0.0)
        least = AT_BOUND * np.maximum(np.minimum(high - low, np.abs(self.numbers)), errors)
        near = np.minimum(self.numbers - low, high - self.numbers) <= least
        return tuple(n for n, is_near in zip(self.names, near, strict=True) if is_near)

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per parameter: value, standard deviation, unit, bounds, initial guess."""
        pandas = optional("pandas")

        errors = list(self.standard_errors.values())
        return pandas.DataFrame(
            {
                "value": self.numbers, "standard error": errors, "unit": self.units, "low": self.bounds[:, 0],
                "high": self.bounds[:, 1], "begin": self.begin,
            },
            index=pandas.Index(self.names, name="parameter"),
        )  # fmt: skip

    def __str__(self) -> str:
        counts = (len(self.names), "parameter"), (len(self.residuals), "number"), (self.experiments, "experiment")
        free, given, many = (f"{count} {what}{'s' if count > 1 else ''}" for count, what in counts)
        lines = [f"Fit of {free} of {self.system} to {given} from {many}: {self.evaluations} evaluations"]
        if not self.converged:
            lines.append("The search had not ended when the evaluations ran out; give more, or begin nearer.")
        width = max(9, *map(len, self.names))
        lines.append(f"{'parameter':{width}s}  {'value':>12s} {'+- standard error':>18s}  {'unit':12s} {'bounds':>24s}")
        for name, value, error, unit, (low, high) in zip(
            self.names, self.numbers, self.standard_errors.values(), self.units, self.bounds, strict=True
        ):
            sure = f"{error:18.3g}" if np.isfinite(error) else f"{'unknown' if np.isnan(error) else 'not determined':>18s}"
            held = "  at its bound" if name in self.at_bounds else ""
            lines.append(f"{name:{width}s}  {value:12.6g} {sure}  {unit:12s} {f'{low:g} .. {high:g}':>24s}{held}".rstrip())
        lines += self._remarks()
        return "\n".join(
            w for line in lines for w in (textwrap.wrap(line, WIDE, subsequent_indent="  ") if len(line) > WIDE else [line])
        )

    def _remarks(self) -> list[str]:
        """Residuals and identifiability in words."""
        seen, lines = self.identifiability, []
        known = int(seen.determined.sum())
        if len(self.residuals) > known:
            rms = float(np.sqrt((self.residuals**2).sum() / (len(self.residuals) - known)))
            given = f"{rms:.3g} times the noise that was given" if self.noise_given else f"{100 * rms:.3g} % of the spread"
            lines.append(f"What is left is {given}.")
        elif not self.noise_given:
            lines.append("No number is left over to estimate the noise from: for standard errors, give noise=....")
        sizes = f"(singular values {', '.join(f'{s:.3g}' for s in seen.singular_values)})"
        if self.identifiable:
            lines.append(f"Identifiable: the data determines every direction {sizes}.")
        else:
            lines.append(f"Not identifiable: the data determines {known} of {len(self.names)} directions {sizes}.")
            for direction in seen.open_directions:
                shares = ", ".join(f"{name} {share:+.2f}" for name, share in direction.items())
                lines.append(f"  Not determined: {shares} (in parts of their ranges).")
        if self.approximate:
            lines.append(f"Derivatives of histories are differences of runs: {self.approximate}.")
        return lines

    def plot(self, *, axes: Any = None) -> Any:
        """Plot measurements and predictions, one diagram per series (the first 6); returns the matplotlib axes."""
        plt = optional("matplotlib.pyplot")

        shown = self.series[:MOST_DRAWN]
        if axes is None:
            _, axes = plt.subplots(len(shown), 1, figsize=(8, 1.2 + 2.2 * len(shown)), squeeze=False, layout="constrained")
            axes = axes[:, 0] if len(shown) > 1 else axes[0, 0]
        check_axes(axes, len(shown))
        for ax, s in zip(np.atleast_1d(axes), shown, strict=True):
            measured, predicted = (np.abs(v) if np.iscomplexobj(v) else v for v in (s.measured, s.predicted))
            marker = dict(marker=".", linestyle="none", markersize=4, alpha=0.6)
            ax.plot(s.x, measured, label="measured", **marker)
            ax.plot(s.x, predicted, label="fitted", **({} if len(s.x) > 3 else {"marker": "x", "linestyle": "none"}))
            if np.iscomplexobj(s.measured):
                ax.set_xscale("log")
                ax.set_yscale("log")
            ax.set_ylabel(axis_label(s.name, spelled(s.unit)))
            ax.set_xlabel(s.along)
            ax.grid(alpha=0.3)
        np.atleast_1d(axes)[0].legend(fontsize=8)
        return axes
