"""Plots without a time axis, and spectra, of histories made by hand."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction

import matplotlib.pyplot as plt
import numpy as np
import pytest

from gearlib.drawing.curves import loop_work, plot_against, plot_spectrum, spectrum, stroboscopic
from gearlib.drawing.histories import DASHES, MOST_LINES, History, plot_histories, shown_units
from gearlib.drawing.page import MOST_POINTS, thinned
from gearlib.drawing.quantities import Shown
from gearlib.drawing.style import COLOURS
from gearlib.errors import ArgumentError


@pytest.fixture(autouse=True)
def _close() -> Iterator[None]:
    yield
    plt.close("all")


def ellipse(unit_x: str = "m", unit_y: str = "N") -> tuple[History, History]:
    """Three and a half turns of 2 s, a little uneven in time, the last one twice as wide."""
    t = np.linspace(0, 7, 701)
    wide = np.where(t >= 5, 2.0, 1.0)
    return History("x", unit_x, t, wide * np.sin(np.pi * t)), History("f", unit_y, t, 3 * np.cos(np.pi * t))


def test_times_of_whole_periods_end_with_the_run() -> None:
    t = np.linspace(1.0, 3.0, 21)
    assert stroboscopic(t, 0.5).tolist() == pytest.approx([1.0, 1.5, 2.0, 2.5, 3.0])
    assert stroboscopic(t, 0.6).tolist() == pytest.approx([1.2, 1.8, 2.4, 3.0])
    assert stroboscopic(t, 2.0).tolist() == [1.0, 3.0]
    assert stroboscopic(np.linspace(0, 0.3, 4), 0.1).tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])  # 0.3 / 0.1 < 3 in floats
    for period in (2.001, 0.0, -1.0):
        with pytest.raises(
            ArgumentError, match=rf"period is {period:g} s; expected a positive time, up to that of the run, 2 s"
        ):
            stroboscopic(t, period)
    with pytest.raises(ArgumentError, match=r"period is 4.94066e-324 s; expected .* and not below that between samples"):
        stroboscopic(t, 5e-324)
    assert stroboscopic(t, Fraction(1, 2)).tolist() == stroboscopic(t, 0.5).tolist()


def test_work_is_the_area_between_two_times() -> None:
    x, f = ellipse()
    assert loop_work(x, f, 5.0, 7.0) == pytest.approx(6 * np.pi, rel=1e-3)
    assert loop_work(x, f, 1.0, 3.0) == pytest.approx(3 * np.pi, rel=1e-3)
    t = np.array([0.0, 1.0, 2.0, 4.0])
    ramp = History("x", "m", t, t), History("f", "N", t, 1 + 2 * t)
    assert loop_work(*ramp, 0.5, 3.5) == pytest.approx(
        (3.5 + 3.5**2) - (0.5 + 0.5**2)
    )  # trapezoids are exact, ends between samples


def test_the_work_of_a_loop_with_few_samples_is_stated_with_its_error() -> None:
    t = np.linspace(0.0, 3.0, 31)
    x, f = (History(name, unit, t, curve(2 * np.pi * t)) for name, unit, curve in (("x", "m", np.sin), ("f", "N", np.cos)))
    label = plot_against(x, f, (Shown("m", 1.0), Shown("N", 1.0)), period=1.0).lines[1].get_label()
    work, error = (float(number) for number in re.findall(r"([\d.]+) J", label))
    assert abs(work - np.pi) < error < 3 * abs(work - np.pi) + 0.3


def test_the_last_period_is_told_from_those_before() -> None:
    x, f = ellipse()
    axes = plot_against(x, f, (Shown("mm", 1e3), Shown("kN", 1e-3)), period=2.0)
    before, last, marks = axes.lines
    assert len(before.get_xdata()) == 500
    assert len(last.get_xdata()) == 201
    assert np.abs(before.get_xdata()).max() == pytest.approx(1e3)
    assert np.abs(last.get_xdata()).max() == pytest.approx(2e3)
    assert np.abs(last.get_ydata()).max() == pytest.approx(3e-3)
    assert last.get_label() == f"last period, {loop_work(x, f, 5.0, 7.0):.4g} J"
    assert last.get_linewidth() > before.get_linewidth()
    assert marks.get_label() == "every 2 s"
    assert pytest.approx(np.array([[0, -3e-3]] * 4), abs=1e-9) == np.array(marks.get_data()).T
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x, mm", "f, kN")
    assert axes.get_legend() is not None


@pytest.mark.parametrize(
    ("x", "y", "said"), [("rad", "N.m", True), ("N", "m", True), ("rad", "rad/s", False), ("m", "N.m", False)]
)
def test_a_loop_has_work_where_it_is_of_a_path_and_its_force(x: str, y: str, said: bool) -> None:
    axes = plot_against(*ellipse(x, y), (Shown("a", 1.0), Shown("b", 1.0)), period=2.0)
    assert (" J" in axes.lines[1].get_label()) is said


def test_without_a_period_there_is_one_curve() -> None:
    x, f = ellipse()
    axes = plot_against(x, f, (Shown("m", 1.0), Shown("N", 2.0)))
    (line,) = axes.lines
    assert line.get_label() == "f over x"
    assert line.get_ydata() == pytest.approx(2 * f.values)
    assert axes.get_legend() is None


@pytest.mark.parametrize("window", ["hann", "flattop", "blackman", "rectangular"])
def test_amplitudes_of_tones_that_fit_the_interval(window: str) -> None:
    t = 3.0 + np.arange(400) / 100
    history = History("x", "m", t, -0.7 + 2 * np.sin(2 * np.pi * 10 * t) + 0.5 * np.cos(2 * np.pi * 25 * t))
    f, a = spectrum(history, window)
    assert f == pytest.approx(np.arange(201) * 0.25)
    at = {freq: a[int(4 * freq)] for freq in (0, 10, 25)}
    assert at == pytest.approx({0: 0.7, 10: 2.0, 25: 0.5}, rel=1e-3)
    f_late, a_late = spectrum(history, window, 5.0)
    assert f_late == pytest.approx(np.arange(101) * 0.5)
    assert a_late[20] == pytest.approx(2.0, rel=1e-2)


@pytest.mark.parametrize("window", ["hann", "flattop", "blackman", "rectangular"])
def test_the_last_line_of_an_even_number_of_samples_is_not_doubled(window: str) -> None:
    """Two samples a wave, 0.5 above and below the mean; of an odd number of samples no line is there."""
    values = 3.0 + 0.5 * (-1.0) ** np.arange(400)
    f, a = spectrum(History("x", "m", np.arange(400) / 100, values), window)
    assert (f[-1], a[-1]) == pytest.approx((50.0, 0.5), rel=1e-9)
    tone = 2 * np.cos(2 * np.pi * 200 * np.arange(401) / 401)  # the last line
    assert spectrum(History("x", "m", np.arange(401) / 100, tone), "rectangular")[1][-1] == pytest.approx(2.0)


def test_a_spectrum_needs_eight_even_samples() -> None:
    def of(times: object) -> History:
        return History("x", "m", np.asarray(times, float), np.arange(len(np.asarray(times)), dtype=float) ** 2)

    assert len(spectrum(of(np.arange(8)))[0]) == 5
    with pytest.raises(ArgumentError, match="the interval holds 7 samples; a spectrum needs 8 or more"):
        spectrum(of(np.arange(7)))
    with pytest.raises(ArgumentError, match="the interval holds 7 samples"):
        spectrum(of(np.arange(9)), t_start=1.5)
    spectrum(of(np.arange(8) + [0, 0, 4e-7, 0, 0, 0, 0, 0]))  # rounding of times
    for unit in (1.0, 1e-3, 1e3):
        with pytest.raises(ArgumentError, match=r"equally spaced samples; simulate with samples=\.\.\."):
            spectrum(of(unit * (np.arange(8) + [0, 0, 6e-7, 0, 0, 0, 0, 0])))
        spectrum(of(unit * (np.arange(8) + [0, 0, 4e-7, 0, 0, 0, 0, 0])))


def test_a_spectrum_is_shown_over_six_decades_below_its_peak() -> None:
    t = np.arange(400) / 100
    history = History("x", "m", t, 5.0 + 2 * np.sin(2 * np.pi * 10 * t))
    axes = plot_spectrum(history, Shown("mm", 1e3))
    f, a = axes.lines[0].get_data()
    assert (f[0], len(f)) == (0.25, 200)  # without the mean
    assert a.max() == pytest.approx(2000.0)
    assert axes.get_ylim() == pytest.approx((2e-3, 4e3))
    assert axes.get_xlim() == (0, 50)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("frequency, Hz", "amplitude of x, mm")
    assert axes.get_title() == "Spectrum of x, window: hann"
    assert plot_spectrum(history, Shown("m", 1.0), f_max=20.0).get_xlim() == (0, 20)
    with pytest.raises(ArgumentError, match="f_max is 0; expected a positive frequency"):
        plot_spectrum(history, Shown("m", 1.0), f_max=0)
    assert plot_spectrum(History("x", "m", t, 0 * t), Shown("m", 1.0)).get_ylim() == pytest.approx((1e-6, 2))


def histories(*units: str, run: str = "") -> list[History]:
    t = np.linspace(0, 1, 11)
    return [History(f"v{k}", unit, t, (k + 1) * t, run) for k, unit in enumerate(units)]


def test_lines_of_runs_share_colours_and_differ_in_dashes() -> None:
    runs = [history for run in ("", "b", "c", "d", "e", "f") for history in histories("m", "m", run=run)]
    axes = plot_histories(runs)
    lines = {line.get_label(): line for line in axes.lines}
    assert list(lines)[:4] == ["v0", "v1", "v0 (b)", "v1 (b)"]
    for k in (0, 1):
        own = [line for label, line in lines.items() if label.startswith(f"v{k}")]
        assert {line.get_color() for line in own} == {COLOURS[k]}
    patterns = [lines[f"v0{run}"]._unscaled_dash_pattern for run in ("", " (b)", " (c)", " (d)", " (e)", " (f)")]
    assert [p[1] and tuple(p[1]) for p in patterns] == [None, *(d[1] for d in DASHES), DASHES[0][1]]
    assert lines["v0"].get_linewidth() > lines["v0 (b)"].get_linewidth() == lines["v0 (f)"].get_linewidth()
    many = plot_histories(histories(*["m"] * 9))
    assert [line.get_color() for line in many.lines] == [*COLOURS, COLOURS[0]]


def test_each_unit_has_a_diagram_with_the_name_of_its_quantity() -> None:
    rows = plot_histories(histories("m", "N", "m", "1", "N.m2"), units={"s": "ms", "v1": "kN"})
    assert [row.get_ylabel() for row in rows] == ["displacement, m", "v1, kN", "v3", "v4, N·m²"]
    assert [row.get_xlabel() for row in rows] == ["", "", "", "time, ms"]
    assert [len(row.lines) for row in rows] == [2, 1, 1, 1]
    assert [row.get_legend() is not None for row in rows] == [True, False, False, False]
    assert rows[1].lines[0].get_ydata()[-1] == pytest.approx(2e-3)
    assert rows[1].lines[0].get_xdata()[-1] == pytest.approx(1000)
    width, height = rows[0].figure.get_size_inches()
    assert (width, height) == pytest.approx((8.0, 1.2 + 4 * 2.3))
    two = plot_histories([*histories("N.m2"), History("w", "N.m2", np.arange(2.0), np.arange(2.0))])
    assert two.get_ylabel() == "value, N·m²"
    again = plot_histories([*histories("m"), *histories("m", run="b")])
    assert again.get_ylabel() == "v0, m"  # one variable in two runs


@pytest.mark.parametrize("count", [0, 1, MOST_LINES, MOST_LINES + 1])
def test_few_events_are_lines_and_many_are_ticks(count: int) -> None:
    events = [(k / 50, "gap") for k in range(count)]
    axes = plot_histories(histories("m"), events, units={"s": "ms"})
    marks = [line for line in axes.lines if line.get_label() == "events"]
    assert len(marks) == (count > 0)
    for mark in marks:
        assert mark.get_xdata() == pytest.approx([20.0 * k for k in range(count)])
        assert (mark.get_ydata() > 0.95).all()
        assert (mark.get_ydata() < 1).all()
    uprights = [s for c in axes.collections for s in c.get_segments()]
    assert len(uprights) == (count if count <= MOST_LINES else 0)
    assert all(s[:, 1].tolist() == [0, 1] for s in uprights)
    assert (axes.get_legend() is not None) == (count > 0)


def test_units_are_chosen_by_name_before_unit() -> None:
    found = shown_units(histories("m", "m", "rad/s"), {"m": "mm", "v1": "µm", "rad/s": "rpm"})
    assert [(s.text, s.factor) for s in found] == [("mm", 1e3), ("µm", 1e6), ("rpm", pytest.approx(30 / np.pi))]
    assert [s.text for s in shown_units(histories("m", "N.m"), None)] == ["m", "N·m"]
    assert [s.text for s in shown_units(histories("N.m"), {"N·m": "kN.m"})] == ["kN·m"]
    with pytest.raises(
        ArgumentError, match=r"units: nothing that is shown is called 'K' or is in that unit; shown: N·m, m, s, v0, v1, v2$"
    ):
        shown_units(histories("m", "N.m", "1"), {"K": "mK"})


def test_long_curves_keep_their_extremes() -> None:
    x = np.linspace(0, 1, MOST_POINTS)
    assert thinned(x, x)[0] is x
    x = np.linspace(0, 1, 3 * MOST_POINTS)
    y = np.random.default_rng(1).normal(size=len(x))
    y[100:200] = np.nan
    a, b = thinned(x, y)
    assert MOST_POINTS / 2 < len(a) <= MOST_POINTS
    assert (a[0], a[-1]) == (0, 1)
    assert (np.diff(a) > 0).all()
    assert b == pytest.approx(y[np.searchsorted(x, a)], nan_ok=True)
    pieces = np.array_split(np.arange(len(x)), MOST_POINTS // 2 - 1)
    kept = set(np.searchsorted(x, a).tolist())
    for piece in pieces[60:]:
        assert {int(piece[y[piece].argmin()]), int(piece[y[piece].argmax()])} <= kept
