"""Sampled blocks at their first instants."""

from __future__ import annotations

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from tests.gearparts.blocks.bench import Driven
from tests.gearparts.test_declared_numbers import parameters

B = gp.blocks


def test_a_digital_controller_begins_at_its_first_instant() -> None:
    """Its derivative part has no measurement before that one, and holds what it is between instants."""
    make = lambda: B.DiscretePID(  # noqa: E731
        sample_period=0.5, start_time=0.25, k=2.0, Ti=4.0, Td=0.5, Nd=3.0, wp=0.5, y_max=100.0, u_s=6.0, u_m=1.0 + 2.0 * gl.time
    )
    r = gl.simulate(Driven(make=make), 1.5, times=[0.0, 0.3, 0.7, 0.8, 1.2, 1.3])
    assert r["block.begun"].tolist() == [0, 1, 1, 1, 1, 1]
    assert r["block.last"] == pytest.approx([0.0, 1.5, 1.5, 2.5, 2.5, 3.5], abs=1e-14)
    derivative = -3.0 / 2.0  # -k Td Nd (1.0) / (Td + Nd h)
    later = (0.5 * derivative - 3.0) / 2.0
    assert r["block.derivative"] == pytest.approx([0.0, 0.0, 0.0, derivative, derivative, later], abs=1e-14)
    integral = np.cumsum([2.0 * 0.5 / 4.0 * (6.0 - measured) for measured in (1.5, 2.5, 3.5)])
    assert r["block.integral"] == pytest.approx([0.0, *integral[[0, 0, 1, 1, 2]]], abs=1e-14)
    v = [2.0 * (3.0 - 1.5), 2.0 * (3.0 - 2.5) + integral[0] + derivative, 2.0 * (3.0 - 3.5) + integral[1] + later]
    assert r["block.y"] == pytest.approx([0.0, v[0], v[0], v[1], v[1], v[2]], abs=1e-14)


def test_limits_are_symmetric_unless_told_otherwise() -> None:
    given = parameters(B.DiscretePID(sample_period=0.1, y_max=2.0, y_min=-3.0))
    symmetric = parameters(B.DiscretePID(sample_period=0.1, y_max=2.0))
    assert (given["room"], given["y_min"], symmetric["room"], symmetric["y_min"]) == (5.0, -3.0, 4.0, -2.0)


def test_a_delay_tells_its_instants() -> None:
    r = gl.simulate(Driven(make=lambda: B.UnitDelay(sample_period=0.5, start_time=0.25, u=3.0 + gl.time)), 1.0, samples=9)
    assert r["block.taken"] == pytest.approx([0, 0, 3.25, 3.25, 3.25, 3.25, 3.75, 3.75, 3.75], abs=1e-14)
    assert r["block.y"] == pytest.approx([0, 0, 0, 0, 0, 0, 3.25, 3.25, 3.25], abs=1e-14)
