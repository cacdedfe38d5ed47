"""What a user asks of a run, checked."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import real
from gearlib.errors import ArgumentError, nearest
from gearlib.run.integrate import METHODS

Floats = NDArray[np.float64]
SMALL = 1e8  # bytes of results that fit anywhere


@dataclass(frozen=True)
class Request:
    """What was asked of a run."""

    t_start: float
    times: Floats
    method: str
    rtol: float
    atol: ArrayLike | None
    parameters: Floats
    start: Any  # a mapping, 'steady', a result, or a result and a time
    signals: tuple[Any, ...]
    progress: bool
    max_step: float | None


def output_times(t_start: float, t_end: float, samples: int | None, times: ArrayLike | None, states: int = 0) -> Floats:
    """The output times, or an `ArgumentError` that says what is wrong with what was asked for; ``states`` are kept at each."""
    if not t_end > t_start:
        raise ArgumentError(f"t_end ({t_end:g}) must be greater than t_start ({t_start:g})")
    if times is not None:
        if samples is not None:
            raise ArgumentError("give samples or times, not both")
        try:
            grid = np.array(times, float)
        except (TypeError, ValueError):
            raise ArgumentError(f"times is {times!r}; expected an increasing sequence of numbers, s") from None
        if grid.ndim != 1 or len(grid) < 1:
            raise ArgumentError("times must be an increasing sequence of finite numbers")
        _check_times(grid.tobytes(), float(t_start), float(t_end))
        return grid
    count = 501 if samples is None else samples
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 2:
        raise ArgumentError(f"samples is {samples!r}; expected a whole number, 2 or more")
    needed = 8.0 * int(count) * (1 + states)
    if needed > SMALL and needed > (there := _memory()):
        raise ArgumentError(
            f"samples is {samples!r}: time and {states} states at so many times take {needed / 1e9:.3g} GB, and this machine has "
            f"{there / 1e9:.3g}; ask for fewer, or for the end of the run only: times=[{t_end:g}]"
        )
    return np.linspace(t_start, t_end, int(count))


def _memory() -> float:
    """Bytes of the machine's memory, where the system tells."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * float(os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return 64e9


@lru_cache(maxsize=4)
def _check_times(grid: bytes, t_start: float, t_end: float) -> None:
    """Raise `ArgumentError` for times that cannot be; other parameters come with the same times."""
    times = np.frombuffer(grid)
    if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise ArgumentError("times must be an increasing sequence of finite numbers")
    if times[0] < t_start or times[-1] > t_end:
        raise ArgumentError(f"times must lie in t_start .. t_end ({t_start:g} .. {t_end:g}), got {times[0]:g} .. {times[-1]:g}")


def check_options(method: str, rtol: float, max_step: float | None) -> None:
    """Raise `ArgumentError` for an unknown method, a tolerance or a step out of range."""
    if max_step is not None and not real("max_step", max_step, "a positive number of seconds, or None") > 0.0:
        raise ArgumentError(f"max_step is {max_step!r}; expected a positive number of seconds, or None")
    if method not in METHODS:
        raise ArgumentError(f"there is no method {method!r}; {nearest(str(method), METHODS)}")
    if isinstance(rtol, bool) or not isinstance(rtol, (int, float, np.number)) or not 1e-13 <= rtol <= 0.1:
        raise ArgumentError(f"rtol is {rtol!r}; expected a number from 1e-13 to 0.1")


def absolute_tolerance(atol: ArrayLike | None, n: int) -> Floats | None:
    """One absolute tolerance for each state, or None where none was given."""
    if atol is None:
        return None
    try:
        result = np.broadcast_to(np.asarray(atol, float), (n,)).copy()
    except (TypeError, ValueError):
        raise ArgumentError(f"atol is {atol!r}; expected a number, or one for each of the {n} states") from None
    if not (np.isfinite(result).all() and (result > 0).all()):
        raise ArgumentError(f"atol is {atol!r}; expected positive numbers")
    return result
