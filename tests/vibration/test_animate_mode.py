"""Animations of a mode by hand."""

from __future__ import annotations

import pytest

from gearlib.vibration.animate_mode import animate_mode
from gearlib.vibration.draw_mode import ModePicture

DISCS = ModePicture(1, 5.0, 0.0, [("a", "rad", -0.5 + 0j), ("b", "rad", 1 + 0j)], [])


def test_two_frames_are_enough_for_an_animation() -> None:
    """The bodies at one end of their swing and at the other."""
    animation = animate_mode(DISCS, frames=2, degrees=90.0)
    animation._draw_was_started = True
    spokes = [line for line in animation._fig.axes[0].lines if line.get_linewidth() == 2.5]
    for frame, end in enumerate((-1.0, 1.0)):
        animation._func(frame)
        assert spokes[1].get_xdata()[1] - spokes[1].get_xdata()[0] == pytest.approx(end)
