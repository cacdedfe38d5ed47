"""Unequal planets: errors of the pins and unequal spacing, against a minimum of the elastic energy written by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError

SIZES = {
    "r_s": 0.03, "r_r": 0.09, "r_p": 0.03, "r_c": 0.064, "m_s": 0.4, "m_r": 2.0, "m_c": 3.0, "m_p": 0.6, "I_s": 4e-4, "I_r": 2e-2,
    "I_c": 6e-3, "I_p": 6e-4, "k_sp": 5e8, "k_rp": 6e8, "k_r": 1e8, "k_c": 2e8, "k_p": 1e8, "k_ring_phi": 1e6, "alpha": 0.4,
}  # fmt: skip
TORQUE = 300.0


class Loaded(gl.Component):
    """A torque on the sun; the ring's support and a held carrier take it."""

    k_s = gl.Parameter("N/m", "bearing stiffness of the sun")
    positions = gl.Structural(())
    pin_errors = gl.Structural(())
    planets = gl.Structural(3)

    def assemble(self) -> list[Any]:
        self.drive, self.ground = gp.ConstantTorque(tau_constant=TORQUE), gp.Fixed()
        self.unit = gp.PlanarPlanetaryUnit(
            planets=self.planets, ring_held=True, positions=self.positions, pin_errors=self.pin_errors, k_s=self.k_s, **SIZES
        )
        return [gl.connect(self.drive.flange, self.unit.sun), gl.connect(self.unit.carrier, self.ground.flange)]


def forces(model: Loaded) -> np.ndarray[Any, Any]:
    names = [f"unit.sun_mesh[{n}].f" for n in range(model.planets)]
    result = gl.simulate(model, 1e-6, start="steady", samples=2, outputs=names)
    return np.array([result[name][0] for name in names])


def forces_by_hand(angles: list[float], errors: list[float], k_s: float) -> np.ndarray[Any, Any]:
    """Deflections are linear in the displacements x, y, r phi of sun, ring and planets, and x, y of the carrier, which cannot turn."""
    p = SIZES
    count = len(angles)
    rows, stiff, fixed = [], [], []
    size = 3 + 3 + 2 + 3 * count  # sun, ring (x, y, phi), carrier (x, y), planets (x, y, phi)

    def add(row: dict[int, float], k: float, offset: float = 0.0) -> None:
        rows.append([row.get(j, 0.0) for j in range(size)])
        stiff.append(k)
        fixed.append(offset)

    for j, k in ((0, k_s), (1, k_s), (3, p["k_r"]), (4, p["k_r"]), (5, p["k_ring_phi"]), (6, p["k_c"]), (7, p["k_c"])):
        add({j: 1.0}, k)
    for n, (psi, error) in enumerate(zip(angles, errors, strict=True)):
        x, y, phi = (8 + 3 * n + j for j in range(3))
        for gear, r_a, r_b, theta, k in (
            (0, p["r_s"], p["r_p"], psi - p["alpha"], p["k_sp"]),
            (3, p["r_r"], -p["r_p"], psi + p["alpha"], p["k_rp"]),
        ):
            c, s = math.cos(theta), math.sin(theta)
            add({gear: -s, gear + 1: c, x: s, y: -c, gear + 2: r_a, phi: r_b}, k)
        c, s = math.cos(psi), math.sin(psi)
        add({6: c, 7: s, x: -c, y: -s}, p["k_p"])
        add({6: -s, 7: c, x: s, y: -c}, p["k_p"], error)
    S, K = np.array(rows), np.diag(stiff)
    load = np.zeros(size)
    load[2] = TORQUE
    displacements = np.linalg.lstsq(S.T @ K @ S, load - S.T @ K @ np.array(fixed), rcond=None)[0]
    every = K @ (S @ displacements + fixed)
    return every[7::4]


@pytest.mark.parametrize("k_s", [1e8, 1e3])
def test_errors_of_pins_and_unequal_spacing(k_s: float) -> None:
    angles, errors = [0.0, 1.5, 3.2, 4.8], [0.0, 20e-6, -5e-6, 10e-6]
    found = forces(Loaded(planets=4, k_s=k_s, positions=tuple(angles), pin_errors=tuple(errors)))
    assert found == pytest.approx(forces_by_hand(angles, errors, k_s), rel=1e-6)
    assert found.sum() * SIZES["r_s"] == pytest.approx(TORQUE, rel=1e-9)
    assert np.ptp(found) > 0.05 * found.mean()


def test_three_planets_around_a_floating_sun_share_equally() -> None:
    found = forces(Loaded(k_s=0.0, pin_errors=(0.0, 30e-6, -10e-6)))
    assert found == pytest.approx(np.full(3, TORQUE / SIZES["r_s"] / 3), rel=1e-9)
    held = forces(Loaded(k_s=1e9, pin_errors=(0.0, 30e-6, -10e-6)))
    assert np.ptp(held) > 0.1 * held.mean()


def test_one_error_for_each_pin() -> None:
    with pytest.raises(BindingError, match="2 pin_errors for 3 planets"):
        gl.compile(Loaded(k_s=1e8, pin_errors=(0.0, 1e-5)))


class PlanarTrain(gl.Component):
    """The XP train with a planar X unit: a floating sun, planets where 19 and 81 teeth let them be assembled, and an error of one pin."""

    def assemble(self) -> list[gl.Connection]:
        self.drive, self.load, self.ground = gp.ConstantTorque(tau_constant=100.0), gp.Damper(d=1800 * 0.075**2), gp.Fixed()
        self.x_unit = gp.PlanetaryUnit(
            level="planar", planets=3, positions=gp.planet_positions(19, 81, 3), pin_errors=(10e-6, 0.0, 0.0), R_s=0.0285, R_p=0.0465,
            R_r=0.1215, R_h=0.075, I_s=0.0015, I_r=0.151, I_h=0.0491, I_spin=0.0094, I_orbit=0.0094, K_ring=1.8e8, C_ring=2000.0,
            K_sun=1.8e8, C_sun=2000.0, k_s=0.0,
        )  # fmt: skip
        self.p_unit = gp.FixedAxisUnit(R_1=0.0285, R_2=0.0465, I_1=0.0015, I_2=0.0094, K_g=1.8e8, C_g=2000.0)
        self.coupling = gp.IdealGear(ratio=-1.0)
        return [
            gl.connect(self.drive.flange, self.x_unit.ring),
            gl.connect(self.x_unit.sun, self.p_unit.flange_a),
            gl.connect(self.p_unit.flange_b, self.coupling.flange_a),
            gl.connect(self.coupling.flange_b, self.x_unit.carrier, self.load.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]


def test_the_xp_train_with_a_floating_sun_shares_its_load_by_the_positions_of_its_planets() -> None:
    """Three forces that balance are as the sines of the angles between the other two (Lami); a pin's error does not matter."""
    forces = [f"x_unit.planar.sun_mesh[{n}].f" for n in range(3)]
    run = gl.compile(PlanarTrain(), outputs=forces).simulate(1.0, samples=2)
    psi = gp.planet_positions(19, 81, 3)
    sines = [math.sin((psi[(n + 2) % 3] - psi[(n + 1) % 3]) % (2 * math.pi)) for n in range(3)]
    found = [float(run[name][-1]) for name in forces]
    assert [f / found[1] for f in found] == pytest.approx([s / sines[1] for s in sines], rel=1e-3)
    assert found[0] < 0.97 * found[1]
