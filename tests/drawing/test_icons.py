"""Icons: what they show ends where it should, and what is symmetric is drawn so."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.drawing.icons import ICONS
from tests.drawing.shapes import CLOSE, Shape, same, shapes

ONE_SHAFT = {
    "fixed", "torque", "speed", "angle", "acceleration", "force", "load", "eddy_brake", "sensor", "heat_capacity", "temperature",
    "body",
}  # fmt: skip
UPSIDE_DOWN = {
    "inertia", "disc", "mass", "damper", "one_way_clutch", "joint", "link", "force", "eddy_brake", "heat_capacity", "temperature",
    "heat_resistance", "body",
}  # fmt: skip
FROM_BEHIND = {"inertia", "disc", "mass", "clutch", "joint", "link", "heat_resistance"}
HALF_A_TURN = {"spring"}
THROUGH = {"brake", "bearing", "link"}  # their shaft passes them
TO_THE_CENTRE = {"gear": 2, "lossy_gear": 2, "mesh": 2, "rack": 1}  # gears, behind which their shafts end


def drawn(name: str) -> list[Shape]:
    return shapes("".join(ICONS[name].drawing))


def mirrored(found: list[Shape], x: float, y: float) -> list[Shape]:
    return [Shape(s.kind, s.points * [x, y], s.radius, s.text, s.title, s.attributes) for s in found]


def ends(shape: Shape) -> list[np.ndarray]:
    """Free ends of a line."""
    return [] if shape.closed else [shape.points[0], shape.points[-1]]


FRAMED = {name for name, icon in ICONS.items() if icon.framed}


@pytest.mark.parametrize("name", sorted(set(ICONS) - FRAMED))
def test_shafts_reach_the_sides_and_end_at_the_part(name: str) -> None:
    """48 by 40, with shafts at the stated heights; each ends on an outline, or behind the middle of its gear."""
    icon, found = ICONS[name], drawn(name)
    boxes = np.array([shape.box for shape in found])
    assert (boxes[:, 0].min() >= -24) & (boxes[:, 2].max() <= 24) & (boxes[:, 1].min() >= -20) & (boxes[:, 3].max() <= 20)
    expected = {(24.0, icon.right)} | (set() if name in ONE_SHAFT else {(-24.0, icon.left)})
    assert all(min(shape.distance(np.array(point)) for shape in found) == 0 for point in expected)
    assert {(float(x), float(y)) for shape in found for x, y in shape.points if abs(x) == 24 and not shape.closed} <= expected
    if name in THROUGH:
        return
    shafts = [s for s in found if s.kind == "line" and any(abs(p[0]) == 24 for p in ends(s))]
    for shaft in shafts:
        (inner,) = (p for p in ends(shaft) if abs(p[0]) != 24)
        others = [s for s in found if s is not shaft]
        gears = [s for s in others if s.kind in ("rect", "circle") and s.middle == pytest.approx(inner)]
        assert gears if name in TO_THE_CENTRE else min(s.distance(inner) for s in others) < CLOSE
    assert all(shaft.points[0][1] == shaft.points[1][1] for shaft in shafts)


@pytest.mark.parametrize("name", sorted(UPSIDE_DOWN | FROM_BEHIND | HALF_A_TURN))
def test_symmetric_parts_are_drawn_so(name: str) -> None:
    found = drawn(name)
    for names, x, y in ((UPSIDE_DOWN, 1, -1), (FROM_BEHIND, -1, 1), (HALF_A_TURN, -1, -1)):
        assert name not in names or same(found, mirrored(found, x, y))


def test_couplings_of_two_parts_are_those_parts() -> None:
    """A spring and a damper side by side; a gap is a fork about a stub, and a spring behind."""
    both = drawn("spring_damper")
    (spring,) = (s for s in both if len(s.points) == len(drawn("spring")[1].points))
    assert spring.points.mean(axis=0) == pytest.approx((0, -9))
    assert same([spring], [Shape("path", (0, -18) - spring.points, 0.0, "", "", spring.attributes)])
    webs = [s for s in both if set(s.points[:, 0].tolist()) in ({-17.0}, {17.0})]
    assert [sorted(web.points[:, 1].tolist()) for web in webs] == [[-9, 9], [-9, 9]]
    damper = [s for s in both if s.points[:, 1].mean() == pytest.approx(9)]
    assert len(damper) == len(drawn("damper"))
    assert {float(x) for s in damper for x in s.points[:, 0] if s.points[:, 1].tolist() == [9, 9]} >= {-17.0, 17.0}
    fork = [s for s in drawn("backlash") if "stroke-linejoin" not in s.attributes]  # all but the spring
    assert same(fork, mirrored(fork, 1, -1))


@pytest.mark.parametrize("name", ["brake", "bearing", "fixed"])
def test_the_housing_is_hatched_away_from_the_part(name: str) -> None:
    """Parallel strokes at equal distances, which begin on one line."""
    strokes = [s for s in drawn(name) if s.attributes.get("stroke-width") == "1"]
    assert len(strokes) >= 5
    first = np.array([s.points[0] for s in strokes])
    slants = np.array([s.points[1] - s.points[0] for s in strokes])
    assert slants == pytest.approx(np.tile(slants[0], (len(slants), 1)))
    steps = np.diff(first, axis=0)
    assert steps == pytest.approx(np.tile(steps[0], (len(steps), 1)))
    (wall,) = (s for s in drawn(name) if s.attributes.get("stroke-width") != "1" and all(s.distance(p) < CLOSE for p in first))
    length = np.ptp(wall.points, axis=0).max()
    assert np.ptp(first, axis=0).max() <= length < np.ptp(first, axis=0).max() + 2 * np.abs(steps[0]).max()
    away = slants[0] @ (wall.points.mean(axis=0) - 0.0) if name != "fixed" else -slants[0][0]
    assert away > 0


def test_gauges_have_a_scale_of_equal_steps() -> None:
    """Marks every 30 degrees on rays from the centre, between hand and rim."""
    found = drawn("sensor")
    rim = max((s for s in found if s.kind == "circle"), key=lambda s: s.radius)
    marks = [s for s in found if s.attributes.get("stroke-width") == "1"]
    angles = [np.degrees(np.arctan2(s.points[:, 1], s.points[:, 0])) for s in marks]
    assert np.array(angles) == pytest.approx(np.array([[a, a] for a in (-150, -120, -90, -60, -30)]), abs=0.2)
    lengths = np.array([np.hypot(*s.points.T) for s in marks])
    assert lengths == pytest.approx(np.tile(lengths[0], (5, 1)), rel=0.01)
    assert 0.7 * rim.radius < lengths[0][0] < lengths[0][1] < rim.radius
    assert same(found, [s for s in drawn("sensor_between") if s.points.min() > -24])
    (hub,) = (s for s in found if s.kind == "circle" and s is not rim)
    assert not hub.middle.any()
    assert not rim.middle.any()


def test_letters_stand_in_the_middle_of_their_sign() -> None:
    for name in ("torque", "speed", "angle", "acceleration", "heat_capacity", "temperature"):
        (letter,) = shapes("".join(ICONS[name].letters))
        x, y = letter.points[0]
        assert (x, y - 0.36 * letter.size) == pytest.approx((0, 0), abs=0.5)  # half the height of a capital
        assert letter.attributes["text-anchor"] == "middle"


def test_gears_touch_and_racks_mesh() -> None:
    small, large = (s for s in drawn("gear") if s.kind == "rect")
    assert small.box[3] == large.box[1]
    assert same([small, large], [s for s in drawn("lossy_gear") if s.kind == "rect"])
    a, b = (s for s in drawn("mesh") if s.kind == "rect")
    (spring,) = (s for s in drawn("mesh") if len(s.points) > 2 and s.kind == "path")
    assert (spring.box[1], spring.box[3]) == (a.box[3], b.box[1])
    assert spring.points.mean(axis=0) == pytest.approx((0, 0))
    (rack,) = (s for s in drawn("rack") if s.kind == "polygon")
    pinion = max((s for s in drawn("rack") if s.kind == "circle"), key=lambda s: s.radius)
    teeth = rack.points[2:-2]
    assert teeth[::2, 1].max() == teeth[::2, 1].min() < teeth[1::2, 1].min() == teeth[1::2, 1].max() < rack.box[3]
    assert 0 < teeth[0, 1] - pinion.box[3] <= 1
    assert np.ptp(np.diff(teeth[:, 0])) == 0
    assert same([rack], mirrored([rack], -1, 1))
