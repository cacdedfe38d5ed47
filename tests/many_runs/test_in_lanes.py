"""Sweeps whose runs are integrated side by side: the runs of `simulate` within the tolerance, one by one where lanes do not fit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from scipy.special import erf

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, BoundError, GearlibWarning
from gearlib.many_runs.by_exponentials import ExactSweep, why_not_by_exponentials
from gearlib.many_runs.in_lanes import LEAST_STEPS, MOST_CORNERS, MOST_OF_LINEAR, PATIENCE, most_steps, why_not_in_lanes
from gearlib.many_runs.side_by_side import why_one_by_one
from gearlib.run.methods.run import LATE
from gearlib.run.simulate import checked_request
from gearlib.solvers.lanes.lanes import LaneRuns
from tests.many_runs.models import Drive, Rattle, peak

J = np.linspace(0.5, 4.0, 11)
TORQUE = {"torque.tau": 3.0}
OPTIONS: dict[str, Any] = {"samples": 21, "method": "rk5", "rtol": 1e-7, "inputs": TORQUE}


class Pendulum(gl.Component):
    """Two coupled pendulums with a regularised friction, driven by time: nothing linear, sines, branches, a quotient."""

    g = gl.Parameter("1", default=20.0)
    b = gl.Parameter("1", default=0.4)
    phi = gl.Variable("1", start=1.0)
    w = gl.Variable("1", start=0.0)
    psi = gl.Variable("1", start=-0.5)
    u = gl.Variable("1", start=0.2)

    def equations(self) -> list[Any]:
        stop = gl.no_event(gl.Piecewise((30.0 * (self.phi - self.psi - 1.0) ** 3, self.phi - self.psi > 1.0), (0, True)))
        return [
            gl.Eq(gl.der(self.phi), self.w),
            gl.Eq(gl.der(self.psi), self.u),
            gl.Eq(gl.der(self.w), -self.g * gl.sin(self.phi) - self.b * gl.tanh(5 * self.w) - stop),
            gl.Eq(
                gl.der(self.u), -self.g * gl.cos(self.phi) * self.psi + stop + self.b * gl.sin(7 * gl.time) / (1 + self.u**2)
            ),
        ]


@pytest.fixture(scope="module")
def drive() -> gl.System:
    return gl.compile(Drive(), outputs=["load.w", "shaft.tau"])


@pytest.fixture(scope="module")
def pendulum() -> gl.System:
    return gl.compile(Pendulum())


def test_linear_runs_are_exact_runs_within_the_tolerance(drive: gl.System) -> None:
    runs = drive.sweep({"J": J, "torque.tau": J + 1.0, "start(load.w)": -J}, 1.0, **OPTIONS | {"inputs": None})
    assert runs.stats["lanes"] == 8
    for k in range(len(J)):
        exact = drive.simulate(
            1.0, samples=21, method="exact", parameters={"J": J[k]}, inputs={"torque.tau": J[k] + 1.0}, start={"load.w": -J[k]}
        )
        for name in ("load.w", "shaft.tau"):
            assert np.allclose(runs[name][k], exact[name], rtol=1e-5, atol=1e-5 * np.abs(exact[name]).max())


@pytest.mark.parametrize("seed", [1, 2])
def test_nonlinear_runs_are_single_runs_within_the_tolerance(pendulum: gl.System, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = {"g": rng.uniform(5.0, 40.0, 9), "b": rng.uniform(0.0, 1.0, 9), "start(psi)": rng.uniform(-1.0, 1.0, 9)}
    runs = pendulum.sweep(values, 1.0, samples=11, method="rk5", rtol=1e-9, outputs=["phi", "u"], lanes=8)
    for k in (0, 8):
        single = pendulum.simulate(
            1.0,
            samples=11,
            method="rk8",
            rtol=1e-11,
            parameters={n: values[n][k] for n in "gb"},
            start={"psi": values["start(psi)"][k]},
        )
        for name in ("phi", "u"):
            assert np.abs(runs[name][k] - single[name]).max() < 1e-6


class Struck(gl.Component):
    """A body under a push that lasts as long as it likes, always with the same impulse."""

    width = gl.Parameter("s", default=1.0)
    w = gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.w), gl.exp(-(((gl.time - 5.0312) / self.width) ** 2)) / self.width)]


@pytest.mark.parametrize("more", [{}, {"max_step": 1e-3}])
def test_no_run_steps_over_a_push_that_is_shorter_than_that_of_the_first(more: dict[str, Any]) -> None:
    widths = np.geomspace(1.0, 1e-3, 9)
    runs = gl.compile(Struck()).sweep({"width": widths}, 10.0, samples=3, method="rk5", lanes=8, **more)
    pushed = erf((np.array([0.0, 5.0, 10.0]) - 5.0312) / widths[:, None])
    assert runs["w"] == pytest.approx(np.sqrt(np.pi) / 2 * (pushed - pushed[:, :1]), abs=1e-5)


class Emptying(gl.Component):
    """A vessel that runs empty, x = (1 - k t / 2)^2: there Runge-Kutta's steps end, and `"auto"` has another method."""

    k = gl.Parameter("1/s", default=1.0)
    x = gl.Variable("1", start=1.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), -self.k * gl.sqrt(self.x))]


def test_runs_that_no_lane_carries_to_their_end_are_those_of_auto() -> None:
    system, k = gl.compile(Emptying()), np.linspace(0.5, 3.0, 8)
    with pytest.raises(gl.GearlibError, match="the step became too small"):
        system.simulate(5.0, method="rk5", parameters={"k": k[0]})
    runs = system.sweep({"k": k}, 5.0, times=[0.0, 0.5, 5.0])
    assert runs["x"] == pytest.approx(np.column_stack([np.ones(8), (1 - k / 4) ** 2, np.zeros(8)]), abs=1e-6)
    assert runs.stats["why"].startswith("the first run fails: the step became too small")


def test_what_is_reduced_is_a_result(drive: gl.System) -> None:
    def told(result: gl.Result) -> list[float]:
        return [result["shaft.tau"][-1], result.stats["steps"]]

    runs = drive.sweep({"J": J}, 1.0, reduce={"peak": peak, "told": told}, **OPTIONS)
    one = drive.sweep({"J": J}, 1.0, reduce={"peak": peak, "told": told}, lanes=1, **OPTIONS)
    assert (runs.stats["lanes"], one.stats["lanes"], one.stats["why"]) == (8, 1, "asked for")
    assert np.allclose(runs["peak"], one["peak"], rtol=1e-5)
    assert np.allclose(runs["told"][:, 0], one["told"][:, 0], rtol=1e-4, atol=1e-4)
    assert (np.abs(runs["told"][:, 1] - one["told"][:, 1]) <= 0.2 * one["told"][:, 1]).all()


def test_a_run_is_the_same_whatever_its_neighbours_are(drive: gl.System) -> None:
    whole = drive.sweep({"J": J}, 1.0, **OPTIONS)["load.w"]
    turned = drive.sweep({"J": J[::-1]}, 1.0, **OPTIONS)["load.w"][::-1]
    with ThreadPoolExecutor(2) as pool:
        shared = drive.sweep({"J": J}, 1.0, executor=pool, **OPTIONS)["load.w"]
    assert whole.tobytes() == turned.tobytes() == shared.tobytes()


def test_one_lane_is_simulate_to_the_last_bit(drive: gl.System) -> None:
    runs = drive.sweep({"J": J}, 1.0, lanes=1, **OPTIONS)
    assert runs["load.w"][7].tobytes() == drive.simulate(1.0, parameters={"J": J[7]}, **OPTIONS)["load.w"].tobytes()


def test_runs_that_fail_or_do_not_fit_are_carried_out_by_themselves(drive: gl.System) -> None:
    masses = np.where(J[3] == J, -1.0, 0.5)
    masses[5] = 0.0  # another translation
    with pytest.warns(GearlibWarning, match=r"1 of 11 runs failed.*run 3: motor.J is -1"):
        runs = drive.sweep({"J": J, "motor.J": masses}, 1.0, **OPTIONS)
    assert [*runs.errors] == [3]
    assert isinstance(runs.errors[3], BoundError)
    assert np.isnan(runs["load.w"]).any(axis=1).tolist() == [k == 3 for k in range(11)]
    single = drive.simulate(1.0, parameters={"J": J[5], "motor.J": 0.0}, **OPTIONS)
    assert runs["load.w"][5].tobytes() == single["load.w"].tobytes()


class SideBySide(gl.Component):
    """Two gears between the same two shafts, of which the second says nothing new while both have one ratio."""

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.motor, self.load = gp.Torque(tau=3.0), gp.Inertia(J=0.5), gp.Inertia(J=1.0)
        self.one, self.two = gp.IdealGear(ratio=2.0), gp.IdealGear(ratio=2.0)
        return [
            gl.connect(self.torque.flange, self.motor.flange_a),
            gl.connect(self.motor.flange_b, self.one.flange_a, self.two.flange_a),
            gl.connect(self.one.flange_b, self.two.flange_b, self.load.flange_a),
        ]


@pytest.mark.parametrize("method", ["rk5", "exact"])
def test_a_run_whose_rigid_loop_cannot_turn_fails_among_others(method: str) -> None:
    """The inertia that the torque drives is 0.5 + 1 / 2^2 at the motor."""
    ratios = np.full(9, 2.0)
    ratios[3] = 2.5
    with pytest.warns(GearlibWarning, match="1 of 9 runs failed.*run 3: the rigid loop through one, two cannot turn"):
        runs = gl.compile(SideBySide(), outputs=["load.w"]).sweep({"two.ratio": ratios}, 1.0, samples=3, method=method)
    assert [*runs.errors] == [3]
    assert np.isnan(runs["load.w"][3]).all()
    assert np.allclose(np.delete(runs["load.w"], 3, axis=0), [0.0, 1.0, 2.0])


def test_a_run_that_cannot_go_on_says_so_as_simulate_does() -> None:
    class Explosion(gl.Component):
        rate = gl.Parameter("1", default=1.0)
        x = gl.Variable("1", start=1.0)

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), self.rate * self.x**2)]

    system = gl.compile(Explosion())
    rates = np.array([0.1, 0.2, 0.3, 5.0, 0.4, 0.5, 0.6, 0.7, 0.8])
    with pytest.warns(GearlibWarning, match="the step became too small"):
        runs = system.sweep({"rate": rates}, 1.0, samples=3, method="rk5", lanes=8)
    assert [*runs.errors] == [3]
    good = rates < 1.0
    assert np.allclose(runs["x"][good], 1.0 / (1.0 - np.outer(rates[good], [0.0, 0.5, 1.0])), rtol=1e-5)


def test_files_and_grids_are_filled_from_lanes(drive: gl.System, tmp_path: Any) -> None:
    varied = gl.grid({"J": [1.0, 2.0, 3.0], "shaft.c": [300.0, 400.0, 500.0, 600.0]})
    there = drive.sweep(varied, 1.0, to=tmp_path / "sweep.nc", **OPTIONS)
    memory = drive.sweep(varied, 1.0, **OPTIONS)
    assert there["load.w"].shape == (3, 4, 21)
    assert there["load.w"].tobytes() == memory["load.w"].tobytes()


def test_progress_is_told_and_an_interrupt_keeps_what_is_done(drive: gl.System) -> None:
    count = [0]

    def interrupt(result: gl.Result) -> float:
        count[0] += 1
        if count[0] == 5:
            raise KeyboardInterrupt
        return peak(result)

    told: list[float] = []
    with pytest.warns(GearlibWarning, match="interrupted after 4 of 11 runs"):
        runs = drive.sweep({"J": J}, 1.0, reduce={"peak": interrupt}, progress=lambda f, _: told.append(f), **OPTIONS)
    assert runs.done.sum() == 4
    assert told[-1] == pytest.approx(4 / 11)
    assert np.isfinite(runs["peak"]).sum() == 4


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"method": "ida"}, "the method is ida"),
        ({"method": "rk", "rtol": 1e-9}, "the method is rk;"),
        ({"inputs": {"torque.tau": gl.Table([0, 0.4, 0.5, 1], [0, 1, 3, 0], interpolation="cubic")}}, "a table of cubics"),
        ({"inputs": {"torque.tau": lambda t: t}}, "functions of time"),
        ({"t_start": 1e6, "t_end": 1e6 + 1.0}, "begin late"),
    ],
)
def test_what_does_not_fit_is_told(drive: gl.System, options: dict[str, Any], why: str) -> None:
    given_ = {"t_end": 1.0, **OPTIONS, "rtol": 1e-6, "samples": 3, **options}
    runs = drive.sweep({"J": J[:8]}, **given_)
    assert runs.stats["lanes"] == 1
    assert why in runs.stats["why"]
    with pytest.raises(ArgumentError, match="lanes is 8, but these runs cannot be carried out so"):
        drive.sweep({"J": J[:8]}, lanes=8, **given_)


@pytest.mark.parametrize(
    ("points", "values", "options"),
    [
        ([0.0, 0.31, 0.31, 0.4, 1.0], [0.0, 4.0, 1.0, -2.0, 1.0], {}),  # with a jump
        ([0.5, 0.501, 0.502], [0.0, 900.0, 0.0], {}),  # a short pulse
        ([0.0, 0.02], [0.0, 5.0], {"interpolation": "previous", "outside": "hold"}),
        ([0.0, 0.05, 0.2], [0.0, 5.0, 0.0], {"outside": "periodic"}),
    ],
)
@pytest.mark.parametrize("samples", [21, 2])
def test_tables_are_stepped_through_from_corner_to_corner(
    drive: gl.System, points: Any, values: Any, options: Any, samples: int
) -> None:  # fmt: skip
    table = gl.Table(points, values, **options)
    options = {**OPTIONS, "inputs": {"torque.tau": table}, "samples": samples}
    runs = drive.sweep({"J": J, "start(load.w)": -J}, 1.0, **options, lanes=8)
    for k in (0, 10):
        given = {"parameters": {"J": J[k]}, "start": {"load.w": -J[k]}}
        exact = drive.simulate(1.0, samples=samples, method="exact", inputs={"torque.tau": table}, **given)
        for name in ("load.w", "shaft.tau"):
            assert np.abs(runs[name][k] - exact[name]).max() < 1e-6 * np.abs(exact[name]).max()


def test_each_run_may_have_a_table_of_its_own(drive: gl.System) -> None:
    tables = [gl.Table(np.linspace(0.0, 1.0, 2 + k), np.arange(2 + k) % 3) for k in range(11)]
    tables[4] = gl.Table([0.0, 0.4, 0.5, 1.0], [0.0, 1.0, 3.0, 0.0], interpolation="cubic")  # is done by itself
    runs = drive.sweep({"J": J, "torque.tau": tables}, 1.0, **{**OPTIONS, "inputs": None})
    assert runs.stats["lanes"] == 8
    for k in (0, 4, 10):
        single = drive.simulate(
            1.0, samples=21, rtol=1e-10, method="rk8", parameters={"J": J[k]}, inputs={"torque.tau": tables[k]}
        )
        assert np.abs(runs["load.w"][k] - single["load.w"]).max() < 1e-6 * np.abs(single["load.w"]).max()


class ThreeForces(gl.Component):
    """Three integrals, each of a signal of its own."""

    u, v, w = (gl.Input("1/s") for _ in range(3))
    x, y, z = (gl.Variable("1", start=0.0) for _ in range(3))

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(a), b) for a, b in ((self.x, self.u), (self.y, self.v), (self.z, self.w))]


def test_tables_stand_beside_each_other_and_beside_numbers() -> None:
    """The integral of a line between corners is exact; each table has corners of its own, in some runs none."""
    t, rng = np.linspace(0.0, 1.0, 9), np.random.default_rng(2)
    corners, numbers = np.sort(rng.uniform(0.0, 1.0, (10, 2))), rng.normal(size=10)
    own = [gl.Table([0.0, *c, 1.0], rng.normal(size=4)) for c in corners]
    shared = gl.Table([0.0, 0.3, 1.0], [1.0, -2.0, 4.0])
    varied: dict[str, Any] = {"u": own, "v": numbers}
    system = gl.compile(ThreeForces(), outputs=["x", "y", "z"])
    runs = system.sweep(varied, 1.0, samples=9, method="rk5", lanes=8, inputs={"w": shared})

    def integral(table: gl.Table) -> Any:
        fine = np.union1d(np.linspace(0.0, 1.0, 9), table.t)
        values = np.interp(fine, table.t, table.y)
        return np.interp(t, fine, np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (values[1:] + values[:-1]))]))

    assert runs["x"] == pytest.approx(np.array([integral(table) for table in own]), abs=1e-6)
    assert runs["y"] == pytest.approx(numbers[:, None] * t, abs=1e-12)
    assert runs["z"] == pytest.approx(np.tile(integral(shared), (10, 1)), abs=1e-6)
    sizes = np.arange(1.0, 9.0)  # from one sample to the next several periods, the first of which counts, too
    waves = [gl.Table([0.0, 0.05, 0.1], [0.0, a, 0.0], outside="periodic") for a in sizes]
    runs = system.sweep({"u": waves}, 1.0, samples=3, method="rk5", lanes=8, inputs={"v": 0.0, "w": 0.0})
    assert runs["x"] == pytest.approx(sizes[:, None] * [0.0, 0.25, 0.5], abs=1e-6)


def test_auto_takes_lanes_where_one_run_shows_neither_events_nor_stiffness(pendulum: gl.System) -> None:
    g = np.linspace(5.0, 40.0, 9)
    runs = pendulum.sweep({"g": g}, 1.0, samples=5, outputs=["phi"])
    assert runs.stats["lanes"] == 8
    single = pendulum.simulate(1.0, samples=5, parameters={"g": g[8]}, rtol=1e-10)
    assert np.abs(runs["phi"][8] - single["phi"]).max() < 1e-5
    tight = pendulum.sweep({"g": g}, 1.0, samples=5, outputs=["phi"], rtol=1e-9)
    assert "the method is auto" in tight.stats["why"]


class Relaxing(gl.Component):
    """Van der Pol's oscillator: stiff where mu is large."""

    mu = gl.Parameter("1", default=1.0)
    x = gl.Variable("1", start=2.0)
    v = gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), self.mu * (1 - self.x**2) * self.v - self.x)]


def test_a_stiff_run_among_others_is_left_to_auto() -> None:
    system = gl.compile(Relaxing())
    mu = np.array([1.0, 2.0, 1.5, 3e4, 0.5, 0.2, 2.5, 3.0, 0.1])
    method = lambda r: float(r.stats["method"] == "rk5")  # noqa: E731
    runs = system.sweep({"mu": mu}, 5.0, samples=6, reduce={"rk5": method, "end": gl.final("x")})
    assert runs.stats["lanes"] == 8
    assert runs["rk5"].tolist() == [float(m < 1e3) for m in mu]
    single = system.simulate(5.0, samples=6, parameters={"mu": 3e4})
    assert runs["end"][3] == single["x"][-1]
    stiff = system.sweep({"mu": 3e4, "start(x)": np.linspace(1.5, 2.5, 9)}, 5.0, samples=6, outputs=["x"])
    assert (stiff.stats["lanes"], "stability limits" in stiff.stats["why"]) == (1, True)


class Swing(gl.Component):
    """An undamped oscillator with a rate of 64 in both of its equations, driven by an input."""

    u = gl.Input("1")
    x = gl.Variable("1", start=1.0)
    v = gl.Variable("1", start=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), 64.0 * self.v), gl.Eq(gl.der(self.v), self.u - 64.0 * self.x)]


def most(system: gl.System, t_end: float, **options: Any) -> float | str:
    """The limit for the steps of a run, or why there are no lanes."""
    translation, request = checked_request(system.translation, t_end, **options)
    return most_steps(ExactSweep(translation, request, {}, {}, True, (), False))


def test_limit_of_the_steps_of_a_linear_run() -> None:
    """Three radians are a step, and each corner of a table is the end of one; from 3000 on, exponentials are faster."""
    swing = gl.compile(Swing())
    table = gl.Table([0.0, 0.5, 0.75, 9.0], [0.0, 1.0, 3.0, 0.0])
    for span in (3.0, 30.0):
        for begin in (0.0, -2.0, 5.0):
            assert most(swing, begin + span, t_start=begin, inputs={"u": 1.0}) == PATIENCE * 64.0 * span / 3.0 + LEAST_STEPS
        assert most(swing, span, inputs={"u": table}) == PATIENCE * (4 + 64.0 * span / 3.0) + LEAST_STEPS
        assert most(swing, span, inputs={"u": table}, method="rk5") == float("inf")
    longest = 3.0 * MOST_OF_LINEAR / 64.0
    assert most(swing, longest, inputs={"u": 1.0}) == PATIENCE * MOST_OF_LINEAR + LEAST_STEPS
    assert most(swing, 2 * longest, inputs={"u": 1.0}) == "the scene is linear: exponentials are faster than some 6000 steps"


def test_limit_of_the_steps_of_a_nonlinear_run_is_that_of_the_first(pendulum: gl.System) -> None:
    steps = pendulum.simulate(1.0, method="rk5").stats["steps"]
    assert most(pendulum, 1.0) == PATIENCE * steps + LEAST_STEPS
    assert most(pendulum, 1.0, method="rk") == most(pendulum, 1.0, method="rk5") == float("inf")
    bursting = gl.compile(Bursting())
    assert str(most(bursting, 2.0)).startswith("the first run fails: ")


class Bursting(gl.Component):
    """Infinite after a second."""

    x = gl.Variable("1", start=1.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.x**2)]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"method": "rk", "rtol": 1e-6}, None),
        ({"method": "rk", "rtol": 0.99e-6}, "the method is rk; lanes are Runge-Kutta of order 5: method='rk5'"),
        ({"method": "rk8"}, "the method is rk8; lanes are Runge-Kutta of order 5: method='rk5'"),
        ({"method": "rk5", "rtol": 1e-9}, None),
        ({"t_start": LATE - 1.0, "t_end": LATE}, "the runs begin late"),
        ({"t_start": LATE - 2.0, "t_end": LATE - 1.0}, None),
        ({"t_start": -LATE, "t_end": 1.0 - LATE}, "the runs begin late"),
        ({"t_start": 1.0 - LATE, "t_end": 2.0 - LATE}, None),
        ({"inputs": {"u": lambda t: t}}, "inputs are functions of time"),
        ({"inputs": {"u": gl.Table([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.0, 1.0], interpolation="cubic")}}, "an input is a table of cubics"),
        ({"inputs": {"u": gl.Table([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.0, 1.0])}}, None),
    ],
)  # fmt: skip
def test_what_lanes_need(options: dict[str, Any], said: str | None) -> None:
    swing = gl.compile(Swing())
    given_ = {"t_end": 1.0, "inputs": {"u": 0.0}, "method": "auto", **options}
    assert why_not_in_lanes(*checked_request(swing.translation, **given_)) == said


class Bounded(gl.Component):
    """A state with a least value, and one without; without ``x``, nothing but an equation."""

    k = gl.Parameter("any", default=1.0)
    x = gl.Variable("any", start=2.0, min=0.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), -self.k * self.x)]


class Governed(gl.Component):
    def assemble(self) -> list[Any]:
        self.torque, self.body = gp.Torque(), gp.Inertia(J=2.0)
        self.governor = gl.Sampled(lambda t, w: 1.0 - w[0], 0.1, inputs=[self.body.w], outputs=[self.torque.tau])
        return [gl.connect(self.torque.flange, self.body.flange_a)]


class Standing(gl.Component):
    k = gl.Parameter("any", default=1.0)
    y = gl.Variable("any")

    def equations(self) -> list[Any]:
        return [gl.Eq(self.y, self.k * gl.time)]


CHANGED = "the model has sampled controllers, or equations that other parameters change"


def test_runs_that_cannot_be_prepared_together_say_why(drive: gl.System) -> None:
    first = drive.simulate(0.5, **OPTIONS)
    massless = drive.translation.fitting(drive.translation.parameter_values({"motor.J": 0.0}))
    for translation, start, said in (
        (drive.translation, first, "the runs go on from another one"),
        (drive.translation, (first, 0.25), "the runs go on from another one"),
        (drive.translation, {"load.w": 1.0}, None),
        (drive.translation, "steady", None),
        (massless, None, CHANGED),
        (gl.compile(Governed()).translation, None, CHANGED),
        (gl.compile(Rattle()).translation, None, "there are events"),
        (gl.compile(Standing()).translation, None, "there are no states"),
        (gl.compile(Bounded()).translation, None, "variables have least values that are to be watched"),
    ):
        _, request = checked_request(
            translation, 1.0, samples=3, start=start, inputs=dict.fromkeys(translation.open_inputs, 1.0)
        )
        assert why_one_by_one(translation, request) == said
        assert why_not_in_lanes(translation, request) == said
        assert why_not_by_exponentials(translation, request) == said


def test_exponentials_are_for_their_methods(drive: gl.System) -> None:
    for method, said in (("auto", None), ("exact", None), ("rk5", "the method is rk5"), ("ida", "the method is ida")):
        request = checked_request(drive.translation, 1.0, method=method, inputs=TORQUE)[1]
        assert why_not_by_exponentials(drive.translation, request) == said


@pytest.mark.parametrize(
    ("varied", "options", "why"),
    [
        ({"torque.tau": [lambda t: t] * 8}, {"inputs": None}, "inputs are functions of time"),
        ({"J": J[:8]}, {"outputs": ["load.phi"]}, "an output needs more states than the system was compiled for"),
        (
            {"J": J[:8]},
            {"reduce": {"end": gl.final("load.phi")}},
            "an output needs more states than the system was compiled for",
        ),
        ({"J": J[:8]}, {"method": "auto", "rtol": 1e-9, "inputs": {"torque.tau": lambda t: t}}, "the method is auto"),
        ({"J": J[:8]}, {"method": "exact", "samples": None, "times": np.geomspace(0.01, 1.0, 130)}, "the method is exact"),
    ],
)
def test_why_the_runs_of_a_sweep_follow_one_another(drive: gl.System, varied: Any, options: dict[str, Any], why: str) -> None:
    """And they are the runs of `simulate` all the same, to the last bit."""
    given_ = {**OPTIONS, "samples": 3, **options}
    runs = drive.sweep(varied, 1.0, **given_)
    assert (runs.stats["lanes"], runs.stats["why"].split(";")[0]) == (1, why)
    own = {key: value for key, value in given_.items() if key not in ("outputs", "reduce")}
    if "J" in varied:
        single = drive.simulate(1.0, **own, parameters={"J": J[3]})
    else:
        single = drive.simulate(1.0, **own | {"inputs": {"torque.tau": varied["torque.tau"][3]}})
    for name in runs:
        expected = single["load.phi"][-1:] if name == "end" else single[name]
        assert np.ravel(runs[name][3]).tobytes() == expected.tobytes(), name


def test_statistics_of_a_run_in_lanes(drive: gl.System) -> None:
    """Six evaluations in a step, of which the last is the first of the next one; two more give the first step its length."""

    def told(result: gl.Result) -> list[float]:
        s = result.stats
        assert (s["method"], s["why"]) == ("rk5", "asked for; 8 runs side by side")
        return [s["steps"], s["rejected"], s["rhs"], s["order"], s["states"]]

    runs = drive.sweep({"J": J}, 1.0, reduce={"told": told}, **OPTIONS)["told"]
    assert (runs[:, 2] == 6 * (runs[:, 0] + runs[:, 1]) + 2).all()
    assert (runs[:, 3:] == [5, len(drive.states)]).all()
    assert ((runs[:, 0] > 20) & (runs[:, 1] >= 0) & (runs[:, 1] < runs[:, 0])).all()
    loose = drive.sweep({"J": J}, 1.0, reduce={"told": told}, **OPTIONS | {"rtol": 1e-3})["told"]
    assert (loose[:, 0] < runs[:, 0]).all()


def test_a_table_with_many_corners_is_stepped_through_by_itself(drive: gl.System) -> None:
    """Up to 2000 points, the tables of the runs are copied for the lanes."""
    tables = [gl.Table(np.linspace(0.0, 1.0, n), np.arange(n) % 2) for n in (*[5] * 8, MOST_CORNERS, MOST_CORNERS + 1)]
    why = lambda result: float("side by side" in result.stats["why"])  # noqa: E731
    runs = drive.sweep({"torque.tau": tables}, 0.01, reduce={"lanes": why}, **{**OPTIONS, "inputs": None})
    assert runs["lanes"].tolist() == [1.0] * 9 + [0.0]


def test_events_and_few_runs_are_carried_out_one_by_one(drive: gl.System) -> None:
    rattle = gl.compile(Rattle(), outputs=["load.w"]).sweep({"load.J": J[:8]}, 0.1, samples=3, method="rk5")
    assert (rattle.stats["lanes"], rattle.stats["why"]) == (1, "there are events")
    assert drive.sweep({"J": J[:7]}, 1.0, **OPTIONS).stats["why"] == "there are fewer than 8 runs"


@pytest.mark.parametrize("lanes", [0, 2, 4, 16, True, 8.5, "all", None, np.array([8, 8]), np.array(["auto"]), Decimal("sNaN")])
def test_other_lanes_are_refused(drive: gl.System, lanes: Any) -> None:
    with pytest.raises(ArgumentError, match=r"lanes is .*; expected 'auto', 1 or 8"):
        drive.sweep({"J": J}, 1.0, lanes=lanes, **OPTIONS)


def test_the_paper_train_in_lanes_is_the_exact_one() -> None:
    system = gl.compile(gp.ZhouCui2022(), outputs=["w_out", "q_ring"])
    stiffness = np.linspace(1e8, 3e8, 9)
    options: dict[str, Any] = {"samples": 51, "inputs": {"tau_in": 100.0}}
    runs = system.sweep({"K_g": stiffness}, 0.01, method="rk5", rtol=1e-8, lanes=8, **options)
    for k in (0, 8):
        exact = system.simulate(0.01, method="exact", parameters={"K_g": stiffness[k]}, **options)
        for name in ("w_out", "q_ring"):
            assert np.abs(runs[name][k] - exact[name]).max() < 1e-6 * np.abs(exact[name]).max()


def test_threads_wait_for_runs_that_take_many_calls(drive: gl.System, monkeypatch: pytest.MonkeyPatch) -> None:
    """A call of the loop in which no run ends has nothing to hand on."""
    given: dict[str, Any] = {"parameters": {"J": np.linspace(0.5, 4.0, 64)}, "t_end": 1.0, "outputs": ["load.w"], **OPTIONS}
    expected = drive.sweep(**given)
    whole = LaneRuns.advance
    monkeypatch.setattr(LaneRuns, "advance", lambda runs: whole(runs, 2))
    for threads in (1, 2):
        runs = drive.sweep(**given, threads=threads)
        assert runs.stats["lanes"] == 8
        assert runs["load.w"].tobytes() == expected["load.w"].tobytes()


class Coasting(gl.Component):
    """A body without a torque: its equations have no number at all."""

    def assemble(self) -> list[Any]:
        self.body = gp.Inertia(J=1.0)
        return []


@pytest.mark.parametrize("method", ["auto", "rk5"])
def test_equations_without_a_number_are_integrated_side_by_side(method: str) -> None:
    w = np.linspace(-3.0, 4.0, 9)
    runs = gl.compile(Coasting(), outputs=["body.phi"]).sweep({"start(body.w)": w}, 2.0, samples=3, method=method)
    assert runs["body.phi"] == pytest.approx(w[:, None] * [0.0, 1.0, 2.0], abs=1e-12)
