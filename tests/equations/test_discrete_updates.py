"""Equations of a class taken apart: continuous ones, updates at events, hidden discrete variables."""

from __future__ import annotations

from typing import Any

import pytest
import sympy

import gearlib as gl
from gearlib.equations.discrete_updates import Update, split_equations
from gearlib.equations.kernel import array_function
from gearlib.errors import DeclarationError
from gearlib.language.declarations import Discrete

x, n, m, p = sympy.symbols("x n m p", real=True)


def split(*equations: Any) -> tuple[list[gl.Eq], tuple[Update, ...], dict[str, Discrete]]:
    discretes = {"n": Discrete("count"), "m": Discrete("another")}
    return split_equations("Part", equations, discretes, lambda name: name == "p", {"x": gl.Variable("1")})


def test_each_discrete_variable_and_each_reinit_has_one_update() -> None:
    flow = gl.Eq(gl.der(x), p)
    actions = gl.Eq(n, gl.pre(n) + 1), gl.reinit(x, 0), gl.reinit(x, 1)
    continuous, updates, known = split(flow, gl.When(x > 1, *actions), gl.Eq(m, n))
    assert continuous == [flow]
    assert sorted((u.target, u.reinit) for u in updates) == [("m", False), ("n", False), ("when_0", False), ("x", True)]
    assert set(known) == {"n", "m", "when_0"}
    assert known["when_0"].start == 1.0  # a condition that holds at the start does not become true


def test_what_becomes_true_at_the_start_is_false_before() -> None:
    _, updates, known = split(gl.When(gl.initial(), gl.Eq(n, 2)), gl.When(gl.sample(p), gl.Eq(m, x)))
    assert [known[name].start for name in ("when_0", "when_1")] == [0.0, 0.0]
    assert {u.target for u in updates} == set(known) == {"n", "m", "when_0", "when_1", "sample_0", "sample_0_before"}


@pytest.mark.parametrize(
    ("equations", "message"),
    [
        ([gl.Eq(n, 1)], "'m' has 0 equations; expected one"),
        ([gl.Eq(n, 1), gl.Eq(m, 0), gl.Eq(n, 2)], "'n' has 2 equations; expected one"),
        ([gl.Eq(n, 1), gl.When(x > 1, gl.Eq(m, 1)), gl.When(x > 2, gl.Eq(m, 2))], "'m' has 2 equations; expected one"),
        ([gl.Eq(n, 1), gl.When(x > 1, gl.Eq(m, 1), gl.Eq(m, 2))], "'m' has 2 equations; expected one"),
        ([gl.When(x > 1, gl.reinit(p, 1))], r"reinit\(p\): no variable of the class"),
        ([gl.When(x > 1, gl.Eq(n, n + 1))], r"the new value is given by itself; .* is gl\.pre\(self\.n\)"),
        ([gl.When(x > 1, gl.Eq(x, 1))], r"in When: expected gl\.Eq\(discrete variable, \.\.\.\) or gl\.reinit"),
        ([gl.When(p > 1, gl.Eq(n, 1))], r"the condition holds parameters only, and never becomes true"),
        ([gl.When(gl.initial(), gl.reinit(x, 1))], r"reinit in a When of gl\.initial\(\)"),
        ([gl.When(gl.sample(x, m), gl.Eq(n, 1))], r"gl\.sample\(x, m\) depends on m; its instants"),
        ([gl.When(gl.sample(x), gl.Eq(n, 1))], r"depends on x; its instants are given by numbers and parameters"),
    ],
)  # fmt: skip
def test_what_is_refused(equations: list[Any], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        split(*equations)


class Machine:
    """Updates of a class evaluated by hand: each event with the values before it, until nothing changes."""

    def __init__(self, *equations: Any) -> None:
        _, self.updates, self.known = split(*equations)
        self.values = {name: discrete.start for name, discrete in self.known.items()}

    def value(self, update: Update, point: dict[str, float]) -> float:
        template = update.template

        def evaluate(expression: Any) -> float:
            symbols = sorted(expression.free_symbols, key=str)
            return float(array_function(symbols, expression)(*(point[symbol.name] for symbol in symbols)))

        for k, relation in enumerate(template.relations):
            g = evaluate(relation.g)
            point[f"relation({k})"] = float((g < 0 if relation.negated else g > 0) or (g == 0 and not relation.strict))
        return evaluate(template.residual)

    def event(self, initial: bool = False, **point: float) -> dict[str, float]:
        """The values of all discrete variables after an event, and the new values of states."""
        point = {"x": 0.0, "p": 2.0, "time": 0.0, "initial()": float(initial), **point}
        before = {f"pre({name})": value for name, value in self.values.items()}
        for _ in range(5):
            for update in self.updates:
                if not update.reinit:
                    self.values[update.target] = self.value(update, {**point, **before, **self.values})
        return self.values | {u.target: self.value(u, {**point, **before, **self.values}) for u in self.updates if u.reinit}


def test_actions_are_taken_once_when_a_condition_becomes_true() -> None:
    machine = Machine(gl.When(x > 1, gl.Eq(n, gl.pre(n) + 1), gl.reinit(x, p * x)), gl.Eq(m, 2 * n))
    seen = [machine.event(x=at) for at in (3.0, 0.0, 2.0, 2.5, 0.5, 1.5)]
    assert [found["n"] for found in seen] == [0, 0, 1, 1, 1, 2], "what holds at the start has not become true"
    assert [found["m"] for found in seen] == [0, 0, 2, 2, 2, 4]
    assert [found["x"] for found in seen] == [3.0, 0.0, 4.0, 2.5, 0.5, 3.0]


def test_the_first_of_several_branches_goes_before() -> None:
    second = gl.When(x > p, gl.Eq(n, 2), gl.reinit(x, -2), elsewhen=gl.When(x < 0, gl.Eq(n, 3)))
    machine = Machine(gl.When(x > 1, gl.Eq(n, 1), gl.reinit(x, -1), elsewhen=second), gl.Eq(m, 0))
    seen = [
        machine.event(x=at, p=limit)
        for at, limit in ((0.5, 2), (3, 2), (0.5, 2), (1.5, 2), (2.5, 2), (-1, 2), (0.5, 2), (0.5, 0.2))
    ]
    assert [found["n"] for found in seen] == [0, 1, 1, 1, 2, 3, 3, 2]
    assert [found["x"] for found in seen] == [0.5, -1, 0.5, -1, -2, -1, 0.5, -2]


def test_several_reinits_of_one_state_are_one_update_in_order() -> None:
    machine = Machine(gl.When(x > 1, gl.reinit(x, 10)), gl.When(x > 2, gl.reinit(x, 20)), gl.Eq(n, 0), gl.Eq(m, 0))
    assert [machine.event(x=at)["x"] for at in (0.0, 1.5, 2.5, 0.0, 3.0)] == [0.0, 10.0, 20.0, 0.0, 10.0]


def test_the_start_of_a_run() -> None:
    machine = Machine(gl.When(gl.initial(), gl.Eq(n, 5)), gl.Eq(m, gl.pre(m) + 1))
    assert machine.event(initial=True)["n"] == 5
    assert machine.event()["n"] == 5


@pytest.mark.parametrize(
    ("start", "counts"),
    [
        (0.0, [0, 1, 1, 2, 2, 3]),
        (0.1, [1, 1, 1, 2, 2, 3]),
        (0.2, [0, 0, 0, 1, 1, 2]),
        (0.6, [1, 1, 1, 1, 1, 2]),
        (0.7, [0, 0, 0, 0, 0, 1]),
        (1.1, [1, 1, 1, 1, 1, 1]),
    ],
)
def test_samples_are_taken_at_their_instants_and_at_a_start_that_is_one(start: float, counts: list[int]) -> None:
    """An event is evaluated at a time slightly after it."""
    machine = Machine(gl.When(gl.sample(0.5, 0.1), gl.Eq(n, gl.pre(n) + 1)), gl.Eq(m, 0))
    found = []
    for k, at in enumerate((start, 0.1, 0.3, 0.6, 0.9, 1.1)):
        late = max(at, start) * (1 + 1e-12)
        found.append(machine.event(initial=k == 0, time=late)["n"])
    assert found == counts


def test_hidden_variables_take_no_name_of_the_class() -> None:
    """Nor one whose value before an event would have a name of the class."""
    own = {"when_0": gl.Variable("1"), "sample_1_before": gl.Variable("1")}
    discretes = {name: Discrete("own") for name in ("n", "m", "when_2")}
    equations = [gl.When(x > 1, gl.Eq(n, 1)), gl.When(gl.sample(0.5), gl.Eq(m, 1)), gl.Eq(sympy.Symbol("when_2", real=True), m)]
    _, updates, known = split_equations("Part", equations, discretes, lambda name: name in ("when_1", "sample_0"), own)
    assert sorted(known) == ["m", "n", "sample_2", "sample_2_before", "when_2", "when_3", "when_4"]
    assert sorted(u.target for u in updates) == sorted(known)


def test_names_of_hidden_variables_are_counted() -> None:
    every = gl.When(gl.sample(0.5), gl.Eq(m, 1)), gl.When(gl.sample(p, 1), gl.reinit(x, 2))
    _, updates, known = split(gl.When(x > 1, gl.Eq(n, 1)), gl.When(x > 2, gl.reinit(x, 1)), *every)
    hidden = [f"when_{k}" for k in range(4)] + [f"sample_{k}{end}" for k in range(2) for end in ("", "_before")]
    assert sorted(known) == sorted(["n", "m", *hidden])
    assert len(updates) == len(known) + 1
    once = split(gl.When(gl.sample(0.5), gl.Eq(n, 1)), gl.When(gl.sample(0.5), gl.Eq(m, 1)))[2]
    assert [name for name in once if name.startswith("sample")] == ["sample_0", "sample_0_before"], (
        "two of the same instants share them"
    )


def test_what_is_discrete_in_an_update() -> None:
    """The value of a variable before an event is no discrete variable, and only whole names count."""
    _, updates, _ = split(gl.Eq(n, gl.pre(x) + sympy.Symbol("rateny", real=True)), gl.Eq(m, gl.pre(n) * gl.pre(m) + n))
    assert [(u.target, u.template.discretes) for u in updates] == [("n", ()), ("m", ("n", "pre(m)", "pre(n)"))]
    assert updates[0].template.locals == ("pre(x)", "rateny")
