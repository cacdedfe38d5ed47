"""Parts of the plots of a loop: labels, marks of margins, contours, limits and gains, of numbers that are written down."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest

import gearlib as gl
from gearlib.feedback import loop_plots as parts
from gearlib.feedback.feedback_loop import Loop, as_loop
from gearlib.feedback.loop_plots import mark_frequencies
from gearlib.feedback.margins import GainCrossing, Margins, PhaseCrossing, margins


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    plt.close("all")


@pytest.fixture
def ax() -> Any:
    return plt.subplots()[1]


def of(*phase: tuple[float, float], gain: tuple[tuple[float, float], ...] = (), modulus: float = 0.4) -> Margins:
    """Margins with crossings (rad/s, factor) of the negative axis, and (rad/s, degrees) of the unit circle."""
    return Margins(tuple(PhaseCrossing(*c) for c in phase), tuple(GainCrossing(*c, 1.0) for c in gain), modulus, 1.0, False)


def data(ax: Any, label: str) -> tuple[list[float], list[float]]:
    (found,) = [line for line in ax.lines if str(line.get_label()).startswith(label)]
    return np.asarray(found.get_xdata(), float).tolist(), np.asarray(found.get_ydata(), float).tolist()


def test_labels_of_margins() -> None:
    assert parts.margin_labels(of((1.0, 10.0), gain=((2.0, -30.0),))) == ("gain margin 20.00 dB", "phase margin -30.00°")
    assert parts.margin_labels(of()) == ("gain margin infinite", "phase margin infinite")


@pytest.mark.parametrize(
    ("points", "near"),
    [
        ([], 1.4),
        ([-0.3], 1.4),
        ([-1.5], 1.8),  # a fifth more
        ([-1.79, -1.3], 1.2 * 1.79),
        ([-1.81], 1.4),  # too far away to be shown
        ([-1.81, -1.6, -0.2], 1.92),
    ],
)
def test_the_neighbourhood_of_the_point_shows_crossings_that_are_near(ax: Any, points: list[float], near: float) -> None:
    parts.nyquist_margins(ax, of(*((1.0, -1 / x) for x in points), gain=((1.0, 60.0), (2.0, -90.0))))
    assert ax.get_xlim() == pytest.approx((-1 - near, -1 + 1.2 * near))
    assert ax.get_ylim() == pytest.approx((-1.1 * near, 1.1 * near))
    x, y = data(ax, "gain margin")
    assert x == pytest.approx(points or [np.nan], nan_ok=True)
    assert y == [0.0] * max(1, len(points))
    x, y = data(ax, "phase margin")
    assert (x, y) == (pytest.approx([-0.5, 0.0]), pytest.approx([-np.sqrt(0.75), 1.0]))


def test_a_curve_without_crossings_has_no_marks_on_the_circle(ax: Any) -> None:
    parts.nyquist_margins(ax, of())
    assert np.isnan(data(ax, "phase margin")[0]).all()


@pytest.mark.parametrize(
    ("point", "said"),
    [
        (-0.5 + 0.5j, False),
        (-0.5 + 3.0j, True),  # above
        (-0.5 - 3.0j, True),  # its image is above
        (3.0, True),
        (-4.0, True),
        (np.nan, True),
    ],
)
def test_a_curve_that_is_not_seen_is_spoken_of_in_its_place(ax: Any, point: complex, said: bool) -> None:
    ax.set_xlim(-2, 0.5)
    ax.set_ylim(-1, 1)
    parts.say_where_it_is(ax, np.array([point, 100.0, -100j]), of(modulus=2.5))
    texts = [(t.get_text(), t.get_position()) for t in ax.texts]
    assert texts == (
        [("the curve is not seen here:\nit comes no nearer to −1\nthan 2.5", (-0.75, pytest.approx(0.6)))] if said else []
    )


def test_crossings_lie_at_the_image_of_the_point_that_is_nearest_to_their_phase(ax: Any) -> None:
    """And at their gain; where the curve crosses the circle, at its own phase."""
    omega, phase = np.array([0.1, 1.0, 10.0]), np.array([-100.0, -185.0, -530.0])
    m = of((1.0, 10.0), (10.0, 0.1), (np.inf, 3.0), gain=((0.55, 10.0),))
    parts.nichols_margins(ax, m, omega, phase)
    assert data(ax, "gain margin") == ([-180.0, -540.0], pytest.approx([-20.0, 20.0]))
    assert data(ax, "phase margin") == (pytest.approx([-142.5]), [0.0])
    ax.cla()
    parts.nichols_margins(ax, of(), omega, phase)
    for label in ("gain margin", "phase margin"):
        assert np.isnan(data(ax, label)[0]).all()


def test_contours_are_named_at_their_tops_or_their_left_ends_within_the_axes(ax: Any) -> None:
    """Around the first image of the point only; at least three hundredths away from the border."""
    ax.set_xlim(-350.0, 350.0)
    ax.set_ylim(-20.0, 25.0)
    taken = parts.closed_loop_lines(ax, [-180.0, 180.0])
    named = {t.get_text(): t.get_position() for t in ax.texts}
    assert len(named) == len(ax.texts) == len(taken) >= 4
    contours: dict[str, Any] = {}
    for k, line in enumerate(ax.lines):
        x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
        centre = (-180.0, 180.0)[k // 6]
        assert centre - 180 <= np.nanmin(x) < np.nanmax(x) <= centre + 180
        assert np.nanmax(x) - centre == pytest.approx(centre - np.nanmin(x), abs=1.0)  # on both sides of the point
        if k < 6:
            contours[f"{(6, 3, 1, -3, -6, -12)[k]:+g} dB"] = x, y
    assert len(ax.lines) == 12
    for text, place in named.items():
        x, y = contours[text]
        inside = (np.abs(x) < 350 - 28) & (y > -20 + 1.35) & (y < 25 - 1.35)
        best = np.argmax(np.where(inside, y, -np.inf)) if text.startswith("+") else np.argmin(np.where(inside, x, np.inf))
        assert place == (x[best], y[best])
    assert np.array(taken) == pytest.approx(ax.transData.transform(list(named.values())))
    assert all(parts.is_free(a, [b], 26.0, 10.0) for i, a in enumerate(taken) for b in taken[:i])


def limits_with(bound: float, share: float, upper: bool) -> tuple[float, float]:
    """Limits of an axis of which a value is away from the upper or the lower one by exactly a share of what lies between them."""
    near = bound + 100.0 * share if upper else bound - 100.0 * share
    far = near - 100.0 if upper else near + 100.0

    def reached() -> float:
        return near - share * (near - far) if upper else near + share * (far - near)

    while reached() != bound:
        near, far = np.nextafter(near, np.inf if reached() < bound else -np.inf), np.nextafter(far, np.inf)
    return (far, near) if upper else (near, far)


@pytest.mark.parametrize("side", ["left", "right", "low", "high"])
def test_a_contour_of_which_one_point_alone_reaches_the_margin_of_the_axes_has_no_name(ax: Any, side: str) -> None:
    """Its rightmost point at the left, and so on."""
    ax.set(xlim=(-900.0, 900.0), ylim=(-200.0, 200.0))
    parts.closed_loop_lines(ax, [-180.0])
    x, y = (np.asarray(part, float) for part in ax.lines[0].get_data())
    which = "xlim" if side in ("left", "right") else "ylim"
    bound = {"left": np.nanmax(x), "right": np.nanmin(x), "low": y.max(), "high": y.min()}[side]
    low, high = limits_with(float(bound), 0.04 if which == "xlim" else 0.03, side in ("right", "high"))
    for inwards in (0.0, 1e-9 if side in ("right", "high") else -1e-9):
        ax.cla()
        ax.set(xlim=(-900.0, 900.0), ylim=(-200.0, 200.0))
        ax.set(**{which: (low + inwards, high + inwards)})
        parts.closed_loop_lines(ax, [-180.0])
        assert ("+6 dB" in [t.get_text() for t in ax.texts]) == bool(inwards)


def test_contours_out_of_view_have_no_name(ax: Any) -> None:
    ax.set_xlim(-100.0, -10.0)
    ax.set_ylim(40.0, 60.0)
    assert parts.closed_loop_lines(ax, [-180.0]) == []
    assert not ax.texts


@pytest.mark.parametrize(
    ("place", "free"),
    [((0, 0), False), ((41, 13), False), ((-41, -13), False), ((43, 0), True), ((0, -15), True), ((-43, 9), True)],
)
def test_a_label_is_free_of_others_beside_or_above_them(place: tuple[float, float], free: bool) -> None:
    others = [np.array([500.0, 500.0]), np.array([0.0, 0.0])]
    assert parts.is_free(np.array(place, float), others, 42.0, 14.0) == free
    assert parts.is_free(np.array(place, float), [], 42.0, 14.0)


def test_frequencies_are_marked_where_the_curve_is_in_view(ax: Any) -> None:
    """With a point at each label, on the curve between its samples; whole decades come first where labels are tight."""
    omega = 2 * np.pi * np.array([0.5, 8.0, 40.0])
    ax.set_xlim(0.0, 30.0)
    ax.set_ylim(-1.0, 60.0)
    hertz = omega / (2 * np.pi)
    mark_frequencies(ax, omega, hertz, 2 * hertz)
    assert [t.get_text() for t in ax.texts] == ["1 Hz", "10 Hz", "20 Hz", "5 Hz"]
    places = [(1.0, 2.0), (10.0, 20.0), (20.0, 40.0), (5.0, 10.0)]
    assert [t.xy for t in ax.texts] == [pytest.approx(place) for place in places]
    assert [(line.get_xdata()[0], line.get_ydata()[0]) for line in ax.lines] == [pytest.approx(place) for place in places]
    ax.cla()
    ax.set_xlim(0.0, 100.0)
    ax.set_ylim(-1.0, 1.0)
    mark_frequencies(ax, omega, hertz, np.array([5.0, 0.0, 0.0]))
    assert [t.get_text() for t in ax.texts] == ["10 Hz", "20 Hz"]  # 1 Hz lies above, 40 Hz is the end


@pytest.mark.parametrize(
    ("model", "last"),
    [
        (control.tf([1.0], [1, 1]), 30.0),
        (control.tf([100.0], [1, 1]), 10.0),
        (control.tf([0.01], [1, 1]), 3000.0),
        (control.tf([1.0], [1, 3, 3, 1]), 40.0),  # the margin is 8
    ],
)
def test_gains_of_a_root_locus_go_beyond_the_last_margin_and_bring_the_curve_to_the_circle(model: Any, last: float) -> None:
    loop = as_loop(model)
    found = parts.gains_of(loop, margins(loop))
    assert (found[0], found[1], found[-1]) == (0.0, pytest.approx(1e-5 * last, rel=1e-3), pytest.approx(last, rel=1e-3))
    assert (np.diff(found) > 0).all()


def test_axes_of_the_plane_go_through_its_origin() -> None:
    for ax in (*gl.nyquist_plot(control.tf([2.0], [1, 1])), gl.root_locus_plot(control.tf([2.0], [1, 1]), gains=[0.0, 1.0])):
        lines = [(list(line.get_xdata()), list(line.get_ydata())) for line in ax.lines]
        assert lines.count(([0, 1], [0, 0])) == 1
        assert lines.count(([0, 0], [0, 1])) == 1


def test_limits_of_a_root_locus() -> None:
    """A quarter beyond the farthest pole; sideways beyond poles, zeros and the origin by two fifths of what lies between them."""
    ax = gl.root_locus_plot(control.tf([1.0], [1, 0, 4.0]), gains=[0.0, 1.0, 2.0])
    reach = 1.25 * np.sqrt(5.0)
    assert ax.get_ylim() == pytest.approx((-reach, reach))
    assert ax.get_xlim() == pytest.approx((-0.1 * reach, 0.1 * reach), rel=1e-6)  # all on the axis
    assert ax.get_title() == "Root locus of the loop u[0] → y[0], gain 0 .. 2"
    ax = gl.root_locus_plot(control.tf([1.0, -3.0], [1, 3, 2]), gains=[0.0, 0.1])
    closed = np.roots([1.0, 4.0, -1.0]).real
    low, high = min(closed), 3.0
    assert ax.get_xlim() == pytest.approx((low - 0.4 * (high - low), high + 0.4 * (high - low)))
    assert ax.get_ylim()[1] == pytest.approx(1.25 * max(2.0, -low))


@pytest.mark.parametrize(("zero", "seen"), [(20.0, True), (24.0, True), (26.0, False)])
def test_zeros_of_a_root_locus_are_shown_up_to_four_times_its_reach(zero: float, seen: bool) -> None:
    """Of ``(s + z) / (s^2 + s)``, whose closed-loop poles are as far as the root of z: a quarter more is the reach."""
    ax = gl.root_locus_plot(control.tf([1.0, zero], [1, 1, 0]), gains=[0.0, 1.0])
    assert ax.get_ylim()[1] == pytest.approx(1.25 * np.sqrt(zero))
    assert data(ax, "zeros")[0] == (pytest.approx([-zero]) if seen else [])


def test_the_first_crossing_of_a_root_locus_is_marked_apart() -> None:
    """Stable for gains between two crossings, at which pairs of poles lie on the axis."""
    model = control.tf([1.0, 2, 1], np.polymul([1, 0, 0, 0], np.polymul([0.02, 1], [0.02, 1])))
    ax = gl.root_locus_plot(model)
    diamonds = [line for line in ax.lines if line.get_marker() == "D"]
    crossings = margins(as_loop(model)).phase_crossings
    assert len(diamonds) == len(crossings) == 2
    for line, c in zip(diamonds, crossings, strict=True):
        assert (list(line.get_xdata()), list(line.get_ydata())) == ([0, 0], [c.omega, -c.omega])
    assert len({line.get_color() for line in diamonds}) == 2


@pytest.mark.parametrize(("lags", "lines"), [(1, []), (2, [-180]), (5, [-180]), (7, [-540, -180])])
def test_a_bode_plot_draws_the_phases_at_which_the_curve_is_on_the_negative_axis(lags: int, lines: list[float]) -> None:
    gain, phase = gl.bode_plot(control.tf([4.0], np.poly([-1.0] * lags)))
    levels = [line.get_ydata()[0] for line in phase.lines if list(line.get_xdata()) == [0, 1]]
    assert levels == lines
    m = margins(as_loop(control.tf([4.0], np.poly([-1.0] * lags))))
    for ax, crossings in ((phase, m.phase_crossings), (gain, m.gain_crossings)):
        upright = [line.get_xdata()[0] for line in ax.lines if list(line.get_ydata()) == [0, 1]]
        assert upright == pytest.approx([c.omega / (2 * np.pi) for c in crossings if 0 < c.omega < np.inf])
    f = np.asarray(gain.lines[0].get_xdata(), float)
    scale = as_loop(control.tf([4.0], np.poly([-1.0] * lags))).scale
    assert (f[0], f[-1]) == pytest.approx((scale[0] / 100 / (2 * np.pi), scale[1] * 100 / (2 * np.pi)))


def test_paths_of_poles_do_not_depend_on_the_units_of_the_states() -> None:
    """Of ``k / (s + 1)^3``: real and complex ones on three rays from -1."""
    A, unit = -np.eye(3) + np.diag([1.0, 1.0], 1), np.array([1.0, 1e5, 1e-3])
    loop = Loop(A * unit / unit[:, None], np.array([0.0, 0.0, 1.0]) / unit, np.array([1.0, 0.0, 0.0]) * unit, 0.0, "u", "y")
    factors = np.array([0.1, 1.0, 8.0])
    found = parts.paths_of(loop, factors)
    assert found.shape == (3, 3)
    assert (found + 1) ** 3 == pytest.approx(-np.tile(factors[:, None], 3), rel=1e-6)
    for path in found.T:
        assert np.angle(path[1:] + 1) == pytest.approx(np.angle(path[:-1] + 1)) or np.abs(np.angle(path + 1)) == pytest.approx(
            np.pi
        )


def test_a_bode_plot_has_gain_over_phase_over_frequency() -> None:
    gain, phase = gl.bode_plot(control.tf([0.5], [1, 1]))
    assert (gain.get_ylabel(), phase.get_ylabel()) == ("gain |L|, dB", "phase of L, deg")
    assert (gain.get_xlabel(), phase.get_xlabel()) == ("", "frequency, Hz")
    assert (gain.get_title(), phase.get_title()) == ("Bode plot of the loop u[0] → y[0]", "")


def test_a_bode_plot_names_margins_that_there_are_not() -> None:
    gain, phase = gl.bode_plot(control.tf([0.5], [1, 1]))
    assert [t.get_text() for t in gain.get_legend().get_texts()] == ["gain margin infinite"]
    assert [t.get_text() for t in phase.get_legend().get_texts()] == ["phase margin infinite"]
    gain, phase = gl.bode_plot(control.tf([5.0], [1, 1]))
    assert [t.get_text() for t in gain.get_legend().get_texts()] == ["gain margin infinite"]
    (said,) = [t.get_text() for t in phase.get_legend().get_texts()]
    assert said.startswith("phase margin 101.54° at 0.7797 Hz")
    gain, phase = gl.bode_plot(control.tf([-0.5, -0.1], [1, 1]))  # on the axis at the ends alone
    assert gain.get_legend() is None


@pytest.mark.parametrize(
    ("numerator", "denominator", "points"),
    [
        ([2.0], [1, 1], [-180.0]),  # down to -90 deg
        ([1.0, 0], [1, 1], [180.0]),  # from 90 deg
        ([1.0, 2], [1, 1], [-180.0]),  # none is within 100 deg: the usual one
        ([4.0], np.poly([-1.0] * 7), [-540.0, -180.0]),
    ],
)
def test_a_nichols_plot_shows_the_images_of_the_point_that_are_near(
    numerator: Any, denominator: Any, points: list[float]
) -> None:
    ax = gl.nichols_plot(control.tf(numerator, denominator))
    found, levels = data(ax, "−1")
    assert (found, levels) == (points, [0.0] * len(points))
    x, _ = data(ax, "L(jω)")
    assert ax.get_xlim() == pytest.approx((min(*x, *points) - 25, max(*x, *points) + 25))


def shown(model: Any) -> Any:
    return pytest.approx(gl.nichols_plot(model).get_ylim(), abs=0.1)


def test_a_nichols_plot_shows_twelve_decibels_up_and_down_at_least() -> None:
    assert shown(control.tf([1.0, 2.0], [1, 1])) == (-18.0, 18.0)  # from 6 dB to 0 dB
    levels = [list(line.get_ydata()) for line in plt.gca().lines if list(line.get_xdata()) == [0, 1]]
    assert levels == [[0, 0]]
    assert shown(control.tf([10.0, 200.0], [1, 10])) == (-18.0, 32.0)  # from 26 dB to 20 dB
    assert shown(control.tf([0.1, 0.5], [1, 10.0])) == (-32.0, 18.0)


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        ([1.0], [1, 0]),
        ([-1.0], [1, 1]),
        ([1.0], [1, 0, 0]),
        ([1, 0], [1, 1]),
        ([-1.0], [1, 0, 0]),
        ([2.0], np.poly([-1.0] * 7)),
    ],
)
def test_phases_are_those_of_the_response_but_for_whole_turns(numerator: Any, denominator: Any) -> None:
    model = control.tf(numerator, denominator)
    _, phase = gl.bode_plot(model)
    f, angle = (np.asarray(part, float) for part in phase.lines[0].get_data())
    expected = as_loop(model).response(2j * np.pi * f)
    assert np.exp(1j * np.radians(angle)) == pytest.approx(expected / np.abs(expected), abs=1e-3)  # of a pole sevenfold
    assert -270 <= angle[0] <= 90
    x, _ = data(gl.nichols_plot(model), "L(jω)")
    assert x == pytest.approx(angle.tolist())


@pytest.mark.parametrize(("gain", "reach"), [(0.4, 0.4), (0.5, 1.1), (2.0, 2.0)])
def test_a_nyquist_plot_shows_the_point_unless_the_curve_is_less_than_half_as_large(gain: float, reach: float) -> None:
    """Of a loop that is a constant."""
    whole, _ = gl.nyquist_plot(control.ss([[-1.0]], [[1.0]], [[0.0]], [[gain]]))
    assert whole.get_ylim() == pytest.approx((-1.15 * reach, 1.15 * reach))
