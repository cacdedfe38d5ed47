"""Floquet multipliers of trains that turn: which of them belong to rigid motions, and which to vibration."""

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.periodic.floquet import vibration_multipliers

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
