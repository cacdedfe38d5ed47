"""Names in stick diagrams stand off all lines and off each other."""

import itertools
import re

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.drawing.scheme.labels import Label, overlap, placed
from gearlib.drawing.scheme.stick_diagram import placed_names
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
    assert overlap((0, 0, 4, 2), (0, 2.5, 4, 3)) == overlap((0, 0, 2, 4), (2.5, 0, 3, 4)) == 0.0
    assert overlap((0, 0, 4, 2), (1, 2, 4, 3)) == overlap((0, 0, 2, 4), (2, 1, 3, 4)) == 3.0


def test_labels_of_a_ladder_are_drawn_over_all_its_rails():
    """A label that lies on the rail of another shaft interrupts it."""
    svg = gl.compile(Turning()).power_flow(speeds={"engine.flange": 200.0}, torques={"engine.tau": 100.0}).speed_ladder().svg
    last_rail = max(found.start() for found in re.finditer(r'<line [^>]*stroke="#5b6b7d"', svg))
    names = [found for found in re.finditer(r"<text [^>]*>box\.[^<]*=", svg) if "paint-order" in found[0]]
    assert len(names) == 2
    assert all(found.start() > last_rail for found in names)
