"""Generated code for everything computed before a run: bound parameters, factorised blocks, start values, switching times.

`gearlib.program.interpret.prepare`, `gearlib.run.start_values` and `gearlib.run.time_switches` do the same in Python.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import scalar_source
from gearlib.equations.time_rates import time_rates
from gearlib.fmi.exported_model import ExportedModel
from gearlib.native.layout import Layout
from gearlib.native.source import LONGEST, Body, loop
from gearlib.program.interpret import labelled, owner_of
from gearlib.program.program import Batch, Linear, Program
from gearlib.reduce.coefficients import some
from gearlib.run.methods.run import SEARCHED, SEEN
from gearlib.run.start_values import ROUNDING
from gearlib.run.time_switches import driven, rate_symbols

Integers = NDArray[np.int64]
NEVER = 1e300  # s: a time that is never reached

INVERT = '''
def invert(data: floats, a: int, n: int, b: int, m: int) -> int:
    """Solve ``A X = B`` in place: A is n x n at ``a``, B n x m at ``b``, n numbers behind it are scratch. 1 where A is singular."""
    c = b + n * m
    for i in range(n):
        s = 0.0
        for j in range(n):
            s = max(s, abs(data[a + i * n + j]))
        if not (s > 0.0 and s < 1e300):
            return 1
        for j in range(n):
            data[a + i * n + j] /= s
        for j in range(m):
            data[b + i * m + j] /= s
    for j in range(n):
        s = 0.0
        for i in range(n):
            s = max(s, abs(data[a + i * n + j]))
        if not s > 0.0:
            return 1
        data[c + j] = s
        for i in range(n):
            data[a + i * n + j] /= s
    for k in range(n):
        best, r = 0.0, k
        for i in range(k, n):
            if abs(data[a + i * n + k]) > best:
                best, r = abs(data[a + i * n + k]), i
        if not best > 1e-13:
            return 1
        if r != k:
            for j in range(n):
                data[a + k * n + j], data[a + r * n + j] = data[a + r * n + j], data[a + k * n + j]
            for j in range(m):
                data[b + k * m + j], data[b + r * m + j] = data[b + r * m + j], data[b + k * m + j]
        for i in range(k + 1, n):
            f = data[a + i * n + k] / data[a + k * n + k]
            if f != 0.0:
                for j in range(k + 1, n):
                    data[a + i * n + j] -= f * data[a + k * n + j]
                for j in range(m):
                    data[b + i * m + j] -= f * data[b + k * m + j]
    for k in range(n - 1, -1, -1):
        for j in range(m):
            s = data[b + k * m + j]
            for i in range(k + 1, n):
                s -= data[a + k * n + i] * data[b + i * m + j]
            data[b + k * m + j] = s / data[a + k * n + k]
    for i in range(n):
        for j in range(m):
            data[b + i * m + j] /= data[c + i]
    return 0
'''


@dataclass(frozen=True)
class Part:
    """A program's section of ``data``; coefficients of unit-stride runs follow its end."""

    program: Program
    layout: Layout
    coefficients: tuple[Batch, ...]


def preparation_body(exported: ExportedModel, parts: Sequence[Part], end: int, checks: list[str]) -> tuple[Body, int]:
    """The body of ``prepare``, and the size of ``data`` that it needs; its error messages are appended to ``checks``."""
    structure, table = exported.scene.structure, exported.model.parameters
    rows = sum(len(b) for p in parts for g in (*p.program.constant_groups, p.coefficients) for b in g)
    body = Body(literal=rows + sum(len(d.targets) for d in table.dependents) <= LONGEST)
    for d in table.dependents:
        _rows(body, d.scalar, "a", d.targets, d.arguments)
    size = end
    for part in parts:
        for batch in part.program.pivots:
            checks.append(f"{labelled(structure, batch, 0)} cannot be solved with these parameters; division by zero")
            loop(body, batch, f"y = {{value}}\nif not (abs(y) > 0.0 and abs(y) < 1e300):\n    return {len(checks)}")
        at = part.layout.size
        for batch in part.coefficients:
            loop(body, replace(batch, targets=np.arange(at, at + len(batch))), "data[{target}] = {value}")
            at += len(batch)
        blocks = [step for step in part.program.steps if isinstance(step, Linear)]
        for block, place, needed in zip(blocks, part.layout.solutions, part.layout.needed, strict=True):
            n, m = len(block.unknowns), len(block.known)
            right = end + n * n
            size = max(size, right + n * m + n)
            owners = [o for o in dict.fromkeys(owner_of(structure, int(e)) for e in block.equations) if o != "connection"]
            checks.append(f"the equations of {some(owners, ', ')} are singular with these parameters")
            body.lines += [f"for k in range({n * n + n * m}):", f"    data[{end} + k] = 0.0"]
            for batch in block.matrix:
                loop(body, replace(batch, targets=end + batch.targets), "data[{target}] += {value}")
            known, wanted = body.array(right + block.known_rows * m + np.arange(m)), body.array(needed)
            body.lines += [
                f"h, g = {known}, {wanted}",
                f"for k in range({m}):",
                "    data[index[h + k]] = -1.0",
                f"if invert(data, {end}, {n}, {right}, {m}) != 0:",
                f"    return {len(checks)}",
                f"for k in range({len(needed)}):",
                f"    for j in range({m}):",
                f"        data[{place} + k * {m} + j] = data[{right} + index[g + k] * {m} + j]",
            ]
    return body, size


def begin_body(exported: ExportedModel, parts: Sequence[Part], first_input: int, checks: list[str]) -> Body:
    """The body of ``begin``: start values of the states, and initial guesses of iterations; ``first_input`` is a place in ``data``."""
    scene, model = exported.scene, exported.model
    representatives, signs, slots = model.guessed
    value = {int(v): (int(sign), int(slot)) for v, sign, slot in zip(representatives, signs, slots, strict=True) if sign}
    body = Body()
    if exported.computed_starts is None:
        states = [(i, *value[v]) for i, (v, k) in enumerate(scene.states) if k == 0 and v in value]
        body.lines += [f"for k in range({len(scene.states)}):", "    x[k] = 0.0"]
        _copied(body, "x", states)
        _contradictions(exported, body, checks)
    else:
        body.lines += [f"x[{i}] = {float(number)!r}" for i, number in enumerate(exported.start)]
        _computed(exported, first_input, body, checks)
    for part in parts:
        if part.program.iterated:
            variables, places = part.program.undifferentiated
            pairs = zip(variables.tolist(), places.tolist(), strict=True)
            _copied(body, "data", [(part.layout.slots + slot, *value[v]) for v, slot in pairs if v in value])
    return body


def _computed(exported: ExportedModel, first_input: int, body: Body, checks: list[str]) -> None:
    """Check that inputs and time are those that start values were computed with."""
    found = exported.start_constraints
    assert found is not None, "start values are computed"
    for k in np.flatnonzero(found.inputs).tolist():
        name, value = exported.translation.inputs[k], float(exported.input_starts[k])
        checks.append(
            f"start values were computed with {name} = {value:g}, so it begins with that; export the FMU with inputs={{'{name}': ...}}"
        )
        body.lines += [f"if data[{first_input + k}] != {value!r}:", f"    return {len(checks)}"]
    if found.on_time:
        checks.append("start values were computed for a start at t = 0 s")
        body.lines += ["if t != 0.0:", f"    return {len(checks)}"]


def _copied(body: Body, target: str, triples: Sequence[tuple[int, int, int]]) -> None:
    """Copy entries of ``data``, with signs: (target, sign, offset in data)."""
    if triples:
        table = np.array(triples, np.int64).T
        body.lines += [
            f"o = {body.array(table.ravel())}",
            f"for k in range({len(triples)}):",
            f"    {target}[index[o + k]] = index[o + {len(triples)} + k] * data[index[o + {2 * len(triples)} + k]]",
        ]


def _contradictions(exported: ExportedModel, body: Body, checks: list[str]) -> None:
    """Check that several fixed start values of one variable, up to sign, agree."""
    model = exported.model
    representatives, signs, slots = model.fixed
    first: dict[int, tuple[int, int]] = {}
    for v, sign, slot in zip(representatives.tolist(), signs.tolist(), slots.tolist(), strict=True):
        name = model.parameters.names[slot]
        if sign == 0:
            checks.append(f"{name} must be zero: its variable always is")
            body.lines += [f"if not abs(data[{slot}]) <= 1e-12:", f"    return {len(checks)}"]
        elif v in first and first[v][1] != slot:
            other, at = first[v]
            checks.append(
                f"{model.parameters.names[at]} and {name} contradict each other: they are one variable, up to its sign"
            )
            apart = f"abs(data[{slot}] {'-' if sign == other else '+'} data[{at}])"
            body.lines += [f"if not {apart} <= {ROUNDING} * abs(data[{at}]) + 1e-12:", f"    return {len(checks)}"]
        first.setdefault(v, (sign, slot))


def next_time_body(exported: ExportedModel) -> Body:
    """The body of ``next_time``: the first switching time after ``t``, `NEVER` if there is none."""
    body = Body()
    body.lines += [f"values[0] = {NEVER!r}", "later = t + 1.8e-15 * max(abs(t), 1e-3)"]
    for timed in exported.timed:
        for row in timed.parameters:
            table = {symbol.name: f"data[{int(p)}]" for symbol, p in zip(timed.symbols, row, strict=True)}
            if timed.wave is not None:
                period, offset = (_filled(scalar_source(part), table) for part in timed.wave)
                body.lines += [
                    f"p, o = {period}, {offset}",
                    "if p > 0.0:",
                    "    q = max((t - o) / p, 0.0)",
                    "    if q < 1e15:",
                    "        y = o + int(q) * p",
                    "        if y <= later:",
                    "            y = o + (int(q) + 1) * p",
                    "        if y <= later:",
                    "            y = o + (int(q) + 2) * p",
                    "        values[0] = min(values[0], y)",
                ]
                continue
            assert timed.terms is not None, "only those that follow a formula are here"
            a, b = (_filled(scalar_source(part), table) for part in timed.terms)
            body.lines.append(f"y = -({a}) / ({b})")
            if (error := timed.error) is not None:  # as `past_rounding`
                hidden = _filled(scalar_source(error), table | {"t": "y"})
                body.lines += [
                    f"q = 2.0**-50 * ({hidden}) / abs({b})", "if q > 1e-13 * max(abs(y), 1e-3):", "    y += q",
                ]  # fmt: skip
            body.lines += ["if y > later and y < values[0]:", "    values[0] = y"]
    return body


def longest_step_body(exported: ExportedModel) -> Body:
    """The body of ``longest_step``: that of a run which what time drives limits, `NEVER` where nothing does so; as `Run.longest_step`."""
    relations = exported.relations
    share = SEARCHED if relations is not None and len(relations.searched) else SEEN
    body = Body()
    body.lines += [f"values[0] = {NEVER!r}", "w = 0.0"]
    for batch in driven(exported.observed, relations):
        symbols = [symbol.name for symbol in rate_symbols(batch)]
        for rate in map(scalar_source, time_rates(batch.kernel) or ()):
            tables = (dict(zip(symbols, (f"data[{p}]" for p in row), strict=True)) for row in batch.parameters.tolist())
            for text in dict.fromkeys(_filled(rate, table) for table in tables):
                body.lines += [f"y = abs({text})", f"if y > w and y < {NEVER!r}:", "    w = y"]
    body.lines += ["if w > 0.0:", f"    values[0] = {share * math.tau!r} / w"]
    return body


def _filled(text: str, table: dict[str, str]) -> str:
    return re.sub(r"\b(p\d+|t)\b", lambda m: table.get(m[0], m[0]), text)


def _rows(body: Body, text: str, letter: str, targets: Integers, arguments: Integers) -> None:
    """``data[target] = text`` for each row, with the text's a0, a1, ... replaced by its arguments."""

    def put(place: Callable[[int], str]) -> str:
        return re.sub(rf"\b{letter}(\d+)\b", lambda m: place(int(m[1])), text)

    if body.literal:
        for target, row in zip(targets.tolist(), arguments.tolist(), strict=True):
            body.lines.append(f"data[{target}] = {put(lambda a, row=row: f'data[{row[a]}]')}")  # type: ignore[misc]
        return
    count = len(targets)
    where = body.array(np.concatenate([targets, arguments.T.ravel()]))
    body.lines += [
        f"o = {where}",
        f"for k in range({count}):",
        f"    data[index[o + k]] = {put(lambda a: f'data[index[o + {(a + 1) * count} + k]]')}",
    ]
