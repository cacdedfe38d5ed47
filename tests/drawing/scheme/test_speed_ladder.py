"""Speed ladders: rails where Willis' equation puts them, speeds at the height of the scale, labels off each other."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gearlib.drawing.scheme.speed_ladder import EDGE, WIDTH, is_straight, ladders, ratio_of, speed_ladder
from gearlib.drawing.scheme.train import Symbol, Train
from gearlib.drawing.style import COLOURS
from gearlib.drawing.svg import Picture
from tests.drawing.shapes import CLOSE, Shape, shapes

RPM = 30 / np.pi
PORTS = ("sun", "carrier", "ring")


def one(name: str, shafts: tuple[int, int, int], ratio: float, double: bool = False) -> Symbol:
    return Symbol(name, "double_planetary" if double else "planetary", "planetary", shafts, PORTS, (1.0, ratio))


@example([0, 1, 2], 2.0, 3.0, False, False)
@given(st.permutations(range(3)), st.floats(1.2, 5.0), st.floats(1.2, 5.0), st.booleans(), st.booleans())
def test_speeds_of_all_members_are_on_one_line(places: list[int], i_1: float, i_2: float, first: bool, second: bool) -> None:
    """Two sets with any two common shafts: speeds that satisfy Willis' equation of both are linear over the rails."""
    common = (0, 1, 3)
    sets = (one("a", (0, 1, 2), i_1, first), one("b", tuple(common[p] for p in places), i_2, second))
    (ladder,) = ladders(Train("", "", sets, 4))
    at = ladder.rails
    assert (at[0], at[2]) == (0.0, 1.0)
    assert [s.name for s in ladder.sets] == ["a", "b"]
    speeds = {shaft: 7.0 - 3.0 * place for shaft, place in at.items()}
    for symbol in sets:
        sun, carrier, ring = (speeds[s] for s in symbol.shafts)
        i = ratio_of(symbol)
        assert (sun - carrier) == pytest.approx(-i * (ring - carrier), abs=1e-9 * (1 + max(map(abs, at.values()))))
        assert is_straight(symbol, speeds)
        assert not is_straight(symbol, speeds | {symbol.shafts[0]: sun + 1e-4 * max(map(abs, speeds.values())) * (1 + abs(i))})
        assert is_straight(symbol, {symbol.shafts[0]: 1.0})


def test_sets_with_one_common_shaft_have_ladders_of_their_own() -> None:
    found = ladders(Train("", "", (one("a", (0, 1, 2), 2.0), one("b", (0, 3, 4), 2.0), one("c", (1, 2, 5), 2.0)), 6))
    assert [[s.name for s in ladder.sets] for ladder in found] == [["a", "c"], ["b"]]


SETS = (one("front", (0, 1, 2), 2.0), one("rear", (0, 3, 1), 2.0), one("last", (4, 5, 6), 3.0))
TRAIN = Train("box", "Box", SETS, 7)
LINE = {0: 0.0, 1: 2 / 3, 2: 1.0, 3: 4 / 9}


def motion(low: float, high: float) -> dict[tuple[str, str], float]:
    """Speeds (rad/s) with the first set's sun at the one and its ring at the other."""
    first = {
        (s.name, port): low + (high - low) * LINE[shaft] for s in SETS[:2] for port, shaft in zip(PORTS, s.shafts, strict=True)
    }
    return first | {("last", "sun"): low, ("last", "carrier"): low / 4 + high * 3 / 4, ("last", "ring"): high}


def scale(drawn: list[Shape]) -> tuple[float, float, list[tuple[float, Shape]]]:
    """Height of 0, pixels per 1/min, and the ticks."""
    lines = {round(float(s.middle[1]), 1): s for s in drawn if s.kind == "line" and s.points[0][1] == s.points[1][1]}
    ticks = []
    for s in drawn:
        if s.kind == "text" and s.attributes.get("text-anchor") == "end":
            line = lines[min(lines, key=lambda y, s=s: abs(y - s.points[0][1]))]
            assert s.points[0][1] - 0.36 * s.size == pytest.approx(line.middle[1], abs=0.6)
            assert s.points[0][0] < line.points[0][0]
            ticks.append((float(s.text), line))
    values, heights = np.array([v for v, _ in ticks]), np.array([line.middle[1] for _, line in ticks])
    slope, zero = np.polyfit(values, heights, 1)
    assert heights == pytest.approx(zero + slope * values, abs=2 * CLOSE)
    return float(zero), float(-slope), ticks


@pytest.mark.parametrize(("low", "high"), [(0.0, 100.0), (30.0, -12.0), (-5.0, -900.0), (1e-3, 2e-3), (0.0, 0.0), (40.0, 40.0)])
def test_speeds_stand_at_the_height_of_the_scale(low: float, high: float) -> None:
    drawn = shapes(speed_ladder(TRAIN, {"": motion(low, high)}).svg)
    zero, per, ticks = scale(drawn)
    values = [v for v, _ in ticks]
    steps = np.diff(values)
    assert np.ptp(steps) < 1e-6 * abs(steps[0])
    assert f"{steps[0]:.0e}"[0] in "125"
    span = max(0.0, low * RPM, high * RPM) - min(0.0, low * RPM, high * RPM) or 2.0
    assert 3 <= len(values) <= 8
    assert span / 6 <= steps[0] * (1 + 1e-9) <= span / 2
    assert 0.0 in values
    assert [s.attributes["stroke"] for v, s in ticks].count("#1b2a41") == 1  # the line of rest
    assert next(s for v, s in ticks if v == 0).attributes["stroke"] == "#1b2a41"
    points = sorted(((float(s.middle[0]), float(s.middle[1])) for s in drawn if s.kind == "circle"), key=lambda p: p[0])
    expected = [low + (high - low) * share for share in (0, 4 / 9, 2 / 3, 1)] + [low, low / 4 + high * 3 / 4, high]
    assert [(zero - y) / per for _, y in points] == pytest.approx([w * RPM for w in expected], abs=0.1 / per)
    left = points[0][0]
    assert [(x - left) / WIDTH for x, _ in points[:4]] == pytest.approx([0, 4 / 9, 2 / 3, 1], abs=1e-3)
    assert points[4][0] - points[3][0] > 60
    assert [(x - points[4][0]) / WIDTH for x, _ in points[4:]] == pytest.approx([0, 0.75, 1], abs=1e-3)
    said = [s for s in drawn if s.attributes.get("fill") == COLOURS[0] and s.kind == "text"]
    assert sorted(s.text for s in said) == sorted(f"{w * RPM:.5g}" for w in expected)
    for s in said:
        (near,) = (p for p in points if abs(s.points[0][0] - 6 - p[0]) < CLOSE and abs(s.points[0][1] + 6 - p[1]) < CLOSE)
        assert float(s.text) == pytest.approx((zero - near[1]) / per, abs=0.1 / per)
    lines = [s for s in drawn if s.kind == "path"]
    assert np.vstack([s.points for s in lines]) == pytest.approx(np.array(points), abs=CLOSE)


def test_rails_lead_from_their_names_to_the_lowest_speed() -> None:
    """Names in rows above, in the order of the rails, off each other; the sets' names above them."""
    picture = speed_ladder(TRAIN, {"": motion(-10.0, 100.0)})
    drawn = shapes(picture.svg)
    zero, per, _ = scale(drawn)
    rails = [s for s in drawn if s.kind == "line" and s.points[0][0] == s.points[1][0]]
    names = [s for s in drawn if s.kind == "text" and s.text.split(".")[-1].split(" = ")[0] in PORTS]
    assert sorted(s.text for s in names) == sorted(
        ["front.sun = rear.sun", "front.carrier = rear.ring", "front.ring", "rear.carrier", "sun", "carrier", "ring"]
    )
    for rail in rails:
        assert rail.points[1][1] == pytest.approx(zero + 10 * RPM * per, abs=0.1)
        (name,) = (s for s in names if abs(s.points[0][0] - rail.points[0][0]) < CLOSE)
        assert name.attributes["text-anchor"] == "middle"
        assert 1 <= rail.points[0][1] - name.points[0][1] <= 5
    assert len(rails) == len(names)
    for a, b in itertools.combinations(names, 2):
        (x1, y1, x2, y2), (x3, y3, x4, y4) = a.box, b.box
        assert x2 < x3 or x4 < x1 or y2 <= y3 or y4 <= y1, (a.text, b.text)
    rows = sorted({float(s.points[0][1]) for s in names})
    assert len(rows) >= 2
    assert np.ptp(np.diff(rows)) < CLOSE
    top = zero - 100 * RPM * per
    assert rows[-1] < top - 5
    first = {s.text: float(s.points[0][1]) for s in names}
    assert first["front.sun = rear.sun"] == rows[0]
    assert len({first[name] for name in PORTS}) == 1  # those of a single set have room in one row
    for words, of in (("front, rear", "front.ring"), ("last", "carrier")):
        (heading,) = (s for s in drawn if s.text == words)
        assert heading.box[3] <= rows[0] - 5
        left = next(s for s in names if s.text == ("front.sun = rear.sun" if of == "front.ring" else "sun")).points[0][0]
        assert heading.points[0][0] == pytest.approx(left + WIDTH / 2, abs=CLOSE)
    inside_the_page(picture)


@pytest.mark.parametrize("length", range(1, 22, 2))
def test_labels_share_a_row_where_they_are_ten_pixels_apart(length: int) -> None:
    """Each stands in the first row in which it has room behind the one on its left."""
    sets = (one("a" * length, (0, 1, 2), 2.0), one("b" * length, (0, 3, 1), 2.0))
    drawn = shapes(speed_ladder(Train("box", "Box", sets, 4), {}).svg)
    names = sorted((s for s in drawn if s.kind == "text" and s.text.endswith(PORTS)), key=lambda s: s.points[0][0])
    assert len(names) == 4
    levels = sorted({float(s.points[0][1]) for s in names})
    ends = dict.fromkeys(levels, -np.inf)
    for s in names:
        free = [y for y in levels if s.box[0] - ends[y] > 10]
        assert float(s.points[0][1]) == free[0]
        ends[free[0]] = s.box[2]


def inside_the_page(picture: Picture) -> None:
    page, *content = shapes(picture.svg)
    for s in content:
        assert s.box[0] >= EDGE - 10
        assert s.box[2] <= page.box[2]
        assert s.box[3] <= page.box[3] - 4


def test_motions_are_told_by_colour_and_a_list_below() -> None:
    names = [f"gear {k}" for k in range(3)]
    picture = speed_ladder(TRAIN, {name: motion(10.0 * k, 100.0) for k, name in enumerate(names)})
    drawn = shapes(picture.svg)
    zero, per, _ = scale(drawn)
    keys = [next(s for s in drawn if s.text == name) for name in names]
    assert np.ptp(np.diff([float(s.points[0][1]) for s in keys])) < CLOSE
    assert keys[0].box[1] > zero
    for k, key in enumerate(keys):
        stroke = min((s for s in drawn if s.kind == "line" and s.attributes["stroke"] == COLOURS[k]), key=lambda s: s.middle[0])
        assert stroke.middle[1] == pytest.approx(key.points[0][1] - 0.36 * key.size, abs=0.5)
        assert 0 < key.box[0] - stroke.box[2] < 12
        own = [s for s in drawn if s.kind == "path" and s.title == names[k]]
        assert {s.attributes["stroke"] for s in own} == {COLOURS[k]}
        assert len(own) == 2
        assert (zero - own[0].points[0][1]) / per == pytest.approx(10.0 * k * RPM, abs=0.1 / per)
    assert not [s for s in drawn if s.text == f"{100 * RPM:.5g}"]  # numbers beside the points of a single motion only
    inside_the_page(picture)


def test_what_is_bent_or_unknown_is_said_or_left_out() -> None:
    bent = motion(0.0, 100.0) | {("last", "ring"): 90.0}
    drawn = shapes(speed_ladder(TRAIN, {"": bent}).svg)
    (said,) = (s for s in drawn if s.text.startswith("not straight"))
    zero = scale(drawn)[0]
    middle = [s for s in drawn if s.kind == "circle"][5:]
    assert min(s.middle[0] for s in middle) - WIDTH < said.points[0][0] < max(s.middle[0] for s in middle)
    assert said.box[1] > zero
    little = {key: value for key, value in motion(0.0, 100.0).items() if key[0] != "last" or key[1] == "sun"}
    drawn = shapes(speed_ladder(TRAIN, {"": little}).svg)
    assert len([s for s in drawn if s.kind == "circle"]) == 4  # one speed alone is no line
    assert not [s for s in drawn if s.text.startswith("not straight")]
