"""`Run`: one integration, as passed to the methods."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearlib.program.interpret import Prepared
from gearlib.run.scene import Scene
from gearlib.run.start_values import Start
from gearlib.solvers.inputs.table import Table

if TYPE_CHECKING:
    from gearlib.run.scene_form import SceneForm
    from gearlib.run.tangents.tangents import Tangents

Floats = NDArray[np.float64]
# Longest step in periods of the fastest sinusoid of time: short enough for the stages of a step to sample it; and for root search, since
# the interval between two events may be a tenth of a period
SEEN, SEARCHED = 0.5, 1 / 16
LATE = 100.0  # start time over run length at which the clock's resolution counts as coarse
LEAST_STEPS = 100  # assumed number of steps before it is known


@dataclass(frozen=True)
class Run:
    """One integration: scene, numbers, start, inputs, times and tolerances."""

    scene: Scene
    numbers: Prepared
    start: Start
    signals: tuple[Any, ...]
    times: Floats
    rtol: float
    atol: Floats | None
    discrete: Floats | None = None  # relations and discrete variables to continue from
    max_step: float | None = None  # s
    slots: Floats | None = None  # of the scene's program where a run continues: its branch of nonlinear equations
    form: str = "ode"  # form of the equations for IDA
    backend: str = "native"  # backend of IDA
    tangents: Tangents | None = None  # integrated along with the states
    tell: Callable[[float], None] | None = None  # called now and then with the time reached
    may_stop: bool = False  # whether an interrupt ends the run at its present time, instead of being raised
    traced: bool = False  # whether the ends of its steps are stored, for states that are requested afterwards
    open_end: bool = False  # whether known events at its end are left to the run that goes on from there

    @property
    def handed(self) -> SceneForm | None:
        """The form of the scene with the algebraic unknowns left to IDA, if any."""
        if self.form == "ode":
            return None
        from gearlib.run.scene_form import scene_form

        return scene_form(self.scene, self.form)

    @cached_property
    def longest_step(self) -> float:
        """Largest step that cannot skip an event, or a pulse that lasts longer than it.

        Where there are events that are searched for, or time drives the scene, a hundredth of the run by default; where time drives it,
        also a share of its shortest period; see `follows_samples` for where that is not known.
        """
        return self.longest_step_with(self.numbers.parameters)

    def longest_step_with(self, parameters: Floats) -> float:
        """The same with other parameters."""
        if self.max_step is not None:
            return self.max_step
        scene, share = self.scene, 0.01 * float(self.times[-1] - self.times[0]) or math.inf
        if self.follows_samples:
            return min(2.0 * float(np.diff(self.times).max(initial=0.0)), share) or math.inf
        if self.driven:
            rate = scene.fastest_drive(parameters)
            return min(share, (SEARCHED if scene.searched else SEEN) * math.tau / rate) if rate else share
        return share if scene.searched else math.inf

    @property
    def longest_expanded_step(self) -> float:
        """The same for a method that expands sinusoids of time in series, where no events are searched for: the shortest period.

        Beside a zero of sin(w t)**6 all low coefficients vanish, and after half a period its value is the same again.
        """
        if self.max_step is None and not self.scene.searched and self.driven and not self.follows_samples:
            rate = self.scene.fastest_drive(self.numbers.parameters)
            return math.tau / rate if rate else math.inf
        return self.longest_step

    @cached_property
    def follows_samples(self) -> str:
        """Why steps are limited to two sample intervals: a pulse between two steps would not be noticed. Or nothing."""
        if self.max_step is not None:
            return ""
        names = self.signals and [
            self.scene.model.name(v)
            for (v, _), s in zip(self.scene.program.inputs, self.signals, strict=False)
            if is_function(s)
        ]
        if names:
            return f"{', '.join(names)}: a Python function, whose shortest pulse is not known"
        if self.driven and not self.scene.fastest_drive.known:
            return "an expression of time whose shortest pulse is not known"
        return ""

    @cached_property
    def driven(self) -> bool:
        """Whether time drives the scene, other than through tables."""
        return self.scene.on_time or any(map(is_function, self.signals))

    def coarse_clock(self, steps: int) -> str:
        """Warning for a run that starts so late that rounding of time exceeds the tolerance of its driving terms; empty if none."""
        first, last = float(self.times[0]), float(self.times[-1])
        late, span = max(abs(first), abs(last)), last - first
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
        """Whether there is neither a state nor a discrete variable."""
        return not self.scene.states and (self.scene.relations is None or not self.scene.relations.discretes)


def is_function(signal: Any) -> bool:
    """Whether an input is a Python function of time."""
    return callable(signal) and not isinstance(signal, Table)
