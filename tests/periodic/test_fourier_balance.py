"""The error of a motion in Fourier series, where what is missing is known."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SolverError
from gearlib.periodic.first_motion import First, Forced
from gearlib.periodic.fourier_balance import HarmonicEquations, Rigid
from tests.periodic.models import driven, motion

ZETA, OMEGA, HARMONICS = 0.05, 0.7, 3


class Oscillator(gl.Component):
    """``x'' + 2 zeta x' + x = F``."""

    F = gl.Input("1")
    zeta = gl.Parameter("1", default=ZETA)
    x = gl.Variable("1")
    v = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), self.F - 2 * self.zeta * self.v - self.x)]


@cache
def oscillator() -> gl.System:
    return gl.compile(Oscillator())


@cache
def solved() -> First:
    drive: dict[str, Any] = {"F": lambda phase, w: 2.0 + np.cos(phase)}
    task = Forced(oscillator().translation, None, {}, drive, HARMONICS, {})
    return task.first(task.scene(["x"]), OMEGA, 32, None, None)


def test_a_linear_motion_is_exact() -> None:
    balance = solved().balance
    c = balance.coefficients(solved().z)
    response = 1 / (1 - OMEGA**2 + 2j * ZETA * OMEGA)
    assert c[0] == pytest.approx([2.0, 0.0], abs=1e-12)
    assert np.hypot(*c[1:3]) == pytest.approx(abs(response) * np.array([1.0, OMEGA]))
    assert max(balance.error(solved().z, OMEGA)) < 1e-10


@pytest.mark.parametrize(
    ("zeta", "begin"), [(0.0, 0.45), (0.0, 3.0), (1e-9, 0.6), (0.01, 1e-2), (0.01, 1e4), (0.01, 3e5), (-1e-9, 0.6)]
)
def test_motions_are_stable_where_the_train_is_damped_however_slowly_it_is_forced(zeta: float, begin: float) -> None:
    """Multipliers are exponentials of the poles; without damping they lie on the unit circle, at whatever frequency."""
    found = gl.harmonic_balance(
        oscillator(), begin, 1.05 * begin, inputs={"F": lambda phase, w: np.cos(phase)}, parameters={"zeta": zeta}, harmonics=1,
        step=0.1, outputs=["x"],
    )  # fmt: skip
    assert (found.stable == (zeta > 0)).all()
    poles = -zeta + 1j * np.sqrt(1 - zeta**2) * np.array([1, -1])
    expected = np.exp(2 * np.pi * poles / found.omega[:, None])
    assert np.abs(np.sort_complex(found.multipliers) - np.sort_complex(expected)).max() < 1e-5
    assert np.abs(found.multipliers) - 1 == pytest.approx(np.abs(expected) - 1, rel=1e-5, abs=4e-16)


@pytest.mark.parametrize("place", range(2 * HARMONICS + 1))
@pytest.mark.parametrize("state", [0, 1])
def test_the_error_is_what_was_added_to_the_motion(place: int, state: int) -> None:
    """To the mean, a cosine or a sine; in parts of the state's amplitude, at the motion's own harmonics."""
    balance = solved().balance
    c = balance.coefficients(solved().z).copy()
    amplitude = np.hypot(*c[1:3])[state]
    c[place, state] += 0.01 * amplitude
    low, error = balance.error(balance.unknowns(c), OMEGA)
    assert low == pytest.approx(0.01, rel=0.03)
    assert error == pytest.approx(low, rel=1e-6)


@pytest.mark.parametrize(("state", "places", "added"), [(0, [0, 1, 3], -0.02), (1, [2], 0.02)])
def test_the_error_sums_what_is_wrong_and_what_is_missing(state: int, places: list[int], added: float) -> None:
    """Errors of x in its mean, cos(p) and cos(2 p), or of v in sin(p), beside a missing 0.002 cos(5 p) of x: all peak at once."""
    fifth = 1 / (1 - (5 * OMEGA) ** 2 + 10j * ZETA * OMEGA)
    c = np.zeros((2 * HARMONICS + 1, 2))
    c[1], c[2] = [1.0, 0.0], [0.0, -OMEGA]
    force = np.array([1.0, 0.002]) / [1 / (1 - OMEGA**2 + 2j * ZETA * OMEGA), fifth]
    drive: dict[str, Any] = {"F": lambda phase, w: (force @ np.exp(1j * np.array([1, 5]) * phase)).real}
    task = Forced(gl.compile(Oscillator()).translation, None, {}, drive, HARMONICS, {})
    balance = HarmonicEquations(task.driven(task.scene(["x"])), HARMONICS, 32, np.ones(2), rigid(0), True)
    c[places, state] += added * [1.0, OMEGA][state]
    low = 0.02 * len(places)
    missing = [0.002, 0.01][state]  # of x and of its rate, in parts of the amplitude
    found = balance.error(balance.unknowns(c), OMEGA)
    assert found == pytest.approx(np.array([low, low + missing]) / (1 - 0.02), rel=2e-3)


def rigid(sums: int) -> Rigid:
    """None; or an oscillator one combination of whose rates is taken as balanced, while a mean stays where it is."""
    ends = np.array([[0.6], [0.8]])[:, :sums]
    none = np.empty((2, 0))
    return Rigid(ends, np.array([[0.8, -0.6]])[:sums], np.array([0.3, -0.2]), none, np.ones(2), ends, none)


@pytest.mark.parametrize("sums", [0, 1])
def test_derivatives_of_the_residual_are_its_differences(sums: int) -> None:
    """With respect to every coefficient and the frequency, for forces with corners and jumps; scales and means differ."""
    equations = HarmonicEquations(driven, 3, 400, np.array([2.0, 0.3]), rigid(0), True)
    z, omega, h = equations.unknowns(motion(0.8)), 0.8, 1e-4
    assert equations.coefficients(z) == pytest.approx(motion(0.8))
    if sums:
        equations = HarmonicEquations(driven, 3, 400, equations.scale, rigid(1), True)
        equations.__dict__["_check"] = lambda *_: None  # of rates that nothing balances, which this motion leaves
    _, by_z, by_w = equations.equations(z, omega)

    def rest(at: np.ndarray, w: float) -> np.ndarray:
        return equations.equations(at, w)[0]

    differences = np.column_stack([(rest(z + h * e, omega) - rest(z - h * e, omega)) / (2 * h) for e in np.eye(len(z))])
    assert by_z == pytest.approx(differences, abs=2e-3)
    assert by_w == pytest.approx((rest(z, omega + h) - rest(z, omega - h)) / (2 * h), abs=2e-3)


def test_the_residual_is_the_rate_of_the_motion_less_that_of_the_equations() -> None:
    """In parts of the scale and per radian, transformed by an integral that is taken elsewhere."""
    equations = HarmonicEquations(driven, 3, 800, np.array([2.0, 0.3]), rigid(0), True)
    c, omega, phase = motion(0.8), 0.8, (np.arange(200_000) + 0.5) * 2 * np.pi / 200_000
    x = driven(omega).states(phase, c)
    rates = driven(omega).rates(phase, x, driven(omega).discrete(phase, x))
    ahead, back = driven(omega).states(phase + 1e-5, c), driven(omega).states(phase - 1e-5, c)
    off = (ahead - back) / 2e-5 - rates / omega
    waves = [1, *(f(k * phase) * 2 for k in (1, 2, 3) for f in (np.cos, np.sin))]
    expected = np.array([(off * wave).mean(axis=1) for wave in waves]) / equations.scale
    assert equations.equations(equations.unknowns(c), omega)[0] == pytest.approx(expected.ravel(), abs=1e-5)


class Turning(gl.Component):
    """A phase that grows by two radians per second, and what it drives: ``v' = cos(p) - v``."""

    p = gl.Variable("rad", state="prefer")
    v = gl.Variable("1")
    rate = gl.Parameter("rad/s", default=2.0)
    tau = gl.Parameter("s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.p), self.rate), gl.Eq(self.tau * gl.der(self.v), gl.cos(self.p) - self.v)]


@pytest.mark.parametrize(("turns", "omega"), [(1.0, 2.0), (-1.0, 2.0), (2.0, 1.0)])
def test_a_growing_phase_counts_by_its_growth_over_its_scale(turns: float, omega: float) -> None:
    """Forwards and too far backwards, once and twice in a period; the mean rate off, and the error of the motion."""
    task = Forced(gl.compile(Turning()).translation, None, {}, {}, HARMONICS, {"p": turns})
    scene = task.scene(["v"])
    at = task.driven(scene)
    p, v = (scene.state_names.index(name) for name in "pv")
    scale = np.empty(2)
    scale[p], scale[v] = 0.5, 3.0
    equations = HarmonicEquations(at, HARMONICS, 32, scale, rigid(0), False)
    response = np.exp(0.3j) / (1 + 2j)
    c = np.zeros((2 * HARMONICS + 1, 2))
    c[0, p] = 0.3
    k = int(abs(turns))
    c[2 * k - 1, v], c[2 * k, v] = response.real, -response.imag
    rest = equations.equations(equations.unknowns(c), omega)[0].reshape(c.shape)
    assert rest[0, p] == pytest.approx((turns - 2.0 / omega) / 0.5)
    if turns > 0:
        assert rest == pytest.approx(np.zeros(c.shape), abs=1e-12)
        assert max(equations.error(equations.unknowns(c), omega)) < 1e-6


class Rotor(gl.Component):
    """A phase that grows with the speed of a body, which tends to two radians per second, and what the phase drives."""

    p, w, v = gl.Variable("rad", state="prefer"), gl.Variable("rad/s"), gl.Variable("1")
    tau = gl.Parameter("s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.p), self.w),
            gl.Eq(self.tau * gl.der(self.w), 2.0 - self.w),
            gl.Eq(self.tau * gl.der(self.v), gl.cos(self.p) - self.v),
        ]


@pytest.mark.parametrize("speed", [2.0, 2.2])
def test_the_growth_of_a_phase_is_that_of_the_speed(speed: float) -> None:
    """Whatever their scales are: no error at this speed; at another one the mean is off by its difference."""
    task = Forced(gl.compile(Rotor()).translation, None, {}, {}, HARMONICS, {"p": 1.0})
    scene = task.scene(["v"])
    p, w, v = (scene.state_names.index(name) for name in "pwv")
    scale = np.empty(3)
    scale[[p, w, v]] = 0.5, 7.0, 3.0
    none = np.empty((3, 0))
    free = Rigid(none, none.T, np.zeros(3), none, np.ones(3), none, none)
    equations = HarmonicEquations(task.driven(scene), HARMONICS, 32, scale, free, False)
    response = 1 / (1 + 2j)
    c = np.zeros((2 * HARMONICS + 1, 3))
    c[0, w], c[1, v], c[2, v] = speed, response.real, -response.imag
    low, error = equations.error(equations.unknowns(c), 2.0)
    assert (low < 1e-6) == (error < 1e-6) == (speed == 2.0)


class Unheld(gl.Component):
    """A body that nothing holds."""

    F = gl.Input("1")
    x, w, y = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.w), gl.Eq(2 * gl.der(self.w), self.F), gl.Eq(gl.der(self.y), self.w - self.y)]


@pytest.mark.parametrize("mean", [3.0, -3.0])
def test_a_mean_force_that_nothing_holds_is_told_with_what_it_does(mean: float) -> None:
    said = rf"^there is no periodic motion at 5 rad/s: w changes by {mean / 2:g} per second on average, and nothing in the train can hold"
    with pytest.raises(SolverError, match=said):
        gl.harmonic_balance(gl.compile(Unheld()), 5.0, 6.0, inputs={"F": lambda phase, w: mean + np.cos(phase)}, outputs=["y"])
