"""Poles, margins and the Nyquist count: against closed forms, python-control, and eigenvalues of random systems."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import control
import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.feedback.feedback_loop import as_loop
from gearlib.feedback.margins import margins
from gearlib.feedback.nyquist import nyquist_count
from gearlib.linear.poles import poles, rows_and_null


def test_zeros_are_exact_and_their_chains_are_known() -> None:
    spring = np.array([[0, 1, 0], [-4.0, 0, 0], [0, 0, 0]])
    assert poles(spring).chains == (1,)
    assert poles(spring).verdict == "marginal"
    turning = np.zeros((4, 4))
    turning[0, 1] = 1.0  # an angle and its speed
    turning[2:, 2:] = [[0, 1], [-9.0, -0.1]]
    rng = np.random.default_rng(3)
    basis = rng.normal(size=(4, 4))
    found = poles(basis @ turning @ np.linalg.inv(basis))
    assert found.chains == (1, 1)
    assert found.verdict == "drifting"
    assert found.values[2:] == pytest.approx(np.roots([1, 0.1, 9.0])[::-1], abs=1e-12)


def test_a_matrix_that_takes_equal_speeds_to_zero() -> None:
    """Two bodies and a damper: equal entries, of which no rank tells that they cancel unless the matrix's size is known."""
    a, b = 0.00321352195939963, 0.00968580166410944
    found = poles([[-a, a, 0.0], [b, -b, 0.0], [0.0, 0.0, 0.0]])
    assert found.chains == (2,)
    assert found.values[2].real == pytest.approx(-(a + b), rel=1e-12)
    shaken = poles([[-a, a * (1 + 1e-15), 0.0], [b, -b, 0.0], [0.0, 0.0, 0.0]])
    assert shaken.chains == (2,)


@pytest.mark.parametrize("zeros", [0, 1, 3, 12])
@pytest.mark.parametrize("open_", [False, True])
def test_null_spaces_are_those_of_singular_values(zeros: int, open_: bool) -> None:
    """Matrices with known singular values; where some lie just above and below the limit, bounds alone cannot tell the rank."""
    rng = np.random.default_rng(7)
    n, limit = 12, 1e-9
    u, v = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(2))
    sizes = np.geomspace(1.0, 1e-4, n)
    if open_ and zeros < n:
        sizes[n - zeros - 1] = 1.2 * limit
    sizes[n - zeros :] = 0.8 * limit if open_ else 0.0
    rows, null = rows_and_null(u @ np.diag(sizes) @ v.T, limit)
    assert (rows.shape, null.shape) == ((n, n - zeros), (n, zeros))
    both = np.hstack([rows, null])
    assert both.T @ both == pytest.approx(np.eye(n), abs=1e-13)
    assert np.abs(null.T @ v[:, : n - zeros]).max(initial=0.0) < 1e-4  # a gap of a factor 1.5 at 1e-9 of rounding at 1e-16


def test_resonance_driven_by_a_resonance_drifts() -> None:
    oscillator = np.array([[0, 2.0], [-2.0, 0]])
    pair = np.block([[oscillator, np.eye(2)], [np.zeros((2, 2)), oscillator]])
    assert poles(pair).verdict == "drifting"
    assert poles(np.block([[oscillator, np.zeros((2, 2))], [np.zeros((2, 2)), oscillator]])).verdict == "marginal"


@pytest.mark.parametrize(
    ("numerator", "denominator", "gain_margin", "phase_omega"),
    [
        ([1], [1, 2, 1, 0], 2.0, 1.0),  # 1 / (s (s + 1)^2)
        ([1], [1, 3, 3, 1], 8.0, np.sqrt(3)),  # 1 / (s + 1)^3
        ([1], [1, 6, 11, 6], 60.0, np.sqrt(11)),  # 1 / ((s + 1) (s + 2) (s + 3)): Routh
        ([4, 4], [1, 2, -3, 0], 1.5, np.sqrt(3)),  # 4 (s + 1) / (s (s - 1) (s + 3)): conditionally stable from 3/2 on
    ],
)
def test_gain_margins_equal_closed_forms(
    numerator: list[float], denominator: list[float], gain_margin: float, phase_omega: float
) -> None:
    found = margins(as_loop(control.tf(numerator, denominator)))
    assert [c.gain_margin for c in found.phase_crossings] == pytest.approx([gain_margin], rel=1e-11)
    assert [c.omega for c in found.phase_crossings] == pytest.approx([phase_omega], rel=1e-11)


def test_phase_delay_and_modulus_margins_equal_closed_forms() -> None:
    """An integrator k / s: |L| = 1 at k, phase margin 90 degrees, and |1 + L| falls to 1 at infinity."""
    found = margins(as_loop(control.tf([5.0], [1, 0])))
    assert found.gain_crossings[0].omega == pytest.approx(5.0, rel=1e-12)
    assert found.phase_margin == pytest.approx(90.0, rel=1e-12)
    assert found.delay_margin == pytest.approx(np.pi / 10, rel=1e-12)
    assert found.modulus_margin == pytest.approx(1.0, abs=1e-6)
    assert found.gain_margin == np.inf
    # Second order, 1 / (s (s + 2 z)) with z = 0.5: w_c^2 = sqrt(1 + 4 z^4) - 2 z^2
    second = margins(as_loop(control.tf([1.0], [1, 1.0, 0])))
    w = np.sqrt(np.sqrt(1 + 4 * 0.5**4) - 2 * 0.5**2)
    assert second.gain_crossings[0].omega == pytest.approx(w, rel=1e-12)
    assert second.phase_margin == pytest.approx(90 - np.degrees(np.arctan(w)), rel=1e-12)


def test_margins_agree_with_python_control_on_small_systems() -> None:
    rng = np.random.default_rng(11)
    compared = 0
    for _ in range(60):
        n = int(rng.integers(2, 5))
        model = control.tf(rng.normal(size=n - 1), np.poly(-rng.uniform(0.2, 3, n)) + 0)
        gain, _, distance, w_phase, w_gain, _ = control.stability_margins(model, returnall=True)
        found = margins(as_loop(model))
        mine = sorted(c.gain_margin for c in found.phase_crossings if np.isfinite(c.omega))
        assert mine == pytest.approx(sorted(g for g in gain if np.isfinite(g) and g > 0), rel=1e-6)
        assert [c.omega for c in found.gain_crossings] == pytest.approx(sorted(w_gain), rel=1e-6)
        if len(distance):
            assert found.modulus_margin <= min(distance) * (1 + 1e-6)
        compared += len(mine) + len(w_gain)
        del w_phase
    assert compared > 40


def test_margins_do_not_depend_on_the_unit_of_time() -> None:
    def found(seconds: float) -> Any:
        return margins(as_loop(control.tf([3.0], np.polymul([seconds, 1], np.polymul([0.4 * seconds, 1], [0.3 * seconds, 1])))))

    one = found(1.0)
    for seconds in (1e-4, 1e5):
        other = found(seconds)
        assert other.modulus_omega * seconds == pytest.approx(one.modulus_omega, rel=1e-5)
        assert other.modulus_margin == pytest.approx(one.modulus_margin, rel=1e-11)
        assert other.gain_margin == pytest.approx(one.gain_margin, rel=1e-11)
        assert other.phase_margin == pytest.approx(one.phase_margin, rel=1e-11)


@pytest.mark.parametrize(
    ("numerator", "denominator", "clockwise", "right", "closed"),
    [
        ([10], [1, 2, 1, 0], 2, 0, 2),
        ([1], [1, 2, 1, 0], 0, 0, 0),
        ([2], [1, -1], -1, 1, 0),  # an unstable pole that feedback stabilises
        ([0.5], [1, -1], 0, 1, 1),
        ([1], [1, 0, 0], 0, 0, 0),  # two integrators: the closed loop rings for ever
        ([1, 1], [1, 0, 0], 0, 0, 0),
        ([-1], [1, 0, 0], 1, 0, 1),
        ([1], [1, 0, 4, 0], 2, 0, 2),  # poles on the axis, at 0 and at 2
    ],
)
def test_nyquist_counts(numerator: list[float], denominator: list[float], clockwise: int, right: int, closed: int) -> None:
    found = nyquist_count(as_loop(control.tf(numerator, denominator)))
    assert (found.clockwise, found.open_right, found.closed_right) == (clockwise, right, closed)
    roots = np.roots(np.polyadd(numerator, denominator))
    assert found.closed_right == (roots.real > 1e-9).sum()
    assert bool(found.through) == bool((np.abs(roots.real) < 1e-9).any())


@pytest.mark.parametrize("k", [1e-4, 1e-8, 1e-12, -1e-4, -1e-8, -1e-12])
def test_loop_that_hardly_moves_poles_off_the_axis_is_told(k: float) -> None:
    """k s / (s^2 + 1): the closed loop's poles lie at -k / 2 beside the open loop's on the axis."""
    found = gl.stability(control.tf([k, 0], [1, 0, 1]), (0, 0)).loop
    assert found is not None
    assert found.verdict == found.closed_poles.verdict == ("stable" if k > 0 else "unstable")
    assert found.nyquist.closed_right == (0 if k > 0 else 2)


def test_count_goes_round_repeated_poles_that_rounding_tears_apart() -> None:
    """1 / (s^2 + 1)^2: the closed loop has s^2 = -1 +- j, two of these four poles on the right."""
    report = gl.stability(control.tf([1], [1, 0, 2, 0, 1]), loop=(0, 0))
    assert (report.loop.nyquist.closed_right, report.loop.verdict) == (2, "unstable")


def test_margins_beside_poles_on_the_axis() -> None:
    """(s + 1) / (s (s^2 + 4)): |L| = 1 where x^3 - 8 x^2 + 15 x - 1 = 0 with x = omega^2; the axis is crossed at no frequency."""
    found = margins(as_loop(control.tf([1, 1], [1, 0, 4, 0])))
    expected = np.sqrt(np.sort(np.roots([1, -8, 15, -1]).real))
    assert [c.omega for c in found.gain_crossings] == pytest.approx(expected, rel=1e-12)
    assert found.gain_margin == np.inf


def test_all_pass_has_one_phase_margin() -> None:
    """(s - 2) / (s + 2): |L| is 1 everywhere, and rounding alone decided where it crossed 1."""
    found = margins(as_loop(control.tf([1, -2], [1, 2])))
    assert len(found.gain_crossings) == 1
    assert found.modulus_margin == pytest.approx(0.0, abs=1e-12)


def test_count_says_it_in_words() -> None:
    text = str(gl.stability(control.tf([10], [1, 2, 1, 0]), (0, 0)))
    assert "encircles -1 twice clockwise (N = 2)" in text
    assert "1 pole at 0" in text
    assert "the closed loop is unstable" in text


def test_report_is_readable(paper: gl.System, chain: Callable[..., gl.System]) -> None:
    """Stable, free turning, undamped, drifting and unstable, each in its own words."""
    assert str(gl.stability(paper)).splitlines() == [
        "ZhouCui2022: asymptotically stable: every motion dies away",
        "  the slowest motion falls to 1/e in 0.03112 s",
        "  the least damped vibration has 929.687 Hz and the damping ratio 0.0357",
        "  passive: the stored energy x'Qx/2 >= 0 falls by the losses x'Wx >= 0 alone (8 states, rank of Q 8,",
        "    of W 5)",
        "",
        "       real, 1/s     imag, rad/s   frequency, Hz    damping   e-fold time, s",
        "        -32.1307               0               -          -          0.03112",
        "        -393.955               0               -          -         0.002538",
        "        -565.793  +-     3439.03         554.697     0.1623         0.001767",
        "        -208.543  +-     5837.67         929.687     0.0357         0.004795",
        "        -658.344  +-     7691.04         1228.54     0.0853         0.001519",
    ]
    turning = str(gl.stability(chain(n=3), parameters={"d": 1.0})).splitlines()
    assert turning[1] == "  1 pole at 0: the train turns freely"
    assert turning[2] == "  the rest falls to 1/e in 2.5 s or less"
    assert "rings undamped at 1.49057, 2.54905 Hz" in str(gl.stability(chain(n=3), parameters={"d": 0.0}))
    angle = chain(n=3).linearize(["torque.tau"], ["body[2].phi"], parameters={"d": 1.0})
    assert "in chains: with a speed that stays, an angle grows" in " ".join(str(gl.stability(angle)).split())
    loop = (
        str(gl.stability(chain(n=3), ("torque.tau", "body[2].w"), parameters={"d": 1.0}, gain=50)).split("\n\n")[2].splitlines()
    )
    assert loop[0] == "Loop torque.tau -> body[2].w, negative feedback: unstable: a motion grows exponentially"
    assert loop[1] == "  Nyquist          Over all frequencies the curve encircles -1 twice clockwise (N = 2)."
    said = " ".join(" ".join(loop).split())
    assert "eigenvalues the same: a vibration at 1.71426 Hz grows e-fold in 0.1951 s; the rest falls to" in said
    assert "  gain             stable for less than 0.0412029 (-27.701 dB) times the present gain" in loop


@pytest.mark.parametrize(
    ("numerator", "denominator", "expected"),
    [
        ([1], [1, 2, 1, 0], [(0, 2)]),  # k / (s (s + 1)^2)
        ([1], [1, 1], [(0, np.inf)]),
        ([2], [1, -1], [(0.5, np.inf)]),  # k 2 / (s - 1)
        ([4, 4], [1, 2, -3, 0], [(1.5, np.inf)]),  # Routh: 2 (4 k - 3) > 4 k
        ([-1], [1, 0, 0], []),
        # k (s + 1)^2 / s^3: s^3 + k s^2 + 2 k s + k needs 2 k^2 > k
        ([1, 2, 1], [1, 0, 0, 0], [(0.5, np.inf)]),
    ],
)
def test_ranges_of_stable_gains(numerator: list[float], denominator: list[float], expected: list[tuple[float, float]]) -> None:
    report = gl.stability(control.tf(numerator, denominator), (0, 0)).loop
    assert report is not None
    assert len(report.stable_gains) == len(expected)
    for found, wanted in zip(report.stable_gains, expected, strict=True):
        assert found == pytest.approx(wanted, rel=1e-9)


def test_conditionally_stable_loop_has_an_interval_of_gains() -> None:
    """k (s + 1)^2 / (s^3 (1 + s/50)^2), against the roots of its characteristic polynomial over k."""
    numerator, denominator = np.array([1.0, 2, 1]), np.polymul([1, 0, 0, 0], np.polymul([0.02, 1], [0.02, 1]))
    report = gl.stability(control.tf(numerator, denominator), (0, 0)).loop
    assert report is not None
    ((low, high),) = report.stable_gains
    for k, stable in ((0.999 * low, False), (1.001 * low, True), (0.999 * high, True), (1.001 * high, False)):
        assert (np.roots(np.polyadd(denominator, k * numerator)).real.max() < 0) == stable
    assert "times the present gain" in str(report)


def _eigenvalue_verdict(A: Any, loop_poles_only: float = 1e-9) -> str:
    values = np.linalg.eigvals(A)
    return "unstable" if values.real.max() > loop_poles_only * max(1.0, np.abs(values).max()) else "bounded"


@pytest.mark.parametrize("grounded", [False, True])
@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
def test_verdict_is_that_of_the_eigenvalues_on_random_trains(chain: Callable[..., gl.System], n: int, grounded: bool) -> None:
    """Twenty trains each: random numbers, sensors and gains; free ones turn, and some have no damping."""
    system = chain(n=n, grounded=grounded)
    rng = np.random.default_rng(100 * n + grounded)
    seen = set()
    for trial in range(20):  # a thousand trains of many kinds are in test_random_verdicts.py
        values = {"J": 10 ** rng.uniform(-2, 1), "c": 10 ** rng.uniform(1, 5), "d": 10 ** rng.uniform(-2, 1) * (trial % 4 > 0)}
        sensor = rng.choice(
            [f"body[{rng.integers(n)}].w", f"shaft[{rng.integers(n - 1)}].phi_rel", f"shaft[{rng.integers(n - 1)}].tau"]
        )
        model = system.linearize(["torque.tau"], [str(sensor)], parameters=values)
        gain = float(rng.choice([-1, 1, 1]) * 10 ** rng.uniform(-3, 3))
        report = gl.stability(model, ("torque.tau", str(sensor)), gain=gain)
        assert report.loop is not None
        closed = model.A - gain * model.B @ model.C / (1 + gain * model.D[0, 0])
        verdict = report.loop.verdict
        seen.add(verdict)
        assert verdict == report.loop.closed_poles.verdict
        assert (verdict == "unstable") == (_eigenvalue_verdict(closed) == "unstable"), np.linalg.eigvals(closed)
    assert {"stable", "unstable"} <= seen or not grounded


def test_verdict_is_that_of_the_eigenvalues_on_random_matrices() -> None:
    rng = np.random.default_rng(0)
    count = {"stable": 0, "unstable": 0}
    for trial in range(300):
        n = int(rng.integers(1, 9))
        A = rng.normal(size=(n, n)) - rng.uniform(0, 2) * np.eye(n)
        if trial % 3 == 0:
            A[:, 0] = 0.0
        if trial % 5 == 0:
            A = A - A.T
        b, c, d = rng.normal(size=n), rng.normal(size=n), float(rng.normal()) * (trial % 4 == 0)
        found = gl.stability(control.ss(A, b[:, None], c[None], [[d]]), (0, 0)).loop
        assert found is not None
        closed = np.linalg.eigvals(A - np.outer(b, c) / (1 + d))
        assert found.nyquist.closed_right == (closed.real > 1e-9).sum()
        count[found.verdict] += 1
    assert min(count.values()) > 50


def test_what_grows_is_said_whether_it_vibrates_or_not() -> None:
    """Each pair of poles once, also where it is slow."""
    A = np.zeros((4, 4))
    A[0, 0], A[1, 1], A[2:, 2:] = 0.5, -2.0, [[0.1, 0.6], [-0.6, 0.1]]
    lines = str(gl.stability(control.ss(A, np.ones((4, 1)), np.ones((1, 4)), 0))).split("\n\n")[0].splitlines()
    assert sorted(lines[1:-1]) == [
        "  a motion without vibration grows e-fold in 2 s",
        "  a vibration at 0.095493 Hz grows e-fold in 10 s",
    ]


def permuted_and_scaled(rng: np.random.Generator) -> Any:
    """A sparse matrix over eight decades, whose balancing needs a permutation and scales, too."""
    n = int(rng.integers(3, 8))
    pattern = rng.random((n, n)) < 0.35
    return rng.normal(size=(n, n)) * pattern * 10 ** rng.uniform(-4, 4, (n, n))


def test_responses_and_shapes_survive_balancing() -> None:
    """Responses err by what a backward error of rounding in the balanced matrix may do to them.

    An orthogonal reduction is exact for a matrix that is off by some ``n eps`` of its norm. That changes ``c R b`` by
    ``c R E R b`` with the resolvent ``R``, all in the balanced coordinates; small responses between states of very different size
    are known no better than that.
    """
    from scipy.linalg import matrix_balance

    from gearlib.vibration.spectrum import dense_spectrum

    rng = np.random.default_rng(2)
    rings = 0
    for _ in range(200):
        A = permuted_and_scaled(rng)
        n = len(A)
        b, c, s = rng.normal(size=n), rng.normal(size=n), 3j * (np.abs(A).max() + 1)
        model = control.ss(A, b[:, None], c[None], 0)
        resolvent = np.linalg.inv(s * np.eye(n) - A)
        expected = c @ resolvent @ b
        balanced, turn = matrix_balance(A, separate=False)
        seen, reached = c @ resolvent @ turn, np.linalg.solve(turn, resolvent @ b)
        known = n * np.finfo(float).eps * (np.linalg.norm(balanced) + abs(s)) * np.linalg.norm(seen) * np.linalg.norm(reached)
        assert abs(complex(as_loop(model).response(s)) - expected) < 20 * known
        assert abs(gl.frequency_response(model, [s.imag]).values[0, 0, 0] - expected) < 20 * known
        found = dense_spectrum(A, np.eye(n), None)
        for value, shape in zip(found.values, found.vectors.T, strict=True):
            rings += 1
            terms = np.abs(A) @ np.abs(shape) + abs(value) * np.abs(shape)
            assert (np.abs(A @ shape - value * shape) <= 1e-7 * terms.max()).all()
    assert rings > 50


def test_stiff_train_keeps_its_margins(paper: gl.System) -> None:
    """The paper's train has poles from 32 to 7700 rad/s; the crossing solves Im L = 0 by the printed equations, too."""
    from gearparts.trains import zhou_cui_2022 as zc

    report = gl.stability(paper, ("tau_in", "w_out"))
    assert report.verdict == "stable"
    assert report.loop is not None
    crossing = report.loop.margins.phase_crossings[0]
    params = zc.bond_parameters()
    A, B = zc.explicit_matrices(params)
    row = -np.eye(8)[7] / params.I[78]
    value = row @ np.linalg.solve(1j * crossing.omega * np.eye(8) - A, B[:, 0])
    assert value.imag == pytest.approx(0, abs=1e-10 * abs(value))
    assert -1 / value.real == pytest.approx(crossing.gain_margin, rel=1e-9)
    assert crossing.gain_margin_db == pytest.approx(44.728, abs=1e-3)


def test_loop_that_sees_no_free_turning_is_marginal(chain: Callable[..., gl.System]) -> None:
    report = gl.stability(chain(n=2), ("torque.tau", "shaft[0].tau"), parameters={"d": 1.0})
    assert report.loop is None or "pole" in str(report)
    both = chain(n=2).linearize(["torque.tau"], ["shaft[0].tau", "body[1].w"], parameters={"d": 1.0})
    seen = gl.stability(both, ("torque.tau", "shaft[0].tau")).loop
    assert seen is not None
    assert seen.verdict == seen.closed_poles.verdict == "marginal"
    assert seen.nyquist.through == (0.0,)


def test_undamped_collocated_curve_lies_on_the_axis(chain: Callable[..., gl.System]) -> None:
    loop = as_loop(chain(n=3).linearize(["torque.tau"], ["shaft[0].tau"]))
    assert margins(loop).real
    assert "nothing is damped" in str(gl.stability(chain(n=3), ("torque.tau", "shaft[0].tau")))


def test_wrong_arguments_are_named(paper: gl.System) -> None:
    with pytest.raises(gl.GearlibError, match=r"no input 'tau_inn'; did you mean 'tau_in'"):
        gl.stability(paper, ("tau_inn", "w_out"))
    with pytest.raises(gl.GearlibError, match=r"expected \(input, output\)"):
        gl.stability(paper, "w_out")
    with pytest.raises(gl.GearlibError, match="belong to a System"):
        gl.stability(control.tf([1], [1, 1]), (0, 0), parameters={"a": 1.0})
    with pytest.raises(gl.GearlibError, match="cannot be closed"):
        str(gl.stability(control.ss([[-1.0]], [[1.0]], [[1.0]], [[-1.0]]), (0, 0)))
    with pytest.raises(gl.GearlibError, match="sampled"):
        gl.stability(control.tf([1], [1, 0.5], True), (0, 0))
    with pytest.raises(gl.GearlibError, match="choose a loop"):
        as_loop(control.ss([[-1.0]], [[1.0, 2.0]], [[1.0]], [[0.0, 0.0]]))


def test_a_gain_without_a_loop_is_refused() -> None:
    """The poles would be those of the open loop."""
    with pytest.raises(ArgumentError, match=r"^gain is 50\.0, but no loop is closed; choose one, loop=\(input, output\)$"):
        gl.stability(control.tf([1], [1, 2, 1, 0]), gain=50.0)
