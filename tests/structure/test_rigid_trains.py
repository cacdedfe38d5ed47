"""Rigid trains: whatever is connected, one degree of freedom with the closed form's inertia."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gearlib as gl
import gearparts as gp
from gearlib.errors import BalanceError

c = gl.connect
inertia = st.floats(1e-3, 1e3)
ratio = st.floats(0.2, 5.0) | st.floats(-5.0, -0.2)


class XP(gl.Component):
    """The XP single-loop train without compliance: torque on the ring, the P unit closes the loop from carrier to sun."""

    i0 = gl.Parameter("1", "ring over sun teeth", default=3.0)
    i_p = gl.Parameter("1", "speed of the sun over speed of the carrier", default=0.4)
    order = gl.Structural(0, "seed of the order in which parts are made and connected")

    def assemble(self) -> list[Any]:
        parts = {
            "torque": lambda: gp.Torque(tau=7.0),
            "planetary": lambda: gp.IdealPlanetary(ratio=self.i0),
            "closing": lambda: gp.IdealGear(ratio=self.i_p),
            **{
                name: (lambda j=j: gp.Inertia(J=j))
                for name, j in (("sun", 0.3), ("carrier", 2.0), ("ring", 1.5), ("pinion", 0.1))
            },
        }
        links = [
            ("torque.flange", "ring.flange_a"),
            ("ring.flange_b", "planetary.ring"),
            ("planetary.sun", "sun.flange_a"),
            ("sun.flange_b", "pinion.flange_a"),
            ("pinion.flange_b", "closing.flange_a"),
            ("closing.flange_b", "carrier.flange_a"),
            ("carrier.flange_b", "planetary.carrier"),
        ]
        shuffle = random.Random(self.order)
        names = list(parts)
        if self.order:
            shuffle.shuffle(names)
            shuffle.shuffle(links)
            links = [(b, a) if shuffle.random() < 0.5 else (a, b) for a, b in links]
        for name in names:
            setattr(self, name, parts[name]())

        def port(path: str) -> Any:
            part, connector = path.split(".")
            return getattr(getattr(self, part), connector)

        return [c(port(a), port(b)) for a, b in links]


def speeds(i0: float, i_p: float) -> dict[str, float]:
    """Relative to the carrier, by Willis' equation."""
    return {"carrier": 1.0, "sun": i_p, "pinion": i_p, "ring": (1 + i0 - i_p) / i0}


@given(st.floats(0.3, 8.0), ratio, inertia, inertia, inertia, inertia, st.floats(-100.0, 100.0))
def test_xp_train_accelerates_as_its_equivalent_inertia(
    i0: float, i_p: float, sun: float, carrier: float, ring: float, pinion: float, tau: float
) -> None:
    inertias = {"sun": sun, "carrier": carrier, "ring": ring, "pinion": pinion}
    given_ = {"i0": i0, "i_p": i_p, "torque.tau": tau} | {f"{k}.J": v for k, v in inertias.items()}
    result = SYSTEM.simulate(1e-3, samples=2, parameters=given_)
    ratio_to_carrier = speeds(i0, i_p)
    equivalent = sum(inertias[k] * ratio_to_carrier[k] ** 2 for k in inertias)
    expected = tau * ratio_to_carrier["ring"] / equivalent
    for name, turns in ratio_to_carrier.items():
        error = abs(result[f"der({name}.w)"][0] - expected * turns)
        assert error <= 1e-12 * abs(expected) * max(1.0, abs(turns))


SYSTEM = gl.compile(XP())


def test_xp_train_has_one_degree_of_freedom() -> None:
    assert len(SYSTEM.states) == 1
    assert "2 possible, 1 integrated" in SYSTEM.summary()


def histories(component: gl.Component, names: list[str]) -> Any:
    result = gl.simulate(component, 1.0, samples=11)
    return np.array([result[n] for n in names])


@pytest.mark.parametrize("seed", range(1, 9))
def test_order_of_parts_and_connections_changes_the_last_digits_only(seed: int) -> None:
    names = ["carrier.w", "ring.w", "sun.phi", "planetary.ring.tau", "closing.flange_b.tau", "pinion.flange_b.tau"]
    one, other = histories(XP(), names), histories(XP(order=seed), names)
    assert np.abs(one - other).max(axis=1) == pytest.approx(0.0, abs=1e-13 * np.abs(one).max())


def random_train(seed: int) -> tuple[type[gl.Component], Any, Any]:
    """Bodies whose speeds relative to the first are drawn; gears and planetary sets that agree with them, loops included."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    turns = rng.uniform(0.4, 2.5, n) * rng.choice([-1, 1], n)
    turns[0] = 1.0
    inertias = rng.uniform(0.1, 10.0, n)
    pairs = [(int(rng.integers(i)), i) for i in range(1, n)]
    pairs += [tuple(rng.choice(n, 2, replace=False).tolist()) for _ in range(int(rng.integers(0, 4)))]
    sets = [rng.choice(n, 3, replace=False).tolist() for _ in range(int(rng.integers(0, 3)) if n > 2 else 0)]
    # (1 + k) carrier = sun + k ring
    sets = [(s, h, r, (turns[s] - turns[h]) / (turns[h] - turns[r])) for s, h, r in sets]
    sets = [x for x in sets if 0.05 < abs(x[3]) < 20 and abs(1 + x[3]) > 0.05]

    class Train(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque = gp.Torque(tau=3.0)
            self.body = [gp.Inertia(J=float(j)) for j in inertias]
            self.gear = [gp.IdealGear(ratio=float(turns[a] / turns[b])) for a, b in pairs]
            self.set = [gp.IdealPlanetary(ratio=float(k)) for *_, k in sets]
            links = [c(self.torque.flange, self.body[0].flange_a)]
            for gear, (a, b) in zip(self.gear, pairs):
                links += [c(self.body[a].flange_b, gear.flange_a), c(gear.flange_b, self.body[b].flange_a)]
            for planetary, (s, h, r, _) in zip(self.set, sets):
                links += [
                    c(planetary.sun, self.body[s].flange_b),
                    c(planetary.carrier, self.body[h].flange_a),
                    c(planetary.ring, self.body[r].flange_b),
                ]
            return links

    return Train, turns, inertias


@given(st.integers(0, 10_000))
def test_random_trains_with_redundant_loops(seed: int) -> None:
    train, turns, inertias = random_train(seed)
    system = gl.compile(train())
    assert len(system.states) == 1
    result = system.simulate(1.0, samples=2)
    expected = 3.0 / float(inertias @ turns**2) * turns
    for i, acceleration in enumerate(expected):
        assert result[f"der(body[{i}].w)"][0] == pytest.approx(acceleration, rel=1e-10)
        assert result[f"body[{i}].w"][-1] == pytest.approx(acceleration, rel=1e-10)


def test_chain_of_inertias_and_ideal_gears() -> None:
    n = 40

    class Chain(gl.Component):
        def assemble(self) -> list[Any]:
            self.torque = gp.Torque(tau=1.0)
            self.body = [gp.Inertia(J=1.0) for _ in range(n)]
            self.gear = [gp.IdealGear(ratio=1.1) for _ in range(n - 1)]
            links = [c(self.torque.flange, self.body[0].flange_a)]
            for a, gear, b in zip(self.body, self.gear, self.body[1:]):
                links += [c(a.flange_b, gear.flange_a), c(gear.flange_b, b.flange_a)]
            return links

    system = gl.compile(Chain())
    assert len(system.states) == 1
    expected = 1 / sum(1.1 ** (-2 * i) for i in range(n))
    assert system.simulate(1.0, samples=2)["body[0].w"][-1] == pytest.approx(expected, rel=1e-12)


def test_geared_shafts_of_friswell() -> None:
    """Friswell et al., Dynamics of Rotating Machines (2010): 0, 425.4, 634.1 and 3247.2 Hz."""

    class Shafts(gl.Component):
        def assemble(self) -> list[Any]:
            self.motor, self.gear, self.meshing = gp.Inertia(J=400e-6), gp.Inertia(J=25e-6), gp.Inertia(J=25e-6)
            self.rotor = [gp.Inertia(J=700e-6) for _ in range(2)]
            self.shaft = [gp.Spring(c=1e4), gp.Spring(c=5e3), gp.Spring(c=5e3)]
            self.pair = gp.IdealGear(ratio=-1.0)
            return [
                c(self.motor.flange_b, self.shaft[0].flange_a),
                c(self.shaft[0].flange_b, self.gear.flange_a, self.pair.flange_a, self.shaft[1].flange_a),
                c(self.pair.flange_b, self.meshing.flange_a, self.shaft[2].flange_a),
                c(self.shaft[1].flange_b, self.rotor[0].flange_a),
                c(self.shaft[2].flange_b, self.rotor[1].flange_a),
            ]

    linear = gl.compile(Shafts()).linearize()
    hertz = np.unique(np.round(np.abs(np.linalg.eigvals(linear.A)) / (2 * np.pi), 1))
    assert hertz[-3:].tolist() == [425.4, 634.1, 3247.2]
    assert np.abs(hertz[:-3]).max() < 0.1


@pytest.mark.parametrize("second", ["lossy", "ideal"])
def test_losses_in_a_rigid_loop_are_refused_with_the_remedy(second: str) -> None:
    """Two paths of one ratio: how they share the torque decides what is lost, and nothing decides how they share it."""

    class Paths(gl.Component):
        elastic = gl.Structural(False)

        def assemble(self) -> list[Any]:
            losses = ((0.0, 0.9, 0.8, 0.1, 0.1),)
            self.torque, self.inlet, self.outlet = gp.Torque(tau=5.0), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.upper = gp.LossyGear(ratio=2.0, loss_table=losses)
            self.lower = gp.LossyGear(ratio=2.0, loss_table=losses) if second == "lossy" else gp.IdealGear(ratio=2.0)
            links = [
                c(self.torque.flange, self.inlet.flange_a),
                c(self.inlet.flange_b, self.upper.flange_a, self.lower.flange_a),
                c(self.upper.flange_b, self.outlet.flange_a),
            ]
            if self.elastic:
                self.shaft = gp.SpringDamper(c=1e4, d=10.0)
                return [*links, c(self.lower.flange_b, self.shaft.flange_a), c(self.shaft.flange_b, self.outlet.flange_b)]
            return [*links, c(self.lower.flange_b, self.outlet.flange_b)]

    with pytest.raises(
        BalanceError, match=r"rigid loop goes through (upper, lower|lower, upper): .*Make one of the paths elastic"
    ):
        gl.compile(Paths())
    assert gl.compile(Paths(elastic=True)).simulate(0.01, samples=3)["outlet.w"][-1] > 0


def test_of_many_loops_the_message_names_some() -> None:
    class Paths(gl.Component):
        def assemble(self) -> list[Any]:
            losses = ((0.0, 0.9, 0.8, 0.1, 0.1),)
            self.torque, self.inlet, self.outlet = gp.Torque(tau=5.0), gp.Inertia(J=1.0), gp.Inertia(J=2.0)
            self.path = [gp.LossyGear(ratio=2.0, loss_table=losses) for _ in range(60)]
            return [
                c(self.torque.flange, self.inlet.flange_a),
                c(self.inlet.flange_b, *(p.flange_a for p in self.path)),
                c(self.outlet.flange_a, *(p.flange_b for p in self.path)),
            ]

    with pytest.raises(BalanceError, match=r"rigid loop goes through path\[.*; and 51 more: its paths share") as refused:
        gl.compile(Paths())
    assert len(str(refused.value)) < 1000


def test_what_lacks_an_equation_beside_a_rigid_loop_is_named() -> None:
    """The loop is not blamed for it."""

    class Open(gl.Component):
        x, y = gl.Variable("1"), gl.Variable("1")

        def assemble(self) -> list[Any]:
            self.body = gp.Inertia(J=1.0)
            self.gear = [gp.IdealGear(ratio=2.0) for _ in range(2)]
            return [c(self.body.flange_a, *(g.flange_a for g in self.gear)), c(*(g.flange_b for g in self.gear))]

        def equations(self) -> list[gl.Eq]:
            return [gl.Eq(self.x + self.y, 1)]

    with pytest.raises(BalanceError, match=r"under-determined: .*The variables: x; y\."):
        gl.compile(Open())
