"""Laws of storage elements that follow from others, in the direction in which they are given and in the other one."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp

from gearlib.bondgraph import BondGraph, C, I, One, Se, Sf, Zero, state_equations
from gearlib.bondgraph.elements import symbol
from gearlib.errors import ArgumentError, DeclarationError


@pytest.mark.parametrize(("law", "inverse"), [(lambda p: p**3, lambda f: sp.cbrt(f)), (lambda p: p / 5, None), (None, None)])
def test_storage_that_follows_is_that_of_its_law(law: Any, inverse: Any) -> None:
    v = One("v")
    graph = BondGraph((1, Sf(), v), (2, v, I(5, law=law, inverse=inverse)))
    (value,) = state_equations(graph).dependent_values.values()
    assert float(value.subs(symbol("Sf_1"), 8)) == pytest.approx(2.0 if inverse else 40.0)


def test_a_law_with_two_solutions_is_none() -> None:
    z = Zero("z")
    with pytest.raises(DeclarationError) as refused:
        state_equations(BondGraph((1, Se(), z), (2, z, C(law=lambda q: q**2)), name="graph"))
    assert (
        str(refused.value) == "graph: C on bond 2 is needed in the other direction than its law gives: state its `inverse`, too"
    )
    for law, said in ((0, "C_2 is 0; leave the element out, or give it a value"),):
        with pytest.raises(ArgumentError, match=said):
            state_equations(BondGraph((1, Sf(), z), (2, z, C(law))))
