"""How runs are carried out, gathered and told apart, with work that takes no time."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearlib.errors import ArgumentError, BoundError, FileError, GearlibWarning, WorkerError
from gearlib.many_runs import execution
from gearlib.many_runs.execution import execute
from gearlib.many_runs.runs import Runs
from gearlib.many_runs.samples import as_samples
from gearlib.many_runs.work import ManyRows, Row, Work, done_there, here, job
from gearlib.run.request import physical_memory

X = np.arange(40.0)


class Doubling(Work):
    """Twice what varies over two times, and its square; it fails, warns and is interrupted where it is told to."""

    def __init__(
        self, fails: tuple[float, ...] = (), stops: float = -1.0, warns: str = "", large: int = 0, key: str = "a"
    ) -> None:
        self.fails, self.stops, self.warns, self.large, self.key = fails, stops, warns, large, key
        self.asked: list[float] = []

    def row(self, given: Any) -> Row:
        x = given["x"]
        self.asked.append(x)
        if self.warns:
            warnings.warn(self.warns.format(x), RuntimeWarning, stacklevel=1)
        if x == self.stops:
            raise KeyboardInterrupt
        if x in self.fails:
            raise BoundError(f"x is {x:g}")
        if self.large:
            return Row({"y": np.broadcast_to(0.0, (self.large,))})
        return Row({"y": 2 * x * np.array([0.0, 1.0]), "z": x**2}, {"time": [0.0, 1.5]})

    def dimensions(self, name: str) -> tuple[str, ...]:
        return ("time",) if name == "y" else ()

    def unit(self, name: str) -> str:
        return {"y": "m"}.get(name, "")

    def varied_unit(self, name: str) -> str:
        return {"x": "s", "y": "kg"}.get(name, "")

    def identity(self) -> Iterator[bytes]:
        yield self.key.encode()


class Together(Doubling):
    """The same, seven runs at a time, the last ones first; those that fail by themselves."""

    def together(self, part: Any, count: int) -> Any:
        x = part["x"]
        self.asked += x.tolist()
        for i in np.flatnonzero(np.isin(x, self.fails)).tolist():
            yield i, BoundError(f"x is {x[i]:g}")
        good = np.flatnonzero(~np.isin(x, self.fails))[::-1]
        for first in range(0, len(good), 7):
            runs = good[first : first + 7]
            values = {"y": 2 * x[runs, None] * np.array([0.0, 1.0]), "z": x[runs] ** 2}
            yield runs, ManyRows(values, {"time": [0.0, 1.5]})


class AtOnce(Executor):
    """Does at once what it is given, and says how many runs each task holds."""

    def __init__(self) -> None:
        self.sizes: list[int] = []

    def submit(self, function: Any, /, *given: Any, **_: Any) -> Future[Any]:
        self.sizes.append(given[2])
        future: Future[Any] = Future()
        future.set_result(function(*given))
        return future


def check(runs: Runs, fails: tuple[int, ...] = ()) -> None:
    good = np.array([k not in fails for k in range(len(runs))])
    assert runs["y"].shape == (len(X), 2)
    assert runs["y"][good, 1].tolist() == (2 * X[good]).tolist()
    assert runs["z"][good].tolist() == (X[good] ** 2).tolist()
    assert np.isnan(runs["y"][~good]).all()
    assert np.isnan(runs["z"][~good]).all()
    assert list(runs.errors) == list(fails)
    assert runs.time.tolist() == [0.0, 1.5]
    assert (runs.unit("y"), runs.unit("x"), runs.unit("z")) == ("m", "s", "")
    assert (runs.stats["runs"], runs.stats["done"], runs.stats["failed"]) == (len(X), len(X), len(fails))


@pytest.mark.parametrize("fails", [(), (0, 1, 7, 39)])
@pytest.mark.parametrize("how", ["here", "one thread", "threads", "pool", "at once"])
@pytest.mark.parametrize(("kind", "stored"), [(Doubling, ""), (Together, ""), (Doubling, ".nc"), (Together, ".zarr")])
def test_every_way_gives_the_same_runs(how: str, fails: tuple[int, ...], stored: str, kind: Any, tmp_path: Path) -> None:
    """Also where the first runs fail, whose shapes are then not known; a file is read again without a run."""
    work, path = kind(tuple(map(float, fails))), tmp_path / f"runs{stored}" if stored else None
    with ThreadPoolExecutor(2) as pool:
        more: Any = {"one thread": {"threads": 1}, "threads": {"threads": 3}, "pool": {"executor": pool}}
        more["at once"] = {"executor": AtOnce()}
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            check(execute(work, "Model", as_samples({"x": X}), to=path, **more.get(how, {})), fails)
            said = [str(w.message) for w in told]
            where = f"{len(fails)} of 40 runs failed and are NaN; runs.errors says why: run 0: x is 0"
            assert said == ([where] if fails else [])
            if how != "at once":
                assert sorted(work.asked) == X.tolist()
            if path is not None:
                again = kind(tuple(map(float, fails)))
                found = execute(again, "Model", as_samples({"x": X}), to=path)
                check(found, fails)
                assert (again.asked, found.stats["done_before"]) == ([], 40)
                assert all(isinstance(e, BoundError) for e in found.errors.values())


def test_tasks_hold_an_eighth_of_the_runs_at_most() -> None:
    """Two runs are done here to learn what they take; those that take long are tasks by themselves."""
    executor = AtOnce()
    execute(Doubling(), "Model", as_samples({"x": np.arange(99.0)}), executor=executor)
    assert sum(executor.sizes) in (97, 98)
    assert executor.sizes[0] == 13
    assert len(executor.sizes) == 8


@pytest.mark.parametrize(
    ("first", "each", "here", "size"),
    [
        (0.001, 0.001, 1, 13),  # an eighth
        (0.009, 0.009, 1, 13),
        (0.03, 0.03, 2, 9),  # a quarter of a second
        (5.0, 0.06, 2, 5),  # the first one compiles
        (5.0, 1e-9, 2, 13),
        (1.0, 1.0, 2, 1),
    ],
)
def test_tasks_last_a_quarter_of_a_second(
    monkeypatch: pytest.MonkeyPatch, first: float, each: float, here: int, size: int
) -> None:
    """By the time of one run, or of the second one where the first was slow."""
    now = [0.0]

    class Slow(Doubling):
        def row(self, given: Any) -> Row:
            now[0] += each if self.asked else first
            return super().row(given)

    monkeypatch.setattr(execution, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    executor = AtOnce()
    execute(Slow(), "Model", as_samples({"x": np.arange(100.0)}), executor=executor)
    assert sum(executor.sizes) == 100 - here
    assert set(executor.sizes[:-1]) <= {size}
    assert executor.sizes[0] == min(size, 100 - here)


def test_a_file_of_another_sweep_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "runs.zarr"
    execute(Doubling(), "Model", as_samples({"x": X, "k": 1.0}), to=path)
    for work, samples in (
        (Doubling(key="b"), {"x": X, "k": 1.0}), (Doubling(), {"x": X + 1, "k": 1.0}), (Doubling(), {"x": X, "k": 2.0}),
        (Doubling(), {"x": X}), (Doubling(), {"x": X[:-1], "k": 1.0}),
    ):  # fmt: skip
        with pytest.raises(FileError, match=r"was written by another sweep \(of Model, 40 runs\)"):
            execute(work, "Model", as_samples(samples), to=path)


@pytest.mark.parametrize("stored", [False, True])
def test_an_interrupt_keeps_what_was_done_and_a_file_goes_on(stored: bool, tmp_path: Path) -> None:
    path = tmp_path / "runs.zarr" if stored else None
    with pytest.warns(
        GearlibWarning, match="the sweep was interrupted after 17 of 40 runs; the others are NaN, runs.done says which"
    ):
        runs = execute(Doubling(stops=17.0), "Model", as_samples({"x": X}), to=path)
    assert runs.done.tolist() == (X < 17).tolist()
    assert np.isnan(runs["z"]).tolist() == (X >= 17).tolist()
    if path is not None:
        work = Doubling()
        found = execute(work, "Model", as_samples({"x": X}), to=path)
        check(found)
        assert (work.asked, found.stats["done_before"]) == (X[17:].tolist(), 17)


def test_where_all_fail_the_error_of_the_first_is_raised(tmp_path: Path) -> None:
    for path in (None, tmp_path / "runs.zarr"):
        with pytest.raises(BoundError, match="x is 2"):
            execute(Doubling((2.0, 3.0)), "Model", as_samples({"x": [2.0, 3.0]}), to=path)


@pytest.mark.parametrize("threads", [None, 2])
def test_a_warning_is_shown_once_whatever_its_numbers_are(threads: int | None) -> None:
    with pytest.warns(RuntimeWarning) as told:
        execute(Doubling(warns="the load turns at {:.1f} rad/s"), "Model", as_samples({"x": X}), threads=threads)
    assert [str(w.message) for w in told] == ["the load turns at 0.0 rad/s (in 40 runs)"]
    for count, often in ((1, ""), (2, " (in 2 runs)")):
        with pytest.warns(RuntimeWarning) as told:
            execute(Doubling(warns="it turns"), "Model", as_samples({"x": X[:count]}), threads=threads)
        assert [str(w.message) for w in told] == [f"it turns{often}"]


def test_progress_ends_with_the_part_that_was_done() -> None:
    told: list[tuple[float, float]] = []
    execute(Doubling(), "Model", as_samples({"x": X}), progress=lambda f, t: told.append((f, t)))
    assert told[-1][0] == 1.0
    assert 0.0 <= told[-1][1] < 60.0
    with pytest.warns(GearlibWarning, match="interrupted"):
        execute(Doubling(stops=10.0), "Model", as_samples({"x": X}), progress=lambda f, t: told.append((f, t)))
    assert told[-1][0] == 0.25


def test_progress_is_told_when_it_is_due() -> None:
    """By the runs that are done, those of an earlier sweep as well."""
    told: list[float] = []
    gathering: Any = SimpleNamespace(before=3, samples=range(8))
    running = execution.Execution(gathering, lambda part, seconds: told.append(part))
    due = iter([False, True, False, True])
    running._ticker = SimpleNamespace(due=lambda: next(due))  # type: ignore[assignment]
    for count in (1, 2, 0, 2):
        running.received(count)
    assert told == [6 / 8, 1.0]
    silent = execution.Execution(gathering, None)
    silent.received(2)
    silent.report()
    assert silent._received == 5


def test_more_than_the_memory_holds_is_refused_before_it_is_allocated() -> None:
    machine = f"{physical_memory() / 1e9:.3g}"
    with pytest.raises(
        ArgumentError, match=rf"outputs of 40 runs take 3\.2e\+05 GB, and this machine has {re.escape(machine)}; keep less"
    ):
        execute(Doubling(large=10**12), "Model", as_samples({"x": X}))


class Losing(AtOnce):
    """Loses its second task."""

    def submit(self, function: Any, /, *given: Any, **_: Any) -> Future[Any]:
        if len(self.sizes) < 1:
            return super().submit(function, *given)
        future: Future[Any] = Future()
        future.set_exception(OSError("the cable is cut"))
        return future


def test_a_lost_task_is_named(tmp_path: Path) -> None:
    for path, kept in (
        (None, ""),
        (tmp_path / "runs.zarr", "; what was done is in the file, and the same call goes on with it"),
    ):
        with pytest.raises(WorkerError, match=rf"a task was lost after \d+ of 40 runs: OSError: the cable is cut{kept}$"):
            execute(Doubling(), "Model", as_samples({"x": X}), executor=Losing(), to=path)


def test_an_executor_or_threads_but_not_both() -> None:
    with ThreadPoolExecutor(1) as pool, pytest.raises(ArgumentError, match="give an executor or threads, not both"):
        execute(Doubling(), "Model", as_samples({"x": X}), executor=pool, threads=1)


@pytest.mark.parametrize(
    ("executor", "threads", "said"),
    [
        (None, 0, "threads is 0; expected a whole number, 1 or more"),
        (None, 1.5, "threads is 1.5; expected a whole number, 1 or more"),
        (3, None, "executor is 3; expected a concurrent.futures.Executor, such as ProcessPoolExecutor() or, of dask, "
         "client.get_executor()"),
        (AtOnce(), 2, "give an executor or threads, not both"),
        (AtOnce(), 0, "threads is 0; expected a whole number, 1 or more"),
        (AtOnce(), None, ""),
        (None, 1, ""),
    ],
)  # fmt: skip
def test_who_carries_runs_out(executor: Any, threads: Any, said: str) -> None:
    if not said:
        execution.check_executor(executor, threads)
        return
    with pytest.raises(ArgumentError) as refused:
        execution.check_executor(executor, threads)
    assert str(refused.value) == said


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("it slips by {0} at t = {0}e-05 s", ["it slips by 0.0 at t = 0.0e-05 s (in 3 runs)"]),
        ("speeds of [{0}, -{0}]", ["speeds of [0.0, -0.0] (in 3 runs)"]),
        ("shaft{:.0f}.c is small", ["shaft0.c is small", "shaft1.c is small", "shaft2.c is small"]),
        ("body[{0:.0f}] turns at {0}", ["body[0] turns at 0.0", "body[1] turns at 1.0", "body[2] turns at 2.0"]),
    ],
)
def test_warnings_that_differ_in_a_number_are_one_and_those_of_other_parts_are_not(said: str, told: list[str]) -> None:
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        execute(Doubling(warns=said), "Model", as_samples({"x": X[:3]}))
    assert [str(w.message) for w in shown] == told


def test_warnings_are_shown_at_home_and_sent_from_elsewhere() -> None:
    """Each once from elsewhere: a process that is not asked to show them says what there was to say."""
    part, work = {"x": X[:5]}, job(Doubling(fails=(3.0,), warns="x is odd"))
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        there = done_there(work, part, 5, "another machine")
        assert shown == []
        own = done_there(work, part, 5, here())
    assert (len(shown), own.warned, there.warned) == (5, (), ((RuntimeWarning, "x is odd"),))
    for chunk in (there, own):
        assert chunk.values["z"][[0, 1, 2, 4]].tolist() == [0.0, 1.0, 4.0, 16.0]
        assert [*chunk.errors] == [3]
