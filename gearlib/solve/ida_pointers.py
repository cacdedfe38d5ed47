"""Addresses in code that numba compiles: functions to call, and memory to see as arrays.

An address is a plain integer to numba, so that code which works on addresses is compiled once for all models.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from llvmlite import ir
from numba.extending import intrinsic

_numba: Any = numba  # some of its versions declare types, and not those that its functions take
carray, types = _numba.carray, _numba.types
_int, _long, _double = types.int32, types.int64, types.float64
_Function = TypeVar("_Function", bound=Callable[..., Any])


def inline(function: _Function) -> _Function:
    """Compile a function that compiled code calls."""
    return cast(_Function, _numba.njit(function))


def _call(typingctx: Any, address: Any, arguments: Any) -> Any:

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        count = len(signature.args[1].types)
        values = [builder.extract_value(args[1], i) for i in range(count)]
        function = ir.FunctionType(ir.IntType(32), [value.type for value in values])
        return builder.call(builder.inttoptr(args[0], function.as_pointer()), values)

    return _int(_long, arguments), codegen


def _call_for_address(typingctx: Any, address: Any, argument: Any) -> Any:

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        function = ir.FunctionType(ir.IntType(64), [ir.IntType(64)])
        return builder.call(builder.inttoptr(args[0], function.as_pointer()), [args[1]])

    return _long(_long, _long), codegen


def _cast(target: Any) -> Any:
    def cast_address(typingctx: Any, address: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return types.CPointer(target)(_long), codegen

    return intrinsic(cast_address)


call: Any = intrinsic(_call)  # the C function at an address, with a tuple of arguments; it returns an int32
call_for_address: Any = intrinsic(_call_for_address)  # the same with one address; it returns an address
_as_doubles, _as_longs, _as_ints = _cast(_double), _cast(_long), _cast(_int)


@inline
def doubles(address: int, n: int) -> Any:
    return carray(_as_doubles(address), n)


@inline
def longs(address: int, n: int) -> Any:
    return carray(_as_longs(address), n)


@inline
def ints(address: int, n: int) -> Any:
    return carray(_as_ints(address), n)
