"""Connection sets: potentials are equal, flows sum to zero."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np
import sympy

from gearlib.equations.template import Template, make_template
from gearlib.flatten.aliases import Aliases
from gearlib.flatten.model import EquationGroup

MOST_ADDENDS = 8  # longer sums are split, so that template sizes do not grow with the model


SignedSum = tuple[tuple[int, int], ...]
"""Variables with their signs, whose sum is zero."""


@lru_cache
def sum_template(n: int) -> Template:
    """The sum of n flows; signs are applied to the variables."""
    return make_template(f"sum of {n} flows", sympy.Add(*(sympy.Symbol(f"flow_{i}", real=True) for i in range(n))), ())


def connection_sets(links: Iterable[Sequence[int]]) -> list[list[int]]:
    """Sets of connected nodes, each sorted, ordered by their lowest node.

    >>> connection_sets([(4, 2), (1, 7), (2, 9)])
    [[1, 7], [2, 4, 9]]
    """
    set_of: dict[int, list[int]] = {}
    for link in links:
        largest = max((set_of.setdefault(node, [node]) for node in link), key=len)
        for node in link:
            if (other := set_of[node]) is not largest:
                largest += other
                set_of.update(dict.fromkeys(other, largest))
    return sorted(sorted(s) for s in {id(s): s for s in set_of.values()}.values())


def without_opposites(members: SignedSum, aliases: Aliases) -> SignedSum:
    """A sum without flows that are zero, and without those that are equal and opposite."""
    totals: dict[int, int] = {}
    for v, sign in members:
        own = int(aliases.representative[v])
        totals[own] = totals.get(own, 0) + sign * int(aliases.sign[v])
    return tuple((v, sign) for v, sign in members if totals[int(aliases.representative[v])])


def split_sum(members: SignedSum, new_variable: int) -> tuple[list[SignedSum], int]:
    """Split a long sum into several short ones over new variables; returns them and the next free variable."""
    sums: list[SignedSum] = []
    while len(members) > MOST_ADDENDS:
        head = MOST_ADDENDS - 1
        sums.append((*members[:head], (new_variable, -1)))
        members = (*members[head:], (new_variable, 1))
        new_variable += 1
    return [*sums, members], new_variable


def sum_groups(owned: Iterable[tuple[SignedSum, int]]) -> list[EquationGroup]:
    """Equations of sums, each with the component that owns it (-1: a connection), grouped by length."""
    by_length: dict[int, list[tuple[SignedSum, int]]] = defaultdict(list)
    for members, owner in owned:
        by_length[len(members)].append((members, owner))
    groups = []
    for length, known in sorted(by_length.items()):
        terms, owners = np.array([members for members, _ in known], np.int64), np.array([owner for _, owner in known], np.int64)
        none = np.empty((len(known), 0), np.int64)
        groups.append(EquationGroup(sum_template(length), terms[:, :, 0], terms[:, :, 1], none, owners, none))
    return groups


def series_of_parallels(
    groups: Sequence[EquationGroup], aliases: Aliases
) -> tuple[list[tuple[int, int, int]], list[EquationGroup]]:
    """Simplify parallel parts in series: where two sums share all but one flow, replace the second sum by an equality.

    Of ``x + a + b = 0`` and ``y - a - b = 0`` the second becomes ``x = -y``. Otherwise each of the two sums could be matched to a or b,
    which may leave neither available: a spring in series with two parallel dampers, and no inertia between.
    """
    known: dict[frozenset[tuple[int, int]], tuple[int, int]] = {}
    equal: list[tuple[int, int, int]] = []
    rest: list[EquationGroup] = []
    for group in groups:
        n = group.variables.shape[1]
        if not n or group.template is not sum_template(n):
            rest.append(group)
            continue
        kept = []
        variables = aliases.representative[group.variables].tolist()
        signs = (group.signs * aliases.sign[group.variables]).tolist()
        for row in range(len(group)):
            terms = [(v, sign) for v, sign in zip(variables[row], signs[row], strict=True) if sign]
            if len(terms) < 3 or len({v for v, _ in terms}) < len(terms):
                kept.append(row)
                continue
            keys = []
            for k, (x, sign) in enumerate(terms):
                others = sorted(terms[:k] + terms[k + 1 :])
                first = others[0][1]
                keys.append((frozenset((v, s * first) for v, s in others), x, sign * first))
            match = next((key for key in keys if key[0] in known and known[key[0]][0] != key[1]), None)
            if match is None:
                kept.append(row)
                known |= {key: (x, sign) for key, x, sign in keys}
            else:
                key, x, sign = match
                other, its = known[key]
                equal.append((other, x, sign * its))
        rest.append(group if len(kept) == len(group) else group.take(np.array(kept, np.int64), group.template))
    return equal, [g for g in rest if len(g)]
