"""Specialisation of templates: variables merged by aliases, identically zero, or parameters at values that make a coefficient zero.

A spring whose two flanges lie on one rigid set has ``phi_rel = phi - phi``, which is identically zero; neither matching nor code
generation may see a ``phi`` in it. A body with ``J = 0`` states that its torques cancel, and nothing about its acceleration; a gear
with ``ratio = 1`` states nothing about its support. So symbols or values are substituted, the equation is simplified, and the result is
a template of its own: one per pattern of a class.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import sympy

from gearlib.equations.template import Relation, Template, column_symbol, make_template, memoised, relation_symbol
from gearlib.errors import SingularError
from gearlib.flatten.aliases import Aliases, Integers
from gearlib.flatten.model import EquationGroup

# per local: the first local that is the same variable (-1: identically zero), and the relative sign
Pattern = tuple[tuple[int, int], ...]
Special = frozenset[tuple[int, float]]  # parameters, with values at which a coefficient vanishes


LARGEST = 1000  # largest denominator of a coefficient that is kept as a fraction


@memoised
def specialised(template: Template, pattern: Pattern, values: frozenset[tuple[str, float]] = frozenset()) -> Template:
    """The template with aliases merged into the first local of each variable, and with the values of some parameters substituted.

    Raises
    ------
    SingularError
        A divisor becomes zero.
    """
    table = {sympy.Symbol(name, real=True): sympy.Rational(value) for name, value in values}  # exact: what cancels is 0
    where = {name: j for j, name in enumerate(template.locals)}
    for name, order in (*template.columns, *template.relation_columns):
        lead, sign = pattern[where[name]]
        if lead != where[name]:
            table[column_symbol((name, order))] = sign * column_symbol((template.locals[lead], order))  # without a lead, 0
    residual = sympy.sympify(template.residual).xreplace(table)
    relations: list[Relation] = []
    known = {}
    for i, relation in enumerate(template.relations):
        g = sympy.sympify(relation.g).xreplace(table)
        symbol = relation_symbol(i)
        if g.is_number:  # a constant condition
            holds = bool(g < 0 if relation.negated else g > 0) or (not relation.strict and g == 0)
            known[symbol] = sympy.Integer(holds)
        else:
            known[symbol] = relation_symbol(len(relations))
            relations.append(replace(relation, g=g))
    residual = residual.xreplace(known)
    if values:
        fractions = {r for r in residual.atoms(sympy.Rational) if r.q > LARGEST}
        residual = residual.xreplace({r: sympy.Float(float(r)) for r in fractions})
    if residual.has(sympy.zoo, sympy.nan, sympy.oo, sympy.S.NegativeInfinity):
        raise SingularError(f"{template.label} divides by zero")
    return make_template(template.label, residual, template.parameters, tuple(relations), template.discretes, template.binds)


def with_values(raw: EquationGroup, values: Mapping[int, float], names: Sequence[str]) -> list[EquationGroup]:
    """The equations with the values of some parameters substituted.

    Raises
    ------
    SingularError
        One of them is zero and divided by.
    """
    here = np.isin(raw.parameters, list(values))
    if not here.any():
        return [raw]
    identity = tuple((j, 1) for j in range(len(raw.template.locals)))
    alike: dict[tuple[tuple[int, float], ...], list[int]] = {}
    for row in range(len(raw)):
        pattern = tuple((p, values[raw.parameters[row, p]]) for p in np.flatnonzero(here[row]).tolist())
        alike.setdefault(pattern, []).append(row)
    pieces = []
    for pattern, rows in alike.items():
        local = frozenset((raw.template.parameters[p], value) for p, value in pattern)
        try:
            template = specialised(raw.template, identity, local) if local else raw.template
            pieces.append(raw.take(np.array(rows, np.int64), template))
        except SingularError as problem:
            named = ", ".join(names[raw.parameters[rows[0], p]] for p, value in pattern if value == 0.0)
            raise SingularError(f"{problem}: {named} may not be 0") from None
    return pieces


def by_pattern(raw: EquationGroup, aliases: Aliases) -> list[tuple[Integers, Pattern]]:
    """Rows in which a local is an alias of another one, or zero, grouped by pattern; other rows are omitted."""
    representative, sign = aliases.representative[raw.variables], raw.signs * aliases.sign[raw.variables]
    ordered = np.sort(representative, axis=1)
    special = (sign == 0).any(axis=1) | (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    found: dict[Pattern, list[int]] = {}
    for i in np.flatnonzero(special).tolist():
        first: dict[int, int] = {}
        pattern = []
        signs = sign[i].tolist()
        for j, v in enumerate(representative[i].tolist()):
            lead = first.setdefault(v, j) if signs[j] else -1
            pattern.append((lead, signs[j] * signs[lead] if signs[j] else 0))
        found.setdefault(tuple(pattern), []).append(i)
    return [(np.array(rows, np.int64), pattern) for pattern, rows in found.items()]


def merged(template: Template, pattern: Pattern) -> Template:
    """The template with aliased locals merged. Identically zero ones are kept unless the equation reduces to an alias without them.

    An unconnected flange makes a torque zero in many equations that are otherwise the same.
    """
    without = specialised(template, pattern) if template.linear else None
    if without is not None and (without.alias is not None or not without.columns):
        return without
    kept = tuple((j, 1) if lead < 0 else (lead, sign) for j, (lead, sign) in enumerate(pattern))
    return template if all(lead == j for j, (lead, _) in enumerate(kept)) else specialised(template, kept)


def simplified(raw: EquationGroup, aliases: Aliases) -> list[tuple[Integers, Template]]:
    """The templates that fit the rows' alias patterns, each with its rows."""
    patterns = by_pattern(raw, aliases)
    if not patterns:
        return [(np.arange(len(raw)), raw.template)]
    pieces: list[tuple[Integers, Template]] = []
    rest = np.ones(len(raw), bool)
    for rows, pattern in patterns:
        template = merged(raw.template, pattern)
        if template is not raw.template:
            rest[rows] = False
            pieces.append((rows, template))
    return [(np.flatnonzero(rest), raw.template), *pieces] if rest.any() or not pieces else pieces
