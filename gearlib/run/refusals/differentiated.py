"""Refusal of sensitivities for runs that cannot be differentiated."""

from __future__ import annotations

from typing import Any

from gearlib.errors import ArgumentError
from gearlib.run.result import Result
from gearlib.run.translation import Translation


def refuse_tangents(translation: Translation, form: str, start: Any) -> None:
    """Check that a run with sensitivities can be differentiated.

    Raises
    ------
    ArgumentError
        Sampled controllers, a form of the equations that leaves unknowns to IDA, or a start whose dependence on parameters is unknown.
    """
    if form != "ode":
        raise ArgumentError(
            f"sensitivities need form='ode', in which all unknowns follow from the states; the form is {form!r}"
        )
    if translation.controllers:
        raise ArgumentError(
            f"{translation.name} has sampled controllers, functions of Python, or delays: how what they give changes with a parameter is "
            "not known, so that there are no sensitivities; write the controller as equations"
        )
    if isinstance(start[0] if isinstance(start, tuple) else start, Result):
        raise ArgumentError(
            "sensitivities are those of a whole run: a run that goes on from a result does not know how its start changes; "
            "begin at the beginning, or give start values: start={'load.w': ...}"
        )
