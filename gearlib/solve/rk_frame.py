"""The Runge-Kutta loop's view of its record, see ``rk_layout``, and of memory at an address.

What is made here has no reference count, unlike what numba's ``carray`` gives.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import extending
from numba.np import arrayobj

from gearlib.solve.rk_layout import Frame

__all__ = ["doubles", "frame_at", "ints", "longs"]

_numba: Any = numba  # some of its versions declare types, and not those that its functions take
_types: Any = _numba.types
_arrays: Any = arrayobj
_intrinsic: Any = extending.intrinsic
_RECORD = _numba.from_dtype(np.dtype(Frame))


def _frame_at(typing_context: Any, address: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(_RECORD))

    return _RECORD(_types.int64), generate


def _array_of(element: Any, itemsize: int) -> Any:
    def array_at(typing_context: Any, address: Any, n: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array = context.make_array(signature.return_type)(context, builder)
            data = builder.inttoptr(arguments[0], context.get_data_type(element).as_pointer())
            stride = ir.Constant(ir.IntType(64), itemsize)
            _arrays.populate_array(array, data=data, shape=[arguments[1]], strides=[stride], itemsize=itemsize, meminfo=None)
            return array._getvalue()

        return _types.Array(element, 1, "C")(_types.int64, _types.int64), generate

    return _intrinsic(array_at)


frame_at: Any = _intrinsic(_frame_at)  # the record at an address
doubles: Any = _array_of(_types.float64, 8)  # ``doubles(address, n)`` and so on: the array there
longs: Any = _array_of(_types.int64, 8)
ints: Any = _array_of(_types.int32, 4)
