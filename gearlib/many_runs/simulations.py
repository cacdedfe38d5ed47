"""`sweep_runs`: implements `System.sweep`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from gearlib.arguments import by_name
from gearlib.errors import ArgumentError
from gearlib.files.sweep_files import sweep_path
from gearlib.many_runs.execution import check_executor, execute
from gearlib.many_runs.in_lanes import check_lanes
from gearlib.many_runs.runs import Runs
from gearlib.many_runs.samples import as_samples
from gearlib.many_runs.simulating import kind_of, simulating
from gearlib.progress import check_progress
from gearlib.run.simulate import checked_request, warn_of_zero_inputs
from gearlib.run.start_values import start_named
from gearlib.run.translation import Translation


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
    if inputs is not None:
        inputs = by_name("inputs", inputs, "a mapping of paths to numbers, functions of time or tables", "torque.tau")
    if twice := {*given, *first} & {*(inputs or {})}:
        raise ArgumentError(f"the input {twice.pop()} is given in parameters and in inputs; give it once")
    all_inputs = {**(inputs or {}), **given, **first} if inputs is not None or given or first else None
    own, request = checked_request(
        translation, t_end, start={**(start or {}), **starts} if starts else start, inputs=all_inputs, **options
    )  # fmt: skip
    warn_of_zero_inputs(translation, request.zero_inputs, "all runs of this sweep", "sweep")
    common = {**(inputs or {}), **given}
    work = simulating(own, samples, request, fixed, common, outputs, reduce, lanes)
    return execute(work, own.name, samples, executor=executor, threads=threads, to=path, progress=progress)
