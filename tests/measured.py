"""Measured parts of pages: what a command measured is kept as JSON in ``tests/measured``, and the page shows the text made of it.

A command calls `Part.store`, which writes both. ``python -m tests.measured`` writes the pages anew from what is kept.
"""

from __future__ import annotations

import importlib
import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- measured {}: begin -->\n", "<!-- measured {}: end -->"
MODULES = (
    "tests.benchmarks.page", "tests.benchmarks.forms", "tests.benchmarks.scale", "tests.benchmarks.many_runs",
    "tests.benchmarks.modal", "tests.benchmarks.gradients",
    "tests.benchmarks.before_after", "tests.stress.tables", "tests.stress.campaign",
)  # fmt: skip
"""Modules with a ``PARTS``."""


@dataclass(frozen=True)
class Part:
    """A part of a page between two marks.

    Parameters
    ----------
    name : str
        In the marks, and of the file of the data.
    page : str
        File in ``docs``, without its suffix.
    text : callable
        Makes the text from the data; it reads nothing else, so that page and data always agree.
    """

    name: str
    page: str
    text: Callable[[Any], str]

    @property
    def data(self) -> Path:
        return ROOT / "tests" / "measured" / f"{self.name}.json"

    def load(self) -> Any:
        return json.loads(self.data.read_text(encoding="utf-8"))

    def store(self, measured: Any) -> None:
        """Keep what was measured, and put the text made of it on the page."""
        self.data.parent.mkdir(exist_ok=True)
        self.data.write_text(compact(measured) + "\n", encoding="utf-8")
        self.write()

    def write(self) -> None:
        """Put the text made of the kept data on the page."""
        before, _, after = self._page()
        path = ROOT / "docs" / f"{self.page}.md"
        path.write_text(before + self.text(self.load()) + "\n" + after, encoding="utf-8")

    def shown(self) -> str:
        """What stands between the marks."""
        return self._page()[1].removesuffix("\n")

    def _page(self) -> tuple[str, str, str]:
        page = (ROOT / "docs" / f"{self.page}.md").read_text(encoding="utf-8")
        begin, end = BEGIN.format(self.name), END.format(self.name)
        if page.count(begin) != 1 or page.count(end) != 1:
            raise ValueError(f"{self.page}.md needs the marks of {self.name!r} once")
        head, rest = page.split(begin)
        shown, tail = rest.split(end)
        return head + begin, shown, end + tail


def parts() -> list[Part]:
    """All measured parts of the pages."""
    return [part for module in MODULES for part in importlib.import_module(module).PARTS]


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def compact(measured: Any) -> str:
    """JSON with a record a line; numbers of four digits, null for NaN.

    >>> print(compact({"a": [{"ms": [0.123456, float("nan")]}, {"ms": []}]}))
    {"a": [
    {"ms": [0.1235, null]},
    {"ms": []}]}
    """

    def rounded(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: rounded(each) for key, each in value.items()}
        if isinstance(value, list | tuple):
            return [rounded(each) for each in value]
        if isinstance(value, float):
            return float(f"{value:.4g}") if math.isfinite(value) else None
        return value

    return json.dumps(rounded(measured), ensure_ascii=False).replace("[{", "[\n{").replace("}, ", "},\n")


def main() -> None:
    for part in parts():
        part.write()


if __name__ == "__main__":
    main()
