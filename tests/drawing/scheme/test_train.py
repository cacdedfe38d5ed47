"""Which symbol a part has in a stick diagram, from its icon, its flanges and its radii."""

from __future__ import annotations

import pytest

from gearlib.drawing.block_diagram import Outline, Terminal
from gearlib.drawing.scheme.train import Symbol, train_of

PAIR = ("flange_a", "flange_b")
SET = ("sun", "carrier", "ring")


def symbol(icon: str, ports: tuple[str, ...], radii: tuple[float, ...] = ()) -> Symbol:
    """Of a part beside a body."""
    part = Outline("part", "Part", icon, tuple(map(Terminal, ports)), radii=radii)
    body = Outline("body", "Body", "torque", (Terminal("flange"),))
    found = train_of(Outline("model", "Model", parts=(body, part)))
    assert [s.name for s in found.symbols] == ["body", "part"]
    return found.symbols[1]


@pytest.mark.parametrize(("icon", "ports", "label"), [("brake", PAIR, "part"), ("fixed", ("flange",), "")])
def test_what_is_held_has_one_flange_in_the_drawing(icon: str, ports: tuple[str, ...], label: str) -> None:
    """A brake is on one shaft, though it has a flange on both sides; a wall needs no name."""
    found = symbol(icon, ports)
    assert (found.kind, found.shafts, found.ports, found.label) == ("held", (1,), ports[:1], label)
    assert found.named(ports[0]) == "part"


@pytest.mark.parametrize(
    ("ratio", "kind", "radii", "label"),
    [(-2.0, "external", (1.0, 2.0), "part"), (-0.5, "external", (1.0, 0.5), "part"), (1.5, "inline", (), "part: 1.5"),
     (0.0, "inline", (), "part: 0"), (1e-3, "inline", (), "part: 0.001"), (float("nan"), "external", (1.0, 1.0), "part")],
)  # fmt: skip
def test_a_ratio_is_drawn_as_two_gears_where_it_reverses(ratio: float, kind: str, radii: tuple[float, ...], label: str) -> None:
    """And as a box with the number elsewhere: two gears of no size would be seen as none."""
    found = symbol("gear", PAIR, (ratio,))
    assert (found.kind, found.shafts, found.radii, found.label) == (kind, (1, 2), radii, label)
    assert found.icon == ("gear" if kind == "external" else "ratio")
    assert not found.in_metres


@pytest.mark.parametrize(
    ("icon", "radii", "kind", "expected"),
    [("mesh", (0.02, 0.06), "external", (0.02, 0.06)), ("internal_mesh", (0.06, 0.02), "internal", (0.06, 0.02)),
     ("mesh", (0.02, float("nan")), "external", (1.0, 1.0))],
)  # fmt: skip
def test_radii_of_a_pair_are_its_own(icon: str, radii: tuple[float, ...], kind: str, expected: tuple[float, ...]) -> None:
    found = symbol(icon, PAIR, radii)
    assert (found.kind, found.shafts, found.ports, found.radii, found.in_metres) == (kind, (1, 2), PAIR, expected, True)


@pytest.mark.parametrize(
    ("radii", "kind", "sizes", "in_metres"),
    [((0.03, 0.09), "planetary", (0.03, 0.09), True), ((3.0,), "planetary", (1.0, 3.0), False), ((), "planetary", (1.0, 2.5), False),
     ((-3.0,), "double_planetary", (1.0, 3.0), False), ((-0.5,), "double_planetary", (1.0, 0.5), False),
     ((0.5,), "planetary", (1.0, 0.5), False), ((float("nan"), 0.09), "planetary", (1.0, 2.5), False)],
)  # fmt: skip
def test_a_set_has_its_shafts_in_one_order_and_the_size_of_its_ratio(
    radii: tuple[float, ...], kind: str, sizes: tuple[float, ...], in_metres: bool
) -> None:
    found = symbol("planetary", ("ring", "sun", "carrier"), radii)
    assert (found.kind, found.ports, found.shafts) == (kind, SET, (2, 3, 1))
    assert (found.radii, found.in_metres) == (sizes, in_metres)


@pytest.mark.parametrize(
    ("icon", "ports"), [("", SET), ("spring", SET), ("planetary", ("sun", "carrier")), ("planetary", ("sun", "ring", "planet"))]
)
def test_a_set_is_what_has_its_icon_and_its_flanges(icon: str, ports: tuple[str, ...]) -> None:
    found = symbol(icon, ports)
    assert (found.kind, found.ports, found.shafts) == ("inline", ports, tuple(range(1, 1 + len(ports))))
    assert found.icon == ("spring" if icon == "spring" else "box")


@pytest.mark.parametrize(("icon", "shown"), [("torque", "torque"), ("rack", "rack"), ("", "box"), ("spring", "box")])
def test_a_part_with_one_flange_is_the_end_of_its_shaft(icon: str, shown: str) -> None:
    found = symbol(icon, ("flange",))
    assert (found.kind, found.icon, found.shafts, found.label) == ("end", shown, (1,), "part")
