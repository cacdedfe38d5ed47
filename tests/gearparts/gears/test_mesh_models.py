"""Detailed meshes: tables over the mesh phase, sliding friction, meshes on a carrier, static deflection."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, BindingError, StartError
from gearparts.gears.mesh_phase import checked_period, contact_intervals, periodic, wrapped
from tests.gearparts.related import RelatedProbe

R_A, R_B, Z_A, C = 0.05, 0.1, 20, 1e7
STIFF = ((0.3, 0.8), (1.5, 1.1), (2.9, 1.3), (4.0, 1.0), (5.6, 0.8))
ERROR = ((0.0, 0.0), (1.0, 4e-6), (3.0, -2e-6), (5.0, -3e-6))


class Pair(gl.Component):
    """Two bodies joined by a mesh, on axes that a third body carries where the mesh has a support."""

    external = gl.Structural(True)
    options = gl.Structural((), "of the mesh, as pairs")

    def assemble(self) -> Any:
        kind = gp.DetailedExternalMesh if self.external else gp.DetailedInternalMesh
        given = {"r_a": R_A, "r_b": R_B, "z_a": float(Z_A), "c": C, "d": 0.0, **dict(self.options)}
        self.a, self.b = gp.Inertia(J=0.002, start={"w": 10.0}), gp.Inertia(J=0.01)
        self.mesh = kind(start={"q": 0.0}, **given)
        links = [gl.connect(self.a.flange_b, self.mesh.flange_a), gl.connect(self.mesh.flange_b, self.b.flange_a)]
        if given.get("use_support"):
            self.carrier = gp.Inertia(J=0.03)
            links.append(gl.connect(self.mesh.support, self.carrier.flange_a))
        return links


def pair(external: bool = True, **options: Any) -> Pair:
    return Pair(external=external, options=tuple(options.items()))


@pytest.mark.parametrize("external", [True, False])
def test_tables_over_the_mesh_phase_are_periodic_splines(external: bool) -> None:
    sense, t = (1 if external else -1), np.linspace(0.0, 0.05, 51)

    def spline(rows: Any) -> Any:
        return CubicSpline(
            [*(r[0] for r in rows), rows[0][0] + 2 * math.pi], [*(r[1] for r in rows), rows[0][1]], bc_type="periodic"
        )

    stiffness, error = spline(STIFF), spline(ERROR)
    slope = error.derivative()

    def rate(_: float, x: np.ndarray) -> list[float]:
        phase, f = Z_A * x[1] + 0.4, C * stiffness(Z_A * x[1] + 0.9) * x[0]
        v = R_A * x[2] + sense * R_B * x[3] + slope(phase) * Z_A * x[2]
        return [v, x[2], -R_A * f / 0.002, -sense * R_B * f / 0.01]

    expected = solve_ivp(rate, (0, 0.05), [0, 0, 10.0, 0], "DOP853", t, rtol=1e-10, atol=1e-13, max_step=2e-4).y
    model = pair(external, stiffness="table", stiffness_table=STIFF, error_table=ERROR, phase0=0.4, c_phase=0.5)
    system = gl.compile(model, outputs=["mesh.q", "a.w", "b.w", "mesh.e"])
    result = system.simulate(0.05, times=t, method="rk", rtol=1e-9)
    for name, k in (("mesh.q", 0), ("a.w", 2), ("b.w", 3)):
        assert result[name] == pytest.approx(expected[k], abs=1e-6 * np.abs(expected[k]).max())
    assert result["mesh.e"] == pytest.approx(error(0.4 + Z_A * expected[1]), abs=1e-11)


@pytest.mark.parametrize("rows", [((0.0, 1.0), (1.0, 2.0)), ((0.0, 1.0), (3.0, 2.0), (6.3, 1.0))])
def test_a_wrong_table_over_the_phase_is_named(rows: Any) -> None:
    said = f"stiffness_table has {len(rows)} rows from 0 to {rows[-1][0]:g} rad; expected three or more within less than one period"
    with pytest.raises(BindingError, match=rf"DetailedExternalMesh\.{re.escape(said)}"):
        gl.compile(pair(stiffness="table", stiffness_table=rows))


@pytest.mark.parametrize("contact_ratio", [1, 1.25, 1.75, 2.0, 2.6, 7.5, 100])
def test_intervals_of_contact_divide_the_period_by_the_contact_ratio(contact_ratio: float) -> None:
    intervals = contact_intervals("Mesh", contact_ratio)
    assert len(intervals) == 2
    assert [intervals[0].start, intervals[0].end, intervals[1].end] == [0.0, intervals[1].start, 1.0]
    assert [s.pairs for s in intervals] == [math.ceil(contact_ratio), math.floor(contact_ratio)]
    assert sum(s.pairs * (s.end - s.start) for s in intervals) == pytest.approx(contact_ratio, rel=1e-14)
    for first in (True, False):
        for share in np.linspace(0.01, 0.99, 5):
            mid = intervals[0].end * share if first else intervals[0].end + (1 - intervals[0].end) * share
            assert [bool(s.within(2 * np.pi * (mid + 3))) for s in intervals] == [first, not first]


@pytest.mark.parametrize("contact_ratio", [0.999, 100.001, 0, math.nan])
def test_a_contact_ratio_of_less_than_one_pair_is_refused(contact_ratio: float) -> None:
    with pytest.raises(BindingError, match=rf"Mesh\.contact_ratio is {contact_ratio:g}.*; expected a number from 1 to 100"):
        contact_intervals("Mesh", contact_ratio)


def test_a_table_over_the_phase_has_three_rows_within_less_than_a_period() -> None:
    almost = ((1.0, 0.5), (2.0, 1.0), (1.0 + 2 * math.pi - 1e-9, 0.6))
    assert checked_period("Mesh.table", almost) == almost
    for rows in (almost[:2], (*almost[:2], (1.0 + 2 * math.pi, 0.6))):
        with pytest.raises(
            BindingError, match=rf"Mesh\.table has {len(rows)} rows from 1 to .* rad; expected three or more within"
        ):
            checked_period("Mesh.table", rows)


@pytest.mark.parametrize("rows", [STIFF, ERROR, ((-2.0, 1.0), (0.5, 3.0), (4.0, 2.0))])
def test_a_periodic_table_is_the_spline_with_its_slope(rows: Any) -> None:
    """For any phase, which is brought into the period of the table first; the slope is continuous from period to period."""
    curve = CubicSpline(
        [*(r[0] for r in rows), rows[0][0] + 2 * math.pi], [*(r[1] for r in rows), rows[0][1]], bc_type="periodic"
    )
    x = sympy.Symbol("x", real=True)
    value, slope = (law.args[0] for law in periodic(rows, x))
    for phase in np.linspace(-9.1, 8.9, 19):
        inside = float(wrapped(float(phase), rows[0][0] + math.pi))
        assert rows[0][0] <= inside <= rows[0][0] + 2 * math.pi
        assert math.remainder(inside - phase, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)
        assert float(value.subs(x, inside)) == pytest.approx(float(curve(phase)), rel=1e-10, abs=1e-18)
        assert float(slope.subs(x, inside)) == pytest.approx(float(curve(phase, 1)), rel=1e-9, abs=1e-17)


PATTERNS: list[dict[str, Any]] = [
    {"stiffness": "sinusoidal", "c_amplitude": 0.3, "c_phase": 0.7},
    {"stiffness": "fourier", "stiffness_terms": ((1.0, 0.2, 0.3), (2.0, 0.1, -0.5))},
    {"stiffness": "rectangular", "contact_ratio": 1.625},
    {"stiffness": "rectangular", "contact_ratio": 2.0},
]


@pytest.mark.parametrize("options", PATTERNS)
def test_the_mean_stiffness_is_c(options: dict[str, Any]) -> None:
    p = RelatedProbe(pair(**options))
    phases = 2 * np.pi * (np.arange(800) + 0.5) / 800
    values = [p.values({"mesh.turned": x})("mesh.c_now") for x in phases] if "mesh.turned" in p.states else [C]
    assert np.mean(values) == pytest.approx(C, rel=1e-12)
    assert np.ptp(values) > 0.1 * C or options.get("contact_ratio") == 2.0


class Pressed(gl.Component):
    """A torque presses a gear against one that is held."""

    b = gl.Parameter("m", "gap", default=0.0)
    tau = gl.Parameter("N.m", "torque", default=50.0)

    def assemble(self) -> Any:
        self.torque, self.a, self.ground = gp.Torque(tau=self.tau), gp.Inertia(J=1e-3), gp.Fixed()
        self.mesh = gp.DetailedExternalMesh(r_a=R_A, r_b=R_B, c=C, d=2e4, b=self.b, backlash=True, start={"q": 0.0})
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.mesh.flange_a),
            gl.connect(self.mesh.flange_b, self.ground.flange),
        ]


@pytest.mark.parametrize(
    ("b", "tau", "expected", "contact"),
    [
        (0.0, 50.0, 1000 / C, 1),
        (2e-4, 50.0, 1e-4 + 1000 / C, 1),
        (2e-4, -50.0, -1e-4 - 1000 / C, -1),
        (2e-4, 0.0, 0.0, 0),
        (-2e-4, 50.0, 1000 / (2 * C), 2),  # both flanks in contact: twice as stiff
        (-5e-5, 50.0, 1000 / C - 2.5e-5, 1),  # the coast flank has lifted
    ],
)
def test_static_deflection_with_gap_and_with_preload(
    pressed: gl.System, b: float, tau: float, expected: float, contact: int
) -> None:
    result = pressed.simulate(0.2, samples=3, parameters={"b": b, "tau": tau}, rtol=1e-10)
    assert result["mesh.q"][-1] == pytest.approx(expected, rel=1e-7)
    assert result["mesh.contact"][-1] == contact


@pytest.fixture(scope="module")
def pressed() -> gl.System:
    return gl.compile(Pressed(), outputs=["mesh.q", "mesh.contact"])


FRICTION = {"friction": True, "mu": 0.06, "alpha": 0.4, "approach": 0.9, "contact_ratio": 1.6, "phase0": 0.3}


def friction_by_hand(external: bool, phase: float, f: float, w_a: float, w_b: float, v_smooth: float) -> tuple[float, float]:
    """Torques on both gears, one pair of teeth after the other."""
    pitch, sense = 2 * math.pi * R_A / Z_A, 1 if external else -1
    come = phase / (2 * math.pi) % 1.0
    places = [come + k for k in range(2) if come + k < 1.6]
    on_a = on_b = 0.0
    for place in places:
        x_a = R_A * math.tan(0.4) + sense * pitch * (place - 0.9)
        x_b = R_B * math.tan(0.4) - pitch * (place - 0.9)
        force = 0.06 * abs(f) / len(places) * math.tanh((x_a * w_a + sense * x_b * w_b) / v_smooth)
        on_a, on_b = on_a + force * x_a, on_b + sense * force * x_b
    return on_a, on_b


@pytest.mark.parametrize("external", [True, False])
def test_friction_of_each_pair_and_energy(external: bool) -> None:
    p, rng = RelatedProbe(pair(external, **FRICTION, v_smooth=0.3, use_support=True, d=40.0)), np.random.default_rng(1)
    for _ in range(40):
        states = {s: rng.normal() * (1e-6 if s.endswith(".q") else 3.0) for s in p.states}
        value = p.values(states)
        w_a, w_b = states["a.w"] - states["carrier.w"], states["b.w"] - states["carrier.w"]
        torques = friction_by_hand(external, 0.3 + states["mesh.turned"], value("mesh.f"), w_a, w_b, 0.3)
        assert value("mesh.tau_friction_a") == pytest.approx(torques[0], rel=1e-9)
        assert value("mesh.tau_friction_b") == pytest.approx(torques[1], rel=1e-9)
        rubbing = torques[0] * w_a + torques[1] * w_b
        assert rubbing >= 0
        assert value("mesh.loss_power") == pytest.approx(rubbing + 40.0 * value("mesh.v") ** 2, rel=1e-9)
        kinetic = sum(J * states[f"{n}.w"] * value(f"der({n}.w)") for n, J in (("a", 0.002), ("b", 0.01), ("carrier", 0.03)))
        stored = C * states["mesh.q"] * value("mesh.v")
        assert kinetic + stored + value("mesh.loss_power") == pytest.approx(0.0, abs=1e-9 * (abs(kinetic) + abs(stored)))


def test_friction_changes_its_sign_at_the_pitch_point() -> None:
    p = RelatedProbe(pair(**{**FRICTION, "contact_ratio": 1.0, "approach": 0.5, "phase0": 0.0}, v_smooth=1e-6))
    rolling = {"a.w": 30.0, "b.w": -15.0, "mesh.q": 1e-5}
    torque = [p.values({**rolling, "mesh.turned": 2 * np.pi * x})("mesh.tau_friction_a") for x in (0.01, 0.49, 0.51, 0.99)]
    force = 0.06 * C * 1e-5
    arms = [R_A * (math.tan(0.4) + 2 * math.pi / Z_A * (x - 0.5)) for x in (0.01, 0.49, 0.51, 0.99)]
    assert torque == pytest.approx([-force * arms[0], -force * arms[1], force * arms[2], force * arms[3]], rel=1e-9)


@pytest.mark.parametrize("external", [True, False])
def test_mean_loss_is_that_of_the_loss_factor(external: bool) -> None:
    geometry = gp.GearPair(20, 40, m_n=5e-3, width=0.03, x_1=0.3, internal=not external)
    shares = geometry.mesh_values()
    r_a, r_b = shares["r_a"], shares["r_b"]
    options = {**FRICTION, **shares, "c": C, "phase0": 0.0}
    p = RelatedProbe(pair(external, **options, v_smooth=1e-9))
    w_a, w_b = 30.0, (-1 if external else 1) * 30.0 * r_a / r_b
    corners = sorted({0.0, 1.0, geometry.contact_ratio % 1, shares["approach"] % 1})  # the loss is linear between
    loss = 0.0
    for left, right in zip(corners, corners[1:], strict=False):
        value = p.values({"a.w": w_a, "b.w": w_b, "mesh.q": 1e-5, "mesh.turned": np.pi * (left + right)})
        loss += (right - left) * value("mesh.loss_power")
    power = C * 1e-5 * r_a * w_a
    assert loss / power == pytest.approx(0.06 * geometry.loss_factor, rel=1e-9)
    assert geometry.efficiency(0.06) == 1 - 0.06 * geometry.loss_factor


def test_a_pair_with_friction_slows_down_as_by_hand() -> None:
    t = np.linspace(0.0, 0.06, 31)

    def rate(_: float, x: np.ndarray) -> list[float]:
        v = R_A * x[2] + R_B * x[3]
        f = C * x[0] + 1000.0 * v
        on_a, on_b = friction_by_hand(True, 0.3 + Z_A * x[1], f, x[2], x[3], 0.5)
        return [v, x[2], (-R_A * f - on_a) / 0.002, (-R_B * f - on_b) / 0.01]

    expected = solve_ivp(rate, (0, 0.06), [0, 0, 10.0, 0], "DOP853", t, rtol=1e-8, atol=1e-12, max_step=5e-5).y
    system = gl.compile(pair(**FRICTION, v_smooth=0.5, d=1000.0), outputs=["a.w", "b.w"])
    for method in ("rk", "ida"):
        result = system.simulate(0.06, times=t, method=method, rtol=1e-8)
        assert result["a.w"] == pytest.approx(expected[2], abs=1e-5)
        assert result["b.w"] == pytest.approx(expected[3], abs=1e-5)


def test_a_mesh_on_a_carrier_moves_as_a_planet_s() -> None:
    value = RelatedProbe(pair(use_support=True)).values({"a.w": 3.0, "b.w": 2.0, "carrier.w": 0.7, "mesh.q": 1e-5})
    assert value("mesh.v") == pytest.approx(R_A * 2.3 + R_B * 1.3, rel=1e-14)
    assert 0.03 * value("der(carrier.w)") == pytest.approx((R_A + R_B) * C * 1e-5, rel=1e-13)


@pytest.mark.parametrize("kind", [gp.DetailedExternalMesh, gp.DetailedInternalMesh])
def test_friction_beyond_the_tangent_points_is_refused_with_the_teeth_that_make_it(kind: Any) -> None:
    """The base pitch is 2 pi r_a / z_a: with one tooth, a turn. Pairs touch between the tangent points of the line of action."""

    class Pair(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.drive, self.a, self.b = gp.Torque(), gp.Inertia(J=0.01), gp.Inertia(J=0.1)
            self.mesh = kind(r_a=0.1, r_b=0.05, c=1e8, d=500.0, friction=True)
            return [
                gl.connect(self.drive.flange, self.a.flange_a),
                gl.connect(self.a.flange_b, self.mesh.flange_a),
                gl.connect(self.mesh.flange_b, self.b.flange_a),
            ]

    system, z_a, half = gl.compile(Pair(), outputs=["b.w"]), 80.0, 0.75
    result = system.simulate(1e-4, samples=2, inputs={"drive.tau": 10.0}, parameters={"mesh.z_a": z_a})
    pitch, inward = 2 * np.pi * 0.1 / z_a, np.tan(np.pi / 9)
    side = 1 if kind is gp.DetailedExternalMesh else -1
    assert result["mesh.from_tangent_a"] == pytest.approx(0.1 * inward - side * half * pitch)
    assert result["mesh.to_tangent_b"] == pytest.approx(0.05 * inward - half * pitch)
    with pytest.raises(
        StartError, match=r"mesh\.(from_tangent_a|to_tangent_b) is -0.* m \(friction: way from .* cannot be below 0"
    ):
        system.simulate(1e-4, samples=2, inputs={"drive.tau": 10.0})
    with pytest.raises(ArgumentError, match=r"mesh\.(from_tangent_a|to_tangent_b) is -0.* cannot be below 0"):
        gl.power_flow(system, speeds={"a.w": 10.0})
