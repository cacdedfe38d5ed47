r"""
The XP train with backlash
==========================

Zhou and Cui [1]_ compare the linear XP train with a "weakly nonlinear" one (Fig. 6) without saying what makes it nonlinear. Here
one, two or all three meshes have a backlash of 100 µm. Under 100 N.m each is pressed together by 4.6 µm, and a transmission error
of 1 µm excites them. Where the resonance near 930 Hz makes a mesh vibrate by more than it is pressed together, its flanks part: the
resonance bends to lower speeds, and between two folds there are two stable motions.

Three roads: the describing function (one harmonic), harmonic balance of the whole train, and time integration that starts from
either side. The linear train has no folds, and the same verdict at every speed.

.. [1] X. Zhou, Y. Cui, "Dynamic characteristics of single-loop gear system based on bond graph method", Journal of
   Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

FIGURES = Path("examples/figures" if Path("examples").is_dir() else "figures")
FIGURES.mkdir(exist_ok=True)
GAP = (("backlash", True), ("b", 100e-6))
MESHES = ("ring", "sun", "pair")


class Loaded(gl.Component):
    """The XP train between a constant torque and a damper; all meshes have the transmission error ``E sin(w t)``."""

    gaps = gl.Structural(MESHES, "meshes that have backlash")
    E = gl.Parameter("m", "amplitude of the transmission error", default=1e-6)
    w = gl.Parameter("rad/s", "its angular frequency", default=8500.0)
    q = gl.Variable("m", "deflection of the ring's mesh")
    q_sun = gl.Variable("m", "deflection of the sun's mesh")
    q_pair = gl.Variable("m", "deflection of the P unit's mesh")

    def assemble(self):
        details = {f"{mesh}_details": GAP for mesh in self.gaps}
        self.drive, self.ground = gp.ConstantTorque(tau_constant=100.0), gp.Fixed()
        self.train = gp.XPTrain(Z_s=19, Z_p=31, Z_r=81, e_rate=self.E * self.w * gl.cos(self.w * gl.time), **details)
        self.load = gp.Damper(d=1800 * 0.075**2)
        return [
            gl.connect(self.drive.flange, self.train.flange_in),
            gl.connect(self.train.flange_out, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]

    def equations(self):
        unit = self.train.x_unit
        meshes = (unit.ring_mesh, unit.sun_mesh, self.train.p_unit.mesh)
        return [gl.Eq(q, mesh.q) for q, mesh in zip((self.q, self.q_sun, self.q_pair), meshes)]


# %%
# The linear train first: stable, and passive whatever its parameters.

linear = gl.compile(Loaded(gaps=()), outputs=["q"])
print(gl.stability(linear))

# %%
# With backlash: the motion at rest, under the torque alone, is where the search for vibrations begins. The branch of periodic motions is
# followed through its folds, where runs jump; the Floquet multipliers of each motion say whether it is stable.

FROM, TO = 5900.0, 5000.0


def follow(gaps, **options):
    """The train with backlash in these meshes, its rest, and its branch of periodic motions."""
    system = gl.compile(Loaded(gaps=gaps), outputs=["q", "q_sun", "q_pair"])
    rest = system.simulate(3.0, samples=2, parameters={"E": 0.0})
    guess = {name: float(rest[name][-1]) for name in system.states}
    outputs = ["q", "q_sun", "q_pair"]
    return system, guess, gl.harmonic_balance(system, FROM, TO, frequency="w", guess=guess, outputs=outputs, **options)


def parted(branch, name):
    """Whether the flanks of a mesh part, for each motion of a branch."""
    waves = (branch.waveform(name, n, 64)[1] for n in range(len(branch.omega)))
    return np.array([np.abs(wave).min() < 50e-6 for wave in waves])


system, guess, branch = follow(MESHES, step=0.08)
single = gl.harmonic_balance(system, FROM, TO, frequency="w", guess=guess, outputs=["q"], harmonics=1, step=0.12)
pressed = guess["q"] - 50e-6
print(f"\nthe ring's mesh is pressed together by {1e6 * pressed:.3f} um\n{branch.reached}")
print(f"one harmonic (describing function): folds at {', '.join(f'{w:.1f}' for w in single.fold_omega)} rad/s")
print("\nbacklash in       folds, rad/s       motions by Floquet              flanks part, rad/s (ring, sun, P unit)")
branches = {MESHES: branch} | {gaps: follow(gaps, step=0.25)[2] for gaps in (("ring",), ("sun", "pair"))}
for gaps, found in branches.items():
    folds = ", ".join(f"{w:.1f}" for w in found.fold_omega) or "none"
    between = found.omega[~found.stable]
    verdict = f"unstable {between.min():.0f} to {between.max():.0f}" if len(between) else "stable"
    lost = []
    for mesh, name in zip(MESHES, ("q", "q_sun", "q_pair")):
        apart = found.omega[parted(found, name)] if mesh in gaps else np.array([])
        lost.append(f"{apart.min():.0f} to {apart.max():.0f}" if len(apart) else "never")
    print(f"{', '.join(gaps):16} {folds:18} {verdict:30}  {'; '.join(lost)}")
print("none (linear)    none               stable at every speed, and passive")

# %%
# The ring's mesh alone parts: it vibrates most at this resonance. Gaps in the others stay closed by the load, and change nothing.
#
# Time integration finds the motion that its start leads to: from rest the small one, from a large motion the large one, if there is
# one. Each run lasts until it repeats.


def amplitude(w, start):
    """First harmonic of the ring's deflection over the last 20 periods of a run, and the state at its end."""
    period = 2 * np.pi / w
    run = system.simulate(
        320 * period, start=start, parameters={"w": w}, rtol=1e-7, method="rk", times=np.linspace(300, 320, 1281) * period
    )
    wave = run["q"][:-1] * np.exp(-1j * w * run.time[:-1])
    return 2 * abs(wave.mean()), {name: float(run[name][-1]) for name in system.states}


print("\nspeed, rad/s   from below, um   from above, um   harmonic balance, um")
table = []
large = guess
for w in (5800.0, 5450.0, 5250.0, 5050.0):
    small, _ = amplitude(w, guess)
    above, large = amplitude(w, large)
    crossings = np.flatnonzero(np.diff(np.sign(branch.omega - w)))
    balance = []
    for k in crossings:
        part = (w - branch.omega[k]) / (branch.omega[k + 1] - branch.omega[k])
        level = branch.amplitude("q", 1)
        if branch.stable[k] and branch.stable[k + 1]:
            balance.append(level[k] + part * (level[k + 1] - level[k]))
    table.append((w, small, above, balance))
    print(f"{w:12.0f} {1e6 * small:16.3f} {1e6 * above:16.3f}   {', '.join(f'{1e6 * a:.3f}' for a in balance)}")

# %%
# The picture: stable motions solid, unstable ones dashed.

fig, ax = plt.subplots(figsize=(8, 5), layout="constrained")
level = 1e6 * branch.amplitude("q", 1)
ax.plot(branch.omega, np.where(branch.stable, level, np.nan), color="C0", label="harmonic balance, stable")
ax.plot(branch.omega, np.where(branch.stable, np.nan, level), "--", color="C0", label="unstable")
ax.plot(single.omega, 1e6 * single.amplitude("q", 1), color="C1", lw=1, label="describing function")
ax.plot([row[0] for row in table], [1e6 * row[1] for row in table], "v", color="C2", label="time, from rest")
ax.plot([row[0] for row in table], [1e6 * row[2] for row in table], "^", color="C3", label="time, from the large motion")
ax.axhline(1e6 * pressed, color="0.6", lw=1)
ax.annotate("flanks part above", (5010, 1e6 * pressed), textcoords="offset points", xytext=(0, 4), fontsize=8, color="0.35")
ax.set(xlabel="angular frequency of the transmission error, rad/s", ylabel="first harmonic of the ring's deflection, µm")
ax.legend()
fig.savefig(FIGURES / "xp_weakly_nonlinear.png", dpi=110)
