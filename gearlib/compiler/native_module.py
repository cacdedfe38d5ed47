"""Compilation of modules written in the small language: integration loops, SUNDIALS callbacks, table look-up.

Such a module is an ordinary Python file. Functions decorated with `native` are compiled from their source text, once per machine; the
numbers, records and prototypes that they refer to are looked up in the module. A module may add functions that it generates itself, as
``GENERATED``.
"""

from __future__ import annotations

import ast
import ctypes
import hashlib
import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from numpy.typing import NDArray

from gearlib.compiler.cache import COMPILING, cached_bytes
from gearlib.compiler.object_code import compiler_digest, linked, optimised
from gearlib.compiler.small_language import Environment, Prototype, fields_of, is_record

_loaded: list[Any] = []  # linked libraries; never unloaded, since the addresses of their functions are stored in many places


@dataclass(frozen=True)
class NativeFunctions:
    """Addresses of the exported functions of some modules, valid for the lifetime of the process."""

    addresses: Mapping[str, int]
    _loops: dict[str, Any] = field(default_factory=dict)

    def loop(self, name: str) -> Callable[[int], int]:
        """A function that takes the address of a record; ctypes releases the GIL while it runs."""
        if name not in self._loops:
            self._loops[name] = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64)(self.addresses[name])
        found: Callable[[int], int] = self._loops[name]
        return found

    def call(self, name: str, record: ctypes.Structure, **arrays: NDArray[Any]) -> int:
        """Call a function that takes a record.

        Parameters
        ----------
        name : str
        record : ctypes.Structure
        **arrays
            Record fields that hold the addresses of arrays: contiguous, of 64-bit numbers.

        Returns
        -------
        int
            The function's return value.
        """
        for key, array in arrays.items():
            if not array.flags.c_contiguous or array.dtype.itemsize != 8:
                raise ValueError(f"{key} must be contiguous and of 64-bit numbers")
            setattr(record, key, array.ctypes.data)
        return self.loop(name)(ctypes.addressof(record))


@cache
def native_functions(*modules: str) -> NativeFunctions:
    """Compile modules as one unit, or load them from the cache.

    Parameters
    ----------
    *modules : str
        Dotted names. Functions of one may call those of another; those that return ``int32`` are exported.
    """

    def exported() -> bytes:
        """Names of the exported functions, and the object code."""
        names = [
            node.name for node, _ in functions(*texts_of(modules)) if ast.unparse(node.returns or ast.Constant(None)) == "int32"
        ]
        return " ".join(names).encode() + b"\n" + optimised(native_text(*modules))

    def loaded(content: bytes) -> tuple[dict[str, int], Any]:
        names, code = content.split(b"\n", 1)
        return linked(code, names.decode().split())

    with COMPILING:
        try:
            name = f"gearlib_model_{native_digest(*modules)[:24]}.o"
            addresses, library = loaded(cached_bytes(name, exported, "its solvers for this machine"))
        except RuntimeError:  # damage that the checksum did not reveal
            addresses, library = loaded(exported())
    _loaded.append(library)
    return NativeFunctions(addresses)


def native_digest(*modules: str) -> str:
    """Digest of everything that the code of some modules depends on."""
    loaded, texts, generated = texts_of(modules)
    values = [repr(sorted(values_of(vars(module)))) for module in loaded]  # includes what a module imports from others
    return hashlib.sha256("\0".join([compiler_digest(), *texts, *generated, *values]).encode()).hexdigest()


def native_text(*modules: str) -> str:
    """LLVM IR of modules as one unit, to be compiled for any platform."""
    from gearlib.compiler.translate import translated

    return translated(functions(*texts_of(modules)), fused=True)


def texts_of(modules: Sequence[str]) -> tuple[list[ModuleType], list[str], list[str]]:
    """Modules, their source, and the source that they generate."""
    loaded = [importlib.import_module(name) for name in modules]
    texts = [Path(str(module.__file__)).read_text(encoding="utf-8") for module in loaded]
    return loaded, texts, [str(getattr(module, "GENERATED", "")) for module in loaded]


def functions(
    loaded: Sequence[ModuleType], texts: Sequence[str], generated: Sequence[str]
) -> Iterator[tuple[ast.FunctionDef, Environment]]:
    """The functions of modules that are compiled, each with its global names."""
    for module, text, more in zip(loaded, texts, generated, strict=True):
        for node in ast.parse(text).body:
            if isinstance(node, ast.FunctionDef) and is_native(node):
                yield node, vars(module)
        yield from ((node, vars(module)) for node in ast.parse(more).body if isinstance(node, ast.FunctionDef))


def is_native(node: ast.FunctionDef) -> bool:
    return any(isinstance(d, ast.Name) and d.id == "native" for d in node.decorator_list)


def values_of(environment: Environment) -> Iterator[tuple[str, str]]:
    """Globals that code depends on besides its text: constants, tuples of these, records and prototypes."""
    for name, value in environment.items():
        numbers = value if isinstance(value, tuple) else (value,)
        if all(isinstance(number, (bool, int, float)) for number in numbers) or isinstance(value, Prototype):
            yield name, repr(value)
        elif is_record(value):
            yield name, repr(fields_of(value))
