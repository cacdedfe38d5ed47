"""Kernel templates: their source with the placeholders of one instance filled in."""

from __future__ import annotations

import re
from collections.abc import Callable

from gearlib.program.program import Batch

_TOKEN = re.compile(r"\b([xpr])(\d+)\b")


def expression(
    batch: Batch, row: int, argument: Callable[[int], str], parameter: Callable[[int], str], flag: Callable[[int], str]
) -> str:
    """The kernel's source with each placeholder replaced; ``row`` selects the signs."""
    text = unsigned(batch, row, argument, parameter, flag)
    return text if batch.signs[row] > 0 else f"-({text})"


def unsigned(
    batch: Batch, row: int, argument: Callable[[int], str], parameter: Callable[[int], str], flag: Callable[[int], str]
) -> str:
    """The same without the overall sign."""
    kernel = batch.kernel
    position = {("x", c): a for a, c in enumerate(kernel.columns)}
    position |= {("p", c): a for a, c in enumerate(kernel.parameters)}
    position |= {("r", c): a for a, c in enumerate(kernel.relations)}
    signs = batch.argument_signs[row]

    def replace(match: re.Match[str]) -> str:
        kind, number = match.group(1), int(match.group(2))
        a = position[kind, number]
        if kind == "p":
            return parameter(a)
        if kind == "r":
            return flag(a)
        if signs[a] == 0:
            return "0.0"
        return argument(a) if signs[a] > 0 else f"(-{argument(a)})"

    return _TOKEN.sub(replace, kernel.scalar)
