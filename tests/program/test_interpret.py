"""Blocks that are solved by iteration: at many times together as at each time alone."""

from __future__ import annotations

import re
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SingularError, SolverError
from gearlib.program.derivatives import undetermined
from gearlib.program.factored import Factored
from gearlib.program.interpret import block_solve, evaluate, regular, solutions_of_runs
from gearlib.program.program import Newton
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train


class Pair(gl.Component):
    """``x a + b = 1`` and ``a + x b = 1``: ``a = b = 1 / (1 + x)``, but at x = 1 the two say the same, and at x = -1 they disagree."""

    x = gl.Variable("1")
    a = gl.Variable("1")
    b = gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * self.a),
            gl.Eq(self.x * self.a + self.b, 1.0),
            gl.Eq(self.a + self.x * self.b, 1.0),
        ]


def values(x: list[float], forgiving: bool = False) -> Any:
    """a and b at some x."""
    system = gl.compile(Pair(), outputs=["a", "b"])
    scene = system.translation.scene
    (step,) = (s for s in scene.program.steps if isinstance(s, Newton))
    assert step.linear
    numbers = scene.numbers(system.translation.parameter_values({}))
    none = np.empty((0, len(x)))
    return evaluate(numbers, np.arange(len(x), dtype=float), np.array([x]), none, none, None, forgiving)[step.unknowns]


@pytest.mark.parametrize("entries", [1, 1_000_000], ids=["one by one", "together"])
def test_singular_times_do_not_harm_others(entries: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the solutions at x = 1 the smallest is taken."""
    monkeypatch.setattr("gearlib.program.interpret.ENTRIES", entries)
    x = [0.0, 3.0, 1.0, -0.5, 1.0]
    np.testing.assert_allclose(values(x), np.tile(1 / (1 + np.array(x)), (2, 1)), rtol=1e-14)


def test_time_without_a_solution_is_named() -> None:
    with pytest.raises(SolverError, match="have no solution at t = 2 s: they depend on each other there"):
        values([0.0, 3.0, -1.0, 2.0])
    found = values([0.0, 3.0, -1.0, 2.0], forgiving=True)
    np.testing.assert_allclose(found[:, [0, 1, 3]], [[1.0, 0.25, 1 / 3]] * 2, rtol=1e-14)


@pytest.mark.parametrize("seed", [4, 28, 58])
def test_many_times_are_as_many_points_on_random_trains_that_switch(seed: int) -> None:
    scene = gl.compile(Model(train=hybrid_train(seed))).translation.scene
    assert any(isinstance(step, Newton) for step in scene.program.steps)
    numbers, rng, times = scene.numbers(scene.model.parameters.evaluate({})), np.random.default_rng(seed), 8
    t, x = rng.uniform(0, 2, times), scene.nominal[:, None] * rng.uniform(-1, 1, (len(scene.states), times))
    u = np.zeros((len(scene.program.inputs), times))
    flags = scene.discrete(numbers, t, x, u)
    together = evaluate(numbers, t, x, u, flags, forgiving=True)
    for i in range(times):
        k = slice(i, i + 1)
        alone = evaluate(numbers, t[k], x[:, k], u[:, k], flags[:, k], forgiving=True)[:, 0]
        np.testing.assert_allclose(together[:, i], alone, rtol=1e-12, atol=1e-13 * np.abs(alone).max())


@pytest.mark.parametrize("weight", [1.0, 1e20, -1e-20, 0.0])
def test_what_a_singular_block_leaves_open_is_in_the_units_of_its_unknowns(weight: float) -> None:
    """``x a + c b = 1`` and ``w (a + x c b) = w`` leave ``x a = -c b`` open at x = 1, or without a weight w."""

    class Scaled(gl.Component):
        x = gl.Variable("1")
        a = gl.Variable("1")
        b = gl.Variable("1")
        rate = gl.Parameter("1/s", default=1.0)
        c = gl.Parameter("1", default=1000.0)
        w = gl.Parameter("1", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(gl.der(self.x), self.rate * self.a),
                gl.Eq(self.x * self.a + self.c * self.b, 1.0),
                gl.Eq(self.w * (self.a + self.x * self.c * self.b), self.w),
            ]

    system = gl.compile(Scaled(), outputs=["a", "b"])
    scene = system.translation.scene
    numbers, none = scene.numbers(system.translation.parameter_values({"w": weight})), np.empty((0, 1))
    for x, count in ((1.0, 1), (3.0, 0 if weight else 1)):
        slots = evaluate(numbers, np.zeros(1), np.array([[x]]), none, none)[:, 0]
        a, b = (scene.program.slots[scene.model.variable(name), 0] for name in ("a", "b"))
        directions = undetermined(numbers, 0.0, slots, none[:, 0], [a, b])
        assert directions.shape == (2, count)
        for da, db in directions.T:
            assert x * da == pytest.approx(-1000.0 * db)
            assert abs(da) > 0


class Constant(gl.Component):
    """``A z = (x, 0, 2 x)`` with any matrix A, and an unknown that is divided by a parameter."""

    x = gl.Variable("1")
    y = gl.Variable("1")
    z0 = gl.Variable("1")
    z1 = gl.Variable("1")
    z2 = gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)
    q = gl.Parameter("1", default=2.0)
    a, b, c = gl.Parameter("1", default=2.0), gl.Parameter("1", default=1.0), gl.Parameter("1", default=-1.0)
    d, e, f = gl.Parameter("1", default=1.0), gl.Parameter("1", default=3.0), gl.Parameter("1", default=1.0)
    g, h, i = gl.Parameter("1", default=1.0), gl.Parameter("1", default=-1.0), gl.Parameter("1", default=4.0)

    def equations(self) -> list[gl.Eq]:
        z, x = (self.z0, self.z1, self.z2), self.x
        return [
            gl.Eq(gl.der(x), self.rate * (self.z0 + self.z1 + self.z2 + self.y)),
            gl.Eq(self.q * self.y, x),
            gl.Eq(self.a * z[0] + self.b * z[1] + self.c * z[2], x),
            gl.Eq(self.d * z[0] + self.e * z[1] + self.f * z[2], 0),
            gl.Eq(self.g * z[0] + self.h * z[1] + self.i * z[2], 2 * x),
        ]


CONSTANT = gl.compile(Constant()).translation


def parameters_of(matrix: Any, q: float = 2.0) -> Any:
    """The parameter table with the entries of the matrix."""
    found, index = CONSTANT.model.parameters.values.copy(), CONSTANT.model.parameters.index
    found[[index[name] for name in "qabcdefghi"]] = [q, *np.ravel(matrix)]
    return found


def prepared(matrix: Any) -> Any:
    CONSTANT.structure.inverses.clear()
    CONSTANT.scene.program.solved.clear()
    return CONSTANT.scene.numbers(parameters_of(matrix))


def rotated(seed: int) -> Any:
    """A matrix that is far from singular."""
    rng = np.random.default_rng(seed)
    return np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(1.0, 3.0, 3)


def almost(distance: float) -> Any:
    """Two equations that are the same but for the distance."""
    return np.array([[1.0, 1.0, 0.0], [1.0, 1.0 + distance, 0.0], [0.0, 0.0, 1.0]])


WRONG = {
    "zero row": np.diag([1.0, 0.0, 2.0]),
    "zero column": rotated(1) * [1.0, 0.0, 1.0],
    "sum of rows": np.array([[1.0, 2.0, 3.0], [3.0, 4.0, 5.0], [2.0, 2.0, 2.0]]),
    "same rows": almost(0.0),
    "no number": rotated(2) * [1.0, np.nan, 1.0],
    "infinite": rotated(2) + np.array([0.0, np.inf, 0.0]),
}


@pytest.mark.parametrize("most", [400, 0], ids=["dense", "sparse"])
def test_constant_blocks_are_solved_in_any_units(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows and columns may differ by many decades."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    scene, rng, x = CONSTANT.scene, np.random.default_rng(1), 0.7
    assert len(scene.program.linear_blocks) == 1
    (block,) = scene.program.linear_blocks
    assert (len(block.unknowns), len(block.known)) == (3, 2)
    at, none = [scene.program.slots[CONSTANT.model.variable(n), 0] for n in ("z0", "z1", "z2")], np.empty((0, 1))
    for seed, decades in ((1, 0), (2, 0), (3, 60), (4, 60)):
        units, mine = 10.0 ** rng.uniform(-decades, decades, (2, 3)) if most else np.ones((2, 3)), rotated(seed)
        numbers = prepared(units[0][:, None] * mine * units[1])
        assert isinstance(numbers.solutions[0], Factored) == (most == 0)
        slots = evaluate(numbers, np.zeros(1), np.array([[x]]), none, none)[:, 0]
        expected = np.linalg.solve(mine, np.array([x, 0.0, 2 * x]) / units[0]) / units[1]
        assert slots[at] == pytest.approx(expected, rel=1e-11, abs=1e-13 * np.abs(expected * units[1]).max() / units[1].max())
        whole = block_solve(numbers, 0, np.eye(3))
        columns = numbers.solutions[0] if most else np.array(numbers.solutions[0].tolist())
        assert -whole[:, block.known_rows] == pytest.approx(columns, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("most", [400, 0], ids=["dense", "sparse"])
@pytest.mark.parametrize("kind", WRONG)
def test_singular_constant_blocks_are_refused(most: int, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    with pytest.raises(SingularError, match="the equations of Constant are singular with these parameters"):
        prepared(WRONG[kind])


def test_equations_that_are_almost_the_same() -> None:
    """Up to a condition number of 1e13, which is 4 over the distance; the same for many runs at once."""
    distances = {1.0: True, 1e-12: True, 5e-13: True, 3e-13: False, 1e-13: False}
    for distance, good in distances.items():
        with nullcontext() if good else pytest.raises(SingularError):
            prepared(almost(distance))
    runs = np.stack([parameters_of(almost(distance)) for distance in distances], axis=1)
    assert solutions_of_runs(CONSTANT.scene.program, runs)[1].tolist() == [*distances.values()]


def test_a_run_is_refused_alone_where_it_is_among_many() -> None:
    """Wherever a matrix lies beside the limit."""
    rng, matrices = np.random.default_rng(4), []
    for decades in rng.uniform(12.2, 13.2, 40):
        left, right = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
        matrices.append(left * [1.0, 0.5, 10.0**-decades] @ right)
    solved = solutions_of_runs(CONSTANT.scene.program, np.stack([parameters_of(m) for m in matrices], axis=1))[1]
    assert 5 < solved.sum() < 35
    for matrix, good in zip(matrices, solved, strict=True):
        with nullcontext() if good else pytest.raises(SingularError):
            prepared(matrix)


def test_constant_blocks_of_many_runs() -> None:
    """What differs, or does not, between the runs."""
    program = CONSTANT.scene.program
    good = [rotated(seed) for seed in range(4)]
    for chosen in (good, good[:1] * 3):
        (found,), solved = solutions_of_runs(program, np.stack([parameters_of(m) for m in chosen], axis=1))
        assert solved.all()
        for one, matrix in zip(found, chosen, strict=True):
            assert one == pytest.approx(prepared(matrix).solutions[0], rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_in_one_run_is_not_in_others(kind: str) -> None:
    """Where numpy finds a matrix singular none is said to be solved: then each is looked at by itself."""
    good = [rotated(seed) for seed in range(4)]
    for place in range(3):
        runs = [parameters_of(m) for m in (good[1], good[2])]
        runs.insert(place, parameters_of(WRONG[kind]))
        (found,), solved = solutions_of_runs(CONSTANT.scene.program, np.stack(runs, axis=1))
        others = [k for k in range(3) if k != place]
        assert not solved[place]
        assert solved[others].all() == (kind != "same rows")
        for k, seed in zip(others, (1, 2), strict=True):
            assert solved[k] == (found[k] == pytest.approx(prepared(good[seed]).solutions[0], rel=1e-12, abs=1e-14))


def test_runs_with_a_divisor_of_zero() -> None:
    runs = np.stack([parameters_of(rotated(1), q) for q in (1.0, 0.0, -2.0, np.inf, np.nan, 1e-300)], axis=1)
    assert regular(CONSTANT.scene.program, runs).tolist() == [True, False, True, False, False, True]


def test_a_constant_block_is_solved_again_where_its_own_entries_change() -> None:
    first = prepared(rotated(1))
    others = [CONSTANT.scene.numbers(parameters_of(matrix, q)) for matrix, q in ((rotated(1), 3.0), (rotated(2), 3.0))]
    assert [numbers.solutions[0] is first.solutions[0] for numbers in others] == [True, False]


@pytest.mark.parametrize("most", [400, 0], ids=["dense", "sparse"])
def test_entries_of_all_solutions_as_one_list(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Block by block, row by row: -inverse(A) with a column for each right-hand side that is not zero."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    (block,) = CONSTANT.scene.program.linear_blocks
    numbers = prepared(rotated(5))
    whole = -block_solve(numbers, 0, np.eye(3))[:, block.known_rows]
    assert numbers.listed == pytest.approx(whole.ravel().tolist(), rel=1e-12)
    assert all(isinstance(x, float) for x in numbers.listed)


class Ratio(gl.Component):
    """``(p / q) y = x``, beside ``y + z = r / q`` and ``y - sqrt(s) z = 0``."""

    x, y, z, v = (gl.Variable("1") for _ in range(4))
    rate, p, q = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=3.0), gl.Parameter("1", default=2.0)
    s = gl.Parameter("1", default=4.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * (self.v + self.z)), gl.Eq(self.p / self.q * self.y, self.x),
            gl.Eq(self.v + self.z, self.x), gl.Eq(self.v - gl.sqrt(self.s) * self.z / self.q, 1.0 + self.y),
        ]  # fmt: skip


@pytest.mark.parametrize(
    ("values", "refused"),
    [
        ({"p": 0.0}, "cannot be solved with p = 0, q = 2; division by zero"),
        ({"q": 0.0}, "cannot be solved with p = 3, q = 0; division by zero"),
        ({"p": np.inf}, "cannot be solved with p = inf, q = 2; division by zero"),
        ({"s": -1.0}, "are singular with these parameters"),
        ({"p": 1e308, "q": 1e-308}, "cannot be solved with p = 1e+308, q = 1e-308; division by zero"),
        ({}, ""), ({"p": 1e-3}, ""), ({"s": 0.0}, ""),
    ],
    ids=str,
)  # fmt: skip
def test_numbers_for_which_python_and_arrays_differ(values: dict[str, float], refused: str) -> None:
    """Python raises where an array has infinities: the same word for both, which names the parameters."""
    scene = gl.compile(Ratio(), outputs=["x", "y"]).translation.scene
    table = scene.model.parameters.values.copy()
    table[[scene.model.parameters.index[name] for name in values]] = [*values.values()]
    if refused:
        with pytest.raises(SingularError, match=re.escape(refused)):
            scene.numbers(table)
        return
    slots = evaluate(scene.numbers(table), np.zeros(1), np.array([[0.5]]), *(np.empty((0, 1)),) * 2)[:, 0]
    p, q = values.get("p", 3.0), values.get("q", 2.0)
    assert slots[scene.program.slots[scene.model.variable("y"), 0]] == pytest.approx(0.5 * q / p, rel=1e-14)
    assert slots[scene.program.output_slots[0]] == pytest.approx(0.5)


class Part(gl.Component):
    a, b, x = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    p = gl.Parameter("1", default=2.0)

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(self.a - self.p * self.b, self.x)]


@pytest.mark.parametrize(("n", "named", "more"), [(3, 3, ""), (8, 8, ""), (9, 8, " and 1 more"), (11, 8, " and 3 more")])
def test_parts_of_a_singular_block_are_named(n: int, named: int, more: str) -> None:
    """A ring in which each unknown is the next one plus x: eight of them at most, then how many more there are."""

    class Ring(gl.Component):
        rate = gl.Parameter("1/s", default=1.0)
        x = gl.Variable("1")

        def assemble(self) -> list[gl.Connection]:
            self.part = [Part() for _ in range(n)]
            return []

        def equations(self) -> list[gl.Eq]:
            ring = [gl.Eq(one.b, other.a) for one, other in zip(self.part, [*self.part[1:], self.part[0]], strict=True)]
            return [gl.Eq(gl.der(self.x), self.rate * self.part[0].a), *ring, *(gl.Eq(one.x, self.x) for one in self.part)]

    scene = gl.compile(Ring()).translation.scene
    assert np.isfinite(
        evaluate(scene.numbers(scene.model.parameters.values), np.zeros(1), np.array([[0.5]]), *(np.empty((0, 1)),) * 2)
    ).all()
    table = scene.model.parameters.values.copy()
    table[[scene.model.parameters.index[f"part[{i}].p"] for i in range(n)]] = 1.0
    listed = rf"(part\[\d+\](, )?){{{named}}}(?<! ){more}"
    with pytest.raises(SingularError, match=rf"^the equations of {listed} are singular with these parameters"):
        scene.numbers(table)


@pytest.mark.parametrize("guess", [0.0, 1e-12, -3.0])
def test_where_a_square_has_its_vertex_the_iteration_goes_on_upwards(guess: float) -> None:
    class Square(gl.Component):
        x, y = gl.Variable("1", guess=guess), gl.Variable("1", start=4.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.x**2, self.y), gl.Eq(gl.der(self.y), 0.0 * self.x)]

    assert gl.simulate(Square(), 1.0, samples=2)["x"] == pytest.approx([2.0 if guess >= 0 else -2.0] * 2, rel=1e-9)
