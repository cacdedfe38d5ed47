"""`ImportedFmu`: an FMU from any tool, stepped in co-simulation through FMPy."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gearlib.arguments import as_path, by_name, name_list, real
from gearlib.errors import ArgumentError, DeclarationError, FileError, GearlibWarning, NameLookupError, nearest, warn
from gearlib.language.units import BASE, INSTEAD, dimension
from gearlib.optional import optional

TYPES = ("Real", "Float64")
AS_IT_IS = 1.0, 0.0  # factor and offset
PER_SECOND = dimension("1/s")


class ImportedFmu:
    """A co-simulation FMU as a stateful function of time and inputs: each call of a run continues from the previous one.

    Parameters
    ----------
    path : path
        Of the file.
    inputs, outputs : sequence of str
        Names of its variables, in the order of the values passed in and out.
    values : mapping of str to float, optional
        Values of its parameters, and start values.
    units : mapping of str to str, optional
        Units of some of the inputs and outputs. All are passed in SI units, and converted to those that the FMU defines.

    Raises
    ------
    FileError
        The file does not exist, or is not an FMU.
    ArgumentError, NameLookupError
        The FMU does not support co-simulation, lacks the variables, or declares other units for them.
    MissingPackageError
        FMPy is not installed.
    """

    def __init__(
        self, path: str | os.PathLike[str], inputs: Sequence[str], outputs: Sequence[str],
        values: Mapping[str, float] | None = None, units: Mapping[str, str] | None = None,
    ) -> None:  # fmt: skip
        self.path = as_path("FMU", path, "engine.fmu")
        if not self.path.is_file():
            raise FileError(f"{self.path} cannot be read: there is no such file")
        fmpy = optional("fmpy")
        try:
            self._description = fmpy.read_model_description(str(self.path), validate=False)
        except Exception as problem:
            raise FileError(f"{self.path} is not an FMU: {problem}") from None
        if self._description.coSimulation is None or not self._description.fmiVersion.startswith(("2.0", "3.0")):
            raise ArgumentError(
                f"{self.path.name} is not for co-simulation by FMI 2.0 or 3.0; export it as a co-simulation FMU"
            )
        self.inputs, self.outputs = name_list("inputs", inputs, "w"), name_list("outputs", outputs, "tau")
        given = by_name("values", values, "a mapping of names to numbers", "J")
        self.values = {name: real(f"{name} of {self.path.name}", value) for name, value in given.items()}
        self._given = self._references(self.inputs, ("input",))
        self._taken = self._references(self.outputs, ("output", "local", "calculatedParameter"))
        self._set = self._references([*self.values], ("parameter", "structuralParameter", "local", "output", "input"))
        self.units = by_name("units", units, "a mapping of names to units", "w")
        self._given_scales = [self._scale(name) for name in self.inputs]
        self._taken_scales = [self._scale(name) for name in self.outputs]
        if twice := [name for name in self.values if name in self.inputs]:
            raise ArgumentError(
                f"values has {twice[0]}, an input of {self.path.name} that the model gives at each instant; leave it out of one of them"
            )
        self._fmu: Any = None
        self._t: float | None = None  # of the last call
        self._returned = [0.0] * len(self.outputs)

    def _scale(self, name: str) -> tuple[float, float]:
        """Factor and offset from the FMU's numbers of a variable to SI units.

        A variable without a unit is taken as it is, one in an unknown unit with a warning; one that does not fit is refused.
        """
        variable = next(v for v in self._description.modelVariables if v.name == name)
        declared, expected = variable.declaredType, self.units.get(name)
        unit = variable.unit or (declared.unit if declared else None)
        if unit is None:
            return AS_IT_IS
        defined = next((u.baseUnit for u in self._description.unitDefinitions if u.name == unit and u.baseUnit), None)
        said = f"{name} of {self.path.name} is in {unit}"
        scale = AS_IT_IS
        if defined is not None:
            relative = variable.relativeQuantity or (declared is not None and declared.relativeQuantity)
            scale = float(defined.factor), 0.0 if relative else float(defined.offset)
            exponents = tuple(getattr(defined, base) for base in BASE)
            if exponents == PER_SECOND and not defined.rad and scale != AS_IT_IS:
                raise ArgumentError(
                    f"{said}; expected {expected or 'rad/s or Hz'}: its definition does not tell turns from radians per second"
                )
            same = expected is None or exponents == dimension(expected)
        elif expected is not None and unit in INSTEAD:
            same = INSTEAD[unit] == (expected, f"1 {expected}")
        else:
            try:
                same = dimension(unit) == dimension(expected or unit)
            except DeclarationError:
                same = unit in INSTEAD and INSTEAD[unit][1] == f"1 {INSTEAD[unit][0]}"
                if not same:
                    how = f"as {expected}" if expected else "as it is"
                    warn(f"{said}, which the file does not define; it is taken {how}", GearlibWarning)
                return AS_IT_IS
        if not same or (unit == "Hz" and expected not in (None, unit)):  # a turn has no dimension either
            raise ArgumentError(f"{said}; expected {expected}")
        return scale

    def _references(self, names: Sequence[str], causalities: Sequence[str]) -> list[int]:
        """Value references of variables by name."""
        known = {
            v.name: v
            for v in self._description.modelVariables
            if v.type in TYPES and v.causality in causalities and not v.dimensions
        }
        for name in names:
            if name not in known:
                raise NameLookupError(
                    f"{self.path.name} has no {causalities[0]} '{name}' that is a number; {nearest(name, [*known])}"
                )
        return [known[name].valueReference for name in names]

    def begin_run(self, t: float, held: Sequence[float] | None) -> None:
        """A new run restarts the FMU; one that goes on, with the outputs ``held``, must be the one that it is in."""
        if held is None:
            self._t, self._returned = None, [0.0] * len(self.outputs)
        elif [*held] != self._returned or (self._t is not None and t < self._t):
            raise ArgumentError(
                f"a run goes on at {t:g} s, and {self.path.name} is in another run, or later, and cannot be set back"
            )

    def __call__(self, t: float, values: Sequence[float]) -> list[float]:
        """Outputs at a time (s), with the inputs of the previous call held up to now; ``values`` are the inputs from now on."""
        if self._t is None:
            self._begin(t, values)
        else:
            done = self._fmu.doStep(currentCommunicationPoint=self._t, communicationStepSize=t - self._t)
            if not self._is_fmi2 and done[1]:
                raise ArgumentError(f"{self.path.name} ended the simulation at {t:g} s")
            self._give(values)
        taken = zip(self._get(self._taken), self._taken_scales, strict=True)
        self._t, self._returned = t, [factor * float(v) + offset for v, (factor, offset) in taken]
        return self._returned

    def _give(self, values: Sequence[float]) -> None:
        scaled = zip(values, self._given_scales, strict=True)
        self._put(self._given, [(float(v) - offset) / factor for v, (factor, offset) in scaled])

    def _put(self, references: Sequence[int], values: Sequence[float]) -> None:
        if references:
            put = self._fmu.setReal if self._is_fmi2 else self._fmu.setFloat64
            put(list(references), [float(v) for v in values])

    def _get(self, references: Sequence[int]) -> Any:
        return (self._fmu.getReal if self._is_fmi2 else self._fmu.getFloat64)(list(references))

    @property
    def _is_fmi2(self) -> bool:
        return bool(self._description.fmiVersion.startswith("2.0"))

    def _begin(self, t: float, values: Sequence[float]) -> None:
        if self._fmu is None:
            self._fmu = self._instance()
        else:
            self._fmu.reset()
        self._put(self._set, [*self.values.values()])
        self._give(values)
        if self._is_fmi2:
            self._fmu.setupExperiment(startTime=t)
            self._fmu.enterInitializationMode()
        else:
            self._fmu.enterInitializationMode(startTime=t)
        self._fmu.exitInitializationMode()

    def _instance(self) -> Any:
        fmpy, module = optional("fmpy"), optional("fmpy.fmi2" if self._is_fmi2 else "fmpy.fmi3")
        folder = tempfile.mkdtemp(prefix="gearlib-fmu-")
        fmpy.extract(str(self.path), folder)
        made = (module.FMU2Slave if self._is_fmi2 else module.FMU3Slave)(
            guid=self._description.guid, unzipDirectory=folder, instanceName=Path(self.path).stem,
            modelIdentifier=self._description.coSimulation.modelIdentifier,
        )  # fmt: skip
        made.instantiate()
        weakref.finalize(self, _freed, made, folder)
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return ImportedFmu, (self.path, self.inputs, self.outputs, self.values, self.units)


def _freed(fmu: Any, folder: str) -> None:
    """Free an instance with its unpacked files."""
    try:
        fmu.terminate()
        fmu.freeInstance()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
