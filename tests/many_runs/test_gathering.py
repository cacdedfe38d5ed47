"""Runs as they come in: when they are written, what is told of them, and what makes a file that of another sweep."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import BoundError, GearlibError
from gearlib.many_runs import gathering
from gearlib.many_runs.gathering import Gathering
from gearlib.many_runs.samples import as_samples
from gearlib.many_runs.work import Chunk, ManyRows, Row
from tests.many_runs.test_execution import Doubling


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time in seconds, which tests set."""
    now = [10.0]
    monkeypatch.setattr(gathering, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    return now


def row(x: float) -> Row:
    return Doubling().row({"x": x})


def gathered(path: Path | None, count: int = 6) -> Gathering:
    return Gathering(Doubling(), "Model", as_samples({"x": np.arange(float(count))}), path)


def test_runs_wait_half_a_second_at_most_to_be_written(clock: list[float], tmp_path: Path) -> None:
    found = gathered(tmp_path / "runs.zarr")
    seen = []
    for run, pause in enumerate((0.25, 0.25, 0.125, 0.5, 0.0625, 0.0)):
        clock[0] += pause
        found.add(run, row(run))
        seen.append(int(found.done.sum()))
    assert seen == [0, 0, 3, 3, 5, 5]
    found.write()
    assert found.done.all()
    assert found.todo.tolist() == []


def test_runs_are_written_as_soon_as_they_fill_a_batch(clock: list[float], tmp_path: Path) -> None:
    found = gathered(tmp_path / "runs.zarr")
    found.add(4, row(4.0))
    assert found._file is not None
    found._file.batch = 3
    found.fail(2, BoundError("x is 2"))
    assert found.todo.tolist() == [0, 1, 2, 3, 4, 5]
    found.add(0, row(0.0))
    assert found.todo.tolist() == [1, 3, 5]
    runs = found.runs(True)
    assert runs.done.tolist() == [True, False, True, False, True, False]
    assert np.isnan(runs["z"]).tolist() == [False, True, True, True, False, True]
    assert (runs["z"][0], runs["z"][4]) == (0.0, 16.0)
    assert {run: str(error) for run, error in runs.errors.items()} == {2: "x is 2"}


@pytest.mark.parametrize("stored", ["", "runs.nc"])
def test_statistics_of_what_came_in(clock: list[float], stored: str, tmp_path: Path) -> None:
    path = tmp_path / stored if stored else None
    found = gathered(path)
    chunk = Chunk(
        {"y": np.arange(4.0).reshape(2, 2), "z": np.array([7.0, np.nan])}, {"time": [0.0, 1.5]}, {1: BoundError("no")}, (), 1.0
    )
    found.take(np.array([3, 1]), chunk)
    found.add_all(np.array([5, 4]), ManyRows({"y": np.ones((2, 2)), "z": np.array([25.0, 16.0])}, {"time": [0.0, 1.5]}))
    clock[0] += 2.5
    runs = found.runs(True)
    assert (runs.stats["runs"], runs.stats["done"], runs.stats["failed"], runs.stats["done_before"]) == (6, 4, 1, 0)
    assert runs.stats["seconds"] == 2.5
    assert list(runs.errors) == [1]
    np.testing.assert_array_equal(runs["z"], [np.nan, np.nan, np.nan, 7.0, 16.0, 25.0])
    np.testing.assert_array_equal(runs["y"][3], [0.0, 1.0])
    if path is not None:
        again = gathered(path)
        assert (again.before, again.todo.tolist()) == (4, [0, 2])
        assert again.coordinates["time"].tolist() == [0.0, 1.5]
        assert isinstance(again.errors[1], BoundError)


@pytest.mark.parametrize("stored", ["", "runs.zarr"])
def test_runs_of_another_shape_fail_with_all_that_came_with_them(clock: list[float], stored: str, tmp_path: Path) -> None:
    found = gathered(tmp_path / stored if stored else None)
    found.fail(1, BoundError("early"))
    found.add(0, row(0.0))
    found.add_all(np.array([2, 3]), ManyRows({"y": np.ones((2, 3)), "z": np.ones(2)}, {"time": [0.0, 1.5]}))
    found.add(4, Row({"y": np.ones(2), "z": 1.0}, {"time": [0.0, 2.5]}))
    found.add(5, row(5.0))
    runs = found.runs(False)
    assert runs.done.all()
    assert {run: str(error).split(" in ")[0] for run, error in runs.errors.items()} == {
        1: "early", 2: "y has the shape (3,)", 3: "y has the shape (3,)", 4: "the axis time has other values",
    }  # fmt: skip
    assert np.isnan(runs["z"]).tolist() == [False, True, True, True, True, False]
    assert runs["z"][5] == 25.0


def test_axes_have_names_where_the_work_names_as_many() -> None:
    found = gathered(None)
    assert found._axes("y", (2,)) == ("time",)
    assert found._axes("y", (2, 3)) == ("y_0", "y_1")
    assert found._axes("z", ()) == ()
    assert found._axes("z", (4,)) == ("z_0",)


@pytest.mark.parametrize("there", [3.9e4, 4.1e4])
def test_memory_is_that_of_all_runs(monkeypatch: pytest.MonkeyPatch, there: float) -> None:
    """Of 5000 numbers of eight bytes: 40 kB, in any number of runs."""
    monkeypatch.setattr(gathering, "physical_memory", lambda: there)
    found = Gathering(Doubling(), "Model", as_samples({"x": np.arange(50.0)}), None)
    values: dict[str, Any] = {"y": np.zeros((9, 11)), "z": 0.0}
    if there > 4e4:
        found.add(0, Row(values))
        assert found.done.sum() == 1
        return
    with pytest.raises(GearlibError, match=r"^outputs of 50 runs take 4e-05 GB, and this machine has 3\.9e-05; keep less"):
        found.add(0, Row(values))


@pytest.mark.parametrize(
    ("each", "there", "said"), [(5312500, 1.125e9, ("2.12", "1.12")), (5937500, 1.375e9, ("2.38", "1.38"))]
)
def test_memory_is_told_in_gigabytes(monkeypatch: pytest.MonkeyPatch, each: int, there: float, said: tuple[str, str]) -> None:
    """To three digits; of a half, which these are, the even one."""
    monkeypatch.setattr(gathering, "physical_memory", lambda: there)
    found = Gathering(Doubling(), "Model", as_samples({"x": np.arange(50.0)}), None)
    with pytest.raises(GearlibError) as refused:
        found.add(0, Row({"y": np.broadcast_to(0.0, each)}))
    assert str(refused.value).startswith("outputs of 50 runs take {} GB, and this machine has {}; keep less".format(*said))
