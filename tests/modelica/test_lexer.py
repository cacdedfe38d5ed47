"""Tokens of Modelica text: kinds, texts and places."""

from __future__ import annotations

import pytest

from gearlib.modelica.lexer import tokens


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('"a gear"', "a gear"),
        ('""', ""),
        (r'"he said \"two\""', 'he said "two"'),
        (r'"a\tb\nc\\d\?"', "a\tb\nc\\d?"),
        ('"two\nlines // no comment"', "two\nlines // no comment"),
    ],
)
def test_strings_say_what_stands_between_their_quotes(text: str, said: str) -> None:
    found, following, end = tokens(f"{text} J")
    assert (found.kind, found.text) == ("string", said)
    assert (following.kind, following.text, end.kind) == ("identifier", "J", "end of text")
    assert (following.at.line, following.at.column) == (1 + text.count("\n"), len(text.rpartition("\n")[2]) + 2)
