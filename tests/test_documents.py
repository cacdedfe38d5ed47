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
    "docs/blocks.md",
    "docs/fmu.md",
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


def test_files_that_the_row_by_row_page_names_exist() -> None:
    page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:tests|examples|gearparts)/[\w/]+(?:\.py)?)`", page)
    assert len(named) > 10
    missing = [n for n in named if not ((ROOT / n).exists() or (ROOT / "library" / n).exists())]
    assert missing == []


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
