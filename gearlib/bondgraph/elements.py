"""Elements of bond graphs: sources, storage, dissipation, transformers and junctions.

An element is made once and identified by the bonds that end on it; two elements with equal contents are distinct. A parameter is a
number, the name of a symbol, or a sympy expression; if omitted, it is named by the paper's letter and the bond number: ``I()`` on bond
17 is the inertia I_17.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from typing import Any

import sympy as sp

from gearlib.arguments import is_real, shown, whole
from gearlib.errors import ArgumentError

__all__ = ["GY", "TF", "C", "Element", "I", "Junction", "MSe", "MSf", "One", "R", "Se", "Sf", "Zero", "energy_symbol", "time"]

time: Any = sp.Symbol("t", real=True)
"""Time (s), for the expressions of modulated elements."""


def symbol(name: str) -> Any:
    """A real symbol with a given name."""
    return sp.Symbol(name, real=True)


def energy_symbol(kind: str, bond: int) -> Any:
    """The momentum ``p`` or displacement ``q`` stored on a bond, for use in modulated elements.

    >>> energy_symbol("q", 6)
    q_6
    """
    if not (isinstance(kind, str) and kind in ("p", "q")):
        raise ArgumentError(f"energy_symbol: kind is {shown(kind)}; expected 'p' or 'q'")
    return symbol(f"{kind}_{whole('energy_symbol: bond', bond, 0)}")


def expression(value: Any, default: str) -> Any:
    """The parameter ``value`` of an element as a sympy expression; None stands for a symbol named ``default``."""
    if value is None:
        return symbol(default)
    if isinstance(value, str):
        return symbol(value)
    return checked(value, default, "a number, the name of a parameter, or an expression")


def checked(value: Any, name: str, expected: str = "a number or an expression") -> Any:
    """A number or an expression in sympy's form; strings, which sympy would execute, are refused."""
    if not isinstance(value, sp.Expr) and not is_real(value):
        if isinstance(value, Real) and not isinstance(value, bool):
            expected = "a finite number"
        raise ArgumentError(f"{name} is {shown(value)}; expected {expected}")
    found = sp.sympify(value)
    if found.has(sp.nan, sp.zoo, sp.oo, -sp.oo, sp.I):
        raise ArgumentError(f"{name} is {shown(value)}; expected a finite real number or expression")
    return found


def by_law(law: Callable[[Any], Any], argument: Any, said: str) -> Any:
    """Result of a user-defined law."""
    try:
        value = law(argument)
    except Exception as problem:
        raise ArgumentError(f"{said} raised {type(problem).__name__}: {problem}") from problem
    return checked(value, said)


def _check_laws(element: Element, *names: str) -> None:
    for name in names:
        law = getattr(element, name)
        if law is not None and (isinstance(law, type) or not callable(law)):
            raise ArgumentError(f"{element.kind}: {name} is {shown(law)}; expected a function of one expression")


@dataclass(frozen=True, eq=False)
class Element:
    """Base of all elements."""

    @property
    def kind(self) -> str:
        """Letters of the element in a drawing."""
        return type(self).__name__


@dataclass(frozen=True, eq=False)
class Se(Element):
    """Effort source. Without a value it is an input of the system, named ``Se_1`` on bond 1."""

    value: Any = None


@dataclass(frozen=True, eq=False)
class Sf(Element):
    """Flow source. Without a value it is an input of the system, named ``Sf_8`` on bond 8."""

    value: Any = None


@dataclass(frozen=True, eq=False)
class MSe(Se):
    """Modulated effort source: its value is an expression of :data:`time` and of stored p and q."""


@dataclass(frozen=True, eq=False)
class MSf(Sf):
    """Modulated flow source: its value is an expression of :data:`time` and of stored p and q."""


@dataclass(frozen=True, eq=False)
class Storage(Element):
    """Base of I and C.

    Parameters
    ----------
    value : number, str or expression, optional
        Inertia or compliance of the linear law.
    law : callable, optional
        Constitutive law replacing the linear one: f = law(p) for an inertia, e = law(q) for a compliance. It is called with a sympy
        symbol and returns an expression.
    inverse : callable, optional
        The law solved for p or q, required if a nonlinear storage element gets derivative causality.
    """

    value: Any = None
    law: Callable[[Any], Any] | None = None
    inverse: Callable[[Any], Any] | None = None

    def __post_init__(self) -> None:
        _check_laws(self, "law", "inverse")


@dataclass(frozen=True, eq=False)
class I(Storage):  # noqa: E742  (the letter of the field)
    """Inertia: f = p / I, or f = law(p)."""


@dataclass(frozen=True, eq=False)
class C(Storage):
    """Compliance: e = q / C, or e = law(q). ``C(law=lambda q: 0)`` merely integrates a displacement."""


@dataclass(frozen=True, eq=False)
class R(Element):
    """Resistance: e = R f, or e = law(f), or f = conductance(e).

    A nonlinear law is evaluated in the direction in which it is given, if causality permits.

    Parameters
    ----------
    value : number, str or expression, optional
        Resistance of the linear law.
    law, conductance : callable, optional
        Nonlinear law for the effort as a function of the flow, or vice versa, called with a sympy symbol. If both are given, they must
        be inverses.
    """

    value: Any = None
    law: Callable[[Any], Any] | None = None
    conductance: Callable[[Any], Any] | None = None

    def __post_init__(self) -> None:
        _check_laws(self, "law", "conductance")


@dataclass(frozen=True, eq=False)
class TF(Element):
    """Transformer: with bond 1 pointing in and bond 2 pointing out, f2 = m f1 and e1 = m e2.

    Parameters
    ----------
    modulus : number, str or expression
        m; it may depend on :data:`time` and on stored p and q.
    """

    modulus: Any


@dataclass(frozen=True, eq=False)
class GY(Element):
    """Gyrator: with bond 1 pointing in and bond 2 pointing out, e1 = r f2 and e2 = r f1.

    Parameters
    ----------
    modulus : number, str or expression
        r; it may depend on :data:`time` and on stored p and q.
    """

    modulus: Any


@dataclass(frozen=True, eq=False)
class Junction(Element):
    """Base of the junctions.

    Parameters
    ----------
    name : str
        Name in messages and drawings.
    """

    name: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise ArgumentError(f"{type(self).__name__}: name is {shown(self.name)}; expected text, such as 'rotor'")


@dataclass(frozen=True, eq=False)
class Zero(Junction):
    """0-junction: one effort; the flows, counted along the half arrows, sum to zero."""

    @property
    def kind(self) -> str:
        """Digit in a drawing."""
        return "0"


@dataclass(frozen=True, eq=False)
class One(Junction):
    """1-junction: one flow; the efforts, counted along the half arrows, sum to zero."""

    @property
    def kind(self) -> str:
        """Digit in a drawing."""
        return "1"
