"""Lexer of Modelica text: tokens with line and column."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

from gearlib.errors import GearlibError, ModelicaError

TokenKind = Literal["identifier", "keyword", "number", "string", "symbol", "end of text"]

KEYWORDS = frozenset(
    {
        "algorithm", "and", "annotation", "block", "break", "class", "connect", "connector", "constant", "constrainedby", "der",
        "discrete", "each", "else", "elseif", "elsewhen", "encapsulated", "end", "enumeration", "equation", "expandable", "extends",
        "external", "false", "final", "flow", "for", "function", "if", "import", "impure", "in", "initial", "inner", "input", "loop",
        "model", "not", "operator", "or", "outer", "output", "package", "parameter", "partial", "protected", "public", "pure",
        "record", "redeclare", "replaceable", "return", "stream", "then", "true", "type", "when", "while", "within",
    }
)  # fmt: skip
_TOKEN = re.compile(
    r"""(?P<blank>\s+|//[^\n]*|/\*.*?\*/)
    |(?P<string>"(?:[^"\\]|\\.)*")
    |(?P<quoted>'(?:[^'\\]|\\.)+')
    |(?P<unended>/\*|["'])
    |(?P<number>\d+(?:\.\d*)?(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)
    |(?P<identifier>[A-Za-z_][A-Za-z_0-9]*)
    |(?P<symbol>:=|==|<>|<=|>=|\.\*|\./|\.\+|\.-|\.\^|[-+*/^=<>()\[\]{},;:.])""",
    re.VERBOSE | re.DOTALL,
)
_KINDS: dict[str, TokenKind] = {
    "string": "string", "quoted": "identifier", "identifier": "identifier", "number": "number", "symbol": "symbol",
}  # fmt: skip
_ESCAPED = {"n": "\n", "t": "\t", "r": "\r", "a": "\a", "b": "\b", "f": "\f", "v": "\v"}


@dataclass(frozen=True)
class TextPlace:
    """A position: the file (or "the text"), line and column, counted from 1."""

    source: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.source}, line {self.line}, column {self.column}"

    @contextmanager
    def in_refusals(self) -> Iterator[None]:
        """Refusals that do not know the text are said with this position."""
        try:
            yield
        except ModelicaError:
            raise
        except GearlibError as problem:
            raise ModelicaError(f"{self}: {problem}") from problem


@dataclass(frozen=True)
class Token:
    """A word, number, string or operator of the text."""

    kind: TokenKind
    text: str
    at: TextPlace

    def __str__(self) -> str:
        return self.kind if self.kind == "end of text" else f"'{self.text}'"


def tokens(text: str, source: str = "the text") -> list[Token]:
    """The tokens of a text, followed by an end marker.

    Raises
    ------
    ModelicaError
        An invalid character, or an unterminated string or comment.

    Examples
    --------
    >>> [token.text for token in tokens("J*der(w) = 2.5e-3; // torque")][:-1]
    ['J', '*', 'der', '(', 'w', ')', '=', '2.5e-3', ';']
    """
    found: list[Token] = []
    line, begin, place = 1, 0, 0
    while place < len(text):
        match = _TOKEN.match(text, place)
        at = TextPlace(source, line, place - begin + 1)
        if match is None:
            raise ModelicaError(f"{at}: the sign {text[place]!r} has no meaning here")
        kind, words = match.lastgroup, match.group()
        if kind == "unended":
            raise ModelicaError(f"{at}: a {'comment' if words == '/*' else 'string'} that does not end")
        if kind == "string":
            words = re.sub(r"\\(.)", lambda m: _ESCAPED.get(m[1], m[1]), words[1:-1], flags=re.DOTALL)
        if kind != "blank":
            found.append(Token("keyword" if kind == "identifier" and words in KEYWORDS else _KINDS[str(kind)], words, at))
        newlines = match.group().count("\n")
        if newlines:
            line += newlines
            begin = place + match.group().rindex("\n") + 1
        place = match.end()
    found.append(Token("end of text", "", TextPlace(source, line, place - begin + 1)))
    return found
