"""Torque sources and loads, as functions of time or speed; prescribed motions are in ``motions``.

A positive torque accelerates the connected shaft, so ``flange.tau = -tau``.
"""

from __future__ import annotations

import gearlib as gl
from gearparts.interfaces import Dissipative, OneFlange, TwoFlanges

SMALLEST = 1e-15  # smallest speed in a denominator, like Modelica.Constants.eps


class Torque(OneFlange):
    """Prescribed torque: ``flange.tau = -tau``; a positive ``tau`` accelerates the connected shaft."""

    icon = "torque"

    tau = gl.Input("N.m", "driving torque")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, -self.tau)]


class Torque2(TwoFlanges):
    """Prescribed torque between two shafts: ``flange_a.tau = tau``, ``flange_b.tau = -tau``; a positive one accelerates flange_b."""

    icon = "torque_between"

    tau = gl.Input("N.m", "torque that drives flange_b and takes its reaction from flange_a")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange_a.tau, self.tau), gl.Eq(self.flange_b.tau, -self.tau)]

    def energies(self) -> gl.Energy:
        return gl.Energy(source=True)


class ConstantTorque(OneFlange):
    """Constant torque: ``flange.tau = -tau_constant``."""

    icon = "torque"

    tau_constant = gl.Parameter("N.m", "torque; negative: a load in positive direction of rotation")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.flange.tau, -self.tau_constant)]


class TorqueStep(OneFlange):
    """Torque step: ``tau = offset_torque`` before ``start_time``, ``offset_torque + step_torque`` from then on."""

    icon = "torque"

    step_torque = gl.Parameter("N.m", "height of the step; negative: a load")
    offset_torque = gl.Parameter("N.m", "torque before the step", default=0.0)
    start_time = gl.Parameter("s", "time of the step", default=0.0)
    tau = gl.Variable("N.m", "torque that accelerates the shaft")

    def equations(self) -> list[gl.Eq]:
        step = gl.Piecewise((0, gl.time < self.start_time), (self.step_torque, True))
        return [
            gl.Eq(self.tau, self.offset_torque + step),
            gl.Eq(self.flange.tau, -self.tau),
        ]


class SpeedDependentTorque(OneFlange):
    """Base of speed-dependent torques: the speed, and the torque that accelerates the shaft."""

    icon = "load"

    w = gl.Variable("rad/s", "speed of the flange relative to the support", state="avoid")
    tau = gl.Variable("N.m", "torque at the flange that accelerates it")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.w, gl.der(self.angle())), gl.Eq(self.flange.tau, -self.tau)]

    def energies(self) -> gl.Energy:
        """It either drives, or dissipates the power it takes, as a fan does."""
        power = self.tau * self.w
        return gl.Energy(supplied=gl.Max(power, 0), heat=gl.Max(-power, 0))


class LinearSpeedDependentTorque(SpeedDependentTorque):
    """Torque proportional to speed: ``tau = tau_nominal w / w_nominal``.

    With ``torque_direction`` (the default) ``abs(w)`` replaces ``w``: the torque has the sign of ``tau_nominal`` in both directions of
    rotation.
    """

    tau_nominal = gl.Parameter("N.m", "torque at nominal speed; negative: a load")
    w_nominal = gl.Parameter("rad/s", "nominal speed", min=SMALLEST)
    torque_direction = gl.Structural(True, "same direction of torque in both directions of rotation")

    def equations(self) -> list[gl.Eq]:
        speed = abs(self.w) if self.torque_direction else self.w
        return [gl.Eq(self.tau, self.tau_nominal * speed / self.w_nominal)]


class QuadraticSpeedDependentTorque(SpeedDependentTorque):
    """Torque proportional to speed squared: ``tau = tau_nominal (w / w_nominal)**2``.

    With ``torque_direction`` (the default) it has the sign of ``tau_nominal`` in both directions of rotation; without, it changes sign
    with the speed, like that of a fan: ``tau = tau_nominal w abs(w) / w_nominal**2``.
    """

    tau_nominal = gl.Parameter("N.m", "torque at nominal speed; negative: a load")
    w_nominal = gl.Parameter("rad/s", "nominal speed", min=SMALLEST)
    torque_direction = gl.Structural(True, "same direction of torque in both directions of rotation")

    def equations(self) -> list[gl.Eq]:
        square = self.w**2 if self.torque_direction else self.w * gl.no_event(abs(self.w))
        return [gl.Eq(self.tau, self.tau_nominal * square / self.w_nominal**2)]


class InverseSpeedDependentTorque(SpeedDependentTorque):
    """Torque of constant power: ``tau = tau_nominal w_nominal / w`` above the speed ``w0``.

    With ``torque_direction`` (the default) ``abs(w)`` replaces ``w``, and below ``w0`` the torque is constant. Without, it is
    ``tau_nominal w / w0`` below ``w0``, so that it jumps by the factor ``w_nominal / w0`` at that speed, as in the Modelica Standard
    Library 4.1.0.
    """

    tau_nominal = gl.Parameter("N.m", "torque at nominal speed; negative: a load")
    w_nominal = gl.Parameter("rad/s", "nominal speed", min=SMALLEST)
    w0 = gl.Parameter("rad/s", "speed below which the law is another one", min=SMALLEST)
    torque_direction = gl.Structural(True, "same direction of torque in both directions of rotation")

    def equations(self) -> list[gl.Eq]:
        w, w0, power = self.w, self.w0, self.tau_nominal * self.w_nominal
        if self.torque_direction:
            tau = gl.Piecewise((power / w, w >= w0), (-power / w, w <= -w0), (power / w0, True))
        else:
            tau = gl.Piecewise((power / w, w >= w0), (power / w, w <= -w0), (self.tau_nominal * w / w0, True))
        return [gl.Eq(self.tau, tau)]


class SignTorque(SpeedDependentTorque):
    """Constant torque with the sign of the speed: ``tau = tau_nominal sign(w)``, smoothed near standstill.

    ``"exp"``: ``tau_nominal (2 / (1 + exp(-w / (0.01 w0))) - 1)`` at any speed. Within ``-w0 < w < w0``, ``"sine"``:
    ``tau_nominal sin(pi w / (2 w0))``; ``"linear"``: ``tau_nominal w / w0``; ``"cosine"``:
    ``tau_nominal sign(w) (1 - cos(pi w / (2 w0)))``.
    """

    icon = "load"

    tau_nominal = gl.Parameter("N.m", "torque; negative: it brakes in both directions of rotation")
    w0 = gl.Parameter("rad/s", "speed below which the torque is smaller", min=SMALLEST)
    reg = gl.Structural("exp", "law near standstill", choices=("exp", "sine", "linear", "cosine"))

    def equations(self) -> list[gl.Eq]:
        x = self.w / self.w0
        if self.reg == "exp":
            direction = gl.tanh(50 * x)  # the same function, without overflow
        else:
            smooth = gl.no_event(gl.sign(self.w)) * (1 - gl.cos(gl.pi * x / 2))
            inside = {"sine": gl.sin(gl.pi * x / 2), "linear": x, "cosine": smooth}[self.reg]
            direction = gl.Piecewise((1, self.w >= self.w0), (-1, self.w <= -self.w0), (inside, True))
        return [gl.Eq(self.tau, self.tau_nominal * direction)]


class EddyCurrentTorque(OneFlange, Dissipative):
    """Eddy current brake after Kloss: ``tau = 2 tau_nominal excitation**2 w_n / (1 + w_n**2)``, ``flange.tau = +tau``.

    ``w_n = w / (w_nominal R)`` with the disc's resistance over that at T_ref, ``R = 1 + alpha (T - T_ref)``, and ``alpha = alpha20 / (1 +
    alpha20 (T_ref - 293.15))``: a hot disc has its peak torque at a higher speed. The temperature is that of the heat port or, without
    one, ``T``. It dissipates ``tau w``. Where the linear law gives a negative resistance, as for copper (0.004/K) below 43 K, runs are
    refused: the brake would drive.
    """

    icon = "eddy_brake"

    tau_nominal = gl.Parameter("N.m", "largest torque; it always brakes", min=0)
    w_nominal = gl.Parameter("rad/s", "speed of the largest torque at T_ref", min=SMALLEST)
    T_ref = gl.Parameter("K", "reference temperature", default=293.15, min=0)
    alpha20 = gl.Parameter("1/K", "temperature coefficient of the disc's resistance at 20 degC", default=0.0)
    T = gl.Parameter("K", "temperature without heat port", default=lambda brake: brake.T_ref, min=0)
    excitation = gl.Input("1", "excitation current over its nominal value", default=1.0)
    w = gl.Variable("rad/s", "speed of the flange relative to the support", state="avoid")
    resistance = gl.Variable("1", "resistance of the disc over that at T_ref", min=0)
    w_normalized = gl.Variable("1", "speed over the speed of the largest torque")
    tau = gl.Variable("N.m", "braking torque")

    def equations(self) -> list[gl.Eq]:
        temperature = self.heat_port.T if self.use_heat_port else self.T
        alpha = self.alpha20 / (1 + self.alpha20 * (self.T_ref - 293.15))
        return [
            gl.Eq(self.w, gl.der(self.angle())),
            gl.Eq(self.resistance, 1 + alpha * (temperature - self.T_ref)),
            gl.Eq(self.w_normalized * self.w_nominal * self.resistance, self.w),
            gl.Eq(self.tau, 2 * self.tau_nominal * self.excitation**2 * self.w_normalized / (1 + self.w_normalized**2)),
            gl.Eq(self.flange.tau, self.tau),
            gl.Eq(self.loss_power, self.tau * self.w),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy(heat=self.loss_power)
