"""Measurements: histories, frequency responses, modes and margins; each computes a system's prediction with derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import by_name, complexes, increasing, one_name, real, reals, shown
from gearlib.errors import ArgumentError, GearlibError, NameLookupError, nearest
from gearlib.feedback.stability import stability
from gearlib.linear.frequency_response import frequency_response
from gearlib.run.request import Request
from gearlib.run.simulate import checked_request, run
from gearlib.run.start_values import start_named
from gearlib.run.translation import Compiled
from gearlib.vibration.modes import modes

Floats = NDArray[np.float64]
TIME = "time"
MARGINS = ("gain_margin_db", "phase_margin", "delay_margin", "modulus_margin")
# Relative step of central differences, for runs without tangents: the error is 1e-10 by curvature, 1e-6 by that of runs at TIGHT
STEP = 1e-5
TIGHT = 1e-11  # relative tolerance of runs used in differences


@dataclass(frozen=True, eq=False)
class MeasuredSeries:
    """One measured quantity over an abscissa.

    Attributes
    ----------
    name, unit : str
    x : array
        Times, frequencies, or indices.
    along : str
        Label of ``x`` on plots.
    values : array, real or complex
    noise : float or None
        Standard deviation of each value; for a complex one, of each part.
    """

    name: str
    unit: str
    x: Floats
    along: str
    values: Any
    noise: float | None

    @property
    def numbers(self) -> Floats:
        """Real numbers; complex values as separate parts."""
        return as_real(self.values)


def as_real(values: Any) -> Floats:
    """Real parts followed by imaginary parts of complex values, along the first axis."""
    found = np.asarray(values)
    return np.asarray(np.concatenate([found.real, found.imag]) if np.iscomplexobj(found) else found, float)


@dataclass(frozen=True, eq=False)
class Prediction:
    """A system's predictions for all series, and their derivatives with respect to the free parameters.

    ``approximate`` gives the reason why derivatives are finite differences; empty if they are exact.
    """

    values: list[Any]
    slopes: list[Any]  # (numbers, free)
    approximate: str = ""


class Measured(ABC):
    """One experiment."""

    parameters: Mapping[str, float]
    bounds: Mapping[str, tuple[float, float]] = MappingProxyType({})  # of the free parameters

    def ends(self, name: str, value: float) -> tuple[float, float]:
        """Values of a free parameter for a central difference, within its bounds; near zero, a value has no size of its own."""
        low, high = self.bounds.get(name, (-np.inf, np.inf))
        step = STEP * (value if low > 0.0 else max(abs(value), min(high - low, 1.0)))
        return max(value - step, low), min(value + step, high)

    @property
    @abstractmethod
    def begins(self) -> Any:
        """Start values by path, or what else the experiment begins with."""

    @property
    def given(self) -> dict[str, Any]:
        """Values of this experiment alone: parameters, and start values as ``"start(load.w)"``."""
        starts = self.begins if isinstance(self.begins, Mapping) else {}
        return {**self.parameters, **{f"start({name})": value for name, value in starts.items()}}

    @abstractmethod
    def series(self, system: Compiled) -> list[MeasuredSeries]:
        """The measured series."""

    @abstractmethod
    def predicted(self, system: Compiled, free: Mapping[str, float], exact: bool = True) -> Prediction:
        """Predictions for some values of the free parameters; derivatives are exact where possible and requested."""


def checked_noise(noise: Any, names: Sequence[str]) -> dict[str, float]:
    """Standard deviations by name; empty if unknown."""
    if noise is None:
        return {}
    given = {n: real("noise", noise) for n in names} if not isinstance(noise, Mapping) else by_name("noise", noise, "")
    for name, value in given.items():
        if name not in names:
            raise NameLookupError(f"noise names '{name}', which was not measured; {nearest(name, names)}")
        if not real(f"noise of {name}", value) > 0.0:
            raise ArgumentError(f"noise of {name} is {shown(value)}; expected a standard deviation above 0")
    return {name: float(value) for name, value in given.items()}


def split(free: Mapping[str, float]) -> tuple[dict[str, float], dict[str, float]]:
    """Free parameters, and free start values by path of their variable."""
    own = {name: start_named(name) for name in free}
    starts = {variable: free[name] for name, variable in own.items() if variable is not None}
    return {name: value for name, value in free.items() if own[name] is None}, starts


class MeasuredHistories(Measured):
    """Measured histories of variables in one experiment.

    Parameters
    ----------
    data : pandas.DataFrame or mapping
        One column per variable, by path, and one called ``time`` (s); for a DataFrame without it, the index is the time. NaN marks
        missing values, and so does a mask. Runs begin at the first time.
    inputs, start, parameters : mapping, optional
        For this experiment, as for `System.simulate`.
    noise : float or mapping, optional
        Standard deviation of the noise, of all columns or by path.

    Examples
    --------
    >>> import gearlib as gl
    >>> gl.MeasuredHistories({"time": [0.0, 0.1], "load.w": [0.0, 1.2]}, inputs={"torque.tau": 5.0}, noise=0.1)
    <MeasuredHistories of load.w: 2 times>
    """

    def __init__(
        self, data: Any, *, inputs: Mapping[str, Any] | None = None, start: Mapping[str, float] | str | None = None,
        parameters: Mapping[str, float] | None = None, noise: Any = None,
    ) -> None:  # fmt: skip
        expected = "a pandas.DataFrame, or a mapping of paths to histories with one called 'time'"
        if isinstance(data, Mapping):
            columns: dict[str, Any] = by_name("data", data, expected)
        elif type(data).__name__ == "DataFrame":
            columns = {name: data[name].to_numpy() for name in data.columns}
            columns.setdefault(TIME, data.index.to_numpy())
        else:
            raise ArgumentError(f"data is {shown(data)}; expected {expected}")
        if TIME not in columns:
            raise ArgumentError(f"data has no column 'time'; its columns are {', '.join(map(str, columns))}")
        self.time = increasing("time", columns.pop(TIME), 2, ", s")
        self.columns: dict[str, Floats] = {}
        for name, values in columns.items():
            try:
                found = np.ma.filled(values.astype(float), np.nan) if np.ma.is_masked(values) else np.asarray(values)
            except Exception:  # rows of different lengths; a user's object
                raise ArgumentError(f"data['{name}'] is {shown(values)}; expected a history of numbers") from None
            missing = np.isnan(found) if found.dtype.kind == "f" else np.zeros(found.shape, bool)
            if missing.all():
                raise ArgumentError(f"data['{name}'] holds no number; expected a history of numbers")
            found = reals(f"data['{name}']", np.where(missing, 0.0, found) if missing.any() else found, "a history of numbers")
            if found.shape != self.time.shape:
                raise ArgumentError(
                    f"data['{name}'] has the shape {found.shape}; expected {self.time.shape}, as the times have"
                )
            self.columns[one_name("a column of data", name, "load.w")] = np.where(missing, np.nan, found)
        if not self.columns:
            raise ArgumentError("data has no column but the time; expected one for each variable, by path")
        expected = "a mapping of paths to numbers, functions of time or tables"
        self.inputs = None if inputs is None else by_name("inputs", inputs, expected, "torque.tau")
        self.start = by_name("start", start, "a mapping of paths to start values") if isinstance(start, Mapping) else start
        self.parameters = by_name("parameters", parameters, "a mapping of paths to numbers")
        self.noise = checked_noise(noise, list(self.columns))

    def __repr__(self) -> str:
        return f"<MeasuredHistories of {', '.join(self.columns)}: {len(self.time)} times>"

    @property
    def begins(self) -> Any:
        return self.start

    def series(self, system: Compiled) -> list[MeasuredSeries]:
        unit = system.translation.unit
        return [
            MeasuredSeries(n, unit(n), self.time[(here := ~np.isnan(v))], "time, s", v[here], self.noise.get(n))
            for n, v in self.columns.items()
        ]

    def predicted(self, system: Compiled, free: Mapping[str, float], exact: bool = True) -> Prediction:
        names, reason = list(free), ""
        if exact:
            try:
                result = self._run(system, free, 1e-8, names)
            except GearlibError as problem:
                reason = str(problem)  # the next run fails, too, unless the tangents are to blame
            else:
                slopes = [np.column_stack([result.sensitivity(n, p) for p in names]) for n in self.columns]
                return Prediction(self._kept([result[n] for n in self.columns]), self._kept(slopes))
        result = self._run(system, free, TIGHT)
        columns: list[list[Floats]] = [[] for _ in self.columns]
        for name, value in free.items():
            ends = self.ends(name, value)
            back, ahead = (self._run(system, {**free, name: end}, TIGHT) for end in ends)
            for column, n in zip(columns, self.columns, strict=True):
                column.append((ahead[n] - back[n]) / (ends[1] - ends[0]))
        return Prediction(
            self._kept([result[n] for n in self.columns]), self._kept([np.column_stack(c) for c in columns]), reason
        )

    def _kept(self, values: list[Any]) -> list[Any]:
        return [v[~np.isnan(measured)] for v, measured in zip(values, self.columns.values(), strict=True)]

    def _run(self, system: Compiled, free: Mapping[str, float], rtol: float, tangents: Sequence[str] = ()) -> Any:
        parameters, starts = split(free)
        start: Any = self.start
        if starts:
            start = {**by_name("start", start, "a mapping of paths to start values"), **starts}
        translation, request = checked_request(
            system.translation, float(self.time[-1]), t_start=float(self.time[0]), times=self.time, rtol=rtol,
            parameters={**self.parameters, **parameters}, start=start, inputs=self.inputs, sensitivities=tangents,
        )  # fmt: skip
        assert isinstance(request, Request)
        return run(translation, request)


class MeasuredAtPoint(Measured):
    """Measurements of a linear model at an operating point, which free start values move."""

    at: Any

    @property
    def begins(self) -> Any:
        return self.at

    @abstractmethod
    def _at_point(self, system: Compiled, at: Any, parameters: Mapping[str, float], free: Sequence[str]) -> Prediction:
        """Predictions, with derivatives with respect to some of the parameters."""

    def predicted(self, system: Compiled, free: Mapping[str, float], exact: bool = True) -> Prediction:
        parameters, starts = split(free)
        given, begins = {**self.parameters, **parameters}, isinstance(self.at, Mapping) or self.at is None

        def at_start(moved: Mapping[str, float], names: Sequence[str]) -> Prediction:
            return self._at_point(system, {**(self.at or {}), **moved} if begins and moved else self.at, given, names)

        found = at_start(starts, list(parameters))
        place = {name: k for k, name in enumerate(parameters)}

        def column(name: str, value: float) -> list[Floats]:
            """The derivative of each prediction."""
            if name in place:
                return [slopes[:, place[name]] for slopes in found.slopes]
            if not begins:
                return [np.zeros(len(as_real(v))) for v in found.values]
            ends = self.ends(name, value)
            back, ahead = (at_start({**starts, str(start_named(name)): end}, ()).values for end in ends)
            return [as_real(a - b) / (ends[1] - ends[0]) for a, b in zip(ahead, back, strict=True)]

        columns = [column(name, value) for name, value in free.items()]
        slopes = [np.column_stack(parts) for parts in zip(*columns, strict=True)]
        return Prediction(found.values, slopes, found.approximate)


class MeasuredResponse(MeasuredAtPoint):
    """A measured frequency response from one input to one output.

    Parameters
    ----------
    omega : array
        Angular frequencies, rad/s.
    values : complex array
        Output per unit input.
    input, output : str
        As for `frequency_response`.
    at, parameters
        Operating point and parameters of this experiment, as for `frequency_response`.
    noise : float, optional
        Standard deviation of the real and of the imaginary part.
    """

    def __init__(
        self, omega: ArrayLike, values: ArrayLike, input: str, output: str, *, at: Any = None,
        parameters: Mapping[str, float] | None = None, noise: float | None = None,
    ) -> None:  # fmt: skip
        self.omega = np.atleast_1d(reals("omega", omega, "angular frequencies, rad/s"))
        expected = f"{len(self.omega) or 'some'} finite complex numbers, one for each frequency in omega"
        self.values = complexes("values", values, expected)
        if self.values.shape != self.omega.shape or self.omega.ndim != 1 or not len(self.omega):
            raise ArgumentError(f"values is {shown(values)}; expected {expected}")
        self.input, self.output = one_name("input", input, "torque.tau"), one_name("output", output, "load.w")
        self.at, self.parameters = at, by_name("parameters", parameters, "a mapping of paths to numbers")
        self.noise = checked_noise(noise, [self.output]).get(self.output)

    def __repr__(self) -> str:
        return f"<MeasuredResponse of {self.output} to {self.input}: {len(self.omega)} frequencies>"

    def series(self, system: Compiled) -> list[MeasuredSeries]:
        translation = system.translation
        unit = f"{translation.unit(self.output) or '1'} per {translation.unit(self.input) or '1'}"
        name = f"{self.output} to {self.input}"
        return [MeasuredSeries(name, unit, self.omega / (2 * np.pi), "frequency, Hz", self.values, self.noise)]

    def _at_point(self, system: Compiled, at: Any, parameters: Mapping[str, float], free: Sequence[str]) -> Prediction:
        found = frequency_response(system, self.omega, [self.input], [self.output], at=at, parameters=parameters)
        slopes = found.sensitivities(list(free))[:, 0, 0].T if free else np.empty((len(self.omega), 0), complex)
        return Prediction([found.values[0, 0]], [as_real(slopes)])


class MeasuredModes(MeasuredAtPoint):
    """Measured natural frequencies and damping ratios.

    Parameters
    ----------
    frequencies : array
        Hz.
    damping : array, optional
        Ratios, one per frequency.
    numbers : sequence of int, optional
        Index of each mode, counted from the lowest oscillating one; by default 0, 1, 2, ...
    at, parameters
        Operating point and parameters of this experiment, as for `modes`.
    noise : float or mapping, optional
        Standard deviation of the frequencies (Hz), or by name: ``{"frequencies": 0.5, "damping": 0.002}``.
    """

    def __init__(
        self, frequencies: ArrayLike, damping: ArrayLike | None = None, *, numbers: Sequence[int] | None = None, at: Any = None,
        parameters: Mapping[str, float] | None = None, noise: Any = None,
    ) -> None:  # fmt: skip
        self.measured = {"frequencies": np.atleast_1d(reals("frequencies", frequencies, "frequencies, Hz"))}
        count = len(self.measured["frequencies"])
        if damping is not None:
            self.measured["damping"] = np.atleast_1d(reals("damping", damping, "damping ratios"))
        chosen = np.arange(count) if numbers is None else np.atleast_1d(reals("numbers", numbers, "numbers of modes"))
        if not ((chosen >= 0) & (chosen < 2**53) & (chosen % 1 == 0)).all():
            raise ArgumentError(f"numbers is {shown(numbers)}; expected the index of each mode, a whole number, 0 or more")
        self.numbers = chosen.astype(int)
        for name, values in {**self.measured, "numbers": self.numbers}.items():
            if values.shape != (count,) or not count:
                raise ArgumentError(f"{name} has the shape {values.shape}; expected one for each of {count} frequencies")
        self.at, self.parameters = at, by_name("parameters", parameters, "a mapping of paths to numbers")
        self.noise = checked_noise(
            noise if isinstance(noise, Mapping) or noise is None else {"frequencies": noise}, [*self.measured]
        )

    def __repr__(self) -> str:
        return f"<MeasuredModes: {len(self.numbers)} {' and '.join(self.measured)}>"

    def series(self, system: Compiled) -> list[MeasuredSeries]:
        units = {"frequencies": "Hz", "damping": "1"}
        return [
            MeasuredSeries(n, units[n], self.numbers.astype(float), "mode", v, self.noise.get(n))
            for n, v in self.measured.items()
        ]

    def _at_point(self, system: Compiled, at: Any, parameters: Mapping[str, float], free: Sequence[str]) -> Prediction:
        found = modes(system, at=at, parameters=parameters)
        chosen, count = found.free + self.numbers, len(found) - found.free
        if self.numbers.max() >= count:
            raise ArgumentError(f"numbers names mode {self.numbers.max()}; the system has {count} that vibrate")
        slopes = [found.sensitivity(name) for name in free]
        return Prediction(
            [getattr(found, n)[chosen] for n in self.measured],
            [np.array([getattr(s, n)[chosen] for s in slopes]).reshape(len(free), len(chosen)).T for n in self.measured],
        )


class MeasuredMargins(MeasuredAtPoint):
    """Measured or specified stability margins of a loop.

    Parameters
    ----------
    loop : (input, output)
    gain_margin_db, phase_margin, delay_margin, modulus_margin : float, optional
        Decibels, degrees, seconds, 1; at least one.
    gain : float
        Loop gain factor, as for `stability`.
    at, parameters
        Operating point and parameters of this experiment, as for `stability`.
    noise : float or mapping, optional
        Standard deviation, of all or by name.
    """

    def __init__(
        self, loop: tuple[str, str], *, gain_margin_db: float | None = None, phase_margin: float | None = None,
        delay_margin: float | None = None, modulus_margin: float | None = None, gain: float = 1.0, at: Any = None,
        parameters: Mapping[str, float] | None = None, noise: Any = None,
    ) -> None:  # fmt: skip
        given = (gain_margin_db, phase_margin, delay_margin, modulus_margin)
        self.measured = {n: real(n, value) for n, value in zip(MARGINS, given, strict=True) if value is not None}
        if not self.measured:
            raise ArgumentError(f"no margin was given; expected at least one of {', '.join(MARGINS)}")
        self.loop, self.gain = loop, real("gain", gain)
        self.at, self.parameters = at, by_name("parameters", parameters, "a mapping of paths to numbers")
        self.noise = checked_noise(noise, [*self.measured])

    def __repr__(self) -> str:
        return f"<MeasuredMargins of {self.loop[0]} -> {self.loop[1]}: {', '.join(self.measured)}>"

    def series(self, system: Compiled) -> list[MeasuredSeries]:
        units = dict(zip(MARGINS, ("dB", "deg", "s", "1"), strict=True))
        return [
            MeasuredSeries(n, units[n], np.zeros(1), "", np.array([v]), self.noise.get(n)) for n, v in self.measured.items()
        ]

    def _at_point(self, system: Compiled, at: Any, parameters: Mapping[str, float], free: Sequence[str]) -> Prediction:
        found = stability(system, self.loop, gain=self.gain, at=at, parameters=parameters)
        assert found.loop is not None, "one was chosen"
        margins, slopes = found.loop.margins, [found.sensitivity(p) for p in free]
        values, rows = [], []
        for name in self.measured:
            own = getattr(margins, name)
            if not np.isfinite(own):
                raise ArgumentError(f"the loop {self.loop[0]} -> {self.loop[1]} has no {name} with {parameters}: it is {own}")
            values.append(np.array([own]))
            plain = name.removesuffix("_db")
            per = 20 / np.log(10) / margins.gain_margin if plain != name else 1.0
            rows.append(np.array([[per * getattr(s, plain) for s in slopes]]))
        return Prediction(values, rows)
