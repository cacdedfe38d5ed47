"""The tree of exceptions, and the advice that their messages give."""

from __future__ import annotations

import builtins
import re
import warnings
from functools import partial
from pathlib import Path
from typing import Any

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
    assert str(errors.AttributeNameError("first", "second")) == "first"


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


MANY = [f"v{i:02d}" for i in range(20)]


@pytest.mark.parametrize(
    ("name", "valid", "advice"),
    [
        ("load.omega", ["load.w", "load.phi"], "did you mean 'load.w'? Valid names: load.phi, load.w"),
        ("Omega", ["w", "xyz"], "did you mean 'w'? Valid names: w, xyz"), ("omega", ["load.w"], "Valid names: load.w"),
        ("LOAD.W", ["load.w", "load.v"], "did you mean 'load.w'? Valid names: load.v, load.w"),
        ("q.zzzzzz", ["p.w", "q.w", "q.phi"], "'q' has phi, w"), ("a.b.zzzzzzzz", ["a.b.w", "a.phi"], "'a.b' has w"),
        ("q.zzzzzz", [f"q.{v}" for v in MANY], f"'q' has {', '.join(MANY[:12])}"), ("zzz", ["b", "a", "b"], "Valid names: a, b"),
        ("zzz", MANY[:12], f"Valid names: {', '.join(MANY[:12])}"),
        ("zzz", MANY[:13], f"there are 13 names, among them {', '.join(MANY[:12])}"),
        ("spede", ["speed", *MANY], "did you mean 'speed'?"),
        ("speed_x", ["speed_a", "speed_b", "speed_c", "speed_d"],
         "did you mean 'speed_d' or 'speed_c' or 'speed_b'? Valid names: speed_a, speed_b, speed_c, speed_d"),
        ("q.zzzzzz", ["load.w"], "Valid names: load.w"), ("zzz", ["load.w", "w"], "Valid names: load.w, w"), ("a.b", [], "there are none"),
        ("abcd", ["abxy"], "did you mean 'abxy'? Valid names: abxy"), ("abcd", ["axyz"], "Valid names: axyz"),  # half of it alike
    ],
)  # fmt: skip
def test_nearest_in_full(name: str, valid: list[str], advice: str) -> None:
    assert errors.nearest(name, valid) == advice
    assert errors.nearest(name, iter(valid[::-1])) == advice


def test_of_the_names_as_many_are_shown_as_are_asked_for() -> None:
    assert errors.nearest("zzz", MANY[:3], limit=3) == "Valid names: v00, v01, v02"
    assert errors.nearest("zzz", MANY[:4], limit=3) == "there are 4 names, among them v00, v01, v02"
    assert errors.nearest("a.zzzzzz", [f"a.{v}" for v in MANY], limit=2) == "'a' has v00, v01"


def calling(name: str, function: Any) -> Any:
    """A function of a module of that name, which calls another one."""
    module: dict[str, Any] = {"__name__": name, "function": function}
    exec(compile("def call():\n    return function()", f"{name}.py", "exec"), module)
    return module["call"]


@pytest.mark.parametrize(
    ("modules", "blamed"),
    [
        ([], "here"), (["gearlib.run.simulate"], "here"), (["gearlib", "functools", "gearlib.linear"], "here"),
        (["gearlibrary"], "gearlibrary.py"), (["gearlib.run", "user.gearlib", "gearlib.run"], "user.gearlib.py"),
    ],
)  # fmt: skip
def test_a_warning_is_given_at_the_line_outside_of_gearlib_each_time(modules: list[str], blamed: str) -> None:
    call: Any = lambda: errors.warn("look", errors.InputWarning)  # noqa: E731
    if modules:
        call = calling(modules[0], partial(errors.warn, "look", errors.InputWarning))
        for name in modules[1:]:
            call = calling(name, call)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(3):
            call()
    assert [(str(w.message), w.category) for w in caught] == [("look", errors.InputWarning)] * 3
    assert {Path(w.filename).name for w in caught} == {Path(__file__).name if blamed == "here" else blamed}


def test_docstrings_name_the_exceptions_that_are_raised() -> None:
    texts = [path.read_text(encoding="utf-8") for top in ("gearlib", "library") for path in (ROOT / top).rglob("*.py")]
    own = [name for text in texts for name in re.findall(r"^class (\w+)\(Exception\)", text, re.M)]
    known = {"LinAlgError", *vars(errors), *vars(builtins), *own}
    for text in texts:
        for margin, section in re.findall(r"^( *)Raises\n +-+\n(.*?)(?=\n\n|\"\"\")", text, re.M | re.S):
            for line in re.findall(rf"^{margin}(\S.*)", section, re.M):
                assert {*line.split(", ")} <= known, section
