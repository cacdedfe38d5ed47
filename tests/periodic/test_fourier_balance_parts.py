"""Parts of the equations of harmonic balance: null spaces, sizes of terms, and rigid motions of systems that are written down."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import SolverError
from gearlib.periodic import fourier_balance as parts
from gearlib.periodic.first_motion import Forced
from gearlib.periodic.fourier_balance import HarmonicEquations, Rigid, rigid_motions, terms


@pytest.mark.parametrize(
    ("matrix", "kernel"),
    [
        ([[1e-20, 1e-20, 0.0], [0.0, 0.0, 1e20]], [[1.0, -1.0, 0.0]]),  # each row in a unit of its own
        ([[0.0, 0.0], [3.0, 4.0]], [[0.8, -0.6]]),
        ([[1.0, 0.0], [1.0, 1e-14]], [[0.0, 1.0]]),  # but for rounding
        ([[1.0, 0.0], [1.0, 1e-12]], []),
        ([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], []),
        ([[0.0, 0.0, 0.0]], np.eye(3)),
        (np.empty((0, 2)), np.eye(2)),
    ],
)
def test_a_null_space_of_rows_in_any_unit(matrix: Any, kernel: Any) -> None:
    matrix = np.array(matrix, float)
    found = parts.kernel(matrix)
    expected = np.array(kernel, float).reshape(len(kernel), matrix.shape[1])
    assert found.shape == expected.T.shape
    assert found.T @ found == pytest.approx(np.eye(len(expected)))
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert found @ found.T == pytest.approx(expected.T @ expected, abs=1e-12)


def test_terms_are_sums_of_sizes_before_they_cancel() -> None:
    driven: Any = SimpleNamespace(omega=5.0, growth=np.array([0.0, -2.0]))
    found: Any = SimpleNamespace(weights=np.array([0.25, 0.75]))
    slopes = np.array([[[1.0, -2.0], [3.0, 0.0]], [[-4.0, 0.0], [1.0, -8.0]]])
    sizes = np.array([10.0, 100.0])
    mean = 0.25 * np.abs(slopes[0]) + 0.75 * np.abs(slopes[1])
    assert terms(driven, found, slopes, sizes) == pytest.approx(mean @ sizes / 5.0 + [0.0, 2.0])


def test_natural_units_are_those_in_which_states_act_on_each_other_alike() -> None:
    """Usual values count, and means where most are zero."""
    mutual = np.array([[0.0, 400.0], [1.0, 0.0]])
    found = parts.natural_units(np.array([mutual, mutual, 1e9 * mutual]))
    assert np.abs(mutual * found / found[:, None])[[0, 1], [1, 0]] == pytest.approx([20.0, 20.0], rel=1.0)
    sometimes = np.zeros((3, 2, 2))
    sometimes[0] = mutual
    assert parts.natural_units(sometimes)[0] / parts.natural_units(sometimes)[1] == found[0] / found[1]


def test_a_speed_that_the_torques_determine_is_refused_by_the_names_of_what_turns() -> None:
    def said(*growth: float) -> str:
        scene = SimpleNamespace(state_names=("a.p", "w", "b.p"))
        return str(parts.other_speed(SimpleNamespace(scene=scene, growth=np.array(growth), omega=12.5)))  # type: ignore[arg-type]

    assert said(0.0, 0.0, 1.0) == (
        "the train turns with b.p at a speed that its torques determine, which is not the one that 12.5 rad/s asks for; make the torques "
        "that drive and load it constant, and let them balance"
    )
    assert said(-1.0, 0.0, 2.0).startswith("the train turns with a.p, b.p at a speed")
    assert said(-1.0, 0.0, 2.0).endswith(
        ". Transmission errors of meshes in a row determine it as well: give them as functions of time, and frequency=..."
    )


def test_vectors_without_their_free_components() -> None:
    free = np.array([[0.6], [0.8], [0.0]])
    none = np.empty((3, 0))
    rigid = Rigid(none, none.T, np.zeros(3), free, np.ones(3), none, none)
    assert rigid.without_free(np.array([3.0, 4.0, 5.0])) == pytest.approx([0.0, 0.0, 5.0])
    assert rigid.without_free(np.diag([1.0, 1.0, 2.0])) == pytest.approx(
        np.array([[0.64, -0.48, 0], [-0.48, 0.36, 0], [0, 0, 2.0]])
    )


class Couple(gl.Component):
    """Two bodies on a shaft, of which the first may be held; ``x`` is the angle of the first, ``d`` that between them."""

    F = gl.Input("1")
    held = gl.Parameter("1", default=0.0)
    x, d = gl.Variable("1"), gl.Variable("1")
    v, u = gl.Variable("1", start=2.0), gl.Variable("1", start=2.0)

    def equations(self) -> list[gl.Eq]:
        between = 9.0 * self.d + 0.3 * (self.v - self.u)
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.d), self.v - self.u),
            gl.Eq(gl.der(self.v), self.F - between - self.held * self.x),
            gl.Eq(4.0 * gl.der(self.u), between),
        ]


@cache
def couple() -> gl.System:
    return gl.compile(Couple())


def rigid(held: float, scale: Any = None) -> tuple[Rigid, dict[str, int], Any]:
    task = Forced(couple().translation, None, {"held": held}, {"F": lambda phase, w: np.cos(phase)}, 1, {})
    scene = task.scene(["x", "d", "v", "u"])
    at = {name: k for k, name in enumerate(scene.state_names)}
    driven = task.driven(scene)(0.7)
    means = np.array([{"v": 2.0, "u": 2.0}.get(name, 0.0) for name in scene.state_names])
    return rigid_motions(driven, means, np.ones(4) if scale is None else scale(at), np.ones(4)), at, driven


@pytest.mark.parametrize("unit", [1.0, 1e-4, 1e4])
def test_a_train_that_nothing_holds_keeps_its_momentum_and_turns(unit: float) -> None:
    """Combinations ``v + 4 u`` of the scaled rates; its angle is free, and nothing depends on it."""

    def scale(at: dict[str, int]) -> np.ndarray:
        found = np.ones(4)
        found[at["v"]] = unit
        return found

    found, at, _ = rigid(0.0, scale)
    momentum = np.zeros(4)
    momentum[at["v"]], momentum[at["u"]] = unit, 4.0
    angle = np.eye(4)[at["x"]]
    (kept,) = found.sums.T
    assert np.abs(kept @ momentum) == pytest.approx(np.linalg.norm(momentum))
    assert np.abs(found.free.T) == pytest.approx(angle[None], abs=1e-9)
    assert np.abs(found.idle.T) == pytest.approx(angle[None], abs=1e-9)
    assert found.rows.shape == (1, 4)
    assert np.abs(found.rows[0] @ momentum) == pytest.approx(np.linalg.norm(momentum))  # its mean stays where it starts
    assert found.without_free(np.ones(4))[at["x"]] == pytest.approx(0.0, abs=1e-9)


def test_a_train_that_is_held_has_no_rigid_motion() -> None:
    found, _, _ = rigid(5.0)
    assert [part.size for part in (found.sums, found.rows, found.free, found.kept, found.idle)] == [0] * 5
    assert found.means.tolist().count(2.0) == 2


class Integrated(gl.Component):
    """An oscillator, the integral of its speed, and that of its square, on which nothing depends."""

    F = gl.Input("1")
    x, v = gl.Variable("1", start=0.5), gl.Variable("1")
    p, q = gl.Variable("1", start=3.0), gl.Variable("1", start=4.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.v), self.F - 0.1 * self.v - self.x),
            gl.Eq(gl.der(self.p), self.v),
            gl.Eq(gl.der(self.q), self.v**2),
        ]


def test_integrals_on_which_nothing_depends_may_grow() -> None:
    """Both are free and idle; no combination needs to balance."""
    task = Forced(gl.compile(Integrated()).translation, None, {}, {"F": lambda phase, w: np.cos(phase)}, 1, {})
    scene = task.scene(["x", "p", "q"])
    integral = np.diag([float(name in ("p", "q")) for name in scene.state_names])
    found = rigid_motions(task.driven(scene)(0.7), np.ones(4), np.ones(4), np.ones(4))
    assert (found.sums.shape, found.rows.shape, found.kept.shape) == ((4, 0), (0, 4), (4, 0))
    assert found.free @ found.free.T == pytest.approx(integral, abs=1e-9)
    assert found.idle @ found.idle.T == pytest.approx(integral, abs=1e-9)


class Parted(gl.Component):
    """A body that a spring holds in one half of each period."""

    w = gl.Parameter("rad/s", default=1.0)
    late = gl.Parameter("rad", default=0.0)
    x, v = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        spring = gl.Piecewise((self.x, gl.sin(self.w * gl.time - self.late) > 0), (0, True))
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), gl.cos(self.w * gl.time) - spring)]


@pytest.mark.parametrize("late", [0.0, np.pi / 2, np.pi, 3 * np.pi / 2])
def test_what_holds_a_train_in_some_part_of_the_period_holds_it(late: float) -> None:
    task = Forced(gl.compile(Parted()).translation, "w", {"late": late}, {}, 1, {})
    found = rigid_motions(task.driven(task.scene(["x"]))(0.7), np.zeros(2), np.ones(2), np.ones(2))
    assert [part.size for part in (found.sums, found.rows, found.free, found.idle)] == [0] * 4


class Somewhere(gl.Component):
    """A body that a spring holds where it is far away, or near."""

    far = gl.Structural(True)
    x, v = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[Any]:
        where = self.x > 1e4 if self.far else abs(self.x) < 0.1
        spring = gl.Piecewise((self.x, where), (0, True))
        return [gl.Eq(gl.der(self.x), self.v), gl.Eq(gl.der(self.v), gl.cos(gl.time) - spring)]


@pytest.mark.parametrize("far", [True, False])
def test_what_holds_a_train_somewhere_holds_it(far: bool) -> None:
    """From a hundredth of the nominal value to a million of it."""
    task = Forced(gl.compile(Somewhere(far=far)).translation, None, {}, {}, 1, {})
    found = rigid_motions(task.driven(task.scene(["x"]))(1.0), np.zeros(2), np.ones(2), np.ones(2))
    assert [part.size for part in (found.sums, found.rows, found.free, found.idle)] == [0] * 4


def test_the_size_of_a_motion_is_a_thousandth_of_the_scale_at_least() -> None:
    found, _, driven = rigid(5.0)
    scale = np.array([1e-3, 2.0, 2.0, 50.0])
    equations = HarmonicEquations(lambda omega: driven, 1, 16, scale, found, True)
    c = np.array([[0.0, 0.0, 0.3, 1.0], [0.0, 1e-4, -0.7, 0.0], [1e-7, 0.0, 0.1, -2.0]])
    assert equations._step(c) == pytest.approx([1e-6, 2e-3, 0.7, 2.0])


def test_directions_in_which_a_train_turns_are_those_that_are_not_given_as_turning() -> None:
    _, at, driven = rigid(0.0)
    none, given = np.empty((4, 0)), np.eye(4)[:, [at["x"]]]
    scale = np.array([2.0, 3.0, 4.0, 5.0])
    assert np.abs(parts.free_directions(driven, scale, none).T) == pytest.approx(given.T, abs=1e-9)
    assert parts.free_directions(driven, scale, given).shape == (4, 0)
    _, _, still = rigid(5.0)
    assert parts.free_directions(still, scale, none).shape == (4, 0)


class TwoOnAShaft(gl.Component):
    """Two bodies on a shaft, with the angle of each."""

    F = gl.Input("1")
    x, y = gl.Variable("1", nominal=1e-2), gl.Variable("1", nominal=10.0)
    v, u = gl.Variable("1"), gl.Variable("1")

    def equations(self) -> list[gl.Eq]:
        between = 9.0 * (self.x - self.y)
        return [
            gl.Eq(gl.der(self.x), self.v),
            gl.Eq(gl.der(self.y), self.u),
            gl.Eq(gl.der(self.v), self.F - between),
            gl.Eq(gl.der(self.u), between),
        ]


def test_a_direction_in_which_all_turn_alike_is_scaled_with_its_states() -> None:
    task = Forced(gl.compile(TwoOnAShaft()).translation, None, {}, {"F": lambda phase, w: np.cos(phase)}, 1, {})
    scene = task.scene(["x", "y"])
    scale = np.array([{"x": 2.0, "y": 5.0}.get(name, 7.0) for name in scene.state_names])
    (found,) = parts.free_directions(task.driven(scene)(0.7), scale, np.empty((4, 0))).T
    alike = np.array([1.0 if name in ("x", "y") else 0.0 for name in scene.state_names]) / scale
    assert abs(found @ alike) == pytest.approx(np.linalg.norm(alike), rel=1e-9)


@pytest.mark.parametrize("off", [0.0, 1e-8, 1e-5])
def test_mean_rates_that_nothing_balances_vanish(off: float) -> None:
    """To a ten-millionth of the largest rate."""
    found, at, driven = rigid(0.0)
    equations = HarmonicEquations(lambda omega: driven, 1, 16, np.ones(4), found, True)
    first, mean = np.zeros(4), np.zeros((3, 4))
    first[at["u"]], mean[1, at["v"]] = off, 1.0
    if off < 1e-7:
        equations._check(first, mean, 0.7)
        return
    rate = -0.7 * off * 4.0 / 17.0 * np.array([1.0, 4.0])  # the part along the momentum, which is largest in u
    with pytest.raises(
        SolverError, match=rf"^there is no periodic motion at 0\.7 rad/s: u changes by {rate[1]:.3g} per second"
    ):
        equations._check(first, mean, 0.7)


@pytest.mark.parametrize("scale", [1.0, 0.1])
def test_free_states_grow_by_their_mean_rate(scale: float) -> None:
    """The angle of a train that turns at two radians per second while it vibrates; what is held does not grow."""
    for held, grows in ((0.0, 1.0), (5.0, 0.0)):
        found, at, driven = rigid(held, lambda at: scale * np.ones(4))
        equations = HarmonicEquations(lambda omega, driven=driven: driven, 1, 16, scale * np.ones(4), found, True)
        c = np.zeros((3, 4))
        c[0, [at["v"], at["u"]]], c[1, at["v"]], c[2, at["u"]] = 2.0, 0.7, -0.4
        expected = np.zeros(4)
        expected[at["x"]] = grows * 2.0 / 0.7
        assert equations.growth(equations.unknowns(c), 0.7) == pytest.approx(expected, abs=1e-9)


def test_a_combination_that_stays_takes_the_place_of_its_equation() -> None:
    """``v + 4 u`` at its start, whatever the rates are; the angle at its own."""
    found, at, driven = rigid(0.0)
    equations = HarmonicEquations(lambda omega: driven, 1, 16, np.ones(4), found, True)
    c = np.zeros((3, 4))
    c[0, at["v"]], c[0, at["u"]], c[0, at["x"]] = 2.5, 2.1, 0.3
    momentum, angle = np.zeros(4), np.eye(4)[at["x"]]
    momentum[at["v"]], momentum[at["u"]] = 1.0, 4.0
    momentum /= np.sqrt(17.0)
    rest, by_z, by_w = equations.equations(equations.unknowns(c), 0.7)
    off = c[0] - found.means
    assert abs(momentum @ rest[:4]) == pytest.approx(abs(momentum @ off))
    assert abs(angle @ rest[:4]) == pytest.approx(0.3)
    assert np.abs(momentum @ by_z[:4, :4]) == pytest.approx(np.abs(momentum))
    assert np.abs(angle @ by_z[:4, :4]) == pytest.approx(angle)
    for row in (momentum, angle):
        assert row @ by_z[:4, 4:] == pytest.approx(np.zeros(8), abs=1e-12)
        assert row @ by_w[:4] == pytest.approx(0.0, abs=1e-9)
