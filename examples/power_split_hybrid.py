r"""
A power-split hybrid with PI control
====================================

A planetary set divides the engine's power: the engine drives the carrier, a generator holds the sun, the ring drives the wheels
together with a motor. Whatever the car's speed, the generator's controller can put the engine at the speed that it is asked for; the
motor makes up for what the ring lacks of the driver's torque. The gearbox has no clutch and no gears to shift.

The checks: Willis' equation and the powers at the set, and the same equations written by hand for SciPy.
"""

import math

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp

I_SET, FINAL = 78 / 30, 3.9  # ring over sun, ring over wheels
J_ENGINE, J_GENERATOR, J_MOTOR, J_CAR = 0.18, 0.025, 0.03, 1500 * 0.31**2  # kg.m2; the car's mass at its wheels
K, T = 1.6, 0.35  # PI control of the engine's speed: N.m.s/rad, s
ENGINE = gl.Table([0.0, 1.0, 1.6, 9.0, 9.4, 14.0], [0.0, 0.0, 95.0, 95.0, 60.0, 60.0])  # torque, N.m
ASKED = gl.Table([0.0, 1.0, 2.0, 9.0, 10.0, 14.0], [105.0, 105.0, 250.0, 250.0, 180.0, 180.0])  # speed of the engine, rad/s
DRIVER = gl.Table([0.0, 0.5, 1.0, 8.0, 9.0, 14.0], [0.0, 250.0, 900.0, 700.0, 250.0, 250.0])  # torque at the wheels, N.m


class Hybrid(gl.Component):
    """Engine at the carrier, generator at the sun, motor and final drive at the ring."""

    def assemble(self):
        self.set, self.final = gp.IdealPlanetary(ratio=I_SET), gp.IdealGear(ratio=FINAL)
        self.engine, self.generator = gp.Inertia(J=J_ENGINE, start={"w": 105.0}), gp.Inertia(J=J_GENERATOR)
        self.motor, self.car = gp.Inertia(J=J_MOTOR), gp.Inertia(J=J_CAR, start={"w": 0.0})
        self.combustion = gp.Torque(tau=gl.Table(ENGINE.t, ENGINE.y))
        self.governor = gp.blocks.PI(k=K, T=T, u=ASKED(gl.time) - self.engine.w)
        # a torque on the sun holds the engine: more of it against the engine's turning brakes it
        self.current = gp.Torque(tau=self.governor.y - ENGINE(gl.time) / (1 + I_SET))
        self.ring_torque = I_SET * (ENGINE(gl.time) / (1 + I_SET))
        self.boost = gp.Torque(tau=DRIVER(gl.time) / FINAL - self.ring_torque)
        self.road = gp.Torque(tau=-(12.0 + 0.4 * self.car.w**2 * 0.31**3) * gl.tanh(self.car.w))
        return [
            gl.connect(self.combustion.flange, self.engine.flange_a),
            gl.connect(self.engine.flange_b, self.set.carrier),
            gl.connect(self.current.flange, self.generator.flange_a),
            gl.connect(self.generator.flange_b, self.set.sun),
            gl.connect(self.set.ring, self.motor.flange_a, self.boost.flange),
            gl.connect(self.motor.flange_b, self.final.flange_a),
            gl.connect(self.final.flange_b, self.car.flange_a),
            gl.connect(self.car.flange_b, self.road.flange),
        ]


times = np.linspace(0.0, 14.0, 1401)
names = [
    "engine.w",
    "generator.w",
    "motor.w",
    "car.w",
    "current.tau",
    "boost.tau",
    "set.sun.tau",
    "set.ring.tau",
    "set.carrier.tau",
]
run = gl.simulate(Hybrid(), 14.0, times=times, rtol=1e-9, outputs=names)

# %%
# Checks at the set
# -----------------

willis = run["generator.w"] + I_SET * run["motor.w"] - (1 + I_SET) * run["engine.w"]
powers = {
    name: run[f"set.{name}.tau"] * run[f"{body}.w"]
    for name, body in (("sun", "generator"), ("carrier", "engine"), ("ring", "motor"))
}
rest = np.abs(sum(powers.values())).max()
print(f"Willis' equation holds within {np.abs(willis).max():.1e} rad/s, the set's powers add up within {rest:.1e} W")
assert np.abs(willis).max() < 1e-6
assert rest < 1e-6 * max(np.abs(p).max() for p in powers.values())

# %%
# By hand
# -------
# Two speeds are free, that of the engine and that of the car. With the sun's torque :math:`\tau` the ring has :math:`i \tau` and the
# carrier :math:`-(1 + i) \tau`.


def by_hand(t, x):
    engine, car, integral = x
    torque, driver = np.interp(t, ENGINE.t, ENGINE.y), np.interp(t, DRIVER.t, DRIVER.y)
    u = np.interp(t, ASKED.t, ASKED.y) - engine
    current = K * (integral + u) - torque / (1 + I_SET)
    boost = driver / FINAL - I_SET * torque / (1 + I_SET)
    road = -(12.0 + 0.4 * car**2 * 0.31**3) * math.tanh(car)
    mass = np.array([
        [J_ENGINE + J_GENERATOR * (1 + I_SET) ** 2, -J_GENERATOR * (1 + I_SET) * I_SET * FINAL],
        [-J_GENERATOR * (1 + I_SET) * I_SET * FINAL, J_CAR + (J_MOTOR + J_GENERATOR * I_SET**2) * FINAL**2],
    ])  # fmt: skip
    force = [torque + (1 + I_SET) * current, FINAL * boost - I_SET * FINAL * current + road]
    return [*np.linalg.solve(mass, force), u / T]


own = solve_ivp(by_hand, (0, 14.0), [105.0, 0.0, 0.0], "DOP853", times, rtol=1e-10, atol=1e-10, max_step=0.02)
apart = {name: np.abs(y - run[f"{name}.w"]).max() for name, y in zip(("engine", "car"), own.y)}
print(f"SciPy's run by hand: engine within {apart['engine']:.1e}, car within {apart['car']:.1e} rad/s")
assert max(apart.values()) < 1e-4

# %%

figure, (above, middle, below) = plt.subplots(3, 1, sharex=True, figsize=(8, 7.5), layout="constrained")
for name, label in (("engine", "engine"), ("generator", "generator"), ("motor", "ring and motor")):
    above.plot(times, run[f"{name}.w"] * 30 / math.pi, label=label)
above.plot(ASKED.t, np.array(ASKED.y) * 30 / math.pi, color="black", ls=":", label="engine, asked for")
above.set_ylabel("speed, 1/min")
middle.plot(times, run["engine.w"] * np.interp(times, ENGINE.t, ENGINE.y) / 1e3, label="engine")
middle.plot(times, run["current.tau"] * run["generator.w"] / 1e3, label="generator")
middle.plot(times, run["boost.tau"] * run["motor.w"] / 1e3, label="motor")
middle.axhline(0, color="0.6", lw=0.8)
middle.set_ylabel("power into the train, kW")
below.plot(times, run["car.w"] * 0.31 * 3.6, color="black")
below.set(xlabel="time, s", ylabel="car, km/h")
above.legend(fontsize=8, ncols=2)
middle.legend(fontsize=8)

# %%
# The gearbox as engineers draw it:

Hybrid().scheme()
