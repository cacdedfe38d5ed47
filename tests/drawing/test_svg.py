"""Texts of pictures hold what XML 1.0 allows, and nothing else."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from gearlib.drawing.svg import element, escaped, number


@pytest.mark.parametrize(
    "allowed", [" ", "\t", "\n", "\x7f", "\ud7ff", "\ue000", "\ufffd", "\U00010000", "\U0001d714", "\U0010ffff"]
)
def test_characters_that_xml_allows_are_kept(allowed: str) -> None:
    assert escaped(f"a{allowed}b") == f"a{allowed}b"
    assert ET.fromstring(element("text", escaped(f"a{allowed}b"))).text == f"a{allowed}b"


@pytest.mark.parametrize("other", ["\0", "\x0b", "\x1f", "\ud800", "\ufffe", "\uffff"])
def test_characters_that_xml_does_not_allow_are_dropped(other: str) -> None:
    assert escaped(f"a{other}b") == "ab"


def test_marks_of_elements_are_written_out() -> None:
    text = "<a & \"b\" > 'c'"
    assert ET.fromstring(element("text", escaped(text), title=text)).text == text
    assert ET.fromstring(element("text", "", title=text)).get("title") == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-0.004, "0"), (-0.006, "-0.01"), (100.0, "100"), (2.5, "2.5"), (1.239, "1.24"), (-12.0, "-12")],
)
def test_numbers_have_two_decimals_at_most(value: float, text: str) -> None:
    assert number(value) == text
