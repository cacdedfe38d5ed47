"""Sequential causality assignment procedure (SCAP): which side of each bond sets the effort and which the flow.

Sources come first, then the storage elements in order of preference, each with all its consequences; then resistances, then what is
left. A storage element whose causality has been determined by earlier ones, against its integral form, gets derivative causality: it
contributes no state.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import networkx as nx

from gearlib.arguments import shown, whole
from gearlib.bondgraph.completion import can_be_completed
from gearlib.bondgraph.elements import GY, TF, C, Element, I, Junction, One, R, Se, Sf, Zero
from gearlib.bondgraph.graph import Bond, BondGraph, check_graph
from gearlib.errors import ArgumentError, BalanceError

__all__ = ["Causality", "Quantity", "assign_causality", "evaluation_order"]

Quantity = tuple[str, int]
"""An effort ``("e", bond)`` or a flow ``("f", bond)``."""


@dataclass(frozen=True)
class Causality:
    """Result of the assignment.

    Parameters
    ----------
    effort_to : mapping
        Maps each bond to the element that receives its effort (at the causal stroke); the other end receives its flow.
    integral, derivative : tuple of int
        Bonds of the storage elements with integral and with derivative causality.
    chosen : tuple of int
        Bonds whose causality was arbitrary.
    loops : tuple of tuple of int
        Algebraic loops, each given by the bonds of its resistances, or all its bonds if it contains none.
    tears : tuple of Quantity
        Efforts and flows which, once known, break all algebraic loops.
    """

    effort_to: Mapping[int, Element]
    integral: tuple[int, ...]
    derivative: tuple[int, ...]
    chosen: tuple[int, ...]
    loops: tuple[tuple[int, ...], ...]
    tears: tuple[Quantity, ...]

    def report(self) -> str:
        """The assignment in words.

        >>> from gearlib.bondgraph import BondGraph, I, One, Se, assign_causality
        >>> v = One("v")
        >>> print(assign_causality(BondGraph((1, Se(), v), (2, v, I()), (3, v, I()))).report())
        integral causality: 2
        derivative causality: 3
        algebraic loops: none
        """
        loops = "; ".join(" and ".join(map(str, loop)) for loop in self.loops)
        parts = {"integral causality": self.integral, "derivative causality": self.derivative}
        lines = [f"{name}: {', '.join(map(str, bonds)) or 'none'}" for name, bonds in parts.items()]
        return "\n".join([*lines, f"algebraic loops: {loops or 'none'}"])


class _ConflictError(Exception):
    """Contradictory decisions: the bonds involved, what they set or leave, and through which bonds."""

    def __init__(self, bonds: Iterable[int], what: str, through: str = "") -> None:
        self.bonds, self.what, self.through = tuple(dict.fromkeys(bonds)), what, through


class _Assignment:
    """Causal strokes set so far, and the bond whose choice led to each."""

    def __init__(self, graph: BondGraph) -> None:
        self.graph = graph
        self.effort_to: dict[int, Element] = {}
        self.because: dict[int, int] = {}

    def copy(self) -> _Assignment:
        twin = _Assignment(self.graph)
        twin.effort_to, twin.because = dict(self.effort_to), dict(self.because)
        return twin

    def choose(self, bond: Bond, effort_to: Element) -> None:
        """Set one stroke and propagate its consequences; raises :class:`_ConflictError`."""
        queue = deque([(bond, effort_to, bond.number)])
        while queue:
            bond, end, cause = queue.popleft()
            if bond.number in self.effort_to:
                if self.effort_to[bond.number] is not end:
                    raise _ConflictError((self.because[bond.number], cause), f"of bond {bond.number}")
                continue
            self.effort_to[bond.number], self.because[bond.number] = end, cause
            for element in (bond.tail, bond.head):
                queue.extend((b, e, cause) for b, e in self._consequences(element))

    def _consequences(self, element: Element) -> list[tuple[Bond, Element]]:
        if isinstance(element, Junction):
            return self._at_junction(element)
        if isinstance(element, TF | GY):
            first, second = self.graph.at(element)
            known, open_bond = (first, second) if first.number in self.effort_to else (second, first)
            effort_in = self.effort_to[known.number] is element
            passes = (not effort_in) if isinstance(element, TF) else effort_in
            return [(open_bond, element if passes else open_bond.other(element))]
        return []

    def _at_junction(self, junction: Junction) -> list[tuple[Bond, Element]]:
        """A 0-junction receives its effort from exactly one bond, a 1-junction its flow."""
        bonds, zero = self.graph.at(junction), isinstance(junction, Zero)
        known = [bond for bond in bonds if bond.number in self.effort_to]
        setters = [bond for bond in known if (self.effort_to[bond.number] is junction) == zero]
        left = [bond for bond in bonds if bond.number not in self.effort_to]
        label, what = self.graph.label(junction), "effort" if zero else "flow"
        if len(setters) > 1:
            causes = [self.because[bond.number] for bond in setters]
            through = f", through bonds {_join(bond.number for bond in setters)}"
            raise _ConflictError(causes, f"set the {what} of the {label}", through)
        if not setters and not left:
            causes = [self.because[bond.number] for bond in known]
            raise _ConflictError(causes, f"leave nothing that sets the {what} of the {label}")
        if setters:
            return [(bond, bond.other(junction) if zero else junction) for bond in left]
        if len(left) == 1:
            return [(left[0], junction if zero else left[0].other(junction))]
        return []


def assign_causality(graph: BondGraph, prefer: Iterable[int] = ()) -> Causality:
    """Assign causality to every bond by the sequential procedure.

    Parameters
    ----------
    graph : BondGraph
        The graph.
    prefer : iterable of int
        Bonds of storage elements that get integral causality first, in this order; the others follow by number.

    Returns
    -------
    Causality
        Strokes, the storage elements by causality, and the algebraic loops.

    Raises
    ------
    BalanceError
        Sources conflict, or no causality fits the graph.
    ArgumentError
        ``prefer`` names a bond without a storage element.

    References
    ----------
    D. C. Karnopp, D. L. Margolis, R. C. Rosenberg, "System Dynamics", 5th ed., Wiley, 2012, chapter 5.
    https://doi.org/10.1002/9781118152812
    """
    check_graph(graph)
    expected = "numbers of bonds with a storage element, such as [2, 6]"
    try:
        first = tuple(dict.fromkeys(whole("prefer", bond, 0) for bond in prefer))
    except Exception:  # not a sequence of numbers; a user's object may fail
        raise ArgumentError(f"{graph.name}: prefer is {shown(prefer)}; expected {expected}") from None
    storage = graph.of_kind(I, C)
    if wrong := [bond for bond in first if bond not in storage]:
        raise ArgumentError(f"{graph.name}: prefer: no storage element on bonds {_join(wrong)}; they are on {_join(storage)}")
    order = [*first, *(bond for bond in storage if bond not in first)]
    try:
        state, chosen = _sequence(graph, order, look_ahead=False)
    except BalanceError as problem:
        try:
            state, chosen = _sequence(graph, order, look_ahead=True)
        except BalanceError:
            raise problem from None
    return _result(graph, state, storage, chosen)


def _sequence(graph: BondGraph, order: Iterable[int], *, look_ahead: bool) -> tuple[_Assignment, tuple[int, ...]]:
    """All strokes, and the bonds whose causality was free; ``look_ahead`` avoids steps that make later ones impossible.

    Otherwise consequences are propagated from bond to bond only, which may miss a later conflict in loops of rigid gears.
    """
    state = _Assignment(graph)
    for number in graph.of_kind(Se, Sf):
        bond, source = graph.bonds[number], graph.element(number, Se, Sf)
        try:
            state.choose(bond, source if isinstance(source, Sf) else bond.other(source))
        except _ConflictError as conflict:
            raise BalanceError(_message(graph, conflict)) from None
    for number in order:
        if number not in state.effort_to:
            bond, element = graph.bonds[number], graph.element(number, I, C)
            state = _settle(state, bond, element if isinstance(element, I) else bond.other(element), look_ahead)
    chosen = []
    one_way = [n for n in graph.of_kind(R) if _has_one_direction(graph.element(n, R))]
    for number in [*one_way, *graph.of_kind(R), *graph.bonds]:
        if number not in state.effort_to:
            chosen.append(number)
            state = _settle(state, graph.bonds[number], _wished(graph.bonds[number]), look_ahead)
    return state, tuple(chosen)


def _settle(state: _Assignment, bond: Bond, wished: Element, look_ahead: bool) -> _Assignment:
    """The assignment after giving ``bond`` the preferred stroke, or the other one if that leads to a conflict."""
    conflict: _ConflictError | None = None
    for end in (wished, bond.other(wished)):
        trial = state.copy()
        try:
            trial.choose(bond, end)
        except _ConflictError as found:
            conflict = conflict or found
        else:
            if not look_ahead or can_be_completed(trial.graph, trial.effort_to):
                return trial
            conflict = conflict or _ConflictError((bond.number,), "leave a junction with nothing to set it")
    assert conflict is not None
    raise BalanceError(_message(state.graph, conflict))


def _has_one_direction(element: Element) -> bool:
    """Whether a resistance has a nonlinear law that is given only as e(f) or only as f(e)."""
    return isinstance(element, R) and (element.law is None) != (element.conductance is None)


def _wished(bond: Bond) -> Element:
    """Preferred direction of a free bond's effort: away from a resistance with a law e(f), into one with f(e)."""
    for end in (bond.tail, bond.head):
        if isinstance(end, R):
            return end if end.conductance is not None and end.law is None else bond.other(end)
    return bond.head


def _result(graph: BondGraph, state: _Assignment, storage: tuple[int, ...], chosen: tuple[int, ...]) -> Causality:
    integral = []
    for number in storage:
        element = graph.element(number, I, C)
        if (state.effort_to[number] is element) == isinstance(element, I):
            integral.append(number)
    derivative = tuple(bond for bond in storage if bond not in integral)
    loops, tears = _algebraic_loops(graph, state.effort_to)
    return Causality(dict(sorted(state.effort_to.items())), tuple(integral), derivative, chosen, loops, tears)


def dependencies(graph: BondGraph, effort_to: Mapping[int, Element]) -> dict[Quantity, tuple[Quantity, ...]]:
    """For every effort and flow, the quantities from which its element computes it; storage elements and sources need none."""
    needs: dict[Quantity, tuple[Quantity, ...]] = {}
    for bond in graph.bonds.values():
        for letter, receiver in (("e", effort_to[bond.number]), ("f", bond.other(effort_to[bond.number]))):
            needs[letter, bond.number] = _needs(graph, effort_to, letter, bond, bond.other(receiver))
    return needs


def _needs(
    graph: BondGraph, effort_to: Mapping[int, Element], letter: str, bond: Bond, setter: Element
) -> tuple[Quantity, ...]:
    others = [b for b in graph.at(setter) if b is not bond]
    match setter:
        case Zero() | One():
            shared = "e" if isinstance(setter, Zero) else "f"
            if letter != shared:
                return tuple((letter, b.number) for b in others)
            strong = next(b for b in others if (effort_to[b.number] is setter) == (shared == "e"))
            return ((shared, strong.number),)
        case TF():
            return ((letter, others[0].number),)
        case GY():
            return (("f" if letter == "e" else "e", others[0].number),)
        case R():
            return (("f" if letter == "e" else "e", bond.number),)
    return ()


def _algebraic_loops(
    graph: BondGraph, effort_to: Mapping[int, Element]
) -> tuple[tuple[tuple[int, ...], ...], tuple[Quantity, ...]]:
    """The cycles among efforts and flows, and the tearing variables; outputs of resistances are preferred."""
    needs = dependencies(graph, effort_to)
    net = nx.DiGraph([(source, target) for target, sources in needs.items() for source in sources])
    resistive = set(graph.of_kind(R))
    loops: list[frozenset[Quantity]] = []
    tears: list[Quantity] = []
    while cycles := [part for part in nx.strongly_connected_components(net) if len(part) > 1]:
        for part in cycles:
            outputs = sorted(q for q in part if q[1] in resistive and isinstance(_setter(graph, effort_to, q), R))
            if not any(part <= old for old in loops):
                loops.append(frozenset(part))
            tear = min(outputs or part, key=lambda q: (q[1], q[0]))
            tears.append(tear)
            net.remove_edges_from(list(net.in_edges(tear)))
    named = [tuple(sorted({n for _, n in part} & resistive or {n for _, n in part})) for part in loops]
    return tuple(sorted(named)), tuple(tears)


def evaluation_order(graph: BondGraph, causality: Causality, wanted: Iterable[Quantity] | None = None) -> tuple[Quantity, ...]:
    """Efforts and flows in evaluation order; tearing variables are given.

    All of them, or the ``wanted`` ones with their prerequisites.
    """
    needs = dependencies(graph, causality.effort_to)
    net = nx.DiGraph()
    net.add_nodes_from(needs)
    for target in needs.keys() - set(causality.tears):
        net.add_edges_from((source, target) for source in needs[target])
    if wanted is not None:
        kept = set(wanted)
        net = net.subgraph(kept.union(*(nx.ancestors(net, quantity) for quantity in kept)))
    return tuple(nx.topological_sort(net))


def _setter(graph: BondGraph, effort_to: Mapping[int, Element], quantity: Quantity) -> Element:
    bond = graph.bonds[quantity[1]]
    receiver = effort_to[bond.number]
    return bond.other(receiver) if quantity[0] == "e" else receiver


def _join(numbers: Iterable[int]) -> str:
    found = [str(number) for number in numbers]
    return ", ".join(found[:-1]) + (" and " if len(found) > 1 else "") + found[-1] if found else "none"


def _message(graph: BondGraph, conflict: _ConflictError) -> str:
    culprits, ends = [], []
    for number in conflict.bonds:
        bond = graph.bonds[number]
        end = bond.tail if isinstance(bond.tail, Se | Sf | I | C | R) else bond.head
        ends.append(end)
        culprits.append(f"{end.kind} on bond {number}" if isinstance(end, Se | Sf | I | C | R) else f"bond {number}")
    what = conflict.what
    if what.startswith("of bond"):
        flow, effort = (all(isinstance(end, kinds) for end in ends) for kinds in ((Sf, I), (Se, C)))
        what = f"set the {'flow' if flow else 'effort' if effort else 'causality'} {what}"
    verb, rest = what.split(" ", 1)
    if len(culprits) == 1:
        verb, rest = f"{verb}s", f"{rest} in two ways" if verb == "set" else rest
    elif verb == "set":
        verb = "both set"
    return f"{graph.name}: no causality fits: {' and '.join(culprits)} {verb} {rest}{conflict.through}"
