"""Index-1 differential-algebraic problems by SUNDIALS IDA (see `sundials`): variable-order, variable-step BDF.

The residual is diag(differential) x' - f(t, x), the iteration matrix cj diag(differential) - df/dx. Two backends drive the same IDA, in
the libraries that the scikit-sundae wheel ships, and take the same steps. The *native* backend passes compiled callbacks to IDA. The
*scikit-sundae* backend uses that package's Python interface, a hundred times slower on small models; it is the fallback where the
libraries cannot be driven directly.

A step ends at every time event. A root of an event function is located by IDA; `Problem.update` is then called with the state there,
and if it changes anything, the algebraic unknowns and derivatives are made consistent and IDA is restarted. An event function that is
exactly zero counts as negative: a relation that differs between its zero and its negative side needs the other sign.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gearlib.solvers.ida.sundials import UnavailableError, load

if TYPE_CHECKING:
    from gearlib.solvers.ida.ida_stepper import IdaStepper

__all__ = ["ida", "is_native"]


def ida(native: bool = True, linear_solver: str | None = None) -> IdaStepper:
    r"""An IDA stepper, with the native backend where it is available.

    Its statistics are ``steps``, ``attempts`` (attempted steps) and ``rejected`` (the difference), ``rhs`` and ``jac`` (evaluations),
    ``restarts``, ``order`` (of the last step), ``linear_solver``, ``backend`` and ``work`` (ns, estimated from counted operations). The
    scikit-sundae backend does not know ``steps``, ``rejected`` and ``order``: None.

    Parameters
    ----------
    native
        False forces scikit-sundae's Python interface.
    linear_solver
        ``"dense"``, ``"band"`` or ``"sparse"``; by default the cheapest for the sparsity pattern of df/dx.

    Examples
    --------
    Exponential decay, x' = -x:

    >>> import numpy as np
    >>> from gearlib.compiler.object_code import compiled
    >>> from gearlib.solvers.drive.driver import Driver, integrate
    >>> from gearlib.solvers.problem import Problem
    >>> source = "def rhs(t: float, x: floats, dx: floats, data: floats, index: ints) -> int32:\n    dx[0] = -x[0]\n    return 0"
    >>> rhs, one, times = compiled(source, "rhs"), np.ones(1), np.array([0.0, 1.0])
    >>> problem = Problem(rhs, one, np.zeros(1), np.zeros(1, dtype=np.int64), np.array([True]), one, times=times, rtol=1e-8)
    >>> solution = integrate(Driver(problem, ida()))
    >>> bool(abs(solution.x[-1, 0] - np.exp(-1)) < 1e-7)
    True
    """
    reason = "asked for"
    if native:
        try:
            sundials = load()
            from gearlib.solvers.ida.native_backend import NativeIda

            return NativeIda(sundials, linear_solver)
        except UnavailableError as unavailable:
            reason = str(unavailable)
    from gearlib.solvers.ida.sksundae_backend import SundaeIda

    return SundaeIda(reason, linear_solver)


def is_native(native: bool = True) -> bool:
    """Whether `ida` drives the libraries directly."""
    if native:
        try:
            load()
        except UnavailableError:
            return False
    return native
