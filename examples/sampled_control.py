r"""
A controller from outside, 1000 times a second
==============================================

``system.stepper`` holds a run that is advanced from outside: a loop reads what it needs, sets inputs, and asks for the next
millisecond. So a real-time program, or a library of reinforcement learning, drives a train. The class below has the two methods that
such libraries ask for, ``reset`` and ``step``; nothing of them is needed.

Here a PI law governs the carrier of the XP train of Zhou & Cui (2022) by the torque on its ring. How long each step took is measured:
a loop in real time has a millisecond for it. How evenly the steps come depends on the machine and on what else it does.
"""

import time

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp

PERIOD = 1e-3  # s


class TrainEnvironment:
    """The XP train with its torque as the action, and its speeds as the observation."""

    def __init__(self, target: float) -> None:
        self.system = gl.compile(gp.ZhouCui2022(), outputs=["w_in", "w_out"])
        self.target = target

    def observation(self) -> np.ndarray:
        return np.array([self.run["w_in"], self.run["w_out"]])

    def reset(self) -> np.ndarray:
        self.run = self.system.stepper(rtol=1e-5, inputs={"tau_in": 0.0})
        self.steps = 0
        return self.observation()

    def step(self, action: float) -> tuple[np.ndarray, float, bool]:
        """Hold a torque for one period: observation, reward, whether it is over."""
        self.run.inputs["tau_in"] = action
        self.steps += 1
        self.run.advance(self.steps * PERIOD)  # no instant has the errors of the ones before it
        seen = self.observation()
        return seen, -abs(seen[1] - self.target) * PERIOD, self.steps >= 1000


environment = TrainEnvironment(target=2.0)
seen, over, integral = environment.reset(), False, 0.0
taken, reward, speeds, torques = [], 0.0, [seen], [0.0]
while not over:
    begin = time.perf_counter()
    error = environment.target - seen[1]
    integral += error * PERIOD
    action = 400.0 * error + 600.0 * integral
    seen, gain, over = environment.step(action)
    reward += gain
    taken.append(time.perf_counter() - begin)
    speeds.append(seen)
    torques.append(action)

ms = 1e3 * np.sort(taken)
late = int((ms > 1e3 * PERIOD).sum())
print(f"{len(taken)} steps of {1e3 * PERIOD:g} ms, carrier at {seen[1]:.3f} rad/s, reward {reward:.3f}")
print(
    f"a step took {np.median(ms):.3f} ms (median), {ms[int(0.99 * len(ms))]:.3f} ms (99 %), {ms[-1]:.3f} ms (longest); {late} were late"
)
assert environment.run.t == 1.0
assert np.isfinite(seen).all()

# %%
# Held to the clock
# -----------------
# In a real-time loop each step waits for its instant. By how much it begins too late, its jitter, is the machine's: an ordinary system
# interrupts a program now and then.
seen = environment.reset()
lateness, begin = [], time.perf_counter()
for step in range(300):
    while time.perf_counter() < begin + step * PERIOD:  # sleeping would be less exact
        pass
    lateness.append(time.perf_counter() - (begin + step * PERIOD))
    seen, _, _ = environment.step(100.0)
held = time.perf_counter() - begin
us = 1e6 * np.sort(lateness)
print(
    f"{len(us)} steps at 1 kHz took {held:.3f} s; jitter {np.median(us):.0f} us (median), {us[int(0.99 * len(us))]:.0f} us (99 %)"
)
assert environment.run.t == 0.3

figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(7, 5), layout="constrained")
instants = PERIOD * np.arange(len(speeds))
above.plot(instants, speeds, label=["ring", "carrier"])
above.axhline(environment.target, color="0.4", linestyle=":")
above.set_ylabel("speed, rad/s")
above.legend()
below.step(instants, torques)
below.set(xlabel="time, s", ylabel="torque on the ring, N·m")
