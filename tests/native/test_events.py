"""The native event iteration: the sides of roots that it reports."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

import gearlib as gl
from gearlib.program.event_iteration import compares_with_before

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


class Staircase(gl.Component):
    """A level that x climbs by one whenever it reaches it, beside a comparison with a number and a state that is set."""

    one = gl.Parameter("1", default=1.0)
    x, y = gl.Variable("1"), gl.Variable("1")
    level = gl.Discrete("1", start=1.0)

    def equations(self) -> list[Any]:
        return [
            gl.Eq(gl.der(self.x), gl.Piecewise((1.0, self.x >= self.one), (2.0, True)) + self.level),
            gl.Eq(gl.der(self.y), -self.one * self.y),
            gl.When(self.x >= gl.pre(self.level), gl.Eq(self.level, gl.pre(self.level) + 1.0)),
            gl.When(self.level >= 3.0, gl.reinit(self.y, 7.0)),
        ]


@pytest.mark.parametrize(("x", "level", "y"), [(1.0 - 1e-15, 1.0, 0.25), (2.0 - 1e-15, 2.0, 7.0), (4.5, 1.0, 0.25)])
def test_what_has_crossed_counts_until_it_is_compared_with_something_else(x: float, level: float, y: float) -> None:
    """Just below the level, a root that has fired is above it: once, since the level is higher afterwards; a number stays the same."""
    system = gl.compile(Staircase(), outputs=["x", "y", "level"])
    scene, model = system.translation.scene, system.translation.model
    native, relations = scene.native, scene.relations
    assert native.update is not None
    assert relations is not None
    state = np.zeros(2)
    state[[scene.state_names.index(name) for name in "xy"]] = x, 0.25
    flags = np.zeros(scene.n_discrete)
    place, n = model.n_relations + model.discretes.index("level"), len(model.discretes)
    flags[place] = flags[place + n] = level
    numbers = scene.prepared(system.translation.parameter_values({}))
    data = scene.data(native, numbers, np.zeros(0), flags, np.zeros(model.n_variables))
    fired = np.full(len(relations.searched), -1, np.int32)  # the functions are numbers minus x
    status = MODEL(native.update.address)(0.0, state.ctypes.data, fired.ctypes.data, data.ctypes.data, native.index.ctypes.data)
    held = data[native.shared.relations :][: native.shared.n_discrete]
    assert status == (2 if y == 7.0 else 1)
    assert held[place] == held[place + n] == level + 1.0
    assert state[scene.state_names.index("y")] == y
    for phase in relations.event_iteration.event_functions:
        for target in phase.batch.targets.tolist():
            before = compares_with_before(phase.batch)
            assert held[target] == (x >= level + 1.0 if before else 1.0)
            assert fired[relations.searched.tolist().index(target)] == (-2 if held[target] else 2)


class Sawtooth(gl.Component):
    """A state that is set back whenever it reaches one."""

    one = gl.Parameter("1", default=1.0)
    rate = gl.Parameter("1/s", default=1.0)
    x = gl.Variable("1")

    def equations(self) -> list[Any]:
        return [gl.Eq(gl.der(self.x), self.rate), gl.When(self.x >= self.one, gl.reinit(self.x, 0.25))]


@pytest.mark.parametrize("x", [1.0 - 1e-15, 1.0, 1.0 + 1e-15])
def test_what_has_crossed_does_not_count_where_a_state_has_been_set(x: float) -> None:
    """The relation is judged by the new state."""
    system = gl.compile(Sawtooth())
    scene, n_variables = system.translation.scene, system.translation.model.n_variables
    native, state, fired = scene.native, np.array([x]), np.full(1, -1, np.int32)  # the function is one minus x
    assert native.update is not None
    numbers = scene.prepared(system.translation.parameter_values({}))
    data = scene.data(native, numbers, np.zeros(0), np.zeros(scene.n_discrete), np.zeros(n_variables))
    status = MODEL(native.update.address)(0.0, state.ctypes.data, fired.ctypes.data, data.ctypes.data, native.index.ctypes.data)
    assert (status, state.tolist(), fired.tolist()) == (2, [0.25], [2])
    assert data[native.shared.relations] == 0.0
