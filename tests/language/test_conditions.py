"""What is a condition and what is none, in `When` and elsewhere; actions that are none."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import pytest
import sympy

import gearlib as gl
from gearlib.errors import DeclarationError

NO_CONDITION: list[tuple[Callable[[Any], Any], str]] = [
    (lambda s: s.x - 0.5, r"is x - 0\.5, which is not a condition; expected a comparison"),
    (lambda s: 2.0, r"is 2\.0, which is not a condition"),
    (lambda s: s.n, r"is n, which is not a condition; compare it, as in n > 0 \(a discrete variable: gl\.holds"),
    (lambda s: s.x, r"is x, which is not a condition; compare it"),
    (lambda s: s.n & (s.x > 0.5), r"is n, which is not a condition"),
    (lambda s: sympy.And(s.x > 0.5, sympy.Not(s.n)), r"is n, which is not a condition"),
    (lambda s: None, "is None, which is not a condition"),
    (lambda s: "x > 0.5", "is 'x > 0.5', which is not a condition"),
    (lambda s: s.n == 2, r"the condition is False, and never becomes true; == compares at once, gl\.equals"),
    (lambda s: True, r"the condition is True, and never becomes true; .* gl\.initial\(\)"),
    (lambda s: s.p > 1.0, r"When\(p > 1\.0\): the condition holds parameters only, and never becomes true"),
]


def leaf(equations: Callable[[Any], list[Any]], start: float = 0.0) -> gl.Component:
    declared: dict[str, Any] = {"x": gl.Variable("1"), "n": gl.Discrete(start=start), "m": gl.Discrete()}
    declared |= {"p": gl.Parameter("1", default=2.0), "equations": lambda self: [gl.Eq(gl.der(self.x), 1.0), *equations(self)]}
    made: gl.Component = type("Leaf", (gl.Component,), declared)()
    return made


def counting(condition: Callable[[Any], Any]) -> gl.Component:
    return leaf(lambda s: [gl.When(condition(s), gl.Eq(s.n, gl.pre(s.n) + 1)), gl.Eq(s.m, 0)])


@pytest.mark.parametrize(("condition", "message"), NO_CONDITION)
def test_a_when_needs_a_condition(condition: Callable[[Any], Any], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        gl.compile(counting(condition))


def test_elsewhen_yields_to_what_becomes_true_at_the_same_instant() -> None:
    def equations(s: Any) -> list[Any]:
        third = gl.When(gl.time >= 0.6, gl.Eq(s.n, gl.pre(s.n) + 100))
        second = gl.When(s.x > 0.5, gl.Eq(s.n, gl.pre(s.n) + 10), gl.reinit(s.x, s.x + 2.0), elsewhen=third)
        return [gl.When(gl.time >= 0.25, gl.Eq(s.n, gl.pre(s.n) + 1), gl.Eq(s.m, 1), elsewhen=second)]

    result = gl.simulate(leaf(equations), 1.0, times=[0.0, 0.3, 0.55, 0.9])
    assert list(result["n"]) == [0, 1, 11, 111]
    assert list(result["m"]) == [0, 1, 1, 1]
    assert result["x"] == pytest.approx([0.0, 0.3, 2.55, 2.9])
    together = leaf(
        lambda s: [gl.When(s.x > 0.5, gl.Eq(s.n, 1), elsewhen=gl.When(s.x > 0.5 + 0 * s.p, gl.Eq(s.n, 2), gl.Eq(s.m, 1)))]
    )
    result = gl.simulate(together, 1.0, times=[0.0, 0.9])
    assert (result["n"][-1], result["m"][-1]) == (1, 0)


def test_elsewhen_is_another_when_and_assigns_each_variable_once() -> None:
    with pytest.raises(DeclarationError, match=r"elsewhen is 3; expected another gl\.When"):
        gl.When(gl.time > 1, elsewhen=3)  # type: ignore[arg-type]
    twice = leaf(lambda s: [gl.When(s.x > 1, gl.Eq(s.n, 1), gl.Eq(s.n, 2)), gl.Eq(s.m, 0)])
    with pytest.raises(DeclarationError, match="'n' has 2 equations; expected one"):
        gl.compile(twice)


@pytest.mark.parametrize(("condition", "message"), NO_CONDITION[2:6])
def test_a_branch_needs_a_condition(condition: Callable[[Any], Any], message: str) -> None:
    """Written with sympy's own functions, too."""
    for kind in (gl.Piecewise, sympy.Piecewise):
        model = leaf(
            lambda s, kind=kind: [gl.Eq(s.m, kind((1, condition(s)), (0, True))), gl.When(s.x > 2, gl.Eq(s.n, 1))]  # type: ignore[misc]
        )
        with pytest.raises(DeclarationError, match=message):
            gl.compile(model)


@pytest.mark.parametrize(
    "condition",
    [
        lambda s: s.x > 0.6, lambda s: gl.And(s.x > 0.6, s.p > 1.0), lambda s: gl.time >= 0.6, lambda s: gl.Not(s.x <= 0.6),
        lambda s: gl.Or(gl.holds(s.m), s.x > 0.6), lambda s: gl.And(gl.equals(s.m, 0), s.x > 0.6),
    ],
)  # fmt: skip
def test_a_condition_acts_once(condition: Callable[[Any], Any]) -> None:
    assert gl.simulate(counting(condition), 1.0, samples=3)["n"].tolist() == [0.0, 0.0, 1.0]


CONDITIONS: list[tuple[Callable[[Any], Any], Callable[[float], bool]]] = [  # at m = 1, p = 2, and how each is at x
    (lambda s: s.x > 0.4, lambda x: x > 0.4),
    (lambda s: s.x > s.p, lambda x: False),
    (lambda s: s.p > 1.0, lambda x: True),
    (lambda s: gl.time < 0.6, lambda x: x < 0.6),
    (lambda s: gl.And(s.x > 0.4, s.x < 0.6), lambda x: 0.4 < x < 0.6),
    (lambda s: gl.Or(s.x < 0.4, gl.Not(s.x < 0.6)), lambda x: not 0.4 <= x < 0.6),
    (lambda s: sympy.Xor(s.x > 0.4, s.x > 0.6), lambda x: 0.4 < x <= 0.6),
    (lambda s: gl.holds(s.m), lambda x: True),
    (lambda s: gl.Not(gl.holds(s.m)), lambda x: False),
    (lambda s: gl.equals(s.m, 1), lambda x: True),
    (lambda s: gl.no_event(s.x > 0.4), lambda x: x > 0.4),
    (lambda s: gl.Max(s.x, 0.2) > 0.4, lambda x: x > 0.4),
    (lambda s: abs(s.x - 0.5) > 0.1, lambda x: abs(x - 0.5) > 0.1),
    (lambda s: gl.sign(s.x - 0.4) > 0, lambda x: x > 0.4),
    (lambda s: gl.der(s.x) > 0.5, lambda x: True),
    (lambda s: True, lambda x: True),
    (lambda s: sympy.false, lambda x: False),
]


@cache
def with_conditions(where: str) -> gl.System:
    """A system with the conditions as numbers."""
    conditions = [condition for condition, _ in CONDITIONS]

    def equations(s: Any) -> list[Any]:
        found: list[Any] = [gl.Eq(gl.der(s.x), 1.0), gl.Eq(s.m, s.x > -1.0)]
        for k, condition in enumerate(conditions):
            y, v, value = getattr(s, f"y{k}"), getattr(s, f"v{k}"), condition(s)
            if where != "reinit":
                found.append(gl.Eq(gl.der(v), 0.0))
            if where in ("continuous", "reinit"):
                found.append(gl.Eq(y, 0))
            if where == "continuous":
                found[-2] = gl.Eq(v, value)
            elif where == "reinit":
                found += [gl.Eq(gl.der(v), 0.0), gl.When(gl.time >= s.at, gl.reinit(v, value))]
            elif where == "Eq":
                found.append(gl.Eq(y, value))
            else:
                new = value if where == "Eq in When" else gl.Piecewise((value, s.x > -2), (5.0, True))
                found.append(gl.When(gl.time >= s.at, gl.Eq(y, new)))
        return found

    declared: dict[str, Any] = {"x": gl.Variable("1", start=0.0), "m": gl.Discrete(), "p": gl.Parameter("1", default=2.0)}
    declared |= {"at": gl.Parameter("s", default=0.5)}
    declared |= {f"y{k}": gl.Discrete(start=-1.0) for k in range(len(conditions))}
    declared |= {f"v{k}": gl.Variable("1", guess=-1.0) for k in range(len(conditions))}
    return gl.compile(type("Leaf", (gl.Component,), declared | {"equations": equations})())


@pytest.mark.parametrize("at", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("where", ["Eq in When", "reinit", "Piecewise in When", "Eq", "continuous"])
def test_a_condition_is_a_number(where: str, at: float) -> None:
    """1 where it holds, 0 where it does not, wherever a value may stand."""
    name = "v" if where in ("continuous", "reinit") else "y"
    for method in ("rk", "ida"):
        result = with_conditions(where).simulate(at + 0.01, samples=2, method=method, parameters={"at": at})
        x = at + 0.01 if where in ("Eq", "continuous") else at
        expected = [float(holds(x)) for _, holds in CONDITIONS]
        assert [result[f"{name}{k}"][-1] for k in range(len(CONDITIONS))] == expected


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda s: gl.When(s.x > 1, None), "When.. is given None; expected gl.Eq"),
        (lambda s: gl.When(s.x > 1, [gl.reinit(s.x, 0)]), r"When\(\) is given \[Reinit"),
        (lambda s: gl.reinit(s.x, None), "the new value of x in reinit.. is None; expected a number or an expression"),
        (lambda s: gl.reinit(s.x, float("nan")), "the new value of x in reinit.. is nan; .* finite"),
        (lambda s: gl.reinit(2.0, 1.0), r"reinit\(\) is given 2\.0; expected a state, such as self\.w"),
        (lambda s: gl.reinit(s.x**2, 1.0), "expected a state"),
        (lambda s: gl.holds(s.x > 1), "argument of holds.. is x > 1; .*a condition is not a number"),
        (lambda s: gl.holds(None), "argument of holds.. is None"),
        (lambda s: gl.equals(s.x > 1, True), "variable of equals.. is x > 1"),
        (lambda s: gl.equals(s.n, float("nan")), "value of equals.. is nan"),
        (lambda s: gl.equals(s.n, [1]), r"value of equals.. is \[1\]"),
        (lambda s: gl.no_event([1]), r"argument of no_event.. is \[1\]"),
        (lambda s: gl.settled([1]), r"argument of settled.. is \[1\]"),
        (lambda s: gl.der(s.x > 1), "argument of der.. is x > 1"),
        (lambda s: gl.sin(10**400), "argument of sin.. is 1000"),
        (lambda s: gl.Piecewise(), "Piecewise.. is given nothing"),
        (lambda s: gl.Piecewise(1), r"Piecewise.. is given 1; expected \(value, condition\)"),
        (lambda s: gl.Piecewise((1, s.n == 2), (0, True)), "condition of 1 is False; == compares at once"),
        (lambda s: gl.Max(), "Max.. is given nothing"),
    ],
)
def test_no_expression(make: Callable[[Any], Any], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        make(leaf(lambda s: []))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: gl.Discrete(start=float("nan")), "Discrete: start is nan; expected a finite number"),
        (lambda: gl.Discrete(start="on"), "Discrete: start is 'on'"),
        (lambda: gl.Parameter(min="0"), "Parameter: min is '0'"),
        (lambda: gl.Parameter(min=float("nan")), "Parameter: min is nan"),
        (lambda: gl.Parameter(min=2, max=1), "Parameter: min is 2, above max, which is 1"),
        (lambda: gl.Parameter(default="3"), "Parameter: default is '3'"),
        (lambda: gl.Input(default=[1]), r"Input: default is \[1\]"),
        (lambda: gl.Variable(start=10**400), "Variable: start is 1000"),
        (lambda: gl.Variable(guess="a"), "Variable: guess is 'a'"),
        (lambda: gl.Derivative(3), "Derivative: of is 3; expected text"),
        (lambda: gl.Structural(1, choices=2), "Structural: choices is 2; expected a tuple"),
    ],
)
def test_a_declaration_takes_numbers_only(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        make()


def test_an_instance_cannot_start_a_discrete_variable_at_nan() -> None:
    kind = type(counting(lambda s: s.x > 0.5))
    for wrong in (float("nan"), "on", None, 10**400):
        with pytest.raises(gl.GearlibError, match=r"start\(n\)"):
            gl.compile(kind(start={"n": wrong}))
    assert gl.simulate(kind(start={"n": 2}), 1.0, samples=2)["n"].tolist() == [2.0, 3.0]


def test_a_new_value_that_is_given_by_itself_points_to_pre() -> None:
    model = leaf(lambda s: [gl.When(s.x > 0.5, gl.Eq(s.n, s.n + 1)), gl.Eq(s.m, 0)])
    with pytest.raises(DeclarationError, match=r"n = n \+ 1 in When: .*the value before the event is gl\.pre\(self\.n\)"):
        gl.compile(model)


def test_an_expression_that_is_nested_too_deeply() -> None:
    def deep(s: Any) -> list[Any]:
        law = s.x
        for _ in range(1000):
            law = gl.sin(law) + 1
        return [gl.Eq(s.n, 0), gl.Eq(s.m, law)]

    with pytest.raises(DeclarationError, match="nested too deeply"):
        gl.compile(leaf(deep))


def test_numbers_that_no_computer_holds_are_refused() -> None:
    with pytest.raises(DeclarationError, match=r"holds 1000.*too large"):
        gl.compile(leaf(lambda s: [gl.Eq(s.n, 10**400 * s.x), gl.Eq(s.m, 0)]))


def test_the_start_in_an_equation_of_a_model_without_discrete_variables_is_refused() -> None:
    class Law(gl.Component):
        x = gl.Variable("1", start=1.0)
        y = gl.Variable("1")

        def equations(self) -> list[Any]:
            return [gl.Eq(gl.der(self.x), 0), gl.Eq(self.y, gl.Piecewise((self.x, gl.initial()), (0, True)))]

    with pytest.raises(
        DeclarationError, match=r"Law.*gl\.initial\(\) stands in an equation of a model without discrete variables"
    ):
        gl.compile(Law())
