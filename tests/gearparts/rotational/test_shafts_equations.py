"""Springs, bodies and starts of shafts: equations and energies at numbers worked out by hand."""

from __future__ import annotations

from typing import Any

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits, powers
from tests.gearparts.test_declared_numbers import parameters

X, W = 0.25, -1.5  # twist beyond the unstretched angle, rad, and its rate, rad/s
TWISTED = {
    "phi_rel0": 0.5, "phi_rel": 0.75, "der(phi_rel)": W, "w_rel": W, "flange_a.phi": 0.1, "flange_b.phi": 0.85,
    "c": 40.0, "c_3": 16.0, "d": 3.0,
}  # fmt: skip
LAWS: list[tuple[Any, dict[str, float], float, float]] = [  # torque of the spring, and energy in it
    (gp.Spring, {"c": 40.0}, 40.0 * X, 20.0 * X**2),
    (gp.Damper, {"d": 3.0}, 0.0, 0.0),
    (gp.SpringDamper, {"c": 40.0, "d": 3.0}, 40.0 * X, 20.0 * X**2),
    (gp.CubicSpringDamper, {"c": 40.0, "c_3": 16.0, "d": 3.0}, 40.0 * X + 16.0 * X**3, 20.0 * X**2 + 4.0 * X**4),
]


@pytest.mark.parametrize(("kind", "given", "spring", "stored"), LAWS)
@pytest.mark.parametrize("use_heat_port", [False, True])
def test_a_spring_stores_and_a_damper_loses(
    kind: Any, given: dict[str, float], spring: float, stored: float, use_heat_port: bool
) -> None:
    damped = "d" in given
    tau, lost = spring + (3.0 * W if damped else 0.0), 3.0 * W**2 if damped else 0.0
    part = kind(**given, **({"use_heat_port": use_heat_port} if damped else {}))
    values = TWISTED | {
        "tau": tau, "flange_a.tau": -tau, "flange_b.tau": tau, "loss_power": lost, "heat_port.Q_flow": -lost
    }  # fmt: skip
    assert misfits(part, values) == []
    assert powers(part, values) == pytest.approx((stored, lost, 0.0), abs=1e-14)


def test_a_disc_turns_its_flanges_apart_around_their_middle() -> None:
    values = {
        "delta_phi": 0.5,
        "phi": 1.0,
        "flange_a.phi": 0.75,
        "flange_b.phi": 1.25,
        "flange_a.tau": 4.0,
        "flange_b.tau": -4.0,
    }
    assert misfits(gp.Disc(delta_phi=0.5), values) == []


def test_a_body_accelerates_under_both_torques_and_ground_stands_at_its_angle() -> None:
    values = {
        "J": 2.0, "phi": 0.5, "flange_a.phi": 0.5, "flange_b.phi": 0.5, "der(phi)": 3.0, "w": 3.0, "der(w)": 2.5,
        "flange_a.tau": 7.0, "flange_b.tau": -2.0,
    }  # fmt: skip
    assert misfits(gp.Inertia(J=2.0), values) == []
    assert powers(gp.Inertia(J=2.0), values) == (9.0, 0.0, 0.0)
    assert misfits(gp.Fixed(phi0=0.5), {"flange.phi": 0.5, "phi0": 0.5}) == []


@pytest.mark.parametrize("use", [(p, w, a) for p in (False, True) for w in (False, True) for a in (False, True)])
def test_a_start_counts_the_deviations_that_are_asked_for(use: tuple[bool, bool, bool]) -> None:
    phi, w, a = use
    part = gp.InitializeFlange(use_phi_start=phi, use_w_start=w, use_a_start=a)
    values = {
        "flange.tau": 0.0, "flange.phi": 0.75, "der(flange.phi)": 2.0, "w": 2.0, "der(w)": 3.0, "a": 3.0, "phi_start": 0.25,
        "w_start": 1.5, "a_start": 7.0, "phi_error": 0.5 * phi, "w_error": 0.5 * w, "a_error": -4.0 * a,
    }  # fmt: skip
    assert misfits(part, values) == []


@pytest.mark.parametrize("n", [1, 4])
def test_segments_of_a_shaft_share_its_inertia_and_flexibility(n: int) -> None:
    found = parameters(gp.TorsionalShaft(segments=n, J=0.4, c=900.0, d=0.5))
    masses = [found[f"bodies[{i}].J"] for i in range(n + 1)]
    assert masses == pytest.approx([0.2 / n, *[0.4 / n] * (n - 1), 0.2 / n], rel=1e-15)
    assert [found[f"springs[{i}].c"] for i in range(n)] == [900.0 * n] * n
    assert [found[f"springs[{i}].d"] for i in range(n)] == [0.5 * n] * n
    assert f"springs[{n}].c" not in found
