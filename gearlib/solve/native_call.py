"""What the compiled integration loops are made of: calls of a model's native functions, and the options of inner functions.

An address is a plain integer to numba, so that a loop that calls the functions of a model is compiled once for all models.
(numba's first-class functions do the same, but take 5 us each to pass and 1 ns more to call.)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from llvmlite import ir
from numba import extending, types

__all__ = ["call_native", "inner"]

_Function = TypeVar("_Function", bound=Callable[..., Any])


def inner(**options: Any) -> Callable[[_Function], _Function]:
    """Decorate a function that only a compiled loop calls.

    Such functions get arrays from the loop and allocate none: without reference counts (``_nrt=False``) a step of a model with
    four states takes 75 ns instead of 120.
    """
    njit: Any = numba.njit
    decorate: Callable[[_Function], _Function] = njit(
        error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False, **options
    )
    return decorate


def _call_native(typing_context: Any, address: Any, t: Any, x: Any, out: Any, data: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        native = ir.FunctionType(ir.IntType(32), [ir.DoubleType(), pointer, pointer, pointer, pointer])
        function = builder.inttoptr(arguments[0], native.as_pointer())
        pointers = [builder.inttoptr(a, pointer) for a in arguments[2:]]
        return builder.call(function, [arguments[1], *pointers])

    return types.int32(types.intp, types.float64, *(types.intp,) * 4), generate


_intrinsic: Any = extending.intrinsic
# ``call_native(address, t, x, out, data, index)`` calls ``int32 f(double t, void *x, void *out, void *data, void *index)``, all
# addresses being integers. The caller keeps the arrays alive. Such a call may change any array, and LLVM assumes so.
call_native: Any = _intrinsic(_call_native)
