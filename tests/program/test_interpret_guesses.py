"""Where iterations start: at a guess of each time, or at one for the first time and then at the solution before."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SolverError
from gearlib.program.interpret import evaluate


class Folded(gl.Component):
    """``y^3 - 3 y = a`` has three roots where a is between -2 and 2; ``z^2 = b`` has two, one or none."""

    a, b, y, z = (gl.Variable("1") for _ in range(4))
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.a), self.rate * self.y), gl.Eq(gl.der(self.b), self.rate * self.z),
            gl.Eq(self.y**3 - 3 * self.y, self.a), gl.Eq(self.z**2, self.b),
        ]  # fmt: skip


@cache
def folded() -> Any:
    return gl.compile(Folded()).translation


def roots(a: Any, b: Any, y: Any = None, z: Any = None, forgiving: bool = False) -> Any:
    """Of both equations at several times; from no guess, one, or one for each time."""
    scene = folded().scene
    numbers, names = scene.numbers(folded().parameter_values({})), scene.state_names
    places = [scene.program.slots[scene.model.variable(name), 0] for name in "yz"]
    times, guess = len(np.ravel(a)), None
    if y is not None:
        guess = np.full((scene.program.n_slots, *np.shape(y)), 0.5)
        guess[places] = y, z
    x = np.array([{"a": a, "b": b}[name] for name in names], float)
    none = np.empty((0, times))
    return evaluate(numbers, np.arange(times) + 0.25, x, none, none, guess, forgiving)[places]


def real_root(a: float, near: float) -> float:
    found = np.roots([1.0, 0.0, -3.0, -a])
    return float(min(found[np.abs(found.imag) < 1e-9].real, key=lambda root: abs(root - near)))


def test_each_time_begins_where_the_one_before_ended() -> None:
    """Beyond the fold the lower branch has ended, so that the upper one is followed back."""
    found = roots([0.0, 30.0, 0.0], [4.0, 9.0, 1.0], -2.0, -1.0)
    expected = [-np.sqrt(3.0), real_root(30.0, 3.4), np.sqrt(3.0)]
    np.testing.assert_allclose(found, [expected, [-2.0, -3.0, -1.0]], rtol=1e-12)
    np.testing.assert_allclose(roots([0.0, 0.0], [4.0, 9.0], 2.0, 1.0), [[np.sqrt(3.0)] * 2, [2.0, 3.0]], rtol=1e-12)


def test_each_time_has_a_guess_of_its_own() -> None:
    """Whatever is found at the others."""
    found = roots([0.0, 3.0, 0.0], [4.0, 9.0, 1.0], [-2.0, -2.0, -2.0], [1.0, -1.0, -0.1])
    np.testing.assert_allclose(found, [[-np.sqrt(3.0), real_root(3.0, 2.1), -np.sqrt(3.0)], [2.0, -3.0, -1.0]], rtol=1e-12)
    found = roots([1.0, 1.0, 1.0], [4.0, 4.0, 4.0], [2.0, -2.0, -0.2], [-0.1, 5.0, -9.0])
    expected = [real_root(1.0, 2.0), real_root(1.0, -2.0), real_root(1.0, -0.3)]
    np.testing.assert_allclose(found, [expected, [-2.0, 2.0, -2.0]], rtol=1e-12)


@pytest.mark.parametrize("own", [True, False], ids=["of each time", "of the first"])
def test_times_without_a_root_leave_the_others_theirs(own: bool) -> None:
    a, b = [1.0, 1.0, 1.0, 1.0], [4.0, -1.0, 9.0, 16.0]
    y, z = ([2.0, 2.0, -2.0, 2.0], [1.0, 1.0, -1.0, -1.0]) if own else (-2.0, -1.0)
    with pytest.raises(
        SolverError, match=r"^the nonlinear equations Folded: .* were not solved at t = 1\.25 s; they have no solution"
    ):
        roots(a, b, y, z)
    found = roots(a, b, y, z, forgiving=True)
    expected = np.stack([[real_root(1.0, g) for g in np.broadcast_to(y, 4)], np.sign(z) * np.sqrt(np.abs(b))])
    expected[1] *= np.ones(4)
    np.testing.assert_allclose(found[:, [0, 2, 3]], expected[:, [0, 2, 3]], rtol=1e-12)
    assert found[0, 1] == pytest.approx(expected[0, 1], rel=1e-12)
    alone = roots(a[1:2], b[1:2], *((y[1:2], z[1:2]) if own else (y, z)), forgiving=True)
    assert alone[0] == pytest.approx(expected[0, 1], rel=1e-12)


def test_without_a_guess_the_first_begins_at_zero() -> None:
    """From the middle branch; a square begins at its vertex and goes upwards."""
    found = roots([1.0, 1.5, 1.9], [4.0, 9.0, 1.0])
    expected = [real_root(1.0, -0.3), real_root(1.5, -0.5), real_root(1.9, -0.8)]
    np.testing.assert_allclose(found, [expected, [2.0, 3.0, 1.0]], rtol=1e-12)


@pytest.mark.parametrize("z", [[1.0, -1.0], [-1.0, 1.0]])
@pytest.mark.parametrize("wrong", [0, 1])
def test_of_two_times_one_may_have_a_root(wrong: int, z: list[float]) -> None:
    b = [4.0, 4.0]
    b[wrong] = -1.0
    found = roots([1.0, 1.0], b, [2.0, 2.0], z, forgiving=True)
    assert found[1, 1 - wrong] == pytest.approx(2.0 * z[1 - wrong], rel=1e-12)


def test_of_several_times_without_a_root_the_first_is_named() -> None:
    for wrong in ([1], [1, 2], [0, 3], [2, 3]):
        b = np.array([4.0, 9.0, 1.0, 16.0])
        b[wrong] = -b[wrong]
        for z in (np.ones(4), 1.0):
            with pytest.raises(SolverError, match=rf"were not solved at t = {wrong[0]}\.25 s"):
                roots(np.ones(4), b, 2.0 * z, z)


@pytest.mark.parametrize(("offset", "size"), [(100.0, 3.0), (1.0, 0.01), (1000.0, 40.0)])
def test_equations_that_rounding_keeps_from_being_more_exact_are_solved(offset: float, size: float) -> None:
    """``(y + c)^2 - 2 c y - c^2`` is y^2 up to rounding of c^2, which differs from point to point; each y feels the next one."""
    n = 12

    def equations(self: Any) -> list[gl.Eq]:
        y, c = [getattr(self, f"y{i}") for i in range(n)], self.c
        ring = [
            gl.Eq((one + c) ** 2 - 2 * c * one - c**2, self.x * (1 + 0.1 * i) + self.e * other)
            for i, (one, other) in enumerate(zip(y, [*y[1:], y[0]], strict=True))
        ]
        return [gl.Eq(gl.der(self.x), self.rate * sum(y)), *ring]

    names = {f"y{i}": gl.Variable("1") for i in range(n)} | {"x": gl.Variable("1"), "rate": gl.Parameter("1/s", default=1.0)}
    names |= {"c": gl.Parameter("1", default=offset), "e": gl.Parameter("1", default=0.1 * size)}
    scene = gl.compile(type("Rounded", (gl.Component,), names | {"equations": equations})()).translation.scene
    none, guess = np.empty((0, 1)), np.full(scene.program.n_slots, 1.3 * size)
    numbers = scene.numbers(scene.model.parameters.values)
    slots = evaluate(numbers, np.zeros(1), np.array([[size**2]]), none, none, guess)[:, 0]
    y = slots[[scene.program.slots[scene.model.variable(f"y{i}"), 0] for i in range(n)]]
    rest = y**2 - size**2 * (1 + 0.1 * np.arange(n)) - 0.1 * size * np.roll(y, -1)
    assert np.abs(rest).max() <= 1e-14 * offset**2
    assert (y > 0).all()


@pytest.mark.parametrize("size", [1e-4, 1e-1, 1e2])
def test_roots_that_take_many_steps_are_exact_whatever_their_size(size: float) -> None:
    """Far from it, a step towards a cube root takes off a third."""

    class Cubed(gl.Component):
        x, y, rate = gl.Variable("1"), gl.Variable("1"), gl.Parameter("1/s", default=1.0)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(self.y**3, self.x)]

    scene = gl.compile(Cubed()).translation.scene
    none, guess = np.empty((0, 1)), np.full(scene.program.n_slots, 1e3 * size)
    slots = evaluate(scene.numbers(scene.model.parameters.values), np.zeros(1), np.array([[size**3]]), none, none, guess)
    assert slots[scene.program.slots[scene.model.variable("y"), 0], 0] == pytest.approx(size, rel=1e-10)
