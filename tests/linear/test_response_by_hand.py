"""Frequency responses of models made by hand: values, names, texts, tables and plots."""

from __future__ import annotations

import pickle
from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pytest
import scipy.sparse as sparse

import gearlib as gl
from gearlib.drawing.style import COLOURS
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.linear import frequency_response as module
from gearlib.linear.frequency_response import FrequencyResponse
from gearlib.linear.linear_model import LinearModel


@pytest.fixture(autouse=True)
def _close() -> Iterator[None]:
    yield
    plt.close("all")


def model(n: int, seed: int = 0, fill: float = 1.0) -> LinearModel:
    """Random, stable, with two inputs and three outputs, its states of any units."""
    rng = np.random.default_rng(seed)
    units = 10.0 ** rng.uniform(-4, 4, n)
    A = (rng.normal(size=(n, n)) * (rng.random((n, n)) < fill) - 2 * np.sqrt(n) * np.eye(n)) * units[:, None] / units
    B, C, D = rng.normal(size=(n, 2)) * units[:, None], rng.normal(size=(3, n)) / units, rng.normal(size=(3, 2))
    return LinearModel(A, B, C, D, tuple(f"x{k}" for k in range(n)), ("u", "v"), ("a", "b", "c"), ("open: mesh m",))


def exact(found: LinearModel, omega: np.ndarray) -> np.ndarray:
    at = [found.C @ np.linalg.solve(1j * w * np.eye(len(found.A)) - found.A, found.B) + found.D for w in omega]
    return np.moveaxis(np.array(at), 0, 2)


OMEGA = np.array([0.0, 0.3, 2.0, 50.0, 1e4])


@pytest.mark.parametrize("n", [0, 1, 5, 30])
def test_values_are_those_of_the_transfer_function(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """In one batch of frequencies or in several, the last one smaller."""
    given = model(n)
    found = gl.frequency_response(given, OMEGA)
    assert found.values == pytest.approx(exact(given, OMEGA), rel=1e-9)
    for entries in (2 * max(n, 1) ** 2, 1):  # two frequencies, or less than one
        monkeypatch.setattr(module, "AT_ONCE", entries)
        assert gl.frequency_response(given, OMEGA).values == pytest.approx(found.values, rel=1e-12)
    assert (found.inputs, found.outputs, found.units, found.per) == (("u", "v"), ("a", "b", "c"), ("",) * 3, "")
    assert found.conditions == ("open: mesh m",)


def test_large_sparse_models_have_the_same_values() -> None:
    given = model(120, fill=0.03)
    matrices = [sparse.csr_matrix(m) for m in (given.A, given.B, given.C, given.D)]
    large = LinearModel(*matrices, given.states, given.inputs, given.outputs)
    assert gl.frequency_response(large, OMEGA).values == pytest.approx(exact(given, OMEGA), rel=1e-9)
    assert gl.frequency_response(given, OMEGA).values == pytest.approx(exact(given, OMEGA), rel=1e-9)


def test_a_large_sparse_model_may_have_one_input_and_one_output() -> None:
    given = model(120, fill=0.03)
    A, B, C, D = (sparse.csr_matrix(m) for m in (given.A, given.B, given.C, given.D))
    one = gl.frequency_response(LinearModel(A, B[:, [1]], C[[2]], D[[2]][:, [1]], given.states, ("v",), ("c",)), OMEGA)
    assert one.values == pytest.approx(exact(given, OMEGA)[2:, 1:], rel=1e-9)


@pytest.mark.parametrize("large", [False, True])
def test_a_pole_on_the_grid_is_named_and_others_are_not(large: bool) -> None:
    n = 45 if large else 1
    swing = np.kron(np.eye(n), np.array([[0.0, 2.0], [-2.0, 0.0]]))
    names = tuple(f"x{k}" for k in range(2 * n))
    given = LinearModel(swing, np.ones((2 * n, 1)), np.ones((1, 2 * n)), np.zeros((1, 1)), names, ("u",), ("y",))
    beside = gl.frequency_response(given, [1.0, 1.5, 3.0])["y"]
    assert beside == pytest.approx([n * 2j * w / (4 - w**2) for w in (1.0, 1.5, 3.0)])
    with pytest.raises(ArgumentError, match="the model has a pole at 2 rad/s: the response there is infinite"):
        gl.frequency_response(given, [1.0, 2.0, 3.0])
    with pytest.raises(ArgumentError, match="a pole at 2 rad/s"):
        gl.frequency_response(given, 2.0)
    given.A[:2, :2] *= 2.5
    for grid, first in (([1.0, 5.0, 2.0], 5), ([2.0, 1.0, 5.0], 2)) if large else ():
        with pytest.raises(ArgumentError, match=f"a pole at {first} rad/s"):
            gl.frequency_response(given, grid)


@pytest.mark.parametrize("omega", [[], [-1.0, 2.0], [[1.0]], [np.nan], "x"])
def test_frequencies_are_numbers_that_are_not_negative(omega: object) -> None:
    with pytest.raises(ArgumentError, match="expected a sequence of finite numbers that are not negative, rad/s"):
        gl.frequency_response(model(2), omega)  # type: ignore[arg-type]


@pytest.mark.parametrize("more", [{"inputs": ["u"]}, {"outputs": ["a"]}, {"at": "steady"}, {"parameters": {"a": 1.0}}])
def test_what_belongs_to_a_system_is_refused_for_a_model(more: dict[str, object]) -> None:
    with pytest.raises(
        ArgumentError, match="inputs, outputs, at and parameters belong to a System; a linear model has them already"
    ):
        gl.frequency_response(model(2), [1.0], **more)  # type: ignore[arg-type]
    assert gl.frequency_response(model(2), [1.0], parameters={}).values.shape == (3, 2, 1)


def response(
    units: tuple[str, ...] = ("rad/s", "N.m", "rad/s"), inputs: tuple[str, ...] = ("u", "v"), per: str = "N.m"
) -> FrequencyResponse:
    omega = np.array([1.0, 2.0, 4.0, 8.0])
    values = np.array([[(i + 1) * 10.0**j * np.exp(-1j * omega) for j in range(len(inputs))] for i in range(len(units))])
    return FrequencyResponse(omega, values, inputs, ("a", "b", "c")[: len(units)], units, per, ("sliding: clutch k",))


def test_rows_are_picked_by_name() -> None:
    found = response()
    for i, output in enumerate("abc"):
        for j, given in enumerate("uv"):
            assert (found[output, given] == found.values[i, j]).all()
    assert (response(inputs=("u",))["b"] == response(inputs=("u",)).values[1, 0]).all()
    with pytest.raises(ArgumentError, match=r"choose an input: response\['b', input\], one of u, v"):
        found["b"]
    for key, said in ((("b", "w"), "the response has no 'w'"), ("w", "the response has no 'w'")):
        with pytest.raises(NameLookupError, match=said):
            found[key]  # type: ignore[index]
    for wrong in (("b",), ("b", "u", "v")):
        with pytest.raises(ArgumentError, match=r"expected response\[output\] or response\[output, input\]"):
            found[wrong]  # type: ignore[index]
    assert found.frequencies == pytest.approx(found.omega / (2 * np.pi))
    assert str(found) == (
        f"Response of a, b, c to u, v: 4 frequencies from {0.5 / np.pi:.6g} to {4 / np.pi:.6g} Hz\nOperating point: sliding: clutch k."
    )
    with pytest.raises(ArgumentError, match="the response is not that of a System"):
        found.sensitivity("x")
    again = pickle.loads(pickle.dumps(found))
    assert again.values == pytest.approx(found.values)
    assert str(again) == str(found)


def test_the_table_has_magnitudes_and_unwrapped_phases() -> None:
    table = response().to_dataframe()
    assert table.index.to_numpy() == pytest.approx(np.array([1.0, 2, 4, 8]) / (2 * np.pi))
    assert table["b", "v", "magnitude"].to_numpy() == pytest.approx(np.full(4, 20.0))
    assert table["c", "u", "phase, deg"].diff().dropna().abs().max() <= 180
    assert np.exp(1j * np.radians(table["c", "u", "phase, deg"])).to_numpy() == pytest.approx(
        np.exp(-1j * np.array([1.0, 2, 4, 8]))
    )


def test_the_plot_has_a_diagram_per_unit_and_one_for_the_phases() -> None:
    axes = response().plot()
    assert [ax.get_ylabel() for ax in axes] == ["amplitude, rad/s per N·m", "amplitude, N·m per N·m", "phase, deg"]
    assert [ax.get_xlabel() for ax in axes] == ["", "", "frequency, Hz"]
    assert [[line.get_label() for line in ax.lines] for ax in axes] == [
        ["a / u", "a / v", "c / u", "c / v"], ["b / u", "b / v"], ["a / u", "a / v", "b / u", "b / v", "c / u", "c / v"],
    ]  # fmt: skip
    colours = {line.get_label(): line.get_color() for line in axes[2].lines}
    assert list(colours.values()) == list(COLOURS[:6])
    for ax in axes[:2]:
        for line in ax.lines:
            assert line.get_color() == colours[line.get_label()]
            i, j = "abc".index(line.get_label()[0]), "uv".index(line.get_label()[-1])
            assert line.get_ydata() == pytest.approx(np.full(4, (i + 1) * 10.0**j))
            assert line.get_xdata() == pytest.approx(np.array([1.0, 2, 4, 8]) / (2 * np.pi))
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
        assert ax.get_legend() is not None
    assert (axes[2].get_xscale(), axes[2].get_yscale()) == ("log", "linear")
    assert axes[0].get_title() == "Response to u, v"
    axes[0].set_xlim(0.5, 7.0)
    assert [ax.get_xlim() for ax in axes] == [(0.5, 7.0)] * 3
    heights = [ax.get_gridspec().get_height_ratios() for ax in axes]
    assert heights[0] == [2, 2, 1]
    assert tuple(axes[0].figure.get_size_inches()) == pytest.approx((8, 1.9 + 2 * 3.6))
    three = response(inputs=("u", "v", "w"), per="").plot()
    assert three[0].get_title() == "Response to 3 inputs"
    assert three[0].get_ylabel() == "amplitude, rad/s"
    one = response(("",), ("u",)).plot()
    assert one[0].get_ylabel() == "amplitude, 1 per N·m"
    assert [line.get_label() for line in one[0].lines] == ["a"]


@pytest.mark.parametrize(
    ("low", "high", "step"), [(0, -80, None), (0, -100, 90), (0, -440, 90), (10, -600, 180), (0, -1200, None)]
)
def test_phases_are_marked_at_right_angles(low: float, high: float, step: float | None) -> None:
    """Every 90 degrees, beyond 500 every 180; where the range is small or huge, as matplotlib does."""
    phase = np.radians(np.linspace(low, high, 60))
    values = np.exp(1j * phase)[None, None] * np.array([1.0, 2.0])[:, None, None]
    found = FrequencyResponse(np.arange(1.0, 61.0), values, ("u",), ("y", "z"), ("rad", "m"))
    ticks = found.plot()[-1].get_yticks()
    if step is None:
        assert set(np.diff(ticks)) != {90.0}
    else:
        assert (ticks % 90 == 0).all()
        assert np.diff(ticks) == pytest.approx(np.full(len(ticks) - 1, step))
        bottom, top = found.plot()[-1].get_ylim()
        assert ticks[0] - bottom < 90
        assert ticks[0] >= bottom - 1
        assert ticks[-1] <= top
