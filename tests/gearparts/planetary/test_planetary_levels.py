"""The planetary unit's levels of detail give the same answer where they should, and follow the numbers of teeth."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.flatten import flatten

R_S, R_P, N = 0.03, 0.045, 4
R_R, R_H = R_S + 2 * R_P, R_S + R_P
DATA = {"R_s": R_S, "R_p": R_P, "I_s": 0.002, "I_r": 0.15, "I_h": 0.05, "I_spin": 0.006, "I_orbit": 0.01, "planets": N}
MESHES = {"K_ring": 2e8, "K_sun": 1.5e8, "C_ring": 4e3, "C_sun": 3e3}
TORQUE = {"sun": 11.0, "carrier": -20.0, "ring": 4.0}
LEVELS: dict[str, dict[str, Any]] = {
    "ideal": {"level": "ideal"},
    "lossy": {"level": "lossy"},
    "separate": {"planet_meshes": "separate", **MESHES},
    "detailed": {"planet_meshes": "separate", **MESHES, "Z_s": 20, "Z_p": 30, "Z_r": 80, "sun_details": (("phase0", 0.1),)},
    "planar": {"level": "planar", **MESHES},
}


class Driven(gl.Component):
    """A unit with a torque on every shaft, and a small body that tells its speed."""

    given = gl.Structural((), "of the unit, as pairs")
    tau_sun = gl.Parameter("N.m", "torque", default=TORQUE["sun"])
    tau_carrier = gl.Parameter("N.m", "torque", default=TORQUE["carrier"])
    tau_ring = gl.Parameter("N.m", "torque", default=TORQUE["ring"])

    def assemble(self) -> Any:
        self.unit = gp.PlanetaryUnit(**{**DATA, **dict(self.given)})
        links = []
        for shaft in ("sun", "carrier", "ring"):
            torque, body = gp.Torque(tau=getattr(self, f"tau_{shaft}")), gp.Inertia(J=1e-3)
            setattr(self, f"{shaft}_torque", torque)
            setattr(self, f"{shaft}_body", body)
            links += [gl.connect(torque.flange, body.flange_a), gl.connect(body.flange_b, getattr(self.unit, shaft))]
        return links


def driven(**given: Any) -> Driven:
    return Driven(given=tuple(given.items()))


def test_masses_that_are_not_given_are_those_of_discs_and_the_ring_s_of_a_hoop() -> None:
    table = flatten(gp.PlanetaryUnit(**DATA, **LEVELS["planar"])).parameters
    found = dict(zip(table.names, table.defaults, strict=True))
    r_c = R_H / np.cos(np.pi / 9)
    wanted = {"m_s": 2 * 0.002 / R_S**2, "m_r": 0.15 / R_R**2, "m_c": 2 * 0.05 / R_H**2, "m_p": 0.01 / r_c**2, "r_c": r_c}
    assert {name: found[f"planar.{name}"] for name in wanted} == pytest.approx(wanted, rel=1e-14)


def rigid_accelerations() -> dict[str, float]:
    """Of the rigid set, by Lagrange's equations in the speeds of sun and carrier."""
    rows = {"sun": [1.0, 0.0], "carrier": [0.0, 1.0], "ring": [-R_S / R_R, 2 * R_H / R_R], "planet": [-R_S / R_P, R_H / R_P]}
    inertia = {"sun": 0.002 + 1e-3, "carrier": 0.05 + N * 0.01 + 1e-3, "ring": 0.15 + 1e-3, "planet": N * 0.006}
    mass = sum(J * np.outer(rows[b], rows[b]) for b, J in inertia.items())
    force = sum(tau * np.array(rows[s]) for s, tau in TORQUE.items())
    found = np.linalg.solve(mass, force)
    return {s: float(np.dot(rows[s], found)) for s in TORQUE}


@pytest.mark.parametrize("level", ["ideal", "lossy"])
def test_rigid_levels_accelerate_as_lagrange_s_equations(level: str) -> None:
    system = gl.compile(driven(**LEVELS[level]), outputs=[f"{s}_body.w" for s in TORQUE])
    result = system.simulate(1.0, samples=2)
    for shaft, a in rigid_accelerations().items():
        assert result[f"{shaft}_body.w"][-1] == pytest.approx(a, rel=1e-9)


@pytest.mark.parametrize("level", ["separate", "planar"])
def test_elastic_levels_accelerate_as_the_rigid_one_in_the_mean(level: str) -> None:
    """Without dissipation through bearings the mean over many swings is the rigid motion; meshes have damped the others."""
    given = {**LEVELS[level], "C_ring": 2e4, "C_sun": 2e4}
    system = gl.compile(driven(**given), outputs=[f"{s}_body.w" for s in TORQUE])
    result = system.simulate(1.0, times=np.array([0.0, 0.8, 1.0]), method="exact")
    for shaft, a in rigid_accelerations().items():
        w = result[f"{shaft}_body.w"]
        assert (w[2] - w[1]) / 0.2 == pytest.approx(a, rel=1e-6)


def eigenvalues(probe: Callable[..., Any], **given: Any) -> Any:
    found = np.linalg.eigvals(probe(gp.PlanetaryUnit(**{**DATA, **given})).A)
    return found[np.abs(found) > 1.0]


def nearest(found: Any, expected: Any) -> float:
    """Largest relative distance of an expected eigenvalue from the found ones."""
    return float(max(np.abs(found - e).min() / abs(e) for e in expected))


def test_the_planar_unit_tends_to_the_torsional_one_on_stiff_bearings(probe: Callable[..., Any]) -> None:
    torsional = eigenvalues(probe, **LEVELS["separate"])
    errors = []
    for stiffness in (1e12, 1e13):
        bearings = dict.fromkeys(("k_s", "k_r", "k_h", "k_p"), stiffness)
        errors.append(nearest(eigenvalues(probe, **LEVELS["planar"], **bearings), torsional))
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)  # first order in the bearings' flexibility


def test_detailed_meshes_of_constant_stiffness_are_the_plain_ones(probe: Callable[..., Any]) -> None:
    plain, detailed = (eigenvalues(probe, **LEVELS[n]) for n in ("separate", "detailed"))
    assert len(plain) == len(detailed)
    assert nearest(detailed, plain) < 1e-9


def ripple(Z_s: int, Z_p: int, in_phase: bool) -> tuple[float, Any]:
    """Fluctuation of the sun's speed under a transmission error of its meshes, and their phases at the start."""
    error = (("error_terms", ((1.0, 1e-6, 0.0),)),)
    R_p = R_S * Z_p / Z_s
    R_h = R_S + R_p
    teeth = {"Z_s": Z_s, "Z_p": Z_p, "Z_r": Z_s + 2 * Z_p, "R_p": R_p}
    given = {**LEVELS["detailed"], **teeth, "sun_details": error, "ring_details": ()}
    names = [f"unit.{side}_meshes[{n}].phase" for side in ("sun", "ring") for n in range(N)]
    outputs = ["sun_body.w", *names]
    system = gl.compile(driven(**given), outputs=outputs)
    still = dict.fromkeys(("tau_sun", "tau_carrier", "tau_ring"), 0.0)
    if in_phase:
        still |= {f"unit.sun_meshes[{n}].phase0": 0.0 for n in range(N)}
    start = {"sun_body.w": 30.0, "carrier_body.w": 30.0 * R_S / (2 * R_h), "ring_body.w": 0.0}
    start |= {f"unit.planet[{n}].spin.w": -(R_S * 30.0 - R_h * start["carrier_body.w"]) / R_p for n in range(N)}
    result = system.simulate(0.02, samples=101, parameters=still, start=start, method="rk", rtol=1e-9)
    return float(np.ptp(result["sun_body.w"])), [result[n] / (2 * np.pi) for n in names]


@pytest.mark.parametrize("planet_meshes", ["lumped", "separate"])
def test_phases_do_not_depend_on_where_positions_are_counted_from(planet_meshes: str) -> None:
    found = []
    for by in (0.0, 0.4):
        given = {
            **DATA,
            **LEVELS["detailed"],
            "planet_meshes": planet_meshes,
            "planets": 2,
            "positions": (by, 0.4 * math.pi + by),
            **({"C_v": 0.0} if planet_meshes == "lumped" else {}),
        }
        table = flatten(gp.PlanetaryUnit(**given)).parameters
        values = table.evaluate({})
        found.append([float(values[k]) for name, k in table.index.items() if name.endswith("phase0")])
    assert len(found[0]) == (4 if planet_meshes == "separate" else 2)
    assert found[1] == pytest.approx(found[0], abs=1e-9)


def test_phases_from_teeth_cancel_or_add_up_on_the_sun() -> None:
    sequential, phases = ripple(21, 31, in_phase=False)  # 21 / 4 leaves a rest: the errors cancel in the torque
    together, _ = ripple(21, 31, in_phase=True)
    assert together > 1e-4
    assert sequential < 1e-7 * together
    phasing = gp.planet_phasing(21, 31, 83, N)
    assert phasing.excites() == "translational"
    sun, ring = phases[:N], phases[N:]
    assert sun[0][-1] > sun[0][0]
    assert ring[0][-1] < ring[0][0]  # the sun drives: seen from the carrier, the ring turns backward
    for n in range(N):
        assert sun[0] - sun[n] == pytest.approx(np.full(101, sun[0][0] - sun[n][0]), abs=1e-12)
        assert (sun[0][0] - sun[n][0]) % 1.0 == pytest.approx(phasing.sun[n], abs=1e-9)
        assert (ring[n][0] - ring[0][0]) % 1.0 == pytest.approx(phasing.ring[n], abs=1e-9)
    assert (ring[0][0] - sun[0][0]) % 1.0 == pytest.approx(phasing.ring_to_sun, abs=1e-9)


@pytest.mark.parametrize("level", ["ideal", "detailed", "planar"])
@pytest.mark.parametrize(
    ("given", "right"),
    [
        ({"R_p": 0.0444, "R_r": 0.12}, False),  # a planet with profile shift: R_s + R_p is not the carrier's radius
        ({"R_p": 0.0444, "R_r": 0.12, "R_h": 0.075}, True),
        ({"R_h": 0.0754}, False),
        ({"R_h": 0.0753}, True),  # rounded: 80.4 teeth
    ],
)
def test_the_carrier_s_radius_is_that_of_the_teeth(level: str, given: dict[str, Any], right: bool) -> None:
    unit = gp.PlanetaryUnit(**{**DATA, **LEVELS[level], "Z_s": 20, "Z_p": 29, "Z_r": 80, **given})
    if right:
        flatten(unit)
        return
    with pytest.raises(BindingError, match=r"2 R_h / R_s = .*, but 1 \+ Z_r / Z_s = 5, .*; expected R_h = 0\.075 m"):
        flatten(unit)


@pytest.mark.parametrize("level", ["ideal", "detailed", "planar"])
@pytest.mark.parametrize(
    ("given", "right"),
    [
        ({"Z_s": 20, "Z_p": 30, "Z_r": 80}, True),
        ({"Z_s": 20, "Z_p": 29, "Z_r": 80}, True),  # a planet with profile shift
        ({"Z_s": 24, "Z_p": 30, "Z_r": 84}, False),
        ({"Z_s": 24, "Z_p": 30, "Z_r": 84, "R_p": 0.0375}, True),
        ({"Z_s": 20, "Z_p": 30, "Z_r": 84}, False),
        ({"Z_s": 20, "Z_p": 30, "Z_r": 84, "R_r": 0.126, "R_h": 0.078}, True),
        ({"Z_s": 20, "Z_p": 30, "Z_r": 80, "R_r": 0.1207}, True),  # rounded: 80.47 teeth
        ({"Z_s": 20, "Z_p": 30, "Z_r": 80, "R_r": 0.1209}, False),  # 80.6 teeth
        ({"Z_s": 20, "Z_p": 30, "Z_r": 80, "R_r": 0.1192}, False),  # 79.47 teeth
    ],
)
def test_pitch_radii_are_in_the_ratio_of_the_teeth(level: str, given: dict[str, Any], right: bool) -> None:
    train = driven(**{**LEVELS[level], **given})
    if right:
        gl.compile(train, outputs=["sun_body.w"])
        return
    with pytest.raises(BindingError, match=r"unit: R_r / R_s = 0\.1.* / 0\.03 = .*, but Z_r / Z_s = .*; expected R_r = 0\.1"):
        gl.compile(train)


def test_the_lossy_unit_has_the_losses_of_both_meshes() -> None:
    unit = gp.PlanetaryUnit(**DATA, level="lossy", sun_efficiency=((0, 0.96, 0.95),), ring_efficiency=((0, 0.98, 0.9),))
    assert unit.set.gear.loss_table[0] == pytest.approx((0.0, 0.96 * 0.98, 0.95 * 0.9, 0.0, 0.0))


@pytest.mark.slow
def test_the_lossy_unit_has_the_efficiency_of_its_set() -> None:
    """Sun to carrier with the ring held by its brake torque: (1 + ratio eta) / (1 + ratio) of the power arrives."""
    table, eta, ratio = ((0.0, 0.96, 0.96),), 0.96**2, R_R / R_S
    system = gl.compile(
        driven(level="lossy", sun_efficiency=table, ring_efficiency=table),
        outputs=["unit.set.sun.tau", "unit.set.carrier.tau", "unit.set.ring.tau"],
    )
    result = system.simulate(1e-9, samples=2, start={"sun_body.w": 50.0, "carrier_body.w": 50.0 / (1 + ratio)})
    sun, carrier = result["unit.set.sun.tau"][-1], result["unit.set.carrier.tau"][-1]
    assert -carrier / (1 + ratio) / sun == pytest.approx((1 + ratio * eta) / (1 + ratio), rel=1e-9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"Z_s": 19, "Z_p": 31, "Z_r": 81, "planets": 3}, r"PlanetaryUnit: 3 equally spaced planets cannot be assembled"),
        (
            {"planet_meshes": "separate", "sun_details": (("friction", True),)},
            r"unit: sun_details and ring_details need the numbers of teeth Z_s, Z_p, Z_r",
        ),
        ({"level": "rigid"}, r"'level' is 'rigid'; valid choices: 'ideal', 'lossy', 'elastic', 'planar'"),
    ],
)
def test_what_does_not_fit_is_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(BindingError, match=message):
        gl.compile(driven(**given))


MODELS = {
    gp.IdealPlanetaryUnit: {"level": "ideal"},
    gp.LossyPlanetaryUnit: {"level": "lossy"},
    gp.LumpedPlanetaryUnit: {"C_v": 1800.0},
    gp.TorsionalPlanetaryUnit: {"planet_meshes": "separate"},
    gp.TranslationalPlanetaryUnit: {"level": "planar"},
}


@pytest.mark.parametrize("model", MODELS)
def test_each_level_is_a_class_that_the_unit_makes(model: type[gp.PlanetaryUnit]) -> None:
    made = gp.PlanetaryUnit(**DATA, **MODELS[model])
    assert type(made) is model
    assert isinstance(made, gp.PlanetaryUnit)
    assert type(copy.deepcopy(made)) is type(pickle.loads(pickle.dumps(made))) is model
    assert made.planets == N
    levels = {name: value for name, value in MODELS[model].items() if name != "C_v"}
    assert levels.items() <= {"level": made.level, "planet_meshes": made.planet_meshes}.items()
    by_name = gl.compile(model(**DATA, **MODELS[model] if model is gp.LumpedPlanetaryUnit else {}, start={}), outputs=None)
    assert by_name.states == gl.compile(made).states


def test_no_model_declares_what_it_has_no_use_for() -> None:
    common = gp.PlanetaryUnit._bindable.keys()
    assert gp.IdealPlanetaryUnit._bindable.keys() == common
    assert gp.LumpedPlanetaryUnit._bindable.keys() - gp.TorsionalPlanetaryUnit._bindable.keys() == {
        "C_v",
        "I_at_ring",
        "I_at_sun",
    }
    assert "e_rate" not in gp.TranslationalPlanetaryUnit._bindable


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: gp.IdealPlanetaryUnit(**DATA, level="lossy"),
            r"PlanetaryUnit: level='lossy' has no effect with level='ideal'.*it counts with level='lossy'$",
        ),
        (
            lambda: gp.PlanetaryUnit(**DATA, level="ideal", C_v=3.0),
            r"PlanetaryUnit: C_v=3\.0 has no effect with level='ideal', planet_meshes='lumped' \(.*\); it counts with level='elastic'$",
        ),
        (
            lambda: gp.PlanetaryUnit(**DATA, level="ideal", sun_details=(("b", 1e-4),)),
            r"it counts with level='elastic'$",
        ),
        (lambda: gp.PlanetaryUnit(**DATA, K_rng=3.0), r"LumpedPlanetaryUnit: 'K_rng' is not a parameter.*'K_ring'"),
    ],
)
def test_a_value_of_another_level_is_refused_with_the_choice_that_gives_it_a_meaning(
    make: Callable[[], gl.Component], message: str
) -> None:
    with pytest.raises(BindingError, match=message):
        gl.compile(make())


def test_a_lumped_unit_asks_for_the_damping_that_leads_torque_to_its_carrier() -> None:
    with pytest.raises(
        BindingError, match=r"C_v has no value; give one in N\.s/m \(.*alone leads torque to the carrier\): C_v="
    ):
        gl.compile(driven(**MESHES))
    carried = {}
    for C_v in (0.0, 1e9):
        system = gl.compile(driven(**MESHES, C_v=C_v), outputs=["carrier_body.w", "sun_body.w", "ring_body.w"])
        result = system.simulate(0.2, samples=3, parameters={"tau_carrier": 0.0})
        carried[C_v] = {shaft: result[f"{shaft}_body.w"] for shaft in ("sun", "carrier", "ring")}
    assert carried[0.0]["carrier"][-1] != pytest.approx(carried[1e9]["carrier"][-1], rel=0.1)
    end = {shaft: w[-1] for shaft, w in carried[1e9].items()}
    assert R_R * end["ring"] + R_S * end["sun"] == pytest.approx(2 * R_H * end["carrier"], rel=1e-3)


def test_what_a_composite_hands_on_and_what_is_offered_may_have_no_effect() -> None:
    class Outer(gl.Component):
        damping = gl.Parameter("N.s/m", default=3.0)

        def assemble(self) -> Any:
            self.unit = gp.PlanetaryUnit(**DATA, level="ideal", C_v=self.damping, **gl.offered({"K_sun": 1e8}))
            return []

    assert gl.compile(Outer()).states
    with pytest.raises(BindingError, match=r"Outer: damping=2\.0 has no effect"):
        gl.compile(Outer(damping=2.0))
