"""Residual forms of equations that switch: what is compared is an unknown too, and what that depends on."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.interpret import batch_values, evaluate, prepare
from gearlib.program.relations import Relations
from gearlib.program.residual_form import index_reduced_form, torn_form


class Switching(gl.Component):
    """``h`` counts how often w reaches 3, where w depends on whether v is above 1; ``m`` tells whether q was above 2."""

    x, y, v, w, q, idle = (gl.Variable("1") for _ in range(6))
    h, m = gl.Discrete("1"), gl.Discrete("1")
    u = gl.Input("1")
    rate, k = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=2.5)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), self.rate * (self.y + self.h)),
            gl.Eq(self.y**3 + self.y, self.x + self.u),
            gl.Eq(self.v, self.x + 2 * self.y),
            gl.Eq(self.w, gl.Piecewise((self.y, self.v > 1), (self.k, True))),
            gl.Eq(self.q, self.k * self.x),
            gl.Eq(self.idle, 5 * self.x),
            gl.When(self.w >= 3, gl.Eq(self.h, gl.pre(self.h) + 1)),
            gl.When(self.q > 2, gl.Eq(self.m, 1.0)),
        ]


@cache
def switching() -> Any:
    return gl.compile(Switching(), outputs=["x", "m"]).translation


def node(name: str, order: int = 0) -> tuple[int, int]:
    return switching().model.variable(name), order


def names(form: Any) -> list[str]:
    return [switching().model.name(v) for v, _ in form.algebraic]


def compared(found: Relations, slots: Any, flags: Any) -> list[float]:
    """What the relations compare with zero, whichever side it is on."""
    table = switching().model.parameters.values
    values = [batch_values(batch, np.zeros(1), slots, table, flags)[:, 0] for batch in found.batches]
    assert sorted(int(t) for batch in found.batches for t in batch.targets) == found.used.tolist()
    assert not found.on_time.any()
    return sorted(np.abs(np.concatenate(values)).tolist())


def discretes(found: Relations) -> set[str]:
    model = switching().model
    targets = {model.discretes[int(t) - model.n_relations] for batch in found.discretes for t in batch.targets}
    return {name for name in targets if not name.startswith("when_")}


@pytest.mark.parametrize("m_wanted", [False, True])
def test_everything_that_is_compared_is_an_unknown(m_wanted: bool) -> None:
    """The chain from h over w to v; of an output m also q. What nothing needs is left out."""
    model, structure = switching().model, switching().structure
    wanted = [model.discretes.index("m")] if m_wanted else []
    form = index_reduced_form(structure, (node("x"),), [], wanted, True)
    assert (form.n_states, form.implicit, sorted(names(form))) == (1, True, ["q"] * m_wanted + ["v", "w", "y"])
    assert form.relations is not None
    assert discretes(form.relations) == ({"h", "m"} if m_wanted else {"h"})
    program = form.program
    assert form.relations.program.slots == program.slots
    assert form.relations.program.n_slots == len(program.states) + len(program.inputs)
    values = {"x": 0.7, "y": -0.4, "v": 2.2, "w": 3.7, "q": 1.1}
    y = [values[name] for name in ("x", *names(form))] + [0.3]  # the last is the rate of x
    flags = np.zeros((model.n_relations + 2 * len(model.discretes) + 1, 1))
    flags[model.n_relations + model.discretes.index("h")] = 4.0
    for above in (0.0, 1.0):
        flags[: model.n_relations] = above
        numbers = prepare(program, structure, model.parameters.values)
        slots = evaluate(numbers, np.zeros(1), np.array(y)[:, None], np.array([[0.2]]), flags)
        x, y_, v, w, q = values.values()
        expected = [0.3 - y_ - 4.0, y_**3 + y_ - x - 0.2, v - x - 2 * y_, w - (y_ if above else 2.5)] + [q - 2.5 * x] * m_wanted
        found = slots[list(program.residuals), 0]
        assert np.sort(np.abs(found)) == pytest.approx(np.sort(np.abs(expected)), abs=1e-15)
        assert abs(found[0]) == pytest.approx(abs(expected[0]))
    assert compared(form.relations, slots, flags) == pytest.approx(sorted([w - 3, v - 1] + [abs(q - 2)] * m_wanted))


def test_without_a_discrete_state_nothing_is_compared() -> None:
    form = index_reduced_form(switching().structure, (node("x"),), [node("idle")], (), False)
    assert form.relations is None
    assert {"y", "idle"} <= {*names(form)}
    for outputs, count in (([node("x", 1)], 0), ([node("x")], 0), ([node("idle")], 1)):
        plain = index_reduced_form(switching().structure, (node("x"),), outputs, (), False)
        assert names(plain).count("idle") == count
        assert len(plain.program.residuals) == len(plain.unknowns)


def test_relations_of_a_torn_form_are_of_its_unknowns() -> None:
    """The cubic root is an unknown of the integrator; what is compared follows from it in sequence."""
    model, structure, scene = switching().model, switching().structure, switching().scene
    assert scene.relations is not None
    for wanted in ([], [model.discretes.index("m")]):
        form = torn_form(structure, scene.program, scene.relations, wanted)
        assert (names(form), form.unknowns[:1], form.implicit) == (["y"], (node("x"),), False)
        assert form.relations is not None
        assert form.relations.program.states == form.program.states == form.unknowns
        assert discretes(form.relations) == ({"h", "m"} if wanted else {"h"})
        flags = np.zeros((scene.n_discrete, 1))
        for above in (0.0, 1.0):
            flags[: model.n_relations] = above
            x, y = 0.7, -0.4
            numbers = prepare(form.relations.program, structure, model.parameters.values)
            slots = evaluate(numbers, np.zeros(1), np.array([[x], [y]]), np.array([[0.2]]), flags)
            expected = [abs((y if above else 2.5) - 3), abs(x + 2 * y - 1)] + [abs(2.5 * x - 2)] * len(wanted)
            assert compared(form.relations, slots, flags) == pytest.approx(sorted(expected))
