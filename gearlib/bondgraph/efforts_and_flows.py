"""Efforts and flows of a bond graph as expressions, by traversing causality from each quantity to its determinants."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from gearlib.arguments import shown
from gearlib.bondgraph.causality import Causality, Quantity
from gearlib.bondgraph.elements import (
    GY,
    TF,
    C,
    Element,
    I,
    Junction,
    R,
    Se,
    Sf,
    Storage,
    Zero,
    by_law,
    energy_symbol,
    expression,
    symbol,
)
from gearlib.bondgraph.graph import Bond, BondGraph
from gearlib.errors import ArgumentError, DeclarationError

__all__ = ["Traversal", "rate_of"]


def rate_of(variable: Any) -> Any:
    """The symbol of a variable's time derivative: ``dp_17`` of ``p_17``."""
    if not isinstance(variable, sp.Symbol):
        raise ArgumentError(f"rate_of: variable is {shown(variable)}; expected a symbol, such as p_17")
    return symbol(f"d{variable.name}")


class Traversal:
    """Efforts and flows as expressions, found by traversal against the causal direction.

    With ``own_law`` the common variable of a junction with a storage element of derivative causality is expressed by that element's own
    p or q, as in the paper (f = p_17 / I_17); otherwise by the independent variables that determine it.
    """

    def __init__(self, graph: BondGraph, causality: Causality, order: Sequence[Quantity], *, own_law: bool) -> None:
        self.graph, self.causality, self.own_law = graph, causality, own_law
        self.known: dict[Quantity, Any] = {}
        for quantity in order:  # avoids deep recursion for any expression
            self(quantity)

    def energy(self, number: int) -> Any:
        """Symbol of the energy variable stored on a bond."""
        return energy_symbol("p" if isinstance(self.graph.element(number, I, C), I) else "q", number)

    def tear(self, quantity: Quantity) -> Any:
        """Symbol of an effort or flow that is unknown because of an algebraic loop."""
        return symbol(f"{quantity[0]}_{quantity[1]}")

    def __call__(self, quantity: Quantity) -> Any:
        """Expression for an effort or flow."""
        if quantity not in self.known:
            self.known[quantity] = self.tear(quantity) if quantity in self.causality.tears else self.set_value(quantity)
        return self.known[quantity]

    def set_value(self, quantity: Quantity) -> Any:
        """The value given to an effort or flow by the element that sets it, even if it is a tearing variable."""
        letter, number = quantity
        bond = self.graph.bonds[number]
        receiver = self.causality.effort_to[number]
        setter = bond.other(receiver) if letter == "e" else receiver
        if isinstance(setter, Junction):
            return self._junction(setter, letter, bond)
        if isinstance(setter, TF | GY):
            return self._two_port(setter, letter, bond)
        if isinstance(setter, R):
            return self._resistance(setter, letter, number)
        if isinstance(setter, Storage):
            integral = number in self.causality.integral
            return _law(setter, self.energy(number)) if integral else rate_of(self.energy(number))
        if isinstance(setter, Se | Sf):
            return expression(setter.value, f"{'Se' if isinstance(setter, Se) else 'Sf'}_{number}")
        raise DeclarationError(f"{self.graph.name}: {self.graph.label(setter)} has no law")

    def stored(self, number: int) -> Any:
        """The energy variable of a storage element, as a function of the flow or effort imposed on it."""
        element = self.graph.element(number, I, C)
        assert isinstance(element, Storage)
        imposed = self(("f" if isinstance(element, I) else "e", number))
        if element.inverse is not None:
            return by_law(element.inverse, imposed, f"the inverse law of {self.graph.label(element)}")
        variable = self.energy(number)
        if element.law is None:
            return imposed * expression(element.value, f"{element.kind}_{number}")
        return _solved(_law(element, variable), variable, imposed, f"{self.graph.name}: {self.graph.label(element)}", "inverse")

    def _junction(self, junction: Junction, letter: str, bond: Bond) -> Any:
        shared = "e" if isinstance(junction, Zero) else "f"
        others = [b for b in self.graph.at(junction) if b is not bond]
        if letter != shared:
            return -bond.sign(junction) * sum(b.sign(junction) * self((letter, b.number)) for b in others)
        for b in others if self.own_law else []:
            element = b.other(junction)
            if isinstance(element, C if shared == "e" else I) and b.number in self.causality.derivative:
                return _law(element, self.energy(b.number))
        strong = next(b for b in others if (self.causality.effort_to[b.number] is junction) == (shared == "e"))
        return self((shared, strong.number))

    def _two_port(self, element: TF | GY, letter: str, bond: Bond) -> Any:
        (other,) = (b for b in self.graph.at(element) if b is not bond)
        m = expression(element.modulus, "modulus")
        if isinstance(element, TF):  # f_out = m f_in, e_in = m e_out
            value = self((letter, other.number))
            return value * m if (bond.tail is element) == (letter == "f") else value / m
        value = self(("f" if letter == "e" else "e", other.number))  # e_in = r f_out, e_out = r f_in
        return value * m if letter == "e" else value / m

    def _resistance(self, element: R, letter: str, number: int) -> Any:
        given = self(("f" if letter == "e" else "e", number))
        direct, reverse = (element.law, element.conductance) if letter == "e" else (element.conductance, element.law)
        if direct is not None:
            return by_law(direct, given, f"the law of {self.graph.label(element)}")
        if reverse is None:
            resistance = expression(element.value, f"R_{number}")
            return given * resistance if letter == "e" else given / resistance
        wanted = symbol(f"{letter}_{number}")
        need = "law" if letter == "e" else "conductance"
        label = f"{self.graph.name}: {self.graph.label(element)}"
        return _solved(by_law(reverse, wanted, f"the law of {label}"), wanted, given, label, need)


def _law(element: Element, variable: Any) -> Any:
    """Flow of an inertia, or effort of a compliance, that stores ``variable``."""
    assert isinstance(element, Storage)
    if element.law is not None:
        return by_law(element.law, variable, f"the law of the {element.kind} that stores {variable}")
    name = f"{element.kind}_{variable.name[2:]}"
    value = expression(element.value, name)
    if value == 0:
        raise ArgumentError(f"{name} is 0; leave the element out, or give it a value")
    return variable / value


def _solved(law: Any, variable: Any, given: Any, label: str, need: str) -> Any:
    """``variable`` from ``law(variable) = given``, if there is exactly one real solution."""
    value = sp.Dummy("given", real=True)
    try:
        solutions = sp.solve(law - value, variable)
    except NotImplementedError:
        solutions = []
    if len(solutions) != 1:
        raise DeclarationError(f"{label} is needed in the other direction than its law gives: state its `{need}`, too")
    return solutions[0].xreplace({value: given})
