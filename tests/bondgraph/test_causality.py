"""Causality and state equations of small random graphs, against all assignments there are and against the law of every element."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Mapping
from typing import Any

import networkx as nx
import numpy as np
import pytest

from gearlib.bondgraph import (
    GY,
    TF,
    BondGraph,
    C,
    I,
    One,
    R,
    RunTime,
    Se,
    Sf,
    Zero,
    assign_causality,
    state_equations,
)
from gearlib.bondgraph.causality import dependencies, evaluation_order
from gearlib.bondgraph.completion import can_be_completed
from gearlib.bondgraph.elements import Element, Junction
from gearlib.errors import BalanceError, SingularError

MOST = 9  # bonds: 512 assignments


def random_graph(seed: int) -> BondGraph:
    """Junctions in a tree or with a loop, joined directly or through transformers and gyrators, with one-ports at random."""
    draw = random.Random(seed)
    junctions: list[Element] = [draw.choice((Zero, One))(f"j{k}") for k in range(draw.randint(1, 3))]
    pairs = [(junctions[draw.randrange(k)], junctions[k]) for k in range(1, len(junctions))]
    if len(junctions) > 1 and draw.random() < 0.4:
        pairs.append(tuple(draw.sample(junctions, 2)))  # type: ignore[arg-type]
    ends: list[tuple[Element, Element]] = []
    for tail, head in pairs:
        middle = draw.choice([None, None, TF, TF, GY])
        between = middle(draw.choice([2.0, -0.5, 3.0])) if middle else None
        ends += [(tail, head)] if between is None else [(tail, between), (between, head)]
    while len(ends) < MOST and (draw.random() < 0.8 or len(ends) < 3):
        one, kind = draw.choice(junctions), draw.choice((Se, Sf, I, C, R, I, C))
        ends.append((kind(), one) if kind in (Se, Sf) else (one, kind()))
    for one in junctions:
        if sum(one in pair for pair in ends) < 2:
            ends += [(one, I())] * 1 + [(one, R())]
    numbers = draw.sample(range(1, 40), len(ends))
    return BondGraph(*((n, *pair) for n, pair in zip(numbers, ends, strict=True)))


def is_right(graph: BondGraph, effort_to: Mapping[int, Element], sources: bool) -> bool:
    """Whether an assignment satisfies every junction and two-port, and the sources."""
    for element in graph.elements:
        efforts_in = [effort_to[b.number] is element for b in graph.at(element)]
        right = {
            Zero: sum(efforts_in) == 1, One: efforts_in.count(False) == 1, TF: sum(efforts_in) == 1, GY: sum(efforts_in) != 1,
            Se: not sources or not efforts_in[0], Sf: not sources or efforts_in[0],
        }  # fmt: skip
        if not right.get(type(element), True):
            return False
    return True


def all_assignments(graph: BondGraph, sources: bool = True) -> Iterator[dict[int, Element]]:
    bonds = graph.bonds.values()
    for choice in itertools.product(*((bond.tail, bond.head) for bond in bonds)):
        effort_to = dict(zip(graph.bonds, choice, strict=True))
        if is_right(graph, effort_to, sources):
            yield effort_to


def integral_among(graph: BondGraph, effort_to: Mapping[int, Element]) -> set[int]:
    """An inertia receives effort, a compliance gives it."""
    return {n for n in graph.of_kind(I, C) if (effort_to[n] is graph.element(n)) == isinstance(graph.element(n), I)}


@pytest.mark.parametrize("seed", range(60))
def test_an_assignment_is_found_wherever_there_is_one(seed: int) -> None:
    graph = random_graph(seed)
    right = list(all_assignments(graph))
    assert can_be_completed(graph, {}) == any(all_assignments(graph, sources=False))
    if not right:
        with pytest.raises(BalanceError, match=r"^bond graph: no causality fits: .*(sets? the|leaves? nothing that sets)"):
            assign_causality(graph)
        return
    storage = graph.of_kind(I, C)
    for prefer in ([], storage[::-1]):
        found = assign_causality(graph, prefer)
        assert found.effort_to in right
        assert list(found.effort_to) == sorted(graph.bonds)
        assert (set(found.integral), set(found.derivative)) == (
            integral_among(graph, found.effort_to), set(storage) - integral_among(graph, found.effort_to),
        )  # fmt: skip
        if order := [*prefer, *storage]:
            assert (order[0] in found.integral) == any(order[0] in integral_among(graph, one) for one in right)
        assert not set(found.chosen) & {*storage, *graph.of_kind(Se, Sf)}, "these are not arbitrary"


@pytest.mark.parametrize("seed", range(60, 90))
def test_a_partial_assignment_can_be_completed_if_one_of_all_continues_it(seed: int) -> None:
    graph = random_graph(seed)
    draw = random.Random(seed)
    everything = list(all_assignments(graph, sources=False))
    for one in everything[:8]:
        some = {n: one[n] for n in draw.sample(sorted(one), draw.randrange(len(one)))}
        assert can_be_completed(graph, consequences(everything, some))


def consequences(every: list[dict[int, Element]], some: dict[int, Element]) -> dict[int, Element]:
    """What all assignments that continue one have in common."""
    fitting = [one for one in every if all(one[n] is end for n, end in some.items())]
    return {n: end for n, end in fitting[0].items() if all(one[n] is end for one in fitting)}


@pytest.mark.parametrize("seed", range(60))
def test_tears_break_every_loop(seed: int) -> None:
    graph = random_graph(seed)
    try:
        causality = assign_causality(graph)
    except BalanceError:
        return
    needs = dependencies(graph, causality.effort_to)
    assert set(needs) == {(letter, n) for letter in "ef" for n in graph.bonds}
    order = evaluation_order(graph, causality)
    assert sorted(order) == sorted(needs)
    place = {quantity: k for k, quantity in enumerate(order)}
    for target, sources in needs.items():
        if target not in causality.tears:
            assert all(place[source] < place[target] for source in sources)
    assert bool(causality.loops) == bool(causality.tears)
    net = nx.DiGraph([(source, target) for target, sources in needs.items() for source in sources])
    for loop in nx.strongly_connected_components(net):
        outputs = [(n, letter) for letter, n in loop if [q[1] for q in needs[letter, n]] == [n]]  # only a resistance's own bond
        if len(loop) > 1:
            n, letter = min(outputs or [(n, letter) for letter, n in loop])
            assert (letter, n) in causality.tears, "the first output of a resistance, where there is one"
    wanted = order[len(order) // 2]
    some = evaluation_order(graph, causality, [wanted])
    assert some[-1] == wanted
    assert all(source in some for target in some if target not in causality.tears for source in needs[target])


@pytest.mark.parametrize("seed", range(40))
def test_efforts_and_flows_satisfy_the_law_of_every_element(seed: int) -> None:
    graph = random_graph(seed)
    try:
        run = RunTime(state_equations(graph))
    except (BalanceError, SingularError):
        return
    draw = random.Random(seed)
    x, u, rate = ([draw.uniform(-2, 2) for _ in names] for names in (run.states, run.inputs, run.inputs))
    parameters = {name: draw.uniform(0.5, 2.0) for name in run.parameters}
    try:
        found = run.bond_variables(0.0, x, u, parameters, rate)
    except SingularError:  # two dependent storage elements and a loop that locks
        return
    given = {**dict(zip(run.states, x, strict=True)), **dict(zip(run.inputs, u, strict=True)), **parameters}
    slopes = dict(zip(run.states, run.rhs(0.0, x, u, parameters, rate), strict=True))
    for element in graph.elements:
        bonds = graph.at(element)
        (e, f), n = found[bonds[0].number], bonds[0].number
        match element:
            case Junction():
                shared, summed = (0, 1) if isinstance(element, Zero) else (1, 0)
                assert [found[b.number][shared] for b in bonds] == pytest.approx([found[n][shared]] * len(bonds), abs=1e-9)
                assert sum(b.sign(element) * found[b.number][summed] for b in bonds) == pytest.approx(0.0, abs=1e-9)
            case TF() | GY():
                first, second = sorted(bonds, key=lambda b: b.tail is element)
                (e1, f1), (e2, f2) = found[first.number], found[second.number]
                expected = (f2 / element.modulus, e2 * element.modulus) if isinstance(element, TF) else (None, None)
                if isinstance(element, TF):
                    assert (f1, e1) == pytest.approx(expected, abs=1e-9)
                else:
                    assert (e1, e2) == pytest.approx((element.modulus * f2, element.modulus * f1), abs=1e-9)
            case R():
                assert e == pytest.approx(given[f"R_{n}"] * f, abs=1e-9)
            case Se():
                assert e == given[f"Se_{n}"]
            case Sf():
                assert f == given[f"Sf_{n}"]
            case I() if f"p_{n}" in given:
                assert (f, slopes[f"p_{n}"]) == pytest.approx((given[f"p_{n}"] / given[f"I_{n}"], e), abs=1e-9)
            case C() if f"q_{n}" in given:
                assert (e, slopes[f"q_{n}"]) == pytest.approx((given[f"q_{n}"] / given[f"C_{n}"], f), abs=1e-9)
    check_dependent(run, x, u, parameters, rate, slopes, found)
    check_linear_model(run, x, u, parameters)


def check_dependent(run: RunTime, x: Any, u: Any, parameters: Any, rate: Any, slopes: Any, found: Any) -> None:
    """A dependent p is I f at each moment, and its rate is e; by a small step along the motion."""
    equations, h = run.equations, 1e-6
    forward = [a + h * slopes[name] for a, name in zip(x, run.states, strict=True)]
    back = [a - h * slopes[name] for a, name in zip(x, run.states, strict=True)]
    later = run.bond_variables(h, forward, [a + h * b for a, b in zip(u, rate, strict=True)], parameters, rate)
    earlier = run.bond_variables(-h, back, [a - h * b for a, b in zip(u, rate, strict=True)], parameters, rate)
    for variable in map(str, equations.dependent):
        kind, n = ("I", int(variable[2:])) if variable[0] == "p" else ("C", int(variable[2:]))
        imposed, answer = (1, 0) if kind == "I" else (0, 1)
        change = parameters[f"{kind}_{n}"] * (later[n][imposed] - earlier[n][imposed]) / (2 * h)
        assert found[n][answer] == pytest.approx(change, abs=1e-6, rel=1e-6)


def check_linear_model(run: RunTime, x: Any, u: Any, parameters: Any) -> None:
    """The graphs are linear: x' = A x + B u where no input's rate enters."""
    A, B = run.matrices(parameters)
    expected = A @ np.array(x) + B @ np.array(u)
    assert run.rhs(0.0, x, u, parameters) == pytest.approx(expected, abs=1e-9)
    assert run.bind(parameters, dict(zip(run.inputs, u, strict=True)))(0.0, x) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("given", "into"),
    [({}, False), ({"law": lambda f: f**3}, False), ({"conductance": lambda e: e**3}, True),
     ({"law": lambda f: f**3, "conductance": lambda e: e ** (1 / 3)}, False)],
)  # fmt: skip
@pytest.mark.parametrize("turned", [False, True])
def test_a_free_resistance_gives_the_effort_unless_only_its_conductance_is_known(
    given: dict[str, Any], into: bool, turned: bool
) -> None:
    """Two resistances in a loop, where either may give the effort: the one with a law in one direction is asked first."""
    i, node, part, other = One("i"), Zero("node"), R(**given), R()
    first, second = (4, 2) if turned else (2, 4)
    ends = {first: (i if first == 2 else node, part), second: (node if second == 4 else i, other)}
    graph = BondGraph((1, Se(), i), *((n, *pair) for n, pair in ends.items()), (3, i, node), (5, node, I()))
    found = assign_causality(graph)
    one_way = ("law" in given) != ("conductance" in given)
    assert found.chosen == (first if one_way else 2,)
    assert found.loops == ((2, 4),)
    chosen, element = found.chosen[0], graph.element(found.chosen[0])
    assert (found.effort_to[chosen] is element) == (into if chosen == first else False)


def test_bonds_may_be_numbered_from_zero() -> None:
    v = One("v")
    graph = BondGraph((2, Se(), v), (0, v, I()), (1, v, I()))
    assert assign_causality(graph, [0]).integral == (0,)
    assert assign_causality(graph, [1]).integral == (1,)
    assert [str(x) for x in state_equations(graph, [0]).states] == ["p_0"]


def test_a_loop_that_takes_two_tears_is_one_loop() -> None:
    """A ladder of resistances: what is left of the loop after the first tear is no other loop."""
    i, node, j, end = One("i"), Zero("node"), One("j"), Zero("end")
    bonds = [(2, i, R()), (3, i, node), (4, node, R()), (5, node, j), (6, j, R()), (7, j, end), (8, end, R()), (9, end, I())]
    found = assign_causality(BondGraph((1, Se(), i), *bonds))
    assert found.loops == ((2, 4, 6, 8),)
    assert found.tears == (("e", 2), ("e", 6))
    assert found.report().endswith("algebraic loops: 2 and 4 and 6 and 8")


@pytest.mark.parametrize("kind", [One, Zero])
@pytest.mark.parametrize("middle", [TF, GY])
@pytest.mark.parametrize("ports", [0, 1, 2])
def test_a_ring_through_one_junction_can_be_assigned_unless_a_gyrator_is_alone_on_it(
    kind: Any, middle: Any, ports: int
) -> None:
    """Both bonds of the gyrator give the junction its variable, or neither does."""
    v, part = kind("v"), middle(2)
    graph = BondGraph((1, v, part), (2, part, v), *((10 + k, v, R()) for k in range(ports)))
    assert can_be_completed(graph, {}) == any(all_assignments(graph, sources=False)) == (middle is TF or ports > 0)


@pytest.mark.parametrize("forward", [True, False])
def test_a_row_of_elements_without_junctions_hands_its_quantities_on(forward: bool) -> None:
    """A transformer hands on the same quantity, a gyrator the other one; the resistance answers, in whatever order bonds come."""
    tf, gy = TF(2.0), GY(3.0)
    bonds = [(1, Se(), tf), (2, tf, gy), (3, gy, R(5.0))]
    graph = BondGraph(*(bonds if forward else bonds[::-1]))
    effort_to = assign_causality(graph).effort_to
    assert dependencies(graph, effort_to) == {
        ("e", 1): (), ("e", 2): (("e", 1),), ("f", 3): (("e", 2),),
        ("e", 3): (("f", 3),), ("f", 2): (("e", 3),), ("f", 1): (("f", 2),),
    }  # fmt: skip


@pytest.mark.parametrize("first", [1, 7, 20, 33, 50, 64, 71, 90])
def test_of_the_effort_and_the_flow_of_a_bond_a_loop_is_torn_at_the_effort(first: int) -> None:
    """Two gyrators turn the waves back at the ends of one bond, so that both its quantities are in one loop; in every process alike."""
    a, b, left, right = One("a"), Zero("b"), GY(2.0), GY(3.0)
    ends = [(a, b), (a, left), (left, a), (b, right), (right, b)]
    found = assign_causality(BondGraph(*((first + k, *pair) for k, pair in enumerate(ends)), (99, Se(), a)))
    assert found.tears == (("e", first),)
    assert found.loops == (tuple(range(first, first + 5)),)
