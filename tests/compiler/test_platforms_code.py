"""Object code for other machines: of their kind, with functions that are hidden outside, and kept by what it is made from."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from gearlib.compiler import platforms
from gearlib.compiler.platforms import PLATFORMS, Platform, object_code_for
from gearlib.compiler.translate import intermediate

SOURCE = """
def half(x: float) -> float:
    return x / 2

def f(t: float, x: floats) -> int32:
    x[0] = half(t) + tan(t)
    return 3
"""
HEADS = {
    "x86_64-linux": ("<4s14xH", (b"\x7fELF", 62)), "aarch64-linux": ("<4s14xH", (b"\x7fELF", 183)),
    "x86_64-windows": ("<H", (0x8664,)), "aarch64-windows": ("<H", (0xAA64,)),
    "x86_64-darwin": ("<II", (0xFEEDFACF, 0x01000007)), "aarch64-darwin": ("<II", (0xFEEDFACF, 0x0100000C)),
}  # fmt: skip


def test_every_platform_has_its_own_names_and_suffix() -> None:
    assert set(PLATFORMS) == set(HEADS)
    suffixes = {"linux": ".so", "windows": ".dll", "darwin": ".dylib"}
    for name, target in PLATFORMS.items():
        machine, system = name.split("-")
        assert (target.name, target.suffix) == (name, suffixes[system])
        assert target.triple.startswith(machine if name != "aarch64-darwin" else "arm64")
        assert target.zig.startswith(machine)
    for field in ("triple", "zig", "fmi2"):
        assert len({getattr(target, field) for target in PLATFORMS.values()}) == 6


@pytest.mark.parametrize("name", HEADS)
def test_code_is_of_the_kind_of_its_machine(name: str) -> None:
    layout, head = HEADS[name]
    code = platforms.compiled(PLATFORMS[name], intermediate(SOURCE))
    assert struct.unpack_from(layout, code) == head
    for symbol in (b"f", b"tan"):
        assert (b"_" * name.endswith("darwin") + symbol + b"\0") in code


def symbols(code: bytes) -> dict[str, tuple[int, int, int]]:
    """Of an ELF file of 64 bits: binding, visibility and section of each name."""
    (sections,), (size, count) = struct.unpack_from("<Q", code, 40), struct.unpack_from("<HH", code, 58)
    heads = [struct.unpack_from("<IIQQQQIIQQ", code, sections + k * size) for k in range(count)]
    found = {}
    for head in heads:
        if head[1] == 2:  # a table of symbols
            names = heads[head[6]][4]
            for at in range(head[4], head[4] + head[5], 24):
                name, info, other, section = struct.unpack_from("<IBBH", code, at)
                text = code[names + name : code.index(b"\0", names + name)].decode()
                found[text] = (info >> 4, other & 3, section)
    return found


ALONE = "def f(t: float, x: floats) -> int32:\n    x[0] = t / 2 + tan(t)\n    return 3\n"  # all of it is seen from outside


@pytest.mark.parametrize("source", [ALONE, SOURCE])
@pytest.mark.parametrize("name", ["x86_64-linux", "aarch64-linux"])
def test_functions_are_hidden_outside_and_what_they_call_is_not(name: str, source: str) -> None:
    found = symbols(platforms.compiled(PLATFORMS[name], intermediate(source)))
    assert found["f"][:2] == (1, 2)  # global, hidden
    assert found["f"][2] != 0
    assert found["tan"] == (1, 0, 0)  # global, visible, from elsewhere
    assert "half" not in found, "inlined, and nobody else's"


def test_code_is_kept_by_compiler_machine_and_what_it_is_made_from(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def cached(name: str, make: Any) -> bytes:
        asked.append(name)
        return bytes(make())

    made: list[str] = []

    def text() -> str:
        made.append(SOURCE)
        return intermediate(SOURCE)

    monkeypatch.setattr(platforms, "cached_bytes", cached)
    linux, windows = PLATFORMS["x86_64-linux"], PLATFORMS["x86_64-windows"]
    assert (
        object_code_for(linux, text, "a")
        == object_code_for(linux, text, "a")
        == platforms.compiled(linux, intermediate(SOURCE))
    )
    assert object_code_for(windows, text, "a")[:2] == b"\x64\x86"
    object_code_for(linux, text, "b")
    monkeypatch.setattr(platforms, "compiler_digest", lambda: "another")
    object_code_for(linux, text, "a")
    assert asked[0] == asked[1]
    assert len({*asked}) == 4
    assert all(name.startswith("gearlib_code_") and len(name) == len("gearlib_code_.o") + 24 for name in asked)
    assert len(made) == 5
    monkeypatch.setattr(platforms, "cached_bytes", lambda name, make: b"kept")
    assert object_code_for(linux, text, "a") == b"kept"
    assert len(made) == 5, "what is kept is not made again"


def test_a_machine_without_a_compiler_is_refused() -> None:
    with pytest.raises(RuntimeError, match="nomachine"):
        platforms.compiled(Platform("x", "nomachine-unknown-none", "", "", ""), intermediate(SOURCE))
