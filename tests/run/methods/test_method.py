"""What is made of an integration: its statistics, advice beside its errors, and solutions that are not finite."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, SolverError
from gearlib.run.methods.method import explained, finished, refusal, with_callbacks
from gearlib.run.methods.method_table import METHODS, integrate
from gearlib.run.methods.run import Run
from tests.program.test_derivatives import Loop
from tests.run.methods.test_native_problem import run
from tests.run.test_constrained import Pendulum
from tests.run.test_linear_form import train


@cache
def scene(kind: type[gl.Component]) -> Any:
    return gl.compile(kind()).translation.scene


def test_errors_of_runs_that_solve_no_equations_stay() -> None:
    problem = SolverError("too many steps")
    assert explained(problem, train().scene) is problem


def test_errors_of_runs_that_iterate_give_advice() -> None:
    """By the names of the components; not where events chatter."""
    said = str(explained(SolverError("too many steps"), scene(Loop)))
    assert said == (
        "too many steps. The nonlinear equations of Loop may have no solution further on, or need better guesses: guess={...} of their "
        "variables"
    )
    chatter = SolverError("events chatter at t = 1 s")
    assert explained(chatter, scene(Loop)) is chatter


def test_errors_of_constrained_motions_name_the_states() -> None:
    own = gl.compile(Pendulum(start={"x": 0.6}, guess={"y": -0.8})).translation.scene
    said = str(explained(SolverError("too many steps"), own))
    states = ", ".join(own.state_names)
    assert said == (
        f"too many steps. The constraints of Pendulum may have become singular there for the states in use ({states}): start nearer to "
        "the end, or declare other variables as state='prefer'"
    )


def test_what_a_method_lacks() -> None:
    error = refusal("taylor", "needs smooth equations")
    assert isinstance(error, ArgumentError)
    assert str(error) == "method='taylor' needs smooth equations; use method='auto', 'rk' or 'ida'"


@cache
def solved() -> tuple[Run, Any]:
    own = run(times=(0.0, 0.5, 1.0))
    return own, integrate(own, METHODS["rk5"])


def test_statistics_of_a_run() -> None:
    own, solution = solved()
    plain = replace(solution, stats={"steps": 7})
    found = finished(own, plain, "mine", "for a reason")
    assert found.stats == {"method": "mine", "why": "for a reason", "states": len(own.scene.states), "steps": 7}
    watched = replace(own, signals=(lambda t: 0.0,))
    assert finished(watched, plain, "mine", "so").stats["max_step"] == (
        "two sample intervals, because of open.tau: a Python function, whose shortest pulse is not known; give max_step"
    )
    assert [name for _, name in found.events()] == [name for _, name in solution.events()]
    assert len(found.events()) == 2


def test_unknowns_beside_the_states_are_left_out() -> None:
    own, solution = solved()
    n = len(own.scene.states)
    wide = replace(
        solution, x=np.column_stack([solution.x, np.full(len(solution.x), 7.0)]), x_last=np.append(solution.x_last, 7.0)
    )
    found = finished(own, wide, "mine", "so")
    assert (found.x.shape[1], len(found.x_last)) == (n, n)
    assert found.x.tolist() == solution.x.tolist()


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_solution_that_is_not_finite_is_refused(row: int, value: float) -> None:
    """At the first sample that is not."""
    own, solution = solved()
    x = solution.x.copy()
    x[row:, -1] = value
    with pytest.raises(SolverError, match=rf"^the solution is not finite at t = {0.5 * row:g} s$"):
        finished(own, replace(solution, x=x), "mine", "so")


def test_failures_of_functions_take_precedence() -> None:
    """Over the solver's error, which follows from them; else that one is explained."""
    own, solution = solved()
    lost = ArgumentError("the function is lost")

    def failing(callbacks: Any) -> Any:
        callbacks.stop(lost)
        raise SolverError("no value")

    with pytest.raises(ArgumentError, match="the function is lost"):
        with_callbacks(own, failing)

    def stopped(callbacks: Any) -> Any:
        callbacks.stop(lost)
        return solution

    with pytest.raises(ArgumentError, match="the function is lost"):
        with_callbacks(own, stopped)

    def unsolved(callbacks: Any) -> Any:
        raise SolverError("no value")

    with pytest.raises(SolverError, match=r"^no value$"):
        with_callbacks(own, unsolved)
    with pytest.raises(SolverError, match=r"^no value\. The nonlinear equations of Loop may"):
        with_callbacks(replace(own, scene=scene(Loop)), unsolved)
    assert with_callbacks(own, lambda callbacks: solution) is solution


@pytest.mark.parametrize(("steps", "said"), [(0, ["clock 0"]), (7, ["clock 7"]), (None, ["clock 0"])])
def test_a_coarse_clock_is_told_with_the_steps(steps: Any, said: list[str]) -> None:
    own: Any = SimpleNamespace(may_stop=False, signals=(), coarse_clock=lambda n: f"clock {n}")
    solution: Any = SimpleNamespace(stats={} if steps is None else {"steps": steps})
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        assert with_callbacks(own, lambda callbacks: solution) is solution
    assert [str(one.message) for one in found] == said


def test_interrupts_are_listened_for_where_a_function_is_called() -> None:
    """Python would discard one at the entry of such a function. Numbers and tables call none."""
    own, solution = solved()
    before, hooks = sys.unraisablehook, []

    def integrated(_: Any) -> Any:
        hooks.append(sys.unraisablehook)
        return solution

    for signal in (0.0, gl.Table([0.0, 1.0], [0.0, 0.0]), lambda t: 0.0):
        with_callbacks(replace(own, signals=(signal,)), integrated)
    assert [hook is before for hook in hooks] == [True, True, False]
    assert sys.unraisablehook is before
