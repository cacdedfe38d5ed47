"""What the structure of a small model says of it."""

from __future__ import annotations

from typing import Any

import gearlib as gl
import gearparts as gp
from gearlib.flatten.flatten import flatten
from gearlib.reduce.reduction import Structure, analyse, reinit_nodes


def structure_of(component: gl.Component) -> Structure:
    model = flatten(component)
    return analyse(model, model.parameters.defaults)


def named(structure: Structure, nodes: Any) -> set[str]:
    return {"der(" * k + structure.model.name(v) + ")" * k for v, k in nodes}


class Memory(gl.Component):
    """An integral of what is no speed, on which nothing depends."""

    y = gl.Variable("1", start=0.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.y), gl.sin(self.y * 0 + gl.time))]


def test_angles_are_those_of_bodies_whatever_comes_first() -> None:
    class Both(gl.Component):
        swapped = gl.Structural(False)

        def assemble(self) -> list[Any]:
            parts = {"body": gp.Inertia(J=1.0), "memory": Memory()}
            for name in sorted(parts, reverse=self.swapped):
                setattr(self, name, parts[name])
            return []

    for swapped in (False, True):
        found = structure_of(Both(swapped=swapped))
        assert {n.rpartition(".")[2] for n in named(found, found.states)} == {"phi", "w", "y"}
        assert {n.rpartition(".")[2] for n in named(found, found.angles)} == {"phi"}


class Kinds(gl.Component):
    """Laws with a relation, with a mode, with both and with neither, of which some are differentiated."""

    x, on = gl.Variable("1", start=0.0), gl.Discrete("mode")
    bend, scaled, plain, still, w = (gl.Variable("1") for _ in range(5))

    def equations(self) -> list[Any]:
        x = self.x
        bend = gl.Piecewise((x - 1, x > 1), (0, True))
        return [
            gl.Eq(gl.der(x), 1), gl.Eq(self.on, gl.Piecewise((1, gl.time > 1), (0, True))),
            gl.Eq(self.bend, bend), gl.Eq(self.scaled, x**2 * gl.pre(self.on)), gl.Eq(self.plain, x**3),
            gl.Eq(self.still, gl.Piecewise((x**2, x > 2), (4, True)) * gl.pre(self.on)),
            gl.Eq(self.w, gl.der(self.bend) + gl.der(self.scaled) + gl.der(self.plain)),
        ]  # fmt: skip


def test_differentiated_equations_that_change_at_events() -> None:
    found = structure_of(Kinds())
    rows = [named(found, row) for row in found.model.rows]
    of = {name: rows.index({name, "x"}) for name in ("bend", "scaled", "plain", "still")}
    assert {e for e, count in enumerate(found.differentiation.counts) if count} == {of["bend"], of["scaled"], of["plain"]}
    assert found.changing == {of["bend"], of["scaled"]}
    assert found.switching == {of["bend"]}


def test_new_values_of_states_depend_on_what_decides_them_through_modes_too() -> None:
    class Hit(gl.Component):
        x, v, far, other = (gl.Variable("1", start=1.0) for _ in range(4))
        count = gl.Discrete("hits")

        def equations(self) -> list[Any]:
            again = gl.When(self.x < 0, gl.reinit(self.v, -self.v * self.count), gl.reinit(self.far, 2.0))
            counted = gl.Eq(self.count, gl.Piecewise((1, self.other > 3), (2, True)))
            rates = [gl.Eq(gl.der(self.x), self.v)] + [gl.Eq(gl.der(n), -1) for n in (self.v, self.far, self.other)]
            return [*rates, counted, again]

    found = structure_of(Hit())
    nodes = {next(iter(named(found, [state]))): named(found, deciding) for state, deciding in reinit_nodes(found.model).items()}
    assert nodes == {"v": {"x", "v", "other"}, "far": {"x", "far"}}
    assert found.at_reinits == reinit_nodes(found.model)
