"""Floquet multipliers of trains that turn: which of them belong to rigid motions, and which to vibration."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import gearlib as gl
import gearparts as gp
from gearlib.periodic.first_motion import Forced
from gearlib.periodic.floquet import monodromy, vibration_multipliers
from gearlib.periodic.periods import fourier, jumps, moments
from tests.periodic.models import STIFF, STOP, ZETA, driven, motion

W_SUN, W_RING, W_PLANET = 31 / 19, 23 / 27, -19 / 31  # speeds over that of the carrier
PRELOAD = 100 / 0.1215 / 1.8e8  # by which 100 N.m on the ring press a mesh together


class TurningTrain(gl.Component):
    """The XP train with all its planets under balanced torques: the stiffness of their meshes varies as the train turns."""

    depth = gl.Structural(0.35, "amplitude of the stiffness over its mean")

    def assemble(self) -> list[gl.Connection]:
        gap = (("backlash", True), ("b", 100e-6))
        varying = (("stiffness", "sinusoidal"), ("c_amplitude", self.depth), *gap)
        self.drive, self.load = gp.ConstantTorque(tau_constant=100.0), gp.ConstantTorque(tau_constant=-100.0 * W_RING)
        self.train = gp.XPTrain(
            Z_s=19, Z_p=31, Z_r=81, planet_meshes="separate", ring_details=varying, sun_details=varying, pair_details=gap
        )
        return [gl.connect(self.drive.flange, self.train.flange_in), gl.connect(self.train.flange_out, self.load.flange)]


def rest(system: gl.System, omega: float) -> dict[str, float]:
    """Speeds without vibration at which the planets' teeth meet ``omega / (2 pi)`` times a second, and the preloads."""
    carrier = omega / (19 * (W_SUN - 1))
    speeds = {"ring_gear.w": W_RING, "carrier_body.w": 1.0, "shaft_at_sun.w": W_SUN, "spin.w": W_PLANET}
    found = {}
    for name in system.states:
        for ending, ratio in speeds.items():
            if name.endswith(ending):
                found[name] = ratio * carrier
        if name.endswith(".q"):
            found[name] = -50e-6 - PRELOAD if "p_unit" in name else 50e-6 + PRELOAD / 3
    return found


def test_multipliers_of_the_turning_train_are_those_of_runs() -> None:
    """Ten of nineteen; the others are 1: the train's momentum, the phase, and what the loops of its meshes keep."""
    system = gl.compile(TurningTrain())
    turning = {name: -1.0 if "ring" in name else 1.0 for name in system.states if "_meshes" in name and name.endswith("turned")}
    used = [name for name in system.states if not name.endswith("p_unit.mesh.turned")]
    outputs = [name for name in used if name not in turning]
    omega = 18000.0
    found = gl.harmonic_balance(
        system, omega, omega - 1.0, turning=turning, guess=rest(system, omega), outputs=outputs, harmonics=4, step=1.0, points=2
    )
    assert not found.stable[0]
    here = {name: float(found.waveform(name, 0, 1)[1][0]) for name in outputs} | dict.fromkeys(turning, 0.0)
    kinds = {".w": 1e-3, ".q": 1e-9, "turned": 1e-3}
    size = [next(size for ending, size in kinds.items() if name.endswith(ending)) for name in used]

    def after(name: str, change: float) -> np.ndarray:
        start = here | {name: here[name] + change}
        run = system.simulate(2 * np.pi / omega, samples=2, start=start, rtol=1e-11, method="rk")
        return np.array([run[n][-1] for n in used])

    columns = [(after(name, h) - after(name, -h)) / (2 * h) for name, h in zip(used, size, strict=True)]
    over_period = np.linalg.eigvals(np.array(columns).T)
    others = over_period[np.argsort(np.abs(over_period - 1.0))][9:]
    assert len(found.multipliers[0]) == 10
    assert np.sort_complex(found.multipliers[0]) == pytest.approx(np.sort_complex(others), abs=2e-3)
    assert np.abs(others).max() > 1.05


@pytest.mark.parametrize("multiplier", [0.5, 1.0 - 1e-9, 1.0 + 1e-9, 1.2])
def test_a_multiplier_near_1_is_not_taken_for_a_rigid_motion(multiplier: float) -> None:
    """A wheel that turns freely (angle, speed) drives a vibration; what it keeps and its angle are told from their directions."""
    over_period = np.array([[1.0, 2.0, 0.3], [0.0, 1.0, 0.0], [0.0, 0.5, multiplier]])
    swapped = np.random.default_rng(2).normal(size=(3, 3))  # in other coordinates
    sums = np.linalg.qr(np.linalg.inv(swapped).T[:, 1:2])[0]
    idle = np.linalg.qr(swapped[:, 0:1])[0]
    found = vibration_multipliers(swapped @ over_period @ np.linalg.inv(swapped), sums, idle, np.zeros(3))
    assert found == pytest.approx([multiplier], rel=1e-12)


def test_a_direction_that_a_jump_depends_on_is_no_rigid_motion() -> None:
    """Between its jumps no force depends on the phase of a rectangular stiffness; over a period the motion does."""
    over_period = np.array([[0.9, 0.4], [0.1, 0.8]])
    phase = np.eye(2)[:, 1:2]
    found = vibration_multipliers(over_period, phase, phase, np.zeros(2))
    assert np.sort(found.real) == pytest.approx(np.sort(np.linalg.eigvals(over_period).real))


def test_disturbances_pass_corners_and_jumps_as_linear_pieces_do() -> None:
    """Between its switches the train is linear with constant coefficients: exponentials, and a jump at each turn of the friction."""
    omega, c = 0.8, motion(0.8)
    found = moments(driven(omega), c, 400)
    cuts = jumps(driven(omega), c, found, np.ones(2))
    assert cuts is not None
    expected = np.eye(2)
    for i, (begin, end, _) in enumerate(found.pieces):
        expected = expected + np.outer(cuts.jump[i], cuts.gradient[i] @ expected) / cuts.rate[i]
        touched = (fourier(np.array([(begin + end) / 2]), 3) @ c)[0, 0] > STOP
        expected = expm(np.array([[0.0, 1.0], [-1.0 - STIFF * touched, -2 * ZETA]]) * (end - begin) / omega) @ expected
    assert monodromy(driven(omega), c, found, cuts, 400) == pytest.approx(expected, abs=1e-6)
    without = monodromy(driven(omega), c, found, None, 400)
    assert np.linalg.det(without) == pytest.approx(np.exp(-2 * ZETA * 2 * np.pi / omega), rel=1e-6)
    assert np.abs(without - expected).max() > 0.1


class Twins(gl.Component):
    """Two oscillators side by side whose dampers act beyond a place only; the second one's is farther away."""

    F = gl.Input("1")
    apart = gl.Parameter("1", default=0.0)
    x, v = gl.Variable("1"), gl.Variable("1")
    y, u = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        damped = [
            gl.Piecewise((0.6 * self.v, self.x > 0.3), (0.0, True)),
            gl.Piecewise((0.6 * self.u, self.y > 0.3 + self.apart), (0.0, True)),
        ]
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.F - self.x - 0.01 * self.v - damped[0]),
            gl.Eq(gl.der(self.y), self.u),
            gl.Eq(gl.der(self.u), self.F - self.y - 0.01 * self.u - damped[1]),
        ]


@cache
def twins() -> gl.System:
    return gl.compile(Twins(), outputs=["x", "v", "y", "u"])


@pytest.mark.parametrize("apart", [0.0, 1e-3, 0.02])
def test_disturbances_of_what_switches_together_are_those_of_each(apart: float) -> None:
    """Between the same two samples: the first oscillator does not know of the second one, which a single one is as well."""
    drive = {"F": lambda phase, w: 0.3 + np.cos(phase)}

    def pairs(apart: float) -> np.ndarray:
        given = {"apart": apart}
        found = gl.harmonic_balance(twins(), 0.5, 0.501, inputs=drive, parameters=given, harmonics=6, points=2)
        upper = found.multipliers[0][found.multipliers[0].imag > 0]
        return upper[np.argsort(-upper.imag)]

    alone = pairs(0.5)  # switching far from each other
    assert np.abs(pairs(apart) - alone[1]).min() < 1e-7
    if not apart:
        assert pairs(0.0) == pytest.approx([alone[1], alone[1]], rel=1e-6)


class Pumped(gl.Component):
    """An oscillator whose stiffness a motion of its own varies: ``x'' + 0.1 x' + x + x**3 = 0``."""

    x = gl.Variable("1")
    v = gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), -0.1 * self.v - self.x - self.x**3)]


@cache
def pumped() -> Forced:
    return Forced(gl.compile(Pumped()).translation, None, {}, {}, 1, {})


def test_disturbances_of_smooth_motions_are_those_of_integration_to_fourth_order() -> None:
    """About ``x = 0.2 + 0.8 cos(w t) + 0.5 sin(w t)``, whatever makes it move so; half the step, a sixteenth of the error."""
    omega, c = 1.3, np.array([[0.2, 0.0], [0.8, 0.0], [0.5, 0.0]])

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        x = 0.2 + 0.8 * np.cos(omega * t) + 0.5 * np.sin(omega * t)
        return (np.array([[0.0, 1.0], [-1.0 - 3 * x**2, -0.1]]) @ y.reshape(2, 2)).ravel()

    expected = solve_ivp(rate, (0.0, 2 * np.pi / omega), np.eye(2).ravel(), rtol=1e-12, atol=1e-13).y[:, -1].reshape(2, 2)
    driven_ = pumped().driven(pumped().scene(["x", "v"]))(omega)
    errors = []
    for samples in (94, 190, 382):
        found = moments(driven_, c, samples)
        errors.append(np.abs(monodromy(driven_, c, found, None, samples) - expected).max())
    assert errors[0] < 4e-4
    assert errors[0] / errors[1] == pytest.approx((190 / 94) ** 4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx((382 / 190) ** 4, rel=0.1)


@pytest.mark.parametrize(("omega", "within"), [(0.05, 1e-5), (0.2, 2e-5)])
@pytest.mark.parametrize("wave", [(0.2, 0.8, 0.5), (0.0, 0.0, 1.2), (0.0, 0.0, -1.2), (0.5, -0.6, 0.0)])
def test_disturbances_of_slow_motions_are_those_of_integration(wave: tuple[float, ...], omega: float, within: float) -> None:
    """The free vibration passes many periods in one of the motion, and several of them between two samples.

    It is the fastest anywhere in the period, also where that begins with a slow one.
    """
    c = np.column_stack([wave, np.zeros(3)])

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        x = wave[0] + wave[1] * np.cos(omega * t) + wave[2] * np.sin(omega * t)
        return (np.array([[0.0, 1.0], [-1.0 - 3 * x**2, -0.1]]) @ y.reshape(2, 2)).ravel()

    found = solve_ivp(rate, (0.0, 2 * np.pi / omega), np.eye(2).ravel(), rtol=1e-9, atol=1e-12, method="DOP853")
    expected = found.y[:, -1].reshape(2, 2)
    driven_ = pumped().driven(pumped().scene(["x", "v"]))(omega)
    assert np.abs(monodromy(driven_, c, moments(driven_, c, 32), None, 32) - expected).max() < within * np.abs(expected).max()


class Decaying(gl.Component):
    """What decays at a given rate beside a slow oscillator."""

    F = gl.Input("1")
    rate = gl.Parameter("1/s", default=1.0)
    x, v, z = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.F - 0.1 * self.v - self.x),
            gl.Eq(gl.der(self.z), self.rate * (self.x - self.z)),
        ]


@cache
def decaying() -> gl.System:
    return gl.compile(Decaying(), outputs=["z"])


@pytest.mark.parametrize("rate", [1.0, 10.0, 1e2, 1e4, 1e6])
def test_what_decays_within_a_period_has_the_multiplier_of_its_pole(rate: float) -> None:
    drive = {"F": lambda phase, w: np.cos(phase)}
    found = gl.harmonic_balance(decaying(), 0.5, 0.51, inputs=drive, parameters={"rate": rate}, harmonics=1, points=2)
    sizes = np.sort(np.abs(found.multipliers[0]))
    assert sizes == pytest.approx(np.exp(-np.array([rate, 0.05, 0.05]) * 4 * np.pi), rel=1e-5, abs=1e-9)


def test_the_phase_of_a_turning_train_is_one_multiplier_and_no_more() -> None:
    """The eigenvalue nearest to 1 goes where a mesh phase grows, unless that direction is idle and gone already."""
    over_period = np.diag([1.0 + 1e-4, 0.9, -0.8])
    none, growth = np.empty((3, 0)), np.array([1.0, 0.0, 0.0])
    assert np.sort(vibration_multipliers(over_period, none, none, growth).real) == pytest.approx([-0.8, 0.9])
    assert np.sort(vibration_multipliers(over_period, none, none, 0 * growth).real) == pytest.approx([-0.8, 0.9, 1.0001])
    idle = np.eye(3)[:, :1]
    exact = np.diag([1.0, 0.9, -0.8])
    assert np.sort(vibration_multipliers(exact, none, idle, growth).real) == pytest.approx([-0.8, 0.9])
