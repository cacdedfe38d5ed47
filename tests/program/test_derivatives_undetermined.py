"""What singular blocks leave open, and where there are no derivatives: several blocks, and several directions of one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SolverError
from gearlib.program.derivatives import derivatives, solve_shared, undetermined
from tests.program.test_interpret_singular import N, numbers, varying
from tests.program.test_solve_shared import answer


class Roots(gl.Component):
    """Cubic roots y and z of a state and of another, and a sum of them."""

    a, b, y, z, s = (gl.Variable("1") for _ in range(5))
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.a), self.rate * self.s), gl.Eq(gl.der(self.b), self.rate),
            gl.Eq(self.y**3, self.a), gl.Eq(self.z**3, self.b), gl.Eq(self.s, 2 * self.y - 3 * self.z),
        ]  # fmt: skip


@pytest.mark.parametrize(("y", "z"), [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, -2.0)])
def test_each_block_leaves_open_what_it_leaves_open(y: float, z: float) -> None:
    """A cubic root at zero, each with a direction of its own, and what follows from it."""
    translation = gl.compile(Roots()).translation
    scene, parameters = translation.scene, translation.parameter_values({})
    places = [scene.program.slots[scene.model.variable(name), 0] for name in "yzs"]
    slots, none = np.zeros(scene.program.n_slots), np.zeros(0)
    slots[places[:2]] = y, z
    given = scene.numbers(parameters), 0.0, slots, none
    found = undetermined(*given, places)
    expected = [column for column, root in (([1.0, 0.0, 2.0], y), ([0.0, 1.0, -3.0], z)) if root == 0.0]
    assert found.shape == (3, len(expected))
    columns = sorted((found / np.abs(found[:2]).max(axis=0, initial=1e-300)).T.tolist(), key=lambda c: -abs(c[0]))
    for column, right in zip(columns, expected, strict=True):
        assert np.abs(column) == pytest.approx(np.abs(right))
        assert np.sign(column[2]) == np.sign(column[0] + column[1]) * np.sign(right[2])
    everything = undetermined(*given)
    assert everything.shape == (len(slots), len(expected))
    assert everything[places] == pytest.approx(found)
    assert undetermined(*given, iter(places)).shape == found.shape
    wanted = [scene.program.slots[node] for node in scene.program.outputs]
    assert undetermined(*given, wanted).shape == (2, len(expected))


@pytest.mark.parametrize("rank", [1, 2, 3, 4])
def test_as_many_directions_as_equations_are_missing(rank: int) -> None:
    """They are independent, and the equations do not feel them."""
    rng = np.random.default_rng(rank)
    matrix = rng.normal(size=(N, rank)) @ rng.normal(size=(rank, N))
    scene = varying().scene
    slots, none = np.zeros(scene.program.n_slots), np.zeros(0)
    slots[0] = 0.6
    places = [scene.program.slots[scene.model.variable(f"z{j}"), 0] for j in range(N)]
    found = undetermined(numbers(matrix, np.zeros(N)), 0.0, slots, none, places)
    assert found.shape == (N, N - rank)
    assert np.linalg.matrix_rank(found, 1e-6) == N - rank
    assert np.abs(matrix @ found).max(initial=0.0) <= 1e-12


@pytest.mark.parametrize("seed", range(6))
def test_what_is_told_beside_an_open_direction_does_not_move_at_all(seed: int) -> None:
    """Two unknowns are told by their difference only, two in full, in any units; and the equations are mixed: rounding is no motion."""
    rng = np.random.default_rng(seed)
    units, matrix = 10.0 ** rng.uniform(-4, 4, N), np.zeros((N, N))
    matrix[:2, :2] = np.outer(rng.uniform(1, 2, 2), [1.0, -1.0])
    matrix[2:, 2:] = rng.normal(size=(2, 2))
    matrix = rng.normal(size=(N, N)) @ matrix / units
    scene = varying().scene
    slots, none = np.zeros(scene.program.n_slots), np.zeros(0)
    slots[0] = 0.6
    places = [scene.program.slots[scene.model.variable(f"z{j}"), 0] for j in range(N)]
    found = undetermined(numbers(matrix, np.zeros(N)), 0.0, slots, none, places)
    assert found.shape == (N, 1)
    assert found[2:, 0].tolist() == [0.0, 0.0]
    assert found[0, 0] / units[0] == pytest.approx(found[1, 0] / units[1], rel=1e-9)


def test_equations_of_which_the_number_is_told_have_no_derivatives_where_they_disagree() -> None:
    """Two that are the same in their unknowns: what shifts one of them alone has no answer, what shifts both alike has."""
    matrix = np.diag([1.0, 1.0, 2.0, 4.0])
    matrix[:2, :2] = 1.0
    scene = varying().scene
    slots, none = np.zeros(scene.program.n_slots), np.zeros(0)
    slots[0] = 1.0
    index, places = scene.model.parameters.index, [scene.program.slots[scene.model.variable(f"z{j}"), 0] for j in range(N)]
    given = numbers(matrix, np.zeros(N)), 0.0, slots, none
    r: Any = [scene.program.n_slots + index[f"r{i}"] for i in range(N)]
    text = (
        r"^there is no linear model at this point: 4 equations that are solved by iteration cannot be solved for small changes"
    )
    with pytest.raises(SolverError, match=text):
        derivatives(*given, [r[0]], (), places)
    found = derivatives(*given, [r[2], r[3]], [(r[0], 0, 1.0), (r[1], 0, 1.0)], places)
    np.testing.assert_allclose(found, [[0, 0, 0.5], [0, 0, 0.5], [0.5, 0, 0], [0, 0.25, 0]], atol=1e-15)


@pytest.mark.parametrize(("off", "answered"), [(1e-11, True), (5e-10, True), (2e-9, False), (1e-6, False)])
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_sides_that_differ_by_more_than_a_billionth_disagree(off: float, answered: bool, size: float) -> None:
    """Of the largest of them, in units of the equations."""
    matrix, right = np.array([[1.0, 1.0], [4.0, 4.0]]), size * np.array([[1.0 - off], [4.0 * (1.0 + off)]])
    if answered:
        np.testing.assert_allclose(answer(matrix, right), size * np.full((2, 1), 0.5), rtol=1e-8)
    else:
        with pytest.raises(np.linalg.LinAlgError):
            solve_shared(matrix, right)


def test_an_equation_without_unknowns_and_one_without_equation() -> None:
    """0 = 0 leaves the other equations alone, 0 = 1 is refused; an unknown that nothing tells is zero."""
    matrix = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 8.0]])
    np.testing.assert_allclose(answer(matrix, np.array([[0.0], [3.0], [4.0]])), [[1.5], [0.0], [0.5]], atol=1e-15)
    for small in (1.0, 1e-6):
        with pytest.raises(np.linalg.LinAlgError):
            solve_shared(matrix, np.array([[small], [3.0], [4.0]]))


def test_no_equations_have_an_empty_solution() -> None:
    assert answer(np.diag([3.0]), np.zeros((1, 0))).shape == (1, 0)
