"""Simulations of a sweep by matrix exponentials: many linear runs at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.many_runs.side_by_side import Found, KeptStates, PreparedRuns, SideBySide, why_one_by_one
from gearlib.run.request import Request
from gearlib.run.translation import Translation
from gearlib.solvers.exponential.exact import DENSE_ALWAYS, cut
from gearlib.solvers.exponential.forcing import Forcing, NotExact, recognise
from gearlib.solvers.exponential.many import AT_ONCE, histories
from gearlib.solvers.exponential.stretches import Stretch

Floats = NDArray[np.float64]
MOST_STRETCHES = 100  # uniform grids between corners of tables and switching times, beyond which single runs are as fast


def why_not_by_exponentials(translation: Translation, request: Request) -> str | None:
    """Reason why runs cannot be solved by stacked matrix exponentials, or None; their linearity is checked later, by `ExactSweep`."""
    method, scene = str(request.method), translation.scene
    if method not in ("auto", "exact"):
        return f"the method is {method}"
    if reason := why_one_by_one(translation, request):
        return reason
    if len(scene.states) > DENSE_ALWAYS:
        return f"there are more than {DENSE_ALWAYS} states"
    return None


@dataclass(frozen=True, eq=False)
class ExactSweep(SideBySide):
    """Simulations of a linear scene by matrix exponentials; inputs that vary in time are the same in all runs."""

    @property
    def statistics(self) -> Mapping[str, Any]:
        return {"lanes": 1, "why": "matrix exponentials of many runs at once"}

    def why_not(self) -> str | None:
        """Reason why the scene or its inputs do not permit it, or None."""
        found = self._times
        return found if isinstance(found, str) else None

    @cached_property
    def _times(self) -> tuple[Forcing, list[Stretch], int] | str:
        """The inputs, the uniform grids between their corners, and the number of samples at the start; or the reason why not."""
        forms, grid = self.linear, self.sampled
        if isinstance(forms, str):
            return forms
        ends = float(grid[0]), float(grid[-1])
        forcing = recognise(forms.inputs, *ends)
        if isinstance(forcing, NotExact):
            return forcing.reason
        cuts, at_start = cut(grid, forcing)
        if len(cuts) > MOST_STRETCHES:
            return "the output times are unequal, or inputs have many corners"
        return forcing, cuts, at_start

    def runs_of(self, prepared: PreparedRuns) -> Iterator[Found]:
        forms, times = self.linear, self._times
        assert not isinstance(forms, str), "checked by `why_not`"
        assert not isinstance(times, str), "checked by `why_not`"
        scene = self.translation.scene
        forcing, cuts, at_start = times
        good = prepared.fit & forms.alike(prepared.parameters)
        yield from ((i, None) for i in np.flatnonzero(prepared.fit & ~good).tolist())
        fitting, columns = np.flatnonzero(good), self.columns
        matrices, weights = forms.of_runs(prepared.parameters, prepared.solutions, prepared.numbers)
        stats = {
            "method": "exact", "why": "the scene is linear and time-invariant; many runs at once", "states": len(scene.states),
            "steps": 0, "rhs": 0,
        }  # fmt: skip
        for first in range(0, len(fitting), AT_ONCE):
            here = fitting[first : first + AT_ONCE]
            out = np.empty((len(here), len(self.sampled), len(columns)))
            out[:, :at_start] = prepared.states[here][:, None, columns]
            histories(matrices[here], weights[here], forcing, cuts, prepared.states[here], columns, out)
            finite = np.isfinite(out).all(axis=(1, 2))
            yield from ((int(i), None) for i in here[~finite])
            if not self.whole:
                yield KeptStates(here[finite], out[finite, self.hidden :])
                continue
            for k in np.flatnonzero(finite).tolist():
                yield int(here[k]), prepared.result(int(here[k]), out[k, self.hidden :], stats)
