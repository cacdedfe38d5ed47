"""The page of the vocabulary is that of the code. (That no noun stands for two things is counted in `tests.architecture`.)"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache

import pytest

from tests import architecture, vocabulary


@cache
def texts() -> dict[str, str]:
    """Names and texts of each module, by path; no comments."""
    return {str(path): "\n".join(words(tree)) for path, tree in vocabulary.modules().items()}


def words(tree: ast.Module) -> Iterator[str]:
    for node in architecture.nodes(tree):
        for value in vars(node).values():
            if isinstance(value, str):
                yield value
            elif isinstance(value, list):  # the names of a global statement
                yield from (item for item in value if isinstance(item, str))


def test_words_are_names_and_texts_without_comments() -> None:
    text = 'from a.b import c as d  # e\ndef f(g, *, h=0):\n    """i j"""\n    global k, l\n    return m.n(o=f"p {q} r" "s")'
    assert {*re.findall(r"\w+", " ".join(words(ast.parse(text))))} == {*"abcdfghijklmnopq", "rs"}


def test_every_file_and_class_is_on_the_page_as_the_code_describes_it() -> None:
    page = vocabulary.PAGE.read_text(encoding="utf-8")
    assert page.split(vocabulary.HEADING)[1] == vocabulary.listed().split(vocabulary.HEADING)[1], "python tests/vocabulary.py"


def test_every_file_and_class_says_what_it_is() -> None:
    silent = [str(path) for path, tree in vocabulary.modules().items() if not vocabulary.first_line(tree)]
    silent += [
        f"{path}: {c.name}"
        for path, tree in vocabulary.modules().items()
        for c in vocabulary.classes(tree)
        if not vocabulary.first_line(c)
    ]
    assert silent == []


@pytest.mark.parametrize("word", vocabulary.abandoned())
def test_word_is_used_no_more(word: str) -> None:
    """Neither in names nor in texts, as a whole word or as a part of a name."""
    wanted = re.compile(rf"(?<![A-Za-z]){word}(?![a-z])", re.IGNORECASE)
    assert [path for path, text in texts().items() if wanted.search(text)] == []


def test_some_words_are_used_no_more() -> None:
    assert len(vocabulary.abandoned()) >= 3


def test_representations_of_the_page_of_phases_exist_once() -> None:
    page = (vocabulary.ROOT / "docs" / "phases.md").read_text(encoding="utf-8").split("## Every representation once")[1]
    rows = re.findall(r"^\| `(\w+)` \| `([\w.]+)` \|", page, re.MULTILINE)
    assert len(rows) == len({name for name, _ in rows}) >= 20
    known = {
        (c.name, ".".join(path.with_suffix("").parts[1:]))
        for path, tree in vocabulary.modules().items()
        for c in vocabulary.classes(tree)
    }
    assert set(rows) - known == set()
    forms = {form.removeprefix("gearlib.").rpartition(".")[::2] for form in architecture.FORMS}
    assert {(module, name) for name, module in rows} >= forms
