"""Plots of histories without a time axis: phase plots, Poincaré sections, hysteresis loops, and spectra."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import one_of, real
from gearlib.drawing.histories import History
from gearlib.drawing.quantities import Shown, axis_label, spelled
from gearlib.drawing.style import COLOURS, figure, legend
from gearlib.errors import ArgumentError

Floats = NDArray[np.float64]
WINDOWS = ("hann", "flattop", "blackman", "rectangular")
WORK = {frozenset({"N·m", "rad"}), frozenset({"N", "m"})}  # units whose product is an energy
SEEN = 1e-3  # of the work of a loop: a larger difference between all samples and every second one is stated
PAST = "#7fa3c7"


def plot_against(x: History, y: History, shown: tuple[Shown, Shown], *, period: float | None = None, axes: Any = None) -> Any:
    """Plot one variable over another: a phase portrait, a hysteresis loop, an orbit.

    Parameters
    ----------
    x, y : History
    shown : pair of Shown
        Their units.
    period : float, optional
        Of the excitation, s: the last period is drawn bold, the state at the end of each is marked (the Poincaré section), and the work
        of the last period, the area of the loop, is stated where x and y are a path and its force, with what half of the samples would
        change.
    axes : matplotlib Axes, optional

    Raises
    ------
    ArgumentError
        A period longer than the run.
    """
    here = figure(axes, 1, (5.6, 4.6))
    a, b = x.values * shown[0].factor, y.values * shown[1].factor
    if period is None:
        here.plot(a, b, color=COLOURS[0], lw=1.0, label=f"{y.name} over {x.name}")
    else:
        times = stroboscopic(x.time, period)
        last = x.time >= times[-2] - 1e-12 * abs(times[-1])
        here.plot(a[~last], b[~last], color=PAST, lw=0.6, label="before")
        label = "last period"
        if frozenset({spelled(x.unit), spelled(y.unit)}) in WORK:
            work, rarer = (loop_work(x, y, times[-2], times[-1], every) for every in (1, 2))
            missed = abs(work - rarer)
            label += f", {work:.4g} J" + (f" ± {missed:.1g} J" if missed > SEEN * abs(work) else "")
        here.plot(a[last], b[last], color=COLOURS[0], lw=1.8, label=label)
        at = [np.interp(times, x.time, values) for values in (a, b)]
        here.plot(*at, "o", color=COLOURS[1], ms=3.5, label=f"every {float(period):.4g} s")
        legend(here)
    here.set_xlabel(axis_label(x.name, shown[0].text))
    here.set_ylabel(axis_label(y.name, shown[1].text))
    here.grid(alpha=0.3)
    return here


def stroboscopic(time: Floats, period: float) -> Floats:
    """Times at whole periods before the end of a run, in ascending order.

    >>> stroboscopic(np.linspace(0, 1, 11), 0.3).round(9).tolist()
    [0.1, 0.4, 0.7, 1.0]
    """
    length = float(time[-1] - time[0])
    period = real("period", period, "a positive time, s")
    if not length / len(time) <= period <= length:
        raise ArgumentError(
            f"period is {period:g} s; expected a positive time, up to that of the run, {length:g} s, and not below that between samples"
        )
    before: Floats = period * np.arange(int(length / period * (1 + 1e-12)), -1.0, -1.0)
    return float(time[-1]) - before


def loop_work(x: History, y: History, t_start: float, t_end: float, every: int = 1) -> float:
    """Integral of y dx between two times by the trapezoidal rule: the area of a closed loop; from every sample, or from fewer.

    >>> t = np.linspace(0, 2 * np.pi, 2001)
    >>> round(loop_work(History("x", "m", t, np.sin(t)), History("f", "N", t, 3 * np.cos(t)), 0.0, 2 * np.pi), 4)
    9.4248
    """
    inside = x.time[(x.time > t_start) & (x.time < t_end)]
    t = np.concatenate([[t_start], inside[::every], [t_end]])
    a, b = np.interp(t, x.time, x.values), np.interp(t, y.time, y.values)
    return float(((b[1:] + b[:-1]) / 2 * np.diff(a)).sum())


def spectrum(history: History, window: str = "hann", t_start: float | None = None) -> tuple[Floats, Floats]:
    """Peak amplitudes over frequency (Hz), by a windowed Fourier transform.

    Parameters
    ----------
    history : History
        Equally spaced.
    window : {"hann", "flattop", "blackman", "rectangular"}
        Flattop shows amplitudes accurately wherever their frequencies lie, Hann separates close frequencies.
    t_start : float, optional
        Earlier samples are left out.

    Raises
    ------
    ArgumentError
        Samples that are not equally spaced, or too few; or an unknown window.

    Examples
    --------
    >>> t = np.arange(1000) * 1e-3
    >>> f, a = spectrum(History("x", "m", t, 0.5 + 2 * np.sin(2 * np.pi * 50 * t)), "flattop")
    >>> int(f[a.argmax()]), round(float(a.max()), 3)
    (50, 2.0)
    """
    from scipy.signal import get_window

    one_of("window", window, WINDOWS)
    kept = history.time >= (history.time[0] if t_start is None else real("t_start", t_start, "a finite number of seconds"))
    time, values = history.time[kept], history.values[kept]
    steps = np.diff(time)
    if len(time) < 8:
        raise ArgumentError(f"the interval holds {len(time)} samples; a spectrum needs 8 or more")
    if np.ptp(steps) > 1e-6 * steps.mean():
        raise ArgumentError("a spectrum needs equally spaced samples; simulate with samples=..., not with times of your own")
    shape = get_window("boxcar" if window == "rectangular" else window, len(values))
    amplitudes: Floats = np.abs(np.fft.rfft((values - values.mean()) * shape)) * 2 / shape.sum()
    amplitudes[0] = abs(values.mean())
    if len(values) % 2 == 0:  # the line of two samples per wave has no counterpart at a negative frequency
        amplitudes[-1] /= 2
    return np.arange(len(amplitudes)) / (len(values) * float(steps.mean())), amplitudes


def plot_spectrum(
    history: History, shown: Shown, *, window: str = "hann", t_start: float | None = None, f_max: float | None = None,
    axes: Any = None,
) -> Any:  # fmt: skip
    """Plot the spectrum of a history; returns the axes."""
    f, amplitudes = spectrum(history, window, t_start)
    here = figure(axes, 1, (8.0, 3.5))
    here.semilogy(f[1:], np.maximum(amplitudes[1:] * shown.factor, 1e-300), color=COLOURS[0], lw=1.0)
    top = float(amplitudes[1:].max()) * shown.factor or 1.0
    here.set_ylim(1e-6 * top, 2 * top)
    highest = float(f[-1]) if f_max is None else real("f_max", f_max, "a positive frequency, Hz")
    if highest <= 0:
        raise ArgumentError(f"f_max is {highest:g}; expected a positive frequency, Hz")
    here.set_xlim(0, highest)
    here.set_xlabel("frequency, Hz")
    here.set_ylabel(axis_label(f"amplitude of {history.name}", shown.text))
    here.set_title(f"Spectrum of {history.name}, window: {window}", fontsize=10)
    here.grid(alpha=0.3)
    return here
