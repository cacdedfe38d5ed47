"""Switching times on both sides of every limit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
from gearlib.equations import switch_times as module
from gearlib.equations.kernel import relation_kernel
from gearlib.equations.quasipolynomials import TIME, OutsideClassError
from gearlib.equations.switch_times import distinct, has_known_zeros, instants, rounding, times_of_breakpoints
from gearlib.equations.template import template_of
from gearlib.errors import ArgumentError
from gearlib.language.expressions import SquareWave
from gearlib.program.event_iteration import right_hand

t = TIME
P, Q, x = sympy.symbols("P Q x", real=True)


@pytest.mark.parametrize(
    ("period", "offset", "t0", "t_end"),
    [(0.5, 1.0, 0.0, 2.0), (0.1, 0.0, 0.3, 0.7), (0.1, -5.03, 0.0, 0.5), (2.0, 3.0, 0.0, 2.9), (1.0, 0.0, 4.0, 4.0),
     (0.3, 0.2, 100.0, 103.0)],
)  # fmt: skip
def test_instants_are_all_multiples_of_the_period_in_a_closed_interval(
    period: float, offset: float, t0: float, t_end: float
) -> None:
    every = [offset + k * period for k in range(5000)]
    assert instants(period, offset, t0, t_end).tolist() == [s for s in every if t0 <= s <= t_end]


def test_instants_that_are_too_many_or_have_no_period_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_INSTANTS", 10)
    assert len(instants(1.0, 0.0, 0.0, 10.0)) == len(instants(1.0, 0.0, 995.0, 1005.0)) == 11
    with pytest.raises(OutsideClassError, match=r"there are 10\.5 instants, more than 10"):
        instants(1.0, 0.0, 0.0, 10.5)
    for period in (0.0, -1.0, math.nan):
        with pytest.raises(OutsideClassError, match=rf"a period is {period:g} s, which is not positive"):
            instants(period, 0.0, 0.0, 1.0)


def test_a_square_wave_switches_at_its_instants_inside_the_interval() -> None:
    wave = SquareWave(t, sympy.Float(0.25), sympy.Float(0.5)) > 0
    assert times_of_breakpoints(wave, 0.5, 1.25).tolist() == [0.75, 1.0]
    assert times_of_breakpoints(wave, 0.0, 1.0).tolist() == [0.5, 0.75]
    assert times_of_breakpoints(wave, 1e7, 1e7 + 0.6).tolist() == [1e7 + 0.25, 1e7 + 0.5], "however late"


def test_times_that_differ_by_rounding_are_one_and_those_at_the_ends_none() -> None:
    same = rounding(1.0, -4.0)
    assert same == rounding(4.0) == 4 * rounding(1.0)
    assert 0 < same < 1e-14
    times = np.array([3.0, 1.0, 2.0 + same / 2, 2.0, 1.0 + 3 * same, same / 2, 4.0 - same / 2])
    assert distinct(times, 0.0, 4.0).tolist() == [1.0, 1.0 + 3 * same, 2.0, 3.0]


@pytest.mark.parametrize(
    ("expression", "root"),
    [
        (sympy.sin(3 * t + 1) > 0.4, lambda s: math.sin(3 * s + 1) - 0.4),
        (2 - 3 * sympy.cos(5 * t) < 1, lambda s: 1 - 3 * math.cos(5 * s)),
        (sympy.sin(3 * t + 1) / 2 > 0.2, lambda s: math.sin(3 * s + 1) / 2 - 0.2),
        (sympy.sin(2 * t) + sympy.cos(2 * t) > 1.2, lambda s: math.sin(2 * s) + math.cos(2 * s) - 1.2),
        (3 * sympy.exp(-t / 4) < 2, lambda s: 3 * math.exp(-s / 4) - 2),
        ((t - 1) * (t - 2) * (t + 3) * (2 * t - 5) > 0.1, lambda s: (s - 1) * (s - 2) * (s + 3) * (2 * s - 5) - 0.1),
        (t**2 > 2 * t + 1, lambda s: s * s - 2 * s - 1), (3.1 - 2 * t > 0, lambda s: 3.1 - 2 * s),
    ],
)  # fmt: skip
@pytest.mark.parametrize(("t0", "t_end"), [(0.0, 4.0), (-7.0, 2.0), (2.5, 60.0)])
def test_every_change_of_sign_is_found(expression: Any, root: Any, t0: float, t_end: float) -> None:
    """Counted on a fine grid, and zero to rounding at each."""
    found = times_of_breakpoints(expression, t0, t_end)
    grid = np.linspace(t0, t_end, 20003)
    signs = np.sign([root(s) for s in grid])
    assert len(found) == np.count_nonzero(np.diff(signs))
    assert np.abs([root(s) for s in found]).max(initial=0.0) < 1e-11


@pytest.mark.parametrize("phase", np.arange(-3.0, 3.2, 0.25).tolist())
@pytest.mark.parametrize(("t0", "t_end"), [(0.0, 1.2), (-0.9, 0.4), (2.0, 2.0 + math.pi), (-5.0, -2.0)])
@pytest.mark.parametrize("level", [-0.9, 0.0, 0.95])
def test_a_sinusoid_switches_inside_any_part_of_a_turn(phase: float, t0: float, t_end: float, level: float) -> None:
    """cos(2 t + phase) = level where 2 t + phase is the angle of that, or the opposite one, and any number of turns."""
    angle = math.acos(level)
    every = sorted((2 * math.pi * k + sign * angle - phase) / 2 for k in range(-5, 6) for sign in (1, -1))
    found = times_of_breakpoints(sympy.cos(2 * t + phase) > level, t0, t_end)
    assert found == pytest.approx([s for s in every if t0 < s < t_end], rel=1e-12)


@pytest.mark.parametrize("side", [1, -1])
def test_a_sinusoid_that_touches_a_level_does_so_once_per_turn(side: int) -> None:
    found = times_of_breakpoints(sympy.Gt(3 * sympy.cos(t), 3 * side, evaluate=False), -1.0, 12.0)
    assert found == pytest.approx([2 * math.pi * k for k in (0, 1)] if side > 0 else [math.pi, 3 * math.pi], abs=1e-12)


NEVER = [(sympy.sin(t), 1.5), (sympy.exp(t), -1), (sympy.exp(-t), -0.5), (sympy.exp(-t), 0), (t**2, -1), (sympy.cos(t) + 3, 1)]


@pytest.mark.parametrize("expression", [sympy.Gt(*sides, evaluate=False) for sides in NEVER])
def test_what_never_switches(expression: Any) -> None:
    assert times_of_breakpoints(expression, -10.0, 10.0).tolist() == []


def test_a_wave_that_switches_too_often_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_SWITCHES", 20)
    assert len(times_of_breakpoints(sympy.sin(math.pi * t + 0.5) > 0, 0.0, 20.0)) == 20
    with pytest.raises(ArgumentError, match="it switches more than 20 times"):
        times_of_breakpoints(sympy.sin(math.pi * t + 0.5) > 0, 0.0, 20.5)


@pytest.mark.parametrize(
    ("expression", "switches"),
    [
        (sympy.Abs(t - 1), [1.0]), (sympy.sign(t - 2), [2.0]), (sympy.Heaviside(t - 3), [3.0]), (sympy.Max(t, 2 - t, 3.5), [1.0, 3.5]),
        (sympy.Min(t, 2 - t), [1.0]), (sympy.Piecewise((sympy.Abs(t - 1), t < 2), (0, True)), [1.0, 2.0]), (sympy.Symbol("x") > t, []),
    ],
)  # fmt: skip
def test_what_has_branches_switches_where_they_meet(expression: Any, switches: list[float]) -> None:
    assert times_of_breakpoints(expression, 0.0, 4.0).tolist() == switches


@pytest.mark.parametrize(
    "expression",
    [t + sympy.sin(t) > 1, sympy.sin(t) > sympy.sin(3 * t), t * sympy.exp(t) > 1, sympy.exp(t) + sympy.exp(2 * t) > 3],
)
def test_what_has_no_closed_form_is_refused(expression: Any) -> None:
    with pytest.raises(
        ArgumentError, match=r"cannot tell when .* switches between t = 0 and 4 s: the zeros of .* are not known"
    ):
        times_of_breakpoints(expression, 0.0, 4.0)


@pytest.mark.parametrize(
    ("c", "root"),  # roots from mpmath.polyroots with 40 digits
    [
        ([0.0011, -17, -280, -11000, 0.0013], 6.463689468150225e-05),
        ([-9.9e-05, 3400, 0.00011, 11000, -5.4e-05], 2.911764705882342e-08),
    ],
)
def test_small_roots_of_polynomials_keep_their_digits(c: list[float], root: float) -> None:
    times = times_of_breakpoints(sum(a * t**k for k, a in enumerate(c)) > 0, 0.0, 1e-3)
    assert times[np.argmin(np.abs(times - root))] == pytest.approx(root, rel=1e-15, abs=0)


def test_double_roots_are_where_they_are() -> None:
    """There the slope is rounding, too, and no step along it helps."""
    for root in np.random.default_rng(5).uniform(0.1, 1.9, 50).tolist():
        times = times_of_breakpoints(sympy.expand((t - root) ** 2 * (t + 3.0)) > 0, 0.0, 2.0)
        assert times == pytest.approx(root, rel=1e-6)
    assert times_of_breakpoints(t**3 - 0.5 * t**2 > 0, -1.0, 9.0).tolist() == [0.0, 0.5], "a slope of exactly zero"
    assert times_of_breakpoints(t**5 - t > 0, -2.0, 2.0) == pytest.approx([-1, 0, 1], abs=1e-15), "a third derivative of zero"


@pytest.mark.parametrize("power", [3, 5, 7])
def test_where_several_roots_are_one_a_sum_switches_behind_its_rounding(power: int) -> None:
    """Where the terms of an expanded power cancel, so that its sign is that of rounding closer by; beside a single root."""
    rng = np.random.default_rng(power)
    for root in rng.uniform(0.3, 1.5, 20).tolist():
        expanded = sympy.expand((t - root) ** power * (3 - t))
        times = times_of_breakpoints(expanded > 0, 0.0, 4.0)
        (first,) = {x for x in times.tolist() if x < 2.5}
        terms = sum(abs(float(a)) * root**k for k, a in enumerate(reversed(sympy.Poly(expanded, t).all_coeffs())))
        assert root <= first <= root + 2 * (2.0**-46 * terms / (3 - root)) ** (1 / power)
        assert times[-1] == pytest.approx(3.0, rel=1e-9)
        assert expanded.subs(t, float(right_hand(np.array(first)))) > 0


@pytest.mark.parametrize("power", [3, 5])
@pytest.mark.parametrize("side", [1, -1])
def test_a_single_root_close_to_where_several_would_meet_is_itself(power: int, side: int) -> None:
    """(t - 1)**power = c with a c that is small, but 100 times what counts as rounding."""
    c = side * 100 * 2.0**-46 * 2.0**power
    times = times_of_breakpoints(sympy.expand((t - 1) ** power) - c > 0, 0.0, 4.0)
    assert times == pytest.approx(1 + side * abs(c) ** (1 / power), abs=1e-2 * abs(c) ** (1 / power))


@pytest.mark.parametrize("root", [1.0, 0.37, 1234.5])
@pytest.mark.parametrize("power", [2, 3, 5])
def test_products_and_powers_switch_where_their_factors_do(power: int, root: float) -> None:
    """To the last bit, although they are zero but for rounding in a neighbourhood that is much wider."""
    assert times_of_breakpoints((t - root) ** power > 0, 0.0, 2 * root).tolist() == [root]
    assert times_of_breakpoints(3 * (t - root) ** power * (t - 1.5 * root) > 0, 0.0, 2 * root).tolist() == [root, 1.5 * root]
    assert times_of_breakpoints(-sympy.exp(t / root) * (t - root) > 0, 0.0, 2 * root).tolist() == [root]
    waves = times_of_breakpoints((t - root) * sympy.sin(np.pi / root * t - 1) ** power > 0, 0.0, 2 * root)
    assert waves == pytest.approx([root / np.pi, root, root / np.pi + root], rel=1e-12)
    assert times_of_breakpoints((t - root) ** power + 1 > 0, root - 0.5, root + 0.5).tolist() == []


@pytest.mark.parametrize("size", [1e-2, 1.0, 1e3])
@pytest.mark.parametrize("apart", [0.3, 1e-2, 1e-3, 2e-4])
def test_a_polynomial_has_changed_its_sign_just_after_its_roots(apart: float, size: float) -> None:
    """There conditions are evaluated. Beside a complex pair or between other roots its terms almost cancel, and rounding hides its sign."""
    for root in (size * np.random.default_rng(3).uniform(0.5, 1.5, 20)).tolist():
        gap = apart * root
        pair = np.polymul([1.0, -root], [1.0, -2 * (root + 0.3 * gap), (root + 0.3 * gap) ** 2 + gap**2])
        three = np.poly([root, root + gap, root - 2 * gap])
        for c, roots, signs in ((pair, [root], [1]), (three, [root - 2 * gap, root, root + gap], [1, -1, 1])):
            numbers = c[::-1].tolist()
            times = times_of_breakpoints(sum(a * t**k for k, a in enumerate(numbers)) > 0, 0.0, 3 * root)
            assert times == pytest.approx(roots, rel=1e-13 + 3e-14 / apart**2)
            after = [sum(a * s**k for k, a in enumerate(numbers)) for s in right_hand(times).tolist()]
            assert np.sign(after).tolist() == signs


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("below", [1e-2, 1e-7, 1e-9, 1e-11])
@pytest.mark.parametrize("rate", [1e-2, 1.0, 3e3])
def test_a_sinusoid_has_changed_its_sign_just_after_it_passes_a_level_near_its_peak(
    side: int, below: float, rate: float
) -> None:
    for phase in np.random.default_rng(4).uniform(-3.0, 3.0, 20).tolist():
        level = side * (1.0 - below)
        times = times_of_breakpoints(side * sympy.sin(rate * t + phase) > side * level, 0.0, 20.0 / rate)
        turns = (rate * times + phase - side * np.pi / 2 + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(turns) == pytest.approx(np.arccos(1.0 - below), rel=1e-13 / below + 1e-9)
        above = side * (np.sin(rate * right_hand(times) + phase) - level) > 0
        assert above.tolist() == (turns < 0).tolist()
        assert (np.diff(times) > 0).all()
        assert (np.diff(turns > 0) != 0).all()


@pytest.mark.parametrize("rate", [-3.0, -1e-4, -1e-7, 1e-8, 2.0])
def test_an_exponential_has_passed_a_level_just_after(rate: float) -> None:
    """Also one that hardly changes."""
    for root in np.random.default_rng(6).uniform(0.1, 1.9, 20).tolist():
        level = float(np.exp(rate * root))
        (time,) = times_of_breakpoints(sympy.exp(rate * t) > level, 0.0, 2.0)
        assert time == pytest.approx(root, rel=1e-13, abs=4e-15 / abs(rate))
        assert np.sign(np.exp(rate * right_hand(np.array([time]))) - level).tolist() == [np.sign(rate)]
    assert times_of_breakpoints(sympy.exp(rate * t) > -1.0, 0.0, 2.0).tolist() == []


@pytest.mark.parametrize(
    ("signal", "known"),
    [
        (t - P, True), (P * t**2 - Q * t + 1, True), (gl.sin(P * t) - Q, True), (gl.exp(-P * t) - Q, True), (P - Q, True),
        (gl.sin(P * t) - Q * t, False), (gl.exp(gl.sin(t)) - P, False), (gl.sin(P * t) + gl.sin(Q * t), False),
        (gl.sin(t) + gl.sin(P * t), False), (gl.exp(t) - P * gl.exp(Q * t) - 1, False), (x * t + gl.sin(P * t) - Q, True),
        (gl.sin(t) - x * gl.atan(t), True),
    ],
)  # fmt: skip
def test_zeros_are_known_of_what_has_a_formula_for_all_parameters(signal: Any, known: bool) -> None:
    """And of what else is zero, as x is here."""
    template = template_of(gl.Eq(x, gl.Piecewise((1, signal > 0), (2, True))), "test", {"P", "Q"}.__contains__)
    assert has_known_zeros(relation_kernel(template, 0)) is known


def test_both_sides_of_what_has_no_closed_form_are_named() -> None:
    with pytest.raises(ArgumentError, match=r"the zeros of sin\(time\) - \(exp\(time\)\) are not known"):
        times_of_breakpoints(sympy.Gt(sympy.sin(t), sympy.exp(t), evaluate=False), 0.0, 1.0)
