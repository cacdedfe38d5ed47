"""Explicit state equations of a bond graph with assigned causality, in symbolic form.

There are two forms. The *printed* form is the one found in papers: p' and q' of the storage elements with integral causality, in terms
of all p and q, of the rates of those with derivative causality, and of the sources. The *solved* form eliminates the latter: with the
dependent p = g(x, u, t), so that p' = dg/dx x' + dg/du u' + dg/dt, all x' and the outputs z of resistances in algebraic loops solve
residual(x', z; x, u, u', t) = 0, which is linear, M y = b with y = (x', z), unless a loop contains a nonlinear resistance.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import sympy as sp

from gearlib.arguments import flag, shown, whole
from gearlib.bondgraph.causality import Causality, assign_causality, evaluation_order
from gearlib.bondgraph.efforts_and_flows import Traversal, rate_of
from gearlib.bondgraph.elements import C, I, Se, Sf, symbol, time
from gearlib.bondgraph.graph import BondGraph, check_graph
from gearlib.bondgraph.symbolic_solution import solved_by_blocks
from gearlib.errors import ArgumentError, SingularError

__all__ = ["StateEquations", "state_equations"]


@dataclass(frozen=True)
class StateEquations:
    """State equations of a bond graph.

    Parameters
    ----------
    graph, causality : BondGraph, Causality
        The graph and causality from which they were derived.
    states, dependent : tuple of Symbol
        p and q with integral and with derivative causality, by bond.
    inputs : tuple of Symbol
        Sources without a value.
    parameters : tuple of Symbol
        All other symbols, by name.
    tears : tuple of Symbol
        Tearing variables: efforts and flows that are unknown because of algebraic loops.
    printed : mapping
        Rate of each state as an expanded expression of states, dependent p and q, their rates, inputs and tears.
    dependent_values : mapping
        Each dependent p or q in terms of the states and the inputs.
    tear_values : mapping
        One equation for each tear, in terms of the same symbols as ``printed``.
    efforts, flows : mapping
        Effort and flow of every bond, in terms of the same symbols as ``printed``.
    """

    graph: BondGraph
    causality: Causality
    states: tuple[Any, ...]
    dependent: tuple[Any, ...]
    inputs: tuple[Any, ...]
    parameters: tuple[Any, ...]
    tears: tuple[Any, ...]
    printed: Mapping[Any, Any]
    dependent_values: Mapping[Any, Any]
    tear_values: Mapping[Any, Any]
    efforts: Mapping[int, Any]
    flows: Mapping[int, Any]

    @cached_property
    def unknowns(self) -> tuple[Any, ...]:
        """The vector y = (x', z)."""
        return (*map(rate_of, self.states), *self.tears)

    @cached_property
    def elimination(self) -> Mapping[Any, Any]:
        """Substitutions for the dependent p and q and their rates: expressions of states, inputs and unknowns."""
        values: dict[Any, Any] = dict(self.dependent_values)
        for variable, value in self.dependent_values.items():
            total = sp.diff(value, time)
            for x in (*self.states, *self.inputs):
                total += sp.diff(value, x) * rate_of(x)
            values[rate_of(variable)] = total
        return MappingProxyType(values)

    @cached_property
    def residual(self) -> tuple[Any, ...]:
        """Residuals: unknowns minus their values, with the dependent p and q eliminated."""
        values = [*self.printed.values(), *self.tear_values.values()]
        return tuple(y - value.xreplace(dict(self.elimination)) for y, value in zip(self.unknowns, values, strict=True))

    @cached_property
    def mass_matrix(self) -> Any:
        """M of M y = b; for a nonlinear system, the Jacobian of the residual."""
        return sp.Matrix([[sp.expand(sp.diff(r, y)) for y in self.unknowns] for r in self.residual])

    @cached_property
    def right_side(self) -> Any:
        """The vector b of M y = b, in terms of states, inputs, their rates and time."""
        zero = dict.fromkeys(self.unknowns, sp.Integer(0))
        return sp.Matrix([sp.expand(-r.xreplace(zero)) for r in self.residual])

    @cached_property
    def is_linear_in_unknowns(self) -> bool:
        """Whether a single linear solve gives x'."""
        return not (self.mass_matrix.free_symbols & set(self.unknowns))

    def explicit(self) -> dict[Any, Any]:
        """Each state's rate as an expression of states, inputs and their rates: the solved form, in symbols.

        The mass matrix is solved block by block, without expanding the sums in it: :meth:`latex` prints each subexpression shared by
        several rates once.

        Raises
        ------
        SingularError
            The mass matrix is singular, or a loop contains a nonlinear resistance.

        >>> from gearlib.bondgraph import BondGraph, I, One, Se, state_equations
        >>> v = One("v")
        >>> state_equations(BondGraph((1, Se(), v), (2, v, I()), (3, v, I()))).explicit()
        {dp_2: I_2*Se_1/(I_2 + I_3)}
        """
        if not self.is_linear_in_unknowns:
            raise SingularError(f"{self.graph.name}: a loop with a nonlinear resistance has no solution in symbols")
        try:
            solution = solved_by_blocks(self.mass_matrix, self.right_side)
        except ZeroDivisionError:
            raise SingularError(f"{self.graph.name}: the mass matrix has no inverse") from None
        return dict(zip(map(rate_of, self.states), solution, strict=False))

    def latex(self, *, solved: bool = False, terms: int = 5) -> str:
        r"""The equations as LaTeX, in one ``aligned`` block, with dots for rates and the bond numbers.

        Parameters
        ----------
        solved : bool
            Print the solved form instead of the printed one: see :meth:`explicit`. Sums that occur more than once are printed once,
            first, as :math:`s_1, s_2, \ldots`
        terms : int
            Terms per line of the printed form, in which each variable occurs once, with its coefficient.

        >>> from gearlib.bondgraph import BondGraph, C, I, One, Se, state_equations
        >>> v = One("v")
        >>> print(state_equations(BondGraph((1, Se(), v), (2, v, I()), (3, v, C()))).latex())
        \begin{aligned}
        \dot{p}_{2} &= - \frac{1}{C_{3}} q_{3} + Se_{1} \\
        \dot{q}_{3} &= \frac{1}{I_{2}} p_{2}
        \end{aligned}
        """
        variables = [*sorted((*self.states, *self.dependent), key=lambda v: int(v.name[2:])), *self.tears, *self.inputs]
        variables += [rate_of(v) for v in (*self.dependent, *self.inputs)]
        names = {rate_of(v): rf"\dot{{{v.name[0]}}}_{{{v.name[2:]}}}" for v in (*self.states, *self.dependent)}
        names |= {rate_of(v): rf"\dot{{{v.name[:2]}}}_{{{v.name[3:]}}}" for v in self.inputs}
        whole("terms", terms, 1)
        if flag("solved", solved):
            shared = _with_shared_sums(self.explicit())
            sides = [
                (y, _terms(value, variables, names) if value.is_Add else [sp.latex(value, symbol_names=names)])
                for y, value in shared
            ]
        else:
            rows = {rate_of(x): value for x, value in self.printed.items()} | dict(self.tear_values)
            sides = [(y, _terms(value, variables, names)) for y, value in rows.items()]
        lines = []
        for y, parts in sides:
            pieces = [" ".join(parts[k : k + terms]) for k in range(0, len(parts), terms)]
            lines.append(f"{sp.latex(y, symbol_names=names)} &= " + " \\\\\n&\\quad ".join(pieces))
        return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"


def _with_shared_sums(values: Mapping[Any, Any]) -> list[tuple[Any, Any]]:
    """The values as equations, preceded by equations for sums that occur at least twice."""
    replaced, reduced = sp.cse([*values.values()], symbols=sp.numbered_symbols(cls=sp.Dummy))
    inlined: dict[Any, Any] = {}
    sums: list[tuple[Any, Any]] = []
    for name, value in replaced:
        if value.is_Add:
            sums.append((symbol(f"s_{len(sums) + 1}"), value.xreplace(inlined)))
            inlined[name] = sums[-1][0]
        else:
            inlined[name] = value.xreplace(inlined)
    return [*sums, *zip(values, (value.xreplace(inlined) for value in reduced), strict=True)]


def _terms(value: Any, variables: list[Any], names: Mapping[Any, str]) -> list[str]:
    """Terms ``+ coefficient variable`` of an expanded expression, in the order of the variables."""
    if value == 0:
        return ["0"]
    found = sp.collect(value, variables, evaluate=False)
    place = {variable: k for k, variable in enumerate(variables)}
    parts: list[str] = []
    for variable in sorted(found, key=lambda v: (place.get(v, len(place)), str(v))):
        minus = all(term.could_extract_minus_sign() for term in sp.Add.make_args(found[variable]))
        coefficient = sp.together(-found[variable] if minus else found[variable])
        factors = [sp.latex(c, symbol_names=names) for c in (coefficient, variable) if c != 1]
        if coefficient.is_Add and variable != 1:
            factors[0] = rf"\left({factors[0]}\right)"
        sign = "- " if minus else "+ " if parts else ""
        parts.append(sign + (" ".join(factors) or "1"))
    return parts


def state_equations(graph: BondGraph, prefer: Iterable[int] = (), causality: Causality | None = None) -> StateEquations:
    """Explicit state equations of a bond graph.

    Parameters
    ----------
    graph : BondGraph
        The graph.
    prefer : iterable of int
        Bonds of storage elements to be preferred as states: see :func:`~gearlib.bondgraph.assign_causality`.
    causality : Causality, optional
        An existing assignment, instead of ``prefer``.

    Returns
    -------
    StateEquations
        The printed and the solved form.

    Raises
    ------
    BalanceError
        No causality fits the graph.
    DeclarationError
        A nonlinear law is needed in the direction in which it is not given, and cannot be inverted.
    SingularError
        With these moduli a rigid loop is locked, or the preferred states are dependent.

    Examples
    --------
    >>> from gearlib.bondgraph import BondGraph, C, I, One, R, Se, state_equations
    >>> v = One("v")
    >>> equations = state_equations(BondGraph((1, Se(), v), (2, v, I()), (3, v, C()), (4, v, R())))
    >>> equations.printed
    mappingproxy({p_2: Se_1 - R_4*p_2/I_2 - q_3/C_3, q_3: p_2/I_2})
    """
    check_graph(graph)
    if causality is None:
        causality = assign_causality(graph, prefer)
    elif not isinstance(causality, Causality) or causality.effort_to.keys() != graph.bonds.keys():
        raise ArgumentError(
            f"{graph.name}: causality is {shown(causality)}; expected the result of assign_causality for this graph"
        )
    traversal = Traversal(graph, causality, evaluation_order(graph, causality), own_law=True)
    imposed = [("f" if isinstance(graph.element(n, I, C), I) else "e", n) for n in causality.derivative]
    straight = Traversal(graph, causality, evaluation_order(graph, causality, imposed), own_law=False)
    states = {n: traversal.energy(n) for n in causality.integral}
    rates = {x: sp.expand(traversal(("e" if x.name[0] == "p" else "f", n))) for n, x in states.items()}
    dependent = {traversal.energy(n): sp.expand(straight.stored(n)) for n in causality.derivative}
    tears = {traversal.tear(q): sp.expand(traversal.set_value(q)) for q in causality.tears}
    dependent = _without_tears(dependent, straight)
    inputs = tuple(symbol(f"{'Se' if isinstance(graph.element(n, Se, Sf), Se) else 'Sf'}_{n}") for n in _open_sources(graph))
    efforts = {n: traversal(("e", n)) for n in graph.bonds}
    flows = {n: traversal(("f", n)) for n in graph.bonds}
    known = {*states.values(), *dependent, *map(rate_of, dependent), *inputs, *tears, time}
    everything = [*rates.values(), *dependent.values(), *tears.values(), *efforts.values(), *flows.values()]
    parameters = set().union(*(value.free_symbols for value in everything)) - known
    return StateEquations(
        graph, causality, tuple(states.values()), tuple(dependent), inputs, tuple(sorted(parameters, key=str)), tuple(tears),
        MappingProxyType(rates), MappingProxyType(dependent), MappingProxyType(tears), MappingProxyType(efforts),
        MappingProxyType(flows),
    )  # fmt: skip


def _without_tears(dependent: dict[Any, Any], straight: Traversal) -> dict[Any, Any]:
    """Dependent p and q in terms of states and inputs alone.

    In a rigid loop the flows depend on each other cyclically, and are solved for here. Such a loop contains no resistance: the
    procedure would have given the storage element integral causality and let the resistance follow.
    """
    name, tears = straight.graph.name, {straight.tear(q): q for q in straight.causality.tears}
    values: dict[Any, Any] = {}
    used = [symbol for value in dependent.values() for symbol in sorted(value.free_symbols & tears.keys(), key=str)]
    for z in used:  # grows during iteration
        if z not in values:
            values[z] = sp.expand(straight.set_value(tears[z]))
            used += sorted(values[z].free_symbols & tears.keys(), key=str)
    unsettled = {*dependent, *map(rate_of, dependent)}
    if any(value.free_symbols & unsettled for value in (*dependent.values(), *values.values())):
        raise SingularError(f"{name}: {', '.join(map(str, dependent))} depend on each other's rates")
    if not values:
        return dependent
    loop = ", ".join(map(str, values))
    try:
        matrix, vector = sp.linear_eq_to_matrix([z - value for z, value in values.items()], *values)
        solution = dict(zip(values, matrix.LUsolve(vector, iszerofunc=_vanishes), strict=True))
    except (ValueError, ZeroDivisionError):
        raise SingularError(
            f"{name}: {', '.join(map(str, dependent))} do not follow from the states through the loop of {loop}: with these moduli "
            "the train is locked, or some of the states depend on each other and others must be preferred"
        ) from None
    return {p: sp.together(value.xreplace(solution)) for p, value in dependent.items()}


def _vanishes(value: Any) -> bool:
    """Whether a pivot is zero, up to rounding if it is a number."""
    return bool(abs(value) < 1e-12) if value.is_number else bool(sp.simplify(value) == 0)


def _open_sources(graph: BondGraph) -> list[int]:
    return [n for n in graph.of_kind(Se, Sf) if getattr(graph.element(n, Se, Sf), "value", None) is None]
