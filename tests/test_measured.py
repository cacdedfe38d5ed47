"""What pages show of measurements is the text made of the data that the commands keep, and nothing else quotes a time."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.measured import ROOT, Part, compact, parts

DOCS = ROOT / "docs"
PARTS = parts()
MEASURED = re.compile(r"<!-- measured (\w+): begin -->.*?<!-- measured \1: end -->", re.DOTALL)
CODE = re.compile(r"^( *)```.*?^\1```", re.DOTALL | re.MULTILINE)
NUMBER = r"\d[\d ]*(?:\.\d+)?(?:e-?\d+)?"
TIME = re.compile(rf"(?<![\w.]){NUMBER}\s(?:ms|us|µs|MB|GB)\b|(?<![\w.]){NUMBER}\stimes\s(?:as\s(?:fast|long)|faster|slower)")
STATED = {
    "blocks.md": {"50 ms", "100 ms"},  # of the model
    "how_it_scales.md": {"512 MB"},  # a limit
    "releasing.md": {"1 MB"},  # a limit
    "solvers.md": {"30 MB"},  # a limit
    "scaling_out.md": {"8 MB", "4 GB", "1 ms"},  # sizes of arrays; 1 ms is assumed
    "vocabulary.md": {"50 ms"},  # a limit
}
"""Quantities that are no measurements."""
HELD = {
    "bond_graph.md": "gearparts/trains/test_paper_graphs.py",
    "paper_section_4.md": "test_examples.py",
    "published.md": "linear/test_published.py",
    "weak_nonlinearity.md": "test_examples.py",
    "xp_train.md": "validation/test_xp_train.py",
}
"""Pages with tables of results outside the marks, and the test that compares them."""


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
def test_the_page_shows_what_is_made_of_the_data(part: Part) -> None:
    assert part.shown() == part.text(part.load())


def test_every_mark_and_every_file_has_a_part() -> None:
    marks = [(path.stem, name) for path in DOCS.glob("*.md") for name in MEASURED.findall(path.read_text(encoding="utf-8"))]
    assert sorted(marks) == sorted((part.page, part.name) for part in PARTS)
    assert sorted(path.stem for path in (ROOT / "tests" / "measured").iterdir()) == sorted(part.name for part in PARTS)
    assert sum(part.data.stat().st_size for part in PARTS) < 100_000


def prose(path: Path) -> str:
    """A page without its code, and without what is made of data."""
    return CODE.sub("", MEASURED.sub("", path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("path", sorted(DOCS.glob("*.md")), ids=lambda path: path.stem)
def test_no_sentence_quotes_a_time_that_no_command_writes(path: Path) -> None:
    if path.name == "changelog.md":
        return
    quoted = {" ".join(found.split()) for found in TIME.findall(prose(path))}
    assert quoted <= STATED.get(path.name, set())


@pytest.mark.parametrize("path", sorted(DOCS.glob("*.md")), ids=lambda path: path.stem)
def test_tables_of_results_are_made_of_data_or_compared_by_a_test(path: Path) -> None:
    """A table of results has rows with several cells that are decimal numbers."""
    rows = [line.strip().strip("|").split("|") for line in prose(path).splitlines() if line.lstrip().startswith("|")]
    results = [row for row in rows if sum(bool(re.fullmatch(r"\W*-?\d+\.\d+\W*", cell)) for cell in row) > 1]
    if path.name in HELD:
        test = (ROOT / "tests" / HELD[path.name]).read_text(encoding="utf-8")
        assert path.name in test or HELD[path.name] in path.read_text(encoding="utf-8")
    else:
        assert results == []


def test_what_is_stored_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.measured.ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    (tmp_path / "tests").mkdir()
    page = tmp_path / "docs" / "p.md"
    page.write_text("a\n<!-- measured x: begin -->\nold\n<!-- measured x: end -->\nb\n", encoding="utf-8")
    part = Part("x", "p", lambda kept: f"{kept['ms']} ms")
    part.store({"ms": 1.23456, "none": float("nan")})
    assert part.load() == {"ms": 1.235, "none": None}
    assert page.read_text(encoding="utf-8") == "a\n<!-- measured x: begin -->\n1.235 ms\n<!-- measured x: end -->\nb\n"
    assert part.shown() == "1.235 ms"
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(ValueError, match=r"p\.md needs the marks of 'x' once"):
        part.shown()


def test_numbers_are_kept_with_four_digits() -> None:
    assert compact([{"a": 1234567.0, "b": 3, "c": "ä"}]) == '[\n{"a": 1235000.0, "b": 3, "c": "ä"}]'
