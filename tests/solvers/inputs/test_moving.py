"""Tables as inputs of compiled runs: the same motion as with the expression, at its price."""

from __future__ import annotations

import time

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


class Driven(gl.Component):
    """Two tables, one of which steps, and a function drive a body with a fan: nonlinear, so that it is integrated."""

    def assemble(self) -> list[object]:
        self.a, self.b, self.c = gp.Torque(), gp.Torque(), gp.Torque()
        self.body = gp.Inertia(J=0.5)
        self.fan = gp.QuadraticSpeedDependentTorque(tau_nominal=-2.0, w_nominal=10.0, torque_direction=False)
        return [gl.connect(part.flange, self.body.flange_a) for part in (self.a, self.b, self.c, self.fan)]


RAMP, STEP = gl.Table([0.2, 0.5, 0.9], [0.0, 6.0, 2.0]), gl.Table([0.0, 0.4, 0.4, 1.0], [1.0, 1.0, -3.0, -4.0])


@pytest.fixture(scope="module")
def system() -> gl.System:
    return gl.compile(Driven(), outputs=["body.w"])


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida"])
@pytest.mark.parametrize("wave", [False, True])
def test_tables_equal_what_scipy_makes_of_them(system: gl.System, method: str, wave: bool) -> None:
    from scipy.integrate import solve_ivp

    third = (lambda t: np.sin(20 * t)) if wave else 0.0

    def rate(t: float, w: np.ndarray, limit: float) -> np.ndarray:
        inside = np.clip(t, *limit)  # one-sided at the knots
        late = 1.0 if limit[0] < 0.4 else -3.0 - (inside - 0.4) / 0.6
        ramp = np.interp(inside, RAMP.t, RAMP.y)
        return (ramp + late + (third(t) if wave else 0.0) - 2.0 * w * np.abs(w) / 100.0) / 0.5

    w, knots = np.zeros(1), [0.0, 0.2, 0.4, 0.5, 0.9, 1.2]
    expected = [0.0]
    for span in zip(knots, knots[1:], strict=False):
        if span[0] == 0.9:  # the second table is constant after its last knot at 1.0
            for part in ((0.9, 1.0), (1.0, 1.2)):
                w = solve_ivp(
                    lambda t, y, p=part: (2.0 + max(-3.0 - (t - 0.4) / 0.6, -4.0) + (third(t) if wave else 0.0)
                                          - 2.0 * y * np.abs(y) / 100.0) / 0.5,
                    part, w, rtol=1e-12, atol=1e-12, method="DOP853",
                ).y[:, -1]  # fmt: skip
        else:
            w = solve_ivp(rate, span, w, rtol=1e-12, atol=1e-12, method="DOP853", args=(span,)).y[:, -1]
        expected.append(w[0])
    inputs = {"a.tau": RAMP, "b.tau": STEP, "c.tau": third}
    result = system.simulate(1.2, times=knots, method=method, rtol=1e-9, inputs=inputs)
    assert result["body.w"] == pytest.approx(expected, rel=1e-7, abs=1e-8)


def test_a_table_costs_no_python_call(system: gl.System) -> None:
    """A Python function in its place makes the same run many times slower."""
    costs = []
    for signal in (STEP, STEP.__call__):
        inputs = {"a.tau": signal, "b.tau": 0.0, "c.tau": 0.0}
        system.simulate(1.2, samples=3, method="rk8", rtol=1e-12, inputs=inputs)
        begin = time.process_time()
        for _ in range(3):
            system.simulate(1.2, samples=3, method="rk8", rtol=1e-12, inputs=inputs)
        costs.append(time.process_time() - begin)
    assert costs[0] < 0.5 * costs[1]


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida"])
@pytest.mark.parametrize(
    ("begin", "jump", "end"), [(0.0, 0.8, 1.0), (-1.0, 0.0, 1.0), (1e9, 1e9 + 0.37, 1e9 + 1.0), (0.0, 1.0, 1.0)]
)
def test_a_step_up_to_a_jump_does_not_see_what_follows_it(
    system: gl.System, method: str, begin: float, jump: float, end: float
) -> None:
    """The fan holds against 8 N.m at 20 rad/s and against -2 N.m at -10 rad/s: w = 20 tanh(0.8 t), then a tangent, then a tanh again."""
    table = gl.Table([begin, jump], [8.0, -2.0], interpolation="previous")
    w, left = 20.0 * np.tanh(0.8 * (jump - begin)), end - jump
    stopping = np.arctan(w / 10.0) / 0.4  # s, until the body stands still
    w = 10.0 * np.tan(0.4 * (stopping - left)) if left < stopping else -10.0 * np.tanh(0.4 * (left - stopping))
    inputs = {"a.tau": table, "b.tau": 0.0, "c.tau": 0.0}
    result = system.simulate(end, t_start=begin, samples=2, method=method, rtol=1e-6, inputs=inputs)
    assert result["body.w"][-1] == pytest.approx(w, rel=1e-7 if method.startswith("rk") else 1e-6)
    assert result.stats["rejected"] <= (0 if method.startswith("rk") else 12)


@pytest.mark.parametrize("method", ["rk5", "rk8", "ida"])
@pytest.mark.parametrize("instants", [(0.5, 1.0), (0.2, 0.5, 0.7, 1.0), (0.3, 1.0)])
def test_a_stepped_run_may_stop_at_a_jump(system: gl.System, method: str, instants: tuple[float, ...]) -> None:
    table = gl.Table([0.0, 0.5], [0.0, 8.0], interpolation="previous")
    run = system.stepper(method=method, rtol=1e-6, inputs={"a.tau": table, "b.tau": 0.0, "c.tau": 0.0})
    for t in instants:
        run.advance(t)
    assert run["body.w"] == pytest.approx(20.0 * np.tanh(0.4), rel=1e-6 if method == "ida" else 1e-7)


@pytest.mark.parametrize("method", ["rk", "ida"])
def test_inputs_before_time_zero(method: str) -> None:
    """From -2 s on: what a torque of straight lines puts into a body, at corners and between them."""

    class Body(gl.Component):
        def assemble(self) -> list[object]:
            self.torque, self.body = gp.Torque(), gp.Inertia(J=0.5)
            return [gl.connect(self.torque.flange, self.body.flange_a)]

    table = gl.Table([-2.0, -1.0, 0.0, 1.0], [0.0, 1.0, 4.0, 4.0])
    times = [-2.0, -1.5, -1.0, -0.5, 0.0, 1.0]
    found = gl.compile(Body()).simulate(1.0, t_start=-2.0, times=times, method=method, rtol=1e-9, inputs={"torque.tau": table})
    assert found["body.w"] == pytest.approx([0.0, 0.25, 1.0, 2.75, 6.0, 14.0], rel=1e-7, abs=1e-9)
