"""Integration of index-1 differential-algebraic problems by SUNDIALS' IDA: variable-order, variable-step BDF.

The residual is diag(differential) x' - f(t, x), the iteration matrix cj diag(differential) - df/dx. Two roads lead to the same
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
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gearlib.solvers.ida.ida_request import ERROR_TEST, Outcome, Request, failure, refused, request, with_less_safety
from gearlib.solvers.ida.sundials import UnavailableError, load
from gearlib.solvers.problem import Problem, Solution
from gearlib.solvers.rungekutta.rungekutta import PATIENCE

__all__ = ["integrate"]


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
        Stop with the status ``"left"`` where the right-hand side cannot be evaluated further on (native road only). The solution
        then holds the samples up to ``t_last``, and ``stats["data"]`` the model's data there.

    Returns
    -------
    Solution
        Its ``stats`` hold ``steps``, ``attempts`` (steps tried) and ``rejected`` (the difference), ``rhs`` and ``jac``
        (evaluations), ``events``, ``restarts``, ``order`` (of the last step), ``linear_solver`` and ``road``. The scikit-sundae
        road cannot tell ``steps``, ``rejected`` and ``order``: None.

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
    asked = request(problem, times, rtol, atol, max_steps, linear_solver)
    if may_leave:
        asked = replace(asked, patience=PATIENCE)
    road, outcome = _run(asked, native)
    while outcome.status == ERROR_TEST and (eased := with_less_safety(asked, outcome.worst_state)) is not None:
        asked = eased
        road, outcome = _run(asked, native)
    if outcome.status < 0 and not (may_leave and outcome.x_failed is not None and refused(asked, outcome)):
        raise failure(asked, outcome)
    return _solution(asked, outcome, road)


def _run(asked: Request, native: bool) -> tuple[str, Outcome]:
    """The road taken, and what it brought back."""
    road, outcome = _native(asked) if native else ("scikit-sundae: asked for", None)
    if outcome is None:
        from gearlib.solvers.ida import sksundae_backend

        outcome = sksundae_backend.run(asked)
    return road, outcome


def _native(asked: Request) -> tuple[str, Outcome | None]:
    try:
        sundials = load()
    except UnavailableError as reason:
        return f"scikit-sundae: {reason}", None
    from gearlib.solvers.ida import native_backend

    try:
        return f"native: SUNDIALS {sundials.version}", native_backend.run(sundials, asked)
    except UnavailableError as reason:
        return f"scikit-sundae: {reason}", None


def _solution(asked: Request, outcome: Outcome, road: str) -> Solution:
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
        "road": road,
    }
    left = outcome.status < 0
    samples = int(np.searchsorted(asked.times, outcome.t, side="right")) if left else len(asked.times)
    if left:
        stats["data"] = asked.data
    return Solution(
        t=asked.times[:samples],
        x=outcome.x[:samples],
        modes=outcome.modes[:samples],
        status="left" if left else "done",
        t_last=outcome.t if left else float(asked.times[-1]),
        x_last=outcome.x[-1].copy() if outcome.x_failed is None else outcome.x_failed,
        event_times=outcome.event_times,
        event_roots=outcome.event_roots,
        stats=stats,
    )
