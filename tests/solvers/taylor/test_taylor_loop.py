"""The steps of the Taylor method with prescribed coefficients, against the same steps written out for vectors."""

from __future__ import annotations

import ctypes
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import SolverError
from gearlib.solvers.drive.driver import PATIENCE, Driver, integrate
from gearlib.solvers.problem import Floats
from gearlib.solvers.rungekutta.first_step import DAMPED
from gearlib.solvers.taylor.polynomial import DECAY, LAST
from gearlib.solvers.taylor.taylor import COEFFICIENT, OPERATION, STEP, TERM, Taylor
from gearlib.solvers.taylor.taylor_loop import SEARCHED, UNSEEN
from tests.run.python_problem import driver, problem

# Coefficients up to an order at a time and some states, a row per order; or a code: 1 for a smaller step, -1 for the end of the run
Series = Callable[[float, Floats, int], Floats | int]
_NUMBERS = ctypes.POINTER(ctypes.c_double)


def factorials(order: int) -> Floats:
    return np.cumprod([1.0, *range(1, order + 1)])[:, None]


def exponentials(*rates: complex) -> Series:
    """Each of the states grows by its rate; a complex one is that of two states, which vibrate."""

    def series(t: float, x: Floats, order: int) -> Floats:
        z = x if np.isrealobj(np.array(rates)) else x[::2] + 1j * x[1::2]
        c = z * np.array(rates) ** np.arange(order + 1)[:, None] / factorials(order)
        return c if np.isrealobj(c) else np.stack([c.real, c.imag], axis=2).reshape(order + 1, -1)

    return series


def sines(*rates: float) -> Series:
    """States whose derivatives are sines of time."""

    def series(t: float, x: Floats, order: int) -> Floats:
        k, w = np.arange(order + 1)[:, None], np.array(rates)
        c: Floats = w ** (k - 1) * np.cos(w * t + (k - 1) * math.pi / 2) / factorials(order)
        c[0] = x
        return c

    return series


def poles(t: float, x: Floats, order: int) -> Floats:
    """x' = x^2."""
    return x ** np.arange(1, order + 2)[:, None]


def lines(t: float, x: Floats, order: int) -> Floats:
    """x' = 2."""
    return np.vstack([x, 2.0 + 0.0 * x, np.zeros((order - 1, x.size))])


def kinks(t: float, x: Floats, order: int) -> Floats:
    """x' = -2, then 1 from 0.7 s on."""
    return np.vstack([x, (-2.0 if t < 0.7 else 1.0) + 0.0 * x, np.zeros((order - 1, x.size))])


def small(even: float, odd: float) -> Series:
    """Terms below all tolerances of a series that does not converge beyond these times."""

    def series(t: float, x: Floats, order: int) -> Floats:
        k = np.arange(order + 1)
        c = np.outer(1e-12 / np.where(k % 2, odd, even) ** k, np.ones(x.size))
        c[0] = x
        return c

    return series


def lacking(one: int) -> Series:
    """Terms of falling size, but for one of them."""

    def series(t: float, x: Floats, order: int) -> Floats:
        k = np.arange(order + 1)
        c = np.outer(np.where(k == one, 0.0, 1e-6 * 0.5**k), np.ones(x.size))
        c[0] = x
        return c

    return series


def overflowing(beyond: int) -> Series:
    """A vibration whose coefficients of higher orders are infinite, or no numbers."""

    def series(t: float, x: Floats, order: int) -> Floats:
        c = np.array(exponentials(-5j)(t, x, order))
        c[beyond + 1 :], c[beyond + 2 :] = math.inf, math.nan
        return c

    return series


def patchy(t: float, *_: Any) -> int:
    """1 at a third of all times."""
    return int(math.sin(1e3 * t) > 0.5)


def undefined(series: Series) -> Series:
    """Not to be evaluated at many times, but for the start."""
    return lambda t, x, order: patchy(t) or series(t, x, order)


def taylor(
    series: Series, x0: Any, end: float, rtol: float = 1e-6, samples: int = 9, sums: int = 5, products: int = 2, **more: Any
) -> Driver:
    """A run with these coefficients; ``more`` holds functions and numbers of the problem."""
    n, begin, rhs = len(x0), more.pop("begin", 0.0), more.pop("rhs", lambda *_: 0)
    flags = {name: more.pop(name, False) for name in ("guarded", "pulses", "branches", "hides")}

    def function(t: float, c: Any, work: Any, data: Any, index: Any, order: int, size: int) -> int:
        rows = np.ctypeslib.as_array(c, (order + 1, size))
        with np.errstate(all="ignore"):
            found = series(t, rows[0, :n].copy(), order)
        if isinstance(found, int):
            return found
        rows[1:, :n] = found[1:]
        return 0

    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[_NUMBERS] * 3, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64)
    wrapped = kind(function)
    address = ctypes.cast(wrapped, ctypes.c_void_p).value
    own: Any = SimpleNamespace(address=address, keep=wrapped, rows=0, sums=sums, products=products, compared=0, **flags)
    return driver(problem(rhs, x0, **more), np.linspace(begin, begin + end, samples), Taylor(own), rtol=rtol)


@dataclass
class Alone:
    """The same run without events; the coefficients of each step are kept."""

    series: Series
    x: Floats
    end: float
    rtol: float
    longest: float
    highest: int = 30
    sums: int = 5
    products: int = 2
    rhs_cost: float = 100.0
    begin: float = 0.0
    t: float = 0.0  # since then
    expansions: int = 0
    attempts: int = 0
    rejected: int = 0
    looked: int = 20
    since: int = 0
    cosine: float = 0.0
    stiff_steps: int = 0
    kept: list[tuple[float, Floats]] = field(default_factory=list)

    def expanded(self, t: float, x: Floats) -> Any:
        self.expansions += self.next_order
        return self.series(self.begin + t, x, self.next_order)

    def reach(self, norms: list[float], k: int) -> float:
        last, before = norms[k], norms[k - 1]
        return min(
            (LAST / last) ** (1 / k) if last > 0.0 else math.inf,
            (LAST * DECAY / before) ** (1 / (k - 1)) if before > 0.0 else math.inf,
        )

    def chosen(self, norms: list[float]) -> int:
        """Two more orders if the highest one makes most progress per cost, a lower one if that makes 5 % more."""
        order, size = len(norms) - 1, 4 * math.ceil(self.x.size / 4)
        orders, products = OPERATION * self.sums + COEFFICIENT * size, 0.5 * TERM * self.products
        speeds = {
            k: min(self.reach(norms, k), self.longest)
            / (STEP + self.rhs_cost + COEFFICIENT * size + k * (orders + k * products))
            for k in range(4, order + 1)
        }
        best = max(speeds, key=lambda k: (speeds[k], k))
        if best == order:
            return min(order + 2, self.highest)
        return best if speeds[best] > 1.05 * speeds[order] else order

    def watched(self, c: Floats, norms: list[float], weights: Floats) -> None:
        """Whether the fastest motion is smaller than the tolerance, and how far it is a decay."""
        k, amplitude = len(norms) - 1, math.inf
        if all(norms[k - 3 :]):
            rate = math.sqrt(max(k * (k - 1) * norms[k] / norms[k - 2], (k - 1) * (k - 2) * norms[k - 1] / norms[k - 3]))
            amplitude = max(norms[k] * math.factorial(k) / rate**k, norms[k - 1] * math.factorial(k - 1) / rate ** (k - 1))
            self.cosine = float(np.mean(c[k] * weights * c[k - 1] * weights)) / norms[k] / norms[k - 1]
        self.stiff_steps = self.stiff_steps + 1 if amplitude < UNSEEN else 0

    def steps(self) -> Iterator[tuple[float, ...]]:
        """What the record then holds, in the order of `COUNTED`."""
        self.next_order = min(20, self.highest)
        c = self.expanded(self.t, self.x)
        while self.t < self.end:
            weights = 1.0 / (self.rtol + self.rtol * abs(self.x))
            norms = [math.sqrt(np.mean((row * weights) ** 2)) for row in c]
            while len(norms) > 5 and not norms[-1] < math.inf:
                norms.pop()
                self.next_order = len(norms) - 1
            if self.looked >= 20:
                self.looked, self.next_order = 0, self.chosen(norms)
                self.watched(c, norms, weights)
                norms = norms[: self.next_order + 1]
            self.looked += 1
            order = len(norms) - 1
            c, reach = c[: order + 1], self.reach(norms, order)
            if reach < 1e-3 * self.longest:
                pairs = [(norms[j - 2], norms[j]) for j in (order - 1, order)]
                reach = min(reach, *(math.sqrt(a / b) for a, b in pairs if a > 0.0 and b > 0.0))
            h = min(reach, self.longest)
            last = self.t + 1.0001 * h >= self.end
            h = self.end - self.t if last else h
            while True:
                powers = h ** np.arange(order + 1)
                y, slope = powers @ c, powers[:-1] @ (c[1:] * np.arange(1, order + 1)[:, None])
                ahead, self.attempts, error = self.expanded(self.t + h, y), self.attempts + 1, math.inf
                if not isinstance(ahead, int):
                    error = h / (order + 1) * math.sqrt(np.mean(((ahead[1] - slope) * weights) ** 2))
                if error <= 1.0:
                    break
                self.rejected, last = self.rejected + 1, False
                h *= max(0.2, min(0.8, 0.9 * error ** (-1.0 / (order + 1)))) if error < math.inf else 0.25
            self.kept.append((self.t, c))
            self.t, self.x, c = self.end if last else self.t + h, y, ahead
            self.since += 1
            parts = 1 + (order if self.since < 4 else order - 3) // 8
            counts = self.looked, self.expansions, self.rejected, parts, self.stiff_steps, self.cosine
            yield self.t, order, self.next_order, reach, h, *counts

    def at(self, t: float) -> Floats:
        """The states at a time, by the polynomial of the step around it."""
        begin, c = next(kept for kept in reversed(self.kept) if kept[0] < t or kept is self.kept[0])
        found: Floats = (t - begin) ** np.arange(len(c)) @ c
        return found


CASES: dict[str, tuple[Series, list[float], dict[str, Any]]] = {
    "vibrations": (exponentials(-30j, 2j), [1.0, 0.0, 3.0, 1.0], {}),
    "many products": (exponentials(-30j, 2j), [1.0, 0.0, 3.0, 1.0], {"products": 200}),
    "costly rates": (exponentials(-3j), [1.0, 0.0], {"rhs_cost": 1e5, "sums": 1}),
    "decays": (exponentials(-40.0, -1.0, -0.1), [1.0, 1.0, -2.0], {}),
    "steep": (exponentials(-3000.0), [1.0], {}),
    "sines": (sines(1.0, 9.0), [0.0, 0.0], {"begin": 50.0}),
    "branches": (exponentials(-12j), [1.0, 0.5], {"branches": True}),
    "poles": (poles, [0.97 / 4.0, 0.1], {}),
    "lines": (lines, [0.0], {}),
    "kinks": (kinks, [0.0, 1.0], {}),
    "small, even": (small(1e-3, 2e-3), [1.0, 2.0], {}),
    "small, odd": (small(2e-3, 1e-3), [1.0, 2.0], {}),
    "small, even alone": (small(1e-3, math.inf), [1.0, 2.0], {}),
    "small, odd alone": (small(math.inf, 1e-3), [1.0, 2.0], {}),
    **{f"order {k} lacks": (lacking(k), [1.0, 2.0], {}) for k in (17, 18, 19, 20)},
    "overflow": (overflowing(7), [1.0, 0.0], {}),
    "overflow, odd": (overflowing(18), [1.0, 0.0], {}),
    "undefined": (undefined(exponentials(-9j)), [1.0, 0.0], {}),
}
COUNTED = ("t", "order", "next_order", "h", "h_step", "looked", "expansions", "rejected", "parts", "stiff_steps", "cosine")


def compared(
    series: Series, x0: list[float], special: dict[str, Any], rtol: float, longest: float, seen: Series | None = None
) -> Alone:
    """Take the steps in both ways, 45 at most, and compare them and the samples; ``seen``: the series with what the rates refuse."""
    special, end = dict(special), 4.0
    costs = {name: special[name] for name in ("sums", "products") if name in special}
    both = {name: special[name] for name in ("rhs_cost", "begin") if name in special}
    highest = SEARCHED if "branches" in special else 30
    own = Alone(seen or series, np.array(x0), end, rtol, min(end, longest), highest, **costs, **both)
    run = taylor(series, x0, end, rtol, **special, longest_expanded_step=longest)
    run.stepper.watch(math.inf)  # type: ignore[attr-defined]
    for step in itertools.islice(own.steps(), 45):
        assert run.advance(1) == "more"
        assert [getattr(run.record, name) for name in COUNTED] == pytest.approx(step, rel=1e-6)
    assert run.record.evaluations == 1 + own.attempts * special.get(
        "guarded", False
    )  # at the start, and to look for divisors of zero
    assert run.stepper.damped == (own.cosine < -DAMPED)  # type: ignore[attr-defined]
    if own.t == end:
        assert run.advance(1) == "done"
    reached = run.record.sample
    assert reached == np.searchsorted(run.problem.times, run.t + 1e-9)
    for t, x in zip(run.problem.times[:reached], run.out[:reached], strict=True):
        assert x == pytest.approx(own.at(t - own.begin), rel=1e-9, abs=1e-9)
    return own


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("rtol", "longest"), [(1e-3, 0.3), (1e-10, math.inf)])
def test_order_and_step_follow_from_the_coefficients(case: str, rtol: float, longest: float) -> None:
    """And are chosen anew every twenty steps; samples lie on the polynomials."""
    series, x0, special = CASES[case]
    own = compared(series, x0, special, rtol, longest)
    assert own.rejected > 0 or case not in ("kinks", "undefined")


@pytest.mark.parametrize("guarded", [True, False])
def test_the_right_hand_side_is_asked_only_where_it_knows_more(guarded: bool) -> None:
    """Then a code of it repeats the step as one of the series does."""
    whole = exponentials(-9j)
    special = {"guarded": guarded, "rhs": lambda t, *_: patchy(t)}
    own = compared(whole, [1.0, 0.0], special, 1e-6, 0.3, undefined(whole) if guarded else whole)
    assert (own.rejected > 0) == guarded


@pytest.mark.parametrize("hides", [True, False])
def test_a_right_hand_side_that_the_series_does_not_show_is_looked_for(hides: bool) -> None:
    """x' = 2, but 7 for a tenth of the step; a step that met it ends there, and what refuses it for good ends the run."""

    def visits(t: float, x: Floats, order: int) -> Floats:
        return np.vstack([x, [2.0 + 5.0 * (0.31 < t < 0.41)], np.zeros((order - 1, 1))])

    own: dict[str, Any] = {"hides": hides, "rhs": lambda t, x, dx, data: dx.__setitem__(0, visits(t, np.zeros(1), 2)[1, 0])}
    run = taylor(visits, [0.0], 1.0, **own)
    assert integrate(run).x[-1, 0] == pytest.approx(2.5 if hides else 2.0, abs=3e-5)
    assert (run.record.rejected > 0) == (run.record.evaluations > 1) == hides
    if hides:
        stepper: Any = run.stepper
        assert stepper._work(1, 20, 0) > 20 * (100.0 + 20 * COEFFICIENT)
        with pytest.raises(SolverError, match=r"the step became too small at t = 0\.4"):
            integrate(taylor(lines, [0.0], 1.0, hides=True, rhs=lambda t, x, dx, data: dx.__setitem__(0, 2.0) or int(t > 0.4)))


@pytest.mark.parametrize("slow", [0.0, 4e4, 1e9])
def test_a_fast_motion_below_the_tolerance_is_noticed(slow: float) -> None:
    """When the order has been chosen three times so, and not before another method would have caught up."""
    run = taylor(exponentials(-50.0, -1.0), [1.0, 1.0], 40.0, 1e-6)
    stepper: Any = run.stepper
    stepper.watch(slow)
    own = Alone(exponentials(-50.0, -1.0), np.array([1.0, 1.0]), 40.0, 1e-6, 40.0)
    fewest = math.ceil(slow / stepper._work(1, 20, 0))
    for number, step in zip(range(1, 151), own.steps(), strict=False):
        status = run.advance(1)
        assert run.record.stiff_steps == own.stiff_steps
        if own.looked == 1 and own.stiff_steps == 1:
            first = number, own.kept[-1][0]
        due = own.looked == 1 and own.stiff_steps >= 3 and number >= fewest
        assert status == ("stiff" if due else "more"), step
        if due:
            break
    assert due == (slow < 1e9)
    assert (run.record.stiff_first, run.record.stiff_t) == (first[0], pytest.approx(first[1]))
    assert stepper.damped


def test_work_is_counted_in_operations() -> None:
    """Of steps, of orders of coefficients, and of what is done at events; since the steps became short, too."""
    run = taylor(
        exponentials(-9j),
        [1.0, 0.0],
        4.0,
        sums=7,
        products=3,
        rhs_cost=70.0,
        roots_cost=11.0,
        update_cost=13.0,
        roots=lambda *_: 0,
    )
    stepper: Any = run.stepper

    def expected(steps: float, orders: float, events: int) -> float:
        own = steps * (STEP + 70.0 + 4 * COEFFICIENT + 22.0)
        own += orders * (7 * OPERATION + 4 * COEFFICIENT + orders / steps * 0.5 * 3 * TERM)
        return float(own + events * (70.0 + 13.0 + 110.0))

    assert run.work == 0.0
    stepper.watch(3.5 * expected(1, 20, 0))
    assert (stepper.record.detect, stepper.record.detect_from) == (1, 4)
    for _ in range(7):
        run.advance(1)
    record = stepper.record
    assert (record.steps, record.events) == (7, 0)
    assert run.work == pytest.approx(expected(7, record.expansions, 0))
    record.events, record.stiff_first, record.stiff_t, record.stiff_events = 5, 3, 0.25 * record.t, 2
    assert run.work == pytest.approx(expected(7, record.expansions, 5))
    assert stepper.pace == pytest.approx(0.75 * record.t / expected(4, record.expansions * 4 / 7, 3))
    stepper.watch(5.2 * expected(1, record.expansions / 7, 0))
    assert (record.detect_from, record.stiff_steps) == (13, 0)
    assert stepper.stats() == {
        "method": "taylor", "order": record.order, "steps": 7, "rejected": 0, "rhs": 1, "coefficients": record.expansions,
    }  # fmt: skip


SMALL = r"the step became too small at t = {}: the solution goes to infinity, jumps, or cannot be evaluated further on"
RATES = "the right-hand side cannot be evaluated at t = {}"


@pytest.mark.parametrize(
    ("series", "more", "said"),
    [
        (lambda *_: 1, {}, RATES.format("0 s after 1 steps")),
        (lambda *_: -1, {}, RATES.format("0 s after 1 steps")),
        (lambda t, x, order: -1 if t > 0.7 else lines(t, x, order), {}, RATES.format("0.6 s after 3 steps")),
        (lambda t, x, order: 1 if t > 0.7 else lines(t, x, order), {}, SMALL.format(r"0.7 s after \d+ steps")),
        (lines, {"rhs": lambda *_: 1}, RATES.format("0 s after 0 steps")),
        (lines, {"rhs": lambda t, *_: -(t > 0.7), "guarded": True}, RATES.format("0.6 s after 3 steps")),
        (overflowing(4), {}, "done"),
        (overflowing(3), {}, "the Taylor coefficients are not finite at t = 0 s after 1 steps: a root of zero, or a pole; use method='rk'"),
        (overflowing(2), {}, "the Taylor coefficients are not finite at t = 0 s after 1 steps: a root of zero, or a pole; use method='rk'"),
        (lines, {"roots": lambda *_: 1, "n_roots": 1}, "the event functions cannot be evaluated at t = 0 s after 0 steps"),
        (lines, {"roots": lambda t, *_: t > 0.7, "n_roots": 1}, "the event functions cannot be evaluated at t = 0.6 s after 3 steps"),
    ],
)  # fmt: skip
def test_where_a_run_cannot_go_on_it_says_so(series: Series, more: dict[str, Any], said: str) -> None:
    """Or, if it may, leaves there; steps of 0.3 s, the third of which ends beyond 0.7 s."""
    for may_leave in (False, True):
        run = taylor(series, [1.0, 0.0], 1.0, longest_expanded_step=0.3, may_leave=may_leave, **more)
        if said == "done":
            assert integrate(run).status == "done"
        elif may_leave:
            assert integrate(run).status == "left"
        else:
            with pytest.raises(SolverError, match="^" + said.replace("(", r"\(")):
                integrate(run)


def test_a_run_that_may_leave_tries_so_often() -> None:
    run = taylor(
        lambda t, x, order: 1 if t > 0.7 else lines(t, x, order), [0.0], 1.0, longest_expanded_step=0.3, may_leave=True
    )
    found = integrate(run)
    assert found.stats["rejected"] == PATIENCE
    assert 0.65 < found.t_last <= 0.7


def test_an_event_ends_its_step_and_the_coefficients_are_computed_anew() -> None:
    """x = 2 t, and events at two places, after each of which the order is chosen."""
    own = {"roots": lambda t, x, g, data: g.__setitem__(0, x[0] - 0.5) or g.__setitem__(1, 1.5 - x[0]), "n_roots": 2}
    run = taylor(lines, [0.0], 1.0, longest_expanded_step=0.4, rhs=lambda t, x, dx, data: dx.__setitem__(0, 2.0), **own)
    record: Any = run.record
    seen = []
    while run.advance(1) == "more":
        seen.append((round(run.t, 12), record.order, record.expansions, record.evaluations, record.since))
    # computed at the start of a step unless at the end of the last one, and at the end of each: 10 + 4, 4 + 6, 6, 6 + 4
    assert seen == [(0.25, 4, 14, 2, 0), (0.65, 4, 24, 2, 1), (0.75, 6, 30, 3, 0), (1.0, 4, 40, 3, 1)]
    assert run.event_times == pytest.approx([0.25, 0.75], rel=1e-13)
    assert run.event_roots.tolist() == [0, 1]


@pytest.mark.parametrize("above", [0.95, 0.999])
@pytest.mark.parametrize("phase", [0.0, 2.8])
def test_both_ends_of_a_dip_are_found(above: float, phase: float) -> None:
    """cos(9 t + phase) beyond a limit and back within one step, the first or a later one: the slopes at its ends show it."""

    def rates(t: float, x: Any, dx: Any, data: Any) -> None:
        dx[0], dx[1] = 9.0 * x[1], -9.0 * x[0]

    start = [math.cos(phase), -math.sin(phase)]
    run = taylor(
        exponentials(-9j), start, 3.0, rhs=rates, roots=lambda t, x, g, data: g.__setitem__(0, x[0] + above), n_roots=1
    )
    turn, ends = 2.0 * math.pi * np.arange(6)[:, None], math.acos(-above) * np.array([1.0, -1.0]) + [0.0, 2.0 * math.pi]
    times = np.sort(((turn + ends - phase) / 9.0).ravel())
    assert integrate(run).event_times == pytest.approx(times[times < 3.0], abs=1e-7)


def test_with_events_a_step_is_the_difference_of_two_times() -> None:
    """Of the numbers as they are stored, so that rounding of the clock at each of many steps does not add up."""
    run = taylor(exponentials(-9j), [1.0, 0.0], 3.0, roots=lambda t, x, g, data: g.__setitem__(0, 1.0), n_roots=1)
    record: Any = run.record
    for _ in range(12):
        before = record.t
        run.advance(1)
        assert record.h_step == record.t - before


def test_the_trace_divides_long_steps_by_their_order() -> None:
    """More finely in the first steps after an event; with the states and rates of the polynomials."""
    run = taylor(
        sines(3.0),
        [0.0],
        4.0,
        1e-10,
        time_events=np.array([1.7]),
        traced=np.array([0]),
        rhs=lambda t, x, dx, data: dx.__setitem__(0, math.cos(3.0 * t)),
    )
    record: Any = run.record
    ends, rows, since = [0.0], [0.0], 0
    while run.advance(1) == "more":
        since += 1
        assert record.parts == 1 + (record.order - (3 if since >= 4 else 0)) // 8
        rows += [ends[-1] + (run.t - ends[-1]) * i / record.parts for i in range(1, record.parts + 1)]
        ends.append(run.t)
        if run.t == 1.7:
            since, rows = 0, [*rows, 1.7]
    trace = run.solution().trace
    assert trace is not None
    assert trace.times == pytest.approx(np.array(rows), rel=1e-12)
    assert trace.states[:, 0] == pytest.approx(np.sin(3.0 * trace.times) / 3.0, abs=1e-9)
    assert trace.rates[:, 0] == pytest.approx(np.cos(3.0 * trace.times), abs=1e-8)
