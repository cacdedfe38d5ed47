r"""
Which reading has a gain margin of 7.05 dB?
===========================================

Zhou and Cui [1]_ print one number in their discussion of stability: a gain margin of 7.05 dB for the part of the XP train "from the input
end to the x-type element body" (Fig. 7). They name neither the output nor where the part ends, and leave values of the train open. This
script takes every reading that these choices leave: the whole train and the X unit alone, cut off by `gl.cut` in four ways; each input and
each output; and the parameters that the paper does not print. It counts how many of them have a margin of 7.05 dB, and how many would have
any other number: if the one is as good as the other, a number that agrees identifies nothing.

.. [1] X. Zhou, Y. Cui, "Dynamic characteristics of single-loop gear system based on bond graph method", Journal of
   Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290
"""

from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

FIGURES = Path("examples/figures" if Path("examples").is_dir() else "figures")
FIGURES.mkdir(exist_ok=True)
PRINTED, NEAR = 7.05, 0.03  # dB

# %%
# The systems. Cut at the sun and at the coupling, the X unit keeps its load; cut at the carrier itself it has none.

X_OUTPUTS = [
    "w_in", "w_sun", "w_out", "q_ring", "q_sun", "train.x_unit.ring_mesh.f", "train.x_unit.sun_mesh.f",
    "train.x_unit.planets_at_ring.w", "train.x_unit.planets_at_sun.w", "train.x_unit.planet[0].spin.w",
    "train.x_unit.support[0].tau",
]  # fmt: skip
WHOLE = [
    *X_OUTPUTS,
    "q_pair",
    "train.p_unit.mesh.f",
    "train.p_unit.gear_2.w",
    "train.x_unit.sun.tau",
    "train.p_unit.flange_a.tau",
]
SUN, LOADED, BARE = "train.x_unit.sun", "train.coupling.flange_b", "train.x_unit.carrier"


def alone(*places, **ends):
    """The X unit, cut off."""
    return gl.compile(gl.cut(gp.ZhouCui2022(), *places, **ends), outputs=X_OUTPUTS)


SYSTEMS = {
    "whole train": (gl.compile(gp.ZhouCui2022(), outputs=WHOLE), WHOLE),
    "X unit, sun free, loaded": (alone(SUN, LOADED), X_OUTPUTS),
    "X unit, sun free, no load": (alone(SUN, BARE), X_OUTPUTS),
    "X unit, sun held, loaded": (alone(SUN, LOADED, given={SUN: "held"}), X_OUTPUTS),
    "X unit, sun held, no load": (alone(SUN, BARE, given={SUN: "held"}), X_OUTPUTS),
}
INPUTS = ["tau_in", "e_rate_ring", "e_rate_sun"]

# %%
# What the paper leaves open: the ratio of the coupling, the P unit's gears, the size of the support damping that follows from C_v, and on
# which flank a force or deflection is counted positive.

defaults = SYSTEMS["whole train"][0].parameters
sun, planet = ({key: defaults[f"{kind}_{part}"] for key, kind in (("R", "R"), ("I", "I"))} for part in ("s", "p"))
SETS = [
    {"m_22": m_22, "R_1": one["R"], "I_1": one["I"], "R_2": two["R"], "I_2": two["I"], "C_v": C_v}
    for m_22, (one, two), C_v in product(
        (0.5, 1.0, 2.0), ((sun, planet), (planet, sun), (sun, sun)), (defaults["C_v"], 10 * defaults["C_v"])
    )
]

# %%
# Gain margins of all transfer functions of one linear model at once, from its eigenvalues. A crossing of the negative real axis where the
# curve begins or ends (at zero or infinite frequency) counts as well: there the margin is that of a static gain.

OMEGA = np.geomspace(1e-2, 1e6, 4001)


def margins(linear):
    """(input, output, sign, gain margin in dB) where the curve crosses the negative real axis; the outermost crossing counts."""
    values, vectors = np.linalg.eig(linear.A)
    left, right = linear.C @ vectors, np.linalg.solve(vectors, linear.B)
    found = []
    for i, j in np.ndindex(linear.D.shape):
        residues = left[i] * right[:, j]

        def curve(omega, residues=residues, direct=linear.D[i, j]):
            return (residues / (1j * np.atleast_1d(omega)[:, None] - values)).sum(axis=1) + direct

        G = curve(OMEGA)
        if abs(G).max() <= 1e-12:
            continue
        k = np.flatnonzero((np.diff(np.sign(G.imag)) != 0) & (abs(G[1:]) > 1e-9 * abs(G).max()))
        low, high = OMEGA[k], OMEGA[k + 1]
        below = G.imag[k]
        for _ in range(30):  # bisection
            middle = np.sqrt(low * high)
            same = np.sign(curve(middle).imag) == np.sign(below)
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        crossed = list(curve(low).real) if len(k) else []
        if abs(G[0].imag) < 1e-3 * abs(G[0]):  # begins on the real axis
            crossed.append(G[0].real)
        for sign in (1, -1):
            sizes = [-sign * x for x in crossed if sign * x < 0]
            if sizes:
                found.append((j, i, sign, -20 * np.log10(max(sizes))))
    return found


rows = []
total = 0
for name, (system, outputs) in SYSTEMS.items():
    for values in SETS:
        linear = system.linearize(INPUTS, outputs, parameters=values)
        total += 2 * linear.D.size
        rows += [
            (name, INPUTS[j], ("" if sign > 0 else "-") + outputs[i], margin, values) for j, i, sign, margin in margins(linear)
        ]
found = np.array([row[3] for row in rows])
print(f"{total} readings, {len(rows)} with a finite gain margin, between {found.min():.1f} and {found.max():.1f} dB")

# %%
# Which of them come near 7.05 dB, and how many come as near to other numbers?

near = [row for row in rows if abs(row[3] - PRINTED) <= NEAR]
print(f"within {NEAR} dB of {PRINTED} dB: {len(near)}")
for name, source, output, margin, values in near[:12]:
    where = f"m_22 = {values['m_22']}, R_1 = {values['R_1']}, R_2 = {values['R_2']}, C_v = {values['C_v']:g}"
    print(f"  {margin:6.3f} dB  {name}: {source} -> {output}, {where}")
others = np.arange(-20.0, 60.0, 2 * NEAR)
hits = np.array([np.sum(np.abs(found - other) <= NEAR) for other in others])
print(
    f"of {len(others)} other numbers between -20 and 60 dB {np.mean(hits > 0):.0%} are met, each {hits.mean():.1f} times on average"
)

default = [row for row in rows if row[4]["m_22"] == 1.0 and row[4]["R_1"] == sun["R"] and row[4]["R_2"] == planet["R"]]
default = [row for row in default if row[4]["C_v"] == defaults["C_v"]]
closest = min(default, key=lambda row: abs(row[3] - PRINTED))
distance = abs(closest[3] - PRINTED)
print(f"closest with the default values: {closest[3]:.2f} dB, {closest[0]}: {closest[1]} -> {closest[2]}")
plain = np.array([row[3] for row in default])
as_close = np.mean([np.abs(plain - other).min() <= distance for other in others])
print(f"  as close to one of these {len(plain)} readings as that: {as_close:.0%} of all numbers between -20 and 60 dB")
report = gl.stability(
    SYSTEMS[closest[0]][0], (closest[1], closest[2].removeprefix("-")), gain=-1.0 if closest[2][0] == "-" else 1.0
)
print(f"  its closed loop is {report.loop.verdict}; the paper calls it stable")

fig, ax = plt.subplots(figsize=(8, 4), layout="constrained")
ax.hist(np.clip(found, -60, 200), bins=np.arange(-60, 201, 2), color="C0")
ax.axvline(PRINTED, color="C3", label="printed: 7.05 dB")
ax.set(xlabel="gain margin, dB", ylabel="readings", title="Gain margins of the readings that the paper leaves open")
ax.legend()
fig.savefig(FIGURES / "paper_gain_margin.png", dpi=100)
plt.show()
