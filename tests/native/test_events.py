"""The native event iteration: the sides of roots that it reports."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

import gearlib as gl

MODEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, *[ctypes.c_void_p] * 4)


class Switches(gl.Component):
    """Every way to compare a state with a number."""

    one = gl.Parameter("1", default=1.0)
    x = gl.Variable("1")
    y = gl.Variable("1")

    def equations(self) -> list[Any]:
        x, y, one = self.x, self.y, self.one
        return [
            gl.Eq(gl.der(x), gl.Piecewise((1.0, x > one), (2.0, x >= -one), (3.0, True))),
            gl.Eq(gl.der(y), gl.Piecewise((1.0, y < -one), (2.0, y <= one), (3.0, True))),
        ]


@pytest.mark.parametrize("x", [-2.0, 0.0, 2.0])
@pytest.mark.parametrize("y", [-2.0, 0.0, 2.0])
def test_sides_are_the_signs_of_the_event_functions(x: float, y: float) -> None:
    """2 where the function is positive, -2 where it is negative; and the relations hold that do."""
    system = gl.compile(Switches())
    scene = system.translation.scene
    native, state = scene.native, np.array([x, y])
    assert native.roots is not None
    assert native.update is not None
    numbers = scene.prepared(system.translation.parameter_values({}))
    flags = np.zeros(scene.n_discrete)
    data = scene.data(native, numbers, np.zeros(0), flags, np.zeros(scene.model.n_variables))
    functions, fired = np.empty(4), np.zeros(4, np.int32)
    assert MODEL(native.roots.address)(
        0.0, state.ctypes.data, functions.ctypes.data, data.ctypes.data, native.index.ctypes.data
    ) == 0  # fmt: skip
    status = MODEL(native.update.address)(0.0, state.ctypes.data, fired.ctypes.data, data.ctypes.data, native.index.ctypes.data)
    assert status >= 0
    assert fired.tolist() == (2 * np.sign(functions)).tolist()
    assert sorted(np.abs(functions)) == pytest.approx(sorted([abs(x - 1), abs(x + 1), abs(y + 1), abs(y - 1)]))
    held = data[native.shared.relations :][: native.shared.n_discrete]
    assert sorted(held) == sorted([x > 1, x >= -1, y < -1, y <= 1])
