"""What a detailed mesh does to its shafts: deflection, torques, losses and energies by hand, with gears that turn either way."""

from __future__ import annotations

import math
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError, BoundError
from gearparts.gears.mesh_models import details_of
from tests.gearparts.laws import powers, right_side
from tests.gearparts.test_declared_numbers import parameters

SIZES = {"r_a": 0.1, "r_b": 0.2, "c": 1e8, "d": 10.0}
KINDS = [(gp.DetailedExternalMesh, 1), (gp.DetailedInternalMesh, -1)]


@pytest.mark.parametrize(("kind", "sense"), KINDS)
def test_radii_turn_speeds_into_deflection_and_force_into_torques(kind: Any, sense: int) -> None:
    """Gears outside each other turn against each other, a gear inside a ring with it."""
    mesh = kind(**SIZES)
    values = {"r_a": 0.1, "r_b": 0.25, "w_a": 3.0, "w_b": 7.0, "e_rate": 0.5, "f": 40.0}
    assert right_side(mesh, "v", **values) == pytest.approx(0.3 + sense * 1.75 + 0.5)
    assert right_side(mesh, "flange_a.tau", **values) == pytest.approx(4.0)
    assert right_side(mesh, "flange_b.tau", **values) == pytest.approx(sense * 10.0)
    assert right_side(mesh, "loss_power", d=0.5, v=8.0, **values) == pytest.approx(32.0)


@pytest.mark.parametrize(("kind", "sense"), KINDS)
@pytest.mark.parametrize("backlash", [False, True])
def test_friction_adds_to_torques_and_losses(kind: Any, sense: int, backlash: bool) -> None:
    mesh = kind(friction=True, backlash=backlash, **SIZES)
    values = {"r_a": 0.1, "r_b": 0.25, "w_a": 3.0, "w_b": 7.0, "f": 40.0, "tau_friction_a": 1.5, "tau_friction_b": -0.25}
    assert right_side(mesh, "flange_a.tau", **values) == pytest.approx(4.0 + 1.5)
    assert right_side(mesh, "flange_b.tau", **values) == pytest.approx(sense * 10.0 - 0.25)
    assert right_side(mesh, "loss_power", d=0.5, v=8.0, q=1.0, **values) == pytest.approx(32.0 + 4.5 - 1.75)


@pytest.mark.parametrize(("kind", "sense"), KINDS)
def test_the_error_and_a_stiffness_that_grows_supply_power(kind: Any, sense: int) -> None:
    """Of a stiffness 5 (1 + 0.3 cos(x)), at x = -1.5 and 20 teeth times 2 rad/s, with a deflection of 3 m."""
    mesh = kind(stiffness="sinusoidal", c_amplitude=0.3, error_terms=((2.0, 0.4, 0.25),), **SIZES)
    values = {"c": 5.0, "c_amplitude": 0.3, "phase": -0.5, "c_phase": -1.0, "z_a": 20.0, "w_a": 2.0, "q": 3.0, "c_now": 4.0}
    stored, heat, supplied = powers(mesh, values | {"loss_power": 6.0, "f": 7.0, "e_rate": 0.5})
    error, slope = 2.0 * 0.4 * math.cos(-1.0 + 0.25), 5.0 * 0.3 * math.sin(1.5)
    assert (stored, heat) == (18.0, 6.0)
    assert supplied == pytest.approx(7.0 * (0.5 + error * 40.0) + slope * 40.0 * 9.0 / 2, rel=1e-14)


def test_mesh_damping_is_that_of_the_reduced_mass() -> None:
    """2 zeta sqrt(c m), with 1 / m = r_a**2 / J_a + r_b**2 / J_b = 9 / 4 + 16 / 64 = 10 / 4."""
    assert float(gp.mesh_damping(0.05, 10.0, 4.0, 3.0, 64.0, 4.0)) == pytest.approx(0.1 * 2.0, rel=1e-15)
    assert (
        float(gp.mesh_damping(0.0, 10.0, 4.0, 3.0, 64.0, 4.0)) == float(gp.mesh_damping(0.05, 0.0, 4.0, 3.0, 64.0, 4.0)) == 0.0
    )


@pytest.mark.parametrize("name", ["zeta", "c", "J_a", "r_a", "J_b", "r_b"])
def test_values_of_which_no_damping_follows_are_refused(name: str) -> None:
    given: dict[str, Any] = {"zeta": 0.05, "c": 2e8, "J_a": 0.001, "r_a": 0.05, "J_b": 0.016, "r_b": 0.1}
    may_be_zero = name in ("zeta", "c")
    expected = "a finite number from 0 on" if may_be_zero else "a positive finite number"
    for value in (-1.0, math.inf, "1", *(() if may_be_zero else (0.0,))):
        with pytest.raises(BoundError, match=rf"^mesh_damping: {name} is {value!r}; expected {expected}$"):
            gp.mesh_damping(**{**given, name: value})


@pytest.mark.parametrize(("J", "r"), [(1e300, 0.1), (1.0, 1e200), (1.0, 1e-200)])
def test_a_damping_beyond_all_numbers_is_refused(J: float, r: float) -> None:
    with pytest.raises(BoundError, match=r"^mesh_damping\(zeta=0\.05, c=1e\+300, .*\) is not a finite number$"):
        gp.mesh_damping(0.05, 1e300, J, r, J, r)


class DampedByRatio(gl.Component):
    """A mesh whose damping follows from parameters."""

    J = gl.Parameter("kg.m2", default=4.0)
    c = gl.Parameter("N/m", default=10.0)

    def assemble(self) -> list[Any]:
        self.mesh = gp.ExternalMesh(r_a=3.0, r_b=4.0, c=self.c, d=gp.mesh_damping(0.05, self.c, self.J, 3.0, 16 * self.J, 4.0))
        with pytest.raises(BoundError, match=r"mesh_damping: r_a is -3\.0"):
            gp.mesh_damping(0.05, self.c, self.J, -3.0, self.J, 4.0)
        return []


def test_damping_of_parameters_is_an_expression_of_them() -> None:
    """Beside which numbers are checked as ever."""
    assert parameters(DampedByRatio())["mesh.d"] == pytest.approx(0.2, rel=1e-15)
    assert parameters(DampedByRatio(J=1.0))["mesh.d"] == pytest.approx(0.1, rel=1e-15)


@pytest.mark.parametrize("given", [(1.0,), ("ab", 1.0), ((3, 1.0),), (("b",),)])
def test_details_are_pairs_of_a_name_and_a_value(given: Any) -> None:
    unit = gp.FixedAxisUnit(details=given, R_1=0.1, R_2=0.2, I_1=1.0, I_2=1.0, K_g=1e8, C_g=0.0)
    with pytest.raises(BindingError, match=r"FixedAxisUnit\.details is .*; expected pairs of a name and a value"):
        details_of(unit, "details")


def test_details_are_handed_on_by_name() -> None:
    unit = gp.FixedAxisUnit(details=(("b", 1e-4), ("backlash", True)), R_1=0.1, R_2=0.2, I_1=1.0, I_2=1.0, K_g=1e8, C_g=0.0)
    assert details_of(unit, "details") == {"b": 1e-4, "backlash": True}
    assert isinstance(unit.mesh, gp.DetailedExternalMesh)
    assert unit.mesh.backlash is True
