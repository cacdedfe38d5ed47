"""
How planets share the load
==========================

A planetary set has three planets or more so that each carries a part of the torque. A pin that stands a few micrometres off
its place spoils this. The remedy is a sun without a bearing: it moves to where the meshes' forces balance. With three planets
these are two equations for the two directions and one for the torque, so that the shares are equal whatever the errors are.
With four, one pattern of errors is left.
"""

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

TORQUE, R_SUN, ALPHA = 300.0, 0.03, 0.4


class Stage(gl.Component):
    """A torque on the sun; ring and carrier are held."""

    planets = gl.Structural(3)
    pin_errors = gl.Structural((), "by how much each pin is ahead of its place, m")
    k_sun = gl.Parameter("N/m", "stiffness of the sun's bearing")

    def assemble(self):
        self.drive, self.ground = gp.ConstantTorque(tau_constant=TORQUE), gp.Fixed()
        self.unit = gp.PlanarPlanetaryUnit(
            planets=self.planets, pin_errors=self.pin_errors, ring_held=True, k_s=self.k_sun, r_s=R_SUN, r_r=0.09, r_p=0.03,
            r_c=0.064, alpha=ALPHA, m_s=0.4, m_r=2.0, m_c=3.0, m_p=0.6, I_s=4e-4, I_r=2e-2, I_c=6e-3, I_p=6e-4, k_sp=5e8, k_rp=6e8,
            k_r=1e8, k_c=2e8, k_p=1e8, k_ring_phi=1e6,
        )  # fmt: skip
        return [gl.connect(self.drive.flange, self.unit.sun), gl.connect(self.unit.carrier, self.ground.flange)]


def shares(planets, error, k_sun):
    """Mesh forces at the sun over their mean, with the first pin off its place, in the steady state."""
    model = Stage(planets=planets, pin_errors=(error,) + (0.0,) * (planets - 1), k_sun=k_sun)
    names = [f"unit.sun_mesh[{n}].f" for n in range(planets)]
    result = gl.simulate(model, 1e-6, start="steady", samples=2, outputs=names)
    forces = np.array([result[name][0] for name in names])
    assert abs(forces.sum() * R_SUN - TORQUE) < 1e-9 * TORQUE
    return forces / forces.mean()


# %%
# Shares with the first pin 10 µm ahead
# -------------------------------------

found = {}
for planets in (3, 4, 5):
    for sun, k_sun in (("in a bearing", 1e9), ("floating", 0.0)):
        found[planets, sun] = shares(planets, 10e-6, k_sun)
        print(f"{planets} planets, sun {sun:12}: " + " ".join(f"{share:.3f}" for share in found[planets, sun]))

# %%
# Two of these rows are known without a computation: three planets around a floating sun carry equal loads, and of four the opposite ones
# do, one pair as much more as the other less.

assert np.allclose(found[3, "floating"], 1.0, atol=1e-9)
four = found[4, "floating"]
assert np.allclose(four - 1, (four[0] - 1) * np.array([1, -1, 1, -1]), atol=1e-9)

# %%
# The planet that carries most
# ----------------------------
# The model is linear, so that a share grows in proportion to the error.

errors = np.linspace(0.0, 30e-6, 7)
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for (planets, sun), share in found.items():
    largest = 1 + (share.max() - 1) * errors / 10e-6
    axes.plot(
        1e6 * errors,
        largest,
        "o--" if sun == "floating" else "-",
        color=f"C{planets - 3}",
        label=f"{planets} planets, sun {sun}",
    )
axes.set(xlabel="error of one pin, µm", ylabel="largest share over the mean")
axes.legend()
