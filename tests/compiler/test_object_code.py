"""Object code of a source: compiled once for each way of rounding, by passes that are made anew now and then."""

from __future__ import annotations

import ctypes

import pytest

from gearlib.compiler import object_code


def test_source_is_compiled_once_for_each_way_of_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a digest of the compiler, the source and whether products are fused; what is long is told."""
    asked: list[tuple[str, str]] = []
    monkeypatch.setattr(object_code, "cached_bytes", lambda name, make, slow: asked.append((name, slow)) or make())
    source = "def f(t: float, x: floats) -> int32:\n    x[0] = 3 * t\n    return 4\n"
    make = object_code.compiled.__wrapped__
    for fused in (False, True, False):
        function = make(source, "f", fused)
        result = ctypes.c_double()
        assert (
            ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p)(function.address)(2.0, ctypes.addressof(result))
            == 4
        )
        assert result.value == 6.0
    assert asked[0] == asked[2] != asked[1]
    assert [slow for _, slow in asked] == [""] * 3
    for length, said in ((len(source), ""), (len(source) - 1, "a large model")):
        monkeypatch.setattr(object_code, "LONG", length)
        make(source, "f")
        assert asked[-1] == (asked[0][0], said)
    monkeypatch.setattr(object_code, "compiler_digest", lambda: "another")
    make(source, "f")
    assert asked[-1][0] != asked[0][0]


def test_passes_are_made_anew_after_so_many_uses() -> None:
    host = object_code.Host()
    first = host.passes
    assert all(host.passes is first for _ in range(object_code.USES - 1))
    second = host.passes
    assert second is not first
    assert host.passes is second
