"""Equations of discrete variables: evaluated at events, apart from the continuous ones.

``When`` is lowered to such equations: a hidden discrete variable holds the condition, and the actions apply where that has just become
1.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from gearlib.arguments import shown
from gearlib.equations.template import Template, template_of_value
from gearlib.errors import DeclarationError, nearest
from gearlib.language.declarations import Discrete
from gearlib.language.expressions import (
    Eq,
    JustBefore,
    Reinit,
    Sample,
    SquareWave,
    When,
    alternates,
    holds,
    initial,
    no_event,
    pre,
    real_symbol,
    time,
    value_of,
)


@dataclass(frozen=True)
class Update:
    """Assignment at events: ``target``, a discrete variable or a state (``reinit``), takes the value of the template."""

    target: str
    template: Template
    reinit: bool


def split_equations(
    name: str, equations: Sequence[Eq | When], discretes: Mapping[str, Discrete], is_parameter: Callable[[str], bool],
    variables: Mapping[str, Any],
) -> tuple[list[Eq], tuple[Update, ...], dict[str, Discrete]]:  # fmt: skip
    """The continuous equations of a class, its discrete ones, and its discrete variables including the hidden ones.

    Raises
    ------
    DeclarationError
        An invalid action, or a discrete variable with no equation or more than one.
    """
    continuous: list[Eq] = []
    values: list[tuple[str, Any, bool]] = []
    known = dict(discretes)
    reinits: dict[str, list[tuple[Any, Any]]] = {}
    samples: dict[Any, Any] = {}  # condition -> the condition of its sample instants, in discrete variables
    states: dict[str, Any] = {}

    def unused(kind: str) -> str:
        """Name of a hidden discrete variable that, like its ``..._before``, the class has not declared."""
        names = (f"{kind}_{k}" for k in itertools.count())
        return next(n for n in names if not any(m in known or m in variables or is_parameter(m) for m in (n, f"{n}_before")))

    def sampled(expression: Any) -> Any:
        """An expression with `gl.sample` replaced by comparisons of hidden discrete variables."""
        for found in sorted(expression.atoms(Sample), key=str):
            if found not in samples:
                samples[found] = _instants(name, found, unused("sample"), is_parameter, known, values)
            expression = expression.xreplace({found > 0: samples[found], found: value_of(samples[found])})
        return expression

    def action(given: Any, due: Any, ways: dict[str, list[tuple[Any, Any]]]) -> None:
        if isinstance(given, Reinit):
            target = getattr(given.state, "name", str(given.state))
            if target not in variables:
                raise DeclarationError(f"{name}: reinit({given.state}): no variable of the class; {nearest(target, variables)}")
            # all ``reinit`` of one state in one update: separate ones would overwrite each other with the old value
            reinits.setdefault(target, []).append((value_of(given.value), due))
            states[target] = given.state
        elif isinstance(given, Eq) and getattr(given.left, "name", "") in known:
            new = value_of(given.right, f"{name}: the value of {given.left} in When")
            if given.left in new.free_symbols:
                raise DeclarationError(
                    f"{name}: {given.left} = {given.right} in When: the new value is given by itself; the value before the event is "
                    f"gl.pre(self.{given.left})"
                )
            ways.setdefault(given.left.name, []).append((new, due))
        else:
            raise DeclarationError(
                f"{name}: {shown(given)} in When: expected gl.Eq(discrete variable, ...) or gl.reinit(state, ...)"
            )

    def when(branch: When, earlier: list[Any]) -> dict[str, list[tuple[Any, Any]]]:
        """New values of the discrete variables that a branch assigns, with their conditions; ``earlier`` branches take precedence."""
        hidden = real_symbol(unused("when"))
        condition = value_of(branch.condition, f"{name}: the condition of When")
        at_start = any(symbol.name == "initial()" for symbol in condition.free_symbols)
        if not condition.has(Sample) and all(is_parameter(symbol.name) for symbol in condition.free_symbols):
            raise DeclarationError(
                f"{name}: When({branch.condition}): the condition holds parameters only, and never becomes true during a run; "
                "gl.initial() holds at the start"
            )
        known[hidden.name] = Discrete("condition of a When", start=0.0 if at_start or condition.has(Sample) else 1.0)
        values.append((hidden.name, condition, False))
        if at_start and any(isinstance(given, Reinit) for given in branch.actions):
            raise DeclarationError(f"{name}: reinit in a When of gl.initial(): give the state a start value instead, start=...")
        became = sympy.And(holds(hidden), sympy.Not(holds(pre(hidden))))
        ways: dict[str, list[tuple[Any, Any]]] = {}
        for given in branch.actions:
            action(given, sympy.And(became, *map(sympy.Not, earlier)), ways)
        earlier.append(became)
        return ways

    for equation in equations:
        if isinstance(equation, When):
            earlier: list[Any] = []
            chosen: dict[str, list[tuple[Any, Any]]] = {}
            for branch in equation.branches:
                for target, (first, *more) in when(branch, earlier).items():
                    chosen.setdefault(target, []).append(first)
                    values += [(target, sympy.Piecewise(way, (pre(real_symbol(target)), True)), False) for way in more]
            values += [
                (target, sympy.Piecewise(*found, (pre(real_symbol(target)), True)), False) for target, found in chosen.items()
            ]
        elif getattr(equation.left, "name", "") in known:
            values.append((equation.left.name, value_of(equation.right, f"{name}: the value of {equation.left}"), False))
        else:
            continuous.append(equation)

    values += [(target, sympy.Piecewise(*ways, (states[target], True)), True) for target, ways in reinits.items()]

    written = [(target, sampled(value), reinit) for target, value, reinit in list(values)]  # adds the hidden ones to `values`
    values = [*values[len(written) :], *written]

    def is_discrete(symbol: str) -> bool:
        return symbol in known or symbol == "initial()" or (symbol.startswith("pre(") and symbol[4:-1] in known)

    updates = tuple(
        Update(target, template_of_value(value, f"{name}: {target}", is_parameter, is_discrete), reinit)
        for target, value, reinit in values
    )
    for discrete in known:
        count = sum(u.target == discrete and not u.reinit for u in updates)
        if count != 1:
            raise DeclarationError(f"{name}: the discrete variable '{discrete}' has {count} equations; expected one")
    return continuous, updates, known


def _instants(
    name: str, found: Any, hidden: str, is_parameter: Callable[[str], bool], known: dict[str, Discrete], values: list[Any]
) -> Any:
    """The condition that stands for a `gl.sample`, and the hidden discrete variables that it needs.

    One holds the side of a square wave that switches at the instants; the other its value before the event, which at the start of a run
    is the value just before the start time.
    """
    period, offset = found.args
    if wrong := sorted(s.name for s in found.free_symbols if not is_parameter(s.name)):
        raise DeclarationError(
            f"{name}: gl.sample{found.args} depends on {wrong[0]}; its instants are given by numbers and parameters"
        )
    side, before = real_symbol(hidden), real_symbol(f"{hidden}_before")
    known[side.name] = Discrete("side of a function that alternates at the instants of sample()")
    known[before.name] = Discrete("its value before the event")
    start = no_event(value_of(SquareWave(JustBefore(time), period, offset) > 0))
    values.append((side.name, value_of(alternates(period, offset)), False))
    values.append((before.name, sympy.Piecewise((start, initial()), (pre(side), True)), False))
    return sympy.Ne(side, before)
