"""Redundant constraints: detection and removal, and closing of the flows that they leave undetermined.

A rigid loop of gears has one redundant equation between its positions and, by duality, a torque that circulates in it and that no
equation determines. Both are found numerically, since structure alone cannot tell a torque in the loop from one beside it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gearlib.errors import BalanceError, LoopError
from gearlib.flatten.model import EquationGroup, FlatModel, Floats, alphabetical
from gearlib.reduce.coefficients import listed, partials_at, rest_at, some
from gearlib.structure.dulmage_mendelsohn import dulmage_mendelsohn
from gearlib.structure.rigid_loops import TOLERANCE, core, examine
from gearlib.structure.states import select_columns


def redundant_rows(model: FlatModel, parameters: Floats, known: Floats) -> dict[int, tuple[int, ...]]:
    """Equations between positions (no derivative, no flow, constant coefficients) that follow from the others.

    Each comes with the equations of its loop. Arguments as for `partials_at`.
    """
    candidates: list[int] = []
    coefficients: list[dict[int, float]] = []
    constants: list[float] = []
    for g, group in enumerate(model.groups):
        t = group.template
        if not (t.linear and (t.columns or t.parameters)) or any(order for _, order in t.columns) or t.binds:
            continue
        eligible = ~(model.flow[group.variables] & (group.signs != 0)).any(axis=1)
        if not eligible.any():
            continue
        rows = np.flatnonzero(eligible)
        places = [j for j, _ in t.local_columns]
        partials = [partials_at(model, g, c, parameters, known)[rows] for c in range(len(places))]
        columns, factors = group.variables[rows][:, places], group.signs[rows][:, places] * np.transpose(partials)
        candidates += (model.first_equations[g] + rows).tolist()
        coefficients += [dict(zip(*row, strict=True)) for row in zip(columns.tolist(), factors.tolist(), strict=True)]
        constants += (-rest_at(model, g, parameters, known)[rows]).tolist()
    order, coefficients, standing = rows_by_name(model, candidates, coefficients)
    candidates, constants = [candidates[r] for r in order], [constants[r] for r in order]
    redundant, contradictory = examine(coefficients, constants)
    for found in contradictory:
        alone = [r for r in found.rows if len(coefficients[r]) == 1]
        if len(alone) > 1:
            variables = dict.fromkeys(model.name(v) for r in alone for v, _ in model.rows[candidates[r]])
            raise BalanceError(
                f"the model is not balanced. over-determined: held twice by {listed(model, [candidates[r] for r in alone])}. "
                f"The variables: {'; '.join(variables)}. Remove one of them, or make a connection between them elastic"
            )
    for bad in contradictory:
        owners = list(dict.fromkeys(model.owner(*model.places[candidates[r]]) for r in bad.rows))
        if len(owners) == 1:
            raise BalanceError(
                "the model is not balanced. over-determined: these equations contradict each other: "
                f"{listed(model, [candidates[r] for r in bad.rows])}"
            )
        forced = standing[bad.variable] if bad.variable >= 0 else -1
        what = f"force {model.name(forced)} to stand still" if forced >= 0 else "contradict each other"
        raise LoopError(
            f"the rigid loop through {', '.join(owners)} cannot turn: its ratios {what}; check the ratios of these components, or "
            "make one of the connections elastic"
        )
    return {candidates[found.last]: tuple(candidates[r] for r in found.rows) for found in redundant}


def rows_by_name(
    model: FlatModel, candidates: Sequence[int], coefficients: list[dict[int, float]]
) -> tuple[list[int], list[dict[int, float]], list[int]]:
    """Rows of loops sorted by name, over variables sorted by name; and the original row numbers.

    Which equation of a loop is removed must not depend on the order in which the parts were made.
    """
    loops = core(coefficients)
    label = {r: _written_by(model, candidates[r]) for r in loops}
    order = sorted(loops, key=label.__getitem__)
    known = last_names(model, {v for r in order for v, c in coefficients[r].items() if c != 0.0})
    variables = sorted(known, key=lambda v: alphabetical(known[v]))
    place = {v: k for k, v in enumerate(variables)}
    return order, [{place[v]: c for v, c in coefficients[r].items() if c != 0.0} for r in order], variables


def _written_by(model: FlatModel, e: int) -> tuple[Any, str]:
    g, i = model.places[e]
    return alphabetical(model.owner(g, i)), model.groups[g].template.label


def without(model: FlatModel, dropped: Collection[int]) -> FlatModel:
    """The model without some equations, which are counted as redundant."""
    groups = list(model.groups)
    for g in {model.places[e][0] for e in dropped}:
        gone = [model.places[e][1] for e in dropped if model.places[e][0] == g]
        group = groups[g]
        groups[g] = group.take(np.delete(np.arange(len(group)), gone), group.template)
    return model.with_groups(tuple(groups), model.redundant + len(dropped))


def flows_beside(model: FlatModel, places: Iterable[tuple[int, int]]) -> frozenset[int]:
    """The flows of the components that some equations come from."""
    owners = (model.instances[o] for g, i in places if (o := int(model.groups[g].owners[i])) >= 0)
    own = {
        int(v) for o in owners for v in model.representative[o.first_variable : o.first_variable + len(o.declared.variables)]
    }
    return frozenset(v for v in own if model.flow[v])


def balanced(
    model: FlatModel, parameters: Floats, known: Floats, wanted: frozenset[int], loops: Sequence[Sequence[str]] = ()
) -> tuple[FlatModel, tuple[str, ...]]:
    """Check the balance; flows that redundant equations leave undetermined are set to zero, preferably ``wanted`` ones.

    ``loops`` are the components of each redundant equation's loop; other arguments as for `partials_at`. Returns the model, and the names
    of the flows that were set to zero.

    Raises
    ------
    BalanceError
        Too many or too few equations, beyond those flows.
    """
    closed: list[int] = []
    given = set(model.inputs.tolist())
    candidates: list[int] | None = None  # zero for these determines all flows; independent of the order of declaration
    while True:
        incidence = [[v for v, _ in row if v not in given] for row in model.rows]
        unknown = sorted({*model.representative[model.sign != 0].tolist()} - given - set(closed))
        balance = dulmage_mendelsohn(incidence, unknown)
        if balance is None:
            return model, tuple(last_names(model, closed).values())
        if balance.surplus == 0 and candidates is None and model.redundant:
            flows = [v for v in unknown if model.flow[v]]  # some occur in no equation: flows that circulate within a body
            candidates = left_open(flow_rows(model, parameters, known), last_first(model, flows, wanted))
        undetermined = set(balance.undetermined).difference(closed)
        free = [v for v in candidates or () if v in undetermined]
        left = model.redundant - len(closed)  # one flow for each redundant equation, and no more
        closing = free[: min(balance.deficit, left)]
        if balance.surplus or not closing:
            if balance.surplus == 0 and balance.deficit <= left and wanted & set(balance.undetermined):
                raise BalanceError(_split(loops))
            from gearlib.reduce.imbalance import explained

            raise BalanceError(explained(model, balance))
        closed += closing
        model = _zeroed(model, closing)


def refuse_cancelling(declared: FlatModel, model: FlatModel) -> None:
    """Refuse a model that is balanced only as long as equations are not added: in their sums, an unknown cancels that nothing else holds.

    Raises
    ------
    BalanceError
        Names what is undetermined.
    """
    given = set(model.inputs.tolist())
    incidence = [[v for v, _ in row if v not in given] for row in model.rows]
    unknown = {v for row in (*declared.rows, *model.rows) for v, _ in row} - given
    balance = dulmage_mendelsohn(incidence, sorted(unknown))
    if balance is not None:
        names = sorted((declared.name(v) for v in balance.undetermined if v < declared.n_variables), key=alphabetical)
        raise BalanceError(
            f"the model is not balanced. under-determined: nothing determines {some(names)}; springs and dampers in a ring hold their "
            "ends against each other only. Give one of them an inertia, or hold it"
        )


def left_open(rows: Sequence[dict[int, float]], order: Sequence[int]) -> list[int]:
    """The first columns of an order for which ``sum(row[v] * x[v]) = 0`` has only the solution x = 0 once they are set to zero.

    The others are a basis of the columns that prefers the last ones of the order: by matroid duality, the complement of a
    minimum-weight basis is a maximum-weight basis of the dual.

    Examples
    --------
    Two gears in parallel share the known torque x0 as x1 and x2; the second is to be zero:

    >>> left_open([{0: 1.0}, {0: 1.0, 1: 1.0, 2: 1.0}], [2, 1])
    [2]
    >>> left_open([{0: 1.0, 1: 1.0, 2: 1.0}, {2: 1.0}], [2, 1, 0])
    [1]
    """
    weight = {(v, 0): (float(k),) for k, v in enumerate(order)}
    first = (float(len(order)),)  # cannot be set to zero
    nodes = {(r, 0): {(v, 0): c for v, c in row.items()} for r, row in enumerate(rows)}
    weight.update({v: first for row in nodes.values() for v in row if v not in weight})
    follow, _ = select_columns(nodes, weight, zero=TOLERANCE)
    return [v for v in order if (v, 0) not in follow]


def last_first(model: FlatModel, variables: Collection[int], wanted: Collection[int]) -> list[int]:
    """Variables in the order in which they are set to zero: wanted ones first, then in reverse alphabetical order."""
    known = last_names(model, [v for v in variables if v < model.auxiliary])
    return sorted(sorted(known, key=lambda v: alphabetical(known[v]), reverse=True), key=lambda v: v not in wanted)


def last_names(model: FlatModel, variables: Collection[int]) -> dict[int, str]:
    """For each representative, the alphabetically last name among its aliases.

    Which alias is the representative depends on the order in which the parts were made, as do the partial sums of flows; the result
    must not.
    """
    names: dict[int, list[str]] = {v: [] for v in variables}
    for same in np.flatnonzero(np.isin(model.representative[: model.auxiliary], list(names))).tolist():
        names[int(model.representative[same])].append(model.name(same))
    return {v: max(same, key=alphabetical, default=model.name(v)) for v, same in names.items()}


def _definitions(model: FlatModel) -> frozenset[int]:
    """Equations that only define a variable that occurs nowhere else, such as a sensor's power; they constrain no flow."""
    plain = ~(model.flow | model.potential)
    plain[model.inputs] = False
    count: dict[int, int] = {}
    for row in model.rows:
        for v in {v for v, _ in row}:
            count[v] = count.get(v, 0) + 1
    return frozenset(
        e for e, row in enumerate(model.rows) if any(order == 0 and count[v] == 1 and plain[v] for v, order in row)
    )


def flow_rows(model: FlatModel, parameters: Floats, known: Floats) -> list[dict[int, float]]:
    """Coefficients of the flows in each equation at rest, any numbers for those that vary; inputs are no unknowns."""
    result: list[dict[int, float]] = []
    unknown = model.flow.copy()
    unknown[model.inputs] = False
    definitions = _definitions(model)
    for g, group in enumerate(model.groups):
        flows = unknown[group.variables] & (group.signs != 0)
        columns = [(c, j) for c, (j, _) in enumerate(group.template.local_columns) if flows[:, j].any()]
        found: list[dict[int, float]] = [{} for _ in range(len(group) if columns else 0)]
        for c, j in columns:
            values = np.array(partials_at(model, g, c, parameters, known), float)
            if not group.template.fixed[c]:  # any generic value
                values = np.where(
                    np.isfinite(values) & (values != 0.0), values, np.pi + 0.1 * np.sin(np.arange(len(values)) + c)
                )
            for i in np.flatnonzero(flows[:, j]).tolist():
                if model.first_equations[g] + i in definitions:
                    continue
                v = int(group.variables[i, j])
                found[i][v] = found[i].get(v, 0.0) + int(group.signs[i, j]) * float(values[i])
        result += found
    return result


def _zeroed(model: FlatModel, variables: Sequence[int]) -> FlatModel:
    gone = np.zeros(model.n_variables, bool)
    gone[list(variables)] = True
    sign = np.where(gone[model.representative], 0, model.sign)

    def zeroed(group: EquationGroup) -> EquationGroup:
        return replace(group, signs=np.where(gone[group.variables], 0, group.signs))

    updates = tuple(replace(u, equations=zeroed(u.equations)) for u in model.updates)
    return replace(
        model, sign=sign, groups=tuple(zeroed(g) for g in model.groups), updates=updates,
        closed=(*model.closed, *variables),
    )  # fmt: skip


def _split(loops: Sequence[Sequence[str]]) -> str:
    """Advice on parallel paths whose losses or friction depend on how they share the torque."""
    named = some([some(list(owners), ", ") for owners in loops])
    return (
        f"the model is not balanced. A rigid loop goes through {named}: its paths share the torque in a way that no equation "
        "determines, and the losses in them depend on it. Make one of the paths elastic (a SpringDamper in series, or an elastic "
        "mesh), or join the paths into one component"
    )
