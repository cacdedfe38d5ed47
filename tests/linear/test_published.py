"""Natural frequencies printed in the literature."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

# Lin and Parker (1999), table 1: base diameters, mm -> radii, m
R = {"s": 0.0774 / 2, "r": 0.2750 / 2, "c": 0.1768 / 2, "p": 0.1003 / 2}
MASS = {"s": 0.40, "r": 2.35, "c": 5.43, "p": 0.66}
I_OVER_R2 = {"s": 0.39, "r": 3.00, "c": 6.29, "p": 0.61}
ALPHA = np.deg2rad(24.6)
ROTATIONAL = [1536.6, 1970.6, 2625.7, 7773.6, 13071.1]  # as printed
TRANSLATIONAL = [727.0, 1091.0, 1892.8, 2342.5, 7189.9, 10437.6]
PLANET = [1808.2, 5963.8, 6981.7]
COMPUTED = {727.0: 727.267, 1091.0: 1091.164, 1536.6: 1536.535}  # where the printed data give something else


def planar(planets: int, **changes: Any) -> gl.System:
    inertia = {f"I_{b}": I_OVER_R2[b] * R[b] ** 2 for b in R}
    values = {f"m_{b}": MASS[b] for b in MASS} | inertia | {f"r_{b}": R[b] for b in R}
    values |= {"k_sp": 5e8, "k_rp": 5e8, "k_s": 1e8, "k_r": 1e8, "k_c": 1e8, "k_p": 1e8, "alpha": ALPHA}
    values |= {"k_ring_phi": 1e9 * R["r"] ** 2} | changes
    return gl.compile(gp.PlanarPlanetaryUnit(planets=planets, ring_held=True, **values))


def by_hand(n: int) -> Any:
    """Eigenvalues (rad/s)^2 of M x'' + K x = 0 with x, y, u of carrier, ring, sun, planets, from the springs' deflections."""
    size = 3 * (n + 3)
    masses, K = np.zeros(size), np.zeros((size, size))
    for k, body in enumerate("crs"):
        masses[3 * k : 3 * k + 3] = MASS[body], MASS[body], I_OVER_R2[body]
        for axis in (0, 1):
            K[3 * k + axis, 3 * k + axis] += 1e8
    K[5, 5] += 1e9
    for planet in range(n):
        at = 9 + 3 * planet
        masses[at : at + 3] = MASS["p"], MASS["p"], I_OVER_R2["p"]
        psi = 2 * np.pi * planet / n
        rows = np.zeros((4, size))  # sun mesh, ring mesh, bearing radial and tangential; zeta, eta, u of the planet
        rows[0, 6:9] = -np.sin(psi - ALPHA), np.cos(psi - ALPHA), 1
        rows[0, at : at + 3] = -np.sin(ALPHA), -np.cos(ALPHA), 1
        rows[1, 3:6] = -np.sin(psi + ALPHA), np.cos(psi + ALPHA), 1
        rows[1, at : at + 3] = np.sin(ALPHA), -np.cos(ALPHA), -1
        rows[2, 0:2], rows[2, at] = (np.cos(psi), np.sin(psi)), -1
        rows[3, 0:3], rows[3, at + 1] = (-np.sin(psi), np.cos(psi), 1), -1
        for row, k in zip(rows, (5e8, 5e8, 1e8, 1e8), strict=True):
            K += k * np.outer(row, row)
    root = 1 / np.sqrt(masses)
    return np.linalg.eigvalsh(root[:, None] * K * root)


def frequencies(squares: Any) -> Any:
    return np.sqrt(np.abs(squares)) / (2 * np.pi)


def by_symmetry(n: int) -> tuple[Any, Any, Any]:
    """Rotational, translational and planet modes each by themselves, Hz, after the structure proved in the paper.

    All planets move alike, with a phase of one turn round the sun (central bodies then circle, x + i y), or with central bodies at
    rest: each time the springs of one planet are enough.
    """
    e, s, c = np.exp(1j * ALPHA), np.sin(ALPHA), np.cos(ALPHA)
    stiffness = np.diag([5e8, 5e8, 1e8, 1e8])
    planet = np.array([[-s, -c, 1], [s, -c, -1], [-1, 0, 0], [0, -1, 0]])  # zeta, eta, u in both meshes and in the bearing
    masses = [MASS["p"], MASS["p"], I_OVER_R2["p"]]
    turning = np.array([[0, 0, 1], [0, 1, 0], [0, 0, 0], [1, 0, 0]])  # u of carrier, ring, sun
    circling = np.array([[0, 0, -1j * e], [0, -1j / e, 0], [1, 0, 0], [-1j, 0, 0]])
    result = []
    for central, inertia, support in (
        (turning, I_OVER_R2, np.array([0, 1e9, 0])), (circling, {b: 2 * m for b, m in MASS.items()}, np.full(3, 2e8)),
    ):  # fmt: skip
        springs = np.hstack([central, planet])
        K = n * springs.conj().T @ stiffness @ springs + np.diag([*support, 0, 0, 0])
        root = 1 / np.sqrt([inertia["c"], inertia["r"], inertia["s"], *(n * np.array(masses))])
        result.append(frequencies(np.linalg.eigvalsh(root[:, None] * K * root)))
    root = 1 / np.sqrt(masses)
    result.append(frequencies(np.linalg.eigvalsh(root[:, None] * (planet.T @ stiffness @ planet) * root)))
    return result[0], result[1], result[2]


def test_lin_parker_planar_four_planets() -> None:
    """Twelve of the fifteen printed numbers agree in every digit; of the other three see the next test."""
    found = gl.modes(planar(4))
    assert found.free == 1
    assert found.preloads == 0
    printed = sorted([0.0, *ROTATIONAL, *np.repeat(TRANSLATIONAL, 2), *PLANET])
    for mine, theirs in zip(found.frequencies, printed, strict=True):
        if theirs in COMPUTED:
            assert mine == pytest.approx(COMPUTED[theirs], abs=0.0006)
        else:
            assert mine == pytest.approx(theirs, abs=0.0501)


def test_lin_parker_again_from_the_symmetry_of_the_modes() -> None:
    rotational, translational, planet = by_symmetry(4)
    assert rotational[0] == pytest.approx(0.0, abs=1e-2)
    assert sorted([*rotational[1:], *np.repeat(translational, 2), *planet]) == pytest.approx(
        gl.modes(planar(4)).frequencies[1:], rel=1e-10
    )
    for mine, theirs in zip([*rotational[1:], *translational], [*ROTATIONAL, *TRANSLATIONAL], strict=True):
        assert mine == pytest.approx(COMPUTED.get(theirs, theirs), abs=0.0501)


def test_what_disagrees_is_within_the_rounding_of_the_printed_data() -> None:
    """Masses and inertias are printed to 0.01 kg, the angle to 0.1 degrees: half of that moves the three by more than they are off."""
    exact = frequencies(by_hand(4))
    room = np.zeros(len(exact))
    for table in (MASS, I_OVER_R2):
        for body in table:
            value = table[body]
            table[body] = value + 0.005
            room += np.abs(frequencies(by_hand(4)) - exact)
            table[body] = value
    for printed, computed in COMPUTED.items():
        assert abs(printed - computed) < room[int(np.argmin(np.abs(exact - computed)))]


@pytest.mark.parametrize("planets", [3, 4, 5, 6])
def test_planar_unit_equals_matrices_by_hand(planets: int) -> None:
    expected = np.sqrt(np.abs(by_hand(planets))) / (2 * np.pi)
    assert gl.modes(planar(planets)).frequencies[1:] == pytest.approx(expected[1:], rel=1e-10)


@pytest.mark.parametrize("planets", [3, 4, 5, 6])
def test_structure_of_the_modes(planets: int) -> None:
    """Six rotational modes, six pairs of translational ones, three planet modes of multiplicity N - 3 (section 4 of the paper)."""
    found = gl.modes(planar(planets))
    f = found.frequencies
    clusters = np.split(f, np.flatnonzero(np.diff(f) > 1e-6 * f[1:]) + 1)
    sizes = sorted(len(c) for c in clusters)
    assert sizes == sorted([1] * 6 + [2] * 6 + [planets - 3] * 3 * (planets > 3))
    energy = found.to_dataframe()["kinetic, %"]
    central = energy[["sun_gear", "ring_gear", "carrier_body"]].sum(axis=1).to_numpy()
    still = [k for k in range(len(f)) if central[k] < 1e-6]
    assert len(still) == 3 * (planets - 3)  # in planet modes only the planets move
    if planets > 3:
        assert np.unique(np.round(f[still], 1)) == pytest.approx(PLANET, abs=0.051)  # the same for all N


@pytest.mark.parametrize("planets", [4])
def test_lin_parker_torsional(planets: int) -> None:
    class Held(gl.Component):
        def assemble(self) -> list[Any]:
            inertia = {b: I_OVER_R2[b] * R[b] ** 2 for b in R}
            self.unit = gp.PlanetaryUnit(
                planets=planets, planet_meshes="separate", R_s=R["s"], R_p=R["p"], R_r=R["r"], R_h=R["c"] * np.cos(ALPHA),
                I_s=inertia["s"], I_r=inertia["r"], I_h=inertia["c"], I_spin=inertia["p"], I_orbit=MASS["p"] * R["c"] ** 2,
                K_ring=5e8, C_ring=0.0, K_sun=5e8, C_sun=0.0,
            )  # fmt: skip
            self.support, self.ground = gp.Spring(c=1e9 * R["r"] ** 2), gp.Fixed()
            return [
                gl.connect(self.unit.ring, self.support.flange_a), gl.connect(self.support.flange_b, self.ground.flange),
            ]  # fmt: skip

    found = gl.modes(gl.compile(Held()))
    assert found.free == 1
    # The carrier's inertia over r^2 and its mass of planets are those of the pitch radius, u_c of the base circle.
    expected = [0, 2120.6213, *[6443.9953] * 3, 6635.2115, 12554.3317]
    assert found.frequencies == pytest.approx(expected, rel=1e-8, abs=1e-4)


def test_friswell_geared_shafts() -> None:
    class Machine(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.rotor_1, self.rotor_2 = (gp.Inertia(J=J) for J in (400e-6, 700e-6, 700e-6))
            self.gear_1, self.gear_2 = gp.Inertia(J=25e-6), gp.Inertia(J=25e-6)
            self.shaft, self.shaft_1, self.shaft_2 = gp.Spring(c=1e4), gp.Spring(c=5e3), gp.Spring(c=5e3)
            self.mesh = gp.IdealGear(ratio=-1.0)
            return [
                gl.connect(self.motor.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.gear_1.flange_a),
                gl.connect(self.gear_1.flange_b, self.mesh.flange_a, self.shaft_1.flange_a),
                gl.connect(self.mesh.flange_b, self.gear_2.flange_a),
                gl.connect(self.gear_2.flange_b, self.shaft_2.flange_a),
                gl.connect(self.shaft_1.flange_b, self.rotor_1.flange_a),
                gl.connect(self.shaft_2.flange_b, self.rotor_2.flange_a),
            ]

    found = gl.modes(gl.compile(Machine()))
    assert np.round(found.frequencies, 1).tolist() == [0.0, 425.4, 634.1, 3247.2]


def test_nrel_5_mw() -> None:
    class Turbine(gl.Component):
        def assemble(self) -> list[Any]:
            self.rotor, self.generator = gp.Inertia(J=38_759_236.0), gp.Inertia(J=534.116)
            self.shaft, self.gear = gp.SpringDamper(c=8.67637e8, d=6.215e6), gp.IdealGear(ratio=1 / 97)
            return [
                gl.connect(self.rotor.flange_b, self.shaft.flange_a),
                gl.connect(self.shaft.flange_b, self.gear.flange_a),
                gl.connect(self.gear.flange_b, self.generator.flange_a),
            ]

    found = gl.modes(gl.compile(Turbine()))
    assert round(float(found.frequencies[1]), 4) == 2.2227
    heavy = 534.116 * 97**2
    reduced = 38_759_236.0 * heavy / (38_759_236.0 + heavy)
    assert found.frequencies[1] == pytest.approx(np.sqrt(8.67637e8 / reduced) / (2 * np.pi), rel=1e-12)
    assert found.damping[1] == pytest.approx(6.215e6 / 2 / np.sqrt(8.67637e8 * reduced), rel=1e-11)
