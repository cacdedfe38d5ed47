"""Parts of the exact solution: jumps of tangents, choice and refusal of algorithms, samples on breakpoints, overflow."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy

from gearlib.equations.quasipolynomials import TIME
from gearlib.equations.switch_times import rounding
from gearlib.errors import ArgumentError, SolverError
from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.exponential import exact
from gearlib.solvers.exponential.dense import estimate
from gearlib.solvers.exponential.exact import Exponential, cut, prepare, tangent_jumps
from gearlib.solvers.exponential.forcing import Forcing, NotExact, recognise
from gearlib.solvers.exponential.sparse_stepping import components, union
from gearlib.solvers.inputs.table import Table
from gearlib.solvers.problem import LinearChanges, LinearForm, MovedSwitch
from tests.solvers.exponential.test_exact import linear_problem


def known(inputs: list[Any], t_end: float = 2.0) -> Forcing:
    found = recognise(inputs, 0.0, t_end)
    assert isinstance(found, Forcing)
    return found


def switched(*switches: MovedSwitch, directions: int = 2) -> LinearForm:
    """Two states, three inputs."""
    changes = LinearChanges(tuple(np.zeros((2, 2)) for _ in range(directions)), np.zeros((directions, 2, 3)), switches)
    return LinearForm(np.zeros((2, 2)), np.array([[1.0, 2.0, 0.0], [0.0, 3.0, 5.0]]), (), changes=changes)


STEPS = [
    sympy.Piecewise((1, TIME < 0.5), (4, TIME < 1.5), (0, True)),
    sympy.Piecewise((TIME, TIME < 0.5), (sympy.Float(0.5), True)),
    sympy.Piecewise((2, TIME < 1.0), (-1, True)),
]
ONE, ZERO = sympy.Integer(1), sympy.Integer(0)


def test_tangents_jump_where_inputs_do_at_times_that_depend_on_directions() -> None:
    """S+ = S- + B (u- - u+) dt/dp, dt/dp = -(dg/dp) / (dg/dt); an input that is continuous there gives none."""
    first = MovedSwitch(0, 2 * TIME - 1, (ONE, TIME))  # at 0.5: dt/dp = -1/2 and -1/4
    bend = MovedSwitch(1, TIME - 0.5, (ONE, ONE))
    late = MovedSwitch(2, 1 - TIME**2, (ZERO, 3 * ONE))  # at 1: dt/dp = 0 and 3/2
    found = tangent_jumps(switched(first, bend, late), [0, 1, 2], known(STEPS))
    assert isinstance(found, dict)
    assert sorted(found) == [1, 2]  # at 1.5 an input jumps at a time of its own
    assert found[1] == pytest.approx(np.outer([-0.5, -0.25], [1.0, 0.0]) * (1.0 - 4.0), abs=1e-14)
    assert found[2] == pytest.approx(np.outer([0.0, 1.5], [0.0, 5.0]) * (2.0 + 1.0), abs=1e-14)


@pytest.mark.parametrize(
    ("before", "after"), [(3.0, -3.0), (-3.0, 3.0), (0.0, 2.0), (2.0, 0.0), (1.0, 1.0 + 1e-12), (1.0, 1.0 + 1e-15)]
)
def test_an_input_jumps_if_it_changes_by_more_than_rounding(before: float, after: float) -> None:
    step = known([sympy.Piecewise((before, TIME < 0.5), (after, True))])
    found = tangent_jumps(switched(MovedSwitch(0, TIME - 0.5, (ONE,)), directions=1), [0], step)
    assert isinstance(found, dict)
    if abs(after - before) > 1e-13:
        assert found[1].ravel() == pytest.approx([after - before, 0.0], rel=1e-3)
    else:
        assert found == {}


def test_jumps_of_several_inputs_at_one_time_add_up() -> None:
    """The columns say which inputs there are."""
    steps = [sympy.Piecewise((1, TIME < 0.5), (4, True)), sympy.Piecewise((0, TIME < 0.5), (2, True))]
    one, other = MovedSwitch(2, TIME - 0.5, (ONE, ZERO)), MovedSwitch(1, TIME - 0.5, (ZERO, ONE))
    found = tangent_jumps(switched(one, other, one), [1, 2], known(steps))
    assert isinstance(found, dict)
    expected = np.outer([0.0, -1.0], [2.0, 3.0]) * -3.0 + np.outer([-1.0, 0.0], [0.0, 5.0]) * -2.0
    assert found[1] == pytest.approx(expected, abs=1e-14)


def test_conditions_that_do_not_tell_one_time_are_named() -> None:
    forcing = known([STEPS[0]])
    touching = MovedSwitch(0, (TIME - 0.5) ** 2, (ONE,))
    found = tangent_jumps(switched(touching, directions=1), [0], forcing)
    assert isinstance(found, NotExact)
    assert found.reason.endswith("touches zero at t = 0.5 s without crossing it")
    one, other = MovedSwitch(0, TIME - 0.5, (ONE,)), MovedSwitch(0, 2 * TIME - 1, (ONE,))
    found = tangent_jumps(switched(one, other, directions=1), [0], forcing)
    assert isinstance(found, NotExact)
    assert found.reason == "conditions on time that depend differently on the parameters change together at t = 0.5 s"
    same = MovedSwitch(0, 2 * TIME - 1, (2 * ONE,))
    assert isinstance(tangent_jumps(switched(one, same, directions=1), [0], forcing), dict)
    assert tangent_jumps(switched(directions=1), [0], forcing) == {}
    assert tangent_jumps(replace(switched(), changes=None), [0], forcing) == {}


@pytest.mark.parametrize(
    ("share", "one_time"), [(0.0, True), (0.9e-9, True), (-0.9e-9, True), (1.2e-9, False), (-1.2e-9, False), (0.3, False)]
)
def test_two_conditions_change_together_if_their_times_do(share: float, one_time: bool) -> None:
    """In every direction, to a billionth, however little that moves them."""
    step = known([STEPS[0]])
    for size in (1.0, 1e-12):
        one = MovedSwitch(0, TIME - 0.5, (sympy.Float(size), ZERO))
        other = MovedSwitch(0, 2 * (TIME - 0.5), (sympy.Float(2.0 * size * (1.0 + share)), ZERO))
        found = tangent_jumps(switched(one, other), [0], step)
        assert isinstance(found, dict) == one_time
        if isinstance(found, dict):
            assert found[1] == pytest.approx(np.outer([-size, 0.0], [1.0, 0.0]) * -3.0, rel=1e-8, abs=0.0)


@pytest.mark.parametrize(("off", "counts"), [(0.9e-9, True), (1.1e-9, False), (-0.9e-9, True), (-1.1e-9, False)])
def test_a_condition_changes_where_its_zero_is_near(off: float, counts: bool) -> None:
    """Within a billionth of the time or of the length of the run, the longer one; whatever its slope."""
    for at, t_end, size in ((0.5, 2.0, 2.0), (1.5, 1.75, 1.75)):
        step = known([sympy.Piecewise((1, at > TIME), (4, True))], t_end)
        for slope in (1.0, -1e6):
            switch = MovedSwitch(0, slope * (TIME - (at + off * size)), (ONE,))
            found = tangent_jumps(switched(switch, directions=1), [0], step)
            assert isinstance(found, dict)
            assert bool(found) == counts


def test_a_sample_at_a_jump_belongs_to_what_follows() -> None:
    """x' = u, u switches at 1 + p: the tangent is u- - u+ from there on, also in the samples that lie there."""
    step = known([sympy.Piecewise((3, TIME < 1), (1, True))])
    times = np.array([0.0, 0.5, 1.0 - 1e-3, 1.0, 1.0, 1.5, 2.0])
    changes = LinearChanges((np.zeros((1, 1)),), np.zeros((1, 1, 1)))
    for n in (1, 50):  # in parts where there are many states
        many = LinearChanges((np.zeros((n, n)),), np.zeros((1, n, 1)))
        run = prepare(
            np.zeros((n, n)), np.ones((n, 1)), step, times, changes=many if n > 1 else changes, jumps={1: np.full((1, n), 2.0)}
        )
        found = run.solve(np.zeros((2, n)))
        assert found[:, 0] == pytest.approx(np.repeat(np.minimum(3 * times, 2 + times)[:, None], n, 1), abs=1e-12)
        assert found[:, 1] == pytest.approx(np.array([[2.0 * (t >= 1.0)] * n for t in times]), abs=1e-12)


def test_samples_at_the_start_are_counted() -> None:
    step = known([sympy.Piecewise((3, TIME < 1), (1, True))])
    same = rounding(0.0, 2.0)
    cuts, at_start = cut(np.array([0.0, 0.9 * same, 1.1 * same, 0.5, 2.0]), step)
    assert at_start == 2
    assert next(c.row for c in cuts if c.row >= 0) == 2
    assert cut(np.empty(0), step) == ([], 0)
    with pytest.raises(ArgumentError, match="times must be a sequence in increasing order"):
        cut(np.array([0.0, 1.0, 0.5]), step)
    assert cut(np.array([0.0, 1.0, 1.0]), step)[1] == 1


@pytest.mark.parametrize("wrong", [(-1e-14, 1.0), (0.0, 2.0 + 1e-14), (0.5, 0.5)])
def test_times_end_where_the_inputs_do(wrong: tuple[float, float]) -> None:
    forcing = known([TIME])
    fine = wrong == (0.5, 0.5)
    if fine:
        assert prepare(np.zeros((1, 1)), np.ones((1, 1)), forcing, [-1e-16, 2.0 + 1e-15]).solve([0.0])[-1, 0] == pytest.approx(
            2.0
        )
    else:
        said = rf"^times from {wrong[0]:g} to {wrong[1]:g} s, but inputs are known from 0 to 2 s$"
        with pytest.raises(ArgumentError, match=said):
            prepare(np.zeros((1, 1)), np.ones((1, 1)), forcing, wrong)


def diagonal(n: int, rate: float) -> np.ndarray:
    return np.diag(np.linspace(-rate, -0.5 * rate, n)) + 1e-3 * np.eye(n, k=1)


def test_small_scenes_are_dense_whatever_the_other_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 40 states, or a millisecond of work for a fast motion; with tangents three products for each one."""

    def refused(*_: Any) -> None:
        raise AssertionError("it is not prepared")

    forcing, times = known([TIME]), np.linspace(0.0, 2.0, 5)
    for n, fast in ((40, True), (41, True), (110, True), (111, False)):
        while not fast and estimate(n, [1e3], 4) < 1e-3:
            n += 1
        while fast and n > 41 and estimate(n, [1e3], 4) > 1e-3:
            n -= 1
        A, B = diagonal(n, 3.0), np.ones((n, 1))
        with monkeypatch.context() as patch:
            patch.setattr("gearlib.solvers.exponential.sparse_stepping.SparseStepping", refused)
            if fast:
                assert prepare(A, B, forcing, times).algorithm == "dense"
            else:
                with pytest.raises(AssertionError, match="not prepared"):
                    prepare(A, B, forcing, times)
    n = next(n for n in range(41, 400) if 3.0 * estimate(n, [1e3], 4) > 1e-3)
    assert estimate(n, [1e3], 4) < 1e-3
    changes = LinearChanges((np.eye(n),), np.zeros((1, n, 1)))
    with monkeypatch.context() as patch:
        patch.setattr("gearlib.solvers.exponential.sparse_stepping.SparseStepping", refused)
        assert prepare(diagonal(n, 3.0), np.ones((n, 1)), forcing, times).algorithm == "dense"
        with pytest.raises(AssertionError, match="not prepared"):
            prepare(diagonal(n, 3.0), np.ones((n, 1)), forcing, times, changes=changes)
        n -= 1
        changes = LinearChanges((np.eye(n),), np.zeros((1, n, 1)))
        assert prepare(diagonal(n, 3.0), np.ones((n, 1)), forcing, times, changes=changes).algorithm == "dense"


def test_exponentials_overflow_with_the_first_sample_that_does() -> None:
    forcing = known([TIME])
    run = prepare(np.diag([-1.0, 1e3]), np.ones((2, 1)), forcing, [0.0, 0.1, 0.5, 1.0, 2.0])
    with pytest.raises(SolverError, match=r"^the solution leaves the range of floating-point numbers before t = 1 s$"):
        run.solve([1.0, 1.0])
    for wrong in ([1.0], [[1.0, 1.0]], 1.0):
        with pytest.raises(ArgumentError, match=r"start values of shape .* for 2 states$"):
            run.solve(wrong)


def test_a_few_propagators_are_kept_for_steps_that_come_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two at least; any number of different steps gives the exact solution."""
    made: list[float] = []
    own = exact.Propagator

    def counted(G: Any, h: float) -> Any:
        made.append(h)
        return own(G, h)

    monkeypatch.setattr(exact, "Propagator", counted)
    steps = [0.25, 0.5, 0.25, 0.5, 0.125, 0.125, 0.25]
    times = np.cumsum([0.0, *steps])
    found = prepare(np.array([[-1.0]]), np.zeros((1, 0)), known([], 2.0), times).solve([1.0])
    assert found[:, 0] == pytest.approx(np.exp(-times), rel=1e-14)
    assert sorted(made) == [0.125, 0.25, 0.5]


@pytest.mark.parametrize("n", [40, 41])
def test_tables_are_integrated_from_corner_to_corner_where_there_are_few_states(n: int) -> None:
    """Beside constants; the others in closed form."""
    table = Table([0.0, 1.0, 2.0], [0.0, 1.0, 0.0])
    inputs = (sympy.sin(TIME), table, sympy.Float(2))
    problem = linear_problem(-np.eye(n), np.ones((n, 3)), inputs, [0.0] * n, np.linspace(0.0, 2.0, 5))
    stepper = Exponential(problem)
    assert stepper.cornered == ((1, 2) if n == 40 else ())
    assert (stepper.cuts is None) == (n == 41)
    assert stepper.forcing is not None
    assert len(stepper.forcing.pieces[0].H) == (1 if n == 40 else 3)
    run = Driver(problem, stepper)
    assert run.advance() == "done"
    fine = np.linspace(0.0, 2.0, 20001)  # Simpson's rule
    drive = np.sin(fine) + table(fine) + 2.0
    weight = np.full(len(fine), 2.0)
    weight[1::2], weight[0], weight[-1] = 4.0, 1.0, 1.0
    exact_end = (weight * drive * np.exp(fine - 2.0)).sum() * (fine[1] / 3.0)
    assert run.out[-1] == pytest.approx(np.full(n, exact_end), rel=1e-9)


def test_the_fastest_rate_does_not_depend_on_units() -> None:
    problem = linear_problem([[0.0, 2.0**20], [-(2.0**-20), 0.0]], np.zeros((2, 0)), (), [0.0, 0.0], np.array([0.0, 1.0]))
    assert Exponential(problem).rate() == 1.0
    stepper = Exponential(problem)
    assert (stepper.work, stepper.stats(), stepper.steps) == (0.0, {"steps": 0, "rhs": 0}, False)
    assert str(stepper.failure(-3)) == "matrix exponentials ended with -3"


def test_states_that_are_not_coupled_are_groups() -> None:
    """In the order of their first states; one way of acting couples. One group is all."""
    A = np.zeros((6, 6))
    A[0, 4] = A[1, 1] = A[2, 5] = A[5, 2] = 1.0
    assert [group.tolist() for group in components(union([A]), 6, {})] == [[0, 4], [1], [2, 5], [3]]
    change = np.zeros((6, 6))
    change[3, 1] = -2.0
    assert [group.tolist() for group in components(union([A, change]), 6, {})] == [[0, 4], [1, 3], [2, 5]]
    assert components(union([np.ones((3, 3))]), 3, {}) == [slice(None)]
