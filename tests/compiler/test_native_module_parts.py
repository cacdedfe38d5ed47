"""Modules of the small language part by part: which functions are taken, what their digest depends on, how they are called."""

from __future__ import annotations

import ast
import ctypes
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.compiler import native_module
from gearlib.compiler.native_module import NativeFunctions, native_digest, native_text
from gearlib.compiler.small_language import Prototype, record
from tests.compiler import sample_loops

NAME = "tests.compiler.sample_loops"


@record
class Pair(ctypes.Structure):
    n: int
    x: float


def test_functions_that_are_marked_and_those_that_a_module_generates() -> None:
    texts = [
        "@native\ndef one(x: float) -> float:\n    return x\n\ndef two(): pass\n@other\n@native\ndef three(): pass\nx = 1",
        "y = 2",
    ]
    generated = ["", "def four(): pass\nz = 3\ndef five(): pass"]
    modules: list[Any] = [SimpleNamespace(name="first"), SimpleNamespace(name="second")]
    found = [(node.name, environment["name"]) for node, environment in native_module.functions(modules, texts, generated)]
    assert found == [("one", "first"), ("three", "first"), ("four", "second"), ("five", "second")]
    for text, native in (("@native\ndef f(): pass", True), ("def f(): pass", False), ("@a.native\ndef f(): pass", False),
                         ("@native()\ndef f(): pass", False), ("@other\ndef f(): pass", False)):  # fmt: skip
        (node,) = ast.parse(text).body
        assert isinstance(node, ast.FunctionDef)
        assert native_module.is_native(node) == native, text


def test_numbers_records_and_prototypes_are_what_code_depends_on() -> None:
    prototype = Prototype("int32", ("float",))
    environment = {
        "a": 1, "b": 2.5, "c": True, "d": "text", "e": prototype, "f": Pair, "g": Pair(), "h": (1, 2.5), "i": len, "j": (1, "text"),
        "k": [1, 2],
    }  # fmt: skip
    assert dict(native_module.values_of(environment)) == {
        "a": "1", "b": "2.5", "c": "True", "e": repr(prototype), "f": repr([("n", ctypes.c_int64), ("x", ctypes.c_double)]),
        "h": "(1, 2.5)",
    }  # fmt: skip


def test_texts_of_a_module_and_what_it_generates() -> None:
    loaded, texts, generated = native_module.texts_of([NAME, "gearlib.compiler.small_language"])
    assert [module.__name__ for module in loaded] == [NAME, "gearlib.compiler.small_language"]
    assert texts[0] == Path(str(sample_loops.__file__)).read_text(encoding="utf-8")
    assert generated == [sample_loops.GENERATED, ""]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("STEP", 0.5),
        ("LIMIT", 1001),
        ("SHARES", (0.5, 2.5)),
        ("GENERATED", "def doubled(x: float) -> float:\n    return x + x\n"),
    ],
)
def test_a_digest_depends_on_values_texts_and_the_compiler(name: str, value: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample_loops, "SHARES", (0.5, 1.5), raising=False)  # as if it came from another module
    before = native_digest(NAME)
    assert before == native_digest(NAME)
    assert len(before) == 64
    assert native_digest(NAME, NAME) != before
    monkeypatch.setattr(sample_loops, name, value)
    changed = native_digest(NAME)
    assert changed != before
    monkeypatch.setattr(native_module, "compiler_digest", lambda: "another compiler")
    assert native_digest(NAME) not in (before, changed)


def test_functions_are_exported_where_they_return_a_code_and_products_may_be_fused() -> None:
    text = native_text(NAME)
    exported = [line.split("@")[1].split("(")[0] for line in text.splitlines() if line.startswith("define i32 ")]
    assert set(exported) >= {"whole_numbers", "use_frame", "vectors"}
    assert "define internal double @doubled(double %a.x) nounwind {" in text
    assert " contract " in text


def test_a_loop_is_made_once_and_takes_a_record_with_its_arrays() -> None:
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64)
    seen: list[Any] = []
    callback = kind(lambda address: seen.append(Pair.from_address(address).n) or -7)  # type: ignore[func-returns-value]
    address = ctypes.cast(callback, ctypes.c_void_p).value
    assert address is not None
    functions = NativeFunctions({"f": address, "g": address})
    assert functions.loop("f") is functions.loop("f")
    assert functions.loop("f") is not functions.loop("g")
    numbers = np.arange(3.0)
    assert functions.call("f", Pair(x=2.0), n=numbers) == -7
    assert functions.call("f", Pair(n=5)) == -7
    assert seen == [numbers.ctypes.data, 5]
    for wrong in (np.arange(4.0)[::2], np.arange(3, dtype=np.int32), np.zeros((4, 4)).T[1:]):
        with pytest.raises(ValueError, match=r"^n must be contiguous and of 64-bit numbers$"):
            functions.call("f", Pair(), n=wrong)
    assert len(seen) == 2


def test_functions_are_compiled_or_read_and_made_anew_where_they_cannot_be_linked(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path))
    source = "def f(n: int) -> int32:\n    return n + 1\ndef g(n: int) -> int32:\n    return 2 * n\ndef h(n: int) -> int:\n    return n\n"
    module = SimpleNamespace(__name__="m", __file__=str(tmp_path / "m.py"), GENERATED=source)
    (tmp_path / "m.py").write_text("")
    monkeypatch.setattr(native_module.importlib, "import_module", lambda name: module)
    asked: list[tuple[str, str]] = []
    content: list[bytes] = []

    def cached(name: str, make: Any, slow: str) -> bytes:
        asked.append((name, slow))
        return content[0] if content else make()

    monkeypatch.setattr(native_module, "cached_bytes", cached)
    for damaged in (False, True):
        if damaged:
            content.append(b"f g\nno object code")
        found = native_module.native_functions.__wrapped__("m")
        assert set(found.addresses) == {"f", "g"}
        results = [ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int64)(found.addresses[name])(20) for name in "fg"]
        assert results == [21, 40]
    assert asked == [(f"gearlib_model_{native_digest('m')[:24]}.o", "its solvers for this machine")] * 2
