"""The code on the pages that users read first: it runs, and prints what the page says."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any

import pytest

import gearlib as gl
import gearlib.errors
import gearparts.blocks

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    "README.md",
    "docs/index.md",
    "docs/quickstart.md",
    "docs/xp_train.md",
    "docs/phases.md",
    "docs/statics.md",
    "docs/linear_analysis.md",
    "docs/gear_physics.md",
    "docs/energy.md",
    "docs/files.md",
    "docs/many_runs.md",
    "docs/fitting.md",
    "docs/gradients.md",
    "docs/accuracy.md",
    "docs/components.md",
    "docs/errors.md",
    "docs/own_gearbox.md",
    "docs/level_of_detail.md",
    "docs/blocks.md",
    "docs/fmu.md",
    "docs/modelica_text.md",
]
BLOCK = re.compile(r"^```(python|text)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES)
def test_code_prints_what_the_page_shows(page: str) -> None:
    names: dict[str, Any] = {"__name__": "page"}
    printed = None
    for language, text in BLOCK.findall((ROOT / page).read_text(encoding="utf-8")):
        if language == "text":
            assert printed == text
            printed = None
        else:
            assert not printed, f"{page} does not show {printed!r}"
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(text, page, "exec"), names)
            printed = out.getvalue()
    assert not printed


def test_the_pages_have_code_and_output() -> None:
    for page in PAGES:
        languages = [language for language, _ in BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))]
        assert {"python", "text"} <= set(languages), page


def test_every_page_that_the_readme_names_exists() -> None:
    links = re.findall(r"\]\(([^)#:]+)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(links) >= 6
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_every_page_is_in_the_navigation() -> None:
    docs = ROOT / "docs"
    trees = re.findall(r"```\{toctree\}\n(.*?)```", (docs / "index.md").read_text(encoding="utf-8"), re.DOTALL)
    named = [line for tree in trees for line in tree.splitlines() if line and not line.startswith(":")]
    assert sorted(named) == sorted({"gallery/index"} | {page.stem for page in docs.glob("*.md")} - {"index"})


def paper_rows() -> list[list[str]]:
    """Cells of the table of `docs/paper.md`, without its head."""
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in page.splitlines() if line.startswith("| ")]
    return rows[1:]


def test_every_row_of_the_paper_has_a_file_a_test_and_what_differs() -> None:
    rows = paper_rows()
    assert [row for row in rows if len(row) != 4 or not all(row)] == []
    sections = ["1", "2.1.1", "2.1.2", "2.1.3", "2.2.1", "2.2.2", "2.2.3", "3", "4.1", "4.2", "4.3.1", "4.3.2", "4.3.3", "5"]
    first = [row[0] for row in rows]
    assert [found[0] for cell in first if (found := re.match(r"[\d.]+(?=[ ,])", cell))] == sections
    for word, last in {"Fig.": 8, "Table": 4}.items():
        assert sorted(int(n) for cell in first for n in re.findall(rf"{re.escape(word)} (\d)", cell)) == [*range(1, last + 1)]
    assert sorted(int(n) for cell in first for n in re.findall(r"\((\d)\)", cell)) == [*range(1, 10)]


def test_what_the_row_by_row_page_names_exists() -> None:
    rows = paper_rows()
    cells = " ".join(cell for row in rows for cell in row)
    files = re.findall(r"`((?:tests|examples|gearparts)/[\w/]+(?:\.py)?)(?:::(\w+))?`", cells)
    assert len(files) > 25
    for name, test in files:
        found = next(path for path in (ROOT / name, ROOT / "library" / name) if path.exists())
        assert not test or f"def {test}(" in found.read_text(encoding="utf-8"), f"{name}::{test}"
    assert [cell for _, _, cell, _ in rows if not ("::" in cell or cell.startswith("the same"))] == []
    assert [
        page for page in re.findall(r"\{doc\}`(?:[^`<]*<)?(\w+)", cells) if not (ROOT / "docs" / f"{page}.md").exists()
    ] == []
    assert [name for name in re.findall(r"`gp\.(\w+)", cells) if not hasattr(gearparts, name)] == []
    graphs = (ROOT / "library" / "gearparts" / "trains" / "paper_graphs.py").read_text(encoding="utf-8")
    assert all(f"def {name}(" in graphs for name in ("fixed_axis_unit", "planetary_unit", "single_loop_train"))


FUNCTIONS = {
    "acos", "asin", "atan", "atan2", "cos", "cosh", "exp", "log", "pi", "sin", "sinh", "sqrt", "tan", "tanh", "time",
}  # fmt: skip


def test_the_reference_has_every_public_name_once() -> None:
    page = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
    named = re.findall(r"auto(?:class|function):: gearlib\.(\w+)$", page, re.MULTILINE)
    assert sorted(named) == sorted(set(gl.__all__) - FUNCTIONS - set(vars(gearlib.errors)))
    assert all(f"`{name}`" in page or f"`gl.{name}`" in page for name in FUNCTIONS)


@pytest.mark.parametrize(("page", "package"), [("parts.md", gearparts), ("block_reference.md", gearparts.blocks)])
def test_every_part_has_its_place(page: str, package: Any) -> None:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    named = [name for block in re.findall(r"```\{part\}.*?\n(.*?)```", text, re.DOTALL) for name in block.split()]
    assert sorted(named) == sorted(package.__all__)
