"""Readable identifiers for paths: ``body[0].w`` becomes ``body_0_w``."""

from __future__ import annotations

import keyword
import unicodedata
from collections.abc import Iterable

RESERVED = {"t", "x", "dx", "data", "index", "v", "k", "i", "j", "n", "s", "time"}


def identifiers(paths: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """Distinct identifiers, in the order of the paths.

    >>> identifiers(["body[0].w", "body_0.w", "der(load.phi)", "J².w"])
    ['body_0_w', 'body_0_w_2', 'der_load_phi', 'J2_w']
    """
    used = set(RESERVED).union(taken)
    result = []
    for path in paths:
        allowed = (c if f"_{c}".isidentifier() else " " for c in unicodedata.normalize("NFKC", path))  # as Python reads names
        base = "_".join("".join(allowed).split()).strip("_") or "value"
        if base[0].isdigit() or keyword.iskeyword(base):
            base = f"_{base}"
        name, count = base, 1
        while name in used:
            count += 1
            name = f"{base}_{count}"
        used.add(name)
        result.append(name)
    return result
