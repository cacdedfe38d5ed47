"""Exosystems: linear systems that generate the inputs, so that a forced scene becomes a larger autonomous one.

On each interval between breakpoints u(t) = H s(t - start), s' = S s. Each block of s generates one v(t) = p(t) exp(lambda t), p
a polynomial of degree d, by the chain w_i = (D - lambda)**i v: w_i' = lambda w_i + w_{i+1}, w_{d+1} = 0.

A smooth scene shares the block t**d/d! exp(lambda t) among all inputs. With many intervals each input has its own blocks instead:
intervals of the same form then differ in the start of s only, and share their matrix exponentials.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.equations.quasipolynomials import OutsideClassError, Signal, known_rate, parse
from gearlib.equations.switch_times import distinct, switch_times
from gearlib.solvers.inputs.table import Table

Floats = NDArray[np.float64]
T = TypeVar("T")

# What follows from inputs, times and patterns, for the next runs of a scene with other numbers, see `recent`: a few per pattern, grid of
# times and set of inputs
Known = dict[Any, Any]
MOST_KNOWN = 64

Block = tuple[complex, tuple[complex, ...]]  # rate lambda (1/s, imaginary part >= 0), coefficients of p


@dataclass(frozen=True, eq=False)
class Exosystem:
    """Linear system that generates the inputs on one interval: u = H s, s' = S s."""

    H: Floats  # (inputs, order)
    S: Floats  # (order, order)
    blocks: tuple[Block, ...]

    def state(self, time: float) -> Floats:
        """The state s at local time ``time`` (s), in closed form: w_i = p^(i)(t) exp(lambda t)."""
        parts: list[float] = []
        for rate, p in self.blocks:
            growth = cmath.exp(rate * time)
            for i in range(len(p)):
                w = 0j
                for j in range(len(p) - 1, i - 1, -1):
                    w = w * time + math.perm(j, i) * p[j]
                w *= growth
                parts += [w.real, w.imag] if rate.imag else [w.real]
        return np.array(parts)

    @cached_property
    def key(self) -> bytes:
        """Hash key, equal for exosystems that differ only in their start."""
        return self.H.tobytes() + self.S.tobytes()


@dataclass(frozen=True, eq=False)
class Forcing:
    """All inputs of a scene from t0 to t_end.

    Examples
    --------
    >>> import sympy
    >>> from gearlib.equations.quasipolynomials import TIME
    >>> forcing = recognise([sympy.Piecewise((TIME, TIME < 1), (1, True))], 0.0, 2.0)
    >>> forcing.breakpoints, forcing(np.array([0.5, 1.5]))
    (array([1.]), array([[0.5],
           [1. ]]))
    """

    t0: float
    t_end: float
    breakpoints: Floats  # interior, sorted
    pieces: tuple[Exosystem, ...]  # one more than breakpoints

    def start(self, piece: int) -> float:
        """Time (s) at which a piece begins."""
        return float(self.breakpoints[piece - 1]) if piece else self.t0

    def __call__(self, times: Floats) -> Floats:
        """Inputs (times, inputs) at ``times`` (s); on a breakpoint those of the following interval."""
        pieces = np.searchsorted(self.breakpoints, times, side="right")
        values = [self.pieces[p].H @ self.pieces[p].state(t - self.start(p)) for t, p in zip(times, pieces, strict=True)]
        return np.array(values).reshape(len(times), len(self.pieces[0].H))


@dataclass(frozen=True)
class NotExact:
    """Reason why the inputs are not quasipolynomials."""

    reason: str

    def __bool__(self) -> bool:
        return False


def recognise(u: Sequence[Any], t0: float, t_end: float) -> Forcing | NotExact:
    """Find linear systems that generate given functions of time.

    Parameters
    ----------
    u : sequence of sympy.Expr or Table
        Inputs; expressions are in the symbol ``time``: sums and products of polynomials, sines, cosines and exponentials
        (hyperbolic sines and cosines included) with linear arguments, and Piecewise, Abs, sign, Heaviside, Max, Min of such.
    t0, t_end : float
        Interval (s).

    Returns
    -------
    Forcing or NotExact
        NotExact (false in a condition) names the first input outside the class, with the reason in words.

    Examples
    --------
    >>> import sympy
    >>> from gearlib.equations.quasipolynomials import TIME
    >>> recognise([3 * sympy.sin(2 * TIME)], 0.0, 1.0).pieces[0].S
    array([[ 0., -2.],
           [ 2.,  0.]])
    >>> print(recognise([sympy.tanh(TIME)], 0.0, 1.0).reason)
    input 1, tanh(time): tanh(time) is not a sum of products of polynomials, sines, cosines and exponentials of time
    """
    t0, t_end = float(t0), float(t_end)
    if not (math.isfinite(t0) and math.isfinite(t_end)):
        return NotExact(f"the interval from {t0:g} to {t_end:g} s is not finite")
    inputs = [x if isinstance(x, Table) else sympy.sympify(x) for x in u]
    try:
        switches = _each(inputs, lambda x: x.t if isinstance(x, Table) else switch_times(x, t0, t_end))
        breakpoints = distinct(np.concatenate([np.empty(0), *switches]), t0, t_end)
        edges = [t0, *breakpoints.tolist(), t_end]
        signals = [_each(inputs, partial(_signal, origin=a, probe=0.5 * (b - a))) for a, b in pairwise(edges)]
        pieces = _exosystems(signals)
        for piece, (start, end) in zip(pieces, pairwise(edges), strict=True):
            piece.state(end - start)
    except OutsideClassError as error:
        return NotExact(str(error))
    except OverflowError:
        return NotExact(f"the inputs leave the range of floating-point numbers before t = {t_end:g} s")
    return Forcing(t0, t_end, breakpoints, pieces)


def _signal(u: Any, origin: float, probe: float) -> Signal:
    """An input on one interval, in local time."""
    if not isinstance(u, Table):
        return parse(u, origin, probe)
    (value,), (slope,) = u.lines(np.array([origin]), np.array([probe]))
    return {0j: [float(value), float(slope)]}


def _each(inputs: list[Any], rule: Callable[[Any], T]) -> list[T]:
    """Apply ``rule`` to each input; an input outside the class is named."""
    results = []
    for number, expression in enumerate(inputs, 1):
        try:
            results.append(rule(expression))
        except OutsideClassError as error:
            raise OutsideClassError(f"input {number}, {expression}: {error}") from None
    return results


def _exosystems(pieces: list[list[Signal]]) -> tuple[Exosystem, ...]:
    """Exosystems of all intervals: with separate blocks per input if there are many intervals, unless that makes them much larger."""
    shared = [_degrees([signals]) for signals in pieces]
    if len(pieces) > 2:
        inputs = range(len(pieces[0]))
        own = [_degrees([[signals[k]] for signals in pieces]) for k in inputs]
        if sum(map(_order, own)) <= 4 + 2 * max(map(_order, shared)):
            return tuple(_separate(signals, own) for signals in pieces)
    return tuple(_shared(signals, degrees) for signals, degrees in zip(pieces, shared, strict=True))


def _degrees(pieces: list[list[Signal]]) -> dict[complex, int]:
    """The rates of all signals, with the highest polynomial degree of each."""
    degrees: dict[complex, int] = {}
    known: Signal = {}
    for signal in (signal for signals in pieces for signal in signals):
        for rate, p in signal.items():
            if rate.imag >= 0:
                rate = known_rate(rate, known)
                known[rate] = []
                degrees[rate] = max(degrees.get(rate, 0), len(p) - 1)
    return degrees


def _order(degrees: dict[complex, int]) -> int:
    return sum((2 if rate.imag else 1) * (degree + 1) for rate, degree in degrees.items())


def _shared(signals: list[Signal], degrees: dict[complex, int]) -> Exosystem:
    """One block per rate; its w_{d-k} is t**k/k! exp(lambda t), and inputs are linear combinations."""
    blocks = tuple((rate, (0j,) * d + (1.0 / math.factorial(d) + 0j,)) for rate, d in degrees.items())
    H = np.zeros((len(signals), _order(degrees)))
    first = 0
    for rate, d in degrees.items():
        width = 2 if rate.imag else 1
        for row, signal in zip(H, signals, strict=True):
            for k, coefficient in enumerate(signal.get(known_rate(rate, signal), [])):
                i, a = first + (d - k) * width, math.factorial(k) * complex(coefficient)
                row[i : i + width] = (2.0 * a.real, -2.0 * a.imag) if width == 2 else a.real
        first += width * (d + 1)
    return Exosystem(H, _chains(blocks), blocks)


def _separate(signals: list[Signal], own: list[dict[complex, int]]) -> Exosystem:
    """Separate blocks per input, which is the first state of each block."""
    blocks: list[Block] = []
    takes: list[tuple[int, int, float]] = []
    first = 0
    for k, (signal, degrees) in enumerate(zip(signals, own, strict=True)):
        for rate, d in degrees.items():
            p = [complex(c) for c in signal.get(known_rate(rate, signal), [])]
            blocks.append((rate, tuple(p + [0j] * (d + 1 - len(p)))))
            takes.append((k, first, 2.0 if rate.imag else 1.0))
            first += (2 if rate.imag else 1) * (d + 1)
    H = np.zeros((len(signals), first))
    for k, i, share in takes:
        H[k, i] = share
    return Exosystem(H, _chains(tuple(blocks)), tuple(blocks))


def _chains(blocks: tuple[Block, ...]) -> Floats:
    """Block-diagonal S."""
    S = np.zeros((order := _order_of(blocks), order))
    i = 0
    for rate, p in blocks:
        width = 2 if rate.imag else 1
        for link in range(len(p)):
            S[i : i + width, i : i + width] = [[rate.real, -rate.imag], [rate.imag, rate.real]] if width == 2 else rate.real
            if link < len(p) - 1:
                S[range(i, i + width), range(i + width, i + 2 * width)] = 1.0
            i += width
    return S


def _order_of(blocks: tuple[Block, ...]) -> int:
    return sum((2 if rate.imag else 1) * len(p) for rate, p in blocks)
