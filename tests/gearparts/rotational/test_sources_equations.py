"""Torques over speed and time at numbers, at and around the speeds and instants at which the laws change."""

from __future__ import annotations

import math

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits, powers, right_side

NOMINAL = {"tau_nominal": -6.0, "w_nominal": 8.0, "w0": 2.0}
SPEEDS = (-16.0, -4.0, -2.0, -0.5, 0.0, 0.5, 2.0, 4.0, 16.0)


def sign(w: float) -> float:
    return math.copysign(1.0, w) if w else 0.0


@pytest.mark.parametrize("w", SPEEDS)
@pytest.mark.parametrize("torque_direction", [False, True])
def test_torques_grow_with_the_speed_or_its_square_in_one_sense_or_both(w: float, torque_direction: bool) -> None:
    """A load of 6 N.m at 8 rad/s."""
    side = 1.0 if torque_direction else sign(w)
    linear = gp.LinearSpeedDependentTorque(tau_nominal=-6.0, w_nominal=8.0, torque_direction=torque_direction)
    assert right_side(linear, "tau", w=w, **NOMINAL) == -0.75 * abs(w) * side
    quadratic = gp.QuadraticSpeedDependentTorque(tau_nominal=-6.0, w_nominal=8.0, torque_direction=torque_direction)
    assert right_side(quadratic, "tau", w=w, **NOMINAL) == -6.0 / 64.0 * w**2 * side


@pytest.mark.parametrize("w", SPEEDS)
@pytest.mark.parametrize("torque_direction", [False, True])
def test_a_torque_of_constant_power_has_another_law_below_a_speed(w: float, torque_direction: bool) -> None:
    """48 W from 2 rad/s on; below, the torque at that speed, or the nominal one in proportion to the speed as in Modelica."""
    part = gp.InverseSpeedDependentTorque(**NOMINAL, torque_direction=torque_direction)
    if abs(w) >= 2.0:
        expected = -48.0 / (abs(w) if torque_direction else w)
    else:
        expected = -24.0 if torque_direction else -6.0 * w / 2.0
    assert right_side(part, "tau", w=w, **NOMINAL) == expected


@pytest.mark.parametrize("w", [*SPEEDS, 1.0, -1.0])
def test_the_sign_of_the_speed_is_smoothed_near_standstill(w: float) -> None:
    x = w / 2.0
    whole = -6.0 * sign(w)
    laws = {
        "exp": -6.0 * (2 / (1 + math.exp(min(-x / 0.01, 700.0))) - 1), "sine": -6.0 * math.sin(math.pi * x / 2), "linear": -6.0 * x,
        "cosine": whole * (1 - math.cos(math.pi * x / 2)),
    }  # fmt: skip
    for reg, law in laws.items():
        expected = whole if abs(x) >= 1 and reg != "exp" else law
        part = gp.SignTorque(tau_nominal=-6.0, w0=2.0, reg=reg)
        assert right_side(part, "tau", w=w, **NOMINAL) == pytest.approx(expected, abs=1e-14), reg


def test_near_standstill_the_exponential_law_is_a_hundredth_as_wide() -> None:
    part = gp.SignTorque(tau_nominal=-6.0, w0=2.0)
    assert right_side(part, "tau", w=0.02, **NOMINAL) == pytest.approx(-6.0 * (2 / (1 + math.exp(-1.0)) - 1), rel=1e-13)


def test_a_torque_steps_at_its_time() -> None:
    part = gp.TorqueStep(step_torque=3.0)
    values = {"step_torque": 3.0, "offset_torque": -1.0, "start_time": 0.5}
    assert [right_side(part, "tau", time=t, **values) for t in (0.25, 0.5, 0.75)] == [-1.0, 2.0, 2.0]
    assert right_side(part, "flange.tau", tau=2.0) == -2.0


@pytest.mark.parametrize("use_support", [False, True])
def test_torques_drive_the_shaft_and_take_their_reaction_from_the_housing(use_support: bool) -> None:
    torques = {"flange.tau": -2.5, "support.tau": 2.5, "tau": 2.5, "tau_constant": 2.5}
    assert misfits(gp.Torque(tau=2.5, use_support=use_support), torques) == []
    assert misfits(gp.ConstantTorque(tau_constant=2.5, use_support=use_support), torques) == []
    assert misfits(gp.Torque2(), {"tau": 2.5, "flange_a.tau": 2.5, "flange_b.tau": -2.5}) == []
    turning = {"w": 3.0, "der(flange.phi)": 4.0 if use_support else 3.0, "der(support.phi)": 1.0, "w0": 2.0, "tau_nominal": 2.5}
    for kind, more in ((gp.SignTorque, {"w0": 2.0, "reg": "linear"}), (gp.LinearSpeedDependentTorque, {"w_nominal": 3.0})):
        part = kind(tau_nominal=2.5, use_support=use_support, **more)
        assert misfits(part, torques | turning | {"w_nominal": 3.0}) == []


def test_what_brakes_dissipates_and_what_drives_supplies() -> None:
    part = gp.LinearSpeedDependentTorque(tau_nominal=-6.0, w_nominal=8.0)
    for tau, w, heat, supplied in ((2.0, 3.0, 0.0, 6.0), (-2.0, 3.0, 6.0, 0.0), (2.0, -3.0, 6.0, 0.0), (-2.0, -3.0, 0.0, 6.0)):
        assert powers(part, {"tau": tau, "w": w}) == (0.0, heat, supplied)


@pytest.mark.parametrize("use_support", [False, True])
@pytest.mark.parametrize("use_heat_port", [False, True])
def test_an_eddy_current_brake_has_kloss_s_law_at_its_disc_s_temperature(use_support: bool, use_heat_port: bool) -> None:
    """At 373.15 K a disc of 0.004/K at 293.15 K has 1.4 times the resistance at 273.15 K: 1.32 over 0.92."""
    part = gp.EddyCurrentTorque(tau_nominal=5.0, w_nominal=4.0, use_support=use_support, use_heat_port=use_heat_port)
    resistance = 1.32 / 0.92
    w = 0.5 * 4.0 * resistance  # at half the speed of the largest torque
    tau = 2 * 5.0 * 0.6**2 * 0.5 / 1.25
    values = {
        "tau_nominal": 5.0, "w_nominal": 4.0, "T_ref": 273.15, "alpha20": 0.004, "T": 373.15, "heat_port.T": 373.15,
        "excitation": 0.6, "w": w, "der(flange.phi)": w + 1.0 * use_support, "der(support.phi)": 1.0,
        "resistance": resistance, "w_normalized": 0.5, "tau": tau, "flange.tau": tau, "support.tau": -tau,
        "loss_power": tau * w, "heat_port.Q_flow": -tau * w,
    }  # fmt: skip
    assert misfits(part, values) == []
    assert powers(part, values) == (0.0, tau * w, 0.0)
