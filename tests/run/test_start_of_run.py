"""simulate(start=...): any variable, under any of its names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearlib as gl
import gearparts as gp
from gearlib.errors import NameLookupError, StartError


class Geared(gl.Component):
    """Two bodies on one shaft, a third behind a gear, a fourth on a spring; two of them have start values of their own."""

    def assemble(self) -> list[Any]:
        self.torque, self.gear, self.spring = gp.Torque(), gp.IdealGear(ratio=2.0), gp.SpringDamper(c=10.0, d=1.0)
        self.a, self.d = (gp.Inertia(J=1.0, start={"phi": 0.0, "w": w}) for w in (2.0, 1.0))
        self.b, self.c = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
        self.bearing = gp.BearingFriction(tau_pos=[[0.0, 0.0]])
        return [
            gl.connect(self.torque.flange, self.a.flange_a),
            gl.connect(self.a.flange_b, self.b.flange_a),
            gl.connect(self.b.flange_b, self.gear.flange_a),
            gl.connect(self.gear.flange_b, self.c.flange_a, self.spring.flange_a),
            gl.connect(self.spring.flange_b, self.d.flange_a, self.bearing.flange_a),
        ]


FREE = {"torque.tau": 0.0}


@pytest.fixture(scope="module")
def system() -> gl.System:
    return gl.compile(Geared())


@pytest.mark.parametrize(
    ("name", "value", "w"), [("a.w", 3.0, 3.0), ("b.w", 3.0, 3.0), ("c.w", 3.0, 6.0), ("a.flange_a.phi", 0.4, 2.0)]
)
def test_a_variable_stands_for_the_state_that_it_follows_from(system: gl.System, name: str, value: float, w: float) -> None:
    """The model's start value of that state gives way; the others hold."""
    result = system.simulate(0.01, samples=2, start={name: value}, inputs=FREE)
    assert result[name][0] == pytest.approx(value, rel=1e-14)
    assert [result["a.w"][0], result["b.w"][0], result["c.w"][0], result["d.w"][0]] == pytest.approx(
        [w, w, w / 2, 1.0], rel=1e-14
    )


def test_a_run_keeps_no_memory_of_another_start(system: gl.System) -> None:
    system.simulate(0.01, samples=2, start={"c.w": 3.0}, inputs=FREE)
    assert system.simulate(0.01, samples=2, inputs=FREE)["a.w"][0] == 2.0


@pytest.mark.parametrize(
    ("start", "error", "message"),
    [
        (
            {"spring.w_rel": 0.1},
            StartError,
            r"spring\.w_rel is fixed at 0\.1, .* make it 0; .*spring\.w_rel follows from a\.w, d\.w",
        ),
        ({"b.w": 1.0, "a.w": 2.0}, StartError, r"b\.w is fixed at 1, .*make it 2; .*b\.w follows from a\.w"),
        (
            {"d.phi": 1.0, "d.flange_a.phi": 2.0},
            StartError,
            r"d\.phi and d\.flange_a\.phi are one variable .* fixed at 1 and 2",
        ),
        ({"a.a": 1.0}, NameLookupError, r"a\.a is a derivative, which has no start value; a\.w has one"),
        ({"der(a.w)": 1.0}, NameLookupError, r"der\(a\.w\) is a derivative"),
        ({"torque.tau": 1.0}, NameLookupError, r"torque\.tau is an input, .* give inputs=\{'torque\.tau': \.\.\.\}"),
        ({"a": 1.0}, NameLookupError, r"'a' is a component, no variable; name one of its variables: .*a\.w"),
    ],
)
def test_what_cannot_be_a_start_value_is_told(system: gl.System, start: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        system.simulate(0.01, samples=2, start=start)


def test_a_linear_model_takes_no_start_value_of_a_discrete_variable(system: gl.System) -> None:
    message = r"bearing\.mode is a discrete variable; .* start=\{'mode': \.\.\.\} of bearing"
    with pytest.raises(NameLookupError, match=message):
        system.linearize(at={"bearing.mode": 1.0})


ROOTED = {  # slopes are infinite or not defined at x = y = 0
    "square": lambda root, x, y: root(x), "tank": lambda root, x, y: 1 - root(x), "swollen": lambda root, x, y: 1 + root(x),
    "product": lambda root, x, y: 1 + root(x * y),
}  # fmt: skip


@pytest.mark.parametrize("form", ["ode", "torn", "dae"])
@pytest.mark.parametrize("kind", ROOTED)
def test_rates_may_start_where_their_slope_is_not_finite(kind: str, form: Any) -> None:
    """With IDA as with Runge-Kutta and SciPy."""

    class Rooted(gl.Component):
        x, y, s = gl.Variable("1", start=0.0), gl.Variable("1", start=0.0), gl.Parameter("s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(self.s * gl.der(self.x), ROOTED[kind](gl.sqrt, self.x, self.y)), gl.Eq(self.s * gl.der(self.y), 1.0),
            ]  # fmt: skip

    t = np.linspace(0.0, 0.9, 4)
    right = solve_ivp(
        lambda t, x: ROOTED[kind](lambda z: np.sqrt(np.abs(z)), x, t), (0.0, 0.9), [0.0], "DOP853", t, rtol=1e-11, atol=1e-14
    )
    for asked in ({"method": "rk"}, {"method": "ida", "form": form}):
        found = gl.simulate(Rooted(), 0.9, samples=4, rtol=1e-8, **asked)
        assert found["x"] == pytest.approx(right.y[0], abs=2e-7)
