"""The functions of an FMU without a compiler: the small language is a part of Python, and so runs in it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.fmi.exported_model import exported_model
from gearlib.fmi.model_source import BEGIN, LONGEST_STEP, NEXT_TIME, OBSERVE, PREPARE, RHS, ModelSource, model_source
from gearlib.fmi.preparation import INVERT
from tests.fmi.test_preparation import Bound
from tests.test_acceptance import RigidLoop

FUNCTIONS = {
    RHS: "rhs",
    OBSERVE: "observe",
    PREPARE: "prepare",
    BEGIN: "begin",
    NEXT_TIME: "next_time",
    LONGEST_STEP: "longest_step",
}


class Functions:
    """Those of a model, with their data."""

    def __init__(self, component: gl.Component, outputs: Sequence[str] | None = None, **options: Any) -> None:
        self.system = gl.compile(component, outputs)
        self.exported = exported_model(self.system.translation, options.get("parameters"), options.get("inputs"), None)
        self.source: ModelSource = model_source(self.exported)
        self.data, self.x = self.source.data.tolist(), [np.nan] * max(len(self.exported.scene.states), 1)
        self.space: dict[str, Any] = {"parallel": range}
        for name in ("sin", "cos", "exp", "sqrt", "floor", "pi"):
            self.space[name] = getattr(np, name)
        exec(f"from __future__ import annotations\n{self.source.text}", self.space)

    def put(self, **parameters: float) -> None:
        for name, value in parameters.items():
            self.data[self.system.translation.model.parameters.index[name.replace("__", ".")]] = value

    def call(self, number: int, t: float = 0.0, length: int = 0) -> tuple[Any, list[float]]:
        values = [np.nan] * max(length, len(self.x), 1)
        return self.space[FUNCTIONS[number]](t, self.x, values, self.data, self.source.index.tolist()), values

    def begun(self, **parameters: float) -> list[float]:
        """Start values of the states, for some parameters."""
        self.put(**parameters)
        assert self.call(PREPARE)[0] == 0
        assert self.call(BEGIN)[0] == 0
        return self.x


CASES: dict[str, tuple[Callable[[], gl.Component], dict[str, float]]] = {
    "bound": (Bound, {"J": 0.7, "w": 5.0, "when": 0.5, "gear__ratio": -2.0, "shaft__c": 30.0, "load__J": 4.0}),
    "rigid loop": (RigidLoop, {}),
    "xp": (lambda: gp.ZhouCui2022(tau_in=100.0), {"I_h": 0.3}),
}


@pytest.mark.parametrize("case", CASES)
def test_start_values_and_rates_follow_from_the_parameters(case: str) -> None:
    """As those of a run; the tables of rigid loops are solved anew for each set of parameters."""
    make, parameters = CASES[case]
    model = Functions(make())
    names = {name.replace("__", "."): value for name, value in parameters.items()}
    for given, spelled in (({}, {}), (parameters, names)):
        start = list(model.begun(**given))
        count = len(model.exported.observed.outputs)
        assert model.call(OBSERVE, length=count)[0] == 0
        observed = model.call(OBSERVE, length=count)[1]
        assert model.call(RHS)[0] == 0
        rates = model.call(RHS)[1]
        expected = model.system.simulate(1e-9, samples=2, method="rk", parameters=spelled)
        for k, state in enumerate(model.system.states):
            assert start[k] == pytest.approx(expected[state][0], rel=1e-12, abs=1e-14), state
            assert rates[k] == pytest.approx(expected[f"der({state})"][0], rel=1e-9, abs=1e-9), state
            assert observed[k] == pytest.approx(rates[k], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_linear_equations_are_solved_in_place(n: int) -> None:
    """With rows and columns of very different sizes, and pivots that are zero where they stand."""
    space: dict[str, Any] = {}
    exec(f"from __future__ import annotations\n{INVERT}", space)
    draw = np.random.default_rng(n)
    for m, a in ((1, 0), (3, 2)):
        A, B = draw.normal(size=(n, n)), draw.normal(size=(n, m))
        if n > 1:
            A[0, 0] = 0.0
        A *= np.logspace(-4, 4, n)[:, None] * np.logspace(3, -3, n)
        b = a + n * n + 1
        data = [7.0] * (b + n * m + n + 1)
        data[a : a + n * n], data[b : b + n * m] = A.ravel().tolist(), B.ravel().tolist()
        assert space["invert"](data, a, n, b, m) == 0
        expected = np.linalg.solve(A, B)
        assert np.array(data[b : b + n * m]).reshape(n, m) == pytest.approx(expected, rel=1e-8)
        assert (data[:a], data[a + n * n : b], data[-1]) == ([7.0] * a, [7.0], 7.0), "nothing beside it"
    for wrong in (np.zeros((n, n)), np.full((n, n), np.inf), np.ones((n, n)) if n > 1 else np.full((1, 1), np.nan)):
        data = [*wrong.ravel().tolist(), *[1.0] * (2 * n)]
        assert space["invert"](data, 0, n, n * n, 1) == 1
    if n > 1:
        column = draw.normal(size=(n, n))
        column[:, 1] = 0.0
        assert space["invert"]([*column.ravel().tolist(), *[1.0] * (2 * n)], 0, n, n * n, 1) == 1


class Timed(gl.Component):
    """Conditions of time: an instant from parameters, a wave, and one that depends on the state."""

    a, b = gl.Parameter("s", default=2.0), gl.Parameter("1", default=4.0)
    period, offset = gl.Parameter("s", default=0.5), gl.Parameter("s", default=0.2)
    x = gl.Variable("any", start=0.0)
    n = gl.Discrete("count")

    def equations(self) -> Any:
        tick = gl.When(gl.sample(self.period, self.offset), gl.Eq(self.n, gl.pre(self.n) + 1))
        return [gl.Eq(gl.der(self.x), gl.Piecewise((1, gl.time * self.b > self.a), (self.n, True))), tick]


@pytest.mark.parametrize(
    "parameters", [{}, {"a": 6.0, "b": 3.0, "period": 0.7, "offset": 1.0}, {"period": 0.7, "offset": -0.4}]
)
def test_the_next_time_at_which_a_condition_switches(parameters: dict[str, float]) -> None:
    """The instant a / b and the ticks, later than now by more than rounding; also from a tick itself, and from just before it."""
    model = Functions(Timed(), outputs=["x"])
    model.begun(**parameters)
    a, b, period, offset = ({"a": 2.0, "b": 4.0, "period": 0.5, "offset": 0.2} | parameters).values()
    switches = [a / b, *(offset + k * period for k in range(60))]
    for t in (-1.0, 0.0, 0.3, 5.0, *(s + shift for s in switches[:9] for shift in (-1e-9, 0.0, 1e-9))):
        (_, (found, *_)) = model.call(NEXT_TIME, t)
        assert found == pytest.approx(min(s for s in switches if s > t + 1e-14), abs=1e-13), t


def test_a_model_whose_equations_cannot_be_solved_says_which() -> None:
    model = Functions(Bound())
    for parameters, said in (
        ({"load__J": 0.0}, "load: .* cannot be solved with these parameters; division by zero"),
        (
            {"J": 0.0, "load__J": 2.0, "wheel__J": 0.0, "gear__ratio": np.nan},
            ".* (singular|cannot be solved) with these parameters.*",
        ),
    ):
        model.put(**parameters)
        number, _ = model.call(PREPARE)
        assert number > 0
        assert re.fullmatch(said, model.source.checks[number - 1]), model.source.checks[number - 1]


class Driven(gl.Component):
    """Two waves, of which the faster one is searched for events if there are any."""

    f, second = gl.Parameter("Hz", default=2.0), gl.Parameter("s", default=1.0)
    searched = gl.Structural(False)
    x = gl.Variable("1", start=0.0)

    def equations(self) -> Any:
        wave = gl.sin(2 * gl.pi * self.f * gl.time)
        pulse = gl.Piecewise((1, wave + self.x > 0.5), (0, True)) if self.searched else wave**3
        return [gl.Eq(self.second * gl.der(self.x), gl.cos(5.0 * gl.time / self.second) + pulse)]


@pytest.mark.parametrize(("searched", "share"), [(False, 0.5), (True, 1 / 16)])
def test_the_longest_step_is_a_share_of_the_shortest_period(searched: bool, share: float) -> None:
    """A cube has a wave of three times the frequency; in a product, rates add up. Without what time drives, nothing limits the steps."""
    for f in (0.01, 2.0, 70.0):
        model = Functions(Driven(searched=searched))
        model.begun(f=f)
        (_, (found, *_)) = model.call(LONGEST_STEP)
        fastest = max(5.0, (1 if searched else 3) * 2 * np.pi * f)
        assert share * 2 * np.pi / (fastest + 5.0) <= found <= share * 2 * np.pi / fastest * (1 + 1e-12)
    still = Functions(Bound())
    still.begun()
    assert still.call(LONGEST_STEP)[1][0] == 1e300
