"""What IDA is told by the model's functions: to stop, to take a smaller step, or the values."""

from __future__ import annotations

import math
from typing import Any

import pytest

from gearlib.errors import SolverError
from gearlib.solvers.drive.driver import integrate
from gearlib.solvers.ida.ida import ida
from tests.run.python_problem import driver, problem
from tests.solvers.ida.test_sksundae_backend import with_jacobian


def decay(of_rate: Any = lambda t, call: 0, of_jacobian: Any = lambda t, call: 0) -> Any:
    """x' = -50 (x - t), with functions of time and the number of the call that say what is returned."""
    calls = [0]

    def rhs(t: float, x: Any, dx: Any, data: Any) -> int:
        calls[0] += 1
        dx[0] = -50.0 * (x[0] - t)
        return int(of_rate(t, calls[0]))

    return with_jacobian(problem(rhs, [1.0]), [[1]], lambda t, x, data: [[-50.0]], of_jacobian)


@pytest.mark.parametrize("native", [True, False])
def test_a_jacobian_that_stops_the_run_is_asked_once(native: bool) -> None:
    run = driver(decay(of_jacobian=lambda t, call: -1), [0.0, 1.0], ida(native), rtol=1e-6)
    with pytest.raises(SolverError, match=r"the Jacobian could not be evaluated or factorised at t=0$"):
        integrate(run)
    assert run.record.n_jac == 1
    assert run.record.refused == 0


@pytest.mark.parametrize("native", [True, False])
def test_a_jacobian_that_cannot_be_evaluated_is_asked_again_until_patience_ends(native: bool) -> None:
    run = driver(decay(of_jacobian=lambda t, call: 1), [0.0, 1.0], ida(native), rtol=1e-6)
    with pytest.raises(SolverError, match="could not be evaluated"):
        integrate(run)
    assert run.record.n_jac > 1
    assert run.record.refused > 0


@pytest.mark.parametrize("native", [True, False])
def test_a_function_that_fails_once_and_then_no_more_leaves_the_solution_as_it_is(native: bool) -> None:
    """x = t - 1/50 + 51/50 exp(-50 t); a Jacobian that was refused, and a rate, at their third calls."""
    for failing in ({"of_jacobian": lambda t, call: int(call == 3)}, {"of_rate": lambda t, call: int(call == 30)}):
        run = driver(decay(**failing), [0.0, 0.1, 1.0], ida(native), rtol=1e-8, atol=1e-10)
        found = integrate(run)
        exact = [t - 0.02 + 1.02 * math.exp(-50.0 * t) for t in (0.0, 0.1, 1.0)]
        assert found.x[:, 0] == pytest.approx(exact, abs=1e-6)
        assert run.record.refused == 1


@pytest.mark.parametrize("native", [True, False])
def test_a_rate_that_stops_the_run_stops_it_there(native: bool) -> None:
    """And the state until there is known."""
    seen: list[float] = []

    def of_rate(t: float, call: int) -> int:
        seen.append(t)
        return -1 if t > 0.5 else 0

    run = driver(decay(of_rate), [0.0, 1.0], ida(native), rtol=1e-6)
    with pytest.raises(SolverError, match=r"the right-hand side could not be evaluated at t=0\.5"):
        integrate(run)
    assert sum(t > 0.5 for t in seen) == 1
