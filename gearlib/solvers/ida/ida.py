"""Integration of index-1 differential-algebraic problems by SUNDIALS' IDA: variable-order, variable-step BDF.

The residual is diag(differential) x' - f(t, x), the iteration matrix cj diag(differential) - df/dx. Two backends drive the same
IDA, in the libraries that the scikit-sundae wheel ships, and take the same steps. The *native* one hands IDA compiled callbacks
and loops over samples and events in compiled code. The *scikit-sundae* one goes through that package's Python interface, a
hundred times slower on small models, and is taken where its libraries cannot be driven directly.

A step ends at every time event. A root of an event function is located by IDA; `Problem.update` then sees the state there,
and if it changed anything, the algebraic unknowns and derivatives are made consistent and IDA starts anew. An event function
that is exactly zero counts as negative: a relation that differs between its zero and its negative side needs the other sign.

References
----------
A. C. Hindmarsh et al., SUNDIALS: Suite of nonlinear and differential/algebraic equation solvers, ACM Trans. Math. Softw. 31
(2005) 363-396, doi:10.1145/1089014.1089020.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from gearlib.errors import SolverError
from gearlib.solvers.ida.ida_request import (
    CHUNK,
    ERROR_TEST,
    IdaOutcome,
    IdaRequest,
    failure,
    refused,
    request,
    with_less_safety,
)
from gearlib.solvers.ida.sundials import UnavailableError, load
from gearlib.solvers.problem import Floats, Problem, Solution
from gearlib.solvers.rungekutta.rungekutta import PATIENCE

if TYPE_CHECKING:
    from gearlib.solvers.ida.native_backend import Drive

__all__ = ["Ida", "integrate"]

TRIAL = 100  # steps after which IDA has found its order and step size
START = 1.2e6  # ns, of making IDA ready and going back to another method (measured)
OPERATION = 0.5  # ns, of elimination


def integrate(
    problem: Problem,
    times: ArrayLike,
    *,
    rtol: float,
    atol: ArrayLike | None = None,
    native: bool = True,
    max_steps: int = 100_000_000,
    linear_solver: str | None = None,
    may_leave: bool = False,
) -> Solution:
    r"""Integrate a problem from ``times[0]`` and sample it at ``times``.

    Parameters
    ----------
    problem
        Right-hand side, Jacobian and events as native functions. Neither it nor its arrays are changed.
    times
        Sample times, s, strictly increasing, shape (samples,).
    rtol
        Relative accuracy that the samples shall have. IDA is given a fiftieth of it, since its errors add up over a run: see
        `gearlib.solvers.ida.ida_request.SAFETY`.
    atol
        Absolute accuracy, one number or one for each state in its unit; ``rtol * problem.nominal`` unless given. IDA is given a
        fiftieth of this as well.
    native
        False to go through scikit-sundae's Python interface.
    max_steps
        Steps after which to give up.
    linear_solver
        ``"dense"``, ``"band"`` or ``"sparse"``; the cheapest for the pattern of df/dx unless given.
    may_leave
        Stop with the status ``"left"`` where the right-hand side cannot be evaluated further on (native backend only). The solution
        then holds the samples up to ``t_last``, and ``stats["data"]`` the model's data there.

    Returns
    -------
    Solution
        Its ``stats`` hold ``steps``, ``attempts`` (steps tried) and ``rejected`` (the difference), ``rhs`` and ``jac``
        (evaluations), ``events``, ``restarts``, ``order`` (of the last step), ``linear_solver``, ``backend`` and ``work`` (ns, estimated
        from counted operations). The scikit-sundae backend cannot tell ``steps``, ``rejected``, ``order`` and ``work``: None.

    Raises
    ------
    ArgumentError
        For times or tolerances that make no sense.
    StartError
        If the algebraic unknowns have no consistent start values, or start values are not finite.
    SolverError
        If the integration fails; says when, and in which state or event function.

    Examples
    --------
    Exponential decay, x' = -x:

    >>> import numpy as np
    >>> from gearlib.compiler.object_code import compiled
    >>> source = "def rhs(t: float, x: floats, dx: floats, data: floats, index: ints) -> int32:\n    dx[0] = -x[0]\n    return 0"
    >>> rhs, one = compiled(source, "rhs"), np.ones(1)
    >>> problem = Problem(rhs, one, np.zeros(1), np.zeros(1, dtype=np.int64), np.array([True]), one)
    >>> solution = integrate(problem, [0.0, 1.0], rtol=1e-8)
    >>> bool(abs(solution.x[-1, 0] - np.exp(-1)) < 1e-7)
    True
    """
    stepper = Ida(
        problem,
        times,
        rtol=rtol,
        atol=atol,
        native=native,
        max_steps=max_steps,
        linear_solver=linear_solver,
        may_leave=may_leave,
    )
    try:
        while stepper.advance() == "more":
            pass
        return stepper.solution()
    finally:
        stepper.close()


class Ida:
    """IDA on its way through a problem; the parameters are those of `integrate`. `close` frees its memory.

    Attributes
    ----------
    status : str
        ``"more"``, ``"done"`` or ``"left"``.
    """

    def __init__(
        self, problem: Problem, times: ArrayLike, *, rtol: float, atol: ArrayLike | None = None, native: bool = True,
        max_steps: int = 100_000_000, linear_solver: str | None = None, may_leave: bool = False,
    ) -> None:  # fmt: skip
        asked = request(problem, times, rtol, atol, max_steps, linear_solver)
        self._asked = replace(asked, patience=PATIENCE) if may_leave else asked
        self.problem, self.may_leave, self.status = problem, may_leave, "more"
        self._drive: Drive | None = None
        self._outcome: IdaOutcome | None = None
        if native:
            self._backend, self._drive = _native(self._asked)
        else:
            self._backend = "scikit-sundae: asked for"

    @property
    def t(self) -> float:
        """Where it is, s."""
        if self._drive is not None:
            return self._drive.t
        return float(self._asked.times[0]) if self._outcome is None else self._outcome.t

    @property
    def work(self) -> float:
        """What was done so far, ns: estimated from counted operations; 0 through scikit-sundae."""
        if self._drive is None:
            return 0.0
        record = self._drive.record
        return work(self.problem, self._asked, record.done, record.n_rhs, record.n_jac, record.restarts)

    def advance(self, steps: int = CHUNK) -> str:
        """Go on by so many steps, or until something happens; through scikit-sundae, to the end. Returns the status."""
        if self._drive is None:
            from gearlib.solvers.ida import sksundae_backend

            self._outcome = sksundae_backend.run(self._asked)
        elif self._drive.advance(steps) > 0:
            return self.status
        else:
            self._outcome = self._drive.outcome()
        found = self._outcome
        if found.status == ERROR_TEST and (eased := with_less_safety(self._asked, found.worst_state)) is not None:
            self._asked = eased
            if self._drive is not None:
                self.close()
                self._backend, self._drive = _native(eased)
            return self.status  # from the beginning
        if found.status >= 0:
            self.status = "done"
        elif self.may_leave and found.x_failed is not None and refused(self._asked, found):
            self.status = "left"
        else:
            raise failure(self._asked, found)
        return self.status

    def solution(self) -> Solution:
        """What has been found so far."""
        outcome = self._drive.outcome() if self._outcome is None and self._drive is not None else self._outcome
        if outcome is None:
            raise SolverError("IDA has not begun")
        x = self._drive.x if self.status == "more" and self._drive is not None else None
        found = _solution(self._asked, outcome, self._backend, self.status, x)
        return found if self._drive is None else replace(found, stats={**found.stats, "work": self.work})

    def close(self) -> None:
        """Free IDA's memory."""
        if self._drive is not None:
            self._drive.close()


def work(problem: Problem, asked: IdaRequest, steps: int, rhs: int, jac: int, restarts: int) -> float:
    """What some steps and evaluations cost, ns: estimated from counted operations (measured for 3 to 200 states)."""
    n, effort = len(problem.x0), problem.effort
    factorise, solve = asked.matrix.operations(n)
    looks = effort.roots if problem.roots is not None else 0.0
    step = 1100.0 + 60.0 * n + 2.0 * looks
    return (
        steps * step + rhs * (effort.rhs + OPERATION * solve) + jac * (effort.jac + OPERATION * factorise)
        + restarts * (800.0 + effort.update + 4.0 * looks)
    )  # fmt: skip


def trial(problem: Problem) -> float:
    """The work, ns, that `TRIAL` steps are expected to be, with all that it takes to begin: known before IDA is made ready."""
    n, looks = len(problem.x0), problem.effort.roots if problem.roots is not None else 0.0
    return START + TRIAL * (1100.0 + 60.0 * n + 2.0 * looks + 1.3 * problem.effort.rhs)


def _native(asked: IdaRequest) -> tuple[str, Drive | None]:
    """The native backend, or the reason why it is not available."""
    try:
        sundials = load()
        from gearlib.solvers.ida.native_backend import Drive

        return f"native: SUNDIALS {sundials.version}", Drive(sundials, asked)
    except UnavailableError as reason:
        return f"scikit-sundae: {reason}", None


def _solution(asked: IdaRequest, outcome: IdaOutcome, backend: str, status: str, x: Floats | None) -> Solution:
    stats: dict[str, Any] = {
        "steps": outcome.steps,
        "attempts": outcome.attempts,
        "rejected": None if outcome.steps is None else outcome.attempts - outcome.steps,
        "rhs": outcome.rhs,
        "jac": outcome.jac,
        "events": len(outcome.event_times),
        "restarts": outcome.restarts,
        "order": outcome.order,
        "linear_solver": asked.matrix.describe(),
        "backend": backend,
        "work": None,
    }
    done = status == "done"
    samples = len(asked.times) if done else int(np.searchsorted(asked.times, outcome.t, side="right"))
    if not done:
        stats["data"] = asked.data.copy()
        x = outcome.x_failed if x is None else x
    return Solution(
        t=asked.times[:samples],
        x=outcome.x[:samples],
        modes=outcome.modes[:samples],
        status=status,
        t_last=float(asked.times[-1]) if done else outcome.t,
        x_last=outcome.x[-1].copy() if x is None else x,
        event_times=outcome.event_times,
        event_roots=outcome.event_roots,
        stats=stats,
    )
