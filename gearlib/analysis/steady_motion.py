"""Steady motion of a model: every variable is ``a + b t``, and the coefficients solve the model's own equations.

A linear equation then splits into one for the constant part and one for the part that grows with time. Torques must not grow.
With that, a spring that carries a constant torque keeps its deflection, so elastic trains turn as rigid ones do; derivatives of
speeds vanish, so inertia takes no torque; what is left is kinematics and statics, coupled as in the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearlib.codegen.kernels import Kernel, partial_kernel, relation_kernel, residual_kernel
from gearlib.errors import ArgumentError
from gearlib.flatten.model import EquationGroup, FlatModel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
CONTRADICTION = 1e-8  # relative residual of an equation that cannot be met
RANK = 1e-11  # relative singular value below which a row says nothing new
SPEED, VALUE = 1, 0


@dataclass(frozen=True)
class Given:
    """A prescribed value: of a variable (order 0), or of its rate (order 1)."""

    name: str
    variable: int  # representative
    order: int
    value: float


@dataclass(frozen=True)
class Rows:
    """Linear equations between the ``2 n`` unknowns: constants ``a``, then rates ``b``."""

    matrix: Floats
    residual: Floats
    kinematic: NDArray[np.bool_]  # rows without torques
    owners: tuple[str, ...]


@dataclass(frozen=True)
class Motion:
    """The steady motion, and the directions in which it is not determined."""

    constants: Floats
    rates: Floats
    free: Floats  # (2 n, directions)
    residual: Floats
    owners: tuple[str, ...]


def argument(group: EquationGroup, name: str, order: int, a: Floats, b: Floats) -> Floats:
    """Values of a column of a group in the motion at t = 0."""
    j = group.template.locals.index(name)
    source = a if order == 0 else b
    values: Floats = source[group.variables[:, j]] * group.signs[:, j] if order < 2 else np.zeros(len(group))
    return values


def apply(
    model: FlatModel, kernel: Kernel, g: int, group: EquationGroup, parameters: Floats, a: Floats, b: Floats, modes: Floats
) -> Floats:
    """Values of a kernel of one group at t = 0, with the flags of events as they are."""
    template = kernel.template
    columns = [*template.columns, *template.relation_columns]
    arguments = [argument(group, *columns[c], a, b) for c in kernel.columns]
    n, rows, flags = len(template.relations), np.arange(len(group)), []
    for c in kernel.relations:
        place = model.first_relations[g] + rows * n + c if c < n else model.n_relations + group.held[:, c - n]
        flags.append(modes[place])
    constants = [parameters[group.parameters[:, p]] for p in kernel.parameters]
    with np.errstate(all="ignore"):
        value = kernel.function(0.0, *arguments, *constants, *flags)
    return np.broadcast_to(np.asarray(value, float), (len(group),))


def assemble(model: FlatModel, parameters: Floats, given: Sequence[Given], a: Floats, b: Floats, modes: Floats) -> Rows:
    """The equations of a steady motion, linearised about ``a + b t``. A binding to a function of time stands for zero."""
    n = model.n_variables
    replaced = {g.variable for g in given if g.order == VALUE}
    blocks: list[Floats] = []
    rest: list[Floats] = []
    kinematic: list[NDArray[np.bool_]] = []
    owners: list[str] = []
    for g, group in enumerate(model.groups):
        template, count = group.template, len(group)
        binding = template.label == "binding"
        keep = np.ones(count, bool)
        if binding:
            j = template.locals.index("bound")
            keep = np.array([v not in replaced for v in group.variables[:, j].tolist()], bool)
        constant, growth = np.zeros((count, 2 * n)), np.zeros((count, 2 * n))
        torques = np.zeros(count, bool)
        rows = np.arange(count)
        for c, (name, order) in enumerate(template.columns):
            j = template.locals.index(name)
            v = group.variables[:, j]
            p = apply(model, partial_kernel(template, c), g, group, parameters, a, b, modes) * group.signs[:, j]
            p = np.where(np.isfinite(p), p, 0.0)
            if not template.linear:
                p = np.where(model.potential[v] & (order == 0), 0.0, p)  # frozen at the angle
            if order < 2:
                np.add.at(constant, (rows, v + order * n), p)
            if order == 0:
                np.add.at(growth, (rows, v + n), p)
                torques |= model.flow[v] & (p != 0)
        if binding and template.on_time:
            value = argument(group, "bound", 0, a, b)
            constant[:] = 0.0
            constant[rows, group.variables[:, j]] = group.signs[:, j]
        else:
            value = apply(model, residual_kernel(template), g, group, parameters, a, b, modes)
        blocks += [constant[keep], growth[keep]]
        rest += [value[keep], (growth @ np.concatenate([a, b]))[keep]]
        kinematic += [~torques[keep], np.ones(int(keep.sum()), bool)]
        owners += 2 * [model.owner(g, i) for i in np.flatnonzero(keep).tolist()]
    steady = np.flatnonzero(model.flow & (model.representative == np.arange(n)))  # torques do not grow
    extra = np.zeros((len(steady), 2 * n))
    extra[np.arange(len(steady)), n + steady] = 1.0
    wanted = np.zeros((len(given), 2 * n))
    for i, item in enumerate(given):
        wanted[i, item.variable + item.order * n] = 1.0
    x = np.concatenate([a, b])
    blocks += [extra, wanted]
    rest += [extra @ x, wanted @ x - np.array([item.value for item in given])]
    kinematic += [np.ones(len(steady), bool), ~model.flow[[item.variable for item in given]] if given else np.empty(0, bool)]
    owners += ["connection"] * len(steady) + [item.name for item in given]
    return Rows(np.concatenate(blocks), np.concatenate(rest), np.concatenate(kinematic), tuple(owners))


@dataclass(frozen=True)
class Factors:
    """A singular value decomposition of a matrix whose rows and columns were scaled to similar size."""

    row: Floats
    column: Floats
    u: Floats
    s: Floats
    vt: Floats
    rank: int

    def solve(self, residual: Floats) -> Floats:
        """The smallest change that makes the residual as small as possible."""
        r = self.rank
        y = (self.u[:, :r].T @ (residual * self.row)) / self.s[:r]
        x: Floats = (self.vt[:r].T @ y) * self.column
        return x

    @property
    def free(self) -> Floats:
        """A basis of what the equations leave free, shape (unknowns, directions), in scaled unknowns."""
        basis: Floats = self.vt[self.rank :].T.copy()
        return basis


def factorise(matrix: Floats) -> Factors:
    """Scale and decompose."""
    size = np.abs(matrix)
    row, column = np.ones(matrix.shape[0]), np.ones(matrix.shape[1])
    for _ in range(8):
        scaled = size * row[:, None] * column
        row /= np.sqrt(np.where(scaled.any(axis=1), scaled.max(axis=1, initial=0.0), 1.0))
        column /= np.sqrt(np.where(scaled.any(axis=0), scaled.max(axis=0, initial=0.0), 1.0))
    missing = np.zeros((max(0, matrix.shape[1] - matrix.shape[0]), matrix.shape[1]))  # so that all directions come out
    u, s, vt = np.linalg.svd(np.concatenate([matrix * row[:, None] * column, missing]), full_matrices=False)
    u = u[: len(matrix)]
    rank = int((s > RANK * max(1.0, float(s[0]) if len(s) else 1.0)).sum())
    return Factors(row, column, u, s, vt, rank)


def solve(model: FlatModel, parameters: Floats, given: Sequence[Given]) -> Motion:
    """Newton's method for the unknowns, inside an iteration for the flags of events (which side of a lossy gear drives)."""
    n = model.n_variables
    x = np.zeros(2 * n)
    modes = initial_modes(model)
    for _ in range(40):
        for _ in range(30):
            rows = assemble(model, parameters, given, x[:n], x[n:], modes)
            factors = factorise(rows.matrix)
            change = factors.solve(rows.residual)
            x = x - change
            if np.abs(change / factors.column).max(initial=0.0) <= 1e-14 * np.abs(x / factors.column).max(initial=0.0):
                break
        new = settled_modes(model, parameters, x[:n], x[n:])
        if (new == modes).all():
            break
        modes = new
    rows = assemble(model, parameters, given, x[:n], x[n:], modes)
    factors = factorise(rows.matrix)
    size = np.abs(x / factors.column).max(initial=0.0)
    relative = np.abs(rows.residual) * factors.row / max(size, np.finfo(float).tiny)
    return Motion(x[:n], x[n:], factors.free, relative, rows.owners)


def kinematics(model: FlatModel, parameters: Floats, given: Sequence[Given] = ()) -> tuple[Rows, Factors]:
    """The equations between speeds alone, whatever the torques are."""
    zero = np.zeros(model.n_variables)
    rows = assemble(model, parameters, given, zero, zero, initial_modes(model))
    return rows, factorise(rows.matrix[rows.kinematic])


def initial_modes(model: FlatModel) -> Floats:
    """Relations false, discrete variables at their start values."""
    modes = np.zeros(model.n_modes)
    first, d = model.n_relations, len(model.discretes)
    if d:
        modes[first : first + d] = modes[first + d : first + 2 * d] = model.discretes.starts
        modes[first + 2 * d] = 1.0
    return modes


def settled_modes(model: FlatModel, parameters: Floats, a: Floats, b: Floats) -> Floats:
    """Relations and discrete variables of a run that is started in this motion."""
    modes = initial_modes(model)
    groups = [*model.groups, *(u.equations for u in model.discretes.updates)]
    first, d = model.n_relations, len(model.discretes)
    for _ in range(50):
        for _ in range(50):
            before = modes.copy()
            for g, group in enumerate(groups):
                for c, relation in enumerate(group.template.relations):
                    value = apply(model, relation_kernel(group.template, c), g, group, parameters, a, b, modes)
                    value = -value if relation.negated else value
                    flags = value > 0 if relation.strict else value >= 0
                    modes[model.first_relations[g] + np.arange(len(group)) * len(group.template.relations) + c] = flags
            for u, update in enumerate(model.discretes.updates):
                if not update.reinit:
                    g, kernel = len(model.groups) + u, residual_kernel(update.equations.template)
                    modes[first + update.targets] = apply(model, kernel, g, update.equations, parameters, a, b, modes)
            if (before == modes).all():
                break
        if not d:
            break
        old = modes[first + d : first + 2 * d].copy()
        modes[first + d : first + 2 * d] = modes[first : first + d]
        modes[first + 2 * d] = 0.0
        if (old == modes[first : first + d]).all():
            break
    return modes


def refuse_contradiction(motion: Motion, given: Sequence[Given]) -> None:
    bad = np.flatnonzero(motion.residual > CONTRADICTION)
    if len(bad):
        owners = list(dict.fromkeys(motion.owners[i] for i in bad[np.argsort(-motion.residual[bad])]))
        named = [o for o in owners if o != "connection"][:6]
        raise ArgumentError(
            f"no steady motion has the given {', '.join(g.name for g in given) or 'torques'}: the equations of {', '.join(named)} cannot "
            "hold; give fewer values, leave a driving torque unbound, or close gaps (backlash parameters = 0)"
        )
