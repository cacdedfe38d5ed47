"""Parameter values at which a pivotal coefficient vanishes; there the equations are translated without it.

A body without inertia has no acceleration of its own to compute: ``J der(w) = tau_a + tau_b`` with ``J = 0`` says that its torques
cancel. A gear's support has the coefficient ``1 - ratio``, and drops out of its equation where the ratio is 1. The matching of
equations to unknowns then changes, so the model is translated again without the coefficient. Other zeros (the damping of a spring
between bodies) change nothing, and cost nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearlib.equations.kernel import Kernel, partial_kernel
from gearlib.errors import SingularError
from gearlib.flatten.model import FlatModel, Floats, Integers
from gearlib.flatten.specialise import Special
from gearlib.program.interpret import constant_values
from gearlib.program.program import Newton, Program
from gearlib.run.scene import Scene

# Coefficients such as ``1 - ratio``, with their parameters: one row per argument of the kernel, one column per equation
Sums = tuple[tuple[Kernel, Integers], ...]


def factors(model: FlatModel) -> Integers:
    """Parameters that multiply a variable of some equation."""
    groups = [(group, [name in group.template.factors for name in group.template.parameters]) for group in model.groups]
    return np.unique(
        np.concatenate([np.empty(0, np.int64), *(group.parameters[:, factor].ravel() for group, factor in groups)])
    )


def sums(model: FlatModel) -> Sums:
    """Constant coefficients that are sums, which may cancel."""
    kernels = [(group, partial_kernel(group.template, c)) for group in model.groups for c in group.template.cancelling]
    return tuple((kernel, group.parameters[:, list(kernel.parameters)].T) for group, kernel in kernels)


def special_values(multiplied: Integers, added: Sums, parameters: Floats) -> Special:
    """The parameters, with their values, at which a coefficient vanishes: a factor or a sum."""
    values = parameters[multiplied]
    zero = set() if values.all() else set(multiplied[values == 0.0].tolist())
    found = {(p, 0.0) for p in zero}
    for kernel, places in added:
        with np.errstate(all="ignore"):
            cancelled = np.flatnonzero(kernel.function(0.0, *parameters[places]) == 0.0)
        for column in cancelled.tolist():
            involved = places[:, column].tolist()
            if zero.isdisjoint(involved):
                found.update((p, float(parameters[p])) for p in involved)
    return frozenset(found)


def nothing_special(multiplied: Integers, added: Sums, parameters: Floats) -> NDArray[np.bool_]:
    """Mask of the runs without `special_values`; ``parameters`` has the shape (parameters, runs)."""
    ordinary: NDArray[np.bool_] = (parameters[multiplied] != 0.0).all(axis=0)
    for kernel, places in added:
        with np.errstate(all="ignore"):
            ordinary &= (np.asarray(kernel.function(0.0, *parameters[places])) != 0.0).all(axis=0)
    return ordinary


def can_be_solved(scene: Scene, parameters: Floats) -> bool:
    """Whether no divisor is zero, as far as this is known before a run."""
    try:
        numbers = scene.numbers(parameters)
    except SingularError:
        return False
    programs = [numbers.program, *([] if numbers.relations is None else [numbers.relations.program])]
    return not any(_vanishes(program, parameters) for program in programs)


def _vanishes(program: Program, parameters: Floats) -> bool:
    """Whether a constant coefficient vanishes in equations whose matrix varies during a run."""
    for step in program.steps:
        for batch in step.jacobian if isinstance(step, Newton) else ():
            kernel = batch.kernel
            if kernel.parameters and not (kernel.columns or kernel.relations or kernel.on_time):
                if not constant_values(batch, parameters).all():
                    return True
    return False
