"""`Tree`: the instantiated component tree: instances, equations, connections and start values, not yet flattened."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

from gearlib.equations.template import Template
from gearlib.flatten.model import Instance
from gearlib.language.component import Component


@dataclass
class Tree:
    """Instantiated model before connections and alias elimination."""

    instances: list[Instance] = field(default_factory=list)
    rows: dict[Template, list[tuple[int, list[int], list[int]]]] = field(default_factory=lambda: defaultdict(list))
    local_rows: dict[Template, list[int]] = field(default_factory=lambda: defaultdict(list))  # instance numbers
    parameter_names: list[str] = field(default_factory=list)
    parameter_values: list[float] = field(default_factory=list)
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    written: list[int] = field(default_factory=list)  # parameters that are numbers in the expression of a binding
    dependents: dict[Any, tuple[list[tuple[int, ...]], list[int]]] = field(default_factory=dict)
    starts: list[tuple[int, int, bool]] = field(default_factory=list)
    started: set[int] = field(default_factory=set)  # variables whose start value an enclosing component sets
    choices: list[tuple[int, str, Any]] = field(default_factory=list)  # see gearlib.flatten.attributes
    inputs: list[int] = field(default_factory=list)
    links: list[list[int]] = field(default_factory=list)
    ports: list[tuple[int, str]] = field(default_factory=list)  # (instance, connector)
    loose_ports: list[tuple[int, str]] = field(default_factory=list)  # connected to nothing outside,
    inner_ports: list[tuple[int, str]] = field(default_factory=list)  # or to parts inside
    first_port: list[int] = field(default_factory=list)  # of each instance
    numbers: dict[int, int] = field(default_factory=dict)  # id(component) -> instance
    signals: dict[int, dict[str, tuple[Component, Any]]] = field(default_factory=dict)  # instance -> input -> scope, signal
    n_variables: int = 0
    discrete_names: list[str] = field(default_factory=list)
    discrete_starts: list[float] = field(default_factory=list)
    first_discrete: dict[int, int] = field(default_factory=dict)  # of each instance with discrete variables
    bound: dict[tuple[Template, tuple[int, ...]], int] = field(default_factory=dict)  # rows that are bindings -> input
    updates: dict[tuple[Template, bool], list[tuple[int, list[int], list[int], int]]] = field(
        default_factory=lambda: defaultdict(list)
    )
