"""The loop behind all margins: its response, zeros, frequencies and names, against matrices and polynomials."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control
import numpy as np
import pytest
from scipy.optimize import brentq

import gearlib as gl
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.feedback.feedback_loop import Loop, as_loop, refine
from gearlib.feedback.margins import margins
from gearlib.linear.linear_model import full


def random_loop(n: int, seed: int, d: float = 0.0) -> Loop:
    rng = np.random.default_rng(seed)
    return Loop(rng.normal(size=(n, n)) - np.eye(n), rng.normal(size=n), rng.normal(size=n), d, "u", "y")


@pytest.mark.parametrize("n", [0, 1, 2, 5, 8])
@pytest.mark.parametrize("d", [0.0, -0.7])
def test_responses_poles_and_zeros_are_those_of_the_matrices(n: int, d: float) -> None:
    """For points in any shape; zeros are where the response vanishes, and as many as the polynomial has."""
    loop = random_loop(n, n, d)
    s = np.array([[0.3j, 1 + 2j, 5.0], [-4.0, 1e3j, 2j]])
    exact = np.array([[loop.c @ np.linalg.solve(x * np.eye(n) - loop.A, loop.b) + d for x in row] for row in s])
    assert loop.response(s) == pytest.approx(exact, rel=1e-9)
    assert loop.response(2j) == pytest.approx(exact[1, 2], rel=1e-9)
    assert loop.response(2j).shape == ()
    assert np.sort_complex(loop.open_poles.values) == pytest.approx(np.sort_complex(np.linalg.eigvals(loop.A)), abs=1e-10)
    closed = loop.A - np.outer(loop.b, loop.c) / (1 + d)
    assert np.sort_complex(loop.closed_poles.values) == pytest.approx(np.sort_complex(np.linalg.eigvals(closed)), abs=1e-10)
    assert len(loop.zeros) == (n if d else max(n - 1, 0))
    assert np.abs(loop.response(loop.zeros)) == pytest.approx(0.0, abs=1e-9)
    sizes = np.abs(np.concatenate([loop.open_poles.values, loop.closed_poles.values]))
    assert sorted(np.abs(loop.critical)) == pytest.approx(sorted(sizes))
    assert loop.scale == (pytest.approx((sizes.min(), sizes.max())) if n else (1.0, 1.0))


@pytest.mark.parametrize("k", [1e-4, 1e4])
def test_zeros_count_and_scale_with_the_unit_of_time(k: float) -> None:
    one = random_loop(6, 3)
    other = Loop(k * one.A, k * one.b, one.c, 0.0, "u", "y")
    assert len(other.zeros) == 5
    apart = np.abs(np.subtract.outer(other.zeros / k, one.zeros)) / np.abs(one.zeros)
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-7


@pytest.mark.parametrize("unit", [1e-25, 1e25])
@pytest.mark.parametrize("d", [0.0, 0.5])
def test_zeros_do_not_depend_on_the_units_of_the_signals(unit: float, d: float) -> None:
    one = random_loop(6, 3, d)
    for b, c in ((unit, 1.0), (1.0, unit), (unit, 1 / unit)):
        other = replace(one, b=one.b * b, c=one.c * c, d=one.d * b * c)
        assert np.poly(other.zeros) == pytest.approx(np.poly(one.zeros), rel=1e-9)


def test_rounding_is_that_of_the_terms_which_cancel() -> None:
    """Of 1e8 / (s + 1) - 1e8 / (s + 1): a hundred units in the last place of either, and four of the matrix's."""
    loop = Loop(-np.eye(2) + np.array([[0, 1e-3], [0, 0]]), np.array([1.0, 1.0]), np.array([1e8, -1e8]), 0.5, "u", "y")
    terms = 2e8 + 0.5
    matrix = np.sqrt(2) * np.sqrt(2) * 1e8 * np.sqrt(2)  # its norm, and those of the states and of the weights of an output
    assert float(loop.rounding(0.0)) == pytest.approx(np.finfo(float).eps * (1e2 * terms + 4 * matrix), rel=0.01)
    assert loop.rounding([1j, 2j]).shape == (2,)
    for d in (5.0, -5.0):  # beside a feedthrough that is as large as the rest: of 3 / (s + 2)
        plain = Loop(np.array([[-2.0]]), np.array([3.0]), np.array([-1.0]), d, "u", "y")
        assert float(plain.rounding(1.5j)) == pytest.approx(
            np.finfo(float).eps * (1e2 * (3.0 / 2.5 + 5.0) + 4 * 2.0 * 3.0 / 2.5**2), rel=1e-9
        )


@pytest.mark.parametrize("decades", [1.0, 2.0])
def test_frequencies_go_decades_beyond_the_poles_and_are_dense_beside_them(decades: float) -> None:
    loop = as_loop(control.tf([1.0, 0.02, 25.0], np.polymul([1, 0.002, 1], [1, 0.1, 100.0])))
    omega = loop.frequencies(decades)
    assert (omega[0], omega[-1]) == pytest.approx((loop.scale[0] / 10**decades, loop.scale[1] * 10**decades))
    assert (np.diff(omega) > 0).all()
    middle, length = (omega[1:] + omega[:-1]) / 2, np.diff(omega)
    features = np.concatenate([loop.critical, loop.zeros])
    turn = (length[:, None] / np.abs(1j * middle[:, None] - features)).sum(axis=1)
    assert turn.max() < 0.11
    assert len(omega) < 5000
    values = loop.response(1j * omega)
    assert np.abs(np.angle(values[1:] / values[:-1])).max() < 0.11


def test_frequencies_leave_out_poles_on_the_axis_and_come_near_them() -> None:
    loop = as_loop(control.tf([1.0], [1, 0, 4.0]))
    omega = loop.frequencies()
    assert not np.isin(2.0, omega)
    for side in (omega[omega < 2.0], omega[omega > 2.0]):
        assert 0.0 < np.abs(side - 2.0).min() < 2.1e-7


def test_a_path_is_refined_until_nothing_turns_by_more_than_a_step() -> None:
    features = np.array([-0.01 + 1j, 3j])
    found = refine(np.array([0.0, 2.0, 5.0]), lambda x: 1j * x, features, 0.5)
    assert set(found) >= {0.0, 2.0, 5.0}
    length = np.diff(found)
    middle = (found[1:] + found[:-1]) / 2
    gaps = np.abs(1j * middle[:, None] - features) - length[:, None] / 2
    clear = gaps.min(axis=1) > 1e-8
    assert (length[clear, None] / gaps[clear]).sum(axis=1).max() <= 0.5
    assert length.min() > 1e-10
    assert refine(np.array([0.0, 1.0]), lambda x: 1j * x, np.array([-100.0 + 0j]), 0.5).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("unit", [1e-200, 1e-9, 1e9, 1e150])
def test_a_path_is_refined_alike_in_any_unit(unit: float) -> None:
    features = np.array([-0.01 + 1j, 3j])
    found = refine(np.array([0.0, 2.0, 5.0]), lambda x: 1j * x, features, 0.5)
    other = refine(unit * np.array([0.0, 2.0, 5.0]), lambda x: 1j * x, unit * features, 0.5)
    assert other == pytest.approx(unit * found, rel=1e-6)


def two() -> control.StateSpace:
    return control.ss(
        [[-1.0]], [[1.0, 2.0]], [[3.0], [4.0], [5.0]], np.arange(6.0).reshape(3, 2), inputs=["a", "b"], outputs=["x", "y", "z"]
    )


@pytest.mark.parametrize("chosen", [("b", "y"), (1, 1), ("b", 1), ["b", "y"]])
def test_a_loop_is_chosen_by_names_or_numbers(chosen: Any) -> None:
    loop = as_loop(two(), chosen, gain=-2.0)
    assert (loop.input, loop.output, loop.gain) == ("b", "y", "")
    assert (loop.b.tolist(), loop.c.tolist(), loop.d) == ([-4.0], [4.0], -6.0)


def test_the_gain_of_a_loop_is_said_with_the_unit_that_makes_it_a_number(paper: gl.System) -> None:
    """But for signals of the same unit, and for models that have no units."""
    assert as_loop(paper, ("tau_in", "w_out"), gain=2.5).gain == "2.5 N·m per rad/s"
    assert as_loop(paper, ("tau_in", "train.x_unit.ring.tau"), gain=2.5).gain == "2.5"
    assert as_loop(two(), ("a", "x"), gain=2.5).gain == ""


def test_a_loop_in_a_system_knows_how_its_matrices_change(chain: Any) -> None:
    """With the gain in the input; one in a linear model of other origin does not."""
    system, names = chain(n=2, grounded=True), ("torque.tau", "body[0].w")
    once, thrice = (as_loop(system, names, gain=gain, parameters={"d": 0.5}) for gain in (1.0, 3.0))
    assert once.whole is not None
    assert thrice.whole is not None
    assert once.changes is not None
    assert thrice.changes is not None
    n = len(full(once.whole.A))
    assert [full(part).shape for part in (once.whole.B, once.whole.C, once.whole.D)] == [(n, 1), (1, n), (1, 1)]
    assert full(thrice.whole.B) == pytest.approx(3.0 * full(once.whole.B))
    assert full(thrice.whole.C) == pytest.approx(full(once.whole.C))
    h = 1e-5
    ahead, back = (as_loop(system, names, parameters={"d": 0.5 + s}).whole for s in (h, -h))
    assert ahead is not None
    assert back is not None
    (change,) = once.changes(["d"])
    for part in ("A", "B", "C", "D"):
        expected = (full(getattr(ahead, part)) - full(getattr(back, part))) / (2 * h)
        assert full(getattr(change, part)) == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert (as_loop(two(), ("a", "x")).whole, as_loop(two(), ("a", "x")).changes) == (None, None)


@pytest.mark.parametrize(
    ("chosen", "kind", "message"),
    [
        (("a",), ArgumentError, r"loop is \('a',\); expected \(input, output\)"),
        ("ab", ArgumentError, r"loop is 'ab'; expected \(input, output\)"),
        (("a", 3), NameLookupError, r"the linear model has no output '3'; "),
        (("a", -1), NameLookupError, "no output '-1'"),
        (("c", "x"), NameLookupError, "the linear model has no input 'c'; .*a, b"),
        (None, ArgumentError, r"choose a loop: the model has 2 inputs \(a, b\)"),
    ],
)
def test_loops_that_there_are_not(chosen: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        as_loop(two(), chosen)


def test_a_loop_that_feeds_its_input_through_at_once() -> None:
    with pytest.raises(ArgumentError, match="the loop u -> y cannot be closed: 1 \\+ L is 0 at infinite frequency"):
        _ = random_loop(2, 1, -1.0).closed_poles
    with pytest.raises(ArgumentError, match="at and parameters belong to a System"):
        as_loop(two(), ("a", "x"), at={})


def test_a_loop_closed_with_a_factor_of_its_gain() -> None:
    """As the loop with that gain is closed, but where its direct feedthrough becomes -1."""
    loop = random_loop(2, 3, -0.5)
    for factor in (0.0, 0.5, 1.0, 1.9, 7.0):
        times = replace(loop, c=loop.c * factor, d=loop.d * factor)
        assert loop.closed(factor) == pytest.approx(times.A - np.outer(times.b, times.c) / (1 + times.d), rel=1e-12)
    said = "the loop u -> y cannot be closed with 2 times its gain: 1 \\+ L is 0 at infinite frequency"
    model = control.ss(loop.A, loop.b[:, None], loop.c[None, :], [[loop.d]], inputs=["u"], outputs=["y"])
    for ask in (lambda: loop.closed(2.0), lambda: gl.root_locus_plot(model, gains=[0.0, 1.0, 2.0])):
        with pytest.raises(ArgumentError, match=said):
            ask()


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_zeros_in_any_unit_of_time(unit: float) -> None:
    """Those at infinity are none, although rounding may bring them nearer."""
    turned = np.linalg.qr(np.random.default_rng(2).normal(size=(4, 4)))[0]
    plain = as_loop(control.tf([2.0, 5.0], np.poly([-1.0, -2.0, -3.0, -4.0])))
    A, b, c = turned @ plain.A @ turned.T, turned @ plain.b, turned @ plain.c
    found = Loop(unit * A, unit * b, c, 0.0, "u", "y").zeros
    assert (found / unit).tolist() == [pytest.approx(-2.5, rel=1e-6)]


@pytest.mark.parametrize("seed", range(8))
def test_vibrations_in_series_keep_their_response_whatever_their_units(seed: int) -> None:
    """Their couplings are hardly felt beside their rates, in the units of the states."""
    draw = np.random.default_rng(seed)
    w, z = draw.uniform(30, 300, 5), draw.uniform(0.3, 1.2, 5)
    w[4], z[4] = w[0], z[0]
    A, b, c = np.zeros((10, 10)), np.zeros(10), np.zeros(10)
    for k in range(5):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[-2 * z[k] * w[k], -(w[k] ** 2)], [1.0, 0.0]]
        if k:
            A[2 * k, 2 * k - 1] = 1.0
    b[0], c[-1] = 2 * float(np.prod(w**2)), 1.0
    loop, omega = Loop(A, b, c, 0.0, "u", "y"), np.geomspace(1, 300, 40)
    exact = 2 * np.prod(w**2 / (w**2 - omega[:, None] ** 2 + 2j * z * w * omega[:, None]), axis=1)
    found = loop.response(1j * omega)
    assert found == pytest.approx(exact, rel=1e-6)
    assert (np.abs(found - exact) <= loop.rounding(1j * omega)).all()

    def past_half_a_turn(x: float) -> float:
        return float(np.angle(w**2 - x**2 + 2j * z * w * x).sum() - np.pi)

    crossings = [c.omega for c in margins(loop).phase_crossings]
    assert crossings[0] == pytest.approx(brentq(past_half_a_turn, 0.0, 1e3), rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_a_zero_at_rest_is_no_crossing_and_a_gain_is_no_cure(seed: int) -> None:
    """k s / ((s - p) (s^2 + a s + b)): the pole on the right goes to the zero at 0, which no gain reaches."""
    p, a, b, k = np.random.default_rng(seed).uniform([1, 30, 1e3, 1e3], [3, 60, 3e3, 3e3])
    A = np.array([[-a, -b, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, p]])
    report = gl.stability(control.ss(A, [[k], [0.0], [0.0]], [[0.0, 0.0, 1.0]], 0.0), loop=(0, 0)).loop
    assert report is not None
    assert (report.margins.phase_crossings, report.stable_gains, report.verdict) == ((), (), "unstable")
