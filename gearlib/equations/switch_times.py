"""Switching times of relations that depend on time only, so that integrators step to them exactly."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations
from types import MappingProxyType
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.equations.kernel import Kernel, array_function
from gearlib.equations.quasipolynomials import TIME, OutsideClassError, Signal, add, multiply, parse
from gearlib.equations.template import memoised
from gearlib.errors import ArgumentError
from gearlib.language.expressions import SquareWave

Floats = NDArray[np.float64]

MAX_SWITCHES = 100_000  # of one relation
MOST_INSTANTS = 10_000_000  # of one sample


def times_of_breakpoints(expression: Any, t0: float, t_end: float, given: Mapping[Any, float] = MappingProxyType({})) -> Floats:
    """The sorted times inside (t0, t_end) at which relations on time in an expression switch.

    Relations in Piecewise and Boolean expressions, and the arguments of Abs, sign, Heaviside, Max and Min are examined. Relations
    between polynomials of time, between a sinusoid and a constant, between an exponential and a constant, and between products of these
    and zero are solved. Relations that contain another symbol (a state) are skipped: they are not functions of time.

    Parameters
    ----------
    expression : sympy.Basic
        Expression or condition.
    t0, t_end : float
        Interval (s), both ends excluded.
    given : mapping
        Numbers of the symbols other than time.

    Returns
    -------
    ndarray
        Times (s); those that differ only by rounding are merged. Where rounding hides the sign of a difference just after its zero,
        the time at which it no longer does.

    Raises
    ------
    ArgumentError
        A relation depends on time alone, but its switching times have no closed form.

    Examples
    --------
    >>> import sympy
    >>> from gearlib.equations.quasipolynomials import TIME
    >>> times_of_breakpoints(sympy.Piecewise((1, TIME < 0.5), (2, sympy.sin(sympy.pi * TIME) > 0), (3, True)), 0.0, 2.5)
    array([0.5, 1. , 2. ])
    """
    try:
        return switch_times(expression, t0, t_end, given)
    except OutsideClassError as error:
        raise ArgumentError(f"cannot tell when {expression} switches between t = {t0:g} and {t_end:g} s: {error}") from None


@memoised
def has_known_zeros(kernel: Kernel) -> bool:
    """Whether the zeros of a function of time and parameters follow from a formula, whatever the parameters are."""
    values: dict[Any, Any] = {sympy.Symbol(f"x{c}", real=True): sympy.S.Zero for c in kernel.columns}
    values |= {sympy.Symbol(f"p{p}", real=True): sympy.Float(1.5 + math.sin(3 * p * p)) for p in kernel.parameters}
    try:
        switch_times(kernel.expression.xreplace({sympy.Symbol("t", real=True): TIME} | values) > 0, 0.0, 1e-6)
    except OutsideClassError:
        return False
    return True


def switch_times(expression: Any, t0: float, t_end: float, given: Mapping[Any, float] = MappingProxyType({})) -> Floats:
    """As `times_of_breakpoints`, but raises OutsideClassError."""
    found: list[Floats] = []
    numbers = {symbol: sympy.Float(number, 17) for symbol, number in given.items()}
    for pair in _differences(expression, {TIME, *given}):
        first, second = (side.xreplace(numbers) for side in pair)
        if first.has(TIME) or second.has(TIME):
            roots = np.unique(_roots((first, second), t0, t_end))
            if not isinstance(first, SquareWave):
                later = np.append(roots, math.inf)[np.searchsorted(roots, roots + rounding(t0, t_end), side="right")]
                roots = past_rounding(sympy.Add(pair[0], -pair[1], evaluate=False), roots, given, later)
            found.append(roots)
    return distinct(np.concatenate([np.empty(0), *found]), t0, t_end)


def past_rounding(difference: Any, roots: Floats, given: Mapping[Any, Any], later: Floats | float = math.inf) -> Floats:
    """Zeros of a function of time, moved to where its sign is not hidden by rounding: conditions are evaluated just after (`right_hand`).

    ``given`` has the numbers of the other symbols, also arrays of them, for each root. None is moved beyond what comes ``later``, nor
    where the sign is the same on both sides.
    """
    if is_exact(difference):
        return roots
    way, scale = np.zeros(len(roots)), np.maximum(np.abs(roots), 1e-3)

    def told(times: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        number, error = with_error(difference, {**given, TIME: times})
        return np.sign(number), np.abs(number) > 2.0**-51 * error

    with np.errstate(all="ignore"):
        for k in range(48):
            after, seen = told(roots + way + 1e-12 * scale)
            if seen.all():
                break
            way = np.where(seen, way, 2.0 ** (k - 48) * scale)
        same = told(roots - way - 1e-12 * scale)[0] == after
    return np.where(seen & ~same & (roots + way < later), roots + way, roots)


def is_exact(difference: Any) -> bool:
    """Whether rounding does not hide the sign of a difference: that of two symbols or numbers (Sterbenz), or of one and 0."""
    return _plain(difference) or bool(difference.is_Add and len(difference.args) == 2 and all(map(_plain, difference.args)))


def _plain(term: Any) -> bool:
    """Whether a term is a symbol or a number, or the negative of a symbol."""
    return bool(term.is_Atom or (term.is_Mul and term.args[0] == -1 and term.args[1].is_Atom and len(term.args) == 2))


NO_ERROR = 0.0
_SLOPES = {sympy.exp: sympy.exp, sympy.sinh: sympy.cosh, sympy.cosh: sympy.sinh}  # of the others: 1


def _applied(function: Any, *values: Any) -> Any:
    """A function of numbers or arrays, or of expressions."""
    if any(isinstance(value, sympy.Basic) for value in values):
        return function(*values)
    symbols = sympy.symbols(f"a:{len(values)}", real=True)
    return array_function(symbols, function(*symbols))(*values)


def with_error(expression: Any, numbers: Mapping[Any, Any]) -> tuple[Any, Any]:
    """Value of an expression, and a bound of its rounding error in units of 2**-53 (running error analysis); as ``numbers``, or symbols."""
    if expression in numbers:
        return numbers[expression], NO_ERROR
    if not expression.args:
        number = float(expression)
        return number, NO_ERROR if expression.is_Integer or expression.is_Float else abs(number)
    parts = [with_error(part, numbers) for part in expression.args]
    if expression.is_Add:
        number = sum(part for part, _ in parts)
        error = sum(e for _, e in parts) + (len(parts) - 2) * sum(abs(part) for part, _ in parts) + abs(number)
    elif expression.is_Mul:
        number, error = parts[0]
        for factor, e in parts[1:]:
            number, error = number * factor, abs(number) * e + abs(factor) * error + abs(number * factor)
    elif expression.is_Pow:
        (base, e), (exponent, f) = parts
        number = base**exponent
        error = abs(number)
        if e is not NO_ERROR:
            error = error + abs(exponent * base ** (exponent - 1)) * e
        if f is not NO_ERROR:
            error = error + abs(number * _applied(sympy.log, abs(base))) * f
    else:
        values, slope = [part for part, _ in parts], 1.0
        number = _applied(expression.func, *values)
        if expression.func in _SLOPES:
            slope = abs(_applied(_SLOPES[expression.func], *values))
        error = abs(number) + slope * sum(e for _, e in parts)
    return number, error


def distinct(times: Floats, t0: float, t_end: float) -> Floats:
    """``times`` inside (t0, t_end), sorted and without duplicates up to rounding."""
    same = rounding(t0, t_end)
    times = np.sort(times[(times > t0 + same) & (times < t_end - same)])
    return times[np.diff(times, prepend=-math.inf) > same]


def rounding(*times: float) -> float:
    """Difference (s) below which two times of the size of ``times`` count as equal."""
    return 8.0 * 2.0**-53 * max(abs(t) for t in times)


def _differences(expression: Any, known: set[Any]) -> list[Any]:
    """Pairs of expressions of known symbols, time among them, whose meetings are the switching times."""
    pairs: list[tuple[Any, Any]] = []
    for node in sympy.preorder_traversal(expression):
        if getattr(node, "is_Relational", False):
            pairs.append((node.lhs, node.rhs))
        elif isinstance(node, sympy.Abs | sympy.sign | sympy.Heaviside):
            pairs.append((node.args[0], sympy.Integer(0)))
        elif isinstance(node, sympy.Max | sympy.Min):
            pairs.extend(combinations(node.args, 2))
    used = {pair: pair[0].free_symbols | pair[1].free_symbols for pair in pairs}
    return [pair for pair, symbols in used.items() if TIME in symbols and symbols <= known]


def _roots(pair: tuple[Any, Any], t0: float, t_end: float) -> list[float]:
    """Zeros of the difference of two expressions of absolute time, in which the zero of time - a is a to the last bit."""
    if isinstance(pair[0], SquareWave) and pair[1] == 0:
        return list(map(float, instants(float(pair[0].args[1]), float(pair[0].args[2]), t0, t_end)))
    if pair[1] == 0 and (pair[0].is_Mul or (pair[0].is_Pow and pair[0].exp.is_integer and pair[0].exp > 0)):
        factors = pair[0].args if pair[0].is_Mul else pair[0].args[:1]  # a multiple root of what is multiplied out is inexact
        return [root for factor in factors if factor.has(TIME) for root in _roots((factor, pair[1]), t0, t_end)]
    signal = add(parse(pair[0], 0.0), multiply({0j: [-1.0]}, parse(pair[1], 0.0)))
    rates = [rate for rate in signal if rate != 0]
    constant = signal.get(0j, [0.0])
    if not rates:
        return _polynomial_roots([c.real for c in constant])
    if len(constant) == 1 and all(len(signal[rate]) == 1 for rate in rates):
        if len(rates) == 1 and rates[0].imag == 0:
            rate, ratio = rates[0].real, -constant[0].real / signal[rates[0]][0].real
            return [math.log(ratio) / rate] if ratio > 0 else []
        if len(rates) == 2 and all(rate.real == 0 for rate in rates):
            return _sinusoid_roots(constant[0].real, signal, t0, t_end)
    raise OutsideClassError(f"the zeros of {pair[0]} - ({pair[1]}) are not known in closed form")


def instants(period: float, offset: float, t0: float, t_end: float) -> Floats:
    """offset + k * period in a closed interval, k = 0, 1, ..., each rounded separately, so that errors do not accumulate.

    >>> instants(0.5, 1.0, 0.0, 2.0)
    array([1. , 1.5, 2. ])
    """
    if not period > 0.0:
        raise OutsideClassError(f"a period is {period:g} s, which is not positive")
    begin = max(t0, offset)
    if begin > t_end:
        return np.empty(0)
    many = (t_end - begin) / period  # infinite if it overflows
    if many > MOST_INSTANTS:
        raise OutsideClassError(f"there are {many:.6g} instants, more than {MOST_INSTANTS}")
    first = math.floor((begin - offset) / period)
    with np.errstate(over="ignore"):  # beyond the interval
        times = offset + period * np.arange(first, first + math.ceil(many) + 4)
    return np.asarray(times[(times >= t0) & (times <= t_end)], float)


def _polynomial_roots(c: list[float]) -> list[float]:
    if len(c) <= 1:
        return []
    if len(c) == 2:
        return [-c[0] / c[1]]
    roots = np.roots(c[::-1])
    # A double root splits into a conjugate pair by sqrt(rounding)
    real = roots.real[np.abs(roots.imag) <= 1e-7 * np.abs(roots)]
    polynomial = np.polynomial.Polynomial(c)
    slopes = polynomial.deriv()
    for _ in range(3):  # eigenvalues of the companion matrix: small roots beside large ones are inaccurate
        with np.errstate(divide="ignore", invalid="ignore"):  # the slope is zero at a double root
            steps = polynomial(real) / slopes(real)
        real = real - np.where(np.abs(steps) <= 1e-3 * np.abs(real), steps, 0.0)
    size = np.polynomial.Polynomial(np.abs(c))(np.abs(real))
    several = (_where_several_meet(polynomial, root, float(terms)) for root, terms in zip(real, size, strict=True))
    return [t if meet is None else meet for t, meet in zip(real.tolist(), several, strict=True)]


def _where_several_meet(polynomial: Any, root: Any, size: float) -> float | None:
    """Just behind an odd number of roots that are one: where terms of some size tell the sign again; None at any other root."""
    noise = 2.0**-46 * size
    for m in (k for k in range(polynomial.degree(), 2, -1) if k % 2):
        derivatives = [polynomial.deriv(k) for k in range(m + 1)]
        t = root
        with np.errstate(all="ignore"):  # where the m-th derivative is zero, what follows is not finite, and no limit holds
            for _ in range(3):
                t = t - derivatives[m - 1](t) / derivatives[m](t)
            way = (noise * math.factorial(m) / abs(derivatives[m](t))) ** (1 / m)  # over which it outgrows rounding
            if abs(t - root) <= 10 * way and all(
                abs(d(t)) * way**k <= noise * math.factorial(k) for k, d in enumerate(derivatives[:m])
            ):
                return float(t + way)
    return None


def _sinusoid_roots(constant: float, signal: Signal, t0: float, t_end: float) -> list[float]:
    """Zeros of constant + amplitude * cos(omega t + phase)."""
    rate = next(rate for rate in signal if rate.imag > 0)
    omega, half = rate.imag, signal[rate][0]
    amplitude, phase = 2.0 * abs(half), math.atan2(half.imag, half.real)
    if abs(constant) > amplitude:
        return []
    if omega * (t_end - t0) > MAX_SWITCHES * math.pi:
        raise OutsideClassError(f"it switches more than {MAX_SWITCHES} times")
    angle = math.acos(-constant / amplitude)
    turns = np.arange(
        math.floor(omega * t0 / math.tau), math.ceil(omega * t_end / math.tau) + 1
    )  # angle - phase: within one turn
    return [t for sign in (1, -1) for t in ((math.tau * turns + sign * angle - phase) / omega).tolist()]
