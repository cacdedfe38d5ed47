"""Code generation for right-hand sides extended by tangents, of small programs: unrolled, with the columns in vectors.

Partial derivatives of each equation are computed once and multiply the tangents of all columns, eight columns per vector; one or two
remaining columns are scalars. Everything stays in registers and on the stack.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.instructions import LANES
from gearlib.native.jacobian import inverted_blocks
from gearlib.native.layout import Layout
from gearlib.native.source import Body, is_small, written_out
from gearlib.program.derivative_plan import DerivativePlan, Solved
from gearlib.program.program import Batch, Linear, Program
from gearlib.program.text import expression

Integers = NDArray[np.int64]
Entry = tuple[int, int]  # entry of the parameter table, column
MOST_LINES = 2000  # vectors computed in a function
FEW = 2  # remaining columns up to which they are scalars; more make another vector
HEAD = """\
def rhs(t: float, x_at: int, dx_at: int, data_at: int, index: ints) -> int32:
    x, dx, data = floats_at(x_at), floats_at(dx_at), floats_at(data_at)
"""


@dataclass(frozen=True)
class TangentVectors:
    """Layout in ``data`` of the weights of the columns at parameters: a row per parameter, padded with zeros to whole vectors.

    Attributes
    ----------
    place : int
        Offset of the first row.
    parameters : tuple of int
        Entries of the parameter table that columns change.
    width : int
        Numbers per row.
    """

    place: int
    parameters: tuple[int, ...]
    width: int

    def weights(self, entries: Sequence[Entry], weights: Sequence[float]) -> NDArray[np.float64]:
        """The rows, one after the other."""
        row = {p: i for i, p in enumerate(self.parameters)}
        found = np.zeros((len(row), self.width))
        for (p, k), weight in zip(entries, weights, strict=True):
            found[row[p], k] += weight
        return found.ravel()

    @property
    def size(self) -> int:
        return len(self.parameters) * self.width


def vector_body(
    program: Program, layout: Layout, plan: DerivativePlan, changed: Sequence[Entry]
) -> tuple[str, Body, TangentVectors, int] | None:
    """Source of a right-hand side extended by tangents, its body, the layout of the weights, and the end of its numbers in ``data``.

    None if the program is not small. The tangents follow the states, all tangents of one state together. Partial derivatives that
    depend on parameters only are coefficients of the body; the weights are followed by the inverses of `inverted_blocks`, row by row,
    and by scratch space for a vector.
    """
    parameters = tuple(dict.fromkeys(p for p, _ in changed))
    width = -(-plan.n_seeds // LANES) * LANES
    rows = sum(len(s) if isinstance(s, Batch) else len(s.unknowns) for s in program.steps)
    if not is_small(program) or rows * width // LANES > MOST_LINES:
        return None
    names = {slot: f"v{slot}" for slot in range(program.n_slots)}
    body = written_out(program, layout, names, [f"p{k}" for k in range(1 + max(_parameters(program), default=-1))])
    place = layout.size
    for _ in range(2):  # the first pass counts the coefficients, which the weights follow
        columns = _Columns(program, layout, plan, TangentVectors(place, parameters, width))
        place = layout.size + columns.n_coefficients
    body.coefficients = columns.coefficients
    text = HEAD + "\n".join([*(f"    {line}" for line in [*body.lines, *columns.lines]), "    return 0", ""])
    return text, body, columns.vectors, columns.end


def _parameters(program: Program) -> Iterator[int]:
    for step in program.steps:
        if isinstance(step, Batch):
            yield from step.parameters.ravel().tolist()
    for guard in program.guards:
        yield from guard.divisors.parameters.ravel().tolist()


@dataclass
class _Columns:
    """Lines that compute the tangents."""

    program: Program
    layout: Layout
    plan: DerivativePlan
    vectors: TangentVectors
    lines: list[str] = field(default_factory=list)
    coefficients: list[Batch] = field(default_factory=list)
    n_coefficients: int = 0

    def __post_init__(self) -> None:
        program, plan, k = self.program, self.plan, self.plan.n_seeds
        left = k % LANES
        whole = k - left if left <= FEW else k
        self._pieces = [*((c, min(LANES, k - c)) for c in range(0, whole, LANES)), *((c, 1) for c in range(whole, k))]
        self._row = {p: i for i, p in enumerate(self.vectors.parameters)}
        self._factors: dict[str, str] = {}
        self._places: dict[tuple[int, str], int] = {}  # of the coefficients of a batch
        self._tangents: set[int] = set(range(len(program.states)))  # slots that have some
        at = self.vectors.place + self.vectors.size
        self._inverses: dict[int, tuple[Solved, list[int], int]] = {}
        for solved, equations in inverted_blocks(plan):
            self._inverses[id(solved.step)] = solved, equations.tolist(), at
            at += len(solved.rows) * len(equations)
        self._room, self.end = at, at + LANES
        for i in range(len(program.states)):
            for piece in range(len(self._pieces)):
                self._load(i, piece)
        solved_steps = {id(s.step): s for s in plan.steps if isinstance(s, Solved)}
        block = 0
        for step in program.steps:
            if isinstance(step, Batch):
                for i in range(len(step)):
                    self._set(int(step.targets[i]), self._of_row(step, i))
            elif isinstance(step, Linear):
                if id(step) in self._inverses:
                    self._implicit(step, self.program.n_slots + MOST_LINES * block)
                elif id(step) in solved_steps:
                    self._multiplied(step, block)
                block += 1
        for i, slot in enumerate(program.output_slots.tolist()):
            for piece in range(len(self._pieces)):
                self._store(i, piece, f"d{slot}_{piece}" if slot in self._tangents else self._zero(piece))

    def _place(self, state: int, piece: int) -> int:
        return len(self.program.states) + state * self.plan.n_seeds + self._pieces[piece][0]

    def _is_number(self, piece: int) -> bool:
        first, count = self._pieces[piece]
        return count == 1 and first >= self.plan.n_seeds - self.plan.n_seeds % LANES

    def _beyond(self, state: int, piece: int) -> bool:
        """Whether a vector there would extend beyond the last tangent."""
        return self._place(state, piece) + LANES > len(self.program.states) * (1 + self.plan.n_seeds)

    def _zero(self, piece: int) -> str:
        return "0.0" if self._is_number(piece) else "in_lanes(0.0)"

    def _load(self, state: int, piece: int) -> None:
        at, name = self._place(state, piece), f"d{state}_{piece}"
        if self._is_number(piece):
            self.lines.append(f"{name} = x[{at}]")
        elif self._beyond(state, piece):
            self.lines += [f"data[{self._room + k}] = x[{at + k}]" for k in range(self._pieces[piece][1])]
            self.lines.append(f"{name} = lanes_at(data_at + {8 * self._room})[0]")
        else:
            self.lines.append(f"{name} = lanes_at(x_at + {8 * at})[0]")

    def _store(self, state: int, piece: int, value: str) -> None:
        """A vector may extend into the next row, which is stored later."""
        at = self._place(state, piece)
        if self._is_number(piece):
            self.lines.append(f"dx[{at}] = {value}")
        elif self._beyond(state, piece):
            self.lines.append(f"lanes_at(data_at + {8 * self._room})[0] = {value}")
            self.lines += [f"dx[{at + k}] = data[{self._room + k}]" for k in range(self._pieces[piece][1])]
        else:
            self.lines.append(f"lanes_at(dx_at + {8 * at})[0] = {value}")

    def _set(self, slot: int, terms: Sequence[tuple[str, str]]) -> None:
        """The tangent of a slot: a sum of products of a number with a tangent or with the weights of a parameter."""
        if not terms:
            return
        self._tangents.add(slot)
        for piece in range(len(self._pieces)):
            parts = []
            for factor, of in terms:
                vector = self._weight(int(of[1:]), piece) if of.startswith("w") else f"{of}_{piece}"
                if factor in ("1.0", "-1.0"):
                    parts.append(f"{'-' if factor[0] == '-' else '+'} {vector}")
                else:
                    parts.append(f"+ {self._factor(factor, piece)} * {vector}")
            self.lines.append(f"d{slot}_{piece} = {' '.join(parts).removeprefix('+ ')}")

    def _weight(self, parameter: int, piece: int) -> str:
        at = self.vectors.place + self._row[parameter] * self.vectors.width + self._pieces[piece][0]
        return f"data[{at}]" if self._is_number(piece) else f"lanes_at(data_at + {8 * at})[0]"

    def _factor(self, text: str, piece: int) -> str:
        """A number, computed once for all columns."""
        if text not in self._factors:
            name = self._factors[text] = f"f{len(self._factors)}"
            self.lines.append(f"{name} = {text}")
        name = self._factors[text]
        if self._is_number(piece):
            return name
        wide = f"in_lanes({name})"
        if wide not in self._factors:
            self._factors[wide] = f"{name}_w"
            self.lines.append(f"{name}_w = {wide}")
        return f"{name}_w"

    def _text(self, batch: Batch, i: int, key: tuple[int, str]) -> str:
        """Source of row i of a partial derivative; ``key`` identifies the batch and the variable or parameter."""
        if batch.numbers is not None:
            return repr(float(batch.numbers[i]))
        if batch.of_parameters:
            if key not in self._places:
                self._places[key] = self.layout.size + self.n_coefficients
                self.coefficients.append(batch)
                self.n_coefficients += len(batch)
            return f"data[{self._places[key] + i}]"
        return expression(
            batch, i, lambda a: f"v{int(batch.arguments[i, a])}", lambda a: f"data[{int(batch.parameters[i, a])}]",
            lambda a: f"data[{self.layout.relations + int(batch.relations[i, a])}]",
        )  # fmt: skip

    def _of_row(self, batch: Batch, i: int) -> list[tuple[str, str]]:
        terms = []
        for a in batch.active:
            slot = int(batch.arguments[i, a])
            if batch.argument_signs[i, a] and slot in self._tangents:
                terms.append((self._text(batch.derivative(a), i, (id(batch), f"x{a}")), f"d{slot}"))
        return [term for term in [*terms, *self._of_parameters(batch, i)] if term[0] not in ("0.0", "-0.0")]

    def _of_parameters(self, batch: Batch, i: int) -> Iterator[tuple[str, str]]:
        for q in range(batch.parameters.shape[1]):
            p = int(batch.parameters[i, q])
            if p in self._row:
                yield self._text(batch.parameter_derivative(q), i, (id(batch), f"p{q}")), f"w{p}"

    def _multiplied(self, step: Linear, block: int) -> None:
        """The tangents of a linear block: its solution matrix times the tangents of the known slots."""
        at, width = self.layout.solutions[block], len(step.known)
        for i, row in enumerate(self.layout.needed[block]):
            known = [(j, slot) for j, slot in enumerate(step.known.tolist()) if slot in self._tangents]
            self._set(int(step.unknowns[row]), [(f"data[{at + i * width + j}]", f"d{slot}") for j, slot in known])

    def _implicit(self, step: Linear, base: int) -> None:
        """A linear block whose matrix depends on parameters: dz = -inverse(A) (dA z + dg); dA z + dg as slots from ``base`` on."""
        solved, equations, at = self._inverses[id(step)]
        n = len(step.unknowns)
        right: dict[int, list[tuple[str, str]]] = {e: [] for e in equations}
        for slot, row in zip(step.known.tolist(), step.known_rows.tolist(), strict=True):
            if slot in self._tangents:
                right[row].append(("1.0", f"d{slot}"))
        for batch in step.matrix:
            for i, target in enumerate(batch.targets.tolist()):
                row, column = divmod(target, n)
                z = f"v{int(step.unknowns[column])}"
                right.setdefault(row, []).extend(
                    (f"({text}) * {z}", of) for text, of in self._of_parameters(batch, i) if text != "0.0"
                )
        for e in equations:
            self._set(base + e, right[e])
        for i, row in enumerate(solved.rows.tolist()):
            self._set(
                int(step.unknowns[row]),
                [(f"(-data[{at + i * len(equations) + j}])", f"d{base + e}") for j, e in enumerate(equations)],
            )
