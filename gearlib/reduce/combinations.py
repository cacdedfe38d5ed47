"""Linear combinations of equations in which the highest derivatives cancel; each replaces one of its equations.

Structural index reduction does not see numerical cancellation: three dampers between three massless nodes leave their common speed
undetermined. Where the rows of constant coefficients A of the highest derivatives are linearly dependent, ``y' A = 0``, the sum of these
equations with the weights y contains lower derivatives only: a hidden constraint, which must be differentiated like any other (the springs
at those nodes balance each other). It replaces the equation of the sum that is differentiated least often, which follows from it and the
others.

References
----------
N. S. Nedialkov, G. Tan, J. D. Pryce, "Conversion methods for improving structural analysis of differential-algebraic equation systems",
BIT Numerical Mathematics 57 (2017) 845-865, doi 10.1007/s10543-017-0655-z: the linear combination method.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy

from gearlib.equations.bindings import discrete_name
from gearlib.equations.kernel import differentiated, partial_kernel
from gearlib.equations.template import Relation, Template, column_symbol, make_template, relation_symbol
from gearlib.flatten.model import EquationGroup, FlatModel, Floats
from gearlib.reduce.coefficients import some
from gearlib.reduce.reduction import Structure
from gearlib.reduce.redundancy import without
from gearlib.structure.incidence import Node
from gearlib.structure.sorting import Block, reach, sort_blocks

DEPENDENT = 1e-11  # singular value of scaled rows, relative to the largest, that counts as zero
CANCELLED = 1e-9  # sum of coefficients over the sum of their magnitudes that counts as zero
MOST = 400  # unknowns of the largest block that is examined
BESIDE = 1e-3  # relative perturbation of a parameter, which shows whether the cancellation depends on its value


@dataclass(frozen=True)
class CancellingSum:
    """A sum of equations in which derivatives cancel, and the equation that it replaces.

    Attributes
    ----------
    terms : tuple of (equation, times differentiated, weight)
    replaced : int
        One of these equations.
    gone : tuple of nodes
        Variables, with their orders, that cancel.
    decisive : tuple of int
        Parameters at whose present values only they cancel.
    """

    terms: tuple[tuple[int, int, float], ...]
    replaced: int
    gone: tuple[Node, ...]
    decisive: tuple[int, ...] = ()


def combinations(structure: Structure, parameters: Floats, targets: Iterable[Node]) -> tuple[CancellingSum, ...]:
    """The sums of equations in which unknowns of some targets cancel; a sum in which nothing remains is left out.

    Parameters
    ----------
    structure : Structure
    parameters : array
        The complete vector.
    targets : iterable of nodes
        What a run computes: the derivatives of its states.
    """
    unknowns, _ = reach(structure, targets, dynamic=True, events=True)
    blocks = [b for b in sort_blocks(structure, unknowns) if 1 < len(b) <= MOST]
    return tuple(found for block in blocks for found in _of_block(structure, block, parameters))


def cancel(structure: Structure, found: Sequence[CancellingSum], parameters: Floats) -> bool:
    """Whether the same derivatives cancel with these parameters, too."""
    return all(set(c.gone) <= _cancelled(structure, c.terms, parameters) for c in found)


def replaced(structure: Structure, found: Sequence[CancellingSum]) -> FlatModel:
    """The model with the sums in place of equations."""
    model = structure.model
    sums = [_combined(structure, combination) for combination in found]
    return model.with_groups((*without(model, [c.replaced for c in found]).groups, *sums), model.redundant)


@dataclass(frozen=True)
class _Equation:
    """One equation, differentiated a number of times: a template, and the row of a group that holds its variables and parameters."""

    template: Template
    group: EquationGroup
    place: int

    def nodes(self) -> list[tuple[int, Node, int]]:
        """(column, node, sign) of its variables, except those that are identically zero."""
        where = {name: j for j, name in enumerate(self.group.template.locals)}
        variables, signs = self.group.variables[self.place].tolist(), self.group.signs[self.place].tolist()
        named = [(c, where[name], order) for c, (name, order) in enumerate(self.template.columns)]
        return [(c, (variables[j], order), signs[j]) for c, j, order in named if signs[j]]

    def parameters(self, column: int) -> list[int]:
        """The parameters that a constant coefficient depends on."""
        kernel, own = partial_kernel(self.template, column), self.group.template.parameters
        return [int(self.group.parameters[self.place, own.index(self.template.parameters[p])]) for p in kernel.parameters]

    def coefficient(self, column: int, sign: int, parameters: Floats) -> float:
        """A constant coefficient."""
        with np.errstate(all="ignore"):
            value = partial_kernel(self.template, column).function(0.0, *parameters[self.parameters(column)])
        return sign * float(value)


def _row(structure: Structure, equation: int, times: int) -> _Equation:
    g, i = structure.model.places[equation]
    group = structure.model.groups[g]
    return _Equation(differentiated(group.template, times), group, i)


def _of_block(structure: Structure, block: Block, parameters: Floats) -> list[CancellingSum]:
    """The sums of the equations of one block."""
    place = {node: c for c, node in enumerate(block)}
    solving = sorted((structure.equation(node) for node in block), key=lambda row: (row[1], row[0]))
    rows: list[tuple[int, int]] = []
    entries: list[Floats] = []
    for e, k in solving:
        row, values = _row(structure, e, k), np.zeros(len(block))
        inside = [(c, node, sign) for c, node, sign in row.nodes() if node in place]
        if all(row.template.fixed[c] for c, _, _ in inside):
            for c, node, sign in inside:
                values[place[node]] += row.coefficient(c, sign, parameters)
            rows.append((e, k))
            entries.append(values)
    if not rows or not np.isfinite(entries).all():
        return []
    found = []
    for weights in dependent_rows(np.array(entries)):
        used = np.flatnonzero(weights).tolist()
        first, least = rows[used[0]]  # they are sorted by how often they are differentiated; it has the weight 1
        terms = tuple((rows[r][0], rows[r][1] - least, float(weights[r])) for r in used)
        gone = _cancelled(structure, terms, parameters)
        held = {node for e, k, _ in terms for _, node, _ in _row(structure, e, k).nodes()}
        if not {(v, order - least) for v, order in block} & held <= gone or held <= gone:
            continue
        combination = CancellingSum(terms, first, tuple(sorted(gone)))
        found.append(replace(combination, decisive=_decisive(structure, combination, parameters)))
    return found


def dependent_rows(matrix: Floats) -> list[Floats]:
    """A basis of the weights with which rows add up to zero, in reduced echelon form: no vector contains the first row of another.

    Examples
    --------
    Three dampers between three nodes, ``tau = d (w_a - w_b)`` with their balances put in:

    >>> [w.tolist() for w in dependent_rows(np.array([[2.0, -1.0, -1.0], [-1.0, 4.0, -3.0], [-1.0, -3.0, 4.0]]))]
    [[1.0, 1.0, 1.0]]
    >>> dependent_rows(np.eye(2))
    []
    """
    row_scale = np.abs(matrix).max(axis=1)
    if not row_scale.all():  # nothing is left of such an equation
        return []
    scaled = matrix / row_scale[:, None]
    column_scale = np.abs(scaled).max(axis=0)
    scaled = scaled / np.where(column_scale > 0, column_scale, 1.0)
    left, sizes, _ = np.linalg.svd(scaled)
    rank = int((sizes > DEPENDENT * sizes.max(initial=0.0)).sum())
    vectors = left[:, rank:].T.copy()
    lead = 0
    for column in range(vectors.shape[1]):
        if lead == len(vectors):
            break
        best = lead + int(np.argmax(np.abs(vectors[lead:, column])))
        if abs(vectors[best, column]) < CANCELLED:
            continue
        vectors[[lead, best]] = vectors[[best, lead]]
        vectors[lead] /= vectors[lead, column]
        others = np.arange(len(vectors)) != lead
        vectors[others] -= vectors[others, column, None] * vectors[lead]
        lead += 1
    vectors[np.abs(vectors) < CANCELLED] = 0.0
    weights = [vector / row_scale for vector in vectors]
    plain = [w / w[np.flatnonzero(w)[0]] for w in weights]
    return [np.where(np.abs(w - np.round(w)) < 1e-12 * np.abs(w).max(), np.round(w), w) for w in plain]


def _cancelled(structure: Structure, terms: Sequence[tuple[int, int, float]], parameters: Floats) -> set[Node]:
    """The variables, with their orders, that have constant coefficients in the terms, which cancel in the sum."""
    total: dict[Node, float] = {}
    size: dict[Node, float] = {}
    for e, k, weight in terms:
        row = _row(structure, e, k)
        for c, node, sign in row.nodes():
            constant = row.template.fixed[c]
            value = weight * row.coefficient(c, sign, parameters) if constant else np.nan
            total[node] = total.get(node, 0.0) + value
            size[node] = size.get(node, 0.0) + abs(value)
    return {node for node, value in total.items() if abs(value) <= CANCELLED * size[node]}


def _decisive(structure: Structure, combination: CancellingSum, parameters: Floats) -> tuple[int, ...]:
    """The parameters of the cancelling coefficients that undo the cancellation when they are perturbed."""
    involved: set[int] = set()
    for e, k, _ in combination.terms:
        row = _row(structure, e, k)
        for c, node, _ in row.nodes():
            if node in combination.gone:
                involved.update(row.parameters(c))
    found = []
    for p in sorted(involved):
        beside = parameters.copy()
        beside[p] += BESIDE * (abs(beside[p]) or 1.0)
        if not cancel(structure, [combination], beside):
            found.append(p)
    return tuple(found)


def _combined(structure: Structure, combination: CancellingSum) -> EquationGroup:
    """The sum as a template of its own, over the variables and parameters of the model."""
    model, gone = structure.model, set(combination.gone)
    residual: sympy.Expr = sympy.S.Zero
    relations: list[Relation] = []
    parameters: dict[str, int] = {}
    discretes: dict[str, int] = {}
    for e, k, weight in combination.terms:
        row = _row(structure, e, k)
        group, i = row.group, row.place
        where = {name: j for j, name in enumerate(group.template.locals)}
        table: dict[sympy.Symbol, sympy.Expr] = {}
        for name, order in (*row.template.columns, *row.template.relation_columns):
            v, sign = int(group.variables[i, where[name]]), int(group.signs[i, where[name]])
            table[column_symbol((name, order))] = sign * column_symbol((f"v{v}", order))
        for j, name in enumerate(group.template.parameters):
            parameters[f"p{group.parameters[i, j]}"] = int(group.parameters[i, j])
            table[sympy.Symbol(name, real=True)] = sympy.Symbol(f"p{group.parameters[i, j]}", real=True)
        for j, name in enumerate(group.template.discretes):
            place = int(group.discretes[i, j])
            held = name if name == "initial()" else discrete_name(place, name.startswith("pre("))
            discretes[held] = place
            table[sympy.Symbol(name, real=True)] = sympy.Symbol(held, real=True)
        for j in range(len(row.template.relations)):
            table[relation_symbol(j)] = relation_symbol(len(relations) + j)
        relations += [replace(r, g=r.g.xreplace(table)) for r in row.template.relations]
        absent = {column_symbol((f"v{v}", order)): sympy.S.Zero for v, order in gone}
        value = sympy.Integer(int(weight)) if float(weight).is_integer() else sympy.Float(weight)
        residual += value * row.template.residual.xreplace(table).xreplace(absent)
    owners = [model.owner(*structure.model.places[e]) for e, _, _ in combination.terms]
    named = [o for o in dict.fromkeys(owners) if o != "connection"]
    label = (
        f"what the equations of {some(named, ', ')} leave of each other" if named else "what connections leave of each other"
    )
    template = make_template(label, sympy.expand_mul(residual), parameters, tuple(relations), discretes)
    variables = np.array([[int(name[1:]) for name in template.locals]], np.int64)
    g, i = structure.model.places[combination.replaced]
    return EquationGroup(
        template, variables, np.ones_like(variables), np.array([[parameters[n] for n in template.parameters]], np.int64),
        model.groups[g].owners[i : i + 1], np.array([[discretes[n] for n in template.discretes]], np.int64),
    )  # fmt: skip
