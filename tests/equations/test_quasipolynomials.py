"""Sums of polynomials times exponentials, against the functions that they stand for."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
import sympy
from sympy import And, Eq, Ge, Gt, Le, Lt, Ne, Not, Or, Xor

from gearlib.equations.quasipolynomials import (
    MAX_DEGREE,
    MAX_RATES,
    TIME,
    OutsideClassError,
    Signal,
    add,
    holds,
    known_rate,
    mean_value,
    multiply,
    parse,
    value,
)

t = TIME


def direct(signal: Signal, s: float) -> complex:
    return sum((c * s**k * cmath.exp(rate * s) for rate, cs in signal.items() for k, c in enumerate(cs)), 0j)


def random_signal(rng: np.random.Generator) -> Signal:
    rates = rng.choice([0j, 1j, -1j, -0.5 + 0j, 2.0 + 1j], int(rng.integers(1, 4)), replace=False)
    return {complex(rate): rng.normal(size=int(rng.integers(1, 4))).tolist() for rate in rates}


@pytest.mark.parametrize("seed", range(20))
def test_sums_products_and_values(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other, s = random_signal(rng), random_signal(rng), float(rng.uniform(-2, 2))
    assert value(one, s) == pytest.approx(direct(one, s).real, rel=1e-12)
    assert direct(add(one, other), s) == pytest.approx(direct(one, s) + direct(other, s), rel=1e-12)
    assert direct(multiply(one, other), s) == pytest.approx(direct(one, s) * direct(other, s), rel=1e-12)
    difference = add(one, multiply({0j: [-1.0]}, one))
    assert difference == {}, "what cancels leaves no term"


def test_rates_that_differ_by_rounding_are_one() -> None:
    rates: Signal = {3.0 + 1j: [1.0], 0j: [1.0]}
    assert known_rate(3.0 * (1 + 4e-16) + 1j, rates) == 3.0 + 1j
    assert known_rate(3.0 * (1 + 4e-15) + 1j, rates) != 3.0 + 1j
    assert known_rate(1e-30 + 0j, rates) == 1e-30, "a slow rate is not zero"
    assert [known_rate(1 + k * 2.0**-52, {1.0 + 0j: [1.0]}) == 1.0 for k in (7, 8, 9)] == [True, True, False]


@pytest.mark.parametrize("origin", [0.0, -1.5, 7.0])
@pytest.mark.parametrize(
    "expression",
    [
        t, sympy.Integer(3), 2 - 3 * t + t**3, sympy.sin(2 * t + 1), sympy.cos(0.5 - 3 * t), sympy.exp(1 - t / 2),
        sympy.sinh(t) - 2 * sympy.cosh(t / 3), sympy.cos((1 + t) * (1 - t) + t**2), 2 + sympy.cos((1 + t) * (1 - t) + t**2 - 1),
        sympy.exp((2 + t) * (2 - t) + t**2 - 5),
        3 ** (1 + t / 4), sympy.Float(0.25) ** (t / 2 - 1),
        sympy.pi * t * sympy.sin(t) ** 2 * sympy.exp(-t / 5), (1 + sympy.cos(t)) ** 3, t**4 * sympy.Float(0.25),
    ],
)  # fmt: skip
def test_local_time_begins_at_the_origin(expression: Any, origin: float) -> None:
    signal = parse(expression, origin)
    for s in (0.0, 0.7, -1.1):
        assert value(signal, s) == pytest.approx(float(expression.subs(t, origin + s)), rel=1e-11, abs=1e-11)
    assert all(rate.conjugate() in signal for rate in signal), "a real signal"


@pytest.mark.parametrize(
    "expression",
    [
        sympy.Abs(t - 1), sympy.sign(t - 1), sympy.Heaviside(t - 1), sympy.Max(t, 2 - t, sympy.Rational(1, 2) * t + 1),
        sympy.Min(t, 2 - t, 3),
        sympy.Piecewise((t, t < 0.5), (2, t < 1.5), (3 - t, True)), sympy.Piecewise((5, (t > 0.5) & (t < 1.5)), (t, True)),
        sympy.Piecewise((1, t <= 0.25), (2, t <= 1.75), (3, True)), sympy.Piecewise((1, t > 1), (sympy.sin(t), True)),
        sympy.Piecewise((1, sympy.sin(t) < 0.5), (t, True)),
        sympy.Piecewise((1, t < 1.5), (2, t < 0.5), (t, True)),  # the second branch is never taken
    ],
)  # fmt: skip
@pytest.mark.parametrize("origin", [0.0, -2.0])
def test_branches_are_those_at_the_probe(expression: Any, origin: float) -> None:
    for at in (0.2, 0.8, 1.2, 1.8, 4.0):
        signal = parse(expression, origin, at - origin)
        for near in (at - 1e-3, at + 1e-3):  # a smooth function, not a value
            assert value(signal, near - origin) == pytest.approx(float(expression.subs(t, near)), rel=1e-12)
    with pytest.raises(OutsideClassError, match="has branches of its own"):
        parse(expression, origin)


@pytest.mark.parametrize(
    ("condition", "below", "at", "above"),
    [
        (Lt(t, 1), True, False, False), (Le(t, 1), True, True, False), (Gt(t, 1), False, False, True), (Ge(t, 1), False, True, True),
        (Eq(t, 1), False, False, False), (Ne(t, 1), True, True, True), (sympy.true, True, True, True), (sympy.false, False, False, False),
        (And(t > 0.5, t < 1), True, False, False), (Or(t < 0.5, t > 1), False, False, True),
        (Not(And(t < 1, t > 0.5)), False, True, True),
        (Xor(t > 0.5, t > 1), True, True, False), (Xor(t > 0.5, t < 5, t > 1, evaluate=False), False, False, True),
    ],
)  # fmt: skip
def test_conditions_on_either_side_of_a_limit_and_at_it(condition: Any, below: bool, at: bool, above: bool) -> None:
    for origin in (0.0, 3.0):
        assert [holds(condition, origin, time - origin) for time in (0.75, 1.0, 1.25)] == [below, at, above]


def test_equal_for_ever_is_equal() -> None:
    same = Eq(sympy.sin(t), sympy.sin(t) + 0 * t, evaluate=False)
    assert holds(same, 0.0, 0.3)
    assert not holds(Ne(sympy.sin(t), sympy.sin(t), evaluate=False), 0.0, 0.3)


def test_limits_of_powers_and_of_the_number_of_rates() -> None:
    assert len(parse(t**MAX_DEGREE, 0.0)[0j]) == MAX_DEGREE + 1
    assert len(multiply(parse(t**20, 0.0), parse(t ** (MAX_DEGREE - 20), 0.0))[0j]) == MAX_DEGREE + 1
    for wrong in (lambda: parse(t ** (MAX_DEGREE + 1), 0.0), lambda: multiply(parse(t**20, 0.0), parse(t**21, 0.0))):
        with pytest.raises(OutsideClassError, match=f"above {MAX_DEGREE}"):
            wrong()
    full: Signal = {complex(k): [1.0] for k in range(MAX_RATES)}
    assert len(add(full, {0j: [1.0]})) == MAX_RATES
    with pytest.raises(OutsideClassError, match=f"more than {MAX_RATES} different"):
        add(full, {complex(MAX_RATES): [1.0]})


@pytest.mark.parametrize(
    ("expression", "reason"),
    [
        (t ** sympy.Rational(1, 2), "is not a whole, positive power"), (t**-1, "divides by a function of time"),
        ((-2) ** t, "is not a whole, positive power"), (sympy.Integer(0) ** t, "is not a whole, positive power"),
        (sympy.sin(t + t**2), r"the argument of sin\(.*\) is not linear in time"),
        (sympy.exp(sympy.sin(t)), "is not linear in time"), (sympy.exp(1000 + t), "leaves the range"),
        (sympy.I * t, "I is not a real number"),
        (t * sympy.Symbol("b") + sympy.Symbol("a"), "it depends on a, b, not on time alone"), (sympy.atan(t), "is not a sum of products"),
        (sympy.oo * t, "leaves the range of floating-point numbers"),
    ],
)  # fmt: skip
def test_reasons(expression: Any, reason: str) -> None:
    with pytest.raises(OutsideClassError, match=reason):
        parse(expression, 0.0)


def test_a_gap_between_branches_is_told_by_its_time() -> None:
    gap = sympy.Piecewise((1, t < 1), (2, t > 2))
    assert [parse(gap, 0.5, s) for s in (0.25, 2.0)] == [{0j: [1.0]}, {0j: [2.0]}]
    with pytest.raises(OutsideClassError, match=r"has no value at time = 1\.75$"):
        parse(gap, 0.5, 1.25)


@pytest.mark.parametrize("kept", [[1.0, 0.0, 3.0], [0.0, 2.0], [0.0, 0.0, 5.0], [7.0]])
@pytest.mark.parametrize("zeros", [0, 1, 2])
def test_zeros_behind_the_last_coefficient_are_cut_and_no_others(kept: list[float], zeros: int) -> None:
    assert add({2j: [*kept, *[0.0] * zeros]}, {}) == {2j: kept}
    assert add({}, {2j: [*kept, *[0.0] * zeros]}) == {2j: kept}


def test_what_cancels_is_cut() -> None:
    assert add({1j: [1.0, 2.0, 3.0]}, {1j: [4.0, -2.0, -3.0]}) == {1j: [5.0]}
    assert multiply({1j: [0.0, 2.0]}, {0j: [3.0, 0.0, 1.0], 1j: [4.0]}) == {1j: [0.0, 6.0, 0.0, 2.0], 2j: [0.0, 8.0]}


def is_refused(make: Any) -> bool:
    try:
        make()
    except OutsideClassError:
        return True
    return False


def test_a_limit_itself_is_allowed() -> None:
    degrees = range(MAX_DEGREE - 3, MAX_DEGREE + 3)
    beyond = [degree > MAX_DEGREE for degree in degrees]
    assert [is_refused(lambda n=n: parse(t**n, 0.0)) for n in degrees] == beyond
    assert [is_refused(lambda n=n: add({0j: [1.0] * (n + 1)}, {})) for n in degrees] == beyond
    counts = range(MAX_RATES - 2, MAX_RATES + 3)
    full: list[Signal] = [{complex(k): [1.0] for k in range(count)} for count in counts]
    assert [is_refused(lambda s=s: add(s, {})) for s in full] == [count > MAX_RATES for count in counts]


@pytest.mark.parametrize("scale", [1e-6, 1.0, 3e4])
def test_what_is_the_same_rate_depends_on_its_size(scale: float) -> None:
    rate = scale * (3.0 + 1j)
    for part in (1.0, 1j):
        assert known_rate(rate + 4e-16 * scale * part, {rate: [1.0]}) == rate
        assert known_rate(rate + 4e-14 * scale * part, {rate: [1.0]}) != rate
    both = add({rate: [1.0, 2.0]}, {rate + 4e-16 * scale: [3.0], -rate: [1.0]})
    assert both == {rate: [4.0, 2.0], -rate: [1.0]}


@pytest.mark.parametrize(
    ("signal", "mean"),
    [
        ({0j: [2.5]}, 2.5), ({0j: [-1.0], 3j: [0.5 + 1j], -3j: [0.5 - 1j]}, -1.0), ({3j: [0.5], -3j: [0.5]}, 0.0), ({}, 0.0),
        ({0j: [2.0, 1.0]}, None), ({0j: [2.0], 3j: [0.5, 1.0], -3j: [0.5, 1.0]}, None), ({0j: [2.0], -0.5 + 0j: [1.0]}, None),
        ({0.1 + 3j: [0.5], 0.1 - 3j: [0.5]}, None),
    ],
)  # fmt: skip
def test_only_constants_and_sinusoids_have_a_mean(signal: Signal, mean: float | None) -> None:
    """It is the average over the whole periods of a long time."""
    assert mean_value(signal) == mean
    if mean is not None:
        instants = np.arange(60) * (2 * np.pi / 3 / 60)
        assert np.mean([value(signal, s) for s in instants]) == pytest.approx(mean, abs=1e-14)


@pytest.mark.parametrize("expression", [sympy.Abs(t - 1), sympy.Max(t, 1), sympy.Piecewise((t, t < 1), (2, True))])
def test_branches_need_a_probe_and_the_smooth_does_not(expression: Any) -> None:
    assert not is_refused(lambda: parse(expression, 0.0, 0.5))
    assert not is_refused(lambda: parse(3 * t + 1 - sympy.sin(t), 0.0, 0.5))
    assert is_refused(lambda: parse(expression, 0.0))


@pytest.mark.parametrize("omega", [1.0, 3.7, 0.1, 100 * np.pi, 0.0473790230035046])
def test_the_mean_of_powers_and_products_of_sinusoids_is_one_constant(omega: float) -> None:
    """Opposite frequencies make the rate 0, however their sums are rounded: else half of the mean is a sinusoid of 1e-14 rad/s."""
    for n in (2, 6, 7, 20, 26, 32, 40):
        signal = parse(sympy.sin(omega * t) ** n, 0.0)
        assert mean_value(signal) == pytest.approx(math.comb(n, n // 2) / 2**n if n % 2 == 0 else 0.0, abs=1e-13)
        assert min((abs(rate) for rate in signal if rate), default=1.0) > 0.5 * omega
    three = sympy.sin(0.1 * omega * t) * sympy.sin(0.2 * omega * t) * sympy.cos(0.3 * omega * t)
    assert mean_value(parse(three, 0.0)) == pytest.approx(-0.25, rel=1e-12)
