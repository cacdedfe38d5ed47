"""The loop of runs in lanes against the same runs one by one: Tsitouras' method with its step control, written out for vectors."""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.compiler.instructions import LANES
from gearlib.solvers.lanes.lane_loop import GENERATED
from gearlib.solvers.lanes.lanes import LaneProblem, LaneRuns
from gearlib.solvers.problem import Floats
from gearlib.solvers.rungekutta.first_step import DAMPED, NEAR5
from gearlib.solvers.rungekutta.tableaux import TSIT5_A, TSIT5_C, TSIT5_E, TSIT5_R
from tests.solvers.rungekutta.test_first_step import RIGHT, by_hand

Rates = Callable[[Any, Any, Any], Sequence[Any]]  # of time, states and numbers, of one run or of several side by side
Times = Sequence[float]


@dataclass
class Scene:
    """Runs of x' = f."""

    f: Rates
    starts: Any
    numbers: Any
    times: Times
    rtol: float = 1e-5
    atol: Any = 1e-5
    longest: float = math.inf
    most_steps: float = math.inf
    corners: Any = field(default_factory=lambda: np.empty((1, 0)))
    pieces: Any = field(default_factory=lambda: np.empty((1, 1, 0)))
    columns: tuple[int, ...] = (0, 1)

    def one(self, array: Any, run: int) -> Any:
        """The row of a run, or that of all."""
        return array[run if len(array) > 1 else 0]


@dataclass
class Found:
    """What became of a run; ``went`` holds the time and the next step after each step that was tried."""

    samples: list[Floats]
    went: list[tuple[float, float]] = field(default_factory=list)
    rejected: int = 0
    careful: int = 0  # steps with an error that counts as more
    status: int = 0


def alone(scene: Scene, run: int) -> Found:
    """One run; times count from its start."""
    numbers, x = np.array(scene.numbers[run], dtype=float), np.array(scene.starts[run], dtype=float)
    begin, times = scene.times[0], [t - scene.times[0] for t in scene.times]
    corners = [*(c - begin for c in scene.one(scene.corners, run)), math.inf]
    longest, atol, rtol = min(0.1 * times[-1], scene.longest), scene.atol, scene.rtol

    def f(t: float, x: Floats) -> Floats:
        return np.array([*scene.f(begin + t, x, numbers)], dtype=float)

    def turn(corner: int) -> float:
        pieces = scene.one(scene.pieces, run)[corner]
        numbers[: len(pieces)] = pieces
        return min(times[-1], corners[corner])

    found, corner, stop = Found([x]), 0, turn(0)
    t, h, before, retry = 0.0, by_hand(f, x, 5, longest, rtol, atol), 1.0, False
    k = np.zeros((7, len(x)))
    k[0] = f(t, x)
    while found.status == 0:
        wanted = h = min(h, longest)
        failed, last = h < 8.9e-15 * t + 1e-25 * times[-1] or len(found.went) >= scene.most_steps, t + 1.0001 * h >= stop
        if last:
            h = stop - t
        y = [x]
        for stage in range(1, 7):
            y.append(x + h * (np.array(TSIT5_A[stage]) @ k[:stage]))
            k[stage] = f(t + TSIT5_C[stage] * h, y[stage])
        weight = 1.0 / (atol + rtol * np.maximum(abs(x), abs(y[6])))
        error = h * math.sqrt(np.mean((weight * (np.array(TSIT5_E) @ k)) ** 2))
        slope, move = weight * h * (k[6] - k[5]), weight * (y[6] - y[5])
        near, lengths = NEAR5**2 * (move @ move), math.sqrt(slope @ slope * (move @ move))
        share = 1.0 if slope @ move < -DAMPED * lengths or not slope @ slope > near else slope @ slope / near
        found.careful += share > 1.0
        careful = max(error * min(share**2, 12.0), 1e-10)
        t_new = stop if last else t + h
        if error <= 1.0:
            growth = min(max(0.9 * before ** (1 / 16) * careful ** (-1 / 8), 0.2), 1.0 if retry else 10.0)
            before, retry = max(careful, 1e-4), False
            while len(found.samples) < len(times) and times[len(found.samples)] <= t_new:
                theta = (times[len(found.samples)] - t) / h
                found.samples.append(x + h * (np.array(TSIT5_R) @ theta ** np.arange(1, 5)) @ k)
            t, x, k[0], h = t_new, np.where(abs(y[6]) > 1e-250, y[6], 0.0), k[6], h * growth
            if last and t == times[-1]:
                found.status = 1
            elif last:
                corner += 1
                stop, h = turn(corner), max(h, wanted)
                k[0] = f(t, x)
        else:
            retry = True
            h *= max(0.9 * error**-0.25, 0.2) if error < math.inf else 0.25
            found.rejected += 1
        if failed and found.status == 0:
            found.status = -1
        found.went.append((t, h))
    return found


def side_by_side(scene: Scene) -> tuple[LaneRuns, list[list[tuple[float, float]]]]:
    """The runs in lanes, and where each of them went, step by step."""
    n, m = np.shape(scene.starts)[1], np.shape(scene.numbers)[1]
    calls = []

    def rhs(time: Any, x: Any, dx: Any, data: Any) -> int:
        t, states, rates, numbers = (
            np.ctypeslib.as_array(at, (rows, LANES)) for at, rows in ((time, 1), (x, n), (dx, n), (data, m))
        )
        with np.errstate(all="ignore"):  # of lanes whose results are ignored, too
            rates[:] = scene.f(t[0], states, numbers)
        calls.append(t)
        return 0

    wrapped = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.POINTER(ctypes.c_double)] * 4)(rhs)
    starts, numbers, times = (np.array(a, dtype=float) for a in (scene.starts, scene.numbers, scene.times))
    runs = LaneRuns(
        LaneProblem(
            SimpleNamespace(address=ctypes.cast(wrapped, ctypes.c_void_p).value), starts, numbers, times, np.array(scene.columns),
            np.full(n, 1.0) * scene.atol, scene.rtol, scene.longest, scene.corners, scene.pieces, scene.most_steps,
        )
    )  # fmt: skip
    record, went = runs.record, [list[tuple[float, float]]() for _ in starts]

    def lanes(field: str, kind: Any = ctypes.c_double) -> list[Any]:
        return [*(kind * LANES).from_address(getattr(record, field))]

    for _ in range(2000):
        more = runs.advance(1)
        assert runs.done == np.count_nonzero(runs.status)
        assert more == (runs.done < len(starts))
        if not more:
            break
        for run, active, *after in zip(lanes("run", ctypes.c_int64), *map(lanes, ("active", "steps", "t", "h")), strict=True):
            if active and after[0] > 0:
                went[run].append((after[1] + record.origin - scene.times[0], after[2]))
                assert after[0] == len(went[run])
    assert record.evaluations == len(calls)
    assert not runs.advance()
    return runs, went


def check(scene: Scene, rel: float = 1e-5) -> list[Found]:
    """The runs in lanes go as each of them does alone."""
    with np.errstate(all="ignore"):
        expected = [alone(scene, run) for run in range(len(scene.starts))]
    runs, went = side_by_side(scene)
    assert runs.status.tolist() == [one.status for one in expected]
    assert runs.steps.tolist() == [len(one.went) for one in expected]
    assert runs.rejected.tolist() == [one.rejected for one in expected]
    for run, one in enumerate(expected):
        ways = np.reshape(one.went[:-1], (-1, 2))  # after the last step the lane has taken the next run
        assert np.reshape(went[run], (-1, 2)) == pytest.approx(
            ways, rel=rel, abs=1e-10, nan_ok=True
        )  # at a pole, rounding decides
        samples = np.array(one.samples)[:, scene.columns]
        assert runs.out[run, : len(samples)] == pytest.approx(samples, rel=rel, abs=1e-9)
    return expected


def vibration(t: Any, x: Any, p: Any) -> Sequence[Any]:
    """About a slow motion that drives it."""
    return [x[1], -(p[0] ** 2) * (x[0] - p[1] * np.cos(t))]


@pytest.mark.parametrize("number", [1, LANES, 2 * LANES + 3])
def test_any_number_of_runs_has_its_own_steps(number: int) -> None:
    """Whatever the lanes beside it do; the quicker ones take more of them."""
    rates = np.geomspace(0.5, 20.0, number)[::-1]
    found = check(Scene(vibration, [[1.0, 0.1]] * number, [[rate, 0.0] for rate in rates], np.linspace(0.0, 2.0, 5)))
    taken = [len(one.went) for one in found]
    assert taken == sorted(taken, reverse=True)


KINDS: dict[str, tuple[Rates, list[float], Sequence[float]]] = {
    "pulses": (lambda t, x, p: [np.exp(-p[0] * (t - 1.0) ** 2), x[0] - x[1]], [0.0, 1.0], np.geomspace(1.0, 1e3, 4)),
    "relaxation": (lambda t, x, p: [x[1], p[0] * (1.0 - x[0] ** 2) * x[1] - x[0]], [2.0, 0.0], [1.0, 4.0, 20.0]),
    "decay": (lambda t, x, p: [-p[0] * (x[0] - np.cos(t)), -x[1]], [2.0, 0.0], [1.0, 40.0, 80.0]),
    "vibration": (lambda t, x, p: [x[1], -(p[0] ** 2) * (x[0] - np.cos(t))], [1.0, 0.0], [5.0, 20.0, 50.0]),
    "rest": (lambda t, x, p: [p[0] * x[0], p[0] * x[1]], [0.0, 0.0], [1.0, 2.0]),
    "jump": (lambda t, x, p: [p[0] * (t > 0.7), p[0] - x[1]], [0.0, 0.0], [1e-3, 20.0]),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("rtol", [1e-3, 1e-5])
def test_steps_are_controlled_as_in_a_run_alone(kind: str, rtol: float) -> None:
    """By errors, by the limit of stability, and more carefully after a step that was rejected."""
    f, start, rates = KINDS[kind]
    scene = Scene(f, [start] * len(rates), [[r] for r in rates], np.linspace(0.0, 2.0, 9), rtol, rtol * np.array([1.0, 10.0]))
    found = check(scene)
    assert any(one.rejected for one in found) or kind not in ("decay", "jump")
    assert any(one.careful for one in found) or kind != "vibration"


@pytest.mark.parametrize("kind", RIGHT)
def test_the_first_step_is_hairers(kind: str) -> None:
    """Also beside the limits from which a run counts as at rest, or as from zero."""
    f, start = RIGHT[kind]
    each: Rates = lambda t, x, p: f(t, x) if np.ndim(t) == 0 else np.stack([*map(f, t, x.T)], axis=1)  # noqa: E731
    scene = Scene(each, [start], [[0.0]], [0.0, 20.0], most_steps=2.0)
    _, ((after, *_),) = side_by_side(scene)
    with np.errstate(all="ignore"):
        assert after == pytest.approx(alone(scene, 0).went[0], rel=1e-9)


@pytest.mark.parametrize("begin", [0.0, 1.0, -50.0])
@pytest.mark.parametrize("each", [True, False])
def test_at_corners_numbers_change_and_the_step_goes_on(begin: float, each: bool) -> None:
    """Steps end there, of each run or of all at once; with the states of three runs, and of one that has fewer corners."""
    corners = begin + np.array([[0.25, 0.7, 1.5], [0.7, 0.71, 2.0], [1.1, math.inf, math.inf], [0.5, 0.5, 3.0]])
    pieces = np.array([[[1.0, 0.0], [-1.0, 2.0], [30.0, 1.0], [0.0, 0.0]]] * 4) * np.arange(1.0, 5.0)[:, None, None]
    if not each:
        corners, pieces = corners[:1], pieces[:1]
    scene = Scene(
        lambda t, x, p: [p[0] - x[0], p[1] * np.cos(p[2] * t), x[0] * x[1]], [[0.0, 1.0, 0.1 * run] for run in range(4)],
        [[9.0, 9.0, 1.0 + run] for run in range(4)], begin + np.array([0.0, 0.0, 0.25, 0.3, 0.6, 0.7, 2.0]), 1e-4, 1e-4,
        corners=corners, pieces=pieces, columns=(2, 0, 2),
    )  # fmt: skip
    check(scene)


@pytest.mark.parametrize("longest", [math.inf, 0.03])
def test_no_step_is_longer_than_allowed(longest: float) -> None:
    """The tenth part of the run, or less; beyond a corner as before it."""
    scene = Scene(
        lambda t, x, p: [p[0] + 0.0 * x[0]], [[0.0]], [[1.0]], [0.0, 1.0], longest=longest, columns=(0,),
        corners=np.array([[0.405]]), pieces=np.array([[[1.0], [2.0]]]),
    )  # fmt: skip
    (found,) = check(scene)
    assert np.diff([0.0, *(t for t, _ in found.went)]).max() == pytest.approx(min(longest, 0.1))


def test_runs_that_cannot_go_on_fail_alone() -> None:
    """At a pole, at the edge of what can be evaluated, from a start that is not finite, and after too many steps; others follow them."""
    starts, numbers = [[1.0, 0.0], [0.1, 0.0], [np.inf, 1.0], [0.1, 0.0]], [[9.0, 1.0], [0.5, 1.0], [9.0, 1.0], [9.0, 30.0]]
    later = [[0.1 + 0.002 * i, 0.3] for i in range(4 * LANES)]
    scene = Scene(
        lambda t, x, p: [np.sqrt(p[0] - t) + x[0] ** 2, p[1] * x[0]], starts + later, numbers + [[9.0, 1.0]] * 4 * LANES,
        [0.0, 0.1, 0.2, 0.7], most_steps=70.0,
    )  # fmt: skip
    assert [one.status for one in check(scene, 1e-3)[:4]] == [-1, -1, -1, 1]


@pytest.mark.parametrize("most", [10.0, 11.0, 12.0])
def test_a_run_may_take_so_many_steps_and_one_to_its_end(most: float) -> None:
    scene = Scene(lambda t, x, p: [p[0] - x[0], -x[0]], [[1.0, 2.0]] * 2, [[1.0], [1.1]], [0.0, 1.0], most_steps=most)
    check(scene)


def test_a_single_sample_is_the_start() -> None:
    for begin in (0.0, 3.0):
        runs, _ = side_by_side(Scene(vibration, [[1.0, 2.0]] * 3, [[1.0, 0.0]] * 3, [begin]))
        assert runs.out.tolist() == [[[1.0, 2.0]]] * 3
        assert runs.status.tolist() == [1, 1, 1]


def test_what_is_as_small_as_nothing_becomes_zero() -> None:
    """Numbers so small are slow: what decays to 1e-250 is at rest from then on, and what it moves, too."""
    scene = Scene(lambda t, x, p: [-x[0], p[0] * x[0]], [[1e-249, 0.0], [-1e-249, 0.0]], [[1e249]] * 2, [0.0, 4.0, 6.0, 9.0])
    found = check(scene)
    assert [abs(one.samples[-1][1]) for one in found] == pytest.approx([0.95, 0.95], abs=0.05)
    assert [one.samples[-1][1] for one in found] == pytest.approx([one.samples[-2][1] for one in found], rel=1e-9)


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.0])
def test_weights_between_two_steps_are_polynomials_that_end_at_those_of_the_step(theta: float) -> None:
    """The coefficients stand in the order of their powers, from the first on."""
    texts = re.findall(r"^ +b(\d) = (.*)$", GENERATED, re.MULTILINE)
    assert [int(j) for j, _ in texts] == list(range(7))
    weights = [eval(text, {"theta": theta, "h": 2.0}) for _, text in texts]
    assert weights == pytest.approx([2.0 * sum(r * theta ** (k + 1) for k, r in enumerate(row)) for row in TSIT5_R], abs=1e-13)
    if theta == 1.0:
        assert weights == pytest.approx([2.0 * a for a in (*TSIT5_A[6], 0.0)[:7]], abs=1e-12)
