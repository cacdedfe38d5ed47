"""Progress of long calls: a bar on a terminal, or a user's callback that receives the fraction done and the elapsed time; notices."""

from __future__ import annotations

import importlib.util
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from gearlib.arguments import shown
from gearlib.errors import ArgumentError, GearlibError

Told = Callable[[float, float], None]
APART = 0.05  # s, minimum interval between reports


def check_progress(progress: Any) -> Any:
    """Validate ``progress``: True, False, or a callback of the fraction done (0 to 1) and the time.

    Raises
    ------
    ArgumentError
        Anything else.
    """
    if isinstance(progress, bool) or callable(progress):
        return progress
    raise ArgumentError(f"progress is {shown(progress)}; expected True, False, or a function of the fraction done and the time")


@contextmanager
def reporting(progress: Any, label: str) -> Iterator[Told | None]:
    """A callback for the fraction done and the time, or None if progress is not wanted.

    Parameters
    ----------
    progress : bool or callable
        True shows a bar if standard error is a terminal: tqdm's if that is installed, otherwise a line of text.
    label : str
        Label in front of the bar.
    """
    if callable(progress):
        yield _guarded(progress)
    elif not progress or not _on_terminal():
        yield None
    elif importlib.util.find_spec("tqdm") is not None:
        yield from _bar(label)
    else:
        yield from _line(label)


def notice(text: str) -> None:
    """Say in one line on standard error why a call takes long; nothing unless that is a terminal.

    Parameters
    ----------
    text : str
        It overwrites a bar that is being shown there; the bar is drawn again below.
    """
    if _on_terminal():
        sys.stderr.write(f"\r{text.ljust(shutil.get_terminal_size().columns - 1)}\n")
        sys.stderr.flush()


def _on_terminal() -> bool:
    return sys.stderr is not None and sys.stderr.isatty()  # a program without a console has none


def _guarded(progress: Callable[[float, float], Any]) -> Told:
    def tell(fraction: float, now: float) -> None:
        try:
            progress(fraction, now)
        except GearlibError:
            raise
        except Exception as problem:
            raise ArgumentError(
                f"progress, a function, raised {type(problem).__name__}: {problem}; expected a function of the fraction done and the time"
            ) from problem

    return tell


def _bar(label: str) -> Iterator[Told]:
    from tqdm import tqdm

    form = "{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}"
    with tqdm(total=1.0, desc=label, bar_format=form, file=sys.stderr) as bar:
        yield lambda fraction, now: bar.update(max(0.0, fraction - bar.n))


def _line(label: str) -> Iterator[Told]:
    begin = time.perf_counter()

    def tell(fraction: float, now: float) -> None:
        sys.stderr.write(f"\r{label}: {100 * fraction:3.0f} %, {time.perf_counter() - begin:.1f} s")
        sys.stderr.flush()

    try:
        yield tell
    finally:
        sys.stderr.write("\n")


class RunProgress:
    """Reports the progress of a run through an interval, from the times that it has reached.

    Parameters
    ----------
    tell : callable
        Receives the fraction done and the elapsed seconds.
    first, last : float
        The interval, in either direction.
    """

    def __init__(self, tell: Told, first: float, last: float) -> None:
        self._tell, self._first, self._last = tell, first, last
        self._ticker, self._begin = Ticker(), time.perf_counter()

    def __call__(self, reached: float) -> None:
        if self._ticker.due():
            self.end(reached)

    def end(self, reached: float) -> None:
        """The last report, or one that must not be left out."""
        done = (reached - self._first) / (self._last - self._first) if self._last != self._first else 1.0
        self._tell(min(max(done, 0.0), 1.0), time.perf_counter() - self._begin)


class Ticker:
    """Limits the rate of reports to one per 50 ms."""

    def __init__(self) -> None:
        self._next = time.perf_counter() + APART

    def due(self) -> bool:
        """Whether a report is due."""
        now = time.perf_counter()
        if now < self._next:
            return False
        self._next = now + APART
        return True
