"""Modelica's grammar: sections of a class, and how deeply texts may be nested."""

from __future__ import annotations

import pytest

from gearlib.errors import ModelicaError
from gearlib.modelica.text_parser import DEEPEST_TEXT, parsed


def test_sections_of_a_class_may_follow_in_any_order() -> None:
    text = """
        model M
          Real a;
        protected
          Real b = 1;
          annotation(Documentation(info="between"));
        equation
          a = b;
        public
          parameter Real c = 2;
        initial equation
          a = c;
        equation
          b = a;
        protected
        end M;
        model N end N;"""
    first, second = parsed(text).classes
    assert (first.name, second.name) == ("M", "N")
    assert [element.name for element in first.elements] == ["a", "b", "c"]  # type: ignore[union-attr]
    assert (len(first.equations), len(first.initial_equations)) == (2, 1)


def nested(levels: int, beside: int = 0) -> str:
    """An expression in so many brackets, behind others that are not nested."""
    others = " ".join(f"Real y{k} = if true then (1) else (2);" for k in range(beside))
    return f"model M {others} Real x = {'(' * levels}1{')' * levels}; end M;"


@pytest.mark.parametrize("beside", [0, 2 * DEEPEST_TEXT])
def test_depth_is_that_of_what_is_open(beside: int) -> None:
    """Of the class, the expression and its brackets; what was closed before does not count."""
    assert parsed(nested(DEEPEST_TEXT - 2, beside)).classes[0].name == "M"
    with pytest.raises(ModelicaError, match="nested too deeply; give parts of it to variables"):
        parsed(nested(DEEPEST_TEXT - 1, beside))


@pytest.mark.parametrize("beside", [0, 2 * DEEPEST_TEXT])
def test_classes_nest_as_deeply(beside: int) -> None:
    def text(levels: int) -> str:
        inner = " ".join(f"model N{k} end N{k};" for k in range(beside))
        for k in range(levels - 1):
            inner = f"package P{k} {inner} end P{k};"
        return f"package Q {inner} end Q;"

    deepest = DEEPEST_TEXT - 1 if beside else DEEPEST_TEXT
    assert parsed(text(deepest)).classes[0].name == "Q"
    with pytest.raises(ModelicaError, match="nested too deeply"):
        parsed(text(deepest + 1))
