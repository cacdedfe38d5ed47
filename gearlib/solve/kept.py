"""Compiled loops that are kept on disk under a digest of every source that goes into them.

numba recognises its files by the file of the function alone, and would run an old loop after a change of what it calls. So the
function that numba sees is a shell in a generated module, whose text holds the digest; it lies in the cache of generated code.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from gearlib.codegen.cache import load

SOURCES = ("rk_*.py", "ida_*.py", "native_call.py", "tableaux.py", "table_feed.py")
REGISTERED: dict[str, tuple[Any, Any]] = {}


@cache
def digest() -> str:
    """Of the sources of all compiled loops."""
    files = sorted(path for pattern in SOURCES for path in Path(__file__).parent.glob(pattern))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def keep(inner: Any, decorate: Callable[[Callable[..., Any]], Any]) -> Any:
    """Compile a function, or find it compiled.

    Parameters
    ----------
    inner : numba dispatcher
        What is run.
    decorate : callable
        numba's ``cfunc(...)`` or ``njit(...)`` with a signature and ``cache=True``.
    """
    name, arguments = inner.__name__.lstrip("_"), ", ".join(inspect.signature(inner.py_func).parameters)
    key = f"{inner.__module__}.{name}"
    REGISTERED[key] = inner, decorate
    text = (
        f'"""`{key}`, from sources with the digest {digest()}."""\n'
        f"from {__name__} import REGISTERED\n\n"
        f'inner, decorate = REGISTERED["{key}"]\n\n\n'
        f"@decorate\ndef {name}({arguments}):\n    return inner({arguments})\n"
    )
    return getattr(load(text), name)
