"""Measured text on docs/stability.md."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEGIN, END = "<!-- measured {}: begin -->\n", "<!-- measured {}: end -->"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def fill(name: str, text: str) -> None:
    """Put measured text between its marks on the page."""
    page = DOCS / "stability.md"
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN.format(name))
    _, end, after = rest.partition(END.format(name))
    if not (begin and end):
        raise ValueError(f"{page.name} has no marks for {name!r}")
    page.write_text(before + begin + text + "\n" + end + after, encoding="utf-8")
    print(f"{name}\n{text}\n", flush=True)


def shown(name: str) -> str:
    """What stands between the marks."""
    page = (DOCS / "stability.md").read_text(encoding="utf-8")
    return page.split(BEGIN.format(name))[1].split("\n" + END.format(name))[0]
