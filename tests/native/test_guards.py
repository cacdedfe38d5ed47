"""Divisors that change their sign: an evaluation fails where a quotient has a pole, and not where its numerator vanishes with it."""

from __future__ import annotations

import numpy as np
import pytest

import gearlib as gl
from gearlib.native.layout import EACH
from tests.compiler.test_translate import by_python


class Quotient(gl.Component):
    """y = z / x, with both as states."""

    x, z, y = gl.Variable("1"), gl.Variable("1"), gl.Variable("1")
    rate = gl.Parameter("1/s", default=1.0)

    def equations(self) -> list[gl.Eq]:
        return [
            gl.Eq(gl.der(self.x), self.rate * self.y), gl.Eq(gl.der(self.z), -self.rate * self.z), gl.Eq(self.y * self.x, self.z)
        ]  # fmt: skip


class Evaluations:
    """The source of the rates, carried out by Python, call by call on one block of data."""

    def __init__(self, component: gl.Component | None = None) -> None:
        translation = gl.compile(component or Quotient()).translation
        self.scene = translation.scene
        self.native, flags = self.scene.native, np.zeros(self.scene.native.shared.n_discrete)
        numbers = self.scene.prepared(translation.parameter_values({}))
        self.data = self.scene.data(self.native, numbers, np.zeros(0), flags, np.zeros(translation.model.n_variables))
        self.place = [self.scene.state_names.index(name) for name in "xz"]

    def __call__(self, x: float, z: float = 1.0) -> int:
        states, rates = np.zeros(2), np.zeros(2)
        states[self.place] = x, z
        code = by_python(self.native.rhs.source, "rhs", 0.0, states, rates, self.data, self.native.index.copy())
        if code == 0 and x:
            assert rates[self.place[0]] == pytest.approx(z / x)
        return code

    def event(self) -> None:
        """What the event iteration does to the signs of divisors."""
        at = self.native.rhs.layout.guards
        assert abs(self.data[at]) == 1.0
        self.data[at] *= 0.5


@pytest.fixture(params=[260, 0], ids=["written out", "loops"])
def rates(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Evaluations:
    monkeypatch.setattr("gearlib.native.source.LONGEST", request.param)
    return Evaluations()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_pole_between_two_evaluations_is_noticed(rates: Evaluations, side: float) -> None:
    assert [rates(side * x) for x in (2.0, 1e-3, 3.0, -1e-3, 1e-3, -5.0, 2.0)] == [0, 0, 0, 1, 0, 1, 0]


@pytest.mark.parametrize("z", [1.0, -1e6])
def test_a_numerator_that_vanishes_too_is_no_pole(rates: Evaluations, z: float) -> None:
    """Below 1e-8 of the largest that was met; the divisor has changed its side then."""
    assert rates(2.0, z) == 0
    assert rates(-1.0, 2e-8 * z) == 1
    assert rates(-1.0, 0.5e-8 * z) == 0
    assert rates(-1.0, z) == 0
    assert rates(1.0, z) == 1


def test_an_event_may_carry_a_divisor_across_zero(rates: Evaluations) -> None:
    """But not to zero: within a millionth of the largest it has crossed there. Once on the other side it stays."""
    for first, later in ((3e-6, 0), (1.5e-6, 1)):
        own = type(rates)()
        assert own(2.0) == 0
        own.event()
        assert own(-first) == later
        assert own(-1.0) == 0  # the next try, farther away
        assert own(1.0) == 1
    assert rates(2.0) == 0
    rates.event()
    assert [rates(x) for x in (1e-9, -1e-9)] == [0, 1]  # on its own side it may come close, and is watched again


def test_a_divisor_of_zero_has_no_side(rates: Evaluations) -> None:
    assert [rates(2.0), rates(0.0, 0.0)] == [0, 0]
    at = rates.native.rhs.layout.guards
    assert rates.data[at : at + EACH].tolist()[1:] == [1.0, 2.0]  # the largest numerator and divisor
    assert rates(-1.0) in (0, 1)


def test_event_functions_leave_the_signs_of_divisors_alone() -> None:
    """They look ahead, to where the run may never get."""

    class Watched(Quotient):
        n = gl.Discrete()

        def equations(self) -> list[gl.Eq]:
            return [gl.When(self.y > 7.0, gl.Eq(self.n, gl.pre(self.n) + 1))]

    rates = Evaluations(Watched())
    for x, ahead in ((2.0, -3.0), (3.0, -1e-3), (1.0, 2.0)):
        assert rates(x) == 0
        states, values = np.zeros(2), np.zeros(1)
        states[rates.place] = ahead, 1.0
        assert by_python(rates.native.roots.source, "roots", 0.0, states, values, rates.data, rates.native.index.copy()) == 0
        assert values[0] == pytest.approx(1.0 / ahead - 7.0)


class Three(gl.Component):
    """Quotients with divisors of their own."""

    def assemble(self) -> list[gl.Connection]:
        self.parts = [Quotient() for _ in range(3)]
        return []


@pytest.mark.parametrize("longest", [260, 0], ids=["written out", "loops"])
def test_each_divisor_has_a_side_of_its_own(longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gearlib.native.source.LONGEST", longest)
    translation = gl.compile(Three()).translation
    scene, rates = translation.scene, np.zeros(6)
    native, begun = scene.native, scene.prepared(translation.parameter_values({}))
    divisors = [scene.state_names.index(f"parts[{k}].x") for k in range(3)]
    for crossing in divisors:
        data = scene.data(native, begun, np.zeros(0), np.zeros(0), np.zeros(translation.model.n_variables))
        for moved, code in ((crossing, 1), (None, 0)):  # back on its side, it has crossed nothing
            states = np.array([-1.0 if i == moved else 2.0 for i in range(6)])
            assert by_python(native.rhs.source, "rhs", 0.0, np.full(6, 2.0), rates, data, native.index.copy()) == 0
            assert by_python(native.rhs.source, "rhs", 0.0, states, rates, data, native.index.copy()) == code
            at = native.rhs.layout.guards
            assert data[at : at + 3 * EACH].reshape(3, EACH).tolist() == [[1.0, 2.0, 2.0]] * 3


class WatchedThree(gl.Component):
    """Three of them, with an event."""

    n = gl.Discrete()

    def assemble(self) -> list[gl.Connection]:
        self.parts = [Quotient() for _ in range(3)]
        return []

    def equations(self) -> list[gl.Eq]:
        return [gl.When(self.parts[0].y > 7.0, gl.Eq(self.n, gl.pre(self.n) + 1))]


@pytest.mark.parametrize("longest", [260, 0], ids=["written out", "loops"])
def test_an_event_makes_the_signs_of_all_divisors_stale(longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are halved, and nothing else that is kept of the divisors is changed."""
    monkeypatch.setattr("gearlib.native.source.LONGEST", longest)
    translation = gl.compile(WatchedThree()).translation
    scene = translation.scene
    native, begun = scene.native, scene.prepared(translation.parameter_values({}))
    data = scene.data(native, begun, np.zeros(0), np.zeros(scene.n_discrete), np.zeros(translation.model.n_variables))
    states, rates = np.full(6, 2.0), np.zeros(6)
    states[scene.state_names.index("parts[1].x")] = -2.0
    assert by_python(native.rhs.source, "rhs", 0.0, states, rates, data, native.index.copy()) == 0
    at = native.rhs.layout.guards
    before = data[at : at + 3 * EACH].reshape(3, EACH).copy()
    assert sorted(before[:, 0].tolist()) == [-1.0, 1.0, 1.0]
    fired = np.zeros(1, np.int32)
    assert by_python(native.update.source, "update", 0.0, states, fired, data, native.index.copy()) >= 0
    after = data[at : at + 3 * EACH].reshape(3, EACH)
    assert after[:, 0].tolist() == (0.5 * before[:, 0]).tolist()
    assert after[:, 1:].tolist() == before[:, 1:].tolist()
    assert fired.tolist() == [-2]  # the quotient is below 7
