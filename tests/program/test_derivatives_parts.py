"""What derivatives are put together from: slopes of batches, and scale factors of equations against least squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.derivative_plan import TIME, Solved, derivative_plan, discrete_entry
from gearlib.program.derivatives import At, dense, entries, equilibrating, pulled_back, slopes, undetermined
from gearlib.program.interpret import batch_values, solutions_of_runs
from gearlib.program.program import Batch, Linear
from tests.program.programs import KINDS, compiled, point
from tests.program.test_derivatives import Root


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_are_those_of_the_values(kind: str) -> None:
    """Along random changes of all slots: against central differences. Absent arguments are left out."""
    p, rng = point(kind), np.random.default_rng(5)
    now, slots, flags = p.t[:1], p.slots[:, :1], p.flags[:, :1]
    at = At(p.numbers, now, slots, flags)
    change = rng.normal(size=len(slots)) * np.maximum(np.abs(slots[:, 0]), 1e-2)
    for batch in p.batches:
        found, size = np.zeros((2, len(batch)))
        met: set[tuple[int, int, int]] = set()
        for number, (rows, places, values) in enumerate(slopes(batch, at)):
            assert (batch.argument_signs[rows, batch.active[number]] != 0).all()
            met.update((number, row, place) for row, place in zip(rows.tolist(), places.tolist(), strict=True))
            found[rows] += values * change[places]
            size[rows] += np.abs(values * change[places])
        shown = [(k, a) for k, a in enumerate(batch.active)]
        table, signs = batch.arguments.tolist(), batch.argument_signs
        assert met == {(k, row, table[row][a]) for k, a in shown for row in range(len(batch)) if signs[row, a]}
        h = 1e-6
        high, low = (
            np.broadcast_to(
                batch_values(batch, now, slots + sign * h * change[:, None], p.numbers.parameters, flags), (len(batch), 1)
            )
            for sign in (1, -1)
        )
        noise = 1e-7 * size + 1e-9 * np.abs(high[:, 0])
        assert (np.abs(found - (high - low)[:, 0] / (2 * h)) <= noise + 1e-12).all()


@pytest.mark.parametrize("kind", KINDS)
def test_values_of_a_batch_are_there_for_each_time(kind: str) -> None:
    """Of numbers, of parameters, and of what changes; of one row, and of as many rows as times."""
    p = point(kind)
    at = At(p.numbers, p.t, p.slots, p.flags)
    batches = [*p.batches, *(batch.derivative(a) for batch in p.batches for a in batch.active)]
    for batch in sorted(batches, key=lambda b: (not b.of_parameters, len(b))):
        for one in (batch, batch.take(np.array([len(batch) - 1])), batch.take(np.array([0, len(batch) - 1]))):
            found = at.values(one)
            assert found.shape == (len(one), 2)
            expected = [
                batch_values(one.take(np.array([row])), p.t, p.slots, p.numbers.parameters, p.flags) for row in range(len(one))
            ]
            assert found == pytest.approx(
                np.concatenate([np.broadcast_to(e, (1, 2)) for e in expected]), rel=1e-13, nan_ok=True
            )


def test_derivatives_of_many_runs_are_those_of_each() -> None:
    """Of a linear program with other parameters in each run, some of them the same in all; two seeds with weights of their own."""
    translation = compiled("bound").translation
    scene, program = translation.scene, translation.scene.program
    given: list[dict[str, float]] = [{}, {"size": 0.31}, {"b.J": 0.02, "stiffness": 3e3}]
    tables = [translation.parameter_values(values) for values in given]
    solutions, solved = solutions_of_runs(program, np.stack(tables, axis=1))
    assert solved.all()
    numbers = replace(scene.numbers(tables[0]), parameters=np.stack(tables, axis=1), solutions=tuple(solutions))
    n, none = len(program.states) + len(program.inputs), np.zeros((0, 3))
    plan = derivative_plan(program, [(i, i) for i in range(n)], program.output_slots)
    slots, weights = np.zeros((program.n_slots, 3)), np.linspace(1.0, 2.0, 3 * n).reshape(n, 3)
    found = dense(plan, entries(plan, At(numbers, np.zeros(3), slots, none), weights))
    for run, table in enumerate(tables):
        one = At(scene.numbers(table), np.zeros(1), slots[:, :1], none[:, :1])
        expected = dense(plan, entries(plan, one))[0] * weights[:, run]
        assert found[run] == pytest.approx(expected, rel=1e-12, abs=1e-13 * np.abs(expected).max())
        assert dense(plan, entries(plan, one, weights[:, run]))[0] == pytest.approx(expected, rel=1e-13)
        for step in program.steps:
            for batch in (step,) if isinstance(step, Batch) else ():
                for a in batch.active:
                    slope = batch.derivative(a)
                    values = At(numbers, np.zeros(3), slots, none).values(slope)
                    assert values.shape == (len(batch), 3)
                    assert values[:, run] == pytest.approx(one.values(slope)[:, 0], rel=1e-14)


@pytest.mark.parametrize("constants", [False, True], ids=["states", "parameters"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_reverse_of_a_plan_is_its_transpose(kind: str, constants: bool) -> None:
    """At two times; by states, inputs and some unknowns, or also by what the matrices of blocks are made of."""
    p, rng = point(kind), np.random.default_rng(8)
    program, at = p.program, At(p.numbers, p.t, p.slots, p.flags)
    places = [*range(len(program.states) + len(program.inputs)), int(program.output_slots[-1])]
    places += [int(step.unknowns[k]) for step in program.steps if not isinstance(step, Batch) for k in (0, -1)][:3]
    places = [*dict.fromkeys(places)]
    if constants:
        blocks = [
            b for step in program.steps if not isinstance(step, Batch) for b in (getattr(step, "matrix", ()) or step.jacobian)
        ]
        places += [program.n_slots + q for q in sorted({int(q) for b in blocks for q in b.parameters.ravel()})]
    wanted = rng.permutation(program.n_slots)[:30]
    one, each = (derivative_plan(program, [(slot, k * i) for k, slot in enumerate(places)], wanted) for i in (0, 1))
    matrices = dense(each, entries(each, at))
    weights = rng.normal(size=(len(wanted), 2))
    found = pulled_back(one, at, weights)
    assert found.shape == (len(places), 2)
    for i in range(2):
        size = np.abs(matrices[i]).max(axis=0) + 1e-300
        assert found[:, i] / size == pytest.approx(matrices[i].T @ weights[:, i] / size, rel=1e-10, abs=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_has_the_same_weight_at_all_times_or_one_for_each(kind: str) -> None:
    """As many seeds as times, or fewer, or more."""
    p, rng = point(kind), np.random.default_rng(6)
    program, at = p.program, At(p.numbers, p.t, p.slots, p.flags)
    constants = [program.n_slots + q for q in sorted({int(q) for b in p.batches for q in b.parameters.ravel()})]
    places = [*range(len(program.states)), *constants]
    for count in (1, 2, 3):
        plan = derivative_plan(program, [(slot, k) for k, slot in enumerate(places[:count])])
        count = min(count, len(places))
        plain, weights = dense(plan, entries(plan, at, np.ones((count, 2)))), rng.uniform(1.0, 2.0, (count, 2))
        assert dense(plan, entries(plan, at, weights[:, 0])) == pytest.approx(plain * weights[:, 0], rel=1e-12)
        expected = np.stack([plain[i] * weights[:, i] for i in range(2)])
        assert dense(plan, entries(plan, at, weights)) == pytest.approx(expected, rel=1e-12)
        assert dense(plan, entries(plan, at)) == pytest.approx(plain, rel=1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_added_to_an_unknown_leaves_the_others_of_its_block_alone(kind: str) -> None:
    """It is added to the solution; whether or not anything else asks for that unknown."""
    p = point(kind)
    program, at = p.program, At(p.numbers, p.t, p.slots, p.flags)
    for step in (s for s in program.steps if not isinstance(s, Batch)):
        chosen = step.unknowns[[0, 1, -2, -1] if len(step.unknowns) > 3 else [*range(len(step.unknowns))]].tolist()
        for k, slot in enumerate(chosen):
            for wanted in ([other for other in chosen if other != slot], chosen, chosen[::-1]):
                plan = derivative_plan(program, [(slot, 0)], wanted, 1)
                expected = np.array([[float(other == chosen[k])] for other in wanted]).reshape(-1, 1)
                assert dense(plan, entries(plan, at)).tolist() == [expected.tolist()] * 2


def test_the_reverse_through_a_large_constant_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """Factorised as a sparse matrix, it gives the same as a dense one; also where what it is made of is a seed."""
    translation = compiled("bound").translation
    scene, program, rng = translation.scene, translation.scene.program, np.random.default_rng(9)
    (block,) = program.linear_blocks
    n, none = len(program.states) + len(program.inputs), np.zeros((0, 2))
    slots = np.random.default_rng(1).normal(size=(program.n_slots, 2))
    used = sorted({int(q) for batch in block.matrix for q in batch.parameters.ravel()})
    weights, found = rng.normal(size=(len(program.output_slots), 2)), {}
    for places in ([*range(n)], [*range(n), *(program.n_slots + q for q in used)]):
        plan = derivative_plan(program, [(place, 0) for place in places], program.output_slots)
        for most in (400, 1):
            monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
            program.solved.clear()
            numbers = scene.numbers(translation.parameter_values({}))
            assert isinstance(numbers.solutions[0], np.ndarray) == (most == 400)
            found[most] = pulled_back(plan, At(numbers, np.zeros(2), slots, none), weights)
        program.solved.clear()
        assert found[1] == pytest.approx(found[400], rel=1e-11, abs=1e-12 * np.abs(found[400]).max())
        assert found[400].any()


@pytest.mark.parametrize("kind", ["held", "latch", "bound"])
def test_constants_have_places_of_their_own(kind: str) -> None:
    """Every parameter, every entry of the discrete state, and time: all at once as each by itself."""
    p = point(kind)
    program, at = p.program, At(p.numbers, p.t, p.slots, p.flags)
    places = [*(program.n_slots + q for q in range(len(p.numbers.parameters))), *map(discrete_entry, range(len(p.flags))), TIME]
    plan = derivative_plan(program, [(place, k) for k, place in enumerate(places)], program.output_slots)
    together = dense(plan, entries(plan, at))
    linear = iter(range(len(program.linear_blocks)))
    for step in plan.steps:
        if isinstance(step, Solved):
            assert step.block == (next(linear) if isinstance(step.step, Linear) else -1)
    for k, place in enumerate(places):
        own = derivative_plan(program, [(place, 0)], program.output_slots)
        expected = dense(own, entries(own, at)) if len(own.sources) else np.zeros((2, len(program.output_slots), 1))
        assert together[:, :, [k]] == pytest.approx(expected, rel=1e-13)


def scales(matrix: np.ndarray, counted: np.ndarray) -> tuple[list[float], list[float]]:
    """Powers of 2 next to the least scale factors that bring the entries that count nearest to 1, all weighted alike."""
    n = len(matrix)
    rows, columns = np.nonzero(counted)
    terms = np.zeros((len(rows), 2 * n))
    terms[np.arange(len(rows)), rows] = terms[np.arange(len(rows)), n + columns] = 1.0
    found = 2.0 ** np.round(np.linalg.lstsq(terms, -np.log2(np.abs(matrix[rows, columns])), rcond=1e-10)[0])
    return found[:n].tolist(), found[n:].tolist()


@pytest.mark.parametrize("seed", range(12))
def test_scale_factors_are_powers_of_two_that_bring_entries_near_one(seed: int) -> None:
    """Rows without entries keep theirs, and compliances far below the largest entry of an equation count as nothing."""
    rng = np.random.default_rng(seed)
    n = 1 + seed % 6
    matrix = np.where(rng.random((n, n)) < 0.6, rng.choice([-1, 1], (n, n)) * 10.0 ** rng.uniform(-4, 4, (n, n)), 0.0)
    matrix *= 10.0 ** rng.uniform(-30, 30, (n, 1))
    large = np.abs(matrix).max(axis=1, keepdims=True)
    small = (matrix == 0) & (rng.random((n, n)) < 0.5)
    found = equilibrating(np.where(small, 1e-21 * large * (1 - 2 * (rng.random((n, n)) < 0.5)), matrix))
    assert tuple(x.tolist() for x in found) == scales(matrix, matrix != 0)


@pytest.mark.parametrize(("share", "counts"), [(1e-19, True), (1e-21, False)])
def test_a_compliance_is_a_share_of_the_largest_entry_of_its_equation(share: float, counts: bool) -> None:
    matrix = np.array([[5.0, 5.0 * share], [3.0 * share, 3.0]])
    found = equilibrating(matrix)
    assert tuple(x.tolist() for x in found) == scales(matrix, np.full((2, 2), True) if counts else np.eye(2, dtype=bool))


@pytest.mark.parametrize(("y", "count"), [(0.0, 1), (1e-3, 0), (-2.0, 0)])
def test_where_the_slope_of_a_cube_vanishes_its_root_is_undetermined(y: float, count: int) -> None:
    translation = gl.compile(Root()).translation
    scene, numbers = translation.scene, translation.scene.numbers(translation.parameter_values({}))
    place = scene.program.slots[scene.model.variable("y"), 0]
    slots, none = np.zeros(scene.program.n_slots), np.zeros(0)
    slots[place] = y
    found = undetermined(numbers, 0.0, slots, none, [place])
    assert found.shape == (1, count)
    assert found.all()
    assert undetermined(numbers, 0.0, slots, none).shape == (len(slots), count)


@pytest.mark.parametrize("s", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize(("x", "count"), [(1.0, 0), (15.0 / 224.0, 1)])
def test_undetermined_unknowns_of_a_chain(x: float, count: int, s: float) -> None:
    """Four unknowns between neighbours, 4 on the diagonal and 1 beside it, but 4 x at the first: 4 x 56 - 15 = 0 leaves one open.

    In units of which each is s times the one before.
    """

    class Chain(gl.Component):
        x = gl.Variable("1")
        y0, y1, y2, y3 = (gl.Variable("1") for _ in range(4))
        rate, s = gl.Parameter("1/s", default=1.0), gl.Parameter("1", default=1.0)

        def equations(self) -> list[gl.Eq]:
            y = (self.y0, self.s * self.y1, self.s**2 * self.y2, self.s**3 * self.y3)
            return [
                gl.Eq(gl.der(self.x), self.rate * self.y3),
                gl.Eq(4 * self.x * y[0] + y[1], 1.0),
                *(gl.Eq(y[i - 1] + 4 * y[i] + y[i + 1], self.x) for i in (1, 2)),
                gl.Eq(y[2] + 4 * y[3], 0.5),
            ]

    translation = gl.compile(Chain()).translation
    scene, numbers = translation.scene, translation.scene.numbers(translation.parameter_values({"s": s}))
    slots, none = np.zeros(scene.program.n_slots), np.zeros(0)
    slots[0] = x
    places = [scene.program.slots[scene.model.variable(f"y{i}"), 0] for i in range(4)]
    found = undetermined(numbers, 0.0, slots, none, places)
    assert found.shape == (4, count)
    for y in found.T * s ** np.arange(4):  # y3 = 1, and upwards from there
        assert y / y[3] == pytest.approx([-56.0, 15.0, -4.0, 1.0], rel=1e-9)
