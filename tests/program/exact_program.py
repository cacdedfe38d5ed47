"""Programs carried out with 40 digits, straight from the equations' expressions, and differences of them: what derivatives must equal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import mpmath as mp
import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.flatten.model import ParameterTable
from gearlib.program.program import Batch, Linear, Newton, Program

Floats = NDArray[np.float64]
DIGITS = 40
STEP = mp.mpf(10) ** -12


@cache
def _lambdified(expression: Any, arguments: int) -> Any:
    return sympy.lambdify(sympy.symbols([f"a{i}" for i in range(arguments)], real=True), expression, "mpmath")


def exact_table(table: ParameterTable, given: Mapping[int, Any]) -> list[Any]:
    """All parameters with many digits, some of them given."""
    values = [given.get(k, mp.mpf(float(v))) for k, v in enumerate(table.values)]
    for d in table.dependents:
        function = _lambdified(d.expression, d.arguments.shape[1])
        for arguments, target in zip(d.arguments.tolist(), d.targets.tolist(), strict=True):
            if target not in given:
                values[target] = function(*(values[a] for a in arguments))
    return values


@dataclass
class ExactProgram:
    """A program at one time with fixed relations; ``near`` are slots from which iterations start."""

    program: Program
    t: float
    relations: Floats
    near: Floats

    def __post_init__(self) -> None:
        self._functions: dict[Any, Any] = {}

    def _values(self, batch: Batch, slots: list[Any], parameters: list[Any]) -> list[Any]:
        kernel = batch.kernel
        if kernel not in self._functions:
            names = ["t", *(f"x{i}" for i in kernel.columns), *(f"p{i}" for i in kernel.parameters)]
            names += [f"r{i}" for i in kernel.relations]
            symbols = [sympy.Symbol(n, real=True) for n in names]
            self._functions[kernel] = sympy.lambdify(symbols, kernel.expression, "mpmath")
        found = []
        for i in range(len(batch)):
            x = [int(s) * slots[a] for a, s in zip(batch.arguments[i], batch.argument_signs[i], strict=True)]
            p = [parameters[k] for k in batch.parameters[i]]
            r = [float(self.relations[k]) for k in batch.relations[i]]
            found.append(int(batch.signs[i]) * self._functions[kernel](mp.mpf(self.t), *x, *p, *r))
        return found

    def slots(self, known: Sequence[Any], parameters: list[Any]) -> list[Any]:
        """All slots from states and inputs."""
        slots = [mp.mpf(float(v)) for v in self.near]
        slots[: len(known)] = known
        for step in self.program.steps:
            if isinstance(step, Batch):
                for target, value in zip(step.targets.tolist(), self._values(step, slots, parameters), strict=True):
                    slots[target] = value
                continue
            n = len(step.unknowns)
            if isinstance(step, Linear):
                right = [mp.mpf(0)] * n
                for row, slot in zip(step.known_rows.tolist(), step.known.tolist(), strict=True):
                    right[row] -= slots[slot]
                found = solved(self._matrix(step.matrix, n, slots, parameters), right)
                for i, u in enumerate(step.unknowns.tolist()):
                    slots[u] = found[i]
            else:
                self._solve(step, slots, parameters)
        return slots

    def _matrix(self, batches: Sequence[Batch], n: int, slots: list[Any], parameters: list[Any]) -> list[dict[int, Any]]:
        rows: list[dict[int, Any]] = [{} for _ in range(n)]
        for batch in batches:
            for target, value in zip(batch.targets.tolist(), self._values(batch, slots, parameters), strict=True):
                rows[target // n][target % n] = rows[target // n].get(target % n, 0) + value
        return rows

    def _solve(self, step: Newton, slots: list[Any], parameters: list[Any]) -> None:
        n = len(step.unknowns)
        for _ in range(60):
            rest = [mp.mpf(0)] * n
            for batch in step.residuals:
                for target, value in zip(batch.targets.tolist(), self._values(batch, slots, parameters), strict=True):
                    rest[target] += value
            change = solved(self._matrix(step.jacobian, n, slots, parameters), rest)
            for i, u in enumerate(step.unknowns.tolist()):
                slots[u] -= change[i]
            if max(abs(c) for c in change) <= mp.mpf(10) ** (10 - DIGITS) * max(abs(slots[u]) for u in step.unknowns.tolist()):
                return
        raise AssertionError("the iteration did not converge")


def solved(rows: list[dict[int, Any]], right: list[Any]) -> list[Any]:
    """Solve linear equations by elimination, column by column, with the largest pivot; ``rows`` and ``right`` are used up."""
    order = []
    left = set(range(len(rows)))
    for column in range(len(rows)):
        pivot = max(left, key=lambda r: abs(rows[r].get(column, 0)))
        left.remove(pivot)
        order.append(pivot)
        for r in [r for r in left if rows[r].get(column, 0) != 0]:
            factor = rows[r].pop(column) / rows[pivot][column]
            for k, value in rows[pivot].items():
                if k > column:
                    rows[r][k] = rows[r].get(k, 0) - factor * value
            right[r] -= factor * right[pivot]
    found: list[Any] = [mp.mpf(0)] * len(rows)
    for column, pivot in reversed(list(enumerate(order))):
        rest = right[pivot] - sum(value * found[k] for k, value in rows[pivot].items() if k > column)
        found[column] = rest / rows[pivot][column]
    return found


def difference_quotients(
    exact: ExactProgram, known: Floats, table: ParameterTable, given: Mapping[int, float], seeds: Sequence[int]
) -> tuple[Floats, Floats]:
    """Derivatives of all slots by central differences, shape (slots, seeds), and the size of what each is made of.

    ``seeds`` are slots of states and inputs, or ``n_slots + p`` for parameter p.
    """
    n = exact.program.n_slots
    with mp.workdps(DIGITS):
        found = np.zeros((n, len(seeds)))
        start = exact_table(table, {k: mp.mpf(v) for k, v in given.items()})
        size = np.array([float(abs(v)) for v in exact.slots([mp.mpf(float(v)) for v in known], start)])
        for column, seed in enumerate(seeds):
            sides = []
            for sign in (1, -1):
                x = [mp.mpf(float(v)) for v in known]
                parameters = start
                if seed < n:
                    x[seed] += sign * STEP
                else:
                    moved = {**{k: mp.mpf(v) for k, v in given.items()}, seed - n: start[seed - n] + sign * STEP}
                    parameters = exact_table(table, moved)
                sides.append(exact.slots(x, parameters))
            found[:, column] = [float((a - b) / (2 * STEP)) for a, b in zip(*sides, strict=True)]
    return found, size
