"""gearlib's own methods, and the floors: loops written by hand for one model, as fast as the method can be."""

from __future__ import annotations

import itertools
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.ida.ida_stepper import SAFETY
from gearlib.solvers.problem import Floats, Problem
from tests.benchmarks import floor_ida, floor_rk
from tests.benchmarks.competitors import Competitor, RunAt, Unavailable
from tests.benchmarks.equations import shown
from tests.benchmarks.references import BenchScene

EPSILON = 2.2e-16
_count = itertools.count()


@contextmanager
def clocked() -> Iterator[list[float]]:
    """Adds up the processor time (s) spent in gearlib's integrators themselves."""
    spent = [0.0]
    places: list[tuple[Any, str]] = [(Driver, name) for name in ("__init__", "advance", "solution")]
    originals = [getattr(owner, name) for owner, name in places]

    def watched(original: Any) -> Any:
        def run(*arguments: Any, **options: Any) -> Any:
            start = time.process_time()
            try:
                return original(*arguments, **options)
            finally:
                spent[0] += time.process_time() - start

        return run

    for (owner, name), original in zip(places, originals, strict=True):
        setattr(owner, name, watched(original))
    try:
        yield spent
    finally:
        for (owner, name), original in zip(places, originals, strict=True):
            setattr(owner, name, original)


START: dict[str, dict[str, float]] = {"M3": {"x": 50e-6, "w_1": 800.0, "w_2": 400.0}}
# A parameter that every run changes in its last digit, so that no run can take what an equal one before it has left.
TURNED = {"M1": "drag.d", "M2": "load.J", "M3": "d", "XP": "C_v"}


def with_gearlib(method: str) -> Callable[[BenchScene], RunAt]:
    """gearlib as a user calls it: ``simulate`` on a compiled system, and reading the outputs."""

    def prepare(scene: BenchScene) -> RunAt:
        if method == "exact" and not scene.linear:
            raise Unavailable("the scene is not linear")
        system = compiled(scene.name)
        start, turned = START.get(scene.name), TURNED[scene.name[:2]]
        value = system.parameters[turned]

        def run(rtol: float) -> Floats:
            parameters = {turned: value * (1 + next(_count) % 400 * EPSILON)}
            try:
                result = system.simulate(
                    scene.times[-1], times=scene.times, method=method, rtol=rtol, start=start, parameters=parameters
                )
            except ArgumentError as reason:
                raise Unavailable(str(reason)) from None
            return np.column_stack([result[name] for name in scene.outputs])

        return run

    return prepare


@cache
def compiled(name: str) -> gl.System:
    from tests.benchmarks.references import SCENES

    return gl.compile(SCENES[name].component(), outputs=list(SCENES[name].outputs))


def numba_floor(scene: BenchScene) -> RunAt:
    """Tsitouras' method in one numba loop with the right-hand side inlined."""
    hand = scene.by_hand()
    if scene.name == "M3":
        problem: Any = floor_rk.backlash()
        loop, outputs = floor_rk.backlash_floor(), hand.outputs
    elif scene.name.startswith("M1"):
        n = int(hand.index[0])
        problem, loop, outputs = _twists_first(n), floor_rk.chain_floor(), _speeds_last(n)
    else:
        problem = Problem(hand.rhs, hand.x0, hand.data, hand.index, np.ones(hand.x0.size, dtype=np.bool_), hand.nominal)
        loop, outputs = floor_rk.chain_floor(hand.rhs), hand.outputs
    return lambda rtol: np.asarray(floor_rk.run_floor(loop, problem, scene.times, rtol, hand.step)[0] @ outputs.T)


def c_floor(scene: BenchScene) -> RunAt:
    """The chain's loop in C."""
    if not scene.name.startswith("M1"):
        raise Unavailable("written for the chain only")
    if shutil.which("cc") is None:
        raise Unavailable("no C compiler")
    n = int(scene.by_hand().index[0])
    problem, outputs = _twists_first(n), _speeds_last(n)
    with tempfile.TemporaryDirectory() as directory:
        loop: Any = floor_rk.c_chain(directory)
    return lambda rtol: np.asarray(loop(problem, scene.times, rtol, 1e-5)[0] @ outputs.T)


def ida_floor(scene: BenchScene) -> RunAt:
    """IDA in C on the same SUNDIALS, with the safety factor that gearlib uses, so that both take the same steps."""
    if not scene.name.startswith("M1"):
        raise Unavailable("written for the chain only")
    if shutil.which("cc") is None:
        raise Unavailable("no C compiler")
    library, n = _ida_library(), int(scene.by_hand().index[0])
    return lambda rtol: np.asarray(floor_ida.floor(library, n, SAFETY * rtol)[0][:, [2 * i for i in shown(n)]])


@cache
def _ida_library() -> Any:
    return floor_ida.compile_floor()


@cache
def _twists_first(n: int) -> Problem:
    """The chain with all twists before all speeds, inertias as in the scene and nominal values as gearlib has them."""
    problem = floor_rk.chain(n)
    problem.data[5:] = 1.0 / (0.01 * (1.0 + np.arange(n) / n))
    problem.nominal[: n - 1], problem.nominal[n - 1 :] = 1e-4, 1e-2
    return problem


def _speeds_last(n: int) -> Floats:
    outputs = np.zeros((3, 2 * n - 1))
    outputs[np.arange(3), n - 1 + np.array(shown(n))] = 1.0
    return outputs


METHODS = ("auto", "exact", "rk5", "rk8", "taylor", "ida")
OWN = tuple(Competitor(f"gearlib {m}", "gearlib", with_gearlib(m)) for m in METHODS)
FLOORS = (
    Competitor("RK5 floor, numba", "floor", numba_floor),
    Competitor("RK5 floor, C", "floor", c_floor),
    Competitor("IDA floor, C", "IDA floor", ida_floor),
)
