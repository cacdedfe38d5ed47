"""Bounds, defaults and sizes that components declare: what is physical, what Modelica has, what another component has."""

from __future__ import annotations

import math
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BoundError
from gearlib.flatten.flatten import flatten
from gearlib.language.component import equations_of
from tests.gearparts.bench import bench, needed_values
from tests.gearparts.declared_numbers import misfits
from tests.gearparts.test_components import COMPONENTS

B = gp.blocks
BLOCKS = [getattr(B, name) for name in B.__all__]
CLASSES = [*COMPONENTS, *BLOCKS]


def known(kind: Any) -> dict[str, Any]:
    """What a class declares, by name."""
    return kind._declarations  # type: ignore[no-any-return]


@pytest.mark.parametrize("kind", COMPONENTS)
def test_it_and_its_parts_have_physical_bounds_and_sizes_and_modelica_s_defaults(kind: type[gl.Component]) -> None:
    """Masses, stiffnesses, dampings and radii may be zero and not negative; what is added to a law is nothing unless it is given."""
    found = [m for part in flatten(bench(kind)).instances for m in misfits(part.kind, part.record.declared)]
    assert found == []


COUNTED = [(c, n, d) for c in CLASSES for n, d in known(c).items() if isinstance(d, gl.Structural) and d.is_bounded]


def test_counts_of_parts_have_limits_and_numbers_of_teeth_may_be_unknown() -> None:
    limits = {"planets": (1, 1000), "segments": (1, 100_000), "n": (1, 20)} | dict.fromkeys(
        ("Z_s", "Z_p", "Z_r", "Z_1"), (0, math.inf)
    )
    for kind, name, declared in COUNTED:
        assert (declared.min, declared.max) == limits[name], (kind, name)
        assert declared.default == 0 or not name.startswith("Z"), (kind, name)
        assert declared.default == 3 or name != "planets" or kind is gp.PlanarPlanetaryUnit, kind  # as in the paper
    for part, message in (
        (lambda: gp.TorsionalShaft(segments=100_001, J=1.0, c=1.0), "segments is 100001; expected 1 to 100000"),
        (lambda: B.PadeDelay(n=21, delay_time=1.0), "n is 21; expected 1 to 20"),
        (
            lambda: gp.FixedAxisUnit(Z_1=-1, R_1=1.0, R_2=1.0, I_1=1.0, I_2=1.0, K_g=1.0, C_g=1.0),
            "Z_1 is -1; expected 0 or more",
        ),
    ):
        with pytest.raises(BoundError, match=message):
            gl.compile(part())


STRUCTURE_IN_MODELICA: dict[Any, dict[str, Any]] = {  # choices and tables of the Modelica Standard Library 4.1.0
    gp.BearingFriction: {"tau_pos": ((0, 1),)}, gp.Brake: {"mu_pos": ((0, 0.5),)}, gp.Clutch: {"mu_pos": ((0, 0.5),)},
    gp.OneWayClutch: {"mu_pos": ((0, 0.5),)}, gp.Gearbox: {"loss_table": ((0, 1, 1, 0, 0),), "use_support": False},
    gp.LossyGear: {"loss_table": ((0, 1, 1, 0, 0),), "use_support": False, "use_heat_port": False},
    gp.IdealGearR2T: {"use_support_r": False, "use_support_t": False}, gp.Position: {"exact": False}, gp.Speed: {"exact": False},
    gp.InitializeFlange: {"use_phi_start": True, "use_w_start": True, "use_a_start": True},
    gp.TorqueToAngleAdaptor: {"use_w": True, "use_a": True}, gp.AngleToTorqueAdaptor: {"use_w": True, "use_a": True},
    gp.LinearSpeedDependentTorque: {"torque_direction": True}, gp.QuadraticSpeedDependentTorque: {"torque_direction": True},
    gp.InverseSpeedDependentTorque: {"torque_direction": True}, gp.QuadraticSpeedDependentForce: {"force_direction": True},
    gp.SignTorque: {"reg": "exp"}, B.LimPID: {"controller_type": "PID"}, B.PadeDelay: {"n": 1},
    B.TransferFunction: {"b": (1,), "a": (1,)},
}  # fmt: skip


@pytest.mark.parametrize("kind", STRUCTURE_IN_MODELICA, ids=lambda kind: kind.__name__)
def test_choices_are_those_of_the_modelica_standard_library_unless_told_otherwise(kind: Any) -> None:
    """A text that leaves a choice to Modelica means the same here."""
    part = kind(**needed_values(kind, 1.0))
    assert equations_of(part) or part.assemble()
    assert {name: getattr(part, name) for name in STRUCTURE_IN_MODELICA[kind]} == STRUCTURE_IN_MODELICA[kind]


@pytest.mark.parametrize("kind", [c for c in CLASSES if c not in STRUCTURE_IN_MODELICA], ids=lambda kind: kind.__name__)
def test_what_may_be_left_out_is_left_out_unless_it_is_asked_for(kind: Any) -> None:
    """Housings, heat ports, backlash, friction, elastic shafts; an adaptor's and a start value's parts are on in Modelica."""
    assert [name for name, d in known(kind).items() if isinstance(d, gl.Structural) and d.default is True] == []


def test_both_sides_and_all_bearings_of_a_planetary_unit_are_alike_unless_told_otherwise() -> None:
    elastic, planar = known(gp.TorsionalPlanetaryUnit), known(gp.TranslationalPlanetaryUnit)
    assert elastic["K_ring"].default == elastic["K_sun"].default > 0
    assert elastic["C_ring"].default == elastic["C_sun"].default == 0
    assert len({planar[f"k_{body}"].default for body in "srhp"}) == 1
    assert planar["k_s"].default == 10 * planar["K_sun"].default


def test_the_first_unit_of_the_xx_train_is_that_of_the_xp_train_and_the_second_one_is_alike() -> None:
    xx, xp = known(gp.XXTrain), known(gp.XPTrain)
    for name in ("K_g", "C_g", "C_v"):
        assert xx[name].default == xp[name].default
    for name in ("R_s", "R_p", "I_s", "I_p", "I_r", "I_h"):
        assert xx[f"{name}1"].default == xp[name].default
    given: dict[str, Any] = {f"{n}1": 1.0 + 0.1 * k for k, n in enumerate(("R_s", "R_p", "I_s", "I_p", "I_r", "I_h"))}
    values = parameters(gp.XXTrain(**given))
    for name, value in given.items():
        assert values[name.replace("1", "2")] == value, name
    assert all(xp[f"m_{k}"].default == 1.0 for k in (18, 19, 22))


def parameters(component: gl.Component) -> dict[str, float]:
    """Values of all parameters by path."""
    found = flatten(component).parameters
    return dict(zip(found.names, found.defaults, strict=True))


def test_masses_of_a_planar_unit_are_those_of_discs_a_rim_and_points() -> None:
    """Sun and carrier are discs, I = m R**2 / 2; the ring is a rim, I = m R**2; the planets' orbit is that of points."""
    given: dict[str, Any] = {
        "R_s": 0.3,
        "R_p": 0.5,
        "I_s": 0.7,
        "I_r": 1.1,
        "I_h": 1.3,
        "I_spin": 1.7,
        "I_orbit": 1.9,
        "alpha": 0.35,
    }
    values = parameters(gp.PlanetaryUnit(level="planar", **given))
    r_h = 0.8 / math.cos(0.35)  # the radii are those of the base circles, so the centres lie farther out
    expected = {"R_r": 1.3, "R_h": 0.8, "m_s": 1.4 / 0.09, "m_r": 1.1 / 1.69, "m_h": 2.6 / 0.64,
                "planar.r_c": r_h, "planar.planet[0].m": 1.9 / r_h**2}  # fmt: skip
    assert {name: values[name] for name in expected} == pytest.approx(expected, rel=1e-14)


def test_places_of_a_detailed_mesh_follow_from_its_radii_and_teeth() -> None:
    mesh = gp.DetailedExternalMesh(friction=True, r_a=0.04, r_b=0.07, c=1e8, d=0.0, z_a=23.0, alpha=0.4, contact_ratio=1.7)
    values = parameters(Between(part=mesh))
    expected = {
        "pitch": 2 * math.pi * 0.04 / 23, "approach": 0.85, "tangent_a": 0.04 * math.tan(0.4), "tangent_b": 0.07 * math.tan(0.4)
    }  # fmt: skip
    assert {name: values[f"part.{name}"] for name in expected} == pytest.approx(expected, rel=1e-14)


class Between(gl.Component):
    """A part that is already made, between two bodies."""

    def __init__(self, part: gl.Component) -> None:
        super().__init__()
        self.part = part

    def assemble(self) -> list[gl.Connection]:
        self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        return [gl.connect(self.a.flange_b, self.part.flange_a), gl.connect(self.part.flange_b, self.b.flange_a)]


def test_sizes_of_bodies_speeds_are_those_of_their_springs() -> None:
    assert known(gp.Inertia)["w"].nominal == known(gp.Mass)["v"].nominal == known(gp.Spring)["w_rel"].nominal
    temperature = known(gp.HeatCapacitor)["T"]
    assert 273.15 < temperature.guess < 300.0 <= temperature.nominal < 310.0
