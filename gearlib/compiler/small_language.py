"""Names of the small language that Python does not have, so that its modules can be imported, checked and read as Python."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Record = TypeVar("_Record", bound=type[ctypes.Structure])

# Kinds: arrays of numbers of 64, 64 and 32 bits; a whole number of 32 bits.
floats = list[float]
ints = list[int]
int32s = list[int]
int32 = int

parallel = range  # a loop whose iterations do not depend on each other
blocks = range  # a loop over several elements at a time
generated: Any = None  # stands for a function whose text the module generates


def floats_at(address: int) -> floats:
    """The array at an address."""
    raise NotImplementedError(address)


def ints_at(address: int) -> ints:
    """The array at an address."""
    raise NotImplementedError(address)


def int32s_at(address: int) -> int32s:
    """The array at an address."""
    raise NotImplementedError(address)


def block(number: float) -> float:
    """A vector of equal numbers."""
    return number


def total(vector: float) -> float:
    """The sum of a vector's elements."""
    return vector


def where(condition: bool, first: float, second: float) -> float:
    """Elements of the first where the condition holds, else of the second."""
    return first if condition else second


def one_by_one(array: floats, place: int) -> float:
    """A vector whose elements were just written one by one; loaded in one piece it would be waited for."""
    return array[place]


def native(function: _Function) -> _Function:
    """Mark a function as written in the small language. Python calls it only through `native_functions`."""
    return function


def record(cls: _Record) -> _Record:
    """Make a record of a class whose annotations are its fields, ``int`` (also for addresses) or ``float``.

    Examples
    --------
    >>> @record
    ... class Clock(ctypes.Structure):
    ...     ticks: int
    ...     t: float
    >>> Clock(ticks=3).ticks, ctypes.sizeof(Clock)
    (3, 16)
    """
    kinds: dict[str, Any] = {"int": ctypes.c_int64, "float": ctypes.c_double}
    cls._fields_ = [(name, kinds[kind]) for name, kind in cls.__annotations__.items()]
    return cls
