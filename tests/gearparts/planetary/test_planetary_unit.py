"""The X unit in both forms, against Willis' equation, closed forms and its own energy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp

R_S, R_P = 0.0285, 0.0465
R_R, R_H = R_S + 2 * R_P, R_S + R_P
DATA = {
    "R_s": R_S, "R_p": R_P, "I_s": 0.0015, "I_r": 0.151, "I_h": 0.05, "I_spin": 0.0094, "I_orbit": 0.02, "K_ring": 1.8e8,
    "C_ring": 2000.0, "K_sun": 1.5e8, "C_sun": 1500.0,
}  # fmt: skip
FORMS = [("lumped", 1), ("lumped", 3), ("separate", 1), ("separate", 3), ("separate", 5)]


def unit(form: str, planets: int, **changes: float) -> gp.PlanetaryUnit:
    return gp.PlanetaryUnit(planet_meshes=form, planets=planets, **gl.offered({**DATA, "C_v": 1800.0, **changes}))


def speeds(value: Callable[[str], float]) -> dict[str, float]:
    return {name: value(f"{name}.w") for name in ("ring_gear", "sun_gear", "carrier_body", "planet[0].spin")}


@pytest.mark.parametrize(("form", "planets"), FORMS)
def test_rolling_without_deflection_obeys_willis(probe: Callable[..., Any], form: str, planets: int) -> None:
    p = probe(unit(form, planets))
    # speeds at which no mesh and no support moves: the null space of their rates over the states
    rates = [s for s in p.model.names() if s.endswith((".v", ".w_rel"))]
    rows = np.array([[p.values({s: 1.0})(r) for s in p.states] for r in rates])
    moving = [i for i, s in enumerate(p.states) if not s.endswith(".q")]
    _, singular, vt = np.linalg.svd(rows[:, moving])
    free = vt[np.sum(singular > 1e-12 * singular[0]) :]
    assert len(free) == 2  # a differential has two degrees of freedom
    for motion in free:
        w = speeds(p.values({p.states[i]: float(x) for i, x in zip(moving, motion, strict=True)}))
        willis = [R_R * w["ring_gear"], R_S * w["sun_gear"], -2 * R_H * w["carrier_body"]]
        assert abs(sum(willis)) < 1e-14 * max(map(abs, willis))
        assert R_P * w["planet[0].spin"] == pytest.approx(R_H * w["carrier_body"] - R_S * w["sun_gear"], abs=1e-14)


@pytest.mark.parametrize(("form", "planets"), FORMS)
def test_power_in_is_stored_or_lost(probe: Callable[..., Any], form: str, planets: int) -> None:
    class Driven(gl.Component):
        def assemble(self) -> Any:
            self.unit = unit(form, planets)
            self.ring, self.sun, self.carrier = gp.Torque(tau=11.0), gp.Torque(tau=-5.0), gp.Torque(tau=3.0)
            return [gl.connect(getattr(self, n).flange, getattr(self.unit, n)) for n in ("ring", "sun", "carrier")]

    p, rng = probe(Driven()), np.random.default_rng(5)
    value = p.values({s: rng.normal() * (1e-6 if s.endswith(".q") else 1.0) for s in p.states})
    owner = {i.path: i for i in p.model.instances}
    parameter = dict(zip(p.model.parameters.names, p.prepared.parameters, strict=True))
    stored = lost = 0.0
    for path, instance in owner.items():
        if instance.kind == "Inertia":
            stored += parameter[f"{path}.J"] * value(f"{path}.w") * value(f"der({path}.w)")
        elif instance.kind.endswith("Mesh"):
            stored += parameter[f"{path}.c"] * value(f"{path}.q") * value(f"{path}.v")
            lost += parameter[f"{path}.d"] * value(f"{path}.v") ** 2
        elif instance.kind == "Damper":
            lost += parameter[f"{path}.d"] * value(f"{path}.w_rel") ** 2
    w = {n: value(f"unit.{n}.w") for n in ("ring_gear", "sun_gear", "carrier_body")}
    power = 11.0 * w["ring_gear"] - 5.0 * w["sun_gear"] + 3.0 * w["carrier_body"]
    assert stored == pytest.approx(power - lost, abs=1e-12 * (abs(stored) + lost))
    assert lost > 0


def test_more_planets_are_one_planet_of_more_stiffness_and_modes_of_their_own(probe: Callable[..., Any]) -> None:
    n = 4
    many = np.linalg.eigvals(probe(unit("separate", n)).A)
    scaled = {k: n * DATA[k] for k in ("I_spin", "I_orbit", "K_ring", "C_ring", "K_sun", "C_sun")}
    one = np.linalg.eigvals(probe(unit("separate", 1, **scaled)).A)
    # Planets may turn against each other while sun, ring and carrier rest; three ways, each between two springs.
    K, C = DATA["K_ring"] + DATA["K_sun"], DATA["C_ring"] + DATA["C_sun"]
    own = np.roots([DATA["I_spin"], C * R_P**2, K * R_P**2])
    # 2 n deflections meet n + 3 bodies that have two rigid motions: n - 1 ways of pre-load, which stay as they are.
    expected = np.concatenate([one, *([own] * (n - 1)), np.zeros(n - 1)])
    assert len(many) == len(expected)
    scale = abs(one).max()
    for eigenvalue in expected:
        nearest = int(np.argmin(abs(many - eigenvalue)))
        assert abs(many[nearest] - eigenvalue) < 1e-7 * scale
        many = np.delete(many, nearest)


def test_lumped_tends_to_separate_where_supports_are_stiff_and_lumps_light(probe: Callable[..., Any]) -> None:
    light = {"I_at_ring": 1e-9, "I_at_sun": 1e-9, "C_v": 1e9}
    lumped = np.linalg.eigvals(probe(unit("lumped", 3, **light)).A)
    per_mesh = {k: DATA[k] / 3 for k in ("K_ring", "C_ring", "K_sun", "C_sun")}
    separate = np.linalg.eigvals(probe(unit("separate", 3, **per_mesh)).A)
    modes = [e for e in separate if abs(e) > 1.0]
    own = np.roots(
        [DATA["I_spin"], (DATA["C_ring"] + DATA["C_sun"]) / 3 * R_P**2, (DATA["K_ring"] + DATA["K_sun"]) / 3 * R_P**2]
    )
    shared = [e for e in modes if abs(e - own).min() > 1e-6 * abs(e)]
    assert len(shared) == 4
    for e in shared:
        assert abs(lumped - e).min() < 1e-5 * abs(e)


def test_lumped_planets_count_by_their_sums(probe: Callable[..., Any]) -> None:
    half = {k: DATA[k] / 2 for k in ("I_spin", "I_orbit")} | {"C_v": 900.0, "I_at_ring": 0.01, "I_at_sun": 0.02}
    six = np.sort_complex(np.linalg.eigvals(probe(unit("lumped", 6, **half)).A))
    three = np.sort_complex(np.linalg.eigvals(probe(unit("lumped", 3, I_at_ring=0.01, I_at_sun=0.02)).A))
    assert six == pytest.approx(three, abs=1e-9 * abs(three).max())


@pytest.mark.parametrize("planets", [1, 2, 3, 5])
def test_planets_stand_at_equal_distances_unless_positions_are_given(planets: int) -> None:
    def angles(**more: Any) -> np.ndarray:
        return np.array(gp.PlanetaryUnit(planet_meshes="separate", planets=planets, **more, **gl.offered(DATA)).angles(), float)

    around = np.exp(1j * angles())
    assert around[0] == 1.0
    assert around**planets == pytest.approx(np.ones(planets))
    assert len(set(np.round(around, 9))) == planets
    given = tuple(0.1 + 1.1 * n for n in range(planets))
    assert tuple(angles(positions=given)) == given
