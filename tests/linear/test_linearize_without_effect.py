"""Linear models from inputs that do nothing, or to outputs that are always zero, with full and with sparse matrices."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
import gearparts as gp
from tests.stress.test_right_calls import given


class TwoApart(gl.Component):
    """Two bodies that are not joined, under torques that are given, or not; a spring hangs loose on one of them."""

    given = gl.Structural(None)

    def assemble(self) -> list[Any]:
        self.left, self.right, self.more = gp.Torque(tau=self.given), gp.Torque(tau=gl.time), gp.Torque(tau=self.given)
        self.a, self.b, self.loose = gp.Inertia(J=2.0), gp.Inertia(J=4.0), gp.Spring(c=4.0)
        return [
            gl.connect(self.left.flange, self.a.flange_a, self.more.flange),
            gl.connect(self.right.flange, self.b.flange_a, self.loose.flange_a),
        ]


@pytest.fixture(params=[False, True], ids=["full", "sparse"], autouse=True)
def large(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param:
        monkeypatch.setattr("gearlib.program.derivatives.MOST_DENSE", 0)
        monkeypatch.setattr("gearlib.linear.linearized_program.MOST_DENSE", 0)


@pytest.fixture(params=[None, 3 + gl.time], ids=["open", "given"])
def two(request: pytest.FixtureRequest) -> gl.System:
    return gl.compile(TwoApart() if request.param is None else TwoApart(given=request.param))


def entries(system: gl.System, inputs: list[str], outputs: list[str]) -> list[Any]:
    model = given(lambda: system.linearize(inputs, outputs, sparse=True))
    return [(m.toarray() if hasattr(m, "toarray") else m).tolist() for m in (model.A, model.B, model.C, model.D)]


def test_an_input_on_which_nothing_depends_has_a_column_of_zeros(two: gl.System) -> None:
    """Between inputs with an effect, and alone."""
    A, B, C, D = entries(two, ["left.tau", "right.tau", "more.tau"], ["a.w", "a.a"])
    assert (A, B, C, D) == ([[0.0]], [[0.5, 0.0, 0.5]], [[1.0], [0.0]], [[0.0, 0.0, 0.0], [0.5, 0.0, 0.5]])
    assert entries(two, ["right.tau"], ["a.w"]) == [[[0.0]], [[0.0]], [[1.0]], [[0.0]]]
    assert entries(two, ["left.tau", "right.tau"], ["b.w"])[1] == [[0.0, 0.25]]


def test_an_output_that_is_always_zero_has_a_row_of_zeros(two: gl.System) -> None:
    """Alone, without any state; and beside one that moves."""
    assert entries(two, ["right.tau", "left.tau"], ["loose.flange_b.tau"]) == [[], [], [[]], [[0.0, 0.0]]]
    assert entries(two, [], ["loose.flange_b.tau"]) == [[], [], [[]], [[]]]
    _, B, C, D = entries(two, ["right.tau"], ["loose.flange_b.tau", "b.w"])
    assert (B, C, D) == ([[0.25]], [[0.0], [1.0]], [[0.0], [0.0]])


def test_without_states_the_first_input_has_its_column(two: gl.System) -> None:
    assert entries(two, ["left.tau", "more.tau"], ["a.a"]) == [[], [], [[]], [[0.5, 0.5]]]
