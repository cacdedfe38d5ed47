"""What is named where a program cannot be evaluated: parts, their parameters and times; and how many iterations are tried."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SingularError, SolverError
from gearlib.program import scalars
from gearlib.program.interpret import evaluate, owner_of, regular
from tests.program.test_interpret import CONSTANT, parameters_of, prepared, rotated
from tests.program.test_interpret_large import CubeRoot


class Lever(gl.Component):
    x, y = gl.Variable("1"), gl.Variable("1")
    p = gl.Parameter("1", default=2.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.p * self.y, self.x)]


class Sum(gl.Component):
    x, y = gl.Variable("1"), gl.Variable("1")
    p, q = gl.Parameter("1", default=1.0), gl.Parameter("1", default=0.5)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq((self.p + self.q) * self.y, self.x)]


class Levers(gl.Component):
    x = gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)

    def assemble(self) -> list[Any]:
        self.lever, self.sum = [Lever() for _ in range(3)], [Sum() for _ in range(2)]
        return []

    def equations(self) -> list[gl.Eq]:
        parts = [*self.lever, *self.sum]
        return [gl.Eq(gl.der(self.x), self.rate * sum(one.y for one in parts)), *(gl.Eq(one.x, self.x) for one in parts)]


@pytest.mark.parametrize("most", [1500, 0], ids=["written out", "arrays"])
def test_the_part_whose_divisor_vanishes_is_named(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any of several parts of two kinds, with its own parameters; of several the first. Other runs go on."""
    monkeypatch.setattr(scalars, "MOST", most)
    scene = gl.compile(Levers()).translation.scene
    index, good = scene.model.parameters.index, scene.model.parameters.values
    cases: list[tuple[str, dict[str, float]]] = [(f"lever[{i}]", {"p": value}) for i in range(3) for value in (0.0, np.inf)]
    cases += [
        (f"sum[{i}]", values)
        for i in range(2)
        for values in ({"p": 0.0, "q": 0.0}, {"p": -0.5, "q": 0.5}, {"p": np.nan, "q": 1.0})
    ]
    tables = [good]
    for part, values in cases:
        table = good.copy()
        table[[index[f"{part}.{name}"] for name in values]] = [*values.values()]
        named = ", ".join(f"{part}.{name} = {value:g}" for name, value in values.items())
        text = rf"^{re.escape(part)}: .* cannot be solved with {re.escape(named)}; division by zero$"
        with pytest.raises(SingularError, match=text):
            scene.numbers(table)
        tables.append(table)
    assert regular(scene.program, np.stack(tables, axis=1)).tolist() == [True] + [False] * len(cases)
    both = good.copy()
    both[[index["lever[1].p"], index["lever[2].p"]]] = 0.0
    with pytest.raises(SingularError, match=re.escape("lever[1].p = 0")):
        scene.numbers(both)


def iterations(x: float, y: float) -> int:
    """How many Newton's method takes from y to the cube root of x: until a change is rounding, or nearly so after some."""
    for count in range(1, 200):
        change = (y**3 - x) / (3 * y**2)
        y -= change
        if abs(change) <= 1e-14 * abs(y) or (count > 9 and abs(change) <= 1e-11 * abs(y) + 1e-12):
            return count
    raise AssertionError("many")


def test_fifty_iterations_are_tried() -> None:
    """From far away a cube root comes nearer by a third with each; the times at which that is not enough are named."""
    scene = gl.compile(CubeRoot()).translation.scene
    numbers, root = scene.numbers(scene.model.parameters.values), 1.7
    place = scene.program.output_slots[0]
    guesses = {iterations(root**3, guess): guess for guess in root * 1.5 ** np.arange(35.0, 60.0, 0.1)}
    for count in (48, 49, 50, 51, 52):
        given = scene.program.n_slots, 1
        for guess in (np.full(given, guesses[count]), np.full(given[:1], guesses[count])):
            at = numbers, np.array([0.25]), np.array([[root**3]]), np.empty((0, 1)), np.empty((0, 1)), guess
            if count <= 50:
                assert evaluate(*at)[place] == pytest.approx([root], rel=1e-14)
            else:
                with pytest.raises(
                    SolverError, match=r"^the nonlinear equations .* were not solved at t = 0\.25 s; they have no"
                ):
                    evaluate(*at)
    several = np.full((scene.program.n_slots, 4), root)
    several[:, 2] = guesses[52]
    x, none, t = np.full((1, 4), root**3), np.empty((0, 4)), np.array([0.0, 1.0, 2.5, 3.0])
    with pytest.raises(SolverError, match=r"were not solved at t = 2\.5 s"):
        evaluate(numbers, t, x, none, none, several)
    found = evaluate(numbers, t, x, none, none, several, forgiving=True)[place]
    assert found[[0, 1, 3]] == pytest.approx([root] * 3, rel=1e-14)


class SquareRoot(gl.Component):
    x, y = gl.Variable("1"), gl.Variable("1", start=1.0)
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(self.y**2, self.x)]


@pytest.mark.parametrize("entries", [1, 10**6], ids=["one by one", "together"])
def test_times_without_a_solution_do_not_touch_the_roots_at_others(entries: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each time goes to the root at its own guess, or all to that of the only guess; -1 has no square root."""
    monkeypatch.setattr("gearlib.program.interpret.ENTRIES", entries)
    scene = gl.compile(SquareRoot()).translation.scene
    numbers, place = scene.numbers(scene.model.parameters.values), scene.program.output_slots[0]
    x, signs, none = np.array([[-1.0, 4.0, 9.0, 16.0]]), np.array([1.0, -1.0, 1.0, -1.0]), np.empty((0, 4))
    for sign in (1.0, -1.0):
        for guess, expected in (
            (np.tile(sign * signs, (scene.program.n_slots, 1)), sign * signs * [1, 2, 3, 4]),
            (np.full(scene.program.n_slots, sign), sign * np.array([1, 2, 3, 4])),
        ):
            found = evaluate(numbers, np.arange(4.0), x, none, none, guess, forgiving=True)[place]
            assert found[1:] == pytest.approx(expected[1:], rel=1e-12)


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize(("smallest", "good"), [(1e-11, True), (1e-15, True), (1e-17, False), (0.0, False)])
def test_pivots_of_a_large_constant_block(smallest: float, good: bool, size: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """As it is not scaled, one may be a ten-quadrillionth of another."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", 0)
    matrix = size * np.diag([1.0, smallest, 0.5])
    if good:
        assert size * np.array(prepared(matrix).solutions[0].tolist())[[0, 2]] == pytest.approx(-np.diag([1.0, 2.0]))
    else:
        with pytest.raises(SingularError, match="the equations of Constant are singular"):
            prepared(matrix)


def test_a_few_inverses_are_kept() -> None:
    """Four of a structure at most."""
    prepared(rotated(0))
    counts = []
    for seed in range(1, 7):
        CONSTANT.scene.program.solved.clear()
        CONSTANT.scene.numbers(parameters_of(rotated(seed)))
        counts.append(len(CONSTANT.structure.inverses))
    assert max(counts) == 4


@pytest.mark.parametrize(("n", "more"), [(1, 0), (3, 0), (4, 0), (5, 1), (6, 2)])
def test_four_equations_are_named_at_most(n: int, more: int) -> None:
    """Each once, with the number of the others."""

    def equations(self: Any) -> list[gl.Eq]:
        y = [getattr(self, f"y{i}") for i in range(n)]
        ring = [gl.Eq(one**3 + one - 0.3 * other, self.x) for one, other in zip(y, [*y[1:], y[0]], strict=True)]
        return [gl.Eq(gl.der(self.x), self.rate * sum(y)), *ring]

    names = {f"y{i}": gl.Variable("1") for i in range(n)} | {"x": gl.Variable("1"), "rate": gl.Parameter("1/s", default=1.0)}
    scene = gl.compile(type("Ring", (gl.Component,), names | {"equations": equations})()).translation.scene
    none = np.empty((0, 1))
    with pytest.raises(SolverError) as caught:
        evaluate(scene.numbers(scene.model.parameters.values), np.full(1, 0.5), np.full((1, 1), np.nan), none, none)
    named, _, rest = str(caught.value).removeprefix("the nonlinear equations ").partition(" were not solved at t = 0.5 s; ")
    assert rest.startswith("they have no solution there, or need better guesses")
    assert (" more" in named) == (more > 0)
    assert named.endswith(f" and {more} more" if more else "")
    labels = named.removesuffix(f" and {more} more").split("; ")
    assert len({*labels}) == len(labels) == min(n, 4)
    assert all(re.fullmatch(r"Ring: \S.* = x", label) for label in labels)


class Counted(gl.Component):
    x, n = gl.Variable("1"), gl.Discrete("1")
    rate, limit = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=2.0)

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.rate * (1 + self.n)), gl.When(self.x >= self.limit, gl.Eq(self.n, 1.0))]


class Counters(gl.Component):
    x, n = gl.Variable("1"), gl.Discrete("1")
    rate = gl.Parameter("1/s", default=1.0)

    def assemble(self) -> list[Any]:
        self.one, self.other = Counted(), Counted(limit=3.0)
        return []

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), -self.rate * self.x * self.n), gl.When(self.x <= 0.5, gl.Eq(self.n, self.one.x))]


def test_equations_belong_to_components() -> None:
    """Those of variables by their numbers, those of discrete variables by the instance, counted downwards from -1."""
    translation = gl.compile(Counters(), outputs=["x", "one.x", "other.x"]).translation
    model, structure, relations = translation.model, translation.structure, translation.scene.relations
    assert relations is not None
    assert [owner_of(structure, -1 - i) for i in range(3)] == ["Counters", "one", "other"]
    met = set()
    for e in range(len(model.places)):
        owner = owner_of(structure, e)
        names = {model.name(v) for v, _ in model.nodes(e, 0)}
        assert all(name.startswith("" if owner == "Counters" else f"{owner}.") for name in names)
        assert owner != "Counters" or not all("." in name for name in names)
        met.add(owner)
    assert met == {"Counters", "one", "other"}
    for batch in relations.discretes:
        for target, equation in zip(batch.targets.tolist(), batch.equations.tolist(), strict=True):
            path, _, _ = model.discretes[target - model.n_relations].rpartition(".")
            assert owner_of(structure, equation) == (path or "Counters")
