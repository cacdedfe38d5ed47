r"""
An engine as an FMU, out and in again
=====================================

An engine whose torque follows the throttle with a lag is written as a Functional Mock-up Unit, as a maker of engines would hand it out:
machine code, no equations, no Python. ``gp.FMU`` takes it into a train at the engine's shaft, in steps of a fixed period: at each instant
it is told the speed, and its torque is held up to the next.

What the coupling costs is seen beside the whole system's exact motion, the exponential of its matrix: the error falls in proportion to
the period.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import expm

import gearlib as gl
import gearparts as gp

LAG, FLYWHEEL, LOAD, C, D, THROTTLE = 0.05, 0.3, 1.0, 2e3, 5.0, 0.8


class Engine(gl.Component):
    """Its torque follows the throttle with a lag, and falls with the speed."""

    lag = gl.Parameter("s", "time constant", default=LAG, min=1e-6)
    w = gl.Input("rad/s", "speed of the shaft")
    throttle = gl.Input("1", "0 to 1")
    tau = gl.Variable("N.m", "torque on the shaft", start=0.0)

    def equations(self):
        return [gl.Eq(self.lag * gl.der(self.tau), 100.0 * self.throttle - 0.5 * self.w - self.tau)]


fmu = gl.compile(Engine(), outputs=["tau"]).export_fmu(Path(tempfile.mkdtemp()) / "engine.fmu", kind="cs")


class Car(gl.Component):
    """The engine's FMU, its flywheel, an elastic shaft and a load."""

    period = gl.Structural(1e-3, "s, of the coupling")

    def assemble(self):
        self.engine = gp.FMU(fmu, speed="w", torque="tau", inputs=["throttle"], period=self.period)
        self.flywheel, self.shaft, self.load = gp.Inertia(J=FLYWHEEL), gp.SpringDamper(c=C, d=D), gp.Inertia(J=LOAD)
        return [
            gl.connect(self.engine.flange, self.flywheel.flange_a),
            gl.connect(self.flywheel.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
        ]


# the same by hand: torque, speeds of flywheel and load, twist of the shaft, and a one for the throttle
A = np.zeros((5, 5))
A[0, [0, 1, 4]] = -1 / LAG, -0.5 / LAG, 100.0 * THROTTLE / LAG
A[1, :4] = np.array([1.0, -D, D, C]) / FLYWHEEL
A[2, 1:4] = np.array([D, -D, -C]) / LOAD
A[3, 1:3] = -1.0, 1.0
times = np.linspace(0.0, 0.4, 41)
exact = np.array([(expm(A * t) @ [0, 0, 0, 0, 1.0])[2] for t in times])

periods, errors = [4e-3, 2e-3, 1e-3], []
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
for period in periods:
    result = gl.simulate(Car(period=period), t_end=0.4, times=times, inputs={"engine.signals[0].u": THROTTLE})
    errors.append(np.abs(result["load.w"] - exact).max())
    left.plot(times, result["load.w"], label=f"period {1e3 * period:g} ms")
    print(f"period {1e3 * period:g} ms: largest error of the load's speed {errors[-1]:.4f} rad/s")
assert all(1.8 < a / b < 2.2 for a, b in zip(errors, errors[1:], strict=False)), "it falls in proportion to the period"

left.plot(times, exact, "k--", label="exact")
left.set(xlabel="time, s", ylabel="speed of the load, rad/s")
left.legend()
right.plot([1e3 * period for period in periods], errors, "o-")
right.set(xlabel="period of the coupling, ms", ylabel="largest error, rad/s", xlim=(0, None), ylim=(0, None))
figure.tight_layout()
plt.show()
