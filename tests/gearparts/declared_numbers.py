"""What numbers components should declare: bounds that are physical, sizes of teeth and shafts, the defaults that Modelica has."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from gearlib.language.declarations import NO_VALUE, Declared

NOT_NEGATIVE = {"kg", "kg.m2", "N/m", "N.s/m", "N.m/rad", "N.m.s/rad", "J/K", "W/K", "K", "m"}
OF_EITHER_SIGN = {  # a gap or an interference, lengths and places, radii whose sign tells the sense of rotation
    "DetailedExternalMesh.b", "DetailedInternalMesh.b", "IdealRollingWheel.radius", "Mass.L", "PlanarMesh.r_a", "PlanarMesh.r_b",
    "PlanetBearing.e", "TranslationalFixed.s0", "TranslationalSpring.s_rel0", "TranslationalSpringDamper.s_rel0",
}  # fmt: skip
FROM_ZERO = {  # forces, gaps, coefficients of friction, rates of decay, weights, durations, room between limits
    *(f"{kind}.room" for kind in ("LimPID", "DiscretePID", "Limiter", "DeadZone", "Hysteresis")), "Trapezoid.pause",
    *(f"{kind}.fn_max" for kind in ("Brake", "Clutch", "OneWayClutch")), "EddyCurrentTorque.tau_nominal",
    *(f"{kind}.b" for kind in ("ElastoBacklash", "ElastoBacklash2", "ElasticCoupling", "Gearbox")),
    *(f"Detailed{kind}Mesh.{name}" for kind in ("External", "Internal") for name in ("mu", "approach")),
    "Move.k", "AngleToTorqueAdaptor.k", "Position.f_crit", "Speed.f_crit", "DiscretePID.Td", "DiscretePID.wp", "LimPID.wp",
    "LimPID.wd", "Trapezoid.width", "RateLimiter.rising",
}  # fmt: skip
LIMITS = {
    "UniversalJoint.beta": (-1.5, 1.5), "TranslationalPlanetaryUnit.alpha": (0.0, 1.5), "Pulse.width": (0.0, 100.0),
    "RateLimiter.falling": (-math.inf, 0.0), **dict.fromkeys(FROM_ZERO, (0.0, math.inf)),
    **dict.fromkeys(("BearingFriction.peak", "Brake.peak", "Clutch.peak", "OneWayClutch.peak"), (1.0, math.inf)),
    **{f"Detailed{kind}Mesh.{name}": limits for kind in ("External", "Internal")
       for name, limits in (("alpha", (0.0, 1.5)), ("c_amplitude", (-1.0, 1.0)), ("z_a", (1.0, math.inf)))},
}  # fmt: skip

IN_MODELICA: dict[str, dict[str, Any]] = {  # of the Modelica Standard Library 4.1.0, where it has any
    "Fixed": {"phi0": 0}, "Disc": {"delta_phi": 0}, "Spring": {"phi_rel0": 0}, "SpringDamper": {"phi_rel0": 0},
    "ElastoBacklash": {"phi_rel0": 0, "b": 0}, "ElastoBacklash2": {"phi_rel0": 0, "b": 0}, "Gearbox": {"b": 0},
    "BearingFriction": {"peak": 1, "w_small": 1e10}, "Brake": {"peak": 1, "w_small": 1e10, "cgeo": 1},
    "Clutch": {"peak": 1, "w_small": 1e10, "cgeo": 1},
    "OneWayClutch": {"peak": 1, "w_small": 1e10, "cgeo": 1}, "Position": {"f_crit": 50}, "Speed": {"f_crit": 50},
    "TorqueStep": {"offset_torque": 0, "start_time": 0}, "EddyCurrentTorque": {"T_ref": 293.15, "alpha20": 0}, "Mass": {"L": 0},
    "TranslationalFixed": {"s0": 0}, "TranslationalSpring": {"s_rel0": 0}, "TranslationalSpringDamper": {"s_rel0": 0},
    "Add": {"k1": 1, "k2": 1}, "Add3": {"k1": 1, "k2": 1, "k3": 1}, "Integrator": {"k": 1}, "Derivative": {"k": 1, "T": 0.01},
    "FirstOrder": {"k": 1}, "SecondOrder": {"k": 1}, "PI": {"k": 1}, "PID": {"k": 1, "Ti": 0.5, "Td": 0.1, "Nd": 10},
    "LimPID": {"k": 1, "Ti": 0.5, "Td": 0.1, "wp": 1, "wd": 0, "Ni": 0.9, "Nd": 10},
    "Step": {"height": 1, "offset": 0, "start_time": 0}, "Ramp": {"height": 1, "offset": 0, "start_time": 0},
    "Sine": {"amplitude": 1, "phase": 0, "offset": 0, "start_time": 0}, "CombiTimeTable": {"offset": 0, "start_time": 0},
    "KinematicPTP": {"deltaq": 1, "qd_max": 1, "qdd_max": 1, "start_time": 0},
    "Pulse": {"amplitude": 1, "width": 50, "n_period": -1, "offset": 0, "start_time": 0},
    "Trapezoid": {"amplitude": 1, "n_period": -1, "offset": 0, "start_time": 0},
    "RateLimiter": {"rising": 1, "Td": 0.001}, "Sampler": {"start_time": 0}, "ZeroOrderHold": {"start_time": 0},
    "UnitDelay": {"start_time": 0},
}  # fmt: skip
LIKE_MODELICA: dict[str, dict[str, Any]] = {  # what it has not, like what it has
    "Chirp": {"amplitude": 1, "offset": 0, "start_time": 0}, "Move": {"k": 10.0}, "AngleToTorqueAdaptor": {"k": 10.0},
    "DiscretePID": {"k": 1, "Ti": 0.5, "Td": 0, "wp": 1, "Ni": 0.9, "Nd": 10, "start_time": 0},
}  # fmt: skip
USUAL: dict[str, dict[str, Any]] = {  # of steel teeth and bearings, and of greased teeth
    **{f"{kind}PlanetaryUnit": {"K_ring": 1e8, "K_sun": 1e8} for kind in ("Lumped", "Torsional")},
    "TranslationalPlanetaryUnit": {"K_ring": 1e8, "K_sun": 1e8, **dict.fromkeys(("k_s", "k_r", "k_h", "k_p"), 1e9)},
    **{f"Detailed{kind}Mesh": {"mu": 0.05, "v_smooth": 1e-3} for kind in ("External", "Internal")},
}
NOTHING = {  # errors, excitations, phases, and parts of a law that are there when they are given
    "e", "e_rate", "e_sun", "e_ring", "phase0", "c_phase", "c_amplitude", "c_3", "d_phi", "k_phi", "k_ring_phi", "phi_start", "w_start",
    "a_start", "w_ref", "a_ref", "phi_rel0", "b", "d", "d_sp", "d_rp", "C_ring", "C_sun",
}  # fmt: skip
SIZES = {"phi_rel": 1e-4, "s_rel": 1e-4, "w_rel": 1e-2, "v_rel": 1e-2}  # a vibration at 100 rad/s


def misfits(kind: str, declared: Declared) -> Iterator[str]:
    """What a component of a kind declares otherwise than it should."""
    usual = IN_MODELICA.get(kind, {}) | LIKE_MODELICA.get(kind, {}) | USUAL.get(kind, {})
    for name, parameter in declared.parameters.items():
        path = f"{kind}.{name}"
        physical = (0.0, math.inf) if parameter.unit in NOT_NEGATIVE else None
        limits = None if path in OF_EITHER_SIGN else LIMITS.get(path, physical)
        if limits is not None and (parameter.min, parameter.max) != limits:
            yield f"{path} is bounded by {parameter.min:g} and {parameter.max:g}"
        if parameter.default != usual.get(name, parameter.default):
            yield f"{path} is {parameter.default} by default"
    for name, each in (declared.parameters | declared.variables).items():
        default = getattr(each, "default", NO_VALUE)
        if name in NOTHING and isinstance(default, float | int) and default != 0:
            yield f"{kind}.{name} is {default} by default"
    for name, variable in declared.variables.items():
        size = 1e-6 if name.startswith("q") and variable.unit == "m" else SIZES.get(name)
        preferred = variable.state in ("prefer", "default")
        sizes = (size, 1.0)  # or that of any angle
        if size is not None and preferred and not any(math.isclose(variable.nominal, known) for known in sizes):
            yield f"the size of {kind}.{name} is {variable.nominal:g}"
