"""What stands for the small language in Python: the meaning of its functions for one number, records, and prototypes."""

from __future__ import annotations

import ctypes

import pytest

from gearlib.compiler.small_language import (
    Prototype,
    any_of,
    block,
    both,
    either,
    fields_of,
    floats_at,
    in_lanes,
    int32s_at,
    ints_at,
    is_record,
    lanes_at,
    native,
    one_by_one,
    record,
    total,
    where,
)


@pytest.mark.parametrize("a", [False, True])
@pytest.mark.parametrize("b", [False, True])
def test_a_single_lane(a: bool, b: bool) -> None:
    assert (both(a, b), either(a, b), any_of(a)) == (a and b, a or b, a)
    assert where(a, 1.0, 2.0) == (1.0 if a else 2.0)
    assert (block(2.5), total(2.5), in_lanes(2.5), one_by_one([1.0, 2.5], 1)) == (2.5, 2.5, 2.5, 2.5)


@pytest.mark.parametrize("function", [floats_at, ints_at, int32s_at, lanes_at])
def test_addresses_have_no_meaning_in_python(function: object) -> None:
    with pytest.raises(NotImplementedError, match=r"^64$"):
        function(64)  # type: ignore[operator]


def test_decorated_functions_and_records_are_themselves() -> None:
    def half(x: float) -> float:
        return x / 2

    assert native(half) is half

    @record
    class First(ctypes.Structure):
        n: int
        t: float

    @record
    class Second(First):
        more: int

    assert fields_of(Second) == [("n", ctypes.c_int64), ("t", ctypes.c_double), ("more", ctypes.c_int64)]
    assert fields_of(half) == []
    assert (is_record(Second), is_record(Second()), is_record(int), is_record(half)) == (True, False, False, False)
    assert ctypes.sizeof(Second) == 24


def test_a_prototype_calls_the_function_at_an_address() -> None:
    seen = []
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_int64, ctypes.c_int32)
    callback = kind(lambda x, n, i: seen.append((x, n, i)) or -3)  # type: ignore[func-returns-value]
    address = ctypes.cast(callback, ctypes.c_void_p).value
    assert address
    assert Prototype("int32", ("float", "int", "int32"))(address, 0.5, 2**40, -7) == -3
    assert seen == [(0.5, 2**40, -7)]
