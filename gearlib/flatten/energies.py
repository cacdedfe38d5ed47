"""Energy terms of a model's components: declared energies, and the power through their connectors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy

from gearlib.equations.class_record import descend
from gearlib.equations.kernel import array_function
from gearlib.equations.template import checked, parse_column, piecewise
from gearlib.errors import DeclarationError, nearest
from gearlib.language.component import Component, energies_of
from gearlib.language.declarations import Connector, Flow, Potential, declared_by
from gearlib.language.expressions import real_symbol, time
from gearlib.language.interior import connections_of, parts_of, reads_parts
from gearlib.language.units import dimension

ENERGY, POWER = dimension("J"), dimension("W")


@dataclass(frozen=True)
class Formula:
    """An energy or power in the names of a component's own scope, shared by all components that declare the same.

    Attributes
    ----------
    symbols : tuple of sympy.Symbol
        Its variables, discrete variables and parameters, sorted by name.
    expression : sympy.Expr
    """

    symbols: tuple[Any, ...]
    expression: Any

    @cached_property
    def function(self) -> Callable[..., Any]:
        """A function of the values in the order of ``symbols``; generated on first use."""
        return array_function(self.symbols, self.expression)


@dataclass(frozen=True)
class Term:
    """A formula for one component.

    Attributes
    ----------
    names : tuple of str
        Paths, or ``"der(path)"``, of the formula's symbols; ``"time"`` for time.
    formula : Formula
    """

    names: tuple[str, ...]
    formula: Formula

    @property
    def function(self) -> Callable[..., Any]:
        """A function of the values in the order of ``names``."""
        return self.formula.function


NOTHING = Term((), Formula((), sympy.S.Zero))


@dataclass(frozen=True)
class Audited:
    """Energy terms of one component.

    Attributes
    ----------
    path, kind : str
        Path and class of the component.
    through : Term
        Power that flows in through all mechanical connectors, W.
    heat_in : Term or None
        Heat that flows in through its heat ports if it has other connectors, too, W.
    stored, heat, supplied : Term or None
        As declared; None where nothing is.
    declares, source : bool
        Whether it declares what it stores and loses; whether power out of its connectors counts as work put in.
    unknown : bool
        Whether it has a connector whose power is not known.
    """

    path: str
    kind: str
    through: Term
    heat_in: Term | None
    stored: Term | None
    heat: Term | None
    supplied: Term | None
    declares: bool
    source: bool
    unknown: bool

    @property
    def terms(self) -> list[Term]:
        return [t for t in (self.through, self.heat_in, self.stored, self.heat, self.supplied) if t is not None]


@reads_parts
def audited(root: Component) -> tuple[Audited, ...]:
    """All components that exchange, store or dissipate energy; `Translation.energies` has those of a compiled model."""
    found = []
    formulas: dict[Any, Formula] = {}
    for component, path in _components(root):
        connectors = {} if parts_of(component) else declared_by(component).connectors  # a composite merely passes power on
        energies = energies_of(component)
        if not connectors and energies is None:
            continue
        work, thermal, unknown = sympy.S.Zero, sympy.S.Zero, False
        for name, connector in connectors.items():
            powers = _powers(name, connector)
            unknown = unknown or powers is None
            for power, is_heat in powers or ():
                work, thermal = (work, thermal + power) if is_heat else (work + power, thermal)
        if work == 0:
            work, thermal = thermal, sympy.S.Zero

        def term(expression: Any, what: str, component: Component = component, path: str = path) -> Term | None:
            value = sympy.sympify(expression)
            return None if value == 0 else _term(component, path, value, f"{type(component).__name__}: {what}", formulas)

        found.append(
            Audited(
                path or type(component).__name__, type(component).__name__,
                term(work, "power") or NOTHING, term(thermal, "heat flow"),
                None if energies is None else term(energies.stored, "stored energy"),
                None if energies is None else term(energies.heat, "heat"),
                None if energies is None else term(energies.supplied, "supplied power"),
                energies is not None, energies is not None and energies.source, unknown,
            )
        )  # fmt: skip
    return tuple(found)


def _components(root: Component) -> Iterator[tuple[Component, str]]:
    stack = [(root, "")]
    while stack:
        component, path = stack.pop()
        connections_of(component)
        yield component, path
        prefix = f"{path}." if path else ""
        stack += [(part, prefix + name) for name, part in reversed(parts_of(component).items())]


def _powers(name: str, connector: Connector) -> list[tuple[Any, bool]] | None:
    """The powers into a component through a connector, each with whether it is heat; None if unknown.

    Potentials and flows are paired in the order of their declaration. A flow in W is a power, and so is a product of both in W; if the
    product is in J, the potential is a displacement.
    """
    potentials = [(n, v.unit) for n, v in connector.variables.items() if isinstance(v, Potential)]
    flows = [(n, v.unit) for n, v in connector.variables.items() if isinstance(v, Flow)]
    if len(potentials) != len(flows):
        return None
    found = []
    for (potential, unit), (flow, flow_unit) in zip(potentials, flows, strict=True):
        across, into = (real_symbol(f"{name}.{n}") for n in (potential, flow))
        try:
            a, b = dimension(unit), dimension(flow_unit)
        except DeclarationError:
            return None
        if a is None or b is None:
            return None
        product = tuple(x + y for x, y in zip(a, b, strict=True))
        if b == POWER:
            found.append((into, True))
        elif product == ENERGY:
            found.append((into * real_symbol(f"der({name}.{potential})"), False))
        elif product == POWER:
            found.append((into * across, False))
        else:
            return None
    return found


def _formula(expression: Any, label: str) -> Formula:
    plain = expression.replace(lambda e: getattr(e.func, "__name__", "") == "no_event", lambda e: e.args[0])
    plain = piecewise(checked(plain, label))
    return Formula(tuple(sorted(plain.free_symbols, key=lambda s: s.name)), plain)


def _term(component: Component, path: str, expression: Any, label: str, formulas: dict[Any, Formula]) -> Term:
    if expression not in formulas:
        formulas[expression] = _formula(expression, label)
    formula = formulas[expression]
    prefix = f"{path}." if path else ""
    names = []
    for symbol in formula.symbols:
        base, order = parse_column(symbol.name)
        if symbol != time and not _declared(component, base):
            raise DeclarationError(
                f"{label} holds '{base}', which is not declared; {nearest(base, declared_by(component).variables)}"
            )
        names.append("time" if symbol == time else "der(" * order + prefix + base + ")" * order)
    return Term(tuple(names), formula)


def _declared(component: Component, name: str) -> bool:
    part, local = descend(component, name)
    found = declared_by(part)
    return local in found.variables or local in found.parameters or local in found.discretes
