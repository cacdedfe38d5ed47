r"""
A train in Modelica text
========================

``gl.read_modelica`` makes a component class of a Modelica model. Its parameters are open, it is compiled, simulated and analysed as any
other, and ``gl.to_modelica`` writes it again.

The train is a motor on a gear that drives a load through an elastic shaft. Two things are known by hand: its natural frequency,
:math:`f = \sqrt{c\,(1/J_1 + 1/J_2)}/2\pi` with the motor's inertia :math:`J_1 = i^2 J_m` behind the gear, and the mean speed, which
grows with the torque over all inertia.
"""

import matplotlib.pyplot as plt
import numpy as np

import gearlib as gl

TEXT = """
model Drive "motor, gear, elastic shaft and load"
  import Modelica.Mechanics.Rotational.{Components, Sources};
  parameter Modelica.Units.SI.Inertia J_motor = 0.02 "rotor";
  parameter Modelica.Units.SI.Inertia J_load = 3 "load";
  parameter Real i = 10 "ratio of the gear";
  parameter Modelica.Units.SI.RotationalSpringConstant c = 4000;
  Sources.ConstantTorque torque(tau_constant = 5, useSupport = false);
  Components.Inertia motor(J = J_motor);
  Components.IdealGear gear(ratio = i, useSupport = false);
  Components.SpringDamper shaft(c = c, d = 0);
  Components.Inertia load(J = J_load, phi(fixed = true, start = 0), w(fixed = true, start = 0));
equation
  connect(torque.flange, motor.flange_a);
  connect(motor.flange_b, gear.flange_a);
  connect(gear.flange_b, shaft.flange_a);
  connect(shaft.flange_b, load.flange_a);
end Drive;
"""

Drive = gl.read_modelica(TEXT)
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for J_load in (3.0, 1.0):
    system = gl.compile(Drive(J_load=J_load))
    result = system.simulate(t_end=1.0, samples=501, rtol=1e-9)
    axes.plot(result.time, result["load.w"], label=f"load of {J_load:g} kg·m²")
    whole, behind = 10.0**2 * 0.02 + J_load, 10.0**2 * 0.02
    f = np.sqrt(4000.0 * (1 / behind + 1 / J_load)) / (2 * np.pi)
    exact = 50.0 / whole * (result.time - np.sin(2 * np.pi * f * result.time) / (2 * np.pi * f))
    error = np.abs(result["load.w"] - exact).max()
    print(f"load {J_load:g} kg m2: natural frequency {f:.4f} Hz, largest error of the speed {error:.1e} rad/s")
    assert error < 1e-6

axes.set(xlabel="time, s", ylabel="speed of the load, rad/s")
axes.legend()
plt.show()

# Written again and read again, it moves the same:
again = gl.simulate(gl.read_modelica(gl.to_modelica(Drive(J_load=1.0)))(), t_end=1.0, samples=501, rtol=1e-9)
assert np.abs(again["load.w"] - result["load.w"]).max() < 1e-7
