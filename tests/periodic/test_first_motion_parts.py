"""Checks of a forcing, Newton's method at one frequency, and the scales of the first motion, of equations that are written down."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import ArgumentError, SolverError
from gearlib.periodic.first_motion import _check_periodic, _refuse_undetermined, _solved


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
        (lambda p, w: np.cos(0.5 * p), 2 * np.cos(0.5 * 0.1234567)),  # another sign after a period
    ],
)
def test_a_function_of_the_phase_repeats_after_a_turn(function: Any, off: float) -> None:
    if not off:
        _check_periodic("torque.tau", function, 3.0)
        return
    said = rf"^the input torque\.tau is not 2 pi periodic in the phase: it differs by {off:.3g} after a period\. Give it the slowest"
    with pytest.raises(ArgumentError, match=said.replace("+", r"\+")):
        _check_periodic("torque.tau", function, 3.0)


def test_a_function_is_asked_at_the_frequency() -> None:
    asked: set[float] = set()
    _check_periodic("F", lambda p, w: asked.add(w) or 1.0, 3.0)
    assert asked == {3.0}


def equations(rest: Any, slope: Any) -> Any:
    """Stands for the equations of a balance."""
    return SimpleNamespace(equations=lambda z, omega: (rest(z, omega), slope(z, omega), None))


def test_newtons_method_finds_a_root_or_says_that_there_is_none() -> None:
    """Full steps would diverge for the arc tangent from 3 on; a parabola above zero has no root."""
    arc = equations(lambda z, w: np.arctan(z - w), lambda z, w: np.diag(1 / (1 + (z - w) ** 2)))
    for begin in (5.0, 8.0, 2.1):
        found = _solved(arc, np.array([begin]), 5.0)
        assert found is not None
        assert found == pytest.approx([5.0], rel=1e-12)
    none = equations(lambda z, w: z**2 + w, lambda z, w: np.diag(2 * z))
    assert _solved(none, np.array([3.0]), 1.0) is None
    flat = equations(lambda z, w: z * 0 + 1.0, lambda z, w: np.zeros((1, 1)))
    assert _solved(flat, np.array([3.0]), 1.0) is None
    zero = equations(lambda z, w: 2 * z, lambda z, w: 2 * np.eye(2))
    assert _solved(zero, np.array([4.0, -3.0]), 1.0) == pytest.approx([0.0, 0.0], abs=1e-300)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_a_root_is_as_exact_as_is_asked_for(scale: float) -> None:
    """Steps that halve the distance each: the last one is that part of the unknowns, whatever their unit."""
    slow = equations(lambda z, w: z - scale, lambda z, w: 2 * np.eye(1))
    for exact in (1e-3, 1e-6):
        found = _solved(slow, np.array([3.0 * scale]), 1.0, exact)
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
                _refuse_undetermined(undetermined(matrix), np.zeros(10), 3.0)
        else:
            _refuse_undetermined(undetermined(matrix), np.zeros(10), 3.0)


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
            _refuse_undetermined(balance, np.zeros(2), 3.0)
