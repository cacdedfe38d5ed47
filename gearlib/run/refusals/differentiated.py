"""Refusal of sensitivities for runs that cannot be differentiated."""

from __future__ import annotations

from typing import Any

from gearlib.errors import ArgumentError
from gearlib.run.result import Result
from gearlib.run.tangents.requested import CONTINUED, refuse_form
from gearlib.run.translation import Translation


def refuse_tangents(translation: Translation, form: str, start: Any) -> None:
    """Check that a run with sensitivities can be differentiated.

    Raises
    ------
    ArgumentError
        Sampled controllers, a form of the equations that leaves unknowns to IDA, or a start whose dependence on parameters is unknown.
    """
    refuse_form(translation, form)
    if isinstance(start[0] if isinstance(start, tuple) else start, Result):
        raise ArgumentError(CONTINUED)
