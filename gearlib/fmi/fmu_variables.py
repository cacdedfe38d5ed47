"""Variables of an FMU: names, value references, units, start values; the source of both versions of the model description."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from gearlib.equations.template import parse_column
from gearlib.fmi.exported_model import ExportedModel, following_events
from gearlib.language.declarations import Parameter, Variable
from gearlib.run.scene import node_name

INFINITE = float("inf")


@dataclass(frozen=True)
class FmuVariable:
    """A variable as FMI describes it.

    Attributes
    ----------
    name : str
    reference : int
        Its value reference.
    causality, variability, initial : str
        As in FMI; ``initial`` is empty where FMI does not allow it.
    unit, description : str
    start : float or None
    lower, upper, nominal : float
    derivative : int or None
        Value reference of the state that it is the derivative of.
    """

    name: str
    reference: int
    causality: str
    variability: str
    initial: str = ""
    unit: str = "1"
    description: str = ""
    start: float | None = None
    lower: float = -INFINITE
    upper: float = INFINITE
    nominal: float = 1.0
    derivative: int | None = None


@dataclass(frozen=True)
class FmuVariables:
    """All variables of an FMU, with those listed in its model structure.

    Attributes
    ----------
    listed : tuple of FmuVariable
    states, derivatives : tuple of int
        Value references, in the order of the states.
    outputs : tuple of int
        Value references of all outputs, including states.
    inputs : tuple of int
    indicators : tuple of int
    observed : mapping of int to int
        For each derivative and output: its row in the sparsity pattern of the derivatives, if that tells all that it depends on.
    columns : tuple of int
        Value references of the pattern's columns.
    """

    listed: tuple[FmuVariable, ...]
    states: tuple[int, ...]
    derivatives: tuple[int, ...]
    outputs: tuple[int, ...]
    inputs: tuple[int, ...]
    indicators: tuple[int, ...]
    observed: dict[int, int]
    columns: tuple[int, ...]


def fmu_variables(exported: ExportedModel, n_indicators: int) -> FmuVariables:
    """Describe the variables of an exported model; the numbering of value references is defined in ``wrapper/model.h``."""
    found = [FmuVariable("time", 0, "independent", "continuous", unit="s", description="time")]
    found += _parameters(exported)
    at = 1 + len(exported.parameters)
    inputs = tuple(range(at, at + len(exported.inputs)))
    found += _inputs(exported, inputs)
    at += len(inputs)
    count = max(len(exported.scene.states), 1)
    states = tuple(range(at, at + count))
    found += _states(exported, states)
    rates = _rates(exported, states, at + count)
    found += rates.values()
    derivatives = tuple(rates[i].reference if i in rates else states[place] for i, place in _followed(exported, count).items())
    observed = {reference: i for i, reference in enumerate(derivatives)} if exported.scene.states else {}
    at += 2 * count
    outputs = [v.reference for v in found if v.causality == "output"]
    switched = following_events(exported.observed)
    for k, output in enumerate(exported.outputs):
        of = (exported.model.declaration(output.variable) if output.variable >= 0 else None) or Variable()
        kind = "continuous" if output.discrete < 0 else "discrete"
        unit, text = differentiated_unit(of.unit, output.order), _described(of.description, output.order)
        found.append(FmuVariable(_spelled(output.name), at + k, "output", kind, "calculated", unit, text))
        outputs.append(at + k)
        if output.slot >= 0 and not switched[exported.observed.output_slots[output.slot]]:
            observed[at + k] = output.slot
    at += len(exported.outputs)
    indicators = tuple(range(at, at + n_indicators))
    found += [
        FmuVariable(f"event_indicators[{k}]", r, "local", "continuous", "calculated", description="event indicator")
        for k, r in enumerate(indicators)
    ]
    columns = (*(states if exported.scene.states else ()), *inputs)
    return FmuVariables(tuple(found), states, derivatives, tuple(outputs), inputs, indicators, observed, columns)


def _parameters(exported: ExportedModel) -> Iterator[FmuVariable]:
    model, table = exported.model, exported.model.parameters
    declared = {
        (f"{i.path}.{name}" if i.path else name): p for i in model.instances for name, p in i.declared.parameters.items()
    }
    for reference, p in enumerate(exported.parameters, 1):
        known = declared.get(table.names[p], Parameter())
        kinds, description, start = ("parameter", "tunable", "exact"), known.description, float(exported.numbers[p])
        if p in exported.constants:
            kinds, description = ("local", "constant", "exact"), f"{description} (constant: {exported.constants[p]})".strip()
        elif p in exported.dependent:
            kinds = ("calculatedParameter", "tunable", "calculated")
        if kinds[1] == "tunable" and p in exported.fixed:
            kinds = (kinds[0], "fixed", kinds[2])
        yield FmuVariable(
            table.names[p], reference, *kinds, known.unit, description, None if kinds[2] == "calculated" else start,
            float(table.lower[p]), float(table.upper[p]),
        )  # fmt: skip


def _inputs(exported: ExportedModel, references: Sequence[int]) -> Iterator[FmuVariable]:
    for reference, k in zip(references, exported.inputs, strict=True):
        of = exported.model.declaration(int(exported.model.inputs[k])) or Variable()
        name, start = exported.translation.inputs[k], float(exported.input_starts[k])
        yield FmuVariable(name, reference, "input", "continuous", "", of.unit, of.description, start)


def _states(exported: ExportedModel, references: Sequence[int]) -> Iterator[FmuVariable]:
    scene, model = exported.scene, exported.model
    if not scene.states:
        text = "stands still: the model has no state"
        yield FmuVariable("no_state", references[0], "local", "continuous", "exact", "1", text, 0.0)
    place = scene.place_of
    for i, (v, order) in enumerate(scene.states):
        of, own, lower = model.declaration(v) or Variable(), exported.own_starts[i], place.get((v, order - 1))
        yield FmuVariable(
            _spelled(scene.state_names[i]), references[i], "output" if scene.state_names[i] in exported.names else "local",
            "continuous", "exact" if own else "calculated", differentiated_unit(of.unit, order), _described(of.description, order),
            float(exported.start[i]) if own else None, of.min if not order else -INFINITE, nominal=float(scene.nominal[i]),
            derivative=None if lower is None else references[lower],
        )  # fmt: skip


def _followed(exported: ExportedModel, count: int) -> dict[int, int]:
    """For each state the index of its derivative among the states, -1 if that is not a state."""
    scene = exported.scene
    return {
        i: scene.place_of.get((scene.states[i][0], scene.states[i][1] + 1), -1) if scene.states else -1 for i in range(count)
    }


def _rates(exported: ExportedModel, states: Sequence[int], first: int) -> dict[int, FmuVariable]:
    """Derivatives of states that are not states themselves, by index."""
    scene, model = exported.scene, exported.model
    found = {}
    for i, higher in _followed(exported, len(states)).items():
        if higher >= 0:
            continue
        v, order = scene.states[i] if scene.states else (-1, 0)
        of = (model.declaration(v) if v >= 0 else None) or Variable()
        name = node_name(model, (v, order + 1)) if v >= 0 else "der(no_state)"
        found[i] = FmuVariable(
            _spelled(name), first + i, "output" if name in exported.names else "local", "continuous", "calculated",
            differentiated_unit(of.unit, order + 1), _described(of.description, order + 1), derivative=states[i],
        )  # fmt: skip
    return found


def _spelled(name: str) -> str:
    """A name in FMI syntax: ``der(x,2)`` for ``der(der(x))``.

    >>> _spelled("der(der(load.phi))"), _spelled("load.w")
    ('der(load.phi,2)', 'load.w')
    """
    base, order = parse_column(name)
    return f"der({base}{f',{order}' if order > 1 else ''})" if order else name


def differentiated_unit(unit: str, order: int) -> str:
    """Unit of a derivative.

    >>> differentiated_unit("rad/s", 1), differentiated_unit("N.m", 1), differentiated_unit("N/m", 1)
    ('rad/s2', 'N.m/s', 'N/(m.s)')
    """
    if unit == "any" or not order:
        return unit
    above, stroke, below = unit.partition("/")
    seconds, below = "s" if order == 1 else f"s{order}", below.strip("()")
    if not stroke:
        return f"{above}/{seconds}"
    if re.fullmatch(r"s\d*", below):
        return f"{above}/s{int(below[1:] or 1) + order}"
    return f"{above}/({below}.{seconds})"


def _described(description: str, order: int) -> str:
    which = {1: "derivative", 2: "second derivative"}.get(order, f"{order}. derivative")
    return f"{which} of {description}" if order and description else description
