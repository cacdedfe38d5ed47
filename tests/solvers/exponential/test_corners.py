"""Tables that drive linear scenes: from corner to corner, against scipy and closed forms, and never as symbols."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gearlib as gl
import gearparts as gp
from gearlib.errors import SolverError
from gearlib.solvers.exponential.corners import Intervals, solve
from gearlib.solvers.inputs.table import Table

c = gl.connect


class Drive(gl.Component):
    """A measured torque, and one of time, on two inertias with a shaft between."""

    def assemble(self) -> list[Any]:
        self.t, self.a, self.b = gp.Torque(), gp.Inertia(J=0.1), gp.Inertia(J=0.2)
        self.s, self.d, self.g = gp.SpringDamper(c=1e3, d=1.0), gp.Damper(d=1.0), gp.Fixed()
        self.u = gp.Torque(tau=gl.Piecewise((gl.sin(5 * gl.time), gl.time < 0.7), (0.3, True)))
        return [
            c(self.t.flange, self.a.flange_a), c(self.a.flange_b, self.s.flange_a), c(self.s.flange_b, self.b.flange_a),
            c(self.b.flange_b, self.d.flange_a, self.u.flange), c(self.d.flange_b, self.g.flange),
        ]  # fmt: skip


SYSTEM = gl.compile(Drive(), outputs=["b.w"])


def by_pieces(A: Any, B: Any, tables: list[gl.Table], x0: Any, times: Any) -> Any:
    """scipy from corner to corner."""
    corners = np.unique(np.concatenate([times, *(t.t[(t.t > times[0]) & (t.t < times[-1])] for t in tables)]))
    x, found = np.asarray(x0, float), [x0]
    for a, b in zip(corners, corners[1:], strict=False):
        inner = [a + 0.25 * (b - a), a + 0.75 * (b - a)]  # of a straight line
        u = np.array([t(np.array(inner)) for t in tables])
        slope = (u[:, 1] - u[:, 0]) / (0.5 * (b - a))
        rates = lambda t, x: A @ x + B @ (u[:, 0] + slope * (t - inner[0]))  # noqa: B023, E731
        x = solve_ivp(rates, (a, b), x, rtol=1e-12, atol=1e-14, method="DOP853").y[:, -1]
        if b in times:
            found.append(x)
    return np.array(found)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.booleans(), st.integers(2, 12))
def test_any_tables_against_scipy(seed: int, even: bool, count: int) -> None:
    rng = np.random.default_rng(seed)
    A, B, x0 = rng.normal(size=(3, 3)), rng.normal(size=(3, 2)), rng.normal(size=3)
    times = np.linspace(0.5, 2.0, 7) if even else np.sort(rng.uniform(0.5, 2.0, 7))
    tables = []
    for _ in range(2):
        knots = np.linspace(0.0, 3.0, count) if even else np.sort(rng.uniform(0.0, 3.0, count))
        knots[count // 2] = knots[count // 2 - 1]  # a step
        tables.append(gl.Table(knots, rng.normal(size=count)))
    found = solve(A, B, tables, x0, times, Intervals.of(times, tables))
    assert found == pytest.approx(by_pieces(A, B, tables, x0, times), rel=1e-9, abs=1e-10)


@pytest.mark.parametrize("corners", [11, 3000])
@pytest.mark.parametrize("irregular", [False, True])
def test_a_scene_with_a_table_and_an_expression(corners: int, irregular: bool) -> None:
    rng = np.random.default_rng(corners)
    t = np.linspace(0, 2, corners)
    t[1:-1] += irregular * rng.uniform(-0.3, 0.3, corners - 2) * 2 / corners
    table = gl.Table(t, rng.normal(size=corners))
    options: dict[str, Any] = {"samples": 101, "inputs": {"t.tau": table}}
    fine, found = SYSTEM.simulate(2.0, method="rk8", rtol=1e-12, **options), SYSTEM.simulate(2.0, method="auto", **options)
    assert found.stats["method"] == "exact"
    assert found["b.w"] == pytest.approx(fine["b.w"], rel=1e-8, abs=1e-9)


def test_the_work_per_corner_is_a_few_operations() -> None:
    """Counted, not timed: nothing in Python is called once per corner, no symbol least of all."""

    def calls(corners: int) -> int:
        table = gl.Table(np.linspace(0, 1, corners), np.cos(np.arange(float(corners))))
        count = 0

        def see(frame: Any, event: str, _: Any) -> None:
            nonlocal count
            count += event in ("call", "c_call")

        sys.setprofile(see)
        try:
            SYSTEM.simulate(1.0, samples=3, inputs={"t.tau": table}, parameters={"s.c": 1e3 + corners})
        finally:
            sys.setprofile(None)
        return count

    calls(500)
    few, many = calls(1000), calls(20_000)
    assert many < 1.5 * few


def test_many_states_leave_a_table_with_many_corners_to_runge_kutta() -> None:
    class Long(gl.Component):
        def assemble(self) -> list[Any]:
            self.t, self.j = gp.Torque(), [gp.Inertia(J=1.0) for _ in range(30)]
            self.s = [gp.SpringDamper(c=100.0, d=1.0) for _ in range(29)]
            links = [c(self.t.flange, self.j[0].flange_a)]
            for a, s, b in zip(self.j, self.s, self.j[1:], strict=False):
                links += [c(a.flange_b, s.flange_a), c(s.flange_b, b.flange_a)]
            return links

    system = gl.compile(Long(), outputs=["j[29].w"])
    t = np.linspace(0, 10, 301)
    ramp, measured = gl.Table([0.0, 1.0], [0.0, 5.0]), gl.Table(t, np.sin(t))
    assert system.simulate(10.0, samples=11, inputs={"t.tau": ramp}).stats["method"] == "exact"
    left = system.simulate(10.0, samples=11, inputs={"t.tau": measured}, rtol=1e-9)
    assert left.stats["method"].startswith("rk")
    assert "a table has 301 points" in left.stats["why"]
    exact = system.simulate(10.0, samples=11, inputs={"t.tau": measured}, method="exact")
    assert left["j[29].w"] == pytest.approx(exact["j[29].w"], rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("back", [0.0, 1e-19, 1e-12, 1e-3])
@pytest.mark.parametrize("n", [1, 2, 4])
def test_states_that_hardly_act_back(n: int, back: float) -> None:
    """A chain of integrators driven by a ramp: the last term of the series is the one that reaches the last state."""
    A, B = np.diag(np.full(n - 1, 0.7), -1), np.zeros((n, 1))
    A[0, -1], B[0, 0] = back, 0.15
    ramp, times = Table([0.0, 1.3], [2.0, 5.0]), np.array([0.0, 0.123, 0.5, 1.3])
    found = solve(A, B, [ramp], np.zeros(n), times, Intervals.of(times, [ramp]))
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n], whole[:n, n], whole[n, n + 1] = A, B[:, 0], 1.0
    right = np.array([expm(whole * t)[:n] @ [*np.zeros(n), 2.0, 3.0 / 1.3] for t in times])
    assert found == pytest.approx(right, rel=1e-12, abs=1e-300)


@pytest.mark.parametrize("rate", [0.0, 1.7e-18, -1e-12, 1e-30])
@pytest.mark.parametrize("n", [1, 2, 4])
def test_chains_of_integrators_with_a_rate_that_is_rounding(rate: float, n: int) -> None:
    """A table that rises, over n integrators: 3 t**(n + 1) / (n + 1)!; from the last one back there is next to nothing."""
    A = np.diag(np.ones(n - 1), -1)
    A[0, -1] = rate
    B = np.zeros((n, 1))
    B[0] = 1.0
    ramp, times = Table([0.0, 2.0], [-4.0, 2.0]), np.array([0.0, 0.01, 0.05, 0.5, 1.0])
    found = solve(A, B, [ramp], np.zeros(n), times, Intervals.of(times, [ramp]))
    for k in range(1, n + 1):
        expected = -4.0 * times**k / math.factorial(k) + 3.0 * times ** (k + 1) / math.factorial(k + 1)
        assert found[:, k - 1] == pytest.approx(expected, rel=1e-9, abs=1e-18)


@pytest.mark.parametrize(("rate", "when"), [(800.0, "0.9"), (1500.0, "0.5")])
@pytest.mark.parametrize("corners", [2, 40])
def test_a_solution_that_overflows_is_refused(rate: float, when: str, corners: int) -> None:
    """With the first sample that is not finite: exp(710) is the last power."""
    times, table = np.array([0.0, 0.4, 0.5, 0.7, 0.9, 1.0]), gl.Table(np.linspace(0.0, 1.0, corners), np.ones(corners))
    with pytest.raises(SolverError, match=rf"^the solution leaves the range of floating-point numbers before t = {when} s$"):
        solve(np.array([[rate]]), np.ones((1, 1)), [table], np.ones(1), times, Intervals.of(times, [table]))
