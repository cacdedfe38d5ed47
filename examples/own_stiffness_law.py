r"""
A stiffness law of one's own
============================

A mesh asks a `gearparts.StiffnessLaw` how stiff it is at a mesh phase, relative to its mean stiffness. A law of one's own is a class
with two methods, the value and its slope, and is given to any mesh that takes ``stiffness_law``.

Here the stiffness rises and falls as :math:`1 + a (|\sin(\phi/2)|^3 - m)`, where the constant *m* makes the mean one. A pinion turns at
constant speed, and a loaded wheel vibrates on the mesh. The same motion is computed by SciPy from the equations written by hand.
"""

from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp

MEAN = 4 / (3 * np.pi)  # of abs(sin)**3


@dataclass(frozen=True)
class CubedSine(gp.StiffnessLaw):
    """``1 + depth (abs(sin(phase / 2))**3 - MEAN)``."""

    depth: float

    def value(self, mesh: Any, phase: Any) -> Any:
        return 1 + self.depth * (gl.no_event(abs(gl.sin(phase / 2))) ** 3 - MEAN)

    def slope(self, mesh: Any, phase: Any) -> Any:
        half = gl.sin(phase / 2)
        return 1.5 * self.depth * half * gl.no_event(abs(half)) * gl.cos(phase / 2)


R_A, R_B, Z_A, C, D, J, TAU, SPEED = 0.05, 0.1, 20, 1e8, 1000.0, 0.02, 200.0, 50.0


class Pair(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.drive, self.wheel, self.load = (
            gp.ConstantSpeed(w_fixed=SPEED),
            gp.Inertia(J=J, start={"w": -SPEED * R_A / R_B}),
            gp.Torque(tau=TAU),
        )
        self.mesh = gp.DetailedExternalMesh(stiffness_law=CubedSine(0.3), r_a=R_A, r_b=R_B, z_a=Z_A, c=C, d=D)
        return [
            gl.connect(self.drive.flange, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.load.flange),
        ]


system = gl.compile(Pair(), outputs=["mesh.q", "mesh.f"])
result = system.simulate(0.02, samples=1001, rtol=1e-9)


def by_hand(t: float, state: Any) -> list[float]:
    q, w = state
    stiffness = C * (1 + 0.3 * (abs(np.sin(Z_A * SPEED * t / 2)) ** 3 - MEAN))
    speed = R_A * SPEED + R_B * w
    return [speed, (TAU - R_B * (stiffness * q + D * speed)) / J]


reference = solve_ivp(by_hand, (0, 0.02), [0.0, -SPEED * R_A / R_B], "DOP853", result.time, rtol=1e-11, atol=1e-15).y[0]
error = np.abs(result["mesh.q"] - reference).max() / np.abs(reference).max()
print(
    f"deflection at the end {1e6 * result['mesh.q'][-1]:.4f} um, by hand {1e6 * reference[-1]:.4f} um, relative error {error:.1e}"
)
assert error < 1e-7

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
axes.plot(1e3 * result.time, 1e6 * result["mesh.q"], label="gearlib")
axes.plot(1e3 * result.time[::25], 1e6 * reference[::25], "k.", label="by hand")
axes.set(xlabel="time, ms", ylabel="mesh deflection, µm")
axes.legend()
