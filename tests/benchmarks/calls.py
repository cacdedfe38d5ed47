"""A native function called many times: what one call takes, without the cost of calls from Python."""

from __future__ import annotations

import ctypes
import time
from typing import Any

from gearlib.compiler.native_module import native_functions
from gearlib.compiler.small_language import int32, native, record
from gearlib.native.layout import MODEL


@record
class Calls(ctypes.Structure):
    """Calls of a model's function with the same arguments."""

    function: int
    count: int
    t: float
    x: int
    dx: int
    data: int
    index: int
    failed: int


@native
def call_often(address: int) -> int32:
    """Call the function; sums of what it returns are kept, so that no call is left out."""
    s = Calls(address)
    for _ in range(s.count):
        s.failed += MODEL(s.function, s.t, s.x, s.dx, s.data, s.index)
    return 0


def nanoseconds(function: int, t: float, repeat: int = 60, count: int = 2000, **arrays: Any) -> float:
    """Time of a call, the least of some repetitions; ``arrays``: x, dx, data, index."""
    record, times = Calls(function=function, count=count, t=t), []
    for _ in range(repeat):
        begin = time.perf_counter()
        native_functions(__name__).call("call_often", record, **arrays)
        times.append(time.perf_counter() - begin)
    return 1e9 * min(times) / count
