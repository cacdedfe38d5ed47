"""Numbers, names and mappings that a user gives, checked.

Each function returns what was given in one form, or raises an error that says what it is called, what was found and what was
expected.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError, NameLookupError

Floats = NDArray[np.float64]
LONG = 100  # characters of a value in an error message


def shown(value: Any) -> str:
    """A value in an error message, cut short where it is long."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # the object's own fault; and Python writes no number of more than 4300 digits
        return "a number of very many digits" if isinstance(value, int) else f"a {type(value).__name__} that cannot be printed"
    return text if len(text) <= LONG else f"{text[: LONG - 20]} ..."


def finite(said: Callable[[], str], value: Any) -> float:
    """The value as a float, or an `ArgumentError` that begins with what is ``said`` of it, where it is no finite number.

    >>> finite(lambda: "the function returned", 2)
    2.0
    """
    try:
        number = float(value)
    except OverflowError:
        raise ArgumentError(f"{said()} {shown(value)}; expected a number of ordinary size") from None
    except Exception:  # whatever an object of the user's makes of float()
        raise ArgumentError(f"{said()} {shown(value)}; expected a number") from None
    if not math.isfinite(number):
        raise ArgumentError(f"{said()} {number}; expected a finite number")
    return number


def real(name: str, value: Any, expected: str = "a finite number") -> float:
    """The value as a float, or an `ArgumentError` where it is no finite real number.

    >>> real("gain", 2)
    2.0
    """
    try:
        if isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool) and math.isfinite(value):
            return float(value)
    except OverflowError:  # a whole number too large for a float
        pass
    raise ArgumentError(f"{name} is {shown(value)}; expected {expected}")


def reals(name: str, values: Any, expected: str) -> Floats:
    """The values as an array, or an `ArgumentError` where they are no finite real numbers.

    >>> reals("omega", [1, 10], "a sequence of numbers")
    array([ 1., 10.])
    """
    try:
        found = np.asarray(values)
        result = found.astype(float) if found.dtype.kind in "iufO" else np.array(np.nan)
    except Exception:  # whatever an object of the user's makes of being an array
        result = np.array(np.nan)
    if not np.isfinite(result).all():
        raise ArgumentError(f"{name} is {shown(values)}; expected {expected}")
    return result


def increasing(name: str, values: Any, least: int, unit: str = "") -> Floats:
    """The values as an array, or an `ArgumentError` where they do not increase, or are fewer than ``least``.

    >>> increasing("gains", (0, 1), 1)
    array([0., 1.])
    """
    expected = f"an increasing sequence of {'finite numbers' if least < 2 else 'two or more finite numbers'}{unit}"
    result = reals(name, values, expected)
    if result.ndim != 1 or len(result) < least or (np.diff(result) <= 0).any():
        raise ArgumentError(f"{name} is {shown(values)}; expected {expected}")
    return result


def one_name(what: str, value: Any, example: str) -> str:
    """The name, or an `ArgumentError` where it is no text."""
    if not isinstance(value, str):
        raise ArgumentError(f"{what} is {shown(value)}; expected a name, such as '{example}'")
    return value


def name_list(what: str, values: Any, example: str) -> list[str]:
    """The names as a list, or an `ArgumentError` where they are no list of names.

    >>> name_list("held", ("unit.ring",), "unit.carrier")
    ['unit.ring']
    """
    if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
        suggested = [values] if isinstance(values, str) else [example]
        raise ArgumentError(f"{what} is {shown(values)}; expected a list of names, such as {suggested}")
    found = list(values)
    for name in found:
        if not isinstance(name, str):
            raise NameLookupError(f"{shown(name)} is no name; names are text, such as '{example}' (in {what})")
    return found


def by_name(what: str, values: Any, expected: str) -> dict[str, Any]:
    """The values by name, empty where there are none, or an `ArgumentError` where they are no mapping.

    >>> by_name("torques", None, "a mapping of paths to numbers")
    {}
    """
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise ArgumentError(f"{what} is {shown(values)}; expected {expected}")
    for name in values:
        if not isinstance(name, str):
            raise NameLookupError(f"{shown(name)} is no name; names are text, such as 'load.w' (in {what})")
    return dict(values)
