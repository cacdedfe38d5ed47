r"""
Parametric resonance of the XP train
====================================

The stiffness of a mesh varies as teeth come into contact and leave it. A train that is stable with constant stiffness can then
vibrate more and more without any excitation, where the mesh frequency is near :math:`2 \omega_i / n` or near a sum
:math:`(\omega_i + \omega_j) / n` of natural frequencies. This is the instability chart (Strutt and Ince) of the linear XP train of
Zhou and Cui, over the mesh frequency and the amplitude of the stiffness :math:`K_g (1 + \varepsilon \cos \omega t)`. On the left
both meshes of the planets vary, which share one frequency, on the right the P unit's mesh. Long runs of the train check it.
"""

from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

FIGURES = Path("examples/figures" if Path("examples").is_dir() else "figures")
FIGURES.mkdir(exist_ok=True)
VARIED = {"X unit: meshes of the planets": ("ring", "sun"), "P unit: its mesh": ("pair",)}

# %%
# Floquet's theory
# ----------------
# In the linear model the column of a mesh deflection holds nothing but the spring of that mesh: it is what varies. The map of the
# states over one period (the monodromy matrix) is integrated for all points of the chart at once; the largest modulus of its
# eigenvalues is the factor by which the worst disturbance grows in a period.

linear = gl.compile(gp.ZhouCui2022()).linearize(["tau_in"], ["q_ring"])
A = np.array(linear.A)


def growth(meshes, omega, eps, steps=48):
    """Growth rate (1/s) of the worst disturbance, for arrays of mesh frequencies (rad/s) and amplitudes of the stiffness."""
    omega, eps = np.broadcast_arrays(omega, eps)
    springs = np.zeros_like(A)
    for mesh in meshes:
        place = linear.state_labels.index(f"q_{mesh}")
        springs[:, place] = A[:, place]
    h = (2 * np.pi / omega / steps)[..., None, None]
    X = np.broadcast_to(np.eye(len(A)), (*omega.shape, *A.shape)).copy()
    for k in range(steps):  # Runge-Kutta of order 4
        begin, middle, end = (
            A + (eps * np.cos(2 * np.pi * part / steps))[..., None, None] * springs for part in (k, k + 0.5, k + 1)
        )
        k1 = begin @ X
        k2 = middle @ (X + h / 2 * k1)
        k3 = middle @ (X + h / 2 * k2)
        X = X + h / 6 * (k1 + 2 * k2 + 2 * k3 + end @ (X + h * k3))
    return np.log(np.abs(np.linalg.eigvals(X)).max(axis=-1)) * omega / (2 * np.pi)


omega, eps = np.linspace(4000.0, 17000.0, 40), np.linspace(0.0, 0.95, 15)
charts = {title: growth(meshes, omega[:, None], eps[None, :]) for title, meshes in VARIED.items()}
eigenvalues = np.linalg.eigvals(A)
natural = np.sort(np.abs(eigenvalues[eigenvalues.imag > 1]))
print("natural angular frequencies, rad/s:", ", ".join(f"{w:.0f}" for w in natural))
for title, chart in charts.items():
    first = int((chart > 0).any(axis=0).argmax())
    print(f"{title}: unstable from an amplitude of {eps[first]:.2f} on, first at {omega[chart[:, first].argmax()]:.0f} rad/s")

# %%
# Long runs
# ---------
# The train is compiled with a stiffness law of its own, a function of time, and released with one deflected mesh and no load. Its vibration
# is measured from period to period until the worst disturbance has outgrown the others; gearlib integrates the components'
# equations, and knows no Floquet theory.


@dataclass(frozen=True)
class Prescribed(gp.StiffnessLaw):
    """``1 + depth cos(omega t)``, whatever the gears do."""

    depth: float
    omega: float

    def value(self, mesh, phase):
        return 1 + self.depth * gl.cos(self.omega * gl.time)


def measured(meshes, w, amplitude, periods=240, window=20):
    """Growth rate (1/s) over the second half of a long run without load or transmission error."""
    details = {f"{mesh}_details": (("stiffness_law", Prescribed(amplitude, w)),) for mesh in meshes}
    train = gp.ZhouCui2022(Z_s=19, Z_p=31, Z_r=81, e_amplitude=0.0, tau_in=0.0, **details, start={f"q_{meshes[0]}": 1e-6})
    system = gl.compile(train, outputs=["q_ring", "q_sun", "q_pair"])
    length = periods * 2 * np.pi / w
    run = system.simulate(length, samples=periods * 16 + 1, rtol=1e-9, atol=1e-30)
    q = np.array([run["q_ring"], run["q_sun"], run["q_pair"]])[:, 1:]
    size = np.sqrt(np.mean(q.reshape(3, periods // window, -1) ** 2, axis=(0, 2)))
    middle = run.time[1:].reshape(periods // window, -1).mean(axis=1)
    late = len(size) // 2
    return np.polyfit(middle[late:], np.log(size[late:]), 1)[0]


POINTS = {
    "X unit: meshes of the planets": [(11675.0, 0.3), (11675.0, 0.6), (13500.0, 0.7), (9000.0, 0.3)],
    "P unit: its mesh": [(6850.0, 0.9), (11675.0, 0.9), (9000.0, 0.6)],
}
print("\nmeshes                          rad/s  amplitude   growth by Floquet, 1/s   in the long run, 1/s")
runs = {title: [] for title in VARIED}
for title, points in POINTS.items():
    for w, amplitude in points:
        predicted = float(growth(VARIED[title], np.array(w), np.array(amplitude), steps=400))
        found = measured(VARIED[title], w, amplitude)
        runs[title].append((w, amplitude, found))
        print(f"{title:30} {w:6.0f} {amplitude:8.2f} {predicted:20.3f} {found:22.3f}")

# %%
# The charts: growth where there is any, and the runs. Lines mark twice a natural frequency (dashed) and sums of two (dotted). The planets'
# meshes excite the vibrations of 930 and 1230 Hz, the P unit's mesh that of 555 Hz, whose damping ratio of 0.16 takes amplitudes above 0.7.
# The axis at the top is the speed of the ring at which the teeth meet that often, by Willis' equation.

W_OUT = 1.0  # with the carrier at 1 rad/s:
W_SUN = 31 / 19 * W_OUT
W_RING = (2 * 0.075 * W_OUT - 0.0285 * W_SUN) / 0.1215
TEETH = dict(zip(VARIED, (81 * abs(W_RING - W_OUT) / W_RING, 19 * W_SUN / W_RING)))  # that meet while the ring turns by 1 rad

fig, axes = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained", sharey=True)
levels = [0, 50, 100, 200, 400, 800, 1600]
for ax, (title, chart) in zip(axes, charts.items()):
    filled = ax.contourf(
        omega, eps, chart.T, levels=levels, cmap="YlOrRd", norm=plt.matplotlib.colors.BoundaryNorm(levels, 256)
    )
    ax.contour(omega, eps, chart.T, levels=[0], colors="black", linewidths=1)
    for i, a in enumerate(natural):
        for j, b in enumerate(natural[: i + 1]):
            ax.axvline(a + b, color="0.6", lw=0.8, ls="--" if i == j else ":")
    for w, amplitude, found in runs[title]:
        ax.plot(w, amplitude, "o", mfc="black" if found > 0 else "white", mec="black")
    per_rad = TEETH[title]
    top = ax.secondary_xaxis("top", functions=(lambda w, n=per_rad: w / n, lambda w, n=per_rad: w * n))
    top.set_xlabel("speed of the ring, rad/s")
    ax.set(title=title, xlabel="mesh frequency, rad/s", xlim=(omega[0], omega[-1]), ylim=(0, eps[-1]))
axes[0].set_ylabel("amplitude of the stiffness over its mean")
axes[0].plot([], [], "o", mfc="black", mec="black", label="run that grows")
axes[0].plot([], [], "o", mfc="white", mec="black", label="run that dies out")
axes[0].legend(loc="lower left", fontsize=8)
fig.colorbar(filled, ax=axes, label="growth, 1/s")
fig.savefig(FIGURES / "xp_parametric_resonance.png", dpi=100)
plt.show()
