"""The engine does not become larger to learn: what `tests.architecture` counts may only fall."""

from __future__ import annotations

import ast

import pytest

import gearlib as gl
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


def test_the_page_shows_the_limits() -> None:
    """All but lines, which change with every commit."""
    page = architecture.PAGE.read_text(encoding="utf-8")
    shown, due = (
        [line for line in text.splitlines() if line.startswith("|") and not line.startswith("| lines")]
        for text in (page.split(architecture.BEGIN)[1].split(architecture.END)[0], architecture.table())
    )
    assert shown == due, "python tests/architecture.py --page"


def test_a_row_that_falls_short_says_why() -> None:
    assert list(architecture.ROWS) == list(LIMITS)
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in architecture.table().splitlines()[3:] if "|" in line
    ]
    short = [(what, why) for what, _, now, aim, why in rows[1:] if aim.isdigit() and float(now) > int(aim)]
    assert short
    assert all(why for _, why in short), short


def test_ways_of_calls() -> None:
    """From one package on within it, down, up again, and down into the one that was entered."""
    calls = [("run", "f", "run", "g"), ("run", "g", "flatten", "h"), ("flatten", "h", "run", "k"), ("run", "k", "flatten", "l")]
    found = architecture.way_of([(f"gearlib.{a}", one, f"gearlib.{b}", other) for a, one, b, other in calls])
    assert found == dict(
        zip(
            architecture.WAY,
            (
                ["gearlib.run: f -> gearlib.run: g"],
                ["gearlib.flatten: h -> gearlib.run: k"],
                ["gearlib.run: k -> gearlib.flatten: l"],
            ),
            strict=True,
        )
    )


def test_calls_are_those_that_pass_an_instance_on() -> None:
    model = architecture.small_model()
    calls = architecture.calls_with(gl.Component, lambda: gl.check_units(model))
    assert ("gearlib.language", "check_units", "gearlib.language", "equations_of") in calls
    assert all(a.startswith("gearlib.") and b.startswith("gearlib.") for a, _, b, _ in calls)


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
