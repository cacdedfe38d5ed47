r"""
A rolling mill: the bite, and rolls that slip
=============================================

When a slab enters the rolls, its torque hits a shaft that was slack: the spindle swings to nearly twice the load, which is what it must
be made for (the torque amplification factor). When the rolls slip on the strip, friction that falls with the slip speed feeds the
vibration instead: the mill chatters. Both have closed forms: the factor of a step on an oscillator, and the slope of friction from
which the damping is used up.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

J_MOTOR, J_ROLLS, C_SPINDLE, D_SPINDLE = 5200.0, 1400.0, 6.0e6, 2.4e3  # behind the gears, as the rolls see them
W_ROLLS, BITE = 8.0, 300e3  # rad/s, N.m


class Stand(gl.Component):
    """Motor with its speed control, gearbox, spindle, rolls; the strip's torque is an input."""

    strip = gl.Input("N.m", "torque of the strip on the rolls")

    def assemble(self):
        self.drive = gp.Speed(w_ref=W_ROLLS, exact=True)
        self.spindle, self.rolls = gp.SpringDamper(c=C_SPINDLE, d=D_SPINDLE), gp.Inertia(J=J_ROLLS)
        self.gap = gp.Torque(tau=-self.strip)
        return [
            gl.connect(self.drive.flange, self.spindle.flange_a),
            gl.connect(self.spindle.flange_b, self.rolls.flange_a),
            gl.connect(self.rolls.flange_b, self.gap.flange),
        ]


# %%
# The bite
# --------
# The load comes within 4 ms. Of a step on an oscillator with the damping ratio D the first peak is
# :math:`1 + e^{-\pi D / \sqrt{1 - D^2}}` times the load; a ramp that is short against the period takes off a little,
# :math:`|\sin(\omega t_r / 2)| / (\omega t_r / 2)` of what is beyond 1 (undamped).

times = np.linspace(0.0, 0.6, 3001)
bite = gl.Table([0.0, 0.05, 0.054, 0.6], [0.0, 0.0, BITE, BITE])
system = gl.compile(Stand(), outputs=["spindle.tau", "rolls.w"])
run = system.simulate(0.6, times=times, inputs={"strip": bite}, start={"rolls.w": W_ROLLS})
torque = -run["spindle.tau"] * np.sign(-run["spindle.tau"][-1])
omega = math.sqrt(C_SPINDLE / J_ROLLS)
D = D_SPINDLE / (2 * math.sqrt(C_SPINDLE * J_ROLLS))
ramp = omega * 0.004 / 2
factor = 1 + math.exp(-math.pi * D / math.sqrt(1 - D**2)) * math.sin(ramp) / ramp
print(
    f"torque amplification factor {torque.max() / BITE:.4f}; closed form {factor:.4f}; natural frequency {omega / 2 / math.pi:.2f} Hz"
)
assert abs(torque.max() / BITE - factor) < 0.005

# %%
# Slip
# ----
# Now the strip is held by the stands before and behind, and the rolls slip on it. The torque falls from its largest value as the
# slip grows: :math:`\tau = \tau_0 (\mu_k + (1 - \mu_k) e^{-s / s_0})`. About a steady slip its slope takes damping away; the
# limit is where it is as large as the spindle's own damping.


class Slipping(gl.Component):
    """Rolls that slip on a strip with a speed of its own."""

    v_strip = gl.Parameter("rad/s", "speed of the strip, as that of rolls which would not slip")
    fall = gl.Parameter("rad/s", "slip at which most of the fall has happened", default=1.2, min=1e-3)
    share = gl.Parameter("1", "of the largest torque that is left at large slip", default=0.8)

    def assemble(self):
        self.drive = gp.Speed(w_ref=W_ROLLS, exact=True)
        self.spindle, self.rolls = gp.SpringDamper(c=C_SPINDLE, d=D_SPINDLE), gp.Inertia(J=J_ROLLS)
        slip = self.rolls.w - self.v_strip
        grip = gl.tanh(slip / 0.05)
        self.gap = gp.Torque(tau=-BITE * grip * (self.share + (1 - self.share) * gl.exp(-slip * grip / self.fall)))
        return [
            gl.connect(self.drive.flange, self.spindle.flange_a),
            gl.connect(self.spindle.flange_b, self.rolls.flange_a),
            gl.connect(self.rolls.flange_b, self.gap.flange),
        ]


def slope(slip):
    """By how much the torque falls with the slip, N.m.s/rad."""
    return BITE * 0.2 / 1.2 * math.exp(-slip / 1.2)


limit = 1.2 * math.log(BITE * 0.2 / 1.2 / D_SPINDLE)  # slip at which the slope is the spindle's damping
slipping = gl.compile(Slipping(v_strip=1.0), outputs=["rolls.w", "spindle.tau"])
growth = []
slips = np.linspace(0.6, 6.0, 28)
for slip in slips:
    steady = {"rolls.w": W_ROLLS, "spindle.phi_rel": 0.0}
    linear = slipping.linearize(inputs=[], outputs=["rolls.w"], at=steady, parameters={"v_strip": W_ROLLS - slip})
    growth.append(max(linear.poles().real))
    expected = (slope(slip) - D_SPINDLE) / (2 * J_ROLLS)
    assert abs(growth[-1] - expected) < 1e-6 * max(1.0, abs(expected))
print(f"slip above which the rolls run quietly: {limit:.3f} rad/s")

runs = {}
for slip in (1.5, 5.5):
    held = -BITE * (0.8 + 0.2 * math.exp(-slip / 1.2)) / C_SPINDLE
    start = {"rolls.w": W_ROLLS + 0.3, "spindle.phi_rel": held}
    runs[slip] = slipping.simulate(3.0, samples=12001, parameters={"v_strip": W_ROLLS - slip}, start=start)
swing = {slip: np.ptp(r["rolls.w"][-1000:]) for slip, r in runs.items()}
assert swing[1.5] > 1.0  # a limit cycle
assert swing[5.5] < 0.6 * math.exp(growth[-3] * 2.5)  # dies out

# %%

figure, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
axes[0].plot(times, torque / 1e3)
axes[0].axhline(BITE / 1e3, color="0.5", ls=":", lw=1)
axes[0].annotate(
    f"factor {torque.max() / BITE:.2f}",
    (times[torque.argmax()], torque.max() / 1e3),
    xytext=(12, -4),
    textcoords="offset points",
)
axes[0].set(xlabel="time, s", ylabel="torque of the spindle, kN·m", title="bite", xlim=(0.03, 0.4))
axes[1].axhline(0, color="0.5", lw=1)
axes[1].plot(slips, growth)
axes[1].axvline(limit, color="firebrick", ls="--", lw=1, label=f"slope = damping: {limit:.2f} rad/s")
axes[1].set(xlabel="slip, rad/s", ylabel="growth of the vibration, 1/s", title="slip")
axes[1].legend(fontsize=8)
for slip, r in runs.items():
    axes[2].plot(r["rolls.w"], -r["spindle.tau"] / 1e3, lw=0.7, label=f"slip {slip} rad/s")
axes[2].set(xlabel="speed of the rolls, rad/s", ylabel="torque, kN·m", title="chatter, and rest")
axes[2].legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 0.0), ncols=2)
axes[2].set_ylim(bottom=20.0)
