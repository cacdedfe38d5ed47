r"""
The XP single-loop gear train
=============================

Zhou and Cui (2022) [1]_ couple a planetary differential (the X unit) and a pair of gears on fixed axes (the P unit) into a
closed loop: a torque drives the ring, the sun drives the pair, and the pair joins the carrier at the output. Three elastic
meshes carry the load, and a transmission error excites all of them.

This script translates the train from its components, integrates it, compares it with the equations that the paper prints, and
looks at the linear model: modes, stability margins, Nyquist and Nichols diagrams.

.. [1] X. Zhou, Y. Cui, "Dynamic characteristics of single-loop gear system based on bond graph method", Journal of
   Vibroengineering, 2022. https://doi.org/10.21595/jve.2021.22290
"""

from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp
from gearparts.trains import zhou_cui_2022

FIGURES = Path("examples/figures" if Path("examples").is_dir() else "figures")
FIGURES.mkdir(exist_ok=True)

# %%
# From components to states
# -------------------------
# `gp.ZhouCui2022` is the train with a damper as its load, with the parameters of the paper's Table 4. The torque on the ring is
# an input; here it steps from 0 to 100 N.m. The summary says how many equations came in and what became of them.

T_STEP, T_END, TORQUE = 0.1, 0.5, 100.0  # s, s, N.m

step = gl.Piecewise((0.0, gl.time < T_STEP), (TORQUE, True))
system = gl.compile(gp.ZhouCui2022(tau_in=step))
print(system.summary())

# %%
# A DAE solved with IDA, and the bond graph's explicit form beside it
# -------------------------------------------------------------------
# Index reduction leaves a DAE of index 1. SUNDIALS IDA gets it as it is, with all its differential and algebraic unknowns, and
# tight tolerances. The explicit equations (2)-(9) of the paper share no code with it, and are integrated by another solver.

summary = system.summary(form="dae").splitlines()
unknowns = next(i for i, line in enumerate(summary) if line.startswith("  dae"))
print("\n".join([*summary[unknowns : unknowns + 5], f"{'':18}... and {len(summary) - unknowns - 5} lines more"]))
times = np.linspace(0, T_END, 5001)
dae = system.simulate(T_END, times=times, method="ida", form="dae", rtol=1e-10)
print(f"\nIDA: {dae.stats['unknowns']} unknowns, {dae.stats['steps']} steps, {dae.stats['rhs']} evaluations")

params = zhou_cui_2022.bond_parameters()


def explicit_form(x, torque, times):
    """States of the explicit form over time, under a constant torque and the transmission error."""

    def rhs(t, x):
        e = zhou_cui_2022.transmission_error_rate(t)
        return zhou_cui_2022.explicit_rhs(t, x, params, (torque, e, e, e))

    return solve_ivp(rhs, times[[0, -1]], x, "DOP853", times, rtol=1e-12, atol=1e-14).y


before, after = times <= T_STEP, times >= T_STEP
first = explicit_form(np.zeros(8), 0.0, times[before])
second = explicit_form(first[:, -1], TORQUE, times[after])
p2, q6, p11, p26, q30, p35, q74, p78 = np.hstack([first[:, :-1], second])

explicit = {
    "w_in": p2 / params.I[2],
    "w_sun": p26 / params.I[26],
    "w_out": -p78 / params.I[78] / params.m[22],
    "q_ring": q6,
    "q_sun": q30,
    "q_pair": q74,
}
print("largest difference from the explicit form, by the signal's peak")
for name, reference in explicit.items():
    print(f"  {name:7} {abs(dae[name] - reference).max() / abs(reference).max():.1e}")

# %%
# The other ways to the same solution: with the algebraic unknowns eliminated before IDA sees the equations, through scikit-sundae's own
# interface, and by the matrix exponential, which is what `method="auto"` takes for a linear train.

print("\nlargest difference from the DAE, of any of these signals by its peak")
ways = {
    "states only": {"method": "ida", "rtol": 1e-10},
    "scikit-sundae": {"method": "ida", "rtol": 1e-6, "backend": "sksundae"},  # Python in the loop: fewer steps
    "exact": {"method": "exact"},
}
for way, options in ways.items():
    result = system.simulate(T_END, times=times, **options)
    difference = max(abs(result[name] - dae[name]).max() / abs(dae[name]).max() for name in explicit)
    print(f"  {way:14} {difference:.1e}   {result.stats['seconds']:.2f} s")

# %%
# The meshes take up the step by vibration within a few milliseconds; then the train gathers speed until the load's damper
# balances the torque. Before the step the transmission error alone moves the train.

SPEEDS = {"w_in": "ring", "w_sun": "sun", "w_out": "carrier"}
DEFLECTIONS = {"q_ring": "ring and planets", "q_sun": "sun and planets", "q_pair": "P unit"}
DASHES = [(), (), (4, 3)]

fig, axes = plt.subplots(2, 2, figsize=(9, 5.2), sharex="col", layout="constrained")
for column, window in zip(axes.T, [times <= T_END, abs(times - T_STEP - 0.006) <= 0.008]):
    for axis, names, scale in zip(column, [SPEEDS, DEFLECTIONS], [1, 1e6]):
        for (name, label), dashes in zip(names.items(), DASHES):
            axis.plot(1e3 * times[window], scale * result[name][window], label=label, dashes=dashes)
        axis.grid(alpha=0.3)
        axis.margins(x=0)
    column[1].set_xlabel("time, ms")
    column[0].set_ylabel("angular velocity, rad/s")
    column[1].set_ylabel("mesh deflection, µm")
axes[0, 0].set_title("whole run")
axes[0, 1].set_title("around the step")
for axis in axes[:, 0]:
    axis.legend(loc="lower right")
fig.suptitle(f"XP train: torque on the ring steps to {TORQUE:g} N.m at {1e3 * T_STEP:g} ms")
fig.savefig(FIGURES / "time_histories.png", dpi=90)

# %%
# Modes
# -----
# `linearize` differentiates the equations exactly, and returns a `control.StateSpace`.

linear = system.linearize(inputs=["tau_in"], outputs=["w_in", "w_out"])
omega_n, damping, poles = control.damp(linear, doprint=False)
print("\neigenvalue, 1/s           natural frequency, Hz   damping ratio")
for pole, frequency, zeta in sorted(zip(poles, omega_n / (2 * np.pi), damping), key=lambda mode: mode[1]):
    if pole.imag >= 0:
        print(f"{pole.real:10.3f} {f'± {pole.imag:.3f}i' if pole.imag else '':12} {frequency:16.3f} {zeta:18.4f}")

reference = np.linalg.eigvals(zhou_cui_2022.explicit_matrices(params)[0])
difference = max(abs(poles - p).min() / abs(p) for p in reference)
print(f"largest relative difference from the explicit form's eigenvalues: {difference:.1e}")
print("all eigenvalues lie in the left half plane: the train is stable" if max(poles.real) < 0 else "the train is unstable")

# %%
# Stability margins
# -----------------
# Margins belong to a loop, and the paper does not say which transfer function it plots. Here the carrier's speed is controlled
# through the torque on the ring, tau_in = k (w_set - w_out), so that the open loop is L(s) = k w_out(s) / tau_in(s). Were the
# ring's own speed controlled, no k > 0 could make the loop unstable: the train is passive, and the product of the ring's torque
# and speed is the power that it takes.

K = 60.0  # N.m.s/rad
loop = K * linear["w_out", "tau_in"]
print(f"\nopen loop, k = {K:g} N.m.s/rad   gain margin, dB   phase margin, deg   least distance to -1")
for name, transfer in {"k w_in / tau_in": K * linear["w_in", "tau_in"], "k w_out / tau_in": loop}.items():
    gm, pm, distance, *_ = control.stability_margins(transfer)
    distance = min(distance, 1.0)  # python-control looks at finite frequencies; at infinite ones L is 0
    print(f"{name:29} {20 * np.log10(gm):15.2f} {pm:19.2f} {distance:22.3f}")

# %%
# Nyquist and Nichols diagrams show the same loop from 0.1 Hz to 5 kHz. The curve does not go round -1 and the train has no
# unstable eigenvalue, so the closed loop is stable, too.

omega = 2 * np.pi * np.geomspace(0.1, 5e3, 5000)
gm, pm, _, w_180, w_1, _ = control.stability_margins(loop)
gain_margin = f"gain margin {20 * np.log10(gm):.1f} dB\nat {w_180 / (2 * np.pi):.0f} Hz"
phase_margin = f"phase margin {pm:.1f}°\nat {w_1 / (2 * np.pi):.1f} Hz"
NAME = f"L = k w_out / tau_in, k = {K:g} N.m.s/rad"
ARROW = {"arrowprops": {"arrowstyle": "->"}}

fig, axes = plt.subplots(1, 2, figsize=(9, 4.9))
for axis in axes:
    control.nyquist_plot(loop, omega, ax=axis, title="", unit_circle=True, color="tab:blue")
    axis.plot(-1, 0, "r+", markersize=12)
    axis.set(xlabel="real part of L", ylabel="imaginary part of L")
axes[0].set(xlim=(-1.5, 5.5), ylim=(-3.5, 3.5), title="whole curve (dashed: negative frequencies)")
axes[1].set(xlim=(-1.5, 1.5), ylim=(-1.5, 1.5), title="near the critical point -1")
at_180, at_1 = loop(1j * w_180), loop(1j * w_1)
axes[1].plot([at_180.real, at_1.real], [at_180.imag, at_1.imag], "ko", markersize=4)
axes[1].annotate(gain_margin, (at_180.real, at_180.imag), (-0.9, 1.15), ha="center", **ARROW)
axes[1].annotate(phase_margin, (at_1.real, at_1.imag), (0.9, -1.35), ha="center", **ARROW)
fig.suptitle(f"Nyquist diagram of {NAME}")
fig.set_layout_engine("constrained")
fig.savefig(FIGURES / "nyquist.png", dpi=100)

# %%
fig, axis = plt.subplots(figsize=(7, 5.2))
control.nichols_plot(loop, omega, ax=axis, title="", grid=False, color="tab:blue")
phase, decibel = np.meshgrid(np.linspace(-270, 0, 541), np.linspace(-60, 30, 361))
L = 10 ** (decibel / 20) * np.exp(1j * np.radians(phase))
levels = [-40, -20, -12, -6, -3, -1, 0, 1, 3, 6, 12]
closed = 20 * np.log10(abs(L / (1 + L)))
contours = axis.contour(phase, decibel, closed, levels, colors="0.7", linewidths=0.8, linestyles="dotted")
axis.clabel(contours, [3, 6, 12], fmt="%g dB", fontsize=8)
at = int(np.searchsorted(phase[0], -12))
for level in (-40, -20, -12, -6, -3, -1):
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1}
    label = {"fontsize": 8, "color": "0.5", "ha": "center", "va": "center", "bbox": box, "zorder": 1}
    axis.text(phase[0, at], np.interp(level, closed[:, at], decibel[:, 0]), f"{level} dB", **label)
axis.plot([-180, pm - 180], [-20 * np.log10(gm), 0], "ko", markersize=4)
axis.annotate(gain_margin, (-180, -20 * np.log10(gm)), (-215, -33), ha="center", **ARROW)
axis.annotate(phase_margin, (pm - 180, 0), (-54, -8), ha="center", **ARROW)
axis.set(xlim=(-270, 0), ylim=(-60, 30), xticks=range(-270, 1, 45), title="")
axis.set(xlabel="phase of L, deg", ylabel="magnitude of L, dB")
fig.suptitle(f"Nichols diagram of {NAME}\ndotted: magnitude of L / (1 + L)")
fig.set_layout_engine("constrained")
fig.savefig(FIGURES / "nichols.png", dpi=100)
plt.show()
