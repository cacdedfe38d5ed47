"""Matrices in the shapes in which users have them, and the coefficients of a transfer function by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import gearlib as gl
import gearparts as gp
from gearlib.errors import BindingError
from gearlib.flatten.flatten import flatten
from tests.gearparts.blocks.bench import Driven

B = gp.blocks


def gains(block: Any, inputs: list[str], outputs: list[str], s: complex) -> Any:
    """The transfer matrix of a block at a complex frequency."""
    linear = gl.compile(Driven(make=lambda: block)).linearize(inputs, outputs)
    return np.asarray(linear(s)).reshape(len(outputs), len(inputs))


S = 0.3 + 1.7j


@pytest.mark.parametrize("a", [[-2.0], [[-2.0]], -2.0 * np.eye(1)])
@pytest.mark.parametrize("c", [[3.0, 0.5], [[3.0], [0.5]]])
def test_a_row_of_one_number_may_be_the_number(a: Any, c: Any) -> None:
    found = gains(
        B.MultiStateSpace(A=a, B=[4.0], C=c, D=[0.0, 7.0]),
        ["block.inputs[0].u"],
        ["block.outputs[0].y", "block.outputs[1].y"],
        S,
    )
    assert found.ravel() == pytest.approx([12.0 / (S + 2), 2.0 / (S + 2) + 7], rel=1e-12)


@pytest.mark.parametrize("b", [[1.0, 4.0], [[1.0], [4.0]], [[1.0, 4.0]]])
@pytest.mark.parametrize("c", [[3.0, 0.5], [[3.0, 0.5]], [[3.0], [0.5]]])
def test_input_and_output_of_a_state_space_are_rows_or_columns(b: Any, c: Any) -> None:
    """Two lags side by side, the second one fed by the first."""
    found = gains(B.StateSpace(A=[[-2.0, 0.0], [1.5, -5.0]], B=b, C=c, D=0.25), ["block.u"], ["block.y"], S)
    first = 1.0 / (S + 2)
    assert found.ravel() == pytest.approx([3.0 * first + 0.5 * (4.0 + 1.5 * first) / (S + 5) + 0.25], rel=1e-12)


@pytest.mark.parametrize("d", [np.nan, np.inf, -np.inf])
def test_what_goes_through_at_once_is_one_finite_number(d: Any) -> None:
    block = B.StateSpace(A=[[-1.0]], B=[1.0], C=[1.0], D=d)
    with pytest.raises(BindingError, match=r"block: D is .*; expected a sequence of finite numbers"):
        flatten(Driven(make=lambda: block))


def test_states_of_a_transfer_function_are_those_of_the_controllable_form() -> None:
    """(6 s**2 + 5 s + 4) / (2 s**2 + 3 s + 8): der(x1) = u - (8 x0 + 3 x1) / 2, y = 3 u + ((4 - 24) x0 + (5 - 9) x1) / 2."""
    system = gl.compile(Driven(make=lambda: B.TransferFunction(b=[6, 5, 4], a=[2, 3, 8])))
    linear = system.linearize(["block.u"], ["block.y"])
    assert pytest.approx(np.array([[0.0, 1.0], [-4.0, -1.5]]), abs=1e-14) == linear.A
    assert linear.B.ravel() == pytest.approx([0.0, 1.0], abs=1e-14)
    assert linear.C.ravel() == pytest.approx([-10.0, -2.0], abs=1e-14)
    assert linear.D.ravel() == pytest.approx([3.0], abs=1e-14)


def refusal(make: Any) -> str:
    """What is raised for a block."""
    try:
        flatten(Driven(make=make))
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def test_a_block_whose_matrices_do_not_fit_is_refused_by_their_sizes() -> None:
    zero_first = "BindingError: TransferFunction block: b is (1.0,) and a is (0.0, 2.0); expected a first coefficient of a"
    assert refusal(lambda: B.TransferFunction(a=[0.0, 2.0])).startswith(zero_first)
    assert refusal(lambda: B.TransferFunction(b=[1.0, 1.0])).startswith("BindingError: TransferFunction block: b is (1.0, 1.0)")
    for b, c in (([1.0, 2.0], [1.0]), ([1.0], [1.0, 2.0])):
        said = refusal(lambda b=b, c=c: B.StateSpace(A=[[1.0]], B=b, C=c))
        assert said.startswith("BindingError: StateSpace block: A is "), said
    for given, sizes in (
        ({"A": [[1.0]], "B": [[1.0], [2.0]], "C": [[1.0]]}, "A 1 x 1, B 2 x 1, C 1 x 1, D 1 x 1"),
        ({"A": np.eye(2), "B": [[1.0, 2.0], [1.0]], "C": [[1.0, 0.0]]}, "A 2 x 2, B 2 x 2, C 1 x 2, D 1 x 2"),
        ({"A": [[1.0]], "C": [[1.0]]}, "A 1 x 1, B 0 x 0, C 1 x 1, D 1 x 0"),
    ):
        said = refusal(lambda given=given: B.MultiStateSpace(**given))
        assert said == f"BindingError: MultiStateSpace block: the matrices do not fit each other: {sizes}"


def test_only_the_first_coefficient_must_not_be_zero() -> None:
    assert gains(B.TransferFunction(b=[3.0], a=[2.0, 0.0]), ["block.u"], ["block.y"], S).ravel() == pytest.approx(
        [1.5 / S], rel=1e-12
    )
    assert gains(B.TransferFunction(b=[3.0]), ["block.u"], ["block.y"], S).ravel() == pytest.approx([3.0], rel=1e-14)
