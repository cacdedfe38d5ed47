"""Linear blocks, as in Modelica.Blocks.Continuous and Modelica.Blocks.Math: gains, sums, integrators, filters, controllers.

States without a fixed start value begin at 0: ``blocks.Integrator(start={"y": 2.0})``.
"""

from __future__ import annotations

import gearlib as gl
from gearparts.blocks.interfaces import SHORTEST, SI2SO, SISO, SO


class Gain(SISO):
    """Proportional gain: ``y = k u``."""

    k = gl.Parameter("any", "gain")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.k * self.u)]


class Add(SI2SO):
    """Weighted sum: ``y = k1 u1 + k2 u2``."""

    k1 = gl.Parameter("any", "gain of the first input", default=1.0)
    k2 = gl.Parameter("any", "gain of the second input", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.k1 * self.u1 + self.k2 * self.u2)]


class Add3(SI2SO):
    """Weighted sum: ``y = k1 u1 + k2 u2 + k3 u3``."""

    u3 = gl.Input("any", "third input signal")
    k1 = gl.Parameter("any", "gain of the first input", default=1.0)
    k2 = gl.Parameter("any", "gain of the second input", default=1.0)
    k3 = gl.Parameter("any", "gain of the third input", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.k1 * self.u1 + self.k2 * self.u2 + self.k3 * self.u3)]


class Feedback(SI2SO):
    """Difference of a command and a feedback signal: ``y = u1 - u2``."""

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.u1 - self.u2)]


class Product(SI2SO):
    """Product: ``y = u1 u2``."""

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.u1 * self.u2)]


class Integrator(SISO):
    """Integral: ``der(y) = k u``."""

    k = gl.Parameter("any", "gain", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.y), self.k * self.u)]


class Derivative(SISO):
    """Filtered derivative: ``T der(x) = u - x``, ``y = k (u - x) / T``, the transfer function ``k s / (T s + 1)``."""

    k = gl.Parameter("any", "gain", default=1.0)
    T = gl.Parameter("s", "time constant of the lag", default=0.01, min=SHORTEST)
    x = gl.Variable("any", "lagged input")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.T * gl.der(self.x), self.u - self.x), gl.Eq(self.y, self.k * (self.u - self.x) / self.T)]


class FirstOrder(SISO):
    """First-order lag: ``T der(y) + y = k u``."""

    k = gl.Parameter("any", "gain", default=1.0)
    T = gl.Parameter("s", "time constant", min=SHORTEST)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.T * gl.der(self.y) + self.y, self.k * self.u)]


class SecondOrder(SISO):
    """Second-order lag: ``der(y) = yd``, ``der(yd) = w**2 (k u - y) - 2 D w yd``."""

    k = gl.Parameter("any", "gain", default=1.0)
    w = gl.Parameter("rad/s", "natural angular frequency", min=SHORTEST)
    D = gl.Parameter("1", "damping ratio")
    yd = gl.Variable("any", "derivative of the output")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.y), self.yd),
            gl.Eq(gl.der(self.yd), self.w**2 * (self.k * self.u - self.y) - 2 * self.D * self.w * self.yd),
        ]


class PI(SISO):
    """Proportional-integral controller: ``T der(x) = u``, ``y = k (x + u)``."""

    k = gl.Parameter("any", "gain", default=1.0)
    T = gl.Parameter("s", "integral time", min=SHORTEST)
    x = gl.Variable("any", "integral of the input over the integral time")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.T * gl.der(self.x), self.u), gl.Eq(self.y, self.k * (self.x + self.u))]


class PID(SISO):
    """PID controller in additive form: ``y = k (u + x_I + Td (u - x_D) / T)`` with ``Ti der(x_I) = u``, ``T der(x_D) = u - x_D``.

    The derivative is filtered with the time constant ``T = Td / Nd``: ``k (1 + 1 / (Ti s) + Td s / (1 + s Td / Nd))``.
    """

    k = gl.Parameter("any", "gain", default=1.0)
    Ti = gl.Parameter("s", "integral time", default=0.5, min=SHORTEST)
    Td = gl.Parameter("s", "derivative time", default=0.1, min=SHORTEST)
    Nd = gl.Parameter("1", "the higher, the less the derivative lags", default=10.0, min=SHORTEST)
    x_I = gl.Variable("any", "integral of the input over the integral time")
    x_D = gl.Variable("any", "lagged input")

    def equations(self) -> list[gl.Eq]:
        lag = self.Td / self.Nd
        return [
            gl.Eq(self.Ti * gl.der(self.x_I), self.u),
            gl.Eq(lag * gl.der(self.x_D), self.u - self.x_D),
            gl.Eq(self.y, self.k * (self.u + self.x_I + self.Nd * (self.u - self.x_D))),
        ]


class LimPID(SO):
    """P, PI, PD or PID controller with limited output, anti-windup compensation and set-point weighting.

    With the set-point ``u_s`` and the measurement ``u_m``, ``v = k (wp u_s - u_m + x_I + D)`` and ``y = min(max(v, y_min), y_max)``,
    where ``Ti der(x_I) = u_s - u_m + (y - v) / (k Ni)`` and ``D = Nd (e - x_D)``, ``(Td / Nd) der(x_D) = e - x_D``, ``e = wd u_s -
    u_m``. While the output is limited, ``y - v`` unwinds the integrator.

    References
    ----------
    K. J. Astrom, T. Hagglund, "PID Controllers: Theory, Design, and Tuning", 2nd ed., Instrument Society of America 1995, 3.5.
    """

    u_s = gl.Input("any", "set-point")
    u_m = gl.Input("any", "measurement")
    controller_type = gl.Structural("PID", "which parts it has", choices=("P", "PI", "PD", "PID"))
    k = gl.Parameter("any", "gain", default=1.0, min=SHORTEST)
    Ti = gl.Parameter("s", "integral time", default=0.5, min=SHORTEST)
    Td = gl.Parameter("s", "derivative time", default=0.1, min=SHORTEST)
    y_max = gl.Parameter("any", "upper limit of the output")
    y_min = gl.Parameter("any", "lower limit of the output", default=lambda controller: -controller.y_max)
    room = gl.Parameter("any", "y_max - y_min, which is not negative", default=lambda b: b.y_max - b.y_min, min=0)
    wp = gl.Parameter("1", "weight of the set-point in the proportional part", default=1.0, min=0)
    wd = gl.Parameter("1", "weight of the set-point in the derivative part", default=0.0, min=0)
    Ni = gl.Parameter("1", "Ni Ti is the time constant of the anti-windup compensation", default=0.9, min=SHORTEST)
    Nd = gl.Parameter("1", "the higher, the less the derivative lags", default=10.0, min=SHORTEST)
    v = gl.Variable("any", "output before it is limited")
    x_I = gl.Variable("any", "integral part, over the gain")
    x_D = gl.Variable("any", "lagged input of the derivative part")

    def equations(self) -> list[gl.Eq]:
        integral, derivative = "I" in self.controller_type, "D" in self.controller_type
        e = self.wd * self.u_s - self.u_m
        back = (self.y - self.v) / (self.k * self.Ni)
        parts = self.wp * self.u_s - self.u_m + (self.x_I if integral else 0) + (self.Nd * (e - self.x_D) if derivative else 0)
        limited = gl.Piecewise((self.y_max, self.v > self.y_max), (self.y_min, self.v < self.y_min), (self.v, True))
        return [
            gl.Eq(self.v, self.k * parts),
            gl.Eq(self.y, limited),
            gl.Eq(self.Ti * gl.der(self.x_I), self.u_s - self.u_m + back) if integral else gl.Eq(self.x_I, 0),
            gl.Eq(self.Td / self.Nd * gl.der(self.x_D), e - self.x_D) if derivative else gl.Eq(self.x_D, 0),
        ]
