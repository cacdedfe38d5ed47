"""Simulations of a sweep in vector lanes: eligibility of a sweep, and integration of its prepared runs."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import shown
from gearlib.compiler.instructions import LANES
from gearlib.errors import ArgumentError, GearlibError
from gearlib.many_runs.side_by_side import Found, KeptStates, PreparedRuns, SideBySide, why_one_by_one
from gearlib.native.lane_source import LaneCode, lane_code, why_scalar
from gearlib.native.source import is_small
from gearlib.reduce.coefficients import start_guess
from gearlib.run.linear_form import LinearForms
from gearlib.run.methods.closed_form import REACH_OF_A_STEP
from gearlib.run.methods.run import LATE, Run, is_function
from gearlib.run.request import Request, absolute_tolerance
from gearlib.run.simulate import run
from gearlib.run.start_values import Start
from gearlib.run.translation import Translation
from gearlib.solvers.exponential.dense import balanced_norm
from gearlib.solvers.inputs.table import Table, breakpoints
from gearlib.solvers.lanes.lanes import LaneProblem, LaneRuns
from gearlib.solvers.taylor.taylor import Taylor

Floats = NDArray[np.float64]
ORDER5_FROM = 1e-6  # rtol from which "rk" takes the method of order 5, which is that of the lanes
MOST_CORNERS = 2000  # of a run's tables; they are copied for each run, some 32 kB per input at this limit
# Steps of a linear run up to which eight runs in lanes take less time than eight exponentials, one after another; and the limit for the
# steps of a run: PATIENCE times those expected from the first run, and LEAST_STEPS more
MOST_OF_LINEAR, PATIENCE, LEAST_STEPS = 3000.0, 20.0, 1000.0


def check_lanes(lanes: object) -> None:
    """Raise `ArgumentError` for an invalid number of lanes."""
    number = isinstance(lanes, int | np.integer) and not isinstance(lanes, bool)
    if not (number and lanes in (1, LANES)) and not (isinstance(lanes, str) and lanes == "auto"):
        raise ArgumentError(f"lanes is {shown(lanes)}; expected 'auto', 1 or {LANES}")


def why_not_in_lanes(translation: Translation, request: Request) -> str | None:
    """Reason why runs cannot be integrated in lanes, or None; the values of each run are checked later."""
    scene, method = translation.scene, str(request.method)
    if not (method == "rk5" or (method in ("rk", "auto") and request.rtol >= ORDER5_FROM)):
        return f"the method is {method}; lanes are Runge-Kutta of order 5: method='rk5'"
    if reason := why_one_by_one(translation, request) or why_scalar(scene.program):
        return reason
    if not is_small(scene.program):
        return "the model is large"
    span = float(request.times[-1]) - request.t_start
    if max(abs(request.t_start), abs(float(request.times[-1]))) >= LATE * span:
        return "the runs begin late"
    if any(is_function(signal) for signal in request.signals):
        return "inputs are functions of time"
    if any(isinstance(s, Table) and not s.straight for s in request.signals):
        return "an input is a table of cubics"
    return None


def most_steps(sweep: SideBySide) -> float | str:
    """Limit for the steps of a run, beyond which it counts as stiff and is left to ``"auto"``; or the reason not to use lanes at all.

    With ``method="auto"`` the first run, whose numbers the request holds, decides for the whole sweep.
    """
    request = sweep.request
    if str(request.method) != "auto":
        return float("inf")
    forms = sweep.linear
    if isinstance(forms, LinearForms):
        span = request.times[-1] - request.t_start
        steps = len(breakpoints(request.signals)) + balanced_norm(forms.matrix) * span / REACH_OF_A_STEP
        if steps > MOST_OF_LINEAR:
            return f"the scene is linear: exponentials are faster than some {steps:.0f} steps"
        return PATIENCE * float(steps) + LEAST_STEPS
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            stats = run(sweep.translation, request).stats
            if stats.get("legs") != 1:
                return "stability limits the steps of the first run"
            if stats["method"] == Taylor.name:  # its steps are other ones
                stats = run(sweep.translation, replace(request, method="rk5")).stats
    except GearlibError as problem:
        return f"the first run fails: {problem}"
    return PATIENCE * float(stats["steps"]) + LEAST_STEPS


@dataclass(frozen=True, eq=False)
class LaneSweep(SideBySide):
    """Simulations in lanes, by Runge-Kutta of order 5.

    Attributes
    ----------
    most_steps : float
        Limit for the steps of a run.
    """

    most_steps: float = float("inf")

    @property
    def statistics(self) -> Mapping[str, Any]:
        return {"lanes": LANES}

    def code(self, tables: tuple[int, ...]) -> LaneCode:
        """The right-hand side where some inputs are tables."""
        scene, key = self.translation.scene, f"lanes {tables}"
        if key not in scene.forms:
            scene.forms[key] = lane_code(scene.program, len(scene.model.parameters.names), tables)
        code: LaneCode = scene.forms[key]
        return code

    def runs_of(self, prepared: PreparedRuns) -> Iterator[Found]:
        scene, request = self.translation.scene, self.request
        tables = tuple(k for k, s in enumerate(prepared.signals) if isinstance(s, tuple))
        code = self.code(tables)
        data = code.numbers(prepared.parameters, prepared.numbers, prepared.solutions)
        good = prepared.fit & np.isfinite(data).all(axis=1) & straight(prepared, tables)
        yield from ((i, None) for i in np.flatnonzero(prepared.fit & ~good).tolist())
        fitting = np.flatnonzero(good)
        if not len(fitting):
            return
        absolute = absolute_tolerance(request.atol, len(scene.states))
        first = int(fitting[0])
        numbers = scene.prepared(prepared.parameters[:, first].copy())
        begin = Start(prepared.states[first], start_guess(scene.model, numbers.parameters), ())
        like = Run(scene, numbers, begin, prepared.signals_of(first), self.grid, request.rtol, absolute, None, request.max_step)
        longest: float | Floats = like.longest_step
        if scene.fastest_drive.varying:
            longest = np.array([like.longest_step_with(one) for one in prepared.parameters.T[fitting]])
        problem = LaneProblem(
            code.function, prepared.states[fitting], data[fitting], self.sampled, self.columns,
            request.rtol * scene.nominal if absolute is None else absolute, request.rtol, longest,
            *pieces_of([prepared.signals[k] for k in tables], fitting, self.grid), self.most_steps,
        )  # fmt: skip
        runs = LaneRuns(problem)
        reported = np.zeros(len(fitting), bool)
        more, why = True, "asked for" if str(request.method) != "auto" else "neither events nor stiffness"
        while more:
            more = runs.advance()
            new = np.flatnonzero((runs.status != 0) & ~reported)
            reported[new] = True
            ended = (runs.status[new] > 0) & np.isfinite(runs.out[new]).all(axis=(1, 2))
            yield from ((int(i), None) for i in fitting[new[~ended]])
            new = new[ended]
            if not self.whole:
                yield KeptStates(fitting[new], runs.out[new, self.hidden :])
                continue
            for k in new.tolist():
                stats = {
                    "method": "rk5", "why": f"{why}; {LANES} runs side by side", "states": len(scene.states), "order": 5,
                    "steps": int(runs.steps[k] - runs.rejected[k]), "rejected": int(runs.rejected[k]),
                    "rhs": 6 * int(runs.steps[k]) + 2,
                }  # fmt: skip
                yield int(fitting[k]), prepared.result(int(fitting[k]), runs.out[k, self.hidden :].copy(), stats)


def straight(prepared: PreparedRuns, tables: Sequence[int]) -> NDArray[np.bool_]:
    """Mask of the runs whose tables are piecewise linear, with at most `MOST_CORNERS` points."""
    good = np.ones(prepared.count, bool)
    for k in tables:
        for signal in set(prepared.signals[k]):
            if isinstance(signal, Table) and (not signal.straight or len(signal.t) > MOST_CORNERS):
                good &= np.array([s is not signal for s in prepared.signals[k]])
    return good


def pieces_of(signals: Sequence[Sequence[Any]], runs: NDArray[np.int64], grid: Floats) -> tuple[Floats, Floats]:
    """Corners and pieces of inputs for `LaneProblem`; a single row if they are the same in all runs."""
    alike = all(len(set(signal)) == 1 for signal in signals)
    rows = [row([signal[i] for signal in signals], grid) for i in (runs[:1] if alike else runs).tolist()]
    most = max(len(corners) for corners, _ in rows)
    corners, pieces = np.full((len(rows), most), np.inf), np.zeros((len(rows), most + 1, 2 * len(signals)))
    for i, (times, lines) in enumerate(rows):
        corners[i, : len(times)] = times
        pieces[i, : len(lines)], pieces[i, len(lines) :] = lines, lines[-1]
    return corners, pieces


def row(signals: Sequence[Any], grid: Floats) -> tuple[Floats, Floats]:
    """The corners of a run's inputs; and for each interval between them the values at time zero and the slopes."""
    begin, end = float(grid[0]), float(grid[-1])
    inner = np.unique(np.concatenate([np.empty(0), *(s.t for s in signals if isinstance(s, Table))]))
    inner = inner[(inner > begin) & (inner < end)]
    starts = np.concatenate([[begin], inner])
    lines = np.zeros((len(starts), 2 * len(signals)))
    for j, signal in enumerate(signals):
        if isinstance(signal, Table):
            values, slopes = signal.lines(starts, 0.5 * np.diff(starts, append=end))
            lines[:, 2 * j], lines[:, 2 * j + 1] = values - slopes * starts, slopes
        else:
            lines[:, 2 * j] = signal
    return inner, lines
