"""`LinearModel`: named state-space matrices, with conversion to and from python-control."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import ArgumentError
from gearlib.run.subject import described

Floats = NDArray[np.float64]
# States from which a frequency is solved for with sparse matrices, and largest share of entries that are not zero. Measured on elastic
# chains: equal times at 75 states, a sixth at 200, a twentieth at 400. With a tenth of the entries, factors fill up.
MOST_DENSE, MOST_FILLED = 80, 0.1


@dataclass(frozen=True, eq=False)
class Matrices:
    """State-space matrices A, B, C, D; or their derivatives with respect to a parameter."""

    A: Any
    B: Any
    C: Any
    D: Any


@dataclass(frozen=True, eq=False)
class LinearModel:
    """dx/dt = A x + B u, y = C x + D u about an operating point; matrices are arrays, or sparse where these would be large.

    ``conditions`` describes the operating point in words, such as "open: mesh m" or "sliding: clutch c". ``whole`` holds the matrices
    before the elimination of held states, and ``changes`` their derivatives with respect to parameters, by path; both are None for a
    model that was not derived from a system.
    """

    A: Any
    B: Any
    C: Any
    D: Any
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    conditions: tuple[str, ...] = ()
    whole: Matrices | None = field(default=None, repr=False)
    changes: Callable[[Sequence[str]], list[Matrices]] | None = field(default=None, repr=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the numbers only, without the reference to the system."""
        return LinearModel, (self.A, self.B, self.C, self.D, self.states, self.inputs, self.outputs, self.conditions)


def label(name: str) -> str:
    """A signal name that python-control accepts: ``torque.tau`` becomes ``torque_tau``.

    >>> label("shaft[2].tau")
    'shaft[2]_tau'
    """
    return name.replace(".", "_")


def state_space(model: LinearModel, name: str | None = None) -> Any:
    """Convert to a ``control.StateSpace``; inputs and outputs are named by their paths with "_" for ".", states by their paths.

    Raises
    ------
    ArgumentError
        Two signals that would have one name.
    """
    import control

    for what, names in (("input", model.inputs), ("output", model.outputs)):
        first: dict[str, str] = {}
        for path in names:
            if label(path) in first:
                other = first[label(path)]
                alike = f"the {what}s {other} and {path} both become '{label(path)}' in python-control; sparse=True keeps paths"
                raise ArgumentError(f"the {what} {path} is named twice" if other == path else alike)
            first[label(path)] = path
    B, D = full(model.B), full(model.D)
    if not model.inputs:  # python-control supports such models in some shapes only: add an input and remove it afterwards
        B, D = np.zeros((len(model.states), 1)), np.zeros((len(model.outputs), 1))
    result = control.ss(
        full(model.A), B, full(model.C), D, states=list(model.states), name=name,
        inputs=[label(n) for n in model.inputs] or ["none"], outputs=[label(n) for n in model.outputs],
        remove_useless_states=False,
    )  # fmt: skip
    if not model.inputs:
        result.B, result.D = B[:, :0], D[:, :0]
        result.set_inputs([])
    return result


def check_linear(model: Any) -> None:
    """Raise `ArgumentError` for anything but a linear model in continuous time."""
    if isinstance(model, LinearModel):
        return
    import control

    if not isinstance(model, (control.StateSpace, control.TransferFunction)):
        raise ArgumentError(f"expected a System, StateSpace, TransferFunction or LinearModel, got {described(model)}")
    if model.dt:
        raise ArgumentError("the model is a sampled one; expected one in continuous time")


def matrices(model: Any) -> tuple[Floats, Floats, Floats, Floats, list[str], list[str]]:
    """A, B, C, D as dense arrays, and the names of inputs and outputs."""
    check_linear(model)
    if not hasattr(model, "A"):
        import control

        model = control.ss(model)
    return full(model.A), full(model.B), full(model.C), full(model.D), *signal_names(model)


def full(matrix: Any) -> Floats:
    """A matrix with all its entries, which may be sparse."""
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix, float)


def is_sparse(A: Any) -> bool:
    """Whether equations with ``s I - A`` are solved faster by a sparse factorisation than by a dense one."""
    n = A.shape[0]
    return bool(n > MOST_DENSE and (A.nnz if hasattr(A, "nnz") else np.count_nonzero(A)) < MOST_FILLED * n**2)


def signal_names(model: Any) -> tuple[list[str], list[str]]:
    """Names of the inputs and outputs of a state space model."""
    inputs = list(getattr(model, "input_labels", None) or model.inputs)
    outputs = list(getattr(model, "output_labels", None) or model.outputs)
    return inputs, outputs
