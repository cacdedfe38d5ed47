"""Native IDA backend: SUNDIALS with compiled callbacks and a compiled loop."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from gearlib.compiler.native_module import native_functions
from gearlib.compiler.small_language import Prototype
from gearlib.solvers.drive.drive_loop import ROOT
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.ida import callbacks
from gearlib.solvers.ida.ida_stepper import ERROR_TEST, IdaStepper
from gearlib.solvers.ida.sundials import Solver, Sundials
from gearlib.solvers.problem import Floats

_FUNCTIONS = {
    "array_pointer": "N_VGetArrayPointer",
    "solve": "IDASolve",
    "reinit": "IDAReInit",
    "calc_ic": "IDACalcIC",
    "get_ic": "IDAGetConsistentIC",
    "root_info": "IDAGetRootInfo",
    "set_stop": "IDASetStopTime",
    "get_dky": "IDAGetDky",
    "get_steps": "IDAGetNumSteps",
    "ls_setup": "SUNLinSolSetup",
    "ls_solve": "SUNLinSolSolve",
}

_RESTART = Prototype("int32", ("int", "int", "int"))


def _functions() -> Mapping[str, int]:
    """Addresses of the compiled callbacks and stepper functions."""
    return native_functions(callbacks.__name__).addresses


class NativeIda(IdaStepper):
    """IDA with compiled callbacks.

    Parameters
    ----------
    sundials
        The libraries, from `gearlib.solvers.ida.sundials.load`.
    linear_solver
        As for `IdaStepper`.
    """

    solver: Solver | None = None

    def __init__(self, sundials: Sundials, linear_solver: str | None = None) -> None:
        super().__init__(linear_solver)
        self.sundials, self.backend = sundials, f"native: SUNDIALS {sundials.version}"

    def attach(self, driver: Driver, memory: Callable[[str], Floats]) -> None:
        super().attach(driver, memory)
        order, n = self.matrix.order, driver.x.size
        y = driver.x if order is None else driver.x[order]
        dy = np.zeros(n)
        self.arrays: dict[str, Any] = {}  # referenced by the record
        self.solver = Solver(self.sundials, y, dy)
        try:
            self._prepare(self.solver, y, dy)
        except BaseException:
            self.close()
            raise

    def _point(self, **arrays: Any) -> None:
        """Set pointers of the record to arrays, and keep these alive."""
        for name, array in arrays.items():
            self.arrays[name] = array
            setattr(self.record, name, array.ctypes.data if array.size else 0)

    def _prepare(self, solver: Solver, y: Floats, dy: Floats) -> None:
        problem, matrix, record = self.problem, self.matrix, self.record
        n, n_roots, between = y.size, record.n_roots, np.zeros(y.size)
        self._point(
            f=np.zeros(n), y=y, dy=dy, natural=np.zeros(2 * n), differential=self.differential,
            order=np.empty(0) if matrix.order is None else matrix.order, atol=self.atol[self.permuted], probe=np.zeros(n),
            between=between, values=np.zeros(len(matrix.position)), position=matrix.position, diagonal=matrix.diagonal,
            sides=np.zeros(n_roots, dtype=np.int32), before=np.zeros(n_roots, dtype=np.int32), g=np.zeros(n_roots),
            defect=np.zeros(n), change=np.zeros(n), y_before=np.zeros(n), dy_before=np.zeros(n),
            scale=self.scales[self.permuted], part=matrix.part, later=np.zeros(n_roots),
            scratch=np.zeros(1), counter=np.zeros(1, dtype=np.int64),
        )  # fmt: skip
        record.rates = 0 if problem.implicit else record.natural + 8 * n
        record.nnz, record.n_diagonal = len(matrix.position), len(matrix.diagonal)
        record.jac = 0 if problem.jac is None else problem.jac.address
        for name, function in _FUNCTIONS.items():
            setattr(record, name, self.sundials.address(function))
        found = _functions()
        solver.create(found["residual"], record.t, record.address, self.rtol, self.arrays["atol"], self.differential)
        self.sundials.IDASetNonlinConvCoef(solver.mem, self.newton)
        if problem.implicit:
            self.sundials.IDASetSuppressAlg(solver.mem, 1)
        if problem.longest_step < math.inf:
            self.sundials.IDASetMaxStep(solver.mem, problem.longest_step)
        if matrix.pattern is not None:
            starts, rows = matrix.pattern
            record.matrix, record.pattern, record.starts = solver.use_sparse(len(rows))
            record.n_pattern = record.n_matrix = len(rows)
            self._point(pattern_source=rows, starts_source=starts)
        else:
            record.matrix = solver.use_band(matrix.upper, matrix.lower) if matrix.kind == "band" else solver.use_dense()
            height = matrix.upper + 2 * matrix.lower + 1 if matrix.kind == "band" else n
            record.n_matrix = n * height
        directions = np.repeat(np.array([0, 1], np.int32), n_roots)  # the second half: functions that turn away from zero
        solver.attach(None if problem.jac is None else found["jacobian"], found["roots"], directions)
        record.mem, record.yy, record.yp, record.yd = solver.mem, solver.yy, solver.yp, solver.vector(between)
        record.linear_solver, record.sun_matrix = solver.linear_solver, solver.matrix
        record.defect_vector, record.change_vector = solver.vector(self.arrays["defect"]), solver.vector(self.arrays["change"])
        record.step, record.interpolate = found["ida_step"], found["ida_interpolate"]
        record.accept, record.restart = found["ida_accept"], found["ida_restart"]
        if record.n_algebraic and record.update:  # the event iteration depends on algebraic unknowns
            code = _RESTART(record.restart, record.address, 1, ROOT)
            if code < 0:
                raise self.failure(code)
            self.driver.fired[:] = 0
            record.restarts = 0

    @property
    def rates(self) -> Floats:
        found: Floats = self.arrays["dy"]
        return found

    def until(self, t: float, longest_step: float) -> None:
        super().until(t, longest_step)
        if self.solver is not None:
            self.sundials.IDASetMaxStep(self.solver.mem, longest_step if longest_step < math.inf else 0.0)  # 0: unlimited

    def worst_state(self) -> int:
        worst = self.solver.worst() if self.solver is not None and self.record.done > 0 else -1
        return int(self.matrix.order[worst]) if self.matrix.order is not None and worst >= 0 else worst

    def step_size(self) -> float | None:
        return None if self.solver is None else float(self.solver.number("IDAGetCurrentStep"))

    def recovers(self, code: int) -> bool:
        """Relax the absolute tolerance of the state whose error test fails, from IDA's fraction to the full one requested.

        A state that passes through zero among large ones carries their rounding, which may exceed a fiftieth of its tolerance.
        """
        state = self.worst_state() if code == ERROR_TEST else -1
        if self.solver is None or state < 0 or self.atol[state] >= self.full_atol[state]:
            return False
        self.atol[state] = self.full_atol[state]
        eased = self.atol[self.permuted]
        self._point(atol=eased)
        self.sundials.IDASVtolerances(self.solver.mem, self.rtol, self.solver.vector(eased))
        return _RESTART(self.record.restart, self.record.address, 1, ROOT) >= 0

    def stats(self) -> dict[str, Any]:
        done = self.record.done
        order = None if self.solver is None else self.solver.number("IDAGetLastOrder", ctypes.c_int)
        return {**super().stats(), "steps": done, "rejected": self.record.attempts - done, "order": order}

    def close(self) -> None:
        if self.solver is not None:
            self.solver.close(self.record.factorised != 0)
            self.solver = None
