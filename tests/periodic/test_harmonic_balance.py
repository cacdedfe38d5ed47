"""Harmonic balance: against closed forms with one harmonic, linear frequency responses, and time integration."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError
from gearlib.linear.operating_point import Point, slots_at
from gearlib.periodic.harmonic_balance import samples_of_a_period
from gearlib.program.derivative_plan import state_plan
from gearlib.program.derivatives import At, dense, derivatives, entries
from gearparts.gears.mesh_models import DetailedExternalMesh, mesh_damping
from tests.gearparts.rotational.scenes_backlash import BacklashPair

C, GAP, ZETA, F_M, F_A = 1.0, 2.0, 0.05, 0.3, 0.1  # mass 1, so that the natural frequency in contact is 1


class BacklashOscillator(gl.Component):
    """Mass 1 behind a spring with backlash, under a preload and a harmonic force."""

    w = gl.Parameter("rad/s", default=1.0)
    F_a = gl.Parameter("1", default=F_A)
    q = gl.Variable("1", start=F_M / C + GAP / 2)
    v = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        drive, coast = self.q > GAP / 2, self.q < -GAP / 2
        spring = gl.Piecewise((C * (self.q - GAP / 2), drive), (C * (self.q + GAP / 2), coast), (0, True))
        force = F_M + self.F_a * gl.cos(self.w * gl.time)
        return [gl.Eq(gl.der(self.q), self.v), gl.Eq(gl.der(self.v), force - spring - 2 * ZETA * self.v)]


class Duffing(gl.Component):
    """``x'' + 2 zeta x' + x + alpha x**3 = F cos(w t)``."""

    alpha = gl.Parameter("1", default=1.0)
    F = gl.Input("1")
    x = gl.Variable("1")
    v = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.F - 2 * ZETA * self.v - self.x - self.alpha * self.x**3),
        ]


class GearPair(gl.Component):
    """A spur gear pair that turns freely under balanced torques, with backlash and damping in contact only."""

    w = gl.Parameter("rad/s", "mesh frequency", default=1e4)
    E = gl.Parameter("m", "transmission error", default=8e-6)
    tau = gl.Parameter("N.m", "torque on the pinion", default=100.0)
    tau_load = gl.Parameter("N.m", "torque on the wheel", default=200.0)

    def assemble(self) -> list[gl.Connection]:
        self.pinion, self.wheel = gp.Inertia(J=0.001, start={"w": 100.0}), gp.Inertia(J=0.016)
        self.mesh = DetailedExternalMesh(
            backlash=True, r_a=0.05, r_b=0.1, c=2e8, d=mesh_damping(0.05, 2e8, 0.001, 0.05, 0.016, 0.1), b=100e-6,
            e_rate=-self.E * self.w * gl.sin(self.w * gl.time), start={"q": 60e-6},
        )  # fmt: skip
        self.drive, self.load = gp.Torque(tau=self.tau), gp.Torque(tau=self.tau_load)
        return [
            gl.connect(self.drive.flange, self.pinion.flange_a),
            gl.connect(self.pinion.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.load.flange),
        ]


NATURAL = 25000.0  # rad/s, of the gear pair in contact


@pytest.fixture(scope="module")
def oscillator() -> gl.System:
    return gl.compile(BacklashOscillator())


@pytest.fixture(scope="module")
def pair() -> gl.System:
    return gl.compile(GearPair(), outputs=["mesh.q", "pinion.w", "wheel.w"])


@pytest.fixture(scope="module")
def pair_response(pair: gl.System) -> gl.HarmonicBalance:
    return gl.harmonic_balance(pair, 1.6 * NATURAL, 0.4 * NATURAL, frequency="w", harmonics=8, step=0.05)


def edge(z: float) -> tuple[float, float]:
    """Mean of ``max(cos u - z, 0)``, and of its first harmonic: contact lasts for ``abs(u) < a`` with ``cos a = z``."""
    a = np.arccos(np.clip(z, -1.0, 1.0))
    return (np.sin(a) - a * z) / np.pi, (a - np.sin(a) * np.cos(a)) / np.pi


@cache
def stiffness(A: float) -> float:
    """Of the first harmonic, with the mean at which both flanks together carry the preload."""

    def force(mean: float) -> tuple[float, float]:
        above, below = edge((GAP / 2 - mean) / A), edge((GAP / 2 + mean) / A)
        return C * A * (above[0] - below[0]), C * (above[1] + below[1])

    mean = brentq(lambda m: force(m)[0] - F_M, -5 - A, 5 + A, xtol=1e-15)
    return force(mean)[1]


def closed_form(A: np.ndarray, side: int, F_a: float) -> np.ndarray:
    """Frequency over amplitude of ``(N - w**2)**2 + (2 zeta w)**2 = (F_a / A)**2``: the greater or smaller solution, where there is one."""
    N = np.array([stiffness(a) for a in A])
    p = N - 2 * ZETA**2
    root = p**2 - N**2 + (F_a / A) ** 2
    with np.errstate(invalid="ignore"):
        return np.sqrt(p + side * np.sqrt(root))[root >= 0]


def closed_folds(F_a: float) -> np.ndarray:
    """Extrema of both curves, by parabolas through three points of a fine grid."""
    found = []
    A = np.linspace(F_M + 1e-6, 2.0, 1501)
    for side in (1, -1):
        w = closed_form(A, side, F_a)
        rise = np.diff(w)
        for k in np.flatnonzero(rise[1:] * rise[:-1] < 0):
            bend = rise[k + 1] - rise[k]
            found.append(w[k + 1] - (rise[k] + rise[k + 1]) ** 2 / (8 * bend))
    return np.sort(found)


@pytest.mark.parametrize(("F_a", "number"), [(0.05, 2), (0.1, 4)])
def test_one_harmonic_is_the_closed_form(oscillator: gl.System, F_a: float, number: int) -> None:
    """A stronger force drives the mass on to the other flank, where the spring stiffens: two more folds."""
    response = gl.harmonic_balance(oscillator, 1.5, 0.3, frequency="w", harmonics=1, parameters={"F_a": F_a})
    A, w = response.amplitude("q"), response.omega
    N = np.array([stiffness(a) for a in A])
    assert np.hypot(N - w**2, 2 * ZETA * w) * A == pytest.approx(F_a, rel=1e-9)
    assert len(response.folds) == number
    assert np.sort(response.fold_omega) == pytest.approx(closed_folds(F_a), rel=1e-6)
    assert (response.mean("q") - A < -GAP / 2).any() == (number == 4)
    assert response.complete
    assert w[[0, -1]].tolist() == [1.5, 0.3]


def test_the_second_pair_of_folds_belongs_to_one_harmonic(oscillator: gl.System) -> None:
    response = gl.harmonic_balance(oscillator, 1.5, 0.3, frequency="w", harmonics=3)
    assert len(response.folds) == 2


def test_stability_changes_at_the_folds(oscillator: gl.System) -> None:
    response = gl.harmonic_balance(oscillator, 1.5, 0.3, frequency="w", harmonics=8, parameters={"F_a": 0.05})
    first, second = response.folds
    assert not response.stable[first + 1 : second - 1].any()
    assert response.stable[second + 2 :].all()
    assert abs(response.multipliers[first] - 1).min() < 2e-3  # a multiplier leaves the unit circle at 1
    assert abs(response.multipliers[second] - 1).min() < 2e-3
    assert np.prod(response.multipliers, axis=1) == pytest.approx(np.exp(-4 * np.pi * ZETA / response.omega), rel=2e-5)


def test_runs_jump_where_the_branch_turns_back(oscillator: gl.System) -> None:
    """Runs that start on the branch of small and of large motions, within and beyond the fold where it ends."""
    response = gl.harmonic_balance(oscillator, 1.5, 0.3, frequency="w", harmonics=8)
    large, small = response.folds
    for fold, beyond, jumps_to in ((small, 1.001, 0.75), (large, 0.999, 0.16)):
        amplitude = response.amplitude("q")[fold]
        start = {n: float(response.waveform(n, fold, 1)[1][0]) * (1.0 if n == "v" else 0.9999) for n in ("q", "v")}
        w = float(response.omega[fold])
        for frequency, expected, share in ((w * beyond, jumps_to, 0.1), (w * (2 - beyond), amplitude, 0.15)):
            period = 2 * np.pi / frequency
            times = np.append(0.0, (400 + np.arange(64) / 64) * period)
            run = oscillator.simulate(times[-1], times=times, start=start, parameters={"w": frequency}, rtol=1e-8)
            assert abs(np.fft.rfft(run["q"][1:])[1]) / 32 == pytest.approx(expected, rel=share)


def test_duffing_is_its_closed_form() -> None:
    """``(1 + 3/4 alpha A**2 - w**2)**2 + (2 zeta w)**2 = (F / A)**2`` (Nayfeh and Mook, "Nonlinear Oscillations", 4.1)."""
    system, F = gl.compile(Duffing()), 0.2
    force = {"F": lambda phase, w: F * np.cos(phase)}
    response = gl.harmonic_balance(system, 0.3, 2.5, inputs=force, harmonics=1)
    A, w = response.amplitude("x"), response.omega
    N = 1 + 0.75 * A**2
    assert np.hypot(N - w**2, 2 * ZETA * w) * A == pytest.approx(F, rel=1e-9)
    assert response.phase("x") == pytest.approx(-np.arctan2(2 * ZETA * w, N - w**2), abs=1e-9)
    a = np.linspace(0.2, 1.5, 20_001)  # folds: extrema of w over A
    n = 1 + 0.75 * a**2
    found = []
    for side in (1, -1):
        curve = n - 2 * ZETA**2 + side * np.sqrt(np.maximum((n - 2 * ZETA**2) ** 2 - n**2 + (F / a) ** 2, 0.0))
        rise = np.diff(curve[: np.flatnonzero((n - 2 * ZETA**2) ** 2 - n**2 + (F / a) ** 2 < 0)[0]])
        found += np.sqrt(curve[np.flatnonzero(rise[1:] * rise[:-1] < 0) + 1]).tolist()
    assert np.sort(response.fold_omega) == pytest.approx(np.sort(found), rel=1e-6)
    assert len(found) == 2


class BesideLarge(Duffing):
    """With a state beside it that is forced as well, and vibrates as much as its gain says."""

    gain = gl.Parameter("1", default=1.0)
    y = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.y), self.gain * self.F - self.y)]


@cache
def beside_large() -> gl.System:
    return gl.compile(BesideLarge(), outputs=["x", "v", "y"])


@pytest.mark.parametrize("size", [1.0, 1e-6, 1e-12])
@pytest.mark.parametrize("large", [1.0, 1e6])
def test_a_small_state_beside_a_large_one_is_as_accurate(size: float, large: float) -> None:
    F = {"F": lambda phase, w: 0.5 * size * np.cos(phase)}
    values = {"alpha": size**-2, "gain": large / size}
    found = gl.harmonic_balance(beside_large(), 0.5, 0.501, inputs=F, parameters=values, harmonics=1, points=2)
    A, w = found.amplitude("x") / size, found.omega
    assert np.hypot(1 + 0.75 * A**2 - w**2, 2 * ZETA * w) * A == pytest.approx(0.5, rel=1e-7)
    several = gl.harmonic_balance(beside_large(), 0.5, 0.501, inputs=F, parameters=values, points=2)
    assert (several.harmonics, several.amplitude("x", 3)[0] / size) == (8, pytest.approx(0.040287, rel=1e-4))


@pytest.mark.parametrize("end", [3.0, 1e3, 1e4])
def test_the_error_of_a_motion_is_relative_to_it_where_it_has_become_small(end: float) -> None:
    """Far above its resonance, the speed follows the force: a fifth harmonic that is missing is a fifth of it."""
    drive = {"F": lambda phase, w: np.cos(phase) + np.cos(5 * phase)}
    linear = {"alpha": 0.0}
    found = gl.harmonic_balance(beside_large(), 1.0, end, inputs=drive, outputs=["x"], parameters=linear, harmonics=3)
    one, fifth = (k * end / abs(1 - (k * end) ** 2 + 2j * ZETA * k * end) for k in (1, 5))
    assert found.error[-1] == pytest.approx(fifth / one, rel=1e-3)


class Watched(gl.Component):
    """A linear oscillator whose outputs switch, by themselves and with a discrete variable, where its motion does not."""

    F = gl.Input("1")
    x, v = gl.Variable("1"), gl.Variable("1")
    side, gated, flag = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    clock, ramp, count = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    faint, quick = gl.Variable("1"), gl.Variable("1")
    fast, kept = gl.Discrete(start=0.0), gl.Discrete(start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.F - 2 * ZETA * self.v - self.x),
            gl.Eq(self.side, gl.Piecewise((2.0, self.x > 0.5), (-1.0, True))),
            gl.Eq(self.gated, gl.Piecewise((self.v, self.F > 0.5), (0.0, True))),
            gl.Eq(self.fast, gl.Piecewise((1.0, self.v > 0.2), (0.0, True))),
            gl.Eq(self.flag, 3 * self.fast),
            gl.Eq(self.clock, self.x + 1e-3 * gl.sin(gl.time)),
            gl.Eq(self.faint, self.x + 1e-5 * gl.sin(gl.time)),
            gl.Eq(self.quick, self.x + gl.sin(10.5 * gl.time)),
            gl.Eq(self.ramp, self.x + 1e-3 * gl.time),
            gl.Eq(self.kept, gl.Piecewise((1 - gl.pre(self.kept), self.x > 5.0), (gl.pre(self.kept), True))),
            gl.Eq(self.count, self.x + self.kept),
        ]


@cache
def watched() -> gl.System:
    return gl.compile(Watched())


@pytest.mark.parametrize("outputs", [["side"], ["x", "gated"], ["flag", "side"]])
def test_outputs_switch_where_the_motion_does_not(outputs: list[str]) -> None:
    """Exactly where their conditions say, not at a sample: against sums over many moments of the exact motion."""
    phase = (np.arange(100_000) + 0.5) / 100_000 * 2 * np.pi
    found = gl.harmonic_balance(
        watched(), 0.5, 0.51, inputs={"F": lambda phase, w: np.cos(phase)}, outputs=outputs, harmonics=5, points=2
    )
    x, v = (np.real(s / (1 - 0.25 + 1j * ZETA) * np.exp(1j * phase)) for s in (1, 0.5j))
    flags = {
        "x": x,
        "side": np.where(x > 0.5, 2.0, -1.0),
        "gated": np.where(np.cos(phase) > 0.5, v, 0.0),
        "flag": 3.0 * (v > 0.2),
    }
    for name in outputs:
        assert found.mean(name)[0] == pytest.approx(flags[name].mean(), abs=1e-4)
        for k in (1, 2, 5):
            assert found.amplitude(name, k)[0] == pytest.approx(
                2 * abs((flags[name] * np.exp(-1j * k * phase)).mean()), abs=1e-4
            )


@pytest.mark.parametrize(
    ("output", "message"),
    [
        ("clock", r"clock does not repeat after 2 pi / 0\.617284 rad/s, but differs by up to .* leave it out"),
        ("faint", r"faint does not repeat after 2 pi / 0\.617284 rad/s"),
        ("quick", r"quick does not repeat after 2 pi / 0\.617284 rad/s, but differs by up to 0\.06"),  # 17.01 of its periods
        ("ramp", r"ramp grows by 0\.0125\d* in each period; leave it out"),
        ("count", r"the system has a memory \(kept\)"),
    ],
)
def test_outputs_that_do_not_repeat_are_refused(output: str, message: str) -> None:
    """Also one that repeats at the first frequency by chance."""
    with pytest.raises(gl.GearlibError, match=message):
        gl.harmonic_balance(watched(), 0.5, 0.51, inputs={"F": lambda phase, w: np.cos(phase)}, outputs=["x", output], points=3)


@pytest.mark.parametrize("other", [1.5, 0.5, 2 / 3, 1.01])
def test_an_input_that_is_not_periodic_in_the_phase_is_refused(other: float) -> None:
    drive = {"F": lambda phase, w: np.cos(phase) + 1e-3 * np.cos(other * phase)}
    with pytest.raises(
        gl.GearlibError, match=r"the input F is not 2 pi periodic in the phase: it differs by .* slowest frequency"
    ):
        gl.harmonic_balance(watched(), 0.5, 0.51, inputs=drive)


def at_frequency(response: gl.HarmonicBalance, w: float) -> list[int]:
    """Points next to a frequency, in the order of the branch."""
    passed = (response.omega[:-1] - w) * (response.omega[1:] - w) <= 0
    return np.flatnonzero(passed).tolist()


def run_from(system: gl.System, response: gl.HarmonicBalance, k: int, periods: int) -> dict[str, np.ndarray]:
    """Values over the last period of a run that starts near a point of the branch."""
    w = float(response.omega[k])
    start = {name: float(response.waveform(name, k, 1)[1][0]) for name in response.outputs}
    period = 2 * np.pi / w
    times = np.append(0.0, (periods + np.arange(64) / 64) * period)
    result = system.simulate(times[-1], times=times, start=start, parameters={"w": w}, rtol=1e-9)
    return {name: result[name][1:] for name in response.outputs}


def test_both_branches_of_the_jump_are_those_of_time_integration(pair: gl.System, pair_response: gl.HarmonicBalance) -> None:
    """At one frequency between the folds: flanks that part, and flanks that stay in contact."""
    low, high = pair_response.fold_omega[[2, 3]]
    branches = [k for k in at_frequency(pair_response, 0.5 * (low + high) * 1.03) if pair_response.stable[k]]
    assert len(branches) == 2
    sizes = []
    for k in branches:
        run = run_from(pair, pair_response, k, 80)
        for name in ("mesh.q", "pinion.w"):
            assert abs(np.fft.rfft(run[name])[1]) / 32 == pytest.approx(pair_response.amplitude(name)[k], rel=1e-3)
        waveform = pair_response.waveform("mesh.q", k, 64)[1]
        sizes.append(np.abs(waveform - waveform.mean()).max())
        assert run["mesh.q"] == pytest.approx(waveform, abs=3e-3 * sizes[-1])
    assert sizes[0] > 4 * sizes[1]
    assert sizes[1] < 10e-6  # the static deflection: contact is kept


def multipliers_of_a_run(system: gl.System, start: dict[str, float], size: list[float], w: float) -> np.ndarray:
    """Eigenvalues of the matrix that takes small disturbances over a period, by central differences of runs."""
    here = np.array(list(start.values()))

    def after(x: np.ndarray) -> np.ndarray:
        moved = dict(zip(start, x.tolist(), strict=True))
        run = system.simulate(2 * np.pi / w, samples=2, start=moved, parameters={"w": w}, rtol=1e-12)
        return np.array([run[name][-1] for name in start])

    columns = [(after(here + s * e) - after(here - s * e)) / (2 * s) for s, e in zip(size, np.eye(len(size)), strict=True)]
    return np.sort_complex(np.linalg.eigvals(np.array(columns).T))


def test_multipliers_are_those_of_time_integration(pair: gl.System, pair_response: gl.HarmonicBalance) -> None:
    """Disturbances of a motion that loses contact."""
    k = at_frequency(pair_response, 0.9 * NATURAL)[0]
    start = {n: float(pair_response.waveform(n, k, 1)[1][0]) for n in ("pinion.w", "wheel.w", "mesh.q")}
    expected = multipliers_of_a_run(pair, start, [1e-3, 1e-3, 1e-8], float(pair_response.omega[k]))
    assert expected[-1] == pytest.approx(1.0, abs=1e-6)  # the free turning
    assert np.sort_complex(pair_response.multipliers[k]) == pytest.approx(expected[:-1], abs=1e-3)


class Rubbing(gl.Component):
    """Mass and spring with dry friction that never sticks: disturbances jump where the speed turns."""

    w = gl.Parameter("rad/s", default=0.7)
    x = gl.Variable("1", start=1.0)
    v = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        friction = gl.Piecewise((0.2, self.v > 0), (-0.2, True))
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), gl.cos(self.w * gl.time) - self.x - friction)]


def test_forces_that_jump() -> None:
    """Den Hartog's oscillator: amplitude and multipliers, without any damping but the friction."""
    system = gl.compile(Rubbing())
    response = gl.harmonic_balance(system, 0.75, 0.7, frequency="w", harmonics=31, step=1.0)
    w, F = 0.7, 0.2
    # J. P. Den Hartog, Transactions of the ASME 53 (1931): largest deflection of a motion without stops
    U, V = np.sin(np.pi / w) / (w * (1 + np.cos(np.pi / w))), 1 / (1 - w**2)
    largest = np.sqrt(V**2 - (F * U) ** 2)
    _, x = response.waveform("x", -1, 4096)
    assert x.max() == pytest.approx(largest, rel=1e-3)  # what the missing harmonics leave: it falls as 1 / harmonics
    start = {n: float(response.waveform(n, len(response) - 1, 1)[1][0]) for n in ("x", "v")}
    expected = multipliers_of_a_run(system, start, [1e-5, 1e-5], w)
    assert np.sort_complex(response.multipliers[-1]) == pytest.approx(expected, abs=4e-4)
    assert abs(expected).max() < 0.9


@pytest.mark.parametrize(("grounded", "speed"), [(True, 6.0), (False, 7.0)])
def test_a_linear_train_has_its_frequency_response(chain: Any, grounded: bool, speed: float) -> None:
    """Also where it turns freely, with a pole at zero: it keeps the mean speed that it starts with."""
    system = chain(n=2, grounded=grounded, d=0.5)
    mean = 0.5 * speed if grounded else 0.0
    torque = {"torque.tau": lambda phase, w: mean + 2.0 * np.cos(phase) + 0.5 * np.sin(3 * phase)}
    outputs = ["body[0].w", "shaft[0].tau", "body[1].w"]
    guess = {f"body[{i}].w": 7.0 for i in range(2)}
    response = gl.harmonic_balance(system, 3.0, 30.0, inputs=torque, outputs=outputs, harmonics=3, guess=guess, step=0.1)
    for harmonic, amplitude in ((1, 2.0), (3, 0.5)):
        exact = gl.frequency_response(system, harmonic * response.omega, ["torque.tau"], outputs)
        for name in outputs:
            assert response.amplitude(name, harmonic) == pytest.approx(amplitude * abs(exact[name]), rel=1e-9)
    assert response.mean("body[1].w") == pytest.approx(speed, rel=1e-10)
    assert response.amplitude("body[0].w", 2) == pytest.approx(0.0, abs=1e-10)
    assert response.stable.all()
    poles = np.linalg.eigvals(system.linearize(outputs=["body[0].w", "shaft[0].tau"]).A)
    poles = poles[np.abs(poles) > 1e-6]
    expected = np.sort(np.abs(np.exp(poles * 2 * np.pi / response.omega[-1])))
    assert np.sort(np.abs(response.multipliers[-1])) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("omega", [30.0, 3e3, 1e4])
def test_a_free_train_has_one_rigid_motion_however_little_its_far_end_vibrates(chain: Any, omega: float) -> None:
    """Multipliers are exponentials of the poles but the one at zero; amplitudes fall by the square of the frequency from body to body."""
    system = chain(n=3, grounded=False, d=0.5)
    outputs = [name for name in system.states if not name.endswith(".phi")]
    torque = {"torque.tau": lambda phase, w: np.cos(phase)}
    response = gl.harmonic_balance(system, omega, 1.1 * omega, inputs=torque, outputs=outputs, harmonics=1, points=2)
    poles = np.sort(system.linearize(outputs=outputs).poles())
    poles = poles[np.argsort(np.abs(poles))][1:]
    for w, multipliers in zip(response.omega, response.multipliers, strict=True):
        expected = np.exp(2 * np.pi * poles / w)
        assert np.sort_complex(multipliers) == pytest.approx(np.sort_complex(expected), abs=1e-6)
        assert np.sort(1 - np.abs(multipliers)) == pytest.approx(np.sort(1 - np.abs(expected)), rel=1e-3)
    assert response.stable.all()
    exact = gl.frequency_response(system, response.omega, ["torque.tau"], outputs)
    for name in outputs:
        assert response.amplitude(name) == pytest.approx(abs(exact[name]), rel=1e-6)


@pytest.mark.parametrize("c", [1e4, 1e8])
@pytest.mark.parametrize("d", [1.0, 1e-4, 1e-6])
def test_a_weak_damper_holds_the_mean_speed(c: float, d: float) -> None:
    """Beside stiff shafts and quick vibrations, in hours or weeks."""
    response = gl.harmonic_balance(
        held(), 50.0, 50.1, inputs={"torque.tau": lambda phase, w: 5.0 * d + np.cos(phase)}, parameters={"load.d": d, "shaft.c": c},
        outputs=["a.w", "b.w"], harmonics=1, points=2,
    )  # fmt: skip
    assert response.mean("a.w") == pytest.approx(5.0, rel=1e-7)
    assert response.mean("b.w") == pytest.approx(5.0, rel=1e-7)
    slowest = 1 - np.abs(response.multipliers).max(axis=1)
    assert slowest == pytest.approx(1 - np.exp(-2 * np.pi / response.omega * d / 3.0), rel=1e-3 if d < 1 else 0.1)


class Braked(gl.Component):
    """A body that a constant force brakes at high speeds only, beside an oscillator."""

    F = gl.Input("1")
    w, x, v = gl.Variable("1", start=0.0), gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        brake = gl.Piecewise((0.2, self.w > 1), (-0.2, self.w < -1), (0, True))
        return [
            gl.Eq(gl.der(self.w), self.F - brake),
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.F - 9 * self.x - 0.1 * self.v),
        ]


def test_where_a_force_begins_to_act_a_rigid_motion_ends() -> None:
    """The brake acts below the frequency 1: from there on the mean speed has a multiplier, which is not 1."""
    drive = {"F": lambda phase, w: np.cos(phase)}
    found = gl.harmonic_balance(gl.compile(Braked()), 1.2, 0.8, inputs=drive, harmonics=3, step=0.2)
    rigid = found.omega > 1
    assert (np.isnan(found.multipliers).sum(axis=1) == rigid).all()
    others = np.abs(found.multipliers)
    assert np.nanmax(others, axis=1) == pytest.approx(np.exp(-0.05 * 2 * np.pi / found.omega), rel=1e-4)
    assert (np.nanmin(others[~rigid], axis=1) < 0.3).all()
    assert found.stable.all()
    assert found.multipliers.shape == (len(found), 3)


class SquareWave(gl.Component):
    """A linear oscillator under a force that changes its sign, at samples of a period or between them."""

    w, shift = gl.Parameter("rad/s", default=1.0), gl.Parameter("1", default=0.0)
    x, v = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        force = gl.Piecewise((1.0, gl.sin(self.w * gl.time + self.shift) > 0), (-1.0, True))
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), force - 2 * ZETA * self.v - self.x)]


@cache
def square_wave() -> gl.System:
    return gl.compile(SquareWave(), outputs=["x"])


@pytest.mark.parametrize("shift", [0.0, 0.5 * np.pi, 1.0])
def test_a_force_that_changes_its_sign_at_a_sample_has_its_fourier_series(shift: float) -> None:
    found = gl.harmonic_balance(square_wave(), 0.4, 0.41, frequency="w", parameters={"shift": shift}, harmonics=5, points=3)
    for k, force in ((1, 4 / np.pi), (2, 0.0), (3, 4 / (3 * np.pi)), (5, 4 / (5 * np.pi))):
        w = k * found.omega
        assert found.amplitude("x", k) == pytest.approx(force / np.abs(1 - w**2 + 2j * ZETA * w), rel=1e-6, abs=1e-9)
    assert found.mean("x") == pytest.approx(0.0, abs=1e-9)


class Held(gl.Component):
    """Two bodies on a shaft, of which a damper holds the second."""

    def assemble(self) -> list[Any]:
        self.torque, self.ground = gp.Torque(), gp.Fixed()
        self.a, self.b = gp.Inertia(J=1.0, start={"w": 3.0}), gp.Inertia(J=2.0)
        self.shaft, self.load = gp.SpringDamper(c=1e4, d=1.0), gp.Damper(d=1.0)
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.b.flange_a),
            gl.connect(self.b.flange_b, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]


@cache
def held() -> gl.System:
    return gl.compile(Held())


def test_the_paper_s_train(paper: gl.System) -> None:
    """Under its transmission error, whose frequency is a parameter, and a constant torque."""
    response = gl.harmonic_balance(
        paper, 2000.0, 4500.0, frequency="e_omega", inputs={"tau_in": 100.0}, outputs=["w_out", "q_ring"], step=0.1
    )
    exact = gl.frequency_response(paper, response.omega, ["train.e_rate"], ["w_out", "q_ring"])
    for name in response.outputs:
        assert response.amplitude(name) == pytest.approx(paper.parameters["e_amplitude"] * abs(exact[name]), rel=1e-8)


class MeshingPair(gl.Component):
    """A gear pair excited by its own turning: stiffness and transmission error vary with the mesh phase."""

    tau = gl.Parameter("N.m", "torque on the pinion", default=100.0)

    def assemble(self) -> list[gl.Connection]:
        self.pinion, self.wheel = gp.Inertia(J=0.001, start={"w": 1000.0}), gp.Inertia(J=0.016, start={"w": -500.0})
        self.mesh = DetailedExternalMesh(
            backlash=True, stiffness="sinusoidal", c_amplitude=0.15, error_terms=((1, 2e-6, 0.3),), z_a=20, r_a=0.05, r_b=0.1, c=2e8,
            d=mesh_damping(0.05, 2e8, 0.001, 0.05, 0.016, 0.1), b=100e-6, start={"q": 60e-6},
        )  # fmt: skip
        self.drive, self.load = gp.Torque(tau=self.tau), gp.Torque(tau=2 * self.tau)
        return [
            gl.connect(self.drive.flange, self.pinion.flange_a),
            gl.connect(self.pinion.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.load.flange),
        ]


def test_excitation_by_the_mesh_phase() -> None:
    """The mesh phase is a state that grows; at each frequency the mean speed is the one that it asks for."""
    system = gl.compile(MeshingPair(), outputs=["mesh.q", "pinion.w", "wheel.w"])
    response = gl.harmonic_balance(system, 1.5 * NATURAL, 0.8 * NATURAL, turning={"mesh.turned": 1.0}, harmonics=8, step=0.05)
    assert response.mean("pinion.w") == pytest.approx(response.omega / 20, rel=1e-5)
    for target, parted in ((1.4, False), (0.95, True)):
        k = next(k for k in at_frequency(response, target * NATURAL) if response.stable[k])
        w = float(response.omega[k])
        start = {name: float(response.waveform(name, k, 1)[1][0]) for name in response.outputs} | {"mesh.turned": 0.0}
        times = np.append(0.0, (40 + np.arange(64) / 64) * 2 * np.pi / w)
        run = system.simulate(times[-1], times=times, start=start, rtol=1e-10)
        assert abs(np.fft.rfft(run["mesh.q"][1:])[1]) / 32 == pytest.approx(response.amplitude("mesh.q")[k], rel=1e-4)
        assert (response.waveform("mesh.q", k)[1].min() < 50e-6) == parted
    with pytest.raises(gl.GearlibError, match="nothing varies over the period"):
        gl.harmonic_balance(system, 3e4, 2e4)
    with pytest.raises(gl.GearlibError, match=r"mesh\.phase grows by 6\.28"):
        gl.harmonic_balance(system, 1.5 * NATURAL, 1.49 * NATURAL, turning={"mesh.turned": 1.0}, outputs=["mesh.phase"])
    with pytest.raises(gl.GearlibError, match=r"no state 'mesh\.turn'"):
        gl.harmonic_balance(system, 3e4, 2e4, turning={"mesh.turn": 1.0})
    braked = gl.compile(BacklashPair(), outputs=["mesh.q"])
    with pytest.raises(gl.GearlibError, match="at a speed that its torques determine"):
        gl.harmonic_balance(braked, 3e4, 2e4, turning={"mesh.turned": 1.0})


class DriftingPair(MeshingPair):
    """With an output that grows with time, not with the mesh phase."""

    rate = gl.Parameter("m/s", "drift", default=3.0)
    drifted = gl.Variable("m", "deflection and drift")
    faster = gl.Variable("m", "deflection and twice the drift")

    def equations(self) -> list[gl.Eq]:
        drift = self.rate * gl.time
        return [gl.Eq(self.drifted, self.mesh.q + drift), gl.Eq(self.faster, self.mesh.q + 2 * drift)]


def test_what_drifts_in_time_is_refused_with_its_growth_in_a_period() -> None:
    w = 1.5 * NATURAL
    with pytest.raises(gl.GearlibError, match=f"drifted grows by {3.0 * 2 * np.pi / w:g} in each period; leave it out"):
        gl.harmonic_balance(
            gl.compile(DriftingPair()), w, 0.999 * w, turning={"mesh.turned": 1.0}, outputs=["mesh.q", "drifted", "faster"],
            harmonics=1, samples=32,
        )  # fmt: skip


def test_derivatives_at_many_times_are_those_at_one() -> None:
    system = gl.compile(GearPair())
    scene = system.translation.scene
    numbers = scene.numbers(system.translation.parameter_values(None))
    random = np.random.default_rng(4)
    x = random.standard_normal((len(scene.states), 5)) * np.array([[1e-4 if "q" in s else 1.0] for s in system.states])
    t = np.linspace(0, 1e-3, 5)
    flags = scene.discrete(numbers, t, x, np.empty((0, 5)))
    program = numbers.program
    for i in range(5):
        point = Point(
            float(t[i]), dict(zip(scene.states, x[:, i].tolist(), strict=True)), np.empty(0), np.zeros(scene.model.n_variables)
        )
        slots, discrete = slots_at(scene, numbers.parameters, numbers, point)
        assert (discrete == flags[:, i]).all()
        expected = derivatives(numbers, float(t[i]), slots, discrete, range(len(x)))[program.output_slots]
        plan = state_plan(program)
        found = dense(plan, entries(plan, At(numbers, t[[i]], slots[:, None], discrete[:, None])))[0]
        assert found == pytest.approx(expected, rel=1e-13, abs=1e-13)


def test_a_start_in_the_gap_is_left_by_a_run(oscillator: gl.System) -> None:
    """There nothing holds the mass, so that Newton's method alone finds no first motion."""
    away = gl.harmonic_balance(oscillator, 1.5, 1.2, frequency="w", guess={"q": 0.0})
    near = gl.harmonic_balance(oscillator, 1.5, 1.2, frequency="w")
    assert away.amplitude("q")[[0, -1]] == pytest.approx(near.amplitude("q")[[0, -1]], rel=1e-8)


def test_the_plot_names_what_it_shows(pair_response: gl.HarmonicBalance) -> None:
    import matplotlib.pyplot as plt

    ax = pair_response.plot("mesh.q", harmonic=2)
    assert ax.get_xlabel() == "forcing frequency, Hz"
    assert ax.get_ylabel() == "amplitude of mesh.q, harmonic 2, m"
    assert {t.get_text() for t in ax.get_legend().get_texts()} == {"stable", "unstable", "fold"}
    plt.close(ax.figure)
    assert re.match(
        rf"<HarmonicBalance of .*mesh\.q.*: {len(pair_response)} points, .* rad/s, \d harmonics", repr(pair_response)
    )
    table = pair_response.to_dataframe()
    assert table["mesh.q, harmonic 1"].to_numpy() == pytest.approx(pair_response.amplitude("mesh.q"))


@pytest.mark.parametrize("begin", [0.05, 20.0, 1e4])
def test_a_step_beside_the_forcing_is_refused_whenever_it_comes(begin: float) -> None:
    """The motion behind it has another mean than the one before, which is no steady motion."""

    class Stepped(gl.Component):
        w = gl.Parameter("rad/s", default=1.0)

        def assemble(self) -> list[gl.Connection]:
            self.step = gp.blocks.Step(start_time=begin)
            self.torque = gp.Torque(tau=gl.sin(self.w * gl.time) + self.step.y)
            self.body, self.shaft, self.ground = gp.Inertia(J=1.0), gp.SpringDamper(c=4.0, d=0.6), gp.Fixed()
            return [
                gl.connect(self.torque.flange, self.body.flange_a),
                gl.connect(self.body.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.ground.flange),
            ]

    system, options = gl.compile(Stepped()), {"frequency": "w", "outputs": ["shaft.phi_rel"], "harmonics": 4}
    with pytest.raises(ArgumentError, match=r"^der\(body\.w\) does not repeat .* varies with time otherwise: .* a step"):
        gl.harmonic_balance(system, 0.7, 0.8, **options)
    settled = gl.harmonic_balance(system, 0.7, 0.8, parameters={"step.start_time": -1.0}, **options)
    assert settled.mean("shaft.phi_rel") == pytest.approx(np.full(len(settled), -0.25), rel=1e-9)


@pytest.mark.parametrize(
    ("start", "end", "options", "message"),
    [
        (0.0, 1.0, {"frequency": "w"}, "positive frequencies"),
        (1e308, 2.0, {"frequency": "w"}, r"start is 1e\+308; expected a frequency from 1e-50 to 1e\+50 rad/s"),
        (5e-324, 2.0, {"frequency": "w"}, r"start is 5e-324; expected a frequency from"),
        (1.0, 1e308, {"frequency": "w"}, r"end is 1e\+308; expected a frequency from"),
        (1.0, 2.0, {"frequency": "w", "harmonics": 0}, "harmonics is 0"),
        (1.0, 2.0, {"frequency": "w", "harmonics": 9, "samples": 12}, "whole number from 20 on"),
        (1.0, 2.0, {"frequency": "omega"}, "no parameter 'omega'"),
        (1.0, 2.0, {"frequency": "w", "outputs": ["Q"]}, "'Q'"),
        (1.3, 2.0, {}, "does not repeat after"),
        (0.5, 2.0, {}, "does not repeat after"),  # whose second harmonic the forcing at 1 rad/s is
        (1.0, 2.0, {"frequency": "w", "inputs": {"F": 1.0}}, "no unbound input 'F'"),
        (1.0, 2.0, {"frequency": "w", "step": 0.0}, "step is 0.0; expected a number above 0, up to 1$"),
        (1.0, 2.0, {"frequency": "w", "step": 1.001}, "step is 1.001; expected a number above 0, up to 1$"),
        (1.0, 1.0, {"frequency": "w"}, r"start and end are 1\.0 and 1\.0; expected two different positive frequencies, rad/s$"),
        (1.0, -2.0, {"frequency": "w"}, r"start and end are 1\.0 and -2\.0; expected two different"),
        (
            1.0,
            2.0,
            {"frequency": "w", "accuracy": 0.0},
            "accuracy is 0.0; expected an error over the vibration, above 0 and below 1$",
        ),
        (1.0, 2.0, {"frequency": "w", "accuracy": 1.0}, "accuracy is 1.0; expected"),
        (1.0, 2.0, {"frequency": "w", "points": 1}, "points is 1; expected a whole number, 2 or more$"),
        (
            1.0,
            2.0,
            {"frequency": "w", "harmonics": 8, "samples": 17},
            r"samples is 17; expected .* from 18 on \(8 harmonics need as",
        ),
        (
            1.0,
            2.0,
            {"frequency": "w", "turning": {"q": 0.0}},
            r"turning\['q'\] is 0\.0; expected the periods of 2 pi in one period",
        ),
        (1.0, 2.0, {"frequency": "w", "outputs": []}, r"outputs is \[\]; expected a list of names, such as"),
    ],
)
def test_errors(oscillator: gl.System, start: float, end: float, options: dict[str, Any], message: str) -> None:
    with pytest.raises(gl.GearlibError, match=message):
        gl.harmonic_balance(oscillator, start, end, **options)


class Split(gl.Component):
    """A drive whose torque goes through two shafts, each with a gear of its own, to one output shaft with a brake."""

    w = gl.Parameter("rad/s", default=1.0)

    def assemble(self) -> list[Any]:
        self.drive, self.rotor = gp.Torque(tau=10.0 + 2.0 * gl.cos(self.w * gl.time)), gp.Inertia(J=1.0)
        self.shafts = [gp.SpringDamper(c=1e3, d=1.0), gp.SpringDamper(c=2e3, d=1.0)]
        self.pinions = [gp.Inertia(J=0.1), gp.Inertia(J=0.1)]
        self.gears = [gp.IdealGear(ratio=2.5), gp.IdealGear(ratio=2.5)]
        self.wheel, self.brake, self.ground = gp.Inertia(J=0.5), gp.Damper(d=2.0), gp.Fixed()
        links = [gl.connect(self.drive.flange, self.rotor.flange_a), gl.connect(self.brake.flange_b, self.ground.flange)]
        for shaft, pinion, gear in zip(self.shafts, self.pinions, self.gears, strict=True):
            links += [gl.connect(self.rotor.flange_b, shaft.flange_a), gl.connect(shaft.flange_b, pinion.flange_a)]
            links += [gl.connect(pinion.flange_b, gear.flange_a), gl.connect(gear.flange_b, self.wheel.flange_a)]
        return [*links, gl.connect(self.wheel.flange_b, self.brake.flange_a)]


def test_a_split_train_turns_on_while_it_vibrates() -> None:
    """Both twists are computed from absolute angles, which only the equality of two ratios makes irrelevant."""
    names = ["shafts[0].phi_rel", "shafts[1].phi_rel", "wheel.w"]
    found = gl.harmonic_balance(gl.compile(Split()), 60.0, 150.0, frequency="w", outputs=names, harmonics=1)
    s, inertia, brake = 1j * found.omega, 0.2 + 0.5 / 2.5**2, 2.0 / 2.5**2
    shaft = 3e3 / s + 2.0  # torque by relative speed
    other = shaft / (inertia * s + brake + shaft)  # speed of the pinions by that of the rotor
    rotor = 2.0 / (s + shaft * (1 - other))
    assert found.amplitude("shafts[0].phi_rel") == pytest.approx(np.abs(rotor * (1 - other) / s), rel=1e-9)
    assert found.amplitude("shafts[1].phi_rel") == pytest.approx(np.abs(rotor * (1 - other) / s), rel=1e-9)
    assert found.amplitude("wheel.w") == pytest.approx(np.abs(rotor * other) / 2.5, rel=1e-9)
    assert found.mean("wheel.w") == pytest.approx(10.0 / 2.5 / brake, rel=1e-9)
    assert found.mean("shafts[1].phi_rel") == pytest.approx(-10.0 / 3e3, rel=1e-9)
    assert found.stable.all()
    with pytest.raises(gl.GearlibError, match=r"brake\.phi_rel grows by .* in each period; leave it out, or take its rate"):
        gl.harmonic_balance(gl.compile(Split()), 60.0, 150.0, frequency="w", outputs=["brake.phi_rel"], harmonics=1)


def test_trains_that_cannot_vibrate_about_a_mean_are_refused(pair: gl.System, chain: Any) -> None:
    with pytest.raises(gl.GearlibError, match=r"no periodic motion .* wheel\.w changes by .* load that grows with speed"):
        gl.harmonic_balance(pair, 2e4, 1e4, frequency="w", parameters={"tau_load": 190.0})
    loaded = {"torque.tau": lambda phase, w: 3.0 + np.cos(phase)}
    with pytest.raises(
        gl.GearlibError, match=r"body\[0\]\.phi grows by 12\.5\d* in each period; leave it out, or take its rate"
    ):
        gl.harmonic_balance(chain(n=2, grounded=True, d=0.5), 3.0, 4.0, inputs=loaded, outputs=["body[0].phi"])
    with pytest.raises(gl.GearlibError, match="nothing varies"):
        gl.harmonic_balance(chain(n=2, grounded=True, d=0.5), 3.0, 4.0, inputs={"torque.tau": 1.0})
    with pytest.raises(gl.GearlibError, match="no output 'q'"):
        gl.harmonic_balance(pair, 3e4, 2.9e4, frequency="w").mean("q")


class Sticking(gl.Component):
    """A body on a brake that sticks."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.body = gp.Torque(), gp.Inertia(J=1.0)
        self.friction = gp.BearingFriction(tau_pos=((0.0, 1.0), (1.0, 2.0)))
        return [gl.connect(self.torque.flange, self.body.flange_a), gl.connect(self.body.flange_b, self.friction.flange_a)]


def test_memory_is_refused() -> None:
    with pytest.raises(gl.GearlibError, match="memory"):
        gl.harmonic_balance(gl.compile(Sticking()), 1.0, 2.0, inputs={"torque.tau": lambda phase, w: np.cos(phase)})


class Planets(gl.Component):
    """A planetary set with a mesh with backlash for every planet at the sun and at the ring, under a common transmission error."""

    planets = gl.Structural(2)
    w = gl.Parameter("rad/s", default=9000.0)
    E = gl.Parameter("m", default=2e-5)
    tau = gl.Parameter("N.m", default=100.0)

    def assemble(self) -> list[gl.Connection]:
        gap = (("backlash", True), ("b", 100e-6))
        self.drive, self.load, self.ground = gp.Torque(tau=self.tau), gp.Damper(d=10.0), gp.Fixed()
        self.x = gp.PlanetaryUnit(
            planet_meshes="separate", Z_s=24, Z_p=36, Z_r=96, planets=self.planets, R_s=0.03, R_p=0.045, I_s=0.0015, I_r=0.151,
            I_h=0.0491, I_spin=0.0094, I_orbit=0.0094, K_ring=1.8e8, C_ring=2000.0, K_sun=1.8e8, C_sun=2000.0, sun_details=gap,
            ring_details=gap, e_rate=-self.E * self.w * gl.sin(self.w * gl.time),
        )  # fmt: skip
        return [
            gl.connect(self.drive.flange, self.x.sun),
            gl.connect(self.x.ring, self.ground.flange),
            gl.connect(self.x.carrier, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]


@pytest.mark.parametrize("planets", [1, 2, 5])
@pytest.mark.parametrize("E", [1e-8, 2e-5])
def test_planetary_sets_with_backlash(planets: int, E: float) -> None:
    """Means are those of the train at rest while nothing parts; the motion is the orbit that a run has from there, also where it does."""
    system = gl.compile(Planets(planets=planets), outputs=["x.sun_meshes[0].q", "x.ring_meshes[0].q", "load.w_rel"])
    rest = system.simulate(3.0, samples=2, parameters={"E": 0.0}, rtol=1e-10)
    guess = {name: float(rest[name][-1]) for name in system.states}
    found = gl.harmonic_balance(
        system, 9000.0, 8990.0, frequency="w", guess=guess, parameters={"E": E}, outputs=[*system.states, "load.w_rel"], step=1.0,
        points=2, accuracy=1e-2,
    )  # fmt: skip
    assert found.error.max() < 1e-2
    assert found.mean("load.w_rel")[0] == pytest.approx(rest["load.w_rel"][-1], rel=1e-6)
    still = 1e-6 * np.abs(rest["x.sun_meshes[0].q"][-1])
    start = {name: float(found.waveform(name, 0, 2)[1][0]) for name in system.states}
    period = 2 * np.pi / found.omega[0]
    run = system.simulate(period, samples=65, start=start, parameters={"E": E, "w": found.omega[0]}, rtol=1e-10)
    parted = False
    for name in system.states:
        wave = found.waveform(name, 0, 64)[1]
        if E < 1e-6:
            assert found.mean(name)[0] == pytest.approx(rest[name][-1], rel=1e-6, abs=still)
        elif name.endswith(".q"):
            parted |= bool(np.abs(wave).min() < 50e-6)
        assert np.abs(run[name][:-1] - wave).max() < 2e-2 * np.ptp(wave) / 2 + 1e-9 * np.abs(wave).max()
    assert parted == (E > 1e-6)


class WholeTrain(gl.Component):
    """The XP train under load, with backlash in all meshes, of which each planet has two of its own."""

    w, E = gl.Parameter("rad/s", default=11200.0), gl.Parameter("m", default=4e-7)

    def assemble(self) -> list[gl.Connection]:
        gap = (("backlash", True), ("b", 100e-6))
        self.drive, self.load, self.ground = gp.Torque(tau=100.0), gp.Damper(d=1800 * 0.075**2), gp.Fixed()
        self.train = gp.XPTrain(
            Z_s=19, Z_p=31, Z_r=81, planet_meshes="separate", ring_details=gap, sun_details=gap, pair_details=gap,
            e_rate=self.E * self.w * gl.cos(self.w * gl.time),
        )  # fmt: skip
        return [
            gl.connect(self.drive.flange, self.train.flange_in),
            gl.connect(self.train.flange_out, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]


def test_the_xp_train_with_all_its_planets() -> None:
    """Near a resonance where flanks part, the motion of the whole train is the orbit of a run that begins on it."""
    system = gl.compile(WholeTrain(), outputs=["train.x_unit.ring_meshes[0].q", "load.w_rel"])
    rest = system.simulate(3.0, samples=2, parameters={"E": 0.0})
    guess = {name: float(rest[name][-1]) for name in system.states}
    found = gl.harmonic_balance(
        system, 11200.0, 11190.0, frequency="w", guess=guess, outputs=list(system.states), step=1.0, points=2, accuracy=2e-2
    )
    start = {name: float(found.waveform(name, 0, 2)[1][0]) for name in system.states}
    run = system.simulate(2 * np.pi / found.omega[0], samples=65, start=start, parameters={"w": found.omega[0]}, rtol=1e-10)
    parted = []
    for name in system.states:
        wave = found.waveform(name, 0, 64)[1]
        assert np.abs(run[name][:-1] - wave).max() < 4e-2 * np.ptp(wave) / 2 + 1e-9 * np.abs(wave).max(), name
        parted += [name] if name.endswith(".q") and np.abs(wave).min() < 50e-6 else []
    assert parted


@pytest.mark.slow
def test_folds_of_the_xp_train_with_all_its_planets() -> None:
    """The branch of the page: it jumps where flanks of the planets' meshes part, and is unstable between its folds."""
    q = "train.x_unit.ring_meshes[0].q"
    system = gl.compile(WholeTrain(), outputs=[q])
    rest = system.simulate(3.0, samples=2, parameters={"E": 0.0})
    guess = {name: float(rest[name][-1]) for name in system.states}
    found = gl.harmonic_balance(system, 11200.0, 10900.0, frequency="w", guess=guess, outputs=[q], step=0.3, harmonics=16)
    assert found.fold_omega == pytest.approx([11017.9, 11020.5], abs=0.1)
    first, second = found.folds
    assert not found.stable[first + 1 : second - 1].any()
    assert found.stable[:first].all()
    assert found.stable[second + 1 :].all()


@pytest.mark.parametrize("seed", range(6))
def test_random_gear_pairs_have_the_orbits_of_runs(pair: gl.System, seed: int) -> None:
    """Above and below the resonance, lightly and heavily loaded; the number of harmonics follows from the accuracy."""
    rng = np.random.default_rng(seed)
    tau = 10 ** rng.uniform(1, 2.5)
    begin = float(rng.choice([1.6, 1.4, 0.45]) * NATURAL)
    found = gl.harmonic_balance(
        pair, begin, begin * 0.98, frequency="w", parameters={"tau": tau, "tau_load": 2 * tau}, step=1.0, points=2, accuracy=1e-2,
        outputs=list(pair.states),
    )  # fmt: skip
    assert found.error.max() < 1e-2
    start = {name: float(found.waveform(name, 1, 2)[1][0]) for name in pair.states}
    values = {"tau": tau, "tau_load": 2 * tau, "w": float(found.omega[1])}
    run = pair.simulate(2 * np.pi / found.omega[1], samples=129, start=start, parameters=values, rtol=1e-10)
    for name in pair.states:
        wave = found.waveform(name, 1, 128)[1]
        assert np.abs(run[name][:-1] - wave).max() < 2e-2 * np.ptp(wave) / 2


def test_harmonics_follow_from_the_accuracy(oscillator: gl.System) -> None:
    """One harmonic puts the end of the branch of large motions at 0.567; it is at 0.7198."""
    options: dict[str, Any] = {"frequency": "w", "step": 0.1, "parameters": {"E": 3e-6}}
    system = gl.compile(GearPair(), outputs=["mesh.q"])
    found = gl.harmonic_balance(system, 1.5 * NATURAL, 0.5 * NATURAL, **options)
    assert found.fold_omega / NATURAL == pytest.approx([0.7198, 0.8876], abs=2e-4)
    assert found.harmonics > 1
    assert found.error.max() <= 5e-3
    assert f"{found.harmonics} harmonics, waveform within 0.00" in repr(found)
    between = [k for k in range(len(found)) if found.folds[0] < k < found.folds[1]]
    outside = [k for k in range(len(found)) if k < found.folds[0] - 1 or k > found.folds[1] + 1]
    assert not found.stable[between[1:-1]].any()
    assert found.stable[outside].all()
    one = gl.harmonic_balance(system, 1.5 * NATURAL, 0.5 * NATURAL, harmonics=1, **options)
    assert one.fold_omega[0] / NATURAL == pytest.approx(0.567, abs=1e-3)
    assert one.error.max() > 0.05
    with pytest.raises(gl.GearlibError, match=r"64 harmonics leave an error of .* more than accuracy=1e-09"):
        gl.harmonic_balance(oscillator, 0.9, 0.88, frequency="w", accuracy=1e-9)


def test_a_motion_between_the_samples_is_refused() -> None:
    """With few samples the equations may hold at them and nowhere else."""
    drive = {"F": lambda phase, w: np.cos(phase) + 0.9 * np.cos(9 * phase)}
    with pytest.raises(gl.GearlibError, match=r"between the 8 samples of a period .* take more samples"):
        gl.harmonic_balance(gl.compile(Duffing()), 0.3, 0.31, inputs=drive, harmonics=3, samples=8)


def test_a_mean_that_nothing_determines_is_refused_by_name() -> None:
    """Unloaded gears shake inside their gap wherever they are; what a train keeps determines the rest."""

    class Loose(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.torque, self.a, self.z = gp.Torque(), gp.Inertia(J=0.01), gp.Inertia(J=0.1)
            self.mesh = gp.DetailedExternalMesh(r_a=0.05, r_b=0.1, c=1e8, d=500.0, b=1e-3, backlash=True)
            self.f, self.g, self.ground = gp.Damper(d=0.1), gp.Damper(d=0.1), gp.Fixed()
            return [
                gl.connect(self.torque.flange, self.a.flange_a, self.g.flange_a),
                gl.connect(self.a.flange_b, self.mesh.flange_a),
                gl.connect(self.mesh.flange_b, self.z.flange_a),
                gl.connect(self.z.flange_b, self.f.flange_a),
                gl.connect(self.f.flange_b, self.g.flange_b, self.ground.flange),
            ]

    system = gl.compile(Loose(), outputs=["mesh.q", "a.w"])
    shake = {"torque.tau": lambda phase, w: 1e-2 * np.cos(phase)}
    with pytest.raises(gl.GearlibError, match=r"the mean of mesh\.q is undetermined"):
        gl.harmonic_balance(system, 100.0, 110.0, inputs=shake)
    loaded = {"torque.tau": lambda phase, w: 5.0 + 1e-2 * np.cos(phase)}
    found = gl.harmonic_balance(system, 100.0, 110.0, inputs=loaded)
    wheel = 5.0 / (0.1 + 0.1 / 4)  # rad/s of the pinion; the wheel's damper counts by the square of the ratio
    assert found.mean("a.w") == pytest.approx(wheel, rel=1e-9)
    assert found.mean("mesh.q") == pytest.approx(5e-4 + 0.1 * wheel / 2 / 0.1 / 1e8, rel=1e-9)
    without = gl.harmonic_balance(gl.compile(Loose()), 100.0, 110.0, inputs=loaded, points=2)  # phases and angles are left out
    assert not any("turned" in name or name.endswith("phi") for name in without.outputs)


def test_a_frequency_in_hertz() -> None:
    """It is converted where it is declared so, for its bounds as well; where it is not, the message says what varies otherwise."""

    class Shaken(gl.Component):
        x = gl.Variable("1", "place")
        v = gl.Variable("1", "speed")
        f = gl.Parameter("Hz", default=0.0, max=0.1)
        g = gl.Parameter("1/s", default=0.0)

        def equations(self) -> list[gl.Eq]:
            spring = self.x + 2 * ZETA * self.v
            return [
                gl.Eq(gl.der(self.x), self.v),
                gl.Eq(gl.der(self.v), gl.cos(2 * gl.pi * (self.f + self.g) * gl.time) - spring),
            ]

    system = gl.compile(Shaken())
    found = gl.harmonic_balance(system, 0.3, 0.5, frequency="f", outputs=["x"])
    assert found.amplitude("x") == pytest.approx(1 / np.abs(1 - found.omega**2 + 2j * ZETA * found.omega), rel=1e-9)
    with pytest.raises(gl.GearlibError, match=r"g was set to that frequency, and .* counts in Hz"):
        gl.harmonic_balance(system, 0.3, 0.5, frequency="g")
    whole = gl.harmonic_balance(system, 0.2 * np.pi, 0.3, frequency="f", outputs=["x"], harmonics=1)  # from its largest value
    back = gl.harmonic_balance(system, 0.3, 0.2 * np.pi, frequency="f", outputs=["x"], harmonics=1)
    assert whole.amplitude("x")[[0, -1]] == pytest.approx(back.amplitude("x")[[-1, 0]], rel=1e-9)
    for start, end in ((0.3, 0.63), (0.63, 0.3)):
        with pytest.raises(gl.GearlibError, match=r"f is 0\.1002\d*; expected at most 0\.1"):
            gl.harmonic_balance(system, start, end, frequency="f")


def test_forces_that_balance_repeat_but_for_their_rounding() -> None:
    """An excitation that is the same at both sides of a planet cancels there: what is left of it is not a function of time."""

    class Turning(gl.Component):
        w = gl.Parameter("rad/s", default=9000.0)
        E = gl.Parameter("m", default=1e-7)

        def assemble(self) -> list[gl.Connection]:
            self.at_sun, self.at_ring, self.at_carrier = gp.Torque(tau=-126.7), gp.Torque(tau=-506.8), gp.Torque(tau=633.5)
            self.x = gp.PlanetaryUnit(
                planet_meshes="separate", Z_s=24, Z_p=36, Z_r=96, planets=5, R_s=0.03, R_p=0.045, I_s=0.0015, I_r=0.151, I_h=0.0491,
                I_spin=0.0094, I_orbit=0.0094, K_ring=1.8e8, C_ring=2000.0, K_sun=1.2e8, C_sun=2000.0,
                e_rate=-self.E * self.w * gl.sin(self.w * gl.time),
            )  # fmt: skip
            return [
                gl.connect(self.at_sun.flange, self.x.sun),
                gl.connect(self.at_ring.flange, self.x.ring),
                gl.connect(self.at_carrier.flange, self.x.carrier),
            ]

    system = gl.compile(Turning(), outputs=["x.sun_meshes[0].q"])
    rest = system.simulate(1.0, samples=2, parameters={"E": 0.0})
    guess = {name: float(rest[name][-1]) for name in system.states}
    rng = np.random.default_rng(3)
    for _ in range(8):
        E, w = 10 ** rng.uniform(-8, -6.5), float(rng.uniform(3e3, 1.5e4))
        found = gl.harmonic_balance(
            system, w, 1.001 * w, frequency="w", guess=guess, parameters={"E": E}, harmonics=1, step=1.0, points=2
        )
        assert found.mean("x.sun_meshes[0].q")[0] == pytest.approx(rest["x.sun_meshes[0].q"][-1], rel=1e-6)


@pytest.mark.parametrize("zeros", [("b.J",), ("a.J", "b.J"), ("s1.d",), ("s1.c",), ("b.J", "s1.d")])
def test_parameters_that_are_zero_where_they_would_be_divided_by(zeros: tuple[str, ...]) -> None:
    """Two bodies in a row to the housing: by the impedance of the chain."""

    class Chain(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.ground = gp.Torque(), gp.Fixed()
            self.a, self.b = gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.s1, self.s2 = gp.SpringDamper(c=1.0, d=0.2), gp.SpringDamper(c=3.0, d=0.3)
            return [
                gl.connect(self.torque.flange, self.a.flange_a),
                gl.connect(self.a.flange_b, self.s1.flange_a),
                gl.connect(self.s1.flange_b, self.b.flange_a),
                gl.connect(self.b.flange_b, self.s2.flange_a),
                gl.connect(self.s2.flange_b, self.ground.flange),
            ]

    numbers = {"a.J": 1.0, "b.J": 2.0, "s1.c": 1.0, "s1.d": 0.2, "s2.c": 3.0, "s2.d": 0.3, **dict.fromkeys(zeros, 0.0)}
    system = gl.compile(Chain())
    found = gl.harmonic_balance(
        system, 0.5, 1.5, inputs={"torque.tau": lambda phase, w: np.cos(phase)}, outputs=["a.w"],
        parameters=dict.fromkeys(zeros, 0.0),
    )  # fmt: skip
    s = 1j * found.omega
    to_b, to_ground = (numbers[f"{n}.c"] / s + numbers[f"{n}.d"] for n in ("s1", "s2"))
    beyond = s * numbers["b.J"] + to_ground
    expected = np.abs(1 / (s * numbers["a.J"] + to_b * beyond / (to_b + beyond)))
    assert found.amplitude("a.w") == pytest.approx(expected, rel=1e-8)
    flow = system.power_flow(torques={"torque.tau": 1.0}, parameters=dict.fromkeys(zeros, 0.0))
    assert flow["a.flange_a"].speed == pytest.approx(1.0 / 0.2 if "s1.c" in zeros else 0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("given", "harmonics", "switching", "count"),
    [
        (None, 1, False, 64), (None, 8, False, 64), (None, 9, False, 72), (None, 40, False, 320), (None, 40, True, 320),
        (None, 1, True, 256), (None, 33, True, 264), (10, 4, True, 10), (11, 4, False, 11),
    ],
)  # fmt: skip
def test_a_period_has_eight_samples_for_each_harmonic_and_more_for_few(
    given: int | None, harmonics: int, switching: bool, count: int
) -> None:
    assert samples_of_a_period(given, harmonics, switching) == count
    with pytest.raises(
        gl.GearlibError, match=rf"a whole number from {2 * harmonics + 2} on \({harmonics} harmonics need as many\)"
    ):
        samples_of_a_period(2 * harmonics + 1, harmonics, switching)


def test_a_fixed_frequency_that_is_a_multiple_of_the_first_one_is_refused() -> None:
    """Between the ends it is no multiple, and the series would be that of a force that jumps after each period."""
    system = gl.compile(Duffing())
    said = r"^the input F is not 2 pi periodic in the phase: it differs by .* after a period at 1\.38197 rad/s\."
    with pytest.raises(gl.GearlibError, match=said):
        gl.harmonic_balance(system, 1.0, 2.0, inputs={"F": lambda phase, w: np.cos(phase) + np.cos(3.0 / w * phase)})


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_vibration_at_any_frequency(unit: float) -> None:
    """``x'' = F - 2 z W x' - W^2 x``: at W = 1e9 rad/s, speeds and angles are far apart, and nothing is undetermined."""

    class Vibration(gl.Component):
        F = gl.Input("m/s2")
        x = gl.Variable("m")
        v = gl.Variable("m/s")
        W = gl.Parameter("rad/s", default=unit)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), self.v),
                gl.Eq(gl.der(self.v), self.F - 2 * ZETA * self.W * self.v - self.W**2 * self.x),
            ]

    found = gl.harmonic_balance(
        gl.compile(Vibration()), 0.4 * unit, 1.4 * unit, inputs={"F": lambda phase, w: np.cos(phase)}, outputs=["x"], step=0.1
    )
    w = found.omega / unit
    assert found.amplitude("x") * unit**2 == pytest.approx(1 / np.abs(1 - w**2 + 2j * ZETA * w), rel=1e-8)
    multiplier = np.exp(-2 * np.pi * ZETA / w)
    assert np.abs(found.multipliers) == pytest.approx(np.column_stack([multiplier, multiplier]), rel=1e-6)
