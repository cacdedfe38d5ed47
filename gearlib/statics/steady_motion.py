"""Steady motion: every variable is ``a + b t``, with coefficients from the model's own equations.

A linear equation then splits into one for the constant part and one for the part that grows with time; torques must not grow. So a
spring with constant torque keeps its deflection, and elastic trains turn like rigid ones; derivatives of speeds vanish, so inertias
take no torque; what remains are kinematics and statics, coupled as in the model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import partial_kernel, relation_kernel, residual_kernel
from gearlib.errors import ArgumentError
from gearlib.flatten.model import EquationGroup, FlatModel
from gearlib.flatten.time_means import off_mean
from gearlib.language.declarations import Flow
from gearlib.language.units import SECOND
from gearlib.program.newton import Correction, newton
from gearlib.statics.mesh_turn import Periodic, Turn, apply, generic, mean, nonlinear_columns, periodic_columns, phases_of, turn
from gearlib.structure.sparse_elimination import Factors, factorise

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
CONTRADICTION = 1e-8  # relative residual of an equation that cannot be satisfied
ROUNDING = 1e-13  # in equations that are not linear: of a row's largest coefficient, and of their largest unknown
YIELDS = 1e-20  # relative: smaller terms only make the torque that holds a speed an unknown of its equation
REST = 1e-9  # rad/s or m/s: below it a train stands still, and its speeds are rounding
UNDETERMINED = 1e-8  # of a scaled free motion of about 1; such motions are accurate to about 1e-13
LONGEST = 20  # values that follow one from another without torques
SPEED, VALUE = 1, 0


@dataclass(frozen=True)
class Given:
    """A prescribed value of a variable (order 0) or of its rate (order 1)."""

    name: str
    variable: int  # number of the representative
    order: int
    value: float


@dataclass(frozen=True, eq=False)
class MotionEquations:
    """Linear equations in the ``2 n`` unknowns: constants ``a``, then rates ``b``."""

    matrix: Any  # sparse
    residual: Floats
    kinematic: NDArray[np.bool_]  # rows without torques
    owner: Callable[[int], str]  # path of the component that a row comes from
    sizes: Floats  # of the unknowns, see `unit_sizes`
    turning: NDArray[np.bool_]  # variables over whose turn the equations are averaged


@dataclass(frozen=True, eq=False)
class Motion:
    """A steady motion, with a measure of indeterminacy for each unknown (0: determined)."""

    constants: Floats
    rates: Floats
    undetermined: Floats
    residual: Floats  # of each row, relative
    factors: Factors
    owner: Callable[[int], str]
    discrete: Floats


class MatrixAssembly:
    """Incremental assembly of a sparse matrix in coordinate format."""

    def __init__(self) -> None:
        self.count = 0
        self._parts: list[tuple[Integers, Integers, Floats]] = []

    def put(self, rows: Integers, columns: Integers, values: Floats) -> None:
        """Add entries, with rows counted from the first of the current block."""
        self._parts.append((rows + self.count, columns, values))

    def matrix(self, columns: int) -> Any:
        import scipy.sparse as sparse

        rows, places, values = (np.concatenate([p[k] for p in self._parts]) for k in range(3))
        return sparse.csr_matrix((values.astype(float), (rows, places)), shape=(self.count, columns))


def assemble(
    model: FlatModel, parameters: Floats, given: Sequence[Given], a: Floats, b: Floats, discrete: Floats,
    still: NDArray[np.bool_] | None = None,
) -> MotionEquations:  # fmt: skip
    """Equations of a steady motion, linearised about ``a + b t``, in which some variables are known to stand ``still``.

    Sinusoids of time count with their mean, other functions of time with their value at 0.
    """
    n = model.n_variables
    entries = MatrixAssembly()
    rest: list[Floats] = []
    kinematic: list[NDArray[np.bool_]] = []
    linear: list[NDArray[np.bool_]] = []
    writers: list[tuple[int, Integers]] = []  # group, and the row in it of each line
    periodic = periodic_columns(model, parameters, a, b, discrete, np.zeros(n, bool) if still is None else still)
    over = turn(model, parameters, periodic, a, b, discrete)
    replaced = np.array([g.variable for g in given if g.order == VALUE], np.int64)
    for g, group in enumerate(model.groups):
        keep = np.arange(len(group))
        if group.template.binds:
            keep = np.flatnonzero(~np.isin(group.variables[:, group.template.locals.index("bound")], replaced))
        value, torques = _group(model, entries, g, keep, parameters, a, b, discrete, periodic.get(g, {}), over)
        rest.append(value)
        kinematic += [~torques, np.ones(len(keep), bool)]
        linear.append(np.full(2 * len(keep), group.template.linear))
        writers += [(g, keep), (g, keep)]
    x = np.concatenate([a, b])
    steady = np.flatnonzero(model.flow & (model.representative == np.arange(n)))  # torques do not grow
    entries.put(np.arange(len(steady)), n + steady, np.ones(len(steady)))
    entries.count += len(steady)
    places = np.array([item.variable + item.order * n for item in given], np.int64)
    entries.put(np.arange(len(given)), places, np.ones(len(given)))
    entries.count += len(given)
    rest += [x[n + steady], x[places] - np.array([item.value for item in given])]
    kinematic += [np.ones(len(steady), bool), ~model.flow[[item.variable for item in given]] if given else np.empty(0, bool)]
    ends = np.cumsum([len(rows) for _, rows in writers])

    def owner(row: int) -> str:
        part = int(np.searchsorted(ends, row, side="right"))
        if part < len(writers):
            group, rows = writers[part]
            return model.owner(group, int(rows[row - (ends[part - 1] if part else 0)]))
        row -= int(ends[-1]) if len(ends) else 0
        return "connection" if row < len(steady) else given[row - len(steady)].name

    matrix = entries.matrix(2 * n)
    units = np.concatenate([model.exponents, model.exponents - np.array(SECOND, float)])
    sizes = unit_sizes(matrix, units, np.concatenate(linear))
    return MotionEquations(matrix, np.concatenate(rest), np.concatenate(kinematic), owner, sizes, phases_of(model, periodic))


def unit_sizes(matrix: Any, exponents: Floats, linear: NDArray[np.bool_]) -> Floats:
    """Sizes of the unknowns: their units, made of base units in which coefficients are as close to 1 as possible; NaN: unit not known.

    A train and the same one in other units so have the same scaled equations. Sums of magnitudes are minimised (by reweighted least
    squares), so that a few coefficients far from the others have little effect; in rows that are not ``linear`` very small ones have
    none, which may be rounding.
    """
    entries = matrix[: len(linear)].tocoo()
    size = np.abs(entries.data)
    least = np.zeros(len(linear))
    np.maximum.at(least, entries.row, np.where(linear[entries.row], 0.0, ROUNDING * size))
    kept = (size > least[entries.row]) & np.isfinite(exponents[entries.col]).all(axis=1)
    i, of_unknowns = entries.row[kept], exponents[entries.col[kept]]
    terms = np.column_stack([-np.log(size[kept]), of_unknowns])
    count = np.maximum(np.bincount(i, minlength=len(linear)), 1)
    terms -= np.column_stack([np.bincount(i, t, len(count)) / count for t in terms.T])[i]  # each row has a scale of its own
    wanted, known = terms[:, 0], terms[:, 1:]
    weights = np.ones(len(wanted))
    for _ in range(10):
        units = np.linalg.lstsq((known.T * weights) @ known, (known.T * weights) @ wanted, rcond=1e-9)[0]
        weights = 1 / np.maximum(1.0, np.abs(wanted - known @ units))
    return np.asarray(np.exp(exponents @ units), float)


def _group(
    model: FlatModel, entries: MatrixAssembly, g: int, keep: Integers, parameters: Floats, a: Floats, b: Floats, discrete: Floats,
    periodic: Mapping[int, Periodic], over: Turn | None,
) -> tuple[Floats, NDArray[np.bool_]]:  # fmt: skip
    """Rows of one group: constant parts, then growing parts. Returns the residuals, and the mask of rows with torques."""
    group, n, count = model.groups[g], model.n_variables, len(keep)
    template = group.template
    torques, growth, rows = np.zeros(len(group), bool), np.zeros(len(group)), np.arange(count)
    own = {c: group.variables[:, template.locals.index(name)] for c, (name, _) in enumerate(template.columns)}
    for c, (name, order) in enumerate(template.columns):
        j, v = template.locals.index(name), own[c]
        slope = mean(model, partial_kernel(template, c), g, group, parameters, a, b, discrete, over)
        p = np.where(np.isfinite(slope), slope * group.signs[:, j], 0.0)
        grows = p
        if c in periodic:
            grows = np.where(periodic[c].grow, p, 0.0)  # periodic terms do not grow
            p = np.where(periodic[c].turns, grows, p)
        if order == 0 and c in partial_kernel(template, c).columns and c not in periodic and not p.all():
            deflected = a.copy()
            for k in nonlinear_columns(template):  # all at once: the difference of two that grow may stay
                deflected[own[k]] = generic(a)[own[k]]
            elsewhere = (
                apply(model, partial_kernel(template, c), g, group, parameters, deflected, b, discrete) * group.signs[:, j]
            )
            hardens = (p == 0) & np.isfinite(elsewhere)
            # a spring without stiffness at rest: it has some where it is deflected, and its deflection may not grow
            grows = p = np.where(hardens, elsewhere, p)
        if order < 2:
            entries.put(rows, v[keep] + order * n, p[keep])
        if order == 0:
            entries.put(rows + count, v[keep] + n, grows[keep])
            growth += grows * b[v]
            torques |= model.flow[v] & (p != 0)
            absent = (group.signs[:, j] == 0) & (slope != 0)
            if absent.any():
                torques |= absent & forces(model, g, name)
    value = mean(model, residual_kernel(template), g, group, parameters, a, b, discrete, over)
    if template.timed:
        value = value - np.nan_to_num(off_mean(group, parameters))
    entries.count += 2 * count
    return np.concatenate([value[keep], growth[keep]]), torques[keep]


def forces(model: FlatModel, g: int, name: str) -> NDArray[np.bool_]:
    """Whether a variable of a group's components is a torque or a force, even an identically zero one of an unconnected port."""
    owners = [model.instances[i].declared.variables.get(name) if i >= 0 else None for i in model.groups[g].owners.tolist()]
    return np.array([d is not None and (isinstance(d, Flow) or d.unit in ("N.m", "N")) for d in owners], bool)


def solve(model: FlatModel, parameters: Floats, given: Sequence[Given], near: Sequence[Given] = ()) -> Motion:
    """The steady motion by Newton's method: near given speeds if there are any, else from rest, or from the model's guesses."""
    n = model.n_variables
    if near:
        return motion_from(model, parameters, given, speeds_near(model, parameters, given, near))
    motion = motion_from(model, parameters, given, np.zeros(2 * n))
    if (motion.residual > CONTRADICTION).any() and any(not group.template.linear for group in model.groups):
        other = motion_from(model, parameters, given, speeds_near(model, parameters, given, guesses(model, parameters)))
        if not (other.residual > CONTRADICTION).any():
            return other
    return motion


def guesses(model: FlatModel, parameters: Floats) -> list[Given]:
    """The speeds for which the model has start values or guesses."""
    found = []
    for v, slot in zip(model.started.tolist(), model.start_slots.tolist(), strict=True):
        rep, sign = int(model.representative[v]), int(model.sign[v])
        if sign and not model.flow[rep] and not model.potential[rep] and parameters[slot]:
            found.append(Given("guess", rep, VALUE, sign * float(parameters[slot])))
    return found


def held(model: FlatModel, parameters: Floats, motion: Motion) -> list[Given]:
    """The speeds that locked clutches and brakes hold, with their values in a motion.

    Their equations are ``der(v) = 0`` in this discrete state, which every constant speed meets.
    """
    found = []
    for group, rate, slopes in _locking(model, parameters, motion):
        others = np.max([s for c, s in enumerate(slopes) if c != rate], axis=0, initial=0.0)
        own = group.variables[:, group.template.locals.index(group.template.columns[rate][0])]
        for v in own[others < YIELDS * slopes[rate]].tolist():
            value = float(motion.constants[v])
            found.append(Given(model.name(v), v, VALUE, value if abs(value) > REST else 0.0))
    return found


def yields(model: FlatModel, parameters: Floats, motion: Motion) -> Floats:
    """The artificial compliance of each variable in the equations of what is locked; 0 for all others."""
    found = np.zeros(model.n_variables)
    for group, rate, slopes in _locking(model, parameters, motion):
        for c, (name, _) in enumerate(group.template.columns):
            small = (slopes[c] > 0.0) & (slopes[c] < YIELDS * slopes[rate])
            places = group.variables[:, group.template.locals.index(name)]
            np.maximum.at(found, places[small], (slopes[c] / np.where(slopes[rate] > 0.0, slopes[rate], 1.0))[small])
    return found


def _locking(model: FlatModel, parameters: Floats, motion: Motion) -> Iterator[tuple[EquationGroup, int, list[Floats]]]:
    """Equations that may lock: their group, the column of the rate in it, and the magnitudes of all slopes."""
    for g, group in enumerate(model.groups):
        template = group.template
        rates = [c for c, (_, order) in enumerate(template.columns) if order == 1]
        if len(rates) != 1 or not (template.relations or group.discretes.shape[1]):
            continue
        numbers = parameters, motion.constants, motion.rates, motion.discrete
        kernels = [partial_kernel(template, c) for c in range(len(template.columns))]
        yield group, rates[0], [np.abs(apply(model, kernel, g, group, *numbers)) for kernel in kernels]


def speeds_near(model: FlatModel, parameters: Floats, given: Sequence[Given], near: Sequence[Given]) -> Floats:
    """Consistent speeds, as close as possible to the wanted ones."""
    zero = np.zeros(model.n_variables)
    rows = assemble(model, parameters, [*given, *near], zero, zero, model.initial_discrete())
    return -factorise(rows.matrix[np.flatnonzero(rows.kinematic)], rows.sizes).solve(rows.residual[rows.kinematic])


def speeds_only(model: FlatModel, parameters: Floats, given: Sequence[Given], near: Sequence[Given]) -> Motion:
    """The motion near given speeds without torques, in the discrete state that it starts in."""
    n, x = model.n_variables, speeds_near(model, parameters, given, near)
    discrete = settled_discrete(model, parameters, x[:n], x[n:])
    rows = assemble(model, parameters, given, x[:n], x[n:], discrete)
    factors = factorise(rows.matrix, rows.sizes)
    return Motion(x[:n], x[n:], factors.undetermined, factors.contradiction(rows.residual, x), factors, rows.owner, discrete)


def motion_from(model: FlatModel, parameters: Floats, given: Sequence[Given], x: Floats) -> Motion:
    """Newton's method for the unknowns, inside an iteration for the discrete state (such as the driving side of a lossy gear).

    Nothing is averaged over the turn of an angle that turns out to stand still, at a place that the equations determine, or of one that
    must stand still, as that of a coupling whose mean torque over a turn is zero.
    """
    n = model.n_variables
    still, begin = np.zeros(n, bool), x
    while True:
        motion, averaged = _settled(model, parameters, given, x, still)
        if (motion.residual > CONTRADICTION).any():
            standing, x = averaged & ~model.potential, begin
        else:
            known = (motion.undetermined.reshape(2, n) <= UNDETERMINED).all(axis=0)
            standing, x = averaged & known & (np.abs(motion.rates) <= REST), np.concatenate([motion.constants, motion.rates])
        if not standing.any():
            return motion
        still |= standing


def _settled(
    model: FlatModel, parameters: Floats, given: Sequence[Given], x: Floats, still: NDArray[np.bool_]
) -> tuple[Motion, NDArray[np.bool_]]:
    """The motion in which some variables stand ``still``, and those over whose turn its equations are averaged."""
    n = model.n_variables
    discrete = settled_discrete(model, parameters, x[:n], x[n:])
    last: Factors | None = None

    def equations(x: Floats) -> tuple[Floats, Correction]:
        nonlocal last
        rows = assemble(model, parameters, given, x[:n], x[n:], discrete, still)
        last = _factors(rows, last)
        return rows.residual, last.solve

    def settled(x: Floats, change: Floats, _: Floats) -> bool:
        assert last is not None, "the change is that of these factors"
        return is_rounding(change, x, last.column)

    for _ in range(40):
        x = newton(equations, x, settled, 30).x
        new = settled_discrete(model, parameters, x[:n], x[n:])
        if (new == discrete).all():
            break
        discrete = new
    rows = assemble(model, parameters, given, x[:n], x[n:], discrete, still)
    factors = _factors(rows, last)
    contradiction = factors.contradiction(rows.residual, x)
    motion = Motion(x[:n], x[n:], factors.undetermined, contradiction, factors, rows.owner, discrete)
    return motion, rows.turning


def _factors(rows: MotionEquations, last: Factors | None) -> Factors:
    """Factors of the equations; the previous ones if their matrix is unchanged."""
    return last if last is not None and not (rows.matrix != last.matrix).nnz else factorise(rows.matrix, rows.sizes)


def kinematics(
    model: FlatModel, parameters: Floats, wanted: Integers, given: Sequence[Given] = ()
) -> tuple[MotionEquations, Factors, Integers]:
    """The equations between speeds alone, independent of torques: the rows on which the wanted unknowns depend."""
    rows = kinematic_rows(model, parameters, given, model.initial_discrete())
    found = connected(rows, wanted)
    if model.n_relations:  # backlash is taken up: a mesh inside its gap turns its wheels as soon as it has crossed it
        touching = model.initial_discrete()
        touching[: model.n_relations] = 1.0
        rows_closed = kinematic_rows(model, parameters, given, touching)
        closed = connected(rows_closed, wanted)
        if len(closed[0].open) < len(found[0].open):
            rows, found = rows_closed, closed
    return rows, *found


def kinematic_rows(model: FlatModel, parameters: Floats, given: Sequence[Given], discrete: Floats) -> MotionEquations:
    """The kinematic equations, linearised about the values that follow without torques (a stiffness, for instance)."""
    n = model.n_variables
    x = np.zeros(2 * n)
    rows = assemble(model, parameters, given, x[:n], x[n:], discrete)
    for _ in range(LONGEST if any(not group.template.linear for group in model.groups) else 0):
        still, before = np.flatnonzero(rows.kinematic), x[:n]
        x = x - factorise(rows.matrix[still], rows.sizes).solve(rows.residual[still])
        x[n:] = 0.0
        rows = assemble(model, parameters, given, x[:n], x[n:], discrete)
        if is_rounding(x[:n] - before, x[:n], np.where(np.isfinite(rows.sizes), rows.sizes, 1.0)[:n]):
            break
    return replace(rows, residual=rows.residual - rows.matrix @ x)  # residual at zero unknowns


def is_rounding(change: Floats, x: Floats, sizes: Floats) -> bool:
    """Whether the last change of some unknowns is rounding: a next one would not be smaller."""
    return bool(np.abs(change / sizes).max(initial=0.0) <= ROUNDING * np.abs(x / sizes).max(initial=0.0))


def connected(rows: MotionEquations, wanted: Integers) -> tuple[Factors, Integers]:
    """Factors of the kinematic rows on which the wanted unknowns depend, and these rows."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    matrix = rows.matrix[np.flatnonzero(rows.kinematic)]
    matrix.eliminate_zeros()
    m, n = matrix.shape
    entries = matrix.tocoo()
    graph = csr_matrix((np.ones(len(entries.data)), (entries.row, m + entries.col)), shape=(m + n, m + n))
    parts = connected_components(graph, directed=False)[1]
    chosen = np.flatnonzero(np.isin(parts[:m], parts[m + wanted]))
    return factorise(matrix[chosen], rows.sizes), np.flatnonzero(rows.kinematic)[chosen]


def settled_discrete(model: FlatModel, parameters: Floats, a: Floats, b: Floats) -> Floats:
    """Relations and discrete variables of a run that starts in this motion."""
    discrete = model.initial_discrete()
    first, d = model.n_relations, len(model.discretes)
    for _ in range(50):
        for _ in range(50):
            before = discrete.copy()
            _sweep(model, parameters, a, b, discrete)
            if (before == discrete).all():
                break
        if not d:
            break
        old = discrete[first + d : first + 2 * d].copy()
        discrete[first + d : first + 2 * d] = discrete[first : first + d]
        discrete[first + 2 * d] = 0.0
        if (old == discrete[first : first + d]).all():
            break
    return discrete


def _sweep(model: FlatModel, parameters: Floats, a: Floats, b: Floats, discrete: Floats) -> None:
    """Evaluate every relation and discrete variable once, in place; what is compared is equal where rounding decides."""
    groups = [*model.groups, *(u.equations for u in model.updates)]
    tie = ROUNDING * (generic(a) - a) * a
    for g, group in enumerate(groups):
        for c, relation in enumerate(group.template.relations):
            compared = relation_kernel(group.template, c)
            more, less = (apply(model, compared, g, group, parameters, x, b, discrete) for x in (a + tie, a - tie))
            value = np.where((more > 0) == (less > 0), -more if relation.negated else more, 0.0)
            flags = value > 0 if relation.strict else value >= 0
            discrete[model.first_relations[g] + np.arange(len(group)) * len(group.template.relations) + c] = flags
    for u, update in enumerate(model.updates):
        if not update.reinit:
            g, kernel = len(model.groups) + u, residual_kernel(update.equations.template)
            value = apply(model, kernel, g, update.equations, parameters, a, b, discrete)
            discrete[model.n_relations + update.targets] = value


def refuse_unsettled(model: FlatModel, parameters: Floats, motion: Motion) -> None:
    """Raise an error that names the discrete variables which change again and again, as ``n = 1 - pre(n)`` does."""
    first, again = model.n_relations, motion.discrete.copy()
    _sweep(model, parameters, motion.constants, motion.rates, again)
    changed = np.flatnonzero((again != motion.discrete)[first : first + len(model.discretes)])
    if len(changed):
        raise ArgumentError(
            f"there is no steady motion: {', '.join(model.discretes[i] for i in changed[:6])} does not settle, each event changes it"
        )


def refuse_contradiction(motion: Motion, given: Sequence[Given]) -> None:
    """Raise an error that names the components whose equations contradict each other or the given values."""
    bad = np.flatnonzero(motion.residual > CONTRADICTION)
    if len(bad):
        worst = int(bad[np.argmax(motion.residual[bad])])
        weights = np.abs(motion.factors.combined(worst))
        involved = np.flatnonzero(weights > 1e-9 * weights.max())
        names = {g.name for g in given}
        owners = dict.fromkeys(motion.owner(i) for i in (worst, *involved[np.argsort(-weights[involved])].tolist()))
        named = [o for o in owners if o != "connection" and o not in names][:6] or ["connections"]
        raise ArgumentError(
            f"no steady motion has the given {', '.join(g.name for g in given) or 'torques'}: the equations of {', '.join(named)} cannot "
            "hold; give fewer values, leave a driving torque unbound, close gaps (backlash parameters = 0), or, for a load that "
            "depends on speed, start near its speed: guess={'w': ...}"
        )
