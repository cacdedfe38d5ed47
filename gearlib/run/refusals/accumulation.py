"""Warning of events that accumulate: each sooner than the one before, until two of them are closer together than rounding.

Such a motion (Zeno's) has infinitely many events before a certain time, which no solver passes: a bouncing ball ends below the floor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import GearlibWarning, warn
from gearlib.run.methods.run import Run
from gearlib.solvers.problem import Solution

Floats = NDArray[np.float64]
SHRUNK = 2e-5  # ratio of the intervals between events down to which they have become shorter, one after another
LEAST = 5  # intervals that have
ENDED = 1e3  # intervals of the last kind that pass without an event: there are no more
EQUAL = 1e-13  # of the time: events closer together are one


def warn_of_accumulation(run: Run, solution: Solution) -> None:
    """Warn if the events of one equation accumulate, and the run goes on behind the last of them."""
    times, roots = solution.event_times, solution.event_roots
    if len(times) <= LEAST:
        return
    for root in np.unique(roots[roots >= 0]).tolist():
        last = accumulated(times[roots == root], solution.t_last)
        if last is not None:
            name = (run.handed or run.scene).root_names[root]
            warn(
                f"the events of {name} come ever faster until t = {last:.6g} s, where they are closer together than rounding, and no more "
                "come: what follows is not the motion of the model. Let the run end there, or give what lasts (a contact, a standstill) "
                "equations of its own",
                GearlibWarning,
            )


def accumulated(times: Floats, end: float) -> float | None:
    """The time of the event at which events accumulate before the end of a run, if they do.

    >>> print(accumulated(np.cumsum(0.5 ** np.arange(40)), 3.0))
    1.9999999999...
    >>> print(accumulated(np.arange(40.0), 50.0))
    None
    """
    apart = np.diff(times, prepend=-np.inf) > EQUAL * np.abs(times)
    gaps = np.diff([*times[apart], end])
    if len(gaps) <= LEAST:
        return None
    first = int(gaps[:-1].argmax())
    short = np.flatnonzero(gaps[first:] <= SHRUNK * gaps[first])
    if not len(short) or short[0] < LEAST or (np.diff(gaps[first : first + short[0] + 1]) >= 0).any():
        return None
    k = first + int(short[0])
    ended = np.flatnonzero(gaps[k:] > ENDED * gaps[k])
    return float(times[apart][k + ended[0]]) if len(ended) else None
