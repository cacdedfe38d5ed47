"""What programs read and divide by: inputs that something follows from, and divisors that may change sign, of several parts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.build import build
from gearlib.program.interpret import batch_values
from gearlib.program.program import Linear, Newton
from gearlib.program.residual_form import torn_form

READ = {"plain": True, "of_block": True, "of_iteration": True, "compared": False, "idle": False}


class Driven(gl.Component):
    """Inputs in an assignment, in a block with constant coefficients, in one that is iterated, in a condition, and in nothing."""

    plain, of_block, of_iteration, compared, idle = (gl.Input("1") for _ in range(5))
    x, a, b, y = (gl.Variable("1") for _ in range(4))
    rate, p = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=3.0)

    def equations(self) -> list[gl.Eq]:
        load = gl.Piecewise((1.0, self.compared > 0), (2.0, True))
        return [
            gl.Eq(gl.der(self.x), self.rate * (self.plain + self.a + self.y + load)),
            gl.Eq(self.a + self.p * self.b, self.of_block), gl.Eq(self.a - 2 * self.p * self.b, self.x),
            gl.Eq(self.y**3 + self.y, self.of_iteration),
        ]  # fmt: skip


def test_inputs_that_anything_follows_from() -> None:
    """Each by itself, with conditions left out; an input that is asked for is read."""
    translation = gl.compile(Driven()).translation
    program, model = translation.scene.program, translation.model
    assert {type(step) for step in program.steps} >= {Linear, Newton}
    assert {model.name(v): bool(read) for (v, _), read in zip(program.inputs, program.inputs_read, strict=True)} == READ
    for name in READ:
        alone = build(translation.structure, [(model.variable(name), 0)], None, dynamic=False)
        assert [model.name(v) for (v, _), read in zip(alone.inputs, alone.inputs_read, strict=True) if read] == [name]


class Quotient(gl.Component):
    """``y = v / (p + x)`` where v is positive, else ``y = v / (p + q x)``; and ``z (x + v) = q``."""

    x, v, y, z = (gl.Variable("1") for _ in range(4))
    p, q = gl.Parameter("1", default=0.5), gl.Parameter("1", default=3.0)

    def equations(self) -> list[gl.Eq]:
        slope = gl.Piecewise((self.x, self.v > 0), (self.q * self.x, True))
        return [gl.Eq(self.y, self.v / (self.p + slope)), gl.Eq(self.z * (self.x + self.v), self.q)]


class Quotients(gl.Component):
    """Three of them, one of which has the opposite x."""

    x, v = gl.Variable("1", start=0.3), gl.Variable("1", start=0.7)
    rate = gl.Parameter("1/s", default=1.0)

    def assemble(self) -> list[Any]:
        self.part = [Quotient(), Quotient(p=0.25), Quotient(q=-2.0)]
        return []

    def equations(self) -> list[gl.Eq]:
        total = sum(one.y + one.z for one in self.part)
        one, other, third = self.part
        return [
            gl.Eq(gl.der(self.x), self.rate * total), gl.Eq(gl.der(self.v), self.rate),
            gl.Eq(one.x, self.x), gl.Eq(other.x, -self.x), gl.Eq(third.x, self.x), *(gl.Eq(p.v, self.v) for p in self.part),
        ]  # fmt: skip


@pytest.mark.parametrize("v", [0.7, -0.4])
def test_divisors_of_several_parts(v: float) -> None:
    """They are numbered one after the other, and are what their quotients are divided by."""
    translation = gl.compile(Quotients()).translation
    scene, model, x = translation.scene, translation.model, 0.3
    program, numbers = scene.program, scene.numbers(translation.parameter_values({}))
    slots = np.zeros((program.n_slots, 1))
    for name, value in (("x", x), ("v", v)):
        slots[program.slots[model.variable(name), 0]] = value
    flags = scene.discrete(numbers, np.zeros(1), slots[: len(program.states)], np.zeros((0, 1)))
    found, count = {}, 0
    for guard in program.guards:
        assert guard.divisors.targets.tolist() == [*range(count, count + len(guard.quotients))]
        count += len(guard.quotients)
        values = batch_values(guard.divisors, np.zeros(1), slots, numbers.parameters, flags)[:, 0]
        found |= dict(zip(guard.quotients.tolist(), np.abs(values).tolist(), strict=True))
    assert program.n_guards == count == 6
    for i, (p, q, sign) in enumerate([(0.5, 3.0, 1), (0.25, 3.0, -1), (0.5, -2.0, 1)]):
        own = {"y": p + (1.0 if v > 0 else q) * sign * x, "z": sign * x + v}
        for name, expected in own.items():
            slot = program.slots[model.variable(f"part[{i}].{name}"), 0]
            assert found.pop(slot) == pytest.approx(abs(expected), rel=1e-14)
    assert not found


def test_residuals_are_not_guarded() -> None:
    """In a torn form, whose integrator sees them; but what is computed in sequence is, before and after them."""

    class Loop(gl.Component):
        a, b, c, d, e = (gl.Variable("1") for _ in range(5))
        rate = gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.a), self.rate * (self.b + self.c + self.e)),
                gl.Eq(self.c, self.b / (1.0 + self.a)),
                gl.Eq(self.b**3 + self.b + self.c / (3.0 + self.a), 2 * self.a),
                gl.Eq(self.d, 1.0 / (self.c - 5.0)), gl.Eq(self.e, 1.0 / (self.d - 7.0)),
            ]  # fmt: skip

    translation = gl.compile(Loop()).translation
    form = torn_form(translation.structure, translation.scene.program, None, ())
    assert len(form.algebraic) == 1
    (tear,) = form.algebraic
    assert translation.model.name(tear[0]) == "b"
    guarded = sorted(slot for guard in form.program.guards for slot in guard.quotients.tolist())
    assert guarded == sorted(form.program.slots[translation.model.variable(name), 0] for name in "cde")
    assert form.program.n_guards == 3
