"""Integration of index-1 differential-algebraic problems by SUNDIALS' IDA: variable-order, variable-step BDF.

The residual is diag(differential) x' - f(t, x), the iteration matrix cj diag(differential) - df/dx. Two roads lead to the same
IDA, in the library that the scikit-sundae wheel ships, and take the same steps: the *native* one hands IDA compiled callbacks
and loops over samples and events in compiled code; the *scikit-sundae* one goes through that package's Python interface and
is taken where its library cannot be driven directly.

References
----------
A. C. Hindmarsh et al., SUNDIALS: Suite of nonlinear and differential/algebraic equation solvers, ACM Trans. Math. Softw. 31
(2005) 363-396, doi:10.1145/1089014.1089020.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gearlib.errors import ArgumentError, SolverError, StartError
from gearlib.solve.ida_matrix import MatrixPlan, plan
from gearlib.solve.problem import Floats, Integers, Problem, Solution
from gearlib.solve.sundials import Solver, Unavailable, load

__all__ = ["integrate"]
SAFETY = 0.02


@dataclass(frozen=True)
class Request:
    """What both roads integrate: the problem with its tolerances and storage."""

    problem: Problem
    times: Floats
    rtol: float  # as handed to IDA
    atol: Floats
    matrix: MatrixPlan
    max_steps: int
    time_events: Floats  # those after the start


def integrate(
    problem: Problem,
    times: ArrayLike,
    *,
    rtol: float,
    atol: ArrayLike | None = None,
    native: bool = True,
    max_steps: int = 100_000_000,
    linear_solver: str | None = None,
) -> Solution:
    request = _request(problem, times, rtol, atol, max_steps, linear_solver)
    if native:
        try:
            return _native(request)
        except Unavailable as reason:
            why = str(reason)
    else:
        why = "asked for"
    raise NotImplementedError(why)


def _request(
    problem: Problem, times: ArrayLike, rtol: float, atol: ArrayLike | None, max_steps: int, linear_solver: str | None
) -> Request:
    t = np.ascontiguousarray(times, dtype=np.float64)
    n = len(problem.x0)
    absolute = np.asarray(rtol * problem.nominal if atol is None else atol, dtype=np.float64)
    absolute = np.array(np.broadcast_to(absolute, (n,)))
    events = np.asarray(problem.time_events, dtype=np.float64)
    return Request(problem, t, rtol*SAFETY, absolute*SAFETY, plan(problem, linear_solver), max_steps, np.unique(events[events > t[0]]))


def _address(array: Any) -> int:
    return int(array.ctypes.data) if array is not None and array.size else 0


def _native(request: Request) -> Solution:
    sundials = load()
    from gearlib.solve import ida_compiled as compiled

    problem, matrix, n = request.problem, request.matrix, len(request.problem.x0)
    y, dy, x = np.array(problem.x0[matrix.order] if matrix.order is not None else problem.x0, dtype=float), np.zeros(n), np.zeros(n)
    frame = np.zeros(1, dtype=compiled.FRAME)
    keep: list[Any] = []
    solver = Solver(sundials, y, dy)
    order = matrix.order if matrix.order is not None else slice(None)
    differential = problem.differential[order].astype(np.float64)
    data = np.array(problem.data, dtype=np.float64)
    index = np.ascontiguousarray(problem.index, dtype=np.int64)
    modes = data[problem.modes]
    samples = len(request.times)
    out, modes_out = np.empty((samples, n)), np.empty((samples, len(modes)))
    try:
        addresses = {
            "rhs": problem.rhs.address, "jac": problem.jac.address if problem.jac else 0, "roots": problem.roots.address if problem.roots else 0,
            "update": problem.update.address if problem.update else 0, "mem": 0, "yy": solver.yy, "yp": solver.yp,
        }
        names = {"array_pointer": "N_VGetArrayPointer", "solve": "IDASolve", "reinit": "IDAReInit", "calc_ic": "IDACalcIC", "get_ic": "IDAGetConsistentIC",
                 "root_info": "IDAGetRootInfo", "set_stop": "IDASetStopTime", "set_max_steps": "IDASetMaxNumSteps", "get_steps": "IDAGetNumSteps"}
        for k, v in names.items(): addresses[k] = sundials.address(v)
        nnz = len(matrix.position)
        nr = problem.n_roots
        arrays = {"data": data, "index": index, "y": y, "dy": dy, "x": x if matrix.order is not None else y, "f": np.zeros(n), "differential": differential,
                  "order": matrix.order, "values": np.zeros(nnz), "position": matrix.position, "diagonal": matrix.diagonal,
                  "fired": np.zeros(nr, np.int32), "sides": np.zeros(nr, np.int32), "g": np.zeros(nr), "times": request.times, "out": out, "modes_out": modes_out,
                  "time_events": request.time_events, "event_times": np.zeros(1000+nr), "event_roots": np.zeros(1000+nr, np.int64), "scratch": np.zeros(1), "counter": np.zeros(1, np.int64)}
        for k, v in arrays.items(): addresses[k] = _address(v)
        span = request.times[-1]-request.times[0]
        numbers = dict(n=n, nnz=nnz, n_diagonal=len(matrix.diagonal), n_roots=nr, n_algebraic=int((~problem.differential).sum()), n_times=samples,
                       n_time_events=len(request.time_events), n_modes=len(modes), first_mode=problem.modes.start or 0, event_capacity=1000+nr,
                       max_steps=request.max_steps, t=request.times[0], t_end=request.times[-1], window=max(1e-9*span, 1e6*2.2e-16*np.abs(request.times).max()), ic_span=0.01*span)
        solver.create(compiled.residual.address, float(request.times[0]), frame.ctypes.data, request.rtol, request.atol if matrix.order is None else request.atol[matrix.order], differential)
        addresses["mem"] = solver.mem
        if matrix.kind == "dense":
            addresses["matrix"] = solver.use_dense()
        elif matrix.kind == "band":
            addresses["matrix"] = solver.use_band(matrix.upper, matrix.lower)
        else:
            ptr, ind = matrix.pattern
            v, r, p = solver.use_sparse(len(ind))
            addresses["matrix"] = v
            import ctypes
            both = np.concatenate([ptr, ind])
            ctypes.memmove(p, ptr.ctypes.data, ptr.nbytes); ctypes.memmove(r, ind.ctypes.data, ind.nbytes)
            addresses["pattern"]=r; addresses["pattern_source"]=ind.ctypes.data; numbers["n_pattern"]=len(ind)
            addresses["starts"]=p; addresses["starts_source"]=ptr.ctypes.data
        for k, v in {**addresses, **numbers}.items():
            frame[k] = v
        solver.attach(compiled.jacobian.address if problem.jac else None, nr, compiled.roots.address)
        drive = compiled.drive.ctypes
        import ctypes
        p = ctypes.cast(frame.ctypes.data, drive.argtypes[0])
        while True:
            status = drive(p)
            if status != 1: break
        if status < 0:
            raise SolverError(f"{status} {frame}")
        s = frame[0]
        return Solution(request.times, out, modes_out, "done", request.times[-1], out[-1], arrays["event_times"][:s["events"]], arrays["event_roots"][:s["events"]],
           dict(steps=int(s["steps"]), rhs=int(s["n_rhs"]), jac=int(s["n_jac"]), attempts=int(s["attempts"]), linear=matrix.describe()))
    finally:
        solver.close()
