"""Flanks: force, contact, stored energy and heat of each side over the deflection, by hand."""

from __future__ import annotations

import pytest

import gearparts as gp
from tests.gearparts.laws import powers, right_side

MESH = {"r_a": 0.1, "r_b": 0.2, "c": 1e8, "d": 10.0}


@pytest.mark.parametrize(
    ("b", "q", "beyond", "contact"),
    [  # half the gap is 2; how far the drive flank and the coast flank are pressed, where they are
        (4.0, 5.0, (3.0, None), 1),
        (4.0, 2.0, (0.0, None), 1),
        (4.0, 1.9, (None, None), 0),
        (4.0, -1.9, (None, None), 0),
        (4.0, -2.0, (None, None), 0),
        (4.0, -5.0, (None, -3.0), -1),
        (0.0, 3.0, (3.0, None), 1),
        (0.0, 0.0, (0.0, None), 1),
        (0.0, -3.0, (None, -3.0), -1),
        (-4.0, 5.0, (7.0, None), 1),  # an interference of 4
        (-4.0, 2.0, (4.0, None), 1),
        (-4.0, 1.0, (3.0, -1.0), 2),
        (-4.0, -2.0, (0.0, -4.0), 2),
        (-4.0, -5.0, (None, -7.0), -1),
    ],
)
def test_each_flank_presses_beyond_its_half_of_the_gap(
    b: float, q: float, beyond: tuple[float | None, float | None], contact: int
) -> None:
    """With a stiffness of 6 N/m, a damping of 0.5 N.s/m and 8 m/s."""
    mesh = gp.DetailedExternalMesh(backlash=True, **MESH)
    pressed = [x for x in beyond if x is not None]
    values = {"q": q, "b": b, "c_now": 6.0, "d": 0.5, "v": 8.0}
    assert right_side(mesh, "f", **values) == pytest.approx(6.0 * sum(pressed) + 4.0 * len(pressed))
    assert right_side(mesh, "contact", **values) == contact
    assert right_side(mesh, "loss_power", **values) == pytest.approx(32.0 * len(pressed))
    symbols = values | {"loss_power": 32.0, "f": 2.0, "e_rate": 0.25}
    assert powers(mesh, symbols) == pytest.approx((3.0 * sum(x**2 for x in pressed), 32.0, 0.5))


def test_without_backlash_force_and_deflection_are_proportional() -> None:
    mesh = gp.DetailedExternalMesh(**MESH)
    for q in (3.0, -3.0):
        values = {"q": q, "c_now": 6.0, "d": 0.5, "v": 8.0}
        assert right_side(mesh, "f", **values) == 6.0 * q + 4.0
        assert right_side(mesh, "contact", **values) == 1
        assert right_side(mesh, "loss_power", **values) == 32.0
        assert powers(mesh, values | {"loss_power": 32.0, "f": 2.0, "e_rate": 0.25}) == (27.0, 32.0, 0.5)


def test_words_tell_the_flanks_that_touch() -> None:
    """Its values are those of ``contact``: none, that of a positive turn of the first gear, the other one, both."""
    said = gp.DetailedExternalMesh._declarations["contact"].words
    assert [said[flanks].format("m").partition(":")[0] for flanks in (0.0, 1.0, -1.0, 2.0)] == [
        "open",
        "in contact",
        "in contact, driven backwards",
        "in contact on both flanks",
    ]
