"""Modules in the small language: the same numbers as Python's, records and callbacks by address, kept between processes."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearlib.compiler.native_module import native_functions
from gearlib.compiler.object_code import optimised
from gearlib.compiler.small_language import Prototype
from gearlib.compiler.translate import intermediate
from tests.compiler import sample_loops

NAME = "tests.compiler.sample_loops"


@pytest.fixture(autouse=True, scope="module")
def own_folder(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("native_module")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GEARLIB_CACHE", str(folder))
        native_functions.cache_clear()
        yield folder
        native_functions.cache_clear()


def call(name: str, *arguments: int) -> int:
    return Prototype("int32", ("int",) * len(arguments))(native_functions(NAME).addresses[name], *arguments)


@given(
    st.integers(1, 10_000), st.lists(st.integers(-50, 1000), min_size=1), st.integers(-99, 99), st.integers(-9, 9).filter(bool)
)
def test_whole_numbers_loops_and_tuples(first: int, rest: list[int], a: int, b: int) -> None:
    numbers = np.array([first, a, b, *rest])
    found = np.zeros(7, np.int64)
    assert call("whole_numbers", numbers.ctypes.data, len(numbers), found.ctypes.data) == 0
    plain = numbers.tolist()
    steps, largest, n = 0, 0, first
    while n != 1 and steps < sample_loops.LIMIT:
        n = n // 2 if n % 2 == 0 else 3 * n + 1
        steps, largest = steps + 1, max(largest, n)
    odd = 0
    for value in plain:
        if value % 2 and value < 0:
            break
        odd += value * (value % 2)
    negative = next((i for i, value in enumerate(plain) if value < 0), -1)
    assert found.tolist() == [steps, largest, odd, negative, a // b, a % b, abs(a)]


def test_records_and_callbacks() -> None:
    x = np.array([1.0, -5.0, 3.0])
    seen: list[float] = []
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_int64)
    callback = kind(lambda value, address: seen.append(value) or int(address == x.ctypes.data))  # type: ignore[func-returns-value]
    frame = sample_loops.Frame(n=3, x=x.ctypes.data, callback=ctypes.cast(callback, ctypes.c_void_p).value)
    assert call("use_frame", ctypes.addressof(frame)) == 21  # 1 of the callback, 10 * 2: 3 and 12 are not near
    assert (frame.sum, frame.t, seen) == (12.0, 3.0, [12.0])


@given(st.lists(st.floats(-3, 3), min_size=8, max_size=8), st.floats(-2, 2))
def test_blocks(values: list[float], t: float) -> None:
    x, y = np.array(values), np.zeros(16)
    y[8:] = x[::-1]
    frame = sample_loops.Frame(n=8, x=x.ctypes.data, y=y.ctypes.data, t=t)
    call("vectors", ctypes.addressof(frame))
    a = np.maximum(np.abs(x), x[::-1])
    expected = 0.25 * a + t * np.where(a > 1.0, a, 0.5) - x
    assert y[:8] == pytest.approx(expected, abs=1e-14)
    assert frame.sum == pytest.approx(expected @ expected, abs=1e-12)


def test_arrays_of_a_record_are_contiguous_and_of_64_bits() -> None:
    numbers = np.arange(16.0)
    for wrong in (numbers[::2], numbers.astype(np.float32)):
        with pytest.raises(ValueError, match="x must be contiguous and of 64-bit numbers"):
            native_functions(NAME).call("vectors", sample_loops.Frame(n=8), x=wrong, y=numbers)


def test_what_is_compiled_once_is_kept(own_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    native_functions(NAME)
    kept = {path.name for path in own_folder.rglob("gearlib_model_*")}
    assert len(kept) == 1
    native_functions.cache_clear()
    monkeypatch.setattr(sample_loops, "STEP", 0.5)  # a value that the code holds
    native_functions(NAME)
    assert {path.name for path in own_folder.rglob("gearlib_model_*")} > kept
    native_functions.cache_clear()


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("s.missing = 1", "no such field"),
        ("return 1", "`return 1`"),
        ("x = s.n // 2.0", "whole numbers"),
        ("f(s, s)", "takes 1 arguments"),
    ],
)
def test_refusals(body: str, message: str) -> None:
    with pytest.raises(Exception, match=message):
        intermediate(f"def f(s: Frame) -> None:\n    {body}\n", vars(sample_loops))


def test_loops_that_do_not_ask_for_vectors_are_compiled_as_they_stand() -> None:
    """Unrolled and vectorised copies of every loop took most of the time of the first process on a machine."""

    def size(loops: int) -> int:
        body = "    for i in range(n):\n        y[i] = x[i] - y[i]\n" * loops
        return len(optimised(intermediate(f"def f(n: int, x: floats, y: floats) -> int32:\n{body}    return 0")))

    assert size(9) - size(1) < 8 * 100  # bytes of machine code
