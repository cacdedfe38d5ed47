"""Wheels, marks and arrows of gear views stand where the geometry says: in the picture, its animation, the page and matplotlib's."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from math import cos, pi, sin

import matplotlib.pyplot as plt
import numpy as np
import pytest

from gearlib.drawing.gears.gear_set import Contact, GearSet, Wheel, meshing_turn
from gearlib.drawing.gears.gear_view import EDGE, LONGEST, SIZE, TOP, GearMotion, GearView
from gearlib.errors import ArgumentError
from tests.drawing.shapes import CLOSE, Shape, shapes

ALPHA = 0.35


def star(radius: float, teeth: int) -> np.ndarray:
    """A polygon with its tips at a radius, one on the first axis."""
    angle = np.arange(2 * teeth) * pi / teeth
    return np.c_[np.cos(angle), np.sin(angle)] * np.where(np.arange(2 * teeth) % 2, 0.9 * radius, radius)[:, None]


PAIR = GearSet(
    (Wheel("gear 1: 10", star(0.11, 10), 0.1, False, (0.0, 1.0, 0.0)),
     Wheel("gear 2: 20", star(0.21, 20), 0.2, False, (0.3, -0.5, 1.5), 0.3, 0.0)),
    (Contact(0, 1, ALPHA, "f"),), "first.phi", "", {"": (1.0, 0.0)},
)  # fmt: skip
SET = GearSet(
    (Wheel("sun: 12", star(0.065, 12), 0.06, False, (0.0, 1.0, 0.0)),
     Wheel("planet 1: 18", star(0.095, 18), 0.09, False, (0.1, -2 / 3, 5 / 3), 0.15, 0.0),
     Wheel("planet 2: 18", star(0.095, 18), 0.09, False, (0.4, -2 / 3, 5 / 3), 0.15, pi),
     Wheel("ring: 48", star(0.245, 48), 0.24, True, (0.0, -0.25, 1.25))),
    (Contact(0, 1, ALPHA, "a"), Contact(3, 2, ALPHA, "b")), "sun.phi", "carrier.phi", {"ring": (1.0, 0.2)},
)  # fmt: skip
FIRST, CARRIER = np.array([0.0, 0.5, 1.2]), np.array([0.0, 0.1, 0.24])


def view(frames: int = 3) -> GearView:
    motions = [
        GearMotion("train.pair", PAIR, FIRST[:frames], 0 * FIRST[:frames], np.array([[10.0], [-20.0], [0.0]])[:frames]),
        GearMotion(
            "train.set", SET, FIRST[:frames], CARRIER[:frames], np.array([[3e4, -2e4], [1e4, 6e4], [0.0, 5.0]])[:frames]
        ),
    ]
    return GearView("Train", motions, [f"t = {k} s" for k in range(frames)])


def wheels(drawn: list[Shape], name: str) -> list[Shape]:
    return [s for s in drawn if s.title == name]


def scaled(gears: GearSet, k: int) -> tuple[float, np.ndarray]:
    """Pixels per metre and the set's axis in the picture, from what must fit between the margins of panel k."""
    if gears is PAIR:
        left, right = -0.11, 0.3 + 0.21
        scale = (SIZE - 2 * EDGE) / (right - left) / 1.04
        return scale, np.array([SIZE * (k + 0.5) - scale * (left + right) / 2, TOP + SIZE / 2])
    reach = 0.245 * 1.1
    return (SIZE - 2 * EDGE) / (2 * reach) / 1.04, np.array([SIZE * (k + 0.5), TOP + SIZE / 2])


@pytest.mark.parametrize("frames", [1, 3])
def test_wheels_stand_at_their_places(frames: int) -> None:
    drawn = shapes(view(frames).svg)
    for k, gears in enumerate((PAIR, SET)):
        scale, axis = scaled(gears, k)
        for wheel in gears.wheels:
            own = wheels(drawn, wheel.name)
            centre = axis + scale * wheel.orbit * np.array([cos(wheel.place), -sin(wheel.place)])
            (outline,) = (s for s in own if s.kind == "polygon")
            c, s = cos(wheel.turn[0]), sin(wheel.turn[0])
            turned = wheel.outline @ np.array([[c, s], [-s, c]])
            assert outline.points == pytest.approx(centre + scale * turned * [1, -1], abs=2 * CLOSE)
            pitch = [s for s in own if s.attributes.get("stroke-dasharray")]
            assert [s.radius for s in pitch] == pytest.approx([scale * wheel.pitch_radius], abs=CLOSE)
            assert all(s.middle == pytest.approx(centre, abs=CLOSE) for s in own if s.kind == "circle")
            (mark,) = (s for s in own if s.kind == "line")
            reach = np.hypot(*(mark.points - centre).T) / scale
            assert reach[0] < reach[1]
            along = (mark.points[1] - centre) / np.hypot(*(mark.points[1] - centre))
            assert along == pytest.approx([c, -s], abs=1e-3)
            if wheel.ring:  # on the rim, outside of the teeth
                (rim,) = (s for s in own if s.attributes.get("stroke-width") == "1")
                assert rim.radius == pytest.approx(1.1 * 0.245 * scale, abs=CLOSE)
                assert 0.245 < reach[0] < reach[1] < 1.1 * 0.245
                assert outline.attributes["fill"] == "white"
            else:
                assert 0.2 * wheel.pitch_radius < reach[0] < reach[1] < 0.8 * wheel.pitch_radius
                assert len([s for s in own if s.kind == "circle"]) == 2
    order = [
        s.title for s in drawn if s.kind == "polygon" and s.title.partition(":")[0] in ("sun", "ring", "planet 1", "planet 2")
    ]
    assert order == ["ring: 48", "sun: 12", "planet 1: 18", "planet 2: 18"]  # from back to front
    fills = {s.title: s.attributes["fill"] for s in drawn if s.kind == "polygon"}
    assert fills["planet 1: 18"] == fills["planet 2: 18"] == fills["gear 2: 20"] != fills["sun: 12"] == fills["gear 1: 10"]


def test_titles_and_captions_are_centred_over_their_panels() -> None:
    drawn = shapes(view().svg)
    for k, words in enumerate(("train.pair", "train.set")):
        (title,) = (s for s in drawn if s.text == words)
        assert title.points[0][0] == SIZE * (k + 0.5)
        assert title.box[3] <= TOP
    said = {s.text: s for s in drawn if s.kind == "text"}
    words = "arrows: forces of the meshes on the"
    lines = (
        ("gear 1: 10 teeth, gear 2: 20 teeth", f"{words} gear 2, longest 20 N"),
        ("sun: 12 teeth, 2 × planet: 18 teeth, ring: 48 teeth", f"{words} planets, longest 60 kN"),
    )
    for k, pair in enumerate(lines):
        assert [said[line].points[0][0] for line in pair] == [SIZE * (k + 0.5)] * 2
        assert said[pair[1]].box[1] > TOP + SIZE
        assert said[pair[1]].box[3] < drawn[0].box[3]
    assert drawn[0].box[2] == 2 * SIZE
    still = shapes(view(1).svg)
    (caption,) = (s for s in still if s.text == "t = 0 s")
    assert caption.points[0][0] == SIZE
    assert TOP + SIZE < caption.box[1] < caption.box[3] < still[0].box[3]
    assert repr(view()) == "<GearView of Train: 6 gears, 3 frames; save('gears.svg') or save('gears.html') writes it>"
    named = GearView("Alone", [GearMotion("", PAIR, FIRST[:1], 0 * FIRST[:1], np.zeros((1, 0)))], ["now"])
    assert "Alone" in [s.text for s in shapes(named.svg)]
    assert "arrows" not in named.svg


@pytest.mark.parametrize("force", [100.0, -40.0])
@pytest.mark.parametrize("turn", [0.0, 0.7, 2.9])
def test_forces_press_the_teeth_apart_and_against_the_turn(force: float, turn: float) -> None:
    """At the pitch point, under the pressure angle; a positive one brakes the first wheel and pushes the second away from its teeth."""
    for contact, gears in ((PAIR.contacts[0], PAIR), *((c, SET) for c in SET.contacts)):
        placed = gears.placed(0.0, turn)
        first, a, b = gears.wheels[contact.a], placed[contact.a], placed[contact.b]
        x, y, fx, fy = gears.force_on_b(contact, placed, force)
        assert np.hypot(fx, fy) == pytest.approx(abs(force))
        assert np.hypot(x - a.x, y - a.y) == pytest.approx(first.pitch_radius)
        assert np.hypot(x - b.x, y - b.y) == pytest.approx(gears.wheels[contact.b].pitch_radius)
        torque_on_a = -((x - a.x) * fy - (y - a.y) * fx)
        assert torque_on_a == pytest.approx(-force * cos(ALPHA) * first.pitch_radius)
        out = np.array([b.x - a.x, b.y - a.y]) / np.hypot(b.x - a.x, b.y - a.y)
        assert np.array([fx, fy]) @ out == pytest.approx(abs(force) * sin(ALPHA) * (-1 if first.ring else 1))


def test_wheels_turn_and_orbit_with_the_first_gear_and_the_carrier() -> None:
    placed = SET.placed(0.5, 0.1)
    assert [p.angle for p in placed] == pytest.approx([0.5, 0.1 - 1 / 3 + 1 / 6, 0.4 - 1 / 3 + 1 / 6, -0.125 + 0.125])
    assert (placed[1].x, placed[1].y) == pytest.approx((0.15 * cos(0.1), 0.15 * sin(0.1)))
    assert (placed[2].x, placed[2].y) == pytest.approx((-0.15 * cos(0.1), -0.15 * sin(0.1)))
    assert (SET.extent, PAIR.extent) == pytest.approx((0.245 * 1.1, 0.3 + 0.21))


@pytest.mark.parametrize("place", [0.0, 0.8, 2.5])
@pytest.mark.parametrize(("z_a", "z_b", "ring"), [(17, 23, False), (20, 40, False), (60, 20, True), (57, 19, True)])
def test_a_tooth_faces_a_space_on_the_line_of_centres(z_a: int, z_b: int, ring: bool, place: float) -> None:
    """At all angles of wheel and carrier: teeth of a where its angle times z_a is whole turns, spaces of b half a tooth off."""
    start = (0.2, 1.0, 0.0)
    turn = meshing_turn(z_a, z_b, ring, place, start)
    for first, carrier in ((0.0, 0.0), (1.3, 0.0), (0.4, -0.9)):
        line = place + carrier  # direction from the axis of a to that of b
        at_a = (line - (start[0] + first)) * z_a / (2 * pi)  # teeth of a (of a ring: spaces) passed by the line
        seen = line if ring else line + pi
        at_b = (seen - (turn[0] + turn[1] * first + turn[2] * carrier)) * z_b / (2 * pi)
        faces = at_a - at_b if ring else at_a + at_b + 0.5  # in pitches: a whole number
        assert abs(faces - round(faces)) < 1e-9


def arrows(drawn: ET.Element) -> list[ET.Element]:
    return [e for e in drawn.iter("{http://www.w3.org/2000/svg}path") if e.get("class") == "force"]


def test_arrows_are_as_long_as_their_forces_and_the_largest_is_the_longest() -> None:
    """Shaft and head as one path, whose points stay as many; over all frames to one scale."""
    found = view()
    paths = arrows(ET.fromstring(found.svg))
    assert len(paths) == 3
    k = 0
    for panel, motion in enumerate(found.motions):
        scale, axis = scaled(motion.gears, panel)
        for column, contact in enumerate(motion.gears.contacts):
            values = paths[k].find("{*}animate").get("values").split(";")
            k += 1
            assert paths[k - 1].get("d") == values[0]
            for frame, value in enumerate(values):
                points = np.array([float(v) for v in re.findall(r"-?[\d.]+", value)]).reshape(-1, 2)
                placed = motion.at(frame)
                length = motion.forces[frame, column] / motion.largest * LONGEST * motion.gears.extent
                x, y, fx, fy = motion.gears.force_on_b(contact, placed, float(length))
                start, end = (axis + scale * np.array([px, -py]) for px, py in ((x, y), (x + fx, y + fy)))
                assert points[0] == pytest.approx(start, abs=CLOSE)
                assert points[3] == pytest.approx(end, abs=CLOSE)
                assert points[1] == pytest.approx(points[5], abs=CLOSE)
                whole = np.hypot(*(end - start))
                assert np.hypot(*(points[3] - points[1])) == pytest.approx(min(9, 0.6 * whole), abs=CLOSE)
                assert (points[2] + points[4]) / 2 == pytest.approx(points[1], abs=CLOSE)
                across, along = points[4] - points[2], points[3] - points[1]
                assert across @ along == pytest.approx(0, abs=0.3)
                assert np.hypot(*across) == pytest.approx(0.76 * min(9, 0.6 * whole), abs=0.05)
    lengths = [np.hypot(fx, fy) for m in found.motions[:1] for f in range(3) for *_, fx, fy in m.arrows(f)]
    assert lengths == pytest.approx([0.5 * LONGEST * PAIR.extent, LONGEST * PAIR.extent, 0.0])


def test_the_page_and_the_animations_hold_the_same_places() -> None:
    found = view()
    root = ET.fromstring(found.svg)
    html = found.html or ""
    frames = json.loads(re.findall(r'<script type="application/json">(.*?)</script>', html)[0])
    assert [frame["caption"] for frame in frames] == ["t = 0 s", "t = 1 s", "t = 2 s"]
    assert 'min="0" max="2" value="0"' in html
    (still,) = re.findall(r"<svg.*?</svg>", html, re.DOTALL)
    assert "<animate" not in still, "its script moves it"
    assert still == GearView(found.name, found.motions, found.captions[:1]).svg
    moving = [e for e in root.iter("{http://www.w3.org/2000/svg}g") if e.get("class") == "wheel"]
    assert len(moving) == 6
    for k, wheel in enumerate(moving):
        (turn,) = (g for g in wheel if g.get("class") == "turn")
        spin = turn.find("{*}animateTransform")
        assert spin.get("dur") == "1.00s"  # three frames would take less
        assert [float(v) for v in spin.get("values").split(";")] == pytest.approx([f["wheels"][k][2] for f in frames], abs=0.01)
        shift = wheel.find("{*}animateTransform")
        places = [f["wheels"][k][:2] for f in frames]
        orbits = wheel.find("{*}title").text.startswith("planet")
        assert (shift is not None) == orbits
        if shift is not None:
            assert np.array([v.split() for v in shift.get("values").split(";")], float) == pytest.approx(
                np.array(places), abs=0.01
            )
        assert [float(v) for v in re.findall(r"-?[\d.]+", wheel.get("transform"))] == pytest.approx(places[0], abs=0.01)
    for k, path in enumerate(arrows(root)):
        ends = np.array([f["arrows"][k] for f in frames])
        drawn = [
            np.array(re.findall(r"-?[\d.]+", v), float).reshape(-1, 2) for v in path.find("{*}animate").get("values").split(";")
        ]
        assert ends == pytest.approx(np.array([[*points[0], *points[3]] for points in drawn]), abs=0.01)
    angles = np.degrees([m.at(f)[0].angle for m in found.motions for f in range(3)])
    assert [f["wheels"][0][2] for f in frames] == pytest.approx(-angles[:3], abs=1e-3)
    long = GearView("Long", [GearMotion("", PAIR, np.zeros(100), np.zeros(100), np.zeros((100, 0)))], ["x"] * 100)
    assert 'dur="8.00s"' in long.svg
    assert long.motions[0].arrows(5) == []


def test_an_animation_of_matplotlib_shows_them_too() -> None:
    found = view()
    animation = found.animate(interval=20.0)
    animation._draw_was_started = True  # nothing is lost where it is not
    update, figure = animation._func, animation._fig
    axes = figure.axes
    assert [ax.get_title() for ax in axes] == ["train.pair", "train.set"]
    for frame in (0, 2, 1):
        update(frame)
        assert figure._suptitle.get_text() == f"t = {frame} s"
        for ax, motion in zip(axes, found.motions, strict=True):
            places = motion.at(frame)
            polygons = [p for p in ax.patches if hasattr(p, "get_xy") and len(p.get_xy()) > 10]
            order = sorted(range(len(places)), key=lambda k, m=motion: not m.gears.wheels[k].ring)
            for k, polygon, mark in zip(order, polygons, ax.lines, strict=True):
                wheel, at = motion.gears.wheels[k], places[k]
                c, s = cos(at.angle), sin(at.angle)
                assert polygon.get_xy()[:-1] == pytest.approx(wheel.outline @ np.array([[c, s], [-s, c]]) + [at.x, at.y])
                assert (polygon.get_facecolor()[:3] == (1.0, 1.0, 1.0)) == wheel.ring  # a ring's inside is empty
                ends = np.array(mark.get_data()).T - [at.x, at.y]
                assert ends[:, 0] * s == pytest.approx(ends[:, 1] * c, abs=1e-12)
                assert (ends @ [c, s] > 0).all()
            drawn = [(text.get_position(), text.xy) for text in ax.texts]
            for ((x, y), end), (px, py, fx, fy) in zip(drawn, motion.arrows(frame), strict=True):
                assert (x, y, *end) == pytest.approx((px, py, px + fx, py + fy))
    for ax, motion in zip(axes, found.motions, strict=True):
        (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
        assert right - left == pytest.approx(high - low)
        assert (left + right) / 2 == pytest.approx(0.2 if motion.gears is PAIR else 0.0)
        assert high == -low
        assert right - left == pytest.approx(1.04 * (0.62 if motion.gears is PAIR else 2 * 0.245 * 1.1))
    rims = [p for p in axes[1].patches if hasattr(p, "get_radius")]
    assert [p.get_radius() for p in rims] == pytest.approx([1.1 * 0.245])
    plt.close("all")


@pytest.mark.parametrize(("interval", "fine"), [(1, True), (0.999, False), (1e6, True), (1.001e6, False)])
def test_intervals_of_an_animation(interval: float, fine: bool) -> None:
    alone = GearView("A", [GearMotion("", PAIR, np.zeros(1), np.zeros(1), np.zeros((1, 0)))], ["x"])
    if fine:
        alone.animate(interval)._draw_was_started = True
    else:
        with pytest.raises(ArgumentError, match=rf"interval is {interval}; expected milliseconds, from 1 to 1e6"):
            alone.animate(interval)
    plt.close("all")


def test_a_pair_that_orbits_has_room_for_its_whole_circle() -> None:
    around = GearSet(PAIR.wheels, PAIR.contacts, "a", "b", {"": (1.0, 0.5)})
    drawn = shapes(GearView("A", [GearMotion("", around, np.zeros(1), np.zeros(1), np.zeros((1, 0)))], ["x"]).svg)
    (second,) = (s for s in drawn if s.kind == "polygon" and s.title == "gear 2: 20")
    assert second.box[2] == pytest.approx(SIZE / 2 + (SIZE / 2 - EDGE) / 1.04, abs=0.5)
