"""Initial value problems as the integrators see them: numbers and native functions, nothing symbolic.

    M x' = f(t, x),    M = diag(differential),    x(t_start) = x0

or, if ``implicit``, F(t, x, x') = 0, with x' of the differential unknowns, which come first. Native functions then find x' behind x,
and ``rhs`` computes F.

Every native function has a C signature over the state ``x``, a block of numbers ``data`` (parameters, factorised matrices, values of
relations, work space) and a block of integers ``index`` (index arrays of the generated loops)::

    int32 rhs   (double t, double *x, double *dx,     double *data, int64 *index)
    int32 jac   (double t, double *x, double *values, double *data, int64 *index)    df/dx, nonzeros in CSC order
    int32 roots (double t, double *x, double *g,      double *data, int64 *index)    event functions
    int32 update(double t, double *x, int32 *fired,   double *data, int64 *index)    event iteration

A return value of 0 means success, a positive one requests a smaller step, a negative one stops the run. ``update`` is called at the
start, at each time event and at each located root, with ``fired[k]`` the direction (+1, -1) in which root k crossed zero (0: it did
not); it may set ``fired[k]`` to 2 or -2, the side that the event function starts from (otherwise its sign counts). It returns 0 if
nothing changed, 1 if the right-hand side did, 2 if ``x`` did as well, and stores the values of relations and discrete variables in
``data[discrete]``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from gearlib.solvers.drive.trace import Trace


Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def late_start(t0: float, t1: float) -> float:
    """Origin of an integrator's clock: the start of a run that begins late. Differences of times are then exact (Sterbenz)."""
    return t0 if abs(t0) >= 2.0 * (t1 - t0) else 0.0


class Native(Protocol):
    """Anything with the address of a native function: a compiled one or a wrapped Python callable."""

    @property
    def address(self) -> int: ...


class NoCode:
    """Placeholder for native functions that a method does not call, so that nothing is compiled."""

    address = 0


@dataclass(frozen=True, eq=False)
class MovedSwitch:
    """A condition on time of an input whose switching times depend on the directions: dt/dp = -(dg/dp) / (dg/dt) where g(t, p) = 0."""

    input: int  # the input that switches
    g: Any  # expression of time
    changes: tuple[Any, ...]  # its derivative in each direction


@dataclass(frozen=True, eq=False)
class LinearChanges:
    """Derivatives of a linear form in some directions: S_k' = A S_k + A_k x + B_k u."""

    A: tuple[Any, ...]  # (states, states) each, arrays or sparse
    B: Floats  # (directions, states, inputs)
    switches: tuple[MovedSwitch, ...] = ()


@dataclass(frozen=True, eq=False)
class LinearForm:
    """x' = A x + B u(t); the inputs u are tables, or expressions of time with numeric coefficients."""

    A: Any  # (states, states), array or sparse
    B: Floats  # (states, inputs)
    inputs: tuple[Any, ...]
    stepper: list[Any] = field(default_factory=list)  # the last one, reused by the next run with the same numbers
    known: dict[Any, Any] = field(default_factory=dict)  # what runs with other numbers have found of inputs, times and pattern
    changes: LinearChanges | None = None  # the states of the problem are then followed by their tangents, (states, directions)


@dataclass(frozen=True)
class Problem:
    """A scene as an integrator sees it."""

    rhs: Native
    x0: Floats
    data: Floats
    index: Integers
    differential: NDArray[np.bool_]  # False: an algebraic unknown, whose row of f is a residual
    nominal: Floats  # typical size of each state; the absolute tolerance is rtol * nominal unless given
    jac: Native | None = None
    jac_indptr: Integers | None = None  # CSC pattern of df/dx
    jac_indices: Integers | None = None
    matrix_plans: dict[Any, Any] = field(default_factory=dict)  # storages of the matrix that were chosen for this pattern
    roots: Native | None = None
    n_roots: int = 0
    update: Native | None = None
    # Discrete state, the part of data that events change; recorded with every sample
    discrete: slice = field(default_factory=lambda: slice(0, 0))
    time_events: Floats = field(default_factory=lambda: np.empty(0))  # known times, stepped to exactly
    interval: int | None = None  # place in data of two times, s: the inputs take their limits there beyond them
    longest_step: float = float("inf")  # s
    longest_expanded_step: float = float("inf")  # s, of a method that expands sinusoids of time in series
    state_names: tuple[str, ...] = ()  # for messages
    root_names: tuple[str, ...] = ()
    # (t, x, data): description of what an event iteration keeps changing
    unsettled: Callable[[float, Floats, Floats], str] | None = None
    implicit: bool = False  # rhs computes F(t, x, x'); the pattern of jac has the columns of x' behind those of x
    # (t, x, data): description of what cannot be evaluated beyond that point
    culprit: Callable[[float, Floats, Floats], str] | None = None
    # Cost of one call of each native function, ns, estimated from counted operations so that it is reproducible
    rhs_cost: float = 100.0
    jac_cost: float = 300.0
    roots_cost: float = 50.0
    update_cost: float = 100.0
    times: Floats = field(default_factory=lambda: np.zeros(1))  # sample times, s, nondecreasing: the first is the start
    rtol: float = 1e-6
    atol: ArrayLike | None = None  # a scalar, or one value per state in its unit
    max_steps: int = 100_000_000  # limit on the number of steps
    linear: LinearForm | None = None  # the same equations for methods that call no native function: ``rhs`` is `NoCode` then
    tell: Callable[[float], None] | None = None  # is told the time that was reached, s, now and then
    may_stop: bool = False  # whether an interrupt (Ctrl-C) ends the run where it is, with the status "interrupted"
    # returns the compiled Taylor coefficients (`TaylorSeries`), or a text why there are none
    series: Callable[[], Any] | None = None
    # Indices of states: keep their values at the ends of all steps, where the stepper tells their derivatives there
    traced: Integers | None = None
    may_leave: bool = False  # stop with the status "left" where the right-hand side cannot be evaluated any further
    layouts: dict[Any, Any] = field(default_factory=dict)  # of drivers' memory, by its sizes

    @cached_property
    def absolute_tolerance(self) -> Floats:
        """``rtol * nominal`` unless given."""
        return self.rtol * self.nominal if self.atol is None else np.asarray(self.atol, dtype=np.float64)

    @property
    def look_cost(self) -> float:
        """Cost of one look at the event functions, if there are any."""
        return self.roots_cost if self.roots is not None else 0.0

    def state_name(self, k: int) -> str:
        return self.state_names[k] if k < len(self.state_names) else f"state {k}"

    def equation_name(self, k: int) -> str:
        """Meaning of row k of ``rhs``: the derivative of a state, or the equation of an algebraic unknown."""
        name = self.state_name(k)
        return f"der({name})" if k >= len(self.differential) or self.differential[k] else f"the equation of {name}"

    def root_name(self, k: int) -> str:
        return self.root_names[k] if k < len(self.root_names) else f"root {k}"

    def not_settled(self, t: float, x: Floats, data: Floats) -> str:
        """The names that a failed event iteration keeps changing, as part of a message."""
        names = self.unsettled(t, x, data) if self.unsettled is not None else ""
        return f": the iteration does not settle, it keeps changing {names}" if names else ""

    def blamed(self, t: float, x: Floats | None, data: Floats) -> str:
        """The variable, component and expression that cannot be evaluated any further, as part of a message."""
        return self.culprit(t, x, data) if self.culprit is not None and x is not None else ""


@dataclass(frozen=True)
class Solution:
    """States and discrete state at the requested times. A sample on an event holds the right-hand limit."""

    t: Floats  # (samples,)
    x: Floats  # (samples, states)
    discrete: Floats  # (samples, n_discrete)
    status: str  # "done" | "interrupted" | "stiff" (explicit run that met stiffness) | "left" (undefined any further): stopped at t_last
    t_last: float
    x_last: Floats
    data: Floats  # the model's block of numbers at t_last
    event_times: Floats  # (events,)
    event_roots: Integers  # (events,) index of the root that fired, -1 for a time event
    stats: dict[str, Any]  # method, steps, rhs, jac, events, rejected, ...
    events: Callable[[], list[tuple[float, str]]] = list  # gives the time, and component with equation, where known
    algebraic: Mapping[tuple[int, int], Floats] = field(default_factory=dict)  # histories of the unknowns left to IDA, by node
    tangents: Floats | None = None  # (samples, states, directions), if integrated with the states
    trace: Trace | None = None  # the ends of its steps, where they were kept
    branch: Floats | None = None  # slots of the scene's program at the end, where ``data`` does not hold them
