r"""
Gear whine in a run-up
======================

The teeth of a gear pair are not perfect, and they bend: the transmission error repeats with every tooth. While the drive runs up, its
frequency sweeps over the natural frequencies, and where it meets one the gears whine. A waterfall diagram shows it: over orders of the
pinion the excitation stands upright, at its number of teeth and twice that, and lights up at the resonances.

The check: along the order of the teeth the amplitudes are those of the frequency response, computed without any simulation.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

Z_PINION, Z_WHEEL, ERROR, SECOND = 23, 57, 3e-6, 0.8e-6  # teeth, m
R_PINION, R_WHEEL = 0.0345, 0.0855
W_START, W_END, T_END = 2 * math.pi * 8, 2 * math.pi * 60, 12.0  # rad/s, s


class Drive(gl.Component):
    """Motor on a soft shaft, gear pair, machine."""

    e_rate = gl.Input("m/s", "rate of the transmission error", default=0.0)

    def assemble(self):
        ramp = W_START + (W_END - W_START) * gl.time / T_END
        angle = W_START * gl.time + (W_END - W_START) * gl.time**2 / (2 * T_END)
        teeth = Z_PINION * angle
        rate = Z_PINION * ramp * (ERROR * gl.cos(teeth) + 2 * SECOND * gl.cos(2 * teeth))
        self.motor = gp.Move(phi_ref=angle, w_ref=ramp, a_ref=(W_END - W_START) / T_END)
        self.shaft = gp.SpringDamper(c=2.5e4, d=0.6, nominal={"phi_rel": 1e-3})
        self.pinion, self.wheel, self.machine = gp.Inertia(J=1.2e-3), gp.Inertia(J=2.0e-2), gp.Inertia(J=0.25)
        self.mesh = gp.ExternalMesh(r_a=R_PINION, r_b=R_WHEEL, c=2.2e8, d=400.0, e_rate=self.e_rate + rate)
        self.coupling, self.bearing, self.ground = gp.SpringDamper(c=3.0e4, d=0.8), gp.Damper(d=0.4), gp.Fixed()
        return [
            gl.connect(self.motor.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.pinion.flange_a),
            gl.connect(self.pinion.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.machine.flange_a),
            gl.connect(self.machine.flange_b, self.bearing.flange_a),
            gl.connect(self.bearing.flange_b, self.ground.flange),
        ]


system = gl.compile(Drive(), outputs=["mesh.f", "shaft.tau", "pinion.w"])
print(gl.modes(system))
start = {"pinion.w": W_START, "wheel.w": -W_START * R_PINION / R_WHEEL, "machine.w": -W_START * R_PINION / R_WHEEL}
run = system.simulate(T_END, samples=120_001, rtol=1e-8, start=start)

# %%
# Waterfall
# ---------
# The motor's own speed is the reference of the orders; the torque in its shaft is what reaches the housing.

waterfall = gl.order_waterfall(run, "shaft.tau", "pinion.w", revolutions=5, max_order=60)
waterfall.plot(decibels=60.0)

# %%
# Along the order of the teeth
# ----------------------------
# The same from the linear model: the rate of the error has the amplitude :math:`z \omega e`.

nearest = int(np.argmin(np.abs(waterfall.orders - Z_PINION)))
band = waterfall.amplitudes[:, nearest - 1 : nearest + 2].max(axis=1)
grid = np.linspace(W_START, W_END, 1500)
response = gl.frequency_response(system, Z_PINION * grid, ["e_rate"], ["shaft.tau"])
steady = np.abs(response["shaft.tau"]) * Z_PINION * grid * ERROR
figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
axes.semilogy(waterfall.speeds * 30 / math.pi, band, ".", ms=3, label="run-up, order of the teeth")
axes.semilogy(grid * 30 / math.pi, steady, color="firebrick", lw=1, label="frequency response")
axes.set(xlabel="pinion, 1/min", ylabel="torque in the motor's shaft, N·m", title=f"order {Z_PINION}")
axes.legend(fontsize=8)

peak, expected = band.argmax(), steady.argmax()
at, whine = waterfall.speeds[peak], grid[expected]
rpm = 30 / math.pi
print(f"it whines at {whine * rpm:.0f} 1/min, {Z_PINION * whine / 2 / math.pi:.0f} Hz; in the run-up at {at * rpm:.0f} 1/min")
assert abs(at / whine - 1) < 0.03
away = np.abs(waterfall.speeds / whine - 1) > 0.25
ratio = band[away] / np.interp(waterfall.speeds[away], grid, steady)
print(f"away from there the run-up has {ratio.min():.2f} .. {ratio.max():.2f} of the steady amplitudes")
assert np.median(np.abs(ratio - 1)) < 0.05
