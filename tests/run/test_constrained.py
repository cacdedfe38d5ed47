"""Index-3 systems outside gears: the car axis, pendulums in Cartesian coordinates, and four bars."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from scipy.special import ellipj

import gearlib as gl
import gearparts as gp
from gearlib.errors import SolverError


class CarAxis(gl.Component):
    """The car axis on a bumpy road.

    F. Mazzia, C. Magherini, Test Set for Initial Value Problem Solvers, release 2.4 (2008).
    """

    eps = gl.Parameter("1", "square root of mass over stiffness", default=0.01)
    M = gl.Parameter("1", "mass", default=10.0)
    L = gl.Parameter("1", "length of the axis", default=1.0)
    L0 = gl.Parameter("1", "unstretched length of the springs", default=0.5)
    r = gl.Parameter("1", "amplitude of the road", default=0.1)
    omega = gl.Parameter("rad/s", "frequency of the road", default=10.0)
    g = gl.Parameter("1", "gravity", default=1.0)
    xl = gl.Variable("1", "left end")
    yl = gl.Variable("1", "left end")
    xr = gl.Variable("1", "right end")
    yr = gl.Variable("1", "right end")
    ul = gl.Variable("1", "left end")
    vl = gl.Variable("1", "left end")
    ur = gl.Variable("1", "right end")
    vr = gl.Variable("1", "right end")
    lam1 = gl.Variable("1", "multiplier")
    lam2 = gl.Variable("1", "multiplier")

    def equations(self) -> list[gl.Eq]:
        xl, yl, xr, yr, lam1, lam2 = self.xl, self.yl, self.xr, self.yr, self.lam1, self.lam2
        yb = self.r * gl.sin(self.omega * gl.time)
        xb = gl.sqrt(self.L**2 - yb**2)
        left, right = gl.sqrt(xl**2 + yl**2), gl.sqrt((xr - xb) ** 2 + (yr - yb) ** 2)
        k = self.M * self.eps**2 / 2
        pull_l, pull_r = (self.L0 - left) / left, (self.L0 - right) / right
        return [
            gl.Eq(gl.der(xl), self.ul),
            gl.Eq(gl.der(yl), self.vl),
            gl.Eq(gl.der(xr), self.ur),
            gl.Eq(gl.der(yr), self.vr),
            gl.Eq(k * gl.der(self.ul), pull_l * xl + lam1 * xb + 2 * lam2 * (xl - xr)),
            gl.Eq(k * gl.der(self.vl), pull_l * yl + lam1 * yb + 2 * lam2 * (yl - yr) - k * self.g),
            gl.Eq(k * gl.der(self.ur), pull_r * (xr - xb) - 2 * lam2 * (xl - xr)),
            gl.Eq(k * gl.der(self.vr), pull_r * (yr - yb) - 2 * lam2 * (yl - yr) - k * self.g),
            gl.Eq(xl * xb + yl * yb, 0),
            gl.Eq((xl - xr) ** 2 + (yl - yr) ** 2, self.L**2),
        ]


# The test set's reference solution at t = 3 (GAMD, quadruple precision).
CAR_AXIS = {
    "xl": 0.493455784275402809122e-1, "yl": 0.496989460230171153861, "xr": 0.104174252488542151681e1,
    "yr": 0.373911027265361256927, "ul": -0.770583684040972357970e-1, "vl": 0.744686658723778553466e-2,
    "ur": 0.175568157537232222276e-1, "vr": 0.770341043779251976443, "lam1": -0.473688659084893324729e-2,
    "lam2": -0.110468033125734368808e-2,
}  # fmt: skip


@pytest.mark.parametrize("method", ["ida", "rk"])
def test_car_axis(method: str) -> None:
    start = {"xl": 0.0, "yl": 0.5, "xr": 1.0, "yr": 0.5, "ul": -0.5, "vl": 0.0, "ur": -0.5, "vr": 0.0}
    system = gl.compile(CarAxis(start=start))
    assert len(system.states) == 4
    assert "structural index 3" in system.summary()
    result = system.simulate(3.0, times=[0.0, 1.5, 3.0], method=method, rtol=1e-10)
    for name, value in CAR_AXIS.items():
        assert abs(result[name][-1] - value) <= 1e-7
    for name, value in start.items():
        assert result[name][0] == pytest.approx(value, abs=1e-12)


class Pendulum(gl.Component):
    """A point mass on a rod, in Cartesian coordinates."""

    L = gl.Parameter("m", "length", default=1.0)
    g = gl.Parameter("m/s2", "gravity", default=9.81)
    x = gl.Variable("m", "horizontal")
    y = gl.Variable("m", "vertical")
    u = gl.Variable("m/s", "horizontal speed")
    v = gl.Variable("m/s", "vertical speed")
    T = gl.Variable("1/s2", "rod force over mass and length")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.u),
            gl.Eq(gl.der(self.y), self.v),
            gl.Eq(gl.der(self.u), self.T * self.x),
            gl.Eq(gl.der(self.v), self.T * self.y - self.g),
            gl.Eq(self.x**2 + self.y**2, self.L**2),
        ]


@cache
def released(angle: float, speed: float = 0.0) -> gl.System:
    place = {"x": np.sin(angle), "y": -np.cos(angle)}
    return gl.compile(Pendulum(start=place | {"u": np.cos(angle) * speed, "v": np.sin(angle) * speed}))


def swing(angle: float, t: Any) -> Any:
    """Angle at time t of a pendulum of length 1 released from rest: sin(phi/2) = k cd(sqrt(g) t, k)."""
    k = np.sin(angle / 2)
    _, cn, dn, _ = ellipj(np.sqrt(9.81) * t, k**2)
    return 2 * np.arcsin(k * cn / dn)


@pytest.mark.parametrize("method", ["ida", "rk5", "rk8", "auto"])
@pytest.mark.parametrize("angle", [0.2, 0.7])
def test_small_swings_follow_the_elliptic_function(method: str, angle: float) -> None:
    system = released(angle)
    assert set(system.states) == {"x", "u"}
    result = system.simulate(5.0, samples=101, method=method, rtol=1e-9)
    phi = swing(angle, result.time)
    assert np.abs(result["x"] - np.sin(phi)).max() < 5e-8
    assert np.abs(result["y"] + np.cos(phi)).max() < 5e-8
    assert np.abs(result["x"] ** 2 + result["y"] ** 2 - 1).max() < 1e-14
    energy = (result["u"] ** 2 + result["v"] ** 2) / 2 + 9.81 * result["y"]
    assert np.ptp(energy) < 1e-6


def test_inputs_of_a_run_are_those_of_the_constraint() -> None:
    """The rod's length is a parameter of the run: the start then contradicts the constraint."""
    with pytest.raises(gl.GearlibError, match="start values contradict each other"):
        released(0.3).simulate(1.0, samples=3, parameters={"L": 2.0})


@cache
def pendulum_by_hand(angle: float, speed: float) -> Any:
    """Angles and speeds at 41 times up to 4 s."""
    tight = {"rtol": 1e-12, "atol": 1e-12, "method": "DOP853", "t_eval": np.linspace(0, 4.0, 41)}
    return solve_ivp(lambda t, z: [z[1], -9.81 * np.sin(z[0])], (0, 4.0), [angle, speed], **tight).y


@pytest.mark.parametrize(("angle", "speed"), [(1.5, 0.0), (1.7, 0.0), (3.0, 0.1), (0.3, 9.0)])
@pytest.mark.parametrize("method", ["ida", "rk", "auto"])
def test_swings_change_their_states_on_the_way(method: str, angle: float, speed: float) -> None:
    times, (phi, w) = np.linspace(0, 4.0, 41), pendulum_by_hand(angle, speed)
    result = released(angle, speed).simulate(4.0, times=times, method=method, rtol=1e-9)
    assert result.stats["segments"] >= 4
    assert result.time == pytest.approx(times, rel=0)
    assert np.abs(result["x"] - np.sin(phi)).max() < 2e-6
    assert np.abs(result["y"] + np.cos(phi)).max() < 2e-6
    assert np.abs(result["der(x)"] - np.cos(phi) * w).max() < 1e-5
    assert np.abs(result["x"] ** 2 + result["y"] ** 2 - 1).max() < 1e-13
    assert result.states.shape == (41, 2)


@pytest.mark.parametrize("place", ["x", "y"])
@pytest.mark.parametrize("speed", ["u", "v"])
@pytest.mark.parametrize("method", ["ida", "rk5", "rk8", "auto"])
def test_whichever_coordinates_a_swing_begins_with(place: str, speed: str, method: str) -> None:
    """The other speed is a quotient, whose divisor and numerator vanish together where it has lost its digits."""
    preferred = {place: gl.Variable("m", state="prefer"), speed: gl.Variable("m/s", state="prefer")}
    kind = type("Preferring", (Pendulum,), preferred)
    for angle in (0.9, 1.7, 2.5):
        system = gl.compile(kind(start={"x": np.sin(angle), "y": -np.cos(angle), "u": 0.0, "v": 0.0}))
        assert set(system.states) == {place, speed}
        result = system.simulate(2.0, method=method, rtol=1e-9)
        phi = swing(angle, result.time)
        assert np.hypot(result["x"] - np.sin(phi), result["y"] + np.cos(phi)).max() < 2e-7


BARS, BASE, INERTIAS = np.array([1.0, 3.0, -3.0]), 3.5, np.array([1.0, 2.0, 3.0])


def four_bars_by_hand(angles: Any, w: float, times: Any) -> Any:
    """Angles of crank, coupler and rocker: the equations of motion with both multipliers, from a speed of the crank."""

    def slopes(q: Any) -> Any:
        return BARS * [-np.sin(q), np.cos(q)]

    def rates(_: float, z: Any) -> Any:
        q, speeds = np.split(z, 2)
        matrix = np.block([[np.diag(INERTIAS), -slopes(q).T], [slopes(q), np.zeros((2, 2))]])
        bend = BARS * [-np.cos(q), -np.sin(q)] @ speeds**2
        return np.concatenate([speeds, np.linalg.solve(matrix, np.concatenate([np.zeros(3), -bend]))[:3]])

    others = np.linalg.solve(slopes(angles)[:, 1:], -w * slopes(angles)[:, 0])
    tight = {"rtol": 1e-12, "atol": 1e-12, "method": "DOP853", "t_eval": times}
    return solve_ivp(rates, (0, times[-1]), [*angles, w, *others], **tight).y[:3]


@pytest.mark.parametrize("speed", [0, 1, 2])
def test_four_bars_turn_whichever_speed_is_a_state(speed: int) -> None:
    """Coupler and rocker come to rest on the way, where their speeds do not tell that of the crank."""

    class FourBars(gl.Component):
        a, b, c = (gl.Variable("1", state="prefer" if k == 0 else "default") for k in range(3))
        u, v, w = (gl.Variable("1/s", state="prefer" if k == speed else "default") for k in range(3))
        along, across = gl.Variable("1/s2"), gl.Variable("1/s2")

        def equations(self) -> list[gl.Eq]:
            angles, speeds = (self.a, self.b, self.c), (self.u, self.v, self.w)
            bars = list(zip(BARS.tolist(), INERTIAS.tolist(), angles, speeds, strict=True))
            return [
                *(gl.Eq(gl.der(angle), rate) for _, _, angle, rate in bars),
                *(gl.Eq(J * gl.der(w), L * (gl.cos(q) * self.across - gl.sin(q) * self.along)) for L, J, q, w in bars),
                gl.Eq(sum(L * gl.cos(q) for L, _, q, _ in bars), BASE),
                gl.Eq(sum(L * gl.sin(q) for L, _, q, _ in bars), 0.0),
            ]

    others = fsolve(lambda z: [BARS @ np.cos([0.7, *z]) - BASE, BARS @ np.sin([0.7, *z])], [0.8, 1.5], xtol=1e-14)
    system = gl.compile(FourBars(start={"a": 0.7, "u": 5.0}, guess={"b": others[0], "c": others[1]}))
    assert set(system.states) == {"a", "uvw"[speed]}
    times = np.linspace(0.0, 3.0, 61)
    right = four_bars_by_hand(np.array([0.7, *others]), 5.0, times)
    for method in ("ida", "rk5", "auto"):
        result = system.simulate(3.0, times=times, method=method, rtol=1e-9)
        assert np.abs([result["a"], result["b"], result["c"]] - right).max() < 1e-6, method


@pytest.mark.parametrize("method", ["ida", "rk"])
def test_the_statistics_are_those_of_all_parts(method: str) -> None:
    """Most steps are taken after the first change of states: a run up to a later time has more of them, and both have parts."""
    halfway, whole = (released(0.3, 9.0).simulate(t, samples=2, method=method, rtol=1e-9) for t in (2.0, 4.0))
    assert 1 < halfway.stats["segments"] < whole.stats["segments"]
    for count in ("steps", "rhs", "work"):
        assert whole.stats[count] > 1.5 * halfway.stats[count] > 0


def test_an_interrupt_after_a_change_of_states_is_told_by_the_whole_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.progress.APART", 0.0)  # every report is made, and none is far from the next
    monkeypatch.setattr("gearlib.solvers.drive.driver.STEPS_PER_CALL", 20)

    def tell(done: float, _: float) -> None:
        if done > 0.6:
            raise KeyboardInterrupt

    options: dict[str, Any] = {"samples": 41, "method": "rk", "rtol": 1e-9}
    with pytest.warns(gl.GearlibWarning, match=r"interrupted at t = 2\.\d+ s"):
        part = released(0.3, 9.0).simulate(4.0, progress=tell, on_interrupt="stop", **options)
    assert part.stats["segments"] >= 4
    assert "interrupted" in part.stats
    assert part.time[-1] <= part.stats["interrupted"] < part.time[-1] + 0.1
    assert part.request.times.tolist() == part.time.tolist()  # what it is repeated for ends there, too


class Slider(gl.Component):
    """A mass that is led along y = x**3 / 3 - x; x is a state everywhere, y between the turning points only.

    The guide is written so that it is linear in neither, and what is declared decides.
    """

    x = gl.Variable("1", "along")
    y = gl.Variable("1", "across", state="prefer")
    u = gl.Variable("1", "speed along")
    v = gl.Variable("1", "speed across", state="prefer")
    F = gl.Variable("1", "force of the guide")

    def equations(self) -> list[gl.Eq]:
        guide = self.x**3 / 3 - self.x
        return [
            gl.Eq(gl.der(self.x), self.u),
            gl.Eq(gl.der(self.y), self.v),
            gl.Eq(gl.der(self.u), -self.F * (self.x**2 - 1) + 1.0),
            gl.Eq(gl.der(self.v), self.F),
            gl.Eq(self.y + self.y**3, guide + guide**3),
        ]


def test_preferred_states_give_way_where_they_must() -> None:
    system = gl.compile(Slider(start={"x": -2.0, "u": 0.5}))
    assert set(system.states) == {"y", "v"}

    def along(t: float, z: Any) -> list[float]:
        slope, bend = z[0] ** 2 - 1, 2 * z[0]
        return [z[1], (1.0 - slope * bend * z[1] ** 2) / (1 + slope**2)]

    times = np.linspace(0, 3.0, 31)
    exact = solve_ivp(along, (0, 3.0), [-2.0, 0.5], rtol=1e-12, atol=1e-12, method="DOP853", t_eval=times).y
    assert exact[0].max() > 1.5  # through both turning points
    for method in ("rk", "ida"):
        result = system.simulate(3.0, times=times, method=method, rtol=1e-9)
        assert np.abs(result["x"] - exact[0]).max() < 1e-6
        assert np.abs(result["u"] - exact[1]).max() < 1e-6


class Wedge(gl.Component):
    """x is the root of y until y = 0 leaves none."""

    x = gl.Variable("1", "root", guess=1.0)
    y = gl.Variable("1", "falls", start=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.y), -self.x - 0.5), gl.Eq(self.x**2, self.y)]


@pytest.mark.parametrize("method", ["ida", "rk"])
def test_where_equations_lose_their_solution_the_run_is_refused(method: str) -> None:
    system = gl.compile(Wedge())
    root = solve_ivp(lambda t, x: (-x - 0.5) / (2 * x), (0, 0.8), [1.0], rtol=1e-12, atol=1e-12).y[0, -1]
    assert system.simulate(0.8, samples=3, method=method, rtol=1e-9)["x"][-1] == pytest.approx(root, rel=1e-7)
    with pytest.raises(SolverError, match=r"at t ?= ?0\.9.*nonlinear equations of Wedge"):  # y = 0 at 2 + ln(1/3)
        system.simulate(1.5, samples=3, method=method)


class Cam(gl.Component):
    """A cam that is flat at both ends of its stroke."""

    shaft = gp.Flange("cam")
    follower = gp.TranslationalFlange("follower")
    h = gl.Parameter("m", "stroke", default=0.01)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.follower.s, self.h * (1 - gl.cos(self.shaft.phi)) / 2),
            gl.Eq(self.shaft.tau, -self.follower.f * self.h * gl.sin(self.shaft.phi) / 2),
        ]


class CamDrive(gl.Component):
    """A wheel drives a mass up and down against a spring."""

    def assemble(self) -> list[Any]:
        self.wheel, self.cam = gp.Inertia(J=0.001, start={"w": 30.0, "phi": 0.1}), Cam()
        self.mass, self.spring, self.wall = gp.Mass(m=4.0), gp.TranslationalSpring(c=3000.0), gp.TranslationalFixed()
        return [
            gl.connect(self.wheel.flange_b, self.cam.shaft),
            gl.connect(self.cam.follower, self.mass.flange_a),
            gl.connect(self.mass.flange_b, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.wall.flange),
        ]


@pytest.mark.parametrize("method", ["rk8", "ida"])
def test_the_angle_of_a_cam_is_a_state(method: str) -> None:
    """The deflection of a spring is preferred as a state, but where the cam is flat no angle follows from that of its follower."""
    system = gl.compile(CamDrive(), outputs=["mass.s", "wheel.w"])
    assert set(system.states) == {"wheel.phi", "wheel.w"}
    run = system.simulate(2.0, samples=41, method=method, rtol=1e-9)

    def lift(angle: Any) -> Any:
        return 0.005 * (1 - np.cos(angle))

    def speed(angle: Any) -> Any:
        inertia, start = (0.001 + 4.0 * (0.005 * np.sin(phi)) ** 2 for phi in (angle, 0.1))
        return np.sqrt((start * 30.0**2 + 3000.0 * (lift(0.1) ** 2 - lift(angle) ** 2)) / inertia)

    angle = solve_ivp(lambda t, y: speed(y), (0, 2), [0.1], "DOP853", run.time, rtol=1e-12, atol=1e-12).y[0]
    assert abs(run["wheel.w"] - speed(angle)).max() < 1e-6 * 30
    assert abs(run["mass.s"] - lift(angle)).max() < 1e-6 * 0.01
