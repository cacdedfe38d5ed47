"""Tables as inputs of native functions: compiled shells that look the tables up and then call the model.

The knots of the tables follow the model's numbers in ``data``. A block behind its integers, to which ``index[TABLES]`` points, holds
the addresses of the model's functions, and of each table the input's place, the place of its knots and their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from gearlib.codegen.native import TABLES, NativeScene
from gearlib.solve.feed import Wrapped
from gearlib.solve.ida_pointers import call, doubles, inline, longs
from gearlib.solve.kept import keep
from gearlib.solve.table import Table

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
FUNCTIONS = ("rhs", "jac", "roots", "update")
FAR = 1 << 40  # no length of the blocks is known here

_numba: Any = numba
_types = _numba.types
_decorate = _numba.cfunc(_types.int32(_types.float64, *(_types.int64,) * 4), cache=True)


@inline
def _look_up(t: float, data_: int, index_: int, kind: int) -> int:
    """Write the tables' values at a time into the inputs; returns the address of the model's function."""
    data, index = doubles(data_, FAR), longs(index_, FAR)
    block = index[TABLES]
    for j in range(index[block + 4]):
        place = block + 5 + 3 * j
        first, n = index[place + 1], index[place + 2]
        low, high = 0, n  # knots up to and at t
        while low < high:
            middle = (low + high) // 2
            if data[first + middle] <= t:
                low = middle + 1
            else:
                high = middle
        if low == 0 or low == n:
            value = data[first + n + max(low - 1, 0)]
        else:
            left, right = data[first + low - 1], data[first + low]
            before, after = data[first + n + low - 1], data[first + n + low]
            value = before + (t - left) / (right - left) * (after - before)
        data[index[place]] = value
    address: int = index[block + kind]
    return address


@inline
def _rhs(t: float, x: int, out: int, data: int, index: int) -> Any:
    return call(_look_up(t, data, index, 0), (t, x, out, data, index))


@inline
def _jac(t: float, x: int, out: int, data: int, index: int) -> Any:
    return call(_look_up(t, data, index, 1), (t, x, out, data, index))


@inline
def _roots(t: float, x: int, out: int, data: int, index: int) -> Any:
    return call(_look_up(t, data, index, 2), (t, x, out, data, index))


@inline
def _update(t: float, x: int, out: int, data: int, index: int) -> Any:
    return call(_look_up(t, data, index, 3), (t, x, out, data, index))


_shells = {name: keep(inner, _decorate) for name, inner in zip(FUNCTIONS, (_rhs, _jac, _roots, _update), strict=True)}


def fed(
    native: NativeScene, data: Floats, tables: Sequence[tuple[int, Table]]
) -> tuple[dict[str, Wrapped | None], Floats, Integers]:
    """The functions of a scene with tables as inputs, and the two blocks that they work on.

    Parameters
    ----------
    native : NativeScene
    data : array
        The scene's numbers.
    tables : sequence of (number of the input, Table)
    """
    functions = [getattr(native, name) for name in FUNCTIONS]
    block = [0 if f is None else f.address for f in functions] + [len(tables)]
    at = len(data)
    for k, table in tables:
        block += [native.shared.inputs + k, at, len(table.t)]
        at += 2 * len(table.t)
    index = np.concatenate([native.index, np.array(block, np.int64)])
    index[TABLES] = len(native.index)
    knots = [part for _, table in tables for part in (table.t, table.y)]
    shells = {
        name: None if f is None else Wrapped(int(_shells[name].address)) for name, f in zip(FUNCTIONS, functions, strict=True)
    }
    return shells, np.concatenate([data, *knots]), index
