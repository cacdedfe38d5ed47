"""Process-independent identity of a sweep: models, functions and numbers as bytes for a digest."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import CellType, CodeType, FunctionType
from typing import Any

import numpy as np

from gearlib.run.sampling.controllers import Controller
from gearlib.run.translation import Translation
from gearlib.solvers.inputs.table import FunctionInput, Table

ADDRESS = re.compile(" at 0x[0-9a-fA-F]+")
NAMED = (bool, int, float, complex, str, tuple, list, dict, np.ndarray, Table)  # what a function's name stands for that is told
UNASSIGNED = CellType()
Known = dict[int, Any]  # what has been told, so that what refers to itself has an end


def of_model(translation: Translation) -> Iterator[bytes]:
    """The equations, names and default values of a model, its requested outputs, and its sampled controllers."""
    yield repr((translation.name, translation.outputs, translation.states, translation.model.digest)).encode()
    for controller in translation.controllers:
        yield from of_values((controller.path, controller.reads))
        if isinstance(controller, Controller):
            yield from of_values((controller.part.function, controller.part.period, controller.part.offset))


def of_functions(functions: Mapping[str, Callable[..., Any]]) -> Iterator[bytes]:
    """Names and behaviour of some functions, as far as their own code determines it."""
    for name, function in functions.items():
        yield name.encode()
        yield from of_function(function)


def of_function(function: Any, known: Known | None = None) -> Iterator[bytes]:
    """Behaviour of a function: its code, its defaults, and what it finds by name in the functions around it and in its module."""
    while isinstance(inner := getattr(function, "__wrapped__", function), type(function)) and inner is not function:
        function = inner
    code, known = getattr(function, "__code__", None), {} if known is None else known
    if code is not None:
        around = (cell.cell_contents for cell in function.__closure__ or () if cell != UNASSIGNED)
        within = {name: function.__globals__[name] for name in sorted(_names(code) & function.__globals__.keys())}
        own = {n: v for n, v in within.items() if isinstance(v, NAMED) or _of_module(v, function.__module__)}
        yield from _of_code(code)
        yield from of_values(
            [function.__defaults__, function.__kwdefaults__, getattr(function, "__self__", None), *around, own], known
        )
        return
    yield f"{type(function).__module__}.{type(function).__qualname__} {getattr(function, '__qualname__', '')}".encode()
    if isinstance(function, partial):
        yield from of_values([function.func, function.args, function.keywords], known)
    elif not isinstance(function, type) and hasattr(function, "__dict__"):
        yield from of_values([vars(function), type(function).__call__], known)


def _of_module(value: Any, module: str) -> bool:
    return isinstance(value, FunctionType) and value.__module__ == module


def _names(code: CodeType) -> set[str]:
    return {*code.co_names, *(name for inner in code.co_consts if isinstance(inner, CodeType) for name in _names(inner))}


def _of_code(code: CodeType) -> Iterator[bytes]:
    yield code.co_code
    yield repr(code.co_names).encode()
    for constant in code.co_consts:
        yield from _of_code(constant) if isinstance(constant, CodeType) else of_values(constant)


def of_values(value: Any, known: Known | None = None) -> Iterator[bytes]:
    """Numbers, names, tables, functions and objects, single or nested."""
    known = {} if known is None else known
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        yield repr(value.shape).encode()
        yield np.asarray(value, float).tobytes()
    elif isinstance(value, (set, frozenset)):
        yield from sorted(b" ".join(of_values(one)) for one in value)
    elif isinstance(value, Table):
        yield repr((value.interpolation, value.outside)).encode()
        yield from of_values([value.t, value.y])
    elif id(value) in known:
        yield f"as before: {list(known).index(id(value))}".encode()
    elif isinstance(value, np.ndarray):
        yield from of_values(value.tolist(), known)
    elif isinstance(value, Mapping):
        known[id(value)] = value
        for name, one in value.items():
            yield repr(name).encode()
            yield from of_values(one, known)
    elif isinstance(value, (list, tuple)):
        known[id(value)] = value
        yield f"{len(value)}".encode()
        for one in value:
            yield from of_values(one, known)
    elif isinstance(value, FunctionInput):
        yield from of_function(value.function, known)
    elif callable(value):
        known[id(value)] = value
        yield from of_function(value, known)
    else:
        said = repr(value)
        yield ADDRESS.sub("", said).encode()
        if ADDRESS.search(said) and hasattr(value, "__dict__"):  # which says nothing of its contents
            known[id(value)] = value
            yield from of_values(vars(value), known)
