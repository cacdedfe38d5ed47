"""The choice of states: dummy derivatives, preferences, numerical pivots."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.errors import SingularError
from gearlib.structure.pantelides import Differentiation
from gearlib.structure.states import constraints, matched, select_columns

c = gl.connect


class Pendulum(gl.Component):
    """Mattsson and Soderlind's first example: a point mass on a rod, in Cartesian coordinates."""

    L = gl.Parameter("m", "length", default=1.0, min=0)
    x = gl.Variable("m", "horizontal")
    y = gl.Variable("m", "vertical")
    u = gl.Variable("m/s", "horizontal speed")
    v = gl.Variable("m/s", "vertical speed")
    T = gl.Variable("1/s2", "rod force over mass and length")

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.u),
            gl.Eq(gl.der(self.y), self.v),
            gl.Eq(gl.der(self.u), self.T * self.x),
            gl.Eq(gl.der(self.v), self.T * self.y - 9.81),
            gl.Eq(self.x**2 + self.y**2, self.L**2),
        ]


@pytest.mark.parametrize(
    ("angle", "states"),
    [(0.1, {"x", "u"}), (0.7, {"x", "u"}), (0.9, {"y", "v"}), (1.5, {"y", "v"}), (-2.0, {"y", "v"}), (3.0, {"x", "u"})],
)
def test_pendulum_keeps_the_coordinate_that_moves(angle: float, states: set[str]) -> None:
    """Two states of four candidates: the pair whose pivot (the other coordinate) is the larger one."""
    system = gl.compile(Pendulum(start={"x": np.sin(angle), "y": -np.cos(angle)}))
    assert set(system.states) == states
    assert "structural index 3; 3 equations differentiated, up to 2 times" in system.summary()


def test_a_start_at_which_no_choice_exists() -> None:
    with pytest.raises(SingularError, match="the constraints of Pendulum depend on each other at these values"):
        gl.compile(Pendulum())  # x = y = 0


@given(st.integers(0, 10_000))
def test_columns_chosen_are_a_basis_of_least_preference(seed: int) -> None:
    """The greedy choice against all choices: no other basis is worse wanted in any position (matroid)."""
    rng = np.random.default_rng(seed)
    m, n = int(rng.integers(1, 5)), int(rng.integers(5, 8))
    A = rng.integers(-2, 3, size=(m, n)).astype(float)
    rows = {(i, 0): {(j, 0): a for j, a in enumerate(row) if a} for i, row in enumerate(A)}
    badness = {(j, 0): (float(rng.integers(0, 3)),) for j in range(n)}
    chosen, failed = select_columns(rows, badness)
    columns = [j for j, _ in chosen]
    rank = int(np.linalg.matrix_rank(A))
    assert len(columns) == rank == m - len(failed)
    assert np.linalg.matrix_rank(A[:, columns]) == rank
    ordered = sorted(range(n), key=lambda j: -badness[j, 0][0])
    greedy: list[int] = []
    for j in ordered:
        if np.linalg.matrix_rank(A[:, [*greedy, j]]) > len(greedy):
            greedy.append(j)
    assert sorted(badness[j, 0][0] for j in columns) == sorted(badness[j, 0][0] for j in greedy)


def test_a_structurally_sound_pivot_that_is_zero_is_not_taken() -> None:
    # the second row is the first in columns 0 and 1: after elimination only column 2 is left for it
    rows = {(0, 0): {(0, 0): 1.0, (1, 0): 2.0}, (1, 0): {(0, 0): 1.0, (1, 0): 2.0, (2, 0): 1.0}}
    chosen, failed = select_columns(rows, {(0, 0): (9.0,), (1, 0): (9.0,), (2, 0): (0.0,)})
    assert (chosen - {(0, 0), (1, 0)}, len(chosen), failed) == ({(2, 0)}, 2, [])


def test_constraints_are_all_but_the_highest_derivatives() -> None:
    """0 = f(x, y) twice differentiated and g(z) once, of which x' is in no equation as such, and z stands twice."""
    x, y, z = range(3)
    result = Differentiation((2, 0, 1), {x: 2, y: 1, z: 3}, {0: x, 1: y, 2: z})
    entries = [(0, x, 0, 2.0), (0, y, 0, -3.0), (2, z, 1, 1.5), (2, z, 1, 0.5), (2, z, 2, 4.0), (2, x, 0, 0.0), (1, y, 0, 7.0)]
    rows = constraints(result, entries)
    assert rows == {
        (0, 0): {(x, 0): 2.0, (y, 0): -3.0},
        (0, 1): {(x, 1): 2.0},  # y' is the highest derivative of y
        (2, 0): {(z, 1): 2.0, (z, 2): 4.0},
    }
    solved_by = matched(result, {**rows, (2, 0): {(z, 1): 0.0, (z, 2): 4.0}}, {(y, 0), (x, 1), (z, 1), (z, 2)})
    highest = {(x, 2): (0, 2), (y, 1): (1, 0), (z, 3): (2, 1)}
    assert solved_by == {**highest, (y, 0): (0, 0), (x, 1): (0, 1), (z, 2): (2, 0)}


@pytest.mark.parametrize(("difference", "independent"), [(1e-2, True), (1e-4, False)])
def test_rows_are_dependent_below_a_share_of_their_largest_coefficient(difference: float, independent: bool) -> None:
    rows = {(0, 0): {(0, 0): 1.0, (1, 0): 1.0}, (1, 0): {(0, 0): 10.0, (1, 0): 10.0 * (1 + difference)}}
    chosen, failed = select_columns(rows, {}, zero=1e-3)
    assert (len(chosen), len(failed)) == ((2, 0) if independent else (1, 1))


def test_among_equals_ranks_decide_and_where_coefficients_vary_the_largest_one() -> None:
    rows = {(4, 0): {(7, 0): 1.0, (8, 0): 1.0, (9, 0): -5.0}}
    assert select_columns({(4, 0): {(7, 0): 1.0, (8, 0): 1.0}}, {}) == ({(7, 0)}, [])
    assert select_columns({(4, 0): {(7, 0): 1.0, (8, 0): 1.0}}, {}, ranks=[0] * 7 + [2, 1]) == ({(8, 0)}, [])
    less_wanted = {(7, 0): (3.0,), (8, 0): (3.0,), (9, 0): (1.0,)}
    assert select_columns(rows, less_wanted, varying=frozenset({4})) == ({(7, 0)}, []), "what is wanted comes first"
    assert select_columns(rows, {}, varying=frozenset({4})) == ({(9, 0)}, [])


def chain(n: int) -> gl.Component:
    class Chain(gl.Component):
        def assemble(self) -> list[Any]:
            self.body = [gp.Inertia(J=1.0 + i) for i in range(n)]
            self.shaft = [gp.SpringDamper(c=100.0, d=1.0) for _ in range(n - 1)]
            links = [c(a.flange_b, s.flange_a) for a, s in zip(self.body, self.shaft)]
            return links + [c(s.flange_b, b.flange_a) for s, b in zip(self.shaft, self.body[1:])]

    return Chain()


@pytest.mark.parametrize("n", [2, 5])
def test_deflections_and_speeds_come_before_absolute_angles(n: int) -> None:
    system = gl.compile(chain(n))
    assert sorted(system.states) == sorted([f"shaft[{i}].phi_rel" for i in range(n - 1)] + [f"body[{i}].w" for i in range(n)])
    assert f"{2 * n} possible, {2 * n - 1} integrated" in system.summary()


def test_angles_of_connectors_are_avoided_without_being_told() -> None:
    class Elastic(gl.Component):
        flange_a = gp.Flange("one side")
        flange_b = gp.Flange("other side")
        q = gl.Variable("rad", "deflection, of no declared preference")

        def equations(self) -> list[gl.Eq]:
            return [
                gl.Eq(10 * self.q, 3 * self.flange_a.phi - self.flange_b.phi),
                gl.Eq(self.flange_b.tau, -100.0 * self.q - 1.0 * gl.der(self.q)),
                gl.Eq(self.flange_a.tau, -3 * self.flange_b.tau),
            ]

    class Model(gl.Component):
        def assemble(self) -> list[Any]:
            self.a, self.b, self.elastic = gp.Inertia(J=1.0), gp.Inertia(J=1.0), Elastic()
            return [c(self.a.flange_b, self.elastic.flange_a), c(self.elastic.flange_b, self.b.flange_a)]

    assert set(gl.compile(Model()).states) == {"a.w", "b.w", "elastic.q"}


def test_an_absolute_angle_is_a_state_where_something_depends_on_it() -> None:
    class Held(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.spring, self.ground = gp.Inertia(J=1.0), gp.Spring(c=4.0), gp.Fixed()
            return [c(self.body.flange_b, self.spring.flange_a), c(self.spring.flange_b, self.ground.flange)]

    assert set(gl.compile(Held()).states) == {"spring.phi_rel", "body.w"}


@pytest.mark.parametrize(("preference", "states"), [("prefer", ("y",)), ("default", ("x",)), ("never", ("x",))])
def test_preferences_are_followed(preference: Any, states: tuple[str, ...]) -> None:
    class Leaf(gl.Component):
        x = gl.Variable("1", "one", start=1.0)  # among equals the one with a fixed start
        y = gl.Variable("1", "other", state=preference)

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.y, 2 * self.x), gl.Eq(gl.der(self.x) + gl.der(self.y), -3 * self.x)]

    system = gl.compile(Leaf())
    assert system.states == states
    result = system.simulate(1.0, samples=5)
    assert result["x"] == pytest.approx(np.exp(-result.time), rel=1e-10)


def test_only_what_the_outputs_need_is_integrated() -> None:
    class Two(gl.Component):
        def assemble(self) -> list[Any]:
            self.one, self.other = chain(2), chain(3)
            return []

    assert len(gl.compile(Two()).states) == 3 + 5
    assert len(gl.compile(Two(), outputs=["other.body[0].w"]).states) == 5
    assert len(gl.compile(Two(), outputs=["one.body[0].phi"]).states) == 4  # an absolute angle, too


def test_what_an_event_gives_a_value_is_a_state_whatever_is_preferred() -> None:
    class Pair(gl.Component):
        x = gl.Variable("m", state="prefer")
        y = gl.Variable("m")
        v = gl.Variable("m/s")

        def equations(self) -> list[Any]:
            jump = gl.When(gl.time > 0.5, gl.reinit(self.y, 0))
            return [gl.Eq(gl.der(self.y), 2), gl.Eq(self.y, 2 * self.x), gl.Eq(self.v, gl.der(self.x)), jump]

    result = gl.simulate(Pair(), 1.0, samples=3)
    assert result["x"] == pytest.approx([0.0, 0.0, 0.5], abs=1e-9)
