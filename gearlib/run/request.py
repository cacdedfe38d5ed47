"""`Request`: the validated arguments of a run."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import is_real, real, reals, shown, whole
from gearlib.errors import ArgumentError, nearest
from gearlib.run.methods.method import Method
from gearlib.run.methods.method_table import method_of
from gearlib.run.tangents.directions import TangentDirections

Floats = NDArray[np.float64]
FORMS = ("ode", "torn", "dae")  # of the equations for IDA
BACKENDS = ("native", "sksundae")
INCREASING = "an increasing sequence of finite numbers, s"
SHORTEST, LONGEST = 1e-200, 1e200  # s; steps outside would overflow or underflow when squared
SMALL = 1e8  # bytes of results that always fit into memory


@dataclass(frozen=True)
class Request:
    """Validated arguments of a run."""

    t_start: float
    times: Floats
    method: str | Method
    rtol: float
    atol: ArrayLike | None
    parameters: Floats
    start: Any  # a mapping, "steady", a result, or a result and a time
    signals: tuple[Any, ...]
    progress: Any  # whether a bar is shown, or a function of the fraction done and the time
    max_step: float | None
    zero_inputs: tuple[str, ...] = ()  # inputs that were not given
    form: str = "ode"
    backend: str = "native"
    directions: TangentDirections | None = None  # directions of differentiation
    given: tuple[str, ...] = ()  # parameters that were given, which do not follow from others
    on_interrupt: str = "raise"  # or "stop"
    pieces: Any = None  # of a repeated run with sampled controllers: the recorded controller outputs


def output_times(t_start: float, t_end: float, samples: int | None, times: ArrayLike | None, states: int = 0) -> Floats:
    """The output times; raises `ArgumentError` for impossible ones. ``states`` values are stored at each."""
    if not t_end > t_start:
        raise ArgumentError(f"t_end ({t_end:g}) must be greater than t_start ({t_start:g})")
    if not SHORTEST <= t_end - t_start <= LONGEST:
        raise ArgumentError(
            f"t_end is {t_end:g}, {t_end - t_start:.3g} s after the start; expected {SHORTEST:g} to {LONGEST:g} s"
        )
    if times is not None:
        if samples is not None:
            raise ArgumentError("give samples or times, not both")
        grid = reals("times", times, INCREASING).copy()
        if grid.ndim != 1 or len(grid) < 1:
            raise ArgumentError(f"times is {shown(times)}; expected {INCREASING}")
        if not (np.isfinite(grid[[0, -1]]).all() and (grid[1:] > grid[:-1]).all()):
            raise ArgumentError(f"times is {shown(grid)}; expected {INCREASING}")
        if grid[0] < t_start or grid[-1] > t_end:
            raise ArgumentError(
                f"times must lie in t_start .. t_end ({t_start:g} .. {t_end:g}), got {grid[0]:g} .. {grid[-1]:g} s"
            )
        return grid
    count = whole("samples", 501 if samples is None else samples, 2)
    needed = 8.0 * count * (1 + states)
    if needed > SMALL and needed > (there := physical_memory()):
        raise ArgumentError(
            f"samples is {shown(samples)}: time and {states} states at so many times take {needed / 1e9:.3g} GB, and this machine has "
            f"{there / 1e9:.3g}; ask for fewer, or for the end of the run only: times=[{t_end:g}]"
        )
    even = np.arange(count, dtype=np.float64)  # as `numpy.linspace` computes them, in a quarter of the time
    even *= (t_end - t_start) / (count - 1)
    even += t_start
    even[-1] = t_end
    coarse = t_end - t_start < 16.0 * count * math.ulp(max(abs(t_start), abs(t_end)))
    if coarse and not (np.diff(even) > 0).all():
        raise ArgumentError(
            f"samples is {count}: so many times between {t_start!r} and {t_end!r} s are not distinct in double precision"
        )
    return even


def physical_memory() -> float:
    """Bytes of physical memory, if the system tells."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * float(os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return 64e9


def check_options(method: str | Method, rtol: float, max_step: float | None) -> None:
    """Raise `ArgumentError` for an unknown method, or a tolerance or step out of range."""
    if max_step is not None and not real("max_step", max_step, "a positive number of seconds, or None") >= SHORTEST:
        raise ArgumentError(f"max_step is {shown(max_step)}; expected a positive number of seconds, or None")
    method_of(method)
    if not (is_real(rtol) and 1e-13 <= rtol <= 0.1):
        raise ArgumentError(f"rtol is {shown(rtol)}; expected a number from 1e-13 to 0.1")


def check_form(method: str | Method, form: str, backend: str) -> None:
    """Raise `ArgumentError` for an unknown form of the equations or IDA backend, or one that the method does not take."""
    for name, given, known in (("form", form, FORMS), ("backend", backend, BACKENDS)):
        if not isinstance(given, str) or given not in known:
            advice = nearest(given, known) if isinstance(given, str) else f"Valid names: {', '.join(known)}"
            raise ArgumentError(f"there is no {name} {shown(given)}; {advice}")
        if given != known[0] and method != "ida":
            raise ArgumentError(
                f"{name}={given!r} is a choice of method='ida', and the method is {method!s}; give method='ida'"
            )


def absolute_tolerance(atol: ArrayLike | None, n: int) -> Floats | None:
    """One absolute tolerance per state, or None if none was given."""
    if atol is None:
        return None
    expected = f"positive numbers: one, or one for each of the {n} states"
    given = reals("atol", atol, expected)
    if not (given > 0).all() or given.shape not in ((), (1,), (n,)):
        raise ArgumentError(f"atol is {shown(atol)}; expected {expected}")
    return np.broadcast_to(given, (n,)).copy()
