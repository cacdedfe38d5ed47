"""`sweep`: repeats an analysis for many parameter sets: modes, margins, responses, power flow, harmonic balance."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearlib.arguments import shown
from gearlib.errors import ArgumentError, GearlibError
from gearlib.feedback.stability import StabilityReport
from gearlib.files.sweep_files import sweep_path
from gearlib.linear.frequency_response import FrequencyResponse
from gearlib.linear.steady_state import SteadyState
from gearlib.many_runs.execution import check_executor, execute
from gearlib.many_runs.identity import of_function, of_functions, of_model, of_values
from gearlib.many_runs.runs import Runs
from gearlib.many_runs.samples import Samples, as_samples
from gearlib.many_runs.simulating import functions_of
from gearlib.many_runs.tracking import followed
from gearlib.many_runs.work import Row, Values, Work, check_names, reduced
from gearlib.periodic.harmonic_response import HarmonicBalance
from gearlib.progress import check_progress
from gearlib.run.subject import translation_of
from gearlib.run.translation import Compiled
from gearlib.statics.power_flow import PowerFlow
from gearlib.vibration.modes import Modes

EIGENVALUES, SHAPES = "eigenvalues", "shapes"
OF_MODES = "frequencies", "damping", EIGENVALUES, "number"
DIMENSIONS = {
    EIGENVALUES: ("mode",), SHAPES: ("state", "mode"), "response": ("output", "input", "omega"), "speed": ("flange",),
    "torque": ("flange",), "power": ("flange",), "peak": ("output",), "peak_omega": ("output",),
}  # fmt: skip
UNITS = {
    "frequencies": "Hz", EIGENVALUES: "1/s", "growth": "1/s", "phase_margin": "deg", "delay_margin": "s", "efficiency": "1",
    "input_power": "W", "circulating_power": "W", "power": "W", "peak_omega": "rad/s",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Analysing(Work):
    """An analysis of a system as the work of a sweep.

    Attributes
    ----------
    analysis : callable
    system : System
    options : mapping
        Further arguments of the analysis.
    reduce : mapping of str to callable
        Quantities to keep of each result; empty for the defaults of `kept`.
    """

    analysis: Callable[..., Any]
    system: Compiled
    options: Mapping[str, Any]
    reduce: Mapping[str, Callable[[Any], Any]]

    def row(self, given: Mapping[str, Any]) -> Row:
        fixed = self.options.get("parameters") or {}
        try:
            result = self.analysis(self.system, **{**self.options, "parameters": {**fixed, **given}})
        except (GearlibError, KeyboardInterrupt):
            raise
        except Exception as problem:
            raise ArgumentError(f"analysis raised {type(problem).__name__}: {problem}") from problem
        return Row(reduced(self.reduce, result)) if self.reduce else kept(result)

    @property
    def reshapes(self) -> bool:
        return not self.reduce

    def dimensions(self, name: str) -> tuple[str, ...]:
        return () if self.reduce else DIMENSIONS.get(name, ())

    def unit(self, name: str) -> str:
        translation = self.system.translation
        if self.reduce or name in UNITS or translation.model.find(translation.model.column(name)[0]) is None:
            return "" if self.reduce else UNITS.get(name, "")
        return translation.unit(name)

    def varied_unit(self, name: str) -> str:
        return self.system.translation.parameter_units.get(name, "")

    def presented(self, names: Iterable[str]) -> Iterable[str]:
        return OF_MODES if SHAPES in names else names

    def finished(self, samples: Samples, values: Values) -> tuple[Values, Mapping[str, tuple[str, ...]]]:
        """Track modes, so that each keeps its own column."""
        if SHAPES not in values:
            return values, {name: self.dimensions(name) for name in values}
        branches = followed(samples, values[EIGENVALUES], values[SHAPES])
        size = np.abs(branches.eigenvalues)
        damping = (0.0 - branches.eigenvalues.real) / size  # NaN where a branch has no mode
        found = size / (2 * np.pi), damping, branches.eigenvalues, branches.numbers
        return dict(zip(OF_MODES, found, strict=True)), dict.fromkeys(OF_MODES, ("mode",))

    def identity(self) -> Iterator[bytes]:
        yield from of_model(self.system.translation)
        yield from of_function(self.analysis)
        yield from of_values(dict(self.options))
        yield from of_functions(self.reduce)


def kept(result: Any) -> Row:
    """Quantities kept of an analysis by default.

    Raises
    ------
    ArgumentError
        There are no defaults for such a result.
    """
    if isinstance(result, Modes):
        n, shapes = len(result.states), result.shapes[:, result.free :]
        room = [(0, 0), (0, n - shapes.shape[1])]  # in other runs, a mode may be overdamped
        values = np.pad(result.eigenvalues[result.free :].astype(complex), room[1], constant_values=np.nan)
        return Row({EIGENVALUES: values, SHAPES: np.pad(shapes.astype(complex), room, constant_values=np.nan)})
    if isinstance(result, StabilityReport):
        values, ratios = result.eigenvalues, result.damping[result.eigenvalues.imag != 0.0]
        found = {"growth": values.real.max(initial=-np.inf), "least_damping": ratios.min(initial=np.inf)}
        if result.loop is not None:
            m = result.loop.margins
            found |= {name: getattr(m, name) for name in ("gain_margin", "phase_margin", "delay_margin", "modulus_margin")}
            found["closed_growth"] = result.loop.closed_poles.values.real.max(initial=-np.inf)
        return Row({name: float(value) for name, value in found.items()})
    if isinstance(result, FrequencyResponse):
        return Row({"response": result.values}, {"output": result.outputs, "input": result.inputs, "omega": result.omega})
    if isinstance(result, PowerFlow):
        columns = {name: [getattr(f, name) for f in result.flanges] for name in ("speed", "torque", "power")}
        scalars = {name: getattr(result, name) for name in ("efficiency", "input_power", "circulating_power")}
        return Row(columns | scalars, {"flange": tuple(f.name for f in result.flanges)})
    if isinstance(result, SteadyState):
        return Row({name: float(value) for name, value in zip(result.names, result.values, strict=True)})
    if isinstance(result, HarmonicBalance):
        sizes = np.array([result.amplitude(name) for name in result.outputs])
        top = {"peak": sizes.max(axis=1), "peak_omega": result.omega[sizes.argmax(axis=1)], "folds": float(len(result.folds))}
        return Row(top | {"all_stable": float(result.stable.all())}, {"output": result.outputs})
    raise ArgumentError(
        f"analysis returned a {type(result).__name__}; say what is to be kept of it: reduce={{'name': function}}"
    )


def sweep(
    analysis: Callable[..., Any], system: Compiled, parameters: Any, *, names: Sequence[str] | None = None,
    reduce: Mapping[str, Callable[[Any], Any]] | None = None, executor: Any = None, threads: int | None = None, to: Any = None,
    progress: Any = False, **options: Any,
) -> Runs:  # fmt: skip
    """Repeat an analysis of a system with varying parameters; for simulations use `System.sweep`.

    Parameters
    ----------
    analysis : callable
        `modes`, `stability`, `steady_state`, `frequency_response`, `power_flow`, `harmonic_balance`, or any function of a system that
        accepts ``parameters=``.
    system : System
    parameters : mapping, Grid, DataFrame or array
        Varied values, as for `System.sweep`: parameters by path.
    names, executor, threads, to, progress
        As for `System.sweep`.
    reduce : mapping of str to callable, optional
        Quantities to keep of each result: functions that return a number or an array. By default: for modes the ``frequencies`` (Hz),
        ``damping`` and ``eigenvalues``, each mode tracked by the similarity of its shape so that it keeps its column, and its
        ``number`` among the oscillating modes of the run; for stability the ``growth`` of the fastest growing motion (1/s), the
        ``least_damping`` and, for a loop, its margins; for a frequency response the complex ``response``; for power flow ``speed``,
        ``torque`` and ``power`` at each flange and the ``efficiency``; for harmonic balance the ``peak`` amplitude of each output, its
        frequency (``peak_omega``), and the number of ``folds``; for steady states the variables by path.
    **options
        Further arguments of the analysis.

    Returns
    -------
    Runs

    Raises
    ------
    ArgumentError, NameLookupError, FileError
        The message names what was found and what was expected.
    GearlibError
        Every run failed: the error of the first one.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Rotor(gl.Component):
    ...     def assemble(self):
    ...         self.ground, self.shaft, self.disc = gp.Fixed(), gp.Spring(c=400.0), gp.Inertia(J=1.0)
    ...         return [gl.connect(self.ground.flange, self.shaft.flange_a), gl.connect(self.shaft.flange_b, self.disc.flange_a)]
    >>> runs = gl.sweep(gl.modes, gl.compile(Rotor()), {"shaft.c": [100.0, 400.0]})
    >>> 2 * np.pi * runs["frequencies"][:, 0]
    array([10., 20.])
    """
    translation = translation_of(system)
    if not callable(analysis):
        raise ArgumentError(f"analysis is {shown(analysis)}; expected a function of a system, such as gl.modes")
    samples, functions = as_samples(parameters, names), functions_of(reduce)
    check_names(samples, functions, ())
    for name in samples.names:
        translation.model.parameters.number(name)
        if name not in samples.numbers and not isinstance(samples.fixed.get(name), float):
            raise ArgumentError(
                f"parameters['{name}'] holds what is not a number; a parameter of an analysis is a number in each run"
            )
    check_executor(executor, threads)
    check_progress(progress)
    path = None if to is None else sweep_path(to)
    work = Analysing(analysis, system, {**options, "parameters": dict(samples.fixed)}, functions)
    return execute(work, translation.name, samples, executor=executor, threads=threads, to=path, progress=progress)
