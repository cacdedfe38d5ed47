"""Code generation for runs in lanes: the right-hand side of several runs at once, and its numbers in each run.

Within a run most of a right-hand side is linear: speeds, deflections and torques follow from the states by factors that depend on
parameters only. So every quantity is carried as a linear form in the states, in the nonlinear quantities (a friction torque, the sine of
time) and the number 1. Coefficients that differ between runs are computed beforehand for all runs together; those that are the same in
all runs, most often 1 and -1, are literals in the source, which holds only what must be evaluated in every step.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from gearlib.compiler.object_code import CompiledFunction, compiled
from gearlib.equations.kernel import rest_of
from gearlib.native.lane_functions import FUNCTIONS
from gearlib.program.interpret import constant_values
from gearlib.program.program import Batch, Linear, Newton, Program
from gearlib.program.text import expression

Floats = NDArray[np.float64]
Form = dict[int, Floats | float]  # coefficients by slot: one number per run, or the same for all
ONE = -1  # in place of a slot: the constant term
HEAD = "def rhs(time: lanes, x: lanes, dx: lanes, data: lanes) -> int32:"


def why_scalar(program: Program) -> str | None:
    """Why a program cannot be computed in lanes, or None."""
    if any(isinstance(step, Newton) for step in program.steps):
        return "equations are solved by iteration"
    if program.guards:
        return "it is divided by what moves"
    if any(b.kernel.relations for b in program.steps if isinstance(b, Batch)):
        return "there are events"
    return None


@dataclass(frozen=True, eq=False)
class LaneCode:
    """A compiled right-hand side for lanes.

    Attributes
    ----------
    program : Program
    source : str
    kept : frozenset of int
        Slots with a statement of their own; the others are substituted where they are used.
    tables : tuple of int
        Inputs that are straight lines in time: the numbers begin with two for each, its value at time zero and its slope.
    """

    program: Program
    source: str
    kept: frozenset[int]
    tables: tuple[int, ...]
    function: CompiledFunction

    def numbers(self, parameters: Floats, inputs: Floats, solutions: Sequence[Floats]) -> Floats:
        """The numbers of runs, shape (runs, numbers).

        Parameters
        ----------
        parameters : array, shape (parameters, runs)
        inputs : array, shape (inputs, runs)
        solutions : sequence of arrays, shape (runs, unknowns, known)
            Of the linear blocks.
        """
        body = _LaneBody(self.program, parameters, inputs, solutions, self.kept, self.tables)
        found = np.empty((parameters.shape[1], len(body.numbers)))
        for column, number in zip(found.T, body.numbers, strict=True):
            column[:] = number
        return found


def lane_code(program: Program, n_parameters: int, tables: tuple[int, ...] = ()) -> LaneCode:
    """Compile a program for which `why_scalar` is None; the inputs ``tables`` are straight lines in time."""
    unknown = [
        np.ones((1, len(step.unknowns), len(step.known))) for step in program.steps if isinstance(step, Linear)
    ]  # any nonzero numbers: the source does not depend on their values
    given = np.ones((n_parameters, 1)), np.ones((len(program.inputs), 1)), unknown
    bodies = [_LaneBody(program, *given, kept, tables) for kept in (frozenset[int](), _shared(program))]
    body = min(bodies, key=lambda b: b.terms)
    functions = "".join(text for name, text in FUNCTIONS.items() if any(f"{name}(" in line for line in body.lines))
    source = functions + "\n".join([HEAD, *(f"    {line}" for line in body.lines), "    return 0", ""])
    return LaneCode(program, source, body.kept, tables, compiled(source, "rhs", fused=True))


def _shared(program: Program) -> frozenset[int]:
    """Slots that are used more than once."""
    uses: Counter[int] = Counter(program.output_slots.tolist())
    for step in program.steps:
        if isinstance(step, Batch):
            uses.update(step.arguments[step.argument_signs != 0].tolist())
        elif isinstance(step, Linear):
            uses.update(step.known.tolist() * len(step.unknowns))
    return frozenset(slot for slot, n in uses.items() if n > 1)


@dataclass
class _LaneBody:
    """Lines of a right-hand side under construction, with the numbers that they read from ``data``, in this order."""

    program: Program
    parameters: Floats
    inputs: Floats
    solutions: Sequence[Floats]
    kept: frozenset[int]
    tables: tuple[int, ...] = ()
    lines: list[str] = field(default_factory=list)
    of_time: list[str] = field(default_factory=list)
    numbers: list[Floats] = field(default_factory=list)
    terms: int = 0

    def __post_init__(self) -> None:
        program, n = self.program, len(self.program.states)
        self.forms: dict[int, Form] = {k: {k: 1.0} for k in range(n)}
        self.forms |= {n + k: {ONE: row} for k, row in enumerate(self.inputs)}
        self.forms |= {n + k: {n + k: 1.0} for k in self.tables}
        self.numbers = [np.zeros(1) for _ in range(2 * len(self.tables))]
        straight = [f"v{n + k} = data[{2 * j}] + t * data[{2 * j + 1}]" for j, k in enumerate(self.tables)]
        self._places: dict[int, int] = {}
        blocks = iter(self.solutions)
        with np.errstate(all="ignore"):
            for step in program.steps:
                if isinstance(step, Batch):
                    self._batch(step)
                elif isinstance(step, Linear):
                    self._block(step, next(blocks))
            for i, slot in enumerate(program.output_slots.tolist()):
                self.lines.append(f"dx[{i}] = {self._text(self.forms[slot])}")
        # functions of time only are called first, before states occupy registers that the calls would have to save
        self.lines[:0] = ["t = time[0]", *straight, *self.of_time, *(f"v{k} = x[{k}]" for k in range(n))]

    def _batch(self, batch: Batch) -> None:
        slopes = [batch.derivative(a) for a in range(len(batch.kernel.columns))]
        if not all(slope.of_parameters for slope in slopes):
            for i in range(len(batch)):
                self._computed(batch, i)
                self.forms[int(batch.targets[i])] = {int(batch.targets[i]): 1.0}
            return
        rest = batch.rest if not rest_of(batch.kernel).is_zero else None
        values = [self._constants(slope) for slope in slopes]
        constant = self._constants(rest) if rest is not None and rest.of_parameters else None
        for i in range(len(batch)):
            target, form = int(batch.targets[i]), Form()
            for a, value in enumerate(values):
                if batch.argument_signs[i, a]:
                    _add(form, self.forms[int(batch.arguments[i, a])], value[i])
            if constant is not None:
                _add(form, {ONE: 1.0}, constant[i])
            elif rest is not None:  # of time
                self._computed(rest, i)
                _add(form, {target: 1.0}, 1.0)
                self.forms[target] = form
                continue
            self._keep(target, form)

    def _block(self, step: Linear, solution: Floats) -> None:
        for i, unknown in enumerate(step.unknowns.tolist()):
            form = Form()
            for j, known in enumerate(step.known.tolist()):
                _add(form, self.forms[known], solution[:, i, j])
            self._keep(unknown, form)

    def _keep(self, slot: int, form: Form) -> None:
        if slot in self.kept and len(form) > 1:
            self.lines.append(f"v{slot} = {self._text(form)}")
            form = {slot: 1.0}
        self.forms[slot] = form

    def _constants(self, batch: Batch) -> Sequence[Floats | float]:
        """Values of a batch that depends on parameters only, by instance."""
        if batch.numbers is not None:
            found: list[float] = batch.numbers.tolist()
            return found
        return list(constant_values(batch, self.parameters))

    def _computed(self, batch: Batch, i: int) -> None:
        """A line that computes a nonlinear quantity, named by its slot."""
        target = int(batch.targets[i])
        arguments = {a: self._argument(target, a, self.forms[int(slot)]) for a, slot in enumerate(batch.arguments[i])}
        text = expression(
            batch, i, arguments.__getitem__, lambda a: self._parameter(int(batch.parameters[i, a])), lambda _: "0.0"
        )
        self.terms += batch.kernel.operations
        (self.lines if batch.kernel.columns else self.of_time).append(f"v{target} = {text}")

    def _argument(self, target: int, a: int, form: Form) -> str:
        (slot, number), *others = form.items() or [(ONE, 0.0)]
        if not others and slot != ONE and isinstance(number, float) and number == 1.0:
            return f"v{slot}"
        self.lines.append(f"a{target}_{a} = {self._text(form)}")
        return f"a{target}_{a}"

    def _parameter(self, p: int) -> str:
        if p not in self._places:
            self._places[p] = len(self.numbers)
            self.numbers.append(self.parameters[p])
        return f"data[{self._places[p]}]"

    def _text(self, form: Form) -> str:
        """Source of a linear form; its coefficients are appended to the numbers."""
        parts = []
        for slot, number in sorted(form.items(), key=itemgetter(0)):  # added in the order of computation
            self.terms += 1
            if isinstance(number, float):
                sign, size = ("-", -number) if number < 0.0 else ("+", number)
                factor = [] if size == 1.0 and slot != ONE else [repr(size)]
            else:
                sign, factor = "+", [f"data[{len(self.numbers)}]"]
                self.numbers.append(number)
            parts.append(f"{sign} {' * '.join(factor + ([] if slot == ONE else [f'v{slot}']))}")
        return " ".join(parts).removeprefix("+ ") or "0.0"


def _add(form: Form, other: Form, factor: Floats | float) -> None:
    """Add a multiple of another form; coefficients that are zero in every run are left out."""
    if isinstance(factor, float) and factor == 0.0:
        return
    for slot, number in other.items():
        product = factor * number
        form[slot] = form[slot] + product if slot in form else product
        if isinstance(form[slot], float) and form[slot] == 0.0:
            del form[slot]
