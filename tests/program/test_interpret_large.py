"""Large blocks that are solved by iteration: sparse and full matrices give the same; messages where there is no solution."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SolverError
from gearlib.program.interpret import evaluate
from gearlib.program.program import Newton

N = 26


class Cell(gl.Component):
    y, following, x = gl.Variable("1", guess=0.4), gl.Variable("1"), gl.Variable("1")
    cubic, p, q = gl.Structural(True), gl.Parameter("1", default=1.0), gl.Parameter("1", default=1.0)

    def equations(self) -> list[gl.Eq]:
        if self.cubic:
            return [gl.Eq(self.y**3 + 2.0 * self.y - 0.5 * self.following, self.x)]
        return [gl.Eq(self.p * self.x * self.y + self.q * self.following, self.q)]


class Cells(gl.Component):
    """A ring: each unknown depends on the next one. The linear ones are ``x y + y' = 1``, singular at x = -1 and x = 1."""

    cubic = gl.Structural(True)
    rate = gl.Parameter("1/s", default=1.0)
    x = gl.Variable("1")

    def assemble(self) -> list[Any]:
        self.cell = [Cell(cubic=self.cubic) for _ in range(N)]
        return []

    def equations(self) -> list[gl.Eq]:
        ring = [gl.Eq(one.following, other.y) for one, other in zip(self.cell, [*self.cell[1:], self.cell[0]], strict=True)]
        shares = [gl.Eq(one.x, self.x * (1.0 + 0.1 * i if self.cubic else 1.0)) for i, one in enumerate(self.cell)]
        return [gl.Eq(gl.der(self.x), self.rate * sum(one.y for one in self.cell)), *ring, *shares]


@cache
def cells(cubic: bool) -> Any:
    return gl.compile(Cells(cubic=cubic)).translation


def values(
    cubic: bool, x: list[float], guess: Any = None, forgiving: bool = False, pq: tuple[float, float] = (1.0, 1.0),
    others: dict[str, float] | None = None,
) -> Any:  # fmt: skip
    """The unknowns of the ring, in its order, shape (cells, times)."""
    scene = cells(cubic).scene
    table = {f"cell[{i}].{name}": value for i in range(N) for name, value in zip("pq", pq, strict=True)} | (others or {})
    numbers, none = scene.numbers(cells(cubic).parameter_values(table)), np.empty((0, len(x)))
    (step,) = (s for s in scene.program.steps if isinstance(s, Newton))
    assert (step.linear, len(step.unknowns), step.order is not None) == (not cubic, N, True)
    if guess is not None:
        guess = np.full((scene.program.n_slots, len(x)), guess)
    slots = evaluate(numbers, np.arange(len(x), dtype=float), np.array([x]), none, none, guess, forgiving)
    model = scene.model
    return slots[[scene.program.slots[int(model.representative[model.variable(f"cell[{i}].y")]), 0] for i in range(N)]]


@pytest.mark.parametrize("most", [400, 10], ids=["dense", "sparse"])
@pytest.mark.parametrize("guess", [None, 0.3], ids=["one after the other", "together"])
def test_cubic_equations_in_a_ring(most: int, guess: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    x = np.array([0.5, -2.0, 0.0, 30.0])
    y = values(True, x.tolist(), guess)
    rest = y**3 + 2.0 * y - 0.5 * np.roll(y, -1, axis=0) - x * (1.0 + 0.1 * np.arange(N)[:, None])
    assert np.abs(rest).max() <= 1e-14 * (1.0 + np.abs(y).max() ** 3)


@pytest.mark.parametrize("entries", [1, 1_000_000], ids=["one by one", "together"])
@pytest.mark.parametrize("most", [400, 10], ids=["dense", "sparse"])
def test_linear_equations_in_a_ring(most: int, entries: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """All are 1 / (1 + x), or one of many solutions at x = 1."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    monkeypatch.setattr("gearlib.program.interpret.ENTRIES", entries)
    x = np.array([0.5, 1.0, -3.0, 1.0, 4.0])
    y = values(False, x.tolist())
    np.testing.assert_allclose(x * y + np.roll(y, -1, axis=0), np.ones_like(y), rtol=1e-12)
    np.testing.assert_allclose(y[:, x != 1], np.tile(1 / (1 + x[x != 1]), (N, 1)), rtol=1e-12)
    if most > N:
        np.testing.assert_allclose(y[:, 1], np.full(N, 0.5), rtol=1e-12)  # the smallest


@pytest.mark.parametrize("most", [400, 10], ids=["dense", "sparse"])
@pytest.mark.parametrize("unit", [1.0, 1e8, 1e-8])
def test_equations_in_a_ring_that_depend_on_each_other_up_to_rounding(
    most: int, unit: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.1 times 3 is not 0.3: one of the many solutions, and no large numbers."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    y = values(False, [3.0, 1.0], pq=(0.1 * unit, 0.3 * unit))
    np.testing.assert_allclose((y + np.roll(y, -1, axis=0))[:, 0], np.ones(N), rtol=1e-12)
    assert np.abs(y).max() < 10.0
    np.testing.assert_allclose(y[:, 1], np.full(N, 0.75), rtol=1e-12)


@pytest.mark.parametrize(
    ("pq", "units"),
    [
        ((0.1, 0.3), (1, 1)),
        ((1.0, 3.0), (1, 1)),
        ((1e6, 3e6), (0.1, 0.1)),
        ((1.1, 3.3), (1e8, 1e8)),
        ((0.1, 0.3), (1e-8, 1e-8)),
        ((0.1, 0.3), (1e-9, 1e9)),
        ((0.1, 0.3), (1e9, 1e-9)),
    ],
)
@pytest.mark.parametrize("most", [400, 10], ids=["dense", "sparse"])
def test_equations_in_a_ring_that_disagree_are_refused(
    most: int, pq: tuple[float, float], units: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """y' = 1 - y leads back to y after an even number of cells, but with a factor c at one and 1 / c at the next to 1 - 1 / c + y."""
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    factors, scale = np.ones((N, 1)), np.tile(units, N // 2)[:, None]
    factors[:2, 0] = 2.0, 0.5
    p, q = pq[0] * scale * factors, pq[1] * scale
    given = {f"cell[{i}].p": float(p[i, 0]) for i in range(N)} | {f"cell[{i}].q": float(q[i, 0]) for i in range(N)}
    with pytest.raises(SolverError, match=rf"^the equations cell.* and {N - 4} more have no solution at t = 1 s: they depend"):
        values(False, [4.0, 3.0], others=given)
    x = np.array([4.0, 0.3])
    y = values(False, x.tolist(), others=given)
    rest = (p * x * y + q * np.roll(y, -1, axis=0)) / q
    np.testing.assert_allclose(rest, np.ones((N, 2)), atol=1e-10 * np.abs(y).max())


@pytest.mark.parametrize("most", [400, 10], ids=["dense", "sparse"])
def test_a_large_block_without_a_solution_names_its_first_equations(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.program.interpret.MOST_DENSE", most)
    text = rf"^the equations (cell\[\d+\]: [^;]+; ){{3}}cell\[\d+\]: [^;]+ and {N - 4} more have no solution at t = 1 s: they depend"
    with pytest.raises(SolverError, match=text):
        values(False, [0.5, -1.0, 2.0])
    found = values(False, [0.5, -1.0, 2.0], forgiving=True)
    np.testing.assert_allclose(found[:, [0, 2]], np.tile([1 / 1.5, 1 / 3], (N, 1)), rtol=1e-12)


def test_an_iteration_that_does_not_end_names_its_first_equations() -> None:
    """With no number among what is given."""
    text = (
        rf"^the nonlinear equations (cell\[\d+\]: [^;]+; ){{3}}cell\[\d+\]: [^;]+ and {N - 4} more were not solved at t = 1 s"
    )
    for guess in (None, 0.3):
        with pytest.raises(SolverError, match=text):
            values(True, [0.5, np.nan, 2.0], guess)
        found = values(True, [0.5, np.nan, 2.0], guess, forgiving=True)
        np.testing.assert_allclose(found[:, [0, 2]], values(True, [0.5, 2.0], guess), rtol=1e-13)


class CubeRoot(gl.Component):
    rate = gl.Parameter("1/s", default=1.0)
    x, y = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(self.y**3, self.x)]


def test_small_roots_far_from_their_guess_are_exact() -> None:
    """Cube roots of which the iteration needs many steps, at many times together and one after the other."""
    scene = gl.compile(CubeRoot()).translation.scene
    numbers, roots = scene.numbers(scene.model.parameters.values), np.geomspace(1e-5, 1e-2, 12)
    none = np.empty((0, len(roots)))
    for guess in (np.ones(scene.program.n_slots), np.ones((scene.program.n_slots, len(roots)))):
        slots = evaluate(numbers, np.zeros(len(roots)), roots[None, ::-1] ** 3, none, none, guess)
        np.testing.assert_allclose(slots[scene.program.output_slots[0]], roots[::-1], rtol=1e-9)
