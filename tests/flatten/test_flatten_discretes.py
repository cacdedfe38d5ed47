"""Where equations find discrete variables, their values before an event, and whether a run is being started."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
from gearlib.equations.bindings import discrete_name
from gearlib.flatten.flatten import flatten


class Cell(gl.Component):
    """One equation for each way of naming a discrete variable, and one for all of them."""

    n, m = gl.Discrete("one"), gl.Discrete("other", start=2.0)
    u = gl.Input("1", default=0.0)
    now, before, started, every = (gl.Variable("1") for _ in range(4))

    def equations(self) -> list[Any]:
        at_start, two = gl.Piecewise((1, gl.initial()), (2, True)), gl.Piecewise((2.0, gl.time > 1), (0, True))
        return [
            gl.Eq(self.n, gl.Piecewise((1.0, gl.time > 1), (0, True))), gl.Eq(self.m, two + gl.pre(self.n) + self.n),
            gl.Eq(self.now, 2 * self.m), gl.Eq(self.before, 3 * gl.pre(self.n)), gl.Eq(self.started, at_start + self.u),
            gl.Eq(self.every, at_start * gl.pre(self.m) + 5 * self.n * self.m + 7 * gl.pre(self.n)),
        ]  # fmt: skip


class Row(gl.Component):
    """Cells that hand a discrete variable, or its value before an event, to the next one."""

    def assemble(self) -> list[Any]:
        self.a = Cell()
        self.b = Cell(u=3 * self.a.m)
        self.c = Cell(u=2 * gl.pre(self.b.n) + self.a.n)
        return []


@pytest.mark.parametrize("part", ["a", "b", "c"])
def test_each_part_has_its_own(part: str) -> None:
    """Values before an event behind all values, and the start of a run behind both."""
    model = flatten(Row())
    names = list(model.discretes)
    assert sorted(names) == sorted(f"{p}.{n}" for p in "abc" for n in "nm")
    place = {name: k for k, name in enumerate(names)}
    at = {n: place[f"{part}.{n}"] for n in "nm"} | {f"pre({n})": place[f"{part}.{n}"] + len(names) for n in "nm"}
    at["initial()"] = 2 * len(names)
    found = {}
    for g, group in enumerate(model.groups):
        for i in range(len(group)):
            if model.owner(g, i) == part and not group.template.binds:
                assert group.discretes[i].tolist() == [at[name] for name in group.template.discretes]
                found[group.template.label.partition(" ")[2].partition(" ")[0]] = set(group.template.discretes)
    assert found == {
        "now": {"m"}, "before": {"pre(n)"}, "started": {"initial()"}, "every": {"initial()", "n", "m", "pre(n)", "pre(m)"},
    }  # fmt: skip
    for update in model.updates:
        for i, target in enumerate(update.targets.tolist()):
            if names[target].startswith(f"{part}."):
                assert update.equations.discretes[i].tolist() == [at[name] for name in update.equations.template.discretes]


def test_bindings_hold_discrete_variables_by_their_numbers() -> None:
    model = flatten(Row())
    place = {name: k for k, name in enumerate(model.discretes)}
    bound = {}
    for g, group in enumerate(model.groups):
        for i in range(len(group)):
            if group.template.binds:
                bound[model.owner(g, i)] = dict(zip(group.template.discretes, group.discretes[i].tolist(), strict=True))
    first, pre_b, now = place["a.m"], place["b.n"], place["a.n"]
    assert bound["b"] == {discrete_name(first, False): first}
    assert bound["c"] == {discrete_name(pre_b, True): pre_b + len(place), discrete_name(now, False): now}
