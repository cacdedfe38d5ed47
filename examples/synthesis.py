r"""
Which single-loop train for a given ratio?
==========================================

A planetary set (X unit) has three shafts and two degrees of freedom. Join two of its shafts, ``u`` and ``v``, by a gear of fixed ratio (P
unit), and a loop with one degree of freedom is left: power goes in or out at ``u`` and at the third shaft ``w``. With the input at ``w`` it
is an XP train (the branches meet at the output, as in Zhou and Cui's [1]_), with the input at ``u`` a PX train, and if the
gear of fixed ratio is a planetary set with one shaft held, an XX train.

This script enumerates them for one wanted ratio, with numbers of teeth: kinematics, efficiency both ways, circulating power,
self-locking and natural frequencies. The search uses closed forms; gearlib then computes the designs from their parts.

.. [1] X. Zhou, Y. Cui, "Dynamic characteristics of single-loop gear system based on bond graph method", Journal of
   Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290
.. [2] R. H. Macmillan, "Power flow and loss in differential mechanisms", Journal of Mechanical Engineering Science 3 (1961), 37-41.
   Proved for all trains of one degree of freedom in Proceedings of the Institution of Mechanical Engineers 205 (1991),
   https://doi.org/10.1243/PIME_PROC_1991_205_151_02
.. [3] H. W. Mueller, "Epicyclic Drive Trains", Wayne State University Press, 1982.
.. [4] E. Pennestri, F. Freudenstein, "The mechanical efficiency of epicyclic gear trains", Journal of Mechanical Design 115
   (1993), 645-651. https://doi.org/10.1115/1.2919239
"""

from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

FIGURES = Path("examples/figures" if Path("examples").is_dir() else "figures")
FIGURES.mkdir(exist_ok=True)
WANTED, NEAR = 20.0, 0.01  # speed of the input over speed of the output, either sense; relative tolerance
ETA_X, ETA_P = 0.985**2, 0.98  # of a planetary set seen from its carrier (two meshes), and of a pair of gears
SHAFTS = ("sun", "ring", "carrier")


# %%
# Closed forms
# ------------
# Willis' equation ties the speeds of a set with :math:`k = Z_r / Z_s`. Its torques follow from one of them: seen from the carrier
# power goes from the sun to the ring or back, and the meshes take their part of that (Mueller [3]_, Pennestri and Freudenstein [4]_).


def willis(k):
    """Coefficients of the speeds of sun, ring and carrier, whose sum is zero; without losses the ratios of the torques, too."""
    return {"sun": np.ones_like(k), "ring": k, "carrier": -(1 + k)}


def set_torques(k, eta, speed, sun):
    """Torques on the three shafts, where that on the sun is given."""
    k = k * np.where(sun * (speed["sun"] - speed["carrier"]) > 0, eta, 1 / eta)
    return {name: sun * factor for name, factor in willis(k).items()}


class Train(NamedTuple):
    """A single-loop train: shafts of the set, the gear between v and u, and numbers of teeth (arrays: many at once)."""

    w: str
    u: str
    v: str
    gear: str  # "pair", "idler", or the held shaft of a second set
    ends: tuple  # shafts of the second set at v and at u
    k: np.ndarray  # teeth of the ring over teeth of the sun
    i: np.ndarray  # speed of v over speed of u
    k_2: np.ndarray  # of the second set

    def speeds(self):
        """With one radian per second at u."""
        a = willis(self.k)
        return {self.u: np.ones_like(self.i), self.v: self.i, self.w: -(a[self.u] + a[self.v] * self.i) / a[self.w]}

    def powers(self, sense, eta_x=ETA_X, eta_p=ETA_P):
        """What goes in at w, at u, and from v through the gear, where the torque on the sun is `sense`."""
        speed = self.speeds()
        torque = set_torques(self.k, eta_x, speed, sense)
        into = -torque[self.v]
        if self.gear in SHAFTS:
            at_v, at_u = self.ends
            second = {at_v: speed[self.v], at_u: speed[self.u], self.gear: 0.0}
            sun = np.where((at_v == "carrier") ^ (into > 0), 1.0, -1.0)
            found = set_torques(self.k_2, eta_x, second, sun)
            out = found[at_u] * into / found[at_v]
        else:
            eta = eta_p if self.gear == "pair" else eta_p**2
            out = -self.i * into * np.where(into * self.i > 0, eta, 1 / eta)
        return torque[self.w] * speed[self.w], torque[self.u] + out, into * self.i

    def efficiencies(self, eta_x=ETA_X, eta_p=ETA_P):
        """From w to u and from u to w; 0 where the train locks."""
        found = []
        for sign in (1, -1):
            sense = sign * np.sign(self.powers(1.0, 1.0, 1.0)[0])
            at_w, at_u, _ = self.powers(sense, eta_x, eta_p)
            found.append(np.maximum(-at_u / at_w if sign > 0 else -at_w / at_u, 0.0) * (sign * at_w > 0))
        return found

    def circulating(self):
        """Power that goes round in the loop over the power that goes through the train, without losses."""
        at_w, _, through = self.powers(1.0, 1.0, 1.0)
        with np.errstate(divide="ignore"):  # infinite where w stands still
            return np.maximum(0.0, np.maximum(-through / at_w, through / at_w - 1))


# %%
# Enumeration
# -----------
# Sets with three equal planets: :math:`Z_r = Z_s + 2 Z_p`, and :math:`Z_s + Z_r` a multiple of 3. Pairs: 18 to 90 teeth; an idler
# turns the sense. The second set has one shaft held, in three ways, either way round.

SETS = np.array([(s, s + 2 * p) for s in range(18, 43, 3) for p in range(18, 43) if (2 * s + 2 * p) % 3 == 0])
PAIRS = np.array([(a, b) for a in range(18, 91, 6) for b in range(18, 91)])
K = SETS[:, 1] / SETS[:, 0]
HELD = {
    ("ring", ("sun", "carrier")): 1 + K,
    ("ring", ("carrier", "sun")): 1 / (1 + K),
    ("carrier", ("sun", "ring")): -K,
    ("carrier", ("ring", "sun")): -1 / K,
    ("sun", ("ring", "carrier")): (1 + K) / K,
    ("sun", ("carrier", "ring")): K / (1 + K),
}
GEARS = {("pair", ()): -PAIRS[:, 1] / PAIRS[:, 0], ("idler", ()): PAIRS[:, 1] / PAIRS[:, 0], **HELD}


def candidates(wanted):
    """All trains near the wanted ratio: kind, train, and numbers of teeth of both gears."""
    found = []
    for w, u, v in permutations(SHAFTS):
        a = willis(K)
        for kind in ("X-", "-X"):  # input at w, input at u
            for sense in (1, -1):
                at_w = sense * (wanted if kind == "X-" else 1 / wanted)
                needed = -(a[w] * at_w + a[u]) / a[v]
                for (gear, ends), offered in GEARS.items():
                    nearest = np.abs(needed[:, None] - offered).argmin(axis=1)
                    train = Train(w, u, v, gear, ends, K, offered[nearest], K[nearest] if gear in SHAFTS else K)
                    good = np.abs(train.speeds()[w] / at_w - 1) < NEAR
                    if good.any():
                        teeth = (SETS if gear in SHAFTS else PAIRS)[nearest[good]]
                        kept = train._replace(k=K[good], i=train.i[good], k_2=train.k_2[good])
                        name = kind.replace("-", "X" if gear in SHAFTS else "P")
                        found.append((name, kind == "X-", kept, SETS[good], teeth))
    return found


def one(train, index):
    """One of many trains."""
    return train._replace(k=train.k[index], i=train.i[index], k_2=train.k_2[index])


found = candidates(WANTED)
print(
    f"{sum(len(teeth) for *_, teeth in found)} trains in {len(found)} arrangements have the ratio {WANTED:g} within {100 * NEAR:g} %"
)

best = []  # the most efficient of each arrangement
cloud = {}
barred, free = [], []  # efficiency of trains that lock backwards, and of those that do not
for kind, from_w, train, teeth_x, teeth_p in found:
    ahead, back = train.efficiencies() if from_w else train.efficiencies()[::-1]
    cloud.setdefault(kind, []).append((train.circulating(), ahead))
    barred += ahead[(back == 0) & (ahead > 0)].tolist()
    free += ahead[back > 0].tolist()
    n = int(ahead.argmax())
    best.append((float(ahead[n]), float(back[n]), kind, from_w, one(train, n), teeth_x[n], teeth_p[n]))
best.sort(key=lambda row: -row[0])

# %%
# From parts
# ----------
# The same trains as models: rigid with mesh losses, for statics and motion, and with elastic meshes, for natural frequencies. The table
# has the most efficient train of each arrangement; the frequencies are the three lowest above 0.


class Rigid(gl.Component):
    """Drive, single-loop train with losses, load; a flywheel at either end."""

    w, u, v = gl.Structural("ring"), gl.Structural("carrier"), gl.Structural("sun")
    gear, ends = gl.Structural("pair"), gl.Structural(())
    eta_x, eta_p = gl.Structural(ETA_X), gl.Structural(ETA_P)
    k = gl.Parameter("1", "ratio of the set", default=2.0)
    i = gl.Parameter("1", "speed of v over speed of u", default=2.0)
    k_2 = gl.Parameter("1", "ratio of the second set", default=2.0)

    def assemble(self):
        mesh = ((0.0, self.eta_x, self.eta_x),)
        self.x = gp.LossyPlanetary(ratio=self.k, sun_mesh=mesh)
        self.at_w, self.at_u = gp.Torque(), gp.Torque()
        self.body_w, self.body_u = gp.Inertia(J=0.01), gp.Inertia(J=0.01)
        if self.gear in SHAFTS:
            self.p, self.housing = gp.LossyPlanetary(ratio=self.k_2, sun_mesh=mesh), gp.Fixed()
            at_v, at_u = (getattr(self.p, end) for end in self.ends)
            links = [gl.connect(getattr(self.p, self.gear), self.housing.flange)]
        else:
            eta = self.eta_p if self.gear == "pair" else self.eta_p**2
            self.p, links = gp.LossyGear(ratio=self.i, loss_table=((0.0, eta, eta, 0.0, 0.0),)), []
            at_v, at_u = self.p.flange_a, self.p.flange_b
        return [
            *links,
            gl.connect(self.at_w.flange, self.body_w.flange_a),
            gl.connect(self.body_w.flange_b, getattr(self.x, self.w)),
            gl.connect(getattr(self.x, self.v), at_v),
            gl.connect(getattr(self.x, self.u), at_u, self.body_u.flange_a),
            gl.connect(self.body_u.flange_b, self.at_u.flange),
        ]


def rigid(train, **choices):
    """The train as a compiled model, and its ratio by the kinematics of its parts."""
    values = {"k": float(train.k), **({"k_2": float(train.k_2)} if train.gear in SHAFTS else {"i": float(train.i)})}
    if train.gear in SHAFTS:
        choices.pop("eta_p", None)
    names = {name: getattr(train, name) for name in ("w", "u", "v", "gear", "ends")}
    return gl.compile(Rigid(**names, **values, **choices), outputs=["body_w.w", "body_u.w"])


MODULE, WIDTH, STEEL, STIFFNESS = 3e-3, 0.03, 7850.0, 1.4e10  # m, m, kg/m3, N/m for each metre of width


def wheel(teeth):
    """Pitch radius and moment of inertia of a disc."""
    radius = MODULE * teeth / 2
    return radius, np.pi / 2 * STEEL * WIDTH * radius**4


class Elastic(gl.Component):
    """The train with elastic meshes and planets of their own, between a drive (0.05 kg m2) and a load (1 kg m2)."""

    w, u, v = gl.Structural("ring"), gl.Structural("carrier"), gl.Structural("sun")
    gear, ends = gl.Structural("pair"), gl.Structural(())
    teeth_x, teeth_p = gl.Structural((18, 54)), gl.Structural((18, 54))
    J_w, J_u = gl.Parameter("kg.m2", "body at w"), gl.Parameter("kg.m2", "body at u")

    def planetary(self, teeth):
        (R_s, I_s), (R_p, I_p) = wheel(teeth[0]), wheel((teeth[1] - teeth[0]) / 2)
        I_r, orbit = wheel(teeth[1])[1], np.pi * STEEL * WIDTH * R_p**2 * (R_s + R_p) ** 2
        stiff = {"K_ring": STIFFNESS * WIDTH, "K_sun": STIFFNESS * WIDTH, "C_ring": 500.0, "C_sun": 500.0}
        return gp.TorsionalPlanetaryUnit(
            planets=3, R_s=R_s, R_p=R_p, I_s=I_s, I_r=0.5 * I_r, I_h=0.5 * I_r, I_spin=I_p, I_orbit=orbit, **stiff
        )

    def pair(self, first, second):
        (R_1, I_1), (R_2, I_2) = wheel(first), wheel(second)
        return gp.FixedAxisUnit(R_1=R_1, R_2=R_2, I_1=I_1, I_2=I_2, K_g=STIFFNESS * WIDTH, C_g=500.0)

    def assemble(self):
        self.x, self.body_w, self.body_u = self.planetary(self.teeth_x), gp.Inertia(J=self.J_w), gp.Inertia(J=self.J_u)
        first, second = (int(z) for z in self.teeth_p)
        if self.gear in SHAFTS:
            self.p, self.housing = self.planetary(self.teeth_p), gp.Fixed()
            at_v, at_u = (getattr(self.p, end) for end in self.ends)
            links = [gl.connect(getattr(self.p, self.gear), self.housing.flange)]
        else:
            self.p, links = self.pair(first, second), []
            at_v, at_u = self.p.flange_a, self.p.flange_b
            if self.gear == "idler":
                self.p_2 = self.pair(second, second)
                links, at_u = [gl.connect(at_u, self.p_2.flange_a)], self.p_2.flange_b
        return [
            *links,
            gl.connect(self.body_w.flange_a, getattr(self.x, self.w)),
            gl.connect(getattr(self.x, self.v), at_v),
            gl.connect(getattr(self.x, self.u), at_u, self.body_u.flange_a),
        ]


def frequencies(train, from_w, teeth_x, teeth_p):
    """Natural frequencies of the train with elastic meshes, Hz."""
    names = {name: getattr(train, name) for name in ("w", "u", "v", "gear", "ends")}
    ends = (0.05, 1.0) if from_w else (1.0, 0.05)
    teeth = {"teeth_x": tuple(teeth_x.tolist()), "teeth_p": tuple(teeth_p.tolist())}
    return np.sort(gl.modes(gl.compile(Elastic(**names, **teeth, J_w=ends[0], J_u=ends[1]))).frequencies)


print(
    "\ntrain input    output   gear between v and u             teeth of set, gear    ratio       ahead   back   circulating  lowest, Hz"
)
for ahead, back, kind, from_w, train, teeth_x, teeth_p in best:
    ends = (train.w, train.u) if from_w else (train.u, train.w)
    ratio = train.speeds()[train.w] if from_w else 1 / train.speeds()[train.w]
    gear = f"X, {train.gear} held" if train.gear in SHAFTS else train.gear
    gear = f"{train.v} - {gear} - {train.u}"
    teeth = f"{teeth_x[0]}/{teeth_x[1]}, {teeth_p[0]}/{teeth_p[1]}"
    low = ", ".join(f"{f:.0f}" for f in frequencies(train, from_w, teeth_x, teeth_p)[1:4])
    print(
        f"{kind:5} {ends[0]:8} {ends[1]:8} {gear:32} {teeth:19} {ratio:8.3f} {ahead:11.4f}   "
        f"{f'{back:.4f}' if back > 0 else 'locks '} {float(train.circulating()):9.3f}      {low}"
    )

# %%
# The cause of low efficiency is circulating power: it passes through meshes and comes back. Where more than half of the power is lost
# on the way ahead, the way back is barred, more or less: the train locks itself.

print(f"\ntrains that lock have an efficiency of up to {max(barred):.3f}, those that do not, of {min(free):.3f} and more")

# %%
# Three designs
# -------------
# A PX train, an XX train and one that locks, each checked against closed forms of the literature: the ratio (Willis), the power in the loop
# (Macmillan [2]_: the fraction of the power through the gear is the logarithmic derivative of the train's ratio by the
# gear's, so that it follows from the kinematics alone), the efficiency (torques above). gearlib knows no such formula: it solves the
# equations of the parts, for a steady motion, or over time from rest.

designs = [
    next(row for row in best if row[2] == "PX"),
    next(row for row in best if row[2] == "XX" and row[4].circulating() > 0.1),
]
designs.append(next(row for row in best if row[1] == 0))
print(f"\n{'':40} ratio   circulating  efficiency   rad/s after 1 s   back")
for ahead, back, kind, from_w, train, *_ in designs:
    begin, end = ("w", "u") if from_w else ("u", "w")
    system, ideal = rigid(train), rigid(train, eta_x=1.0, eta_p=1.0)
    ratio = gl.speed_ratio(system, f"body_{begin}.w", f"body_{end}.w")
    flow = ideal.power_flow(speeds={f"body_{begin}.w": 100.0}, torques={f"at_{end}.tau": -50.0 * np.sign(ratio)})
    around = flow.circulating_power / flow.input_power
    steady = system.power_flow(speeds={f"body_{begin}.w": 100.0}, torques={f"at_{end}.tau": -50.0 * np.sign(ratio)})

    # by the kinematics alone: how the ratio changes with that of the gear
    change = 1e-6
    other = [train._replace(i=train.i * (1 + sign * change)).speeds()[train.w] for sign in (1, -1)]
    fraction = (other[0] - other[1]) / (2 * change) / train.speeds()[train.w]  # d ln(w_w / w_u) / d ln(i)
    macmillan = max(0.0, -fraction, fraction - 1)

    # from rest: 10 N.m at the input; half of what the train could hold still at the output
    load = -10.0 * abs(ratio) * ahead * 0.5 * np.sign(ratio)
    torques = {f"at_{begin}.tau": 10.0, f"at_{end}.tau": load}
    run = system.simulate(1.0, samples=3, inputs=torques)
    accelerated = run[f"body_{begin}.w"][-1]
    inertia = 0.01 + 0.01 / ratio**2 / ahead  # of both bodies, at the input
    expected = (10.0 + load / ratio / ahead) / inertia
    driven = system.simulate(1.0, samples=3, inputs={f"at_{begin}.tau": 0.0, f"at_{end}.tau": 10.0})
    backwards = round(driven[f"body_{end}.w"][-1], 3) + 0.0  # not -0.0

    by_hand = float(train.speeds()[train.w] if from_w else 1 / train.speeds()[train.w])
    title = f"{kind}, {train.v} - {train.gear} - {train.u}"
    print(
        f"{title:26} gearlib {ratio:11.6f} {around:11.6f} {steady.efficiency:12.8f} {accelerated:13.4f}     {backwards:.3f} rad/s"
    )
    print(f"{'':26} by hand {by_hand:11.6f} {macmillan:11.6f} {ahead:12.8f} {expected:13.4f}     efficiency {back:.4f}")

# %%
# The map
# -------
# Circulating power of the paper's train over the ratio of its coupling, ``m_22``, and that of its set: the input is the ring, and the sun
# leads through the pair to the carrier, with :math:`i = m_{22} R_2 / R_1`. Points are computed by gearlib from the parts.

GEOMETRY = 0.0465 / 0.0285  # R_2 / R_1 of the paper's pair
m_22, k = np.linspace(-4.0, 6.0, 401), np.linspace(1.5, 8.0, 261)
paper = Train("ring", "carrier", "sun", "pair", (), *np.broadcast_arrays(k[:, None], GEOMETRY * m_22[None, :], 1.0))
around = paper.circulating()
ideal = rigid(Train("ring", "carrier", "sun", "pair", (), 4.0, 1.0, 1.0), eta_x=1.0, eta_p=1.0)
checked, difference = [(-3.0, 3.0), (-1.0, 6.0), (0.5, 5.0), (1.0, 81 / 19), (2.0, 7.0), (4.0, 2.5), (5.0, 5.5)], 0.0
for m, ratio in checked:
    values = {"k": ratio, "i": GEOMETRY * m}
    flow = ideal.power_flow(speeds={"body_w.w": 10.0}, torques={"at_w.tau": 1.0}, parameters=values)
    by_hand = float(Train("ring", "carrier", "sun", "pair", (), np.array(ratio), np.array(GEOMETRY * m), 1.0).circulating())
    difference = max(difference, abs(flow.circulating_power / flow.input_power - by_hand))
print(f"\nlargest difference of the map from gl.power_flow at {len(checked)} points: {difference:.1e}")

fig, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
levels = [0, 0.1, 0.25, 0.5, 1, 2, 4, 8, 1e9]
filled = left.contourf(m_22, k, around, levels=levels, norm=plt.matplotlib.colors.BoundaryNorm(levels, 256), cmap="YlOrRd")
left.contour(m_22, k, around, levels=levels[1:-1], colors="0.4", linewidths=0.5)
left.plot((1 + k) / GEOMETRY, k, "k--", lw=1)
left.annotate(
    "the ring stands still", (6.4 / GEOMETRY, 5.4), xytext=(-3.8, 4.1), fontsize=8, arrowprops={"arrowstyle": "-", "lw": 0.5}
)
left.plot(*np.array(checked).T, "o", mfc="white", mec="black", ms=5, label="checked by gl.power_flow")
left.plot(1.0, 81 / 19, "k*", ms=11, label="the paper's train")
left.legend(loc="upper left", fontsize=8)
bar = fig.colorbar(filled, ax=left, ticks=levels[:-1], label="circulating power over input power")
left.set(
    xlabel="$m_{22}$, ratio of the gear pair",
    ylabel="teeth of the ring over teeth of the sun",
    title="XP: ring in, sun - pair - carrier",
    xlim=(-4, 6),
)
for (kind, points), marker in zip(sorted(cloud.items()), "o^s"):
    x, y = np.concatenate([np.array(pair) for pair in points], axis=1)
    right.plot(x, y, marker, ms=4, alpha=0.5, mew=0, label=f"{kind}, {len(x)} trains")
right.set(
    xscale="symlog",
    xlabel="circulating power over input power",
    ylabel="efficiency",
    title=f"All trains with the ratio {WANTED:g}",
)
right.axhline(0.5, color="0.6", lw=0.8)
right.annotate(
    "below, most trains lock backwards", (0.0, 0.5), textcoords="offset points", xytext=(4, 3), fontsize=8, color="0.35"
)
right.grid(alpha=0.3)
right.legend()
fig.savefig(FIGURES / "synthesis.png", dpi=100)
plt.show()
