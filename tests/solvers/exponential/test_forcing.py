"""Inputs of time: recognition, breakpoints, and the linear systems that generate them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from sympy import Abs, And, Heaviside, Max, Min, Ne, Or, Piecewise, cos, cosh, exp, pi, sign, sin, sinh, sqrt, tan

from gearlib.equations.switch_times import times_of_breakpoints
from gearlib.errors import ArgumentError
from gearlib.solvers.exponential.forcing import Forcing, NotExact, recognise

t = sympy.Symbol("time", real=True)

SMOOTH = [
    10 * sin(2 * pi * 5 * t),
    exp(-3 * t) * t**2 * cos(4 * t + 1),
    (1 + t - sin(t)) ** 3,
    2**t - sqrt(2) * sinh(t) + cosh(2 * t + 1),
    sin(3 * t) * cos(3 * t) * sin(5 * t) - 7,
    (t - 4) ** 5 / 3 + sympy.Rational(1, 3),
    sympy.Float(0.0) + t * 0,
]


def known(inputs: list[Any], t0: float = 0.0, t_end: float = 2.0) -> Forcing:
    forcing = recognise(inputs, t0, t_end)
    assert isinstance(forcing, Forcing), forcing
    return forcing


def numeric(expression: Any, times: np.ndarray) -> np.ndarray:
    return np.array([float(expression.subs(t, sympy.Float(float(s), 30)).evalf(25)) for s in times])


def generated(forcing: Forcing, times: np.ndarray) -> np.ndarray:
    """Inputs by the exponential of S from each interval's start: as an integrator makes them."""
    values = []
    for s in times:
        piece = int(np.searchsorted(forcing.breakpoints, s, side="right"))
        exosystem, start = forcing.pieces[piece], forcing.start(piece)
        values.append(exosystem.H @ expm(exosystem.S * (s - start)) @ exosystem.state(0.0))
    return np.array(values)


@pytest.mark.parametrize("expression", SMOOTH)
@pytest.mark.parametrize("t0", [0.0, 3.5])
def test_smooth_inputs_are_generated(expression: Any, t0: float) -> None:
    forcing = known([expression], t0, t0 + 2.0)
    times = np.linspace(t0, t0 + 2.0, 7)
    expected = numeric(sympy.sympify(expression), times)
    size = max(1.0, np.abs(expected).max())
    assert np.abs(forcing(times)[:, 0] - expected).max() < 1e-12 * size
    assert np.abs(generated(forcing, times)[:, 0] - expected).max() < 1e-12 * size


def test_inputs_share_their_frequencies() -> None:
    forcing = known([sin(5 * t), 3 * cos(5 * t + 1), 2 + sin(5 * t), 4 + t])
    assert forcing.pieces[0].S.shape == (4, 4)  # one rotation, 1 and t


def test_rates_that_differ_by_rounding_are_one() -> None:
    assert 0.1 + 0.2 != 0.3
    forcing = known([sin(0.1 * t) * cos(0.2 * t) + sin(0.3 * t), cos(0.3 * t)])
    assert forcing.pieces[0].S.shape == (4, 4)  # 0.1 and 0.3 rad/s
    expected = math.sin(0.17) * math.cos(0.34) + math.sin(0.51)
    assert forcing(np.array([1.7]))[0] == pytest.approx([expected, math.cos(0.51)], rel=1e-14, abs=0)


def test_a_late_interval_keeps_its_digits() -> None:
    forcing = known([Piecewise((0, t < 1e6), ((t - 1000000) ** 6, True))], 0.0, 1e6 + 2.0)
    assert forcing(np.array([1e6 + 0.5]))[0, 0] == pytest.approx(0.5**6, rel=1e-14, abs=0)


BRANCHING = [
    (Piecewise((1, t < 0.5), (2, True)), [0.5]),
    (Piecewise((0, t < 0.5), (t - 0.5, t < 1), (0.5, True)), [0.5, 1.0]),
    (Piecewise((5, And(t >= 0.25, t < 0.75)), (0, True)), [0.25, 0.75]),
    (Piecewise((5, Or(t < 0.25, t > 0.75)), (sin(t), True)), [0.25, 0.75]),
    (Piecewise((5, sympy.Xor(t < 0.75, t > 0.25)), (sin(t), True)), [0.25, 0.75]),
    (Piecewise((1, sin(2 * pi * t) >= 0), (-1, True)), [0.5, 1.0, 1.5]),
    (Piecewise((1, 2 * cos(pi * t) - 1 > 0), (t, True)), [1 / 3, 5 / 3]),
    (Piecewise((1, exp(t) < 2), (t, True)), [math.log(2)]),
    (Piecewise((1, t**2 < 2), (t, True)), [math.sqrt(2)]),
    (Piecewise((1, sympy.Gt(1, 2 * t)), (t, True)), [0.5]),
    (Piecewise((1, Ne(t, 1)), (100, True)), [1.0]),
    (Abs(sin(pi * t)) * t, [1.0]),
    (Heaviside(t - 1) - sign(t - 0.5), [0.5, 1.0]),
    (Max(t, 1, 2 * t - sympy.Rational(3, 2)) + Min(t, 0.5), [0.5, 1.0, 1.25, 1.5]),
]


@pytest.mark.parametrize(("expression", "switches"), BRANCHING)
def test_branches_and_their_breakpoints(expression: Any, switches: list[float]) -> None:
    forcing = known([expression, t])
    assert forcing.breakpoints == pytest.approx(switches, rel=1e-14, abs=0)
    times = np.array([0.1, 0.3, 0.45, 0.6, 0.7, 0.9, 1.1, 1.3, 1.45, 1.6, 1.9])
    assert forcing(times)[:, 0] == pytest.approx(numeric(expression, times), rel=1e-13, abs=0)
    assert generated(forcing, times)[:, 0] == pytest.approx(numeric(expression, times), rel=1e-12, abs=1e-14)
    assert times_of_breakpoints(expression, 0.0, 2.0) == pytest.approx(switches, rel=1e-14, abs=0)


def test_linear_relations_switch_to_the_last_bit() -> None:
    assert known([Piecewise((1, t < 0.7), (0, True))], 0.1).breakpoints.tolist() == [0.7]
    assert times_of_breakpoints((t >= 0.3) | (t < 0.1 + 1e-17) | (t > 0.7), 0.1, 0.7).tolist() == [0.3]  # neither end
    assert times_of_breakpoints((t > 0.3) & (t <= 0.7), 0.1, 0.7).tolist() == [0.3]


def test_switches_of_states_are_passed_over() -> None:
    x = sympy.Symbol("x", real=True)
    assert times_of_breakpoints(Piecewise((1, x > 0), (2, t > x), (x, t > 1), (3, True)), 0.0, 2.0).tolist() == [1.0]


def test_intervals_of_one_form_have_one_matrix() -> None:
    steps = [
        Piecewise(*((float(k * k) + k * t, t < 0.1 * k + 0.1) for k in range(15)), (0, True)),
        Piecewise((1, t < 1), (2 * t, True)),
    ]
    forcing = known(steps)
    assert len(forcing.pieces) == 16
    assert len({piece.key for piece in forcing.pieces}) == 1
    times = np.linspace(0.03, 1.93, 39)
    for k, expression in enumerate(steps):
        assert forcing(times)[:, k] == pytest.approx(numeric(expression, times), rel=1e-12, abs=1e-12)
    assert generated(forcing, times) == pytest.approx(forcing(times), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("expression", "reason"),
    [
        (tan(t), r"input 2, tan\(time\): tan\(time\) is not a sum of products"),
        (sin(t**2), r"the argument of sin\(time\*\*2\) is not linear in time"),
        (sin(sin(t)), r"the argument of sin\(sin\(time\)\) is not linear in time"),
        (1 / (1 + t), "divides by a function of time"),
        (sqrt(t), "is not a whole, positive power"),
        (t * sympy.Symbol("x"), "it depends on x, not on time alone"),
        (sympy.I * t, "is not a real number"),
        (sympy.oo * t, "range of floating-point numbers"),
        (t**41, "is a power above 40"),
        (t**30 * (1 + t) ** 20, "power of time above 40"),
        (exp(800 * t), "range of floating-point numbers before t = 2 s"),
        (exp(800 * t + 800), "range of floating-point numbers"),
        (Piecewise((1, t < 1)), "has no value at time = 1.5"),
        (Piecewise((1, sin(t) > cos(2 * t)), (2, True)), "are not known in closed form"),
        (Piecewise((1, sin(1e9 * t) > 0), (2, True)), "switches more than 100000 times"),
    ],
)
def test_reasons(expression: Any, reason: str) -> None:
    answer = recognise([t, expression], 0.0, 2.0)
    assert isinstance(answer, NotExact)
    assert not answer
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(answer.reason)


def test_unknown_switch_times_are_an_error() -> None:
    with pytest.raises(ArgumentError, match=r"cannot tell when .* switches between t = 0 and 2 s"):
        times_of_breakpoints(t * sin(t) > 0.5, 0.0, 2.0)


numbers = st.floats(-3, 3).map(lambda v: sympy.Float(round(v, 3)))
leaves = st.one_of(
    st.builds(lambda a, b: a * t + b, numbers, numbers), st.builds(lambda a, b: sin(a * t + b), numbers, numbers),
    st.builds(lambda a, b: cos(a * t + b), numbers, numbers), st.builds(lambda a: exp(a * t), numbers), numbers,
)  # fmt: skip
smooth = st.recursive(leaves, lambda e: st.one_of(st.builds(sympy.Add, e, e), st.builds(sympy.Mul, e, e)), max_leaves=5)
branched = st.one_of(smooth, st.builds(lambda a, b, c: Piecewise((a, t < c), (b, True)), smooth, smooth, numbers))


@given(st.lists(branched, min_size=1, max_size=3), st.sampled_from([-2.0, 0.0]))
def test_random_inputs(expressions: list[Any], t0: float) -> None:
    forcing = known(expressions, t0, 2.0)
    times = np.linspace(t0 + 0.0123, 1.987, 5)
    for k, expression in enumerate(expressions):
        expected = numeric(sympy.sympify(expression), times)
        assert np.abs(forcing(times)[:, k] - expected).max() < 1e-11 * max(1.0, np.abs(expected).max())
