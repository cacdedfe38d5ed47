"""State equations in symbols: what has no explicit form, dependent storage with laws of its own, and how terms are printed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
import sympy as sp

from gearlib.bondgraph import (
    TF,
    BondGraph,
    C,
    I,
    One,
    R,
    RunTime,
    Se,
    Sf,
    StateEquations,
    Zero,
    assign_causality,
    state_equations,
)
from gearlib.bondgraph.completion import can_be_completed
from gearlib.bondgraph.elements import Element
from gearlib.errors import DeclarationError, GearlibError, SingularError


def at_one_flow(*parts: Element, source: Element | None = None) -> BondGraph:
    v = One("v")
    return BondGraph((1, source or Se(), v), *((k, v, part) for k, part in enumerate(parts, 2)), name="graph")


def tied(part: Element) -> BondGraph:
    """Two resistances on one effort, in series with a part: a loop."""
    v, z = One("v"), Zero("z")
    return BondGraph((1, Se(), v), (2, v, part), (3, v, z), (4, z, R()), (5, z, R()), name="graph")


def lines(graph: BondGraph, **how: Any) -> list[str]:
    return [line.removesuffix(" \\\\") for line in state_equations(graph).latex(**how).splitlines()[1:-1]]


@pytest.mark.parametrize(
    ("graph", "expected"),
    [
        (BondGraph((1, Sf(0), (z := Zero())), (2, z, C())), [r"\dot{q}_{2} &= 0"]),
        (BondGraph((1, Sf(3), (z := Zero())), (2, z, C())), [r"\dot{q}_{2} &= 3"]),
        (BondGraph((1, Sf(-1), (z := Zero())), (2, z, C())), [r"\dot{q}_{2} &= - 1"]),
        (at_one_flow(I(1), R(), R()), [r"\dot{p}_{2} &= - \left(R_{3} + R_{4}\right) p_{2} + Se_{1}"]),
        (at_one_flow(I(2), R(), R()), [r"\dot{p}_{2} &= - \frac{R_{3} + R_{4}}{2} p_{2} + Se_{1}"]),
        (at_one_flow(I(1), C(1), source=Se("a")), [r"\dot{p}_{2} &= - q_{3} + a", r"\dot{q}_{3} &= p_{2}"]),
        (at_one_flow(I(), source=Se(sp.Symbol("a", real=True) + 2)), [r"\dot{p}_{2} &= a + 2"]),
    ],
)  # fmt: skip
def test_terms_are_printed_with_their_signs(graph: BondGraph, expected: list[str]) -> None:
    assert lines(graph) == expected


def test_derivatives_of_dependent_quantities_and_of_inputs_are_printed_with_dots() -> None:
    """Two inertias on one shaft; a source of flow on an inertia."""
    assert lines(at_one_flow(I(), I())) == [r"\dot{p}_{2} &= Se_{1} - \dot{p}_{3}"]
    equations = state_equations(at_one_flow(I(5), C(), source=Sf()))
    assert [str(x) for x in equations.dependent] == ["p_2"]
    assert str(equations.efforts[1]) in {"-dp_2 - q_3/C_3", "dp_2 + q_3/C_3"}
    run = RunTime(equations)
    assert run.bond_variables(0.0, [4.0], [3.0], [0.5], [7.0])[2] == pytest.approx((35.0, 3.0))


@pytest.mark.parametrize(
    ("graph", "said"),
    [
        (at_one_flow(I(1), I(-1)), "graph: the mass matrix has no inverse"),
        (
            tied(R(law=lambda f: f**3 + f)),
            "graph: a loop with a nonlinear resistance has no solution in symbols",
        ),
    ],
)  # fmt: skip
def test_what_has_no_explicit_form_is_refused(graph: BondGraph, said: str) -> None:
    equations = state_equations(graph)
    with pytest.raises(SingularError) as refused:
        equations.explicit()
    assert str(refused.value) == said


@pytest.mark.parametrize(
    ("kind", "law", "factor"), [(I, lambda p: p / 3, 3.0), (I, lambda p: (p - 1) / 4, 4.0), (C, lambda q: 2 * q, 0.5)]
)
def test_a_law_is_inverted_where_storage_depends(kind: Any, law: Any, factor: float) -> None:
    """The first one is a state, the second one follows: ``p = factor f + constant``."""
    if kind is I:
        graph = at_one_flow(I(2), I(law=law))
    else:
        graph = BondGraph((1, Sf(), (z := Zero())), (2, z, C(0.25)), (3, z, C(law=law)), name="graph")
    (variable, value), *_ = state_equations(graph).dependent_values.items()
    (state,) = state_equations(graph).states
    own = 2.0 if kind is I else 0.25
    assert float(sp.diff(value, state)) == pytest.approx(factor / own)
    assert str(variable) == ("p_3" if kind is I else "q_3")


def test_a_law_that_cannot_be_inverted_is_to_be_stated() -> None:
    with pytest.raises(DeclarationError) as refused:
        state_equations(at_one_flow(I(), I(law=lambda p: p**2)))
    assert (
        str(refused.value) == "graph: I on bond 3 is needed in the other direction than its law gives: state its `inverse`, too"
    )
    for given, need in (({"law": lambda f: f**2}, "conductance"), ({"conductance": lambda e: e**2}, "law")):
        z, v = Zero("z"), One("v")
        graph = BondGraph((1, Se(), z), (2, z, R(**given)), name="graph") if need == "conductance" else None
        graph = graph or BondGraph((1, Sf(), v), (2, v, R(**given)), name="graph")
        with pytest.raises(DeclarationError, match=rf"^graph: R on bond 2 is needed in the other .*: state its `{need}`, too$"):
            state_equations(graph)


@dataclass(frozen=True, eq=False)
class Odd(Element):
    """An element that has no law."""


def test_an_element_without_a_law_is_named() -> None:
    with pytest.raises(GearlibError, match="Odd"):
        state_equations(at_one_flow(I(), Odd()))


def test_a_ring_of_transformers_leaves_nothing_to_assign() -> None:
    one, other = TF(2), TF(3)
    assert can_be_completed(BondGraph((1, one, other), (2, other, one)), {})


@pytest.mark.parametrize(("prefer", "integral"), [([], (2,)), ([3], (3,)), ([3, 2], (3,)), ([2, 3], (2,))])
def test_the_preferred_storage_is_the_state(prefer: list[int], integral: tuple[int, ...]) -> None:
    found = assign_causality(at_one_flow(I(), I()), prefer)
    assert found.integral == integral
    assert found.derivative == tuple({2, 3} - {*integral})
    assert found.report().splitlines()[0] == f"integral causality: {integral[0]}"


def test_rates_of_inputs_are_printed_with_dots_and_numbers_of_two_digits_are_whole() -> None:
    """A source of flow between two inertias, on bonds of one digit and of two."""
    for n, source in ((4, 40), (16, 4)):
        a, s, b = One("a"), Zero("sum"), One("b")
        graph = BondGraph((1, Se(), a), (2, a, I()), (3, a, s), (source, Sf(), s), (5, s, b), (n + 20, b, I()))
        assert lines(graph) == [rf"\dot{{p}}_{{2}} &= Se_{{1}} - \dot{{p}}_{{{n + 20}}}"]
        (solved,) = lines(graph, solved=True)
        assert rf"I_{{{n + 20}}} \dot{{Sf}}_{{{source}}}" in solved
        assert solved.count("Sf") == 1


def test_states_are_printed_in_the_order_of_their_bonds() -> None:
    """Numbers, not letters: 3 before 12, q before p."""
    graph = BondGraph((1, Se(), v := One("v")), (12, v, I(2)), (3, v, C(4)), (5, v, R(7)))
    assert lines(graph) == [
        r"\dot{q}_{3} &= \frac{1}{2} p_{12}",
        r"\dot{p}_{12} &= - \frac{1}{4} q_{3} - \frac{7}{2} p_{12} + Se_{1}",
    ]


def two_shafts(first: Any, second: Any) -> StateEquations:
    """Joined by two gears: they can turn only where the ratios are alike."""
    a, b, one, other = One("a"), One("b"), TF(first), TF(second)
    return state_equations(BondGraph((1, a, I()), (2, b, I()), (3, a, one), (4, one, b), (5, a, other), (6, other, b)))


x = sp.Symbol("x", real=True)


@pytest.mark.parametrize(("first", "second"), [(2, 3), ("m", "n"), (0.1, 0.3), (x**2, x)])
def test_shafts_joined_by_two_different_gears_do_not_move(first: Any, second: Any) -> None:
    assert dict(two_shafts(first, second).dependent_values) == {sp.Symbol(p, real=True): 0 for p in ("p_1", "p_2")}


@pytest.mark.parametrize(
    ("first", "second"),
    [(2, 2), ("m", "m"), (0.1 + 0.2, 0.3), (x**2 - 1, (x - 1) * (x + 1)), (sp.sqrt(6), sp.sqrt(2) * sp.sqrt(3))],
)
def test_gears_that_are_alike_however_written_leave_a_motion_open(first: Any, second: Any) -> None:
    with pytest.raises(SingularError, match=r"^bond graph: p_1, p_2 do not follow from the states through the loop of f_3: "):
        two_shafts(first, second)


def test_an_assignment_may_be_given() -> None:
    v = One("v")
    graph = BondGraph((1, Se(), v), (2, v, I()), (3, v, I()))
    for state in (2, 3):
        causality = assign_causality(graph, [state])
        equations = state_equations(graph, causality=causality)
        assert equations.causality is causality
        assert [str(p) for p in equations.states] == [f"p_{state}"]
