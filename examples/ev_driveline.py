"""
An electric car's tip-in: clunk and shuffle
===========================================

The driver steps on the pedal while the car recuperates: the torque changes its sign, the play of the driveline is crossed,
and the flanks meet with a clunk. Then car and motor swing against each other, a few times a second: shuffle. A torque that
waits in the play is the remedy.

Three checks: the shuffle's frequency by hand, the time of free flight by the motion of the motor alone, and the car's speed
by its momentum.
"""

import math

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

import gearlib as gl
import gearparts as gp

J_MOTOR, RATIO, RADIUS, MASS, J_WHEELS = 0.045, 9.1, 0.32, 1750.0, 2.4
C, D, PLAY = 9000.0, 25.0, math.radians(2.0)  # half shafts and play, both as the wheels see them


class Car(gl.Component):
    """Motor, reduction gear, half shafts with play, wheels that roll, body."""

    torque = gl.Input("N.m", "torque of the motor")

    def assemble(self):
        self.source, self.motor = gp.Torque(tau=self.torque), gp.Inertia(J=J_MOTOR)
        self.reduction = gp.IdealGear(ratio=RATIO)
        self.shafts = gp.ElastoBacklash(c=C, d=D, b=PLAY)
        self.wheels, self.contact = gp.Inertia(J=J_WHEELS), gp.IdealRollingWheel(radius=RADIUS)
        self.body = gp.Mass(m=MASS)
        return [
            gl.connect(self.source.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.reduction.flange_a),
            gl.connect(self.reduction.flange_b, self.shafts.flange_a),
            gl.connect(self.shafts.flange_b, self.wheels.flange_a),
            gl.connect(self.wheels.flange_b, self.contact.flange_r),
            gl.connect(self.contact.flange_t, self.body.flange_a),
        ]


system = gl.compile(Car())

# %%
# The shuffle's frequency
# -----------------------
# The motor's inertia counts with the square of the ratio, the car's mass with that of the wheel's radius. The model is
# linearised where the flanks are pressed.

J_1, J_2 = RATIO**2 * J_MOTOR, J_WHEELS + MASS * RADIUS**2
by_hand = math.sqrt(C * (1 / J_1 + 1 / J_2)) / (2 * math.pi)
pressed = {"shafts.phi_rel": -PLAY}  # beyond the play, which ends at half of it
modes = gl.modes(system, at=pressed)
shuffle = modes.frequencies[modes.free]
print(f"shuffle {shuffle:.4f} Hz, by hand {by_hand:.4f} Hz")
assert abs(shuffle - by_hand) < 1e-6 * by_hand

# %%
# Tip-in
# ------
# From -15 N.m to 200 N.m, at once within 30 ms, or with a stop at 4 N.m while the play is crossed and then within one period
# of the shuffle, which a ramp of that length does not excite.

REGEN, FULL = -15.0, 200.0
fast = gl.Table([0.0, 0.2, 0.23, 1.5], [REGEN, REGEN, FULL, FULL])
shaped = gl.Table([0.0, 0.2, 0.22, 0.34, 0.34 + 1 / by_hand, 1.5], [REGEN, REGEN, 4.0, 4.0, FULL, FULL])


def run(torque):
    """From a steady recuperation: the shafts are twisted by its torque, everything slows down together."""
    slow = RATIO * REGEN / (J_1 + J_2)  # rad/s2 of the wheels
    twist = J_2 * slow / C  # what the shafts carry is what slows the car down
    start = {"wheels.w": 40.0, "motor.w": 40.0 * RATIO, "shafts.phi_rel": -(twist - PLAY / 2)}
    return system.simulate(1.5, samples=3001, inputs={"torque": torque}, start=start, rtol=1e-8)


sudden, gentle = run(fast), run(shaped)
for name, found in (("at once", sudden), ("with a stop", gentle)):
    swing = np.ptp(found["body.a"][found.time > 0.6])
    print(
        f"{name:12} largest torque in the shafts {-found['shafts.tau'].min():5.0f} N.m, swing of the car's acceleration {swing:.2f} m/s2"
    )

# %%
# Free flight
# -----------
# In the play, the motor turns alone. Its angle is its torque's double integral, from where a sample first lies within the
# play.


def momentum(torque, t):
    """Integral of a table of torque, N.m.s, from 0 to t."""
    times = np.union1d(torque.t[torque.t < t], [0.0, t])
    return np.trapezoid(np.interp(times, torque.t, torque.y), times)


begin = int(np.argmax(sudden["shafts.phi_rel"] < PLAY / 2))
t_0, phi_0 = sudden.time[begin], sudden["shafts.phi_rel"][begin]
w_0 = sudden["wheels.w"][begin] - sudden["motor.w"][begin] / RATIO


def phi(t):
    """Angle across the play while nothing touches."""
    steps = np.linspace(t_0, t, 20_001)
    gained = np.array([momentum(fast, x) for x in steps[::100]]) - momentum(fast, t_0)
    return phi_0 + w_0 * (t - t_0) - RATIO / J_1 * np.trapezoid(np.interp(steps, steps[::100], gained), steps)


meets = brentq(lambda t: phi(t) + PLAY / 2, t_0 + 1e-3, t_0 + 0.1)
leaves, contact = (t for t, what in sudden.events if what.endswith("contact"))
print(f"the flanks meet at {contact:.7f} s in the run, at {meets:.7f} s by the motor's motion alone")
assert leaves < t_0 < contact
assert abs(contact - meets) < 1e-7

# %%
# Momentum
# --------
# Motor, wheels and body together know nothing of shafts and play.

gained = J_1 * np.ptp(sudden["motor.w"][[0, -1]]) / RATIO + J_2 * np.ptp(sudden["wheels.w"][[0, -1]])
assert abs(gained - RATIO * momentum(fast, 1.5)) < 1e-6 * gained

figure, (above, middle, below) = plt.subplots(3, 1, sharex=True, figsize=(8, 7), layout="constrained")
for name, found, torque in (("at once", sudden, fast), ("with a stop", gentle, shaped)):
    above.plot(found.time, np.interp(found.time, torque.t, torque.y), label=name)
    middle.plot(found.time, np.degrees(found["shafts.phi_rel"]))
    below.plot(found.time, found["body.a"])
middle.axhspan(-math.degrees(PLAY) / 2, math.degrees(PLAY) / 2, color="0.9")
middle.text(1.3, 0.0, "play", va="center")
above.set_ylabel("torque, N·m")
above.legend()
middle.set_ylabel("twist, deg")
below.set(xlabel="time, s", ylabel="acceleration, m/s²", xlim=(0.15, 1.3))
