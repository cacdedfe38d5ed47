"""Plots carry names, units and margins."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.feedback.loop_plots import mark_frequencies


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    plt.close("all")


def overprints(ax: Any) -> list[tuple[str, str]]:
    """Labels within the axes of a figure that is drawn, which lie on each other."""
    seen = [(t.get_text(), t.get_window_extent()) for t in ax.texts if t.get_text()]
    seen = [(text, box) for text, box in seen if box.overlaps(ax.get_window_extent())]
    return [(a, b) for i, (a, box) in enumerate(seen) for b, other in seen[:i] if box.overlaps(other)]


LOOPS = {
    "three lags": control.tf([1.2], [1, 2, 1, 0]),
    "resonances": control.tf([3.0, 0.2, 30], [1, 0.3, 16, 2, 5]),
    "one lag": control.tf([5.0], [1, 1]),
    "far away": control.tf([1e-3], [1, 1]),
    "large": control.tf([1e6], [1, 1]),
}


@pytest.mark.parametrize("name", LOOPS)
def test_frequencies_are_marked_and_no_label_lies_on_another(name: str) -> None:
    whole, near = gl.nyquist_plot(LOOPS[name])
    nichols = gl.nichols_plot(LOOPS[name])
    for figure in (whole.figure, nichols.figure):
        figure.draw_without_rendering()
    for ax in (whole, near, nichols):
        assert not overprints(ax), name
    for ax in (whole, nichols):
        assert any(t.get_text().endswith(" Hz") for t in ax.texts), name
    for label in [t for t in whole.texts if t.get_text().endswith(" Hz")]:
        hertz = float(label.get_text().split()[0])
        there = LOOPS[name](2j * np.pi * hertz)
        assert np.allclose(label.xy, (there.real, there.imag), atol=0.01 * np.abs(there) + 1e-9)
    curves = [line for line in near.lines if line.get_label() == "L(jω), ω > 0"]
    inside = near.viewLim.contains
    seen = any(inside(x, y) for line in curves for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True))
    assert seen or any("comes no nearer" in t.get_text() for t in near.texts)
    plt.close("all")


def texts(ax: Any) -> str:
    legend = ax.get_legend() or (ax.figure.legends or [None])[0]
    entries = [t.get_text() for t in legend.get_texts()] if legend else []
    return " | ".join([ax.get_title(), ax.get_xlabel(), ax.get_ylabel(), *entries])


LOOP = control.tf([3.0], [1, 2, 1, 0])  # gain margin 2/3


def test_nyquist() -> None:
    whole, near = gl.nyquist_plot(LOOP)
    assert (whole.get_aspect(), near.get_aspect()) == (1.0, 1.0)
    assert "gain margin -3.52 dB" in texts(near)
    assert "real part of L" in texts(whole)
    marks = [line for line in near.lines if line.get_marker() == "s"]
    assert marks[0].get_xdata() == pytest.approx([-1.5])
    low, high = near.get_xlim()
    assert low < -1.5 < high


def test_a_pole_on_the_axis_that_the_output_does_not_show_leaves_the_curve_in_view() -> None:
    whole, _ = gl.nyquist_plot(control.ss(np.diag([0.0, -1.0]), [[1.0], [1.0]], [[0.0, 0.1]], [[0.0]]))
    assert whole.get_ylim()[1] < 0.2


def test_nichols() -> None:
    ax = gl.nichols_plot(LOOP)
    assert set(np.diff(ax.get_xticks())) == {45.0}
    assert "phase of L, deg" in texts(ax)
    assert "phase margin -11.01°" in texts(ax)
    square = next(line for line in ax.lines if line.get_marker() == "s")
    assert (square.get_xdata()[0], square.get_ydata()[0]) == pytest.approx((-180, 20 * np.log10(1.5)))
    cross = next(line for line in ax.lines if line.get_marker() == "+")
    assert -180 in cross.get_xdata()


@pytest.mark.parametrize(("gain", "shown"), [(1e-9, (-126, 18)), (1e9, (-126, 126)), (1.0, (-126, 18))])
def test_nichols_shows_at_most_120_db_up_and_down(gain: float, shown: tuple[float, float]) -> None:
    assert gl.nichols_plot(gain * control.tf([1.0], [1, 3, 3, 1])).get_ylim() == pytest.approx(shown)


def test_bode(paper: gl.System) -> None:
    gain, phase = gl.bode_plot(paper, ("tau_in", "w_out"))
    assert "gain margin 44.73 dB at 934.3 Hz" in texts(gain)
    assert "phase margin infinite" in texts(phase)
    assert "frequency, Hz" in texts(phase)
    assert "tau_in → w_out, gain 1 N·m per rad/s" in texts(gain)


def test_bode_marks_no_margin_that_lies_at_no_frequency_of_the_plot() -> None:
    """Real and negative at rest and at infinity only: -0.1 and -0.5."""
    gain, phase = gl.bode_plot(control.tf([-0.5, -0.1], [1, 1]))
    for ax in (gain, phase):
        assert " at " not in texts(ax)
        assert all(np.isfinite(np.asarray(line.get_xdata(), float)).all() for line in ax.lines)


def test_the_gain_has_the_unit_that_makes_the_loop_a_number(paper: gl.System) -> None:
    assert texts(gl.nichols_plot(paper, ("tau_in", "q_ring"), gain=-2.5)).startswith(
        "Nichols plot of the loop tau_in → q_ring, gain -2.5 N·m per m"
    )
    assert gl.nyquist_plot(paper, ("tau_in", "w_out"))[0].figure.get_suptitle().endswith(", gain 1 N·m per rad/s")
    assert "gain" not in gl.nichols_plot(LOOP).get_title()


def test_root_locus_ends_on_the_axis_at_the_gain_margin() -> None:
    ax = gl.root_locus_plot(LOOP, gains=np.linspace(0, 2 / 3, 200))
    ends = [complex(line.get_xdata()[-1], line.get_ydata()[-1]) for line in ax.lines if len(line.get_xdata()) == 200]
    assert min(abs(z - 1j) for z in ends) < 1e-6
    assert "on the imaginary axis at gain 0.6667 (-3.52 dB)" in texts(ax)


def test_root_locus_shows_the_origin_and_little_more() -> None:
    ax = gl.root_locus_plot(control.tf([1], [1, 3, 2]), gains=np.linspace(0, 0.1, 20))
    left, right = ax.get_xlim()
    assert left < -2 < 0 < right < 1


def test_own_axes_are_used(chain: Callable[..., gl.System]) -> None:
    _, ax = plt.subplots()
    assert gl.nichols_plot(LOOP, axes=ax) is ax
    system = chain(n=3, grounded=True)
    assert "1/min" in texts(gl.campbell(system, [0, 10.0], {"mesh": 20}).plot())
    top, _ = gl.frequency_response(system, [1.0, 2.0], ["torque.tau"], ["body[0].w", "body[2].w"]).plot()
    assert "rad/s per N·m" in texts(top)
    assert "body[2].w" in texts(top)


def test_campbell_draws_what_it_found(chain: Callable[..., gl.System]) -> None:
    """Over the speed in 1/min: the frequencies, the lines of the orders (60 / min is 1 Hz), and the crossings on both."""
    diagram = gl.campbell(chain(n=3, grounded=True), [0.0, 1.0, 4.0], {"mesh": 20})
    ax = diagram.plot()
    lines = {line.get_label(): (np.asarray(line.get_xdata()), np.asarray(line.get_ydata())) for line in ax.lines}
    rpm, order = lines["mesh (order 20)"]
    assert rpm == pytest.approx(diagram.speeds * 30 / np.pi)
    assert order == pytest.approx(20 * rpm / 60)
    assert lines["natural frequencies"][1] == pytest.approx(diagram.frequencies[:, 0])
    x, y = lines["crossings"]
    assert len(x) == len(diagram.crossings) > 0
    assert y == pytest.approx(20 * x / 60)
    assert y == pytest.approx([c.frequency for c in diagram.crossings])


def spoke_angles(animation: Any, frame: int) -> list[float]:
    """Degrees by which each body has turned in a picture."""
    animation._func(frame)
    marks = [line for line in animation._fig.axes[0].lines if line.get_linewidth() == 2.5]
    ends = [(np.diff(line.get_xdata())[0], np.diff(line.get_ydata())[0]) for line in marks]
    return [float(np.degrees(np.arctan2(-x, y))) for x, y in ends]


def test_animation_of_a_mode(paper: gl.System, tmp_path: Any) -> None:
    from PIL import Image

    modes = gl.modes(paper)
    animation = modes.animate(1, frames=4, degrees=40.0)
    animation.save(tmp_path / "mode.gif", writer="pillow", fps=10)
    with Image.open(tmp_path / "mode.gif") as image:
        assert image.n_frames == 4
    start, half = spoke_angles(animation, 0), spoke_angles(animation, 2)
    assert max(start) == pytest.approx(40.0)
    assert half == pytest.approx([-a for a in start])
    motions = {name: value for name, _, value in modes.motions(1)}
    names = [name for name in motions if abs(motions[name]) > 1e-6 * max(map(abs, motions.values()))]
    assert len(start) == len(names)
    largest = max(names, key=lambda n: abs(motions[n]))
    ratio = start[names.index("train.x_unit.ring_gear")] / start[names.index(largest)]
    assert ratio == pytest.approx((motions["train.x_unit.ring_gear"] / motions[largest]).real, abs=1e-2)
    assert "Mode 1: 929.69 Hz" in texts(animation._fig.axes[0])


def test_bodies_that_slide_are_animated(tmp_path: Any) -> None:
    class Slider(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.ground, self.spring, self.mass = gp.TranslationalFixed(), gp.TranslationalSpring(c=100.0), gp.Mass(m=1.0)
            return [gl.connect(self.ground.flange, self.spring.flange_a), gl.connect(self.spring.flange_b, self.mass.flange_a)]

    animation = gl.modes(gl.compile(Slider())).animate(0, frames=4)
    animation.save(tmp_path / "mode.gif", writer="pillow", fps=10)
    square = animation._fig.axes[0].patches[0]
    animation._func(0)
    right = square.get_x()
    animation._func(2)
    assert right - square.get_x() == pytest.approx(1.4)
    with pytest.raises(gl.GearlibError, match="frames is 1"):
        gl.modes(gl.compile(Slider())).animate(0, frames=1)


# ---------------------------------------------------------------- what is drawn, of loops with closed forms


def line(ax: Any, label: str) -> tuple[np.ndarray, np.ndarray]:
    """The data of the one curve whose label begins so."""
    (found,) = [each for each in ax.lines if str(each.get_label()).startswith(label)]
    return np.asarray(found.get_xdata(), float), np.asarray(found.get_ydata(), float)


def response(w: Any, k: float = 3.0) -> Any:
    """Of `LOOP`: ``k / (s (s + 1)^2)``."""
    s = 1j * np.asarray(w)
    return k / (s * (s + 1) ** 2)


def test_a_nyquist_plot_shows_the_curve_its_image_the_margins_and_the_distance() -> None:
    whole, near = gl.nyquist_plot(LOOP)
    margins = gl.stability(LOOP, (0, 0)).loop.margins
    for ax in (whole, near):
        x, y = line(ax, "L(jω)")
        w = np.geomspace(0.1, 30, 50)
        assert np.interp(w, w, np.abs(response(w))) == pytest.approx(
            np.interp(w, *at_frequencies(x + 1j * y)), rel=0.02
        )  # the curve is that of the loop
        mirrored = line(ax, "ω < 0")
        assert (mirrored[0].tolist(), mirrored[1].tolist()) == (x.tolist(), (-y).tolist())
        assert line(ax, "−1")[0].tolist() == [-1]
        assert line(ax, "−1")[1].tolist() == [0]
    x, y = line(near, "|L| = 1")
    assert np.hypot(x, y) == pytest.approx(1.0)
    assert np.ptp(np.unwrap(np.arctan2(y, x))) == pytest.approx(2 * np.pi)
    x, y = line(near, "distance from −1")
    assert np.hypot(x + 1, y) == pytest.approx(margins.modulus_margin)
    (x,), (y,) = line(near, "phase margin")
    assert complex(x, y) == pytest.approx(complex(response(margins.gain_crossings[0].omega)), abs=1e-9)
    assert line(near, "gain margin")[1].tolist() == [0.0]
    low, high = near.get_xlim()
    assert (-1 - low, high + 1) == pytest.approx((1.8, 1.2 * 1.8))  # a crossing at -1.5, and a fifth more
    assert near.get_ylim() == pytest.approx((-1.1 * 1.8, 1.1 * 1.8))
    top = abs(response(0.3))  # but for the neighbourhood of the pole at zero
    assert whole.get_ylim() == pytest.approx((-1.15 * top, 1.15 * top), rel=0.02)
    assert whole.figure.get_suptitle() == "Nyquist plot of the loop u[0] → y[0]"
    assert (whole.get_title(), near.get_title()) == ("whole curve", "around −1")


def at_frequencies(curve: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies of points of `LOOP`'s curve, from their phase -90 deg - 2 atan(w), and their sizes."""
    w = np.tan((-np.unwrap(np.angle(curve)) % (2 * np.pi) - np.pi / 2) / 2)
    return w, np.abs(curve)


@pytest.mark.parametrize(
    ("model", "top"),
    [
        (control.tf([0.2], [1, 1]), 0.2),  # below a half, all of it
        (control.tf([0.8], [1, 1]), 1.1),  # the unit circle at least
        (control.tf([7.0], [1, 1]), 7.0),
        (control.tf([0.1, 1.0], [1, 0, 100]), 3.0),  # with a pole on the axis, at least three
        (control.tf([4.0], [1, 2, 1, 0]), 11.7714),  # and what is not next to the pole
    ],
)
def test_the_whole_curve_is_in_view_but_for_what_goes_to_infinity(model: Any, top: float) -> None:
    whole, _ = gl.nyquist_plot(model)
    assert whole.get_ylim() == pytest.approx((-1.15 * top, 1.15 * top), rel=1e-3)
    left, right = whole.get_xlim()
    assert right - left == pytest.approx(2.3 * top, rel=1e-3)
    x, y = (part[np.hypot(*line(whole, "L(jω)")) <= 1.0001 * top] for part in line(whole, "L(jω)"))
    assert left < x.min() <= x.max() < right
    assert np.abs(y).max() < 1.15 * top
    assert (left < -1.0) == (top > 0.5)
    shown = [*x, 0.0, *([-1.0] if top > 0.5 else [])]  # the origin and -1, too
    assert (left + right) / 2 == pytest.approx((min(shown) + max(shown)) / 2, abs=1e-3 * top)


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_arrows_point_to_higher_frequencies(turn: float) -> None:
    """At a fifth, about a half and most of the way along the curve, of a loop whose curve is a half circle."""
    whole, _ = gl.nyquist_plot(control.tf([4.0 * turn], [1, 1]))
    arrows = [t for t in whole.texts if t.arrow_patch is not None]
    assert len(arrows) == 3
    parts = []
    for arrow in arrows:
        start, end = (complex(*at) for at in (arrow.xyann, arrow.xy))
        w = [-(np.tan(np.angle(z * turn))) for z in (start, end)]
        assert 0 < w[0] < w[1]
        parts.append(-2 * np.angle(start * turn) / np.pi)  # of the half circle
    assert parts == pytest.approx([0.2, 0.55, 0.85], abs=0.03)


def test_a_nichols_plot_has_the_margins_at_the_right_image_of_the_point() -> None:
    """A loop whose phase goes on to -450 deg: crossings at -180 and at -540 belong to images of -1 a turn apart."""
    model = control.tf([8.0], np.poly([-1.0] * 5))
    ax = gl.nichols_plot(model)
    x, y = line(ax, "L(jω)")
    w = np.geomspace(1e-2, 1e2, 60)
    assert np.interp(w, w, -5 * np.degrees(np.arctan(w))) == pytest.approx(-5 * np.degrees(np.arctan(w)))
    order = np.argsort(x)
    expected = 20 * np.log10(8 / np.hypot(1, w) ** 5)
    assert np.interp(-5 * np.degrees(np.arctan(w)), x[order], y[order]) == pytest.approx(expected, abs=0.05)
    assert line(ax, "−1")[0].tolist() == [-540.0, -180.0]
    assert line(ax, "−1")[1].tolist() == [0.0, 0.0]
    found = gl.stability(model, (0, 0)).loop.margins
    assert line(ax, "gain margin")[0].tolist() == [-180.0]
    assert line(ax, "gain margin")[1] == pytest.approx([-found.gain_margin_db])
    (crossing,) = found.gain_crossings
    assert line(ax, "phase margin")[0] == pytest.approx([-180 + crossing.phase_margin], abs=0.01)
    left, right = ax.get_xlim()
    assert (left, right) == pytest.approx((-540.0 - 25, x.max() + 25), abs=1e-6)


def test_contours_of_a_nichols_plot_are_of_equal_closed_loop_gain() -> None:
    ax = gl.nichols_plot(LOOP)
    contours = [each for each in ax.lines if each.get_color() == "0.8"]
    levels = []
    for each in contours:
        x, y = np.asarray(each.get_xdata(), float), np.asarray(each.get_ydata(), float)
        opened = 10 ** (y / 20) * np.exp(1j * np.radians(x))
        closed = 20 * np.log10(np.abs(opened / (1 + opened)))[np.isfinite(x)]
        assert np.ptp(closed) < 1e-6
        levels.append(round(float(closed.mean()), 6))
        assert (np.abs(np.diff(x))[np.isfinite(np.diff(x))] < 180).all()
    assert sorted(set(levels)) == [-12, -6, -3, 1, 3, 6]
    assert len(levels) == 6 * len(line(ax, "−1")[0])
    named = {t.get_text(): t.get_position() for t in ax.texts if t.get_text().endswith("dB")}
    for text, (x, y) in named.items():
        opened = 10 ** (y / 20) * np.exp(1j * np.radians(x))
        assert 20 * np.log10(abs(opened / (1 + opened))) == pytest.approx(float(text.split()[0]), abs=1e-6)
    assert {"+6 dB", "-12 dB"} <= named.keys()


def test_a_bode_plot_has_curves_and_margins_where_they_are() -> None:
    gain, phase = gl.bode_plot(LOOP)
    f, level = (np.asarray(d, float) for d in gain.lines[0].get_data())
    assert level == pytest.approx(20 * np.log10(np.abs(response(2 * np.pi * f))))
    _, angle = (np.asarray(d, float) for d in phase.lines[0].get_data())
    assert angle == pytest.approx(-90 - 2 * np.degrees(np.arctan(2 * np.pi * f)))
    crossing = gl.stability(LOOP, (0, 0)).loop.margins.gain_crossings[0]
    x, y = line(gain, "gain margin -3.52 dB at 0.1592 Hz")
    assert (x, y) == (pytest.approx([1 / (2 * np.pi)] * 2), pytest.approx([20 * np.log10(1.5), 0.0]))
    x, y = line(phase, "phase margin -11.01° at")
    assert x == pytest.approx([crossing.omega / (2 * np.pi)] * 2)
    assert y == pytest.approx([-180.0, -180.0 + crossing.phase_margin], abs=0.01)
    levels = [each.get_ydata()[0] for each in phase.lines if list(each.get_xdata()) == [0, 1]]
    assert levels == [-180]
    assert gain.get_xscale() == "log"


def test_phases_begin_about_minus_ninety_degrees() -> None:
    """Whatever turn the angle of the first point counts."""
    for numerator, denominator, first in (
        ([1.0], [1, 0], -90),
        ([-1.0], [1, 1], -180),
        ([1.0], [1, 0, 0], -180),
        ([1, 0], [1, 1], 90),
    ):
        _, phase = gl.bode_plot(control.tf(numerator, denominator))
        assert phase.lines[0].get_ydata()[0] == pytest.approx(first, abs=1.0)


def test_a_root_locus_joins_what_belongs_together() -> None:
    """Of ``k / (s (s + 2))``: real poles meet at -1 for k = 1, and part up and down; each path is continuous."""
    gains = np.concatenate([np.linspace(0, 0.99, 100), np.linspace(1.01, 5, 100)])
    ax = gl.root_locus_plot(control.tf([1.0], [1, 2, 0]), gains=gains)
    paths = [np.asarray(p.get_xdata()) + 1j * np.asarray(p.get_ydata()) for p in ax.lines if len(p.get_xdata()) == 200]
    assert len(paths) == 2
    exact = -1 + np.sqrt(1 - gains + 0j)
    assert np.sort_complex(np.array(paths).T).ravel() == pytest.approx(np.sort_complex(np.array([exact, -2 - exact]).T).ravel())
    assert max(np.abs(np.diff(p)).max() for p in paths) < 0.25
    x, _ = line(ax, "open-loop poles (gain 0)")
    assert sorted(x) == pytest.approx([-2.0, 0.0], abs=1e-9)
    x, _ = line(ax, "closed-loop poles (gain 1)")
    assert x == pytest.approx([-1.0, -1.0], abs=1e-6)
    assert ax.get_title().endswith(", gain 0 .. 5")
    assert ax.get_ylim() == pytest.approx((-2.5, 2.5))
    assert ax.get_xlim() == pytest.approx((-2.8, 0.8))
    alone = gl.root_locus_plot(control.tf([1.0], [1, 2, 0]), gains=[0.75])
    assert sorted(x for p in alone.lines if len(p.get_xdata()) == 1 for x in p.get_xdata()) == pytest.approx([-1.5, -0.5])


def test_a_root_locus_goes_well_beyond_the_last_margin_and_shows_near_zeros() -> None:
    ax = gl.root_locus_plot(control.tf([1.0, 4.0], [1, 1, 0]))
    assert line(ax, "zeros")[0] == pytest.approx([-4.0])
    far = gl.root_locus_plot(control.tf([1.0, 400.0], [1, 1, 0]))
    assert len(line(far, "zeros")[0]) == 0
    third = gl.root_locus_plot(LOOP)  # up to 2/3
    count = 601
    last = [p for p in third.lines if len(p.get_xdata()) == count]
    assert len(last) == 3
    assert third.get_title().endswith("gain 0 .. 10")
    large = gl.root_locus_plot(control.tf([0.01], [1, 2, 1, 0]))  # up to 200
    assert large.get_title().endswith("gain 0 .. 1e+03")
    x, y = line(large, "on the imaginary axis at gain 200 (46.02 dB)")
    assert (x.tolist(), y) == ([0, 0], pytest.approx([1.0, -1.0]))


def test_frequencies_are_named_at_1_2_and_5_of_each_decade() -> None:
    _, ax = plt.subplots()
    omega = 2 * np.pi * np.geomspace(0.09, 12.0, 400)
    x = np.log10(omega / (2 * np.pi))
    ax.set_xlim(-2, 2)
    ax.set_ylim(-1, 1)
    mark_frequencies(ax, omega, x, 0 * x)
    names = {t.get_text() for t in ax.texts}
    assert names <= {f"{f:g} Hz" for f in (0.1, 0.2, 0.5, 1, 2, 5, 10)}
    assert {"0.1 Hz", "1 Hz", "10 Hz"} <= names
    for t in ax.texts:
        assert t.xy == (pytest.approx(np.log10(float(t.get_text().split()[0])), abs=0.01), pytest.approx(0.0))
    ax.cla()
    ax.set_xlim(-0.5, 2)
    ax.set_ylim(-1, 1)
    mark_frequencies(ax, omega, x, 0 * x, [ax.transData.transform((0.0, 0.0))])
    assert "1 Hz" not in {t.get_text() for t in ax.texts}
