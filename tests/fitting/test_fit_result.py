"""What a fit says: of numbers that are written down."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from gearlib.errors import NameLookupError
from gearlib.fitting.fit_result import Fit, FittedSeries
from gearlib.fitting.identifiability import Identifiability, identifiability


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    plt.close("all")


def seen(slopes: Any, residuals: Any, names: tuple[str, ...], known: bool = True) -> Identifiability:
    return identifiability(np.array(slopes, float), np.array(residuals, float), names, known)


def series(name: str = "load.w", count: int = 4, complex_: bool = False) -> FittedSeries:
    measured = (1.0 + np.arange(count)) * (1 + 1j if complex_ else 1)
    return FittedSeries(name, "rad/s", np.arange(count) + 1.0, "time, s", measured, 1.5 * measured, 0.1)


def fitted(**changes: Any) -> Fit:
    names = ("shaft.c", "shaft.d")
    given: dict[str, Any] = {
        "system": "Drive", "names": names, "numbers": np.array([520.0, 1.6]), "units": ("N.m/rad", "N.m.s/rad"),
        "bounds": np.array([[100.0, 1e4], [0.01, 10.0]]), "begin": np.array([400.0, 2.0]),
        "covariance": np.array([[25.0, 0.3], [0.3, 0.04]]), "identifiability": seen([[30, 0], [0, 50], [0, 0]], [1, 2, 2], names),
        "series": (series(), series("motor.w", 3, True)), "residuals": np.array([3.0, 4.0, 0.0]), "experiments": 1,
        "evaluations": 7, "converged": True, "noise_given": True,
    }  # fmt: skip
    return Fit(**(given | changes))


def words(found: Fit) -> list[str]:
    """Lines without their spaces; a table of parameters has its columns below their heads."""
    lines = str(found).splitlines()
    head, *rows = lines[1:4]
    assert {len(row) for row in rows} == {len(head)}
    assert {row.rindex(" .. ") > head.index("bounds") - 12 for row in rows} == {True}
    assert len({row.index("  N.m") for row in rows}) == 1
    return [" ".join(line.split()) for line in lines]


def test_a_fit_in_words() -> None:
    """What is left is the root of the sum of squares over the numbers more than parameters: 5, of three numbers and two."""
    assert words(fitted()) == [
        "Fit of 2 parameters of Drive to 3 numbers from 1 experiment: 7 evaluations",
        "parameter value +- standard error unit bounds",
        "shaft.c 520 5 N.m/rad 100 .. 10000",
        "shaft.d 1.6 0.2 N.m.s/rad 0.01 .. 10",
        "What is left is 5 times the noise that was given.",
        "Identifiable: the data determines every direction (singular values 50, 30).",
    ]
    text = str(fitted(noise_given=False, converged=False, evaluations=2, experiments=2, approximate="it jumps"))
    assert text.splitlines()[0].endswith("from 2 experiments: 2 evaluations")
    assert text.splitlines()[1] == "The search had not ended when the evaluations ran out; give more, or begin nearer."
    assert "What is left is 500 % of the spread." in text
    assert text.splitlines()[-1] == "Derivatives of histories are differences of runs: it jumps."
    as_many = {"residuals": np.array([3.0, 4.0]), "covariance": np.full((2, 2), np.nan)}  # numbers as parameters
    assert "is left" not in str(fitted(**as_many))
    unknown = words(fitted(**as_many, noise_given=False))
    assert unknown[2] == "shaft.c 520 unknown N.m/rad 100 .. 10000"
    assert unknown[4] == "No number is left over to estimate the noise from: for standard errors, give noise=...."
    one = fitted(
        names=("c",), numbers=np.ones(1), units=("1",), bounds=np.array([[0.0, 2.0]]), covariance=np.eye(1),
        residuals=np.ones(1), identifiability=seen([[3.0]], [0.0], ("c",)),
    )  # fmt: skip
    assert str(one).startswith("Fit of 1 parameter of Drive to 1 number from 1 experiment: ")


def test_what_is_not_determined_in_words() -> None:
    names = ("shaft.c", "shaft.d")
    open_ = fitted(
        covariance=np.array([[np.inf, np.nan], [np.nan, 0.04]]),
        identifiability=seen([[0, 0], [0, 50], [0, 0]], [1, 2, 2], names),
    )
    assert words(open_)[2:] == [
        "shaft.c 520 not determined N.m/rad 100 .. 10000",
        "shaft.d 1.6 0.2 N.m.s/rad 0.01 .. 10",
        "What is left is 3.54 times the noise that was given.",  # one direction of two takes one number of three
        "Not identifiable: the data determines 1 of 2 directions (singular values 50, 0).",
        "Not determined: shaft.c +1.00 (in parts of their ranges).",
    ]
    assert not open_.identifiable
    assert open_.standard_errors == {"shaft.c": np.inf, "shaft.d": 0.2}
    assert np.isnan(open_.correlation[0]).all()


def test_lines_are_a_hundred_columns_wide_at_most() -> None:
    whole = f"Derivatives of histories are differences of runs: {'x' * 49}."
    assert len(whole) == 100
    assert str(fitted(approximate="x" * 49)).splitlines()[-1] == whole
    long = str(fitted(approximate="many words " * 12 + "end")).splitlines()
    assert max(map(len, long)) <= 100
    assert long[-1].startswith("  ")
    assert long[-2].startswith("Derivatives")


def test_numbers_by_name() -> None:
    found = fitted()
    assert (found["shaft.c"], found["shaft.d"]) == (520.0, 1.6)
    assert found.values == {"shaft.c": 520.0, "shaft.d": 1.6}
    assert found.standard_errors == {"shaft.c": 5.0, "shaft.d": 0.2}
    assert found.correlation == pytest.approx(np.array([[1.0, 0.3], [0.3, 1.0]]))
    with pytest.raises(NameLookupError, match=r"'shaft\.k' was not free; did you mean"):
        found["shaft.k"]
    table = found.to_dataframe()
    assert table.loc["shaft.d"].tolist() == [1.6, 0.2, "N.m.s/rad", 0.01, 10.0, 2.0]
    assert series().residuals.tolist() == [0.5, 1.0, 1.5, 2.0]


@pytest.mark.parametrize(
    ("value", "held"),
    [
        (100.0, True),
        (100.0 + 0.9e-4, True),
        (100.0 + 1.1e-4, False),
        (200.0 - 1.9e-4, False),
        (200.0 - 0.9e-4, True),
        (150, False),
    ],
)
def test_a_bound_is_reached_within_a_millionth(value: float, held: bool) -> None:
    """Of the range, or of the value where that is less."""
    found = fitted(numbers=np.array([value, 1.6]), bounds=np.array([[100.0, 200.0], [1.6 - 2e-6, 100.0]]))
    assert found.at_bounds == (("shaft.c",) if held else ())
    assert ("at its bound" in str(found)) == held


@pytest.mark.parametrize(("error", "held"), [(0.05, False), (0.2, True), (np.inf, False), (np.nan, False)])
def test_a_value_that_tends_to_zero_is_at_its_bound_within_a_millionth_of_its_error(error: float, held: bool) -> None:
    """One that the data does not determine has no error that counts."""
    found = fitted(
        numbers=np.array([1e-7, 1.6]), bounds=np.array([[0.0, 1.0], [0.01, 10.0]]), covariance=np.diag([error**2, 0.04])
    )
    assert found.at_bounds == (("shaft.c",) if held else ())
    on_it = fitted(
        numbers=np.array([0.0, 1.6]), bounds=np.array([[0.0, 1.0], [0.01, 10.0]]), covariance=np.diag([error**2, 0.04])
    )
    assert on_it.at_bounds == ("shaft.c",)


def test_series_are_drawn_below_each_other() -> None:
    """Complex ones by their size over logarithmic scales; few values as marks; six at most."""
    axes = fitted().plot()
    assert len(axes) == 2
    measured, predicted = axes[0].lines
    assert (measured.get_linestyle(), predicted.get_linestyle(), predicted.get_marker()) == ("None", "-", "None")
    assert measured.get_ydata().tolist() == [1.0, 2.0, 3.0, 4.0]
    assert predicted.get_ydata().tolist() == [1.5, 3.0, 4.5, 6.0]
    assert (axes[0].get_xscale(), axes[0].get_ylabel(), axes[0].get_xlabel()) == ("linear", "load.w, rad/s", "time, s")
    assert axes[1].lines[0].get_ydata() == pytest.approx(np.sqrt(2) * np.arange(1, 4))
    assert (axes[1].get_xscale(), axes[1].get_yscale(), axes[1].lines[1].get_marker()) == ("log", "log", "x")
    assert axes[0].get_legend() is not None
    assert axes[1].get_legend() is None
    assert len(fitted(series=tuple(series() for _ in range(8))).plot()) == 6
    single = fitted(series=(series(),)).plot()
    assert [line.get_label() for line in single.lines] == ["measured", "fitted"]
    assert fitted(series=(series(),)).plot(axes=single) is single


# ---------------------------------------------------------------- identifiability


def test_directions_are_those_of_the_singular_values() -> None:
    """Each parameter alone, and two that act together: errors are those of least squares."""
    rng = np.random.default_rng(4)
    slopes = rng.normal(size=(30, 3)) * [5.0, 20.0, 80.0]
    residuals = rng.normal(size=30)
    for known in (True, False):
        found = identifiability(slopes, residuals, ("a", "b", "c"), known)
        noise = 1.0 if known else np.sqrt((residuals**2).sum() / 27)
        assert found.complete
        assert found.open_directions == ()
        assert found.noise == pytest.approx(noise)
        assert found.covariance == pytest.approx(noise**2 * np.linalg.inv(slopes.T @ slopes))
        assert (np.diff(found.singular_values) < 0).all()
        assert np.linalg.norm(slopes @ found.directions.T, axis=0) == pytest.approx(found.singular_values)


def test_a_direction_is_determined_where_it_moves_the_data_by_more_than_the_noise() -> None:
    for size, determined in ((0.999, False), (1.001, True)):
        found = seen([[10.0, 0.0], [0.0, size], [0.0, 0.0]], [0, 0, 0], ("a", "b"))
        assert found.determined.tolist() == [True, determined]
        assert np.isfinite(found.covariance[1, 1]) == determined
        assert found.covariance[0, 0] == pytest.approx(0.01)
    estimated = seen([[10.0, 0.0], [0.0, 3.0], [0.0, 0.0], [0.0, 0.0]], [0, 0, 3.0, 3.0], ("a", "b"), known=False)
    assert estimated.noise == 3.0
    assert estimated.determined.tolist() == [True, False]


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_rounding_is_relative_to_the_largest_influence(unit: float) -> None:
    for size, count in ((1.1e-8, 2), (0.9e-8, 1), (0.0, 1)):
        found = seen(unit * np.array([[1.0, 0.0], [0.0, size]]), [0.0, 0.0], ("a", "b"), known=False)
        assert found.determined.tolist() == [True, count == 2]
        assert found.singular_values == pytest.approx([unit, unit * size])


@pytest.mark.parametrize(
    ("residuals", "noise"),
    [([3.0, 4.0], np.nan), ([3.0, 4.0, 0.0], 5.0), ([3.0, 4.0, 0.0, 12.0], 13.0 / np.sqrt(2.0)), ([0.0] * 3, 0.0)],
)
def test_noise_is_estimated_from_the_numbers_that_are_left_over(residuals: list[float], noise: float) -> None:
    slopes = np.zeros((len(residuals), 2))
    slopes[0, 0], slopes[1, 1] = 1e3, 2e3
    found = seen(slopes, residuals, ("a", "b"), known=False)
    assert found.noise == pytest.approx(noise, nan_ok=True)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx([noise / 1e3, noise / 2e3], nan_ok=True)
    assert found.complete


def test_without_noise_all_but_rounding_is_determined() -> None:
    """Fewer numbers than parameters, or as many: there is nothing to estimate noise and errors from, and the rest is open."""
    exact = seen([[1.0, 0.0], [0.0, 1e-7]], [0.0, 0.0], ("a", "b"), known=False)
    assert np.isnan([exact.noise, *exact.covariance.flat]).all()
    assert exact.determined.tolist() == [True, True]
    rounding = seen([[1.0, 0.0], [0.0, 1e-9]], [0.0, 0.0], ("a", "b"), known=False)
    assert rounding.determined.tolist() == [True, False]
    assert rounding.open_directions == ({"b": 1.0},)
    single = seen([[2.0, 0.0]], [0.0], ("a", "b"), known=False)
    assert np.diag(single.covariance) == pytest.approx([np.nan, np.inf], nan_ok=True)
    few = seen([[3.0, 4.0, 0.0]], [0.5], ("a", "b", "c"))
    assert few.singular_values == pytest.approx([5.0, 0.0, 0.0])
    assert (few.determined.sum(), len(few.open_directions)) == (1, 2)
    nothing = seen([[0.0], [0.0]], [1.0, 1.0], ("a",))
    assert not nothing.complete
    assert np.isinf(nothing.covariance).all()


def test_open_directions_name_what_takes_part_the_largest_share_first() -> None:
    """With the sign of the largest, which is positive; shares of a tenth or less are not mentioned, but make no error finite."""
    direction = np.array([0.05, -0.8, 0.6, 0.0])
    direction /= np.linalg.norm(direction)
    others = np.linalg.svd(direction[None])[2][1:]
    found = seen(100 * others, np.zeros(3), ("a", "b", "c", "e"))
    (named,) = found.open_directions
    assert list(named) == ["b", "c"]
    assert named == pytest.approx({"b": 0.8, "c": -0.6}, rel=2e-3)
    assert np.isinf(np.diag(found.covariance)).tolist() == [True, True, True, False]
    assert np.isnan(found.covariance[0, 1:]).all()
    assert found.covariance[3, 3] == pytest.approx(1e-4)
