"""Which rates are those of a periodic forcing: they vary, and repeat after a period, but for rounding."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import ArgumentError
from gearlib.periodic import first_motion as parts


def check(
    *rates: Any, slope: float = 0.0, nominal: tuple[float, ...] = (), growth: tuple[float, ...] = (), means: float = 1.0,
    frequency: str | None = None,
) -> str:  # fmt: skip
    """What is said of states a, b, ... whose rates are functions of the phase and of the states."""
    n = len(rates)

    def values(phase: Any, x: Any, _: Any) -> Any:
        return np.array([rate(phase, x) + 0.0 * phase for rate in rates])

    driven: Any = SimpleNamespace(
        growth=np.array(growth or (0.0,) * n), omega=2.5, discrete=lambda phase, x: None, rates=values,
        linear_rates=lambda phase, x, flags: (values(phase, x, flags), np.full((len(phase), n, n), slope) * np.eye(n)),
        scene=SimpleNamespace(state_names=("a", "b", "c")[:n], nominal=np.array(nominal or (1.0,) * n)),
    )  # fmt: skip
    try:
        parts.check_forcing(driven, np.full(n, means), frequency)
    except ArgumentError as problem:
        return str(problem).split(";")[0].split(":")[0]
    return ""


def wave(size: float = 1.0, drift: float = 0.0, mean: float = 0.0) -> Any:
    return lambda phase, x: mean + size * np.cos(phase) + drift * phase


STILL = "nothing varies over the period"


def off(name: str) -> str:
    return f"der({name}) does not repeat after 2 pi / 2.5 rad/s"


def test_a_rate_that_varies_and_repeats_is_a_forcing() -> None:
    assert check(wave()) == ""
    assert check(wave(mean=5.0), lambda phase, x: 0.0) == ""
    assert check(wave(drift=1e-6)) == off("a")
    assert check(lambda phase, x: np.cos(0.5 * phase)) == off("a")
    assert check(wave(drift=1e-7)) == ""  # of a swing of 2, less than a millionth


def test_the_rate_that_is_farthest_off_is_named() -> None:
    """In parts of its own swing."""
    assert check(wave(drift=1e-5), wave(size=1e-2, drift=1e-6), wave()) == off("b")
    assert check(wave(drift=1e-5), wave(size=1e-2, drift=1e-8), wave()) == off("a")


@pytest.mark.parametrize(("bad", "name"), [(0, "a"), (1, "b")])
def test_a_rate_that_is_no_number_is_named(bad: int, name: str) -> None:
    rates = [wave(), wave(), wave()]
    rates[bad] = lambda phase, x: np.where(phase > 3.0, np.nan, 1.0)
    rates[2] = lambda phase, x: np.inf
    assert check(*rates) == f"der({name}) is not finite at the start values"


def test_forces_that_balance_leave_rounding_errors() -> None:
    """Of the terms of all states, and of the rate itself: a part in 1e12."""
    small = wave(size=1e-4, drift=1e-9)
    assert check(small) == off("a")
    assert check(small, slope=1e4) == ""
    assert check(small, slope=1e3) == off("a")
    assert check(small, slope=1e3, means=-10.0) == ""
    assert check(wave(size=1e-4, drift=1e-9, mean=1e4)) == ""
    assert check(wave(size=1e-4, drift=1e-9, mean=-1e3)) == off("a")


def test_a_rate_that_hardly_varies_is_compared_with_those_that_do() -> None:
    """In nominal values: to a thousand-millionth of the largest swing it counts as constant."""
    assert check(wave(), wave(size=0.0, drift=1e-17)) == ""
    assert check(wave(), wave(size=0.0, drift=1e-15)) == off("b")
    assert check(wave(), wave(size=0.0, drift=1e-15), nominal=(1.0, 100.0)) == ""
    assert check(wave(), wave(size=0.0, drift=1e-15), nominal=(1e-2, 1.0)) == ""


@pytest.mark.parametrize("begin", [1e-5, 0.1, 1.0, 20.0, 1e3, 6e4])
def test_a_step_at_any_time_is_no_forcing(begin: float) -> None:
    """Before the first of the other phases that are looked at, and after many periods."""
    assert check(lambda phase, x: np.cos(phase) + 0.1 * (phase >= begin)) == off("a")
    assert check(lambda phase, x: np.cos(phase) + 0.1 * (phase >= begin - 1e5)) == ""


def test_something_has_to_vary() -> None:
    """By more than rounding, in parts of its own size; all that is at rest does not."""
    assert check(lambda phase, x: 5.0) == check(lambda phase, x: 0.0) == STILL
    assert check(wave(size=1e-12, mean=5.0)) == STILL
    assert check(wave(size=1e-11, mean=5.0)) == ""
    assert check(wave(size=1e-12, mean=5.0), wave(size=1e-3)) == ""
    assert check(wave(size=0.0, mean=5.0), wave(size=1e-11, mean=-2.0)) == ""


def test_phases_of_meshes_grow() -> None:
    assert check(lambda phase, x: 2.0, lambda phase, x: np.cos(x[0]), growth=(1.0, 0.0)) == ""
    assert check(lambda phase, x: 2.0, lambda phase, x: np.cos(x[0]), growth=(-3.0, 0.0)) == ""
    assert check(lambda phase, x: 2.0, lambda phase, x: np.cos(x[0]), growth=(0.5, 0.0)) == off("b")
    assert check(lambda phase, x: 2.0, lambda phase, x: x[0], growth=(1.0, 0.0)) == off("b")


def test_a_phase_of_a_mesh_grows_with_the_time() -> None:
    """What depends on the difference of both repeats."""
    assert check(lambda phase, x: np.cos(0.3 * (x[0] - phase)) + np.cos(phase), growth=(1.0,)) == ""
    assert check(lambda phase, x: np.cos(0.3 * (x[0] + phase)) + np.cos(phase), growth=(1.0,)) == off("a")


def test_flags_are_those_of_the_moment() -> None:
    driven: Any = SimpleNamespace(
        growth=np.zeros(1), omega=2.5, discrete=lambda phase, x: phase, rates=lambda phase, x, flags: (np.cos(phase) + flags - phase)[None],
        linear_rates=lambda phase, x, flags: ((np.cos(phase) + flags - phase)[None], np.zeros((len(phase), 1, 1))),
        scene=SimpleNamespace(state_names=("a",), nominal=np.ones(1)),
    )  # fmt: skip
    parts.check_forcing(driven, np.ones(1), None)


def test_whose_frequency_it_is_is_said() -> None:
    rate = wave(drift=1.0)
    for frequency, said in (
        (None, "name the parameter that is the forcing frequency"),
        ("mesh.w", "mesh.w was set to that frequency"),
    ):
        scene = SimpleNamespace(state_names=("a",), nominal=np.ones(1))
        driven: Any = SimpleNamespace(
            growth=np.zeros(1), omega=2.5, discrete=lambda phase, x: None, rates=lambda phase, x, _: rate(phase, x)[None],
            linear_rates=lambda phase, x, _: (rate(phase, x)[None], np.zeros((len(phase), 1, 1))), scene=scene,
        )  # fmt: skip
        with pytest.raises(ArgumentError, match=f"; {said}"):
            parts.check_forcing(driven, np.ones(1), frequency)
