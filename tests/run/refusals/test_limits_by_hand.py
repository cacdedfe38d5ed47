"""By how much a variable may fall short of its least value: numbers told beforehand, of states, of what follows from them, of aliases."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, SolverError, StartError
from gearlib.run.refusals.limits import refuse_start, refuse_too_small, refuse_too_small_in, too_small


class Limits(gl.Component):
    """A state x from 0 on, whose opposite is at least -3; and a gap between two other states, of at least 2."""

    rate = gl.Parameter("rad/s2", "of x", default=-1.0)
    drift = gl.Parameter("m/s", "of a", default=0.0)
    shift = gl.Parameter("m", "of the gap", default=0.0)
    x = gl.Variable("rad/s", "speed of it", start=1.0, min=0)
    opposite = gl.Variable("rad/s", "its opposite", min=-3)
    a, b = gl.Variable("m", start=5.0), gl.Variable("m", start=5.0)
    gap = gl.Variable("m", "between a and b", min=2, nominal=100.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.rate),
            gl.Eq(self.opposite, -self.x),
            gl.Eq(gl.der(self.a), -self.drift),
            gl.Eq(gl.der(self.b), 0.0),
            gl.Eq(self.gap, self.a - self.b + 2.0 - self.shift),
        ]


SYSTEM = gl.compile(Limits())
SCENE = SYSTEM.translation.scene
NUMBERS = SCENE.numbers(SCENE.model.parameters.defaults)
BEGIN: Any = SimpleNamespace(guess=np.zeros(SCENE.model.n_variables))
CHOOSE = "choose start values that make {} {} or more (start={{...}}), or turn the part round"
LEAVE = "the equations hold down to there; let start values, parameters and inputs leave {} at {} or more"


def state(**values: float) -> Any:
    return np.array([{"x": 1.0, "a": 5.0, "b": 5.0, **values}[name] for name in SCENE.state_names])


@pytest.mark.parametrize(
    ("at", "text"),
    [
        ({}, ""),
        ({"x": 0.0}, ""),
        ({"x": -0.99e-8}, ""),  # of a nominal value of 1
        ({"x": -1.01e-8}, "x is -1.01e-08 rad/s (speed of it), but it cannot be below 0"),
        ({"x": -2.0}, "x is -2 rad/s (speed of it), but it cannot be below 0"),
        ({"x": 3.0 + 2.9e-8}, ""),  # of its own value
        ({"x": 3.0 + 3.1e-8}, "opposite is -3.000000031 rad/s (its opposite), but it cannot be below -3"),
        ({"x": 4.0}, "opposite is -4 rad/s (its opposite), but it cannot be below -3"),
        ({"a": 5.0 - 0.99e-6}, ""),  # of a nominal value of 100
        ({"a": 5.0 - 1.01e-6}, "gap is 1.99999899 m (between a and b), but it cannot be below 2"),
        ({"a": 1e6 - 0.0099, "b": 1e6}, ""),  # of what it is the difference of
        ({"a": 1e6 - 0.0101, "b": 1e6}, "gap is 1.9899 m (between a and b), but it cannot be below 2"),
        ({"a": -1e6 - 0.0099, "b": -1e6}, ""),
        ({"a": -1e6 - 0.0101, "b": -1e6, "x": 1e6}, "opposite is -1e+06 rad/s (its opposite), but it cannot be below -3"),
    ],
)
def test_how_far_below_a_state_may_lie(at: dict[str, float], text: str) -> None:
    """By 1e-8 of the largest number that it is computed from, its own and its nominal value among them; no others."""
    assert too_small(SCENE, NUMBERS, 0.0, state(**at), np.empty(0), BEGIN) == text


@pytest.mark.parametrize(
    ("at", "text"),
    [
        ({"x": -2.0}, "x is -2 rad/s (speed of it), but it cannot be below 0 at t = 0.25 s; " + CHOOSE.format("x", 0)),
        ({"a": 1.0}, "gap is -2 m (between a and b), but it cannot be below 2 at t = 0.25 s; " + LEAVE.format("gap", 2)),
    ],
)
def test_a_start_that_is_refused(at: dict[str, float], text: str) -> None:
    begin: Any = SimpleNamespace(states=state(**at), guess=BEGIN.guess)
    with pytest.raises(StartError) as refused:
        refuse_start(SCENE, SCENE.model.parameters.defaults, 0.25, np.empty(0), begin)
    assert str(refused.value) == text
    begin.states = state()
    refuse_start(SCENE, SCENE.model.parameters.defaults, 0.25, np.empty(0), begin)


@pytest.mark.parametrize("method", ["exact", "rk", "ida"])
@pytest.mark.parametrize(
    ("rtol", "rate", "end", "text"),
    [
        (1e-6, -1.0, 1.0, None),
        (
            1e-6,
            -1.0,
            2.0,
            "x is -0.25 rad/s (speed of it), but it cannot be below 0 at t = 1.25 s; only a reinit, or motions that",
        ),
        (
            0.01,
            -1.0,
            1.25,
            "x is -0.25 rad/s (speed of it), but it cannot be below 0 at t = 1.25 s; only a reinit, or motions that",
        ),
        (0.03, -1.0, 1.25, None),  # ten tolerances of a largest value of 1
        (0.024, -1.0, 1.25, "x is -0.25 rad/s"),
        (1e-6, 1.0, 2.0, None),
        (
            1e-6,
            4.0,
            1.0,
            "opposite is -4 rad/s (its opposite), but it cannot be below -3 at t = 0.75 s; only a reinit, or motions",
        ),
    ],
)
def test_how_far_below_a_run_may_come(method: str, rtol: float, rate: float, end: float, text: str | None) -> None:
    """The first sample that is too small is named: x = 1 + rate t, at every 0.25 s."""
    asked: dict[str, Any] = {
        "times": np.arange(0.0, end + 0.1, 0.25),
        "method": method,
        "rtol": rtol,
        "parameters": {"rate": rate},
    }
    if text is None:
        SYSTEM.simulate(end, **asked)
        return
    with pytest.raises(SolverError) as refused:
        SYSTEM.simulate(end, **asked)
    assert str(refused.value).startswith(text)
    name, least = text.split()[0], text.partition("below ")[2].split(" ")[0]
    assert f"let them leave {name} at {least or '0'} or more, or give one side" in str(refused.value)


def test_what_follows_from_states_during_a_run() -> None:
    """gap = 2 - t, with a = 5 - t and b = 5: the first sample says so at the start, a later one by another error."""
    with pytest.raises(
        SolverError, match=r"^gap is 1\.5 m \(between a and b\), but it cannot be below 2 at t = 0\.5 s; the equations"
    ):
        SYSTEM.simulate(2.0, samples=5, parameters={"rate": 0.0, "drift": 1.0})
    with pytest.raises(
        StartError, match=r"^gap is 1 m \(between a and b\), but it cannot be below 2 at t = 0 s; the equations"
    ):
        SYSTEM.simulate(2.0, samples=5, parameters={"shift": 1.0})


def test_values_that_are_given_for_all_variables() -> None:
    """Of an alias with the other sign its own value is named."""
    model: Any = SimpleNamespace(
        bounded=((3, 2.0), (4, -3.0)), representative={3: 0, 4: 1}, sign={3: 1, 4: -1}, nominal={0: 100.0, 1: 1.0},
        name={3: "gap", 4: "opposite"}.__getitem__, unit={3: "m", 4: "rad/s"}.__getitem__, declaration=lambda v: None,
    )  # fmt: skip
    for fine in ([2.0, 3.0], [2.0 - 0.99e-6, 3.0 + 2.9e-8], [1e4, -1e9]):
        refuse_too_small_in(model, np.array(fine))
    for values, text in (
        ([2.0 - 1.01e-6, 0.0], "gap is 1.99999899, but it cannot be below 2; " + LEAVE.format("gap", 2)),
        ([1.0, 7.0], "gap is 1, but it cannot be below 2; " + LEAVE.format("gap", 2)),
        ([2.0, 3.0 + 3.1e-8], "opposite is -3.000000031, but it cannot be below -3; " + CHOOSE.format("opposite", -3)),
        ([2.0, 7.0], "opposite is -7, but it cannot be below -3; " + CHOOSE.format("opposite", -3)),
    ):
        with pytest.raises(ArgumentError) as refused:
            refuse_too_small_in(model, np.array(values))
        assert str(refused.value) == text


def test_a_start_is_the_first_sample_of_the_first_part() -> None:
    """A later part, or a later sample, fell below on the way."""
    whole: Any = SYSTEM.simulate(0.5, samples=3, method="rk")
    fine = whole._segments[0]
    x = SCENE.state_names.index("x")

    def below(*samples: int) -> Any:
        states = fine.states.copy()
        states[list(samples), x] = -1.0
        return replace(fine, states=states, known={}, computed=[])

    refuse_too_small([fine, fine], 1e-6)
    for parts, kind, t in (
        ([below(0, 1)], StartError, "0"), ([below(1)], SolverError, "0.25"), ([fine, below(0)], SolverError, "0"),
        ([fine, below(2)], SolverError, "0.5"), ([below(0), below(1)], StartError, "0"),
    ):  # fmt: skip
        with pytest.raises(kind, match=rf"^x is -1 rad/s .* at t = {t} s; {'choose' if kind is StartError else 'only'}"):
            refuse_too_small(parts, 1e-6)
    with pytest.raises(StartError, match=r"^gap is 1 m .* at t = 0\.5 s; the equations hold down to there"):
        SYSTEM.simulate(1.0, samples=3, start=whole, parameters={"shift": 1.0}, method="rk")


class Guarded(gl.Component):
    """A gap that is open where z is positive."""

    a, z = gl.Variable("m", start=6.0), gl.Variable("m", start=1.0)
    gap = gl.Variable("m", "guarded", min=0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.a), 0.0),
            gl.Eq(gl.der(self.z), 0.0),
            gl.Eq(self.gap, gl.Piecewise((self.a - 5.0, self.z > 0.0), (1.0, True))),
        ]


@pytest.mark.parametrize(("short", "refused"), [(4.9e-8, False), (5.1e-8, True), (1e-3, True)])
@pytest.mark.parametrize("z", [1e6, 1.0])
def test_what_only_decides_between_equations_is_no_operand(short: float, refused: bool, z: float) -> None:
    """However large it is: 1e-8 of a = 5 m."""
    scene = gl.compile(Guarded()).translation.scene
    numbers, begin = scene.numbers(scene.model.parameters.defaults), SimpleNamespace(guess=np.zeros(scene.model.n_variables))
    x = np.array([{"a": 5.0 - short, "z": z}[name] for name in scene.state_names])
    said = too_small(scene, numbers, 0.0, x, np.empty(0), begin)  # type: ignore[arg-type]
    assert said.startswith("gap is -") == refused
    assert (said == "") != refused


class Driven(gl.Component):
    """A speed that is an input, and the opposite of one that is another."""

    u, v = gl.Input("rad/s"), gl.Input("rad/s")
    w = gl.Variable("rad/s", "driven", min=-1)
    back = gl.Variable("rad/s", "turned back", min=-1)
    phi = gl.Variable("rad", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(self.w, self.u), gl.Eq(self.back, -self.v), gl.Eq(gl.der(self.phi), self.w + self.v)]


@pytest.mark.parametrize("method", ["auto", "rk", "ida"])
def test_what_an_input_prescribes_has_its_minimum(method: str) -> None:
    system = gl.compile(Driven())
    fine = system.simulate(1.0, samples=3, inputs={"u": -1.0, "v": 1.0}, method=method)
    assert fine["w"].tolist() == fine["back"].tolist() == [-1.0] * 3
    for name, value, text in (("u", -1.5, "w is -1.5 rad/s .driven."), ("v", 1.5, "back is -1.5 rad/s .turned back.")):
        with pytest.raises(StartError, match=rf"^{text}, but it cannot be below -1 at t = 0 s; choose start values"):
            system.simulate(1.0, samples=3, inputs={"u": 0.0, "v": 0.0, name: value}, method=method)
    falling = {"u": gl.Table([0.0, 1.0], [0.0, -2.0]), "v": 0.0}
    with pytest.raises(SolverError, match=r"^w is -1\.5 rad/s \(driven\), but it cannot be below -1 at t = 0\.75 s; only"):
        system.simulate(1.0, samples=5, inputs=falling, method=method)


def test_a_number_without_unit_or_description_is_named_alone() -> None:
    class Level(gl.Component):
        x = gl.Variable("1", min=0.0, start=-1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), 1.0)]

    with pytest.raises(StartError, match=r"^x is -1, but it cannot be below 0 at t = 0 s; the equations"):
        gl.simulate(Level(), 1.0)
