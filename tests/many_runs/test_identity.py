"""What makes a sweep the same as another: its model, its functions and its numbers, in bytes."""

from __future__ import annotations

import functools
import threading
from collections import deque
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import sparse
from scipy.interpolate import CubicSpline

import gearlib as gl
from gearlib.errors import FileError, GearlibError
from gearlib.many_runs.identity import of_function, of_functions, of_model, of_values
from tests.many_runs.models import Drive


def digest(value: Any) -> bytes:
    return b"|".join(of_values(value))


def adding(k: Any) -> Any:
    return lambda x: x + k


def test_values_that_differ_have_different_bytes() -> None:
    """Numbers, shapes, names, tables and functions, also inside each other; what is equal has equal bytes."""
    table = [0.0, 1.0], [2.0, 3.0]
    distinct = [
        1.0, 2.0, "1.0", None, [1.0], [[1.0]], [1.0, 2.0], np.array([1.0, 2.0]), np.array([[1.0, 2.0]]), np.array([[1.0], [2.0]]),
        {"a": 1.0}, {"b": 1.0}, {"a": 2.0}, {"a": {"b": 1.0}}, gl.Table(*table), gl.Table(*table, interpolation="previous"),
        gl.Table(*table, outside="periodic"), gl.Table([0.0, 1.0], [2.0, 4.0]), gl.Table([0.0, 2.0], [2.0, 3.0]),
        lambda x: x + 1, lambda x: x + 2, lambda x: x - 1, lambda x: np.sin(x), lambda x: np.cos(x), adding(1.0), adding(2.0),
        np.sin, np.cos, len, lambda x: [i + 1 for i in x], lambda x: [i + 2 for i in x],
    ]  # fmt: skip
    found = [digest(value) for value in distinct]
    same = [(i, j) for i in range(len(found)) for j in range(i) if found[i] == found[j]]
    assert same == []
    assert digest({"a": [1.0, np.array([2.0])]}) == digest({"a": (1.0, np.array([2.0]))})
    assert digest(adding(3.0)) == digest(adding(3.0))
    assert digest(gl.Table(*table)) == digest(gl.Table(*table))


def test_objects_that_differ_in_what_their_text_leaves_out_have_different_bytes() -> None:
    """Tables of other libraries and splines print some of their numbers, runs and systems none."""
    system = gl.compile(Drive(), outputs=["load.w"])

    def run(torque: float, end: float = 1.0) -> gl.Result:
        return system.simulate(end, samples=3, inputs={"torque.tau": torque})

    def objects() -> list[Any]:
        many = [np.where(np.arange(5000) == 2500, k, 1.0) for k in (1.0, 2.0)]
        splines, spaces = lambda y: CubicSpline(np.arange(5000), y), lambda y: SimpleNamespace(y=y)
        return [
            *(kind(numbers) for kind in (pd.Series, pd.DataFrame, deque, sparse.diags_array, splines, spaces) for numbers in many),
            run(1.0), run(2.0), (run(1.0), 0.5), run(1.0, 0.5), system, gl.compile(Drive(J=1.0), outputs=["load.w"]), np, np.linalg,
            threading.Lock(),
        ]  # fmt: skip

    found = [digest(value) for value in objects()]
    assert [(i, j) for i in range(len(found)) for j in range(i) if found[i] == found[j]] == []
    assert [digest(value) for value in objects()] == found, "nothing depends on where an object is in memory"


def test_a_sweep_that_goes_on_from_another_run_is_another_sweep(tmp_path: Path) -> None:
    system = gl.compile(Drive(), outputs=["load.w"])
    earlier = [system.simulate(1.0, samples=3, inputs={"torque.tau": torque}) for torque in (1.0, 7.0)]
    options: dict[str, Any] = {"samples": 2, "inputs": {"torque.tau": 1.0}, "to": tmp_path / "runs.nc"}
    first = system.sweep({"J": [1.0, 2.0]}, 2.0, start=earlier[0], **options)
    again = system.sweep({"J": [1.0, 2.0]}, 2.0, start=earlier[0], **options)
    assert (first.stats["done_before"], again.stats["done_before"]) == (0, 2)
    for other in (earlier[1], (earlier[0], 0.5)):
        with pytest.raises(FileError, match="was written by another sweep"):
            system.sweep({"J": [1.0, 2.0]}, 2.0, start=other, **options)


class Factor:
    """A function with a state."""

    def __init__(self, k: Any) -> None:
        self.k = k

    def __call__(self, x: Any) -> Any:
        return self.k * x

    def method(self, x: Any) -> Any:
        return x - self.k


class Plain(Factor):
    __call__ = None  # type: ignore[assignment]


class Offset(Factor):
    def __call__(self, x: Any) -> Any:
        return self.k + x


SCALE, TABLE = 3.0, {"a": [1.0]}
FRAME, SPLINE = pd.DataFrame({"a": [1.0]}), CubicSpline([0.0, 1.0], [0.0, 1.0])


def by_objects(x: Any) -> Any:
    return SPLINE(x), FRAME, Factor, digest, np.sin


def scaled(x: Any) -> Any:
    return SCALE * x


def by_table(x: Any) -> Any:
    return [scaled(x), TABLE]


def test_functions_that_differ_in_what_they_use_have_different_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Defaults, what a closure holds, bound arguments, the state of objects, and what has a name in the module."""

    def repeated(n: int) -> Any:
        return lambda x: repeated(n - 1) if n else x  # refers to itself

    def functions() -> list[Any]:
        return [
            lambda x, k=1: k * x, lambda x, k=2: k * x, lambda x, *, k=1: k * x, lambda x, *, k=2: k * x,
            *(adding(k) for k in ([1.0], [2.0], {"a": 1.0}, {"a": 2.0}, np.array([1.0]), np.array([2.0]), np.array(["b"]), 1j, np.sin)),
            *(functools.partial(max, k) for k in (1.0, 2.0)), functools.partial(min, 1.0), functools.partial(sorted, reverse=True),
            *(kind(k) for kind in (Factor, Offset) for k in (1.0, 2.0)), *(kind(k).method for kind in (Factor, Plain) for k in (1.0, 2.0)),
            adding(Plain(1.0)), adding(Plain(2.0)), *(f(name) for f in (gl.final, gl.peak) for name in ("a.w", "b.w")),
            lambda x: x in {"one", "other"}, lambda x: x in {"one", "another"}, repeated(1), repeated(2), scaled, by_table, Factor,
            [].append,
        ]  # fmt: skip

    found = [digest(function) for function in functions()]
    assert [(i, j) for i in range(len(found)) for j in range(i) if found[i] == found[j]] == []
    assert [digest(function) for function in functions()] == found, "nothing depends on where an object is in memory"
    monkeypatch.setitem(globals(), "SCALE", 4.0)
    assert digest(scaled) != found[functions().index(scaled)]
    assert digest(by_table) != found[functions().index(by_table)]  # through the function that it calls
    monkeypatch.undo()
    objects = [digest(by_objects)]
    for name, value in (("FRAME", 2 * FRAME), ("SPLINE", CubicSpline([0.0, 1.0], [0.0, 2.0])), ("Factor", Offset)):
        monkeypatch.setitem(globals(), name, value)
        objects.append(digest(by_objects))
        monkeypatch.undo()
    assert [objects.index(told) for told in objects] == [0, 1, 2, 0]  # what a class does is not told
    monkeypatch.setitem(TABLE, "a", [2.0])
    assert digest(scaled) == found[functions().index(scaled)]
    assert digest(by_table) != found[functions().index(by_table)]


def test_a_function_with_a_variable_that_is_not_assigned_yet() -> None:
    found = digest(lambda x: later * x)
    later = 2.0
    assert digest(lambda x: later * x) != found


def counting(
    start: float = 1.0, rate: float = 2.0, step: float = 3.0, first: float = 0.0, factor: float = 4.0, most: float = 9.0,
    after: float = 0.5, reset: float = 5.0, period: float = 0.1,
) -> gl.System:  # fmt: skip
    def equations(self: Any) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.n + self.twice - rate * self.x + self.u),
            gl.When(gl.time > after, gl.Eq(self.n, gl.pre(self.n) + step), gl.reinit(self.x, reset)),
        ]

    def assemble(self: Any) -> list[Any]:
        self.count = inner()
        self.control = gl.Sampled(lambda t, x: step * x[0], period, inputs=[self.count.x], outputs=[self.count.u])
        return []

    own = {
        "k": gl.Parameter("any", default=0.0, max=most), "twice": gl.Parameter("any", default=lambda c: factor * c.k),
        "x": gl.Variable("any", start=start), "n": gl.Discrete(start=first), "u": gl.Input("any"), "equations": equations,
    }  # fmt: skip
    inner = type("Counting", (gl.Component,), own)
    return gl.compile(type("Controlled", (gl.Component,), {"assemble": assemble})(), outputs=["count.x"])


def test_models_that_would_move_otherwise_have_different_bytes() -> None:
    """Start values, equations, those at events, bindings and bounds of parameters, and sampled controllers."""
    options = ({}, *({name: 7.0} for name in ("start", "rate", "step", "first", "factor", "most", "after", "reset", "period")))
    found = [list(of_model(counting(**given).translation)) for given in options]
    assert [(i, j) for i in range(len(found)) for j in range(i) if found[i] == found[j]] == []
    assert list(of_model(counting().translation)) == found[0]


def test_a_function_is_that_which_it_wraps() -> None:
    def plain(x: float) -> float:
        return x + 41.0

    @functools.wraps(plain)
    def wrapped(*given: Any) -> float:
        return plain(*given)

    assert list(of_function(wrapped)) == list(of_function(plain))
    assert list(of_functions({"a": plain})) == [b"a", *of_function(plain)]
    assert list(of_functions({"b": plain})) != list(of_functions({"a": plain}))
    assert isinstance(next(of_function(GearlibError)), bytes)
