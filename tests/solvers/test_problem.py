"""What problems tell in messages: names where they are known, numbers where not; tolerances and the clock's origin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearlib.solvers.problem import Floats, Problem, late_start
from tests.run.python_problem import problem


def plain(**more: object) -> Problem:
    return replace(problem(lambda t, x, dx, data: 0, [1.0, 2.0, 3.0]), **more)  # type: ignore[arg-type]


def test_names_as_far_as_they_are_known() -> None:
    own = plain(state_names=("a.w", "a.phi"), root_names=("a: x > 0",), differential=np.array([True, False, True]))
    assert [own.state_name(k) for k in range(3)] == ["a.w", "a.phi", "state 2"]
    assert [own.root_name(k) for k in range(2)] == ["a: x > 0", "root 1"]
    assert [own.equation_name(k) for k in range(4)] == ["der(a.w)", "the equation of a.phi", "der(state 2)", "der(state 3)"]


def test_tolerances_follow_the_size_of_a_state_unless_given() -> None:
    own = plain(nominal=np.array([1.0, 10.0, 0.1]), rtol=1e-3)
    assert own.absolute_tolerance == pytest.approx([1e-3, 1e-2, 1e-4])
    assert plain(atol=[1e-9, 1e-8, 1e-7]).absolute_tolerance.tolist() == [1e-9, 1e-8, 1e-7]
    assert float(plain(atol=1e-9).absolute_tolerance) == 1e-9


def test_what_a_message_adds() -> None:
    seen: list[tuple[float, float, float]] = []

    def told(t: float, x: Floats, data: Floats) -> str:
        seen.append((t, x[0], data[0]))
        return "brake.mode"

    x, data = np.array([5.0]), np.array([7.0])
    own = plain(unsettled=told, culprit=told)
    assert own.not_settled(0.5, x, data) == ": the iteration does not settle, it keeps changing brake.mode"
    assert own.blamed(0.25, x, data) == "brake.mode"
    assert seen == [(0.5, 5.0, 7.0), (0.25, 5.0, 7.0)]
    assert own.blamed(0.25, None, data) == ""
    assert (plain().not_settled(0.5, x, data), plain().blamed(0.5, x, data)) == ("", "")
    assert plain(unsettled=lambda *_: "").not_settled(0.5, x, data) == ""


def test_looks_at_event_functions_cost_something_where_there_are_some() -> None:
    assert plain(roots_cost=70.0).look_cost == 0.0
    assert problem(lambda t, x, dx, data: 0, [1.0], roots=lambda t, x, g, data: 0, roots_cost=70.0).look_cost == 70.0


@pytest.mark.parametrize(
    ("t0", "t1", "origin"),
    [
        (0.0, 1.0, 0.0),
        (1.9, 2.9, 0.0),
        (2.0, 3.0, 2.0),
        (-2.0, -1.0, -2.0),
        (-1.0, 0.0, 0.0),
        (3.0, 7.0, 0.0),
        (0.3, 0.4, 0.3),
        (5.0, 5.0, 5.0),
    ],
)
def test_a_late_run_counts_from_its_start(t0: float, t1: float, origin: float) -> None:
    """Where it begins two of its lengths away from zero or farther."""
    assert late_start(t0, t1) == origin
