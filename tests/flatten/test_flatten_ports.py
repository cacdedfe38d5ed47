"""Which connectors of a flat model are connected to nothing, and which ones of composites to their parts."""

from __future__ import annotations

from typing import Any

import gearlib as gl
import gearparts as gp
from gearlib.flatten.flatten import flatten


class Housed(gl.Component):
    """A spring in a housing, of which one flange leads inside, and another nowhere; the spring has a loose end."""

    flange, spare = gp.Flange("of the spring"), gp.Flange("leads nowhere")

    def assemble(self) -> list[Any]:
        self.spring = gp.Spring(c=2.0)
        return [gl.connect(self.flange, self.spring.flange_b)]


class Deep(gl.Component):
    """A housing in a housing, behind a body."""

    flange_a, flange_b = gp.Flange("of the body"), gp.Flange("of the housing")

    def assemble(self) -> list[Any]:
        self.body, self.inner = gp.Inertia(J=1.0), Housed()
        return [
            gl.connect(self.flange_a, self.body.flange_a), gl.connect(self.body.flange_b, self.inner.flange),
            gl.connect(self.inner.spare, self.flange_b),
        ]  # fmt: skip


class Whole(gl.Component):
    def assemble(self) -> list[Any]:
        self.load, self.one, self.deep, self.two = gp.Inertia(J=1.0), Housed(), Deep(), Housed()
        return [
            gl.connect(self.load.flange_a, self.one.flange), gl.connect(self.one.spare, self.deep.flange_a, self.two.flange),
        ]  # fmt: skip


def test_connectors_are_told_by_instance_and_name_in_the_order_of_the_instances() -> None:
    model = flatten(Whole())
    inner, loose = (
        [f"{model.instances[number].path}.{connector}" for number, connector in ports]
        for ports in (model.inner_ports, model.loose_ports)
    )
    order = [instance.path for instance in model.instances]
    for found in (inner, loose):
        places = [order.index(path.rpartition(".")[0]) for path in found]
        assert places == sorted(places)
    assert sorted(inner) == ["deep.flange_a", "deep.flange_b", "deep.inner.flange", "one.flange", "two.flange"]
    assert sorted(loose) == sorted(
        [
            "load.flange_b",
            "one.spring.flange_a",
            "two.spring.flange_a",
            "two.spare",
            "deep.inner.spring.flange_a",
            "deep.flange_b",
        ]
    )
