"""Equations in which time occurs, and the mean over time of what they add to a motion that is otherwise steady."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.equations.quasipolynomials import OutsideClassError, mean_value, parse, value
from gearlib.equations.switch_times import switch_times
from gearlib.equations.template import Template, relation_symbol
from gearlib.flatten.model import EquationGroup, FlatModel, alphabetical
from gearlib.language.declarations import Input
from gearlib.language.expressions import real_symbol, time

Floats = NDArray[np.float64]
SOON, FOREVER = 1.0, 1e12  # s
SMALL = 1e-12  # of its sinusoids: what a signal is off its mean by rounding


def off_mean(group: EquationGroup, parameters: Floats) -> Floats:
    """How far the residuals of equations are off their mean over time, at time 0 and with constant variables.

    NaN where there is no mean: a step, a ramp, a table, a coefficient that varies.
    """
    if not group.template.timed:
        return np.zeros(len(group))
    return np.array([np.nan if means is None else means[0] for means in _means(group, parameters)])


def ripples(group: EquationGroup, parameters: Floats) -> NDArray[np.bool_]:
    """Which equations of a group swing with time about a mean, with constant variables."""
    return np.array([means is not None and means[1] > 0.0 for means in _means(group, parameters)])


def _means(group: EquationGroup, parameters: Floats) -> Iterator[tuple[float, float] | None]:
    """What equations are off their mean over time at time 0, and their largest swing; None where there is no mean."""
    symbols = [real_symbol(name) for name in group.template.parameters]
    for own in parameters[group.parameters].tolist():
        yield _mean(group.template, dict(zip(symbols, map(sympy.Float, own), strict=True)))


def _mean(template: Template, given: dict[Any, Any]) -> tuple[float, float] | None:
    if any(time in slope.free_symbols for slope in template.slopes):
        return None
    try:
        states = {
            relation_symbol(k): _state(r.g.xreplace(given), r.negated)
            for k, r in enumerate(template.relations)
            if time in r.g.free_symbols
        }
        alone = template.rest.xreplace({**given, **states}).as_independent(time, as_Add=True)[1]
        signal = parse(alone, 0.0)
    except OutsideClassError:
        return None
    mean = mean_value(signal)
    if mean is None:
        return None
    off, size = value(signal, 0.0) - mean, sum(abs(c) for powers in signal.values() for c in powers)
    swing = size - abs(mean)
    return (off if abs(off) > SMALL * size else 0.0), (swing if swing > SMALL * size else 0.0)


def _state(g: Any, negated: bool) -> Any:
    """Whether a comparison of time holds from time 0 on for ever."""
    if g.free_symbols != {time}:
        raise OutsideClassError(f"{g} depends on more than time")
    if any(len(switch_times(g > 0, 0.0, end)) for end in (SOON, FOREVER)):  # what is close to zero is none among large times
        raise OutsideClassError(f"{g} changes its sign")
    return sympy.Integer(bool(g.subs(time, SOON) < 0 if negated else g.subs(time, SOON) > 0))


def held_in_time(model: FlatModel, parameters: Floats, means: bool) -> list[str]:
    """Inputs and components, by path, that count with their value at time 0 in a steady motion, although they change with time.

    ``means``: whether what has a mean counts with that; otherwise it counts as at time 0, too, unless it has its mean there.
    """
    bound: set[int] = set()
    found: set[str] = set()
    for g, group in enumerate(model.groups):
        template = group.template
        if template.timed:
            off = off_mean(group, parameters)
            rows = np.flatnonzero(np.isnan(off) if means else off != 0.0).tolist()
            if template.binds:
                bound.update(group.variables[rows, template.locals.index("bound")].tolist())
            else:
                found.update(model.owner(g, i) for i in rows)
    inputs = [
        (model.name(v), int(model.representative[v]))
        for instance in model.instances if bound
        for v, declared in enumerate(instance.declared.variables.values(), instance.first_variable)
        if isinstance(declared, Input) and int(model.representative[v]) in bound
    ]  # fmt: skip
    first: dict[int, str] = {}
    for name, v in sorted(inputs, key=lambda each: alphabetical(each[0])):
        first.setdefault(v, name)
    return sorted({*found, *first.values()}, key=alphabetical)


def in_words(names: Sequence[str]) -> str:
    """What a warning says of these."""
    if len(names) > 1:
        return "change with time, and count with their values at t = 0"
    return "changes with time, and counts with its value at t = 0"
