r"""
An event of one's own
=====================

A component makes an event by a comparison in its equations, and acts at it by ``When``. A shear pin is an example: an elastic pin that
breaks where its torque first exceeds a limit, and transmits nothing from then on. One class in one file is all that it takes: the
solver's root function, its location to rounding and the restart behind it follow from the equations.

A body at rest is loaded with a constant torque *T* through such a pin. It swings as :math:`\varphi = T (1 - \cos \omega t) / c`,
so that the moment of breaking and the motion after it are known in closed form.
"""

import numpy as np

import gearlib as gl
import gearparts as gp
from gearparts.interfaces import Compliant


class ShearPin(Compliant):
    """Spring ``tau = c phi_rel`` until ``abs(tau)`` first exceeds ``tau_max``; afterwards ``tau = 0``."""

    c = gl.Parameter("N.m/rad", "stiffness", min=0)
    tau_max = gl.Parameter("N.m", "torque at which it breaks", min=0)
    broken = gl.Discrete("1 once it is broken")

    def equations(self) -> list[gl.Eq | gl.When]:
        elastic = self.c * self.phi_rel
        return [
            gl.Eq(self.tau, gl.Piecewise((0, gl.holds(self.broken)), (elastic, True))),
            gl.When(gl.Or(elastic > self.tau_max, elastic < -self.tau_max), gl.Eq(self.broken, 1)),
        ]


C, J, T = 1000.0, 0.1, 20.0


class Bench(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.torque, self.body = gp.Torque(tau=T), gp.Inertia(J=J)
        self.pin, self.ground = ShearPin(c=C, tau_max=1.5 * T), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.body.flange_a),
            gl.connect(self.ground.flange, self.pin.flange_a),
            gl.connect(self.pin.flange_b, self.body.flange_b),
        ]


result = gl.simulate(Bench(), 0.1, samples=201, rtol=1e-9)

omega = np.sqrt(C / J)
breaks = np.arccos(-0.5) / omega  # 1 - cos = 1.5
print(f"the pin breaks at {result.events[0][0]:.12f} s, by hand at {breaks:.12f} s")
assert abs(result.events[0][0] - breaks) < 1e-9

t = result.time
swinging = T / (J * omega) * np.sin(omega * np.minimum(t, breaks))
expected = swinging + T / J * np.maximum(t - breaks, 0)
error = np.abs(result["body.w"] - expected).max() / expected.max()
print(f"speed at the end {result['body.w'][-1]:.6f} rad/s, by hand {expected[-1]:.6f} rad/s, relative error {error:.1e}")
assert error < 1e-7
assert result["pin.broken"][-1] == 1

result.plot("body.w", "pin.tau")
