"""Sensitivities against runs with other numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import gearlib as gl


def differences(history: Callable[[float], Any], at: float, step: float = 1e-3) -> Any:
    """The derivative of a history by a number: central differences, extrapolated twice (an error of order 6)."""
    size = step * (abs(at) or 1.0)
    d = [(history(at + k * size) - history(at - k * size)) / (2 * k * size) for k in (1, 2, 4)]
    once = [(4 * d[i] - d[i + 1]) / 3 for i in (0, 1)]
    return (16 * once[0] - once[1]) / 15


def off(found: Any, right: Any) -> float:
    return float(np.abs(found - right).max() / np.abs(right).max())


def against_other_runs(
    system: gl.System, names: Sequence[str], outputs: Sequence[str], t_end: float, method: str = "rk8", *, step: float = 1e-3,
    within: float = 1e-6, by: str = "auto", samples: int = 12, **options: Any,
) -> Any:  # fmt: skip
    """Each output's sensitivities, of a run ``by`` one method, are the differences of runs by another ``method``; gives the run."""
    run = system.simulate(t_end, samples=samples, rtol=1e-10, method=by, sensitivities=names, **options)
    table = system.translation.model.parameters
    for name in names:
        of_start = name.startswith("start(")

        def other(value: float, name: str = name, of_start: bool = of_start) -> Any:
            given = {"start": {name[6:-1]: value}} if of_start else {"parameters": {name: value}}
            result = system.simulate(t_end, samples=samples, rtol=1e-12, method=method, **options, **given)
            return np.array([result[output] for output in outputs])

        at = float(run[name[6:-1]][0]) if of_start else float(table.defaults[table.index[name]])
        for output, expected in zip(outputs, differences(other, at, step), strict=True):
            assert off(run.sensitivity(output, name), expected) < within, (output, name)
    return run
