"""Single equations of a component, evaluated by themselves."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import sympy

import gearlib as gl
from gearlib.language.component import energies_of, equations_of
from gearlib.language.expressions import value_of


def plain(expression: Any) -> Any:
    """An expression, or a condition as 1 or 0, whose conditions are as any others."""
    return value_of(expression).replace(lambda e: e.func.__name__ in ("no_event", "settled"), lambda e: e.args[0])


@cache
def stated(part: gl.Component) -> dict[str, Any]:
    """Right sides of a component's equations by their left sides."""
    return {str(e.left): plain(e.right) for e in equations_of(part) if isinstance(e, gl.Eq)}


def right_side(part: gl.Component, left: str, **values: float) -> float:
    """What an equation gives to its left side, with the names that are not mentioned zero; ``pre_mode`` is ``pre(mode)``."""
    given = stated(part)[left]
    known = {s: values.get(s.name.replace("pre(", "pre_").removesuffix("()").removesuffix(")").replace(".", "__"), 0.0)
             for s in given.free_symbols}  # fmt: skip
    return float(given.xreplace({s: sympy.Float(value) for s, value in known.items()}))


def number(expression: Any, values: Mapping[str, float]) -> float:
    """An expression at values of all its symbols, by name, such as "w_a" or "der(flange_a.phi)"."""
    expression = plain(expression)
    return float(expression.xreplace({s: sympy.Float(values[s.name]) for s in expression.free_symbols}))


def misfits(part: gl.Component, values: Mapping[str, float]) -> list[str]:
    """Left sides of those of a component's equations that do not hold where its symbols have some values."""
    size = max(1.0, *map(abs, values.values()))
    equations = [e for e in equations_of(part) if isinstance(e, gl.Eq)]
    return [str(e.left) for e in equations if abs(number(e.residual, values)) > 1e-12 * size]


def powers(part: gl.Component, values: Mapping[str, float]) -> tuple[float, float, float]:
    """Energy that a component stores, power that it loses and power that is supplied to it, at values of its symbols."""
    energy = energies_of(part)
    assert energy is not None
    return number(energy.stored, values), number(energy.heat, values), number(energy.supplied, values)
