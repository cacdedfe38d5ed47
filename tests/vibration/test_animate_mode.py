"""Animations of a mode by hand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from gearlib.vibration.animate_mode import animate_mode
from gearlib.vibration.draw_mode import ModePicture

DISCS = ModePicture(1, 5.0, 0.0, [("a", "rad", -0.5 + 0j), ("b", "rad", 1 + 0j)], [])
LATE = ModePicture(2, 5.0, 0.1, [("a", "rad", 2 + 0j), ("b", "rad", 1j), ("c", "m", 0.5 + 0j), ("d", "m", -0.3j)], [])


@pytest.fixture(autouse=True)
def _close() -> Iterator[None]:
    yield
    plt.close("all")


def drawn(mode: ModePicture, **more: Any) -> tuple[Any, Any]:
    """An animation that is not shown, and its axes."""
    animation = animate_mode(mode, **more)
    animation._draw_was_started = True
    return animation, animation._fig.axes[0]


def spokes(ax: Any) -> list[Any]:
    return [line for line in ax.lines if line.get_linewidth() == 2.5]


def test_two_frames_are_enough_for_an_animation() -> None:
    """The bodies at one end of their swing and at the other."""
    animation, ax = drawn(DISCS, frames=2, degrees=90.0)
    for frame, end in enumerate((-1.0, 1.0)):
        animation._func(frame)
        assert spokes(ax)[1].get_xdata()[1] - spokes(ax)[1].get_xdata()[0] == pytest.approx(end)


def test_a_swing_may_be_less_than_a_degree() -> None:
    animation, _ = drawn(DISCS, frames=4, degrees=0.5)
    (spoke,) = animation._func(0)[1:]
    assert spoke.get_xdata()[1] - spoke.get_xdata()[0] == pytest.approx(-np.sin(np.pi / 360))


def test_discs_and_squares_stand_at_rest_before_the_first_frame() -> None:
    """A disc with a spoke that points up, to a mark beside the disc; a square of 0.8 in the middle of its rail, just above it."""
    _, ax = drawn(LATE)
    assert [type(patch).__name__ for patch in ax.patches] == ["Circle", "Circle", "Rectangle", "Rectangle"]
    rest = [line.get_xydata().tolist() for line in ax.lines if line.get_linewidth() == 1]
    for k, patch in enumerate(ax.patches):
        x, y = 1.5 + 3 * k, -1.1
        if k < 2:
            assert (patch.center, patch.radius) == ((x, y), 1.0)
            assert spokes(ax)[k].get_xydata() == pytest.approx(np.array([[x, y], [x, y + 1.0]]))
            assert np.array(rest[k]) == pytest.approx(np.array([[x, y + 1.0], [x, y + 1.25]]))
        else:
            (left, right), rail = np.array(rest[k])[:, 0], np.array(rest[k])[:, 1]
            assert (left, right) == pytest.approx((x - 1.2, x + 1.2))
            assert rail == pytest.approx([y - 0.5, y - 0.5])
            assert patch.get_bbox().bounds == pytest.approx((x - 0.4, y - 0.45, 0.8, 0.8))


@pytest.mark.parametrize("frame", [5, 2, 1])
def test_a_body_that_is_a_quarter_period_ahead_is_drawn_so(frame: int) -> None:
    """The first turns as the cosine of the phase; the second, half as far, and the last slide as its quarter period later."""
    animation, ax = drawn(LATE, frames=8, degrees=60.0)
    artists = animation._func(frame)
    assert artists == [*spokes(ax), *(patch for patch in ax.patches if hasattr(patch, "get_x"))]
    phase = 2 * np.pi * frame / 8
    angles = [np.arctan2(-np.diff(s.get_xdata())[0], np.diff(s.get_ydata())[0]) for s in artists[:2]]
    assert np.rad2deg(angles) == pytest.approx([60 * np.cos(phase), -30 * np.sin(phase)])
    ways = [square.get_x() + 0.4 - (1.5 + 3 * k) for k, square in enumerate(artists[2:], 2)]
    assert ways == pytest.approx([0.7 * np.cos(phase), 0.7 * 0.6 * np.sin(phase)])


@pytest.mark.parametrize(("count", "columns", "rows"), [(0, 1, 1), (1, 1, 1), (6, 6, 1), (7, 6, 2)])
def test_the_picture_has_a_cell_for_each_body(count: int, columns: int, rows: int) -> None:
    _, ax = drawn(ModePicture(0, 0.0, 0.0, [(f"b{k}", "rad", 1 + 0j) for k in range(count)], []))
    assert len(ax.patches) == count
    assert ax.get_xlim() == pytest.approx((-0.1, 3 * columns + 0.1))
    assert ax.get_ylim() == pytest.approx((-3 * rows, 0.6))
    assert ax.get_title() == "Mode 0: free motion"


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("train.intermediate_shaft.left.body", ["train", "intermediate_shaft", "left.body"]),
        ("intermediate_shaft.end.b", ["intermediate_shaft", "end.b"]),
        ("gearbox.stage[0]", ["gearbox.stage[0]"]),
        ("gearbox.stage[10]", ["gearbox", "stage[10]"]),
        ("first.second.third.fourth.fifth", ["first.second", "third.fourth", "fifth"]),
    ],
)
def test_names_are_split_between_their_parts_into_lines_of_sixteen_characters(name: str, lines: list[str]) -> None:
    _, ax = drawn(ModePicture(1, 5.0, 0.0, [(name, "rad", 1 + 0j)], []))
    assert ax.texts[0].get_text().split("\n") == lines
