"""Bounds, defaults and sizes that components declare: what is physical, what Modelica has, what another component has."""

from __future__ import annotations

import math
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BoundError
from gearlib.flatten.flatten import flatten
from tests.gearparts.test_components import COMPONENTS

B = gp.blocks
BLOCKS = [getattr(B, name) for name in B.__all__]
CLASSES = [*COMPONENTS, *BLOCKS]


def known(kind: Any) -> dict[str, Any]:
    """What a class declares, by name."""
    return kind._declarations  # type: ignore[no-any-return]


PARAMETERS = [(c, n, d) for c in CLASSES for n, d in known(c).items() if isinstance(d, gl.Parameter)]
NOT_NEGATIVE = {"kg", "kg.m2", "N/m", "N.s/m", "N.m/rad", "N.m.s/rad", "J/K", "W/K", "K"}
OF_EITHER_SIGN = {  # m: a gap or an interference, lengths and places, radii whose sign tells the sense of rotation
    "DetailedExternalMesh.b", "DetailedInternalMesh.b", "IdealRollingWheel.radius", "Mass.L", "PlanarMesh.r_a", "PlanarMesh.r_b",
    "PlanetBearing.e", "TranslationalFixed.s0", "TranslationalSpring.s_rel0", "TranslationalSpringDamper.s_rel0",
}  # fmt: skip


def test_masses_stiffnesses_dampings_and_radii_may_be_zero_and_not_negative() -> None:
    bounded = [(f"{c.__name__}.{n}", d) for c, n, d in PARAMETERS if d.unit in NOT_NEGATIVE or d.unit == "m"]
    assert len(bounded) > 200
    for name, declared in bounded:
        assert (declared.min, declared.max) == (-math.inf if name in OF_EITHER_SIGN else 0.0, math.inf), name


@pytest.mark.parametrize("name", ["Clutch.fn_max", "Move.k", "AngleToTorqueAdaptor.k", "Position.f_crit", "Speed.f_crit",
    "EddyCurrentTorque.tau_nominal", "ElastoBacklash.b", "ElastoBacklash2.b", "ElasticCoupling.b", "Gearbox.b",
    "DetailedExternalMesh.mu", "DetailedExternalMesh.approach", "DiscretePID.Td", "DiscretePID.wp", "LimPID.wp", "LimPID.wd",
    "Trapezoid.width", "RateLimiter.rising", "Pulse.width"])  # fmt: skip
def test_what_has_no_negative_side_begins_at_zero(name: str) -> None:
    """Forces, gaps, coefficients of friction, rates of decay, weights, durations."""
    kind, parameter = name.split(".")
    assert {d.min for c, n, d in PARAMETERS if (c.__name__, n) == (kind, parameter)} == {0.0}


UP_TO = [
    (gp.UniversalJoint, "beta", -1.5, 1.5), (gp.DetailedExternalMesh, "alpha", 0.0, 1.5),
    (gp.DetailedExternalMesh, "c_amplitude", -1.0, 1.0),
    (gp.TranslationalPlanetaryUnit, "alpha", 0.0, 1.5), (B.Pulse, "width", 0.0, 100.0), (gp.Clutch, "peak", 1.0, None),
    (gp.OneWayClutch, "peak", 1.0, None), (gp.DetailedExternalMesh, "z_a", 1.0, None), (B.RateLimiter, "falling", None, 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "name", "low", "high"), UP_TO)
def test_limits_of_angles_and_shares_belong_to_the_range(kind: Any, name: str, low: float | None, high: float | None) -> None:
    declared = known(kind)[name]
    assert declared.min == (-math.inf if low is None else low)
    assert declared.max == (math.inf if high is None else high)


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


IN_MODELICA: dict[Any, dict[str, Any]] = {  # defaults of the Modelica Standard Library 4.1.0, where it has any
    gp.Fixed: {"phi0": 0}, gp.Disc: {"delta_phi": 0}, gp.Spring: {"phi_rel0": 0}, gp.SpringDamper: {"phi_rel0": 0},
    gp.ElastoBacklash: {"phi_rel0": 0, "b": 0}, gp.ElastoBacklash2: {"phi_rel0": 0, "b": 0},
    gp.BearingFriction: {"tau_pos": ((0, 1),), "peak": 1}, gp.Brake: {"mu_pos": ((0, 0.5),), "peak": 1, "cgeo": 1},
    gp.Clutch: {"mu_pos": ((0, 0.5),), "peak": 1, "cgeo": 1}, gp.OneWayClutch: {"mu_pos": ((0, 0.5),), "peak": 1, "cgeo": 1},
    gp.LossyGear: {"loss_table": ((0, 1, 1, 0, 0),), "use_support": False, "use_heat_port": False},
    gp.Gearbox: {"loss_table": ((0, 1, 1, 0, 0),), "b": 0, "use_support": False},
    gp.IdealGearR2T: {"use_support_r": False, "use_support_t": False},
    gp.InitializeFlange: {"use_phi_start": True, "use_w_start": True, "use_a_start": True},
    gp.TorqueToAngleAdaptor: {"use_w": True, "use_a": True}, gp.AngleToTorqueAdaptor: {"use_w": True, "use_a": True},
    gp.Position: {"exact": False, "f_crit": 50}, gp.Speed: {"exact": False, "f_crit": 50},
    gp.TorqueStep: {"offset_torque": 0, "start_time": 0}, gp.SignTorque: {"reg": "exp"},
    gp.LinearSpeedDependentTorque: {"torque_direction": True}, gp.QuadraticSpeedDependentTorque: {"torque_direction": True},
    gp.InverseSpeedDependentTorque: {"torque_direction": True}, gp.QuadraticSpeedDependentForce: {"force_direction": True},
    gp.EddyCurrentTorque: {"T_ref": 293.15, "alpha20": 0}, gp.Mass: {"L": 0}, gp.TranslationalFixed: {"s0": 0},
    gp.TranslationalSpring: {"s_rel0": 0}, gp.TranslationalSpringDamper: {"s_rel0": 0},
    B.Add: {"k1": 1, "k2": 1}, B.Add3: {"k1": 1, "k2": 1, "k3": 1}, B.Integrator: {"k": 1}, B.Derivative: {"k": 1, "T": 0.01},
    B.FirstOrder: {"k": 1}, B.SecondOrder: {"k": 1}, B.PI: {"k": 1}, B.PID: {"k": 1, "Ti": 0.5, "Td": 0.1, "Nd": 10},
    B.LimPID: {"controller_type": "PID", "k": 1, "Ti": 0.5, "Td": 0.1, "wp": 1, "wd": 0, "Ni": 0.9, "Nd": 10},
    B.Step: {"height": 1, "offset": 0, "start_time": 0}, B.Ramp: {"height": 1, "offset": 0, "start_time": 0},
    B.Sine: {"amplitude": 1, "phase": 0, "offset": 0, "start_time": 0},
    B.KinematicPTP: {"deltaq": 1, "qd_max": 1, "qdd_max": 1, "start_time": 0},
    B.Pulse: {"amplitude": 1, "width": 50, "n_period": -1, "offset": 0, "start_time": 0},
    B.Trapezoid: {"amplitude": 1, "n_period": -1, "offset": 0, "start_time": 0}, B.CombiTimeTable: {"offset": 0, "start_time": 0},
    B.DeadZone: {"u_max": 1}, B.RateLimiter: {"rising": 1, "Td": 0.001}, B.PadeDelay: {"n": 1},
    B.Sampler: {"start_time": 0}, B.ZeroOrderHold: {"start_time": 0}, B.UnitDelay: {"start_time": 0},
}  # fmt: skip


@pytest.mark.parametrize("kind", IN_MODELICA, ids=lambda kind: kind.__name__)
def test_defaults_are_those_of_the_modelica_standard_library(kind: Any) -> None:
    """A text that leaves a value to Modelica means the same here."""
    assert {name: known(kind)[name].default for name in IN_MODELICA[kind]} == IN_MODELICA[kind]


def test_what_is_added_to_a_law_is_nothing_unless_it_is_given() -> None:
    """Errors, excitations, phases and cubic terms; a controller of one's own begins like Modelica's."""
    added = ("e", "e_rate", "e_sun", "e_ring", "phase0", "c_phase", "c_amplitude", "c_3", "w_ref", "a_ref", "d_phi", "k_phi", "d_sp",
             "d_rp", "k_ring_phi", "phi_start", "w_start", "a_start")  # fmt: skip
    found = [
        (c, n, d) for c in COMPONENTS for n, d in known(c).items() if n in added and isinstance(d, gl.Parameter | gl.Input)
    ]
    zero = [d.default for c, n, d in found if isinstance(d.default, float)]
    assert len(zero) > 30
    assert not any(zero)
    assert known(gp.EddyCurrentTorque)["excitation"].default == 1.0
    same = ("k", "Ti", "wp", "Ni", "Nd")
    assert all(known(B.DiscretePID)[n].default == known(B.LimPID)[n].default for n in same)
    assert known(B.DiscretePID)["Td"].default == known(B.DiscretePID)["start_time"].default == 0.0
    assert known(gp.Move)["k"].default == known(gp.AngleToTorqueAdaptor)["k"].default == 10.0


def test_both_sides_and_all_bearings_of_a_planetary_unit_are_alike_unless_told_otherwise() -> None:
    elastic, planar = known(gp.TorsionalPlanetaryUnit), known(gp.TranslationalPlanetaryUnit)
    assert elastic["K_ring"].default == elastic["K_sun"].default > 0
    assert elastic["C_ring"].default == elastic["C_sun"].default == known(gp.LumpedPlanetaryUnit)["C_v"].default == 0
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


def test_sizes_of_deflections_are_those_of_teeth_and_shafts() -> None:
    """The absolute tolerance of a state is in proportion to its size; a relative speed is that of a vibration at 100 rad/s."""
    for kind in COMPONENTS:
        declarations = known(kind)
        for name, declared in declarations.items():
            if isinstance(declared, gl.Variable) and name.startswith("q") and declared.unit == "m":
                assert declared.nominal == pytest.approx(1e-6), (kind, name)
        for place, speed in (("phi_rel", "w_rel"), ("s_rel", "v_rel")):
            if place in declarations and speed in declarations and declarations[speed].nominal < 1:
                assert declarations[speed].nominal == pytest.approx(100 * declarations[place].nominal), kind
                assert declarations[place].nominal == pytest.approx(1e-4), kind
    assert known(gp.Inertia)["w"].nominal == known(gp.Mass)["v"].nominal == known(gp.Spring)["w_rel"].nominal
    temperature = known(gp.HeatCapacitor)["T"]
    assert 273.15 < temperature.guess < 300.0 <= temperature.nominal < 310.0
