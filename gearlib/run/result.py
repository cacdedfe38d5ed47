"""`Result`: the outcome of a run. Variables that were not integrated are computed from the states on demand."""

from __future__ import annotations

import math
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from html import escape
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import as_path, by_name, flag, name_list, one_name, real, shown
from gearlib.errors import ArgumentError, NameLookupError, SolverError, warn
from gearlib.optional import optional
from gearlib.records import altered, unwritable
from gearlib.run.request import Request
from gearlib.run.scene import Scene
from gearlib.run.segment import ADDED, Segment
from gearlib.run.start_values import Start
from gearlib.run.translation import Translation
from gearlib.structure.incidence import Node

if TYPE_CHECKING:
    import pandas
    import xarray

    from gearlib.drawing.gears.gear_set import GearSet
    from gearlib.drawing.gears.gear_view import GearView
    from gearlib.drawing.histories import History
    from gearlib.files.contents import Record
    from gearlib.language.component import Component
    from gearlib.run.energy.energy_balance import EnergyBalance

Floats = NDArray[np.float64]
MOST_SHOWN = 30  # outputs in a notebook
FEWEST = 8  # samples that can show waves
BESIDE = 1e-9  # of a run: times so close to an event are looked at in the steps that found it
STEPS_OVER_A_WAVE = ("rk", "ida")  # methods that take several


class Statistics(dict[str, Any]):
    """Solver statistics; ``["energy_residual"]``, which costs several runs, is computed on first access."""

    check_energy: Callable[[], None] | None = None

    def __missing__(self, key: str) -> Any:
        if key != "energy_residual" or self.check_energy is None:
            raise KeyError(key)
        self.check_energy()
        return self[key]

    def __reduce__(self) -> tuple[Any, ...]:
        return dict, (dict(self),)


class Result(ABC):
    """Time histories of one run.

    ``result["load.w"]`` is the history of a variable, ``result["der(load.w)"]`` that of its derivative, ``result.time`` the sample
    times, ``result.stats`` the solver statistics, ``result.events`` when and where events occurred. Every variable of the model is
    available: what the run did not need is computed on demand, including absolute angles that were not integrated. A result read from a
    file has the variables that were saved.
    """

    time: Floats
    stats: dict[str, Any]
    events: list[Any]

    @abstractmethod
    def __getitem__(self, name: str) -> Floats:
        """History of a variable."""

    @abstractmethod
    def __iter__(self) -> Iterator[str]:
        """Names of the outputs."""

    @abstractmethod
    def __contains__(self, name: object) -> bool:
        """Whether there is such a variable."""

    @abstractmethod
    def unit(self, name: str) -> str:
        """SI unit of a variable or a derivative; empty where the model declares none."""

    @abstractmethod
    def at(self, t: float) -> dict[str, float]:
        """Values of the outputs at a time (s); `final` gives those at the end.

        For a time between samples the run is repeated up to it; a result read from a file is interpolated linearly.

        Raises
        ------
        ArgumentError
            The time lies outside the run.

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp
        >>> class Drive(gl.Component):
        ...     def assemble(self):
        ...         self.torque, self.load = gp.Torque(tau=3.0), gp.Inertia(J=1.5)
        ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
        >>> result = gl.simulate(Drive(), t_end=2.0, samples=3)
        >>> result.at(0.5), result.final
        ({'load.w': 1.0}, {'load.w': 4.0})
        """

    def _check_name(self, name: Any) -> None:
        if not isinstance(name, str):
            raise ArgumentError(
                f"result[{shown(name)}]: expected one name, such as result['load.w']; to_dataframe(names) takes several"
            )

    def _within(self, t: float) -> float:
        """A time, which lies within the run."""
        t = real("t", t, "a finite number of seconds")
        if not self.time[0] <= t <= self.time[-1]:
            raise ArgumentError(f"t is {t:g} s; the run goes from {self.time[0]:g} to {self.time[-1]:g} s")
        return t

    @abstractmethod
    def record(self, names: Sequence[str] | None = None) -> Record:
        """Histories of some variables with their provenance, in the layout of result files (see `save`)."""

    @abstractmethod
    def energy_balance(self) -> EnergyBalance:
        """Work put in, energy stored and heat of every component over time, with the residual; prints as a table.

        The run is repeated with as many samples as the quadrature of the powers needs; runs pay nothing for it otherwise.

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp
        >>> class Spin(gl.Component):
        ...     def assemble(self):
        ...         self.body, self.bearing, self.ground = gp.Inertia(J=2.0, start={"w": 3.0}), gp.Damper(d=1.0), gp.Fixed()
        ...         return [
        ...             gl.connect(self.body.flange_b, self.bearing.flange_a),
        ...             gl.connect(self.bearing.flange_b, self.ground.flange),
        ...         ]
        >>> found = gl.simulate(Spin(), 20.0, samples=2).energy_balance()
        >>> {path: round(float(heat[-1]), 6) for path, heat in found.heat.items()}
        {'bearing': 9.0}
        """

    @abstractmethod
    def sensitivity(self, name: str, parameter: str) -> Floats:
        """Sensitivity of a variable to a parameter or start value, at each sample.

        The derivative is taken at fixed sample times; event times move with the parameter.

        Parameters
        ----------
        name : str
            Path of a variable, or ``"der(...)"`` of one.
        parameter : str
            One of those requested by ``simulate(sensitivities=[...])``.

        Returns
        -------
        array, shape (samples,)
            In units of the variable per unit of the parameter.

        Raises
        ------
        NameLookupError, ArgumentError
            Unknown variable, a discrete variable, or a parameter that was not requested.

        Examples
        --------
        A body accelerated by a torque: w = tau t / J.

        >>> import gearlib as gl, gearparts as gp
        >>> class Drive(gl.Component):
        ...     def assemble(self):
        ...         self.torque, self.load = gp.Torque(tau=3.0), gp.Inertia(J=1.5)
        ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
        >>> result = gl.compile(Drive(), outputs=["load.w"]).simulate(2.0, samples=3, sensitivities=["load.J"])
        >>> result.sensitivity("load.w", "load.J").round(6) + 0.0
        array([ 0.        , -1.333333, -2.666667])
        """

    @abstractmethod
    def gradient(self, weights: Mapping[str, ArrayLike], names: Sequence[str]) -> dict[str, float]:
        """Derivative of one number of the run with respect to parameters and start values: by the adjoint equations, backwards in time.

        The number is any function J of the samples of some variables; ``weights`` are its derivatives with respect to them. The cost
        hardly depends on how many names there are; for many numbers and few names take `sensitivity`.

        Parameters
        ----------
        weights : mapping of str to array, shape (samples,)
            dJ/dy(t_k) of each variable y, by path.
        names : sequence of str
            Paths of parameters, and start values as ``"start(load.w)"``.

        Returns
        -------
        dict of str to float
            dJ/dp, in units of J per unit of the parameter.

        Raises
        ------
        ArgumentError, NameLookupError
            Unknown names; events, sampled controllers, or anything else that the adjoint equations do not go through, by name.
        SolverError
            The gradient still changes with the steps when these are halved again and again.

        Examples
        --------
        The mean speed of a body accelerated by a torque, w = tau t / J, over the samples 0, 1, 2:

        >>> import gearlib as gl, gearparts as gp
        >>> class Drive(gl.Component):
        ...     def assemble(self):
        ...         self.torque, self.load = gp.Torque(tau=3.0), gp.Inertia(J=1.5)
        ...         return [gl.connect(self.torque.flange, self.load.flange_a)]
        >>> result = gl.compile(Drive(), outputs=["load.w"]).simulate(2.0, samples=3)
        >>> found = result.gradient({"load.w": [1 / 3, 1 / 3, 1 / 3]}, ["load.J", "start(load.w)"])
        >>> {name: round(value, 9) for name, value in found.items()}
        {'load.J': -1.333333333, 'start(load.w)': 1.0}
        """

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def keys(self) -> list[str]:
        """Names of the outputs."""
        return [*iter(self)]

    def items(self) -> Iterator[tuple[str, Floats]]:
        """Names and histories of the outputs."""
        return ((name, self[name]) for name in self.keys())

    @property
    def final(self) -> dict[str, float]:
        """Values of the outputs at the end of the run."""
        return self.at(float(self.time[-1]))

    def save(self, path: str | os.PathLike[str], names: Sequence[str] | None = None) -> None:
        """Write histories to a file, with units and provenance: model, parameters, method, versions.

        Parameters
        ----------
        path : path
            The suffix selects the format: ``.mat`` (Dymola and OpenModelica), ``.csv``, ``.nc`` (netCDF), ``.zarr``, ``.parquet``. An
            existing file is replaced atomically.
        names : sequence of str, optional
            Paths of variables. By default the outputs that the system was compiled with, or everything if it was compiled without.

        Raises
        ------
        FileError
            The file cannot be written.
        ArgumentError, NameLookupError, MissingPackageError
            Unknown format or variable, or a package that the format needs is not installed.

        Examples
        --------
        >>> import gearlib as gl, gearparts as gp
        >>> class Spin(gl.Component):
        ...     def assemble(self):
        ...         self.body = gp.Inertia(J=1.0, start={"w": 2.0})
        ...         return []
        >>> path = getfixture("tmp_path") / "spin.mat"
        >>> gl.simulate(Spin(), t_end=1.0, samples=2).save(path)
        >>> gl.load_result(path)["body.flange_a.phi"]
        array([0., 2.])
        """
        from gearlib.files.formats import save_record

        save_record(self.record(names), as_path("path", path))

    def to_dataframe(self, names: Sequence[str] | None = None) -> pandas.DataFrame:
        """The outputs (or the variables named) as a pandas DataFrame over time."""
        pandas = optional("pandas")

        chosen = self.keys() if names is None else name_list("names", names, "load.w")
        return pandas.DataFrame({n: self[n] for n in chosen}, index=pandas.Index(self.time, name="time"))

    def to_xarray(self, names: Sequence[str] | None = None) -> xarray.Dataset:
        """The outputs (or the variables named) as an `xarray.Dataset` over time, with units and descriptions."""
        from gearlib.files.dataset import dataset

        return dataset(self.record(self.keys() if names is None else name_list("names", names, "load.w")))

    def plot(
        self, *names: str, units: Mapping[str, str] | None = None, other: Result | Mapping[str, Result] | None = None,
        events: bool = True, axes: Any = None,
    ) -> Any:  # fmt: skip
        """Plot variables over time with matplotlib, one diagram per unit; returns the axes.

        Parameters
        ----------
        *names : str
            Variables; by default the outputs.
        units : mapping of str to str, optional
            Units to show, by variable or by SI unit, such as ``{"m": "µm", "N": "kN", "s": "ms"}``.
        other : Result or mapping of str to Result, optional
            Runs to compare, keyed by their name in the legend; drawn dashed.
        events : bool
            Whether to mark the times of events.
        axes : matplotlib Axes, optional
            Axes to draw into: one, or one per unit.

        Returns
        -------
        An array if there are several units.
        """
        from gearlib.drawing.histories import plot_histories

        chosen = names or tuple(self.keys())
        if not chosen:
            raise ArgumentError("plot() needs the names of variables")
        runs: dict[str, Result] = {"": self}
        if other is not None:
            runs |= {"other": other} if isinstance(other, Result) else by_name("other", other, "runs by name", "before")
        for name, run in runs.items():
            if not isinstance(run, Result):
                raise ArgumentError(f"other is {shown(run)} for {shown(name)}; expected a result, or results by name")
        histories = [run.history(name, label) for label, run in runs.items() for name in chosen]
        marks = self.events if flag("events", events) else []
        return plot_histories(histories, marks, units=units, axes=axes)

    def plot_against(
        self, x: str, y: str, *, period: float | None = None, units: Mapping[str, str] | None = None, axes: Any = None
    ) -> Any:
        """Plot one variable over another: a phase portrait, a hysteresis loop, an orbit; returns the axes.

        Parameters
        ----------
        x, y : str
            Variables, such as a deflection and its force, or ``"mesh.q"`` and ``"der(mesh.q)"``.
        period : float, optional
            Of the excitation, s: the last period is drawn bold, the states at whole periods before the end are marked (the Poincaré
            section), and the work per period is stated where x and y are a path and its force.
        units : mapping of str to str, optional
            As for `plot`.
        axes : matplotlib Axes, optional
        """
        from gearlib.drawing.curves import plot_against
        from gearlib.drawing.histories import shown_units

        pair = self.history(x), self.history(y)
        shown = shown_units(pair, units)
        return plot_against(*pair, (shown[0], shown[1]), period=period, axes=axes)

    def plot_spectrum(
        self, name: str, *, window: str = "hann", t_start: float | None = None, f_max: float | None = None,
        units: Mapping[str, str] | None = None, axes: Any = None,
    ) -> Any:  # fmt: skip
        """Plot the amplitude spectrum of a variable; returns the axes.

        Parameters
        ----------
        name : str
        window : {"hann", "flattop", "blackman", "rectangular"}
            Flattop shows amplitudes accurately wherever their frequencies lie, Hann separates close frequencies.
        t_start : float, optional
            Start of the analysed interval (s), to leave out the transient.
        f_max : float, optional
            Highest frequency shown, Hz.
        units : mapping of str to str, optional
            As for `plot`.
        axes : matplotlib Axes, optional
        """
        from gearlib.drawing.curves import plot_spectrum
        from gearlib.drawing.histories import shown_units

        history = self.history(name)
        shown = shown_units([history], units)[0]
        drawn = plot_spectrum(history, shown, window=window, t_start=t_start, f_max=f_max, axes=axes)
        self.check_sampling(name, t_start)
        return drawn

    def check_sampling(self, name: str, t_start: float | None = None, t_end: float | None = None) -> None:
        """Warn if a variable does not follow its samples between them, so that a spectrum shows its waves as longer ones.

        A run is repeated for this if its steps are as short as the samples. Results from files are not judged.
        """
        one_name("name", name, "load.w")

    def gear_view(
        self, part: str | None = None, *, t: float | Sequence[float] | None = None, gears: GearSet | None = None
    ) -> GearView:
        """Gears seen along their axes in the course of the run, with the forces of their meshes: `Component.gear_view` of a run.

        Wheels are drawn where the set's first gear and its carrier are, in mesh; deflections are too small to be seen.

        Parameters
        ----------
        part : str, optional
            Path of a pair or of a planetary set, or of what contains some; all without.
        t : float or sequence of float, optional
            Times, s; several make the picture move. Without, 100 times over the run.
        gears : GearSet, optional
            The gears of ``part``, such as ``GearPair(...).drawn_gears()``; without forces where the part has no variable for them.

        Raises
        ------
        ArgumentError
            A time that the run does not go to, or a result that was read from a file.
        ModelError
            There are no gears whose teeth are known.
        """
        from gearlib.language.gears_of import frames, in_motion

        component = self.model_drawn()
        first, last = float(self.time[0]), float(self.time[-1])
        times = np.linspace(first, last, 100) if t is None else frames("t", t, "a time in s, or a sequence of them")
        if not (first <= times.min() and times.max() <= last):
            raise ArgumentError(f"t is {shown(t)}; the run goes from {first:g} to {last:g} s")
        return in_motion(component, part, times, lambda name: np.interp(times, self.time, self[name]), gears)

    @abstractmethod
    def model_drawn(self) -> Component:
        """The component that was simulated, as `gear_view` draws it.

        Raises
        ------
        ArgumentError
            The result was read from a file.
        """

    def history(self, name: str, run: str = "") -> History:
        """A variable over time with its unit, as plots take it; ``run`` labels this run."""
        from gearlib.drawing.histories import History

        return History(name, self.unit(name), self.time, self[name], one_name("run", run, "stiffer shaft"))

    def _repr_html_(self) -> str:
        """Notebook representation: one line per output."""
        rows = []
        for name in self.keys()[:MOST_SHOWN]:
            history = self[name]
            numbers = "".join(f"<td>{x:.6g}</td>" for x in (history[0], history.min(), history.max(), history[-1]))
            rows.append(f"<tr><td>{escape(name)}</td><td>{escape(self.unit(name))}</td>{numbers}</tr>")
        more = len(self) - len(rows)
        head = "".join(f"<th>{title}</th>" for title in ("variable", "unit", "first", "least", "greatest", "last"))
        return f"<p>{escape(repr(self))}</p><table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>" + (
            f"<p>and {more} more</p>" if more else ""
        )


class SimulatedResult(Result):
    """Result of a run in this process; what the run did not need is computed on demand.

    ``result.translation`` and ``result.request`` hold the model and the request.

    Parameters
    ----------
    parts : sequence of (Segment, mapping, callable)
        Each segment with its statistics, and a function that returns its named events.
    translation : Translation
    request : Request
    run : callable
        Repeats the run, with another request or scene.
    """

    def __init__(
        self, parts: Sequence[tuple[Segment, Mapping[str, Any], Callable[[], list[Any]]]], translation: Translation, request: Request,
        run: Callable[[Translation, Request, Scene], SimulatedResult],
    ) -> None:  # fmt: skip
        (first, stats, _), *later = parts
        self.time = unwritable(np.concatenate([first.time, *(part.time[1:] for part, *_ in later)]) if later else first.time)
        statistics = Statistics(stats)
        statistics.check_energy = self.check_energy
        self.stats = statistics
        for _, more, _ in later:
            self.stats |= {k: self.stats[k] + more[k] for k in ADDED if isinstance(more.get(k), (int, float)) and k in stats}
        if later:
            self.stats["segments"] = len(parts)
        self._named = [named for *_, named in parts]
        self._segments = [part for part, *_ in parts] if later else [altered(first, finer=self._finer)]
        self.scene, self.translation, self.request = first.scene, translation, request
        self._outputs = translation.states if translation.outputs is None else translation.outputs
        self._run = run
        self._known: dict[Node, Floats] = {}
        self._extended: SimulatedResult | None = None
        self._all_can_be_integrated = True

    @cached_property
    def events(self) -> list[Any]:  # type: ignore[override]  # as an attribute, it can be set
        """When and where events occurred; named when they are first read."""
        return list(chain.from_iterable(named() for named in self._named))

    def __reduce__(self) -> tuple[Any, ...]:
        parts = [
            (p.scene.states, p.time, p.states, p.discrete, p.parameters, p.signals, p.guess, p.begin, p.tangents, p.events)
            for p in self._segments
        ]
        if any(self.translation.with_states(p.scene.states) is not p.scene for p in self._segments):
            raise TypeError("a run whose states changed on the way cannot be pickled; take its histories: {name: result[name]}")
        return _restored, (self.translation, self.request, self._run, parts, self.stats, self.events)

    def __getitem__(self, name: str) -> Floats:
        self._check_name(name)
        if name in self.scene.model.discretes:
            return self._joined(part.discrete_variable(name) for part in self._segments)
        node, sign = self.scene.named(name)
        if sign == 0:
            return np.zeros_like(self.time)
        return sign * self.history_of(node)

    def model_drawn(self) -> Component:
        return self.translation.component

    def sensitivity(self, name: str, parameter: str) -> Floats:
        name, parameter = one_name("name", name, "load.w"), one_name("parameter", parameter, "load.J")
        directions = self.request.directions
        if directions is None or parameter not in directions.place:
            known = [] if directions is None else directions.names
            advice = f"it has {', '.join(known)}" if known else "it has none"
            raise ArgumentError(
                f"the run was not asked for sensitivities with respect to {parameter!r} ({advice}): "
                f"simulate(..., sensitivities=[{parameter!r}])"
            )
        if name in self.scene.model.discretes:
            raise ArgumentError(f"{name} is a discrete variable, which changes in steps: it has no sensitivity")
        node, sign = self.scene.named(name)
        if sign == 0:
            return np.zeros_like(self.time)
        return sign * self._tangents_of(node)[:, directions.place[parameter]]

    def gradient(self, weights: Mapping[str, ArrayLike], names: Sequence[str]) -> dict[str, float]:
        from gearlib.run.tangents.gradient import gradient_of

        return gradient_of(self.translation, self.request, self.scene, self.time, weights, names, self._run)

    def _tangents_of(self, node: Node) -> Floats:
        """Tangents of a flat-model variable or its derivative, shape (samples, directions)."""
        missing = self.scene.missing(node)
        if missing:
            return self._extend(missing)._tangents_of(node)
        return self._joined(part.tangents_of(node) for part in self._segments)

    def __iter__(self) -> Iterator[str]:
        return iter(self._outputs)

    def __contains__(self, name: object) -> bool:
        model = self.scene.model
        return isinstance(name, str) and (name in model.discretes or model.find(model.column(name)[0]) is not None)

    def unit(self, name: str) -> str:
        return self._declared(name)[0]

    def _declared(self, name: str) -> tuple[str, str]:
        """Unit and description of a variable."""
        name, model = one_name("name", name, "load.w"), self.scene.model
        if name in model.discretes:
            return "", ""
        self.scene.named(name)  # raises for a wrong name, suggesting similar ones
        base, order = model.column(name)
        declared = model.declaration(model.variable(base))
        return (
            ("", "") if declared is None else (declared.unit + "/s" * order, "derivative of: " * order + declared.description)
        )

    def at(self, t: float) -> dict[str, float]:
        t = self._within(t)
        found = self.with_sample(t)
        sample = int(np.searchsorted(found.time, t))
        return {name: float(found[name][sample]) for name in self._outputs}

    def record(self, names: Sequence[str] | None = None) -> Record:
        from gearlib.files.contents import Record, versions

        request, translation = self.request, self.translation
        if names is not None:
            chosen = list(dict.fromkeys(name_list("names", names, "load.w")))
        else:
            chosen = self._computable(self.scene.model.names()) if translation.outputs is None else self.keys()
        histories, places = self._gathered(chosen)
        model, numbers, described = self.scene.model, request.parameters.tolist(), [self._declared(name) for name in chosen]
        table = model.parameters
        known = {name: x for k, (name, x) in enumerate(zip(table.names, numbers, strict=True)) if k not in table.written}
        return Record(
            self.time, histories, tuple(chosen), tuple(column for column, _ in places), tuple(sign for _, sign in places),
            tuple(unit for unit, _ in described), tuple(text for _, text in described), translation.name, known, self.stats,
            tuple(self.events), {"method": str(request.method), "rtol": request.rtol, "atol": request.atol, "t_start": request.t_start,
            "max_step": request.max_step}, versions(),
        )  # fmt: skip

    def _computable(self, names: Iterable[str]) -> list[str]:
        """The variables among some names that the model's equations determine, and the recorded discrete variables."""
        kept = []
        for name in [*names, *self.scene.model.discretes]:
            with suppress(NameLookupError):
                if name in self.scene.model.discretes:
                    self._segments[0].discrete_variable(name)
                else:
                    self.scene.named(name)
                kept.append(name)
        return list(dict.fromkeys(kept))

    def _gathered(self, names: Sequence[str]) -> tuple[Floats, list[tuple[int, int]]]:
        """Distinct histories as columns, and per name its column and sign; all computed together."""
        discretes = set(self.scene.model.discretes)
        found = {name: self.scene.named(name) for name in names if name not in discretes}
        self._compute_together([node for node, sign in found.values() if sign])
        columns: dict[Node | str, int] = {}
        histories: list[Floats] = []
        places = []
        for name in names:
            node, sign = found.get(name, (None, 1))
            key = name if node is None else node if sign else "zero"
            if key not in columns:
                columns[key] = len(histories)
                histories.append(self[name] if node is None or not sign else self.history_of(node))
            places.append((columns[key], sign or 1))
        return np.column_stack([np.empty((len(self.time), 0)), *histories]), places

    def _compute_together(self, nodes: Sequence[Node]) -> None:
        """Prepare to compute some variables together, extending the run by the states that they need."""
        missing = {state for node in nodes for state in self.scene.missing(node)}
        if missing:
            self._extend(missing)._compute_together([n for n in nodes if self.scene.missing(n)])
        for part in self._segments:
            part.scene.compute_together([n for n in nodes if not self.scene.missing(n)])

    def _extend(self, missing: Iterable[Node]) -> SimulatedResult:
        """The run with additional states, integrated beside its stored motion, or else repeated.

        The first time with the missing states only, the second time with all: so the run is repeated at most twice, unless a part of
        the model that was not asked for cannot be integrated.
        """
        known = () if self._extended is None else self._extended.scene.states
        wanted = {*self.scene.states, *known, *missing}
        if len(wanted) == len(known):
            assert self._extended is not None, "it has them all"
            return self._extended
        more = {*self.scene.structure.states} if known else set()
        beside = (self._beside(tuple(sorted(wanted | more))) if more else None) or self._beside(tuple(sorted(wanted)))
        if beside is not None:
            self._extended = beside
            return beside
        if self._extended is None:
            self._extended = self._again(tuple(sorted({*self.scene.states, *missing})))
        elif any(s not in self._extended.scene.place_of for s in missing):
            wanted = {*self._extended.scene.states, *missing}
            if self._all_can_be_integrated:
                try:
                    self._extended = self._again(tuple(sorted({*wanted, *self.scene.structure.states})))
                except SolverError:  # in a part of the model that nothing asked for
                    self._all_can_be_integrated = False
            if not self._all_can_be_integrated:
                self._extended = self._again(tuple(sorted(wanted)))
        return self._extended

    def _beside(self, states: tuple[Node, ...]) -> SimulatedResult | None:
        """The same run with additional states, integrated beside it; None where that is not possible."""
        part = self._segments[0]
        if len(self._segments) > 1 or part.trace is None or part.begun is None:
            return None
        from gearlib.run.afterwards.beside import integrated_beside

        scene = self.translation.with_states(states)
        begin = part.begun(scene)
        found = integrated_beside(part, scene, begin.states, self.request.rtol)
        if found is None:
            return None
        found[:, [scene.place_of[s] for s in part.scene.states]] = part.states
        more = replace(
            part, scene=scene, states=found, guess=begin.guess, known={}, computed=[], finer=None, branches=[], varied={},
            trace=None,
        )  # fmt: skip
        return SimulatedResult([(more, self.stats, lambda: self.events)], self.translation, self.request, self._run)

    @property
    def states(self) -> Floats:
        """Histories of the integrated states, shape (samples, states)."""
        if len(self._segments) == 1:
            return unwritable(self._segments[0].states)
        return np.column_stack([self.history_of(node) for node in self.scene.states])

    def _again(self, states: tuple[Node, ...], times: Floats | None = None) -> SimulatedResult:
        """The same run with other states or other sample times."""
        request = self.request
        atol = request.atol if states == self.translation.scene.states or np.ndim(request.atol) == 0 else None  # type: ignore[arg-type]
        request = replace(request, times=request.times if times is None else times, atol=atol, on_interrupt="raise")
        return self._run(self.translation, request, self.translation.with_states(states))

    def with_sample(self, t: float) -> SimulatedResult:
        """The run itself if a time is one of its samples, else the run repeated up to it; at an event, to its end in the same steps."""
        if t in self.time:
            return self
        if any(abs(event - t) <= BESIDE * (self.time[-1] - self.time[0]) for event, _ in self.events):
            return self.sampled_at(np.union1d(self.time, t))  # a run that ends there may pass over it, by rounding
        return self.sampled_at(np.append(self.time[self.time < t], t))

    def sampled_at(self, times: Floats) -> SimulatedResult:
        """The run repeated with other samples, up to the last of them."""
        return self._again(self.scene.states, times)

    def moment(self, scene: Scene, t: float) -> Start:
        """Start values for a scene whose run continues from this one at a time."""
        if t not in self.time:
            return self.with_sample(t).moment(scene, t)
        sample, part = int(np.searchsorted(self.time, t)), self.segment_at(t)
        states = np.array([self.history_of(node)[sample] for node in scene.states], float)
        guess = part.guess.copy()
        if scene.program.iterated:  # on the solution branch of this run
            for v in scene.program.undifferentiated[0].tolist():
                guess[v] = self.history_of((v, 0))[sample]
        return Start(states, guess, (), part.discrete_at(scene.program, t) if scene.n_discrete else None)

    def _finer(self, times: Floats) -> Segment:
        """The run with other samples: integrated again to its end, in the same steps."""
        part: Segment = self._again(self.scene.states, np.union1d(times, self.time[-1:]))._segments[0]
        return part

    def segment_at(self, t: float) -> Segment:
        """The segment that contains a time."""
        return next(part for part in reversed(self._segments) if part.time[0] <= t)

    def _joined(self, histories: Iterable[Floats]) -> Floats:
        """Histories of the segments joined into one; each later segment begins at the end of the one before."""
        first, *later = histories
        return np.concatenate([first, *(history[1:] for history in later)]) if later else first

    def history_of(self, node: Node) -> Floats:
        """History of a flat-model variable or its derivative."""
        if node not in self._known:
            missing = self.scene.missing(node)
            if not missing and len(self._segments) == 1:
                return self._segments[0].history(node)
            if not missing:
                self._known[node] = self._joined(part.history(node) for part in self._segments)
            else:
                self._known[node] = self._extend(missing).history_of(node)
        return self._known[node]

    @cached_property
    def _energy_balance(self) -> EnergyBalance:
        return self._balance(self.request)

    def _balance(self, request: Request) -> EnergyBalance:
        from gearlib.run.energy.audit import energy_balance
        from gearlib.solvers.inputs.table import Table

        # the exact method crosses switches in time and jumps of inputs without events
        samples = np.union1d([request.t_start], self.time)
        t0, t1 = float(samples[0]), float(samples[-1])
        switches = self.translation.energy_scene.time_switches(request.parameters, t0, t1)
        tables = [signal.over(t0, t1) for signal in request.signals if isinstance(signal, Table)]
        jumps = [*(t for t, _ in (*self.events, *switches)), *(t for table in tables for t in table.jumps.tolist())]
        return energy_balance(self.translation, request, samples, jumps, self._run)

    def energy_balance(self) -> EnergyBalance:
        return self._energy_balance

    def check_sampling(self, name: str, t_start: float | None = None, t_end: float | None = None) -> None:
        from gearlib.run.afterwards.folding import warn_of_folding

        seconds = "a finite number of seconds"
        low = -math.inf if t_start is None else real("t_start", t_start, seconds)
        high = math.inf if t_end is None else real("t_end", t_end, seconds)
        unit = self.unit(one_name("name", name, "load.w"))
        steps = self.stats.get("steps") or math.inf
        if str(self.stats.get("method")).startswith(STEPS_OVER_A_WAVE) and steps < len(self.time):
            return
        inside = (self.time >= low) & (self.time <= high)
        if inside.sum() < FEWEST:
            raise ArgumentError(f"the interval holds {inside.sum()} samples; it takes {FEWEST} to see waves")
        warn_of_folding(name, unit, self.time[inside], self[name][inside], lambda t: self.sampled_at(t)[name], len(self.time))

    def check_energy(self) -> None:
        """Store the residual in ``stats``, and warn if it exceeds what the run's tolerance explains."""
        from gearlib.run.energy.audit import explained

        found = self.energy_balance()

        def tighter(rtol: float) -> EnergyBalance:
            return self._balance(replace(self.request, rtol=rtol))

        self.stats["energy_residual"] = found.relative_residual
        if not explained(found, tighter):
            warn(
                f"the energy balance is off by {found.relative_residual:.2g} of the energy exchanged, more than rtol = {found.rtol:g} "
                f"explains, most of all in {found.worst or 'the whole'}: its equations and its energies() contradict each other, or "
                "the run is wrong (result.energy_balance())",
                RuntimeWarning,
            )

    def __repr__(self) -> str:
        method = self.stats.get("method", "?")
        return f"<Result: {len(self.time)} samples, {self.time[0]:g} .. {self.time[-1]:g} s, {len(self.scene.states)} states, {method}>"


def _restored(
    translation: Translation, request: Request, run: Callable[..., SimulatedResult], parts: Sequence[tuple[Any, ...]],
    stats: dict[str, Any], events: list[Any],
) -> SimulatedResult:  # fmt: skip
    """Unpickle a result from another process."""
    made = [
        (altered(Segment(translation.with_states(states), *rest), events=times), stats, list[Any])
        for states, *rest, times in parts
    ]
    result = SimulatedResult(made, translation, request, run)
    result.stats.update(stats)
    result.events = events
    return result
