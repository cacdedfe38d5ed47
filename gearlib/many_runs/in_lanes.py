"""Simulations of a sweep side by side in lanes: which sweeps are carried out so, and what prepares all runs together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import shown
from gearlib.compiler.instructions import LANES
from gearlib.errors import ArgumentError, GearlibError
from gearlib.flatten.flatten import out_of_bounds
from gearlib.native.lane_source import LaneCode, lack, lane_code
from gearlib.native.source import is_small
from gearlib.program.interpret import regular, solutions_of_runs
from gearlib.reduce.coefficients import coefficients_of, start_guess
from gearlib.reduce.reduction import confirm
from gearlib.run.methods.run import LATE, Run
from gearlib.run.request import Request, absolute_tolerance
from gearlib.run.result import Result, SimulatedResult
from gearlib.run.segment import Segment
from gearlib.run.simulate import run
from gearlib.run.start_values import Start, starts_of_runs
from gearlib.run.translation import Translation
from gearlib.solvers.lanes.lanes import LaneProblem, LaneRuns

Floats = NDArray[np.float64]
AT_ONCE = 512  # runs that are prepared together, and
MOST_NUMBERS = 4_000_000  # samples of states that they may have
ORDER5_FROM = 1e-6  # rtol from which "rk" takes the method of order 5, which is that of the lanes


def check_lanes(lanes: object) -> None:
    """Raise `ArgumentError` for another number of lanes than there is."""
    if isinstance(lanes, bool) or lanes not in ("auto", 1, LANES):
        raise ArgumentError(f"lanes is {shown(lanes)}; expected 'auto', 1 or {LANES}")


def lacks(translation: Translation, asked: Request) -> str | None:
    """Why runs cannot be carried out in lanes, or None; what varies from run to run is looked at later."""
    scene, method = translation.scene, str(asked.method)
    if not (method == "rk5" or (method == "rk" and asked.rtol >= ORDER5_FROM)):
        return f"the method is {method}; lanes are Runge-Kutta of order 5: method='rk5'"
    if isinstance(asked.start, Result) or (isinstance(asked.start, tuple) and isinstance(asked.start[0], Result)):
        return "the runs go on from another one"
    if translation.put_in or translation.controllers or translation.structure.switching:
        return "the model has sampled controllers, or equations that other parameters change"
    if not scene.states or scene.n_modes:
        return "there are events" if scene.n_modes else "there are no states"
    if scene.model.bounded:
        return "variables have least values that are to be watched"
    if reason := lack(scene.program):
        return reason
    if not is_small(scene.program):
        return "the model is large"
    span = float(asked.times[-1]) - asked.t_start
    if max(abs(asked.t_start), abs(float(asked.times[-1]))) >= LATE * span:
        return "the runs begin late"
    if any(callable(signal) for signal in asked.signals):
        return "inputs are tables or functions of time"
    return None


@dataclass(frozen=True, eq=False)
class LaneSweep:
    """Simulations of a translation in lanes.

    Attributes
    ----------
    translation : Translation
    asked : Request
        Of a run in which nothing varies.
    parameters, inputs : mapping of str to float
        What is given for all runs, by path.
    whole : bool
        Whether the results are wanted; else the states in ``kept`` suffice.
    kept : tuple of int
    """

    translation: Translation
    asked: Request
    parameters: Mapping[str, float]
    inputs: Mapping[str, Any]
    whole: bool
    kept: tuple[int, ...]

    def column(self, name: str) -> int:
        """Where an output that is a state stands among those that are kept."""
        place = self.translation.scene.place_of.get(self.translation.scene.named(name)[0], -1)
        return self.kept.index(place) if place in self.kept else -1

    @cached_property
    def grid(self) -> Floats:
        """The times, s, of which the first is the start."""
        times, t_start = self.asked.times, self.asked.t_start
        return times if times[0] == t_start else np.concatenate([[t_start], times])

    @cached_property
    def code(self) -> LaneCode:
        scene = self.translation.scene
        if "lanes" not in scene.forms:
            scene.forms["lanes"] = lane_code(scene.program, len(scene.model.parameters.names))
        code: LaneCode = scene.forms["lanes"]
        return code

    def carried_out(
        self, parameters: Mapping[str, Floats], starts: Mapping[str, Floats], inputs: Mapping[str, Floats], count: int
    ) -> Iterator[tuple[int, Floats | SimulatedResult | None]]:
        """Each run's number, and the kept states at the times asked for, (samples, kept), or its result; in the order in which they end.

        None stands for a run that cannot be done in a lane, or failed there.
        """
        width = len(self.grid) * (len(self.translation.states) if self.whole else len(self.kept))
        size = max(LANES, min(AT_ONCE, MOST_NUMBERS // max(width, 1)))
        for first in range(0, count, size):
            here = slice(first, min(first + size, count))
            varied = [{name: column[here] for name, column in given.items()} for given in (parameters, starts, inputs)]
            block = _Block(self, varied[0], varied[1], varied[2], here.stop - first)
            yield from ((first + i, found) for i, found in block.carried_out())


class _Block:
    """Runs that are prepared together."""

    def __init__(
        self, sweep: LaneSweep, parameters: Mapping[str, Floats], starts: Mapping[str, Floats], inputs: Mapping[str, Floats],
        count: int,
    ) -> None:  # fmt: skip
        self.sweep, self.varied, self.count = sweep, (parameters, starts, inputs), count
        own = sweep.translation
        table = own.model.parameters
        numbers: dict[str, float | Floats] = {**sweep.parameters, **parameters}
        given = {table.index[name]: value for name, value in numbers.items()}
        self.parameters = table.evaluate_many(given, count)  # (parameters, runs)
        self.fit = ~out_of_bounds(table, self.parameters).any(axis=0) & own.variants.ordinary(self.parameters)
        if own.structure.redundant:
            self._each(np.flatnonzero(self.fit), self._confirm)
        names, told = own.inputs, {**sweep.inputs, **inputs}
        self.inputs = np.array([np.broadcast_to(told.get(name, 0.0), count) for name in names]).reshape(len(names), count)
        program = own.scene.program
        self.fit &= regular(program, self.parameters)
        solutions, solved = solutions_of_runs(program, self.parameters)
        self.fit &= solved
        padded = np.zeros((len(program.inputs), count))
        padded[: len(names)] = self.inputs[: len(program.inputs)]
        self.numbers = sweep.code.numbers(self.parameters, padded, solutions)
        self.guess: list[Floats] = []
        self.states = self._starts()
        self.fit &= np.isfinite(self.numbers).all(axis=1) & np.isfinite(self.states).all(axis=1)

    def _each(self, runs: Any, action: Any) -> None:
        """Do something with each run; one that raises an error is done by itself, which raises it again."""
        for i in runs.tolist():
            try:
                action(i)
            except GearlibError:
                self.fit[i] = False

    def _confirm(self, i: int) -> None:
        structure = self.sweep.translation.structure
        confirm(structure, coefficients_of(structure.complete, self.parameters[:, i], 0.0))

    def _starts(self) -> Floats:
        """Start values of the states, (runs, states)."""
        sweep, scene = self.sweep, self.sweep.translation.scene
        states = np.empty((self.count, len(scene.states)))
        if not self.varied[1] and sweep.asked.start is None:
            alike = starts_of_runs(scene, self.parameters)
            if alike is not None:
                return alike

        def one(i: int) -> None:
            begin = self.begin(i)
            states[i] = begin.states

        states[:] = np.nan
        self._each(np.flatnonzero(self.fit), one)
        return states

    def begin(self, i: int) -> Start:
        """The start of a run."""
        sweep, own = self.sweep, self.sweep.translation
        return own.start(
            own.scene, self.parameters[:, i], float(sweep.grid[0]), self._start_of(i), self.inputs[:, i].tolist(), True
        )

    def _start_of(self, i: int) -> Any:
        starts = {name: float(column[i]) for name, column in self.varied[1].items()}
        return {**(self.sweep.asked.start or {}), **starts} if starts else self.sweep.asked.start

    def carried_out(self) -> Iterator[tuple[int, Any]]:
        fitting = np.flatnonzero(self.fit)
        yield from ((i, None) for i in np.flatnonzero(~self.fit).tolist())
        if not len(fitting):
            return
        sweep, scene, asked = self.sweep, self.sweep.translation.scene, self.sweep.asked
        absolute = absolute_tolerance(asked.atol, len(scene.states))
        first = int(fitting[0])
        numbers = scene.prepared(self.parameters[:, first].copy())
        begin = Start(self.states[first], start_guess(scene.model, numbers.parameters), ())
        like = Run(scene, numbers, begin, tuple(self.inputs[:, first]), sweep.grid, asked.rtol, absolute, None, asked.max_step)
        columns = np.arange(len(scene.states)) if sweep.whole else np.array(sweep.kept, np.int64)
        problem = LaneProblem(
            sweep.code.function, self.states[fitting], self.numbers[fitting], sweep.grid, columns,
            asked.rtol * scene.nominal if absolute is None else absolute, asked.rtol, like.longest_step,
        )  # fmt: skip
        runs = LaneRuns(problem)
        told = np.zeros(len(fitting), bool)
        more = True
        hidden = len(sweep.grid) - len(asked.times)
        while more:
            more = runs.advance()
            for k in np.flatnonzero((runs.status != 0) & ~told).tolist():
                told[k] = True
                i, good = int(fitting[k]), runs.status[k] > 0 and np.isfinite(runs.out[k]).all()
                yield i, (self._result(i, runs, k) if sweep.whole else runs.out[k, hidden:]) if good else None

    def _result(self, i: int, runs: LaneRuns, k: int) -> SimulatedResult:
        """The result of a run."""
        sweep, own = self.sweep, self.sweep.translation
        scene, asked, grid = own.scene, sweep.asked, sweep.grid
        hidden = len(grid) - len(asked.times)
        parameters, signals = self.parameters[:, i].copy(), tuple(self.inputs[:, i].tolist())
        states = runs.out[k, hidden:].copy()
        segment = Segment(
            scene, grid[hidden:], states, np.zeros((len(states), 0)), parameters, signals, start_guess(scene.model, parameters),
            float(grid[0]),
        )  # fmt: skip
        stats = {
            "method": "rk5", "why": f"asked for; {LANES} runs side by side", "states": len(scene.states), "order": 5,
            "steps": int(runs.steps[k] - runs.rejected[k]), "rejected": int(runs.rejected[k]), "rhs": 6 * int(runs.steps[k]) + 2,
            "events": 0, "zero_inputs": asked.zero_inputs,
        }  # fmt: skip
        again = replace(asked, parameters=parameters, signals=signals, start=self._start_of(i))
        return SimulatedResult([(segment, stats, ())], own, again, run)
