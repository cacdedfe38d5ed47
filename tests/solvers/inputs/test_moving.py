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
