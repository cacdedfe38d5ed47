"""`Table`: an input as a piecewise linear function of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import finite, reals, shown
from gearlib.errors import ArgumentError

Floats = NDArray[np.float64]


class Table:
    """Piecewise linear function of time; constant before the first and after the last point.

    Parameters
    ----------
    t : sequence of float, shape (n,)
        Increasing times, s. Two equal times make a step.
    y : sequence of float, shape (n,)
        Values.

    Examples
    --------
    >>> Table([0, 1, 1, 2], [0, 1, 3, 3])(np.array([0.5, 1.0, 5.0]))
    array([0.5, 3. , 3. ])
    """

    def __init__(self, t: ArrayLike, y: ArrayLike) -> None:
        self.t = reals("Table(t, y): t", t, "an increasing sequence of finite numbers, s").copy()
        self.y = reals("Table(t, y): y", y, "a sequence of finite numbers").copy()
        if self.t.ndim != 1 or self.t.shape != self.y.shape or len(self.t) < 1:
            raise ArgumentError(
                f"Table(t, y): expected two sequences of one length, got shapes {self.t.shape} and {self.y.shape}"
            )
        if (np.diff(self.t) < 0).any():
            raise ArgumentError("Table(t, y): the times must not decrease")
        self.t.flags.writeable = self.y.flags.writeable = False  # what was made from them is kept

    def __call__(self, time: Any) -> Floats:
        t = reals("time", time, "finite numbers, s")
        k = np.searchsorted(self.t, t, side="right")
        left, right = np.clip(k - 1, 0, None), np.clip(k, None, len(self.t) - 1)
        width = self.t[right] - self.t[left]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(width > 0, (t - self.t[left]) / width, 0.0)
        result: Floats = self.y[left] + np.clip(share, 0.0, 1.0) * (self.y[right] - self.y[left])
        return result

    def lines(self, starts: Floats, inside: Floats) -> tuple[Floats, Floats]:
        """Values and slopes of the straight lines that hold just after some times; ``inside`` (s) later they hold still."""
        k = np.searchsorted(self.t, starts + inside, side="right")
        left, right = np.clip(k - 1, 0, None), np.clip(k, None, len(self.t) - 1)
        width = self.t[right] - self.t[left]
        slopes = np.divide(self.y[right] - self.y[left], width, out=np.zeros(len(starts)), where=width > 0.0)
        return self.y[left] + slopes * (starts - self.t[left]), slopes


Signal = Any  # a number, a FunctionInput, or a Table


def breakpoints(signals: Sequence[Signal]) -> Floats:
    """Times at which tables have corners."""
    tables = [s.t for s in signals if isinstance(s, Table)]
    corners = np.sort(np.concatenate([np.empty(0), *tables]))
    return corners[np.diff(corners, prepend=-np.inf) > 0]


@dataclass(frozen=True)
class FunctionInput:
    """An input that is a Python function of time; its path names it where the function fails.

    Raises
    ------
    ArgumentError
        When called: the function fails, or returns anything but a finite number.
    """

    path: str
    function: Callable[[float], Any]

    def __call__(self, t: float) -> float:
        try:
            value = self.function(t)
        except Exception as problem:
            raise ArgumentError(f"{self._at(t, 'raised')} {type(problem).__name__}: {problem}") from problem
        return finite(lambda: self._at(t, "returned"), value)

    def _at(self, t: float, did: str) -> str:
        name = getattr(self.function, "__name__", None) or shown(self.function)
        return f"the function {name} of the input {self.path}, called with t = {t:.9g} s, {did}"


def values(signals: Sequence[Signal], times: Floats, count: int = 0) -> Floats:
    """Values of the signals at some times, shape (signals, times); with rows of zeros up to ``count`` where there are fewer."""
    rows = []
    for signal in signals:
        if isinstance(signal, Table):
            rows.append(signal(times))
        elif callable(signal):
            rows.append(np.array([signal(float(t)) for t in times]))
        else:
            rows.append(np.full(len(times), float(signal)))
    rows += [np.zeros(len(times))] * (count - len(rows))
    return np.array(rows, float).reshape(len(rows), len(times))
