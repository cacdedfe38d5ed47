"""From sorted blocks to programs: rows that know their equations, unknowns that occur twice, derivatives of conditional equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.equations.kernel import differentiated
from gearlib.program.interpret import evaluate
from tests.program.programs import KINDS, compiled, point


@pytest.mark.parametrize("kind", KINDS)
def test_rows_know_their_equations(kind: str) -> None:
    """The instance that a row belongs to has its parameters, and the variables behind its slots."""
    p, model, rows = point(kind), compiled(kind).translation.model, set()
    named = {*p.program.slots.values()}
    for batch in p.batches:
        for i, equation in enumerate(batch.equations.tolist()):
            g, row = model.places[equation]
            group = model.groups[g]
            assert group.template.label in batch.kernel.template.label
            assert {*batch.parameters[i].tolist()} <= {*group.parameters[row].tolist()}
            read = named.intersection(batch.arguments[i][batch.argument_signs[i] != 0].tolist())
            own = {*group.variables[row].tolist()}
            assert read <= {slot for (v, _), slot in p.program.slots.items() if v in own}
            rows.add((g, row))
    assert rows


class Weighted(gl.Component):
    a, b, x = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    p = gl.Parameter("1", default=2.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.a + self.p * self.b, self.x)]


def test_an_unknown_that_occurs_twice() -> None:
    """Two variables of a part that are one in the whole: a + p b = x with a = b, also with opposite signs."""

    class Whole(gl.Component):
        rate = gl.Parameter("1/s", default=1.0)
        x = gl.Variable("1")

        def assemble(self) -> list[Any]:
            self.same, self.opposite = Weighted(), Weighted(p=5.0)
            return []

        def equations(self) -> list[gl.Eq]:
            one, other = self.same, self.opposite
            return [
                gl.Eq(gl.der(self.x), self.rate * (one.a + other.a)), gl.Eq(one.a, one.b), gl.Eq(other.a, -other.b),
                gl.Eq(one.x, self.x), gl.Eq(other.x, self.x),
            ]  # fmt: skip

    scene = gl.compile(Whole()).translation.scene
    numbers, none = scene.numbers(scene.model.parameters.evaluate({})), np.empty((0, 2))
    x = np.array([[0.6, -3.0]])
    slots = evaluate(numbers, np.zeros(2), x, none, none)
    assert slots[scene.program.output_slots] == pytest.approx(x * (1 / 3 - 1 / 4), rel=1e-14)


def test_a_condition_that_a_derivative_no_longer_holds() -> None:
    """x = 2 y + c, where c depends on which side u is: the derivatives hold x and y only. x'' = f + 1 and 2 y'' = sin(t) - f."""

    class Offset(gl.Component):
        rate = gl.Parameter("1/s", default=1.0)
        x, y, v, w, u, f = (gl.Variable("1") for _ in range(6))

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), self.rate * self.v), gl.Eq(gl.der(self.y), self.rate * self.w),
                gl.Eq(gl.der(self.v), self.rate * (self.f + 1)),
                gl.Eq(2 * gl.der(self.w), self.rate * (gl.sin(self.rate * gl.time) - self.f)),
                gl.Eq(self.x, 2 * self.y + gl.Piecewise((0.0, self.u > 10), (0.2, True))), gl.Eq(self.u, self.y + 1),
            ]  # fmt: skip

    run = gl.compile(Offset(), outputs=["x", "y", "f"]).simulate(1.0, samples=6, rtol=1e-10)
    t = np.linspace(0.0, 1.0, 6)
    assert run["f"] == pytest.approx((np.sin(t) - 1) / 2, abs=1e-9)
    assert run["x"] == pytest.approx((t**2 / 2 + t - np.sin(t)) / 2, abs=1e-9)
    assert run["y"] == pytest.approx((run["x"] - 0.2) / 2, abs=1e-12)


@pytest.mark.parametrize("wanted", [("w",), ("w", "second"), ("first", "z")])
@pytest.mark.parametrize(("first", "second"), [("a", "b"), ("x", "y")])
def test_derivatives_read_the_variables_of_their_equations(first: str, second: str, wanted: tuple[str, ...]) -> None:
    """a = sin(b) gives a' = cos(b) b', whatever the names are, and whether or not anything else needs b; a' = (1 - a) / 2."""

    def equations(self: Any) -> list[gl.Eq]:
        a, b = getattr(self, first), getattr(self, second)
        return [
            gl.Eq(gl.der(a), 0.5 * self.rate * (1 - a)), gl.Eq(self.w, gl.der(b)), gl.Eq(a, gl.sin(b)), gl.Eq(gl.der(self.z), self.w),
        ]  # fmt: skip

    names = {first: gl.Variable("1", start=0.3), second: gl.Variable("1"), "w": gl.Variable("1/s"), "z": gl.Variable("1")}
    rate = gl.Parameter("1/s", default=1.0)
    model = type("Driven", (gl.Component,), names | {"rate": rate, "equations": equations})
    outputs = [{"first": first, "second": second}.get(name, name) for name in wanted]
    times = np.linspace(0.0, 1.0, 3)
    run = gl.compile(model(), outputs=outputs).simulate(1.0, times=times, rtol=1e-9, method="rk", start={"z": 0.0})
    a = 1 - 0.7 * np.exp(-0.5 * times)
    right = {"w": 0.5 * (1 - a) / np.sqrt(1 - a**2), "z": np.arcsin(a) - np.arcsin(0.3), first: a, second: np.arcsin(a)}
    for name in outputs:
        assert run[name] == pytest.approx(right[name], abs=1e-8), name


@pytest.mark.parametrize("kind", KINDS)
def test_equations_and_their_derivatives_hold_what_their_texts_do(kind: str) -> None:
    """The variables of an instance are in the order of its equation, which is not that of a derivative of it."""
    model = compiled(kind).translation.model
    for e, (g, i) in enumerate(model.places):
        group = model.groups[g]
        own = dict(
            zip(group.template.locals, zip(group.variables[i].tolist(), group.signs[i].tolist(), strict=True), strict=True)
        )
        for k in range(3):
            columns = differentiated(group.template, k).columns
            assert {*model.nodes(e, k)} == {(own[name][0], order) for name, order in columns if own[name][1]}
