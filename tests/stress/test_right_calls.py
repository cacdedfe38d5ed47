"""Right calls that reach seldom used lines, by values from closed forms: what comes instead of a value fails a claim, too."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from scipy.io import netcdf_file

import gearlib as gl
import gearparts as gp
from gearlib.fmi.exported_model import exported_model


def given(call: Callable[[], Any]) -> Any:
    """What a right call returns; its claim is that it raises nothing."""
    try:
        return call()
    except Exception as error:
        pytest.fail(f"{type(error).__name__}: {error}")


class Grip(gl.Component):
    """A brake whose coefficient is decided at events: stronger while the run is being started, weaker at low speed."""

    flange = gp.Flange("shaft")
    w = gl.Variable("rad/s")
    now = gl.Discrete()
    before = gl.Discrete()

    def equations(self) -> list[Any]:
        return [
            gl.Eq(self.w, gl.der(self.flange.phi)),
            gl.Eq(self.flange.tau, (self.now + self.before) * self.w),
            gl.Eq(self.now, gl.Piecewise((50.0, gl.initial()), (2.0, self.w > 1.0), (1.0, True))),
            gl.Eq(self.before, gl.pre(self.now)),
        ]


class Gripped(gl.Component):
    """A body that a torque drives against a grip."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.body, self.grip = gp.Torque(), gp.Inertia(J=3.0), Grip()
        return [
            gl.connect(self.torque.flange, self.body.flange_a),
            gl.connect(self.body.flange_b, self.grip.flange),
        ]


@pytest.mark.parametrize(("tau", "w"), [(6.0, 1.5), (1.5, 0.75), (20.0, 5.0)])
def test_steady_motion_with_what_the_start_decided_over(tau: float, w: float) -> None:
    """The coefficient is 2 + 2 above 1 rad/s, and 1 + 1 below it, as after the start, not 50."""
    system = gl.compile(Gripped())
    flow = given(lambda: system.power_flow(torques={"torque.tau": tau}))
    assert flow["body.flange_a"].speed == pytest.approx(w, rel=1e-12)
    run = system.simulate(60.0, samples=2, inputs={"torque.tau": tau}, start={"body.w": w})
    assert run["body.w"][-1] == pytest.approx(w, rel=1e-6)


class Ringed(gl.Component):
    """A set with losses, of three bodies that a torque on the sun drives."""

    def assemble(self) -> list[gl.Connection]:
        friction = ((0.0, 0.2), (40.0, 1.0))
        self.set = gp.LossyPlanetary(ratio=2.5, sun_mesh=((0.0, 0.9, 0.8),), bearing=friction)
        self.torque, self.sun, self.ring, self.carrier = (
            gp.Torque(tau=10.0),
            gp.Inertia(J=0.2),
            gp.Inertia(J=1),
            gp.Inertia(J=3),
        )
        return [
            gl.connect(self.torque.flange, self.sun.flange_a),
            gl.connect(self.sun.flange_b, self.set.sun),
            gl.connect(self.set.ring, self.ring.flange_a),
            gl.connect(self.set.carrier, self.carrier.flange_a),
        ]


@pytest.mark.parametrize(("relative", "friction"), [(20.0, 0.6), (30.0, 0.8)])
def test_a_lossy_set_with_a_table_of_bearing_friction(relative: float, friction: float) -> None:
    """The friction at the sun's speed relative to the carrier lies between the rows of its table."""
    system = given(lambda: gl.compile(Ringed(), outputs=["set.sun.tau", "set.ring.tau", "set.carrier.tau", "set.loss_power"]))
    run = system.simulate(1e-9, samples=2, start={"sun.w": 7.0 + relative, "carrier.w": 7.0})
    sun, ring, carrier, lost = (run[f"set.{x}"][0] for x in ("sun.tau", "ring.tau", "carrier.tau", "loss_power"))
    assert sun > 1.0
    assert ring == pytest.approx(2.5 * (0.9 * sun - friction), rel=1e-9)
    assert carrier == pytest.approx(-sun - ring, rel=1e-9)
    assert lost == pytest.approx((0.1 * sun + friction) * relative, rel=1e-7)


class Spun(gl.Component):
    """A body under a constant torque."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.body = gp.Torque(tau=6.0), gp.Inertia(J=1.0)
        return [gl.connect(self.torque.flange, self.body.flange_a)]


def test_a_sweep_is_read_back_from_its_netcdf_file(tmp_path: Path) -> None:
    """With constant torque w = tau t / J."""
    J, path = np.array([1.0, 2.0, 5.0]), tmp_path / "runs.nc"
    system = gl.compile(Spun())
    options = {"outputs": ["body.w"], "reduce": {"last": gl.final("body.w")}, "samples": 3, "to": path}
    runs = given(lambda: system.sweep({"body.J": J}, 2.0, **options))
    assert runs["last"] == pytest.approx(12.0 / J, rel=1e-12)
    with netcdf_file(path, mmap=False) as file:
        held = {name: np.array(variable.data) for name, variable in file.variables.items()}
    assert held["body.J"].tolist() == [1.0, 2.0, 5.0]
    assert held["time"].tolist() == [0.0, 1.0, 2.0]
    assert held["body.w"] == pytest.approx(np.outer(6.0 / J, [0.0, 1.0, 2.0]), rel=1e-12)
    assert held["last"] == pytest.approx(12.0 / J, rel=1e-12)
    again = given(lambda: system.sweep({"body.J": J}, 2.0, **options))
    assert again.stats["done_before"] == 3
    assert again["last"] == pytest.approx(12.0 / J, rel=1e-12)


class Three(gl.Component):
    """Three oscillators on the ground, of 10, 20 and 40 rad/s, hardly coupled."""

    def assemble(self) -> list[gl.Connection]:
        self.ground = gp.Fixed()
        self.shaft = [gp.SpringDamper(c=w * w, d=0.01 * w) for w in (10.0, 20.0, 40.0)]
        self.disc = [gp.Inertia(J=1.0) for _ in self.shaft]
        self.between = [gp.Spring(c=0.001) for _ in range(2)]
        links = [gl.connect(self.ground.flange, s.flange_a) for s in self.shaft]
        links += [gl.connect(s.flange_b, d.flange_a) for s, d in zip(self.shaft, self.disc, strict=True)]
        for k, spring in enumerate(self.between):
            links += [
                gl.connect(self.disc[k].flange_b, spring.flange_a),
                gl.connect(spring.flange_b, self.disc[k + 1].flange_b),
            ]
        return links


def test_modes_that_begin_to_oscillate_open_branches() -> None:
    """Two discs are overdamped at first: their branches begin behind that of the third, and stay there."""
    system = gl.compile(Three())
    d = np.array([100.0, 90.0, 10.0, 1.0])  # critical are 20 and 40 N.m.s/rad
    runs = given(lambda: gl.sweep(gl.modes, system, {"shaft[0].d": d, "shaft[1].d": d}))
    w = 2 * np.pi * runs["frequencies"]
    assert w[:, 0] == pytest.approx([40.0] * 4, rel=1e-4)
    assert np.isnan(w[:2, 1:]).all()
    assert w[2:] == pytest.approx(np.array([[40.0, 10.0, 20.0]] * 2), rel=1e-4)
    assert runs["damping"][2:, 1:] == pytest.approx(np.outer(d[2:], [1 / 20.0, 1 / 40.0]), rel=1e-4)
    assert runs["number"][2:].tolist() == [[2, 0, 1]] * 2


class Circling(gl.Component):
    """Quantities with closed forms, by sine and cosine, and by their hyperbolic counterparts, of the same quantity."""

    x = gl.Variable("1", start=0.7)
    y = gl.Variable("1", start=0.7)
    z = gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), gl.sin(self.x) * gl.cos(self.x)),
            gl.Eq(gl.der(self.y), -gl.cosh(self.y) * gl.sinh(self.y)),
            gl.Eq(gl.der(self.z), gl.cos(self.z)),
        ]


def test_a_taylor_series_of_sine_and_cosine_of_one_quantity() -> None:
    """tan(x) = tan(x0) exp(t), tanh(y) = tanh(y0) exp(-t), and sin(z) = tanh(t)."""
    run = given(lambda: gl.compile(Circling()).simulate(2.0, samples=5, method="taylor", rtol=1e-12, atol=1e-14))
    assert run.stats["method"] == "taylor"
    assert run["x"] == pytest.approx([math.atan(math.tan(0.7) * math.exp(t)) for t in run.time], rel=1e-10)
    assert run["y"] == pytest.approx([math.atanh(math.tanh(0.7) * math.exp(-t)) for t in run.time], rel=1e-10)
    assert run["z"] == pytest.approx([math.asin(math.tanh(t)) for t in run.time], rel=1e-10)


PAIR = gp.GearPair(20, 40, 3e-3, 0.02)
SAID: dict[str, tuple[Callable[[], object], str]] = {
    "modes": (lambda: gl.modes(gl.compile(gp.ZhouCui2022())), "train.x_unit.ring_mesh 96 %"),
    "gears": (lambda: gp.DetailedExternalMesh(d=0.0, **PAIR.mesh_values()).drawn_gears(), "gear a: 20"),
    "diagram": (lambda: gp.ZhouCui2022().diagram(2).svg, "ZhouCui2022"),
}


@pytest.mark.parametrize("name", SAID)
def test_results_are_printed(name: str) -> None:
    call, part = SAID[name]
    assert part in given(lambda: str(call()))


class Twice(gl.Component):
    """Two gears of one ratio between the same shafts: one of them says nothing new."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.a, self.b = gp.Torque(tau=6.0), gp.Inertia(J=1.0, start={"w": 0.0}), gp.Inertia(J=4.0)
        self.gears = [gp.IdealGear(ratio=2.0) for _ in range(2)]
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, *(gear.flange_a for gear in self.gears)),
            gl.connect(self.b.flange_a, *(gear.flange_b for gear in self.gears)),
        ]


def test_a_rigid_loop_moves_and_goes_into_an_fmu() -> None:
    system = given(lambda: gl.compile(Twice(), outputs=["a.w"]))
    assert given(lambda: system.simulate(2.0, samples=2))["a.w"][-1] == pytest.approx(6.0)
    assert given(lambda: exported_model(system.translation, None, None, None)).names == ("a.w",)


class Scaled(gl.Component):
    """A signal times a number, without any state."""

    u, y, k = gl.Input("1"), gl.Variable("1"), gl.Parameter("1", default=3.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.y, self.k * self.u)]


def test_the_response_of_a_transfer_function() -> None:
    found = given(lambda: gl.frequency_response(control.tf([2.0], [1.0, 1.0]), [1.0, 3.0]))
    assert found.values[0, 0] == pytest.approx([2 / (1 + 1j), 2 / (1 + 3j)], rel=1e-12)


@pytest.mark.parametrize("inputs", [[], ["u"]])
def test_the_linear_model_of_what_has_no_states(inputs: list[str]) -> None:
    model = given(lambda: gl.compile(Scaled()).linearize(inputs, ["y"], sparse=True))
    assert model.D.tolist() == [[3.0] * len(inputs)]
    assert given(lambda: model.changes(["k"]))[0].D.tolist() == [[1.0] * len(inputs)]
