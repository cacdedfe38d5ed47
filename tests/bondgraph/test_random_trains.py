"""Random trains of P and X units, trees and loops, rigid and elastic, built as components and as a bond graph.

Components go through flattening and index reduction, the bond graph through causality with a random order of preference and its
explicit state equations. Both must have the same eigenvalues, frequency responses and motion.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment

import gearlib as gl
import gearparts as gp
from gearlib.bondgraph import GY, TF, BondGraph, C, I, One, R, RunTime, Se, Zero, state_equations
from gearlib.bondgraph.completion import can_be_completed
from gearlib.bondgraph.elements import Element
from gearlib.errors import BalanceError, LoopError, SingularError
from gearparts.trains import zhou_cui_2022 as zc
from gearparts.trains.paper_graphs import single_loop_train


@dataclass(frozen=True)
class Unit:
    """One unit: its kind, the shafts it joins (sun, carrier and ring of an X unit), whether it is elastic, and its numbers."""

    kind: str  # "P", "X", "lumped X"
    shafts: tuple[int, ...]
    elastic: bool
    n: dict[str, float]
    planets: int = 1

    @property
    def row(self) -> dict[int, float]:
        """A rigid unit's condition on the speeds of its shafts."""
        if self.kind == "P":
            return dict(zip(self.shafts, (1.0, -self.n["ratio"]), strict=True))
        return dict(zip(self.shafts, (1.0, -1 - self.n["ratio"], self.n["ratio"]), strict=True))


@dataclass(frozen=True)
class Spec:
    """A train: moments of inertia and bearing friction of its shafts, and its units."""

    J: tuple[float, ...]
    d: tuple[float, ...]
    units: tuple[Unit, ...]
    order: int  # seed of the order of preference


DRIVE, BRAKE = 1.0, -0.4

NUMBERS = (
    "ratio", "R_1", "R_2", "I_1", "I_2", "K_g", "C_g", "R_s", "R_p", "I_s", "I_r", "I_h", "I_spin", "I_orbit", "I_at_ring",
    "I_at_sun", "K_ring", "C_ring", "K_sun", "C_sun", "C_v",
)  # fmt: skip
LUMPED_ONLY = ("I_at_ring", "I_at_sun", "C_v")


@st.composite
def trains(draw: st.DrawFn) -> Spec:
    """Units are added one by one, each to a shaft that is there and to new ones, or to old ones, which closes a loop."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count, units, rigid = 1, list[Unit](), list[dict[int, float]]()
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["P", "X", "lumped X"]))
        shafts: list[int] = [draw(st.integers(0, count - 1))]
        for _ in range(1 if kind == "P" else 2):
            old = [k for k in range(count) if k not in shafts]
            if old and draw(st.booleans()):
                shafts.append(draw(st.sampled_from(old)))
            else:
                shafts.append(count)
                count += 1
        shafts = draw(st.permutations(shafts))
        n = {name: float(rng.uniform(0.5, 2.0)) for name in NUMBERS}
        n["ratio"] *= float(rng.choice([-1, 1])) if kind == "P" else 1
        unit = Unit(kind, tuple(shafts), draw(st.booleans()), n, draw(st.integers(1, 2)))
        if not unit.elastic:
            if is_possible([*rigid, unit.row], count):
                unit = Unit("X" if kind == "lumped X" else kind, unit.shafts, False, n)
                rigid.append(unit.row)
            else:
                unit = Unit(kind, unit.shafts, True, n, unit.planets)
        units.append(unit)
    d = rng.uniform(0.1, 1.0, count) * rng.choice([0, 1], count)
    return Spec(tuple(rng.uniform(0.5, 2.0, count)), tuple(d), tuple(units), draw(st.integers(0, 2**32 - 1)))


def is_possible(rows: list[dict[int, float]], count: int) -> bool:
    """Whether rigid conditions leave every shaft free to turn and do not repeat each other, by a good margin."""
    matrix = np.zeros((len(rows), count))
    for k, row in enumerate(rows):
        matrix[k, list(row)] = list(row.values())
    _, sizes, directions = np.linalg.svd(matrix)
    free = directions[len(rows) :]
    return len(rows) < count and bool(sizes[-1] > 0.1 and np.abs(free).max(axis=0).min() > 0.05)


# ---------------------------------------------------------------- as components


def part(unit: Unit) -> Any:
    if unit.kind == "P":
        names = ("R_1", "R_2", "I_1", "I_2", "K_g", "C_g")
        return gp.FixedAxisUnit(**{k: unit.n[k] for k in names}) if unit.elastic else gp.IdealGear(ratio=unit.n["ratio"])
    if not unit.elastic:
        return gp.IdealPlanetary(ratio=unit.n["ratio"])
    meshes = "lumped" if unit.kind == "lumped X" else "separate"
    names = [k for k in NUMBERS[NUMBERS.index("R_s") :] if meshes == "lumped" or k not in LUMPED_ONLY]
    return gp.PlanetaryUnit(planets=unit.planets, planet_meshes=meshes, **{k: unit.n[k] for k in names})


def as_components(spec: Spec) -> gl.Component:
    class Train(gl.Component):
        def assemble(self) -> Any:
            self.shaft = [gp.Inertia(J=J) for J in spec.J]
            self.bearing = [gp.Damper(d=d) for d in spec.d]
            self.ground, self.drive, self.brake = gp.Fixed(), gp.Torque(tau=DRIVE), gp.Torque(tau=BRAKE)
            self.unit = [part(unit) for unit in spec.units]
            links = [
                gl.connect(self.drive.flange, self.shaft[0].flange_a),
                gl.connect(self.brake.flange, self.shaft[-1].flange_a),
            ]
            for shaft, bearing in zip(self.shaft, self.bearing, strict=True):
                links += [gl.connect(shaft.flange_b, bearing.flange_a), gl.connect(bearing.flange_b, self.ground.flange)]
            for unit, made in zip(spec.units, self.unit, strict=True):
                flanges = ("flange_a", "flange_b") if unit.kind == "P" else ("sun", "carrier", "ring")
                for flange, k in zip(flanges, unit.shafts, strict=True):
                    links.append(gl.connect(getattr(made, flange), self.shaft[k].flange_b))
            return links

    return Train()


def deflections(spec: Spec) -> list[str]:
    """Paths of the mesh deflections, in the order in which the bond graph makes its compliances."""
    found = []
    for k, unit in enumerate(spec.units):
        if unit.elastic and unit.kind == "P":
            found.append(f"unit[{k}].mesh.q")
        elif unit.elastic and unit.kind == "lumped X":
            found += [f"unit[{k}].ring_mesh.q", f"unit[{k}].sun_mesh.q"]
        elif unit.elastic:
            found += [f"unit[{k}].{side}_meshes[{i}].q" for i in range(unit.planets) for side in ("ring", "sun")]
    return found


# ---------------------------------------------------------------- as a bond graph


@dataclass
class Sketch:
    """Bonds that are numbered as they come."""

    bonds: list[tuple[int, Element, Element]] = field(default_factory=list)

    def bond(self, tail: Element, head: Element) -> int:
        self.bonds.append((len(self.bonds) + 1, tail, head))
        return len(self.bonds)

    def turned(self, tail: Element, head: Element, m: float) -> None:
        """The head's flow is m times the tail's."""
        tf = TF(m)
        self.bond(tail, tf)
        self.bond(tf, head)

    def adds(self, sum_of: Zero, one: One, factor: float) -> None:
        """Adds ``factor`` times the flow of a 1-junction to the sum of a 0-junction."""
        if factor > 0:
            self.turned(one, sum_of, factor)
        else:
            self.turned(sum_of, one, -1 / factor)

    def mesh(self, parts: dict[One, float], c: float, d: float) -> int:
        """A compliance and a resistance on the sum of flows; returns the compliance's bond."""
        sum_of, v = Zero(), One()
        for one, factor in parts.items():
            self.adds(sum_of, one, factor)
        self.bond(sum_of, v)
        self.bond(v, R(d))
        return self.bond(v, C(1 / c))


def as_bond_graph(spec: Spec) -> tuple[BondGraph, list[int], list[int]]:
    """The graph, the bonds of the shafts' inertias, and those of the meshes' compliances."""
    sketch, shafts = Sketch(), [One(f"shaft {k}") for k in range(len(spec.J))]
    sketch.bond(Se(), shafts[0])
    sketch.bond(Se(), shafts[-1])
    bodies = [sketch.bond(shaft, I(J)) for shaft, J in zip(shafts, spec.J, strict=True)]
    for shaft, d in zip(shafts, spec.d, strict=True):
        if d:
            sketch.bond(shaft, R(d))
    springs: list[int] = []
    for unit in spec.units:
        ends, n = [shafts[k] for k in unit.shafts], unit.n
        if unit.kind == "P" and unit.elastic:
            sketch.bond(ends[0], I(n["I_1"]))
            sketch.bond(ends[1], I(n["I_2"]))
            springs.append(sketch.mesh({ends[0]: n["R_1"], ends[1]: n["R_2"]}, n["K_g"], n["C_g"]))
        elif unit.kind == "P":
            sketch.turned(ends[1], ends[0], n["ratio"])
        elif unit.elastic:
            springs += elastic_planetary(sketch, unit, *ends)
        else:
            sum_of = Zero()
            for end, k in zip(ends, unit.shafts, strict=True):
                sketch.adds(sum_of, end, unit.row[k])
    return BondGraph(*sketch.bonds, name="train"), bodies, springs


def elastic_planetary(sketch: Sketch, unit: Unit, sun: One, carrier: One, ring: One) -> list[int]:
    n, springs = unit.n, list[int]()
    R_s, R_p = n["R_s"], n["R_p"]
    R_r, R_h = R_s + 2 * R_p, R_s + R_p
    for one, name in ((sun, "I_s"), (carrier, "I_h"), (ring, "I_r")):
        sketch.bond(one, I(n[name]))
    if unit.kind == "lumped X":
        at_ring, at_sun = One("at ring"), One("at sun")
        sketch.bond(at_ring, I(n["I_at_ring"]))
        sketch.bond(at_sun, I(n["I_at_sun"]))
        springs.append(sketch.mesh({ring: R_r, at_ring: -R_p}, n["K_ring"], n["C_ring"]))
        springs.append(sketch.mesh({sun: R_s, at_sun: R_p}, n["K_sun"], n["C_sun"]))
    for k in range(unit.planets):
        spin = One("spin of a planet that is not the first" if k and unit.kind == "lumped X" else "spin")
        sketch.bond(spin, I(n["I_spin"]))
        sketch.bond(carrier, I(n["I_orbit"]))
        if unit.kind == "lumped X":
            rides, slip = Zero("rides"), Zero("slip")
            for one, factor in ((spin, 1.0), (carrier, R_h / R_p), (at_ring, -1.0)):
                sketch.adds(rides, one, factor)
            for one, factor in ((spin, 1.0), (carrier, -R_h / R_p), (at_sun, -1.0)):
                sketch.adds(slip, one, factor)
            sketch.bond(slip, R(n["C_v"] * R_p**2))
        else:
            springs.append(sketch.mesh({ring: R_r, spin: -R_p, carrier: -R_h}, n["K_ring"], n["C_ring"]))
            springs.append(sketch.mesh({sun: R_s, spin: R_p, carrier: -R_h}, n["K_sun"], n["C_sun"]))
    return springs


def linear_model(run: RunTime, bodies: list[int], springs: list[int]) -> tuple[Any, Any, Any]:
    """A, B and C of a train's bond graph; the outputs are the shafts' speeds and the meshes' deflections."""
    A, B = run.matrices()
    equations = run.equations
    momenta = {n: equations.dependent_values.get(p, p) for n in bodies for p in [sp.Symbol(f"p_{n}", real=True)]}
    speeds = [p / equations.graph.element(n, I).value for n, p in momenta.items()]
    rows = np.array([[float(sp.diff(w, x)) for x in equations.states] for w in speeds])
    selected = np.array([[float(x == f"q_{n}") for x in run.states] for n in springs]).reshape(len(springs), len(A))
    return A, B, np.vstack([rows, selected])


def response(A: Any, B: Any, rows: Any, w: float) -> Any:
    return rows @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B)


def distance(a: Any, b: Any) -> float:
    """Largest difference of two multisets of eigenvalues, in terms of the largest."""
    cost = abs(np.subtract.outer(a, b))
    at = linear_sum_assignment(cost)
    return float(cost[at].max() / abs(b).max()) if len(a) else 0.0


# ---------------------------------------------------------------- comparisons


def preference(spec: Spec, graph: BondGraph) -> list[int]:
    """A random order of the storage elements, but that of two planets that turn alike only one can be a state."""
    order = np.random.default_rng(spec.order).permutation(graph.of_kind(I, C)).tolist()
    alike: list[int] = []
    for junction in (e for e in graph.elements if isinstance(e, One) and e.name == "spin of a planet that is not the first"):
        alike += [b.number for b in graph.at(junction) if isinstance(b.other(junction), I)]
    return sorted(order, key=lambda bond: bond in alike)


def check_linear_models(spec: Spec) -> None:
    graph, bodies, springs = as_bond_graph(spec)
    A, B, rows = linear_model(RunTime(state_equations(graph, preference(spec, graph))), bodies, springs)
    outputs = [f"shaft[{k}].w" for k in range(len(spec.J))] + deflections(spec)
    model = gl.compile(as_components(spec)).linearize(["drive.tau", "brake.tau"], outputs, sparse=True)
    assert model.A.shape == A.shape
    if len(A) and np.abs(A).max():
        assert distance(np.linalg.eigvals(model.A), np.linalg.eigvals(A)) < 1e-8
    for w in (0.01, 0.1, 0.5, 1.0, 2.0, 5.0, 100.0):
        found, expected = response(model.A, model.B, model.C, w), response(A, B, rows, w)
        assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()
    if np.linalg.cond(A) < 1e6:
        found, expected = response(model.A, model.B, model.C, 0.0), response(A, B, rows, 0.0)
        assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


@settings(max_examples=12)
@given(trains())
def test_linear_models_agree(spec: Spec) -> None:
    check_linear_models(spec)


@settings(max_examples=5)
@given(trains())
def test_motions_agree(spec: Spec) -> None:
    """Two seconds from rest under constant torques, against the matrix exponential of the bond graph's equations."""
    graph, bodies, springs = as_bond_graph(spec)
    A, B, rows = linear_model(RunTime(state_equations(graph, preference(spec, graph))), bodies, springs)
    forced = np.zeros((len(A) + 1, len(A) + 1))
    forced[:-1, :-1], forced[:-1, -1] = A, B @ [DRIVE, BRAKE]
    times = np.linspace(0.0, 2.0, 5)
    expected = np.array([rows @ expm(forced * t)[:-1, -1] for t in times])
    outputs = [f"shaft[{k}].w" for k in range(len(spec.J))] + deflections(spec)
    system = gl.compile(as_components(spec), outputs)
    for method, rtol in (("exact", 1e-10), ("rk", 1e-8)):
        result = system.simulate(2.0, times=times, method=method, rtol=rtol, atol=1e-2 * rtol)
        found = np.column_stack([result[name] for name in outputs])
        assert np.abs(found - expected).max() < 100 * rtol * max(1.0, np.abs(expected).max())


SINGLE_LOOPS = {
    "XP": (("X", (0, 1, 2)), ("P", (1, 2))),
    "PX": (("P", (0, 1)), ("X", (0, 1, 2))),
    "XX": (("X", (0, 1, 2)), ("X", (1, 3, 2))),
    "XPP": (("X", (0, 1, 2)), ("P", (1, 3)), ("P", (3, 2))),
    "two loops": (("X", (0, 1, 2)), ("X", (1, 3, 2)), ("P", (0, 3))),
    "carriers locked to rings": (("P", (0, 1)), ("X", (0, 2, 1)), ("X", (3, 1, 0)), ("X", (4, 2, 5))),
}


@pytest.mark.parametrize("order", range(4))
@pytest.mark.parametrize("loop", SINGLE_LOOPS)
def test_rigid_loops(loop: str, order: int) -> None:
    """In a rigid loop the flows depend on each other all round; every order of preference must get through."""
    rng = np.random.default_rng(order)
    kinds = SINGLE_LOOPS[loop]
    units = tuple(Unit(kind, shafts, False, {"ratio": float(rng.uniform(1.5, 3.0))}) for kind, shafts in kinds)
    count = 1 + max(k for unit in units for k in unit.shafts)
    spec = Spec(tuple(rng.uniform(0.5, 2.0, count)), tuple(rng.uniform(0.1, 1.0, count)), units, order)
    assert is_possible([unit.row for unit in units], count)
    check_linear_models(spec)


def test_twin_planets_cannot_both_be_states() -> None:
    n = dict.fromkeys(NUMBERS, 1.0)
    graph, _, _ = as_bond_graph(Spec((1.0,) * 3, (0.1,) * 3, (Unit("lumped X", (0, 1, 2), True, n, planets=2),), 0))
    spins = [b.number for e in graph.elements if isinstance(e, One) and e.name.startswith("spin") for b in graph.at(e)]
    spins = [bond for bond in spins if bond in graph.of_kind(I)]
    assert len(spins) == 2
    with pytest.raises(SingularError, match="some of the states depend on each other and others must be preferred"):
        state_equations(graph, spins)
    assert len(state_equations(graph, spins[:1]).states) == 7


def test_locked_loop_is_named_on_both_roads() -> None:
    units = tuple(Unit("P", (0, 1), False, {"ratio": r}) for r in (2.0, 3.0, 4.0))
    spec = Spec((1.0, 1.0), (0.0, 0.0), units, 0)
    with pytest.raises(BalanceError, match="no causality fits"):
        state_equations(as_bond_graph(spec)[0])
    with pytest.raises(LoopError, match="cannot turn"):
        gl.compile(as_components(spec))


def test_choice_of_states_that_the_moduli_forbid() -> None:
    """The paper's planets are alike by their geometry; with the moduli as symbols that shows when numbers are put in."""
    run = RunTime(state_equations(single_loop_train().graph, [17, 41]))
    params = zc.bond_parameters()
    numbers = {f"m_{k}": float(params.m[k]) for k in range(1, 23)}
    numbers |= {f"{kind}_{bond}": value for kind in "IRC" for bond, value in getattr(params, kind).items()}
    numbers = {name: numbers[name] for name in run.parameters}
    with pytest.raises(SingularError, match=r"these values make the equations for dp_2, dq_6, .* singular"):
        run.rhs(0.0, np.ones(8), parameters=numbers)
    run.rhs(0.0, np.ones(8), parameters=numbers | {"m_13": 1.1 * numbers["m_13"]})


def test_gyrators_between_shafts_do_not_set_their_speeds() -> None:
    """Any number of them will do, where a third transformer between the same shafts would be one too many."""
    for kind, possible in ((GY, True), (TF, False)):
        a, b, joints = One("a"), One("b"), [kind(2.0), kind(3.0), kind(4.0)]
        bonds = [(1, a, I()), (2, b, I())]
        bonds += [(10 + k, a, joint) for k, joint in enumerate(joints)] + [(20 + k, joint, b) for k, joint in enumerate(joints)]
        assert can_be_completed(BondGraph(*bonds), {}) is possible
