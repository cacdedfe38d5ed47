"""Forces on rods as functions of the velocity, with and without a housing that moves."""

from __future__ import annotations

import numpy as np
import pytest

import gearparts as gp
from gearlib.language.component import equations_of
from tests.gearparts.bench import bench
from tests.gearparts.conftest import Probe


@pytest.mark.parametrize("use_support", [False, True])
@pytest.mark.parametrize("force_direction", [False, True])
@pytest.mark.parametrize("v", [3.0, -2.0, 0.0])
def test_a_force_grows_with_the_square_of_the_velocity(use_support: bool, force_direction: bool, v: float) -> None:
    """Relative to the housing, which takes the reaction; in the same sense for both directions, or against the motion like the air."""
    given = {"f_nominal": -6.0, "v_nominal": 4.0, "force_direction": force_direction, "use_support": use_support}
    probe, housing = Probe(bench(gp.QuadraticSpeedDependentForce, **given)), 0.5 if use_support else 0.0
    value = probe.values({"at_flange.v": v + housing} | ({"at_support.v": housing} if use_support else {}))
    sense = 1.0 if force_direction else np.sign(v)
    assert value("part.v") == pytest.approx(v, abs=1e-15)
    assert value("part.f") == value("part.flange.f") == pytest.approx(6.0 * sense * (v / 4.0) ** 2, abs=1e-15)
    if use_support:
        assert value("part.support.f") == -value("part.f")


@pytest.mark.parametrize("use_support", [False, True])
def test_a_force_pushes_the_rod_and_the_housing_apart(use_support: bool) -> None:
    probe = Probe(bench(gp.Force, use_support=use_support, f=2.5))
    value = probe.values({})
    assert value("part.flange.f") == -2.5
    if use_support:
        assert value("part.support.f") == 2.5
        assert 1.7 * value("der(at_support.v)") == pytest.approx(value("on_support.f") - 2.5)


@pytest.mark.parametrize("L", [0.0, 0.3])
def test_flanges_of_a_mass_are_its_ends(L: float) -> None:
    value = Probe(gp.Mass(m=2.0, L=L)).values({"s": 0.7})
    assert (value("flange_a.s"), value("flange_b.s")) == pytest.approx((0.7 - L / 2, 0.7 + L / 2))
    assert len(equations_of(gp.Mass(m=2.0, L=L))) == 4
