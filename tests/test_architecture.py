"""The engine does not become larger to learn: what `tests.architecture` counts may only fall."""

from __future__ import annotations

import ast

import pytest

from tests import architecture

LIMITS = architecture.limits()


@pytest.fixture(scope="module")
def counts() -> dict[str, int]:
    return architecture.counts()


def test_every_row_has_a_limit(counts: dict[str, int]) -> None:
    assert list(counts) == list(LIMITS)


@pytest.mark.parametrize("row", LIMITS)
def test_count_has_not_grown(row: str, counts: dict[str, int]) -> None:
    found = architecture.findings().get(row, [])
    assert counts[row] <= LIMITS[row], "\n".join([f"{row}: at most {LIMITS[row]}, but there are {counts[row]}", *found])


def test_counters_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two modules with one of everything that is counted."""
    first = "from gearlib.b import _hidden\n@functools.lru_cache(maxsize=1)\ndef f(): return _hidden\nclass Same: pass\nKNOWN: dict = {}"
    second = "from gearlib.a import f\n_hidden = 1\nclass Same: pass\ndef g(x): return x._inner, x._hidden"
    trees = {"gearlib.a": ast.parse(first), "gearlib.b": ast.parse(second)}
    monkeypatch.setattr(architecture, "sources", lambda: trees)
    architecture.imports.cache_clear()
    try:
        assert architecture.private_reads() == ["gearlib.a:1 _hidden", "gearlib.b:4 ._inner", "gearlib.b:4 ._hidden"]
        assert architecture.module_caches() == ["gearlib.a.f", "gearlib.a.KNOWN"]
        assert architecture.class_names_with_two_meanings() == ["Same"]
        assert architecture.import_circles() == ["gearlib.a gearlib.b"]
    finally:
        architecture.imports.cache_clear()
