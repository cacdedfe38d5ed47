"""An FMU from another tool at a shaft: an engine, a motor with its controls, a load."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import gearlib as gl
from gearlib.arguments import name_list, one_name, real
from gearlib.errors import ArgumentError
from gearlib.fmi.imported_fmu import ImportedFmu
from gearparts.blocks.continuous import Gain
from gearparts.interfaces import Flange
from gearparts.rotational.sensors import SpeedSensor
from gearparts.rotational.sources import Torque


class FMU(gl.Component):
    """Co-simulation FMU that receives a shaft's speed and returns its torque: ``flange.tau = -torque``, held between steps.

    At the instants ``k * period`` the FMU receives the speed, performs a step with its previous inputs, and returns a torque, which is
    held up to the next instant: the coupling error is proportional to the period. A positive torque accelerates the shaft. It needs the
    extra ``gearlib[fmu]`` (FMPy).

    Parameters
    ----------
    path : path
        Path of the file, FMI 2.0 or 3.0.
    speed, torque : str
        Names of the FMU's input and output; other units than rad/s and N.m are converted by the definitions in the file.
    inputs, outputs : sequence of str
        Further inputs and outputs, in SI units as well: input k is ``signals[k].u``, to be connected or given in
        ``simulate(inputs=...)``; output k is ``taken[k].y``.
    values : mapping of str to float, optional
        Parameter and start values of the FMU, in its own units.
    period : float
        Communication step size, s.

    Examples
    --------
    ::

        class Car(gl.Component):
            def assemble(self):
                self.engine = gp.FMU("engine.fmu", speed="w", torque="tau", inputs=["throttle"], period=1e-3)
                self.flywheel = gp.Inertia(J=0.2)
                return [gl.connect(self.engine.flange, self.flywheel.flange_a)]
    """

    icon = "torque"

    flange = Flange("shaft that it turns")

    def __init__(
        self, path: str | os.PathLike[str] = "", *, speed: str = "w", torque: str = "tau", inputs: Sequence[str] = (),
        outputs: Sequence[str] = (), values: Mapping[str, float] | None = None, period: float = 1e-3,
    ) -> None:  # fmt: skip
        super().__init__()
        further, others = name_list("inputs", inputs, "throttle"), name_list("outputs", outputs, "power")
        units = {one_name("speed", speed, "w"): "rad/s", one_name("torque", torque, "tau"): "N.m"}
        self.unit = ImportedFmu(path, [speed, *further], [torque, *others], values, units)
        self.period = real("period", period, "a positive number of seconds")
        if not self.period > 0.0:
            raise ArgumentError(f"period is {self.period:g}; expected a positive number of seconds")

    def assemble(self) -> list[Any]:
        self.sensor, self.source = SpeedSensor(), Torque()
        self.signals = [Gain(k=1.0) for _ in self.unit.inputs[1:]]
        self.taken = [Gain(k=1.0) for _ in self.unit.outputs[1:]]
        self.exchange = gl.Sampled(
            self.unit, self.period, inputs=[self.sensor.w, *(signal.y for signal in self.signals)],
            outputs=[self.source.tau, *(signal.u for signal in self.taken)],
        )  # fmt: skip
        return [gl.connect(self.flange, self.sensor.flange, self.source.flange)]
