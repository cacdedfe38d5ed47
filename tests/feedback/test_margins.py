"""Margins at their edges, and what is made of several crossings; how they move with a parameter."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.feedback import margins as parts
from gearlib.feedback.feedback_loop import Loop, as_loop
from gearlib.feedback.gain_range import gains_in_words, stable_gains
from gearlib.feedback.margins import GainCrossing, Margins, PhaseCrossing, margins
from gearlib.feedback.stability import LoopReport
from gearlib.feedback.stability_sensitivity import change_at_rest, stability_sensitivity
from gearlib.linear.linear_model import Matrices
from gearlib.linear.poles import poles

INFINITE = float("inf")


def test_the_nearest_of_several_crossings_counts() -> None:
    """Gains by decibels, phases by size, delays by the time that is left."""
    crossings = (PhaseCrossing(1.0, 0.2), PhaseCrossing(2.0, 4.0), PhaseCrossing(3.0, 100.0))
    gains = (GainCrossing(1.0, 80.0, 1.4), GainCrossing(2.0, -30.0, 2.9), GainCrossing(9.0, 170.0, 0.33))
    found = Margins(crossings, gains, 0.4, 2.5, False)
    assert (found.gain_margin, found.phase_margin, found.delay_margin) == (4.0, -30.0, 0.33)
    assert found.gain_margin_db == pytest.approx(12.0412, abs=1e-4)
    assert crossings[0].gain_margin_db == pytest.approx(-13.9794, abs=1e-4)
    assert found.as_dict() == {
        "gain_margin": 4.0, "gain_margin_db": found.gain_margin_db, "phase_margin_deg": -30.0, "delay_margin_s": 0.33,
        "modulus_margin": 0.4, "modulus_omega": 2.5, "phase_crossings": [(1.0, 0.2), (2.0, 4.0), (3.0, 100.0)],
        "gain_crossings": [(1.0, 80.0), (2.0, -30.0), (9.0, 170.0)],
    }  # fmt: skip
    none = Margins((), (), 1.0, INFINITE, False)
    assert (none.gain_margin, none.phase_margin, none.delay_margin, none.gain_margin_db) == (INFINITE,) * 4


@pytest.mark.parametrize(
    ("numerator", "denominator", "expected"),
    [
        ([-0.5, -0.1], [1, 1], [(0.0, 10.0), (INFINITE, 2.0)]),  # real and negative at rest, and at infinity
        ([0.5, -0.1], [1, 1], [(0.0, 10.0)]),
        ([-0.5, 0.1], [1, 1], [(INFINITE, 2.0)]),
        ([0.5, 0.1], [1, 1], []),
        ([-3.0], [1, 1, 0], []),  # at rest there is no value, but a pole
        ([0.5, 0.0], [1, 1], []),  # at rest the curve begins in the origin
    ],
)
def test_ends_of_the_curve_on_the_negative_axis_are_crossings(
    numerator: list[float], denominator: list[float], expected: list[tuple[float, float]]
) -> None:
    found = [(c.omega, c.gain_margin) for c in margins(as_loop(control.tf(numerator, denominator))).phase_crossings]
    assert np.ravel(found).tolist() == pytest.approx(np.ravel(expected).tolist())


def test_a_start_that_is_rounding_is_no_crossing() -> None:
    """At rest two parts cancel but for rounding of either sign."""
    starts = []
    for p in np.linspace(1.0, 2.0, 30):
        loop = Loop(np.diag([-p, -3.0 * p]), np.ones(2), np.array([0.1 * p, -0.3 * p]), 0.0, "u", "y")
        starts.append(float(loop.response(0.0).real))
        (crossing,) = margins(loop).phase_crossings
        assert (crossing.omega, crossing.gain_margin) == (pytest.approx(np.sqrt(3) * p), pytest.approx(20.0))
    assert min(starts) < 0.0


def of_frequency(polynomial: Any) -> Any:
    """The polynomial in w of one in s = j w."""
    return np.array(polynomial) * 1j ** np.arange(len(polynomial))[::-1]


@pytest.mark.parametrize(("seed", "unit"), [*((seed, 1.0) for seed in range(12, 18)), (13, 1e-5), (13, 1e5)])
def test_undamped_poles_are_no_crossings_whichever_side_rounding_puts_them_on(seed: int, unit: float) -> None:
    """Three vibrations without damping behind one lag or two: the phase is that of numerator and lags, but for half turns."""
    draw = np.random.default_rng(seed)
    undamped = np.array([1.0])
    for w in np.sort(draw.uniform(0.3, 5, 3)):
        undamped = np.polymul(undamped, [1, 0, w**2])
    lag = np.array([draw.uniform(0.001, 1), 1])
    if seed % 2:
        lag = np.polymul(lag, [draw.uniform(0.001, 1), 1])
    numerator = np.atleast_1d(draw.normal() * np.poly(-draw.uniform(0.1, 3, seed % 3)))
    roots = np.roots(np.imag(np.polymul(of_frequency(numerator), of_frequency(lag).conj())))
    whole = np.polymul(lag, undamped)
    at = np.sort(roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 1e-9)].real)
    values = (np.polyval(numerator, 1j * at) / np.polyval(whole, 1j * at)).real
    loop = as_loop(control.tf(numerator, whole))
    found = margins(Loop(unit * loop.A, unit * loop.b, loop.c, 0.0, "u", "y")).phase_crossings
    mine = [c for c in found if 0 < c.omega < INFINITE]
    assert [c.omega / unit for c in mine] == pytest.approx(at[values < 0].tolist(), rel=1e-9)
    assert [c.gain_margin for c in mine] == pytest.approx((-1 / values[values < 0]).tolist(), rel=1e-7)


@pytest.mark.parametrize("k", [0.7, 2.0, 30.0])
@pytest.mark.parametrize("pole", [0.3, 4.0])
def test_margins_of_one_lag_and_an_integrator(k: float, pole: float) -> None:
    """``k / (s (s + p))``: |L| = 1 at w with w^4 + p^2 w^2 = k^2, and a phase of -90 deg - atan(w / p) there."""
    found = margins(as_loop(control.tf([k], [1, pole, 0])))
    w = np.sqrt((np.sqrt(pole**4 + 4 * k**2) - pole**2) / 2)
    (crossing,) = found.gain_crossings
    phase = 90 - np.degrees(np.arctan(w / pole))
    assert (crossing.omega, crossing.phase_margin) == (pytest.approx(w, rel=1e-11), pytest.approx(phase, rel=1e-11))
    assert crossing.delay_margin == pytest.approx(np.radians(phase) / w, rel=1e-11)
    grid = np.geomspace(1e-3, 1e3, 400_001)
    distance = np.abs(1 + k / (1j * grid * (1j * grid + pole)))
    assert found.modulus_margin == pytest.approx(distance.min(), rel=1e-8)
    assert found.modulus_omega == pytest.approx(grid[distance.argmin()], rel=1e-3)
    assert not found.real


def test_a_negative_phase_margin_takes_almost_a_turn_of_delay() -> None:
    """The unstable loop ``3 / (s (s + 1)^2)``: a lag of -11 deg, or a delay by which the curve turns 349 deg."""
    (crossing,) = margins(as_loop(control.tf([3.0], [1, 2, 1, 0]))).gain_crossings
    assert crossing.phase_margin == pytest.approx(-11.01, abs=0.01)
    assert crossing.delay_margin == pytest.approx(np.radians(360 + crossing.phase_margin) / crossing.omega, rel=1e-12)


@pytest.mark.parametrize(
    ("denominator", "w"), [([1, 0, 1], np.sqrt(2.0)), ([1, 0, 3], 2.0), ([1, 0, 0], 1.0), ([4, 0, 1], np.sqrt(0.5))]
)
def test_a_curve_through_minus_one_has_no_delay_to_spare(denominator: list[int], w: float) -> None:
    """``1 / (a s^2 + b)`` is -1 where ``a w^2 = b + 1``, whichever side of the axis rounding puts it on."""
    found = margins(as_loop(control.tf([1.0], denominator)))
    assert [c.omega for c in found.gain_crossings if abs(c.phase_margin) < 90] == [pytest.approx(w)]
    assert (found.phase_margin, found.delay_margin) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [([2.0], [1]), ([-2.0], [1]), ([1.0], [1]), ([2.0, 1], [1, 1]), ([1.0, -1], [1, 1]), ([-3.0, 0, 0], [1, 0.1, 1])],
)
def test_any_delay_turns_a_curve_that_ends_beyond_one_round_the_point(numerator: list[float], denominator: list[float]) -> None:
    """``1 + L exp(-s T)`` has zeros at ever higher frequencies."""
    report = LoopReport(as_loop(control.tf(numerator, denominator)))
    assert report.margins.delay_margin == 0.0
    assert "  delay margin     0: |L| does not fall below 1 at infinite frequency" in str(report)


def test_delays_of_curves_that_end_inside() -> None:
    assert margins(as_loop(control.tf([0.9], [1]))).delay_margin == INFINITE
    w = np.sqrt(32 / 3)  # 9 + w^2 / 4 = 1 + w^2
    delay = (np.pi + np.angle((3 + 0.5j * w) / (1 + 1j * w))) / w
    assert margins(as_loop(control.tf([0.5, 3], [1, 1]))).delay_margin == pytest.approx(delay, rel=1e-12)


def test_the_distance_from_the_point_is_found_at_the_ends_too() -> None:
    """A lead is nearest to -1 at rest, a lag at infinite frequency."""
    lead, lag = (margins(as_loop(control.tf(numerator, [1, 10.0]))) for numerator in ([5.0, 1.0], [0.2, 30.0]))
    assert (lead.modulus_margin, lead.modulus_omega) == (pytest.approx(1.1, rel=1e-12), 0.0)
    assert (lag.modulus_margin, lag.modulus_omega) == (pytest.approx(1.2, rel=1e-12), INFINITE)


# ---------------------------------------------------------------- ranges of gains


@pytest.mark.parametrize(
    ("ranges", "said"),
    [
        ([], "no positive gain makes it stable"),
        ([(0.0, INFINITE)], "stable for every positive gain"),
        ([(0.0, 2.0)], "stable for less than 2 (+6.021 dB) times the present gain"),
        ([(0.5, INFINITE)], "stable for more than 0.5 (-6.021 dB) times the present gain"),
        (
            [(0.0, 0.1), (2.0, 10.0), (100.0, INFINITE)],
            "stable for less than 0.1 (-20.000 dB), and for 2 (+6.021 dB) to 10 (+20.000 dB), and for more than 100 (+40.000 dB) "
            "times the present gain",
        ),
    ],
)
def test_ranges_in_words(ranges: list[tuple[float, float]], said: str) -> None:
    assert gains_in_words(ranges) == said


def test_ranges_meet_where_a_crossing_changes_nothing() -> None:
    """A lag is stable for any gain, whatever edges are given; edges at 0 and infinity, or given twice, are none."""
    loop = as_loop(control.tf([1.0], [1, 1]))
    edges = [PhaseCrossing(1.0, g) for g in (3.0, 0.5, 0.5, INFINITE, 0.0)]
    assert stable_gains(loop, edges) == ((0.0, INFINITE),)
    third = as_loop(control.tf([1.0], [1, 3, 3, 1]))  # up to 8
    for edges in ([8.0], [8.0, 1.0, 4.0], [2.0, 8.0, 9.0, 80.0]):
        assert stable_gains(third, [PhaseCrossing(1.0, g) for g in edges]) == ((0.0, 8.0),)


MODELS = {
    "three lags": control.tf([1.0], [1, 3, 3, 1]),
    "an integrator": control.tf([1.0], [1, 2, 1, 0]),
    "resonances": control.tf([3.0, 0.2, 30], [1, 0.3, 16, 2, 5]),
    "unstable": control.tf([4.0, 4.0], [1, 2, -3, 0]),
}


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("k", [1e-30, 1e-9, 1e10, 1e30])
def test_crossings_of_the_axis_stay_and_their_margins_divide_by_the_gain(name: str, k: float) -> None:
    one, other = (as_loop(MODELS[name], gain=gain) for gain in (1.0, k))
    found, wanted = margins(other), margins(one)
    assert [c.omega for c in found.phase_crossings] == pytest.approx([c.omega for c in wanted.phase_crossings], rel=1e-9)
    assert [c.gain_margin * k for c in found.phase_crossings] == pytest.approx(
        [c.gain_margin for c in wanted.phase_crossings], rel=1e-8
    )
    ranges = (stable_gains(loop, m.phase_crossings) for loop, m in ((other, found), (one, wanted)))
    scaled, own = (np.ravel(r) for r in ranges)
    assert (scaled * k).tolist() == pytest.approx(own.tolist(), rel=1e-8)
    for crossing in found.gain_crossings:
        s = 1j * crossing.omega
        assert abs(other.response(s)) == pytest.approx(1.0, abs=1e-9 + float(other.rounding(s)))


# ---------------------------------------------------------------- how margins move


def matrices(p: float, feedthrough: float) -> Matrices:
    """A damped chain with an unstable pole, whose matrices depend on p in every part."""
    A = np.array([[0.0, 1.0, 0.0], [-4.0 - p, -0.4, 1.0], [0.0, 0.0, -3.0 + p]])
    return Matrices(
        A, np.array([[0.0], [1.0 + p], [2.0]]), np.array([[3.0 - p, 0.5 * p, 0.2]]), np.array([[feedthrough + 0.3 * p]])
    )


def loop_at(p: float, feedthrough: float) -> tuple[Loop, Margins, Matrices]:
    m = matrices(p, feedthrough)
    loop = Loop(m.A, m.B[:, 0], m.C[0], float(m.D[0, 0]), "u", "y", m)
    return loop, margins(loop), m


@pytest.mark.parametrize("feedthrough", [0.0, 0.3, -0.6])
def test_all_margins_move_as_differences_say(feedthrough: float) -> None:
    p, h = 0.2, 1e-5
    loop, own, whole = loop_at(p, feedthrough)
    change = Matrices(*((a - b) / (2 * h) for a, b in zip(_parts(p + h, feedthrough), _parts(p - h, feedthrough), strict=True)))
    found = stability_sensitivity("p", "1", p, whole, change, poles(loop.A), (loop, own))
    ahead, back = (loop_at(p + step, feedthrough) for step in (h, -h))
    for name in ("gain_margin", "phase_margin", "delay_margin", "modulus_margin"):
        expected = (getattr(ahead[1], name) - getattr(back[1], name)) / (2 * h)
        assert getattr(found, name) == pytest.approx(expected, rel=1e-4, abs=1e-6, nan_ok=True)
    for values, which in ((found.eigenvalues, "open_poles"), (found.closed_eigenvalues, "closed_poles")):
        moved = (getattr(ahead[0], which).values - getattr(back[0], which).values) / (2 * h)
        assert values == pytest.approx(moved, rel=1e-5, abs=1e-6)


def _parts(p: float, feedthrough: float) -> tuple[Any, ...]:
    m = matrices(p, feedthrough)
    return m.A, m.B, m.C, m.D


def test_how_they_move_is_printed_with_units() -> None:
    loop, own, whole = loop_at(0.2, 0.3)
    change = Matrices(*((a - b) for a, b in zip(_parts(0.7, 0.3), _parts(-0.3, 0.3), strict=True)))
    text = str(stability_sensitivity("shaft.d", "N.m", 0.25, whole, change, poles(loop.A), (loop, own))).splitlines()
    assert text[0] == "Change with shaft.d = 0.25 N.m, per N.m"
    assert [line.split()[0] for line in text[1:7]] == ["pole"] * 3 + ["closed"] * 3
    assert all(line.endswith("j 1/s") for line in text[1:7])
    ends = {line[2:16].strip(): line.split()[-1] for line in text[7:]}
    assert ends["phase margin"] == "deg"
    assert ends["delay margin"] == "s"
    alone = stability_sensitivity("k", "1", 2.0, whole, change, poles(loop.A), None)
    assert str(alone).splitlines()[0] == "Change with k = 2"
    assert len(str(alone).splitlines()) == 4
    assert np.isnan([alone.gain_margin, alone.phase_margin, alone.delay_margin, alone.modulus_margin]).all()


def test_of_an_all_pass_the_phase_margin_is_that_of_the_point_nearest_to_minus_one() -> None:
    """|L| is 1 everywhere; L turns once, past -1 at 2 rad/s."""
    loop = as_loop(control.tf([1, -1, 4], [1, 1, 4]))
    (crossing,) = margins(loop).gain_crossings
    assert crossing.omega in loop.frequencies()
    assert crossing.omega == pytest.approx(2.0, rel=0.2)
    expected = np.degrees(np.angle(-complex(loop.response(1j * crossing.omega))))
    assert crossing.phase_margin == pytest.approx(expected, abs=1e-9)
    assert abs(expected) < 90


def stable_by_roots(a: float, b: float, v: float, w: float) -> list[float]:
    """Positive gains g at which roots x = s^2 of (x + v)(x + w) + g (a (x + w) + b (x + v)) leave the negative axis, or come back."""
    c = np.poly1d([a + b, a * w + b * v])  # numerator
    sums, products = np.poly1d([c[1], v + w]), np.poly1d([c[0], v * w])  # in g: x^2 + sums x + products
    borders = [g.real for g in (sums**2 - 4 * products).roots if abs(g.imag) < 1e-12]
    borders += [g.real for g in products.roots] if products.order else []

    def stays(g: float) -> bool:
        x = np.roots([1.0, sums(g), products(g)])
        return bool((np.abs(x.imag) < 1e-9).all() and (x.real < 0).all())

    borders = sorted(g for g in borders if g > 0)
    return [g for g in borders if stays(g * (1 - 1e-6)) != stays(g * (1 + 1e-6))]


@pytest.mark.parametrize(
    ("a", "b", "v", "w"),
    [
        (-0.5, 0.0, 1.0, 4.0),
        (2.0, -1.0, 1.0, 4.0),
        (-1.0, 2.0, 1.0, 4.0),
        (1.0, -3.0, 2.0, 9.0),
        (-1.0, -2.0, 1.0, 30.0),
        (1.0, 2.0, 1.0, 4.0),
    ],
)
def test_gains_of_a_loop_without_damping(a: float, b: float, v: float, w: float) -> None:
    """Two modes: the roots of the closed loop, in s^2, are those of a quadratic."""
    loop = as_loop(control.tf([a + b, 0, a * w + b * v], [1, 0, v + w, 0, v * w]))
    found = margins(loop)
    assert found.real
    expected = stable_by_roots(a, b, v, w)
    report = gl.stability(control.tf([a + b, 0, a * w + b * v], [1, 0, v + w, 0, v * w]), loop=(0, 0)).loop
    assert report is not None
    borders = [g for ends in report.stable_gains for g in ends if 0 < g < np.inf]
    assert borders == pytest.approx(expected, rel=1e-6)
    assert found.gain_margin == (pytest.approx(min(expected, key=lambda g: abs(np.log(g))), rel=1e-6) if expected else np.inf)


def test_between_two_modes_of_opposite_sign_the_curve_turns_back() -> None:
    """``1 / (1 - x) - 1 / (4 - x)`` over x = w^2 is largest between the poles, -4/3 at x = 2.5, and nowhere else negative."""
    numerator, denominator = np.array([3.0]), [1, 0, 5, 0, 4]
    found = margins(as_loop(control.tf(numerator, denominator))).phase_crossings
    assert [(c.omega, c.gain_margin) for c in found] == [
        (pytest.approx(np.sqrt(2.5), rel=1e-6), pytest.approx(0.75, rel=1e-12))
    ]
    found = margins(as_loop(control.tf(-numerator, denominator))).phase_crossings
    assert [(c.omega, c.gain_margin) for c in found] == [(0.0, pytest.approx(4 / 3))]  # from -3/4 down to the first pole


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_crossings_of_an_integrating_loop_in_any_unit_of_time(unit: float) -> None:
    """``4 / (s (s + 1)^2)`` meets the axis at 1, with a factor of a half; beside its pole at zero it is large."""
    loop = as_loop(control.tf([4.0], [1, 2, 1, 0]))
    found = margins(Loop(unit * loop.A, unit * loop.b, loop.c, 0.0, "u", "y"))
    assert [(c.omega / unit, c.gain_margin) for c in found.phase_crossings] == [(pytest.approx(1.0), pytest.approx(0.5))]


def test_the_least_value_between_two_frequencies() -> None:
    for w in (1e-6, 2.0, 1e9):
        value, at = parts.least_between(lambda x, w=w: (x / w - 1) ** 2 + 3.0, (0.4 * w, 3 * w))
        assert (value, at) == (pytest.approx(3.0), pytest.approx(w, rel=1e-7))
    _, at = parts.least_between(lambda x: abs(x - 0.01), (1e-3, 1e3))
    assert at == pytest.approx(0.01, rel=1e-6)


def test_roots_are_sign_changes_but_no_jumps() -> None:
    """Samples that are zero are roots; a function that rounds otherwise at a point has its root at the nearer end."""
    grid = np.array([1.0, 1.5, 2.0, 3.0, 4.0])

    def values(f: Any) -> list[float]:
        with np.errstate(divide="ignore"):
            return parts.roots(grid, np.array([f(x) for x in grid]), f)

    assert values(lambda x: (x - np.sqrt(2.0)) * (x - 3.5)) == pytest.approx([np.sqrt(2.0), 3.5], rel=1e-14)
    assert values(lambda x: (x - 2.0) * (x - 3.5)) == [2.0, pytest.approx(3.5)]
    assert values(lambda x: 1.0 + x) == []
    assert values(lambda x: 1.0 / np.float64(x - 1.25)) == []  # a pole, which halving meets
    assert values(lambda x: 1.0 / np.float64(x - 2.0)) == []
    assert parts.roots(np.array([1.0, 2.0]), np.array([-1e-20, 1.0]), lambda x: 1e-20 if x < 1.5 else 1.0) == [1.0]
    assert parts.roots(np.array([1.0, 2.0]), np.array([-1.0, 1e-20]), lambda x: -1.0 if x < 1.5 else -1e-20) == [2.0]


def test_a_loop_that_sees_nothing_has_no_margin_but_its_distance() -> None:
    found = margins(Loop(np.diag([-1.0, -3.0]), np.ones(2), np.zeros(2), 0.0, "u", "y"))
    assert (found.phase_crossings, found.gain_crossings) == ((), ())
    assert (found.modulus_margin, found.gain_margin, found.phase_margin) == (1.0, INFINITE, INFINITE)


def test_a_curve_that_is_on_the_axis_but_for_rounding_crosses_it_at_its_ends_alone() -> None:
    """-0.5, and two large parts that cancel each other below 1 mrad/s but for rounding of either sign."""
    p = np.linspace(1e-3, 1.3e-3, 7)
    ends = 1e8 * np.append(p, -p)
    loop = Loop(-np.diag(np.append(p, p)), np.ones(14), ends, -0.5, "u", "y")
    imaginary = loop.response(1j * loop.frequencies()).imag
    assert imaginary.min() < -1e-12 < 1e-12 < imaginary.max()
    found = margins(loop)
    assert not found.real
    assert [(c.omega, c.gain_margin) for c in found.phase_crossings] == [(0.0, pytest.approx(2.0)), (INFINITE, 2.0)]


@pytest.mark.parametrize("factor", [9.5, 10.5, -10.5])
def test_a_start_is_negative_from_ten_roundings_on(factor: float) -> None:
    lag = np.array([[-1.0]]), np.ones(1), np.ones(1)
    rounding = float(Loop(*lag, -1.0, "u", "y").rounding(0.0))
    loop = Loop(*lag, -1.0 - factor * rounding, "u", "y")
    assert float(loop.response(0.0).real) / float(loop.rounding(0.0)) == pytest.approx(-factor, abs=0.02)
    assert [c.omega for c in margins(loop).phase_crossings] == ([0.0] if factor > 10 else []) + [INFINITE]


@pytest.mark.parametrize("at", range(5))
def test_the_nearest_point_lies_between_its_neighbours(at: int) -> None:
    """Of five frequencies, one of which is nearest to the peak: it is found between those beside it, but not beyond the ends."""

    class Coarse(Loop):
        def frequencies(self, *_: Any, **__: Any) -> Any:
            return 2.9 * 2.0 ** (np.arange(5.0) - at)

    resonance = as_loop(control.tf([0.5, 0.0], [1, 0.5, 9.0]), gain=-0.9)  # 1 + L is 1 - 0.9 at the resonance, 3 rad/s
    coarse = Coarse(resonance.A, resonance.b, resonance.c, resonance.d, "u", "y")
    sampled = abs(1 + complex(resonance.response(2.9j)))
    found = margins(coarse)
    inside = 0 < at < 4
    assert found.modulus_margin == pytest.approx(0.1 if inside else sampled, rel=1e-9)
    assert found.modulus_omega == pytest.approx(3.0 if inside else 2.9, rel=1e-6)


@pytest.mark.parametrize("above", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("w", [1.0, 5.95, 77.0])
def test_a_resonance_that_hardly_reaches_the_circle_crosses_it_twice(w: float, above: float) -> None:
    """k 2 z w s / (s^2 + 2 z w s + w^2) has the magnitude k at w, and 1 where (s / w - w / s) / 2 z is +-sqrt(k^2 - 1)."""
    z, k = 0.02, 1 + above
    found = margins(as_loop(control.tf([2 * k * z * w, 0.0], [1, 2 * z * w, w**2]))).gain_crossings
    half = z * np.sqrt(k**2 - 1)
    sides = [w * (np.sqrt(half**2 + 1) - half), w * (np.sqrt(half**2 + 1) + half)]
    assert [c.omega for c in found] == pytest.approx(sides, rel=1e-9)


@pytest.mark.parametrize("off", [1e-2, 1e-4, 1e-6])
def test_a_curve_that_ends_near_the_circle_meets_it_far_from_its_poles(off: float) -> None:
    """k (s + 7) / s falls to k just below 1 at infinite frequency; k / (s + 1) falls from k just above 1 at rest."""
    k = 1 - off
    high = margins(as_loop(control.tf([k, 7 * k], [1, 0]))).gain_crossings
    assert [c.omega for c in high] == pytest.approx([7 * k / np.sqrt((1 - k) * (1 + k))], rel=1e-9)
    low = margins(as_loop(control.tf([1 + off], [1, 1]))).gain_crossings
    assert [c.omega for c in low] == pytest.approx([np.sqrt(off * (2 + off))], rel=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_roots_between_two_samples_are_found(sign: float) -> None:
    """Of a function that goes through 0 and returns before the next sample, as of a curve that hardly reaches the axis."""
    x = np.linspace(0.0, 2.0, 18)
    assert parts.roots(x, sign * ((x - 0.97) ** 2 - 1e-6), lambda x: sign * ((x - 0.97) ** 2 - 1e-6)) == pytest.approx(
        [0.969, 0.971]
    )
    assert parts.roots(x, sign * ((x - 0.97) ** 2 + 1e-6), lambda x: sign * ((x - 0.97) ** 2 + 1e-6)) == []


def test_the_lower_one_of_two_near_places_is_the_nearest() -> None:
    """Two resonances that come as near to -1 as 0.5 and 0.4; of the samples, the lowest is at the top of the first one."""

    class Coarse(Loop):
        def frequencies(self, *_: Any, **__: Any) -> Any:
            return np.array([0.3, 0.8, 1.0, 1.2, 3.0, 9.3, 10.8, 30.0])

    tops = (control.tf([k * 0.2 * w, 0], [1, 0.2 * w, w**2]) for w, k in ((1.0, -0.5), (10.0, -0.6)))
    both = as_loop(sum(tops, control.tf([0], [1])))
    found = margins(Coarse(both.A, both.b, both.c, both.d, "u", "y"))
    w = np.linspace(9.9, 10.1, 200_001)
    assert (found.modulus_margin, found.modulus_omega) == (
        pytest.approx(float(np.abs(1 + both.response(1j * w)).min()), rel=1e-9), pytest.approx(10.0, rel=1e-3),
    )  # fmt: skip


class Driven(gl.Component):
    """A motor and a load that turn freely, the load in two parts behind a stuck clutch; and a spring to the ground, if there is one."""

    c0 = gl.Parameter("N.m/rad", default=0.0)
    held = gl.Structural(False)

    def assemble(self) -> list[gl.Connection]:
        self.torque, self.motor, self.load, self.wheel = gp.Torque(), gp.Inertia(J=1.0), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
        self.shaft, self.clutch = gp.SpringDamper(c=4.0, d=0.5), gp.Clutch(f_normalized=1.0, fn_max=100.0)
        row = [self.torque.flange, self.motor.flange_a, self.motor.flange_b, self.shaft.flange_a, self.shaft.flange_b,
               self.load.flange_a, self.load.flange_b, self.clutch.flange_a, self.clutch.flange_b, self.wheel.flange_a]  # fmt: skip
        if self.held:
            self.spring, self.ground = gp.SpringDamper(c=self.c0, d=0.1), gp.Fixed()
            row += [self.wheel.flange_b, self.spring.flange_a, self.spring.flange_b, self.ground.flange]
        return [gl.connect(a, b) for a, b in zip(row[::2], row[1::2], strict=True)]


@pytest.mark.parametrize("gain", [2.0, -2.0, 30.0])
def test_a_free_train_is_not_seen_in_its_twist(gain: float) -> None:
    """At rest the shaft's twist is ``-(u / J) / (c (1 / J + 1 / J'))``: the pole of the free rotation is none of the loop's."""
    report = gl.stability(gl.compile(Driven()), loop=("torque.tau", "shaft.phi_rel"), gain=gain)
    margin, found = 4.0 * (1.0 + 1.0 / 3.0) / gain, report.loop.margins
    unstable = np.linalg.eigvals(report.loop.loop.closed(1.01 * abs(margin))).real.max() > 1e-3
    assert unstable == (gain > 0)
    if gain < 0:
        assert (found.gain_margin, report.loop.stable_gains) == (INFINITE, ((0.0, INFINITE),))
        return
    assert [(c.omega, c.gain_margin) for c in found.phase_crossings] == [(0.0, pytest.approx(margin, rel=1e-12))]
    assert report.loop.stable_gains == ((0.0, pytest.approx(margin, rel=1e-12)),)
    assert report.loop.verdict == ("marginal" if margin > 1 else "unstable")
    for parameter, slope in (("shaft.c", margin / 4.0), ("motor.J", 4.0 / 3.0 / gain), ("wheel.J", -4.0 / 9.0 / gain)):
        assert report.sensitivity(parameter).gain_margin == pytest.approx(slope, rel=1e-9)


def test_a_margin_at_rest_moves_with_a_parameter_though_a_clutch_sticks() -> None:
    """The twist of the spring to the ground is ``u / c0`` at rest; what the clutch holds is a state of the whole model alone."""
    system, near = gl.compile(Driven(held=True)), {"c0": 5.0}
    report = gl.stability(system, loop=("torque.tau", "spring.phi_rel"), gain=2.0, parameters=near)
    assert report.loop.margins.phase_crossings[0] == PhaseCrossing(0.0, pytest.approx(2.5, rel=1e-12))
    assert parts_at_rest(report) == pytest.approx(2.0 / 25.0, rel=1e-9)


def parts_at_rest(report: gl.StabilityReport) -> float:
    """The slope of the response at rest over the stiffness to the ground."""
    return change_at_rest(report.loop.loop.whole, report.loop.loop.changes(["c0"])[0])


@pytest.mark.parametrize("hidden", [[[0.0]], [[0.0, 1.0], [0.0, 0.0]]])
@pytest.mark.parametrize("shown", [False, True])
@pytest.mark.parametrize("k", [-1.0, -0.5, 2.0])
def test_poles_at_rest_that_the_loop_does_not_see(hidden: list[list[float]], shown: bool, k: float) -> None:
    """``k / (s + 1)^2`` beside chains of poles at 0 that the input does not reach, or that the output does not show."""
    lag, rng = control.ss(control.tf([k], [1, 2, 1])), np.random.default_rng(5)
    q = len(hidden)
    coupling = rng.normal(size=(q, 2))
    A = np.block([[np.array(hidden), coupling * (not shown)], [coupling.T * shown, lag.A]])
    b, c = np.vstack([rng.normal(size=(q, 1)) * (not shown), lag.B]), np.hstack([rng.normal(size=(1, q)) * shown, lag.C])
    basis = np.linalg.qr(rng.normal(size=A.shape))[0] * np.geomspace(1.0, 3.0, q + 2)
    found = margins(as_loop(control.ss(np.linalg.solve(basis, A @ basis), np.linalg.solve(basis, b), c @ basis, 0.0)))
    assert [(x.omega, x.gain_margin) for x in found.phase_crossings] == ([(0.0, pytest.approx(-1 / k))] if k < 0 else [])
    curve = k / (1j * np.geomspace(1e-6, 1e3, 200_001) + 1) ** 2
    assert found.modulus_margin == pytest.approx(float(np.abs(1 + np.append(curve, k)).min()), abs=1e-8)


class Apart(gl.Component):
    """A driven body, and one that nothing is connected to."""

    def assemble(self) -> list[Any]:
        self.torque, self.body, self.damper, self.ground = gp.Torque(), gp.Inertia(J=1.0), gp.Damper(d=1.0), gp.Fixed()
        self.other = gp.Inertia(J=2.0)
        return [
            gl.connect(self.torque.flange, self.body.flange_a, self.damper.flange_a),
            gl.connect(self.damper.flange_b, self.ground.flange),
        ]


def test_a_loop_without_a_response_has_no_crossing() -> None:
    """What does not reach the output can be multiplied, turned and delayed at will."""
    report = gl.stability(gl.compile(Apart(), outputs=["body.w", "other.w"]), ("torque.tau", "other.w"))
    assert report.loop is not None
    found = report.loop.margins
    assert found.gain_margin == found.phase_margin == found.delay_margin == np.inf
    assert found.modulus_margin == 1.0
    assert not found.real
    assert "|L| is nowhere 1" in str(report)
    slopes = report.sensitivity("body.J")
    assert np.isnan([slopes.gain_margin, slopes.phase_margin, slopes.delay_margin]).all()
    assert slopes.modulus_margin == 0.0
