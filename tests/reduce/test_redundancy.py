"""Redundant rigid connections: what is given stays given, what is determined is computed, and no order of writing matters."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.flatten.flatten import flatten
from gearlib.reduce.redundancy import flows_beside, left_open

c = gl.connect


class Lump(gl.Component):
    """Parts and connections of a description, made and connected in the order that a seed gives.

    ``parts`` are (name, kind, numbers) and ``links`` tuples of "part.connector".
    """

    parts = gl.Structural(())
    links = gl.Structural(())
    seed = gl.Structural(0)

    def assemble(self) -> list[Any]:
        shuffle = random.Random(self.seed)
        parts, links = list(self.parts), [list(link) for link in self.links]
        if self.seed:
            shuffle.shuffle(parts)
            shuffle.shuffle(links)
            for link in links:
                shuffle.shuffle(link)
        for name, kind, numbers in parts:
            setattr(self, name, getattr(gp, kind)(**dict(numbers)))

        def port(path: str) -> Any:
            part, connector = path.split(".")
            return getattr(getattr(self, part), connector)

        return [c(*map(port, link)) for link in links]


class Reference:
    """Accelerations and reactions of a rigid lump by hand: ``M a + G' r = f`` with ``G a = 0`` over the angles of nodes."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.n = n = int(rng.integers(2, 5))  # nodes, the connection sets
        self.turns = rng.choice([-2.0, -1.0, 0.5, 1.0, 2.0], n)  # their speeds, if all are geared to one
        self.mass, self.force = np.zeros(n), np.zeros(n)
        self.constraints: list[Any] = []
        self.reactions: dict[str, tuple[Any, int]] = {}  # flange torque -> (factors of the constraints' forces)
        self.parts: list[Any] = []
        self.inputs: dict[str, float] = {}
        self.members: list[list[str]] = [[] for _ in range(n)]
        tree = [(int(rng.integers(i)), i) for i in range(1, n)]
        extra = [tuple(int(k) for k in rng.choice(n, 2, replace=False)) for _ in range(int(rng.integers(0, 3)))]
        for number, (a, b) in enumerate([*tree, *extra]):
            name, ratio = f"gear{number}", float(self.turns[a] / self.turns[b])
            self._add(name, "IdealGear", {"ratio": ratio}, {"flange_a": a, "flange_b": b})
            row = np.zeros(n)
            row[a], row[b] = 1.0, -ratio
            self._constrain(row, {f"{name}.flange_a.tau": 1.0, f"{name}.flange_b.tau": -ratio})
        for number in range(int(rng.integers(1, 5))):
            J, a, b = float(rng.integers(1, 5)), int(rng.integers(n)), int(rng.integers(n))
            if abs(self.turns[a] - self.turns[b]) > 0.0:
                b = a
            self._add(f"body{number}", "Inertia", {"J": J}, {"flange_a": a, "flange_b": b})
            self.mass[a] += J
            if a != b:  # it holds both nodes together
                row = np.zeros(n)
                row[a], row[b] = 1.0, -1.0
                self._constrain(row, {f"body{number}.flange_b.tau": -1.0})
        for number in range(int(rng.integers(1, 4))):
            tau, a, b = float(rng.integers(1, 9)), int(rng.integers(n)), int(rng.integers(n))
            bound = bool(rng.random() < 0.4)
            self._add(
                f"torque{number}",
                "Torque",
                {"use_support": True} | ({"tau": tau} if bound else {}),
                {"flange": a, "support": b},
            )
            if not bound:
                self.inputs[f"torque{number}.tau"] = tau
            self.force[a] += tau
            self.force[b] -= tau
        if rng.random() < 0.4:
            a = int(rng.integers(n))
            self._add("drive", "ConstantSpeed", {"w_fixed": 1.9}, {"flange": a})
            row = np.zeros(n)
            row[a] = 1.0
            self._constrain(row, {"drive.flange.tau": 1.0})
        links = [tuple(members) for members in self.members if len(members) > 1]
        self.description = {"parts": tuple(self.parts), "links": tuple(links)}

    def _add(self, name: str, kind: str, numbers: dict[str, Any], ports: dict[str, int]) -> None:
        self.parts.append((name, kind, tuple(numbers.items())))
        for connector, node in ports.items():
            self.members[node].append(f"{name}.{connector}")

    def _constrain(self, row: Any, flanges: dict[str, float]) -> None:
        """The force of a constraint is positive out of the node ``row`` counts positive: into the part that makes it."""
        self.constraints.append(row)
        for path, factor in flanges.items():
            self.reactions[path] = (len(self.constraints) - 1, factor)

    def solve(self) -> tuple[Any, dict[str, float]]:
        """Accelerations of the nodes, and the reactions that are determined."""
        G = np.array(self.constraints)
        free = null(G)
        a = free @ np.linalg.solve(free.T @ np.diag(self.mass) @ free, free.T @ self.force) if free.size else np.zeros(self.n)
        # M a = f - G' r
        r, *_ = np.linalg.lstsq(G.T, self.force - self.mass * a, rcond=None)
        open_ = null(G.T)
        known = {
            path: factor * r[k] for path, (k, factor) in self.reactions.items() if not np.abs(open_[k]).max(initial=0.0) > 1e-9
        }
        return a, known


def null(matrix: Any) -> Any:
    _, s, vt = np.linalg.svd(matrix)
    return vt[int((s > 1e-9).sum()) :].T


def check(seed: int, orders: int) -> None:
    lump = Reference(seed)
    a, reactions = lump.solve()
    first: dict[str, float] | None = None
    for order in range(orders):
        system = gl.compile(Lump(**lump.description, seed=order))
        result = system.simulate(1.0, samples=2, inputs=lump.inputs)
        for name, kind, _ in lump.parts:
            if kind == "Inertia":
                node = next(i for i, members in enumerate(lump.members) if f"{name}.flange_a" in members)
                assert result[f"der({name}.w)"][-1] == pytest.approx(a[node], rel=1e-9, abs=1e-9), (seed, order, name)
        for path, value in reactions.items():
            assert result[path][-1] == pytest.approx(value, rel=1e-9, abs=1e-9), (seed, order, path)
        found = {n: float(result[n][-1]) for n in sorted(system.variables)}
        first = first or found
        assert found == pytest.approx(first, rel=1e-9, abs=1e-9), (seed, order)


@settings(max_examples=25)
@given(st.integers(0, 100_000))
def test_rigid_lumps_against_mass_matrix_and_null_space_in_any_order(seed: int) -> None:
    check(seed, 2)


@pytest.mark.stress
def test_many_rigid_lumps() -> None:
    for seed in range(1000):
        check(seed, 3)


def lump(parts: dict[str, tuple[str, dict[str, Any]]], *links: tuple[str, ...]) -> dict[str, Any]:
    return {"parts": tuple((n, kind, tuple(given.items())) for n, (kind, given) in parts.items()), "links": links}


@pytest.mark.parametrize("seed", range(4))
def test_two_grounds_that_agree_hold_one_shaft(seed: int) -> None:
    """The one whose name comes last carries nothing; those that disagree are refused."""
    torque, body = ("Torque", {"tau": 5.0}), ("Inertia", {"J": 1.0})
    links = (("one.flange", "body.flange_a"), ("other.flange", "body.flange_b"), ("torque.flange", "body.flange_a"))
    for angle, agrees in ((0.3, True), (0.4, False)):
        grounds = {"one": ("Fixed", {"phi0": 0.3}), "other": ("Fixed", {"phi0": angle})}
        described = lump({"torque": torque, "body": body, **grounds}, *links)
        if agrees:
            result = gl.simulate(Lump(**described, seed=seed), 1.0, samples=2)
            assert [result[n][-1] for n in ("body.phi", "one.flange.tau", "other.flange.tau")] == pytest.approx([0.3, 5.0, 0.0])
        else:
            with pytest.raises(gl.GearlibError, match=r"held twice by one .*other |held twice by other .*one "):
                gl.compile(Lump(**described, seed=seed))


@pytest.mark.parametrize("seed", range(4))
def test_two_discs_that_agree_in_a_rigid_loop(seed: int) -> None:
    described = lump(
        {
            "torque": ("Torque", {"tau": 6.0}), "a": ("Inertia", {"J": 1.0}), "b": ("Inertia", {"J": 2.0}),
            "d": ("Disc", {"delta_phi": 0.17}), "e": ("Disc", {"delta_phi": -0.17}),
        },
        ("torque.flange", "a.flange_a"), ("a.flange_b", "d.flange_a", "e.flange_b"), ("d.flange_b", "e.flange_a", "b.flange_a"),
    )  # fmt: skip
    result = gl.simulate(Lump(**described, seed=seed), 1.0, samples=2)
    found = [result[n][-1] for n in ("a.w", "b.w", "b.flange_a.tau", "d.flange_a.tau", "e.flange_b.tau")]
    assert found == pytest.approx([2.0, 2.0, 4.0, 4.0, 0.0], rel=1e-9, abs=1e-12)
    assert result["b.phi"] - result["a.phi"] == pytest.approx(0.17)
    assert result["a.phi"][0] == pytest.approx(-0.085)  # nothing fixes it: both angles are as near to zero as can be


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_of_everything_beside_a_rigid_link(seed: int) -> None:
    described = lump(
        {
            "torque": ("Torque", {"tau": 6.0}), "a": ("Inertia", {"J": 1.0}), "b": ("Inertia", {"J": 2.0}),
            "sensor": ("MultiSensor", {}), "link": ("IdealGear", {"ratio": 1.0}),
        },
        ("torque.flange", "a.flange_a"), ("a.flange_b", "sensor.flange_a", "link.flange_a"),
        ("sensor.flange_b", "link.flange_b", "b.flange_a"),
    )  # fmt: skip
    result = gl.simulate(Lump(**described, seed=seed), 1.0, samples=2)
    assert result["b.w"] == pytest.approx([0.0, 2.0])
    assert result["sensor.w"] == pytest.approx([0.0, 2.0])


def test_every_analysis_gives_the_same_in_any_order() -> None:
    """A loop of rigid gears with a torque inside it, a shaft and a load."""
    described = lump(
        {
            "drive": ("Torque", {}), "inner": ("Torque", {"use_support": True}), "a": ("Inertia", {"J": 1.0}),
            "b": ("Inertia", {"J": 2.0}), "up": ("IdealGear", {"ratio": 2.0}), "down": ("IdealGear", {"ratio": 2.0}),
            "shaft": ("SpringDamper", {"c": 400.0, "d": 1.0}), "load": ("Inertia", {"J": 3.0}), "fan": ("Damper", {"d": 0.5}),
            "ground": ("Fixed", {}),
        },
        ("drive.flange", "a.flange_a"), ("a.flange_b", "up.flange_a", "down.flange_a", "inner.flange"),
        ("up.flange_b", "down.flange_b", "inner.support", "b.flange_a"), ("b.flange_b", "shaft.flange_a"),
        ("shaft.flange_b", "load.flange_a"), ("load.flange_b", "fan.flange_a"), ("fan.flange_b", "ground.flange"),
    )  # fmt: skip

    def everything(order: int) -> list[Any]:
        system = gl.compile(Lump(**described, seed=order))
        given = {"drive.tau": 5.0, "inner.tau": 3.0}
        names = ["a.w", "load.w", "shaft.tau", "up.flange_a.tau", "down.flange_b.tau", "b.flange_a.tau"]
        found = []
        for method in ("rk", "ida", "exact"):
            result = system.simulate(1.0, samples=3, inputs=given, method=method, rtol=1e-10)
            found += [result[n] for n in names]
        steady = system.simulate(0.1, samples=2, inputs=given, start="steady")
        found += [steady[n] for n in names]
        linear = system.linearize(["drive.tau", "inner.tau"], ["load.w", "b.flange_a.tau"])
        found += [linear(0.7j).real, linear(0.7j).imag, gl.modes(system).frequencies]
        flow = system.power_flow(speeds={"a.flange_a": 10.0}, torques={"inner.tau": 3.0})
        found += [flow["load.flange_a"].speed, flow["b.flange_a"].speed, gl.mobility(system)]
        return found

    first = everything(0)
    for order in range(1, 4):
        for one, other in zip(first, everything(order), strict=True):
            assert other == pytest.approx(one, rel=1e-6, abs=1e-6), order


SELF_JOINED = {
    "Inertia": {"J": 2.0}, "TorqueSensor": {}, "PowerSensor": {}, "MultiSensor": {}, "IdealGear": {"ratio": 1.0},
    "Disc": {"delta_phi": 0.0},
}  # fmt: skip


@pytest.mark.parametrize("kind", SELF_JOINED)
def test_what_runs_round_in_a_part_joined_to_itself_is_zero_and_named(kind: str) -> None:
    """Its two flanges are connected to each other alone, or lie on a driven shaft: the motion is determined, the inner torque not."""
    part = (kind, SELF_JOINED[kind])
    if kind == "Inertia":
        system = gl.compile(Lump(**lump({"part": part}, ("part.flange_a", "part.flange_b"))))
        result = system.simulate(1.0, samples=3, start={"part.w": 2.0})
        assert [result[n][-1] for n in ("part.phi", "part.w", "der(part.w)", "part.flange_b.tau")] == [2.0, 2.0, 0.0, 0.0]
        assert "these are zero: part.flange_b.tau" in system.summary()
    described = lump(
        {"drive": ("Torque", {}), "body": ("Inertia", {"J": 1.0}), "part": part},
        ("drive.flange", "body.flange_a", "part.flange_a", "part.flange_b"),
    )
    for order in range(3):
        system = gl.compile(Lump(**described, seed=order))
        result = system.simulate(1.0, samples=2, inputs={"drive.tau": 6.0})
        assert result["body.w"][-1] == pytest.approx(2.0 if kind == "Inertia" else 6.0)
        carried = 4.0 if kind == "Inertia" else 0.0  # what accelerates it
        assert result["part.flange_a.tau"][-1] + result["part.flange_b.tau"][-1] == pytest.approx(carried)
        if kind == "MultiSensor":
            assert [result[n][-1] for n in ("part.w", "part.tau", "part.power")] == pytest.approx([6.0, 0.0, 0.0])
        assert any(f"these are zero: part.{name}" in system.summary() for name in ("flange_b.tau", "tau"))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["TorqueSensor", "PowerSensor", "MultiSensor"])
def test_a_sensor_beside_a_body_that_joins_the_same_two_nodes(kind: str, seed: int) -> None:
    """The body's two ends are one through the sensor; the torques of what is driven through it are determined."""
    described = lump(
        {
            "torque": ("Torque", {"tau": 6.0}), "a": ("Inertia", {"J": 1.0}), "b": ("Inertia", {"J": 2.0}), "sensor": (kind, {}),
        },
        ("torque.flange", "a.flange_a", "sensor.flange_a"), ("a.flange_b", "sensor.flange_b", "b.flange_a"),
    )  # fmt: skip
    system = gl.compile(Lump(**described, seed=seed))
    result = system.simulate(1.0, samples=2)
    assert result["b.w"] == pytest.approx([0.0, 2.0])
    assert result["b.flange_a.tau"] == pytest.approx([4.0, 4.0])
    assert "these are zero: sensor" in system.summary()
    carries = float(result["sensor.flange_a.tau"][-1])
    assert carries == pytest.approx(0.0, abs=1e-12)  # the body carries it all


@pytest.mark.parametrize("angle", [0.25, -1.0])
def test_a_disc_that_turns_a_shaft_against_itself_is_refused(angle: float) -> None:
    described = lump({"body": ("Inertia", {"J": 1.0}), "disc": ("Disc", {"delta_phi": angle})},
                     ("body.flange_a", "disc.flange_a", "disc.flange_b"))  # fmt: skip
    with pytest.raises(gl.GearlibError, match="contradict each other: disc"):
        gl.compile(Lump(**described))


class TwoDiscs(gl.Component):
    """Two shafts side by side, each with an angle between its ends."""

    def assemble(self) -> list[Any]:
        self.a, self.b, self.body = gp.Disc(delta_phi=0.2), gp.Disc(delta_phi=0.3), gp.Inertia(J=1.0)
        return [
            gl.connect(self.a.flange_a, self.b.flange_a, self.body.flange_a),
            gl.connect(self.a.flange_b, self.b.flange_b),
        ]


def test_angles_that_contradict_each_other_force_nothing_to_stand_still() -> None:
    with pytest.raises(gl.GearlibError, match=r"rigid loop through (a, b|b, a) cannot turn: its ratios contradict each other"):
        gl.compile(TwoDiscs())


@pytest.mark.parametrize("gears", [("one", "two"), ("two", "one")])
def test_gears_that_disagree_beside_a_ground_are_one_loop(gears: tuple[str, str]) -> None:
    """Only an angle that two parts hold is held twice."""

    class Held(gl.Component):
        def assemble(self) -> list[Any]:
            self.wall, self.body = gp.Fixed(phi0=0.3), gp.Inertia(J=1.0)
            first, second = gp.IdealGear(ratio=2.0), gp.IdealGear(ratio=3.0)
            setattr(self, gears[0], first)
            setattr(self, gears[1], second)
            return [
                gl.connect(self.wall.flange, first.flange_a, second.flange_a),
                gl.connect(self.body.flange_a, first.flange_b, second.flange_b),
            ]

    with pytest.raises(gl.GearlibError) as told:
        gl.compile(Held())
    said = str(told.value)
    assert said.endswith(
        " cannot turn: its ratios contradict each other; check the ratios of these components, or make one of the connections elastic"
    )
    assert said.startswith("the rigid loop through ")
    assert sorted(said.removeprefix("the rigid loop through ").partition(" cannot")[0].split(", ")) == ["one", "two", "wall"]


@pytest.mark.parametrize("kind", ["phi", "tau"])
@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_an_equation_that_its_class_says_twice_is_no_redundant_connection(factor: float, kind: str) -> None:
    """Beside another part it would be; here a torque would be zero in place of the law that is missing."""

    class Twice(gl.Component):
        flange_a, flange_b = gp.Flange(), gp.Flange()

        def equations(self) -> list[Any]:
            a, b = (getattr(flange, kind) for flange in (self.flange_a, self.flange_b))
            return [gl.Eq(a, 3 * b), gl.Eq(factor * a, 3 * factor * b)]

    class Model(gl.Component):
        def assemble(self) -> list[Any]:
            self.drive, self.a, self.link, self.wall = gp.Torque(tau=5.0), gp.Inertia(J=1.0), Twice(), gp.Fixed()
            ends = (
                (self.drive.flange, self.a.flange_a),
                (self.a.flange_b, self.link.flange_a),
                (self.link.flange_b, self.wall.flange),
            )
            return [gl.connect(*pair) for pair in ends]

    with pytest.raises(gl.GearlibError, match=r"one of these equations follows from the others: Twice: .*; Twice: "):
        gl.compile(Model())


@pytest.mark.parametrize("name", ["one", "other"])
def test_flows_beside_an_equation_are_those_of_its_component(name: str) -> None:
    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.body, self.load = gp.Inertia(J=1.0), gp.Inertia(J=1.0)
            self.one, self.other = gp.IdealGear(ratio=2.0), gp.IdealGear(ratio=3.0)
            return [
                gl.connect(self.body.flange_b, self.one.flange_a),
                gl.connect(self.one.flange_b, self.other.flange_a),
                gl.connect(self.other.flange_b, self.load.flange_a),
            ]

    model = gl.compile(Train()).translation.model
    places = [
        (g, i)
        for g, group in enumerate(model.groups)
        for i, owner in enumerate(group.owners.tolist())
        if owner >= 0 and model.instances[owner].path == name
    ]
    assert places
    flows = {int(model.representative[model.variable(f"{name}.{flange}.tau")]) for flange in ("flange_a", "flange_b")}
    assert flows_beside(model, places) == flows


def test_flows_beside_an_equation_of_the_outermost_component_are_its_own() -> None:
    model = flatten(gp.IdealGear(ratio=2.0))
    flows = {int(model.representative[model.variable(f"{flange}.tau")]) for flange in ("flange_a", "flange_b")}
    assert flows_beside(model, [(g, i) for g, i in model.places if model.groups[g].owners[i] == 0]) == flows


def test_what_is_set_to_zero_is_named_by_flanges_in_any_order() -> None:
    """Partial sums of flows at a connection set with many flanges follow its order; their names must not be told."""
    described = lump(
        {
            "one": ("Inertia", {"J": 1.0}), "two": ("Inertia", {"J": 2.0}), "disc": ("Disc", {}), "load": ("Inertia", {"J": 3.0}),
            "sensor": ("RelAccSensor", {}), "shaft": ("Damper", {"d": 1.0}), "drag": ("Damper", {"d": 2.0}), "ground": ("Fixed", {}),
        },
        (*(f"{n}.flange_{side}" for n in ("one", "two", "disc") for side in "ab"), "load.flange_b", "sensor.flange_a", "drag.flange_b"),
        ("sensor.flange_b", "shaft.flange_a"), ("shaft.flange_b", "load.flange_a"), ("drag.flange_a", "ground.flange"),
    )  # fmt: skip
    told = {
        line
        for seed in range(12)
        for line in gl.compile(Lump(**described, seed=seed)).summary().split("\n")
        if line.startswith("  redundant")
    }
    assert len(told) == 1
    assert "flow_sum" not in min(told)


@given(st.integers(0, 10_000))
def test_what_is_set_to_zero_are_the_first_that_leave_the_others_determined(seed: int) -> None:
    """Brute force over an order: the first column without which the rest has the same rank, then the next, ..."""
    rng = np.random.default_rng(seed)
    m, n = int(rng.integers(1, 5)), int(rng.integers(1, 7))
    A = rng.choice([0.0, 1.0, -1.0, 2.0], (m, n))
    order = rng.permutation(n)[: int(rng.integers(0, n + 1))].tolist()
    rows = [{j: float(a) for j, a in enumerate(row) if a} for row in A]
    left = list(range(n))
    zero = []
    for v in order:
        rest = [u for u in left if u != v]
        if np.linalg.matrix_rank(A[:, rest]) == np.linalg.matrix_rank(A[:, left]) if rest else not A[:, left].any():
            zero.append(v)
            left = rest
    assert left_open(rows, order) == zero
