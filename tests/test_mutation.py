"""What counts as noticing a mutant."""

from __future__ import annotations

import doctest
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

import gearlib as gl
from gearlib.errors import SingularError
from tests.mutation import (
    FOUND,
    Mutant,
    accepted,
    around,
    definition,
    is_claim,
    is_compiled,
    logged,
    mirrors,
    source,
    summary,
    words,
)


def raised(error: BaseException) -> Any:
    try:
        raise error
    except BaseException:
        return sys.exc_info()


@pytest.mark.parametrize(
    ("failure", "claim"),
    [
        (AssertionError("1 == 2"), True),
        (pytest.fail.Exception("DID NOT RAISE"), True),
        (SingularError("no pivot"), True),
        (gl.InputWarning("nobody gave it"), True),
        (RuntimeWarning("overflow"), True),
        (IndexError("out of bounds"), False),
        (TypeError("no array"), False),
    ],
)
def test_refusals_and_warnings_are_claims_and_raw_exceptions_are_not(failure: BaseException, claim: bool) -> None:
    assert is_claim(failure) == claim
    example = doctest.Example("f()\n", "1\n")
    shown = doctest.DocTest([example], {}, "f", None, None, None)
    assert is_claim(doctest.UnexpectedException(shown, example, raised(failure))) == claim


def test_another_exception_than_the_expected_one_is_a_claim_that_fails() -> None:
    """It came out of the block that says what is raised, at any depth; one beside the block says nothing."""

    def within() -> None:
        with pytest.raises(ValueError, match="even"):
            [1][int("1")]

    def beside() -> None:
        with pytest.raises(ValueError, match="invalid"):
            int("x")
        [1][int("1")]

    failures = []
    for call in (within, beside):
        try:
            call()
        except IndexError as failure:
            failures.append(failure)
    assert [is_claim(failure) for failure in failures] == [True, False]


def test_exceptions_count_as_noticed_and_crashes_do_not() -> None:
    """Where every test of a line meets an exception there is no value to judge; these are counted apart, too."""
    verdicts = [*["assertion"] * 5, "exception", *["no value"] * 2, "crash", "survived", "accepted", "accepted"]
    assert {*FOUND.values()} < {*verdicts}
    text = summary([Mutant("m.py", "", k, 1, "a", "b", verdict) for k, verdict in enumerate(verdicts)])
    assert (
        "12 mutants: 5 noticed by an assertion, 3 by an exception (2 of them in all tests of their lines), 1 by a crash" in text
    )
    assert "1 by a crash, 1 survived, 2 accepted" in text
    assert "50.0 % were noticed by an assertion (80.0 % by any test); of those that give values, 62.5 %" in text


def test_a_sample_goes_on_from_its_log(tmp_path: Path) -> None:
    tried = [
        Mutant("a/m.py", "Not", k, 3, "x", "not x", verdict, "t::t", 1.5) for k, verdict in enumerate(["assertion", "crash"])
    ]
    log = tmp_path / "log.jsonl"
    assert logged(log) == []
    log.write_text("".join(json.dumps(asdict(one) | {"key": one.key}) + "\n" for one in tried))
    assert logged(log) == tried
    assert {one.change for one in logged(log)} == {("a/m.py", "Not", 0), ("a/m.py", "Not", 1)}


def test_a_mutant_is_first_tried_by_the_tests_of_its_module_and_by_those_around_its_line() -> None:
    assert mirrors("gearlib/linear/balancing.py") == ["tests/linear/test_balancing.py", "gearlib/linear/balancing.py"]
    module = "tests/mutation.py"
    line = next(
        number for number, text in enumerate(source(module).splitlines(), 1) if text.strip().startswith("self.targets,")
    )
    names = [getattr(node, "name", "") for node in around(module, line)]
    assert names == ["", "__init__", "Notice"]


def test_a_test_names_a_function_by_calling_it() -> None:
    """One with an underscore as well: such tests are run first."""

    def calling(_private: Any, public: Any) -> None:
        _private(public())

    module = "gearlib/linear/poles.py"
    line = next(n for n, text in enumerate(source(module).splitlines(), 2) if text.startswith("def _"))
    name = source(module).splitlines()[line - 2].removeprefix("def _").partition("(")[0]
    assert definition(module, line) == ("linear", name)
    assert {"calling", "private", "public"} <= words(calling)


def test_what_is_compiled_is_not_tried_in_place() -> None:
    """Machine code is made of the text of a file, whatever becomes of the Python function."""
    module = "gearlib/solvers/drive/trace.py"
    lines = source(module).splitlines()
    compiled, called = (
        next(n for n, text in enumerate(lines, 2) if text.startswith(head)) for head in ("def left_out", "def width")
    )
    assert is_compiled(module, compiled)
    assert not is_compiled(module, called)


def test_the_list_of_accepted_mutants_can_be_read() -> None:
    assert all(module.endswith(".py") and old != new and why for (module, old, new), why in accepted().items())
