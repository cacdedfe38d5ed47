"""`flatten`: turns a component into a `FlatModel`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from gearlib.equations.bindings import is_discrete_name
from gearlib.equations.template import Template
from gearlib.errors import BindingError, BoundError, DeclarationError, ModelError
from gearlib.flatten.aliases import Aliases, unite
from gearlib.flatten.attributes import PREFERENCE, declared, nominals, of_any_alias, places_of_classes, preferences
from gearlib.flatten.connections import (
    MOST_ADDENDS,
    SignedSum,
    connection_sets,
    series_of_parallels,
    split_sum,
    sum_groups,
    without_opposites,
)
from gearlib.flatten.instances import place_of, walk
from gearlib.flatten.model import (
    Dependent,
    EquationGroup,
    FlatModel,
    Floats,
    Integers,
    ParameterTable,
    UpdateGroup,
)
from gearlib.flatten.specialise import Special, simplified, with_values
from gearlib.flatten.tree import Tree
from gearlib.flatten.unused import refuse_unused
from gearlib.language.component import Component, no_component
from gearlib.language.declarations import Flow, Potential
from gearlib.language.interior import ASSEMBLING

COORDINATES = ("rad", "m", "1", "any")  # units of potentials that may be absolute; temperatures and voltages are none


def flatten(component: Component, substituted: Special = frozenset(), anew: bool = True) -> FlatModel:
    """Flatten a component with all its parts.

    Parameters
    ----------
    component : Component
        The root.
    substituted : frozenset of (int, float)
        Parameters whose values are substituted into the equations, since a coefficient vanishes there.
    anew : bool
        Whether the component is assembled once more, since what ``assemble`` reads may have changed.

    Returns
    -------
    FlatModel
        Equations grouped by template, over representative variables.

    Raises
    ------
    ModelError
        Any defect of the model: a missing value, a part of another model, a violated bound.
    """
    if not isinstance(component, Component):
        raise no_component(component)
    with ASSEMBLING:
        tree = walk(component, anew)
        refuse_unused(tree, component)
    table = _parameter_table(tree)
    check_bounds(table, table.defaults)
    raw, equalities = _equations(tree, substituted)
    whole, zeros, n_sets = _connections(tree)
    equalities += zeros
    sums, n_variables = _short_sums(whole, equalities, tree.n_variables)
    raw += sum_groups((s, -1) for s in sums if len(s) not in (0, 2))
    equalities += _equal_flows(sums)
    equalities += [(0, 0, 1) for s in sums if not s]  # such as x = x
    classes = places_of_classes(tree)
    rank = declared(classes, lambda name, _: "." in name, np.ones(n_variables, np.int64))
    rank[tree.inputs] = -1  # an input represents all its aliases
    n_equations = len(equalities) + sum(map(len, raw))
    raw, equalities, aliases = _without_aliases(raw, equalities, n_variables, rank)
    rep = aliases.representative
    _refuse_equal_inputs(tree, aliases)
    flow = declared(classes, lambda _, v: isinstance(v, Flow), np.arange(n_variables) >= tree.n_variables)  # sums are flows
    coordinates = declared(
        classes, lambda _, v: isinstance(v, Potential) and v.unit in COORDINATES, np.zeros(n_variables, bool)
    )
    potential = of_any_alias(coordinates, rep)
    wanted = declared(classes, lambda _, v: PREFERENCE[v.state], np.full(n_variables, PREFERENCE["default"]))
    sizes = declared(classes, lambda _, v: v.nominal, np.ones(n_variables))
    groups = tuple(_represented(group, aliases) for group in raw)
    starts = np.array(tree.starts, np.int64).reshape(len(tree.starts), 3)  # variable, slot, fixed
    return FlatModel(
        tuple(tree.instances), groups, table,
        starts[:, 0], starts[:, 1], starts[:, 2].astype(bool),
        np.array(tree.inputs, np.int64), rep, aliases.sign,
        preferences(wanted, potential, rep, tree.choices), potential, of_any_alias(flow, rep),
        nominals(sizes, rep, tree.choices), tree.n_variables, aliases.redundant, n_equations, len(equalities) - aliases.redundant, n_sets,
        tuple(tree.discrete_names), np.array(tree.discrete_starts), _updates(tree, aliases),
        tuple(tree.loose_ports), tuple(tree.inner_ports),
    )  # fmt: skip


def _without_aliases(
    raw: list[EquationGroup], equalities: list[tuple[int, int, int]], n_variables: int, rank: Integers
) -> tuple[list[EquationGroup], list[tuple[int, int, int]], Aliases]:
    """Equations in which each variable occurs once, all equalities found among them, and the aliases.

    Where two variables of an equation become one, the rest of it may be another equality, which merges more variables.
    """
    while True:
        left, right, sign = np.array(equalities, np.int64).reshape(len(equalities), 3).T
        aliases = unite(n_variables, left, right, sign, rank)
        kept: list[EquationGroup] = []
        changed: list[EquationGroup] = []
        for group in raw:
            for rows, template in simplified(group, aliases):
                if template is not group.template:
                    changed.append(group.take(rows, template))
                else:
                    kept.append(group if len(rows) == len(group) else group.take(rows, template))
        series, rest = series_of_parallels(kept, aliases) if not changed else ([], kept)
        if series:
            equalities += series
            raw = rest
            continue
        if not changed:
            return raw, equalities, aliases
        # Such as x = x
        equalities += [(0, 0, 1) for piece in changed if piece.template.residual == 0 for _ in range(len(piece))]
        raw = [*kept, *_separated((piece for piece in changed if piece.template.residual != 0), equalities)]


def _separated(pieces: Iterable[EquationGroup], equalities: list[tuple[int, int, int]]) -> list[EquationGroup]:
    """The equations that are not aliases; those that are, are appended to the equalities."""
    raw: list[EquationGroup] = []
    for piece in pieces:
        if piece.template.alias is None:
            raw.append(piece)
        else:
            i, j, sign = piece.template.alias
            rows = zip(piece.variables.tolist(), piece.signs.tolist(), strict=True)
            equalities += [(v[i], v[j], sign * s[i] * s[j]) if j >= 0 else (v[i], -1, sign) for v, s in rows]
    return raw


def _refuse_equal_inputs(tree: Tree, aliases: Aliases) -> None:
    for own in tree.inputs:
        other = int(aliases.representative[own])
        name = _variable_name(tree, own)
        if aliases.sign[own] == 0:
            instance, _ = place_of(tree, own)
            part = instance.path or instance.kind
            number = tree.instances.index(instance)
            loose = [c for n, c in tree.loose_ports if n == number]
            if loose and len(loose) == len(instance.declared.connectors):
                raise ModelError(
                    f"{part} is not connected, so that its input {name} acts on nothing; connect it, or leave it out"
                )
            if loose:
                c = loose[0]
                switch = instance.declared.connectors[c].when
                off = f", or leave it switched off ({switch}=False of {part})" if switch else ""
                raise ModelError(f"{part}.{c} is connected to nothing, so that the input {name} does nothing; connect it{off}")
            raise ModelError(
                f"the equations of the model make the input {name} zero; bind it to 0: {name.rpartition('.')[2]}=0"
            )
        if other != own:
            raise ModelError(
                f"the unbound input {name} equals the input {_variable_name(tree, other)}; only one of them can be given: bind one "
                "to the other"
            )


def _variable_name(tree: Tree, variable: int) -> str:
    instance, local = place_of(tree, variable)
    return ".".join(filter(None, (instance.path, local)))


def out_of_bounds(table: ParameterTable, values: Floats) -> NDArray[np.bool_]:
    """Which parameters are out of their bounds or not finite; ``values`` of one run, or (parameters, runs)."""
    lower, upper = table.lower, table.upper
    if values.ndim > 1:
        lower, upper = lower[:, None], upper[:, None]
    found: NDArray[np.bool_] = ~(np.isfinite(values) & (values >= lower) & (values <= upper))
    return found


def check_bounds(table: ParameterTable, values: Floats, given: Mapping[int, float] | None = None) -> None:
    """Raise `BoundError` if a parameter is out of its bounds or not finite; ``given``: those from which these values were computed."""
    if not table.within_bounds(values, given):
        k = int(np.flatnonzero(out_of_bounds(table, values))[0])
        low, high, value = table.lower[k], table.upper[k], values[k]
        if not np.isfinite(value):
            raise BoundError(f"{table.names[k]} is {value}; expected a finite number")
        bound, limit = ("at least", low) if value < low else ("at most", high)
        found, expected = f"{value:g}", f"{limit:g}"
        if found == expected:  # which differ in later digits
            found, expected = repr(float(value)), repr(float(limit))
        raise BoundError(f"{table.names[k]} is {found}; expected {bound} {expected}")


def _parameter_table(tree: Tree) -> ParameterTable:
    level = _parameter_levels(tree)
    steps: dict[tuple[int, Any], tuple[list[tuple[int, ...]], list[int]]] = {}
    for expression, pairs in tree.dependents.items():
        for arguments, target in zip(*pairs, strict=True):
            rows, targets = steps.setdefault((level[target], expression), ([], []))
            rows.append(arguments)
            targets.append(target)
    dependents = tuple(
        Dependent(expression, np.array(rows, np.int64), np.array(targets, np.int64))
        for (_, expression), (rows, targets) in sorted(steps.items(), key=lambda item: item[0][0])
    )
    values = np.array(tree.parameter_values, float)
    bounds = np.array(tree.lower), np.array(tree.upper)
    starts = frozenset(slot for _, slot, _ in tree.starts)
    return ParameterTable(tuple(tree.parameter_names), values, dependents, *bounds, frozenset(tree.written), starts)


def _parameter_levels(tree: Tree) -> dict[int, int]:
    """Evaluation level of each dependent parameter."""
    made = {t: arguments for pairs in tree.dependents.values() for arguments, t in zip(*pairs, strict=True)}
    level: dict[int, int] = {}
    for start in made:
        stack, opened = [start], set[int]()
        while stack:
            target = stack[-1]
            before = [a for a in made[target] if a in made]
            waiting = [a for a in before if a not in level]
            if target in level or not waiting:
                level[target] = 1 + max((level[a] for a in before), default=0)
                stack.pop()
                continue
            opened.add(target)
            if any(a in opened for a in waiting):
                circle = nx.find_cycle(nx.DiGraph((t, a) for t in opened for a in made[t] if a in opened))
                names = sorted(tree.parameter_names[t] for t, _ in circle)
                if len(names) == 1:
                    raise BindingError(f"the parameter {names[0]} depends on itself; give it a number")
                raise BindingError(
                    f"the parameters {', '.join(names)} depend on each other cyclically; give one of them a number"
                )
            stack += waiting
    return level


def _equations(tree: Tree, substituted: Special) -> tuple[list[EquationGroup], list[tuple[int, int, int]]]:
    first_variable = np.array([i.first_variable for i in tree.instances], np.int64)
    first_parameter = np.array([i.first_parameter for i in tree.instances], np.int64)
    blocks: list[tuple[Template, Integers, Integers, Integers]] = []
    for template, owners in tree.local_rows.items():
        record = tree.instances[owners[0]].record
        who = np.array(owners, np.int64)
        offsets = np.array([record.variable_index[n] for n in template.locals], np.int64)
        parameter_offsets = np.array([record.parameter_index[n] for n in template.parameters], np.int64)
        blocks.append(
            (template, first_variable[who][:, None] + offsets, first_parameter[who][:, None] + parameter_offsets, who)
        )
    for template, rows in tree.rows.items():
        n = len(rows)
        blocks.append(
            (
                template,
                np.array([r[1] for r in rows], np.int64).reshape(n, -1),
                np.array([r[2] for r in rows], np.int64).reshape(n, -1),
                np.array([r[0] for r in rows], np.int64),
            )
        )
    pieces = [_group(tree, *block) for block in blocks]
    if substituted:
        pieces = [part for piece in pieces for part in with_values(piece, dict(substituted), tree.parameter_names)]
    equalities: list[tuple[int, int, int]] = []
    return _separated(pieces, equalities), equalities


def _equal_flows(sums: Iterable[SignedSum]) -> list[tuple[int, int, int]]:
    return [(s[0][0], s[1][0], -s[0][1] * s[1][1]) for s in sums if len(s) == 2]


def _short_sums(
    sums: Sequence[SignedSum], equalities: Sequence[tuple[int, int, int]], n_variables: int
) -> tuple[list[SignedSum], int]:
    """Long sums split over auxiliary variables; and the number of all variables.

    Flows that cancel, as those of a part with two flanges on one set do, leave a long sum before it is split. Otherwise it would depend
    on the order of declaration whether they meet in a partial sum.
    """
    short: list[SignedSum] = []
    if any(len(members) > MOST_ADDENDS for members in sums):
        left, right, sign = np.array([*equalities, *_equal_flows(sums)], np.int64).reshape(-1, 3).T
        aliases = unite(n_variables, left, right, sign, np.ones(n_variables, np.int64))
        sums = [s if len(s) <= MOST_ADDENDS else without_opposites(s, aliases) for s in sums]
    for members in sums:
        pieces, n_variables = split_sum(members, n_variables)
        short += pieces
    return short, n_variables


def _connections(tree: Tree) -> tuple[list[SignedSum], list[tuple[int, int, int]], int]:
    """Sums of flows, equalities (of potentials; of flows of unconnected ports with zero), number of sets."""
    sets = connection_sets(tree.links)
    connected = {node for s in sets for node in s}
    sums: list[SignedSum] = []
    equalities: list[tuple[int, int, int]] = []

    def variables_of(port: int) -> tuple[list[int], list[int]]:
        """Potentials and flows."""
        number, connector = tree.ports[port]
        instance = tree.instances[number]
        potentials, flows = instance.declared.ends[connector]
        return [instance.first_variable + i for i in potentials], [instance.first_variable + i for i in flows]

    for members in sets:
        (lead, *others), flows = zip(*[variables_of(node // 2) for node in members], strict=True)
        equalities += [(v, first, 1) for potentials in others for v, first in zip(potentials, lead, strict=True)]
        signs = [-1 if node % 2 else 1 for node in members]  # a composite's own connector, seen from inside
        sums += [tuple(zip(addends, signs, strict=True)) for addends in zip(*flows, strict=True)]
    loose = [port for port in range(len(tree.ports)) if 2 * port not in connected]
    for port in loose:
        equalities += [(v, -1, 0) for v in variables_of(port)[1]]
    inner = sorted(node // 2 for node in connected if node % 2)
    tree.loose_ports, tree.inner_ports = [tree.ports[port] for port in loose], [tree.ports[port] for port in inner]
    return sums, equalities, len(sets)


def _group(tree: Tree, template: Template, variables: Integers, parameters: Integers, owners: Integers) -> EquationGroup:
    discretes = np.array(
        [_discrete_indices(template, tree, i) for i in owners.tolist()] if template.discretes else [], np.int64
    )
    shape = len(variables), len(template.discretes)
    return EquationGroup(template, variables, np.ones_like(variables), parameters, owners, discretes.reshape(shape))


def _represented(group: EquationGroup, aliases: Aliases) -> EquationGroup:
    variables = aliases.representative[group.variables]
    return replace(group, variables=variables, signs=group.signs * aliases.sign[group.variables])


def _discrete_indices(template: Template, tree: Tree, instance: int) -> list[int]:
    """Indices of a template's discrete names in the discrete state, for one instance; see `FlatModel`."""
    n = len(tree.discrete_names)
    places = []
    for name in template.discretes:
        if name == "initial()":
            if not n:
                raise DeclarationError(
                    f"{template.label}: gl.initial() stands in an equation of a model without discrete variables, where it never acts; "
                    "give what holds at the start as start=..., or declare a gl.Discrete whose equation holds gl.initial()"
                )
            places.append(2 * n)
            continue
        before = name.startswith("pre(")
        local = name[4:-1] if before else name
        if is_discrete_name(name):  # bindings refer to it by number
            places.append(int(local[len("discrete[") : -1]) + n * before)
            continue
        own = tree.first_discrete[instance] + list(tree.instances[instance].record.discretes).index(local)
        places.append(own + n * before)
    return places


def _updates(tree: Tree, aliases: Aliases) -> tuple[UpdateGroup, ...]:
    updates = []
    for (template, reinit), rows in tree.updates.items():
        n = len(rows)
        variables = np.array([r[1] for r in rows], np.int64).reshape(n, -1)
        parameters = np.array([r[2] for r in rows], np.int64).reshape(n, -1)
        owners, targets = np.array([r[0] for r in rows], np.int64), np.array([r[3] for r in rows], np.int64)
        every = _group(tree, template, variables, parameters, owners)
        for some, fitting in simplified(every, aliases):
            updates.append(UpdateGroup(_represented(every.take(some, fitting), aliases), targets[some], reinit))
    return tuple(updates)
