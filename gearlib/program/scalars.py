"""Generated scalar Python functions for one-off evaluations: a few scalar operations are cheaper than one on arrays."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from gearlib.equations.template import memoised
from gearlib.program.derivative_plan import DerivativePlan, Sums
from gearlib.program.program import Batch, Linear, Program
from gearlib.program.text import expression, unsigned

MOST = 1500  # numbers up to which a function is generated
NAMES: dict[str, Any] = {name: getattr(math, name) for name in dir(math) if not name.startswith("_")}


@memoised
def constants(program: Program) -> Callable[[list[float]], list[float]] | None:
    """Pivots and entries of the linear blocks as one function of the parameters; None where there are too many."""
    blocks = [b for s in program.steps if isinstance(s, Linear) for b in s.matrix]
    return constants_function([*program.pivots, *blocks])


def constants_function(batches: Sequence[Batch]) -> Callable[[list[float]], list[float]] | None:
    """A function of the parameters that returns the values of batches without arguments; None where there are too many."""
    if sum(len(b) for b in batches) > MOST:
        return None
    items = [_text(batch, i) for batch in batches for i in range(len(batch))]
    return _compiled(f"def f(p):\n    return [{', '.join(items)}]\n")


def _text(batch: Batch, row: int) -> str:
    parameters = batch.parameters[row].tolist()
    return expression(batch, row, lambda a: "0.0", lambda a: f"p[{parameters[a]}]", lambda a: "0.0")


def _compiled(source: str) -> Callable[..., Any]:
    namespace = dict(NAMES)
    exec(compile(source, "<gearlib scalars>", "exec"), namespace)
    function: Callable[..., Any] = namespace["f"]
    return function


Term = tuple[int, str]  # sign, and a factor or a name; "" stands for one
_NAME = re.compile(r"\bd\d+\b")


def linear_function(program: Program, plan: DerivativePlan) -> Callable[[list[float], list[float]], Any] | None:
    """Generated function for the derivatives that a plan lists, for a linear program.

    Returns
    -------
    callable or None
        ``f(parameters, solutions)`` returns the values; ``solutions`` are the concatenated solution matrices of all blocks. None where
        the source would be too long.
    """
    sizes = [len(s.unknowns) * len(s.known) for s in program.steps if isinstance(s, Linear)]
    before = np.cumsum([0, *sizes]).tolist()
    terms: dict[int, Term] = {entry: (1, "") for entry in range(1, 1 + len(plan.order))}  # others are zero
    lines: dict[str, str] = {}

    def store(entry: int, products: list[tuple[Term, Term]]) -> None:
        if not products:
            return
        (sign, factor), (other, name) = products[0]
        if len(products) == 1 and not factor:  # plus or minus something that already has a name
            terms[entry] = sign * other, name
        else:
            lines[f"d{entry}"] = " ".join(_product(*pair) for pair in products)
            terms[entry] = 1, f"d{entry}"

    for step in plan.steps:
        if isinstance(step, Sums):
            for entry, products in zip(step.to.tolist(), _products(step), strict=True):
                store(entry, [(factor, terms[source]) for factor, source in products if source in terms])
        elif not isinstance(step.step, Linear) or step.implicit:
            return None
        else:
            known = len(step.step.known)
            by_column: dict[int, list[tuple[int, Term]]] = {}
            for place, ((_, source),) in zip(step.sums.to.tolist(), _products(step.sums), strict=True):
                if source in terms:
                    by_column.setdefault(place % step.width, []).append((place // step.width, terms[source]))
            entering = dict(zip(step.added.tolist(), step.added_sources.tolist(), strict=True))
            if len(entering) < len(step.added):
                return None
            for k, row in enumerate(step.rows.tolist()):
                at = before[step.block] + row * known
                for c in range(step.width):
                    place = k * step.width + c
                    sums: list[tuple[Term, Term]] = [((1, f"s[{at + j}]"), term) for j, term in by_column.get(c, [])]
                    sums += [((1, ""), terms[entering[place]])] if place in entering else []
                    store(step.first + place, sums)
        if len(lines) > 4 * MOST:
            return None
    values = ", ".join(_product((1, ""), terms[entry]) if entry in terms else "0.0" for entry in plan.sources.tolist())
    needed = set(_NAME.findall(values))
    kept: list[str] = []
    for name, text in reversed(lines.items()):
        if name in needed:
            needed.update(_NAME.findall(text))
            kept.append(f"    {name} = {text}\n")
    return _compiled(f"def f(p, s):\n{''.join(reversed(kept))}    return [{values}]\n")


def _products(sums: Sums) -> Iterator[list[tuple[Term, int]]]:
    """Per sum, its factors and the entries that they multiply."""
    factors = [term for f in sums.factors for term in _factors(f)]
    factors.append((1, ""))  # stands for the -1 of products without a factor
    ends = [*sums.starts.tolist(), len(sums.which)]
    pairs = [(factors[w], source) for w, source in zip(sums.which.tolist(), sums.sources.tolist(), strict=True)]
    for start, end in itertools.pairwise(ends):
        yield pairs[start:end]


def _factors(batch: Batch) -> Iterator[Term]:
    for i in range(len(batch)):
        parameters = batch.parameters[i].tolist()
        text = unsigned(batch, i, lambda a: "0.0", lambda a, p=parameters: f"p[{p[a]}]", lambda a: "0.0")  # type: ignore[misc]
        sign = int(batch.signs[i])
        yield {"1": (sign, ""), "-1": (-sign, "")}.get(text, (sign, f"({text})"))


def _product(a: Term, b: Term) -> str:
    return f"{'+-'[a[0] != b[0]]} {'*'.join(filter(None, (a[1], b[1]))) or '1.0'}"
