"""Composite planetary sets and single-loop trains against Willis' equation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp


class Gearbox(gl.Component):
    """A set with a body and a torque at every shaft; some shafts are held."""

    kind = gl.Structural(gp.Simpson)
    values = gl.Structural((), "of the set, as pairs")
    held = gl.Structural((), "names of the shafts that are held")

    def assemble(self) -> Any:
        self.set = self.kind(**dict(self.values))
        links = []
        for name in [n for n, d in self.kind._declarations.items() if isinstance(d, gp.Flange) and d.when is None]:
            body, torque = gp.Inertia(J=0.3), gp.Torque()
            setattr(self, f"{name}_body", body)
            setattr(self, f"{name}_torque", torque)
            links += [gl.connect(getattr(self.set, name), body.flange_a), gl.connect(torque.flange, body.flange_b)]
            if name in self.held:
                ground = gp.Fixed()
                setattr(self, f"{name}_ground", ground)
                links.append(gl.connect(ground.flange, body.flange_b))
        return links


SIMPSON = {"ratio_front": 2.2, "ratio_rear": 2.0}
RAVIGNEAUX = {"ratio_small": 2.7, "ratio_large": 1.9}
DOUBLE = {"ratio": 2.5}
GEARS = [  # kind, values, held, driving, driven, ratio
    (gp.Simpson, SIMPSON, "rear_carrier", "ring", "output", (1 + 2.2 + 2.0) / 2.2),
    (gp.Simpson, SIMPSON, "sun", "ring", "output", 3.2 / 2.2),
    (gp.Simpson, SIMPSON, "rear_carrier", "sun", "output", -2.0),
    (gp.Ravigneaux, RAVIGNEAUX, "carrier", "small_sun", "ring", 2.7),
    (gp.Ravigneaux, RAVIGNEAUX, "large_sun", "small_sun", "ring", (2.7 + 1.9) / 2.9),
    (gp.Ravigneaux, RAVIGNEAUX, "large_sun", "carrier", "ring", 1.9 / 2.9),
    (gp.Ravigneaux, RAVIGNEAUX, "carrier", "large_sun", "ring", -1.9),
    (gp.DoublePinionPlanetary, DOUBLE, "carrier", "sun", "ring", 2.5),
    (gp.DoublePinionPlanetary, DOUBLE, "ring", "sun", "carrier", 1 - 2.5),
    (gp.DoublePinionPlanetary, DOUBLE, "sun", "ring", "carrier", 1.5 / 2.5),
]


@pytest.mark.parametrize(("kind", "values", "held", "driving", "driven", "ratio"), GEARS)
def test_speed_and_torque_ratios_of_every_gear(
    kind: Any, values: dict[str, float], held: str, driving: str, driven: str, ratio: float
) -> None:
    system = gl.compile(Gearbox(kind=kind, values=tuple(values.items()), held=(held,)))
    assert gl.mobility(system) == 1
    assert gl.speed_ratio(system, f"{driving}_body.w", f"{driven}_body.w") == pytest.approx(ratio, rel=1e-12)
    names = [n for n in kind._declarations if isinstance(kind._declarations[n], gp.Flange)]
    torques = {f"{n}_torque.tau": 0.0 for n in names if n != driving} | {f"{driven}_torque.tau": -6.0}
    flow = gl.power_flow(system, speeds={f"{driving}_body.w": 10.0}, torques=torques)
    assert flow[f"set.{driving}"].torque == pytest.approx(6.0 / ratio, rel=1e-10)
    assert flow[f"set.{driven}"].power == pytest.approx(-flow[f"set.{driving}"].power, rel=1e-10)
    assert flow[f"set.{held}"].torque == pytest.approx(6.0 - 6.0 / ratio, rel=1e-10)


@pytest.mark.parametrize(("kind", "values"), [(gp.Simpson, SIMPSON), (gp.Ravigneaux, RAVIGNEAUX)])
def test_compound_sets_have_two_degrees_of_freedom_and_turn_as_a_block(kind: Any, values: dict[str, float]) -> None:
    system = gl.compile(Gearbox(kind=kind, values=tuple(values.items())))
    assert gl.mobility(system) == 2
    names = [n for n in kind._declarations if isinstance(kind._declarations[n], gp.Flange)]
    torques = {f"{n}_torque.tau": 0.0 for n in names}
    flow = gl.power_flow(system, speeds={f"{names[0]}_body.w": 7.0, f"{names[1]}_body.w": 7.0}, torques=torques)
    assert [flow[f"set.{n}"].speed for n in names] == pytest.approx([7.0] * 4, rel=1e-12)


R_S, R_P = 0.0285, 0.0465
K = (R_S + 2 * R_P) / R_S


def test_xp_train() -> None:
    given = {"m_18": 1.3, "m_19": 0.8, "m_22": 1.1, "R_1": 0.03, "R_2": 0.05, "planet_meshes": "separate"}
    system = gl.compile(Gearbox(kind=gp.XPTrain, values=tuple(given.items())))
    assert gl.mobility(system) == 1
    sun = 1.1 * 0.05 / (1.3 * 0.8 * 0.03)  # over the carrier
    ring = ((1 + K) - sun) / K
    assert gl.speed_ratio(system, "flange_in_body.w", "flange_out_body.w") == pytest.approx(ring, rel=1e-10)
    one = gl.compile(Gearbox(kind=gp.XPTrain, values=(*given.items(), ("planets", 1))))
    flow = gl.power_flow(one, speeds={"flange_in_body.w": 10.0}, torques={"flange_out_torque.tau": -6.0})
    assert flow["set.flange_in"].torque == pytest.approx(6.0 / ring, rel=1e-9)


@pytest.mark.parametrize("elastic", [False, True])
def test_px_train(elastic: bool) -> None:
    given = {"m_18": 1.3, "m_19": 0.8, "m_22": 1.1, "R_1": 0.03, "R_2": 0.05, "elastic_shafts": elastic}
    system = gl.compile(Gearbox(kind=gp.PXTrain, values=tuple(given.items())))
    assert gl.mobility(system) == 1
    w_sun, w_ring = 1 / 1.3, 0.8 * 0.03 / 0.05 / 1.1
    expected = (w_sun + K * w_ring) / (1 + K)
    assert gl.speed_ratio(system, "flange_out_body.w", "flange_in_body.w") == pytest.approx(expected, rel=1e-10)
    one = gl.compile(
        Gearbox(kind=gp.PXTrain, values=(*given.items(), ("planets", 1)))
    )  # several share the load by their stiffness
    flow = gl.power_flow(one, speeds={"flange_in_body.w": 10.0}, torques={"flange_out_torque.tau": -6.0})
    assert flow.efficiency == pytest.approx(1.0, rel=1e-9)
    assert flow["set.flange_in"].torque == pytest.approx(6.0 * expected, rel=1e-9)


def test_xx_train() -> None:
    given = {"R_s2": 0.04, "R_p2": 0.03}
    k_2 = 0.1 / 0.04
    carrier = 1 / (1 + K)
    expected = (1 + k_2 * carrier) / (1 + k_2)
    system = gl.compile(Gearbox(kind=gp.XXTrain, values=tuple(given.items())))
    assert gl.mobility(system) == 1
    assert gl.speed_ratio(system, "flange_out_body.w", "flange_in_body.w") == pytest.approx(expected, rel=1e-10)
    free = gl.compile(Gearbox(kind=gp.XXTrain, values=(*given.items(), ("ring_free", True))))
    assert gl.mobility(free) == 2


@pytest.mark.parametrize(("kind", "shafts"), [(gp.PXTrain, 2), (gp.XXTrain, 2)])
def test_elastic_trains_keep_their_energy(kind: Any, shafts: int, probe: Any) -> None:
    """Without dissipation and torques every mode swings, and one motion turns freely."""
    given = {"C_g": 0.0, "planet_meshes": "separate"}
    found = np.linalg.eigvals(probe(Gearbox(kind=kind, values=tuple(given.items()))).A)
    scale = np.abs(found).max()
    assert np.abs(found.real).max() < 1e-7 * scale
    assert (np.abs(found) > 1e-6 * scale).sum() > 4


def test_the_planetary_of_the_xp_train_is_what_it_was() -> None:
    assert len(gl.compile(gp.ZhouCui2022()).states) == 8
