"""What IDA is handed: the states alone, the tearing variables too, or the index-reduced equations as they are."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, SolverError
from gearlib.run.request import BACKENDS, FORMS
from gearlib.run.scene_form import scene_form
from gearparts.trains import zhou_cui_2022
from tests.run.test_constrained import CAR_AXIS, CarAxis, released, swing

Floats = NDArray[np.float64]
XP = gl.compile(gp.ZhouCui2022(tau_in=100.0))
T_END, TIMES = 0.02, np.linspace(0.0, 0.02, 201)


def explicit_form() -> dict[str, Floats]:
    """The bond graph's explicit state equations under the same torque, integrated by SciPy."""
    params = zhou_cui_2022.bond_parameters()

    def rhs(t: float, x: Floats) -> Floats:
        e = zhou_cui_2022.transmission_error_rate(t)
        return np.asarray(zhou_cui_2022.explicit_rhs(t, x, params, (100.0, e, e, e)), float)

    p2, q6, _, p26, q30, _, q74, p78 = solve_ivp(rhs, (0.0, T_END), np.zeros(8), "DOP853", TIMES, rtol=1e-12, atol=1e-15).y
    return {
        "w_in": p2 / params.I[2], "w_sun": p26 / params.I[26], "w_out": -p78 / params.I[78] / params.m[22],
        "q_ring": q6, "q_sun": q30, "q_pair": q74,
    }  # fmt: skip


@pytest.fixture(scope="module")
def reference() -> dict[str, Floats]:
    return explicit_form()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("form", FORMS)
def test_xp_train_follows_the_explicit_form_of_its_bond_graph(form: str, backend: str, reference: dict[str, Floats]) -> None:
    result = XP.simulate(T_END, times=TIMES, method="ida", rtol=1e-10, form=form, backend=backend)
    for name, expected in reference.items():
        assert np.abs(result[name] - expected).max() < 1e-7 * np.abs(expected).max(), name
    assert result.stats["form"] == form
    assert result.stats["unknowns"] == (91 if form == "dae" else 8)
    assert result.stats["backend"].startswith("scikit-sundae" if backend == "sksundae" else "native")


def test_every_unknown_that_ida_finds_is_what_elimination_gives() -> None:
    """The algebraic histories are IDA's own; those of the ODE form are computed from the states."""
    dae = XP.simulate(T_END, times=TIMES, method="ida", rtol=1e-10, form="dae")
    ode = XP.simulate(T_END, times=TIMES, method="exact")
    form = scene_form(XP.translation.scene, "dae")
    assert len(form.equations.algebraic) == 83
    compared = 0
    for name in form.state_names:
        if np.abs(ode[name]).max() > 1e-12:
            assert np.abs(dae[name] - ode[name]).max() < 2e-7 * np.abs(ode[name]).max(), name
            compared += int((dae[name] != ode[name]).any())
    assert compared > 60


def test_nothing_is_eliminated() -> None:
    """One residual for each unknown, from one equation each: no assignment, no block, no solution matrix."""
    equations = scene_form(XP.translation.scene, "dae").equations
    steps = equations.program.steps
    assert sorted(t for step in steps for t in step.targets.tolist()) == sorted(equations.program.residuals)
    assert not any(a in equations.program.residuals for step in steps for a in step.arguments.ravel().tolist())
    assert "residual" in scene_form(XP.translation.scene, "dae").native_with_jacobian.rhs.source


class FourBar(gl.Component):
    """A crank, a coupler without mass and a rocker on two bearings; a torque on the crank, a damper on the rocker."""

    a = gl.Variable("rad", "angle of the crank")
    b = gl.Variable("rad", "angle of the coupler", guess=0.4)
    c = gl.Variable("rad", "angle of the rocker", guess=1.2)
    wa = gl.Variable("rad/s", "speed of the crank")
    wc = gl.Variable("rad/s", "speed of the rocker")
    fx = gl.Variable("N", "force on the rocker")
    fy = gl.Variable("N", "force on the rocker")

    def equations(self) -> list[gl.Eq]:
        a, b, c = self.a, self.b, self.c
        return [
            gl.Eq(gl.der(a), self.wa),
            gl.Eq(gl.der(c), self.wc),
            gl.Eq(0.3 * gl.cos(a) + 1.0 * gl.cos(b), 0.9 + 0.8 * gl.cos(c)),
            gl.Eq(0.3 * gl.sin(a) + 1.0 * gl.sin(b), 0.8 * gl.sin(c)),
            gl.Eq(0.5 * gl.der(self.wa), 2.0 + 0.3 * (gl.sin(a) * self.fx - gl.cos(a) * self.fy)),
            gl.Eq(0.4 * gl.der(self.wc), -0.5 * self.wc + 0.8 * (gl.cos(c) * self.fy - gl.sin(c) * self.fx)),
            gl.Eq(gl.sin(b) * self.fx, gl.cos(b) * self.fy),  # along the coupler
        ]


@cache
def four_bar() -> tuple[gl.System, Floats]:
    """The system; the crank's angle and speed and the rocker's angle, from a triangle over the diagonal, by hand at 81 times."""

    def rocker(a: float) -> tuple[float, float]:
        x, y = 0.9 - 0.3 * np.cos(a), -0.3 * np.sin(a)  # from the crank's end to the rocker's bearing
        d = np.hypot(x, y)
        c = np.arctan2(y, x) + np.pi - np.arccos((d * d + 0.8**2 - 1.0) / (2 * 0.8 * d))
        return c, np.arctan2(y + 0.8 * np.sin(c), x + 0.8 * np.cos(c))

    def ratio(a: float) -> float:
        c, b = rocker(a)
        return 0.3 * np.sin(a - b) / (0.8 * np.sin(c - b))

    def rates(_: float, y: Floats) -> list[float]:
        i, h = ratio(y[0]), 1e-5
        slope = (8 * (ratio(y[0] + h) - ratio(y[0] - h)) - (ratio(y[0] + 2 * h) - ratio(y[0] - 2 * h))) / (12 * h)
        torque = 2.0 - 0.5 * i * i * y[1] - 0.4 * i * slope * y[1] ** 2
        return [y[1], torque / (0.5 + 0.4 * i * i)]

    found = solve_ivp(rates, (0.0, 2.0), [0.3, 0.0], "DOP853", np.linspace(0.0, 2.0, 81), rtol=1e-11, atol=1e-11).y
    system = gl.compile(FourBar(start={"a": 0.3, "wa": 0.0}))
    return system, np.array([found[0], found[1], [rocker(a)[0] for a in found[0]]])


@pytest.mark.parametrize("form", FORMS)
def test_four_bar(form: str) -> None:
    system, expected = four_bar()
    result = system.simulate(2.0, samples=81, method="ida", rtol=1e-9, form=form)
    for name, history in zip(("a", "wa", "c"), expected, strict=True):
        assert np.abs(result[name] - history).max() < 1e-6 * np.abs(history).max(), name


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("form", FORMS)
def test_pendulum_follows_the_elliptic_function(form: str, backend: str) -> None:
    """In Cartesian coordinates; the large swing changes its states on the way."""
    for angle in (0.7, 2.5) if backend == "native" or form == "dae" else (0.7,):
        result = released(angle).simulate(3.0, samples=61, method="ida", rtol=1e-9, form=form, backend=backend)
        phi = swing(angle, result.time)
        assert np.abs(result["x"] - np.sin(phi)).max() < 2e-6
        assert np.abs(result["y"] + np.cos(phi)).max() < 2e-6
        assert (result.stats.get("segments", 1) > 1) == (angle > 1.0)


@pytest.mark.parametrize("form", ["ode", "torn"])
def test_states_are_not_switched_through_sksundae(form: str) -> None:
    """They are singular at 0.522 s."""
    with pytest.raises(
        SolverError, match=r"\(x, u\) become singular after t = 0\.(4|5[01])\d* s.*backend='native', or form='dae'"
    ):
        released(2.5).simulate(3.0, samples=61, method="ida", rtol=1e-9, form=form, backend="sksundae")


@cache
def car_axis() -> gl.System:
    start = {"xl": 0.0, "yl": 0.5, "xr": 1.0, "yr": 0.5, "ul": -0.5, "vl": 0.0, "ur": -0.5, "vr": 0.0}
    return gl.compile(CarAxis(start=start))


@pytest.mark.parametrize("form", FORMS)
def test_car_axis(form: str) -> None:
    result = car_axis().simulate(3.0, times=[3.0], method="ida", rtol=1e-9, form=form)
    for name, value in CAR_AXIS.items():
        assert abs(result[name][-1] - value) <= 2e-6


class LossyLoop(gl.Component):
    """A planetary set whose carrier and ring are coupled by a pair of gears: a closed loop of power, with bearing friction and losses."""

    def assemble(self) -> list[gl.Connection]:
        self.torque = gp.Torque(tau=40 * gl.sin(9 * gl.time))
        self.sun, self.carrier, self.ring = gp.Inertia(J=0.05), gp.Inertia(J=0.4), gp.Inertia(J=0.3)
        self.planetary = gp.IdealPlanetary(ratio=2.5)
        self.pair = gp.LossyGear(ratio=-1.6, loss_table=[[0, 0.94, 0.91, 0.2, 0.2], [50, 0.95, 0.92, 0.4, 0.4]])
        self.shaft = gp.SpringDamper(c=2e3, d=2.0)
        self.bearing = gp.BearingFriction(tau_pos=[[0, 1.5], [40, 2.5]])
        self.drag, self.ground = gp.Damper(d=0.4), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.sun.flange_a),
            gl.connect(self.sun.flange_b, self.planetary.sun),
            gl.connect(self.planetary.carrier, self.carrier.flange_a),
            gl.connect(self.planetary.ring, self.ring.flange_a),
            gl.connect(self.carrier.flange_b, self.pair.flange_a),
            gl.connect(self.pair.flange_b, self.shaft.flange_a),
            gl.connect(self.shaft.flange_b, self.ring.flange_b),
            gl.connect(self.sun.flange_b, self.bearing.flange_a),
            gl.connect(self.carrier.flange_b, self.drag.flange_a),
            gl.connect(self.drag.flange_b, self.ground.flange),
        ]


@pytest.fixture(scope="module")
def lossy_loop() -> tuple[gl.System, Any]:
    system = gl.compile(LossyLoop())
    return system, system.simulate(1.5, samples=151, method="rk", rtol=1e-10)


@pytest.mark.parametrize("form", FORMS)
def test_friction_in_a_planetary_loop(form: str, lossy_loop: tuple[gl.System, Any]) -> None:
    system, expected = lossy_loop
    result = system.simulate(1.5, samples=151, method="ida", rtol=1e-8, form=form)
    assert len(expected.events) > 4
    for name in ("sun.w", "carrier.w", "ring.w", "shaft.phi_rel"):
        assert np.abs(result[name] - expected[name]).max() < 2e-6 * np.abs(expected[name]).max(), name


class Play(gl.Component):
    """A torque that shakes two bodies over a gap."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.play = gp.Torque(tau=3 * gl.sin(5 * gl.time)), gp.ElastoBacklash(c=1e3, d=1.0, b=0.02)
        self.a, self.b = gp.Inertia(J=0.3), gp.Inertia(J=0.5)
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.play.flange_a),
            gl.connect(self.play.flange_b, self.b.flange_a),
        ]


@pytest.mark.parametrize("form", ["torn", "dae"])
def test_backlash(form: str) -> None:
    """Event functions of algebraic unknowns, which are interpolated: each impact is found once."""
    system = gl.compile(Play())
    expected = system.simulate(0.6, samples=101, method="rk", rtol=1e-10)
    result = system.simulate(0.6, samples=101, method="ida", rtol=1e-9, form=form)
    for name in ("a.w", "b.w", "play.phi_rel"):
        assert np.abs(result[name] - expected[name]).max() < 1e-5 * np.abs(expected[name]).max(), name


class Driven(gl.Component):
    """A body whose torque is an input."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.body, self.drag, self.ground = gp.Torque(), gp.Inertia(J=2.0), gp.Damper(d=0.5), gp.Fixed()
        return [
            gl.connect(self.torque.flange, self.body.flange_a),
            gl.connect(self.body.flange_b, self.drag.flange_a),
            gl.connect(self.drag.flange_b, self.ground.flange),
        ]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("form", ["torn", "dae"])
def test_inputs_and_outputs_of_the_forms(form: str, backend: str) -> None:
    """A table, a function, a number; an output that the motion does not need is an unknown of the DAE."""
    system = gl.compile(Driven(), outputs=["body.w", "drag.loss_power"])
    for torque in (gl.Table([0.0, 1.0, 2.0], [0.0, 4.0, 0.0]), lambda t: 4.0 * np.sin(t), 3.0):
        expected = system.simulate(2.0, samples=21, method="rk", rtol=1e-10, inputs={"torque.tau": torque})
        result = system.simulate(
            2.0, samples=21, method="ida", rtol=1e-9, inputs={"torque.tau": torque}, form=form, backend=backend
        )
        for name in ("body.w", "drag.loss_power"):
            assert np.abs(result[name] - expected[name]).max() < 1e-6 * np.abs(expected[name]).max()
    going = system.simulate(3.0, samples=5, method="ida", rtol=1e-9, form=form, start=result)
    assert going["body.w"][-1] == pytest.approx(6.0 * (1.0 - np.exp(-0.75)), rel=1e-6)


def test_forms_and_backends_are_checked() -> None:
    system = gl.compile(Driven())
    given = {"torque.tau": 0.0}
    with pytest.raises(ArgumentError, match=r"there is no form 'da'.*dae"):
        system.simulate(1.0, method="ida", form="da", inputs=given)
    with pytest.raises(ArgumentError, match=r"there is no backend 'sundae'"):
        system.simulate(1.0, method="ida", backend="sundae", inputs=given)
    with pytest.raises(ArgumentError, match=r"form='dae' is a choice of method='ida'"):
        system.simulate(1.0, form="dae", inputs=given)
    with pytest.raises(ArgumentError, match=r"backend='sksundae' is a choice of method='ida'"):
        system.simulate(1.0, method="rk", backend="sksundae", inputs=given)
    with pytest.raises(ArgumentError, match=r"there is no form 3"):
        system.simulate(1.0, method="ida", form=3, inputs=given)  # type: ignore[arg-type]


def test_a_clutch_that_locks_in_a_form_where_it_cannot_names_the_one_where_it_can() -> None:
    class Locking(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.load = gp.Inertia(J=0.2, start={"w": 5.0}), gp.Inertia(J=0.3, start={"w": -5.0})
            self.clutch = gp.Clutch(fn_max=40.0, f_normalized=1.0)
            return [gl.connect(self.motor.flange_b, self.clutch.flange_a), gl.connect(self.clutch.flange_b, self.load.flange_a)]

    system = gl.compile(Locking(), outputs=["load.w"])
    with pytest.raises(SolverError, match=r"does not settle at t = 0\.06 s .* to and fro: clutch: .*; take form='ode'"):
        system.simulate(1.0, method="ida", form="dae")
    assert system.simulate(1.0, method="ida", form="ode")["load.w"][-1] == pytest.approx(-1.0)  # of the momentum


class Ratio(gl.Component):
    """A ratio of two unknowns, written as a product: at zero it determines neither."""

    x = gl.Variable("1", start=1.0)
    r, u = (gl.Variable("1") for _ in range(2))

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), -self.r), gl.Eq(self.r * self.u, self.x), gl.Eq(self.u, 1.0 + self.x)]


@pytest.mark.parametrize("form", FORMS)
def test_a_product_of_unknowns_begins_with_their_values(form: str) -> None:
    """Of x' = -x / (1 + x), ln(x) + x = 1 - t."""
    x = gl.simulate(Ratio(), 1.0, samples=5, method="ida", rtol=1e-9, form=form)["x"]
    assert np.log(x) + x == pytest.approx(1.0 - np.linspace(0.0, 1.0, 5), abs=1e-7)
