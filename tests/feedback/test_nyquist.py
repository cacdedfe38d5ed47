"""The contour of the Nyquist criterion, and its count in words."""

from __future__ import annotations

import control
import numpy as np
import pytest

from gearlib.errors import SolverError
from gearlib.feedback import nyquist as parts
from gearlib.feedback.feedback_loop import Loop, as_loop
from gearlib.feedback.nyquist import NyquistCount, contour, nyquist_count
from gearlib.linear.poles import Poles, poles


@pytest.mark.parametrize(
    ("count", "verdict", "said"),
    [
        (
            NyquistCount(0, 0, ()), "stable",
            "does not encircle -1 (N = 0). The open loop has no pole in the right half-plane (P = 0), so the closed loop has no pole "
            "there (Z = N + P = 0): the closed loop is stable.",
        ),
        (
            NyquistCount(-1, 1, ()), "stable",
            "encircles -1 once counter-clockwise (N = -1). The open loop has one pole in the right half-plane (P = 1), so the closed "
            "loop has no pole there (Z = N + P = 0): the closed loop is stable.",
        ),
        (
            NyquistCount(1, 0, ()), "unstable",
            "encircles -1 once clockwise (N = 1). The open loop has no pole in the right half-plane (P = 0), so the closed loop has "
            "one pole there (Z = N + P = 1): the closed loop is unstable.",
        ),
        (
            NyquistCount(3, 2, (1.5,)), "unstable",
            "encircles -1 3 times clockwise (N = 3). The open loop has 2 poles in the right half-plane (P = 2), so the closed loop "
            "has 5 poles there (Z = N + P = 5) and poles on the imaginary axis at 1.5 rad/s: the closed loop is unstable.",
        ),
        (
            NyquistCount(-2, 2, (0.0, 12.3456789), False), "marginal",
            "encircles -1 twice counter-clockwise (N = -2). The open loop has 2 poles in the right half-plane (P = 2), so the closed "
            "loop has no pole there (Z = N + P = 0) and poles on the imaginary axis at 0, 12.3457 rad/s: the closed loop is marginal.",
        ),
        (
            NyquistCount(0, 0, (2.0,), True), "drifting",
            "does not encircle -1 (N = 0). The open loop has no pole in the right half-plane (P = 0), so the closed loop has no pole "
            "there (Z = N + P = 0) and poles on the imaginary axis at 2 rad/s: the closed loop is drifting.",
        ),
    ],
)  # fmt: skip
def test_a_count_in_words(count: NyquistCount, verdict: str, said: str) -> None:
    assert count.verdict == verdict
    assert str(count) == f"Over all frequencies the curve {said}"


LOOPS = {
    "no pole on the axis": ([1.0], [1, 3, 3, 1]),
    "one at zero": ([1.0], [1, 2, 1, 0]),
    "three at zero": ([1.0, 2, 1], [1, 0, 0, 0]),
    "at zero and at two": ([1.0], [1, 0, 4, 0]),
    "of the closed loop only": ([1.0], [1, 0, 0.5]),
    "close to each other": ([1.0], np.polymul([1, 0, 4], [1, 0, 4.0001])),
    "four places": ([1.0], np.polymul([1, 0, 0], np.polymul([1, 0, 1], np.polymul([1, 0, 4], [1, 0, 9])))),
    "a pair twice": ([1.0, 0, 0], np.polymul([1, 0, 1], np.polymul([1, 0, 4], [1, 0, 4]))),
    "beside the axis": ([1.0, 1.0], [1, 1e-6, 9]),
}


@pytest.mark.parametrize("name", LOOPS)
def test_a_contour_leads_up_the_axis_and_back_through_infinity_with_all_poles_on_the_axis_on_its_left(name: str) -> None:
    """In one piece, from the real axis to the real axis; no pole lies inside that is not right of the imaginary axis."""
    loop = as_loop(control.tf(*LOOPS[name]))
    points = np.concatenate(contour(loop))
    assert np.abs(points[0].imag) < 1e-12
    assert points[0].real < 0.3 * loop.scale[0]
    assert np.abs(points[-1].imag) < 1e-9 * np.abs(points[-1])
    assert points[-1].real == pytest.approx(1e3 * loop.scale[1])
    assert (points.real >= -1e-9 * np.abs(points)).all()
    critical = loop.critical
    steps = np.abs(np.diff(points))
    distance = np.abs((points[1:] + points[:-1])[:, None] / 2 - critical[None, :])
    assert (steps[:, None] / distance).sum(axis=1).max() < 0.75  # too short to turn 1 + L by a quarter of a turn, and no gaps
    whole = np.concatenate([points, points[::-1].conj()])
    for pole in critical:
        turns = np.angle((whole - pole) / (np.roll(whole, 1) - pole)).sum() / (2 * np.pi)
        assert round(turns) == -int(pole.real > 1e-12 * abs(pole)), pole


@pytest.mark.parametrize("name", LOOPS)
def test_a_count_is_that_of_the_roots(name: str) -> None:
    numerator, denominator = LOOPS[name]
    found = nyquist_count(as_loop(control.tf(numerator, denominator)))
    roots = np.roots(np.polyadd(numerator, denominator))
    assert found.closed_right == (roots.real > 1e-7).sum()
    assert found.open_right == 0
    assert bool(found.through) == bool((np.abs(roots.real) < 1e-7).any())


@pytest.mark.parametrize(
    ("low", "up", "critical", "gap"),
    [
        (0.0, 0.0, [0, -2], 2.0),  # as far as the next pole
        (0.0, 0.0, [0], 1.0),  # alone
        (0.3, 0.3, [0.3j, -0.3j], 0.3),  # not beyond the real axis
        (3.0, 3.0, [3j, -3j, -8], 3.0),
        (3.0, 3.0, [3j, -3j, -0.5 + 3j], 0.5),  # at the same height, but not on the axis
        (2.0, 2.2, [2j, -2j, 2.2j, -2.2j, -0.3 + 2.5j], 0.5),
        (2.0, 2.2, [2j, -2j, 2.2j, -2.2j, 2.3j, -2.3j], 0.2),
        (2.0, 2.2, [2j, -2j, 2.2j, -2.2j, 1.8j, -1.8j], 0.3),
        (0.0, 0.8, [0, 0.8j, -0.8j, -0.3], 0.5),  # around zero it may pass the real axis
    ],
)
def test_a_detour_encloses_its_poles_and_a_quarter_of_the_way_to_the_next(
    low: float, up: float, critical: list[complex], gap: float
) -> None:
    half = (up - low) / 2
    assert parts.detour_radius(low, up, np.array(critical, complex)) == pytest.approx(half + (gap - half) / 4, rel=1e-12)


def test_poles_that_rounding_cannot_separate_share_a_detour() -> None:
    """Relative to their frequency, or to the smallest pole beside zero; intervals that overlap are one."""
    assert parts.together([], 1.0) == []
    assert parts.together([(2.0, 2.0), (0.0, 0.0), (2.0 + 1.9e-9, 2.5)], 1.0) == [(0.0, 0.0), (2.0, 2.5)]
    assert len(parts.together([(2.0, 2.0), (2.0 + 2.1e-9, 2.5)], 1.0)) == 2
    assert parts.together([(0.0, 0.0), (1e-9, 2e-9)], 1.0) == [(0.0, 2e-9)]
    assert parts.together([(0.0, 0.0), (1e-9, 2e-9)], 0.5) == [(0.0, 0.0), (1e-9, 2e-9)]
    assert parts.together([(1.5, 2.0), (1.0, 3.0), (2.5, 4.0)], 1.0) == [(1.0, 4.0)]


def test_poles_on_the_axis_lie_somewhere_within_their_rounding() -> None:
    """Upwards from zero: those below are mirror images."""
    values = np.array([0.0, 0.1j, -0.1j, -1.0, 2j, -2j, -0.5 + 3j, -0.5 - 3j])
    found = parts.on_axis(Poles(values, np.array([0.2, 0.5, 0.5, 0.3, 0.1, 0.1, 0.1, 0.1]), (1,)))
    assert found == [(0.0, 0.2), (0.0, 0.6), (pytest.approx(1.9), pytest.approx(2.1))]


def test_turns_that_are_no_whole_number_are_refused() -> None:
    """The root of ``1 + L`` turns half as far: a curve that comes too close to -1 looks like that."""
    loop = as_loop(control.tf(*LOOPS["no pole on the axis"]))
    unstable = as_loop(control.tf([20.0], [1, 3, 3, 1]))
    assert nyquist_count(unstable).clockwise == 2

    class Half(type(unstable)):  # type: ignore[misc]
        def response(self, s: np.ndarray) -> np.ndarray:
            f = 1 + super().response(s)
            return np.abs(f) ** 0.25 * np.exp(0.25j * np.unwrap(np.angle(f))) - 1

    for whole, count in ((loop, "0"), (unstable, "0.500")):
        half = Half(
            **{name: getattr(whole, name) for name in whole.__dataclass_fields__ if whole.__dataclass_fields__[name].init}
        )
        if count == "0":
            assert nyquist_count(half).clockwise == 0
        else:
            with pytest.raises(
                SolverError, match=rf"^the curve of .* passes -1 closer than rounding can tell \(count {count}\)$"
            ):
                nyquist_count(half)


def test_a_count_that_is_not_that_of_the_eigenvalues_is_refused() -> None:
    """A pole beside the axis that rounding in the response puts on its other side: here, poles that are said to be elsewhere."""

    class Other(Loop):
        @property
        def closed_poles(self) -> Poles:
            return poles(np.diag([-1.0, -1.0, 2.0]))

    stable = as_loop(control.tf([1.0], [1, 3, 3, 1]))
    other = Other(stable.A, stable.b, stable.c, stable.d, "u", "y")
    said = r"^the curve of u -> y gives no pole of the closed loop in the right half-plane, the eigenvalues one pole: some lie closer"
    with pytest.raises(SolverError, match=said):
        nyquist_count(other)
