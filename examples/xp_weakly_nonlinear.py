r"""
The XP train with backlash
==========================

Zhou and Cui [1]_ compare the linear XP train with a "weakly nonlinear" one (Fig. 6) without saying what makes it nonlinear. Here
one, two or all three meshes have a backlash of 100 µm. Under 100 N.m each is pressed together by 4.6 µm, and a transmission error
of 1 µm excites them. Where the resonance near 930 Hz makes a mesh vibrate by more than it is pressed together, its flanks part: the
resonance bends to lower speeds, and between two folds there are two stable motions.

Three methods are compared: the describing function (one harmonic), harmonic balance of the whole train, and time integration from
either side. Floquet multipliers tell which motions are stable. The linear train has no folds, and is stable at every speed. Then
the same for one planet with meshes of its own, and for the train with all its planets as it turns, with mesh stiffness that varies.

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
DEFLECTIONS = ("q", "q_sun", "q_pair")


class Loaded(gl.Component):
    """The XP train between a constant torque and a damper; all meshes have the transmission error ``E sin(w t)``."""

    gaps = gl.Structural(MESHES, "meshes that have backlash")
    planets = gl.Structural(3, "number of planets")
    planet_meshes = gl.Structural("lumped", "one mesh for all planets, or one for each")
    pair_sense = gl.Structural(
        1, "sense of the P unit's error: 1 as in the paper, -1 presses its teeth together with the others'"
    )
    E = gl.Parameter("m", "amplitude of the transmission error", default=1e-6)
    w = gl.Parameter("rad/s", "its angular frequency", default=8500.0)
    q = gl.Variable("m", "deflection of the ring's mesh")
    q_sun = gl.Variable("m", "deflection of the sun's mesh")
    q_pair = gl.Variable("m", "deflection of the P unit's mesh")

    def assemble(self):
        details = {f"{mesh}_details": GAP for mesh in self.gaps}
        rate = self.E * self.w * gl.cos(self.w * gl.time)
        self.drive, self.ground = gp.ConstantTorque(tau_constant=100.0), gp.Fixed()
        self.train = gp.XPTrain(
            planets=self.planets, planet_meshes=self.planet_meshes, Z_s=19, Z_p=31, Z_r=81, e_rate=rate,
            e_rate_pair=self.pair_sense * rate, **details,
        )  # fmt: skip
        self.load = gp.Damper(d=1800 * 0.075**2)
        return [
            gl.connect(self.drive.flange, self.train.flange_in),
            gl.connect(self.train.flange_out, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]

    def equations(self):
        unit = self.train.x_unit
        lumped = self.planet_meshes == "lumped"
        at_ring, at_sun = (unit.ring_mesh, unit.sun_mesh) if lumped else (unit.ring_meshes[0], unit.sun_meshes[0])
        return [
            gl.Eq(self.q, at_ring.q),
            gl.Eq(self.q_sun, at_sun.q),
            gl.Eq(self.q_pair, self.train.p_unit.mesh.q),
        ]


# %%
# The linear train first: stable, and passive whatever its parameters.

linear = gl.compile(Loaded(gaps=()), outputs=["q"])
print(gl.stability(linear))

# %%
# With backlash: the motion at rest, under the torque alone, is where the search for vibrations begins. The branch of periodic motions is
# followed through its folds, where runs jump; the Floquet multipliers of each motion say whether it is stable.

FROM, TO = 5900.0, 5000.0


def loaded(**choices):
    """The train with these choices, and its state under the torque alone."""
    system = gl.compile(Loaded(**choices), outputs=list(DEFLECTIONS))
    rest = system.simulate(3.0, samples=2, parameters={"E": 0.0})
    return system, {name: float(rest[name][-1]) for name in system.states}


def follow(system, guess, start=FROM, end=TO, **options):
    """Branch of periodic motions of a train."""
    return gl.harmonic_balance(system, start, end, frequency="w", guess=guess, outputs=list(DEFLECTIONS), **options)


def parted(branch, name):
    """Whether the flanks of a mesh part, for each motion of a branch."""
    waves = (branch.waveform(name, n, 64)[1] for n in range(len(branch.omega)))
    return np.array([np.abs(wave).min() < 50e-6 for wave in waves])


def unstable(branch):
    """Intervals of speed in which motions are unstable, in the order of the branch."""
    ends = np.flatnonzero(np.diff(np.concatenate([[True], branch.stable, [True]]).astype(int)))
    return [(branch.omega[a:b].min(), branch.omega[a:b].max()) for a, b in ends.reshape(-1, 2)]


system, guess = loaded()
branch = follow(system, guess, step=0.08)
single = gl.harmonic_balance(system, FROM, TO, frequency="w", guess=guess, outputs=["q"], harmonics=1, step=0.12)
pressed = guess["q"] - 50e-6
print(f"\nthe ring's mesh is pressed together by {1e6 * pressed:.3f} um\n{branch.reached}")
print(f"one harmonic (describing function): folds at {', '.join(f'{w:.1f}' for w in single.fold_omega)} rad/s")

# %%
# Backlash in one, two and all meshes, with the paper's planets, lumped at each mesh; then with one planet, and with three, each with two
# meshes of its own (the errors are 0.4 µm for the three). With one planet the error in the P unit is counted
# so that it presses all teeth together at the same time, and every mesh parts at the resonance near 7690 rad/s.

branches = {
    "ring, sun, pair": (MESHES, branch),
    "ring": (("ring",), follow(*loaded(gaps=("ring",)), step=0.25, harmonics=branch.harmonics)),
    "sun, pair": (("sun", "pair"), follow(*loaded(gaps=("sun", "pair")), step=0.25)),
    "one planet": (
        MESHES,
        follow(*loaded(planets=1, planet_meshes="separate", pair_sense=-1), 8600.0, 6000.0, step=0.15, harmonics=16),
    ),
}
print("\nbacklash in       folds, rad/s       unstable, rad/s            flanks part, rad/s (ring, sun, P unit)")
for title, (gaps, found) in branches.items():
    folds = ", ".join(f"{w:.1f}" for w in found.fold_omega) or "none"
    verdict = ", ".join(f"{low:.0f} to {high:.0f}" for low, high in unstable(found)) or "none"
    lost = []
    for mesh, name in zip(MESHES, DEFLECTIONS):
        apart = found.omega[parted(found, name)] if mesh in gaps else np.array([])
        lost.append(f"{apart.min():.0f} to {apart.max():.0f}" if len(apart) else "never")
    print(f"{title:16} {folds:18} {verdict:26} {'; '.join(lost)}")
print("none (linear)    none               none, and passive")

# %%
# With the paper's planets, lumped at each mesh, the ring's mesh alone parts: it vibrates most at this resonance. Gaps in the others stay
# closed by the load, and change nothing.
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
# The train as it turns
# ---------------------
# Each planet has meshes of its own, whose stiffness varies by 35 % with the mesh phase; the phases follow from the numbers of teeth. The
# torques are constant and balanced, so that the train turns at any speed. The phases are states that grow: those of the sun's meshes
# by a tooth in every period, those of the ring's meshes the other way. (The P unit's teeth meet 31/12 times as often; its stiffness is
# constant.)

W_SUN, W_RING, W_PLANET = 31 / 19, 23 / 27, -19 / 31  # speeds over that of the carrier


class Turning(gl.Component):
    """The XP train with all its planets, with backlash in every mesh, between two constant torques."""

    def assemble(self):
        varying = (("stiffness", "sinusoidal"), ("c_amplitude", 0.35), *GAP)
        self.train = gp.XPTrain(
            Z_s=19, Z_p=31, Z_r=81, planet_meshes="separate", ring_details=varying, sun_details=varying, pair_details=GAP
        )
        self.drive, self.load = gp.ConstantTorque(tau_constant=100.0), gp.ConstantTorque(tau_constant=-100.0 * W_RING)
        return [gl.connect(self.drive.flange, self.train.flange_in), gl.connect(self.train.flange_out, self.load.flange)]


turning = gl.compile(Turning())
unit = "train.x_unit."
suns, rings = ([f"{unit}{side}_meshes[{n}]" for n in range(3)] for side in ("sun", "ring"))


def unexcited(w):
    """Speeds at which the planets' teeth meet with an angular frequency, and deflections under the torques."""
    carrier = w / (19 * (W_SUN - 1))
    found = {f"{unit}planet[{n}].spin.w": W_PLANET * carrier for n in range(3)}
    found |= {f"{unit}ring_gear.w": W_RING * carrier, f"{unit}carrier_body.w": carrier, "train.shaft_at_sun.w": W_SUN * carrier}
    found |= {f"{mesh}.q": 50e-6 + pressed / 3 for mesh in suns + rings}
    return found | {"train.p_unit.mesh.q": -50e-6 - pressed}


phases = {f"{mesh}.turned": 1.0 for mesh in suns} | {f"{mesh}.turned": -1.0 for mesh in rings}
names = list(unexcited(1.0))
moving = gl.harmonic_balance(turning, 20000.0, 14000.0, turning=phases, guess=unexcited(20000.0), outputs=names, step=0.1)
worst = np.abs(moving.multipliers).max(axis=1)
intervals = ", ".join(f"{low:.0f} to {high:.0f}" for low, high in unstable(moving))
print(f"\nthe turning train: {moving.reached}; unstable by Floquet: {intervals} rad/s")

# %%
# Near twice the natural frequency of 9100 rad/s, which belongs to the planets against each other, the motion at the mesh frequency is
# unstable. Runs that begin beside it show the same growth, until flanks part and bound the vibration.

print("mesh frequency, rad/s   growth by Floquet, 1/s   in a run, 1/s")
for w in (17600.0, 18200.0):
    k = int(np.argmin(np.abs(moving.omega - w)))
    period = 2 * np.pi / moving.omega[k]
    start = {name: float(moving.waveform(name, k, 1)[1][0]) for name in names} | dict.fromkeys(phases, 0.0)
    beside = start | {f"{suns[1]}.q": start[f"{suns[1]}.q"] + 1e-9}
    run, other = (turning.simulate(40 * period, samples=41, start=x, rtol=1e-10, method="rk") for x in (start, beside))
    apart = np.array([other[f"{mesh}.q"] - run[f"{mesh}.q"] for mesh in suns + rings])
    changes = np.log(np.linalg.norm(np.diff(apart), axis=0))  # from period to period: what the train keeps drops out
    slope = np.polyfit(run.time[24:40], changes[24:40], 1)[0]
    print(f"{moving.omega[k]:14.0f} {np.log(worst[k]) / period:22.1f} {slope:20.1f}")

# %%
# The pictures: stable motions solid, unstable ones dashed.

fig, (ax, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained", width_ratios=[3, 2])
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
right.plot(moving.omega, worst, ".-")
right.axhline(1.0, color="0.6", lw=1)
right.set(xlabel="mesh frequency, rad/s", ylabel="largest Floquet multiplier", title="The turning train")
fig.savefig(FIGURES / "xp_weakly_nonlinear.png", dpi=110)
