r"""
An engine's map
===============

The torque of an engine is measured over speed and pedal: a map of two variables. ``gl.Table2D`` takes it into the equations of a model,
bilinear in each cell, with exact slopes; ``gl.Table`` does so for a curve, here the pedal over time and the car's resistance over speed.

The engine accelerates a car through a gearbox in one gear. The same equations, written by hand, are solved by SciPy.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

import gearlib as gl
import gearparts as gp

SPEEDS = [80.0, 150.0, 250.0, 400.0, 550.0]  # rad/s
PEDAL = [0.0, 0.3, 0.6, 1.0]
TORQUE = [
    [-15.0, 45.0, 80.0, 100.0],
    [-20.0, 60.0, 110.0, 140.0],
    [-28.0, 65.0, 125.0, 165.0],
    [-40.0, 50.0, 120.0, 170.0],
    [-60.0, 10.0, 80.0, 130.0],
]  # fmt: skip, N.m
FOOT = gl.Table([0.0, 1.0, 1.5, 6.0, 6.5], [0.2, 0.2, 1.0, 1.0, 0.0])  # over time, s
DRAG = gl.Table([0.0, 20.0, 40.0, 60.0], [20.0, 45.0, 130.0, 270.0], "monotone")  # N.m at the wheels over their speed
RATIO, J_ENGINE, J_CAR, W_0 = 6.0, 0.2, 110.0, 120.0


class Car(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        torque = gl.Table2D(SPEEDS, PEDAL, TORQUE)
        self.engine, self.gear = gp.Inertia(J=J_ENGINE, start={"w": W_0}), gp.IdealGear(ratio=RATIO)
        self.car, self.pedal = gp.Inertia(J=J_CAR), gp.blocks.Gain(k=1.0, u=FOOT)
        self.combustion = gp.Torque(tau=torque(self.engine.w, self.pedal.y))
        self.drag = gp.Torque(tau=-DRAG(self.car.w))
        return [
            gl.connect(self.combustion.flange, self.engine.flange_a),
            gl.connect(self.engine.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.car.flange_a),
            gl.connect(self.car.flange_b, self.drag.flange),
        ]


result = gl.simulate(Car(), 10.0, samples=101, rtol=1e-9)
w = result["engine.w"]

drag = PchipInterpolator(DRAG.t, DRAG.y)
columns = np.array(TORQUE).T


def by_hand(t: float, x: np.ndarray) -> list[float]:
    at_speed = [np.interp(x[0], SPEEDS, column) for column in columns]
    driving = np.interp(np.interp(t, FOOT.t, FOOT.y), PEDAL, at_speed)
    return [(driving - drag(x[0] / RATIO) / RATIO) / (J_ENGINE + J_CAR / RATIO**2)]


expected = solve_ivp(by_hand, (0.0, 10.0), [W_0], t_eval=result.time, rtol=1e-9, atol=1e-9, max_step=0.01).y[0]
error = np.abs(w - expected).max() / expected.max()
print(f"engine at {w[0]:.0f} rad/s, at most {w.max():.1f} rad/s, at the end {w[-1]:.1f} rad/s; by hand within {error:.1e}")
assert error < 1e-6
assert result["combustion.tau"].max() > 150.0

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
speed, pedal = np.linspace(SPEEDS[0], SPEEDS[-1], 95), np.linspace(0.0, 1.0, 51)
torque = [[np.interp(p, PEDAL, [np.interp(s, SPEEDS, column) for column in columns]) for s in speed] for p in pedal]
lines = left.contourf(speed, pedal, torque, levels=12, cmap="viridis")
figure.colorbar(lines, ax=left, label="engine torque, N·m")
left.plot(w, np.interp(result.time, FOOT.t, FOOT.y), "w.-", linewidth=1)
left.set(xlabel="engine speed, rad/s", ylabel="pedal")
right.plot(result.time, w, label="engine")
right.plot(result.time, RATIO * result["car.w"], "--", label="car, at the engine's side")
right.set(xlabel="time, s", ylabel="speed, rad/s")
right.legend()
