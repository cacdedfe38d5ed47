"""Mobility, speed ratios and power flow against hand calculations."""

from __future__ import annotations

import itertools
import re
import time
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.statics.power_flow import FlangePower
from gearparts.gears.lossy import LossyGear

EXACT = 1e-12


class SingleLoop(gl.Component):
    """An X unit and a P unit in one loop. "XP": ring drives, the P unit leads the sun to the carrier; "PX": it leads to the ring."""

    kind = gl.Structural("XP")
    k = gl.Parameter("1", default=4.2)
    i = gl.Parameter("1", default=-1.6)

    def assemble(self) -> list[Any]:
        self.drive, self.load = gp.Torque(), gp.Torque()
        self.x, self.p = gp.IdealPlanetary(ratio=self.k), gp.IdealGear(ratio=self.i)
        self.body = gp.Inertia(J=3.0)
        out = gl.connect(self.x.carrier, self.body.flange_a)
        if self.kind == "XP":
            return [
                out,
                gl.connect(self.drive.flange, self.x.ring),
                gl.connect(self.x.sun, self.p.flange_a),
                gl.connect(self.p.flange_b, self.body.flange_b, self.load.flange),
            ]
        return [
            out,
            gl.connect(self.drive.flange, self.x.sun, self.p.flange_a),
            gl.connect(self.p.flange_b, self.x.ring),
            gl.connect(self.body.flange_b, self.load.flange),
        ]


@pytest.fixture(scope="module")
def xp() -> gl.System:
    return gl.compile(SingleLoop())


@pytest.mark.parametrize("i", [-1.6, 1.7, 3.0, 8.0])
def test_xp_train(xp: gl.System, i: float) -> None:
    k, T, w = 4.2, 70.0, 12.0
    flow = gl.power_flow(xp, speeds={"body.w": w}, torques={"load.tau": -T}, parameters={"i": i})
    assert flow.mobility == 1
    tau_s = T / (1 + k - i)
    expected = {
        "x.sun": (i * w, tau_s), "x.ring": (w * (1 + k - i) / k, k * tau_s), "x.carrier": (w, -(1 + k) * tau_s),
        "p.flange_a": (i * w, -tau_s), "p.flange_b": (w, i * tau_s), "load.flange": (w, T),
    }  # fmt: skip
    for name, (speed, torque) in expected.items():
        assert flow[name].speed == pytest.approx(speed, rel=EXACT)
        assert flow[name].torque == pytest.approx(torque, rel=EXACT)
        assert flow[name].power == pytest.approx(speed * torque, rel=EXACT)
    assert flow.efficiency == pytest.approx(1.0, rel=EXACT)
    assert flow.imbalance < EXACT
    # through the P unit flows i / (1 + k - i) of the output; it returns to the X unit where that is positive, and where
    # it is below -1 the X unit's ring and carrier both feed the drive's side of the loop
    share = i / (1 + k - i)
    circulating = share if share > 0 else max(-share - 1, 0.0)
    assert flow.circulating_power == pytest.approx(circulating * T * w, rel=EXACT, abs=1e-9)
    assert gl.speed_ratio(xp, "x.ring", "body.w", parameters={"i": i}) == pytest.approx((1 + k - i) / k, rel=EXACT)
    assert flow.willis("x.sun", "x.ring", "x.carrier") == pytest.approx((-k, -k), rel=EXACT)


@pytest.mark.parametrize("i", [-9.0, -6.0, 2.5])
def test_px_train(i: float) -> None:
    k, T, w = 4.2, 70.0, 12.0
    system = gl.compile(SingleLoop(kind="PX", i=i))
    flow = gl.power_flow(system, speeds={"x.sun": w}, torques={"load.tau": -T})
    out = w * (1 + k / i) / (1 + k)
    assert flow["body.flange_a"].speed == pytest.approx(out, rel=EXACT)
    assert flow.willis("x.sun", "x.ring", "x.carrier") == pytest.approx((-k, -k), rel=EXACT)
    assert flow["x.sun"].power == pytest.approx(T * w / (1 + k), rel=EXACT)
    assert flow["x.ring"].power == pytest.approx(T * w / (1 + k) * k / i, rel=EXACT)
    assert flow["drive.flange"].torque == pytest.approx(-T * (1 + k / i) / (1 + k), rel=EXACT)
    circulating = T * w / (1 + k) * abs(k / i) if i < 0 else 0.0
    assert flow.circulating_power == pytest.approx(circulating, rel=EXACT, abs=1e-9)
    assert flow.imbalance < EXACT


class Wolfrom(gl.Component):
    """Sun, ring 1 held, ring 2 out, stepped planets: two sets that share the sun and the carrier."""

    z_s, z_p1, z_r1, z_p2, z_r2 = (gl.Parameter("1", default=float(z)) for z in (21, 40, 101, 38, 99))

    def assemble(self) -> list[Any]:
        self.drive, self.load, self.ground, self.carrier = gp.Torque(), gp.Torque(), gp.Fixed(), gp.Inertia(J=1.0)
        self.first = gp.IdealPlanetary(ratio=self.z_r1 / self.z_s)
        self.second = gp.IdealPlanetary(ratio=self.z_p1 * self.z_r2 / (self.z_s * self.z_p2))
        return [
            gl.connect(self.drive.flange, self.first.sun, self.second.sun),
            gl.connect(self.first.carrier, self.second.carrier, self.carrier.flange_a),
            gl.connect(self.first.ring, self.ground.flange),
            gl.connect(self.second.ring, self.load.flange),
        ]


def test_wolfrom_set() -> None:
    system = gl.compile(Wolfrom())
    z_s, z_p1, z_r1, z_p2, z_r2 = 21.0, 40.0, 101.0, 38.0, 99.0
    ratio = (1 + z_r1 / z_s) / (1 - z_r1 * z_p2 / (z_p1 * z_r2))
    assert gl.mobility(system) == 1
    assert gl.speed_ratio(system, "first.sun", "second.ring") == pytest.approx(ratio, rel=EXACT)
    flow = gl.power_flow(system, speeds={"first.sun": 300.0}, torques={"load.tau": -900.0})
    assert flow.willis("first.sun", "first.ring", "first.carrier") == pytest.approx((-z_r1 / z_s,) * 2, rel=EXACT)
    second = -z_p1 * z_r2 / (z_s * z_p2)
    assert flow.willis("second.sun", "second.ring", "second.carrier") == pytest.approx((second, second), rel=EXACT)
    assert flow["load.flange"].speed == pytest.approx(300.0 / ratio, rel=EXACT)
    assert flow["drive.flange"].torque == pytest.approx(-900.0 / ratio, rel=EXACT)
    assert flow["ground.flange"].torque == pytest.approx(900.0 / ratio - 900.0, rel=EXACT)
    assert flow["ground.flange"].power == pytest.approx(0.0, abs=EXACT)
    assert flow.imbalance < EXACT


class Ravigneaux(gl.Component):
    """Two suns, one ring and one carrier; the small sun drives the ring through two planets, so with a positive basic ratio."""

    z_1, z_2, z_r = (gl.Parameter("1", default=float(z)) for z in (28, 36, 78))

    def assemble(self) -> list[Any]:
        self.small, self.large = gp.IdealPlanetary(ratio=-self.z_r / self.z_1), gp.IdealPlanetary(ratio=self.z_r / self.z_2)
        self.sun_1, self.sun_2, self.carrier, self.ring = (gp.Torque() for _ in range(4))
        self.body = [gp.Inertia(J=1.0), gp.Inertia(J=1.0)]
        return [
            gl.connect(self.body[0].flange_a, self.carrier.flange),
            gl.connect(self.body[1].flange_a, self.ring.flange),
            gl.connect(self.small.sun, self.sun_1.flange),
            gl.connect(self.large.sun, self.sun_2.flange),
            gl.connect(self.small.carrier, self.large.carrier, self.carrier.flange),
            gl.connect(self.small.ring, self.large.ring, self.ring.flange),
        ]


def test_ravigneaux_set() -> None:
    system = gl.compile(Ravigneaux())
    k_1, k_2 = 78 / 28, 78 / 36
    assert gl.mobility(system) == 2
    ratios = {
        ("sun_1", "carrier"): k_1, ("sun_1", "sun_2"): k_1 + (1 - k_1) * k_2 / (1 + k_2), ("sun_2", "carrier"): -k_2,
        ("carrier", "sun_2"): k_2 / (1 + k_2),
    }  # fmt: skip
    for (driving, held), ratio in ratios.items():
        found = gl.speed_ratio(system, f"{driving}.flange", "ring.flange", held=[f"{held}.flange"])
        assert found == pytest.approx(ratio, rel=EXACT)
    ratio = ratios["sun_1", "sun_2"]
    flow = gl.power_flow(
        system, speeds={"sun_1.flange": 50.0, "sun_2.flange": 0.0}, torques={"ring.tau": -80.0, "carrier.tau": 0.0}
    )
    assert flow["sun_1.flange"].torque == pytest.approx(-80.0 / ratio, rel=EXACT)
    assert flow["sun_2.flange"].torque == pytest.approx(80.0 / ratio - 80.0, rel=EXACT)  # the held sun takes the rest
    assert flow.imbalance < EXACT


class Rig(gl.Component):
    """Two equal gearboxes back to back: a loading torque between the slow shafts, a drive for the losses on the fast one."""

    losses = gl.Structural(((0.0, 0.97, 0.95, 0.0, 0.0),))
    preload = gl.Structural("torque")

    def assemble(self) -> list[Any]:
        self.drive, self.body = gp.Torque(), gp.Inertia(J=0.5)
        self.test, self.slave = (LossyGear(ratio=3.0, loss_table=self.losses) for _ in range(2))
        self.loading = gp.Torque2() if self.preload == "torque" else gp.Spring(c=2e4, phi_rel0=-0.02)
        return [
            gl.connect(self.drive.flange, self.body.flange_a, self.test.flange_a, self.slave.flange_a),
            gl.connect(self.test.flange_b, self.loading.flange_a),
            gl.connect(self.loading.flange_b, self.slave.flange_b),
        ]


@pytest.mark.parametrize(("T", "w"), [(600.0, 150.0), (-600.0, 150.0), (600.0, -150.0)])
def test_recirculating_rig_with_losses(T: float, w: float) -> None:
    flow = gl.power_flow(gl.compile(Rig()), speeds={"test.flange_a": w}, torques={"loading.tau": T})
    eta_1, eta_2, i = 0.97, 0.95, 3.0
    power = abs(T * w) / i
    assert flow.input_power == pytest.approx(power * (1 / eta_1 - eta_2), rel=EXACT)
    assert flow.output_power == 0.0
    assert flow.circulating_power == pytest.approx(power * eta_2, rel=EXACT)
    driven, driving = ("test", "slave") if T * w > 0 else ("slave", "test")
    assert flow.losses[driven] == pytest.approx(power * (1 / eta_1 - 1), rel=EXACT)
    assert flow.losses[driving] == pytest.approx(power * (1 - eta_2), rel=EXACT)
    assert flow.imbalance < EXACT


def test_recirculating_rig_with_a_twisted_shaft() -> None:
    flow = gl.power_flow(
        gl.compile(Rig(losses=((0.0, 1.0, 1.0, 0.0, 0.0),), preload="spring")), speeds={"test.flange_a": 150.0}
    )
    assert flow["loading.flange_b"].torque == pytest.approx(400.0, rel=EXACT)
    assert flow.circulating_power == pytest.approx(400.0 * 50.0, rel=EXACT)
    assert flow.input_power == pytest.approx(0.0, abs=1e-8)


def test_elastic_train_turns_as_the_rigid_one_does(paper: gl.System) -> None:
    """Steady state of the paper's system, against a search for a state in which nothing accelerates."""
    tau = 40.0
    flow = gl.power_flow(paper, torques={"tau_in": tau})
    steady = paper.simulate(1e-3, samples=2, start="steady", inputs={"tau_in": tau}, parameters={"e_amplitude": 0.0})
    for flange, name in {"x_unit.ring": "w_in", "x_unit.sun": "w_sun", "x_unit.carrier": "w_out"}.items():
        assert flow[f"train.{flange}"].speed == pytest.approx(steady[name][0], rel=1e-9)
    assert flow.mobility == 2  # the planets at the sun are held by dampers only
    assert flow.input_power == pytest.approx(tau * steady["w_in"][0], rel=1e-9)
    assert flow.output_power + sum(flow.losses.values()) == pytest.approx(flow.input_power, rel=EXACT)


def test_table_and_text(xp: gl.System) -> None:
    flow = xp.power_flow(speeds={"body.w": 10.0}, torques={"load.tau": -5.0}, parameters={"i": 1.7})
    assert flow.to_dataframe().loc["load.flange", "power"] == pytest.approx(50.0)
    lines = str(flow).splitlines()
    assert lines[0] == "Steady power flow of SingleLoop: mobility 1 (1 degree of freedom)"
    assert lines[2].split("  ")[0] == "flange"
    assert [line.split()[0] for line in lines[3:10]] == [
        "drive.flange", "load.flange", "x.sun", "x.carrier", "x.ring", "p.flange_a", "p.flange_b",
    ]  # fmt: skip
    assert lines[4].split()[1:] == ["10", "95.493", "5", "50"]
    assert "input power        50 W from drive" in lines
    assert "efficiency         1" in lines
    assert any(line.startswith("circulating power  24.2857 W, 48.57 %") for line in lines)
    assert lines[-1].strip() == "24.2857 W through p, x"


class LossyLoop(gl.Component):
    """An X unit without losses and a lossy P unit that leads its sun back to the carrier."""

    i = gl.Structural(1.7)
    eta_1, eta_2 = gl.Structural(0.96), gl.Structural(0.94)

    def assemble(self) -> list[Any]:
        self.drive, self.load, self.body = gp.Torque(), gp.Torque(), gp.Inertia(J=3.0)
        self.x = gp.IdealPlanetary(ratio=4.2)
        self.p = LossyGear(ratio=self.i, loss_table=((0.0, self.eta_1, self.eta_2, 0.0, 0.0),))
        return [
            gl.connect(self.drive.flange, self.x.ring),
            gl.connect(self.x.sun, self.p.flange_a),
            gl.connect(self.x.carrier, self.body.flange_a),
            gl.connect(self.p.flange_b, self.body.flange_b, self.load.flange),
        ]


@pytest.mark.parametrize("i", [1.7, -1.6])
def test_efficiency_of_a_loop_with_a_lossy_gear(i: float) -> None:
    """With circulating power (i > 0) the carrier drives the P unit, without (i < 0) the sun does: eta_2, eta_1 count.

    Torque of the carrier's shaft: T = (1 + k) t - f i t with t the sun's torque on the X unit and f the loss factor.
    """
    k, T, w = 4.2, 70.0, 12.0
    flow = gl.compile(LossyLoop(i=i)).power_flow(speeds={"body.w": w}, torques={"load.tau": -T})
    factor = 1 / 0.94 if i > 0 else 0.96  # of the torque at flange_b over that without losses
    sun = T / (1 + k - factor * i)
    assert flow["x.sun"].torque == pytest.approx(sun, rel=EXACT)
    assert flow["p.flange_b"].torque == pytest.approx(factor * i * sun, rel=EXACT)
    assert flow["drive.flange"].power == pytest.approx(-k * sun * w * (1 + k - i) / k, rel=EXACT)
    assert flow.efficiency == pytest.approx((1 + k - factor * i) / (1 + k - i), rel=EXACT)
    assert flow.losses == {"p": pytest.approx(abs(factor - 1) * abs(i) * sun * w, rel=1e-11)}
    assert flow.input_power == pytest.approx(flow.output_power + flow.losses["p"], rel=EXACT)
    assert flow.imbalance < EXACT
    assert flow.willis("x.sun", "x.ring", "x.carrier") == pytest.approx((-k, -k), rel=EXACT)


class Row(gl.Component):
    """Rigid gears and bodies in a row; in every fifth place a planetary set between shafts that a gear joins, too."""

    n = gl.Structural(50)

    def assemble(self) -> list[Any]:
        self.drive, self.load = gp.Torque(), gp.Torque()
        self.gear = [gp.IdealGear(ratio=(-1.25, 0.8, 2.5, -0.4)[i % 4]) for i in range(self.n)]
        self.body = [gp.Inertia(J=1.0) for _ in range(self.n + 1)]
        self.loop = [gp.IdealPlanetary(ratio=2.0) for _ in range(0, self.n, 5)]
        self.back = [gp.IdealGear(ratio=1.5) for _ in self.loop]
        links = [gl.connect(self.drive.flange, self.body[0].flange_a), gl.connect(self.body[-1].flange_b, self.load.flange)]
        for i, gear in enumerate(self.gear):
            links.append(gl.connect(gear.flange_b, self.body[i + 1].flange_a))
            if i % 5:
                links.append(gl.connect(self.body[i].flange_b, gear.flange_a))
                continue
            unit, back = self.loop[i // 5], self.back[i // 5]
            links += [gl.connect(self.body[i].flange_b, unit.ring), gl.connect(unit.sun, back.flange_a)]
            links.append(gl.connect(unit.carrier, back.flange_b, gear.flange_a))
        return links


def test_long_row_of_gears_and_loops() -> None:
    """w_ring = w_carrier (1 + k - i) / k = 0.75 w_carrier in each loop; the rest is a product of ratios."""
    n = 400
    system = gl.compile(Row(n=n))
    ratio = 0.75 ** (n // 5) * (-1.25 * 0.8 * 2.5 * -0.4) ** (n // 4)
    assert gl.mobility(system) == 1
    assert gl.speed_ratio(system, "body[0].w", f"body[{n}].w") == pytest.approx(ratio, rel=1e-11)
    flow = system.power_flow(speeds={f"body[{n}].w": 2.0}, torques={"load.tau": -30.0})
    assert flow["drive.flange"].torque == pytest.approx(-30.0 / ratio, rel=1e-11)
    assert flow.imbalance < EXACT
    assert len(flow.circulating) == n // 5
    assert flow.circulating_power == pytest.approx(n // 5 * 60.0 * 1.5 / (3.0 - 1.5), rel=1e-9)


@pytest.mark.slow
def test_effort_grows_with_size_not_with_its_square() -> None:
    seconds = []
    for n in (250, 1000):
        system = gl.compile(Row(n=n))
        arguments = {"speeds": {"body[0].w": 2.0}, "torques": {"load.tau": -1.0}}
        system.power_flow(**arguments)
        begin = time.process_time()
        system.power_flow(**arguments)
        seconds.append(time.process_time() - begin)
    assert seconds[1] < 8 * seconds[0]
    assert seconds[1] < 2.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"speeds": {"body.w": 10.0}}, "too little is given"),
        ({"torques": {"load.tau": -5.0}}, "too little is given: the speed of"),
        (
            {"speeds": {"body.w": 10.0, "x.sun": 5.0}, "torques": {"load.tau": -5.0}},
            "no steady motion has the given body.w, x.sun",
        ),
        ({"speeds": {"body.w": 10.0}, "torques": {"load.tau": -5.0, "drive.tau": 99.0}}, "no steady motion"),
        ({"speeds": {"body.v": 10.0}}, "no speed or flange 'body.v'"),
        ({"speeds": {"body.w": float("nan")}}, "expected a finite number"),
    ],
)
def test_errors(xp: gl.System, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(gl.GearlibError, match=message):
        gl.power_flow(xp, **arguments)


def test_speed_under_a_load_that_depends_on_speed_is_found() -> None:
    """8 = 2 (w / 10)^2 at w = 20: from the guess, since at rest the load has no slope."""

    class Fan(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.rotor = gp.Torque(tau=8.0), gp.Inertia(J=0.5, guess={"w": 10.0})
            self.load = gp.QuadraticSpeedDependentTorque(tau_nominal=-2.0, w_nominal=10.0)
            return [gl.connect(self.torque.flange, self.rotor.flange_a), gl.connect(self.rotor.flange_b, self.load.flange)]

    system = gl.compile(Fan())
    assert system.power_flow()["load.flange"].speed == pytest.approx(20.0, rel=EXACT)
    assert system.power_flow(torques={"torque.tau": 4.5})["load.flange"].speed == pytest.approx(15.0, rel=EXACT)
    with pytest.raises(gl.GearlibError, match=r"has the given rotor\.w, torque\.tau: the equations of .*rotor"):
        system.power_flow(speeds={"rotor.w": 20.0}, torques={"torque.tau": 5.0})


def test_ratios_that_do_not_exist() -> None:
    system = gl.compile(Ravigneaux())
    with pytest.raises(gl.GearlibError, match="name the speeds that are held"):
        gl.speed_ratio(system, "sun_1.flange", "ring.flange")
    with pytest.raises(gl.GearlibError, match="cannot turn"):
        gl.speed_ratio(system, "sun_1.flange", "ring.flange", held=["carrier.flange", "ring.flange"])


LINKS: list[tuple[Any, int]] = [
    (lambda: gp.Spring(c=5.0), 0), (lambda: gp.Spring(c=0.0), 1), (lambda: gp.SpringDamper(c=5.0, d=2.0), 0),
    (lambda: gp.SpringDamper(c=0.0, d=2.0), 1), (lambda: gp.SpringDamper(c=0.0, d=0.0), 1), (lambda: gp.Damper(d=2.0), 1),
    (lambda: gp.ElastoBacklash(c=5.0, d=1.0, b=0.1), 0), (lambda: gp.ElastoBacklash(c=0.0, d=1.0, b=0.1), 1),
    (lambda: gp.CubicSpringDamper(c=0.0, c_3=1.0, d=1.0), 0), (lambda: gp.CubicSpringDamper(c=0.0, c_3=0.0, d=1.0), 1),
    (lambda: gp.Clutch(fn_max=10.0, f_normalized=0.0), 1), (lambda: gp.Clutch(fn_max=10.0, f_normalized=1.0), 1),
    (lambda: gp.OneWayClutch(fn_max=10.0, f_normalized=1.0), 1), (lambda: gp.Disc(delta_phi=0.1), 0),
    (lambda: gp.DetailedExternalMesh(r_a=0.1, r_b=0.1, c=0.0, d=1.0), 1),
    (lambda: gp.ElasticCoupling(J_a=0.1, J_b=0.1, c=0.0, d=1.0), 1),
]  # fmt: skip


@pytest.mark.parametrize("end", ["body", "massless body", "nothing"])
@pytest.mark.parametrize("which", range(len(LINKS)))
def test_what_is_no_spring_leaves_a_speed_open(which: int, end: str) -> None:
    """A stiffness of zero, losses, clutches: whatever stands at their other end, also where no torque can act there."""
    link, expected = LINKS[which]

    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.rotor, self.link = gp.ConstantSpeed(w_fixed=3.0), gp.Inertia(J=1.0), link()
            joints = [
                gl.connect(self.drive.flange, self.rotor.flange_a),
                gl.connect(self.rotor.flange_b, self.link.flange_a),
            ]
            if end == "nothing":
                return joints
            self.load = gp.Inertia(J=1.0 if end == "body" else 0.0)
            return [*joints, gl.connect(self.link.flange_b, self.load.flange_a)]

    try:
        system = gl.compile(Driven())
    except gl.GearlibError as refusal:  # a massless end of a link without any effect: its motion does not follow from anything
        assert end != "body"
        assert expected == 1
        assert re.search(r"under-determined|zero|singular", str(refusal))
        return
    assert gl.mobility(system) == expected


MESHES: dict[str, dict[str, Any]] = {
    "plain": {}, "gap": {"backlash": True, "b": 1e-4}, "gap of zero": {"backlash": True}, "preloaded": {"backlash": True, "b": -1e-6},
    "sinusoidal": {"stiffness": "sinusoidal", "c_amplitude": 0.3, "phase0": 0.7},
    "rectangular": {"stiffness": "rectangular", "contact_ratio": 1.6},
    "fourier": {"stiffness": "fourier", "stiffness_terms": ((1, 0.2, 0.3), (2, 0.1, 0.0))},
    "table": {"stiffness": "table"},
    "error": {"error_terms": ((1, 1e-5, 0.2), (2, 3e-6, 0.0))},
    "error table": {"error_table": ((0.0, 0.0), (1.0, 3e-5), (3.0, -2e-5), (5.0, 1e-5)), "phase0": 0.4},
    "friction": {"friction": True, "contact_ratio": 1.6},
    "all": {
        "error_table": ((0.0, 0.0), (1.0, 3e-5), (3.0, -2e-5)), "friction": True, "contact_ratio": 1.6, "stiffness": "table",
        "stiffness_table": ((0.0, 1.2), (2.0, 0.9), (4.0, 0.9)),
    },
}  # fmt: skip


class Stages(gl.Component):
    """Stages 1:2 with detailed meshes."""

    kinds = gl.Structural(())

    def assemble(self) -> list[Any]:
        self.drive, self.load = gp.Torque(), gp.Torque()
        self.body = [gp.Inertia(J=0.1) for _ in range(len(self.kinds) + 1)]
        self.mesh = [gp.DetailedExternalMesh(r_a=0.05, r_b=0.1, c=1e8, d=500.0, z_a=20.0, **MESHES[k]) for k in self.kinds]
        joints = [gl.connect(self.drive.flange, self.body[0].flange_a), gl.connect(self.body[-1].flange_b, self.load.flange)]
        for i, mesh in enumerate(self.mesh):
            joints += [
                gl.connect(self.body[i].flange_b, mesh.flange_a),
                gl.connect(mesh.flange_b, self.body[i + 1].flange_a),
            ]
        return joints


@pytest.mark.parametrize("kinds", [*((k,) for k in MESHES), ("plain", "gap"), ("sinusoidal", "error", "friction")])
def test_detailed_meshes_turn_as_rigid_gears_do(kinds: tuple[str, ...]) -> None:
    """On average over the mesh, also where stiffness and transmission error vary: the ratio is that of the radii."""
    system, ratio = gl.compile(Stages(kinds=kinds)), (-2.0) ** len(kinds)
    assert gl.mobility(system) == 1
    assert gl.speed_ratio(system, "body[0].w", f"body[{len(kinds)}].w") == pytest.approx(ratio, rel=1e-12)
    if "gap" in kinds:
        return  # which flank carries is not known; power_flow says so
    flow = gl.power_flow(system, speeds={"body[0].w": 100.0}, torques={"load.tau": -10.0})
    assert flow["load.flange"].speed == pytest.approx(100.0 / ratio, rel=1e-10)
    if not {"friction", "all"} & set(kinds):
        assert flow["drive.flange"].torque == pytest.approx(-10.0 / ratio, rel=1e-10)


@pytest.mark.parametrize("phase0", [0.0, 2.0, 4.5])
@pytest.mark.parametrize(("mu", "contact_ratio"), [(0.05, 1.6), (0.1, 1.3), (0.2, 2.0)])
def test_mesh_friction_loses_its_mean_over_a_turn(mu: float, contact_ratio: float, phase0: float) -> None:
    """By quadrature over the positions of the pairs, wherever the turn begins; and Niemann's formula."""

    class Pair(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.load = gp.Torque(), gp.Torque()
            self.mesh = gp.DetailedExternalMesh(
                r_a=0.05, r_b=0.1, c=1e8, d=500.0, z_a=20.0, friction=True, mu=mu, contact_ratio=contact_ratio, phase0=phase0,
                v_smooth=1e-6,
            )  # fmt: skip
            return [
                gl.connect(self.drive.flange, self.mesh.flange_a),
                gl.connect(self.mesh.flange_b, self.load.flange),
            ]

    flow = gl.power_flow(gl.compile(Pair()), speeds={"mesh.flange_a": 100.0}, torques={"load.tau": -10.0})
    pitch, w_a, w_b, r_b = 2 * np.pi * 0.05 / 20, 100.0, -50.0, 0.1
    u = (np.arange(200_000) + 0.5) / 200_000
    pairs = 1 + (u < contact_ratio - 1)
    power, torque_b = np.zeros(len(u)), np.zeros(len(u))  # per newton along the line of action
    for k in range(2):
        beyond = pitch * (u + k - contact_ratio / 2)
        arm_a, arm_b = 0.05 * np.tan(np.pi / 9) + beyond, 0.1 * np.tan(np.pi / 9) - beyond
        sliding = arm_a * w_a + arm_b * w_b
        force = np.where(k < pairs, mu / pairs * np.sign(sliding), 0.0)
        power += force * sliding
        torque_b += force * arm_b
    force = 10.0 / (r_b - torque_b.mean())
    lost = flow.input_power - flow.output_power
    assert lost == pytest.approx(force * power.mean(), rel=1e-3)
    eps = contact_ratio / 2
    assert lost == pytest.approx(force * 5.0 * mu * np.pi * (1 / 20 + 1 / 40) * (1 - contact_ratio + 2 * eps**2), rel=1e-3)


class Car(gl.Component):
    """A motor, a gear, an elastic shaft, a mass, air and rolling resistance; the air's torque has one direction (see its part)."""

    direction = gl.Structural(True)
    bound = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.motor = gp.Torque(tau=100.0) if self.bound else gp.Torque()
        self.rotor, self.wheel = gp.Inertia(J=0.05), gp.Inertia(J=80.0)
        self.gear, self.shaft = gp.IdealGear(ratio=8.0), gp.SpringDamper(c=5e3, d=20.0)
        self.air = gp.QuadraticSpeedDependentTorque(tau_nominal=-300.0, w_nominal=100.0, torque_direction=self.direction)
        self.roll = gp.LinearSpeedDependentTorque(tau_nominal=-50.0, w_nominal=100.0, torque_direction=False)
        return [
            gl.connect(self.motor.flange, self.rotor.flange_a),
            gl.connect(self.rotor.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.wheel.flange_a),
            gl.connect(self.wheel.flange_b, self.air.flange, self.roll.flange),
        ]


FORWARD = 155.17847391957153  # 800 = 0.03 w^2 + 0.5 w


@pytest.mark.parametrize("direction", [True, False])
@pytest.mark.parametrize("bound", [True, False])
def test_of_several_speeds_it_is_the_one_that_the_train_comes_to(direction: bool, bound: bool) -> None:
    """Newton's method from rest finds -171.8 rad/s just as well, where the air drives the car backwards for ever."""
    system = gl.compile(Car(direction=direction, bound=bound))
    torques = {} if bound else {"motor.tau": 100.0}
    flow = gl.power_flow(system, torques=torques)
    assert flow["wheel.flange_a"].speed == pytest.approx(FORWARD, rel=1e-9)
    run = system.simulate(3000.0, samples=2, inputs=torques)
    assert flow["wheel.flange_a"].speed == pytest.approx(run["wheel.w"][-1], rel=1e-5)


class Fan(gl.Component):
    """A body with the air's torque on it, and no variable for its speed: the state is der(flange.phi)."""

    flange = gp.Flange("shaft")

    def equations(self) -> list[gl.Eq]:
        phi = self.flange.phi
        w = gl.der(phi)
        return [gl.Eq(80.0 * gl.der(w), self.flange.tau - 0.03 * w**2 - 0.5 * w)]


def test_a_speed_that_has_no_variable_is_found_among_several() -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.fan = gp.Torque(), Fan()
            return [gl.connect(self.motor.flange, self.fan.flange)]

    flow = gl.power_flow(gl.compile(Driven()), torques={"motor.tau": 800.0})
    assert flow["fan.flange"].speed == pytest.approx(FORWARD, rel=1e-9)


class Climbing(gl.Component):
    """A load whose torque is zero at three speeds, of which the middle one is left at once."""

    flange = gp.Flange("shaft")
    k = gl.Parameter("N.m.s3/rad3", default=1.0)
    w = gl.Variable("rad/s")

    def equations(self) -> list[gl.Eq]:
        w = self.w
        return [gl.Eq(w, gl.der(self.flange.phi)), gl.Eq(self.flange.tau, self.k * (w - 1) * (w - 2) * (w - 3))]


def test_the_speed_depends_on_where_the_train_begins() -> None:
    class Train(gl.Component):
        w0 = gl.Parameter("rad/s", default=0.0)

        def assemble(self) -> list[Any]:
            self.body, self.gear, self.load = gp.Inertia(J=1.0, start={"w": 2 * self.w0}), gp.IdealGear(ratio=2.0), Climbing()
            return [gl.connect(self.body.flange_b, self.gear.flange_a), gl.connect(self.gear.flange_b, self.load.flange)]

    system = gl.compile(Train())
    for begin, reached in ((0.0, 1.0), (1.9, 1.0), (2.1, 3.0), (8.0, 3.0)):
        flow = gl.power_flow(system, parameters={"w0": begin})
        assert flow["load.flange"].speed == pytest.approx(reached, rel=1e-9), begin
        assert flow["body.flange_b"].speed == pytest.approx(2 * reached, rel=1e-9)
    middle = gl.power_flow(system, speeds={"load.w": 2.0})
    assert middle["load.flange"].torque == pytest.approx(0.0, abs=1e-12)


def test_the_speed_is_the_one_that_a_train_comes_to_under_the_laws_at_first() -> None:
    """A load that is as above at first; half a second later the middle speed is the one that is kept."""

    class Turned(gl.Component):
        flange = gp.Flange("shaft")
        k = gl.Parameter("N.m.s3/rad3", default=1.0)
        w = gl.Variable("rad/s")

        def equations(self) -> list[gl.Eq]:
            law = self.k * (self.w - 1) * (self.w - 2) * (self.w - 3)
            later = gl.Piecewise((law, gl.time < 0.5), (-law, True))
            return [gl.Eq(self.w, gl.der(self.flange.phi)), gl.Eq(self.flange.tau, later)]

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.load = gp.Inertia(J=1.0, start={"w": 2.2}), Turned()
            return [gl.connect(self.body.flange_b, self.load.flange)]

    system = gl.compile(Train())
    with pytest.warns(gl.InputWarning, match="load"):
        flow = gl.power_flow(system)
    assert flow["load.flange"].speed == pytest.approx(3.0, rel=1e-9)


def test_speeds_that_nothing_tells_apart_are_named() -> None:
    """A binding that is replaced: no run says which way it goes."""
    system = gl.compile(Car(bound=True))
    with pytest.raises(
        gl.GearlibError, match=r"several steady motions have the given motor\.tau: der\(.*\) is .* in one and .* in another"
    ):
        gl.power_flow(system, torques={"motor.tau": 50.0})


@pytest.mark.parametrize("tau", [3.0, -3.0])
@pytest.mark.parametrize("mesh", [False, True])
def test_a_gap_that_the_torque_closes(tau: float, mesh: bool) -> None:
    """From inside an open gap the train comes to turn with it closed, at the side of the torque: w = tau w_n / tau_n, as a long run."""

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.a, self.b = gp.Torque(tau=tau), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            flanks = gp.DetailedExternalMesh(r_a=0.05, r_b=0.05, c=1e7, d=3e5, backlash=True, b=1e-4)
            self.gap = flanks if mesh else gp.ElastoBacklash(c=1e3, d=10.0, b=0.1)
            self.load = gp.LinearSpeedDependentTorque(tau_nominal=-2.0, w_nominal=4.0, torque_direction=False)
            return [
                gl.connect(self.drive.flange, self.a.flange_a),
                gl.connect(self.a.flange_b, self.gap.flange_a),
                gl.connect(self.gap.flange_b, self.b.flange_a),
                gl.connect(self.b.flange_b, self.load.flange),
            ]

    flow = gl.power_flow(gl.compile(Train()))
    sense = -1.0 if mesh else 1.0
    assert flow["b.flange_a"].speed == pytest.approx(sense * 2.0 * tau, rel=1e-6)
    assert flow["gap.flange_a"].torque == pytest.approx(tau, rel=1e-6)
    run = gl.simulate(Train(), 150.0, samples=2)
    assert run["b.w"][-1] == pytest.approx(flow["b.flange_a"].speed, rel=1e-4)


class AtRest(gl.Component):
    """Torques that cancel within one shaft, a load, and a loop of two gears through a spring: nothing turns."""

    def assemble(self) -> list[Any]:
        self.body, self.inner, self.gear = gp.Inertia(J=1.2), gp.Torque2(tau=-3.302704636554461), gp.IdealGear(ratio=-1.4)
        self.load = gp.LinearSpeedDependentTorque(tau_nominal=-1.0, w_nominal=1.0, torque_direction=False)
        self.shaft, self.back = gp.SpringDamper(c=3267.0, d=1.0, phi_rel0=1.0), gp.IdealGear(ratio=-1.0)
        self.seen = gp.RelativeStates()
        return [
            gl.connect(self.body.flange_a, self.inner.flange_b, self.seen.flange_a),
            gl.connect(self.body.flange_b, self.inner.flange_a, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.load.flange, self.shaft.flange_b),
            gl.connect(self.shaft.flange_a, self.back.flange_a),
            gl.connect(self.back.flange_b, self.seen.flange_b),
        ]


def test_a_train_at_rest_has_one_motion() -> None:
    """Its speeds are rounding, 1e-32 rad/s, which differ in all digits between two ways to find them."""
    flow = gl.power_flow(gl.compile(AtRest()))
    assert abs(flow["body.flange_a"].speed) < 1e-12
    assert flow["load.flange"].torque == pytest.approx(0.0, abs=1e-12)
    numbers = [value for f in flow.flanges for value in (f.speed, f.torque, f.power)]
    assert not any(value == 0 and np.signbit(value) for value in numbers)


def test_zeros_are_printed_without_a_sign() -> None:
    """Where all stands still under torque there is no scale by which a speed could be small."""
    text = str(gl.PowerFlow((FlangePower("part", "flange", -0.0, 3.0, -0.0, 0, True),), 1))
    assert "part.flange" in text
    assert not re.search(r"-0(?![.\d])", text)


class Crank(gl.Component):
    """A slider on a crank, without friction."""

    flange = gp.Flange("crank")
    slider = gp.TranslationalFlange("slider")
    r = gl.Parameter("m", default=0.05)
    rod = gl.Parameter("m", default=0.2)

    def equations(self) -> list[Any]:
        sin, cos = gl.sin(self.flange.phi), gl.cos(self.flange.phi)
        along = gl.sqrt(self.rod**2 - self.r**2 * sin**2)
        lever = self.r * sin + self.r**2 * sin * cos / along
        return [gl.Eq(self.slider.s, self.r * cos + along), gl.Eq(self.flange.tau, lever * self.slider.f)]


class Jointed(gl.Component):
    """A gear, two universal joints with a shaft between them, a crank with a piston, and a load that grows with the speed."""

    def assemble(self) -> list[Any]:
        self.drive, self.motor, self.gear = gp.Torque(), gp.Inertia(J=0.2), gp.IdealGear(ratio=-2.0)
        self.first, self.second = gp.UniversalJoint(beta=0.5), gp.UniversalJoint(beta=0.3)
        self.shaft, self.wheel = gp.SpringDamper(c=2000.0, d=2.0), gp.Inertia(J=0.3)
        self.crank, self.piston = Crank(), gp.Mass(m=0.4)
        self.load, self.ground = gp.Damper(d=0.4), gp.Fixed()
        line = [self.motor, self.gear, self.first, self.shaft, self.second, self.wheel, self.load]
        return [
            gl.connect(self.drive.flange, self.motor.flange_a),
            *(gl.connect(a.flange_b, b.flange_a) for a, b in itertools.pairwise(line)),
            gl.connect(self.wheel.flange_a, self.crank.flange),
            gl.connect(self.crank.slider, self.piston.flange_a),
            gl.connect(self.load.flange_b, self.ground.flange),
        ]


def test_joints_and_cranks_turn_with_their_mean_speeds() -> None:
    """Angles behind a joint are ahead of each other by what repeats; a slider goes to and fro."""
    system = gl.compile(Jointed())
    assert gl.mobility(system) == 1
    assert gl.speed_ratio(system, "motor.w", "wheel.w") == pytest.approx(-2.0)
    flow = system.power_flow(speeds={"motor.w": 30.0})
    assert flow["wheel.flange_a"].speed == pytest.approx(-15.0)
    assert flow["drive.flange"].torque == pytest.approx(-0.4 * 15.0 / 2)
    assert flow["piston.flange_a"].speed == pytest.approx(0.0, abs=1e-9)
    assert flow.input_power == pytest.approx(90.0)
    assert flow.output_power == pytest.approx(90.0)


class Port(gl.Connector):
    """Hydraulic."""

    p = gl.Potential("Pa")
    q = gl.Flow("m3/s")


class Pump(gl.Component):
    """Pump or motor whose displacement is a fraction ``x`` of the largest, and that leaks."""

    flange, port = gp.Flange("shaft"), Port("line; the tank is at 0")
    x = gl.Input("1", "displacement over the largest one", default=1.0)
    D = gl.Parameter("m3", "largest displacement", default=1e-5)
    leak = gl.Parameter("m3/(s.Pa)", "leakage", default=1e-12)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.port.q, -self.D * self.x * gl.der(self.flange.phi) + self.leak * self.port.p),
            gl.Eq(self.flange.tau, self.D * self.x * self.port.p),
        ]


class Hydrostatic(gl.Component):
    def assemble(self) -> list[Any]:
        self.drive, self.load = gp.Torque(tau=20.0), gp.Torque()
        self.pump, self.motor = Pump(x=0.5), Pump(D=3e-5)
        self.rotor, self.drum = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        return [
            gl.connect(self.drive.flange, self.rotor.flange_a, self.pump.flange),
            gl.connect(self.pump.port, self.motor.port),
            gl.connect(self.motor.flange, self.drum.flange_a, self.load.flange),
        ]


def test_a_pressure_is_no_angle() -> None:
    """Laws that are not linear are frozen at an angle, not at a pressure; and what flows beside the shafts is said."""
    flow = gl.compile(Hydrostatic()).power_flow(speeds={"pump.flange": 100.0})
    p = 20.0 / (0.5 * 1e-5)
    speed = -(0.5 * 1e-5 * 100.0 - 2 * 1e-12 * p) / 3e-5
    assert flow["motor.flange"].torque == pytest.approx(3e-5 * p)
    assert flow["motor.flange"].speed == pytest.approx(speed)
    assert flow.beside == ("pump", "motor")
    assert str(flow).endswith("those of pump, motor)")


class Pushed(gl.Component):
    """A torque of 5 N.m on a body whose load pushes the more, the faster it turns (gain > 0), or holds it (gain < 0)."""

    gain = gl.Parameter("N.m", "torque of the load at 1 rad/s")
    is_quadratic = gl.Structural(False)

    def assemble(self) -> list[gl.Connection]:
        load = gp.QuadraticSpeedDependentTorque if self.is_quadratic else gp.LinearSpeedDependentTorque
        self.torque, self.body = gp.Torque(), gp.Inertia(J=2.0, guess={"w": 3.0})
        self.load = load(tau_nominal=self.gain, w_nominal=1.0, torque_direction=False)
        return [gl.connect(self.torque.flange, self.body.flange_a, self.load.flange)]


@pytest.mark.parametrize("is_quadratic", [False, True])
def test_a_motion_that_a_run_leaves_comes_with_a_warning(is_quadratic: bool) -> None:
    """2 der(w) = tau + gain w, or tau + gain w abs(w): unstable where the slope is positive."""
    held = gl.compile(Pushed(gain=-1.25, is_quadratic=is_quadratic))
    pushed = gl.compile(Pushed(gain=1.25, is_quadratic=is_quadratic))
    speed = 2.0 if is_quadratic else 4.0
    slope = 1.25 * (2 * speed if is_quadratic else 1.0)
    assert gl.power_flow(held, torques={"torque.tau": 5.0})["load.flange"].speed == pytest.approx(speed, rel=1e-9)
    with pytest.warns(gl.GearlibWarning, match=f"Pushed: the steady state is unstable.* factor of e in {2.0 / slope:.3g} s"):
        flow = gl.power_flow(pushed, torques={"torque.tau": -5.0})
    assert flow["load.flange"].speed == pytest.approx(speed, rel=1e-9)
    assert gl.power_flow(pushed, speeds={"body.w": speed})["torque.flange"].torque == pytest.approx(5.0)  # the torque is free
