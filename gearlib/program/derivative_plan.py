"""Symbolic plan of a program's sparse forward differentiation: which products of factors are summed into which entry.

Derivatives with respect to seeds are propagated forward through the steps of a program. Every slot has a row of entries, one for each
seed that it depends on; entries are numbered consecutively. A batch contributes sums of products of its partial derivatives (factors)
with entries of its arguments (sources); a block solves its linearised equations for the entries of all its unknowns. The plan consists
of integers and is independent of numerical values, so it is made once and evaluated at one point or many by
`gearlib.program.derivatives`, or printed: as Python by `gearlib.program.scalars`, as native code by `gearlib.native.jacobian`.

A seed enters at slots of states and inputs (a derivative with respect to them); at computed slots (a perturbation added to their
value); or at quantities held constant during an evaluation: entries of the parameter table, discrete variables, time.

References
----------
A. Griewank, A. Walther, "Evaluating Derivatives", 2nd ed., SIAM, 2008, chapter 3 (forward mode) and section 7.2 (sparsity).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from gearlib.program.program import Batch, Linear, Newton, Program, Step, slots_behind

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Entering = tuple[int, int]  # slot, or n_slots + parameter, or `TIME`, or the code made by `discrete_entry`; seed
TIME = -1
_NONE = np.empty(0, np.int64)


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums of products, in compressed-row layout.

    Attributes
    ----------
    factors : tuple of Batch
        Partial derivatives with respect to one argument or parameter, one value per row.
    multiplied : tuple of (array or None)
        Slots that multiply a factor, where the entries of a block's matrix are themselves differentiated.
    which : array of int
        Per product: the row of its factor, counted through all factors; -1 where the factor is one.
    sources : array of int
        Per product: the entry that is multiplied.
    starts : array of int
        First product of each sum.
    to : array of int
        Destination of each sum: an entry of a batch's target, or the position (row * width + column) in a block's right-hand side.
    """

    factors: tuple[Batch, ...]
    multiplied: tuple[Integers | None, ...]
    which: Integers
    sources: Integers
    starts: Integers
    to: Integers

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def targets(self) -> Integers:
        """Per product: the destination of its sum."""
        return np.repeat(self.to, np.diff(self.starts, append=len(self.which)))

    def of_factor(self, position: int) -> tuple[Integers, Integers]:
        """The products of one factor sorted by row, and where each row begins."""
        ends = np.cumsum([0, *map(len, self.factors)])
        chosen = np.flatnonzero((self.which >= ends[position]) & (self.which < ends[position + 1]))
        rows = self.which[chosen] - ends[position]
        order = np.argsort(rows, kind="stable")
        return chosen[order], np.searchsorted(rows[order], np.arange(len(self.factors[position]) + 1))


@dataclass(frozen=True, eq=False)
class Solved:
    """Entries of a block's unknowns, row by row from ``first`` on; all rows have the same seeds.

    Attributes
    ----------
    step : Linear or Newton
    block : int
        Number of the linear block; -1 for a block solved by Newton's method.
    implicit : bool
        Whether the right-hand side has one row per equation, so that the linearised equations are solved; otherwise it has one per
        known slot of a linear block, and the solution matrix is multiplied by it.
    sums : Sums
        The right-hand side.
    rows : array of int
        The unknowns whose entries are needed.
    width : int
        Number of seeds.
    first : int
    added, added_sources : arrays of int
        Seeds that enter at the unknowns: positions counted from ``first``, and the entries added there.
    matrix : Sums, optional
        Changes of the matrix of linear equations that may be singular, on which the shares of what they leave open depend:
        (row * unknowns + column) * width + seed.
    """

    step: Linear | Newton
    block: int
    implicit: bool
    sums: Sums
    rows: Integers
    width: int
    first: int
    added: Integers
    added_sources: Integers
    matrix: Sums | None = None


@dataclass(frozen=True, eq=False)
class DerivativePlan:
    """Sparse differentiation plan for some slots.

    Derivative i is that of slot ``wanted[rows[i]]`` with respect to seed ``seeds[i]``, and is entry ``sources[i]``. Entry 0 is zero;
    the entries of the seeds follow in the order ``order``.
    """

    wanted: Integers
    n_seeds: int
    order: Integers
    steps: tuple[Sums | Solved, ...]
    n_entries: int
    rows: Integers
    seeds: Integers
    sources: Integers

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.wanted), self.n_seeds

    @cached_property
    def by_column(self) -> Integers:
        """Permutation that sorts the derivatives by column."""
        return np.lexsort((self.rows, self.seeds))

    @property
    def multiplied(self) -> Integers:
        """Slots whose values appear as factors."""
        sums = (s.sums for s in self.steps if isinstance(s, Solved))
        return np.concatenate([_NONE, *(slots for s in sums for slots in s.multiplied if slots is not None)])


def discrete_entry(number: int) -> int:
    """Code of a seed that enters at an entry of the discrete state."""
    return TIME - 1 - number


def state_plan(program: Program) -> DerivativePlan:
    """Derivatives of the outputs with respect to the states: the Jacobian."""
    return derivative_plan(program, [(i, i) for i in range(len(program.states))], program.output_slots)


def derivative_plan(
    program: Program, entering: Sequence[Entering], wanted: Iterable[int] | Integers | None = None, n_seeds: int | None = None
) -> DerivativePlan:
    """Plan the derivatives of some slots.

    Parameters
    ----------
    program : Program
    entering : sequence of (slot, seed)
        Where seeds enter, each pair once; ``n_slots + p`` denotes entry p of the parameter table, `discrete_entry` of a number an
        entry of the discrete state, `TIME` time.
    wanted : iterable of int, optional
        Slots to differentiate, by default all. Those that depend on no seed are left out.
    n_seeds : int, optional
        Total number, if there are more seeds than those that enter.

    Examples
    --------
    >>> import gearlib as gl, gearparts as gp
    >>> class Wheel(gl.Component):
    ...     def assemble(self):
    ...         self.body, self.fan, self.ground = gp.Inertia(J=2.0), gp.Damper(d=3.0), gp.Fixed()
    ...         return [gl.connect(self.body.flange_b, self.fan.flange_a), gl.connect(self.fan.flange_b, self.ground.flange)]
    >>> program = gl.compile(Wheel(), outputs=["body.w"]).translation.scene.program
    >>> state_plan(program).shape
    (1, 1)
    """
    slots = np.arange(program.n_slots) if wanted is None else np.fromiter(wanted, np.int64)
    places = _places(program, [slot for slot, _ in entering])
    entering = [(_place(places, slot), seed) for slot, seed in entering]
    n_given = len(program.states) + len(program.inputs)
    makers, rows_made = _made_by(program)
    known = [(k, slot) for k, (slot, _) in enumerate(entering) if not n_given <= slot < program.n_slots]
    order = [k for k, _ in sorted(known, key=lambda pair: pair[1])]
    order += sorted(set(range(len(entering))) - set(order))
    rows = _Rows(program, places, [entering[k] for k in order], len(known), n_seeds)
    added: dict[int, list[tuple[int, int]]] = {}  # per step: row, entry
    for entry, k in enumerate(order[len(known) :], 1 + len(known)):
        slot = entering[k][0]
        added.setdefault(int(makers[slot]), []).append((int(rows_made[slot]), entry))
    alive = slots_behind(program, slots, slopes=True) if wanted is not None else np.ones(program.n_slots, bool)
    steps: list[Sums | Solved] = []
    block = 0
    for number, step in enumerate(program.steps):
        here, entries = np.array(added[number]).T if number in added else (_NONE, _NONE)
        if isinstance(step, Batch):
            made: Sums | Solved | None = _chained(rows, step, alive, here, entries)
        else:
            made = _solved(rows, step, block if isinstance(step, Linear) else -1, alive, here, entries)
            block += isinstance(step, Linear)
        if made is not None:
            steps.append(made)
    which, sources = rows.entries_of(slots)
    return DerivativePlan(
        slots, rows.n_seeds, np.array(order, np.int64), tuple(steps), rows.count, which, rows.seed_of[sources], sources
    )


# Offsets behind the slots: the first parameter, the first entry of the discrete state, time; and at which of these seeds enter.
Places = tuple[int, int, int, tuple[bool, bool, bool]]


def _places(program: Program, slots: Sequence[int]) -> Places:
    """Places, behind the slots, of constants at which seeds enter."""
    n = program.n_slots
    entered = any(s >= n for s in slots), any(s < TIME for s in slots), TIME in slots
    if not any(entered):
        return n, n, n, entered
    batches = list(_batches(program.steps))
    discrete = 1 + max([n - 1, *slots, *(n + int(b.parameters.max(initial=-1)) for b in batches)])
    most = max([-1, *(TIME - 1 - s for s in slots), *(int(b.relations.max(initial=-1)) for b in batches)])
    return n, discrete, discrete + 1 + most, entered


def _place(places: Places, slot: int) -> int:
    """Place of a slot, or of the constant that a code denotes."""
    _, discrete, time, _ = places
    return slot if slot >= 0 else time if slot == TIME else discrete + TIME - 1 - slot


def _held(places: Places, batch: Batch) -> Iterator[tuple[Integers, Callable[[], Batch]]]:
    """Constants of a batch at which seeds may enter: place per row, and the derivatives with respect to it."""
    parameters, discrete, time, entered = places
    for q in range(batch.parameters.shape[1] if entered[0] else 0):
        yield parameters + batch.parameters[:, q], partial(batch.parameter_derivative, q)
    for q in range(batch.relations.shape[1] if entered[1] else 0):
        yield discrete + batch.relations[:, q], partial(batch.discrete_derivative, q)
    if entered[2] and batch.kernel.on_time:
        yield np.full(len(batch), time), batch.time_derivative


class _Rows:
    """Entry numbering under construction: first entry and number of entries of each slot, and of each constant behind the slots."""

    def __init__(
        self, program: Program, places: Places, entering: Sequence[Entering], n_known: int, n_seeds: int | None
    ) -> None:
        self.n_slots, self.places = program.n_slots, places
        slots, seeds = np.array(entering, np.int64).reshape(len(entering), 2).T
        self.n_seeds = n_seeds if n_seeds is not None else int(seeds.max(initial=-1)) + 1
        self.length = np.bincount(slots[:n_known], minlength=places[2] + 1)
        self.first = 1 + np.cumsum(self.length) - self.length
        self.count = 1 + len(slots)
        self._seeds = np.append(-1, seeds)

    @property
    def seed_of(self) -> Integers:
        """Seed of each entry; -1 for the zero entry."""
        return self._seeds[: self.count]

    def make(self, slots: Integers, lengths: Integers, seeds: Integers) -> int:
        """Number the entries of some slots; returns the first number."""
        first = self.count
        self.length[slots], self.first[slots] = lengths, first + lengths.cumsum() - lengths
        self.count += len(seeds)
        if self.count > len(self._seeds):
            self._seeds = np.append(self._seeds, np.empty(max(self.count, 2 * len(self._seeds)) - len(self._seeds), np.int64))
        self._seeds[first : self.count] = seeds
        return first

    def entries_of(self, slots: Integers) -> tuple[Integers, Integers]:
        """All entries of some slots, concatenated, and the slot of the list that each belongs to."""
        lengths, first = self.length[slots], self.first[slots]
        if (lengths == 1).all():
            return np.arange(len(slots)), first
        which = np.arange(len(slots)).repeat(lengths)
        return which, np.arange(len(which)) + (first + lengths - lengths.cumsum())[which]


Products = tuple[list[Batch], list[Integers | None], Integers, Integers, Integers]  # factors, multiplied, which, sources, rows
_NOTHING: Products = [], [], _NONE, _NONE, _NONE


def _of_batch(
    rows: _Rows, batch: Batch, to: Integers, use: NDArray[np.bool_], inside: NDArray[np.bool_] | None = None
) -> Products:
    """The chain rule for the rows of a batch that are in ``use``; slots ``inside`` a block are its own unknowns."""
    active = list(batch.active)
    slots, signs = batch.arguments.T[active], batch.argument_signs.T[active]
    moves = use & (signs != 0) & (rows.length[slots] > 0)
    if inside is not None:
        moves &= ~inside[slots]
    arguments, here = moves.nonzero()
    if not len(here):
        return _NOTHING
    which, sources = rows.entries_of(slots[moves])
    counts = np.bincount(arguments, minlength=len(slots)).tolist()
    factors, first = [], 0
    for a, count in zip(batch.active, counts, strict=True):
        if count:
            factors.append(_rows_of(batch, here[first : first + count]).derivative(a))
            first += count
    return factors, [None] * len(factors), which, sources, to[here[which]]


def _of_held(
    rows: _Rows, batch: Batch, to: Integers, use: NDArray[np.bool_], multiplied: Integers | None = None
) -> Iterator[Products]:
    """Derivatives with respect to constants that the rows of a batch in ``use`` hold."""
    for slots, differentiated in _held(rows.places, batch):
        here = np.flatnonzero(use & (rows.length[slots] > 0))
        if len(here) and not (slope := differentiated()).kernel.is_zero:
            which, sources = rows.entries_of(slots[here])
            taken = None if multiplied is None else multiplied[here]
            yield [_rows_of(slope, here)], [taken], which, sources, to[here[which]]


def _rows_of(batch: Batch, rows: Integers) -> Batch:
    """Some rows of a batch, in the given order; the batch itself if these are all."""
    return batch if len(rows) == len(batch) else batch.take(rows)


def _plain(sources: Integers, to: Integers) -> Products:
    """Entries added with factor one."""
    return [], [], np.full(len(sources), -1), sources, to


def _summed(rows: _Rows, products: Sequence[Products], seeds: Integers | None = None) -> Sums:
    """Sum the products of equal row and seed into row * columns + column; ``seeds`` are the columns, by default all."""
    size, parts = 0, []
    for factors, _, which, sources, to in products:
        parts.append((which + size if factors else which, sources, to))
        size += sum(map(len, factors))
    which, sources, to = (np.concatenate(x) for x in zip(*parts, strict=True))
    factors, multiplied = [b for f, *_ in products for b in f], [m for _, slots, *_ in products for m in slots]
    found = rows.seed_of[sources]
    to = to * rows.n_seeds + found if seeds is None else to * len(seeds) + np.searchsorted(seeds, found)
    order = to.argsort(kind="stable")
    to = to[order]
    first = np.ones(len(to), bool)
    np.not_equal(to[1:], to[:-1], out=first[1:])
    starts = first.nonzero()[0]
    return Sums(tuple(factors), tuple(multiplied), which[order], sources[order], starts, to[starts])


def _chained(rows: _Rows, step: Batch, alive: NDArray[np.bool_], added: Integers, entries: Integers) -> Sums | None:
    use, everyone = alive[step.targets], np.arange(len(step))
    products = [_of_batch(rows, step, everyone, use), *_of_held(rows, step, everyone, use)]
    if len(added):
        products.append(_plain(entries[use[added]], added[use[added]]))
    if not any(len(sources) for *_, sources, _ in products):
        return None
    sums = _summed(rows, products)
    to, seeds = np.divmod(sums.to, rows.n_seeds)
    first = rows.make(step.targets, np.bincount(to, minlength=len(step)), seeds)
    return Sums(sums.factors, sums.multiplied, sums.which, sums.sources, sums.starts, first + np.arange(len(seeds)))


def _solved(
    rows: _Rows, step: Linear | Newton, block: int, alive: NDArray[np.bool_], added: Integers, entries: Integers
) -> Solved | None:
    needed = np.flatnonzero(alive[step.unknowns])
    if not len(needed):
        return None
    products: list[Products] = []
    turned: list[Products] = []
    implicit = isinstance(step, Newton) or _has_varied_matrix(rows, step)
    if isinstance(step, Newton):
        inside = np.zeros(rows.n_slots, bool)
        inside[step.unknowns] = True
        for batch in step.residuals:
            use = np.ones(len(batch), bool)
            products += [_of_batch(rows, batch, batch.targets, use, inside), *_of_held(rows, batch, batch.targets, use)]
        for batch in step.jacobian if step.linear else ():
            use = np.ones(len(batch), bool)
            turned += [_of_batch(rows, batch, batch.targets, use, inside), *_of_held(rows, batch, batch.targets, use)]
    else:
        which, sources = rows.entries_of(step.known)
        products.append(_plain(sources, step.known_rows[which] if implicit else which))
        for batch in step.matrix if implicit else ():  # A z + g = 0: dA z joins the right-hand side
            row, column = np.divmod(batch.targets, len(step.unknowns))
            products += _of_held(rows, batch, row, np.ones(len(batch), bool), step.unknowns[column])
    seeds = np.unique(rows.seed_of[np.concatenate([entries, *(p[3] for p in products)])])
    if not len(seeds):
        return None
    sums = _summed(rows, products, seeds)
    place = np.full(len(step.unknowns), -1)
    place[needed] = np.arange(len(needed))
    kept = place[added] >= 0
    added_places = place[added[kept]] * len(seeds) + np.searchsorted(seeds, rows.seed_of[entries[kept]])
    first = rows.make(step.unknowns[needed], np.full(len(needed), len(seeds)), np.tile(seeds, len(needed)))
    matrix = _summed(rows, turned, seeds) if any(len(p[3]) for p in turned) else None
    return Solved(step, block, implicit, sums, needed, len(seeds), first, added_places, entries[kept], matrix)


def _has_varied_matrix(rows: _Rows, step: Linear) -> bool:
    """Whether a differentiated parameter appears in the matrix of a block."""
    if not rows.places[3][0]:
        return False
    return any((rows.length[rows.n_slots + batch.parameters] > 0).any() for batch in step.matrix)


def _made_by(program: Program) -> tuple[Integers, Integers]:
    """Per computed slot: the step that computes it, and its row there."""
    makers, rows = np.full(program.n_slots, -1), np.zeros(program.n_slots, np.int64)
    for number, step in enumerate(program.steps):
        made = step.targets if isinstance(step, Batch) else step.unknowns
        makers[made], rows[made] = number, np.arange(len(made))
    return makers, rows


def _batches(steps: Iterable[Step]) -> Iterator[Batch]:
    for step in steps:
        if isinstance(step, Batch):
            yield step
        elif isinstance(step, Linear):
            yield from step.matrix
        else:
            yield from step.residuals
            yield from step.jacobian
