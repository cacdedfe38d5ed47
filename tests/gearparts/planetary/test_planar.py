"""Parts of planar planetary units: deflections and forces as projections of displacements, written with vectors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearparts as gp
from tests.gearparts.bench import bench
from tests.gearparts.conftest import Probe

Value = Callable[[str], float]


def at_random(kind: Any, *bodies: str, **given: Any) -> tuple[Value, list[np.ndarray], list[np.ndarray]]:
    """A part between bodies in any state of motion: its values, and displacements and velocities (x, y, phi) of the bodies."""
    probe, rng = Probe(bench(kind, **given)), np.random.default_rng(4)
    value = probe.values({state: rng.normal() for state in probe.states})
    places = [np.array([value(f"part.{body}.{x}") for x in ("x", "y", "phi")]) for body in bodies]
    speeds = [np.array([value(f"at_{body}.{v}") for v in ("v_x", "v_y", "w")]) for body in bodies]
    return value, places, speeds


def forces(value: Value, body: str) -> np.ndarray:
    return np.array([value(f"part.{body}.{f}") for f in ("f_x", "f_y", "tau")])


def direction(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), np.sin(angle)])


def test_a_mesh_is_a_spring_and_damper_along_its_line_of_action() -> None:
    given = {"r_a": 0.3, "r_b": -0.2, "theta": 0.7, "c": 50.0, "d": 3.0, "e": 0.11}
    value, (a, b), (v_a, v_b) = at_random(gp.PlanarMesh, "gear_a", "gear_b", **given)
    along = direction(0.7 + np.pi / 2)
    rate = along @ (v_a - v_b)[:2] + 0.3 * v_a[2] - 0.2 * v_b[2]
    assert value("part.q") == pytest.approx(along @ (a - b)[:2] + 0.3 * a[2] - 0.2 * b[2] + 0.11, rel=1e-12)
    f = 50.0 * value("part.q") + 3.0 * rate
    assert value("part.f") == pytest.approx(f, rel=1e-12)
    assert forces(value, "gear_a") == pytest.approx([*(f * along), 0.3 * f], rel=1e-12)
    assert forces(value, "gear_b") == pytest.approx([*(-f * along), -0.2 * f], rel=1e-12)


def test_a_planet_s_bearing_holds_it_to_a_place_on_the_carrier() -> None:
    """Its forces are those on the point of the carrier in which the pin stands; the pin's error is along the carrier's turn."""
    given = {"r": 0.4, "psi": 2.1, "k": 70.0, "d": 5.0, "e": 0.13}
    value, (c, p), (v_c, v_p) = at_random(gp.PlanetBearing, "carrier", "planet", **given)
    radial, tangential = direction(2.1), direction(2.1 + np.pi / 2)
    off = (c - p)[:2] + tangential * (0.4 * c[2] + 0.13)
    force = 70.0 * off + 5.0 * ((v_c - v_p)[:2] + tangential * 0.4 * v_c[2])
    assert [value("part.q_radial"), value("part.q_tangential")] == pytest.approx([radial @ off, tangential @ off], rel=1e-12)
    assert forces(value, "carrier") == pytest.approx([*force, 0.4 * tangential @ force], rel=1e-12)
    assert forces(value, "planet") == pytest.approx([*-force, 0.0], rel=1e-12)


@pytest.mark.parametrize("turning", [False, True])
def test_a_support_holds_a_body_in_place_and_against_turning_if_it_is_told_to(turning: bool) -> None:
    torsional = {"k_phi": 8.0, "d_phi": 0.9} if turning else {}
    value, (x,), (v,) = at_random(gp.PlanarSupport, "centre", k=60.0, d=4.0, turning=turning, **torsional)
    k, d = np.array([60.0, 60.0, 8.0 * turning]), np.array([4.0, 4.0, 0.9 * turning])
    assert forces(value, "centre") == pytest.approx(k * x + d * v, rel=1e-12)


def test_a_body_accelerates_under_what_acts_on_its_centre() -> None:
    value, _, _ = at_random(gp.PlanarSupport, "centre", k=60.0, d=4.0)
    m, J = 1.7, 1.3
    rates = [value(f"der(at_centre.{v})") for v in ("v_x", "v_y", "w")]
    assert np.array([m, m, J]) * rates == pytest.approx(-forces(value, "centre"), rel=1e-12)
