"""Frequency responses of matrices: closed forms, poles on the way, and how many frequencies are solved at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse

import gearlib as gl
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.linear import frequency_response as module
from gearlib.linear.frequency_response import FrequencyResponse, frequency_response
from gearlib.linear.linear_model import LinearModel

W = np.array([0.0, 0.5, 2.0, 40.0])


def model(A: Any, B: Any, C: Any, D: Any) -> LinearModel:
    names = [tuple(f"{kind}{k}" for k in range(n)) for kind, n in zip("xuy", (A.shape[0], B.shape[1], C.shape[0]), strict=True)]
    return LinearModel(A, B, C, D, *names)


def drawn(n: int, seed: int = 0) -> LinearModel:
    """Stable, with states in units far apart."""
    rng = np.random.default_rng(seed)
    units = 10.0 ** rng.uniform(-4, 4, n)
    A = rng.normal(size=(n, n)) - 2 * n * np.eye(n)
    return model(
        A * units[:, None] / units,
        rng.normal(size=(n, 2)) * units[:, None],
        rng.normal(size=(3, n)) / units,
        rng.normal(size=(3, 2)),
    )


def by_hand(m: LinearModel, w: float) -> Any:
    return m.C @ np.linalg.solve(1j * w * np.eye(len(m.A)) - m.A, m.B) + m.D


@pytest.mark.parametrize("most", [1, 40, 100, 10_000])
@pytest.mark.parametrize("n", [1, 6])
def test_any_number_of_frequencies_at_once(n: int, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "AT_ONCE", most)
    given = drawn(n)
    found = frequency_response(given, W)
    assert found.values.shape == (3, 2, 4)
    for k, w in enumerate(W):
        assert found.values[:, :, k] == pytest.approx(by_hand(given, w), rel=1e-8)
    assert (found.omega.tolist(), found.inputs, found.outputs) == (W.tolist(), given.inputs, given.outputs)
    assert (found.units, found.per, found.conditions) == (("", "", ""), "", ())
    assert found.frequencies == pytest.approx(W / (2 * np.pi))


@pytest.mark.parametrize(("inputs", "outputs"), [(1, 1), (2, 3), (0, 2), (2, 0)])
def test_without_states_the_response_is_what_is_fed_through(inputs: int, outputs: int) -> None:
    D = np.arange(1.0, 1 + inputs * outputs).reshape(outputs, inputs)
    found = frequency_response(model(np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((outputs, 0)), D), W)
    assert found.values.shape == (outputs, inputs, 4)
    for k in range(4):
        assert found.values[:, :, k].tolist() == D.tolist()


@pytest.mark.parametrize("most", [1, 10_000])
@pytest.mark.parametrize("at", [[2.0], [1.0, 2.0, 3.0], [2.0, 5.0]])
def test_a_pole_on_the_way_is_named(at: list[float], most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """An undamped swing at 2 rad/s."""
    monkeypatch.setattr(module, "AT_ONCE", most)
    swing = model(np.array([[0.0, 2.0], [-2.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)))
    with pytest.raises(ArgumentError, match="the model has a pole at 2 rad/s: the response there is infinite"):
        frequency_response(swing, at)
    assert frequency_response(swing, [1.0, 3.0]).values[0, 0] == pytest.approx([2 / 3, -2 / 5])


@pytest.mark.parametrize("kind", [np.asarray, sparse.csr_matrix])
@pytest.mark.parametrize(("k", "between"), [(400.0, 300.0), (401.0, 300.5), (1234.5, 77.7), (3.0, 7.0)])
@pytest.mark.parametrize(
    ("beside", "refused"), [(0.0, True), (1e-15, True), (-1e-15, True), (1e-13, True), (1e-8, False), (-1e-6, False)]
)
def test_what_rounding_decides_is_no_response(kind: Any, k: float, between: float, beside: float, refused: bool) -> None:
    """Two equal bodies on equal springs, which forces in step do not swing against each other, as they would at that frequency."""
    across = -k - between
    A = np.array([[0, across, 0, between], [1, 0, 0, 0], [0, between, 0, across], [0, 0, 1, 0.0]])
    pair = model(kind(A), np.array([[1.0], [0.0], [1.0], [0.0]]), np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros((1, 1)))
    w = np.sqrt(k + 2 * between) * (1 + beside)
    if refused:
        with pytest.raises(ArgumentError, match="the response there is infinite, or lost in rounding"):
            frequency_response(pair, [1.0, w])
    else:
        assert frequency_response(pair, [w]).values.item() == pytest.approx(1j * w / (k - w**2), rel=1e-5)
    low = [1e-12, 1e-6]
    assert frequency_response(pair, low).values[0, 0] == pytest.approx([1j * w / k for w in low], rel=1e-12)


def test_a_pole_of_a_large_model_is_named() -> None:
    """Eighty-one decays, with 0 among them; a large one that is sparse feeds through, too."""
    n = 81
    A = sparse.csr_matrix(np.diag(-np.arange(n) * 1.0))
    B, C, D = np.ones((n, 2)), np.vstack([np.eye(n)[3], np.ones(n)]), np.array([[1.0, 2.0], [3.0, 4.0]])
    found = frequency_response(model(A, B, C, D), W[1:])
    for k, w in enumerate(W[1:]):
        gains = np.array([1 / (1j * w + 3), (1 / (1j * w + np.arange(n))).sum()])
        assert found.values[:, :, k] == pytest.approx(gains[:, None] + D, rel=1e-10)
    with pytest.raises(ArgumentError, match="the model has a pole at 0 rad/s"):
        frequency_response(model(A, B, C, D), W)


@pytest.mark.parametrize(
    ("given", "found"), [(3.0, [3.0]), ([4, 1], [4.0, 1.0]), ((), None), ([-1.0], None), ([[1.0]], None), ([np.inf], None)]
)
def test_frequencies_are_numbers_that_are_not_negative(given: Any, found: list[float] | None) -> None:
    if found is None:
        with pytest.raises(
            ArgumentError, match=r"omega is .*expected a sequence of finite numbers that are not negative, rad/s"
        ):
            frequency_response(drawn(2), given)
    else:
        assert frequency_response(drawn(2), given).omega.tolist() == found


@pytest.mark.parametrize("given", [{"inputs": ["u0"]}, {"outputs": []}, {"at": "steady"}, {"parameters": {"a": 1.0}}])
def test_a_linear_model_has_its_signals_and_its_point(given: dict[str, Any]) -> None:
    with pytest.raises(ArgumentError, match="inputs, outputs, at and parameters belong to a System; a linear model has them"):
        frequency_response(drawn(2), W, **given)
    assert frequency_response(drawn(2), W, parameters={}).values.shape == (3, 2, 4)


def response(inputs: int = 2) -> FrequencyResponse:
    values = np.arange(1.0, 1 + 2 * inputs * 3).reshape(2, inputs, 3) * 1j
    names = tuple(f"u{k}" for k in range(inputs))
    return FrequencyResponse(
        np.array([1.0, 2.0, 4.0]) * np.pi, values, names, ("a", "b"), ("rad", ""), "N.m", ("stuck: brake",)
    )


def test_responses_are_read_by_names() -> None:
    found = response()
    assert found["b", "u1"].tolist() == [10j, 11j, 12j]
    assert found["a", "u0"].tolist() == [1j, 2j, 3j]
    assert response(1)["b"].tolist() == [4j, 5j, 6j]
    assert response(1)["b", "u0"].tolist() == [4j, 5j, 6j]
    with pytest.raises(ArgumentError, match=r"choose an input: response\['a', input\], one of u0, u1"):
        found["a"]
    for wrong in ("c", ("a", "c"), ("u0", "a")):
        with pytest.raises(NameLookupError, match="the response has no"):
            found[wrong]
    with pytest.raises(ArgumentError, match=r"expected response\[output\] or response\[output, input\]"):
        found["a", "u0", "u1"]  # type: ignore[index]
    with pytest.raises(ArgumentError, match="the response is not that of a System; the derivative"):
        found.sensitivity("c")


def test_texts_and_tables_of_responses() -> None:
    found = response()
    assert str(found).splitlines() == [
        "Response of a, b to u0, u1: 3 frequencies from 0.5 to 2 Hz",
        "Operating point: stuck: brake.",
    ]
    table = found.to_dataframe()
    assert table.index.tolist() == [0.5, 1.0, 2.0]
    assert table["b", "u1", "magnitude"].tolist() == [10.0, 11.0, 12.0]
    assert table["b", "u1", "phase, deg"].tolist() == [90.0, 90.0, 90.0]
    assert len(table.columns) == 8
    assert gl.FrequencyResponse is FrequencyResponse
