"""`packed`: pickles components and functions for other processes."""

from __future__ import annotations

import importlib.util
import pickle
from typing import Any


def packed(value: Any) -> bytes:
    """A value as bytes for `pickle.loads`; classes and functions defined in a notebook need cloudpickle.

    >>> pickle.loads(packed({"a": 1}))
    {'a': 1}
    """
    if importlib.util.find_spec("cloudpickle") is None:
        return pickle.dumps(value)
    import cloudpickle

    return bytes(cloudpickle.dumps(value))
