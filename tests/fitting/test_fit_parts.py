"""Ranges, first guesses and sizes of a fit: of numbers that are written down."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import ArgumentError, GearlibError
from gearlib.fitting import fit as parts
from gearlib.fitting.fit import Range
from gearlib.fitting.measured import MeasuredSeries, Prediction


def test_a_range_is_logarithmic_or_not() -> None:
    positive, plain = Range("c", 10.0, 1000.0, True), Range("c", -10.0, 30.0, False)
    assert positive.place(100.0) == pytest.approx(np.log(100.0))
    assert plain.place(100.0) == 100.0
    assert (positive.width, plain.width) == (pytest.approx(np.log(100.0)), 40.0)
    assert (positive.slope(7.0), plain.slope(7.0)) == (7.0, 1.0)
    for place, value in ((np.log(50.0), 50.0), (0.0, 10.0), (9.0, 1000.0)):
        assert positive.value(place) == pytest.approx(value, rel=1e-14)
    for place, value in ((5.0, 5.0), (-10.5, -10.0), (31.0, 30.0)):
        assert plain.value(place) == value
    h = 1e-6
    assert (positive.value(3.0 + h) - positive.value(3.0 - h)) / (2 * h) == pytest.approx(positive.slope(positive.value(3.0)))


@pytest.mark.parametrize(
    ("bounds", "begin"),
    [
        (Range("c", 10.0, 1000.0, True), np.log(400.0)),
        (Range("c", 400.0, 1600.0, True), np.log(800.0)),  # at a bound: the middle
        (Range("c", 100.0, 400.0, True), np.log(200.0)),
        (Range("c", -100.0, 1000.0, False), 400.0),
        (Range("c", -100.0, 400.0, False), 150.0),
        (Range("start(w)", 10.0, 1000.0, True), np.log(100.0)),
        (Range("start(w)", -1.0, 4.0, False), 1.5),
    ],
)
def test_a_first_guess_is_the_models_value_between_the_bounds(bounds: Range, begin: float) -> None:
    model: Any = SimpleNamespace(model=SimpleNamespace(parameters=SimpleNamespace(index={"a": 0, "c": 1})))
    assert parts.first_guess(bounds, model, np.array([3.0, 400.0])) == pytest.approx(begin, rel=1e-12)


def ranges(free: Any, *experiments: dict[str, float]) -> list[Range]:
    """Of a model that has any parameter."""
    model: Any = SimpleNamespace(model=SimpleNamespace(parameters=SimpleNamespace(number=lambda *_: 0)))
    return parts.ranges_of(model, free, [SimpleNamespace(given=own) for own in experiments])  # type: ignore[misc]


def test_ranges_are_logarithmic_where_both_bounds_are_positive() -> None:
    found = ranges({"c": (1, 2.5), "d": [-1.0, 2.0], "e": np.array([0.0, 2.0])}, {"a": 1.0})
    assert [(r.name, r.low, r.high, r.logarithmic) for r in found] == [
        ("c", 1.0, 2.5, True), ("d", -1.0, 2.0, False), ("e", 0.0, 2.0, False),
    ]  # fmt: skip


@pytest.mark.parametrize("bounds", [(2.0, 1.0), (1.0, 1.0), 3.0, (1.0, 2.0, 3.0), (1.0,), [[1.0, 2.0]]])
def test_bounds_are_two_numbers_the_lower_one_first(bounds: Any) -> None:
    with pytest.raises(ArgumentError, match=r"^free\['c'\] is .*; expected \(low, high\), low below high$"):
        ranges({"c": bounds})


def test_what_is_free_is_not_given_in_any_experiment() -> None:
    with pytest.raises(ArgumentError, match=r"^'c' is free, and given as 4\.0 in parameters; leave one of the two out$"):
        ranges({"a": (1.0, 2.0), "c": (1.0, 2.0)}, {"d": 3.0}, {"d": 5.0, "c": 4.0})
    with pytest.raises(ArgumentError, match=r"^free is empty; expected the parameters to find with their bounds"):
        ranges({})


@pytest.mark.parametrize(
    ("numbers", "spread"),
    [
        ([1.0, 3.0], 1.0),
        ([-1e200, 1e200], 1e200),
        ([1e-200, 3e-200], 1e-200),
        ([5.0], 5.0),
        ([-5.0, -5.0], 5.0),
        ([0.0, 0.0], 1.0),
        ([1.0, 1.0 + 4e-12], 2e-12),
        ([1.0, 1.0 + 1e-12], 1.0),  # rounding
        ([0.05] * 3, 0.05),
    ],
)
def test_the_size_of_a_series_is_its_spread_or_that_of_its_numbers(numbers: list[float], spread: float) -> None:
    assert parts.spread_of(np.array(numbers)) == pytest.approx(spread, rel=1e-3)


def series(name: str, values: Any, noise: float | None = None) -> MeasuredSeries:
    values = np.array(values)
    return MeasuredSeries(name, "1", np.arange(float(len(values))), "", values, noise)


def test_residuals_are_sized_by_their_noise_or_by_their_spread() -> None:
    """A complex value is two residuals."""
    own = [series("a", [1.0, 3.0, 1.0, 3.0], 0.1), series("b", [1.0 + 2j, 3.0], 0.2)]
    sizes, known = parts.residual_sizes(own, {"a": 7.0})
    assert (sizes.tolist(), known) == ([0.1] * 4 + [0.2] * 4, True)
    given = [series("a", [1.0, 3.0]), series("b", [1.0, 5.0])]
    sizes, known = parts.residual_sizes(given, {"a": 7.0, "b": 0.5})
    assert (sizes.tolist(), known) == ([7.0, 7.0, 0.5, 0.5], True)
    sizes, known = parts.residual_sizes(given, {})
    assert (sizes.tolist(), known) == ([1.0, 1.0, 2.0, 2.0], False)


def test_noise_is_given_for_all_series_or_for_none() -> None:
    given = [series("a", [1.0, 3.0]), series("b", [1.0, 5.0])]
    for some, missing in (({"a": 7.0}, "b"), ({"b": 7.0}, "a")):
        with pytest.raises(ArgumentError, match=rf"^the noise of {missing} is not given, that of others is; give all, or none"):
            parts.residual_sizes(given, some)


def evaluator(**changes: Any) -> tuple[parts.FitResiduals, list[Any]]:
    """Of two experiments that predict the parameters themselves, a twice and a times b; and what they were asked for."""
    asked: list[Any] = []

    def first(system: Any, free: Any, exact: bool) -> Prediction:
        asked.append(("first", dict(free), exact))
        return Prediction([np.array([2.0 * free["a"]])], [np.array([[2.0, 0.0]])])

    def second(system: Any, free: Any, exact: bool) -> Prediction:
        asked.append(("second", dict(free), exact))
        a, b = free["a"], free["b"]
        if a > 90.0:
            raise GearlibError("too large")
        return Prediction([np.array([a * b * 1j])], [np.array([[0.0, 0.0], [b, a]])], "it jumps")

    given: dict[str, Any] = {
        "system": None,
        "experiments": [SimpleNamespace(predicted=first), SimpleNamespace(predicted=second)],
        "ranges": [Range("a", 1.0, 100.0, True), Range("b", -5.0, 5.0, False)],
        "names": ["u", "v", "v"], "measured": np.array([1.0, 0.5, 2.0]), "sizes": np.array([0.5, 0.1, 4.0]),
    }  # fmt: skip
    return parts.FitResiduals(**given | changes), asked


def test_residuals_and_their_derivatives_are_computed_once_at_each_point() -> None:
    """In parts of the noise, with respect to the places in the ranges; without exact derivatives where they are missing."""
    told: list[float] = []
    task, asked = evaluator(tell=lambda part, seconds: told.append(part), most=2)
    place = np.array([np.log(3.0), -2.0])
    residuals, slopes = task.residuals(place), task.jacobian(place)
    assert residuals == pytest.approx([(6.0 - 1.0) / 0.5, (0.0 - 0.5) / 0.1, (-6.0 - 2.0) / 4.0])
    assert slopes == pytest.approx(np.array([[2.0 * 3.0 / 0.5, 0.0], [0.0, 0.0], [-2.0 * 3.0 / 4.0, 3.0 / 4.0]]))
    assert asked == [
        ("first", {"a": pytest.approx(3.0), "b": -2.0}, True),
        ("second", {"a": pytest.approx(3.0), "b": -2.0}, True),
    ]
    assert task.count == 1
    task.jacobian(place + 0.1)
    assert [exact for _, _, exact in asked[2:]] == [True, False]
    task.residuals(place)
    assert task.count == 3
    assert told == [0.5, 1.0, 1.0]
    assert task.approximate == {1: "it jumps"}


def test_a_point_at_which_an_experiment_fails_is_infinitely_far() -> None:
    task, _ = evaluator()
    assert task.residuals(np.array([np.log(95.0), 1.0])).tolist() == [np.inf] * 3
    with pytest.raises(GearlibError, match="too large"):
        task.at(np.array([np.log(95.0), 1.0]))


@pytest.mark.parametrize(("size", "name"), [(1e-149, ""), (1e-151, "u"), (1e-300, "u")])
def test_residuals_whose_squares_overflow_are_refused(size: float, name: str) -> None:
    task, _ = evaluator(sizes=np.array([size, 0.1, 4.0]))
    place = np.array([np.log(1.0), 1.0])
    if not name:
        assert np.isfinite(task.residuals(place)).all()
        return
    said = rf"^u is predicted as 2 and measured as 1; in units of its noise, {size:.3g}, the difference or its derivative is not below 1e"
    with pytest.raises(ArgumentError, match=said):
        task.at(place)
