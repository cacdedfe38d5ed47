"""Validation of the subject of an analysis: a compiled system, or a model that can be compiled."""

from __future__ import annotations

from typing import Any

from gearlib.arguments import shown
from gearlib.errors import ArgumentError
from gearlib.language.component import Component
from gearlib.run.result import Result
from gearlib.run.sampling.controllers import refuse_controllers
from gearlib.run.translation import Compiled, Translation


def is_compiled(model: Any) -> bool:
    """Whether a model is compiled, and not already linear."""
    return isinstance(model, Compiled)


def translation_of(system: Compiled) -> Translation:
    """The translation in a compiled system; `ArgumentError` for anything else."""
    if not isinstance(system, Compiled):
        raise ArgumentError(f"expected a compiled system, got {described(system)}")
    refuse_controllers(system.translation.component, "the analysis")
    return system.translation


def check_result(result: Result) -> None:
    """Raise `ArgumentError` for anything but the result of a run."""
    if not isinstance(result, Result):
        raise ArgumentError(f"expected the result of a run, got {described(result)}")


def described(value: Any) -> str:
    """Description of an object given in place of a system or a result, with the likely fix.

    >>> described(None)
    'None'
    >>> described(Component)
    'the component class Component; make one and compile it: gl.compile(Component(...))'
    """
    kind = type(value).__name__
    if isinstance(value, Component):
        return f"the component {kind}; compile it: gl.compile({kind}(...))"
    if isinstance(value, type) and issubclass(value, Component):
        return f"the component class {value.__name__}; make one and compile it: gl.compile({value.__name__}(...))"
    if isinstance(value, Result):
        return "the result of a run; give the system that was simulated"
    if is_compiled(value):
        return "a compiled system; simulate it first: system.simulate(t_end)"
    return shown(value) if type(value).__module__ == "builtins" else f"a {kind}"
