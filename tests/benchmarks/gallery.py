"""Models of the gallery, without its runs and pictures."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path
from types import SimpleNamespace

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@cache
def gallery(name: str, component: str) -> SimpleNamespace:
    """The names of an example's module up to and with the class of its component: constants, tables, the class itself."""
    path = EXAMPLES / f"{name}.py"
    body = []
    for statement in ast.parse(path.read_text(encoding="utf-8")).body:
        if not (isinstance(statement, ast.Import) and statement.names[0].name.startswith("matplotlib")):
            body.append(statement)
        if isinstance(statement, ast.ClassDef) and statement.name == component:
            break
    names: dict[str, object] = {"__name__": f"examples.{name}"}
    exec(compile(ast.Module(body, []), str(path), "exec"), names)
    return SimpleNamespace(**names)
