"""Built-ins of the small language as Python stand-ins, so that its modules can be imported, type-checked and read."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Record = TypeVar("_Record", bound=type[ctypes.Structure])

Environment = Mapping[str, object]  # values of names that are neither local nor functions of the language

# Types: arrays of 64-bit floats, 64-bit and 32-bit integers; a 32-bit integer.
floats = list[float]
ints = list[int]
int32s = list[int]
int32 = int
lane = float  # a number of each of several runs side by side
lanes = list[float]

BLOCK = 4  # elements of a block: arrays whose length is a multiple of it are processed in blocks, without a remainder loop

parallel = range  # a loop with independent iterations
blocks = range  # a loop that processes several elements per iteration
generated: Any = None  # placeholder for a function whose source the module generates


def floats_at(address: int) -> floats:
    """The float array at an address."""
    raise NotImplementedError(address)


def ints_at(address: int) -> ints:
    """The array of 64-bit integers at an address."""
    raise NotImplementedError(address)


def int32s_at(address: int) -> int32s:
    """The array of 32-bit integers at an address."""
    raise NotImplementedError(address)


def lanes_at(address: int) -> lanes:
    """The array of lanes at an address."""
    raise NotImplementedError(address)


def any_of(condition: bool) -> bool:
    """Whether a condition holds in any lane."""
    return condition


def both(*conditions: bool) -> bool:
    """Whether all conditions hold, lane by lane."""
    return all(conditions)


def either(*conditions: bool) -> bool:
    """Whether any condition holds, lane by lane."""
    return any(conditions)


def in_lanes(number: float) -> float:
    """The same number in all lanes."""
    return number


def block(number: float) -> float:
    """A SIMD vector with all elements equal."""
    return number


def total(vector: float) -> float:
    """Horizontal sum of a vector."""
    return vector


def where(condition: bool, first: float, second: float) -> float:
    """Elementwise select: the first operand where the condition holds, else the second."""
    return first if condition else second


def one_by_one(array: floats, place: int) -> float:
    """Load a vector whose elements were just stored one by one; a single load would stall on store forwarding."""
    return array[place]


def native(function: _Function) -> _Function:
    """Decorator of functions in the small language; Python calls them through `native_functions` only."""
    return function


def record(cls: _Record) -> _Record:
    """Class decorator: a ctypes structure whose annotated fields are ``int`` (64 bits, also addresses) or ``float``.

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


def is_record(value: object) -> bool:
    """Whether a name of the environment stands for a record."""
    return isinstance(value, type) and issubclass(value, ctypes.Structure)


def fields_of(record: object) -> list[tuple[str, object]]:
    """Names and types of a record's fields, inherited ones first."""
    bases = reversed(record.__mro__) if isinstance(record, type) else ()
    return [field for base in bases for field in vars(base).get("_fields_", ())]


@dataclass(frozen=True)
class Prototype:
    """A C function called through its address: ``prototype(address, *arguments)``.

    Attributes
    ----------
    result : str
        ``int32`` or ``int``.
    arguments : tuple of str
        ``float``, ``int`` (also for pointers) or ``int32``.
    """

    result: str
    arguments: tuple[str, ...]

    def __call__(self, address: int, *arguments: float) -> int:
        kinds: dict[str, Any] = {"float": ctypes.c_double, "int": ctypes.c_int64, "int32": ctypes.c_int32}
        return int(ctypes.CFUNCTYPE(kinds[self.result], *(kinds[a] for a in self.arguments))(address)(*arguments))
