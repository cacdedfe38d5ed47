"""The directive ``picture``: code of a page, shown, run when the pages are built, and followed by the picture that it makes.

The code of one page shares its names. The picture is the value of the last expression: SVG where it has ``_repr_svg_``, otherwise the
current figure of matplotlib. An error stops the build.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective


class Picture(SphinxDirective):
    """Show code, run it, and show what it draws."""

    has_content = True
    option_spec = {"alt": directives.unchanged_required, "hidden": directives.flag}  # noqa: RUF012

    def run(self) -> list[nodes.Node]:
        code = "\n".join(self.content)
        names = self.env.temp_data.setdefault("picture names", {"__name__": "page"})
        number = self.env.temp_data["picture number"] = self.env.temp_data.get("picture number", 0) + 1
        value = _value(code, f"{self.env.docname}, picture {number}", names)
        stem = f"{self.env.docname.replace('/', '-')}-{number}"
        folder = Path(self.env.app.outdir) / "_pictures"
        folder.mkdir(parents=True, exist_ok=True)
        file = _written(value, folder / stem)
        up = "../" * self.env.docname.count("/")
        alt = self.options.get("alt", "picture made by the code above")
        image = nodes.raw(
            "", f'<p><img src="{up}_pictures/{file.name}" alt="{alt}" style="max-width:100%"/></p>', format="html"
        )
        if "hidden" in self.options:
            return [image]
        return [nodes.literal_block(code, code, language="python"), image]


def _value(code: str, where: str, names: dict[str, Any]) -> Any:
    """Run code; the value of its last statement, if that is an expression."""
    tree = ast.parse(code, where)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, where, "exec"), names)
    return eval(compile(ast.Expression(last.value), where, "eval"), names) if isinstance(last, ast.Expr) else None


def _written(value: Any, path: Path) -> Path:
    if hasattr(value, "_repr_svg_"):
        file = path.with_suffix(".svg")
        file.write_text(value._repr_svg_(), encoding="utf-8")
        return file
    import matplotlib.pyplot as plt

    file = path.with_suffix(".png")
    plt.gcf().savefig(file, dpi=110)
    plt.close("all")
    return file


def setup(app: Any) -> dict[str, bool]:
    app.add_directive("picture", Picture)
    return {"parallel_read_safe": True}
