"""What a branch of periodic motions says of itself: against Fourier series that are written down."""

from __future__ import annotations

import re
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError

OMEGA = np.array([2.0, 3.0, 4.0, 3.5, 3.6])
SERIES = np.zeros((5, 5, 2))  # points, mean and two harmonics, outputs
SERIES[:, :, 0] = np.outer([1.0, 2.0, 3.0, 4.0, 5.0], [10.0, 3.0, 4.0, 0.0, -2.0])
SERIES[:, :, 1] = [7.0, -1.0, 0.0, 0.5, 0.5]
MULTIPLIERS = np.array([[0.5, -0.9j], [0.99, 0.1], [1.0, 0.2], [0.3, -1.1], [0.9, 0.9j]])


def response(**changes: Any) -> gl.HarmonicBalance:
    given: dict[str, Any] = {
        "omega": OMEGA, "coefficients": SERIES, "multipliers": MULTIPLIERS, "folds": (2, 3), "outputs": ("mesh.q", "w"),
        "units": ("m", "rad/s"), "complete": True, "error": np.array([1e-3, 2e-3, 0.0042, 1e-3, 0.0]),
    }  # fmt: skip
    return gl.HarmonicBalance(**(given | changes))


def test_amplitudes_and_phases_are_those_of_the_waveform() -> None:
    """Of each harmonic, from the waveform's Fourier transform; the root mean square is that of what is left without the mean."""
    found = response()
    assert (len(found), found.harmonics) == (5, 2)
    assert found.frequencies == pytest.approx(OMEGA / (2 * np.pi))
    assert found.fold_omega.tolist() == [4.0, 3.5]
    for k in range(-5, 5):
        for output in ("mesh.q", "w"):
            time, wave = found.waveform(output, k, 16)
            assert time == pytest.approx(np.arange(16) / 16 * 2 * np.pi / OMEGA[k])
            lines = np.fft.rfft(wave) / 16
            assert found.mean(output)[k] == pytest.approx(lines[0].real)
            assert found.rms(output)[k] == pytest.approx(np.std(wave))
            for harmonic in (1, 2):
                assert found.amplitude(output, harmonic)[k] == pytest.approx(2 * abs(lines[harmonic]))
                turned = found.phase(output, harmonic)[k] - np.angle(lines[harmonic])
                assert np.exp(1j * turned) == pytest.approx(1.0 if abs(lines[harmonic]) > 1e-12 else np.exp(1j * turned))
    assert found.phase("mesh.q", 1)[0] == pytest.approx(-np.arctan2(4.0, 3.0))
    assert found.amplitude("mesh.q")[1] == pytest.approx(10.0)
    assert len(found.waveform("w", 0)[0]) == 256
    assert found.waveform("w", 0, 1)[1].tolist() == [7.0 - 1.0 + 0.5]


def test_a_motion_is_stable_while_all_multipliers_are_inside_the_unit_circle() -> None:
    assert response().stable.tolist() == [True, True, False, False, True]
    rigid = response(multipliers=np.empty((5, 0)))
    assert rigid.stable.all()


@pytest.mark.parametrize(("size", "stable"), [(1 - 2e-15, True), (1 - 1e-15, False), (1.0, False), (1 + 2e-15, False)])
def test_a_multiplier_on_the_unit_circle_but_for_rounding_is_not_inside(size: float, stable: bool) -> None:
    """As those of trains without damping, whose motions are neither stable nor unstable."""
    found = response(multipliers=np.tile([0.5, 0.6 * size + 0.8j * size, np.nan], (5, 1)))
    sizes = np.abs(found.multipliers[:, 1])
    assert found.stable.tolist() == (sizes < 1 - 1e-15).tolist()
    found = response(multipliers=np.full((5, 1), -size, complex))
    assert found.stable.tolist() == [stable] * 5
    ax = found.plot(ax=plt.figure().add_subplot())
    labels = {t.get_text() for t in ax.get_legend().get_texts()} - {"fold"}
    assert labels == {"stable" if stable else "unstable" if size > 1 else "marginal"}
    plt.close("all")


@pytest.mark.parametrize("wrong", [0, 3, 1.5, "1"])
def test_harmonics_count_from_one(wrong: Any) -> None:
    with pytest.raises(ArgumentError, match=rf"harmonic is {wrong!r}; expected a whole number from 1 to 2$"):
        response().amplitude("w", wrong)


@pytest.mark.parametrize("wrong", [5, -6, 0.5])
def test_points_count_from_either_end(wrong: Any) -> None:
    with pytest.raises(ArgumentError, match=rf"point is {wrong!r}; expected the number of a point, 0 to 4$"):
        response().waveform("w", wrong)
    with pytest.raises(ArgumentError, match="samples is 0"):
        response().waveform("w", 0, 0)


def test_a_branch_says_what_it_is() -> None:
    assert repr(response()) == (
        "<HarmonicBalance of mesh.q, w: 5 points, 2 .. 4 rad/s, 2 harmonics, waveform within 0.004, folds at 4, 3.5 rad/s>"
    )
    one = response(coefficients=SERIES[:, :3], folds=(), complete=False)
    assert repr(one).endswith("2 .. 4 rad/s, 1 harmonic, waveform within 0.004, no folds, incomplete>")
    none = response(omega=np.empty(0), coefficients=SERIES[:0], multipliers=MULTIPLIERS[:0], folds=(), error=np.empty(0))
    assert repr(none) == "<HarmonicBalance of mesh.q, w: no points, 2 harmonics, no folds>"


def test_a_table_has_a_row_for_each_point() -> None:
    table = response().to_dataframe()
    assert list(table) == [
        "omega", "stable", "error", *(f"{o}, {what}" for o in ("mesh.q", "w") for what in ("mean", "harmonic 1", "harmonic 2")),
    ]  # fmt: skip
    assert table["mesh.q, harmonic 1"].tolist() == response().amplitude("mesh.q").tolist()
    assert table["w, harmonic 2"].tolist() == response().amplitude("w", 2).tolist()
    assert table["w, mean"].tolist() == [7.0] * 5


def test_stable_and_unstable_pieces_meet_and_folds_are_named_once() -> None:
    """Each piece goes on to the first point of the next; a legend has each kind once."""
    found = response()
    ax = found.plot("w", harmonic=2)
    amplitude, f = found.amplitude("w", 2), found.frequencies
    lines = [line for line in ax.lines if line.get_marker() == "None"]
    assert [line.get_linestyle() for line in lines] == ["-", "--", "-"]
    for line, piece in zip(lines, (slice(0, 3), slice(2, 5), slice(4, 5)), strict=True):
        assert line.get_xdata() == pytest.approx(f[piece])
        assert line.get_ydata() == pytest.approx(amplitude[piece])
    marks = [line for line in ax.lines if line.get_marker() == "o"]
    assert [(m.get_xdata()[0], m.get_ydata()[0]) for m in marks] == [(f[k], amplitude[k]) for k in (2, 3)]
    assert [str(m.get_label()).startswith("_") for m in marks] == [False, True]
    assert [t.get_text() for t in ax.texts] == [f"{f[k]:.4g} Hz" for k in (2, 3)]
    assert sorted(t.get_text() for t in ax.get_legend().get_texts()) == ["fold", "stable", "unstable"]
    assert ax.get_ylabel() == "amplitude of w, harmonic 2, rad/s"
    assert ax.get_title() == "Harmonic balance, 2 harmonics, waveform within 0.004"
    first = response(coefficients=SERIES[:, :3]).plot(ax=plt.figure().add_subplot())
    assert first.get_ylabel() == "amplitude of mesh.q, m"
    assert re.match("Harmonic balance, 1 harmonic,", first.get_title())
    ends = response(multipliers=MULTIPLIERS[[0, 0, 2, 3, 3]]).plot(ax=plt.figure().add_subplot()).lines
    assert [(line.get_linestyle(), len(line.get_xdata())) for line in ends if line.get_marker() == "None"] == [
        ("-", 3),
        ("--", 3),
    ]
    pieces = response(multipliers=MULTIPLIERS[[2, 0, 0, 0, 3]]).plot(ax=plt.figure().add_subplot()).lines
    assert [line.get_linestyle() for line in pieces if line.get_marker() == "None"] == ["--", "-", "--"]
    plt.close("all")
