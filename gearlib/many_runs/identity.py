"""Process-independent identity of a sweep: models, functions and numbers as bytes for a digest."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from types import BuiltinFunctionType, CellType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from gearlib.run.result import SimulatedResult
from gearlib.run.sampling.controllers import Controller
from gearlib.run.translation import Translation
from gearlib.solvers.inputs.table import FunctionInput, Table

ADDRESS = re.compile(" at 0x[0-9a-fA-F]+")
PLAIN = (int, float, complex, str, bytes, np.generic, type(None))  # whose text says everything
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
        own = {n: v for n, v in within.items() if _is_told(v, function.__module__)}
        yield from _of_code(code)
        yield from of_values(
            [function.__defaults__, function.__kwdefaults__, getattr(function, "__self__", None), *around, own], known
        )
        return
    yield f"{type(function).__module__}.{type(function).__qualname__} {getattr(function, '__qualname__', '')}".encode()
    if not isinstance(function, type):
        yield from of_values([_contents(function), type(function).__call__], known)


def _is_told(value: Any, module: str) -> bool:
    """Whether what a name of a module stands for is told: everything but classes, and functions from elsewhere."""
    if isinstance(value, FunctionType):
        return value.__module__ == module
    return not isinstance(value, (type, BuiltinFunctionType, np.ufunc))


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
    elif isinstance(translation := getattr(value, "translation", None), Translation):  # a system, or a run of it
        known[id(value)] = value
        yield from of_model(translation)
        if isinstance(value, SimulatedResult):
            yield from of_values([vars(value.request), value.time], known)
    elif isinstance(value, PLAIN):
        yield repr(value).encode()
    elif isinstance(value, ModuleType):
        yield value.__name__.encode()
    else:
        known[id(value)] = value
        yield from of_values(_contents(value), known)


def _contents(value: Any) -> list[Any]:
    """What an object is made of; its text may leave numbers out."""
    try:
        made = value.__reduce_ex__(2)
    except Exception:  # which cannot be pickled
        made = ADDRESS.sub("", repr(value)), getattr(value, "__dict__", None)
    return [made] if isinstance(made, str) else [[*part] if isinstance(part, Iterator) else part for part in made]
