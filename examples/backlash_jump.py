r"""
The jump of a gear pair with backlash
=====================================

A spur gear pair under a constant torque vibrates because its transmission error does. As long as the vibration is smaller than
the static deflection, the flanks stay in contact and the pair is linear. Near the resonance they part. Contact then lasts for
a part of each period only, the mesh is softer on average, and the resonance bends to lower frequencies: over some of these there are
two stable motions, and the vibration jumps from one to the other [1]_, [2]_.

This script follows the periodic motions by harmonic balance, and sweeps the mesh frequency up and down by time integration.

.. [1] A. Kahraman, R. Singh, "Non-linear dynamics of a spur gear pair", Journal of Sound and Vibration 142 (1990) 49-75.
   https://doi.org/10.1016/0022-460X(90)90582-K
.. [2] R. J. Comparin, R. Singh, "Non-linear frequency response characteristics of an impact pair", Journal of Sound and Vibration
   134 (1989) 259-290.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp
from gearparts.gears.mesh_models import DetailedExternalMesh, mesh_damping

FIGURES = Path("examples/figures" if Path("examples").is_dir() else "figures")
FIGURES.mkdir(exist_ok=True)
J_A, R_A, J_B, R_B, C, ZETA = 0.001, 0.05, 0.016, 0.1, 2e8, 0.05
NATURAL = np.sqrt(C * (R_A**2 / J_A + R_B**2 / J_B))  # rad/s, of the mesh in contact


class GearPair(gl.Component):
    """A pinion drives a wheel; both turn freely under torques that balance."""

    w = gl.Parameter("rad/s", "mesh frequency", default=1e4)
    E = gl.Parameter("m", "amplitude of the transmission error", default=3e-6)
    tau = gl.Parameter("N.m", "torque on the pinion", default=100.0)

    def assemble(self):
        self.pinion, self.wheel = gp.Inertia(J=J_A), gp.Inertia(J=J_B)
        self.mesh = DetailedExternalMesh(
            backlash=True, r_a=R_A, r_b=R_B, c=C, d=mesh_damping(ZETA, C, J_A, R_A, J_B, R_B), b=100e-6, start={"q": 60e-6},
            e_rate=-self.E * self.w * gl.sin(self.w * gl.time),
        )  # fmt: skip
        self.drive, self.load = gp.Torque(tau=self.tau), gp.Torque(tau=self.tau * R_B / R_A)
        return [
            gl.connect(self.drive.flange, self.pinion.flange_a),
            gl.connect(self.pinion.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.load.flange),
        ]


system = gl.compile(GearPair(), outputs=["mesh.q", "pinion.w", "wheel.w"])
static = 100.0 / R_A / C  # m, deflection under the torque alone

# %%
# Harmonic balance
# ----------------
# The branch starts above the resonance and goes down in frequency, round the folds. The number of harmonics follows from the
# accuracy that is asked for, and the result says what was reached. One harmonic alone is off: it puts the end of the branch of large
# motions at 0.567 of the natural frequency, where it is at 0.720.

branches = {
    name: gl.harmonic_balance(system, 1.5 * NATURAL, 0.5 * NATURAL, frequency="w", harmonics=n, step=0.04)
    for name, n in (("one harmonic only", 1), ("harmonic balance", None))
}
for name, branch in branches.items():
    folds = ", ".join(
        f"{w / NATURAL:.4f} ({a * 1e6:.2f})" for w, a in zip(branch.fold_omega, branch.amplitude("mesh.q")[list(branch.folds)])
    )
    print(f"{name}: {branch.reached}; {len(branch)} points; folds at w/wn (amplitude, µm): {folds}")

# %%
# Sweeps by time integration
# --------------------------
# At each frequency the run starts where the last one ended, so that it stays on its branch as long as there is one. After 60
# periods for the transient, one more gives the first harmonic.


def sweep(frequencies):
    state, amplitudes = {"mesh.q": 60e-6, "pinion.w": 100.0, "wheel.w": -50.0}, []
    for w in frequencies:
        period = 2 * np.pi / w
        times = np.append(0.0, (60 + np.arange(65) / 64) * period)
        run = system.simulate(times[-1], times=times, start=state, parameters={"w": w}, rtol=1e-7)
        amplitudes.append(abs(np.fft.rfft(run["mesh.q"][1:-1])[1]) / 32)
        state = {name: run[name][-1] for name in state}
    return np.array(amplitudes)


frequencies = np.linspace(0.55, 1.25, 57) * NATURAL
sweeps = {"swept up": sweep(frequencies), "swept down": sweep(frequencies[::-1])[::-1]}
for name, amplitude in sweeps.items():
    k = int(np.argmax(np.abs(np.diff(amplitude))))
    print(
        f"{name}: jump between w/wn = {frequencies[k] / NATURAL:.4f} and {frequencies[k + 1] / NATURAL:.4f}, "
        f"{amplitude[k] * 1e6:.2f} to {amplitude[k + 1] * 1e6:.2f} µm"
    )

# %%
# Both together
# -------------

fig, ax = plt.subplots(figsize=(8, 4.8), layout="constrained")
for (_, branch), color in zip(branches.items(), ("#6a3d9a", "C0")):
    converged = branch.harmonics > 1
    ratio, amplitude = branch.omega / NATURAL, branch.amplitude("mesh.q") * 1e6
    if not converged:  # which of its motions are stable is as wrong as the motions themselves
        ax.plot(ratio, amplitude, color=color, lw=1, ls="-.", label="one harmonic only: not converged")
        continue
    ax.plot(ratio, np.where(branch.stable, amplitude, np.nan), color=color, label=f"harmonic balance, {branch.reached}")
    ax.plot(ratio, np.where(branch.stable, np.nan, amplitude), color=color, ls=":", label="the same, unstable")
    for k in branch.folds:
        ax.plot(ratio[k], amplitude[k], "ko", ms=4)
        ax.annotate(f"{ratio[k]:.3f}", (ratio[k], amplitude[k]), textcoords="offset points", xytext=(-34, 4), fontsize=8)
for (name, amplitude), marker in zip(sweeps.items(), ("^", "v")):
    ax.plot(frequencies / NATURAL, amplitude * 1e6, marker, color="C3" if marker == "^" else "C2", ms=5, mfc="none", label=name)
ax.axhline(static * 1e6, color="k", lw=0.8, ls="--")
ax.annotate("static deflection: flanks part above", (0.51, static * 1e6), va="bottom", fontsize=8)
ax.set_xlabel("mesh frequency over natural frequency in contact")
ax.set_ylabel("amplitude of the deflection, first harmonic, µm")
ax.set_title("A gear pair with backlash: softening and jump")
ax.set_xlim(0.5, 1.25)
ax.set_ylim(0, None)
ax.legend(fontsize=8)
ax.grid(alpha=0.3)
fig.savefig(FIGURES / "backlash_jump.png", dpi=80)
plt.show()
