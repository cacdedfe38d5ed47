"""What `stability` hands on: the poles it finds in a model of any kind, what it computes later, and for which loop."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.feedback import stability as module
from gearlib.feedback import stability as parts
from gearlib.feedback.stability import StabilityReport, pole_table, stability
from tests.feedback.test_reports import TURN, of

TRANSFER = control.tf([3.0], [1, 3.0, 2.0])


def test_poles_of_a_model_of_any_kind(chain: Any) -> None:
    """With and without a loop; of a System those of its linear model."""
    system = chain(n=2, grounded=True)
    linear = system.linearize(["torque.tau"], ["body[0].w"], parameters={"d": 0.5})
    expected = np.sort_complex(np.linalg.eigvals(linear.A))
    loop = ("torque.tau", "body[0].w")
    for report in (
        stability(system, parameters={"d": 0.5}), stability(system, loop, parameters={"d": 0.5}), stability(linear),
        stability(linear, loop), stability(control.ss(linear.A, linear.B, linear.C, linear.D)),
    ):  # fmt: skip
        assert np.sort_complex(report.eigenvalues) == pytest.approx(expected, rel=1e-9)
    for report in (stability(TRANSFER), stability(TRANSFER, (0, 0)), stability(control.ss(TRANSFER))):
        assert np.sort_complex(report.eigenvalues) == pytest.approx([-2.0, -1.0])
        assert report.verdict == "stable"
        assert report.damping.tolist() == [1.0, 1.0]
    assert stability(TRANSFER).loop is None
    named = control.tf([3.0], [1, 3.0, 2.0], name="lag")
    assert stability(named).name == "lag"
    assert stability(system).name == system.name


def test_a_loop_has_the_gain_that_is_given() -> None:
    report = stability(TRANSFER, (0, 0), gain=-0.5)
    assert report.loop is not None
    assert np.sort_complex(report.loop.closed_poles.values) == pytest.approx(np.sort_complex(np.roots([1.0, 3.0, 0.5])))
    assert report.loop.margins is report.loop.margins
    assert report.loop.verdict == report.loop.nyquist.verdict == "stable"
    unstable = stability(TRANSFER, (0, 0), gain=-1.0)
    assert unstable.loop is not None
    assert unstable.loop.verdict == "unstable"
    assert unstable.verdict == "stable"
    assert stability(TRANSFER, gain=1.0).loop is None
    with pytest.raises(ArgumentError, match=r"^gain is 1\.5, but no loop is closed"):
        stability(TRANSFER, gain=1.5)


@pytest.mark.parametrize("spare", [0, -1])
def test_words_and_certificate_are_those_of_systems_that_are_not_too_large(
    chain: Any, monkeypatch: pytest.MonkeyPatch, spare: int
) -> None:
    system = chain(n=2)
    monkeypatch.setattr(module, "MOST_DENSE", len(system.states) + spare)
    report = stability(system, parameters={"d": 1.0})
    if spare:
        assert (report.passivity, report.conditions, report.at_zero) == (None, (), "")
    else:
        assert report.passivity is not None
        assert report.passivity.holds
        assert report.at_zero == "the train turns freely"


def test_what_is_computed_later_is_that_of_the_parameters_that_were_given(chain: Any) -> None:
    """Not of those that the mapping holds by then."""
    system, given = chain(n=2, grounded=True), {"d": 0.5}
    for loop in (None, ("torque.tau", "body[0].w")):
        report = stability(system, loop, parameters=given)
        given["d"] = 7.0
        found = report.sensitivity("d")
        given["d"] = 0.5
        assert (found.parameter, found.value) == ("d", 0.5)
        h = 1e-5
        ahead, back = (stability(system, parameters={"d": 0.5 + s}).eigenvalues for s in (h, -h))
        assert found.eigenvalues == pytest.approx((ahead - back) / (2 * h), rel=1e-5, abs=1e-7)
        assert (len(found.closed_eigenvalues) > 0) == (loop is not None)
        assert report.passivity is not None
        assert float(np.trace(report.passivity.W)) == pytest.approx(
            float(np.trace(gl.passivity(system, parameters={"d": 0.5}).W))
        )


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ({}, ""),
        ({"free": 1}, "the train turns freely"),
        ({"free": 3}, "the train turns freely in 3 ways"),
        (
            {"gaps": {4: "mesh b", 5: "mesh a", 7: "mesh b"}},
            "a free relative motion across mesh b; a free relative motion across mesh a",
        ),
        ({"preloads": 1}, "a loop of meshes keeps a preload"),
        ({"preloads": 2}, "loops of meshes keep preloads"),
        ({"positions": ("a.phi", "b.phi")}, "nothing here depends on a.phi, b.phi"),
        (
            {"free": 1, "preloads": 1, "positions": ("a.phi",)},
            "the train turns freely; a loop of meshes keeps a preload; nothing here depends on a.phi",
        ),
    ],
)
def test_what_poles_at_zero_stand_for(found: dict[str, Any], said: str) -> None:
    modes: Any = SimpleNamespace(**{"free": 0, "gaps": {}, "preloads": 0, "positions": ()} | found)
    assert parts.poles_at_zero(modes) == said


def test_frequencies_in_words() -> None:
    assert parts.rad(TURN) == "6.28319 rad/s (1 Hz)"
    assert parts.rad(0.0) == "0 rad/s (0 Hz)"
    assert parts.rad(np.inf) == "infinite frequency"


def test_the_table_of_a_notebook_has_a_row_for_each_pole() -> None:
    found = of(-3.0 + 4.0j, -0.5)
    html = StabilityReport("train", found)._repr_html_()
    rows = [re.findall("<td[^>]*>([^<]*)</td>", row) for row in html.split("<tr")]
    numbers = sorted([float(cell) for cell in row] for row in rows if row)
    hertz = 5 / TURN
    expected = sorted([[-3.0, 4.0, hertz, 0.6], [-3.0, -4.0, hertz, 0.6], [-0.5, 0.0, 0.5 / TURN, 1.0]])
    assert numbers == [pytest.approx(row, rel=1e-3) for row in expected]
    for head in ("real part, 1/s", "imaginary part, rad/s", "frequency, Hz", "damping ratio"):
        assert head in html


def test_a_table_has_each_pair_once_however_slow_it_is() -> None:
    """The rows of `pole_table` are those of the poles above the real axis, and on it."""
    rows = [" ".join(line.split()) for line in pole_table(of(-0.1 + 0.6j, -0.2 + 1e-3j, -0.5))[1:]]
    assert sorted(row.split()[0] for row in rows) == ["-0.1", "-0.2", "-0.5"]
    assert sum("+-" in row for row in rows) == 2


def test_poles_of_a_system_that_rounding_blurs_are_told(chain: Any) -> None:
    """A damping of almost no mass makes a pole so fast that the slow ones are known badly."""
    system = chain(n=2, grounded=True)
    with pytest.warns(gl.GearlibWarning, match=rf"^{system.name}: poles are known to .* rad/s, since the fastest one"):
        stability(system, parameters={"d": 1e13})
