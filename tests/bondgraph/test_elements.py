"""Values, symbols and laws of elements: what they may be, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp

from gearlib.bondgraph import energy_symbol
from gearlib.bondgraph.efforts_and_flows import rate_of
from gearlib.bondgraph.elements import by_law, checked, expression, symbol
from gearlib.errors import ArgumentError


@pytest.mark.parametrize(("kind", "bond", "name"), [("p", 17, "p_17"), ("q", 0, "q_0")])
def test_symbols_of_what_is_stored_and_of_its_rate(kind: str, bond: int, name: str) -> None:
    found = energy_symbol(kind, bond)
    assert found == symbol(name) == sp.Symbol(name, real=True)
    assert rate_of(found) == symbol(f"d{name}")
    with pytest.raises(ArgumentError, match=r"^energy_symbol: bond is -1"):
        energy_symbol(kind, -1)
    with pytest.raises(ArgumentError, match=r"^rate_of: variable is 'p_1'; expected a symbol, such as p_17$"):
        rate_of("p_1")


def test_laws_give_expressions_or_say_what_went_wrong() -> None:
    x = symbol("x")
    assert by_law(lambda y: y**2 / 2, x, "the law") == x**2 / 2
    assert checked(3, "a") == 3
    for law, said in ((lambda y: [y], "the law is [x]; expected a number or an expression"),
                      (lambda y: y.nothing, "the law raised AttributeError: "),
                      (lambda y: None, "the law is None; expected a number or an expression")):  # fmt: skip
        with pytest.raises(ArgumentError) as refused:
            by_law(law, x, "the law")
        assert str(refused.value).startswith(said)


@pytest.mark.parametrize(
    ("value", "found"),
    [(None, symbol("R_3")), ("d", symbol("d")), (2, sp.Integer(2)), (0.5, sp.Float(0.5)), (symbol("a") * 2, 2 * symbol("a")), (0, 0)],
)  # fmt: skip
def test_values_of_elements_are_expressions_of_real_symbols(value: Any, found: Any) -> None:
    assert expression(value, "R_3") == found
    assert all(s.is_real for s in expression(value, "R_3").free_symbols)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (True, "a number, the name of a parameter, or an expression"), (float("inf"), "a finite number"), (1j, "a number, the name of a"),
        (sp.zoo, "a finite real number or expression"), (sp.nan, "a finite real number"), (sp.I * symbol("a"), "a finite real number"),
        (-sp.oo, "a finite real number"), ([2.0], "a number, the name of a parameter, or an expression"),
    ],
)  # fmt: skip
def test_values_that_are_no_finite_real_numbers_are_refused(value: Any, expected: str) -> None:
    with pytest.raises(ArgumentError) as refused:
        expression(value, "R_3")
    assert str(refused.value).startswith("R_3 is ")
    assert f"; expected {expected}" in str(refused.value)
