"""A module in the small language that uses all of it that generated functions do not."""

from __future__ import annotations

import ctypes
import math

from gearlib.compiler.small_language import (
    Prototype,
    block,
    blocks,
    floats_at,
    int32,
    ints,
    ints_at,
    native,
    one_by_one,
    total,
    where,
)

LIMIT, STEP = 1000, 0.25
CALLED = Prototype("int32", ("float", "int"))
GENERATED = "def doubled(x: float) -> float:\n    return 2.0 * x\n"


class Frame(ctypes.Structure):
    _fields_ = [("n", ctypes.c_int64), ("x", ctypes.c_int64), ("y", ctypes.c_int64), ("callback", ctypes.c_int64),
                ("t", ctypes.c_double), ("sum", ctypes.c_double)]  # fmt: skip


@native
def collatz(n: int) -> tuple[int, int]:
    steps = largest = 0
    while n != 1 and steps < LIMIT:
        n = n // 2 if n % 2 == 0 else 3 * n + 1
        largest = max(largest, n)
        steps += 1
    return steps, largest


@native
def odd_sum(x: ints, n: int) -> int:
    total = 0
    for i in range(n):
        if x[i] % 2 == 0:
            continue
        if x[i] < 0:
            break
        total += x[i]
    return total


@native
def first_negative(x: ints, n: int) -> int:
    i = 0
    while True:
        if i == n:
            return -1
        if x[i] < 0:
            break
        i += 1
    return i


@native
def note(s: Frame, value: float) -> None:
    if value < 0.0:
        return
    s.sum += value
    s.t = math.sqrt(value)


@native
def is_near(a: float, b: float) -> bool:
    return abs(a - b) <= STEP


@native
def whole_numbers(x: int, n: int, out: int) -> int32:
    numbers, result = ints_at(x), ints_at(out)
    result[0], result[1] = collatz(numbers[0])
    result[2] = odd_sum(numbers, n)
    result[3] = first_negative(numbers, n)
    result[4] = numbers[1] // numbers[2]
    result[5] = numbers[1] % numbers[2]
    result[6] = abs(numbers[1])
    return 0


@native
def use_frame(address: int) -> int32:
    s = Frame(address)
    x = floats_at(s.x)
    for i in range(s.n):
        note(s, doubled(x[i]) + x[i])  # noqa: F821
    near = int(is_near(s.t, s.sum)) + 2 * int(math.nextafter(1.0, math.inf) > 1.0)
    return CALLED(s.callback, s.sum, s.x) + 10 * near


@native
def vectors(address: int) -> int32:
    s = Frame(address)
    x, y, size = floats_at(s.x), floats_at(s.y), s.n
    sums = block(0.0)
    for k in blocks(size):
        a = max(abs(x[k]), y[k + size])
        b = where(a > 1.0, a, 0.5)
        y[k] = STEP * a + s.t * b - one_by_one(x, k)
        sums += y[k] * y[k]
    s.sum = total(sums)
    return 0
