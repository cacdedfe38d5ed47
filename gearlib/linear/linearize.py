"""Linearisation of a scene by exact partial derivatives (no finite differences)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import name_list
from gearlib.errors import ArgumentError, InputWarning, NameLookupError, SolverError, nearest, warn
from gearlib.flatten.model import FlatModel
from gearlib.linear.condition import conditions, frozen
from gearlib.linear.held_states import remaining
from gearlib.linear.linear_model import LinearModel, Matrices
from gearlib.linear.linearized_program import LinearizedProgram
from gearlib.linear.operating_point import Point, fitting, operating_point
from gearlib.program.build import build
from gearlib.program.derivatives import undetermined
from gearlib.program.interpret import prepare
from gearlib.program.program import Program
from gearlib.reduce.coefficients import some
from gearlib.run.scene import Scene, needed_states, node_name
from gearlib.run.translation import Translation

Floats = NDArray[np.float64]
NEGLIGIBLE = 1e-12  # rounding error of an undetermined value without effect


def input_names(model: FlatModel) -> list[str]:
    """Paths of all possible inputs of a linear model: unbound inputs, and bound ones."""
    unbound = [model.name(int(v)) for v in model.inputs]
    bound = []
    for group in model.groups:
        if group.template.binds:
            j = group.template.locals.index("bound")
            bound += [model.name(int(v)) for v in group.variables[:, j]]
    return unbound + bound


def states_of_outputs(translation: Translation) -> list[str]:
    """The states of the linear model that is asked for no outputs in particular."""
    chosen = translation.states if translation.outputs is None else translation.outputs
    structure = translation.structure
    return [node_name(structure.model, s) for s in needed_states(structure, translation.nodes(chosen))]


def linearized(
    translation: Translation, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None, at: Any = None,
    parameters: Mapping[str, float] | None = None, worded: bool = True,
) -> LinearModel:  # fmt: skip
    """Linear model of a translation; arguments as for `System.linearize`. ``worded``: also determine its conditions."""
    translation = fitting(translation, at, parameters)
    default = translation.states if translation.outputs is None else translation.outputs
    chosen_inputs = name_list("inputs", translation.inputs if inputs is None else inputs, "torque.tau")
    chosen = name_list("outputs", default if outputs is None else outputs, "load.w")
    nodes = translation.nodes(chosen)
    states = needed_states(translation.structure, nodes)
    scene, numbers, point = operating_point(translation, states, at, parameters, outputs=nodes)
    model = linearize(scene, numbers, chosen_inputs, chosen, point, worded)
    if inputs is not None:
        _warn_of_unread(translation, chosen_inputs)
    return model


def read_by_equations(model: FlatModel) -> frozenset[int]:
    """Variables in some equation other than the binding of an input that occurs in no other equation."""
    bound: dict[int, set[int]] = {}  # the variables of each input's own binding
    read: set[int] = set()
    for group in [*model.groups, *(u.equations for u in model.updates)]:
        used = group.signs != 0
        if not group.template.binds:
            read.update(group.variables[used].tolist())
            continue
        j = group.template.locals.index("bound")
        for row, mask in zip(group.variables, used, strict=True):
            bound.setdefault(int(row[j]), set()).update(row[mask].tolist())
    waiting = [v for v in bound if v in read]
    while waiting:
        v = waiting.pop()
        waiting += [w for w in bound[v] if w in bound and w not in read]
        read |= bound[v]
    return frozenset(read)


def _warn_of_unread(translation: Translation, inputs: Sequence[str]) -> None:
    """Warn of inputs without any effect, since they enter no equation."""
    model = translation.model
    read = read_by_equations(model)

    def is_read(name: str) -> bool:
        return int(model.representative[model.variable(name)]) in read

    for name in inputs:
        if is_read(name):
            continue
        path, _, local = name.rpartition(".")
        inside = f"{path}." if path else ""
        others = [
            n for n in input_names(model) if n.startswith(inside) and n.endswith(f".{local}") and n != name and is_read(n)
        ]
        instead = f"; the equations contain {some(others, ', ')}, whose values do not come from it" if others else ""
        warn(f"{translation.name}: no equation contains the input {name}, and nothing responds to it{instead}", InputWarning)


def linearize(
    whole_scene: Scene, parameters: Floats, inputs: Sequence[str], outputs: Sequence[str], point: Point, worded: bool = True
) -> LinearModel:
    """Linear model from ``inputs`` to ``outputs``, with the states that these need except held ones.

    Raises
    ------
    NameLookupError
        An input or output that the model does not have.
    ArgumentError
        An output depends on the derivative of an input.
    """
    structure, model = whole_scene.structure, whole_scene.model
    targets, signs = [], []
    for name in outputs:
        base, order = model.column(name)
        variable = model.variable(base, "output")
        targets.append((int(model.representative[variable]), order))
        signs.append(int(model.sign[variable]))
    needed = [t for t, sign in zip(targets, signs, strict=True) if sign]  # the others are identically zero
    states = needed_states(structure, needed)
    scene = Scene(structure, states)
    program = build(structure, needed, states, dynamic=True)
    prepared = prepare(program, structure, parameters)
    signals = _Signals.of(program, model, inputs, outputs)
    wanted = [*(program.slots[v, k + 1] for v, k in states), *(program.slots.get(t, 0) for t in targets)]
    seeds, added = (*range(len(states)), *signals.seeds), tuple((slot, i, 1.0) for i, slot in enumerate(signals.added))
    at = LinearizedProgram(scene, prepared, point, seeds, added, tuple(wanted))
    slots, discrete = at.slots, at.discrete
    n, sign_out = len(states), np.array(signs, float)
    refuse_undetermined(at)
    refuse_infinite([*(node_name(model, (v, k + 1)) for v, k in states), *outputs], at.derivatives)
    whole = signals.matrices(at.derivatives, n, sign_out)
    A, B, C, names = whole.A, whole.B, whole.C, tuple(node_name(model, s) for s in states)
    left = remaining(structure, prepared, point.t, slots, discrete, A, B)
    if left is None:
        at.warn_of_corners(list(range(len(wanted))))
    else:
        at.warn_of_corners([*left.keep, *range(n, len(wanted))], left.basis)
        A, B, C = A[left.keep] @ left.basis, B[left.keep], C @ left.basis
        names = tuple(names[i] for i in left.keep)

    def changes(parameters: Sequence[str]) -> list[Matrices]:
        return [signals.matrices(change, n, sign_out) for change in at.changes(parameters, wanted)]

    said = (*conditions(whole_scene, parameters, point).said, *frozen(at, range(len(wanted)), needed)) if worded else ()
    return LinearModel(A, B, C, whole.D, names, tuple(inputs), tuple(outputs), said, whole, changes)


@dataclass(frozen=True, eq=False)
class _Signals:
    """Positions at which the inputs enter a program.

    Attributes
    ----------
    seeds, added : tuples of int
        Slots of inputs, and computed slots to which a perturbation is added.
    columns : tuple of int
        Per input: the column of the derivatives behind those of the states, -1 if nothing depends on it.
    scale : array
    """

    seeds: tuple[int, ...]
    added: tuple[int, ...]
    columns: tuple[int, ...]
    scale: Floats

    @classmethod
    def of(cls, program: Program, model: FlatModel, inputs: Sequence[str], outputs: Sequence[str]) -> _Signals:
        seeds: list[int] = []
        added: list[int] = []
        scale: list[float] = []
        position: list[tuple[str, int]] = []
        for name in inputs:
            variable = _input(model, name)
            node, sign = (int(model.representative[variable]), 0), int(model.sign[variable])
            _refuse_derivatives(program, node[0], name, outputs)
            slot = program.slots.get(node)
            scale.append(float(sign))
            if slot is None:
                position.append(("none", 0))
            elif node in program.inputs:
                position.append(("seed", len(seeds)))
                seeds.append(slot)
            else:
                position.append(("added", len(added)))
                added.append(slot)
        columns = tuple({"seed": i, "added": len(seeds) + i, "none": -1}[kind] for kind, i in position)
        return cls(tuple(seeds), tuple(added), columns, np.array(scale))

    def matrices(self, d: Any, n: int, sign_out: Floats) -> Matrices:
        """A, B, C, D from the derivatives of n rates and the outputs with respect to n states and the inputs."""
        rates, rows = d[:n], d[n:]
        full = isinstance(d, np.ndarray)
        columns = [c if c < 0 else n + c for c in self.columns]
        B, D = _columns(rates, columns, self.scale, full), _columns(rows, columns, self.scale, full)
        if full:
            return Matrices(rates[:, :n], B, sign_out[:, None] * rows[:, :n], sign_out[:, None] * D)
        import scipy.sparse as sparse

        return Matrices(rates[:, :n], B, sparse.diags(sign_out) @ rows[:, :n], sparse.diags(sign_out) @ D)


def refuse_undetermined(at: LinearizedProgram) -> None:
    """Refuse rates that the equations leave undetermined; torques that locked elements share arbitrarily do no harm."""
    wanted = [(v, k + 1) for v, k in at.scene.states]
    open_ = undetermined(at.prepared, at.point.t, at.slots, at.discrete)
    rows = open_[[at.prepared.program.slots[node] for node in wanted]]
    if not rows.size:
        return
    bad = np.flatnonzero(np.abs(rows).max(axis=1, initial=0.0) > NEGLIGIBLE * np.abs(open_).max(initial=0.0))
    if len(bad):
        raise SolverError(
            f"there is no linear model at this point: {node_name(at.scene.model, wanted[int(bad[0])])} is not determined there, nothing "
            "says how fast it moves; give inertia to what nothing moves, or another point (at=...)"
        )


def refuse_infinite(names: Sequence[str], slopes: Any) -> None:
    """Refuse rates and outputs, the rows of a matrix of derivatives, that have no slope."""
    bad = np.flatnonzero(~np.isfinite(np.asarray(abs(slopes).sum(axis=1)).ravel()))
    if len(bad):
        raise SolverError(
            f"there is no linear model at this point: the slope of {names[int(bad[0])]} is not finite there, as that of sqrt(x) where x "
            "is 0; take a point beside it (at=...)"
        )


def _input(model: FlatModel, name: str) -> int:
    valid = input_names(model)
    variable = model.find(name)
    known = {int(model.representative[model.variable(v)]) for v in valid}
    if variable is None or (name not in valid and int(model.representative[variable]) not in known):
        raise NameLookupError(f"the model has no input '{name}'; {nearest(name, valid)}")
    return variable


def _refuse_derivatives(program: Program, variable: int, name: str, outputs: Sequence[str]) -> None:
    """Refuse inputs whose derivatives a program uses, where a constraint on the input was differentiated."""
    if any(v == variable and k for v, k in program.slots):
        raise ArgumentError(
            f"the outputs {', '.join(outputs[:6])} need the derivative of the input {name}, for which dx/dt = A x + B u, y = C x + D u "
            "has no place; take other outputs, or let the motion follow the input through a filter"
        )


def _columns(matrix: Any, columns: Sequence[int], scale: Floats, full: bool) -> Any:
    if full:
        result = np.zeros((matrix.shape[0], len(columns)))
        for i, c in enumerate(columns):
            if c >= 0:
                result[:, i] = scale[i] * matrix[:, c]
        return result
    import scipy.sparse as sparse

    parts = [scale[i] * matrix[:, [c]] if c >= 0 else sparse.csr_matrix((matrix.shape[0], 1)) for i, c in enumerate(columns)]
    return sparse.hstack(parts).tocsr() if parts else sparse.csr_matrix((matrix.shape[0], 0))
