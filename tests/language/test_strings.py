"""Text is never evaluated: sympy executes what it parses, and would execute what came with a file of parameters."""

from __future__ import annotations

import builtins
import contextlib
import inspect
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib import bondgraph as bg
from gearlib.flatten.flatten import flatten
from gearlib.language.declarations import Declaration

MARK = "_a_mark_that_executed_text_leaves"
HARMFUL = f"0 or __import__('builtins').__dict__['{MARK}'].append(1)"


@pytest.fixture
def mark() -> Iterator[list[int]]:
    left: list[int] = []
    setattr(builtins, MARK, left)
    yield left
    delattr(builtins, MARK)


def attempt(action: Callable[[], Any]) -> None:
    with contextlib.suppress(Exception):
        action()


def leaf(**members: Any) -> gl.Component:
    declared: dict[str, Any] = {"x": gl.Variable("1"), "n": gl.Discrete(), "p": gl.Parameter("1", default=1.0)}
    made: gl.Component = type("Leaf", (gl.Component,), declared | members)()
    return made


class Train(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.torque, self.body = gp.Torque(), gp.Inertia(J=1.0)
        return [gl.connect(self.torque.flange, self.body.flange_a)]


def test_the_mark_would_be_left(mark: list[int]) -> None:
    import sympy

    attempt(lambda: sympy.sympify(HARMFUL))
    assert mark


def calls_with_text(function: Any, first: tuple[Any, ...]) -> Iterator[Callable[[], Any]]:
    """Calls of a function with the text in every place, the other arguments right or text, too."""
    for count in range(4):
        for values in ([HARMFUL], (HARMFUL, HARMFUL), HARMFUL):
            yield lambda n=count, v=values: function(*first, *[v] * n)  # type: ignore[misc]
    try:
        names = [p.name for p in inspect.signature(function).parameters.values()]
    except (TypeError, ValueError):
        return
    for name in names:
        for values in (
            HARMFUL,
            [HARMFUL],
            {HARMFUL: HARMFUL},
            {"torque.tau": HARMFUL},
            {"body.w": HARMFUL},
            {"body.J": HARMFUL},
        ):
            yield lambda k=name, v=values: function(*first, **{k: v})  # type: ignore[misc]


@pytest.mark.parametrize("module", [gl, gp, bg], ids=lambda m: m.__name__)
def test_no_public_function_and_no_declaration_evaluates_text(module: Any, mark: list[int]) -> None:
    system = gl.compile(Train())
    x = leaf().x
    for name in module.__all__:
        function = getattr(module, name)
        if not callable(function):
            continue
        firsts: list[tuple[Any, ...]] = [()]
        if not isinstance(function, type):
            firsts += [(system,), (x,)]
        for first in firsts:
            for call in calls_with_text(function, first):
                attempt(call)
        if isinstance(function, type) and issubclass(function, gl.Component):
            inherited = {key for base in function.__bases__ for key in getattr(base, "_declarations", ())}
            for key, declared in function._declarations.items():
                assert isinstance(declared, Declaration)
                if key in inherited:
                    continue
                attempt(lambda f=function, k=key: flatten(f(**{k: HARMFUL})))  # type: ignore[misc]
                attempt(lambda f=function, k=key: flatten(f(**{k: ((HARMFUL, HARMFUL), (HARMFUL, HARMFUL))})))  # type: ignore[misc]
                attempt(lambda f=function, k=key: flatten(f(start={k: HARMFUL}, guess={k: HARMFUL})))  # type: ignore[misc]
        assert not mark, name


def test_no_equation_evaluates_text(mark: list[int]) -> None:
    equations: list[Callable[[Any], Any]] = [
        lambda s: gl.Eq(HARMFUL, 0),
        lambda s: gl.Eq(s.x, HARMFUL),
        lambda s: gl.Eq(s.n, HARMFUL),
        lambda s: gl.When(HARMFUL, gl.Eq(s.n, 1)),
        lambda s: gl.When(s.x > 1, gl.Eq(s.n, HARMFUL)),
        lambda s: gl.When(s.x > 1, gl.reinit(HARMFUL, 1)),
        lambda s: gl.When(s.x > 1, HARMFUL),
        lambda s: gl.Eq(s.x, gl.Piecewise((HARMFUL, s.x > 0), (HARMFUL, HARMFUL))),
        lambda s: gl.Eq(s.x, s.x + HARMFUL),
        lambda s: gl.Eq(s.x, s.x**HARMFUL),
        lambda s: gl.When(s.x > HARMFUL, gl.Eq(s.n, 1)),
        lambda s: HARMFUL,
    ]
    for law in equations:
        attempt(lambda law=law: gl.compile(leaf(equations=lambda self: [gl.Eq(gl.der(self.x), 1), law(self)])))  # type: ignore[misc]
        assert not mark, inspect.getsource(law)


def test_no_name_and_no_run_evaluates_text(mark: list[int]) -> None:
    class Named(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            setattr(self, HARMFUL, gp.Inertia(J=1.0))
            setattr(self, "[" + HARMFUL + "]", gp.Inertia(J=2.0, start={"w": 1.0}))
            return []

    strange = type(
        "Odd", (gl.Component,), {HARMFUL: gl.Variable("1"), "equations": lambda s: [gl.Eq(gl.der(getattr(s, HARMFUL)), 1)]}
    )
    law = {"law": lambda flow: HARMFUL}
    system = gl.compile(Train())
    runs: list[Callable[[], Any]] = [
        lambda: gl.simulate(Named(), 1.0, samples=2, method="rk"),
        lambda: gl.simulate(Named(), 1.0, samples=2, method="ida"),
        lambda: gl.simulate(strange(), 1.0, samples=2),
        lambda: gl.simulate(strange(), 1.0, samples=2, method="rk"),
        lambda: type("Of", (gl.Component,), {"a": gl.Derivative(HARMFUL)})().a,
        lambda: gl.simulate(type("Of", (gl.Component,), {"x": gl.Variable(HARMFUL, HARMFUL)})(), 1.0),
        lambda: system.simulate(1.0, inputs={"torque.tau": lambda t: HARMFUL}),
        lambda: system.simulate(1.0, inputs={"torque.tau": gl.Table([0, 1], [HARMFUL, HARMFUL])}),
        lambda: system.simulate(1.0, samples=2)[HARMFUL],
        lambda: system.linearize([HARMFUL], [HARMFUL]),
        lambda: gl.Table(np.array([HARMFUL]), np.array([HARMFUL])),
        lambda: gp.from_bond_graph("G", bg.BondGraph((0, bg.R(**law))), {}),
    ]
    for run in runs:
        attempt(run)
        assert not mark, inspect.getsource(run)
