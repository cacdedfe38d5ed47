"""`replacing`: atomic replacement of files by writing to a temporary path and renaming."""

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
    """Temporary path for a file or folder, renamed to its target on success and removed on failure.

    Parameters
    ----------
    path : path
        Target. Existing content stays intact until the new one is complete.

    Raises
    ------
    FileError
        The folder does not exist, or is not writable.

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
    """Rename to the target; an existing folder is moved aside first, since only empty folders can be replaced."""
    if not (beside.is_dir() and target.exists()):
        os.replace(beside, target)
        return
    target.rename(aside)
    try:
        beside.rename(target)
    except OSError:
        aside.rename(target)
        raise
