"""An instance of an FMU of version 3.0 that a test sets, gets and steps by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi3 import FMU3Model, FMU3Slave


class FmuInstance:
    """An instance; ``t`` is where it is, ``moving`` gives inputs within steps of co-simulation."""

    def __init__(
        self, path: Path, folder: Path, kind: str = "cs", moving: dict[str, Callable[[float], float]] | None = None
    ) -> None:
        self.description = fmpy.read_model_description(str(path))
        if not (folder / "modelDescription.xml").exists():
            fmpy.extract(str(path), str(folder))
        made, which = {
            "cs": (FMU3Slave, self.description.coSimulation), "me": (FMU3Model, self.description.modelExchange),
        }[kind]  # fmt: skip
        self.fmu = made(
            guid=self.description.guid, unzipDirectory=str(folder), modelIdentifier=which.modelIdentifier, instanceName="one"
        )
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.messages: list[str] = []
        callback = fmpy.fmi3.fmi3LogMessageCallback(
            lambda environment, status, category, text: self.messages.append(text.decode())
        )
        self.moving = moving or {}
        more: dict[str, Any] = {}
        if self.moving:
            required = [self.references[name] for name in self.moving]
            more = {"intermediateUpdate": self._update, "requiredIntermediateVariables": required, "loggingOn": True}
        self.fmu.instantiate(logMessage=callback, **more)
        self.t = 0.0

    def _update(self, environment: Any, t: float, set_requested: bool, *others: Any) -> None:
        if set_requested:
            try:
                self.set({name: function(t) for name, function in self.moving.items()})
            except fmpy.fmi1.FMICallException:
                return  # told in a message

    def begin(self, tolerance: float = 1e-10, **values: float) -> None:
        self.set(values)
        self.fmu.enterInitializationMode(tolerance=tolerance, startTime=0.0, stopTime=1.0)
        self.fmu.exitInitializationMode()

    def set(self, values: dict[str, float]) -> None:
        for name, value in values.items():
            self.fmu.setFloat64([self.references[name]], [value])

    def get(self, *names: str) -> list[float]:
        return list(self.fmu.getFloat64([self.references[n] for n in names]))

    def go(self, t: float, steps: int = 1) -> None:
        for _ in range(steps):
            self.fmu.doStep(currentCommunicationPoint=self.t, communicationStepSize=t / steps)
            self.t += t / steps

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
