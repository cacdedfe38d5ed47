r"""
Section 4 of Zhou and Cui, row by row
=====================================

Section 4 of the paper [1]_ reads stability from Nyquist and Nichols diagrams: of the whole train (Figs. 5 and 6), of the part
from the input to the X unit (Fig. 7, with a printed gain margin of 7.05 dB), and of the part from the input to the P unit
(Fig. 8). It names no output of any transfer function, and its figures hold no data. For each figure this script takes the
readings that suggest themselves, says which transfer function it used, and prints poles, margins and Nyquist's count; the page
:doc:`/paper_section_4` compares the verdicts.

A gear train is no control loop. "Closed loop" here means that the output is subtracted from the input, with a gain of 1 in SI
units, as the paper's diagrams imply; gains of other units move every gain margin by as many decibels.

.. [1] X. Zhou, Y. Cui, "Dynamic characteristics of single-loop gear system based on bond graph method", Journal of
   Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290
"""

from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

FIGURES = Path("examples/figures" if Path("examples").is_dir() else "figures")
FIGURES.mkdir(exist_ok=True)
PRINTED = 7.05  # dB, gain margin in Fig. 7(b)

system = gl.compile(gp.ZhouCui2022())
HEADER = "transfer function                                 poles, largest real part   gain margin, dB   phase margin, deg   N  closed loop"


def row(model, source, output, name=None, sign=1.0):
    """Print one reading; return its report."""
    report = gl.stability(model, (source, output), gain=sign)
    margins = report.loop.margins
    text = name or f"{source} -> {output}"
    print(
        f"{text:50} {report.eigenvalues.real.max():22.3f} {margins.gain_margin_db:17.2f} {margins.phase_margin:19.2f} "
        f"{report.loop.nyquist.clockwise:3d}  {report.loop.verdict}"
    )
    return report


def diagrams(model, source, output, number, title):
    """Nyquist and Nichols diagrams of one reading."""
    fig = plt.figure(figsize=(10, 9), layout="constrained")
    upper, lower = fig.subfigures(2, 1, height_ratios=[1, 1])
    gl.nyquist_plot(model, (source, output), axes=upper.subplots(1, 2))
    gl.nichols_plot(model, (source, output), axes=lower.subplots())
    upper.suptitle(f"{title}, {source} → {output}")
    fig.savefig(FIGURES / f"paper_fig_{number}.png", dpi=90)


# %%
# Figure 5: the linear system
# ---------------------------
# The input of the paper's simulation is the torque on the ring, Se1, and its output the carrier's speed. The paper: the curve does
# not enclose -1, crosses the positive real axis twice clockwise, so "the system is unstable".

print("Fig. 5, linear system\n" + HEADER)
report = row(system, "tau_in", "w_out", "torque on the ring -> speed of the carrier")
row(system, "tau_in", "w_in", "torque on the ring -> speed of the ring")
row(system, "train.e_rate", "w_out", "transmission error's rate -> speed of the carrier")
print()
print(report)
diagrams(system, "tau_in", "w_out", 5, "Fig. 5: whole train, linear")

# %%
# Every pole lies in the left half-plane. It must: springs and dampers with positive constants only store and dissipate, so no set
# of positive parameters makes the linear train unstable. A check at random:

rng = np.random.default_rng(2022)
names = ["R_s", "R_p", "I_s", "I_p", "I_r", "I_h", "I_f", "K_g", "C_g", "C_v"]
worst = -np.inf
for _ in range(200):
    values = {n: system.parameters[n] * 10 ** rng.uniform(-1, 1) for n in names}
    values |= {"R_r": values["R_s"] + 2 * values["R_p"], "R_h": values["R_s"] + values["R_p"]}
    worst = max(worst, gl.stability(system, parameters=values).eigenvalues.real.max())
print(f"\nlargest real part of a pole over 200 random sets of parameters, a decade each way: {worst:.3g} 1/s")

# %%
# Criterion and curve: where does the curve cross the real axis? A crossing of the positive real axis is of no consequence
# for Nyquist's criterion, which counts turns round -1.

omega = np.geomspace(1e-1, 1e6, 200_001)
response = gl.frequency_response(system, omega, ["tau_in"], ["w_out"])["w_out"]
at = np.flatnonzero(np.diff(np.sign(response.imag)))
crossings = [f"{response.real[i]:+.3g} at {omega[i]:.5g} rad/s" for i in at]
print(f"real axis crossed at {', '.join(crossings)}; start {response.real[0]:+.4g}, end {abs(response[-1]):.1e}")

# %%
# Figure 6: the weakly nonlinear system
# -------------------------------------
# The paper does not define "weakly nonlinear"; it finds infinite gain and phase margins. Equivalent linearisation replaces a mesh with
# backlash by a spring whose stiffness depends on the amplitude: K_g times a factor between 0 and 1. The linear model covers it.

print("\nFig. 6, equivalent linearisation: mesh stiffness times a factor\n" + HEADER)
for factor in (1.0, 0.8, 0.5, 0.2, 0.05):
    values = {"K_g": factor * system.parameters["K_g"]}
    linear = system.linearize(["tau_in"], ["w_out"], parameters=values)
    row(linear, "tau_in", "w_out", f"torque -> speed of the carrier, {factor:g} K_g")
diagrams(system.linearize(["tau_in"], ["w_out"], parameters={"K_g": 0.5 * system.parameters["K_g"]}), "tau_in", "w_out", 6,
         "Fig. 6: whole train, mesh stiffness 0.5 K_g")  # fmt: skip

# %%
# What ties the factor to an amplitude is the describing function of backlash under preload. A torque of 100 N.m on the ring presses
# every mesh together; a vibration about that deflection keeps K_g until its amplitude exceeds it. Then the flanks part, and the
# stiffness of the first harmonic, N(A), falls; it rises again where the other flanks are hit. The paper gives no backlash; 100 µm
# stand for a usual one.

K_g, BACKLASH = system.parameters["K_g"], 100e-6
settled = system.simulate(2.0, samples=2, inputs={"tau_in": 100.0}, parameters={"e_amplitude": 0.0})
static = {q: float(settled[q][-1]) for q in ("q_ring", "q_sun", "q_pair")}
print(
    "\nDescribing function of the backlash, stiffness over K_g; static deflections "
    + ", ".join(f"{q} {x * 1e6:.3f} µm" for q, x in static.items())
)
ratios = np.geomspace(0.5, 200.0, 1201)
preload = K_g * static["q_ring"]
shares = gl.equivalent_stiffness(ratios * static["q_ring"], preload, c=K_g, b=BACKLASH) / K_g
least = int(np.argmin(shares))
for ratio in (0.5, 1.0, 1.5, 2.0, 5.0, 10.0):
    share = gl.equivalent_stiffness(ratio * static["q_ring"], preload, c=K_g, b=BACKLASH) / K_g
    print(f"  amplitude {ratio:4g} times the static deflection: {float(share):.4f}")
print(f"  smallest: {shares[least]:.4f} at an amplitude of {ratios[least] * static['q_ring'] * 1e6:.1f} µm")

# %%
# That is a loop: the force of one mesh's springs acts on the train, and the train's deflection acts on the springs. With G(s) from
# the force to the deflection, the springs of that mesh taken out, the train may vibrate by itself at an amplitude A
# where 1 + N(A) G = 0: where the Nyquist curve of G meets -1/N(A), which lies on the negative real axis left of -1/K_g.


def mesh_loop(q):
    """From the force of a mesh's springs to its deflection, that mesh without springs; ``A[:, q]`` holds nothing but the springs."""
    linear = system.linearize(["tau_in"], [q])
    i = linear.state_labels.index(q)
    without = np.array(linear.A)
    without[:, i] = 0.0
    return control.ss(without, -linear.A[:, [i]] / K_g, np.eye(len(without))[[i]], 0, inputs=["force"], outputs=[q])


print("\nloop of one mesh, N(A) G(s); meets: crossings of the negative real axis, where -1/N(A) lies")
print("stiffness                 poles of G, largest real part   meets   gain margin, dB   phase margin, deg   N  closed loop")
for q in static:
    G = mesh_loop(q)
    curve = gl.frequency_response(G, np.geomspace(1e-2, 1e7, 20_001))[q]
    crossings = int(((np.diff(np.sign(curve.imag)) != 0) & (curve.real[1:] < 0)).sum())
    for share in (1.0, shares[least]):
        report = gl.stability(G, ("force", q), gain=share * K_g)
        m, count = report.loop.margins, report.loop.nyquist.clockwise
        print(
            f"{q:7} N = {share:.4f} K_g {report.eigenvalues.real.max():34.3f} {crossings:7d} {m.gain_margin_db:17.2f} "
            f"{m.phase_margin:19.2f} {count:3d}  {report.loop.verdict}"
        )

fig = plt.figure(figsize=(10, 9), layout="constrained")
upper, lower = fig.subfigures(2, 1)
pair = upper.subplots(1, 2)
G = mesh_loop("q_ring")
gl.nyquist_plot(G, ("force", "q_ring"), gain=K_g, axes=pair)
ax = lower.subplots()
gl.nichols_plot(G, ("force", "q_ring"), gain=K_g, axes=ax)
parts = shares[: least + 1]
for axes in pair:
    axes.plot(-1 / parts, 0 * parts, color="#7b3294", lw=4, alpha=0.5, solid_capstyle="butt", label="−K_g / N(A)")
ax.plot(np.full(len(parts), -180.0), -20 * np.log10(parts), color="#7b3294", lw=4, alpha=0.5, label="−K_g / N(A)")
pair[0].legend(fontsize=8)
ax.legend(fontsize=8)
upper.suptitle("Fig. 6: springs of the ring's mesh against the rest of the train, K_g G")
fig.savefig(FIGURES / "paper_fig_6_describing_function.png", dpi=90)

# %%
# Figure 7: from the input to the X unit
# --------------------------------------
# The paper cuts the subsystem "from the input end to the x-type element body". Readings: the X unit alone, cut out of the train at its sun
# and at the coupling, so that the load stays on its carrier (`gl.cut`), with the sun free or held; or the whole train, seen at
# the X unit's sun, at its meshes, or at the torque that it hands on.

SUN = "train.x_unit.sun"
x_rows = {}


def readings(model, source, outputs, store):
    """A row for each output; ``-w`` counts a speed or force the other way round."""
    for output, name in outputs.items():
        sign = -1.0 if output.startswith("-") else 1.0
        store[name] = row(model, source, output.removeprefix("-"), name, sign)


print("\nFig. 7, from the input to the X unit\n" + HEADER)
for end in ("free", "held"):
    pieces = gl.cut(gp.ZhouCui2022(), SUN, "train.coupling.flange_b", given={SUN: end})
    alone = gl.compile(pieces, outputs=["w_in", "w_out", "q_sun", "train.x_unit.sun_mesh.f", "train.x_unit_sun.flow"])
    label = f"X unit alone, sun {end}: torque ->"
    readings(
        alone,
        "tau_in",
        {"w_out": f"{label} carrier", "w_in": f"{label} ring", "train.x_unit.sun_mesh.f": f"{label} sun's mesh"},
        x_rows,
    )
    if end == "held":
        readings(alone, "tau_in", {"train.x_unit_sun.flow": f"{label} torque that holds the sun"}, x_rows)
    else:
        diagrams(alone, "tau_in", "w_out", 7, "Fig. 7: X unit alone, sun free")
        print("poles of the X unit alone, 1/s:", *(f"{p:.3f}" for p in gl.stability(alone).eigenvalues))
readings(
    system, "tau_in",
    {
        "w_sun": "torque -> speed of the sun",
        "q_ring": "torque -> deflection of the ring's mesh",
        "train.x_unit.ring_mesh.f": "torque -> force of the ring's mesh",
        "q_sun": "torque -> deflection of the sun's mesh",
        "train.x_unit.sun_mesh.f": "torque -> force of the sun's mesh",
        "train.x_unit.planets_at_ring.w": "torque -> speed of the planets at the ring",
        "-train.x_unit.planets_at_sun.w": "torque -> speed of the planets at the sun, reversed",
        "train.x_unit.sun.tau": "torque -> torque at the sun's shaft",
    },
    x_rows,
)  # fmt: skip
found = {name: r.loop.margins.gain_margin_db for name, r in x_rows.items()}
distance, nearest = min((abs(margin - PRINTED), name) for name, margin in found.items())
print(f"printed: {PRINTED} dB; the nearest of these readings is {distance:.1f} dB away ({nearest}: {found[nearest]:.2f} dB)")

# %%
# None of these readings gives the printed margin, and the printed margin cannot single one out: ``paper_gain_margin.py`` takes some
# thousands of them. No agreement is claimed.

# %%
# Figure 8: from the input to the P unit
# --------------------------------------
# Readings: the P unit alone, cut out of the train at both shafts; the same with the shaft that drives it and the coupling, carrier
# and load that it drives; or the whole train, seen at the P unit's gears, its mesh, or the torque that enters it.

print("\nFig. 8, from the input to the P unit\n" + HEADER)
p_rows = {}
bare = gl.compile(
    gl.cut(gp.ZhouCui2022(), "train.p_unit"), outputs=["train.p_unit.gear_1.w", "train.p_unit.gear_2.w", "train.p_unit.mesh.f"]
)
readings(
    bare, "train.p_unit_flange_a.flow",
    {
        "train.p_unit.gear_1.w": "P unit alone: torque -> gear 1",
        "-train.p_unit.gear_2.w": "P unit alone: torque -> gear 2, reversed",
        "train.p_unit.mesh.f": "P unit alone: torque -> force of the mesh",
    },
    p_rows,
)  # fmt: skip
pieces = gl.cut(gp.ZhouCui2022(), "train.step_18.flange_a", "train.x_unit.carrier")
loaded = gl.compile(pieces, outputs=["train.p_unit.gear_1.w", "load.w_rel", "train.p_unit.mesh.f"])
readings(
    loaded, "train.step_18_flange_a.flow",
    {
        "train.p_unit.gear_1.w": "P unit with shaft and load: torque -> gear 1",
        "-load.w_rel": "P unit with shaft and load: torque -> load",
        "train.p_unit.mesh.f": "P unit with shaft and load: torque -> mesh",
    },
    p_rows,
)  # fmt: skip
print("poles of the P unit with shaft and load, 1/s:", *(f"{p:.3f}" for p in gl.stability(loaded).eigenvalues))
diagrams(
    loaded, "train.step_18_flange_a.flow", "train.p_unit.gear_1.w", 8, "Fig. 8: P unit with shaft and load, cut from the X unit"
)
readings(
    system, "tau_in",
    {
        "train.p_unit.gear_1.w": "torque -> speed of gear 1",
        "-train.p_unit.gear_2.w": "torque -> speed of gear 2, reversed",
        "q_pair": "torque -> deflection of the P unit's mesh",
        "train.p_unit.mesh.f": "torque -> force of the P unit's mesh",
        "-train.p_unit.mesh.f": "torque -> force of the P unit's mesh, reversed",
        "train.p_unit.flange_a.tau": "torque -> torque into the P unit",
    },
    p_rows,
)  # fmt: skip
plt.show()
