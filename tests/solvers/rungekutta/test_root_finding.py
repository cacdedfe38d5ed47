"""Events within one step whose motion is a polynomial that the methods follow exactly: where they are found, and with how many looks."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from gearlib.solvers.drive.driver import Driver
from gearlib.solvers.rungekutta.rungekutta import RungeKutta
from tests.run.python_problem import driver, problem
from tests.solvers.lanes.test_lane_loop import KINDS
from tests.solvers.rungekutta.test_step_size import Alone

DOWN_AND_UP = Polynomial([0.5, 0.0, -0.2, 0.3]).integ()


def one_step(
    motion: Polynomial, roots: Callable[[float, float], list[float]], n_roots: int, order: int = 5, begin: float = 0.0, span: float = 10.0,
    sides: tuple[int, ...] = (),
) -> Driver:  # fmt: skip
    """A run of one step of 1 s along a polynomial; event functions of time and state."""
    slope, looks, fires = motion.deriv(), [], []

    def rates(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0] = slope(t - begin)

    def values(t: float, x: Any, g: Any, data: Any) -> None:
        looks.append(t)
        for k, value in enumerate(roots(t - begin, x[0])):
            g[k] = value

    def update(t: float, x: Any, fired: Any, data: Any) -> int:
        fires.append((t, [fired[k] for k in range(n_roots)]))
        for k, side in enumerate(sides if len(fires) == 1 else ()):
            fired[k] = 2 * side
        return 0

    own = problem(rates, [motion(0.0)], roots=values, n_roots=n_roots, atol=1e12, update=update)
    run = driver(own, [begin, begin + 1.0, begin + span], RungeKutta(order, 1.0))
    run.looks, run.fires = looks, fires  # type: ignore[attr-defined]
    return run


def first_event(run: Driver) -> tuple[float, list[int]]:
    """Time and functions of the first event, nan if the step has none."""
    run.advance(1)
    return (run.event_times[0] if len(run.event_times) else math.nan), run.event_roots.tolist()


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("begin", [0.0, 1e4])
def test_the_first_crossing_is_found_with_few_looks(order: int, sign: float, begin: float) -> None:
    """Of a function that changes its sign in the step, wherever that is; the event is just beyond it."""
    motion, looks = Polynomial([0.0, 0.4, 0.9, -0.3]), []
    for at in (1e-7, 0.001, 0.03, 0.2, 0.5, 0.77, 0.97, 0.9999):
        level = motion(at)
        run = one_step(motion, lambda t, x, level=level: [sign * (x - level), 1.0 + t], 2, order, begin)
        found, roots = first_event(run)
        assert roots == [0]
        assert found - begin == pytest.approx(at, rel=1e-8 if begin else 1e-13, abs=4e-12 if begin else 1e-15)
        assert run.x[0] == pytest.approx(motion(at), rel=1e-9, abs=1e-12)
        looks.append(len(run.looks))  # type: ignore[attr-defined]
    assert np.mean(looks) < 14.0


@pytest.mark.parametrize("order", [5, 8])
def test_the_states_at_an_event_are_those_at_its_time_as_it_is_stored(order: int) -> None:
    """And just beyond the crossing: a fast motion is elsewhere one rounding of the clock away."""
    motion = Polynomial([0.0, 1e6])
    for at in np.random.default_rng(order).uniform(0.1, 0.9, 20):
        run = one_step(motion, lambda t, x, level=motion(at): [x - level], 1, order, 6e3, 6e3)  # noqa: B008
        found, _ = first_event(run)
        assert run.x[0] == pytest.approx(motion(found - 6e3), rel=1e-14)
        assert 0.0 <= run.x[0] - motion(at) < 3e-6


@pytest.mark.parametrize("order", [5, 8])
def test_functions_that_jump_are_located_by_halves(order: int) -> None:
    for at in (0.01, 0.3, 0.62):
        run = one_step(DOWN_AND_UP, lambda t, x, at=at: [1.0 if t < at else -1e-3], 1, order)
        found, _ = first_event(run)
        assert at <= found <= at + 1e-14
        assert len(run.looks) < 110  # type: ignore[attr-defined]


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_of_several_crossings_the_first_one_counts(order: int, sign: float) -> None:
    """With those that cross at the same time, in either direction."""
    levels = [0.6, 0.3, 0.3, 0.31, 2.0]
    run = one_step(Polynomial([0.0, 1.0]), lambda t, x: [sign * (x - at) * (-1) ** k for k, at in enumerate(levels)], 5, order)
    found, roots = first_event(run)
    assert found == pytest.approx(0.3, rel=1e-14)
    assert roots == [1, 2]


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize(("sign", "begin"), [(1.0, 0.0), (-1.0, 0.0), (1.0, 1e4)])
def test_a_dip_below_zero_within_a_step_is_found_where_it_begins(order: int, sign: float, begin: float) -> None:
    """However short it is, of one function beside others that stay; one that stays above is no event, and takes 8 times 2 looks at most."""
    rng = np.random.default_rng(order)
    for _ in range(15):
        bottom, depth = rng.uniform(0.1, 0.9), 10.0 ** rng.uniform(-9, -1)
        shape = Polynomial([-bottom, 1.0]) ** 2 * Polynomial([1.0, rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2)])
        for below in (depth, -depth - 1e-3):
            run = one_step(shape, lambda t, x, below=below: [3.0 + t, sign * (x - below), -5.0], 3, order, begin)
            found, roots = first_event(run)
            if below < 0.0:
                assert roots == []
                assert len(run.looks) <= 4 + 2 * 8  # type: ignore[attr-defined]
            else:
                zeros = (shape - below).roots()
                expected = min(z.real for z in zeros if abs(z.imag) < 1e-6 and 0.0 < z.real < 1.0)
                assert found - begin == pytest.approx(expected, abs=(1e-9 if begin else 1e-12) / math.sqrt(depth))
                assert roots == [1]


@pytest.mark.parametrize(("order", "limit"), [(5, 0.3), (8, 0.1)])
@pytest.mark.parametrize("share", [0.02, 0.045, 0.055, 0.5, 0.975, 0.985])
@pytest.mark.parametrize("times", [0.9, 1.1])
def test_where_the_dense_output_may_be_poor_the_step_is_repeated_up_to_the_event(
    order: int, limit: float, share: float, times: float
) -> None:
    """Inside the step, if its error is more than a share of the tolerance; at its ends the dense output is as good as the step."""
    f, start, _ = KINDS["relaxation"]
    alone = Alone(order, f, np.array(start), 1e-3, 9.0, 3.0, 0.3)
    alone.numbers, alone.k = (), np.zeros((13, 2))
    alone.restart(False, first=True)
    rtol = 1e-3 * alone.attempt(0.3) / (times * limit)

    def rates(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = f(t, np.array([x[0], x[1]]), [3.0])

    own = problem(rates, start, roots=lambda t, x, g, data: g.__setitem__(0, t - share * 0.3), n_roots=1)
    run = driver(own, [0.0, 9.0], RungeKutta(order, 0.3), rtol=rtol)
    run.advance(1)
    repeated = times > 1.0 and 0.05 < share < 0.98
    assert run.t == (0.0 if repeated else pytest.approx(0.3 * share))
    assert run.stepper.stats()["rejected"] == repeated
    for _ in range(3):
        run.advance(1)
    assert run.event_times == pytest.approx([0.3 * share], rel=1e-13)


@pytest.mark.parametrize("order", [5, 8])
@pytest.mark.parametrize("side", [1, -1])
def test_a_function_on_the_wrong_side_from_the_start_is_an_event_at_once(order: int, side: int) -> None:
    """In the same instant; not if it has come over a billionth of the step later, as rounding may have it."""
    run = one_step(Polynomial([0.0, 1.0]), lambda t, x: [1.0, -side * (2.0 - t)], 2, order, sides=(0, side))
    assert math.isnan(first_event(run)[0])
    assert run.fires == [(0.0, [0, 0]), (0.0, [0, -side])]  # type: ignore[attr-defined]
    # its slope promises to bring it over, and it is not there in time
    run = one_step(Polynomial([0.0, 1.0]), lambda t, x: [1.0, side * (1e6 * t**2 - 5e-10)], 2, order, sides=(0, side))
    assert first_event(run) == (pytest.approx(1e-9, rel=1e-6), [1])
    run = one_step(Polynomial([0.0, 1.0]), lambda t, x: [1.0, side * (t - 5e-10)], 2, order, sides=(0, side))
    assert math.isnan(first_event(run)[0])
    assert run.t == 1.0
    run = one_step(Polynomial([0.0, 1.0]), lambda t, x: [0.7 - t, side * (t - 5e-10)], 2, order, sides=(0, side))
    assert first_event(run) == (pytest.approx(0.7, rel=1e-14), [0])
