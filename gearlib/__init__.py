"""gearlib: equation-based dynamics of gear trains.

All public names are here; modules are imported on first use.
"""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

__version__ = "0.1.0"

# one list of the public names and their modules, which type checkers read, too
_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOME = {name: module for module, name in re.findall(r"^from (\S+) import (\w+) as \2$", _STUB, re.MULTILINE)}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    if name.startswith("_"):  # looked up by Python itself: __path__, __wrapped__, ...
        raise AttributeError(f"module 'gearlib' has no attribute '{name}'")
    from gearlib.errors import nearest

    raise AttributeError(f"module 'gearlib' has no attribute '{name}'; {nearest(name, _HOME)}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
