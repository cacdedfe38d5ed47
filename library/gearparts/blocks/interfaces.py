"""Base classes of signal blocks, with inputs and outputs of any unit and without power."""

from __future__ import annotations

import gearlib as gl

SHORTEST = 1e-60  # s: smallest time constant in a denominator, like Modelica.Constants.small


class Block(gl.Component):
    """Base of signal blocks, which carry no power."""

    def energies(self) -> gl.Energy:
        return gl.Energy()


class SO(Block):
    """Base of blocks with one output."""

    y = gl.Variable("any", "output signal")


class SISO(SO):
    """Base of blocks with one input and one output."""

    u = gl.Input("any", "input signal")


class SI2SO(SO):
    """Base of blocks with two inputs and one output."""

    u1 = gl.Input("any", "first input signal")
    u2 = gl.Input("any", "second input signal")


class SignalSource(SO):
    """Base of sources: a function of time that begins at ``start_time``, plus an offset."""

    offset = gl.Parameter("any", "added to the signal, also before it begins", default=0.0)
    start_time = gl.Parameter("s", "time at which the signal begins", default=0.0)
