"""Exact integration of linear time-invariant scenes with quasipolynomial inputs.

x' = A x + B u(t) with u the output of linear systems of its own (`forcing`) is x' = A x + B H s, s' = S s between breakpoints:
one matrix exponential carries (x, s) over a step, and equal steps share it. No error is controlled because none is made: small
matrices go through `dense_exponential`, large sparse ones through `action`, whose series ends at the tolerance asked for.
`Exponential` is the stepper, which finds all samples at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearlib.arguments import shown
from gearlib.equations.switch_times import rounding
from gearlib.errors import ArgumentError, SolverError
from gearlib.solvers.drive.drive_loop import DONE
from gearlib.solvers.drive.driver import Driver, Stepper
from gearlib.solvers.exponential import corners
from gearlib.solvers.exponential.action import Action, Triplets, band_order
from gearlib.solvers.exponential.action import prepare as prepare_action
from gearlib.solvers.exponential.dense import Propagator, balanced_norm, estimate
from gearlib.solvers.exponential.forcing import Exosystem, Forcing, NotExact, recognise
from gearlib.solvers.exponential.stretches import Stretch, stretches
from gearlib.solvers.inputs.table import Table
from gearlib.solvers.problem import LinearForm, Problem

Floats = NDArray[np.float64]

ALGORITHMS = ("auto", "dense", "action")
DENSE_ALWAYS = 40  # states: nothing is gained below by looking for anything better
DENSE_LIMIT = 4000  # states: ten matrices of that size take 1.3 GB
SECONDS_LIMIT = 600.0
MOST_CORNERED = 40  # states up to which tables are gone through from corner to corner with dense exponentials
FINEST = 1e-9  # the series of the sparse algorithm go on to there at least: a digit more costs little

_Groups = list[tuple[NDArray[np.int64] | slice, "_Advance"]]
_Advance = Callable[[Exosystem, float, int, Floats, Floats], Floats]


class Exponential(Stepper):
    """Matrix exponentials of a problem's linear form: no steps, no events, nothing compiled.

    Tables go from corner to corner where states are few; what the other inputs do is recognised in closed form. Since the problem is
    linear, what each of the two drives may be added.

    Parameters
    ----------
    problem : Problem
        With a linear form. The stepper serves for other start values too.

    Attributes
    ----------
    lack : str
        Why an input is not known in closed form; empty where all are.
    """

    steps = False

    def __init__(self, problem: Problem) -> None:
        self.problem, self.linear = problem, problem.linear or LinearForm(np.zeros((0, 0)), np.zeros((0, 0)), ())
        inputs, n, times = self.linear.inputs, problem.x0.size, problem.times
        self.cornered: tuple[int, ...] = ()  # the inputs that go from corner to corner
        self.cuts: corners.Intervals | None = None  # and the intervals there
        self.forcing: Forcing | None = None  # of the other inputs; None where they are constant
        self.lack = ""
        tables = [u for u in inputs if isinstance(u, Table)]
        if tables and n <= MOST_CORNERED:
            self.cornered = tuple(k for k, u in enumerate(inputs) if isinstance(u, Table) or u.is_number)
            self.cuts = corners.Intervals.of(times, tables)
            inputs = tuple(u for k, u in enumerate(inputs) if k not in self.cornered)
        if n and (inputs or self.cuts is None):
            forcing = _recognised(inputs, float(times[0]), float(times[-1]))
            if isinstance(forcing, NotExact):
                self.lack = forcing.reason
            else:
                self.forcing = forcing

    def rate(self) -> float:
        """Of the fastest motion, 1/s: a bound."""
        A = self.linear.A
        return balanced_norm(np.asarray(A if isinstance(A, np.ndarray) else A.toarray()))

    def attach(self, driver: Driver, memory: Callable[[str], Floats]) -> None:
        """It has no part in the compiled loop."""

    def carry_on(self, driver: Driver) -> int:
        """Write all samples; the loop has nothing to do."""
        if driver.x.size:
            driver.out = self._samples(driver.x)
            driver.x = driver.out[-1]
        driver.record.t, driver.record.sample = driver.t_end, driver.record.n_times
        return DONE

    def _samples(self, x0: Floats) -> Floats:
        linear, found = self.linear, None
        if self._smooth is not None:
            found, x0 = self._smooth.solve(x0), np.zeros(x0.size)
        if self.cuts is not None:
            A = linear.A if isinstance(linear.A, np.ndarray) else linear.A.toarray()
            drive = [u if isinstance(u, Table) else float(u) for u in (linear.inputs[k] for k in self.cornered)]
            driven = corners.solve(A, linear.B[:, self.cornered], drive, x0, self.problem.times, self.cuts)
            found = driven if found is None else found + driven
        assert found is not None
        return found

    @cached_property
    def _smooth(self) -> ExactRun | None:
        """The exponentials for the inputs that are recognised, if any are."""
        if self.forcing is None:
            return None
        linear, problem = self.linear, self.problem
        B = linear.B
        if self.cornered:
            B = B[:, [k for k in range(len(linear.inputs)) if k not in self.cornered]]
        return prepare(linear.A, B, self.forcing, problem.times, rtol=min(problem.rtol, FINEST))

    @property
    def work(self) -> float:
        return 0.0  # there is nothing to choose while it goes on

    def stats(self) -> dict[str, Any]:
        return {"steps": 0, "rhs": 0}

    def failure(self, code: int) -> SolverError:
        return SolverError(f"matrix exponentials ended with {code}")


@lru_cache(maxsize=256)
def _recognised(inputs: tuple[Any, ...], t0: float, t1: float) -> Forcing | NotExact:
    """The inputs as outputs of linear systems; the same inputs come again with every other set of parameters."""
    return recognise(inputs, t0, t1)


@dataclass(frozen=True, eq=False)
class ExactRun:
    """A linear scene with the algorithm chosen for it, and the reason; `solve` integrates."""

    n: int  # states
    algorithm: str  # "dense" or "action"
    reason: str  # in words, for statistics
    seconds: float  # estimated time of `solve`
    _times: Floats
    _forcing: Forcing
    _stretches: list[Stretch]
    _at_start: int  # times that are the start
    _groups: _Groups  # states that act on each other, and how they step

    def solve(self, x0: ArrayLike) -> Floats:
        """States (times, n) that start from ``x0`` (n,) at the beginning of the forcing.

        Raises
        ------
        ArgumentError
            Start values that do not fit.
        SolverError
            The solution overflows.
        """
        x0 = np.asarray(x0, dtype=float)
        if x0.shape != (self.n,):
            raise ArgumentError(f"start values of shape {x0.shape} for {self.n} states")
        out = np.empty((len(self._times), len(x0)))
        out[: self._at_start] = x0
        with np.errstate(over="ignore", invalid="ignore"):
            for states, advance in self._groups:
                self._march(x0[states], states, advance, out)
        if not np.isfinite(out).all():
            first = int(np.argmin(np.isfinite(out).all(axis=1)))
            raise SolverError(f"the solution leaves the range of floating-point numbers before t = {self._times[first]:g} s")
        return out

    def _march(self, x: Floats, states: NDArray[np.int64] | slice, advance: _Advance, out: Floats) -> None:
        for stretch in self._stretches:
            exosystem = self._forcing.pieces[stretch.piece]
            if stretch.h == 0.0:
                X = np.repeat(x[None], stretch.count, axis=0)
            else:
                X = advance(exosystem, stretch.h, stretch.count, x, exosystem.state(stretch.start))
            x = X[-1]
            if stretch.row >= 0:
                out[stretch.row : stretch.row + stretch.count, states] = X


def prepare(A: Any, B: Any, forcing: Forcing, times: Any, *, rtol: float = 1e-12, algorithm: str = "auto") -> ExactRun:
    """Choose how x' = A x + B u(t) is integrated, and get ready to: all that does not depend on the start values.

    Parameters
    ----------
    A : ndarray or scipy.sparse array
        (n, n), in 1/s for states of one unit.
    B : ndarray or scipy.sparse array
        (n, m); m is the number of inputs of ``forcing``.
    forcing : Forcing
        From `forcing.recognise`.
    times : array_like
        Output times (s), in order, from ``forcing.t0`` to ``forcing.t_end``.
    rtol : float
        Where the series of the sparse algorithm may end, relative to the largest state (in balanced units). The dense one
        is as accurate as rounding allows in any case.
    algorithm : {"auto", "dense", "action"}
        Dense exponential of every step, action of the sparse exponential, or the one that is estimated to be faster.

    Raises
    ------
    ArgumentError
        Shapes or times that do not fit.
    SolverError
        The scene is too large and too stiff for both algorithms.

    Notes
    -----
    Rounding makes a phase error of about 1e-16 times the angle w t, as it must where w itself is rounded. Fast modes that are
    not separate in the states (the common speed of two inertias behind a hard damper) lose about 1e-16 |A| t.

    Examples
    --------
    >>> from gearlib.solvers.exponential.forcing import recognise
    >>> forcing, times = recognise([4.0], 0.0, 1.0), [0.0, 0.5 * math.log(2)]
    >>> prepare(np.array([[-2.0]]), np.array([[1.0]]), forcing, times).solve([0.0])
    array([[0.],
           [1.]])
    """
    times = np.asarray(times, dtype=float)
    _check(A, B, forcing, times, algorithm)
    n = A.shape[0]
    same = rounding(forcing.t0, forcing.t_end)
    cuts, at_start = _cut(times.tobytes(), forcing.t0, forcing.t_end, forcing.breakpoints.tobytes())

    def run(algorithm: str, reason: str, seconds: float, groups: _Groups) -> ExactRun:
        return ExactRun(n, algorithm, reason, seconds, times, forcing, cuts, at_start, groups)

    steps = {(forcing.pieces[c.piece].key, c.h): c for c in cuts if c.h}
    count = sum(c.count for c in cuts)
    small = n <= DENSE_ALWAYS or estimate(n, [1e3] * len(steps), count) < 1e-3
    if algorithm == "dense" or (algorithm == "auto" and small):
        if n > DENSE_LIMIT:
            raise SolverError(f"{n} states: a dense exponential of more than {DENSE_LIMIT} takes too much memory")
        groups = _dense_groups(A, B, _components(_triplets(A), n) if n > DENSE_ALWAYS else [slice(None)])
        return run("dense", f"{n} states, {len(steps)} different steps", math.nan, groups)
    entries = _triplets(A)
    parts = _components(entries, n)
    actions = _Actions(entries, B, n, max(forcing.t_end - forcing.t0, same), rtol)
    sparse = sum(actions.of(forcing.pieces[c.piece]).seconds(c.h, c.count, rtol) for c in cuts if c.h)
    sizes = [n] if isinstance(parts[0], slice) else [len(part) for part in parts]
    speed = actions.fastest
    dense = sum(estimate(size, [speed * c.h for c in steps.values()], count) for size in sizes)
    reason = f"{n} states, rates up to {speed:.2g} 1/s: estimated {sparse:.2g} s, dense exponentials {dense:.2g} s"
    dense_fits = max(sizes) <= DENSE_LIMIT and dense <= SECONDS_LIMIT
    if algorithm == "auto":
        if dense_fits and dense < max(2.0 * sparse, 2e-3):
            return run("dense", reason, dense, _dense_groups(A, B, parts))
        if sparse > SECONDS_LIMIT:
            raise SolverError(f"no exact solution within {SECONDS_LIMIT:g} s: {reason}. Use method='ida' or method='rk'")
    return run("action", reason, sparse, [(slice(None), actions.advance)])


def _check(A: Any, B: Any, forcing: Forcing, times: Floats, algorithm: str) -> None:
    n, m = A.shape[0], len(forcing.pieces[0].H)
    if algorithm not in ALGORITHMS:
        raise ArgumentError(f"algorithm={shown(algorithm)}: choose one of {', '.join(ALGORITHMS)}")
    if A.shape != (n, n) or tuple(B.shape) != (n, m):
        raise ArgumentError(f"A is {A.shape} and B is {tuple(B.shape)}: with {m} inputs they must be (n, n) and (n, {m})")
    entries = [M if isinstance(M, np.ndarray) else M.data for M in (A, B)]
    if not all(np.isfinite(M).all() for M in entries):
        raise ArgumentError(
            "the matrices A and B of the linear scene are not finite: values as large or small as these overflow"
        )
    same = rounding(forcing.t0, forcing.t_end)
    if times.ndim != 1:
        raise ArgumentError("times must be a sequence in increasing order")
    if len(times) and not (times[0] >= forcing.t0 - same and times[-1] <= forcing.t_end + same):
        raise ArgumentError(
            f"times from {times[0]:g} to {times[-1]:g} s, but inputs are known from {forcing.t0:g} to {forcing.t_end:g} s"
        )


@lru_cache(maxsize=4)
def _cut(grid: bytes, t0: float, t_end: float, breakpoints: bytes) -> tuple[list[Stretch], int]:
    """The stretches of a grid of times, and how many times are the start; other parameters come with the same grid."""
    times = np.frombuffer(grid)
    if not (np.diff(times) >= 0).all():
        raise ArgumentError("times must be a sequence in increasing order")
    cuts = stretches(times, t0, np.frombuffer(breakpoints)) if len(times) else []
    return cuts, int(np.searchsorted(times, t0 + rounding(t0, t_end), side="right"))


def _components(A: Triplets, n: int) -> list[Any]:
    """States that act on each other, as index arrays; one slice where all do or where there are few."""
    return [slice(None)] if n <= DENSE_ALWAYS else _parts(n, A.rows.tobytes(), A.columns.tobytes())


@lru_cache(maxsize=4)
def _parts(n: int, rows: bytes, columns: bytes) -> list[Any]:
    """Parts of a pattern that are not connected; other parameters come with the same pattern."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    places = np.frombuffer(rows, np.int64), np.frombuffer(columns, np.int64)
    count, label = connected_components(coo_array((np.ones(len(places[0])), places), shape=(n, n)), directed=False)
    return [slice(None)] if count == 1 else [np.flatnonzero(label == k) for k in range(count)]


def _dense(M: Any) -> Floats:
    return np.asarray(M if isinstance(M, np.ndarray) else M.toarray(), dtype=float)


def _dense_groups(A: Any, B: Any, parts: list[Any]) -> _Groups:
    return [(part, _dense_advance(_dense(A[part][:, part]), _dense(B[part]))) for part in parts]


def _dense_advance(A: Floats, B: Floats) -> _Advance:
    """Steps by dense exponentials, which are kept for the steps that come again."""
    n = len(A)
    known: dict[tuple[bytes, float], Propagator] = {}
    room = max(2, int(2e8 / (8.0 * n * n)))

    def advance(exosystem: Exosystem, h: float, count: int, x: Floats, s: Floats) -> Floats:
        key = (exosystem.key, h)  # not rounded: the time that a rounded step is off by would add up
        if key not in known:
            if len(known) >= room:
                del known[next(iter(known))]
            G = np.zeros((n + len(s), n + len(s)))
            G[:n, :n], G[:n, n:], G[n:, n:] = A, B @ exosystem.H, exosystem.S
            known[key] = Propagator(G, h)
        return known[key].advance(np.concatenate([x, s]), count)[:, :n]

    return advance


class _Actions:
    """Steps by the action of sparse exponentials; one prepared action per exosystem."""

    def __init__(self, A: Triplets, B: Any, n: int, span: float, rtol: float) -> None:
        self._A, self._B, self._span, self._rtol = A, B, span, rtol
        self._order = band_order(A, n)
        self._known: dict[bytes, Action] = {}

    @property
    def fastest(self) -> float:
        """Bound of the eigenvalues' sizes (1/s)."""
        ellipses = [action.ellipse for action in self._known.values()]
        return max((abs(e.centre) + e.real + e.imaginary for e in ellipses), default=0.0)

    def of(self, exosystem: Exosystem) -> Action:
        if exosystem.key not in self._known:
            n, inputs = len(self._order), len(exosystem.S)
            parts = [self._A, _triplets(np.asarray(self._B @ exosystem.H), 0, n), _triplets(exosystem.S, n, n)]
            rows, columns = (np.concatenate([getattr(p, name) for p in parts]) for name in ("rows", "columns"))
            G = Triplets(rows, columns, np.concatenate([p.entries for p in parts]))
            # inputs act on any of the states and take no part in the ordering for a narrow band
            self._known[exosystem.key] = prepare_action(G, np.append(self._order, np.arange(n, n + inputs)), self._span, inputs)
        return self._known[exosystem.key]

    def advance(self, exosystem: Exosystem, h: float, count: int, x: Floats, s: Floats) -> Floats:
        return self.of(exosystem).advance(np.concatenate([x, s]), h, count, self._rtol)[:, : len(x)]


def _triplets(M: Any, row: int = 0, column: int = 0) -> Triplets:
    """The nonzeros of a dense or sparse matrix, moved to begin at a row and a column."""
    if isinstance(M, np.ndarray):
        rows, columns = np.nonzero(M)
        return Triplets(rows + row, columns + column, M[rows, columns])
    M = M.tocsr()
    keep = M.data != 0
    rows = np.repeat(np.arange(M.shape[0]), np.diff(M.indptr))
    return Triplets(rows[keep] + row, M.indices[keep].astype(np.int64) + column, M.data[keep].astype(float))
