"""The cache of machine code: damage, a folder that cannot be written, and writers at the same time cost time, never a result."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gearlib.compiler import cache, object_code

ROOT = Path(__file__).resolve().parents[2]
MODEL = "def f(t: float, x: floats) -> int32:\n    x[0] = {number} * t\n    return 0\n"
made: list[str] = []  # sources compiled to object code


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path))
    monkeypatch.setattr(cache, "_temporary", None)
    monkeypatch.setattr(cache, "ONE_IN", 1)
    make = object_code.object_code
    monkeypatch.setattr(object_code, "object_code", lambda source, fused=False: made.append(source) or make(source, fused))
    forget(monkeypatch)
    yield tmp_path
    forget(monkeypatch)
    if cache._temporary is not None:
        cache._temporary[1]()


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a new process would begin."""
    object_code.compiled.cache_clear()


def triple(number: int = 3) -> tuple[float, int]:
    """The result of a cached function for 2, and whether its machine code was found on disk."""
    made.clear()
    function, result = object_code.compiled(MODEL.format(number=number), "f"), ctypes.c_double()
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p)(function.address)
    assert call(2.0, ctypes.addressof(result)) == 0
    return result.value, int(not made)


def files(folder: Path, pattern: str) -> list[Path]:
    return sorted(folder.rglob(f"gearlib_model_*{pattern}"))


def test_second_process_finds_the_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    assert triple(3) == (6.0, 0)
    forget(monkeypatch)
    assert triple(3) == (6.0, 1)


@pytest.mark.parametrize("how", ["cut", "changed", "emptied", "swapped", "seal changed"])
def test_damage_costs_time_only(own_folder: Path, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    triple(3)
    triple(4)
    (file, other) = files(own_folder, ".o")
    good = file.read_bytes()
    half = len(good) // 2
    bad = {"cut": good[:half], "changed": good[:half] + bytes([good[half] ^ 1]) + good[half + 1 :], "emptied": b"",
           "swapped": other.read_bytes(), "seal changed": bytes([good[0] ^ 1]) + good[1:]}[how]  # fmt: skip
    times = file.stat().st_atime, file.stat().st_mtime
    file.write_bytes(bad)
    os.utime(file, times)
    forget(monkeypatch)
    assert (triple(3)[0], triple(4)[0]) == (6.0, 8.0)
    forget(monkeypatch)
    assert (triple(3), triple(4)) == ((6.0, 1), (8.0, 1))  # mended


def test_object_code_that_cannot_be_linked_is_made_anew(monkeypatch: pytest.MonkeyPatch, own_folder: Path) -> None:
    """Damage that the checksum did not see."""
    triple(3)
    (file,) = files(own_folder, ".o")
    code = b"no object code"
    file.write_bytes(cache.seal_of(file.name, code) + code)
    forget(monkeypatch)
    assert triple(3) == (6.0, 0)


def test_another_processor_or_compiler_has_its_own_object_code(monkeypatch: pytest.MonkeyPatch) -> None:
    triple(3)
    compiler = object_code.compiler_digest()
    monkeypatch.setattr(object_code, "compiler_digest", lambda: compiler + "x")
    forget(monkeypatch)
    assert triple(3) == (6.0, 0)
    for what in (object_code.HOST.machine.triple, *object_code.HOST.processor):
        assert what in compiler


def test_folder_that_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way", encoding="utf-8")
    monkeypatch.setenv("GEARLIB_CACHE", str(blocked))
    assert triple(3) == (6.0, 0)
    assert blocked.read_text(encoding="utf-8") == "in the way"


def test_folder_that_cannot_be_written(own_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replace = os.replace

    def full(source: str, target: str | Path) -> None:
        if Path(target).is_relative_to(own_folder):
            raise OSError(28, "No space left on device")
        replace(source, target)

    monkeypatch.setattr(cache.os, "replace", full)
    assert triple(3) == (6.0, 0)
    assert files(own_folder, "") == []


def test_writers_at_the_same_time(own_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = "from tests.compiler.test_cache import triple; print([triple(k)[0] for k in (3, 4, 5)])"
    path = os.pathsep.join([str(ROOT), str(ROOT / "library")])
    run = [subprocess.Popen([sys.executable, "-c", script], cwd=ROOT, env={**os.environ, "PYTHONPATH": path},
                            stdout=subprocess.PIPE, text=True) for _ in range(3)]  # fmt: skip
    assert {process.communicate()[0] for process in run} == {"[6.0, 8.0, 10.0]\n"}
    for _ in range(2):  # what one of them left undone is done at once
        found = [triple(k) for k in (3, 4, 5)]
        forget(monkeypatch)
    assert found == [(6.0, 1), (8.0, 1), (10.0, 1)]
    assert files(own_folder, ".tmp") == []


def test_size_is_bounded(own_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    triple(1)
    one = sum(file.stat().st_size for file in files(own_folder, ""))
    for number, file in enumerate(files(own_folder, "")):
        os.utime(file, (number, number))  # long ago
    monkeypatch.setattr(cache, "LARGEST", int(2.5 * one))
    for number in (2, 3, 4):
        triple(number)
        assert sum(file.stat().st_size for file in files(own_folder, "")) <= 2.5 * one
    forget(monkeypatch)
    assert triple(4) == (8.0, 1)
    assert triple(1) == (2.0, 0)


def test_its_limit_is_that_of_the_documentation() -> None:
    page = (ROOT / "docs" / "how_it_scales.md").read_text(encoding="utf-8")
    (said,) = re.findall(r"evicted when the total exceeds (\d+) MB", page)
    assert int(said) * 2**20 == cache.LARGEST


def test_nothing_else_is_ever_removed(own_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = own_folder / "mine.txt"
    kept.write_text("a" * 1000, encoding="utf-8")
    monkeypatch.setattr(cache, "LARGEST", 0)
    triple(1)
    triple(2)
    triple(3)
    assert kept.exists()


def test_versions_are_kept_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    first = cache.folder()
    assert first.name.endswith(f"py{sys.version_info.major}.{sys.version_info.minor}")
    monkeypatch.setattr(cache, "FORMAT", "next")
    second = cache.folder()
    monkeypatch.setattr(cache, "VERSION", "9.9")
    assert len({first, second, cache.folder()}) == 3


def test_folder_of_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GEARLIB_CACHE")
    asked: list[Any] = []
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *a, **k: asked.append((a, k)) or str(tmp_path / "user"))
    assert cache.folder().parent == tmp_path / "user"
    assert asked == [(("gearlib",), {"appauthor": False})], "no author's folder around it"
