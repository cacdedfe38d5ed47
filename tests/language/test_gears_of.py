"""Which gears a view shows, at which angles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearparts as gp
from gearlib.errors import ArgumentError, ModelError, NameLookupError
from gearlib.language.gears_of import FARTHEST, MOST_FRAMES, frames, gears_in, in_motion, turned


def train() -> Any:
    return gp.ZhouCui2022(Z_s=19, Z_p=31, Z_r=81)


def test_a_frame_is_an_angle() -> None:
    assert frames("angle", 0.5, "angles").tolist() == [0.5]
    assert frames("angle", [0.0, 1, 2.5], "angles").tolist() == [0.0, 1.0, 2.5]
    assert len(frames("angle", np.zeros(MOST_FRAMES), "angles")) == MOST_FRAMES
    assert frames("angle", -FARTHEST, "angles").tolist() == [-FARTHEST]
    for wrong in (np.zeros(MOST_FRAMES + 1), [0.0, -1.001 * FARTHEST], [], np.zeros((2, 2))):
        with pytest.raises(ArgumentError, match=r"^angle is .*; expected angles, 1000 at most$"):
            frames("angle", wrong, "angles")


def test_gears_are_found_by_path_in_the_order_of_the_parts() -> None:
    every = [path for path, _ in gears_in(train(), None, None)]
    assert every == ["train.x_unit", "train.p_unit"]
    assert [path for path, _ in gears_in(train(), "train", None)] == every
    assert [path for path, _ in gears_in(train(), "train.p_unit", None)] == ["train.p_unit"]
    own = gears_in(train(), None, None)[0][1]
    assert gears_in(train(), "train", own) == [("train", own)]
    assert gears_in(train(), None, own) == [("", own)]
    for part in ("train.y", "x_unit"):
        with pytest.raises(NameLookupError, match=f"ZhouCui2022 has no part '{part}'"):
            gears_in(train(), part, None)
    with pytest.raises(ModelError, match=r"'train\.shaft_at_sun' has no gears whose"):
        gears_in(train(), "train.shaft_at_sun", None)
    with pytest.raises(ModelError, match=r"^Inertia has no gears whose teeth are known; expected meshes with z_a"):
        gears_in(gp.Inertia(J=1.0), None, None)
    with pytest.raises(ArgumentError, match="gears is 3; expected gears, such as"):
        gears_in(train(), None, 3)  # type: ignore[arg-type]


def test_what_a_component_returns_as_its_gears_is_named_if_it_is_none() -> None:
    part = type("Odd", (gp.Inertia,), {"drawn_gears": lambda self: [3]})(J=1.0)
    with pytest.raises(ModelError, match=r"^Odd\.drawn_gears\(\) must return gears, such as .*; got \[3\]$"):
        part.gear_view()


@pytest.mark.parametrize("held", [None, "ring", "carrier", "sun"])
def test_the_view_turns_by_the_shaft_that_is_held(held: str | None) -> None:
    angles = np.array([0.0, 0.5, 2.0])
    view = turned(train(), None, angles, held, None)
    for motion in view.motions:
        first, carrier = motion.gears.holding.get(held or "ring", (1.0, 0.0))
        assert motion.first == pytest.approx(first * angles)
        assert motion.carrier == pytest.approx(carrier * angles)
        assert motion.forces.shape == (3, 0)
    planets = view.motions[0]
    (first, carrier), teeth = (planets.first[-1], planets.carrier[-1]), {"sun": 19, "ring": 81}
    ring = carrier - (first - carrier) * teeth["sun"] / teeth["ring"]  # Willis
    assert {None: ring, "ring": ring, "carrier": carrier, "sun": first}[held] == pytest.approx(0.0, abs=1e-12)
    assert list(view.captions) == ["angle 0°", "angle 28.65°", "angle 114.6°"]


def test_a_motion_is_read_by_the_paths_of_the_parts() -> None:
    times, asked = np.array([0.0, 1.0]), []

    def history(name: str) -> Any:
        asked.append(name)
        return len(asked) * times

    view = in_motion(train(), None, times, history, None)
    count = 0
    for motion in view.motions:
        turning = [motion.gears.first, *([motion.gears.carrier] if motion.gears.carrier else [])]
        names = [*turning, *(c.force for c in motion.gears.contacts if c.force)]
        assert asked[count : count + len(names)] == [f"{motion.name}.{name}" for name in names]
        assert motion.first.tolist() == [0.0, count + 1.0]
        assert motion.carrier.tolist() == ([0.0, count + 2.0] if motion.gears.carrier else [0.0, 0.0])
        shares = [c.share for c in motion.gears.contacts if c.force]
        start = count + len(names) - len(shares)
        assert motion.forces == pytest.approx(np.outer(times, [s * (start + k + 1) for k, s in enumerate(shares)]))
        count += len(names)
    assert list(view.captions) == ["t = 0 s", "t = 1 s"]

    own = gears_in(train(), "train.p_unit", None)[0][1]
    force = next(c.force for c in own.contacts if c.force)

    def without_forces(name: str) -> Any:
        if name.endswith(force):
            raise NameLookupError(f"no {name}")
        return times

    assert in_motion(train(), "train.p_unit", times, without_forces, own).motions[0].forces.shape == (2, 0)
    with pytest.raises(NameLookupError, match=r"no train\.p_unit"):
        in_motion(train(), "train.p_unit", times, without_forces, None)
