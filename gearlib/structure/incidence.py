"""Incidence of equations and (differentiated) variables: nodes, entries."""

from __future__ import annotations

from collections.abc import Callable

Node = tuple[int, int]  # a variable or equation, and how often it is differentiated
Columns = Callable[[int, int], list[Node]]  # (equation, times differentiated) -> variables with their orders
Entry = tuple[int, int, int, float]  # a partial derivative: equation, variable, derivative order, value
