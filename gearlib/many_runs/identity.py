"""Process-independent identity of a sweep: models, functions and numbers as bytes for a digest."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import CodeType
from typing import Any

import numpy as np

from gearlib.run.translation import Translation
from gearlib.solvers.inputs.table import FunctionInput, Table


def of_model(translation: Translation) -> Iterator[bytes]:
    """Equations, names and default values of a model, and its requested outputs."""
    model = translation.model
    yield repr((translation.name, translation.outputs, translation.states, model.parameters.names)).encode()
    yield model.parameters.defaults.tobytes()
    for group in model.groups:
        template = group.template
        yield repr((template.label, str(template.residual), [str(r.g) for r in template.relations])).encode()
        yield from (part.tobytes() for part in (group.variables, group.signs, group.parameters))


def of_functions(functions: Mapping[str, Callable[..., Any]]) -> Iterator[bytes]:
    """Names and behaviour of some functions, as far as their own code determines it."""
    for name, function in functions.items():
        yield name.encode()
        yield from of_function(function)


def of_function(function: Any) -> Iterator[bytes]:
    """Behaviour of a function, as far as its own code determines it."""
    while isinstance(inner := getattr(function, "__wrapped__", function), type(function)) and inner is not function:
        function = inner
    code = getattr(function, "__code__", None)
    if code is None:
        yield f"{type(function).__module__}.{type(function).__qualname__} {getattr(function, '__qualname__', '')}".encode()
        return
    yield from _of_code(code)
    for cell in getattr(function, "__closure__", None) or ():
        if isinstance(cell.cell_contents, (int, float, str, tuple)):
            yield repr(cell.cell_contents).encode()


def _of_code(code: CodeType) -> Iterator[bytes]:
    yield code.co_code
    yield repr(code.co_names).encode()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _of_code(constant)
        else:
            yield repr(constant).encode()


def of_values(value: Any) -> Iterator[bytes]:
    """Numbers, names, tables and functions, single or nested."""
    if isinstance(value, np.ndarray):
        yield repr(value.shape).encode()
        yield np.asarray(value, float).tobytes()
    elif isinstance(value, Mapping):
        for name, one in value.items():
            yield repr(name).encode()
            yield from of_values(one)
    elif isinstance(value, (list, tuple)):
        yield f"{len(value)}".encode()
        for one in value:
            yield from of_values(one)
    elif isinstance(value, Table):
        yield repr((value.interpolation, value.outside)).encode()
        yield from of_values([value.t, value.y])
    elif isinstance(value, FunctionInput):
        yield from of_function(value.function)
    elif callable(value):
        yield from of_function(value)
    else:
        yield repr(value).encode()
