"""The nouns of the engine: ``python tests/vocabulary.py`` writes the list of files and classes into ``docs/vocabulary.md``.

The list holds every file and public class of gearlib once, with the first line of its docstring; what stands above it is written by hand.
"""

from __future__ import annotations

import ast
import re
import sys
from functools import cache
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.architecture import syntax

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "vocabulary.md"
HEADING = "## Files and classes\n"


def first_line(node: ast.Module | ast.ClassDef) -> str:
    return (ast.get_docstring(node) or "").split("\n")[0].replace("|", "\\|")


@cache
def modules() -> dict[Path, ast.Module]:
    """The files of gearlib, those of a folder before those of its subfolders."""
    paths = sorted((ROOT / "gearlib").rglob("*.py"), key=lambda p: (p.parent.parts, p.name != "__init__.py", p.name))
    return {path.relative_to(ROOT): syntax(path) for path in paths}


def classes(tree: ast.Module) -> list[ast.ClassDef]:
    return [node for node in tree.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")]


def listed() -> str:
    """The generated part of the page."""
    lines = [HEADING]
    for path, tree in modules().items():
        if path.name == "__init__.py":
            lines += [
                "",
                f"### {path.parent.as_posix()}",
                "",
                first_line(tree),
                "",
                "| file or class | what it is |",
                "|---|---|",
            ]
        else:
            lines.append(f"| **{path.stem}** | {first_line(tree)} |")
        lines += [f"| `{node.name}` | {first_line(node)} |" for node in classes(tree)]
    return "\n".join(lines).replace("\n\n\n", "\n\n") + "\n"


def abandoned() -> list[str]:
    """The words that the page says are used no more: those in italics in the last column of its table."""
    rows = re.findall(r"^\|.*\|([^|]*)\|$", PAGE.read_text(encoding="utf-8").split(HEADING)[0], re.MULTILINE)
    return [word for cell in rows for word in re.findall(r"\*([a-z ]+)\*", cell)]


if __name__ == "__main__":
    by_hand = PAGE.read_text(encoding="utf-8").split(HEADING)[0]
    PAGE.write_text(by_hand + listed(), encoding="utf-8")
