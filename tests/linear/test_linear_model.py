"""Linear models: conversion to python-control and back, names, and when sparse matrices are worth their while."""

from __future__ import annotations

import pickle
from typing import Any

import control
import numpy as np
import pytest
import scipy.sparse as sparse

import gearlib as gl
from gearlib.errors import ArgumentError
from gearlib.linear.linear_model import LinearModel, check_linear, full, is_sparse, label, matrices, signal_names, state_space
from tests.stress.test_right_calls import given

A, B, C, D = np.diag([-1.0, -2.0]), np.array([[1.0], [3.0]]), np.array([[1.0, 0.0], [0.5, 2.0]]), np.array([[0.0], [7.0]])
NAMES = ("a.w", "b.w"), ("drive.tau",), ("a.w", "der(b.w)")


def model(**more: Any) -> LinearModel:
    return LinearModel(
        **{"A": A, "B": B, "C": C, "D": D, **dict(zip(("states", "inputs", "outputs"), NAMES, strict=True)), **more}
    )


@pytest.mark.parametrize("form", [np.asarray, sparse.csr_matrix, sparse.csc_array])
def test_a_state_space_has_the_matrices_and_names(form: Any) -> None:
    found = state_space(model(A=form(A), B=form(B), C=form(C), D=form(D)), "train")
    for name, matrix in (("A", A), ("B", B), ("C", C), ("D", D)):
        assert getattr(found, name).tolist() == matrix.tolist()
    assert (found.state_labels, found.input_labels, found.output_labels) == (["a.w", "b.w"], ["drive_tau"], ["a_w", "der(b_w)"])
    assert found.name == "train"
    assert [m if isinstance(m, list) else m.tolist() for m in matrices(found)] == [
        A.tolist(), B.tolist(), C.tolist(), D.tolist(), ["drive_tau"], ["a_w", "der(b_w)"],
    ]  # fmt: skip


@pytest.mark.parametrize("outputs", [0, 1, 2])
@pytest.mark.parametrize("states", [1, 2])
def test_a_state_space_without_inputs(states: int, outputs: int) -> None:
    without = model(
        A=A[:states, :states], B=np.zeros((states, 0)), C=C[:outputs, :states], D=np.zeros((outputs, 0)),
        states=NAMES[0][:states], inputs=(), outputs=NAMES[2][:outputs],
    )  # fmt: skip
    found = given(lambda: state_space(without))
    assert (found.B.shape, found.D.shape, found.ninputs, found.input_labels) == ((states, 0), (outputs, 0), 0, [])
    assert found.A.tolist() == A[:states, :states].tolist()
    assert found.C.tolist() == C[:outputs, :states].tolist()


@pytest.mark.parametrize(
    ("alike", "said"),
    [
        ({"outputs": ("a.w", "a_w")}, "the outputs a.w and a_w both become 'a_w' in python-control; sparse=True keeps paths"),
        ({"outputs": ("a.w", "a.w")}, "the output a.w is named twice"),
        ({"inputs": ("t.x", "t_x"), "B": np.ones((2, 2)), "D": np.ones((2, 2))}, "the inputs t.x and t_x both become 't_x'"),
    ],
)
def test_signals_of_one_name_are_refused(alike: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError, match=f"^{said}"):
        state_space(model(**alike))


def test_what_is_no_linear_model_is_refused() -> None:
    for right in (model(), state_space(model()), control.tf([1.0], [1.0, 2.0])):
        check_linear(right)
    with pytest.raises(ArgumentError, match="expected a System, StateSpace, TransferFunction or LinearModel, got"):
        check_linear(A)
    with pytest.raises(ArgumentError, match="got"):
        matrices("train")
    for sampled in (control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1), control.tf([1.0], [1.0, -0.5], True)):
        for ask in (check_linear, matrices, gl.stability, lambda m: gl.frequency_response(m, [1.0])):
            with pytest.raises(ArgumentError, match="the model is a sampled one; expected one in continuous time"):
                ask(sampled)  # the pole 0.5 of a sampled model is a motion that dies


def test_a_transfer_function_has_the_gain_of_its_matrices() -> None:
    a, b, c, d, inputs, outputs = matrices(control.tf([3.0, 1.0], [1.0, 4.0], inputs="u", outputs="y"))
    assert (inputs, outputs) == (["u"], ["y"])
    assert c @ np.linalg.solve(2j * np.eye(1) - a, b) + d == pytest.approx((3 * 2j + 1) / (2j + 4))


def test_names_without_labels_are_those_of_the_model() -> None:
    assert signal_names(model()) == (["drive.tau"], ["a.w", "der(b.w)"])
    assert [label(name) for name in ("a.b.c", "a")] == ["a_b_c", "a"]


def test_a_pickled_model_is_numbers_and_names() -> None:
    told = model(conditions=("open: mesh m",), whole="the whole", changes=len)
    found = pickle.loads(pickle.dumps(told))
    assert (found.states, found.inputs, found.outputs, found.conditions) == (*NAMES, ("open: mesh m",))
    assert [m.tolist() for m in (found.A, found.B, found.C, found.D)] == [m.tolist() for m in (A, B, C, D)]
    assert found.whole is None
    assert found.changes is None


def test_a_model_is_told_by_its_numbers_and_compared_as_one_object() -> None:
    """Matrices have no single truth value, and what they were derived from is long."""
    one, other = model(whole="the whole", changes=len), model()
    assert one == one
    assert one != other
    assert len({one, other, one}) == 2
    assert "the whole" not in repr(one)
    assert "changes" not in repr(one)


@pytest.mark.parametrize("form", [np.asarray, sparse.csr_matrix])
@pytest.mark.parametrize(("n", "entries", "expected"), [(80, 80, False), (81, 81, True), (100, 999, True), (100, 1000, False)])
def test_sparse_matrices_are_used_for_many_states_with_few_entries(form: Any, n: int, entries: int, expected: bool) -> None:
    """More than 80 states, and less than a tenth of the entries."""
    table = np.zeros(n * n)
    table[:entries] = 2.0
    assert is_sparse(form(table.reshape(n, n))) is expected


def test_a_full_matrix_has_all_entries() -> None:
    for form in (np.asarray, sparse.csr_matrix, sparse.csc_array):
        assert full(form(C)).tolist() == C.tolist()
    assert full([[1, 2]]).dtype == float


@pytest.mark.parametrize("form", [sparse.csr_matrix, sparse.csc_array])
def test_entries_that_are_stored_count_though_they_are_zero(form: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A factorisation carries them along; a full matrix has only the others."""
    monkeypatch.setattr("gearlib.linear.linear_model.MOST_DENSE", 0)
    stored = form((np.zeros(1), ([0], [0])), shape=(1, 1))
    assert (is_sparse(stored), is_sparse(stored.toarray())) == (False, True)
