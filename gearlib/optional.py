"""Lazy import of optional dependencies: pandas for tables, matplotlib for plots, xarray, zarr and pyarrow for some files."""

from __future__ import annotations

import importlib
from typing import Any

from gearlib.errors import MissingPackageError


def optional(module: str) -> Any:
    """Import a module of an optional package on first use.

    Parameters
    ----------
    module : str
        For example ``"matplotlib.pyplot"``.

    Raises
    ------
    MissingPackageError
        The package is not installed, or cannot be imported; the message says how to install it.

    Examples
    --------
    >>> optional("math").sqrt(4.0)
    2.0
    >>> optional("no_such_package.inner")
    Traceback (most recent call last):
    gearlib.errors.MissingPackageError: this needs no_such_package, which is not installed: pip install no_such_package
    """
    package = module.partition(".")[0]
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as problem:
        if (problem.name or package).partition(".")[0] == package:
            raise MissingPackageError(f"this needs {package}, which is not installed: pip install {package}") from None
        raise MissingPackageError(
            f"this needs {package}, which does not find {problem.name}: pip install {problem.name}"
        ) from None
    except ImportError as problem:  # installed but broken: mixed versions, or a missing system library
        raise MissingPackageError(f"this needs {package}, which cannot be imported: {problem}") from problem
