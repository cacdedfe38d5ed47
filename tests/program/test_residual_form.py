"""Residuals in place of solutions: those of equations by hand, torn and index-reduced."""

from __future__ import annotations

from functools import cache
from itertools import permutations
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SingularError
from gearlib.program.build import build
from gearlib.program.interpret import evaluate, prepare, regular
from gearlib.program.program import Batch
from gearlib.program.residual_form import index_reduced_form, torn_form

P, Q = 2.5, 1.5
U, V = 0.4, -0.9  # values of the inputs


class Torn(gl.Component):
    """``b`` by iteration, and ``c`` in sequence from it by a coefficient that is a parameter."""

    p = gl.Parameter("1", default=P)
    q = gl.Parameter("1", default=Q)
    rate = gl.Parameter("1/s", default=1.0)
    a = gl.Variable("1")
    b = gl.Variable("1")
    c = gl.Variable("1")
    u = gl.Input("1")
    v = gl.Input("1")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.a), self.rate * (self.b + self.c + self.v)),
            gl.Eq(self.p * self.c, self.a - self.b + self.u),
            gl.Eq(self.b**3 + self.b + self.q * self.c, 2 * self.a),
        ]


@cache
def torn() -> Any:
    return gl.compile(Torn()).translation


def values(form: Any, y: list[float], parameters: Any = None) -> Any:
    """Slots of a form's program at some unknowns (and rates)."""
    table = torn().model.parameters.values if parameters is None else parameters
    prepared, inputs = prepare(form.program, torn().structure, table), np.array([[U], [V]])
    return evaluate(prepared, np.zeros(1), np.array(y)[:, None], inputs, np.zeros((0, 1)))[:, 0]


def nodes() -> Any:
    """Of a, b and c."""
    return [(torn().model.variable(name), 0) for name in "abc"]


def test_a_tear_is_an_unknown_and_its_equation_a_residual() -> None:
    A, B, C = nodes()
    form = torn_form(torn().structure, torn().scene.program, torn().scene.relations, ())
    assert len(form.algebraic) == 1
    (tear,) = form.algebraic
    assert (form.unknowns, form.n_states, form.implicit, form.relations) == ((A, tear), 1, False, None)
    assert tear in (B, C)
    assert all(isinstance(step, Batch) for step in form.program.steps)  # nothing is iterated
    assert form.program.states == (A, tear)
    assert len(form.program.residuals) == 1
    for a, z in ((0.7, 0.3), (-1.2, 2.0), (0.0, 0.0)):
        slots = values(form, [a, z])
        rate, residual = slots[form.program.output_slots]
        b, c = (slots[form.program.slots[node]] for node in (B, C))
        assert rate == pytest.approx(b + c + V)
        left = [P * c - a + b - U, b**3 + b + Q * c - 2 * a]  # one of them is solved, and the other the residual
        assert (b if tear == B else c) == z
        assert sorted(np.abs(left)) == pytest.approx([0.0, abs(residual)], abs=1e-14)


def test_a_coefficient_that_is_divided_by_in_a_torn_form_must_not_vanish() -> None:
    form = torn_form(torn().structure, torn().scene.program, None, ())
    table = torn().model.parameters.values.copy()
    assert regular(form.program, table[:, None]).tolist() == [True]
    table[[torn().model.parameters.index[name] for name in "pq"]] = 0.0
    assert regular(form.program, table[:, None]).tolist() == [False]
    with pytest.raises(SingularError, match=r"^Torn: .* cannot be solved with [pq] = 0; division by zero"):
        values(form, [0.1, 0.2], table)


def test_every_equation_is_a_residual() -> None:
    """F(y, y') of all unknowns, at states and rates that fit nothing."""
    A, B, C = nodes()
    form = index_reduced_form(torn().structure, (A,), [C], (), False)
    assert (form.unknowns, form.n_states, form.implicit, form.relations) == ((A, B, C), 1, True, None)
    assert form.algebraic == (B, C)
    program = form.program
    assert program.states == (A, B, C, (A[0], 1))
    assert (program.outputs, program.pivots, len(program.residuals)) == ((), (), 3)
    for a, b, c, rate in ((0.7, 0.3, -0.2, 1.1), (-1.2, 2.0, 0.5, 0.0), (0.0, 0.0, 0.0, 0.3)):
        found = values(form, [a, b, c, rate])[list(program.residuals)]
        assert abs(found[0]) == pytest.approx(abs(rate - b - c - V))  # the first is that of the state's rate
        expected = [abs(P * c - a + b - U), abs(b**3 + b + Q * c - 2 * a)]
        assert sorted(np.abs(found[1:])) == pytest.approx(sorted(expected))


class Second(gl.Component):
    """A state whose derivative is a state."""

    x = gl.Variable("1")
    k = gl.Parameter("1/s2", default=4.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(gl.der(self.x)), -self.k * self.x)]


def test_a_state_whose_derivative_is_a_state() -> None:
    translation = gl.compile(Second()).translation
    x = translation.model.variable("x")
    states = translation.scene.states
    form = index_reduced_form(translation.structure, states, [], (), False)
    assert sorted(states) == [(x, 0), (x, 1)]
    assert (form.unknowns, form.n_states) == (states, 2)
    prepared, none = prepare(form.program, translation.structure, translation.model.parameters.values), np.zeros((0, 1))
    place = {node: i for i, node in enumerate(states)}
    y = np.zeros(4)
    y[place[x, 0]], y[place[x, 1]] = 0.3, -0.7  # x, v
    y[2 + place[x, 0]], y[2 + place[x, 1]] = 1.9, 5.0  # their rates
    slots = evaluate(prepared, np.zeros(1), y[:, None], none, none)[:, 0]
    found = slots[list(form.program.residuals)]
    assert found[place[x, 0]] == pytest.approx(1.9 + 0.7)
    assert abs(found[place[x, 1]]) == pytest.approx(5.0 + 4.0 * 0.3)


class Third(gl.Component):
    """Two states whose derivatives are states."""

    x = gl.Variable("1")
    k = gl.Parameter("1/s3", default=4.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(gl.der(gl.der(self.x))), -self.k * self.x)]


@pytest.mark.parametrize("order", [*permutations(range(3))], ids=str)
def test_states_whose_derivatives_are_states_in_any_order(order: tuple[int, ...]) -> None:
    translation = gl.compile(Third()).translation
    x = translation.model.variable("x")
    form = index_reduced_form(translation.structure, tuple((x, k) for k in order), [], (), False)
    assert (form.unknowns, form.n_states, form.algebraic) == (tuple((x, k) for k in order), 3, ())
    values, rates = {0: 0.3, 1: -0.7, 2: 1.1}, {0: 1.9, 1: 5.0, 2: -2.5}
    y = np.array([*(values[k] for k in order), *(rates[k] for k in order)])
    prepared, none = prepare(form.program, translation.structure, translation.model.parameters.values), np.zeros((0, 1))
    found = evaluate(prepared, np.zeros(1), y[:, None], none, none)[list(form.program.residuals), 0]
    expected = {0: 1.9 + 0.7, 1: 5.0 - 1.1, 2: -2.5 + 4.0 * 0.3}
    assert np.abs(found) == pytest.approx([abs(expected[k]) for k in order])
    assert form.program.n_slots == 9
    numbers = [e for step in form.program.steps if isinstance(step, Batch) for e in step.equations.tolist()]
    assert sorted(numbers) == [-1, -1, 0], "what is the same by definition is no equation of the model"


class Static(gl.Component):
    """No state: ``b`` by iteration, and ``c`` in sequence from it."""

    b, c = gl.Variable("1"), gl.Variable("1")
    u = gl.Input("1")
    p = gl.Parameter("1", default=P)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.p * self.c, self.u - self.b), gl.Eq(self.b**3 + self.b + self.c, 2 * self.u)]


def test_equations_without_states_are_torn_as_well() -> None:
    """The tear is all that is left to the integrator."""
    translation = gl.compile(Static(), outputs=["b", "c"]).translation
    model, structure = translation.model, translation.structure
    wanted = [(model.variable(name), 0) for name in "bc"]
    program = build(structure, wanted, (), dynamic=False)
    form = torn_form(structure, program, None, ())
    (tear,) = form.unknowns
    assert (form.n_states, form.algebraic, len(form.program.residuals)) == (0, (tear,), 1)
    assert all(isinstance(step, Batch) for step in form.program.steps)
    prepared = prepare(form.program, structure, model.parameters.values)
    slots = evaluate(prepared, np.zeros(1), np.array([[0.3]]), np.array([[U]]), np.zeros((0, 1)))[:, 0]
    b, c = (slots[form.program.slots[node]] for node in wanted)
    left = [P * c - U + b, b**3 + b + c - 2 * U]
    assert sorted(np.abs(left)) == pytest.approx([0.0, abs(slots[form.program.residuals[0]])], abs=1e-15)
