"""Torques of couplings with backlash at numbers: on both sides of the gap, in it and at its edges, approaching and leaving."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits, powers, right_side

KINDS = [gp.ElastoBacklash, gp.ElastoBacklash2]
C, D, GAP, MIDDLE = 40.0, 3.0, 0.2, 0.5


def torque(kind: Any, x: float, w: float) -> tuple[float, float]:
    """Of the spring, and in all, with ``x`` from the middle of the gap."""
    side = 1.0 if x > GAP / 2 else -1.0 if x < -GAP / 2 else 0.0
    spring = C * (x - side * GAP / 2) if side else 0.0
    damping = D * w
    if kind is gp.ElastoBacklash:
        damping = side * min(side * damping, side * spring)
    return spring, side * max(side * (spring + damping), 0.0) if side else 0.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("x", [-0.35, -0.15, -0.1, 0.0, 0.1, 0.15, 0.35])
def test_torque_pushes_only_and_only_beyond_the_gap(kind: Any, x: float) -> None:
    part = kind(c=C, d=D, b=GAP)
    side = 1.0 if x > 0.1 else -1.0 if x < -0.1 else 0.0
    for w in (-40.0, -2.0, -0.1, 0.0, 0.1, 2.0, 40.0):
        spring, total = torque(kind, x, w)
        phi_rel = MIDDLE + x
        values = {
            "c": C, "d": D, "b": GAP, "phi_rel0": MIDDLE, "phi_rel": phi_rel, "der(phi_rel)": w, "w_rel": w,
            "flange_a.phi": 0.7, "flange_b.phi": 0.7 + phi_rel, "tau": total, "flange_a.tau": -total, "flange_b.tau": total,
            "tau_c": spring, "tau_d": D * w, "contact": side, "touching": side, "has_gap": 1.0,
            "loss_power": (total - spring) * w,
        }  # fmt: skip
        if abs(abs(x) - 0.1) > 1e-9:  # beside the edges, whose place is that of a rounded sum
            assert misfits(part, values) == [], w
            assert powers(part, values) == pytest.approx((spring**2 / C / 2, (total - spring) * w, 0.0), abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_at_its_edges_the_gap_is_open(kind: Any) -> None:
    part = kind(c=C, d=D, b=0.25)
    found = [
        right_side(part, "contact", has_gap=1.0, b=0.25, phi_rel0=0.5, phi_rel=at) for at in (0.25, 0.375, 0.5, 0.625, 0.75)
    ]
    assert found == [-1.0, 0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize("kind", KINDS)
def test_without_a_gap_it_pulls_as_it_pushes(kind: Any) -> None:
    part = kind(c=C, d=D)
    for x, w in itertools.product((-0.3, 0.0, 0.3), (-20.0, 5.0)):
        values = {"c": C, "d": D, "phi_rel0": MIDDLE, "phi_rel": MIDDLE + x, "w_rel": w, "tau_c": C * x, "tau_d": D * w}
        assert right_side(part, "tau_c", **values) == pytest.approx(C * x, abs=1e-13)
        assert right_side(part, "tau", **values) == C * x + D * w
        assert right_side(part, "touching", **values) == 1.0
        assert right_side(part, "contact", **values) == 0.0, "an edge of what is no gap"
    assert [right_side(part, "has_gap", b=b) for b in (0.0, 0.9e-10, 1e-10, 1.1e-10, 0.1)] == [0, 0, 0, 1, 1]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_damper_adds_at_most_what_the_spring_gives_or_all(kind: Any, side: float) -> None:
    """A spring at 3 N.m, pressed together or drawn apart at 1 to 4 N.m of damping, on both sides."""
    part, limited = kind(c=C, d=D, b=GAP), kind is gp.ElastoBacklash
    for damping, total in ((1.0, 4.0), (3.0, 6.0), (4.0, 6.0 if limited else 7.0), (-1.0, 2.0), (-3.0, 0.0), (-4.0, 0.0)):
        values = {"has_gap": 1.0, "contact": side, "tau_c": 3.0 * side, "tau_d": damping * side}
        assert right_side(part, "tau", **values) == total * side, damping


@pytest.mark.parametrize("kind", KINDS)
def test_words_tell_the_side_that_touches(kind: Any) -> None:
    said = kind._declarations["touching"].words
    assert [said[side].format("hub") for side in (0.0, 1.0, -1.0)] == [
        "open: coupling hub",
        "in contact: coupling hub",
        "in contact, driven backwards: coupling hub",
    ]
