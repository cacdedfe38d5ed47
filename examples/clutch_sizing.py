r"""
Sizing a clutch: torque, heat and temperature of a launch
=========================================================

A dry clutch shall launch a car of 1600 kg from rest. Its torque must exceed that of the engine with a margin, but a stronger clutch
jerks more and a weaker one slips longer: heat, and the temperature of the plates, decide. The geometry follows from the torque; the
slip time, the heat and the jerk have closed forms for constant torques, which the simulation is checked with.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

T_ENGINE, W_IDLE, J_ENGINE = 180.0, 210.0, 0.22  # N.m, rad/s, kg.m2
MASS, R_WHEEL, RATIO, ROLLING = 1600.0, 0.3, 13.0, 260.0  # kg, m, gearbox and axle in first gear, N
J_CAR = MASS * (R_WHEEL / RATIO) ** 2  # as the clutch sees it
T_CAR = ROLLING * R_WHEEL / RATIO

# %%
# The friction face
# -----------------
# With uniform wear the torque of a face is :math:`\mu F (r_o + r_i) / 2`, and its pressure is largest at the inner radius:
# :math:`F = 2 \pi p_{max} r_i (r_o - r_i)`. Two faces, organic lining: 0.3 for the coefficient, 0.25 MPa for the pressure.

MU, PRESSURE, FACES, MARGIN = 0.30, 0.25e6, 2, 1.35
r_outer = 0.120
wanted = MARGIN * T_ENGINE
r_inner = next(r for r in np.arange(r_outer - 0.002, 0.5 * r_outer, -0.0005)
               if FACES * MU * 2 * math.pi * PRESSURE * r * (r_outer - r) * (r_outer + r) / 2 >= wanted)  # fmt: skip
force = 2 * math.pi * PRESSURE * r_inner * (r_outer - r_inner)
geometry = FACES * (r_outer + r_inner) / 2  # torque over coefficient and force
capacity = MU * geometry * force
area = FACES * math.pi * (r_outer**2 - r_inner**2)
print(
    f"lining {2e3 * r_outer:.0f} x {2e3 * r_inner:.0f} mm, force {force:.0f} N, torque {capacity:.1f} N.m (asked {wanted:.1f} N.m)"
)


# %%
# The launch
# ----------
class Launch(gl.Component):
    """Engine, clutch with its heat, car; the clutch's force is an input."""

    pressed = gl.Input("1", "force over the largest one")

    def assemble(self):
        self.torque, self.engine = gp.Torque(tau=T_ENGINE), gp.Inertia(J=J_ENGINE, start={"w": W_IDLE})
        self.clutch = gp.Clutch(mu_pos=((0.0, MU),), cgeo=geometry, fn_max=force, f_normalized=self.pressed, use_heat_port=True)
        self.plates = gp.HeatCapacitor(C=2.6 * 480.0, start={"T": 293.15})  # 2.6 kg of cast iron
        self.car, self.resistance = gp.Inertia(J=J_CAR, start={"w": 0.0}), gp.Torque(tau=-T_CAR)
        return [
            gl.connect(self.torque.flange, self.engine.flange_a),
            gl.connect(self.engine.flange_b, self.clutch.flange_a),
            gl.connect(self.clutch.flange_b, self.car.flange_a),
            gl.connect(self.car.flange_b, self.resistance.flange),
            gl.connect(self.clutch.heat_port, self.plates.port),
        ]


# %%
# With the whole force at once all torques are constant, and the speeds approach each other along straight lines:
#
# .. math:: t_s = \frac{\omega_0}{(T_c - T_e) / J_e + (T_c - T_r) / J_c}, \qquad Q = \tfrac12 T_c \, \omega_0 \, t_s

system = gl.compile(Launch(), outputs=["engine.w", "car.w", "clutch.tau", "plates.T"])
at_once = system.simulate(1.2, samples=2401, inputs={"pressed": 1.0})
t_slip = W_IDLE / ((capacity - T_ENGINE) / J_ENGINE + (capacity - T_CAR) / J_CAR)
heat = capacity * W_IDLE * t_slip / 2
found = (at_once["plates.T"][-1] - 293.15) * 2.6 * 480.0
stuck = next(event[0] for event in at_once.events if event[0] > 0.01)
print(f"slip {stuck:.5f} s, closed form {t_slip:.5f} s; heat {found / 1e3:.4f} kJ, closed form {heat / 1e3:.4f} kJ")
print(f"work per lining area {found / area / 1e6:.3f} MJ/m2, plates {at_once['plates.T'][-1] - 293.15:.1f} K warmer")
assert abs(stuck / t_slip - 1) < 1e-6
assert abs(found / heat - 1) < 1e-6

# %%
# How hard to press
# -----------------
# Pressed less, the clutch spares the jerk when it sticks, and costs heat. Shown are the heat, and the step of the car's acceleration at
# the end of the slip, which is what passengers feel: :math:`(T_c - T_l) / J_c`, where :math:`T_l = (T_e J_c + T_r J_e) / (J_e + J_c)` is
# what the clutch carries once it is locked.

shares = np.array([0.8, 0.85, 0.9, 0.95, 1.0])
to_car = R_WHEEL / RATIO  # from rad/s2 to m/s2
runs = [system.simulate(2.5, samples=2501, inputs={"pressed": share}) for share in shares]
heats = np.array([(run["plates.T"][-1] - 293.15) * 2.6 * 480.0 for run in runs])
steps = np.array([np.abs(np.diff(run["clutch.tau"])).max() / J_CAR * to_car for run in runs])
locked = (T_ENGINE * J_CAR + T_CAR * J_ENGINE) / (J_ENGINE + J_CAR)
for share, q, step in zip(shares, heats, steps):
    torque = share * capacity
    slip = W_IDLE / ((torque - T_ENGINE) / J_ENGINE + (torque - T_CAR) / J_CAR)
    print(f"pressed {share:4.2f}: slip {slip:5.3f} s, heat {q / 1e3:5.2f} kJ, step of acceleration {step:5.3f} m/s2")
    assert abs(q / (torque * W_IDLE * slip / 2) - 1) < 1e-6
    assert abs(step / ((torque - locked) / J_CAR * to_car) - 1) < 1e-6

figure, (speeds, choice) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
for run, style, name in ((at_once, "-", "pressed fully"), (runs[0], "--", "pressed 0.8")):
    speeds.plot(run.time, run["engine.w"], "#0b5394", ls=style, label=f"engine, {name}")
    speeds.plot(run.time, run["car.w"], "#d1495b", ls=style, label=f"gearbox input, {name}")
speeds.set(xlabel="time, s", ylabel="angular velocity, rad/s", title="Launch")
speeds.legend(fontsize=8)
choice.plot(shares, heats / 1e3, "o-", color="#0b5394")
choice.set(xlabel="force over the largest one", title="Heat and jerk")
choice.set_ylabel("heat of a launch, kJ", color="#0b5394")
jerk = choice.twinx()
jerk.plot(shares, steps, "s--", color="#d1495b")
jerk.set_ylabel("step of acceleration, m/s²", color="#d1495b")
plt.show()
