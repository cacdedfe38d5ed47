r"""
Maps of an engine and of a motor
================================

The torque of an engine is measured over speed and pedal: a map of two variables. ``gl.Table2D`` takes it into the equations of a model,
bilinear in each cell, with exact slopes; ``gl.Table`` does so for a curve, here the pedal over time and the car's resistance over speed.

The engine accelerates a car through a gearbox in one gear; then an electric motor does, whose torque is limited over its speed, and whose
losses are a map of speed and torque. The same equations, written by hand, are solved by SciPy.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

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

# %%
# The motor
# ---------
# Up to its base speed it gives its full torque, above it its full power. What the battery gives is the power on the shaft and the losses.
MOTOR_SPEEDS = [0.0, 200.0, 400.0, 800.0]  # rad/s
LIMIT = gl.Table([0.0, 300.0, 400.0, 500.0, 600.0, 800.0], [150.0, 150.0, 112.5, 90.0, 75.0, 56.25])  # N.m
MOTOR_TORQUES = [0.0, 60.0, 150.0]  # N.m
LOSSES = [[100.0, 600.0, 3000.0], [400.0, 900.0, 3500.0], [1000.0, 1800.0, 4500.0], [2800.0, 3900.0, 7500.0]]  # W
MOTOR_RATIO, J_ROTOR = 9.0, 0.05


class ElectricCar(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.rotor, self.gear = gp.Inertia(J=J_ROTOR, start={"w": 1.0}), gp.IdealGear(ratio=MOTOR_RATIO)
        self.car, self.pedal = gp.Inertia(J=J_CAR), gp.blocks.Gain(k=1.0, u=FOOT)
        self.drive = gp.Torque(tau=self.pedal.y * LIMIT(self.rotor.w))
        self.drag = gp.Torque(tau=-DRAG(self.car.w))
        losses = gl.Table2D(MOTOR_SPEEDS, MOTOR_TORQUES, LOSSES)(self.rotor.w, self.drive.tau)
        self.battery = gp.blocks.Integrator(u=self.drive.tau * self.rotor.w + losses)  # J
        return [
            gl.connect(self.drive.flange, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.car.flange_a),
            gl.connect(self.car.flange_b, self.drag.flange),
        ]


electric = gl.simulate(ElectricCar(), 10.0, samples=101, rtol=1e-9)
loss = RegularGridInterpolator((MOTOR_SPEEDS, MOTOR_TORQUES), LOSSES)


def motor_by_hand(t: float, x: np.ndarray) -> list[float]:
    driving = np.interp(t, FOOT.t, FOOT.y) * np.interp(x[0], LIMIT.t, LIMIT.y)
    rate = (driving - drag(x[0] / MOTOR_RATIO) / MOTOR_RATIO) / (J_ROTOR + J_CAR / MOTOR_RATIO**2)
    return [rate, driving * x[0] + loss((x[0], driving))]


solved = solve_ivp(motor_by_hand, (0.0, 10.0), [1.0, 0.0], t_eval=electric.time, rtol=1e-8, atol=1e-6, max_step=0.05).y
for name, values in zip(("rotor.w", "battery.y"), solved, strict=True):
    assert np.abs(electric[name] - values).max() < 2e-6 * values.max()
kinetic = 0.5 * (J_ROTOR * electric["rotor.w"][-1] ** 2 + J_CAR * electric["car.w"][-1] ** 2)
print(
    f"motor at the end {electric['rotor.w'][-1]:.1f} rad/s; the battery gave {electric['battery.y'][-1] / 1e3:.1f} kJ, "
    f"of which {kinetic / 1e3:.1f} kJ move the car"
)

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
