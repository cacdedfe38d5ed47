"""Where generated source and its machine code are kept between processes.

The folder is ``GEARLIB_CACHE``, or the user's cache folder. A file's name is a digest of its content, so concurrent writers agree,
and a stale or damaged file is never used. What cannot be written is made anew in a temporary folder.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from pathlib import Path
from types import ModuleType

LARGEST = 512 * 2**20  # bytes; the oldest files go first
FORMAT = "1"
_temporary: tempfile.TemporaryDirectory[str] | None = None
_loaded: dict[str, ModuleType] = {}


def folder() -> Path:
    """The cache folder of this version, made if need be."""
    import gearlib

    chosen = os.environ.get("GEARLIB_CACHE")
    if chosen is None:
        from platformdirs import user_cache_dir

        chosen = user_cache_dir("gearlib", appauthor=False)
    path = Path(chosen) / f"{gearlib.__version__}-{FORMAT}-py{sys.version_info.major}.{sys.version_info.minor}"
    try:
        path.mkdir(parents=True, exist_ok=True)
        if os.access(path, os.W_OK):
            return path
    except OSError:
        pass
    global _temporary
    if _temporary is None:
        _temporary = tempfile.TemporaryDirectory(prefix="gearlib-", ignore_cleanup_errors=True)
    return Path(_temporary.name)


def load(source: str) -> ModuleType:
    """The module with that source, from the cache where it was met before."""
    name = "gearlib_model_" + hashlib.sha256(source.encode()).hexdigest()[:24]
    if name in _loaded:
        return _loaded[name]
    path = folder() / f"{name}.py"
    if not _same(path, source):
        _write(path, source)
        _shrink(path.parent)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # numba finds the functions that it keeps on disk by their module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    _loaded[name] = module
    return module


def _same(path: Path, source: str) -> bool:
    try:
        return path.read_text(encoding="utf-8") == source
    except (OSError, UnicodeDecodeError):
        return False


def _write(path: Path, source: str) -> None:
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(source)
    os.replace(temporary, path)


def _shrink(path: Path) -> None:
    """Remove the oldest files when the folder has grown too large."""
    files = []
    for file in path.rglob("*"):
        try:
            stat = file.stat()
        except OSError:
            continue
        if file.is_file():
            files.append((stat.st_mtime, stat.st_size, file))
    total = sum(size for _, size, _ in files)
    for _, size, file in sorted(files):
        if total <= LARGEST:
            break
        try:
            file.unlink()
            total -= size
        except OSError:
            continue
