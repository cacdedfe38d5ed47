"""Where bands begin and end in Sankey diagrams, and what stands beside them."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

from gearlib.drawing.sankey import BACK, BAND, BAR, EDGE, LOSS, WIDEST, Band, sankey, watts
from tests.drawing.shapes import CLOSE, Shape, shapes

FLOWS = [
    Band("drive", "gear", 1000.0),
    Band("gear", "shaft 1", 950.0),
    Band("shaft 1", "load", 600.0),
    Band("shaft 1", "pump", 150.0),
    Band("drive", "fan", 40.0),
    Band("shaft 1", "gear", 200.0),
    Band("fan", "load", 30.0),
]
LOSSES = {"gear": 250.0, "fan": 10.0}
NAMES = ("drive", "gear", "shaft 1", "load", "pump", "fan")


@pytest.fixture(scope="module")
def drawn() -> list[Shape]:
    return shapes(sankey(FLOWS, LOSSES, "Power of a train", ("shaft 1",)).svg)


@pytest.fixture(scope="module")
def bars(drawn: list[Shape]) -> dict[str, Shape]:
    """By name: each is the bar at which its widest band begins or ends."""
    rects = [s for s in drawn[1:] if s.kind == "rect"]
    assert len(rects) == len(NAMES)
    order = list(dict.fromkeys(name for f in FLOWS for name in (f.source, f.target)))
    return {name: rects[order.index(name)] for name in NAMES}


def bands(drawn: list[Shape], colour: str) -> list[tuple[Band, float, np.ndarray]]:
    """Flow, width and corners of each band."""
    found = []
    for s in drawn:
        if s.attributes.get("stroke") == colour:
            source, target = re.match(r"(.*) → (.*):", s.title).groups()
            flow = next(f for f in FLOWS if (f.source, f.target) == (source, target))
            assert s.title == f"{source} → {target}: {watts(flow.power)}"
            found.append((flow, float(s.attributes["stroke-width"]), s.points))
    return found


def test_bands_fill_the_bars_side_by_side(drawn: list[Shape], bars: dict[str, Shape]) -> None:
    """From the right edge of the one bar to the left edge of the other, packed without gaps from the top."""
    found = [*bands(drawn, BAND), *bands(drawn, BACK)]
    assert len(found) == len(FLOWS)
    assert {flow.target for flow, *_ in bands(drawn, BACK)} == {"gear"}
    scale = WIDEST / 1000.0
    ends: dict[tuple[str, int], list[tuple[float, float]]] = {}
    for flow, width, points in found:
        assert width == pytest.approx(flow.power * scale, abs=0.006)
        a, b = bars[flow.source], bars[flow.target]
        assert points[0][0] == pytest.approx(a.box[2], abs=CLOSE)
        assert points[-1][0] == pytest.approx(b.box[0], abs=CLOSE)
        ends.setdefault((flow.source, 1), []).append((points[0][1] - width / 2, points[0][1] + width / 2))
        ends.setdefault((flow.target, 0), []).append((points[-1][1] - width / 2, points[-1][1] + width / 2))
    for (name, _), spans in ends.items():
        spans = sorted(spans)
        assert spans[0][0] == pytest.approx(bars[name].box[1], abs=CLOSE)
        assert all(b[0] == pytest.approx(a[1], abs=CLOSE) for a, b in itertools.pairwise(spans))
    for name, bar in bars.items():
        through = [sum(f.power for f in FLOWS if getattr(f, side) == name) * scale for side in ("source", "target")]
        assert bar.box[3] - bar.box[1] == pytest.approx(max(through), abs=CLOSE)
        assert bar.box[2] - bar.box[0] == pytest.approx(BAR)


def test_columns_follow_the_flow_at_equal_distances(bars: dict[str, Shape]) -> None:
    columns = [{"drive"}, {"gear", "fan"}, {"shaft 1"}, {"load", "pump"}]
    x = [{round(bars[name].box[0], 2) for name in names} for names in columns]
    assert all(len(found) == 1 for found in x)
    steps = np.diff([found.pop() for found in x])
    assert steps == pytest.approx(np.full(3, steps[0]), abs=CLOSE)
    assert steps[0] > 60
    for a, b in itertools.combinations(bars.values(), 2):
        assert a.box[0] != b.box[0] or a.box[3] + 20 < b.box[1] or b.box[3] + 20 < a.box[1]


def test_a_band_that_passes_a_column_is_level_there(drawn: list[Shape], bars: dict[str, Shape]) -> None:
    """Curves leave and arrive level: the inner points of each piece have the heights of its ends, in its middle."""
    for flow, _, points in bands(drawn, BAND):
        pieces = [points[k : k + 4] for k in range(0, len(points) - 1, 3)]
        assert len(pieces) == {("fan", "load"): 2}.get((flow.source, flow.target), 1)
        for piece in pieces:
            assert piece[1] == pytest.approx([(piece[0][0] + piece[3][0]) / 2, piece[0][1]], abs=CLOSE)
            assert piece[2] == pytest.approx([(piece[0][0] + piece[3][0]) / 2, piece[3][1]], abs=CLOSE)
        for joint in points[3:-1:3]:
            assert joint[0] == pytest.approx(bars["shaft 1"].box[0], abs=CLOSE)


def test_returning_power_passes_below_everything(drawn: list[Shape], bars: dict[str, Shape]) -> None:
    ((_, width, points),) = bands(drawn, BACK)
    lowest = max(s.box[3] for s in drawn[1:] if s.kind in ("rect", "polygon") or s.attributes.get("stroke") == BAND)
    assert points[2][1] == points[3][1] > lowest + width / 2
    assert points[0][1] == points[1][1]
    assert points[4][1] == points[5][1]
    assert points[1][0] == points[2][0] >= points[0][0] + width / 2 + 8
    assert points[3][0] == points[4][0]
    assert points[4][0] - points[5][0] == pytest.approx(points[0][0] - points[1][0], abs=CLOSE)
    (said,) = (s for s in drawn if s.text.endswith("flows back"))
    assert said.text == "200 W flows back"
    assert said.points[0][0] == pytest.approx((points[0][0] + points[5][0]) / 2, abs=CLOSE)
    assert said.points[0][1] - 0.36 * said.size == pytest.approx(points[2][1], abs=0.5)


def test_names_stand_above_their_bars_and_losses_below(drawn: list[Shape], bars: dict[str, Shape]) -> None:
    said = {s.text: s for s in drawn if s.kind == "text"}
    assert "shaft 1" not in said
    for name in set(NAMES) - {"shaft 1"}:
        assert said[name].points[0][0] == pytest.approx(bars[name].middle[0], abs=CLOSE)
        assert 2 <= bars[name].box[1] - said[name].points[0][1] < 10
    triangles = [s for s in drawn if s.attributes.get("fill") == LOSS and s.kind == "polygon"]
    assert len(triangles) == len(LOSSES)
    for triangle, (name, loss) in zip(triangles, LOSSES.items(), strict=True):
        base, tip = triangle.points[:2], triangle.points[2]
        assert base.mean(axis=0) == pytest.approx([bars[name].middle[0], bars[name].box[3]], abs=CLOSE)
        wide = max(loss * WIDEST / 1000.0, 1.0)
        assert base[1][0] - base[0][0] == pytest.approx(wide, abs=CLOSE)
        assert tip == pytest.approx([bars[name].middle[0], bars[name].box[3] + 10 + wide / 2], abs=CLOSE)
        text = said[f"loss {watts(loss)}"]
        assert text.points[0][0] > bars[name].box[2]
        assert bars[name].box[3] < text.box[1] < text.box[3] < tip[1] + 10
    for flow, width, points in bands(drawn, BAND):
        (label,) = (s for s in drawn if s.text == watts(flow.power) and flow.source in s.title and flow.target in s.title)
        end = points[3]
        middle = (points[0] + end) / 2
        assert label.points[0][0] == pytest.approx(middle[0], abs=CLOSE)
        if width > 14:  # within the band, otherwise above it
            assert label.points[0][1] - 0.36 * label.size == pytest.approx(middle[1], abs=0.5)
        else:
            assert middle[1] - width / 2 - 8 < label.box[3] < middle[1] - width / 2


def test_the_page_holds_it_all(drawn: list[Shape]) -> None:
    page = drawn[0]
    for shape in drawn[1:]:
        assert min(shape.box[:2]) >= 0
        assert shape.box[2] <= page.box[2]
        assert shape.box[3] <= page.box[3] - 8
    (title,) = (s for s in drawn if s.text == "Power of a train")
    assert title.points[0] == pytest.approx([EDGE, EDGE])
    left = min(s.box[0] for s in drawn[1:] if s.kind == "rect" or s.text == "drive")
    right = max(s.box[2] for s in drawn[1:] if s.kind == "rect" or s.text == "load")
    assert left >= EDGE - 8
    assert page.box[2] - right >= EDGE - 8
    long = shapes(sankey(FLOWS[:1], {}, "A title that is much longer than the picture of its two bars would be wide").svg)
    assert long[-1].box[2] < long[0].box[2]
    nothing = shapes(sankey([], {}, "nothing").svg)
    assert [s.text for s in nothing[1:]] == ["nothing"]


@pytest.mark.parametrize(
    ("power", "text"),
    [
        (999.4, "999 W"),
        (999.6, "1 kW"),
        (-2500.0, "-2.5 kW"),
        (999.4e3, "999 kW"),
        (999.6e3, "1 MW"),
        (0.0, "0 W"),
        (0.0123, "0.0123 W"),
    ],
)
def test_powers_have_three_digits(power: float, text: str) -> None:
    assert watts(power) == text
