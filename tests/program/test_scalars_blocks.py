"""Derivatives through several constant blocks as one function, against the arrays and by hand."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.derivative_plan import derivative_plan, state_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import solutions_of_runs
from gearlib.program.program import Linear
from gearlib.program.scalars import linear_function
from tests.program.programs import point


class Blocks(gl.Component):
    """Two equations, then three that need what the first two give, and then two again; and copies with either sign."""

    x, y, v, w = (gl.Variable("1") for _ in range(4))
    a0, a1, b0, b1, b2, c0, c1 = (gl.Variable("1") for _ in range(7))
    u = gl.Input("1")
    rate = gl.Parameter("1/s", default=1.0)
    p, q, s = gl.Parameter("1", default=3.0), gl.Parameter("1", default=-0.5), gl.Parameter("1", default=2.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * (self.b0 - self.v)),
            gl.Eq(gl.der(self.y), self.rate * (self.c0 + 2 * self.c1 + self.w)),
            gl.Eq(self.v, self.p * self.x - self.y), gl.Eq(self.w, -self.u),
            gl.Eq(self.p * self.a0 + self.a1, self.x), gl.Eq(self.a0 - self.q * self.a1, 0),
            gl.Eq(self.b0 + self.q * self.b1 + self.b2, self.a0), gl.Eq(self.s * self.b0 - self.b1, self.y - 3 * self.u),
            gl.Eq(self.b1 + self.p * self.b2, self.a0 - self.a1),
            gl.Eq(self.c0 + self.p * self.q * self.c1, self.b2), gl.Eq(self.s * self.c0 - self.c1, self.v + self.b1),
        ]  # fmt: skip


@cache
def blocks() -> Any:
    return gl.compile(Blocks(), outputs=["x", "y", "c1", "w"]).translation


def by_hand(p: float, q: float, s: float) -> tuple[Any, Any]:
    """Rates of x and y as a matrix of x, y and u; and all unknowns as one."""
    names = ["v", "w", "a0", "a1", "b0", "b1", "b2", "c0", "c1"]
    left, right, at = np.zeros((9, 9)), np.zeros((9, 3)), {name: i for i, name in enumerate(names)}
    rows: list[tuple[dict[str, float], list[float]]] = [
        ({"v": 1}, [p, -1, 0]), ({"w": 1}, [0, 0, -1]), ({"a0": p, "a1": 1}, [1, 0, 0]), ({"a0": 1, "a1": -q}, [0, 0, 0]),
        ({"b0": 1, "b1": q, "b2": 1, "a0": -1}, [0, 0, 0]), ({"b0": s, "b1": -1}, [0, 1, -3]),
        ({"b1": 1, "b2": p, "a0": -1, "a1": 1}, [0, 0, 0]), ({"c0": 1, "c1": p * q, "b2": -1}, [0, 0, 0]),
        ({"c0": s, "c1": -1, "v": -1, "b1": -1}, [0, 0, 0]),
    ]  # fmt: skip
    for i, (entries_, known) in enumerate(rows):
        for name, value in entries_.items():
            left[i, at[name]] = value
        right[i] = known
    z = np.linalg.solve(left, right)
    rates = np.stack([z[at["b0"]] - z[at["v"]], z[at["c0"]] + 2 * z[at["c1"]] + z[at["w"]]])
    return rates, {name: z[i] for name, i in at.items()}


@pytest.mark.parametrize("values", [{}, {"p": 1.7, "s": -4.0}, {"q": 0.25}], ids=str)
def test_derivatives_through_blocks_that_follow_each_other(values: dict[str, float]) -> None:
    translation = blocks()
    scene, model = translation.scene, translation.model
    program, numbers = scene.program, scene.numbers(translation.parameter_values(values))
    assert sorted(len(step.unknowns) for step in program.steps if isinstance(step, Linear)) == [2, 2, 3]
    given = {"p": 3.0, "q": -0.5, "s": 2.0} | values
    rates, unknowns = by_hand(given["p"], given["q"], given["s"])
    order = [["x", "y"].index(name) for name in scene.state_names]
    columns = [*order, 2]
    everything = derivative_plan(program, [(i, i) for i in range(3)])
    at = At(numbers, np.zeros(1), np.zeros((program.n_slots, 1)), np.zeros((1, 1)))
    for plan in (everything, state_plan(program), derivative_plan(program, [(2, 0)], program.output_slots)):
        function = linear_function(program, plan)
        assert function is not None
        found = function(numbers.parameters.tolist(), numbers.listed)
        np.testing.assert_allclose(found, entries(plan, at)[:, 0], rtol=1e-13, atol=1e-14)
    function = linear_function(program, everything)
    assert function is not None
    values_ = np.array(function(numbers.parameters.tolist(), numbers.listed))
    whole = dense(everything, values_[:, None])[0]
    np.testing.assert_allclose(whole[program.output_slots], rates[order][:, columns], rtol=1e-12, atol=1e-13)
    met = 0
    for name, expected in unknowns.items():
        slot = program.slots.get((int(model.representative[model.variable(name)]), 0))
        if slot is not None:
            sign = int(model.sign[model.variable(name)])
            np.testing.assert_allclose(sign * whole[slot], expected[columns], rtol=1e-12, atol=1e-13)
            met += 1
    assert met > 5


def test_what_enters_at_an_unknown_of_a_block() -> None:
    """It moves what follows, and none of the unknowns beside it."""
    scene = blocks().scene
    program, numbers = scene.program, scene.numbers(blocks().parameter_values({}))
    at = At(numbers, np.zeros(1), np.zeros((program.n_slots, 1)), np.zeros((1, 1)))
    for step in program.linear_blocks:
        for unknown in step.unknowns.tolist():
            plan = derivative_plan(program, [(unknown, 0)])
            function = linear_function(program, plan)
            assert function is not None
            found = np.array(function(numbers.parameters.tolist(), numbers.listed))
            np.testing.assert_allclose(found, entries(plan, at)[:, 0], rtol=1e-13, atol=1e-14)
            whole = dense(plan, found[:, None])[0, :, 0]
            assert whole[step.unknowns].tolist() == (step.unknowns == unknown).astype(float).tolist()


@pytest.mark.parametrize("values", [(1.5,), (1.5, -0.7), (1.5, -0.7, 2.5, 4.0), (2.5, 2.5)], ids=str)
@pytest.mark.parametrize("varied", ["p", "q", "s", "rate"])
def test_blocks_of_many_runs_are_those_of_each(varied: str, values: tuple[float, ...]) -> None:
    """Some entries of a matrix are numbers, some vary, some are the same in all runs."""
    translation = blocks()
    tables = [translation.parameter_values({varied: value}) for value in values]
    found, solved = solutions_of_runs(translation.scene.program, np.stack(tables, axis=1))
    assert solved.tolist() == [True] * len(values)
    for k, table in enumerate(tables):
        for one, alone in zip(found, translation.scene.numbers(table).solutions, strict=True):
            assert one.shape == (len(values), *alone.shape)
            np.testing.assert_allclose(one[k], alone, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("varied", ["p", "q", "s", "rate"])
def test_a_matrix_that_varies_is_left_to_the_arrays(varied: str) -> None:
    """Also one whose unknowns are not wanted; a parameter of rates alone is none of its entries."""
    program, index = blocks().scene.program, blocks().model.parameters.index
    plan = derivative_plan(program, [(0, 0), (program.n_slots + index[varied], 1)])
    assert (linear_function(program, plan) is None) == (varied != "rate")
    newton = point("loop").program
    assert linear_function(newton, state_plan(newton)) is None
