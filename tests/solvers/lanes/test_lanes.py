"""Runs in lanes, against closed forms: every lane at its own pace, lanes that take the next run, runs that cannot go on."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.compiler.instructions import LANES
from gearlib.compiler.object_code import compiled
from gearlib.native.lane_functions import FUNCTIONS
from gearlib.solvers.lanes.lanes import LaneProblem, LaneRuns
from gearlib.solvers.problem import Floats

HEAD = "def rhs(time: lanes, x: lanes, dx: lanes, data: lanes) -> int32:\n"


def runs_of(lines: str, starts: Floats, numbers: Floats, times: Floats, rtol: float = 1e-8, **more: Any) -> LaneRuns:
    """Runs of x' = f, carried out to their end."""
    functions = "".join(text for name, text in FUNCTIONS.items() if f"{name}(" in lines)
    rhs = compiled(
        functions + HEAD + "".join(f"    {line}\n" for line in lines.split("\n")) + "    return 0\n", "rhs", fused=True
    )
    n = starts.shape[1]
    columns = more.pop("columns", np.arange(n))
    runs = LaneRuns(LaneProblem(rhs, starts, numbers, times, columns, np.full(n, rtol), rtol, **more))
    while runs.advance(50):
        pass
    return runs


def test_every_run_has_its_own_longest_step() -> None:
    """Of x' = 1 nothing else limits the steps, but a tenth of the run."""
    longest = np.array([0.1, 0.02, 5.0, 0.05] * 5)
    runs = runs_of("dx[0] = 1.0 + 0.0 * x[0]", np.zeros((20, 1)), np.zeros((20, 1)), np.array([0.0, 2.0]), longest_step=longest)
    assert runs.out[:, -1, 0] == pytest.approx(np.full(20, 2.0))
    least = np.ceil(2.0 / np.minimum(longest, 0.2))
    assert (runs.steps >= least).all()
    assert (runs.steps <= least + 8).all()  # the first ones grow


def test_every_lane_has_its_own_steps_and_takes_the_next_run() -> None:
    omega = np.geomspace(0.5, 400.0, 3 * LANES + 5)
    times = np.linspace(0.0, 2.0, 37)
    runs = runs_of(
        "dx[0] = x[1]\ndx[1] = data[1] - data[0] * data[0] * x[0]", np.array([[1.0, 0.0]] * len(omega)),
        np.column_stack([omega, np.zeros(len(omega))]), times,
    )  # fmt: skip
    assert (runs.status == 1).all()
    assert runs.done == len(omega)
    assert np.abs(runs.out[:, :, 0] - np.cos(np.outer(omega, times))).max() < 3e-6
    assert (np.diff(runs.steps[10:]) > 0).all()  # a faster run takes more steps, whatever its neighbours do
    assert (runs.rejected < 0.1 * runs.steps).all()
    assert runs.record.evaluations < 1.25 * 6 * runs.steps.sum() / LANES + 6 * runs.steps.max()


def test_time_driven_runs_keep_the_states_asked_for() -> None:
    a = np.array([[1.0], [2.0], [30.0]])
    times = np.array([5.0, 5.1, 6.0, 7.5])  # begins late
    runs = runs_of(
        "t = time[0]\ndx[0] = data[0] * cos(data[0] * t)\ndx[1] = sin(t) * x[1]", np.column_stack([np.sin(5.0 * a), [1.0, 2.0, 3.0]]),
        a, times, columns=np.array([1, 0]),
    )  # fmt: skip
    assert np.allclose(runs.out[:, :, 1], np.sin(a * times), atol=1e-6)
    growth = np.exp(np.cos(5.0) - np.cos(times))
    assert np.allclose(runs.out[:, :, 0], np.outer([1.0, 2.0, 3.0], growth), rtol=1e-6)


def test_a_run_that_goes_to_infinity_stops_alone() -> None:
    starts = np.array([[0.1], [3.0], [0.2], [np.inf], [0.3]])
    times = np.linspace(0.0, 1.0, 5)
    runs = runs_of("dx[0] = x[0] ** 2", starts, np.zeros((5, 1)), times)  # x = x0 / (1 - x0 t)
    assert runs.status.tolist() == [1, -1, 1, -1, 1]
    good = runs.status > 0
    assert np.allclose(runs.out[good, :, 0], starts[good] / (1.0 - starts[good] * times), rtol=1e-7)


def test_a_long_step_is_no_longer_than_allowed() -> None:
    runs = runs_of("dx[0] = data[0]", np.zeros((2, 1)), np.ones((2, 1)), np.array([0.0, 1.0]), longest_step=0.01)
    assert (runs.steps >= 100).all()
    assert np.allclose(runs.out[:, 1, 0], 1.0, rtol=1e-14)


def test_no_runs_are_done_at_once() -> None:
    assert not LaneRuns(
        LaneProblem(
            SimpleNamespace(address=0), np.empty((0, 1)), np.empty((0, 1)), np.array([0.0, 1.0]), np.arange(1), np.ones(1), 1e-6
        )
    ).advance()


@pytest.mark.parametrize("begin", [0.0, 40.0])
@pytest.mark.parametrize("each", [True, False])
def test_steps_end_at_the_corners_of_inputs(each: bool, begin: float) -> None:
    """Values that jump there, of each run or of all: x' = u(t) t is a sum of areas; some runs have fewer corners."""
    rng, n = np.random.default_rng(2), 2 * LANES + 3
    rows = n if each else 1
    corners = begin + np.sort(rng.uniform(0.1, 1.9, (rows, 3)), axis=1)
    corners[::2, 2], corners[3::5, 0] = np.inf, begin + 1.0 / 3.0
    corners.sort(axis=1)
    pieces = rng.normal(size=(rows, 4, 1)) * 10.0 ** rng.integers(-2, 3, (rows, 4, 1))
    times = begin + np.array([0.0, 0.2, 1.0 / 3.0, 0.9, 2.0])
    rate = rng.uniform(0.5, 2.0, n)
    runs = runs_of(
        "dx[0] = data[0] * data[1] * time[0]", np.zeros((n, 1)), np.column_stack([np.full(n, 7.0), rate]), times,
        corners=corners, pieces=pieces,
    )  # fmt: skip
    assert (runs.status == 1).all()
    for run in range(n):
        own, values = corners[run * each], pieces[run * each, :, 0]
        edges = np.concatenate([[begin], own])
        wanted = [
            sum(
                0.5 * u * max(min(b, t) ** 2 - a**2, 0.0)
                for u, a, b in zip(values, edges, [*own, np.inf], strict=True)
                if t > a
            )
            for t in times
        ]
        assert runs.out[run, :, 0] == pytest.approx(rate[run] * np.array(wanted), rel=1e-10, abs=1e-10)


def test_a_run_of_too_many_steps_fails_alone() -> None:
    omega = np.array([1.0, 300.0, 2.0])
    runs = runs_of(
        "dx[0] = data[0] * cos(data[0] * time[0])", np.zeros((3, 1)), omega[:, None], np.array([0.0, 2.0]), most_steps=200.0
    )
    assert runs.status.tolist() == [1, -1, 1]
    assert runs.steps[1] in (200, 201)
    assert (runs.steps[[0, 2]] < 200).all()
    assert np.allclose(runs.out[[0, 2], 1, 0], np.sin(2.0 * omega[[0, 2]]), atol=1e-6)


@pytest.mark.parametrize("begin", [0.0, 1.0, 40.0])
def test_numbers_of_runs_lie_one_behind_the_other(begin: float) -> None:
    """A vector of lanes for each state, stage, number and column, in whole cache lines; times count from a late start."""
    n, m, number = 3, 2, LANES + 1
    times = begin + np.array([0.0, 0.1, 4.0])
    rng = np.random.default_rng(4)
    starts, numbers = rng.normal(size=(number, n)), rng.normal(size=(number, m))
    corners, pieces = begin + np.arange(1.0, 3.0)[None].repeat(number, 0), rng.normal(size=(number, 3, 1))
    longest = np.linspace(0.1, 0.9, number)
    given = LaneProblem(
        SimpleNamespace(address=5), starts, numbers, times, np.array([2, 0]), np.full(n, 1e-3), 1e-4, longest, corners, pieces, 99.0
    )  # fmt: skip
    runs = LaneRuns(given)
    record, arrays = runs.record, runs._arrays
    sizes = {"x": n, "k": 7 * n, "y": n, "x_new": n, "data": m, "kept": 2}
    at = record.x
    assert at % 64 == 0
    for name, size in sizes.items():
        assert (getattr(record, name), arrays[name].size) == (at, LANES * size)
        at += 8 * LANES * size
    assert sorted(getattr(record, name) for name in ("t", "h", "stop", "steps", "run", "corner", "fresh"))[0] >= at
    origin = begin if begin == 40.0 else 0.0
    assert (record.origin, record.end) == (origin, begin + 4.0 - origin)
    assert arrays["times"].tolist() == (times - origin).tolist()
    assert arrays["corners"].tolist() == (corners - origin).tolist()
    assert arrays["longest"].tolist() == np.minimum(0.4, longest).tolist()
    assert arrays["x"].reshape(n, LANES).tolist() == starts[0][:, None].repeat(LANES, 1).tolist()
    assert arrays["data"].reshape(m, LANES).tolist() == numbers[0][:, None].repeat(LANES, 1).tolist()
    assert (record.rhs, record.n, record.n_numbers, record.n_times, record.n_columns) == (5, n, m, 3, 2)
    assert (record.n_corners, record.n_pieces, record.cornered, record.n_runs) == (2, 1, 1, number)
    assert (record.most_steps, record.rtol, runs.done) == (99.0, 1e-4, 0)
    assert runs.out.shape == (number, 3, 2)
    one = LaneRuns(LaneProblem(given.rhs, starts, numbers, times, np.arange(n), np.ones(n), 1e-4))
    assert (one.record.cornered, one.record.n_corners, one.record.n_pieces) == (0, 0, 0)
    assert one._arrays["longest"].tolist() == pytest.approx([0.4] * number)
