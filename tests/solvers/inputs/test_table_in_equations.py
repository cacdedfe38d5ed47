"""Tables bound to inputs, and tables of variables, against SciPy and the same run with the table as an input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

import gearlib as gl
import gearparts as gp
from gearlib.errors import ArgumentError, BindingError

TABLES = {
    "linear": gl.Table([0.5, 1, 1, 2, 3], [1, 2, 5, 5, 0]),
    "previous": gl.Table([0.25, 1, 2], [1, 3, 0], "previous"),
    "monotone": gl.Table([0, 1, 2, 3], [0, 2, 1, 4], "monotone"),
    "cubic": gl.Table([0, 1, 2, 3], [0, 2, 1, 4], "cubic"),
    "akima": gl.Table([0, 0.5, 1, 2, 3], [0, 1, 2, 1, 4], "akima"),
    "one point": gl.Table([1.0], [2.0]),
}


class Bodies(gl.Component):
    """A body for each of some torques; one of each pair has the table bound, the other is given it."""

    def assemble(self) -> list[gl.Connection]:
        self.bound = [gp.Torque(tau=table) for table in TABLES.values()]
        self.given = [gp.Torque() for _ in TABLES]
        self.bodies = [gp.Inertia(J=2.0) for _ in range(2 * len(TABLES))]
        return [gl.connect(t.flange, b.flange_a) for t, b in zip((*self.bound, *self.given), self.bodies, strict=True)]


@pytest.mark.parametrize("method", ["auto", "rk", "ida"])
def test_a_bound_table_is_the_table_that_is_given_to_a_run(method: str) -> None:
    n = len(TABLES)
    given = {f"given[{k}].tau": table for k, table in enumerate(TABLES.values())}
    r = gl.compile(Bodies()).simulate(4.0, samples=81, rtol=1e-9, inputs=given, method=method)
    for k, (name, table) in enumerate(TABLES.items()):
        assert r[f"bound[{k}].tau"] == pytest.approx(table(r.time), abs=1e-13), name
        assert r[f"bodies[{k}].w"] == pytest.approx(r[f"bodies[{n + k}].w"], abs=1e-8), name


SPEEDS, LEVERS = [0.0, 50.0, 100.0, 200.0], [0.0, 0.5, 1.0]
TORQUES = [[0.0, 60.0, 90.0], [-5.0, 80.0, 120.0], [-10.0, 90.0, 150.0], [-20.0, 70.0, 140.0]]
LOAD = gl.Table([0.0, 100.0, 300.0], [5.0, 20.0, 200.0], "monotone")


class Engine(gl.Component):
    """An engine by its map, which a tabulated load brakes."""

    def assemble(self) -> list[gl.Connection]:
        torque = gl.Table2D(SPEEDS, LEVERS, TORQUES)
        self.engine = gp.Inertia(J=0.5, start={"w": 20.0})
        self.torque = gp.Torque(tau=torque(self.engine.w, 0.5 + 0.4 * gl.sin(gl.time)))
        self.load = gp.Torque(tau=-LOAD(self.engine.w))
        return [gl.connect(self.engine.flange_a, self.torque.flange, self.load.flange)]


def test_an_engine_by_its_map_agrees_with_scipy_and_has_exact_slopes() -> None:
    system = gl.compile(Engine())
    r = system.simulate(4.0, samples=41, rtol=1e-9)
    assert r.stats["events"] == 0
    torque, load = RegularGridInterpolator((SPEEDS, LEVERS), np.array(TORQUES)), PchipInterpolator([0, 100, 300], [5, 20, 200])

    def f(t: float, w: Any) -> Any:
        return (torque((min(w[0], 200.0), 0.5 + 0.4 * np.sin(t))) - load(w[0])) / 0.5

    expected = solve_ivp(f, (0.0, 4.0), [20.0], rtol=1e-8, atol=1e-8, t_eval=r.time, max_step=0.02).y[0]
    assert np.abs(r["engine.w"] - expected).max() < 1e-6 * expected.max()
    linear = system.linearize([], ["engine.w"], at={"engine.w": 150.0})  # lever at 0.5: from 90 to 70 N.m over 100 rad/s
    assert float(linear.A[0, 0]) == pytest.approx((-0.2 - float(load.derivative()(150.0))) / 0.5, rel=1e-12)
    assert gl.check_units(Engine()) == []


def test_events_at_corners_only_where_asked_and_at_jumps_always() -> None:
    corner, jump = gl.Table([0, 1, 2], [0, 1, 0]), gl.Table([0, 1, 1, 2], [0, 1, 3, 3])

    class Laws(gl.Component):
        x = gl.Variable("1", "a clock", start=0.25)
        smooth, stopped, jumping = gl.Variable("1", "a"), gl.Variable("1", "b"), gl.Variable("1", "c")
        z = gl.Variable("1", "integral", start=0.0)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), 1.0),
                gl.Eq(self.smooth, corner(self.x)),
                gl.Eq(self.stopped, corner(self.x, events=True)),
                gl.Eq(self.jumping, jump(self.x)),
                gl.Eq(gl.der(self.z), self.smooth + self.stopped + self.jumping),
            ]

    r = gl.simulate(Laws(), 2.5, samples=101, rtol=1e-9)
    assert sorted(round(t, 9) for t, _ in r.events) == [0.75, 0.75, 1.75]  # x = 1 twice, and x = 2
    assert r["smooth"] == pytest.approx(corner(r["x"]), abs=1e-12)
    assert r["stopped"] == pytest.approx(corner(r["x"]), abs=1e-12)
    assert r["jumping"] == pytest.approx(jump(r["x"]), abs=1e-9)


def test_a_map_of_two_variables_is_bilinear_and_holds_its_edge() -> None:
    table = gl.Table2D(SPEEDS, LEVERS, TORQUES)
    rng = np.random.default_rng(5)
    w, lever = rng.uniform(-50, 250, 200), rng.uniform(-0.5, 1.5, 200)
    reference = RegularGridInterpolator((SPEEDS, LEVERS), np.array(TORQUES))
    assert table(w, lever) == pytest.approx(reference((np.clip(w, 0, 200), np.clip(lever, 0, 1))), abs=1e-12)
    assert table(50.0, 0.5) == 80.0
    assert gl.Table2D([1.0], [2.0], [[3.0]])(0.0, 9.0) == 3.0


@pytest.mark.parametrize(
    ("make", "kind", "message"),
    [
        (
            lambda w: gl.Table([0, 1], [0, 1], outside="periodic"),
            BindingError,
            r"torque\.tau: .*periodic table is not a function",
        ),
        (
            lambda w: gl.Table(range(300), range(300)),
            BindingError,
            r"torque\.tau: .* has 300 points; in an equation, at most 200",
        ),
        (
            lambda w: gl.Table([0, 1], [0, 1], outside="periodic")(w),
            ArgumentError,
            r"periodic table is not a function in an equation",
        ),
        (
            lambda w: gl.Table2D([0, 1], [0, 1], [[0, 1]])(w, w),
            ArgumentError,
            r"has the shape \(1, 2\); expected a row for each of the 2 x",
        ),
        (lambda w: gl.Table([0, 1], [0, 1])(abs(w)), ArgumentError, r"expression with branches; give this to a variable"),
        (lambda w: gl.Table2D([0, 0], [0, 1], [[0, 1], [1, 2]])(w, w), ArgumentError, r"x must increase"),
        (lambda w: gl.Table2D(range(40), range(40), np.zeros((40, 40)))(w, w), ArgumentError, r"40 x 40 points; expected 800"),
        (lambda w: gl.Table([0, 1], [0, 1])(w, events=3), ArgumentError, r"events is 3; expected True or False"),
    ],
)
def test_tables_that_are_refused(make: Any, kind: type[Exception], message: str) -> None:
    class Driven(gl.Component):
        def assemble(self) -> list[gl.Connection]:
            self.body = gp.Inertia(J=1.0)
            self.torque = gp.Torque(tau=make(self.body.w))
            return [gl.connect(self.torque.flange, self.body.flange_a)]

    with pytest.raises(kind, match=message):
        gl.compile(Driven())


@pytest.mark.parametrize("no_number", [sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I, 1 + sympy.I * sympy.Symbol("x")])
def test_what_is_no_finite_real_number_is_refused(no_number: Any) -> None:
    table, area = gl.Table([0.0, 1.0], [0.0, 1.0]), gl.Table2D([0.0, 1.0], [0.0, 1.0], [[0.0, 1.0], [2.0, 3.0]])
    for call in (lambda: table(no_number), lambda: area(no_number, 0.5), lambda: area(0.5, no_number)):
        with pytest.raises(ArgumentError, match=r"is given .*; expected a finite real number, or an expression"):
            call()
