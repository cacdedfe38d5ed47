"""`run`: execute a request on a translation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import by_name, one_of, real
from gearlib.errors import ArgumentError, GearlibWarning, InputWarning, warn
from gearlib.progress import RunProgress, check_progress, reporting
from gearlib.records import altered
from gearlib.reduce.coefficients import some
from gearlib.run.methods.method import Method
from gearlib.run.methods.method_table import integrate, method_of
from gearlib.run.methods.native_problem import begun_at_instants
from gearlib.run.methods.run import Run
from gearlib.run.refusals.accumulation import warn_of_accumulation
from gearlib.run.refusals.limits import refuse_start, refuse_too_small, warn_of_unchecked
from gearlib.run.request import Request, absolute_tolerance, check_form, check_options, output_times
from gearlib.run.result import Result, SimulatedResult
from gearlib.run.scene import Scene
from gearlib.run.segment import Segment
from gearlib.run.start_values import Start
from gearlib.run.state_switching import integrate_through
from gearlib.run.tangents.requested import CONTINUED, directions, refuse_form
from gearlib.run.translation import Translation
from gearlib.solvers.inputs.table import FunctionInput, unrolled, values

Floats = NDArray[np.float64]
INTERRUPTS = ("raise", "stop")


def run(translation: Translation, request: Request, scene: Scene | None = None) -> SimulatedResult:
    """Integrate a scene of a translation, by default its own.

    Raises
    ------
    ArgumentError, NameLookupError, StartError, SolverError
        The message names what was found and what was expected.
    """
    scene = scene or translation.scene
    parameters, times = request.parameters, request.times
    signals = unrolled(request.signals, request.t_start, float(times[-1]))
    functions = [signal for signal in signals if isinstance(signal, FunctionInput)]
    for function in functions:
        function.confirm()
    numbers = scene.prepared(parameters)
    grid = times if times[0] == request.t_start else np.concatenate([[request.t_start], times])
    if translation.structure.switching:
        from gearlib.run.refusals.jumps import refuse_jumps

        refuse_jumps(translation.structure, scene.program, parameters, float(grid[0]), float(grid[-1]))
    earlier = None if request.start is None else earlier_run(translation, request.start)
    absolute = absolute_tolerance(request.atol, len(scene.states))
    traced = not translation.controllers and scene.feeding is not None

    def begun(begin: Start) -> Run:
        return Run(
            scene, numbers, begin, signals, grid, request.rtol, absolute, begin.discrete, request.max_step, form=request.form,
            backend=request.backend, traced=traced,
        )  # fmt: skip

    begin = start_of(translation, request, scene, signals)
    if earlier:
        from gearlib.run.sampling.instants import given_before

        signals = given_before(translation.controllers, earlier[0], signals, scene.model, parameters)
    first = begun(begin)
    if not earlier:
        if translation.controllers:
            from gearlib.run.sampling.instants import begun_with

            first = begun_with(partial(start_of, translation, request, scene), first, translation.controllers)
            begin, signals = first.start, first.signals
        if scene.model.bounded:
            refuse_start(scene, parameters, float(grid[0]), values(signals, grid[:1])[:, 0], begin)
    if request.directions is not None:
        from gearlib.run.tangents.requested import refuse_held
        from gearlib.run.tangents.tangents import Tangents

        assert begin.changes is not None, "they were asked for"
        refuse_held(scene, parameters, float(grid[0]), values(signals, grid[:1])[:, 0], begin, request.directions)
        first = replace(first, tangents=Tangents(request.directions, begin.changes))
    if not translation.controllers:
        first = begun_at_instants(first)
    with nullcontext() if request.progress is False else reporting(request.progress, _label(translation, grid)) as tell:
        watch = None if tell is None else RunProgress(tell, float(grid[0]), float(grid[-1]))
        stops = request.on_interrupt == "stop" and not translation.controllers
        if watch is not None or stops:
            first = replace(first, tell=watch, may_stop=stops)
        if translation.controllers:
            from gearlib.run.sampling.instants import integrate_sampled

            joined, solution, pieces = integrate_sampled(
                first,
                method_of(request.method),
                translation.switched,
                translation.controllers,
                request.pieces,
                begun=earlier is not None,
                acted=earlier is not None and earlier[1] == request.t_start,
            )
            parts, request = [(joined, solution)], replace(request, pieces=pieces, signals=joined.signals)
        else:
            parts = integrate_through(first, method_of(request.method), translation.switched)
        if watch is not None and parts[-1][1].status != "interrupted":
            watch.end(parts[-1][1].t_last)
    if parts[-1][1].status == "interrupted":
        reached = parts[-1][1].t_last
        if len(parts) == 1 and len(parts[0][1].x) <= len(grid) - len(times):
            raise KeyboardInterrupt(f"before the first sample, at t = {reached:g} s")
        parts[0][1].stats["interrupted"] = reached  # those of the result begin with the first
        warn(f"the run was interrupted at t = {reached:.6g} s: its result ends at the last sample before", GearlibWarning)
    hidden = [len(grid) - len(times), *[0] * len(parts[1:])]  # the start, if it was not requested
    given = {"zero_inputs": request.zero_inputs}
    method = method_of(request.method)

    def finer(part: Run, more: Floats) -> Segment:
        """A segment with other samples, over the same interval: steps do not depend on samples."""
        again = replace(part, times=np.union1d(more, part.times[[0, -1]]), max_step=part.longest_step, tell=None)
        return Segment.of(again, integrate(again, method))

    def again(other: Scene) -> Start:
        return start_of(translation, request, other, first.signals)

    found = [
        (Segment.of(part, o, skipped, finer if len(parts) > 1 else None, again), o.stats | given, o.events)
        for (part, o), skipped in zip(parts, hidden, strict=True)
    ]
    for part, o in parts:
        warn_of_accumulation(part, o)
    for function in functions:
        function.remember(times)
    if first.longest_step < math.inf:
        request = altered(request, max_step=first.longest_step)  # a repeated run takes the same steps
    if parts[-1][1].status == "interrupted":
        request = altered(request, times=times[times <= found[-1][0].time[-1]])  # and ends where this one did
    refuse_too_small([part for part, _, _ in found], request.rtol)
    if scene.model.bounded:
        warn_of_unchecked(scene.structure)
    return SimulatedResult(found, translation, request, run)


def _label(translation: Translation, grid: Floats) -> str:
    """Text in front of a progress bar."""
    return f"{translation.name}, {grid[0]:g} .. {grid[-1]:g} s"


def start_of(translation: Translation, request: Request, scene: Scene, signals: tuple[Any, ...]) -> Start:
    """Start values of a run of a scene with certain inputs.

    Raises
    ------
    ArgumentError, NameLookupError, StartError
        As `run` raises.
    """
    earlier = None if request.start is None else earlier_run(translation, request.start)
    if earlier:
        begin, was = earlier[0].moment(scene, earlier[1]), (earlier[1], earlier[0].request.parameters)
        return replace(begin, discrete=scene.going_on(begin.discrete, was, (request.t_start, request.parameters)))
    varied = request.directions
    seeds = None if varied is None else varied.seeds
    own_seeds = () if varied is None else varied.starts
    return translation.start(scene, request.parameters, request.t_start, request.start, signals, True, seeds, own_seeds)


def checked_request(
    translation: Translation, t_end: float, *, t_start: float | None = None, samples: int | None = None,
    times: ArrayLike | None = None, method: str | Method = "auto", rtol: float = 1e-6, atol: ArrayLike | None = None,
    parameters: Mapping[str, float] | None = None, start: Any = None, inputs: Mapping[str, Any] | None = None,
    max_step: float | None = None, progress: Any = False, form: str = "ode", backend: str = "native",
    sensitivities: Sequence[str] = (), on_interrupt: str = "raise",
) -> tuple[Translation, Request]:  # fmt: skip
    """The translation that fits a request, and the validated request; arguments as for `System.simulate`.

    Raises
    ------
    ArgumentError, NameLookupError, BoundError
        The message names what was found and what was expected.
    """
    names = translation.open_inputs
    # copies, since the result may repeat the run when it is read, after the caller has changed them
    start = by_name("start", start, "a mapping of paths to start values") if isinstance(start, Mapping) else start
    atol = atol.copy() if isinstance(atol, (list, np.ndarray)) else atol
    earlier = None if start is None else earlier_run(translation, start)
    t_start = (earlier[1] if earlier else 0.0) if t_start is None else t_start
    options = (method, rtol, max_step, form, backend, progress, on_interrupt)
    begin, grid = _interval_and_options(translation, t_start, t_end, samples, times, options)
    if earlier:
        parameters, inputs = kept_values(earlier[0], parameters, inputs)
    translation, numbers = translation.fitted(parameters)
    given = tuple(parameters or ())
    signals = tuple(translation.input_signals(inputs))
    zero = tuple(name for name in names if name not in inputs) if inputs else names
    varied = None
    if not (type(sensitivities) is tuple and not sensitivities):
        varied = directions(translation, sensitivities, numbers, given, start)
    if varied is not None:
        refuse_form(translation, form)
        if isinstance(start[0] if isinstance(start, tuple) else start, Result):
            raise ArgumentError(CONTINUED)
    return translation, Request(
        begin, grid, method, float(rtol), atol, numbers, start, signals, progress, max_step, zero, form, backend, varied,
        given, on_interrupt,
    )  # fmt: skip


def kept_values(
    earlier: SimulatedResult, parameters: Mapping[str, float] | None, inputs: Mapping[str, Any] | None = None
) -> tuple[dict[str, float], dict[str, Any]]:
    """Parameters and inputs of what continues a run: those that are given, and beside them those that were given for the run."""
    request, translation = earlier.request, earlier.translation
    place = translation.model.parameters.index
    numbers = {name: float(request.parameters[place[name]]) for name in request.given}
    signals = {
        name: signal.function if isinstance(signal, FunctionInput) else signal
        for name, signal in zip(translation.inputs, request.signals, strict=True)
        if name in translation.open_inputs and name not in request.zero_inputs
    }
    return (
        numbers | by_name("parameters", parameters, "a mapping of paths to numbers", "load.J"),
        signals | by_name("inputs", inputs, "a mapping of paths to numbers, functions of time or tables", "torque.tau"),
    )


def _interval_and_options(
    translation: Translation, t_start: Any, t_end: Any, samples: Any, times: Any, options: tuple[Any, ...]
) -> tuple[float, Floats]:
    """The start time and the output times of a run; arguments equal to those of the last run are not checked again."""
    again = times.tobytes() if type(times) is np.ndarray and times.dtype == float and times.ndim == 1 else times
    given = (t_start, t_end, samples, again, *options)
    key = *map(type, given), *given  # the types first: a number equals some that are refused, an array has no truth value
    known = translation.asked[0] if translation.asked else None
    if known is not None and known[0] == key:
        return known[1], known[2]
    method, rtol, max_step, form, backend, progress, on_interrupt = options
    begin = real("t_start", t_start, "a finite number of seconds")
    end = real("t_end", t_end, "a finite number of seconds")
    grid = output_times(begin, end, samples, times, len(translation.states))
    check_options(method, rtol, max_step)
    check_form(method, form, backend)
    check_progress(progress)
    one_of("on_interrupt", on_interrupt, INTERRUPTS)
    grid.flags.writeable = False  # runs share it
    if times is None or again is not times:  # what else there is may change
        translation.asked[:] = [(key, begin, grid)]
    return begin, grid


def warn_of_zero_inputs(
    translation: Translation, zero: tuple[str, ...], runs: str = "this run", given: str = "simulate"
) -> None:
    """Warn of inputs that were not given although the outputs depend on them."""
    missed = [name for name in translation.needed_inputs if name in zero] if zero else []
    if missed:
        many = f"the inputs {some(missed, ', ')}: they are" if len(missed) > 1 else f"the input {missed[0]}: it is"
        warn(
            f"{translation.name}: no value was given for {many} 0 in {runs}. Pass {given}(inputs={{{missed[0]!r}: ...}}), "
            "0.0 if that is intended, or bind it in the model",
            InputWarning,
        )


def earlier_run(translation: Translation, start: Any) -> tuple[SimulatedResult, float] | None:
    """The run that ``start`` continues and the time at which it does; None if it continues none.

    Raises
    ------
    ArgumentError
        A run of another model, or a time outside the run.
    """
    if isinstance(start, SimulatedResult):
        start = (start, float(start.time[-1]))
    if not (isinstance(start, tuple) and len(start) == 2 and isinstance(start[0], SimulatedResult)):
        if isinstance(start[0] if isinstance(start, tuple) and len(start) == 2 else start, Result):
            raise ArgumentError(
                "start is a result from a file, which does not hold all of the run's state; start from values in it: "
                "start={'load.w': result['load.w'][-1]}"
            )
        return None
    result, t = start[0], real("the time of start=(result, time)", start[1], "a finite number of seconds")
    theirs, ours = result.scene.structure, translation.structure
    variant = any(theirs is other.structure for other in translation.variants.known.values())
    if not (theirs is ours or variant or (theirs.states == ours.states and theirs.model.same_names(ours.model))):
        raise ArgumentError(
            f"start is a run of another system than {translation.name}; a run goes on with the system that made it"
        )
    if not result.time[0] <= t <= result.time[-1]:
        raise ArgumentError(f"start names the time {t:g} s; the run goes from {result.time[0]:g} to {result.time[-1]:g} s")
    return result, float(t)
