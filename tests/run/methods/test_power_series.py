"""What Taylor series are not made for, in words."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.run.methods.power_series import TaylorSeriesMethod
from tests.run.methods.test_native_problem import plain, run


def smooth(**more: Any) -> Any:
    """A run whose scene has a series."""
    own = run(plain())
    scene: Any = SimpleNamespace(program=own.scene.program, model=own.scene.model, series=SimpleNamespace(), relations=None)
    return replace(own, scene=scene, **more)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({}, None),
        ({"tangents": SimpleNamespace()}, "does not integrate sensitivities"),
        ({"form": "dae"}, "needs the equations as form='ode', not 'dae'"),
        ({"signals": (lambda t: 1.0,)}, "needs inputs with a Taylor series: open.tau is a Python function"),
        ({"signals": (gl.Table([0.0, 1.0], [0.0, 1.0]),)}, "needs inputs with a Taylor series: open.tau is a table"),
        ({"signals": (3.0,)}, None),
    ],
)
def test_what_does_not_fit(more: dict[str, Any], said: str | None) -> None:
    assert TaylorSeriesMethod().fits(smooth(**more)) == said


def test_scenes_without_a_series_say_why() -> None:
    own = smooth()
    own.scene.series = "needs equations without tables"
    assert TaylorSeriesMethod().fits(own) == "needs equations without tables"


def test_problems_without_a_series_are_refused() -> None:
    for problem, said in (
        (SimpleNamespace(series=None), "needs the equations as form='ode'"),
        (SimpleNamespace(series=lambda: "needs smooth equations"), "needs smooth equations"),
    ):
        with pytest.raises(ArgumentError, match=rf"^method='taylor' {said}; use method='auto', 'rk' or 'ida'$"):
            TaylorSeriesMethod().stepper(problem)  # type: ignore[arg-type]
