"""Formulas of the pages as MathML, which browsers draw themselves: no script and no network.

``html_math_renderer = "mathml"`` chooses it; LaTeX becomes MathML by latex2mathml. A formula that it cannot read stops the build.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert


def _inline(writer: Any, node: nodes.Element) -> None:
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.Element) -> None:
    label = f' id="equation-{node["label"]}"' if node.get("label") else ""
    text = node.astext().replace("{aligned}", "{align*}")  # the environment that latex2mathml knows
    writer.body.append(f'<div class="math"{label}>{convert(text, display="block")}</div>\n')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
