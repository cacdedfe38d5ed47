"""`Exact`: linear time-invariant scenes by matrix exponentials; nothing is stepped and nothing compiled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from gearlib.run.linear_form import linear_form
from gearlib.run.methods.method import refusal
from gearlib.run.methods.run import Run
from gearlib.solvers.inputs.table import Table, breakpoints, values
from gearlib.solvers.problem import Solution

Floats = NDArray[np.float64]
LARGEST_EXACT = 30_000  # states
MOST_CORNERED = 40  # states up to which tables are gone through from corner to corner with dense exponentials
FEW_CORNERS = 50  # of tables, up to which nothing is to be gained by a choice
SLOW_CORNER = 3e-4  # s, of a table that drives more states
# Measured, s: a step of Runge-Kutta and its part for each slot of the program; and how many radians of the fastest motion it spans
RK_STEP, RK_SLOT, REACH_OF_A_STEP = 1.5e-6, 3e-8, 3.0


class Exact:
    """``"exact"``: matrix exponentials of a linear time-invariant scene, with inputs that are known in closed form."""

    name = "exact"

    def fits(self, run: Run) -> str | None:
        """Why a run cannot be integrated so, or None."""
        form = None if run.still else exact_form(run)
        return self._lack(form) if isinstance(form, str) else None

    def solve(self, run: Run, why: str) -> Solution:
        """Integrate a run."""
        form = exact_form(run)
        if isinstance(form, str):
            raise refusal(self.name, self._lack(form))
        return solved(run, form, why)

    @staticmethod
    def _lack(reason: str) -> str:
        return f"needs a linear time-invariant scene: {reason}"


@dataclass(frozen=True, eq=False)
class ExactForm:
    """A linear scene, and what drives it: tables from corner to corner where states are few, the rest recognised."""

    linear: Any
    cornered: tuple[int, ...]  # the inputs that go from corner to corner, and
    cuts: Any  # the intervals there
    forcing: Any  # of the other inputs; None where they are constant


def exact_form(run: Run) -> ExactForm | str:
    """What a run is to matrix exponentials, or why it is nothing to them."""
    scene = run.scene
    if run.tangents is not None:
        return "its sensitivities are integrated with the states"
    if len(scene.states) > LARGEST_EXACT:
        return f"{len(scene.states)} states are too many for an exponential"
    linear = linear_form(scene, run.numbers, run.signals)
    if isinstance(linear, str):
        return linear
    from gearlib.solvers.exponential.forcing import NotExact

    inputs, cuts = linear.inputs, None
    cornered: tuple[int, ...] = ()
    tables = [u for u in inputs if isinstance(u, Table)]
    if tables and len(scene.states) <= MOST_CORNERED:
        from gearlib.solvers.exponential.corners import Intervals

        cornered = tuple(k for k, u in enumerate(inputs) if isinstance(u, Table) or u.is_number)
        cuts = Intervals.of(run.times, tables)
        inputs = tuple(u for k, u in enumerate(inputs) if k not in cornered)
        if not inputs:
            return ExactForm(linear, cornered, cuts, None)
    forcing = _recognised(inputs, float(run.times[0]), float(run.times[-1]))
    if isinstance(forcing, NotExact):
        return forcing.reason
    return ExactForm(linear, cornered, cuts, forcing)


def too_many_corners(run: Run, form: ExactForm) -> str | None:
    """The reason to leave tables to Runge-Kutta, which takes a step from one corner to the next, if that is faster."""
    corners = len(breakpoints(run.signals))
    if corners <= FEW_CORNERS:
        return None
    n, linear = len(run.scene.states), form.linear
    if form.cuts is None:
        exact_seconds, rate = corners * SLOW_CORNER, 0.0
    else:
        from gearlib.solvers.exponential.dense import balanced_norm

        rate = balanced_norm(np.asarray(linear.A if isinstance(linear.A, np.ndarray) else linear.A.toarray()))
        exact_seconds = min(form.cuts.costs(n, len(form.cornered), rate))
    steps = corners + rate * float(run.times[-1] - run.times[0]) / REACH_OF_A_STEP
    seconds = steps * (RK_STEP + RK_SLOT * run.scene.program.n_slots)
    if exact_seconds <= 1.2 * seconds:
        return None
    return (
        f"a table has {corners} points: exponentials from one to the next are estimated to take {exact_seconds:.2g} s, steps "
        f"of Runge-Kutta {seconds:.2g} s"
    )


_prepared: WeakKeyDictionary[Any, tuple[Any, ...]] = WeakKeyDictionary()  # linear form -> key, exponentials, forcing


@lru_cache(maxsize=256)
def _recognised(inputs: tuple[Any, ...], t0: float, t1: float) -> Any:
    """The inputs as outputs of linear systems; the same inputs come again with every other set of parameters."""
    from gearlib.solvers.exponential.forcing import recognise

    return recognise(inputs, t0, t1)


def solved(run: Run, form: ExactForm | None, why: str) -> Solution:
    """States at the samples; ``form`` is None where there are no states."""
    n = len(run.scene.states)
    states = np.zeros((len(run.times), n))
    if form is not None:
        B, start = form.linear.B, run.start.states
        if form.forcing is not None:
            from gearlib.solvers.exponential import exact

            key = (id(form.forcing), run.times.tobytes(), run.rtol)
            known = _prepared.get(form.linear)
            if known is None or known[0] != key:
                smooth = [k for k in range(len(form.linear.inputs)) if k not in form.cornered]
                ready = exact.prepare(form.linear.A, B[:, smooth], form.forcing, run.times, rtol=min(run.rtol, 1e-9))
                known = _prepared[form.linear] = (key, ready, form.forcing)
            states, start = known[1].solve(start), np.zeros(n)
        if form.cuts is not None:  # linear: what each drives may be added
            from gearlib.solvers.exponential import corners

            A = form.linear.A if isinstance(form.linear.A, np.ndarray) else form.linear.A.toarray()
            drive = [u if isinstance(u, Table) else float(u) for u in (form.linear.inputs[k] for k in form.cornered)]
            states = states + corners.solve(A, B[:, form.cornered], drive, start, run.times, form.cuts)
    flags = run.scene.modes(run.numbers, run.times, states.T, values(run.signals, run.times, len(run.scene.program.inputs)))
    stats = {"method": "exact", "why": why, "states": n, "steps": 0, "rhs": 0, "events": 0}
    none = np.empty(0)
    end = states[-1] if n else none
    return Solution(run.times, states, flags.T, "done", float(run.times[-1]), end, none, none, np.empty(0, np.int64), stats)
