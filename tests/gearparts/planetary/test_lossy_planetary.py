"""A planetary set with losses: closed-form efficiencies of all arrangements, standstill, energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.flatten import flatten
from gearparts.planetary.lossy_planetary import combined_losses

SHAFTS = ("sun", "carrier", "ring")
RATIO, ETA_S, ETA_R = 2.5, 0.97, 0.93
ETA = ETA_S * ETA_R
# Mueller's formulas, with 1 + ratio between sun and carrier, (1 + ratio) / ratio between ring and carrier: (input, output) -> efficiency
EFFICIENCY = {
    ("sun", "carrier"): (1 + RATIO * ETA) / (1 + RATIO),
    ("carrier", "sun"): (1 + RATIO) / (1 + RATIO / ETA),
    ("ring", "carrier"): (ETA + RATIO) / (1 + RATIO),
    ("carrier", "ring"): (1 + RATIO) / (1 / ETA + RATIO),
    ("sun", "ring"): ETA,
    ("ring", "sun"): ETA,
}


class Bench(gl.Component):
    """A set with a body and a torque on each shaft."""

    kind = gl.Structural(gp.LossyPlanetary)
    losses = gl.Structural((), "of the set, as pairs")
    tau_sun = gl.Parameter("N.m", "torque", default=0.0)
    tau_carrier = gl.Parameter("N.m", "torque", default=0.0)
    tau_ring = gl.Parameter("N.m", "torque", default=0.0)

    def assemble(self) -> Any:
        self.set = self.kind(ratio=RATIO, **dict(self.losses))
        self.sun_body, self.carrier_body, self.ring_body = gp.Inertia(J=0.2), gp.Inertia(J=3.0), gp.Inertia(J=1.0)
        self.sun_torque, self.carrier_torque = gp.Torque(tau=self.tau_sun), gp.Torque(tau=self.tau_carrier)
        self.ring_torque = gp.Torque(tau=self.tau_ring)
        links = []
        for shaft in SHAFTS:
            body = getattr(self, f"{shaft}_body")
            links.append(gl.connect(getattr(self.set, shaft), body.flange_a))
            links.append(gl.connect(body.flange_b, getattr(self, f"{shaft}_torque").flange))
        return links


LOSSES = (("sun_mesh", ((0.0, ETA_S, ETA_S),)), ("ring_mesh", ((0.0, ETA_R, ETA_R),)))
OUTPUTS = [*(f"set.{s}.tau" for s in SHAFTS), *(f"{s}_body.{x}" for s in SHAFTS for x in ("w", "phi")), "set.loss_power"]


@pytest.fixture(scope="module")
def bench() -> gl.System:
    return gl.compile(Bench(losses=LOSSES), outputs=[*OUTPUTS, "set.gear.mode"])


@pytest.mark.parametrize(("given", "taken"), EFFICIENCY)
@pytest.mark.parametrize("sense", [1, -1])
def test_efficiency_of_every_arrangement(bench: gl.System, given: str, taken: str, sense: int) -> None:
    held = next(s for s in SHAFTS if s not in (given, taken))
    # Willis: (1 + ratio) carrier = sun + ratio ring
    speeds = {"sun": {"sun": 0, "ring": 1 + RATIO, "carrier": RATIO}, "ring": {"ring": 0, "sun": 1 + RATIO, "carrier": 1}}
    speeds["carrier"] = {"carrier": 0, "sun": -RATIO, "ring": 1}
    w = {s: 20.0 * sense * speeds[held][s] * np.sign(speeds[held][given]) for s in SHAFTS}
    torques = {f"tau_{given}": 100.0 * sense, f"tau_{taken}": -100.0 * np.sign(w[taken])}
    start = {f"{s}_body.w": w[s] for s in ("sun", "carrier")}
    result = bench.simulate(1e-9, samples=2, parameters=torques, start=start)
    power = {s: result[f"set.{s}.tau"][-1] * w[s] for s in SHAFTS}
    assert power[given] > 0 > power[taken]
    assert power[held] == 0
    assert -power[taken] / power[given] == pytest.approx(EFFICIENCY[given, taken], rel=1e-7)
    assert result["set.loss_power"][-1] == pytest.approx(power[given] + power[taken], rel=1e-6)
    assert sum(result[f"set.{s}.tau"][-1] for s in SHAFTS) == pytest.approx(0.0, abs=1e-9)


FORWARD = 30 / (1 + RATIO * ETA)  # the sun's torque from which on it drives, with 30 N.m on the carrier against it
BACKWARD = 30 / (1 + RATIO / ETA)  # ... below which it is driven


@pytest.mark.parametrize(
    ("tau", "sense"), [(1.01 * FORWARD, 1), (0.99 * FORWARD, 0), (1.01 * BACKWARD, 0), (0.99 * BACKWARD, -1)]
)
def test_standstill(bench: gl.System, tau: float, sense: int) -> None:
    torques = {"tau_sun": tau, "tau_carrier": -30.0, "tau_ring": 30.0 - tau}
    result = bench.simulate(0.5, samples=3, parameters=torques)
    assert result["set.gear.mode"][-1] == sense
    relative = result["sun_body.w"][-1] - result["carrier_body.w"][-1]
    assert np.sign(np.round(relative, 9)) == sense


@pytest.mark.parametrize("sense", [1, -1])
def test_a_set_with_a_held_shaft_starts_from_rest(bench: gl.System, sense: int) -> None:
    # the sun as good as held: the carrier (3 kg.m2) drives the ring (1 kg.m2, 1.4 times as fast)
    torques = {"tau_carrier": 10.0 * sense, "tau_ring": -6.233 * sense}
    result = bench.simulate(1.0, samples=2, parameters={"sun_body.J": 1e9, **torques})
    carrier = (RATIO * ETA * 3.767 - 6.233) / (1.4 + 4.4 * RATIO * ETA)
    assert result["ring_body.w"][-1] == pytest.approx(1.4 * carrier * sense, rel=1e-6)


def test_energy_with_all_shafts_free(bench: gl.System) -> None:
    torques = {"tau_sun": 6.0, "tau_carrier": -9.0, "tau_ring": 5.0}
    r = bench.simulate(2.0, samples=501, rtol=1e-9, parameters=torques)
    work = sum(torques[f"tau_{s}"] * (r[f"{s}_body.phi"][-1] - r[f"{s}_body.phi"][0]) for s in SHAFTS)
    kinetic = sum(J / 2 * r[f"{s}_body.w"][-1] ** 2 for s, J in zip(SHAFTS, (0.2, 3.0, 1.0), strict=True))
    lost = np.sum(np.diff(r.time) * (r["set.loss_power"][1:] + r["set.loss_power"][:-1]) / 2)
    assert kinetic + lost == pytest.approx(work, rel=1e-6)
    assert lost > 0.01 * kinetic


def test_losses_of_both_meshes_are_combined_over_all_speeds() -> None:
    sun, ring = ((0.0, 0.9, 0.85), (30.0, 0.99, 0.98)), ((0.0, 0.98, 0.9),)
    table = combined_losses(sun, ring, ((0.0, 0.2), (60.0, 0.5)))
    assert [row[0] for row in table] == [0.0, 30.0, 60.0, 61.0]
    assert table[0] == pytest.approx((0.0, 0.882, 0.765, 0.2, 0.2))
    assert table[1] == pytest.approx((30.0, 0.9702, 0.882, 0.35, 0.35))
    assert table[2] == pytest.approx((60.0, 0.9702, 0.882, 0.5, 0.5))
    assert table[3][1:] == table[2][1:]


def test_combined_losses_are_products_at_every_speed_of_a_row() -> None:
    """Rows of the three tables at different speeds; between the rows of the product nothing is lost, behind its end it is constant."""
    sun, ring = ((5.0, 0.9, 0.85), (30.0, 0.99, 0.98)), ((-10.0, 0.95, 0.9), (20.0, 0.97, 0.93), (50.0, 0.98, 0.96))
    bearing = ((10.0, 0.2), (60.0, 0.5))
    table = np.array(combined_losses(sun, ring, bearing))
    assert table[:, 0].tolist() == [-10.0, 0.0, 5.0, 10.0, 20.0, 30.0, 50.0, 60.0, 61.0]

    def at(rows: Any, column: int) -> Any:
        return np.interp(table[:, 0], *np.array(rows).T[[0, column]])

    assert table[:, 1] == pytest.approx(at(sun, 1) * at(ring, 1), rel=1e-15)
    assert table[:, 2] == pytest.approx(at(sun, 2) * at(ring, 2), rel=1e-15)
    assert (table[:, 3] == at(bearing, 1)).all()
    assert (table[:, 4] == table[:, 3]).all()
    assert combined_losses(((0.0, 1.0, 1.0),), ((0.0, 1.0, 1.0),)) == ((0.0, 1.0, 1.0, 0.0, 0.0),)


@pytest.mark.parametrize("speed", [5.0, 120.0])
def test_losses_are_constant_beyond_the_tables(speed: float) -> None:
    """The carrier held: the sun gives its torque to the ring, by the efficiency of the first or the last rows."""
    rows = (("sun_mesh", ((20.0, 0.9, 0.85), (60.0, 0.98, 0.96))), ("ring_mesh", ((20.0, 0.95, 0.9),)))
    start = {"sun_body.w": speed, "carrier_body.w": 0.0}
    outputs = ["set.sun.tau", "set.ring.tau"]
    result = gl.compile(Bench(losses=rows), outputs=outputs).simulate(
        1e-9, samples=2, parameters={"tau_sun": 100.0, "tau_ring": 200.0}, start=start
    )
    efficiency = {5.0: 0.9, 120.0: 0.98}[speed] * 0.95
    assert result["set.ring.tau"][-1] / result["set.sun.tau"][-1] == pytest.approx(RATIO * efficiency, rel=1e-6)


def test_without_losses_it_is_the_ideal_set() -> None:
    given = {"tau_sun": 7.0, "tau_carrier": -3.0, "tau_ring": 2.0}
    lossy = gl.simulate(Bench(**given), 1.0, samples=5)
    ideal = gl.simulate(Bench(kind=gp.IdealPlanetary, **given), 1.0, samples=5)
    for name in [f"{s}_body.w" for s in SHAFTS]:
        assert lossy[name] == pytest.approx(ideal[name], rel=1e-12, abs=1e-12)
    assert (lossy["set.loss_power"] == 0).all()


@pytest.mark.parametrize(
    ("losses", "message"),
    [
        ({"sun_mesh": ((0.0, 1.1, 1.0),)}, r"LossyPlanetary\.sun_mesh has the row .* efficiencies above 0, up to 1"),
        ({"sun_mesh": ((0.0, 1.0, 0.0),)}, r"LossyPlanetary\.sun_mesh has the row .* efficiencies above 0, up to 1"),
        ({"ring_mesh": ((0.0, 0.0, 1.0),)}, r"LossyPlanetary\.ring_mesh has the row .* efficiencies above 0, up to 1"),
        ({"ring_mesh": ((0.0, 1.0, 1.1),)}, r"LossyPlanetary\.ring_mesh has the row .* efficiencies above 0, up to 1"),
        ({"bearing": ((0.0, 0.9, 1.0),)}, r"LossyPlanetary\.bearing .* rows of 2 numbers"),
        ({"ring_mesh": ((0.0, 0.9),)}, r"LossyPlanetary\.ring_mesh .* rows of 3 numbers"),
    ],
)
def test_wrong_efficiencies_are_named(losses: dict[str, Any], message: str) -> None:
    with pytest.raises(BindingError, match=message):
        flatten(Bench(losses=tuple(losses.items())))
