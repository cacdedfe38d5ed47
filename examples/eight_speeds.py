r"""
An automatic gearbox with eight speeds shifts 1-2-3
===================================================

Four planetary sets, two brakes and three clutches make eight forward speeds; three of the five are closed in each. The pressures of a
shift from first over second to third come as a table of measured values, CSV, and are handed to the model as inputs.

Which speed a set of closed elements gives is a system of linear equations: Willis' four and one for each that is closed. The run must
end each shift at the ratio that they say.
"""

import io
import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

RATIOS = {"p1": 2.0, "p2": 2.0, "p3": 1.6, "p4": 3.7}
GEARS = {1: "ABE", 2: "ABC", 3: "ACE", 4: "ACD", 5: "ADE", 6: "CDE", 7: "BDE", 8: "BCD"}
PRESSURES = """\
t,A,B,C,D,E
0.0,1,1,0,0,1
1.5,1,1,0,0,1
1.6,1,1,0.10,0,0.35
2.0,1,1,0.25,0,0
2.8,1,1,0.32,0,0
3.0,1,1,1,0,0
4.5,1,1,1,0,0
4.6,1,0.35,1,0,0.10
5.0,1,0,1,0,0.25
5.8,1,0,1,0,0.32
6.0,1,0,1,0,1
8.0,1,0,1,0,1
"""


class EightSpeeds(gl.Component):
    """Engine, gearbox, car; the elements' normalised pressures are inputs."""

    def assemble(self):
        self.engine, self.shaft = gp.ConstantTorque(tau_constant=220.0), gp.Inertia(J=0.25, start={"w": 120.0})
        self.p1, self.p2, self.p3, self.p4 = (gp.IdealPlanetary(ratio=ratio) for ratio in RATIOS.values())
        self.A, self.B = (gp.Brake(fn_max=2500.0) for _ in range(2))
        self.C, self.D, self.E = (gp.Clutch(fn_max=2500.0) for _ in range(3))
        self.sun, self.ring, self.drum, self.middle, self.front = (gp.Inertia(J=0.012) for _ in range(5))
        self.lever = gp.Inertia(J=0.012)
        self.out, self.car = gp.IdealGear(ratio=3.2), gp.Inertia(J=1900 * 0.33**2)
        self.road = gp.QuadraticSpeedDependentTorque(tau_nominal=-450.0, w_nominal=100.0)
        return [
            gl.connect(self.engine.flange, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.p2.carrier, self.E.flange_a),
            gl.connect(self.p1.sun, self.p2.sun, self.B.flange_a, self.sun.flange_a),
            gl.connect(self.p1.ring, self.A.flange_a, self.ring.flange_a),
            gl.connect(self.p1.carrier, self.p4.ring, self.drum.flange_a),
            gl.connect(self.p2.ring, self.p3.sun, self.C.flange_a, self.front.flange_a),
            gl.connect(self.C.flange_b, self.p4.sun, self.E.flange_b, self.p3.ring, self.middle.flange_a),
            gl.connect(self.p3.carrier, self.D.flange_a, self.lever.flange_a),
            gl.connect(self.D.flange_b, self.p4.carrier, self.out.flange_a),
            gl.connect(self.out.flange_b, self.car.flange_a),
            gl.connect(self.car.flange_b, self.road.flange),
        ]


EightSpeeds().scheme()

# %%
# Ratios by hand
# --------------
# Eight shafts: input, sun of 1 and 2, ring of 1, carrier of 1, ring of 2, middle, carrier of 3, output.

INPUT, SUN, RING, CARRIER, FRONT, MIDDLE, LEVER, OUT = range(8)
MEMBERS = {"p1": (SUN, CARRIER, RING), "p2": (SUN, INPUT, FRONT), "p3": (FRONT, LEVER, MIDDLE), "p4": (MIDDLE, OUT, CARRIER)}
CLOSED = {
    "A": {RING: 1.0},
    "B": {SUN: 1.0},
    "C": {FRONT: 1.0, MIDDLE: -1.0},
    "D": {LEVER: 1.0, OUT: -1.0},
    "E": {INPUT: 1.0, MIDDLE: -1.0},
}


def ratio_by_hand(closed):
    rows = np.zeros((8, 8))
    for row, (name, (sun, carrier, ring)) in zip(rows, MEMBERS.items()):
        row[sun], row[ring], row[carrier] = 1.0, RATIOS[name], -(1 + RATIOS[name])
    for row, element in zip(rows[4:], closed):
        for shaft, sign in CLOSED[element].items():
            row[shaft] = sign
    rows[7, INPUT] = 1.0
    return 1.0 / np.linalg.solve(rows, [0] * 7 + [1.0])[OUT]


steps = {gear: ratio_by_hand(closed) for gear, closed in GEARS.items()}
print("ratios: " + ", ".join(f"{gear}: {ratio:.3f}" for gear, ratio in steps.items()))

# %%
# The run
# -------

columns = np.genfromtxt(io.StringIO(PRESSURES), delimiter=",", names=True)
pressures = {f"{name}.f_normalized": gl.Table(columns["t"], columns[name]) for name in "ABCDE"}
system = gl.compile(
    EightSpeeds(),
    outputs=["shaft.w", "car.w", "out.flange_a.tau", *(f"{name}.w_rel" if name in "CDE" else f"{name}.w" for name in "ABCDE")],
)
start = {"car.w": 120.0 / steps[1] / 3.2, "drum.w": 0.0, "ring.w": 0.0, "sun.w": 0.0}
run = system.simulate(8.0, samples=4001, rtol=1e-6, inputs=pressures, start=start)
ratio = run["shaft.w"] / (3.2 * run["car.w"])
for gear, until in ((1, 1.4), (2, 4.4), (3, 7.9)):
    there = float(np.interp(until, run.time, ratio))
    print(f"at {until} s: ratio {there:.4f}; gear {gear} by hand {steps[gear]:.4f}")
    assert abs(there - steps[gear]) < 1e-4 * steps[gear]

# %%

figure, (above, middle, below) = plt.subplots(3, 1, sharex=True, figsize=(8, 7), layout="constrained")
above.plot(run.time, ratio, color="black")
for gear in (1, 2, 3):
    above.axhline(steps[gear], color="0.6", ls=":", lw=1)
    above.annotate(
        f"gear {gear}", (7.9, steps[gear]), fontsize=9, va="top", ha="right", xytext=(0, -2), textcoords="offset points"
    )
above.set(ylabel="engine over output", ylim=(1.7, 4.9))
middle.plot(run.time, run["shaft.w"] * 30 / math.pi, label="engine")
middle.plot(run.time, 3.2 * run["car.w"] * 30 / math.pi, label="output")
middle.set_ylabel("speed, 1/min")
middle.legend(fontsize=8)
for name, width in zip("ABCE", (5.0, 3.5, 2.0, 1.0)):  # some lie on others
    below.plot(columns["t"], columns[name], label=name, lw=width)
below.set(xlabel="time, s", ylabel="pressure over the largest")
below.legend(fontsize=8, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
