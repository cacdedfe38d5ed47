"""`packed`: components and functions as bytes that another process can read."""

from __future__ import annotations

import importlib.util
import pickle
from typing import Any


def packed(value: Any) -> bytes:
    """A value as bytes for `pickle.loads`, also of classes and functions of a notebook where cloudpickle is installed.

    >>> pickle.loads(packed({"a": 1}))
    {'a': 1}
    """
    if importlib.util.find_spec("cloudpickle") is None:
        return pickle.dumps(value)
    import cloudpickle

    return bytes(cloudpickle.dumps(value))
