"""Symbols of stick diagrams: gears meet at their pitch point, planets between sun and ring, plates and walls stand on their shafts."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.scheme.axes import Axes
from gearlib.drawing.scheme.routing import Place, Routing
from gearlib.drawing.scheme.shown_motion import BACK, FORWARD, RIM, SWEPT, SWING, ShownMotion
from gearlib.drawing.scheme.shown_power import POWER
from gearlib.drawing.scheme.shown_results import places_of_numbers
from gearlib.drawing.scheme.stick_diagram import EDGE, Scheme, placed_names
from gearlib.drawing.scheme.train import Symbol
from tests.drawing.scheme.test_stick_diagram import Gear, scheme_of
from tests.drawing.shapes import CLOSE, Shape, shapes


class Mixed(gl.Component):
    """A pair inside a ring, a pair whose ratio alone is known, one of no reversal, a coupling, a load that is a box."""

    def assemble(self) -> list[Any]:
        self.motor, self.machine, self.wall = gp.Torque(tau=1.0), gp.Inertia(J=1.0), gp.Fixed()
        self.ring = gp.InternalMesh(r_a=0.09, r_b=0.03, c=1e8, d=0.0)
        self.pair, self.chain = gp.IdealGear(ratio=-2.0), gp.IdealGear(ratio=1.5)
        self.clutch, self.coupling = gp.Clutch(fn_max=1.0, f_normalized=1.0), gp.SpringDamper(c=1.0, d=1.0)
        return [
            gl.connect(self.motor.flange, self.ring.flange_a),
            gl.connect(self.ring.flange_b, self.pair.flange_a),
            gl.connect(self.pair.flange_b, self.chain.flange_a),
            gl.connect(self.chain.flange_b, self.clutch.flange_a),
            gl.connect(self.clutch.flange_b, self.machine.flange_a, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.wall.flange),
        ]


@pytest.fixture(scope="module", params=["two stages", "ravigneaux", "mixed", "xp"])
def scheme(request: pytest.FixtureRequest) -> Scheme:
    return Mixed().scheme() if request.param == "mixed" else scheme_of(request.param)


def moved(scheme: Scheme) -> tuple[list[Shape], np.ndarray]:
    """What is drawn, and where the drawing's origin is."""
    found = shapes(scheme.svg)
    axis = next(s for s in found if s.attributes.get("stroke-dasharray") == "12 3 2 3")
    return found, np.array([axis.points[0][0] - float(axis.attributes["x1"]), axis.points[0][1] - scheme.axes.height[0]])


def parts(scheme: Scheme, *kinds: str) -> list[tuple[Any, np.ndarray, list[float], list[Shape]]]:
    """Of each symbol: itself, its place, the heights of its shafts' axes, and what is drawn of it, about the drawing's origin."""
    found, origin = moved(scheme)
    own = [Shape(s.kind, s.points - origin, s.radius, s.text, s.title, s.attributes) for s in found]
    return [
        (symbol, np.array([place.x, place.y]), [scheme.axes.height[scheme.axes.of[s]] for s in symbol.shafts],
         [s for s in own if s.title.split("\n")[0] == symbol.name])
        for symbol, place in zip(scheme.axes.symbols, scheme.routing.places, strict=True) if symbol.kind in kinds
    ]  # fmt: skip


def level(shape: Shape) -> bool:
    return shape.kind == "line" and abs(shape.points[0][1] - shape.points[1][1]) < CLOSE


def test_gears_meet_at_the_pitch_point(scheme: Scheme) -> None:
    """Bars at the teeth, as far from the axis as the radius says, all of one length; a web from bar to bar."""
    for symbol, place, base, drawn in parts(scheme, "external", "internal"):
        bars, webs = [s for s in drawn if level(s)], [s for s in drawn if not level(s)]
        rings = [s for s in bars if symbol.kind == "internal" and abs(s.middle[0] - place[0]) > CLOSE]
        wheels = [s for s in bars if s not in rings]
        assert all(s.middle[0] == pytest.approx(place[0], abs=CLOSE) for s in wheels)
        assert np.ptp([np.ptp(s.points[:, 0]) for s in wheels]) < CLOSE
        sense = np.sign(base[1] - base[0]) * (1 if symbol.kind == "external" else np.sign(symbol.radii[0] - symbol.radii[1]))
        pitch = base[0] + sense * symbol.radii[0]
        assert abs(pitch - base[1]) == pytest.approx(symbol.radii[1], abs=CLOSE)
        edges = sorted((base[k] + side * symbol.radii[k] for k in (0, 1) for side in (-1, 1)), key=lambda y: abs(y - pitch))
        heights = sorted((float(s.middle[1]) for s in bars), key=lambda y: abs(y - pitch))
        assert heights[2:] == pytest.approx(edges[2:], abs=CLOSE)
        gaps = [abs(y - pitch) for y in heights[:2]]
        if symbol.kind == "external":
            assert (heights[0] - pitch) * (heights[1] - pitch) < 0  # on both sides of the pitch point
            assert gaps == pytest.approx([gaps[0]] * 2, abs=CLOSE)
            assert 1 <= gaps[0] <= 2
        else:
            assert sorted(gaps)[0] == pytest.approx(0, abs=CLOSE)
            assert 1 <= sorted(gaps)[1] <= 2
        for web in webs:
            assert abs(web.points[0][0] - web.points[1][0]) < CLOSE
            assert all(min(bar.distance(end) for bar in bars) < CLOSE for end in web.points)
        if rings:  # its shaft is led to the web beside the wheel
            (beside,) = {round(float(web.points[0][0]), 6) for web in webs if abs(web.points[0][0] - place[0]) > CLOSE}
            number, points = scheme.axes.symbols.index(symbol), scheme.routing.spines[symbol.shafts[0]][1]
            assert [x for i, k, x in points if (i, k) == (number, 0)] == pytest.approx([beside], abs=CLOSE)
        for edge in rings:  # from above the wheel to the web beside it
            assert min(web.distance(end) for web in webs for end in edge.points) < CLOSE
            assert edge.box[0] <= place[0] - 6 or edge.box[2] >= place[0] + 6


def test_planets_stand_between_sun_and_ring(scheme: Scheme) -> None:
    for symbol, place, base, drawn in parts(scheme, "planetary", "double_planetary"):
        sun, ring = symbol.radii
        pins = sorted((s for s in drawn if s.kind == "circle"), key=lambda s: s.middle[0])
        assert len(pins) == (1 if symbol.kind == "planetary" else 2)
        outer = [s for s in drawn if s.attributes["stroke"] == "#1b2a41" and level(s)]
        assert sorted(float(base[0] - s.middle[1]) for s in outer) == pytest.approx([sun, ring], abs=CLOSE)
        assert all(s.middle[0] == pytest.approx(place[0], abs=CLOSE) for s in outer)
        assert [s.middle[0] - place[0] for s in pins] == pytest.approx(
            [place[0] - s.middle[0] for s in reversed(pins)], abs=CLOSE
        )
        bodies = [s for s in drawn if s.kind == "line" and s not in outer and not level(s)]
        bars = [s for s in drawn if s.kind == "line" and s not in outer and level(s)]
        for pin, body in zip(pins, sorted(bodies, key=lambda s: s.middle[0]), strict=True):
            assert body.middle == pytest.approx(pin.middle, abs=CLOSE)
            own = [s for s in bars if s.middle[0] == pytest.approx(pin.middle[0], abs=CLOSE)]
            assert sorted(s.middle[1] for s in own) == pytest.approx(sorted(body.points[:, 1]), abs=CLOSE)
        reach = [base[0] - s.points[:, 1] for s in bodies]
        assert min(r.min() for r in reach) - sun == pytest.approx(ring - max(r.max() for r in reach), abs=CLOSE)
        assert 1 <= ring - max(r.max() for r in reach) <= 3
        if len(bodies) == 2:  # they mesh with each other: the lower one reaches above the other's lower edge
            low, high = sorted(reach, key=lambda r: r.min())
            assert 0 < low.max() - high.min() < min(np.ptp(low), np.ptp(high))
            assert low.min() + high.max() == pytest.approx(sun + ring, abs=CLOSE)
            assert np.ptp(low) == pytest.approx(np.ptp(high), abs=CLOSE)
            assert symbol.radii[0] < low.min() < high.max() < symbol.radii[1]


def test_what_is_held_stands_on_a_hatched_wall(scheme: Scheme) -> None:
    for symbol, place, base, drawn in parts(scheme, "held"):
        (wall,) = (s for s in drawn if s.attributes.get("stroke-width") == "2")
        assert wall.middle == pytest.approx(place, abs=CLOSE)
        strokes = [s for s in drawn if s.attributes.get("stroke-width") == "1"]
        starts, ends = (np.array([s.points[k] for s in strokes]) for k in (0, 1))
        assert starts[:, 1] == pytest.approx(np.full(len(starts), place[1]), abs=CLOSE)
        assert starts[0][0] == pytest.approx(wall.box[0], abs=CLOSE)
        assert np.ptp(np.diff(starts[:, 0])) < CLOSE
        assert np.ptp(ends - starts, axis=0) == pytest.approx([0, 0], abs=CLOSE)
        assert abs(ends[-1][0] - wall.box[2]) <= 1  # as wide as the wall
        away = np.sign(ends[0][1] - place[1])
        assert away == (1 if place[1] > base[0] else -1)  # away from the shaft
        plates = [s for s in drawn if s.attributes.get("stroke") == "#c0392b"]
        assert len(plates) == (2 if symbol.icon == "brake" else 0)
        for plate in plates:
            assert plate.middle[0] == pytest.approx(place[0], abs=CLOSE)
            assert (plate.middle[1] - place[1]) * away < 0
        if plates:
            (body,) = (s for s in drawn if s.kind == "rect")
            assert body.middle[0] == pytest.approx(place[0], abs=CLOSE)
            near, far = sorted((float(s.middle[1]) for s in plates), key=lambda y: abs(y - place[1]))
            end = max(body.points[:, 1], key=lambda y: abs(y - place[1]))
            assert min(body.points[:, 1], key=lambda y: abs(y - place[1])) == pytest.approx(place[1], abs=CLOSE)
            stems = [
                sorted(s.points[:, 1].tolist()) for s in drawn if s.kind == "line" and s.attributes["stroke-width"] == "1.8"
            ]
            expected = sorted([sorted([place[1], near]), sorted([far, end])])
            assert np.array(sorted(stems)) == pytest.approx(np.array(expected), abs=CLOSE)


def test_couplings_stand_in_their_shafts(scheme: Scheme) -> None:
    for symbol, place, _, drawn in parts(scheme, "inline"):
        corners = np.vstack([s.points for s in drawn]) - place
        assert (corners[:, 0].min(), corners[:, 0].max()) == pytest.approx((-24, 24), abs=CLOSE)
        if symbol.icon in ("clutch", "ratio", "box"):
            assert corners[:, 1].min() == pytest.approx(-corners[:, 1].max(), abs=CLOSE)
        if symbol.icon == "clutch":
            plates = sorted((s for s in drawn if s.attributes["stroke"] == "#c0392b"), key=lambda s: s.middle[0])
            for plate, shaft in zip(plates, sorted((s for s in drawn if level(s)), key=lambda s: s.middle[0]), strict=True):
                assert min(np.hypot(*(plate.middle - end)) for end in shaft.points) < CLOSE
            assert np.sum([s.middle - place for s in plates], axis=0) == pytest.approx([0, 0], abs=CLOSE)
        if symbol.icon == "ratio":
            (body,), (stroke,) = ([s for s in drawn if s.kind == kind] for kind in ("rect", "line"))
            assert {tuple(p.round(1)) for p in stroke.points} <= {tuple(p.round(1)) for p in body.points}


def test_drives_and_loads_stand_at_the_end_of_their_shafts(scheme: Scheme) -> None:
    """Their shaft ends at the place, they lie beyond it, and their name is centred below or above."""
    found, origin = moved(scheme)
    for symbol, place, _, drawn in parts(scheme, "end"):
        left, upper, right, lower = (f(s.box[k] for s in drawn) for k, f in enumerate((min, min, max, max)))
        away = 1 if right > place[0] + 1 else -1
        beyond = 0.0 if symbol.icon != "port" else -4.0 * away  # a port's circle is about the end
        assert (left if away > 0 else right) == pytest.approx(place[0] + beyond, abs=CLOSE)
        (name,) = (s for s in found if s.text == symbol.label)
        if symbol.icon != "port":
            assert name.points[0][0] - origin[0] == pytest.approx(place[0] + 24 * away, abs=CLOSE)
            assert name.box[1] - origin[1] > lower or name.box[3] - origin[1] < upper


def test_the_drawing_lies_within_its_margins(scheme: Scheme) -> None:
    """Nothing is cut off, axes reach from margin to margin, and no name lies on a symbol."""
    found, _ = moved(scheme)
    page, content = found[0], found[1:]
    width, height = page.points[2]
    boxes = np.array([s.box for s in content])
    assert boxes[:, :2].min() > EDGE - 6
    assert boxes[:, 2].max() < width - EDGE + 6
    assert boxes[:, 3].max() < height - EDGE + 6
    for axis in (s for s in content if s.attributes.get("stroke-dasharray") == "12 3 2 3"):
        assert axis.points[:, 0] == pytest.approx([EDGE, width - EDGE], abs=CLOSE)
    names = [s for s in content if s.attributes.get("paint-order")]
    assert len(names) == sum(bool(s.label) for s in scheme.axes.symbols)
    for name, other in itertools.product(names, (s for s in content if s.title and s.kind != "text")):
        (a, b, c, d), (e, f, g, h) = name.box, other.box
        assert c <= e or g <= a or d <= f or h <= b, (name.text, other.title)


def test_names_lead_away_from_their_parts(scheme: Scheme) -> None:
    """Wherever there may be room for one: it begins on the right of its part, ends on the left, or has its middle above or below."""
    named = [
        (symbol, place)
        for symbol, place in zip(scheme.axes.symbols, scheme.routing.places, strict=True)
        if symbol.label and symbol.kind != "end"
    ]
    labels = {label.words: label for label, _ in placed_names(scheme.axes, scheme.routing)}
    assert {symbol.label for symbol, _ in named} <= set(labels)
    for symbol, place in named:
        spots = labels[symbol.label].places
        assert len(set(spots)) == len(spots) >= 3
        for x, _, anchor in spots:
            assert np.sign(x - place.x) == {"start": 1, "middle": 0, "end": -1}[anchor]
        sides = [abs(x - place.x) for x, _, anchor in spots if anchor == "end"]
        assert sides == sorted(sides), "the nearest first"


def test_names_stand_beside_the_teeth() -> None:
    """Letters centred on the pitch point, as near on the one side as on the other."""
    scheme = scheme_of("two stages")
    found, origin = moved(scheme)
    for symbol, place, base, _ in parts(scheme, "external"):
        (name,) = (s for s in found if s.text == symbol.label)
        x, y = name.points[0] - origin
        sense = 1 if base[1] > base[0] else -1
        assert y - 0.36 * name.size == pytest.approx(base[0] + sense * symbol.radii[0], abs=0.3)
        assert 5 < x - place[0] < 20


@pytest.fixture(scope="module")
def flow() -> gl.PowerFlow:
    return gl.compile(Gear()).power_flow(speeds={"engine.flange": 200.0}, torques={"load.tau": -100.0})


def test_bands_are_as_wide_as_the_power_and_arrows_point_along_it(flow: gl.PowerFlow) -> None:
    """On each shaft, between each two parts: what those on the left have given it."""
    scheme = flow.scheme()
    found, origin = moved(scheme)
    bands = [s for s in found if s.attributes.get("stroke") == POWER]
    heads = [s for s in found if s.kind == "polygon" and s.attributes.get("fill") == POWER]
    expected = []
    for y, points in scheme.routing.spines.values():
        passing = 0.0
        for (i, k, x1), (_, _, x2) in itertools.pairwise(points):
            passing -= flow[f"{scheme.train.symbols[i].name}.{scheme.train.symbols[i].ports[k]}"].power
            if abs(passing) > 1e-3 * flow.largest and x2 - x1 > 1:
                expected.append((x1, x2, y, passing / flow.largest) if passing > 0 else (x2, x1, y, passing / flow.largest))
    assert len(bands) == len(expected) > 1
    widest = max(float(s.attributes["stroke-width"]) for s in bands)
    for band, (x1, x2, y, share) in zip(bands, expected, strict=True):
        assert (band.points - origin).ravel() == pytest.approx([x1, y, x2, y], abs=CLOSE)
        assert float(band.attributes["stroke-width"]) == pytest.approx(widest * abs(share), abs=0.01)
    long = [(e, b) for e, b in zip(expected, bands, strict=True) if abs(e[1] - e[0]) > 30]
    assert len(heads) == len(long) > 0
    for head, ((x1, x2, y, _), band) in zip(heads, long, strict=True):
        tip = head.points[1] - origin
        assert tip == pytest.approx([x2, y], abs=CLOSE)
        back = head.points[[0, 2]] - origin
        assert back.mean(axis=0)[1] == pytest.approx(y, abs=CLOSE)
        assert np.ptp(back[:, 0]) < CLOSE
        assert np.sign(x2 - x1) * (x2 - back[0][0]) > 5
        assert np.ptp(back[:, 1]) > float(band.attributes["stroke-width"])


def test_numbers_stand_in_circles_on_their_shafts_clear_of_each_other(flow: gl.PowerFlow) -> None:
    scheme = flow.scheme()
    found, origin = moved(scheme)
    count = len(scheme.routing.spines)
    discs = [s for s in found if s.kind == "circle" and s.attributes.get("fill") == "white" and s.radius == 7]
    letters = [s for s in found if s.text in map(str, range(1, count + 1)) and s.attributes.get("font-size") == "9"]
    assert [s.text for s in letters] == [str(k + 1) for k in range(count)]
    for disc, letter, (_, (y, points)) in zip(discs, letters, sorted(scheme.routing.spines.items()), strict=True):
        x = disc.middle[0] - origin[0]
        assert disc.middle[1] - origin[1] == pytest.approx(y, abs=CLOSE)
        assert min(p[2] for p in points) <= x <= max(p[2] for p in points)
        assert letter.points[0] - [0, 0.36 * letter.size] == pytest.approx(disc.middle, abs=0.1)
    for a, b in itertools.combinations(discs, 2):
        assert np.hypot(*(a.middle - b.middle)) > 12  # the numbers do not cover each other, even in a short segment


def test_numbers_stand_in_the_middle_of_the_longest_free_segment() -> None:
    """At a quarter of it where the middle is taken, and as far from others as they can where nothing is free."""

    def along(*spines: tuple[float, tuple[float, ...]], inline: tuple[tuple[float, float], ...] = ()) -> list[float]:
        symbols = tuple(Symbol("k", "inline", "clutch", (0, 1), ("a", "b")) for _ in inline)
        routing = Routing(
            tuple(Place(x, y, False) for x, y in inline), (),
            {k: (y, tuple((0, 0, x) for x in xs)) for k, (y, xs) in enumerate(spines)}, 0, 0,
        )  # fmt: skip
        found = list(places_of_numbers(Axes(symbols, (), ()), routing))
        assert [(n, shaft, y) for n, shaft, _, y in found] == [(k + 1, k, y) for k, (y, _) in enumerate(spines)]
        return [x for _, _, x, _ in found]

    assert along((0.0, (0.0, 100.0, 40.0))) == [70.0]  # between 40 and 100
    assert along((5.0, (30.0, 30.0))) == [30.0]
    assert along((0.0, (0.0, 100.0)), (20.0, (0.0, 100.0))) == [50.0, 25.0]
    assert along((0.0, (0.0, 100.0)), (26.0, (0.0, 100.0))) == [50.0, 50.0]
    assert along((0.0, (0.0, 100.0)), inline=((50.0, 17.0),)) == [25.0]  # a label above a clutch
    assert along((0.0, (0.0, 8.0)), (1.0, (0.0, 8.0)), (2.0, (0.0, 8.0))) == [4.0, 2.0, 6.0]


def test_the_table_is_aligned_below_the_drawing(flow: gl.PowerFlow) -> None:
    """Numbers end at the edge of their column, as its head does; rows at equal distances; the note below them."""
    scheme = flow.scheme()
    listing = scheme.results.listing(scheme.axes, scheme.routing)
    found = [s for s in shapes(scheme.svg) if s.kind == "text"][-1 - len(listing.head) * (1 + len(listing.rows)) :]
    *cells, note = found
    assert note.text == listing.note
    rows = [cells[k : k + len(listing.head)] for k in range(0, len(cells), len(listing.head))]
    assert [tuple(s.text for s in row) for row in rows] == [listing.head, *listing.rows]
    for k in range(1, len(listing.head)):
        column = [row[k] for row in rows]
        edge = column[0].box[2] if k < len(listing.head) - 1 else column[0].box[0]
        assert [s.box[2] if k < len(listing.head) - 1 else s.box[0] for s in column] == pytest.approx([edge] * len(column))
        assert column[0].box[0] > max(row[k - 1].box[2] for row in rows)
    heights = [row[0].points[0][1] for row in rows]
    assert all(s.points[0][1] == row[0].points[0][1] for row in rows for s in row)
    assert np.ptp(np.diff(heights[1:])) < CLOSE
    assert heights[1] - heights[0] == pytest.approx(heights[2] - heights[1], abs=1)
    assert note.points[0][1] > heights[-1] + note.size
    page = shapes(scheme.svg)[0]
    assert note.points[0][1] + note.size < page.box[3]
    drawing = [s for s in shapes(scheme.svg)[1:] if s not in found and s.kind != "text"]
    assert heights[0] - rows[0][0].size > max(s.box[3] for s in drawing if s.text == "") - 1
    assert max(row[-1].box[2] for row in rows) <= page.box[2]


@pytest.mark.parametrize("turn", [1.0, -0.4, 0.8 + 0.6j, -0.2 - 0.1j])
def test_dials_show_how_far_the_shaft_swings(turn: complex) -> None:
    """A grey sector over the whole swing, a coloured one from rest to the hand, both about the top."""
    train = scheme_of("two stages").train
    scheme = Scheme(train, ShownMotion("a mode", {0: turn}))
    sectors = {s.attributes["fill"]: s for s in shapes(scheme.svg) if s.attributes.get("d", "").startswith("M0 0")}
    now = complex(turn).real
    assert set(sectors) == {SWEPT, FORWARD if now > 0 else BACK}
    for fill, (start, end) in ((SWEPT, (-abs(turn), abs(turn))), (FORWARD if now > 0 else BACK, sorted((0.0, now)))):
        numbers = [float(v.lstrip("MLA")) for v in sectors[fill].attributes["d"].split() if v != "Z"]
        (x1, y1), (x2, y2) = numbers[2:4], numbers[9:11]
        assert numbers[:2] == [0, 0]
        assert numbers[4:7] == [RIM, RIM, 0]
        assert np.degrees([np.arctan2(x1, -y1), np.arctan2(x2, -y2)]) == pytest.approx([SWING * start, SWING * end], abs=0.1)
        assert (np.hypot(x1, y1), np.hypot(x2, y2)) == pytest.approx((RIM, RIM), abs=0.01)
        assert numbers[7:9] == [SWING * (end - start) > 180, 1]
