"""The directive ``part``: a class of the library with its icon, its documentation, its equations and what it declares.

Everything is read from the class: the icon is its diagram, the equations are what its ``equations`` returns for the default choices,
parameters and variables are its declarations, and Modelica's name stands in the tables of modelica.md.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import math
import re
from pathlib import Path
from typing import Any

import sympy
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective
from sympy.printing.latex import LatexPrinter

import gearlib as gl
from gearlib.language.component import equations_of
from gearlib.language.declarations import NO_VALUE, Structural, declared_by

GREEK = {
    "phi", "tau", "omega", "eta", "mu", "alpha", "beta", "gamma", "delta", "kappa", "rho", "theta", "epsilon", "sigma", "psi", "xi",
}  # fmt: skip
LONGEST = 150  # characters of source beyond which an equation is a law of cases to be read in the code


class Part(SphinxDirective):
    """The parts of one module, or the parts that are named."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        module = importlib.import_module(self.arguments[0])
        self.env.note_dependency(__file__)
        names = [name for line in self.content for name in line.replace(",", " ").split()]
        found: list[nodes.Node] = []
        for name in names:
            section = nodes.section(ids=[f"part-{nodes.make_id(name)}"], names=[name])
            section += nodes.title(text=name)
            described = ["````{eval-rst}", *_described(module, name), "````"]  # the pages are Markdown
            self.state.nested_parse(StringList(described, source=name), 0, section)
            found.append(section)
        return found


def _described(module: Any, name: str) -> list[str]:
    """What stands of a part, as reStructuredText."""
    kind = getattr(module, name)
    lines = []
    part = _example(kind)
    if part is not None:
        svg = part.diagram()._repr_svg_()
        lines += [".. raw:: html", "", *(f"   {line}" for line in f'<div class="part-icon">{svg}</div>'.splitlines()), ""]
        if name in modelica_names():
            lines += [f"Modelica: ``{modelica_names()[name]}``", ""]
    lines += [f".. auto{'class' if inspect.isclass(kind) else 'function'}:: {module.__name__}.{name}", ""]
    if part is not None:
        lines += _equations(part) + _declared(part)
    return lines


def _example(kind: Any) -> gl.Component | None:
    """An instance with the default choices, where the class is a part that has them."""
    if not (inspect.isclass(kind) and issubclass(kind, gl.Component)):
        return None
    try:
        part = kind()
        part.diagram(), equations_of(part)
    except gl.GearlibError:  # a part that is made from data: a state space, a bond graph
        return None
    return part


def _equations(part: gl.Component) -> list[str]:
    written = [e for e in equations_of(part) if isinstance(e, gl.Eq)]
    short = [e for e in written if len(str(e.left)) + len(str(e.right)) <= LONGEST]
    if not short:
        return []
    rows = [f"{formula(e.left)} &= {formula(e.right)}" for e in short]
    lines = [
        ".. math::",
        "",
        r"   \begin{aligned}",
        *(f"   {row} \\\\" for row in rows[:-1]),
        f"   {rows[-1]}",
        r"   \end{aligned}",
        "",
    ]
    if left_out := len(written) - len(short):
        lines += [f"and {left_out} laws of cases, which its code shows.", ""]
    return lines


def _declared(part: gl.Component) -> list[str]:
    rows = []
    for name, d in part._declarations.items():
        if isinstance(d, Structural):
            rows.append((name, "choice", "", _value(d.default), d.description))
        elif isinstance(d, gl.Parameter):
            rows.append((name, "parameter", d.unit, _value(d.default), d.description + _bounds(d)))
        elif isinstance(d, gl.Input):
            rows.append((name, "input", d.unit, _value(d.default), d.description))
    own = {name: v for name, v in declared_by(part).variables.items() if "." not in name and not isinstance(v, gl.Input)}
    rows += [(name, "variable", v.unit, "", v.description) for name, v in own.items()]
    rows += [(name, "port", "", "", type(connector).__name__) for name, connector in declared_by(part).connectors.items()]
    lines = [".. list-table::", "   :header-rows: 1", "   :widths: 18 12 12 14 44", ""]
    for name, *cells in [("name", "is a", "unit", "default", "meaning"), *((f"``{r[0]}``", *r[1:]) for r in rows)]:
        lines += [f"   {'* -' if i == 0 else '  -'} {cell}".rstrip() for i, cell in enumerate((name, *cells))]
    return [*lines, ""] if rows else []


def _value(default: Any) -> str:
    if default is NO_VALUE:
        return "must be given"
    if isinstance(default, float | int) and not isinstance(default, bool):
        return f"``{default:g}``"
    return f"``{default!r}``" if isinstance(default, str | bool | None | tuple) else "bound"


def _bounds(p: gl.Parameter) -> str:
    if math.isfinite(p.min) and math.isfinite(p.max):
        return f" ({p.min:g} to {p.max:g})"
    return f" (at least {p.min:g})" if math.isfinite(p.min) else f" (at most {p.max:g})" if math.isfinite(p.max) else ""


def formula(expression: Any) -> str:
    r"""LaTeX of an expression of a component's.

    >>> import sympy
    >>> print(formula(sympy.Symbol("J") * sympy.Symbol("der(w)")), formula(sympy.Symbol("flange_a.tau")))
    J \, \dot{w} \tau_{\mathrm{flange\,a}}
    """
    return str(_Printer({"order": "none", "mul_symbol": r" \, "}).doprint(sympy.sympify(expression)))


class _Printer(LatexPrinter):
    def _print_Symbol(self, expr: Any, style: str = "plain") -> str:
        return _symbol(expr.name)

    _print_Dummy = _print_Symbol


def _symbol(name: str) -> str:
    if inner := re.fullmatch(r"der\((.*)\)", name):
        twice = re.fullmatch(r"der\((.*)\)", inner[1])
        return rf"\ddot{{{_symbol(twice[1])}}}" if twice else rf"\dot{{{_symbol(inner[1])}}}"
    if inner := re.fullmatch(r"pre\((.*)\)", name):
        return rf"\operatorname{{pre}}({_symbol(inner[1])})"
    *path, last = name.split(".")
    head, *subscript = last.split("_")
    if len(head) > 1 and head not in GREEK:
        head, subscript = last, []
    below = [*subscript, *(p.replace("_", r"\,") for p in path)]
    word = head.replace("_", r"\_")
    first = rf"\{head}" if head in GREEK else head if len(head) == 1 else rf"\mathrm{{{word}}}"
    return rf"{first}_{{\mathrm{{{', '.join(below)}}}}}" if below else first


@functools.cache
def modelica_names() -> dict[str, str]:
    """Modelica's name of each part, from the tables of the page on Modelica."""
    text = (Path(__file__).parent / "modelica.md").read_text(encoding="utf-8")
    names: dict[str, str] = {}
    package = ""
    for line in text.splitlines():
        if line.startswith("## "):
            package = line[3:].strip()
        cells = [re.findall(r"`([\w.]+)`", cell) for cell in line.strip("|").split("|")[:2]] if line.startswith("| `") else []
        if len(cells) == 2 and len(cells[0]) == len(cells[1]):
            for theirs, ours in zip(*cells, strict=True):
                if ours.startswith("gp."):
                    names[ours.removeprefix("gp.")] = f"{package}.{theirs}" if package.startswith("Rotational") else theirs
    return names


def setup(app: Any) -> dict[str, bool]:
    app.add_directive("part", Part)
    return {"parallel_read_safe": True}
