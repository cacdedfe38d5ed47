"""Order analysis: spectra over the angle of a shaft instead of time, and waterfall diagrams over speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import check_axes, one_name, real, shown, whole
from gearlib.drawing.quantities import axis_label, spelled
from gearlib.errors import ArgumentError
from gearlib.optional import optional
from gearlib.run.result import Result
from gearlib.run.subject import check_result

if TYPE_CHECKING:
    import pandas

Floats = NDArray[np.float64]
RPM = 30 / np.pi  # 1/min per rad/s
FINEST, MANY, ALWAYS = 32, 2**22, 4  # points for each sample of a block, at most; of a block with that many points, at most
ROUNDING = 1e-6  # of a revolution, of a sample's distance, of a number of points


@dataclass(frozen=True, eq=False)
class OrderSpectrum:
    """Amplitudes over orders (events per revolution of the reference shaft).

    Attributes
    ----------
    orders, amplitudes : arrays (orders,)
        Peak amplitudes in the signal's unit.
    name, reference, unit : str
    """

    orders: Floats
    amplitudes: Floats
    name: str
    reference: str
    unit: str

    def at(self, order: float) -> float:
        """Amplitude at the nearest spectral line; orders above the highest line, which sampling cannot resolve, are refused.

        A component halfway between two lines shows 15 % less in each of them, as is the way of a Hann window: choose an interval
        (``t_start``, ``t_end``) whose number of revolutions makes a whole number when multiplied by the order.
        """
        highest = float(self.orders[-1])
        order = real("order", order)
        if not 0 <= order <= highest + 0.5 * float(self.orders[1] if len(self.orders) > 1 else 0.0):
            raise ArgumentError(
                f"order {order:g} is not in this spectrum of {self.name}, which goes from 0 to {highest:.4g}; give a higher "
                "max_order, or sample the run more often"
            )
        return float(self.amplitudes[int(np.argmin(np.abs(self.orders - order)))])

    def to_dataframe(self) -> pandas.DataFrame:
        pandas = optional("pandas")

        return pandas.DataFrame({self.name: self.amplitudes}, index=pandas.Index(self.orders, name="order"))

    def plot(self, *, axes: Any = None) -> Any:
        """Plot the spectrum; returns the matplotlib axes."""
        plt = optional("matplotlib.pyplot")

        if axes is None:
            _, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
        check_axes(axes, 1)
        axes.semilogy(self.orders, np.maximum(self.amplitudes, 1e-12 * self.amplitudes.max(initial=1e-300)), lw=1)
        axes.set_xlabel(f"order of {self.reference}, events per revolution")
        axes.set_ylabel(axis_label(f"amplitude of {self.name}", spelled(self.unit)))
        axes.set_title(f"Order spectrum of {self.name}")
        axes.grid(alpha=0.3)
        return axes


@dataclass(frozen=True, eq=False)
class OrderWaterfall:
    """Order spectra of successive blocks of a run.

    Attributes
    ----------
    times, speeds : arrays (pieces,)
        Midpoint of each block (s), and the mean speed of the reference in it (rad/s), negative where it turns backwards.
    orders : array (orders,)
    amplitudes : array (pieces, orders)
    """

    times: Floats
    speeds: Floats
    orders: Floats
    amplitudes: Floats
    name: str
    reference: str
    unit: str

    def plot(self, *, axes: Any = None, decibels: float = 80.0) -> Any:
        """Plot amplitudes as colours over order and speed (or time, if the speed does not increase); returns the axes."""
        plt = optional("matplotlib.pyplot")

        expected = "a positive range, dB, up to 1000"
        if not 0 < real("decibels", decibels, expected) <= 1000:
            raise ArgumentError(f"decibels is {shown(decibels)}; expected {expected}")
        decibels = float(decibels)
        if axes is None:
            _, axes = plt.subplots(figsize=(8, 4.5), layout="constrained")
        check_axes(axes, 1)
        monotonic = (np.diff(self.speeds) > 0).all() or (np.diff(self.speeds) < 0).all()
        height, label = (self.speeds * RPM, f"mean speed of {self.reference}, 1/min") if monotonic else (self.times, "time, s")
        top = max(float(self.amplitudes.max(initial=0.0)), 1e-300)
        level = 20 * np.log10(np.maximum(self.amplitudes / top, 10 ** (-decibels / 20)))
        image = axes.pcolormesh(
            self.orders, height, level, shading="nearest", cmap="viridis", vmin=-decibels, vmax=0, rasterized=True
        )
        axes.figure.colorbar(image, ax=axes, label=f"amplitude of {self.name}, dB over {top:.3g} {spelled(self.unit)}".rstrip())
        axes.set_xlabel(f"order of {self.reference}, events per revolution")
        axes.set_ylabel(label)
        axes.set_title(f"Order spectra of {self.name}")
        return axes


def order_spectrum(
    result: Result, name: str, reference: str, *, t_start: float | None = None, t_end: float | None = None,
    max_order: float | None = None,
) -> OrderSpectrum:  # fmt: skip
    """Order spectrum of a variable of a run.

    The signal is resampled by quintic splines at equal angle steps, as fine as the samples where the shaft is slowest, and transformed
    with a Hann window over as many whole revolutions as the interval contains; two orders are resolved if they differ by more than 2
    over the number of revolutions.

    Parameters
    ----------
    result : Result
        Sampled at several times the highest order of interest.
    name : str
        The variable.
    reference : str
        Angle (rad) or speed (rad/s) of the reference shaft, which must turn in one direction.
    t_start, t_end : float, optional
        Interval, s.
    max_order : float, optional
        Highest order to keep; by default, and at most, half the samples per revolution at the highest speed.

    Returns
    -------
    OrderSpectrum

    Raises
    ------
    ArgumentError
        Less than one revolution, or a reference shaft that reverses.
    """
    time, angle, signal, _ = _prepared(result, name, reference, t_start, t_end)
    revolutions = int((angle[-1] - angle[0]) / (2 * np.pi) + ROUNDING)
    if revolutions < 1:
        raise ArgumentError(
            f"{reference} turns {(angle[-1] - angle[0]) / (2 * np.pi):.3g} times in the interval; a spectrum needs one"
        )
    orders, rows = _spectra(time, angle, signal, [0.0], revolutions, max_order)
    return OrderSpectrum(orders, rows[0], name, reference, result.unit(name))


def order_waterfall(
    result: Result, name: str, reference: str, *, revolutions: int = 8, overlap: float = 0.5, max_order: float | None = None
) -> OrderWaterfall:
    """Order spectra of successive blocks of a run, each a number of revolutions long.

    Parameters
    ----------
    result, name, reference, max_order
        As for `order_spectrum`.
    revolutions : int
        Block length.
    overlap : float
        Fraction of a block that overlaps the next one, 0 .. 0.95.

    Returns
    -------
    OrderWaterfall
    """
    revolutions = whole("revolutions", revolutions, 1)
    overlap = real("overlap", overlap, "a number from 0 to 0.95")
    if not 0 <= overlap <= 0.95:
        raise ArgumentError(f"overlap is {overlap}; expected a number from 0 to 0.95")
    time, angle, signal, sense = _prepared(result, name, reference, None, None)
    total = (angle[-1] - angle[0]) / (2 * np.pi)
    starts = np.arange(0.0, total - revolutions + ROUNDING, revolutions * (1 - overlap))
    if not len(starts):
        raise ArgumentError(f"{reference} turns {total:.3g} times in the run; a piece needs {revolutions}")
    orders, rows = _spectra(time, angle, signal, starts.tolist(), revolutions, max_order)
    edges = np.interp(angle[0] + 2 * np.pi * np.array([starts, starts + revolutions]), angle, time)
    speeds = sense * 2 * np.pi * revolutions / (edges[1] - edges[0])
    return OrderWaterfall(edges.mean(axis=0), speeds, orders, rows, name, reference, result.unit(name))


def _prepared(
    result: Result, name: str, reference: str, t_start: float | None, t_end: float | None
) -> tuple[Floats, Floats, Floats, int]:
    """Time, increasing angle, and signal in the interval; and 1 or -1, the direction in which the reference turns."""
    from scipy.interpolate import make_interp_spline

    check_result(result)
    seconds = "a finite number of seconds"
    begin, end = (x if x is None else real(n, x, seconds) for n, x in (("t_start", t_start), ("t_end", t_end)))
    name, reference = one_name("name", name, "load.w"), one_name("reference", reference, "motor.phi")
    time, signal, motion = result.time, result[name], result[reference]
    near = ROUNDING * float(np.diff(time).max(initial=0.0))  # an end that misses a sample by rounding means that sample
    inside = (time >= (time[0] if begin is None else begin - near)) & (time <= (time[-1] if end is None else end + near))
    inside &= np.append(
        np.diff(time) > 0, True
    )  # a file of another program repeats the time of an event: its last values count
    time, signal, motion = time[inside], signal[inside], motion[inside]
    if len(time) < 12:
        raise ArgumentError(f"the interval holds {len(time)} samples; a spectrum needs more")
    unit = result.unit(reference)
    if unit == "rad/s":
        motion = make_interp_spline(time, motion, k=5).antiderivative()(time)
    elif unit != "rad":
        raise ArgumentError(f"{reference} is in {unit or 'no unit'}; expected an angle (rad) or a speed (rad/s)")
    sense = 1 if motion[-1] > motion[0] else -1
    angle = sense * motion
    if (np.diff(angle) <= 0).any():
        raise ArgumentError(f"{reference} does not turn in one direction all the time; choose an interval in which it does")
    result.check_sampling(name, float(time[0]), float(time[-1]))
    return time, angle, signal, sense


def _spectra(
    time: Floats, angle: Floats, signal: Floats, starts: list[float], revolutions: int, max_order: float | None
) -> tuple[Floats, Floats]:
    """Orders, and the spectrum of each block beginning at ``starts`` revolutions."""
    from scipy.interpolate import make_interp_spline

    steps = np.diff(angle)
    step = float(steps.max())
    per_revolution = max(8, int(np.ceil(2 * np.pi / step)))
    over_time, turning = make_interp_spline(time, signal, k=5), make_interp_spline(time, angle, k=5)
    rate = turning.derivative()
    orders = np.arange(per_revolution * revolutions // 2 + 1) / revolutions
    highest = np.pi / step  # two samples per wave at the highest speed
    if max_order is not None:
        highest = min(real("max_order", max_order, "a positive order"), highest)
        if not highest > 0:
            raise ArgumentError(f"max_order is {shown(max_order)}; expected a positive order")
    kept = orders <= highest
    rows = []
    for start in starts:
        n = per_revolution * revolutions * finer(angle, steps, angle[0] + 2 * np.pi * start, revolutions, per_revolution)
        window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
        wanted = angle[0] + 2 * np.pi * (start + revolutions * np.arange(n) / n)
        t = np.interp(wanted, angle, time)
        for _ in range(4):  # Newton's iterations for the time of each angle
            t = np.clip(t - (turning(t) - wanted) / rate(t), time[0], time[-1])
        line = np.abs(np.fft.rfft(over_time(t) * window)) * 2 / window.sum()
        line[0] /= 2
        rows.append(line[: len(orders)][kept])
    return orders[kept], np.array(rows)


def finer(angle: Floats, steps: Floats, begin: float, revolutions: int, per_revolution: int) -> int:
    """How many times finer than ``per_revolution`` a block is resampled, so that its slowest samples are as close in angle.

    Otherwise waves that the run resolves where the shaft is slow would appear as lower orders. Where it is slower than a `FINEST`-th of
    the mean speed, too little of the block's angle passes to be seen.
    """
    inside = steps[(angle[1:] > begin) & (angle[:-1] < begin + 2 * np.pi * revolutions)]
    needed = 2 * np.pi / per_revolution / float(inside.min())
    points = max(min(FINEST * len(inside), MANY), ALWAYS * len(inside))
    return max(1, math.ceil(min(needed, points / (per_revolution * revolutions)) * (1 - ROUNDING)))
