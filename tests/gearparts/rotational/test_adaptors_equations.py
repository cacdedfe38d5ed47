"""Adaptors between a flange and signals: equations that hold at motions worked out by hand."""

from __future__ import annotations

import pytest

import gearparts as gp
from tests.gearparts.laws import misfits

SIGNALS = {"phi_ref": 0.7, "w_ref": 5.0, "a_ref": 11.0, "k": 3.0, "flange.tau": 1.5, "tau": -1.5, "flange.phi": 0.3}


@pytest.mark.parametrize(("use_w", "use_a"), [(True, True), (True, False), (False, True), (False, False)])
def test_an_adaptor_follows_all_signals_or_the_angle_alone(use_w: bool, use_a: bool) -> None:
    part = gp.AngleToTorqueAdaptor(phi_ref=0.7, use_w=use_w, use_a=use_a)
    turning = SIGNALS | {"phi": 0.3, "w": 2.0, "der(phi)": 2.0}
    if use_w and use_a:
        assert misfits(part, turning | {"phi_error": -0.4, "w_error": -3.0, "der(w)": 11.0 + 18.0 + 3.6}) == []
    else:
        assert misfits(part, turning | {"phi_error": 0.0, "w_error": 0.0, "phi_ref": 0.3}) == []


@pytest.mark.parametrize(("use_w", "use_a"), [(True, True), (True, False), (False, True), (False, False)])
def test_an_adaptor_tells_what_it_is_asked_for(use_w: bool, use_a: bool) -> None:
    part = gp.TorqueToAngleAdaptor(tau=1.5, use_w=use_w, use_a=use_a)
    turning = {"flange.phi": 0.3, "phi": 0.3, "der(phi)": 2.0, "der(w)": 7.0, "tau": 1.5, "flange.tau": 1.5}
    assert misfits(part, turning | {"w": 2.0 * use_w, "a": 7.0 * (use_w and use_a)}) == []
