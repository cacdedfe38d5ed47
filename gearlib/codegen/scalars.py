"""Plain Python functions for what a run needs once: written out, since a few scalar operations cost less than one on arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

from gearlib.codegen.kernels import derivative_of
from gearlib.codegen.program import Batch, Linear, Newton, Program
from gearlib.codegen.text import expression

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


def linear_function(program: Program, added: Sequence[int]) -> Callable[[list[float], list[list[list[float]]]], Any] | None:
    """For a linear program: the derivatives of its outputs with respect to states, inputs and terms added to slots.

    Returns
    -------
    callable or None
        ``f(parameters, solutions)`` gives {(output, seed): value}'s values as rows of (output, seed) pairs beside it in
        ``f.places``; None where writing it out would be too long.
    """
    n_seeds = len(program.states) + len(program.inputs)
    rows: dict[int, dict[int, str]] = {i: {i: "1.0"} for i in range(n_seeds)}
    extra = {slot: n_seeds + k for k, slot in enumerate(added)}
    lines: list[str] = []
    block = 0

    def store(slot: int, sums: dict[int, list[str]]) -> None:
        row = {}
        for seed, terms in sums.items():
            name = f"d{slot}_{seed}"
            lines.append(f"    {name} = {' + '.join(terms)}")
            row[seed] = name
        if slot in extra:
            row[extra[slot]] = "1.0"
        rows[slot] = row

    for step in program.steps:
        if isinstance(step, Newton):
            return None
        if isinstance(step, Linear):
            for i, unknown in enumerate(step.unknowns.tolist()):
                sums: dict[int, list[str]] = {}
                for j, known in enumerate(step.known.tolist()):
                    for seed, term in rows[known].items():
                        sums.setdefault(seed, []).append(f"s[{block}][{i}][{j}]*{term}")
                store(unknown, sums)
            block += 1
        else:
            for i, target in enumerate(step.targets.tolist()):
                store(target, _chain(step, i, rows))
        if len(lines) > 4 * MOST:
            return None
    places, values = [], []
    for i, slot in enumerate(program.output_slots.tolist()):
        for seed, name in rows[slot].items():
            places.append((i, seed))
            values.append(name)
    source = "def f(p, s):\n" + "\n".join(lines) + f"\n    return [{', '.join(values)}]\n"
    function: Any = _compiled(source)
    function.places = places
    return function  # type: ignore[no-any-return]


def _chain(batch: Batch, i: int, rows: dict[int, dict[int, str]]) -> dict[int, list[str]]:
    sums: dict[int, list[str]] = {}
    for a, c in enumerate(batch.kernel.columns):
        sign = int(batch.argument_signs[i, a] * batch.signs[i])
        kernel = derivative_of(batch.kernel, c)
        if not sign or kernel.is_zero:
            continue
        parameters = [int(batch.parameters[i, batch.kernel.parameters.index(p)]) for p in kernel.parameters]
        text = kernel.scalar
        for k, slot in sorted(zip(kernel.parameters, parameters, strict=True), reverse=True):
            text = text.replace(f"p{k}", f"@[{slot}]")
        factor = f"{'-' if sign < 0 else ''}({text.replace('@', 'p')})"
        for seed, term in rows[int(batch.arguments[i, a])].items():
            sums.setdefault(seed, []).append(f"{factor}*{term}")
    return sums
