"""What `Energy` takes: expressions, conditions as numbers, and whether it is a source."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy

import gearlib as gl
from gearlib.errors import DeclarationError

x = sympy.Symbol("x", real=True)


def test_powers_and_energies_are_expressions_and_nothing_unless_given() -> None:
    given = gl.Energy(stored=x**2 / 2, heat=x > 1, supplied=np.float64(2.5), source=np.True_)  # type: ignore[arg-type]
    assert (given.stored, given.heat.subs(x, 2), given.heat.subs(x, 0), given.supplied) == (x**2 / 2, 1, 0, 2.5)
    assert all(isinstance(part, sympy.Expr) for part in (given.stored, given.heat, given.supplied))
    assert given.source
    none = gl.Energy()
    assert (none.stored, none.heat, none.supplied, none.source) == (0, 0, 0, False)


@pytest.mark.parametrize("name", ["stored", "heat", "supplied"])
@pytest.mark.parametrize("wrong", ["x", None, [x], float("nan")])
def test_what_is_no_expression_is_refused_by_name(name: str, wrong: Any) -> None:
    with pytest.raises(DeclarationError, match=rf"^Energy\({name}=\) is .*; expected a number or an expression"):
        gl.Energy(**{name: wrong})


@pytest.mark.parametrize("wrong", [1, None, "yes"])
def test_a_source_is_one_or_not(wrong: Any) -> None:
    with pytest.raises(DeclarationError, match=r"^Energy: source is .*; expected True or False$"):
        gl.Energy(source=wrong)
