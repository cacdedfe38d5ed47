"""`gradient_of`: implements `Result.gradient`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import by_name, name_list, reals
from gearlib.errors import ArgumentError
from gearlib.run.energy.audit import Histories
from gearlib.run.request import Request
from gearlib.run.scene import Scene
from gearlib.run.tangents.adjoint import FEWEST, MOST_STATES, TIGHTEST, Adjoint
from gearlib.run.tangents.requested import CONTINUED, directions, refuse_form
from gearlib.run.translation import Translation
from gearlib.solvers.exponential.dense import balanced_norm
from gearlib.solvers.inputs.table import Table, values
from gearlib.structure.incidence import Node

Floats = NDArray[np.float64]
Run = Callable[[Translation, Request, Scene], Histories]
RADIANS = 3.0  # of the fastest motion that a step spans at first
MOST_AT_FIRST = 5000  # steps at first


def gradient_of(
    translation: Translation, request: Request, scene: Scene, times: Floats, weights: Any, names: Any, run: Run
) -> dict[str, float]:
    """The derivatives of a weighted sum of samples; arguments as for `Result.gradient`, and the run.

    Raises
    ------
    ArgumentError, NameLookupError
        Unknown names, or something that cannot be differentiated, by name.
    """
    given = by_name("weights", weights, "arrays of weights, one number per sample, by path of a variable", "load.w")
    chosen = name_list("names", names, "shaft.c")
    if not given or not chosen:
        raise ArgumentError(f"{'weights' if not given else 'names'} is empty: there is nothing to differentiate")
    refuse_form(translation, request.form)
    if not (request.start is None or isinstance(request.start, (str, Mapping))):
        raise ArgumentError(CONTINUED)
    if translation.structure.switching:
        raise ArgumentError(
            "there is no adjoint gradient of a run whose states may change on the way; use simulate(sensitivities=[...])"
        )
    nodes: dict[Node, Floats] = {}
    for name, weight in given.items():
        if name in translation.model.discretes:
            raise ArgumentError(f"weights names {name}, a discrete variable, which changes in steps: it has no derivative")
        found = reals(f"weights['{name}']", weight, f"{len(times)} numbers, one per sample")
        if found.shape != times.shape:
            raise ArgumentError(f"weights['{name}'] has the shape {found.shape}; expected {len(times)} numbers, one per sample")
        node, sign = scene.named(name)
        if sign:  # the others are identically zero
            nodes[node] = nodes.get(node, np.zeros(len(times))) + sign * found
    missing = sorted({state for node in nodes for state in scene.missing(node)})
    if missing:
        scene = translation.with_states(tuple(sorted({*scene.states, *missing})))
    if scene.relations is not None:
        where = "; ".join(dict.fromkeys(scene.relation_names.values())) or "a condition"
        raise ArgumentError(
            f"there is no adjoint gradient through events ({where}); simulate(sensitivities=[...]) goes through them, forward in time"
        )
    if not scene.states or len(scene.states) > MOST_STATES:
        raise ArgumentError(
            f"{len(scene.states)} states; adjoint gradients are for 1 to {MOST_STATES}: use simulate(sensitivities=[...])"
        )
    varied = directions(translation, chosen, request.parameters, request.given, request.start)
    assert varied is not None, "names were given"
    begin, end = request.t_start, float(times[-1])
    signals = tuple(s.over(begin, end) if isinstance(s, Table) else s for s in request.signals)
    start = translation.start(scene, request.parameters, begin, request.start, signals, True, varied.seeds, varied.starts)
    assert start.changes is not None, "they were asked for"
    linear = scene.program.is_linear
    method = "rk8" if linear else request.method
    tight = replace(request, method=method, rtol=min(request.rtol, TIGHTEST), atol=None, directions=None, progress=False)

    def motion(at: Floats) -> Floats:
        if len(at) == 1 and at[0] == begin:
            return start.states[:, None]
        found = run(translation, replace(tight, times=at), scene)
        return np.column_stack([found[name] for name in scene.state_names]).T

    adjoint = Adjoint(scene, request.parameters, times, begin, nodes, signals, motion, start.changes, varied)
    found = adjoint.gradient(max(request.rtol, 1e-9), _steps_at_first(scene, request, start.states, signals, begin, end))
    return dict(zip(chosen, found.tolist(), strict=True))


def _steps_at_first(scene: Scene, request: Request, states: Floats, signals: tuple[Any, ...], begin: float, end: float) -> int:
    """Number of steps for the fastest motion, from the Jacobian at the start."""
    _, evaluator = scene.compiled_numbers(request.parameters)
    t = np.array([begin])
    inputs = values(signals, t)
    _, jacobian = evaluator.derivatives(t, states[:, None], inputs, np.zeros((scene.n_discrete, 1)))
    return int(np.clip(balanced_norm(jacobian[0]) * (end - begin) / RADIANS, FEWEST, MOST_AT_FIRST))
