"""Arguments that are taken and refused: each check at its limits, and the words of its message."""

from __future__ import annotations

from collections import UserDict
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy

from gearlib import arguments
from gearlib.errors import ArgumentError, NameLookupError
from gearlib.recent import recent
from gearlib.records import altered
from gearlib.stored_result import load_result

HUGE = 10**5000


@dataclass(frozen=True)
class Point:
    x: float
    y: float = 2.0


class Failing:
    """Whose every use fails."""

    def _fail(self, *_: Any) -> Any:
        raise RuntimeError

    __array__ = __float__ = __len__ = __iter__ = __repr__ = __fspath__ = _fail


def test_values_are_quoted_in_a_line_of_a_hundred_letters_at_most() -> None:
    assert arguments.shown("a" * 98) == repr("a" * 98)
    assert arguments.shown("a" * 99) == f"'{'a' * 79} ..."
    assert arguments.shown(np.eye(2)) == "array([[1., 0.], [0., 1.]])"
    assert arguments.shown(HUGE) == "a number of very many digits"
    assert arguments.shown(Failing()) == "a Failing that cannot be printed"


@pytest.mark.parametrize("value", [1, 2.5, -0.0, np.float32(3), np.int64(4), Fraction(1, 3), sympy.Rational(1, 2), 1.7e308])
def test_numbers_of_any_kind_are_real(value: Any) -> None:
    assert arguments.is_real(value)
    assert arguments.real("gain", value) == float(value)
    assert type(arguments.real("gain", value)) is float
    assert arguments.reals("gain", [value, 1], "numbers").tolist() == [float(value), 1.0]


@pytest.mark.parametrize("value", [True, np.bool_(1), "3", None, 1j, np.inf, -np.inf, np.nan, np.float64("nan"), 10**400,
                                   pytest.param(HUGE, id="huge"),
                                   np.timedelta64(3, "s"), Decimal(3), [1.0], Failing()])  # fmt: skip
def test_what_is_no_finite_real_number_is_refused(value: Any) -> None:
    assert not arguments.is_real(value)
    with pytest.raises(ArgumentError, match=r"gain is .*; expected a finite number$"):
        arguments.real("gain", value)
    with pytest.raises(ArgumentError, match=r"frames is .*; expected a whole number, 2 or more$"):
        arguments.whole("frames", value, 2)
    if not isinstance(value, list | bool | np.bool_):  # of which an array makes numbers
        with pytest.raises(ArgumentError, match=r"omega is .*; expected some numbers$"):
            arguments.reals("omega", [value, 1.0], "some numbers")


def test_what_is_masked_is_no_number() -> None:
    """What is behind a mask is not data."""
    for dtype in (float, int, complex):
        values = np.ma.masked_array(np.array([1, 2, 999], dtype), mask=[False, False, True])
        if dtype is not complex:
            assert arguments.reals("y", values[:2], "numbers").tolist() == [1.0, 2.0]
            with pytest.raises(ArgumentError, match=r"^y is masked_array\(.*; expected numbers$"):
                arguments.reals("y", values, "numbers")
        assert arguments.complexes("z", values[:2], "numbers").tolist() == [1.0, 2.0]
        with pytest.raises(ArgumentError, match=r"^z is masked_array\(.*; expected numbers$"):
            arguments.complexes("z", values, "numbers")


def test_whole_numbers_from_a_least_one_on() -> None:
    assert [arguments.whole("n", value, 2) for value in (2, np.int8(3))] == [2, 3]
    assert type(arguments.whole("n", np.int8(3), 2)) is int
    for value in (1, 2.0, 2.5):
        with pytest.raises(ArgumentError, match=f"n is {value}; expected a whole number, 2 or more"):
            arguments.whole("n", value, 2)
    with pytest.raises(ArgumentError, match=r"n is 1; expected pairs$"):
        arguments.whole("n", 1, 2, "pairs")


def test_flags_are_true_or_false_or_one_or_zero() -> None:
    assert [arguments.flag("sparse", value) for value in (True, False, np.True_, np.False_, 1, 0)] == [True, False] * 3
    assert type(arguments.flag("sparse", np.True_)) is bool
    for value in (2, -1, 1.0, None, "yes", np.int64(1), np.array([True])):
        with pytest.raises(ArgumentError, match=r"sparse is .*; expected True or False"):
            arguments.flag("sparse", value)


def test_what_a_function_returned_is_finite() -> None:
    assert arguments.finite(lambda: "it returned", np.array(2)) == 2.0
    for value, said in (
        (np.inf, "it returned inf; expected a finite number"), (HUGE, "expected a number of ordinary size"),
        ("x", "it returned 'x'; expected a number$"), (Failing(), "cannot be printed; expected a number$"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError, match=said):
            arguments.finite(lambda: "it returned", value)


@pytest.mark.parametrize("count", [0, 1, 9_999, 10_000, 20_000])
def test_all_numbers_of_an_array_are_finite_or_one_is_not(count: int) -> None:
    x = np.full(count, 1e200)
    assert arguments.all_finite(x)
    for bad in (np.nan, np.inf, -np.inf):
        for place in {0, count - 1} if count else ():
            x[place] = bad
            assert not arguments.all_finite(x)
            x[place] = 1.0


def test_complex_numbers() -> None:
    assert arguments.complexes("z", [[1, 2j], [Fraction(1, 2), np.complex64(1 + 1j)]], "z").tolist() == [[1, 2j], [0.5, 1 + 1j]]
    for wrong in ([1.0, complex(np.nan, 0)], [complex(0, np.inf)], ["1"], Failing(), [True]):
        with pytest.raises(ArgumentError, match=r"z is .*; expected numbers"):
            arguments.complexes("z", wrong, "numbers")


@pytest.mark.parametrize(
    ("least", "right", "wrong", "expected"),
    [
        (1, [[3.0], [1, 2]], [[], [1.0, 1.0], [2.0, 1.0], [[1.0, 2.0]], 3.0], "an increasing sequence of finite numbers$"),
        (2, [[1.0, 1.0 + 1e-9], (0, 1, 2)], [[1.0], [], [0, 1, 1]], "an increasing sequence of two or more finite numbers$"),
    ],
)
def test_sequences_that_increase(least: int, right: list[Any], wrong: list[Any], expected: str) -> None:
    for values in right:
        assert arguments.increasing("t", values, least).tolist() == list(values)
    for values in wrong:
        with pytest.raises(ArgumentError, match=rf"t is .*; expected {expected}"):
            arguments.increasing("t", values, least)
    with pytest.raises(ArgumentError, match=r"finite numbers, s$"):
        arguments.increasing("t", [], least, ", s")


def test_names() -> None:
    assert arguments.one_name("name", "w", "load.w") == "w"
    assert arguments.one_of("side", "left", ("left", "right")) == "left"
    assert arguments.name_list("held", ("a", "b"), "c") == ["a", "b"]
    assert arguments.name_list("held", (n for n in "ab"), "c") == ["a", "b"]
    for call, said in (
        (lambda: arguments.one_name("name", 3, "load.w"), r"name is 3; expected a name, such as 'load\.w'$"),
        (lambda: arguments.one_of("side", "up", ("left", "right")), "side is 'up'; expected 'left', 'right'$"),
        (lambda: arguments.one_of("side", ["left"], ("left", "right")), r"side is \['left'\]"),
        (lambda: arguments.name_list("held", "a", "c"), r"held is 'a'; expected a list of names, such as \['a'\]$"),
        (lambda: arguments.name_list("held", b"a", "c"), r"held is b'a'; expected a list of names, such as \['c'\]$"),
        (lambda: arguments.name_list("held", 3, "c"), r"held is 3; expected a list of names, such as \['c'\]$"),
        (lambda: arguments.name_list("held", Failing(), "c"), r"expected a list of names, such as \['c'\]$"),
    ):
        with pytest.raises(ArgumentError, match=said):
            call()
    with pytest.raises(NameLookupError, match=r"3 is not a name; names are strings, such as 'c' \(in held\)$"):
        arguments.name_list("held", ["a", 3], "c")


def test_mappings() -> None:
    assert arguments.by_name("torques", None, "") == {}
    assert arguments.by_name("torques", UserDict({"a": 1}), "") == {"a": 1}
    for wrong in (3, [("a", 1)], "a"):
        with pytest.raises(ArgumentError, match=r"torques is .*; expected paths$"):
            arguments.by_name("torques", wrong, "paths")
    with pytest.raises(NameLookupError, match=r"3 is not a name; names are strings, such as 'load\.w' \(in torques\)$"):
        arguments.by_name("torques", {"a": 1, 3: 2}, "paths")


@pytest.mark.parametrize("wrong", [3, "", b"r.mat", "a\0b", None, Failing(), "\ud800"])
def test_what_is_no_path(wrong: Any) -> None:
    with pytest.raises(ArgumentError, match=r"path is .*; expected the path of a file, such as 'r\.mat'$"):
        arguments.as_path("path", wrong)
    with pytest.raises(ArgumentError, match="path is"):
        load_result(wrong)


def test_paths() -> None:
    assert arguments.as_path("path", "run/r.mat") == arguments.as_path("path", Path("run/r.mat")) == Path("run/r.mat")


def test_axes_are_as_many_as_are_drawn_into() -> None:
    _, both = plt.subplots(2)
    arguments.check_axes(both[0], 1)
    arguments.check_axes(both, 2)
    arguments.check_axes(list(both), 2)
    for wrong, count, said in (
        (both, 1, "expected matplotlib Axes$"),
        ([both[0]], 1, "expected matplotlib Axes$"), (both[:1], 1, "expected matplotlib Axes$"),
        (3, 1, "axes is 3; expected matplotlib Axes$"),
        (both[0], 2, r"expected 2 matplotlib"),
        (both[:1], 2, r"expected 2 matplotlib Axes, such as those of plt\.subplots\(2\)$"), ([both[0], 3], 2, "expected 2"),
        (Failing(), 2, "axes is a Failing"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError, match=said):
            arguments.check_axes(wrong, count)
    with pytest.raises(ArgumentError, match="ax is 3"):
        arguments.check_axes(3, 1, "ax")
    plt.close("all")


def test_the_last_results_are_kept_and_no_more() -> None:
    known: dict[int, int | None] = {}
    made: list[int] = []

    def get(key: int, most: int) -> int | None:
        return recent(known, key, lambda: made.append(key), most)  # type: ignore[func-returns-value]

    for key in (1, 2, 1, 2, 3, 3, 1):
        get(key, 2)
    assert made == [1, 2, 3, 1]  # also of what is None; with a third, the first two are forgotten
    assert sorted(known) == [1, 3]


def test_a_record_is_altered_in_fields_that_it_has() -> None:
    found = altered(Point(1.0), y=3.0)
    assert (found.x, found.y) == (1.0, 3.0)
    with pytest.raises(TypeError, match=r"Point has no fields w, z$"):
        altered(Point(1.0), z=1.0, w=2.0)
