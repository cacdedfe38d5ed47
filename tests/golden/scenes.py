"""Thirty scenes of every kind that gearlib solves, each small enough to be read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import gearlib as gl
import gearparts as gp
from tests.benchmarks.scenes import Chain, Star, Trains, Tree
from tests.gearparts import msl_examples, msl_hybrid_examples
from tests.gearparts.planetary.test_gear_sets import RAVIGNEAUX, SIMPSON, Gearbox
from tests.gearparts.planetary.test_planetary_levels import LEVELS, driven
from tests.run.test_constrained import CarAxis, Pendulum
from tests.test_acceptance import RigidLoop


@dataclass(frozen=True)
class Golden:
    """A scene, and how it is run."""

    make: Callable[[], gl.Component]
    t_end: float
    outputs: tuple[str, ...] | None = None
    options: dict[str, Any] = field(default_factory=dict)


class Thermostat(gl.Component):
    """A discrete variable with hysteresis, and a reinitialised state."""

    T = gl.Variable("K", "temperature", start=20.0)
    worn = gl.Variable("1", "what each switching adds to, and time takes from", start=0.0)
    on = gl.Discrete("heater", start=1.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.T), gl.Piecewise((2.0, gl.holds(self.on)), (-1.0, True))),
            gl.Eq(gl.der(self.worn), -self.worn),
            gl.Eq(self.on, gl.Piecewise((1, self.T < 18.0), (0, self.T > 22.0), (gl.pre(self.on), True))),
            gl.When(self.T > 22.0, gl.reinit(self.worn, self.worn + 1.0)),
        ]


class Rattle(gl.Component):
    """A gear pair with backlash under a torque that changes its sign."""

    def assemble(self) -> list[Any]:
        self.torque = gp.Torque(tau=2.0 * gl.sin(40 * gl.time))
        self.pinion, self.wheel = gp.Inertia(J=0.01), gp.Inertia(J=0.1)
        self.mesh = gp.DetailedExternalMesh(r_a=0.05, r_b=0.1, c=1e7, d=500.0, b=1e-4, backlash=True)
        self.drag, self.ground = gp.Damper(d=0.1), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.pinion.flange_a),
            gl.connect(self.pinion.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.drag.flange_a),
            gl.connect(self.drag.flange_b, self.ground.flange),
        ]


class MeasuredTorque(gl.Component):
    """Two bodies and a shaft whose torque is an unbound input."""

    def assemble(self) -> list[Any]:
        self.torque, self.motor, self.load = gp.Torque(), gp.Inertia(J=0.1), gp.Inertia(J=2.0)
        self.shaft, self.fan = gp.SpringDamper(c=1e3, d=2.0), gp.QuadraticSpeedDependentTorque(tau_nominal=-1.0, w_nominal=10.0)
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.fan.flange),
        ]


def gearbox(kind: type[gl.Component], values: dict[str, float], held: str, torque: str) -> Golden:
    inputs = {f"{name}_torque.tau": 1.0 if name == torque else 0.0 for name in shafts(kind)}
    return Golden(lambda: Gearbox(kind=kind, values=tuple(values.items()), held=(held,)), 1.0, None, {"inputs": inputs})


def shafts(kind: type[gl.Component]) -> list[str]:
    system = gl.compile(Gearbox(kind=kind, values=tuple({gp.Simpson: SIMPSON, gp.Ravigneaux: RAVIGNEAUX}[kind].items())))
    return [name.removesuffix("_torque.tau") for name in system.inputs]


TABLE = gl.Table([0.0, 0.1, 0.25, 0.5, 1.0], [0.0, 10.0, 4.0, 6.0, 6.0])
CAR = {"xl": 0.0, "yl": 0.5, "xr": 1.0, "yr": 0.5, "ul": -0.5, "vl": 0.0, "ur": -0.5, "vr": 0.0}

ERROR = (("error_terms", ((1.0, 1e-6, 0.0),)),)

SCENES: dict[str, Golden] = {
    "zhou_cui_2022": Golden(lambda: gp.ZhouCui2022(tau_in=100.0), 0.05),
    "zhou_cui_2022_w_out": Golden(lambda: gp.ZhouCui2022(tau_in=100.0), 0.05, ("w_out",)),
    "zhou_cui_2022_error": Golden(
        lambda: gp.ZhouCui2022(tau_in=100.0, e_amplitude=1e-5, e_omega=2000.0), 0.02, ("q_ring", "q_sun")
    ),
    "chain": Golden(lambda: Chain(N=10), 0.2),
    "chain_one_output": Golden(lambda: Chain(N=10), 0.2, ("body[9].w",)),
    "long_chain": Golden(lambda: Chain(N=150), 0.1, ("body[149].w",)),
    "star": Golden(lambda: Star(N=6), 0.2),
    "tree": Golden(lambda: Tree(N=40), 0.05),
    "trains": Golden(lambda: Trains(N=3), 0.01),
    "rigid_loop": Golden(lambda: RigidLoop(), 1.0, ("carrier.w", "load.w")),
    "first": Golden(msl_examples.first, 0.2),
    "rolling_wheel": Golden(msl_examples.RollingWheel, 1.0),
    "elastic_bearing": Golden(msl_examples.ElasticBearing, 1.0),
    "eddy_current_brake": Golden(msl_examples.EddyCurrentBrake, 1.0),
    "compare_braking_torque": Golden(msl_examples.CompareBrakingTorque, 3.0),
    "backlash": Golden(msl_hybrid_examples.Backlash, 0.5),
    "friction": Golden(msl_hybrid_examples.Friction, 1.0),
    "simple_gear_shift": Golden(msl_hybrid_examples.SimpleGearShift, 3.0),
    "lossy_gear": Golden(msl_hybrid_examples.LossyGearDemo1, 0.5),
    "coupled_clutches": Golden(msl_hybrid_examples.CoupledClutches, 1.2),
    "one_way_clutch": Golden(msl_hybrid_examples.OneWayClutch, 2.0),
    "heat_losses": Golden(msl_hybrid_examples.HeatLosses, 0.5),
    "simpson": gearbox(gp.Simpson, SIMPSON, "rear_carrier", "ring"),
    "ravigneaux": gearbox(gp.Ravigneaux, RAVIGNEAUX, "large_sun", "small_sun"),
    "planetary_lossy": Golden(lambda: driven(**LEVELS["lossy"]), 0.2),
    "planetary_detailed": Golden(lambda: driven(**{**LEVELS["detailed"], "sun_details": ERROR}), 0.01),
    "thermostat": Golden(Thermostat, 10.0),
    "rattle": Golden(Rattle, 0.1),
    "measured_torque": Golden(MeasuredTorque, 1.0, None, {"inputs": {"torque.tau": TABLE}}),
    "car_axis": Golden(lambda: CarAxis(start=CAR), 1.0),
    "pendulum": Golden(lambda: Pendulum(start={"x": 1.0, "y": 0.0, "u": 0.0, "v": 0.0}), 1.0),
}
