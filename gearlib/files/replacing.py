"""`replacing`: a file is written beside the place where it belongs, and then renamed."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gearlib.errors import FileError


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path to write a file or a folder to; it takes its place when all is written, and vanishes if writing fails.

    Parameters
    ----------
    path : path
        Where the file belongs. What is there stays whole until the new one is.

    Raises
    ------
    FileError
        The folder does not exist, or the system refuses to write there.

    Examples
    --------
    >>> folder = getfixture("tmp_path")
    >>> with replacing(folder / "numbers.txt") as beside:
    ...     _ = beside.write_text("1 2 3")
    >>> [file.name for file in folder.iterdir()]
    ['numbers.txt']
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise FileError(f"{target} cannot be written: there is no folder {target.parent}")
    try:
        folder = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as problem:
        raise FileError(f"{target} cannot be written: {problem.strerror or problem}") from None
    try:
        yield (beside := folder / target.name)
        if target.is_dir() and not beside.is_dir():
            raise FileError(f"{target} cannot be written: it is a folder")
        _put(beside, target, folder / "before")
    except OSError as problem:
        raise FileError(f"{target} cannot be written: {problem.strerror or problem}") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _put(beside: Path, target: Path, aside: Path) -> None:
    """Rename to the target; a folder that is there is moved aside first, since one takes the place of an empty one only."""
    if not (beside.is_dir() and target.exists()):
        os.replace(beside, target)
        return
    target.rename(aside)
    try:
        beside.rename(target)
    except OSError:
        aside.rename(target)
        raise
