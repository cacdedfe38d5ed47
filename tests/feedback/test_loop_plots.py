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


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    plt.close("all")


def overprints(ax: Any) -> list[tuple[str, str]]:
    """Labels within the axes that lie on each other."""
    ax.figure.draw_without_rendering()
    seen = [t for t in ax.texts if t.get_text() and t.get_window_extent().overlaps(ax.get_window_extent())]
    return [
        (a.get_text(), b.get_text())
        for i, a in enumerate(seen)
        for b in seen[:i]
        if a.get_window_extent().overlaps(b.get_window_extent())
    ]


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
    animation = modes.animate(1, frames=8, degrees=40.0)
    animation.save(tmp_path / "mode.gif", writer="pillow", fps=10)
    with Image.open(tmp_path / "mode.gif") as image:
        assert image.n_frames == 8
    start, half = spoke_angles(animation, 0), spoke_angles(animation, 4)
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
