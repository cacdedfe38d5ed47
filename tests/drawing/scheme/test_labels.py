"""Names in stick diagrams stand off all lines and off each other."""

import itertools
import re

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.scheme.axes import Axes
from gearlib.drawing.scheme.labels import Label, overlap, placed
from gearlib.drawing.scheme.routing import Place, Routing
from gearlib.drawing.scheme.stick_diagram import placed_names
from gearlib.drawing.scheme.train import Symbol
from tests.drawing.scheme.test_stick_diagram import scheme_of


class Turning(gl.Component):
    """Ravigneaux's set with its carrier held."""

    def assemble(self):
        self.engine, self.load, self.housing = gp.Torque(), gp.Torque(), gp.Fixed()
        self.box = gp.Ravigneaux(ratio_small=2.2, ratio_large=2.9)
        self.body = [gp.Inertia(J=1.0) for _ in range(4)]
        shafts = [self.box.small_sun, self.box.large_sun, self.box.carrier, self.box.ring]
        return [
            gl.connect(self.engine.flange, self.box.small_sun),
            gl.connect(self.box.ring, self.load.flange),
            gl.connect(self.housing.flange, self.box.carrier),
            *(gl.connect(body.flange_a, shaft) for body, shaft in zip(self.body, shafts, strict=True)),
        ]


@pytest.mark.parametrize("train", ["ravigneaux", "xp"])
def test_no_name_lies_on_a_line_or_on_another_name(train):
    scheme = scheme_of(train)
    boxes = [label.box(place) for label, place in placed_names(scheme.axes, scheme.routing)]
    assert len(boxes) > 3
    lines = [(min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2)) for x1, y1, x2, y2, _ in scheme.routing.lines]
    assert [(box, line) for box in boxes for line in lines if overlap(box, line) > 0] == []
    assert [pair for pair in itertools.combinations(boxes, 2) if overlap(*pair) > 0] == []


def test_the_first_free_place_is_taken_and_otherwise_the_emptiest():
    left, right = (0.0, 0.0, "end"), (0.0, 0.0, "start")
    wide, narrow = (1.0, -20.0, 100.0, 20.0), (-3.0, -20.0, -2.0, 20.0)
    label = Label("name", [right, left])
    assert placed([label], []) == [right]
    assert placed([label], [wide]) == [left]
    assert placed([label], [wide, narrow]) == [left]
    assert placed([label, label], []) == [right, left]
    assert overlap((0, 0, 2, 2), (1, 1, 1, 5)) == 1.0
    assert overlap((0, 0, 2, 2), (3, 0, 4, 2)) == 0.0


def test_labels_of_a_ladder_are_drawn_over_all_its_rails():
    """A label that lies on the rail of another shaft interrupts it."""
    svg = gl.compile(Turning()).power_flow(speeds={"engine.flange": 200.0}, torques={"engine.tau": 100.0}).speed_ladder().svg
    last_rail = max(found.start() for found in re.finditer(r'<line [^>]*stroke="#5b6b7d"', svg))
    names = [found for found in re.finditer(r"<text [^>]*>box\.[^<]*=", svg) if "paint-order" in found[0]]
    assert len(names) == 2
    assert all(found.start() > last_rail for found in names)


EXTERNAL = Symbol("G", "external", "gear", (0, 1), ("flange_a", "flange_b"), (30.0, 60.0), label="G")
INTERNAL = Symbol("G", "internal", "internal_mesh", (0, 1), ("flange_a", "flange_b"), (60.0, 30.0), label="G")
PLANETS = Symbol("G", "planetary", "planetary", (0, 1, 1), ("sun", "carrier", "ring"), (30.0, 80.0), label="G")
COUPLING = Symbol("G", "inline", "spring", (0, 1), ("flange_a", "flange_b"), label="G")


@pytest.mark.parametrize(
    ("other", "turned", "lower", "covered"),
    [
        (EXTERNAL, False, 90.0, (-7, -30, 7, 150)), (INTERNAL, False, 30.0, (-7, -60, 20, 60)),
        (INTERNAL, True, 30.0, (-20, -60, 7, 60)), (PLANETS, False, 0.0, (-10, -80, 10, -30)), (COUPLING, False, 0.0, (-10, -9, 10, 9)),
    ],
)  # fmt: skip
@pytest.mark.parametrize("edge", range(4))
@pytest.mark.parametrize("inside", [False, True])
def test_a_name_stands_off_what_another_part_covers(other, turned, lower, covered, edge, inside) -> None:
    """The first place of a coupling's name, above it, is taken where it is a pixel from the other part, and not a pixel within it."""
    middle = [(covered[k] + covered[k + 2]) / 2 for k in (0, 1)]
    label = Label("K", [(0.0, 0.0, "middle")]).box((0.0, 0.0, "middle"))  # about its base point
    far = edge // 2  # 0: the left or upper edge, 1: the right or lower one
    shift = (1.0 if inside else -1.0) * (-1.0 if far else 1.0)
    middle[edge % 2] = covered[edge] - label[edge % 2 + (0 if far else 2)] + shift
    if edge % 2 == 0:
        middle[1] += 3.0  # of the letters about their base line
    x, y = middle
    coupling = Symbol("K", "inline", "spring", (2, 3), ("flange_a", "flange_b"), label="K")
    axes = Axes((coupling, other), (0, 1, 0, 0), (0.0, lower))
    routing = Routing((Place(x, y + 21.0, False), Place(0.0, 0.0, turned)), (), {}, 0, 0)
    (name, spot), _ = placed_names(axes, routing)
    assert name.words == "K"
    assert (spot == (x, y, "middle")) != inside
