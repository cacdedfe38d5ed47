"""The first step of a run, against Hairer's formula written out for vectors."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gearlib.solvers.rungekutta.rungekutta import RungeKutta
from tests.run.python_problem import driver, problem

RIGHT: dict[str, tuple[Callable[[float, Any], Any], list[float]]] = {
    "decay": (lambda t, x: -3.0 * x, [1.0, 0.5]),
    "faster": (lambda t, x: -10.0 * x, [1.0, 2.0]),
    "of unlike sizes": (lambda t, x: np.array([-x[0], 1e3 * x[0]]), [1.0, 1e-3]),
    "at rest, driven by time": (lambda t, x: np.array([np.sin(50.0 * t), -x[1]]), [0.0, 0.0]),
    "at rest for ever": (lambda t, x: 0.0 * x, [0.0, 0.0]),
    "still, but not at zero": (lambda t, x: 0.0 * x, [1.0, 2.0]),
    "from zero": (lambda t, x: 1.0 - x, [0.0, 0.0]),
    "slow": (lambda t, x: 1e-9 * x, [1.0, 1.0]),
    "almost at rest": (lambda t, x: 1.6e-10 + 0.0 * x, [1.0, 1.0]),
    "hardly at rest": (lambda t, x: 2.4e-10 + 0.0 * x, [1.0, 1.0]),
    "almost from zero": (lambda t, x: 1.0 + 0.0 * x, [0.8e-10, 0.8e-10]),
    "hardly from zero": (lambda t, x: 1.0 + 0.0 * x, [1.2e-10, 1.2e-10]),
    "infinite where Euler leads": (lambda t, x: np.where(x < 1.0001, 2.0, np.inf), [1.0, 1.0]),
    "curved only": (lambda t, x: np.array([1e-4 + t * 1e6, 0.0]), [1.0, 1.0]),
}


def by_hand(f: Callable[[float, Any], Any], x: Any, order: int, h_max: float, rtol: float, atol: Any) -> float:
    weight = 1.0 / (atol + rtol * np.abs(x))
    norm = lambda v: math.sqrt(float(np.mean((v * weight) ** 2)))  # noqa: E731
    slope = f(0.0, x)
    d0, d1 = norm(x), norm(slope)
    h0 = min(0.01 * d0 / d1 if d0 > 1e-5 and d1 > 1e-5 else 1e-6 * h_max, h_max)
    d2 = norm(f(h0, x + h0 * slope) - slope) / h0
    largest = max(d1, d2)
    if not largest < math.inf:
        return 1e-3 * h0
    h1 = max(1e-6 * h_max, 1e-3 * h0) if largest <= 1e-15 else (0.01 / largest) ** (1 / order)
    return min(100 * h0, h1, h_max)


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("kind", RIGHT)
@pytest.mark.parametrize("longest", [math.inf, 1e-4])
def test_it_is_hairers(kind: str, order: int, longest: float) -> None:
    """A tenth of the run at most, or the longest step that is allowed."""
    f, x0 = RIGHT[kind]

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = f(t, np.array([x[0], x[1]]))

    own = problem(rhs, x0, traced=np.array([0]), longest_step=longest)
    run = driver(own, [0.0, 20.0], RungeKutta(order), rtol=1e-5)
    run.advance(1)
    trace = run.solution().trace
    assert trace is not None
    expected = by_hand(f, np.array(x0), order, min(2.0, longest), 1e-5, 1e-5)
    assert run.t == pytest.approx(expected, rel=1e-9)
    assert trace.times.tolist() == [0.0, run.t]


def test_a_first_step_that_is_given_is_taken() -> None:
    own = problem(lambda t, x, dx, data: 0, [1.0, 1.0])
    run = driver(own, [0.0, 20.0], RungeKutta(5, 0.125))
    run.advance(1)
    assert run.t == 0.125
