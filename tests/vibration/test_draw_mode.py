"""Drawings and animations of modes, and Campbell diagrams: what they show is what they were given."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.style import COLOURS, MARK
from gearlib.errors import ArgumentError
from gearlib.vibration.animate_mode import COLUMNS, animate_mode
from gearlib.vibration.campbell import Campbell, Crossing
from gearlib.vibration.draw_mode import MOST_BARS, ModePicture, aligned, draw_mode, largest
from gearlib.vibration.mode_matching import same_modes
from gearlib.vibration.mode_sensitivity import mode_sensitivity


@pytest.fixture(autouse=True)
def _close() -> Iterator[None]:
    yield
    plt.close("all")


def picture(*motions: tuple[str, str, complex], shares: Any = (), **more: Any) -> ModePicture:
    return ModePicture(3, 12.3456789, 0.01234, list(motions), list(shares), **more)


MIXED = picture(
    ("a", "rad", 1j), ("b", "rad", -4j), ("c", "m", 2e-3j), ("d", "m", -1e-3j), ("still", "rad", 1e-9j),
    shares=[("a", 60.0, 0.0), ("s", 0.0, 100.0), ("b", 40.0, 0.0), ("none", 0.0, 0.0)],
)  # fmt: skip


def test_amplitudes_are_turned_to_be_real_with_the_largest_positive() -> None:
    """Whatever the phase of the whole: relative to the largest of each kind, no imaginary part where all are in phase."""
    for phase in np.exp(1j * np.linspace(0, 6, 7)):
        turned = aligned([(name, unit, value * phase) for name, unit, value in MIXED.motions])
        values = [v for _, _, v in turned]
        assert np.real(values[:4]) == pytest.approx([-0.25, 1.0, -1.0, 0.5])
        assert np.imag(values) == pytest.approx(np.zeros(5), abs=1e-12)
        assert [(name, unit) for name, unit, _ in turned] == [(name, unit) for name, unit, _ in MIXED.motions]
    assert aligned([]) == []
    for nothing in (np.complex128(0), 0j):
        assert aligned([("a", "rad", nothing)]) == [("a", "rad", 0j)]
    circle = [("a", "rad", np.complex128(1j)), ("b", "rad", np.complex128(1))]  # no phase is more real than another
    assert aligned(circle) == circle
    ahead = [v for _, _, v in aligned([("a", "rad", 2 + 0j), ("b", "rad", 1j)])]
    assert ahead[1] / ahead[0] == pytest.approx(0.5j)
    assert max(map(abs, ahead)) == pytest.approx(1)
    slides = [v for _, _, v in aligned([("a", "m", -2j), ("b", "m", 1j)])]
    assert slides == pytest.approx([1, -0.5])


def test_the_largest_items_are_kept_in_their_order() -> None:
    assert largest([], abs) == ([], 0)
    assert largest([3, 0.0, -5, 4.9e-6, 5.1e-6], abs) == ([3, -5, 5.1e-6], 2)
    many = [float(k % 37 + 1) for k in range(50)]
    kept, left_out = largest(many, abs)
    assert len(kept) == MOST_BARS
    assert left_out == 20
    assert sorted(kept) == sorted(many)[20:]
    assert kept == [v for v in many if v in set(kept)][: len(kept)] or sorted(kept) == sorted(many)[-MOST_BARS:]
    assert largest([0.0, 0.0], abs) == ([], 2)


def test_bars_of_motion_and_energy() -> None:
    motion, energy = draw_mode(MIXED)
    assert motion.figure.get_suptitle() == "Mode 3: 12.346 Hz, damping ratio 0.0123"
    turning, sliding = motion.containers
    widths = [[bar.get_width() for bar in container] for container in (turning, sliding)]
    assert np.array(widths) == pytest.approx(np.array([[-0.25, 1.0, np.nan, np.nan], [np.nan, np.nan, -1.0, 0.5]]), nan_ok=True)
    assert [turning.get_label(), sliding.get_label()] == ["turning (largest 1 rad)", "displacement (largest 0.0005 m)"]
    assert len({tuple(bar.get_facecolor()) for container in (turning, sliding) for bar in container}) == 2
    names = {round(t): label.get_text() for t, label in zip(motion.get_yticks(), motion.get_yticklabels(), strict=True)}
    places = [round(bar.get_y() + bar.get_height() / 2) for bar in turning]
    assert [names[p] for p in places] == ["a", "b", "c", "d"]
    assert places == [3, 2, 1, 0]  # the first at the top
    assert motion.get_xlabel() == "amplitude over the largest (1 at rest not shown)"
    low, high = motion.get_xlim()
    assert low == -high < -1
    kinetic, potential = energy.containers
    assert [bar.get_width() for bar in kinetic] == [60, 0, 40]
    assert [bar.get_width() for bar in potential] == [0, -100, 0]
    for container in (turning, sliding, kinetic, potential):  # a bar in each row, apart from the next
        assert {round(bar.get_y() + bar.get_height() / 2, 9) for bar in container} == {*range(len(container))}
        assert {0.5 < bar.get_height() < 1 for bar in container} == {True}
    assert [label.get_text() for label in energy.get_yticklabels()] == ["a", "s", "b"]
    assert energy.get_xlabel() == "share of energy, % (1 components with none not shown)"
    assert [t.get_text() for t in energy.get_xticklabels()] == [f"{abs(x):g}" for x in energy.get_xticks()]
    assert energy.get_xlim()[0] == -energy.get_xlim()[1] < -100
    assert (motion.get_title(), energy.get_title()) == ("Motion", "Energy")
    assert not energy.texts
    for ax in (motion, energy):  # a line at 0, and legends below the labels of the axes
        assert [0, 0] in [list(line.get_xdata()) for line in ax.lines]
        ax.figure.draw_without_rendering()
        assert ax.get_legend().get_window_extent().y1 <= ax.xaxis.label.get_window_extent().y0
        assert ax.get_legend().get_window_extent().y0 >= 0
        legend, frame = ax.get_legend().get_window_extent(), ax.get_window_extent()
        assert (legend.x0 + legend.x1) / 2 == pytest.approx((frame.x0 + frame.x1) / 2, abs=1)
        assert not ax.get_legend().get_frame_on()
        first, second = (text.get_window_extent() for text in ax.get_legend().get_texts())
        assert (first.y0 + first.y1) / 2 == pytest.approx((second.y0 + second.y1) / 2, abs=2)
        assert first.x1 < second.x0


def test_what_is_a_quarter_period_late_is_marked() -> None:
    late = picture(("a", "rad", 1 + 0j), ("b", "rad", 0.5 * np.exp(0.1j)))
    motion, energy = draw_mode(late)
    (marks,) = (line for line in motion.lines if line.get_marker() == "|")
    assert marks.get_label() == "turning, a quarter period later"
    assert np.abs(marks.get_xdata()).max() < 0.06
    assert motion.get_xlabel() == "amplitude over the largest"
    assert energy.get_xlabel() == "share of energy, %"
    none = draw_mode(picture(("a", "rad", 1 + 0j), ("b", "rad", 0.5 * np.exp(0.03j))))[0]
    assert not [line for line in none.lines if line.get_marker() == "|"]


def test_reasons_stand_in_the_place_of_shares_and_heights_grow_with_bars() -> None:
    _, energy = draw_mode(picture(("a", "rad", 1 + 0j), not_given="nobody knows"))
    assert [text.get_text() for text in energy.texts] == ["not given:\nnobody knows"]
    assert energy.texts[0].get_position() == (0.5, 0.5)
    assert energy.texts[0].get_wrap()
    energy.figure.draw_without_rendering()
    text, frame = energy.texts[0].get_window_extent(), energy.get_window_extent()  # in the middle of the axes
    assert [text.x0 + text.x1, text.y0 + text.y1] == pytest.approx([frame.x0 + frame.x1, frame.y0 + frame.y1], abs=3)
    heights = [
        draw_mode(picture(*[(f"b{k}", "rad", 1 + 0j) for k in range(n)]))[0].figure.get_figheight() for n in (1, 4, 5, 9)
    ]
    assert heights[0] == heights[1] < heights[2]
    assert heights[3] - heights[2] == pytest.approx(4 * (heights[2] - heights[1]))
    assert picture().title == "Mode 3: 12.346 Hz, damping ratio 0.0123"
    assert ModePicture(0, 0.0, 0.0, [], []).title == "Mode 0: free motion"
    pair = plt.subplots(1, 2)[1]
    assert draw_mode(MIXED, pair) is pair
    with pytest.raises(ArgumentError, match="expected 2 matplotlib Axes"):
        draw_mode(MIXED, pair[:1])
    apart = [plt.subplots()[1] for _ in range(2)]
    draw_mode(MIXED, apart)
    assert [axes.figure.get_suptitle() for axes in apart] == [MIXED.title, ""]


@pytest.mark.parametrize("degrees", [40.0, 180.0])
def test_discs_swing_and_squares_slide(degrees: float) -> None:
    """At each frame the angle of a spoke and the way of a square are the real part of their amplitude at that phase."""
    animation = animate_mode(MIXED, frames=8, degrees=degrees)
    animation._draw_was_started = True
    (ax,) = animation._fig.axes
    assert ax.get_title() == f"{MIXED.title}; 1 bodies at rest not shown"
    circles = [p for p in ax.patches if hasattr(p, "get_radius")]
    squares = [p for p in ax.patches if hasattr(p, "get_x")]
    spokes = [line for line in ax.lines if line.get_linewidth() == 2.5]
    rest = [line for line in ax.lines if line.get_linewidth() == 1]
    start = None
    for frame in range(8):
        animation._func(frame)
        turn = np.cos(2 * np.pi * frame / 8)
        for circle, spoke, share in zip(circles, spokes, (-0.25, 1.0), strict=True):
            (x0, x1), (y0, y1) = spoke.get_data()
            assert (x0, y0) == circle.center
            angle = np.deg2rad(degrees) * share * turn
            assert (x1 - x0, y1 - y0) == pytest.approx((-np.sin(angle), np.cos(angle)))
            assert np.hypot(x1 - x0, y1 - y0) == pytest.approx(circle.get_radius())
        where = np.array([s.get_x() for s in squares])
        start = where - np.array([-1, 0.5]) * 0.7 * turn if start is None else start
        assert where == pytest.approx(start + np.array([-1, 0.5]) * 0.7 * turn)
    for square, rail, x in zip(squares, rest[2:], start, strict=True):  # at rest in the middle of its rail, and above it
        ends = rail.get_xdata()
        assert x + square.get_width() / 2 == pytest.approx(np.mean(ends))
        assert ends[0] <= x - 0.7
        assert 0 <= square.get_y() - rail.get_ydata()[0] <= 0.1
    for circle, mark in zip(circles, rest[:2], strict=True):  # the place of the spoke at rest
        assert list(mark.get_xdata()) == [circle.center[0]] * 2
        assert mark.get_ydata()[0] == circle.center[1] + circle.get_radius() < mark.get_ydata()[1]


@pytest.mark.parametrize("count", [1, 6, 7, 13])
def test_bodies_stand_in_rows_of_six_with_their_names_below(count: int) -> None:
    names = [f"gearbox.stage[{k}].intermediate_shaft" for k in range(count)]
    animation = animate_mode(picture(*[(name, "rad", 1 + 0j) for name in names]))
    animation._draw_was_started = True
    (ax,) = animation._fig.axes
    centres = [p.center for p in ax.patches]
    columns = min(count, COLUMNS)
    assert [(round((x - 1.5) / 3), round((-1.1 - y) / 3)) for x, y in centres] == [(k % 6, k // 6) for k in range(count)]
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    for (x, y), text in zip(centres, ax.texts, strict=True):
        assert left <= x - 1.25
        assert x + 1.25 <= right
        assert low <= y - 1.5
        assert y + 1.25 <= high
        assert text.get_position() == pytest.approx((x, y - 1.3))
        assert text.get_text().replace("\n", ".") in names
        assert max(map(len, text.get_text().split("\n"))) <= max(16, len("intermediate_shaft"))
    assert right - left == pytest.approx(3 * columns, abs=0.5)
    assert ax.texts[0].get_text() == "gearbox.stage[0]\nintermediate_shaft"
    assert animation._interval == 40
    assert ax.get_title() == picture().title


NO_SWING = [({"frames": 1}, "frames is 1"), ({"degrees": 0.0}, r"degrees is 0\.0"), ({"degrees": 180.5}, r"degrees is 180\.5")]


@pytest.mark.parametrize(("given", "said"), NO_SWING)
def test_animations_that_show_nothing_are_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        animate_mode(MIXED, **given)


def diagram(**more: Any) -> Campbell:
    speeds = np.array([10.0, 20.0, 30.0])
    frequencies = np.array([[2.0, 50.0], [2.5, 50.0], [3.0, 50.0]])
    crossings = (Crossing(15.0, "mesh", 4, 2.25, 0.0123), Crossing(25.0, "unbalance", 1, 2.75, 0.5))
    given = {"orders": {"mesh": 1.0, "unbalance": 0.5}, "crossings": crossings} | more
    return Campbell(speeds, frequencies, 0 * frequencies, np.array([[1, 4], [1, 4], [1, 4]]), **given)


def test_a_campbell_diagram_shows_frequencies_orders_and_crossings() -> None:
    axes = diagram().plot()
    rpm = np.array([10.0, 20.0, 30.0]) * 30 / np.pi
    assert len(axes.lines) == 5
    first, second, mesh, unbalance, marks = axes.lines
    assert first.get_ydata().tolist() == [2.0, 2.5, 3.0]
    assert second.get_ydata().tolist() == [50.0, 50.0, 50.0]
    for line in (first, second, mesh, unbalance):
        assert line.get_xdata() == pytest.approx(rpm)
    assert [line.get_label() for line in (first, mesh, unbalance, marks)] == [
        "natural frequencies", "mesh (order 1)", "unbalance (order 0.5)", "crossings",
    ]  # fmt: skip
    assert second.get_label().startswith("_")
    assert mesh.get_ydata() == pytest.approx(np.array([10, 20, 30]) / (2 * np.pi))
    assert unbalance.get_ydata() == pytest.approx(np.array([10, 20, 30]) / (4 * np.pi))
    assert [mesh.get_color(), unbalance.get_color(), marks.get_color()] == [*COLOURS[:2], MARK]
    assert marks.get_xdata() == pytest.approx(np.array([15, 25]) * 30 / np.pi)
    assert list(marks.get_ydata()) == [2.25, 2.75]
    assert [(t.get_text(), pytest.approx(t.xy[0]), t.xy[1]) for t in axes.texts] == [
        ("1", rpm[0], 2.0), ("4", rpm[0], 50.0), ("4", 15 * 30 / np.pi, 2.25), ("1", 25 * 30 / np.pi, 2.75),
    ]  # fmt: skip
    axes.figure.draw_without_rendering()
    number = axes.texts[0].get_window_extent()  # beside the beginning of its curve, not on it
    x, y = axes.transData.transform((rpm[0], 2.0))
    assert number.x1 <= x < number.x1 + 2 * number.width
    assert number.y0 < y < number.y1
    low, high = axes.get_xlim()
    assert high == pytest.approx(rpm[-1])
    assert low == pytest.approx(rpm[0] - 0.02 * 20 * 30 / np.pi)
    assert axes.get_ylim() == (0, pytest.approx(1.1 * 30 / (2 * np.pi)))
    assert axes.get_xlabel() == "speed of the reference shaft, 1/min"
    legend, frame = axes.get_legend().get_window_extent(), axes.get_window_extent()
    assert frame.x1 < legend.x0  # beside the diagram, at its upper edge
    assert frame.y1 - 0.1 * frame.height < legend.y1 <= frame.y1
    assert not axes.get_legend().get_frame_on()
    assert not [line for line in diagram(crossings=()).plot().lines if line.get_label() == "crossings"]


LIMITS = [
    ({"a": 1.0}, 1.1 * 30 / (2 * np.pi)), ({"a": 0.01}, 1.1 * 2.0), ({"a": 1000.0}, 1.1 * 50.0), ({}, 1.1 * 50.0),
    ({"a": 0.01, "b": 2.0}, 1.1 * 30 / np.pi),
]  # fmt: skip


@pytest.mark.parametrize(("orders", "highest"), LIMITS)
def test_its_upper_limit_is_that_of_the_excitations_and_shows_one_frequency(orders: dict[str, float], highest: float) -> None:
    assert diagram(orders=orders).highest == pytest.approx(highest)
    assert Campbell(np.array([0.0, 1.0]), np.empty((2, 0)), np.empty((2, 0)), np.empty((2, 0), int), orders, ()).highest == 1.0


def test_its_text_and_table_list_the_crossings() -> None:
    found = diagram(conditions=("open: mesh m",))
    head, *rows, note = str(found).splitlines()
    assert [re.split(r"\s{2,}", row.strip()) for row in rows] == [
        ["143.239", "mesh", "4", "2.25", "0.01230"], ["238.732", "unbalance", "1", "2.75", "0.50000"],
    ]  # fmt: skip
    for row, words in zip(rows, ("mesh", "unbalance"), strict=True):
        assert row.index(words) == head.index("order")
    assert note == "Operating point: open: mesh m."
    assert str(diagram(crossings=())) == "no order meets a natural frequency in this range of speed"
    table = found.to_dataframe()
    assert table["speed, 1/min"].tolist() == pytest.approx([143.239, 238.732], abs=1e-3)
    assert table.iloc[0].tolist() == [15.0, pytest.approx(143.239, abs=1e-3), "mesh", 4, 2.25, 0.0123]


class Rotor(gl.Component):
    """A disc on a shaft that is fixed at its other end."""

    def assemble(self) -> list[Any]:
        self.ground, self.shaft, self.disc = gp.Fixed(), gp.SpringDamper(c=400.0, d=2.0), gp.Inertia(J=1.0)
        return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange_a)]


@pytest.fixture(scope="module")
def rotor() -> gl.System:
    return gl.compile(Rotor())


def test_critical_speeds_of_a_stiffness_that_depends_on_speed(rotor: gl.System) -> None:
    """w = sqrt(400 + w^2 / 4 ...): the order k meets sqrt(c0 (1 + a W)) where k W is that; the mode and damping are those there."""
    found = gl.campbell(rotor, np.linspace(1.0, 30.0, 4), [1.0, 2.0], parameters=lambda w: {"shaft.c": 100.0 + 10.0 * w})
    exact = {k: (10.0 + np.sqrt(100.0 + 400.0 * k**2)) / (2 * k**2) for k in (1, 2)}
    assert [(c.speed, c.order) for c in found.crossings] == [(pytest.approx(exact[2]), "2"), (pytest.approx(exact[1]), "1")]
    for crossing in found.crossings:
        stiffness = 100.0 + 10.0 * crossing.speed
        assert crossing.frequency == pytest.approx(np.sqrt(stiffness) / (2 * np.pi))
        assert crossing.damping == pytest.approx(2.0 / (2 * np.sqrt(stiffness)))
        assert crossing.mode == 0
    assert found.frequencies[:, 0] == pytest.approx(np.sqrt(100 + 10 * found.speeds) / (2 * np.pi))
    assert found.modes.tolist() == [[0]] * 4


@pytest.mark.parametrize(
    ("given", "said"),
    [({"orders": [[1.0]]}, "expected events for each revolution"), ({"orders": {"a": "b"}}, "order a is 'b'"),
     ({"orders": 3.0}, "orders is"),
     ({"at": lambda w: 1 / 0}, r"at, a function, raised ZeroDivisionError at 1 rad/s: division by zero; expected a function of the speed"),
     ({"speeds": [1.0]}, "speeds is"), ({"speeds": [2.0, 1.0]}, "speeds is")],
)  # fmt: skip
def test_wrong_arguments_of_a_campbell_diagram(rotor: gl.System, given: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        gl.campbell(rotor, **({"speeds": [1.0, 2.0], "orders": [1.0]} | given))


def test_modes_are_matched_by_shape_and_by_frequency_where_shapes_do_not_tell() -> None:
    random = np.random.default_rng(2)
    shapes = random.normal(size=(6, 4)) + 1j * random.normal(size=(6, 4))
    frequencies = np.array([1.0, 2.0, 3.0, 4.0])
    for order in ([1, 0, 3, 2], [3, 2, 1, 0]):
        scaled = shapes[:, order] * np.exp(1j * random.uniform(0, 6, 4)) * random.uniform(0.5, 2, 4)
        first, second = same_modes(shapes, frequencies, scaled, frequencies[order] * 1.1)
        assert [order[k] for k in second] == first.tolist() == [0, 1, 2, 3]
    alike = np.ones((3, 2))
    assert same_modes(alike, np.array([1.0, 10.0]), alike, np.array([9.0, 1.1]))[1].tolist() == [1, 0]
    first, second = same_modes(shapes, frequencies, shapes[:, [2]], frequencies[[2]])
    assert (first.tolist(), second.tolist()) == ([2], [0])
    units = np.array([1.0, 1e6, 1e-6, 1.0, 1.0, 1.0])[:, None]  # of the states: they do not matter
    assert same_modes(units * shapes, frequencies, units * shapes[:, ::-1], frequencies[::-1])[1].tolist() == [3, 2, 1, 0]


def test_derivatives_of_a_damped_mode_are_those_of_its_closed_form() -> None:
    """m s^2 + d s + c = 0: frequency sqrt(c / m) / 2 pi and ratio d / (2 sqrt(c m)), by c and by d."""
    m, d, c = 2.0, 3.0, 50.0
    s = -d / (2 * m) + 1j * np.sqrt(c / m - (d / (2 * m)) ** 2)
    values = np.array([0.0, s])
    for name, value, change, frequency, ratio in (
        ("c", c, -1 / (2 * m * s + d), 1 / (4 * np.pi * np.sqrt(c * m)), -d / (4 * np.sqrt(m) * c**1.5)),
        ("d", d, -s / (2 * m * s + d), 0.0, 1 / (2 * np.sqrt(c * m))),
    ):
        found = mode_sensitivity(name, "N", value, values, np.array([0.0, change]))
        assert found.frequencies == pytest.approx([0.0, frequency], abs=1e-15)
        assert found.damping == pytest.approx([0.0, ratio])
        assert found.relative == pytest.approx([0.0, 0.5 if name == "c" else 0.0], abs=1e-15)
        assert "-0 " not in str(found)
    assert str(mode_sensitivity("x", "1", 4.0, values[1:], values[1:])).splitlines()[:2] == [
        "Change with x = 4", "mode  frequency, Hz                   damping ratio    frequency, % per % of the parameter",
    ]  # fmt: skip
