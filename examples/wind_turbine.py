"""
A wind turbine's drivetrain: free vibration, critical speeds, power flow, a gust
================================================================================

The masses and the shaft are those of the NREL 5 MW reference turbine (Jonkman, Butterfield, Musial, Scott, NREL/TP-500-38060,
2009). Its gearbox has the ratio 97 and no teeth; here it is a planetary stage and two pairs of gears, as gearboxes of this
size are built. Three checks stand in the text: the first natural frequency by hand, the gearbox' ratio by Willis, the gust's
response by the modes.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

# %%
# The numbers
# -----------
# Hub and blades about the shaft, the generator about its own, and the shaft between rotor and gearbox. Rated: 12.1 rpm, 5.3
# MW at the rotor.

J_ROTOR, J_GENERATOR = 38_759_228.0, 534.116  # kg.m2
C_SHAFT, D_SHAFT = 867_637_000.0, 6_215_000.0  # N.m/rad, N.m.s/rad
W_RATED, TAU_RATED = 12.1 * math.pi / 30, 4.18e6  # rad/s, N.m at the rotor

Z_SUN, Z_RING, PAIRS = 21, 96, ((98, 23), (94, 23))  # teeth, to the ratio 97.02
RATIO = (1 + Z_RING / Z_SUN) * math.prod(wheel / pinion for wheel, pinion in PAIRS)  # by Willis' formula


class Turbine(gl.Component):
    """Rotor, shaft, planetary stage with its ring in the housing, two pairs, generator."""

    wind = gl.Input("N.m", "torque of the wind")
    tau_rated = gl.Parameter("N.m", "torque of the generator at its rated speed", default=TAU_RATED / RATIO)

    def assemble(self):
        self.blades, self.rotor = gp.Torque(tau=self.wind), gp.Inertia(J=J_ROTOR)
        self.shaft = gp.SpringDamper(c=C_SHAFT, d=D_SHAFT, nominal={"phi_rel": 1e-2})
        self.housing, self.stage = gp.Fixed(), gp.IdealPlanetary(ratio=Z_RING / Z_SUN)
        self.pair = [gp.IdealGear(ratio=pinion / wheel) for wheel, pinion in PAIRS]
        self.generator = gp.Inertia(J=J_GENERATOR)
        self.grid = gp.LinearSpeedDependentTorque(
            tau_nominal=-self.tau_rated, w_nominal=RATIO * W_RATED, torque_direction=False
        )
        return [
            gl.connect(self.blades.flange, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.stage.carrier),
            gl.connect(self.stage.ring, self.housing.flange),
            gl.connect(self.stage.sun, self.pair[0].flange_a),
            gl.connect(self.pair[0].flange_b, self.pair[1].flange_a),
            gl.connect(self.pair[1].flange_b, self.generator.flange_a),
            gl.connect(self.generator.flange_b, self.grid.flange),
        ]


system = gl.compile(Turbine())
ratio = gl.speed_ratio(system, "generator.w", "rotor.w")
print(f"ratio {ratio:.4f}; by Willis' formula {RATIO:.4f}")
assert abs(ratio - RATIO) < 1e-9 * RATIO

# %%
# The first natural frequency
# ---------------------------
# Rotor and generator swing against each other. By hand, with the generator's inertia as the shaft sees it: :math:`\omega =
# \sqrt{c (1/J_r + 1/(i^2 J_g))}`.

modes = gl.modes(system)
by_hand = math.sqrt(C_SHAFT * (1 / J_ROTOR + 1 / (ratio**2 * J_GENERATOR))) / (2 * math.pi)
first = int(np.argmax(modes.frequencies > 0.1))
print(
    f"first natural frequency {modes.frequencies[first]:.4f} Hz, by hand {by_hand:.4f} Hz; damping {modes.damping[first]:.4f}"
)
assert abs(modes.frequencies[first] - by_hand) < 2e-3 * by_hand  # the generator's torque adds a little

# %%
# Critical speeds
# ---------------
# The blades pass the tower three times a turn, which excites 3P and its multiples. Up to the rated speed 3P to 9P stay below the
# first natural frequency; 12P meets it at :math:`60 f / 12` turns per minute.

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
diagram = gl.campbell(system, [4.0 * math.pi / 30, 14.0 * math.pi / 30], {"3P": 3, "6P": 6, "9P": 9, "12P": 12})
diagram.plot(axes=axes)
(crossing,) = diagram.crossings
print(f"{crossing.order} meets mode {crossing.mode} at {crossing.speed * 30 / math.pi:.3f} 1/min")
assert abs(crossing.speed * 12 / (2 * math.pi) - modes.frequencies[first]) < 1e-6 * modes.frequencies[first]

# %%
# Power flow at the rated point
# -----------------------------
# At the rated speed, 5.3 MW pass the gearbox.

flow = system.power_flow({"generator.w": RATIO * W_RATED})
print(flow)

# %%
# A gust
# ------
# The wind's torque varies with the blades' passing frequency, three times a turn, and a gust adds 30 % within a second.

times = np.linspace(0.0, 80.0, 8001)
gust = 0.3 / (1 + np.exp(-8 * (times - 15.0)))
torque = TAU_RATED * (1 + 0.05 * np.sin(3 * W_RATED * times) + gust)
result = system.simulate(
    80.0, samples=8001, inputs={"wind": gl.Table(times, torque)},
    start={"rotor.w": W_RATED, "generator.w": ratio * W_RATED, "shaft.phi_rel": -TAU_RATED / C_SHAFT},
)  # fmt: skip
shaft_torque = -result["shaft.tau"]

figure, (above, below, spectrum) = plt.subplots(3, 1, figsize=(8, 7.5), layout="constrained")
above.plot(times, torque / 1e6, color="#e08e0b", lw=1, label="wind")
above.plot(times, shaft_torque / 1e6, color="#0b5394", label="shaft")
above.set_ylabel("torque, MN·m")
above.legend()
below.plot(times, result["rotor.w"] * 30 / math.pi)
below.sharex(above)
below.set(xlabel="time, s", ylabel="rotor, 1/min")
result.plot_spectrum("shaft.tau", window="flattop", t_start=60.0, f_max=3.0, units={"N.m": "kN.m"}, axes=spectrum)
spectrum.axvline(3 * W_RATED / (2 * math.pi), color="firebrick", ls=":", lw=1, label="3P")
spectrum.set_ylim(bottom=1e-2)
spectrum.legend()  # sphinx_gallery_thumbnail_number = 2

# %%
# What remains of the 3P excitation in the shaft is what the frequency response says. Below the natural frequency the rotor's
# inertia takes most of it:

response = gl.frequency_response(system, [3 * W_RATED], ["wind"], ["shaft.tau"])
expected = 0.05 * TAU_RATED * abs(response["shaft.tau", "wind"][0])
last = times > 60.0
basis = np.column_stack(
    [np.sin(3 * W_RATED * times[last]), np.cos(3 * W_RATED * times[last]), np.ones(last.sum()), times[last]]
)
found = np.hypot(*np.linalg.lstsq(basis, result["shaft.tau"][last], rcond=None)[0][:2])
print(f"3P torque in the shaft: {found / 1e3:.2f} kN.m in the run, {expected / 1e3:.2f} kN.m by the frequency response")
assert abs(found - expected) < 0.005 * expected
