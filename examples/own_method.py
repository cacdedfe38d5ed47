r"""
A method of integration of one's own
====================================

A method is a class with a name that gives a stepper; what it adds to gearlib is its formula. Events and their location, samples, the
discrete state, time events, the log and the errors are those of every run, since there is one driver for all methods. The classical
Runge-Kutta method of order 4 with a fixed step (Kutta 1901) is an example.

A body on a spring swings as :math:`\varphi = \varphi_0 \cos \omega t`: half the step must make a sixteenth of the error. A body that a
constant torque brakes stands still from :math:`t = J w_0 / T` on: an event, located within a step.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl
import gearparts as gp


class FixedSteps(gl.ExplicitStepper):
    """Kutta's four stages, and steps of ``h`` seconds."""

    def __init__(self, h: float) -> None:
        self.h = h

    def advance(self, t, x, stop):
        h = min(self.h, stop - t)
        k1 = self.f(t, x)
        k2 = self.f(t + 0.5 * h, x + 0.5 * h * k1)
        k3 = self.f(t + 0.5 * h, x + 0.5 * h * k2)
        k4 = self.f(t + h, x + h * k3)
        return t + h, x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


class RK4(gl.Method):
    """The classical Runge-Kutta method with a fixed step."""

    name = "rk4"

    def __init__(self, h: float = 1e-3) -> None:
        self.h = h

    def fits(self, run):
        """A reason, as the rest of a sentence, where a run cannot be integrated so."""
        if run.times[-1] - run.times[0] > 1e7 * self.h:
            return f"needs more than ten million steps of {self.h:g} s"
        return None

    def stepper(self, problem):
        return FixedSteps(self.h)


gl.register_method(RK4())


class Swing(gl.Component):
    def assemble(self):
        self.body, self.spring, self.ground = gp.Inertia(J=0.1, start={"phi": 0.02, "w": 0.0}), gp.Spring(c=1000.0), gp.Fixed()
        return [gl.connect(self.ground.flange, self.spring.flange_a), gl.connect(self.spring.flange_b, self.body.flange_a)]


system = gl.compile(Swing(), outputs=["body.phi"])
errors = []
for h in (1e-3, 5e-4):
    result = system.simulate(1.0, samples=101, method=RK4(h))
    errors.append(np.abs(result["body.phi"] - 0.02 * np.cos(100.0 * result.time)).max())
print(f"errors {errors[0]:.2e} rad and {errors[1]:.2e} rad: order {math.log2(errors[0] / errors[1]):.2f}")
assert 3.9 < math.log2(errors[0] / errors[1]) < 4.1


class Brake(gl.Component):
    """Turns at 10 rad/s and is braked."""

    w = gl.Variable("rad/s", "speed", start=10.0)

    def equations(self):
        return [gl.Eq(gl.der(self.w), gl.Piecewise((-40.0, self.w > 0.0), (0.0, True)))]


result = gl.simulate(Brake(), 1.0, samples=11, method="rk4")
print(f"stands still from t = {result.events[0][0]:.12f} s on; method {result.stats['method']}, {result.stats['steps']} steps")
assert abs(result.events[0][0] - 0.25) < 1e-12
assert np.allclose(result["w"], np.maximum(10.0 - 40.0 * result.time, 0.0), atol=1e-12)

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for h in (1.6e-2, 1e-3):
    swing = system.simulate(0.2, samples=201, method=RK4(h))
    left.plot(swing.time, swing["body.phi"], label=f"h = {1e3 * h:g} ms")
left.plot(swing.time, 0.02 * np.cos(100.0 * swing.time), "k:", label="cosine")
left.set(xlabel="time, s", ylabel="angle, rad")
left.locator_params(axis="x", nbins=5)
left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
right.plot(result.time, result["w"], "o-")
right.axvline(result.events[0][0], color="0.5", linestyle=":")
right.set(xlabel="time, s", ylabel="braked body's speed, rad/s")
