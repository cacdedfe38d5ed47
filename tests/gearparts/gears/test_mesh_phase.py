"""The phase of a mesh, speeds that are counted from its support, and functions of the phase that repeat with each tooth."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest
import sympy
from scipy.interpolate import CubicSpline

import gearparts as gp
from gearlib.errors import BindingError
from gearparts.gears.mesh_phase import (
    ContactInterval,
    checked_period,
    checked_terms,
    contact_intervals,
    period_spline,
    periodic,
    wrapped,
)
from tests.gearparts.laws import misfits

MESH = {"r_a": 0.1, "r_b": 0.2, "c": 1e8, "d": 10.0}


@pytest.mark.parametrize("use_support", [False, True])
def test_speeds_and_phase_are_counted_from_the_support(use_support: bool) -> None:
    mesh = gp.DetailedExternalMesh(use_support=use_support, **MESH)
    values = {"der(flange_a.phi)": 5.0, "der(flange_b.phi)": -3.0, "z_a": 20.0, "phase0": 0.4, "turned": 1.5}
    support = {"der(support.phi)": 2.0} if use_support else {}
    w_a, w_b = (3.0, -5.0) if use_support else (5.0, -3.0)
    motion = {"w_a": w_a, "w_b": w_b, "der(turned)": 20.0 * w_a, "phase": 1.9, "v": 0.7, "der(q)": 0.7}
    found = misfits(mesh, defaultdict(float, values | support | motion))  # the other symbols are zero
    assert sorted(found) == ["contact", "v"]  # which are equated elsewhere


@pytest.mark.parametrize("centre", [0.0, math.pi, -2.5, 20.0])
def test_a_wrapped_phase_lies_within_half_a_turn_of_the_centre(centre: float) -> None:
    for phase in np.linspace(-9.0, 11.0, 21):
        inside = float(wrapped(float(phase), centre))
        assert abs(inside - centre) <= math.pi + 1e-12
        assert math.remainder(inside - phase, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)


ROWS = ((-2.0, 1.0), (0.5, 3.0), (4.0, 2.0))


def test_a_table_is_a_spline_over_one_period_and_its_slope() -> None:
    curve = CubicSpline([-2.0, 0.5, 4.0, -2.0 + 2 * math.pi], [1.0, 3.0, 2.0, 1.0], bc_type="periodic")
    phases = np.linspace(-2.0, -2.0 + 2 * math.pi, 15)
    assert period_spline(ROWS)(phases) == pytest.approx(curve(phases), rel=1e-13)
    x = sympy.Symbol("x", real=True)
    value, slope = (law.args[0] for law in periodic(ROWS, x))
    assert [float(value.subs(x, at)) for at in phases] == pytest.approx(curve(phases), rel=1e-12)
    assert [float(slope.subs(x, at)) for at in phases] == pytest.approx(curve(phases, 1), rel=1e-11, abs=1e-12)


def test_a_table_has_three_rows_or_more_within_less_than_a_period() -> None:
    whole = ((0.0, 1.0), (1.0, 2.0), (2 * math.pi, 1.0))
    for rows, last in ((whole[:2], "1"), (whole, r"6\.28319"), (((0.0, 1.0), (1.0, 2.0), (9.0, 1.0)), "9")):
        said = rf"^Mesh\.table has {len(rows)} rows from 0 to {last} rad; expected three or more within less than one period of two pi"
        with pytest.raises(BindingError, match=said):
            checked_period("Mesh.table", rows)
    assert checked_period("Mesh.table", ((0, 1), (1, 2), (6.28, 1))) == ((0.0, 1.0), (1.0, 2.0), (6.28, 1.0))


def test_terms_are_rows_of_three_or_none() -> None:
    assert checked_terms(gp.DetailedExternalMesh(**MESH), "error_terms") == ()
    mesh = gp.DetailedExternalMesh(error_terms=((1, 2e-6, 0.4),), **MESH)
    assert checked_terms(mesh, "error_terms") == ((1.0, 2e-6, 0.4),)
    with pytest.raises(BindingError, match=r"DetailedExternalMesh\.error_terms .* rows of 3 numbers"):
        checked_terms(gp.DetailedExternalMesh(error_terms=((1.0, 2e-6),), **MESH), "error_terms")


@pytest.mark.parametrize(
    ("contact_ratio", "intervals"),
    [
        (1, [(0.0, 0.5, 1), (0.5, 1.0, 1)]),
        (1.25, [(0.0, 0.25, 2), (0.25, 1.0, 1)]),
        (2.0, [(0.0, 0.5, 2), (0.5, 1.0, 2)]),
        (3.75, [(0.0, 0.75, 4), (0.75, 1.0, 3)]),
        (100, [(0.0, 0.5, 100), (0.5, 1.0, 100)]),
    ],
)
def test_a_period_begins_with_one_pair_more_for_the_fraction_of_the_contact_ratio(
    contact_ratio: float, intervals: list[tuple[float, float, int]]
) -> None:
    found = contact_intervals("Mesh", contact_ratio)
    assert [(s.start, s.end, s.pairs) for s in found] == intervals
    for s in found:
        for at in (0.01, 0.2, 0.3, 0.45, 0.55, 0.7, 0.8, 0.99):
            for turn in (-2, 0, 3):
                assert bool(s.within(2 * math.pi * (at + turn))) == (s.start < at < s.end)
                assert not s.start < at < s.end or float(s.newest(2 * math.pi * (at + turn))) == pytest.approx(at, abs=1e-12)


def test_the_newest_pair_is_counted_on_beyond_its_interval() -> None:
    interval = ContactInterval(0.25, 1.0, 1)
    assert [float(interval.newest(2 * math.pi * at)) for at in (0.2, 1.05)] == pytest.approx([0.2, 1.05])


def test_an_interval_holds_the_phases_between_its_ends() -> None:
    interval = ContactInterval(0.2, 0.5, 1)
    places = (-0.55, -0.45, 0.1, 0.19, 0.21, 0.35, 0.49, 0.51, 0.9, 3.3)
    assert [at for at in places if interval.within(2 * math.pi * at)] == [-0.55, 0.21, 0.35, 0.49, 3.3]
