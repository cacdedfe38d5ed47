"""Methods written in Python with a step formula alone: dense output, events and counts, on cubics, for which both are exact."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gearlib.errors import SolverError
from gearlib.solvers.drive.driver import Driver, integrate
from gearlib.solvers.drive.explicit_stepper import ExplicitStepper
from gearlib.solvers.problem import Floats
from tests.run.python_problem import driver, problem


class Cubic(ExplicitStepper):
    """Steps of 0.3 s along x = t^3 + a constant, and x = t."""

    short = 0.0  # share by which the last step ends before the stop, as rounding may have it

    def advance(self, t: float, x: Floats, stop: float) -> tuple[float, Floats]:
        end = t + 0.3 if t + 0.3 < stop else stop * (1.0 - self.short)
        return end, x + [end**3 - t**3, end - t]


def run_of(roots: Callable[[float, Any], list[float]] | None = None, n_roots: int = 0, x0: float = 0.0, **more: Any) -> Driver:
    """From zero to 1 s; ``roots``: event functions of time and states."""

    def rates(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = 3.0 * t**2, 1.0

    def values(t: float, x: Any, g: Any, data: Any) -> None:
        for k, value in enumerate(roots(t, x) if roots else []):
            g[k] = value

    own = {"roots": values, "n_roots": n_roots} if roots else {}
    times = more.pop("times", np.linspace(0.0, 1.0, 11))
    return driver(problem(more.pop("rhs", rates), [x0, 0.0], **own, **more), times, Cubic())


def test_samples_lie_on_the_cubic_of_values_and_slopes() -> None:
    run = run_of(rhs_cost=7.0, x0=2.0)
    found = integrate(run)
    assert found.x[:, 0] == pytest.approx(2.0 + found.t**3, rel=1e-14)
    assert found.x[:, 1] == pytest.approx(found.t, abs=1e-15)
    assert found.stats == {"steps": 4, "rejected": 0, "rhs": 5, "events": 0, "work": 35.0}  # at the start and after each step


@pytest.mark.parametrize(("short", "steps"), [(0.0, 4), (2e-16, 4), (3e-16, 4), (1e-15, 5)])
def test_a_step_that_ends_at_the_stop_but_for_rounding_ends_there(short: float, steps: int) -> None:
    run = run_of()
    run.stepper.short = short  # type: ignore[attr-defined]
    while run.advance(1) == "more":
        run.stepper.short *= run.t < 0.95  # type: ignore[attr-defined]
    assert (run.t, run.record.steps) == (1.0, steps)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_first_crossing_of_a_step_is_found_to_rounding(sign: float) -> None:
    """Two within one step, one exactly at the end of a step, and one that is not crossed; the step goes on from there."""
    levels = [0.343, 0.4, 0.6**3 + 1e-9, 2.0]
    run = run_of(lambda t, x: [sign * (x[0] - level) for level in levels], 4)
    found = integrate(run)
    assert found.event_roots.tolist() == [2, 0, 1]
    assert found.event_times == pytest.approx(np.cbrt([levels[2], *levels[:2]]), rel=1e-14)
    assert found.x[:, 0] == pytest.approx(found.t**3, rel=1e-13)
    # steps end at 0.3, 0.6, three events, then 0.3 s later; the slope is computed anew at an event, and once more by the restart
    assert found.stats["steps"] == 6
    assert found.stats["rhs"] == 1 + 6 + 2 * 3


def test_a_function_that_comes_to_rest_at_zero_is_no_longer_positive() -> None:
    """The second one only touches zero at the end of a step, at 0.6 s; the third rests there from below, where zero counts as negative."""
    found = integrate(run_of(lambda t, x: [max(0.0, 0.4 - t), (t - 0.6) ** 2, min(0.0, t - 0.4)], 3))
    assert found.event_roots.tolist() == [0]
    assert found.event_times == pytest.approx([0.4], rel=1e-12)


@pytest.mark.parametrize("direction", [1, -1])
def test_directions_and_sides_are_those_of_the_event_iteration(direction: int) -> None:
    """It may set the side that an event function starts from, whatever its value is; those that fired together are told together."""
    seen = []

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        seen.append((round(t, 9), fired[0], fired[1], fired[2]))
        if len(seen) == 1:
            fired[1] = -2 * direction  # on the other side, where its value does not belong: it has jumped, in the same instant
        return 0

    run = run_of(
        lambda t, x: [direction * (x[1] - 0.45), direction * (1.0 + x[1]), direction * (0.45 - x[1])], 3, update=update
    )
    assert integrate(run).event_roots.tolist() == [0, 2]
    assert seen[0] == (0.0, 0, 0, 0)
    assert seen[-1] == (0.45, direction, 0, -direction)
    assert seen[1] == (0.0, 0, direction, 0)  # at once


@pytest.mark.parametrize("changes", [0, 1])
def test_leaving_zero_is_an_event_only_if_it_changes_something(changes: int) -> None:
    """With another function that crosses at the same time it is one in any case."""
    for level, logged in ((-1.0, 1 if changes else 0), (0.3, 2)):
        coming = iter([0, changes, *[0] * 9])
        run = run_of(
            lambda t, x, level=level: [max(x[1] - 0.3, 0.0), x[1] - level], 2, update=lambda *_, coming=coming: next(coming)
        )  # fmt: skip
        assert len(integrate(run).event_times) == logged


def test_what_cannot_be_evaluated_is_said() -> None:
    """With the culprit, if the problem knows it; or the run leaves there."""

    def rates(t: float, x: Any, dx: Any, data: Any) -> int:
        dx[0], dx[1] = 3.0 * t**2, math.nan if 0.7 < t < 0.95 else 1.0
        return int(t > 0.95)

    for rhs, culprit in ((rates, None), (rates, lambda t, x, data: f"; x is {x[1]:.3g}")):
        for last in (0.9, 0.99):
            run = run_of(rhs=rhs, culprit=culprit, times=[0.0, last])
            said = "the right-hand side cannot be evaluated beyond t = 0.6 s" + ("; x is 0.6" if culprit else "")
            with pytest.raises(SolverError, match=f"^{said}$"):
                integrate(run)
    assert integrate(run_of(rhs=rates, may_leave=True)).status == "left"

    def unknown(t: float, x: Any, g: Any, data: Any) -> int:
        return int(t > 0.7)

    run = driver(problem(lambda *_: 0, [0.0, 0.0], roots=unknown, n_roots=1), [0.0, 1.0], Cubic())
    with pytest.raises(SolverError, match=r"^the event functions cannot be evaluated beyond t = 0\.6 s$"):
        integrate(run)
