"""`execute`: executes the runs of a sweep, sequentially or by an executor; deduplicates warnings, and survives interrupts."""

from __future__ import annotations

import math
import re
import time
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearlib.arguments import shown, whole
from gearlib.errors import ArgumentError, GearlibError, GearlibWarning, WorkerError, warn
from gearlib.many_runs.gathering import Gathering
from gearlib.many_runs.runs import Runs
from gearlib.many_runs.samples import Samples
from gearlib.many_runs.work import Chunk, ManyRows, Row, Warned, Work, done, done_there, here, job, noted
from gearlib.progress import APART, Ticker, Told, reporting

Integers = NDArray[np.int64]
# A dask task costs 2 to 5 ms of overhead, one of a process pool 0.3 ms: at most 2 % of a quarter of a second
TASK = 0.25  # s
LEAST_TASKS = 8  # so that workers end at about the same time, and progress is seen
IN_FLIGHT = 4096  # tasks submitted at a time, so that memory does not grow with the number of runs


def execute(
    work: Work, model: str, samples: Samples, *, executor: Any = None, threads: Any = None, to: Path | None = None,
    progress: Any = False,
) -> Runs:  # fmt: skip
    """Execute the runs of a sweep that are not done yet.

    Parameters
    ----------
    work : Work
    model : str
        Name of the model.
    samples : Samples
    executor : concurrent.futures.Executor, optional
        Executes the runs; by default this process.
    threads : int, optional
        Alternatively, the number of threads in this process.
    to : Path, optional
        File to write to, or to resume.
    progress : bool or callable

    Raises
    ------
    ArgumentError, FileError, WorkerError
        Not an executor, a file of another sweep, or a lost worker.
    GearlibError
        Every run failed.
    """
    check_executor(executor, threads)
    gathering, interrupted, elsewhere = Gathering(work, model, samples, to), False, list[Warned]()
    with reporting(progress, f"{model}, {len(samples)} runs") as tell, noted() as found:
        execution = Execution(gathering, tell)
        try:
            if executor is None and threads in (None, 1):
                _sequentially(execution, gathering.todo)
            else:
                with ThreadPoolExecutor(threads) if executor is None else nullcontext(executor) as chosen:
                    _distributed(execution, chosen, elsewhere)
        except KeyboardInterrupt:
            interrupted = True
        finally:
            gathering.write()
        execution.report()
        warned = [*found(), *elsewhere]
    _warn_once(warned)
    runs = gathering.runs(interrupted)
    _say_what_failed(runs, interrupted)
    return runs


def check_executor(executor: Any, threads: Any) -> None:
    """Raise `ArgumentError` for an invalid executor or number of threads."""
    if executor is not None and not isinstance(executor, Executor):
        raise ArgumentError(
            f"executor is {shown(executor)}; expected a concurrent.futures.Executor, such as ProcessPoolExecutor() or, of dask, "
            "client.get_executor()"
        )
    if threads is not None:
        whole("threads", threads, 1)
        if executor is not None:
            raise ArgumentError("give an executor or threads, not both")


class Execution:
    """A sweep in progress."""

    def __init__(self, gathering: Gathering, tell: Told | None) -> None:
        self.gathering, self._tell = gathering, tell
        self._ticker, self._begin, self._received = Ticker(), time.perf_counter(), gathering.before

    def take(self, run: int, row: Row | GearlibError) -> None:
        """A run that was executed in this process."""
        if isinstance(row, GearlibError):
            self.gathering.fail(run, row)
        else:
            self.gathering.add(run, row)
        self.received(1)

    def take_all(self, runs: Integers, rows: ManyRows) -> None:
        """Runs that were executed in this process, and are alike."""
        self.gathering.add_all(runs, rows)
        self.received(len(runs))

    def received(self, count: int) -> None:
        """Count some more runs as received, and report progress if it is due."""
        self._received += count
        if self._tell is not None and self._ticker.due():
            self.report()

    def report(self) -> None:
        """Report progress."""
        if self._tell is not None:
            self._tell(self._received / len(self.gathering.samples), time.perf_counter() - self._begin)


def _sequentially(execution: Execution, runs: Integers) -> None:
    """Execute some runs in this process."""
    part = execution.gathering.samples.part(runs)
    for i, row in execution.gathering.work.together(part, len(runs)):
        if isinstance(row, ManyRows):
            execution.take_all(runs[i], row)
        else:
            execution.take(int(runs[i]), row)


def _distributed(execution: Execution, executor: Executor, elsewhere: list[Warned]) -> None:
    """Have an executor execute the runs, in tasks of many runs each."""
    gathering = execution.gathering
    seconds = _first_runs(execution)
    todo, samples, work = gathering.todo, gathering.samples, gathering.work
    size = max(1, min(math.ceil(TASK / max(seconds, 1e-6)), math.ceil(len(todo) / LEAST_TASKS)))
    parts = [todo[first : first + size] for first in range(0, len(todo), size)]
    same = isinstance(executor, ThreadPoolExecutor)
    packed = b"" if same else job(work)
    flying: dict[Future[Chunk], Integers] = {}
    try:
        while parts or flying:
            while parts and len(flying) < IN_FLIGHT:
                runs = parts.pop(0)
                part = samples.part(runs)
                task = (done, work, part, len(runs)) if same else (done_there, packed, part, len(runs), here())
                flying[executor.submit(*task)] = runs
            for future in wait(flying, timeout=APART, return_when=FIRST_COMPLETED).done:
                runs = flying.pop(future)
                chunk = _brought(future, gathering)
                gathering.take(runs, chunk)
                elsewhere += chunk.warned
                execution.received(len(runs))
    except BaseException:
        for future in flying:
            future.cancel()
        raise


def _first_runs(execution: Execution) -> float:
    """Execute one or two runs here to learn the shapes of results and the number of runs per task; returns the seconds per run."""
    seconds = 0.0
    for _ in range(2):  # the first one may compile
        begin, runs = time.perf_counter(), execution.gathering.todo[:1]
        _sequentially(execution, runs)
        execution.gathering.write()
        seconds = time.perf_counter() - begin
        if seconds < 0.01:
            break
    return seconds


def _brought(future: Future[Chunk], gathering: Gathering) -> Chunk:
    """The results of a task."""
    try:
        return future.result()
    except GearlibError:
        raise
    except Exception as problem:  # raised by the executor, or by missing modules in the worker
        kept = "; what was done is in the file, and the same call goes on with it" if gathering.path is not None else ""
        raise WorkerError(
            f"a task was lost after {int(gathering.done.sum())} of {len(gathering.samples)} runs: {type(problem).__name__}: {problem}{kept}"
        ) from problem


_NUMBER = re.compile(r"(?<!\w)(?<!\w\[)\d[\d.e+-]*")  # not of a name: shaft2.c, body[1]


def _warn_once(warned: Iterable[Warned]) -> None:
    """Show each warning of the runs once, regardless of the numbers in it."""
    count: Counter[tuple[type[Warning], str]] = Counter()
    first: dict[tuple[type[Warning], str], str] = {}
    for category, message in warned:
        key = category, _NUMBER.sub("#", message)
        first.setdefault(key, message)
        count[key] += 1
    for key, message in first.items():
        often = f" (in {count[key]} runs)" if count[key] > 1 else ""
        warn(message + often, key[0])


def _say_what_failed(runs: Runs, interrupted: bool) -> None:
    """Warn of failed runs, and of an interrupt."""
    if interrupted:
        n = int(runs.done.sum())
        warn(
            f"the sweep was interrupted after {n} of {len(runs)} runs; the others are NaN, runs.done says which", GearlibWarning
        )
    if runs.errors:
        place, problem = next(iter(runs.errors.items()))
        what = f"{len(runs.errors)} of {len(runs)} runs failed and are NaN; runs.errors says why"
        warn(f"{what}: run {place}: {problem}", GearlibWarning)
