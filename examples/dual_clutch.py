r"""
A dual-clutch gearbox shifts from first to second
=================================================

The gears of both speeds are engaged before the shift; two clutches hand the engine's torque over from one to the other without a gap
in the drive. First the oncoming clutch takes over the torque while the first one opens (torque phase); then the engine is drawn down to
its new speed (inertia phase), while the oncoming clutch slips and turns the difference into heat.

While only one clutch slips, the engine's equation has a solution by hand: its inertia, its torque, and the friction of that clutch.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

FIRST, SECOND, FINAL = 3.5, 2.1, 4.1
J_ENGINE, J_CAR, TORQUE = 0.25, 1600 * 0.32**2, 180.0
CAPACITY = 420.0  # N.m of a clutch that is pressed fully
SHARE_1 = gl.Table([0.0, 1.0, 1.25, 3.0], [1.0, 1.0, 0.0, 0.0])  # of the pressing force
SHARE_2 = gl.Table([0.0, 1.0, 1.25, 1.6, 2.4, 3.0], [0.0, 0.0, 0.5, 0.62, 0.62, 1.0])


class Gearbox(gl.Component):
    """Two input shafts, one inside of the other, each with the gears of one speed."""

    def assemble(self):
        self.combustion = gp.ConstantTorque(tau_constant=TORQUE)
        self.engine = gp.Inertia(J=J_ENGINE, start={"w": 300.0})
        pressed = {"fn_max": CAPACITY, "mu_pos": ((0.0, 1.0),), "cgeo": 1.0}
        self.clutch_1 = gp.Clutch(f_normalized=SHARE_1(gl.time), **pressed)
        self.clutch_2 = gp.Clutch(f_normalized=SHARE_2(gl.time), **pressed)
        self.first, self.second = gp.IdealGear(ratio=-FIRST), gp.IdealGear(ratio=-SECOND)
        self.shaft_1, self.shaft_2 = gp.Inertia(J=2e-3, start={"w": 300.0}), gp.Inertia(J=2e-3)
        self.final, self.flex = gp.IdealGear(ratio=-FINAL), gp.SpringDamper(c=9e3, d=180.0, nominal={"phi_rel": 1e-2})
        self.car = gp.Inertia(J=J_CAR, start={"w": 300.0 / (FIRST * FINAL)})
        return [
            gl.connect(self.combustion.flange, self.engine.flange_a),
            gl.connect(self.engine.flange_b, self.clutch_1.flange_a, self.clutch_2.flange_a),
            gl.connect(self.clutch_1.flange_b, self.shaft_1.flange_a),
            gl.connect(self.clutch_2.flange_b, self.shaft_2.flange_a),
            gl.connect(self.shaft_1.flange_b, self.first.flange_a),
            gl.connect(self.shaft_2.flange_b, self.second.flange_a),
            gl.connect(self.first.flange_b, self.second.flange_b, self.final.flange_a),
            gl.connect(self.final.flange_b, self.flex.flange_a),
            gl.connect(self.flex.flange_b, self.car.flange_a),
        ]


Gearbox().scheme()

# %%
# The shift
# ---------

times = np.linspace(0.0, 3.0, 3001)
names = ["engine.w", "shaft_1.w", "shaft_2.w", "car.w", "clutch_1.tau", "clutch_2.tau", "der(car.w)"]
run = gl.simulate(Gearbox(), 3.0, times=times, rtol=1e-8, outputs=names)
w, w_1, w_2 = run["engine.w"], run["shaft_1.w"], run["shaft_2.w"]
assert np.abs(w - w_1)[times < 0.95].max() < 1e-6  # first is engaged
assert np.abs(w - w_2)[times > 2.8].max() < 1e-6  # second is
assert np.allclose(w_1 * SECOND, w_2 * FIRST, rtol=1e-9)

# %%
# By hand
# -------
# From the moment at which the first clutch is open until the second one holds, :math:`J \dot\omega = \tau - \tau_2(t)`.

begin, locked = 1.25, float(times[np.flatnonzero((times > 1.3) & (np.abs(w - w_2) < 1e-6))[0]])
slipping = times[(times >= begin) & (times < locked - 0.002)]
taken = np.array(
    [np.trapezoid(CAPACITY * np.interp(grid := np.linspace(begin, t, 400), SHARE_2.t, SHARE_2.y), grid) for t in slipping]
)
expected = np.interp(begin, times, w) + (TORQUE * (slipping - begin) - taken) / J_ENGINE
apart = np.abs(expected - np.interp(slipping, times, w)).max()
print(f"the clutch slips until {locked:.3f} s; the engine's speed by hand is at most {apart:.1e} rad/s elsewhere")
assert apart < 2e-3

heat = {k: np.trapezoid(np.abs(run[f"clutch_{k}.tau"] * (w - shaft)), times) for k, shaft in ((1, w_1), (2, w_2))}
print(f"heat in the clutches: first {heat[1]:.0f} J, second {heat[2]:.0f} J")

# %%

figure, (above, middle, below) = plt.subplots(3, 1, sharex=True, figsize=(8, 7), layout="constrained")
for values, label in ((w, "engine"), (w_1, "shaft of the first"), (w_2, "shaft of the second")):
    above.plot(times, values * 30 / math.pi, label=label, ls="-" if label == "engine" else "--")
above.set_ylabel("speed, 1/min")
middle.plot(times, np.abs(run["clutch_1.tau"]), label="first clutch")
middle.plot(times, np.abs(run["clutch_2.tau"]), label="second clutch")
middle.set_ylabel("torque, N·m")
below.plot(times, run["der(car.w)"] * 0.32, color="black")
below.set(xlabel="time, s", ylabel="car's acceleration, m/s²", ylim=(0, None))
for axes in (above, middle, below):
    axes.axvspan(1.0, begin, color="C1", alpha=0.12, label="torque phase" if axes is middle else None)
    axes.axvspan(begin, locked, color="C2", alpha=0.12, label="inertia phase" if axes is middle else None)
above.legend(fontsize=8)
middle.legend(fontsize=8, ncols=2)
