"""Checks of a forcing, Newton's method at one frequency, and the scales of the first motion, of equations that are written down."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, SolverError
from gearlib.periodic import first_motion
from gearlib.periodic import first_motion as parts
from gearlib.periodic.first_motion import Forced
from tests.periodic.test_first_motion import forced, response
from tests.periodic.test_fourier_balance import Turning


@pytest.mark.parametrize(
    ("function", "off"),
    [
        (lambda p, w: np.cos(p) + 3.0, 0.0),
        (lambda p, w: 5.0, 0.0),
        (lambda p, w: np.cos(p) + 1e-7 * p, 0.0),  # a millionth of the swing is rounding
        (lambda p, w: np.cos(p) + 1e-6 * p, 2e-6 * np.pi),
        (lambda p, w: 1e6 + 1e-4 * p, 0.0),  # a thousand-millionth of the size, too
        (lambda p, w: 1e6 + 1e-3 * p, 2e-3 * np.pi),
        (lambda p, w: p, 2 * np.pi),
        (lambda p, w: max(p - 10.0, 0.0), None),  # zero at first
        (lambda p, w: np.cos(0.5 * p), 2 * np.cos(0.5 * 0.1234567)),  # another sign after a period
    ],
)
def test_a_function_of_the_phase_repeats_after_a_turn(function: Any, off: float | None) -> None:
    if off == 0.0:
        parts.check_periodic("torque.tau", function, 3.0)
        return
    size = ".*" if off is None else f"{off:.3g}"
    said = (
        rf"^the input torque\.tau is not 2 pi periodic in the phase: it differs by {size} after a period at 3 rad/s\. Give it"
    )
    with pytest.raises(ArgumentError, match=said.replace("+", r"\+")):
        parts.check_periodic("torque.tau", function, 3.0)


def test_a_function_is_asked_at_the_frequency() -> None:
    asked: set[float] = set()
    parts.check_periodic("F", lambda p, w: asked.add(w) or 1.0, 3.0)
    assert asked == {3.0}


def equations(rest: Any, slope: Any) -> Any:
    """Stands for the equations of a balance."""
    return SimpleNamespace(equations=lambda z, omega: (rest(z, omega), slope(z, omega), None))


def test_newtons_method_finds_a_root_or_says_that_there_is_none() -> None:
    """Full steps would diverge for the arc tangent from 3 on; a parabola above zero has no root."""
    arc = equations(lambda z, w: np.arctan(z - w), lambda z, w: np.diag(1 / (1 + (z - w) ** 2)))
    for begin in (5.0, 8.0, 2.1):
        found = parts.solved(arc, np.array([begin]), 5.0)
        assert found is not None
        assert found == pytest.approx([5.0], rel=1e-12)
    none = equations(lambda z, w: z**2 + w, lambda z, w: np.diag(2 * z))
    assert parts.solved(none, np.array([3.0]), 1.0) is None
    flat = equations(lambda z, w: z * 0 + 1.0, lambda z, w: np.zeros((1, 1)))
    assert parts.solved(flat, np.array([3.0]), 1.0) is None
    zero = equations(lambda z, w: 2 * z, lambda z, w: 2 * np.eye(2))
    assert parts.solved(zero, np.array([4.0, -3.0]), 1.0) == pytest.approx([0.0, 0.0], abs=1e-300)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_a_root_is_as_exact_as_is_asked_for(scale: float) -> None:
    """Steps that halve the distance each: the last one is that part of the unknowns, whatever their unit."""
    slow = equations(lambda z, w: z - scale, lambda z, w: 2 * np.eye(1))
    for exact in (1e-3, 1e-6):
        found = parts.solved(slow, np.array([3.0 * scale]), 1.0, exact)
        assert found is not None
        off = float(found[0]) / scale - 1.0
        assert 0.4 * exact < off <= 1.001 * exact


def undetermined(matrix: Any) -> Any:
    scene = SimpleNamespace(states=("x", "v"), state_names=("a.x", "a.v"), nominal=np.array([1.0, 1.0]))
    return SimpleNamespace(
        equations=lambda z, omega: (None, np.array(matrix, float), None),
        driven=lambda omega: SimpleNamespace(scene=scene),
        scale=np.array([1.0, 1.0]),
    )


@pytest.mark.parametrize(
    ("free", "said"),
    [
        (0, r"^at 3 rad/s the mean of a\.x is undetermined: it can have other values with the same motion"),
        (1, r"^at 3 rad/s the mean of a\.v is undetermined"),
        (
            2,
            r"^at 3 rad/s the 1\. harmonic of a\.x is undetermined: the train vibrates freely at 3 rad/s, and nothing damps that",
        ),
        (5, r"^at 3 rad/s the 1\. harmonic of a\.v is undetermined: the train vibrates freely at 3 rad/s"),
        (6, r"^at 3 rad/s the 2\. harmonic of a\.x is undetermined: the train vibrates freely at 6 rad/s"),
        (9, r"^at 3 rad/s the 2\. harmonic of a\.v is undetermined: the train vibrates freely at 6 rad/s"),
    ],
)
def test_what_is_undetermined_is_named_by_its_state_and_harmonic(free: int, said: str) -> None:
    """Of two states and two harmonics: means first, then cosines and sines; down to a part in 1e14 it is determined."""
    for size, refused in ((0.0, True), (0.9e-13, True), (1.1e-13, False)):
        matrix = np.diag(np.where(np.arange(10) == free, size, 10.0))
        if refused:
            with pytest.raises(SolverError, match=said):
                parts.refuse_undetermined(undetermined(matrix), np.zeros(10), 3.0)
        else:
            parts.refuse_undetermined(undetermined(matrix), np.zeros(10), 3.0)


def test_states_are_compared_in_their_nominal_values() -> None:
    """A direction in which the second state moves three times as far in its scale, but the first one in its nominal value."""
    direction = np.array([1.0, 3.0]) / np.sqrt(10.0)
    balance = undetermined(np.eye(2) - np.outer(direction, direction))
    for scale, nominal, name in (
        ([1.0, 1.0], [1.0, 1.0], "a.v"), ([1.0, 1.0], [1.0, 10.0], "a.x"), ([1.0, 0.1], [1.0, 1.0], "a.x"),
        ([10.0, 1.0], [1.0, 1.0], "a.x"),
    ):  # fmt: skip
        balance.scale = np.array(scale)
        balance.driven(3.0).scene.nominal = np.array(nominal)
        with pytest.raises(SolverError, match=f"the mean of {name} is undetermined"):
            parts.refuse_undetermined(balance, np.zeros(2), 3.0)


def test_no_run_is_made_where_newtons_method_finds_a_motion_from_the_start_values(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    monkeypatch.setattr(Forced, "_settled", lambda *given: made.append(given))
    task = forced(F=lambda phase, w: np.cos(phase))
    task.first(task.scene(["x"]), 0.7, 16, None)
    assert made == []


def test_a_run_is_made_where_newtons_method_finds_no_motion_from_the_start_values(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no phase turns; of a run, the last motion is that of the response."""
    made: list[float] = []
    settled, solved = Forced._settled, first_motion.solved

    phases: list[float] = []

    def watched(*given: Any) -> Any:
        made.append(given[2])
        phases.clear()
        found = settled(*given)
        assert 0.0 <= min(phases) <= 0.1 < 6.2 < max(phases) < 2 * np.pi, "inputs are asked for within one turn"
        return found

    asked: list[Any] = []
    run = first_motion.run
    monkeypatch.setattr(first_motion, "run", lambda translation, request: asked.append(request) or run(translation, request))
    monkeypatch.setattr(Forced, "_settled", watched)
    task = forced(F=lambda phase, w: phases.append(phase) or np.cos(phase))
    scene = task.scene(["x"])
    plain = task.first(scene, 0.7, 16, None)
    assert made == []
    calls: list[Any] = []

    def fails_first(*given: Any) -> Any:
        calls.append(given[1].copy())
        return None if len(calls) == 1 else solved(*given)

    monkeypatch.setattr(first_motion, "solved", fails_first)
    found = task.first(scene, 0.7, 16, None)
    assert made == [0.7]
    assert asked[0].times == pytest.approx(np.append(0.0, (100 + np.arange(16) / 16) * 2 * np.pi / 0.7), rel=1e-12)
    assert asked[0].progress is False
    begun, c = found.balance.coefficients(found.z), plain.balance.coefficients(plain.z)
    assert begun == pytest.approx(c, abs=1e-9)
    x = scene.state_names.index("x")
    begin = np.zeros((5, 2))
    begin[0, x] = 0.25
    assert calls[0].reshape(5, -1) * np.maximum(scene.nominal, 1e-300) == pytest.approx(begin)
    after = (calls[1].reshape(5, -1) * np.maximum(scene.nominal, 1e-300))[:, x]  # where Newton's method begins after the run
    assert after[1:3] == pytest.approx([response(0.7).real, -response(0.7).imag], rel=1e-4)
    assert np.abs(after[[0, 3, 4]]).max() < 1e-3
    monkeypatch.setattr(first_motion, "solved", lambda *given: None)
    turning = Forced(gl.compile(Turning()).translation, None, {}, {}, 2, {"p": 1.0})
    with pytest.raises(SolverError, match="no periodic motion was found at 2 rad/s"):
        turning.first(turning.scene(["v"]), 2.0, 16, None)
    assert made == [0.7]


class Aside(gl.Component):
    """A forced oscillator in small units, beside it something that is at rest, and something that follows it at a distance."""

    F = gl.Input("1")
    x, v = gl.Variable("1", nominal=1e-3), gl.Variable("1", nominal=1e-2)
    z = gl.Variable("1", nominal=1e-4)
    y = gl.Variable("1", nominal=1e5)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.F - 0.1 * self.v - self.x),
            gl.Eq(gl.der(self.z), -self.z),
            gl.Eq(gl.der(self.y), 1e-3 * self.x - self.y),
        ]


@pytest.mark.parametrize("size", [1e-5, 1.0, 1e5])
def test_states_are_scaled_by_their_vibration_or_as_others_are_in_nominal_values(size: float) -> None:
    """By `_rescaled`, once the first motion is known."""
    task = Forced(gl.compile(Aside()).translation, None, {}, {"F": lambda phase, w: size * np.cos(phase)}, 2, {})
    scene = task.scene(["x", "z", "y"])
    found = task.first(scene, 0.7, 16, None)
    spread = np.abs(found.balance.coefficients(found.z)[1:]).max(axis=0)
    scale = dict(zip(scene.state_names, found.balance.scale.tolist(), strict=True))
    own = dict(zip(scene.state_names, spread.tolist(), strict=True))
    wave = size / (1 - 0.49 + 0.07j)
    assert own["x"] == pytest.approx(max(abs(wave.real), abs(wave.imag)))
    assert [scale[n] for n in "xvy"] == pytest.approx([own[n] for n in "xvy"], rel=1e-9)
    assert scale["z"] == pytest.approx(1e-4 * max(own["x"] / 1e-3, own["v"] / 1e-2, own["y"] / 1e5))


@pytest.mark.parametrize("mean", [0.0, 3.0])
def test_a_forcing_that_moves_nothing_is_refused(mean: float) -> None:
    balance: Any = SimpleNamespace(coefficients=lambda z: np.array([[mean, 1.0], [0.0, 0.0], [0.0, 0.0]]))
    with pytest.raises(SolverError, match=r"^the forcing moves nothing: no state vibrates at the first frequency$"):
        parts.rescaled(balance, np.zeros(6), None, np.ones(2))  # type: ignore[arg-type]
