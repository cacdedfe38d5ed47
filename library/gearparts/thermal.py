"""Thermal elements: heat capacitor, conductor, convection, ambient temperature."""

from __future__ import annotations

import gearlib as gl
from gearparts.interfaces import HeatPort


class HeatCapacitor(gl.Component):
    """Heat capacity of uniform temperature: ``C der(T) = port.Q_flow``."""

    icon = "heat_capacity"

    port = HeatPort("the body")
    C = gl.Parameter("J/K", "heat capacity", min=0)
    T = gl.Variable("K", "temperature", state="prefer", nominal=300.0, guess=293.15)
    der_T = gl.Derivative("T", "K/s", "rate of the temperature")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.T, self.port.T), gl.Eq(self.C * gl.der(self.T), self.port.Q_flow)]

    def energies(self) -> gl.Energy:
        return gl.Energy(stored=self.C * self.T)


class ThermalConductor(gl.Component):
    """Heat conduction without storage: ``Q_flow = G (port_a.T - port_b.T)``."""

    icon = "heat_resistance"

    port_a = HeatPort("one end")
    port_b = HeatPort("the other end")
    G = gl.Parameter("W/K", "thermal conductance", min=0)
    Q_flow = gl.Variable("W", "heat flow from port_a to port_b")
    dT = gl.Variable("K", "port_a.T - port_b.T")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.dT, self.port_a.T - self.port_b.T),
            gl.Eq(self.Q_flow, self.G * self.dT),
            gl.Eq(self.port_a.Q_flow, self.Q_flow),
            gl.Eq(self.port_b.Q_flow, -self.Q_flow),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class Convection(gl.Component):
    """Heat transfer from a solid to a fluid: ``Q_flow = Gc (solid.T - fluid.T)`` with a conductance that may vary."""

    icon = "convection"

    solid = HeatPort("surface of the solid")
    fluid = HeatPort("fluid")
    Gc = gl.Input("W/K", "thermal conductance of the convection")
    Q_flow = gl.Variable("W", "heat flow from the solid to the fluid")
    dT = gl.Variable("K", "solid.T - fluid.T")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.dT, self.solid.T - self.fluid.T),
            gl.Eq(self.Q_flow, self.Gc * self.dT),
            gl.Eq(self.solid.Q_flow, self.Q_flow),
            gl.Eq(self.fluid.Q_flow, -self.Q_flow),
        ]

    def energies(self) -> gl.Energy:
        return gl.Energy()


class FixedTemperature(gl.Component):
    """Surroundings of constant temperature: ``port.T = T``."""

    icon = "temperature"

    port = HeatPort("the surroundings")
    T = gl.Parameter("K", "temperature", min=0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.port.T, self.T)]

    def energies(self) -> gl.Energy:
        return gl.Energy(heat=self.port.Q_flow)
