"""Second derivatives of programs are exact: against differences of the same equations with 40 digits."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest
from numpy.typing import NDArray

import gearlib as gl
import gearparts as gp
from gearlib.program.derivative_plan import derivative_plan
from gearlib.program.derivatives import At, derivatives
from gearlib.program.interpret import evaluate
from gearlib.program.program import Linear, Newton
from gearlib.program.second_derivatives import Direction, entry_changes
from gearlib.run.scene import guess_of
from tests.program.exact_program import DIGITS, ExactProgram, exact_table
from tests.program.test_derivatives import Bound, Loop
from tests.stress.described import Model
from tests.stress.hybrid_draw import hybrid_train
from tests.stress.trains import RandomTrain

Floats = NDArray[np.float64]
STEP = mp.mpf(10) ** -9


def mixed_differences(
    exact: ExactProgram, known: Floats, table: Any, given: dict[int, float], seeds: list[int], moves: Floats, parameter: int
) -> Floats:
    """d/de of the derivatives with respect to ``seeds`` where states move by ``e moves`` and a parameter by e, shape (slots, seeds)."""
    found = np.zeros((exact.program.n_slots, len(seeds)))
    with mp.workdps(DIGITS):
        fixed = {k: mp.mpf(v) for k, v in given.items()}
        value = exact_table(table, fixed)[parameter]
        sides = {e: exact_table(table, {**fixed, parameter: value + e * STEP}) for e in (1, -1)}
        for column, seed in enumerate(seeds):
            total = [mp.mpf(0)] * exact.program.n_slots
            for e in (1, -1):
                for sign in (1, -1):
                    x = [mp.mpf(float(v)) for v in known]
                    for i, move in enumerate(moves.tolist()):
                        x[i] += e * STEP * mp.mpf(move)
                    x[seed] += sign * STEP
                    total = [t + e * sign * s for t, s in zip(total, exact.slots(x, sides[e]), strict=True)]
            found[:, column] = [float(t / (4 * STEP**2)) for t in total]
    return found


def check(system: gl.System, values: dict[str, float], seed: int, most: int = 4) -> Any:
    """The change of all derivatives with respect to states along random directions that move states and one parameter."""
    rng = np.random.default_rng(seed)
    scene, table = system.translation.scene, system.translation.model.parameters
    parameters = system.translation.parameter_values(values)
    given = {table.index[name]: value for name, value in values.items()}
    prepared = scene.numbers(parameters)
    program = prepared.program
    n, m, t = len(program.states), len(program.inputs), float(rng.uniform(0.1, 2.0))
    x, u = scene.nominal * rng.uniform(-1.0, 1.0, n), rng.normal(size=m)
    now = np.array([t])
    flags = scene.discrete(scene.numbers(parameters), now, x[:, None], u[:, None])[:, 0]
    guess = guess_of(program, np.zeros(system.translation.model.n_variables))
    slots = evaluate(prepared, now, x[:, None], u[:, None], flags[:, None], guess)[:, 0]
    used = {int(p) for s in program.steps for b in _batches(s) for p in b.parameters.ravel()}
    upstream = [p for p in range(len(table.names)) if any(k in used for k, *_ in table.derivatives(parameters, [p], given))]
    moves = np.zeros((n + m, most))
    moves[:n] = scene.nominal[:, None] * rng.uniform(-1.0, 1.0, (n, most)) * 1e-3
    seeds = list(range(n + m))
    plan = derivative_plan(program, [(i, i) for i in seeds])
    at = At(prepared, now, slots[:, None], flags[:, None])
    different = 0
    for k, p in enumerate(rng.permutation(upstream)[:most].tolist()):
        rows = table.derivatives(parameters, [p], given)
        change = np.zeros((len(table.names), 1))
        change[[q for q, *_ in rows], 0] = [w for *_, w in rows]
        own = [(program.n_slots + q, 0, w) for q, _, w in rows if q in used]
        slopes = derivatives(prepared, t, slots, flags, seeds, own)
        moved = slopes[:, : n + m] @ moves[:, k] + (slopes[:, n + m] if own else 0.0)
        found = np.zeros((program.n_slots, n + m))
        found[plan.rows, plan.seeds] = entry_changes(plan, at, Direction(moved[:, None], change))[:, 0]
        right = mixed_differences(
            ExactProgram(program, t, flags, slots), np.concatenate([x, u]), table, given, seeds, moves[:, k], p
        )
        scale = np.array([*scene.nominal, *[1.0] * m])
        size = np.maximum(np.abs(right) * 10, (np.abs(right) * scale).max(axis=1, keepdims=True) / scale)
        noise = 1e-10 * size + 1e-13 * np.abs(right * scale).max() / scale
        noise += 1e-19 * max(1.0, float(np.abs(slots).max()))  # of the differences: 40 digits less twice the step's
        np.testing.assert_array_less(np.abs(found - right), noise)
        different += bool((np.abs(right) > 10 * noise).any())
    assert different
    return program


def _batches(step: Any) -> Any:
    return (
        step.matrix if isinstance(step, Linear) else [*step.residuals, *step.jacobian] if isinstance(step, Newton) else [step]
    )


def test_a_constant_block() -> None:
    program = check(gl.compile(Bound()), {}, 5)
    assert any(isinstance(s, Linear) for s in program.steps)


def test_a_large_constant_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """Factorised as a sparse matrix, as blocks of hundreds of unknowns are."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", 1)
    check(gl.compile(Bound()), {"size": 0.31}, 6)


def test_a_block_that_is_solved_by_iteration() -> None:
    program = check(gl.compile(Loop()), {"length": 0.41}, 2)
    assert any(isinstance(s, Newton) and not s.linear for s in program.steps)


@pytest.mark.parametrize("seed", [4, 23])
def test_random_trains_that_switch(seed: int) -> None:
    check(gl.compile(Model(train=hybrid_train(seed))), {}, seed, 2)


def test_random_linear_trains() -> None:
    check(gl.compile(RandomTrain(seed=11)), {}, 1, 2)


def test_the_papers_train() -> None:
    check(gl.compile(gp.ZhouCui2022()), {}, 3, 3)


@pytest.mark.parametrize("model", [Bound(), Loop()])
def test_the_order_of_differentiation_does_not_matter(model: gl.Component) -> None:
    """By a parameter and then by a state, or the other way round."""
    system, rng = gl.compile(model), np.random.default_rng(4)
    scene = system.translation.scene
    prepared = scene.numbers(system.translation.parameter_values({}))
    program = prepared.program
    n, now = len(program.states) + len(program.inputs), np.array([0.7])
    x, u = scene.nominal * rng.uniform(-1.0, 1.0, len(program.states)), rng.normal(size=len(program.inputs))
    flags = scene.discrete(prepared, now, x[:, None], u[:, None])[:, 0]
    guess = guess_of(program, np.zeros(system.translation.model.n_variables))
    slots = evaluate(prepared, now, x[:, None], u[:, None], flags[:, None], guess)[:, 0]
    at, seeds = At(prepared, now, slots[:, None], flags[:, None]), list(range(n))
    different = 0
    used = sorted({int(p) for s in program.steps for b in _batches(s) for p in b.parameters.ravel()})
    for p in rng.permutation(used)[:5].tolist():
        entering = [(program.n_slots + p, 0)]
        slopes = derivatives(prepared, 0.7, slots, flags, seeds, [(program.n_slots + p, 0, 1.0)])
        change = np.zeros((len(prepared.parameters), n + 1))
        change[p, -1] = 1.0
        by_state, by_parameter = derivative_plan(program, [(i, i) for i in seeds]), derivative_plan(program, entering)
        one, other = np.zeros((2, program.n_slots, n))
        one[by_state.rows, by_state.seeds] = entry_changes(by_state, at, Direction(slopes[:, n:], change[:, n:]))[:, 0]
        other[by_parameter.rows] = entry_changes(by_parameter, at, Direction(slopes[:, :n], change[:, :n]))
        assert one == pytest.approx(other, rel=1e-9, abs=1e-10 * np.abs(other).max())
        different += bool(other.any())
    assert different


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(100))
def test_many_random_trains(seed: int) -> None:
    check(gl.compile(RandomTrain(seed=seed)), {}, seed, 2)
    check(gl.compile(Model(train=hybrid_train(seed))), {}, seed, 2)
