"""Plots of runs: axes by unit, labels, events, comparisons; phase portraits, loops, spectra."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.histories import History, plot_histories
from gearlib.drawing.quantities import in_unit, spelled
from gearlib.drawing.style import legend
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.language.units import UNITS, dimension


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


class Rattle(gl.Component):
    """Two bodies with backlash between them, shaken by a torque."""

    def assemble(self):
        self.torque, self.a, self.b = gp.Torque(tau=10 * gl.sin(30 * gl.time)), gp.Inertia(J=0.1), gp.Inertia(J=0.2)
        self.gap = gp.ElastoBacklash(c=1e3, d=1.0, b=0.05)
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.gap.flange_a),
            gl.connect(self.gap.flange_b, self.b.flange_a),
        ]


class Damped(gl.Component):
    """A damper driven by a speed: its torque over its angle is an ellipse."""

    def assemble(self):
        self.source, self.damper, self.ground = (
            gp.Speed(w_ref=3 * gl.cos(2 * gl.pi * gl.time), exact=True),
            gp.Damper(d=2.0),
            gp.Fixed(),
        )
        return [
            gl.connect(self.ground.flange, self.damper.flange_a),
            gl.connect(self.damper.flange_b, self.source.flange),
        ]


@pytest.fixture(scope="module")
def rattle():
    return gl.compile(Rattle())


@pytest.fixture(scope="module")
def run(rattle):
    return rattle.simulate(1.0, samples=501)


@pytest.mark.parametrize("unit", ["rad/s/s", "rad/s2", "N.m.s/rad", "W/(m2.K)", "kg.m2", "1/s", "1", "N.s3/m3", *UNITS])
def test_spelling_keeps_the_dimension(unit):
    """Read back, a unit has the dimension that the language gives it; a repeated stroke divides again."""
    again = spelled(unit).translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹·", "0123456789.")) or "1"
    first, *more = unit.split("/")
    plain = unit if len(more) < 2 else f"{first}/{'.'.join(more)}"
    assert dimension(again) == dimension(plain)
    assert spelled(again) == spelled(unit)


def test_one_axis_for_each_unit(run):
    rows = run.plot("a.w", "b.w", "gap.tau", "der(a.w)", "a.a", "gap.phi_rel")
    labels = [row.get_ylabel() for row in rows]
    assert labels == ["angular velocity, rad/s", "gap.tau, N·m", "angular acceleration, rad/s²", "gap.phi_rel, rad"]
    assert [len([line for line in row.lines if not line.get_label().startswith(("_", "events"))]) for row in rows] == [
        2,
        1,
        2,
        1,
    ]
    assert rows[-1].get_xlabel() == "time, s"
    rows[0].set_xlim(0.1, 0.2)
    assert all(row.get_xlim() == (0.1, 0.2) for row in rows), "they show one stretch of time"
    alone = run.plot("a.w")
    assert alone.get_ylabel() == "a.w, rad/s"


def test_units_by_choice(run):
    rows = run.plot("gap.phi_rel", "a.w", "gap.tau", units={"rad": "deg", "a.w": "1/min", "N.m": "kN.m", "s": "ms"})
    assert [row.get_ylabel() for row in rows] == ["gap.phi_rel, deg", "a.w, 1/min", "gap.tau, kN·m"]
    drawn = [row.lines[0] for row in rows]
    assert drawn[0].get_ydata() == pytest.approx(np.rad2deg(run["gap.phi_rel"]))
    assert drawn[1].get_ydata() == pytest.approx(run["a.w"] * 30 / np.pi)
    assert drawn[2].get_ydata() == pytest.approx(run["gap.tau"] / 1000)
    assert drawn[2].get_xdata() == pytest.approx(run.time * 1000)
    with pytest.raises(ArgumentError, match="'µm' is not a unit for values in rad"):
        run.plot("gap.phi_rel", units={"rad": "µm"})
    with pytest.raises(ArgumentError, match=r"units\['rad'\] is 3; expected"):
        run.plot("gap.phi_rel", units={"rad": 3})
    with pytest.raises(ArgumentError, match="nothing that is shown is called 'm'"):
        run.plot("gap.phi_rel", units={"m": "µm"})
    assert in_unit("kg.m2", "kg.mm2").factor == pytest.approx(1e6)
    assert in_unit("N/m", "MN/m").text == "MN/m"


def test_events_are_marked(run):
    axes = run.plot("a.w")
    marks = next(line for line in axes.lines if line.get_label() == "events")
    assert marks.get_xdata() == pytest.approx([t for t, _ in run.events])
    assert not [line for line in run.plot("a.w", events=False).lines if line.get_label() == "events"]


def test_runs_are_compared(rattle, run):
    other = rattle.simulate(1.0, samples=201, parameters={"gap.d": 5.0})
    axes = run.plot("a.w", "b.w", other={"more damping": other}, events=False)
    lines = {line.get_label(): line for line in axes.lines}
    assert list(lines) == ["a.w", "b.w", "a.w (more damping)", "b.w (more damping)"]
    assert lines["a.w"].get_color() == lines["a.w (more damping)"].get_color() != lines["b.w"].get_color()
    assert lines["a.w"].get_linestyle() == "-" != lines["a.w (more damping)"].get_linestyle()
    assert lines["b.w (more damping)"].get_ydata() == pytest.approx(other["b.w"])
    assert "a.w (other)" in [line.get_label() for line in run.plot("a.w", other=other).lines]
    with pytest.raises(ArgumentError, match="other is 3"):
        run.plot("a.w", other={"x": 3})
    with pytest.raises(NameLookupError):
        run.plot("a.v")


def test_own_axes_for_each_unit(run):
    _, pair = plt.subplots(2)
    assert run.plot("a.w", "gap.tau", axes=pair) is pair
    with pytest.raises(ArgumentError, match="expected 2 matplotlib Axes"):
        run.plot("a.w", "gap.tau", axes=pair[0])


def test_a_legend_covers_no_data():
    """Noise over the whole diagram leaves no place inside; a ramp does."""
    t = np.linspace(0, 1, 2000)
    noise = np.random.default_rng(1).uniform(-1, 1, (2, len(t)))
    full = plot_histories([History("x", "m", t, noise[0]), History("y", "m", t, noise[1])])
    ramp = plot_histories([History("x", "m", t, t), History("y", "m", t, 2 * t)])
    for axes, outside in ((full, True), (ramp, False)):
        axes.figure.draw_without_rendering()
        box, frame = axes.get_legend().get_window_extent(), axes.get_window_extent()
        assert bool(box.x0 >= frame.x1) is outside
        assert not any(
            line.get_transform().transform_path(line.get_path()).intersects_bbox(box, filled=False) for line in axes.lines
        )
    _, framed = plt.subplots()
    framed.plot([0, 1, 1, 0, 0], [0, 0, 1, 1, 0], label="around the legend")
    framed.margins(0)
    legend(framed)
    assert framed.get_legend().get_window_extent().x1 < framed.get_window_extent().x1
    _, empty = plt.subplots()
    legend(empty)
    assert empty.get_legend() is None


def test_loop_and_section_of_a_damper():
    """Closed form: amplitude X = 3 / (2 pi), work per period pi d w X**2 with w = 2 pi."""
    run = gl.compile(Damped()).simulate(4.0, samples=4001)
    axes = run.plot_against("damper.phi_rel", "damper.tau", period=1.0)
    labels = [line.get_label() for line in axes.lines]
    work = np.pi * 2.0 * 2 * np.pi * (3 / (2 * np.pi)) ** 2
    found = next(float(label.split(", ")[1].split()[0]) for label in labels if label.startswith("last period"))
    assert found == pytest.approx(work, rel=1e-3)
    points = next(line for line in axes.lines if line.get_label() == "every 1 s")
    assert len(points.get_xdata()) == 5
    assert points.get_ydata() == pytest.approx(np.full(5, 6.0), rel=1e-5)
    assert axes.get_xlabel() == "damper.phi_rel, rad"
    with pytest.raises(ArgumentError, match="up to that of the run, 4 s"):
        run.plot_against("damper.phi_rel", "damper.tau", period=5.0)
    assert run.plot_against("damper.phi_rel", "damper.w_rel", units={"rad": "deg"}).get_xlabel() == "damper.phi_rel, deg"


@pytest.mark.parametrize("window", ["hann", "rectangular"])
def test_spectrum_of_a_cosine(window):
    run = gl.compile(Damped()).simulate(8.0, samples=801)
    axes = run.plot_spectrum("damper.tau", window=window, f_max=10.0)
    f, a = axes.lines[0].get_data()
    assert f[a.argmax()] == pytest.approx(1.0, abs=0.13)
    assert a.max() == pytest.approx(6.0, rel=0.02 if window != "rectangular" else 0.05)
    assert axes.get_ylabel() == "amplitude of damper.tau, N·m"
    with pytest.raises(ArgumentError, match="expected 'hann'"):
        run.plot_spectrum("damper.tau", window="hamming")
    uneven = gl.compile(Damped()).simulate(8.0, times=np.geomspace(1, 9, 100) - 1)
    with pytest.raises(ArgumentError, match="equally spaced"):
        uneven.plot_spectrum("damper.tau")
