"""
A shaft's stiffness from a bench
================================

Two runs of a test bench are at hand, with other torques and start values, noise on both speeds. What are the shaft's stiffness and
damping, and how sure is that? `gl.fit` finds them by least squares with exact derivatives of the runs. It also says what the data
does not determine: two shafts in a row are felt as one.

The check is independent of gearlib: the same data are fitted with scipy's `solve_ivp` and finite differences.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

import gearlib as gl
import gearparts as gp

TRUE, NOISE = {"shaft.c": 520.0, "shaft.d": 1.6}, 0.05
TIME = np.linspace(0.0, 1.0, 101)


class Bench(gl.Component):
    """A motor drives a braked load through an elastic shaft."""

    def assemble(self):
        self.torque, self.motor = gp.Torque(), gp.Inertia(J=0.5, start={"w": 0.0})
        self.shaft, self.load = gp.SpringDamper(c=400.0, d=2.0), gp.Inertia(J=2.0, start={"w": 0.0})
        self.brake, self.ground = gp.Damper(d=0.5), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.brake.flange_a),
            gl.connect(self.brake.flange_b, self.ground.flange),
        ]


# %%
# Two experiments
# ---------------
# What stands in for the bench is a run with the true shaft, and noise.

system = gl.compile(Bench(), outputs=["motor.w", "load.w"])
rng = np.random.default_rng(1)
plans = [(5.0, 0.0), (20.0, 3.0)]  # torque in N.m, speed of the motor at the start in rad/s
experiments = []
for torque, speed in plans:
    given = {"inputs": {"torque.tau": torque}, "start": {"motor.w": speed}}
    run = system.simulate(TIME[-1], times=TIME, parameters=TRUE, **given)
    data = {name: run[name] + NOISE * rng.normal(size=len(TIME)) for name in ("motor.w", "load.w")}
    experiments.append(gl.MeasuredHistories({"time": TIME, **data}, noise=NOISE, **given))

found = gl.fit(system, experiments, free={"shaft.c": (1e2, 1e4), "shaft.d": (0.01, 10.0)})
print(found)
for name, value in TRUE.items():
    assert abs(found[name] - value) < 3 * found.standard_errors[name]
found.plot()

# %%
# The same by other means
# -----------------------
# The bench's equations written by hand, integrated by scipy, fitted with differences.


def residuals(x):
    """Predicted less measured over the noise, of both experiments."""
    rows = []
    for (torque, speed), experiment in zip(plans, experiments, strict=True):

        def rates(t, y, torque=torque):
            motor, twist, load = y
            shaft = x[0] * twist + x[1] * (motor - load)
            return [(torque - shaft) / 0.5, motor - load, (shaft - 0.5 * load) / 2.0]

        y = solve_ivp(rates, (0.0, TIME[-1]), [speed, 0.0, 0.0], t_eval=TIME, rtol=1e-9, atol=1e-10).y
        rows += [y[0] - experiment.columns["motor.w"], y[2] - experiment.columns["load.w"]]
    return np.concatenate(rows) / NOISE


other = least_squares(residuals, [found["shaft.c"] * 1.05, found["shaft.d"] * 0.9], x_scale=[100.0, 1.0])
apart = np.abs(other.x / found.numbers - 1.0)
print(f"scipy alone: c = {other.x[0]:.4f} N.m/rad, d = {other.x[1]:.5f} N.m.s/rad; {apart.max():.1e} from the fit")
assert apart.max() < 1e-4
errors = np.sqrt(np.diag(np.linalg.inv(other.jac.T @ other.jac)))
np.testing.assert_allclose(list(found.standard_errors.values()), errors, rtol=1e-3)

# %%
# What the data does not determine
# --------------------------------


class TwoShafts(Bench):
    """The same with two shafts in a row, in place of the one."""

    def assemble(self):
        joints = super().assemble()
        self.coupling = gp.Spring(c=2000.0)
        joints[2] = gl.connect(self.shaft.flange_b, self.coupling.flange_a)
        return [*joints, gl.connect(self.coupling.flange_b, self.load.flange_a)]


modes = gl.MeasuredModes([5.0], noise=0.01)
both = gl.fit(gl.compile(TwoShafts()), modes, free={"shaft.c": (1e2, 1e4), "coupling.c": (1e2, 1e4)})
print(both)
assert not both.identifiable
plt.show()
