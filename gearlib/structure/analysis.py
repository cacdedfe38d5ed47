"""`analyse`: from flat equations to states, and which equation determines each other unknown.

The steps, in order: loops (numbers), balance, Pantelides, states (numbers). A redundant equation is left out before anything is
counted, and one torque that nothing determines any more is set to zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from gearlib.errors import BalanceError, LoopError, ModelError, SingularError
from gearlib.flatten.model import EquationGroup, FlatModel
from gearlib.structure.balance import Balance, dulmage_mendelsohn
from gearlib.structure.incidence import Entries, Floats, Integers, Node
from gearlib.structure.loops import examine
from gearlib.structure.pantelides import Differentiation, pantelides
from gearlib.structure.sorting import Dependence, sinks
from gearlib.structure.states import StateChoice, choose_states

# (group, column of its template) -> that partial derivative of each row
PartialValues = Callable[[int, int], Floats]
# group -> the constant part of each row, NaN where it varies with time
RestValues = Callable[[int], Floats]


@dataclass(frozen=True)
class Numbers:
    """Numerical values of a flat model's partial derivatives, as structure asks for them."""

    partial: PartialValues
    rest: RestValues


@dataclass(frozen=True)
class Structure:
    """A flat model, reduced and ready to be sorted."""

    model: FlatModel  # without redundant equations
    rows: tuple[tuple[int, int], ...]  # (group, row) of each equation
    differentiation: Differentiation
    choice: StateChoice
    dependence: Dependence
    angles: frozenset[Node]  # states that are integrals nobody depends on
    redundant: tuple[str, ...]  # owners of the equations that were left out
    closed: tuple[str, ...]  # flows set to zero
    complete: FlatModel  # with the redundant equations

    @property
    def states(self) -> tuple[Node, ...]:
        return self.choice.states


class Rows:
    """The equations of a flat model one by one: their variables and orders, also differentiated."""

    def __init__(self, model: FlatModel) -> None:
        self.model = model
        self.first = np.cumsum([0, *(len(g) for g in model.groups)])
        self.place = [(g, i) for g, group in enumerate(model.groups) for i in range(len(group))]
        self._rows = [row for group in model.groups for row in _columns(group)]
        self._locals = [group.variables.tolist() for group in model.groups]
        self._signs = [group.signs.tolist() for group in model.groups]

    def columns(self, e: int, k: int) -> list[Node]:
        """Variables and orders in the k-th derivative of equation e."""
        if k == 0:
            return self._rows[e]
        g, i = self.place[e]
        template = self.model.groups[g].template
        if template.linear:
            return [(v, order + k) for v, order in self._rows[e]]
        for _ in range(k):
            template = template.derivative
        variables, signs = self._locals[g][i], self._signs[g][i]
        return list(dict.fromkeys((variables[j], order) for j, order in template.local_columns if signs[j]))


def _columns(group: EquationGroup) -> list[list[Node]]:
    """What stands in each row of a group, cancelled where two locals are one variable."""
    template = group.template
    if not template.columns:
        return [[] for _ in range(len(group))]
    parts = [[(v, order) for v in group.variables[:, j].tolist()] for j, order in template.local_columns]
    rows = [list(r) for r in zip(*parts, strict=True)]
    odd = np.flatnonzero((group.signs == 0).any(axis=1) | _repeats(group.variables))
    for i in odd.tolist():
        weight: dict[Node, float] = {}
        for (j, order), partial in zip(template.local_columns, template.partials, strict=True):
            sign = int(group.signs[i, j])
            if sign:
                node = (int(group.variables[i, j]), order)
                number = partial.number if partial.number is not None else np.pi  # a parameter: cancels with nothing
                weight[node] = weight.get(node, 0.0) + sign * number
        rows[i] = [node for node, w in weight.items() if w != 0.0]
    return rows


def _repeats(variables: Integers) -> np.ndarray:
    ordered = np.sort(variables, axis=1)
    result: np.ndarray = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    return result


def analyse(model: FlatModel, numbers: Numbers) -> Structure:
    """Reduce a flat model.

    Raises
    ------
    LoopError, BalanceError, SingularError
        With the names of the equations and variables at fault.
    """
    complete = model
    rows = Rows(model)
    dropped = _redundant_rows(model, rows, numbers)
    redundant = tuple(model.owner(*rows.place[e]) for e in dropped)
    if dropped:
        model = _without(model, rows, dropped)
        numbers = _shifted(numbers, rows, dropped)
        rows = Rows(model)
    model, closed, balance = _balanced(model, rows, model.redundant + len(dropped))
    if closed:
        rows = Rows(model)
    del balance
    given = frozenset(model.inputs.tolist())
    result = pantelides(len(rows.place), lambda e, k: [n for n in rows.columns(e, k) if n[0] not in given])
    _refuse_differentiated_inputs(model, rows, result, given)
    varying = frozenset(e for e, (g, _) in enumerate(rows.place) if result.counts[e] and not model.groups[g].template.linear)
    choice = choose_states(result, _entries(model, rows, result, numbers), _badness(model, result), varying)
    if choice.singular:
        owners = sorted({model.owner(*rows.place[e]) for e in choice.singular})
        raise SingularError(
            f"the constraints of {', '.join(owners)} depend on each other at these values (a combination of ratios makes a pivot "
            "zero); change a ratio, or make one of the connections elastic"
        )
    dependence = Dependence(choice, rows.columns, given, frozenset(choice.states), decisive_nodes(model, rows))
    plain_rates = _rate_equations(model, rows)

    def position(state: Node) -> bool:
        """A potential, or a variable that a declared speed is the derivative of."""
        return state[1] == 0 and (bool(model.potential[state[0]]) or state[0] in plain_rates)

    angles = sinks(dependence, choice.states, position)
    return Structure(model, tuple(rows.place), result, choice, dependence, angles, redundant, closed, complete)


def confirm(structure: Structure, numbers: Numbers) -> None:
    """Check that what was redundant still is, with other numbers (of ``structure.complete``).

    Raises
    ------
    LoopError
        The equations that were left out do not follow from the others any more.
    """
    if not structure.redundant:
        return
    rows = Rows(structure.complete)
    dropped = _redundant_rows(structure.complete, rows, numbers)
    if len(dropped) != len(structure.redundant):
        raise LoopError(
            f"the model was compiled with equations of {', '.join(structure.redundant)} that followed from the others, and with these "
            "parameters they do not; give the parameters to the components and compile again"
        )


def _refuse_differentiated_inputs(model: FlatModel, rows: Rows, result: Differentiation, given: frozenset[int]) -> None:
    if not given:
        return
    for e, count in enumerate(result.counts):
        for v, order in rows.columns(e, count):
            if v in given and order:
                raise ModelError(
                    f"{model.owner(*rows.place[e])}: the input {model.name(v)} would have to be differentiated; bind it to an "
                    "expression of gl.time that can be, or let the motion follow it through a filter (exact=False)"
                )


def decisive_nodes(model: FlatModel, rows: Rows) -> dict[int, list[Node]]:
    """Of each equation with relations or discrete variables: the variables that decide on these, through all updates."""
    n = len(model.discretes)
    known: dict[int, list[Node]] = {}
    result: dict[int, list[Node]] = {}
    for g, group in enumerate(model.groups):
        template = group.template
        if not (template.relation_columns or template.held):
            continue
        where = {name: j for j, name in enumerate(template.locals)}
        for i in range(len(group)):
            found = {(int(group.variables[i, where[c]]), o) for c, o in template.relation_columns if group.signs[i, where[c]]}
            for place in group.held[i].tolist():
                if place < 2 * n:
                    d = place % n
                    if d not in known:
                        known[d] = discrete_nodes(model, d)
                    found.update(known[d])
            result[int(rows.first[g]) + i] = sorted(found)
    return result


def discrete_nodes(model: FlatModel, discrete: int) -> list[Node]:
    """The variables that decide on a discrete variable (those of its own equation and, through it, of others)."""
    found: set[Node] = set()
    seen: set[int] = set()
    stack = [discrete]
    n = len(model.discretes)
    while stack:
        d = stack.pop()
        if d in seen:
            continue
        seen.add(d)
        for update in model.discretes.updates:
            if update.reinit:
                continue
            group = update.equations
            where = {name: j for j, name in enumerate(group.template.locals)}
            for i in np.flatnonzero(update.targets == d).tolist():
                columns = [*group.template.columns, *group.template.relation_columns]
                found |= {(int(group.variables[i, where[c]]), o) for c, o in columns if group.signs[i, where[c]]}
                stack += [p % n for p in group.held[i].tolist() if p < 2 * n]
    return sorted(found)


def _rate_equations(model: FlatModel, rows: Rows) -> set[int]:
    """Variables x of equations der(x) = w."""
    found: set[int] = set()
    for group in model.groups:
        t = group.template
        if len(t.columns) == 2 and not t.parameters and sorted(o for _, o in t.columns) == [0, 1] and t.linear:
            j = next(j for j, o in t.local_columns if o == 1)
            found.update(group.variables[:, j].tolist())
    del rows
    return found


def _redundant_rows(model: FlatModel, rows: Rows, numbers: Numbers) -> list[int]:
    """Equations between positions (no derivative, no flow, constant coefficients) that follow from the others."""
    candidates: list[int] = []
    coefficients: list[dict[int, float]] = []
    constants: list[float] = []
    for g, group in enumerate(model.groups):
        t = group.template
        if not t.linear or not t.columns or any(order for _, order in t.columns) or t.label == "binding":
            continue
        eligible = ~(model.flow[group.variables] & (group.signs != 0)).any(axis=1)
        if not eligible.any():
            continue
        partials = [numbers.partial(g, c) for c in range(len(t.columns))]
        rest = numbers.rest(g)
        for i in np.flatnonzero(eligible).tolist():
            row: dict[int, float] = {}
            for c, (j, _) in enumerate(t.local_columns):
                v = int(group.variables[i, j])
                row[v] = row.get(v, 0.0) + int(group.signs[i, j]) * float(partials[c][i])
            candidates.append(int(rows.first[g]) + i)
            coefficients.append(row)
            constants.append(-float(rest[i]))
    loops = examine(coefficients, constants, frozenset())
    for found in (*loops.contradictory, *loops.redundant):
        held = [r for r in found.rows if len(coefficients[r]) == 1]
        if len(held) > 1:
            variables = dict.fromkeys(model.name(v) for r in held for v in coefficients[r])
            raise BalanceError(
                f"the model is not balanced. over-determined: held twice by {_listed(model, rows, [candidates[r] for r in held])}. "
                f"The variables: {'; '.join(variables)}. Remove one of them, or make a connection between them elastic"
            )
    for bad in loops.contradictory:
        owners = list(dict.fromkeys(model.owner(*rows.place[candidates[r]]) for r in bad.rows))
        if len(owners) == 1:
            raise BalanceError(
                "the model is not balanced. over-determined: these equations contradict each other: "
                f"{_listed(model, rows, [candidates[r] for r in bad.rows])}"
            )
        what = f"force {model.name(bad.variable)} to stand still" if bad.variable >= 0 else "contradict each other"
        raise LoopError(
            f"the rigid loop through {', '.join(owners)} cannot turn: its ratios {what}; check the ratios of these components, or "
            "make one of the connections elastic"
        )
    return [candidates[c.last] for c in loops.redundant]


def _without(model: FlatModel, rows: Rows, dropped: list[int]) -> FlatModel:
    groups = list(model.groups)
    for g in {rows.place[e][0] for e in dropped}:
        gone = [rows.place[e][1] for e in dropped if rows.place[e][0] == g]
        group = groups[g]
        groups[g] = EquationGroup(
            group.template, np.delete(group.variables, gone, 0), np.delete(group.signs, gone, 0),
            np.delete(group.parameters, gone, 0), np.delete(group.owners, gone, 0), np.delete(group.held, gone, 0),
        )  # fmt: skip
    return model.with_groups(tuple(groups), model.redundant + len(dropped))


def _shifted(numbers: Numbers, rows: Rows, dropped: list[int]) -> Numbers:
    gone: dict[int, list[int]] = {}
    for e in dropped:
        g, i = rows.place[e]
        gone.setdefault(g, []).append(i)
    return Numbers(
        lambda g, c: np.delete(numbers.partial(g, c), gone.get(g, [])), lambda g: np.delete(numbers.rest(g), gone.get(g, []))
    )


def _balanced(model: FlatModel, rows: Rows, redundant: int) -> tuple[FlatModel, tuple[str, ...], Balance]:
    """Check the balance; close what redundant equations leave open by setting flows to zero."""
    closed: list[int] = []
    given = set(model.inputs.tolist())
    while True:
        incidence = [list({v for v, _ in rows.columns(e, 0) if v not in given}) for e in range(len(rows.place))]
        unknown = sorted({int(r) for r in np.unique(model.representative[model.sign != 0])} - given - set(closed))
        balance = dulmage_mendelsohn(incidence, unknown)
        if balance.balanced:
            return model, tuple(model.name(v) for v in closed), balance
        free_flows = [v for v in balance.undetermined if model.flow[v]]
        if balance.surplus == 0 and len(closed) < redundant and free_flows:
            closed.append(free_flows[0])
            model = _zeroed(model, free_flows[0])
            rows = Rows(model)
            continue
        raise BalanceError(_explain(model, rows, balance))


def _zeroed(model: FlatModel, variable: int) -> FlatModel:
    sign = np.where(model.representative == variable, 0, model.sign)

    def zeroed(group: EquationGroup) -> EquationGroup:
        return replace(group, signs=np.where(group.variables == variable, 0, group.signs))

    updates = tuple(replace(u, equations=zeroed(u.equations)) for u in model.discretes.updates)
    return replace(
        model, sign=sign, groups=tuple(zeroed(g) for g in model.groups), discretes=replace(model.discretes, updates=updates),
        closed=(*model.closed, variable),
    )  # fmt: skip


def _some(items: list[str]) -> str:
    return "; ".join(items[:8]) + (f"; and {len(items) - 8} more" if len(items) > 8 else "")


def _listed(model: FlatModel, rows: Rows, equations: Iterable[int]) -> str:
    """Equations as "load (Inertia: der(phi) = w); ..."."""
    places = (rows.place[e] for e in equations)
    return _some([f"{model.owner(g, i)} ({model.groups[g].template.label})" for g, i in places])


def _explain(model: FlatModel, rows: Rows, balance: Balance) -> str:
    text = []
    if balance.surplus:
        text.append(
            f"over-determined: {len(balance.excess_equations)} equations for {len(balance.excess_variables)} variables, "
            f"{balance.surplus} too many. The equations: {_listed(model, rows, balance.excess_equations)}. "
            f"The variables: {_some([model.name(v) for v in balance.excess_variables]) or 'none that is not given or zero'}. "
            "Is something held or driven twice (two sources or grounds on one rigid shaft), or a source not connected?"
        )
    if balance.deficit:
        text.append(
            f"under-determined: {len(balance.undetermined)} variables in {len(balance.missing_equations)} equations, "
            f"{balance.deficit} too few. The variables: {_some([model.name(v) for v in balance.undetermined])}. "
            "Is a flange left unconnected inside a composite, or a variable without an equation?"
        )
    return "the model is not balanced. " + " ".join(text)


def _entries(model: FlatModel, rows: Rows, result: Differentiation, numbers: Numbers) -> Entries:
    """Partial derivatives of every equation that is differentiated."""
    counts = np.array(result.counts)
    e_all, v_all, o_all, a_all = [], [], [], []
    for g, group in enumerate(model.groups):
        first = int(rows.first[g])
        differentiated = np.flatnonzero(counts[first : first + len(group)])
        if not len(differentiated):
            continue
        for c, (j, order) in enumerate(group.template.local_columns):
            values = np.asarray(numbers.partial(g, c))[differentiated] * group.signs[differentiated, j]
            e_all.append(first + differentiated)
            v_all.append(group.variables[differentiated, j])
            o_all.append(np.full(len(differentiated), order))
            a_all.append(values)
    empty = [np.empty(0, np.int64)]
    return Entries(
        np.concatenate(e_all or empty), np.concatenate(v_all or empty), np.concatenate(o_all or empty),
        np.concatenate(a_all or [np.empty(0)]),
    )  # fmt: skip


def _badness(model: FlatModel, result: Differentiation) -> dict[Node, tuple[float, ...]]:
    """How little each candidate is wanted as a state: by declaration, then derivatives, then without a fixed start value."""
    wanted = set(model.representative[model.starts.variables[model.starts.fixed]].tolist())
    bad: dict[Node, tuple[float, ...]] = {}
    for v, order in result.orders.items():
        for k in range(order):
            preference = int(model.preference[v])
            bad[v, k] = (3.0 - preference if k == 0 else max(2.0, 3.0 - preference), float(v not in wanted))
    return bad
