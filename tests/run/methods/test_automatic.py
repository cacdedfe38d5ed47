"""What the statistics say of a run that more than one method integrated."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from gearlib.run.methods.automatic import told
from gearlib.solvers.alternation import Leg


def leg(method: str, end: float, order: int = 5, stayed: bool = True, name: str = "rk") -> Leg:
    solution: Any = SimpleNamespace(t_last=end, stats={"order": order, "method": name})
    return Leg(method, cast(Any, None), solution, stayed)


def explicit(end: float, order: int = 5) -> Leg:
    return leg("explicit", end, order)


def implicit(end: float, stayed: bool = True) -> Leg:
    return leg("implicit", end, 0, stayed)


HIGHER = "order 8 from t = 0.25 s on, where it made more progress"


@pytest.mark.parametrize(
    ("legs", "text"),
    [
        ([explicit(0.25), explicit(1.0, 8)], HIGHER),
        (
            [explicit(0.25), explicit(0.5, 8), implicit(1.0)],
            f"{HIGHER}; explicit Runge-Kutta met stiffness at t = 0.5 s and handed over to IDA",
        ),
        ([explicit(0.5), implicit(1.0)], "explicit Runge-Kutta met stiffness at t = 0.5 s and handed over to IDA"),
        (
            [leg("explicit", 0.5, name="taylor"), implicit(1.0)],
            "the Taylor series met stiffness at t = 0.5 s and handed over to IDA",
        ),
        (
            [explicit(0.5), implicit(0.6, False), explicit(0.8), implicit(1.0)],
            "explicit Runge-Kutta met stiffness at t = 0.5 s, and handed over to IDA later on; IDA was tried once and would have "
            "taken longer",
        ),
        (
            [explicit(0.5), implicit(0.6, False), explicit(0.7), implicit(0.8, False), explicit(1.0)],
            "explicit Runge-Kutta met stiffness at t = 0.5 s; IDA was tried 2 times and would have taken longer",
        ),
        (
            [explicit(0.5), implicit(0.7), explicit(1.0)],
            "explicit Runge-Kutta met stiffness at t = 0.5 s and handed over to IDA, which handed back once where it was the "
            "slower one",
        ),
        (
            [explicit(0.5), implicit(0.6), explicit(0.7), implicit(0.8), explicit(0.9), implicit(1.0)],
            "explicit Runge-Kutta met stiffness at t = 0.5 s and handed over to IDA, which handed back 2 times where it was the "
            "slower one",
        ),
    ],
)
def test_the_legs_of_a_run_are_told_in_words(legs: list[Leg], text: str) -> None:
    assert told(legs) == text
