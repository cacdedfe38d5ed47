"""Linear time-invariant form of a scene and its inputs: x' = A x + B u(t)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from weakref import ref

import numpy as np
import sympy
from numpy.typing import NDArray

from gearlib.equations.kernel import Kernel, rest_of
from gearlib.equations.template import Relation
from gearlib.errors import SingularError
from gearlib.program.derivative_plan import DerivativePlan, Solved, derivative_plan
from gearlib.program.derivatives import At, entries
from gearlib.program.interpret import Prepared, constant_values, owner_of
from gearlib.program.program import Batch, Program
from gearlib.program.scalars import linear_function
from gearlib.run.scene import Scene
from gearlib.solvers.inputs.table import Table
from gearlib.solvers.problem import LinearForm

Floats = NDArray[np.float64]
TIME: Any = sympy.Symbol("time", real=True)
# States up to which A is dense, with entries from generated scalar code: a quarter of the time of arrays at 59 states, half of it at 119,
# for about 10 ms of code generation once per structure (measured); larger ones are sparse
MOST_WRITTEN = 60


@dataclass(eq=False)
class LinearPlan:
    """The parts of a scene's linear form that do not depend on numbers, and the most recent forms (caches)."""

    seeds: list[tuple[Batch, int]]
    added: list[int]
    derivatives: DerivativePlan  # of the rates with respect to states, inputs, and perturbations of slots
    written: Any  # generated scalar function for these derivatives, or None
    slots: NDArray[np.int64]  # parameters in the driving expressions
    last: tuple[Any, ...] = ()  # key, inputs, mix
    form: tuple[Any, ...] = ()  # numbers, key, the linear form, mix
    changed: tuple[Any, ...] = ()  # the linear form, key of the directions, the form with its derivatives
    known: dict[Any, Any] = field(default_factory=dict)  # see `LinearForm`


def linear_plan(scene: Scene) -> LinearPlan:
    if "linear" not in scene.forms:
        program = scene.program
        seeds = affine_seeds(program)
        added = [int(batch.targets[i]) for batch, i in seeds]
        entering = [(slot, k) for k, slot in enumerate([*range(len(program.states) + len(program.inputs)), *added])]
        derivatives = derivative_plan(program, entering, program.output_slots)
        written = linear_function(program, derivatives) if len(scene.states) < MOST_WRITTEN else None
        scene.forms["linear"] = LinearPlan(seeds, added, derivatives, written, _slots_of(scene, seeds))
    found: LinearPlan = scene.forms["linear"]
    return found


def _slots_of(scene: Scene, seeds: Sequence[tuple[Batch, int]]) -> NDArray[np.int64]:
    """The parameters in the equations of some rows of batches, sorted."""
    return np.unique(np.array([p for seed in seeds for p in parameter_slots(scene, *seed).values()], np.int64))


def linear_form(scene: Scene, numbers: Prepared, signals: Sequence[Any]) -> LinearForm | str:
    """The linear form of a scene, or the reason why it has none.

    Parameters
    ----------
    scene : Scene
    numbers : Prepared
    signals : sequence
        The unbound inputs: numbers, tables or functions of time.
    """
    found = mixed_form(scene, numbers, signals)
    return found if isinstance(found, str) else found[0]


def mixed_form(scene: Scene, numbers: Prepared, signals: Sequence[Any]) -> tuple[LinearForm, Floats] | str:
    """The linear form of a scene, and the weights of its inputs in the program's inputs and driving terms; or why it has none."""
    program = scene.program
    if not program.is_linear:
        return "the equations are not linear with constant coefficients"
    if scene.relations is not None and not (scene.relations.on_time.all() and not scene.relations.discretes):
        return "relations between variables make events"
    if any(callable(s) and not isinstance(s, Table) for s in signals):
        return "an input is a Python function"
    if any(isinstance(s, Table) and not s.straight for s in signals):
        return "an input is a table of cubics"
    plan = linear_plan(scene)
    key = (numbers.parameters[plan.slots].tobytes(), tuple(s if not callable(s) else id(s) for s in signals))
    known, last = plan.form, plan.last  # other threads may replace them meanwhile
    if known and known[0]() is numbers and known[1] == key:
        return known[2], known[3]
    if last[:1] != (key,):
        last = plan.last = (key, *_drives(scene, numbers, signals, plan))
    inputs, mix = last[1:]
    form = LinearForm(*_matrices(scene, numbers, plan, mix), inputs, known=plan.known)
    plan.form = (ref(numbers), key, form, mix)
    return form, mix


@dataclass(frozen=True, eq=False)
class LinearForms:
    """Linear forms of many runs of a scene, with inputs in common.

    Attributes
    ----------
    inputs : tuple
        Tables, expressions of time, and finally the constant 1, whose column of B differs between runs.
    matrix : array, shape (states, states)
        A of one of the runs.
    tables : tuple of int
        Unbound inputs that are tables.
    moving : tuple of int
        Driving terms that depend on time, as indices of `LinearPlan.seeds`.
    slots, values : arrays
        Parameters in the moving terms, and the values that all runs must have for these.
    """

    scene: Scene
    inputs: tuple[Any, ...]
    matrix: Floats
    tables: tuple[int, ...]
    moving: tuple[int, ...]
    slots: NDArray[np.int64]
    values: Floats

    def alike(self, parameters: Floats) -> NDArray[np.bool_]:
        """Mask of the runs that have these inputs; ``parameters`` has the shape (parameters, runs)."""
        return np.asarray((parameters[self.slots] == self.values[:, None]).all(axis=0))

    def of_runs(self, parameters: Floats, solutions: Sequence[Floats], numbers: Floats) -> tuple[Floats, Floats]:
        """A, shape (runs, states, states), and B, shape (runs, states, inputs).

        Parameters
        ----------
        parameters : array, shape (parameters, runs)
        solutions : sequence of arrays, shape (runs, unknowns, known)
            Of the linear blocks.
        numbers : array, shape (inputs, runs)
            Of the scene's program: zero where an input is a table.
        """
        scene, plan, runs = self.scene, linear_plan(self.scene), parameters.shape[1]
        program, table = scene.program, plan.derivatives
        n, m = len(program.states), len(program.inputs)
        points = At(
            Prepared(program, scene.structure, parameters, tuple(solutions)),
            np.zeros(runs), np.zeros((program.n_slots, runs)), np.zeros((scene.n_discrete, runs)),
        )  # fmt: skip
        full = np.zeros((runs, n, n + m + len(plan.added)))
        full[:, table.rows, table.seeds] = entries(table, points).T
        constants = np.zeros((m + len(plan.added), runs))
        constants[:m] = numbers
        rows = _constants(plan, parameters)
        for k, (batch, i) in enumerate(plan.seeds):
            if k not in self.moving:
                constants[m + k] = rows[id(batch)][i]
        one = np.einsum("rnm,mr->rn", full[:, :, n:], constants)
        common = [n + k for k in self.tables] + [n + m + k for k in self.moving]
        return full[:, :, :n], np.concatenate([full[:, :, common], one[:, :, None]], axis=2)


def linear_forms(scene: Scene, numbers: Prepared, signals: Sequence[Any]) -> LinearForms | str:
    """The linear forms of runs that differ in numbers, or the reason why there are none; arguments as for `linear_form`, of one run."""
    form = linear_form(scene, numbers, signals)
    if isinstance(form, str):
        return form
    plan = linear_plan(scene)
    if any(isinstance(step, Solved) and step.implicit for step in plan.derivatives.steps):
        return "equations that are solved together depend on what they determine"
    tables = tuple(k for k, s in enumerate(signals) if isinstance(s, Table))
    moving = tuple(k for k, (batch, _) in enumerate(plan.seeds) if not batch.rest.of_parameters)
    slots = _slots_of(scene, [plan.seeds[k] for k in moving])
    drives = [driving_expression(scene, *plan.seeds[k], numbers.parameters) for k in moving]
    matrix = form.A if isinstance(form.A, np.ndarray) else form.A.toarray()
    inputs = (*(signals[k] for k in tables), *drives, sympy.Integer(1))
    return LinearForms(scene, inputs, matrix, tables, moving, slots, numbers.parameters[slots])


def _drives(scene: Scene, numbers: Prepared, signals: Sequence[Any], plan: LinearPlan) -> tuple[tuple[Any, ...], Floats]:
    """The inputs of the form as expressions, and their weights in the program's inputs and driving terms."""
    m = len(scene.program.inputs)
    values = numbers.parameters
    fixed = _constants(plan, values)
    if not all(np.isfinite(terms).all() for terms in fixed.values()):
        raise not_finite(scene, numbers)
    expressions = [fixed[id(b)][i] if id(b) in fixed else driving_expression(scene, b, i, values) for b, i in plan.seeds]
    constant = [k for k, e in enumerate(expressions) if isinstance(e, float) or e.is_number]
    moving = sorted({*range(len(expressions))} - {*constant})
    inputs = [s if isinstance(s, Table) else sympy.Float(float(s), 17) for s in signals]
    inputs += [sympy.Integer(0)] * (m - len(inputs)) + [expressions[k] for k in moving]
    rows = [*range(m), *(m + k for k in moving), *(m + k for k in constant)]
    columns = [*range(m + len(moving)), *[m + len(moving)] * len(constant)]
    shares = [*[1.0] * (m + len(moving)), *(float(expressions[k]) for k in constant)]
    if constant:
        inputs.append(sympy.Integer(1))
    mix = np.zeros((m + len(plan.added), len(inputs)))
    mix[rows, columns] = shares
    return tuple(inputs), mix


def _constants(plan: LinearPlan, parameters: Floats) -> dict[int, Floats]:
    """By batch, the driving terms that are constant during a run; parameters of one run, or (parameters, runs)."""
    rests = {key: batch.rest for key, batch in {id(batch): batch for batch, _ in plan.seeds}.items()}
    return {key: constant_values(rest, parameters) + 0.0 for key, rest in rests.items() if rest.of_parameters}  # no -0.0


def _matrices(scene: Scene, numbers: Prepared, plan: LinearPlan, mix: Floats) -> tuple[Any, Floats]:
    """A (dense, or sparse if it is large) and B of the linear form."""
    program, table = scene.program, plan.derivatives
    n = len(program.states)
    if plan.written is not None:
        try:
            written = plan.written(numbers.parameters.tolist(), numbers.listed)
        except (ArithmeticError, ValueError):
            raise not_finite(scene, numbers) from None
        full = np.zeros((n, n + len(mix)))
        full[table.rows, table.seeds] = written
        return full[:, :n], full[:, n:] @ mix
    nowhere = At(numbers, np.zeros(1), np.zeros((program.n_slots, 1)), np.zeros((scene.n_discrete, 1)))
    values = entries(table, nowhere)[:, 0]
    if not np.isfinite(values).all():
        raise not_finite(scene, numbers)
    return _sparse(values, table, n, mix)


def _sparse(values: Floats, plan: DerivativePlan, n: int, mix: Floats) -> tuple[Any, Floats]:
    """A (sparse) and B from the entries of a plan."""
    from scipy.sparse import csr_array

    inner = plan.seeds < n
    starts = np.concatenate([[0], np.cumsum(np.bincount(plan.rows[inner], minlength=n))])
    A = csr_array((values[inner], plan.seeds[inner], starts), shape=(n, n))
    seeds = plan.seeds[~inner] - n
    column = np.abs(mix).argmax(axis=1)[seeds]  # each goes into one column
    places, width = plan.rows[~inner] * mix.shape[1] + column, mix.shape[1]
    B = np.asarray(np.bincount(places, values[~inner] * mix[seeds, column], n * width), float)
    return A, B.reshape(n, width)


def not_finite(scene: Scene, numbers: Prepared) -> SingularError:
    """The error that names an equation with a coefficient that cannot be evaluated, and its parameters."""
    for step in (s for s in scene.program.steps if isinstance(s, Batch)):
        for a in step.active:
            bad = np.flatnonzero(~np.isfinite(constant_values(step.derivative(a), numbers.parameters)))
            if len(bad):
                i = int(bad[0])
                names = ", ".join(f"{scene.model.parameters.names[p]} = {numbers.parameters[p]:g}" for p in step.parameters[i])
                owner = owner_of(scene.structure, int(step.equations[i]))
                return SingularError(f"{owner}: {step.kernel.template.label} cannot be evaluated with {names}")
    return SingularError("the linear equations cannot be evaluated with these parameters: something is divided by zero")


def affine_seeds(program: Program) -> list[tuple[Batch, int]]:
    """Rows of batches that are not homogeneous: the driving terms of a linear program."""
    driving = [step for step in program.steps if isinstance(step, Batch) and not rest_of(step.kernel).is_zero]
    return [(step, i) for step in driving for i in range(len(step))]


def driving_expression(scene: Scene, batch: Batch, row: int, parameters: Floats) -> Any:
    """The inhomogeneous term of a batch's row, as an expression of time with numbers."""
    return int(batch.signs[row]) * of_time(rest_of(batch.kernel), parameter_values(scene, batch, row, parameters))


def parameter_slots(scene: Scene, batch: Batch, row: int) -> dict[str, int]:
    """The parameters in the equation of a batch's row: entries of the parameter table, by their names there."""
    g, i = scene.model.places[int(batch.equations[row])]
    group = scene.model.groups[g]
    return dict(zip(group.template.parameters, group.parameters[i].tolist(), strict=True))


def parameter_values(scene: Scene, batch: Batch, row: int, parameters: Floats) -> dict[str, Any]:
    """The values of the parameters in the equation of a batch's row, by their names there."""
    return {name: sympy.Float(parameters[slot], 17) for name, slot in parameter_slots(scene, batch, row).items()}


def of_time(kernel: Kernel, value: Mapping[str, Any]) -> Any:
    """A kernel without columns as an expression of time, with numbers for its parameters."""
    template = kernel.template
    table: dict[Any, Any] = {sympy.Symbol("t", real=True): TIME}
    table |= {sympy.Symbol(f"p{k}", real=True): value[name] for k, name in enumerate(template.parameters)}
    by_name = {sympy.Symbol(name, real=True): v for name, v in value.items()}
    for r in kernel.relations:
        flag = sympy.Ne(sympy.Symbol(f"r{r}", real=True), 0)
        table[flag] = _condition(template.relations[r]).xreplace(by_name)
    return kernel.expression.xreplace(table)


def _condition(relation: Relation) -> Any:
    zero = sympy.S.Zero
    if relation.negated:
        return relation.g < zero if relation.strict else relation.g <= zero
    return relation.g > zero if relation.strict else relation.g >= zero
