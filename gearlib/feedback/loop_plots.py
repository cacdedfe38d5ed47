"""Nyquist, Nichols, Bode and root-locus plots of a loop, with its margins marked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import check_axes, increasing
from gearlib.feedback.feedback_loop import Loop, as_loop
from gearlib.feedback.margins import Margins, margins
from gearlib.linear.balancing import balance
from gearlib.optional import optional

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
CURVE, POINT, GAIN, PHASE = "#1f4e9c", "#b22222", "#2e8b57", "#d95f02"


def _curve(loop: Loop) -> tuple[Floats, Complexes]:
    omega = loop.frequencies(decades=2.0)
    curve = loop.response(1j * omega)
    keep = np.isfinite(curve)
    return omega[keep], curve[keep]


def _title(loop: Loop, kind: str) -> str:
    """Title with the signals and the gain, whose unit makes L a number."""
    return f"{kind} of the loop {loop.input} → {loop.output}" + (f", gain {loop.gain}" if loop.gain else "")


def margin_labels(m: Margins) -> tuple[str, str]:
    gain, phase = m.gain_margin, m.phase_margin
    return (
        f"gain margin {m.gain_margin_db:.2f} dB" if np.isfinite(gain) else "gain margin infinite",
        f"phase margin {phase:.2f}°" if np.isfinite(phase) else "phase margin infinite",
    )


def nyquist_plot(
    model: Any, loop: Sequence[Any] | None = None, *, gain: float = 1.0, at: Any = None,
    parameters: Mapping[str, float] | None = None, axes: Any = None,
) -> Any:  # fmt: skip
    """Nyquist plot with margins: the whole curve, and the neighbourhood of -1.

    Parameters
    ----------
    model, loop, gain, at, parameters
        As for `gearlib.stability`: the loop from an input to an output, closed by negative feedback.
    axes : matplotlib Axes, optional
        Two axes to draw into.

    Returns
    -------
    list of matplotlib Axes
        The whole curve, and the neighbourhood of -1.

    Raises
    ------
    ArgumentError, NameLookupError
        Unknown signal, or several and none chosen.

    Examples
    --------
    >>> import control, gearlib as gl, matplotlib.pyplot as plt
    >>> axes = gl.nyquist_plot(control.tf([1], [1, 2, 1, 0]))
    >>> plt.close()
    """
    plt = optional("matplotlib.pyplot")

    chosen = as_loop(model, loop, gain=gain, at=at, parameters=parameters)
    omega, curve = _curve(chosen)
    m = margins(chosen)
    if axes is None:
        _, axes = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
    check_axes(axes, 2)
    bound = _view(chosen, omega, curve)
    for ax in axes:
        ax.plot(curve.real, curve.imag, color=CURVE, lw=1.4, label="L(jω), ω > 0")
        ax.plot(curve.real, -curve.imag, color=CURVE, lw=0.9, ls="--", alpha=0.6, label="ω < 0")
        ax.plot(-1, 0, "+", color=POINT, ms=11, mew=2, label="−1")
        ax.axhline(0, color="0.6", lw=0.7, zorder=0)
        ax.axvline(0, color="0.6", lw=0.7, zorder=0)
        ax.set_xlabel("real part of L")
        ax.set_ylabel("imaginary part of L")
        ax.grid(alpha=0.25)
    _arrows(axes[0], curve, bound)
    inside = curve.real[np.abs(curve) <= bound * (1 + 1e-9)]
    left = min(float(inside.min(initial=0.0)), -1.0 if bound > 0.5 else 0.0)
    centre = (float(inside.max(initial=0.0)) + left) / 2
    axes[0].set_xlim(centre - 1.15 * bound, centre + 1.15 * bound)
    axes[0].set_ylim(-1.15 * bound, 1.15 * bound)
    axes[0].set_aspect("equal")
    axes[0].locator_params(axis="x", nbins=5)
    axes[0].set_title("whole curve")
    nyquist_margins(axes[1], m)
    axes[1].set_title("around −1")
    for ax in axes:
        mark_frequencies(ax, omega, curve.real, curve.imag)
    say_where_it_is(axes[1], curve, m)
    axes[0].figure.legend(*axes[1].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=4)
    axes[0].figure.suptitle(_title(chosen, "Nyquist plot"))
    return list(axes)


def say_where_it_is(ax: Any, curve: Complexes, m: Margins) -> None:
    """Describe where the curve is if it does not come near -1."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    if not ((curve.real > left) & (curve.real < right) & (np.abs(curve.imag) < high)).any():
        said = f"the curve is not seen here:\nit comes no nearer to −1\nthan {m.modulus_margin:.3g}"
        ax.text((left + right) / 2, low + 0.8 * (high - low), said, ha="center", va="center", fontsize=8)


def _view(loop: Loop, omega: Floats, curve: Complexes) -> float:
    """Plot range: everything except the branches to infinity near poles on the imaginary axis."""
    size = np.abs(curve)
    largest = float(size.max(initial=1e-300))
    if largest < 0.5:  # also where a pole on the axis does not reach the output
        return largest
    if not len(loop.open_poles.on_axis):
        return max(largest, 1.1)
    around = np.maximum(loop.open_poles.on_axis, loop.scale[0])
    near = np.abs(omega[:, None] - loop.open_poles.on_axis[None, :]) < 0.3 * around[None, :]
    return max(3.0, float(size[~near.any(axis=1)].max(initial=0.0)))


def _arrows(ax: Any, curve: Complexes, bound: float) -> None:
    """Arrows in the direction of increasing frequency."""
    inside = np.flatnonzero(np.abs(curve) <= bound)
    length = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(curve[inside])))]) if len(inside) else np.empty(0)
    for part in (0.2, 0.55, 0.85):
        if not len(length) or not length[-1]:
            return
        i = inside[min(int(np.searchsorted(length, part * length[-1])), len(inside) - 2)]
        start, end = curve[i], curve[i + 1]
        if start != end:
            ax.annotate(
                "", (end.real, end.imag), (start.real, start.imag), arrowprops={"arrowstyle": "-|>", "color": CURVE, "lw": 1.4}
            )


def nyquist_margins(ax: Any, m: Margins) -> None:
    turn = np.linspace(0, 2 * np.pi, 361)
    ax.plot(np.cos(turn), np.sin(turn), color="0.5", lw=0.8, ls=":", label="|L| = 1")
    radius = m.modulus_margin
    ax.plot(-1 + radius * np.cos(turn), radius * np.sin(turn), color="0.7", lw=0.8, label=f"distance from −1: {radius:.3g}")
    gain, phase = margin_labels(m)
    crossings = [-1 / c.gain_margin for c in m.phase_crossings]
    ax.plot(crossings or [np.nan], np.zeros(max(1, len(crossings))), "s", color=GAIN, ms=6, label=gain)
    circle = np.exp(1j * np.deg2rad([c.phase_margin for c in m.gain_crossings] or [np.nan])) * -1
    ax.plot(circle.real, circle.imag, "o", color=PHASE, ms=6, label=phase)
    near = min(2.2, max(1.4, *(abs(x) * 1.2 for x in crossings if abs(x) < 1.8), 1.4))
    ax.set_xlim(-1 - near, -1 + 1.2 * near)
    ax.set_ylim(-1.1 * near, 1.1 * near)
    ax.set_aspect("equal")


def nichols_plot(
    model: Any, loop: Sequence[Any] | None = None, *, gain: float = 1.0, at: Any = None,
    parameters: Mapping[str, float] | None = None, axes: Any = None,
) -> Any:  # fmt: skip
    """Nichols plot, gain over phase, with margins and contours of equal closed-loop gain.

    Parameters
    ----------
    model, loop, gain, at, parameters
        As for `gearlib.stability`: the loop from an input to an output, closed by negative feedback.
    axes : matplotlib Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    ArgumentError, NameLookupError
        Unknown signal, or several and none chosen.

    Examples
    --------
    >>> import control, gearlib as gl, matplotlib.pyplot as plt
    >>> axes = gl.nichols_plot(control.tf([1], [1, 2, 1, 0]))
    >>> plt.close()
    """
    plt = optional("matplotlib.pyplot")
    MultipleLocator = optional("matplotlib.ticker").MultipleLocator

    chosen = as_loop(model, loop, gain=gain, at=at, parameters=parameters)
    omega, curve = _curve(chosen)
    m = margins(chosen)
    if axes is None:
        _, axes = plt.subplots(figsize=(8, 5.5), layout="constrained")
    check_axes(axes, 1)
    phase, level = np.degrees(np.unwrap(np.angle(curve))), 20 * np.log10(np.maximum(np.abs(curve), 1e-300))
    phase += 360 * np.round((-90 - phase[0]) / 360)
    axes.plot(phase, level, color=CURVE, lw=1.4, label="L(jω)")
    points = [p for p in np.arange(-1260.0, 901.0, 360.0).tolist() if phase.min() - 100 <= p <= phase.max() + 100] or [-180.0]
    axes.plot(points, np.zeros(len(points)), "+", color=POINT, ms=11, mew=2, label="−1 (−180°, 0 dB)")
    nichols_margins(axes, m, omega, phase)
    low, high = max(float(level.min()), -120.0), min(float(level.max()), 120.0)
    axes.set_ylim(min(low, -12) - 6, max(high, 12) + 6)
    axes.set_xlim(min(phase.min(), *points) - 25, max(phase.max(), *points) + 25)
    taken = closed_loop_lines(axes, points)
    mark_frequencies(axes, omega, phase, level, taken)
    axes.set_xlabel("phase of L, deg")
    axes.set_ylabel("gain |L|, dB")
    axes.xaxis.set_major_locator(MultipleLocator(45))
    axes.axhline(0, color="0.6", lw=0.7, zorder=0)
    axes.grid(alpha=0.25)
    axes.set_title(_title(chosen, "Nichols plot"))
    axes.legend(fontsize=8)
    return axes


def nichols_margins(ax: Any, m: Margins, omega: Floats, phase: Floats) -> None:
    gain, phase_label = margin_labels(m)
    ends = [c for c in m.phase_crossings if np.isfinite(c.omega)]
    at = [float(np.round((np.interp(c.omega, omega, phase) + 180) / 360) * 360 - 180) for c in ends]
    ax.plot(at or [np.nan], [-c.gain_margin_db for c in ends] or [np.nan], "s", color=GAIN, ms=6, label=gain)
    where = [float(np.interp(c.omega, omega, phase)) for c in m.gain_crossings]
    ax.plot(where or [np.nan], np.zeros(max(1, len(where))), "o", color=PHASE, ms=6, label=phase_label)


def closed_loop_lines(ax: Any, points: Sequence[float]) -> list[Floats]:
    """Contours of equal |L / (1 + L)| around each image of -1; returns the label positions, in pixels."""
    angle = np.linspace(1e-3, 2 * np.pi - 1e-3, 600)
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    taken: list[Floats] = []
    for centre in points:
        for decibels in (6.0, 3.0, 1.0, -3.0, -6.0, -12.0):
            closed = 10 ** (decibels / 20) * np.exp(1j * angle)
            opened = closed / (1 - closed)
            x, y = np.degrees(np.angle(opened)) % 360 - 360 + centre + 180, 20 * np.log10(np.abs(opened))
            x = np.where(np.abs(np.diff(x, prepend=x[0])) > 180, np.nan, x)
            ax.plot(x, y, color="0.8", lw=0.6, zorder=0)
            inside = (
                np.isfinite(x)
                & (x > left + 0.04 * (right - left))
                & (x < right - 0.04 * (right - left))
                & (y > low + 0.03 * (high - low))
                & (y < high - 0.03 * (high - low))
            )
            if centre == points[0] and inside.any():
                here = np.flatnonzero(inside)
                i = int(here[np.argmax(y[here])] if decibels > 0 else here[np.argmin(x[here])])
                at = ax.transData.transform((x[i], y[i]))
                if is_free(at, taken, 26.0, 10.0):
                    taken.append(at)
                    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
                    ax.text(
                        x[i],
                        y[i],
                        f"{decibels:+g} dB",
                        fontsize=6,
                        color="0.35",
                        ha="center",
                        va="center",
                        bbox=box,
                        clip_on=True,
                    )
    return taken


def mark_frequencies(ax: Any, omega: Floats, x: Floats, y: Floats, taken: Sequence[Floats] = ()) -> None:
    """Mark frequencies (Hz) on a curve, at 1, 2 and 5 of each decade where labels fit.

    Parameters
    ----------
    ax : matplotlib Axes
        With its final limits.
    omega, x, y : arrays
        Increasing angular frequencies, and the curve.
    taken : sequence of arrays (2,)
        Positions of other labels, pixels.
    """
    ax.apply_aspect()
    hertz, (left, right), (low, high) = omega / (2 * np.pi), ax.get_xlim(), ax.get_ylim()
    first, last = int(np.floor(np.log10(hertz[0]))), int(np.ceil(np.log10(hertz[-1])))
    places = [np.asarray(at) for at in taken]
    for times in (1.0, 2.0, 5.0):  # whole decades first
        for f in (times * 10.0 ** np.arange(first, last + 1)).tolist():
            if not hertz[0] <= f <= hertz[-1]:
                continue
            at = float(np.interp(f, hertz, x)), float(np.interp(f, hertz, y))
            place = ax.transData.transform(at)
            if left < at[0] < right and low < at[1] < high and is_free(place, places, 42.0, 14.0):
                places.append(place)
                ax.plot(*at, ".", color=CURVE, ms=6)
                ax.annotate(f"{f:g} Hz", at, xytext=(4, 3), textcoords="offset points", fontsize=7)


def is_free(place: Floats, taken: Sequence[Floats], width: float, height: float) -> bool:
    """Whether a label (in pixels) does not overlap others."""
    return all(abs(place[0] - other[0]) > width or abs(place[1] - other[1]) > height for other in taken)


def bode_plot(
    model: Any, loop: Sequence[Any] | None = None, *, gain: float = 1.0, at: Any = None,
    parameters: Mapping[str, float] | None = None, axes: Any = None,
) -> Any:  # fmt: skip
    """Bode plot over frequency in Hz, with margins.

    Parameters
    ----------
    model, loop, gain, at, parameters
        As for `gearlib.stability`: the loop from an input to an output, closed by negative feedback.
    axes : matplotlib Axes, optional
        Two axes to draw into.

    Returns
    -------
    array of two matplotlib Axes
        Gain and phase axes.

    Raises
    ------
    ArgumentError, NameLookupError
        Unknown signal, or several and none chosen.

    Examples
    --------
    >>> import control, gearlib as gl, matplotlib.pyplot as plt
    >>> axes = gl.bode_plot(control.tf([1], [1, 2, 1, 0]))
    >>> plt.close()
    """
    plt = optional("matplotlib.pyplot")
    MaxNLocator = optional("matplotlib.ticker").MaxNLocator

    chosen = as_loop(model, loop, gain=gain, at=at, parameters=parameters)
    omega, curve = _curve(chosen)
    m = margins(chosen)
    if axes is None:
        _, axes = plt.subplots(2, 1, sharex=True, figsize=(8, 6), layout="constrained")
    check_axes(axes, 2)
    phase = np.degrees(np.unwrap(np.angle(curve)))
    phase += 360 * np.round((-90 - phase[0]) / 360)
    level, hertz = 20 * np.log10(np.maximum(np.abs(curve), 1e-300)), omega / (2 * np.pi)
    axes[0].semilogx(hertz, level, color=CURVE)
    axes[1].semilogx(hertz, phase, color=CURVE)
    axes[0].axhline(0, color="0.5", lw=0.8)
    for c in m.phase_crossings:
        if 0 < c.omega < np.inf:
            f = c.omega / (2 * np.pi)
            label = f"gain margin {c.gain_margin_db:.2f} dB at {f:.4g} Hz"
            axes[0].plot([f, f], [-c.gain_margin_db, 0], color=GAIN, lw=2, marker="s", ms=4, label=label)
            axes[1].axvline(f, color=GAIN, lw=0.8, ls=":")
    for g in m.gain_crossings:
        f = g.omega / (2 * np.pi)
        here = float(np.interp(g.omega, omega, phase))
        label = f"phase margin {g.phase_margin:.2f}° at {f:.4g} Hz"
        axes[1].plot([f, f], [here - g.phase_margin, here], color=PHASE, lw=2, marker="o", ms=4, label=label)
        axes[0].axvline(f, color=PHASE, lw=0.8, ls=":")
    for line in np.arange(-1260, 901, 360):
        if phase.min() - 30 <= line <= phase.max() + 30:
            axes[1].axhline(line, color="0.5", lw=0.8)
    missing = [text for text, found in zip(margin_labels(m), (m.phase_crossings, m.gain_crossings), strict=True) if not found]
    for ax, kind in zip(axes, ("gain", "phase"), strict=True):
        for text in missing:
            if text.startswith(kind):
                ax.plot([], [], " ", label=text)
        ax.grid(alpha=0.3, which="both")
        if ax.get_legend_handles_labels()[0]:
            ax.legend(fontsize=8)
    axes[0].set_ylabel("gain |L|, dB")
    axes[1].set_ylabel("phase of L, deg")
    axes[1].yaxis.set_major_locator(MaxNLocator(steps=[1, 4.5, 9, 10]))
    axes[1].set_xlabel("frequency, Hz")
    axes[0].set_title(_title(chosen, "Bode plot"))
    return axes


def root_locus_plot(
    model: Any, loop: Sequence[Any] | None = None, *, gain: float = 1.0, at: Any = None,
    parameters: Mapping[str, float] | None = None, gains: Any = None, axes: Any = None,
) -> Any:  # fmt: skip
    """Root locus: closed-loop poles over increasing gain, with the gains at the stability limits.

    Parameters
    ----------
    model, loop, gain, at, parameters
        As for `gearlib.stability`: the loop from an input to an output, closed by negative feedback.
    gains : array, optional
        Increasing gains; by default from 0 to well beyond the last margin.
    axes : matplotlib Axes, optional
        Axes to draw into.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    ArgumentError, NameLookupError
        Unknown signal, or several and none chosen.

    Examples
    --------
    >>> import control, gearlib as gl, matplotlib.pyplot as plt
    >>> axes = gl.root_locus_plot(control.tf([1], [1, 2, 1, 0]))
    >>> plt.close()
    """
    plt = optional("matplotlib.pyplot")

    chosen = as_loop(model, loop, gain=gain, at=at, parameters=parameters)
    m = margins(chosen)
    factors = increasing("gains", gains, 1) if gains is not None else gains_of(chosen, m)
    paths = paths_of(chosen, factors)
    if axes is None:
        _, axes = plt.subplots(figsize=(8, 6), layout="constrained")
    check_axes(axes, 1)
    colours = plt.get_cmap("viridis")(np.linspace(0, 0.85, len(paths.T)))
    for path, colour in zip(paths.T, colours, strict=True):
        axes.plot(path.real, path.imag, color=colour, lw=1.2)
    opened, closed = chosen.open_poles.values, chosen.closed_poles.values
    axes.plot(opened.real, opened.imag, "x", color="black", ms=8, mew=1.5, label="open-loop poles (gain 0)")
    axes.plot(closed.real, closed.imag, "o", color=CURVE, ms=5, label="closed-loop poles (gain 1)")
    zeros = chosen.zeros
    reach = 1.25 * max(float(np.abs(opened).max(initial=0.0)), float(np.abs(closed).max(initial=0.0)), 1e-12)
    zeros = zeros[np.abs(zeros) < 4 * reach]
    axes.plot(zeros.real, zeros.imag, "o", mfc="none", mec=PHASE, ms=8, mew=1.5, label="zeros")
    for k, c in enumerate(c for c in m.phase_crossings if np.isfinite(c.omega)):
        label = f"on the imaginary axis at gain {c.gain_margin:.4g} ({c.gain_margin_db:.2f} dB)"
        axes.plot([0, 0], [c.omega, -c.omega], "D", color=POINT if not k else GAIN, ms=6, label=label)
    axes.axvline(0, color="0.4", lw=0.9)
    axes.axhline(0, color="0.8", lw=0.7, zorder=0)
    shown = np.concatenate([opened.real, closed.real, zeros.real, [0.0]])
    spare = max(0.4 * np.ptp(shown), 0.1 * reach)
    axes.set_xlim(shown.min() - spare, shown.max() + spare)
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("real part, 1/s")
    axes.set_ylabel("imaginary part, rad/s")
    axes.set_title(f"{_title(chosen, 'Root locus')}, gain {factors[0]:.3g} .. {factors[-1]:.3g}", fontsize=11)
    axes.legend(fontsize=8, loc="best")
    axes.grid(alpha=0.25)
    return axes


def gains_of(loop: Loop, m: Margins) -> Floats:
    """Gains from almost zero to well beyond the last margin."""
    peak = float(np.nanmax(np.abs(_curve(loop)[1])))
    last = max([10.0, 30.0 / max(peak, 1e-300), *(5 * c.gain_margin for c in m.phase_crossings)])
    return np.concatenate([[0.0], np.geomspace(1e-5 * last, last, 600)])


def paths_of(loop: Loop, factors: Floats) -> Complexes:
    """Closed-loop poles over the gain, tracked by the shortest total path; (gains, poles)."""
    from scipy.optimize import linear_sum_assignment

    _, scale = balance(loop.A)
    rows: list[Any] = []
    for factor in factors:
        values = np.linalg.eigvals(loop.closed(float(factor)) / scale[:, None] * scale)
        if rows:
            _, order = linear_sum_assignment(np.abs(rows[-1][:, None] - values[None, :]))
            values = values[order]
        rows.append(values)
    return np.array(rows)
