"""Validation of users' arguments: numbers, sequences, names and mappings.

Each function returns its argument in a canonical form, or raises an error that gives the argument's name, what was found and what was
expected.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError, NameLookupError
from gearlib.optional import optional

Floats = NDArray[np.float64]
LONG = 100  # characters of a value quoted in an error message
ONE_THREAD = 10_000  # numbers; OpenBLAS multiplies longer vectors in several threads


def shown(value: Any) -> str:
    """A value for an error message, truncated if it is long."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # a failing repr(); or an integer of more than 4300 digits, which Python refuses to print
        return "a number of very many digits" if isinstance(value, int) else f"a {type(value).__name__} that cannot be printed"
    return text if len(text) <= LONG else f"{text[: LONG - 20]} ..."


def finite(said: Callable[[], str], value: Any) -> float:
    """The value as a float; `ArgumentError` if it is not a finite number, with a message that begins with ``said()``.

    >>> finite(lambda: "the function returned", 2)
    2.0
    """
    try:
        number = float(value)
    except OverflowError:
        raise ArgumentError(f"{said()} {shown(value)}; expected a number of ordinary size") from None
    except Exception:  # a user's object may have a failing float()
        raise ArgumentError(f"{said()} {shown(value)}; expected a number") from None
    if not math.isfinite(number):
        raise ArgumentError(f"{said()} {number}; expected a finite number")
    return number


def all_finite(x: Floats) -> bool:
    """Whether all numbers of an array are finite.

    >>> all_finite(np.array([1e200, -1e200])), all_finite(np.array([1.0, np.nan]))
    (True, False)
    """
    # a product takes half the time, but waking the threads for a long one takes milliseconds where the other cores are busy
    return (x.size < ONE_THREAD and math.isfinite(np.vdot(x, x))) or bool(np.isfinite(x).all())


def real(name: str, value: Any, expected: str = "a finite number") -> float:
    """The value as a float; `ArgumentError` if it is not a finite real number.

    >>> real("gain", 2)
    2.0
    """
    if not is_real(value):
        raise ArgumentError(f"{name} is {shown(value)}; expected {expected}")
    return float(value)


def is_real(value: Any) -> bool:
    """Whether a value is a finite real number representable as a float; Booleans, strings and durations are not.

    >>> [is_real(value) for value in (1, 2.5, float("inf"), True, "3", None, 10**400)]
    [True, True, False, False, False, False, False]
    """
    if type(value) is float:  # most of them are, and the test against abstract classes takes long
        return math.isfinite(value)
    if isinstance(value, (bool, np.timedelta64)) or not isinstance(value, (Real, np.integer, np.floating)):
        return False
    try:
        return math.isfinite(value)
    except Exception:  # an integer too large for a float; a user's object
        return False


def whole(name: str, value: Any, least: int, expected: str = "") -> int:
    """The value as an int; `ArgumentError` if it is not an integer of at least ``least``.

    >>> whole("frames", 24, 2)
    24
    """
    if not is_real(value) or not isinstance(value, (int, np.integer)) or value < least:
        raise ArgumentError(f"{name} is {shown(value)}; expected {expected or f'a whole number, {least} or more'}")
    return int(value)


def flag(name: str, value: Any) -> bool:
    """The value as a bool; `ArgumentError` if it is neither True nor False.

    >>> flag("sparse", True)
    True
    """
    if isinstance(value, (bool, np.bool_)) or (type(value) is int and value in (0, 1)):
        return bool(value)
    raise ArgumentError(f"{name} is {shown(value)}; expected True or False")


def reals(name: str, values: Any, expected: str) -> Floats:
    """The values as an array; `ArgumentError` if they are not finite real numbers.

    >>> reals("omega", [1, 10], "a sequence of numbers")
    array([ 1., 10.])
    """
    try:
        found = _unmasked(values)
        whole_or_real = found.dtype.kind in "iuf" or (found.dtype.kind == "O" and all(map(is_real, found.ravel().tolist())))
        with np.errstate(over="ignore"):  # of extended-precision numbers
            result = found.astype(float) if whole_or_real else np.array(np.nan)
    except Exception:  # a user's object may fail to convert to an array
        result = np.array(np.nan)
    if not np.isfinite(result).all():
        raise ArgumentError(f"{name} is {shown(values)}; expected {expected}")
    return result


def complexes(name: str, values: Any, expected: str) -> NDArray[np.complex128]:
    """The values as a complex array; `ArgumentError` if they are not finite numbers, real or complex.

    >>> complexes("values", [1, 0.5j], "a sequence of complex numbers")
    array([1.+0.j , 0.+0.5j])
    """
    try:
        found = _unmasked(values)
        numbers = found.ravel().tolist() if found.dtype.kind in "iufcO" else [np.nan]
        pairs = [(z.real, z.imag) if isinstance(z, (complex, np.complexfloating)) else (z, 0.0) for z in numbers]
        valid = all(is_real(a) and is_real(b) for a, b in pairs)
    except Exception:  # a user's object may fail to convert to an array
        valid = False
    if not valid:
        raise ArgumentError(f"{name} is {shown(values)}; expected {expected}")
    return np.array([complex(float(a), float(b)) for a, b in pairs], complex).reshape(found.shape)


def _unmasked(values: Any) -> NDArray[Any]:
    """The values as an array, if none of them is masked: an ordinary array would show what is behind the mask."""
    if np.ma.is_masked(values):
        raise ValueError("values are masked")
    return np.asarray(values)


def increasing(name: str, values: Any, least: int, unit: str = "") -> Floats:
    """The values as an array; `ArgumentError` if they do not increase, or are fewer than ``least``.

    >>> increasing("gains", (0, 1), 1)
    array([0., 1.])
    """
    expected = f"an increasing sequence of {'finite numbers' if least < 2 else 'two or more finite numbers'}{unit}"
    result = reals(name, values, expected)
    if result.ndim != 1 or len(result) < least or (np.diff(result) <= 0).any():
        raise ArgumentError(f"{name} is {shown(values)}; expected {expected}")
    return result


def one_name(what: str, value: Any, example: str) -> str:
    """The name; `ArgumentError` if it is not a string."""
    if not isinstance(value, str):
        raise ArgumentError(f"{what} is {shown(value)}; expected a name, such as '{example}'")
    return value


def one_of(what: str, value: Any, valid: Sequence[str]) -> str:
    """The name; `ArgumentError` if it is not among the valid ones.

    >>> one_of("side", "left", ("left", "right"))
    'left'
    """
    if not isinstance(value, str) or value not in valid:
        raise ArgumentError(f"{what} is {shown(value)}; expected {', '.join(map(repr, valid))}")
    return value


def as_path(what: str, path: Any, example: str = "r.mat") -> Path:
    """The path; `ArgumentError` if it is not one.

    >>> as_path("path", "run/r.mat").suffix
    '.mat'
    """
    try:
        text = os.fspath(path)
        valid = isinstance(text, str) and text != "" and b"\0" not in os.fsencode(text)
    except Exception:  # no path; or characters that no name of a file can have
        valid = False
    if not valid:
        raise ArgumentError(f"{what} is {shown(path)}; expected the path of a file, such as {example!r}")
    return Path(path)


def name_list(what: str, values: Any, example: str) -> list[str]:
    """The names as a list; `ArgumentError` if they are not a list of names.

    >>> name_list("held", ("unit.ring",), "unit.carrier")
    ['unit.ring']
    """
    if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
        suggested = [values] if isinstance(values, str) else [example]
        raise ArgumentError(f"{what} is {shown(values)}; expected a list of names, such as {suggested}")
    try:
        found = list(values)
    except Exception:  # a user's iterable may fail
        raise ArgumentError(f"{what} is {shown(values)}; expected a list of names, such as {[example]}") from None
    for name in found:
        if not isinstance(name, str):
            raise NameLookupError(f"{shown(name)} is not a name; names are strings, such as '{example}' (in {what})")
    return found


def by_name(what: str, values: Any, expected: str, example: str = "load.w") -> dict[str, Any]:
    """The values by name (empty if None); `ArgumentError` if they are not a mapping.

    >>> by_name("torques", None, "a mapping of paths to numbers")
    {}
    """
    if values is None:
        return {}
    try:
        found = dict(values) if isinstance(values, Mapping) else None
    except Exception:  # a user's mapping may fail
        found = None
    if found is None:
        raise ArgumentError(f"{what} is {shown(values)}; expected {expected}")
    for name in found:
        if not isinstance(name, str):
            raise NameLookupError(f"{shown(name)} is not a name; names are strings, such as '{example}' (in {what})")
    return found


def check_axes(axes: Any, count: int, name: str = "axes") -> None:
    """Raise `ArgumentError` unless ``axes`` are that many matplotlib Axes."""
    Axes = optional("matplotlib.axes").Axes

    try:
        given = list(axes) if isinstance(axes, (Sequence, np.ndarray)) and count > 1 else [axes]
    except Exception:  # a user's sequence may fail
        given = []
    if len(given) != count or not all(isinstance(one, Axes) for one in given):
        expected = "matplotlib Axes" if count == 1 else f"{count} matplotlib Axes, such as those of plt.subplots({count})"
        raise ArgumentError(f"{name} is {shown(axes)}; expected {expected}")
