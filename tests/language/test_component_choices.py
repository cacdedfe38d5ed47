"""Structural choices out of some are taken by value and kind."""

from __future__ import annotations

from typing import Any

import pytest

import gearlib as gl
from gearlib.errors import BindingError
from gearlib.language.interior import structural_of


def of(*choices: Any) -> Any:
    """A class with these choices, of which the first is the default."""
    return type("Chosen", (gl.Component,), {"kind": gl.Structural(choices[0], choices=choices)})


@pytest.mark.parametrize("choices", [(1, 2), (False, True), ("one", "two"), (1.5, 2.0), (None, "one"), (0, "none", 2.5)])
def test_each_choice_is_taken(choices: tuple[Any, ...]) -> None:
    assert [structural_of(of(*choices)(kind=choice))["kind"] for choice in choices] == list(choices)
    assert structural_of(of(*choices)())["kind"] == choices[0]


@pytest.mark.parametrize(
    ("choices", "wrong"),
    [
        ((1, 2), 2.0), ((1, 2), True), ((1, 2), "1"), ((1, 2), 3), ((False, True), 1), ((False, True), 0.0), ((False, True), "True"),
        (("one", "two"), "three"), (("one", "two"), ["one"]), ((0, "none"), False), ((0, "none"), None),
    ],
)  # fmt: skip
def test_what_only_equals_a_choice_is_refused(choices: tuple[Any, ...], wrong: Any) -> None:
    with pytest.raises(BindingError) as refused:
        of(*choices)(kind=wrong)
    valid = ", ".join(map(repr, choices))
    assert str(refused.value) == f"Chosen: structural choice 'kind' is {wrong!r}; valid choices: {valid}"
