"""Results from files: of a record that is written down."""

from __future__ import annotations

import numpy as np
import pytest

from gearlib.errors import ArgumentError, NameLookupError
from gearlib.files.contents import Record
from gearlib.stored_result import StoredResult

TIME = np.array([0.0, 1.0, 3.0])
DATA = np.array([[0.0, 5.0, 9.0], [2.0, 6.0, 9.0], [6.0, 8.0, 9.0]])


def stored(**changes: object) -> StoredResult:
    given = {
        "names": ("a.w", "b.w", "c.tau", "d.w"), "columns": (0, 0, 1, 2), "signs": (1, -1, 1, 1), "units": ("rad/s", "rad/s", "N.m", ""),
        "descriptions": ("first", "second", "torque", ""), "model": "Drive", "parameters": {"J": 2.0}, "stats": {"method": "ida"},
        "events": [(0.5, "gap")],
    }  # fmt: skip
    return StoredResult(Record(TIME, DATA, **(given | changes)))  # type: ignore[arg-type]


def test_variables_by_name_with_their_signs_and_units() -> None:
    found = stored()
    assert list(found) == ["a.w", "b.w", "c.tau", "d.w"]
    assert (found["a.w"].tolist(), found["b.w"].tolist(), found["c.tau"].tolist()) == ([0, 2, 6], [0, -2, -6], [5, 6, 8])
    assert [found.unit(name) for name in found] == ["rad/s", "rad/s", "N.m", ""]
    assert ("a.w" in found, "e.w" in found, 3 in found) == (True, False, False)
    assert (found.parameters, found.stats, found.events) == ({"J": 2.0}, {"method": "ida"}, [(0.5, "gap")])
    for call in (found.__getitem__, found.unit, lambda name: found.record([name])):
        with pytest.raises(NameLookupError, match=r"the file holds no variable 'a\.v'; did you mean 'a\.w'"):
            call("a.v")


def test_values_between_samples_lie_on_a_line() -> None:
    assert stored().at(2.0) == {"a.w": 4.0, "b.w": -4.0, "c.tau": 7.0, "d.w": 9.0}
    assert stored().at(0.0)["c.tau"] == 5.0
    with pytest.raises(ArgumentError):
        stored().at(3.01)


def test_a_part_of_a_record_keeps_what_it_needs() -> None:
    """In the order asked for, each name once, with its own column, sign, unit and description."""
    part = stored().record(["d.w", "b.w", "d.w", "a.w"])
    assert part.names == ("d.w", "b.w", "a.w")
    assert part.data.shape == (3, 2)
    assert [part.history(name).tolist() for name in part.names] == [[9, 9, 9], [0, -2, -6], [0, 2, 6]]
    assert (part.units, part.descriptions, part.signs) == (("", "rad/s", "rad/s"), ("", "second", "first"), (1, -1, 1))
    assert part.model == "Drive"
    assert stored().record().names == ("a.w", "b.w", "c.tau", "d.w")


def test_a_result_says_what_it_is() -> None:
    assert repr(stored()) == "<Result: 3 samples, 0 .. 3 s, 4 variables of Drive, ida>"
    assert repr(stored(model="", stats={})) == "<Result: 3 samples, 0 .. 3 s, 4 variables of a file, ?>"
    empty = StoredResult(Record(np.empty(0), np.empty((0, 0)), (), (), (), (), ()))
    assert repr(empty) == "<Result: 0 samples, 0 variables of a file, ?>"


def test_what_needs_the_model_is_refused() -> None:
    found = stored()
    for call in (
        found.energy_balance, found.model_drawn, lambda: found.gradient({"a.w": 1.0}, ["J"]), lambda: found.sensitivity("a.w", "J"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError, match=r"a result .*from a file"):
            call()
