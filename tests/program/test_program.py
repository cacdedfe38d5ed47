"""Batches: their derivatives against differences, their parts and rows, and what programs tell of themselves."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.derivatives import At
from gearlib.program.interpret import batch_values
from gearlib.program.program import Batch, Linear, Newton
from tests.program.programs import KINDS, Point, compiled, point

kinds = pytest.mark.parametrize("kind", KINDS)
STEP = 1e-5


def values(p: Point, batch: Batch, slots: Any = None, parameters: Any = None, flags: Any = None, t: Any = None) -> Any:
    """Values of a batch, shape (rows, times), with some of the operands replaced."""
    given = (p.t if t is None else t, p.slots if slots is None else slots)
    rest = p.numbers.parameters if parameters is None else parameters, p.flags if flags is None else flags
    return np.broadcast_to(batch_values(batch, *given, *rest), (len(batch), len(p.t)))


def own(p: Point, batch: Batch) -> Any:
    """The same by the linearisation point, which knows what is constant."""
    return At(p.numbers, p.t, p.slots, p.flags).values(batch)


def agree(found: Any, high: Any, low: Any, h: Any) -> None:
    expected = (high - low) / (2 * h)
    size = np.maximum(np.abs(high), np.abs(low)) / np.abs(h)
    assert (np.abs(found - expected) <= 1e-6 * np.abs(expected) + 1e-9 * size + 1e-12).all()


@kinds
def test_derivatives_are_limits_of_differences(kind: str) -> None:
    """By each argument's slot, each parameter's entry, each entry of the discrete state, and time."""
    p, met = point(kind), set()
    for batch in p.batches:
        for a in range(len(batch.kernel.columns)):
            change = np.zeros_like(p.slots)
            for row in range(len(batch)):
                one = batch.take(np.array([row]))
                slot = int(one.arguments[0, a])
                if np.count_nonzero(one.arguments[0] == slot) > 1:
                    continue  # the same slot twice: the derivative by one argument is not that by the slot
                h = STEP * max(1.0, float(np.abs(p.slots[slot]).max()))
                change[:] = 0.0
                change[slot] = h
                agree(own(p, one.derivative(a)), values(p, one, p.slots + change), values(p, one, p.slots - change), h)
                met.add("slot")
        for q in range(batch.parameters.shape[1]):
            for row in range(min(len(batch), 3)):
                one, entry = batch.take(np.array([row])), int(batch.parameters[row, q])
                if np.count_nonzero(one.parameters[0] == entry) > 1:
                    continue
                table = p.numbers.parameters
                h = STEP * max(1e-3, abs(float(table[entry])))
                up, down = table.copy(), table.copy()
                up[entry] += h
                down[entry] -= h
                agree(own(p, one.parameter_derivative(q)), values(p, one, None, up), values(p, one, None, down), h)
                met.add("parameter")
        up, down = values(p, batch, t=p.t + STEP), values(p, batch, t=p.t - STEP)
        agree(own(p, batch.time_derivative()), up, down, STEP)
        if batch.kernel.on_time:
            met.add("time")
    assert {"slot", "parameter"} <= met or kind == "latch"  # whose rate follows from relations only
    assert ("time" in met) == p.program.on_time or kind == "latch"


def test_derivatives_by_discrete_values() -> None:
    p, met = point("held"), 0
    for batch in (b for b in p.batches if b.relations.shape[1]):
        for r in range(batch.relations.shape[1]):
            change = np.zeros_like(p.flags)
            change[batch.relations[0, r]] = STEP
            agree(
                own(p, batch.discrete_derivative(r)), values(p, batch, flags=p.flags + change),
                values(p, batch, flags=p.flags - change), STEP,
            )  # fmt: skip
            met += 1
    assert met > 1


@kinds
def test_active_arguments_are_those_that_matter(kind: str) -> None:
    p = point(kind)
    for batch in p.batches:
        for a in range(len(batch.kernel.columns)):
            assert (a in batch.active) == (not batch.derivative(a).kernel.is_zero)


@kinds
def test_the_rest_is_the_value_without_arguments(kind: str) -> None:
    p = point(kind)
    for batch in p.batches:
        rest, expected = values(p, batch.rest), values(p, batch, np.zeros_like(p.slots))
        both = np.isfinite(expected)
        assert rest[both] == pytest.approx(expected[both], abs=1e-12)


@kinds
def test_rows_and_signs(kind: str) -> None:
    """Some rows in another order have their own values; both signs turn a value round; columns hold no signs where all are plus."""
    p = point(kind)
    for batch in p.batches:
        order = np.arange(len(batch))[::-1]
        assert values(p, batch.take(order)) == pytest.approx(values(p, batch)[order], nan_ok=True)
        turned = replace(batch, signs=-batch.signs)
        assert values(p, turned) == pytest.approx(-values(p, batch), nan_ok=True)
        assert (batch.sign_column is None) == bool((batch.signs == 1).all())
        for a, (slots, signs) in enumerate(batch.columns):
            assert slots.tolist() == batch.arguments[:, a].tolist()
            assert (signs is None) == bool((batch.argument_signs[:, a] == 1).all())
            assert signs is None or signs[:, 0].tolist() == batch.argument_signs[:, a].tolist()
        for q, places in enumerate(batch.parameter_columns):
            assert places[:, 0].tolist() == batch.parameters[:, q].tolist()
        constant = not (batch.arguments.shape[1] or batch.relations.shape[1] or batch.kernel.on_time)
        assert batch.of_parameters == constant
        if batch.numbers is not None:
            assert constant
            assert batch.numbers == pytest.approx(values(p, batch)[:, 0])


@kinds
def test_what_a_program_tells_of_itself(kind: str) -> None:
    program = point(kind).program
    known = len(program.states) + len(program.inputs)
    assert program.n_unknowns == len(program.slots) - known
    assert [program.slots[n] for n in (*program.states, *program.inputs)] == list(range(known))
    variables, slots = program.undifferentiated
    assert dict(zip(variables.tolist(), slots.tolist(), strict=True)) == {v: s for (v, k), s in program.slots.items() if k == 0}
    assert program.output_slots.tolist() == [program.slots[n] for n in program.outputs]
    assert program.linear_blocks == tuple(s for s in program.steps if isinstance(s, Linear))
    sizes = [sum(map(len, group)) for group in program.constant_groups]
    assert [part.stop - part.start for part in program.constant_parts] == sizes
    assert [part.start for part in program.constant_parts] == [sum(sizes[:k]) for k in range(len(sizes))]
    assert program.iterated == tuple(s for s in program.steps if isinstance(s, Newton) and not s.linear)
    assert program.is_linear == (kind == "bound")
    assert program.on_time == any(b.kernel.on_time for b in point(kind).batches)


@kinds
def test_residuals_that_remain_where_all_unknowns_are_zero(kind: str) -> None:
    """Those that are left out vanish for any values of the other slots."""
    p = point(kind)
    for step in (s for s in p.program.steps if isinstance(s, Newton)):
        slots = np.random.default_rng(1).normal(size=p.slots.shape)
        slots[step.unknowns] = 0.0
        kept = {(int(b.equations[i]), int(b.targets[i])) for b in step.rests for i in range(len(b))}
        for batch in step.residuals:
            found = values(p, batch, slots)
            for i in range(len(batch)):
                if (int(batch.equations[i]), int(batch.targets[i])) not in kept:
                    assert found[i] == pytest.approx(np.zeros(2), abs=1e-14)
        matrix = {int(e) for b in step.jacobian for e in b.relations.ravel()}
        assert step.discrete.tolist() == sorted(matrix)
        varies = any(b.kernel.columns or b.kernel.on_time for b in step.jacobian)
        assert step.switched == (step.linear and not varies)


def test_divisors_that_may_change_sign_are_guarded() -> None:
    """y (2 + x) = 1 + z: the divisor of y."""
    import gearlib as gl
    from tests.native.test_layout import Divided

    program = gl.compile(Divided()).translation.scene.program
    (guard,) = program.guards
    y = program.slots[compiled_variable(program, guard)]
    assert guard.quotients.tolist() == [y]
    assert (program.n_guards, guard.divisors.targets.tolist()) == (1, [0])
    none = np.zeros((0, 1))
    slots = np.full((program.n_slots, 1), 0.25)
    assert abs(float(batch_values(guard.divisors, np.zeros(1), slots, np.ones(9), none)[0, 0])) == 2.25
    assert all(not compiled(kind).translation.scene.program.guards for kind in ("bound", "loop", "latch"))


def compiled_variable(program: Any, guard: Any) -> Any:
    """The node that a guard's quotient stands for."""
    return next(node for node, slot in program.slots.items() if slot == guard.quotients[0] and node not in program.states)


def test_time_is_seen_in_blocks_too() -> None:
    """An equation that is solved by iteration and holds time, and nothing else does."""
    import gearlib as gl

    class Timed(gl.Component):
        x, y = gl.Variable("1"), gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)
        driven = gl.Structural(True)

        def equations(self) -> list[Any]:
            load = self.rate * gl.time if self.driven else 0.5
            return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(self.y**3 + self.y, self.x + load)]

    for driven in (True, False):
        program = gl.compile(Timed(driven=driven)).translation.scene.program
        assert (program.on_time, program.is_linear, len(program.iterated)) == (driven, False, 1)
    assert math.isfinite(program.n_slots)


@pytest.mark.parametrize(
    ("factor", "switched"),
    [
        (lambda s: gl.Piecewise((2.0, s.x > 0), (3.0, True)), True),  # by events alone
        (lambda s: 2.0 + s.rate * gl.time, False), (lambda s: 2.0 + s.x, False), (lambda s: 2.0 + s.rate * s.x * gl.time, False),
        (lambda s: gl.Piecewise((2.0 + s.rate * gl.time, s.x > 0), (3.0, True)), False),
    ],
)  # fmt: skip
def test_what_changes_the_matrix_of_a_block(factor: Any, switched: bool) -> None:
    """Only one that nothing but events changes may be kept between them."""

    class Block(gl.Component):
        x, a, b = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), self.rate * (self.a + self.b)),
                gl.Eq(factor(self) * self.a + self.b, 1.0 + self.x),
                gl.Eq(self.a - 5.0 * self.b, self.x),
            ]

    (step,) = (s for s in gl.compile(Block()).translation.scene.program.steps if isinstance(s, Newton))
    assert step.linear
    assert step.switched == switched
