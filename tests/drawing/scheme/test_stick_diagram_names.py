"""Names in stick diagrams stand off what the other parts cover."""

import pytest

from gearlib.drawing.scheme.axes import Axes
from gearlib.drawing.scheme.labels import Label
from gearlib.drawing.scheme.routing import Place, Routing
from gearlib.drawing.scheme.stick_diagram import placed_names
from gearlib.drawing.scheme.train import Symbol

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
