"""Code generation for events: root functions of the relations, and the event iteration (update)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gearlib.flatten.model import FlatModel
from gearlib.native.layout import EACH, Layout
from gearlib.native.source import CLOSING, Body, loop, looped, states_and_inputs
from gearlib.program.event_iteration import (
    MOST_ITERATIONS,
    DiscretesPhase,
    EventIteration,
    RelationsPhase,
    UnknownsPhase,
    compares_with_before,
    relation_of,
)
from gearlib.program.relations import Relations

Integers = NDArray[np.int64]
MOST_STEPS = 20  # outer iterations that are recorded, for the tangents


def roots_body(relations: Relations, layout: Layout) -> Body:
    """Root functions of the relations that compare more than time, signed so that zero counts as negative."""
    body = looped(relations.program, layout)
    body.lines = body.lines[:-CLOSING]
    numbers = relations.searched
    for phase in relations.event_iteration.event_functions:
        relation = relation_of(phase.batch)
        # positive where a strict relation holds, or a non-strict one fails
        sign = "" if relation.strict != relation.negated else "-"
        part = replace(phase.batch, targets=np.searchsorted(numbers, phase.batch.targets))
        loop(body, part, f"values[{{target}}] = {sign}({{value}})")
    return body


def update_body(relations: Relations, layout: Layout, model: FlatModel, guards: tuple[int, int], notes: bool = False) -> Body:
    """Body of the native event iteration.

    A relation whose root was located takes the side that it crossed to; it is evaluated like the others once a state has been
    re-initialised or, if it compares with values before the event, in all outer iterations but the first that decides it. At the end
    ``fired`` holds the side of each root that agrees with its relation (2 or -2), and the signs of divisors, which may have jumped, are
    halved, which marks them as stale: ``guards`` gives their offset and number. ``notes``: whether to record, behind the body's part of
    ``data``, the number of outer iterations, and for the first `MOST_STEPS` of them the discrete state and the states before the
    re-initialisations.
    """
    body = looped(relations.program, layout, keep=False)  # the discrete state changes from one iteration to the next
    numbers = relations.searched
    passes, iteration = _passes(body, relations, model, numbers), relations.event_iteration
    ended = _ended(body, iteration, numbers, "result = max(result, 1)")
    for batch in iteration.reinits:
        loop(body, batch, "y = {value}\nif x[{target}] != y:\n    x[{target}] = y\n    result = 2")
    reinits = body.lines
    forget = (
        ["if result == 2:", f"    for k in range({len(numbers)}):", "        fired[k] = 0"] if reinits and len(numbers) else []
    )
    body.lines = []
    for phase in iteration.event_functions:  # through rounding, the sign of a function may differ from its relation
        holds, fails = (2, -2) if relation_of(phase.batch).strict else (-2, 2)
        statement = f"fired[{{extra}}] = {holds} if data[r + {{target}}] != 0.0 else {fails}"
        loop(body, phase.batch, statement, extra=np.searchsorted(numbers, phase.batch.targets))
    sides = body.lines
    noted = _note(body, model.n_discrete, layout.size + body.n_coefficients) if notes else []
    stale = _stale_signs(body, guards)
    body.lines = [
        "result, moved = 0, 1",
        *passes,
        "        result = max(result, 1)",  # not less where a state has been set
        "    if changed != 0:",
        "        return -1",
        "    moved = 0",
        "    for k in range(nd):",
        "        if data[r + nr + nd + k] != data[r + nr + k]:",
        "            moved = 1",
        *(f"    {line}" for line in noted),
        *(f"    {line}" for line in reinits),
        *(f"    {line}" for line in forget),
        "    for k in range(nd):",
        "        data[r + nr + nd + k] = data[r + nr + k]",
        *_started(model),
        *ended,
        "if moved != 0:",
        "    return -1",
        *sides,
        *stale,
        "return result",
    ]  # fmt: skip
    return body


def _started(model: FlatModel) -> list[str]:
    """Clear the flag of the start of a run (`initial`), which holds in the first outer iteration only."""
    return ["    data[r + nr + 2 * nd] = 0.0"] if len(model.discretes) else []


def settle_body(relations: Relations, layout: Layout, model: FlatModel) -> Body:
    """Body of the event iteration at the start of a run, for relations and discrete variables as `discrete_at_start` finds them.

    Only the final discrete state must admit a solution of the equations: on the way, a moving friction element may be tried as stuck. If
    the iteration does not converge here, that of the run may.
    """
    body = looped(relations.program, layout, forgiving=True, keep=False)
    passes = _passes(body, relations, model, None)
    ended = _ended(body, relations.event_iteration, None)
    body.lines = [
        *passes,
        "    moved = 0",
        "    for k in range(nd):",
        "        if data[r + nr + nd + k] != data[r + nr + k]:",
        "            moved = 1",
        "        data[r + nr + nd + k] = data[r + nr + k]",
        *_started(model),
        "    if changed != 0:",
        "        break",
        *ended,
    ]  # fmt: skip
    return body


def _ended(body: Body, iteration: EventIteration, numbers: Integers | None, *noted: str) -> list[str]:
    """Lines that end the outer iterations where nothing has moved, with the relations that are decided last; statements where some has.

    While these keep their values, ``last`` is 0; it is 1 where they are decided for the first time, then 2. Where they hold as they are,
    no further pass is needed. Takes the lines of the body, and leaves it empty.
    """
    if not iteration.has_last:
        return ["    if moved == 0:", "        break", *(f"    {line}" for line in noted)]
    for phase in iteration.passed:
        if isinstance(phase, RelationsPhase) and phase.last:
            _test(body, phase, numbers)
    tests, body.lines = body.lines, []
    return [
        "    if moved == 0 and last != 0:",
        "        break",
        "    if moved != 0:",
        "        last = 0",
        *(f"        {line}" for line in noted),
        "    else:",
        "        last, first, changed = first, 2, 0",
        *(f"        {line}" for line in tests),
        "        if changed == 0:",
        "            break",
        "        moved = 1",
        *(f"        {line}" for line in noted),
    ]


def _passes(body: Body, relations: Relations, model: FlatModel, numbers: Integers | None) -> list[str]:
    """Lines of the nested iteration: outer iterations, in each of which the phases are passed until the discrete state does not change.

    The caller appends to them: lines indented by 4 spaces belong to the outer iteration, by 8 to an inner one that has changed something.
    ``numbers``: as for `_test`. Takes the lines of the body, and leaves it empty.
    """
    head, compute, body.lines = body.lines[:2], body.lines[2:-CLOSING], []
    iteration = relations.event_iteration
    for phase in iteration.passed:
        match phase:
            case UnknownsPhase():
                body.lines += compute if phase.batches is None else states_and_inputs(relations.program)
                for batch in phase.batches or ():
                    loop(body, batch, "data[v + {target}] = {value}")
            case DiscretesPhase(batch):
                loop(body, batch, "y = {value}\nif data[r + {target}] != y:\n    data[r + {target}] = y\n    changed = 1")
            case RelationsPhase():
                _test(body, phase, numbers)
    inner, body.lines = body.lines, []
    sizes = body.array([model.n_relations, len(model.discretes)])
    return [
        *head, f"h = {sizes}", "nr, nd = index[h], index[h + 1]", *(["last, first = 0, 1"] if iteration.has_last else []),
        f"for outer in range({MOST_ITERATIONS}):",
        "    changed = 1",
        f"    for iteration in range({MOST_ITERATIONS}):",
        "        changed = 0",
        *(f"        {line}" for line in inner),
        "        if changed == 0:",
        "            break",
    ]  # fmt: skip


def _note(body: Body, n_discrete: int, steps: int) -> list[str]:
    """Record the discrete state and the states of an outer iteration, from offset ``steps`` of ``data`` on."""
    return [
        f"h = {body.array([n_discrete, steps])}",
        "q, e = index[h], index[h + 1]",
        "data[e] = outer + 1.0",
        f"if outer < {MOST_STEPS}:",
        "    e += 1 + outer * (q + n)",
        "    for k in range(q):",
        "        data[e + k] = data[r + k]",
        "    for k in range(n):",
        "        data[e + q + k] = x[k]",
    ]


def _stale_signs(body: Body, guards: tuple[int, int]) -> list[str]:
    """Mark the signs of divisors as stale."""
    place, count = guards
    if not count:
        return []
    return [f"s = {body.array([place])}", f"for k in range({count}):", f"    data[index[s] + {EACH} * k] *= 0.5"]


def _test(body: Body, phase: RelationsPhase, numbers: Integers | None) -> None:
    """Evaluate the relations of a phase; ``numbers``: relations of the root functions, which may have fired (None: no root search)."""
    outer, body.lines = body.lines, []
    lines = ["y = {value}", f"f = 1.0 if y {phase.comparison} 0.0 else 0.0"]
    roots = np.zeros(len(phase.batch), np.int64)
    if phase.on_time:
        body.lines += ["now = t", "t = t + 1e-12 * max(abs(t), 1e-3)"]  # right-hand limit in time, as `right_hand` takes it
    if phase.searched and numbers is not None:
        roots = np.searchsorted(numbers, phase.batch.targets)
        start = "last == 1" if phase.last else "outer == 0"
        first = f" and {start}" if compares_with_before(phase.batch) else ""
        above = ">" if relation_of(phase.batch).strict else "<"
        lines += [f"if fired[{{extra}}] != 0{first}:", f"    f = 1.0 if fired[{{extra}}] {above} 0 else 0.0"]
    lines += ["if data[r + {target}] != f:", "    data[r + {target}] = f", "    changed = 1"]
    loop(body, phase.batch, "\n".join(lines), extra=roots)
    if phase.on_time:
        body.lines.append("t = now")
    guarded = ["if last != 0:", *(f"    {line}" for line in body.lines)] if phase.last else body.lines
    body.lines = outer + guarded
