r"""
A ship's shafting: which orders of the engine meet which frequencies
====================================================================

A slow two-stroke engine with six cylinders drives a propeller through an intermediate shaft. Each cylinder excites the shafting with
harmonics of its gas and inertia torque. Classification societies ask for the vibratory torque of the shaft over speed, order by order,
and for barred speed ranges where it is too large.

The check is Holzer's: the same chain, written by hand as a dynamic stiffness matrix and solved with NumPy.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

# %%
# The chain
# ---------
# Six cranks, the flywheel, the propeller with the water that it drags along, the shafts between them.

CYLINDERS, FIRING_ORDER = 6, (1, 5, 3, 4, 2, 6)
J = [9.5e3] * CYLINDERS + [12.0e3, 58.0e3]  # kg.m2
C = [1.05e9] * (CYLINDERS - 1) + [1.4e9, 55.0e6]  # N.m/rad
D_CRANK, D_SHAFT, D_PROPELLER = 2.0e3, 2.0e4, 3.0e5  # N.m.s/rad
AMPLITUDE = {
    1: 130e3,
    2: 110e3,
    3: 95e3,
    4: 70e3,
    5: 52e3,
    6: 38e3,
    7: 27e3,
    8: 19e3,
    9: 13e3,
    12: 5e3,
}  # N.m for each cylinder


class Shafting(gl.Component):
    def assemble(self):
        self.body = [gp.Inertia(J=value) for value in J]
        self.shaft = [gp.SpringDamper(c=value, d=D_SHAFT) for value in C]
        self.gas = [gp.Torque() for _ in range(CYLINDERS)]
        self.piston = [gp.Damper(d=D_CRANK) for _ in range(CYLINDERS)]
        self.water, self.sea, self.block = gp.Damper(d=D_PROPELLER), gp.Fixed(), gp.Fixed()
        links = [gl.connect(self.body[-1].flange_b, self.water.flange_a), gl.connect(self.water.flange_b, self.sea.flange)]
        for k, shaft in enumerate(self.shaft):
            links += [gl.connect(self.body[k].flange_b, shaft.flange_a), gl.connect(shaft.flange_b, self.body[k + 1].flange_a)]
        for body, gas, piston in zip(self.body, self.gas, self.piston):
            links += [gl.connect(gas.flange, body.flange_a, piston.flange_a), gl.connect(piston.flange_b, self.block.flange)]
        return links


system = gl.compile(Shafting())
modes = gl.modes(system)
print(modes)

# %%
# Vibratory torque in the intermediate shaft
# ------------------------------------------
# A cylinder that fires later by an angle has its harmonic later by the order times this angle. For a two-stroke engine the
# crank angles are equally spaced, so that the sixth order of all cylinders is in phase: the major one.

LAST = f"shaft[{len(C) - 1}].tau"
rpm = np.linspace(20.0, 120.0, 401)
angle = [2 * math.pi * FIRING_ORDER.index(k + 1) / CYLINDERS for k in range(CYLINDERS)]
torque = {}
for order, amplitude in AMPLITUDE.items():
    omega = order * rpm * math.pi / 30
    response = gl.frequency_response(system, omega, [f"gas[{k}].tau" for k in range(CYLINDERS)], [LAST])
    parts = [amplitude * np.exp(-1j * order * angle[k]) * response[LAST, f"gas[{k}].tau"] for k in range(CYLINDERS)]
    torque[order] = abs(sum(parts))

total = np.sqrt(sum(values**2 for values in torque.values()))
LIMIT = 500e3
barred = rpm[total > LIMIT]

# %%
# By hand
# -------
# :math:`(-\omega^2 J + j \omega D + C) \varphi = \tau` with tridiagonal matrices, after Holzer.

n = len(J)
stiffness, damping = np.zeros((n, n)), np.diag([D_CRANK] * CYLINDERS + [0.0, D_PROPELLER])
for k, value in enumerate(C):
    pair = np.ix_([k, k + 1], [k, k + 1])
    stiffness[pair] += value * np.array([[1, -1], [-1, 1]])
    damping[pair] += D_SHAFT * np.array([[1, -1], [-1, 1]])
worst = 0.0
for order, amplitude in AMPLITUDE.items():
    for i in range(0, len(rpm), 20):
        w = order * rpm[i] * math.pi / 30
        load = np.zeros(n, complex)
        load[:CYLINDERS] = amplitude * np.exp(-1j * order * np.array(angle))
        turned = np.linalg.solve(-(w**2) * np.diag(J) + 1j * w * damping + stiffness, load)
        by_hand = abs((C[-1] + 1j * w * D_SHAFT) * (turned[-1] - turned[-2]))
        worst = max(worst, abs(torque[order][i] - by_hand) / total.max())
print(f"largest difference to Holzer's matrix: {worst:.1e} of the largest torque")
assert worst < 1e-9

first = next(f for f in modes.frequencies if f > 0.1)
print(
    f"first mode {first:.3f} Hz: critical for order 6 at {60 * first / 6:.2f} rpm; the torque peaks at {rpm[torque[6].argmax()]:.2f} rpm"
)
assert abs(rpm[torque[6].argmax()] - 60 * first / 6) < 0.5
print(f"barred: {barred.min():.1f} .. {barred.max():.1f} rpm")

# %%

figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.4), layout="constrained")
for k, order in enumerate(sorted(AMPLITUDE, key=lambda o: -torque[o].max())[:5]):
    left.plot(rpm, torque[order] / 1e3, label=f"order {order}", color=f"C{k}")
left.plot(rpm, total / 1e3, color="black", lw=1.8, label="root of the sum of squares")
left.axhline(LIMIT / 1e3, color="firebrick", ls="--", lw=1, label="permitted")
left.axvspan(barred.min(), barred.max(), color="firebrick", alpha=0.12)
left.set(xlabel="engine, 1/min", ylabel="vibratory torque in the shaft, kN·m", xlim=(20, 120), ylim=(0, None))
left.legend(fontsize=8)
gl.campbell(system, [20 * math.pi / 30, 120 * math.pi / 30], {"third": 3, "sixth": 6, "ninth": 9, "twelfth": 12}).plot(
    axes=right
)
