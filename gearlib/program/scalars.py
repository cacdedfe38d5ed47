"""Generated scalar Python functions for one-off evaluations: a few scalar operations cost less than one on arrays."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from gearlib.equations.kernel import derivative_of
from gearlib.program.program import Batch, Linear, Newton, Program
from gearlib.program.text import expression

MOST = 1500  # numbers up to which a function is written out
NAMES: dict[str, Any] = {name: getattr(math, name) for name in dir(math) if not name.startswith("_")}


_constants: WeakKeyDictionary[Program, Callable[[list[float]], list[float]] | None] = WeakKeyDictionary()


def constants(program: Program) -> Callable[[list[float]], list[float]] | None:
    """Pivots and entries of the linear blocks as one function of the parameters; None where there are very many."""
    if program not in _constants:
        blocks = [b for s in program.steps if isinstance(s, Linear) for b in s.matrix]
        _constants[program] = constants_function([*program.pivots, *blocks])
    return _constants[program]


def constants_function(batches: Sequence[Batch]) -> Callable[[list[float]], list[float]] | None:
    """A function of the parameters that gives the values of batches without arguments; None where there are very many."""
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


Term = tuple[int, str]  # sign, and a factor or a name; "" is one
_NAME = re.compile(r"\bd\d+_\d+\b")


def linear_function(program: Program, added: Sequence[int]) -> Callable[[list[float], list[float]], Any] | None:
    """For a linear program: the derivatives of its outputs with respect to states, inputs and terms added to slots.

    Returns
    -------
    callable or None
        ``f(parameters, solutions)`` gives the values, ``f.places`` their rows (outputs) and columns (seeds); ``solutions`` are the
        numbers of all blocks' solutions one after the other. None where writing it out would be too long.
    """
    n_seeds = len(program.states) + len(program.inputs)
    rows: dict[int, dict[int, Term]] = {i: {i: (1, "")} for i in range(n_seeds)}
    extra = {slot: n_seeds + k for k, slot in enumerate(added)}
    lines: dict[str, str] = {}
    first = 0

    def store(slot: int, sums: dict[int, list[tuple[Term, Term]]]) -> None:
        rows[slot] = {}
        for seed, terms in sums.items():
            (sign, factor), (other, name) = terms[0]
            if len(terms) == 1 and not factor:  # plus or minus what has a name already
                rows[slot][seed] = sign * other, name
            else:
                lines[f"d{slot}_{seed}"] = " ".join(_product(*term) for term in terms)
                rows[slot][seed] = 1, f"d{slot}_{seed}"
        if slot in extra:
            rows[slot][extra[slot]] = 1, ""

    for step in program.steps:
        if isinstance(step, Newton):
            return None
        if isinstance(step, Linear):
            for unknown in step.unknowns.tolist():
                sums: dict[int, list[tuple[Term, Term]]] = {}
                for j, known in enumerate(step.known.tolist(), first):
                    for seed, term in rows[known].items():
                        sums.setdefault(seed, []).append(((1, f"s[{j}]"), term))
                store(unknown, sums)
                first += len(step.known)
        else:
            for i, target in enumerate(step.targets.tolist()):
                store(target, _chain(step, i, rows))
        if len(lines) > 4 * MOST:
            return None
    outputs = [(i, seed, term) for i, slot in enumerate(program.output_slots.tolist()) for seed, term in rows[slot].items()]
    values = ", ".join(_product((1, ""), term) for *_, term in outputs)
    needed = set(_NAME.findall(values))
    kept: list[str] = []
    for name, text in reversed(lines.items()):
        if name in needed:
            needed.update(_NAME.findall(text))
            kept.append(f"    {name} = {text}\n")
    function: Any = _compiled(f"def f(p, s):\n{''.join(reversed(kept))}    return [{values}]\n")
    function.places = tuple(np.array([place for *place, _ in outputs], np.int64).reshape(-1, 2).T)
    return function  # type: ignore[no-any-return]


def _product(a: Term, b: Term) -> str:
    return f"{'+-'[a[0] != b[0]]} {'*'.join(filter(None, (a[1], b[1]))) or '1.0'}"


def _chain(batch: Batch, i: int, rows: dict[int, dict[int, Term]]) -> dict[int, list[tuple[Term, Term]]]:
    """The terms of a row of a batch by the chain rule: factors and what they multiply, for each seed."""
    sums: dict[int, list[tuple[Term, Term]]] = {}
    for a, c in enumerate(batch.kernel.columns):
        sign = int(batch.argument_signs[i, a] * batch.signs[i])
        kernel = derivative_of(batch.kernel, c)
        if not sign or kernel.is_zero:
            continue
        parameters = [int(batch.parameters[i, batch.kernel.parameters.index(p)]) for p in kernel.parameters]
        text = kernel.scalar
        for k, slot in sorted(zip(kernel.parameters, parameters, strict=True), reverse=True):
            text = text.replace(f"p{k}", f"@[{slot}]")
        text = text.replace("@", "p")
        factor = {"1": (sign, ""), "-1": (-sign, "")}.get(text, (sign, f"({text})"))
        for seed, term in rows[int(batch.arguments[i, a])].items():
            sums.setdefault(seed, []).append((factor, term))
    return sums
