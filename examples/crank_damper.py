r"""
A torsional damper on a crankshaft: 200 designs
===============================================

A ring on a rubber joint at the crankshaft's free end splits its resonance into two lower ones. Too soft or too stiff, too much damping
or too little: each spoils it. A sweep over 200 pairs of stiffness and damping finds the best, and Den Hartog's formulas, which hold for
one mode without damping of its own, say where it should be.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

# %%
# The crank train, seen in its first mode: the inertia that swings against the flywheel, and the ring.

J_CRANK, C_CRANK, MU = 0.045, 62e3, 0.25  # kg.m2, N.m/rad, inertia of the ring over that of the crank
J_RING = MU * J_CRANK
OWN = math.sqrt(C_CRANK / J_CRANK)


class CrankTrain(gl.Component):
    c = gl.Parameter("N.m/rad", "stiffness of the rubber", default=1e4, min=0)
    d = gl.Parameter("N.m.s/rad", "damping of the rubber", default=1.0, min=0)

    def assemble(self):
        self.firing, self.crank = gp.Torque(), gp.Inertia(J=J_CRANK)
        self.shaft, self.flywheel = gp.Spring(c=C_CRANK), gp.Fixed()  # so heavy that it turns evenly
        self.rubber, self.ring = gp.SpringDamper(c=self.c, d=self.d), gp.Inertia(J=J_RING)
        return [
            gl.connect(self.firing.flange, self.crank.flange_a),
            gl.connect(self.crank.flange_b, self.shaft.flange_a, self.rubber.flange_a),
            gl.connect(self.shaft.flange_b, self.flywheel.flange),
            gl.connect(self.rubber.flange_b, self.ring.flange_a),
        ]


system = gl.compile(CrankTrain())

# %%
# The sweep
# ---------
# Tuning is the damper's own frequency over the crank's; the measure is the largest magnification of the static twist over all
# speeds.

tuning, ratios = np.linspace(0.6, 1.05, 20), np.linspace(0.06, 0.6, 10)
omega = OWN * np.linspace(0.3, 1.7, 701)
peak = np.empty((len(tuning), len(ratios)))
for i, g in enumerate(tuning):
    for k, zeta in enumerate(ratios):
        design = {"c": J_RING * (g * OWN) ** 2, "d": 2 * zeta * J_RING * OWN}
        twist = gl.frequency_response(system, omega, ["firing.tau"], ["shaft.phi_rel"], parameters=design)
        peak[i, k] = np.abs(twist["shaft.phi_rel"]).max() * C_CRANK
best = np.unravel_index(peak.argmin(), peak.shape)
print(
    f"{peak.size} designs; best: tuning {tuning[best[0]]:.3f}, damping ratio {ratios[best[1]]:.3f}, magnification {peak.min():.3f}"
)

# %%
# Den Hartog
# ----------
# ("Mechanical Vibrations", 4th ed., 3.3.) The best tuning is :math:`1/(1+\mu)`, the best damping
# :math:`\sqrt{3\mu / (8 (1+\mu)^3)}`, the magnification then :math:`\sqrt{1 + 2/\mu}`.

g_best, zeta_best, least = 1 / (1 + MU), math.sqrt(3 * MU / (8 * (1 + MU) ** 3)), math.sqrt(1 + 2 / MU)
print(f"Den Hartog:          tuning {g_best:.3f}, damping ratio {zeta_best:.3f}, magnification {least:.3f}")
assert least * 0.995 < peak.min() < 1.05 * least
assert abs(tuning[best[0]] - g_best) < 0.04
curves = {}
for label, g, zeta in (("Den Hartog", g_best, zeta_best), ("too little damping", g_best, 0.06), ("too stiff", 1.05, zeta_best)):
    design = {"c": J_RING * (g * OWN) ** 2, "d": 2 * zeta * J_RING * OWN}
    twist = gl.frequency_response(system, omega, ["firing.tau"], ["shaft.phi_rel"], parameters=design)
    curves[label] = np.abs(twist["shaft.phi_rel"]) * C_CRANK
assert abs(curves["Den Hartog"].max() - least) < 0.01 * least

# %%
# The fixed points of all curves, which the best one touches with its tops, are what his formulas come from.

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
image = left.pcolormesh(ratios, tuning, np.minimum(peak, 10.0), shading="nearest", cmap="viridis_r")
left.plot(zeta_best, g_best, "*", color="firebrick", ms=13, label="Den Hartog")
left.set(xlabel="damping ratio of the damper", ylabel="tuning")
left.legend(loc="lower right")
figure.colorbar(image, ax=left, label="largest magnification (10 and more alike)")
for k, (label, curve) in enumerate(curves.items()):
    right.plot(omega / OWN, curve, color=f"C{k}", label=label)
right.axhline(least, color="0.4", ls=":", lw=1)
right.set(xlabel="frequency over the crank's own", ylabel="magnification of the static twist", ylim=(0, 10))
right.legend()
