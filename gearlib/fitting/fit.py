"""`fit`: parameter identification by nonlinear least squares with exact derivatives."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, reals, shown, whole
from gearlib.errors import ArgumentError, GearlibError
from gearlib.fitting.fit_result import Fit, FittedSeries
from gearlib.fitting.identifiability import identifiability
from gearlib.fitting.measured import Measured, MeasuredHistories, MeasuredSeries, as_real, checked_noise
from gearlib.progress import Told, check_progress, reporting
from gearlib.run.start_values import start_named, start_variable
from gearlib.run.subject import translation_of
from gearlib.run.translation import Compiled, Translation

Floats = NDArray[np.float64]
LARGEST = 1e150  # a residual in standard deviations: the sum of squares of larger ones overflows
CONSTANT = 1e-12  # spread of numbers relative to the largest: a smaller one is rounding
CONVERGED = 1e-8  # relative change of the parameters or of the sum of squares at which the search has converged
FLAT = 2.0**-52  # slope of the sum of squares that is rounding: the influence of a parameter may be small


@dataclass(frozen=True, eq=False)
class Range:
    """Bounds and scaling of a free parameter: logarithmic if it is positive.

    >>> bounds = Range("c", 10.0, 1000.0, True)
    >>> float(bounds.value(bounds.place(100.0))), bounds.width
    (100.0, 4.605170185988092)
    """

    name: str
    low: float
    high: float
    logarithmic: bool

    def place(self, value: float) -> float:
        return float(np.log(value)) if self.logarithmic else value

    def value(self, place: float) -> float:
        return float(min(max(np.exp(place) if self.logarithmic else place, self.low), self.high))

    def slope(self, value: float) -> float:
        """The derivative of the value with respect to the scaled position."""
        return value if self.logarithmic else 1.0

    @property
    def width(self) -> float:
        return self.place(self.high) - self.place(self.low)


def fit(
    system: Compiled, data: Any, free: Mapping[str, Sequence[float]], *, noise: Any = None,
    parameters: Mapping[str, float] | None = None, evaluations: int = 100, progress: Any = False,
) -> Fit:  # fmt: skip
    """Estimate parameters of a system from measurements.

    Parameters
    ----------
    system : System
    data : DataFrame, mapping, Measured..., or a list of these
        Histories as `MeasuredHistories` takes them, with a column ``time``; or measurements from one or more experiments:
        `MeasuredHistories`, `MeasuredResponse`, `MeasuredModes`, `MeasuredMargins`.
    free : mapping of str to (low, high)
        The parameters to estimate, and start values as ``"start(load.w)"``, with bounds. The initial guess is the model's own value if
        it lies between them, otherwise the midpoint (of the logarithms, if both bounds are positive).
    noise : float or mapping, optional
        Standard deviation of the noise, for everything or by name; measurements may specify their own. If none is given, the noise of
        each series is assumed to be the same fraction of its spread (of its size, if it is constant), and is estimated from the
        residuals.
    parameters : mapping, optional
        Other values by path, in all experiments that do not give their own.
    evaluations : int
        Limit on evaluations of the system (of all experiments at once).
    progress : bool or callable
        Whether to show a progress bar on a terminal; a callback receives the fraction of ``evaluations`` done, and seconds.

    Returns
    -------
    Fit
        Values, covariance, residuals, and the combinations of parameters that the data does not determine; ``print`` it.

    Raises
    ------
    ArgumentError, NameLookupError
        The message names what was found and what was expected.
    GearlibError
        The system cannot be evaluated at the initial guess.

    Examples
    --------
    A rotor on a shaft of unknown stiffness and damping, of which one vibration mode was measured.

    >>> import gearlib as gl, gearparts as gp
    >>> class Rotor(gl.Component):
    ...     def assemble(self):
    ...         self.ground, self.shaft, self.disc = gp.Fixed(), gp.SpringDamper(c=100.0, d=1.0), gp.Inertia(J=1.0)
    ...         return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange_a)]
    >>> measured = gl.MeasuredModes([3.0], [0.02], noise={"frequencies": 0.01, "damping": 0.001})
    >>> found = gl.fit(gl.compile(Rotor()), measured, free={"shaft.c": (10, 1e4), "shaft.d": (0.01, 10)})
    >>> round(found["shaft.c"], 6), round(found["shaft.d"], 6)          # (2 pi f)^2 J, 2 zeta (2 pi f) J
    (355.305758, 0.753982)
    >>> found.identifiable
    True
    """
    from scipy.optimize import least_squares

    translation = translation_of(system)
    common = by_name("parameters", parameters, "a mapping of paths to numbers")
    experiments = _experiments(data, common)
    ranges = ranges_of(translation, free, experiments)
    for experiment in experiments:
        experiment.bounds = {r.name: (r.low, r.high) for r in ranges}
    series = [s for e in experiments for s in e.series(system)]
    given = checked_noise(noise, list(dict.fromkeys(s.name for s in series))) if noise is not None else {}
    sizes, known = residual_sizes(series, given)
    names = [s.name for s in series for _ in s.numbers]
    evaluator = FitResiduals(system, experiments, ranges, names, np.concatenate([s.numbers for s in series]), sizes)
    evaluator.most = whole("evaluations", evaluations, 1)
    check_progress(progress)
    own = translation.parameter_values(common)
    begin = np.array([first_guess(r, translation, own) for r in ranges])
    evaluator.at(begin)  # raises the system's own error here
    with reporting(progress, f"fit of {translation.name}") as evaluator.tell:
        found = least_squares(
            evaluator.residuals, begin, evaluator.jacobian, x_scale=np.array([r.width for r in ranges]), max_nfev=evaluations,
            bounds=([r.place(r.low) for r in ranges], [r.place(r.high) for r in ranges]),
            ftol=CONVERGED, xtol=CONVERGED, gtol=FLAT,
        )  # fmt: skip
    return _result(translation, evaluator, ranges, series, sizes, known, begin, found)


@dataclass(eq=False)
class FitResiduals:
    """Residuals and their Jacobian, each computed once per point."""

    system: Compiled
    experiments: list[Measured]
    ranges: list[Range]
    names: list[str]  # of the series of each residual
    measured: Floats
    sizes: Floats
    count: int = 0
    approximate: dict[int, str] = field(default_factory=dict)
    tell: Told | None = None
    most: int = 1
    began: float = field(default_factory=time.perf_counter)
    _last: tuple[bytes, Floats, Floats, list[Any]] | None = None

    def at(self, place: Floats) -> tuple[Floats, Floats, list[Any]]:
        """Residuals, their derivatives with respect to the scaled parameters, and the predictions."""
        if self._last is None or self._last[0] != place.tobytes():
            self.count += 1
            values = {r.name: r.value(x) for r, x in zip(self.ranges, place.tolist(), strict=True)}
            predicted: list[Any] = []
            slopes = []
            for k, experiment in enumerate(self.experiments):
                found = experiment.predicted(self.system, values, k not in self.approximate)
                if found.approximate:
                    self.approximate[k] = found.approximate
                predicted += found.values
                slopes += found.slopes
            numbers = np.concatenate([as_real(v) for v in predicted])
            per_place = np.array([r.slope(values[r.name]) for r in self.ranges])
            rows = np.concatenate(slopes) * per_place
            with np.errstate(over="ignore"):
                residuals, slopes_of_residuals = (numbers - self.measured) / self.sizes, rows / self.sizes[:, None]
            self._check(numbers, np.column_stack([residuals, slopes_of_residuals]))
            self._last = place.tobytes(), residuals, slopes_of_residuals, predicted
            if self.tell is not None:
                self.tell(min(1.0, self.count / self.most), time.perf_counter() - self.began)
        return self._last[1:]

    def _check(self, numbers: Floats, sized: Floats) -> None:
        """Raise `ArgumentError` unless the squares of residuals and of their derivatives have a sum in double precision."""
        large = np.flatnonzero(~(np.abs(sized) < LARGEST).all(axis=1))
        if len(large):
            k = int(large[0])
            raise ArgumentError(
                f"{self.names[k]} is predicted as {numbers[k]:.6g} and measured as {self.measured[k]:.6g}; in units of its noise, "
                f"{self.sizes[k]:.3g}, the difference or its derivative is not below {LARGEST:g}. Expected a finite prediction, and a "
                "noise nearer to the scatter of the data"
            )

    def residuals(self, place: Floats) -> Floats:
        try:
            return self.at(place)[0]
        except GearlibError:  # makes the search take a shorter step
            return np.full(len(self.measured), np.inf)

    def jacobian(self, place: Floats) -> Floats:
        return self.at(place)[1]


def _experiments(data: Any, common: Mapping[str, float]) -> list[Measured]:
    """The experiments, with the values of all where they have none of their own."""
    given = list(data) if isinstance(data, (list, tuple)) else [data]
    if not given:
        raise ArgumentError("data is empty; expected measurements from at least one experiment")
    found = [copy(e) if isinstance(e, Measured) else MeasuredHistories(e) for e in given]
    for experiment in found:
        experiment.parameters = {**common, **experiment.parameters}
    return found


def ranges_of(translation: Translation, free: Any, experiments: Sequence[Measured]) -> list[Range]:
    given = by_name("free", free, "a mapping of paths to bounds (low, high)", "shaft.c")
    if not given:
        raise ArgumentError("free is empty; expected the parameters to find with their bounds: free={'shaft.c': (1e3, 1e5)}")
    table, found = translation.model.parameters, []
    for name, bounds in given.items():
        if (started := start_named(name)) is not None:
            start_variable(translation.model, started)
        else:
            table.number(name, " (in free)")
        fixed = next((e.given for e in experiments if name in e.given), None)
        if fixed is not None:
            where = "parameters" if started is None else "the start values of an experiment"
            raise ArgumentError(f"'{name}' is free, and given as {shown(fixed[name])} in {where}; leave one of the two out")
        pair = reals(f"free['{name}']", bounds, "(low, high)")
        if pair.shape != (2,) or not pair[0] < pair[1]:
            raise ArgumentError(f"free['{name}'] is {shown(bounds)}; expected (low, high), low below high")
        low, high = float(pair[0]), float(pair[1])
        found.append(Range(name, low, high, low > 0.0))
    return found


def first_guess(bounds: Range, translation: Translation, numbers: Floats) -> float:
    """Initial guess: moved off bounds, from which the search could not depart."""
    index = translation.model.parameters.index.get(bounds.name)
    low, high = bounds.place(bounds.low), bounds.place(bounds.high)
    value = float(numbers[index]) if index is not None else np.nan
    if bounds.low < value < bounds.high:
        return bounds.place(value)
    return 0.5 * (low + high)


def residual_sizes(series: Sequence[MeasuredSeries], given: Mapping[str, float]) -> tuple[Floats, bool]:
    """Scale of each residual: the noise or, if unknown, the spread of its series; and whether the noise is known."""
    noise = [s.noise if s.noise is not None else given.get(s.name) for s in series]
    known = [n is not None for n in noise]
    if any(known) and not all(known):
        missing = next(s.name for s, k in zip(series, known, strict=True) if not k)
        raise ArgumentError(
            f"the noise of {missing} is not given, that of others is; give all, or none (they are then estimated)"
        )
    sizes = [
        np.full(len(s.numbers), spread_of(s.numbers) if size is None else size) for s, size in zip(series, noise, strict=True)
    ]
    return np.concatenate(sizes), all(known)


def spread_of(numbers: Floats) -> float:
    """Standard deviation, or the size of numbers that are all the same."""
    largest = float(np.abs(numbers).max()) or 1.0
    spread = float(np.std(numbers / largest))  # whose squares do not overflow
    return spread * largest if spread > CONSTANT else largest


def _result(
    translation: Translation, evaluator: FitResiduals, ranges: list[Range], series: list[MeasuredSeries], sizes: Floats, known: bool,
    begin: Floats, found: Any,
) -> Fit:  # fmt: skip
    residuals, slopes, predicted = evaluator.at(found.x)
    values = np.array([r.value(x) for r, x in zip(ranges, found.x.tolist(), strict=True)])
    widths = np.array([r.width for r in ranges])
    per_place = np.array([r.slope(v) for r, v in zip(ranges, values, strict=True)])
    seen = identifiability(slopes * widths, residuals, tuple(r.name for r in ranges), known)
    scale = widths * per_place
    units = translation.parameter_units
    fitted, first = [], 0
    for s, values_found in zip(series, predicted, strict=True):
        count = len(s.numbers)
        noise = float(sizes[first]) * (1.0 if known else seen.noise)
        fitted.append(FittedSeries(s.name, s.unit, s.x, s.along, s.values, values_found, noise))
        first += count
    return Fit(
        translation.name, tuple(r.name for r in ranges), values,
        tuple(units.get(r.name, _start_unit(translation, r.name)) for r in ranges),
        np.array([[r.low, r.high] for r in ranges]), np.array([r.value(x) for r, x in zip(ranges, begin, strict=True)]),
        seen.covariance * np.outer(scale, scale), seen, tuple(fitted), residuals, len(evaluator.experiments), evaluator.count,
        bool(found.status > 0), known, next(iter(evaluator.approximate.values()), ""),
    )  # fmt: skip


def _start_unit(translation: Translation, name: str) -> str:
    started = start_named(name)
    return "" if started is None else translation.unit(started)
