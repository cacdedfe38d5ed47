"""Names that nothing has: the message says what was meant."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError, NameLookupError


class Shaft(gl.Component):
    def assemble(self) -> list[gl.Connection]:
        self.m = gp.Inertia(J=1.0)
        return []


@pytest.mark.parametrize(
    ("module", "name", "meant"),
    [
        (gl, "Model", "Component"),
        (gl, "Paramter", "Parameter"),
        (gp, "PlanetaryGear", "PlanetaryUnit"),
        (gp, "inertia", "Inertia"),
    ],
)
def test_a_module_says_what_was_meant(module: ModuleType, name: str, meant: str) -> None:
    with pytest.raises(
        AttributeError, match=rf"module '{module.__name__}' has no attribute '{name}'; did you mean .*'{meant}'"
    ):
        getattr(module, name)
    assert not hasattr(module, name)
    assert getattr(module, name, None) is None
    assert not hasattr(module, "__wrapped__")


def test_what_is_imported_late_can_be_copied_and_pickled() -> None:
    for kind in (gl.Table, gl.Component, gp.Inertia):
        assert pickle.loads(pickle.dumps(kind)) is kind
        assert copy.deepcopy(kind) is kind


@pytest.mark.parametrize(
    ("action", "error", "message"),
    [
        (lambda: gl.compile(gp.Inertia(J=1, start={"a": 0})), BindingError, r"the derivative of 'w' and .*; start=\{'w': \.\.\.\}"),
        (lambda: gl.compile(gp.Inertia(J=1, start={"der(w)": 0})), BindingError, r"the derivative of 'w'"),
        (lambda: gl.compile(gp.Inertia(J=1, guess={"omega": 0})), BindingError, r"'omega', .* did you mean 'w'\?"),
        (lambda: gp.Inertia(J=1, start={"m.omega"}), BindingError, r"expected start values by name, such as start=\{'m\.omega': 100\.0"),
        (lambda: gl.compile(Shaft()).simulate(1.0, start={"m.omega": 1.0}), NameLookupError, r"did you mean 'm\.w'\?"),
        (lambda: gl.compile(Shaft()).simulate(1.0, start={"m.x": 1.0}), NameLookupError, r"m\.x"),
    ],
)  # fmt: skip
def test_what_works_is_said(action: Callable[[], Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        action()
