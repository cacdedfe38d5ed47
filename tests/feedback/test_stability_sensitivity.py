"""How the closed loop's matrix moves with a parameter, against differences, also with a feedthrough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearlib.feedback import stability_sensitivity as parts
from gearlib.feedback.feedback_loop import Loop
from gearlib.feedback.margins import Margins, PhaseCrossing, margins
from gearlib.feedback.stability_sensitivity import closed_loop, closed_loop_change
from gearlib.linear.linear_model import Matrices


@pytest.mark.parametrize("feedthrough", [0.0, 0.7, -3.0])
def test_the_closed_loop_moves_as_differences_say(feedthrough: float) -> None:
    rng = np.random.default_rng(2)
    shapes = (4, 4), (4, 1), (1, 4), (1, 1)
    here = [*(rng.normal(size=shape) for shape in shapes[:3]), np.array([[feedthrough]])]
    change = [rng.normal(size=shape) for shape in shapes]
    h = 1e-5
    low, high = (closed_loop(Matrices(*(m + side * dm for m, dm in zip(here, change, strict=True)))) for side in (-h, h))
    assert closed_loop_change(Matrices(*here), Matrices(*change)) == pytest.approx((high - low) / (2 * h), rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("d", [-3.0, -1.0, -0.2, 0.5])
def test_how_margins_at_infinite_frequency_move_with_the_feedthrough(d: float) -> None:
    """The gain margin is -1 / d; the distance from the point is the size of 1 + d, which has no derivative at -1."""
    given = np.array([[-1.0]]), np.array([[1.0]]), np.array([[0.5]]), np.array([[d]])
    loop = Loop(given[0], given[1][:, 0], given[2][0], d, "u", "y")
    zero = np.zeros((1, 1))
    change = Matrices(zero, zero, zero, np.array([[2.0]]))
    own = Margins((PhaseCrossing(np.inf, -1 / d),) if d < 0 else (), (), abs(1 + d), np.inf, False)
    gain, phase, delay, modulus = parts.margin_changes(Matrices(*given), change, loop, own)
    assert gain == pytest.approx(2.0 / d**2 if d < 0 else np.nan, nan_ok=True)
    assert np.isnan([phase, delay]).all()
    assert modulus == pytest.approx(2.0 * np.sign(1 + d) if d != -1 else np.nan, nan_ok=True)


@pytest.mark.parametrize(("p", "k"), [(1.0, 20.0), (0.5, 3.0), (3.0, 100.0)])
def test_how_margins_of_three_lags_move_with_their_pole(p: float, k: float) -> None:
    """Of ``k / (s + p)^3``: the gain margin is 8 p^3 / k, at a frequency that moves as well."""

    def of(p: float) -> tuple[float, float, float]:
        w = np.sqrt(k ** (2 / 3) - p**2)
        phase = np.pi - 3 * np.arctan(w / p)
        return 8 * p**3 / k, np.degrees(phase), (phase % (2 * np.pi)) / w

    A = np.diag([-p] * 3) + np.diag([1.0, 1.0], 1)
    b, c = np.array([[0.0], [0.0], [1.0]]), np.array([[k, 0.0, 0.0]])
    loop = Loop(A, b[:, 0], c[0], 0.0, "u", "y")
    zero = np.zeros((1, 1))
    change = Matrices(-np.eye(3), 0 * b, 0 * c, zero)
    own = margins(loop)
    assert (own.gain_margin, own.phase_margin, own.delay_margin) == pytest.approx(of(p))
    h = 1e-6
    expected = (np.array(of(p + h)) - of(p - h)) / (2 * h)
    assert parts.margin_changes(Matrices(A, b, c, zero), change, loop, own)[:3] == pytest.approx(expected, rel=1e-6)


def test_how_the_distance_moves_where_the_curve_passes_near_the_point() -> None:
    """``k s / (s^2 + 2 z s + 1 + p)`` passes -1 at 0.01 of it, and the frequency that the parameter shifts moves the curve along itself.

    The nearest point is known to half of the digits; that must not show in the slope, although the response there moves by a
    hundred times more than the distance.
    """
    z, k, h = 0.01, -0.02 * 0.99, 1e-6

    def of(p: float) -> tuple[Loop, Matrices]:
        A = np.array([[0.0, 1.0], [-1.0 - p, -2 * z]])
        b, c = np.array([[0.0], [1.0]]), np.array([[0.0, k]])
        zero = np.zeros((1, 1))
        return Loop(A, b[:, 0], c[0], 0.0, "u", "y"), Matrices(A, b, c, zero)

    def distance(p: float) -> float:
        w = np.sqrt(1 + p) + np.linspace(-1e-3, 1e-3, 200_001)
        return float(np.abs(1 + k * 1j * w / (1 + p - w**2 + 2j * z * w)).min())

    (loop, here), (_, low), (_, high) = of(0.3), of(0.3 - h), of(0.3 + h)
    change = Matrices(*((b - a) / (2 * h) for a, b in zip(vars(low).values(), vars(high).values(), strict=True)))
    own = margins(loop)
    assert own.modulus_margin == pytest.approx(distance(0.3), rel=1e-6)
    expected = (distance(0.3 + 1e-2) - distance(0.3 - 1e-2)) / 2e-2
    for off in (-1e-7, 0.0, 1e-7):
        found = parts.margin_changes(here, change, loop, replace(own, modulus_omega=own.modulus_omega * (1 + off)))[3]
        assert found == pytest.approx(expected, abs=1e-7)
