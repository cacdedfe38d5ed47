"""Warning of spectra of signals that were sampled too rarely: their waves are folded to longer ones."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from gearlib.errors import GearlibError, GearlibWarning, warn

Floats = NDArray[np.float64]
FOLDED = 0.2  # of the standard deviation: a larger deviation from the spline through the samples is seen; an edge in 30 samples gives 0.1
NOISE = 1e-6  # of the largest value: the tolerance of a run


def warn_of_folding(
    label: str, unit: str, time: Floats, signal: Floats, sampled_at: Callable[[Floats], Floats], total: int
) -> None:  # fmt: skip
    """Warn if a signal does not follow its samples between them.

    Parameters
    ----------
    label, unit : str
        Of the signal.
    time, signal : arrays
        Samples.
    sampled_at : callable
        Returns the signal at other times.
    total : int
        Number of samples of the whole run.
    """
    from scipy.interpolate import make_interp_spline

    between = (time[1:] + time[:-1]) / 2
    with suppress(GearlibError):  # a run that cannot be repeated
        missed = sampled_at(between) - make_interp_spline(time, signal, k=5)(between)
        spread, share = float(np.std(signal)), float(np.sqrt(np.mean(missed**2)))
        if share > max(FOLDED * (spread + float(np.std(missed))), NOISE * float(np.abs(signal).max())):
            warn(
                f"{label} is sampled too rarely: between the samples it differs by {share:.3g} {unit} from what they show "
                f"(standard deviation {spread:.3g}), and waves shorter than two samples appear in the spectrum as longer ones; simulate "
                f"with more samples than {total}",
                GearlibWarning,
            )
