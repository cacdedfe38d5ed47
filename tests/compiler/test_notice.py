"""Users are told, in one line, what the first compilation on a machine does."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from gearlib import progress
from gearlib.compiler import cache, object_code
from gearlib.compiler.native_module import native_functions


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("terminal", [True, False])
def test_a_user_at_a_terminal_is_told_once_what_takes_long(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, terminal: bool
) -> None:
    shown = Terminal() if terminal else io.StringIO()
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path))
    monkeypatch.setattr("sys.stderr", shown)
    monkeypatch.setattr(cache, "_noticed", set())
    native_functions.__wrapped__("tests.compiler.sample_loops")  # compiled
    said = shown.getvalue()
    native_functions.__wrapped__("gearlib.solvers.exponential.corner_loops")  # another one
    object_code.compiled.__wrapped__("def f(t: float, x: floats) -> int32:\n    x[0] = t\n    return 0", "f")  # fast
    assert shown.getvalue() == said
    assert said.count("\n") == terminal
    assert ("its solvers for this machine" in said) == terminal
    assert (str(cache.folder()) in said) == terminal


def test_what_is_in_the_cache_is_not_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    shown = Terminal()
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path))
    monkeypatch.setattr("sys.stderr", shown)
    monkeypatch.setattr(cache, "_noticed", {"its solvers for this machine"})
    native_functions.__wrapped__("tests.compiler.sample_loops")
    monkeypatch.setattr(cache, "_noticed", set())
    native_functions.__wrapped__("tests.compiler.sample_loops")
    assert shown.getvalue() == ""


def test_a_large_model_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    shown = Terminal()
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path))
    monkeypatch.setattr("sys.stderr", shown)
    monkeypatch.setattr(cache, "_noticed", set())
    monkeypatch.setattr(object_code, "LONG", 50)
    object_code.compiled.__wrapped__("def f(t: float, x: floats) -> int32:\n    x[0] = 2 * t\n    return 0", "f")
    assert "compiles a large model" in shown.getvalue()


def test_a_process_without_a_console_is_told_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", None)
    progress.notice("nothing happens")
