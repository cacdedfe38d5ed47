"""What a call gives as ``parameters=`` counts as if it were the model's own: in every analysis, and in what is measured for a fit."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

LOOP = ("drive.tau", "wheel.w")
OMEGA = [5.0, 40.0, 300.0]
PULSE = {"drive.tau": 3.0}
OTHER = {"J": 0.07, "d": 0.9, "r_b": 0.3}


class Train(gl.Component):
    """A pinion and a wheel, which is held by a shaft or turns in a damper."""

    turns = gl.Structural(False)
    J = gl.Parameter("kg.m2", "of the wheel", default=0.2)
    d = gl.Parameter("N.m.s/rad", "of the shaft or damper", default=0.4)
    r_b = gl.Parameter("m", "of the wheel", default=0.2)

    def assemble(self) -> list[Any]:
        self.drive, self.ground = gp.Torque(), gp.Fixed()
        self.pinion, self.wheel = gp.Inertia(J=0.01), gp.Inertia(J=self.J)
        self.mesh = gp.ExternalMesh(r_a=0.1, r_b=self.r_b, c=1e5, d=100.0)
        self.shaft = gp.Damper(d=self.d) if self.turns else gp.SpringDamper(c=50.0, d=self.d)
        return [
            gl.connect(self.drive.flange, self.pinion.flange_a),
            gl.connect(self.pinion.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.ground.flange),
        ]


@cache
def compiled(turns: bool, changed: bool) -> gl.System:
    return gl.compile(Train(turns=turns, **(OTHER if changed else {})), outputs=["wheel.w", "mesh.q"])


def curves(plot: Callable[..., Any], system: gl.System, **given: Any) -> list[Any]:
    axes = np.atleast_1d(plot(system, LOOP, **given)).ravel()
    found = [np.column_stack([line.get_xdata(), line.get_ydata()]) for ax in axes for line in ax.lines]
    plt.close("all")
    return found


def stepped(system: gl.System, **given: Any) -> Any:
    run = system.stepper(inputs=PULSE, **given)
    run.advance(0.5)
    return run["wheel.w"]


def response(system: gl.System, **given: Any) -> Any:
    return gl.frequency_response(system, OMEGA, ["drive.tau"], **given).values


def fitted(system: gl.System, data: Any, **given: Any) -> Any:
    return gl.fit(system, data, {"shaft.c": (10.0, 200.0)}, evaluations=1, **given).residuals


TIMES = np.linspace(0.0, 0.5, 6)
HISTORIES = gl.MeasuredHistories({"time": TIMES, "wheel.w": np.sin(TIMES)}, inputs=PULSE)
ANALYSES: dict[str, tuple[Callable[..., Any], bool]] = {  # and whether the train turns
    "System.simulate": (lambda s, **g: s.simulate(0.5, samples=5, inputs=PULSE, **g)["wheel.w"], False),
    "System.stepper": (stepped, False),
    "System.linearize": (lambda s, **g: s.linearize(["drive.tau"], **g).A, False),
    "System.power_flow": (lambda s, **g: s.power_flow({"pinion.w": 3.0}, **g)["shaft.flange_a"].torque, True),
    "power_flow": (lambda s, **g: gl.power_flow(s, torques=PULSE, **g)["wheel.flange_a"].speed, True),
    "speed_ratio": (lambda s, **g: gl.speed_ratio(s, "pinion.w", "wheel.w", **g), True),
    "bode_plot": (lambda s, **g: curves(gl.bode_plot, s, **g), False),
    "nichols_plot": (lambda s, **g: curves(gl.nichols_plot, s, **g), False),
    "nyquist_plot": (lambda s, **g: curves(gl.nyquist_plot, s, **g), False),
    "root_locus_plot": (lambda s, **g: curves(gl.root_locus_plot, s, gains=[0.5, 1.0, 2.0], **g), False),
    "stability": (lambda s, **g: str(gl.stability(s, LOOP, **g)), False),
    "campbell": (lambda s, **g: str(gl.campbell(s, [0.0, 1e3], [1.0], **g)), False),
    "modes": (lambda s, **g: gl.modes(s, **g).eigenvalues, False),
    "passivity": (lambda s, **g: gl.passivity(s, **g).Q, False),
    "steady_state": (lambda s, **g: gl.steady_state(s, ["wheel.w"], inputs=PULSE, **g)["wheel.w"], True),
    "frequency_response": (response, False),
    "transmission_error_response": (lambda s, **g: gl.transmission_error_response(s, OMEGA, **g).values, False),
    "harmonic_balance": (
        lambda s, **g: gl.harmonic_balance(s, 5.0, 6.0, inputs={"drive.tau": lambda p, w: np.cos(p)}, points=2, **g).coefficients,
        False,
    ),
    "fit": (lambda s, **g: fitted(s, HISTORIES, **g), False),
    "MeasuredHistories.__init__": (
        lambda s, **g: fitted(s, gl.MeasuredHistories({"time": TIMES, "wheel.w": np.sin(TIMES)}, inputs=PULSE, **g)), False
    ),
    "MeasuredModes.__init__": (lambda s, **g: fitted(s, gl.MeasuredModes([2.0], **g)), False),
    "MeasuredMargins.__init__": (lambda s, **g: fitted(s, gl.MeasuredMargins(LOOP, phase_margin=60.0, gain=3.0, **g)), False),
    "MeasuredResponse.__init__": (lambda s, **g: fitted(s, gl.MeasuredResponse(OMEGA, np.ones(3, complex), *LOOP, **g)), False),
}  # fmt: skip
ELSEWHERE = {
    "System.sweep", "sweep",  # of the values themselves
    "FrequencyResponse.sensitivities", "save_parameters",  # names, and a file
    "SteppedRun.__init__",  # as System.stepper
    "mobility",  # a count, which no value of this train changes
    "System.export_fmu",  # tests/fmi
}  # fmt: skip


@pytest.mark.parametrize("name", ANALYSES)
def test_given_values_are_those_of_a_model_that_has_them(name: str) -> None:
    analysis, turns = ANALYSES[name]
    given = analysis(compiled(turns, False), parameters=OTHER)
    right, before = analysis(compiled(turns, True)), analysis(compiled(turns, False))
    if isinstance(right, str):
        assert given == right != before
        return
    given, right, before = ([np.asarray(one) for one in (x if isinstance(x, list) else [x])] for x in (given, right, before))
    for one, other in zip(given, right, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12 * np.abs(other).max(initial=0.0))
    assert any(a.shape != b.shape or not np.allclose(a, b, rtol=1e-3, atol=0.0) for a, b in zip(given, before, strict=False))


def test_every_function_that_takes_values_is_tried() -> None:
    found = set()
    for name in gl.__all__:
        member = getattr(gl, name)
        methods = inspect.getmembers(member, inspect.isfunction) if inspect.isclass(member) else []
        for path, function in [(name, member), *((f"{name}.{n}", f) for n, f in methods)]:
            if inspect.isfunction(function) and "parameters" in inspect.signature(function).parameters:
                found.add(path)
    assert {path for path in found if path.endswith("__init__") or "._" not in path} == {*ANALYSES, *ELSEWHERE}
