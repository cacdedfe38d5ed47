"""Compiled loops are kept under what they are made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numba
import pytest

from gearlib.solve import kept


@numba.njit
def _twice(x: float) -> float:
    return 2.0 * x


def test_a_loop_is_found_again_until_a_source_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARLIB_CACHE", str(tmp_path))
    decorate: Any = numba.njit(numba.types.float64(numba.types.float64), cache=True)
    assert kept.keep(_twice, decorate)(21.0) == 42.0
    assert kept.keep(_twice, decorate)(21.0) == 42.0
    assert len([*tmp_path.rglob("gearlib_model_*.py")]) == 1
    monkeypatch.setattr(kept, "digest", lambda: "another")
    assert kept.keep(_twice, decorate)(21.0) == 42.0
    assert len([*tmp_path.rglob("gearlib_model_*.py")]) == 2
    assert len([*tmp_path.rglob("*.nbc")]) == 2


def test_the_digest_covers_what_the_loops_call() -> None:
    files = {path.name for pattern in kept.SOURCES for path in Path(kept.__file__).parent.glob(pattern)}
    compiled = ["rk_loop", "ida_compiled"]
    while compiled:
        text = (Path(kept.__file__).parent / f"{compiled.pop()}.py").read_text(encoding="utf-8")
        called = [line.split()[1] for line in text.splitlines() if line.startswith("from gearlib.solve.")]
        for name in (n.removeprefix("gearlib.solve.") for n in called):
            assert f"{name}.py" in files or name == "kept", name
