"""Inputs: numbers, functions of time, tables; and those that fail."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, NameLookupError

c = gl.connect


class Driven(gl.Component):
    def assemble(self) -> list[Any]:
        self.torque, self.load = gp.Torque(), gp.Inertia(J=2.0)
        return [c(self.torque.flange, self.load.flange_a)]


SYSTEM = gl.compile(Driven())


def run(tau: Any, **options: Any) -> Any:
    return SYSTEM.simulate(2.0, samples=9, inputs={"torque.tau": tau}, **options)["load.w"]


TABLE = gl.Table([0.0, 0.5, 0.5, 1.25, 1.5], [2.0, 4.0, -1.0, 3.0, 0.0])


def integral(t: Any) -> Any:
    """Of the table, by hand: trapezia between its points."""
    points = np.array([0.0, 0.5, 1.25, 1.5, 2.0])
    pieces = [(2.0, 4.0), (-1.0, 3.0), (3.0, 0.0), (0.0, 0.0)]
    total = np.zeros_like(t)
    for a, b, (ya, yb) in zip(points, points[1:], pieces):
        s = np.clip((t - a) / (b - a), 0.0, 1.0)
        total += (b - a) * (ya * s + (yb - ya) * s**2 / 2)
    return total


@pytest.mark.parametrize("method", ["auto", "exact", "ida", "rk", "rk5", "rk8"])
def test_all_methods_agree_on_a_table(method: str) -> None:
    expected = integral(np.linspace(0, 2, 9)) / 2
    assert run(TABLE, method=method, rtol=1e-9) == pytest.approx(expected, rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("method", ["auto", "ida", "rk"])
def test_a_function_of_time(method: str) -> None:
    t = np.linspace(0, 2, 9)
    assert run(lambda s: np.cos(3 * s), method=method, rtol=1e-9) == pytest.approx(np.sin(3 * t) / 6, rel=1e-7, abs=1e-8)


def test_a_number_and_the_default_of_zero() -> None:
    assert run(3) == pytest.approx(1.5 * np.linspace(0, 2, 9))
    with pytest.warns(gl.GearlibWarning, match=r"Driven: no value was given for the input torque\.tau: it is 0"):
        result = SYSTEM.simulate(2.0, samples=3)
    assert result["load.w"].tolist() == [0.0, 0.0, 0.0]
    assert result.stats["zero_inputs"] == ("torque.tau",)
    assert "inputs      0 unless a run is given them: torque.tau" in SYSTEM.summary()
    assert SYSTEM.simulate(2.0, samples=3, inputs={"torque.tau": 0.0}).stats["zero_inputs"] == ()
    assert SYSTEM.inputs == ("torque.tau",)


def test_an_input_is_a_history_too() -> None:
    result = SYSTEM.simulate(2.0, samples=9, inputs={"torque.tau": TABLE})
    assert result["torque.tau"] == pytest.approx(TABLE(result.time))
    assert result["load.flange_a.tau"] == pytest.approx(TABLE(result.time))


def test_table_values_and_its_lines() -> None:
    assert TABLE(np.array([-1.0, 0.25, 0.5, 1.4, 7.0])) == pytest.approx([2.0, 3.0, -1.0, 1.2, 0.0], abs=1e-14)
    assert TABLE(0.5) == -1.0  # the right-hand value of a step
    assert gl.Table([1.0], [5.0])(np.array([0.0, 3.0])).tolist() == [5.0, 5.0]
    values, slopes = TABLE.lines(np.array([-1.0, 0.25, 0.5, 1.3, 7.0]), np.full(5, 0.1))
    assert values == pytest.approx([2.0, 3.0, -1.0, 2.4, 0.0], abs=1e-14)
    assert slopes == pytest.approx([0.0, 4.0, 16 / 3, -12.0, 0.0])


def test_a_table_keeps_its_own_points() -> None:
    y = np.array([0.0, 1.0])
    table = gl.Table([0.0, 1.0], y)
    y[:] = 7.0
    assert table(1.0) == 1.0
    with pytest.raises(ValueError, match="read-only"):
        table.y[0] = 3.0


@pytest.mark.parametrize(
    ("t", "y", "message"),
    [
        ([0, 1], [0], "expected two sequences of one length"),
        ([], [], "expected two sequences of one length"),
        ([[0, 1]], [[0, 1]], "expected two sequences of one length"),
        ([1, 0], [0, 1], "the times must not decrease"),
        ([0, float("nan")], [0, 1], r"t is \[0, nan\]; expected an increasing sequence of finite numbers"),
        ([0, 1], [0, float("inf")], r"y is \[0, inf\]; expected a sequence of finite numbers"),
        ("ab", [0, 1], r"t is 'ab'; expected an increasing sequence of finite numbers"),
    ],
)
def test_wrong_tables(t: Any, y: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        gl.Table(t, y)


@pytest.mark.parametrize(
    ("inputs", "error", "message"),
    [
        ({"torque.ta": 1.0}, NameLookupError, r"no unbound input 'torque\.ta'; did you mean 'torque\.tau'"),
        ({"load.w": 1.0}, NameLookupError, r"no unbound input 'load\.w'; it is bound in the model, or no input"),
        (
            {"torque.tau": "1"},
            ArgumentError,
            r"input torque\.tau is '1'; expected a finite number, a function of time or a gl\.Table",
        ),
        ({"torque.tau": None}, ArgumentError, r"input torque\.tau is None"),
        ({"torque.tau": float("nan")}, ArgumentError, r"input torque\.tau is nan"),
        ({"torque.tau": True}, ArgumentError, r"input torque\.tau is True"),
        ({"torque.tau": np.ones(3)}, ArgumentError, r"input torque\.tau is array"),
        ({"torque.tau": gl.sin(gl.time)}, ArgumentError, r"input torque\.tau is sin\(time\)"),
    ],
)
def test_wrong_inputs(inputs: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        SYSTEM.simulate(1.0, inputs=inputs)


def boom(t: float) -> float:
    raise ValueError("no torque")


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (boom, r"the function boom of the input torque\.tau, called with t = 0 s, raised ValueError: no torque"),
        (lambda: 1.0, "with t = 0 s, raised TypeError: .*takes 0 positional arguments"),
        (lambda t: "x", "with t = 0 s, returned 'x'; expected a number"),
        (lambda t: None, "with t = 0 s, returned None; expected a number"),
        (lambda t: 1j, "with t = 0 s, returned 1j; expected a number"),
        (lambda t: np.array([1.0, 2.0]), r"with t = 0 s, returned array\(\[1\., 2\.\]\); expected a number"),
        (lambda t: float("nan"), "with t = 0 s, returned nan; expected a finite number"),
    ],
)
def test_functions_that_fail_at_the_start(function: Callable[..., Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        run(function)


def late(value: Callable[[], float]) -> Callable[[float], float]:
    return lambda t: 1.0 if t < 1.0 else value()


def interrupt() -> float:
    raise KeyboardInterrupt


@pytest.mark.parametrize("method", ["ida", "rk"])
def test_an_interrupt_in_a_function_ends_the_run(method: str) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(late(interrupt), method=method)


@pytest.mark.parametrize("method", ["ida", "rk"])
def test_an_interrupt_between_python_and_the_function_ends_the_run(method: str) -> None:
    """As it often comes: Python reports and forgets it there."""
    unraisable = type("Unraisable", (), {"exc_value": KeyboardInterrupt()})
    with pytest.raises(KeyboardInterrupt):
        run(late(lambda: sys.unraisablehook(unraisable) or 1.0), method=method)


@pytest.mark.parametrize("method", ["ida", "rk"])
@pytest.mark.parametrize(
    ("value", "what"),
    [
        (lambda: boom(0.0), "raised ValueError: no torque"),
        (lambda: float("nan"), "returned nan"),
        (lambda: -np.inf, "returned -inf"),
    ],
)
def test_functions_that_fail_later_are_named_with_input_and_time(method: str, value: Callable[[], float], what: str) -> None:
    with pytest.raises(ArgumentError, match=rf"<lambda> of the input torque\.tau, called with t = [12]\.\d* s, {what}"):
        run(late(value), method=method)


def test_exact_needs_inputs_that_it_knows() -> None:
    with pytest.raises(
        ArgumentError, match="method='exact' needs a linear time-invariant scene: an input is a Python function"
    ):
        run(lambda t: 1.0, method="exact")
