"""The same trains in other units of torque and time, whose numbers are others by powers of two: every answer is the same in its units."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

SCALES = ((20, -20), (-40, 20))
NONE, TORQUE, SPEED, TIME, STIFFNESS, DAMPING, INERTIA = (0, 0), (1, 0), (0, -1), (0, 1), (1, 0), (1, 1), (1, 2)
KINDS = ("linear", "cubic", "backlash", "clutch")
FREQUENCY, RUN = 30.0, 0.5  # rad/s, s


class Train(gl.Component):
    """A driven body, a coupling, a gear, and a body with a damper; ``k``: binary exponents of the units of torque and time."""

    k = gl.Structural((0, 0))
    kind = gl.Structural("linear")
    w = gl.Parameter("1/s", default=1.0)  # frequency of the excitation

    def size(self, exponents: tuple[int, int]) -> float:
        return float(2.0 ** np.dot(exponents, self.k))

    def assemble(self) -> list[Any]:
        stiffness, damping, torque = self.size(STIFFNESS), self.size(DAMPING), self.size(TORQUE)
        self.drive = gp.Torque(tau=torque * (3.0 + 0.9 * gl.sin(self.w * gl.time)))
        self.motor, self.pinion, self.load = (
            gp.Inertia(J=J * self.size(INERTIA), nominal={"w": 0.01 * self.size(SPEED)}) for J in (0.1, 0.05, 0.4)
        )
        c, d = 300.0 * stiffness, 0.4 * damping
        slow = {"w_rel": 0.01 * self.size(SPEED)}
        self.coupling = {
            "linear": lambda: gp.SpringDamper(c=c, d=d, nominal=slow),
            "cubic": lambda: gp.CubicSpringDamper(c=c, d=d, c_3=1e5 * stiffness, nominal=slow),
            "backlash": lambda: gp.ElastoBacklash2(c=c, d=d, b=0.02, nominal=slow),
            "clutch": lambda: gp.Clutch(fn_max=4.0 * torque, f_normalized=1.0, nominal=slow),
        }[self.kind]()
        self.gear = gp.IdealGear(ratio=-2.5)
        self.shaft = gp.SpringDamper(c=2e3 * stiffness, d=0.3 * damping, nominal=slow)
        self.brake, self.ground = gp.Damper(d=0.8 * damping), gp.Fixed()
        return [
            gl.connect(self.drive.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.pinion.flange_a),
            gl.connect(self.pinion.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
        ]


@cache
def compiled(kind: str, k: tuple[int, int]) -> gl.System:
    return gl.compile(Train(kind=kind, k=k))


def run(kind: str, k: tuple[int, int], **options: Any) -> gl.Result:
    second = 2.0 ** k[1]
    return compiled(kind, k).simulate(RUN * second, samples=6, parameters={"w": FREQUENCY / second}, **options)


def motion(method: str, rtol: float = 1e-6) -> Callable[..., dict[str, Any]]:
    def found(kind: str, k: tuple[int, int]) -> dict[str, Any]:
        result = run(kind, k, method=method, rtol=rtol)
        torque, speed = 2.0 ** k[0], 2.0 ** -k[1]
        # A clutch compares the rounding of a speed with one that counts as rest
        events = 0 if kind == "clutch" else len(result.events)
        return {"events": events, "load": result["load.w"] / speed, "twist": result["shaft.tau"] / torque}

    return found


def sensitivities(kind: str, k: tuple[int, int]) -> dict[str, Any]:
    result = run(kind, k, sensitivities=["brake.d"], rtol=1e-9)
    return {"d load / d brake": result.sensitivity("load.w", "brake.d") * 2.0 ** (k[0] + 2 * k[1])}


def energy(kind: str, k: tuple[int, int]) -> dict[str, Any]:
    return {"closes": run(kind, k, audit=True).stats["energy_residual"] < 1e-4}


def linear_model(kind: str, k: tuple[int, int]) -> dict[str, Any]:
    model, second = compiled(kind, k).linearize(parameters={"w": 0.0}), 2.0 ** k[1]
    states = model.state_labels
    size = np.array([1 / second if name.endswith(".w") or name.endswith(".v") else 1.0 for name in states])
    return {"states": tuple(states), "A": model.A / size[:, None] * size * second}


def kinematics(kind: str, k: tuple[int, int]) -> dict[str, Any]:
    system = compiled(kind, k)
    return {"mobility": gl.mobility(system), "ratio": gl.speed_ratio(system, "pinion.w", "load.w")}


def statics(kind: str, k: tuple[int, int]) -> dict[str, Any]:
    torque, speed = 2.0 ** k[0], 2.0 ** -k[1]
    flow = compiled(kind, k).power_flow(torques={"drive.tau": 3.0 * torque})
    return {"load": flow["load.flange_a"].speed / speed, "brake": flow["brake.flange_a"].torque / torque}


def steady(kind: str, k: tuple[int, int]) -> dict[str, Any]:
    found = gl.steady_state(compiled(kind, k), parameters={"w": 0.0})
    return {"load": np.array(found["load.w"]) * 2.0 ** k[1]}


def periodic(kind: str, k: tuple[int, int]) -> dict[str, Any]:
    second = 2.0 ** k[1]
    branch = gl.harmonic_balance(
        compiled(kind, k), 30.0 / second, 60.0 / second, frequency="w", outputs=["shaft.tau"], points=30, step=0.1
    )
    return {
        "points": len(branch.omega),
        "omega": branch.omega * second,
        "shaft": branch.amplitude("shaft.tau", 1) / 2.0 ** k[0],
    }


ANSWERS: dict[str, tuple[Callable[..., dict[str, Any]], float, tuple[str, ...]]] = {
    "auto": (motion("auto"), 1e-4, KINDS),
    "rk5": (motion("rk5"), 1e-4, KINDS),
    "ida": (motion("ida"), 1e-4, KINDS),
    "exact": (motion("exact"), 1e-12, ("linear",)),
    "taylor": (motion("taylor", 1e-9), 1e-7, ("linear", "cubic", "backlash")),
    "sensitivities": (sensitivities, 1e-5, KINDS),
    "energy": (energy, 0.0, KINDS),
    "linear model": (linear_model, 1e-9, KINDS),
    "kinematics": (kinematics, 1e-12, ("linear", "cubic", "backlash")),
    "statics": (statics, 1e-9, ("linear", "cubic")),
    "steady": (steady, 1e-8, ("linear", "cubic")),
    "periodic": (periodic, 1e-6, ("linear", "cubic")),
}


@pytest.mark.parametrize(("asked", "kind"), [(asked, kind) for asked, (_, _, kinds) in ANSWERS.items() for kind in kinds])
def test_answers_are_the_same_in_other_units(asked: str, kind: str) -> None:
    answer, accuracy, _ = ANSWERS[asked]
    plain = answer(kind, (0, 0))
    for k in SCALES:
        other = answer(kind, k)
        for name, value in plain.items():
            if isinstance(value, (int, tuple, bool)):
                assert other[name] == value, (name, k)
            else:
                assert other[name] == pytest.approx(value, rel=0, abs=accuracy * np.abs(value).max()), (name, k)
