"""The paper's bond graph: its causality, and its equations against the printed ones, term by term and by numbers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import cache
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy as sp
from matplotlib.colors import to_hex

from gearlib.bondgraph import GY, TF, C, I, R, RunTime, Se, Sf, assign_causality, rate_of, state_equations
from gearlib.bondgraph.draw import BOND_COLOUR, STROKE_COLOUR
from gearlib.bondgraph.elements import Junction, Zero
from gearparts.trains import zhou_cui_2022 as zc
from gearparts.trains.paper_graphs import PREFERENCE, Figure, fixed_axis_unit, planetary_unit, single_loop_train
from tests.bondgraph.paper_parameters import by_name, random_parameters


@cache
def train(*prefer: int) -> RunTime:
    return RunTime(state_equations(single_loop_train().graph, prefer))


def named(kind: str, bond: int) -> Any:
    return sp.Symbol(f"{kind}_{bond}", real=True)


def split(name: str) -> Any:
    """``p11`` as p_11, ``Sf32`` as Sf_32."""
    letters = name.rstrip("0123456789")
    return named(letters, int(name[len(letters) :]))


@cache
def printed(repairs: zc.Repairs) -> dict[Any, Any]:
    """Equations (2)-(9), evaluated on symbols instead of numbers."""
    symbols: Any = SimpleNamespace(
        m=[named("m", k) for k in range(23)],
        I={bond: named("I", bond) for bond in zc.INERTIAS},
        R={bond: named("R", bond) for bond in zc.RESISTANCES},
        C={bond: named("C", bond) for bond in zc.COMPLIANCES},
    )
    x, u = [split(name) for name in zc.STATES], [split(name) for name in zc.SOURCES]
    p = [named("p", bond) for bond in zc.DEPENDENT]
    values = zc.printed_rhs(x, p, [rate_of(variable) for variable in p], u, symbols, repairs)
    return dict(zip(x, values, strict=True))


def test_all_bonds_are_numbered_from_1_to_85() -> None:
    graph = single_loop_train().graph
    assert list(graph.bonds) == list(range(1, 86))
    assert graph.of_kind(I) == zc.INERTIAS
    assert graph.of_kind(C) == zc.COMPLIANCES
    assert not [element for element in graph.elements if isinstance(element, GY)]


def test_causality_with_the_papers_preference() -> None:
    causality = assign_causality(single_loop_train().graph, PREFERENCE)
    assert causality.integral == (2, 6, 11, 26, 30, 35, 74, 78)
    assert causality.derivative == zc.DEPENDENT == (17, 22, 41, 46, 51, 56, 62, 66, 69, 81)
    assert causality.loops == ()


def test_causality_with_the_lowest_bond_first() -> None:
    causality = assign_causality(single_loop_train().graph)
    assert causality.integral == (2, 6, 11, 17, 26, 30, 35, 74)
    assert 78 in causality.derivative


@pytest.mark.parametrize("state", zc.STATES)
def test_derived_equation_has_exactly_the_printed_terms(state: str) -> None:
    derived = train(*PREFERENCE).equations.printed[split(state)]
    expected = sp.expand(printed(zc.Repairs())[split(state)])
    assert set(sp.Add.make_args(derived)) == set(sp.Add.make_args(expected))


def test_the_printed_text_differs_by_the_named_repairs_only() -> None:
    letter = printed(zc.Repairs(shaft_inertia=False, sun_mesh_source=False, p69_term=False))
    derived = train(*PREFERENCE).equations.printed
    missing = {str(x): sp.expand(derived[x] - value) for x, value in letter.items() if sp.expand(derived[x] - value) != 0}
    m_3, m_18, m_20, m_21, R_31, R_75, I_69 = map(split, ("m3", "m18", "m20", "m21", "R31", "R75", "I69"))
    Sf_8, Sf_32, p_69, dp_62 = map(split, ("Sf8", "Sf32", "p69", "dp62"))
    assert missing == {
        "p_26": -m_18 * dp_62 + sp.expand((Sf_8 - Sf_32) * R_31 / m_3),
        "p_78": -m_20 * m_21 * R_75 * p_69 / I_69,
    }


@pytest.mark.parametrize("seed", range(30))
def test_right_sides_agree(seed: int) -> None:
    rng = np.random.default_rng(seed)
    params, x, u = random_parameters(rng), rng.normal(size=8), rng.normal(size=4)
    run = train(*PREFERENCE)
    order = [run.states.index(str(split(name))) for name in zc.STATES]
    sources = {str(split(name)): value for name, value in zip(zc.SOURCES, u, strict=True)}
    mine, state = by_name(run, params), np.empty(8)
    state[order] = x
    expected = zc.explicit_rhs(0.0, x, params, u)
    scale = np.abs(expected).max()
    for found in (run.rhs(0.0, state, sources, mine), run.bind(mine, inputs=sources)(0.0, state)):
        assert np.abs(found[order] - expected).max() < 1e-11 * scale


@pytest.mark.parametrize(
    "params", [zc.bond_parameters(), random_parameters(np.random.default_rng(7))], ids=["Table 4", "random"]
)
def test_frequency_responses_agree(params: zc.BondParameters) -> None:
    run = train(*PREFERENCE)
    order = [run.states.index(str(split(name))) for name in zc.STATES]
    columns = [run.inputs.index(str(split(name))) for name in zc.SOURCES]
    A, B = run.matrices(by_name(run, params))
    A, B = A[np.ix_(order, order)], B[np.ix_(order, columns)]
    A_printed, B_printed = zc.explicit_matrices(params)
    for w in np.geomspace(1e-2, 1e5, 60):
        found, expected = (np.linalg.solve(1j * w * np.eye(8) - a, b) for a, b in ((A, B), (A_printed, B_printed)))
        assert np.all(np.abs(found - expected) <= 1e-9 * np.abs(expected).max(axis=1, keepdims=True))


@pytest.mark.parametrize("prefer", [(), (17, 22), (69, 51, 35)])
def test_any_preference_gives_the_same_motion(prefer: tuple[int, ...]) -> None:
    """Efforts and flows of all bonds, which include all rates p' and q', are the same in the same state of motion."""
    rng = np.random.default_rng(len(prefer))
    params, u = random_parameters(rng), dict(zip(("Se_1", "Sf_8", "Sf_32", "Sf_72"), rng.normal(size=4), strict=True))
    first, second = train(*PREFERENCE), train(*prefer)
    # sources held constant: with another choice of states their rates stay out as well
    x = rng.normal(size=8)
    variables = first.bond_variables(0.0, x, u, by_name(first, params))
    q = dict(zip(first.states, x, strict=True))
    other = [q.get(n) if n[0] == "q" else params.I[int(n[2:])] * variables[int(n[2:])][1] for n in second.states]
    assert len(other) == 8
    assert second.states != first.states
    again = second.bond_variables(0.0, other, u, by_name(second, params))
    scale = max(abs(value) for pair in variables.values() for value in pair)
    assert all(again[n] == pytest.approx(variables[n], abs=1e-11 * scale) for n in variables)
    rates = dict(zip(second.states, second.rhs(0.0, other, u, by_name(second, params)), strict=True))
    for name, rate in rates.items():
        assert rate == pytest.approx(variables[int(name[2:])][0 if name[0] == "p" else 1], abs=1e-11 * scale)


def test_power_and_shared_variables_at_every_junction_and_transformer() -> None:
    rng = np.random.default_rng(5)
    params, run = random_parameters(rng), train(*PREFERENCE)
    x, u = rng.normal(size=8), rng.normal(size=4)
    variables, graph = run.bond_variables(0.0, x, u, by_name(run, params)), run.equations.graph
    scale = max(abs(e * f) for e, f in variables.values())
    for element in graph.elements:
        if isinstance(element, Junction | TF):
            bonds = graph.at(element)
            assert abs(sum(b.sign(element) * np.prod(variables[b.number]) for b in bonds)) < 1e-12 * scale
            if isinstance(element, Junction):
                shared = [variables[b.number][0 if isinstance(element, Zero) else 1] for b in bonds]
                assert np.ptp(shared) < 1e-12 * max(1, np.abs(shared).max())
    stored = sum(np.prod(variables[n]) for n in (*zc.INERTIAS, *zc.COMPLIANCES))
    lost = sum(np.prod(variables[n]) for n in zc.RESISTANCES)
    assert sum(np.prod(variables[n]) for n in (1, 8, 32, 72)) == pytest.approx(stored + lost, rel=1e-11)


def test_flows_are_those_of_the_reading() -> None:
    rng = np.random.default_rng(6)
    params, run = random_parameters(rng), train(*PREFERENCE)
    x, u = rng.normal(size=8), rng.normal(size=4)
    order = [run.states.index(str(split(name))) for name in zc.STATES]
    state = np.empty(8)
    state[order] = x
    sources = {str(split(name)): value for name, value in zip(zc.SOURCES, u, strict=True)}
    variables = run.bond_variables(0.0, state, sources, by_name(run, params))
    for bond, flow in zc.flows(x, params, u).items():
        assert variables[bond][1] == pytest.approx(flow, rel=1e-11, abs=1e-12)


def test_units_alone() -> None:
    # the P unit: gear 1, mesh, gear 2, against the well-known two-inertia model
    run = RunTime(state_equations(fixed_axis_unit().graph))
    assert run.states == ("p_69", "q_74", "p_78")
    I1, I2, r1, r2, k, c = 1.3, 0.7, 0.2, 0.5, 40.0, 3.0
    A, _ = run.matrices({"I_69": I1, "I_78": I2, "m_20": r1, "m_21": r2, "C_74": 1 / k, "R_75": c})
    r = np.array([r1, r2])
    expected = np.zeros((3, 3))
    expected[np.ix_([0, 2], [0, 2])] = -c * np.outer(r, r) / [I1, I2]
    expected[[0, 2], 1] = k * r
    expected[1, [0, 2]] = -r / [I1, I2]
    np.testing.assert_allclose(A, expected, rtol=1e-14)
    # the X unit has two degrees of freedom more than its three planets' slips and two meshes leave
    causality = assign_causality(planetary_unit().graph, (*PREFERENCE[:6], 81))
    assert causality.integral == (2, 6, 11, 26, 30, 35, 81)


def test_the_documentation_shows_the_derived_equations() -> None:
    page = (Path(__file__).resolve().parents[3] / "docs" / "bond_graph.md").read_text(encoding="utf-8")
    shown_red = (r"- m_{18} \dot{p}_{62}", r"- \frac{R_{31}}{m_{3}} Sf_{32}", r"- \frac{R_{75} m_{20} m_{21}}{I_{69}} p_{69}")
    for term in shown_red:
        assert rf"\textcolor{{red}}{{{term}}}" in page
        page = page.replace(rf"\textcolor{{red}}{{{term}}}", term)
    for line in train(*PREFERENCE).equations.latex(terms=4).splitlines()[1:-1]:
        assert line.removesuffix(" \\\\") in page


@pytest.mark.parametrize("figure", [fixed_axis_unit(), planetary_unit(), single_loop_train()], ids=["P", "X", "XP"])
def test_figures_of_the_paper(figure: Figure) -> None:
    graph = figure.graph
    storage = graph.of_kind(I, C)
    causality = assign_causality(graph, [bond for bond in (*PREFERENCE, 81) if bond in storage])
    ax = figure.draw(causality)
    texts = {text.get_text() for text in ax.texts}
    assert {str(number) for number in graph.bonds} <= texts
    assert {f"${graph.element(n).kind}_{{{n}}}$" for n in storage} <= texts
    names = {element.name for element in graph.elements if isinstance(element, Junction)}
    assert names <= {text.replace("\n", " ") for text in texts}
    assert all(
        text.get_fontsize() * 10 / ax.figure.get_size_inches()[0] > 5.0 for text in ax.texts
    )  # pt, on a page 10 inches wide
    lines = [to_hex(line.get_color()) for line in ax.lines]
    assert lines.count(to_hex(BOND_COLOUR)) == lines.count(to_hex(STROKE_COLOUR)) == len(graph.bonds)
    ax.figure.canvas.draw()
    boxes = [text.get_window_extent().shrunk(0.9, 0.8) for text in ax.texts]
    low, high = np.array([box.min for box in boxes]), np.array([box.max for box in boxes])
    meeting = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    overlaps = [(a, b) for a, b in np.argwhere(meeting) if b < a]
    assert [(ax.texts[a].get_text(), ax.texts[b].get_text()) for a, b in overlaps] == []
    strokes = [np.transpose(line.get_data()) for line in ax.lines if to_hex(line.get_color()) == to_hex(STROKE_COLOUR)]
    assert not any(crossing(one, other) for one, other in combinations(strokes, 2))
    ends = ax.transData.transform(np.concatenate(strokes)).reshape(-1, 2, 1, 2)
    points = (ends[:, 0] + np.linspace(0, 1, 9)[:, None] * (ends[:, 1] - ends[:, 0])).reshape(-1, 1, 2)
    covered = [ax.texts[k].get_text() for k in np.flatnonzero(((points > low) & (points < high)).all(axis=2).any(axis=0))]
    assert covered == []
    plt.close(ax.figure)


def test_the_figure_of_the_train_is_laid_out_like_the_train() -> None:
    """The X unit is its own mirror image about the carrier, its planets are alike; shafts and the P unit lie on straight lines."""
    figure = single_loop_train()
    at = {e.name: np.array(p) for e, p in figure.positions.items() if isinstance(e, Junction)}
    middle, sides = at["carrier"][0], [(f"slip {n}", f"support {n}") for n in (1, 2, 3)]
    sides += [("ring", "sun"), ("ring mesh", "sun mesh"), ("planets, ring", "planets, sun"), ("deflection 6", "deflection 30")]
    for left, right in sides:
        assert at[left] - [middle, 0] == pytest.approx((at[right] - [middle, 0]) * [-1, 1], abs=1e-12), left
    for n in (1, 3):
        for part in ("slip {}", "support {}", "planet {} spin", "planet {} orbit"):
            assert at[part.format(n)] - at[part.format(2)] == pytest.approx([0, 4.8 * (2 - n)], abs=1e-12)
    assert at["planet 2 spin"] == pytest.approx(at["planet 2 orbit"] * [1, -1])
    assert at["planet 2 spin"][0] == middle
    for line, axis in (
        (("ring", "ring mesh", "planets, ring", "slip 2", "support 2", "planets, sun", "sun mesh", "sun"), 1),
        (("sun", "shaft", "shaft end", "rigid shaft", "gear 1"), 0), (("gear 1", "P mesh", "gear 2", "carrier"), 1),
    ):  # fmt: skip
        along = np.array([at[name] for name in line])
        assert np.ptp(along[:, axis]) < 1e-12, line
        steps = np.abs(np.diff(along[:, 1 - axis]))
        assert steps.min() > 1.5, line  # room for a transformer or a number
    assert at["P mesh"] == pytest.approx((at["gear 1"] + at["gear 2"]) / 2)
    assert at["shaft"] == pytest.approx((at["sun"] + at["shaft end"]) / 2)
    assert at["rigid shaft"] == pytest.approx((at["shaft end"] + at["gear 1"]) / 2, abs=0.2)
    assert at["deflection 74"] - at["P mesh"] == pytest.approx([0, -1.3]), "below, away from the X unit"
    assert at["deflection 6"] - at["ring mesh"] == pytest.approx([0, 1.3])
    (one, other), (first, second) = (figure.routes[n] for n in (25, 65)), (at["planet 1 orbit"], at["planet 2 orbit"])
    assert np.array(one[:2]) - [middle, 0] == pytest.approx((np.array(other[:2]) - [middle, 0]) * [-1, 1], abs=1e-12)
    assert one[2][1] - first[1] == pytest.approx(other[2][1] - second[1])
    assert middle < one[2][0] == one[1][0]  # straight up, past the other planets
    assert middle > other[2][0] == other[1][0]


def test_elements_of_one_bond_stand_beside_their_junction() -> None:
    """Straight above, below or beside it, but where two springs and dampers or a planet's damper share the room."""
    leaning = {6, 7, 11, 30, 31, 35, 74, 75, 83, 84, 85}
    for figure in (fixed_axis_unit(), planetary_unit(), single_loop_train()):
        graph = figure.graph
        for number in (*graph.of_kind(I, C, R), *graph.of_kind(Se, Sf)):
            ends = [np.array(figure.positions[end]) for end in (graph.bonds[number].tail, graph.bonds[number].head)]
            along = np.abs(ends[1] - ends[0])
            assert 0.9 < np.hypot(*along) < 1.9, number
            assert (along.min() > 1e-9) == (number in leaning), number
    places = {n: np.array(figure.positions[graph.element(n)]) for n in (*graph.of_kind(I, C, R), *graph.of_kind(Se, Sf))}
    assert places[11] + places[35] == pytest.approx([20, 2 * places[35][1]])  # mirror images
    for spring, damper in ((6, 7), (30, 31), (74, 75)):
        (junction,) = (b for b in (graph.bonds[spring].tail, graph.bonds[spring].head) if isinstance(b, Junction))
        beside = [np.array(places[n]) - figure.positions[junction] for n in (spring, damper)]
        assert beside[0] == pytest.approx(beside[1] * [-1, 1])
        assert np.abs(beside[0][0]) == pytest.approx(np.abs(beside[0][1]))
    for inertia, junction in ((2, "ring"), (69, "gear 1"), (78, "gear 2"), (81, "carrier")):  # below, where nothing else is
        (at,) = (figure.positions[e] for e in graph.elements if isinstance(e, Junction) and e.name == junction)
        assert places[inertia] - at == pytest.approx([0, -1.2]), inertia
    for element in graph.elements:
        if isinstance(element, TF):
            around = [figure.positions[bond.other(element)] for bond in graph.at(element)]
            assert figure.positions[element] == pytest.approx(np.mean(around, axis=0))


def test_figures_are_svg_in_notebooks_and_on_pages() -> None:
    picture = ET.fromstring(fixed_axis_unit()._repr_svg_())
    assert picture.tag.endswith("svg")


def crossing(one: Any, other: Any) -> bool:
    """Whether two segments have a point in common."""

    def side(a: Any, b: Any, c: Any) -> float:
        return float(np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])))

    (a, b), (c, d) = one, other
    return side(a, b, c) != side(a, b, d) and side(c, d, a) != side(c, d, b)


def test_each_ratio_of_the_paper_stands_in_one_transformer() -> None:
    """Radii at the meshes (m_1 to m_4, m_20, m_21) turn forces into torques: there the flow is divided; m_22 reverses the motion.

    There is no m_7.
    """
    found = [element.modulus for element in single_loop_train().graph.elements if isinstance(element, TF)]
    expected = (
        {1 / named("m", k) for k in (1, 2, 3, 4, 20, 21)}
        | {named("m", k) for k in range(5, 20) if k != 7}
        | {-1 / named("m", 22)}
    )
    assert (len(found), set(found)) == (21, expected)
