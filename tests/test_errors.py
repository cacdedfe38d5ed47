"""The tree of exceptions, and the advice that their messages give."""

from __future__ import annotations

import builtins
import re
from pathlib import Path

import pytest

import gearlib as gl
from gearlib import errors

ROOT = Path(__file__).resolve().parents[1]


def test_every_exception_is_in_the_drawn_tree() -> None:
    drawn = re.findall(r"[├└]── (\w+)", errors.__doc__ or "")
    assert sorted(["GearlibError", "GearlibWarning", *drawn]) == errors.__all__
    for name in drawn:
        base = errors.GearlibWarning if name.endswith("Warning") else errors.GearlibError
        assert issubclass(getattr(errors, name), base)


@pytest.mark.parametrize(
    ("name", "builtin"),
    [("BindingError", TypeError), ("BoundError", ValueError), ("NameLookupError", KeyError), ("SolverError", RuntimeError)],
)
def test_they_are_also_what_python_would_raise(name: str, builtin: type[Exception]) -> None:
    assert issubclass(getattr(errors, name), builtin)


def test_the_bases_are_public() -> None:
    assert gl.GearlibError is errors.GearlibError
    assert gl.GearlibWarning is errors.GearlibWarning


def test_a_missing_name_is_not_printed_in_quotes() -> None:
    assert str(errors.NameLookupError("the model has no output 'w'")) == "the model has no output 'w'"
    assert str(errors.NameLookupError()) == ""


@pytest.mark.parametrize(
    ("name", "valid", "advice"),
    [
        ("w", [], "there are none"),
        ("w_loda", ["w_load", "phi"], "did you mean 'w_load'? Valid names: phi, w_load"),
        ("j", ["J", "w"], "did you mean 'J'? Valid names: J, w"),
        ("zzz", ["phi"], "Valid names: phi"),
        ("v7x", [f"v{i}" for i in range(20)], "did you mean 'v7'"),
        ("zzz", [f"v{i:02d}" for i in range(20)], "there are 20 names, among them v00, v01"),
    ],
)
def test_nearest(name: str, valid: list[str], advice: str) -> None:
    assert errors.nearest(name, valid).startswith(advice)


def test_docstrings_name_the_exceptions_that_are_raised() -> None:
    texts = [path.read_text(encoding="utf-8") for top in ("gearlib", "library") for path in (ROOT / top).rglob("*.py")]
    own = [name for text in texts for name in re.findall(r"^class (\w+)\(Exception\)", text, re.M)]
    known = {"LinAlgError", *vars(errors), *vars(builtins), *own}
    for text in texts:
        for margin, section in re.findall(r"^( *)Raises\n +-+\n(.*?)(?=\n\n|\"\"\")", text, re.M | re.S):
            for line in re.findall(rf"^{margin}(\S.*)", section, re.M):
                assert {*line.split(", ")} <= known, section
