"""Axes of stick diagrams from shafts and symbols alone: what is coaxial, how far apart axes are, what a gear pair within one is."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.drawing.scheme.axes import APART, LARGEST, PAIR, axes_of
from gearlib.drawing.scheme.train import Symbol, Train

PORTS = ("flange_a", "flange_b")


def train(*symbols: Symbol) -> Train:
    return Train("train", "train", symbols, 1 + max(shaft for s in symbols for shaft in s.shafts))


def pair(
    name: str, *shafts: int, kind: str = "external", radii: tuple[float, float] = (1.0, 1.0), metres: bool = False
) -> Symbol:
    return Symbol(name, kind, "gear", shafts, PORTS, radii, metres, name)


@pytest.mark.parametrize(("kind", "label"), [("external", "-1.5"), ("internal", "1.5")])
def test_a_pair_within_one_axis_is_a_box_with_its_ratio(kind: str, label: str) -> None:
    planets = Symbol("set", "planetary", "planetary", (0, 1, 2), ("sun", "carrier", "ring"), (1.0, 2.5), label="set")
    found = axes_of(train(planets, pair("gear", 0, 1, kind=kind, radii=(2.0, 3.0))))
    assert found.of == (0, 0, 0)
    _, box = found.symbols
    assert (box.kind, box.icon, box.radii, box.label) == ("inline", "ratio", (), f"gear: {label}")


@pytest.mark.parametrize("wheels", [1, 2, 5, 12, 20])
def test_no_two_axes_come_near_each_other_however_many_mesh_with_one(wheels: int) -> None:
    found = axes_of(train(*(pair(f"gear{k}", 0, k, radii=(1.0, 3.0)) for k in range(1, wheels + 1))))
    assert found.height[0] == 0.0
    assert np.diff(sorted(found.height)).min() >= APART
    assert np.abs(found.height[1]) == pytest.approx(PAIR)
    assert (np.diff(np.abs(found.height[1:])) >= 0).all(), "each as near as the ones before it leave room"
    assert np.abs(found.height[:9]).max() < 3.5 * PAIR, "four on either side"
    for symbol in found.symbols:
        assert sum(symbol.radii) == pytest.approx(abs(found.height[symbol.shafts[1]]))


@pytest.mark.parametrize(("radii", "apart"), [((0.12, 0.10), APART), ((0.12, 0.02), LARGEST * 5 / 6)])
def test_a_wheel_in_its_ring_stands_below_it_no_nearer_than_axes_may_be(radii: tuple[float, float], apart: float) -> None:
    found = axes_of(train(pair("ring", 0, 1, kind="internal", radii=radii, metres=True)))
    assert found.height == pytest.approx((0.0, apart))


def test_axes_that_nothing_joins_lie_below_the_others() -> None:
    found = axes_of(train(pair("one", 0, 1), pair("other", 2, 3)))
    assert found.height[2] == max(found.height[:2]) + 3 * LARGEST
    assert abs(found.height[3] - found.height[2]) == pytest.approx(PAIR)


def test_sizes_in_metres_share_one_scale() -> None:
    found = axes_of(
        train(
            pair("one", 0, 1, radii=(0.02, 0.06), metres=True),
            pair("ring", 2, 3, kind="internal", radii=(0.12, 0.05), metres=True),
        )
    )
    one, ring = found.symbols
    assert ring.radii == pytest.approx((LARGEST, LARGEST * 5 / 12))
    assert one.radii == pytest.approx((LARGEST / 6, LARGEST / 2))
