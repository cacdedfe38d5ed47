"""The printed equations (2)-(9) against the energies of the same junction structure, for everything drawn at random."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from gearparts.trains import zhou_cui_2022 as zc


def random_parameters(rng: np.random.Generator, **fixed: float) -> zc.BondParameters:
    m = rng.uniform(0.3, 3.0, 23) * rng.choice([-1.0, 1.0], 23)

    def draw(bonds: tuple[int, ...]) -> dict[int, float]:
        return {bond: float(rng.uniform(0.3, 3.0)) for bond in bonds}

    inertias = draw(zc.INERTIAS) | {int(name[1:]): value for name, value in fixed.items()}
    return zc.BondParameters(m, inertias, draw(zc.RESISTANCES), draw(zc.COMPLIANCES))


def relative(a: Any, b: Any) -> float:
    return float(np.max(np.abs(np.asarray(a) - b)) / np.max(np.abs(b)))


@pytest.mark.parametrize("seed", range(20))
def test_printed_equations_agree_with_the_energy_form(seed: int) -> None:
    rng = np.random.default_rng(seed)
    params = random_parameters(rng)
    x, u = rng.normal(size=8), rng.normal(size=4)
    reference = zc.energy_rhs(x, u, params)
    assert relative(zc.explicit_rhs(0.0, x, params, u), reference) < 1e-12
    # and with the dependent momenta and their derivatives put in from outside
    dependent = zc.momentum_map(params)
    assert relative(zc.printed_rhs(x, dependent @ x, dependent @ reference, u, params), reference) < 1e-12


@pytest.mark.parametrize("name", [field.name for field in fields(zc.Repairs)])
def test_each_repair_is_needed(name: str) -> None:
    rng = np.random.default_rng(1)
    params, x, u = random_parameters(rng), rng.normal(size=8), rng.normal(size=4)
    A, B = zc.explicit_matrices(params, zc.Repairs(**{name: False}))
    assert relative(A @ x + B @ u, zc.energy_rhs(x, u, params)) > 1e-3


def test_equation_5_is_exact_as_printed_without_the_shaft() -> None:
    rng = np.random.default_rng(2)
    params, x, u = random_parameters(rng, I62=0.0), rng.normal(size=8), rng.normal(size=4)
    u[1] = u[2]  # the printed Sf8 for Sf32 does not matter where both are equal, as in the paper
    A, B = zc.explicit_matrices(params, zc.Repairs(shaft_inertia=False, sun_mesh_source=False))
    assert relative(A @ x + B @ u, zc.energy_rhs(x, u, params)) < 1e-12


def test_geometry_gives_willis_equation() -> None:
    params = zc.bond_parameters()
    R = {name: zc.TABLE_4[name].value for name in ("R_s", "R_p", "R_r", "R_h")}
    rows = zc.flow_rows(params)
    # no mesh deflection, no slip at the supports: three conditions, five flows, two degrees of freedom of the X unit
    conditions = np.array([rows[bond][:5] for bond in (6, 30, 85)])
    willis = R["R_r"] * rows[2][:5] + R["R_s"] * rows[26][:5] - 2 * R["R_h"] * rows[81][:5]
    free = np.linalg.svd(conditions)[2][3:]
    assert np.abs(free @ willis).max() < 1e-16
    assert np.linalg.matrix_rank(conditions) == 3
    assert 2 * R["R_h"] == pytest.approx(R["R_r"] + R["R_s"])
    for gear in "spr":
        assert R[f"R_{gear}"] / zc.TABLE_4[f"Z_{gear}"].value == pytest.approx(0.0015)


def test_rate_of_energy_is_power_in_less_dissipation() -> None:
    rng = np.random.default_rng(3)
    params, x, u = zc.bond_parameters(), rng.normal(size=8) * 1e-3, np.array([100.0, 1e-3, 2e-3, 3e-3])
    dx, f = zc.explicit_rhs(0.0, x, params, u), zc.flows(x, params, u)
    df = zc.flows(dx, params)  # flows are linear in the state, and the sources are constant
    stored = sum(params.I[b] * f[b] * df[b] for b in zc.INERTIAS)
    stored += sum(x[k] * dx[k] / params.C[b] for k, b in ((1, 6), (4, 30), (6, 74)))
    meshes = ((1, 1, 6, 7), (2, 4, 30, 31), (3, 6, 74, 75))
    mesh = sum(u[k] * (x[i] / params.C[b] + params.R[r] * f[r]) for k, i, b, r in meshes)
    lost = sum(params.R[b] * f[b] ** 2 for b in zc.RESISTANCES)
    assert stored == pytest.approx(u[0] * f[1] + mesh - lost, rel=1e-10)


def test_table_4_is_the_default() -> None:
    params = zc.bond_parameters()
    names = ("R_s", "R_p", "R_r", "R_h", "I_s", "I_p", "I_r", "I_h", "I_f", "K_g", "C_g", "C_v")
    same = zc.bond_parameters(**{name: zc.TABLE_4[name].value for name in names})
    assert (params.I, params.R, params.C) == (same.I, same.R, same.C)
    assert np.array_equal(params.m, same.m, equal_nan=True)
    assert float(zc.transmission_error_rate(0.3)) == pytest.approx(0.0027 * np.cos(28 * 0.3 + 21 * np.pi))
    assert np.linalg.eigvals(params.matrices[0]).real.max() < 1e-6


def test_wrong_bonds_are_refused() -> None:
    params = zc.bond_parameters()
    with pytest.raises(ValueError, match="exactly the bonds"):
        zc.BondParameters(params.m, {2: 1.0}, params.R, params.C)
    with pytest.raises(ValueError, match="23 numbers"):
        zc.BondParameters(params.m[1:], params.I, params.R, params.C)


def test_every_numbered_element_has_a_flow() -> None:
    """Inertias, springs, resistances and sources; each of the ten dependent momenta follows from the states."""
    params = random_parameters(np.random.default_rng(4))
    assert set(zc.flow_rows(params)) == {*zc.INERTIAS, *zc.COMPLIANCES, *zc.RESISTANCES, 1, 8, 32, 72}
    assert (set(params.I), set(params.R), set(params.C)) == (set(zc.INERTIAS), set(zc.RESISTANCES), set(zc.COMPLIANCES))
    assert zc.momentum_map(params).shape == (10, 8)
