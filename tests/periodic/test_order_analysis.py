"""Order spectra of motions that are written down: which lines there are, and the amplitude of each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.files.contents import Record
from gearlib.periodic import order_analysis
from gearlib.stored_result import StoredResult

UNITS = {"signal": "N.m", "angle": "rad", "speed": "rad/s", "back": "rad"}


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    plt.close("all")


def turning(turns: float, samples: int, orders: dict[float, float], mean: float = 0.0, ramp: float = 0.0) -> StoredResult:
    """A shaft that turns once a second at first, and ``ramp`` times a second faster after each; a signal with these orders."""
    end = turns if not ramp else (np.sqrt(1 + 2 * ramp * turns) - 1) / ramp
    t = np.linspace(3.0, 3.0 + end, samples)
    s = t - 3.0
    angle = 2 * np.pi * (s + ramp * s**2 / 2)
    signal = np.full(samples, mean) + sum(a * np.cos(k * angle + 0.3 * k) for k, a in orders.items())
    data = np.column_stack([signal, angle + 11.0, 2 * np.pi * (1 + ramp * s), 5.0 - angle])
    return StoredResult(Record(t, data, tuple(UNITS), (0, 1, 2, 3), (1,) * 4, tuple(UNITS.values()), ("",) * 4))


@pytest.mark.parametrize("reference", ["angle", "speed", "back"])
def test_a_spectrum_has_the_amplitude_of_each_order_and_the_neighbours_of_its_window(reference: str) -> None:
    """A Hann window shows half of a line beside it, and all of the mean; with 16.2 samples a revolution, orders end at 8.1."""
    run = turning(6.0, 98, {2.0: 0.5, 4.5: 3.0}, mean=-2.0)
    spectrum = gl.order_spectrum(run, "signal", reference)
    assert spectrum.orders == pytest.approx(np.arange(8 * 6 + 1) / 6)
    expected = np.zeros(49)
    expected[[0, 1]] = 2.0
    expected[[11, 12, 13]] = 0.25, 0.5, 0.25
    expected[[26, 27, 28]] = 1.5, 3.0, 1.5
    assert spectrum.amplitudes == pytest.approx(expected, abs=0.02)  # of the splines through 3.6 samples a wave
    fine = gl.order_spectrum(turning(6.0, 6 * 64 + 1, {2.0: 0.5, 4.5: 3.0}, mean=-2.0), "signal", reference, max_order=8.0)
    assert fine.orders.tolist() == pytest.approx(spectrum.orders.tolist())
    assert fine.amplitudes == pytest.approx(expected, abs=1e-6)


def test_only_whole_revolutions_are_transformed() -> None:
    """Of 5.9 revolutions five, whose lines are a fifth of an order apart; of 0.99 none."""
    spectrum = gl.order_spectrum(turning(5.9, 600, {1.2: 2.0}), "signal", "angle")
    assert spectrum.orders[1] == pytest.approx(0.2)
    assert spectrum.at(1.2) == pytest.approx(2.0, rel=1e-6)
    assert gl.order_spectrum(turning(1.0, 101, {1.0: 1.0}), "signal", "angle").orders[1] == 1.0
    with pytest.raises(ArgumentError, match=r"angle turns 0\.99 times in the interval"):
        gl.order_spectrum(turning(0.99, 100, {1.0: 1.0}), "signal", "angle")


def test_an_interval_holds_both_its_ends() -> None:
    """From 4 s to 6 s in steps of an eighth: two revolutions, 17 samples."""
    run = turning(9.0, 73, {1.0: 2.0})
    spectrum = gl.order_spectrum(run, "signal", "angle", t_start=4.0, t_end=6.0)
    assert spectrum.orders[1] == pytest.approx(0.5)
    assert spectrum.at(1.0) == pytest.approx(2.0, rel=1e-2)
    assert gl.order_spectrum(run, "signal", "angle", t_start=8.0).orders[1] == pytest.approx(1 / 4)
    assert gl.order_spectrum(run, "signal", "angle", t_end=5.0).orders[1] == pytest.approx(1 / 2)
    assert gl.order_spectrum(run, "signal", "angle", t_start=4.0, t_end=4.0 + 11 / 8).orders[1] == 1.0  # 12 samples
    with pytest.raises(ArgumentError, match="the interval holds 11 samples; a spectrum needs more"):
        gl.order_spectrum(run, "signal", "angle", t_start=4.0, t_end=4.0 + 10 / 8)


@pytest.mark.parametrize("turns", range(1, 9))
def test_an_interval_that_misses_its_samples_by_rounding_holds_all_revolutions(turns: int) -> None:
    """From 0.1 s in steps of a hundredth: a sum of decimal fractions may be less than the sample that it means."""
    run = turning(9.0, 901, {7.5: 2.0})
    for k in range(40):
        begin = 3.0 + 0.01 * k
        spectrum = gl.order_spectrum(run, "signal", "angle", t_start=begin, t_end=begin + turns)
        assert spectrum.orders[1] == pytest.approx(1 / turns)


@pytest.mark.parametrize("short", [0.0, 1e-12, 1e-9, 1e-7])
def test_revolutions_are_whole_up_to_the_errors_of_a_run(short: float) -> None:
    """The angle of a run with a tolerance of 1e-6 misses its end a little: six revolutions, not five, and as many blocks."""
    run = turning(6.0 - short, 601, {4.5: 2.0})
    spectrum = gl.order_spectrum(run, "signal", "angle")
    assert spectrum.orders[1] == pytest.approx(1 / 6)
    assert spectrum.at(4.5) == pytest.approx(2.0, rel=1e-4)
    assert gl.order_waterfall(run, "signal", "angle", revolutions=2).amplitudes.shape[0] == 5


def test_the_order_at_is_that_of_the_nearest_line_and_none_beyond_the_last() -> None:
    spectrum = gl.order_spectrum(turning(4.0, 4 * 32 + 1, {3.0: 1.0, 7.5: 2.0}), "signal", "angle", max_order=7.5)
    assert spectrum.orders[-1] == 7.5
    for order in (2.9, 3.0, 3.12):
        assert spectrum.at(order) == pytest.approx(1.0, rel=1e-3)
    assert spectrum.at(3.13) == pytest.approx(0.5, rel=1e-3)
    assert spectrum.at(0) == pytest.approx(0.0, abs=1e-3)
    assert spectrum.at(7.62) == spectrum.at(7.5) == pytest.approx(2.0, rel=1e-3)
    for order, said in ((7.63, "7.63"), (-1e-9, "-1e-09")):
        with pytest.raises(ArgumentError, match=f"order {said} is not in this spectrum of signal, which goes from 0 to 7.5;"):
            spectrum.at(order)
    with pytest.raises(ArgumentError, match="max_order is 0; expected a positive order"):
        gl.order_spectrum(turning(4.0, 129, {3.0: 1.0}), "signal", "angle", max_order=0)
    only = gl.order_spectrum(turning(4.0, 129, {}, mean=2.0), "signal", "angle", max_order=0.1)
    assert (only.orders.tolist(), only.at(0.0)) == ([0.0], pytest.approx(2.0))
    with pytest.raises(ArgumentError, match=r"order 0\.01 is not in this spectrum"):
        only.at(0.01)


def test_waves_above_all_orders_are_not_seen_as_lower_ones_where_the_shaft_is_slow() -> None:
    """300 waves a second, at 5 revolutions a second 60 of each: the orders shown end at 25, those of 40 revolutions a second."""
    t = np.linspace(0.0, 2.0, 4001)
    turns = 5.0 * t + 35.0 * 0.05 * np.log1p(np.exp((t - 1.5) / 0.05))  # 5 a second, and 40 from 1.5 s on
    data = np.column_stack([np.cos(2 * np.pi * 300.0 * t), 2 * np.pi * turns])
    run = StoredResult(Record(t, data, ("x", "angle"), (0, 1), (1, 1), ("N", "rad"), ("", "")))
    found = gl.order_waterfall(run, "x", "angle", revolutions=2)
    slow = found.speeds < 2 * np.pi * 5.5
    assert slow.sum() > 3
    assert found.orders[-1] == pytest.approx(25.0, abs=0.5)
    assert found.amplitudes[slow].max() < 1e-3
    assert found.amplitudes[-1].max() > 0.9
    assert gl.order_spectrum(run, "x", "angle", t_end=1.0, max_order=70.0).at(60.0) == pytest.approx(1.0, rel=1e-3)
    whole = gl.order_spectrum(run, "x", "angle")
    assert whole.amplitudes[whole.orders < 6.0].max() < 0.01


@pytest.mark.parametrize("reference", ["angle", "speed", "back"])
def test_times_that_a_file_repeats_at_events_count_once(reference: str) -> None:
    plain = turning(6.0, 385, {2.0: 0.5})
    twice = np.sort(np.append(np.arange(385), [0, 100, 100, 250, 384]))
    data = np.column_stack([plain[name] for name in UNITS])[twice]
    run = StoredResult(Record(plain.time[twice], data, tuple(UNITS), (0, 1, 2, 3), (1,) * 4, tuple(UNITS.values()), ("",) * 4))
    spectra = [gl.order_spectrum(each, "signal", reference) for each in (plain, run)]
    assert spectra[0].amplitudes.tolist() == spectra[1].amplitudes.tolist()


def test_what_turns_to_and_fro_has_no_orders() -> None:
    t = np.linspace(0.0, 1.0, 50)
    for motion in (np.sin(20 * t), np.minimum(30 * t, 20.0)):
        run = StoredResult(Record(t, np.column_stack([t, motion]), ("x", "angle"), (0, 1), (1, 1), ("N", "rad"), ("", "")))
        with pytest.raises(ArgumentError, match="angle does not turn in one direction all the time"):
            gl.order_spectrum(run, "x", "angle")
    with pytest.raises(ArgumentError, match=r"x is in N; expected an angle \(rad\) or a speed \(rad/s\)"):
        gl.order_spectrum(run, "x", "x")


@pytest.mark.parametrize(("overlap", "pieces"), [(0.0, 3), (0.5, 5), (0.75, 9), (0.95, 41)])
def test_pieces_follow_each_other_by_what_they_do_not_overlap(overlap: float, pieces: int) -> None:
    """Twelve revolutions in pieces of four; each in the middle of its time, with the speed that it has on average."""
    run = turning(12.0, 2001, {3.0: 1.5}, ramp=0.5)
    found = gl.order_waterfall(run, "signal", "angle", revolutions=4, overlap=overlap, max_order=10.0)
    starts = 4 * (1 - overlap) * np.arange(pieces)
    when = [np.sqrt(1 + turns) * 2 - 2 for turns in (starts, starts + 4)]  # s + s**2 / 4 turns after s seconds
    assert found.times == pytest.approx(3.0 + (when[0] + when[1]) / 2, rel=1e-5)
    assert found.speeds == pytest.approx(2 * np.pi * 4 / (when[1] - when[0]), rel=1e-4)
    assert found.orders == pytest.approx(np.arange(41) / 4)
    assert found.amplitudes.shape == (pieces, 41)
    assert found.amplitudes[:, 12] == pytest.approx(1.5, rel=1e-6)
    backwards = gl.order_waterfall(run, "signal", "back", revolutions=4, overlap=overlap, max_order=10.0)
    assert backwards.speeds == pytest.approx(-found.speeds, rel=1e-9)
    assert backwards.amplitudes == pytest.approx(found.amplitudes, abs=1e-9)
    assert np.delete(found.amplitudes, [11, 12, 13], axis=1).max() < 1e-6


@pytest.mark.parametrize("overlap", [-0.01, 0.951, 1.0])
def test_other_overlaps_are_refused(overlap: float) -> None:
    with pytest.raises(ArgumentError, match=f"overlap is {overlap}; expected a number from 0 to 0.95"):
        gl.order_waterfall(turning(5.0, 200, {}), "signal", "angle", overlap=overlap)


def test_a_waterfall_needs_one_piece() -> None:
    assert len(gl.order_waterfall(turning(8.0, 400, {1.0: 1.0}), "signal", "angle").times) == 1
    with pytest.raises(ArgumentError, match=r"angle turns 7\.98 times in the run; a piece needs 8"):
        gl.order_waterfall(turning(7.98, 400, {1.0: 1.0}), "signal", "angle")
    with pytest.raises(ArgumentError, match="revolutions is 0"):
        gl.order_waterfall(turning(8.0, 400, {1.0: 1.0}), "signal", "angle", revolutions=0)
    assert len(gl.order_waterfall(turning(2.0, 100, {1.0: 1.0}), "signal", "angle", revolutions=1, overlap=0).times) == 2


def drawn(found: gl.OrderWaterfall, **options: Any) -> tuple[np.ndarray, np.ndarray, Any]:
    """Heights and colours of a plot, and its axes."""
    axes = found.plot(**options)
    (image,) = axes.collections
    edges = np.asarray(image.get_coordinates())[:, 0, 1]
    assert image.get_clim()[1] == 0.0
    return (edges[1:] + edges[:-1]) / 2, np.asarray(image.get_array()).reshape(found.amplitudes.shape), axes


@pytest.mark.parametrize("faster", [True, False])
def test_a_waterfall_is_drawn_over_the_speed_in_decibels_below_its_peak(faster: bool) -> None:
    speeds = np.array([10.0, 20.0, 30.0])[:: 1 if faster else -1]
    found = gl.OrderWaterfall(
        np.array([1.0, 2.0, 3.0]), speeds, np.arange(3.0), np.array([[5.0, 0.5, 0.0], [1, 2, 3], [4, 1e-9, 5]]), "x", "a", "N.m"
    )
    heights, colours, axes = drawn(found)
    assert heights == pytest.approx(speeds * 60 / (2 * np.pi))
    assert colours == pytest.approx(20 * np.log10(np.maximum(found.amplitudes / 5.0, 1e-4)))
    assert axes.get_ylabel() == "mean speed of a, 1/min"
    assert axes.get_xlabel() == "order of a, events per revolution"
    assert axes.figure.axes[1].get_ylabel() == "amplitude of x, dB over 5 N·m"
    assert axes.collections[0].get_clim()[0] == -80.0
    assert drawn(found, decibels=1000)[1].min() == pytest.approx(-1000.0)
    for wrong in (0, -1.0, 1000.1):
        with pytest.raises(ArgumentError, match=f"decibels is {wrong}; expected a positive range, dB, up to 1000"):
            found.plot(decibels=wrong)


@pytest.mark.parametrize("speeds", [[10.0, 20.0, 20.0], [10.0, 30.0, 20.0], [20.0, 20.0, 10.0]])
def test_a_waterfall_is_drawn_over_time_where_the_speed_goes_up_and_down(speeds: list[float]) -> None:
    found = gl.OrderWaterfall(np.array([1.0, 2.0, 3.0]), np.array(speeds), np.arange(2.0), np.ones((3, 2)), "x", "a", "")
    heights, _, axes = drawn(found)
    assert heights == pytest.approx(found.times)
    assert axes.get_ylabel() == "time, s"
    assert axes.figure.axes[1].get_ylabel() == "amplitude of x, dB over 1"


def test_a_spectrum_is_drawn_above_a_floor() -> None:
    """Twelve decades below the largest line, so that a line of zeros does not stretch the scale; a table has them as they are."""
    spectrum = gl.OrderSpectrum(np.arange(4.0), np.array([0.0, 5.0, 1e-20, 2.0]), "x", "a", "N.m")
    ax = spectrum.plot()
    assert ax.lines[0].get_ydata() == pytest.approx([5e-12, 5.0, 5e-12, 2.0])
    assert ax.lines[0].get_xdata() == pytest.approx(spectrum.orders)
    assert (ax.get_ylabel(), ax.get_yscale()) == ("amplitude of x, N·m", "log")
    table = spectrum.to_dataframe()
    assert (table.index.tolist(), table["x"].tolist()) == (spectrum.orders.tolist(), spectrum.amplitudes.tolist())


class Ripple(gl.Component):
    """A shaft at a constant speed, whose torque has 20 waves in a turn; ``square`` makes them rectangles."""

    square = gl.Structural(False)
    lag = gl.Parameter("s", default=1.0)
    speed = gl.Variable("rad/s", state="never")
    phi = gl.Variable("rad")
    y = gl.Variable("rad")

    def equations(self) -> list[Any]:
        wave = gl.sin(20 * self.phi)
        return [
            gl.Eq(self.speed, 10.0),
            gl.Eq(gl.der(self.phi), self.speed),
            gl.Eq(self.lag * gl.der(self.y), (gl.sign(wave) if self.square else wave) - self.y),
        ]


@pytest.mark.parametrize("method", ["rk", "ida", "taylor"])
def test_spectra_of_waves_between_the_samples_warn(method: str) -> None:
    """32 waves in a second: seen 30 times in a second, they look like 2."""
    system = gl.compile(Ripple())
    rare, often = (system.simulate(20.0, samples=n, method=method) for n in (601, 6001))
    assert gl.order_spectrum(often, "y", "phi", t_start=10.0).at(20) == pytest.approx(1 / 200, rel=0.01)
    often.plot_spectrum("y", t_start=10.0)
    with pytest.warns(gl.GearlibWarning, match="y is sampled too rarely: .* simulate with more samples than 601"):
        assert gl.order_spectrum(rare, "y", "phi", t_start=10.0).orders[-1] < 10
    with pytest.warns(gl.GearlibWarning, match="y is sampled too rarely"):
        gl.order_waterfall(rare, "y", "phi")
    with pytest.warns(gl.GearlibWarning, match="y is sampled too rarely"):
        rare.plot_spectrum("y", t_start=10.0)


def test_spectra_of_edges_do_not_warn() -> None:
    run = gl.compile(Ripple(square=True, lag=1e-4)).simulate(4.0, samples=8001)
    assert gl.order_spectrum(run, "y", "phi").at(20) == pytest.approx(4 / np.pi, rel=0.01)


def test_waves_are_not_seen_in_a_few_samples() -> None:
    run = gl.compile(Ripple()).simulate(1.0, samples=101)
    for interval in ({"t_start": 0.99}, {"t_end": 0.05}, {"t_start": 2.0}):
        with pytest.raises(ArgumentError, match=r"the interval holds \d samples; it takes 8 to see waves"):
            run.check_sampling("y", **interval)


def finer(angle: Any, begin: float = 0.0, revolutions: int = 1) -> int:
    """Of a block that begins at an angle, with eight samples in each revolution at least."""
    return order_analysis.finer(np.asarray(angle, float), np.diff(angle), begin, revolutions, 8)


def test_a_block_is_resampled_as_finely_as_its_slowest_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of other blocks do not count; where the shaft almost stands still, the number of samples limits the points."""
    step = 2 * np.pi / 8
    even = step * np.arange(25.0)  # three revolutions
    assert [finer(even, begin) for begin in (0.0, 2 * np.pi, 4 * np.pi)] == [1, 1, 1]
    third = np.sort(np.concatenate([even, even[9] + step / 3 * np.array([1, 2])]))  # in the second one
    assert [finer(third, begin) for begin in (0.0, 2 * np.pi, 4 * np.pi)] == [1, 3, 1]
    assert [finer(third, begin, 2) for begin in (0.0, 2 * np.pi)] == [3, 3]
    still = np.sort(np.append(even, even[9] + 1e-9))
    assert finer(still, 2 * np.pi) == 32 * 9 / 8
    assert finer(still, 0.0) == 1
    assert finer(still, 0.0, 2) == np.ceil(32 * 17 / 16)
    monkeypatch.setattr(order_analysis, "MANY", 100)
    assert finer(still, 2 * np.pi) == np.ceil(100 / 8)
    monkeypatch.setattr(order_analysis, "MANY", 10)  # a block with that many samples of its own has four points for each
    assert finer(still, 2 * np.pi) == np.ceil(4 * 9 / 8)
