"""Call a native function by its address from code that numba compiles.

An address is a plain integer to numba, so that a loop that calls the functions of a model is compiled once for all models.
(numba's first-class functions do the same, but take 5 us to pass and 1 ns more to call.)
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

__all__ = ["call_native"]


@intrinsic  # type: ignore[untyped-decorator]
def call_native(typing_context: Any, address: Any, t: Any, x: Any, out: Any, data: Any, index: Any) -> Any:
    """Call ``int32 f(double t, void *x, void *out, void *data, void *index)``; addresses and pointers are integers.

    The caller keeps the arrays alive. A call by an unknown address may change any array that the caller was given, and LLVM
    assumes so: functions that call this one must not be compiled with ``noalias``.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        native = ir.FunctionType(ir.IntType(32), [ir.DoubleType(), pointer, pointer, pointer, pointer])
        function = builder.inttoptr(arguments[0], native.as_pointer())
        pointers = [builder.inttoptr(a, pointer) for a in arguments[2:]]
        return builder.call(function, [arguments[1], *pointers])

    return types.int32(types.intp, types.float64, *(types.intp,) * 4), generate
