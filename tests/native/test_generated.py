"""What generated source computes, carried out by Python, against the interpreter: however a program is written."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.native.jacobian import inverted_blocks, jacobian_body, pattern_of, tangent_body
from gearlib.native.layout import Shared, fill, lay_out
from gearlib.native.linear_solve import SOLVE
from gearlib.native.source import Body, function, is_small, looped, written_out
from gearlib.program.derivative_plan import TIME, derivative_plan, state_plan
from gearlib.program.derivatives import At, dense, entries
from gearlib.program.interpret import block_solve, evaluate
from gearlib.program.program import Batch, Linear, Newton
from tests.compiler.test_translate import Chain, by_python
from tests.program.programs import KINDS, Point, point

SETTINGS = {
    "statements": {"LONGEST": 1000},
    "loops": {"LONGEST": 0},
    "loops over kinds of loops": {"LONGEST": 0, "MOST_LOOPS": 0},
    "signs from arrays": {"LONGEST": 0, "MOST_SIGNS": 0},
}


class Quotients(gl.Component):
    """Divisors that move, with parameters in them, and a state that nothing of the others reaches."""

    p, q = gl.Parameter("1", default=2.0), gl.Parameter("1", default=0.5)
    rate = gl.Parameter("1/s", default=1.5)
    x, z, s, y, v = (gl.Variable("1") for _ in range(5))

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(self.y * (self.p + self.q * self.x), self.z), gl.Eq(self.v * self.x, self.p * self.y),
            gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(gl.der(self.z), self.rate * (self.v - self.p)),
            gl.Eq(gl.der(self.s), self.rate * gl.time),
        ]  # fmt: skip


class Blocks(gl.Component):
    """Two linear blocks, the second of which needs the first."""

    p, q = gl.Parameter("1", default=2.0), gl.Parameter("1", default=0.5)
    rate = gl.Parameter("1/s", default=1.5)
    x, y, a, b, c, d, e = (gl.Variable("1") for _ in range(7))

    def equations(self) -> list[gl.Eq]:
        a, b, c, d, e = self.a, self.b, self.c, self.d, self.e
        return [
            gl.Eq(gl.der(self.x), self.rate * (a - 2 * e)), gl.Eq(gl.der(self.y), self.rate * (d + b)),
            gl.Eq(a + self.p * b, self.x), gl.Eq(self.q * a - b, self.y + self.rate * gl.time),
            gl.Eq(c - self.q * d, b), gl.Eq(c + d + self.p * e, self.x + a), gl.Eq(d - 3 * e + c, 1.0),
        ]  # fmt: skip


class Varying(gl.Component):
    """A linear block whose matrix varies."""

    p, rate = gl.Parameter("1", default=2.0), gl.Parameter("1/s", default=1.5)
    x, a, b = (gl.Variable("1") for _ in range(3))

    def equations(self) -> list[gl.Eq]:
        a, b, x = self.a, self.b, self.x
        return [gl.Eq(gl.der(x), self.rate * (a - b)), gl.Eq(a + x * b, self.p), gl.Eq(x * a - 3 * b, 1.0)]


MORE = {"quotients": Quotients, "blocks": Blocks, "varying": Varying, "chain": lambda: Chain(n=12)}


@cache
def at_point(kind: str) -> Point:
    if kind not in MORE:
        return point(kind)
    translation = gl.compile(MORE[kind]()).translation
    scene, t = translation.scene, np.array([0.3, 1.7])
    numbers = scene.numbers(translation.parameter_values({}))
    x, none = np.random.default_rng(5).uniform(0.3, 1.0, (len(scene.states), 2)), np.zeros((0, 2))
    return Point(scene, numbers, t, evaluate(numbers, t, x, none, none), none)


class Carried:
    """A function of a scene on a block of data of its own, at one of the two times of a point."""

    def __init__(self, p: Point, which: int, before: float = 1.01) -> None:
        self.p, self.which, self.before = p, which, before  # times the slots, those of the evaluation before
        program, model = p.program, p.scene.model
        self.shared = Shared(len(model.parameters.names), p.scene.n_discrete, len(program.inputs))
        self.states = p.slots[: len(program.states), which]

    def __call__(
        self, name: str, arguments: list[str], body: Body, layout: Any, x: Any, size: int, end: int, numbers: Any = ()
    ) -> Any:
        p, shared, n = self.p, self.shared, len(self.p.program.states)
        data = np.full(end + 3, np.nan)
        data[layout.slots :] = 1e-3  # nothing is taken for zero before it is written
        data[layout.guards :] = 0.0
        data[layout.scratch : layout.guards] = 0.0
        for matrix in layout.kept:
            if matrix is not None:
                data[matrix.place : matrix.place + matrix.size] = 0.0
        data[layout.slots : layout.scratch] = p.slots[:, self.which] * self.before
        data[: shared.n_parameters] = p.numbers.parameters
        data[shared.relations : shared.inputs] = p.flags[:, self.which]
        data[shared.inputs : shared.size] = p.slots[n : n + shared.n_inputs, self.which]
        fill(data, layout, body.coefficients, p.numbers)
        for at, values in numbers:
            data[at : at + len(values)] = values
        index = np.concatenate([np.array([5, 0, 0, 0, 0], np.int64), body.packed(5)])
        out = np.full(size + 1, np.nan)
        before = data.copy()
        source = SOLVE + function(name, arguments, body, 0)
        assert by_python(source, name, float(p.t[self.which]), np.array(x), out, data, index) == 0
        assert np.isnan(out[-1])
        for first, last in (
            (0, shared.size),
            (layout.size, layout.size + body.n_coefficients),
            *((a, a + len(v)) for a, v in numbers),
        ):
            assert data[first:last].tolist() == before[first:last].tolist()
        return out[:-1]


def close(found: Any, expected: Any, size: Any = 0.0) -> None:
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-10 * float(np.abs(expected).max(initial=1e-3) + size))


@pytest.fixture(params=SETTINGS)
def setting(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    for name, value in SETTINGS[request.param].items():
        monkeypatch.setattr(f"gearlib.native.source.{name}", value)
    return str(request.param)


kinds = pytest.mark.parametrize("kind", [*KINDS, *MORE])


@kinds
@pytest.mark.usefixtures("setting")
def test_rates(kind: str) -> None:
    p = at_point(kind)
    for which, keep, guarded in itertools.product(range(2), (False, True), (False, True)):
        own = Carried(p, which)
        layout = lay_out(p.program, own.shared, own.shared.size, keep=keep)
        body = looped(p.program, layout, guarded)
        end = layout.size + body.n_coefficients
        found = own("rhs", ["x", "dx", "data", "index"], body, layout, own.states, len(own.states), end)
        close(found, p.slots[p.program.output_slots, which])


def test_values_before_cost_a_linear_block_no_digits() -> None:
    """However large they were: it is solved again from a solution that is smaller by six orders of magnitude."""
    p = at_point("varying")
    assert [step.linear for step in p.program.steps if isinstance(step, Newton)] == [True]
    x = p.slots[0]
    a, b = (2.0 * 3.0 + x) / (3.0 + x**2), (2.0 * x - 1.0) / (3.0 + x**2)
    for which, before in itertools.product(range(2), (0.0, 1.0, 1e5, 1e9, 1e15, -1e15)):
        own = Carried(p, which, before)
        layout = lay_out(p.program, own.shared, own.shared.size, keep=False)
        body = looped(p.program, layout, guarded=False)
        (rate,) = own("rhs", ["x", "dx", "data", "index"], body, layout, own.states, 1, layout.size + body.n_coefficients)
        assert rate == pytest.approx(1.5 * (a - b)[which], rel=1e-9)


@kinds
def test_rates_that_are_written_out(kind: str) -> None:
    p = at_point(kind)
    assert is_small(p.program) == (not any(isinstance(step, Newton) for step in p.program.steps))
    for which in range(2 if is_small(p.program) else 0):
        own = Carried(p, which)
        layout = lay_out(p.program, own.shared, own.shared.size)
        names = {slot: f"slot_{slot}" for slot in range(p.program.n_slots)}
        body = written_out(p.program, layout, names, p.scene.model.parameters.names)
        found = own("rhs", ["x", "dx", "data", "index"], body, layout, own.states, len(own.states), layout.size)
        close(found, p.slots[p.program.output_slots, which])


@kinds
@pytest.mark.usefixtures("setting")
def test_jacobian(kind: str) -> None:
    """With the copies of two tangents."""
    p, tangents = at_point(kind), 2
    plan = state_plan(p.program)
    expected = dense(plan, entries(plan, At(p.numbers, p.t, p.slots, p.flags)))
    pattern, n = pattern_of(plan, tangents), len(p.program.states)
    which = 1
    own = Carried(p, which)
    layout = lay_out(p.program, own.shared, own.shared.size, plan.multiplied)
    body, end = jacobian_body(p.program, layout, plan, tangents)
    found = own("jac", ["x", "values", "data", "index"], body, layout, own.states, len(pattern.indices), end)
    matrix = np.zeros((n * (1 + tangents),) * 2)
    matrix[pattern.indices, np.repeat(np.arange(len(matrix)), np.diff(pattern.indptr))] = found
    close(matrix[:n, :n], expected[which])
    for copy in range(tangents):
        place = n + np.arange(n) * tangents + copy
        close(matrix[np.ix_(place, place)], expected[which])


@kinds
@pytest.mark.usefixtures("setting")
def test_derivatives_by_what_is_computed(kind: str) -> None:
    """Seeds that enter at computed slots, of blocks too, at parameters and at time, some of them together."""
    p = at_point(kind)
    program, n = p.program, len(p.program.states)
    blocks = [int(u) for step in program.steps if not isinstance(step, Batch) for u in step.unknowns[:2]]
    used = sorted({int(q) for batch in p.batches for q in batch.parameters.ravel()})[:2]
    places = [0, *blocks, int(program.output_slots[-1]), *(program.n_slots + q for q in used), TIME]
    seeds = [*((place, k) for k, place in enumerate(places)), (n - 1, len(places)), (places[-2], len(places))]
    plan = derivative_plan(program, seeds, program.output_slots)
    expected, pattern = dense(plan, entries(plan, At(p.numbers, p.t, p.slots, p.flags))), pattern_of(plan)
    which = 1
    own = Carried(p, which)
    layout = lay_out(program, own.shared, own.shared.size, plan.multiplied)
    body, end = jacobian_body(program, layout, plan)
    found = own("jac", ["x", "values", "data", "index"], body, layout, own.states, len(pattern.indices), end)
    matrix = np.zeros(plan.shape)
    matrix[pattern.indices, np.repeat(np.arange(plan.n_seeds), np.diff(pattern.indptr))] = found
    close(matrix, expected[which])


@kinds
@pytest.mark.usefixtures("setting")
def test_tangents(kind: str) -> None:
    """Directions at the states and at all parameters that are used: products with the derivatives by both."""
    p, count = at_point(kind), 3
    n, n_slots = len(p.program.states), p.program.n_slots
    used = sorted({int(q) for batch in p.batches for q in batch.parameters.ravel()})
    rng, outputs = np.random.default_rng(count), p.program.output_slots
    whole = derivative_plan(p.program, [(k, k) for k in range(n)] + [(n_slots + q, n + i) for i, q in enumerate(used)], outputs)
    matrices = dense(whole, entries(whole, At(p.numbers, p.t, p.slots, p.flags)))
    seeds = [(i, k) for i in range(n) for k in range(count)] + [(n_slots + q, k) for q in used for k in range(count)]
    plan = derivative_plan(p.program, seeds, outputs, count)
    tangents, weights = rng.normal(size=(n, count)), rng.normal(size=(len(used), count))
    which = 1
    own = Carried(p, which)
    layout = lay_out(p.program, own.shared, own.shared.size, plan.multiplied, keep=True)
    body, at, end = tangent_body(p.program, layout, plan)
    order = [k - n * count for k in plan.order.tolist() if k >= n * count]
    inverses = [np.empty(0)]
    for step, equations in inverted_blocks(plan):
        assert isinstance(step.step, Linear)
        right = np.eye(len(step.step.unknowns))[:, equations]
        inverses.append(block_solve(p.numbers, step.block, right)[step.rows].ravel())
    numbers = [(at, weights.ravel()[order]), (at + len(order), np.concatenate(inverses))]
    assert end >= sum(map(len, (order, *inverses)), at), "they lie before what other functions keep"
    x = np.concatenate([own.states, tangents.ravel()])
    found = own("rhs", ["x", "dx", "data", "index"], body, layout, x, len(x), end, numbers)
    close(found[:n], p.slots[outputs, which])
    expected = matrices[which][:, :n] @ tangents + matrices[which][:, n:] @ weights
    close(found[n:].reshape(n, count), expected, np.abs(matrices[which]).max())
