"""Poles in words and in a table, of poles that are written down."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.linalg import block_diag

import gearlib as gl
from gearlib.feedback.stability import motions, pole_table
from gearlib.linear.poles import Poles, poles

TURN = 2 * np.pi


def of(*values: complex) -> Poles:
    """Poles of a matrix of blocks: complex ones stand for a pair."""
    blocks = [[[v.real, v.imag], [-v.imag, v.real]] if v.imag else [[v.real]] for v in map(complex, values)]
    return poles(block_diag(*blocks))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([-2.0], ["the slowest motion falls to 1/e in 0.5 s"]),
        ([-2.0, -0.25], ["the slowest motion falls to 1/e in 4 s"]),
        (
            [-2.0, -0.3 + 0.4j * TURN],
            [
                "the slowest motion falls to 1/e in 3.333 s",
                f"the least damped vibration has {abs(-0.3 + 0.4j * TURN) / TURN:.6g} Hz and the damping ratio "
                f"{0.3 / abs(-0.3 + 0.4j * TURN):.4g}",
            ],
        ),
        ([0.0, -2.0], [
            "1 pole at 0: the train turns freely, or a loop of meshes keeps a preload", "the rest falls to 1/e in 0.5 s or less",
        ]),
        ([0.0, 0.0], ["2 poles at 0: the train turns freely, or a loop of meshes keeps a preload"]),
        ([0.5, 0.1 + 2j * TURN], [
            "a motion without vibration grows e-fold in 2 s", "a vibration at 2 Hz grows e-fold in 10 s",
        ]),
        ([2j * TURN, 3j * TURN], ["rings undamped at 2, 3 Hz"]),
        ([1j * k * TURN for k in range(1, 5)], ["rings undamped at 1, 2, 3, 4 Hz"]),
        ([1j * k * TURN for k in range(1, 7)], ["rings undamped at 1, 2, 3, 4 and 2 more Hz"]),
        ([float(k) for k in range(1, 7)], [f"a motion without vibration grows e-fold in {1 / k:.4g} s" for k in range(1, 5)]),
    ],
)  # fmt: skip
def test_motions_in_words(values: list[complex], said: list[str]) -> None:
    """Growth first, four of each at most; what does not vibrate has no frequency."""
    assert sorted(motions(of(*values))) == sorted(said)


def test_the_least_damped_vibration_is_that_of_the_smallest_ratio_not_of_the_slowest_decay() -> None:
    found = motions(of(-0.1 + 0.3j, -1.0 + 50j, -0.2))
    assert found[0] == "the slowest motion falls to 1/e in 10 s"
    assert found[1] == f"the least damped vibration has {np.hypot(1, 50) / TURN:.6g} Hz and the damping ratio 0.02"


def test_what_is_known_of_the_poles_at_zero_is_said() -> None:
    assert motions(of(0.0), "nothing depends on a.phi") == ["1 pole at 0: nothing depends on a.phi"]
    drifting = poles(np.array([[0.0, 1.0], [0.0, 0.0]]))
    (said,) = motions(drifting, "it turns")
    assert said == "2 poles at 0: it turns, in chains: with a speed that stays, an angle grows"
    pair = np.array([[0, 2.0], [-2.0, 0]])
    (rings,) = motions(poles(np.block([[pair, np.eye(2)], [np.zeros((2, 2)), pair]])))
    assert rings.startswith("rings undamped at 0.31831")
    assert rings.endswith(" Hz, growing with time")


def test_a_table_has_a_line_for_each_pole_or_pair() -> None:
    """Frequency and damping of what vibrates, the time of what decays or grows; a dash where there is none."""
    lines = pole_table(of(-0.5, 0.25, 3j, -3.0 + 4.0j, 0.0))
    assert {len(line) for line in lines if not line.endswith("(grows)")} == {len(lines[0])}
    rows = sorted(" ".join(line.split()) for line in lines[1:])
    assert rows == sorted([
        "-0.5 0 - - 2", "0.25 0 - - 4 (grows)", "0 0 - - -", f"0 +- 3 {3 / TURN:.6g} 0.0000 -",
        f"-3 +- 4 {5 / TURN:.6g} 0.6000 0.3333",
    ])  # fmt: skip
    many = pole_table(of(*(-1.0 * k for k in range(1, 27))))
    assert len(many) == 1 + 24 + 1
    assert many[-1] == "  ... and 2 more"
    assert len(pole_table(of(*(-1.0 * k for k in range(1, 25))))) == 1 + 24
    assert pole_table(of(-1.0, -2.0, -3.0), most=2)[-1] == "  ... and 1 more"


def test_a_report_of_a_loop_without_crossings() -> None:
    """Of a lag that stays below 1: no margin is a number but the distance from -1."""
    text = str(gl.stability(control.tf([0.5], [1, 1]), (0, 0)).loop)
    assert "  gain             stable for every positive gain" in text
    assert "  gain margin      infinite: the curve does not cross the negative real axis" in text
    assert "  phase margin     infinite: |L| is nowhere 1" in text
    assert "  modulus margin   1, the smallest distance from -1, at infinite frequency" in text
    both = str(gl.stability(control.tf([3.0], [1, 2, 1, 0]), (0, 0)).loop).splitlines()
    assert "  gain margin      0.666667 (-3.522 dB) at 1 rad/s (0.159155 Hz)" in both
    (phase,) = [line for line in both if line.startswith("  phase margin")]
    assert phase.startswith("  phase margin     -11.0146 deg, delay margin ")
    assert not any("infinite" in line for line in both)


def test_a_notebook_shows_the_words_and_a_table_of_the_poles() -> None:
    report = gl.stability(control.tf([3.0], [1, 3.0, 25.0]))
    html = report._repr_html_()
    assert "<table" in html
    assert f"{5 / TURN:.3g}"[:4] in html
    assert "the least damped vibration" in html
    assert "Loop" not in html
    assert "Nyquist" in gl.stability(control.tf([3.0], [1, 3.0, 25.0]), (0, 0))._repr_html_()


def test_a_report_that_is_not_of_a_system_has_no_sensitivity() -> None:
    with pytest.raises(gl.GearlibError, match="the report is not that of a System"):
        gl.stability(control.tf([1.0], [1, 1])).sensitivity("shaft.d")
    report = gl.stability(control.tf([1.0], [1, 1]))
    assert (report.passivity, report.conditions, report.at_zero) == (None, (), "")
    assert report.damping.tolist() == [1.0]
