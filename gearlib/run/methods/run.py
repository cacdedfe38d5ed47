"""`Run`: one integration, as the methods see it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.run.forms.scene_form import SceneForm, scene_form
from gearlib.run.scene import Numbers, Scene
from gearlib.run.start_values import Start
from gearlib.run.tangents.tangents import Tangents
from gearlib.solvers.inputs.table import Table

Floats = NDArray[np.float64]
LATE = 100.0  # times its length after zero a run has a clock that is coarse beside its steps
LEAST_STEPS = 100  # that a run is thought to take before it is known how many


@dataclass(frozen=True)
class Run:
    """One integration: scene, numbers, start, inputs, times and tolerances."""

    scene: Scene
    numbers: Numbers
    start: Start
    signals: tuple[Any, ...]
    times: Floats
    rtol: float
    atol: Floats | None
    modes: Floats | None = None  # relations and discrete variables to begin with, where a run goes on
    max_step: float | None = None  # s
    slots: Floats | None = None  # of the scene's program, where a run goes on: its branch of nonlinear equations
    form: str = "ode"  # what IDA is handed
    backend: str = "native"  # how it is driven
    tangents: Tangents | None = None  # that are integrated with the states

    @property
    def handed(self) -> SceneForm | None:
        """The scene with the algebraic unknowns that are left to IDA, if any are."""
        return None if self.form == "ode" else scene_form(self.scene, self.form)

    @cached_property
    def longest_step(self) -> float:
        """What no event and no pulse that lasts longer is stepped over by.

        Where there are events that are searched for, a hundredth of the run by default; where time drives the scene, two sample
        intervals as well: a pulse between two steps would not be noticed.
        """
        if self.max_step is not None:
            return self.max_step
        scene, share = self.scene, 0.01 * float(self.times[-1] - self.times[0]) or math.inf
        if self.driven:
            return min(2.0 * float(np.diff(self.times).max(initial=0.0)), share) or math.inf
        return share if scene.relations is not None and not scene.relations.on_time.all() else math.inf

    @property
    def driven(self) -> bool:
        """Whether time drives the scene, other than by tables."""
        programs = [self.scene.program, *([self.scene.relations.program] if self.scene.relations is not None else [])]
        return any(p.on_time for p in programs) or any(map(is_function, self.signals))

    def coarse_clock(self, steps: int) -> str:
        """What is to be said of a run that begins late, where time drives it and is known no better than the tolerance; or nothing."""
        late, span = float(np.abs(self.times[[0, -1]]).max()), float(self.times[-1] - self.times[0])
        resolution = math.ulp(late)
        if span == 0.0 or late < LATE * span or not self.driven or resolution <= self.rtol * span / max(steps, LEAST_STEPS):
            return ""
        return (
            f"at t = {late:.6g} s the clock's resolution is {resolution:.2g} s, too coarse for rtol={self.rtol:g}: what time drives is "
            "known no better than that. Let the run start at 0 and add the offset to the time of the drive's own expression, or allow "
            "a larger rtol"
        )

    @property
    def still(self) -> bool:
        """Whether nothing has a memory: no state, no discrete variable."""
        return not self.scene.states and (self.scene.relations is None or not self.scene.relations.discretes)


def is_function(signal: Any) -> bool:
    """Whether an input is a Python function of time."""
    return callable(signal) and not isinstance(signal, Table)
