"""ctypes bindings of the SUNDIALS libraries in the scikit-sundae wheel, and one IDA solver object.

scikit-sundae's own interface calls Python for every residual. Its shared libraries do not need that: given the addresses of compiled
callbacks they run at C speed. Nothing of scikit-sundae is imported here; where its libraries are missing, or are not the SUNDIALS 7
with double precision and 32-bit indices that this module was written for, `load` raises with the reason, and its caller falls back on
scikit-sundae's interface.

References
----------
A. C. Hindmarsh et al., SUNDIALS: Suite of nonlinear and differential/algebraic equation solvers, ACM Trans. Math. Softw. 31
(2005) 363-396, doi:10.1145/1089014.1089020. IDA's functions: https://sundials.readthedocs.io/en/latest/ida/.
"""

from __future__ import annotations

import ctypes
import functools
import importlib.util
import os
import re
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_int, _double, _pointer = ctypes.c_int, ctypes.c_double, ctypes.c_void_p
_CSC = 0  # SUN_CSC_MAT

# name: (result, arguments). An argument `_pointer` takes an address, a numpy array's `.ctypes.data`, or None.
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "SUNContext_Create": (_int, [_int, _pointer]),
    "SUNContext_Free": (_int, [_pointer]),
    "SUNContext_ClearErrHandlers": (_int, [_pointer]),
    "SUNContext_GetLogger": (_int, [_pointer, _pointer]),
    "SUNLogger_SetWarningFilename": (_int, [_pointer, ctypes.c_char_p]),
    "SUNDIALSGetVersionNumber": (_int, [_pointer, _pointer, _pointer, _pointer, _int]),
    "N_VMake_Serial": (_pointer, [_int, _pointer, _pointer]),
    "N_VDestroy": (None, [_pointer]),
    "N_VGetArrayPointer": (_pointer, [_pointer]),
    "SUNDenseMatrix": (_pointer, [_int, _int, _pointer]),
    "SUNDenseMatrix_Data": (_pointer, [_pointer]),
    "SUNBandMatrix": (_pointer, [_int, _int, _int, _pointer]),
    "SUNBandMatrix_Data": (_pointer, [_pointer]),
    "SUNSparseMatrix": (_pointer, [_int, _int, _int, _int, _pointer]),
    "SUNSparseMatrix_Data": (_pointer, [_pointer]),
    "SUNSparseMatrix_IndexValues": (_pointer, [_pointer]),
    "SUNSparseMatrix_IndexPointers": (_pointer, [_pointer]),
    "SUNMatDestroy": (None, [_pointer]),
    "SUNLinSol_Dense": (_pointer, [_pointer, _pointer, _pointer]),
    "SUNLinSol_Band": (_pointer, [_pointer, _pointer, _pointer]),
    "SUNLinSol_SuperLUMT": (_pointer, [_pointer, _pointer, _int, _pointer]),
    "SUNLinSolInitialize": (_int, [_pointer]),
    "SUNLinSolSetup": (_int, [_pointer, _pointer]),
    "SUNLinSolSolve": (_int, [_pointer, _pointer, _pointer, _pointer, _double]),
    "SUNLinSolFree": (_int, [_pointer]),
    "IDACreate": (_pointer, [_pointer]),
    "IDAInit": (_int, [_pointer, _pointer, _double, _pointer, _pointer]),
    "IDAReInit": (_int, [_pointer, _double, _pointer, _pointer]),
    "IDASVtolerances": (_int, [_pointer, _double, _pointer]),
    "IDASetLinearSolver": (_int, [_pointer, _pointer, _pointer]),
    "IDASetJacFn": (_int, [_pointer, _pointer]),
    "IDASetUserData": (_int, [_pointer, _pointer]),
    "IDASetId": (_int, [_pointer, _pointer]),
    "IDASetNonlinConvCoef": (_int, [_pointer, _double]),
    "IDASetSuppressAlg": (_int, [_pointer, _int]),
    "IDASetMaxOrd": (_int, [_pointer, _int]),
    "IDASetMaxStep": (_int, [_pointer, _double]),
    "IDASetStopTime": (_int, [_pointer, _double]),
    "IDARootInit": (_int, [_pointer, _int, _pointer]),
    "IDASetRootDirection": (_int, [_pointer, _pointer]),
    "IDACalcIC": (_int, [_pointer, _int, _double]),
    "IDAGetConsistentIC": (_int, [_pointer, _pointer, _pointer]),
    "IDASolve": (_int, [_pointer, _double, _pointer, _pointer, _pointer, _int]),
    "IDAGetDky": (_int, [_pointer, _double, _int, _pointer]),
    "IDAGetRootInfo": (_int, [_pointer, _pointer]),
    "IDAGetNumSteps": (_int, [_pointer, _pointer]),
    "IDAGetLastOrder": (_int, [_pointer, _pointer]),
    "IDAGetCurrentTime": (_int, [_pointer, _pointer]),
    "IDAGetCurrentStep": (_int, [_pointer, _pointer]),
    "IDAGetEstLocalErrors": (_int, [_pointer, _pointer]),
    "IDAGetErrWeights": (_int, [_pointer, _pointer]),
    "IDAFree": (None, [_pointer]),
}


class UnavailableError(Exception):
    """The native backend is not available; the message gives the reason."""


@dataclass(frozen=True)
class Sundials:
    """SUNDIALS functions by name, and their addresses."""

    version: str
    folder: Path
    libraries: tuple[ctypes.CDLL, ...]
    functions: dict[str, Any] = field(default_factory=dict)

    def __getattr__(self, name: str) -> Any:
        """The ctypes function for a SUNDIALS function name, looked up on first use."""
        if name not in _SIGNATURES:
            raise AttributeError(name)
        if name not in self.functions:
            self.functions[name] = self._look_up(name)
        return self.functions[name]

    def address(self, name: str) -> int:
        """The address of a SUNDIALS function."""
        return ctypes.cast(getattr(self, name), ctypes.c_void_p).value or 0

    def _look_up(self, name: str) -> Any:
        # SuperLU's library depends on an OpenBLAS (25 ms): loaded only when a sparse matrix is to be factorised
        more = opened(self.folder, "sunlinsolsuperlumt") if name == "SUNLinSol_SuperLUMT" else ()
        for library in (*self.libraries, *more):
            function = getattr(library, name, None)
            if function is not None:
                function.restype, function.argtypes = _SIGNATURES[name]
                return function
        raise UnavailableError(f"the SUNDIALS libraries of scikit-sundae lack {name}")


def opened(folder: Path, *words: str) -> tuple[ctypes.CDLL, ...]:
    """The libraries whose names contain one of some words."""
    found = sorted(path for path in folder.iterdir() if re.search(r"\.(so|dylib|dll)(\.|$)", path.name))
    return tuple(ctypes.CDLL(str(path)) for word in words for path in found if word in path.name)


def configuration(package: Path) -> dict[str, str]:
    """Build configuration of scikit-sundae's SUNDIALS, read from the file in its wheel (importing it takes half a second)."""
    path = package / "py_config.pxi"
    if not path.is_file():
        raise UnavailableError("scikit-sundae does not say how its SUNDIALS was built")
    return dict(re.findall(r'^(\w+) = "([^"]*)"', path.read_text(), re.MULTILINE))


@functools.cache
def _load() -> Sundials | str:
    try:
        return open_sundials()
    except (UnavailableError, OSError) as problem:
        return str(problem)


def load() -> Sundials:
    """The SUNDIALS libraries shipped with the installed scikit-sundae.

    Raises
    ------
    UnavailableError
        Gives the reason: scikit-sundae not installed, built from source against other libraries, or another SUNDIALS version.
    """
    found = _load()
    if isinstance(found, str):
        raise UnavailableError(found)
    return found


def open_sundials() -> Sundials:
    spec = importlib.util.find_spec("sksundae")
    if spec is None or spec.origin is None:
        raise UnavailableError("scikit-sundae is not installed")
    package = Path(spec.origin).parent
    folder = package / ".dylibs" if sys.platform == "darwin" else package.parent / "scikit_sundae.libs"
    if not folder.is_dir():
        raise UnavailableError("this scikit-sundae ships no shared SUNDIALS libraries")
    built = configuration(package)
    if built.get("SUNDIALS_FLOAT_TYPE") != "double" or built.get("SUNDIALS_INT_TYPE") != "int":
        raise UnavailableError("scikit-sundae's SUNDIALS was not built for double precision and 32-bit indices")
    if sys.platform == "win32":
        os.add_dll_directory(str(folder))
    # libsundials_ida contains the serial vectors and the dense and band solvers too, except for symbols that a linker may have dropped.
    words = ("sundials_ida", "sundials_core", "nvecserial", "sunmatrix", "sunlinsoldense", "sunlinsolband")
    sundials = Sundials(built.get("SUNDIALS_VERSION", ""), folder, opened(folder, *words))
    major, minor, patch = _int(), _int(), _int()
    label = ctypes.create_string_buffer(64)
    sundials.SUNDIALSGetVersionNumber(ctypes.byref(major), ctypes.byref(minor), ctypes.byref(patch), label, 64)
    version = f"{major.value}.{minor.value}.{patch.value}"
    if major.value != 7 or version != sundials.version:
        raise UnavailableError(f"SUNDIALS {version} found, {sundials.version} declared, 7 expected")
    for name in _SIGNATURES:
        if name != "SUNLinSol_SuperLUMT":
            getattr(sundials, name)
    return sundials


class Solver:
    """One IDA solver object with all its resources, freed by `close`.

    Parameters
    ----------
    sundials
        The libraries.
    y, dy
        States and their derivatives, shared with IDA, which reads start values from them and writes solutions to them.
    """

    def __init__(self, sundials: Sundials, y: Floats, dy: Floats) -> None:
        self.sundials = sundials
        self._arrays: list[Floats] = []  # memory used by IDA's vectors
        self._vectors: list[int] = []
        self.mem = self.matrix = self.linear_solver = self.sparse = 0
        self._context = ctypes.c_void_p()
        self._check(sundials.SUNContext_Create(0, ctypes.byref(self._context)))
        self._silence()
        self.yy, self.yp = self.vector(y), self.vector(dy)
        self.n = len(y)

    def _silence(self) -> None:
        """Suppress terminal output; errors come back as return values."""
        self.sundials.SUNContext_ClearErrHandlers(self._context)
        logger = ctypes.c_void_p()
        if self.sundials.SUNContext_GetLogger(self._context, ctypes.byref(logger)) == 0 and logger:
            self.sundials.SUNLogger_SetWarningFilename(logger, b"")

    @staticmethod
    def _check(outcome: int | None) -> int:
        """Check a status, which must not be negative, or a pointer, which must not be null."""
        if outcome is None or outcome < 0:
            raise MemoryError("SUNDIALS could not create a solver")
        return outcome

    def vector(self, values: Floats) -> int:
        """An N_Vector over a numpy array's memory."""
        made = self._check(self.sundials.N_VMake_Serial(len(values), values.ctypes.data, self._context))
        self._arrays.append(values)
        self._vectors.append(made)
        return made

    def create(self, residual: int, t: float, user_data: int, rtol: float, atol: Floats, differential: Floats) -> None:
        """Create the IDA object from the residual's address, start time and tolerances."""
        lib = self.sundials
        self.mem = self._check(lib.IDACreate(self._context))
        self._check(lib.IDAInit(self.mem, residual, t, self.yy, self.yp))
        self._check(lib.IDASetUserData(self.mem, user_data))
        self._check(lib.IDASVtolerances(self.mem, rtol, self.vector(atol)))
        self._check(lib.IDASetId(self.mem, self.vector(differential)))
        self._check(lib.IDASetMaxOrd(self.mem, 5))

    def use_dense(self) -> int:
        """Use a dense matrix; returns the address of its columns."""
        lib = self.sundials
        self.matrix = self._check(lib.SUNDenseMatrix(self.n, self.n, self._context))
        self.linear_solver = self._check(lib.SUNLinSol_Dense(self.yy, self.matrix, self._context))
        return self._check(lib.SUNDenseMatrix_Data(self.matrix))

    def use_band(self, upper: int, lower: int) -> int:
        """Use a band matrix; returns the address of its columns."""
        lib = self.sundials
        self.matrix = self._check(lib.SUNBandMatrix(self.n, upper, lower, self._context))
        self.linear_solver = self._check(lib.SUNLinSol_Band(self.yy, self.matrix, self._context))
        return self._check(lib.SUNBandMatrix_Data(self.matrix))

    def use_sparse(self, nonzeros: int) -> tuple[int, int, int]:
        """Use a matrix in compressed sparse columns, factorised by SuperLU; returns the addresses of values, rows and column starts."""
        lib, self.sparse = self.sundials, 1
        self.matrix = self._check(lib.SUNSparseMatrix(self.n, self.n, nonzeros, _CSC, self._context))
        self.linear_solver = self._check(lib.SUNLinSol_SuperLUMT(self.yy, self.matrix, 1, self._context))
        values, rows = lib.SUNSparseMatrix_Data(self.matrix), lib.SUNSparseMatrix_IndexValues(self.matrix)
        return values, rows, lib.SUNSparseMatrix_IndexPointers(self.matrix)

    def attach(self, jacobian: int | None, roots: int, directions: NDArray[np.int32]) -> None:
        """Set the matrix, the Jacobian's address (None: difference quotients) and the event functions.

        For each event function, ``directions`` selects the crossings to detect: 1 rising ones, 0 all.
        """
        lib = self.sundials
        self._check(lib.SUNLinSolInitialize(self.linear_solver))
        self._check(lib.IDASetLinearSolver(self.mem, self.linear_solver, self.matrix))
        if jacobian is not None:
            self._check(lib.IDASetJacFn(self.mem, jacobian))
        if len(directions):
            self._check(lib.IDARootInit(self.mem, len(directions), roots))
            self._check(lib.IDASetRootDirection(self.mem, directions.ctypes.data))

    def number(self, name: str, kind: Any = ctypes.c_double) -> Any:
        """A counter or size kept by IDA, by the name of its getter."""
        value = kind()
        getattr(self.sundials, name)(self.mem, ctypes.byref(value))
        return value.value

    def worst(self) -> int:
        """The component with the largest local error estimate in the last step, -1 if there is none."""
        errors, weights = np.zeros(self.n), np.zeros(self.n)
        lib = self.sundials
        e, w = self.vector(errors), self.vector(weights)
        if lib.IDAGetEstLocalErrors(self.mem, e) < 0 or lib.IDAGetErrWeights(self.mem, w) < 0:
            return -1
        return int(np.argmax(np.nan_to_num(np.abs(errors * weights))))

    def close(self, factorised: bool = True) -> None:
        """Free all resources; SuperLU's solver only if a factorisation was begun, without which SUNDIALS frees what was never made."""
        lib = self.sundials
        if self.mem:
            lib.IDAFree(ctypes.byref(ctypes.c_void_p(self.mem)))
        if self.linear_solver and (factorised or not self.sparse):
            lib.SUNLinSolFree(self.linear_solver)
        if self.matrix:
            lib.SUNMatDestroy(self.matrix)
        for vector in self._vectors:
            lib.N_VDestroy(vector)
        self._vectors.clear()
        if self._context:
            lib.SUNContext_Free(ctypes.byref(self._context))
        self.mem = self.matrix = self.linear_solver = 0
