"""The XP train with detailed meshes, errors of their own and unequally spaced planets: its linear form, phases, and Table 4."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearparts.trains import zhou_cui_2022 as zc
from tests.gearparts.laws import right_side

TEETH = {"Z_s": 19, "Z_p": 31, "Z_r": 81}
TABLE_4 = {name: quantity.value for name, quantity in zc.TABLE_4.items()}
NOTHING_VARIES = (("stiffness", "sinusoidal"), ("c_amplitude", 0.0))
NO_GAP = (("backlash", True), ("b", 0.0))


def run(train: gp.ZhouCui2022, outputs: tuple[str, ...] = ("w_out", "q_ring", "q_sun", "q_pair"), **inputs: Any) -> Any:
    system = gl.compile(train, outputs=list(outputs))
    return system.simulate(0.02, inputs={"tau_in": 100.0, **inputs}, rtol=1e-10, method="rk", samples=41)


def test_every_symbol_of_table_4_is_a_parameter() -> None:
    given, default = run(gp.ZhouCui2022(**TABLE_4)), run(gp.ZhouCui2022())
    assert np.array_equal(given["w_out"], default["w_out"])
    with pytest.raises(BindingError, match=r"XPTrain: K_s=.* has no effect with elastic_shafts=False"):
        gl.compile(gp.XPTrain(K_s=1e8))


@pytest.mark.parametrize("planet_meshes", ["lumped", "separate"])
def test_details_without_effect_leave_the_linear_train(planet_meshes: str) -> None:
    plain = run(gp.ZhouCui2022(planet_meshes=planet_meshes))
    detailed = run(
        gp.ZhouCui2022(
            **TEETH, planet_meshes=planet_meshes, ring_details=NOTHING_VARIES, sun_details=NO_GAP, pair_details=NO_GAP
        )
    )
    for name in ("w_out", "q_ring", "q_sun", "q_pair"):
        assert np.abs(detailed[name] - plain[name]).max() < 1e-8 * np.abs(plain[name]).max()


def test_deflections_of_separate_meshes_are_given_by_their_mean() -> None:
    names = {side: [f"train.x_unit.{side}_meshes[{n}].q" for n in range(3)] for side in ("ring", "sun")}
    varying = (("stiffness", "sinusoidal"), ("c_amplitude", 0.3))
    train = gp.ZhouCui2022(**TEETH, planet_meshes="separate", ring_details=varying, sun_details=varying)
    result = run(train, ("q_ring", "q_sun", *names["ring"], *names["sun"]))
    for side, of in names.items():
        meshes = np.array([result[name] for name in of])
        assert result[f"q_{side}"] == pytest.approx(meshes.mean(axis=0), rel=1e-12, abs=1e-18)
        assert np.ptp(meshes, axis=0).max() > 0.01 * np.abs(meshes).max()


def test_each_mesh_has_an_error_of_its_own() -> None:
    rates = {"e_rate_ring": lambda t: 1e-3, "e_rate_sun": lambda t: 2e-3 * math.cos(50 * t), "e_rate_pair": lambda t: -3e-3}
    unbound = dict.fromkeys(rates)  # None leaves an input to the run

    found = run(gp.ZhouCui2022(**unbound), **rates)
    params = zc.bond_parameters()
    order = ("e_rate_ring", "e_rate_sun", "e_rate_pair")
    solution = solve_ivp(
        lambda t, x: zc.explicit_rhs(t, x, params, [100.0, *(rates[name](t) for name in order)]),
        (0, 0.02), np.zeros(8), method="DOP853", t_eval=found.time, rtol=1e-11, atol=1e-15,
    )  # fmt: skip
    for name, k in (("q_ring", 1), ("q_sun", 4), ("q_pair", 6)):
        assert np.abs(found[name] - solution.y[k]).max() < 1e-7 * np.abs(solution.y[k]).max()


@pytest.mark.parametrize("planet_meshes", ["lumped", "separate"])
def test_meshes_count_their_teeth_against_the_carrier(planet_meshes: str) -> None:
    part = "_mesh" if planet_meshes == "lumped" else "_meshes[1]"
    sun, ring, carrier = "train.x_unit.sun_gear.phi", "train.x_unit.ring_gear.phi", "train.x_unit.carrier_body.phi"
    at_sun, at_ring = f"train.x_unit.sun{part}.phase", f"train.x_unit.ring{part}.phase"
    pair, gear = "train.p_unit.mesh.phase", "train.p_unit.gear_1.phi"
    varying = (("stiffness", "sinusoidal"), ("c_amplitude", 0.1))
    details = {"ring_details": varying, "sun_details": varying, "pair_details": varying}
    own = 25 if planet_meshes == "separate" else 0  # teeth of the pair's first gear; without, they are those of the sun
    train = gp.ZhouCui2022(**TEETH, **details, planet_meshes=planet_meshes, Z_1=own)
    result = run(train, (sun, ring, carrier, at_sun, at_ring, pair, gear))
    turned = {name: result[name] - result[name][0] for name in (sun, ring, carrier, at_sun, at_ring, pair, gear)}
    assert turned[at_sun] == pytest.approx(19 * (turned[sun] - turned[carrier]), abs=1e-8)
    assert turned[at_ring] == pytest.approx(81 * (turned[ring] - turned[carrier]), abs=1e-8)
    assert turned[pair] == pytest.approx((own or 19) * turned[gear], abs=1e-8)
    first = gp.planet_positions(19, 81, 3)[1 if planet_meshes == "separate" else 0]
    assert result[at_sun][0] == pytest.approx(-19 * first)
    assert result[at_ring][0] == pytest.approx(-81 * first)  # 31 teeth: no phase of the ring against the sun


def test_positions_that_do_not_fit_are_refused() -> None:
    equal = tuple(2 * math.pi * n / 3 for n in range(3))
    with pytest.raises(BindingError, match=r"planet 1 at 2\.0944 rad does not fit between Z_s = 19 and Z_r = 81 teeth"):
        gl.compile(gp.ZhouCui2022(**TEETH, positions=equal))
    with pytest.raises(BindingError, match="2 positions for 3 planets"):
        gl.compile(gp.ZhouCui2022(planet_meshes="separate", ring_details=NO_GAP, **TEETH, positions=(0.0, 1.0)))
    with pytest.raises(BindingError, match="sun_details and ring_details need the numbers of teeth"):
        gl.compile(gp.ZhouCui2022(ring_details=NO_GAP))
    for missing in TEETH:
        with pytest.raises(BindingError, match=f"PlanetaryUnit: {missing} is 0; expected a whole number above 0"):
            gl.compile(gp.ZhouCui2022(**TEETH | {missing: 0}))


@pytest.mark.parametrize("planets", [1, 3])
def test_deflections_are_means_over_the_planets(planets: int) -> None:
    train = gp.ZhouCui2022(planet_meshes="separate", planets=planets)
    train.train.x_unit.sun_meshes  # noqa: B018 - makes the parts
    for side in ("ring", "sun"):
        each = {f"train__x_unit__{side}_meshes[{n}]__q": 1.0 + n**2 for n in range(planets)}
        assert right_side(train, f"q_{side}", **each) == pytest.approx(sum(each.values()) / planets)
