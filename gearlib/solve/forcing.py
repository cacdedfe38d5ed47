"""Inputs of time as outputs of linear systems of their own, so that a forced linear scene is an unforced larger one.

On each interval between breakpoints u(t) = H s(t - start), s' = S s, s(0) = s0. Polynomials come from chains of integrators, a
sine and a cosine from a rotation, an exponential from a real rate; inputs that share a frequency share its block.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.solve.quasipolynomials import OutsideClass, Signal, known_rate, parse
from gearlib.solve.switches import distinct, switch_times

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Exosystem:
    """Generates the inputs of one interval: u = H s, s' = S s, s(0) = s0."""

    H: Floats  # (inputs, order)
    S: Floats  # (order, order)
    blocks: tuple[tuple[complex, int], ...]  # rate (1/s, imaginary part >= 0) and degree of each block of s

    def state(self, s: float) -> Floats:
        """s at local time ``s`` (s), in closed form."""
        parts: list[float] = []
        for rate, degree in self.blocks:
            for k in range(degree + 1):
                size = s**k / math.factorial(k) * math.exp(rate.real * s)
                parts += [size * math.cos(rate.imag * s), size * math.sin(rate.imag * s)] if rate.imag else [size]
        return np.array(parts)

    @property
    def key(self) -> bytes:
        """Equal for exosystems that are the same."""
        return self.H.tobytes() + self.S.tobytes()


@dataclass(frozen=True, eq=False)
class Forcing:
    """All inputs of a scene from t0 to t_end.

    Examples
    --------
    >>> import sympy
    >>> from gearlib.solve.quasipolynomials import TIME
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
        """Inputs (times, inputs) at ``times`` (s); on a breakpoint those of the interval after it."""
        pieces = np.searchsorted(self.breakpoints, times, side="right")
        values = [self.pieces[p].H @ self.pieces[p].state(t - self.start(p)) for t, p in zip(times, pieces, strict=True)]
        return np.array(values).reshape(len(times), len(self.pieces[0].H))


@dataclass(frozen=True)
class NotExact:
    """Why inputs are no outputs of linear systems."""

    reason: str

    def __bool__(self) -> bool:
        return False


def recognise(u: Sequence[Any], t0: float, t_end: float) -> Forcing | NotExact:
    """The linear systems that generate inputs of time.

    Parameters
    ----------
    u : sequence of sympy.Expr
        Inputs in the symbol ``time``: sums and products of polynomials, sines, cosines and exponentials (hyperbolic sines and
        cosines included) with linear arguments, and Piecewise, Abs, sign, Heaviside, Max, Min of such.
    t0, t_end : float
        Interval (s).

    Returns
    -------
    Forcing or NotExact
        NotExact (false in a condition) names the first input outside the class, with the reason in words.

    Examples
    --------
    >>> import sympy
    >>> from gearlib.solve.quasipolynomials import TIME
    >>> recognise([3 * sympy.sin(2 * TIME)], 0.0, 1.0).pieces[0].S
    array([[ 0., -2.],
           [ 2.,  0.]])
    >>> print(recognise([sympy.tanh(TIME)], 0.0, 1.0).reason)
    input 1, tanh(time): tanh(time) is not a sum of products of polynomials, sines, cosines and exponentials of time
    """
    t0, t_end = float(t0), float(t_end)
    if not (math.isfinite(t0) and math.isfinite(t_end)):
        return NotExact(f"the interval from {t0:g} to {t_end:g} s is not finite")
    number, expression = 0, None
    try:
        switches = [np.empty(0)]
        for number, expression in enumerate(u, 1):
            switches.append(switch_times(expression, t0, t_end))
        breakpoints = distinct(np.concatenate(switches), t0, t_end)
        edges = [t0, *breakpoints.tolist(), t_end]
        pieces = []
        for start, end in zip(edges, edges[1:], strict=False):
            signals = []
            for number, expression in enumerate(u, 1):
                signals.append(parse(expression, start, 0.5 * (end - start)))
            pieces.append(_exosystem(signals))
            pieces[-1].state(end - start)
    except OutsideClass as error:
        return NotExact(f"input {number}, {expression}: {error}")
    except OverflowError:
        return NotExact(f"the inputs leave the range of floating-point numbers before t = {t_end:g} s")
    return Forcing(t0, t_end, breakpoints, tuple(pieces))


def _exosystem(signals: list[Signal]) -> Exosystem:
    """One linear system that generates all signals of an interval."""
    degrees: dict[complex, int] = {}
    known: Signal = {}
    for signal in signals:
        for rate, c in signal.items():
            if rate.imag >= 0:
                rate = known_rate(rate, known)
                known[rate] = []
                degrees[rate] = max(degrees.get(rate, 0), len(c) - 1)
    order = sum((2 if rate.imag else 1) * (degree + 1) for rate, degree in degrees.items())
    H, S = np.zeros((len(signals), order)), np.zeros((order, order))
    first = 0
    for rate, degree in degrees.items():
        width = 2 if rate.imag else 1
        for k in range(degree + 1):
            i = first + k * width
            S[i : i + width, i : i + width] = [[rate.real, -rate.imag], [rate.imag, rate.real]] if width == 2 else rate.real
            if k:
                S[range(i, i + width), range(i - width, i)] = 1.0
        for row, signal in zip(H, signals, strict=True):
            for k, c in enumerate(signal.get(known_rate(rate, signal), [])):
                i, c = first + k * width, math.factorial(k) * complex(c)
                row[i : i + width] = (2.0 * c.real, -2.0 * c.imag) if width == 2 else c.real
        first += width * (degree + 1)
    return Exosystem(H, S, tuple(degrees.items()))
