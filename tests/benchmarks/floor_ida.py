"""How much slower `gearlib.solvers.ida.ida` is than the least that IDA can take, with residual and Jacobian written by hand.

The model is a chain of N inertias J_i = 0.01 (1 + i/N) kg.m2, joined by spring-dampers (1e5 N.m/rad, 5 N.m.s/rad), with a
damper of 1 N.m.s/rad from the last to ground and a torque of 100 sin(2 pi 50 t) N.m on the first, from rest, 0..0.5 s, 101
samples. States are the relative angles and the speeds.

The floor is a C program's inner half (through ctypes, in the same SUNDIALS libraries): unknowns in the order along the chain,
the Jacobian written straight into the band matrix, and a loop of nothing but ``IDASolve`` and a copy. It needs a C compiler:

    python tests/benchmarks/floor_ida.py
"""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import carray, cfunc, types

from gearlib.solvers.ida.ida_stepper import SAFETY
from gearlib.solvers.ida.sundials import Solver, load
from gearlib.solvers.problem import Problem, Solution
from tests.run.python_problem import by_ida

TIMES = np.linspace(0.0, 0.5, 101)
SOURCE = r"""
#include <math.h>
#include <stddef.h>
#include <string.h>
typedef struct { int length, own; double *data; } content;
typedef struct { content *content; } vector;
typedef struct { int n; double c, d, ground; double *j; double *band; int height, stored; } model;
#define DATA(v) (((vector *)(v))->content->data)
/* w_0 q_0 w_1 q_1 ... w_(N-1) */
int residual(double t, void *yy, void *yp, void *rr, void *user) {
  model *m = user; double *y = DATA(yy), *dy = DATA(yp), *r = DATA(rr), before = -100 * sin(2 * M_PI * 50 * t);
  int n = m->n;
  for (int i = 0; i < n - 1; i++) {
    double slip = y[2*i+2] - y[2*i], torque = m->c * y[2*i+1] + m->d * slip;
    r[2*i+1] = dy[2*i+1] - slip;
    r[2*i] = dy[2*i] - (torque - before) / m->j[i];
    before = torque;
  }
  r[2*n-2] = dy[2*n-2] + (m->ground * y[2*n-2] + before) / m->j[n-1];
  return 0;
}
#define A(i, k) m->band[(size_t)(k) * m->height + (i) - (k) + m->stored]
int jacobian(double t, double cj, void *yy, void *yp, void *rr, void *jj, void *user, void *t1, void *t2, void *t3) {
  model *m = user; int n = m->n;
  for (int i = 0; i < n; i++) {
    A(2*i, 2*i) = cj + ((i > 0) * m->d + (i < n - 1) * m->d + (i == n - 1) * m->ground) / m->j[i];
    if (i < n - 1) {
      A(2*i, 2*i+1) = -m->c / m->j[i]; A(2*i, 2*i+2) = -m->d / m->j[i];
      A(2*i+1, 2*i) = 1; A(2*i+1, 2*i+2) = -1; A(2*i+1, 2*i+1) = cj;
    }
    if (i > 0) { A(2*i, 2*i-1) = m->c / m->j[i]; A(2*i, 2*i-2) = -m->d / m->j[i]; }
  }
  return 0;
}
int drive(int (*solve)(void *, double, double *, void *, void *, int), void *mem, void *yy, void *yp, const double *times,
          int samples, double *out, int n) {
  double t;
  for (int k = 1; k < samples; k++) {
    int flag = solve(mem, times[k], &t, yy, yp, 1);
    if (flag < 0) return flag;
    memcpy(out + (size_t)k * n, DATA(yy), n * sizeof(double));
  }
  return 0;
}
"""


class Model(ctypes.Structure):
    """The C program's struct ``model``."""

    _fields_ = [
        ("n", ctypes.c_int),
        ("c", ctypes.c_double),
        ("d", ctypes.c_double),
        ("ground", ctypes.c_double),
        ("j", ctypes.c_void_p),
        ("band", ctypes.c_void_p),
        ("height", ctypes.c_int),
        ("stored", ctypes.c_int),
    ]


def compile_floor() -> Any:
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder) / "floor.c", Path(folder) / "floor.so"
        source.write_text(SOURCE)
        subprocess.run(["cc", "-O3", "-shared", "-fPIC", "-o", str(library), str(source), "-lm"], check=True)
        return ctypes.CDLL(str(library))


def inertias(count: int) -> Any:
    return 0.01 * (1 + np.arange(count) / count)


def floor(library: Any, count: int, rtol: float) -> tuple[Any, int]:
    """Samples, in the order along the chain, and steps."""
    n = 2 * count - 1
    y, dy, out, j = np.zeros(n), np.zeros(n), np.zeros((len(TIMES), n)), inertias(count)
    atol = np.full(n, rtol)
    atol[::2] *= 1e-2
    atol[1::2] *= 1e-4
    sundials = load()
    solver = Solver(sundials, y, dy)
    model = Model(count, 1e5, 5.0, 1.0, j.ctypes.data, 0, 7, 4)
    address = [ctypes.cast(f, ctypes.c_void_p).value for f in (library.residual, library.jacobian)]
    solver.create(address[0], 0.0, ctypes.addressof(model), rtol, atol, np.ones(n))
    model.band = solver.use_band(2, 2)
    solver.attach(address[1], 0, np.empty(0, np.int32))
    most_steps = next(lib.IDASetMaxNumSteps for lib in sundials.libraries if hasattr(lib, "IDASetMaxNumSteps"))
    most_steps(ctypes.c_void_p(solver.mem), ctypes.c_long(10**7))
    sundials.IDASetStopTime(solver.mem, TIMES[-1])
    pointers = [ctypes.c_void_p(p) for p in (sundials.address("IDASolve"), solver.mem, solver.yy, solver.yp, TIMES.ctypes.data)]
    flag = library.drive(*pointers, len(TIMES), ctypes.c_void_p(out.ctypes.data), n)
    steps = solver.number("IDAGetNumSteps", ctypes.c_long)
    solver.close()
    assert flag >= 0
    return out, steps


doubles, longs = types.CPointer(types.float64), types.CPointer(types.int64)
evaluates = cfunc(types.int32(types.float64, doubles, doubles, doubles, longs), cache=True)


@evaluates
def chain_rhs(t, x_, dx_, data_, index_):
    count = carray(index_, 1)[0]
    x, dx, data = carray(x_, 2 * count - 1), carray(dx_, 2 * count - 1), carray(data_, count + 3)
    before = -100 * math.sin(2 * math.pi * 50 * t)
    for i in range(count - 1):
        slip = x[count + i] - x[count - 1 + i]
        torque = data[0] * x[i] + data[1] * slip
        dx[i] = slip
        dx[count - 1 + i] = (torque - before) / data[3 + i]
        before = torque
    dx[2 * count - 2] = (-data[2] * x[2 * count - 2] - before) / data[2 + count]
    return 0


@evaluates
def chain_jac(t, x_, values_, data_, index_):
    count = carray(index_, 1)[0]
    data, values = carray(data_, count + 3), carray(values_, 7 * count)
    c, d, j = data[0], data[1], data[3:]
    k = 0
    for i in range(count - 1):  # an angle moves the speeds on either side
        values[k], values[k + 1] = c / j[i], -c / j[i + 1]
        k += 2
    for i in range(count):  # a speed moves the angles and speeds beside it
        if i > 0:
            values[k] = 1.0
            k += 1
        if i < count - 1:
            values[k] = -1.0
            k += 1
        if i > 0:
            values[k] = d / j[i - 1]
            k += 1
        values[k] = -(d * ((i > 0) + (i < count - 1)) + data[2] * (i == count - 1)) / j[i]
        k += 1
        if i < count - 1:
            values[k] = d / j[i + 1]
            k += 1
    return 0


def chain(count: int) -> Problem:
    """The same model by the contract: all angles, then all speeds."""
    columns = [[count - 1 + i, count + i] for i in range(count - 1)]
    for i in range(count):
        angles = [k for k in (i - 1, i) if 0 <= k < count - 1]
        columns.append(angles + [count - 1 + k for k in (i - 1, i, i + 1) if 0 <= k < count])
    n = 2 * count - 1
    return Problem(
        rhs=chain_rhs,
        jac=chain_jac,
        jac_indptr=np.cumsum([0, *map(len, columns)]),
        jac_indices=np.array([row for column in columns for row in column]),
        x0=np.zeros(n),
        data=np.concatenate([[1e5, 5.0, 1.0], inertias(count)]),
        index=np.array([count]),
        differential=np.ones(n, dtype=bool),
        nominal=np.concatenate([np.full(count - 1, 1e-4), np.full(count, 1e-2)]),
    )


def compare(library: Any, count: int, rtol: float = 1e-6, repeats: int = 7) -> dict[str, float]:
    """Processor times of both, in ms, best of several taken in turn; they must take the same steps to the same samples."""
    problem, best = chain(count), [math.inf, math.inf]
    for _ in range(repeats):
        start = time.process_time()
        least, steps = floor(library, count, SAFETY * rtol)
        middle = time.process_time()
        solution: Solution = by_ida(problem, TIMES, rtol=rtol)
        best = [min(best[0], middle - start), min(best[1], time.process_time() - middle)]
    speeds = solution.x[:, count - 1 :]
    np.testing.assert_allclose(speeds, least[:, ::2], atol=100 * rtol * np.max(np.abs(speeds)))
    return {
        "inertias": count,
        "floor, ms": 1e3 * best[0],
        "gearlib, ms": 1e3 * best[1],
        "ratio": best[1] / best[0],
        "floor, steps": steps,
        "gearlib, steps": solution.stats["steps"],
    }


@pytest.mark.benchmark
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.parametrize("count", [10, 100, 1000])
def test_within_1_3_times_the_floor(count: int) -> None:
    assert compare(compile_floor(), count)["ratio"] < 1.3


if __name__ == "__main__":
    compiled = compile_floor()
    for size in (10, 100, 1000):
        print(", ".join(f"{name} {value:.4g}" for name, value in compare(compiled, size).items()))
