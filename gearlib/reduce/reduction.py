"""`analyse`: index reduction and state selection of a flat model.

The steps, in order: rigid loops (numerically), balance, Pantelides, state selection (numerically). Redundant equations are removed
before the balance is checked; for each of them one flow that is then undetermined is set to zero.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from gearlib.errors import LoopError, ModelError, NameLookupError, SingularError
from gearlib.flatten.model import EquationGroup, FlatModel, Floats, alphabetical
from gearlib.reduce.coefficients import at_start, partials_at
from gearlib.reduce.discontinuities import may_jump, with_corners
from gearlib.reduce.redundancy import balanced, flows_beside, redundant_rows, refuse_cancelling, without
from gearlib.reduce.rings import with_sums_around_rings
from gearlib.structure.dependence import Dependence
from gearlib.structure.incidence import Entry, Node
from gearlib.structure.pantelides import Differentiation, pantelides
from gearlib.structure.sorting import sinks
from gearlib.structure.states import constraints, matched, select_columns

NEVER = 3.0  # badness of what is declared as no state
LAST = 4.0  # badness as a state of what jumps: behind every preference


@dataclass(frozen=True, eq=False, kw_only=True)
class Structure(Dependence):
    """Result of index reduction: the dependency graph of a flat model, with its states and matching.

    Attributes
    ----------
    model : FlatModel
        Without redundant equations, and with sums around rings.
    differentiation : Differentiation
    redundant : tuple of str
        Origins of the equations that were removed.
    closed : tuple of str
        Flows set to zero.
    complete : FlatModel
        Including the redundant equations.
    declared : FlatModel
        Without redundant equations, and with each component's own in place of sums of equations.
    inverses : dict
        Cache: the most recent inverses of the matrices of linear blocks.
    """

    model: FlatModel
    differentiation: Differentiation
    redundant: tuple[str, ...]
    closed: tuple[str, ...]
    complete: FlatModel
    declared: FlatModel
    inverses: dict[Any, Any] = field(default_factory=dict)

    @cached_property
    def angles(self) -> frozenset[Node]:
        """Positions among the states on which nothing else depends: pure integrals of speeds."""
        model, plain_rates = self.model, integrals(self.model)

        def position(state: Node) -> bool:
            """A potential, or a variable whose derivative is a declared speed."""
            return state[1] == 0 and (bool(model.potential[state[0]]) or state[0] in plain_rates)

        return sinks(self, self.states, position)

    def named(self, name: str, what: str, refusal: tuple[str, str]) -> tuple[Node, int]:
        """The node that a name stands for, and its sign (0: identically zero).

        Parameters
        ----------
        name : str
            A variable's path, or "der(path)".
        what : str
            Its role, for error messages.
        refusal : pair of str
            Ends of the error message, such as ("cannot be an output", "can"): for the name itself, and for the variable whose derivative
            it is.

        Raises
        ------
        NameLookupError
            The model has no such variable, or its equations do not determine it.
        """
        base, order = self.model.column(name)
        variable = self.model.variable(base, what)
        node, sign = (int(self.model.representative[variable]), order), int(self.model.sign[variable])
        if sign and not self.computes(node):
            known = order or node in self.solved_by
            why = "needs the derivative of an input" if known else "does not occur in the model's equations"
            raise NameLookupError(f"{name} {why}, so it {refusal[0]}{f'; {base} {refusal[1]}' if order else ''}")
        return node, sign

    @cached_property
    def switching(self) -> frozenset[int]:
        """Equations that are differentiated and contain relations."""
        groups, places = self.model.groups, self.model.places
        return frozenset(e for e in self.changing if groups[places[e][0]].template.relations)

    @cached_property
    def changing(self) -> frozenset[int]:
        """Equations that are differentiated and contain relations or discrete variables."""
        changes = [bool(group.template.relations or group.template.discretes) for group in self.model.groups]
        counts, places = self.differentiation.counts, self.model.places
        return frozenset(e for e, count in enumerate(counts) if count and changes[places[e][0]])


def analyse(model: FlatModel, parameters: Floats) -> Structure:
    """Perform index reduction and state selection on a flat model; coefficients are evaluated at the start values where needed.

    Raises
    ------
    LoopError, BalanceError, SingularError
        The message names the equations and variables at fault.
    """
    complete, known = model, at_start(model, parameters)
    dropped = redundant_rows(model, parameters, known)
    redundant = tuple(model.owner(*model.places[e]) for e in dropped)
    around = [[model.places[e] for e in loop] for loop in dropped.values()]
    beside = flows_beside(model, [place for loop in around for place in loop])
    loops = [sorted({o for place in loop if (o := model.owner(*place)) != "connection"}, key=alphabetical) for loop in around]
    if dropped:
        model = without(model, dropped)
    model, closed = balanced(model, parameters, known, beside, loops)
    declared, model = model, with_sums_around_rings(model)
    if model is not declared:
        refuse_cancelling(declared, model)
    known = known if model is declared else at_start(model, parameters)
    given = frozenset(model.inputs.tolist())
    unknowns = (lambda e, k: [n for n in model.nodes(e, k) if n[0] not in given]) if given else model.nodes
    result = pantelides(len(model.places), unknowns)
    if corners := with_corners(model, result.counts, parameters):
        groups = [g.take(np.arange(len(g)), corners.get(g.template, g.template)) for g in complete.groups]
        return analyse(complete.with_groups(tuple(groups), complete.redundant), parameters)
    lower, badness = constraints(result, _entries(model, result, parameters, known)), _badness(model, result)
    eliminated, failed = select_columns(lower, badness, _varying(model, result), ranks=model.ranks)
    if failed:
        owners = sorted({model.owner(*model.places[e]) for e, _ in failed})
        raise SingularError(
            f"the constraints of {', '.join(owners)} depend on each other at these values (a combination of ratios makes a pivot "
            "zero); change a ratio, or make one of the connections elastic"
        )
    structure = Structure(
        states=_states(result, eliminated), solved_by=matched(result, lower, eliminated), columns=model.nodes, given=given,
        at_events=decisive_nodes(model), at_reinits=reinit_nodes(model), model=model, differentiation=result, redundant=redundant,
        closed=closed, complete=complete, declared=declared,
    )  # fmt: skip
    structure = _without_jumps(structure, lower, badness, parameters)
    _refuse_differentiated_inputs(structure)
    _refuse_reinits_of_no_state(model, structure.states)
    _refuse_reinits_of_one_state(model)
    return structure


def choose_again(structure: Structure, parameters: Floats, t: float, known: Floats) -> Structure | None:
    """State selection at another point, with arguments as for `partials_at`; None if it yields no other states."""
    model, result = structure.model, structure.differentiation
    lower, varying = constraints(result, _entries(model, result, parameters, known, t)), _varying(model, result)
    by_declaration = {node: bad[:1] for node, bad in _badness(model, result).items()}
    for badness in (by_declaration, {}):
        eliminated, failed = select_columns(lower, badness, varying, ranks=model.ranks)
        if failed:
            return None
        other = replace(structure, states=_states(result, eliminated), solved_by=matched(result, lower, eliminated))
        other = _without_jumps(other, lower, badness, parameters)
        if other.is_state >= {(v, 0) for v in _reinitialised(model)} and other.is_state != structure.is_state:
            return other
    return None


def _without_jumps(
    structure: Structure, lower: Mapping[Node, Mapping[Node, float]], badness: Mapping[Node, tuple[float, ...]],
    parameters: Floats,
) -> Structure:  # fmt: skip
    """The structure with other states, where there are any, in place of those whose rates need the derivative of what may jump.

    Which these are does not depend on the other states, so the choice is repeated with all that have been found put last.
    """
    model, result = structure.model, structure.differentiation

    def unfit(found: Structure, equations: Collection[Node]) -> set[Node]:
        needing = found.needing(equations) if equations else set()
        return {(v, k) for v, k in found.states if (v, k + 1) in needing}

    held = [bool(group.template.relations or group.template.discretes) for group in model.groups]
    switching = {(e, k) for e, (g, _) in enumerate(model.places) if held[g] for k in range(1, result.counts[e] + 1)}
    steep = switching | structure.with_rates_of_given
    if not unfit(structure, steep):
        return structure
    steep -= {(e, k) for e, k in switching if not may_jump(model, e, k, parameters)}
    found, last = structure, dict.fromkeys(((v, 0) for v in _reinitialised(model)), (-1.0,))
    while new := dict.fromkeys(unfit(found, steep) - last.keys(), (LAST,)):
        last |= new
        eliminated, _ = select_columns(lower, {**badness, **last}, _varying(model, result), ranks=model.ranks)
        found = replace(found, states=_states(result, eliminated), solved_by=matched(result, lower, eliminated))
    return min(structure, found, key=lambda s: len(unfit(s, steep)))


def _states(result: Differentiation, eliminated: Collection[Node]) -> tuple[Node, ...]:
    """The state candidates that are not eliminated."""
    return tuple((v, k) for v, order in sorted(result.orders.items()) for k in range(order) if (v, k) not in eliminated)


def _varying(model: FlatModel, result: Differentiation) -> frozenset[int]:
    """Differentiated equations with coefficients that change during a run."""
    return frozenset(e for e, (g, _) in enumerate(model.places) if result.counts[e] and not model.groups[g].template.linear)


def confirm(structure: Structure, parameters: Floats) -> None:
    """Check that redundant equations remain redundant with other parameters.

    Raises
    ------
    LoopError
        The removed equations no longer follow from the others.
    """
    if not structure.redundant:
        return
    dropped = redundant_rows(structure.complete, parameters, at_start(structure.complete, parameters))
    if len(dropped) != len(structure.redundant):
        raise LoopError(
            f"the model was compiled with equations of {', '.join(structure.redundant)} that followed from the others, and with these "
            "parameters they do not; give the parameters to the components and compile again"
        )


def _refuse_differentiated_inputs(structure: Structure) -> None:
    """Refuse models in which the rate of a state needs the derivative of an unbound input."""
    model, rates = structure.model, {(v, k + 1) for v, k in structure.states}
    for e, k in sorted(structure.with_rates_of_given):
        if not rates.isdisjoint(structure.needing({(e, k)})):
            v = next(v for v, order in model.nodes(e, k) if order and v in structure.given)
            raise ModelError(
                f"{model.owner(*model.places[e])}: the input {model.name(v)} would have to be differentiated; bind it to an "
                "expression of gl.time that can be, or let it pass through a filter (a first-order lag; exact=False of a prescribed motion)"
            )


def decisive_nodes(model: FlatModel) -> dict[int, list[Node]]:
    """Per equation with relations or discrete variables: the variables that determine these, through all updates."""
    n = len(model.discretes)
    known: dict[int, list[Node]] = {}
    result: dict[int, list[Node]] = {}
    for g, group in enumerate(model.groups):
        template = group.template
        if not (template.relation_columns or template.discretes):
            continue
        for i in range(len(group)):
            found = _read(group, i, template.relation_columns)
            for place in group.discretes[i].tolist():
                if place < 2 * n:
                    d = place % n
                    if d not in known:
                        known[d] = discrete_nodes(model, d)
                    found.update(known[d])
            result[model.first_equations[g] + i] = sorted(found)
    return result


def discrete_nodes(model: FlatModel, discrete: int) -> list[Node]:
    """The variables that determine a discrete variable, through its own equation and transitively through others."""
    found: set[Node] = set()
    seen: set[int] = set()
    stack = [discrete]
    n = len(model.discretes)
    while stack:
        d = stack.pop()
        if d in seen:
            continue
        seen.add(d)
        for group, i in model.assignments[d]:
            found |= _read(group, i, (*group.template.columns, *group.template.relation_columns))
            stack += [p % n for p in group.discretes[i].tolist() if p < 2 * n]
    return sorted(found)


def reinit_nodes(model: FlatModel) -> dict[Node, list[Node]]:
    """Per state that events set: the variables that determine its new value, and when it is set, through all updates."""
    n = len(model.discretes)
    result: dict[Node, list[Node]] = {}
    for update in (u for u in model.updates if u.reinit):
        group = update.equations
        for i, target in enumerate(update.targets.tolist()):
            others = {p % n for p in group.discretes[i].tolist() if p < 2 * n}
            found = _read(group, i, (*group.template.columns, *group.template.relation_columns)).union(
                *(discrete_nodes(model, d) for d in others)
            )
            result.setdefault((int(model.representative[target]), 0), []).extend(sorted(found))
    return result


def _read(group: EquationGroup, i: int, columns: Iterable[tuple[str, int]]) -> set[Node]:
    """The variables behind some columns of one row of equations."""
    where = {name: j for j, name in enumerate(group.template.locals)}
    return {(int(group.variables[i, where[c]]), o) for c, o in columns if group.signs[i, where[c]]}


def integrals(model: FlatModel) -> dict[int, int]:
    """Variables x of equations der(x) = w, and their w: positions, if these are speeds."""
    found: dict[int, int] = {}
    for group in model.groups:
        t = group.template
        if len(t.columns) == 2 and not t.parameters and sorted(o for _, o in t.columns) == [0, 1] and t.linear:
            rate, x = (group.variables[:, j].tolist() for j, _ in sorted(t.local_columns, key=lambda column: column[1]))
            found.update(zip(x, rate, strict=True))
    return found


def awkward(model: FlatModel, result: Differentiation) -> set[int]:
    """Variables that constraints had better not be solved for: their coefficients vary, and those of others are constant.

    Of ``s = h (1 - cos(phi))`` the angle follows only in one half of a turn, and its speed not at all where the cam is flat.
    """
    found: set[int] = set()
    for g in {model.places[e][0] for e in _varying(model, result)}:
        group, first = model.groups[g], model.first_equations[g]
        constant, columns = group.template.fixed, group.template.local_columns
        for i, (variables, signs) in enumerate(zip(group.variables.tolist(), group.signs.tolist(), strict=True)):
            solvable = [signs[j] != 0 and order < result.orders.get(variables[j], 0) for j, order in columns]
            if result.counts[first + i] and any(s and c for s, c in zip(solvable, constant, strict=True)):
                found |= {variables[j] for (j, _), c in zip(columns, constant, strict=True) if not c}
    rates = integrals(model)
    return found | {rates[v] for v in found & rates.keys()}


def _entries(model: FlatModel, result: Differentiation, parameters: Floats, known: Floats, t: float = 0.0) -> list[Entry]:
    """Partial derivatives of every differentiated equation."""
    counts = np.array(result.counts)
    found: list[Entry] = []
    for g, group in enumerate(model.groups):
        first = model.first_equations[g]
        differentiated = np.flatnonzero(counts[first : first + len(group)])
        if not len(differentiated):
            continue
        for c, (j, order) in enumerate(group.template.local_columns):
            values = np.asarray(partials_at(model, g, c, parameters, known, t))[differentiated] * group.signs[differentiated, j]
            variables = group.variables[differentiated, j].tolist()
            equations = (first + differentiated).tolist()
            found += [(e, v, order, a) for e, v, a in zip(equations, variables, values.tolist(), strict=True)]
    return found


def _badness(model: FlatModel, result: Differentiation) -> dict[Node, tuple[float, ...]]:
    """Sort key of state candidates, the least preferred last: by declaration and derivative order, then by a fixed start value.

    What constraints had better not be solved for comes before everything that is merely preferred.
    """
    wanted = set(model.representative[model.started[model.start_fixed]].tolist())
    declared = (NEVER - model.preference).tolist()
    bad: dict[Node, tuple[float, ...]] = {}
    for v, order in result.orders.items():
        for k in range(order):
            bad[v, k] = (declared[v] if k == 0 else max(2.0, declared[v]), float(v not in wanted))
    for v in awkward(model, result):
        if declared[v] < NEVER:
            bad |= {(v, k): (-0.5 if k == 0 else -0.25, float(v not in wanted)) for k in range(result.orders.get(v, 0))}
    for v in _reinitialised(model):
        if (v, 0) in bad:
            bad[v, 0] = (-1.0,)
    return bad


def _reinits(model: FlatModel) -> list[int]:
    """Variables re-initialised at events; each component lists its own once, regardless of the number of ``When``."""
    return [int(v) for update in model.updates if update.reinit for v in update.targets]


def _reinitialised(model: FlatModel) -> list[int]:
    """The representatives of these variables."""
    return [int(model.representative[v]) for v in _reinits(model)]


def _refuse_reinits_of_one_state(model: FlatModel) -> None:
    """Refuse models that re-initialise a state from several components: with simultaneous events the result would be ambiguous."""
    setting: dict[int, list[str]] = {}
    for v in _reinits(model):
        setting.setdefault(int(model.representative[v]), []).append(model.name(v))
    for names in setting.values():
        if len(names) > 1:
            first, *others = sorted(names, key=alphabetical)
            raise ModelError(
                f"reinit({first}) and reinit({'), reinit('.join(others)}) set one state, since {first} equals "
                f"{' and '.join(others)} up to its sign; a state is given new values in one component: move these When into one, or "
                "make the connection between the parts elastic"
            )


def _refuse_reinits_of_no_state(model: FlatModel, states: Collection[Node]) -> None:
    for v in _reinitialised(model):
        if (v, 0) not in states:
            named = ", ".join("der(" * k + model.name(w) + ")" * k for w, k in states)
            raise ModelError(
                f"reinit({model.name(v)}): {model.name(v)} is not a state, so that it cannot be given a value; the states are "
                f"{named or 'none'}. A variable is one where its derivative is written, as gl.der({model.name(v)})"
            )
