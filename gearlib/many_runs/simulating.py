"""`Simulating`: simulations as the work of a sweep: output histories, and reduced quantities of each run. `sweep_runs` performs them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, name_list, real
from gearlib.compiler.instructions import LANES
from gearlib.errors import ArgumentError, GearlibError, NameLookupError, nearest
from gearlib.files.sweep_files import sweep_path
from gearlib.many_runs.by_exponentials import ExactSweep, why_not_by_exponentials
from gearlib.many_runs.execution import check_executor, execute
from gearlib.many_runs.identity import of_functions, of_model, of_values
from gearlib.many_runs.in_lanes import LaneSweep, check_lanes, most_steps, why_not_in_lanes
from gearlib.many_runs.reductions import Reduction
from gearlib.many_runs.runs import Runs
from gearlib.many_runs.samples import Samples, as_samples, rows
from gearlib.many_runs.side_by_side import KeptStates, SideBySide
from gearlib.many_runs.work import ManyRows, Row, Work, check_names, reduced
from gearlib.progress import check_progress
from gearlib.run.methods.run import is_function
from gearlib.run.request import Request
from gearlib.run.result import SimulatedResult
from gearlib.run.sampling.controllers import Controller
from gearlib.run.simulate import checked_request, earlier_run, kept_values, run, warn_of_zero_inputs
from gearlib.run.start_values import start_named, start_variable
from gearlib.run.translation import Translation

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
TIME = "time"
_turn = threading.RLock()  # of runs that call Python functions, which may keep a state from one instant of a run to the next


@dataclass(frozen=True, eq=False)
class Simulating(Work):
    """Simulations of a translation.

    Attributes
    ----------
    translation : Translation
    request : Request
        Request of a run without variation.
    outputs : tuple of str
        Variables whose histories are kept.
    reduce : mapping of str to callable
        Functions applied to each result.
    parameters, inputs : mapping
        Values common to all runs, by path.
    together_by : SideBySide or str
        What carries runs out side by side, or why they are carried out one after another.
    """

    translation: Translation
    request: Request
    outputs: tuple[str, ...]
    reduce: Mapping[str, Callable[[Any], Any]]
    parameters: Mapping[str, float]
    inputs: Mapping[str, Any]
    together_by: SideBySide | str

    def row(self, given: Mapping[str, Any]) -> Row:
        request, own, coordinates = self.request, self.translation, self._coordinates
        parameters, start, inputs = self._by_kind(given)
        values = {**self.parameters, **parameters}
        translation, numbers = own.fitted(values)
        changed: dict[str, Any] = {"parameters": numbers, "given": tuple(values)}
        if start:
            changed["start"] = {**(request.start or {}), **start}
        if inputs:
            changed["signals"] = tuple(translation.input_signals({**self.inputs, **inputs}))
        with _turn if any(isinstance(c, Controller) for c in own.controllers) else nullcontext():
            result = run(translation, replace(request, **changed))
        return Row({name: result[name] for name in self.outputs} | reduced(self.reduce, result), coordinates)

    def together(
        self, part: Mapping[str, Any], count: int
    ) -> Iterator[tuple[int, Row | GearlibError] | tuple[Integers, ManyRows]]:
        engine = self.together_by
        if isinstance(engine, str):
            yield from super().together(part, count)
            return
        coordinates, given = self._coordinates, list(rows(part, count))
        of_states = {name: (self.translation.scene.named(name)[1], engine.column(name)) for name in self._histories_of}
        for found in engine.results(*self._by_kind(part), count):
            if isinstance(found, KeptStates):
                histories = {name: sign * found.states[:, :, k] for name, (sign, k) in of_states.items()}
                values = {name: histories[name] for name in self.outputs}
                values |= {name: f.of(histories[f.name]) for name, f in self.reduce.items() if isinstance(f, Reduction)}
                yield found.runs, ManyRows(values, coordinates)
                continue
            i, result = found
            yield i, self.attempted(given[i]) if result is None else self._reduced(result)

    @property
    def _histories_of(self) -> tuple[str, ...]:
        """The variables whose histories are kept, or reduced by a `Reduction`."""
        return (*self.outputs, *(f.name for f in self.reduce.values() if isinstance(f, Reduction)))

    def _reduced(self, result: SimulatedResult) -> Row | GearlibError:
        try:
            return Row({name: result[name] for name in self.outputs} | reduced(self.reduce, result), self._coordinates)
        except GearlibError as problem:
            return problem

    @property
    def statistics(self) -> Mapping[str, Any]:
        engine = self.together_by
        return {"lanes": 1, "why": engine} if isinstance(engine, str) else engine.statistics

    def _by_kind(self, given: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        """Parameters, start values by the path of the variable, and inputs."""
        parameters: dict[str, Any] = {}
        start: dict[str, Any] = {}
        inputs: dict[str, Any] = {}
        for name, value in given.items():
            kind = self._kinds.get(name) or self._kinds.setdefault(name, kind_of(self.translation, name))
            if kind == "parameter":
                parameters[name] = value
            elif kind == "start":
                start[start_named(name) or name] = value
            else:
                inputs[name] = value
        return parameters, start, inputs

    @cached_property
    def _kinds(self) -> dict[str, str]:
        return {}

    @cached_property
    def _coordinates(self) -> dict[str, Any]:
        """The output times; also prepares one joint program for the outputs that the states of a run determine."""
        scene = self.translation.scene
        names = [name for name in self.outputs if name not in scene.model.discretes]
        scene.compute_together([node for node, sign in map(scene.named, names) if sign and not scene.missing(node)])
        return {TIME: self.request.times} if self.outputs else {}

    def dimensions(self, name: str) -> tuple[str, ...]:
        return (TIME,) if name in self.outputs else ()

    def unit(self, name: str) -> str:
        return self.translation.unit(name) if name in self.outputs else ""

    def varied_unit(self, name: str) -> str:
        own = self.translation
        return own.parameter_units.get(name, "") if kind_of(own, name) == "parameter" else own.unit(start_named(name) or name)

    def identity(self) -> Iterator[bytes]:
        request = self.request
        yield from of_model(self.translation)
        yield repr((request.t_start, request.method, request.rtol, request.max_step, self.outputs)).encode()
        yield from of_values([request.times, request.atol, request.parameters, request.start, list(request.signals)])
        yield from of_functions(self.reduce)


def sweep_runs(
    translation: Translation, parameters: Any, t_end: float, *, names: Sequence[str] | None, outputs: Sequence[str] | None,
    reduce: Mapping[str, Callable[[Any], Any]] | None, executor: Any, threads: int | None, to: Any, progress: Any, lanes: Any,
    start: Any, inputs: Mapping[str, Any] | None, **options: Any,
) -> Runs:  # fmt: skip
    """Perform a sweep of simulations; arguments as for `System.sweep`."""
    samples = as_samples(parameters, names)
    check_executor(executor, threads)
    check_progress(progress)
    check_lanes(lanes)
    path = None if to is None else sweep_path(to)
    kinds = {name: kind_of(translation, name) for name in samples.names}
    fixed = {name: value for name, value in samples.fixed.items() if kinds[name] == "parameter"}
    given = {name: value for name, value in samples.fixed.items() if kinds[name] == "input"}
    first = {name: samples.columns[name][0] for name in samples.columns if kinds[name] == "input"}
    starts = {start_named(name) or name: value for name, value in samples.fixed.items() if kinds[name] == "start"}
    if starts and not (start is None or isinstance(start, Mapping)):
        raise ArgumentError(f"parameters give {next(iter(starts))} a start value, and start={start!r:.60} gives all of them")
    varied = {start_named(name) or name for name, kind in kinds.items() if kind == "start"}
    if isinstance(start, Mapping) and (twice := varied & {*start}):
        raise ArgumentError(f"the start value of {min(twice)} is given in parameters and in start; give it once")
    if inputs is not None:
        inputs = by_name("inputs", inputs, "a mapping of paths to numbers, functions of time or tables", "torque.tau")
    if twice := {*given, *first} & {*(inputs or {})}:
        raise ArgumentError(f"the input {twice.pop()} is given in parameters and in inputs; give it once")
    if earlier := earlier_run(translation, start):
        fixed, inputs = kept_values(earlier[0], fixed, inputs)
    all_inputs = {**(inputs or {}), **given, **first} if inputs is not None or given or first else None
    own, request = checked_request(
        translation, t_end, start={**(start or {}), **starts} if starts else start, inputs=all_inputs, **options
    )  # fmt: skip
    warn_of_zero_inputs(translation, request.zero_inputs, "all runs of this sweep", "sweep")
    common = {**(inputs or {}), **given}
    work = simulating(own, samples, request, fixed, common, outputs, reduce, lanes)
    return execute(work, own.name, samples, executor=executor, threads=threads, to=path, progress=progress)


def simulating(
    translation: Translation, samples: Samples, request: Request, parameters: Mapping[str, float], inputs: Mapping[str, Any] | None,
    outputs: Sequence[str] | None, reduce: Mapping[str, Callable[[Any], Any]] | None, lanes: int | str = "auto",
) -> Simulating:  # fmt: skip
    """The work of a sweep of simulations, with validated names.

    Raises
    ------
    ArgumentError, NameLookupError
        Unknown parameter, start value, input or output, or one that cannot be varied.
    """
    functions = functions_of(reduce)
    if outputs is not None:
        chosen = tuple(dict.fromkeys(name_list("outputs", outputs, "load.w")))
    elif functions:
        chosen = ()
    else:
        chosen = translation.states if translation.outputs is None else translation.outputs
    if not chosen and not functions:
        raise ArgumentError("outputs is empty, and so is reduce: nothing would be kept of the runs")
    for name in chosen:
        check_output(translation, name)
    for name in samples.names:
        kind = kind_of(translation, name)
        if kind == "start" and request.start is not None and not isinstance(request.start, Mapping):
            raise ArgumentError(f"parameters: {name} varies, but start={request.start!r:.60} fixes all start values")
        if kind != "input":
            values = samples.columns.get(name, samples.fixed.get(name))
            for value in [values] if name in samples.fixed else values if isinstance(values, tuple) else []:
                real(f"parameters['{name}']", value)
    check_names(samples, [*chosen, *functions], [TIME] if chosen else [])
    if both := set(chosen) & set(functions):
        raise ArgumentError(
            f"{both.pop()} is the name of an output and of a function in reduce; give the function another name"
        )
    given = dict(parameters), dict(inputs or {})
    found = _side_by_side(translation, samples, request, *given, chosen, functions, lanes) if lanes != 1 else "asked for"
    if lanes == LANES and isinstance(found, str):
        raise ArgumentError(f"lanes is {LANES}, but these runs cannot be carried out so: {found}; leave it at 'auto'")
    return Simulating(translation, request, chosen, functions, *given, found)


def _side_by_side(
    translation: Translation, samples: Samples, request: Request, parameters: Mapping[str, float], inputs: Mapping[str, Any],
    outputs: Sequence[str], reduce: Mapping[str, Callable[[Any], Any]], lanes: int | str,
) -> SideBySide | str:  # fmt: skip
    """The simulations of many runs at a time, or the reason why the runs are performed one after another."""
    if len(samples) < LANES:
        return f"there are fewer than {LANES} runs"
    own = [signal for column in samples.columns.values() if isinstance(column, tuple) for signal in column]
    if any(map(is_function, own)):
        return "inputs are functions of time"
    request = replace(request, parameters=first_parameters(translation, samples, request, parameters))
    no_lanes = why_not_in_lanes(translation, request)
    no_exponentials = why_not_by_exponentials(translation, request) if lanes == "auto" else "lanes are asked for"
    no_exponentials = "each run has a table of its own" if own else no_exponentials
    if no_lanes and no_exponentials:
        return no_lanes
    scene = translation.scene
    reductions = [f for f in reduce.values() if isinstance(f, Reduction)]
    named = [scene.named(name) for name in (*outputs, *(f.name for f in reductions))]
    if any(sign and scene.missing(node) for node, sign in named):
        return "an output needs more states than the system was compiled for; name it in gl.compile(..., outputs=[...])"
    whole = len(reductions) < len(reduce) or not all(node in scene.place_of for node, _ in named)
    kept = () if whole else tuple(dict.fromkeys(scene.place_of[node] for node, _ in named))
    last = not whole and not outputs and not any(f.of_magnitude for f in reductions)
    given = translation, request, parameters, inputs, whole, kept, last
    exact = ExactSweep(*given)
    if not no_exponentials and exact.why_not() is None:
        return exact
    most = no_lanes or most_steps(exact)
    return most if isinstance(most, str) else LaneSweep(*given, most)


def first_parameters(translation: Translation, samples: Samples, request: Request, fixed: Mapping[str, float]) -> Floats:
    """The parameters of the first run, or those that all runs start from where it needs another translation."""
    names = [name for name in samples.columns if kind_of(translation, name) == "parameter"]
    try:
        own, numbers = translation.fitted({**fixed, **{name: float(samples.columns[name][0]) for name in names}})
    except GearlibError:
        return request.parameters
    return numbers if own is translation else request.parameters


def functions_of(reduce: Any) -> dict[str, Callable[[Any], Any]]:
    """The reducing functions, by name."""
    found = by_name(
        "reduce", reduce, "functions of a result by name, such as {'peak': lambda r: abs(r['load.w']).max()}", "peak"
    )
    for name, function in found.items():
        if not callable(function):
            raise ArgumentError(f"reduce['{name}'] is {function!r:.60}; expected a function of a result")
    return found


def check_output(translation: Translation, name: str) -> None:
    """Raise `NameLookupError` for an unknown variable."""
    if name not in translation.model.discretes:
        translation.scene.named(name)


def kind_of(translation: Translation, name: str) -> str:
    """Kind of a name: parameter, input, or ``start(load.w)`` for a start value.

    Raises
    ------
    NameLookupError
        It is none of these.
    """
    model = translation.model
    if (inner := start_named(name)) is not None:
        if inner not in model.discretes:
            start_variable(model, inner)
        return "start"
    if name in translation.open_inputs:
        return "input"
    if name not in model.parameters.index:
        valid = [*model.parameters.own_names, *translation.open_inputs]
        raise NameLookupError(
            f"the model has no parameter '{name}'; {nearest(name, valid)}. An input is named by its path, a "
            "start value as 'start(load.w)'"
        )
    return "parameter"
