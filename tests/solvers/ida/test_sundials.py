"""The libraries of SUNDIALS: when they are refused, and that what a solver makes is freed, once."""

from __future__ import annotations

import ctypes
import importlib.util
import sys
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.solvers.ida import ida, sundials
from gearlib.solvers.ida.sundials import Solver, UnavailableError, load

MADE = {
    "SUNContext_Create": "SUNContext_Free", "N_VMake_Serial": "N_VDestroy", "IDACreate": "IDAFree", "SUNDenseMatrix": "SUNMatDestroy",
    "SUNBandMatrix": "SUNMatDestroy", "SUNSparseMatrix": "SUNMatDestroy", "SUNLinSol_Dense": "SUNLinSolFree",
    "SUNLinSol_Band": "SUNLinSolFree", "SUNLinSol_SuperLUMT": "SUNLinSolFree",
}  # fmt: skip


class Counting:
    """The libraries, with a count of the calls of each function."""

    def __init__(self) -> None:
        self.calls: Counter[str] = Counter()

    def __getattr__(self, name: str) -> Any:
        function = getattr(load(), name)

        def call(*arguments: Any) -> Any:
            self.calls[name] += 1
            return function(*arguments)

        return call


@pytest.mark.parametrize("kind", ["none", "dense", "band", "sparse"])
def test_what_is_made_is_freed_once(kind: str) -> None:
    lib, y = Counting(), np.zeros(3)
    solver = Solver(lib, y, np.zeros(3))  # type: ignore[arg-type]
    if kind != "none":
        residual = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, *(ctypes.c_void_p,) * 4)(lambda *_: 0)
        solver.create(ctypes.cast(residual, ctypes.c_void_p).value or 0, 0.0, 0, 1e-6, np.ones(3), np.ones(3))
        {"dense": solver.use_dense, "band": lambda: solver.use_band(1, 1), "sparse": lambda: solver.use_sparse(5)}[kind]()
        solver.attach(None, 0, np.empty(0, np.int32))
        solver.vector(np.zeros(3))
        assert lib.calls["IDASetJacFn"] == lib.calls["IDARootInit"] == lib.calls["IDASetRootDirection"] == 0
    for _ in range(2):  # closing again does nothing
        solver.close(kind != "sparse")
    made: Counter[str] = Counter()
    for name, free in MADE.items():
        made[free] += lib.calls[name]
    made["SUNLinSolFree"] -= kind == "sparse"  # without a factorisation SUNDIALS would free what was never made
    assert {free: lib.calls[free] for free in made} == dict(made)
    assert lib.calls["N_VMake_Serial"] == (2 if kind == "none" else 5)
    assert lib.calls["SUNLogger_SetWarningFilename"] == 1  # its warnings go nowhere
    assert (solver.mem, solver.matrix, solver.linear_solver) == (0, 0, 0)


def test_what_cannot_be_made_is_an_error() -> None:
    for outcome in (None, -1, -22):
        with pytest.raises(MemoryError, match="SUNDIALS could not create a solver"):
            Solver._check(outcome)
    assert [Solver._check(outcome) for outcome in (0, 1, 7)] == [0, 1, 7]


def test_jacobian_and_events_are_set_where_they_are_given() -> None:
    lib = Counting()
    solver = Solver(lib, np.zeros(2), np.zeros(2))  # type: ignore[arg-type]
    kinds = [ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_double, *(ctypes.c_void_p,) * n)(lambda *_: 0) for n in (4, 9, 4)]
    residual, jacobian, roots = (ctypes.cast(kind, ctypes.c_void_p).value or 0 for kind in kinds)
    solver.create(residual, 0.0, 0, 1e-6, np.ones(2), np.ones(2))
    solver.use_dense()
    solver.attach(jacobian, roots, np.array([0, 1], np.int32))
    assert lib.calls["IDASetJacFn"] == lib.calls["IDARootInit"] == lib.calls["IDASetRootDirection"] == 1
    solver.close()


def test_functions_are_looked_up_at_once_but_those_of_superlu() -> None:
    """One that is missing is noticed before a run begins; SuperLU's library takes long to load."""
    found = sundials.open_sundials()
    assert {"IDACreate", "IDAGetDky", "IDAFree", "SUNBandMatrix"} <= found.functions.keys()
    assert "SUNLinSol_SuperLUMT" not in found.functions
    for name in ("IDASolve", "SUNLinSol_SuperLUMT"):
        assert found.address(name) == ctypes.cast(getattr(found, name), ctypes.c_void_p).value != 0


def test_an_installation_without_the_libraries_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    spec: list[Any] = [None]
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: spec[0])
    with pytest.raises(UnavailableError, match=r"^scikit-sundae is not installed$"):
        sundials.open_sundials()
    spec[0] = SimpleNamespace(origin=None)
    with pytest.raises(UnavailableError, match=r"^scikit-sundae is not installed$"):
        sundials.open_sundials()
    package = tmp_path / "sksundae"
    package.mkdir()
    spec[0] = SimpleNamespace(origin=str(package / "__init__.py"))
    for platform, folder in (("darwin", package / ".dylibs"), ("linux", tmp_path / "scikit_sundae.libs")):
        monkeypatch.setattr(sys, "platform", platform)
        with pytest.raises(UnavailableError, match=r"^this scikit-sundae ships no shared SUNDIALS libraries$"):
            sundials.open_sundials()
        folder.mkdir()
        with pytest.raises(UnavailableError, match=r"^scikit-sundae does not say how its SUNDIALS was built$"):
            sundials.open_sundials()
        folder.rmdir()
    folder.mkdir()
    for real, integer in (("single", "int"), ("double", "long"), ("", "int")):
        text = f'SUNDIALS_FLOAT_TYPE = "{real}"\nSUNDIALS_INT_TYPE = "{integer}"\nSUNDIALS_VERSION = "7.0.0"\n'
        (package / "py_config.pxi").write_text(text)
        assert sundials.configuration(package)["SUNDIALS_VERSION"] == "7.0.0"
        with pytest.raises(UnavailableError, match=r"^scikit-sundae's SUNDIALS was not built for double precision and 32-bit"):
            sundials.open_sundials()


@pytest.mark.parametrize(("declared", "said"), [("7.0.1", "SUNDIALS {} found, 7.0.1 declared, 7 expected"), ("", None)])
def test_another_version_than_declared_is_refused(declared: str, said: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    own = load()
    built = {"SUNDIALS_FLOAT_TYPE": "double", "SUNDIALS_INT_TYPE": "int", "SUNDIALS_VERSION": declared or own.version}
    monkeypatch.setattr(sundials, "configuration", lambda package: built)
    if said is None:
        assert sundials.open_sundials().version == own.version
    else:
        with pytest.raises(UnavailableError) as told:
            sundials.open_sundials()
        assert str(told.value) == said.format(own.version)


def test_a_new_major_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Even if it is the one declared."""
    own, built = load(), {"SUNDIALS_FLOAT_TYPE": "double", "SUNDIALS_INT_TYPE": "int", "SUNDIALS_VERSION": "8.2.3"}

    class Newer:
        version = "8.2.3"

        def SUNDIALSGetVersionNumber(self, *numbers: Any) -> None:
            for number, value in zip(numbers[:3], (8, 2, 3), strict=True):
                number._obj.value = value

        def __getattr__(self, name: str) -> Any:
            return getattr(own, name)

    monkeypatch.setattr(sundials, "configuration", lambda package: built)
    monkeypatch.setattr(sundials, "Sundials", lambda *_: Newer())
    with pytest.raises(UnavailableError, match=r"^SUNDIALS 8\.2\.3 found, 8\.2\.3 declared, 7 expected$"):
        sundials.open_sundials()


def test_libraries_are_found_by_a_word_in_their_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On every system, in the order of the words; nothing else is opened."""
    for name in ("libida.so.7", "libida.txt", "libcore.dylib", "core.dll", "libother.so"):
        (tmp_path / name).write_text("")
    monkeypatch.setattr(ctypes, "CDLL", lambda path: Path(path).name)
    assert sundials.opened(tmp_path, "core", "ida", "none") == ("core.dll", "libcore.dylib", "libida.so.7")


def test_the_road_is_known_before_it_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (ida.is_native(), ida.is_native(False)) == (True, False)

    def nothing() -> None:
        raise UnavailableError("no libraries here")

    monkeypatch.setattr(ida, "load", nothing)
    assert (ida.is_native(), ida.is_native(False)) == (False, False)
    assert ida.ida().backend == "scikit-sundae: no libraries here"
    assert ida.ida(False).backend == "scikit-sundae: asked for"
