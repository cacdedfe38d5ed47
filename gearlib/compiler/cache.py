"""On-disk cache of object code: its folder, its permissions, its maximum size.

The folder is ``GEARLIB_CACHE``, or the user's cache folder. A file is named by a digest of its inputs, so concurrent writers agree on
its content, and files are written atomically. Object code carries a checksum (`cached_bytes`). What cannot be cached is recomputed: a
damaged or read-only cache costs time, never a result. A folder that other users can write to is rejected with a warning
(`gearlib.compiler.ownership`).
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from threading import RLock
from typing import Any
from weakref import finalize

from gearlib.compiler.ownership import is_own, make_private, read_own, why_foreign
from gearlib.progress import notice

try:
    VERSION = metadata.version("gearlib")
except metadata.PackageNotFoundError:  # run from a source tree
    VERSION = "source"
LARGEST = 512 * 2**20  # bytes; the least recently used files are evicted first
FORMAT = "4"
ONE_IN = 16  # object files are small, so the total size is summed (some 20 us per file) for one in this many only
_SEAL = 32  # bytes of the checksum before the content
_temporary: tuple[Path, finalize[..., Any]] | None = None  # the folder, and the finalizer that deletes it when the process ends
_refused: set[str] = set()  # folders that a warning was given for
_noticed: set[str] = set()  # what users were told of
COMPILING = RLock()
"""Held while anything is compiled: by one thread at a time, and not across a fork."""


def after_fork() -> None:
    """After a fork: the child must not delete the parent's temporary folder."""
    global _temporary
    if _temporary is not None:
        _temporary[1].detach()
        _temporary = None
    COMPILING.release()


if sys.platform != "win32":  # a child forked while another thread compiles would wait for its lock for ever
    os.register_at_fork(before=COMPILING.acquire, after_in_parent=COMPILING.release, after_in_child=after_fork)


def folder() -> Path:
    """Cache folder of this version, created if it does not exist."""
    chosen = os.environ.get("GEARLIB_CACHE")
    if not chosen:
        from platformdirs import user_cache_dir

        chosen = user_cache_dir("gearlib", appauthor=False)
    path = Path(chosen) / f"{VERSION}-{FORMAT}-py{sys.version_info.major}.{sys.version_info.minor}"
    with suppress(OSError, RuntimeError):  # a cycle of symbolic links is a RuntimeError
        make_private(path)
        path = path.resolve()
        foreign = why_foreign(path)
        if foreign is None and os.access(path, os.W_OK):
            return path
        if foreign is not None and chosen not in _refused:
            _refused.add(chosen)
            warnings.warn(
                f"the cache {path} is not used, since code placed there by others would be executed: {foreign}; "
                "compiled code is cached for this process only (GEARLIB_CACHE names a folder of your own)",
                RuntimeWarning, stacklevel=2,
            )  # fmt: skip
    return private()


def private() -> Path:
    """Temporary folder of this process."""
    global _temporary
    if _temporary is None:
        folder = tempfile.mkdtemp(prefix="gearlib-")
        _temporary = Path(folder), finalize(COMPILING, shutil.rmtree, folder, ignore_errors=True)
    return _temporary[0]


def cached_bytes(name: str, make: Callable[[], bytes], slow: str = "") -> bytes:
    """Content of a cached file; computed and written where the file is missing or damaged.

    Parameters
    ----------
    name : str
        File name: a digest of everything that the content depends on.
    make : callable
        Computes the content.
    slow : str
        What is compiled, if that takes a second or more: a user at a terminal is told so, once in a process.
    """
    path = folder() / name
    with suppress(OSError):
        seal, content = (whole := read_own(path))[:_SEAL], whole[_SEAL:]
        if seal == seal_of(name, content):
            with suppress(OSError):
                os.utime(path)
            return content
    if slow and slow not in _noticed:
        _noticed.add(slow)
        kept = "until the process ends" if _temporary is not None and path.parent == _temporary[0] else f"in {path.parent}"
        notice(f"gearlib compiles {slow}; the result is kept {kept}")
    content = make()
    seal = seal_of(name, content)
    with suppress(OSError):
        write(path, seal + content)
        if seal[0] % ONE_IN == 0:
            shrink(path)
    return content


def seal_of(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\0" + content).digest()


def write(path: Path, content: bytes) -> None:
    handle, temporary = tempfile.mkstemp(prefix=f"{path.stem}.", suffix=".tmp", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary)
        raise


def shrink(kept: Path) -> None:
    """Evict the least recently used files once the cache of all versions exceeds its limit."""
    files: list[tuple[float, int, Path]] = []
    for version in kept.parent.parent.glob("*-py*"):
        if is_own(version):
            for file in version.rglob("gearlib_*"):
                with suppress(OSError):
                    stat = file.stat()
                    files.append((stat.st_mtime, stat.st_size, file))
    total = sum(size for _, size, _ in files)
    for _, size, file in sorted(files):
        if total <= LARGEST:
            break
        if file != kept:
            with suppress(OSError):
                file.unlink()
                total -= size
