"""Sweeps by threads, processes and files: the same numbers, wherever they are computed; what is interrupted goes on."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import gearlib as gl
from gearlib.errors import ArgumentError, FileError, GearlibWarning, WorkerError
from tests.many_runs.models import Drive, Rattle, dying, peak, slow_peak

J = np.linspace(0.5, 5.0, 40)
OPTIONS: dict[str, Any] = {"samples": 11, "outputs": ["load.w"], "inputs": {"torque.tau": 3.0}}


@pytest.fixture(scope="module")
def drive() -> gl.System:
    return gl.compile(Drive())


@pytest.fixture(scope="module")
def processes() -> Any:
    with ProcessPoolExecutor(2, mp_context=get_context("forkserver")) as pool:
        yield pool


# ---------------------------------------------------------------- executors


def test_processes_give_the_same_numbers(drive: gl.System, processes: Executor) -> None:
    wanted = drive.sweep({"J": J}, 1.0, reduce={"peak": peak}, **OPTIONS)
    found = drive.sweep({"J": J}, 1.0, reduce={"peak": peak}, executor=processes, **OPTIONS)
    assert found["load.w"].tobytes() == wanted["load.w"].tobytes()
    assert found["peak"].tobytes() == wanted["peak"].tobytes()
    assert found.time.tolist() == wanted.time.tolist()


def test_tables_and_functions_go_to_other_processes(drive: gl.System, processes: Executor) -> None:
    tables = [gl.Table([0, 1], [0, k]) for k in J]
    options = {**OPTIONS, "inputs": None, "reduce": {"end": lambda r: r["load.w"][-1]}}
    wanted = drive.sweep({"torque.tau": tables}, 1.0, **options)
    found = drive.sweep({"torque.tau": tables}, 1.0, executor=processes, **options)
    assert found["end"].tobytes() == wanted["end"].tobytes()


def test_failures_come_back_from_other_processes(drive: gl.System, processes: Executor) -> None:
    with pytest.warns(GearlibWarning, match="2 of 40 runs failed"):
        found = drive.sweep({"J": np.where(np.isin(np.arange(40), (7, 30)), -1.0, J)}, 1.0, executor=processes, **OPTIONS)
    assert list(found.errors) == [7, 30]
    assert "J is -1" in str(found.errors[30])


def test_warnings_of_other_processes_come_once(drive: gl.System, processes: Executor) -> None:
    def grumble(result: Any) -> float:
        warnings.warn(f"the load turns at {result['load.w'][-1]:.3f} rad/s", RuntimeWarning, stacklevel=1)
        return 0.0

    with pytest.warns(RuntimeWarning, match="the load turns at") as told:
        drive.sweep({"J": J}, 1.0, reduce={"none": grumble}, executor=processes, inputs=OPTIONS["inputs"])
    assert len(told) == 1


@pytest.mark.parametrize("model", [Drive, Rattle])
@pytest.mark.parametrize("method", ["auto", "rk5", "ida"])
def test_threads_give_the_same_numbers(model: Any, method: str) -> None:
    system = gl.compile(model(), outputs=["load.w", "motor.w"])
    options: dict[str, Any] = {"samples": 11, "method": method, "inputs": {name: 3.0 for name in system.inputs}}
    varied = {"load.J": np.linspace(0.2, 3.0, 30), "motor.J": np.tile([0.5, 0.0 if model is Drive else 0.1, 0.3], 10)}
    wanted = system.sweep(varied, 1.0, **options)
    found = system.sweep(varied, 1.0, threads=4, **options)
    for name in ("load.w", "motor.w"):
        assert found[name].tobytes() == wanted[name].tobytes()
    with ThreadPoolExecutor(3) as pool:
        assert system.sweep(varied, 1.0, executor=pool, **options)["load.w"].tobytes() == wanted["load.w"].tobytes()


def test_models_travel_as_small_recipes(drive: gl.System) -> None:
    sent: list[int] = []

    class Elsewhere(Executor):
        """Does what it is given at once, as another process would: from bytes."""

        def submit(self, function: Any, /, *given: Any, **_: Any) -> Future[Any]:
            import pickle

            raw = pickle.dumps((function, given))
            sent.append(len(raw))
            asked, (packed, part, count, _) = pickle.loads(raw)
            future: Future[Any] = Future()
            future.set_result(asked(packed, part, count, "another process"))
            return future

    runs = drive.sweep({"J": J}, 1.0, executor=Elsewhere(), **{**OPTIONS, "samples": 2})
    assert runs["load.w"].tobytes() == drive.sweep({"J": J}, 1.0, **{**OPTIONS, "samples": 2})["load.w"].tobytes()
    assert max(sent) < 2500


def test_what_cannot_travel_is_named(drive: gl.System, monkeypatch: pytest.MonkeyPatch) -> None:
    lock = threading.Lock()
    with ProcessPoolExecutor(1) as pool, pytest.raises(ArgumentError, match="cannot be sent to another process"):
        drive.sweep({"J": J}, 1.0, executor=pool, reduce={"n": lambda r: float(lock.locked())}, inputs=OPTIONS["inputs"])


def test_a_worker_that_dies_is_named_and_what_was_done_stays(drive: gl.System, tmp_path: Path) -> None:
    path, c = tmp_path / "runs.zarr", np.linspace(100.0, 499.0, 30)
    options: dict[str, Any] = {"reduce": {"peak": dying}, "inputs": OPTIONS["inputs"], "to": path}
    with ProcessPoolExecutor(1, mp_context=get_context("forkserver")) as pool:
        with pytest.raises(WorkerError, match=r"a task was lost after \d+ of 30 runs: BrokenProcessPool.*goes on with it"):
            drive.sweep({"shaft.c": c}, 1.0, executor=pool, **options)
    done = xarray.open_zarr(path)["gearlib_done"].values.astype(bool)
    assert 0 < done.sum() < 30


# ---------------------------------------------------------------- files


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_files_hold_the_same_numbers(drive: gl.System, tmp_path: Path, suffix: str, processes: Executor) -> None:
    wanted = drive.sweep({"J": J}, 1.0, reduce={"peak": peak}, **OPTIONS)
    path = tmp_path / f"runs{suffix}"
    for executor in (None, processes):
        found = drive.sweep({"J": J}, 1.0, reduce={"peak": peak}, to=path, executor=executor, **OPTIONS)
        assert found["load.w"].tobytes() == wanted["load.w"].tobytes()
        assert found["peak"].tobytes() == wanted["peak"].tobytes()
        opened: Any = xarray.open_zarr(path) if suffix == ".zarr" else xarray.open_dataset(path)
        with opened:
            assert opened["load.w"].values.tobytes() == wanted["load.w"].tobytes()
            assert opened["load.w"].attrs["units"] == "rad/s"
            assert opened["J"].values.tolist() == J.tolist()
            assert opened["time"].values.tolist() == wanted.time.tolist()
            assert opened["load.w"].dims == ("run", "time")
        again = drive.sweep({"J": J}, 1.0, reduce={"peak": peak}, to=path, **OPTIONS)
        assert again.stats["done_before"] == 40
        if executor is None:
            path = tmp_path / f"others{suffix}"


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_another_sweeps_file_is_refused(drive: gl.System, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"runs{suffix}"
    sweep: dict[str, Any] = {"parameters": {"J": J[:4]}, "t_end": 1.0, "reduce": {"peak": peak}, "to": path, **OPTIONS}
    drive.sweep(**sweep)
    others: list[dict[str, Any]] = [
        {"parameters": {"J": J[:5]}}, {"parameters": {"J": J[1:5]}}, {"t_end": 2.0}, {"samples": 12}, {"method": "rk5"},
        {"inputs": {"torque.tau": 4.0}}, {"outputs": ["motor.w"]}, {"reduce": {"peak": lambda r: 2.0}}, {"rtol": 1e-5},
        {"start": {"load.w": 2.0}},
    ]  # fmt: skip
    for other in others:
        with pytest.raises(FileError, match=r"was written by another sweep \(of Drive, 4 runs\)"):
            drive.sweep(**(sweep | other))
    with pytest.raises(FileError, match="was written by another sweep"):
        gl.compile(Rattle(), outputs=["load.w"]).sweep({"load.J": J[:4]}, 1.0, to=path)
    plain = tmp_path / f"plain{suffix}"
    drive.simulate(1.0, inputs=OPTIONS["inputs"]).save(plain, ["load.w"])
    with pytest.raises(FileError, match="is not a file of a sweep"):
        drive.sweep(**(sweep | {"to": plain}))


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_failures_are_kept_in_the_file(drive: gl.System, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"runs{suffix}"
    for _ in range(2):
        with pytest.warns(GearlibWarning, match="2 of 4 runs failed"):
            runs = drive.sweep({"J": [-1.0, 1.0, -3.0, 2.0]}, 1.0, to=path, **OPTIONS)
        assert {k: (type(e).__name__, str(e).split(";")[0]) for k, e in runs.errors.items()} == {
            0: ("BoundError", "J is -1"), 2: ("BoundError", "J is -3"),
        }  # fmt: skip
        assert np.isnan(runs["load.w"][[0, 2]]).all()
        assert np.isfinite(runs["load.w"][[1, 3]]).all()


SCRIPT = """
import sys, numpy as np, gearlib as gl
from tests.many_runs.models import Drive, slow_peak
runs = gl.compile(Drive()).sweep({"J": np.linspace(0.5, 5.0, 80)}, 1.0, reduce={"peak": slow_peak},
                                 inputs={"torque.tau": 3.0}, to=sys.argv[1])
print("all done", len(runs.errors), runs.done.sum(), flush=True)
"""


@pytest.mark.parametrize("suffix", [".zarr", pytest.param(".nc", marks=pytest.mark.slow)])
def test_a_sweep_that_was_killed_goes_on(
    drive: gl.System, tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, log = tmp_path / f"runs{suffix}", tmp_path / "log"
    monkeypatch.setenv("GEARLIB_TEST_LOG", str(log))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).resolve().parents[2]), os.environ["PYTHONPATH"]]))
    process = subprocess.Popen([sys.executable, "-c", SCRIPT, str(path)])
    limit = time.monotonic() + 120
    while not (log.exists() and len(log.read_text().splitlines()) >= 40):
        assert process.poll() is None, "it ended too early"
        assert time.monotonic() < limit
        time.sleep(0.01)
    process.kill()
    process.wait()
    opened: Any = xarray.open_zarr(path) if suffix == ".zarr" else xarray.open_dataset(path)
    with opened:
        kept = opened["gearlib_done"].values.astype(bool)
    assert 1 < kept.sum() < 80
    first = log.read_text().splitlines()
    log.unlink()
    values = np.linspace(0.5, 5.0, 80)
    runs = drive.sweep({"J": values}, 1.0, reduce={"peak": slow_peak}, inputs={"torque.tau": 3.0}, to=path)
    then = log.read_text().splitlines()
    assert runs.stats["done_before"] == kept.sum()
    assert len(then) == 80 - kept.sum()
    assert not set(first[: kept.sum()]) & set(then)
    wanted = drive.sweep({"J": values}, 1.0, reduce={"peak": peak}, inputs={"torque.tau": 3.0})
    assert runs["peak"].tobytes() == wanted["peak"].tobytes()


# ---------------------------------------------------------------- interrupts and progress


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_leaves_the_runs_so_far(drive: gl.System, tmp_path: Path) -> None:
    def interrupting(result: Any) -> float:
        if float(result.request.parameters.max()) == 499.0:
            signal.raise_signal(signal.SIGINT)
        return peak(result)

    c = np.linspace(100.0, 598.0, 11)
    c[5] = 499.0
    for to in (None, tmp_path / "runs.nc"):
        with pytest.warns(GearlibWarning, match=r"interrupted after 5 of 11 runs"):
            runs = drive.sweep({"shaft.c": c}, 1.0, reduce={"peak": interrupting}, inputs=OPTIONS["inputs"], to=to)
        assert runs.done.tolist() == [True] * 5 + [False] * 6
        assert np.isfinite(runs["peak"]).tolist() == runs.done.tolist()
        assert "6 not done" in repr(runs)


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_of_an_executor_returns_soon(drive: gl.System, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("GEARLIB_TEST_LOG", str(tmp_path / "log"))
    main, count = threading.main_thread().ident, itertools.count(1)
    assert main is not None

    def interrupting(result: Any) -> float:
        if next(count) == 5:
            signal.pthread_kill(main, signal.SIGINT)
        return slow_peak(result)

    with ThreadPoolExecutor(2) as pool, pytest.warns(GearlibWarning, match="interrupted after"):
        runs = drive.sweep(
            {"J": np.linspace(0.5, 5.0, 2000)}, 1.0, reduce={"peak": interrupting}, inputs=OPTIONS["inputs"], executor=pool
        )
    assert 0 < runs.done.sum() < 2000
    assert np.isfinite(runs["peak"]).tolist() == runs.done.tolist()


def test_progress_is_told(drive: gl.System, processes: Executor) -> None:
    for more in ({}, {"executor": processes}, {"threads": 2}):
        told: list[tuple[float, float]] = []
        drive.sweep({"J": J}, 1.0, progress=lambda f, t: told.append((f, t)), **more, **OPTIONS)  # noqa: B023
        fractions = [fraction for fraction, _ in told]
        assert fractions == sorted(fractions)
        assert fractions[-1] == 1.0
        assert told[-1][1] > 0.0
    with pytest.raises(ArgumentError, match="progress, a function, raised ZeroDivisionError"):
        drive.sweep({"J": J}, 1.0, progress=lambda f, t: 1 / 0, **OPTIONS)


def test_progress_shows_nothing_where_there_is_no_terminal(drive: gl.System, capfd: pytest.CaptureFixture[str]) -> None:
    drive.sweep({"J": J}, 1.0, progress=True, **OPTIONS)
    assert capfd.readouterr() == ("", "")
