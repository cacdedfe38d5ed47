r"""
Gear rattle: when the loose wheel of a gearbox leaves its flank
===============================================================

A wheel that is not in the power path is dragged along by its partner and carries nothing but the drag of its bearing. The firing of
the engine shakes the partner; where the inertia torque exceeds the drag, the wheel leaves the flank, crosses the backlash and strikes
back. The threshold has a closed form: lift-off begins where :math:`J \dot\omega_{max} > T_{drag}`, with the small correction of the
mesh's resonance. Below it the gearbox is silent, whatever the backlash.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

J, DRAG, BACKLASH, SPEED = 8e-4, 0.35, 1.5e-3, 100.0  # kg.m2, N.m, rad, rad/s
STIFFNESS, DAMPING = 4e4, 0.6  # of the mesh, N.m/rad and N.m.s/rad at the wheel
FIRING = 2 * SPEED  # a four-cylinder engine fires twice in a turn


class LooseWheel(gl.Component):
    """A wheel with drag behind a mesh with backlash; the driving wheel's speed is given."""

    shake = gl.Parameter("rad/s", "amplitude of the driving wheel's speed", default=1.0)

    def assemble(self):
        self.partner = gp.Speed(w_ref=SPEED + self.shake * gl.sin(FIRING * gl.time), exact=True)
        self.mesh = gp.ElastoBacklash(c=STIFFNESS, d=DAMPING, b=BACKLASH)
        self.wheel, self.bearing = gp.Inertia(J=J), gp.Torque(tau=-DRAG)
        return [
            gl.connect(self.partner.flange, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.bearing.flange),
        ]


system = gl.compile(LooseWheel(), outputs=["mesh.tau", "mesh.phi_rel", "wheel.w"])
PERIOD = 2 * math.pi / FIRING
START = {"wheel.w": SPEED, "mesh.phi_rel": -BACKLASH / 2 - DRAG / STIFFNESS}  # on the drive flank, pressed by the drag


def shaken(shake):
    """The last five of thirty firing periods."""
    run = system.simulate(30 * PERIOD, samples=6001, parameters={"shake": shake}, start=START)
    last = run.time >= 25 * PERIOD
    return run.time[last], -run["mesh.tau"][last], run["mesh.phi_rel"][last]


# %%
# The threshold
# -------------
# On the flank the wheel is an oscillator that is driven through its mesh far below its resonance; the mesh's force vanishes first where
# :math:`J \omega a / (1 - \omega^2 J / c) = T_{drag}`.

threshold = DRAG / (J * FIRING) * (1 - FIRING**2 * J / STIFFNESS)
low, high = 0.5 * threshold, 2.0 * threshold
for _ in range(12):
    middle = (low + high) / 2
    low, high = (low, middle) if shaken(middle)[1].min() <= 0 else (middle, high)
print(f"lift-off from {1e3 * high:.2f} mrad/s on; closed form {1e3 * threshold:.2f} mrad/s")
assert abs(high / threshold - 1) < 0.005

# %%
# The noise
# ---------
# What is heard grows with the strokes' momentum; their largest torque, over the drag, is a measure. Once the wheel flies across the
# whole backlash it strikes both flanks.

levels = threshold * np.array([0.5, 0.9, 1.1, 1.5, 2.0, 3.0, 4.5, 6.0])
strokes, widths = [], []
for level in levels:
    _, torque, gap = shaken(level)
    strokes.append(np.abs(torque).max() / DRAG)
    widths.append(np.ptp(gap) / BACKLASH)
    flanks = "both flanks" if torque.min() < -1e-9 else "one flank" if torque.min() <= 1e-9 else "no lift-off"
    print(f"{level / threshold:4.1f} of the threshold: strokes {strokes[-1]:6.2f} of the drag, {flanks}")
assert strokes[0] < 2
assert strokes[-1] > 5 * strokes[1]

figure, (history, noise) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
for share, colour in ((0.9, "#2e8b57"), (3.0, "#d1495b")):
    time, torque, _ = shaken(share * threshold)
    history.plot(1e3 * (time - time[0]), torque, color=colour, label=f"{share:g} of the threshold")
history.set(xlabel="time, ms", ylabel="torque of the mesh, N·m", title="Mesh of the loose wheel", ylim=(-12, 8))
history.legend(fontsize=8, loc="lower center")
noise.semilogy(levels / threshold, strokes, "o-", color="#0b5394")
noise.set_yticks([1, 2, 5, 10, 20, 50], labels=["1", "2", "5", "10", "20", "50"], minor=False)
noise.set_yticks([], minor=True)
noise.axvline(1.0, color="black", lw=1, ls=":")
noise.set(xlabel="shaking over the threshold", ylabel="largest stroke over the drag", title="Rattle sets in")
plt.show()
