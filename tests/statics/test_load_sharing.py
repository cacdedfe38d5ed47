"""Power flow of trains whose parallel paths (planets) could be preloaded against each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearparts.gears.lossy import LossyGear


class Rig(gl.Component):
    """A single-loop train between a drive and a load."""

    kind = gl.Structural("PX")
    planet_meshes = gl.Structural("separate")

    def assemble(self) -> list[Any]:
        self.drive, self.load = gp.Torque(), gp.Torque()
        self.train = {"XP": gp.XPTrain, "PX": gp.PXTrain, "XX": gp.XXTrain}[self.kind](planet_meshes=self.planet_meshes)
        return [
            gl.connect(self.drive.flange, self.train.flange_in),
            gl.connect(self.load.flange, self.train.flange_out),
        ]


R_s, R_p, R_1, R_2, m_22 = 0.03, 0.045, 0.03, 0.1, 1.25
GEOMETRY = {
    "PX": {"R_s": R_s, "R_p": R_p, "R_r": R_s + 2 * R_p, "R_h": R_s + R_p, "R_1": R_1, "R_2": R_2, "m_22": m_22, "m_18": 1.0, "m_19": 1.0},
    "XX": {"R_s1": R_s, "R_p1": R_p},
}  # fmt: skip
k = (R_s + 2 * R_p) / R_s
RATIO = {"PX": (1 + k) / (1 + k * R_1 / (R_2 * m_22)), "XX": (1 + k) / (1 + k / (1 + k))}  # input over output: Willis


@pytest.mark.parametrize("kind", ["XP", "PX", "XX"])
def test_planets_with_meshes_of_their_own(kind: str) -> None:
    T, w = 100.0, 7.0
    system = gl.compile(Rig(kind=kind))
    values = {f"train.{name}": value for name, value in GEOMETRY.get(kind, {}).items()}
    assert gl.mobility(system) == 1
    flow = system.power_flow(speeds={"load.flange": w}, torques={"load.tau": -T}, parameters=values)
    ratio = gl.speed_ratio(system, "drive.flange", "load.flange", parameters=values)
    assert ratio == pytest.approx(RATIO.get(kind, ratio), rel=1e-12)
    assert flow["drive.flange"].speed == pytest.approx(ratio * w, rel=1e-12)
    assert flow["drive.flange"].torque == pytest.approx(-T / ratio, rel=1e-12)
    assert flow.efficiency == pytest.approx(1.0, rel=1e-12)
    assert flow.imbalance < 1e-12
    lumped = gl.compile(Rig(kind=kind, planet_meshes="lumped"))
    other = lumped.power_flow(speeds={"load.flange": w}, torques={"load.tau": -T}, parameters=values)
    assert flow["drive.flange"].torque == pytest.approx(other["drive.flange"].torque, rel=1e-12)
    assert not other.shared
    for unit in ("first", "second") if kind == "XX" else ("x_unit",):
        for side in ("sun", "ring"):
            torques = [flow[f"train.{unit}.{side}_meshes[{k}].flange_a"].torque for k in range(3)]
            assert torques == pytest.approx([torques[0]] * 3, rel=1e-11)
            assert abs(torques[0]) > 1.0
            assert f"train.{unit}.{side}_meshes[0].flange_a" in flow.shared
    assert "which share the load by stiffness, equally among equal planets" in " ".join(str(flow).split())


class Parallel(gl.Component):
    """Two layshafts, each with two meshes; the second path has meshes of other stiffness, and a lossy gear where asked for."""

    c = gl.Structural((2e7, 5e7, 8e7, 3e7))
    lossy = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.drive, self.load = gp.Torque(), gp.Torque()
        self.first, self.last = gp.Inertia(J=0.01), gp.Inertia(J=0.04)
        self.middle = [gp.Inertia(J=0.002), gp.Inertia(J=0.002)]
        mesh = {"r_a": 0.05, "r_b": 0.1, "d": 3e4}
        self.front = [gp.ExternalMesh(c=self.c[0], **mesh), gp.ExternalMesh(c=self.c[1], **mesh)]
        self.rear = [gp.ExternalMesh(c=self.c[2], **mesh), gp.ExternalMesh(c=self.c[3], **mesh)]
        table = ((0.0, 0.9, 0.8, 0.0, 0.0),) if self.lossy else ((0.0, 1.0, 1.0, 0.0, 0.0),)
        self.gear = [LossyGear(ratio=1.0, loss_table=table) if self.lossy else gp.IdealGear(ratio=1.0) for _ in range(2)]
        links = [gl.connect(self.drive.flange, self.first.flange_a), gl.connect(self.last.flange_b, self.load.flange)]
        for front, body, gear, rear in zip(self.front, self.middle, self.gear, self.rear, strict=True):
            links += [
                gl.connect(self.first.flange_b, front.flange_a), gl.connect(front.flange_b, body.flange_a),
                gl.connect(body.flange_b, gear.flange_a), gl.connect(gear.flange_b, rear.flange_a),
                gl.connect(rear.flange_b, self.last.flange_a),
            ]  # fmt: skip
        return links


class Observed(gl.Component):
    """A mesh whose force stands beside its deflection in another equation, too."""

    flange_a, flange_b = gp.Flange("wheel"), gp.Flange("wheel")
    c, r_a, r_b, d = gl.Parameter("N/m"), gl.Parameter("m"), gl.Parameter("m"), gl.Parameter("N.s/m")
    q, F, mean = gl.Variable("m", start=0.0), gl.Variable("N"), gl.Variable("N", "mean of the force and its elastic part")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.q), self.r_a * gl.der(self.flange_a.phi) + self.r_b * gl.der(self.flange_b.phi)),
            gl.Eq(self.F, self.c * self.q + self.d * gl.der(self.q)),
            gl.Eq(self.flange_a.tau, self.r_a * self.F),
            gl.Eq(self.flange_b.tau, self.r_b * self.F),
            gl.Eq(2 * self.mean, self.F + self.c * self.q),
        ]


class Many(gl.Component):
    """Layshafts with two meshes each, all between the same two shafts."""

    c = gl.Structural(((4e7, 4e7),))
    observed = gl.Structural(())
    loose = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.drive, self.load, self.first, self.last = gp.Torque(), gp.Torque(), gp.Inertia(J=0.01), gp.Inertia(J=0.04)
        kinds = [Observed if k in self.observed else gp.ExternalMesh for k in range(len(self.c))]
        self.front, self.rear = (
            [kind(c=c[k], r_a=0.05, r_b=0.1, d=3e4) for c, kind in zip(self.c, kinds, strict=True)] for k in (0, 1)
        )
        links = [gl.connect(self.drive.flange, self.first.flange_a), gl.connect(self.last.flange_b, self.load.flange)]
        for front, rear in zip(self.front, self.rear, strict=True):
            links += [gl.connect(self.first.flange_b, front.flange_a), gl.connect(front.flange_b, rear.flange_a)]
            links.append(gl.connect(rear.flange_b, self.last.flange_a))
        if self.loose:  # a wheel with nothing behind it
            self.end = gp.ExternalMesh(c=5e7, r_a=0.05, r_b=0.1, d=3e4)
            self.spring = gp.Spring(c=5e3)
            links.append(gl.connect(self.last.flange_b, self.end.flange_a, self.spring.flange_a))
        return links


@pytest.mark.parametrize(("count", "observed"), [(3, (0, 2)), (8, ()), (9, ()), (12, ())])
def test_any_number_of_paths_share_by_stiffness(count: int, observed: tuple[int, ...]) -> None:
    """With as many torques open, less one; nine are more than are looked for at first. A spring counts once."""
    c = tuple((1e7 * (1 + k), 3e7 * (count - k)) for k in range(count))
    system = gl.compile(Many(c=c, observed=observed, loose=count == 3))
    k = [stiffness(*path) for path in c]
    expected = [120.0 * x / sum(k) for x in k]
    for times in (1.0, 1e6, 1e-6) if count == 3 else (1.0,):
        given = {f"{mesh}[{i}].c": times * path[j] for j, mesh in enumerate(("front", "rear")) for i, path in enumerate(c)}
        flow = system.power_flow(speeds={"last.w": 5.0}, torques={"load.tau": -120.0}, parameters=given)
        assert [-flow[f"rear[{i}].flange_b"].torque for i in range(count)] == pytest.approx(expected, rel=1e-9)
        assert flow["drive.flange"].torque == pytest.approx(-30.0, rel=1e-12)


@pytest.mark.parametrize("ratios", [(2.0, 2.0), (2.0, 2.0, 2.0)])
def test_equal_rigid_paths_share_equally(ratios: tuple[float, ...]) -> None:
    """However they are declared; a run sets all but one to zero. Two fixed flanges hold a shaft together."""

    class Rigid(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.load, self.wheel = gp.Torque(), gp.Torque(), gp.Inertia(J=1.0)
            self.gear, self.ground = [gp.IdealGear(ratio=r) for r in ratios], [gp.Fixed(), gp.Fixed()]
            self.held = gp.Torque(tau=3.0)
            return [
                gl.connect(self.drive.flange, *(gear.flange_a for gear in self.gear)),
                gl.connect(*(gear.flange_b for gear in self.gear), self.wheel.flange_a),
                gl.connect(self.wheel.flange_b, self.load.flange),
                gl.connect(self.ground[0].flange, self.ground[1].flange, self.held.flange),
            ]

    system = gl.compile(Rigid())
    flow = system.power_flow(speeds={"wheel.w": 5.0}, torques={"load.tau": -120.0})
    assert [gear.torque for gear in (flow[f"gear[{k}].flange_b"] for k in range(len(ratios)))] == pytest.approx(
        [-120 / len(ratios)] * len(ratios), rel=1e-12
    )
    assert [flow[f"ground[{k}].flange"].torque for k in range(2)] == pytest.approx([1.5, 1.5], rel=1e-12)
    assert flow["drive.flange"].torque == pytest.approx(-60.0, rel=1e-12)
    assert (flow.mobility, len(flow.shared)) == (1, 2 * len(ratios) + 2)
    assert "and the smallest ones where these are rigid)" in " ".join(str(flow).split())


def stiffness(c_front: float, c_rear: float) -> float:
    """Of a path as seen at the load, N.m/rad. A torque T there is a force 10 T at the rear pair, T / 2 and so 5 T at the front one."""
    return 1 / (5**2 / c_front + 10**2 / c_rear)


def test_paths_of_different_stiffness_share_by_stiffness_and_as_a_long_run_does() -> None:
    c = (2e7, 5e7, 8e7, 3e7)
    system = gl.compile(Parallel())
    T, w = 120.0, 5.0
    flow = system.power_flow(speeds={"last.w": w}, torques={"load.tau": -T})
    k = [stiffness(c[0], c[2]), stiffness(c[1], c[3])]
    expected = [T * x / sum(k) for x in k]
    assert [-flow[f"rear[{i}].flange_b"].torque for i in range(2)] == pytest.approx(expected, rel=1e-11)
    assert flow["drive.flange"].torque == pytest.approx(-T / 4, rel=1e-12)
    start = {"first.w": 4 * w, "last.w": w, **{f"{m}[{i}].q": 0.0 for m in ("front", "rear") for i in range(2)}}
    run = system.simulate(0.5, samples=3, inputs={"load.tau": -T, "drive.tau": T / 4}, start=start)
    assert [-run[f"rear[{i}].flange_b.tau"][-1] for i in range(2)] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("T", [120.0, -120.0])
def test_lossy_paths(T: float) -> None:
    """Equal deflections at the front follow from the stiffness of the rest: hand calculation with the side that drives."""
    system = gl.compile(Parallel(lossy=True, c=(4e7, 4e7, 4e7, 4e7)))
    flow = system.power_flow(speeds={"last.w": 5.0}, torques={"load.tau": -T})
    eta = 0.9 if T > 0 else 1 / 0.8
    assert flow["drive.flange"].torque == pytest.approx(-T / 4 / eta, rel=1e-12)
    assert [-flow[f"rear[{i}].flange_b"].torque for i in range(2)] == pytest.approx([T / 2, T / 2], rel=1e-11)
    assert flow.efficiency == pytest.approx(0.9 if T > 0 else 0.8, rel=1e-12)


def test_what_stays_open_outside_is_still_an_error() -> None:
    system = gl.compile(Rig())
    with pytest.raises(gl.GearlibError, match=r"too little is given: the input drive\.tau, input load\.tau, torque of drive"):
        system.power_flow(speeds={"load.flange": 7.0})
    with pytest.raises(gl.GearlibError, match="the speed of"):
        system.power_flow(torques={"load.tau": -5.0})


class BesideAStuckSet(gl.Component):
    """A gap, or a spring, between the ring and the carrier of a set whose friction holds it, so that all turn as a block."""

    spring = gl.Structural(False)

    def assemble(self) -> list[Any]:
        self.drive, self.load, self.ground = gp.Torque(), gp.Torque(), gp.Fixed()
        self.a, self.b, self.sun = (gp.Inertia(J=1.0) for _ in range(3))
        self.gap = gp.SpringDamper(c=700.0, d=16.0) if self.spring else gp.ElastoBacklash(c=700.0, d=16.0, b=0.1)
        self.drag, self.brake = gp.Damper(d=0.4), gp.Damper(d=0.3)
        meshes = {"sun_mesh": ((0.0, 0.97, 0.95),), "ring_mesh": ((0.0, 0.99, 0.98),), "bearing": ((0.0, 0.1),)}
        self.set = gp.LossyPlanetary(ratio=2.0, **meshes)
        return [
            gl.connect(self.drive.flange, self.a.flange_a, self.gap.flange_a, self.set.ring),
            gl.connect(self.b.flange_a, self.gap.flange_b, self.set.carrier, self.load.flange, self.brake.flange_a),
            gl.connect(self.sun.flange_a, self.set.sun, self.drag.flange_a),
            gl.connect(self.ground.flange, self.drag.flange_b, self.brake.flange_b),
        ]


def test_a_gap_that_only_a_preload_keeps_closed_is_told() -> None:
    """Without preload the friction would carry all: the gap turns open."""
    with pytest.raises(gl.GearlibError, match=r"in gap a gap is open between sides"):
        gl.compile(BesideAStuckSet()).power_flow(speeds={"a.w": 40.0}, torques={"load.tau": 20.0})


def test_a_torque_that_friction_leaves_open_is_told() -> None:
    """The friction cannot carry all, and how much of it is not known; speeds and torques outside are."""
    system = gl.compile(BesideAStuckSet(spring=True))
    with pytest.warns(gl.InputWarning, match=r"the load of parallel paths is one of many: .* depends on a preload"):
        flow = system.power_flow(speeds={"a.w": 40.0}, torques={"load.tau": -20.0})
    assert [flow[f"{body}.flange_a"].speed for body in ("a", "b", "sun")] == pytest.approx([40.0] * 3)
    assert flow["drive.flange"].torque == pytest.approx(-(0.7 * 40.0 + 20.0))


class HeldByThree(gl.Component):
    """A body that a bearing and a brake hold, and one behind a gear that another bearing holds."""

    backwards = gl.Structural(False)

    def assemble(self) -> list[gl.Connection]:
        parts = {
            "drive": gp.Torque(), "body": gp.Inertia(J=0.3), "bearing": gp.BearingFriction(tau_pos=[[0, 1.0]]),
            "brake": gp.Brake(fn_max=4.0, f_normalized=1.0), "gear": gp.IdealGear(ratio=3.0), "wheel": gp.Inertia(J=40.0),
            "other": gp.BearingFriction(tau_pos=[[0, 5.0]]),
        }  # fmt: skip
        for name in reversed(parts) if self.backwards else parts:
            setattr(self, name, parts[name])
        return [
            gl.connect(self.drive.flange, self.body.flange_a, self.bearing.flange_a),
            gl.connect(self.body.flange_b, self.brake.flange_a, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.wheel.flange_a, self.other.flange_a),
        ]


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("tau", [0.4, -1.9])
def test_what_is_locked_on_a_rigid_path_shares_as_in_a_run(backwards: bool, tau: float) -> None:
    """Sums of squares are smallest: 9/19 twice, and 3/19 behind the gear. All torques counted: 0.747, 0.241 and 0.038 instead."""
    system = gl.compile(HeldByThree(backwards=backwards))
    flow = gl.power_flow(system, speeds={"body.flange_a": 0.0}, torques={"drive.tau": tau})
    result = system.simulate(0.1, inputs={"drive.tau": tau})
    for name, share in {"bearing": 9.0, "brake": 9.0, "other": 3.0}.items():
        np.testing.assert_allclose(flow[f"{name}.flange_a"].torque, tau * share / 19.0, rtol=1e-9)
        np.testing.assert_allclose(result[f"{name}.tau"][-1], tau * share / 19.0, rtol=1e-9)
        assert f"{name}.flange_a" in flow.shared
