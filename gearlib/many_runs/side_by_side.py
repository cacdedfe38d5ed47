"""`SideBySide`: simulations of a sweep that are prepared and integrated many at a time; base of the ways to integrate them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.instructions import LANES
from gearlib.errors import GearlibError
from gearlib.flatten.flatten import out_of_bounds
from gearlib.program.interpret import regular, solutions_of_runs
from gearlib.reduce.coefficients import start_guess
from gearlib.reduce.reduction import confirm
from gearlib.run.linear_form import LinearForms, linear_forms
from gearlib.run.request import Request
from gearlib.run.result import Result, SimulatedResult
from gearlib.run.segment import Segment
from gearlib.run.simulate import run
from gearlib.run.start_values import Start, starts_of_runs
from gearlib.run.translation import Translation
from gearlib.solvers.inputs.table import Table, unrolled

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
AT_ONCE = 4096  # runs that are prepared together: enough that the overhead of numpy is negligible for each
MOST_NUMBERS = 4_000_000  # samples of states computed together (32 MB)


@dataclass(frozen=True, eq=False)
class KeptStates:
    """Samples of the kept states of some runs.

    Attributes
    ----------
    runs : array of int
        Indices of the runs.
    states : array, shape (runs, samples, kept)
    """

    runs: Integers
    states: Floats


Found = tuple[int, SimulatedResult | None] | KeptStates  # one run, or several; None: to be simulated on its own


def why_one_by_one(translation: Translation, request: Request) -> str | None:
    """Reason why runs cannot be prepared together, or None; the values of each run are checked later, by `PreparedRuns`."""
    scene = translation.scene
    if isinstance(request.start, Result) or (isinstance(request.start, tuple) and isinstance(request.start[0], Result)):
        return "the runs go on from another one"
    if translation.substituted or translation.controllers or translation.structure.switching:
        return "the model has sampled controllers, or equations that other parameters change"
    if not scene.states or scene.n_discrete:
        return "there are events" if scene.n_discrete else "there are no states"
    if scene.model.bounded:
        return "variables have least values that are to be watched"
    return None


@dataclass(frozen=True, eq=False)
class SideBySide(ABC):
    """Simulations of a translation, prepared and integrated many at a time.

    Attributes
    ----------
    translation : Translation
    request : Request
        With the parameters of the first run.
    parameters, inputs : mapping
        Values common to all runs, by path.
    whole : bool
        Whether complete results are required; otherwise the histories of the states in ``kept`` suffice.
    kept : tuple of int
        Indices of states.
    last : bool
        Whether the last sample suffices.
    """

    translation: Translation
    request: Request
    parameters: Mapping[str, float]
    inputs: Mapping[str, Any]
    whole: bool
    kept: tuple[int, ...]
    last: bool

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the fields only: each process computes its own cached properties."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    @abstractmethod
    def statistics(self) -> Mapping[str, Any]:
        """Entries for the statistics of the sweep."""

    @abstractmethod
    def runs_of(self, prepared: PreparedRuns) -> Iterator[Found]:
        """Simulate the runs that are ``fit``."""

    def column(self, name: str) -> int:
        """Index of an output among the kept states; -1 if it is none of them."""
        place = self.translation.scene.place_of.get(self.translation.scene.named(name)[0], -1)
        return self.kept.index(place) if place in self.kept else -1

    @cached_property
    def linear(self) -> LinearForms | str:
        """The linear forms of the runs, or the reason why the scene has none."""
        scene = self.translation.scene
        return linear_forms(scene, scene.prepared(self.request.parameters), self.signals)

    @cached_property
    def grid(self) -> Floats:
        """The output times with the start time before them, s."""
        times, t_start = self.request.times, self.request.t_start
        return times if times[0] == t_start else np.concatenate([[t_start], times])

    @cached_property
    def signals(self) -> tuple[Any, ...]:
        """The inputs of the first run, with tables over the whole run."""
        return unrolled(self.request.signals, float(self.grid[0]), float(self.grid[-1]))

    @cached_property
    def sampled(self) -> Floats:
        """The times of `grid` at which states are computed: all of them, or the first and the last."""
        return self.grid[[0, -1]] if self.last and len(self.grid) > 2 else self.grid

    @property
    def hidden(self) -> int:
        """Number of leading samples in `sampled` that are no output times."""
        return 1 if len(self.sampled) < len(self.grid) else len(self.grid) - len(self.request.times)

    @cached_property
    def columns(self) -> Integers:
        """Indices of the states that are sampled."""
        return np.arange(len(self.translation.scene.states)) if self.whole else np.array(self.kept, np.int64)

    def results(
        self, parameters: Mapping[str, Floats], starts: Mapping[str, Floats], inputs: Mapping[str, Any], count: int
    ) -> Iterator[Found]:
        """Indices and results of the runs, in the order of completion; None for a run that does not fit, or failed."""
        size = max(LANES, min(AT_ONCE, MOST_NUMBERS // max(len(self.sampled) * len(self.columns), 1)))
        for first in range(0, count, size):
            here = slice(first, min(first + size, count))
            varied = [{name: column[here] for name, column in given.items()} for given in (parameters, starts, inputs)]
            prepared = PreparedRuns(self, varied[0], varied[1], varied[2], here.stop - first)
            yield from ((first + i, None) for i in np.flatnonzero(~prepared.fit).tolist())
            if prepared.fit.any():
                for found in self.runs_of(prepared):
                    if isinstance(found, KeptStates):
                        if len(found.runs):
                            yield KeptStates(found.runs + first, found.states)
                    else:
                        yield first + found[0], found[1]


class PreparedRuns:
    """Parameters, inputs and start values of several runs, as arrays.

    Attributes
    ----------
    count : int
    parameters : array, shape (parameters, runs)
    signals : list of (array or tuple)
        Unbound inputs: one number per run, or one table per run.
    solutions : list of arrays, shape (runs, unknowns, known)
        Solutions of the linear blocks.
    states : array, shape (runs, states)
        Start values.
    fit : array of bool
        Mask of the valid runs; the others are simulated on their own, which raises the error that names what is wrong.
    """

    def __init__(
        self, sweep: SideBySide, parameters: Mapping[str, Floats], starts: Mapping[str, Floats], inputs: Mapping[str, Any],
        count: int,
    ) -> None:  # fmt: skip
        self.sweep, self.varied, self.count = sweep, (parameters, starts, inputs), count
        own = sweep.translation
        table = own.model.parameters
        numbers: dict[str, float | Floats] = {**sweep.parameters, **parameters}
        given = {table.index[name]: value for name, value in numbers.items()}
        self.parameters = table.evaluate_many(given, count)
        self.fit = ~out_of_bounds(table, self.parameters).any(axis=0) & own.variants.ordinary(self.parameters)
        if own.structure.redundant:
            self._each(np.flatnonzero(self.fit), self._confirm)
        self.signals = [self._signal({**sweep.inputs, **inputs}.get(name, 0.0)) for name in own.inputs]
        program = own.scene.program
        self.fit &= regular(program, self.parameters)
        self.solutions, solved = solutions_of_runs(program, self.parameters)
        self.fit &= solved
        self.states = self._starts()
        self.fit &= np.isfinite(self.states).all(axis=1)

    def _signal(self, value: Any) -> Any:
        """Values of an input, one per run."""
        times = self.sweep.grid
        if isinstance(value, Table):
            return (value.over(float(times[0]), float(times[-1])),) * self.count
        if isinstance(value, tuple):
            return unrolled(value, float(times[0]), float(times[-1]))
        return np.broadcast_to(np.asarray(value, float), self.count)

    @property
    def numbers(self) -> Floats:
        """The inputs of the scene's program, (inputs, runs): zero where they are tables."""
        given = np.zeros((len(self.sweep.translation.scene.program.inputs), self.count))
        for row, signal in zip(given, self.signals, strict=False):
            if not isinstance(signal, tuple):
                row[:] = signal
        return given

    def signals_of(self, i: int) -> tuple[Any, ...]:
        """The inputs of a run."""
        return tuple(s[i] if isinstance(s, tuple) else float(s[i]) for s in self.signals)

    def _each(self, runs: Any, action: Any) -> None:
        """Perform an action for each run; one that raises an error is marked unfit, and raises it again when simulated on its own."""
        for i in runs.tolist():
            try:
                action(i)
            except GearlibError:
                self.fit[i] = False

    def _confirm(self, i: int) -> None:
        structure = self.sweep.translation.structure
        confirm(structure, self.parameters[:, i])

    def _starts(self) -> Floats:
        sweep, scene = self.sweep, self.sweep.translation.scene
        states = np.full((self.count, len(scene.states)), np.nan)
        if not self.varied[1] and sweep.request.start is None:
            alike = starts_of_runs(scene, self.parameters)
            if alike is not None:
                return alike

        def one(i: int) -> None:
            states[i] = self.begin(i).states

        self._each(np.flatnonzero(self.fit), one)
        return states

    def begin(self, i: int) -> Start:
        """Consistent start values of a run."""
        sweep, own = self.sweep, self.sweep.translation
        return own.start(
            own.scene, self.parameters[:, i], float(sweep.grid[0]), self.start_of(i), list(self.signals_of(i)), True
        )

    def start_of(self, i: int) -> Any:
        """The ``start`` argument of a run."""
        starts = {name: float(column[i]) for name, column in self.varied[1].items()}
        return {**(self.sweep.request.start or {}), **starts} if starts else self.sweep.request.start

    def result(self, i: int, states: Floats, stats: Mapping[str, Any]) -> SimulatedResult:
        """The result of a run from its states at the samples."""
        sweep, own = self.sweep, self.sweep.translation
        scene, request, grid = own.scene, sweep.request, sweep.grid
        parameters, signals = self.parameters[:, i].copy(), self.signals_of(i)
        segment = Segment(
            scene, grid[sweep.hidden :], states, np.zeros((len(states), 0)), parameters, signals,
            start_guess(scene.model, parameters), float(grid[0]),
        )  # fmt: skip
        statistics = {**stats, "events": 0, "zero_inputs": request.zero_inputs}
        given = (*sweep.parameters, *self.varied[0])
        again = replace(request, parameters=parameters, given=given, signals=signals, start=self.start_of(i))
        return SimulatedResult([(segment, statistics, list)], own, again, run)
