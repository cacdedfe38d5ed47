"""Quasipolynomials: sums of t**k exp(lambda t) with complex lambda, the solutions of linear time-invariant systems.

A signal is stored as ``{lambda: [c_0, c_1, ...]}``; its value at local time s = t - origin is the sum of c_k s**k exp(lambda s). Sines
and cosines are pairs of conjugate rates. Local time keeps the coefficients well scaled however late an interval begins.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from gearlib.language.expressions import time

TIME: Any = time

Signal = dict[complex, list[complex]]

MAX_DEGREE = 40  # of a polynomial factor: beyond it s**k/k! spans more orders of magnitude than a double, on any interval
MAX_RATES = 200  # of one signal: sin(t)**n has n + 1 of them
SAME_RATE = 8.0 * 2.0**-52  # rates that differ only by rounding are merged
OPPOSITE = 64.0 * 2.0**-52  # a sum of rates that is less than this part of them is rounding, which powers and products gather


class OutsideClassError(Exception):
    """An expression that is not a quasipolynomial; the message says why."""


def add(first: Signal, second: Signal) -> Signal:
    """The sum of two signals.

    >>> add({0j: [1.0]}, {0j: [2.0, 3.0], 1j: [1.0]})
    {0j: [3.0, 3.0], 1j: [1.0]}
    """
    total = {rate: list(c) for rate, c in first.items()}
    for rate, c in second.items():
        rate = known_rate(rate, total)
        old = total.get(rate, [])
        long, short = (old, c) if len(old) >= len(c) else (c, old)
        total[rate] = [a + b for a, b in zip(long, short, strict=False)] + long[len(short) :]
    return _checked(total)


def known_rate(rate: complex, rates: Signal) -> complex:
    """The member of ``rates`` that equals ``rate`` up to rounding, or ``rate`` itself."""
    if rate in rates:
        return rate
    for other in rates:
        if abs(other - rate) <= SAME_RATE * min(abs(other), abs(rate)):
            return other
    return rate


def multiply(first: Signal, second: Signal) -> Signal:
    """The product of two signals.

    >>> multiply({1j: [1.0, 2.0]}, {2j: [3.0]})
    {3j: [3.0, 6.0]}
    """
    total: Signal = {}
    for r1, c1 in first.items():
        for r2, c2 in second.items():
            product = [0j] * (len(c1) + len(c2) - 1)
            for i, a in enumerate(c1):
                for j, b in enumerate(c2):
                    product[i + j] += a * b
            if not any(p.imag for p in product):
                product = [p.real for p in product]
            total = add(total, {complex(_sum_of(r1.real, r2.real), _sum_of(r1.imag, r2.imag)): product})
    return _checked(total)


def _sum_of(a: float, b: float) -> float:
    """The sum of two parts of rates; 0 where it is rounding: opposite rates make a constant, which is not half a slow sinusoid.

    >>> _sum_of(0.1 + 0.2, -0.3), _sum_of(0.1, 0.2) > 0.3
    (0.0, True)
    """
    total = a + b
    return 0.0 if abs(total) <= OPPOSITE * max(abs(a), abs(b)) else total


def value(signal: Signal, s: float) -> float:
    """The value at local time ``s``.

    >>> value({0j: [1.0, 2.0]}, 3.0)
    7.0
    """
    total = 0j
    for rate, c in signal.items():
        polynomial = 0j
        for a in reversed(c):
            polynomial = polynomial * s + a
        total += polynomial * cmath.exp(rate * s)
    return total.real


def mean_value(signal: Signal) -> float | None:
    """The mean of a constant with sinusoids; None for all other signals, which have none.

    >>> mean_value({0j: [2.0], 1j: [0.5], -1j: [0.5]}), mean_value({0j: [2.0, 1.0]})
    (2.0, None)
    """
    if any(rate.real != 0 or len(c) > 1 for rate, c in signal.items()):
        return None
    return signal.get(0j, [0j])[0].real


def _checked(signal: Signal) -> Signal:
    """``signal`` without zero terms; refused if it is too long or not finite."""
    tidy: Signal = {}
    for rate, c in signal.items():
        while c and c[-1] == 0:
            c = c[:-1]
        if c:
            tidy[rate] = c
        if len(c) > MAX_DEGREE + 1:
            raise OutsideClassError(f"it holds a power of time above {MAX_DEGREE}")
        if not (cmath.isfinite(rate) and all(cmath.isfinite(a) for a in c)):
            raise OutsideClassError("it leaves the range of floating-point numbers")
    if len(tidy) > MAX_RATES:
        raise OutsideClassError(f"it holds more than {MAX_RATES} different frequencies and rates")
    return tidy


def parse(expression: Any, origin: float, probe: float | None = None) -> Signal:
    """A sympy expression of time as a signal in the local time s = time - ``origin``.

    Parameters
    ----------
    expression : sympy.Expr
        In the symbol ``time`` alone.
    origin : float
        Time (s) at which local time is zero.
    probe : float, optional
        Local time (s) at which Piecewise, Abs, sign, Heaviside, Max and Min select their branch. Without it they are refused.

    Raises
    ------
    OutsideClassError
        The message gives the reason.

    Examples
    --------
    >>> parse(3 * TIME**2 + 1, 1.0)
    {0j: [4.0, 6.0, 3.0]}
    """
    if expression == TIME:
        return _checked({0j: [origin, 1.0]})
    if expression.func in BRANCHING and probe is not None:
        return parse(_branch(expression, origin, probe), origin, probe)
    if not expression.free_symbols:
        return _checked({0j: [_number(expression)]})
    strangers = sorted(str(s) for s in expression.free_symbols if s != TIME)
    if strangers:
        raise OutsideClassError(f"it depends on {', '.join(strangers)}, not on time alone")
    rule = _RULES.get(expression.func)
    if rule is not None:
        return rule(expression, origin, probe)
    if expression.func in BRANCHING:
        raise OutsideClassError(f"{expression} has branches of its own")
    raise OutsideClassError(f"{expression} is not a sum of products of polynomials, sines, cosines and exponentials of time")


def _number(expression: Any) -> float:
    try:
        return float(expression)
    except (TypeError, ValueError, OverflowError):
        raise OutsideClassError(f"{expression} is not a real number") from None


def _sum(expression: Any, origin: float, probe: float | None) -> Signal:
    total: Signal = {}
    for term in expression.args:
        total = add(total, parse(term, origin, probe))
    return total


def _product(expression: Any, origin: float, probe: float | None) -> Signal:
    scale, signals = 1.0, []
    for factor in expression.args:
        if factor.free_symbols:
            signals.append(parse(factor, origin, probe))
        else:
            scale *= _number(factor)
    total: Signal = {0j: [scale]}
    for signal in signals:
        total = multiply(total, signal)
    return total


def _power(expression: Any, origin: float, probe: float | None) -> Signal:
    base, exponent = expression.args
    if exponent.is_Integer and exponent > 0:
        if exponent > MAX_DEGREE:
            raise OutsideClassError(f"{expression} is a power above {MAX_DEGREE}")
        signal, total = parse(base, origin, probe), Signal({0j: [1.0]})
        for digit in f"{int(exponent):b}":  # by squares, so that rounding of the rates does not add up
            total = multiply(total, total)
            total = multiply(total, signal) if digit == "1" else total
        return total
    if not base.free_symbols and _number(base) > 0.0:
        start, slope = _affine(exponent, expression, origin, probe)
        log = math.log(_number(base))
        return _checked({complex(slope * log): [_exponential(start * log, expression)]})
    if not exponent.free_symbols and _number(exponent) < 0:
        raise OutsideClassError(f"{expression} divides by a function of time")
    raise OutsideClassError(f"{expression} is not a whole, positive power")


def _affine(argument: Any, expression: Any, origin: float, probe: float | None) -> tuple[float, float]:
    """Value at the origin and slope of an argument, which must be a + b * time."""
    signal = parse(argument, origin, probe)
    coefficients = signal.get(0j, [0.0])
    if any(rate != 0 for rate in signal) or len(coefficients) > 2:
        raise OutsideClassError(f"the argument of {expression} is not linear in time")
    a, b = (*coefficients, 0.0)[:2]
    return a.real, b.real


def _exponential(exponent: float, expression: Any) -> float:
    try:
        return math.exp(exponent)
    except OverflowError:
        raise OutsideClassError(f"{expression} leaves the range of floating-point numbers") from None


def _sine(expression: Any, origin: float, probe: float | None) -> Signal:
    phase, omega = _affine(expression.args[0], expression, origin, probe)
    if expression.func is sympy.cos:
        half = 0.5 * complex(math.cos(phase), math.sin(phase))
    else:  # sin(x) = Re(-i exp(i x))
        half = 0.5 * complex(math.sin(phase), -math.cos(phase))
    return add({complex(0.0, omega): [half]}, {complex(0.0, -omega): [half.conjugate()]})


def _growth(expression: Any, origin: float, probe: float | None) -> Signal:
    start, slope = _affine(expression.args[0], expression, origin, probe)
    up: Signal = {complex(slope): [_exponential(start, expression)]}
    if expression.func is sympy.exp:
        return _checked(up)
    sign = 1.0 if expression.func is sympy.cosh else -1.0
    down: Signal = {complex(-slope): [sign * _exponential(-start, expression)]}
    return multiply({0j: [0.5]}, add(up, down))


_RULES: dict[Any, Callable[[Any, float, float | None], Signal]] = {
    sympy.Add: _sum, sympy.Mul: _product, sympy.Pow: _power, sympy.sin: _sine, sympy.cos: _sine,
    sympy.exp: _growth, sympy.sinh: _growth, sympy.cosh: _growth,
}  # fmt: skip

BRANCHING = frozenset({sympy.Piecewise, sympy.Abs, sympy.sign, sympy.Heaviside, sympy.Max, sympy.Min})


def _branch(expression: Any, origin: float, probe: float) -> Any:
    """The smooth expression that a branching one equals near the probe."""
    if expression.func is sympy.Piecewise:
        ladder = _ladder(expression)
        if ladder is not None:
            return expression.args[int(np.searchsorted(ladder, origin + probe))].expr
        for branch, condition in expression.args:
            if holds(condition, origin, probe):
                return branch
        raise OutsideClassError(f"{expression} has no value at time = {origin + probe:g}")
    if expression.func in (sympy.Max, sympy.Min):
        chosen = max if expression.func is sympy.Max else min
        return chosen(expression.args, key=lambda a: value(parse(a, origin, probe), probe))
    argument, *_ = expression.args
    positive = value(parse(argument, origin, probe), probe) > 0
    if expression.func is sympy.Abs:
        return argument if positive else -argument
    if expression.func is sympy.sign:
        return sympy.Integer(1 if positive else -1)
    return sympy.Integer(1 if positive else 0)


@lru_cache(maxsize=64)
def _ladder(expression: Any) -> Any:
    """The increasing a, b, ... of a Piecewise with conditions time < a, time < b, ..., True (as tables have); None if it is another."""
    *rungs, last = [condition for _, condition in expression.args]
    rising = all(isinstance(r, sympy.Lt | sympy.Le) and r.lhs == TIME and r.rhs.is_number for r in rungs)
    if last != sympy.true or not rising:
        return None
    ladder = np.array([_number(rung.rhs) for rung in rungs])
    return ladder if (np.diff(ladder) >= 0).all() else None


def holds(condition: Any, origin: float, probe: float) -> bool:
    """Whether a condition on time holds at local time ``probe``.

    >>> holds((TIME > 1) & (TIME < 2), origin=1.0, probe=0.5)
    True
    """
    if condition in (sympy.true, sympy.false):
        return bool(condition)
    if condition.is_Relational:
        difference = add(parse(condition.lhs, origin, probe), multiply({0j: [-1.0]}, parse(condition.rhs, origin, probe)))
        if isinstance(condition, sympy.Eq | sympy.Ne):
            return (not difference) is isinstance(condition, sympy.Eq)  # equal at isolated instants only, or always
        side = value(difference, probe)
        if isinstance(condition, sympy.Gt | sympy.Ge):
            return side > 0 or (side == 0 and isinstance(condition, sympy.Ge))
        return side < 0 or (side == 0 and isinstance(condition, sympy.Le))
    parts = [holds(part, origin, probe) for part in condition.args]
    if isinstance(condition, sympy.And):
        return all(parts)
    if isinstance(condition, sympy.Or):
        return any(parts)
    if isinstance(condition, sympy.Not):
        return not parts[0]
    if isinstance(condition, sympy.Xor):
        return sum(parts) % 2 == 1
    raise OutsideClassError(f"the condition {condition} is not made of relations, And, Or, Not")
