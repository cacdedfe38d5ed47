"""What became of a train: right, rightly refused, or one of the ways to fall short."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import gearlib as gl

Floats = NDArray[np.float64]

RIGHT, REFUSED, UNCLEAR = "right", "rightly refused", "unclear"  # in the end, or as the reference itself says
WRONG, UNDUE, RAW, ANSWERED, HANG = "WRONG", "REFUSED UNDULY", "RAW EXCEPTION", "ANSWERED WITHOUT REASON", "HANG"
SHORT = (WRONG, UNDUE, RAW, ANSWERED, HANG)


@dataclass(frozen=True)
class Verdict:
    """A kind, and what there is to say about it."""

    kind: str
    detail: str = ""

    @property
    def short(self) -> bool:
        return self.kind in SHORT

    @property
    def reason(self) -> str:
        """What the reference knows against a train that is refused, or that is not judged."""
        return self.detail.split(" | ")[0]


def attempted(action: Callable[[], Verdict], refusal: str | None) -> Verdict:
    """The verdict of an action; a refusal is right where the reference knows a reason for one."""
    try:
        return action()
    except gl.GearlibError as error:
        said = f"{type(error).__name__}: {error}"
        return Verdict(UNDUE, said) if refusal is None else Verdict(REFUSED, f"{refusal} | {said}")
    except Exception as error:
        import traceback

        last = traceback.extract_tb(error.__traceback__)[-1]
        return Verdict(RAW, f"{type(error).__name__}: {error} ({last.filename.rsplit('/', 1)[-1]}:{last.lineno})")


def audited(result: gl.Result, label: str) -> Verdict:
    """Whether the tolerance of a run explains what its energy balance is off by."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        result.check_energy()
    found = [str(w.message) for w in said if "energy balance" in str(w.message)]
    return Verdict(WRONG, f"{label}: {found[0]}") if found else Verdict(RIGHT)


def sizes(right: Mapping[str, Floats], units: Mapping[str, str], terms: Mapping[str, float] | None = None) -> dict[str, float]:
    """The largest value of any variable of a unit; where terms cancel, a value is known as well as the terms are."""
    found = {unit: max(1e-3, 1e-6 * (terms or {}).get(unit, 0.0)) for unit in units.values()}
    for name, values in right.items():
        found[units[name]] = max(found[units[name]], float(np.abs(values).max(initial=0.0)))
    return found


def distance(
    found: Mapping[str, Floats], right: Mapping[str, Floats], units: Mapping[str, str], size: Mapping[str, float]
) -> tuple[float, str]:
    """The largest error of any variable over the size of its unit, and where it is."""
    worst, where = 0.0, "nothing"
    for name, values in right.items():
        error = np.abs(found[name] - values) / size[units[name]]
        k = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
        if not error[k] <= worst:
            worst = float(error[k]) if np.isfinite(error[k]) else np.inf
            where = f"{name} is {found[name][k]:.10g}, right is {values[k]:.10g} (sample {k})"
    return worst, where


def converging(run: Callable[[float], tuple[float, str]], label: str) -> Verdict:
    """Whether a run's error follows the tolerance: what is too far away must come near with a finer one."""
    worst, where = run(1e-8)
    if worst <= 1e-5:
        return Verdict(RIGHT)
    finer, there = run(1e-11)
    if finer <= max(1e-7, 0.03 * worst) and finer <= 1e-5:
        return Verdict(RIGHT)
    return Verdict(WRONG, f"{label}: error {worst:.1e}, finer {finer:.1e}: {there if finer > 1e-5 else where}")
