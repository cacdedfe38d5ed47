"""Modifications of parts: which are allowed."""

from __future__ import annotations

import pytest

import gearlib as gl
from gearlib.errors import ModelicaError

CLASS = "model A final parameter Real k = 2; parameter Real j = 1; Real x = k * j; end A;"


def test_what_is_not_final_can_be_modified() -> None:
    model = gl.read_modelica(f"{CLASS} model B A a(j = 3); A b; end B;", "B")
    result = gl.simulate(model(), 1.0, samples=2)
    assert (result["a.x"][0], result["b.x"][0]) == (6.0, 2.0)


def test_what_is_final_cannot_be_modified() -> None:
    with pytest.raises(ModelicaError, match="'k' is final, and cannot be modified"):
        gl.compile(gl.read_modelica(f"{CLASS} model B A a(k = 3); end B;", "B")())
