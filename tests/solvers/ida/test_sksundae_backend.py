"""Both roads to IDA decide alike: the same evaluations, events, samples and failures, whatever the model does."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import GearlibError, SolverError
from gearlib.solvers.drive.driver import integrate
from gearlib.solvers.ida.ida import ida
from gearlib.solvers.problem import Problem
from gearlib.solvers.rungekutta.rungekutta import RungeKutta
from tests.run.python_problem import driver, native, problem


def with_jacobian(
    own: Problem, pattern: Any, jac: Callable[[float, Any, Any], Any], failing: Callable[[float, int], int] | None = None
) -> Problem:
    """A problem whose Jacobian has entries where a pattern is not zero; ``failing`` says what its call number returns."""
    pattern = np.asarray(pattern)
    columns, rows = np.nonzero(pattern.T)
    calls = [0]

    def entries(t: float, x: Any, out: Any, data: Any) -> int:
        calls[0] += 1
        J = np.asarray(jac(t, x, data), float)
        for k, (i, j) in enumerate(zip(rows, columns, strict=True)):
            out[k] = J[i, j]
        return failing(t, calls[0]) if failing else 0

    starts = np.searchsorted(columns, np.arange(pattern.shape[1] + 1))
    return replace(own, jac=native(entries), jac_indptr=starts, jac_indices=rows)


def stiff(analytic: bool = True, late: float = 0.0, **more: Any) -> Problem:
    """A fast state follows a pendulum, whose angle crosses 0.4 in both directions, and whose speed touches levels; a clock ticks."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = x[1], -25.0 * math.sin(x[0]) + data[0]
        dx[2] = -300.0 * (x[2] - x[0] * math.cos(3.0 * (t - late)))

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0], g[1], g[2] = x[0] - 0.4, x[1] - 2.49, 0.5 - x[2]

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        if fired[0] > 0 and data[1] < 2.0:
            data[0], data[1], x[1] = data[0] + 0.5, data[1] + 1.0, 0.9 * x[1]
            return 2
        return 0

    def jac(t: float, x: Any, data: Any) -> Any:
        return [[0, 1, 0], [-25.0 * math.cos(x[0]), 0, 0], [300.0 * math.cos(3.0 * (t - late)), 0, -300.0]]

    given = {
        "roots": roots,
        "n_roots": 3,
        "update": update,
        "discrete": slice(0, 2),
        "time_events": late + np.array([0.33]),
    } | more
    own = problem(rhs, [0.5, 0.0, 0.0], **given)
    return with_jacobian(own, [[0, 1, 0], [1, 0, 0], [1, 0, 1]], jac) if analytic else own


def touching() -> Problem:
    """x = sin t, which is above 0.9999 for 0.028 s; the crossings are counted."""

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        data[0] += fired[0] != 0
        return 0

    return problem(
        lambda t, x, dx, data: dx.__setitem__(0, math.cos(t)), [0.0], roots=lambda t, x, g, data: g.__setitem__(0, 0.9999 - x[0]),
        n_roots=1, update=update, discrete=slice(0, 1),
    )  # fmt: skip


def chained(kind: str = "") -> Problem:
    """Twelve masses in a row, numbered in no order, the last one driven; one crosses its place at rest again and again."""
    n, order = 24, np.random.default_rng(2).permutation(24)
    place = np.argsort(order)
    A = np.zeros((n, n))
    for k in range(12):
        A[k * 2, k * 2 + 1] = 1.0
        A[k * 2 + 1, k * 2], A[k * 2 + 1, k * 2 + 1] = -800.0, -3.0
        for other in {max(k - 1, 0), min(k + 1, 11)}:
            A[k * 2 + 1, other * 2] += 400.0
    A = A[np.ix_(order, order)]

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        y = A @ [x[i] for i in range(n)]
        y[place[23]] += 50.0 * math.sin(30.0 * t)
        for i in range(n):
            dx[i] = y[i]

    own = problem(rhs, np.zeros(n), roots=lambda t, x, g, data: g.__setitem__(0, x[place[18]] - 1e-3), n_roots=1)
    return with_jacobian(own, A != 0.0, lambda t, x, data: A)


def hessenberg() -> Problem:
    """Each of twenty states acts on the one behind it and on all before it: a band below the diagonal, all above it."""
    A = np.triu(np.random.default_rng(1).normal(size=(20, 20)), -1) - 6.0 * np.eye(20)

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        for i, rate in enumerate(A @ [x[i] for i in range(20)]):
            dx[i] = rate

    return with_jacobian(problem(rhs, np.ones(20)), A != 0.0, lambda t, x, data: A)


def constrained(analytic: bool = True, shift: float = 1.0, failing: Callable[[float, int], int] | None = None) -> Problem:
    """y + y**3 / 10 = shift + x + sin 5 t, which drives x' = -2 x - y; where y rises through 1.2, it jumps once."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = -2.0 * x[0] - x[1]
        dx[1] = shift + x[0] + math.sin(5.0 * t) - data[0] - x[1] - 0.1 * x[1] ** 3

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0] = x[1] - 1.2

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        if fired[0] > 0 and data[0] == 0.0:
            data[0] = 0.7
            return 1
        return 0

    own = problem(rhs, [0.0, 0.2], roots=roots, n_roots=1, update=update, discrete=slice(0, 1))
    own = replace(own, differential=np.array([True, False]))
    if not analytic:
        return own
    return with_jacobian(own, [[1, 1], [1, 1]], lambda t, x, data: [[-2, -1], [1, -1 - 0.3 * x[1] ** 2]], failing)


def implicit(events: bool = True) -> Problem:
    """F(t, x, x') = 0: a bead with a mass that grows, x' = v, (1 + x**2) v' = u - v, and u = -9 x + cos 2 t, an algebraic unknown."""

    def residual(t: float, x: Any, F: Any, data: Any) -> None:
        F[0] = x[3] - x[1]
        F[1] = (1.0 + x[0] ** 2) * x[4] - x[2] + x[1]
        F[2] = x[2] + (9.0 + data[0]) * x[0] - math.cos(2.0 * t)

    def jac(t: float, x: Any, data: Any) -> Any:
        return [
            [0, -1, 0, 1, 0, 0], [2 * x[0] * x[4], 1, -1, 0, 1 + x[0] ** 2, 0], [9 + data[0], 0, 1, 0, 0, 0],
        ]  # fmt: skip

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        if fired[0] < 0 and data[0] == 0.0:
            data[0] = 2.0
            return 1
        return 0

    more: dict[str, Any] = (
        {"roots": lambda t, x, g, data: g.__setitem__(0, x[0] + 0.05), "n_roots": 1, "update": update} if events else {}
    )
    own = replace(
        problem(residual, [0.3, 0.0, 0.0], discrete=slice(0, 1), **more),
        implicit=True,
        differential=np.array([True, True, False]),
    )
    return with_jacobian(own, [[0, 1, 0, 1, 0, 0], [1, 1, 1, 0, 1, 0], [1, 0, 1, 0, 0, 0]], jac)


def refusing(how: str, may_leave: bool = False) -> Problem:
    """x' = 1 + x, y' = -50 (y - x): beyond x = 0.5 it cannot be evaluated, in one way or another, until its rate is set to -1 at 0.45."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> int:
        dx[0], dx[1] = 1.0 + x[0], -50.0 * (x[1] - x[0])
        if x[0] > 0.5:
            dx[1] = math.nan if how == "nan" else dx[1]
            return {"stop": -1, "smaller": 1}.get(how, 0)
        return 0

    def failing(t: float, call: int) -> int:
        return {"jac stops": -1, "jac smaller": 1}.get(how, 0) if t > 0.3 and call % 2 else 0

    def jac(t: float, x: Any, data: Any) -> Any:
        return [[1.0, 0.0], [50.0 if how != "jac nan" or x[0] <= 0.0 else math.nan, -50.0]]

    return with_jacobian(replace(problem(rhs, [0.0, 1.0]), may_leave=may_leave), [[1, 0], [1, 1]], jac, failing)


FREE = np.array([1e-6, 1e-6, 1e3])  # only one road leaves algebraic unknowns out of the error test
T = np.linspace(0.0, 2.0, 9)
CASES: dict[str, tuple[Callable[[], Problem], Any, dict[str, Any]]] = {
    "events": (stiff, T, {}),
    "difference quotients": (lambda: stiff(False), T, {"rtol": 1e-4}),
    "late": (lambda: stiff(late=500.0), 500.0 + T, {}),
    "short steps": (lambda: stiff(longest_step=0.004), T[:3], {}),
    "tolerances of states": (stiff, T, {"atol": np.array([1e-5, 1e-7, 1e-3])}),
    "band": (stiff, T, {"linear_solver": "band"}),
    "chain": (chained, T[:3], {}),
    "touching": (touching, np.array([0.0, 3.0]), {"rtol": 1e-2, "atol": 1e-4}),
    "wide band": (hessenberg, T, {}),
    "sparse chain": (chained, T[:3], {"linear_solver": "sparse"}),
    "algebraic": (constrained, T, {}),
    "algebraic, wrong at first": (lambda: constrained(shift=-30.0), T, {}),
    "algebraic, by differences": (lambda: constrained(False), T, {}),
    "algebraic, sparse": (constrained, T, {"linear_solver": "sparse"}),
    "algebraic, no matrix": (lambda: constrained(failing=lambda t, call: 1), T, {}),
    "implicit": (implicit, T, {"atol": FREE}),
    "implicit, sparse": (implicit, T, {"linear_solver": "sparse", "atol": FREE}),
    "implicit, wide band": (implicit, T, {"linear_solver": "band", "atol": FREE}),
    "implicit without events": (lambda: implicit(False), T, {}),
}  # fmt: skip
# Where a root's time is rounded otherwise, or Newton's iteration ends otherwise: tolerance of numbers, and of counts
LOOSE = {"algebraic": (1e-6, 0.1), "algebraic, sparse": (1e-6, 0.1), "implicit without events": (1e-3, 0.3)}
FAILURES = ["nan", "stop", "smaller", "jac stops", "jac smaller"]


def outcome(own: Problem, times: Any, native: bool, linear_solver: str | None = None, **asked: Any) -> dict[str, Any]:
    """What a run says, with its counts."""
    stepper, said, run = ida(native, linear_solver), "", None
    try:
        run = driver(own, times, stepper, **{"rtol": 1e-6} | asked)
        integrate(run)
    except GearlibError as problem:
        said = re.sub(r" \(h=[^)]*\)|; the error estimate is largest in .*", "", str(problem))
    if run is None:
        return {"said": said}
    record: Any = run.record
    found = run.solution()
    return {
        "said": said, "status": run.status, "t": run.t, "x": run.x, "samples": found.x, "discrete": found.discrete,
        "event times": run.event_times, "event roots": run.event_roots.tolist(), "rhs": record.n_rhs, "jac": record.n_jac,
        "attempts": record.attempts, "restarts": stepper.stats()["restarts"], "refused": record.refused, "bad": record.bad_state,
        "bad time": record.bad_time, "guess": record.first_guess, "events": record.events,
    }  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_both_roads_take_the_same_steps_to_the_same_events(case: str) -> None:
    own, times, asked = CASES[case]
    one, other = (outcome(own(), times, native, **asked) for native in (True, False))
    assert ("no consistent values" in one["said"]) == (case == "algebraic, no matrix")
    for name, value in one.items():
        near, share = LOOSE.get(case, (1e-9, 0.0))
        counted = name in ("rhs", "jac", "attempts")
        expected: Any = value
        if not isinstance(value, str | list):
            expected = pytest.approx(value, rel=share if counted else near, abs=0.0 if counted else 1e-3 * near)
        assert other[name] == expected, name


def test_a_band_may_be_as_wide_as_the_matrix() -> None:
    """It is chosen where there is little below the diagonal."""
    stepper, own = ida(), hessenberg()
    found = integrate(driver(own, [0.0, 1.0], stepper, rtol=1e-9))
    assert found.stats["linear_solver"] == "band, 1 below and 19 above the diagonal"
    assert found.stats["jac"] < 60  # a matrix that is read otherwise than it is written makes no progress
    fine = integrate(driver(own, [0.0, 1.0], RungeKutta(8), rtol=1e-12))
    assert found.x[-1] == pytest.approx(fine.x[-1], rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize("analytic", [True, False])
def test_a_single_sample_has_consistent_values(native: bool, analytic: bool) -> None:
    """Of the algebraic unknown, which starts at 0.2: y + y**3 / 10 = 1."""
    found = outcome(constrained(analytic), np.array([0.0]), native)
    y = found["samples"][0, 1]
    assert (found["status"], found["samples"][0, 0]) == ("done", 0.0)
    assert y + 0.1 * y**3 == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("native", [True, False])
@pytest.mark.parametrize(("slope", "level"), [(-0.25, 0.0), (-4.0, 0.0), (0.25, 0.5), (-0.25, 0.5), (-4.0, 0.5), (-4.0, -0.5)])
def test_what_falls_from_zero_at_the_start_crosses_nothing(slope: float, level: float, native: bool) -> None:
    """An event function (slope - level) t of a state and time, beside an algebraic unknown; a second one crosses zero at 0.6."""

    def rhs(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = slope, 2.0 * x[0] - x[1]

    def roots(t: float, x: Any, g: Any, data: Any) -> None:
        g[0], g[1] = x[0] - level * t, x[0] - 0.6 * slope

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        for k in range(2):
            data[k] += fired[k] != 0
        return 0

    own = problem(rhs, [0.0, 0.0], roots=roots, n_roots=2, update=update, discrete=slice(0, 2))
    found = outcome(replace(own, differential=np.array([True, False])), T, native)
    assert found["discrete"][-1].tolist() == [0.0, 1.0]
    assert found["event times"] == pytest.approx([0.6], abs=1e-6)


@pytest.mark.parametrize("native", [True, False])
def test_both_crossings_within_one_step_are_found(native: bool) -> None:
    """The function turns away from zero in between."""
    found = outcome(touching(), np.array([0.0, 3.0]), native, rtol=1e-2, atol=1e-4)
    half = math.acos(0.9999)
    assert found["event times"] == pytest.approx([0.5 * math.pi - half, 0.5 * math.pi + half], abs=0.02)
    assert found["discrete"][-1].tolist() == [2.0]
    assert found["attempts"] < 3.0 / (2.0 * half)  # most steps are longer than that


@pytest.mark.parametrize("kind", ["dense", "band", "sparse"])
@pytest.mark.parametrize("native", [True, False])
def test_a_run_that_fails_before_its_first_factorisation_ends_with_a_word(native: bool, kind: str) -> None:
    """And so does one that is closed before it begins."""

    def refused(t: float, x: Any, dx: Any, data: Any) -> int:
        dx[0] = math.nan  # it may have written anything
        return -1

    own = with_jacobian(problem(refused, [0.0, 1.0, 2.0]), np.ones((3, 3)), lambda *_: np.eye(3))
    for _ in range(3):
        driver(own, T, ida(native, kind)).close()
        with pytest.raises(SolverError, match=r"^the right-hand side could not be evaluated at t=0; integrated until t=0$"):
            integrate(driver(own, T, ida(native, kind)))


@pytest.mark.parametrize("may_leave", [False, True])
@pytest.mark.parametrize("how", FAILURES)
def test_both_roads_blame_the_same(how: str, may_leave: bool) -> None:
    """scikit-sundae reports no step before the next sample."""
    one, other = (outcome(refusing(how, may_leave), T, native) for native in (True, False))
    for found in (one, other):
        found["said"] = found["said"].partition("; integrated")[0]
    at = one["bad time"] or one["t"]
    limit = math.log(1.5) if "jac" not in how else 0.4
    assert one["bad"] == other["bad"] == (1 if how == "nan" else 0 if how == "jac stops" else -1)
    assert one["status"] == other["status"] == ("left" if may_leave and how != "jac stops" else "more")
    assert 0.3 < at < limit + (0.02 if how == "stop" else 1e-5)
    assert other["bad time"] == pytest.approx(one["bad time"], rel=1e-2)
    if how != "jac stops":
        assert one["said"] == other["said"]


@pytest.mark.parametrize("native", [True, False])
def test_a_slope_that_is_not_finite_only_slows_newtons_iteration_down(native: bool) -> None:
    """x = exp(t) - 1 and y' = -50 (y - x), without dy'/dx; the rates stay right."""
    found = outcome(refusing("jac nan"), T, native, rtol=1e-8)
    c = 1.0 - (50.0 / 51.0 - 1.0)
    exact = np.column_stack([np.exp(T) - 1.0, 50.0 / 51.0 * np.exp(T) - 1.0 + c * np.exp(-50.0 * T)])
    assert (found["said"], found["status"]) == ("", "done")
    assert found["samples"] == pytest.approx(exact, abs=1e-5)


@pytest.mark.parametrize("function", ["rhs", "jac", "root_values"])
def test_the_first_exception_on_the_way_through_ida_comes_out(function: str) -> None:
    run = driver(stiff(), T, ida(native=False))
    assert run.advance(1) == "more"
    calls = itertools.count()

    def failing(*_: Any) -> int:
        raise KeyError(f"call {next(calls)}")

    setattr(run.stepper, function, failing)
    with pytest.raises(KeyError, match="call 0"):
        integrate(run)


def test_the_state_with_the_largest_error_is_known_to_one_road_alone() -> None:
    """A state that is named must be it."""
    steppers = ida(), ida(native=False)
    runs = [driver(stiff(), T, stepper, rtol=1e-6) for stepper in steppers]
    assert [stepper.worst_state() for stepper in steppers] == [-1, -1]  # no step yet
    for run in runs:
        run.advance(5)
    known, unknown = (stepper.worst_state() for stepper in steppers)
    assert 0 <= known < 3
    assert unknown == -1
    for run in runs:
        run.close()


@pytest.mark.parametrize("longest", [0.002, math.inf])
def test_a_run_that_goes_on_takes_steps_as_long_as_it_then_may(longest: float) -> None:
    run = driver(problem(lambda t, x, dx, data: dx.__setitem__(0, -x[0]), [1.0]), [0.0, 1.0], ida(), rtol=1e-6)
    while run.advance() == "more":
        pass
    before = run.record.steps
    run.go_on(2.0, np.empty(0), longest)
    while run.advance() == "more":
        pass
    assert run.x[0] == pytest.approx(np.exp(-2.0), rel=1e-4)
    assert (run.record.steps - before >= 490) == (longest == 0.002)
    run.close()
