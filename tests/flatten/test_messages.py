"""What a modeller reads who forgot to connect a part, and components in components, many levels deep."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import ModelError

c = gl.connect


@pytest.mark.parametrize("support", [False, True])
def test_a_source_that_nobody_connected_is_named(support: bool) -> None:
    class Forgotten(gl.Component):
        def assemble(self) -> list[Any]:
            self.q, self.body = gp.Torque(use_support=support), gp.Inertia(J=1.0)
            return []

    with pytest.raises(ModelError, match=r"q is not connected, so that its input q\.tau acts on nothing; connect it"):
        gl.compile(Forgotten())


def test_two_inputs_that_are_one_are_named() -> None:
    class Twice(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = gp.Torque(), gp.Torque()
            return [c(self.one.flange, self.other.flange)]

    with pytest.raises(
        ModelError, match=r"the unbound input other\.tau equals the input one\.tau; only one of them can be given"
    ):
        gl.compile(Twice())


def test_a_part_does_not_take_the_blame_for_what_is_loose_elsewhere() -> None:
    """A spring whose other end is free passes no torque; the source is connected."""

    class Free(gl.Component):
        def assemble(self) -> list[Any]:
            self.q, self.spring = gp.Torque(), gp.Spring(c=10.0)
            return [c(self.q.flange, self.spring.flange_a)]

    with pytest.raises(ModelError, match=r"the equations of the model make the input q\.tau zero; bind it to 0: tau=0"):
        gl.compile(Free())


class Nested(gl.Component):
    """A body, so many levels deep."""

    depth = gl.Structural(0)
    flange = gp.Flange("shaft")

    def assemble(self) -> list[Any]:
        self.inner = Nested(depth=self.depth - 1) if self.depth else gp.Inertia(J=2.0)
        return [c(self.flange, self.inner.flange if self.depth else self.inner.flange_a)]


def test_components_may_lie_far_inside_components() -> None:
    class Top(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque, self.nested = gp.Torque(tau=3.0), Nested(depth=120)
            return [c(self.torque.flange, self.nested.flange)]

    result = gl.simulate(Top(), 1.0, samples=2)
    assert result["nested." + "inner." * 121 + "w"][-1] == pytest.approx(1.5)


class Between(gl.Component):
    """A torque that acts between three shafts."""

    a, b, c = gp.Flange("one"), gp.Flange("two"), gp.Flange("three")
    u = gl.Input("N.m", "torque")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(flange.tau, factor * self.u) for flange, factor in ((self.a, -2), (self.b, 1), (self.c, 1))]


@pytest.mark.parametrize(
    ("connected", "message"),
    [
        ("", r"^between is not connected, so that its input between\.u acts on nothing; connect it, or leave it out$"),
        ("a", r"^between\.b is connected to nothing, so that the input between\.u does nothing; connect it$"),
        ("ac", r"^between\.b is connected to nothing"), ("bc", r"^between\.a is connected to nothing"),
    ],
)  # fmt: skip
def test_the_first_flange_that_is_loose_is_named(connected: str, message: str) -> None:
    class Model(gl.Component):
        def assemble(self) -> list[Any]:
            self.between, self.bodies = Between(), [gp.Inertia(J=1.0) for _ in connected]
            return [c(getattr(self.between, name), body.flange_a) for name, body in zip(connected, self.bodies, strict=True)]

    with pytest.raises(ModelError, match=message):
        gl.compile(Model())
