"""CombiTimeTable against numpy and scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator, PchipInterpolator

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.flatten import flatten
from tests.gearparts.blocks.bench import Driven, answer, close

B = gp.blocks
ROWS = [[0.0, 1.0, 2.0], [0.3, 2.0, 0.0], [0.4, -1.0, 0.5], [0.9, 0.0, 3.0]]
T, Y = np.array(ROWS).T[0], np.array(ROWS).T[1:]


def lines(y: Any, t: Any) -> Any:
    first, last = (y[1] - y[0]) / (T[1] - T[0]), (y[-1] - y[-2]) / (T[-1] - T[-2])
    return np.where(t < T[0], y[0] + first * (t - T[0]), np.where(t > T[-1], y[-1] + last * (t - T[-1]), np.interp(t, T, y)))


def steps(y: Any, t: Any) -> Any:
    return y[np.clip(np.searchsorted(T, t, side="right") - 1, 0, None)]


LAWS = {
    ("linear", "hold"): lambda y, t: np.interp(t, T, y),
    ("linear", "lines"): lines,
    ("linear", "periodic"): lambda y, t: np.interp(t % 0.9, T, y),
    ("constant", "hold"): steps,
    ("constant", "lines"): steps,
    ("constant", "periodic"): lambda y, t: steps(y, t % 0.9),
    ("akima", "hold"): lambda y, t: Akima1DInterpolator(T, y)(np.clip(t, T[0], T[-1])),
    ("akima", "periodic"): lambda y, t: Akima1DInterpolator(T, y)(t % 0.9),
    ("akima", "lines"): lambda y, t: with_slopes(Akima1DInterpolator(T, y), t),
    ("monotone", "lines"): lambda y, t: with_slopes(PchipInterpolator(T, y), t),
}


def with_slopes(curve: Any, t: Any) -> Any:
    """A curve that goes on with the slopes at its ends."""
    inside, slope = np.clip(t, T[0], T[-1]), curve.derivative()
    return curve(inside) + slope(inside) * (t - inside)


@pytest.mark.parametrize(("smoothness", "extrapolation"), LAWS)
def test_columns_follow_their_rows(smoothness: str, extrapolation: str) -> None:
    """From before the first row, at 0.4 s, to behind the last one."""
    given = {"table": ROWS, "smoothness": smoothness, "extrapolation": extrapolation, "start_time": -1.0, "shift_time": 0.4}
    r = gl.simulate(Driven(make=lambda: B.CombiTimeTable(**given)), 2.0, samples=38)
    for k in (0, 1):
        assert close(r[f"block.outputs[{k}].y"], LAWS[smoothness, extrapolation](Y[k], r.time - 0.4), 1e-9)


def test_offset_start_and_shift() -> None:
    t, y = answer(B.CombiTimeTable, out="outputs[0].y", table=ROWS, offset=0.5, start_time=0.33, shift_time=-0.1, columns=[2])
    assert close(y, 0.5 + np.where(t < 0.33, 0.0, lines(Y[1], t + 0.1)), 1e-9)
    t, y = answer(B.CombiTimeTable, out="outputs[0].y", table=ROWS, start_time=0.77, extrapolation="periodic")
    assert close(y, np.where(t < 0.77, 0.0, np.interp((t - 0.77) % 0.9, T, Y[0])), 1e-9)
    later = [[time + 0.2, *values] for time, *values in ROWS]
    t, y = answer(B.CombiTimeTable, out="outputs[0].y", table=later, shift_time=0.1, extrapolation="periodic")
    assert close(y, np.interp((t - 0.3) % 0.9, T, Y[0]), 1e-9)


@pytest.mark.parametrize(
    ("t_start", "shift_time", "smoothness"), [(-3.0, 1.37, "linear"), (0.0, 4.0, "constant"), (1.3, 4.0, "linear")]
)
def test_a_periodic_table_repeats_before_its_first_row_too(t_start: float, shift_time: float, smoothness: str) -> None:
    class Held(gl.Component):
        y = gl.Variable("1", start=0.0)

        def assemble(self) -> list[gl.Connection]:
            table = B.CombiTimeTable(
                table=ROWS, smoothness=smoothness, extrapolation="periodic", start_time=-5.0, shift_time=shift_time
            )
            self.plan = table
            return []

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.y), self.plan.outputs[0].y)]

    system, times = gl.compile(Held()), t_start + 0.0137 + 0.1 * np.arange(60)
    fine = np.linspace(times[0], times[-1], 100_001)
    law = LAWS[smoothness, "periodic"]
    area = float(np.mean(law(Y[0], fine[:-1] + 0.5 * (fine[1] - fine[0]) - shift_time)) * (fine[-1] - fine[0]))
    for method in ("rk5", "ida"):
        r = system.simulate(float(times[-1]), t_start=float(times[0]), times=times, method=method, rtol=1e-8)
        assert close(r["plan.outputs[0].y"], law(Y[0], times - shift_time), 1e-8)
        assert r["y"][-1] == pytest.approx(area, abs=2e-4)


@pytest.mark.parametrize("method", ["rk", "ida"])
def test_corners_are_stepped_to(method: str) -> None:
    class Drive(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.plan, self.torque, self.load = (
                B.CombiTimeTable(table=ROWS, smoothness="constant", extrapolation="periodic"),
                gp.Torque(),
                gp.Inertia(J=2.0),
            )
            return [gl.connect(self.plan.outputs[0].y, self.torque.tau), gl.connect(self.torque.flange, self.load.flange_a)]

    r = gl.simulate(Drive(), 1.8, samples=2, method=method)
    assert r["load.w"][-1] == pytest.approx((0.3 * 1.0 + 0.1 * 2.0 - 0.5 * 1.0) / 2.0 * 2, abs=1e-9)
    assert gl.simulate(Drive(), 1.1, t_start=1.0, samples=2, method=method)["plan.outputs[0].y"].tolist() == [1.0, 1.0]


STEPPED = [[0.0, 1.0], [0.5, 2.0], [0.5, -1.0], [1.0, 3.0], [1.0, 0.0]]


@pytest.mark.parametrize("smoothness", ["linear", "constant"])
@pytest.mark.parametrize("extrapolation", ["hold", "lines", "periodic"])
def test_two_rows_at_one_time_make_a_step(smoothness: str, extrapolation: str) -> None:
    t, y = answer(
        B.CombiTimeTable, out="outputs[0].y", table=STEPPED, smoothness=smoothness, extrapolation=extrapolation, samples=38
    )
    inside = t % 1.0 if extrapolation == "periodic" else t
    rising = np.where(inside < 0.5, 1.0 + 2.0 * inside, -1.0 + 8.0 * (inside - 0.5))
    level = rising if smoothness == "linear" else np.where(inside < 0.5, 1.0, -1.0)
    assert close(y, np.where(inside < 1.0, level, 0.0), 1e-9)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"table": []}, "expected rows of a time and one or more values"),
        ({"table": [[0.0]]}, "expected rows of a time and one or more values"),
        ({"table": [[1.0, 2.0], [0.0, 1.0]]}, "the first column must not decrease"),
        (
            {"table": [[0.0, 1.0], [1.0, 2.0], [1.0, 3.0]], "smoothness": "akima"},
            "two rows at 1 s, a step, which smoothness='akima'",
        ),
        ({"table": [[1.0, 2.0], [1.0, 3.0]], "extrapolation": "periodic"}, "needs two times"),
        ({"table": ROWS, "columns": [3]}, "expected numbers from 1 to 2"),
        ({"table": ROWS, "columns": [2, 0]}, r"columns is \(2, 0\); expected numbers from 1 to 2"),
        ({"table": ROWS, "columns": [1.5]}, "expected numbers from 1 to 2"),
        ({"table": ROWS[:1] * 2, "extrapolation": "periodic"}, "needs two times"),
        ({"table": [[0.0, 1.0], [1.0]]}, "expected one or more rows of 2 numbers"),
        ({"table": ROWS, "smoothness": "cubic"}, "smoothness is 'cubic'; expected 'linear'"),
        ({"table": ROWS, "extrapolation": "none"}, "extrapolation is 'none'; expected 'lines'"),
        ({"table": ROWS[:1], "extrapolation": "periodic"}, "needs two times"),
    ],
)
def test_what_is_no_table_is_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(BindingError, match=message):
        flatten(Driven(make=lambda: B.CombiTimeTable(**values)))
