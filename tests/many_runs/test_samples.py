"""What varies in a sweep, in every form, and the results that belong to it: of arrays that are written down."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas
import pytest

import gearlib as gl
from gearlib.errors import ArgumentError, GearlibError, NameLookupError
from gearlib.files.sweep_files import StoredArray
from gearlib.many_runs.runs import Runs
from gearlib.many_runs.samples import Samples, as_samples, rows
from gearlib.many_runs.tracking import followed, nearest_first
from gearlib.many_runs.work import ManyRows, Row, Work, blank, done, first_of, put, reduced

TABLES = [gl.Table([0, 1], [0, k]) for k in (1.0, 2.0)]


def test_columns_and_what_is_fixed() -> None:
    found = as_samples({"a": [1, 2, 3], "b": 5, "torque": TABLES[0], "c": np.array([4.0, 5.0, 6.0])})
    assert (found.shape, len(found), found.names) == ((3,), 3, ["a", "c", "b", "torque"])
    assert found.fixed == {"b": 5.0, "torque": TABLES[0]}
    assert {name: column.tolist() for name, column in found.numbers.items()} == {"a": [1, 2, 3], "c": [4, 5, 6]}
    assert list(rows(found.part(np.array([2, 0])), 2)) == [{"a": 3.0, "c": 6.0}, {"a": 1.0, "c": 4.0}]
    assert [found.place(k) for k in range(3)] == [0, 1, 2]
    nothing = as_samples({"b": 5})
    assert (len(nothing), list(rows(nothing.part(np.array([0])), 1))) == (1, [{}])
    assert list(rows({}, 3)) == [{}, {}, {}]


def test_a_grid_is_every_combination_the_last_axis_fastest() -> None:
    found = as_samples(gl.grid({"a": [1, 2], "torque": TABLES, "c": 7.0}, b=[3, 4, 5]))
    assert (found.shape, len(found), list(found.axes)) == ((2, 2, 3), 12, ["a", "torque", "b"])
    assert found.fixed == {"c": 7.0}
    listed = list(rows(found.part(np.arange(12)), 12))
    assert listed == [{"a": a, "torque": t, "b": b} for a in (1.0, 2.0) for t in TABLES for b in (3.0, 4.0, 5.0)]
    for k in range(12):
        i, j, m = found.place(k)
        assert listed[k] == {"a": [1.0, 2.0][i], "torque": TABLES[j], "b": [3.0, 4.0, 5.0][m]}
    alone = as_samples(gl.grid({"c": 7.0}))
    assert (alone.shape, alone.columns, alone.fixed) == ((1,), {}, {"c": 7.0})


def test_arrays_and_frames_are_columns() -> None:
    table = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    for given in (as_samples(table, ["a", "b"]), as_samples(pandas.DataFrame(table, columns=["a", "b"]))):
        assert {n: c.tolist() for n, c in given.columns.items()} == {"a": [1, 3, 5], "b": [2, 4, 6]}
    table[:] = 0.0
    assert given.columns["a"].tolist() == [1, 3, 5]


@pytest.mark.parametrize(
    ("given", "names", "message"),
    [
        (np.ones((3, 2)), ["a", "a"], r"names is \['a', 'a'\]; expected each name once"),
        (np.ones(3), ["a"], r"parameters has the shape \(3,\); expected an array of finite numbers of shape \(runs, 1\)"),
        (np.ones((0, 1)), ["a"], r"parameters has the shape \(0, 1\)"),
        (np.ones((2, 3)), ["a", "b"], r"shape \(2, 3\); expected .* \(runs, 2\), since there are 2 names"),
        (
            {"a": [1.0, gl.Table([0.0, 1.0], [2.0, 3.0]), "first", "second"]},
            None,
            r"parameters\['a'\] holds 'first'; expected a number",
        ),
        ({"a": [[1.0, 2.0]]}, None, r"parameters\['a'\] is \[\[1\.0, 2\.0\]\]; expected a number, or a sequence"),
        ({f"p{k}": np.ones(k + 1) for k in range(9)}, None, r"got p0 1, .*p7 8; for all combinations"),
        ({"a": []}, None, "there is no run, the sequences are empty"),
    ],
)
def test_what_is_refused(given: Any, names: Any, message: str) -> None:
    with pytest.raises(GearlibError, match=message):
        as_samples(given, names)
    with pytest.raises(ArgumentError, match="values: there is no run, those of b are empty"):
        gl.grid(a=[1.0], b=[])
    with pytest.raises(ArgumentError, match="a is given in values, and by its name; leave one of the two out"):
        gl.grid({"a": [1.0], "c": 2.0}, a=[3.0])


# ---------------------------------------------------------------- runs


def runs(samples: Samples, **changes: Any) -> Runs:
    count = len(samples)
    values = {
        "load.w": np.arange(3.0 * count).reshape(count, 3), "peak": 10.0 + np.arange(count), "shape": np.ones((count, 2, 2)),
    }  # fmt: skip
    layout = {
        "load.w": StoredArray(("time",), (3,)), "peak": StoredArray((), ()), "shape": StoredArray(("shape_0", "shape_1"), (2, 2)),
    }  # fmt: skip
    given: dict[str, Any] = {
        "values": layout, "read": values.__getitem__, "coordinates": {"time": [0.0, 0.5, 1.0]}, "done": np.ones(count, bool),
        "errors": {}, "units": {"load.w": "rad/s", "peak": "", "a": "kg", "shape": "1"}, "stats": {"runs": count},
    } | changes  # fmt: skip
    return Runs("Drive", samples, **given)


def test_runs_have_the_shape_of_what_varies() -> None:
    found = runs(
        as_samples(gl.grid(a=[1.0, 2.0], b=[3.0, 4.0, 5.0], c=7.0)), errors={4: GearlibError("no"), 1: GearlibError("n")}
    )
    assert (len(found), found.shape, list(found), found.keys()) == (
        6,
        (2, 3),
        ["load.w", "peak", "shape"],
        ["load.w", "peak", "shape"],
    )
    assert found["load.w"].shape == (2, 3, 3)
    assert found["load.w"][1, 2].tolist() == [15.0, 16.0, 17.0]
    assert found["peak"].tolist() == [[10, 11, 12], [13, 14, 15]]
    assert found["a"].tolist() == [[1, 1, 1], [2, 2, 2]]
    assert list(found.errors) == [(0, 1), (1, 1)]
    assert ("peak" in found, "a" in found, 3 in found) == (True, False, False)
    assert list(found.parameters) == ["a", "b", "c"]
    assert found.parameters["c"] == 7.0
    assert found.parameters["b"].tolist() == [[3, 4, 5], [3, 4, 5]]
    assert found.time.tolist() == [0.0, 0.5, 1.0]
    assert (found.unit("a"), found.unit("peak")) == ("kg", "")
    for call in (found.unit, found.__getitem__):
        with pytest.raises(NameLookupError, match=r"the runs have kept nothing of the name 'peek'; did you mean 'peak'"):
            call("peek")


def test_runs_say_what_they_are() -> None:
    grid = as_samples(gl.grid(a=[1.0, 2.0], b=[3.0, 4.0, 5.0]))
    assert repr(runs(grid)) == "<Runs of Drive: 2 x 3; load.w, peak, shape>"
    some = np.array([True, False, True, False, True, True])
    assert repr(runs(grid, errors={0: GearlibError("no")}, done=some)) == (
        "<Runs of Drive: 2 x 3, 1 failed, 2 not done; load.w, peak, shape>"
    )
    many = {f"v{k}": StoredArray((), ()) for k in range(10)}
    assert repr(runs(as_samples({"a": [1.0]}), values=many)) == f"<Runs of Drive: 1; {', '.join(list(many)[:8])}>"


def test_a_dataset_has_units_and_coordinates() -> None:
    plain = runs(as_samples({"a": [1.0, 2.0], "torque": TABLES, "c": 7.0}), errors={1: GearlibError("no")}).to_xarray()
    assert plain["load.w"].dims == ("run", "time")
    assert plain["shape"].dims == ("run", "shape_0", "shape_1")
    assert plain["run"].values.tolist() == [0, 1]
    assert plain["a"].attrs == {"units": "kg"}
    assert plain["time"].attrs == {"units": "s"}
    assert plain["peak"].attrs == {}
    assert (plain.attrs["model"], plain.attrs["c"], plain.attrs["failed_runs"]) == ("Drive", 7.0, 1)
    grid = runs(as_samples(gl.grid({"a": [1.0, 2.0], "torque": TABLES}))).to_xarray()
    assert grid["load.w"].dims == ("a", "torque", "time")
    assert (grid["a"].values.tolist(), grid["torque"].values.tolist()) == ([1.0, 2.0], [0, 1])
    assert "run" not in grid.coords


def test_a_table_repeats_what_has_no_history() -> None:
    layout = {"shape": StoredArray(("x", "y"), (2, 2)), "other": StoredArray(("x",), (2,))}
    found = runs(as_samples({"a": [1.0, 2.0]}), values=layout)
    with pytest.raises(ArgumentError, match=r"shape has axes of its own, for which a table has no columns"):
        found.to_dataframe()
    less = {"load.w": StoredArray(("time",), (3,)), "peak": StoredArray((), ())}
    table = runs(as_samples({"a": [1.0, 2.0]}), values=less).to_dataframe()
    assert table.index.tolist() == [0, 0, 0, 1, 1, 1]
    assert list(table) == ["a", "time", "load.w", "peak"]
    assert table["a"].tolist() == [1, 1, 1, 2, 2, 2]
    assert table["time"].tolist() == [0.0, 0.5, 1.0] * 2
    assert table["load.w"].tolist() == [0, 1, 2, 3, 4, 5]
    assert table["peak"].tolist() == [10, 10, 10, 11, 11, 11]


# ---------------------------------------------------------------- work


class Squares(Work):
    """The square of what varies; it fails where that is negative, and has another shape from 10 on."""

    def row(self, given: Any) -> Row:
        x = given["x"]
        if x < 0:
            raise GearlibError(f"{x:g} is negative")
        return Row({"square": x**2 if x < 10 else [x, x], "name": x * (1j if x == 9 else 1)}, {"time": [0.0]})

    def dimensions(self, name: str) -> tuple[str, ...]:
        return ()

    def unit(self, name: str) -> str:
        return ""

    def varied_unit(self, name: str) -> str:
        return ""

    def identity(self) -> Any:
        yield b"squares"


def test_runs_that_fail_are_named_by_their_place_and_left_open() -> None:
    chunk = done(Squares(), {"x": np.array([-1.0, 2.0, 12.0, -3.0, 9.0, 4.0])}, 6)
    assert {k: str(e).split(" in this")[0] for k, e in chunk.errors.items()} == {
        0: "-1 is negative", 2: "square has the shape (2,)", 3: "-3 is negative", 4: "name is complex",
    }  # fmt: skip
    assert np.isnan(chunk.values["square"]).tolist() == [True, False, True, True, True, False]
    assert chunk.values["square"][[1, 5]].tolist() == [4.0, 16.0]
    assert np.isnan(chunk.values["name"]).tolist() == np.isnan(chunk.values["square"]).tolist()  # whole rows, or nothing
    assert (chunk.coordinates, chunk.warned) == ({"time": [0.0]}, ())
    assert 0.0 <= chunk.seconds < 10.0


def test_rows_are_put_in_their_places_completely_or_not_at_all() -> None:
    first = {"a": np.ones(2), "b": 1j, "c": 3}
    values = blank(first, 4)
    assert {n: (v.shape, v.dtype.kind) for n, v in values.items()} == {"a": ((4, 2), "f"), "b": ((4,), "c"), "c": ((4,), "f")}
    assert all(np.isnan(v).all() for v in values.values())
    many = {"a": np.array([[1.0, 2.0], [3.0, 4.0]]), "b": np.array([5j, 6.0]), "c": np.array([7, 8])}
    put(values, {}, np.array([3, 1]), ManyRows(many, {}))
    assert values["a"][[3, 1]].tolist() == [[1, 2], [3, 4]]
    assert np.isnan(values["c"]).tolist() == [True, False, True, False]
    assert first_of(ManyRows(many, {"time": 0})).values["a"].tolist() == [1.0, 2.0]
    row = Row({"a": 1})
    assert first_of(row) is row
    good, coordinates = {"a": np.zeros(2), "b": 1j, "c": 0.0}, {"omega": [1.0, 2.0], "output": ("x", "y")}
    for wrong, along, message in (
        (good | {"c": [1.0]}, {}, r"c has the shape \(1,\) in this run and \(\) in the first one"),
        (good | {"a": np.zeros(3)}, {}, r"a has the shape \(3,\) in this run and \(2,\) in the first one"),
        (good | {"c": 1j}, {}, "c is complex in this run and was real in the first one"),
        (good | {"A": 0.0}, {}, "A is there in this run and not in the first one"),
        ({"b": 1j, "c": 0.0}, {}, "a is there in the first run and not in this one"),
        (
            good,
            {"omega": [1.0, 2.5], "output": ("x", "y")},
            "the axis omega has other values in this run than in the first one",
        ),
        (good, {"output": ("y", "x")}, "the axis output has other values in this run than in the first one"),
        (good, {"time": [1.0]}, "the axis time has other values in this run than in the first one"),
    ):
        with pytest.raises(ArgumentError, match=f"{message}; all must be alike"):
            put(values, coordinates, 0, Row(wrong, along))
        assert np.isnan(values["a"][0]).all()
        assert np.isnan(values["c"][0])
    with pytest.raises(ArgumentError, match=r"a has the shape \(3,\) in this run and \(2,\) in the first one"):
        put(values, {}, np.array([0, 2]), ManyRows(many | {"a": np.zeros((2, 3))}, {}))
    put(values, coordinates, 0, Row(good, {"omega": np.array([1.0, 2.0]), "output": ["x", "y"]}))
    assert [v[0].tolist() for v in values.values()] == [[0.0, 0.0], 1j, 0.0]


def test_functions_return_numbers_or_are_refused_by_name() -> None:
    found = reduced({"n": len, "flags": lambda r: [True, False], "z": lambda r: 1j}, [1, 2])
    assert {n: v.tolist() for n, v in found.items()} == {"n": 2, "flags": [True, False], "z": 1j}
    with pytest.raises(ArgumentError, match=r"reduce\['text'\] returned .*'no'.*; expected a number or an array of numbers"):
        reduced({"text": lambda r: "no"}, None)
    with pytest.raises(ArgumentError, match=r"reduce\['bad'\] raised ZeroDivisionError: division by zero"):
        reduced({"bad": lambda r: 1 / 0}, None)


# ---------------------------------------------------------------- modes that are followed


def test_each_run_follows_its_nearest_neighbour_in_parts_of_the_ranges() -> None:
    """Two parameters of very different size; an axis along which nothing varies does not count, runs that are left out neither."""
    samples = as_samples({"a": [0.0, 1.0, 0.0, 1.0], "b": [0.0, 1e6, 1.2e6, 0.9e6], "c": [5.0] * 4})
    assert nearest_first(samples, np.arange(4)) == [(0, -1), (2, 0), (1, 2), (3, 1)]
    pairs = nearest_first(samples, np.array([0, 1, 3]))
    assert pairs == [(0, -1), (3, 0), (1, 3)]
    assert nearest_first(samples, np.array([], int)) == []
    square = as_samples(gl.grid(a=[0.0, 1.0], b=[0.0, 1.0]))
    assert nearest_first(square, np.arange(4)) == [(0, -1), (1, 0), (2, 0), (3, 1)]  # of two as near the earlier one
    rng = np.random.default_rng(2)
    cloud = as_samples({"a": rng.uniform(size=30), "b": 1e9 * rng.uniform(size=30)})
    found = nearest_first(cloud, np.arange(30))
    place = np.column_stack([c / np.ptp(c) for c in cloud.columns.values()])
    seen = [found[0][0]]
    for run, before in found[1:]:
        assert before in seen
        rest = [k for k in range(30) if k not in seen]
        gaps = np.linalg.norm(place[rest][:, None] - place[seen][None], axis=2)
        assert np.linalg.norm(place[run] - place[before]) == pytest.approx(gaps.min())
        seen.append(run)
    assert sorted(seen) == list(range(30))


def test_a_mode_that_comes_and_goes_keeps_a_column() -> None:
    """Shapes along the axes: the second run lacks the first mode, the third has all, in another order of frequencies."""
    samples = as_samples({"a": [0.0, 1.0, 2.0]})
    nothing = np.nan + 0j
    values = np.array([[-1 + 1j, -1 + 5j, nothing], [-1 + 5j, nothing, nothing], [-1 + 2j, -1 + 4j, -1 + 9j]])
    unit = np.eye(3, dtype=complex)
    shapes = np.full((3, 3, 3), nothing)
    shapes[0, :, :2], shapes[1, :, :1], shapes[2] = unit[:, [0, 1]], unit[:, [1]], unit[:, [1, 0, 2]]
    found = followed(samples, values, shapes)
    expected = [[-1 + 1j, -1 + 5j, nothing], [nothing, -1 + 5j, nothing], [-1 + 4j, -1 + 2j, -1 + 9j]]
    np.testing.assert_array_equal(found.eigenvalues, expected)
    np.testing.assert_array_equal(found.numbers, [[0, 1, np.nan], [np.nan, 0, np.nan], [1, 0, 2]])
